//! Sharp parts of a surface: nodes of convex edges, or corners in two dimensions.

use super::Surface;
use super::shape::{Point, cross, dot, norm, sub};

impl Surface {
    /// The nodes of convex edges around which the surface turns by more than `angle`, ascending. Edges where the
    /// surface ends do not count.
    pub(crate) fn sharp_nodes(&self, angle: f64, positions: &[Point]) -> Vec<usize> {
        let mut sharp = Vec::new();
        for (index, facet) in self.facets().iter().enumerate() {
            let nodes = facet.nodes();
            for (side, &first) in nodes.iter().enumerate() {
                if self.turn(index, side, positions).is_some_and(|turn| turn > angle) {
                    sharp.push(first);
                    sharp.extend((nodes.len() > 2).then_some(nodes[(side + 1) % nodes.len()]));
                }
            }
        }
        sharp.sort_unstable();
        sharp.dedup();
        sharp
    }

    /// The angle by which the surface turns across the middle of a side, positive where it is convex; none where the
    /// surface ends, or where a normal is not defined.
    pub(crate) fn turn(&self, facet: usize, side: usize, positions: &[Point]) -> Option<f64> {
        let (other, across) = self.neighbor(facet, side)?;
        let [shape, other] = [facet, other].map(|facet| self.facets()[facet].shape(positions));
        let own = shape.normal(&shape.on_side(side, 0.5))?;
        let normal = other.normal(&other.on_side(across, 0.5))?;
        let turn = norm(cross(own, normal)).atan2(dot(own, normal));
        Some(if dot(own, sub(other.middle(), shape.corner(side))) < 0.0 { turn } else { -turn })
    }
}
