//! What nonlinear bodies share: nodes with lumped masses and their momenta, and the assembly of element matrices.

use crate::vectors::cross;
use contact_dynamics::faer::sparse::SymbolicSparseColMat;
use std::collections::BTreeSet;

/// Nodes with masses, under gravity, some dofs fixed. Dofs are numbered node by node.
#[derive(Clone, Debug)]
pub struct Particles<const D: usize> {
    pub nodes: Vec<[f64; D]>,
    /// Mass of each dof.
    pub mass: Vec<f64>,
    /// Weight of each dof.
    pub load: Vec<f64>,
    /// Fixed dofs, ascending.
    pub fixed: Vec<usize>,
}

impl<const D: usize> Particles<D> {
    /// Free nodes without weight; one mass a dof.
    pub fn new(nodes: Vec<[f64; D]>, mass: Vec<f64>) -> Self {
        assert_eq!(mass.len(), D * nodes.len());
        Self { load: vec![0.0; mass.len()], nodes, mass, fixed: Vec::new() }
    }

    pub fn dofs(&self) -> usize {
        self.mass.len()
    }

    /// The dofs of all nodes.
    pub fn node_dofs(&self) -> Vec<[usize; D]> {
        (0..self.nodes.len()).map(|node| std::array::from_fn(|axis| D * node + axis)).collect()
    }

    /// Sets the weight to mass times `gravity`.
    pub fn weigh(&mut self, gravity: [f64; D]) {
        for (dof, (load, mass)) in self.load.iter_mut().zip(&self.mass).enumerate() {
            *load = mass * gravity[dof % D];
        }
    }

    /// Fixes dofs beside those that are fixed already.
    pub fn fix(&mut self, dofs: impl IntoIterator<Item = usize>) {
        self.fixed.extend(dofs);
        self.fixed.sort_unstable();
        self.fixed.dedup();
        assert!(self.fixed.last().is_none_or(|&dof| dof < self.dofs()));
    }

    /// Displacements that move every node to `map` of its place.
    pub fn displaced(&self, map: impl Fn([f64; D]) -> [f64; D]) -> Vec<f64> {
        self.nodes
            .iter()
            .flat_map(|&x| {
                let y = map(x);
                std::array::from_fn::<_, D, _>(|axis| y[axis] - x[axis])
            })
            .collect()
    }

    pub fn kinetic_energy(&self, v: &[f64]) -> f64 {
        0.5 * self.mass.iter().zip(v).map(|(m, v)| m * v * v).sum::<f64>()
    }

    /// Energy of the weight at u, zero in the reference configuration.
    pub fn weight_energy(&self, u: &[f64]) -> f64 {
        -self.load.iter().zip(u).map(|(f, u)| f * u).sum::<f64>()
    }

    pub fn linear_momentum(&self, v: &[f64]) -> [f64; D] {
        std::array::from_fn(|axis| (axis..self.dofs()).step_by(D).map(|dof| self.mass[dof] * v[dof]).sum())
    }

    /// Σ x × f about the origin at displacements u, for one f a dof; the third component alone in the plane.
    pub fn moment(&self, u: &[f64], f: impl Fn(usize) -> f64) -> [f64; 3] {
        let mut moment = [0.0; 3];
        for (node, place) in self.nodes.iter().enumerate() {
            let (mut x, mut p) = ([0.0; 3], [0.0; 3]);
            for axis in 0..D {
                x[axis] = place[axis] + u[D * node + axis];
                p[axis] = f(D * node + axis);
            }
            let turn = cross(x, p);
            moment.iter_mut().zip(turn).for_each(|(moment, turn)| *moment += turn);
        }
        moment
    }

    /// Center of mass at displacements u.
    pub fn center(&self, u: &[f64]) -> [f64; D] {
        std::array::from_fn(|axis| {
            let dofs = || (axis..self.dofs()).step_by(D);
            let sum: f64 = dofs().map(|dof| self.mass[dof] * (self.nodes[dof / D][axis] + u[dof])).sum();
            sum / dofs().map(|dof| self.mass[dof]).sum::<f64>()
        })
    }

