//! Second differences of gaps along a straight motion of the nodes: the gap acceleration without nodal accelerations.

use super::{Nodes, Point, add_scaled, norm};
use crate::real::Real;
use crate::rounding::{NEAR_SHARE, rounding, time_resolution};

/// Time increment of the differences, as a share of the time ahead, as in `simulation/rows/rate_differences.rs` for
/// `f64`.
const SHARE: f64 = 1.0 / 16.0;

/// Gaps before, now and after, and the nodal positions for them.
#[derive(Debug, Default)]
pub(crate) struct SecondDifference {
    positions: Vec<Point>,
    gaps: [Vec<f64>; 3],
}

impl SecondDifference {
    /// Calls `act` with each row and d²g/ds² of its gap at time t + s and displacements u + s v, for s = 0. `gaps` is
    /// called three times with a time and the positions of the nodes of both bodies then, and writes the gaps (NaN
    /// where there is none). `ahead` is the time that the last search looks ahead. If it is zero, nodes move by a
    /// share of the smallest facet `finest`. Differences within rounding are zero.
    pub(crate) fn find<T: Real>(
        &mut self,
        nodes: &Nodes,
        (t, u, v): (f64, &[T], &[T]),
        (ahead, finest): (f64, f64),
        mut gaps: impl FnMut(f64, &[Point], &mut Vec<f64>),
        mut act: impl FnMut(usize, f64),
    ) {
        let speeds = nodes.bodies().iter().flatten().map(|&node| norm(nodes.vector(node, v)));
        let fastest = speeds.fold(0.0, f64::max);
        let step = match (ahead > 0.0, fastest > 0.0) {
            (true, _) => SHARE * ahead,
            (false, true) => NEAR_SHARE * finest / fastest,
            (false, false) => 0.0,
        };
        // A time increment that is exact in t.
        let delta = (t + step.max(time_resolution(t))) - t;
        let mut size = 0.0_f64;
        for (s, list) in [-delta, 0.0, delta].into_iter().zip(&mut self.gaps) {
            self.positions.resize(nodes.coordinates.len(), [0.0; 3]);
            for &node in nodes.bodies().iter().flatten() {
                let moved = add_scaled(nodes.vector(node, u), s, nodes.vector(node, v));
                let position = add_scaled(nodes.coordinates[node], 1.0, moved);
                size = position.iter().fold(size, |most, x| most.max(x.abs()));
                self.positions[node] = position;
            }
            list.clear();
            gaps(t + s, &self.positions, list);
        }
        let [before, now, after] = &self.gaps;
        for (row, ((before, now), after)) in before.iter().zip(now).zip(after).enumerate() {
            let change = (after - now) - (now - before);
            let most = before.abs().max(now.abs()).max(after.abs());
            act(row, if change.abs() > rounding(size + most) { change / (delta * delta) } else { 0.0 });
        }
    }
}
