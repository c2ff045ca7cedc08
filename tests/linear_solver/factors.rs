//! Linear solvers on every kind of factor: chains, arrows, grids (simplicial and supernodal), dense blocks; both
//! precisions.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::faer::sparse::SparseColMatRef;
use contact_dynamics::{
    Automatic, ByBody, Cholesky, ConjugateGradients, Diagonal, Error, Factorization, LinearSolver, Lu, Real, Result,
    Tridiagonal,
};
use contact_dynamics_scenes::hosts::Uncondensed;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{matrix, spring};

/// A symmetric positive definite matrix with the given pairs as off-diagonal entries.
fn tied<T: Real>(n: usize, pairs: &[(usize, usize)], shift: f64) -> SparseColMat<usize, T> {
    let stiffness = |k: usize| 1.0 + 0.5 * ((k * 37 % 11) as f64);
    let ties = pairs.iter().enumerate().flat_map(|(k, &(i, j))| spring(i, j, stiffness(k)));
    matrix(n, (0..n).map(|i| (i, i, shift)).chain(ties))
}

fn chain(n: usize) -> Vec<(usize, usize)> {
    (1..n).map(|i| (i - 1, i)).collect()
}

/// A chain whose nodes are numbered at random: the elimination order is not the given one.
fn shuffled_chain(n: usize) -> Vec<(usize, usize)> {
    (1..n).map(|i| ((i - 1) * 7 % n, i * 7 % n)).collect()
}

fn arrow(n: usize) -> Vec<(usize, usize)> {
    (0..n - 1).map(|i| (i, n - 1)).chain(chain(n - 1)).collect()
}

fn grid(side: usize) -> Vec<(usize, usize)> {
    let at = |x: usize, y: usize| x + side * y;
    let mut pairs = Vec::new();
    for y in 0..side {
        for x in 0..side {
            // Eight neighbors: enough fill for a supernodal factor on the larger grid.
            let right = (x + 1 < side).then(|| (at(x, y), at(x + 1, y)));
            let up = (y + 1 < side).then(|| (at(x, y), at(x, y + 1)));
            let diagonal = (x + 1 < side && y + 1 < side).then(|| (at(x, y), at(x + 1, y + 1)));
            pairs.extend([right, up, diagonal].into_iter().flatten());
        }
    }
    pairs
}

/// A cube in which every node has 26 neighbors.
fn cube(side: usize) -> Vec<(usize, usize)> {
    let n = side * side * side;
    let place = move |dof: usize| [dof % side, dof / side % side, dof / (side * side)];
    let near = move |i: usize, j: usize| place(i).iter().zip(place(j)).all(|(a, b)| a.abs_diff(b) <= 1);
    let reach = 1 + side + side * side;
    (0..n).flat_map(|j| (j + 1..n.min(j + reach + 1)).map(move |i| (j, i))).filter(|&(i, j)| near(i, j)).collect()
}

fn dense(n: usize) -> Vec<(usize, usize)> {
    (0..n).flat_map(|i| (0..i).map(move |j| (j, i))).collect()
}

fn check<T: Real>(solver: &dyn LinearSolver<T>, n: usize, pairs: &[(usize, usize)], tolerance: f64) {
    let pattern_of = tied::<T>(n, pairs, 0.1);
    let mut factor = solver.analyze(pattern_of.symbolic(), &[]).unwrap();
    assert!(factor.stored_values() >= n);
    // The same analysis serves other values, after what factorizations need was freed too.
    for (shift, released) in [(0.1, false), (3.0, true), (0.5, false)] {
        let a = tied::<T>(n, pairs, shift);
        factor.factorize(a.as_ref()).unwrap();
        if released {
            factor.release();
        }
        for columns in [1, 3, 8, 13, 17] {
            let x: Vec<T> = (0..n * columns).map(|i| T::of((i as f64 * 0.7).sin())).collect();
            let mut b = vec![T::zero(); n * columns];
            for (x, b) in x.chunks(n).zip(b.chunks_mut(n)) {
                for (j, &xj) in x.iter().enumerate() {
                    let a = a.as_ref();
                    for (&i, &value) in a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)) {
                        b[i] += value * xj;
                    }
                }
            }
            factor.solve(&mut b).unwrap();
            let worst = b.iter().zip(&x).map(|(&b, &x)| (b - x).abs().value()).fold(0.0, f64::max);
            assert!(worst < tolerance, "{n} dofs, {} pairs, {columns} columns: {worst:e}", pairs.len());
        }
    }
}

