//! Memory of the corrections.

use super::jump_problem::JumpProblem;
use super::rebounds::Rebounds;
use super::switching::Switching;
use crate::contact::GapRates;
use crate::real::Real;
use crate::state::{Changes, ContactState};

/// Memory of the corrections of a stage.
#[derive(Debug)]
pub(crate) struct Buffers<T> {
    pub(crate) rows: StageRows<T>,
    /// The problem of the jumps of one kind.
    pub(super) problem: Box<JumpProblem<T>>,
    /// Impulses that remove the velocity jumps, and forces that remove the acceleration jumps.
    pub(super) impulses: Removal<T>,
    pub(super) forces: Removal<T>,
    /// S = G M⁻¹ Gᵀ of some rows, or one value per row.
    pub(super) scratch: Vec<T>,
    /// Contacts that rebound with a share of their approach rate.
    pub(super) rebounds: Box<Rebounds<T>>,
    pub(super) readings: Readings<T>,
    pub(crate) damping: Damping<T>,
    /// Displacements moved by a prediction, one entry per dof; empty if no corrector predicts.
    pub(crate) shifted: Vec<T>,
    /// Contacts on dofs without mass that close or open.
    pub(crate) switching: Box<Switching<T>>,
    /// Contacts that receive energy together.
    pub(super) given: Given<T>,
    /// The changes made, if the run is recorded.
    pub(crate) changes: Option<Box<Changes<T>>>,
}

/// Rows that corrections act on, and their forces before.
#[derive(Debug, Default)]
pub(crate) struct StageRows<T> {
    /// Closed rows.
    pub(crate) closed: Vec<usize>,
    /// Engaged rows, a subset of `closed`.
    pub(super) engaged: Vec<usize>,
    /// Rows that have opened in this stage.
    pub(crate) opened: Vec<usize>,
    /// Rows that were closed in this step or at its start and are open now.
    pub(crate) released: Vec<usize>,
    /// Reported forces and λ_a before this stage, one entry per candidate.
    pub(super) reported: Vec<T>,
    pub(super) impacts: Vec<T>,
}

/// Multipliers that remove jumps.
#[derive(Debug, Default)]
pub(super) struct Removal<T> {
    /// The rows of the contacts, tangential rows included, and their multipliers.
    pub(super) rows: Vec<usize>,
    pub(super) multipliers: Vec<T>,
    /// The multipliers without those of tangential rows, one per contact.
    pub(super) normal: Vec<T>,
}

/// Values that the constraints evaluate.
#[derive(Debug, Default)]
pub(super) struct Readings<T> {
    /// Gap rates and gaps, one per candidate.
    pub(super) rates: Vec<GapRates<T>>,
    pub(super) gaps: Vec<T>,
    /// Slip rates of the stage and of a past state, one per tangential row.
    pub(super) slips: Vec<GapRates<T>>,
    pub(super) past_slips: Vec<GapRates<T>>,
}

/// The effect of damping on corrections of v; vectors have one entry per dof and are empty without damping.
#[derive(Debug)]
pub(crate) struct Damping<T> {
    /// Whether damping acts on dofs without mass.
    pub(crate) on_massless: bool,
    /// Change of v by a correction, the resulting change of the damping force, and the force before it for nonlinear
    /// damping.
    pub(super) change: Vec<T>,
    pub(super) force: Vec<T>,
    pub(super) before: Vec<T>,
    /// Forces to be limited, and the accelerations of their rows by them, one entry per row.
    pub(super) limited: Vec<T>,
    pub(super) moved: Vec<T>,
}

/// Rows that receive energy together, and the impulses that provide it.
#[derive(Debug, Default)]
pub(super) struct Given<T> {
    pub(super) rows: Vec<usize>,
    pub(super) energies: Vec<T>,
    pub(super) impulses: Vec<T>,
    /// Rows and impulses of one group that S couples.
    pub(super) group: Vec<usize>,
    pub(super) shares: Vec<T>,
}

impl<T: Real> Given<T> {
    /// Removes all rows.
    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.energies.clear();
        self.impulses.clear();
    }
}

impl<T: Real> Buffers<T> {
    /// Memory for `rows` rows, for velocity changes of `damped` dofs (0 without damping), for predictions of
    /// `predicted` dofs (0 without), and, if contacts without mass are corrected, for velocity changes of `switching`
    /// dofs.
    pub(crate) fn new(rows: usize, [damped, predicted]: [usize; 2], switching: Option<usize>) -> Self {
        let vector = || vec![T::zero(); damped];
        let mut buffers = Self {
            rows: StageRows::default(),
            problem: Box::default(),
            impulses: Removal::default(),
            forces: Removal::default(),
            scratch: Vec::new(),
            rebounds: Box::default(),
            readings: Readings::default(),
            damping: Damping {
                on_massless: false,
                change: vector(),
                force: vector(),
                before: vector(),
                limited: Vec::new(),
                moved: Vec::new(),
            },
            shifted: vec![T::zero(); predicted],
            switching: Box::new(Switching::new(switching)),
            given: Given::default(),
            changes: None,
        };
        buffers.resize(rows);
        buffers
    }

    /// Lists with an entry for each of so many rows.
    pub(crate) fn resize(&mut self, rows: usize) {
        self.readings.rates.resize(rows, GapRates::default());
        self.readings.gaps.resize(rows, T::zero());
    }

    /// Stores the contacts before a stage; `first` marks the first stage of a step.
    pub(crate) fn begin(&mut self, contacts: &ContactState<T>, first: bool) {
        self.rows.report(contacts, first);
        self.switching.begin(contacts, first);
    }

    /// Whether the last stage had contacts to correct.
    pub(crate) fn has_touched(&self) -> bool {
        self.has_jumps() || self.switching.is_pending()
    }

    /// Whether there are, or were, contacts that leave jumps.
    pub(super) fn has_jumps(&self) -> bool {
        let StageRows { closed, opened, released, .. } = &self.rows;
        !(closed.is_empty() && opened.is_empty() && released.is_empty())
    }

    /// Whether damping carries velocity corrections to the accelerations of all dofs.
    pub(crate) fn spreads(&self) -> bool {
        !self.damping.change.is_empty()
    }
}

impl<T: Real> StageRows<T> {
    /// Stores the reported forces before a stage; contacts that open within a step keep their last force.
    fn report(&mut self, contacts: &ContactState<T>, first: bool) {
        if first {
            self.reported.clone_from(&contacts.lambda);
            self.impacts.clone_from(&contacts.lambda_a);
        }
        for (row, _) in contacts.closed.iter().enumerate().filter(|(_, closed)| **closed) {
            (self.reported[row], self.impacts[row]) = (contacts.lambda[row], contacts.lambda_a[row]);
        }
    }
}
