//! A number that distinguishes the rows of schemes.

use super::{ContactLevel, Stage, StageForce, Tableau};

impl Tableau {
    /// A hash of all coefficients, rounded to single precision: the same rows computed in another order give the same
    /// hash.
    pub(crate) fn fingerprint(&self) -> u32 {
        // FNV-1a.
        const OFFSET: u32 = 0x811c_9dc5;
        const PRIME: u32 = 0x0100_0193;
        let mut hash = OFFSET;
        for number in self.stages.iter().flat_map(numbers) {
            // The sum maps −0 to 0.
            #[expect(clippy::cast_possible_truncation, reason = "the rounding is meant")]
            let rounded = number as f32 + 0.0;
            for byte in rounded.to_le_bytes() {
                hash = (hash ^ u32::from(byte)).wrapping_mul(PRIME);
            }
        }
        hash
    }
}

/// All data of a stage.
fn numbers(stage: &Stage) -> Vec<f64> {
    let force = match stage.force {
        StageForce::AtBalance => 0.0,
        StageForce::AlongPath => 1.0,
    };
    let (level, forecast_at) = match stage.contact {
        ContactLevel::Position { .. } => (0.0, 0.0),
        ContactLevel::Velocity { forecast_at, .. } => (1.0, forecast_at),
    };
    let mut numbers = vec![stage.load, stage.end, force, level, stage.contact.lead(), forecast_at];
    for row in stage.rows() {
        numbers.push(row.z);
        numbers.extend(row.u.into_iter().chain(row.v).chain(row.a));
    }
    numbers
}

#[cfg(test)]
mod tests {
    use crate::integrator::{GeneralizedAlpha, Newmark, TimeIntegrator};

    #[test]
    fn other_rows_have_another_fingerprint() {
        let of = |scheme: &dyn TimeIntegrator| scheme.tableau().fingerprint();
        let rule = of(&Newmark::trapezoidal());
        assert_eq!(rule, of(&Newmark::new(0.25, 0.5).unwrap()));
        assert_ne!(rule, of(&Newmark::new(0.2501, 0.5).unwrap()));
        assert_ne!(rule, of(&GeneralizedAlpha::chung_hulbert(0.5).unwrap()));
        // Another order of operations, as a later version of a scheme may have.
        let mut tableau = Newmark::trapezoidal().tableau();
        tableau.stages[0].recovery.v.z += f64::EPSILON;
        tableau.stages[0].recovery.v.a[3] = -0.0;
        assert_eq!(rule, tableau.fingerprint());
    }
}
