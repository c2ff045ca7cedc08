//! The paper's experiment against the figures of two independent prototypes and against theory.

use contact_dynamics::corrector::Parts;
use contact_dynamics::{Bathe, Composite, Corrector, Newmark, PersistencyCorrection, TimeIntegrator};
use contact_dynamics_scenes::measure::{Figures, figures};
use contact_dynamics_scenes::{Bars, record};

const H: f64 = 1e-3;
const UNTIL: f64 = 0.4;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Scheme {
    Newmark,
    Composite,
    Bathe,
}

fn integrator(scheme: Scheme) -> Box<dyn TimeIntegrator> {
    match scheme {
        Scheme::Newmark => Box::new(Newmark::trapezoidal()),
        Scheme::Composite => Box::new(Composite),
        Scheme::Bathe => Box::new(Bathe::default()),
    }
}

const PAPER: PersistencyCorrection = PersistencyCorrection::new();
const FULL: PersistencyCorrection = PersistencyCorrection::with_history_projection();

fn run(bars: &Bars, scheme: Scheme, correction: Option<PersistencyCorrection>, h: f64) -> Figures {
    run_until(bars, scheme, correction, h, 4.0 * bars_time(bars))
}

fn run_until(bars: &Bars, scheme: Scheme, correction: Option<PersistencyCorrection>, h: f64, until: f64) -> Figures {
    let corrector = correction.map(|c| Box::new(c) as Box<dyn Corrector<f64>>);
    figures(bars, &record(bars, integrator(scheme), corrector, h, until), h)
}

/// The impact time at phase 0 in the units of the bars: equal to the travel time of a wave through one bar.
fn bars_time(bars: &Bars) -> f64 {
    bars.length[0] / (bars.young[0] / bars.density[0]).sqrt()
}

fn phases() -> impl Iterator<Item = f64> {
    (0..10).map(|k| 0.05 + 0.1 * f64::from(k))
}

fn sweep(n: usize, scheme: Scheme, correction: Option<PersistencyCorrection>, h: f64) -> Vec<Figures> {
    phases().map(|phase| run(&Bars::paper(n).delayed(phase, h), scheme, correction, h)).collect()
}

fn worst(figures: &[Figures], f: impl Fn(&Figures) -> f64) -> f64 {
    figures.iter().map(f).fold(f64::MIN, f64::max)
}

fn best(figures: &[Figures], f: impl Fn(&Figures) -> f64) -> f64 {
    figures.iter().map(f).fold(f64::MAX, f64::min)
}

/// Figures of the prototypes at phase 0: (force RMS, max, energy), and worst force RMS and lowest energy of a phase
/// sweep.
struct Expected {
    n: usize,
    scheme: Scheme,
    correction: Option<PersistencyCorrection>,
    phase_0: [f64; 3],
    worst: Option<(f64, f64)>,
}

fn table() -> Vec<Expected> {
    use Scheme::{Bathe as B, Composite as C, Newmark as N};
    let velocity = PAPER.parts(Parts::Velocity);
    let row = |n, scheme, correction, phase_0, worst| Expected { n, scheme, correction, phase_0, worst };
    vec![
        row(20, C, None, [1.20, 9.1, 0.956], None),
        row(50, C, None, [0.242, 2.96, 0.979], None),
        row(100, C, None, [0.118, 2.02, 0.983], None),
        row(20, C, Some(velocity), [0.114, 1.45, 0.974], None),
        row(50, C, Some(velocity), [0.072, 1.12, 0.982], None),
        row(100, C, Some(velocity), [0.065, 1.14, 0.983], None),
        row(20, C, Some(PAPER), [0.124, 1.10, 0.974], Some((0.235, 0.964))),
        row(50, C, Some(PAPER), [0.082, 1.12, 0.982], Some((0.117, 0.982))),
        row(100, C, Some(PAPER), [0.067, 1.14, 0.983], Some((0.095, 0.983))),
        row(20, C, Some(FULL), [0.124, 1.10, 0.974], Some((0.142, 0.973))),
        row(50, C, Some(FULL), [0.082, 1.12, 0.982], Some((0.107, 0.982))),
        row(100, C, Some(FULL), [0.067, 1.14, 0.983], Some((0.095, 0.983))),
        row(20, N, Some(PAPER), [0.122, 1.10, 0.975], None),
        row(50, N, Some(PAPER), [0.076, 1.12, 0.990], None),
        row(100, N, Some(PAPER), [0.058, 1.17, 0.995], None),
        row(20, B, Some(PAPER), [0.122, 1.09, 0.975], None),
        row(50, B, Some(PAPER), [0.074, 1.10, 0.988], None),
        row(100, B, Some(PAPER), [0.052, 1.13, 0.990], None),
    ]
}

