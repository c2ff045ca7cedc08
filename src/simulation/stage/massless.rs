//! Dofs without mass, whose displacements follow from static balance with the others: their part of K, factorized.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::operator::Operator;
use crate::simulation::operator::part::{Embedded, Part};
use crate::simulation::operator::responses::Unit;
use crate::sparse::{self, Combination};
use crate::state::Motion;
use crate::system::{Linearity, System, TangentWeights};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat};

/// The dofs b without mass of a linear system, and their part of K.
#[derive(Debug)]
pub(crate) struct MasslessBlock<T: Real> {
    /// Ascending.
    pub(crate) dofs: Vec<usize>,
    pub(crate) columns: Columns<T>,
    /// K_bb⁻¹, with its responses to contact.
    pub(crate) operator: Operator<T>,
    /// The stage in which it is solved: d is the displacement itself.
    pub(crate) stage: CompiledStage<T>,
    /// The dofs of the interface that have a mass, and their indices there.
    pub(crate) massive: Vec<(usize, usize)>,
    /// Version of the rows when rows on massless dofs were last found.
    pub(crate) sorted: u64,
}

/// Columns of K, one per massless dof: its couplings to all free dofs. Columns of a tangent keep entries that are zero:
/// the dofs of a node have the same, and products are faster.
#[derive(Debug)]
pub(crate) struct Columns<T> {
    pointers: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<T>,
}

impl<T: Real> Columns<T> {
    /// From the tangent, or for an empty pattern from one evaluation of the force per column.
    pub(crate) fn of(system: &mut dyn System<T>, dofs: &[usize], at: &Motion<T>) -> Result<Self> {
        let mut free = vec![true; system.dofs()];
        for &dof in system.prescribed() {
            free[dof] = false;
        }
        let mut columns = Self { pointers: vec![0], rows: Vec::new(), values: Vec::new() };
        if !system.pattern().row_idx().is_empty() {
            let weights = TangentWeights { stiffness: T::one(), damping: T::zero() };
            return Self::of_tangent(system, dofs, at, weights, &free);
        }
        let mut force = vec![T::zero(); system.dofs()];
        let (mut moved, mut u) = (force.clone(), at.u.clone());
        system.force(at.t, &u, &at.v, &mut force)?;
        // An increment as large as the displacements keeps the digits of the difference.
        let size = at.u.iter().fold(T::zero(), |largest, u| largest.max(u.abs()));
        let size = if size > T::zero() { size } else { T::one() };
        for &dof in dofs {
            u[dof] += size;
            system.force(at.t, &u, &at.v, &mut moved)?;
            let step = u[dof] - at.u[dof];
            u[dof] = at.u[dof];
            let largest = moved.iter().zip(&force).fold(T::zero(), |largest, (&x, &y)| largest.max((x - y).abs()));
            let differences = moved.iter().zip(&force).map(|(&x, &y)| {
                let difference = y - x;
                // A difference within the rounding of the forces is no coupling.
                let known = difference.abs() > rounding(x.abs().max(y.abs())).min(rounding(largest));
                if known { difference / step } else { T::zero() }
            });
            columns.push(differences.enumerate().filter(|&(_, value)| value != T::zero()), &free);
        }
        Ok(columns)
    }

    /// Columns of C, from the tangent.
    pub(crate) fn of_damping(system: &mut dyn System<T>, dofs: &[usize], at: &Motion<T>) -> Result<Self> {
        let weights = TangentWeights { stiffness: T::zero(), damping: T::one() };
        let free = vec![true; system.dofs()];
        Self::of_tangent(system, dofs, at, weights, &free)
    }

    fn of_tangent(
        system: &mut dyn System<T>,
        dofs: &[usize],
        at: &Motion<T>,
        weights: TangentWeights<T>,
        free: &[bool],
    ) -> Result<Self> {
        let mut columns = Self { pointers: vec![0], rows: Vec::new(), values: Vec::new() };
        let mut values = vec![T::zero(); system.pattern().row_idx().len()];
        system.tangent(at.t, &at.u, &at.v, weights, &mut values)?;
        let sum = SparseColMatRef::new(system.pattern(), &values);
        for &dof in dofs {
            columns.push(sum.row_idx_of_col_raw(dof).iter().copied().zip(sum.val_of_col(dof).iter().copied()), free);
        }
        Ok(columns)
    }

    fn push(&mut self, entries: impl Iterator<Item = (usize, T)>, free: &[bool]) {
        for (row, value) in entries.filter(|&(row, _)| free[row]) {
            self.rows.push(row);
            self.values.push(value);
        }
        self.pointers.push(self.rows.len());
    }

