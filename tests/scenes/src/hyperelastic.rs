//! Elastic bodies at large strains, total Lagrangian: the elements of [`Solid`] with nonlinear materials.

use crate::particles::{Assembly, Particles};
use crate::solids::Solid;
use contact_dynamics::faer::sparse::SymbolicSparseColMatRef;
use contact_dynamics::{Error, Linearity, Mass, Path, PathForce, Result, System, TangentWeights};

/// A nonlinear material with the Lamé constants λ and μ; both laws are Hooke's at small strains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// W = ½ μ (tr C − 3 − 2 ln J) + ½ λ (ln J)².
    NeoHookean,
    /// W = ½ λ (tr E)² + μ E:E with Green's strain E.
    StVenantKirchhoff,
}

/// A body of quad4 (plane strain) or hex8 elements with lumped mass.
#[derive(Clone, Debug)]
pub struct Hyperelastic<const D: usize> {
    pub particles: Particles<D>,
    law: Law,
    lambda: f64,
    mu: f64,
    /// The corners of the elements, one element behind the other.
    elements: Vec<usize>,
    points: Vec<Point<D>>,
    assembly: Assembly<D>,
}

/// More than the corners of a hex8 are not met; a quad4 leaves half of them unused.
const CORNERS: usize = 8;

type Tensor<const D: usize> = [[f64; D]; D];

/// A Gauss point.
#[derive(Clone, Debug)]
struct Point<const D: usize> {
    /// Derivatives of the shape functions in the reference configuration.
    gradients: [[f64; D]; CORNERS],
    /// Weight times volume.
    volume: f64,
}

/// Deformation at a point.
#[derive(Clone, Copy)]
struct Deformation<const D: usize> {
    /// Deformation gradient F.
    gradient: Tensor<D>,
    /// ∂u/∂X = F − 1: strains are formed from it, without loss of digits where they are small.
    displacement_gradient: Tensor<D>,
}

fn tensor<const D: usize>(entry: impl Fn(usize, usize) -> f64) -> Tensor<D> {
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|i| a[i] * b[i]).sum()
}

fn apply<const D: usize>(a: &Tensor<D>, x: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|i| dot(&a[i], x))
}

/// Determinant and cofactors: ∂ det/∂ a.
fn cofactors<const D: usize>(a: &Tensor<D>) -> (f64, Tensor<D>) {
    let cofactor = |i: usize, j: usize| {
        let (p, q) = ((i + 1) % D, (j + 1) % D);
        if D == 2 {
            return if i == j { a[p][q] } else { -a[p][q] };
        }
        let (r, s) = ((i + 2) % D, (j + 2) % D);
        a[p][q] * a[r][s] - a[p][s] * a[r][q]
    };
    let cofactors = tensor(cofactor);
    (dot(&a[0], &cofactors[0]), cofactors)
}

impl<const D: usize> Point<D> {
    fn deformation(&self, element: &[usize], u: &[f64]) -> Deformation<D> {
        let mut h = [[0.0; D]; D];
        for (&node, gradient) in element.iter().zip(&self.gradients) {
            for i in 0..D {
                for j in 0..D {
                    h[i][j] += u[D * node + i] * gradient[j];
                }
            }
        }
        Deformation { gradient: tensor(|i, j| h[i][j] + f64::from(u8::from(i == j))), displacement_gradient: h }
    }
}

impl<const D: usize> Deformation<D> {
    fn green_strain(&self) -> Tensor<D> {
        let h = &self.displacement_gradient;
        tensor(|i, j| 0.5 * (h[i][j] + h[j][i] + (0..D).map(|k| h[k][i] * h[k][j]).sum::<f64>()))
    }
}

impl<const D: usize> Hyperelastic<D> {
    pub fn new(solid: &Solid<D>, law: Law) -> Self {
        let [lambda, mu] = solid.material.lame();
        let points = solid.elements.iter().flat_map(|element| solid.gauss_points(element));
        let points = points.map(|(_, derivatives, volume)| {
            let mut gradients = [[0.0; D]; CORNERS];
            gradients[..derivatives.len()].copy_from_slice(&derivatives);
            Point { gradients, volume }
        });
        let elements = solid.elements.concat();
        Self {
            particles: Particles::new(solid.nodes.clone(), solid.lumped_mass()),
            law,
            lambda,
            mu,
            points: points.collect(),
            assembly: Assembly::new(solid.nodes.len(), 1 << D, &elements),
            elements,
        }
    }

