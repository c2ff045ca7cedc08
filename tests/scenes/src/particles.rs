//! What nonlinear bodies share: nodes with lumped masses and their momenta, and the assembly of element matrices.

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

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use contact_dynamics::faer::sparse::SymbolicSparseColMatRef;
    use contact_dynamics::{Path, System, TangentWeights};

    /// Displacements or velocities without any symmetry, of size `size`.
    pub(crate) fn scattered(count: usize, size: f64, phase: f64) -> Vec<f64> {
        (0..count).map(|k| size * (1.7 * k as f64 * k as f64 + phase).sin()).collect()
    }

    /// A turn of the plane of the first two axes, then of the last two.
    pub(crate) fn turned<const D: usize>(mut x: [f64; D], angles: [f64; 2]) -> [f64; D] {
        for (first, angle) in angles.into_iter().enumerate().take(D - 1) {
            let (s, c) = angle.sin_cos();
            (x[first], x[first + 1]) = (c * x[first] - s * x[first + 1], s * x[first] + c * x[first + 1]);
        }
        x
    }

    pub(crate) fn largest(x: &[f64]) -> f64 {
        x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
    }

    pub(crate) fn force_at(system: &mut dyn System<f64>, u: &[f64]) -> Vec<f64> {
        let mut out = vec![f64::NAN; u.len()];
        system.force(0.0, u, &vec![0.0; u.len()], &mut out).unwrap();
        out
    }

    pub(crate) fn stiffness_at(system: &mut dyn System<f64>, u: &[f64]) -> Vec<f64> {
        let mut out = vec![f64::NAN; system.pattern().row_idx().len()];
        let weights = TangentWeights::new(1.0, 0.0);
        system.tangent(0.0, u, &vec![0.0; u.len()], weights, &mut out).unwrap();
        out
    }

    fn middle(from: &[f64], to: &[f64]) -> Vec<f64> {
        from.iter().zip(to).map(|(a, b)| 0.5 * (a + b)).collect()
    }

    fn force_along(system: &mut dyn System<f64>, from: &[f64], to: &[f64]) -> Vec<f64> {
        let mut out = vec![f64::NAN; from.len()];
        let mean = middle(from, to);
        let own = system.path_force().unwrap();
        own.force_along(0.0, Path::new(from, to, &mean), &vec![0.0; from.len()], &mut out).unwrap();
        out
    }

    /// The tangent along a path is that of a state if both ends are this state, and the part of the difference
    /// quotients that it neglects vanishes with the length of the path.
    pub(crate) fn check_tangent_along(system: &mut dyn System<f64>, from: &[f64], direction: &[f64]) {
        let n = from.len();
        let mut neglected = |length: f64| {
            let to: Vec<f64> = from.iter().zip(direction).map(|(u, d)| u + length * d).collect();
            let mut values = vec![f64::NAN; system.pattern().row_idx().len()];
            let weights = TangentWeights::new(1.0, 0.0);
            let mean = middle(from, &to);
            let path = Path::new(from, &to, &mean);
            system.path_force().unwrap().tangent_along(0.0, path, &vec![0.0; n], weights, &mut values).unwrap();
            assert!(asymmetry(system.pattern(), &values) <= 1e-15 * largest(&values));
            let (mut worst, step) = (0.0_f64, 1e-5);
            for column in 0..n {
                let mut displaced = [to.clone(), to.clone()];
                displaced[0][column] -= step;
                displaced[1][column] += step;
                let [before, after] = displaced.map(|to| force_along(system, from, &to));
                let rows = system.pattern().row_idx_of_col_raw(column).to_vec();
                let start = system.pattern().col_ptr()[column];
                for (row, value) in rows.into_iter().zip(&values[start..]) {
                    worst = worst.max((value - (before[row] - after[row]) / step).abs());
                }
            }
            worst / largest(&values)
        };
        let [still, short, long] = [0.0, 0.01, 0.02].map(&mut neglected);
        assert!(still < 1e-7, "{still:e}");
        assert!((long / short - 2.0).abs() < 0.1 && long > 1e-5, "{short:e} {long:e}");
    }

    pub(crate) fn asymmetry(pattern: SymbolicSparseColMatRef<'_, usize>, values: &[f64]) -> f64 {
        let entry = |row: usize, column: usize| {
            let at = pattern.row_idx_of_col_raw(column).binary_search(&row).unwrap();
            values[pattern.col_ptr()[column] + at]
        };
        let columns = (0..pattern.ncols()).flat_map(|j| pattern.row_idx_of_col_raw(j).iter().map(move |&i| (i, j)));
        columns.fold(0.0, |m: f64, (i, j)| m.max((entry(i, j) - entry(j, i)).abs()))
    }

    /// f_int · (to − from) is the change of the potential; the force has no resultant, and no moment on the mean
    /// configuration. Returns the largest of the three errors, relative.
    pub(crate) fn check_force_along<const D: usize>(
        system: &mut dyn System<f64>,
        particles: &Particles<D>,
        from: &[f64],
        to: &[f64],
    ) -> f64 {
        let force = force_along(system, from, to);
        let work: f64 = force.iter().zip(from.iter().zip(to)).map(|(f, (a, b))| -f * (b - a)).sum();
        let [before, after] = [from, to].map(|u| system.potential_energy(u).unwrap());
        let energy = (work - (after - before)).abs() / before.max(after);
        energy.max(balance(particles, &middle(from, to), &force))
    }

    /// Resultant and moment of forces about the origin at u, relative to the sum of their sizes.
    pub(crate) fn balance<const D: usize>(particles: &Particles<D>, u: &[f64], force: &[f64]) -> f64 {
        let size: f64 = force.iter().map(|f| f.abs()).sum();
        let reach = particles.nodes.iter().flatten().fold(1.0, |m: f64, x| m.max(x.abs()));
        let resultant = (0..D).map(|axis| force[axis..].iter().step_by(D).sum::<f64>().abs() / size);
        let moment = particles.moment(u, |dof| force[dof]).map(|m| m.abs() / (size * reach));
        resultant.chain(moment).fold(0.0, f64::max)
    }

    #[test]
    fn momenta_of_a_rigid_motion() {
        let square = Particles::new(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], vec![0.5; 8]);
        let v = square.rigid_velocity([3.0, 0.0], 2.0, [0.5, 0.5]);
        let [px, py] = square.linear_momentum(&v);
        assert!((px - 6.0).abs() < 1e-14 && py.abs() < 1e-14);
        // Spin 2 · Σ m r² = 2, and the momentum passes the origin at y = 0.5.
        assert!((square.angular_momentum(&[0.0; 8], &v) - (2.0 - 3.0)).abs() < 1e-14);
        assert!((square.kinetic_energy(&v) - (9.0 + 2.0)).abs() < 1e-14);
    }
}
