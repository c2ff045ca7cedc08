//! Checks whether edges have passed through each other in a step, by their straight paths.

use super::EdgeToEdge;
use super::lines::{Crossing, Ways};
use super::pairs::{Pair, motion};
use crate::contact::surface::{Bounds, Point, add_scaled, dot, norm, sub};
use crate::contact::{COARSE, FINE, LARGEST_MISS, Stride, impacts_differ, kept_depth};
use crate::error::Result;
use crate::real::Real;

/// Number of depths that are checked between two meetings of the lines.
const CHECKS: u32 = 4;

impl<T: Real> EdgeToEdge<T> {
    /// Rejects a step in which two edges went through each other, or were stopped apart.
    pub(super) fn check_step(&mut self, step: &Stride<'_, T>) -> Result<()> {
        let motions = self.nodes.boxes_of(|node| self.nodes.way(node, step.u));
        let longest = motions[0].farthest(&motions[1]);
        if self.edges.iter().any(Vec::is_empty) || longest <= FINE * self.finest {
            return Ok(());
        }
        let mut ends = std::mem::take(&mut self.ends);
        for (positions, u) in ends.iter_mut().zip(step.u) {
            self.nodes.places_at(u, positions);
        }
        let [one, other] = self.nodes.bodies().each_ref().map(|nodes| swept(nodes, &ends));
        let mut result = self.check_rows(step, &ends);
        if result.is_ok() && one.intersects(&other) {
            // The lists are complete already unless the edges were faster than their velocities at the search.
            self.update_lists(longest);
            result = self.check_paths(step, &ends);
        }
        self.ends = ends;
        result
    }

    /// Rejects a step in which rows have stopped edges apart.
    fn check_rows(&self, step: &Stride<'_, T>, ends: &[Vec<Point>; 2]) -> Result<()> {
        let [start, end] = [0, 1].map(|k| move |node: usize| ends[k][node]);
        for (row, &index) in self.rows.identities.iter().enumerate() {
            if let Err((what, path, gap)) = self.check_row(row, step, index, (&start, &end)) {
                return Err(step.rejected((index[0], index[1]), what, path, gap));
            }
        }
        Ok(())
    }

    /// Rejects a step in which edges went through each other.
    fn check_paths(&self, step: &Stride<'_, T>, ends: &[Vec<Point>; 2]) -> Result<()> {
        let [start, end] = [0, 1].map(|k| move |node: usize| ends[k][node]);
        for index in self.lists.pairs() {
            let Some(pair) = self.sides(step.t[1]).meeting(index) else { continue };
            // Edges stopped by a spring penetrate.
            let springs =
                self.settings.given_law().is_compliant() && self.rows.identities.binary_search(&index).is_ok();
            let [one, other] = pair.edges.map(|edge| swept(&edge.nodes, ends));
            if springs || !one.intersects(&other) {
                continue;
            }
            if let Err((what, path, gap)) = self.check_path(&pair, (&start, &end)) {
                return Err(step.rejected((index[0], index[1]), what, path, gap));
            }
        }
        Ok(())
    }

    /// Checks the position and normal at which a row has stopped its edges; returns the reason for a rejection.
    fn check_row(
        &self,
        row: usize,
        step: &Stride<'_, T>,
        index: [usize; 2],
        (start, end): (&impl Fn(usize) -> Point, &impl Fn(usize) -> Point),
    ) -> std::result::Result<(), (&'static str, f64, f64)> {
        let [pair_before, pair] = step.t.map(|t| self.sides(t).pair(index));
        if step.closed[0][row] || !step.closed[1][row] {
            return Ok(());
        }
        let normal = self.rows.spots[row].normal;
        let [before, after] = [pair.ends(start), pair.ends(end)];
        let Some([from, to]) = Crossing::of(before).zip(Crossing::of(after)).map(<[Crossing; 2]>::from) else {
            return Ok(());
        };
        let [from, to] = [from, to].map(|crossing| crossing.as_seen_along(normal));
        let gap = pair_before.clear(&from);
        let by = [0, 1].map(|k| [0, 1].map(|j| sub(after[k][j], before[k][j])));
        let path = norm(motion(by, to.shares));
        if path <= FINE * self.finest {
            return Ok(());
        }
        if !pair.is_about(&to, end) {
            return Err(("was stopped where the edges do not meet", path, gap));
        }
        // A deep penetration is kept, see `recovery`.
        let kept = kept_depth(gap, self.settings.given_law().recovery(pair_before.recovery()));
        if (pair.clear(&to) + kept).abs() > LARGEST_MISS * path {
            return Err(("was stopped away from the other edge", path, gap));
        }
        let speed = motion(pair.ends(&|node| self.nodes.vector(node, step.v)), from.shares);
        let speeds = [from.normal, to.normal].map(|normal| dot(normal, speed));
        if path > COARSE * self.finest && impacts_differ(speeds, dot(speed, speed)) {
            return Err(("was stopped along a normal that is not the one where the edges met", path, gap));
        }
        Ok(())
    }

    /// Checks whether the edges have penetrated each other along their paths; returns the reason for a rejection.
    fn check_path(
        &self,
        pair: &Pair<'_>,
        (start, end): (&impl Fn(usize) -> Point, &impl Fn(usize) -> Point),
    ) -> std::result::Result<(), (&'static str, f64, f64)> {
        let before = pair.ends(start);
        let after = pair.ends(end);
        let by = [0, 1].map(|k| [0, 1].map(|j| sub(after[k][j], before[k][j])));
        let ways = Ways::new(before, by);
        for share in ways.meetings() {
            let then = |node: usize| add_scaled(start(node), share, sub(end(node), start(node)));
            let Some(entry) = pair.meeting(&then) else { continue };
            let along = motion(by, entry.shares);
            let path = norm(along);
            if dot(entry.normal, along) >= 0.0 || path <= FINE * self.finest {
                continue;
            }
            let last = ways.meetings().find(|&next| next > share).unwrap_or(1.0);
            let depth = (1..=CHECKS).filter_map(|check| {
                let later = share + (last - share) * f64::from(check) / f64::from(CHECKS);
                let crossing = Crossing::of(ways.at(later))?.as_seen_along(entry.normal);
                crossing.excess().iter().all(|&excess| excess == 0.0).then_some(-crossing.gap)
            });
            if depth.fold(0.0, f64::max) > LARGEST_MISS * path {
                let gap = Crossing::of(before).map_or(0.0, |start| start.as_seen_along(entry.normal).gap);
                return Err(("went through another edge", path, gap));
            }
        }
        Ok(())
    }
}

/// The box of nodes at both ends of a step.
fn swept(nodes: &[usize], ends: &[Vec<Point>; 2]) -> Bounds {
    Bounds::of_points(nodes.iter().flat_map(|&node| [ends[0][node], ends[1][node]]))
}
