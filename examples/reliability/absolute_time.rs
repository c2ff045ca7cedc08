//! Runs that start late: the same as those that start at zero.

use super::{Anything, Row};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{Bdf2, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Simulation, StepControl};

fn spring(k: f64) -> Result<LinearSystem<'static, f64>, Anything> {
    let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, k)])?;
    Ok(LinearSystem::lumped(vec![1.0], k)?)
}

/// Largest displacement error of an oscillator, Ω = 0.1, whose step alternates between h and 1.5 h, against the start
/// at 0.
fn resampled(t0: f64, h: f64) -> Result<f64, Anything> {
    let run = |t0: f64| -> Result<Vec<f64>, Anything> {
        let omega = 0.1 / h;
        let mut run =
            Simulation::builder(spring(omega * omega)?, Bdf2, h).displacement(vec![1.0]).start_time(t0).build()?;
        let mut path = Vec::new();
        for i in 0..200 {
            run.set_step_size(if i % 2 == 0 { h } else { 1.5 * h })?;
            run.step()?;
            path.push(run.state().displacement()[0]);
        }
        Ok(path)
    };
    let pairs = run(t0)?.into_iter().zip(run(0.0)?);
    Ok(pairs.map(|(x, y)| (x - y).abs()).fold(0.0, |worst, x| if x > worst || x.is_nan() { x } else { worst }))
}

fn told(result: Result<f64, Anything>) -> String {
    match result {
        Ok(error) => format!("{error:.1e}"),
        Err(error) => error.to_string(),
    }
}

/// Steps that step control takes at an impact without the time going on.
fn stalled() -> Result<String, Anything> {
    let control = StepControl::halving(1e-12)?.local_error(1e-11)?;
    let mut run = Simulation::builder(spring(1.0)?, Newmark::trapezoidal(), 1e-3)
        .start_time(1e9)
        .velocity(vec![-1.0])
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.6e-3))
        .corrector(PersistencyCorrection::new())
        .step_control(control)
        .build()?;
    let mut still = 0;
    for _ in 0..2000 {
        let before = run.time();
        match run.step() {
            Ok(()) => still += u32::from(run.time() <= before),
            Err(error) => return Ok(format!("{still} of them, then: {error}")),
        }
    }
    Ok(format!("{still} of 2000"))
}

pub(crate) fn cases(_quick: bool) -> Result<Vec<Row>, Anything> {
    let case = |case: &str, before, now: String| Row { case: case.into(), before, now };
    Ok(vec![
        case(
            "BDF2, h = 1e-6 and 1.5e-6 in turn, t₀ = 1e9: error against t₀ = 0",
            BEFORE[0],
            told(resampled(1e9, 1e-6)),
        ),
        case("the same, h = 1e-7, t₀ = 1.7e9", BEFORE[1], told(resampled(1.7e9, 1e-7))),
        case("step control at an impact, t₀ = 1e9: steps that do not change t", BEFORE[2], stalled()?),
    ])
}

const BEFORE: [&str; 3] =
    ["1.3e-2", "step from t = 1.7e9 with h = 1.5e-7: the increment of dof 0 is NaN", "38 of 2000"];
