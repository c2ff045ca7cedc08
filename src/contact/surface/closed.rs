//! Whether a surface encloses a volume, the size of that volume, and which parts of it enclose the same body.

use super::Surface;
use super::shape::{Foot, Point, Shape, cross, dot, sub};

impl Surface {
    /// A facet at which the surface ends.
    pub(crate) fn open_facet(&self) -> Option<usize> {
        (0..self.facets.len()).find(|&facet| self.is_open(facet))
    }

    /// Whether the surface ends at a side of a facet.
    fn is_open(&self, facet: usize) -> bool {
        self.rims[facet].sides[..self.facets[facet].nodes().len()].contains(&true)
    }

    /// A node at which a surface without rim touches itself: the facets around it form several fans.
    pub(crate) fn pinched_node(&self) -> Option<usize> {
        let groups = self.nodes.iter().zip(self.starts.windows(2));
        let mut groups = groups.map(|(&node, range)| (node, &self.around[range[0]..range[1]]));
        groups.find(|&(node, group)| self.fan(node, group) != group.len()).map(|(node, _)| node)
    }

    /// The number of facets in the fan that contains the first facet around a node.
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

    /// The volume that the surface encloses if it has no rim (an area in the plane), negative if its normals point
    /// into it.
    pub(crate) fn volume(&self, positions: &[Point]) -> f64 {
        self.volume_of(0..self.facets.len(), positions)
    }

    /// The volume from some of its facets.
    fn volume_of(&self, facets: impl IntoIterator<Item = usize>, positions: &[Point]) -> f64 {
        let Some(&start) = self.nodes.first() else { return 0.0 };
        let at = |node: usize| sub(positions[node], positions[start]);
        let triangle = |[a, b, c]: [usize; 3]| dot(at(a), cross(at(b), at(c))) / 6.0;
        let part = |facet: usize| match *self.facets[facet].nodes() {
            [a, b] => 0.5 * cross(at(a), at(b))[2],
            [a, b, c] => triangle([a, b, c]),
            [a, b, c, d] => triangle([a, b, c]) + triangle([a, c, d]),
            _ => f64::NAN,
        };
        facets.into_iter().map(part).sum()
    }

    /// The body of each facet, by the number of one of the body's facets. Facets connected through shared nodes
    /// belong to one body. So do the hollows in it: closed parts whose normals point into them.
    pub(crate) fn bodies(&self, positions: &[Point]) -> Vec<usize> {
        let mut bodies = self.parts();
        let mut parts: Vec<Vec<usize>> = vec![Vec::new(); bodies.len()];
        bodies.iter().enumerate().for_each(|(facet, &part)| parts[part].push(facet));
        let is_closed = |part: &Vec<usize>| !part.is_empty() && !part.iter().any(|&facet| self.is_open(facet));
        let sized = |part: Vec<usize>| (self.volume_of(part.iter().copied(), positions), part);
        let closed: Vec<_> = parts.into_iter().filter(is_closed).map(sized).collect();
        let (mut hollows, solids): (Vec<_>, Vec<_>) = closed.into_iter().partition(|(volume, _)| *volume < 0.0);
        // From the outside to the inside. Of overlapping solids, as before a press fit, the larger one has the
        // hollow.
        hollows.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (k, (volume, hollow)) in hollows.iter().enumerate() {
            let x = positions[self.facets[hollow[0]].nodes[0]];
            let is_in_hollow_of = |body: usize| {
                let mut outer = hollows[..k].iter().filter(|(_, outer)| bodies[outer[0]] == body);
                outer.any(|(_, outer)| self.height_over(outer, x, positions) > 0.0)
            };
            let around = solids.iter().filter(|(other, solid)| {
                let may_hold = *other > -volume && !is_in_hollow_of(bodies[solid[0]]);
                may_hold && self.height_over(solid, x, positions) < 0.0
            });
            let largest = around.max_by(|one, other| one.0.total_cmp(&other.0));
            if let Some(body) = largest.map(|(_, solid)| bodies[solid[0]]) {
                for &facet in hollow {
                    bodies[facet] = body;
                }
            }
        }
        bodies
    }

    /// The signed distance of a point from some facets, positive in front of them.
    fn height_over(&self, facets: &[usize], x: Point, positions: &[Point]) -> f64 {
        let mut best: Option<(usize, (Shape, Foot))> = None;
        for &facet in facets {
            let Some(found) = self.project(facet, x, positions) else { continue };
            if best.as_ref().is_none_or(|(_, (_, foot))| found.1.is_better_than(foot)) {
                best = Some((facet, found));
            }
        }
        let height = best.and_then(|(facet, found)| self.direction(facet, x, &found, (0.0, &|_| true), positions));
        height.map_or(f64::INFINITY, |(_, height)| height)
    }

    /// The parts of the surface that share no node, by facet: the number of the first facet of each.
    fn parts(&self) -> Vec<usize> {
        let mut parts = vec![usize::MAX; self.facets.len()];
        let mut reached = Vec::new();
        for first in 0..parts.len() {
            if parts[first] != usize::MAX {
                continue;
            }
            parts[first] = first;
            reached.push(first);
            while let Some(facet) = reached.pop() {
                for k in 0..self.facets[facet].nodes().len() {
                    for other in self.facets_at(facet, k) {
                        if parts[other] == usize::MAX {
                            parts[other] = first;
                            reached.push(other);
                        }
                    }
                }
            }
        }
        parts
    }
}
