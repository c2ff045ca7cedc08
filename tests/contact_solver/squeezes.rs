//! Rows that depend on one another and come to contradict each other: solved while they can be met, refused from then
//! on.

use contact_dynamics::contact_solver::{ContactSolver, Pivoting};
use contact_dynamics::{ActiveSet, Composite, Error, Newmark, PersistencyCorrection, Simulation, TimeIntegrator};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::squeeze::{Squeeze, Walls};

const SCHEMES: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Composite), || Box::new(Newmark::trapezoidal())];

/// Ratios of masses and stiffnesses, and what of a gap is rounding there, over the sizes of its terms.
const RATIOS: [(f64, f64); 5] = [(1.0, 1e-9), (1e2, 1e-9), (1e4, 1e-8), (1e6, 1e-6), (1e8, 1e-5)];

/// Steps until the first error, or `steps` times; the last time reached and the error. No gap may be violated.
fn run(
    squeeze: &Squeeze,
    scheme: Box<dyn TimeIntegrator>,
    solver: Box<dyn ContactSolver<f64>>,
    correction: Option<PersistencyCorrection>,
    (steps, rounding): (usize, f64),
) -> (f64, Option<Error>) {
    let builder =
        Simulation::builder(squeeze.system(), scheme, squeeze.h).constraint(squeeze.contact()).contact_solver(solver);
    let mut run = match correction {
        None => builder.uncorrected().build().unwrap(),
        Some(correction) => builder.corrector(correction).build().unwrap(),
    };
    for _ in 0..steps {
        if let Err(error) = run.step() {
            return (run.time(), Some(error));
        }
        let violation = squeeze.violation(run.time(), run.state().displacement());
        assert!(violation < rounding, "t = {}: {violation:e}, {squeeze:?}", run.time());
    }
    (run.time(), None)
}

#[test]
fn two_masses_between_a_wall_a_lever_and_a_stop() {
    for scheme in SCHEMES {
        let solvers: [Box<dyn ContactSolver<f64>>; 2] = [Box::new(ActiveSet::default()), Box::new(Pivoting::default())];
        for solver in solvers {
            let (t, error) = run(&Squeeze::smallest(), scheme(), solver, None, (20, 1e-9));
            assert!((t - 0.05).abs() < 1e-12, "{t} {error:?}");
            assert!(error.is_some_and(|error| error.is_recoverable()));
        }
    }
}

#[test]
fn squeezed_bodies_are_followed_until_there_is_no_room() {
    for (ratio, rounding) in RATIOS {
        let mut random = xorshift(3);
        for case in 0..400 {
            let squeeze = Squeeze::random(&mut random, ratio, Walls::Close);
            let correction = (case % 4 > 1).then(PersistencyCorrection::with_history_projection);
            let solver = Box::new(ActiveSet::default());
            let (t, error) = run(&squeeze, SCHEMES[case % 2](), solver, correction, (20, rounding));
            // The next step is the first without room.
            assert!(
                t < squeeze.until && squeeze.until < t + 1.000_001 * squeeze.h,
                "{case}: {t} {error:?} {squeeze:?}"
            );
            assert!(matches!(error, Some(Error::ContradictoryContacts { .. })), "{case}: {error:?} {squeeze:?}");
        }
    }
}

#[test]
fn dependent_rows_that_can_be_met_are_met() {
    for (ratio, rounding) in RATIOS {
        let mut random = xorshift(5);
        for case in 0..400 {
            let squeeze = Squeeze::random(&mut random, ratio, Walls::Yield);
            let correction = (case % 4 > 1).then(PersistencyCorrection::with_history_projection);
            let solver = Box::new(ActiveSet::default());
            let (t, error) = run(&squeeze, SCHEMES[case % 2](), solver, correction, (20, rounding));
            assert!(error.is_none(), "{case}, t = {t}: {error:?} {squeeze:?}");
        }
    }
}
