//! Elements of second order: simplices, and quadrilaterals and hexahedra with or without nodes in the middle.

use crate::solids::{Material, Solid, invert};
use crate::stacks::under_pressure;
use contact_dynamics::contact::{ContactConstraint, Facet, Mortar, Surface, Tie};
use contact_dynamics::faer::Mat;
use contact_dynamics::faer::linalg::solvers::DenseSolveCore;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{LinearSystem, Result};
use std::collections::BTreeMap;

/// What elements are: a triangle of 6 or a tetrahedron of 10 nodes, of 8 or 20 nodes (no node inside of sides), of 9 or
/// 27 nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Family {
    Simplex,
    Serendipity,
    Lagrange,
}

/// The reference element.
struct Reference {
    /// Number of nodes.
    count: usize,
    /// Exponents of the monomials, and the coefficients of each shape function.
    monomials: Vec<Vec<i32>>,
    coefficients: Mat<f64>,
    /// Weights and points of a quadrature.
    rule: Vec<(f64, Vec<f64>)>,
}

/// Corners of the unit square, counterclockwise.
const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// All lists of `dimension` numbers below `count`.
fn tuples(count: usize, dimension: usize) -> Vec<Vec<usize>> {
    let split = |mut index: usize| {
        let digit = |_| {
            let digit = index % count;
            index /= count;
            digit
        };
        (0..dimension).map(digit).collect()
    };
    (0..count.pow(u32::try_from(dimension).unwrap())).map(split).collect()
}

impl Family {
    fn corners(self, dimension: usize) -> Vec<Vec<f64>> {
        match (self, dimension) {
            (_, 1) => vec![vec![0.0], vec![1.0]],
            (Self::Simplex, _) => {
                let corner = |k: usize| (0..dimension).map(|axis| f64::from(u8::from(axis + 1 == k))).collect();
                (0..=dimension).map(corner).collect()
            }
            (_, 2) => SQUARE.map(|corner| corner.to_vec()).to_vec(),
            _ => [0.0, 1.0].iter().flat_map(|&z| SQUARE.map(|[x, y]| vec![x, y, z])).collect(),
        }
    }

    /// Which corners each node is in the middle of: corners, edges in the order around, and what else there is.
    fn nodes(self, dimension: usize) -> Vec<Vec<usize>> {
        let corners = self.corners(dimension);
        let mut nodes: Vec<Vec<usize>> = (0..corners.len()).map(|corner| vec![corner]).collect();
        match (self, dimension) {
            (_, 1) => nodes.push(vec![0, 1]),
            (Self::Simplex, 2) => nodes.extend([[0, 1], [1, 2], [2, 0]].map(Vec::from)),
            (Self::Simplex, _) => nodes.extend([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]].map(Vec::from)),
            _ => {
                // Faces of all dimensions: some coordinates are free.
                let around = [[0, 1], [1, 2], [2, 3], [3, 0]].map(Vec::from);
                let face = |at: &Vec<usize>| -> Vec<usize> {
                    let has = |k: &usize| (0..dimension).all(|i| at[i] == 2 || corners[*k][i] == at[i] as f64);
                    (0..corners.len()).filter(has).collect()
                };
                let mut faces: Vec<Vec<usize>> = tuples(3, dimension).iter().map(face).collect();
                faces.sort_by_key(Vec::len);
                if dimension == 2 {
                    nodes.extend(around);
                    faces.retain(|face| face.len() > 2);
                }
                let most = if self == Self::Serendipity { 2 } else { 8 };
                nodes.extend(faces.into_iter().filter(|face| (2..=most).contains(&face.len())));
            }
        }
        nodes
    }

    fn monomials(self, dimension: usize) -> Vec<Vec<i32>> {
        let fits = |exponents: &Vec<usize>| match self {
            Self::Simplex => exponents.iter().sum::<usize>() <= 2,
            Self::Serendipity => exponents.iter().filter(|&&exponent| exponent == 2).count() <= 1,
            Self::Lagrange => true,
        };
        let signed = |exponents: Vec<usize>| exponents.iter().map(|&e| i32::try_from(e).unwrap()).collect();
        tuples(3, dimension).into_iter().filter(fits).map(signed).collect()
    }

    fn reference(self, dimension: usize) -> Reference {
        let (nodes, corners, monomials) = (self.nodes(dimension), self.corners(dimension), self.monomials(dimension));
        let at = |node: usize| middle(&nodes[node], &corners);
        let vandermonde = Mat::from_fn(nodes.len(), nodes.len(), |i, j| monomial(&monomials[j], &at(i)));
        let coefficients = vandermonde.partial_piv_lu().inverse();
        // Gauss' rule of three points; of simplices with the cube folded onto them.
        let line = [(5.0 / 18.0, 0.5 - 0.15_f64.sqrt()), (8.0 / 18.0, 0.5), (5.0 / 18.0, 0.5 + 0.15_f64.sqrt())];
        let point = |places: Vec<usize>| {
            let mut weight: f64 = places.iter().map(|&place| line[place].0).product();
            let mut point: Vec<f64> = places.iter().map(|&place| line[place].1).collect();
            for axis in (1..dimension).filter(|_| self == Self::Simplex) {
                let left = 1.0 - point[axis];
                (0..axis).for_each(|lower| point[lower] *= left);
                weight *= left.powi(i32::try_from(axis).unwrap());
            }
            (weight, point)
        };
        let rule = tuples(3, dimension).into_iter().map(point).collect();
        Reference { count: nodes.len(), monomials, coefficients, rule }
    }

    /// The corners of each side of an element, outward.
    fn sides(self, dimension: usize) -> Vec<Vec<usize>> {
        match (self, dimension) {
            (Self::Simplex, 2) => [[0, 1], [1, 2], [2, 0]].map(Vec::from).to_vec(),
            (Self::Simplex, _) => [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(Vec::from).to_vec(),
            (_, 2) => [[0, 1], [1, 2], [2, 3], [3, 0]].map(Vec::from).to_vec(),
            _ => {
                let sides = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
                sides.map(Vec::from).to_vec()
            }
        }
    }
}

