//! Mass-weighted removal of jumps: x ← x − M⁻¹ Gᵀ S⁻¹ (G x − γ), S = G M⁻¹ Gᵀ.

use crate::contact::{ContactId, ContactJacobian, Groups, RowProducts};
use crate::contact_solver::no_response;
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::mass::{ConsistentInverse, InverseMass, Mass};
use crate::memory;
use crate::real::Real;
use crate::rounding::ONE_ROW;
use crate::sparse;

/// The projection behind the λ_v/λ_a correction, usable on a host's own vectors.
///
/// It removes the jump `G x − γ` of velocity or acceleration over the closed contacts with the least change in the
/// mass norm. Momentum is conserved if the rows of G sum to zero; kinetic energy falls by `½ jumpᵀ S⁻¹ jump` and
/// never rises. With a lumped mass only dofs of the contact nodes change. With a consistent mass all dofs around them
/// change, found by conjugate gradients on M, or by a factor if M is a chain or badly conditioned. Rows that share
/// nodes or dofs are projected together. Prescribed dofs are not moved.
///
/// The correction of Zhang et al. (Eng. Mech. 40 (Suppl.), 2023, eqs. (12), (13), in the form derived in
/// `docs/theory.md`), in a custom loop, after the contact problem of a step gave u, v, a and the raw multiplier p:
///
/// ```
/// use contact_dynamics::contact::ContactJacobian;
/// use contact_dynamics::{JumpProjection, Mass};
///
/// let (mass, h) = ([2.0_f64, 1.0], 1e-3);
/// let mut g = ContactJacobian::default();
/// g.push(&[(0, -1.0), (1, 1.0)]);
/// let mut projection = JumpProjection::new(Mass::Lumped(&mass), &[])?;
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
    columns: Columns<T>,
    closed: Vec<usize>,
    /// The closed rows, grouped by shared dofs. S couples no two groups.
    groups: Groups,
    /// √S of groups of one row, and the factors of the others; one entry per group.
    roots: Vec<T>,
    factors: Vec<DenseCholesky<T>>,
    /// The right-hand side of a group.
    gathered: Vec<T>,
    /// Products of M⁻¹ G_iᵀ with the rows; lumped masses only.
    products: RowProducts<T>,
    /// Whether roots and factors belong to `closed`.
    factored: bool,
}

/// Columns of M⁻¹ Gᵀ, computed when their rows are first closed; consistent masses only.
#[derive(Debug, Default)]
struct Columns<T> {
    /// For each row the slot of its column.
    slots: Vec<usize>,
    stored: Vec<Column<T>>,
    /// Number of columns computed for the present G.
    computed: usize,
    /// Rows whose columns are being computed.
    missing: Vec<usize>,
}

/// A column of M⁻¹ Gᵀ in the order of the places of M⁻¹.
#[derive(Debug)]
struct Column<T> {
    values: Vec<T>,
    extent: Extent,
}

/// Which places a column stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Extent {
    /// The places near contact, from which S is built.
    Near,
    /// All places that respond.
    All,
}

/// A row without a column.
const NONE: usize = usize::MAX;

/// Up to this many rows are pushed along their columns; more rows are pushed by one solve for all, because columns of
/// hundreds of rows would take as much memory as a factor of M. At most this many columns with all places are kept.
const FEW: usize = 128;

impl<T: Real> JumpProjection<T> {
    /// Prepares the projection. `prescribed` dofs (ascending) and dofs without mass do not respond.
    ///
    /// # Errors
    ///
    /// [`Error::Mass`](crate::Error::Mass) or [`Error::Singular`](crate::Error::Singular) if M is negative or
    /// indefinite on the free dofs, [`Error::OutOfMemory`](crate::Error::OutOfMemory); [`Error::MissingDof`] and
    /// [`Error::RepeatedDof`] for prescribed dofs that do not exist or do not ascend, [`Error::Dimension`],
    /// [`Error::MatrixNotFinite`] and [`Error::Asymmetric`] for a matrix that is not square, finite or symmetric.
    pub fn new(mass: Mass<'_, T>, prescribed: &[usize]) -> Result<Self> {
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
        Ok(Self::with(InverseMass::new(mass, prescribed, &[])?, dofs))
    }

