//! Jump problems of hundreds of rows that S couples, as of a mortar: S is sparse, and neither formed densely nor
//! factorized so.

use super::JumpProjection;
use super::jump_problem::JumpProblem;
use crate::contact::ContactJacobian;
use crate::contact_solver::{AdmissibleSet, Patience, ProjectedCg, RowData, SparseProblem};
use crate::real::Real;
use crate::rounding::rounding;

/// Memory for one group, with one entry per row or block.
#[derive(Debug, Default)]
pub(super) struct ManyRows<T> {
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

impl<T: Real> JumpProblem<T> {
    /// Solves for the rows of a group, and returns whether it could: it has at least `large` rows, and no force in it
    /// is known.
    pub(super) fn solve_without_s(
        &mut self,
        (g, projection): (&ContactJacobian<T>, &JumpProjection<T>),
        (group, large): (usize, usize),
        presses: T,
    ) -> bool {
        let (positions, Some(inverse)) = (projection.groups().group(group), projection.lumped()) else { return false };
        let is_known = |&position: &usize| self.blocks[self.owners[position]].known.is_some();
        if positions.len() < large || positions.iter().any(is_known) {
            return false;
        }
        let mut many = self.many.take().unwrap_or_default();
        let mut solved = many.pose(self, g, positions, inverse);
        while solved {
            solved = many.solve(g, inverse);
            if !solved || !self.keep(&mut many, positions, presses) {
                break;
            }
        }
        if solved {
            self.keep_in_cones(positions, presses);
            many.measure(self, g, positions, inverse);
        }
        self.many = Some(many);
        solved
    }

    /// Takes the multipliers over. A sliding contact whose multiplier would pull gets no friction: returns whether
    /// there is any.
    fn keep(&mut self, many: &mut ManyRows<T>, positions: &[usize], presses: T) -> bool {
        let (mut again, mut number) = (false, 0);
        for (&position, &multiplier) in positions.iter().zip(&many.multipliers) {
            self.totals[position] = multiplier;
            let block = &mut self.blocks[self.owners[position]];
            if block.place != position {
                continue;
            }
            let pulls = presses * multiplier < T::zero();
            if pulls && block.direction.is_some_and(|direction| direction != [T::zero(); 2]) {
                (block.direction, many.along[number], again) = (Some([T::zero(); 2]), Some([T::zero(); 2]), true);
            }
            number += 1;
        }
        again
    }
}

impl<T: Real> ManyRows<T> {
    /// Sets up the problem of the rows at these positions. Returns whether all its values are finite.
    fn pose(&mut self, all: &JumpProblem<T>, g: &ContactJacobian<T>, positions: &[usize], inverse: &[T]) -> bool {
        self.move_dofs(g, (&all.rows, positions), inverse, |position| [all.base[position], all.base[position].abs()]);
        let Self { rows, compliance, offset, tolerance, sets, along, multipliers, moved, sizes, .. } = self;
        for values in [&mut *compliance, offset, tolerance] {
            values.clear();
        }
        rows.clear();
        sets.clear();
        along.clear();
        for &position in positions {
            let (row, block) = (all.rows[position], &all.blocks[all.owners[position]]);
            rows.push(row);
            offset.push(all.jump[position] - g.product(row, moved));
            tolerance.push(all.tolerance[position] + rounding(g.magnitude(row, sizes)));
            let is_first = block.place == position;
            compliance.push(if is_first { block.compliance } else { T::zero() });
            if is_first {
                sets.push(block.set);
                along.push(block.direction);
            }
        }
        multipliers.clear();
        multipliers.resize(positions.len(), T::zero());
        T::all_finite(offset) && T::all_finite(compliance)
    }

    fn solve(&mut self, g: &ContactJacobian<T>, inverse: &[T]) -> bool {
        let Self { cg, rows, compliance, offset, tolerance, sets, along, multipliers, .. } = self;
        let mut product = |x: &[T], y: &mut [T]| {
            for ((y, &x), &inverse) in y.iter_mut().zip(x).zip(inverse) {
                *y = if inverse > T::zero() { x / inverse } else { T::zero() };
            }
        };
        let data = RowData { compliance, offset, tolerance, sets, along };
        cg.begin();
        let patience = Patience { products: 2 * LOOKS, looks: LOOKS };
        let mut problem = SparseProblem { product: &mut product, inverse, g, rows, data, patience };
        cg.solve(&mut problem, multipliers).is_solved
    }

    /// Computes the remaining jumps.
    fn measure(&mut self, all: &mut JumpProblem<T>, g: &ContactJacobian<T>, positions: &[usize], inverse: &[T]) {
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
            values.clear();
            values.resize(inverse.len(), T::zero());
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
