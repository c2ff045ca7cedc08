//! Ground motions made of formulas: a record of filtered white noise under an envelope, and a pulse; records as files.

use crate::random::Congruential;
use std::f64::consts::{PI, TAU};

/// Standard gravity (m/s²).
pub const GRAVITY: f64 = 9.806_65;

/// An accelerogram: samples at a fixed interval, straight lines between them, rest before and after.
#[derive(Clone, Debug)]
pub struct Ground {
    interval: f64,
    samples: Vec<f64>,
}

impl Ground {
    /// Samples of an acceleration up to the time given.
    pub fn sampled(interval: f64, duration: f64, acceleration: impl Fn(f64) -> f64) -> Self {
        let count = (duration / interval).round() as usize;
        Self { interval, samples: (0..=count).map(|k| acceleration(k as f64 * interval)).collect() }
    }

    /// White noise through the filter of Kanai (1957) and Tajimi (1960), ω_g = 5π, ζ_g = 0.6 (firm ground), without
    /// its low frequencies by a second one (Clough and Penzien, Dynamics of Structures; ω_f = π/2, ζ_f = 0.6), as a
    /// sum of cosines with random phases (Shinozuka and Deodatis, Appl. Mech. Rev. 44, 1991), under the envelope of
    /// Jennings, Housner and Tsai (1968): t² to 2 s, flat to 7 s, then exp(−0.4 (t − 7 s)). Scaled to its largest
    /// acceleration; sampled every 5 ms.
    pub fn kanai_tajimi(seed: u64, peak: f64, duration: f64) -> Self {
        const WAVES: usize = 400;
        const HIGHEST: f64 = 80.0 * PI;
        let (width, mut random) = (HIGHEST / WAVES as f64, Congruential(seed));
        // (The first numbers of the generator are close to its seed.)
        random.vector(16, 1.0);
        let waves: Vec<_> = (0..WAVES)
            .map(|k| {
                let omega = (k as f64 + 0.5) * width;
                (omega, density(omega).sqrt(), TAU * random.unit())
            })
            .collect();
        let noise = |t: f64| waves.iter().map(|(omega, size, phase)| size * (omega * t + phase).cos()).sum::<f64>();
        let mut ground = Self::sampled(5e-3, duration, |t| envelope(t) * noise(t));
        let scale = peak / ground.peak();
        ground.samples.iter_mut().for_each(|sample| *sample *= scale);
        ground
    }

    /// The record as a file: what it is, the interval, then one acceleration a line, all digits.
    pub fn to_text(&self, what: &str) -> String {
        let lines = self.samples.iter().map(|sample| format!("{sample:e}\n"));
        format!("# {what}\n# interval in s, then accelerations in m/s²\n{:e}\n", self.interval)
            + &lines.collect::<String>()
    }

    /// A record from a file: the interval, then accelerations, one number a line; lines that begin with # are skipped.
    ///
    /// # Errors
    ///
    /// Which line is no finite number, or that there is no positive interval.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let lines = text.lines().zip(1..).map(|(line, number)| (line.trim(), number));
        let mut numbers = lines.filter(|(line, _)| !line.is_empty() && !line.starts_with('#')).map(|(line, number)| {
            let value = line.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| format!("line {number} of the record is no number: {line}"))
        });
        let interval = numbers.next().ok_or("the record is empty")??;
        if interval <= 0.0 {
            return Err(format!("the interval of the record is {interval}, it must be positive"));
        }
        Ok(Self { interval, samples: numbers.collect::<Result<_, _>>()? })
    }

    /// The largest acceleration.
    pub fn peak(&self) -> f64 {
        self.samples.iter().fold(0.0, |peak, sample| sample.abs().max(peak))
    }

    /// The acceleration at t.
    pub fn at(&self, t: f64) -> f64 {
        let place = t / self.interval;
        let before = place.floor().max(0.0);
        let (k, part) = (before as usize, place - before);
        let sample = |k: usize| self.samples.get(k).copied().unwrap_or(0.0);
        if place < 0.0 { 0.0 } else { sample(k) + part * (sample(k + 1) - sample(k)) }
    }
}

/// The spectral density of the filters, up to a factor.
fn density(omega: f64) -> f64 {
    const SOIL: [f64; 2] = [5.0 * PI, 0.6];
    const LOW: [f64; 2] = [0.5 * PI, 0.6];
    let parts = |[own, damping]: [f64; 2]| {
        let ratio = omega / own;
        let velocity = (2.0 * damping * ratio).powi(2);
        (ratio, velocity, (1.0 - ratio * ratio).powi(2) + velocity)
    };
    let ((_, soil, soil_below), (low, _, low_below)) = (parts(SOIL), parts(LOW));
    (1.0 + soil) / soil_below * low.powi(4) / low_below
}

fn envelope(t: f64) -> f64 {
    match t {
        t if t < 2.0 => 0.25 * t * t,
        t if t < 7.0 => 1.0,
        t => (-0.4 * (t - 7.0)).exp(),
    }
}

/// Ricker's wavelet: the acceleration has this peak at the middle, and its spectrum is largest at the frequency.
pub fn ricker(peak: f64, frequency: f64, middle: f64) -> impl Fn(f64) -> f64 {
    move |t| {
        let x = (PI * frequency * (t - middle)).powi(2);
        peak * (1.0 - 2.0 * x) * (-x).exp()
    }
}
