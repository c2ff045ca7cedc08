//! The dam: blocks side by side along an arc, joints between neighbors, water, weight and shaking.
//!
//! Displacements are those relative to the ground, in components along the arc (across the joints), downstream and
//! upward: a contact is then one dof of each of two blocks. Nodes on the rock do not move and are no unknowns.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::reduction::Boundary::{self, CraigBampton, Tapered, Untapered};
use contact_dynamics_scenes::ground::{GRAVITY, Ground};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{Entry, matrix};
use std::f64::consts::PI;
use std::ops::Range;

/// Concrete (Pa, kg/m³).
const CONCRETE: Material = Material { young: 24e9, poisson: 0.2, density: 2400.0 };
/// Density of water (kg/m³).
const WATER: f64 = 1000.0;
/// Height of the dam in the middle and at its ends, thickness at the crest and how much it grows with depth, radius of
/// the upstream face and half the angle of the arc (m, rad).
const HEIGHTS: [f64; 2] = [80.0, 20.0];
const THICKNESS: [f64; 2] = [6.0, 0.35];
const RADIUS: f64 = 500.0;
const HALF: f64 = 0.2;
/// The part of the arc along which the floor of the valley is level.
const LEVEL: f64 = 0.3;
/// 5 % of damping at 4 Hz and 20 Hz.
pub(crate) const RAYLEIGH: [f64; 2] = {
    let [low, high] = [2.0 * PI * 4.0, 2.0 * PI * 20.0];
    [2.0 * 0.05 * low * high / (low + high), 2.0 * 0.05 / (low + high)]
};

/// How fine, and how long.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) blocks: usize,
    /// Elements of a block along the arc, downstream and upward.
    pub(crate) cells: [usize; 3],
    pub(crate) step: f64,
    /// Steps of the earthquake.
    pub(crate) steps: usize,
    pub(crate) reduced: &'static [Way],
    /// Friction in the joints.
    pub(crate) friction: f64,
}

/// How blocks are reduced, and to how many modes each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub(crate) boundary: Boundary,
    /// Softening of tapered blocks, if not the default.
    pub(crate) softening: Option<f64>,
    pub(crate) modes: usize,
    pub(crate) scheme: Scheme,
}

/// The schemes of the runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scheme {
    Trapezoidal,
    /// Chung and Hulbert's with ρ∞ = 0.9.
    Damped,
}

/// Without a choice of softening, by the scheme that suits the boundary: contact dofs without mass that rattle keep the
/// noise of all modes that the step does not resolve, unless the scheme damps it.
const fn way(boundary: Boundary, modes: usize) -> Way {
    let scheme = if matches!(boundary, CraigBampton) { Scheme::Trapezoidal } else { Scheme::Damped };
    Way { boundary, softening: None, modes, scheme }
}

/// Untapered, by the trapezoidal rule all the same.
const fn undamped(modes: usize) -> Way {
    Way { scheme: Scheme::Trapezoidal, ..way(Untapered, modes) }
}

/// Tapered, and statically exact.
const fn unsoftened(modes: usize) -> Way {
    Way { softening: Some(0.0), ..way(Tapered, modes) }
}

impl Plan {
    pub(crate) const QUICK: Self = Self {
        blocks: 20,
        cells: [1, 2, 4],
        step: 0.02,
        steps: 80,
        reduced: &[way(Tapered, 10), unsoftened(10), way(Untapered, 10), undamped(10), way(CraigBampton, 10)],
        friction: 0.0,
    };
    pub(crate) const FULL: Self = Self {
        cells: [2, 6, 16],
        step: 0.0125,
        steps: 240,
        reduced: &[way(Tapered, 30), unsoftened(30), way(Untapered, 30), undamped(30), way(CraigBampton, 30)],
        ..Self::QUICK
    };

    /// A coarse mesh, for joints that rub: a contact has three rows then.
    pub(crate) fn rubbing(friction: f64, steps: usize) -> Self {
        Self { cells: [2, 2, 4], friction, steps, reduced: Self::RUBBING, ..Self::QUICK }
    }

