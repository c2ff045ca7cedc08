//! An elastic body: mass, internal force, tangent and stress of a mesh whose elements are of one or two materials.

use crate::material::Material;
use crate::mesh::{Mesh, Point, cofactors, dot};
use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{Error, LinearSystem, Mass, Result, System, TangentWeights};
use std::collections::BTreeSet;
use std::ops::Range;

type Tensor = [[f64; 3]; 3];

/// What an element is made of, its nodes, and where its integration points and its places in the matrix begin.
#[derive(Clone, Debug)]
struct Part {
    lambda: f64,
    mu: f64,
    corners: [usize; 8],
    count: usize,
    points: Range<usize>,
    places: usize,
}

/// Of Neo-Hookean material, ψ = μ/2 (tr C − 3 − 2 ln J) + λ/2 (ln J)², which is Hooke's at small strains. Dofs are
/// numbered node by node.
#[derive(Clone, Debug)]
pub struct Body {
    parts: Vec<Part>,
    points: Vec<Point>,
    /// Of node b in the columns of node a, by element: how many nodes of the column come before it.
    places: Vec<u32>,
    pattern: SymbolicSparseColMat<usize>,
    mass: Vec<f64>,
    load: Vec<f64>,
    fixed: Vec<usize>,
}

impl Body {
    /// The body of a mesh, element `e` of material `materials(e)`, with a weight of mass times `gravity` along −z and
    /// some nodes held.
    pub fn new(mesh: &Mesh, materials: impl Fn(usize) -> Material, gravity: f64, held: &[usize]) -> Self {
        let mut neighbors = vec![BTreeSet::new(); mesh.nodes.len()];
        for element in &mesh.elements {
            for &a in element.nodes() {
                neighbors[a].extend(element.nodes());
            }
        }
        let neighbors: Vec<Vec<usize>> = neighbors.into_iter().map(|set| set.into_iter().collect()).collect();
        let (mut parts, mut points, mut places) = (Vec::new(), Vec::new(), Vec::new());
        let mut mass = vec![0.0; 3 * mesh.nodes.len()];
        for (index, element) in mesh.elements.iter().enumerate() {
            let [lambda, mu] = materials(index).lame();
            let first = points.len();
            points.extend(mesh.points(element));
            let (count, volume) = (element.nodes().len(), points[first..].iter().map(|p| p.volume).sum::<f64>());
            for &node in element.nodes() {
                for dof in dofs(node) {
                    mass[dof] += materials(index).density * volume / count as f64;
                }
            }
            let part =
                Part { lambda, mu, corners: element.corners, count, points: first..points.len(), places: places.len() };
            for &a in element.nodes() {
                let place = |b: &usize| neighbors[a].binary_search(b).unwrap_or_default() as u32;
                places.extend(element.nodes().iter().map(place));
            }
            parts.push(part);
        }
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for nodes in &neighbors {
            for _ in 0..3 {
                rows.extend(nodes.iter().copied().flat_map(dofs));
                starts.push(rows.len());
            }
        }
        let pattern = SymbolicSparseColMat::new_checked(mass.len(), mass.len(), starts, None, rows);
        let load = mass.iter().enumerate().map(|(dof, m)| if dof % 3 == 2 { -gravity * m } else { 0.0 }).collect();
        let fixed = held.iter().copied().flat_map(dofs).collect();
        Self { parts, points, places, pattern, mass, load, fixed }
    }

    /// Lumped mass, dof by dof (kg).
    pub fn masses(&self) -> &[f64] {
        &self.mass
    }

