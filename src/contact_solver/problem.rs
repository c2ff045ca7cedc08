//! The complementarity problem of a step.

use super::cone::{self, Cone};
use crate::contact::ContactLaw;
use crate::dense::dot;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// The set of the multipliers of a block of rows, which also determines the conditions between them and the block's
/// y.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum AdmissibleSet {
    /// A row with 0 ≤ y ⊥ λ ≥ 0.
    NonNegative,
    /// A row with y = 0, and λ of either sign.
    Free,
    /// A contact with Coulomb friction in a plane: a normal row with 0 ≤ y_n ⊥ p ≥ 0 and a tangential row with |f| ≤
    /// μ p. The slip y_t is zero, or opposes f on the boundary of the cone: y_t = −γ f, γ ≥ 0, γ (μ p − |f|) = 0.
    /// This is not the condition of a minimum: in sliding y_n is zero, not −μ |y_t|.
    Cone2 {
        /// μ, from 0.
        friction: f64,
    },
    /// The same in space: a normal row and two tangential rows along orthonormal directions.
    Cone3 {
        /// μ, from 0.
        friction: f64,
    },
}

impl AdmissibleSet {
    /// The sets of the contact laws.
    pub(crate) const OF_LAWS: [Self; 2] = [Self::NonNegative, Self::Free];

    /// The number of rows of a block.
    pub fn rows(self) -> usize {
        match self {
            Self::NonNegative | Self::Free => 1,
            Self::Cone2 { .. } => 2,
            Self::Cone3 { .. } => 3,
        }
    }

    /// μ, if the set is a cone.
    pub fn friction(self) -> Option<f64> {
        match self {
            Self::NonNegative | Self::Free => None,
            Self::Cone2 { friction } | Self::Cone3 { friction } => Some(friction),
        }
    }

    /// Whether y = 0, with a multiplier of either sign.
    pub(crate) fn is_bilateral(self) -> bool {
        self == Self::Free
    }

    /// The set of a contact with friction in 1 or 2 tangential directions.
    pub(crate) fn with_friction(friction: f64, tangents: usize) -> Self {
        match tangents {
            0 | 1 => Self::Cone2 { friction },
            _ => Self::Cone3 { friction },
        }
    }

    /// Moves the multipliers of a block to the nearest ones in the set.
    ///
    /// ```
    /// use contact_dynamics::contact_solver::AdmissibleSet;
    /// let mut multipliers = [-2.0];
    /// AdmissibleSet::Free.project(&mut multipliers);
    /// assert_eq!(multipliers, [-2.0]);
    /// AdmissibleSet::NonNegative.project(&mut multipliers);
    /// assert_eq!(multipliers, [0.0]);
    /// let mut contact = [1.0, 0.6, -0.8];
    /// AdmissibleSet::Cone3 { friction: 0.5 }.project(&mut contact);
    /// assert!((contact[0] - 1.2_f64).abs() < 1e-15 && (contact[1] - 0.36_f64).abs() < 1e-15);
    /// ```
    pub fn project<T: Real>(self, multipliers: &mut [T]) {
        let Some(friction) = self.friction() else {
            for multiplier in multipliers {
                *multiplier = self.nearest(*multiplier);
            }
            return;
        };
        let Some((normal, tangential)) = multipliers.split_first_mut() else { return };
        let (friction, size) = (T::of(friction), norm(tangential));
        if size <= friction * *normal {
            return;
        }
        let inside = (*normal + friction * size) / (T::one() + friction * friction);
        *normal = inside.max(T::zero());
        let share = if size > T::zero() { friction * *normal / size } else { T::zero() };
        for f in tangential {
            *f *= share;
        }
    }

    /// The nearest multiplier in a set of one row.
    pub(super) fn nearest<T: Real>(self, multiplier: T) -> T {
        match self {
            Self::NonNegative => multiplier.max(T::zero()),
            _ => multiplier,
        }
    }

    /// Residual of a block (unit of y): |min(y, W_ii λ)|, or |y| of a free row; NaN if y is not finite. `compliance`
    /// is the diagonal of W.
    ///
    /// For a cone, the larger one of |min(y_n, W_nn p)| and |W_t f − P(W_t f − y_t)|, with P the projection onto the
    /// disc of radius W_t μ max(0, p) and W_t the largest diagonal entry of the tangential rows (Alart and Curnier,
    /// Comput. Methods Appl. Mech. Eng. 92, 1991).
    pub fn residual<T: Real>(self, y: &[T], multipliers: &[T], compliance: &[T]) -> T {
        if let Some(friction) = self.friction() {
            let [normal, tangential] = cone_residuals(T::of(friction), y, multipliers, compliance);
            return normal.max(tangential);
        }
        let rows = y.iter().zip(multipliers).zip(compliance);
        let misses = rows.map(|((&y, &multiplier), &compliance)| match self {
            // `min` would ignore NaN.
            _ if !y.is_finite() => T::nan(),
            Self::Free => y.abs(),
            _ => y.min(compliance * multiplier).abs(),
        });
        misses.fold(T::zero(), |worst, miss| if miss > worst || miss.is_nan() { miss } else { worst })
    }
}

