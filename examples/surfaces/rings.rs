//! Two rings of rubber that hit each other off center, at large strains: energy and momentum.

use contact_dynamics::contact::{ContactConstraint, Facet, Mortar, NodeToFacet, SurfaceSettings};
use contact_dynamics::{Composite, EnergyMomentum, PersistencyCorrection, Simulation, StepControl, TimeIntegrator};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};
use std::error::Error;
use std::fmt::Write;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.4, density: 1e-3 };

/// Between the centers, along and across.
const APART: [f64; 2] = [80.5, 20.0];

pub(crate) const SPEED: f64 = 2.0;

/// When the rings have left each other.
pub(crate) const END: f64 = 120.0;

/// What [`Rings::contact`] knows.
pub(crate) const CONTACTS: [&str; 3] = ["one pass", "two passes", "mortar"];

/// Energies, momenta and the work of Newton's method, by contact and scheme.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Two neo-Hookean rings that collide off center, corrected: highest energy and energy at the end, largest errors \
         of momentum and angular momentum over those of a ring at the start, most iterations of Newton's method a \
         step, steps refused\n\n\
         | elements around | contact | scheme | highest | at the end | momentum | angular | iterations | refused |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let meshes = if quick { &[[32, 24]][..] } else { &[[64, 64], [64, 90]] };
    let until = if quick { 20.0 } else { END };
    for &around in meshes {
        let rings = Rings::new(3, around);
        for name in CONTACTS {
            for scheme in [|| Box::new(Composite) as Box<dyn TimeIntegrator>, || Box::new(EnergyMomentum) as _] {
                let line = match rings.run(rings.contact(name)?, scheme(), until) {
                    Ok([highest, last, linear, angular, iterations, refused]) => format!(
                        "1 + {:.0e} | {last:.4} | {linear:.0e} | {angular:.0e} | {iterations} | {refused}",
                        (highest - 1.0).max(0.0)
                    ),
                    Err(error) => format!("{error} | | | | |"),
                };
                writeln!(table, "| {}, {} | {name} | {} | {line} |", around[0], around[1], scheme().name())?;
            }
        }
    }
    Ok(table)
}

pub(crate) struct Rings {
    pub(crate) solid: Solid<2>,
    /// Number of nodes of the first one.
    pub(crate) split: usize,
    /// Outer surfaces.
    facets: [Vec<Facet>; 2],
}

impl Rings {
    /// So many elements across both, and around each.
    pub(crate) fn new(across: usize, around: [usize; 2]) -> Self {
        let ring = |k: usize, angle: f64| Solid::ring([30.0, 40.0], [across, around[k]], MATERIAL).rotated(angle);
        let left = ring(0, 0.02);
        let split = left.nodes.len();
        let solid = left.with(ring(1, 0.031).moved(APART));
        let outer = |k: usize| {
            let center = [[0.0; 2], APART][k];
            let on = |&n: &usize| {
                let [x, y] = solid.nodes[n];
                (n < split) == (k == 0) && ((x - center[0]).hypot(y - center[1]) - 40.0).abs() < 1e-9
            };
            let boundary = solid.boundary().into_iter().filter(|facet| facet.iter().all(on));
            boundary.map(|facet| Facet::from([facet[0], facet[1]])).collect()
        };
        let facets = [outer(0), outer(1)];
        Self { solid, split, facets }
    }

    pub(crate) fn contact(&self, name: &str) -> Result<Box<dyn ContactConstraint<f64>>, Box<dyn Error>> {
        let Self { solid, facets: [first, second], .. } = self;
        let (nodes, dofs) = (&solid.nodes, &solid.node_dofs());
        Ok(match name {
            "one pass" => {
                let slaves: Vec<usize> = second.iter().map(|facet| facet.nodes()[0]).collect();
                let contact = NodeToFacet::one_pass(nodes, dofs, &slaves, first.clone())?;
                Box::new(contact.facing(second.clone())?.with(SurfaceSettings::new().reach(5.0))?)
            }
            "two passes" => Box::new(
                NodeToFacet::new(nodes, dofs, second.clone(), first.clone())?
                    .with(SurfaceSettings::new().reach(5.0))?,
            ),
            _ => Box::new(
                Mortar::new(nodes, dofs, second.clone(), first.clone())?.with(SurfaceSettings::new().reach(5.0))?,
            ),
        })
    }

    /// The rings on their way to each other.
    pub(crate) fn thrown(
        &self,
        contact: Box<dyn ContactConstraint<f64>>,
        scheme: Box<dyn TimeIntegrator>,
        h: f64,
    ) -> Result<Simulation<'static, f64>, Box<dyn Error>> {
        let Self { solid, split, .. } = self;
        let toward = |dof: usize| if dof < 2 * split { SPEED } else { -SPEED };
        let velocity = (0..solid.dofs()).map(|dof| if dof % 2 == 0 { toward(dof) } else { 0.0 }).collect();
        let run = Simulation::builder(Hyperelastic::new(solid, Law::NeoHookean), scheme, h)
            .velocity(velocity)
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .step_control(StepControl::halving(h / 64.0)?)
            .build()?;
        Ok(run)
    }

    fn run(
        &self,
        contact: Box<dyn ContactConstraint<f64>>,
        scheme: Box<dyn TimeIntegrator>,
        until: f64,
    ) -> Result<[f64; 6], Box<dyn Error>> {
        let Self { solid, split, .. } = self;
        let mut run = self.thrown(contact, scheme, 0.5)?;
        let mass = solid.lumped_mass::<f64>();
        let scale = (0..2 * split).step_by(2).map(|dof| mass[dof] * SPEED).sum::<f64>();
        let momenta = |u: &[f64], v: &[f64]| {
            let mut sums = [0.0; 3];
            for (node, x) in solid.nodes.iter().enumerate() {
                let [p, q] = [0, 1].map(|axis| mass[2 * node + axis] * v[2 * node + axis]);
                let [x, y] = [0, 1].map(|axis| x[axis] + u[2 * node + axis]);
                sums = [sums[0] + p, sums[1] + q, sums[2] + x * q - y * p];
            }
            sums
        };
        let start = momenta(run.state().displacement(), run.state().velocity());
        let energy = run.energy().total();
        let (mut highest, mut linear, mut angular, mut most) = (1.0_f64, 0.0_f64, 0.0_f64, 0);
        while run.time() < until {
            let before = *run.statistics();
            run.step()?;
            let after = *run.statistics();
            if after.refused_steps == before.refused_steps {
                most = most.max(after.newton_iterations - before.newton_iterations);
            }
            highest = highest.max(run.energy().total() / energy);
            let now = momenta(run.state().displacement(), run.state().velocity());
            linear = linear.max((now[0] - start[0]).hypot(now[1] - start[1]) / scale);
            angular = angular.max((now[2] - start[2]).abs() / (scale * 0.5 * APART[1]));
        }
        let last = run.energy().total() / energy;
        Ok([highest, last, linear, angular, most as f64, run.statistics().refused_steps as f64])
    }
}