#[test]
fn solutions_are_right_whatever_the_structure() {
    let cases: [(usize, Vec<(usize, usize)>); 8] = [
        (1, vec![]),
        (7, vec![]),
        (2, chain(2)),
        (50, chain(50)),
        (50, shuffled_chain(50)),
        (40, arrow(40)),
        (900, grid(30)),
        (60, dense(60)),
    ];
    for (n, pairs) in cases {
        check::<f64>(&Automatic, n, &pairs, 1e-10);
        check::<f32>(&Automatic, n, &pairs, 5e-2);
    }
    for (n, pairs) in bodies() {
        check::<f64>(&ByBody::default(), n, &pairs, 1e-10);
        check::<f32>(&ByBody::default(), n, &pairs, 5e-2);
    }
}

/// Systems of several bodies: side by side, with numbers strewn about, with dofs that belong to none, and a single one.
fn bodies() -> Vec<(usize, Vec<(usize, usize)>)> {
    let behind = |first: usize, pairs: Vec<(usize, usize)>| pairs.into_iter().map(move |(i, j)| (first + i, first + j));
    let side_by_side: Vec<_> = chain(20).into_iter().chain(behind(20, grid(20))).collect();
    let with_single_dofs: Vec<_> = behind(3, chain(15)).chain(behind(25, arrow(12))).collect();
    // Dof k of body b has the number 3 k + b: nothing is side by side.
    let alternating = (0..3).flat_map(|b| grid(8).into_iter().map(move |(i, j)| (3 * i + b, 3 * j + b))).collect();
    let thousands: Vec<_> = (0..1000).map(|k| (2 * k, 2 * k + 1)).chain([(2001, 4001)]).collect();
    vec![
        (1, vec![]),
        (7, vec![]),
        (50, chain(50)),
        (420, side_by_side),
        (40, with_single_dofs),
        (192, alternating),
        (4002, thousands),
    ]
}

#[test]
fn cholesky_refuses_what_is_not_symmetric_positive_definite() {
    for pairs in [chain(30), grid(30), dense(30)] {
        let n = 1 + pairs.iter().map(|&(i, j)| i.max(j)).max().unwrap();
        let good = tied::<f64>(n, &pairs, 1.0);
        let mut factor = LinearSolver::<f64>::analyze(&Cholesky::default(), good.symbolic(), &[]).unwrap();
        let (pattern, values) = good.into_parts();
        let broken = |change: &dyn Fn(usize, usize, f64) -> f64| {
            let mut values = values.clone();
            for j in 0..n {
                for at in pattern.as_ref().col_range(j) {
                    values[at] = change(pattern.row_idx()[at], j, values[at]);
                }
            }
            SparseColMat::new(pattern.clone(), values)
        };
        let negative = broken(&|i, j, x| if (i, j) == (5, 5) { -x } else { x });
        assert!(matches!(factor.factorize(negative.as_ref()), Err(Error::Singular { .. })));
        let one_sided = broken(&|i, j, x| if (i, j) == (1, 0) { 0.5 * x } else { x });
        assert!(matches!(factor.factorize(one_sided.as_ref()), Err(Error::Asymmetric { row: 1, column: 0, .. })));
        let infinite = broken(&|i, j, x| if (i, j) == (3, 3) { f64::INFINITY } else { x });
        assert!(matches!(factor.factorize(infinite.as_ref()), Err(Error::MatrixNotFinite { row: 3, column: 3, .. })));
        // A free body: its rigid mode leaves a pivot of rounding.
        let free = broken(&|i, j, x| if i == j { x - 1.0 } else { x });
        let found = factor.factorize(free.as_ref());
        assert!(matches!(found, Err(Error::Singular { .. })), "{found:?}");
        // A failure does not spoil the analysis.
        factor.factorize(SparseColMat::new(pattern.clone(), values.clone()).as_ref()).unwrap();
    }
}

