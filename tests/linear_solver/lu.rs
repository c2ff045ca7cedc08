//! Matrices that are not symmetric: sparse LU by itself, and runs with gyroscopic, circulatory and follower forces, in
//! contact and away from it.
#![allow(clippy::float_cmp)] // exact zeros and small integers are meant exactly
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // small random numbers

use contact_dynamics::contact_solver::{
    ActiveSet, AdmissibleSet, ContactFailure, ContactProblem, ContactSolver, GaussSeidel, Pivoting,
};
use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{
    Bathe, Cholesky, Composite, EnergyMomentum, Error, Factorization, LinearRows, LinearSolver, LinearSystem, Lu, Mass,
    Newmark, Newton, Path, PathForce, PersistencyCorrection, Real, Result, Simulation, System, TangentWeights,
    TimeIntegrator, verify,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::large::MATERIAL;
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::solids::Solid;
use contact_dynamics_scenes::sparse::{factorized, matrix, rectangular};
use contact_dynamics_scenes::truss::{PendulumReference, Truss};

/// Dense row-major matrices, for references.
type Dense = Vec<Vec<f64>>;

fn dense(n: usize, entries: &[(usize, usize, f64)]) -> Dense {
    let mut a = vec![vec![0.0; n]; n];
    for &(i, j, x) in entries {
        a[i][j] += x;
    }
    a
}

fn times(a: &Dense, x: &[f64]) -> Vec<f64> {
    a.iter().map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
}

/// Gaussian elimination with complete pivoting of rows.
fn solved(mut a: Dense, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            let pivots = a[k].clone();
            for (x, pivot) in a[i].iter_mut().zip(pivots) {
                *x -= factor * pivot;
            }
            b[i] -= factor * b[k];
        }
    }
    for i in (0..n).rev() {
        b[i] = (b[i] - (i + 1..n).map(|j| a[i][j] * b[j]).sum::<f64>()) / a[i][i];
    }
    b
}

fn largest(x: impl IntoIterator<Item = f64>) -> f64 {
    x.into_iter().fold(0.0, |m, x| if x.is_nan() { x } else { m.max(x.abs()) })
}

fn apart(x: &[f64], y: &[f64]) -> f64 {
    largest(x.iter().zip(y).map(|(x, y)| x - y))
}

type Entries = Vec<(usize, usize, f64)>;

type Make = fn() -> Box<dyn TimeIntegrator>;

/// About `per_column` entries a column at random places, and a diagonal that is strong, weak or missing.
fn strewn(n: usize, per_column: usize, diagonal: f64, random: &mut Congruential) -> Entries {
    let mut entries = Vec::new();
    for column in 0..n {
        for _ in 0..per_column {
            let row = ((0.5 + 0.5 * random.signed()) * n as f64) as usize;
            entries.push((row, column, random.signed()));
        }
        if diagonal != 0.0 {
            entries.push((column, column, diagonal));
        }
        // A cycle: regular whatever the diagonal.
        entries.push(((column + 1) % n, column, 3.0));
    }
    entries
}

/// Eight neighbors on a square, with flow across it: unsymmetric values in a symmetric pattern, much fill.
fn flow(side: usize, random: &mut Congruential) -> Entries {
    let mut entries = Vec::new();
    let at = |x: usize, y: usize| x + side * y;
    for y in 0..side {
        for x in 0..side {
            entries.push((at(x, y), at(x, y), 8.0));
            for (nx, ny) in [(x + 1, y), (x, y + 1), (x + 1, y + 1)] {
                if nx < side && ny < side {
                    entries.push((at(x, y), at(nx, ny), -1.0 + 0.9 * random.signed()));
                    entries.push((at(nx, ny), at(x, y), -1.0 + 0.9 * random.signed()));
                }
            }
        }
    }
    entries
}

fn check<T: Real>(
    name: &str,
    n: usize,
    entries: &Entries,
    tolerance: f64,
    factor: &mut Option<Box<dyn Factorization<T>>>,
) {
    let a = matrix::<T>(n, entries.iter().copied());
    let factor = factor.get_or_insert_with(|| Lu.analyze(a.symbolic(), &[]).unwrap());
    factor.factorize(a.as_ref()).unwrap();
    assert!(factor.stored_values() >= n);
    let x: Vec<f64> = (0..3 * n).map(|i| (0.7 * i as f64).sin()).collect();
    for columns in [1, 3] {
        let x = &x[..columns * n];
        let dense = dense(n, entries);
        let mut b: Vec<T> = x.chunks(n).flat_map(|x| times(&dense, x)).map(T::of).collect();
        factor.solve(&mut b).unwrap();
        let b: Vec<f64> = b.into_iter().map(Real::value).collect();
        assert!(apart(&b, x) < tolerance, "{name}, {n} dofs, {columns} columns: {:e}", apart(&b, x));
        // The reference knows no better.
        if n <= 60 && columns == 1 {
            assert!(apart(&solved(dense.clone(), times(&dense, x)), x) < tolerance, "{name}, {n}");
        }
    }
}

#[test]
fn solutions_are_right_whatever_the_structure() {
    let mut random = Congruential(3);
    for n in [1, 2, 3, 10, 57, 300] {
        for (per_column, diagonal) in [(0, 5.0), (2, 9.0), (3, 1e-9), (3, 0.0), (n.min(60), 20.0)] {
            if n > 1 || diagonal > 1.0 {
                let entries = strewn(n, per_column, diagonal, &mut random);
                check::<f64>("strewn", n, &entries, 1e-8, &mut None);
                // Single precision where the matrix is well conditioned.
                if diagonal >= 5.0 {
                    check::<f32>("strewn", n, &entries, 1e-2, &mut None);
                }
            }
        }
    }
    let (mut factor, mut single) = (None, None);
    for _ in 0..3 {
        // One analysis for several values, in blocks.
        let entries = flow(40, &mut random);
        check::<f64>("flow", 1600, &entries, 1e-11, &mut factor);
        check::<f32>("flow", 1600, &entries, 1e-2, &mut single);
    }
    let full: Entries = (0..200 * 200).map(|k| (k % 200, k / 200, random.signed())).collect();
    check::<f64>("full", 200, &full, 1e-8, &mut None);
}

