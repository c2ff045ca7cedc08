//! Conjugate gradients: solutions, units, what they refuse, and steps with them.
#![allow(clippy::float_cmp)] // the same to the last bit is meant

use contact_dynamics::contact::Plane;
use contact_dynamics::contact_solver::Assembly;
use contact_dynamics::faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef};
use contact_dynamics::{
    ActiveSet, ByBody, Cholesky, Composite, ConjugateGradients, Error, Factorization, LinearSolver, LinearSystem,
    Newmark, NodesOnObstacle, PersistencyCorrection, Real, Result, Simulation, SimulationBuilder, StepControl,
};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{Entry, entries, factorized, matrix, springs};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const SOFT: Material = Material { young: 50.0, poisson: 0.25, density: 1.0 };

type Matrix<T> = SparseColMat<usize, T>;
/// M/dt² + K of a solid at a Courant number.
fn effective<const D: usize>(solid: &Solid<D>, size: f64, courant: f64) -> Vec<Entry> {
    let inertia = 4.0 * (SOFT.wave_speed() / (courant * size)).powi(2);
    let mass = solid.lumped_mass::<f64>();
    let mass = mass.into_iter().enumerate().map(|(i, m)| (i, i, inertia * m));
    entries(&solid.stiffness()).into_iter().chain(mass).collect()
}

fn chain(n: usize, shift: f64) -> Vec<Entry> {
    springs(n, 1.0).chain((0..n).map(|i| (i, i, shift))).collect()
}

fn rhs<T: Real>(n: usize) -> Vec<T> {
    (0..n).map(|i| T::of((i as f64 * 0.7).sin() + 0.3 * (i as f64 * 2.9).cos())).collect()
}

/// Largest difference, over the largest entry of the second.
fn difference<T: Real>(x: &[T], y: &[T]) -> f64 {
    let largest = y.iter().fold(0.0, |m: f64, y| m.max(y.value().abs()));
    x.iter().zip(y).fold(0.0, |m: f64, (&x, &y)| m.max((x - y).value().abs())) / largest
}

/// Matrices with blocks of one, two and three dofs, with fixed dofs among them.
fn cases() -> Vec<(usize, Vec<Entry>)> {
    let block = Solid::block([1.0; 3], [4; 3], SOFT);
    let plate = Solid::rectangle([1.0; 2], [9; 2], SOFT);
    let bar = Solid::block([2.0, 0.5, 0.5], [16, 4, 4], SOFT);
    let fixed = |entries: Vec<Entry>, dofs: &'static [usize]| {
        let free = move |&(i, j, _): &Entry| !dofs.contains(&i) && !dofs.contains(&j);
        entries.into_iter().filter(free).chain(dofs.iter().map(|&dof| (dof, dof, 1.0))).collect::<Vec<_>>()
    };
    vec![
        (1, vec![(0, 0, 4.0)]),
        (7, (0..7).map(|i| (i, i, 1.0 + i as f64)).collect()),
        (50, chain(50, 0.01)),
        (block.dofs(), effective(&block, 0.25, 2.0)),
        (block.dofs(), fixed(effective(&block, 0.25, 1.0), &[0, 1, 40, 100, 374])),
        (plate.dofs(), fixed(effective(&plate, 1.0 / 9.0, 3.0), &[0, 1, 19, 90])),
        // Long steps, with a coarse space.
        (bar.dofs(), fixed(effective(&bar, 0.125, 30.0), &[0, 1, 2, 300, 301, 700])),
        (plate.dofs(), effective(&plate, 1.0 / 9.0, 20.0)),
    ]
}

