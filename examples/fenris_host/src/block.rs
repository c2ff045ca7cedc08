//! A neo-Hookean block lands on an edge at large strains: fenris assembles force and tangent in each Newton iteration.

use crate::glue;
use crate::hyperelastic::Hyperelastic;
use crate::scene::Outcome;
use contact_dynamics::contact::Plane;
use contact_dynamics::{EnergyMomentum, Newton, NodesOnObstacle, Simulation, StepControl, System, verify};
use contact_dynamics_scenes::solids::Material;
use fenris::mesh::procedural::create_rectangular_uniform_hex_mesh;
use fenris::nalgebra::{Rotation3, Vector3};
use std::fmt::Write;

/// Rubber.
const MATERIAL: Material = Material { young: 1e6, poisson: 0.4, density: 1000.0 };
/// Edge of the square base; the block is twice as tall.
const WIDTH: f64 = 0.05;
/// The block leans by this angle about y.
const LEAN: f64 = 0.4;
const HEIGHT: f64 = 0.002;
const SPEED: f64 = 4.0;
const STEP: f64 = 1e-4;
const END: f64 = 0.02;

/// What is measured.
#[derive(Debug)]
pub(crate) struct Figures {
    pub(crate) dofs: usize,
    pub(crate) elements: usize,
    pub(crate) steps: u64,
    pub(crate) iterations: f64,
    /// The largest error of fenris's tangent and potential against differences of its force.
    pub(crate) tangent: f64,
    /// The smallest ratio of heights, present over initial.
    pub(crate) shortest: f64,
    /// Vertical impulse over m v, and what does not close of the momenta, over the impulse.
    pub(crate) impulse: f64,
    pub(crate) closure: [f64; 3],
    /// Energy at the end (that of the height included), what was lost in steps in which contacts closed or opened, and
    /// the largest change in all other steps, over the energy at the start.
    pub(crate) energies: [f64; 3],
}

pub(crate) fn report(cells: usize) -> Outcome<String> {
    let Figures { dofs, elements, steps, iterations, tangent, shortest, impulse, closure, energies } = run(cells)?;
    let mut text =
        format!("Block: {elements} hexahedra, {dofs} dofs, {steps} steps, {iterations:.1} iterations a step\n");
    writeln!(text, "  verify::tangent: fenris's tangent and energy differ from its force by {tangent:.0e}")?;
    writeln!(text, "  the block is squeezed to {shortest:.2} of its height; impulse {impulse:.3} m v")?;
    let worst = closure.into_iter().fold(0.0, f64::max);
    writeln!(text, "  momentum: at most {worst:.0e} of the impulse does not close along x, y and z")?;
    let [end, landings, drift] = energies;
    writeln!(
        text,
        "  energy: {end:.4} of the start is left; steps in which contacts close or open change it by {landings:+.4},\n  \
         all others by {drift:.0e} at most"
    )?;
    Ok(text)
}

/// The block above the floor, with so many elements along its width.
fn block(cells: usize) -> contact_dynamics::Result<Hyperelastic> {
    let mut mesh = create_rectangular_uniform_hex_mesh(WIDTH, 1, 1, 2, cells);
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), LEAN);
    mesh.transform_vertices(|vertex| *vertex = turn * *vertex);
    let lowest = mesh.vertices().iter().fold(f64::INFINITY, |low, vertex| low.min(vertex.z));
    mesh.translate(&Vector3::new(0.0, 0.0, HEIGHT - lowest));
    Hyperelastic::new(mesh, MATERIAL, [0.0, 0.0, -9.81])
}

/// The worst error of the tangent, of the block of fewest elements in a state with strains of some percent.
fn tangent() -> contact_dynamics::Result<f64> {
    let mut block = block(1)?;
    let u: Vec<_> = (0..block.dofs()).map(|dof| 0.1 * WIDTH * (1.7 * dof as f64).sin()).collect();
    let v = vec![0.0; u.len()];
    verify::tangent(&mut block, 0.0, &u, &v, 1e-5 * WIDTH, 1.0).map(|error| error.largest())
}

