//! A bar of two parts that are tied to each other: its frequencies beside those of a bar of one piece.

use contact_dynamics::contact::{ContactConstraint, Contacts};
use contact_dynamics::faer::{Mat, Side};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;
use std::error::Error;
use std::f64::consts::PI;
use std::fmt::Write;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.0, density: 1.0 };

/// Length and height of the bar.
const SIZE: [f64; 2] = [4.0, 1.0];

/// Errors of the first frequencies of a free bar.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Tied bar: errors of its first frequencies in bending and lengthwise, free at all sides, ν = 0, in its elements \
         along and across; bending against the finest bar of one piece, lengthwise against π √(E/ρ)/l\n\n\
         | bar | elements | bending | lengthwise |\n\
         | --- | --- | --- | --- |\n",
    );
    let fine = if quick { [16, 4] } else { [48, 12] };
    let bending = first(&frequencies(&Solid::rectangle(SIZE, fine, MATERIAL), None)?, false);
    let mut row = |bar: &str, elements: &str, frequencies: &[(f64, bool)]| {
        let (bends, stretches) =
            (first(frequencies, false) / bending - 1.0, first(frequencies, true) * SIZE[0] / PI - 1.0);
        writeln!(table, "| {bar} | {elements} | {:.2} % | {:.2} % |", 100.0 * bends, 100.0 * stretches)
    };
    for cells in [[8, 2], [8, 4], [12, 3], [12, 4], [16, 3], [16, 6]] {
        let bar = Solid::rectangle(SIZE, cells, MATERIAL);
        row("one piece", &format!("{} × {}", cells[0], cells[1]), &frequencies(&bar, None)?)?;
    }
    let half = [SIZE[0], 0.5 * SIZE[1]];
    for (lower, upper) in [(8, 12), (12, 16), (8, 16), (12, 8), (16, 12)] {
        // (A stack's bodies are as high as one: the half bars are drawn to height one and put back.)
        let bodies = [lower, upper].map(|cells| Solid::rectangle([half[0], 1.0], [cells, cells / 8 + 1], MATERIAL));
        let bar = Stack::new(bodies, 0.0, |[x, y]| [x, 0.5 * y]);
        let elements = format!("{lower} × {} below, {upper} × {} above", lower / 8 + 1, upper / 8 + 1);
        row("lower and upper half, upper the slave", &elements, &frequencies(&bar.solid, Some(&bar.tie(true)?))?)?;
    }
    for (left, right) in [([4, 2], [6, 3]), ([6, 3], [4, 2]), ([6, 4], [8, 3])] {
        let bodies = [left, right].map(|[along, across]| Solid::rectangle([1.0; 2], [across, along], MATERIAL));
        // Along x; mirrored, so that elements stay counterclockwise.
        let bar = Stack::new(bodies, 0.0, |[x, y]| [0.5 * SIZE[0] * y, SIZE[1] * (1.0 - x)]);
        let elements = format!("{} × {} left, {} × {} right", left[0], left[1], right[0], right[1]);
        row("left and right half, right the slave", &elements, &frequencies(&bar.solid, Some(&bar.tie(true)?))?)?;
    }
    Ok(table)
}

/// The first frequency of motions along the bar, or of others.
fn first(frequencies: &[(f64, bool)], lengthwise: bool) -> f64 {
    frequencies.iter().find(|(_, along)| *along == lengthwise).map_or(f64::NAN, |(frequency, _)| *frequency)
}

/// Circular frequencies above zero, ascending, and whether the motion is lengthwise.
fn frequencies(solid: &Solid<2>, tie: Option<&dyn ContactConstraint<f64>>) -> Result<Vec<(f64, bool)>, Box<dyn Error>> {
    let n = solid.dofs();
    let (k, m) = (solid.stiffness::<f64>().to_dense(), solid.consistent_mass().to_dense());
    // A basis of all displacements that the rows allow.
    let basis = match tie {
        None => Mat::identity(n, n),
        Some(tie) => {
            let rows = Contacts::of(tie);
            let mut transposed = Mat::zeros(n, rows.len());
            for row in 0..rows.len() {
                rows.row(row).for_each(|(place, weight)| transposed[(tie.dofs()[place], row)] = weight);
            }
            transposed.qr().compute_Q().subcols(rows.len(), n - rows.len()).to_owned()
        }
    };
    let (k, m) = (basis.transpose() * &k * &basis, basis.transpose() * &m * &basis);
    let cholesky = m.llt(Side::Lower).map_err(|error| format!("{error:?}"))?;
    let l = cholesky.L().to_owned();
    // L⁻¹ K L⁻ᵀ
    let mut scaled = k;
    l.solve_lower_triangular_in_place(scaled.as_mut());
    let mut scaled = scaled.transpose().to_owned();
    l.solve_lower_triangular_in_place(scaled.as_mut());
    let modes = scaled.self_adjoint_eigen(Side::Lower).map_err(|error| format!("{error:?}"))?;
    let mut all = Vec::new();
    for mode in 0..scaled.nrows() {
        let value = modes.S()[mode];
        if value < 1e-8 {
            continue;
        }
        let mut vector = modes.U().subcols(mode, 1).to_owned();
        l.transpose().solve_upper_triangular_in_place(vector.as_mut());
        let shape = &basis * &vector;
        // Lengthwise: it moves more along the bar than across.
        let [mut along, mut across] = [0.0, 0.0];
        for node in 0..solid.nodes.len() {
            along += shape[(2 * node, 0)].powi(2);
            across += shape[(2 * node + 1, 0)].powi(2);
        }
        all.push((value.sqrt(), along > across));
    }
    Ok(all)
}
