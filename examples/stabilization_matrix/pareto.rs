//! The figure: error of the force against error of the energy.

use crate::combinations::{Combination, Correction};
use crate::report::Results;
use contact_dynamics_scenes::masses::Treatment;
use example_support::plot::{
    Axis, BLUE, Cloud, DARK, GRAY, GREEN, Key, Mark, ORANGE, PURPLE, RGBColor, VERMILION, scatter,
};
use std::error::Error;

/// Kinds of combinations, each with a color.
const KINDS: [(&str, RGBColor); 7] = [
    ("raw", GRAY),
    ("λ_v/λ_a", ORANGE),
    ("other correction", PURPLE),
    ("velocity level", GREEN),
    ("massless", VERMILION),
    ("massless, blend", BLUE),
    ("preset", DARK),
];

fn kind(combination: &Combination) -> usize {
    match (combination.preset, combination.mass, combination.correction) {
        (Some(_), ..) => 6,
        (None, Treatment::RedistributedBlend(_), _) => 5,
        (None, Treatment::Redistributed(_), _) => 4,
        (None, _, Correction::None) if combination.load() < 1.0 && combination.scheme().starts_with("Moreau") => 3,
        (None, _, Correction::None) => 0,
        (None, _, Correction::Persistency | Correction::History | Correction::Release) => 1,
        (None, ..) => 2,
    }
}

/// Errors of a row: of the energy, of the force.
fn errors(results: &Results, row: usize) -> Option<[f64; 2]> {
    let errors = [results.of(row, "energy_loss")?.mean.abs(), results.of(row, "force_l1")?.mean];
    errors.iter().all(|error| error.is_finite()).then_some(errors)
}

/// Energies nearer than this are equal, as are overshoots of the force.
const SAME_ENERGY: f64 = 1e-4;
const SAME_OVERSHOOT: f64 = 5e-3;
/// Forces and costs within 5 % are equal: times are measured no better.
const SAME: f64 = 1.05;

/// The rows that no other one beats: as good in energy, force, overshoot of the force and cost, and better in one of
/// them. In the order of energies; of equal rows the first one.
pub(crate) fn front(results: &Results, cost: &[Option<f64>]) -> Vec<usize> {
    let all = || {
        (0..results.rows.len()).filter_map(|row| {
            let [energy, force] = errors(results, row)?;
            let overshoot = (results.of(row, "force_max")?.mean - 1.0).abs();
            Some((row, [energy, force, overshoot, cost[row].unwrap_or(1.0)]))
        })
    };
    // Whether x is better than y, by more than nothing, in each criterion.
    let better = |x: [f64; 4], y: [f64; 4]| {
        [x[0] + SAME_ENERGY < y[0], x[1] * SAME < y[1], x[2] + SAME_OVERSHOOT < y[2], x[3] * SAME < y[3]]
    };
    let beaten = |(row, own): (usize, [f64; 4])| {
        all().any(|(other, errors)| {
            let worse = better(own, errors).contains(&true);
            !worse && (better(errors, own).contains(&true) || other < row)
        })
    };
    let mut front: Vec<_> = all().filter(|row| !beaten(*row)).collect();
    front.sort_by(|x, y| x.1[0].total_cmp(&y.1[0]));
    front.into_iter().map(|(row, _)| row).collect()
}

/// The figure; the area of a mark is the cost of a step, relative to the trapezoidal rule. Rows that no other one beats
/// have numbers, and a key says which they are.
pub(crate) fn figure(
    combinations: &[Combination],
    results: &Results,
    cost: &[Option<f64>],
) -> Result<String, Box<dyn Error>> {
    let front = front(results, cost);
    let mark = |row: usize| {
        let [energy, force] = errors(results, row)?;
        let radius = 5.0 * cost[row].unwrap_or(1.0).clamp(0.3, 6.0).sqrt();
        let label = front.iter().position(|&other| other == row).map(|place| (place + 1).to_string());
        Some(Mark { at: (energy.max(1e-9).log10(), force.max(1e-9).log10()), radius, label })
    };
    let clouds: Vec<Cloud> = KINDS
        .iter()
        .enumerate()
        .map(|(number, &(label, color))| {
            let own = (0..combinations.len()).filter(|&row| kind(&combinations[row]) == number);
            Cloud { label, color, marks: own.filter_map(mark).collect() }
        })
        .collect();
    let x = Axis::decades("energy lost or won by the impact (fraction)", -5, 1, 1);
    let y = Axis::decades("mean error of the contact force / F₀", -3, 1, 1);
    let title = format!(
        "Two bars of {} elements, h = {} s: force against energy; area: cost of a step",
        results.elements, results.h
    );
    let line = |(number, &row): (usize, &usize)| {
        let names = combinations[row].names().map(|name| name.replace("**", ""));
        let parts: Vec<_> = names.iter().filter(|name| *name != "–").map(String::as_str).collect();
        format!("{number}  {}", parts.join(", "))
    };
    // In the empty part of the frame: errors of the force as large as the force itself, small losses.
    let key = Key { at: (-4.2, 0.9), lines: (1..).zip(&front).map(line).collect() };
    scatter(&title, &x, &y, &clouds, &key)
}
