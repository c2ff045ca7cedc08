//! Rows of a tableau over the past that is known: what comes from the past, and the weight of the unknown, dof by dof.

use super::{Motion, Scene};
use contact_dynamics::tableau::{ContactLevel, MAX_PAST, Row, Stage};

/// A quantity that is affine in the unknown z: `weight` z + `known`, dof by dof. (Prescribed dofs have no weight.)
#[derive(Clone, Debug)]
pub(crate) struct Affine {
    pub(crate) weight: Vec<f64>,
    pub(crate) known: Vec<f64>,
}

impl Affine {
    /// The row, which gives h^`power` times its quantity, as that quantity.
    pub(crate) fn new(row: &Row, power: i32, past: &[Motion], h: f64) -> Self {
        let n = past[0].u.len();
        let mut known = vec![0.0; n];
        for (k, motion) in past.iter().enumerate().take(MAX_PAST) {
            let [u, v, a] = row.past(k);
            for (i, known) in known.iter_mut().enumerate() {
                *known += u * motion.u[i] + v * h * motion.v[i] + a * h * h * motion.a[i];
            }
        }
        let unit = h.powi(power);
        known.iter_mut().for_each(|known| *known /= unit);
        Self { weight: vec![row.z / unit; n], known }
    }

    /// Puts prescribed dofs to where they are.
    pub(crate) fn prescribe(&mut self, scene: &Scene, t: f64, what: impl Fn([f64; 3]) -> f64) {
        if let Some((dof, motion)) = scene.driven(t) {
            self.weight[dof] = 0.0;
            self.known[dof] = what(motion);
        }
    }

    /// The quantity at z.
    pub(crate) fn at(&self, z: &[f64]) -> Vec<f64> {
        self.weight.iter().zip(&self.known).zip(z).map(|((w, known), z)| w * z + known).collect()
    }

    /// c₁ of one and c₂ of another.
    pub(crate) fn sum(&self, c1: f64, other: &Self, c2: f64) -> Self {
        let add = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| c1 * x + c2 * y).collect();
        Self { weight: add(&self.weight, &other.weight), known: add(&self.known, &other.known) }
    }
}

/// u, v and a of rows, with prescribed dofs in place.
pub(crate) fn motion(rows: [Row; 3], past: &[Motion], scene: &Scene, t: f64) -> [Affine; 3] {
    [(0, 0), (1, 1), (2, 2)].map(|(field, power)| {
        let mut affine = Affine::new(&rows[field], power, past, scene.h);
        affine.prescribe(scene, t, |motion| motion[field]);
        affine
    })
}

/// What contact constrains: displacements at a time, or velocities times h.
pub(crate) struct Target {
    pub(crate) values: Affine,
    pub(crate) t: f64,
    /// At velocity level the displacements by which contacts are forecast to be closed, and their time.
    pub(crate) forecast: Option<(Vec<f64>, f64)>,
}

/// Where a stage that starts a step at `t` imposes contact.
pub(crate) fn target(stage: &Stage, past: &[Motion], scene: &Scene, t: f64) -> Target {
    let h = scene.h;
    let [u, v, a] = stage.recovery.each();
    match stage.contact {
        ContactLevel::Velocity { lead, forecast, forecast_at } => {
            let there = t + (stage.end + lead) * h;
            let mut values = Affine::new(&(v + lead * a), 0, past, h);
            values.prescribe(scene, there, |motion| h * motion[1]);
            let mut forecast = Affine::new(&forecast, 0, past, h);
            forecast.prescribe(scene, t + forecast_at * h, |motion| motion[0]);
            Target { values, t: there, forecast: Some((forecast.known, t + forecast_at * h)) }
        }
        level => {
            let lead = level.lead();
            let there = t + (stage.end + lead) * h;
            let mut values = Affine::new(&(u + lead * v + (0.5 * lead * lead) * a), 0, past, h);
            values.prescribe(scene, there, |motion| motion[0]);
            Target { values, t: there, forecast: None }
        }
    }
}
