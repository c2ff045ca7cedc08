//! Nothing that is NaN or infinite is published, whoever made it, and a step that fails leaves no trace.

use contact_dynamics::contact::{ContactLaw, GapFunction, GapOffset, NodesOnObstacle, Plane};
use contact_dynamics::contact_solver::{ContactFailure, ContactProblem, ContactSolver};
use contact_dynamics::corrector::{ContactStabilized, LaursenLove, Release, TaylorPapadopoulos};
use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMat};
use contact_dynamics::observer::EnergyRecorder;
use contact_dynamics::tableau::{A, ContactLevel, Row, Rows, Stage, Tableau, U, V, Z};
use contact_dynamics::{
    Bathe, CdLagrange, CentralDifference, Composite, Corrector, EnergyMomentum, Error, GeneralizedAlpha, Gssss,
    LinearRows, LinearSystem, Linearity, MoreauJean, Newmark, Park, PersistencyCorrection, Real, Simulation,
    SimulationBuilder, TimeIntegrator,
};
use contact_dynamics_scenes::hosts::Hooked;
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::schemes::Tabulated;
use contact_dynamics_scenes::sparse::diagonal;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A full matrix of sums.
fn matrix<T: Real>(n: usize, entries: &[(usize, usize, f64)]) -> SparseColMat<usize, T> {
    let mut sums = vec![0.0; n * n];
    for &(i, j, x) in entries {
        sums[j * n + i] += x;
    }
    let starts = (0..=n).map(|j| j * n).collect();
    let pattern = SymbolicSparseColMat::new_checked(n, n, starts, None, (0..n * n).map(|k| k % n).collect());
    SparseColMat::new(pattern, sums.into_iter().map(T::of).collect())
}

/// Everything that a run shows.
fn is_finite<T: Real>(run: &Simulation<'_, T>) -> bool {
    let state = run.state();
    let contacts = state.contacts();
    let mut shown = vec![
        state.displacement(),
        state.velocity(),
        state.acceleration(),
        state.stored_velocity(),
        state.stored_acceleration(),
        contacts.gaps(),
        contacts.forces(),
        contacts.raw_forces(),
        contacts.impulses(),
        contacts.lambda_v(),
        contacts.lambda_a(),
        contacts.dissipated(),
    ];
    for k in 1..=run.history().len() {
        let (u, v, a) = run.history().past(k).unwrap();
        shown.extend([u, v, a]);
    }
    shown.into_iter().flatten().all(|x| x.is_finite())
}

/// State and past, to be compared bit for bit.
fn trace<T: Real>(run: &Simulation<'_, T>) -> String {
    let history = run.history();
    let past: Vec<_> = (1..=history.len()).map(|k| history.past(k)).collect();
    format!("{:?} {past:?} {:e}", run.state(), history.step_size())
}

/// A host function, or a part of what one returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Force,
    Damping,
    Load,
    Tangent,
    Support(usize),
    Offset(usize),
    Function(usize),
    Gradient,
    Shift(usize),
}

/// Says when a part of the host fails: at one of its calls, counted from when it was armed.
#[derive(Clone, Debug)]
struct Fault {
    part: Part,
    value: f64,
    left: Arc<AtomicUsize>,
}

/// Calls that never come.
const DISARMED: usize = usize::MAX / 2;

impl Fault {
    fn of(&self, part: Part) -> f64 {
        match part == self.part && self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            true => self.value,
            false => 0.0,
        }
    }
    fn arm(&self, call: usize) {
        self.left.store(call, Ordering::Relaxed);
    }
    /// Whether it has happened.
    fn is_past(&self) -> bool {
        !(1..=DISARMED).contains(&self.left.load(Ordering::Relaxed))
    }
}

const H: f64 = 0.02;

