//! An elastic bar, and the waves that leave its contact end.

use super::error::{ReferenceError, finite, positive};

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

    /// Travel time of a wave from one end to the other.
    pub(super) fn transit(&self) -> f64 {
        self.length / self.wave_speed()
    }

    pub(super) fn validate(&self) -> Result<(), ReferenceError> {
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

/// One piece of a [`Steps`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) start: f64,
    pub(super) value: f64,
    /// Integral of the function from zero to `start`, plus a constant.
    pub(super) integral: f64,
}

/// A piecewise constant function of time and its running integral; the first piece also covers all earlier times.
#[derive(Clone, Debug)]
pub(super) struct Steps(pub(super) Vec<Piece>);

impl Steps {
    pub(super) fn new(value: f64, integral: f64) -> Self {
        let mut steps = Self(Vec::new());
        steps.push(0.0, value, integral);
        steps
    }

    pub(super) fn push(&mut self, start: f64, value: f64, integral: f64) {
        let piece = Piece { start, value, integral };
        self.0.push(piece);
    }

    /// Changes to `value` at `start`, unless the change is at most `tolerance`.
    pub(super) fn jump(&mut self, start: f64, value: f64, tolerance: f64) {
        if (value - self.value(start)).abs() > tolerance {
            self.push(start, value, self.integral(start));
        }
    }

    /// Index of the piece that contains `t`: the last one that starts at or before `t`.
    pub(super) fn index(&self, t: f64) -> usize {
        self.0[1..].partition_point(|piece| piece.start <= t)
    }

    pub(super) fn value(&self, t: f64) -> f64 {
        self.0[self.index(t)].value
    }

    pub(super) fn integral(&self, t: f64) -> f64 {
        let piece = self.0[self.index(t)];
        piece.integral + piece.value * (t - piece.start)
    }

    /// Start of piece number `index`, infinity after the last.
    pub(super) fn start(&self, index: usize) -> f64 {
        self.0.get(index).map_or(f64::INFINITY, |piece| piece.start)
    }
}

/// One of the two bodies, and the invariant that left its contact end, relative to the frame velocity.
#[derive(Clone, Debug)]
pub(super) struct Body {
    /// `None` for the wall.
    pub(super) bar: Option<Bar>,
    /// `1/Z`, zero for the wall.
    pub(super) compliance: f64,
    /// `l/c`, infinite for the wall, where no wave returns.
    pub(super) transit: f64,
    pub(super) outgoing: Steps,
}

impl Body {
    pub(super) fn new(bar: Option<Bar>, velocity: f64) -> Self {
        Self {
            bar,
            compliance: bar.map_or(0.0, |bar| bar.impedance().recip()),
            transit: bar.map_or(f64::INFINITY, |bar| bar.transit()),
            outgoing: Steps::new(velocity, 0.0),
        }
    }

    /// Integral of `f(outgoing, incoming)` over the transit time, that is over the bar, at the time `t`.
    ///
    /// A wave takes `delay` from the contact end to a point. The outgoing invariant there is the one that left at
    /// `t - delay`, the incoming one is the one that left at `t + delay - 2 l/c`.
    pub(super) fn integrate(&self, t: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
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
