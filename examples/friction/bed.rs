//! A bar pushed along a rough bed: the way of its end, and how quiet friction is once it has stopped.

use crate::rows::{CD_LAGRANGE, CHUNG_HULBERT, COMPOSITE, Correction, Scheme, TRAPEZOIDAL, Table};
use contact_dynamics::{Result, Simulation, mass};
use contact_dynamics_scenes::bed::Bed;

/// Courant numbers of the steps.
const COURANTS: [f64; 3] = [0.25, 0.5, 1.0];

const ROWS: [(Scheme, Correction); 5] = [
    (TRAPEZOIDAL, Correction::None),
    (TRAPEZOIDAL, Correction::Persistency),
    (COMPOSITE, Correction::Persistency),
    (CHUNG_HULBERT, Correction::Persistency),
    (CD_LAGRANGE, Correction::None),
];

/// The digits of what is measured.
const DIGITS: [i32; 2] = [3, -2];

pub(crate) fn tables(quick: bool) -> Vec<String> {
    let [schemes, weights]: [&[usize]; 2] = if quick { [&[20], &[20]] } else { [&[60, 240], &[60, 120]] };
    let schemes = schemes.iter().map(|&elements| by_scheme(elements));
    schemes.chain(weights.iter().map(|&elements| by_mass(elements))).collect()
}

/// Error of the way in percent, and the variation.
fn measured(bed: &Bed, run: Result<Simulation<'static, f64>>) -> Result<[f64; 2]> {
    let [way, variation] = bed.measure(&mut run?)?;
    Ok([100.0 * (way - 1.0), variation])
}

fn by_scheme(elements: usize) -> String {
    let title = format!(
        "Bar on a rough bed, {elements} elements, lumped mass, by Courant number: error of the way of its end, \
         variation of all friction after the stop over the force on the end"
    );
    let figures = COURANTS.map(|courant| ["way %", "variation"].map(|figure| format!("{courant}: {figure}"))).concat();
    let head: Vec<&str> = ["scheme", "correction"].into_iter().chain(figures.iter().map(String::as_str)).collect();
    let mut table = Table::new(&title, &head);
    let bed = Bed::new(elements);
    for (scheme, correction) in ROWS {
        let of = |courant| measured(&bed, bed.run((scheme.make)(), correction.correctors(), courant));
        table.row(&[scheme.name, correction.name()], DIGITS, COURANTS.map(of).into());
    }
    table.text()
}

/// The consistent mass with a weight, the rest lumped. Dispersion of the trapezoidal rule cancels at 0.75 for the
/// Courant number 0.5, at 1.31 for 0.9; for 1 it would at 1.5, where the mass is singular.
fn by_mass(elements: usize) -> String {
    let title = format!(
        "Bar on a rough bed, {elements} elements, trapezoidal rule, by Courant number and weight of the consistent \
         mass in a blend with the lumped one (* cancels dispersion)"
    );
    let head = ["Courant", "weight", "raw: way %", "variation", "corrected: way %", "variation"];
    let mut table = Table::new(&title, &head);
    let bed = Bed::new(elements);
    let weights: [(f64, &[f64]); 3] =
        [(0.5, &[0.5, 0.75, 1.0, 1.25]), (0.9, &[0.5, 1.0, 1.31]), (1.0, &[0.5, 1.0, 1.4, 1.49])];
    for (courant, weights) in weights {
        let best = mass::optimal_weight(&(TRAPEZOIDAL.make)().tableau(), courant).ok();
        for &weight in weights {
            let of = |correction: Correction| {
                measured(&bed, bed.blended((TRAPEZOIDAL.make)(), correction.correctors(), courant, weight))
            };
            let mark = if best.is_some_and(|best| (best - weight).abs() < 1e-9) { " *" } else { "" };
            let names = [courant.to_string(), format!("{weight}{mark}")];
            table.row(&[&names[0], &names[1]], DIGITS, [Correction::None, Correction::Persistency].map(of).into());
        }
    }
    table.text()
}