    /// Angular momentum about the center of mass.
    pub fn spin(&self, u: &[f64], v: &[f64]) -> [f64; 3] {
        let (center, momentum) = (self.center(u), self.linear_momentum(v));
        let (mut x, mut p) = ([0.0; 3], [0.0; 3]);
        x[..D].copy_from_slice(&center);
        p[..D].copy_from_slice(&momentum);
        let (whole, own) = (self.angular(u, v), cross(x, p));
        std::array::from_fn(|k| whole[k] - own[k])
    }

    fn angular(&self, u: &[f64], v: &[f64]) -> [f64; 3] {
        self.moment(u, |dof| self.mass[dof] * v[dof])
    }

    fn rigid(&self, linear: [f64; D], rate: [f64; 3], center: [f64; D]) -> Vec<f64> {
        let velocity = |x: &[f64; D]| -> [f64; D] {
            let mut arm = [0.0; 3];
            arm.iter_mut().zip(x.iter().zip(center)).for_each(|(arm, (x, c))| *arm = x - c);
            let turn = cross(rate, arm);
            std::array::from_fn(|axis| linear[axis] + turn[axis])
        };
        self.nodes.iter().flat_map(velocity).collect()
    }
}

impl Particles<2> {
    /// About the origin.
    pub fn angular_momentum(&self, u: &[f64], v: &[f64]) -> f64 {
        self.angular(u, v)[2]
    }

    /// Velocities of a rigid motion from the reference configuration: `linear` at `center`, turning at `rate`.
    pub fn rigid_velocity(&self, linear: [f64; 2], rate: f64, center: [f64; 2]) -> Vec<f64> {
        self.rigid(linear, [0.0, 0.0, rate], center)
    }
}

impl Particles<3> {
    /// About the origin.
    pub fn angular_momentum(&self, u: &[f64], v: &[f64]) -> [f64; 3] {
        self.angular(u, v)
    }

    /// Velocities of a rigid motion from the reference configuration: `linear` at `center`, turning at `rate`.
    pub fn rigid_velocity(&self, linear: [f64; 3], rate: [f64; 3], center: [f64; 3]) -> Vec<f64> {
        self.rigid(linear, rate, center)
    }
}

/// A pattern of D × D blocks, and where the blocks of each element are in it.
#[derive(Clone, Debug)]
pub(crate) struct Assembly<const D: usize> {
    pub(crate) pattern: SymbolicSparseColMat<usize>,
    corners: usize,
    /// For each element, each of its columns and each of its nodes: the slot of the first of the node's D rows.
    slots: Vec<usize>,
}

impl<const D: usize> Assembly<D> {
    /// Elements of `corners` nodes each, one behind the other.
    pub(crate) fn new(nodes: usize, corners: usize, elements: &[usize]) -> Self {
        let mut neighbors: Vec<BTreeSet<usize>> = (0..nodes).map(|node| BTreeSet::from([node])).collect();
        for element in elements.chunks_exact(corners) {
            element.iter().for_each(|&node| neighbors[node].extend(element));
        }
        let (mut pointers, mut rows) = (vec![0], Vec::new());
        for column in 0..D * nodes {
            rows.extend(neighbors[column / D].iter().flat_map(|node| (0..D).map(move |axis| D * node + axis)));
            pointers.push(rows.len());
        }
        let slot = |row: usize, column: usize| {
            pointers[column] + rows[pointers[column]..pointers[column + 1]].binary_search(&row).unwrap()
        };
        let mut slots = Vec::with_capacity(elements.len() * corners * D);
        for element in elements.chunks_exact(corners) {
            for &b in element {
                for j in 0..D {
                    slots.extend(element.iter().map(|&a| slot(D * a, D * b + j)));
                }
            }
        }
        let pattern = SymbolicSparseColMat::new_checked(D * nodes, D * nodes, pointers, None, rows);
        Self { pattern, corners, slots }
    }

    /// Adds the symmetric matrix of an element, of which `block(a, b)` is read for a ≤ b.
    pub(crate) fn add(&self, element: usize, out: &mut [f64], block: impl Fn(usize, usize) -> [[f64; D]; D]) {
        let corners = self.corners;
        let slots = &self.slots[element * corners * corners * D..][..corners * corners * D];
        for b in 0..corners {
            for a in 0..=b {
                let block = block(a, b);
                for i in 0..D {
                    for j in 0..D {
                        out[slots[(b * D + j) * corners + a] + i] += block[i][j];
                        if a != b {
                            out[slots[(a * D + i) * corners + b] + j] += block[i][j];
                        }
                    }
                }
            }
        }
    }
}
