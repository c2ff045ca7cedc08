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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::tests::{
        asymmetry, balance, check_force_along, check_tangent_along, force_at, largest, scattered, stiffness_at, turned,
    };
    use contact_dynamics::faer::sparse::SparseColMatRef;
    use contact_dynamics::{Cholesky, LinearSolver, verify};

    fn mast() -> Truss<3> {
        Truss::mast(4, [0.6, 0.8], 50.0, 0.3)
    }

    /// Turned by large angles and scattered.
    fn deformed(truss: &Truss<3>, angles: [f64; 2], phase: f64) -> Vec<f64> {
        let turned = truss.particles.displaced(|x| turned(x, angles));
        turned.iter().zip(scattered(turned.len(), 0.05, phase)).map(|(u, s)| u + s).collect()
    }

    #[test]
    fn tangents_are_derivatives() {
        let mut truss = mast().gravity([0.1, 0.0, -1.0]).fix((0..12).collect());
        let u = deformed(&truss, [0.8, -1.1], 0.2);
        let error = verify::tangent(&mut truss, 0.0, &u, &vec![1.0; u.len()], 1e-5, 1e-5).unwrap();
        println!("mast: {:e}", error.largest());
        assert!(error.largest() < 1e-8 && error.potential.is_some(), "{error:?}");
        let k = stiffness_at(&mut truss, &u);
        assert!(asymmetry(truss.pattern(), &k) <= 1e-15 * largest(&k));
        let mut pendulum = Truss::pendulum(1e4);
        let error = verify::tangent(&mut pendulum, 0.0, &[0.0, 0.0, -4.0, 2.0], &[0.0; 4], 1e-5, 1e-5).unwrap();
        println!("pendulum: {:e}", error.largest());
        assert!(error.largest() < 1e-8, "{error:?}");
    }

    #[test]
    fn a_turned_truss_feels_turned_forces() {
        let mut truss = mast();
        let angles = [1.2, 2.5];
        let rigid = truss.particles.displaced(|x| turned(x, angles));
        let stiffness = largest(&stiffness_at(&mut truss, &rigid));
        assert!(largest(&force_at(&mut truss, &rigid)) < 1e-14 * stiffness);
        assert!(truss.potential_energy(&rigid).unwrap() < 1e-26 * stiffness);

        let u = deformed(&truss, [0.0; 2], 0.7);
        let bent = force_at(&mut truss, &u);
        let nodes = truss.particles.nodes.iter().zip(u.chunks_exact(3));
        let places = nodes.map(|(x, u)| (*x, turned([x[0] + u[0], x[1] + u[1], x[2] + u[2]], angles)));
        let turned_u: Vec<f64> = places.flat_map(|(x, y)| [y[0] - x[0], y[1] - x[1], y[2] - x[2]]).collect();
        let force = force_at(&mut truss, &turned_u);
        let expected: Vec<f64> = bent.chunks_exact(3).flat_map(|f| turned([f[0], f[1], f[2]], angles)).collect();
        let difference: Vec<f64> = force.iter().zip(&expected).map(|(a, b)| a - b).collect();
        assert!(largest(&difference) < 1e-14 * stiffness, "{:e}", largest(&difference));
        assert!(balance(&truss.particles, &turned_u, &force) < 1e-14);
        let [before, after] = [&u, &turned_u].map(|u| truss.potential_energy(u).unwrap());
        assert!((after / before - 1.0).abs() < 1e-12 && truss.normal_force(0, &u) != 0.0);
    }

    #[test]
    fn mean_forces_conserve_energy_and_momenta() {
        let mut truss = mast();
        let [from, to] = [deformed(&truss, [0.8, -1.1], 0.2), deformed(&truss, [1.7, -0.2], 1.9)];
        let particles = truss.particles.clone();
        let error = check_force_along(&mut truss, &particles, &from, &to);
        println!("along a path: {error:e}");
        assert!(error < 1e-13, "{error:e}");
        check_tangent_along(&mut truss, &from, &scattered(from.len(), 1.0, 0.4));
    }

    #[test]
    fn a_mast_stands_on_its_base() {
        let mut truss = mast();
        let u = vec![0.0; truss.dofs()];
        let mut k = stiffness_at(&mut truss, &u);
        let pattern = truss.pattern();
        for dof in 0..12 {
            let at = pattern.row_idx_of_col_raw(dof).binary_search(&dof).unwrap();
            k[pattern.col_ptr()[dof] + at] += 50.0;
        }
        let mut factor = LinearSolver::<f64>::analyze(&Cholesky::default(), pattern, &[]).unwrap();
        factor.factorize(SparseColMatRef::new(pattern, &k)).unwrap();
        let mut tip = u;
        tip[12 * 4] = 1.0;
        factor.solve(&mut tip).unwrap();
        // A pull sideways bends it: more than one bar's flexibility L/EA, and finite.
        assert!((0.016..10.0).contains(&tip[12 * 4]), "{}", tip[12 * 4]);
        let length: f64 = truss.bars.iter().map(|bar| bar.length).sum();
        assert!((truss.particles.mass.iter().sum::<f64>() - 3.0 * 0.3 * length).abs() < 1e-12);
    }

    /// Places of the pendulum's mass at 1, 2 and 10 by the classical Runge–Kutta method, and the last u and v.
    fn integrated(pendulum: &mut Truss<2>, h: f64) -> (Vec<PendulumReference>, [Vec<f64>; 2]) {
        let axial = pendulum.bars[0].axial;
        let mut rates = |y: [f64; 4]| {
            let mut force = [0.0; 4];
            pendulum.force(0.0, &[0.0, 0.0, y[0], y[1]], &[0.0; 4], &mut force).unwrap();
            [y[2], y[3], force[2] / PendulumReference::MASS, force[3] / PendulumReference::MASS]
        };
        let mut y = [0.0, 0.0, 0.0, PendulumReference::SPEED];
        let mut places = Vec::new();
        let steps = (1.0 / h).round() as usize;
        for step in 1..=10 * steps {
            let add = |x: [f64; 4], c: f64, k: [f64; 4]| std::array::from_fn(|i| x[i] + c * k[i]);
            let k1 = rates(y);
            let k2 = rates(add(y, 0.5 * h, k1));
            let k3 = rates(add(y, 0.5 * h, k2));
            let k4 = rates(add(y, h, k3));
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
            if [1, 2, 10].contains(&(step / steps)) && step % steps == 0 {
                let place = [PendulumReference::LENGTH + y[0], y[1]];
                places.push(PendulumReference { axial, t: (step / steps) as f64, place });
            }
        }
        (places, [vec![0.0, 0.0, y[0], y[1]], vec![0.0, 0.0, y[2], y[3]]])
    }

    #[test]
    fn the_pendulum_meets_its_reference() {
        for (axial, h) in [(1e4, 1e-4), (1e7, 2e-5)] {
            let mut pendulum = Truss::pendulum(axial);
            let (places, [u, v]) = integrated(&mut pendulum, h);
            for reference in PendulumReference::PLACES.iter().filter(|reference| reference.axial == axial) {
                let PendulumReference { place, .. } = places.iter().find(|place| place.t == reference.t).unwrap();
                for (x, expected) in place.iter().zip(reference.place) {
                    println!("{axial:e} {}: {:e}", reference.t, x - expected);
                    assert!((x - expected).abs() < 1e-7, "{reference:?} {place:?}");
                }
            }
            let energy = pendulum.particles.kinetic_energy(&v) + pendulum.potential_energy(&u).unwrap();
            assert!((energy / PendulumReference::ENERGY - 1.0).abs() < 1e-8, "{energy}");
            let momentum = pendulum.particles.angular_momentum(&u, &v);
            assert!((momentum / PendulumReference::ANGULAR_MOMENTUM - 1.0).abs() < 1e-9, "{momentum}");
            if axial == 1e4 {
                assert!((pendulum.stretch(0, &u) - PendulumReference::STRETCH).abs() < 1e-7);
            }
        }
        let start = Truss::pendulum_velocity();
        let pendulum = Truss::pendulum(1.0);
        assert!((pendulum.particles.kinetic_energy(&start) / PendulumReference::ENERGY - 1.0).abs() < 1e-14);
        let momentum = pendulum.particles.angular_momentum(&[0.0; 4], &start);
        assert!((momentum / PendulumReference::ANGULAR_MOMENTUM - 1.0).abs() < 1e-14);
    }
}
