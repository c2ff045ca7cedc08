//! The response of one degree of freedom, free and to a harmonic force.

/// Free response `[u, v, a]` at the time `t` of `u'' + 2 xi omega u' + omega² u = 0` from `u(0) = u0`, `u'(0) = v0`.
///
/// `omega >= 0` is the undamped natural frequency in radians per unit of time and `xi >= 0` the damping ratio:
/// underdamped below one, critically damped at one, overdamped above. The formula has no cancellation near one.
/// `omega = 0` gives uniform motion.
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
/// It is the steady response plus the [free response](single_oscillator) to the remaining initial values. Undamped
/// resonance is solved exactly; near it the two parts cancel, and the relative error grows as `f64::EPSILON omega /
/// |omega - frequency|`.
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

    fn close(value: f64, expected: f64, tolerance: f64) {
        let error = (value - expected).abs();
        assert!(error <= tolerance, "{value} instead of {expected}");
    }

    fn samples(count: u32) -> impl Iterator<Item = f64> {
        (0..=count).map(move |k| f64::from(k) / f64::from(count))
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
        close(single_oscillator(2.0, 0.0, 1.0, 0.0, 0.3)[0], 0.6_f64.cos(), 1e-15);
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
        // A step load on an undamped oscillator overshoots to twice the static displacement.
        let step = HarmonicForce { frequency: 0.0, cosine: 4.0, sine: 0.0 };
        close(forced_oscillator(2.0, 0.0, step, 0.0, 0.0, std::f64::consts::FRAC_PI_2)[0], 2.0, 1e-15);
    }
}
