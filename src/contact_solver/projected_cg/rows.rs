//! The rows of a contact problem, copied. The tangents of a contact in space may be turned along its slip.

use super::SparseProblem;
use crate::contact_solver::AdmissibleSet;
use crate::real::Real;
use std::ops::Range;

/// The rows, one after the other. The two tangents of a contact act on the same dofs.
#[derive(Debug, Default)]
pub(super) struct Rows<T> {
    starts: Vec<usize>,
    dofs: Vec<usize>,
    weights: Vec<T>,
    pub(super) offset: Vec<T>,
    pub(super) tolerance: Vec<T>,
    /// The compliances of the laws.
    pub(super) compliance: Vec<T>,
    pub(super) blocks: Vec<Block<T>>,
    /// The rows of the system.
    names: Vec<usize>,
    before: Before<T>,
}

/// The weights of the last problem.
#[derive(Debug, Default)]
struct Before<T> {
    starts: Vec<usize>,
    dofs: Vec<usize>,
    weights: Vec<T>,
}

/// A contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<T> {
    pub(super) first: usize,
    pub(super) set: AdmissibleSet,
    /// Its friction per unit normal force, if that is given.
    pub(super) along: Option<[T; 2]>,
    /// The first tangent, in the coordinates in which it was given.
    axis: [T; 2],
}

impl<T> Block<T> {
    pub(super) fn tangents(&self) -> Range<usize> {
        self.first + 1..self.first + self.set.rows()
    }
}

impl<T: Real> Rows<T> {
    pub(super) fn len(&self) -> usize {
        self.offset.len()
    }

    /// Whether these are the rows of a problem, perhaps linearized elsewhere.
    pub(super) fn are_of(&self, problem: &SparseProblem<'_, T>) -> bool {
        self.names == problem.rows && self.blocks.iter().map(|block| block.set).eq(problem.data.sets.iter().copied())
    }

    /// Copies the rows of a problem; `keeps` tangents as they are turned. Returns whether all weights are as before.
    pub(super) fn take(&mut self, problem: &SparseProblem<'_, T>, keeps: bool) -> bool {
        let turned = self.blocks.iter().any(|block| block.axis != [T::one(), T::zero()]);
        let Self { starts, dofs, weights, offset, tolerance, compliance, blocks, names, before } = self;
        let Before { starts: old_starts, dofs: old_dofs, weights: old_weights } = before;
        std::mem::swap(starts, old_starts);
        std::mem::swap(dofs, old_dofs);
        std::mem::swap(weights, old_weights);
        let data = problem.data;
        for (values, of) in [(offset, data.offset), (tolerance, data.tolerance), (compliance, data.compliance)] {
            values.clear();
            values.extend_from_slice(of);
        }
        names.clear();
        names.extend_from_slice(problem.rows);
        starts.clear();
        dofs.clear();
        weights.clear();
        starts.push(0);
        let listed = |row: usize| problem.g.row(problem.rows[row]);
        let mut first = 0;
        for &set in problem.data.sets {
            for row in first..first + set.rows() {
                // Weights of zero on the dofs of the other tangent, where they differ.
                let other = if set.rows() == 3 && row > first { 2 * first + 3 - row } else { row };
                let alike = other == row || listed(row).map(|(dof, _)| dof).eq(listed(other).map(|(dof, _)| dof));
                let of_other = || listed(other).filter(|_| !alike).map(|(dof, _)| (dof, T::zero()));
                let own = || listed(row);
                let mut add = |(dof, weight)| {
                    dofs.push(dof);
                    weights.push(weight);
                };
                // The first tangent comes first in both lists.
                match row <= other {
                    true => own().chain(of_other()).for_each(&mut add),
                    false => of_other().chain(own()).for_each(&mut add),
                }
                starts.push(dofs.len());
            }
            first += set.rows();
        }
        if keeps {
            for block in 0..self.blocks.len() {
                self.turn_weights(block, self.blocks[block].axis);
            }
            return false;
        }
        blocks.clear();
        let mut first = 0;
        blocks.extend(data.sets.iter().enumerate().map(|(number, &set)| {
            let along = data.along.get(number).copied().flatten();
            let block = Block { first, set, along, axis: [T::one(), T::zero()] };
            first += set.rows();
            block
        }));
        !turned && old_starts == starts && old_dofs == dofs && old_weights == weights
    }

    /// The (dof, weight) pairs of a row.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        let range = self.starts[row]..self.starts[row + 1];
        self.dofs[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }

    /// G_row · x + q, without the displacement of a compliant row.
    pub(super) fn gap(&self, row: usize, x: &[T]) -> T {
        self.offset[row] + self.row(row).map(|(dof, weight)| weight * x[dof]).sum::<T>()
    }

    /// |q| + Σ_j |G_row,j| |x_j|.
    pub(super) fn magnitude(&self, row: usize, x: &[T]) -> T {
        self.offset[row].abs() + self.row(row).map(|(dof, weight)| (weight * x[dof]).abs()).sum::<T>()
    }

    /// `x += c G_rowᵀ`.
    pub(super) fn scatter(&self, row: usize, c: T, x: &mut [T]) {
        for (dof, weight) in self.row(row) {
            x[dof] += c * weight;
        }
    }

    /// Turns the tangents of a contact in space so that the first one points along the unit vector `along`, which is
    /// given in the present tangents.
    pub(super) fn turn(&mut self, block: usize, along: [T; 2]) {
        let [c, s] = self.blocks[block].axis;
        self.blocks[block].axis = [c * along[0] - s * along[1], s * along[0] + c * along[1]];
        self.turn_weights(block, along);
    }

    fn turn_weights(&mut self, block: usize, [c, s]: [T; 2]) {
        let Range { start, .. } = self.blocks[block].tangents();
        if self.blocks[block].set.rows() < 3 || [c, s] == [T::one(), T::zero()] {
            return;
        }
        let turn = |x: &mut T, y: &mut T| (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
        let [from, middle, end] = [0, 1, 2].map(|k| self.starts[start + k]);
        let (one, other) = self.weights[from..end].split_at_mut(middle - from);
        one.iter_mut().zip(other).for_each(|(x, y)| turn(x, y));
        let (one, other) = self.offset[start..start + 2].split_at_mut(1);
        turn(&mut one[0], &mut other[0]);
    }

    /// Writes multipliers in the tangents as given, each in its set.
    pub(super) fn read(&self, own: &[T], multipliers: &mut [T]) {
        multipliers.copy_from_slice(own);
        for block in &self.blocks {
            let range = block.first..block.first + block.set.rows();
            if range.len() == 3 {
                let ([c, s], [x, y]) = (block.axis, [own[block.first + 1], own[block.first + 2]]);
                multipliers[block.first + 1] = c * x - s * y;
                multipliers[block.first + 2] = s * x + c * y;
            }
            if block.along.is_none() {
                restrict(block.set, &mut multipliers[range]);
            }
        }
    }
}

/// Moves multipliers that miss their set by rounding into it; of a cone the normal force stays.
fn restrict<T: Real>(set: AdmissibleSet, multipliers: &mut [T]) {
    let Some((normal, tangential)) = multipliers.split_first_mut() else { return };
    if !set.is_bilateral() {
        *normal = normal.max(T::zero());
    }
    let Some(friction) = set.friction() else { return };
    let bound = T::of(friction) * normal.max(T::zero());
    let size = tangential.iter().fold(T::zero(), |size, &f| size.hypot(f));
    if size > bound {
        for f in tangential {
            *f *= bound / size;
        }
    }
}
