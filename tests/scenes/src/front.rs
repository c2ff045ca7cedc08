//! A wave that meets a wall at a reduced body, in closed form: what taper and softening make of the front.
//!
//! The modes of a bar become a continuum x = ω/ω_c as the bar becomes long. Under a force λ at its end, with impedance
//! Z, the end moves by H λ,
//!
//! ```text
//! H(s) = 2/(π Z ω_c) [∫₀¹ (1 − x^p)/(x² + s²) dx + 1 + 1/(p − 1) + softening],      s in units of ω_c
//! ```
//!
//! the sum over the modes, the residual flexibility R = 2/(π Z ω_c), what the taper gives to F, and the softening. The
//! wall stops the end at once, so that the force over its exact value is 1/(s² Z ω_c H). Its singularities are a cut
//! along the modes, |Im s| < 1, and, where the bracket has a zero beyond them, an undamped frequency. Of the cut
//!
//! ```text
//! λ(t)/λ_exact = 2/π ∫₀¹ A(ω) sin(ω t)/ω dω,      A = T/(T² + (2 ω Q/π)²),      T = 1 − ω^p
//! ```
//!
//! with Q the bracket on the cut, its principal value.

use std::f64::consts::{FRAC_2_PI, PI};

/// Points of ∫ dω and ∫ dx.
const SPECTRUM: usize = 400;
const MODES: usize = 200;
/// How long, in units of 1/ω_c, and in what steps, a front is looked at.
const TIME: f64 = 40.0;
const STEP: f64 = 0.05;

/// The force on a wall behind a front, by the modes of a tapered body.
#[derive(Clone, Debug)]
pub struct Front {
    /// ω and A.
    spectrum: Vec<(f64, f64)>,
}

/// What is measured of a front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// ∫ |λ/λ_exact − 1| dt, times ω_c.
    pub error: f64,
    /// The largest force over the exact one, less 1.
    pub overshoot: f64,
    /// The largest A: beyond 1 there are frequencies that the body has too much of.
    pub amplification: f64,
}

impl Front {
    /// Of the taper 1 − (ω/ω_c)^p and a softening in units of R; `None` if there is an undamped frequency above ω_c.
    pub fn new(exponent: f64, softening: f64) -> Option<Self> {
        let still = 1.0 + 1.0 / (exponent - 1.0) + softening;
        // The bracket just above the modes: −∫ (1 − x^p)/(1 − x²) dx and what is constant.
        let above = still - mean(MODES, |x| (1.0 - x.powf(exponent)) / (1.0 - x * x));
        let amplitude = |omega: f64| {
            let power = omega.powf(exponent);
            // (ω^p − x^p)/(x² − ω²) is smooth, and ∫ dx/(x² − ω²) = −artanh(ω)/ω.
            let smooth = mean(MODES, |x| {
                let below = x * x - omega * omega;
                if below.abs() > 1e-9 { (power - x.powf(exponent)) / below } else { -0.5 * exponent * power / (x * x) }
            });
            let (taper, bracket) = (1.0 - power, smooth - (1.0 - power) * omega.atanh() / omega + still);
            taper / (taper * taper + (FRAC_2_PI * omega * bracket).powi(2))
        };
        (above > 0.0).then(|| Self { spectrum: places(SPECTRUM).map(|omega| (omega, amplitude(omega))).collect() })
    }

    /// The force over the exact one, a time t/ω_c after the front has come.
    pub fn force(&self, t: f64) -> f64 {
        let sum: f64 = self.spectrum.iter().map(|(omega, amplitude)| amplitude * (omega * t).sin() / omega).sum();
        FRAC_2_PI * sum / SPECTRUM as f64
    }

    pub fn shape(&self) -> Shape {
        let times = (0_u32..).map(|k| (f64::from(k) + 0.5) * STEP).take_while(|t| *t <= TIME);
        let forces: Vec<f64> = times.map(|t| self.force(t)).collect();
        Shape {
            error: STEP * forces.iter().map(|force| (force - 1.0).abs()).sum::<f64>(),
            overshoot: forces.iter().copied().fold(0.0, f64::max) - 1.0,
            amplification: self.spectrum.iter().map(|of| of.1).fold(0.0, f64::max),
        }
    }
}

fn places(count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| (k as f64 + 0.5) / count as f64)
}

/// The mean of a function on [0, 1], by midpoints.
fn mean(count: usize, f: impl Fn(f64) -> f64) -> f64 {
    places(count).map(f).sum::<f64>() / count as f64
}

/// The softening of least error for an exponent, by golden sections.
pub fn best_softening(exponent: f64) -> Option<(f64, Shape)> {
    let shape = |softening| Front::new(exponent, softening).map(|front| front.shape());
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.0, 4.0);
    while high - low > 0.01 {
        let [left, right] = [high - golden * (high - low), low + golden * (high - low)];
        if shape(left)?.error < shape(right)?.error { high = right } else { low = left }
    }
    let softening = 0.5 * (low + high);
    Some((softening, shape(softening)?))
}

/// The frequency over ω_c with which the force of an untapered body (MacNeal's) rings behind a front, undamped, and its
/// amplitude over the exact force.
///
/// There H = 2/(π Z ω_c) (1 − artanh(1/ω)/ω) beyond the modes: zero where artanh(1/ω) = ω. The residues at ±iω of 1/(s²
/// Z ω_c H) give π (ω² − 1)/ω³ sin(ω t).
pub fn ringing() -> [f64; 2] {
    let (mut low, mut high) = (1.0 + 1e-9, 2.0_f64);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if middle.recip().atanh() > middle { low = middle } else { high = middle }
    }
    [low, PI * (low * low - 1.0) / low.powi(3)]
}