    /// The linear system of small strains.
    pub fn linearized(mut self) -> Result<LinearSystem<'static, f64>> {
        let mut values = vec![0.0; self.pattern.row_idx().len()];
        let zero = vec![0.0; self.mass.len()];
        self.tangent(0.0, &zero, &zero, TangentWeights::new(1.0, 0.0), &mut values)?;
        let load = self.load;
        let system = LinearSystem::lumped(self.mass, SparseColMat::new(self.pattern, values))?
            .load(move |_, out| out.copy_from_slice(&load));
        self.fixed.into_iter().try_fold(system, LinearSystem::fix)
    }

    /// Von Mises stress (Pa) of each element, the mean over its points: Cauchy's by the law of large strains, or
    /// Hooke's.
    pub fn von_mises(&self, u: &[f64], small_strains: bool) -> Vec<f64> {
        let stress = |part: &Part, point: &Point| {
            let f = part.deformation(point, u);
            let (lambda, mu) = (part.lambda, part.mu);
            if small_strains {
                let strain = |i: usize, j: usize| 0.5 * (f[i][j] + f[j][i]) - identity(i, j);
                let trace: f64 = (0..3).map(|i| strain(i, i)).sum();
                tensor(|i, j| 2.0 * mu * strain(i, j) + lambda * trace * identity(i, j))
            } else {
                let (det, _) = cofactors(&f);
                let left = |i: usize, j: usize| dot(&f[i], &f[j]) - identity(i, j);
                tensor(|i, j| (mu * left(i, j) + lambda * det.ln() * identity(i, j)) / det)
            }
        };
        let mean = |part: &Part| {
            let points = &self.points[part.points.clone()];
            let volume: f64 = points.iter().map(|point| point.volume).sum();
            points.iter().map(|point| point.volume * von_mises(&stress(part, point))).sum::<f64>() / volume
        };
        self.parts.iter().map(mean).collect()
    }

    /// The mean rotation (rad) of the elements `range`, from the curl of u: that of a body which turns as a whole, as
    /// long as it is small.
    pub fn rotation(&self, u: &[f64], range: Range<usize>) -> f64 {
        let (mut volume, mut curl) = (0.0, [0.0; 3]);
        for part in &self.parts[range] {
            for point in &self.points[part.points.clone()] {
                let f = part.deformation(point, u);
                volume += point.volume;
                for (i, sum) in curl.iter_mut().enumerate() {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    *sum += 0.5 * point.volume * (f[k][j] - f[j][k]);
                }
            }
        }
        dot(&curl, &curl).sqrt() / volume
    }
}

pub fn dofs(node: usize) -> [usize; 3] {
    [3 * node, 3 * node + 1, 3 * node + 2]
}

