//! The contact problem of a stage: its rows, and its data with one entry per row of it.

use crate::contact_solver::{AdmissibleSet, ContactProblem};
use crate::real::Real;

/// The contact problem of a stage.
#[derive(Default)]
pub(crate) struct ProblemRows<T> {
    /// Its rows, group by group.
    pub(crate) rows: Vec<usize>,
    /// The same rows, ascending.
    pub(super) sorted: Vec<usize>,
    pub(crate) offset: Vec<T>,
    pub(crate) tolerance: Vec<T>,
    pub(crate) sets: Vec<AdmissibleSet>,
    pub(crate) multipliers: Vec<T>,
    /// Compliances of the rows, if W is not formed.
    pub(crate) own: Vec<T>,
    pub(crate) known: KnownForces<T>,
    /// Number of rows for which the available memory has been checked.
    pub(crate) checked: usize,
}

/// A contact problem in which some normal multipliers are known: their rows are the uncoupled equations λ = force.
#[derive(Default)]
pub(crate) struct KnownForces<T> {
    delassus: Vec<T>,
    offset: Vec<T>,
}

impl<T: Real> KnownForces<T> {
    /// Poses the problem with the rows whose multiplier is given by `force` uncoupled from all others.
    pub(crate) fn pose<'p>(
        &'p mut self,
        problem: &ContactProblem<'p, T>,
        force: impl Fn(usize) -> Option<T>,
    ) -> ContactProblem<'p, T> {
        let (Self { delassus, offset }, size) = (self, problem.size());
        delassus.clear();
        delassus.reserve_exact(size * size);
        offset.clear();
        // The diagonal of an uncoupled row is arbitrary, and forces of a static balance are in another unit than W:
        // the largest of the other diagonals is used.
        let unknown = (0..size).filter(|&i| force(i).is_none());
        let largest = unknown.fold(T::zero(), |largest, i| largest.max(problem.delassus(i, i)));
        let own = |i: usize| if largest > T::zero() { largest } else { problem.delassus(i, i) };
        for i in 0..size {
            let known = force(i);
            let entry = |j: usize| match (i == j, known.is_some() || force(j).is_some()) {
                (false, true) => T::zero(),
                (true, _) if known.is_some() => own(i),
                _ => problem.delassus(i, j),
            };
            delassus.extend((0..size).map(entry));
            offset.push(known.map_or(problem.offset[i], |force| -own(i) * force));
        }
        ContactProblem::of(delassus, offset, problem.sets, problem.tolerance, 0)
    }
}
