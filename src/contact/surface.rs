//! A surface of facets: which facet borders on which, where the surface ends, and normals at sides and vertices.

mod behind;
mod closed;
mod cones;
mod dent;
mod exact;
mod facet;
mod kin;
mod nearest_first;
mod nodes;
mod offsets;
mod outer;
mod output;
mod overlap;
mod polygon;
mod projection;
mod ramp;
mod reach;
mod search;
mod second_difference;
mod second_order;
mod shape;
mod sharp;
mod slide;

pub(crate) use behind::{Behind, Side, is_far_side};
pub(crate) use cones::Cones;
pub use facet::Facet;
pub(crate) use kin::Kin;
pub(crate) use nearest_first::{Kept, NearestFirst};
pub(crate) use nodes::{Nodes, points};
pub(crate) use offsets::{Offsets, Thickness};
pub(crate) use overlap::{Base, RimSample, Sample, middle};
pub(crate) use projection::{Ground, Stand};
pub(crate) use ramp::Ramp;
pub(crate) use reach::Reach;
pub(crate) use search::{Bounds, Neighborhood, overhang};
pub(crate) use second_difference::SecondDifference;
pub(crate) use second_order::ByNode;
pub(crate) use shape::{Foot, Location, Point, Shape, add_scaled, cross, dot, norm, sub, unit};

use super::check_nodes;
use crate::error::{Error, Result};
use crate::real::Real;
use shape::{RIM, Rim};

/// A surface of facets, or several: what constraints on surfaces are made of, and what draws them.
///
/// Made of facets ([`new`](Self::new)) or as the outer sides of a mesh of cells ([`of_cells`](Self::of_cells)); both
/// check it: sides, orientation, areas. A constraint takes `&surface` wherever it takes facets, so that one surface
/// serves all, and its output.
///
/// ```
/// use contact_dynamics::contact::{Mortar, Surface};
///
/// // Two unit squares, the second one 0.1 above the first.
/// let coordinates = [[0., 0.], [1., 0.], [1., 1.], [0., 1.], [0., 1.1], [1., 1.1], [1., 2.1], [0., 2.1]];
/// let dofs: Vec<[usize; 2]> = (0..8).map(|node| [2 * node, 2 * node + 1]).collect();
/// let lower = Surface::of_cells(&coordinates, [[0, 1, 2, 3]])?;
/// let upper = Surface::of_cells(&coordinates, [[4, 5, 6, 7]])?;
/// let contact = Mortar::new(&coordinates, &dofs, &upper, &lower)?;
///
/// // Of a force of 3 on the node (1, 1) of the lower square, downward: half of both sides that meet there is its own.
/// let mut forces = [[0.0; 2]; 8];
/// forces[2] = [0.0, -3.0];
/// let pressures = lower.pressures(&coordinates, &forces)?;
/// let corner = lower.nodes().iter().position(|&node| node == 2).ok_or("a node of the surface")?;
/// assert!((pressures[corner] - 3.0_f64).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Surface {
    dimension: usize,
    facets: Vec<Facet>,
    rims: Vec<Rim>,
    /// The facet across each side, and which of its sides that is.
    neighbors: Vec<[Option<(usize, usize)>; 4]>,
    /// Nodes of the facets, sorted.
    nodes: Vec<usize>,
    /// The places among them of the vertices of each facet.
    places: Vec<[usize; 4]>,
    /// (facet, vertex of the facet) by node, and where those of each place begin.
    around: Vec<(usize, usize)>,
    starts: Vec<usize>,
    /// The longest side of the smallest facet, in the reference coordinates.
    finest: f64,
    /// The mean of the longest sides of all facets there.
    typical: f64,
}

fn refuse(facet: usize, reason: &'static str) -> Error {
    Error::Incompatible { part: format!("facet {facet} of a contact surface"), reason }
}

