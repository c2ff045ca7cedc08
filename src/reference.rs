//! Exact solutions to measure the schemes against.
//!
//! [`CollidingBars`] solves the central impact of two linear elastic bars, or of a bar and a rigid wall, by the
//! method of characteristics; [`single_oscillator`] and [`forced_oscillator`] are the textbook responses of one degree
//! of freedom; [`PowerLawImpact`] is Hertz' impact, [`BouncingBar`] an elastic bar that falls on a wall again and
//! again. Units are the caller's and need only be consistent.
//!
//! # Method of characteristics
//!
//! With the compressive force `p = -sigma A` and the impedance `Z = rho c A`, `c = sqrt(E / rho)`, the wave equation
//! of a bar says that `R = v + p/Z` travels unchanged to the right and `L = v - p/Z` to the left, at the speed `c`.
//! Seen from the contact end, one of them comes in and the other goes out; the free far end (`p = 0`) turns the
//! outgoing one into the incoming one, so that
//!
//! ```text
//! incoming(t) = outgoing(t - 2 l/c).
//! ```
//!
//! The contact ends exchange nothing while they are apart. While they touch they share one velocity and one force:
//!
//! ```text
//! p = (R1 - L2) / (1/Z1 + 1/Z2),   v = R1 - p/Z1 = L2 + p/Z2,   p >= 0,
//! ```
//!
//! and they part as soon as this `p` would be negative; apart, the gap grows at the rate `L2 - R1`. A rigid wall is
//! the limit `1/Z2 = 0`. Bars that start undeformed keep both invariants piecewise constant in time, so the solution
//! is a finite list of jumps, and displacements, impulses and energies are exact sums over it.
//!
//! # References
//!
//! - W. Goldsmith, *Impact: The Theory and Physical Behaviour of Colliding Solids*, 1960 (longitudinal impact of rods,
//!   after Saint-Venant).
//! - K. F. Graff, *Wave Motion in Elastic Solids*, 1975 (characteristics, impedance).

mod bouncing_bar;
mod power_law;

pub use bouncing_bar::BouncingBar;
pub use power_law::PowerLawImpact;

use std::error::Error;
use std::fmt;

/// Jumps the event loop may generate before it gives up.
const MAX_EVENTS: usize = 200_000;
/// Events closer than this fraction of the time scale are one event that rounding has split.
const SAME_TIME: f64 = 1e-12;
/// Fraction of the impact speed below which two contact ends move together.
const SAME_VELOCITY: f64 = 1e-12;
/// Fraction of the impact speed below which a jump is rounding, not a wave.
const NO_JUMP: f64 = 8.0 * f64::EPSILON;

/// Why a reference solution cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ReferenceError {
    /// A parameter, or a quantity computed from it, is not finite or has the wrong sign.
    InvalidParameter {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// More wave fronts than can be stored meet at the contact before the horizon.
    TooManyEvents {
        /// Time reached.
        time: f64,
    },
}

impl fmt::Display for ReferenceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InvalidParameter { name, value } => write!(f, "invalid {name}: {value}"),
            Self::TooManyEvents { time } => {
                write!(f, "more than {MAX_EVENTS} wave fronts up to time {time}")
            }
        }
    }
}

impl Error for ReferenceError {}

fn finite(name: &'static str, value: f64, valid: bool) -> Result<f64, ReferenceError> {
    if value.is_finite() && valid { Ok(value) } else { Err(ReferenceError::InvalidParameter { name, value }) }
}

fn positive(name: &'static str, value: f64) -> Result<f64, ReferenceError> {
    finite(name, value, value > 0.0)
}

/// A straight uniform linear elastic bar, undeformed and in translation at time zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    /// Young's modulus, force / length².
    pub young: f64,
    /// Mass density, mass / length³.
    pub density: f64,
    /// Area of the cross-section, length².
    pub area: f64,
    /// Length.
    pub length: f64,
    /// Initial velocity, positive to the right.
    pub velocity: f64,
}

impl Bar {
    /// Speed of longitudinal waves, `c = sqrt(E / rho)`.
    pub fn wave_speed(&self) -> f64 {
        (self.young / self.density).sqrt()
    }

    /// Mechanical impedance, `Z = rho c A`: force over particle velocity in a traveling wave.
    pub fn impedance(&self) -> f64 {
        self.density * self.wave_speed() * self.area
    }

    /// Mass, `rho A l`.
    pub fn mass(&self) -> f64 {
        self.density * self.area * self.length
    }

    /// Time a wave needs from one end to the other.
    fn transit(&self) -> f64 {
        self.length / self.wave_speed()
    }

