//! A slab in plane strain flies against a wall, its sides held: strain along one direction alone, so that the force is
//! known, F = ρ c_p A v with c_p = √((λ + 2μ)/ρ) while the wave runs to the far end and back.

use crate::elastic::{self, Body};
use crate::glue;
use crate::scene::Outcome;
use contact_dynamics::contact::Plane;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{
    Corrector, GeneralizedAlpha, LinearSystem, Mass, Newmark, NodesOnObstacle, PersistencyCorrection, Preset,
    Simulation, TimeIntegrator, mass,
};
use contact_dynamics_scenes::reference::{Bar, CollidingBars};
use contact_dynamics_scenes::solids::Material;
use fenris::mesh::procedural::create_rectangular_uniform_quad_mesh_2d;
use fenris::nalgebra::Vector2;
use std::fmt::Write;

const MATERIAL: Material = Material { young: 1e9, poisson: 0.3, density: 1000.0 };
const HEIGHT: f64 = 0.1;
/// Length over height.
const SQUARES: usize = 10;
const SPEED: f64 = 1.0;
/// Time before the impact, and of the run, over the time that a wave takes from end to end.
const APPROACH: f64 = 0.5;
const END: f64 = 3.5;
/// Waves along an element in a step.
const COURANT: f64 = 0.5;

/// Scheme, mass and correction of a line.
struct Choice {
    name: &'static str,
    integrator: Box<dyn TimeIntegrator>,
    mass: SparseColMat<usize, f64>,
    correctors: Vec<Box<dyn Corrector<f64>>>,
}

/// What is measured.
#[derive(Debug)]
pub(crate) struct Figures {
    /// Error of the force while the bodies touch, largest force, both over the exact one.
    pub(crate) rms: f64,
    pub(crate) largest: f64,
    /// Change of momentum less impulse, over the impulse.
    pub(crate) closure: f64,
    /// Energy at the end over that at the start.
    pub(crate) energy: f64,
}

/// A slab with so many elements across.
pub(crate) fn report(across: usize) -> Outcome<String> {
    let (body, wall) = slab(across)?;
    let mut text = format!(
        "Slab: {} dofs, {} nodes at the wall\n\n| scheme, mass and correction | force RMS | max F/F0 | momentum \
         | E end/start |\n| --- | --- | --- | --- | --- |\n",
        body.mass.nrows(),
        wall.len(),
    );
    for choice in choices(&body, &wall, across)? {
        let name = choice.name;
        let Figures { rms, largest, closure, energy } = run(&body, &wall, across, choice)?;
        writeln!(text, "| {name} | {rms:.3} | {largest:.3} | {closure:.0e} | {energy:.4} |")?;
    }
    Ok(text)
}

fn length() -> f64 {
    SQUARES as f64 * HEIGHT
}

fn wave_speed() -> f64 {
    (elastic::wave_modulus(&MATERIAL) / MATERIAL.density).sqrt()
}

fn step(across: usize) -> f64 {
    COURANT * HEIGHT / (across as f64 * wave_speed())
}

/// The body, and its nodes that face the wall.
fn slab(across: usize) -> Outcome<(Body, Vec<usize>)> {
    let mesh = create_rectangular_uniform_quad_mesh_2d(HEIGHT, SQUARES, 1, across, &Vector2::new(0.0, HEIGHT));
    let body = Body::new(&mesh, MATERIAL)?;
    let wall = body.boundary.iter().copied().filter(|&node| body.nodes[node][0] > length() * (1.0 - 1e-9)).collect();
    Ok((body, wall))
}

fn choices(body: &Body, wall: &[usize], across: usize) -> Outcome<Vec<Choice>> {
    let chung_hulbert =
        || -> contact_dynamics::Result<Box<dyn TimeIntegrator>> { Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.8)?)) };
    let preset = Preset::smooth();
    let normal: Vec<_> = wall.iter().map(|node| 2 * node).collect();
    let groups: Vec<_> = (0..body.mass.nrows()).map(|dof| dof % 2).collect();
    let massless = |courant| preset.mass(body.mass.as_ref(), body.stiffness.symbolic(), &normal, &groups, courant);
    // The estimate from M and K alone also counts the stiffness against shear, which nothing strains here.
    let consistent = Mass::Consistent(body.mass.as_ref());
    let estimate = mass::courant(consistent, body.stiffness.as_ref(), step(across))?[normal[0]];
    let lumped = mass::lump(body.mass.as_ref())?;
    let lumped: Vec<_> = lumped.iter().enumerate().map(|(dof, &m)| Triplet::new(dof, dof, m)).collect();
    let lumped = SparseColMat::try_new_from_triplets(lumped.len(), lumped.len(), &lumped)?;
    let corrected =
        || -> Vec<Box<dyn Corrector<f64>>> { vec![Box::new(PersistencyCorrection::with_history_projection())] };
    let choice = |name, integrator, mass, correctors| Choice { name, integrator, mass, correctors };
    Ok(vec![
        choice("trapezoidal, consistent, none", Box::new(Newmark::trapezoidal()), body.mass.clone(), Vec::new()),
        choice("Chung–Hulbert 0.8, consistent, λ_v/λ_a", chung_hulbert()?, body.mass.clone(), corrected()),
        choice("Chung–Hulbert 0.8, lumped, λ_v/λ_a", chung_hulbert()?, lumped, corrected()),
        choice("`Preset::smooth()`", preset.integrator(), massless(COURANT)?, preset.correctors()),
        choice("the same by `mass::courant`", preset.integrator(), massless(estimate)?, preset.correctors()),
    ])
}