/// A chain of three masses, the first one driven; that at the end meets a wall that moves, the one in the middle a
/// function and an obstacle.
fn faulty(
    scheme: Box<dyn TimeIntegrator>,
    correctors: Vec<Box<dyn Corrector<f64>>>,
    law: ContactLaw,
    linearity: Linearity,
    fault: &Fault,
) -> SimulationBuilder<'static, f64> {
    let entries = [(0, 0, 9.0), (0, 1, -9.0), (1, 0, -9.0), (1, 1, 18.0), (1, 2, -9.0), (2, 1, -9.0), (2, 2, 9.0)];
    let inner = LinearSystem::lumped(vec![1.0, 1.0, 0.4], matrix(3, &entries)).unwrap();
    // (The contact-stabilized scheme is refused where there is damping.)
    let damped = correctors.iter().all(|corrector| corrector.requirements(&scheme.tableau()).damping.is_ok());
    let inner = match damped {
        true => inner.damping(matrix(3, &entries.map(|(i, j, k)| (i, j, 0.005 * k)))).unwrap(),
        false => inner,
    };
    let inner = inner.load(|t, out| out[1] += 0.3 * t).drive(0, |t| [-0.5 * t, -0.5, 0.0]).unwrap();
    let (wall, function, obstacle) = (fault.clone(), fault.clone(), fault.clone());
    let offset = GapOffset::moving(move |t| {
        let motion = [0.1 + 0.02 * t, 0.02, 0.0];
        [0, 1, 2].map(|k| motion[k] + wall.of(Part::Offset(k)))
    });
    let ball = GapFunction::new(&[1], move |_, x, v, gradient| {
        gradient[0] = 1.0 + 0.1 * x[0] + function.of(Part::Gradient);
        let values = [0.15 + x[0] + 0.05 * x[0] * x[0], 0.0, 0.1 * v[0] * v[0]];
        [0, 1, 2].map(|k| values[k] + function.of(Part::Function(k)))
    });
    let plane =
        NodesOnObstacle::new(Plane::new([0.0], [1.0]).unwrap(), &[[0.18]], &[[1]], &[0]).unwrap().moving(move |t| {
            [[0.01 * t], [0.01], [0.0]].map(|x| x).into_iter().enumerate().fold([[0.0]; 3], |mut all, (k, x)| {
                all[k] = [x[0] + obstacle.of(Part::Shift(k))];
                all
            })
        });
    let evaluated = fault.clone();
    let host = Hooked::new(inner, move |method, _, out| {
        let parts: &[(usize, Part)] = match method {
            "force" => &[(1, Part::Force)],
            "tangent" => &[(1, Part::Tangent)],
            "external_load" => &[(1, Part::Load)],
            "damping_force" => &[(2, Part::Damping)],
            "prescribed_motion" => &[(0, Part::Support(0)), (1, Part::Support(1)), (2, Part::Support(2))],
            _ => &[],
        };
        for &(k, part) in parts {
            out[k] += evaluated.of(part);
        }
        Ok(())
    });
    Simulation::builder(host.linearity(linearity), scheme, H)
        .velocity(vec![-0.5, -1.0, -1.5])
        .constraint(LinearRows::new().row(law, &[(2, 1.0)], offset))
        .constraint(ball)
        .constraint(plane)
        .uncorrected()
        .correctors(correctors)
        .energy_balance()
}

type Make = fn() -> (Box<dyn TimeIntegrator>, Vec<Box<dyn Corrector<f64>>>, ContactLaw, Linearity);

const RUNS: [Make; 13] = [
    || (Box::new(Newmark::trapezoidal()), history(), ContactLaw::Rigid, Linearity::Linear),
    || (Box::new(Newmark::trapezoidal()), history(), ContactLaw::Rigid, Linearity::Nonlinear),
    || (Box::new(Composite), history(), ContactLaw::Rigid, Linearity::Linear),
    || (Box::new(Composite), Vec::new(), ContactLaw::Bipenalty { stiffness: 400.0, mass: 0.3 }, Linearity::Linear),
    || (Box::new(Bathe::default()), released(), ContactLaw::Penalty { stiffness: 500.0 }, Linearity::Linear),
    || (Box::new(Park), history(), ContactLaw::RateCondition, Linearity::Linear),
    || {
        (
            Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
            history(),
            ContactLaw::PersistencySwitch,
            Linearity::Linear,
        )
    },
    || (Box::new(EnergyMomentum), vec![Box::new(LaursenLove)], ContactLaw::Rigid, Linearity::Nonlinear),
    || {
        (
            Box::new(Gssss::new(1.0, 1.0, 1.0).unwrap()),
            vec![Box::new(LaursenLove)],
            ContactLaw::Rigid,
            Linearity::Linear,
        )
    },
    || {
        (
            Box::new(Newmark::trapezoidal()),
            vec![Box::new(ContactStabilized::new())],
            ContactLaw::Rigid,
            Linearity::Linear,
        )
    },
    || {
        (
            Box::new(MoreauJean::new(0.5).unwrap()),
            Vec::new(),
            ContactLaw::Restitution { coefficient: 0.7 },
            Linearity::Linear,
        )
    },
    || (Box::new(CdLagrange), Vec::new(), ContactLaw::Rigid, Linearity::Linear),
    || (Box::new(CentralDifference), Vec::new(), ContactLaw::Rigid, Linearity::Linear),
];

