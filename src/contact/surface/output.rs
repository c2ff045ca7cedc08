//! What a surface has for output: areas and normals of its nodes, and the pressure that forces on them make.

use super::nodes::points;
use super::shape::{Point, Shape, add_scaled, cross, dot, norm};
use super::{Facet, Surface};
use crate::error::{Error, Result};
use crate::real::Real;

impl Surface {
    /// ∫ N dA of each of its [`nodes`](Self::nodes) (area; length in two dimensions), N the shape function of the node:
    /// the share of the surface that belongs to it; on facets of second order that of their linear parts. `positions`
    /// are those of all nodes of the mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the positions are of another dimension than the surface or lack a node of it;
    /// [`Error::NotFinite`] for the positions (index: node).
    pub fn areas<T: Real, const D: usize>(&self, positions: &[[T; D]]) -> Result<Vec<T>> {
        let areas = self.areas_at(&self.points(positions)?);
        Ok(areas.into_iter().map(T::of).collect())
    }

    /// As [`areas`](Self::areas), with points in space.
    pub(crate) fn areas_at(&self, positions: &[Point]) -> Vec<f64> {
        let mut areas = vec![0.0; self.nodes.len()];
        self.integrate(positions, |place, share, area| areas[place] += share * norm(area));
        areas
    }

    /// The outward normal at each of its [`nodes`](Self::nodes): the mean of those of the facets around it, with their
    /// angles there as weights, and length one (zero where facets cancel each other).
    ///
    /// # Errors
    ///
    /// As of [`areas`](Self::areas).
    pub fn normals<T: Real, const D: usize>(&self, positions: &[[T; D]]) -> Result<Vec<[T; D]>> {
        let positions = self.points(positions)?;
        let normal = |&node: &usize| self.node_normal(node, &positions).unwrap_or([0.0; 3]);
        Ok(self.nodes.iter().map(normal).map(|normal| std::array::from_fn(|axis| T::of(normal[axis]))).collect())
    }

    /// The pressure (force/area, compression positive) on each of its [`nodes`](Self::nodes) that forces make:
    /// −f·A/|A|² with A = ∫ N n dA, n outward. A pressure that is the same all over the surface comes out as it is, at
    /// edges and corners too; what it leaves of the forces is [`shears`](Self::shears). On facets of second order,
    /// whose nodes in the middle bear most of a pressure, f is what their linear parts would have of it.
    ///
    /// `positions` and `forces` are those of all nodes of the mesh: contact forces are those of
    /// [`contact_forces`](crate::Simulation::contact_forces). At the border of a contact that ends inside of a facet
    /// the area of a node is larger than what is pressed; [`Mortar::area`](crate::contact::Mortar::area) knows better.
    ///
    /// # Errors
    ///
    /// As of [`areas`](Self::areas), for the forces too.
    pub fn pressures<T: Real, const D: usize>(&self, positions: &[[T; D]], forces: &[[T; D]]) -> Result<Vec<T>> {
        let tractions = self.tractions(positions, forces)?;
        Ok(tractions.into_iter().map(|(pressure, _)| T::of(pressure)).collect())
    }

    /// The shear stress (force/area) on each of its [`nodes`](Self::nodes) that forces make: (f − (f·A) A/|A|²)/|A|,
    /// along the surface. See [`pressures`](Self::pressures).
    ///
    /// # Errors
    ///
    /// As of [`pressures`](Self::pressures).
    pub fn shears<T: Real, const D: usize>(&self, positions: &[[T; D]], forces: &[[T; D]]) -> Result<Vec<[T; D]>> {
        let tractions = self.tractions(positions, forces)?;
        Ok(tractions.into_iter().map(|(_, shear)| std::array::from_fn(|axis| T::of(shear[axis]))).collect())
    }

