//! Steps in which hundreds of contacts close: a thick plate that falls onto a floor, slightly tilted, so that a front
//! of contact runs across it.

use super::pressed::{floor_at, patch, plate, simulation};
use contact_dynamics::Newmark;
use example_support::timing::{self, Arguments};
use std::time::Instant;

/// Speed of the fall, where the wave speed is about 1.
const SPEED: f64 = 1e-3;

/// Steps in which the front runs across.
const STEPS: f64 = 5.0;

pub(crate) fn measure(arguments: &Arguments) {
    let (plate, cells, h) = plate(arguments);
    println!("plate of {cells:?} elements, {} dofs, that falls onto a floor, tilted: steps of an impact", plate.dofs());
    println!(
        "{:<12} {:>14} {:>12} {:>14} {:>14} {:>16}",
        "candidates", "bare solve ms", "step", "contacts", "changed", "/ bare solve"
    );
    let sides: &[usize] = if arguments.quick { &[4] } else { &[20, 30, 40] };
    for &side in sides {
        let nodes = patch(&plate, cells, side);
        let vertical: Vec<usize> = nodes.iter().map(|&node| 3 * node + 2).collect();
        let a = timing::effective(&plate.stiffness::<f64>(), &plate.lumped_mass(), &Newmark::trapezoidal(), h);
        let mut solve = timing::solve(timing::factor(&a, &[]), plate.dofs());
        let bare = timing::median(&(0..9).map(|_| milliseconds(&mut solve)).collect::<Vec<_>>());
        drop(a);
        // The front starts in the second step.
        let x = |node: usize| plate.nodes[node][0];
        let width = x(nodes[nodes.len() - 1]) - x(nodes[0]);
        let gaps = nodes.iter().map(|&node| SPEED * h * (1.5 + STEPS * (x(node) - x(nodes[0])) / width));
        let contact = floor_at(vertical.iter().copied().zip(gaps));
        let fall = (0..plate.dofs()).map(|dof| if dof % 3 == 2 { -SPEED } else { 0.0 }).collect();
        let mut run = simulation(&plate, contact, h, fall);
        let mut closed = vec![false; nodes.len()];
        for step in 1..=10 {
            let spent = milliseconds(|| run.step().expect("a well-posed step"));
            let now = run.state().contacts().closed();
            let changed = now.iter().zip(&closed).filter(|(now, before)| now != before).count();
            closed.copy_from_slice(now);
            let count = closed.iter().filter(|&&closed| closed).count();
            println!("{:<12} {bare:>14.2} {step:>12} {count:>14} {changed:>14} {:>16.2}", nodes.len(), spent / bare);
        }
    }
    println!();
}

/// Milliseconds of a call.
fn milliseconds(mut call: impl FnMut()) -> f64 {
    let start = Instant::now();
    call();
    start.elapsed().as_secs_f64() * 1e3
}
