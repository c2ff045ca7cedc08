//! Sharp parts of a surface: nodes of convex edges, or corners in two dimensions.

use super::Surface;
use super::shape::{Point, cross, dot, norm, sub};

impl Surface {
    /// The nodes of convex edges around which the surface turns by more than `angle`, ascending. Edges where the
    /// surface ends do not count.
    pub(crate) fn sharp_nodes(&self, angle: f64, positions: &[Point]) -> Vec<usize> {
        let mut sharp = Vec::new();
        let sine_and_cosine = angle.sin_cos().into();
        for (index, facet) in self.facets().iter().enumerate() {
            let nodes = facet.nodes();
            for (side, &first) in nodes.iter().enumerate() {
                if self.turns(index, side, sine_and_cosine, positions) {
                    sharp.push(first);
                    sharp.extend((nodes.len() > 2).then_some(nodes[(side + 1) % nodes.len()]));
                }
            }
        }
        sharp.sort_unstable();
        sharp.dedup();
        sharp
    }

    /// Whether a surface is convex at a side, and turns across the middle of it by more than the angle with these sine
    /// and cosine. Not where it ends, or where a normal is not defined.
    pub(crate) fn turns(&self, facet: usize, side: usize, [sine, cosine]: [f64; 2], positions: &[Point]) -> bool {
        let Some((other, across)) = self.neighbor(facet, side) else { return false };
        let [shape, other] = [facet, other].map(|facet| self.facets()[facet].shape(positions));
        let own = shape.product(&shape.on_side(side, 0.5));
        let normal = other.product(&other.on_side(across, 0.5));
        // The sine of the turn less the angle, times the lengths of both products.
        let exceeds = norm(cross(own, normal)) * cosine > dot(own, normal) * sine;
        exceeds && dot(own, sub(other.middle(), shape.corner(side))) < 0.0
    }
}
