//! Mass-weighted removal of jumps: x ← x − M⁻¹ Gᵀ S⁻¹ (G x − γ), S = G M⁻¹ Gᵀ.

use crate::contact::{ContactId, ContactJacobian, Groups};
use crate::contact_solver::FORESEEN;
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
    /// For each row the column of M⁻¹ Gᵀ, made when it is first closed; consistent masses only.
    slots: Vec<usize>,
    columns: Vec<Vec<T>>,
    /// Number of columns that belong to the present G.
    computed: usize,
    closed: Vec<usize>,
    /// The closed rows by the dofs that they share. S couples no two groups.
    groups: Groups,
    /// √S of groups of one row, and the factors of the others; one a group each.
    roots: Vec<T>,
    factors: Vec<DenseCholesky<T>>,
    /// The right-hand side of a group.
    gathered: Vec<T>,
    /// Whether roots and factors belong to `closed`.
    factored: bool,
}

/// A row without a column.
const NONE: usize = usize::MAX;

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
        Self::with(InverseMass::new(mass, prescribed)?, dofs, rows)
    }

    pub(crate) fn with(inverse: InverseMass<T>, dofs: usize, rows: usize) -> Result<Self> {
        memory::reserve::<usize>(rows, 8, "a jump projection")?;
        let (stored, keys) = match inverse {
            InverseMass::Lumped(_) => (0, if rows > 0 { dofs } else { 0 }),
            InverseMass::Consistent { .. } => (rows, 0),
        };
        // (Columns of small scenes take little memory, and have it at once.)
        let foreseen = if stored.saturating_mul(dofs) <= FORESEEN * FORESEEN { stored } else { 0 };
        Ok(Self {
            inverse,
            dofs,
            slots: vec![NONE; stored],
            columns: (0..foreseen).map(|_| vec![T::zero(); dofs]).collect(),
            computed: 0,
            closed: Vec::with_capacity(rows),
            groups: Groups::with_capacity(rows, keys),
            roots: Vec::with_capacity(rows),
            factors: vec![DenseCholesky::with_capacity(rows.min(FORESEEN))],
            gathered: Vec::with_capacity(rows),
            factored: false,
        })
    }

    /// Forgets everything computed from an earlier G.
    pub fn reset(&mut self) {
        self.slots.fill(NONE);
        self.computed = 0;
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
            InverseMass::Consistent { .. } => self.slots.len(),
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
        self.sort(g, rows);
        let mut roots = std::mem::take(&mut self.roots);
        let mut factors = std::mem::take(&mut self.factors);
        roots.clear();
        let (mut result, mut used) = (Ok(()), 0);
        for group in 0..self.groups.len() {
            let own = self.groups.group(group);
            let entry = |i: usize, j: usize| self.entry(g, rows[own[i]], rows[own[j]]);
            let root = if own.len() == 1 { entry(0, 0).sqrt() } else { T::zero() };
            roots.push(root);
            if own.len() == 1 && root.is_finite() {
                continue;
            }
            if used == factors.len() {
                factors.push(DenseCholesky::default());
            }
            result = result.and(factors[used].factorize(own.len(), entry).map_err(|i| rows[own[i]]));
            used += 1;
        }
        (self.roots, self.factors) = (roots, factors);
        result?;
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
        let Self { groups, roots, factors, gathered, .. } = self;
        let mut factors = factors.iter_mut();
        for (group, &root) in roots.iter().enumerate() {
            let own = groups.group(group);
            if let &[only] = own {
                // (A row that nothing answers to gets nothing.)
                b[only] = if root > T::zero() { b[only] / root / root } else { T::zero() };
                continue;
            }
            gathered.clear();
            gathered.extend(own.iter().map(|&position| b[position]));
            if let Some(factor) = factors.next() {
                factor.solve(gathered);
            }
            for (&position, &x) in own.iter().zip(gathered.iter()) {
                b[position] = x;
            }
        }
    }

    /// Sorts rows into groups that S does not couple.
    pub(crate) fn sort(&mut self, g: &ContactJacobian<T>, rows: &[usize]) {
        match &self.inverse {
            InverseMass::Lumped(inverse) => {
                let acts_on = |row| {
                    let acting = g.row(row).filter(|&(dof, weight)| weight != T::zero() && inverse[dof] != T::zero());
                    acting.map(|(dof, _)| dof)
                };
                self.groups.sort(rows, self.dofs, |row| g.is_tangential(row), acts_on);
            }
            InverseMass::Consistent { .. } => self.groups.together(rows.len()),
        }
        self.factored = false;
    }

    /// The groups of the last [`sort`](Self::sort).
    pub(crate) fn groups(&self) -> &Groups {
        &self.groups
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
                T::axpy(c, &self.columns[self.slots[row]], x);
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
            s.extend(rows.iter().map(|&i| self.entry(g, i, j)));
        }
    }

    /// Makes the rows known to [`push`](Self::push).
    pub(crate) fn prepare(&mut self, g: &ContactJacobian<T>, rows: &[usize]) {
        let Self { inverse, slots, columns, computed, dofs, .. } = self;
        if let InverseMass::Consistent { .. } = inverse {
            let count = rows.iter().max().map_or(0, |last| last + 1);
            slots.resize(count.max(slots.len()), NONE);
            for &row in rows {
                if slots[row] == NONE {
                    if columns.len() == *computed {
                        columns.push(vec![T::zero(); *dofs]);
                    }
                    let column = &mut columns[*computed];
                    column.fill(T::zero());
                    g.scatter(row, T::one(), column);
                    inverse.apply(column);
                    slots[row] = *computed;
                    *computed += 1;
                }
            }
        }
    }

    /// Entry (i, j) of S = G M⁻¹ Gᵀ; row j must be prepared.
    fn entry(&self, g: &ContactJacobian<T>, i: usize, j: usize) -> T {
        match &self.inverse {
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
            InverseMass::Consistent { .. } => g.product(i, &self.columns[self.slots[j]]),
        }
    }
}