fn tensor(entry: impl Fn(usize, usize) -> f64) -> Tensor {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

fn identity(i: usize, j: usize) -> f64 {
    f64::from(u8::from(i == j))
}

fn von_mises(s: &Tensor) -> f64 {
    let [x, y, z] = [s[0][0] - s[1][1], s[1][1] - s[2][2], s[2][2] - s[0][0]];
    let shear = s[0][1] * s[0][1] + s[1][2] * s[1][2] + s[2][0] * s[2][0];
    (0.5 * (x * x + y * y + z * z) + 3.0 * shear).sqrt()
}

impl Part {
    fn nodes(&self) -> &[usize] {
        &self.corners[..self.count]
    }

    /// Deformation gradient.
    fn deformation(&self, point: &Point, u: &[f64]) -> Tensor {
        let mut f = tensor(identity);
        for (&node, gradient) in self.nodes().iter().zip(&point.gradients) {
            for i in 0..3 {
                for j in 0..3 {
                    f[i][j] += u[3 * node + i] * gradient[j];
                }
            }
        }
        f
    }

    /// Deformation gradient, its determinant and cofactors, if the element is not turned inside out.
    fn admitted(&self, callback: &'static str, point: &Point, u: &[f64]) -> Result<(Tensor, f64, Tensor)> {
        let f = self.deformation(point, u);
        let (det, cofactors) = cofactors(&f);
        if det > 0.0 {
            return Ok((f, det, cofactors));
        }
        let source = format!("the element of the nodes {:?} is squeezed to {det:e} of its volume", self.nodes());
        Err(Error::Inadmissible { callback, source: source.into() })
    }
}

impl System<f64> for Body {
    fn dofs(&self) -> usize {
        self.mass.len()
    }

    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }

    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.load);
        for part in &self.parts {
            for point in &self.points[part.points.clone()] {
                let (f, det, cofactors) = part.admitted("force", point, u)?;
                let factor = (part.lambda * det.ln() - part.mu) / det;
                let stress = tensor(|i, j| point.volume * (part.mu * f[i][j] + factor * cofactors[i][j]));
                for (&node, gradient) in part.nodes().iter().zip(&point.gradients) {
                    for i in 0..3 {
                        out[3 * node + i] -= dot(&stress[i], gradient);
                    }
                }
            }
        }
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }

    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        let starts = self.pattern.col_ptr();
        for part in &self.parts {
            for point in &self.points[part.points.clone()] {
                let (_, det, cofactors) = part.admitted("tangent", point, u)?;
                let g = &point.gradients;
                // Gradients in the current configuration.
                let spatial = g.map(|g| [0, 1, 2].map(|i| dot(&cofactors[i], &g) / det));
                let weight = weights.stiffness * point.volume;
                let shear = part.mu - part.lambda * det.ln();
                for (a, &node) in part.nodes().iter().enumerate() {
                    for b in 0..part.count {
                        let place = 3 * self.places[part.places + part.count * a + b] as usize;
                        let diagonal = part.mu * dot(&g[a], &g[b]);
                        let (sa, sb) = (&spatial[a], &spatial[b]);
                        for j in 0..3 {
                            let column = starts[3 * node + j] + place;
                            for i in 0..3 {
                                let entry =
                                    part.lambda * sb[i] * sa[j] + shear * sa[i] * sb[j] + diagonal * identity(i, j);
                                out[column + i] += weight * entry;
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        let mut energy = 0.0;
        for part in &self.parts {
            for point in &self.points[part.points.clone()] {
                let f = part.deformation(point, u);
                let logarithm = cofactors(&f).0.ln();
                let squares: f64 = f.iter().map(|row| dot(row, row)).sum();
                let shear = 0.5 * part.mu * (squares - 3.0 - 2.0 * logarithm);
                energy += point.volume * (shear + 0.5 * part.lambda * logarithm * logarithm);
            }
        }
        Some(energy)
    }

    fn external_load(&mut self, _: f64, out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.load);
        Ok(())
    }

    fn prescribed(&self) -> &[usize] {
        &self.fixed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Element, Shape};
    use contact_dynamics::verify;

    const MATERIAL: Material = Material { young: 10.0, poisson: 0.3, density: 2.0 };

    /// A crooked hexahedron, with the inner point of a second mesh of tetrahedra to move.
    fn hexahedra() -> Mesh {
        let mut nodes = Vec::new();
        for k in 0..27 {
            let [x, y, z] = [k % 3, k / 3 % 3, k / 9].map(|i| f64::from(i) - 1.0);
            nodes.push([x + 0.1 * y * z, y - 0.08 * x * x, z + 0.12 * x * y]);
        }
        // The middle node off its place: a patch.
        nodes[13] = [0.13, -0.07, 0.11];
        let corner = |e: usize, k: usize| {
            let [i, j, l] =
                [e % 2 + usize::from(matches!(k % 4, 1 | 2)), e / 2 % 2 + usize::from(k % 4 > 1), e / 4 + k / 4];
            i + 3 * j + 9 * l
        };
        let element = |e: usize| Element {
            shape: Shape::Hexahedron,
            corners: std::array::from_fn(|k| corner(e, k)),
            tag: e as u64,
        };
        Mesh { nodes, elements: (0..8).map(element).collect() }
    }

    /// Each hexahedron cut into six tetrahedra around its diagonal from corner 0 to corner 6.
    fn tetrahedra() -> Mesh {
        let Mesh { nodes, elements } = hexahedra();
        let around = [1, 2, 3, 7, 4, 5];
        let cut = |e: &Element| {
            let corners = e.corners;
            (0..6).map(move |k| {
                let four = [corners[0], corners[around[k]], corners[around[(k + 1) % 6]], corners[6]];
                let corners = std::array::from_fn(|i| four.get(i).copied().unwrap_or_default());
                Element { shape: Shape::Tetrahedron, corners, tag: k as u64 }
            })
        };
        Mesh { nodes, elements: elements.iter().flat_map(cut).collect() }
    }

    /// u = H x, plus something that is not linear.
    fn moved(mesh: &Mesh, scatter: f64) -> Vec<f64> {
        let h = [[0.12, -0.05, 0.2], [0.07, -0.1, 0.03], [-0.15, 0.09, 0.06]];
        let move_one =
            |(k, x): (usize, &[f64; 3])| h.map(|row| dot(&row, x) + scatter * (7.3 * k as f64 + row[0]).sin());
        mesh.nodes.iter().enumerate().flat_map(move_one).collect()
    }

    #[test]
    fn meshes_are_sound_and_weigh_what_they_should() {
        for mesh in [hexahedra(), tetrahedra()] {
            mesh.check().unwrap();
            let body = Body::new(&mesh, |_| MATERIAL, 9.81, &[]);
            assert!((body.masses().iter().sum::<f64>() / (3.0 * 2.0 * mesh.volume()) - 1.0).abs() < 1e-14);
            let sum =
                mesh.boundary().iter().map(|f| mesh.area(f)).fold([0.0; 3], |s, a| [0, 1, 2].map(|i| s[i] + a[i]));
            assert!(sum.iter().all(|x| x.abs() < 1e-13), "{sum:?}");
            assert_eq!(mesh.boundary().len(), if mesh.elements.len() == 8 { 24 } else { 48 });
        }
        // By the divergence theorem: a third of the flux of x through the surface. (Of flat facets: quads are not.)
        let flux = |mesh: &Mesh| -> f64 {
            let third = |f: &Vec<usize>| dot(&mesh.area(f), &mesh.nodes[f[0]]) / 3.0;
            mesh.boundary().iter().map(third).sum()
        };
        let mesh = tetrahedra();
        assert!((flux(&mesh) / mesh.volume() - 1.0).abs() < 1e-13);
    }

    #[test]
    fn the_patch_test_is_passed() {
        for mesh in [hexahedra(), tetrahedra()] {
            let mut body = Body::new(&mesh, |_| MATERIAL, 0.0, &[]);
            let u = moved(&mesh, 0.0);
            let mut force = vec![0.0; u.len()];
            body.force(0.0, &u, &u, &mut force).unwrap();
            let largest = force.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            // A homogeneous deformation: no force on the node inside, the same stress in all elements.
            assert!(dofs(13).iter().all(|&dof| force[dof].abs() < 1e-14 * largest), "{:?}", dofs(13).map(|d| force[d]));
            for small in [true, false] {
                let stress = body.von_mises(&u, small);
                assert!(stress.iter().all(|s| (s / stress[0] - 1.0).abs() < 1e-12), "{stress:?}");
            }
        }
    }

    #[test]
    fn tangents_are_derivatives_and_forces_those_of_the_energy() {
        for mesh in [hexahedra(), tetrahedra()] {
            let mut body = Body::new(&mesh, |e| Material { young: 10.0 + e as f64, ..MATERIAL }, 0.7, &[3]);
            let u = moved(&mesh, 0.02);
            let error = verify::tangent(&mut body, 0.0, &u, &vec![0.0; u.len()], 1e-5, 1e-5).unwrap();
            assert!(error.largest() < 1e-7 && error.potential.is_some(), "{error:?}");
        }
    }

    #[test]
    fn simple_shear_and_tension_have_their_closed_forms() {
        let mesh = tetrahedra();
        let body = Body::new(&mesh, |_| MATERIAL, 0.0, &[]);
        let [lambda, mu] = MATERIAL.lame();
        let shear: Vec<f64> = mesh.nodes.iter().flat_map(|x| [0.3 * x[2], 0.0, 0.0]).collect();
        // Cauchy stress of simple shear γ: σ_xx = μ γ², σ_xz = μ γ.
        let large = (0.3_f64.powi(4) + 3.0 * 0.3_f64.powi(2)).sqrt() * mu;
        assert!(body.von_mises(&shear, false).iter().all(|s| (s / large - 1.0).abs() < 1e-12));
        let small = 3.0_f64.sqrt() * mu * 0.3;
        assert!(body.von_mises(&shear, true).iter().all(|s| (s / small - 1.0).abs() < 1e-12));
        // Uniaxial strain: σ_zz − σ_xx = 2 μ ε, whatever λ is.
        let strain: Vec<f64> = mesh.nodes.iter().flat_map(|x| [0.0, 0.0, 1e-3 * x[2]]).collect();
        assert!(lambda > 0.0);
        assert!(body.von_mises(&strain, true).iter().all(|s| (s / (2e-3 * mu) - 1.0).abs() < 1e-10));
    }

    #[test]
    fn rotations_are_measured() {
        let mesh = hexahedra();
        let body = Body::new(&mesh, |_| MATERIAL, 0.0, &[]);
        let mut turned = mesh.clone();
        turned.turn([0.0, 2.0, 0.0]);
        let u: Vec<f64> =
            turned.nodes.iter().zip(&mesh.nodes).flat_map(|(y, x)| [0, 1, 2].map(|i| y[i] - x[i])).collect();
        assert!((body.rotation(&u, 0..8) - 2.0_f64.to_radians().sin()).abs() < 1e-12);
    }

    #[test]
    fn elements_turned_inside_out_are_refused() {
        let mut mesh = tetrahedra();
        mesh.elements[4].corners.swap(0, 1);
        let reason = mesh.check().unwrap_err();
        assert!(reason.contains("element 4, a tetrahedron, is turned inside out"), "{reason}");
        let mut body = Body::new(&tetrahedra(), |_| MATERIAL, 0.0, &[]);
        let u: Vec<f64> = mesh.nodes.iter().flat_map(|x| [-1.5 * x[0], 0.0, 0.0]).collect();
        let error = body.force(0.0, &u, &u, &mut vec![0.0; u.len()]).unwrap_err();
        assert!(error.is_recoverable() && error.to_string().contains("squeezed"), "{error}");
    }
}
