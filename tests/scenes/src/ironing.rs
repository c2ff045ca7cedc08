//! Ironing: a round stamp is pressed into a block and drawn along it, slowly.

use crate::solids::{Material, Solid};
use crate::stacks::Stack;
use contact_dynamics::contact::ContactConstraint;
use contact_dynamics::{Newmark, Result, Simulation};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Length of the block.
pub const LENGTH: f64 = 3.0;

/// Depth of the stamp, and its way along the block.
const DEPTH: f64 = 0.03;
pub const WAY: f64 = 1.0;

/// When the stamp is in and begins to move, and when it stops.
pub const SETTLED: f64 = 60.0;
pub const END: f64 = 260.0;

/// A block and a stamp with so many elements along them. The stamp is 1 wide, its lower side an arc of radius 1, and
/// touches the block at a third of its length.
pub fn scene(block: usize, stamp: usize) -> Stack<2> {
    let below = Solid::rectangle([LENGTH, 1.0], [block, block / 3], MATERIAL);
    let above = Solid::rectangle([1.0; 2], [stamp, stamp / 2], MATERIAL);
    let split = below.nodes.len();
    let mut stack = Stack::new([below, above], 1e-6, |x| x);
    for [x, y] in &mut stack.solid.nodes[split..] {
        let from_middle = *x - 0.5;
        *y += (1.0 - (1.0 - from_middle * from_middle).sqrt()) * (2.0 - *y).max(0.0);
        *x += 0.5 * (LENGTH - 1.0 - WAY);
    }
    stack
}

/// A smooth way from 0 at `from` to 1 at `to`, with its derivatives.
fn smooth(t: f64, from: f64, to: f64) -> [f64; 3] {
    let (length, s) = (to - from, ((t - from) / (to - from)).clamp(0.0, 1.0));
    let value = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    [value, 30.0 * s * s * (1.0 - s) * (1.0 - s) / length, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (length * length)]
}

/// The motion of the stamp, by a scheme that damps all waves: forces of a slow motion.
pub fn simulation(scene: &Stack<2>, contact: Box<dyn ContactConstraint<f64>>) -> Result<Simulation<'static, f64>> {
    let solid = &scene.solid;
    let mut system = solid.system::<f64>();
    for (node, &[_, y]) in solid.nodes.iter().enumerate() {
        if y < 1e-9 {
            system = system.fix(2 * node)?.fix(2 * node + 1)?;
        } else if y > 2.0 - 1e-9 {
            system = system.drive(2 * node, |t| smooth(t, SETTLED, END).map(|x| WAY * x))?;
            system = system.drive(2 * node + 1, |t| smooth(t, 0.0, 0.5 * SETTLED).map(|x| -DEPTH * x))?;
        }
    }
    Simulation::builder(system, Newmark::new(0.5, 1.0)?, 0.25).constraint(contact).build()
}

/// The force of the stamp on the block.
pub fn force_on_block(scene: &Stack<2>, run: &Simulation<'_, f64>) -> [f64; 2] {
    let mut force = [0.0; 2];
    for contact in run.contact_forces() {
        for (dof, part) in contact.forces().filter(|(dof, _)| *dof < 2 * scene.split) {
            force[dof % 2] += part;
        }
    }
    force
}
