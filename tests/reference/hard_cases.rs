//! The hard cases of impact in one dimension: dissimilar bars, touching without pressure, bounces, rest, extreme ratios
//! and redundant contacts.

use contact_dynamics::contact_solver::{GaussSeidel, Pivoting};
use contact_dynamics::{
    ActiveSet, Composite, ContactSolver, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Simulation,
    TimeIntegrator,
};
use contact_dynamics_scenes::measure::record_run;
use contact_dynamics_scenes::reference::BouncingBar;
use contact_dynamics_scenes::sparse::{block, free};
use contact_dynamics_scenes::wall_bar::WallBar;
use contact_dynamics_scenes::{Bars, Record};

fn corrected() -> PersistencyCorrection {
    PersistencyCorrection::with_history_projection()
}

const SCHEMES: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Composite), || Box::new(Newmark::trapezoidal())];

fn schemes() -> [Box<dyn TimeIntegrator>; 2] {
    SCHEMES.map(|scheme| scheme())
}

fn run_bars(bars: &Bars, scheme: Box<dyn TimeIntegrator>, h: f64, until: f64) -> Record {
    let mut run = Simulation::builder(bars.system::<f64>(), scheme, h)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .corrector(corrected())
        .build()
        .unwrap();
    record_run(bars, &mut run, until)
}

fn phases() -> [f64; 5] {
    [0.05, 0.25, 0.45, 0.65, 0.85]
}

/// Mean of the values at times in the window.
fn mean(record: &Record, values: &[f64], window: (f64, f64)) -> f64 {
    let inside: Vec<f64> =
        record.t.iter().zip(values).filter(|(t, _)| (window.0..window.1).contains(*t)).map(|(_, x)| *x).collect();
    inside.iter().sum::<f64>() / inside.len() as f64
}

#[test]
fn dissimilar_bars_show_both_plateaus_and_part_in_time() {
    let h = 5e-4;
    for scheme in SCHEMES {
        for phase in phases() {
            let bars = Bars::dissimilar(100).delayed(phase, h);
            let (start, exact) = (bars.impact_time(), bars.exact(0.6));
            let record = run_bars(&bars, scheme(), h, 0.5);
            for window in [(0.03, 0.17), (0.23, 0.27)] {
                let window = (start + window.0, start + window.1);
                let expected = exact.contact_force(0.5 * (window.0 + window.1));
                let found = mean(&record, &record.force, window);
                assert!(
                    (found / expected - 1.0).abs() < 0.03,
                    "{}, phase {phase}: {found} {expected}",
                    scheme().name()
                );
            }
            let release = record.t[record.force.iter().rposition(|f| *f > 0.0).unwrap()];
            let expected = start + 2.0 / 7.0;
            let allowed = 2.0 * bars.element_size(0) / 70.0 + h;
            // The small plateau ends in the oscillation behind the front: early by a little more than the front is
            // wide.
            assert!(
                (release - expected).abs() < 1.25 * allowed,
                "{}, phase {phase}: {release} {expected}",
                scheme().name()
            );
            // Mean speeds after the release, from the momenta.
            let masses = [0.1, 0.1];
            for ((momentum, mass), speed) in record.momentum[1].iter().zip(masses).zip([0.011_418_685, 0.088_581_315]) {
                assert!((momentum / mass - speed).abs() < 0.01 * 0.1, "{}: {}", scheme().name(), momentum / mass);
            }
            assert!(record.drift() < 1e-10 && record.closure() < 1e-9);
        }
    }
}

