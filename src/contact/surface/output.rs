//! Output of a surface: areas and normals of its nodes, and the pressures and shear stresses from nodal forces.

use super::nodes::points;
use super::shape::{Point, Shape, add_scaled, dot, norm};
use super::{Facet, Surface};
use crate::error::{Error, Result};
use crate::real::Real;

impl Surface {
    /// The tributary area ∫ N dA of each of its [`nodes`](Self::nodes) (a length in two dimensions), with the shape
    /// function N of the node. On facets of second order, N is the shape function of the linear parts. `positions`
    /// holds the positions of all nodes of the mesh.
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
        for (facet, places) in self.facets.iter().zip(&self.places) {
            for (weights, area) in quadrature(facet, &facet.shape(positions)) {
                let shares = places.iter().zip(weights).take(facet.count);
                shares.for_each(|(&place, share)| areas[place] += share * norm(area));
            }
        }
        areas
    }

    /// The outward unit normal at each of its [`nodes`](Self::nodes): the mean of the normals of the facets around
    /// it, weighted by their angles at the node. It is zero where the normals cancel.
    ///
    /// # Errors
    ///
    /// As of [`areas`](Self::areas).
    pub fn normals<T: Real, const D: usize>(&self, positions: &[[T; D]]) -> Result<Vec<[T; D]>> {
        let positions = self.points(positions)?;
        let normal = |&node: &usize| self.node_normal(node, &positions).unwrap_or([0.0; 3]);
        Ok(self.nodes.iter().map(normal).map(|normal| std::array::from_fn(|axis| T::of(normal[axis]))).collect())
    }

    /// The pressure (force/area, compression positive) at each of its [`nodes`](Self::nodes) from the given forces:
    /// −f·A/|A|² with A = ∫ N n dA over the face at the node, n outward. [`shears`](Self::shears) returns the rest. A
    /// face is a set of facets around the node whose normals differ by less than 37°.
    ///
    /// An edge or corner has several faces. Only faces with a facet all of whose nodes bear a force count; if there
    /// is none, all faces count. Pressures p_k ≥ 0 on them are fitted to the force, f ≈ −Σ p_k A_k, and the node gets
    /// the pressure of the face with the largest force. So the pressure on one side of a body holds at its rim and
    /// corners too, and a uniform pressure all over a body is reproduced. On facets of second order the nodes in the
    /// middle bear most of a pressure; there f is redistributed to the linear parts first.
    ///
    /// `positions` and `forces` hold the values of all nodes of the mesh;
    /// [`contact_forces`](crate::Simulation::contact_forces) returns contact forces. Where the contact zone ends
    /// inside a facet, the area of a node is larger than its loaded area;
    /// [`Mortar::area`](crate::contact::Mortar::area) returns the loaded one.
    ///
    /// # Errors
    ///
    /// As of [`areas`](Self::areas), for the forces too.
    pub fn pressures<T: Real, const D: usize>(&self, positions: &[[T; D]], forces: &[[T; D]]) -> Result<Vec<T>> {
        let tractions = self.tractions(positions, forces)?;
        Ok(tractions.into_iter().map(|(pressure, _)| T::of(pressure)).collect())
    }

    /// The shear stress (force/area) along the surface at each of its [`nodes`](Self::nodes) from the given forces:
    /// (f − (f·A) A/|A|²)/|A|. See [`pressures`](Self::pressures).
    ///
    /// # Errors
    ///
    /// As of [`pressures`](Self::pressures).
    pub fn shears<T: Real, const D: usize>(&self, positions: &[[T; D]], forces: &[[T; D]]) -> Result<Vec<[T; D]>> {
        let tractions = self.tractions(positions, forces)?;
        Ok(tractions.into_iter().map(|(_, shear)| std::array::from_fn(|axis| T::of(shear[axis]))).collect())
    }

    /// Pressure and shear stress at each node; zero where the normals of facets cancel.
    fn tractions<T: Real, const D: usize>(&self, positions: &[[T; D]], forces: &[[T; D]]) -> Result<Vec<(f64, Point)>> {
        let (positions, forces) = (self.points(positions)?, self.points(forces)?);
        let loaded = self.loaded(&forces);
        let forces = self.on_parts(forces, &loaded, &positions);
        let traction = |(place, &node): (usize, &usize)| {
            let faces = self.faces(place, &loaded, &positions);
            let (pressures, rest) = pressures_of(forces[node], &faces);
            let bears = |k: &usize| pressures[*k].abs() * norm(faces[*k].area);
            let most = (0..faces.len()).max_by(|one, other| bears(one).total_cmp(&bears(other)));
            most.map_or((0.0, [0.0; 3]), |most| {
                let area = norm(faces[most].area);
                if area > 0.0 { (pressures[most], rest.map(|f| f / area)) } else { (0.0, [0.0; 3]) }
            })
        };
        Ok(self.nodes.iter().enumerate().map(traction).collect())
    }

    /// Whether all nodes of each facet bear a force. Facets of second order always count, because some of their nodes
    /// bear no force under a constant pressure.
    fn loaded(&self, forces: &[Point]) -> Vec<bool> {
        let bears = |node: &usize| forces[*node].iter().any(|&force| force != 0.0);
        self.facets.iter().map(|facet| facet.whole.is_some() || facet.nodes().iter().all(bears)).collect()
    }

    /// The faces around a node that have a loaded facet at the node; all faces if none has.
    fn faces(&self, place: usize, loaded: &[bool], positions: &[Point]) -> Vec<Face> {
        /// Least cosine between the normals of facets of one face: 37°.
        const SMOOTH: f64 = 0.8;
        let mut faces: Vec<Face> = Vec::new();
        for &(index, corner) in self.corners_at(place) {
            let facet = &self.facets[index];
            let points = quadrature(facet, &facet.shape(positions)).into_iter();
            let area = points.fold([0.0; 3], |sum, (weights, area)| add_scaled(sum, weights[corner], area));
            let mut face = Face { area, facets: vec![index] };
            faces.retain(|other| {
                let joins = dot(area, other.area) > SMOOTH * norm(area) * norm(other.area);
                if joins {
                    face.area = add_scaled(face.area, 1.0, other.area);
                    face.facets.extend(&other.facets);
                }
                !joins
            });
            faces.push(face);
        }
        let is_loaded = |face: &Face| face.facets.iter().any(|&facet| loaded[facet]);
        if faces.iter().any(is_loaded) {
            faces.retain(is_loaded);
        }
        faces
    }

    /// Redistributes forces from the nodes of facets of second order to the nodes of their linear parts. The sum
    /// stays.
    fn on_parts(&self, forces: Vec<Point>, loaded: &[bool], positions: &[Point]) -> Vec<Point> {
        if self.facets.iter().all(|facet| facet.whole.is_none()) {
            return forces;
        }
        // For each place, the facets there with their shares of the force. Each facet redistributes its own share.
        let parts = |(place, &node): (usize, &usize)| -> Vec<(usize, Point)> {
            let faces = self.faces(place, loaded, positions);
            let (pressures, rest) = pressures_of(forces[node], &faces);
            let largest = pressures.iter().fold(0.0, |most: f64, p| most.max(p.abs()));
            let bearing = pressures.iter().filter(|p| p.abs() >= largest).count();
            let part = |(face, pressure): (&Face, f64)| {
                let rest = if pressure.abs() >= largest { rest.map(|f| f / bearing as f64) } else { [0.0; 3] };
                let force = add_scaled(rest, -pressure, face.area).map(|f| f / face.facets.len() as f64);
                face.facets.iter().map(|&facet| (facet, force)).collect::<Vec<_>>()
            };
            faces.iter().zip(pressures).flat_map(part).collect()
        };
        let parts: Vec<_> = self.nodes.iter().enumerate().map(parts).collect();
        let mut moved = forces.clone();
        for (index, facet) in self.facets.iter().enumerate() {
            let Some(whole) = &facet.whole else { continue };
            for (corner, &node) in facet.nodes().iter().enumerate() {
                let part = parts[self.place(node)].iter().find(|(facet, _)| *facet == index);
                let Some(&(_, force)) = part else { continue };
                for (other, share) in facet.all_nodes().zip(whole.given(corner)) {
                    // A part whose other nodes are not on the surface keeps the force.
                    if self.nodes.binary_search(&other).is_ok() {
                        moved[node] = add_scaled(moved[node], -share, force);
                        moved[other] = add_scaled(moved[other], share, force);
                    }
                }
            }
        }
        moved
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

/// Facets around a node that meet smoothly, and their ∫ N n dA.
struct Face {
    area: Point,
    facets: Vec<usize>,
}

/// The pressures on the faces of a node that fit its force best, all of one sign, and the remaining force.
fn pressures_of(force: Point, faces: &[Face]) -> (Vec<f64>, Point) {
    const SWEEPS: usize = 200;
    let all = faces.iter().fold([0.0; 3], |sum, face| add_scaled(sum, 1.0, face.area));
    let sign = if dot(force, all) > 0.0 { -1.0 } else { 1.0 };
    let (mut pressures, mut rest) = (vec![0.0; faces.len()], force);
    // Projected Gauss–Seidel sweeps of least squares. One sweep solves a single face.
    for _ in 0..if faces.len() > 1 { SWEEPS } else { 1 } {
        for (pressure, face) in pressures.iter_mut().zip(faces) {
            let square = dot(face.area, face.area);
            if square > 0.0 {
                let next = *pressure - dot(rest, face.area) / square;
                let next = if faces.len() > 1 { sign * (sign * next).max(0.0) } else { next };
                rest = add_scaled(rest, next - *pressure, face.area);
                *pressure = next;
            }
        }
    }
    (pressures, rest)
}

/// Shape functions at the quadrature points of a facet, each with its area times the normal.
fn quadrature(facet: &Facet, shape: &Shape) -> Vec<([f64; 4], Point)> {
    let at = |weights: [f64; 4], share: f64| (weights, shape.product(&weights).map(|x| share * x));
    // One point is exact for linear functions on segments and triangles. On a bilinear quadrilateral N n dA is of
    // degree two in each direction.
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