#[test]
fn diagonal_solver_takes_diagonal_matrices_only() {
    let a = tied::<f64>(3, &[], 4.0);
    let mut factor = LinearSolver::<f64>::analyze(&Diagonal, a.symbolic(), &[]).unwrap();
    factor.factorize(a.as_ref()).unwrap();
    let mut x = [4.0, 8.0, -2.0, 1.0, 2.0, 3.0];
    factor.solve(&mut x).unwrap();
    assert!(x.iter().zip([1.0, 2.0, -0.5, 0.25, 0.5, 0.75]).all(|(x, y)| (x - y).abs() < 1e-15));
    let chain = tied::<f64>(3, &chain(3), 1.0);
    assert!(matches!(LinearSolver::<f64>::analyze(&Diagonal, chain.symbolic(), &[]), Err(Error::Incompatible { .. })));
    let zero = tied::<f64>(3, &[], 0.0);
    assert!(matches!(factor.factorize(zero.as_ref()), Err(Error::Singular { dof: 0, .. })));
}

#[test]
fn free_bodies_are_recognized_by_a_pivot_of_rounding() {
    // The last pivot of a free body is a rounding error of either sign: refused in every case, whatever the factor.
    for n in 2..60 {
        for pairs in [chain(n), shuffled_chain(n), arrow(n.max(3)), dense(n)] {
            let n = 1 + pairs.iter().map(|&(i, j)| i.max(j)).max().unwrap();
            let a = tied::<f64>(n, &pairs, 0.0);
            let mut factor = LinearSolver::<f64>::analyze(&Cholesky::default(), a.symbolic(), &[]).unwrap();
            let found = factor.factorize(a.as_ref());
            assert!(matches!(found, Err(Error::Singular { .. })), "{n} dofs, {} pairs", pairs.len());
        }
    }
}

/// Eliminates `last` last: the same solution in two halves, and S⁻¹ as the block of A⁻¹ on these dofs.
fn check_condensation<T: Real>(
    solver: &dyn LinearSolver<T>,
    n: usize,
    pairs: &[(usize, usize)],
    last: &[usize],
    tolerance: f64,
) {
    let a = tied::<T>(n, pairs, 0.1);
    let mut plain = LinearSolver::<T>::analyze(&Automatic, a.symbolic(), &[]).unwrap();
    let mut factor = solver.analyze(a.symbolic(), last).unwrap();
    plain.factorize(a.as_ref()).unwrap();
    factor.factorize(a.as_ref()).unwrap();
    let distance = |x: &[T], y: &[T]| {
        assert!(x.iter().all(|x| x.is_finite()));
        x.iter().zip(y).map(|(&x, &y)| (x - y).abs().value()).fold(0.0, f64::max)
    };

    let rhs: Vec<T> = (0..n).map(|i| T::of((i as f64 * 0.7).sin())).collect();
    let mut expected = rhs.clone();
    plain.solve(&mut expected).unwrap();
    let mut x = rhs.clone();
    factor.solve(&mut x).unwrap();
    assert!(distance(&x, &expected) < tolerance, "{n} dofs, last {last:?}");

    let condensed = factor.condensation().unwrap();
    let mut interface = vec![T::zero(); last.len()];
    // Twice: nothing of the first must be left in the second.
    for _ in 0..2 {
        condensed.condense(&rhs, &mut interface).unwrap();
        let on_interface: Vec<T> = last.iter().map(|&dof| expected[dof]).collect();
        assert!(distance(&interface, &on_interface) < tolerance, "{n} dofs, last {last:?}");
        // All of it is written.
        x.fill(T::nan());
        condensed.expand(&interface, &mut x).unwrap();
        assert!(distance(&x, &expected) < tolerance, "{n} dofs, last {last:?}");
    }
    // Unit forces, all at once and one by one.
    let m = last.len();
    let mut block = vec![T::zero(); m * m];
    (0..m).for_each(|i| block[i + i * m] = T::one());
    condensed.solve(&mut block).unwrap();
    for (column, &dof) in last.iter().enumerate() {
        let mut response = vec![T::zero(); n];
        response[dof] = T::one();
        plain.solve(&mut response).unwrap();
        let expected: Vec<T> = last.iter().map(|&dof| response[dof]).collect();
        let mut alone = vec![T::zero(); m];
        alone[column] = T::one();
        condensed.solve(&mut alone).unwrap();
        assert!(distance(&block[column * m..(column + 1) * m], &expected) < tolerance);
        assert!(distance(&alone, &expected) < tolerance);
    }
    // A force on the interface, applied between the halves.
    if let Some(&dof) = last.first() {
        let mut pushed = rhs.clone();
        pushed[dof] += T::of(2.5);
        plain.solve(&mut pushed).unwrap();
        condensed.condense(&rhs, &mut interface).unwrap();
        interface.iter_mut().zip(&block).for_each(|(x, &response)| *x += T::of(2.5) * response);
        x.fill(T::nan());
        condensed.expand(&interface, &mut x).unwrap();
        assert!(distance(&x, &pushed) < tolerance);
        for (&dof, &value) in last.iter().zip(&interface) {
            assert_eq!(x[dof], value);
        }
    }
}

