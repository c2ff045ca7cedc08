//! Elastic blocks that fall on a rigid plane, flat and tilted, against the full model.

use crate::bars::{Table, trapezoidal};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::mass::affine_motions;
use contact_dynamics::reduction::{Boundary, Modes, Reduction};
use contact_dynamics::{LinearRows, LinearSystem, Result, Simulation};
use contact_dynamics_scenes::masses::{Body, Takers, Treatment};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::output::decimal;

/// Wave speed 11.6, so that a unit length is crossed and recrossed in 0.17.
const SOFT: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

/// Where a block begins above the plane; it falls with unit speed.
const HEIGHT: f64 = 0.02;

/// A block with massless normal contact dofs.
pub(crate) struct Block {
    pub(crate) mass: SparseColMat<usize, f64>,
    pub(crate) stiffness: SparseColMat<usize, f64>,
    pub(crate) contact: Vec<usize>,
    gaps: Vec<f64>,
    pub(crate) plain: SparseColMat<usize, f64>,
    pub(crate) velocity: Vec<f64>,
    pub(crate) h: f64,
}

/// Total contact forces step by step, and the energy at the end over that at the start.
struct Fall {
    forces: Vec<f64>,
    energy: f64,
}

impl Fall {
    fn of(mut run: Simulation<'static, f64>, until: f64) -> Result<Self> {
        let (before, mut forces) = (run.energy().total(), Vec::new());
        while run.time() < until {
            run.step()?;
            forces.push(run.state().contacts().forces().iter().sum());
        }
        Ok(Self { forces, energy: run.energy().total() / before })
    }

    fn largest(&self) -> f64 {
        self.forces.iter().copied().fold(0.0, f64::max)
    }

    /// Σ |F − F_full| / Σ F_full.
    fn error(&self, full: &Self) -> f64 {
        let miss: f64 = self.forces.iter().zip(&full.forces).map(|(x, y)| (x - y).abs()).sum();
        miss / full.forces.iter().sum::<f64>()
    }
}

impl Block {
    /// Of a mesh that stands over the plane; its nodes `bottom` may touch.
    fn new<const D: usize>(solid: Solid<D>, bottom: &[usize], h: f64) -> Result<Self> {
        let solid = solid.lifted(HEIGHT);
        let contact: Vec<usize> = bottom.iter().map(|&node| Solid::<D>::dof(node, D - 1)).collect();
        let body = Body {
            consistent: solid.consistent_mass(),
            stiffness: solid.stiffness(),
            contact: contact.clone(),
            groups: (0..solid.dofs()).map(|dof| dof % D).collect(),
            motions: affine_motions(solid.dofs(), &solid.nodes, &solid.node_dofs())?,
        };
        let treatment = Treatment::RedistributedBlend(Takers::Tapered);
        let mass = treatment.mass(&body, &trapezoidal().tableau(), body.courant(h)?)?.into_matrix();
        Ok(Self {
            mass,
            stiffness: body.stiffness,
            plain: body.consistent,
            gaps: bottom.iter().map(|&node| solid.nodes[node][D - 1]).collect(),
            contact,
            velocity: solid.uniform(std::array::from_fn(|axis| if axis == D - 1 { -1.0 } else { 0.0 })),
            h,
        })
    }