    fn validate(&self) -> Result<(), ReferenceError> {
        positive("Young's modulus", self.young)?;
        positive("density", self.density)?;
        positive("area", self.area)?;
        positive("length", self.length)?;
        finite("velocity", self.velocity, true)?;
        positive("transit time", self.transit())?;
        positive("mass", self.mass())?;
        positive("impedance", self.impedance())?;
        positive("reciprocal of the impedance", self.impedance().recip())?;
        Ok(())
    }
}

/// Which of the two colliding bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The left bar; its contact end is `x = length`.
    Left,
    /// The right bar, with its contact end at `x = 0`, or the wall.
    Right,
}

/// One piece of a [`Steps`].
#[derive(Clone, Copy, Debug)]
struct Piece {
    start: f64,
    value: f64,
    /// Integral of the function from zero to `start`, plus a constant.
    integral: f64,
}

/// A piecewise constant function of time and its running integral; the first piece also covers all earlier times.
#[derive(Clone, Debug)]
struct Steps(Vec<Piece>);

impl Steps {
    fn new(value: f64, integral: f64) -> Self {
        let mut steps = Self(Vec::new());
        steps.push(0.0, value, integral);
        steps
    }

    fn push(&mut self, start: f64, value: f64, integral: f64) {
        let piece = Piece { start, value, integral };
        self.0.push(piece);
    }

    /// Changes to `value` at `start`, unless the change is not larger than `tolerance`.
    fn jump(&mut self, start: f64, value: f64, tolerance: f64) {
        if (value - self.value(start)).abs() > tolerance {
            self.push(start, value, self.integral(start));
        }
    }

    /// Index of the piece that holds at `t`: the last one that starts no later.
    fn index(&self, t: f64) -> usize {
        self.0[1..].partition_point(|piece| piece.start <= t)
    }

    fn value(&self, t: f64) -> f64 {
        self.0[self.index(t)].value
    }

    fn integral(&self, t: f64) -> f64 {
        let piece = self.0[self.index(t)];
        piece.integral + piece.value * (t - piece.start)
    }

    /// Start of piece number `index`, infinity after the last.
    fn start(&self, index: usize) -> f64 {
        self.0.get(index).map_or(f64::INFINITY, |piece| piece.start)
    }
}

/// One of the two bodies and the invariant that has left its contact end, relative to the frame velocity.
#[derive(Clone, Debug)]
struct Body {
    /// `None` for the wall.
    bar: Option<Bar>,
    /// `1/Z`, zero for the wall.
    compliance: f64,
    /// `l/c`, infinite for the wall: nothing comes back.
    transit: f64,
    outgoing: Steps,
}

impl Body {
    fn new(bar: Option<Bar>, velocity: f64) -> Self {
        Self {
            bar,
            compliance: bar.map_or(0.0, |bar| bar.impedance().recip()),
            transit: bar.map_or(f64::INFINITY, |bar| bar.transit()),
            outgoing: Steps::new(velocity, 0.0),
        }
    }

    /// Integral of `f(outgoing, incoming)` over the transit time, that is over the bar, at the time `t`.
    ///
    /// A wave travels `delay` from the contact end to the point where the outgoing invariant is the one that left at
    /// `t - delay` and the incoming one is the one that left at `t + delay - 2 l/c`.
    fn integrate(&self, t: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
        let pieces = &self.outgoing.0;
        let entered = t - 2.0 * self.transit;
        let (mut out, mut inc) = (self.outgoing.index(t), self.outgoing.index(entered));
        let (mut delay, mut sum) = (0.0_f64, 0.0);
        loop {
            let out_end = if out == 0 { f64::INFINITY } else { t - pieces[out].start };
            let inc_end = self.outgoing.start(inc + 1) - entered;
            let end = out_end.min(inc_end).min(self.transit).max(delay);
            sum += (end - delay) * f(pieces[out].value, pieces[inc].value);
            if end >= self.transit {
                return sum;
            }
            out -= usize::from(out_end <= end);
            inc += usize::from(inc_end <= end);
            delay = end;
        }
    }
}