impl Surface {
    /// The surface of these facets, given by the indices of their nodes in `coordinates`, which are those of all nodes
    /// of a mesh in two or three dimensions. Normals point out of the body ([`Facet`]).
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the dimension is not 2 or 3, if a facet does not fit, or if a node does not exist;
    /// [`Error::NotFinite`] for the coordinates (index: node); [`Error::Empty`] without facets;
    /// [`Error::InvertedFacet`] for a facet without area, folded, or turned against its neighbor;
    /// [`Error::Incompatible`] where more than two facets share a side, and on surfaces of one side (Möbius).
    pub fn new<T: Real, F: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        Self::of_facets(facets, D, &points(coordinates)?)
    }

    /// As [`new`](Self::new), with points in space.
    pub(crate) fn of_facets<F: Into<Facet>>(
        facets: impl IntoIterator<Item = F>,
        dimension: usize,
        coordinates: &[Point],
    ) -> Result<Self> {
        let facets: Vec<Facet> = facets.into_iter().map(Into::into).collect();
        if facets.is_empty() {
            let what = "the list of facets of a contact surface";
            return Err(Error::Empty { what, remedy: "give at least one facet" });
        }
        for (index, facet) in facets.iter().enumerate() {
            let nodes = facet.nodes();
            if (nodes.len() == 2) != (dimension == 2) {
                let expected = if dimension == 2 { 2 } else { 3 };
                return Err(Error::Dimension { what: "a facet of a contact surface", expected, found: nodes.len() });
            }
            let others = facet.whole.as_ref().map_or(&[][..], |whole| whole.others());
            for nodes in [nodes, others] {
                check_nodes("the nodes of a facet (at most)", nodes, coordinates.len())?;
            }
            if !facet.shape(coordinates).is_regular() {
                let reason = match facet.shape(coordinates).is_degenerate() {
                    true => "it has no length or area",
                    false => "its normals point to both sides; give its nodes in the order around it",
                };
                return Err(Error::InvertedFacet { facet: index, nodes: nodes.to_vec(), reason });
            }
        }
        let sizes = facets.iter().map(|facet| facet.shape(coordinates).size());
        let finest = sizes.clone().fold(f64::INFINITY, f64::min);
        let typical = sizes.sum::<f64>() / facets.len() as f64;
        let mut around: Vec<_> = facets
            .iter()
            .enumerate()
            .flat_map(|(index, facet)| facet.nodes().iter().enumerate().map(move |(k, &node)| (node, index, k)))
            .collect();
        around.sort_unstable();
        let (mut nodes, mut starts, mut places) = (Vec::new(), Vec::new(), vec![[0; 4]; facets.len()]);
        for (number, &(node, facet, k)) in around.iter().enumerate() {
            if nodes.last() != Some(&node) {
                nodes.push(node);
                starts.push(number);
            }
            places[facet][k] = nodes.len() - 1;
        }
        starts.push(around.len());
        let mut surface = Self {
            dimension,
            rims: vec![Rim { sides: [true; 4], vertices: [false; 4], beyond: RIM }; facets.len()],
            neighbors: vec![[None; 4]; facets.len()],
            facets,
            nodes,
            places,
            around: around.into_iter().map(|(_, facet, k)| (facet, k)).collect(),
            starts,
            finest,
            typical,
        };
        surface.connect()?;
        surface.find_rim();
        Ok(surface)
    }

    /// Finds the neighbor across each side.
    fn connect(&mut self) -> Result<()> {
        let dimension = self.dimension;
        // (smaller node, larger node, facet, side, whether the side runs from the smaller to the larger node)
        let mut sides = Vec::new();
        for (index, facet) in self.facets.iter().enumerate() {
            let nodes = facet.nodes();
            for (k, &node) in nodes.iter().enumerate() {
                let other = if dimension == 2 { node } else { nodes[(k + 1) % nodes.len()] };
                let forward = if dimension == 2 { k == 0 } else { node < other };
                sides.push((node.min(other), node.max(other), index, k, forward));
            }
        }
        sides.sort_unstable();
        // Facets side by side, and whether both show the same face.
        let mut pairs = Vec::new();
        for group in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            match *group {
                [] | [_] => {}
                [(.., i, k, one), (.., j, l, other)] => {
                    pairs.push((i, j, one != other));
                    self.neighbors[i][k] = Some((j, l));
                    self.neighbors[j][l] = Some((i, k));
                    self.rims[i].sides[k] = false;
                    self.rims[j].sides[l] = false;
                }
                [_, _, (_, _, facet, ..), ..] => {
                    return Err(refuse(
                        facet,
                        "it shares a side with two facets or more, and a surface must not branch",
                    ));
                }
            }
        }
        self.orient(&pairs)
    }

    /// Refuses facets turned against their neighbors: of two parts that contradict each other the smaller one.
    fn orient(&self, pairs: &[(usize, usize, bool)]) -> Result<()> {
        if pairs.iter().all(|&(.., agree)| agree) {
            return Ok(());
        }
        // The face of each facet as the first of its part shows it, once the part is walked.
        let mut faces: Vec<Option<bool>> = vec![None; self.facets.len()];
        for first in 0..self.facets.len() {
            if faces[first].is_some() {
                continue;
            }
            faces[first] = Some(true);
            let mut part = vec![first];
            let mut next = 0;
            while let Some(&facet) = part.get(next) {
                next += 1;
                for &(i, j, agree) in pairs.iter().filter(|&&(i, j, _)| i == facet || j == facet) {
                    let other = if i == facet { j } else { i };
                    let expected = (faces[facet] == Some(true)) == agree;
                    match faces[other] {
                        None => {
                            faces[other] = Some(expected);
                            part.push(other);
                        }
                        Some(found) if found != expected => {
                            return Err(refuse(other, "the surface has one side only"));
                        }
                        Some(_) => {}
                    }
                }
            }
            let front = part.iter().filter(|&&facet| faces[facet] == Some(true)).count();
            let smaller = 2 * front < part.len();
            if let Some(&facet) = part.iter().filter(|&&facet| faces[facet] == Some(smaller)).min() {
                let reason = "its normal points to the other side than those of its neighbors; turn it";
                return Err(Error::InvertedFacet { facet, nodes: self.facets[facet].nodes().to_vec(), reason });
            }
        }
        Ok(())
    }

    /// A vertex is on the rim if a side that ends there is.
    fn find_rim(&mut self) {
        let Self { facets, rims, nodes, places, .. } = self;
        let mut open = vec![false; nodes.len()];
        let vertices = || facets.iter().zip(&*places).map(|(facet, places)| &places[..facet.nodes().len()]);
        for (places, rim) in vertices().zip(&*rims) {
            for (k, &place) in places.iter().enumerate().filter(|&(k, _)| rim.sides[k]) {
                open[place] = true;
                if places.len() > 2 {
                    open[places[(k + 1) % places.len()]] = true;
                }
            }
        }
        for (places, rim) in vertices().zip(rims) {
            for (vertex, &place) in rim.vertices.iter_mut().zip(places) {
                *vertex = open[place];
            }
        }
    }

    /// Its facets, in the order given, or of the cells.
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// The longest side of the smallest facet, in the reference coordinates.
    pub(crate) fn finest(&self) -> f64 {
        self.finest
    }

    /// The mean of the longest sides of the facets, in the reference coordinates.
    pub(crate) fn typical(&self) -> f64 {
        self.typical
    }

    /// The boxes of its facets.
    pub(crate) fn boxes(&self, positions: &[Point]) -> impl Iterator<Item = Bounds> + Clone {
        self.facets.iter().map(|facet| Bounds::of_corners(&facet.shape(positions)))
    }

    /// The nodes of its facets, ascending.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// The nodes that move it, ascending: its own, and those of facets of second order that it has parts of.
    pub(crate) fn moved_by(&self) -> Vec<usize> {
        let others = self.facets.iter().filter(|facet| facet.whole.is_some()).flat_map(Facet::all_nodes);
        let mut nodes = self.nodes.clone();
        nodes.extend(others);
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// The place of one of its nodes among them.
    pub(crate) fn place(&self, node: usize) -> usize {
        self.nodes.partition_point(|&other| other < node)
    }

    /// The places among the nodes of the vertices of a facet; those behind its last vertex have no meaning.
    pub(crate) fn places(&self, facet: usize) -> &[usize; 4] {
        &self.places[facet]
    }

    /// The sides of a facet where the surface ends.
    pub(crate) fn open_sides(&self, facet: usize) -> [bool; 4] {
        self.rims[facet].sides
    }

    /// The facet across a side of a facet, and which of its sides that is; none where the surface ends.
    pub(crate) fn neighbor(&self, facet: usize, side: usize) -> Option<(usize, usize)> {
        self.neighbors[facet][side]
    }

    /// The closest point of a facet, with the shape of the facet.
    pub(crate) fn project(&self, facet: usize, p: Point, positions: &[Point]) -> Option<(Shape, Foot)> {
        self.project_beyond(facet, p, RIM, positions)
    }

    /// As `project`, on a surface that goes on beyond its rim for another share of the facet.
    pub(crate) fn project_beyond(
        &self,
        facet: usize,
        p: Point,
        beyond: f64,
        positions: &[Point],
    ) -> Option<(Shape, Foot)> {
        self.project_within(facet, p, Rim { beyond, ..self.rims[facet] }, positions)
    }

    /// As `project`, on a facet that goes on beyond all of its sides for a share of itself.
    pub(crate) fn project_on_plane(
        &self,
        facet: usize,
        p: Point,
        beyond: f64,
        positions: &[Point],
    ) -> Option<(Shape, Foot)> {
        self.project_within(facet, p, Rim { sides: [true; 4], vertices: [true; 4], beyond }, positions)
    }

    fn project_within(&self, facet: usize, p: Point, rim: Rim, positions: &[Point]) -> Option<(Shape, Foot)> {
        let shape = self.facets[facet].shape(positions);
        shape.project(p, rim).map(|foot| (shape, foot))
    }

    /// Sum of the normals on both sides of a side, at its share `s`; of that beyond it only if it `counts`.
    fn side_normal(
        &self,
        facet: usize,
        (k, s): (usize, f64),
        counts: &impl Fn(Point) -> bool,
        positions: &[Point],
    ) -> Option<Point> {
        let shape = self.facets[facet].shape(positions);
        let own = shape.normal(&shape.on_side(k, s))?;
        let Some((neighbor, l)) = self.neighbors[facet][k] else { return Some(own) };
        let shape = self.facets[neighbor].shape(positions);
        let across = shape.normal(&shape.on_side(l, 1.0 - s))?;
        if counts(across) { unit(add_scaled(own, 1.0, across)).or(Some(own)) } else { Some(own) }
    }

    /// The facets around a node, with the vertex that it is of each; none if it is no node of the surface.
    fn corners_around(&self, node: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let found = self.nodes.binary_search(&node);
        found.into_iter().flat_map(|place| self.corners_at(place).iter().copied())
    }

    /// The same of the node at a place among those of the surface.
    fn corners_at(&self, place: usize) -> &[(usize, usize)] {
        &self.around[self.starts[place]..self.starts[place + 1]]
    }

    /// The facets around the k-th vertex of a facet, itself among them.
    pub(crate) fn facets_at(&self, facet: usize, k: usize) -> impl Iterator<Item = usize> + '_ {
        self.corners_at(self.places[facet][k]).iter().map(|&(facet, _)| facet)
    }

    /// The facets around a node.
    pub(crate) fn facets_around(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        self.corners_around(node).map(|(facet, _)| facet)
    }

    /// Mean of the normals of the facets around a node, weighted by their angles there; none if the node has no facet.
    pub(crate) fn node_normal(&self, node: usize, positions: &[Point]) -> Option<Point> {
        self.node_normal_of(node, &|_| true, positions)
    }

    /// The same of those that `count`.
    fn node_normal_of(&self, node: usize, counts: &impl Fn(Point) -> bool, positions: &[Point]) -> Option<Point> {
        let sum = self.corners_around(node).fold([0.0; 3], |sum, (facet, k)| {
            let shape = self.facets[facet].shape(positions);
            let mut weights = [0.0; 4];
            weights[k] = 1.0;
            match shape.normal(&weights).filter(|normal| counts(*normal)) {
                Some(normal) => add_scaled(sum, shape.angle(k), normal),
                None => sum,
            }
        });
        unit(sum)
    }

    /// How steeply the sides around a node rise above the plane across its mean normal: the mean of the sines, below
    /// zero at a convex corner, above in a dent.
    pub(crate) fn rise(&self, node: usize, positions: &[Point]) -> f64 {
        let Some(normal) = self.node_normal(node, positions) else { return 0.0 };
        let at = positions[node];
        let mut mean = (0.0, 0.0);
        for (facet, k) in self.corners_around(node) {
            let nodes = self.facets[facet].nodes();
            for next in [(k + 1) % nodes.len(), (k + nodes.len() - 1) % nodes.len()] {
                if let Some(along) = unit(sub(positions[nodes[next]], at)) {
                    mean = (mean.0 + dot(normal, along), mean.1 + 1.0);
                }
            }
        }
        if mean.1 > 0.0 { mean.0 / mean.1 } else { 0.0 }
    }

    /// The side or vertex that a point of a facet lies on, up to `share` of the facet.
    fn near(&self, facet: usize, shape: &Shape, foot: &Foot, share: f64) -> Location {
        let (count, rim) = (self.facets[facet].nodes().len(), &self.rims[facet]);
        let close = |k: usize| shape.inset(&foot.weights, k) <= share;
        let mut found = Location::Inside;
        for k in (0..count).filter(|&k| !rim.sides[k] && close(k)) {
            let vertex = if count == 2 || close((k + count - 1) % count) {
                Some(k)
            } else if close((k + 1) % count) {
                Some((k + 1) % count)
            } else {
                None
            };
            found = match vertex {
                Some(vertex) if !rim.vertices[vertex] => return Location::Vertex(vertex),
                _ => Location::Side(k),
            };
        }
        found
    }

    /// Whether a point at this way from a side or a vertex of a facet is in front of a facet there that the others lie
    /// behind of: it is outside then, on whichever side of the mean normal. (The facets whose closest points are nearer
    /// may be none that its node meets.)
    fn is_outside(&self, facet: usize, location: Location, arm: Point, positions: &[Point]) -> bool {
        /// Share of a facet that a point is in front of one: edges that are flush, to a little, are those of one
        /// surface.
        const FLUSH: f64 = 0.02;
        const ROUNDING: f64 = 1e-9;
        let (corner, neighbor) = match location {
            Location::Side(k) => (k, self.neighbors[facet][k].map(|(neighbor, _)| neighbor)),
            Location::Vertex(k) => (k, None),
            Location::Inside | Location::Beyond => return false,
        };
        let at = positions[self.facets[facet].nodes[corner]];
        let is_there = |other: usize| match location {
            Location::Side(_) => other == facet || Some(other) == neighbor,
            _ => true,
        };
        let there = || self.facets_at(facet, corner).filter(|&other| is_there(other));
        there().any(|one| {
            let shape = self.facets[one].shape(positions);
            let Some(normal) = shape.normal(&[1.0 / shape.corners().len() as f64; 4]) else { return false };
            let is_behind = |other: usize| {
                let shape = self.facets[other].shape(positions);
                dot(normal, sub(shape.middle(), at)) <= ROUNDING * shape.size()
            };
            dot(normal, arm) > FLUSH * shape.size() && there().all(|other| other == one || is_behind(other))
        })
    }

    /// The normal along which a node at p stands on a facet, and its signed distance along it.
    ///
    /// Inside of a facet, the facet's own normal. On a side or a vertex the direction from the foot to the node, or
    /// away from it if the node is behind the mean normal of the facets there (the sign is right on any surface that
    /// does not intersect itself: Bærentzen and Aanæs, 2005, doi:10.1109/TVCG.2005.49); closer than `share` of the
    /// facet, where that direction is lost in rounding, the mean normal itself, of those that the node `meets`: a
    /// corner upon a corner of a body below is above it, not beside it.
    pub(crate) fn direction(
        &self,
        facet: usize,
        p: Point,
        (shape, foot): &(Shape, Foot),
        (share, meets): (f64, &impl Fn(Point) -> bool),
        positions: &[Point],
    ) -> Option<(Point, f64)> {
        let arm = sub(p, foot.point);
        let touching = foot.distance <= share * shape.size();
        let location = match foot.location {
            Location::Inside if touching => self.near(facet, shape, foot, share),
            location => location,
        };
        let nodes = self.facets[facet].nodes();
        let counts = |normal: Point| !touching || meets(normal);
        let mean = match location {
            Location::Inside | Location::Beyond => shape.normal(&foot.weights),
            Location::Vertex(k) => {
                let of_some = self.node_normal_of(nodes[k], &counts, positions);
                of_some.or_else(|| self.node_normal(nodes[k], positions))
            }
            Location::Side(k) => {
                let next = foot.weights[(k + 1) % nodes.len()];
                let total = foot.weights[k] + next;
                let share = if total > 0.0 { next / total } else { 0.5 };
                self.side_normal(facet, (k, share), &counts, positions)
            }
        }?;
        if touching || foot.location == Location::Inside {
            return Some((mean, dot(mean, arm)));
        }
        let is_behind = dot(mean, arm) < 0.0 && !self.is_outside(facet, location, arm, positions);
        let side = if is_behind { -1.0 } else { 1.0 };
        Some((unit(arm)?.map(|x| side * x), side * foot.distance))
    }
}

#[allow(clippy::into_iter_without_iter)] // `facets` gives them to look at
impl<'s> IntoIterator for &'s Surface {
    type Item = Facet;
    type IntoIter = std::iter::Copied<std::slice::Iter<'s, Facet>>;

    fn into_iter(self) -> Self::IntoIter {
        self.facets.iter().copied()
    }
}
