//! The rows of a contact problem, copied. The tangents of a contact in space may be turned along its slip.

use super::{RowData, SparseProblem, WHAT};
use crate::contact::ContactJacobian;
use crate::contact_solver::AdmissibleSet;
use crate::error::Result;
use crate::memory;
use crate::real::Real;
use std::ops::Range;

/// The rows, one after the other. The two tangents of a contact act on the same dofs.
#[derive(Debug, Default)]
pub(super) struct Rows<T> {
    g: ContactJacobian<T>,
    /// G of the last problem.
    before: ContactJacobian<T>,
    pub(super) offset: Vec<T>,
    pub(super) tolerance: Vec<T>,
    /// The compliances of the laws.
    pub(super) compliance: Vec<T>,
    pub(super) blocks: Vec<Block<T>>,
    /// The rows of the system.
    names: Vec<usize>,
}

/// A contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<T> {
    pub(super) first: usize,
    pub(super) set: AdmissibleSet,
    /// Its friction per unit normal force, if that is given.
    pub(super) along: Option<[T; 2]>,
    /// Whether it stays closed, by a normal force of either sign.
    pub(super) is_bilateral: bool,
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
        self.names == problem.data.rows
            && self.blocks.iter().map(|block| block.set).eq(problem.data.sets.iter().copied())
    }

    /// Copies the rows of a problem; `keeps` tangents as they are turned. Returns whether all weights are as before.
    pub(super) fn take(&mut self, problem: &SparseProblem<'_, T>, keeps: bool) -> Result<bool> {
        let turned = self.blocks.iter().any(|block| block.axis != [T::one(), T::zero()]);
        let Self { g, before, offset, tolerance, compliance, blocks, names } = self;
        let RowData { g: all, rows, .. } = problem.data;
        let entries_of =
            |row: usize| all.row(row).filter_map(|(dof, weight)| Some((problem.body.number(dof)?, weight)));
        memory::copy(offset, problem.data.offset, WHAT)?;
        memory::copy(tolerance, problem.data.tolerance, WHAT)?;
        memory::copy(compliance, problem.data.compliance, WHAT)?;
        memory::copy(names, rows, WHAT)?;
        // A tangent also gets the dofs of the other one, with weights of zero.
        let entries: usize = rows.iter().map(|&row| all.row(row).count()).sum();
        std::mem::swap(g, before);
        g.begin(rows.len(), 2 * entries)?;
        let mut first = 0;
        for &set in problem.data.sets {
            for row in first..first + set.rows() {
                let other = if set.rows() == 3 && row > first { 2 * first + 3 - row } else { row };
                let dofs = |row: usize| entries_of(rows[row]).map(|(dof, _)| dof);
                let own = entries_of(rows[row]);
                if row == other || dofs(row).eq(dofs(other)) {
                    g.push_entries(own);
                    continue;
                }
                // The first tangent comes first in both rows.
                let beside = dofs(other).map(|dof| (dof, T::zero()));
                match row < other {
                    true => g.push_entries(own.chain(beside)),
                    false => g.push_entries(beside.chain(own)),
                }
            }
            first += set.rows();
        }
        if keeps {
            for block in 0..self.blocks.len() {
                self.turn_rows(block, self.blocks[block].axis);
            }
            return Ok(false);
        }
        blocks.clear();
        memory::make_room(blocks, problem.data.sets.len(), WHAT)?;
        let mut first = 0;
        blocks.extend(problem.data.sets.iter().enumerate().map(|(number, &set)| {
            let along = problem.data.along.get(number).copied().flatten();
            let is_bilateral = set.is_bilateral() || problem.data.holds && along.is_some();
            let block = Block { first, set, along, is_bilateral, axis: [T::one(), T::zero()] };
            first += set.rows();
            block
        }));
        Ok(!turned && g == before)
    }

    /// The (dof, weight) pairs of a row.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        self.g.row(row)
    }

    /// G_row · x + q, without the displacement of a compliant row.
    pub(super) fn gap(&self, row: usize, x: &[T]) -> T {
        self.offset[row] + self.g.product(row, x)
    }

    /// |q| + Σ_j |G_row,j| |x_j|.
    pub(super) fn magnitude(&self, row: usize, x: &[T]) -> T {
        self.offset[row].abs() + self.g.magnitude(row, x)
    }

    /// `x += c G_rowᵀ`.
    pub(super) fn scatter(&self, row: usize, c: T, x: &mut [T]) {
        self.g.scatter(row, c, x);
    }

    /// Turns the tangents of a contact in space so that the first one points along the unit vector `along`, which is
    /// given in the present tangents.
    pub(super) fn turn(&mut self, block: usize, along: [T; 2]) {
        let [c, s] = self.blocks[block].axis;
        self.blocks[block].axis = [c * along[0] - s * along[1], s * along[0] + c * along[1]];
        self.turn_rows(block, along);
    }

    fn turn_rows(&mut self, block: usize, [c, s]: [T; 2]) {
        let Range { start, end } = self.blocks[block].tangents();
        if end - start < 2 || [c, s] == [T::one(), T::zero()] {
            return;
        }
        self.g.turn(start, [c, s]);
        let [x, y] = [self.offset[start], self.offset[start + 1]];
        (self.offset[start], self.offset[start + 1]) = (c * x + s * y, c * y - s * x);
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
