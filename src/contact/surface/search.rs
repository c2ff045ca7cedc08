//! The facets that a node may be in contact with: lists kept over many steps, from an R*-tree of the facets' boxes.

use super::shape::{Point, RIM, Shape, norm};
use crate::rounding::rounding;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use std::ops::ControlFlow;

/// An axis-parallel box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) lower: Point,
    pub(crate) upper: Point,
}

impl Bounds {
    /// The empty box.
    pub(crate) const EMPTY: Self = Self { lower: [f64::INFINITY; 3], upper: [f64::NEG_INFINITY; 3] };

    #[inline]
    pub(crate) fn include(&mut self, x: Point) {
        self.lower = std::array::from_fn(|i| self.lower[i].min(x[i]));
        self.upper = std::array::from_fn(|i| self.upper[i].max(x[i]));
    }

    pub(crate) fn of_points(points: impl IntoIterator<Item = Point>) -> Self {
        points.into_iter().fold(Self::EMPTY, |mut bounds, x| {
            bounds.include(x);
            bounds
        })
    }

    #[inline]
    pub(crate) fn of_corners(shape: &Shape) -> Self {
        Self::of_points(shape.corners().iter().copied())
    }

    fn with(&self, other: &Self) -> Self {
        Self::of_points([self.lower, self.upper, other.lower, other.upper])
    }

    #[inline]
    pub(crate) fn inflated(&self, by: f64) -> Self {
        Self { lower: self.lower.map(|x| x - by), upper: self.upper.map(|x| x + by) }
    }

    #[inline]
    pub(crate) fn intersects(&self, other: &Self) -> bool {
        (0..3).all(|i| self.lower[i] <= other.upper[i] && other.lower[i] <= self.upper[i])
    }

    /// The largest component of the vector from a point to the box; zero inside.
    #[inline]
    pub(crate) fn distance(&self, x: Point) -> f64 {
        (0..3).fold(0.0, |most, i| most.max(self.lower[i] - x[i]).max(x[i] - self.upper[i]))
    }

    #[inline]
    pub(crate) fn contains(&self, x: Point) -> bool {
        (0..3).all(|i| self.lower[i] <= x[i] && x[i] <= self.upper[i])
    }

    /// A bound of |x − y| for x in one box and y in the other.
    #[inline]
    pub(crate) fn farthest(&self, other: &Self) -> f64 {
        norm(self.largest_differences(other))
    }

    /// The largest components of x − y for x in one box and y in the other, in either direction.
    #[inline]
    fn largest_differences(&self, other: &Self) -> Point {
        std::array::from_fn(|i| (self.upper[i] - other.lower[i]).max(other.upper[i] - self.lower[i]))
    }

    #[inline]
    pub(super) fn extent(&self) -> f64 {
        (0..3).map(|i| self.upper[i] - self.lower[i]).fold(0.0, f64::max)
    }

    /// Largest absolute coordinate: the scale of rounding.
    pub(crate) fn magnitude(&self) -> f64 {
        self.lower.iter().chain(&self.upper).fold(0.0, |largest, x| x.abs().max(largest))
    }

    /// The largest one of these components.
    #[inline]
    pub(crate) fn spread(&self, other: &Self) -> f64 {
        let [x, y, z] = self.largest_differences(other);
        x.max(y).max(z)
    }
}

/// How far beyond the box of a facet its closest points can lie: facets extend a little beyond the rim.
pub(crate) fn overhang(bounds: &Bounds) -> f64 {
    overhang_of(bounds.extent())
}

/// As [`overhang`], from the longest side of the box.
pub(super) fn overhang_of(extent: f64) -> f64 {
    8.0 * RIM * extent
}

/// Lists of entries, one after another.
#[derive(Debug)]
pub(crate) struct Lists<E> {
    starts: Vec<usize>,
    entries: Vec<E>,
}

impl<E> Default for Lists<E> {
    fn default() -> Self {
        Self { starts: vec![0], entries: Vec::new() }
    }
}

impl<E> Lists<E> {
    pub(super) fn clear(&mut self) {
        self.starts.truncate(1);
        self.entries.clear();
    }

    /// Appends a list; returns it.
    pub(super) fn push(&mut self, list: impl IntoIterator<Item = E>) -> &mut [E] {
        let start = self.entries.len();
        self.entries.extend(list);
        self.starts.push(self.entries.len());
        &mut self.entries[start..]
    }

    /// The k-th list; empty if there is none.
    pub(crate) fn of(&self, k: usize) -> &[E] {
        self.starts.get(k..k + 2).map_or(&[], |range| &self.entries[range[0]..range[1]])
    }
}

/// For each of some boxes, the facets whose boxes were within the range when the lists were built, in ascending order,
/// so that results do not depend on the age of the lists.
pub(crate) type Neighborhood = Lists<usize>;

impl Neighborhood {
    /// Whether a facet is in the list of the k-th box.
    pub(crate) fn holds(&self, k: usize, facet: usize) -> bool {
        self.of(k).binary_search(&facet).is_ok()
    }

    /// Rebuilds the list of the others within `range` of each box.
    pub(crate) fn build(
        &mut self,
        boxes: impl Iterator<Item = Bounds> + Clone,
        others: impl Iterator<Item = Bounds>,
        range: f64,
    ) {
        self.clear();
        each_near(boxes, others, range, |found| self.push(found.iter().copied()).sort_unstable());
    }
}

/// Calls `act` for each box with the others, in any order, that are within `range` of it.
pub(super) fn each_near(
    boxes: impl Iterator<Item = Bounds> + Clone,
    others: impl Iterator<Item = Bounds>,
    range: f64,
    mut act: impl FnMut(&[usize]),
) {
    let all = boxes.clone().reduce(|all, bounds| all.with(&bounds)).unwrap_or(Bounds::EMPTY);
    let leaves = others.enumerate().filter_map(|(index, bounds)| {
        let rounded = rounding(bounds.magnitude().max(all.magnitude()));
        let near = bounds.inflated(range + overhang(&bounds) + rounded);
        let leaf = || GeomWithData::new(Rectangle::from_corners(near.lower, near.upper), index);
        near.intersects(&all).then(leaf)
    });
    let tree = RTree::bulk_load(leaves.collect());
    let mut near = Vec::new();
    for bounds in boxes {
        near.clear();
        let found = AABB::from_corners(bounds.lower, bounds.upper);
        let _: ControlFlow<()> = tree.locate_in_envelope_intersecting_int(&found, |leaf| {
            near.push(leaf.data);
            ControlFlow::Continue(())
        });
        act(&near);
    }
}
