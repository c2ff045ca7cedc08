//! A factor that goes smoothly from one value to another.

use crate::error::{Error, Result};

/// A factor by time: one value until the first time, another from the second on, smooth in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ramp {
    pub(crate) times: [f64; 2],
    pub(crate) factors: [f64; 2],
}

impl Default for Ramp {
    /// One at all times.
    fn default() -> Self {
        Self { times: [0.0, 1.0], factors: [1.0; 2] }
    }
}

impl Ramp {
    /// Rejects values that are not finite, and an end that is not after the beginning.
    pub(crate) fn check(&self) -> Result<()> {
        let Self { times, factors } = self;
        let refuse = |name, value, range| Err(Error::Parameter { name, value, range });
        if let Some(&time) = times.iter().find(|time| !time.is_finite()) {
            return refuse("a time of a ramp", time, "finite");
        }
        if let Some(&factor) = factors.iter().find(|factor| !factor.is_finite()) {
            return refuse("a factor of a ramp", factor, "finite");
        }
        if times[1] <= times[0] {
            return refuse("the end of a ramp less its beginning", times[1] - times[0], "positive");
        }
        Ok(())
    }

    /// The elapsed share of the ramp at t, from 0 to 1.
    fn place(&self, t: f64) -> f64 {
        ((t - self.times[0]) / (self.times[1] - self.times[0])).clamp(0.0, 1.0)
    }

    /// The second time derivative of the factor.
    pub(crate) fn acceleration(&self, t: f64) -> f64 {
        let ([from, to], s) = (self.factors, self.place(t));
        60.0 * (to - from) / (self.times[1] - self.times[0]).powi(2) * s * (1.0 - s) * (1.0 - 2.0 * s)
    }

    /// The time derivative of the factor.
    pub(crate) fn rate(&self, t: f64) -> f64 {
        let ([from, to], s) = (self.factors, self.place(t));
        30.0 * (to - from) / (self.times[1] - self.times[0]) * (s * (1.0 - s)).powi(2)
    }

    pub(crate) fn at(&self, t: f64) -> f64 {
        let ([from, to], s) = (self.factors, self.place(t));
        // Its first two derivatives are zero at both ends.
        from + (to - from) * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    }
}
