//! Contact of nodes with facets: meshes, and what is asked of them in all files of this folder.
#![cfg(feature = "mesh-contact")]
#![allow(clippy::float_cmp)] // unchanged values are meant exactly

mod following;
mod gaps;
mod lists;
mod rates;

use contact_dynamics::contact::{ContactJacobian, Facet, NodeToFacet, SurfaceSettings};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::Congruential;

/// Nodes with dofs in their order, and facets.
#[derive(Clone, Debug, Default)]
struct Mesh<const D: usize> {
    coordinates: Vec<[f64; D]>,
    facets: Vec<Facet>,
}

impl<const D: usize> Mesh<D> {
    fn dofs(&self) -> Vec<[usize; D]> {
        (0..self.coordinates.len()).map(|node| std::array::from_fn(|i| D * node + i)).collect()
    }

    fn size(&self) -> usize {
        D * self.coordinates.len()
    }

    /// Appends nodes and returns their numbers.
    fn nodes(&mut self, coordinates: impl IntoIterator<Item = [f64; D]>) -> Vec<usize> {
        let start = self.coordinates.len();
        self.coordinates.extend(coordinates);
        (start..self.coordinates.len()).collect()
    }

    fn contact(&self, nodes: &[usize], reach: f64) -> NodeToFacet<f64> {
        let facets = self.facets.iter().copied();
        NodeToFacet::one_pass(&self.coordinates, &self.dofs(), nodes, facets)
            .unwrap()
            .with(SurfaceSettings::new().reach(reach))
            .unwrap()
    }

    /// In two passes.
    fn both(&self, own: impl IntoIterator<Item = Facet>, reach: f64) -> NodeToFacet<f64> {
        let facets = self.facets.iter().copied();
        NodeToFacet::new(&self.coordinates, &self.dofs(), own, facets)
            .unwrap()
            .with(SurfaceSettings::new().reach(reach))
            .unwrap()
    }

    fn positions(&self, u: &[f64]) -> Vec<[f64; D]> {
        let node = |(node, x): (usize, &[f64; D])| std::array::from_fn(|i| x[i] + u[D * node + i]);
        self.coordinates.iter().enumerate().map(node).collect()
    }
}

/// What a grid is made of.
#[derive(Clone, Copy, PartialEq)]
enum Cells {
    Quadrilaterals,
    Triangles,
    Mixed,
}

/// A grid over [0, n]² at the height z(x, y), normals upward.
fn grid(n: usize, cells: Cells, z: impl Fn(f64, f64) -> f64) -> Mesh<3> {
    let mut mesh = Mesh::default();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (i as f64, j as f64);
            mesh.coordinates.push([x, y, z(x, y)]);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            if cells == Cells::Quadrilaterals || (cells == Cells::Mixed && (i + j) % 2 == 0) {
                mesh.facets.push([a, b, c, d].into());
            } else {
                mesh.facets.extend([Facet::from([a, b, c]), [a, c, d].into()]);
            }
        }
    }
    mesh
}

/// The surface of a cube [−1, 1]³ of quadrilaterals with displaced corners: warped and closed.
fn box_of_quadrilaterals(random: &mut Congruential, warp: f64) -> Mesh<3> {
    let mut mesh = Mesh::default();
    mesh.nodes(
        (0..8).map(|k| std::array::from_fn(|i| if k >> i & 1 == 0 { -1.0 } else { 1.0 } + warp * random.signed())),
    );
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    mesh.facets.extend(sides.map(Facet::from));
    mesh
}

/// A regular polygon, counter-clockwise.
fn polygon(corners: usize) -> Mesh<2> {
    let mut mesh = Mesh::default();
    mesh.nodes((0..corners).map(|k| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / corners as f64).sin_cos();
        [cos, sin]
    }));
    mesh.facets.extend((0..corners).map(|k| Facet::from([k, (k + 1) % corners])));
    mesh
}

/// Gaps by identity of the row, after a search.
fn gaps(contact: &mut NodeToFacet<f64>, u: &[f64]) -> Vec<((usize, usize), f64)> {
    contact.search_on(0.0, u, u, 0.0).unwrap();
    let mut gaps = vec![0.0; contact.candidates()];
    contact.gap(0.0, u, &mut gaps);
    (0..gaps.len()).map(|row| contact.identity(row)).zip(gaps).collect()
}

fn rows(contact: &NodeToFacet<f64>) -> ContactJacobian<f64> {
    contact.jacobian()
}

/// The only gap there is, but for those of a dent.
fn single_gap(contact: &mut NodeToFacet<f64>, u: &[f64]) -> Option<f64> {
    let found = gaps(contact, u);
    assert!(found.iter().skip(1).all(|(name, _)| name.1 > 1));
    found.first().map(|&(_, gap)| gap)
}

/// Force of every row, and its moment about the origin, relative to the row's size.
fn imbalance<const D: usize>(contact: &NodeToFacet<f64>, positions: &[[f64; D]]) -> f64 {
    let (g, mut worst) = (rows(contact), 0.0_f64);
    for row in 0..g.rows() {
        let (mut force, mut moment, mut scale) = ([0.0; 3], [0.0; 3], 1.0_f64);
        for (dof, weight) in g.row(row) {
            let x: [f64; 3] = std::array::from_fn(|i| positions[dof / D].get(i).copied().unwrap_or(0.0));
            scale = x.iter().fold(scale, |scale, x| scale.max(x.abs()));
            let (i, mut f) = (dof % D, [0.0; 3]);
            f[i] = weight;
            force[i] += weight;
            for (k, moment) in moment.iter_mut().enumerate() {
                let (l, m) = ((k + 1) % 3, (k + 2) % 3);
                *moment += x[l] * f[m] - x[m] * f[l];
            }
        }
        worst = force.iter().fold(worst, |worst, f| worst.max(f.abs()));
        worst = moment.iter().fold(worst, |worst, m| worst.max(m.abs() / scale));
    }
    worst
}
