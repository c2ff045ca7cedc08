//! Contacts that rebound with restitution: their rates before and after the impact.

use crate::contact::ContactJacobian;
use crate::real::Real;

/// The rebounding contacts of a stage. One entry per row of G unless noted.
#[derive(Debug, Default)]
pub(super) struct Rebounds<T> {
    /// Whether there are any.
    pub(super) any: bool,
    /// The rate before the impact, and the required rate after it: zero if the contact is to stay.
    pub(super) before: Vec<T>,
    pub(super) targets: Vec<T>,
    /// The fraction of the target rates that adds no energy.
    pub(super) share: T,
    /// The contacts that leave, ascending, and their tangential rows.
    pub(super) leaving: Vec<usize>,
    /// Their rates and accelerations.
    pub(super) outgoing: Vec<[T; 2]>,
}

impl<T: Real> Rebounds<T> {
    /// Whether any contact rebounds.
    pub(super) fn any(&self) -> bool {
        self.any
    }

    /// The required rate of a row.
    pub(super) fn target(&self, row: usize) -> T {
        if self.any { self.share * self.targets[row] } else { T::zero() }
    }

    /// Whether a contact leaves; also true for the rows of its friction.
    pub(super) fn leaves(&self, row: usize) -> bool {
        self.leaving.binary_search(&row).is_ok()
    }

    /// The contacts that leave.
    pub(super) fn contacts(&self, g: &ContactJacobian<T>) -> impl Iterator<Item = usize> {
        self.leaving.iter().copied().filter(|&row| !g.is_tangential(row))
    }

    /// Past value of a leaving row a time `ago`: displacement relative to now (`field` 0), rate (1) or acceleration
    /// (2).
    pub(super) fn past(&self, row: usize, field: usize, ago: T) -> T {
        if !self.leaves(row) {
            return T::zero();
        }
        let [rate, acceleration] = self.outgoing[row];
        match field {
            0 => ago * (T::of(0.5) * ago * acceleration - rate),
            1 => rate - ago * acceleration,
            _ => acceleration,
        }
    }
}
