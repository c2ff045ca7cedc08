//! A soft block that falls on another one by a corner, an edge or a face, in the middle or beside its rim.

use crate::OnSystem;
use crate::hyperelastic::{Hyperelastic, Law};
use crate::solids::{Material, Solid};
use crate::stacks::Stack;
use contact_dynamics::contact::{BodyContact, ContactConstraint, EdgeToEdge, NodeToFacet, SurfaceSettings};
use contact_dynamics::{PersistencyCorrection, Result, Simulation, StepControl, TimeIntegrator};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// How the upper block falls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Landing {
    /// Turned at random.
    Any,
    /// On a corner, on the face below.
    Corner,
    /// On an edge, on the face below.
    Edge,
    /// Flat.
    Face,
    /// On an edge, across an edge of the block below.
    Across,
    /// On a corner, beside an edge of the block below.
    Beside,
}

/// What keeps the blocks apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeps {
    TwoPasses,
    TwoPassesAndEdges,
    Mortar,
    Bodies,
    /// Both as one surface against itself.
    Itself,
}

/// Two blocks of hex8 elements.
pub struct Fall {
    /// With the whole surfaces of both.
    pub stack: Stack<3>,
    pub speed: f64,
    /// Length of the elements, and the time in which a wave crosses one.
    pub element: f64,
    pub crossing: f64,
}

/// What a fall was like.
#[derive(Clone, Copy, Debug)]
pub struct FallFigures {
    /// Highest energy over that at the start, and when it was.
    pub highest: f64,
    pub highest_at: f64,
    /// Energy at the end, over that at the start.
    pub last: f64,
    /// The largest rise in a step.
    pub rise: f64,
    /// Deepest nodes in facets and edges in edges (length).
    pub node_depth: f64,
    pub edge_depth: f64,
    pub refused: u64,
    /// Relative change of the momentum.
    pub momentum: f64,
    /// Whether there was contact.
    pub touched: bool,
}

impl Fall {
    /// Orientation, place and speed at random.
    pub fn new(landing: Landing, random: &mut impl FnMut() -> f64) -> Self {
        let mut signed = |size: f64| size * (2.0 * random() - 1.0);
        let any: [f64; 3] = std::array::from_fn(|_| signed(0.5));
        let (wobble, spin, along) = (signed(0.3), signed(0.5), signed(0.5));
        let (x, y) = (signed(0.3), signed(0.3));
        let speed = 0.12 + signed(0.1);
        let turn = 1.5 + signed(1.5);
        let lower = Solid::block([1.5, 1.5, 1.0], [4, 4, 3], MATERIAL).moved([-0.75, -0.75, -1.0]);
        let cube = Solid::block([1.0; 3], [3; 3], MATERIAL).moved([-0.5; 3]);
        let vertical = [0.0, 0.0, 1.0];
        let quarter = std::f64::consts::FRAC_PI_4;
        let corner = |solid: Solid<3>| solid.rotated([1.0, -1.0, 0.0], (1.0 / 3.0_f64.sqrt()).acos());
        let tilted = match landing {
            Landing::Any => cube.rotated(any, turn),
            Landing::Corner => corner(cube).rotated(any, wobble).rotated(vertical, turn),
            Landing::Edge => cube.rotated([1.0, 0.0, 0.0], quarter + wobble).rotated(vertical, turn),
            Landing::Face => cube.rotated(vertical, turn),
            Landing::Across => {
                let roof = cube.rotated([1.0, 0.0, 0.0], quarter + 0.3 * wobble);
                roof.rotated([0.0, 1.0, 0.0], 0.6 + 0.3 * wobble).rotated(vertical, 0.5 * spin)
            }
            Landing::Beside => corner(cube).rotated(any, wobble).rotated(vertical, turn),
        };
        let beside = match landing {
            Landing::Any | Landing::Corner | Landing::Edge | Landing::Face => [x, y, 0.0],
            Landing::Across => [0.75 + 0.3 * along, y, 0.0],
            Landing::Beside => [0.75 + 0.3 * along + 0.1, y, 0.0],
        };
        let upper = tilted.lifted(0.02).moved(beside);
        let stack = Stack::of_whole_surfaces([lower, upper]);
        let element = 1.0 / 3.0;
        Self { stack, speed, element, crossing: element / MATERIAL.wave_speed() }
    }