#[test]
fn zero_diagonals_are_pivoted_around() {
    check::<f64>("exchange", 2, &vec![(0, 1, 2.0), (1, 0, 3.0)], 1e-15, &mut None);
    check::<f64>("stored zeros", 2, &vec![(0, 0, 0.0), (0, 1, 2.0), (1, 0, 3.0), (1, 1, 0.0)], 1e-15, &mut None);
    // A chain with ties by multipliers: zero blocks on the diagonal, one of a stiff spring and one of a soft one.
    let n = 40;
    let mut entries: Entries = (0..n).map(|i| (i, i, 2.0)).collect();
    entries.extend((1..n).flat_map(|i| [(i, i - 1, -1.0), (i - 1, i, -1.0)]));
    for tie in 0..10 {
        let (row, dof) = (n + tie, 4 * tie);
        entries.extend([(row, dof, 1.0), (dof, row, 1.0), (row, dof + 1, -1.0), (dof + 1, row, -1.0), (row, row, 0.0)]);
    }
    check::<f64>("ties", n + 10, &entries, 1e-12, &mut None);
    check::<f32>("ties", n + 10, &entries, 1e-3, &mut None);
    // Cholesky cannot.
    let a = matrix::<f64>(n + 10, entries.iter().copied());
    let mut cholesky = Cholesky::default().analyze(a.symbolic(), &[]).unwrap();
    assert!(matches!(cholesky.factorize(a.as_ref()), Err(Error::Singular { .. })));
}

#[test]
fn units_do_not_matter() {
    let mut random = Congruential(8);
    for n in [30, 200] {
        let entries = strewn(n, 4, 6.0, &mut random);
        // Units of dofs, as of translations and rotations, and beside them equations multiplied by anything.
        for equations in [1.0, 10.0] {
            let mut power = || 10_f64.powi((random.signed() * 12.0) as i32);
            let columns: Vec<f64> = (0..n).map(|_| power()).collect();
            let rows: Vec<f64> =
                columns.iter().map(|unit| if equations > 1.0 { unit * power().sqrt() } else { *unit }).collect();
            let scaled: Entries = entries.iter().map(|&(i, j, x)| (i, j, rows[i] * x * columns[j])).collect();
            let x: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).cos()).collect();
            let mut b: Vec<f64> = times(&dense(n, &entries), &x).iter().zip(&rows).map(|(b, r)| b * r).collect();
            let a = matrix::<f64>(n, scaled.iter().copied());
            let mut factor = Lu.analyze(a.symbolic(), &[]).unwrap();
            factor.factorize(a.as_ref()).unwrap();
            factor.solve(&mut b).unwrap();
            let given: Vec<f64> = b.iter().zip(&columns).map(|(b, c)| b * c).collect();
            assert!(apart(&given, &x) < 1e-9, "{:e}", apart(&given, &x));
        }
    }
}

#[test]
fn the_unit_of_a_matrix_changes_no_bit_of_a_solution() {
    let mut random = Congruential(9);
    for n in [4, 60] {
        let entries = strewn(n, 3, 3.0, &mut random);
        let b = random.vector(n, 1.0);
        let solution = |exponent: i32| -> Vec<f64> {
            let unit = 2.0_f64.powi(exponent);
            let a = matrix::<f64>(n, entries.iter().map(|&(i, j, x)| (i, j, unit * x)));
            let mut factor = Lu.analyze(a.symbolic(), &[]).unwrap();
            factor.factorize(a.as_ref()).unwrap();
            let mut x = b.clone();
            factor.solve(&mut x).unwrap();
            x.iter().map(|x| x * unit).collect()
        };
        let natural = solution(0);
        for exponent in [1, -1, 20, -33, 300] {
            assert_eq!(solution(exponent), natural, "2^{exponent}");
        }
    }
    // Subnormal numbers have no reciprocal.
    let least = 2.0_f64.powi(-1060);
    let mut factor = factorized(&Lu, &matrix(1, [(0, 0, least)]));
    let mut x = [3.0 * least];
    factor.solve(&mut x).unwrap();
    assert_eq!(x, [3.0]);
}

fn chain(n: usize, stiffness: impl Fn(usize) -> f64) -> Entries {
    let spring = |i: usize| {
        let k = stiffness(i);
        [(i, i, k), (i + 1, i + 1, k), (i, i + 1, -k), (i + 1, i, -k)]
    };
    (0..n - 1).flat_map(spring).collect()
}

/// The dof at which the factorization of a matrix fails.
fn singular_at<T: Real>(n: usize, entries: &Entries) -> usize {
    let a = matrix::<T>(n, entries.iter().copied());
    let mut factor = Lu.analyze(a.symbolic(), &[]).unwrap();
    let failure = factor.factorize(a.as_ref());
    let Err(Error::Singular { dof, .. }) = failure else { panic!("{n}: {failure:?}") };
    // What is not factorized does not solve.
    let mut x = vec![T::one(); n];
    assert!(matches!(factor.solve(&mut x), Err(Error::Incompatible { .. })));
    assert!(x.iter().all(|x| *x == T::one()));
    dof
}

