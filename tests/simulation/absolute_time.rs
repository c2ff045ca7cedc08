//! When a run starts changes nothing: spacings enter results, times do not.
#![allow(clippy::float_cmp)] // the same bits are meant

use contact_dynamics::{
    EnergyMomentum, Error, LinearRows, LinearSystem, Newmark, Park, PersistencyCorrection, Simulation,
    SimulationBuilder, State, StepControl, TimeIntegrator, analysis,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::schemes::{Listed, all, correctable};
use contact_dynamics_scenes::sparse::{matrix, springs};

/// A million seconds; the age of a clock that counts from 1970; powers of two; before zero.
const STARTS: [f64; 5] = [1e6, 1.7e9, 1_048_576.0, 1_073_741_824.0, -1e9];

fn spring(k: f64) -> LinearSystem<'static, f64> {
    let k = matrix(1, [(0, 0, k)]);
    LinearSystem::lumped(vec![1.0], k).unwrap()
}

fn bars(scheme: &Listed, bars: &Bars) -> SimulationBuilder<'static, f64> {
    let builder = Simulation::builder(bars.system::<f64>(), (scheme.make)(), 1e-3).velocity(bars.velocities());
    match (scheme.takes_multipliers(), scheme.takes_corrections()) {
        (true, true) => builder.constraint(bars.contact()).corrector(PersistencyCorrection::with_history_projection()),
        (true, false) => builder.constraint(bars.contact()).uncorrected(),
        (false, _) => builder,
    }
}

/// Everything but the time, bit for bit.
fn assert_same(found: &State<f64>, expected: &State<f64>, case: &str) {
    assert_eq!(found.displacement(), expected.displacement(), "{case}");
    assert_eq!(found.velocity(), expected.velocity(), "{case}");
    assert_eq!(found.acceleration(), expected.acceleration(), "{case}");
    assert_eq!(found.contacts(), expected.contacts(), "{case}");
}

/// Two bars that meet, touch and part, with another step size for every step.
#[test]
fn runs_with_changing_steps_are_the_same_whenever_they_start() {
    for scheme in all() {
        let scene = Bars::paper(8).delayed(0.35, 1e-3);
        let run = |t0: f64| {
            let mut run = bars(&scheme, &scene).start_time(t0).build().unwrap();
            let mut draw = xorshift(7);
            let mut elapsed = 0.0;
            while elapsed < 0.4 {
                let h = 1e-3 * 3.0_f64.powf(draw() - 0.5);
                run.set_step_size(h).unwrap();
                run.step().unwrap();
                elapsed += h;
            }
            // Times are the rounded ones of an exact clock, however often the step has changed.
            assert!((run.time() - (t0 + elapsed)).abs() <= 2.0 * f64::EPSILON * t0.abs() + 1e-13, "{}", run.time());
            run.state().clone()
        };
        let expected = run(0.0);
        assert!(expected.displacement().iter().all(|u| u.is_finite()));
        for t0 in STARTS {
            assert_same(&run(t0), &expected, &format!("{}, t0 = {t0:e}", scheme.name()));
        }
    }
}

/// Steps near the resolution of the time.
#[test]
fn steps_as_small_as_times_can_tell_are_resampled_right() {
    for listed in all() {
        let make = listed.make;
        for (t0, h) in [(1e9, 1e-6), (1.7e9, 3e-7)] {
            let run = |t0: f64| {
                let omega = 0.1 / h;
                let system = spring(omega * omega);
                let mut run =
                    Simulation::builder(system, make(), h).displacement(vec![1.0]).start_time(t0).build().unwrap();
                for i in 0..200 {
                    run.set_step_size(if i % 3 == 0 { h } else { 1.5 * h }).unwrap();
                    run.step().unwrap();
                }
                run.state().clone()
            };
            assert_same(&run(t0), &run(0.0), &format!("{}, t0 = {t0:e}, h = {h:e}", make().name()));
        }
    }
}

#[test]
fn steps_are_controlled_alike_whenever_a_run_starts() {
    for scheme in correctable().filter(|scheme| analysis::local_error(&(scheme.make)().tableau()).is_some()) {
        let scene = Bars::paper(8).delayed(0.35, 1e-3);
        let run = |t0: f64| {
            let control = StepControl::halving(1e-6).unwrap().local_error(2e-6).unwrap();
            let mut run = bars(&scheme, &scene).start_time(t0).step_control(control).build().unwrap();
            run.run_until(t0 + 0.25, &mut ()).unwrap();
            // Off the grid, in numbers that all starts can add.
            run.land_on(t0 + 0.28125 + 1.0 / 16_384.0, &mut ()).unwrap();
            run.land_on(t0 + 0.3125, &mut ()).unwrap();
            assert!((run.time() - (t0 + 0.3125)).abs() <= 1e-15, "{}: {:e}", scheme.name(), run.time() - t0);
            (run.state().clone(), *run.statistics(), run.step_size())
        };
        let (expected, statistics, h) = run(0.0);
        assert!(statistics.refused_steps > 0);
        for t0 in [1_048_576.0, 16_777_216.0, -16_777_216.0] {
            let found = run(t0);
            let case = format!("{}, t0 = {t0:e}", scheme.name());
            assert_same(&found.0, &expected, &case);
            assert_eq!((found.1, found.2), (statistics, h), "{case}");
        }
    }
}

