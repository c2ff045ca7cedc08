//! A rank that fails: the step fails on all, with its own error there and its words on the others; nothing has moved,
//! and the run goes on. Nobody waits in vain.

use crate::bodies::{Blocks, Seen, linear_part, record};
use crate::parts::{HyperelasticPart, SolidPart, on_ranks};
use contact_dynamics::observer::{Control, StepView};
use contact_dynamics::{Composite, Error, Newton, Outcome, Result, Simulation, SimulationBuilder, StepControl};
use contact_dynamics_scenes::hosts::Hooked;
use contact_dynamics_scenes::hyperelastic::Law;
use std::panic::{AssertUnwindSafe, catch_unwind};

const RANKS: usize = 3;
const H: f64 = 4e-3;

/// What the failing rank does when its host is called for the n-th time.
#[derive(Clone, Copy)]
enum Failing {
    ForGood,
    Inadmissible,
    NotANumber,
    Panics,
}

/// A hook that fails once, at the n-th call of a method.
fn failing(
    method: &'static str,
    (call, how): (usize, Failing),
) -> impl FnMut(&'static str, f64, &mut [f64]) -> Result<()> + Send {
    let mut calls = 0;
    move |name, t, out| {
        if name != method {
            return Ok(());
        }
        calls += 1;
        if calls != call {
            return Ok(());
        }
        let source = || format!("element 17 at {t}").into();
        match how {
            Failing::ForGood => Err(Error::Host { callback: method, source: source() }),
            Failing::Inadmissible => Err(Error::Inadmissible { callback: method, source: source() }),
            Failing::NotANumber => {
                out.fill(f64::NAN);
                Ok(())
            }
            Failing::Panics => panic!("element 17"),
        }
    }
}

