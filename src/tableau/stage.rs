//! A stage of a step: its rows, where they hold, and where contact is imposed.

use super::{Row, Rows};

/// The level and time at which a stage imposes contact.
///
/// `lead` is the fraction of the step by which the contact condition is ahead of the stage's state, extrapolated with
/// the acceleration of that state: u + lead h v + ½ lead² h² a, and v + lead h a. Explicit schemes need it, because
/// their unknown multiplier moves the body only later.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ContactLevel {
    /// 0 ≤ g ⊥ λ ≥ 0 on displacements.
    Position {
        /// Lead over the stage's state.
        lead: f64,
    },
    /// 0 ≤ ġ ⊥ λ ≥ 0 on velocities, for contacts whose gap is forecast to be closed.
    Velocity {
        /// Lead over the stage's state.
        lead: f64,
        /// Displacements at which the forecast evaluates the gap; a row without the unknown.
        forecast: Row,
        /// Time of the forecast, as a fraction of the step.
        forecast_at: f64,
    },
}

impl ContactLevel {
    /// Positions of the stage's own state.
    pub const POSITION: Self = Self::Position { lead: 0.0 };

    /// Lead over the stage's state, as a fraction of the step.
    pub fn lead(&self) -> f64 {
        match *self {
            Self::Position { lead } | Self::Velocity { lead, .. } => lead,
        }
    }
}

/// The force of a nonlinear system in the balance of a stage. For linear systems both are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum StageForce {
    /// f(t̄, ū, v̄).
    #[default]
    AtBalance,
    /// The force whose internal work from the last state to the state of the stage equals the change of the
    /// potential; ū must be the mean of both.
    AlongPath,
}

/// One stage of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Stage {
    /// Rows of the new state.
    pub recovery: Rows,
    /// Rows at which the balance of momentum holds.
    pub balance: Rows,
    /// Time of external load and multiplier, as a fraction of the step.
    pub load: f64,
    /// Time of the stage's state and its gap, as a fraction of the step.
    pub end: f64,
    /// Level and time at which contact is imposed.
    pub contact: ContactLevel,
    /// The force in the balance.
    pub force: StageForce,
}

impl Stage {
    /// A stage whose balance holds at the new state, at the end of the step, with contact imposed on its displacements.
    pub fn new(recovery: Rows) -> Self {
        let (contact, force) = (ContactLevel::POSITION, StageForce::AtBalance);
        Self { recovery, balance: recovery, load: 1.0, end: 1.0, contact, force }
    }

    /// The same stage with its own balance rows, holding at `t_n + load h`.
    #[must_use]
    pub fn balanced(self, balance: Rows, load: f64) -> Self {
        Self { balance, load, ..self }
    }

    /// The same stage with its state (and load) at `t_n + end h`.
    #[must_use]
    pub fn ending_at(self, end: f64) -> Self {
        Self { end, load: end, ..self }
    }

    /// The same stage with contact imposed at another level or time.
    #[must_use]
    pub fn with_contact(self, contact: ContactLevel) -> Self {
        Self { contact, ..self }
    }

    /// The same stage with the path force instead of the force at the balance.
    #[must_use]
    pub fn along_path(self) -> Self {
        Self { force: StageForce::AlongPath, ..self }
    }

    /// The quantity that contact constrains, as a row: displacements, or h v at velocity level.
    pub fn contact_row(&self) -> Row {
        let Rows { u, v, a } = self.recovery;
        match self.contact {
            ContactLevel::Position { lead } => u + lead * v + (0.5 * lead * lead) * a,
            ContactLevel::Velocity { lead, .. } => v + lead * a,
        }
    }

    /// Time at which contact is imposed, as a fraction of the step.
    pub fn contact_at(&self) -> f64 {
        self.end + self.contact.lead()
    }

    /// All rows that the stage reads: recovery, balance and forecast.
    pub(super) fn rows(&self) -> Vec<Row> {
        let forecast = match self.contact {
            ContactLevel::Position { .. } => None,
            ContactLevel::Velocity { forecast, .. } => Some(forecast),
        };
        self.recovery.each().into_iter().chain(self.balance.each()).chain(forecast).collect()
    }

    /// Whether the balance holds at the recovered state itself.
    pub fn is_collocated(&self) -> bool {
        self.balance == self.recovery
    }

    /// Change of (U, V, A) of the stage by a unit multiplier on a unit mass, in units of h². The balance contains w_ā
    /// times the unknown, so a multiplier moves each row by its weight divided by w_ā.
    pub(crate) fn response(&self) -> [f64; 3] {
        self.recovery.each().map(|row| row.z / self.balance.a.z)
    }

    /// Rows over the increment d = z − ẑ instead of z, with ẑ the value for which the acceleration row vanishes.
    ///
    /// Recovering a by subtracting displacements has an error of eps u/h²; this form has no cancelling terms.
    #[must_use]
    pub fn increment(&self) -> Self {
        let zero = self.recovery.a;
        Self { recovery: self.recovery.increment(zero), balance: self.balance.increment(zero), ..*self }
    }
}
