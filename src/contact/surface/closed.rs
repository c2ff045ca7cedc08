//! Whether a surface encloses a volume, and how large that is.

use super::Surface;
use super::shape::{Point, cross, dot, sub};

impl Surface {
    /// A facet at which the surface ends.
    pub(crate) fn open_facet(&self) -> Option<usize> {
        self.rims.iter().zip(&self.facets).position(|(rim, facet)| rim.sides[..facet.nodes().len()].contains(&true))
    }

    /// A node of a surface without rim at which it touches itself: the facets there are several fans.
    pub(crate) fn pinched_node(&self) -> Option<usize> {
        let groups = self.nodes.iter().zip(self.starts.windows(2));
        let mut groups = groups.map(|(&node, range)| (node, &self.around[range[0]..range[1]]));
        groups.find(|&(node, group)| self.fan(node, group) != group.len()).map(|(node, _)| node)
    }

    /// The number of facets in the fan of the first of the facets around a node.
    fn fan(&self, node: usize, group: &[(usize, usize)]) -> usize {
        let Some(&(first, vertex)) = group.first() else { return 0 };
        if self.facets[first].nodes().len() == 2 {
            return group.len();
        }
        let (mut at, mut count) = ((first, vertex), 0);
        while count < group.len() {
            let Some((next, _)) = self.neighbors[at.0][at.1] else { break };
            count += 1;
            if next == first {
                break;
            }
            let Some(vertex) = self.facets[next].nodes().iter().position(|&other| other == node) else { break };
            at = (next, vertex);
        }
        count
    }

    /// The volume that segments or triangles without rim enclose (an area in the plane), negative if their normals
    /// point into it.
    pub(crate) fn volume(&self, positions: &[Point]) -> f64 {
        let Some(&start) = self.nodes.first() else { return 0.0 };
        let at = |node: usize| sub(positions[node], positions[start]);
        let part = |nodes: &[usize]| match *nodes {
            [a, b] => 0.5 * cross(at(a), at(b))[2],
            [a, b, c] => dot(at(a), cross(at(b), at(c))) / 6.0,
            _ => f64::NAN,
        };
        self.facets.iter().map(|facet| part(facet.nodes())).sum()
    }
}