#[test]
fn solutions_are_those_of_cholesky() {
    for (n, entries) in cases() {
        let (a, single) = (matrix::<f64>(n, entries.clone()), matrix::<f32>(n, entries));
        let solver = ConjugateGradients::default();
        let (mut expected, mut found) = (rhs::<f64>(2 * n), rhs::<f64>(2 * n));
        factorized(&Cholesky::default(), &a).solve(&mut expected).unwrap();
        let mut iterative = factorized(&solver, &a);
        iterative.solve(&mut found).unwrap();
        assert!(difference(&found, &expected) < 1e-9, "{n} {:e}", difference(&found, &expected));
        assert!(iterative.iterations() > 0 && iterative.condensation().is_none());
        // Bit for bit again, each column alone.
        let mut again = rhs::<f64>(2 * n);
        again.chunks_mut(n).for_each(|column| iterative.solve(column).unwrap());
        assert_eq!(found, again);
        // To rounding if so asked, which ends too.
        let exact = solver.tolerance(0.0).unwrap();
        let mut found = rhs::<f64>(2 * n);
        factorized(&exact, &a).solve(&mut found).unwrap();
        assert!(difference(&found, &expected) < 1e-12, "{n} {:e}", difference(&found, &expected));
        for solver in [solver, exact] {
            let mut found = rhs::<f32>(2 * n);
            factorized(&solver, &single).solve(&mut found).unwrap();
            let wide: Vec<f64> = found.iter().map(|x| f64::from(*x)).collect();
            assert!(difference(&wide, &expected) < 2e-5, "{n} {:e}", difference(&wide, &expected));
        }
    }
}

/// A bar that is large enough for parts that threads share, numbered across, along, and scattered, so that it has none.
/// Errors name the dof of the matrix.
#[test]
fn matrices_in_parts_are_solved_as_others() {
    let scattered: Vec<usize> = (0..6666).map(|node| node * 1009 % 6666).collect();
    for (cells, numbering) in [([100, 10, 5], None), ([5, 10, 100], None), ([100, 10, 5], Some(scattered))] {
        let block = Solid::block(cells.map(|count| 0.1 * count as f64), cells, SOFT);
        let n = block.dofs();
        let place = |dof: usize| numbering.as_ref().map_or(dof, |numbering| 3 * numbering[dof / 3] + dof % 3);
        let entries: Vec<_> =
            effective(&block, 0.1, 2.0).into_iter().map(|(i, j, value)| (place(i), place(j), value)).collect();
        let a = matrix::<f64>(n, entries.clone());
        let (mut expected, mut found) = (rhs::<f64>(n), rhs::<f64>(n));
        factorized(&Cholesky::default(), &a).solve(&mut expected).unwrap();
        let exact = ConjugateGradients::default().tolerance(0.0).unwrap();
        let mut factor = factorized(&exact, &a);
        factor.solve(&mut found).unwrap();
        assert!(difference(&found, &expected) < 1e-12, "{cells:?} {:e}", difference(&found, &expected));
        for node in [0, 1000, 3333, 6665] {
            // A negative diagonal, and a coupling within the node that leaves its last dof no positive pivot.
            let (first, last) = (3 * node, 3 * node + 2);
            for (dof, added) in
                [(first, vec![(first, first, -1e9)]), (last, vec![(first, last, 1e9), (last, first, 1e9)])]
            {
                let broken = matrix::<f64>(n, entries.iter().copied().chain(added));
                let refused = factor.factorize(broken.as_ref()).unwrap_err();
                assert!(matches!(refused, Error::Singular { dof: found, .. } if found == dof), "{dof}: {refused}");
            }
        }
        factor.factorize(a.as_ref()).unwrap();
        let mut again = rhs::<f64>(n);
        factor.solve(&mut again).unwrap();
        assert_eq!(found, again);
    }
}

