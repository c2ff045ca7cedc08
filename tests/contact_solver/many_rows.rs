//! Hundreds of rows that press together: solved by iteration where they are independent, and as exactly as few.

use contact_dynamics::Real;
use contact_dynamics::contact_solver::{ActiveSet, AdmissibleSet, ContactProblem, ContactSolver};
use contact_dynamics_scenes::random::Congruential;

/// The flexibility of nodes on a square grid, in units that differ by decades: falls off with their distance.
fn flexibility(side: usize, range: f64) -> Vec<f64> {
    let n = side * side;
    let place = |i: usize| [(i % side) as f64, (i / side) as f64];
    let unit = |i: usize| [1.0, 10.0, 0.1][i % 3];
    let entry = |i: usize, j: usize| {
        let distance = (place(i)[0] - place(j)[0]).hypot(place(i)[1] - place(j)[1]);
        unit(i) * unit(j) * (if i == j { 1.05 } else { 1.0 }) * (-distance / range).exp()
    };
    (0..n * n).map(|e| entry(e / n, e % n)).collect()
}

/// q for which these multipliers and gaps are the solution.
fn offset<T: Real>(w: &[T], multipliers: &[T], gaps: &[T]) -> Vec<T> {
    let n = multipliers.len();
    let product = |i: usize| w[i * n..(i + 1) * n].iter().zip(multipliers).map(|(&w, &l)| w * l).sum::<T>();
    (0..n).map(|i| gaps[i] - product(i)).collect()
}

/// A problem with a known solution, of which most rows press; some are free.
fn check<T: Real>(side: usize, exact: f64) {
    let n = side * side;
    let w: Vec<T> = flexibility(side, 3.0).into_iter().map(T::of).collect();
    let mut random = Congruential(7);
    let sets: Vec<AdmissibleSet> =
        (0..n).map(|i| if i % 11 == 0 { AdmissibleSet::Free } else { AdmissibleSet::NonNegative }).collect();
    let (mut multipliers, mut gaps) = (vec![T::zero(); n], vec![T::zero(); n]);
    for i in 0..n {
        let unit = w[i * n + i].sqrt();
        match (sets[i], random.within(0.0, 1.0) < 0.8) {
            (AdmissibleSet::Free, _) => multipliers[i] = T::of(random.within(-1.0, 1.0)) / unit,
            (_, true) => multipliers[i] = T::of(random.within(0.2, 1.0)) / unit,
            (_, false) => gaps[i] = T::of(random.within(0.2, 1.0)) * unit,
        }
    }
    let offset = offset(&w, &multipliers, &gaps);
    let tolerance = vec![T::zero(); n];
    let problem = |version| ContactProblem::new(&w, &offset, &sets, &tolerance).unwrap().with_version(version);
    let mut solver = ActiveSet::default();
    let mut cold = vec![T::zero(); n];
    solver.solve(&problem(3), &mut cold).unwrap();
    for i in 0..n {
        let unit = w[i * n + i].sqrt();
        let miss: f64 = ((cold[i] - multipliers[i]) * unit).abs().value();
        assert!(miss < exact, "{n} rows, row {i}: {miss:e}");
    }
    // What is kept from the last problem, or guessed, changes nothing.
    let mut kept = cold.clone();
    solver.solve(&problem(3), &mut kept).unwrap();
    let mut fresh = cold.clone();
    ActiveSet::default().solve(&problem(0), &mut fresh).unwrap();
    assert_eq!(kept, fresh);
}

#[test]
fn many_rows_are_solved_as_exactly_as_few() {
    for side in [9, 17, 22, 30] {
        check::<f64>(side, 1e-11);
        check::<f32>(side, 1e-3);
    }
}

#[test]
fn four_hundred_supports_of_a_rigid_table() {
    // Heave, pitch and roll alone: rank three. A load in the middle is shared.
    let side = 20;
    let n = side * side;
    let place = |i: usize| [1.0, (i % side) as f64 - 9.5, (i / side) as f64 - 9.5];
    let w: Vec<f64> = (0..n * n).map(|e| place(e / n).iter().zip(place(e % n)).map(|(a, b)| a * b).sum()).collect();
    let (offset, sets, tolerance) = (vec![-1.0; n], vec![AdmissibleSet::NonNegative; n], vec![1e-14; n]);
    let problem = ContactProblem::new(&w, &offset, &sets, &tolerance).unwrap();
    let mut lambda = vec![0.0; n];
    ActiveSet::default().solve(&problem, &mut lambda).unwrap();
    for axis in 0..3 {
        let carried: f64 = (0..n).map(|i| place(i)[axis] * lambda[i]).sum();
        let load = if axis == 0 { 1.0 } else { 0.0 };
        assert!((carried - load).abs() < 1e-11, "{axis}: {carried}");
    }
    // Of the many ways to carry it one without peaks.
    assert!(lambda.iter().all(|lambda| lambda * (n as f64) < 1.5), "{lambda:?}");
}

/// Stiffnesses over six decades along directions that have nothing to do with the rows: conjugate gradients do not end
/// in time, and no sparse approximate inverse helps them.
#[test]
fn rows_that_iteration_cannot_solve_for_are_solved_all_the_same() {
    let n = 280;
    let mut random = Congruential(11);
    let mut w: Vec<f64> =
        (0..n * n).map(|e| if e / n == e % n { 1e-6_f64.powf((e % n) as f64 / 279.0) } else { 0.0 }).collect();
    for _ in 0..3 {
        // W ← H W H with a reflection H = 1 − 2 v vᵀ.
        let v: Vec<f64> = (0..n).map(|_| random.signed()).collect();
        let length = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let v: Vec<f64> = v.iter().map(|v| v / length).collect();
        let wv: Vec<f64> = w.chunks_exact(n).map(|row| row.iter().zip(&v).map(|(w, v)| w * v).sum()).collect();
        let vwv: f64 = v.iter().zip(&wv).map(|(v, x)| v * x).sum();
        for (e, w) in w.iter_mut().enumerate() {
            let (i, j) = (e / n, e % n);
            *w += 4.0 * vwv * v[i] * v[j] - 2.0 * (v[i] * wv[j] + wv[i] * v[j]);
        }
    }
    // (Rounding has left it symmetric but for the last bits.)
    let w: Vec<f64> = (0..n * n).map(|e| 0.5 * (w[e] + w[e % n * n + e / n])).collect();
    let multipliers: Vec<f64> = (0..n).map(|_| random.within(0.2, 1.0)).collect();
    let offset = offset(&w, &multipliers, &vec![0.0; n]);
    let (sets, tolerance) = (vec![AdmissibleSet::NonNegative; n], vec![0.0; n]);
    let problem = ContactProblem::new(&w, &offset, &sets, &tolerance).unwrap();
    // All rows press, as is guessed: by the factor that takes one iteration. (Proximal steps would help, and be many.)
    let mut found = vec![1.0; n];
    let iterations = ActiveSet::default().solve(&problem, &mut found).unwrap();
    assert_eq!(iterations, 1);
    for (found, exact) in found.iter().zip(&multipliers) {
        assert!((found - exact).abs() < 1e-8, "{found} {exact}");
    }
}
