//! The scenes: blocks of hexahedra thrown at a floor and at one another.

use crate::clock::Timed;
use crate::engine::Engine;
use crate::faults::{Fault, with_fault};
use crate::partition::Part;
use crate::parts::HyperelasticPart;
use contact_dynamics::contact::Plane;
use contact_dynamics::{
    CentralDifference, Composite, ContactConstraint, ContactLaw, LinearRows, LinearSystem, NodesOnObstacle, Result,
    Simulation, SimulationBuilder, System,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};

const MATERIAL: Material = Material { young: 100.0, poisson: 0.25, density: 1.0 };
const FRICTION: f64 = 0.3;

/// What is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// Small strains, composite scheme with λ_v/λ_a.
    Linear,
    /// The same with a consistent mass.
    Consistent,
    /// Neo-Hookean blocks, composite scheme with λ_v/λ_a, Newton's method.
    LargeStrains,
    /// Small strains, central differences.
    Explicit,
}

impl Scene {
    pub const ALL: [Self; 4] = [Self::Linear, Self::Consistent, Self::LargeStrains, Self::Explicit];

    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "small strains",
            Self::Consistent => "consistent mass",
            Self::LargeStrains => "large strains",
            Self::Explicit => "explicit",
        }
    }
}

/// Two blocks of one height, the upper one a gap above the lower one; or one alone.
pub struct Blocks {
    pub solid: Solid<3>,
    bottom: Vec<usize>,
    /// Nodes that face each other, of the lower block and of the upper one.
    pairs: Vec<[usize; 2]>,
    gaps: [f64; 2],
    size: f64,
}

impl Blocks {
    /// Of `cells`³ elements each, with edges of length 1.
    pub fn new(cells: usize) -> Self {
        let gaps = [0.011, 0.017];
        let lower = Solid::block([1.0; 3], [cells; 3], MATERIAL);
        let upper = lower.clone().moved([0.0, 0.0, 1.0 + gaps[1]]);
        let first = lower.nodes.len();
        let at = |height: f64| -> Vec<usize> {
            (0..first).filter(|&node| (lower.nodes[node][2] - height).abs() < 1e-9).collect()
        };
        let (bottom, top) = (at(0.0), at(1.0));
        let pairs = top.into_iter().zip(&bottom).map(|(top, &under)| [top, first + under]).collect();
        Self { solid: lower.with(upper), bottom, pairs, gaps, size: 1.0 / cells as f64 }
    }