fn history() -> Vec<Box<dyn Corrector<f64>>> {
    vec![Box::new(PersistencyCorrection::with_history_projection())]
}

fn released() -> Vec<Box<dyn Corrector<f64>>> {
    vec![Box::new(PersistencyCorrection::new()), Box::new(Release), Box::new(TaylorPapadopoulos::new(0.01).unwrap())]
}

const PARTS: [Part; 17] = [
    Part::Force,
    Part::Damping,
    Part::Load,
    Part::Tangent,
    Part::Support(0),
    Part::Support(1),
    Part::Support(2),
    Part::Offset(0),
    Part::Offset(1),
    Part::Offset(2),
    Part::Function(0),
    Part::Function(1),
    Part::Function(2),
    Part::Gradient,
    Part::Shift(0),
    Part::Shift(1),
    Part::Shift(2),
];

/// A host that fails at one call, whichever: the step fails and leaves no trace, and taken again the run is what it
/// would have been. What is never told must not have changed a bit.
#[test]
fn a_host_that_fails_once_costs_a_step_and_nothing_else() {
    const STEPS: usize = 24;
    for (index, make) in RUNS.into_iter().enumerate() {
        let build = |fault: &Fault| {
            let (scheme, correctors, law, linearity) = make();
            faulty(scheme, correctors, law, linearity, fault)
        };
        let quiet = Fault { part: Part::Force, value: 0.0, left: Arc::new(AtomicUsize::new(DISARMED)) };
        let mut clean = build(&quiet).build().unwrap();
        let (mut touched, mut traces) = ([false; 3], Vec::new());
        for _ in 0..STEPS {
            traces.push(trace(&clean));
            clean.step().unwrap();
            clean.state().contacts().closed().iter().zip(&mut touched).for_each(|(closed, touched)| *touched |= closed);
        }
        assert!(touched.iter().filter(|touched| **touched).count() >= 2, "{index}: {touched:?}");
        let expected = (trace(&clean), clean.energy());
        let (mut failures, mut random) = (0, xorshift(index as u64 + 1));
        for part in PARTS {
            // The first calls, and a third of the others, by chance: the same places of a step come again in each.
            for call in 1.. {
                if call > 12 && random() > 1.0 / 3.0 {
                    continue;
                }
                let value = if random() < 0.3 { f64::INFINITY } else { f64::NAN };
                let fault = Fault { part, value, left: Arc::new(AtomicUsize::new(DISARMED)) };
                let mut run = build(&fault).build().unwrap();
                fault.arm(call);
                let case = format!("run {index}, {part:?} {value} at call {call}");
                for (step, before) in traces.iter().enumerate() {
                    if let Err(error) = run.step() {
                        failures += 1;
                        assert!(fault.is_past(), "{case}, step {step}: {error}");
                        assert_eq!(*before, trace(&run), "{case}, step {step}: {error}");
                        run.step().unwrap_or_else(|error| panic!("{case}, step {step} again: {error}"));
                    }
                    assert!(is_finite(&run), "{case}, step {step}: {}", trace(&run));
                }
                assert_eq!(trace(&run), expected.0, "{case}");
                assert_eq!(run.energy(), expected.1, "{case}");
                if !fault.is_past() {
                    break;
                }
            }
        }
        assert!(failures > 150, "{index}: {failures}");
    }
}

/// The same while a run is built: refused, or finite.
#[test]
fn a_host_that_fails_at_the_start_is_refused_or_does_no_harm() {
    for (index, make) in RUNS.into_iter().enumerate() {
        for part in PARTS {
            for call in 1.. {
                let fault = Fault { part, value: f64::NAN, left: Arc::new(AtomicUsize::new(call)) };
                let (scheme, correctors, law, linearity) = make();
                if let Ok(mut run) = faulty(scheme, correctors, law, linearity, &fault).build() {
                    assert!(is_finite(&run), "run {index}, {part:?} at call {call}");
                    let energy = run.energy();
                    assert!(energy.total().is_finite(), "run {index}, {part:?} at call {call}: {energy:?}");
                }
                if !fault.is_past() {
                    break;
                }
            }
        }
    }
}

