//! Contact problems with friction beside those of their normal rows alone: a body of elements whose bottom is pressed
//! onto a floor and sheared, and piles of rigid boxes, whose rows depend on one another.
//!
//! `cargo bench --bench friction`

use contact_dynamics::Newmark;
use contact_dynamics::contact_solver::{ActiveSet, AdmissibleSet, ContactProblem, ContactSolver, GaussSeidel};
use contact_dynamics_scenes::boxes;
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments};
use std::time::Instant;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

const FRICTION: f64 = 0.4;

/// Rows of a problem: W, q. Three a contact, the normal one first.
type Rows = (Vec<f64>, Vec<f64>);

fn main() {
    let arguments = Arguments::read(&[4, 8, 12, 16, 24, 32, 55], &[3]);
    println!(
        "{:<26} {:>9} {:>18} {:>18} {:>18} {:>9}",
        "", "contacts", "frictionless ms", "ActiveSet ms (its)", "GaussSeidel ms", "ratio"
    );
    for &side in &arguments.sizes {
        row("thick plate, sheared", &body(side), &arguments);
    }
    let heights: &[usize] = if arguments.quick { &[2] } else { &[3, 10, 30] };
    for &height in heights {
        row("pile of rigid boxes", &heap(height), &arguments);
    }
}

fn row(name: &str, (w, q): &Rows, arguments: &Arguments) {
    let contacts = q.len() / 3;
    let cones = vec![AdmissibleSet::Cone3 { friction: FRICTION }; contacts];
    let (mut active, mut sweeps) = (ActiveSet::default(), GaussSeidel::default());
    let (newton, iterations) = time(&mut active, (w, q, &cones), arguments);
    let (swept, _) = time(&mut sweeps, (w, q, &cones), arguments);
    let normal = |i: usize| (0..contacts).map(move |j| w[3 * i * q.len() + 3 * j]);
    let (w, q): Rows = ((0..contacts).flat_map(normal).collect(), (0..contacts).map(|i| q[3 * i]).collect());
    let (bare, _) = time(&mut ActiveSet::default(), (&w, &q, &vec![AdmissibleSet::NonNegative; contacts]), arguments);
    let newton = newton.expect("a problem with a solution");
    let iterations = iterations.map_or(String::new(), |iterations| format!("({iterations})"));
    let swept = swept.map_or("not converged".to_string(), |swept| format!("{swept:.3}"));
    let bare = bare.expect("a problem with a solution");
    println!("{name:<26} {contacts:>9} {bare:>18.3} {newton:>12.3} {iterations:>5} {swept:>18} {:>9.1}", newton / bare);
}

/// Milliseconds of a solution, and its iterations; nothing if there is none.
fn time(
    solver: &mut dyn ContactSolver<f64>,
    (w, q, sets): (&[f64], &[f64], &[AdmissibleSet]),
    arguments: &Arguments,
) -> (Option<f64>, Option<usize>) {
    let tolerance = vec![0.0; q.len()];
    let problem = ContactProblem::new(w, q, sets, &tolerance).expect("parts that fit");
    let (mut multipliers, mut samples, mut iterations) = (vec![0.0; q.len()], Vec::new(), None);
    for _ in 0..arguments.repeated(5) {
        multipliers.fill(0.0);
        let start = Instant::now();
        let Ok(spent) = solver.solve(&problem, &mut multipliers) else { return (None, None) };
        samples.push(start.elapsed().as_secs_f64() * 1e3);
        iterations = Some(spent);
    }
    (Some(timing::median(&samples)), iterations)
}

/// A thick plate on a floor, `side` nodes a side in contact: pressed in the middle, and sheared away from it, so that
/// it sticks inside and slides outside.
fn body(side: usize) -> Rows {
    let cells = side - 1;
    let plate = Solid::block([1.0, 1.0, 0.25], [cells, cells, cells.div_ceil(4)], MATERIAL);
    let h = 1.0 / cells as f64 / MATERIAL.wave_speed();
    let bottom: Vec<usize> = (0..plate.nodes.len()).filter(|&node| plate.nodes[node][2] == 0.0).collect();
    let dofs: Vec<usize> = bottom.iter().flat_map(|&node| [0, 1, 2].map(|axis| Solid::<3>::dof(node, axis))).collect();
    let a = timing::effective(&plate.stiffness::<f64>(), &plate.lumped_mass(), &Newmark::trapezoidal(), h);
    let mut factor = timing::factor(&a, &dofs);
    let size = dofs.len();
    let mut response = vec![0.0; size * size];
    response.iter_mut().step_by(size + 1).for_each(|w| *w = 1.0);
    factor.condensation().expect("Cholesky condenses").solve(&mut response).expect("a direct solve");
    // Normal rows first.
    let at = |row: usize| row / 3 * 3 + (row + 2) % 3;
    let w = (0..size * size).map(|entry| response[at(entry / size) * size + at(entry % size)]).collect();
    let q = bottom.iter().flat_map(|&node| {
        let [x, y, _] = plate.nodes[node];
        let [x, y] = [x - 0.5, y - 0.5];
        [x * x + y * y - 0.4, 0.6 * x, 0.6 * y]
    });
    (w, q.collect())
}

/// Boxes one on the other, which fall and slide.
fn heap(height: usize) -> Rows {
    let mut random = Congruential(13);
    let shifts: Vec<[f64; 2]> = (0..height).map(|_| [0.1 * random.signed(), 0.1 * random.signed()]).collect();
    let free: Vec<f64> = (0..6 * height).map(|k| if k % 6 == 2 { -1.0 } else { 0.3 * random.signed() }).collect();
    boxes::problem(&boxes::pile(&shifts), &free)
}