#[test]
fn condensation_is_the_same_solution_in_two_halves() {
    let cases: [(usize, Vec<(usize, usize)>); 7] = [
        (1, vec![]),
        (6, vec![]),
        (40, chain(40)),
        (40, shuffled_chain(40)),
        (25, arrow(25)),
        (900, grid(30)),
        (30, dense(30)),
    ];
    for (n, pairs) in cases {
        let ends = if n > 1 { vec![0, n - 1] } else { vec![0] };
        // One side of the grid, two zones far apart, dofs strewn about, all of them, none.
        let side: Vec<usize> = (0..n.min(30)).collect();
        let zones: Vec<usize> = (0..n.min(12)).chain(n.saturating_sub(10).max(n.min(12))..n).collect();
        let strewn: Vec<usize> = (0..n).step_by(7).collect();
        let all: Vec<usize> = (0..n.min(60)).collect();
        for last in [vec![], ends, side, zones, strewn, all] {
            check_condensation::<f64>(&Automatic, n, &pairs, &last, 1e-11);
            check_condensation::<f32>(&Automatic, n, &pairs, &last, 2e-3);
        }
    }
}

/// Large enough that branches of the factor are swept apart.
#[test]
fn large_bodies_are_the_same_solution_in_two_halves() {
    let (n, pairs) = (24 * 24 * 24, cube(24));
    for last in [vec![], vec![0, n - 1], (0..24).collect(), (0..n).step_by(701).collect()] {
        check_condensation::<f64>(&Cholesky::default(), n, &pairs, &last, 1e-11);
    }
    check_condensation::<f32>(&Cholesky::default(), n, &pairs, &[5, 900, n - 3], 2e-3);
}

#[test]
fn bodies_are_condensed_one_by_one() {
    for (n, pairs) in bodies() {
        // On all bodies, on one alone, strewn about, at one end, none.
        let across: Vec<usize> = (0..n).step_by(1 + n / 40).collect();
        let strewn: Vec<usize> = (0..n).step_by(7).take(60).collect();
        for last in [across, vec![n / 2], strewn, (0..n.min(18)).collect(), vec![]] {
            check_condensation::<f64>(&ByBody::default(), n, &pairs, &last, 1e-11);
            check_condensation::<f32>(&ByBody::default(), n, &pairs, &last, 2e-3);
        }
    }
}