#[test]
fn singular_matrices_name_what_moves() {
    for stiffness in [|_: usize| 1.0, |i: usize| 1.0 + 0.37 * i as f64, |i: usize| 10_f64.powi(i as i32 % 7 - 3)] {
        for n in [2, 5, 60] {
            // A free chain beside one that is held: the free one moves.
            let mut entries: Entries = chain(n, stiffness);
            let held = chain(10, stiffness).into_iter().chain([(0, 0, 1.0), (4, 4, 1e-3)]);
            entries.extend(held.map(|(i, j, x)| (n + i, n + j, x)));
            assert!(singular_at::<f64>(n + 10, &entries) < n);
            // (In single precision the held one must be better conditioned.)
            if stiffness(3) < 1e3 && stiffness(0) == 1.0 {
                assert!(singular_at::<f32>(n + 10, &entries) < n);
            }
            let behind: Entries =
                entries.iter().map(|&(i, j, x)| ((i + 10) % (n + 10), (j + 10) % (n + 10), x)).collect();
            assert!(singular_at::<f64>(n + 10, &behind) >= 10);
        }
    }
    // In blocks: a plate without support (rows sum to zero), whichever numbers.
    let mut random = Congruential(5);
    for exact in [true, false] {
        let mut plate = flow(30, &mut random);
        for entry in &mut plate {
            entry.2 = if exact { -1.0 } else { -1.0 + 0.5 * random.signed() };
        }
        plate.retain(|&(i, j, _)| i != j);
        let mut sums = vec![0.0; 900];
        for &(i, _, x) in &plate {
            sums[i] -= x;
        }
        plate.extend(sums.into_iter().enumerate().map(|(i, sum)| (i, i, sum)));
        assert!(singular_at::<f64>(900, &plate) < 900);
        assert!(singular_at::<f32>(900, &plate) < 900);
        // One spring to the ground, soft but not lost in rounding, is enough.
        plate.push((450, 450, 1e-3));
        let a = matrix::<f64>(900, plate.iter().copied());
        Lu.analyze(a.symbolic(), &[]).unwrap().factorize(a.as_ref()).unwrap();
    }
    // Two columns that are the same, in integers: an exact zero is met, and one of the two is named.
    let twice: Entries = chain(12, |_| 1.0).into_iter().chain([(0, 0, 1.0)]).filter(|&(_, j, _)| j != 9).collect();
    let copy: Entries = twice.iter().filter(|&&(_, j, _)| j == 3).map(|&(i, _, x)| (i, 9, x)).collect();
    let dof = singular_at::<f64>(12, &[twice, copy].concat());
    assert!(dof == 3 || dof == 9, "{dof}");
    // Structure alone: an empty row, an empty column, two columns for one row.
    assert_eq!(singular_at::<f64>(3, &vec![(0, 0, 1.0), (2, 2, 1.0), (2, 1, 1.0)]), 1);
    assert_eq!(singular_at::<f64>(3, &vec![(0, 0, 1.0), (2, 2, 1.0), (1, 2, 1.0)]), 1);
    assert!(singular_at::<f64>(3, &vec![(0, 0, 1.0), (1, 0, 1.0), (2, 0, 1.0), (0, 1, 1.0), (0, 2, 1.0)]) > 0);
    assert_eq!(singular_at::<f64>(2, &vec![(0, 0, 1.0), (1, 1, 0.0)]), 1);
    // A stiff body beside a soft one is no reason to refuse either.
    let mut entries = chain(20, |_| 1e15);
    entries.push((0, 0, 1e15));
    entries.extend(chain(20, |_| 1e-15).into_iter().chain([(3, 3, 1e-15)]).map(|(i, j, x)| (20 + i, 20 + j, x)));
    check::<f64>("stiff beside soft", 40, &entries, 1e-10, &mut None);
}

#[test]
fn what_does_not_fit_is_refused_and_does_not_spoil_the_analysis() {
    let good = matrix::<f64>(3, [(0, 0, 2.0), (0, 1, 1.0), (1, 0, -1.0), (1, 1, 2.0), (2, 2, 1.0)]);
    let mut factor = Lu.analyze(good.symbolic(), &[]).unwrap();
    let mut early = [1.0_f64; 3];
    assert!(matches!(factor.solve(&mut early), Err(Error::Incompatible { .. })));
    assert_eq!(early, [1.0; 3]);
    for bad in [f64::NAN, f64::INFINITY] {
        let broken = matrix::<f64>(3, [(0, 0, 2.0), (0, 1, bad), (1, 0, -1.0), (1, 1, 2.0), (2, 2, 1.0)]);
        let found = factor.factorize(broken.as_ref());
        assert!(matches!(found, Err(Error::MatrixNotFinite { row: 0, column: 1, .. })), "{found:?}");
    }
    let small = matrix::<f64>(2, [(0, 0, 2.0), (1, 1, 2.0)]);
    assert!(matches!(factor.factorize(small.as_ref()), Err(Error::Dimension { expected: 3, found: 2, .. })));
    let other = matrix::<f64>(3, [(0, 0, 2.0), (0, 1, 1.0), (2, 0, -1.0), (1, 1, 2.0), (2, 2, 1.0)]);
    assert!(matches!(factor.factorize(other.as_ref()), Err(Error::Incompatible { .. })));
    let wide = rectangular::<f64>(2, 3, [(0, 0, 1.0)]);
    let analyzed: Result<Box<dyn Factorization<f64>>> = Lu.analyze(wide.symbolic(), &[]);
    assert!(matches!(analyzed, Err(Error::Dimension { .. })));
    let empty = matrix::<f64>(0, []);
    let mut none = Lu.analyze(empty.symbolic(), &[]).unwrap();
    none.factorize(empty.as_ref()).unwrap();
    none.solve(&mut []).unwrap();

    factor.factorize(good.as_ref()).unwrap();
    let mut x = [4.0, 1.0, 3.0];
    factor.solve(&mut x).unwrap();
    assert!(apart(&x, &[1.4, 1.2, 3.0]) < 1e-15, "{x:?}");
    factor.solve(&mut []).unwrap();
    assert!(factor.condensation().is_none());
}

/// The whirling disc of the example on `Lu`: circular orbits with ω² − g ω = k.
fn rotor(g: f64, k: f64) -> LinearSystem<'static, f64> {
    let stiffness = matrix(2, [(0, 0, 2.0 * k), (1, 1, 2.0 * k)]);
    let gyroscopic = matrix(2, [(0, 1, 2.0 * g), (1, 0, -2.0 * g)]);
    LinearSystem::lumped(vec![2.0; 2], stiffness).unwrap().damping(gyroscopic).unwrap()
}

#[test]
fn a_rotor_whirls_with_both_of_its_frequencies() {
    let schemes: [(Make, bool); 4] = [
        (|| Box::new(Newmark::trapezoidal()), true),
        (|| Box::new(Bathe::default()), false),
        (|| Box::new(Composite), false),
        (|| Box::new(EnergyMomentum), true),
    ];
    let (g, k) = (15.0, 100.0);
    for (make, conserves) in schemes {
        // Forward and backward.
        for omega in [20.0, -5.0] {
            assert_eq!(omega * omega - g * omega, k);
            let end: f64 = 2.0;
            let errors = [200.0, 400.0].map(|steps| {
                let mut run = Simulation::builder(rotor(g, k), make(), end / steps)
                    .linear_solver(Lu)
                    .displacement(vec![1.0, 0.0])
                    .velocity(vec![0.0, omega])
                    .energy_balance()
                    .build()
                    .unwrap();
                let start = run.energy().total();
                run.run_until(end, &mut ()).unwrap();
                let energy = run.energy();
                let works = energy.works.unwrap();
                // Gyroscopic forces do no work.
                assert!(works.damping.abs() < 1e-12 * start, "{}: {works:?}", make().name());
                if conserves {
                    assert!((energy.total() / start - 1.0).abs() < 1e-11, "{}: {energy:?}", make().name());
                    assert!(works.remainder.abs() < 1e-11 * start);
                }
                let place = [(omega * end).cos(), (omega * end).sin()];
                apart(run.state().displacement(), &place)
            });
            let order = (errors[0] / errors[1]).log2();
            assert!((order - 2.0).abs() < 0.15, "{}, {omega}: {errors:?}", make().name());
            assert!(errors[1] < 0.3, "{errors:?}");
        }
    }
}

