//! Materials by name or by their constants.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// An isotropic material in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Young's modulus (Pa).
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Density (kg/m³).
    pub density: f64,
}

/// Usual values at room temperature.
const KNOWN: [(&str, Material); 8] = [
    ("steel", Material { young: 210e9, poisson: 0.3, density: 7850.0 }),
    ("aluminum", Material { young: 70e9, poisson: 0.33, density: 2700.0 }),
    ("copper", Material { young: 120e9, poisson: 0.34, density: 8960.0 }),
    ("titanium", Material { young: 114e9, poisson: 0.34, density: 4430.0 }),
    ("glass", Material { young: 70e9, poisson: 0.22, density: 2500.0 }),
    ("abs", Material { young: 2.2e9, poisson: 0.37, density: 1050.0 }),
    ("nylon", Material { young: 2.8e9, poisson: 0.39, density: 1140.0 }),
    // Compressible enough for elements that lock where the volume cannot change.
    ("rubber", Material { young: 5e6, poisson: 0.45, density: 1100.0 }),
];

impl Material {
    /// Lamé's λ and μ.
    pub fn lame(&self) -> [f64; 2] {
        let Self { young, poisson, .. } = *self;
        [young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson))]
    }

    /// Speed of dilatational waves (m/s).
    pub fn wave_speed(&self) -> f64 {
        let [lambda, mu] = self.lame();
        ((lambda + 2.0 * mu) / self.density).sqrt()
    }
}

impl fmt::Display for Material {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match KNOWN.iter().find(|(_, known)| known == self) {
            Some((name, _)) => f.write_str(name),
            None => write!(f, "E={:e},nu={},rho={}", self.young, self.poisson, self.density),
        }
    }
}

impl FromStr for Material {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((_, material)) = KNOWN.iter().find(|(name, _)| name.eq_ignore_ascii_case(text)) {
            return Ok(*material);
        }
        if !text.contains('=') {
            let names: Vec<_> = KNOWN.iter().map(|(name, _)| *name).collect();
            return Err(format!(
                "unknown material: take one of {}, or E=2.1e11,nu=0.3,rho=7850 (SI)",
                names.join(", ")
            ));
        }
        let mut found = [None; 3];
        for part in text.split(',') {
            let (name, value) = part.split_once('=').ok_or(format!("`{part}` is no NAME=VALUE"))?;
            let place = match name.trim() {
                "E" => 0,
                "nu" => 1,
                "rho" => 2,
                other => return Err(format!("`{other}` is no constant of a material: give E, nu and rho")),
            };
            found[place] = Some(value.trim().parse::<f64>().map_err(|error| format!("`{part}`: {error}"))?);
        }
        let [Some(young), Some(poisson), Some(density)] = found else {
            return Err("a material needs E (Pa), nu and rho (kg/m³), as in E=2.1e11,nu=0.3,rho=7850".into());
        };
        let positive = |x: f64| x > 0.0 && x.is_finite();
        match positive(young) && positive(density) && (0.0..0.5).contains(&poisson) {
            true => Ok(Self { young, poisson, density }),
            false => Err(format!(
                "E = {young}, nu = {poisson}, rho = {density}: E and rho are positive, nu from 0 to below 0.5"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_are_read_and_bad_ones_refused() {
        let own: Material = "E=1e9, rho=900, nu=0".parse().unwrap();
        assert_eq!(own, Material { young: 1e9, poisson: 0.0, density: 900.0 });
        assert!((own.wave_speed() / (1e9_f64 / 900.0).sqrt() - 1.0).abs() < 1e-15);
        for (text, reason) in [
            ("stel", "take one of steel"),
            ("E=1,nu=0.5,rho=1", "below 0.5"),
            ("E=-1,nu=0.2,rho=1", "positive"),
            ("E=NaN,nu=0.2,rho=1", "positive"),
            ("E=1,nu=0.2", "rho"),
            ("E=1,nu=0.2,mu=3", "no constant"),
            ("E=x,nu=0.2,rho=3", "E=x"),
        ] {
            let error = text.parse::<Material>().unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }

    #[test]
    fn every_known_material_is_read_as_it_is_shown() {
        for (name, material) in KNOWN {
            assert_eq!(material.to_string(), name);
            assert_eq!(name.parse(), Ok(material));
        }
    }
}