fn run(body: &Body, wall: &[usize], across: usize, choice: Choice) -> Outcome<Figures> {
    let (transit, dofs) = (length() / wave_speed(), body.mass.nrows());
    let gap = APPROACH * transit * SPEED;
    // The sides are held: no displacement across.
    let system = LinearSystem::new(choice.mass, body.stiffness.clone())?;
    let system = (1..dofs).step_by(2).try_fold(system, LinearSystem::fix)?;
    let obstacle = Plane::new([length() + gap, 0.0], [-1.0, 0.0])?;
    let contact = NodesOnObstacle::new(obstacle, &body.nodes, &glue::node_dofs(body.nodes.len()), wall)?;
    let along: Vec<_> = (0..dofs).map(|dof| f64::from(u8::from(dof % 2 == 0))).collect();
    let mut run = Simulation::builder(system, choice.integrator, step(across))
        .velocity(along.iter().map(|along| SPEED * along).collect())
        .constraint(contact)
        .correctors(choice.correctors)
        .build()?;

    let density = MATERIAL.density;
    let bar = Bar { young: elastic::wave_modulus(&MATERIAL), density, area: HEIGHT, length: length(), velocity: SPEED };
    let exact = CollidingBars::against_wall(bar, gap, END * transit * 1.1)?;
    let plateau = density * wave_speed() * HEIGHT * SPEED;
    let (start, momentum) = (run.energy().total(), run.momentum(&along)?);
    let (mut squares, mut count, mut largest, mut impulse) = (0.0, 0.0, 0.0_f64, 0.0);
    while run.time() < END * transit {
        run.step()?;
        let (contacts, expected) = (run.state().contacts(), exact.contact_force(run.time()));
        let force: f64 = contacts.forces().iter().sum();
        impulse += contacts.impulses().iter().sum::<f64>();
        largest = largest.max(force / plateau);
        if expected > 0.0 {
            squares += (force / plateau - 1.0).powi(2);
            count += 1.0;
        }
    }
    let closure = ((momentum - run.momentum(&along)?) / impulse - 1.0).abs();
    Ok(Figures { rms: f64::sqrt(squares / count), largest, closure, energy: run.energy().total() / start })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The force is that of the wave, momentum is that of the force, and waves lose nothing.
    #[test]
    fn the_force_is_that_of_the_wave() {
        let (body, wall) = slab(3).unwrap();
        // The matrices are those of the body: mass, and no force in a rigid motion.
        let total: f64 = body.mass.as_ref().val().iter().sum();
        let expected = 2.0 * MATERIAL.density * HEIGHT * length();
        assert!((total / expected - 1.0).abs() < 1e-12, "{total}");
        let figures: Vec<_> =
            choices(&body, &wall, 3).unwrap().into_iter().map(|choice| run(&body, &wall, 3, choice).unwrap()).collect();
        let [raw, consistent, lumped, smooth, estimated] = &figures[..] else { panic!("{figures:?}") };
        assert!(figures.iter().all(|figures| figures.closure < 1e-10), "{figures:?}");
        assert!(raw.rms > 1.0 && consistent.rms < 0.25, "{figures:?}");
        assert!(lumped.rms < 0.15 && smooth.rms < 0.13 && smooth.largest < 1.05 && estimated.rms < 0.15, "{figures:?}");
        // Impact costs the energy of the nodes that are stopped, 1/60 of this slab; none where they have no mass.
        assert!((lumped.energy - (1.0 - 1.0 / 60.0)).abs() < 5e-3, "{figures:?}");
        assert!((smooth.energy - 1.0).abs() < 5e-3, "{figures:?}");
    }
}
