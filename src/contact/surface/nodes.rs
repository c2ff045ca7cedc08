//! The nodes of surfaces: where they are, and which dofs move them.

use super::search::Bounds;
use super::shape::Point;
use crate::contact::dofs::DofList;
use crate::contact::{check_coordinates, check_mesh};
use crate::error::{Error, Result};
use crate::real::Real;

/// Coordinates in two or three dimensions as points in space; refuses others, and what is not a number.
pub(crate) fn points<T: Real, const D: usize>(coordinates: &[[T; D]]) -> Result<Vec<Point>> {
    if D != 2 && D != 3 {
        return Err(Error::Dimension { what: "a point of a contact surface", expected: 3, found: D });
    }
    check_coordinates(coordinates)?;
    let component = |x: &[T; D], i: usize| x.get(i).map_or(0.0, |x| x.value());
    Ok(coordinates.iter().map(|x| std::array::from_fn(|i| component(x, i))).collect())
}

/// The nodes of a mesh, some of which two surfaces read.
#[derive(Debug)]
pub(crate) struct Nodes {
    pub(crate) dimension: usize,
    /// Reference coordinates, by node.
    pub(crate) coordinates: Vec<Point>,
    /// Dofs of the displacement in the system, by node; the first `dimension` count.
    system_dofs: Vec<[usize; 3]>,
    /// Their places in the list of the constraint, for nodes of the two bodies.
    places: Vec<[usize; 3]>,
    list: DofList,
    /// Where the nodes of the two bodies are now.
    pub(crate) positions: Vec<Point>,
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
            positions: coordinates.clone(),
            coordinates,
        })
    }

    /// Takes the dofs of two bodies into the list of the constraint; refuses bodies that share a node (each sorted).
    pub(crate) fn read_bodies(&mut self, bodies: &[Vec<usize>; 2]) -> Result<()> {
        let [one, other] = bodies;
        if let Some(node) = one.iter().find(|node| other.binary_search(node).is_ok()) {
            let part = format!("contact node {node}");
            return Err(Error::Incompatible { part, reason: "it belongs to both surfaces" });
        }
        self.read(bodies.iter().flatten().copied());
        Ok(())
    }

    /// Takes the dofs of some nodes into the list of the constraint.
    pub(crate) fn read(&mut self, nodes: impl Iterator<Item = usize>) {
        let Self { list, places, system_dofs, dimension, .. } = self;
        *list = DofList::default();
        for node in nodes {
            for (place, &dof) in places[node].iter_mut().zip(&system_dofs[node][..*dimension]) {
                *place = list.place(dof);
            }
        }
    }

    /// The dofs of the constraint.
    pub(crate) fn dofs(&self) -> &[usize] {
        self.list.as_slice()
    }

    /// The places of a node's dofs among them.
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

    /// Moves the nodes of a body to where they are with displacements u; returns their box.
    pub(crate) fn move_to<T: Real>(&mut self, body: &[usize], u: &[T]) -> Result<Bounds> {
        let Self { dimension, coordinates, system_dofs, places, positions, .. } = self;
        let mut bounds = Bounds::EMPTY;
        for &node in body {
            let mut x = coordinates[node];
            for (axis, (x, &place)) in x.iter_mut().zip(&places[node][..*dimension]).enumerate() {
                *x += u[place].value();
                if !x.is_finite() {
                    let what = "the displacement of a contact surface (by dof)";
                    return Err(Error::NotFinite { what, index: system_dofs[node][axis], value: u[place].value() });
                }
            }
            positions[node] = x;
            bounds.include(x);
        }
        Ok(bounds)
    }
}
