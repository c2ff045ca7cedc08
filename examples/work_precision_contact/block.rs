//! A block of hex8 elements that falls flat on a floor; a quarter of it, for symmetry.

use crate::rows::Row;
use crate::scene::{Errors, Model, Scene, force_errors};
use contact_dynamics::mass::affine_motions;
use contact_dynamics::{ContactLaw, LinearRows, Result, Simulation};
use contact_dynamics_scenes::masses::Body;
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::output::decimal;
use std::collections::BTreeMap;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
const SPEED: f64 = 0.01;
/// Steps before the one of the impact.
const FLIGHT: f64 = 3.0;
/// Time a run goes on after the impact, in times of a wave across the cube; contact lasts a little more than two.
const AFTER: f64 = 3.2;

/// A mesh, assembled once.
struct Mesh {
    body: Body,
    /// Dofs that symmetry holds.
    held: Vec<usize>,
    /// Vertical dofs of the lower face, each with the stiffness of the column of an element above it.
    contact: Vec<(usize, f64)>,
}

impl Mesh {
    /// A quarter of the unit cube, `cells` elements high.
    fn new(cells: usize) -> Self {
        let solid = Solid::block([0.5, 0.5, 1.0], [cells / 2, cells / 2, cells], MATERIAL);
        let at = |node: usize, axis: usize| solid.nodes[node][axis] < 1e-9;
        let nodes = 0..solid.nodes.len();
        let held = nodes.clone().flat_map(|node| [0, 1].map(|axis| (node, axis)));
        let held = held.filter(|&(node, axis)| at(node, axis)).map(|(node, axis)| Solid::<3>::dof(node, axis));
        // A node of the face has a quarter of an element's area from each element that it touches.
        let side = 1.0 / cells as f64;
        let edge = |x: f64| if (1e-9..0.5 - 1e-9).contains(&x) { 1.0 } else { 0.5 };
        let modulus = MATERIAL.density * MATERIAL.wave_speed() * MATERIAL.wave_speed();
        let column = |node: usize| modulus * side * edge(solid.nodes[node][0]) * edge(solid.nodes[node][1]);
        let lower = nodes.clone().filter(|&node| at(node, 2));
        let contact: Vec<_> = lower.map(|node| (Solid::<3>::dof(node, 2), column(node))).collect();
        let body = Body {
            consistent: solid.consistent_mass(),
            stiffness: solid.stiffness(),
            contact: contact.iter().map(|(dof, _)| *dof).collect(),
            groups: (0..solid.dofs()).map(|dof| dof % 3).collect(),
            motions: affine_motions(solid.dofs(), &solid.nodes, &solid.node_dofs()).unwrap_or_default(),
        };
        Self { held: held.collect(), contact, body }
    }

    /// A block that touches the floor so far into a step, the fourth.
    fn simulation(&self, row: &Row, h: f64, phase: f64, transit: f64) -> Result<Simulation<'static, f64>> {
        let mut system = row.mass(&self.body, h)?.system(self.body.stiffness.clone())?;
        for &dof in &self.held {
            system = system.fix(dof)?;
        }
        let height = touch(h, phase) * SPEED;
        let add = |rows: LinearRows<'static, f64>, &(dof, stiffness): &(usize, f64)| {
            let law: ContactLaw = row.law(stiffness);
            rows.row(law, &[(dof, 1.0)], height)
        };
        let velocity = (0..self.body.groups.len()).map(|dof| if dof % 3 == 2 { -SPEED } else { 0.0 }).collect();
        Simulation::builder(system, row.integrator()?, h)
            .velocity(velocity)
            .constraint(self.contact.iter().fold(LinearRows::new(), add))
            .correctors(row.correctors(transit)?)
            .build()
    }

    /// Sums of the forces over ρcvA at times after the touch, and the part of the energy that is left.
    fn forces(&self, row: &Row, h: f64, phase: f64, transit: f64) -> Result<(Vec<(f64, f64)>, f64)> {
        let mut run = self.simulation(row, h, phase, transit)?;
        let (start, touch, late) = (run.energy().total(), touch(h, phase), (row.load() - 1.0) * h);
        let unit = 0.25 * MATERIAL.density * MATERIAL.wave_speed() * SPEED;
        let mut forces = Vec::new();
        while run.time() < until(h, phase) {
            run.step()?;
            let force: f64 = run.state().contacts().forces().iter().sum();
            forces.push((run.time() + late - touch, force / unit));
        }
        Ok((forces, run.energy().total() / start))
    }
}

