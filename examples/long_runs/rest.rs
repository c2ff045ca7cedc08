//! A bar at rest on a floor: nothing may change, step for step.

use crate::follow::{Followed, number};
use crate::{COURANT, ELEMENTS, Line, Scene};
use contact_dynamics::{Result, Simulation};
use contact_dynamics_scenes::combinations::Combination;
use contact_dynamics_scenes::wall_bar::WallBar;

pub(crate) fn scene() -> Scene {
    let head = ["error of the force", "drift/sag", "kinetic energy/elastic", "penetration/sag", "changes"];
    Scene {
        title: "A bar at rest on a floor".into(),
        head: head.map(String::from).into_iter().chain(Followed::heads()).collect(),
        run: resting,
    }
}

fn resting(row: &Combination, steps: u64) -> Result<Line> {
    let bar = WallBar { height: 0.0, ..WallBar::bouncing(ELEMENTS) };
    let transit = bar.element_size() / bar.wave_speed();
    let h = row.step(&bar.body(), COURANT * transit)?;
    let mass = row.mass(&bar.body(), h)?;
    let weights = mass.row_sums();
    let weight = bar.gravity * weights.iter().sum::<f64>();
    let rest = bar.rest_with(&weights);
    let sag = rest[ELEMENTS].abs();
    let mut run = Simulation::builder(bar.system_with(mass), row.integrator()?, h)
        .displacement(rest.clone())
        .constraint(bar.contact())
        .correctors(row.correctors(transit)?)
        .build()?;
    let (mut force, mut drift, mut deepest, mut kinetic) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let followed = Followed::run(&mut run, steps, |step, run| {
        let state = run.state();
        force = force.max((state.contacts().forces()[0] / weight - 1.0).abs());
        drift = drift.max((state.displacement()[ELEMENTS] - rest[ELEMENTS]).abs());
        deepest = deepest.max(-state.displacement()[0]);
        if step % 16 == 0 {
            let energy = run.energy();
            kinetic = kinetic.max(energy.kinetic / energy.potential.unwrap_or(f64::NAN));
        }
    })?;
    let numbers = [force, drift / sag, kinetic, deepest / sag];
    let cells = numbers.map(number).into_iter().chain([followed.changes.to_string()]).chain(followed.cells());
    let mut wrong = followed.wrong();
    if !numbers.iter().all(|x| *x < 1e-6) || followed.changes > 0 {
        wrong.push(format!("it does not rest: {numbers:?}, {} changes", followed.changes));
    }
    Ok(Line { cells: cells.collect(), wrong })
}