    const RUBBING: &'static [Way] = &[way(CraigBampton, 10)];

    /// How long all steps are.
    pub(crate) fn duration(&self) -> f64 {
        self.step * self.steps as f64
    }
}

/// What acts on the dam beside water and weight: the motion of the ground.
#[derive(Debug)]
pub(crate) struct Loading {
    pub(crate) ground: [Ground; 3],
}

impl Loading {
    /// The share of water and weight, and the accelerations of the ground.
    pub(crate) fn at(&self, t: f64) -> [f64; 4] {
        let [across, downstream, upward] = [0, 1, 2].map(|k: usize| self.ground[k].at(t));
        [1.0, across, downstream, upward]
    }
}

/// A block between two joints.
#[derive(Debug)]
pub(crate) struct Block {
    pub(crate) stiffness: SparseColMat<usize, f64>,
    pub(crate) mass: Vec<f64>,
    /// Water and weight, then the forces of unit accelerations of the ground.
    pub(crate) loads: [Vec<f64>; 4],
    /// Dofs across the joint to the left and to the right, ascending.
    pub(crate) faces: [Vec<usize>; 2],
}

impl Block {
    /// All contact dofs, ascending: those across the joints, and where these rub the others of their nodes.
    pub(crate) fn contact(&self, friction: f64) -> Vec<usize> {
        let components = if friction > 0.0 { 3 } else { 1 };
        let mut dofs: Vec<usize> =
            self.faces.iter().flatten().flat_map(|&across| across..across + components).collect();
        dofs.sort_unstable();
        dofs
    }

    /// Its loads, scaled, added up.
    pub(crate) fn load(&self, scales: [f64; 4]) -> Vec<f64> {
        let at = |dof: usize| self.loads.iter().zip(scales).map(|(load, scale)| scale * load[dof]).sum();
        (0..self.mass.len()).map(at).collect()
    }
}

/// All blocks.
#[derive(Debug)]
pub(crate) struct Dam {
    pub(crate) blocks: Vec<Block>,
    /// Block and dof on the left and on the right of each contact.
    pub(crate) contacts: Vec<[(usize, usize); 2]>,
    /// The contacts of each joint.
    pub(crate) joints: Vec<Range<usize>>,
}

impl Dam {
    pub(crate) fn new(plan: &Plan) -> Self {
        let blocks: Vec<Block> = (0..plan.blocks).map(|number| block(plan, number)).collect();
        let (mut contacts, mut joints) = (Vec::new(), Vec::new());
        for (number, pair) in blocks.windows(2).enumerate() {
            let first = contacts.len();
            let matching = pair[0].faces[1].iter().zip(&pair[1].faces[0]);
            contacts.extend(matching.map(|(&left, &right)| [(number, left), (number + 1, right)]));
            joints.push(first..contacts.len());
        }
        Self { blocks, contacts, joints }
    }

    /// Dofs of all blocks.
    pub(crate) fn dofs(&self) -> usize {
        self.blocks.iter().map(|block| block.mass.len()).sum()
    }
}

/// Height of the rock below the crest.
fn depth(angle: f64) -> f64 {
    let place = (angle.abs() / HALF - LEVEL).max(0.0) / (1.0 - LEVEL);
    HEIGHTS[0] + (HEIGHTS[1] - HEIGHTS[0]) * place
}