/// [`AdmissibleSet::residual`] of a cone, split into normal and tangential rows.
fn cone_residuals<T: Real>(friction: T, y: &[T], multipliers: &[T], compliance: &[T]) -> [T; 2] {
    if y.iter().chain(multipliers).any(|x| !x.is_finite()) {
        return [T::nan(); 2];
    }
    let tangential = compliance[1..].iter().fold(T::zero(), |most, &w| most.max(w));
    let mut miss = [T::zero(); 2];
    let mut augmented = [T::zero(); 2];
    for (k, augmented) in augmented.iter_mut().enumerate().take(y.len() - 1) {
        *augmented = tangential * multipliers[k + 1] - y[k + 1];
    }
    let (size, radius) = (norm(&augmented), tangential * friction * multipliers[0].max(T::zero()));
    let share = if size > radius { radius / size } else { T::one() };
    for (k, miss) in miss.iter_mut().enumerate().take(y.len() - 1) {
        *miss = tangential * multipliers[k + 1] - share * augmented[k];
    }
    [y[0].min(compliance[0] * multipliers[0]).abs(), norm(&miss)]
}

/// The length of a tangential vector.
fn norm<T: Real>(x: &[T]) -> T {
    match *x {
        [x, y] => cone::norm([x, y]),
        _ => x.first().map_or(T::zero(), |x| x.abs()),
    }
}

impl From<ContactLaw> for AdmissibleSet {
    fn from(law: ContactLaw) -> Self {
        match law.is_equality() {
            true => Self::Free,
            false => Self::NonNegative,
        }
    }
}

/// Find λ with `y = W λ + q` such that y and λ of every block satisfy the conditions of its [`AdmissibleSet`].
///
/// W is the Delassus operator (positive semidefinite; definite on independent rows), with the compliances of the laws
/// on its diagonal. It is symmetric if the effective matrix A is: W = G A⁻¹ Gᵀ. y and the tolerances have the unit of
/// a gap: a residual compares y_i with W_ii λ_i, never meters with newtons.
///
/// ```
/// use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem};
/// use contact_dynamics::{ActiveSet, ContactSolver};
///
/// let sets = [AdmissibleSet::NonNegative; 2];
/// let problem = ContactProblem::new(&[2.0, 1.0, 1.0, 2.0], &[-2.0, 1.0], &sets, &[1e-14; 2])?;
/// let mut lambda = [0.0_f64; 2];
/// ActiveSet::default().solve(&problem, &mut lambda)?;
/// assert!((lambda[0] - 1.0).abs() < 1e-15 && problem.residual(&lambda).1 < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ContactProblem<'a, T> {
    pub(crate) delassus: &'a [T],
    pub(crate) offset: &'a [T],
    pub(crate) sets: &'a [AdmissibleSet],
    pub(crate) tolerance: &'a [T],
    pub(crate) version: u64,
}

