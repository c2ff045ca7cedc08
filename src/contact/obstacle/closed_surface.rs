//! A body given by a closed surface of triangles, or by a closed polygon.

use super::{Obstacle, dot};
use crate::contact::Facet;
use crate::contact::surface::{Bounds, Foot, Location, Point, Shape, Surface};
use crate::error::{Error, Result, positive};
use crate::real::Real;
use crate::rounding::{half_digits, rounding};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{ParentNode, RTree, RTreeNode, RTreeObject};
use std::collections::HashMap;

/// A facet by its index, in its box.
type Leaf = GeomWithData<Rectangle<Point>, usize>;

/// A rigid body whose surface is given by triangles, for instance from an STL file, or in two dimensions by the
/// segments of a polygon. The obstacle is the set of all points within a radius of that body, so that no convex edge
/// is sharp.
///
/// Facets list their vertices counter-clockwise seen from outside, segments with the body on their left. The surface
/// may have several parts, and hollows. It must not intersect itself; this is not checked. Then the normals at the
/// closest facet, edge or vertex determine the side of a point (Bærentzen and Aanæs, 2005, doi:10.1109/TVCG.2005.49).
/// The closest facet is found in an R*-tree.
///
/// The distance is exact. Within the radius around an edge its normal turns, and steps must resolve this where nodes
/// press on it: on a round body the normal turns by the angle between two facets, over the length of the radius times
/// that angle. Flat facets are moved outward by the radius. In notches, where the surface is not convex, the normal
/// jumps from one face to the other.
///
/// ```
/// use contact_dynamics::contact::{ClosedSurface, Obstacle};
///
/// // A wedge: 2 wide, its edge at the top.
/// let wedge = ClosedSurface::new(&[[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]], &[[0, 1], [1, 2], [2, 0]], 0.1)?;
/// let (gap, normal) = wedge.distance([0.0, 3.0]);
/// assert_eq!((gap, normal), (1.9, [0.0, 1.0]));
/// // A tetrahedron from loose triangles.
/// let [o, x, y, z] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let corner = ClosedSurface::from_loose_facets(&[[o, y, x], [o, z, y], [o, x, z], [x, y, z]], 0.25)?;
/// let (gap, normal) = corner.distance([0.25, 0.25, -1.0]);
/// assert_eq!((gap, normal), (0.75, [0.0, 0.0, -1.0]));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ClosedSurface<T, const D: usize> {
    surface: Surface,
    positions: Vec<Point>,
    tree: RTree<Leaf>,
    rounding: T,
}

/// The point of the surface closest to another point.
#[derive(Clone, Copy)]
struct Nearest {
    facet: usize,
    projected: (Shape, Foot),
}

fn in_space<T: Real, const D: usize>(x: [T; D]) -> Point {
    std::array::from_fn(|axis| x.get(axis).map_or(0.0, |x| x.value()))
}

impl<T: Real, const D: usize> ClosedSurface<T, D> {
    /// From vertices, facets that list them (two for segments in two dimensions, three for triangles), and the radius
    /// of the edges (length).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless the radius is positive and finite; [`Error::NotFinite`] for the vertices;
    /// [`Error::Empty`] without facets; [`Error::Dimension`] for vertices that do not exist; [`Error::InvertedFacet`]
    /// for a facet without length or area, or turned against its neighbors; [`Error::Incompatible`], with the
    /// location, if the surface has an end, branches or touches itself at a vertex, or if all of its normals point
    /// inward.
    pub fn new(vertices: &[[T; D]], facets: &[[usize; D]], rounding: T) -> Result<Self> {
        positive("the radius of a closed surface's edges", rounding.value())?;
        for (index, vertex) in vertices.iter().enumerate() {
            if let Some(x) = vertex.iter().find(|x| !x.is_finite()) {
                let what = "the list of vertices of a closed surface";
                return Err(Error::NotFinite { what, index, value: x.value() });
            }
        }
        let positions: Vec<Point> = vertices.iter().map(|&x| in_space(x)).collect();
        let facet = |nodes: &[usize; D]| match *nodes.as_slice() {
            [a, b] => Ok(Facet::from([a, b])),
            [a, b, c] => Ok(Facet::from([a, b, c])),
            _ => Err(Error::Dimension { what: "a vertex of a closed surface", expected: 3, found: D }),
        };
        let facets: Vec<_> = facets.iter().map(facet).collect::<Result<_>>()?;
        let surface = Surface::of_facets(facets, D, &positions)?;
        check(&surface, &positions)?;
        let leaf = |(index, facet): (usize, &Facet)| {
            let Bounds { lower, upper } = Bounds::of_corners(&facet.shape(&positions));
            GeomWithData::new(Rectangle::from_corners(lower, upper), index)
        };
        let tree = RTree::bulk_load(surface.facets().iter().enumerate().map(leaf).collect());
        Ok(Self { surface, positions, tree, rounding })
    }