/// An energy that is no number is not shown to an observer.
#[test]
fn energies_that_are_no_numbers_are_errors() {
    let quiet = Fault { part: Part::Force, value: 0.0, left: Arc::new(AtomicUsize::new(DISARMED)) };
    let builder = faulty(Box::new(Composite), history(), ContactLaw::Rigid, Linearity::Linear, &quiet);
    let error = builder.velocity(vec![-0.5, -1.0, 1e200]).build().unwrap_err();
    assert!(matches!(error, Error::EnergyNotFinite { .. }), "{error}");
    let system = LinearSystem::lumped(vec![1.0], matrix(1, &[(0, 0, 1.0)])).unwrap();
    let mut run = Simulation::builder(system, Composite, 0.01).velocity(vec![1e200]).build().unwrap();
    let mut energies = EnergyRecorder::new();
    let error = run.run_until(0.1, &mut energies).unwrap_err();
    assert!(matches!(error, Error::EnergyNotFinite { .. }), "{error}");
}

/// A tableau of random numbers, some of them whole and many of them zero.
fn random_tableau(draw: &mut impl FnMut() -> f64) -> Tableau {
    let mut number = |share: f64| match draw() {
        x if x > share => 0.0,
        _ if draw() < 0.5 => (4.0 * draw() - 2.0).round(),
        _ => (draw() - 0.5) * 10.0_f64.powf(8.0 * draw() - 4.0),
    };
    let depth = [1, 2, 3].into_iter().find(|_| number(1.0).abs() < 1.0).unwrap_or(1);
    let mut row =
        |z: Row| (0..depth).fold(z, |row, k| row + number(0.6) * U[k] + number(0.5) * V[k] + number(0.4) * A[k]);
    let mut rows = || Rows { u: row(Z), v: row(Z), a: row(Z) };
    let mut stages = vec![Stage::new(rows())];
    if draw() < 0.3 {
        stages.insert(0, Stage::new(Rows { u: Z, v: Z - U[0], a: Z - U[0] - V[0] }).ending_at(0.4));
    }
    let last = stages.len() - 1;
    if draw() < 0.3 {
        let Rows { u, v, a } = stages[last].recovery;
        let mean = Rows { u: 0.5 * (u + U[0]), v: 0.5 * (v + V[0]), a };
        stages[last] = stages[last].balanced(mean, 0.5);
    }
    if draw() < 0.2 {
        stages[last] = stages[last].with_contact(ContactLevel::Position { lead: 1.0 });
    }
    Tableau::staged(stages)
}

/// Runs until something fails; says how many steps were good.
fn survive<T: Real>(builder: SimulationBuilder<'_, T>, case: &str) -> Option<usize> {
    let mut run = builder.build().ok()?;
    assert!(is_finite(&run), "{case}: {run:?}");
    for step in 0..60 {
        let before = trace(&run);
        if run.step().is_err() {
            assert_eq!(before, trace(&run), "{case}, step {step}");
            return Some(step);
        }
        assert!(is_finite(&run), "{case}, step {step}: {}", trace(&run));
    }
    Some(60)
}

fn random_scene<T: Real>(tableau: &Tableau, seed: u64) -> SimulationBuilder<'static, T> {
    let mut draw = xorshift(seed);
    let mut number = |low: f64, high: f64| T::of(low * (high / low).powf(draw()));
    let mut entries = Vec::new();
    for (i, j) in [(0, 1), (1, 2), (2, 3)] {
        let k = number(1e-3, 1e6).value();
        entries.extend([(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)]);
    }
    let mass = (0..4).map(|_| number(1e-3, 1e3)).collect();
    let damping = 1e-3;
    let c: Vec<_> = entries.iter().map(|&(i, j, k)| (i, j, damping * k)).collect();
    let mut system = LinearSystem::lumped(mass, matrix(4, &entries)).unwrap();
    if seed.is_multiple_of(2) {
        system = system.damping(matrix(4, &c)).unwrap();
    }
    let one = T::one();
    let rows = LinearRows::new()
        .unilateral(&[(0, one)], number(1e-3, 1.0))
        .unilateral(&[(1, -one), (2, one)], number(1e-3, 1.0))
        .row(ContactLaw::Penalty { stiffness: 100.0 }, &[(3, -one)], number(1e-3, 1.0));
    let velocity = vec![-number(1e-2, 1e2), number(1e-2, 1e2), -number(1e-2, 1e2), number(1e-2, 1e2)];
    let h = number(1e-4, 10.0).value();
    let builder = Simulation::builder(system, Tabulated("random", tableau.clone()), h)
        .velocity(velocity)
        .constraint(rows)
        .unchecked_stability();
    match seed % 3 {
        0 => builder.uncorrected(),
        1 => builder.corrector(PersistencyCorrection::with_history_projection()),
        _ => builder.corrector(PersistencyCorrection::new()).corrector(Release),
    }
}

