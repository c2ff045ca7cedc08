//! Ironing: a round stamp is pressed into a block and drawn along it, slowly. The forces of a continuum are constant.

use contact_dynamics::contact::ContactConstraint;
use contact_dynamics_scenes::ironing::{END, LENGTH, SETTLED, WAY, force_on_block, scene, simulation};
use contact_dynamics_scenes::stacks::Stack;
use std::error::Error;
use std::fmt::Write;

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

fn run(scene: &Stack<2>, contact: Box<dyn ContactConstraint<f64>>) -> Result<[f64; 2], Box<dyn Error>> {
    let mut run = simulation(scene, contact)?;
    let (mut smallest, mut largest, mut sum, mut across, mut count) = (f64::INFINITY, 0.0_f64, 0.0, 0.0_f64, 0.0);
    while run.time() < END {
        run.step()?;
        // In the middle of the way, where ends of the block are far.
        if run.time() < SETTLED + 0.2 * (END - SETTLED) || run.time() > END - 0.2 * (END - SETTLED) {
            continue;
        }
        let force = force_on_block(scene, &run);
        (smallest, largest) = (smallest.min(-force[1]), largest.max(-force[1]));
        (sum, across, count) = (sum - force[1], across.max(force[0].abs()), count + 1.0);
    }
    let mean: f64 = sum / count;
    Ok([(largest - smallest) / mean, across / mean])
}
