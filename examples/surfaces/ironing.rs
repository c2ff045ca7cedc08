//! Ironing: a round stamp is pressed into a block and drawn along it, slowly. The forces of a continuum are constant.

use contact_dynamics::contact::ContactConstraint;
use contact_dynamics::{Newmark, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;
use std::error::Error;
use std::fmt::Write;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Depth of the stamp, way along the block, and when it is in and begins to move.
const DEPTH: f64 = 0.03;
const WAY: f64 = 1.0;
const SETTLED: f64 = 60.0;
const END: f64 = 260.0;

/// How much the force on the block varies along the way.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Ironing: a round stamp drawn over a block, in its elements of the block: (largest − smallest)/mean of the \
         vertical force, and largest horizontal force over the mean vertical one, without friction\n\n\
         | elements of the block, of the stamp | contact | facets passed | vertical | horizontal |\n\
         | --- | --- | --- | --- | --- |\n",
    );
    let meshes = if quick { &[(20, 6)][..] } else { &[(20, 6), (30, 14), (60, 14), (60, 40)] };
    for &(block, stamp) in meshes {
        let scene = scene(block, stamp);
        let contacts: [(&str, Box<dyn ContactConstraint<f64>>); 6] = [
            ("nodes of the stamp, one pass", Box::new(scene.nodes_on_facets(1)?)),
            ("nodes, two passes", Box::new(scene.nodes_on_facets(2)?)),
            ("mortar, stamp the slave", Box::new(scene.mortar(true)?)),
            ("mortar, block the slave", Box::new(scene.mortar(false)?)),
            ("dual mortar, stamp the slave", Box::new(scene.mortar(true)?.dual()?)),
            ("dual mortar, block the slave", Box::new(scene.mortar(false)?.dual()?)),
        ];
        for (name, contact) in contacts {
            let passed = WAY * block as f64 / LENGTH;
            match run(&scene, contact) {
                Ok([vertical, horizontal]) => writeln!(
                    table,
                    "| {block}, {stamp} | {name} | {passed:.0} | {:.2} % | {:.2} % |",
                    100.0 * vertical,
                    100.0 * horizontal
                )?,
                Err(error) => {
                    eprintln!("{block}, {stamp}, {name}: {error}");
                    writeln!(table, "| {block}, {stamp} | {name} | {passed:.0} | fails | |")?;
                }
            }
        }
    }
    Ok(table)
}

/// Length of the block.
const LENGTH: f64 = 3.0;

/// The stamp is 1 wide, its lower side an arc of radius 1, and touches the block at a third of its length.
fn scene(block: usize, stamp: usize) -> Stack<2> {
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

fn run(scene: &Stack<2>, contact: Box<dyn ContactConstraint<f64>>) -> Result<[f64; 2], Box<dyn Error>> {
    let Stack { solid, split, .. } = scene;
    let mut system = solid.system::<f64>();
    for (node, &[_, y]) in solid.nodes.iter().enumerate() {
        if y < 1e-9 {
            system = system.fix(2 * node)?.fix(2 * node + 1)?;
        } else if y > 2.0 - 1e-9 {
            system = system.drive(2 * node, |t| smooth(t, SETTLED, END).map(|x| WAY * x))?;
            system = system.drive(2 * node + 1, |t| smooth(t, 0.0, 0.5 * SETTLED).map(|x| -DEPTH * x))?;
        }
    }
    // A scheme that damps all waves: forces of a slow motion.
    let mut run = Simulation::builder(system, Newmark::new(0.5, 1.0)?, 0.25).constraint(contact).build()?;
    let (mut smallest, mut largest, mut sum, mut across, mut count) = (f64::INFINITY, 0.0_f64, 0.0, 0.0_f64, 0.0);
    while run.time() < END {
        run.step()?;
        // In the middle of the way, where ends of the block are far.
        if run.time() < SETTLED + 0.2 * (END - SETTLED) || run.time() > END - 0.2 * (END - SETTLED) {
            continue;
        }
        let mut force = [0.0; 2];
        for contact in run.contact_forces() {
            for &(dof, weight) in contact.row.iter().filter(|(dof, _)| *dof < 2 * split) {
                force[dof % 2] += weight * contact.force;
            }
        }
        (smallest, largest) = (smallest.min(-force[1]), largest.max(-force[1]));
        (sum, across, count) = (sum - force[1], across.max(force[0].abs()), count + 1.0);
    }
    let mean: f64 = sum / count;
    Ok([(largest - smallest) / mean, across / mean])
}