    pub(crate) fn with(inverse: InverseMass<T>, dofs: usize) -> Self {
        Self {
            inverse,
            dofs,
            columns: Columns::default(),
            closed: Vec::new(),
            groups: Groups::default(),
            roots: Vec::new(),
            factors: Vec::new(),
            gathered: Vec::new(),
            products: RowProducts::default(),
            factored: false,
        }
    }

    /// Discards everything computed from an earlier G.
    pub fn reset(&mut self) {
        self.columns.slots.fill(NONE);
        self.columns.computed = 0;
        self.factored = false;
    }

    /// Chooses the rows of G whose jumps are removed, and factorizes their S. Choosing the same rows again costs
    /// nothing. Dependent rows get the multipliers of least norm. A row counts as dependent if others leave less than
    /// 1e-6 of its S_ii: if it differs from them by less than a milliradian.
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`] for a row that G does not have; [`Error::MissingDof`] for a dof of G that the mass does
    /// not have; [`Error::ContactNotFinite`] for a row whose S is not a number (`feature` is the row of G). With a
    /// consistent mass also [`Error::LinearNotConverged`] and [`Error::Singular`], if a solve with M fails.
    pub fn close(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<()> {
        self.check_rows(g, rows)?;
        let contact = |feature| ContactId { constraint: 0, feature, candidate: 0 };
        self.close_rows(g, rows, |row| no_response(0.0, contact(row)))
    }

    fn check_rows(&self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<()> {
        for &row in rows {
            if row >= g.rows() {
                let part = "the list of closed rows".into();
                return Err(Error::Incompatible { part, reason: "it names a row that G does not have" });
            }
            if let Some((dof, _)) = g.row(row).find(|(dof, _)| *dof >= self.dofs) {
                return Err(Error::MissingDof { what: "a closed row", dof, dofs: self.dofs });
            }
        }
        Ok(())
    }

    /// [`close`](Self::close) for rows that are already checked; `refuse` makes the error for a row whose S is not a
    /// number.
    pub(crate) fn close_rows(
        &mut self,
        g: &ContactJacobian<T>,
        rows: &[usize],
        refuse: impl Fn(usize) -> Error,
    ) -> Result<()> {
        if self.factored && self.closed == rows {
            return Ok(());
        }
        self.factored = false;
        self.closed.clear();
        self.closed.extend_from_slice(rows);
        self.prepare(g, rows)?;
        self.sort(g, rows);
        let mut products = self.list(g, rows)?;
        let mut roots = std::mem::take(&mut self.roots);
        let mut factors = std::mem::take(&mut self.factors);
        roots.clear();
        let (mut result, mut used) = (Ok(()), 0);
        for group in 0..self.groups.len() {
            let own = self.groups.group(group);
            let mut root = T::zero();
            if let &[only] = own {
                // Rows of other groups may share a prescribed dof with it.
                let put = |position, square| root = if position == only { square } else { root };
                self.couple((g, rows), (only, own.iter().copied()), &mut products, put);
            }
            let root = root.sqrt();
            roots.push(root);
            if own.len() == 1 && root.is_finite() {
                continue;
            }
            if used == factors.len() {
                factors.push(DenseCholesky::default());
            }
            let fill = |i: usize, row: &mut [T]| {
                row.fill(T::zero());
                let others = own[..=i].iter().copied();
                self.couple((g, rows), (own[i], others), &mut products, |position, product| {
                    let place = own.binary_search(&position).ok();
                    place.and_then(|j| row.get_mut(j)).into_iter().for_each(|entry| *entry = product);
                });
            };
            result =
                result.and(factors[used].factorize_rows(own.len(), ONE_ROW, fill).map_err(|i| refuse(rows[own[i]])));
            used += 1;
        }
        (self.roots, self.factors, self.products) = (roots, factors, products);
        result?;
        self.factored = true;
        Ok(())
    }

    /// `x ← x − M⁻¹ Gᵀ S⁻¹ (G x − γ)` on the closed rows; `multipliers` becomes `S⁻¹ (G x − γ)` of the x given.
    ///
    /// `target` is γ, the velocity or acceleration of the obstacle along each closed row (zero between bodies). Both
    /// slices have one entry per closed row, in the order given to [`close`](Self::close).
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] unless x has one entry per dof, and target and multipliers one per closed row; the errors
    /// of [`close`](Self::close) for a G that the closed rows do not fit, and for a failed solve with M. x is then
    /// unchanged.
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
        let rows = std::mem::take(&mut self.closed);
        let result = self.push(g, (&rows, multipliers), -T::one(), x);
        self.closed = rows;
        result
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
                // A row without response gets no multiplier.
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
            InverseMass::Consistent(_) => self.groups.together(rows.len()),
        }
        self.factored = false;
    }

    /// The size of the largest group of some rows.
    pub(crate) fn largest_group(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> usize {
        if !self.factored || self.closed != rows {
            self.sort(g, rows);
        }
        (0..self.groups.len()).map(|group| self.groups.group(group).len()).max().unwrap_or(0)
    }

    /// M⁻¹, if it is diagonal.
    pub(crate) fn lumped(&self) -> Option<&[T]> {
        match &self.inverse {
            InverseMass::Lumped(inverse) => Some(inverse),
            InverseMass::Consistent(_) => None,
        }
    }

    /// The groups of the last [`sort`](Self::sort).
    pub(crate) fn groups(&self) -> &Groups {
        &self.groups
    }

    /// `x += c Σ m_k M⁻¹ G_kᵀ` of rows k and their multipliers.
    pub(crate) fn push(
        &mut self,
        g: &ContactJacobian<T>,
        (rows, multipliers): (&[usize], &[T]),
        c: T,
        x: &mut [T],
    ) -> Result<()> {
        let pushes = rows.iter().zip(multipliers).map(|(&row, &multiplier)| (row, c * multiplier));
        if let InverseMass::Lumped(inverse) = &self.inverse {
            for (row, c) in pushes {
                for (dof, weight) in g.row(row) {
                    x[dof] += c * weight * inverse[dof];
                }
            }
            return Ok(());
        }
        if multipliers.iter().all(|&multiplier| multiplier == T::zero()) {
            return Ok(());
        }
        let is_few = rows.len() <= FEW;
        if is_few {
            self.make_columns(g, rows, Extent::All)?;
        }
        let Self { inverse, columns, .. } = self;
        let InverseMass::Consistent(inverse) = inverse else { return Ok(()) };
        if is_few {
            inverse.combine(pushes.map(|(row, c)| (c, &columns.of(row).values[..])), x);
            return Ok(());
        }
        let forces = pushes.flat_map(|(row, c)| g.row(row).map(move |(dof, weight)| (dof, c * weight)));
        inverse.add_response(forces, x)
    }

    /// `x ← M⁻¹ x`.
    pub(crate) fn apply_inverse(&mut self, x: &mut [T]) -> Result<()> {
        self.inverse.apply(x)
    }

    /// S of `rows`, dense and column-major.
    pub(crate) fn assemble(&mut self, g: &ContactJacobian<T>, rows: &[usize], s: &mut Vec<T>) -> Result<()> {
        self.prepare(g, rows)?;
        s.clear();
        memory::grow(s, rows.len(), rows.len(), "the matrix of the jumps")?;
        let mut products = self.list(g, rows)?;
        for (j, column) in s.chunks_exact_mut(rows.len().max(1)).enumerate() {
            self.couple((g, rows), (j, 0..rows.len()), &mut products, |i, product| column[i] = product);
        }
        self.products = products;
        Ok(())
    }

    /// The products of a lumped mass for these rows.
    fn list(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<RowProducts<T>> {
        let mut products = std::mem::take(&mut self.products);
        if matches!(self.inverse, InverseMass::Lumped(_)) {
            products.list(rows.len(), self.dofs, |k| g.row(rows[k]))?;
        }
        Ok(products)
    }

    /// Computes the columns needed for S of these rows.
    fn prepare(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<()> {
        // Few rows are later pushed along the same columns.
        self.make_columns(g, rows, if rows.len() <= FEW { Extent::All } else { Extent::Near })
    }

    /// Computes the columns of these rows that are missing or too short. The values of a column do not depend on when
    /// it is computed.
    fn make_columns(&mut self, g: &ContactJacobian<T>, rows: &[usize], extent: Extent) -> Result<()> {
        let InverseMass::Consistent(inverse) = &mut self.inverse else { return Ok(()) };
        let Columns { slots, stored: columns, computed, missing } = &mut self.columns;
        let count = rows.iter().max().map_or(0, |last| last + 1);
        slots.resize(count.max(slots.len()), NONE);
        let find = |missing: &mut Vec<usize>, columns: &[Column<T>]| {
            let ends_too_soon = |slot: usize| extent == Extent::All && columns[slot].extent == Extent::Near;
            missing.clear();
            missing.extend(rows.iter().filter(|&&row| slots[row] == NONE || ends_too_soon(slots[row])));
        };
        find(missing, columns);
        let made = &mut columns[..*computed];
        let long = made.iter().filter(|column| column.extent == Extent::All).count();
        if extent == Extent::All && !missing.is_empty() && missing.len() + long > FEW {
            for column in made {
                column.shorten(inverse.near());
            }
            find(missing, columns);
        }
        let (forces, near) = (|number: usize| g.row(missing[number]), inverse.near());
        inverse.respond(missing.len(), forces, |number, response| {
            let slot = &mut slots[missing[number]];
            if *slot == NONE {
                *slot = *computed;
                *computed += 1;
            }
            if *slot == columns.len() {
                columns.push(Column { values: Vec::new(), extent });
            }
            let kept = if extent == Extent::All { response } else { &response[..response.len().min(near)] };
            let column = &mut columns[*slot];
            column.extent = extent;
            column.values.clear();
            column.values.extend_from_slice(kept);
        })
    }

    /// Entries of S = G M⁻¹ Gᵀ in column j of the `rows`, which must be prepared and listed, at least those at the
    /// positions given; entries that are left out are zero.
    fn couple(
        &self,
        (g, rows): (&ContactJacobian<T>, &[usize]),
        (j, positions): (usize, impl Iterator<Item = usize>),
        products: &mut RowProducts<T>,
        mut put: impl FnMut(usize, T),
    ) {
        match &self.inverse {
            InverseMass::Lumped(inverse) => {
                products.each(g.row(rows[j]).map(|(dof, weight)| (dof, weight * inverse[dof])), put);
            }
            InverseMass::Consistent(inverse) => {
                positions.for_each(|i| put(i, self.columns.of(rows[i]).product(inverse, g.row(rows[j]))));
            }
        }
    }
}

impl<T> Columns<T> {
    /// The column of a row.
    fn of(&self, row: usize) -> &Column<T> {
        &self.stored[self.slots[row]]
    }
}

impl<T: Real> Column<T> {
    /// Keeps only the places near contact.
    fn shorten(&mut self, near: usize) {
        if self.values.len() > near {
            self.values.truncate(near);
            self.values.shrink_to_fit();
        }
        self.extent = Extent::Near;
    }

    /// The product with a row of G.
    fn product(&self, inverse: &ConsistentInverse<T>, row: impl Iterator<Item = (usize, T)>) -> T {
        let response = |dof| self.values.get(inverse.place(dof)).copied().unwrap_or(T::zero());
        row.map(|(dof, weight)| weight * response(dof)).sum()
    }
}
