//! The correctors beside λ_v/λ_a: against their papers' formulas written out by hand, and for what they conserve.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, Parts, Release, TaylorPapadopoulos, ZeroAcceleration,
};
use contact_dynamics::{
    Bdf2, Composite, Corrector, EnergyMomentum, Error, GeneralizedAlpha, Gssss, LinearRows, LinearSystem, Newmark,
    Newton, PersistencyCorrection, Simulation, SimulationBuilder, TimeIntegrator,
};
use contact_dynamics_scenes::measure::{Figures, figures, record_run};
use contact_dynamics_scenes::sparse::{free, matrix, spring, springs};
use contact_dynamics_scenes::{Bars, MassKind, Record};

const H: f64 = 1e-3;

type Correctors = Vec<Box<dyn Corrector<f64>>>;
type Make = fn() -> Box<dyn Corrector<f64>>;

fn list<const N: usize>(correctors: [Box<dyn Corrector<f64>>; N]) -> Correctors {
    correctors.into()
}

fn builder(
    bars: &Bars,
    integrator: impl TimeIntegrator + 'static,
    correctors: Correctors,
) -> SimulationBuilder<'static, f64> {
    Simulation::builder(bars.system::<f64>(), integrator, H)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .correctors(correctors)
}

fn run(bars: &Bars, integrator: impl TimeIntegrator + 'static, correctors: Correctors) -> (Record, Figures) {
    let mut run = builder(bars, integrator, correctors).build().unwrap();
    let record = record_run(bars, &mut run, 0.4);
    let figures = figures(bars, &record, H);
    (record, figures)
}

/// The paper's bars with the impact at a fraction of a step after 0.1 s.
fn bars(n: usize, phase: f64) -> Bars {
    let bars = Bars::paper(n);
    Bars { gap: (0.1 + phase * H) * (bars.velocity[0] - bars.velocity[1]), ..bars }
}

const PHASES: [f64; 4] = [0.05, 0.35, 0.65, 0.95];

/// Two masses on a spring above a floor, by Newmark's rows with the forces of contact fully implicit, written out; the
/// prediction projected or not. Returns u, v and λ of every step.
fn by_hand(steps: usize, [beta, gamma]: [f64; 2], projected: bool) -> Vec<[f64; 5]> {
    let (m, k, gap, weight) = ([0.5, 2.0], 40.0, 0.1, 3.0);
    let h = 0.05;
    let (mut u, mut v) = ([0.0_f64; 2], [-1.0_f64; 2]);
    let force = |u: [f64; 2]| [-k * (u[0] - u[1]), -k * (u[1] - u[0]) - weight];
    let f = force(u);
    let mut a = [f[0] / m[0], f[1] / m[1]];
    let mut out = Vec::new();
    for _ in 0..steps {
        let mut predicted = [u[0] + h * v[0], u[1] + h * v[1]];
        if projected {
            predicted[0] = predicted[0].max(-gap);
        }
        let base: [f64; 2] = std::array::from_fn(|i| predicted[i] + h * h * (0.5 - beta) * a[i]);
        // u' = base + β h² M⁻¹ f(u') + ½ h² λ_K/m₀ e₀, as a 2 × 2 system.
        let [s0, s1] = [beta * h * h / m[0], beta * h * h / m[1]];
        let solve = |pushed: f64| {
            let (b0, b1) = (base[0] + 0.5 * h * h * pushed / m[0], base[1] - s1 * weight);
            let determinant = (1.0 + s0 * k) * (1.0 + s1 * k) - s0 * k * s1 * k;
            [(b0 * (1.0 + s1 * k) + s0 * k * b1) / determinant, (b1 * (1.0 + s0 * k) + s1 * k * b0) / determinant]
        };
        let (free, unit) = (solve(0.0), solve(1.0)[0] - solve(0.0)[0]);
        let lambda = ((-gap - free[0]) / unit).max(0.0);
        u = solve(lambda);
        let f = force(u);
        let new = [f[0] / m[0], f[1] / m[1]];
        for i in 0..2 {
            v[i] += h * ((1.0 - gamma) * a[i] + gamma * new[i]);
        }
        v[0] += h * lambda / m[0];
        a = new;
        out.push([u[0], u[1], v[0], v[1], lambda]);
    }
    out
}