#[test]
fn figures_at_phase_0_are_those_of_the_prototypes() {
    for Expected { n, scheme, correction, phase_0, .. } in table() {
        let found = run(&Bars::paper(n), scheme, correction, H);
        let found = [found.force_rms, found.force_max, found.energy];
        for (found, expected) in found.iter().zip(phase_0) {
            assert!(
                (found / expected - 1.0).abs() < 0.03,
                "n = {n}, {scheme:?}, {correction:?}: {found} for {expected}"
            );
        }
    }
}

#[test]
fn figures_at_other_phases_stay_inside_the_sweep_bounds() {
    for Expected { n, scheme, correction, worst: bounds, .. } in table() {
        let Some((force_rms, energy)) = bounds else { continue };
        let sweep = sweep(n, scheme, correction, H);
        let rms = worst(&sweep, |f| f.force_rms);
        assert!(rms < 1.03 * force_rms, "n = {n}, {scheme:?}, {correction:?}: force RMS {rms}");
        let loss = best(&sweep, |f| f.energy);
        assert!((loss - energy).abs() < 1e-3, "n = {n}, {scheme:?}, {correction:?}: energy {loss}");
    }
}

#[test]
fn corrected_forces_are_bounded_at_every_phase() {
    // H1: force RMS ≤ .15 / .11 / .10, max ≤ 1.15 F0 (1.2 at n = 100), no force outside the contact interval, momentum
    // 1e-10.
    for (n, rms, max) in [(20, 0.15, 1.15), (50, 0.11, 1.15), (100, 0.10, 1.2)] {
        for scheme in [Scheme::Composite, Scheme::Newmark] {
            for phase in std::iter::once(0.0).chain(phases()) {
                let bars = Bars::paper(n).delayed(phase, H);
                let record = record::<f64>(&bars, integrator(scheme), Some(Box::new(FULL)), H, UNTIL);
                let found = figures(&bars, &record, H);
                let case = format!("n = {n}, {scheme:?}, phase {phase}: {found:?}");
                assert!(found.force_rms <= rms && found.force_max <= max && found.drift < 1e-10, "{case}");
                let outside = |&i: &usize| record.t[i] < 0.1 - 1e-9 || record.t[i] > 0.31;
                assert!((0..record.t.len()).filter(outside).all(|i| record.force[i] == 0.0), "{case}");
            }
        }
    }
}

#[test]
fn force_error_depends_little_on_the_phase_with_history_projection() {
    // H2. Without it the ratio is 1.7 at n = 20, h = 1 ms.
    for n in [20, 50] {
        for h in [2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4] {
            let sweep = sweep(n, Scheme::Composite, Some(FULL), h);
            let ratio = worst(&sweep, |f| f.force_rms) / best(&sweep, |f| f.force_rms);
            assert!(ratio < 1.3, "n = {n}, h = {h}: {ratio}");
        }
    }
    let plain = sweep(20, Scheme::Composite, Some(PAPER), H);
    assert!(worst(&plain, |f| f.force_rms) / best(&plain, |f| f.force_rms) > 1.5, "the projection is needed");
}

