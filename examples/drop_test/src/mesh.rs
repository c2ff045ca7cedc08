//! A mesh of tetrahedra and hexahedra with its surface.

use std::collections::HashMap;

/// What an element is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Four nodes, linear.
    Tetrahedron,
    /// Eight nodes, trilinear.
    Hexahedron,
}

impl Shape {
    pub fn corners(self) -> usize {
        match self {
            Self::Tetrahedron => 4,
            Self::Hexahedron => 8,
        }
    }

    /// The sides by their corners, counterclockwise if seen from outside.
    fn sides(self) -> &'static [&'static [usize]] {
        match self {
            Self::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]],
            Self::Hexahedron => {
                &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
            }
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Tetrahedron => "tetrahedron",
            Self::Hexahedron => "hexahedron",
        }
    }
}

/// An element; of a tetrahedron the last four corners mean nothing.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    pub shape: Shape,
    pub corners: [usize; 8],
    /// Its number in the file.
    pub tag: u64,
}

impl Element {
    pub fn nodes(&self) -> &[usize] {
        &self.corners[..self.shape.corners()]
    }
}

/// Nodes (meters) and elements.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub nodes: Vec<[f64; 3]>,
    pub elements: Vec<Element>,
}

/// An integration point: derivatives of the shape functions in space, and weight times volume.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub gradients: [[f64; 3]; 8],
    pub volume: f64,
}

pub fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Determinant and cofactors of a matrix: the inverse is the transpose of the cofactors over the determinant.
pub fn cofactors(m: &[[f64; 3]; 3]) -> (f64, [[f64; 3]; 3]) {
    let c = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])];
    (dot(&m[0], &c[0]), c)
}

impl Mesh {
    /// Integration points of an element: one of a tetrahedron, 2 × 2 × 2 of a hexahedron.
    pub fn points(&self, element: &Element) -> Vec<Point> {
        match element.shape {
            Shape::Tetrahedron => {
                let local = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                vec![self.point(element, &local, 1.0 / 6.0)]
            }
            Shape::Hexahedron => {
                let at = |k: usize| CUBE[k].map(|x| x / 3.0_f64.sqrt());
                (0..8).map(|k| self.point(element, &cube_derivatives(at(k)), 1.0)).collect()
            }
        }
    }

    /// The point at which the shape functions have these derivatives in the reference element.
    fn point(&self, element: &Element, local: &[[f64; 3]], weight: f64) -> Point {
        let mut jacobian = [[0.0; 3]; 3]; // ∂x_j/∂ξ_i
        for (d, &node) in local.iter().zip(element.nodes()) {
            for i in 0..3 {
                for j in 0..3 {
                    jacobian[i][j] += d[i] * self.nodes[node][j];
                }
            }
        }
        let (determinant, cofactors) = cofactors(&jacobian);
        let mut gradients = [[0.0; 3]; 8];
        for (gradient, d) in gradients.iter_mut().zip(local) {
            *gradient = [0, 1, 2].map(|j| (0..3).map(|i| cofactors[i][j] * d[i]).sum::<f64>() / determinant);
        }
        Point { gradients, volume: weight * determinant }
    }

    /// Refuses coordinates that are not finite, elements that are turned inside out or flat, and sides of three
    /// elements.
    pub fn check(&self) -> Result<(), String> {
        if let Some(node) = self.nodes.iter().position(|x| x.iter().any(|x| !x.is_finite())) {
            return Err(format!("a node stands at {:?}", self.nodes[node]));
        }
        for element in &self.elements {
            let smallest = self.points(element).iter().map(|point| point.volume).fold(f64::INFINITY, f64::min);
            if smallest.is_nan() || smallest <= 0.0 {
                let (name, tag) = (element.shape.name(), element.tag);
                return Err(format!(
                    "element {tag}, a {name}, is turned inside out or flat (volume {smallest:.3e} m³ at a point): \
                     look at the quality of the mesh, with Gmsh's Tools, Statistics, and mesh it anew"
                ));
            }
        }
        if let Some(count) = self.sides().into_values().map(|(_, count)| count).find(|count| *count > 2) {
            return Err(format!("a side belongs to {count} elements: the file has elements twice"));
        }
        Ok(())
    }

    pub fn volume(&self) -> f64 {
        self.elements.iter().flat_map(|element| self.points(element)).map(|point| point.volume).sum()
    }

