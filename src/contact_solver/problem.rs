//! The complementarity problem of a step.

use crate::contact::ContactLaw;
use crate::dense::dot;
use crate::real::Real;

/// What the multiplier of a row may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// 0 ≤ y ⊥ λ ≥ 0.
    NonNegative,
    /// y = 0, λ of either sign.
    Free,
}

impl From<ContactLaw> for Bound {
    fn from(law: ContactLaw) -> Self {
        if law.is_equality() { Self::Free } else { Self::NonNegative }
    }
}

/// Find λ with `y = W λ + q`, `0 ≤ y ⊥ λ ≥ 0` on unilateral rows and `y = 0` on free ones.
///
/// W is the Delassus operator (positive semidefinite; definite on independent rows), with the compliances of the laws
/// on its diagonal. It is as symmetric as the effective matrix A: W = G A⁻¹ Gᵀ. y has the unit of a gap, and so have
/// the tolerances: a residual compares y_i with W_ii λ_i, never meters with newtons.
#[derive(Clone, Copy, Debug)]
pub struct ContactProblem<'a, T> {
    /// W row by row, size × size: entry (i, j), what λ_j adds to y_i, is at `i · size + j`.
    pub delassus: &'a [T],
    /// q: y at λ = 0.
    pub offset: &'a [T],
    /// What each multiplier may be.
    pub bounds: &'a [Bound],
    /// For each row, the size of y that is rounding.
    pub tolerance: &'a [T],
    /// A number that changes whenever W does, 0 if unknown: what a solver has computed from W serves it again while the
    /// number is the same.
    pub version: u64,
}

impl<'a, T: Real> ContactProblem<'a, T> {
    /// Number of rows.
    pub fn size(&self) -> usize {
        self.offset.len()
    }

    /// Entry (i, j) of W.
    pub fn delassus(&self, i: usize, j: usize) -> T {
        self.delassus[i * self.size() + j]
    }

    /// Row i of W.
    pub fn row(&self, i: usize) -> &'a [T] {
        &self.delassus[i * self.size()..(i + 1) * self.size()]
    }

    /// `y_i = (W λ + q)_i`.
    pub fn gap(&self, i: usize, multipliers: &[T]) -> T {
        self.offset[i] + dot(self.row(i), multipliers)
    }

    /// What of y_i is rounding: its tolerance, and that of the sum `(W λ + q)_i` itself.
    pub fn rounding(&self, i: usize, multipliers: &[T]) -> T {
        let terms = self.row(i).iter().zip(multipliers).map(|(&w, &lambda)| (w * lambda).abs());
        self.tolerance[i] + T::of(32.0) * T::epsilon() * (self.offset[i].abs() + terms.sum::<T>())
    }

    /// The row that misses complementarity most, and by how much (unit of y): max over `|min(y_i, W_ii λ_i)|`, or
    /// `|y_i|` for free rows.
    pub fn residual(&self, multipliers: &[T]) -> (usize, T) {
        let miss = |i: usize| {
            let y = self.gap(i, multipliers);
            match self.bounds[i] {
                Bound::Free => y.abs(),
                Bound::NonNegative => y.min(self.delassus(i, i) * multipliers[i]).abs(),
            }
        };
        (0..self.size()).map(|i| (i, miss(i))).fold((0, T::zero()), |worst, x| if x.1 > worst.1 { x } else { worst })
    }
}