/// Time of the impact.
fn touch(h: f64, phase: f64) -> f64 {
    (FLIGHT + phase) * h
}

fn until(h: f64, phase: f64) -> f64 {
    touch(h, phase) + AFTER * crossing()
}

fn crossing() -> f64 {
    1.0 / MATERIAL.wave_speed()
}

/// The block on some meshes, and what it is compared with.
pub(crate) struct Block {
    meshes: BTreeMap<usize, Mesh>,
    reference: Vec<(f64, f64)>,
    /// Elements a side of the mesh of the reference.
    finest: usize,
    /// Mean and RMS difference between the reference and that of an unrelated scheme, and what each lost of the energy.
    pub(crate) uncertainty: [f64; 2],
    pub(crate) losses: [f64; 2],
}

impl Block {
    /// With a reference by the first row, compared with the second, at Courant number ½.
    pub(crate) fn new(meshes: &[usize], finest: usize, [first, second]: [&Row; 2]) -> Result<Self> {
        let mesh = Mesh::new(finest);
        let transit = crossing() / finest as f64;
        let run = |row: &Row| mesh.forces(row, 0.5 * transit, 0.5, transit);
        let ((reference, left), (other, other_left)) = (run(first)?, run(second)?);
        let exact = |t: f64| interpolated(&reference, t);
        let uncertainty = force_errors(&other, exact, window(), &[0.0], 0.5 * transit, 1.0);
        let meshes = meshes.iter().map(|&cells| (cells, Mesh::new(cells))).collect();
        Ok(Self { meshes, reference, finest, uncertainty, losses: [left, other_left].map(|left| 1.0 - left) })
    }

    /// One line about the reference.
    pub(crate) fn remark(&self) -> String {
        let Self { finest, uncertainty: [mean, rms], losses, .. } = self;
        format!(
            "Reference of the block: conservative preset, {finest} elements a side, Courant number ½. The composite \
             scheme with λ_v/λ_a on a blend differs from it by {:.1} % in the mean, {:.1} % RMS; they lose {} and {} % \
             of the energy.",
            100.0 * mean,
            100.0 * rms,
            decimal(100.0 * losses[0], 2),
            decimal(100.0 * losses[1], 2)
        )
    }
}

/// From shortly before the impact until shortly after the rebound.
fn window() -> std::ops::Range<f64> {
    -0.3 * crossing()..0.98 * AFTER * crossing()
}

/// On the straight lines between samples; zero before the impact.
fn interpolated(samples: &[(f64, f64)], t: f64) -> f64 {
    let after = samples.partition_point(|sample| sample.0 < t);
    match (t > 0.0, after.checked_sub(1).and_then(|before| Some((samples[before], samples.get(after)?)))) {
        (true, Some((from, to))) => from.1 + (to.1 - from.1) * (t - from.0) / (to.0 - from.0),
        _ => 0.0,
    }
}

impl Scene for Block {
    fn key(&self) -> &'static str {
        "block"
    }

    fn title(&self) -> &'static str {
        "A hex8 block falls on a floor"
    }

    fn budget(&self, row: &Row) -> f64 {
        // Steps without a solve are that much cheaper.
        if row.is_explicit() { 2e6 } else { 2.3e5 }
    }

    fn meshes(&self) -> Vec<usize> {
        self.meshes.keys().copied().collect()
    }

    fn body(&self, elements: usize) -> Body {
        self.meshes[&elements].body.clone()
    }

    fn transit(&self, elements: usize) -> f64 {
        crossing() / elements as f64
    }

    fn simulation(&self, model: &Model<'_>, phase: f64) -> Result<(Simulation<'static, f64>, f64)> {
        let Model { row, elements, h } = *model;
        let run = self.meshes[&elements].simulation(row, h, phase, self.transit(elements))?;
        Ok((run, until(h, phase)))
    }

    fn errors(&self, model: &Model<'_>, phase: f64) -> Result<Errors> {
        let Model { row, elements, h } = *model;
        let (forces, left) = self.meshes[&elements].forces(row, h, phase, self.transit(elements))?;
        let [force, rms] = force_errors(&forces, |t| interpolated(&self.reference, t), window(), &[0.0], h, 1.0);
        Ok(Errors { force, rms, energy: (1.0 - left).abs() })
    }
}