#[test]
fn bars_that_touch_without_pressure_do_not_chatter() {
    // After 0.2 s of contact the ends stay together without force until 0.4 s: nothing may open and close again.
    for scheme in SCHEMES {
        for phase in phases() {
            let h = 1e-3;
            let bars =
                Bars { elements: [50, 100], length: [10.0, 20.0], area: 1.0, velocity: [0.1, 0.0], ..Bars::paper(50) }
                    .delayed(phase, h);
            let start = bars.impact_time();
            let record = run_bars(&bars, scheme(), h, start + 0.6);
            let closed: Vec<bool> = record.gap.iter().zip(&record.force).map(|(g, f)| *f > 0.0 || *g < 1e-12).collect();
            let changes = (1..closed.len())
                .filter(|&i| closed[i] != closed[i - 1])
                .filter(|&i| (start + 0.2..start + 0.4).contains(&record.t[i]))
                .count();
            assert!(changes <= 2, "{}, phase {phase}: {changes} changes", scheme().name());
            // Impulse: all the momentum of the first bar; restitution L1/L2.
            let momentum = 0.1 * 0.1;
            assert!((record.total_impulse / momentum - 1.0).abs() < 0.02, "{}", record.total_impulse / momentum);
            let [left, right] = record.momentum[1];
            let restitution = (right / 0.2 - left / 0.1) / 0.1;
            assert!((restitution - 0.5).abs() < 0.02, "{}, phase {phase}: {restitution}", scheme().name());
            // The gap that opens meanwhile is no more than a hundredth of the compression v L/c.
            let widest = (0..record.t.len())
                .filter(|&i| (start + 0.2..start + 0.39).contains(&record.t[i]))
                .fold(0.0_f64, |m, i| m.max(record.gap[i]));
            assert!(widest < 0.025 * 0.1 * 0.1, "{}, phase {phase}: {widest}", scheme().name());
        }
    }
}

