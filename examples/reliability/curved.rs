//! Curved gaps: energy, and the work of contact, without friction.

use super::{Anything, Row};
use contact_dynamics::{
    CdLagrange, CentralDifference, Composite, EnergyMomentum, GeneralizedAlpha, MoreauJean, Newmark, TimeIntegrator,
};
use contact_dynamics_scenes::curved::Scene;

/// 600 steps of 0.01, raw: largest change of the energy on the way | work of contact, over the energy of the start.
pub(crate) fn cases(_: bool) -> Result<Vec<Row>, Anything> {
    let runs: [(Scene, Box<dyn TimeIntegrator>, &str, &str); 9] = [
        (Scene::Circle, Box::new(Newmark::trapezoidal()), "", "3.8e44 \\| 3.3e44"),
        (Scene::Circle, Box::new(Composite), "", "1.4e-1 \\| 6.8e-2"),
        (Scene::Circle, Box::new(GeneralizedAlpha::chung_hulbert(0.8)?), "", "7.1e-2 \\| 6.5e-2"),
        (Scene::Circle, Box::new(CentralDifference), "", "1.4e-1 \\| 6.8e-2"),
        (Scene::Bowl, Box::new(EnergyMomentum), "", "4.2e-2 \\| 4.2e-2"),
        (Scene::Dumbbell, Box::new(Composite), "", "2.7e-2 \\| 1.3e-2"),
        (Scene::Rod, Box::new(EnergyMomentum), "", "4.7e-2 \\| 4.7e-2"),
        (Scene::Circle, Box::new(MoreauJean::new(0.5)?), ", known failure", "5.4e-2 \\| -5.4e-2"),
        (Scene::Circle, Box::new(CdLagrange), ", known failure", "5.2e-2 \\| -1.0e-1"),
    ];
    let mut rows = Vec::new();
    for (scene, scheme, remark, before) in runs {
        let case = format!("{scene:?}, {}{remark}: energy \\| work of contact", scheme.name());
        let drift = scene.run(scheme, Vec::new(), 0.01)?;
        rows.push(Row { case, before, now: format!("{:.1e} \\| {:.1e}", drift.energy, drift.work) });
    }
    Ok(rows)
}
