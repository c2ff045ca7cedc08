//! A block of hex8 elements dropped on a floor: flat, on an edge, on a corner.

use crate::solids::{Material, Solid};
use contact_dynamics::contact::Plane;
use contact_dynamics::{
    ActiveSet, Composite, ContactSolver, NodesOnObstacle, PersistencyCorrection, Result, Simulation, TimeIntegrator,
};
use std::time::Instant;

/// What the block falls on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Landing {
    Flat,
    Edge,
    Corner,
}

pub const LANDINGS: [Landing; 3] = [Landing::Flat, Landing::Edge, Landing::Corner];

/// The scene: a unit cube of `cells` elements a side, E = 1, ρ = 1, ν = 0.3, at speed 0.01.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drop {
    pub cells: usize,
    pub landing: Landing,
    /// Time step over the time a dilatational wave needs to cross an element.
    pub courant: f64,
}

/// Speed of the fall.
pub const SPEED: f64 = 0.01;
const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// What is measured of a drop.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DropFigures {
    pub dofs: usize,
    pub candidates: usize,
    /// Largest sum of the contact forces, over ρ c v A of the cube's side.
    pub largest_force: f64,
    /// Largest number of contacts pressed at once.
    pub pressed: usize,
    /// Time in contact over the time of a dilatational wave across the cube and back.
    pub duration: f64,
    /// Contact iterations of one step: the most of all steps, and of those in which no contact closed or opened.
    pub iterations: u64,
    pub steady_iterations: u64,
    /// Energy at the end over that at the start.
    pub energy: f64,
    /// Largest deviation of momentum + impulse from the start, over m v.
    pub momentum: f64,
    /// Deepest penetration over the side.
    pub penetration: f64,
    /// Mean wall time of a step, open and in contact, in milliseconds.
    pub milliseconds: [f64; 2],
}

impl Drop {
    pub fn solid(&self) -> Solid<3> {
        let block = Solid::block([1.0; 3], [self.cells; 3], MATERIAL);
        let turned = match self.landing {
            Landing::Flat => block,
            Landing::Edge => block.rotated([1.0, 0.0, 0.0], std::f64::consts::FRAC_PI_4),
            // The space diagonal upright.
            Landing::Corner => block.rotated([1.0, -1.0, 0.0], (1.0 / 3.0_f64.sqrt()).acos()),
        };
        turned.lifted(5.5 * self.step() * SPEED)
    }

    pub fn step(&self) -> f64 {
        self.courant / (self.cells as f64 * MATERIAL.wave_speed())
    }

    /// The block above the floor, all nodes of its lower half candidates.
    pub fn simulation(
        &self,
        scheme: impl TimeIntegrator + 'static,
        solver: impl ContactSolver<f64> + 'static,
    ) -> Result<Simulation<'static, f64>> {
        let solid = self.solid();
        let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0])?;
        let surface = solid.surface_nodes().into_iter();
        let nodes: Vec<_> = match self.landing {
            Landing::Flat => surface.filter(|&node| solid.nodes[node][2] < 0.5 / self.cells as f64).collect(),
            _ => surface.filter(|&node| solid.nodes[node][2] < 0.35).collect(),
        };
        Simulation::builder(solid.system(), scheme, self.step())
            .velocity(solid.uniform([0.0, 0.0, -SPEED]))
            .constraint(NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &nodes)?)
            .contact_solver(solver)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
    }

    /// Runs by the composite scheme with the active set until the block has left the floor.
    pub fn run(&self) -> Result<DropFigures> {
        self.run_with(ActiveSet::default())
    }

    /// Runs by the composite scheme with another contact solver.
    pub fn run_with(&self, solver: impl ContactSolver<f64> + 'static) -> Result<DropFigures> {
        let mut run = self.simulation(Composite, solver)?;
        let up: Vec<f64> = (0..run.system().dofs()).map(|dof| f64::from(u8::from(dof % 3 == 2))).collect();
        let crossing = 1.0 / MATERIAL.wave_speed();
        let unit = MATERIAL.density * MATERIAL.wave_speed() * SPEED;
        let mut figures = DropFigures {
            dofs: run.system().dofs(),
            candidates: run.state().contacts().gaps().len(),
            ..DropFigures::default()
        };
        let (energy, momentum) = (run.energy().total(), run.momentum(&up)?);
        let (mut first, mut last, mut impulse) = (f64::INFINITY, 0.0, 0.0);
        let mut times = [(0.0, 0_u32); 2];
        let until = match self.landing {
            Landing::Flat => 4.0,
            Landing::Edge => 10.0,
            Landing::Corner => 40.0,
        } * crossing;
        while run.time() < until {
            let before = *run.statistics();
            let start = Instant::now();
            run.step()?;
            let elapsed = start.elapsed().as_secs_f64() * 1e3;
            let after = *run.statistics();
            let iterations = after.contact_iterations - before.contact_iterations;
            figures.iterations = figures.iterations.max(iterations);
            if after.contact_changes == before.contact_changes {
                figures.steady_iterations = figures.steady_iterations.max(iterations);
            }
            let contacts = run.state().contacts();
            let force: f64 = contacts.forces().iter().sum();
            let pressed = contacts.raw_forces().iter().filter(|&&force| force > 0.0).count();
            figures.pressed = figures.pressed.max(pressed);
            figures.largest_force = figures.largest_force.max(force / unit);
            let deepest = contacts.gaps().iter().fold(0.0_f64, |m, gap| m.max(-gap));
            figures.penetration = figures.penetration.max(deepest);
            impulse += contacts.impulses().iter().sum::<f64>();
            if pressed > 0 {
                (first, last) = (first.min(run.time()), run.time());
            }
            let (sum, count) = &mut times[usize::from(iterations > 0)];
            (*sum, *count) = (*sum + elapsed, *count + 1);
            let drift = (run.momentum(&up)? - momentum - impulse).abs() / momentum.abs();
            figures.momentum = figures.momentum.max(drift);
        }
        figures.duration = (last - first) / (2.0 * crossing);
        figures.energy = run.energy().total() / energy;
        figures.milliseconds = times.map(|(sum, count)| sum / f64::from(count.max(1)));
        Ok(figures)
    }
}
