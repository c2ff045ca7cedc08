//! The nodes of surfaces: their positions, and the dofs that move them.

use super::search::Bounds;
use super::shape::{Point, add_scaled, sub};
use super::{Facet, Surface};
use crate::contact::dofs::DofList;
use crate::contact::obstacle::across;
use crate::contact::{check_coordinates, check_mesh};
use crate::error::{Error, Result};
use crate::real::Real;

/// Coordinates in two or three dimensions as points in space. Rejects other dimensions and values that are not
/// finite.
pub(crate) fn points<T: Real, const D: usize>(coordinates: &[[T; D]]) -> Result<Vec<Point>> {
    if D != 2 && D != 3 {
        return Err(Error::Dimension { what: "a point of a contact surface", expected: 3, found: D });
    }
    check_coordinates(coordinates)?;
    let component = |x: &[T; D], i: usize| x.get(i).map_or(0.0, |x| x.value());
    Ok(coordinates.iter().map(|x| std::array::from_fn(|i| component(x, i))).collect())
}

/// The nodes of a mesh that two surfaces share.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    pub(crate) dimension: usize,
    /// Reference coordinates, by node.
    pub(crate) coordinates: Vec<Point>,
    /// Dofs of the displacement in the system, by node; the first `dimension` count.
    system_dofs: Vec<[usize; 3]>,
    /// Places of these dofs in the list of the constraint, for the nodes of the two bodies.
    places: Vec<[usize; 3]>,
    list: DofList,
    /// Nodes of the two bodies. A body in contact with itself is listed twice.
    bodies: [Vec<usize>; 2],
    pub(crate) positions: Vec<Point>,
    /// Number of changes of the positions: while it is the same, so are the positions.
    moves: usize,
}

impl Nodes {
    /// All nodes of a mesh in two or three dimensions.
    pub(crate) fn new<T: Real, const D: usize>(coordinates: &[[T; D]], dofs: &[[usize; D]]) -> Result<Self> {
        check_mesh(coordinates, dofs, &[])?;
        let coordinates = points(coordinates)?;
        Ok(Self {
            dimension: D,
            system_dofs: dofs.iter().map(|d| std::array::from_fn(|i| d.get(i).copied().unwrap_or(0))).collect(),
            places: vec![[0; 3]; coordinates.len()],
            list: DofList::default(),
            bodies: [Vec::new(), Vec::new()],
            positions: coordinates.clone(),
            coordinates,
            moves: 0,
        })
    }

    /// Nodes of a mesh, and two surfaces of it. The bodies are the nodes that move the surfaces.
    pub(crate) fn with_surfaces<T: Real, F: Into<Facet>, G: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        one: impl IntoIterator<Item = F>,
        other: impl IntoIterator<Item = G>,
    ) -> Result<(Self, [Surface; 2])> {
        let mut nodes = Self::new(coordinates, dofs)?;
        let one = Surface::of_facets(one, D, &nodes.coordinates)?;
        let other = Surface::of_facets(other, D, &nodes.coordinates)?;
        nodes.read_bodies([one.moved_by(), other.moved_by()])?;
        Ok((nodes, [one, other]))
    }

    /// Lists the dofs of two bodies (sorted nodes) in the constraint. Rejects bodies that share a node.
    pub(crate) fn read_bodies(&mut self, bodies: [Vec<usize>; 2]) -> Result<()> {
        let [one, other] = &bodies;
        if let Some(node) = one.iter().find(|node| other.binary_search(node).is_ok()) {
            let part = format!("contact node {node}");
            return Err(Error::Incompatible { part, reason: "it belongs to both surfaces" });
        }
        self.bodies = bodies;
        self.list_dofs();
        Ok(())
    }

    /// Lists the dofs of one body, which is in contact with itself.
    pub(crate) fn read_body(&mut self, body: Vec<usize>) {
        self.bodies = [body.clone(), body];
        self.list_dofs();
    }

    fn list_dofs(&mut self) {
        let Self { list, places, system_dofs, dimension, bodies, .. } = self;
        *list = DofList::default();
        for &node in bodies.iter().flatten() {
            for (place, &dof) in places[node].iter_mut().zip(&system_dofs[node][..*dimension]) {
                *place = list.place(dof);
            }
        }
    }

    pub(crate) fn bodies(&self) -> &[Vec<usize>; 2] {
        &self.bodies
    }

    pub(crate) fn dofs(&self) -> &[usize] {
        self.list.as_slice()
    }

    /// The places of a node's dofs in [`dofs`](Self::dofs).
    pub(crate) fn places(&self, node: usize) -> &[usize] {
        &self.places[node][..self.dimension]
    }

    /// The entries of a vector of the constraint that belong to a node.
    pub(crate) fn vector<T: Real>(&self, node: usize, x: &[T]) -> Point {
        let mut vector = [0.0; 3];
        for (component, &place) in vector.iter_mut().zip(self.places(node)) {
            *component = x[place].value();
        }
        vector
    }

    /// Orthonormal tangents to a normal: one in two dimensions, two in three.
    pub(crate) fn tangents(&self, normal: Point) -> impl Iterator<Item = Point> + use<> {
        let [x, y, _] = normal;
        let directions = match self.dimension {
            2 => across([x, y]).map(|[x, y]| [x, y, 0.0]),
            _ => across(normal),
        };
        directions.into_iter().take(self.dimension - 1)
    }

    /// The displacement of a node from the first displacements to the second.
    pub(crate) fn way<T: Real>(&self, node: usize, u: [&[T]; 2]) -> Point {
        sub(self.vector(node, u[1]), self.vector(node, u[0]))
    }

    /// The bounding boxes of a nodal vector, for instance a velocity, over each of the two bodies.
    pub(crate) fn boxes_of(&self, vector: impl Fn(usize) -> Point) -> [Bounds; 2] {
        self.bodies.each_ref().map(|body| Bounds::of_points(body.iter().map(|&node| vector(node))))
    }

    /// Writes the positions of the nodes of both bodies with displacements u into a list by node.
    pub(crate) fn places_at<T: Real>(&self, u: &[T], positions: &mut Vec<Point>) {
        positions.resize(self.coordinates.len(), [0.0; 3]);
        for &node in self.bodies.iter().flatten() {
            positions[node] = add_scaled(self.coordinates[node], 1.0, self.vector(node, u));
        }
    }

    /// Moves the nodes of both bodies to their positions with displacements u; returns the boxes of the bodies.
    pub(crate) fn move_to<T: Real>(&mut self, u: &[T]) -> Result<[Bounds; 2]> {
        let Self { dimension, coordinates, system_dofs, places, positions, bodies, moves, .. } = self;
        let (mut boxes, mut moved) = ([Bounds::EMPTY; 2], false);
        for (body, bounds) in bodies.iter().zip(&mut boxes) {
            for &node in body {
                let mut x = coordinates[node];
                for (axis, (x, &place)) in x.iter_mut().zip(&places[node][..*dimension]).enumerate() {
                    *x += u[place].value();
                    if !x.is_finite() {
                        *moves += 1;
                        let what = "the displacement of a contact surface (by dof)";
                        return Err(Error::NotFinite { what, index: system_dofs[node][axis], value: u[place].value() });
                    }
                }
                moved |= positions[node].map(f64::to_bits) != x.map(f64::to_bits);
                positions[node] = x;
                bounds.include(x);
            }
        }
        *moves += usize::from(moved);
        Ok(boxes)
    }

    /// How many calls of [`move_to`](Self::move_to) have changed a position.
    pub(crate) fn moves(&self) -> usize {
        self.moves
    }
}