    /// With other lumped masses.
    #[must_use]
    pub fn masses(mut self, mass: Vec<f64>) -> Self {
        self.particles.mass = mass;
        self
    }

    #[must_use]
    pub fn gravity(mut self, gravity: [f64; D]) -> Self {
        self.particles.weigh(gravity);
        self
    }

    #[must_use]
    pub fn fix(mut self, dofs: Vec<usize>) -> Self {
        self.particles.fix(dofs);
        self
    }

    /// Elements, each with its corners and its Gauss points.
    fn elements(&self) -> impl Iterator<Item = (usize, &[usize], &[Point<D>])> {
        let corners = 1 << D;
        let parts = self.elements.chunks_exact(corners).zip(self.points.chunks_exact(corners));
        parts.enumerate().map(|(index, (element, points))| (index, element, points))
    }

    fn second_stress(&self, strain: &Tensor<D>) -> Tensor<D> {
        let pressure = self.lambda * (0..D).map(|i| strain[i][i]).sum::<f64>();
        tensor(|i, j| 2.0 * self.mu * strain[i][j] + if i == j { pressure } else { 0.0 })
    }

    fn energy_density(&self, deformation: &Deformation<D>) -> f64 {
        let strain = deformation.green_strain();
        let trace: f64 = (0..D).map(|i| strain[i][i]).sum();
        match self.law {
            Law::StVenantKirchhoff => {
                0.5 * self.lambda * trace * trace + self.mu * strain.iter().map(|row| dot(row, row)).sum::<f64>()
            }
            Law::NeoHookean => {
                // tr C − 3 = 2 tr E in the plane too, where F₃₃ = 1.
                let dilatation = cofactors(&deformation.gradient).0.ln();
                self.mu * (trace - dilatation) + 0.5 * self.lambda * dilatation * dilatation
            }
        }
    }

    /// `out −= ∫ P·∇N` of one point with first Piola–Kirchhoff stress P.
    fn subtract(point: &Point<D>, element: &[usize], stress: &Tensor<D>, out: &mut [f64]) {
        for (&node, gradient) in element.iter().zip(&point.gradients) {
            for i in 0..D {
                out[D * node + i] -= point.volume * dot(&stress[i], gradient);
            }
        }
    }

    /// Adds the stiffness of St. Venant–Kirchhoff at a deformation gradient F and a stress S of its own.
    fn add_stiffness(
        &self,
        index: usize,
        point: &Point<D>,
        f: &Tensor<D>,
        s: &Tensor<D>,
        weight: f64,
        out: &mut [f64],
    ) {
        let [lambda, mu, weight] = [self.lambda, self.mu, weight * point.volume];
        let g = &point.gradients;
        let (pushed, stressed) = (g.map(|g| apply(f, &g)), g.map(|g| apply(s, &g)));
        let left: Tensor<D> = tensor(|i, k| dot(&f[i], &f[k]));
        self.assembly.add(index, out, |a, b| {
            let (geometric, shear) = (dot(&g[a], &stressed[b]), mu * dot(&g[a], &g[b]));
            let (pa, pb) = (&pushed[a], &pushed[b]);
            tensor(|i, k| {
                let diagonal = if i == k { geometric } else { 0.0 };
                weight * (lambda * pa[i] * pb[k] + mu * pb[i] * pa[k] + shear * left[i][k] + diagonal)
            })
        });
    }

    /// Determinant and cofactors of a deformation gradient, if the element is not turned inside out.
    fn admitted(callback: &'static str, element: usize, f: &Tensor<D>) -> Result<(f64, Tensor<D>)> {
        let (det, cofactors) = cofactors(f);
        match det > 0.0 {
            true => Ok((det, cofactors)),
            false => {
                Err(Error::Inadmissible { callback, source: format!("element {element}: det F = {det:e}").into() })
            }
        }
    }

    /// Mean deformation gradient and mean stress ½ (S(from) + S(to)).
    fn along(&self, [from, to]: [Deformation<D>; 2]) -> [Tensor<D>; 2] {
        let (before, after) = (from.green_strain(), to.green_strain());
        let stress = self.second_stress(&tensor(|i, j| 0.5 * (before[i][j] + after[i][j])));
        [tensor(|i, j| 0.5 * (from.gradient[i][j] + to.gradient[i][j])), stress]
    }
}