/// The condition number grows as the square of the Courant number, iterations slower than the number itself. Fixed dofs
/// stay where they are to the last bit.
#[test]
fn long_steps_take_few_more_iterations() {
    let bar = Solid::block([6.0, 0.8, 0.8], [60, 8, 8], SOFT);
    let n = bar.dofs();
    let fixed = |entries: Vec<Entry>| {
        let free = |&(i, j, _): &Entry| i >= 3 && j >= 3;
        entries.into_iter().filter(free).chain((0..3).map(|dof| (dof, dof, 7.0))).collect::<Vec<_>>()
    };
    let counts = [4.0, 8.0, 16.0, 32.0, 64.0].map(|courant| {
        let a = matrix::<f64>(n, fixed(effective(&bar, 0.1, courant)));
        let mut x = rhs::<f64>(n);
        x[..3].fill(0.0);
        let mut factor = factorized(&ConjugateGradients::default(), &a);
        factor.solve(&mut x).unwrap();
        assert_eq!(x[..3], [0.0; 3]);
        factor.iterations()
    });
    assert!(counts.windows(2).all(|pair| pair[1] * 10 < 18 * pair[0]) && counts[4] < 6 * counts[0], "{counts:?}");
}

#[test]
fn a_looser_tolerance_is_met_with_fewer_iterations() {
    let block = Solid::block([1.0; 3], [5; 3], SOFT);
    let (n, a) = (block.dofs(), matrix::<f64>(block.dofs(), effective(&block, 0.2, 5.0)));
    let mut expected = rhs::<f64>(n);
    factorized(&Cholesky::default(), &a).solve(&mut expected).unwrap();
    let energy = |x: &[f64]| {
        let mut sum = 0.0;
        for (i, j, value) in entries(&a) {
            sum += x[i] * value * x[j];
        }
        sum.sqrt()
    };
    let mut counts = Vec::new();
    for tolerance in [1e-2, 1e-5, 1e-8] {
        let solver = ConjugateGradients::default().tolerance(tolerance).unwrap();
        let (mut factor, mut x) = (factorized(&solver, &a), rhs::<f64>(n));
        factor.solve(&mut x).unwrap();
        let error: Vec<f64> = x.iter().zip(&expected).map(|(x, y)| x - y).collect();
        let error = energy(&error) / energy(&expected);
        // The norm of the preconditioner is nearly that of the matrix.
        assert!(error < 5.0 * tolerance && error > 1e-3 * tolerance, "{tolerance:e}: {error:e}");
        counts.push(factor.iterations());
    }
    assert!(counts.windows(2).all(|pair| pair[0] < pair[1]), "{counts:?}");
}

#[test]
fn units_do_not_matter() {
    // A beam: deflections in meters and rotations, which may be in any unit; then grams and millimeters.
    let n = 40;
    let (mut beam, l) = (Vec::new(), 0.1_f64);
    for e in 0..n / 2 - 1 {
        let k = [
            [12.0, 6.0 * l, -12.0, 6.0 * l],
            [6.0 * l, 4.0 * l * l, -6.0 * l, 2.0 * l * l],
            [-12.0, -6.0 * l, 12.0, -6.0 * l],
            [6.0 * l, 2.0 * l * l, -6.0 * l, 4.0 * l * l],
        ];
        let dofs: Vec<usize> = (2 * e..2 * e + 4).collect();
        let entry = |(i, j): (usize, usize)| (dofs[i], dofs[j], k[i][j] / l.powi(3));
        beam.extend((0..16).map(|k| entry((k / 4, k % 4))));
    }
    beam.extend((0..n).map(|i| (i, i, if i % 2 == 0 { 2e3 } else { 2.0 })));
    // Bridged by springs, or an incomplete factor would be the whole one.
    for i in (0..n - 10).step_by(2) {
        beam.extend([(i, i, 5e3), (i + 10, i + 10, 5e3), (i, i + 10, -5e3), (i + 10, i, -5e3)]);
    }
    let units = |scale: fn(usize) -> f64| {
        let entries = beam.iter().map(|&(i, j, x)| (i, j, x * scale(i) * scale(j)));
        let (a, mut x) = (matrix::<f64>(n, entries), rhs::<f64>(n));
        x.iter_mut().enumerate().for_each(|(i, x)| *x *= scale(i));
        (a, x)
    };
    let solve = |scale: fn(usize) -> f64| {
        let (a, mut x) = units(scale);
        let mut factor = factorized(&ConjugateGradients::default(), &a);
        factor.solve(&mut x).unwrap();
        x.iter_mut().enumerate().for_each(|(i, x)| *x *= scale(i));
        (x, factor.iterations())
    };
    let (x, iterations) = solve(|_| 1.0);
    assert!(iterations > 5, "{iterations}");
    for scale in [
        (|_| 1e-3) as fn(usize) -> f64,
        |_| 1e-90,
        |_| 1e90,
        |i| if i % 2 == 0 { 1e3 } else { 1.0 },
        |i| if i % 2 == 0 { 1e-6 } else { 1e6 },
    ] {
        let (scaled, count) = solve(scale);
        assert_eq!(count, iterations);
        assert!(difference(&scaled, &x) < 1e-11, "{:e}", difference(&scaled, &x));
    }
    // By powers of two even to the last bit.
    let (scaled, _) = solve(|_| 0.125);
    assert_eq!(scaled, x);
    // The size of the right-hand side: squares of small and of large forces leave the range of the scalar.
    let a = matrix::<f32>(50, chain(50, 0.5));
    let mut factor = factorized(&ConjugateGradients::default(), &a);
    let mut x = rhs::<f32>(50);
    factor.solve(&mut x).unwrap();
    for power in [-100, -60, 60, 100] {
        let size = 2.0_f32.powi(power);
        let mut scaled: Vec<f32> = rhs::<f32>(50).into_iter().map(|x| size * x).collect();
        factor.solve(&mut scaled).unwrap();
        assert!(scaled.iter().zip(&x).all(|(scaled, x)| *scaled == size * x), "{size:e}");
    }
}

