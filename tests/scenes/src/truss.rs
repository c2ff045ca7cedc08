//! Bars at large rotations: trusses of point masses, the stiff elastic pendulum, a lattice mast.

use crate::particles::{Assembly, Particles};
use contact_dynamics::faer::sparse::SymbolicSparseColMatRef;
use contact_dynamics::{Linearity, Mass, Path, PathForce, Result, System, TangentWeights};

/// Bars with Green's strain E = (l² − L²)/(2 L²) and N = EA E between nodes with masses: V = Σ ½ EA L E².
#[derive(Clone, Debug)]
pub struct Truss<const D: usize> {
    pub particles: Particles<D>,
    bars: Vec<Bar<D>>,
    assembly: Assembly<D>,
}

#[derive(Clone, Copy, Debug)]
struct Bar<const D: usize> {
    ends: [usize; 2],
    /// From end to end without load, X.
    vector: [f64; D],
    /// L.
    length: f64,
    /// EA.
    axial: f64,
}

impl<const D: usize> Bar<D> {
    /// Extension vector w: x = X + w.
    fn extension(&self, u: &[f64]) -> [f64; D] {
        std::array::from_fn(|axis| u[D * self.ends[1] + axis] - u[D * self.ends[0] + axis])
    }

    /// E = (X + ½ w)·w/L², without the difference of two squares.
    fn strain(&self, extension: &[f64; D]) -> f64 {
        let work: f64 = self.vector.iter().zip(extension).map(|(x, w)| (x + 0.5 * w) * w).sum();
        work / (self.length * self.length)
    }

    /// The bar vector of an extension.
    fn stretched(&self, extension: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|axis| self.vector[axis] + extension[axis])
    }

    /// Mean strain and mean bar vector along a path.
    fn along(&self, path: Path<'_, f64>) -> (f64, [f64; D]) {
        let [from, to] = [path.from, path.to].map(|u| self.extension(u));
        let mean = std::array::from_fn(|axis| 0.5 * (from[axis] + to[axis]));
        (0.5 * (self.strain(&from) + self.strain(&to)), self.stretched(&mean))
    }

    /// Subtracts the internal force N/L x of a strain and a bar vector x.
    fn subtract(&self, strain: f64, x: &[f64; D], out: &mut [f64]) {
        for axis in 0..D {
            let force = self.axial * strain / self.length * x[axis];
            out[D * self.ends[0] + axis] += force;
            out[D * self.ends[1] + axis] -= force;
        }
    }
}

impl<const D: usize> Truss<D> {
    /// Bars given by their ends and EA, between nodes; one mass a dof.
    pub fn new(nodes: Vec<[f64; D]>, mass: Vec<f64>, bars: &[([usize; 2], f64)]) -> Self {
        let bar = |&(ends, axial): &([usize; 2], f64)| {
            let vector: [f64; D] = std::array::from_fn(|axis| nodes[ends[1]][axis] - nodes[ends[0]][axis]);
            Bar { ends, vector, length: vector.iter().map(|x| x * x).sum::<f64>().sqrt(), axial }
        };
        let bars: Vec<_> = bars.iter().map(bar).collect();
        let ends: Vec<_> = bars.iter().flat_map(|bar| bar.ends).collect();
        Self { assembly: Assembly::new(nodes.len(), 2, &ends), particles: Particles::new(nodes, mass), bars }
    }

    /// The same truss without load in another place: `map` is a rigid motion.
    #[must_use]
    pub fn placed(mut self, map: impl Fn([f64; D]) -> [f64; D]) -> Self {
        let nodes = &mut self.particles.nodes;
        nodes.iter_mut().for_each(|x| *x = map(*x));
        for bar in &mut self.bars {
            bar.vector = std::array::from_fn(|axis| nodes[bar.ends[1]][axis] - nodes[bar.ends[0]][axis]);
        }
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

    /// l/L of a bar.
    pub fn stretch(&self, bar: usize, u: &[f64]) -> f64 {
        let bar = &self.bars[bar];
        bar.stretched(&bar.extension(u)).iter().map(|x| x * x).sum::<f64>().sqrt() / bar.length
    }

    /// EA of a bar.
    pub fn axial(&self, bar: usize) -> f64 {
        self.bars[bar].axial
    }

    /// N of a bar.
    pub fn normal_force(&self, bar: usize, u: &[f64]) -> f64 {
        let bar = &self.bars[bar];
        bar.axial * bar.strain(&bar.extension(u))
    }

    /// Adds EA/L³ x xᵀ + N/L 1 of each bar, for its strain and vector x.
    fn add_stiffness(&self, weight: f64, out: &mut [f64], state: impl Fn(&Bar<D>) -> (f64, [f64; D])) {
        out.fill(0.0);
        for (index, bar) in self.bars.iter().enumerate() {
            let (strain, x) = state(bar);
            let geometric = weight * bar.axial * strain / bar.length;
            let material = weight * bar.axial / bar.length.powi(3);
            self.assembly.add(index, out, |a, b| {
                let sign = if a == b { 1.0 } else { -1.0 };
                let entry = |i, j| material * x[i] * x[j] + if i == j { geometric } else { 0.0 };
                std::array::from_fn(|i| std::array::from_fn(|j| sign * entry(i, j)))
            });
        }
    }
}

/// Where the mass of [`Truss::pendulum`] is, from an integration with a tolerance of 1e-12.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PendulumReference {
    /// EA.
    pub axial: f64,
    pub t: f64,
    pub place: [f64; 2],
}

