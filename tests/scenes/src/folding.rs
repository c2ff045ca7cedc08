//! Bodies that fold until they meet themselves: hairpins whose arms close, a sheet that is one, a strip that buckles.

use crate::falls::depth;
use crate::solids::{Material, Solid};
use contact_dynamics::contact::{Facet, NodeToFacet, Surface};
use contact_dynamics::{PersistencyCorrection, Result, Simulation, StepControl, System, TimeIntegrator};
use std::f64::consts::{PI, TAU};

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

/// A body, the two parts of its surface that are to meet, and velocities that fold it.
#[derive(Clone, Debug)]
pub struct Folding<const D: usize> {
    pub solid: Solid<D>,
    pub arms: [Vec<Facet>; 2],
    pub velocity: Vec<f64>,
}

/// What folding was like.
#[derive(Clone, Debug)]
pub struct FoldFigures {
    /// Highest energy over that at the start, and that at the end.
    pub highest: f64,
    pub last: f64,
    /// How deep nodes get into the body (length).
    pub depth: f64,
    /// Most rows that press at a time.
    pub pressed: usize,
    pub refused: u64,
    /// Most iterations of Newton's method in a step that was not refused.
    pub iterations: u64,
    /// Largest change of the momentum, over the sum of its sizes by dof at the start.
    pub momentum: f64,
    /// Displacements at the end.
    pub displacement: Vec<f64>,
}

/// A hairpin of thickness 0.2: an arm of length 2 below, a half circle on the right, and an arm above, with a slot of
/// `slot` between, a fifth shorter; `shift` moves its nodes along it, so that nodes do not face each other.
fn bend([s, t]: [f64; 2], slot: f64, shift: f64) -> [f64; 2] {
    let (radius, arc) = (0.5 * slot, 1.0);
    // s from 0 to 2 along the lower arm, over the bend, and back along the upper one; t from the inside to the outside.
    if s < 2.0 {
        [s, -radius - t]
    } else if s < 2.0 + arc {
        let angle = PI * (s - 2.0) / arc;
        [2.0 + (radius + t) * angle.sin(), -(radius + t) * angle.cos()]
    } else {
        let back = s - 2.0 - arc;
        [2.0 - 0.8 * back * (1.0 - shift * (2.0 - back)), radius + t]
    }
}

impl<const D: usize> Folding<D> {
    /// With the facets whose nodes are all on the one arm, or all on the other one.
    fn new(solid: Solid<D>, arm_of: impl Fn([f64; D]) -> Option<usize>, velocity: Vec<f64>) -> Self {
        let surface = Surface::of_cells(&solid.nodes, &solid.elements).expect("a mesh of sound elements");
        let arm = |arm: usize| {
            let is_on = |&node: &usize| arm_of(solid.nodes[node]) == Some(arm);
            surface.into_iter().filter(|facet| facet.nodes().iter().all(is_on)).collect()
        };
        Self { arms: [arm(0), arm(1)], solid, velocity }
    }

    /// Contact of its whole surface with itself.
    ///
    /// # Errors
    ///
    /// Those of the constraint.
    pub fn of_itself(&self) -> Result<NodeToFacet<f64>> {
        let surface = Surface::of_cells(&self.solid.nodes, &self.solid.elements)?;
        NodeToFacet::of_itself(&self.solid.nodes, &self.solid.node_dofs(), &surface)
    }

    /// Contact of the two arms, as of two bodies.
    ///
    /// # Errors
    ///
    /// Those of the constraint.
    pub fn of_two_surfaces(&self) -> Result<NodeToFacet<f64>> {
        let [lower, upper] = self.arms.clone();
        NodeToFacet::new(&self.solid.nodes, &self.solid.node_dofs(), upper, lower)
    }