#[test]
fn contact_implicit_steps_are_those_of_the_papers() {
    for [beta, gamma] in [[0.25, 0.5], [0.3025, 0.6]] {
        for (projected, corrector) in
            [(false, Box::new(ContactImplicit) as Box<dyn Corrector<f64>>), (true, Box::new(ContactStabilized::new()))]
        {
            let k = matrix(2, springs(2, 40.0));
            let system = LinearSystem::lumped(vec![0.5, 2.0], k).unwrap().load(|_, f| f[1] = -3.0);
            let mut run = Simulation::builder(system, Newmark::new(beta, gamma).unwrap(), 0.05)
                .velocity(vec![-1.0; 2])
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.1))
                .corrector(corrector)
                .build()
                .unwrap();
            let mut touched = 0;
            for [u0, u1, v0, v1, lambda] in by_hand(70, [beta, gamma], projected) {
                run.step().unwrap();
                let (u, v) = (run.state().displacement(), run.state().velocity());
                let found = [u[0], u[1], v[0], v[1], run.state().contacts().forces()[0]];
                for (x, y) in found.into_iter().zip([u0, u1, v0, v1, lambda]) {
                    // (Impacts amplify rounding.)
                    assert!((x - y).abs() < 1e-8 * (1.0 + y.abs()), "{projected}: {found:?} {lambda}");
                }
                touched += u32::from(lambda > 0.0);
            }
            assert!(touched > 5);
        }
    }
}

#[test]
fn contact_implicit_steps_never_raise_the_energy() {
    for phase in PHASES {
        for corrector in [
            Box::new(ContactImplicit) as Box<dyn Corrector<f64>>,
            Box::new(ContactStabilized::new()),
            Box::new(ContactStabilized::improved()),
        ] {
            let name = corrector.name();
            let (record, figures) = run(&bars(50, phase), Newmark::trapezoidal(), list([corrector]));
            let energies: Vec<f64> = (0..record.t.len()).map(|i| record.energy(i) / record.start_energy).collect();
            assert!(energies.windows(2).all(|pair| pair[1] < pair[0] + 1e-12), "{name}");
            assert!(figures.energy > 0.98 && figures.closure < 1e-10 && figures.drift < 1e-10, "{name}: {figures:?}");
        }
    }
}

#[test]
fn a_projected_prediction_makes_the_force_smooth() {
    // Force RMS, largest force and energy of the two bars in the literature's trials, to a unit of their last digits.
    for (n, rms, max, energy) in [(20, 0.128, 1.09, 0.974), (50, 0.083, 1.10, 0.989), (100, 0.064, 1.12, 0.994)] {
        let (_, found) = run(&bars(n, 0.0), Newmark::trapezoidal(), list([Box::new(ContactStabilized::new())]));
        assert!((found.force_rms - rms).abs() < 1e-3, "{n}: {found:?}");
        assert!((found.force_max - max).abs() < 1e-2 && (found.energy - energy).abs() < 1e-3, "{n}: {found:?}");
        let (_, raw) = run(&bars(n, 0.0), Newmark::trapezoidal(), list([Box::new(ContactImplicit)]));
        assert!(raw.force_rms > 3.0 * found.force_rms, "{n}: {raw:?}");
    }
}

#[test]
fn velocity_jumps_give_the_work_of_contact_back() {
    for phase in PHASES {
        for n in [20, 50] {
            for integrator in
                [Box::new(Gssss::new(1.0, 1.0, 1.0).unwrap()) as Box<dyn TimeIntegrator>, Box::new(EnergyMomentum)]
            {
                let name = integrator.name();
                let (record, found) = run(&bars(n, phase), integrator, list([Box::new(LaursenLove)]));
                // In every step, not only at the end.
                let miss = (0..record.t.len()).map(|i| (record.energy(i) / record.start_energy - 1.0).abs());
                let miss = miss.fold(0.0, f64::max);
                assert!(miss < 1e-12, "{n}, {phase}: {miss:e}");
                assert!(found.closure < 1e-9 && found.drift < 1e-9, "{name}: {found:?}");
                // What it is known for.
                assert!(found.velocity_rms > 0.4, "{name}, {n}, {phase}: {found:?}");
            }
        }
    }
}