fn middle<P: AsRef<[f64]>>(corners: &[usize], places: &[P]) -> Vec<f64> {
    let count = corners.len() as f64;
    let dimension = places[corners[0]].as_ref().len();
    (0..dimension).map(|axis| corners.iter().map(|&k| places[k].as_ref()[axis]).sum::<f64>() / count).collect()
}

fn monomial(exponents: &[i32], at: &[f64]) -> f64 {
    exponents.iter().zip(at).map(|(&e, x)| x.powi(e)).product()
}

impl Reference {
    /// Shape functions and their derivatives.
    fn shapes(&self, at: &[f64]) -> Vec<(f64, Vec<f64>)> {
        let slope = |exponents: &[i32], axis: usize| {
            let mut lower = exponents.to_vec();
            lower[axis] -= 1;
            if lower[axis] < 0 { 0.0 } else { f64::from(exponents[axis]) * monomial(&lower, at) }
        };
        let sum = |node: usize, value: &dyn Fn(&[i32]) -> f64| -> f64 {
            self.monomials.iter().enumerate().map(|(k, e)| self.coefficients[(k, node)] * value(e)).sum()
        };
        let shape = |node: usize| {
            let slopes = (0..at.len()).map(|axis| sum(node, &|e| slope(e, axis))).collect();
            (sum(node, &|e| monomial(e, at)), slopes)
        };
        (0..self.count).map(shape).collect()
    }
}

/// A linear elastic body of elements of second order.
#[derive(Clone, Debug)]
pub struct SecondOrder<const D: usize> {
    pub nodes: Vec<[f64; D]>,
    pub elements: Vec<Vec<usize>>,
    pub material: Material,
    family: Family,
    /// The node in the middle of corners, which are sorted.
    between: BTreeMap<Vec<usize>, usize>,
}

