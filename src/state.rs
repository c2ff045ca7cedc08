//! The state of a run: its motion, as stored for later steps and at the time of the state, and its contacts.

mod backup;
#[cfg(feature = "serde")]
mod checkpoint;
mod clock;
mod contacts;
mod history;
mod overclosures;
#[cfg(feature = "serde")]
mod parts;
#[cfg(feature = "serde")]
mod read;
#[cfg(feature = "serde")]
mod record;
mod tape;

pub(crate) use backup::Backup;
#[cfg(feature = "serde")]
pub use checkpoint::Checkpoint;
pub(crate) use clock::{Clock, Pace, Refusal};
pub use contacts::{ContactState, ContactStatus};
pub(crate) use contacts::{Names, slides};
pub(crate) use history::ComputedMotions;
pub use history::History;
pub(crate) use overclosures::Overclosures;
pub(crate) use tape::{
    Change, Changes, Checkpoints, Compliance, Guide, Held, NoDerivative, Rule, StageRecord, StartingPast, StepRecord,
    Tape,
};

use crate::contact::BrokenBond;
use crate::real::Real;

/// Stored values of one state: displacement, velocity and acceleration at its time.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: Real"))]
pub(crate) struct Motion<T> {
    pub(crate) t: f64,
    pub(crate) u: Vec<T>,
    pub(crate) v: Vec<T>,
    pub(crate) a: Vec<T>,
}

impl<T: Real> Motion<T> {
    pub(crate) fn zero(dofs: usize) -> Self {
        let zero = || vec![T::zero(); dofs];
        Self { t: 0.0, u: zero(), v: zero(), a: zero() }
    }

    /// Time, and u, v, a at that time, for evaluating gaps and their rates.
    pub(crate) fn place(&self) -> (f64, [&[T]; 3]) {
        (self.t, [&self.u, &self.v, &self.a])
    }

    /// Copies without allocating.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.t = other.t;
        self.u.copy_from_slice(&other.u);
        self.v.copy_from_slice(&other.v);
        self.a.copy_from_slice(&other.a);
    }

    /// Mutable field 0, 1, 2: u, v, a.
    pub(crate) fn field_mut(&mut self, field: usize) -> &mut Vec<T> {
        match field {
            0 => &mut self.u,
            1 => &mut self.v,
            _ => &mut self.a,
        }
    }

    /// Field 1 or 2 (v or a) at the time of the state: `rates`, or the stored values if they are empty.
    pub(crate) fn rate<'v>(&'v self, rates: &'v [Vec<T>; 2], field: usize) -> &'v [T] {
        match rates[field - 1].is_empty() {
            true => self.field(field),
            false => &rates[field - 1],
        }
    }

    /// u, v and a at the time of the state.
    pub(crate) fn at_state<'v>(&'v self, rates: &'v [Vec<T>; 2]) -> [&'v [T]; 3] {
        [&self.u, self.rate(rates, 1), self.rate(rates, 2)]
    }

    /// Field 0, 1, 2: u, v, a.
    pub(crate) fn field(&self, field: usize) -> &[T] {
        match field {
            0 => &self.u,
            1 => &self.v,
            _ => &self.a,
        }
    }
}

/// The state of a simulation at a time: motion and contacts.
///
/// State and [`History`] together are all that later steps read: a run continued from clones of both is bitwise the
/// same.
#[derive(Clone, Debug, PartialEq)]
pub struct State<T> {
    /// Values as the scheme stores them.
    pub(crate) motion: Motion<T>,
    /// Velocity and acceleration at the time of the state; empty if the stored ones have that time.
    pub(crate) rates: [Vec<T>; 2],
    pub(crate) contacts: ContactState<T>,
    /// Broken bonds in the order in which they broke.
    pub(crate) broken: Vec<BrokenBond>,
}

impl<T: Real> State<T> {
    /// Time.
    pub fn time(&self) -> f64 {
        self.motion.t
    }

    /// Displacements, one per dof.
    pub fn displacement(&self) -> &[T] {
        &self.motion.u
    }

    /// Velocities at the time of the state, one per dof.
    pub fn velocity(&self) -> &[T] {
        self.motion.rate(&self.rates, 1)
    }

    /// Accelerations at the time of the state, one per dof.
    ///
    /// Some schemes store v or a at another time, given by [`Order`](crate::analysis::Order). The values here are
    /// extrapolated from two states, or are the stored ones if a contact closed or opened between the two by more
    /// than rounding.
    pub fn acceleration(&self) -> &[T] {
        self.motion.rate(&self.rates, 2)
    }

    /// Velocities as the scheme stores them, at the time defined by its rows.
    pub fn stored_velocity(&self) -> &[T] {
        &self.motion.v
    }

    /// Accelerations as the scheme stores them, at the time defined by its rows; they satisfy its balance.
    pub fn stored_acceleration(&self) -> &[T] {
        &self.motion.a
    }

    /// Whether the scheme stores v or a at another time than the time of the state.
    #[cfg(feature = "serde")]
    fn is_shifted(&self) -> bool {
        self.rates.iter().any(|rate| !rate.is_empty())
    }

    /// Contacts, one entry per candidate.
    pub fn contacts(&self) -> &ContactState<T> {
        &self.contacts
    }

    /// The bonds that have broken since the start, in order.
    pub fn broken_bonds(&self) -> &[BrokenBond] {
        &self.broken
    }

    /// The bonds broken in the last step.
    pub fn newly_broken_bonds(&self) -> &[BrokenBond] {
        self.broken_at(self.time())
    }

    /// The bonds broken in the last step, which ended at t.
    pub(crate) fn broken_at(&self, t: f64) -> &[BrokenBond] {
        let count = self.broken.iter().rev().take_while(|bond| bond.time.to_bits() == t.to_bits()).count();
        &self.broken[self.broken.len() - count..]
    }
}
