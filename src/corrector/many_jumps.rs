//! Jump problems of hundreds of rows that S couples, as of a mortar: S is sparse, and neither formed densely nor
//! factorized so.

use super::JumpProjection;
use super::jump_problem::{FrictionOf, JumpProblem};
use crate::contact::ContactJacobian;
use crate::contact_solver::{AdmissibleSet, Patience, ProjectedCg, RowData, SparseProblem};
use crate::error::Result;
use crate::memory;
use crate::real::Real;
use crate::rounding::{projected_residual, rounding};

/// Memory for one group, with one entry per row or block.
#[derive(Debug, Default)]
pub(super) struct ManyJumps<T> {
    cg: ProjectedCg<T>,
    rows: Vec<usize>,
    compliance: Vec<T>,
    offset: Vec<T>,
    tolerance: Vec<T>,
    sets: Vec<AdmissibleSet>,
    along: Vec<Option<[T; 2]>>,
    multipliers: Vec<T>,
    /// Changes of the dofs by the multipliers, and the sums of their magnitudes.
    moved: Vec<T>,
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
        loop {
            if !many.solve(self, g, (positions, inverse))? {
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
        many.measure(self, g, (positions, inverse));
        self.many = Some(many);
        Ok(true)
    }
}

impl<T: Real> ManyJumps<T> {
    /// Solves for the rows at these positions. Returns whether all values are finite, and the iteration converges.
    fn solve(
        &mut self,
        all: &JumpProblem<T>,
        g: &ContactJacobian<T>,
        (positions, inverse): (&[usize], &[T]),
    ) -> Result<bool> {
        let Self { rows, compliance, offset, tolerance, sets, along, multipliers, moved, sizes, .. } = self;
        let size = positions.len();
        for values in [&mut *compliance, offset, tolerance, multipliers] {
            values.clear();
            memory::grow(values, size, 1, WHAT)?;
        }
        for values in [&mut *moved, sizes] {
            memory::grow(values, inverse.len(), 1, WHAT)?;
        }
        rows.clear();
        memory::make_room(rows, size, WHAT)?;
        sets.clear();
        memory::make_room(sets, size, WHAT)?;
        along.clear();
        memory::make_room(along, size, WHAT)?;
        self.move_dofs(g, (&all.rows, positions), inverse, |position| [all.base[position], all.base[position].abs()]);
        let Self { cg, rows, compliance, offset, tolerance, sets, along, multipliers, moved, sizes } = self;
        for (k, &position) in positions.iter().enumerate() {
            let (row, block) = (all.rows[position], &all.blocks[all.owners[position]]);
            rows.push(row);
            offset[k] = all.jump[position] - g.product(row, moved);
            tolerance[k] = all.tolerance[position] + rounding(g.magnitude(row, sizes));
            if block.place == position {
                compliance[k] = block.compliance;
                sets.push(block.set);
                along.push(block.direction);
            }
        }
        if !T::all_finite(offset) || !T::all_finite(compliance) {
            return Ok(false);
        }
        let mut product = |_: usize, x: &[T], y: &mut [T]| {
            for ((y, &x), &inverse) in y.iter_mut().zip(x).zip(inverse) {
                *y = if inverse > T::zero() { x / inverse } else { T::zero() };
            }
        };
        let data = RowData { g, rows, compliance, offset, tolerance, sets, along };
        let patience = Patience { products: 2 * LOOKS, looks: LOOKS, residual: projected_residual::<T>().value() };
        cg.begin();
        let outcome = cg.solve(&mut SparseProblem { product: &mut product, inverse, data, patience }, multipliers)?;
        Ok(outcome.is_solved)
    }

    /// Computes the remaining jumps.
    fn measure(&mut self, all: &mut JumpProblem<T>, g: &ContactJacobian<T>, (positions, inverse): (&[usize], &[T])) {
        self.move_dofs(g, (&all.rows, positions), inverse, |position| {
            let [total, base] = [all.totals[position], all.base[position]];
            [total - base, total.abs() + base.abs()]
        });
        for &position in positions {
            let row = all.rows[position];
            all.left[position] = all.jump[position] + g.product(row, &self.moved);
            all.noise[position] = all.tolerance[position] + rounding(g.magnitude(row, &self.sizes));
        }
    }

    /// M⁻¹ Gᵀ m of multipliers m, and M⁻¹ |G|ᵀ s of their sizes s.
    fn move_dofs(
        &mut self,
        g: &ContactJacobian<T>,
        (rows, positions): (&[usize], &[usize]),
        inverse: &[T],
        multiplier: impl Fn(usize) -> [T; 2],
    ) {
        let Self { moved, sizes, .. } = self;
        for values in [&mut *moved, sizes] {
            values.fill(T::zero());
        }
        for &position in positions {
            let [multiplier, size] = multiplier(position);
            for (dof, weight) in g.row(rows[position]) {
                moved[dof] += inverse[dof] * (weight * multiplier);
                sizes[dof] += inverse[dof] * (weight.abs() * size);
            }
        }
    }
}
