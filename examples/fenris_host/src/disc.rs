//! A disc of fenris's own mesh is thrown at a floor, obliquely and with friction: momentum and energy.

use crate::elastic::{self, Body};
use crate::glue;
use crate::scene::Outcome;
use contact_dynamics::contact::Plane;
use contact_dynamics::{GeneralizedAlpha, LinearSystem, NodesOnObstacle, Simulation};
use contact_dynamics_scenes::solids::Material;
use fenris::geometry::sdf::SdfCircle;
use fenris::mesh::procedural::approximate_quad_mesh_for_sdf_2d;
use fenris::nalgebra::Vector2;
use std::fmt::Write;

const MATERIAL: Material = Material { young: 1e7, poisson: 0.3, density: 1000.0 };
const RADIUS: f64 = 0.1;
const HEIGHT: f64 = 0.01;
const VELOCITY: [f64; 2] = [2.0, -2.0];
const FRICTION: f64 = 0.2;
/// Time of the run in that a wave takes across the disc, and steps in that time for one element.
const END: f64 = 6.0;

/// What is measured.
#[derive(Debug)]
pub(crate) struct Figures {
    pub(crate) dofs: usize,
    pub(crate) steps: u64,
    pub(crate) most_closed: usize,
    /// Largest force over that of a slab of the same diameter.
    pub(crate) largest: f64,
    /// Normal impulse over m v: 1 for a plastic impact, 2 if all comes back.
    pub(crate) impulse: f64,
    /// Friction impulse over normal impulse.
    pub(crate) friction: f64,
    /// Change of momentum along x and y less impulses, over the normal impulse.
    pub(crate) closure: [f64; 2],
    /// Energy at the end, work of friction, corrections and scheme, over energy at the start.
    pub(crate) energies: [f64; 4],
}

pub(crate) fn report(cells: usize) -> Outcome<String> {
    let Figures { dofs, steps, most_closed, largest, impulse, friction, closure, energies } = run(cells)?;
    let mut text = format!("Disc: {dofs} dofs, {steps} steps, at most {most_closed} nodes at the floor\n");
    writeln!(
        text,
        "  largest force {largest:.3} of ρ c_p D v; impulse {impulse:.3} m v, friction {friction:.3} of it"
    )?;
    writeln!(text, "  momentum: {:.0e} (x) and {:.0e} (y) of the impulse do not close", closure[0], closure[1])?;
    let [end, rubbed, struck, scheme] = energies;
    writeln!(
        text,
        "  energy: {end:.4} of the start is left; \
         friction {rubbed:+.4}, impacts and corrections {struck:+.0e}, scheme {scheme:+.0e}"
    )?;
    Ok(text)
}

/// A disc with so many elements across.
pub(crate) fn run(cells: usize) -> Outcome<Figures> {
    let size = 2.0 * RADIUS / cells as f64;
    let circle = SdfCircle { radius: RADIUS, center: Vector2::new(0.0, RADIUS + HEIGHT) };
    let body = Body::new(&approximate_quad_mesh_for_sdf_2d(&circle, size), MATERIAL)?;
    let dofs = body.mass.nrows();
    let speed = (elastic::wave_modulus(&MATERIAL) / MATERIAL.density).sqrt();
    let (transit, h) = (2.0 * RADIUS / speed, 0.5 * size / speed);
    let floor = Plane::new([0.0, 0.0], [0.0, 1.0])?;
    let nodes = glue::node_dofs(body.nodes.len());
    let contact = NodesOnObstacle::new(floor, &body.nodes, &nodes, &body.boundary)?.friction(FRICTION);
    let direction = |axis: usize| -> Vec<f64> { (0..dofs).map(|dof| f64::from(u8::from(dof % 2 == axis))).collect() };
    let directions = [direction(0), direction(1)];
    let mut run =
        Simulation::builder(LinearSystem::new(body.mass, body.stiffness)?, GeneralizedAlpha::chung_hulbert(0.8)?, h)
            .velocity((0..dofs).map(|dof| VELOCITY[dof % 2]).collect())
            .constraint(contact)
            .energy_balance()
            .build()?;

    let before = [run.momentum(&directions[0])?, run.momentum(&directions[1])?];
    let start = run.energy().total();
    let (mut normal, mut rubbed, mut largest, mut most_closed) = (0.0, 0.0, 0.0_f64, 0);
    while run.time() < HEIGHT / -VELOCITY[1] + END * transit {
        run.step()?;
        let contacts = run.state().contacts();
        normal += contacts.impulses().iter().sum::<f64>();
        rubbed += (0..contacts.ids().len()).flat_map(|index| contacts.friction_impulses(index)).sum::<f64>();
        largest = largest.max(contacts.forces().iter().sum());
        most_closed = most_closed.max(contacts.closed().iter().filter(|&&closed| closed).count());
    }
    let after = [run.momentum(&directions[0])?, run.momentum(&directions[1])?];
    let energy = run.energy();
    let works = energy.works.unwrap_or_default();
    Ok(Figures {
        dofs,
        steps: run.statistics().steps,
        most_closed,
        largest: largest / (MATERIAL.density * speed * 2.0 * RADIUS * -VELOCITY[1]),
        impulse: normal / before[1].abs(),
        friction: rubbed.abs() / normal,
        closure: [after[0] - before[0] - rubbed, after[1] - before[1] - normal].map(|miss| (miss / normal).abs()),
        energies: [energy.total(), works.friction, works.impacts + works.corrections, works.remainder]
            .map(|energy| energy / start),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn momentum_closes_and_energy_is_spent_by_friction_and_impact() {
        let figures = run(12).unwrap();
        assert!(figures.closure.iter().all(|&miss| miss < 1e-9), "{figures:?}");
        // It comes back, with less than it had; what slides all the time rubs with μ.
        assert!(figures.impulse > 1.5 && figures.impulse < 2.0, "{figures:?}");
        assert!(figures.friction <= FRICTION * (1.0 + 1e-9) && figures.friction > 0.1 * FRICTION, "{figures:?}");
        let [end, rubbed, struck, scheme] = figures.energies;
        assert!(rubbed < 0.0 && struck < 0.0 && scheme < 0.01, "{figures:?}");
        assert!(end < 1.0 && end > 0.5, "{figures:?}");
    }
}
