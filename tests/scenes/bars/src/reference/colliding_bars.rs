//! The central impact of two elastic bars, or of a bar and a rigid wall, solved by the method of characteristics.

use super::bar::{Bar, Body, Steps};
use super::error::{MAX_EVENTS, ReferenceError, finite, positive};

/// A share of a time or of the impact speed below which only rounding remains after subtractions.
const ONLY_ROUNDING: f64 = 1e-12;

/// A share of the impact speed below which an invariant has not jumped.
const NO_JUMP: f64 = 64.0 * f64::EPSILON;

/// Which of the two colliding bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The left bar; its contact end is `x = length`.
    Left,
    /// The right bar, with its contact end at `x = 0`, or the wall.
    Right,
}

/// Exact solution of the central impact of two elastic bars, or of a bar and a rigid wall.
///
/// The bars lie on one line, a distance `gap` apart at time zero, undeformed, each with its own uniform velocity.
/// Their far ends are free. Material, cross-section (plane cross-sections stay plane), length and velocity may all
/// differ. Contact transmits compression only and does not stick. See the [module](super) for the theory.
///
/// - `x` is the material coordinate of a bar from its own left end, `0 <= x <= length`.
/// - Displacements, velocities and momentum are positive to the right, stress is positive in tension, the contact
///   force and the gap are never negative.
/// - At a jump, the value is the one just after it. A time that misses a jump by rounding only (relative 1e-12)
///   counts as after it.
/// - A query with a time outside `[0, until]` or an `x` outside the bar returns NaN.
/// - For the wall ([`Side::Right`] after [`against_wall`](Self::against_wall)) `x` is ignored, and displacement,
///   velocities and stress are zero. Energies and momentum include only the bar.
/// - Bars may touch without force, if their ends happen to move together. That counts as contact.
///
/// Queries do not allocate and cost `O(log n)` for `n` jumps, energies at most `O(n)`. The only error is rounding: a
/// few `f64::EPSILON` for every wave transit up to `t`.
#[derive(Clone, Debug)]
pub struct CollidingBars {
    /// Velocity of the frame in which the invariants are stored: the velocity of the contact after the first impact.
    /// It keeps rounding proportional to the impact speed, however fast the pair travels.
    frame: f64,
    until: f64,
    bodies: [Body; 2],
    force: Steps,
    /// Rate of change of the gap; its integral is the gap.
    opening: Steps,
    intervals: Vec<(f64, f64)>,
}

impl CollidingBars {
    /// Solves the impact of two bars whose contact ends are `gap` apart at time zero, up to the time `until`.
    ///
    /// # Errors
    ///
    /// [`ReferenceError::InvalidParameter`] if a property of a bar or `until` is not positive, `gap` is negative, or
    /// anything is not finite. [`ReferenceError::TooManyEvents`] if more than 200 000 wave fronts reach the contact
    /// before `until`: the horizon then holds too many round trips of the shorter transit time.
    pub fn new(left: Bar, right: Bar, gap: f64, until: f64) -> Result<Self, ReferenceError> {
        right.validate()?;
        Self::solve(left, Some(right), gap, until)
    }

