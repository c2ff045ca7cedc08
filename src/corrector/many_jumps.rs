//! Jump problems of hundreds of rows that S couples, as of a mortar: S is sparse, and neither formed densely nor
//! factorized so. Only the dofs of the rows move; they are numbered as the rows list them, which is the same on all
//! ranks.

use super::JumpProjection;
use super::jump_problem::{FrictionOf, JumpProblem};
use crate::contact::ContactJacobian;
use crate::contact_solver::{AdmissibleSet, Body, Patience, ProjectedCg, RowData, SparseProblem};
use crate::error::Result;
use crate::memory;
use crate::real::Real;
use crate::rounding::{projected_residual, rounding};

/// Memory for one group.
#[derive(Debug, Default)]
pub(super) struct ManyJumps<T> {
    cg: ProjectedCg<T>,
    moved: MovedDofs<T>,
    rows: Vec<usize>,
    compliance: Vec<T>,
    offset: Vec<T>,
    tolerance: Vec<T>,
    sets: Vec<AdmissibleSet>,
    along: Vec<Option<[T; 2]>>,
    multipliers: Vec<T>,
}

/// The dofs that the rows of a group act on.
#[derive(Debug, Default)]
struct MovedDofs<T> {
    /// The rows, with these dofs.
    g: ContactJacobian<T>,
    dofs: Vec<usize>,
    /// For each dof of the system its number among these, from one on.
    numbers: Vec<usize>,
    inverse: Vec<T>,
    /// Changes of the dofs by the multipliers, and the sums of their magnitudes.
    change: Vec<T>,
    sizes: Vec<T>,
}

/// How often statuses may be decided before S is formed.
const LOOKS: usize = 16;

/// What memory is asked for.
const WHAT: &str = "the jumps of many rows";

impl<T: Real> JumpProblem<T> {
    /// Solves for the rows of a group, and returns whether it could: it has at least `least` rows, and no force in it
    /// is known.
    pub(super) fn solve_without_s(
        &mut self,
        (g, projection): (&ContactJacobian<T>, &JumpProjection<T>),
        (group, least): (usize, usize),
        friction: FrictionOf,
    ) -> Result<bool> {
        let (positions, Some(inverse)) = (projection.groups().group(group), projection.lumped()) else {
            return Ok(false);
        };
        let is_known = |&position: &usize| self.blocks[self.owners[position]].known.is_some();
        if positions.len() < least || positions.iter().any(is_known) {
            return Ok(false);
        }
        let mut many = self.many.take().unwrap_or_default();
        many.moved.read((g, inverse), positions.iter().map(|&position| self.rows[position]))?;
        loop {
            if !many.solve(self, positions, friction)? {
                self.many = Some(many);
                return Ok(false);
            }
            for (&position, &multiplier) in positions.iter().zip(&many.multipliers) {
                self.totals[position] = multiplier;
            }
            if friction == FrictionOf::Changes || !self.take_friction_of_pulling(positions) {
                break;
            }
        }
        self.keep_in_cones(positions);
        many.measure(self, positions);
        self.many = Some(many);
        Ok(true)
    }
}

impl<T: Real> MovedDofs<T> {
    /// Numbers the dofs of some rows.
    fn read(
        &mut self,
        (g, inverse): (&ContactJacobian<T>, &[T]),
        rows: impl Iterator<Item = usize> + Clone,
    ) -> Result<()> {
        let Self { g: own, dofs, numbers, inverse: of_own, change, sizes } = self;
        for dof in dofs.drain(..) {
            numbers[dof] = 0;
        }
        memory::grow(numbers, inverse.len(), 1, WHAT)?;
        let entries = rows.clone().map(|row| g.row(row).count()).sum();
        own.begin(rows.clone().count(), entries)?;
        memory::make_room(dofs, entries.min(inverse.len()), WHAT)?;
        for row in rows {
            own.push_entries(g.row(row).map(|(dof, weight)| {
                if numbers[dof] == 0 {
                    dofs.push(dof);
                    numbers[dof] = dofs.len();
                }
                (numbers[dof] - 1, weight)
            }));
        }
        of_own.clear();
        memory::make_room(of_own, dofs.len(), WHAT)?;
        of_own.extend(dofs.iter().map(|&dof| inverse[dof]));
        for values in [change, sizes] {
            memory::grow(values, dofs.len(), 1, WHAT)?;
        }
        Ok(())
    }