    /// A single block of so many elements, cubes of one size, that stands on a patch in the middle of its lower face:
    /// a body that grows while its contact does not.
    pub fn tower(cells: [usize; 3]) -> Self {
        let size = 1.0 / cells[0] as f64;
        let edges = cells.map(|count| size * count as f64);
        let solid = Solid::block(edges, cells, MATERIAL);
        let is_near = |node: &[f64; 3]| (0..2).all(|axis| (node[axis] - 0.5 * edges[axis]).abs() < 2.5 * size);
        let bottom = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] < 1e-9 && is_near(&solid.nodes[node]));
        let bottom = bottom.collect();
        Self { bottom, solid, pairs: Vec::new(), gaps: [0.2 * size, 0.0], size }
    }

    /// The nodes that contact may act on.
    pub fn contact_nodes(&self) -> Vec<usize> {
        self.bottom.iter().copied().chain(self.pairs.iter().flatten().copied()).collect()
    }

    /// The step of a scene: a fifth of the time in which a wave passes an element, explicit; five times of it else.
    pub fn step(&self, scene: Scene) -> f64 {
        let passage = self.size / MATERIAL.wave_speed();
        if scene == Scene::Explicit { 0.2 * passage } else { passage }
    }

    /// Contact with friction in the dofs that `local` gives for a node. All ranks have the same lists.
    fn contact(&self, local: impl Fn(usize) -> usize) -> Result<Vec<Box<dyn ContactConstraint<f64>>>> {
        let dofs = |node: usize| [0, 1, 2].map(|axis| Solid::<3>::dof(local(node), axis));
        let bottom: Vec<_> = self.bottom.iter().map(|&node| self.solid.nodes[node]).collect();
        let places: Vec<_> = self.bottom.iter().map(|&node| dofs(node)).collect();
        let all: Vec<_> = (0..bottom.len()).collect();
        let floor = Plane::new([0.0, 0.0, -self.gaps[0]], [0.0, 0.0, 1.0])?;
        let floor = NodesOnObstacle::new(floor, &bottom, &places, &all)?.friction(FRICTION);
        let mut rows = LinearRows::new();
        for &[lower, upper] in &self.pairs {
            let law = (ContactLaw::Rigid, FRICTION);
            rows = rows.pair_with_friction(law, dofs(lower), dofs(upper), [0.0, 0.0, 1.0], self.gaps[1])?;
        }
        Ok(vec![Box::new(floor), Box::new(rows)])
    }

    /// Initial velocities of the whole: down, along, and turning.
    fn velocity(&self) -> Vec<f64> {
        let turn = |[x, y, z]: [f64; 3]| [0.8 - 0.2 * z, 0.1 * x, -1.0 + 0.3 * x - 0.1 * y];
        self.solid.nodes.iter().flat_map(|&node| turn(node)).collect()
    }

    fn builder(&self, scene: Scene, system: impl System<f64> + 'static) -> SimulationBuilder<'static, f64> {
        let h = self.step(scene);
        match scene {
            Scene::Explicit => Simulation::builder(system, CentralDifference, h),
            _ => Simulation::builder(system, Composite, h),
        }
    }

    fn matrices(scene: Scene, solid: &Solid<3>) -> Result<LinearSystem<'static, f64>> {
        match scene {
            Scene::Consistent => LinearSystem::new(solid.consistent_mass(), solid.stiffness()),
            _ => LinearSystem::lumped(solid.lumped_mass(), solid.stiffness()),
        }
    }

    /// In one piece, without ranks.
    pub fn alone(&self, scene: Scene) -> Result<SimulationBuilder<'static, f64>> {
        let builder = match scene {
            Scene::LargeStrains => self.builder(scene, Hyperelastic::new(&self.solid, Law::NeoHookean)),
            _ => self.builder(scene, Self::matrices(scene, &self.solid)?),
        };
        Ok(builder.velocity(self.velocity()).constraints(self.contact(|node| node)?))
    }

    /// The part of a rank.
    pub fn on_rank(&self, scene: Scene, part: &Part, engine: Engine) -> Result<SimulationBuilder<'static, f64>> {
        self.on_rank_with(scene, part, engine, None)
    }

    /// The same with a fault, on the last rank or on all, as it is.
    pub fn on_rank_with(
        &self,
        scene: Scene,
        part: &Part,
        engine: Engine,
        fault: Option<Fault>,
    ) -> Result<SimulationBuilder<'static, f64>> {
        let Part { cut, share } = part;
        let is_last = share.world.rank + 1 == share.world.size;
        let fault = fault.filter(|fault| is_last || fault.is_of_all());
        let (ranks, clock) = (share.clone(), share.clock.clone());
        let builder = if scene == Scene::LargeStrains {
            let body = HyperelasticPart::new(cut, ranks, Law::NeoHookean);
            self.builder(scene, Timed { part: with_fault(body, fault), clock })
        } else {
            let body = Self::matrices(scene, &cut.solid)?.over_ranks(ranks);
            self.builder(scene, Timed { part: with_fault(body, fault), clock })
        };
        let local = |node: usize| cut.local(node).expect("all ranks know the contact nodes");
        let builder = builder.velocity(share.of(&self.velocity())).constraints(self.contact(local)?);
        Ok(match scene {
            Scene::Explicit => builder,
            _ => builder.linear_solver(engine.solver(cut, share, fault)),
        })
    }
}