#[test]
fn forces_that_are_hardly_numbers_have_solutions() {
    let a = matrix::<f32>(50, chain(50, 0.1));
    let mut factor = factorized(&ConjugateGradients::default(), &a);
    let mut natural = rhs::<f32>(50);
    factor.solve(&mut natural).unwrap();
    for exponent in [-60, -110, -130] {
        let unit = 2.0_f32.powi(exponent / 2);
        let mut small: Vec<f32> = rhs::<f32>(50).iter().map(|x| x * unit * unit).collect();
        factor.solve(&mut small).unwrap();
        // (Below 2⁻¹²⁶ numbers lose their digits.)
        let most = 1e-4 + 2.0_f32.powi(-149 - exponent) * 50.0;
        let worst = small.iter().zip(&natural).map(|(x, y)| (x / unit / unit - y).abs()).fold(0.0, f32::max);
        let size = natural.iter().fold(0.0_f32, |size, x| size.max(x.abs()));
        assert!(worst < most * size, "2^{exponent}: {worst:e} of {size:e}");
    }
}

#[test]
fn zero_and_nan_come_back_as_they_are() {
    let a = matrix::<f64>(50, chain(50, 0.1));
    let mut factor = factorized(&ConjugateGradients::default(), &a);
    let mut x = rhs::<f64>(50);
    factor.solve(&mut x).unwrap();
    for bad in [f64::NAN, f64::INFINITY] {
        let mut wrong = rhs::<f64>(50);
        wrong[17] = bad;
        factor.solve(&mut wrong).unwrap();
        assert!(wrong.iter().all(|x| x.is_nan()));
    }
    let mut zero = vec![0.0; 100];
    zero[3] = -0.0;
    factor.solve(&mut zero).unwrap();
    assert!(zero.iter().all(|x| *x == 0.0) && factor.iterations() == 1);
    let mut again = rhs::<f64>(50);
    factor.solve(&mut again).unwrap();
    assert_eq!(x, again);
}