/// A [version](ContactProblem::with_version) that no other W has: a solver may come from another run, or from a host.
pub(crate) fn new_version() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1 << 63);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl<'a, T: Real> ContactProblem<'a, T> {
    /// From W row by row (entry (i, j), the change of y_i per λ_j, is at `i · size + j`), the offset q (y at λ = 0),
    /// the set of every block, and the rounding of y in each row.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the lengths disagree, [`Error::Parameter`] for a friction coefficient that is negative
    /// or not finite.
    pub fn new(delassus: &'a [T], offset: &'a [T], sets: &'a [AdmissibleSet], tolerance: &'a [T]) -> Result<Self> {
        let size = offset.len();
        let rows = sets.iter().map(|set| set.rows()).sum();
        for (what, expected, found) in [
            ("the Delassus operator", size * size, delassus.len()),
            ("the sets of a contact problem", size, rows),
            ("the tolerances of a contact problem", size, tolerance.len()),
        ] {
            if expected != found {
                return Err(Error::Dimension { what, expected, found });
            }
        }
        let wrong = |friction: &f64| !(*friction >= 0.0 && friction.is_finite());
        if let Some(value) = sets.iter().filter_map(|set| set.friction()).find(wrong) {
            let range = "not negative and finite";
            return Err(Error::Parameter { name: "a friction coefficient of a contact problem", value, range });
        }
        Ok(Self::of(delassus, offset, sets, tolerance, 0))
    }

    /// The same for consistent parts.
    pub(crate) fn of(
        delassus: &'a [T],
        offset: &'a [T],
        sets: &'a [AdmissibleSet],
        tolerance: &'a [T],
        version: u64,
    ) -> Self {
        Self { delassus, offset, sets, tolerance, version }
    }

    /// Sets a number that changes whenever W does: a solver reuses data computed from W while it is the same. With 0,
    /// the default, nothing is reused.
    #[must_use]
    pub fn with_version(self, version: u64) -> Self {
        Self { version, ..self }
    }

    /// The number given by [`with_version`](Self::with_version).
    pub fn version(&self) -> u64 {
        self.version
    }

    /// q: y at λ = 0, one per row.
    pub fn offset(&self) -> &'a [T] {
        self.offset
    }

    /// The rounding of y in each row.
    pub fn tolerance(&self) -> &'a [T] {
        self.tolerance
    }

    /// The consecutive blocks: their rows, and the sets of their multipliers.
    pub fn blocks(&self) -> impl Iterator<Item = (Range<usize>, AdmissibleSet)> + 'a {
        self.sets.iter().scan(0, |first, &set| {
            let rows = *first..*first + set.rows();
            *first = rows.end;
            Some((rows, set))
        })
    }

    /// A contact with friction with the multipliers of all others at zero.
    pub(super) fn block(&self, rows: Range<usize>, set: AdmissibleSet) -> Cone<T> {
        let (size, friction) = (rows.len(), T::of(set.friction().unwrap_or(0.0)));
        let (mut delassus, mut offset, mut noise) = ([[T::zero(); 3]; 3], [T::zero(); 3], T::zero());
        for (i, row) in rows.clone().enumerate() {
            delassus[i][..size].copy_from_slice(&self.row(row)[rows.clone()]);
            offset[i] = self.offset[row];
            if i > 0 {
                noise = noise.max(self.tolerance[row] + rounding(self.offset[row].abs()));
            }
        }
        let guess = [T::zero(); 2];
        Cone { delassus, offset, friction, tangents: size - 1, noise, guess }
    }

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

    /// Rounding of y_i: its tolerance, plus the rounding of the sum `(W λ + q)_i`.
    pub fn rounding(&self, i: usize, multipliers: &[T]) -> T {
        let terms = self.row(i).iter().zip(multipliers).map(|(&w, &lambda)| (w * lambda).abs());
        self.tolerance[i] + rounding(self.offset[i].abs() + terms.sum::<T>())
    }

    /// The row, or first row of a block, with the largest [`AdmissibleSet::residual`], and that residual (unit of y).
    pub fn residual(&self, multipliers: &[T]) -> (usize, T) {
        let worst = |worst: (usize, T), x: (usize, T)| if x.1 > worst.1 || x.1.is_nan() { x } else { worst };
        let misses = self.blocks().map(|(rows, set)| {
            let [first, tangential] = self.block_misses(rows.clone(), set, multipliers);
            (rows.start, first.max(tangential))
        });
        misses.fold((0, T::zero()), worst)
    }

    /// Residuals of the rows of a block: the first row, and the tangential rows.
    pub(super) fn block_misses(&self, rows: Range<usize>, set: AdmissibleSet, multipliers: &[T]) -> [T; 2] {
        let (mut y, mut compliance) = ([T::zero(); 3], [T::zero(); 3]);
        for (k, row) in rows.clone().enumerate() {
            (y[k], compliance[k]) = (self.gap(row, multipliers), self.delassus(row, row));
        }
        let (y, multipliers, compliance) = (&y[..rows.len()], &multipliers[rows.clone()], &compliance[..rows.len()]);
        match set.friction() {
            Some(friction) => cone_residuals(T::of(friction), y, multipliers, compliance),
            None => [set.residual(y, multipliers, compliance), T::zero()],
        }
    }

    /// Whether any block is a cone.
    pub fn has_cones(&self) -> bool {
        self.sets.len() < self.size()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let sets = [AdmissibleSet::NonNegative, AdmissibleSet::Free];
        let problem = |w: usize, q: usize, sets, tolerance: usize| {
            ContactProblem::new(&[1.0; 9][..w], &[0.0; 3][..q], sets, &[0.0; 3][..tolerance])
                .map(|problem| problem.size())
        };
        assert_eq!(problem(4, 2, &sets, 2).unwrap(), 2);
        for (w, q, count, tolerance) in [(3, 2, 2, 2), (9, 3, 2, 3), (4, 2, 2, 1), (4, 2, 1, 2)] {
            let refused = problem(w, q, &sets[..count], tolerance);
            assert!(matches!(refused, Err(Error::Dimension { .. })), "{w} {q} {count} {tolerance}");
        }
        let problem = ContactProblem::new(&[1.0; 4], &[0.0; 2], &sets, &[0.0; 2]).unwrap().with_version(7);
        assert_eq!(problem.version(), 7);
        assert_eq!(problem.blocks().collect::<Vec<_>>(), [(0..1, sets[0]), (1..2, sets[1])]);
    }

    #[test]
    fn residuals_are_those_of_the_sets() {
        let [unilateral, free] = AdmissibleSet::OF_LAWS;
        for (set, y, multiplier, expected) in [
            (unilateral, 0.5, 0.0, 0.0),
            (unilateral, 0.0, 3.0, 0.0),
            (unilateral, -0.5, 3.0, 0.5),
            (unilateral, 0.25, 3.0, 0.25),
            (unilateral, 8.0, 3.0, 6.0),
            (unilateral, 1.0, -1.0, 2.0),
            (free, -0.5, -3.0, 0.5),
            (free, 0.0, -3.0, 0.0),
        ] {
            let found: f64 = set.residual(&[y], &[multiplier], &[2.0]);
            assert!((found - expected).abs() < 1e-15, "{set:?} {y} {multiplier}");
            assert!(set.residual(&[f64::NAN], &[multiplier], &[2.0]).is_nan());
        }
    }
}
