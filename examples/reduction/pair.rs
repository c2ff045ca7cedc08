//! Two blocks of different sizes and materials that collide face to face.

use crate::bars::Table;
use crate::strikes::{models, relative};
use contact_dynamics_scenes::impact_scenes::{fastest_wave, plane_force, two_blocks};
use contact_dynamics_scenes::impacts::{Course, Model, Step};
use example_support::output::decimal;
use std::fmt::Write;

/// Finer by so much is the reference, in space and in time.
const FINER: usize = 4;

/// Steps of a mesh of so many elements on a unit of length: half of what a wave takes through one of them.
fn step(cells: usize) -> f64 {
    0.5 / cells as f64 / fastest_wave()
}

pub(crate) fn pair(quick: bool) -> Table {
    let (cells, counts): (usize, &[usize]) = if quick { (4, &[10, 20]) } else { (16, &[20, 50, 100, 200]) };
    let h = step(cells);
    let fine = two_blocks(FINER * cells)?.course(Model::Whole, Step::Of(step(FINER * cells)))?;
    let impact = two_blocks(cells)?;
    let whole = impact.course(Model::Whole, Step::Of(h))?;
    let rigid: f64 = impact.parts.iter().map(|part| part.mass().recip()).sum::<f64>().recip();
    let mut table = format!(
        "A block of quad4 elements strikes a wider one, {cells} elements on a unit of length, {} contacts, trapezoidal \
         rule; modes are those of each block: error of the force over time, of a mesh {FINER} times as fine and of the \
         whole model on the same mesh; largest force (plane waves press with {} of it), mean force and impulse over \
         those of the fine mesh; restitution; energy left; times; number of impacts after which the build is paid\n\n\
         | model | unknowns | error, of the fine mesh | error, of the same mesh | largest | mean | impulse | \
         restitution | energy | steps | run, ms | with build, ms | paid after |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
        impact.rows.len(),
        decimal(plane_force() / fine.largest(), 2)
    );
    let mut line = |name: &str, course: &Course| {
        let [of_fine, of_whole] = [&fine, &whole].map(|reference| decimal(course.error(reference), 3));
        // J = (1 + e) m v, m the reduced mass of the two, v = 1.
        let relative = relative(course, [&fine, &whole], course.impulse / rigid - 1.0);
        writeln!(table, "| {name} | {} | {of_fine} | {of_whole} | {relative} |", course.unknowns)
    };
    line("whole, fine", &fine)?;
    line("whole", &whole)?;
    for &count in counts {
        for (name, model, step) in models(count, h) {
            line(&name, &impact.course(model, step)?)?;
        }
    }
    Ok(table)
}
