//! Mass-weighted removal of jumps: x ← x − M⁻¹ Gᵀ S⁻¹ (G x − γ), S = G M⁻¹ Gᵀ.

use crate::contact::{ContactId, ContactJacobian};
use crate::contact_solver::no_response;
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::mass::{InverseMass, Mass};
use crate::memory;
use crate::real::Real;
use crate::sparse;

/// The projection behind the λ_v/λ_a correction, usable on a host's own vectors.
///
/// It removes the jump `G x − γ` of velocity or acceleration over the closed contacts with the least change in the mass
/// norm: momentum is conserved (rows of G that sum to zero), kinetic energy falls by `½ jumpᵀ S⁻¹ jump`, never rises.
/// For a lumped mass everything is local to the contact nodes; for a consistent one a factor of M is kept and every dof
/// changes. Rows that share nodes or dofs are projected together. Prescribed dofs are not moved.
///
/// The correction of Zhang et al. (Eng. Mech. 40 (Suppl.), 2023, eqs. (12), (13), in the form derived in
/// `docs/theory.md`), in a loop of one's own, after the contact problem of a step gave u, v, a and the raw multiplier
/// p:
///
/// ```
/// use contact_dynamics::contact::ContactJacobian;
/// use contact_dynamics::{JumpProjection, Mass};
///
/// let (mass, h) = ([2.0_f64, 1.0], 1e-3);
/// let mut g = ContactJacobian::default();
/// g.push(&[(0, -1.0), (1, 1.0)]);
/// let mut projection = JumpProjection::new(Mass::Lumped(&mass), &[], g.rows())?;
/// projection.close(&g, &[0])?;
///
/// // Approach speed 3 at the contact, accelerations −50 and 100 from the solve with 5/2 z-weight (composite scheme).
/// let (mut v, mut a, raw_force) = ([1.0_f64, -2.0], [-50.0_f64, 100.0], 100.0_f64);
/// let mut impulse = [0.0_f64];
/// projection.remove_jump(&g, &[0.0], &mut v, &mut impulse)?;
/// assert!(v[0].abs() < 1e-15 && v[1].abs() < 1e-15); // common velocity (2·1 − 1·2)/3
/// let lambda_a = h * impulse[0]; // eq. (13): −2e-3 kg m
/// let mut force = [0.0_f64];
/// projection.remove_jump(&g, &[0.0], &mut a, &mut force)?;
/// let lambda_v = -(h / 2.5) * force[0]; // eq. (12): −0.04 kg m/s
/// let corrected_force = raw_force - force[0]; // the impulsive part is gone
/// assert!((a[0] - a[1]).abs() < 1e-12 && corrected_force.abs() < 1e-12);
/// assert!((lambda_a + 2e-3).abs() < 1e-15 && (lambda_v + 0.04).abs() < 1e-15);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct JumpProjection<T: Real> {
    inverse: InverseMass<T>,
    dofs: usize,
    /// M⁻¹ Gᵀ column by column, filled when a row is first closed; consistent masses only.
    columns: Vec<T>,
    computed: Vec<bool>,
    closed: Vec<usize>,
    factor: DenseCholesky<T>,
    /// Whether `factor` belongs to `closed`.
    factored: bool,
}

