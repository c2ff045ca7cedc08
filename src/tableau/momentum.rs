//! The momentum that a scheme conserves, as a functional of the past.

use super::{Stage, Tableau, no_stage};
use crate::error::Result;

/// Weights of motion without stiffness and damping.
const RIGID: [f64; 3] = [0.0, 0.0, 1.0];

/// The linear functional of the past that is the momentum of a scheme, and the contribution of each stage's
/// multiplier.
///
/// ψ is the left eigenvector for the eigenvalue 1 of the step at K = C = 0, scaled so that free flight with velocity V
/// gives V: momentum = 1ᵀ M ψ·(past)/h. A raw multiplier λ of stage s changes it by `h β_s λ`; an edit of the state or
/// of the past by M ψ·(edit)/h.
///
/// ```
/// use contact_dynamics::{Composite, TimeIntegrator};
/// let momentum = Composite.tableau().momentum();
/// // (U0 − U1) + (V0 − V1) for the composite scheme.
/// assert!((momentum.after_step()[0][0] - 1.0).abs() < 1e-12);
/// assert!((momentum.after_step()[1][1] + 1.0).abs() < 1e-12);
/// assert!((momentum.impulse_weights()[0] - 1.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Momentum {
    /// Covector after each stage: `[stage][k][field]`, fields U, V, A.
    covectors: Vec<Vec<[f64; 3]>>,
    weights: Vec<f64>,
}

impl Tableau {
    /// The momentum functional and the impulse weights of the stages; see [`Momentum`].
    pub fn momentum(&self) -> Momentum {
        Momentum::of(self)
    }
}

impl Momentum {
    fn of(tableau: &Tableau) -> Self {
        let stages = tableau.stages.len().max(1);
        let map = tableau.step_map(RIGID);
        let size = map.len();
        // (mapᵀ − 1) ψ = 0.
        let transposed =
            (0..size).map(|i| (0..size).map(|j| map[j][i] - f64::from(u8::from(i == j))).collect()).collect();
        let mut psi = null_vector(transposed);
        let flight: f64 = psi.chunks(3).enumerate().map(|(k, p)| p[1] - k as f64 * p[0]).sum();
        for p in &mut psi {
            *p /= flight;
        }

        // Pull back through the stages, last to first. Intermediate states are dropped after the last stage.
        let mut covector: Vec<[f64; 3]> = psi.chunks(3).map(|p| [p[0], p[1], p[2]]).collect();
        covector.splice(1..1, std::iter::repeat_n([0.0; 3], stages - 1));
        covector.push([0.0; 3]); // the oldest state leaves the past
        let mut covectors = vec![covector];
        for stage in tableau.stages.iter().skip(1).rev() {
            covectors.push(pull_back(&covectors[covectors.len() - 1], stage));
        }
        covectors.reverse();
        let weights = tableau
            .stages
            .iter()
            .zip(&covectors)
            .map(|(stage, covector)| impulse_weight(stage.response(), covector))
            .collect();
        Self { covectors, weights }
    }

    /// The covector over the past after stage `s`: `[k][field]`, k = 0 the state of that stage, fields U, V, A.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if there is no such stage.
    pub fn after_stage(&self, s: usize) -> Result<&[[f64; 3]]> {
        self.covectors.get(s).map(Vec::as_slice).ok_or_else(|| no_stage(s))
    }

    /// The covector over the kept past after a whole step: `[k][field]`.
    pub fn after_step(&self) -> Vec<[f64; 3]> {
        let (stages, last) = (self.covectors.len(), &self.covectors[self.covectors.len() - 1]);
        let mut kept = last.clone();
        kept.drain(1..stages);
        kept.pop();
        kept
    }

    /// The covectors while `start` (one stage) builds up the past: entry m − 1 is the one for m known states. Steps
    /// of `start` conserve them in turn, and the last one is [`after_step`](Self::after_step).
    pub(crate) fn during_start(&self, start: &Stage) -> Vec<Vec<[f64; 3]>> {
        let mut covectors = vec![self.after_step()];
        while covectors[covectors.len() - 1].len() > 1 {
            covectors.push(pull_back(&covectors[covectors.len() - 1], start));
        }
        covectors.reverse();
        covectors
    }

    /// β of each stage: a raw multiplier λ of the stage adds the impulse h β λ. They sum to 1.
    pub fn impulse_weights(&self) -> &[f64] {
        &self.weights
    }
}

/// β of a stage with this [`response`](Stage::response) and the covector after it: a raw multiplier λ changes the
/// momentum by h β λ.
pub(crate) fn impulse_weight(response: [f64; 3], covector: &[[f64; 3]]) -> f64 {
    response.iter().zip(covector[0]).map(|(change, psi)| change * psi).sum()
}

/// The covector before a stage, from the covector `after` it.
fn pull_back(after: &[[f64; 3]], stage: &Stage) -> Vec<[f64; 3]> {
    let width = after.len() - 1;
    let map = Tableau::stage_map(stage, RIGID, width);
    let through = |k: usize, field: usize| (0..3).map(|new| after[0][new] * map[new][3 * k + field]).sum::<f64>();
    (0..width).map(|k| std::array::from_fn(|field| after[k + 1][field] + through(k, field))).collect()
}

/// A vector in the null space of a small matrix of rank deficiency one, by elimination with complete pivoting.
fn null_vector(mut a: Vec<Vec<f64>>) -> Vec<f64> {
    let n = a.len();
    let mut columns: Vec<usize> = (0..n).collect();
    for k in 0..n - 1 {
        let magnitude = |&(i, j): &(usize, usize)| a[i][columns[j]].abs();
        let places = (k..n).flat_map(|i| (k..n).map(move |j| (i, j)));
        let best = places.max_by(|x, y| magnitude(x).total_cmp(&magnitude(y)));
        let Some((i, j)) = best else { break };
        a.swap(k, i);
        columns.swap(k, j);
        let (pivots, rest) = a.split_at_mut(k + 1);
        let pivot = &pivots[k];
        for row in rest {
            let factor = row[columns[k]] / pivot[columns[k]];
            if factor.is_finite() {
                row.iter_mut().zip(pivot).for_each(|(x, p)| *x -= factor * p);
            }
        }
    }
    let mut x = vec![0.0; n];
    x[columns[n - 1]] = 1.0;
    for k in (0..n - 1).rev() {
        let sum: f64 = columns[k + 1..].iter().map(|&j| a[k][j] * x[j]).sum();
        x[columns[k]] = -sum / a[k][columns[k]];
    }
    x
}