    /// Nodes on facets in two passes.
    pub fn two_passes(&self) -> Result<NodeToFacet<f64>> {
        self.stack.nodes_on_facets(2)?.with(SurfaceSettings::new().reach(0.2))
    }

    /// Weighted gaps, the upper block being the slave.
    pub fn mortar(&self) -> Result<Box<dyn ContactConstraint<f64>>> {
        self.stack.weighted(true, 0.2)
    }

    /// Weighted gaps, nodes at corners and edges, and edges, the upper block being the slave.
    pub fn bodies(&self) -> Result<Vec<Box<dyn ContactConstraint<f64>>>> {
        self.stack.bodies(true)?.with(SurfaceSettings::new().reach(0.2)).unwrap().constraints()
    }

    /// Edges on edges.
    pub fn edges(&self) -> Result<EdgeToEdge<f64>> {
        self.stack.edges()?.with(SurfaceSettings::new().reach(0.2))
    }

    fn of_itself(&self) -> Result<Vec<Box<dyn ContactConstraint<f64>>>> {
        let Solid { nodes, .. } = &self.stack.solid;
        BodyContact::of_itself(nodes, &self.stack.solid.node_dofs(), self.stack.surfaces().concat())?.constraints()
    }

    /// Lets the block fall until t = `until`, by steps of a Courant number.
    pub fn run(&self, keeps: Keeps, scheme: Box<dyn TimeIntegrator>, courant: f64, until: f64) -> Result<FallFigures> {
        let Self { stack, speed, crossing, .. } = self;
        let (solid, h) = (&stack.solid, courant * crossing);
        let constraints: Vec<Box<dyn ContactConstraint<f64>>> = match keeps {
            Keeps::TwoPasses => vec![Box::new(self.two_passes()?)],
            Keeps::TwoPassesAndEdges => vec![Box::new(self.two_passes()?), Box::new(self.edges()?)],
            Keeps::Mortar => vec![self.mortar()?],
            Keeps::Bodies => self.bodies()?,
            Keeps::Itself => self.of_itself()?,
        };
        let mut run = Simulation::builder(Hyperelastic::new(solid, Law::NeoHookean), scheme, h)
            .velocity(stack.velocity_of_upper([0.0, 0.0, -speed]))
            .corrector(PersistencyCorrection::with_history_projection())
            .step_control(StepControl::halving(h / 256.0)?)
            .constraints(constraints)
            .build()?;
        let (mut nodes, mut crossed) = (self.two_passes()?, self.edges()?);
        let up: Vec<f64> = (0..solid.dofs()).map(|dof| f64::from(u8::from(dof % 3 == 2))).collect();
        let (momentum, energy) = (run.momentum(&up)?, run.energy().total());
        let mut figures = FallFigures {
            highest: 1.0,
            highest_at: 0.0,
            last: 1.0,
            rise: 0.0,
            node_depth: 0.0,
            edge_depth: 0.0,
            refused: 0,
            momentum: 0.0,
            touched: false,
        };
        while run.time() < until {
            run.step()?;
            let total = run.energy().total() / energy;
            figures.rise = figures.rise.max(total - figures.last);
            figures.last = total;
            if total > figures.highest {
                (figures.highest, figures.highest_at) = (total, run.time());
            }
            figures.node_depth = figures.node_depth.max(depth(&mut nodes, &run)?);
            figures.edge_depth = figures.edge_depth.max(depth(&mut crossed, &run)?);
        }
        figures.refused = run.statistics().refused_steps;
        figures.touched = run.statistics().contact_changes > 0;
        figures.momentum = (run.momentum(&up)? / momentum - 1.0).abs();
        Ok(figures)
    }
}

/// The deepest of the gaps that a constraint finds where a run is.
pub(crate) fn depth(constraint: &mut impl ContactConstraint<f64>, run: &Simulation<'_, f64>) -> Result<f64> {
    let (time, state) = (run.time(), run.state());
    constraint.search_on(time, state.displacement(), state.velocity(), 0.0)?;
    let mut gaps = vec![0.0; constraint.candidates()];
    constraint.gap(time, state.displacement(), &mut gaps);
    Ok(gaps.into_iter().fold(0.0, |deepest, gap| deepest.max(-gap)))
}