#[test]
fn circulatory_forces_feed_a_flutter() {
    // w = x + i y: ẅ = −(k − i q) w, one root of which grows. (Dry friction of bearings, follower loads on columns.)
    let (k, q) = (4.0_f64, 0.6_f64);
    let size = k.hypot(q).sqrt();
    // λ = ± i √(k − i q).
    let angle = -0.5 * q.atan2(k);
    let (re, im) = (-size * angle.sin(), size * angle.cos());
    assert!(re > 0.1);
    let end = 6.0;
    let errors = [300.0, 600.0].map(|steps| {
        let stiffness = matrix(2, [(0, 0, k), (0, 1, q), (1, 0, -q), (1, 1, k)]);
        let system = LinearSystem::lumped(vec![1.0; 2], stiffness).unwrap();
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), end / steps)
            .linear_solver(Lu)
            .displacement(vec![1.0, 0.0])
            .velocity(vec![re, im])
            .energy_balance()
            .build()
            .unwrap();
        run.run_until(end, &mut ()).unwrap();
        // No potential, and the energy is not taken for the scheme's: it is all in the remainder, as documented.
        let energy = run.energy();
        let works = energy.works.unwrap();
        assert!(energy.potential.is_none() && works.load == 0.0 && works.damping == 0.0);
        let growth = (re * end).exp();
        let place = [growth * (im * end).cos(), growth * (im * end).sin()];
        apart(run.state().displacement(), &place) / growth
    });
    let order = (errors[0] / errors[1]).log2();
    assert!((order - 2.0).abs() < 0.1 && errors[1] < 1e-3, "{errors:?}");
}

#[test]
fn verification_of_a_tangent_tells_asymmetry_from_error() {
    let stiffness = matrix(2, [(0, 0, 4.0), (0, 1, 0.6), (1, 0, -0.6), (1, 1, 4.0)]);
    let damping = matrix(2, [(0, 1, 2.0), (1, 0, -3.0)]);
    let mut system = LinearSystem::lumped(vec![1.0; 2], stiffness).unwrap().damping(damping).unwrap();
    let error = verify::tangent(&mut system, 0.0, &[0.3, 0.4], &[1.0, -2.0], 1e-3, 1e-3).unwrap();
    assert!(error.stiffness.relative < 1e-10 && error.damping.relative < 1e-10, "{error:?}");
    assert!(error.damping_force.relative < 1e-10 && error.potential.is_none(), "{error:?}");
    assert!((error.stiffness.asymmetry - 0.3).abs() < 1e-12, "{error:?}");
}

#[test]
fn half_a_symmetric_matrix_is_still_found() {
    let whole = || matrix(2, [(0, 0, 1.0), (1, 1, 1.0)]);
    for half in [matrix(2, [(0, 0, 4.0), (0, 1, 1.0), (1, 1, 4.0)]), matrix(2, [(0, 0, 4.0), (1, 0, 1.0), (1, 1, 4.0)])]
    {
        assert!(matches!(LinearSystem::<f64>::lumped(vec![1.0; 2], half.clone()), Err(Error::Asymmetric { .. })));
        let damped = LinearSystem::lumped(vec![1.0; 2], whole()).unwrap().damping(half);
        assert!(matches!(damped, Err(Error::Asymmetric { .. })));
    }
    // One-way coupling, meant: a stored zero says so.
    let one_way = matrix(2, [(0, 0, 4.0), (0, 1, 1.0), (1, 0, 0.0), (1, 1, 4.0)]);
    let mut system = LinearSystem::lumped(vec![1.0; 2], one_way).unwrap();
    let mut force = [0.0; 2];
    system.force(0.0, &[0.0, 1.0], &[0.0; 2], &mut force).unwrap();
    assert_eq!(force, [-1.0, -4.0]);
}

#[test]
fn rayleigh_damping_and_loads_go_with_a_general_stiffness() {
    let entries = [(0, 0, 4.0), (0, 1, 0.6), (1, 0, -0.8), (1, 1, 5.0)];
    let system = LinearSystem::lumped(vec![1.0, 2.0], matrix(2, entries.iter().copied())).unwrap();
    let mut system = system.rayleigh(0.5, 0.1).unwrap().load(|t, f| f[0] = t);
    let (u, v) = ([0.3, -0.2], [1.0, 0.5]);
    let k = dense(2, &entries);
    let moved: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u + 0.1 * v).collect();
    let internal = times(&k, &moved);
    let expected = [7.0 - internal[0] - 0.5 * v[0], -internal[1] - v[1]];
    let mut force = [0.0; 2];
    system.force(7.0, &u, &v, &mut force).unwrap();
    assert!(apart(&force, &expected) < 1e-14, "{force:?} {expected:?}");
    let error = verify::tangent(&mut system, 0.0, &u, &v, 1e-3, 1e-3).unwrap();
    assert!(error.stiffness.relative < 1e-9 && error.damping.relative < 1e-9 && error.damping_force.relative < 1e-9);
}

/// A mass on an elastic bar in the plane, driven by a force P across it that turns with it.
struct Follower {
    pattern: SymbolicSparseColMat<usize>,
    axial: f64,
    force: f64,
    tangent: Tangent,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Tangent {
    Exact,
    Symmetrized,
}

const BAR: f64 = 2.0;

impl Follower {
    fn new(axial: f64, force: f64, tangent: Tangent) -> Self {
        let pattern = SymbolicSparseColMat::new_checked(2, 2, vec![0, 2, 4], None, vec![0, 1, 0, 1]);
        Self { pattern, axial, force, tangent }
    }
}

impl System<f64> for Follower {
    fn dofs(&self) -> usize {
        2
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&[3.0, 3.0])
    }
    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        let x = [BAR + u[0], u[1]];
        let length = x[0].hypot(x[1]);
        let normal = self.axial * (length - BAR) / BAR / length;
        // Across the bar, P/BAR times its length.
        let across = self.force / BAR;
        out[0] = -normal * x[0] - across * x[1];
        out[1] = -normal * x[1] + across * x[0];
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        let x = [BAR + u[0], u[1]];
        let length = x[0].hypot(x[1]);
        let (stiffness, normal) = (self.axial / BAR, self.axial * (length - BAR) / BAR / length);
        let entry = |i: usize, j: usize| {
            let e = x[i] * x[j] / (length * length);
            stiffness * e + normal * (if i == j { 1.0 } else { 0.0 } - e)
        };
        let skew = if self.tangent == Tangent::Exact { self.force / BAR } else { 0.0 };
        // Column by column.
        out.copy_from_slice(
            &[entry(0, 0), entry(1, 0) - skew, entry(0, 1) + skew, entry(1, 1)].map(|x| w.stiffness * x),
        );
        Ok(())
    }
}

