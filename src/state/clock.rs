//! Time, and where a step size that changes stands in the grid of its nominal one.

#[cfg(feature = "serde")]
use super::read::{COUNT, count, number};
use crate::error::{Error, Result};

/// Time as origin + elapsed + k h, so that it does not drift. What has elapsed is a sum of spacings, which the origin
/// does not round: runs are the same whenever they start.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Clock {
    /// Time at the start of the run.
    origin: f64,
    /// From there to the last change of the step size.
    elapsed: f64,
    /// Steps since then, and their size.
    pub(crate) steps: u64,
    pub(crate) h: f64,
}

impl Clock {
    pub(crate) fn new(origin: f64, h: f64) -> Self {
        Self { origin, elapsed: 0.0, steps: 0, h }
    }

    /// Time at `fraction` of the step that comes next.
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

    /// From now until t.
    pub(crate) fn until(&self, t: f64) -> f64 {
        (t - self.origin) - self.elapsed_at(0.0)
    }

    /// Whether t is reached, but for 1e-9 h and the rounding of t.
    pub(crate) fn has_reached(&self, t: f64) -> bool {
        t - self.at(0.0) <= 1e-9 * self.h + resolution(t).min(0.5 * self.h)
    }

    /// Refuses a step size that does not change the time: host functions of time would stand still while the motion
    /// goes on.
    pub(crate) fn check(&self) -> Result<()> {
        let (t, h) = (self.at(0.0), self.h);
        match h >= resolution(t) {
            true => Ok(()),
            false => Err(Error::TimeNotAdvancing { t, h, resolution: resolution(t) }),
        }
    }
}

/// Of a checkpoint that was read.
#[cfg(feature = "serde")]
impl Clock {
    /// Refuses what no run leaves.
    pub(super) fn check_read(&self) -> Result<()> {
        let Self { origin, elapsed, steps, h } = *self;
        number("the start time of a checkpoint", origin, "finite", f64::is_finite)?;
        number("the time elapsed of a checkpoint", elapsed, "finite, not negative", |x| x >= 0.0 && x.is_finite())?;
        number("the step size of a checkpoint", h, "positive and finite", |h| h > 0.0 && h.is_finite())?;
        count("the number of steps of a checkpoint", steps, 0..=COUNT)?;
        number("the time of a checkpoint", self.at(0.0), "finite", f64::is_finite)
    }
}

/// The distance between times near t that an `f64` can tell apart.
pub(crate) fn resolution(t: f64) -> f64 {
    t.abs().next_up() - t.abs()
}

/// Where the present step size stands in the nominal grid, for runs that control it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Pace {
    /// The step size given, of which all others are halves, quarters and so on.
    pub(crate) nominal: f64,
    /// How often the nominal step is halved now.
    level: u32,
    /// Steps of the present size since the size last was the nominal one.
    position: u64,
    /// Steps taken since the size last changed, and whether it grew then.
    steps: u32,
    grown: bool,
    /// Steps that growth asks for.
    patience: u32,
    /// Halvings that growth keeps: a larger step was beyond the limit of stability of the system, and of contacts that
    /// pressed (until none does).
    kept: [u32; 2],
    /// Time over which the error of a velocity lasts: about the time between changes of contact. It grows in each step,
    /// and halves in a step in which a contact closes, opens, begins or ends to slide, or its slip reverses.
    pub(crate) lasting: f64,
}

/// Why a step was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// For something that passes.
    Passing,
    /// The system is too stiff for it.
    StiffSystem,
    /// A contact is.
    StiffContact,
}

/// Good steps before a step size grows, at first and at most.
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

    /// Of a checkpoint that was read: refuses what no run with a present step size of h leaves.
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
        let is_time = |time: f64| time >= 0.0 && time.is_finite();
        number("the time between changes of contact of a checkpoint", lasting, "finite, not negative", is_time)?;
        count("the patience of a checkpoint", patience.into(), PATIENCE[0].into()..=PATIENCE[1].into())
    }

    /// After a refusal: half the size. One that follows growth at once makes the next growth wait longer; one for a
    /// stiffness keeps it from the size that was refused. (Between two such refusals a step that is too long adds
    /// energy: growing back to it over and over would do so without end.)
    pub(crate) fn halve(&mut self, refusal: Refusal) {
        if self.grown && self.steps == 0 {
            self.patience = (2 * self.patience).min(PATIENCE[1]);
        }
        (self.level, self.position) = (self.level + 1, self.position.saturating_mul(2));
        (self.steps, self.grown) = (0, false);
        match refusal {
            Refusal::Passing => {}
            Refusal::StiffSystem => self.kept[0] = self.level,
            Refusal::StiffContact => self.kept[1] = self.level,
        }
    }

    /// After a good step: says whether the size may grow here. `presses` is asked whether a contact presses that may be
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

    /// After a good step of size h: updates the time over which the error of a velocity lasts. Half of it remains after
    /// a change of contacts, because a slip that reverses may stick for a step before the second change. With changes
    /// in every step it falls to h.
    pub(crate) fn note_change(&mut self, changed: bool, h: f64) {
        self.lasting = (self.lasting + h) * if changed { 0.5 } else { 1.0 };
    }

    /// Growth: twice the size.
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
        pace.halve(Refusal::Passing);
        let mut waits = Vec::new();
        for _ in 0..8 {
            waits.push(wait(&mut pace));
            pace.double();
            pace.halve(Refusal::Passing);
        }
        assert_eq!(waits, [2, 4, 8, 16, 32, 64, 64, 64]);
        // One good step after growth, and it begins anew.
        wait(&mut pace);
        pace.double();
        pace.advance(|| false);
        pace.halve(Refusal::Passing);
        assert_eq!(wait(&mut pace), 2);
    }
}
