//! Momentum in the form each scheme conserves, and the closure of impulses.

use contact_dynamics::contact_solver::{ContactFailure, ContactProblem};
use contact_dynamics::tableau::{A, Rows, Stage, Tableau, U, V, Z};
use contact_dynamics::{
    ActiveSet, Bathe, Bdf2, Composite, ContactSolver, Corrector, GeneralizedAlpha, Houbolt, LinearRows, LinearSystem,
    Newmark, Park, PersistencyCorrection, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::schemes::{Listed, Tabulated, all};
use contact_dynamics_scenes::sparse::matrix;
use contact_dynamics_scenes::{Bars, MassKind, Record, record};
use std::sync::{Arc, Mutex};

type Scheme = fn() -> Box<dyn TimeIntegrator>;

fn one_step() -> impl Iterator<Item = Listed> {
    all().into_iter().filter(|scheme| scheme.takes_multipliers() && (scheme.make)().tableau().depth() == 1)
}

fn multistep() -> impl Iterator<Item = Listed> {
    all().into_iter().filter(|scheme| (scheme.make)().tableau().depth() > 1)
}

fn corrections() -> [Option<PersistencyCorrection>; 5] {
    use contact_dynamics::corrector::Parts;
    let full = PersistencyCorrection::with_history_projection();
    [
        None,
        Some(full.parts(Parts::Velocity)),
        Some(full.parts(Parts::Acceleration)),
        Some(PersistencyCorrection::new()),
        Some(full),
    ]
}

fn scenes(h: f64) -> Vec<Bars> {
    let resting = |bars: Bars| Bars { velocity: [0.1, 0.0], ..bars };
    let equal = Bars::paper(20).delayed(0.37, h);
    let unequal = Bars { elements: [30, 20], length: [10.0, 20.0], ..Bars::paper(20) }.delayed(0.61, h);
    vec![equal, resting(equal), unequal, Bars::dissimilar(20).delayed(0.13, h)]
}

/// Steps, the bars, and when a run ends: at the smallest steps the impact is near, and runs end as many steps behind it.
fn by_steps() -> impl Iterator<Item = (f64, Bars, f64)> {
    [(1e-3, 1.0, 0.5), (1e-4, 1.0, 0.4), (1e-5, 0.1, 0.06)].into_iter().flat_map(|(h, near, until)| {
        scenes(h).into_iter().map(move |bars| (h, Bars { gap: near * bars.gap, ..bars }, until))
    })
}

fn run(bars: &Bars, scheme: Scheme, correction: Option<PersistencyCorrection>, h: f64, until: f64) -> Record {
    record::<f64>(bars, scheme(), correction.map(|c| Box::new(c) as Box<dyn Corrector<f64>>), h, until)
}

#[test]
fn impulses_close_for_every_scheme_and_correction() {
    for listed in one_step().chain(multistep()) {
        let scheme = listed.make;
        let corrected = |correction: &Option<_>| correction.is_none() || listed.takes_corrections();
        for correction in corrections().into_iter().filter(corrected) {
            for bars in scenes(1e-3) {
                for mass in [MassKind::Lumped, MassKind::Consistent] {
                    let found = run(&bars.with_mass(mass), scheme, correction, 1e-3, 0.5);
                    let case = format!("{}, {correction:?}, {bars:?}, {mass:?}", scheme().name());
                    assert!(found.total_impulse > 1e-3, "no impact: {case}");
                    assert!(found.closure() < 1e-9, "{:e}: {case}", found.closure());
                }
            }
        }
    }
}

#[test]
fn one_step_schemes_conserve_momentum_to_rounding() {
    for listed in one_step() {
        let scheme = listed.make;
        let corrected = listed.takes_corrections().then(|| Some(PersistencyCorrection::new()));
        for correction in std::iter::once(None).chain(corrected) {
            for (h, bars, until) in by_steps() {
                let found = run(&bars, scheme, correction, h, until);
                let case = format!("{}, {correction:?}, h = {h}, {bars:?}", scheme().name());
                assert!(found.total_impulse > 1e-4, "no impact: {case}");
                // Bathe's raw spikes at h = 1e-5 are large enough to round a little more.
                let bound = if scheme().tableau().stages.len() > 1 { 1e-11 } else { 1e-12 };
                assert!(found.drift() < bound, "{:e}: {case}", found.drift());
            }
        }
    }
}

#[test]
fn multistep_drift_grows_no_faster_than_rounding_of_displacements() {
    for Listed { make: scheme, .. } in multistep() {
        for correction in [None, Some(PersistencyCorrection::with_history_projection())] {
            for (h, bars, until) in by_steps() {
                let found = run(&bars, scheme, correction, h, until);
                let largest = |x: &[[f64; 2]]| x.iter().flatten().fold(0.0_f64, |a, b| a.max(b.abs()));
                let speed = bars.velocity.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
                // steps · eps · |u| / (h |v|)
                let bound = found.t.len() as f64 * f64::EPSILON * largest(&found.u) / (h * speed);
                let case = format!("{}, {correction:?}, h = {h}, {bars:?}", scheme().name());
                assert!(found.drift() < bound, "{:e} over {bound:e}: {case}", found.drift());
                assert!(h < 1e-3 || found.drift() < 1e-10, "{:e}: {case}", found.drift());
            }
        }
    }
}

#[test]
fn one_step_schemes_conserve_momentum_in_single_precision() {
    for listed in one_step() {
        let scheme = listed.make;
        let corrected = listed.takes_corrections().then(|| Some(PersistencyCorrection::new()));
        for correction in std::iter::once(None).chain(corrected) {
            for h in [1e-3, 1e-4] {
                for bars in scenes(h) {
                    let corrector = correction.map(|c| Box::new(c) as Box<dyn Corrector<f32>>);
                    let found = record::<f32>(&bars, scheme(), corrector, h, 0.3);
                    let case = format!("{}, {correction:?}, h = {h}, {bars:?}", scheme().name());
                    assert!(found.drift() < 1e-5, "{:e}: {case}", found.drift());
                }
            }
        }
    }
}

#[test]
fn weights_of_the_functional_are_those_derived_by_hand() {
    let psi = |scheme: &dyn TimeIntegrator| scheme.tableau().momentum();
    // Newmark and α-schemes: V0 + (1 − γ − α_m) A0.
    let found = psi(&Newmark::new(0.3025, 0.6).unwrap()).after_step();
    assert!((found[0][1] - 1.0).abs() < 1e-12 && (found[0][2] - 0.4).abs() < 1e-12 && found[0][0].abs() < 1e-12);
    let (alpha_m, gamma) = (0.6 / 1.8, 0.5 - 0.6 / 1.8 + 0.8 / 1.8);
    let found = psi(&GeneralizedAlpha::chung_hulbert(0.8).unwrap()).after_step();
    assert!((found[0][2] - (1.0 - gamma - alpha_m)).abs() < 1e-12, "{found:?}");
    // Composite: (U0 − U1) + (V0 − V1).
    let found = psi(&Composite).after_step();
    for (k, sign) in [(0, 1.0), (1, -1.0)] {
        assert!((found[k][0] - sign).abs() < 1e-12 && (found[k][1] - sign).abs() < 1e-12 && found[k][2].abs() < 1e-12);
    }
    // Houbolt 2 U0 − 3 U1 + U2; Park (10 V0 − 5 V1 + V2)/6; BDF2 (3 V0 − V1)/2.
    let displacement = |c: f64| [c, 0.0, 0.0];
    let velocity = |c: f64| [0.0, c, 0.0];
    let cases: [(&dyn TimeIntegrator, Vec<[f64; 3]>); 3] = [
        (&Houbolt, [2.0, -3.0, 1.0].map(displacement).to_vec()),
        (&Park, [10.0, -5.0, 1.0].map(|c| velocity(c / 6.0)).to_vec()),
        (&Bdf2, [1.5, -0.5].map(velocity).to_vec()),
    ];
    for (scheme, expected) in cases {
        let found = psi(scheme);
        for (found, expected) in found.after_step().iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-12, "{}", scheme.name());
        }
        assert!((found.impulse_weights()[0] - 1.0).abs() < 1e-12);
    }
    // Bathe: the stages share the impulse as √2/4 and 1 − √2/4.
    let weights = psi(&Bathe::default()).impulse_weights().to_vec();
    assert!((weights[0] - 0.125_f64.sqrt()).abs() < 1e-12 && (weights[0] + weights[1] - 1.0).abs() < 1e-12);
}