#[test]
fn raw_newmark_is_unusable() {
    // Chaotic: only bounds hold.
    for n in [20, 50] {
        for phase in std::iter::once(0.0).chain(phases()) {
            let found = run(&Bars::paper(n).delayed(phase, H), Scheme::Newmark, None, H);
            assert!(found.force_max > 10.0 && found.energy > 4.0, "n = {n}, phase {phase}: {found:?}");
        }
    }
    let sweep = sweep(100, Scheme::Newmark, None, H);
    assert!(worst(&sweep, |f| f.energy) > 4.0);
}

#[test]
fn corrected_trapezoidal_rule_loses_the_energy_of_the_contact_nodes() {
    // F1: exactly 1/(2n) of the energy.
    for n in [20, 50, 100] {
        let theory = 1.0 - 1.0 / (2.0 * n as f64);
        let at = |phase, h| run(&Bars::paper(n).delayed(phase, h), Scheme::Newmark, Some(PAPER), h).energy;
        let found = at(0.0, H);
        assert!((found - theory).abs() < 1e-4, "n = {n}, h = 1 ms: {found}");
        for phase in phases() {
            let fine = at(phase, 1e-4);
            assert!((fine - theory).abs() < 1e-4, "n = {n}, h = 0.1 ms, phase {phase}: {fine}");
            let coarse = at(phase, H);
            assert!(coarse < theory + 1e-4 && coarse > theory - 0.0023, "n = {n}, h = 1 ms, phase {phase}: {coarse}");
        }
    }
}

#[test]
fn consistent_mass_loses_what_theory_says() {
    // m_c of a consistent bar end is √3/6 ρAh: the loss is 0.288675/n. The projection spreads over the bar.
    use contact_dynamics_scenes::MassKind;
    for n in [20, 50] {
        let bars = Bars::paper(n).with_mass(MassKind::Consistent);
        for phase in [0.25, 0.65] {
            let found = run(&bars.delayed(phase, 1e-4), Scheme::Newmark, Some(PAPER), 1e-4);
            let theory = 1.0 - 0.288_675 / n as f64;
            assert!((found.energy - theory).abs() < 2e-4, "n = {n}: {} for {theory}", found.energy);
            assert!(found.closure < 1e-9, "{found:?}");
        }
    }
}

#[test]
fn results_do_not_depend_on_a_common_velocity() {
    // H6.
    for scheme in [Scheme::Composite, Scheme::Newmark] {
        for phase in [0.0, 0.35] {
            let at_rest = Bars::paper(50).delayed(phase, H);
            let reference = record::<f64>(&at_rest, integrator(scheme), Some(Box::new(FULL)), H, UNTIL);
            for velocity in [[0.1, 0.0], [5.0, 4.9]] {
                let boosted = Bars { velocity, ..at_rest };
                let found = record::<f64>(&boosted, integrator(scheme), Some(Box::new(FULL)), H, UNTIL);
                let boost = velocity[0] - 0.05;
                for i in 0..found.t.len() {
                    let force = (found.force[i] - reference.force[i]).abs() / 0.0125;
                    let speed = (found.v[i][0] - boost - reference.v[i][0]).abs() / 0.05;
                    assert!(
                        force < 1e-9 && speed < 1e-9,
                        "{scheme:?}, phase {phase}, {velocity:?}, step {i}: {force:e} {speed:e}"
                    );
                }
            }
        }
    }
}

#[test]
fn an_impact_at_a_grid_time_closes_at_that_time() {
    // The paper's impact falls on t = 0.1 exactly; the gap there is a rounding error of either sign.
    for scheme in [Scheme::Composite, Scheme::Newmark] {
        for h in [1e-3, 1e-4] {
            for velocity in [[0.05, -0.05], [0.1, 0.0], [5.0, 4.9]] {
                let bars = Bars { velocity, ..Bars::paper(50) };
                let record = record::<f64>(&bars, integrator(scheme), Some(Box::new(FULL)), h, 0.1);
                let [left, right] = record.v[record.v.len() - 1];
                assert!((left - right).abs() < 1e-12, "{scheme:?}, h = {h}, {velocity:?}: {left} {right}");
            }
        }
    }
}

