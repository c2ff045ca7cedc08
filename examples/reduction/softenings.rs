//! Which softening suits which impact: a front, two faces, a growing contact.

use crate::bars::Table;
use crate::strikes::Kind;
use contact_dynamics_scenes::impact_scenes::{Ball, fastest_wave, two_blocks};
use contact_dynamics_scenes::impacts::{Impact, Model, Step};
use example_support::output::decimal;
use std::fmt::Write;

/// Errors against the whole model on the same mesh.
pub(crate) fn softenings(quick: bool) -> Table {
    let ball = if quick { Ball::new(0.15, 2, [5, 5, 7])? } else { Ball::new(0.15, 6, [11, 11, 17])? };
    let cells: usize = if quick { 4 } else { 16 };
    let modes = if quick { 10 } else { 50 };
    let mut table = format!(
        "Taper p = 3 with other softenings, {modes} modes of each body: error of the force over time (largest force), \
         both of the whole model on the same mesh\n\n| softening | ball | two blocks |\n| --- | --- | --- |\n"
    );
    let scenes: [(Impact, f64); 2] = [
        (ball.impact.clone(), ball.hertz.duration() / 400.0),
        (two_blocks(cells)?, 0.5 / cells as f64 / fastest_wave()),
    ];
    let wholes = scenes.iter().map(|(impact, h)| impact.course(Model::Whole, Step::Of(*h)));
    let wholes = wholes.collect::<contact_dynamics::Result<Vec<_>>>()?;
    let softenings: &[f64] = if quick { &[0.0, 2.0] } else { &[0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0] };
    for &softening in softenings {
        write!(table, "| {softening} |")?;
        for ((impact, h), whole) in scenes.iter().zip(&wholes) {
            let course = impact.course(Kind::softened(softening).of(modes), Step::Of(*h))?;
            let largest = course.largest() / whole.largest();
            write!(table, " {} ({}) |", decimal(course.error(whole), 3), decimal(largest, 2))?;
        }
        table += "\n";
    }
    Ok(table)
}
