//! Dual shape functions of the multiplier on a slave facet, blended with standard ones if it is partly covered.
//!
//! ψ_a = Σ_b A_ab N_b with A = D M⁻¹, D = diag ∫N_a, M = ∫N_a N_b over the whole facet satisfies ∫ψ_a N_b = δ_ab ∫N_a
//! (Wohlmuth, SIAM J. Numer. Anal. 38, 2000). A is the same for all segments, for all triangles and for all
//! parallelograms.
//!
//! ψ is negative somewhere, so that ∫ψ_a over a part of a facet may be negative. So the weights are (1 − c) N + c ψ,
//! with c a smooth function of the covered share κ of the facet's area, zero up to [`ENOUGH`]. All integrals are
//! linear in N. They are found with N, and multiplied by B = I + c (A − I). Derivatives also have δB = c′ (A − I) δκ.

use super::points::{Column, column};
use super::sums::{Sums, area, factor};
use crate::contact::surface::{Base, Facet, add_scaled, middle};

/// The weights of gaps: standard or dual shape functions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Multiplier {
    #[default]
    Standard,
    Dual,
}

/// The covered share up to which a facet keeps the standard shape functions: below, ∫ψ_a may be near zero.
const ENOUGH: f64 = 0.75;

/// A by the number of corners.
fn dual(count: usize) -> [[f64; 4]; 4] {
    match count {
        2 => [[2.0, -1.0, 0.0, 0.0], [-1.0, 2.0, 0.0, 0.0], [0.0; 4], [0.0; 4]],
        3 => [[3.0, -1.0, -1.0, 0.0], [-1.0, 3.0, -1.0, 0.0], [-1.0, -1.0, 3.0, 0.0], [0.0; 4]],
        _ => [[4.0, -2.0, 1.0, -2.0], [-2.0, 4.0, -2.0, 1.0], [1.0, -2.0, 4.0, -2.0], [-2.0, 1.0, -2.0, 4.0]],
    }
}

/// c and c′ at the covered share κ.
fn blend(covered: f64) -> [f64; 2] {
    let s = ((covered - ENOUGH) / (1.0 - ENOUGH)).clamp(0.0, 1.0);
    [s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / (1.0 - ENOUGH)]
}

/// The transformation of a facet's integrals with N to integrals with its weights.
pub(super) struct Blend {
    count: usize,
    /// B.
    matrix: [[f64; 4]; 4],
    /// By corner, the derivatives of ∫N g and ∫N with respect to the covered area, through B.
    by_area: [[f64; 2]; 4],
    covered: f64,
}

impl Blend {
    /// Transforms the sums of a facet's corners over its covered part to sums with its weights.
    pub(super) fn of(base: &Base, sums: &mut [Sums; 4]) -> Self {
        let count = base.count();
        let whole = area(base);
        let covered = sums[..count].iter().map(|sums| sums.area).sum::<f64>() / whole;
        let [c, slope] = blend(covered);
        let mut matrix = dual(count);
        for (a, row) in matrix.iter_mut().enumerate() {
            row[a] -= 1.0;
        }
        let found = *sums;
        let by_area = std::array::from_fn(|a| {
            let mut change = Sums::default();
            matrix[a].iter().zip(&found).for_each(|(share, found)| change.add_scaled(*share, found));
            sums[a].add_scaled(c, &change);
            [change.moment, change.area].map(|change| slope / whole * change)
        });
        for (a, row) in matrix.iter_mut().enumerate() {
            *row = row.map(|share| c * share);
            row[a] += 1.0;
        }
        Self { count, matrix, by_area, covered }
    }