/// Exact solution of the central impact of two elastic bars, or of a bar and a rigid wall.
///
/// The bars lie on one line, a distance `gap` apart at time zero, undeformed, each with its own uniform velocity.
/// Their far ends are free. They may differ in everything: material, cross-section (plane cross-sections stay plane),
/// length, velocity. Contact transmits compression only and does not stick. See the [module](self) for the theory.
///
/// - `x` is the material coordinate of a bar from its own left end, `0 <= x <= length`.
/// - Displacements, velocities and momentum are positive to the right, stress is positive in tension, the contact
///   force and the gap are never negative.
/// - Where a quantity jumps, the value is the one just after the jump. A time that misses a jump by rounding only
///   (relative 1e-12) counts as after it.
/// - A query with a time outside `[0, until]` or an `x` outside the bar answers NaN.
/// - For the wall ([`Side::Right`] after [`against_wall`](Self::against_wall)) `x` is ignored, displacement and
///   velocities are those of the wall, and the stress is zero. Energies and momentum count the bar alone.
/// - Bars may touch without force, when their ends happen to move together. That counts as contact.
///
/// Queries allocate nothing and cost `O(log n)` for `n` jumps, energies `O(n)` at worst. The only error is rounding:
/// a few `f64::EPSILON` for every wave transit up to `t`.
///
/// # Example
///
/// Two equal bars meet head-on, stay together while the waves run to the far ends and back, and swap velocities.
///
/// ```
/// use contact_dynamics::reference::{Bar, CollidingBars, Side};
///
/// let left = Bar { young: 100.0, density: 0.01, area: 1.0, length: 10.0, velocity: 0.1 };
/// let right = Bar { velocity: 0.0, ..left };
/// let impact = CollidingBars::new(left, right, 0.01, 0.5)?;
///
/// let (start, release) = impact.contact_intervals()[0];
/// assert!((start - 0.1).abs() < 1e-12 && (release - 0.3).abs() < 1e-12);
/// assert!((impact.contact_force(0.2) - 0.05).abs() < 1e-15); // Z1 Z2 (v1 - v2) / (Z1 + Z2)
/// assert!((impact.impulse(0.5) - left.mass() * 0.1).abs() < 1e-15);
/// assert!((impact.velocity(Side::Right, 0.0, 0.4) - 0.1).abs() < 1e-15);
/// assert!((impact.energy(0.2) - impact.energy(0.0)).abs() < 1e-17);
/// # Ok::<(), contact_dynamics::reference::ReferenceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CollidingBars {
    /// Velocity of the frame in which the invariants are stored, that of the contact after the first impact. Its
    /// choice keeps rounding proportional to the impact speed, however fast the pair travels.
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
        Self::solve(left, Some(right), right.velocity, gap, until)
    }

    /// Solves the impact of a bar on a rigid wall at rest, `gap` to the right of it at time zero.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn against_wall(bar: Bar, gap: f64, until: f64) -> Result<Self, ReferenceError> {
        Self::against_moving_wall(bar, 0.0, gap, until)
    }

    /// Solves the impact of a bar on a rigid wall that keeps the velocity `wall`, positive to the right.
    ///
    /// The wall then does work: the energy of the bar is not conserved.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn against_moving_wall(bar: Bar, wall: f64, gap: f64, until: f64) -> Result<Self, ReferenceError> {
        finite("wall velocity", wall, true)?;
        Self::solve(bar, None, wall, gap, until)
    }

    fn solve(left: Bar, right: Option<Bar>, right_velocity: f64, gap: f64, until: f64) -> Result<Self, ReferenceError> {
        left.validate()?;
        finite("gap", gap, gap >= 0.0)?;
        positive("until", until)?;
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
            let touching = gap <= 0.0 && closing >= -SAME_VELOCITY * scale;
            // The force that gives the ends one velocity. A rest of rounding size, of either sign, is no pressure.
            let bond = if touching { closing / compliance } else { 0.0 };
            let pressing = closing > SAME_VELOCITY * scale;
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
        SAME_TIME * (t + 2.0 * self.bodies[0].transit.min(self.bodies[1].transit))
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
            return self.frame * t;
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

    /// Start and release times of the contacts, in order. A contact that outlasts the horizon ends there.
    pub fn contact_intervals(&self) -> &[(f64, f64)] {
        &self.intervals
    }

    /// Time up to which the solution is known.
    pub fn until(&self) -> f64 {
        self.until
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

    /// The mean over the bar of `(outgoing + incoming) / 2` is the mean of what went out during the last round trip.
    fn mean(&self, body: &Body, t: f64) -> f64 {
        if body.bar.is_none() {
            return self.frame;
        }
        let round_trip = 2.0 * body.transit;
        let relative = body.outgoing.integral(t) - body.outgoing.integral(t - round_trip);
        self.frame + relative / round_trip
    }

    /// Sum over the bars, the wall left out.
    fn sum(&self, t: f64, f: impl Fn(&Body, &Bar) -> f64) -> f64 {
        let bars = self.bodies.iter().filter_map(|body| body.bar.map(|bar| f(body, &bar)));
        self.known(t, || bars.sum())
    }
}

/// Free response `[u, v, a]` at the time `t` of `u'' + 2 xi omega u' + omega² u = 0` from `u(0) = u0`, `u'(0) = v0`.
///
/// `omega >= 0` is the undamped natural frequency in radians per unit of time and `xi >= 0` the damping ratio:
/// underdamped below one, critically damped at one, overdamped above. The formula has no cancellation between the
/// three. `omega = 0` gives uniform motion.
///
/// # Example
///
/// ```
/// use contact_dynamics::reference::single_oscillator;
///
/// let [u, v, a] = single_oscillator(2.0, 0.0, 1.0, 0.0, 0.3);
/// assert!((u - 0.6_f64.cos()).abs() < 1e-15);
/// assert!((v + 2.0 * 0.6_f64.sin()).abs() < 1e-15);
/// assert!((a + 4.0 * u).abs() < 1e-15);
/// ```
pub fn single_oscillator(omega: f64, xi: f64, u0: f64, v0: f64, t: f64) -> [f64; 3] {
    let alpha = xi * omega;
    let rate = omega * ((1.0 - xi) * (1.0 + xi)).abs().sqrt();
    // exp(-alpha t) times cos(rate t) and sin(rate t) / rate, or their hyperbolic and linear counterparts.
    let (cosine, sine) = if rate <= 0.0 {
        let decay = (-alpha * t).exp();
        (decay, decay * t)
    } else if xi < 1.0 {
        let decay = (-alpha * t).exp();
        let (sin, cos) = (rate * t).sin_cos();
        (decay * cos, decay * sin / rate)
    } else {
        let slow = (-omega * omega / (alpha + rate) * t).exp();
        let lost = -(-2.0 * rate * t).exp_m1();
        (slow * (1.0 - 0.5 * lost), 0.5 * slow * lost / rate)
    };
    let u = u0 * cosine + (v0 + alpha * u0) * sine;
    let v = v0 * cosine - (omega * omega * u0 + alpha * v0) * sine;
    [u, v, -2.0 * alpha * v - omega * omega * u]
}

/// A harmonic force per unit mass, `cosine cos(frequency t) + sine sin(frequency t)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicForce {
    /// Frequency in radians per unit of time.
    pub frequency: f64,
    /// Amplitude of the cosine, force / mass.
    pub cosine: f64,
    /// Amplitude of the sine, force / mass.
    pub sine: f64,
}

