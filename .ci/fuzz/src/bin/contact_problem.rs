//! Contact problems, with cones: whatever W, q, sets, tolerances and guess are, a solver that takes the sets returns
//! multipliers that are numbers or an error; on a semidefinite W of moderate numbers they meet the conditions.

#![no_main]

use contact_dynamics::contact_solver::{
    ActiveSet, AdmissibleSet, ContactProblem, ContactSolver, GaussSeidel, Pivoting,
};
use fuzz::Input;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut input = Input(bytes);
    let sets: Vec<_> = (0..1 + input.below(5)).map(|_| set(&mut input)).collect();
    let size: usize = sets.iter().map(|set| set.rows()).sum();
    let is_plain = input.below(4) > 0;
    let number = |input: &mut Input<'_>| match is_plain {
        true => f64::from(input.byte().cast_signed()) / 16.0,
        false => input.number(),
    };
    let w: Vec<_> = match is_plain {
        // Bᵀ B, with fewer rows than columns at times, so that contacts are there twice; some have the same column.
        true => {
            let rank = 1 + input.below(size + 2);
            let mut columns: Vec<Vec<_>> = (0..size).map(|_| (0..rank).map(|_| number(&mut input)).collect()).collect();
            if input.below(4) == 0 {
                columns[size - 1] = columns[0].clone();
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum();
            columns.iter().flat_map(|a| columns.iter().map(move |b| dot(a, b))).collect()
        }
        false => (0..size * size).map(|_| number(&mut input)).collect(),
    };
    let q: Vec<_> = (0..size).map(|_| number(&mut input)).collect();
    let tolerance: Vec<_> = (0..size).map(|_| if is_plain { 1e-12 } else { number(&mut input) }).collect();
    let guess: Vec<_> = (0..size).map(|_| if input.flag() { number(&mut input) } else { 0.0 }).collect();
    let Ok(problem) = ContactProblem::new(&w, &q, &sets, &tolerance) else { return };

    let solvers: [Box<dyn ContactSolver<f64>>; 3] = [
        Box::new(ActiveSet::default()),
        Box::new(GaussSeidel::default()),
        Box::new(Pivoting::default()),
    ];
    let scale = q.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    for mut solver in solvers {
        if !sets.iter().all(|&set| solver.admits(set)) {
            continue;
        }
        let mut lambda = guess.clone();
        if solver.solve(&problem, &mut lambda).is_ok() {
            assert!(lambda.iter().all(|x| x.is_finite()), "{solver:?}: {problem:?} → {lambda:?}");
            if is_plain {
                // (Rows that contradict each other by an angle of √ε are met as well as they can be, and forces of
                // cones may grow until their rounding is that share of q: `BlockAcceptance`.)
                let (row, miss) = problem.residual(&lambda);
                let share = if problem.has_cones() { 64.0 * f64::EPSILON.powf(0.4) } else { 1e-7 };
                let accepted = share * scale + 2.0 * problem.rounding(row, &lambda);
                assert!(miss <= accepted, "{solver:?}: {problem:?} → {lambda:?} misses row {row} by {miss:e}");
            }
        }
    }
});

fn set(input: &mut Input<'_>) -> AdmissibleSet {
    let friction = f64::from(input.byte()) / 100.0;
    match input.below(12) {
        0 | 1 => AdmissibleSet::Free,
        2 | 3 => AdmissibleSet::Cone2 { friction },
        4 => AdmissibleSet::Cone3 { friction },
        5 => AdmissibleSet::Cone3 { friction: input.number() },
        _ => AdmissibleSet::NonNegative,
    }
}