/// A driven end, along the path of the step too; times are numbers that all starts can add.
#[test]
fn driven_ends_move_alike_whenever_a_run_starts() {
    let h = 1.0 / 128.0;
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] =
        [|| Box::new(EnergyMomentum), || Box::new(Newmark::trapezoidal()), || Box::new(Park)];
    for make in schemes {
        let run = |t0: f64| {
            let [k, c] = [40.0; 2].map(|k| matrix(2, springs(2, k)));
            let drive = move |t: f64| {
                let (sin, cos) = (3.0 * (t - t0)).sin_cos();
                [sin, 3.0 * cos, -9.0 * sin]
            };
            let system = LinearSystem::lumped(vec![1.0, 1.0], k).unwrap().damping(c).unwrap().drive(0, drive).unwrap();
            let mut run = Simulation::builder(system, make(), h).start_time(t0).build().unwrap();
            run.run_until(t0 + 1.0, &mut ()).unwrap();
            run.land_on(t0 + 1.0 + 1.0 / 512.0, &mut ()).unwrap();
            run.state().clone()
        };
        let expected = run(0.0);
        for t0 in [1_048_576.0, 1_073_741_824.0] {
            assert_same(&run(t0), &expected, &format!("{}, t0 = {t0:e}", make().name()));
        }
    }
}

#[test]
fn runs_end_and_land_where_they_are_told_however_late() {
    for t0 in [0.0, 1e6, 1e9, 1.7e9, -1e9] {
        for h in [1e-3, 7e-5, 1e-6] {
            let mut run = Simulation::builder(spring(1.0), Park, h).start_time(t0).build().unwrap();
            run.run_until(t0 + 100.0 * h, &mut ()).unwrap();
            assert_eq!(run.statistics().steps, 100, "t0 = {t0:e}, h = {h:e}");
            // The grid begins anew with another step size, and is met still.
            run.set_step_size(0.3 * h).unwrap();
            run.run_until(t0 + 100.0 * h + 100.0 * 0.3 * h, &mut ()).unwrap();
            assert_eq!(run.statistics().steps, 200, "t0 = {t0:e}, h = {h:e}");
            let end = t0 + 151.4 * h;
            run.land_on(end, &mut ()).unwrap();
            assert!((run.time() - end).abs() <= 2.0 * f64::EPSILON * end.abs(), "{:e}", run.time() - end);
            assert!(run.statistics().steps <= 272 && run.step_size() == 0.3 * h);
            run.land_on(end, &mut ()).unwrap();
        }
    }
}

#[test]
fn steps_that_do_not_change_the_time_are_refused() {
    let refused = |result: Result<(), Error>, size: f64| match result {
        Err(error @ Error::TimeNotAdvancing { t, h, .. }) => {
            assert!(t == 1e9 && h == size && error.to_string().contains("nearer"), "{error}");
            assert!(!error.is_recoverable());
        }
        other => panic!("{other:?}"),
    };
    // At build,
    let build = |h: f64| Simulation::builder(spring(1.0), Park, h).start_time(1e9).velocity(vec![-1.0]);
    refused(build(1e-8).build().map(drop), 1e-8);
    // by hand,
    let mut run = build(1e-3).build().unwrap();
    let (state, mut other) = (run.state().clone(), build(1e-3).build().unwrap());
    refused(run.set_step_size(1e-8), 1e-8);
    assert_eq!((run.state(), run.step_size()), (&state, 1e-3));
    run.step().unwrap();
    other.step().unwrap();
    assert_eq!(run.state(), other.state());
    // resumed,
    let (state, history) = (run.state().clone(), run.history().clone());
    assert!(build(1e-3).resume(state, history).build().is_ok());
    // and under control: the impact is to be met by steps that there are none of.
    let control = StepControl::halving(1e-12).unwrap().local_error(1e-11).unwrap();
    let mut run = build(1e-3)
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.5e-3))
        .corrector(PersistencyCorrection::new())
        .step_control(control)
        .build()
        .unwrap();
    let (before, error) = loop {
        let before = (run.state().clone(), run.step_size());
        if let Err(error) = run.step() {
            break (before, error);
        }
        assert!(run.time() < 1e9 + 1.0, "the impact was passed");
    };
    match error {
        Error::TimeNotAdvancing { t, h, resolution } => {
            assert!(t == run.time() && h < resolution && 2.0 * h >= resolution);
        }
        other => panic!("{other:?}"),
    }
    assert_eq!((run.state(), run.step_size()), (&before.0, before.1));
    // Times grow past what a step size can change.
    let late = 9_007_199_254_740_990.0;
    let mut run = Simulation::builder(spring(1.0), Park, 1.0).start_time(late).build().unwrap();
    run.step().unwrap();
    run.step().unwrap();
    let before = run.state().clone();
    assert!(matches!(run.step(), Err(Error::TimeNotAdvancing { .. })), "{:e}", run.time());
    assert_eq!(run.state(), &before);
}
