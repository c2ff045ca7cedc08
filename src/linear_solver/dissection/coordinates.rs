//! Separators by coordinates: one layer of vertices across the longest axis.

use super::separator::{BETWEEN, Separator};
use crate::linear_solver::graph::{Graph, number};
use crate::rounding::half_digits;

/// Side 0 has the vertices below the median of the longest axis; vertices above with a neighbor below form the
/// separator.
pub(super) fn bisect(graph: &Graph, places: &[[f64; 3]]) -> Separator {
    let extent = |axis: usize| {
        let along = places.iter().map(|place| place[axis]);
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    };
    let longest = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let mut along: Vec<f64> = places.iter().map(|place| place[longest]).collect();
    let middle = along.len() / 2;
    let (_, &mut median, _) = along.select_nth_unstable_by(middle, f64::total_cmp);
    // Nodes of one layer differ by rounding.
    let layer = half_digits::<f64>() * extent(longest);
    let below = |vertex: u32| places[vertex as usize][longest] < median - layer;
    let label = |vertex: u32| match below(vertex) {
        true => 0,
        false if graph.neighbors(vertex).iter().any(|&neighbor| below(neighbor)) => BETWEEN,
        false => 1,
    };
    Separator::new(graph, (0..number(graph.size())).map(label).collect())
}