pub(crate) fn run(cells: usize) -> Outcome<Figures> {
    let mut block = block(cells)?;
    let (dofs, elements) = (block.dofs(), block.mesh.connectivity().len());
    let nodes = glue::coordinates::<3, _, _>(&block.mesh);
    let boundary = block.mesh.find_boundary_vertices();
    let mut weight = vec![0.0; dofs];
    block.external_load(0.0, &mut weight)?;
    let pull: f64 = weight.iter().sum();
    let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0])?;
    let contact = NodesOnObstacle::new(floor, &nodes, &glue::node_dofs(nodes.len()), &boundary)?;
    let mut run = Simulation::builder(block, EnergyMomentum, STEP)
        .velocity((0..dofs).map(|dof| if dof % 3 == 2 { -SPEED } else { 0.0 }).collect())
        .constraint(contact)
        .newton(Newton::full().tolerances(1e-12, 1e-11)?)
        .step_control(StepControl::halving(STEP / 64.0)?)
        .build()?;

    let direction = |axis: usize| -> Vec<f64> { (0..dofs).map(|dof| f64::from(u8::from(dof % 3 == axis))).collect() };
    let directions: [Vec<f64>; 3] = std::array::from_fn(direction);
    let momenta = |run: &Simulation<'_, f64>| -> contact_dynamics::Result<[f64; 3]> {
        Ok([run.momentum(&directions[0])?, run.momentum(&directions[1])?, run.momentum(&directions[2])?])
    };
    let height = |u: &[f64]| {
        let z = || nodes.iter().zip(u.chunks(3)).map(|(node, u)| node[2] + u[2]);
        z().fold(f64::NEG_INFINITY, f64::max) - z().fold(f64::INFINITY, f64::min)
    };
    let energy = |run: &mut Simulation<'_, f64>| {
        let lifted: f64 = weight.iter().zip(run.state().displacement()).map(|(w, u)| w * u).sum();
        run.energy().total() - lifted
    };
    let (before, start, tall) = (momenta(&run)?, energy(&mut run), height(&vec![0.0; dofs]));
    let (mut impulse, mut shortest, mut now, mut landings, mut drift) = (0.0, 1.0_f64, start, 0.0, 0.0_f64);
    while run.time() < END - 1e-9 * STEP {
        let closed = run.state().contacts().closed().to_vec();
        run.step()?;
        let change = energy(&mut run) - now;
        now += change;
        match closed == run.state().contacts().closed() {
            true => drift = drift.max(change.abs()),
            false => landings += change,
        }
        impulse += run.state().contacts().impulses().iter().sum::<f64>();
        shortest = shortest.min(height(run.state().displacement()) / tall);
    }
    let after = momenta(&run)?;
    let pushed = [0.0, 0.0, impulse + pull * run.time()];
    let statistics = run.statistics();
    Ok(Figures {
        dofs,
        elements,
        steps: statistics.steps,
        iterations: statistics.newton_iterations as f64 / statistics.steps as f64,
        tangent: tangent()?,
        shortest,
        impulse: impulse / before[2].abs(),
        closure: std::array::from_fn(|axis| ((after[axis] - before[axis] - pushed[axis]) / impulse).abs()),
        energies: [now, landings, drift].map(|energy| energy / start),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use contact_dynamics::Error;

    #[test]
    fn momentum_and_energy_of_a_block_at_large_strains() {
        let figures = run(1).unwrap();
        assert!(figures.tangent < 1e-7, "{figures:?}");
        assert!(figures.shortest < 0.95, "it is squeezed: {figures:?}");
        assert!(figures.closure.iter().all(|&miss| miss < 1e-7), "{figures:?}");
        // The scheme conserves; what is lost, impact has taken.
        let [end, landings, drift] = figures.energies;
        assert!(drift < 1e-9 && landings < 0.0 && end < 1.0, "{figures:?}");
    }

    /// A state that fenris would panic for is refused, so that a smaller step may help.
    #[test]
    fn elements_turned_inside_out_are_inadmissible() {
        let mut block = block(1).unwrap();
        let top = block.mesh.vertices().iter().map(|vertex| vertex.z).fold(f64::NEG_INFINITY, f64::max);
        let u: Vec<_> =
            block.mesh.vertices().iter().flat_map(|vertex| [0.0, 0.0, -3.0 * vertex.z / top * WIDTH]).collect();
        let (v, mut out) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        let refused = block.force(0.0, &u, &v, &mut out);
        assert!(matches!(refused, Err(Error::Inadmissible { callback: "force", .. })), "{refused:?}");
        let mut values = vec![0.0; block.pattern().row_idx().len()];
        let weights = contact_dynamics::TangentWeights::new(1.0, 0.0);
        let refused = block.tangent(0.0, &u, &v, weights, &mut values);
        assert!(matches!(refused, Err(Error::Inadmissible { callback: "tangent", .. })), "{refused:?}");
    }
}