impl<const D: usize> SecondOrder<D> {
    /// With the corners and straight edges of a mesh of quadrilaterals or hexahedra, which are cut into simplices if
    /// elements are to be those.
    pub fn new(solid: &Solid<D>, family: Family) -> Self {
        let cells: Vec<Vec<usize>> = match (family, D) {
            (Family::Simplex, 2) => solid.elements.iter().flat_map(|q| cut(q, &[[0, 1, 2], [0, 2, 3]])).collect(),
            (Family::Simplex, _) => {
                // Around the diagonal from the first corner to the last but one.
                let parts = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]];
                solid.elements.iter().flat_map(|q| cut(q, &parts)).collect()
            }
            _ => solid.elements.clone(),
        };
        let material = solid.material;
        let mut body =
            Self { nodes: solid.nodes.clone(), elements: Vec::new(), material, family, between: BTreeMap::new() };
        for cell in cells {
            let element = family.nodes(D).into_iter().map(|corners| body.node(corners.iter().map(|&k| cell[k])));
            let element = element.collect();
            body.elements.push(element);
        }
        body
    }

    /// The node in the middle of corners, which is made if there is none.
    fn node(&mut self, corners: impl Iterator<Item = usize>) -> usize {
        let mut corners: Vec<usize> = corners.collect();
        if let [corner] = corners[..] {
            return corner;
        }
        corners.sort_unstable();
        let place: Vec<f64> = middle(&corners, &self.nodes);
        let next = self.nodes.len();
        let node = *self.between.entry(corners).or_insert(next);
        if node == next {
            self.nodes.push(std::array::from_fn(|axis| place[axis]));
        }
        node
    }

    /// With its nodes placed elsewhere.
    pub fn mapped(mut self, map: impl Fn([f64; D]) -> [f64; D]) -> Self {
        self.nodes.iter_mut().for_each(|node| *node = map(*node));
        self
    }

    pub fn dofs(&self) -> usize {
        D * self.nodes.len()
    }

    pub fn node_dofs(&self) -> Vec<[usize; D]> {
        (0..self.nodes.len()).map(|node| std::array::from_fn(|axis| Solid::<D>::dof(node, axis))).collect()
    }

    /// K, small strains, plane strain in two dimensions; and a mass in proportion to the diagonal of the consistent
    /// one, element by element.
    pub fn matrices(&self) -> (SparseColMat<usize, f64>, Vec<f64>) {
        let [lambda, mu] = self.material.lame();
        let reference = self.family.reference(D);
        let points: Vec<_> = reference.rule.iter().map(|(weight, at)| (*weight, reference.shapes(at))).collect();
        let (mut triplets, mut mass) = (Vec::new(), vec![0.0; self.dofs()]);
        for element in &self.elements {
            let (mut diagonal, mut whole) = (vec![0.0; element.len()], 0.0);
            for (weight, shapes) in &points {
                let jacobian: [[f64; D]; D] = std::array::from_fn(|i| {
                    std::array::from_fn(|j| {
                        shapes.iter().zip(element).map(|((_, d), &n)| d[i] * self.nodes[n][j]).sum()
                    })
                });
                let (volume, inverse) = invert(jacobian);
                assert!(volume > 0.0, "an element is turned inside out");
                let volume = weight * volume;
                whole += volume;
                diagonal.iter_mut().zip(shapes).for_each(|(sum, (shape, _))| *sum += volume * shape * shape);
                let slope =
                    |d: &Vec<f64>| -> [f64; D] { std::array::from_fn(|j| (0..D).map(|i| inverse[j][i] * d[i]).sum()) };
                let slopes: Vec<[f64; D]> = shapes.iter().map(|(_, d)| slope(d)).collect();
                for (da, &a) in slopes.iter().zip(element) {
                    for (db, &b) in slopes.iter().zip(element) {
                        let dot: f64 = da.iter().zip(db).map(|(x, y)| x * y).sum();
                        for i in 0..D {
                            for j in 0..D {
                                let along = if i == j { mu * dot } else { 0.0 };
                                let value = volume * (lambda * da[i] * db[j] + mu * da[j] * db[i] + along);
                                triplets.push(Triplet::new(D * a + i, D * b + j, value));
                            }
                        }
                    }
                }
            }
            let share = self.material.density * whole / diagonal.iter().sum::<f64>();
            for (&node, x) in element.iter().zip(&diagonal) {
                mass[D * node..D * (node + 1)].iter_mut().for_each(|m| *m += share * x);
            }
        }
        (SparseColMat::try_new_from_triplets(self.dofs(), self.dofs(), &triplets).unwrap(), mass)
    }
}

fn cut<const N: usize>(cell: &[usize], parts: &[[usize; N]]) -> Vec<Vec<usize>> {
    parts.iter().map(|part| part.iter().map(|&k| cell[k]).collect()).collect()
}

/// Two bodies of second order, one upon the other, and their sides that face each other.
pub struct SecondOrderStack<const D: usize> {
    pub solid: SecondOrder<D>,
    /// Number of nodes of the lower body.
    pub split: usize,
    /// Facets of the lower body and of the upper one, and the nodes of the sides of elements there, corners first.
    pub facets: [Vec<Facet>; 2],
    sides: [Vec<Vec<usize>>; 2],
}

