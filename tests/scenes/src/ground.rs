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

#[cfg(test)]
mod tests {
    use super::{Ground, ricker};
    use std::f64::consts::PI;

    #[test]
    fn a_record_has_its_peak_and_is_at_rest_outside() {
        let ground = Ground::kanai_tajimi(1, 3.5, 12.0);
        assert!((ground.peak() - 3.5).abs() < 1e-12);
        assert!(ground.at(-1e-3) == 0.0 && ground.at(12.1) == 0.0 && ground.at(0.0) == 0.0);
        // Straight lines between two samples.
        let [a, b, middle] = [4.0, 4.005, 4.0025].map(|t| ground.at(t));
        assert!((middle - 0.5 * (a + b)).abs() < 1e-9);
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let ground = Ground::kanai_tajimi(5, 2.0, 3.0);
        let read = Ground::from_text(&ground.to_text("a record")).unwrap();
        assert!(read.samples.iter().zip(&ground.samples).all(|(x, y)| x.to_bits() == y.to_bits()));
        assert!(read.samples.len() == 601 && read.interval.to_bits() == ground.interval.to_bits());
        assert_eq!(Ground::from_text("# nothing\n").unwrap_err(), "the record is empty");
        assert!(Ground::from_text("0.01\n1.0\n\nx").unwrap_err().starts_with("line 4"));
        assert!(Ground::from_text("0\n1.0").unwrap_err().contains("positive"));
    }

    /// ω⁴-filter times Kanai's and Tajimi's: (ω_g⁴ + 4ζ²ω_g²ω²)/((ω_g² − ω²)² + 4ζ²ω_g²ω²) · ω⁴/((ω_f² − ω²)² + …).
    fn formula(omega: f64) -> f64 {
        let [soil, low, damping] = [5.0 * PI, 0.5 * PI, 0.6];
        let below = |own: f64| (own * own - omega * omega).powi(2) + (2.0 * damping * own * omega).powi(2);
        (soil.powi(4) + (2.0 * damping * soil * omega).powi(2)) / below(soil) * omega.powi(4) / below(low)
    }

    #[test]
    fn records_have_the_spectrum_of_the_formula() {
        // Between 2 s and 7 s the envelope is flat: power in four bands of many records beside that of the formula.
        let bands = [[0.6, 1.8], [1.8, 3.2], [3.2, 6.0], [6.0, 12.0]];
        let resolution = 0.2;
        let lines = |[low, high]: [f64; 2]| {
            let [first, last] = [low, high].map(|f| (f / resolution).round() as u32);
            (first..last).map(|k| f64::from(k) * resolution * 2.0 * PI)
        };
        let mut power = [0.0; 4];
        for seed in 1..60 {
            let ground = Ground::kanai_tajimi(seed, 1.0, 8.0);
            let window: Vec<f64> = ground.samples[400..1400].to_vec();
            let scale: f64 = window.iter().map(|x| x * x).sum();
            for (power, band) in power.iter_mut().zip(bands) {
                for omega in lines(band) {
                    let (mut s, mut c) = (0.0, 0.0);
                    for (k, x) in (0..1000_u32).zip(&window) {
                        let angle = omega * 5e-3 * f64::from(k);
                        s += x * angle.sin();
                        c += x * angle.cos();
                    }
                    *power += (s * s + c * c) / scale;
                }
            }
        }
        let expected = bands.map(|band| lines(band).map(formula).sum::<f64>());
        let [found, sum] = [power, expected].map(|shares| shares.iter().sum::<f64>());
        for ((power, expected), band) in power.iter().zip(expected).zip(bands) {
            let ratio = power / found / (expected / sum);
            assert!((ratio - 1.0).abs() < 0.12, "{band:?} Hz: {ratio}");
        }
    }

    #[test]
    fn a_wavelet_leaves_the_ground_at_rest() {
        let pulse = ricker(2.0, 1.5, 1.0);
        let h = 1e-3;
        let velocity: f64 = (0..2000).map(|k| h * pulse(f64::from(k) * h)).sum();
        assert!(velocity.abs() < 1e-6 && (pulse(1.0) - 2.0).abs() < 1e-15);
    }
}