#[test]
fn every_body_may_have_its_own_solver() {
    // Chains of 5 and 6 dofs, a point mass (dof 5) between them.
    let pairs: Vec<_> = chain(5).into_iter().chain((7..12).map(|i| (i - 1, i))).collect();
    let a = tied::<f64>(12, &pairs, 0.5);
    let plain = Uncondensed::new(Cholesky::default());
    let analyzed = &plain.analyzed;
    for (dofs, expected) in [(vec![], vec![]), (vec![3], vec![5]), ((5..12).collect(), vec![6]), (vec![5], vec![])] {
        analyzed.lock().unwrap().clear();
        let solver = ByBody::new(Automatic).body(dofs.clone(), plain.clone());
        // Only a body that contact acts on needs a solver that condenses.
        for last in [vec![4], vec![5, 6], vec![4, 6]] {
            let mut factor = solver.analyze(a.symbolic(), &last).unwrap();
            let touched = expected.contains(&5) && last.contains(&4) || expected.contains(&6) && last.contains(&6);
            assert_eq!(factor.condensation().is_none(), touched, "{dofs:?}, {last:?}");
            if !touched {
                check_condensation::<f64>(&solver, 12, &pairs, &last, 1e-11);
            }
        }
        check::<f64>(&solver, 12, &pairs, 1e-11);
        analyzed.lock().unwrap().dedup();
        assert_eq!(*analyzed.lock().unwrap(), expected);
    }
    // A solver for all: point masses are divided through.
    analyzed.lock().unwrap().clear();
    ByBody::<f64>::new(plain.clone()).analyze(a.symbolic(), &[]).unwrap();
    assert_eq!(*analyzed.lock().unwrap(), [5, 6]);
    let refused = |solver: ByBody<'_, f64>| solver.analyze(a.symbolic(), &[]).map(|_| ()).unwrap_err();
    assert!(matches!(refused(ByBody::new(Diagonal)), Error::Incompatible { .. }));
    assert!(matches!(refused(ByBody::default().body([12], Diagonal)), Error::MissingDof { dof: 12, dofs: 12, .. }));
    let twice = ByBody::new(Automatic).body([0], Automatic).body([4], Automatic);
    assert!(refused(twice).to_string().contains("body of dof 4"));
}

#[test]
fn errors_of_a_body_name_dofs_of_the_system() {
    for (n, pairs) in bodies().into_iter().skip(3) {
        let (body, dof) = (pairs[pairs.len() - 1], pairs[pairs.len() - 1].1);
        let single = (0..n).find(|&i| pairs.iter().all(|&(a, b)| i != a && i != b));
        let good = tied::<f64>(n, &pairs, 1.0);
        let mut factor = ByBody::<f64>::default().analyze(good.symbolic(), &[0]).unwrap();
        let (pattern, values) = good.into_parts();
        let mut factorize = |change: &dyn Fn(usize, usize, f64) -> f64| {
            let mut values = values.clone();
            for j in 0..n {
                for at in pattern.as_ref().col_range(j) {
                    values[at] = change(pattern.row_idx()[at], j, values[at]);
                }
            }
            factor.factorize(SparseColMatRef::new(pattern.as_ref(), &values))
        };
        for bad in [dof].into_iter().chain(single) {
            let found = factorize(&|i, j, x| if i == bad && j == bad { -x } else { x });
            let named = |found| if single == Some(bad) { found == bad } else { pairs.iter().any(|p| p.1 == found) };
            assert!(
                matches!(found, Err(Error::Singular { dof, matrix: "effective matrix" }) if named(dof)),
                "{found:?}"
            );
        }
        let found = factorize(&|i, j, x| if (i, j) == body { f64::NAN } else { x });
        let here = |row: usize, column: usize| (row, column) == body;
        assert!(matches!(found, Err(Error::MatrixNotFinite { row, column, .. }) if here(row, column)), "{found:?}");
        let found = factorize(&|i, j, x| if (i, j) == body { 0.5 * x } else { x });
        let here = |row: usize, column: usize| here(row, column) || here(column, row);
        assert!(matches!(found, Err(Error::Asymmetric { row, column, .. }) if here(row, column)), "{found:?}");
        factorize(&|_, _, x| x).unwrap();
    }
    // Body by body a free one is found beside a stiff one.
    let pairs: Vec<_> = chain(5).into_iter().chain((6..10).map(|i| (i - 1, i))).collect();
    let a = tied::<f64>(10, &pairs, 0.0);
    let mut values = a.val().to_vec();
    values[a.symbolic().col_range(0).start] += 1.0;
    let mut factor = ByBody::<f64>::default().analyze(a.symbolic(), &[]).unwrap();
    let found = factor.factorize(SparseColMatRef::new(a.symbolic(), &values));
    assert!(matches!(found, Err(Error::Singular { dof: 5..10, .. })), "{found:?}");
    let other = tied::<f64>(10, &chain(10), 1.0);
    assert!(matches!(factor.factorize(other.as_ref()), Err(Error::Dimension { .. })));
}

