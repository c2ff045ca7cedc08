//! Two cylinders that press on each other, against the pressure of Hertz.

use contact_dynamics::contact::ContactConstraint;
use contact_dynamics_scenes::hertz::{Cylinders, HertzErrors};
use example_support::output::decimal;
use std::error::Error;
use std::fmt::Write;

/// By how much elements of the one body are larger than those of the other.
const COARSER: f64 = 1.3;

/// Depth of the meshes and radius of the upper body over half the contact's width.
const DEPTH: f64 = 3.0;
const RADIUS: f64 = 1e3;

/// Errors of pressure and force.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Two cylinders, by elements of the lower body and the upper one over half the contact's width a: errors over \
         Hertz of the pressure on the nodes of either surface (L² over |x| < 1.2 a), of the largest pressure (the \
         worse of both), and of the force (the worst of the three); one pass takes nodes of the upper body, which is \
         the slave of mortar\n\n\
         | elements below, above | one pass, below | above | largest | two passes, below | above | largest | \
         mortar, below | above | largest | force |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let finest = if quick { &[5.0][..] } else { &[5.0, 10.0, 20.0, 40.0] };
    for mesh in [[1.0, 1.0], [1.0 / COARSER, 1.0], [1.0, 1.0 / COARSER]] {
        for &fine in finest {
            row(&mut table, mesh.map(|share| fine * share))?;
        }
    }
    Ok(table)
}

fn row(table: &mut String, elements: [f64; 2]) -> Result<(), Box<dyn Error>> {
    let scene = Cylinders::new(elements, DEPTH, RADIUS);
    let contacts: [Box<dyn ContactConstraint<f64>>; 3] = [
        Box::new(scene.stack.nodes_on_facets(1)?),
        Box::new(scene.stack.nodes_on_facets(2)?),
        Box::new(scene.stack.mortar(true)?),
    ];
    let percent = |error: f64| format!("{} %", decimal(100.0 * error, 2));
    write!(table, "| {:.1}, {:.1} |", elements[0], elements[1])?;
    let mut worst = 0.0_f64;
    for contact in contacts {
        let HertzErrors { pressure: [below, above], peak, force } = scene.pressed(contact)?;
        let largest =
            peak.into_iter().fold(0.0_f64, |worst, error| if error.abs() > worst.abs() { error } else { worst });
        write!(table, " {} | {} | {} |", percent(below), percent(above), percent(largest))?;
        worst = worst.max(force.abs());
    }
    writeln!(table, " {} |", percent(worst))?;
    Ok(())
}