#[test]
fn past_states_are_counted_from_the_start_of_the_step() {
    assert_eq!([Bathe::default().tableau().depth(), Park.tableau().depth(), Composite.tableau().depth()], [1, 3, 2]);
    // After the first stage of Bathe's scheme the second reads v of that stage and u of t_n, nothing older.
    let read = Bathe::default().tableau().read_after(0).unwrap();
    assert!(read[0][1] && read[1][0] && !read[2..].iter().flatten().any(|&read| read));
    // The composite scheme reads u and v of the last two states, never a.
    let read = Composite.tableau().read_after(0).unwrap();
    assert_eq!(read[..2], [[true, true, false], [true, true, false]]);
}

#[test]
fn terms_that_cancel_in_increment_form_are_gone() {
    // In Newmark's velocity row the displacements cancel exactly; what rounding would leave of them is eps u/h.
    for i in 1..40 {
        for j in 0..40 {
            let (beta, gamma) = (0.023 * f64::from(i), 0.5 + 0.011 * f64::from(j));
            let rows = Newmark::new(beta, gamma).unwrap().tableau().stages[0].increment().recovery;
            assert_eq!([rows.v.u[0].to_bits(), rows.a.u[0].to_bits()], [0, 0], "β = {beta}, γ = {gamma}");
        }
        // The same in the balance rows of Chung and Hulbert, mixed from old and new.
        let rho = 0.025 * f64::from(i);
        let balance = GeneralizedAlpha::chung_hulbert(rho).unwrap().tableau().stages[0].increment().balance;
        assert_eq!([balance.v.u[0].to_bits(), balance.a.u[0].to_bits()], [0, 0], "ρ = {rho}");
    }
}