/// Response `[u, v, a]` at the time `t` of `u'' + 2 xi omega u' + omega² u = force(t)` from `u(0) = u0`, `u'(0) = v0`.
///
/// It is the steady response plus the [free response](single_oscillator) to what that leaves of the initial values.
/// Undamped resonance is solved exactly; next to it the two parts cancel, and the relative error grows as
/// `f64::EPSILON omega / |omega - frequency|`.
///
/// # Example
///
/// A step load on an undamped oscillator overshoots to twice the static displacement.
///
/// ```
/// use contact_dynamics::reference::{HarmonicForce, forced_oscillator};
///
/// let step = HarmonicForce { frequency: 0.0, cosine: 4.0, sine: 0.0 };
/// let [u, ..] = forced_oscillator(2.0, 0.0, step, 0.0, 0.0, std::f64::consts::FRAC_PI_2);
/// assert!((u - 2.0).abs() < 1e-15);
/// ```
pub fn forced_oscillator(omega: f64, xi: f64, force: HarmonicForce, u0: f64, v0: f64, t: f64) -> [f64; 3] {
    let (w, c, s) = (force.frequency, force.cosine, force.sine);
    let (sin, cos) = (w * t).sin_cos();
    let detuning = (omega - w) * (omega + w);
    let damping = 2.0 * xi * omega * w;
    let size = detuning.hypot(damping);
    // The particular solution and its rate, at t and at zero.
    let ([up, vp], [up0, vp0]) = if size > 0.0 {
        let (dx, dy) = (detuning / size, damping / size);
        let p = (dx * c - dy * s) / size;
        let q = (dx * s + dy * c) / size;
        ([p * cos + q * sin, w * (q * cos - p * sin)], [p, w * q])
    } else if w.abs() > 0.0 {
        let u = t * (c * sin - s * cos) / (2.0 * w);
        let v = 0.5 * t * (c * cos + s * sin) + (c * sin - s * cos) / (2.0 * w);
        ([u, v], [0.0, -s / (2.0 * w)])
    } else {
        ([0.5 * c * t * t, c * t], [0.0; 2])
    };
    let [uh, vh, _] = single_oscillator(omega, xi, u0 - up0, v0 - vp0, t);
    let (u, v) = (up + uh, vp + vh);
    let a = c * cos + s * sin - 2.0 * xi * omega * v - omega * omega * u;
    [u, v, a]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bar of the classical benchmark, c = 100 and Z = 1, as in Runcie et al. 2022 (IJNME).
    const BAR: Bar = Bar { young: 100.0, density: 0.01, area: 1.0, length: 10.0, velocity: 0.1 };
    const RESTING: Bar = Bar { velocity: 0.0, ..BAR };
    /// Half of the symmetric pair with four contact nodes: Z = 1/4.
    const QUARTER: Bar = Bar { area: 0.25, velocity: 0.05, ..BAR };
    const V0: f64 = 0.05;
    /// A time after zero, a little later than the event whose consequences are looked at.
    const LATER: f64 = 1e-6;

    fn close(value: f64, expected: f64, tolerance: f64) {
        let error = (value - expected).abs();
        assert!(error <= tolerance, "{value} instead of {expected}");
    }

    fn pair(left: Bar, right: Bar, gap: f64) -> CollidingBars {
        CollidingBars::new(left, right, gap, 1.0).unwrap()
    }

    fn symmetric() -> CollidingBars {
        let right = Bar { velocity: -V0, ..QUARTER };
        pair(QUARTER, right, 0.01)
    }

    fn dissimilar() -> CollidingBars {
        pair(Bar { young: 49.0, ..BAR }, RESTING, 0.01)
    }

    /// Saint-Venant's bars of one section, in contact at time zero.
    fn unequal(left: f64, right: f64) -> CollidingBars {
        let bar = |length, bar| Bar { length, ..bar };
        pair(bar(left, BAR), bar(right, RESTING), 0.0)
    }

    fn samples(count: u32) -> impl Iterator<Item = f64> {
        (0..=count).map(move |k| f64::from(k) / f64::from(count))
    }

    fn contacts(solution: &CollidingBars, expected: &[(f64, f64)]) {
        assert_eq!(solution.contact_intervals().len(), expected.len());
        for (interval, expected) in solution.contact_intervals().iter().zip(expected) {
            close(interval.0, expected.0, 1e-14);
            close(interval.1, expected.1, 1e-14);
        }
    }

    #[test]
    fn equal_bars_follow_the_closed_form() {
        let solution = symmetric();
        contacts(&solution, &[(0.1, 0.3)]);
        let (start, transit, speed) = (0.1, 0.1, 100.0);
        for t in samples(997) {
            let q = t - start;
            let touching = (0.0..2.0 * transit).contains(&q);
            close(solution.contact_force(t), if touching { 0.0125 } else { 0.0 }, 1e-16);
            for s in samples(13).map(|fraction| 10.0 * fraction) {
                let reached = speed * q > s;
                let freed = speed * q > 20.0 - s;
                let (u, v, sigma) = match (reached, freed) {
                    (false, _) => (V0 * t, V0, 0.0),
                    (true, false) => (V0 * (start + s / speed), 0.0, -V0),
                    (true, true) => (V0 * (start + 2.0 * transit - q), -V0, 0.0),
                };
                for (side, x, sign) in [(Side::Left, 10.0 - s, 1.0), (Side::Right, s, -1.0)] {
                    close(solution.displacement(side, x, t), sign * u, 1e-16);
                    close(solution.velocity(side, x, t), sign * v, 1e-16);
                    close(solution.stress(side, x, t), sigma, 1e-16);
                }
            }
        }
        close(solution.displacement(Side::Left, 10.0, 0.2), 0.005, 1e-17);
        close(solution.impulse(1.0), 2.5e-3, 1e-17);
        close(solution.impulse(1.0), 2.0 * QUARTER.mass() * V0, 1e-17);
    }

    #[test]
    fn equal_bars_exchange_kinetic_and_strain_energy_linearly() {
        let solution = symmetric();
        let total = 6.25e-5;
        for t in samples(997) {
            let kinetic = total * (1.0 - ((t - 0.1) / 0.1).clamp(0.0, 2.0)).abs();
            close(solution.kinetic_energy(t), kinetic, 1e-14 * total);
            close(solution.strain_energy(t), total - kinetic, 1e-14 * total);
        }
    }

    #[test]
    fn dissimilar_bars_press_on_two_plateaus() {
        let solution = dissimilar();
        contacts(&solution, &[(0.1, 0.1 + 2.0 / 7.0)]);
        for (t, force, common) in [
            (0.1, 0.07 / 1.7, 0.041_176_470_6),
            (0.3 - LATER, 0.041_176_470_6, 0.041_176_470_6),
            (0.3, 0.007_266_436_0, 0.089_619_377_2),
            (0.385_714, 0.007_266_436_0, 0.089_619_377_2),
        ] {
            close(solution.contact_force(t), force, 1e-10);
            close(solution.velocity(Side::Left, 10.0, t), common, 1e-10);
            close(solution.velocity(Side::Right, 0.0, t), common, 1e-10);
        }
        let release = solution.contact_intervals()[0].1;
        close(solution.contact_force(release), 0.0, 0.0);
        let (left, right) = (-0.017_647_058_8, 0.082_352_941_2);
        close(solution.velocity(Side::Left, 10.0, release), left, 1e-10);
        close(solution.velocity(Side::Right, 0.0, release), right, 1e-10);
        for t in [0.4, 0.7, 1.0] {
            let mean = [Side::Left, Side::Right].map(|side| solution.mean_velocity(side, t));
            close(mean[0], 0.011_418_685_121, 1e-12);
            close(mean[1], 0.088_581_314_879, 1e-12);
            close(mean[0] + mean[1], 0.1, 1e-15);
        }
    }

    #[test]
    fn longer_target_is_touched_without_force_before_it_leaves() {
        let solution = unequal(10.0, 20.0);
        contacts(&solution, &[(0.0, 0.4)]);
        for (t, force, left, right) in [
            (0.0, 0.05, 0.05, 0.05),
            (0.2 - LATER, 0.05, 0.05, 0.05),
            (0.2, 0.0, 0.0, 0.0),
            (0.4 - LATER, 0.0, 0.0, 0.0),
            (0.4, 0.0, 0.0, 0.1),
        ] {
            close(solution.contact_force(t), force, 1e-16);
            close(solution.velocity(Side::Left, 10.0, t), left, 1e-16);
            close(solution.velocity(Side::Right, 0.0, t), right, 1e-16);
        }
        close(solution.mean_velocity(Side::Left, 1.0), 0.0, 1e-16);
        close(solution.mean_velocity(Side::Right, 1.0), 0.05, 1e-16);
        close(solution.impulse(1.0), BAR.mass() * 0.1, 1e-16);
    }

    #[test]
    fn longer_striker_follows_without_force_before_it_is_left() {
        let solution = unequal(20.0, 10.0);
        contacts(&solution, &[(0.0, 0.4)]);
        for (t, force, common) in [(0.1, 0.05, 0.05), (0.2, 0.0, 0.1), (0.3, 0.0, 0.1)] {
            close(solution.contact_force(t), force, 1e-16);
            close(solution.velocity(Side::Left, 20.0, t), common, 1e-16);
            close(solution.velocity(Side::Right, 0.0, t), common, 1e-16);
        }
        assert!(solution.gap(0.5) > 0.0);
        close(solution.mean_velocity(Side::Left, 1.0), 0.05, 1e-16);
        close(solution.mean_velocity(Side::Right, 1.0), 0.1, 1e-16);
    }

    #[test]
    fn touching_without_force_survives_rounding() {
        for k in 1..200 {
            let odd = f64::from(k) / 7.0;
            let bar = |length, velocity| Bar { young: 3.0 * odd, length, velocity, ..BAR };
            let short = bar(0.3, 0.1 + odd);
            let long = bar(0.3 * f64::from(2 + k % 4), odd);
            let round_trip = 2.0 * long.length / long.wave_speed();
            let solution = CollidingBars::new(short, long, 0.0, 9.0).unwrap();
            assert_eq!(solution.contact_intervals().len(), 1);
            close(solution.contact_intervals()[0].1, round_trip, 1e-14);
            assert_eq!(solution.force.0.len(), 3);
            close(solution.contact_force(0.8 * round_trip), 0.0, 0.0);
        }
    }

    #[test]
    fn energy_and_momentum_are_conserved() {
        for solution in [symmetric(), dissimilar(), unequal(10.0, 20.0), unequal(20.0, 10.0)] {
            let (energy, momentum) = (solution.energy(0.0), solution.momentum(0.0));
            for t in samples(997) {
                close(solution.energy(t), energy, 1e-14 * energy);
                close(solution.momentum(t), momentum, 1e-15 * BAR.mass());
                let bar = solution.bodies[0].bar.unwrap();
                let left = bar.mass() * (bar.velocity - solution.mean_velocity(Side::Left, t));
                close(solution.impulse(t), left, 1e-15 * bar.mass());
            }
        }
    }

    #[test]
    fn displacement_integrates_velocity_and_its_gradient_gives_stress() {
        let solution = dissimilar();
        let (steps, dx) = (40_000, 1e-4);
        let dt = 1.0 / f64::from(steps);
        for (side, x, young) in [(Side::Left, 7.3, 49.0), (Side::Right, 2.1, 100.0)] {
            let mut sum = 0.0;
            for k in 0..steps {
                let t = dt * (f64::from(k) + 0.5);
                sum += dt * solution.velocity(side, x, t);
                close(solution.displacement(side, x, t + 0.5 * dt), sum, 5e-6);
            }
            for t in samples(23) {
                let [before, after] = [x - dx, x + dx].map(|x| solution.displacement(side, x, t));
                let strain = (after - before) / (2.0 * dx);
                close(solution.stress(side, x, t), young * strain, 1e-9);
            }
        }
    }

    #[test]
    fn contact_ends_close_the_gap_while_they_touch() {
        for (solution, end, gap) in
            [(symmetric(), 10.0, 0.01), (dissimilar(), 10.0, 0.01), (unequal(20.0, 10.0), 20.0, 0.0)]
        {
            let (start, release) = solution.contact_intervals()[0];
            for t in samples(997) {
                let left = solution.displacement(Side::Left, end, t);
                let right = solution.displacement(Side::Right, 0.0, t);
                close(solution.gap(t), gap + right - left, 1e-16);
                assert_eq!((start..=release).contains(&t), solution.gap(t) <= 0.0);
            }
        }
    }

    #[test]
    fn wall_is_half_of_the_symmetric_pair() {
        let whole = symmetric();
        let half = CollidingBars::against_wall(QUARTER, 0.005, 1.0).unwrap();
        contacts(&half, &[(0.1, 0.3)]);
        for t in samples(997) {
            close(half.contact_force(t), whole.contact_force(t), 1e-16);
            close(half.impulse(t), whole.impulse(t), 1e-17);
            close(half.gap(t), 0.5 * whole.gap(t), 1e-16);
            close(half.energy(t), 0.5 * whole.energy(t), 1e-18);
            let momentum = QUARTER.mass() * half.mean_velocity(Side::Left, t);
            close(half.momentum(t), momentum, 1e-17);
            for x in [0.0, 3.0, 10.0] {
                let [a, b] = [&half, &whole].map(|bars| bars.displacement(Side::Left, x, t));
                close(a, b, 1e-16);
            }
            let wall = [
                half.displacement(Side::Right, 0.0, t),
                half.velocity(Side::Right, 0.0, t),
                half.mean_velocity(Side::Right, t),
                half.stress(Side::Right, 0.0, t),
            ];
            assert!(wall.iter().all(|value| value.abs() <= 0.0));
        }
    }

    #[test]
    fn common_velocity_changes_nothing_else() {
        let boost = 7.0;
        let moved = |bar: Bar| Bar { velocity: bar.velocity + boost, ..bar };
        let left = Bar { young: 49.0, ..BAR };
        let wall = |bar, wall| CollidingBars::against_moving_wall(bar, wall, 0.01, 1.0).unwrap();
        for (rest, moving) in
            [(dissimilar(), pair(moved(left), moved(RESTING), 0.01)), (wall(BAR, 0.0), wall(moved(BAR), boost))]
        {
            for t in samples(499) {
                close(moving.contact_force(t), rest.contact_force(t), 1e-14);
                close(moving.gap(t), rest.gap(t), 1e-14);
                close(moving.strain_energy(t), rest.strain_energy(t), 1e-16);
                for side in [Side::Left, Side::Right] {
                    let [u, u0] = [&moving, &rest].map(|bars| bars.displacement(side, 4.0, t));
                    close(u, u0 + boost * t, 1e-14);
                    let [v, v0] = [&moving, &rest].map(|bars| bars.velocity(side, 4.0, t));
                    close(v, v0 + boost, 1e-14);
                }
            }
        }
    }

    #[test]
    fn bars_that_do_not_approach_never_press() {
        let fleeing = Bar { velocity: 0.2, ..BAR };
        for (right, gap) in [(BAR, 0.01), (fleeing, 0.01), (fleeing, 0.0)] {
            let solution = pair(BAR, right, gap);
            assert!(solution.contact_intervals().is_empty());
            close(solution.impulse(1.0), 0.0, 0.0);
            close(solution.gap(1.0), gap + right.velocity - 0.1, 1e-16);
            close(solution.displacement(Side::Left, 3.0, 0.7), 0.07, 1e-16);
        }
        let together = pair(BAR, BAR, 0.0);
        contacts(&together, &[(0.0, 1.0)]);
        close(together.impulse(1.0), 0.0, 0.0);
    }

    #[test]
    fn vibrating_bar_hits_the_wall_twice() {
        // Z = c = l = 1. The incoming invariant is 1, -1, 1, 1 for half a unit of time each, chosen so that the gap
        // opens at 0.5, is 0.5 at 1, closes at 1.5, and opens for good at 2.
        let bar = Bar { young: 1.0, density: 1.0, area: 1.0, length: 1.0, velocity: 0.0 };
        let mut solution = CollidingBars::against_wall(bar, 0.0, 9.0).unwrap();
        let mut past = Steps(Vec::new());
        past.push(-2.0, 1.0, 0.0);
        past.jump(-1.5, -1.0, 0.0);
        past.jump(-1.0, 1.0, 0.0);
        solution.bodies[0].outgoing = past;
        solution.intervals.clear();
        solution.opening = Steps::new(0.0, 0.0);
        solution.follow_waves(0.0, 1.0).unwrap();
        contacts(&solution, &[(0.0, 0.5), (1.5, 2.0)]);
        close(solution.impulse(9.0), 1.0, 1e-15);
        for t in samples(90).map(|fraction| 9.0 * fraction) {
            close(solution.energy(t), 0.5, 1e-14);
            let change = solution.momentum(t) - solution.momentum(0.0);
            close(change, -solution.impulse(t), 1e-14);
        }
        for (t, gap) in [(1.0, 0.5), (1.25, 0.25), (1.75, 0.0), (3.0, 1.0), (3.5, 0.5)] {
            close(solution.gap(t), gap, 1e-15);
        }
    }

    #[test]
    fn incommensurate_bars_stay_cheap_and_exact() {
        for exponent in -6..=6 {
            let ratio = 10_f64.powi(exponent);
            let right = Bar { area: ratio, length: 2.0_f64.sqrt(), ..RESTING };
            let solution = pair(BAR, right, 0.001);
            assert_eq!(solution.contact_intervals().len(), 1);
            let energy = solution.energy(0.0);
            for t in samples(199) {
                assert!(solution.contact_force(t) >= 0.0 && solution.gap(t) >= 0.0);
                assert!(solution.contact_force(t) * solution.gap(t) <= 0.0);
                close(solution.energy(t), energy, 1e-12 * energy);
            }
        }
    }

    #[test]
    fn queries_out_of_range_are_nan_and_parameters_are_checked() {
        let solution = symmetric();
        for (x, t) in [(-0.1, 0.5), (10.1, 0.5), (f64::NAN, 0.5), (5.0, 1.1), (5.0, f64::NAN)] {
            assert!(solution.velocity(Side::Left, x, t).is_nan());
            assert!(solution.displacement(Side::Right, x, t).is_nan());
            assert!(solution.stress(Side::Right, x, t).is_nan());
        }
        assert!(solution.contact_force(-0.1).is_nan() && solution.gap(1.1).is_nan());
        assert!(solution.energy(1.1).is_nan() && solution.momentum(f64::NAN).is_nan());
        let nan = f64::NAN;
        for (left, gap, until, message) in [
            (Bar { young: 0.0, ..BAR }, 0.0, 1.0, "invalid Young's modulus: 0"),
            (Bar { density: -1.0, ..BAR }, 0.0, 1.0, "invalid density: -1"),
            (Bar { area: nan, ..BAR }, 0.0, 1.0, "invalid area: NaN"),
            (Bar { length: 0.0, ..BAR }, 0.0, 1.0, "invalid length: 0"),
            (Bar { velocity: nan, ..BAR }, 0.0, 1.0, "invalid velocity: NaN"),
            (BAR, -1.0, 1.0, "invalid gap: -1"),
            (BAR, 0.0, 0.0, "invalid until: 0"),
        ] {
            let error = CollidingBars::new(left, BAR, gap, until).unwrap_err();
            assert_eq!(error.to_string(), message);
        }
        assert!(CollidingBars::against_moving_wall(BAR, f64::INFINITY, 0.0, 1.0).is_err());
    }

    /// Checks `[u, v, a]` against its own equation of motion, with differences for the derivatives.
    fn satisfies(response: impl Fn(f64) -> [f64; 3], omega: f64, xi: f64, f: impl Fn(f64) -> f64) {
        let h = 1e-5;
        for t in samples(20).map(|fraction| 0.1 + 3.0 * fraction) {
            let ([u0, v0, _], [u1, v1, _]) = (response(t - h), response(t + h));
            let [u, v, a] = response(t);
            close((u1 - u0) / (2.0 * h), v, 1e-8);
            close((v1 - v0) / (2.0 * h), a, 1e-8);
            close(a + 2.0 * xi * omega * v + omega * omega * u, f(t), 1e-12);
        }
    }

    #[test]
    fn free_oscillator_in_every_damping_regime() {
        for xi in [0.0, 0.05, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 3.0] {
            let response = |t| single_oscillator(2.0, xi, 0.7, -0.3, t);
            satisfies(response, 2.0, xi, |_| 0.0);
            let [u, v, _] = response(0.0);
            close(u, 0.7, 1e-16);
            close(v, -0.3, 1e-16);
        }
        close(single_oscillator(2.0, 1.0, 1.0, 0.0, 0.5)[0], 2.0 / 1_f64.exp(), 1e-15);
        close(single_oscillator(2.0, 1e3, 1.0, 0.0, 1e3)[0], (-1.0_f64).exp(), 1e-6);
        close(single_oscillator(0.0, 0.1, 1.0, 2.0, 3.0)[0], 7.0, 0.0);
    }

    #[test]
    fn forced_oscillator_off_and_at_resonance() {
        for (omega, xi, frequency) in
            [(2.0, 0.0, 1.3), (2.0, 0.1, 2.0), (2.0, 0.0, 2.0), (2.0, 1.5, 0.0), (0.0, 0.0, 2.0), (0.0, 0.0, 0.0)]
        {
            let force = HarmonicForce { frequency, cosine: 0.8, sine: -0.5 };
            let response = |t| forced_oscillator(omega, xi, force, 0.7, -0.3, t);
            let (c, s) = (force.cosine, force.sine);
            let applied = |t: f64| c * (frequency * t).cos() + s * (frequency * t).sin();
            satisfies(response, omega, xi, applied);
            let [u, v, _] = response(0.0);
            close(u, 0.7, 1e-15);
            close(v, -0.3, 1e-15);
        }
    }
}
