//! The outer sides of a mesh of cells: sides of exactly one cell, oriented outward.

use super::nodes::points;
use super::shape::{Point, add_scaled, cross, dot, norm, sub};
use super::{Facet, Surface};
use crate::contact::check_nodes;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::SMALLEST_AREA;

/// Sides of cells by their corners, with outward normals for the usual numbering of corners: counter-clockwise for
/// triangles and quadrilaterals, and the first face counter-clockwise seen from inside for the other cells.
type Sides = &'static [&'static [usize]];

const TRIANGLE: Sides = &[&[0, 1], &[1, 2], &[2, 0]];
const QUADRILATERAL: Sides = &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]];
const TETRAHEDRON: Sides = &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]];
const PYRAMID: Sides = &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
const WEDGE: Sides = &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
const HEXAHEDRON: Sides = &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]];

/// Number of corners, their sides, and whether quadrilateral sides have a node in the middle, by the number of nodes.
fn kind(dimension: usize, nodes: usize) -> Option<(usize, Sides, bool)> {
    Some(match (dimension, nodes) {
        (2, 3 | 6) => (3, TRIANGLE, false),
        (2, 4 | 8 | 9) => (4, QUADRILATERAL, false),
        (3, 4 | 10) => (4, TETRAHEDRON, false),
        (3, 5 | 13 | 14) => (5, PYRAMID, nodes == 14),
        (3, 6 | 15 | 18) => (6, WEDGE, nodes == 18),
        (3, 8 | 20 | 27) => (8, HEXAHEDRON, nodes == 27),
        _ => return None,
    })
}

impl Surface {
    /// The outer sides of a mesh: the sides that belong to one cell only, with normals out of the cell. `coordinates`
    /// are the reference coordinates of all nodes.
    ///
    /// A cell is the list of its nodes, corners first, as in finite-element codes and mesh formats. Its number of
    /// nodes determines its type: in two dimensions a triangle (3, 6) or a quadrilateral (4, 8, 9), in three a
    /// tetrahedron (4, 10), a pyramid (5, 13, 14), a wedge (6, 15, 18) or a hexahedron (8, 20, 27). Cells may have
    /// either orientation. The nodes of a cell of second order behind its corners may be in any order: each side gets
    /// the nodes closest to its middle and to the middles of its edges. Such a side becomes several facets.
    ///
    /// ```
    /// use contact_dynamics::contact::Surface;
    ///
    /// // A unit square of two triangles: the side between them is inside.
    /// let coordinates = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    /// let square = Surface::of_cells(&coordinates, [[0, 1, 2], [0, 2, 3]])?;
    /// assert_eq!(square.facets().len(), 4);
    /// // Of the length of 4 each node has one.
    /// assert_eq!(square.areas(&coordinates)?, [1.0; 4]);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`new`](Self::new); [`Error::Incompatible`] for a cell with another number of nodes or without
    /// volume, for a side shared by three cells, and if one node is closest to the middles of two edges of a side.
    pub fn of_cells<T: Real, C: AsRef<[usize]>, const D: usize>(
        coordinates: &[[T; D]],
        cells: impl IntoIterator<Item = C>,
    ) -> Result<Self> {
        let coordinates = points(coordinates)?;
        let given: Vec<C> = cells.into_iter().collect();
        let read = given.iter().enumerate().map(|(index, nodes)| Cell::new(index, nodes.as_ref(), D, &coordinates));
        let cells = read.collect::<Result<Vec<_>>>()?;
        // (corners in ascending order, cell, side)
        let mut sides = Vec::new();
        for cell in &cells {
            for (side, corners) in cell.sides.iter().enumerate() {
                let mut key = [usize::MAX; 4];
                key.iter_mut().zip(*corners).for_each(|(key, &corner)| *key = cell.nodes[corner]);
                key.sort_unstable();
                sides.push((key, cell.index, side));
            }
        }
        sides.sort_unstable();
        let mut outer = Vec::new();
        for group in sides.chunk_by(|x, y| x.0 == y.0) {
            match *group {
                [(_, cell, side)] => outer.push((cell, side)),
                [_, _, (_, cell, _), ..] => return Err(refuse(cell, "a side of it belongs to three cells or more")),
                _ => {}
            }
        }
        // In the order of the cells.
        outer.sort_unstable();
        let mut facets = Vec::new();
        for (cell, side) in outer {
            cells[cell].push_facets(side, &coordinates, &mut facets)?;
        }
        Self::of_facets(facets, D, &coordinates)
    }
}

fn refuse(cell: usize, reason: &'static str) -> Error {
    Error::Incompatible { part: format!("cell {cell} of a mesh"), reason }
}

fn middle_of(nodes: &[usize], coordinates: &[Point]) -> Point {
    let sum = nodes.iter().fold([0.0; 3], |sum, &node| add_scaled(sum, 1.0, coordinates[node]));
    sum.map(|x| x / nodes.len() as f64)
}

