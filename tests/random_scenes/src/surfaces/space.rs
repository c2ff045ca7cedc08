//! What differs between the plane and space: shapes of obstacles, turning, edges.

use contact_dynamics::Result;
use contact_dynamics::contact::{ContactConstraint, EdgeToEdge, Facet, Obstacle, RigidMotion, SurfaceSettings};
use contact_dynamics_scenes::obstacles::{Named, in_plane_of_size, in_space_of_size};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::vectors::dot;

/// Of D dimensions.
pub(super) struct Space<const D: usize>;

pub(super) trait Dimension<const D: usize> {
    /// Obstacles of all shapes about the origin, about as large as `size`.
    fn shapes(size: f64, random: &mut Congruential) -> Vec<Named<D>>;

    /// By an angle with its derivatives.
    fn turning(point: [f64; D], axis: [f64; 3], angle: [f64; 3]) -> RigidMotion<f64, D>;

    /// Edges of two surfaces, if there are any.
    fn edges(nodes: &[[f64; D]], dofs: &[[usize; D]], surfaces: [&[Facet]; 2], reach: f64) -> Result<Option<Boxed>>;
}

pub(super) type Boxed = Box<dyn ContactConstraint<f64>>;

impl Dimension<2> for Space<2> {
    fn shapes(size: f64, random: &mut Congruential) -> Vec<Named<2>> {
        with_own(in_plane_of_size(size, random), size)
    }

    fn turning(point: [f64; 2], _: [f64; 3], angle: [f64; 3]) -> RigidMotion<f64, 2> {
        RigidMotion::about_point(point, angle)
    }

    fn edges(_: &[[f64; 2]], _: &[[usize; 2]], _: [&[Facet]; 2], _: f64) -> Result<Option<Boxed>> {
        Ok(None)
    }
}

impl Dimension<3> for Space<3> {
    fn shapes(size: f64, random: &mut Congruential) -> Vec<Named<3>> {
        with_own(in_space_of_size(size, random), size)
    }

    fn turning(point: [f64; 3], axis: [f64; 3], angle: [f64; 3]) -> RigidMotion<f64, 3> {
        RigidMotion::about_axis(point, axis, angle)
    }

    fn edges(
        nodes: &[[f64; 3]],
        dofs: &[[usize; 3]],
        [one, other]: [&[Facet]; 2],
        reach: f64,
    ) -> Result<Option<Boxed>> {
        let edges = EdgeToEdge::new(nodes, dofs, one.iter().copied(), other.iter().copied())?;
        Ok(Some(Box::new(edges.with(SurfaceSettings::new().reach(reach))?)))
    }
}

/// With the shape of a host.
fn with_own<const D: usize>(mut shapes: Vec<Named<D>>, size: f64) -> Vec<Named<D>> {
    shapes.push((if D == 2 { "two discs of a host" } else { "torus of a host" }, Box::new(Torus { size })));
    shapes
}

/// A torus around the last axis; in the plane two discs. Its curvature is not given.
struct Torus {
    size: f64,
}

impl<const D: usize> Obstacle<f64, D> for Torus {
    fn distance(&self, x: [f64; D]) -> (f64, [f64; D]) {
        let mut outward = x;
        outward[D - 1] = 0.0;
        let from_axis = dot(outward, outward).sqrt();
        let share = if from_axis > 0.0 { 0.6 * self.size / from_axis } else { 0.0 };
        let from_circle: [f64; D] = std::array::from_fn(|k| x[k] - share * outward[k]);
        let distance = dot(from_circle, from_circle).sqrt();
        let normal = if distance > 0.0 { from_circle.map(|x| x / distance) } else { [0.0; D].map(|_| 1.0) };
        (distance - 0.25 * self.size, normal)
    }
}
