//! The transpose of the conditions of contact rows: of gaps, slips or jumps y and of multipliers x.
//!
//! Forward, with y = y₀ + B x, rule by rule P δy + Q δx = 0: P = 1 for a closed row, Q = 1 for an unloaded one, and
//! Q δx = δx − `share` δx_n, P δy = `turn` δy for one that slides. Back, from the derivatives x̄: (Bᵀ Pᵀ + Qᵀ) ψ = x̄,
//! and the derivatives by −y₀ are Pᵀ ψ.

use super::backward::Back;
use crate::contact::ContactId;
use crate::dense::DenseCholesky;
use crate::real::Real;
use crate::state::{Guide, Rule};

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
        Rule::Unloaded if i == j => scale(j),
        Rule::Unloaded => T::zero(),
        Rule::Slides { normal, share, turn, .. } => {
            let slips = turns(&rules[j]).map(|k| turn[k] * entry(normal + 1 + k, i)).sum::<T>();
            let own = if i == j { T::one() } else { T::zero() } - if i == normal { share } else { T::zero() };
            scale(j) * (slips + own)
        }
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

/// The places behind the normal row whose slips turn a row that slides.
fn turns<T: Real>(rule: &Rule<T>) -> impl Iterator<Item = usize> {
    let turn = match *rule {
        Rule::Slides { turn, by: Guide::Slip, .. } => turn,
        _ => [T::zero(); 2],
    };
    (0..2).filter(move |&k| turn[k] != T::zero())
}

/// Pᵀ ψ.
pub(super) fn released<T: Real>(rules: &[Rule<T>], psi: &[T]) -> Vec<T> {
    let mut released = vec![T::zero(); psi.len()];
    for (k, (rule, &psi)) in rules.iter().zip(psi).enumerate() {
        match *rule {
            Rule::Closed => released[k] += psi,
            Rule::Unloaded => {}
            Rule::Slides { normal, turn, .. } => turns(rule).for_each(|k| released[normal + 1 + k] += turn[k] * psi),
        }
    }
    released
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
            let &Rule::Slides { normal, share, .. } = rule else { continue };
            let of_contact = |other: &Rule<T>| match *other {
                Rule::Slides { normal: at, share, .. } if at == normal => share * share,
                _ => T::zero(),
            };
            let coefficient = rules.iter().map(of_contact).sum::<T>().sqrt();
            // A contact that would slide, but pulls, has no friction.
            if coefficient > T::zero() {
                let (id, psi) = row(k);
                *self.friction.entry(id).or_insert(T::zero()) += psi * share / coefficient * force(normal);
            }
        }
    }
}