#[test]
fn release_returns_what_the_impact_took() {
    for phase in PHASES {
        for (n, mass) in [(20, MassKind::Lumped), (50, MassKind::Lumped), (50, MassKind::Consistent)] {
            let bars = bars(n, phase).with_mass(mass);
            let correctors = || list([Box::new(PersistencyCorrection::new()), Box::new(Release)]);
            let (_, without) = run(&bars, Newmark::trapezoidal(), list([Box::new(PersistencyCorrection::new())]));
            let (_, with) = run(&bars, Newmark::trapezoidal(), correctors());
            assert!(with.energy > without.energy + 1e-4, "{n} {mass:?}: {} {}", with.energy, without.energy);
            assert!(with.energy < 1.0 + 1e-9 && with.closure < 1e-9 && with.drift < 1e-9, "{with:?}");

            let mut run = builder(&bars, Newmark::trapezoidal(), correctors()).energy_balance().build().unwrap();
            let corrections = |run: &mut Simulation<'_, f64>| run.energy().works.unwrap().corrections;
            let (mut stored, mut returned) = (0.0, None);
            while run.time() < 0.4 {
                let (before, closed) = (corrections(&mut run), run.state().contacts().closed()[0]);
                run.step().unwrap();
                let contacts = run.state().contacts();
                if closed && !contacts.closed()[0] && returned.is_none() {
                    // In the step that opens, corrections give back what they had taken, all of it and nothing else.
                    assert!(contacts.dissipated()[0].abs() < 1e-12 * stored, "{}", contacts.dissipated()[0]);
                    returned = Some((corrections(&mut run) - before, stored));
                }
                stored = run.state().contacts().dissipated()[0];
            }
            let (gain, expected) = returned.unwrap();
            assert!(expected > 0.0 && (gain / expected - 1.0).abs() < 1e-9, "{gain} {expected}");
        }
    }
}

#[test]
fn books_close_with_every_corrector() {
    let dissimilar = Bars { young: [49.0, 100.0], elements: [35, 50], ..bars(50, 0.3) };
    let transit = 0.2 / 100.0;
    let correctors: [fn(f64) -> Correctors; 6] = [
        |_| list([Box::new(ContactImplicit)]),
        |_| list([Box::new(ContactStabilized::new())]),
        |_| list([Box::new(ContactStabilized::improved())]),
        |_| list([Box::new(PersistencyCorrection::new()), Box::new(Release)]),
        |transit| list([Box::new(TaylorPapadopoulos::new(transit).unwrap())]),
        |_| list([Box::new(TaylorPapadopoulos::with_impedances([0.7, 1.0].map(|c| 0.25 * c)).unwrap())]),
    ];
    for make in correctors {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            for integrator in [Newmark::trapezoidal(), Newmark::new(0.3025, 0.6).unwrap()] {
                let bars = dissimilar.with_mass(mass);
                let name = make(transit)[0].name();
                let (_, found) = run(&bars, integrator, make(transit));
                assert!(found.closure < 1e-9 && found.drift < 1e-9, "{name}, {mass:?}: {found:?}");
            }
        }
    }
}

#[test]
fn zero_acceleration_is_the_acceleration_part_between_equal_bars_alone() {
    let zero = |bars: &Bars| run(bars, Newmark::trapezoidal(), list([Box::new(ZeroAcceleration)]));
    let part = |bars: &Bars| {
        let correction = PersistencyCorrection::new().parts(Parts::Acceleration);
        run(bars, Newmark::trapezoidal(), list([Box::new(correction)]))
    };
    let equal = bars(50, 0.3);
    let (found, expected) = (zero(&equal).0, part(&equal).0);
    for (x, y) in found.force.iter().zip(&expected.force) {
        assert!((x - y).abs() < 1e-9 * 0.0125, "{x} {y}");
    }
    // Elsewhere it takes momentum away.
    let unequal = Bars { young: [49.0, 100.0], ..equal };
    assert!(zero(&unequal).1.drift > 1e-6 && part(&unequal).1.drift < 1e-10);
}