/// pᵀAp over pᵀdiag(A)p along any direction is between the eigenvalues of A with its diagonal scaled to one.
#[test]
fn the_curvature_that_refuses_a_matrix_is_one_that_it_has() {
    // (Of so many dofs that they are not taken for nodes of two or three.)
    let cases = [5, 7, 11, 13].into_iter().flat_map(|n| [0.6, 0.9, 1.7, 4.0].map(|coupling| (n, coupling)));
    for (n, coupling) in cases {
        let chain: Vec<Entry> = (0..n)
            .map(|i| (i, i, 1.0))
            .chain((1..n).flat_map(|i| [(i - 1, i, coupling), (i, i - 1, coupling)]))
            .collect();
        // (The eigenvalues of a chain are 1 + 2 c cos(k π/(n + 1)).)
        let least = 1.0 - 2.0 * coupling * (std::f64::consts::PI / (n as f64 + 1.0)).cos();
        let a = matrix::<f64>(n, chain);
        let solver = ConjugateGradients::default();
        let mut factor = LinearSolver::<f64>::analyze(&solver, a.symbolic(), &[]).unwrap();
        let found = factor.factorize(a.as_ref()).and_then(|()| factor.solve(&mut rhs::<f64>(n)));
        match found {
            Err(Error::Indefinite { curvature, .. }) => {
                assert!(curvature < 0.0 && curvature > least - 1e-12, "{n} {coupling}: {curvature}, not above {least}");
            }
            other => panic!("{n} {coupling}: {other:?}"),
        }
    }
}

#[test]
fn what_cannot_be_solved_is_refused() {
    let refused = |solver: ConjugateGradients, n: usize, entries: Vec<Entry>| {
        let a = matrix::<f64>(n, entries);
        let mut factor = LinearSolver::<f64>::analyze(&solver, a.symbolic(), &[]).unwrap();
        let result = factor.factorize(a.as_ref()).and_then(|()| factor.solve(&mut rhs::<f64>(n)));
        result.unwrap_err()
    };
    let solver = ConjugateGradients::default();
    // Not positive on the diagonal, within a block of a node, and only as a whole.
    let mut diagonal = chain(50, 0.1);
    diagonal.push((7, 7, -9.0));
    assert!(matches!(refused(solver, 50, diagonal), Error::Singular { dof: 7, .. }));
    let node =
        vec![(0, 0, 1.0), (0, 1, 2.0), (1, 0, 2.0), (1, 1, 1.0), (2, 2, 1.0), (3, 3, 1.0), (2, 3, 0.1), (3, 2, 0.1)];
    assert!(matches!(refused(solver, 4, node), Error::Singular { dof: 1, .. }));
    let found = refused(solver, 50, chain(50, -0.5));
    assert!(matches!(found, Error::Indefinite { dof: 0..50, curvature } if curvature < 0.0), "{found:?}");
    assert!(found.to_string().contains("not positive definite") && !found.is_recoverable());
    // A negative spring amid others: it is named.
    let mut negative = chain(50, 0.5);
    negative.extend([(30, 30, -0.5), (31, 31, -0.5), (30, 31, 4.0), (31, 30, 4.0)]);
    let found = refused(solver, 50, negative);
    assert!(matches!(found, Error::Indefinite { dof: 30 | 31, curvature } if curvature < 0.0), "{found:?}");
    let mut nan = chain(50, 0.1);
    nan.extend([(3, 4, f64::NAN), (4, 3, f64::NAN)]);
    assert!(matches!(refused(solver, 50, nan), Error::MatrixNotFinite { .. }));
    let mut asymmetric = chain(50, 0.1);
    asymmetric.push((3, 4, 0.5));
    assert!(matches!(refused(solver, 50, asymmetric), Error::Asymmetric { .. }));
    // A singular matrix: a free chain under forces that have a sum.
    let found = refused(solver, 60, chain(60, 0.0));
    let singular = matches!(found, Error::Indefinite { curvature, .. } if curvature.abs() < 1e-14);
    assert!(singular || matches!(found, Error::LinearNotConverged { .. }), "{found:?}");
    let bridges = (0..45).flat_map(|i| [(i, i, 1.0), (i + 5, i + 5, 1.0), (i, i + 5, -1.0), (i + 5, i, -1.0)]);
    let found = refused(solver.iterations(2), 50, chain(50, 0.01).into_iter().chain(bridges).collect());
    match found {
        Error::LinearNotConverged { iterations: 2, residual, tolerance, .. } => {
            assert!(residual > 1e-3 && tolerance == 1e-10);
        }
        other => panic!("{other:?}"),
    }
    assert!(found.is_recoverable() && found.to_string().contains("2 iterations"));

    let a = matrix::<f64>(50, chain(50, 0.1));
    let mut factor = LinearSolver::<f64>::analyze(&solver, a.symbolic(), &[]).unwrap();
    assert!(matches!(factor.solve(&mut rhs::<f64>(50)), Err(Error::Incompatible { .. })));
    factor.factorize(a.as_ref()).unwrap();
    assert!(matches!(factor.solve(&mut rhs::<f64>(49)), Err(Error::Dimension { expected: 50, found: 49, .. })));
    let other = matrix::<f64>(49, chain(49, 0.1));
    assert!(matches!(factor.factorize(other.as_ref()), Err(Error::Dimension { .. })));
    // What has failed is not used.
    assert!(matches!(factor.solve(&mut rhs::<f64>(50)), Err(Error::Incompatible { .. })));
    // As many entries, elsewhere.
    let moved = (0..50).map(|i| (i, i, 1.0)).chain((1..50).flat_map(|i| {
        let (a, b) = if i == 49 { (0, 49) } else { (i - 1, i) };
        [(a, b, -0.1), (b, a, -0.1)]
    }));
    let moved = matrix::<f64>(50, moved);
    assert!(matches!(factor.factorize(moved.as_ref()), Err(Error::Incompatible { .. })));
    factor.factorize(a.as_ref()).unwrap();
    factor.solve(&mut rhs::<f64>(50)).unwrap();
    for wrong in [-1e-3, 1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(ConjugateGradients::default().tolerance(wrong), Err(Error::Parameter { .. })));
    }
}