/// A cell of known type.
struct Cell<'c> {
    index: usize,
    nodes: &'c [usize],
    corners: usize,
    sides: Sides,
    /// Whether its quadrilateral sides have a node in the middle.
    centered: bool,
    /// Whether its corners are in the reverse order.
    turned: bool,
}

impl<'c> Cell<'c> {
    fn new(index: usize, nodes: &'c [usize], dimension: usize, coordinates: &[Point]) -> Result<Self> {
        let Some((corners, sides, centered)) = kind(dimension, nodes.len()) else {
            let reason = match dimension {
                2 => "in two dimensions a cell has 3 or 6 nodes (triangle), 4, 8 or 9 (quadrilateral)",
                _ => {
                    "in three dimensions a cell has 4 or 10 nodes (tetrahedron), 5, 13 or 14 (pyramid), 6, 15 or 18 \
                     (wedge), 8, 20 or 27 (hexahedron)"
                }
            };
            return Err(refuse(index, reason));
        };
        check_nodes("the nodes of a cell (at most)", nodes, coordinates.len())?;
        let cell = Self { index, nodes, corners, sides, centered, turned: false };
        let turned = cell.volume(coordinates)? < 0.0;
        Ok(Self { turned, ..cell })
    }

    fn at(&self, corners: &[usize]) -> Vec<usize> {
        corners.iter().map(|&corner| self.nodes[corner]).collect()
    }

    /// Its volume (area in two dimensions) with straight edges; negative if its corners are in the reverse order.
    fn volume(&self, coordinates: &[Point]) -> Result<f64> {
        let corners = &self.nodes[..self.corners];
        let middle = middle_of(corners, coordinates);
        let from_middle = |corner: usize| sub(coordinates[self.nodes[corner]], middle);
        let mut volume = 0.0;
        for side in self.sides {
            let corner = |k: usize| from_middle(side[k]);
            volume += match side.len() {
                2 => 0.5 * cross(corner(0), corner(1))[2],
                3 => dot(corner(0), cross(corner(1), corner(2))) / 6.0,
                // The cone over a bilinear side.
                _ => {
                    let center = middle_of(&self.at(side), coordinates);
                    dot(sub(center, middle), cross(sub(corner(2), corner(0)), sub(corner(3), corner(1)))) / 6.0
                }
            };
        }
        let size = (0..self.corners).map(|corner| norm(from_middle(corner))).fold(0.0, f64::max);
        let power = if self.sides[0].len() == 2 { 2 } else { 3 };
        match volume.abs() > SMALLEST_AREA * size.powi(power) {
            true => Ok(volume),
            false => Err(refuse(self.index, "it has no volume: its nodes are in a wrong order, or it is flat")),
        }
    }

    /// The node that is no corner and is closest to the middle of the given nodes; none if there are only corners.
    fn between(&self, nodes: &[usize], coordinates: &[Point]) -> Option<usize> {
        let middle = middle_of(nodes, coordinates);
        let distance = |node: usize| norm(sub(coordinates[node], middle));
        self.nodes[self.corners..].iter().copied().min_by(|&x, &y| distance(x).total_cmp(&distance(y)))
    }

    /// Appends the facets of one of its sides.
    fn push_facets(&self, side: usize, coordinates: &[Point], facets: &mut Vec<Facet>) -> Result<()> {
        let mut corners = self.at(self.sides[side]);
        if self.turned {
            corners.reverse();
        }
        let edges = if corners.len() == 2 { 1 } else { corners.len() };
        let mut nodes = corners.clone();
        for k in 0..edges {
            nodes.extend(self.between(&[corners[k], corners[(k + 1) % corners.len()]], coordinates));
        }
        if self.centered && corners.len() == 4 {
            nodes.extend(self.between(&corners, coordinates));
        }
        if (1..nodes.len()).any(|k| nodes[..k].contains(&nodes[k])) {
            let reason = "on one of its sides a node is the closest one to the middles of two edges; its corners must \
                          come first, and the others near the middles of edges and sides";
            return Err(refuse(self.index, reason));
        }
        match nodes[..] {
            [a, b] => facets.push(Facet::from([a, b])),
            [a, b, c] if corners.len() == 2 => facets.extend(Facet::of_quadratic_segment([a, b, c])),
            [a, b, c] => facets.push(Facet::from([a, b, c])),
            [a, b, c, d] => facets.push(Facet::from([a, b, c, d])),
            [a, b, c, d, e, f] => facets.extend(Facet::of_quadratic_triangle([a, b, c, d, e, f])),
            [a, b, c, d, e, f, g, h] => {
                facets.extend(Facet::of_quadratic_quadrilateral([a, b, c, d, e, f, g, h]));
            }
            [a, b, c, d, e, f, g, h, i] => {
                facets.extend(Facet::of_biquadratic_quadrilateral([a, b, c, d, e, f, g, h, i]));
            }
            // No side of a cell has another number of nodes.
            _ => {}
        }
        Ok(())
    }
}