impl<const D: usize> SecondOrderStack<D> {
    /// Bodies of height 1, the upper one from `1 + gap` on; then all is mapped.
    pub fn new(bodies: [Solid<D>; 2], family: Family, gap: f64, map: impl Fn([f64; D]) -> [f64; D]) -> Self {
        let [below, above] = bodies;
        let lift = std::array::from_fn(|axis| if axis + 1 == D { 1.0 + gap } else { 0.0 });
        // (Nodes of the lower body come first: corners of the upper one are moved behind its other nodes.)
        let mut solid = SecondOrder::new(&below, family);
        let split = solid.nodes.len();
        let above = SecondOrder::new(&above.moved(lift), family);
        let moved = |list: &Vec<usize>| list.iter().map(|&node| node + split).collect::<Vec<_>>();
        solid.nodes.extend(&above.nodes);
        solid.elements.extend(above.elements.iter().map(moved));
        solid.between.extend(above.between.iter().map(|(corners, &node)| (moved(corners), node + split)));
        let surface = Surface::of_cells(&solid.nodes, &solid.elements).expect("a mesh of sound elements");
        let at = |nodes: &[usize], height: f64, lower: bool| {
            nodes.iter().all(|&n| (n < split) == lower && (solid.nodes[n][D - 1] - height).abs() < 1e-9)
        };
        let places = [(1.0, true), (1.0 + gap, false)];
        let facets = places.map(|(height, lower)| {
            surface.facets().iter().copied().filter(|facet| at(facet.nodes(), height, lower)).collect()
        });
        let sides = places.map(|(height, lower)| {
            let all = solid.elements.iter().flat_map(|element| {
                family.sides(D).into_iter().map(move |side| side.iter().map(|&k| element[k]).collect::<Vec<_>>())
            });
            let whole = |corners: Vec<usize>| -> Vec<usize> {
                let node = |of: Vec<usize>| {
                    let mut key: Vec<usize> = of.iter().map(|&k| corners[k]).collect();
                    key.sort_unstable();
                    if key.len() == 1 { key[0] } else { solid.between[&key] }
                };
                family.nodes(D - 1).into_iter().map(node).collect()
            };
            all.filter(|side| at(side, height, lower)).map(whole).collect()
        });
        Self { solid: solid.mapped(map), split, facets, sides }
    }

    fn surfaces(&self, upper: bool) -> [Vec<Facet>; 2] {
        let [lower, above] = self.facets.clone();
        if upper { [above, lower] } else { [lower, above] }
    }

    /// Weighted gaps, the upper body being the slave, or the lower one.
    pub fn mortar(&self, upper: bool) -> Result<Mortar<f64>> {
        let [slave, master] = self.surfaces(upper);
        Mortar::new(&self.solid.nodes, &self.solid.node_dofs(), slave, master)
    }

    /// The same with facets taken as several of first order.
    pub fn mortar_of_first_order(&self, upper: bool) -> Result<Mortar<f64>> {
        let [slave, master] = self.surfaces(upper).map(|facets| facets.iter().map(linear).collect::<Vec<_>>());
        Mortar::new(&self.solid.nodes, &self.solid.node_dofs(), slave, master)
    }

    /// The bodies tied to each other, the upper one being the slave, or the lower one.
    pub fn tie(&self, upper: bool) -> Result<Tie<f64>> {
        let [slave, master] = self.surfaces(upper);
        Tie::new(&self.solid.nodes, &self.solid.node_dofs(), slave, master)
    }

    /// ∫ N n dA of all dofs over the sides that face each other, n outward.
    pub fn areas(&self) -> Vec<f64> {
        let reference = self.solid.family.reference(D - 1);
        let mut areas = vec![0.0; self.solid.dofs()];
        for side in self.sides.iter().flatten() {
            for (weight, at) in &reference.rule {
                let shapes = reference.shapes(at);
                let tangent = |k: usize| -> [f64; 3] {
                    let along = |axis: usize| {
                        shapes.iter().zip(side).map(|((_, d), &n)| d[k] * self.solid.nodes[n][axis]).sum()
                    };
                    std::array::from_fn(|axis| if axis < D { along(axis) } else { 0.0 })
                };
                let (a, b) = (tangent(0), if D == 2 { [0.0, 0.0, 1.0] } else { tangent(1) });
                let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
                for ((shape, _), &node) in shapes.iter().zip(side) {
                    (0..D).for_each(|axis| areas[D * node + axis] += weight * shape * normal[axis]);
                }
            }
        }
        areas
    }

    /// As of [`Stack::patch`](crate::stacks::Stack::patch).
    pub fn patch(&self, contact: impl ContactConstraint<f64> + 'static) -> Result<f64> {
        let (stiffness, mass) = self.solid.matrices();
        let system = || LinearSystem::lumped(mass.clone(), stiffness.clone());
        let areas: Vec<_> = self.areas().into_iter().enumerate().collect();
        let constraints: Vec<Box<dyn ContactConstraint<f64>>> = vec![Box::new(contact)];
        under_pressure(&self.solid.nodes, self.solid.material, system, &areas, constraints)
    }
}

/// A facet that is no part of another one.
pub fn linear(facet: &Facet) -> Facet {
    match *facet.nodes() {
        [a, b] => Facet::from([a, b]),
        [a, b, c] => Facet::from([a, b, c]),
        [a, b, c, d] => Facet::from([a, b, c, d]),
        _ => panic!("no facet has so many nodes"),
    }
}