#[test]
fn follower_loads_converge_quadratically_with_their_exact_tangent() {
    let error =
        verify::tangent(&mut Follower::new(90.0, 40.0, Tangent::Exact), 0.0, &[0.3, 1.1], &[0.0; 2], 1e-5, 1e-5);
    assert!(error.unwrap().stiffness.relative < 1e-8);
    let run = |tangent: Tangent| {
        let mut run = Simulation::builder(Follower::new(90.0, 40.0, tangent), Newmark::trapezoidal(), 0.25)
            .linear_solver(Lu)
            .newton(Newton::full().tolerances(1e-13, 1e-12).unwrap().iterations(60).unwrap())
            .build()
            .unwrap();
        let mut histories = Vec::new();
        for _ in 0..12 {
            run.step().unwrap();
            histories.push(run.convergence().iter().map(|iteration| iteration.residual).collect::<Vec<_>>());
        }
        (run.state().displacement().to_vec(), run.statistics().newton_iterations, histories)
    };
    let (exact, few, histories) = run(Tangent::Exact);
    let (symmetrized, many, _) = run(Tangent::Symmetrized);
    // The same motion: the tangent decides about the way there only.
    assert!(apart(&exact, &symmetrized) < 1e-9, "{exact:?} {symmetrized:?}");
    assert!(few * 2 < many, "{few} against {many} iterations");
    let mut seen = 0;
    for residuals in histories {
        for pair in residuals.windows(2).filter(|pair| pair[0] < 1e-2 && pair[0] > 1e-7) {
            assert!(pair[1] < 30.0 * pair[0] * pair[0], "{residuals:?}");
            seen += 1;
        }
    }
    assert!(seen >= 12, "{seen}");
    // Cholesky refuses the exact one, and says who takes it.
    let built = Simulation::builder(Follower::new(90.0, 40.0, Tangent::Exact), Newmark::trapezoidal(), 0.25).build();
    let message = built.map(drop).unwrap_err().to_string();
    assert!(message.contains("effective matrix is not symmetric") && message.contains("Lu"), "{message}");
}

/// A shaft of discs, each with two dofs (x, y), springs between neighbors and to the ground, gyroscopic coupling of x
/// and y of one disc, circulatory coupling of the neighbors: nothing is symmetric but M.
struct Shaft {
    mass: Vec<f64>,
    stiffness: Entries,
    damping: Entries,
}

const DISCS: usize = 3;

impl Shaft {
    fn new() -> Self {
        let n = 2 * DISCS;
        let mut stiffness: Entries = (0..n).map(|i| (i, i, 3.0)).collect();
        let mut damping: Entries = (0..n).map(|i| (i, i, 1.0)).collect();
        for disc in 0..DISCS {
            damping.extend([(2 * disc, 2 * disc + 1, 2.5), (2 * disc + 1, 2 * disc, -2.5)]);
            if disc + 1 < DISCS {
                for axis in 0..2 {
                    let (a, b) = (2 * disc + axis, 2 * disc + 2 + axis);
                    stiffness.extend([(a, a, 20.0), (b, b, 20.0), (a, b, -20.0), (b, a, -20.0)]);
                }
                let (a, b) = (2 * disc, 2 * disc + 3);
                stiffness.extend([(a, b, 1.5), (b, a, -0.5)]);
            }
        }
        Self { mass: (0..n).map(|i| 1.0 + 0.1 * i as f64).collect(), stiffness, damping }
    }

    fn system(&self) -> LinearSystem<'static, f64> {
        let n = self.mass.len();
        LinearSystem::lumped(self.mass.clone(), matrix(n, self.stiffness.iter().copied()))
            .unwrap()
            .damping(matrix(n, self.damping.iter().copied()))
            .unwrap()
    }
}

/// Stops on several discs: rows of G and gaps at u = 0.
fn stops() -> (Dense, Vec<f64>) {
    let mut g = vec![vec![0.0; 2 * DISCS]; 5];
    for (row, weights) in
        [&[(0, 1.0)][..], &[(1, -1.0)], &[(2, 0.8), (3, 0.6)], &[(4, -0.6), (5, 0.8), (1, 0.3)], &[(2, -1.0), (4, 1.0)]]
            .into_iter()
            .enumerate()
    {
        for &(dof, weight) in weights {
            g[row][dof] = weight;
        }
    }
    (g, vec![0.05, 0.1, 0.02, 0.08, 0.03])
}

fn stop_rows() -> LinearRows<'static, f64> {
    let (g, gaps) = stops();
    g.iter().zip(gaps).fold(LinearRows::new(), |rows, (g, gap)| {
        let entries: Vec<_> = g.iter().copied().enumerate().filter(|entry| entry.1 != 0.0).collect();
        rows.unilateral(&entries, gap)
    })
}

/// The solution of 0 ≤ W λ + q ⊥ λ ≥ 0, by trying all sets of active rows.
fn enumerated(w: &Dense, q: &[f64]) -> Vec<f64> {
    let (m, size) = (q.len(), largest(q.iter().copied()));
    for set in 0..1_usize << m {
        let rows: Vec<usize> = (0..m).filter(|i| set >> i & 1 == 1).collect();
        let block = rows.iter().map(|&i| rows.iter().map(|&j| w[i][j]).collect()).collect();
        let solution = solved(block, rows.iter().map(|&i| -q[i]).collect());
        let mut lambda = vec![0.0; m];
        rows.iter().zip(&solution).for_each(|(&i, &x)| lambda[i] = x);
        let y: Vec<f64> = times(w, &lambda).iter().zip(q).map(|(y, q)| y + q).collect();
        if lambda.iter().all(|&l| l >= 0.0) && (0..m).all(|i| y[i] >= -1e-12 * size) {
            return lambda;
        }
    }
    panic!("no solution");
}

/// The trapezoidal rule with contact on the displacements at the end of the step, in dense algebra.
struct Reference {
    mass: Vec<f64>,
    k: Dense,
    c: Dense,
    h: f64,
    motion: [Vec<f64>; 3],
    lambda: Vec<f64>,
}

