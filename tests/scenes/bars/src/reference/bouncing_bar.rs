//! An elastic bar that falls on a wall, bounces and falls again.

/// A bar of unit section dropped from rest onto a wall, in the proportions of Doyen, Ern and Piperno (SIAM J. Sci.
/// Comput. 33, 2011, where the solution is a series).
///
/// There the flight between the two contacts of a period lasts three round trips of the waves. The bar leaves the
/// first contact, in which the force rises, with uniform speed and twice the strain of its weight, and returns in
/// that state; the second contact is the first one in reverse, after which the bar rises undeformed to its initial
/// height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BouncingBar {
    pub young: f64,
    pub density: f64,
    pub length: f64,
    pub gravity: f64,
    /// Height of the lower end at the start.
    pub drop: f64,
}

impl BouncingBar {
    /// L = 10, E = 900, ρ = 1, g = 10, h₀ = 5, unit section: c = 30, period 16/3.
    pub fn doyen() -> Self {
        Self { young: 900.0, density: 1.0, length: 10.0, gravity: 10.0, drop: 5.0 }
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

    /// Total energy per section: elastic, kinetic and gravitational; constant in time.
    pub fn energy(&self) -> f64 {
        self.density * self.length * self.gravity * self.drop
    }
}

#[cfg(test)]
mod tests {
    use super::BouncingBar;

    #[test]
    fn forces_of_the_published_solution() {
        let bar = BouncingBar::doyen();
        for (t, force) in [(0.5, 0.0), (1.2, 360.0), (2.5, 0.0), (3.7, 490.0)] {
            assert!((bar.contact_force(t) - force).abs() < 1e-9, "{t}: {}", bar.contact_force(t));
            assert!((bar.contact_force(t + bar.period()) - force).abs() < 1e-9);
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