/// Two masses that touch and fly on together, slowed by damping that both have: which of them is closed is decided by
/// rounding, and a = −α v all the same.
#[test]
fn zero_acceleration_leaves_bodies_alone_that_stay_together_without_force() {
    let damping = 0.05;
    for (k, mass) in [[1.0, 1.3], [1.28, 1.82], [3.0, 0.7], [1e-3, 1.0]].into_iter().enumerate() {
        for unit in [1.0, 10.0, 1e-3, 77.7] {
            let rows = LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.0);
            // (A wall stops the first; after that they are on their own.)
            let rows = rows.unilateral(&[(0, 1.0)], 0.31 * unit);
            let mut run = Simulation::builder(free(&mass).rayleigh(damping, 0.0).unwrap(), Bdf2, 0.12)
                .velocity(vec![-0.35 * unit; 2])
                .constraint(rows)
                .corrector(ZeroAcceleration)
                .build()
                .unwrap();
            let mut alone = 0;
            for step in 0..60 {
                run.step().unwrap();
                let (v, a) = (run.state().velocity(), run.state().acceleration());
                // (Without a force beyond rounding in this step, and the next.)
                if run.state().contacts().raw_forces().iter().any(|force| *force > 1e-9 * unit) {
                    alone = 0;
                    continue;
                }
                alone += 1;
                let slows = (0..2).all(|i| (a[i] + damping * v[i]).abs() < 1e-9 * unit);
                assert!(slows, "{k}, {unit}, step {step}: {v:?} {a:?}");
            }
            assert!(alone > 20, "{k}, {unit}: {alone}");
        }
    }
}

#[test]
fn wave_release_is_the_impulse_of_the_last_force() {
    // One mass on the floor that a load presses down, then pulls up: S and λ are known.
    let system = free(&[2.0]).load(|t, f| f[0] = if t < 0.099 { -7.0 } else { 5.0 });
    let path = |corrector: Box<dyn Corrector<f64>>| {
        let system = free(&[2.0]).load(|t, f| f[0] = if t < 0.099 { -7.0 } else { 5.0 });
        let mut run = Simulation::builder(system, Newmark::new(0.5, 1.0).unwrap(), 0.01)
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.0))
            .corrector(corrector)
            .build()
            .unwrap();
        run.run_until(0.1, &mut ()).unwrap();
        run.state().velocity()[0]
    };
    drop(system);
    let jump = path(Box::new(TaylorPapadopoulos::new(0.04).unwrap())) - path(Box::new(PersistencyCorrection::new()));
    assert!((jump - 0.5 * 0.04 * 7.0 / 2.0).abs() < 1e-12, "{jump}");
}