#[test]
fn memory_is_that_of_half_the_matrix() {
    let block = Solid::block([1.0; 3], [6; 3], SOFT);
    let a = matrix::<f64>(block.dofs(), effective(&block, 1.0 / 6.0, 1.0));
    let solver = ConjugateGradients::default();
    let stored = LinearSolver::<f64>::analyze(&solver, a.symbolic(), &[]).unwrap().stored_values();
    let (n, half) = (block.dofs(), a.val().len() / 2);
    assert!(stored > half && stored < half + half / 10 + 8 * n, "{stored} {half} {n}");
}

/// A block that falls on a tilted floor, corner first: few contacts.
fn falling(solver: impl LinearSolver<f64> + 'static, h: f64) -> Simulation<'static, f64> {
    scene(solver, h).build().unwrap()
}

fn scene(solver: impl LinearSolver<f64> + 'static, h: f64) -> SimulationBuilder<'static, f64> {
    let block = Solid::block([1.0; 3], [4; 3], SOFT);
    let floor = Plane::new([0.0, 0.0, -0.02], [0.1, 0.2, 1.0]).unwrap();
    let dofs = block.node_dofs();
    Simulation::builder(block.system(), Composite, h)
        .velocity(block.uniform([0.0, 0.1, -1.0]))
        .constraint(NodesOnObstacle::new(floor, &block.nodes, &dofs, &block.surface_nodes()).unwrap())
        .corrector(PersistencyCorrection::with_history_projection())
        .linear_solver(solver)
        .energy_balance()
}

#[test]
fn steps_in_contact_are_those_of_cholesky() {
    let h = 0.25 / SOFT.wave_speed();
    let mut exact = falling(Cholesky::default(), h);
    let mut run = falling(ConjugateGradients::default(), h);
    let mut pressed = 0;
    for _ in 0..60 {
        exact.step().unwrap();
        pressed += usize::from(exact.state().contacts().raw_forces().iter().any(|force| *force > 0.0));
        run.step().unwrap();
        let (a, b) = (run.state(), exact.state());
        let [u, v] =
            [(a.displacement(), b.displacement()), (a.velocity(), b.velocity())].map(|(a, b)| difference(a, b));
        assert!(u < 1e-8 && v < 1e-7, "t = {}: {u:e} {v:e}", run.time());
        assert_eq!(a.contacts().closed(), b.contacts().closed());
    }
    assert!(pressed > 10, "{pressed}");
}

#[test]
fn runs_resumed_go_on_bit_for_bit() {
    let h = 0.25 / SOFT.wave_speed();
    let solver = || ConjugateGradients::default();
    let mut run = falling(solver(), h);
    for _ in 0..30 {
        run.step().unwrap();
    }
    let (state, history) = (run.state().clone(), run.history().clone());
    let mut other = scene(solver(), h).resume(state, history).build().unwrap();
    for _ in 0..20 {
        run.step().unwrap();
        other.step().unwrap();
        assert_eq!(run.state().displacement(), other.state().displacement());
        assert_eq!(run.state().contacts().forces(), other.state().contacts().forces());
    }
}

#[test]
fn a_solve_that_fails_leaves_the_step_undone() {
    // Enough iterations for free flight, where the increment is zero, and not for the impact.
    let h = 0.5 / SOFT.wave_speed();
    let stingy = || ConjugateGradients::default().iterations(1).tolerance(1e-9).unwrap();
    // Contact responses are solved for when a contact first presses; building needs none of them.
    let mut run = falling(stingy(), h);
    let error = loop {
        let before = (run.time(), run.state().displacement().to_vec(), run.state().velocity().to_vec());
        let books = run.energy().total();
        match run.step() {
            Ok(()) => assert!(run.time() < 100.0 * h, "never in contact"),
            Err(error) => {
                let after = (run.time(), run.state().displacement().to_vec(), run.state().velocity().to_vec());
                assert_eq!(before, after);
                assert_eq!(books.to_bits(), run.energy().total().to_bits());
                // And again the same: nothing is kept of what was not solved for.
                let second = run.step().unwrap_err();
                assert_eq!(error.to_string(), second.to_string());
                break error;
            }
        }
    };
    assert!(matches!(error, Error::LinearNotConverged { iterations: 1, .. }), "{error:?}");
}

/// Conjugate gradients that refuse one of their solves, counted from now: there are so many before it.
#[derive(Clone, Debug, Default)]
struct Refusing(Arc<AtomicUsize>);

#[derive(Debug)]
struct RefusingFactor(Box<dyn Factorization<f64>>, Refusing);

impl LinearSolver<f64> for Refusing {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<f64>>> {
        Ok(Box::new(RefusingFactor(ConjugateGradients::default().analyze(pattern, last)?, self.clone())))
    }
}

impl Factorization<f64> for RefusingFactor {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<()> {
        self.0.factorize(a)
    }
    fn solve(&mut self, rhs: &mut [f64]) -> Result<()> {
        match self.1.0.fetch_sub(1, Ordering::Relaxed) {
            0 => Err(Error::Inadmissible { callback: "linear solver", source: "refused".into() }),
            _ => self.0.solve(rhs),
        }
    }
    fn stored_values(&self) -> usize {
        self.0.stored_values()
    }
}

#[test]
fn a_step_is_undone_whichever_of_its_solves_fails() {
    let h = 0.25 / SOFT.wave_speed();
    let refusing = Refusing::default();
    refusing.0.store(usize::MAX, Ordering::Relaxed);
    // With responses to forces, which are solves too.
    let with_w = ActiveSet::default().with_assembly(Assembly::Always);
    let mut run = scene(refusing.clone(), h).contact_solver(with_w.clone()).build().unwrap();
    let mut expected = scene(ConjugateGradients::default(), h).contact_solver(with_w).build().unwrap();
    let mut most = 0;
    for _ in 0..25 {
        expected.step().unwrap();
        let before = run.state().clone();
        let mut refused = 0;
        loop {
            // Responses that have been solved for are kept: the count of solves is not that of a step that succeeds at
            // once.
            refusing.0.store(refused, Ordering::Relaxed);
            match run.step() {
                Ok(()) => break,
                Err(error) => {
                    assert!(matches!(error, Error::Inadmissible { .. }), "{error:?}");
                    let after = run.state();
                    assert_eq!(before.displacement(), after.displacement());
                    assert_eq!(before.velocity(), after.velocity());
                    assert_eq!(before.contacts().forces(), after.contacts().forces());
                }
            }
            refused += 1;
        }
        most = most.max(refused);
        assert_eq!(run.state().displacement(), expected.state().displacement(), "t = {}", run.time());
        assert_eq!(run.state().velocity(), expected.state().velocity());
        assert_eq!(run.state().contacts().forces(), expected.state().contacts().forces());
    }
    // Before contact, for its responses and after it.
    assert!(most >= 3, "{most}");
}

#[test]
fn step_control_finds_a_step_at_which_the_iteration_converges() {
    let spring = || LinearSystem::lumped(vec![1.0; 60], matrix(60, chain(60, 0.0))).unwrap();
    let build = |solver: ConjugateGradients, control: bool| {
        let builder = Simulation::builder(spring(), Newmark::trapezoidal(), 8.0)
            .velocity((0..60).map(|i| f64::from(u8::from(i < 5))).collect())
            .linear_solver(solver);
        let builder = if control { builder.step_control(StepControl::halving(0.01).unwrap()) } else { builder };
        builder.build().unwrap()
    };
    let solver = ConjugateGradients::default().iterations(10);
    assert!(matches!(build(solver, false).step(), Err(Error::LinearNotConverged { .. })));
    let mut run = build(solver, true);
    run.step().unwrap();
    assert!(run.step_size() < 8.0 && run.step_size() > 0.01, "{}", run.step_size());
}

#[test]
fn a_body_beside_the_contact_may_iterate() {
    // Two chains: one in contact, condensed by Cholesky, the other free, solved for by iteration, which may fail.
    let (n, m) = (20, 30);
    let springs = chain(n, 0.0).into_iter().chain(chain(m, 0.0).into_iter().map(|(i, j, x)| (n + i, n + j, x)));
    let a: Matrix<f64> = matrix(n + m, springs);
    let build = |iterations: usize, iterative: bool| {
        let mut solver = ByBody::<f64>::default();
        if iterative {
            solver = solver.body([n], ConjugateGradients::default().iterations(iterations));
        }
        let velocity = (0..n + m).map(|i| if i < n { -0.1 } else { f64::from(u8::from(i == n)) }).collect();
        Simulation::builder(LinearSystem::lumped(vec![1.0; n + m], a.clone()).unwrap(), Newmark::trapezoidal(), 1.0)
            .velocity(velocity)
            .constraint(contact_dynamics::LinearRows::new().unilateral(&[(0, 1.0)], 0.05))
            .linear_solver(solver)
            .build()
            .unwrap()
    };
    let (mut iterated, mut direct) = (build(1000, true), build(1000, false));
    for _ in 0..30 {
        iterated.step().unwrap();
        direct.step().unwrap();
        assert!(difference(iterated.state().displacement(), direct.state().displacement()) < 1e-8);
    }
    assert!(direct.statistics().contact_changes > 0);
    let mut stingy = build(3, true);
    let before = stingy.state().displacement().to_vec();
    assert!(matches!(stingy.step(), Err(Error::LinearNotConverged { iterations: 3, .. })));
    assert_eq!(before, stingy.state().displacement());
}

#[test]
fn the_view_of_a_matrix_may_change_its_values_only() {
    // The same analysis serves other values, as for every solver.
    let a = matrix::<f64>(50, chain(50, 0.1));
    let mut factor = factorized(&ConjugateGradients::default(), &a);
    let doubled: Vec<f64> = a.val().iter().map(|x| 2.0 * x).collect();
    let mut x = rhs::<f64>(50);
    factor.solve(&mut x).unwrap();
    factor.factorize(SparseColMatRef::new(a.symbolic(), &doubled)).unwrap();
    let mut half = rhs::<f64>(50);
    factor.solve(&mut half).unwrap();
    assert!(half.iter().zip(&x).all(|(half, x)| (2.0 * half - x).abs() < 1e-12));
}
