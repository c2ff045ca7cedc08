//! Schemes and steps that cannot work.

use crate::{Anything, Row};
use contact_dynamics::tableau::{A, Rows, Stage, Tableau, U, V, Z};
use contact_dynamics::{CdLagrange, Error, Simulation, TimeIntegrator};
use contact_dynamics_scenes::Bars;

/// A scheme that moves by half the velocity.
#[derive(Debug)]
struct Slow;

impl TimeIntegrator for Slow {
    fn name(&self) -> String {
        "own scheme".into()
    }
    fn tableau(&self) -> Tableau {
        Tableau::single(Stage::new(Rows { u: U[0] + 0.5 * V[0] + 0.25 * Z, v: V[0] + 0.5 * (A[0] + Z), a: Z }))
    }
}

/// Energy over that at the start after 400 steps of the paper's bars, or why there is none.
fn fate(scheme: impl TimeIntegrator + 'static, courant: f64) -> Result<String, Anything> {
    let bars = Bars::paper(20);
    let h = courant * bars.element_size(0) / 100.0;
    // One node of a bar is struck.
    let v: Vec<f64> = (0..bars.dofs()).map(|dof| f64::from(u8::from(dof == 7))).collect();
    let mut run = match Simulation::builder(bars.system::<f64>(), scheme, h).velocity(v).build() {
        Err(Error::BeyondStability { largest, .. }) => return Ok(format!("refused: {h:.1e}, at most {largest:.1e}")),
        Err(Error::InconsistentScheme { .. }) => return Ok("refused: order 0".into()),
        Err(error) => return Err(error.into()),
        Ok(run) => run,
    };
    let before = run.energy().total();
    for _ in 0..400 {
        run.step()?;
    }
    Ok(format!("energy × {:.1e}", run.energy().total() / before))
}

pub(crate) fn cases(_quick: bool) -> Result<Vec<Row>, Anything> {
    Ok(vec![
        Row {
            case: "CD-Lagrange at Courant number 1.02, 400 steps".into(),
            before: "energy × 1.8e138",
            now: fate(CdLagrange, 1.02)?,
        },
        Row { case: "a tableau of order 0, 400 steps".into(), before: "energy × 8.5e-1", now: fate(Slow, 0.5)? },
    ])
}