/// Two masses pressed together by loads that turn around: the gap opens at the rate that the impedances say, and the
/// momentum of both together is that of the loads.
#[test]
fn impedances_give_the_rate_of_opening_and_take_no_momentum() {
    let masses = [2.0, 0.3];
    let path = |corrector: Box<dyn Corrector<f64>>| {
        let zero = matrix(2, [(0, 0, 0.0)]);
        let system = LinearSystem::lumped(masses.to_vec(), zero).unwrap();
        let system = system.load(|t, f| {
            let force = if t < 0.099 { 7.0 } else { -5.0 };
            (f[0], f[1]) = (force, -force);
        });
        let mut run = Simulation::builder(system, Newmark::new(0.5, 1.0).unwrap(), 0.01)
            .constraint(LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.0))
            .corrector(corrector)
            .build()
            .unwrap();
        run.run_until(0.1, &mut ()).unwrap();
        let v = run.state().velocity();
        assert!((masses[0] * v[0] + masses[1] * v[1]).abs() < 1e-14, "{v:?}");
        v[1] - v[0]
    };
    let still = path(Box::new(PersistencyCorrection::new()));
    let opening = |corrector: TaylorPapadopoulos| path(Box::new(corrector)) - still;
    let found = opening(TaylorPapadopoulos::with_impedances([40.0, 9.0]).unwrap());
    assert!((found - 7.0 * (1.0 / 40.0 + 1.0 / 9.0)).abs() < 1e-12, "{found}");
    let found = opening(TaylorPapadopoulos::with_impedances([f64::INFINITY, 9.0]).unwrap());
    assert!((found - 7.0 / 9.0).abs() < 1e-12, "{found}");
    // Nodes of mass ½ τ Z with one τ: both ways to say it are one.
    let one_time = TaylorPapadopoulos::with_impedances(masses.map(|m| 2.0 * m / 0.04)).unwrap();
    let by_time = opening(TaylorPapadopoulos::new(0.04).unwrap());
    assert!((opening(one_time) - by_time).abs() < 1e-13, "{by_time}");
    for wrong in [[0.0, 1.0], [-1.0, 1.0], [f64::NAN, 1.0], [f64::INFINITY, f64::INFINITY]] {
        assert!(matches!(TaylorPapadopoulos::with_impedances(wrong), Err(Error::Parameter { .. })), "{wrong:?}");
    }
}

#[test]
fn runs_with_memory_in_their_contacts_resume_bit_for_bit() {
    let bars = bars(20, 0.3);
    let correctors = || list([Box::new(PersistencyCorrection::new()), Box::new(Release)]);
    let mut whole = builder(&bars, Newmark::trapezoidal(), correctors()).build().unwrap();
    whole.run_until(0.2, &mut ()).unwrap();
    assert!(whole.state().contacts().dissipated()[0] > 0.0);
    let (state, history) = (whole.state().clone(), whole.history().clone());
    let mut resumed = builder(&bars, Newmark::trapezoidal(), correctors()).resume(state, history).build().unwrap();
    whole.run_until(0.4, &mut ()).unwrap();
    resumed.run_until(0.4, &mut ()).unwrap();
    assert_eq!(whole.state(), resumed.state());
}

#[test]
fn schemes_that_cannot_be_corrected_so_are_refused() {
    let bars = bars(20, 0.0);
    for corrector in [Box::new(ContactImplicit) as Box<dyn Corrector<f64>>, Box::new(ContactStabilized::new())] {
        match builder(&bars, Composite, list([corrector])).build() {
            Err(Error::Incompatible { part, reason }) => {
                assert!(part.contains("composite") && reason.contains("last state alone"), "{part}: {reason}");
            }
            other => panic!("{other:?}"),
        }
    }
    match builder(&bars, Newmark::trapezoidal(), list([Box::new(LaursenLove)])).build() {
        Err(Error::Incompatible { reason, .. }) => assert!(reason.contains("middle of the step"), "{reason}"),
        other => panic!("{other:?}"),
    }
    assert!(matches!(TaylorPapadopoulos::new(-1.0), Err(Error::Parameter { .. })));
    assert!(matches!(TaylorPapadopoulos::new(f64::NAN), Err(Error::Parameter { .. })));
}

#[test]
fn newtons_method_takes_the_same_corrections() {
    let bars = bars(20, 0.3);
    let correctors: [Make; 3] = [
        || Box::new(ContactStabilized::new()),
        || Box::new(ContactStabilized::improved()),
        || Box::new(ContactImplicit),
    ];
    for make in correctors {
        let mut direct = builder(&bars, Newmark::trapezoidal(), list([make()])).build().unwrap();
        let mut newton = builder(&bars, Newmark::trapezoidal(), list([make()])).newton(Newton::full()).build().unwrap();
        // (Raw contact-implicit steps amplify rounding: the first impact is compared.)
        while direct.time() < 0.12 {
            direct.step().unwrap();
            newton.step().unwrap();
            for (x, y) in direct.state().velocity().iter().zip(newton.state().velocity()) {
                assert!((x - y).abs() < 1e-6 * 0.05, "{}: {x} {y}", make().name());
            }
        }
        assert!(direct.statistics().contact_changes > 0);
    }
}