    /// From facets given with their vertices, as in STL files: vertices that are bitwise equal are one. Otherwise as
    /// [`new`](Self::new).
    ///
    /// # Errors
    ///
    /// As of [`new`](Self::new).
    pub fn from_loose_facets(facets: &[[[T; D]; D]], rounding: T) -> Result<Self> {
        let (mut vertices, mut places) = (Vec::new(), HashMap::new());
        let mut place = |vertex: [T; D]| {
            // −0 counts as 0.
            let key = vertex.map(|x| (x.value() + 0.0).to_bits());
            *places.entry(key).or_insert_with(|| {
                vertices.push(vertex);
                vertices.len() - 1
            })
        };
        let facets: Vec<[usize; D]> = facets.iter().map(|facet| facet.map(&mut place)).collect();
        Self::new(&vertices, &facets, rounding)
    }

    /// The closest point of the surface; none for a point that is not finite.
    fn nearest(&self, p: Point) -> Option<Nearest> {
        let mut best = None;
        self.descend(self.tree.root(), p, &mut best);
        best
    }

    /// Searches a node of the tree, the closest of its children first.
    fn descend(&self, node: &ParentNode<Leaf>, p: Point, best: &mut Option<Nearest>) {
        let away = |child: &RTreeNode<Leaf>| child.envelope().distance_2(&p);
        let children = node.children();
        let closest = (1..children.len())
            .fold(0, |closest, k| if away(&children[k]) < away(&children[closest]) { k } else { closest });
        let order = [closest].into_iter().chain((0..children.len()).filter(|&k| k != closest));
        for child in order.filter_map(|k| children.get(k)) {
            let limit = best.map_or(f64::INFINITY, |best| best.projected.1.distance);
            // Both sides are rounded.
            if away(child) > limit * limit + rounding(limit * limit) {
                continue;
            }
            match child {
                RTreeNode::Parent(node) => self.descend(node, p, best),
                RTreeNode::Leaf(leaf) => {
                    let facet = leaf.data;
                    let Some(projected) = self.surface.project(facet, p, &self.positions) else { continue };
                    // Of equally near facets the first one, so that the order in the tree does not matter.
                    let nearer = |best: &Nearest| {
                        let (new, old) = (projected.1.distance, best.projected.1.distance);
                        new < old || new <= old && facet < best.facet
                    };
                    if projected.1.distance.is_finite() && best.as_ref().is_none_or(nearer) {
                        *best = Some(Nearest { facet, projected });
                    }
                }
            }
        }
    }

    /// The normal, and the signed distance from the surface without the rounding.
    fn direction(&self, p: Point, nearest: &Nearest) -> Option<(Point, f64)> {
        let near = half_digits();
        self.surface.direction(nearest.facet, p, &nearest.projected, (near, &|_| true), &self.positions)
    }
}

/// Rejects a surface that does not enclose a volume, or whose normals point inward.
fn check(surface: &Surface, positions: &[Point]) -> Result<()> {
    if let Some(facet) = surface.open_facet() {
        let part = format!("facet {facet} of a closed surface");
        let reason = "the surface ends at one of its sides; close it (loose facets share vertices that are equal to \
                      the last bit)";
        return Err(Error::Incompatible { part, reason });
    }
    if let Some(vertex) = surface.pinched_node() {
        let part = format!("vertex {vertex} of a closed surface");
        let reason = "the surface touches itself there; give each of the fans of facets a vertex of its own, apart";
        return Err(Error::Incompatible { part, reason });
    }
    let volume = surface.volume(positions);
    if volume > 0.0 {
        return Ok(());
    }
    let part = format!("a closed surface around a volume of {volume:e}");
    let reason = "its normals must point out of a volume; name the vertices of each facet in the other order";
    Err(Error::Incompatible { part, reason })
}

impl<T: Real, const D: usize> Obstacle<T, D> for ClosedSurface<T, D> {
    fn distance(&self, x: [T; D]) -> (T, [T; D]) {
        let p = in_space(x);
        match self.nearest(p).and_then(|nearest| self.direction(p, &nearest)) {
            Some((normal, distance)) => {
                (T::of(distance - self.rounding.value()), std::array::from_fn(|k| T::of(normal[k])))
            }
            None => (T::nan(), [T::nan(); D]),
        }
    }

    fn curvature(&self, x: [T; D], w: [T; D]) -> T {
        let (p, w) = (in_space(x), in_space(w));
        let Some(nearest) = self.nearest(p) else { return T::nan() };
        let Some((normal, distance)) = self.direction(p, &nearest) else { return T::nan() };
        let (shape, foot) = &nearest.projected;
        if foot.distance <= half_digits::<f64>() * shape.size() {
            return T::zero();
        }
        // Around an edge or a vertex the normal turns with the velocity across it.
        let across = |w: Point, n: Point| -> Point { std::array::from_fn(|k| w[k] - dot(w, n) / dot(n, n) * n[k]) };
        let around = match foot.location {
            Location::Inside | Location::Beyond => return T::zero(),
            Location::Side(k) => across(across(w, shape.side(k)), normal),
            Location::Vertex(_) => across(w, normal),
        };
        T::of(dot(around, around) / distance)
    }

    fn magnitude(&self) -> T {
        let coordinates = self.positions.iter().flatten();
        T::of(coordinates.fold(self.rounding.value(), |largest, x| largest.max(x.abs())))
    }
}