impl Reference {
    fn step(&mut self) {
        let (n, h) = (self.mass.len(), self.h);
        let (g, gaps) = stops();
        let [u, v, a] = &self.motion;
        // Unknown u': v' = 2 (u' − u)/h − v, a' = 4 (u' − u)/h² − 4 v/h − a.
        let matrix: Dense = (0..n)
            .map(|i| {
                let inertia = |j: usize| if i == j { 4.0 / (h * h) * self.mass[i] } else { 0.0 };
                (0..n).map(|j| inertia(j) + 2.0 / h * self.c[i][j] + self.k[i][j]).collect()
            })
            .collect();
        let known_v: Vec<f64> = (0..n).map(|i| 2.0 / h * u[i] + v[i]).collect();
        let damped = times(&self.c, &known_v);
        let right: Vec<f64> =
            (0..n).map(|i| self.mass[i] * (4.0 / (h * h) * u[i] + 4.0 / h * v[i] + a[i]) + damped[i]).collect();
        let free = solved(matrix.clone(), right.clone());
        let responses: Vec<Vec<f64>> = g.iter().map(|row| solved(matrix.clone(), row.clone())).collect();
        let w: Dense = g
            .iter()
            .map(|row| responses.iter().map(|x| row.iter().zip(x).map(|(g, x)| g * x).sum()).collect())
            .collect();
        let skew = largest((0..25).map(|k| (w[k / 5][k % 5] - w[k % 5][k / 5]) / w[k / 5][k / 5]));
        assert!(skew > 0.05, "the scene is to test a W that is not symmetric: {skew}");
        let q: Vec<f64> = times(&g, &free).iter().zip(&gaps).map(|(q, gap)| q + gap).collect();
        self.lambda = enumerated(&w, &q);
        let new: Vec<f64> =
            (0..n).map(|i| free[i] + self.lambda.iter().zip(&responses).map(|(l, x)| l * x[i]).sum::<f64>()).collect();
        let new_v: Vec<f64> = (0..n).map(|i| 2.0 / h * (new[i] - u[i]) - v[i]).collect();
        let new_a: Vec<f64> = (0..n).map(|i| 4.0 / (h * h) * (new[i] - u[i]) - 4.0 / h * v[i] - a[i]).collect();
        self.motion = [new, new_v, new_a];
    }
}

#[test]
fn contact_with_an_unsymmetric_matrix_is_that_of_a_dense_reference() {
    let shaft = Shaft::new();
    let (n, h) = (shaft.mass.len(), 0.05);
    let velocity: Vec<f64> = (0..n).map(|i| if i % 2 == 0 { -1.0 } else { 0.9 }).collect();
    let (k, c) = (dense(n, &shaft.stiffness), dense(n, &shaft.damping));
    let a: Vec<f64> = times(&c, &velocity).iter().zip(&shaft.mass).map(|(f, m)| -f / m).collect();
    let mut reference =
        Reference { mass: shaft.mass.clone(), k, c, h, motion: [vec![0.0; n], velocity.clone(), a], lambda: vec![] };
    let build = |solver: Box<dyn ContactSolver<f64>>| {
        Simulation::builder(shaft.system(), Newmark::trapezoidal(), h)
            .velocity(velocity.clone())
            .linear_solver(Lu)
            .contact_solver(solver)
            .constraint(stop_rows())
            .uncorrected()
            .build()
            .unwrap()
    };
    let mut runs = [build(Box::<ActiveSet>::default()), build(Box::<GaussSeidel>::default())];
    let (mut pressed, mut together, mut momentum) = (0, 0, 0.0_f64);
    let (g, _) = stops();
    for step in 0..400 {
        for (which, run) in runs.iter_mut().enumerate() {
            // Step by step: raw contact makes much of small differences.
            let start = run.state().clone();
            reference.motion = [start.displacement(), start.velocity(), start.acceleration()].map(<[f64]>::to_vec);
            reference.step();
            run.step().unwrap();
            let state = run.state();
            let [u, v, a] = &reference.motion;
            // (The reference loses digits in differences of displacements over h².)
            let scale = largest(u.iter().chain(start.displacement()).copied())
                + largest(v.iter().map(|v| v * h))
                + largest(a.iter().map(|a| a * h * h));
            let misses = [
                apart(state.displacement(), u),
                apart(state.velocity(), v) * h,
                apart(state.acceleration(), a) * h * h,
                apart(state.contacts().forces(), &reference.lambda) * h * h,
            ];
            assert!(largest(misses) < [1e-13, 1e-10][which] * scale, "{which}, step {step}: {misses:?}");
            let count = reference.lambda.iter().filter(|&&l| l > 0.0).count();
            pressed += usize::from(count > 0);
            together = together.max(count);
            // Momentum of every dof: M Δv + C Δu + ½ h K (u + u') = ½ h Gᵀ (λ + λ').
            let [steps, sums] = [-1.0, 1.0].map(|sign| -> Vec<f64> {
                state.displacement().iter().zip(start.displacement()).map(|(new, old)| new + sign * old).collect()
            });
            let (damped, elastic) = (times(&reference.c, &steps), times(&reference.k, &sums));
            for i in 0..n {
                let rows = g.iter().zip(state.contacts().forces()).zip(start.contacts().forces());
                let contact: f64 = rows.map(|((g, new), old)| 0.5 * h * g[i] * (new + old)).sum();
                let change =
                    shaft.mass[i] * (state.velocity()[i] - start.velocity()[i]) + damped[i] + 0.5 * h * elastic[i];
                momentum = momentum.max((change - contact).abs() / scale);
            }
        }
    }
    assert!(pressed > 200 && together >= 3, "{pressed} steps in contact, {together} rows at once");
    assert!(momentum < 1e-12, "{momentum:e}");
    // This one needs a symmetric W and says so.
    let failure = build(Box::<Pivoting<f64>>::default()).run_until(20.0, &mut ()).unwrap_err();
    let Error::UnsymmetricContacts { .. } = failure else { panic!("{failure}") };
    assert!(failure.to_string().contains("ActiveSet") && !failure.is_recoverable(), "{failure}");
    let built = Simulation::builder(shaft.system(), Newmark::trapezoidal(), h).constraint(stop_rows()).build();
    assert!(matches!(built.map(drop), Err(Error::Asymmetric { matrix: "effective", .. })));
}