#[test]
fn a_bouncing_bar_shows_the_force_ramps_and_the_contact_times() {
    let (n, exact) = (100, BouncingBar::doyen());
    let bar = WallBar::bouncing(n);
    let h = 0.5 * bar.element_size() / bar.wave_speed();
    for scheme in schemes() {
        let name = scheme.name();
        let mut run = Simulation::builder(bar.system(), scheme, h)
            .constraint(bar.contact())
            .corrector(corrected())
            .build()
            .unwrap();
        let [t1, t2, t3, t4] = exact.events();
        let (mut forces, mut times) = (Vec::new(), Vec::new());
        while run.time() < exact.period() {
            run.step().unwrap();
            times.push(run.time());
            forces.push(run.state().contacts().forces()[0]);
        }
        // The first ramp, between the fronts that the mesh blurs.
        let ramp = |from: f64, to: f64| {
            let errors: Vec<f64> = times
                .iter()
                .zip(&forces)
                .filter(|(t, _)| (from + 0.15..to - 0.1).contains(*t))
                .map(|(&t, f)| f / exact.contact_force(t) - 1.0)
                .collect();
            (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
        };
        assert!(ramp(t1, t2) < 0.03, "{name}: {}", ramp(t1, t2));
        let allowed = 2.0 * bar.element_size() / bar.wave_speed() + h;
        let touch = times[forces.iter().position(|f| *f > 0.0).unwrap()];
        assert!((touch - t1).abs() < allowed, "{name}: {touch}");
        let first_release = times[(0..times.len()).rfind(|&i| times[i] < 2.5 && forces[i] > 0.0).unwrap()];
        // The front that ends the contact has travelled through the mesh and back: it is four elements wide.
        assert!((first_release - t2).abs() < 1.75 * allowed, "{name}: {first_release} {t2}");
        let second = times[(0..times.len()).find(|&i| times[i] > 2.5 && forces[i] > 0.0).unwrap()];
        assert!(
            (second - t3).abs() < 0.05 && (times[forces.iter().rposition(|f| *f > 0.0).unwrap()] - t4).abs() < 0.05
        );
        let energy = bar.total_energy(run.energy().total(), run.state().displacement()) / exact.energy();
        assert!((0.95..=1.0).contains(&energy), "{name}: {energy}");
    }
}

#[test]
fn a_bar_at_rest_stays_at_rest() {
    let bar = WallBar { elements: 20, height: 0.0, ..WallBar::bouncing(20) };
    let h = bar.element_size() / bar.wave_speed();
    for scheme in schemes() {
        let name = scheme.name();
        let mut run = Simulation::builder(bar.system(), scheme, h)
            .displacement(bar.rest())
            .constraint(bar.contact())
            .corrector(corrected())
            .build()
            .unwrap();
        for _ in 0..100_000 {
            run.step().unwrap();
            let force = run.state().contacts().forces()[0];
            assert!((force / bar.weight() - 1.0).abs() < 1e-8, "{name}: {force}");
        }
        let drift = run.state().displacement().iter().zip(bar.rest()).fold(0.0_f64, |m, (u, r)| m.max((u - r).abs()));
        assert!(drift < 1e-9 * bar.rest()[20].abs(), "{name}: {drift:e}");
        let statistics = run.statistics();
        assert_eq!((statistics.contact_changes, statistics.contact_iterations), (0, 100_000), "{name}");
    }
}

#[test]
fn a_bar_settles_under_damping_and_bears_a_tiny_gap() {
    // From u = 0, 5 % of critical damping in the first mode, then 1e-9 above the floor.
    let mut bar = WallBar { elements: 20, height: 0.0, ..WallBar::bouncing(20) };
    let omega = std::f64::consts::FRAC_PI_2 * bar.wave_speed() / bar.length;
    bar.damping = 2.0 * 0.05 / omega;
    let h = bar.element_size() / bar.wave_speed();
    for (scheme, height) in schemes().into_iter().zip([0.0, 1e-9]).chain(schemes().into_iter().zip([1e-9, 0.0])) {
        let name = scheme.name();
        let bar = WallBar { height, ..bar };
        let mut run = Simulation::builder(bar.system(), scheme, h)
            .constraint(bar.contact())
            .corrector(corrected())
            .build()
            .unwrap();
        run.run_until(120.0, &mut ()).unwrap();
        let before = run.statistics().contact_changes;
        for _ in 0..5_000 {
            run.step().unwrap();
            let force = run.state().contacts().forces()[0];
            assert!((force / bar.weight() - 1.0).abs() < 1e-8, "{name}, {height}: {force}");
        }
        assert_eq!(run.statistics().contact_changes, before, "{name}: chatter");
    }
}

#[test]
fn impedances_a_million_apart_and_the_rigid_limit() {
    let h = 1e-3;
    for scheme in SCHEMES {
        for phase in [0.15, 0.65] {
            // A bar against one of the same wave speed, a million times heavier and stiffer.
            let bars = Bars { young: [100.0, 1e8], density: [0.01, 1e4], velocity: [0.1, 0.0], ..Bars::paper(50) }
                .delayed(phase, h);
            let heavy = run_bars(&bars, scheme(), h, 0.4);
            let (window, exact) = ((bars.impact_time() + 0.05, bars.impact_time() + 0.18), bars.exact(0.5));
            let (found, expected) = (mean(&heavy, &heavy.force, window), exact.contact_force(0.2));
            assert!((found / expected - 1.0).abs() < 0.01, "{}: {found} {expected}", scheme().name());
            assert!(heavy.closure() < 1e-9, "{:e}", heavy.closure());
            // The same bar against a wall: the limit, to the ratio of the impedances.
            let [left, _] = bars.contact_dofs();
            let split = left + 1;
            let k = block(&(0..split), &[(1.0, &bars.stiffness())]);
            let system = LinearSystem::lumped(bars.lumped_mass()[..split].to_vec(), k).unwrap();
            let mut run = Simulation::builder(system, scheme(), h)
                .velocity(vec![0.1; split])
                .constraint(LinearRows::new().unilateral(&[(left, -1.0)], bars.gap))
                .corrector(corrected())
                .build()
                .unwrap();
            for force in &heavy.force {
                run.step().unwrap();
                let wall = run.state().contacts().forces()[0];
                assert!((force - wall).abs() < 1e-4 * expected, "{}: {force} {wall}", scheme().name());
            }
        }
    }
}

/// Bars whose contact is written down several times, with `copies` of the row and their sums.
fn redundant(copies: usize, solver: impl ContactSolver<f64> + 'static) -> Vec<(f64, Vec<f64>)> {
    let bars = Bars::paper(20).delayed(0.35, 1e-3);
    let [left, right] = bars.contact_dofs();
    let mut rows = LinearRows::new();
    for copy in 0..copies {
        // One of them turned over and scaled: the same condition in other units.
        let scale = if copy == 2 { 3.0 } else { 1.0 };
        rows = rows.unilateral(&[(left, -scale), (right, scale)], scale * bars.gap);
    }
    let mut run = Simulation::builder(bars.system::<f64>(), Composite, 1e-3)
        .velocity(bars.velocities())
        .constraint(rows)
        .contact_solver(solver)
        .corrector(corrected())
        .build()
        .unwrap();
    let mut history = Vec::new();
    while run.time() < 0.35 {
        run.step().unwrap();
        let forces = run.state().contacts().forces();
        let sum = forces.iter().enumerate().map(|(copy, f)| if copy == 2 { 3.0 * f } else { *f }).sum();
        history.push((sum, run.state().displacement().to_vec()));
    }
    history
}

#[test]
fn redundant_contacts_give_the_motion_of_one() {
    let single = redundant(1, ActiveSet::default());
    let compare = |other: Vec<(f64, Vec<f64>)>, tolerance: f64, name: &str| {
        assert_eq!(single.len(), other.len());
        for ((force, u), (other_force, other_u)) in single.iter().zip(&other) {
            assert!((force - other_force).abs() < tolerance * 0.0125, "{name}: {force} {other_force}");
            let worst = u.iter().zip(other_u).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(worst < tolerance * 5e-3, "{name}: {worst:e}");
        }
    };
    for copies in [2, 4] {
        compare(redundant(copies, ActiveSet::default()), 1e-9, "active set");
        compare(redundant(copies, Pivoting::default()), 1e-9, "pivoting");
        compare(redundant(copies, GaussSeidel::default()), 1e-6, "Gauss-Seidel");
    }
}

#[test]
fn a_rigid_face_on_four_supports_shares_its_force() {
    // Heave and two rotations of a rigid plate on four corners: three dofs, four rows, one of them twice.
    let corners = [[1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, -1.0, -1.0]];
    for corrected in [false, true] {
        let rows = corners.iter().fold(LinearRows::new(), |rows, c| {
            rows.unilateral(&[(0, c[0]), (1, c[1]), (2, c[2])], if corrected { 0.0305 } else { 0.0 })
        });
        let system = free(&[4.0, 1.0, 2.0]).load(|_, f| f[0] = -40.0);
        // An impact, or rest from the start.
        let speed = if corrected { -1.0 } else { 0.0 };
        let builder = Simulation::builder(system, Composite, 0.01).velocity(vec![speed, 0.0, 0.0]).constraint(rows);
        let builder = if corrected { builder.corrector(PersistencyCorrection::new()) } else { builder.uncorrected() };
        let mut run = builder.build().unwrap();
        for _ in 0..8 {
            println!(
                "{} {:?} {:?} {:?}",
                run.time(),
                run.state().displacement(),
                run.state().contacts().raw_forces(),
                run.gaps()
            );
            run.step().unwrap();
        }
        run.run_until(0.5, &mut ()).unwrap();
        let forces = run.state().contacts().forces().to_vec();
        assert!((forces.iter().sum::<f64>() - 40.0).abs() < 1e-9, "{forces:?}");
        // The doubled corner shares what the others bear alone; least norm spreads the twist as well.
        assert!((forces[0] - forces[4]).abs() < 1e-9, "{forces:?}");
        assert!((forces[1] - forces[3]).abs() < 1e-9 && forces.iter().all(|f| *f > 5.0), "{forces:?}");
        let u = run.state().displacement();
        assert!(run.gaps().iter().all(|gap| gap.abs() < 1e-12) && u[1].abs() < 1e-12 && u[2].abs() < 1e-12, "{u:?}");
    }
}