/// Along the arc, downstream, upward.
fn directions(angle: f64) -> [[f64; 3]; 3] {
    let (s, c) = angle.sin_cos();
    [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
}

fn block(plan: &Plan, number: usize) -> Block {
    let cells = plan.cells;
    let angle = |x: f64| HALF * (2.0 * (number as f64 + x) / plan.blocks as f64 - 1.0);
    let solid = Solid::block([1.0; 3], cells, CONCRETE).mapped(|[x, y, z]| {
        let (theta, below) = (angle(x), depth(angle(x)) * (1.0 - z));
        let radius = RADIUS - y * (THICKNESS[0] + THICKNESS[1] * below);
        [radius * theta.sin(), RADIUS - radius * theta.cos(), -below]
    });
    // Nodes layer by layer, the ones on the rock first: what is left begins behind them.
    let [points, rows, _] = cells.map(|n| n + 1);
    let (layer, free) = (points * rows, 3 * (solid.nodes.len() - points * rows));
    let bases: Vec<_> =
        (0..solid.nodes.len()).map(|node| directions(angle((node % points) as f64 / cells[0] as f64))).collect();
    let mass = solid.lumped_mass::<f64>().split_off(3 * layer);
    let mut loads = [water(&solid, cells, &bases), vec![0.0; free], vec![0.0; free], vec![0.0; free]];
    loads[0].drain(..3 * layer);
    for (dof, &m) in mass.iter().enumerate() {
        let direction = bases[dof / 3 + layer][dof % 3];
        loads[0][dof] -= GRAVITY * m * direction[2];
        for (load, component) in loads[1..].iter_mut().zip(direction) {
            load[dof] = -m * component;
        }
    }
    let face = |x: usize| (0..free / 3).filter(|node| node % points == x).map(|node| 3 * node).collect();
    Block { stiffness: stiffness(&solid, &bases, layer), mass, loads, faces: [face(0), face(cells[0])] }
}

/// K in the directions of each node, without the nodes on the rock.
fn stiffness(solid: &Solid<3>, bases: &[[[f64; 3]; 3]], fixed: usize) -> SparseColMat<usize, f64> {
    let k = solid.stiffness::<f64>();
    let (k, count) = (k.as_ref(), solid.nodes.len());
    let mut entries: Vec<Entry> = Vec::new();
    for b in fixed..count {
        // Nodes are coupled by whole blocks of 3 × 3.
        let nodes: Vec<usize> = k.row_idx_of_col_raw(3 * b).iter().step_by(3).map(|row| row / 3).collect();
        for (place, &a) in nodes.iter().enumerate().filter(|(_, a)| **a >= fixed) {
            let block = [0, 1, 2].map(|j| &k.val_of_col(3 * b + j)[3 * place..3 * place + 3]);
            for (p, row) in bases[a].iter().enumerate() {
                for (q, column) in bases[b].iter().enumerate() {
                    let value: f64 =
                        (0..3).map(|j| column[j] * (0..3).map(|i| row[i] * block[j][i]).sum::<f64>()).sum();
                    entries.push((3 * (a - fixed) + p, 3 * (b - fixed) + q, value));
                }
            }
        }
    }
    matrix(3 * (count - fixed), entries)
}

/// The pressure of a full reservoir on the upstream face, in the directions of each node.
fn water(solid: &Solid<3>, cells: [usize; 3], bases: &[[[f64; 3]; 3]]) -> Vec<f64> {
    let [points, rows, _] = cells.map(|n| n + 1);
    let mut load = vec![0.0; solid.dofs()];
    for z in 0..cells[2] {
        for x in 0..cells[0] {
            let first = x + points * rows * z;
            let corners = [first, first + 1, first + points * rows + 1, first + points * rows];
            let [a, b, c, d] = corners.map(|node| solid.nodes[node]);
            let diagonals: [[f64; 3]; 2] = [std::array::from_fn(|i| c[i] - a[i]), std::array::from_fn(|i| d[i] - b[i])];
            // Seen from the water the corners go counterclockwise: the normal points into it.
            let normal: [f64; 3] = std::array::from_fn(|i| {
                let [j, k] = [(i + 1) % 3, (i + 2) % 3];
                0.5 * (diagonals[0][j] * diagonals[1][k] - diagonals[0][k] * diagonals[1][j])
            });
            let pressure = -WATER * GRAVITY * 0.25 * (a[2] + b[2] + c[2] + d[2]);
            for node in corners {
                for (axis, direction) in bases[node].iter().enumerate() {
                    let share: f64 = direction.iter().zip(normal).map(|(e, n)| e * n).sum();
                    load[3 * node + axis] -= 0.25 * pressure * share;
                }
            }
        }
    }
    load
}