impl<const D: usize> System<f64> for Hyperelastic<D> {
    fn dofs(&self) -> usize {
        self.particles.dofs()
    }

    fn linearity(&self) -> Linearity {
        Linearity::Nonlinear
    }

    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.particles.mass)
    }

    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.particles.load);
        for (index, element, points) in self.elements() {
            for point in points {
                let deformation = point.deformation(element, u);
                let f = &deformation.gradient;
                let (det, cofactors) = Self::admitted("force", index, f)?;
                let stress = match self.law {
                    Law::StVenantKirchhoff => {
                        let s = self.second_stress(&deformation.green_strain());
                        tensor(|i, j| dot(&f[i], &s[j]))
                    }
                    Law::NeoHookean => {
                        let factor = (self.lambda * det.ln() - self.mu) / det;
                        tensor(|i, j| self.mu * f[i][j] + factor * cofactors[i][j])
                    }
                };
                Self::subtract(point, element, &stress, out);
            }
        }
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.assembly.pattern.as_ref()
    }

    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        for (index, element, points) in self.elements() {
            for point in points {
                let deformation = point.deformation(element, u);
                let f = &deformation.gradient;
                let (det, cofactors) = Self::admitted("tangent", index, f)?;
                match self.law {
                    Law::StVenantKirchhoff => {
                        let s = self.second_stress(&deformation.green_strain());
                        self.add_stiffness(index, point, f, &s, weights.stiffness, out);
                    }
                    Law::NeoHookean => {
                        let g = &point.gradients;
                        // Gradients in the current configuration.
                        let spatial = g.map(|g| apply(&cofactors, &g).map(|x| x / det));
                        let [lambda, mu, weight] = [self.lambda, self.mu, weights.stiffness * point.volume];
                        let shear = mu - lambda * det.ln();
                        self.assembly.add(index, out, |a, b| {
                            let diagonal = mu * dot(&g[a], &g[b]);
                            let (sa, sb) = (&spatial[a], &spatial[b]);
                            tensor(|i, k| {
                                let diagonal = if i == k { diagonal } else { 0.0 };
                                weight * (lambda * sa[i] * sb[k] + shear * sb[i] * sa[k] + diagonal)
                            })
                        });
                    }
                }
            }
        }
        Ok(())
    }

    fn path_force(&mut self) -> Option<&mut dyn PathForce<f64>> {
        match self.law == Law::StVenantKirchhoff {
            true => Some(self),
            false => None,
        }
    }

    /// NaN if an element of a Neo-Hookean body is turned inside out.
    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        let element = |(_, element, points): (usize, &[usize], &[Point<D>])| {
            let density = |point: &Point<D>| point.volume * self.energy_density(&point.deformation(element, u));
            points.iter().map(density).sum::<f64>()
        };
        Some(self.elements().map(element).sum())
    }

    fn external_load(&mut self, _: f64, out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.particles.load);
        Ok(())
    }

    fn prescribed(&self) -> &[usize] {
        &self.particles.fixed
    }
}

/// Of St. Venant–Kirchhoff bodies.
impl<const D: usize> PathForce<f64> for Hyperelastic<D> {
    fn force_along(&mut self, _: f64, path: Path<'_, f64>, _: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.particles.load);
        for (index, element, points) in self.elements() {
            for point in points {
                let ends = [path.from, path.to].map(|u| point.deformation(element, u));
                Self::admitted("force_along", index, &ends[1].gradient)?;
                let [f, s] = self.along(ends);
                Self::subtract(point, element, &tensor(|i, j| dot(&f[i], &s[j])), out);
            }
        }
        Ok(())
    }

    fn tangent_along(
        &mut self,
        _: f64,
        path: Path<'_, f64>,
        _: &[f64],
        weights: TangentWeights<f64>,
        out: &mut [f64],
    ) -> Result<()> {
        out.fill(0.0);
        // The exact derivative has F(to) on one side of the material part; F̄ on both makes it symmetric.
        for (index, element, points) in self.elements() {
            for point in points {
                let ends = [path.from, path.to].map(|u| point.deformation(element, u));
                Self::admitted("tangent_along", index, &ends[1].gradient)?;
                let [f, s] = self.along(ends);
                self.add_stiffness(index, point, &f, &s, weights.stiffness, out);
            }
        }
        Ok(())
    }
}