/// The run of one of three ranks, of which rank 1 fails as told.
fn with_ranks<R: Send>(
    nonlinear: bool,
    (method, call, how): (&'static str, usize, Failing),
    setting: fn(SimulationBuilder<'static, f64>) -> SimulationBuilder<'static, f64>,
    run: impl Fn(usize, Simulation<'static, f64>, &dyn Fn(&[f64]) -> Vec<f64>) -> R + Sync,
) -> Vec<R> {
    let blocks = Blocks::new();
    on_ranks(RANKS, |rank, meeting| {
        let call = if rank == 1 { call } else { usize::MAX };
        let set_up = |part: &SolidPart<2>| {
            let hook = failing(method, (call, how));
            if nonlinear {
                let body = HyperelasticPart::new(&part.cut, part.part.clone(), Law::NeoHookean);
                Simulation::builder(Hooked::new(body, hook), Composite, H)
            } else {
                Simulation::builder(Hooked::new(linear_part(part, false), hook), Composite, H)
            }
        };
        let (part, builder) = blocks.on_rank((rank, meeting), set_up).unwrap();
        let simulation = setting(builder).build().unwrap();
        run(rank, simulation, &|values| part.part.gather(values).unwrap())
    })
}

/// Steps until one fails: the number of those that did not, and the error.
fn until_failure(run: &mut Simulation<'_, f64>) -> (usize, Error) {
    for taken in 0..40 {
        let before = (run.state().clone(), run.history().clone());
        if let Err(error) = run.step() {
            let bits = |x: &[f64]| -> Vec<u64> { x.iter().map(|x| x.to_bits()).collect() };
            let state = run.state();
            assert_eq!(bits(state.displacement()), bits(before.0.displacement()));
            assert_eq!(bits(state.velocity()), bits(before.0.velocity()));
            assert_eq!(bits(state.acceleration()), bits(before.0.acceleration()));
            assert_eq!(bits(state.contacts().raw_forces()), bits(before.0.contacts().raw_forces()));
            return (taken, error);
        }
    }
    panic!("nothing has failed");
}

/// Fails at some call on rank 1, and compares the rest of the run with one that never failed.
fn check_failure(nonlinear: bool, method: &'static str, call: usize, how: Failing) {
    let never = ("nothing", usize::MAX, how);
    let direction = |count: usize| vec![1.0; count];
    let steps = 12;
    let sound = with_ranks(
        nonlinear,
        never,
        |builder| builder,
        |_, mut run, whole| {
            let dofs = run.state().displacement().len();
            record(&mut run, steps, whole, &direction(dofs)).unwrap()
        },
    );
    let failed = with_ranks(
        nonlinear,
        (method, call, how),
        |builder| builder,
        |rank, mut run, whole| {
            let (taken, error) = until_failure(&mut run);
            let dofs = run.state().displacement().len();
            (rank, taken, error, record(&mut run, steps - taken, whole, &direction(dofs)).unwrap())
        },
    );
    let place = failed[1].1;
    for (rank, taken, error, rest) in &failed {
        assert_eq!(*taken, place, "all ranks fail in the same step");
        match (rank, error) {
            (1, own) => assert!(!matches!(own, Error::OtherRank { .. }), "{own:?}"),
            // (A solve over all ranks spreads what is not a number, and each finds it in its own part.)
            (_, Error::StepNotFinite { .. }) if matches!(how, Failing::NotANumber) => {}
            (_, Error::OtherRank { rank: 1, message, recoverable }) => {
                assert_eq!(*recoverable, failed[1].2.is_recoverable(), "{message}");
                let word = if matches!(how, Failing::NotANumber) { "NaN" } else { "element 17" };
                assert!(message.contains(word) && failed[1].2.to_string().contains(word), "{message}");
            }
            (rank, other) => panic!("rank {rank}: {other:?}"),
        }
        let bits = |seen: &Seen| -> Vec<u64> { seen.motion.iter().flatten().map(|x| x.to_bits()).collect() };
        for (seen, expected) in rest.iter().zip(&sound[*rank][*taken..]) {
            assert_eq!(bits(seen), bits(expected), "{method} {call}");
        }
    }
}

#[test]
fn a_force_that_fails_on_one_rank() {
    for how in [Failing::ForGood, Failing::Inadmissible, Failing::NotANumber] {
        check_failure(false, "force", 14, how);
        check_failure(true, "force", 25, how);
        check_failure(true, "tangent", 20, how);
    }
    check_failure(false, "commit", 7, Failing::ForGood);
    check_failure(true, "commit", 7, Failing::Inadmissible);
}

#[test]
fn inadmissible_states_are_taken_back_by_all() {
    // With step control all ranks halve the step; with a line search all shorten the increment.
    let control = |builder: SimulationBuilder<'static, f64>| builder.step_control(StepControl::halving(1e-5).unwrap());
    let search = |builder: SimulationBuilder<'static, f64>| builder.newton(Newton::full().line_search());
    let fails = ("force", 25, Failing::Inadmissible);
    for refused in with_ranks(true, fails, control, |_, mut run, _| {
        (0..20).for_each(|_| run.step().unwrap());
        run.statistics().refused_steps
    }) {
        assert_eq!(refused, 1);
    }
    let taken = with_ranks(true, fails, search, |_, mut run, _| {
        let result = (0..20).try_for_each(|_| run.step());
        result.map(|()| run.statistics().newton_iterations)
    });
    for iterations in &taken {
        assert_eq!(iterations.as_ref().ok(), taken[0].as_ref().ok(), "{taken:?}");
        assert!(iterations.is_ok(), "{iterations:?}");
    }
}

#[test]
fn a_panic_on_one_rank() {
    let failed = with_ranks(
        false,
        ("force", 14, Failing::Panics),
        |builder| builder,
        |rank, mut run, _| {
            let result = catch_unwind(AssertUnwindSafe(|| (0..40).try_for_each(|_| run.step())));
            (rank, result.map_err(|_| ()))
        },
    );
    for (rank, result) in failed {
        match (rank, result) {
            (1, result) => assert!(result.is_err(), "the panic goes on"),
            (_, Ok(Err(Error::OtherRank { rank: 1, recoverable: false, .. }))) => {}
            (rank, other) => panic!("rank {rank}: {other:?}"),
        }
    }
}

#[test]
fn observers_that_stop_or_fail_on_one_rank() {
    let never = ("nothing", usize::MAX, Failing::ForGood);
    let stopped = with_ranks(
        false,
        never,
        |builder| builder,
        |rank, mut run, _| {
            let observer = |step: &StepView<'_, f64>| match rank == 2 && step.state.time() > 5.5 * H {
                true => Control::Stop,
                false => Control::Continue,
            };
            let outcome = run.run_until(20.0 * H, &mut { observer }).unwrap();
            (outcome, run.statistics().steps)
        },
    );
    assert!(stopped.iter().all(|&seen| seen == (Outcome::Stopped, 6)), "{stopped:?}");
    let failed = with_ranks(
        false,
        never,
        |builder| builder,
        |rank, mut run, _| {
            let observer = |step: &StepView<'_, f64>| match rank == 2 && step.state.time() > 5.5 * H {
                true => Err(Error::Host { callback: "observer", source: "full disk".into() }),
                false => Ok(Control::Continue),
            };
            let error = run.run_until(20.0 * H, &mut { observer }).unwrap_err();
            // The step was taken, and the run goes on.
            run.step().unwrap();
            (error.to_string(), run.statistics().steps)
        },
    );
    assert!(failed.iter().all(|(error, steps)| error.contains("full disk") && *steps == 7), "{failed:?}");
}