    /// Transforms the contributions of nodes to the rows of a facet's corners.
    pub(super) fn weigh<'a>(&self, all: impl Iterator<Item = &'a mut [Column; 4]>) {
        for columns in all {
            let found = *columns;
            let area = found[..self.count]
                .iter()
                .fold([0.0; 3], |sum, &[_, _, _, p, q, r, ..]| add_scaled(sum, 1.0, [p, q, r]));
            for (into, (row, by_area)) in columns[..self.count].iter_mut().zip(self.matrix.iter().zip(self.by_area)) {
                let [moment, of_area] = by_area.map(|by_area| area.map(|x| by_area * x));
                *into = column(moment, of_area, 0.0);
                for (share, found) in row[..self.count].iter().zip(&found) {
                    into.iter_mut().zip(found).for_each(|(into, x)| *into += share * x);
                }
            }
        }
    }

    /// Calls `act` with the contributions of the corners by the growth of the whole facet, which changes the covered
    /// share.
    pub(super) fn each_of_whole(&self, base: &Base, facet: &Facet, mut act: impl FnMut(usize, [Column; 4])) {
        if self.by_area.iter().flatten().all(|x| *x == 0.0) {
            return;
        }
        let by_corner = base.turned(&middle(self.count), base.normal).map(|x| x.map(|x| factor(self.count) * x));
        for (&node, growth) in facet.nodes().iter().zip(by_corner) {
            act(
                node,
                self.by_area.map(|by_area| {
                    let [moment, area] = by_area.map(|by_area| growth.map(|x| -self.covered * by_area * x));
                    column(moment, area, 0.0)
                }),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shape functions at points of equal area.
    fn points(count: usize) -> Vec<[f64; 4]> {
        let size = 200;
        let line = |k: usize| (k as f64 + 0.5) / size as f64;
        match count {
            2 => (0..size * size)
                .map(|k| (k as f64 + 0.5) / (size * size) as f64)
                .map(|s| [1.0 - s, s, 0.0, 0.0])
                .collect(),
            3 => (0..size)
                .flat_map(|i| (0..size).map(move |j| (line(i), line(j))))
                .map(|(s, t)| if s + t < 1.0 { (s, t) } else { (1.0 - s, 1.0 - t) })
                .map(|(s, t)| [1.0 - s - t, s, t, 0.0])
                .collect(),
            _ => (0..size)
                .flat_map(|i| (0..size).map(move |j| (line(i), line(j))))
                .map(|(s, t)| [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t])
                .collect(),
        }
    }

    #[test]
    fn functions_are_dual_and_a_partition_of_unity() {
        for count in 2..=4 {
            let (points, matrix) = (points(count), dual(count));
            for (a, row) in matrix.iter().enumerate().take(count) {
                let psi = |n: &[f64; 4]| row.iter().zip(n).map(|(share, n)| share * n).sum::<f64>();
                assert!((matrix.iter().map(|row| row[a]).sum::<f64>() - 1.0).abs() < 1e-15);
                for b in 0..count {
                    let product = points.iter().map(|n| psi(n) * n[b]).sum::<f64>() / points.len() as f64;
                    let expected = if a == b { 1.0 / count as f64 } else { 0.0 };
                    assert!((product - expected).abs() < 2e-4, "{count}, {a}, {b}: {product}");
                }
            }
        }
    }

    #[test]
    fn weights_are_positive_whatever_part_is_covered() {
        for count in 2..=4 {
            let (points, matrix) = (points(count), dual(count));
            for percent in 1..=100 {
                let [c, _] = blend(percent as f64 / 100.0);
                // The weight less N/3. In the worst case its greatest values are not covered.
                let excess = |n: &[f64; 4]| {
                    let psi = (0..4).map(|b| matrix[0][b] * n[b]).sum::<f64>();
                    (1.0 - c) * n[0] + c * psi - n[0] / 3.0
                };
                let mut values: Vec<f64> = points.iter().map(excess).collect();
                values.sort_unstable_by(f64::total_cmp);
                let least: f64 = values.iter().take(values.len() * percent / 100).sum();
                assert!(least > 0.0, "{count}, {percent} %: {least}");
            }
        }
    }
}
