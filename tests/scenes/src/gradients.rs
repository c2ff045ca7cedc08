//! Compares the gradient of a run by factors of M, C, K, F and of the initial velocities with differences.

use contact_dynamics::gradient::{RecordedStep, Scales, Seed};
use contact_dynamics::verify::{self, GradientError};
use contact_dynamics::{Result, Simulation};

/// Factors of M, C, K, F, of the initial velocities and of compliant forces, a number added to all friction
/// coefficients, and a distance added to all gaps.
pub const AT: [f64; 8] = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0];
pub const NAMES: [&str; 8] = ["mass", "damping", "stiffness", "load", "velocity", "contact", "friction", "gap"];

/// Makes runs with such factors.
pub type Build<'b> = dyn Fn(&[f64]) -> Result<Simulation<'static, f64>> + 'b;

/// Compares the first `varied` of the derivatives. `advance` takes a run to its end; a change of the gaps by `size`
/// counts as large as one of the factors by 1.
///
/// # Errors
///
/// Those of the builder, of the steps and of the gradient.
pub fn compare(
    build: &Build<'_>,
    advance: &dyn Fn(&mut Simulation<'static, f64>) -> Result<()>,
    (varied, size): (usize, f64),
) -> Result<GradientError> {
    let recorded = |at: &[f64]| {
        let mut run = build(&[at, &AT[at.len()..]].concat())?;
        run.record()?;
        advance(&mut run)?;
        Ok(run)
    };
    let mut run = recorded(&AT)?;
    let mut scales = Scales::default();
    let velocities = build(&AT)?.state().velocity().to_vec();
    let gradient = run.gradient(&mut objective, &mut scales)?;
    let velocity = gradient.velocity.iter().zip(&velocities).map(|(by, v)| by * v).sum();
    let sum = |list: &[(_, f64)]| list.iter().map(|&(_, by)| by).sum();
    let (gap, friction) = (sum(&gradient.gaps), sum(&gradient.friction));
    let all = [scales.mass, scales.damping, scales.stiffness, scales.load, velocity, scales.contact, friction, gap];
    let value = |at: &[f64]| Ok(recorded(at)?.gradient(&mut objective, &mut ())?.value);
    let steps = [1e-5, 1e-3, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5 * size];
    verify::gradient(value, &AT[..varied], &all[..varied], &steps[..varied])
}

/// A sum that reads everything that an objective can read.
pub fn objective(step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>) -> f64 {
    let state = step.state;
    let (t, dofs) = (state.time(), state.displacement().len());
    let weight = step.h * (1.0 + (3.0 * t).cos());
    let mut value = 0.0;
    for i in 0..dofs {
        let share = weight * (1.0 + (i as f64).sin());
        let (u, v, a) = (state.displacement()[i], state.velocity()[i], state.acceleration()[i]);
        value += share * (u * u + 0.3 * v + 0.01 * a);
        seed.displacement[i] += share * 2.0 * u;
        seed.velocity[i] += share * 0.3;
        seed.acceleration[i] += share * 0.01;
    }
    let (force, impulse) = (state.contacts().forces(), state.contacts().impulses());
    for i in 0..force.len() {
        let share = weight * (1.0 + 0.5 * (i as f64).cos());
        value += share * (force[i] + 0.2 * force[i] * force[i]) + (t.sin() + 0.5) * impulse[i];
        seed.force[i] += share * (1.0 + 0.4 * force[i]);
        seed.impulse[i] += t.sin() + 0.5;
    }
    value
}

/// The largest relative error of a derivative, beyond the rounding of differences beside the largest derivative.
pub fn largest_error(error: &GradientError) -> f64 {
    let largest = error.expected.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let beyond = |(given, expected): (&f64, &f64)| {
        ((given - expected).abs() - 1e-9 * largest).max(0.0) / expected.abs().max(f64::MIN_POSITIVE)
    };
    error.given.iter().zip(&error.expected).map(beyond).fold(0.0, f64::max)
}

/// Fails unless derivatives agree to 1e-6, and no kink lies near.
///
/// # Panics
///
/// If they differ.
pub fn assert_equal(error: &GradientError, what: &str) {
    assert_near(error, 1e-6, what);
}

/// [`assert_equal`] with another tolerance.
///
/// # Panics
///
/// If they differ.
pub fn assert_near(error: &GradientError, tolerance: f64, what: &str) {
    let largest = error.expected.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    for (k, (spread, expected)) in error.spread.iter().zip(&error.expected).enumerate() {
        let is_smooth = *spread < 1e-3 || expected.abs() < 1e-8 * largest;
        assert!(is_smooth, "{what}: a kink lies near, by {}: {error:?}", NAMES[k]);
    }
    assert!(largest_error(error) < tolerance, "{what}, by {}: {error:?}", NAMES[error.parameter]);
}