/// The composite rows behind a first stage that they do not read: two stages, two operators, a past of two steps.
fn composite_in_two_stages() -> Tabulated {
    let v = 4.0 * (Z - U[0]) - V[0];
    let half = Stage::new(Rows { u: Z, v, a: 16.0 * (Z - U[0] - 0.5 * V[0]) - A[0] }).ending_at(0.5);
    let v = 1.5 * Z - 2.0 * U[1] + 0.5 * U[2];
    let a = (Z - 2.0 * U[1] + U[2]) + (v - 2.0 * V[1] + V[2]);
    Tabulated("composite behind a half step", Tableau::staged(vec![half, Stage::new(Rows { u: Z, v, a })]))
}

#[test]
fn stages_between_drop_out_of_the_past() {
    let run = |scheme: Box<dyn TimeIntegrator>| {
        let bars = Bars { gap: 1e3, ..Bars::paper(10) };
        let velocity: Vec<f64> = (0..bars.dofs()).map(|i| (i as f64).sin()).collect();
        let mut run = Simulation::builder(bars.system::<f64>(), scheme, 5e-3).velocity(velocity).build().unwrap();
        run.run_until(2.0, &mut ()).unwrap();
        run.state().clone()
    };
    let (one, two) = (run(Box::new(Composite)), run(Box::new(composite_in_two_stages())));
    for (x, y) in one.displacement().iter().zip(two.displacement()) {
        assert!((x - y).abs() < 1e-13, "{x} {y}");
    }
    for (x, y) in one.acceleration().iter().zip(two.acceleration()) {
        assert!((x - y).abs() < 1e-7 * one.acceleration().iter().fold(0.0, |a: f64, b| a.max(b.abs())), "{x} {y}");
    }
    // The whole machinery of stages over a past: impulses close through impact and correction.
    for bars in scenes(1e-3) {
        for correction in corrections() {
            let found = record::<f64>(
                &bars,
                composite_in_two_stages(),
                correction.map(|c| Box::new(c) as Box<dyn Corrector<f64>>),
                1e-3,
                0.5,
            );
            assert!(found.total_impulse > 1e-3 && found.closure() < 1e-9, "{:e}, {correction:?}", found.closure());
        }
    }
}

/// The active set, and the raw multiplier of the one row that it solves for, solve by solve.
#[derive(Debug, Default)]
struct Heard(ActiveSet, Arc<Mutex<Vec<f64>>>);

impl ContactSolver<f64> for Heard {
    fn solve(
        &mut self,
        problem: &ContactProblem<'_, f64>,
        multipliers: &mut [f64],
    ) -> Result<usize, ContactFailure<f64>> {
        let iterations = self.0.solve(problem, multipliers)?;
        self.1.lock().unwrap().push(multipliers[0]);
        Ok(iterations)
    }
}

/// Two masses tied together, a load on the first: the second gets all its momentum from the tie, in every stage.
#[test]
fn impulse_weights_are_what_a_run_books() {
    let alpha_m = |alpha_m| Box::new(GeneralizedAlpha::new(alpha_m, 0.2, 0.4, 0.7).unwrap());
    let listed = all().into_iter().filter(Listed::takes_multipliers).map(|listed| (listed.make)());
    let schemes: Vec<Box<dyn TimeIntegrator>> =
        listed.chain([-0.7, 0.45].map(|a| alpha_m(a) as Box<dyn TimeIntegrator>)).collect();
    for scheme in schemes {
        let (name, tableau) = (scheme.name(), scheme.tableau());
        let weights = tableau.momentum().impulse_weights().to_vec();
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{name}: {weights:?}");
        let k = matrix(2, [(0, 0, 3.0)]);
        let system =
            LinearSystem::lumped(vec![0.7, 1.9], k).unwrap().load(|t, force| force[0] += 2.0 + (9.0 * t).sin());
        let heard = Heard::default();
        let (said, h) = (Arc::clone(&heard.1), 0.05);
        let mut run = Simulation::builder(system, scheme, h)
            .constraint(LinearRows::new().equality(&[(0, -1.0), (1, 1.0)], 0.0))
            .contact_solver(heard)
            .uncorrected()
            .build()
            .unwrap();
        // The steps that start a multistep scheme are another scheme's.
        (0..tableau.depth()).for_each(|_| run.step().unwrap());
        for _ in 0..20 {
            let before = run.momentum(&[0.0, 1.0]).unwrap();
            said.lock().unwrap().clear();
            run.step().unwrap();
            let change = run.momentum(&[0.0, 1.0]).unwrap() - before;
            let multipliers = said.lock().unwrap();
            assert_eq!(multipliers.len(), weights.len(), "{name}");
            let impulse: f64 = weights.iter().zip(multipliers.iter()).map(|(beta, lambda)| h * beta * lambda).sum();
            assert!((impulse - change).abs() < 1e-11, "{name}: {impulse:e}, not {change:e}");
            assert!(impulse.abs() > 1e-3, "{name}");
        }
    }
}
