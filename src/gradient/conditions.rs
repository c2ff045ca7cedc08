//! The transpose of the conditions of contact rows: of gaps, slips or jumps y and of multipliers x.
//!
//! Forward, with y = y₀ + B x, rule by rule P δy + Q δx = 0: P = 1 for a closed row, Q = 1 for an unloaded one, and
//! Q δx = δx − `share` δx_n for one that slides. Back, from the derivatives x̄: (Bᵀ Pᵀ + Qᵀ) ψ = x̄, and the derivatives
//! by −y₀ are Pᵀ ψ.

use super::backward::Back;
use crate::contact::ContactId;
use crate::dense::DenseCholesky;
use crate::real::Real;
use crate::state::Rule;

/// Whether rules are conditions on y alone.
pub(super) fn are_closed<T: Real>(mut rules: impl Iterator<Item = Rule<T>>) -> bool {
    rules.all(|rule| rule == Rule::Closed)
}

/// Solves for ψ, in place of x̄, with B given by `entry(i, j)` and c added to the diagonal of closed rows. `Err` is a
/// row whose matrix is singular.
pub(super) fn solve_transposed<T: Real>(
    factor: &mut DenseCholesky<T>,
    rules: &[Rule<T>],
    (entry, c): (impl Fn(usize, usize) -> T, impl Fn(usize) -> T),
    x: &mut [T],
) -> Result<(), usize> {
    // Conditions on multipliers are scaled to conditions on y.
    let scale = |i: usize| if entry(i, i) > T::zero() { entry(i, i) } else { T::one() };
    let transposed = |i: usize, j: usize| match rules[j] {
        Rule::Closed => entry(j, i) + if i == j { c(i) } else { T::zero() },
        Rule::Unloaded | Rule::Slides { .. } if i == j => scale(j),
        Rule::Slides { normal, share } if i == normal => -share * scale(j),
        Rule::Unloaded | Rule::Slides { .. } => T::zero(),
    };
    factor.factorize_general(rules.len(), transposed)?;
    factor.solve(x);
    for (j, _) in rules.iter().enumerate().filter(|(_, rule)| **rule != Rule::Closed) {
        x[j] *= scale(j);
    }
    match T::all_finite(x) {
        true => Ok(()),
        false => Err(0),
    }
}

impl<T: Real> Back<'_, T> {
    /// Adds the derivatives by friction coefficients: `row` gives the name of a row, and ψ; `force` the multiplier of a
    /// row.
    pub(super) fn add_friction(
        &mut self,
        rules: &[Rule<T>],
        row: impl Fn(usize) -> (ContactId, T),
        force: impl Fn(usize) -> T,
    ) {
        for (k, rule) in rules.iter().enumerate() {
            // A contact that would slide, but pulls, has no friction.
            if let &Rule::Slides { normal, share } = rule
                && share != T::zero()
            {
                let (id, psi) = row(k);
                *self.friction.entry(id).or_insert(T::zero()) += psi * share.signum() * force(normal);
            }
        }
    }
}