#[test]
fn balances_halfway_are_shifted_by_their_share() {
    let scheme = || GeneralizedAlpha::chung_hulbert(0.8).unwrap();
    // With the force of contact out of the accelerations, the balance holds without it, at the shifted displacements:
    // M ((1 − α_m) a' + α_m a) + K ((1 − α_f) u' + α_f u) = 0.
    let (am, af) = (0.6 / 1.8, 0.8 / 1.8);
    let scene = bars(20, 0.3);
    let (mass, stiffness) = (scene.lumped_mass::<f64>(), scene.stiffness::<f64>());
    let mut stepped = builder(&scene, scheme(), list([Box::new(ContactStabilized::new())])).build().unwrap();
    let scale = 0.0125;
    while stepped.time() < 0.15 {
        let (u, a) = (stepped.state().displacement().to_vec(), stepped.state().stored_acceleration().to_vec());
        stepped.step().unwrap();
        let (now, rate) = (stepped.state().displacement(), stepped.state().stored_acceleration());
        let mut residual: Vec<f64> = (0..mass.len()).map(|i| mass[i] * ((1.0 - am) * rate[i] + am * a[i])).collect();
        for j in 0..mass.len() {
            let middle = (1.0 - af) * now[j] + af * u[j];
            for (&i, &k) in stiffness.as_ref().row_idx_of_col_raw(j).iter().zip(stiffness.val_of_col(j)) {
                residual[i] += k * middle;
            }
        }
        let worst = residual.iter().fold(0.0, |worst: f64, r| worst.max(r.abs()));
        assert!(worst < 1e-9 * scale, "{}: {worst:e}", stepped.time());
    }
    for phase in PHASES {
        let (_, found) = run(&bars(50, phase), scheme(), list([Box::new(ContactStabilized::new())]));
        assert!(found.force_rms < 0.13 && found.force_max < 1.25 && found.energy < 1.0, "{phase}: {found:?}");
        assert!(found.closure < 1e-9 && found.drift < 1e-9, "{phase}: {found:?}");
    }
}

#[test]
fn only_the_full_projection_moves_bodies_that_meet_for_the_first_time() {
    let first = |corrector: Box<dyn Corrector<f64>>| {
        let mut run = builder(&bars(20, 0.3), Newmark::trapezoidal(), list([corrector])).build().unwrap();
        while !run.state().contacts().closed()[0] {
            run.step().unwrap();
        }
        run.state().contacts().forces()[0]
    };
    let implicit = first(Box::new(ContactImplicit));
    assert!((first(Box::new(ContactStabilized::improved())) / implicit - 1.0).abs() < 1e-9);
    assert!((first(Box::new(ContactStabilized::new())) / implicit - 1.0).abs() > 0.05);
}

/// Two masses on a spring, the first of which meets a wall that comes, as a driven dof or as a gap that closes.
fn wall(driven: bool, equality: bool, until: f64, corrector: Box<dyn Corrector<f64>>) -> Vec<f64> {
    let k = matrix(3, spring(1, 2, 40.0).into_iter().chain([(0, 0, 0.0)]));
    let system = LinearSystem::lumped(vec![1.0, 0.5, 2.0], k).unwrap();
    let motion = |t: f64| [0.3 * t + t * t, 0.3 + 2.0 * t, 2.0];
    let system = if driven { system.drive(0, motion).unwrap() } else { system.fix(0).unwrap() };
    let gap = |t: f64| [0.05 - if equality { 0.05 } else { 0.0 } - 0.3 * t - t * t, -0.3 - 2.0 * t, -2.0];
    let rows = LinearRows::new();
    let start = gap(0.0)[0];
    let rows = match (driven, equality) {
        (true, false) => rows.unilateral(&[(1, 1.0), (0, -1.0)], start),
        (true, true) => rows.equality(&[(1, 1.0), (0, -1.0)], start),
        (false, false) => rows.unilateral(&[(1, 1.0)], GapOffset::moving(gap)),
        (false, true) => rows.equality(&[(1, 1.0)], GapOffset::moving(gap)),
    };
    let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.02)
        // (The tie is pulled open, not pressed.)
        .velocity(
            [if driven { 0.3 } else { 0.0 }, -0.2, -0.2].map(|v| if equality && v < 0.0 { 0.9 } else { v }).to_vec(),
        )
        .constraint(rows)
        .corrector(corrector)
        .build()
        .unwrap();
    run.run_until(until, &mut ()).unwrap();
    run.state().displacement()[1..].iter().chain(&run.state().velocity()[1..]).copied().collect()
}