    /// A square of `cells`² quad4 in plane strain, turned by `tilt`.
    pub(crate) fn plane(cells: usize, tilt: f64) -> Result<Self> {
        let solid = Solid::rectangle([1.0; 2], [cells; 2], SOFT);
        let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] == 0.0).collect();
        Self::new(solid.rotated(tilt), &bottom, 0.5 / cells as f64 / SOFT.wave_speed())
    }

    /// A cube of `cells`³ hex8, turned about an axis.
    pub(crate) fn cube(cells: usize, (axis, tilt): ([f64; 3], f64)) -> Result<Self> {
        let solid = Solid::block([1.0; 3], [cells; 3], SOFT);
        let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
        Self::new(solid.rotated(axis, tilt), &bottom, 0.5 / cells as f64 / SOFT.wave_speed())
    }

    /// A run of a system whose contact dofs are these.
    pub(crate) fn run(
        &self,
        system: LinearSystem<'static, f64>,
        contact: &[usize],
        velocity: Vec<f64>,
    ) -> Result<Simulation<'static, f64>> {
        self.run_in(self.h, system, contact, velocity)
    }

    /// The same in steps of h.
    pub(crate) fn run_in(
        &self,
        h: f64,
        system: LinearSystem<'static, f64>,
        contact: &[usize],
        velocity: Vec<f64>,
    ) -> Result<Simulation<'static, f64>> {
        let rows = contact.iter().zip(&self.gaps);
        let rows = rows.fold(LinearRows::new(), |rows, (&dof, &gap)| rows.unilateral(&[(dof, 1.0)], gap));
        Simulation::builder(system, trapezoidal(), h).velocity(velocity).constraint(rows).build()
    }

    fn full(&self, until: f64) -> Result<Fall> {
        let system = LinearSystem::new(self.mass.clone(), self.stiffness.clone())?;
        Fall::of(self.run(system, &self.contact, self.velocity.clone())?, until)
    }

    /// Reduced to modes of a parent: itself, or the body with a plain consistent mass.
    fn reduced(
        &self,
        parent: &SparseColMat<usize, f64>,
        modes: &Modes,
        boundary: Boundary,
        until: f64,
    ) -> Result<Fall> {
        let reduction = Reduction::new(parent.as_ref(), self.stiffness.as_ref(), &self.contact).boundary(boundary);
        // (Chosen, as it is refused where the parent has no mass at its contact dofs.)
        let body = reduction.softening(2.0).with_modes(modes)?;
        let contact: Vec<usize> = body.contact_dofs().collect();
        Fall::of(self.run(body.system()?, &contact, body.velocity(&self.velocity)?)?, until)
    }

    /// Rows of a table: the full model, then numbers of modes of both parents.
    fn rows(&self, name: &str, counts: &[usize], until: f64, table: &mut String) -> Result<()> {
        let full = self.full(until)?;
        let line = |name: &str, cells: &[String]| format!("| {name} | {} |\n", cells.join(" | "));
        let cells = |fall: &Fall| [decimal(fall.largest(), 1), decimal(fall.energy, 4)];
        let none = |count: usize| vec!["–".to_owned(); count];
        let dofs = self.velocity.len();
        *table += &line(name, &[vec![format!("full, {dofs} dofs")], none(1), cells(&full).to_vec(), none(7)].concat());
        for &count in counts {
            let mut row = vec![format!("{count} modes")];
            for parent in [&self.plain, &self.mass] {
                let modes = Modes::lowest(parent.as_ref(), self.stiffness.as_ref(), &[], count)?;
                for boundary in [Boundary::Tapered, Boundary::Untapered] {
                    let fall = self.reduced(parent, &modes, boundary, until)?;
                    row.push(decimal(fall.error(&full), 3));
                    row.extend(cells(&fall));
                }
            }
            // (Of the energies of the parents without mass at the contact nodes one can see what one sees above.)
            row.remove(12);
            row.remove(9);
            *table += &line(name, &row);
        }
        Ok(())
    }
}

const HEAD: &str = "| falls | model | tapered: error | largest | energy | untapered: error | largest | energy | \
                    massless parent, tapered: error | largest | untapered: error | largest |\n\
                    | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";

/// The square.
pub(crate) fn plane(quick: bool) -> Table {
    let (cells, counts): (usize, &[usize]) = if quick { (8, &[20, 50]) } else { (16, &[20, 50, 100, 200, 400]) };
    let force = SOFT.density * SOFT.wave_speed();
    let mut table = format!(
        "Block of {cells}² quad4 in plane strain on a rigid plane, trapezoidal rule, total force against the full \
         model with massless contact nodes (its own largest; a plane wave presses with {})\n\n{HEAD}",
        decimal(force, 1)
    );
    for (name, tilt) in [("flat", 0.0), ("tilted by 0.02", 0.02)] {
        Block::plane(cells, tilt)?.rows(name, counts, 0.3, &mut table)?;
    }
    Ok(table)
}

/// The cube on its face, an edge and a corner.
pub(crate) fn space(quick: bool) -> Table {
    let (cells, counts): (usize, &[usize]) = if quick { (3, &[20, 40]) } else { (6, &[20, 50, 100, 200, 400]) };
    let mut table =
        format!("Block of {cells}³ hex8 on a rigid plane, {} contact dofs, as above\n\n{HEAD}", (cells + 1).pow(2));
    for (name, turn) in [
        ("flat", ([0.0, 1.0, 0.0], 0.0)),
        ("on an edge, 0.1", ([0.0, 1.0, 0.0], 0.1)),
        ("on a corner, 0.1", ([1.0, 1.0, 0.0], 0.1)),
    ] {
        Block::cube(cells, turn)?.rows(name, counts, 0.35, &mut table)?;
    }
    Ok(table)
}