/// Schemes of random numbers: most of them grow beyond every bound.
#[test]
fn random_schemes_publish_no_nonsense() {
    let mut draw = xorshift(20_260_101);
    let (mut built, mut failed, mut whole) = (0, 0, 0);
    for seed in 1..4000 {
        let tableau = random_tableau(&mut draw);
        let case = format!("seed {seed}: {tableau:?}");
        let found =
            [survive(random_scene::<f64>(&tableau, seed), &case), survive(random_scene::<f32>(&tableau, seed), &case)];
        for steps in found.into_iter().flatten() {
            built += 1;
            failed += u32::from(steps < 60);
            whole += u32::from(steps == 60);
        }
    }
    assert!(built > 1000 && failed > 100 && whole > 50, "{built} {failed} {whole}");
}

/// Numbers that `f32` cannot hold.
#[test]
fn stiffnesses_beyond_the_scalar_are_refused() {
    let run = |law: ContactLaw| {
        let k = matrix::<f32>(1, &[(0, 0, 1.0)]);
        Simulation::builder(LinearSystem::lumped(vec![1.0_f32], k).unwrap(), Composite, 0.1)
            .velocity(vec![-1.0])
            .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.05))
            .uncorrected()
            .build()
            .map(|mut run| {
                for _ in 0..20 {
                    run.step().unwrap();
                }
                assert!(is_finite(&run));
            })
    };
    for law in [
        ContactLaw::Penalty { stiffness: 1e40 },
        ContactLaw::Penalty { stiffness: 1e-40 },
        ContactLaw::Penalty { stiffness: 1e-50 },
        ContactLaw::PowerLaw { stiffness: 1e38, exponent: 40.0 },
        ContactLaw::Bipenalty { stiffness: 1e-30, mass: 1e20 },
        ContactLaw::AugmentedLagrangian { stiffness: 1e39, augmentations: 2 },
    ] {
        assert!(matches!(run(law), Err(Error::Parameter { .. })), "{law:?}");
    }
    run(ContactLaw::Penalty { stiffness: 1e30 }).unwrap();
    run(ContactLaw::Bipenalty { stiffness: 10.0, mass: 0.0 }).unwrap();
}

/// A contact solver that fails, and leaves so much of the gap.
#[derive(Debug)]
struct Failing(f64);

impl ContactSolver<f64> for Failing {
    fn solve(&mut self, _: &ContactProblem<'_, f64>, _: &mut [f64]) -> Result<usize, ContactFailure<f64>> {
        Err(ContactFailure::NotConverged { iterations: 3, row: 0, residual: self.0 })
    }
}

/// That numbers have gone beyond those of the scalar is another failure than that a solver has not converged.
#[test]
fn a_solver_that_leaves_no_number_is_told_from_one_that_does_not_converge() {
    let failed = |residual: f64| {
        let system = LinearSystem::lumped(vec![1.0], matrix(1, &[(0, 0, 0.0)])).unwrap();
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.1)
            .velocity(vec![-1.0])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.15))
            .contact_solver(Failing(residual))
            .build()
            .unwrap();
        run.run_until(1.0, &mut ()).unwrap_err()
    };
    for residual in [f64::NAN, f64::INFINITY] {
        let error = failed(residual);
        assert!(matches!(error, Error::ContactNotFinite { value, .. } if !value.is_finite()), "{error}");
    }
    let error = failed(0.25);
    assert!(matches!(error, Error::Contact { iterations: 3, residual: 0.25, .. }), "{error}");
}

/// What a step cannot find names the dof for which there is no number.
#[test]
fn the_dof_without_a_number_is_named() {
    for dof in 0..3 {
        let mut mass = vec![1.0; 3];
        mass[dof] = 1e-10;
        // (At rest until the step begins.)
        let load = move |t: f64, f: &mut [f64]| f[dof] = if t > 0.0 { 1e306 } else { 0.0 };
        let system = LinearSystem::lumped(mass, diagonal(&[0.0; 3])).unwrap().load(load);
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.1).build().unwrap();
        match run.step() {
            Err(Error::StepNotFinite { dof: named, .. }) => assert_eq!(named, dof),
            other => panic!("{other:?}"),
        }
    }
}