    /// All sides by their sorted nodes: the nodes in order, and to how many elements it belongs.
    fn sides(&self) -> HashMap<[usize; 4], (Vec<usize>, usize)> {
        let mut sides = HashMap::new();
        for element in &self.elements {
            for side in element.shape.sides() {
                let nodes: Vec<usize> = side.iter().map(|&corner| element.corners[corner]).collect();
                let mut key = [usize::MAX; 4];
                key[..nodes.len()].copy_from_slice(&nodes);
                key.sort_unstable();
                sides.entry(key).or_insert((nodes, 0)).1 += 1;
            }
        }
        sides
    }

    /// The facets of the surface, counterclockwise if seen from outside, in an order that the mesh alone decides.
    pub fn boundary(&self) -> Vec<Vec<usize>> {
        let mut outer: Vec<_> = self.sides().into_iter().filter(|(_, (_, count))| *count == 1).collect();
        outer.sort_unstable();
        outer.into_iter().map(|(_, (nodes, _))| nodes).collect()
    }

    /// Area of a facet times its normal.
    #[cfg(test)]
    pub fn area(&self, facet: &[usize]) -> [f64; 3] {
        area_at(facet, |node| self.nodes[node])
    }

    /// The box that holds all nodes.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        self.nodes.iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], x| {
            [[0, 1, 2].map(|i| f64::min(low[i], x[i])), [0, 1, 2].map(|i| f64::max(high[i], x[i]))]
        })
    }

    /// The least height of an element over one of its sides: its volume over its largest side, times three for a
    /// tetrahedron.
    pub fn thinnest(&self) -> f64 {
        let height = |element: &Element| {
            let volume: f64 = self.points(element).iter().map(|point| point.volume).sum();
            let area = |side: &[usize]| {
                let a = area_at(side, |corner| self.nodes[element.corners[corner]]);
                dot(&a, &a).sqrt()
            };
            let largest = element.shape.sides().iter().map(|side| area(side)).fold(0.0, f64::max);
            volume / largest * if element.shape == Shape::Tetrahedron { 3.0 } else { 1.0 }
        };
        self.elements.iter().map(height).fold(f64::INFINITY, f64::min)
    }

    /// The length of the side of a cube as large as a mean element.
    pub fn mean_size(&self) -> f64 {
        let cells: f64 =
            self.elements.iter().map(|e| if e.shape == Shape::Tetrahedron { 1.0 / 6.0 } else { 1.0 }).sum();
        (self.volume() / cells).cbrt()
    }

    /// Moved.
    pub fn translate(&mut self, by: [f64; 3]) {
        for node in &mut self.nodes {
            *node = [0, 1, 2].map(|i| node[i] + by[i]);
        }
    }

    /// Turned about x, then y, then z, by angles in degrees.
    pub fn turn(&mut self, degrees: [f64; 3]) {
        for (axis, angle) in degrees.into_iter().enumerate() {
            let (s, c) = angle.to_radians().sin_cos();
            let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
            for node in &mut self.nodes {
                (node[i], node[j]) = (c * node[i] - s * node[j], s * node[i] + c * node[j]);
            }
        }
    }

    /// This mesh and another one beside it, whose nodes come behind.
    pub fn append(&mut self, other: &Self) {
        let first = self.nodes.len();
        self.nodes.extend(&other.nodes);
        self.elements.extend(other.elements.iter().map(|e| Element { corners: e.corners.map(|n| n + first), ..*e }));
    }
}

/// Area of a facet times its normal, with its nodes at `place`: half the cross product of the diagonals.
pub fn area_at(facet: &[usize], place: impl Fn(usize) -> [f64; 3]) -> [f64; 3] {
    let x: Vec<[f64; 3]> = facet.iter().map(|&node| place(node)).collect();
    let [a, b] = match x.len() {
        3 => [minus(x[1], x[0]), minus(x[2], x[0])],
        _ => [minus(x[2], x[0]), minus(x[3], x[1])],
    };
    cross(a, b).map(|x| 0.5 * x)
}

/// Corners of the reference hexahedron.
const CUBE: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// Derivatives of the trilinear shape functions.
fn cube_derivatives(at: [f64; 3]) -> [[f64; 3]; 8] {
    CUBE.map(|corner| {
        let factor = [0, 1, 2].map(|axis| 0.5 * (1.0 + corner[axis] * at[axis]));
        [
            0.5 * corner[0] * factor[1] * factor[2],
            0.5 * corner[1] * factor[0] * factor[2],
            0.5 * corner[2] * factor[0] * factor[1],
        ]
    })
}