impl PendulumReference {
    pub const LENGTH: f64 = 3.0443;
    pub const MASS: f64 = 10.0;
    pub const SPEED: f64 = 7.72;
    /// Kinetic and elastic energy, constant.
    pub const ENERGY: f64 = 297.992;
    /// Angular momentum about the support, constant.
    pub const ANGULAR_MOMENTUM: f64 = 235.019_96;
    /// l/L at t = 10 with EA = 1e4.
    pub const STRETCH: f64 = 1.030_699_1;
    /// EA = 1e4 and 1e7, at ascending times.
    pub const PLACES: [Self; 5] = [
        Self { axial: 1e4, t: 1.0, place: [-2.345_787_43, 1.942_727_61] },
        Self { axial: 1e4, t: 2.0, place: [0.568_152_12, -2.996_846_7] },
        Self { axial: 1e4, t: 10.0, place: [2.514_413, -1.877_031_47] },
        Self { axial: 1e7, t: 1.0, place: [-2.502_589_01, 1.733_525_65] },
        Self { axial: 1e7, t: 10.0, place: [2.967_523_9, 0.679_610_3] },
    ];
}

impl Truss<2> {
    /// The stiff elastic pendulum of Kuhl and Crisfield (1999), without gravity: node 0 is fixed in the origin, node 1
    /// is the mass, at (L, 0). EA = 1e4 is soft, 1e10 stiff.
    pub fn pendulum(axial: f64) -> Self {
        let mass = vec![0.0, 0.0, PendulumReference::MASS, PendulumReference::MASS];
        Self::new(vec![[0.0, 0.0], [PendulumReference::LENGTH, 0.0]], mass, &[([0, 1], axial)]).fix(vec![0, 1])
    }

    /// The initial velocity of [`pendulum`](Self::pendulum), across the bar.
    pub fn pendulum_velocity() -> Vec<f64> {
        vec![0.0, 0.0, 0.0, PendulumReference::SPEED]
    }
}

impl Truss<3> {
    /// A free lattice mast on the plane z = 0: `bays` boxes of the given width and height with crossed diagonals on the
    /// four sides and one diagonal in each section, all bars with the same EA and mass per length. Four nodes a
    /// section, the lowest first.
    pub fn mast(bays: usize, [width, height]: [f64; 2], axial: f64, line_density: f64) -> Self {
        let node = |section: usize, k: usize| 4 * section + k % 4;
        let mut ends = Vec::new();
        for section in 0..=bays {
            ends.extend((0..4).map(|k| [node(section, k), node(section, k + 1)]));
            ends.push([node(section, section), node(section, section + 2)]);
        }
        for section in 0..bays {
            for k in 0..4 {
                ends.push([node(section, k), node(section + 1, k)]);
                ends.push([node(section, k), node(section + 1, k + 1)]);
                ends.push([node(section, k + 1), node(section + 1, k)]);
            }
        }
        let corner = |k: usize| [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]][k].map(|x| width * x);
        let place = |index: usize| {
            let [x, y] = corner(index % 4);
            [x, y, height * (index / 4) as f64]
        };
        let nodes: Vec<_> = (0..4 * (bays + 1)).map(place).collect();
        let bars: Vec<_> = ends.into_iter().map(|ends| (ends, axial)).collect();
        let mut truss = Self::new(nodes, vec![0.0; 12 * (bays + 1)], &bars);
        for bar in &truss.bars {
            for node in bar.ends {
                truss.particles.mass[3 * node..][..3].iter_mut().for_each(|m| *m += 0.5 * line_density * bar.length);
            }
        }
        truss
    }
}

impl<const D: usize> System<f64> for Truss<D> {
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
        for bar in &self.bars {
            let extension = bar.extension(u);
            bar.subtract(bar.strain(&extension), &bar.stretched(&extension), out);
        }
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.assembly.pattern.as_ref()
    }

    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        self.add_stiffness(weights.stiffness, out, |bar| {
            let extension = bar.extension(u);
            (bar.strain(&extension), bar.stretched(&extension))
        });
        Ok(())
    }

    fn path_force(&mut self) -> Option<&mut dyn PathForce<f64>> {
        Some(self)
    }

    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        let energy = |bar: &Bar<D>| 0.5 * bar.axial * bar.length * bar.strain(&bar.extension(u)).powi(2);
        Some(self.bars.iter().map(energy).sum())
    }

    fn external_load(&mut self, _: f64, out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.particles.load);
        Ok(())
    }

    fn prescribed(&self) -> &[usize] {
        &self.particles.fixed
    }
}

impl<const D: usize> PathForce<f64> for Truss<D> {
    fn force_along(&mut self, _: f64, path: Path<'_, f64>, _: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.particles.load);
        for bar in &self.bars {
            let (strain, x) = bar.along(path);
            bar.subtract(strain, &x, out);
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
        // The exact derivative is EA/L³ x̄ x(to)ᵀ + N̄/L 1. What is neglected, EA/L³ x̄ (x(to) − x̄)ᵀ, is nilpotent for
        // a bar that turns without a change of length: x̄ is then normal to x(to) − x̄.
        self.add_stiffness(weights.stiffness, out, |bar| bar.along(path));
        Ok(())
    }
}
