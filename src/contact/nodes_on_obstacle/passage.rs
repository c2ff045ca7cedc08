//! Checks the paths of nodes near an obstacle in a step: whether one went through it, or was stopped along a wrong
//! normal.

use super::super::obstacle::{dot, minus};
use super::super::{LARGEST_MISS, LARGEST_TURN, Obstacle, STEEP, impacts_differ};
use super::Row;
use crate::real::Real;

/// Whether an obstacle turns so far in a step that its path is not determined by its ends.
pub(super) fn turns_too_far<T: Real>(angle: T) -> bool {
    angle.value() > LARGEST_TURN.acos()
}

/// Checks the path of a node between two points in the frame of the obstacle, which begins with this velocity.
/// Returns the reason for a rejection, and the gap at its start. The row of the node, if any, comes with its flags at
/// the start and at the end: closed or not.
pub(super) fn check_path<T: Real, const D: usize>(
    obstacle: &dyn Obstacle<T, D>,
    row: Option<(&Row<T, D>, [bool; 2])>,
    ends: [[T; D]; 2],
    velocity: [T; D],
) -> std::result::Result<(), (&'static str, T)> {
    let path = minus(ends[1], ends[0]);
    let (gap, normal) = obstacle.distance(ends[1]);
    let Some((row, [was_closed, closed])) = row else {
        let start = obstacle.distance(ends[0]).0;
        return match gap < T::zero() || obstacle.passage(ends[0], ends[1]).is_some() {
            true => Err(("was out of reach, and is in the body or beyond it", start)),
            false => Ok(()),
        };
    };
    let (start, start_normal) = row.start;
    if closed {
        if dot(start_normal, normal) < T::of(LARGEST_TURN) {
            return Err(("presses on a surface that turns by more than 30 degrees on the way", start));
        }
        let speeds = [start_normal, normal].map(|n| dot(n, velocity).value());
        if !was_closed && impacts_differ(speeds, dot(velocity, velocity).value()) {
            return Err(("was stopped along a normal that is not the one where it met the surface", start));
        }
        return Ok(());
    }
    // Within the step the gap of the row is linear. A node is missed if only the true gap is negative.
    let missed = start + dot(start_normal, path) - gap;
    if gap < T::zero() && missed > T::of(LARGEST_MISS) * dot(path, path).sqrt() {
        return Err(("is in the body, and was taken to be outside", start));
    }
    match obstacle.passage(ends[0], ends[1]) {
        Some(passage) if passage.steepness > T::of(STEEP) => Err(("went through the body", start)),
        _ => Ok(()),
    }
}
