//! Piles of rigid boxes with friction, as contact problems: many more rows than motions.

/// Half the lengths of a box.
pub const HALF: [f64; 3] = [0.5, 0.4, 0.2];
/// Its mass.
pub const MASS: f64 = 2.0;
/// Its moments of inertia.
pub const INERTIA: [f64; 3] = [0.13, 0.19, 0.27];

/// Boxes on a rough floor, one on the other, each shifted by so much, with a contact at each corner of its bottom: rows
/// of G by the velocities and spins of all boxes, normal rows first.
pub fn pile(shifts: &[[f64; 2]]) -> Vec<Vec<f64>> {
    let size = 6 * shifts.len();
    let mut rows = Vec::new();
    for (place, shift) in shifts.iter().enumerate() {
        for corner in 0..4 {
            let x = [HALF[0] * [-1.0, 1.0][corner % 2], HALF[1] * [-1.0, 1.0][corner / 2], -HALF[2]];
            for axis in [2, 0, 1] {
                let mut row = vec![0.0; size];
                // The velocity of a point along an axis: e · (v + ω × x).
                let mut add = |place: usize, x: [f64; 3], sign: f64| {
                    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
                    row[6 * place + axis] += sign;
                    row[6 * place + 3 + j] += sign * x[k];
                    row[6 * place + 3 + k] -= sign * x[j];
                };
                add(place, x, 1.0);
                if place > 0 {
                    let below = [x[0] + shift[0], x[1] + shift[1], HALF[2]];
                    add(place - 1, below, -1.0);
                }
                rows.push(row);
            }
        }
    }
    rows
}

/// The same pile in the plane of the first and the last axis: two corners a box, two rows a corner.
pub fn in_plane(mut rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut place = 0..;
    rows.retain(|_| place.next().is_some_and(|row| row / 3 % 4 < 2 && row % 3 < 2));
    for row in &mut rows {
        row.iter_mut().enumerate().filter(|(k, _)| ![0, 2, 4].contains(&(k % 6))).for_each(|(_, entry)| *entry = 0.0);
    }
    rows
}

/// W and q of a pile whose boxes would move so without contact.
pub fn problem(rows: &[Vec<f64>], free: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let inverse = |k: usize| if k % 6 < 3 { MASS.recip() } else { INERTIA[k % 6 - 3].recip() };
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).enumerate().map(|(k, (a, b))| a * b * inverse(k)).sum::<f64>();
    let w = rows.iter().flat_map(|a| rows.iter().map(|b| product(a, b))).collect();
    let q = rows.iter().map(|row| row.iter().zip(free).map(|(g, v)| g * v).sum()).collect();
    (w, q)
}