/// Several strings of different lengths, a ring of two among single dofs; numbered upward, downward and strewn about.
#[test]
fn strings_are_solved_in_any_numbering() {
    let n = 61;
    let strings = [0..20, 20..21, 21..24, 24..60];
    let pairs: Vec<_> = strings.iter().flat_map(|string| string.clone().skip(1).map(|i| (i - 1, i))).collect();
    let numberings: [fn(usize) -> usize; 3] = [|i| i, |i| 60 - i, |i| i * 17 % 61];
    for number in numberings {
        let pairs: Vec<_> = pairs.iter().map(|&(i, j)| (number(i), number(j))).collect();
        check::<f64>(&Tridiagonal, n, &pairs, 1e-11);
        check::<f32>(&Tridiagonal, n, &pairs, 2e-3);
        // Contact at no end, at the ends of some strings, on several dofs of an end, on a whole string and a dof alone.
        for last in [vec![], vec![0], vec![19, 24], vec![57, 58, 59, 0, 1], vec![21, 22, 23, 60], (0..61).collect()] {
            let mut last: Vec<usize> = last.into_iter().map(number).collect();
            last.sort_unstable();
            check_condensation::<f64>(&Tridiagonal, n, &pairs, &last, 1e-11);
            check_condensation::<f32>(&Tridiagonal, n, &pairs, &last, 2e-3);
        }
    }
}

#[test]
fn what_is_no_string_is_refused_by_the_tridiagonal_solver() {
    let refused = |n: usize, pairs: &[(usize, usize)], last: &[usize]| {
        let a = tied::<f64>(n, pairs, 1.0);
        let analyzed: Result<Box<dyn Factorization<f64>>> = Tridiagonal.analyze(a.symbolic(), last);
        assert!(matches!(analyzed, Err(Error::Incompatible { .. })), "{pairs:?}, {last:?}");
        // The automatic choice takes another solver then, with the same solution.
        check_condensation::<f64>(&Automatic, n, pairs, last, 1e-11);
    };
    let ring: Vec<_> = chain(12).into_iter().chain([(11, 0)]).collect();
    refused(12, &ring, &[]);
    refused(15, &ring, &[]);
    refused(12, &arrow(12), &[11]);
    refused(12, &chain(12), &[5]);
    refused(12, &chain(12), &[0, 11]);
    refused(12, &chain(12), &[3, 10, 11]);

    // One-sided patterns are no strings; a matrix with unequal halves is refused when it is factorized.
    let one_sided = matrix::<f64>(2, [(0, 0, 2.0), (1, 0, -1.0), (1, 1, 2.0)]);
    let analyzed: Result<Box<dyn Factorization<f64>>> = Tridiagonal.analyze(one_sided.symbolic(), &[]);
    assert!(matches!(analyzed, Err(Error::Incompatible { .. })));
    let unequal = matrix(2, [(0, 0, 2.0), (1, 0, -1.0), (0, 1, -0.9), (1, 1, 2.0)]);
    let mut factor: Box<dyn Factorization<f64>> = Tridiagonal.analyze(unequal.symbolic(), &[]).unwrap();
    assert!(matches!(factor.factorize(unequal.as_ref()), Err(Error::Asymmetric { .. })));
}

