//! An elastic ball that is thrown obliquely at a rough floor: Maw, Barber and Fawcett's problem (Wear 38, 1976).

use crate::rows::Table;
use contact_dynamics::contact::Plane;
use contact_dynamics::{Composite, ContactLaw, NodesOnObstacle, Result, Simulation};
use contact_dynamics_scenes::reference::PowerLawImpact;
use contact_dynamics_scenes::solids::{Material, Solid};
use std::f64::consts::PI;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
const RADIUS: f64 = 1.0;
const FRICTION: f64 = 0.3;

/// Contact radius by Hertz: small, for the ball turns while it is in contact, which linear elasticity does not know.
const CONTACT: f64 = 0.03;

/// 2 (1 − ν)/(μ (2 − ν)): what makes a quotient of velocities dimensionless.
fn unit() -> f64 {
    2.0 * (1.0 - MATERIAL.poisson) / (FRICTION * (2.0 - MATERIAL.poisson))
}

/// 7 (1 − ν)/(2 (2 − ν)).
fn chi() -> f64 {
    3.5 * (1.0 - MATERIAL.poisson) / (2.0 - MATERIAL.poisson)
}

pub(crate) fn tables(quick: bool) -> Vec<String> {
    let title = "Oblique impact of an elastic ball: dimensionless tangential velocity of the contact point before and \
                 after it; after gross slip of rigid bodies, the mesh and a ball; coefficient of restitution; \
                 tangential over normal impulse, over μ";
    let head = ["before", "after", "mesh that slides", "ball that slides", "restitution", "impulses"];
    let mut table = Table::new(title, &head);
    let before: &[f64] = if quick { &[6.0] } else { &[0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0] };
    for &psi in before {
        table.row(&[&psi.to_string()], [3; 5], vec![thrown(psi, quick)]);
    }
    vec![table.text()]
}

/// The numbers of a row.
fn thrown(psi: f64, quick: bool) -> Result<[f64; 5]> {
    let (across, cells) = if quick { (3.0, [9, 9, 14]) } else { (5.0, [12, 12, 20]) };
    let solid = Solid::half_ball(RADIUS, cells, CONTACT / across, MATERIAL);
    let mass = MATERIAL.density * 4.0 / 3.0 * PI * RADIUS.powi(3);
    let hertz = ContactLaw::hertz(MATERIAL.plane_modulus(), RADIUS);
    let ContactLaw::PowerLaw { stiffness, exponent } = hertz else { unreachable!("Hertz' law is a power law") };
    let depth = CONTACT * CONTACT / RADIUS;
    let speed = (depth.powf(2.5) * stiffness / (1.25 * mass)).sqrt();
    let exact = PowerLawImpact { mass, stiffness, exponent, velocity: speed };
    let along = psi / unit() * speed;
    let h = exact.duration() / 150.0;
    let mut system = solid.system::<f64>();
    for (node, place) in solid.nodes.iter().enumerate() {
        if place[1].abs() < 1e-12 {
            system = system.fix(3 * node + 1)?;
        }
    }
    let near = |&node: &usize| {
        let [x, y, z] = solid.nodes[node];
        z < 0.5 * RADIUS
            && x.hypot(y) < 4.0 * CONTACT
            && ((x * x + y * y + (z - RADIUS).powi(2)).sqrt() - RADIUS).abs() < 1e-9
    };
    let nodes: Vec<_> = solid.surface_nodes().into_iter().filter(near).collect();
    let floor = Plane::new([0.0, 0.0, -2.5 * h * speed], [0.0, 0.0, 1.0])?;
    let mut run = Simulation::builder(system, Composite, h)
        .velocity((0..solid.dofs()).map(|dof| [along, 0.0, -speed][dof % 3]).collect())
        .constraint(NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &nodes)?.friction(FRICTION))
        .build()?;
    while run.time() < 1.4 * exact.duration() {
        run.step()?;
    }
    // The mesh as a rigid body: its center is not quite that of the ball.
    let masses = solid.lumped_mass::<f64>();
    let total: f64 = masses.iter().step_by(3).sum();
    let height = solid.nodes.iter().zip(masses.iter().step_by(3)).map(|([.., z], m)| m * z).sum::<f64>() / total;
    let inertia = solid.nodes.iter().zip(masses.iter().step_by(3));
    let inertia: f64 = inertia.map(|([x, _, z], m)| m * (x * x + (z - height).powi(2))).sum();
    let v = run.state().velocity();
    let momentum = |weight: fn([f64; 3], f64) -> [f64; 3]| -> f64 {
        let of = |(node, &place): (usize, &[f64; 3])| {
            let weight = weight(place, height);
            (0..3).map(|axis| masses[3 * node + axis] * weight[axis] * v[3 * node + axis]).sum::<f64>()
        };
        solid.nodes.iter().enumerate().map(of).sum()
    };
    let [vx, vz] = [momentum(|_, _| [1.0, 0.0, 0.0]) / total, momentum(|_, _| [0.0, 0.0, 1.0]) / total];
    // It turns so that its lowest point is moved against x.
    let turning = momentum(|[x, _, z], height| [height - z, 0.0, x]) / inertia;
    let (point, restitution) = (vx + turning * height, vz / speed);
    let slid = along - FRICTION * speed * 2.0 * (1.0 + total * height * height / inertia);
    let impulses = (along - vx) / (FRICTION * (speed + vz));
    Ok([point * unit() / speed, slid * unit() / speed, psi - 4.0 * chi(), restitution, impulses])
}
