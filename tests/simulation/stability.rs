//! Schemes and steps that cannot work are refused when a simulation is built, with the step that works.

use crate::stiffening::Hardening;
use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::faer::{Mat, Side};
use contact_dynamics::tableau::{A, Rows, U, V, Z};
use contact_dynamics::{
    CdLagrange, CentralDifference, ChungLee, Error, LinearSystem, Linearity, Mass, Newmark, NohBathe, Result,
    Simulation, System, TangentWeights, TimeIntegrator, analysis,
};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::schemes::Tabulated;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::matrix;
use contact_dynamics_scenes::{Bars, schemes};

fn spring(stiffness: f64) -> LinearSystem<'static, f64> {
    let k = matrix(1, [(0, 0, stiffness)]);
    LinearSystem::lumped(vec![1.0], k).unwrap()
}

#[test]
fn schemes_that_do_not_converge_are_refused() {
    // Half the velocity: order 0 in u.
    let slow = || Tabulated::single("slow", Rows { u: U[0] + 0.5 * V[0] + 0.25 * Z, v: V[0] + 0.5 * (A[0] + Z), a: Z });
    let build = |scheme: Tabulated| Simulation::builder(spring(1.0), scheme, 0.01).build().map(drop);
    assert!(matches!(build(slow()), Err(Error::InconsistentScheme { .. })));
    assert!(Simulation::builder(spring(1.0), slow(), 0.01).unchecked_stability().build().is_ok());
    // The explicit two-step formula of order 3 (Dahlquist's example): the root −5 at frequency zero.
    let most = |x: [contact_dynamics::tableau::Row; 4], rate: [contact_dynamics::tableau::Row; 4]| {
        -4.0 * x[0] + 5.0 * x[1] + 4.0 * rate[0] + 2.0 * rate[1]
    };
    let unstable = Tabulated::single("unstable", Rows { u: most(U, V), v: most(V, A), a: Z });
    assert_eq!(analysis::zero_stability(&unstable.tableau()), analysis::ZeroStability::Unstable);
    match build(unstable) {
        Err(Error::UnstableScheme { order, radius, .. }) => {
            assert!(order > 0 && (radius - 5.0).abs() < 1e-3, "{order} {radius}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_scheme_of_the_crate_is_taken() {
    for listed in schemes::all() {
        let h = 0.99 * listed.critical.unwrap_or(1e3) / 10.0;
        assert!(Simulation::builder(spring(100.0), (listed.make)(), h).build().is_ok(), "{}", listed.name());
        if let Some(critical) = listed.critical {
            let h = 1.001 * critical / 10.0;
            match Simulation::builder(spring(100.0), (listed.make)(), h).build() {
                Err(Error::BeyondStability { largest, frequency, .. }) => {
                    assert!((frequency - 10.0).abs() < 1e-12 && (largest * 10.0 / critical - 1.0).abs() < 1e-3);
                }
                other => panic!("{}: {other:?}", listed.name()),
            }
            assert!(Simulation::builder(spring(100.0), (listed.make)(), h).unchecked_stability().build().is_ok());
        }
    }
    // Implicit, but not for every step: the scheme of linear acceleration.
    if let Ok(linear) = Newmark::new(1.0 / 6.0, 0.5) {
        assert!(Simulation::builder(spring(100.0), linear, 0.34).build().is_ok());
        let beyond = Simulation::builder(spring(100.0), linear, 0.36).build();
        assert!(matches!(beyond, Err(Error::BeyondStability { .. })), "{beyond:?}");
    }
}

#[test]
fn bars_may_run_at_courant_one_and_no_further() {
    for n in [3, 20, 100, 1000] {
        let bars = Bars::paper(n);
        let transit = bars.element_size(0) / 100.0;
        let build = |courant: f64| {
            Simulation::builder(bars.system::<f64>(), CdLagrange, courant * transit).velocity(bars.velocities()).build()
        };
        assert!(build(1.0).is_ok() && build(0.5).is_ok());
        match build(1.02) {
            Err(Error::BeyondStability { largest, .. }) => {
                assert!((largest / transit - 1.0).abs() < 2e-3, "{n}: {}", largest / transit);
                let mut run = build(largest / transit).unwrap();
                let before = run.energy().total();
                run.run_until(2000.0 * largest, &mut ()).unwrap();
                assert!(run.energy().total() < 1.1 * before);
            }
            other => panic!("{n}: {other:?}"),
        }
        // As after a build.
        let mut run = build(0.5).unwrap();
        assert!(matches!(run.set_step_size(1.02 * transit), Err(Error::BeyondStability { .. })));
        assert_eq!(run.step_size().to_bits(), (0.5 * transit).to_bits());
        run.set_step_size(transit).unwrap();
        // In f32 too.
        let build =
            |courant: f64| Simulation::builder(bars.system::<f32>(), CentralDifference, courant * transit).build();
        assert!(build(1.0).is_ok() && build(1.02).is_err(), "{n}");
    }
}

/// Bars of light and heavy elements with a consistent mass: light nodes are the fastest, and have little of the mass.
#[test]
fn consistent_masses_are_judged_by_their_lightest_nodes() {
    let mut random = Congruential(3);
    for case in 0..300 {
        let n = 3 + case % 8;
        let (mut m, mut k) = (Mat::<f64>::zeros(n, n), Mat::<f64>::zeros(n, n));
        for i in 1..n {
            let (mass, stiffness) = (10.0_f64.powf(-5.0 * random.unit()), 0.5 + random.unit());
            for (a, b) in [(i - 1, i), (i, i - 1)] {
                m[(a, a)] += mass / 3.0;
                m[(a, b)] += mass / 6.0;
                k[(a, a)] += stiffness;
                k[(a, b)] -= stiffness;
            }
        }
        // The highest eigenvalue of L⁻¹ K L⁻ᵀ with M = L Lᵀ.
        let factor = m.llt(Side::Lower).unwrap();
        let mut y = k.clone();
        factor.L().solve_lower_triangular_in_place(&mut y);
        let mut symmetric = y.transpose().to_owned();
        factor.L().solve_lower_triangular_in_place(&mut symmetric);
        let highest = symmetric.self_adjoint_eigenvalues(Side::Lower).unwrap()[n - 1];
        let limit = 2.0 / highest.sqrt();
        let build = |share: f64| {
            let entries = |a: &Mat<f64>| (0..n * n).map(|e| (e % n, e / n, a[(e % n, e / n)])).collect::<Vec<_>>();
            let system = LinearSystem::<f64>::new(matrix(n, entries(&m)), matrix(n, entries(&k))).unwrap();
            Simulation::builder(system, CdLagrange, share * limit).build()
        };
        assert!(build(0.99).is_ok(), "case {case}");
        for share in [1.01, 1.1, 2.0] {
            assert!(matches!(build(share), Err(Error::BeyondStability { .. })), "case {case}: {share}");
        }
    }
}

/// ω_max of a solid by many power iterations.
fn highest<const D: usize>(solid: &Solid<D>, mass: &[f64]) -> f64 {
    let k = solid.stiffness::<f64>();
    let mut x: Vec<f64> = (0..mass.len()).map(|i| ((7 * i + 3) as f64).sin()).collect();
    let mut square = 0.0;
    for _ in 0..4000 {
        let mut y = vec![0.0; x.len()];
        for (column, &entry) in x.iter().enumerate() {
            for (&row, value) in k.symbolic().row_idx_of_col_raw(column).iter().zip(k.as_ref().val_of_col(column)) {
                y[row] += value * entry / mass[row];
            }
        }
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).zip(mass).map(|((x, y), m)| x * m * y).sum::<f64>();
        square = dot(&x, &y) / dot(&x, &x);
        let size = dot(&y, &y).sqrt();
        x = y.into_iter().map(|y| y / size).collect();
    }
    square.sqrt()
}

fn judge<const D: usize>(solid: &Solid<D>, name: &str) {
    let mass = solid.lumped_mass::<f64>();
    let limit = 2.0 / highest(solid, &mass);
    let build = |h: f64| {
        Simulation::builder(LinearSystem::lumped(mass.clone(), solid.stiffness()).unwrap(), CdLagrange, h).build()
    };
    // Circles alone would refuse from about 0.8 of the limit.
    for share in [0.5, 0.8, 0.9, 0.99, 0.999] {
        assert!(build(share * limit).is_ok(), "{name} {share}");
    }
    for share in [1.01, 1.1, 3.0] {
        match build(share * limit) {
            Err(Error::BeyondStability { largest, .. }) => {
                assert!((largest / limit - 1.0).abs() < 5e-3, "{name} {share}: {}", largest / limit);
                assert!(build(largest).is_ok());
            }
            other => panic!("{name} {share}: {other:?}"),
        }
    }
}

#[test]
fn solids_are_judged_by_their_highest_frequency() {
    let material = Material { young: 50.0, poisson: 0.3, density: 1.0 };
    judge(&Solid::rectangle([1.0, 0.6], [20, 12], material), "rectangle");
    judge(&Solid::block([1.0, 0.6, 0.5], [6, 5, 4], material), "block");
    // A mesh with a layer of thin elements, and a distorted one.
    let graded = Solid::rectangle([1.0, 1.0], [12, 12], material).mapped(|[x, y]: [f64; 2]| [x, y.powi(2)]);
    judge(&graded, "graded");
    judge(&Solid::disc(1.0, 8, material), "disc");
}

/// A chain of springs and unit masses whose force is a loop, without any K.
struct Chain {
    mass: Vec<f64>,
    pattern: SymbolicSparseColMat<usize>,
    frequency: Option<f64>,
    linearity: Linearity,
    evaluations: usize,
}

impl Chain {
    fn new(n: usize, frequency: Option<f64>, linearity: Linearity) -> Self {
        let pattern = SymbolicSparseColMat::new_checked(n, n, vec![0; n + 1], None, Vec::new());
        Self { mass: vec![1.0; n], pattern, frequency, linearity, evaluations: 0 }
    }
}

impl System<f64> for Chain {
    fn dofs(&self) -> usize {
        self.mass.len()
    }
    fn linearity(&self) -> Linearity {
        self.linearity
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        self.evaluations += 1;
        out.fill(0.0);
        for i in 1..u.len() {
            let pull = u[i] - u[i - 1];
            out[i - 1] += pull;
            out[i] -= pull;
        }
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, _: &[f64], _: &[f64], _: TangentWeights<f64>, _: &mut [f64]) -> Result<()> {
        unreachable!("there is none")
    }
    fn highest_frequency(&mut self) -> Option<f64> {
        self.frequency
    }
}

#[test]
fn hosts_without_stiffness_are_judged_by_their_force_or_their_own_number() {
    let n = 200; // ω_max = 2 cos(π/2n), all but 2
    for linearity in [Linearity::Linear, Linearity::Nonlinear] {
        let u: Vec<f64> = (0..n).map(|i| 0.01 * (i as f64).cos()).collect();
        let try_out = |frequency, h: f64| {
            let mut chain = Chain::new(n, frequency, linearity);
            let built = Simulation::builder(&mut chain, CentralDifference, h).displacement(u.clone()).build().map(drop);
            (built, chain.evaluations)
        };
        let start = try_out(Some(2.0), 0.9).1;
        let (built, evaluations) = try_out(None, 0.9);
        assert!(built.is_ok() && evaluations - start <= 20, "{}", evaluations - start);
        let (built, evaluations) = try_out(None, 1.02);
        assert!(matches!(built, Err(Error::BeyondStability { .. })) && evaluations - start <= 45, "{built:?}");
        // Nothing is computed beside the host's own number.
        let (built, evaluations) = try_out(Some(2.0), 1.02);
        assert!(matches!(built, Err(Error::BeyondStability { .. })) && evaluations <= start);
    }
}

/// What a force alone says of the frequency is the same in any unit of length.
#[test]
fn forces_that_are_not_linear_are_asked_near_the_state() {
    let refused = |unit: f64, h: f64| {
        let system = Hardening::new(1, 1.0, unit.powi(-2));
        Simulation::builder(system, CentralDifference, h).displacement(vec![0.01 * unit]).build().is_err()
    };
    for unit in [1.0, 1e-9, 1e9] {
        assert!(!refused(unit, 1.9) && refused(unit, 2.1), "{unit}");
    }
}

#[test]
fn damping_that_lags_lowers_the_limit() {
    let bars = Bars::paper(50);
    let transit = bars.element_size(0) / 100.0;
    let omega = 2.0 / transit;
    for (mass, stiffness) in [(0.0, 0.1 * transit), (0.3 / transit, 0.0), (0.1 / transit, 0.05 * transit)] {
        let xi = 0.5 * (mass / omega + stiffness * omega);
        for scheme in [
            Box::new(ChungLee::new(28.0 / 27.0).unwrap()) as Box<dyn TimeIntegrator>,
            Box::new(NohBathe::new(0.54).unwrap()),
        ] {
            let name = scheme.name();
            let tableau = scheme.tableau();
            let critical =
                analysis::critical_omega(&tableau, xi).unwrap().min(analysis::critical_omega(&tableau, 0.0).unwrap());
            let build = |share: f64| {
                let scheme = Tabulated("own", tableau.clone());
                let system = bars.system::<f64>().rayleigh(mass, stiffness).unwrap();
                Simulation::builder(system, scheme, share * critical / omega).velocity(bars.velocities()).build()
            };
            assert!(build(0.995).is_ok(), "{name} {xi}");
            assert!(matches!(build(1.01), Err(Error::BeyondStability { .. })), "{name} {xi}");
        }
        // Implicit damping leaves it where it is.
        let build = |courant: f64| {
            let system = bars.system::<f64>().rayleigh(mass, stiffness).unwrap();
            Simulation::builder(system, CentralDifference, courant * transit).build()
        };
        assert!(build(1.0).is_ok() && build(1.02).is_err());
    }
}

/// Free masses, and nearly free ones, that damping stops: c h has a limit too, whatever the stiffness.
#[test]
fn damping_has_a_limit_of_its_own() {
    let scheme = NohBathe::new(0.54).unwrap();
    // (With next to no stiffness.)
    let radius = |delta: f64| analysis::spectral_radius(&scheme.tableau(), 1e-6, 0.5e6 * delta);
    let limit = (1..100_000).map(|k| 1e-4 * f64::from(k)).find(|&delta| radius(delta) > 1.0 + 1e-9).unwrap();
    for stiffness in [0.0, 1e-12, 1e-6] {
        let build = |share: f64| {
            let k = matrix(2, [(0, 0, stiffness), (1, 1, 0.0)]);
            let system = LinearSystem::lumped(vec![2.0, 1.0], k).unwrap().rayleigh(0.5, 0.0).unwrap();
            Simulation::builder(system, scheme, share * limit / 0.5).velocity(vec![1.0, -1.0]).build()
        };
        let mut run = build(0.99).unwrap();
        for _ in 0..200 {
            run.step().unwrap();
        }
        assert!(run.state().velocity().iter().all(|v: &f64| v.abs() <= 1.0), "{:?}", run.state().velocity());
        let refused = build(1.01).unwrap_err();
        assert!(
            matches!(refused, Error::BeyondStability { largest, .. } if (largest * 0.5 / limit - 1.0).abs() < 1e-3)
        );
    }
}
