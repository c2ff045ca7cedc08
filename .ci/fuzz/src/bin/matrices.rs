//! Sparse matrices of any pattern and values: solvers refuse them, or solve. A solution of a matrix whose diagonal
//! dominates, or of the pivoting factorization, has a small residual.

#![no_main]

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::linear_solver::Ordering;
use contact_dynamics::{
    Automatic, ByBody, Cholesky, ConjugateGradients, Diagonal, Factorization, LinearSolver, Lu, Tridiagonal,
};
use contact_dynamics_scenes::sparse::entries;
use fuzz::Input;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut input = Input(bytes);
    let n = 1 + input.below(9);
    let a = input.matrix(n);
    let other = if input.below(8) == 0 { input.matrix(n) } else { a.clone() };
    let mut last: Vec<_> = (0..input.below(4)).map(|_| input.below(n + 1)).collect();
    if input.below(8) > 0 {
        last.sort_unstable();
        last.dedup();
        last.retain(|&dof| dof < n);
    }
    let rhs = input.numbers(n);
    let solvers: [(&str, Box<dyn LinearSolver<f64>>); 7] = [
        ("Cholesky", Box::new(Cholesky::default())),
        ("dissection", Box::new(Cholesky::ordered(Ordering::NestedDissection))),
        ("LU", Box::new(Lu)),
        ("tridiagonal", Box::new(Tridiagonal)),
        ("diagonal", Box::new(Diagonal)),
        ("conjugate gradients", Box::new(ConjugateGradients::default())),
        ("by body", Box::new(ByBody::new(Automatic))),
    ];
    for (name, solver) in solvers {
        let Ok(mut factor) = solver.analyze(a.symbolic(), &last) else { continue };
        if factor.factorize(other.as_ref()).is_err() || factor.factorize(a.as_ref()).is_err() {
            continue;
        }
        let mut x = rhs.clone();
        if factor.solve(&mut x).is_ok() && (name == "LU" || dominates(&a)) {
            check(name, &a, &x, &rhs);
        }
        condense(name, &mut *factor, &a, &last, &rhs);
    }
});

/// Whether each diagonal entry is twice as large as the others of its row together, and the matrix symmetric.
fn dominates(a: &SparseColMat<usize, f64>) -> bool {
    let mut rows = vec![[0.0; 2]; a.nrows()];
    let all = entries(a);
    for &(i, j, value) in &all {
        rows[i][usize::from(i != j)] += if i == j { value } else { value.abs() };
    }
    let is_symmetric = all.iter().all(|&(i, j, value)| all.contains(&(j, i, value)));
    is_symmetric && rows.iter().all(|[diagonal, others]| *diagonal > 2.0 * others)
}

fn check(name: &str, a: &SparseColMat<usize, f64>, x: &[f64], rhs: &[f64]) {
    let largest = |x: &mut dyn Iterator<Item = f64>| x.fold(0.0_f64, |most, x| most.max(x.abs()));
    let values = entries(a);
    let sizes =
        [largest(&mut values.iter().map(|e| e.2)), largest(&mut x.iter().copied()), largest(&mut rhs.iter().copied())];
    let smallest = values.iter().map(|e| e.2.abs()).filter(|x| *x > 0.0).fold(f64::MAX, f64::min);
    // (Where products leave the range of numbers there is no rounding to speak of.)
    let ranges = sizes.iter().chain(&[smallest]).all(|size| *size == 0.0 || (1e-100..1e100).contains(size));
    if !ranges || !x.iter().all(|x| x.is_finite()) {
        return;
    }
    let mut residual: Vec<_> = rhs.iter().map(|b| -b).collect();
    for (i, j, value) in values {
        residual[i] += value * x[j];
    }
    let miss = largest(&mut residual.into_iter());
    assert!(miss <= 1e-9 * (sizes[0] * sizes[1] + sizes[2]), "{name}: {a:?} x = {rhs:?} is missed by {miss:e}, {x:?}");
}

/// Contact's half of a solve is the solve.
fn condense(
    name: &str,
    factor: &mut dyn Factorization<f64>,
    a: &SparseColMat<usize, f64>,
    last: &[usize],
    rhs: &[f64],
) {
    let Some(condensation) = factor.condensation() else { return };
    let (mut x, mut interface) = (vec![0.0; rhs.len()], vec![0.0; last.len()]);
    if condensation.condense(rhs, &mut interface).is_ok()
        && condensation.expand(&interface, &mut x).is_ok()
        && dominates(a)
    {
        check(name, a, &x, rhs);
    }
}