#[test]
fn predictions_see_supports_where_they_will_be() {
    // A tie is projected in the first step already.
    for (equality, until) in [(false, 0.3), (true, 0.3), (true, 0.02)] {
        let driven = wall(true, equality, until, Box::new(ContactStabilized::new()));
        let moving = wall(false, equality, until, Box::new(ContactStabilized::new()));
        for (x, y) in driven.iter().zip(&moving) {
            assert!((x - y).abs() < 1e-10, "{equality}: {driven:?} {moving:?}");
        }
        // And the projection is there.
        let implicit = wall(true, equality, until, Box::new(ContactImplicit));
        assert!(implicit.iter().zip(&driven).any(|(x, y)| (x - y).abs() > 1e-6), "{equality}: {driven:?}");
    }
}

#[test]
fn energy_taken_by_an_impact_is_counted_from_that_impact() {
    // A light foot on a spring under a heavy mass, under gravity: it lands several times.
    let k = matrix(2, springs(2, 400.0));
    let system = LinearSystem::lumped(vec![0.2, 2.0], k).unwrap().load(|_, f| (f[0], f[1]) = (-2.0, -20.0));
    let mut run = Simulation::builder(system, Newmark::trapezoidal(), 1e-3)
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.5))
        .corrector(PersistencyCorrection::new())
        .energy_balance()
        .build()
        .unwrap();
    let (mut landings, mut at_landing) = (0, 0.0);
    let corrections = |run: &mut Simulation<'_, f64>| run.energy().works.unwrap().corrections;
    while run.time() < 3.0 {
        let open = !run.state().contacts().closed()[0];
        run.step().unwrap();
        if run.state().contacts().closed()[0] {
            // What is corrected in the step of the landing is part of its impact; after that it has a line of its own.
            let sum = corrections(&mut run) + run.state().contacts().dissipated()[0];
            if open {
                (landings, at_landing) = (landings + 1, sum);
            }
            assert!((sum - at_landing).abs() < 1e-10, "{landings}: {sum} {at_landing}");
        }
    }
    assert!(landings > 2, "{landings}");
}

#[test]
fn what_release_gives_back_does_not_depend_on_the_motion_of_the_observer() {
    // A foot with mass on a spring lands on a floor at rest, or on one that moves as all else does.
    let bounce = |speed: f64| {
        let k = matrix(2, springs(2, 400.0));
        let floor = GapOffset::moving(move |t| [0.1 - speed * t, -speed, 0.0]);
        let mut run =
            Simulation::builder(LinearSystem::lumped(vec![0.5, 2.0], k).unwrap(), Newmark::trapezoidal(), 1e-3)
                .velocity(vec![speed - 1.0; 2])
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], floor))
                .correctors(list([Box::new(PersistencyCorrection::new()), Box::new(Release)]))
                .build()
                .unwrap();
        let mut taken = 0.0_f64;
        while run.time() < 0.6 {
            run.step().unwrap();
            taken = taken.max(run.state().contacts().dissipated()[0]);
        }
        assert!(!run.state().contacts().closed()[0]);
        [run.state().velocity()[0] - speed, run.state().velocity()[1] - speed, taken]
    };
    let still = bounce(0.0);
    // ½ m ġ² of the foot.
    assert!((still[2] - 0.25).abs() < 1e-3, "{still:?}");
    for speed in [3.0, -7.0] {
        let moving = bounce(speed);
        for (x, y) in moving.iter().zip(&still) {
            assert!((x - y).abs() < 1e-9, "{speed}: {moving:?} {still:?}");
        }
    }
}
