//! The exact step of one mode whose force is linear in time (Nigam and Jennings, Bull. Seism. Soc. Am. 59, 1969).

/// `η̈ + c η̇ + k η = f` with f linear over a step h: the map from values at its start to those at its end, rows of η
/// and η̇.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ExactStep {
    /// Coefficients of η and η̇ at the start.
    pub(super) motion: [[f64; 2]; 2],
    /// Coefficients of f at the start and at the end.
    pub(super) force: [[f64; 2]; 2],
}

/// The response to a unit impulse, its rate, and its first two integrals, over a time h; in units of h.
///
/// `kept` equals `rate + damping · value`, but is computed separately because that sum loses digits with strong
/// damping.
#[derive(Clone, Copy, Debug)]
struct Impulse {
    stiffness: f64,
    /// Response to a unit initial displacement.
    kept: f64,
    rate: f64,
    value: f64,
    once: f64,
    twice: f64,
}

/// Below this value of c h + k h² the series converge within `TERMS`.
const SHORT: f64 = 0.5;
const TERMS: u32 = 20;

impl Impulse {
    /// From the power series about zero: the equation of motion gives the derivatives of the impulse response.
    fn series(damping: f64, stiffness: f64) -> Self {
        let (mut last, mut derivative) = (0.0, 1.0);
        let mut sums = Self { stiffness, kept: 0.0, rate: 0.0, value: 0.0, once: 0.0, twice: 0.0 };
        // 1/n! for the n-th derivative.
        let mut share = 1.0;
        for n in 1..TERMS {
            let n = f64::from(n);
            sums.rate += derivative * share;
            share /= n;
            sums.value += derivative * share;
            sums.once += derivative * share / (n + 1.0);
            sums.twice += derivative * share / ((n + 1.0) * (n + 2.0));
            (last, derivative) = (derivative, -damping * derivative - stiffness * last);
        }
        sums.kept = sums.rate + damping * sums.value;
        sums
    }

    /// Over twice the time, in units of the whole time: the second half starts from the state and the force at the
    /// end of the first half.
    fn doubled(self) -> Self {
        let after = |[value, rate]: [f64; 2]| self.kept * value + self.value * rate;
        let elastic = self.stiffness * self.value * self.value;
        Self {
            stiffness: 4.0 * self.stiffness,
            kept: self.kept * self.kept - elastic,
            rate: self.rate * self.rate - elastic,
            value: 0.5 * after([self.value, self.rate]),
            once: 0.25 * (after([self.once, self.value]) + self.once),
            twice: 0.125 * (after([self.twice, self.once]) + self.once + self.twice),
        }
    }
}

impl ExactStep {
    /// For a mode with damping c (1/time) and squared circular frequency k, both nonnegative.
    pub(super) fn new(damping: f64, stiffness: f64, h: f64) -> Self {
        let (mut c, mut k, mut doublings) = (damping * h, stiffness * h * h, 0);
        while c + k > SHORT {
            (c, k, doublings) = (0.5 * c, 0.25 * k, doublings + 1);
        }
        let mut impulse = Impulse::series(c, k);
        for _ in 0..doublings {
            impulse = impulse.doubled();
        }
        let Impulse { stiffness, kept, rate, value, once, twice, .. } = impulse;
        Self {
            motion: [[kept, h * value], [-stiffness * value / h, rate]],
            force: [[h * h * (once - twice), h * h * twice], [h * (value - once), h * once]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ExactStep;

    /// Displacement and velocity of `u'' + 2 ratio omega u' + omega² u = 0` after a time t.
    fn oscillator(omega: f64, ratio: f64, [u, v]: [f64; 2], t: f64) -> [f64; 2] {
        let (alpha, rate) = (ratio * omega, omega * ((1.0 - ratio) * (1.0 + ratio)).abs().sqrt());
        let (cosine, sine) = match rate * t {
            x if x <= 0.0 => (1.0, t),
            x if ratio < 1.0 => (x.cos(), x.sin() / rate),
            x => (x.cosh(), x.sinh() / rate),
        };
        let end = [u * cosine + (v + alpha * u) * sine, v * cosine - (omega * omega * u + alpha * v) * sine];
        end.map(|value| value * (-alpha * t).exp())
    }

    #[test]
    fn free_motion_is_that_of_an_oscillator() {
        for (omega, ratio) in [(0.0, 0.0), (1e-6, 0.0), (2.0, 0.0), (31.4, 0.0), (3.0, 0.3), (5.0, 1.0), (9.0, 40.0)] {
            let h = 0.1;
            let step = ExactStep::new(2.0 * ratio * omega, omega * omega, h);
            // Each doubling of the time doubles the rounding; strong damping takes eight of them.
            let rounding = if ratio > 1.0 { 1e-13 } else { 4e-15 };
            for (column, start) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                let [u, v] = oscillator(omega, ratio, start, h);
                assert!((step.motion[0][column] - u).abs() <= rounding, "{omega} {ratio}: {step:?} {u}");
                assert!(
                    (step.motion[1][column] - v).abs() <= rounding * omega.max(1.0),
                    "{omega} {ratio}: {step:?} {v}"
                );
            }
        }
    }

    #[test]
    fn forces_that_are_linear_are_met_exactly() {
        for (damping, stiffness) in [(0.0, 4.0), (0.6, 4.0), (0.0, 900.0), (80.0, 900.0), (30.0, 1e-9)] {
            let (h, [start, end]) = (0.1, [3.0, 5.0]);
            let step = ExactStep::new(damping, stiffness, h);
            // A motion a + b t with k a + c b + k b t = f.
            let b = (end - start) / (h * stiffness);
            let a = (start - damping * b) / stiffness;
            let at = |row: usize| {
                let [by_value, by_rate] = step.motion[row];
                let [by_start, by_end] = step.force[row];
                [by_value * a, by_rate * b, by_start * start, by_end * end]
            };
            for (row, exact) in [a + b * h, b].into_iter().enumerate() {
                let terms = at(row);
                let size = terms.iter().fold(0.0_f64, |sum, x| sum + x.abs());
                assert!((terms.iter().sum::<f64>() - exact).abs() <= 1e-14 * size, "{damping} {stiffness} {row}");
            }
        }
    }

    #[test]
    fn rigid_motions_have_the_step_of_a_mass() {
        let h = 0.25;
        let step = ExactStep::new(0.0, 0.0, h);
        assert_eq!(step.motion, [[1.0, h], [0.0, 1.0]]);
        let exact = [[h * h / 3.0, h * h / 6.0], [h / 2.0, h / 2.0]];
        for (row, exact) in step.force.iter().zip(exact) {
            assert!(row.iter().zip(exact).all(|(x, exact)| (x - exact).abs() < 1e-17), "{step:?}");
        }
    }
}