    /// Solves the impact of a bar on a rigid wall at rest, `gap` to the right of it at time zero.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn against_wall(bar: Bar, gap: f64, until: f64) -> Result<Self, ReferenceError> {
        Self::solve(bar, None, gap, until)
    }

    fn solve(left: Bar, right: Option<Bar>, gap: f64, until: f64) -> Result<Self, ReferenceError> {
        left.validate()?;
        finite("gap", gap, gap >= 0.0)?;
        positive("until", until)?;
        let right_velocity = right.map_or(0.0, |bar| bar.velocity);
        let impact_speed = finite("relative velocity", left.velocity - right_velocity, true)?;
        let left_compliance = left.impedance().recip();
        let right_compliance = right.map_or(0.0, |bar| bar.impedance().recip());
        let left_share = left_compliance / (left_compliance + right_compliance);
        let right_share = right_compliance / (left_compliance + right_compliance);
        let mut solution = Self {
            frame: right_velocity + impact_speed * right_share,
            until,
            bodies: [Body::new(Some(left), impact_speed * left_share), Body::new(right, -impact_speed * right_share)],
            force: Steps::new(0.0, 0.0),
            opening: Steps::new(-impact_speed, gap),
            intervals: Vec::new(),
        };
        solution.follow_waves(gap, impact_speed.abs())?;
        Ok(solution)
    }

    /// Generates the events at the contact in order: arrivals of wave fronts, closings and openings of the gap.
    fn follow_waves(&mut self, mut gap: f64, scale: f64) -> Result<(), ReferenceError> {
        let compliances = self.bodies.each_ref().map(|body| body.compliance);
        let compliance = compliances[0] + compliances[1];
        let mut now = 0.0;
        let mut fronts = [1; 2]; // the next piece of each outgoing invariant to come back
        let mut touching_since = None;
        for _ in 0..MAX_EVENTS {
            let [from_left, from_right] = [0, 1].map(|i| self.bodies[i].outgoing.0[fronts[i] - 1].value);
            let closing = from_left - from_right;
            let touching = gap <= 0.0 && closing >= -ONLY_ROUNDING * scale;
            // The force that gives the ends one velocity. A remainder of rounding size, of either sign, is no
            // pressure.
            let bond = if touching { closing / compliance } else { 0.0 };
            let pressing = closing > ONLY_ROUNDING * scale;
            let force = if pressing { bond } else { 0.0 };
            let noise = NO_JUMP * scale;
            let [left, right] = &mut self.bodies;
            let left_answer = from_left - 2.0 * bond * compliances[0];
            let right_answer = from_right + 2.0 * bond * compliances[1];
            left.outgoing.jump(now, left_answer, noise);
            right.outgoing.jump(now, right_answer, noise);
            self.force.jump(now, force, noise / compliance);
            let rate = if touching { 0.0 } else { -closing };
            self.opening.push(now, rate, gap);
            if touching {
                touching_since = touching_since.or(Some(now));
            } else if let Some(start) = touching_since.take() {
                self.record_interval(start, now);
            }

            let arrivals = [0, 1].map(|i| {
                let body = &self.bodies[i];
                body.outgoing.start(fronts[i]) + 2.0 * body.transit
            });
            let meeting = if closing > 0.0 && !touching { now + gap / closing } else { f64::INFINITY };
            let next = arrivals[0].min(arrivals[1]).min(meeting);
            if next > self.until + self.slack(self.until) {
                if let Some(start) = touching_since {
                    self.record_interval(start, self.until);
                }
                return Ok(());
            }
            let same = next + self.slack(next);
            gap = if touching || meeting <= same { 0.0 } else { (gap - closing * (next - now)).max(0.0) };
            for (front, body) in fronts.iter_mut().zip(&self.bodies) {
                while body.outgoing.start(*front) + 2.0 * body.transit <= same {
                    *front += 1;
                }
            }
            now = next;
        }
        Err(ReferenceError::TooManyEvents { time: now })
    }

    fn record_interval(&mut self, start: f64, end: f64) {
        if end > start {
            self.intervals.push((start, end));
        }
    }

    /// Rounding error of a time near `t`.
    fn slack(&self, t: f64) -> f64 {
        ONLY_ROUNDING * (t + 2.0 * self.bodies[0].transit.min(self.bodies[1].transit))
    }

    fn covers(&self, t: f64) -> bool {
        (0.0..=self.until).contains(&t)
    }

    /// `value`, or NaN if the solution does not cover `t`.
    fn known(&self, t: f64, value: impl FnOnce() -> f64) -> f64 {
        if self.covers(t) { value() } else { f64::NAN }
    }

    fn body(&self, side: Side) -> &Body {
        &self.bodies[side as usize]
    }

    /// Time from the contact end to `x`, if `x` and `t` are in range; zero for the wall.
    fn delay(&self, side: Side, x: f64, t: f64) -> Option<f64> {
        let Some(bar) = self.body(side).bar else {
            return self.covers(t).then_some(0.0);
        };
        let distance = match side {
            Side::Left => bar.length - x,
            Side::Right => x,
        };
        ((0.0..=bar.length).contains(&x) && self.covers(t)).then_some(distance / bar.wave_speed())
    }

    /// Outgoing and incoming invariant at `x`, relative to the frame.
    fn invariants(&self, side: Side, x: f64, t: f64) -> Option<(f64, f64)> {
        let delay = self.delay(side, x, t)?;
        let body = self.body(side);
        let after = t + self.slack(t);
        let entered = after + delay - 2.0 * body.transit;
        Some((body.outgoing.value(after - delay), body.outgoing.value(entered)))
    }

    /// Displacement at `x` since time zero.
    pub fn displacement(&self, side: Side, x: f64, t: f64) -> f64 {
        let Some(delay) = self.delay(side, x, t) else {
            return f64::NAN;
        };
        let body = self.body(side);
        if body.bar.is_none() {
            return 0.0;
        }
        // v = (outgoing + incoming) / 2, integrated from 0 to t; both are the initial velocity up to time zero.
        let out = body.outgoing.integral(t - delay);
        let inc = body.outgoing.integral(t + delay - 2.0 * body.transit);
        self.frame * t + 0.5 * (out + inc) + body.outgoing.0[0].value * body.transit
    }

    /// Particle velocity at `x`.
    pub fn velocity(&self, side: Side, x: f64, t: f64) -> f64 {
        self.invariants(side, x, t).map_or(f64::NAN, |(out, inc)| self.frame + 0.5 * (out + inc))
    }

    /// Axial stress at `x`, positive in tension.
    pub fn stress(&self, side: Side, x: f64, t: f64) -> f64 {
        let Some((out, inc)) = self.invariants(side, x, t) else {
            return f64::NAN;
        };
        let characteristic = self.body(side).bar.map_or(0.0, |bar| bar.density * bar.wave_speed());
        match side {
            Side::Left => 0.5 * characteristic * (out - inc),
            Side::Right => 0.5 * characteristic * (inc - out),
        }
    }

    /// Force between the bodies, positive in compression.
    pub fn contact_force(&self, t: f64) -> f64 {
        self.known(t, || self.force.value(t + self.slack(t)))
    }

    /// Integral of the contact force from zero to `t`.
    pub fn impulse(&self, t: f64) -> f64 {
        self.known(t, || self.force.integral(t))
    }

    /// Distance between the contact ends; exactly zero while they touch.
    pub fn gap(&self, t: f64) -> f64 {
        self.known(t, || self.opening.integral(t).max(0.0))
    }

    /// Start and release times of the contacts, in order. A contact that lasts beyond the horizon ends there.
    pub fn contact_intervals(&self) -> &[(f64, f64)] {
        &self.intervals
    }

    /// Kinetic energy, summed over the bars.
    pub fn kinetic_energy(&self, t: f64) -> f64 {
        self.sum(t, |body, bar| {
            let square = |out, inc| f64::powi(out + inc + 2.0 * self.frame, 2);
            bar.impedance() / 8.0 * body.integrate(t, square)
        })
    }

    /// Elastic energy, summed over the bars.
    pub fn strain_energy(&self, t: f64) -> f64 {
        self.sum(t, |body, bar| bar.impedance() / 8.0 * body.integrate(t, |out, inc| f64::powi(out - inc, 2)))
    }

    /// Kinetic and elastic energy together, the integral of `rho A (R² + L²) / 4`.
    pub fn energy(&self, t: f64) -> f64 {
        self.kinetic_energy(t) + self.strain_energy(t)
    }

    /// Momentum, summed over the bars.
    pub fn momentum(&self, t: f64) -> f64 {
        self.sum(t, |body, bar| bar.mass() * self.mean(body, t))
    }

    /// Velocity of the center of mass of one bar.
    pub fn mean_velocity(&self, side: Side, t: f64) -> f64 {
        self.known(t, || self.mean(self.body(side), t))
    }

    /// The mean over the bar of `(outgoing + incoming) / 2` is the mean of the outgoing invariant over the last round
    /// trip.
    fn mean(&self, body: &Body, t: f64) -> f64 {
        if body.bar.is_none() {
            return 0.0;
        }
        let round_trip = 2.0 * body.transit;
        let relative = body.outgoing.integral(t) - body.outgoing.integral(t - round_trip);
        self.frame + relative / round_trip
    }

    /// Sum over the bars, without the wall.
    fn sum(&self, t: f64, f: impl Fn(&Body, &Bar) -> f64) -> f64 {
        let bars = self.bodies.iter().filter_map(|body| body.bar.map(|bar| f(body, &bar)));
        self.known(t, || bars.sum())
    }
}

#[cfg(test)]
mod tests;