    /// Folds until t = `until`.
    ///
    /// # Errors
    ///
    /// Those of the run.
    pub fn run(
        &self,
        system: impl System<f64> + 'static,
        contact: NodeToFacet<f64>,
        scheme: impl TimeIntegrator + 'static,
        (h, until): (f64, f64),
    ) -> Result<FoldFigures> {
        let mass = self.solid.lumped_mass::<f64>();
        let mut run = Simulation::builder(system, scheme, h)
            .velocity(self.velocity.clone())
            .constraint(contact)
            .corrector(PersistencyCorrection::default())
            .step_control(StepControl::halving(h / 64.0)?)
            .build()?;
        let momentum = |v: &[f64]| -> [f64; D] {
            std::array::from_fn(|axis| v.iter().zip(&mass).skip(axis).step_by(D).map(|(v, m)| m * v).sum())
        };
        let start = momentum(&self.velocity);
        let scale: f64 = self.velocity.iter().zip(&mass).map(|(v, m)| m * v.abs()).sum();
        let (energy, mut gaps) = (run.energy().total(), self.of_itself()?);
        let mut figures = FoldFigures {
            highest: 1.0,
            last: 1.0,
            depth: 0.0,
            pressed: 0,
            refused: 0,
            iterations: 0,
            momentum: 0.0,
            displacement: Vec::new(),
        };
        while run.time() < until {
            let before = *run.statistics();
            run.step()?;
            let after = *run.statistics();
            if after.refused_steps == before.refused_steps {
                figures.iterations = figures.iterations.max(after.newton_iterations - before.newton_iterations);
            }
            figures.last = run.energy().total() / energy;
            figures.highest = figures.highest.max(figures.last);
            figures.depth = figures.depth.max(depth(&mut gaps, &run)?);
            let pressed = run.state().contacts().forces().iter().filter(|force| **force > 0.0).count();
            figures.pressed = figures.pressed.max(pressed);
            let now = momentum(run.state().velocity());
            let change = now.iter().zip(start).map(|(now, start)| (now - start).abs()).fold(0.0, f64::max);
            figures.momentum = figures.momentum.max(change / scale);
        }
        figures.refused = run.statistics().refused_steps;
        figures.displacement = run.state().displacement().to_vec();
        Ok(figures)
    }
}

/// Which arm of a hairpin a place is on the inner side of, by how far along it and how high it is.
fn arm_of_hairpin([x, y]: [f64; 2], slot: f64) -> Option<usize> {
    let on = |sign: f64| (y - 0.5 * sign * slot).abs() < 1e-9 && x < 1.99;
    [-1.0, 1.0].into_iter().position(on)
}

/// Velocity across with which a place of a hairpin's arms is thrown at the other one.
fn thrown([x, y]: [f64; 2], speed: f64) -> f64 {
    if x < 2.0 { -y.signum() * speed * (1.0 - 0.5 * x) } else { 0.0 }
}

impl Folding<2> {
    /// A hairpin of 40 × 2 elements, whose arms are thrown at each other.
    pub fn hairpin(slot: f64, speed: f64) -> Self {
        let strip = Solid::rectangle([5.0, 0.2], [40, 2], MATERIAL);
        let solid = strip.mapped(|[s, t]| bend([s, 0.2 - t], slot, 0.06));
        let velocity = solid.nodes.iter().flat_map(|&x| [0.0, thrown(x, speed)]).collect();
        Self::new(solid, |x| arm_of_hairpin(x, slot), velocity)
    }

    /// A straight strip of `cells` elements, whose ends are thrown at each other, and its middle down.
    pub fn strip(cells: [usize; 2], [along, across]: [f64; 2]) -> Self {
        const LENGTH: f64 = 6.0;
        const THICKNESS: f64 = 0.12;
        let strip = Solid::rectangle([LENGTH, THICKNESS], cells, MATERIAL);
        // Nodes of both halves do not face each other.
        let solid = strip.mapped(|[x, y]| [x - 0.5 * LENGTH + 0.15 * (PI * x / LENGTH).sin(), y]);
        let velocity = |&[x, _]: &[f64; 2]| {
            let share = x / LENGTH;
            [-2.0 * along * share, -across * (TAU * share).cos()]
        };
        let velocity = solid.nodes.iter().flat_map(velocity).collect();
        let arm_of = |[x, y]: [f64; 2]| (y > THICKNESS - 1e-9 && x.abs() > 0.1).then_some(usize::from(x > 0.0));
        Self::new(solid, arm_of, velocity)
    }
}

impl Folding<3> {
    /// A sheet of 40 × `wide` × 2 elements bent like the hairpin, which closes at one side first.
    pub fn sheet(wide: usize, slot: f64, speed: f64) -> Self {
        let width = 1.0;
        let sheet = Solid::block([5.0, width, 0.2], [40, wide, 2], MATERIAL);
        let solid = sheet.mapped(|[s, y, t]| {
            let [x, z] = bend([s, 0.2 - t], slot, 0.06);
            [x, y, z]
        });
        let toward = |&[x, y, z]: &[f64; 3]| [0.0, 0.0, (0.5 + y / width) * thrown([x, z], speed)];
        let velocity = solid.nodes.iter().flat_map(toward).collect();
        Self::new(solid, |[x, _, z]| arm_of_hairpin([x, z], slot), velocity)
    }
}