impl<T: Real> JumpProjection<T> {
    /// Prepares the projection for up to `rows` contacts; `prescribed` dofs (ascending) do not respond, nor do those
    /// without mass.
    ///
    /// # Errors
    ///
    /// [`Error::Mass`](crate::Error::Mass) or [`Error::Singular`](crate::Error::Singular) if M is negative or
    /// indefinite on the free dofs, [`Error::OutOfMemory`](crate::Error::OutOfMemory); [`Error::MissingDof`] and
    /// [`Error::RepeatedDof`] for prescribed dofs that do not exist or do not ascend, [`Error::Dimension`] for a matrix
    /// that is not square.
    pub fn new(mass: Mass<'_, T>, prescribed: &[usize], rows: usize) -> Result<Self> {
        let dofs = match mass {
            Mass::Lumped(mass) => mass.len(),
            Mass::Consistent(mass) => sparse::square("the mass matrix", mass)?,
        };
        let what = "the list of prescribed dofs";
        if let Some(&dof) = prescribed.iter().find(|&&dof| dof >= dofs) {
            return Err(Error::MissingDof { what, dof, dofs });
        }
        if let Some(pair) = prescribed.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(match pair[0] == pair[1] {
                true => Error::RepeatedDof { what, dof: pair[0] },
                false => Error::Incompatible { part: what.into(), reason: "it is not ascending" },
            });
        }
        memory::reserve::<T>(rows, rows, "the matrix S of a jump projection")?;
        Self::with(InverseMass::new(mass, prescribed)?, dofs, rows)
    }

    pub(crate) fn with(inverse: InverseMass<T>, dofs: usize, rows: usize) -> Result<Self> {
        let stored = match inverse {
            InverseMass::Lumped(_) => 0,
            InverseMass::Consistent { .. } => rows,
        };
        Ok(Self {
            inverse,
            dofs,
            columns: memory::zeros(stored, dofs, "the columns of M⁻¹Gᵀ")?,
            computed: vec![false; stored],
            closed: Vec::with_capacity(rows),
            factor: DenseCholesky::with_capacity(rows),
            factored: false,
        })
    }

    /// Forgets everything computed from an earlier G.
    pub fn reset(&mut self) {
        self.computed.fill(false);
        self.factored = false;
    }

    /// Chooses the rows of G whose jumps are removed, and factorizes their S. Choosing the same rows again costs
    /// nothing. Rows may depend on one another: of all multipliers those of least norm are then found.
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`] for a row that G does not have, or with a consistent mass one beyond those announced;
    /// [`Error::MissingDof`] for a dof of G that the mass does not have; [`Error::ContactNotFinite`] for a row whose S
    /// is not a number (`feature` is the row of G).
    pub fn close(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<()> {
        self.check_rows(g, rows)?;
        let contact = |feature| ContactId { constraint: 0, feature, candidate: 0 };
        self.close_rows(g, rows).map_err(|row| no_response(0.0, contact(row)))
    }

    fn check_rows(&self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<()> {
        let refuse = |reason| Err(Error::Incompatible { part: "the list of closed rows".into(), reason });
        // Of a consistent mass columns of M⁻¹Gᵀ are stored, one for each row announced.
        let stored = match self.inverse {
            InverseMass::Lumped(_) => usize::MAX,
            InverseMass::Consistent { .. } => self.computed.len(),
        };
        for &row in rows {
            if row >= g.rows() {
                return refuse("it names a row that G does not have");
            }
            if row >= stored {
                return refuse("it names a row beyond those that were announced");
            }
            if let Some((dof, _)) = g.row(row).find(|(dof, _)| *dof >= self.dofs) {
                return Err(Error::MissingDof { what: "a closed row", dof, dofs: self.dofs });
            }
        }
        Ok(())
    }

    /// [`close`](Self::close) with rows that are known to be sound; `Err` is the row whose S is not a number.
    pub(crate) fn close_rows(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> std::result::Result<(), usize> {
        if self.factored && self.closed == rows {
            return Ok(());
        }
        self.factored = false;
        self.closed.clear();
        self.closed.extend_from_slice(rows);
        self.prepare(g, rows);
        let Self { inverse, columns, factor, closed, dofs, .. } = self;
        let entry = |i: usize, j: usize| s_entry(inverse, columns, *dofs, g, closed[i], closed[j]);
        factor.factorize(rows.len(), entry).map_err(|i| rows[i])?;
        self.factored = true;
        Ok(())
    }

    /// `x ← x − M⁻¹ Gᵀ S⁻¹ (G x − γ)` on the closed rows; `multipliers` becomes `S⁻¹ (G x − γ)` of the x given.
    ///
    /// `target` is γ, the velocity or acceleration of the obstacle along each closed row (zero between bodies). Both
    /// slices have one entry a closed row, in the order given to [`close`](Self::close).
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] unless x has one entry a dof, and target and multipliers one a closed row; those of
    /// [`close`](Self::close) for a G that the closed rows do not fit. Nothing is changed then.
    pub fn remove_jump(
        &mut self,
        g: &ContactJacobian<T>,
        target: &[T],
        x: &mut [T],
        multipliers: &mut [T],
    ) -> Result<()> {
        let closed = self.closed.len();
        for (what, expected, found) in [
            ("the vector with a jump", self.dofs, x.len()),
            ("the targets of closed rows", closed, target.len()),
            ("the multipliers of closed rows", closed, multipliers.len()),
        ] {
            if expected != found {
                return Err(Error::Dimension { what, expected, found });
            }
        }
        self.check_rows(g, &self.closed)?;
        for ((multiplier, &row), &target) in multipliers.iter_mut().zip(&self.closed).zip(target) {
            *multiplier = g.product(row, x) - target;
        }
        self.solve(multipliers);
        for (&row, &multiplier) in self.closed.iter().zip(multipliers.iter()) {
            self.push(g, row, -multiplier, x);
        }
        Ok(())
    }

    /// Number of degrees of freedom.
    pub(crate) fn dofs(&self) -> usize {
        self.dofs
    }

    /// `b ← S⁻¹ b` on the closed rows.
    pub(crate) fn solve(&mut self, b: &mut [T]) {
        self.factor.solve(b);
    }

    /// `x += c M⁻¹ G_rowᵀ`; the row must have been closed or prepared.
    pub(crate) fn push(&self, g: &ContactJacobian<T>, row: usize, c: T, x: &mut [T]) {
        match &self.inverse {
            InverseMass::Lumped(inverse) => {
                for (dof, weight) in g.row(row) {
                    x[dof] += c * weight * inverse[dof];
                }
            }
            InverseMass::Consistent { .. } => {
                T::axpy(c, &self.columns[row * self.dofs..(row + 1) * self.dofs], x);
            }
        }
    }

    /// `x ← M⁻¹ x`.
    pub(crate) fn apply_inverse(&mut self, x: &mut [T]) {
        self.inverse.apply(x);
    }

    /// S of `rows`, dense and column-major.
    pub(crate) fn assemble(&mut self, g: &ContactJacobian<T>, rows: &[usize], s: &mut Vec<T>) {
        self.prepare(g, rows);
        s.clear();
        for &j in rows {
            s.extend(rows.iter().map(|&i| s_entry(&self.inverse, &self.columns, self.dofs, g, i, j)));
        }
    }

    /// Makes the rows known to [`push`](Self::push).
    pub(crate) fn prepare(&mut self, g: &ContactJacobian<T>, rows: &[usize]) {
        if let InverseMass::Consistent { .. } = self.inverse {
            let count = rows.iter().max().map_or(0, |last| last + 1);
            if count > self.computed.len() {
                self.computed.resize(count, false);
                self.columns.resize(count * self.dofs, T::zero());
            }
            for &row in rows {
                if !self.computed[row] {
                    let column = &mut self.columns[row * self.dofs..(row + 1) * self.dofs];
                    column.fill(T::zero());
                    g.scatter(row, T::one(), column);
                    self.inverse.apply(column);
                    self.computed[row] = true;
                }
            }
        }
    }
}

/// Entry (i, j) of S = G M⁻¹ Gᵀ.
fn s_entry<T: Real>(
    inverse: &InverseMass<T>,
    columns: &[T],
    dofs: usize,
    g: &ContactJacobian<T>,
    i: usize,
    j: usize,
) -> T {
    match inverse {
        InverseMass::Lumped(inverse) => {
            let mut sum = T::zero();
            for (dof, weight) in g.row(i) {
                for (other, weight_j) in g.row(j) {
                    if dof == other {
                        sum += weight * weight_j * inverse[dof];
                    }
                }
            }
            sum
        }
        InverseMass::Consistent { .. } => g.product(i, &columns[j * dofs..(j + 1) * dofs]),
    }
}
