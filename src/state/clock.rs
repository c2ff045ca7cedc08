//! Time, and the position of a changing step size in the grid of the nominal one.

#[cfg(feature = "serde")]
use super::read::{COUNT, count, finite, not_negative, number, positive};
use crate::error::{Error, Result};
use crate::rounding::{TIME_SHARE, time_resolution};

/// Time as origin + elapsed + k h, so that it does not drift. The elapsed time is a sum of step sizes that is not
/// rounded by the origin: runs are the same for any start time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Clock {
    /// Time at the start of the run.
    origin: f64,
    /// Time from the start to the last change of the step size.
    elapsed: f64,
    /// Steps since that change, and their size.
    pub(crate) steps: u64,
    pub(crate) h: f64,
}

impl Clock {
    pub(crate) fn new(origin: f64, h: f64) -> Self {
        Self { origin, elapsed: 0.0, steps: 0, h }
    }

    /// Time at `fraction` of the next step.
    pub(crate) fn at(&self, fraction: f64) -> f64 {
        self.origin + self.elapsed_at(fraction)
    }

    fn elapsed_at(&self, fraction: f64) -> f64 {
        self.elapsed + (self.steps as f64 + fraction) * self.h
    }

    /// The clock with another step size from here on.
    pub(crate) fn with_step_size(&self, h: f64) -> Self {
        Self { elapsed: self.elapsed_at(0.0), steps: 0, h, ..*self }
    }

    /// Whether no time has passed since the start.
    pub(crate) fn is_at_start(&self) -> bool {
        self.elapsed_at(0.0) == 0.0
    }

    /// Duration from now until t.
    pub(crate) fn until(&self, t: f64) -> f64 {
        (t - self.origin) - self.elapsed_at(0.0)
    }

    /// Whether t is reached, within 1e-9 h and the rounding of t.
    pub(crate) fn has_reached(&self, t: f64) -> bool {
        t - self.at(0.0) <= TIME_SHARE * self.h + time_resolution(t).min(0.5 * self.h)
    }

    /// Rejects a step size that does not change the time: host functions of time would not advance with the motion.
    pub(crate) fn check(&self) -> Result<()> {
        let (t, h) = (self.at(0.0), self.h);
        match h >= time_resolution(t) {
            true => Ok(()),
            false => Err(Error::TimeNotAdvancing { t, h, resolution: time_resolution(t) }),
        }
    }
}

/// Checks of a clock read from a checkpoint.
#[cfg(feature = "serde")]
impl Clock {
    /// Rejects values that no run produces.
    pub(super) fn check_read(&self) -> Result<()> {
        let Self { origin, elapsed, steps, h } = *self;
        finite("the start time of a checkpoint", origin)?;
        not_negative("the time elapsed of a checkpoint", elapsed)?;
        positive("the step size of a checkpoint", h)?;
        count("the number of steps of a checkpoint", steps, 0..=COUNT)?;
        finite("the time of a checkpoint", self.at(0.0))
    }
}

/// Position of the present step size in the nominal grid, for runs that control it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Pace {
    /// The given step size; all others are this size halved repeatedly.
    pub(crate) nominal: f64,
    /// Present number of halvings.
    level: u32,
    /// Steps of the present size since the size was last the nominal one.
    position: u64,
    /// Steps taken since the size last changed, and whether that change was growth.
    steps: u32,
    grown: bool,
    /// Steps required before growth.
    patience: u32,
    /// Least number of halvings, because a larger step was beyond the stability limit of the system, or of pressed
    /// contacts (until none presses).
    kept: [u32; 2],
    /// Time for which a velocity error persists: about the time between changes of contact. It grows in each step and
    /// halves in a step in which a contact closes, opens, starts or stops sliding, or reverses its slip.
    pub(crate) lasting: f64,
}

/// Why a step was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// A cause that later steps may not have.
    Temporary,
    /// The system is too stiff for the step size.
    StiffSystem,
    /// A contact is too stiff for the step size.
    StiffContact,
}

/// Good steps before the step size grows: initial and largest number.
const PATIENCE: [u32; 2] = [2, 64];

