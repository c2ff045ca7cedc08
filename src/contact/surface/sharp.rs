//! Sharp parts of a surface: nodes of convex edges, or corners in two dimensions.

use super::Surface;
use super::shape::{Point, cross, dot, norm, sub};

impl Surface {
    /// The nodes of convex edges around which the surface turns by more than `angle`, ascending. Edges where the
    /// surface ends do not count.
    pub(crate) fn sharp_nodes(&self, angle: f64, positions: &[Point]) -> Vec<usize> {
        let mut sharp = Vec::new();
        for (index, facet) in self.facets().iter().enumerate() {
            let (shape, nodes) = (facet.shape(positions), facet.nodes());
            for (side, &first) in nodes.iter().enumerate() {
                let Some((other, across)) = self.neighbor(index, side) else { continue };
                let second = nodes[(side + 1) % nodes.len()];
                let other = self.facets()[other].shape(positions);
                let normals = [shape.normal(&shape.on_side(side, 0.5)), other.normal(&other.on_side(across, 0.5))];
                let [Some(own), Some(across)] = normals else { continue };
                let turn = norm(cross(own, across)).atan2(dot(own, across));
                let below = sub(other.middle(), positions[first]);
                if turn > angle && dot(own, below) < 0.0 {
                    sharp.push(first);
                    sharp.extend((nodes.len() > 2).then_some(second));
                }
            }
        }
        sharp.sort_unstable();
        sharp.dedup();
        sharp
    }
}
