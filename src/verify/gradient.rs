//! Compares a gradient with differences of the objective.

use crate::error::{Error, Result};

/// A gradient beside central differences.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct GradientError {
    /// The largest relative error of a derivative; NaN if one is NaN. A derivative that is zero here and there has
    /// none.
    pub relative: f64,
    /// The parameter with this error.
    pub parameter: usize,
    /// The derivatives given, one a parameter.
    pub given: Vec<f64>,
    /// The derivatives by differences, one a parameter: by the quotients of both step sizes, extrapolated.
    pub expected: Vec<f64>,
    /// The relative difference between the quotients of both step sizes, one a parameter. Where contacts close or open
    /// in other steps under the varied parameters the objective has kinks, and this is not small.
    pub spread: Vec<f64>,
}

/// Compares derivatives of a function, such as a whole run, with central differences.
///
/// Each parameter is varied by its entry of `steps`, and by half of it: four values each. The error of the
/// extrapolated quotient is about step⁴ times the fifth derivative, plus ε |J|/step: use 1e-3 to 1e-4 of the scale of
/// the parameter. A large [`spread`](GradientError::spread) of one parameter says that a kink lies within the
/// difference: then compare at another point, or with smaller steps.
///
/// ```
/// use contact_dynamics::verify;
///
/// let value = |x: &[f64]| Ok(x[0].sin() * x[1]);
/// let (at, gradient) = ([0.3_f64, 2.0], [2.0 * 0.3_f64.cos(), 0.3_f64.sin()]);
/// let error = verify::gradient(value, &at, &gradient, &[1e-3, 1e-3])?;
/// assert!(error.relative < 1e-11 && error.spread.iter().all(|&spread| spread < 1e-6), "{error:?}");
/// // |x| at 0.4 steps from its kink.
/// let error = verify::gradient(|x: &[f64]| Ok(x[0].abs()), &[4e-4], &[1.0], &[1e-3])?;
/// assert!(error.spread[0] > 0.1);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Dimension`] unless there are as many derivatives and steps as parameters, [`Error::Parameter`] for a step
/// that is not positive and finite, and the errors of the function.
pub fn gradient(
    mut value: impl FnMut(&[f64]) -> Result<f64>,
    parameters: &[f64],
    gradient: &[f64],
    steps: &[f64],
) -> Result<GradientError> {
    for (what, found) in [("the gradient", gradient.len()), ("the steps of the parameters", steps.len())] {
        if found != parameters.len() {
            return Err(Error::Dimension { what, expected: parameters.len(), found });
        }
    }
    if let Some(&step) = steps.iter().find(|&&step| !(step > 0.0 && step.is_finite())) {
        return Err(Error::Parameter { name: "the step of a parameter", value: step, range: "positive and finite" });
    }
    let mut at = parameters.to_vec();
    let given = gradient.to_vec();
    let mut error = GradientError { relative: 0.0, parameter: 0, given, expected: Vec::new(), spread: Vec::new() };
    for (number, (&given, &step)) in gradient.iter().zip(steps).enumerate() {
        let mut quotient = |step: f64| {
            let mut ends = [0.0; 2];
            for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
                at[number] = parameters[number] + sign * step;
                *end = value(&at)?;
            }
            at[number] = parameters[number];
            Ok::<f64, Error>((ends[1] - ends[0]) / (2.0 * step))
        };
        let [whole, half] = [quotient(step)?, quotient(0.5 * step)?];
        let expected = (4.0 * half - whole) / 3.0;
        let relative = |difference: f64, x: f64, y: f64| match difference == 0.0 {
            true => 0.0,
            false => difference.abs() / x.abs().max(y.abs()),
        };
        let own = relative(given - expected, given, expected);
        if own.is_nan() || own > error.relative {
            (error.relative, error.parameter) = (own, number);
        }
        error.expected.push(expected);
        error.spread.push(relative(whole - half, whole, half));
    }
    Ok(error)
}