#[test]
fn corrected_force_stays_bounded_when_the_step_shrinks_on_a_fixed_mesh() {
    // H7: the raw multiplier grows like 1/h, the corrected force does not.
    for h in [1e-3, 1e-4, 1e-5] {
        for phase in [0.15, 0.75] {
            let bars = Bars::paper(20).delayed(phase, h);
            for scheme in [Scheme::Composite, Scheme::Newmark] {
                let found = run(&bars, scheme, Some(FULL), h);
                assert!(found.force_max < 1.2, "{scheme:?}, h = {h}, phase {phase}: {found:?}");
            }
        }
    }
    let raw = |h| {
        let bars = Bars::paper(20).delayed(0.15, h);
        let record = record::<f64>(&bars, Composite, Some(Box::new(FULL)), h, 0.12);
        record.raw.iter().fold(0.0_f64, |a, &b| a.max(b)) / 0.0125
    };
    assert!(raw(1e-5) > 50.0 * raw(1e-3), "{} {}", raw(1e-5), raw(1e-3));
    assert!(raw(1e-5) > 500.0);
}

#[test]
fn force_stays_bounded_at_a_microsecond() {
    // The last point of H7: 350 000 steps.
    let bars = Bars::paper(20).delayed(0.35, 1e-6);
    let found = run_until(&bars, Scheme::Composite, Some(FULL), 1e-6, 0.35);
    assert!(found.force_max < 1.2 && found.force_rms < 0.15, "{found:?}");
    assert!((found.energy - (1.0 - 1.0 / 40.0)).abs() < 1e-4, "{found:?}");
    // Momentum of a multistep scheme is known to steps · eps |u|/(h |v|) = 8e-6 here.
    assert!(found.closure < 1e-6, "{found:?}");
}

#[test]
fn results_do_not_depend_on_the_unit_system() {
    // H11: mm-t-s and inch-lbf-s.
    let units = [(1e3, 1.0, 1e-3), (39.370_078_740_157_48, 1.0, 5.710_147_162_769_2e-3), (1e-6, 1e3, 1e9)];
    for scheme in [Scheme::Composite, Scheme::Newmark] {
        for phase in [0.0, 0.35] {
            let si = Bars::paper(20).delayed(phase, H);
            let reference = record::<f64>(&si, integrator(scheme), Some(Box::new(FULL)), H, UNTIL);
            for (length, time, mass) in units {
                let other = si.in_units(length, time, mass);
                let h = H * time;
                let found = record::<f64>(&other, integrator(scheme), Some(Box::new(FULL)), h, UNTIL * time);
                assert_eq!(found.t.len(), reference.t.len());
                let (newton, speed) = (mass * length / (time * time) * 0.0125, length / time * 0.05);
                for i in 0..found.t.len() {
                    let force = (found.force[i] / newton - reference.force[i] / 0.0125).abs();
                    let velocity = (found.v[i][1] / speed - reference.v[i][1] / 0.05).abs();
                    assert!(force < 1e-9 && velocity < 1e-9, "{scheme:?}, step {i}: {force:e} {velocity:e}");
                }
            }
        }
    }
}

#[test]
fn single_precision_shows_the_same_impact() {
    for scheme in [Scheme::Composite, Scheme::Newmark] {
        let bars = Bars::paper(50).delayed(0.35, H);
        let double = figures(&bars, &record::<f64>(&bars, integrator(scheme), Some(Box::new(FULL)), H, UNTIL), H);
        let single = figures(&bars, &record::<f32>(&bars, integrator(scheme), Some(Box::new(FULL)), H, UNTIL), H);
        assert!((single.force_rms - double.force_rms).abs() < 0.01, "{scheme:?}: {single:?} for {double:?}");
        assert!((single.energy - double.energy).abs() < 2e-3, "{scheme:?}: {single:?} for {double:?}");
    }
}