    /// M⁻¹ Gᵀ m of multipliers m, and M⁻¹ |G|ᵀ s of their sizes s, given for each row.
    fn set(&mut self, multipliers: impl Iterator<Item = [T; 2]>) {
        let Self { g, inverse, change, sizes, .. } = self;
        for values in [&mut *change, sizes] {
            values.fill(T::zero());
        }
        for (row, [multiplier, size]) in multipliers.enumerate() {
            for (dof, weight) in g.row(row) {
                change[dof] += inverse[dof] * (weight * multiplier);
                sizes[dof] += inverse[dof] * (weight.abs() * size);
            }
        }
    }

    /// The change of a row, and the rounding of it.
    fn of_row(&self, row: usize) -> [T; 2] {
        [self.g.product(row, &self.change), rounding(self.g.magnitude(row, &self.sizes))]
    }
}

/// M, which is lumped, from its inverse.
struct LumpedMass<'a, T>(&'a [T]);

impl<T: Real> Body<T> for LumpedMass<'_, T> {
    fn multiply(&mut self, _: usize, x: &[T], y: &mut [T]) -> Result<()> {
        for ((y, &x), &inverse) in y.iter_mut().zip(x).zip(self.0) {
            *y = if inverse > T::zero() { x / inverse } else { T::zero() };
        }
        Ok(())
    }
}

impl<T: Real> ManyJumps<T> {
    /// Solves for the rows at these positions. Returns whether all values are finite, and the iteration converges.
    fn solve(&mut self, all: &JumpProblem<T>, positions: &[usize], friction: FrictionOf) -> Result<bool> {
        let Self { cg, moved, rows, compliance, offset, tolerance, sets, along, multipliers } = self;
        let size = positions.len();
        for values in [&mut *compliance, offset, tolerance, multipliers] {
            values.clear();
            memory::grow(values, size, 1, WHAT)?;
        }
        rows.clear();
        memory::make_room(rows, size, WHAT)?;
        rows.extend(0..size);
        sets.clear();
        memory::make_room(sets, size, WHAT)?;
        along.clear();
        memory::make_room(along, size, WHAT)?;
        moved.set(positions.iter().map(|&position| [all.base[position], all.base[position].abs()]));
        for (row, &position) in positions.iter().enumerate() {
            let block = &all.blocks[all.owners[position]];
            let [change, noise] = moved.of_row(row);
            offset[row] = all.jump[position] - change;
            tolerance[row] = all.tolerance[position] + noise;
            if block.place == position {
                compliance[row] = block.compliance;
                sets.push(match (block.set, block.tangents) {
                    // Held, with given friction: the set only counts the rows.
                    (AdmissibleSet::Free, 1..) => AdmissibleSet::with_friction(0.0, block.tangents),
                    (set, _) => set,
                });
                along.push(block.direction);
            }
        }
        if !T::all_finite(offset) || !T::all_finite(compliance) {
            return Ok(false);
        }
        let holds = friction == FrictionOf::Changes;
        let data = RowData { g: &moved.g, rows, compliance, offset, tolerance, sets, along, holds };
        let patience = Patience { products: 2 * LOOKS, looks: LOOKS, residual: projected_residual::<T>().value() };
        cg.begin();
        let mut mass = LumpedMass(&moved.inverse);
        let mut problem = SparseProblem { body: &mut mass, inverse: &moved.inverse, data, patience };
        Ok(cg.solve(&mut problem, multipliers)?.is_solved)
    }

    /// Computes the remaining jumps.
    fn measure(&mut self, all: &mut JumpProblem<T>, positions: &[usize]) {
        self.moved.set(positions.iter().map(|&position| {
            let [total, base] = [all.totals[position], all.base[position]];
            [total - base, total.abs() + base.abs()]
        }));
        for (row, &position) in positions.iter().enumerate() {
            let [change, noise] = self.moved.of_row(row);
            all.left[position] = all.jump[position] + change;
            all.noise[position] = all.tolerance[position] + noise;
        }
    }
}
