//! An elastic body on a slope below its angle of friction, which trembles a little without damping: it may not creep.

use crate::follow::{Followed, number};
use crate::{COURANT, ELEMENTS, Line, Scene};
use contact_dynamics::{ContactLaw, Result, Simulation};
use contact_dynamics_scenes::combinations::Combination;
use contact_dynamics_scenes::slabs::Slab;
use example_support::output::decimal;

const GRAVITY: f64 = 10.0;
/// Its tangent is 0.255; that of the angle of friction is 0.3.
const SLOPE: f64 = 0.25;
/// By how much it is compressed and sheared beyond the static balance at the start.
const TREMBLE: f64 = 0.01;

pub(crate) fn scene() -> Scene {
    let head = ["creep/sag", "penetration/sag", "energy of the tremor", "highest", "friction/force, most", "changes"];
    Scene {
        title: "A body that trembles on a slope below its angle of friction".into(),
        head: head.map(String::from).into_iter().chain(Followed::heads()).collect(),
        run: staying,
    }
}

fn staying(row: &Combination, steps: u64) -> Result<Line> {
    // Dofs 0 and 1 stand on the slope: off it and along it.
    let slab = Slab::thrown(ELEMENTS, 0.0);
    let (body, size) = (slab.body(), slab.length / ELEMENTS as f64);
    let h = row.step(&body, COURANT * size / slab.speeds[0])?;
    let mass = row.mass(&body, h)?;
    let weights = mass.row_sums();
    let pull = [-GRAVITY * SLOPE.cos(), GRAVITY * SLOPE.sin()];
    let rest = rest(&slab, &weights, pull);
    let loads: Vec<f64> = weights.iter().enumerate().map(|(dof, m)| m * pull[dof % 2]).collect();
    let system = mass.system(body.stiffness.clone())?;
    let mut run = Simulation::builder(system.load(move |_, f| f.copy_from_slice(&loads)), row.integrator()?, h)
        .displacement(rest.iter().map(|u| (1.0 + TREMBLE) * u).collect())
        .constraint(slab.wall(ContactLaw::Rigid, 0.0))
        .correctors(row.correctors(size / slab.speeds[0])?)
        .build()?;
    let sag = rest[2 * ELEMENTS].abs();
    // The energy of what is beyond the static balance.
    let stiffness = |k: usize| slab.density * slab.speeds[k] * slab.speeds[k] / size;
    let tremor = |run: &mut Simulation<'static, f64>| {
        let kinetic = run.energy().kinetic;
        let u = run.state().displacement();
        let off = |dof: usize| u[dof] - rest[dof];
        let stretch = |dof: usize| 0.5 * stiffness(dof % 2) * (off(dof + 2) - off(dof)).powi(2);
        kinetic + (0..2 * ELEMENTS).map(stretch).sum::<f64>()
    };
    let start = tremor(&mut run);
    let (mut creep, mut deepest, mut highest, mut share) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let followed = Followed::run(&mut run, steps, |step, run| {
        let (state, contacts) = (run.state(), run.state().contacts());
        creep = creep.max(state.displacement()[1].abs());
        deepest = deepest.max(-state.displacement()[0]);
        share = share.max(contacts.friction_forces(0)[0].abs() / contacts.forces()[0]);
        if step % 16 == 0 {
            highest = highest.max(tremor(run) / start);
        }
    })?;
    let numbers = [creep / sag, deepest / sag];
    let of_one = [tremor(&mut run) / start, highest, share].map(|x| decimal(x, 4));
    let cells = numbers.map(number).into_iter().chain(of_one).chain([followed.changes.to_string()]);
    let cells = cells.chain(followed.cells());
    let mut wrong = followed.wrong();
    if !(numbers[0] < 1e-9 && numbers[1] < 1e-9) || followed.changes > 0 {
        wrong.push(format!("it does not stay: {numbers:?}, {} changes", followed.changes));
    }
    Ok(Line { cells: cells.collect(), wrong })
}

/// The static balance: every element carries what is above it.
fn rest(slab: &Slab, weights: &[f64], pull: [f64; 2]) -> Vec<f64> {
    let size = slab.length / slab.elements as f64;
    let mut u = vec![0.0; weights.len()];
    for dof in 0..weights.len() - 2 {
        let k = dof % 2;
        let above: f64 = weights.iter().skip(dof + 2).step_by(2).sum();
        u[dof + 2] = u[dof] + pull[k] * above * size / (slab.density * slab.speeds[k] * slab.speeds[k]);
    }
    u
}
