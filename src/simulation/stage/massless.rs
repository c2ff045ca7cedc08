//! Dofs without mass, whose displacements follow from static balance with the others: their part of K, factorized.

use crate::error::{Error, Result};
use crate::linear_solver::{Automatic, Condensation, Factorization, LinearSolver};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::operator::Operator;
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
    /// The interface indices of its own dofs; the size of the interface for dofs that are not on it.
    pub(crate) places: Vec<usize>,
    /// Version of the rows when rows on massless dofs were last found.
    pub(crate) sorted: u64,
}

/// Columns of K, one per massless dof: its couplings to all free dofs.
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
            columns.push(differences.enumerate(), &free);
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
        for (row, value) in entries.filter(|&(row, value)| free[row] && value != T::zero()) {
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
            for (row, value) in self.column(j).filter(|&(row, _)| keeps(row)) {
                picked.rows.push(row);
                picked.values.push(value);
            }
            picked.pointers.push(picked.rows.len());
        }
        picked
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

/// A factor of K_bb that solves for vectors of the whole system, and of its whole interface: other dofs do not
/// respond.
#[derive(Debug)]
pub(crate) struct Embedded<T> {
    inner: Box<dyn Factorization<T>>,
    dofs: Vec<usize>,
    /// Interface indices of its own dofs, ascending, and the number of all dofs there.
    places: Vec<usize>,
    interface: usize,
    /// Scratch: one entry per own dof, and one per own dof on the interface.
    vector: Vec<T>,
    on_interface: Vec<T>,
}

fn gather<T: Copy>(all: &[T], places: &[usize], some: &mut [T]) {
    for (x, &place) in some.iter_mut().zip(places) {
        *x = all[place];
    }
}

fn scatter<T: Copy>(some: &[T], places: &[usize], all: &mut [T]) {
    for (&x, &place) in some.iter().zip(places) {
        all[place] = x;
    }
}

impl<T: Real> Factorization<T> for Embedded<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let dofs = &self.dofs;
        self.inner.factorize(a).map_err(|error| match error {
            Error::Singular { dof, .. } => Error::Singular {
                matrix: "stiffness of the dofs without mass",
                dof: dofs.get(dof).copied().unwrap_or(dof),
            },
            other => other,
        })
    }

    /// Entries of other dofs are left as they are.
    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        gather(rhs, &self.dofs, &mut self.vector);
        self.inner.solve(&mut self.vector)?;
        scatter(&self.vector, &self.dofs, rhs);
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.inner.stored_values()
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        Some(self)
    }
}

impl<T: Real> Condensation<T> for Embedded<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        let Self { inner, dofs, places, vector, on_interface, .. } = self;
        gather(rhs, dofs, vector);
        interface.fill(T::zero());
        match inner.condensation().filter(|_| !places.is_empty()) {
            Some(condensed) => condensed.condense(vector, on_interface)?,
            None => inner.solve(vector)?,
        }
        scatter(on_interface, places, interface);
        Ok(())
    }

    /// Entries of other dofs are left as they are.
    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        let Self { inner, dofs, places, vector, on_interface, .. } = self;
        gather(interface, places, on_interface);
        if let Some(condensed) = inner.condensation().filter(|_| !places.is_empty()) {
            condensed.expand(on_interface, vector)?;
        }
        scatter(vector, dofs, solution);
        Ok(())
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        let Self { inner, places, on_interface, interface, .. } = self;
        for column in forces.chunks_exact_mut((*interface).max(1)) {
            gather(column, places, on_interface);
            column.fill(T::zero());
            if let Some(condensed) = inner.condensation().filter(|_| !places.is_empty()) {
                condensed.solve(on_interface)?;
                scatter(on_interface, places, column);
            }
        }
        Ok(())
    }
}

impl<T: Real> Embedded<T> {
    /// K_bb from its columns, factorized.
    pub(crate) fn factorized(columns: &Columns<T>, dofs: &[usize], interface: &[usize]) -> Result<Self> {
        let own = columns.own(dofs)?;
        let shared =
            interface.iter().enumerate().filter_map(|(place, dof)| Some((place, dofs.binary_search(dof).ok()?)));
        let (places, last): (Vec<usize>, Vec<usize>) = shared.unzip();
        let mut factor = Self {
            inner: Automatic.analyze(own.symbolic(), &last)?,
            dofs: dofs.to_vec(),
            on_interface: vec![T::zero(); places.len()],
            places,
            interface: interface.len(),
            vector: vec![T::zero(); dofs.len()],
        };
        factor.factorize(own.as_ref())?;
        Ok(factor)
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
        let factor = Embedded::factorized(&columns, dofs, interface)?;
        let massive = interface.iter().enumerate().filter(|(_, dof)| dofs.binary_search(dof).is_err());
        Ok(Self {
            dofs: dofs.to_vec(),
            columns: columns.without(dofs),
            operator: Operator::of_part(Box::new(factor), interface, Unit::Dof)?,
            stage: CompiledStage::of_displacements(),
            massive: massive.map(|(place, &dof)| (dof, place)).collect(),
            places: dofs.iter().map(|dof| interface.binary_search(dof).unwrap_or(interface.len())).collect(),
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
