//! The contact problem of S = G M⁻¹ Gᵀ, solved separately for each group of rows coupled by S.

use super::JumpProjection;
use crate::contact::{ContactId, ContactJacobian};
use crate::contact_solver::{AdmissibleSet, ContactProblem, ContactSolver, FORESEEN, contact_error};
use crate::error::Result;
use crate::real::Real;

/// Memory for the problem of a group.
#[derive(Debug)]
pub(super) struct GroupProblem<T> {
    rows: Vec<usize>,
    s: Vec<T>,
    offset: Vec<T>,
    sets: Vec<AdmissibleSet>,
    tolerance: Vec<T>,
    multipliers: Vec<T>,
}

/// Rows, the admissible sets of their multipliers, and the jumps to remove with their rounding errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jumps<'j, T> {
    pub(super) rows: &'j [usize],
    pub(super) sets: &'j [AdmissibleSet],
    pub(super) jump: &'j [T],
    pub(super) tolerance: &'j [T],
}

impl<T: Real> GroupProblem<T> {
    /// Reserves memory for groups of up to `rows` rows, at most `FORESEEN`.
    pub(super) fn new(rows: usize) -> Self {
        let rows = rows.min(FORESEEN);
        let reals = |n| Vec::with_capacity(n);
        let (offset, tolerance, multipliers) = (reals(rows), reals(rows), reals(rows));
        let sets = Vec::with_capacity(rows);
        Self { rows: Vec::with_capacity(rows), s: reals(rows * rows), offset, sets, tolerance, multipliers }
    }

    /// Finds the multipliers x with S x + jump admissible; x holds a guess on entry. `id` gives the contact of a row
    /// for an error at time t.
    pub(super) fn solve(
        &mut self,
        (g, projection): (&ContactJacobian<T>, &mut JumpProjection<T>),
        solver: &mut dyn ContactSolver<T>,
        jumps: Jumps<'_, T>,
        x: &mut [T],
        (t, id): (f64, impl Fn(usize) -> ContactId),
    ) -> Result<()> {
        let Self { rows, s, offset, sets, tolerance, multipliers } = self;
        projection.sort(g, jumps.rows);
        for group in 0..projection.groups().len() {
            rows.clear();
            offset.clear();
            sets.clear();
            tolerance.clear();
            multipliers.clear();
            for &position in projection.groups().group(group) {
                rows.push(jumps.rows[position]);
                offset.push(jumps.jump[position]);
                sets.push(jumps.sets[position]);
                tolerance.push(jumps.tolerance[position]);
                multipliers.push(x[position]);
            }
            projection.assemble(g, rows, s)?;
            let problem = ContactProblem::of(s, offset, sets, tolerance, 0);
            solver.solve(&problem, multipliers).map_err(|failure| contact_error(t, failure, |row| id(rows[row])))?;
            for (&position, &multiplier) in projection.groups().group(group).iter().zip(multipliers.iter()) {
                x[position] = multiplier;
            }
        }
        Ok(())
    }
}
