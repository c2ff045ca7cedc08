//! Memory of the corrections, reserved when a simulation is built.

use super::correction::Rebounds;
use super::group_problem::GroupProblem;
use super::rubbing_problem::Rubbing;
use super::switching::Switching;
use crate::contact::GapRates;
use crate::contact_solver::{AdmissibleSet, FORESEEN};
use crate::real::Real;
use crate::state::ContactState;

/// Buffers of the corrections, one entry per closed row unless noted; reserved at build.
#[derive(Debug)]
pub(crate) struct Buffers<T> {
    /// Closed rows.
    pub(crate) closed: Vec<usize>,
    /// Engaged rows, a subset of `closed`.
    pub(super) engaged: Vec<usize>,
    /// Rows that have opened in this stage.
    pub(crate) opened: Vec<usize>,
    /// Rows that were closed in this step or at its start and are open now.
    pub(crate) released: Vec<usize>,
    /// Reported forces and λ_a before this stage, one entry per candidate.
    pub(crate) reported: Vec<T>,
    pub(super) struck: Vec<T>,
    /// The contact problem of the jumps of one kind: admissible sets of the multipliers, jumps, and their rounding
    /// errors.
    pub(super) sets: Vec<AdmissibleSet>,
    pub(super) jump: Vec<T>,
    pub(super) tolerance: Vec<T>,
    /// Jumps of the past measured with the current rows, and the multipliers that remove them.
    pub(super) straight: Vec<T>,
    pub(super) by_straight: Vec<T>,
    /// Impulses that remove the velocity jumps, one per closed row.
    pub(super) impulses: Vec<T>,
    /// Forces that remove the acceleration jumps, one per engaged row.
    pub(super) forces: Vec<T>,
    /// Memory for the problem of one group of rows.
    pub(super) group: Box<GroupProblem<T>>,
    /// S = G M⁻¹ Gᵀ of some rows.
    pub(super) s: Vec<T>,
    /// The problem with contacts that have friction.
    pub(super) rubbing: Box<Rubbing<T>>,
    /// Contacts that rebound with a share of their approach rate.
    pub(super) rebounds: Box<Rebounds<T>>,
    /// Slip rates, one per tangential row.
    pub(super) slips: Vec<GapRates<T>>,
    pub(super) past_slips: Vec<GapRates<T>>,
    /// Gap rates and gaps from the constraints, one per candidate.
    pub(super) rates: Vec<GapRates<T>>,
    pub(super) gaps: Vec<T>,
    /// Change of v by a correction, the resulting change of the damping force, and the force before it for nonlinear
    /// damping; one entry per dof, empty without damping.
    pub(super) change: Vec<T>,
    pub(super) damping: Vec<T>,
    pub(super) before: Vec<T>,
    /// Whether damping acts on dofs without mass.
    pub(crate) damps_massless: bool,
    /// Contacts on dofs without mass that close or open.
    pub(crate) switching: Box<Switching<T>>,
    /// Contacts that receive energy together.
    pub(super) given: Box<Given<T>>,
}

/// Rows that receive energy together, and the impulses that provide it.
#[derive(Debug, Default)]
pub(super) struct Given<T> {
    pub(super) rows: Vec<usize>,
    pub(super) energies: Vec<T>,
    pub(super) impulses: Vec<T>,
    /// Positions of the rows of one group that S couples.
    pub(super) group: Vec<usize>,
}

impl<T: Real> Given<T> {
    fn make_room(&mut self, rows: usize) {
        for list in [&mut self.rows, &mut self.group] {
            list.reserve(rows.saturating_sub(list.len()));
        }
        for values in [&mut self.energies, &mut self.impulses] {
            values.reserve(rows.saturating_sub(values.len()));
        }
    }

    /// Removes all rows.
    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.energies.clear();
        self.impulses.clear();
    }
}

impl<T: Real> Buffers<T> {
    /// Reserves memory for `rows` contacts, for velocity changes of `damped` dofs (0 without damping), and, if
    /// contacts without mass are corrected, for velocity changes of `switching` dofs.
    pub(crate) fn new(rows: usize, damped: usize, switching: Option<usize>) -> Self {
        let reals = |n| Vec::with_capacity(n);
        let mut given = Given { rows: Vec::new(), energies: Vec::new(), impulses: Vec::new(), group: Vec::new() };
        given.make_room(rows);
        Self {
            closed: Vec::with_capacity(rows),
            engaged: Vec::with_capacity(rows),
            opened: Vec::with_capacity(rows),
            released: Vec::with_capacity(rows),
            reported: reals(rows),
            struck: reals(rows),
            sets: Vec::with_capacity(rows),
            jump: reals(rows),
            tolerance: reals(rows),
            straight: reals(rows),
            by_straight: reals(rows),
            impulses: reals(rows),
            forces: reals(rows),
            group: Box::new(GroupProblem::new(rows)),
            s: reals(rows.min(FORESEEN) * rows.min(FORESEEN)),
            rubbing: Box::default(),
            rebounds: Box::default(),
            slips: Vec::new(),
            past_slips: Vec::new(),
            rates: vec![GapRates::default(); rows],
            gaps: vec![T::zero(); rows],
            change: vec![T::zero(); damped],
            damping: vec![T::zero(); damped],
            before: vec![T::zero(); damped],
            damps_massless: false,
            switching: Box::new(Switching::new(rows, switching)),
            given: Box::new(given),
        }
    }

    /// Reserves memory for this many contacts.
    pub(crate) fn make_room(&mut self, rows: usize) {
        self.rates.resize(rows, GapRates::default());
        self.gaps.resize(rows, T::zero());
        self.switching.make_room(rows);
        self.given.make_room(rows);
        let Self {
            closed,
            engaged,
            opened,
            released,
            reported,
            struck,
            sets,
            jump,
            tolerance,
            straight,
            by_straight,
            impulses,
            forces,
            ..
        } = self;
        for list in [closed, engaged, opened, released] {
            list.reserve(rows.saturating_sub(list.len()));
        }
        for values in [reported, struck, jump, tolerance, straight, by_straight, impulses, forces] {
            values.reserve(rows.saturating_sub(values.len()));
        }
        sets.reserve(rows.saturating_sub(sets.len()));
    }

    /// Stores the contacts before a stage; `first` marks the first stage of a step.
    pub(crate) fn begin(&mut self, contacts: &ContactState<T>, first: bool) {
        self.report(contacts, first);
        self.switching.begin(contacts, first);
    }

    /// Stores the reported forces before a stage; contacts that open within a step keep their last force.
    fn report(&mut self, contacts: &ContactState<T>, first: bool) {
        if first {
            self.reported.clone_from(&contacts.lambda);
            self.struck.clone_from(&contacts.lambda_a);
        }
        for (row, _) in contacts.closed.iter().enumerate().filter(|(_, closed)| **closed) {
            (self.reported[row], self.struck[row]) = (contacts.lambda[row], contacts.lambda_a[row]);
        }
    }

    /// Whether the last stage had contacts to correct.
    pub(crate) fn has_touched(&self) -> bool {
        self.has_jumps() || self.switching.is_pending()
    }

    /// Whether there are, or were, contacts that leave jumps.
    pub(super) fn has_jumps(&self) -> bool {
        !self.closed.is_empty() || !self.opened.is_empty() || !self.released.is_empty()
    }

    /// Whether damping carries velocity corrections to the accelerations of all dofs.
    pub(crate) fn spreads(&self) -> bool {
        !self.change.is_empty()
    }
}