#[test]
fn corrected_contact_of_a_gyroscopic_system_converges() {
    // Any scheme, with the correction: towards one motion as h falls. W is of M there, hence symmetric.
    let shaft = Shaft::new();
    let velocity: Vec<f64> = (0..2 * DISCS).map(|i| if i % 2 == 0 { -1.0 } else { 0.9 }).collect();
    let schemes: [Make; 3] =
        [|| Box::new(Newmark::trapezoidal()), || Box::new(Composite), || Box::new(Bathe::default())];
    let end = |make: Make, steps: f64| {
        let mut run = Simulation::builder(shaft.system(), make(), 0.6 / steps)
            .velocity(velocity.clone())
            .linear_solver(Lu)
            .constraint(stop_rows())
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        run.run_until(0.6, &mut ()).unwrap();
        run.state().displacement().to_vec()
    };
    let fine = end(schemes[0], 20_000.0);
    for make in schemes {
        let [coarse, finer] = [100.0, 1600.0].map(|steps| apart(&end(make, steps), &fine));
        assert!(finer < 0.2 * coarse && finer < 2e-3, "{}: {coarse:e} {finer:e}", make().name());
    }
}

#[test]
fn dense_problems_that_are_not_symmetric() {
    let mut random = Congruential(17);
    let mut active = ActiveSet::default();
    let mut refused = 0;
    for case in 0..400_u64 {
        let m = 1 + (case % 7) as usize;
        // B Bᵀ plus a small diagonal, plus a skew part as large; in units that differ by rows.
        let b: Vec<f64> = (0..m * m).map(|_| random.signed()).collect();
        let skew: Vec<f64> = (0..m * m).map(|_| random.signed()).collect();
        let unit: Vec<f64> = (0..m).map(|_| 10_f64.powf(3.0 * random.signed())).collect();
        let entry = |i: usize, j: usize| {
            let own: f64 = (0..m).map(|k| b[i * m + k] * b[j * m + k]).sum();
            let turned = skew[i * m + j] - skew[j * m + i];
            unit[i] * unit[j] * (own + turned + if i == j { 0.3 } else { 0.0 })
        };
        let w: Dense = (0..m).map(|i| (0..m).map(|j| entry(i, j)).collect()).collect();
        let q: Vec<f64> = (0..m).map(|i| unit[i] * random.signed()).collect();
        let (flat, tolerance) = (w.concat(), vec![0.0; m]);
        let bounds = vec![AdmissibleSet::NonNegative; m];
        let problem = |version| ContactProblem::new(&flat, &q, &bounds, &tolerance).unwrap().with_version(version);
        let dimensionless = |i: usize, x: f64| x * unit[i];
        // In sizes of one, for the enumeration.
        let plain: Dense = (0..m).map(|i| (0..m).map(|j| w[i][j] / unit[i] / unit[j]).collect()).collect();
        let expected = enumerated(&plain, &(0..m).map(|i| q[i] / unit[i]).collect::<Vec<_>>());
        for (version, guess) in [(0, 0.0), (case + 1, 1.0), (case + 1, 0.0)] {
            let mut lambda = vec![guess; m];
            active.solve(&problem(version), &mut lambda).unwrap();
            for i in 0..m {
                let difference = dimensionless(i, lambda[i]) - expected[i];
                assert!(difference.abs() < 1e-10 * (1.0 + largest(expected.iter().copied())), "{case}: {difference:e}");
            }
        }
        match Pivoting::default().solve(&problem(0), &mut vec![0.0; m]) {
            Err(ContactFailure::Unsymmetric { row, other }) => {
                assert!(row < m && other < m && row != other);
                refused += 1;
            }
            found => assert!(m == 1, "{found:?}"),
        }
    }
    assert!(refused > 300, "{refused}");
}

#[test]
fn redundant_and_contradictory_rows_of_a_problem_that_is_not_symmetric() {
    // Two contacts, the first of which is there twice: W of rank two.
    let base = [[2.0, 1.5], [-0.5, 1.0]];
    let rows = [0, 0, 1];
    let w: Vec<f64> = rows.iter().flat_map(|&i| rows.map(|j| base[i][j])).collect();
    let bounds = [AdmissibleSet::NonNegative; 3];
    let problem = ContactProblem::new(&w, &[-3.0, -3.0, -1.0], &bounds, &[1e-15; 3]).unwrap();
    let exact = solved(vec![base[0].to_vec(), base[1].to_vec()], vec![3.0, 1.0]);
    assert!(exact.iter().all(|&x| x > 0.0));
    for guess in [0.0, 1.0] {
        let mut lambda = [guess; 3];
        ActiveSet::default().solve(&problem, &mut lambda).unwrap();
        // Their sum is determined, and they share it.
        assert!((lambda[0] + lambda[1] - exact[0]).abs() < 1e-10 && (lambda[2] - exact[1]).abs() < 1e-10, "{lambda:?}");
        assert!((lambda[0] - lambda[1]).abs() < 1e-6, "{lambda:?}");
    }
    // Opposite demands on one dof, beside a skew coupling that has nothing to do with it.
    let g = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]];
    let answer = |i: usize, j: usize| (0..2).map(|a| (0..2).map(|b| g[i][a] * base[a][b] * g[j][b]).sum::<f64>()).sum();
    let w: Vec<f64> = (0..9).map(|k| answer(k / 3, k % 3)).collect();
    let problem = ContactProblem::new(&w, &[-1.0, -1.0, 0.5], &bounds, &[1e-15; 3]).unwrap();
    let failure = ActiveSet::default().solve(&problem, &mut [0.0; 3]);
    assert!(matches!(failure, Err(ContactFailure::Contradictory { row: 0 | 1, other: 0 | 1, .. })), "{failure:?}");
}