    pub(crate) fn column(&self, j: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        let range = self.pointers[j]..self.pointers[j + 1];
        self.rows[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    /// The couplings to other dofs only.
    pub(crate) fn without(&self, dofs: &[usize]) -> Self {
        self.picked(0..dofs.len(), |row| dofs.binary_search(&row).is_err())
    }

    /// The columns of a `part` of the `dofs` of these columns.
    pub(crate) fn of_part(&self, dofs: &[usize], part: &[usize]) -> Self {
        self.picked(part.iter().filter_map(|dof| dofs.binary_search(dof).ok()), |_| true)
    }

    fn picked(&self, places: impl Iterator<Item = usize>, keeps: impl Fn(usize) -> bool) -> Self {
        let mut picked = Self { pointers: vec![0], rows: Vec::new(), values: Vec::new() };
        for j in places {
            for (row, value) in self.column(j).filter(|&(row, value)| value != T::zero() && keeps(row)) {
                picked.rows.push(row);
                picked.values.push(value);
            }
            picked.pointers.push(picked.rows.len());
        }
        picked
    }

    /// A factor of K_bb; contact may act on the `interface`.
    pub(crate) fn factorized(&self, dofs: &[usize], interface: &[usize]) -> Result<Embedded<T>> {
        Part::factorized(self.own(dofs)?, dofs, interface)
    }

    /// K_bb, in the numbering of `dofs`.
    fn own(&self, dofs: &[usize]) -> Result<SparseColMat<usize, T>> {
        let (mut pointers, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for j in 0..dofs.len() {
            for (row, value) in self.column(j) {
                if let Ok(row) = dofs.binary_search(&row) {
                    rows.push(row);
                    values.push(value);
                }
            }
            pointers.push(rows.len());
        }
        let own = SymbolicSparseColMat::new_checked(dofs.len(), dofs.len(), pointers, None, rows);
        let own = SparseColMat::new(own, values);
        sparse::check_symmetric("stiffness", own.as_ref())?;
        // The pattern with all diagonal entries.
        let sum = Combination::new(dofs.len(), &[], &[own.symbolic()])?;
        let mut values = vec![T::zero(); sum.len()];
        sum.fill(&[(T::one(), own.val())], None, &mut values);
        Ok(sum.into_matrix(values))
    }
}

impl<T: Real> MasslessBlock<T> {
    /// Factorizes K_bb. Refuses systems that are nonlinear or have damping on these dofs.
    pub(crate) fn new(
        system: &mut dyn System<T>,
        integrator: &str,
        dofs: &[usize],
        at: &Motion<T>,
        interface: &[usize],
    ) -> Result<Self> {
        let refuse = |reason| {
            Err(Error::Incompatible { part: format!("{integrator} with dof {} without mass", dofs[0]), reason })
        };
        if system.linearity() == Linearity::Nonlinear {
            return refuse(
                "explicit stages find the displacements of dofs without mass by one factor of their stiffness, and the \
                 system is nonlinear; choose an implicit scheme, or give the dofs a mass",
            );
        }
        if is_damped(system, dofs)? {
            return refuse(
                "explicit stages balance dofs without mass by stiffness alone, and damping acts on them; choose \
                 damping proportional to mass or an implicit scheme, or give the dofs a mass",
            );
        }
        Self::of_statics(system, dofs, at, interface)
    }

    /// Factorizes K_bb.
    pub(crate) fn of_statics(
        system: &mut dyn System<T>,
        dofs: &[usize],
        at: &Motion<T>,
        interface: &[usize],
    ) -> Result<Self> {
        let columns = Columns::of(system, dofs, at)?;
        let part = columns.factorized(dofs, interface)?;
        let massive = interface.iter().enumerate().filter(|(_, dof)| dofs.binary_search(dof).is_err());
        Ok(Self {
            dofs: dofs.to_vec(),
            columns: columns.without(dofs),
            operator: Operator::of_part(part, interface, Unit::Dof)?,
            stage: CompiledStage::of_displacements(),
            massive: massive.map(|(place, &dof)| (dof, place)).collect(),
            sorted: 0,
        })
    }
}

impl<T: Real> MasslessBlock<T> {
    /// Writes the velocities of dofs without mass that follow statically from the others, −K_bb⁻¹ K_bi v_i, without
    /// loads and contact; copies the velocities of the others.
    pub(crate) fn follow(&mut self, v: &[T], out: &mut [T]) -> Result<()> {
        out.copy_from_slice(v);
        for (j, &dof) in self.dofs.iter().enumerate() {
            out[dof] = -self.columns.column(j).map(|(row, k)| k * v[row]).sum::<T>();
        }
        self.operator.solve(out)
    }

    /// Replaces forces on all dofs by statically equivalent forces on the dofs with mass: forces on dofs without mass
    /// are passed on to their neighbors.
    pub(crate) fn pass_on(&mut self, forces: &mut [T]) -> Result<()> {
        self.operator.solve(forces)?;
        for (j, &dof) in self.dofs.iter().enumerate() {
            let d = std::mem::replace(&mut forces[dof], T::zero());
            for (row, k) in self.columns.column(j) {
                forces[row] -= k * d;
            }
        }
        Ok(())
    }
}

/// Whether damping forces depend on the velocities of some dofs.
pub(crate) fn is_damped<T: Real>(system: &mut dyn System<T>, dofs: &[usize]) -> Result<bool> {
    Ok(damping_forces(system, dofs)?.is_some_and(|force| force.iter().any(|&force| force != T::zero())))
}

/// Damping forces on all dofs at distinct velocities of some dofs. None for systems without damping.
pub(crate) fn damping_forces<T: Real>(system: &mut dyn System<T>, dofs: &[usize]) -> Result<Option<Vec<T>>> {
    let mut v = vec![T::zero(); system.dofs()];
    let (u, mut force) = (v.clone(), v.clone());
    for &dof in dofs {
        // Scattered values, so that nothing cancels.
        v[dof] = T::of(1.0 + (sparse::scattered(dof) >> 12) as f64 / (1_u64 << 52) as f64);
    }
    let Some(damping) = system.damping_force() else { return Ok(None) };
    damping.evaluate(&u, &v, &mut force)?;
    Ok(Some(force))
}