    /// Pressure and shear stress at each node; zero where facets cancel each other.
    fn tractions<T: Real, const D: usize>(&self, positions: &[[T; D]], forces: &[[T; D]]) -> Result<Vec<(f64, Point)>> {
        let (positions, forces) = (self.points(positions)?, self.on_parts(self.points(forces)?));
        let mut areas = vec![[0.0; 3]; self.nodes.len()];
        self.integrate(&positions, |place, share, area| areas[place] = add_scaled(areas[place], share, area));
        let traction = |(&node, area): (&usize, Point)| {
            let (force, square) = (forces[node], dot(area, area));
            if square <= 0.0 {
                return (0.0, [0.0; 3]);
            }
            let pressure = -dot(force, area) / square;
            (pressure, add_scaled(force, pressure, area).map(|f| f / square.sqrt()))
        };
        Ok(self.nodes.iter().zip(areas).map(traction).collect())
    }

    /// Forces as linear parts of facets of second order would have them, which have the same sum.
    fn on_parts(&self, forces: Vec<Point>) -> Vec<Point> {
        if self.facets.iter().all(|facet| facet.whole.is_none()) {
            return forces;
        }
        // By place how many facets a node has: each hands on its part of the force.
        let mut facets = vec![0.0; self.nodes.len()];
        let own = self.facets.iter().flat_map(Facet::nodes);
        own.for_each(|&node| facets[self.place(node)] += 1.0);
        let mut moved = forces.clone();
        for facet in &self.facets {
            let Some(whole) = &facet.whole else { continue };
            for (corner, &node) in facet.nodes().iter().enumerate() {
                let force = forces[node].map(|f| f / facets[self.place(node)]);
                for (other, share) in facet.all_nodes().zip(whole.given(corner)) {
                    // (A part alone keeps what the others would get.)
                    if self.nodes.binary_search(&other).is_ok() {
                        moved[node] = add_scaled(moved[node], -share, force);
                        moved[other] = add_scaled(moved[other], share, force);
                    }
                }
            }
        }
        moved
    }

    /// Calls `act` with place of the node, its shape function, and area times normal, at the points of a quadrature.
    fn integrate(&self, positions: &[Point], mut act: impl FnMut(usize, f64, Point)) {
        for facet in &self.facets {
            let shape = facet.shape(positions);
            for (weights, area) in quadrature(facet, &shape) {
                for (&node, share) in facet.nodes().iter().zip(weights) {
                    act(self.place(node), share, area);
                }
            }
        }
    }

    /// Positions or vectors of all nodes of a mesh, as points in space.
    fn points<T: Real, const D: usize>(&self, of_nodes: &[[T; D]]) -> Result<Vec<Point>> {
        if D != self.dimension {
            return Err(Error::Dimension { what: "a position of a surface", expected: self.dimension, found: D });
        }
        let last = self.nodes.last().map_or(0, |last| last + 1);
        if of_nodes.len() < last {
            let what = "the list of positions of a surface (at least)";
            return Err(Error::Dimension { what, expected: last, found: of_nodes.len() });
        }
        points(of_nodes)
    }
}

/// Shape functions at some points of a facet, with the area times the normal that belongs to each.
fn quadrature(facet: &Facet, shape: &Shape) -> Vec<([f64; 4], Point)> {
    let at = |weights: [f64; 4], share: f64| {
        let [first, second] = shape.tangents_at(&weights);
        let second = if shape.is_segment() { [0.0, 0.0, 1.0] } else { second };
        (weights, cross(first, second).map(|x| share * x))
    };
    // Linear functions on segments and triangles; of a bilinear quadrilateral N n dA is of degree two in each
    // direction.
    match facet.count {
        2 => vec![at([0.5, 0.5, 0.0, 0.0], 1.0)],
        3 => vec![at([1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0], 0.5)],
        _ => {
            let (low, high) = (0.5 - 0.5 / 3.0_f64.sqrt(), 0.5 + 0.5 / 3.0_f64.sqrt());
            let point = |[s, t]: [f64; 2]| at([(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t], 1.0);
            [[low, low], [high, low], [high, high], [low, high]].map(point).to_vec()
        }
    }
}