#[test]
fn free_and_indefinite_strings_name_the_pivot() {
    let a = tied::<f64>(30, &chain(30), 0.0);
    let mut factor: Box<dyn Factorization<f64>> = Tridiagonal.analyze(a.symbolic(), &[]).unwrap();
    assert!(matches!(factor.factorize(a.as_ref()), Err(Error::Singular { dof: 29, .. })));
    let negative = tied::<f64>(30, &chain(30), -0.5);
    assert!(matches!(factor.factorize(negative.as_ref()), Err(Error::Singular { .. })));
    let mut values = a.val().to_vec();
    values[0] = f64::NAN;
    let broken = SparseColMat::new(a.symbolic().to_owned().unwrap(), values);
    assert!(factor.factorize(broken.as_ref()).is_err());
    // None of this spoils the analysis.
    let good = tied::<f64>(30, &chain(30), 1.0);
    factor.factorize(good.as_ref()).unwrap();
    let mut x = vec![1.0; 30];
    factor.solve(&mut x).unwrap();
    assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-14));
}

#[test]
fn contact_at_the_ends_of_chains_costs_no_fill() {
    // Two chains one behind the other with contact between them: as many values as without contact.
    let n = 200;
    let pairs: Vec<_> = chain(n).into_iter().filter(|&(i, _)| i != n / 2 - 1).collect();
    let a = tied::<f64>(n, &pairs, 0.1);
    let size = |last: &[usize]| LinearSolver::<f64>::analyze(&Automatic, a.symbolic(), last).unwrap().stored_values();
    assert_eq!(size(&[n / 2 - 1, n / 2]), size(&[]));
}

/// Assembly may leave an entry that is zero to rounding on one side of the diagonal alone: it is no part of the factor.
#[test]
fn entries_on_one_side_that_are_zero_to_rounding_change_nothing() {
    let block = Solid::block([1.0; 3], [6; 3], Material { young: 1.0, poisson: 0.3, density: 1.0 });
    let (k, n) = (block.stiffness::<f64>(), block.dofs());
    let entries =
        |j: usize| k.as_ref().row_idx_of_col_raw(j).iter().zip(k.val_of_col(j)).map(move |(&i, &x)| (i, j, x));
    let mut all: Vec<_> = (0..n).flat_map(entries).chain((0..n).map(|i| (i, i, 1.0))).collect();
    let assembled = matrix(n, all.clone());
    // Far from all others, below the diagonal and above it.
    all.extend((0..n).map(|i| (i, (i * 7 + 331) % n, 1e-20)));
    let strewn = matrix(n, all);
    assert!(strewn.val().len() > assembled.val().len());
    for last in [vec![], (0..60).collect::<Vec<_>>()] {
        let solution = |a: &SparseColMat<usize, f64>| {
            let mut factor: Box<dyn Factorization<f64>> = Cholesky::default().analyze(a.symbolic(), &last).unwrap();
            factor.factorize(a.as_ref()).unwrap();
            let mut x: Vec<f64> = (0..n).map(|i| (0.7 * i as f64).sin()).collect();
            factor.solve(&mut x).unwrap();
            x
        };
        let (x, y) = (solution(&assembled), solution(&strewn));
        assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-12), "{} last", last.len());
    }
}

#[test]
fn matrices_without_entries_are_singular() {
    let solvers: [(&str, Box<dyn LinearSolver<f64>>); 7] = [
        ("Cholesky", Box::new(Cholesky::default())),
        ("LU", Box::new(Lu)),
        ("tridiagonal", Box::new(Tridiagonal)),
        ("diagonal", Box::new(Diagonal)),
        ("conjugate gradients", Box::new(ConjugateGradients::default())),
        ("automatic", Box::new(Automatic)),
        ("by body", Box::new(ByBody::default())),
    ];
    for (name, solver) in solvers {
        for n in [1, 3] {
            let a = matrix::<f64>(n, []);
            let refused = solver.analyze(a.symbolic(), &[]).and_then(|mut factor| factor.factorize(a.as_ref()));
            assert!(matches!(refused, Err(Error::Singular { dof: 0, .. })), "{name}: {refused:?}");
        }
    }
}