#[test]
fn symmetric_systems_run_as_with_cholesky() {
    let bars = Bars::paper(20).delayed(0.3, 2e-3);
    let build = |solver: Box<dyn LinearSolver<f64>>| {
        Simulation::builder(bars.system::<f64>().rayleigh(0.0, 1e-5).unwrap(), Composite, 2e-3)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .corrector(PersistencyCorrection::with_history_projection())
            .linear_solver(solver)
            .build()
            .unwrap()
    };
    let (mut one, mut other) = (build(Box::<Cholesky>::default()), build(Box::new(Lu)));
    for step in 0..300 {
        one.step().unwrap();
        other.step().unwrap();
        let (a, b) = (one.state(), other.state());
        assert!(apart(a.displacement(), b.displacement()) < 1e-13, "{step}");
        assert!(apart(a.velocity(), b.velocity()) < 1e-11, "{step}");
        assert!(apart(a.contacts().forces(), b.contacts().forces()) < 1e-9 * 0.0125, "{step}");
        assert_eq!(a.contacts().closed(), b.contacts().closed(), "{step}");
    }
    assert_eq!(one.statistics().linear_solves, other.statistics().linear_solves);

    // At large strains, with a factorization an iteration and blocks.
    let solid = Solid::block([1.0; 3], [4; 3], MATERIAL).rotated([1.0, 1.0, 0.0], 0.4).lifted(0.02);
    let build = |solver: Box<dyn LinearSolver<f64>>| {
        let dofs = solid.node_dofs();
        let floor = contact_dynamics::contact::Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
        let nodes = solid.surface_nodes();
        let contact = contact_dynamics::NodesOnObstacle::new(floor, &solid.nodes, &dofs, &nodes).unwrap();
        Simulation::builder(Hyperelastic::new(&solid, Law::NeoHookean), Composite, 0.05)
            .velocity(solid.uniform([0.0, 0.0, -0.2]))
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .linear_solver(solver)
            .build()
            .unwrap()
    };
    let (mut one, mut other) = (build(Box::<Cholesky>::default()), build(Box::new(Lu)));
    for step in 0..60 {
        one.step().unwrap();
        other.step().unwrap();
        let apart = apart(one.state().displacement(), other.state().displacement());
        assert!(apart < 1e-9, "{step}: {apart:e}");
    }
    assert!(one.statistics().contact_changes > 4);
    assert_eq!(one.statistics().newton_iterations, other.statistics().newton_iterations);
}

/// The stiff elastic pendulum with different forces and tangents of a path.
struct Pendulum {
    truss: Truss<2>,
    along: Along,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Along {
    /// The mean of three forces.
    Generic,
    /// Mean strain on the mean configuration, with a symmetric tangent.
    Symmetric,
    /// The same with its exact tangent.
    Exact,
}

impl System<f64> for Pendulum {
    fn dofs(&self) -> usize {
        self.truss.dofs()
    }
    fn mass(&self) -> Mass<'_, f64> {
        self.truss.mass()
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        self.truss.force(t, u, v, out)
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.truss.pattern()
    }
    fn tangent(&mut self, t: f64, u: &[f64], v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        self.truss.tangent(t, u, v, w, out)
    }
    fn path_force(&mut self) -> Option<&mut dyn PathForce<f64>> {
        match self.along {
            Along::Generic => None,
            Along::Symmetric | Along::Exact => Some(self),
        }
    }
    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        self.truss.potential_energy(u)
    }
    fn prescribed(&self) -> &[usize] {
        self.truss.prescribed()
    }
}

impl PathForce<f64> for Pendulum {
    fn force_along(&mut self, t: f64, path: Path<'_, f64>, v: &[f64], out: &mut [f64]) -> Result<()> {
        self.truss.force_along(t, path, v, out)
    }
    fn tangent_along(
        &mut self,
        t: f64,
        path: Path<'_, f64>,
        v: &[f64],
        w: TangentWeights<f64>,
        out: &mut [f64],
    ) -> Result<()> {
        self.truss.tangent_along(t, path, v, w, out)?;
        if self.along == Along::Exact {
            // EA/L³ x̄ x(to)ᵀ in place of EA/L³ x̄ x̄ᵀ; the support is the first node, the mass the second.
            let stiffness = w.stiffness * self.truss.axial(0) / PendulumReference::LENGTH.powi(3);
            let place = |u: &[f64]| [PendulumReference::LENGTH + u[2], u[3]];
            let (mean, to) = (place(path.mean), place(path.to));
            let pattern = self.truss.pattern();
            for column in 2..4 {
                let range = pattern.col_range(column);
                for (&row, value) in pattern.row_idx_of_col_raw(column).iter().zip(&mut out[range]) {
                    if row >= 2 {
                        *value += stiffness * mean[row - 2] * (to[column - 2] - mean[column - 2]);
                    }
                }
            }
        }
        Ok(())
    }
}

/// Iterations a step, and the largest relative deviation of the energy, over ten seconds.
fn swing(axial: f64, h: f64, along: Along, solver: Box<dyn LinearSolver<f64>>) -> Result<(f64, f64)> {
    let mut run = Simulation::builder(Pendulum { truss: Truss::pendulum(axial), along }, EnergyMomentum, h)
        .velocity(Truss::pendulum_velocity())
        .linear_solver(solver)
        .build()?;
    let start = run.energy().total();
    let mut deviation = 0.0_f64;
    let steps = (10.0 / h).round();
    for _ in 0..steps as usize {
        run.step()?;
        deviation = deviation.max((run.energy().total() / start - 1.0).abs());
    }
    Ok((run.statistics().newton_iterations as f64 / steps, deviation))
}

#[test]
fn paths_with_their_tangents() {
    // The exact tangent of the mean stress saves iterations where the bar is soft.
    let mut saved = 0;
    for axial in [1e4, 1e6, 1e7] {
        for h in [0.01, 0.02, 0.05] {
            let (few, energy) = swing(axial, h, Along::Exact, Box::new(Lu)).unwrap();
            let (more, _) = swing(axial, h, Along::Symmetric, Box::new(Cholesky::default())).unwrap();
            println!("EA = {axial:e}, h = {h}: {few} exact, {more} symmetric; energy {energy:e}");
            assert!(few <= more + 0.05 && few < 3.1 && energy < 1e-8, "{axial:e}, {h}: {few} {more} {energy:e}");
            saved += usize::from(few < more - 0.3);
        }
    }
    assert!(saved >= 4, "{saved}");
    // The mean of three forces, by Simpson's tangent: three iterations where that of the middle took eleven.
    for (axial, h) in [(1e4, 0.05), (1e6, 0.05), (1e7, 0.02), (1e8, 0.01)] {
        let (iterations, energy) = swing(axial, h, Along::Generic, Box::new(Cholesky::default())).unwrap();
        println!("EA = {axial:e}, h = {h}: {iterations} generic; energy {energy:e}");
        assert!(iterations < 3.2 && energy < 1e-7, "{axial:e}, {h}: {iterations}, {energy:e}");
    }
    // Longer steps pass matrices that are not definite: these take Lu.
    for axial in [1e7, 1e8] {
        let refused = swing(axial, 0.05, Along::Generic, Box::new(Cholesky::default()));
        assert!(matches!(refused, Err(Error::IndefiniteTangent { .. })), "{refused:?}");
        let (iterations, energy) = swing(axial, 0.05, Along::Generic, Box::new(Lu)).unwrap();
        println!("EA = {axial:e}, h = 0.05: {iterations} generic by LU; energy {energy:e}");
        assert!(iterations < 7.0 && energy < 1e-7, "{axial:e}: {iterations}, {energy:e}");
    }
}
