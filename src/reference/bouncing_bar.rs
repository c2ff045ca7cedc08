//! An elastic bar that falls on a wall, bounces and falls again.

/// A bar of unit section dropped from rest onto a wall, in the proportions of Doyen, Ern and Piperno (SIAM J. Sci.
/// Comput. 33, 2011, where the solution is a series).
///
/// There the flight between the two contacts of a period lasts three round trips of the waves. The bar leaves the
/// first contact, in which the force rises, with uniform speed and twice the strain of its weight, and returns in
/// that state; the second contact is the first one in reverse, after which the bar rises undeformed to its initial
/// height.
///
/// ```
/// use contact_dynamics::reference::BouncingBar;
/// let bar = BouncingBar::doyen();
/// assert!((bar.contact_force(1.2) - 360.0).abs() < 1e-9 && (bar.contact_force(3.7) - 490.0).abs() < 1e-9);
/// assert!((bar.height(2.0) - 5.0 / 3.0).abs() < 1e-9 && (bar.height(3.0) - 40.0 / 9.0).abs() < 1e-9);
/// assert_eq!(bar.contact_force(0.5), 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BouncingBar {
    young: f64,
    density: f64,
    length: f64,
    gravity: f64,
    drop: f64,
}

impl BouncingBar {
    /// L = 10, E = 900, ρ = 1, g = 10, h₀ = 5, unit section: c = 30, period 16/3.
    pub fn doyen() -> Self {
        Self { young: 900.0, density: 1.0, length: 10.0, gravity: 10.0, drop: 5.0 }
    }

    /// Young's modulus.
    pub fn young(&self) -> f64 {
        self.young
    }

    /// Density.
    pub fn density(&self) -> f64 {
        self.density
    }

    /// Length.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Acceleration of gravity.
    pub fn gravity(&self) -> f64 {
        self.gravity
    }

    /// Height of the lower end at the start.
    pub fn drop(&self) -> f64 {
        self.drop
    }

    fn wave_speed(&self) -> f64 {
        (self.young / self.density).sqrt()
    }

    /// Speed at the first touch.
    fn speed(&self) -> f64 {
        (2.0 * self.gravity * self.drop).sqrt()
    }

    /// Times of touch, release, touch and release in one period.
    pub fn events(&self) -> [f64; 4] {
        let (fall, contact) = (self.speed() / self.gravity, 2.0 * self.length / self.wave_speed());
        let flight = 2.0 * fall;
        [fall, fall + contact, fall + contact + flight, fall + 2.0 * contact + flight]
    }

    /// Period of the motion.
    pub fn period(&self) -> f64 {
        self.events()[3] + self.events()[0]
    }

    /// Force of the wall on the bar.
    pub fn contact_force(&self, t: f64) -> f64 {
        let [t1, t2, t3, t4] = self.events();
        let t = t.rem_euclid(self.period());
        let impedance = self.young / self.wave_speed();
        if t > t1 && t < t2 {
            impedance * (self.speed() + self.gravity * (t - t1))
        } else if t > t3 && t < t4 {
            impedance * (self.speed() + self.gravity * (t4 - t))
        } else {
            0.0
        }
    }

    /// Height of the lower end.
    pub fn height(&self, t: f64) -> f64 {
        let [t1, t2, t3, t4] = self.events();
        let t = t.rem_euclid(self.period());
        let (g, c, speed) = (self.gravity, self.wave_speed(), self.speed());
        let ballistic = |s: f64| speed * s - 0.5 * g * s * s;
        if t <= t1 {
            self.drop - 0.5 * g * t * t
        } else if t < t2 || (t3..t4).contains(&t) {
            0.0
        } else if t < t3 {
            // The bar leaves with uniform speed and twice the strain of its weight.
            let s = t - t2;
            let r = s.rem_euclid(2.0 * self.length / c);
            ballistic(s) + g * (r * r - 2.0 * self.length * r / c)
        } else {
            ballistic(t - t4)
        }
    }

    /// Total energy per section: elastic, kinetic and gravitational; constant in time.
    pub fn energy(&self) -> f64 {
        self.density * self.length * self.gravity * self.drop
    }
}

#[cfg(test)]
mod tests {
    use super::BouncingBar;

    #[test]
    fn heights_of_the_published_solution() {
        let bar = BouncingBar::doyen();
        for (t, height) in [(1.8, 0.533_333), (2.0, 1.666_667), (2.3333, 4.444_111), (3.0, 4.444_444), (4.5, 1.527_778)]
        {
            assert!((bar.height(t) - height).abs() < 1e-5, "{t}: {}", bar.height(t));
            assert!((bar.height(t + bar.period()) - height).abs() < 1e-5);
        }
        assert!((bar.period() - 16.0 / 3.0).abs() < 1e-14);
    }

    #[test]
    fn impulses_balance_the_weight() {
        let bar = BouncingBar::doyen();
        let n = 200_000;
        let step = bar.period() / f64::from(n);
        let impulse: f64 = (0..n).map(|k| bar.contact_force((f64::from(k) + 0.5) * step) * step).sum();
        assert!((impulse / (10.0 * 10.0 * bar.period()) - 1.0).abs() < 1e-5);
    }
}