impl Pace {
    pub(crate) fn new(nominal: f64) -> Self {
        Self {
            nominal,
            level: 0,
            position: 0,
            steps: 0,
            grown: false,
            patience: PATIENCE[0],
            kept: [0; 2],
            lasting: 0.0,
        }
    }

    /// Checks values read from a checkpoint with step size h: rejects values that no run produces.
    #[cfg(feature = "serde")]
    pub(super) fn check_read(&self, h: f64) -> Result<()> {
        let Self { nominal, level, position, steps: _, grown: _, patience, kept, lasting } = *self;
        let halved = |nominal: f64| (0..level).fold(nominal, |h, _| 0.5 * h);
        let levels = u64::from(f64::MANTISSA_DIGITS) + u64::from(f64::MAX_EXP.unsigned_abs());
        count("the halvings of a checkpoint", level.into(), 0..=levels)?;
        let range = "that of the step, times a power of two";
        number("the nominal step size of a checkpoint", nominal, range, |size| halved(size).to_bits() == h.to_bits())?;
        count("the place in the nominal grid of a checkpoint", position, 0..=COUNT)?;
        for kept in kept {
            count("the halvings of a checkpoint that growth keeps", kept.into(), 0..=level.into())?;
        }
        not_negative("the time between changes of contact of a checkpoint", lasting)?;
        count("the patience of a checkpoint", patience.into(), PATIENCE[0].into()..=PATIENCE[1].into())
    }

    /// After a rejection: halves the size. A rejection directly after growth doubles the wait before the next growth;
    /// one for a stiffness prevents growth to the rejected size. Otherwise repeated growth to a step that is too
    /// long, which adds energy before it is rejected, would add energy without bound.
    pub(crate) fn halve(&mut self, refusal: Refusal) {
        if self.grown && self.steps == 0 {
            self.patience = (2 * self.patience).min(PATIENCE[1]);
        }
        (self.level, self.position) = (self.level + 1, self.position.saturating_mul(2));
        (self.steps, self.grown) = (0, false);
        match refusal {
            Refusal::Temporary => {}
            Refusal::StiffSystem => self.kept[0] = self.level,
            Refusal::StiffContact => self.kept[1] = self.level,
        }
    }

    /// After a good step: returns whether the size may grow here. `presses` returns whether a pressed contact may be
    /// too stiff for larger steps.
    pub(crate) fn advance(&mut self, presses: impl FnOnce() -> bool) -> bool {
        self.position = if self.level > 0 { self.position + 1 } else { 0 };
        self.steps = self.steps.saturating_add(1);
        if self.grown {
            self.patience = PATIENCE[0];
        }
        if self.kept[1] > 0 && !presses() {
            self.kept[1] = 0;
        }
        let most = self.kept[0].max(self.kept[1]);
        self.level > most && self.position.is_multiple_of(2) && self.steps >= self.patience
    }

    /// After a good step of size h: updates the time for which a velocity error persists. A change of contacts halves
    /// it only, because a reversing slip may stick for a step before the second change. With changes in every step it
    /// tends to h.
    pub(crate) fn note_change(&mut self, changed: bool, h: f64) {
        self.lasting = (self.lasting + h) * if changed { 0.5 } else { 1.0 };
    }

    /// Growth: doubles the size.
    pub(crate) fn double(&mut self) {
        (self.level, self.position) = (self.level - 1, self.position / 2);
        (self.steps, self.grown) = (0, true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Good steps until the size may grow.
    fn wait(pace: &mut Pace) -> usize {
        (1..1000).find(|_| pace.advance(|| false)).unwrap()
    }

    #[test]
    fn growth_that_is_refused_at_once_waits_twice_as_long_each_time() {
        let mut pace = Pace::new(1.0);
        pace.halve(Refusal::Temporary);
        let mut waits = Vec::new();
        for _ in 0..8 {
            waits.push(wait(&mut pace));
            pace.double();
            pace.halve(Refusal::Temporary);
        }
        assert_eq!(waits, [2, 4, 8, 16, 32, 64, 64, 64]);
        // After one good step following growth the wait is reset.
        wait(&mut pace);
        pace.double();
        pace.advance(|| false);
        pace.halve(Refusal::Temporary);
        assert_eq!(wait(&mut pace), 2);
    }
}
