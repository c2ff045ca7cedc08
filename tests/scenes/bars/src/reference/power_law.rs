//! Impact of a mass on a spring with a power-law force: Hertz' impact and the linear spring.

/// A mass m that hits a spring F = k δ^p with speed v, and leaves it with the same speed.
///
/// Hertz' impact of two elastic spheres has p = 3/2 and k = 4/3 E* √R, with the effective m and R of the pair (1/m =
/// Σ 1/mᵢ). The duration is the integral of dδ/√(v² − 2k δ^{p+1}/((p+1) m)) there and back, in closed form with
/// Euler's beta function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLawImpact {
    /// m.
    pub mass: f64,
    /// k (force/length^p).
    pub stiffness: f64,
    /// p.
    pub exponent: f64,
    /// v, the speed of approach.
    pub velocity: f64,
}

impl PowerLawImpact {
    /// Largest compression: ½ m v² = k δ^{p+1}/(p+1).
    pub fn depth(&self) -> f64 {
        let Self { mass, stiffness, exponent, velocity } = *self;
        let power = exponent + 1.0;
        (0.5 * power * mass * velocity * velocity / stiffness).powf(power.recip())
    }

    /// Largest force.
    pub fn force(&self) -> f64 {
        self.stiffness * self.depth().powf(self.exponent)
    }

    /// Time from the first touch to the release: 2 δ_max/v · ∫₀¹ (1 − x^{p+1})^{−1/2} dx.
    pub fn duration(&self) -> f64 {
        2.0 * self.depth() / self.velocity * Self::shape(self.exponent + 1.0)
    }

    /// ∫₀¹ (1 − x^q)^{−1/2} dx, with x = 1 − s² to remove the singularity, by Gauss–Legendre panels.
    fn shape(q: f64) -> f64 {
        // Nodes and weights of five points on [−1, 1].
        let (inner, outer) =
            ((5.0 - 2.0 * (10.0_f64 / 7.0).sqrt()).sqrt() / 3.0, (5.0 + 2.0 * (10.0_f64 / 7.0).sqrt()).sqrt() / 3.0);
        let root = 13.0 * 70.0_f64.sqrt();
        let rule = [
            (0.0, 128.0 / 225.0),
            (inner, (322.0 + root) / 900.0),
            (-inner, (322.0 + root) / 900.0),
            (outer, (322.0 - root) / 900.0),
            (-outer, (322.0 - root) / 900.0),
        ];
        let integrand = |s: f64| {
            let x = 1.0 - s * s;
            // (1 − x^q)/s² without cancellation.
            let quotient = if s > 0.0 { -(q * x.ln()).exp_m1() / (s * s) } else { q };
            2.0 / quotient.sqrt()
        };
        let panels: usize = 64;
        let half = 0.5 / panels as f64;
        (0..panels)
            .map(|k| {
                let middle = (2 * k + 1) as f64 * half;
                rule.iter().map(|(x, w)| w * half * integrand(middle + half * x)).sum::<f64>()
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::PowerLawImpact;

    #[test]
    fn a_linear_spring_turns_a_mass_in_half_a_period() {
        let impact = PowerLawImpact { mass: 2.0, stiffness: 50.0, exponent: 1.0, velocity: 3.0 };
        assert!((impact.duration() / (std::f64::consts::PI / 5.0) - 1.0).abs() < 1e-9);
        assert!((impact.force() - 30.0).abs() < 1e-12);
    }

    #[test]
    fn hertz_constant() {
        // 4 √π Γ(2/5)/(5 Γ(9/10)).
        let impact = PowerLawImpact { mass: 1.0, stiffness: 1.0, exponent: 1.5, velocity: 1.0 };
        assert!((impact.duration() / impact.depth() - 2.943_275_184_3).abs() < 1e-8);
    }
}
