//! Lemke's pivoting: against the other solvers where there is one solution, on piles of boxes and other rows that
//! depend on one another, without a solution, in other units.

use contact_dynamics::Real;
use contact_dynamics::contact_solver::{
    ActiveSet, AdmissibleSet, ContactFailure, ContactProblem, ContactSolver, GaussSeidel, Lemke, Pivoting,
};
use contact_dynamics_scenes::boxes;
use contact_dynamics_scenes::random::Congruential;

/// B Bᵀ and B v, for B of so many columns.
fn semidefinite(random: &mut Congruential, size: usize, columns: usize) -> (Vec<f64>, Vec<f64>) {
    let (b, v) = (random.vector(size * columns, 1.0), random.vector(columns, 1.0));
    let row = |i: usize| &b[i * columns..(i + 1) * columns];
    let product = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let w = (0..size * size).map(|e| product(row(e / size), row(e % size))).collect();
    (w, (0..size).map(|i| product(row(i), &v)).collect())
}

/// The multipliers, and what they miss.
fn solve<T: Real>(
    solver: &mut dyn ContactSolver<T>,
    (w, q, sets): (&[T], &[T], &[AdmissibleSet]),
) -> Result<(Vec<T>, T), ContactFailure<T>> {
    let tolerance = vec![T::zero(); q.len()];
    let mut multipliers = vec![T::one(); q.len()];
    let problem = ContactProblem::new(w, q, sets, &tolerance).unwrap();
    solver.solve(&problem, &mut multipliers)?;
    let (_, residual) = problem.residual(&multipliers);
    Ok((multipliers, residual))
}

/// The largest difference of multipliers, each by how far it moves its own row.
fn far(w: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let diagonal = w.iter().step_by(a.len() + 1);
    diagonal.zip(a.iter().zip(b)).map(|(w, (a, b))| w * (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn agrees_with_newton_and_sweeps_where_one_solution_exists() {
    let mut random = Congruential(19);
    let mut lemke = Lemke::default();
    for trial in 0..200 {
        let contacts = 1 + trial % 20;
        let (size, friction) = (2 * contacts, 0.2 * random.unit());
        let (w, _) = semidefinite(&mut random, size, 3 * size);
        let q = random.vector(size, 1.0);
        let sets = vec![AdmissibleSet::Cone2 { friction }; contacts];
        let (found, residual) = solve(&mut lemke, (&w, &q, &sets)).unwrap();
        assert!(residual < 1e-13, "trial {trial}: {residual:e}");
        for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
            let (other, _) = solve(solver, (&w, &q, &sets)).unwrap();
            assert!(far(&w, &found, &other) < 1e-10, "trial {trial}, {solver:?}: {:e}", far(&w, &found, &other));
        }
    }
}

#[test]
fn rows_without_friction_stand_beside_contacts() {
    let mut random = Congruential(37);
    let kinds = [AdmissibleSet::NonNegative, AdmissibleSet::Cone2 { friction: 0.15 }, AdmissibleSet::Free];
    for trial in 0..100 {
        let sets: Vec<_> = (0..3 + trial % 9).map(|k| kinds[(k + trial) % 3]).collect();
        let size = sets.iter().map(|set| set.rows()).sum();
        let (w, _) = semidefinite(&mut random, size, 3 * size);
        let q = random.vector(size, 1.0);
        let (found, _) = solve(&mut Lemke::default(), (&w, &q, &sets)).unwrap();
        let (other, _) = solve(&mut ActiveSet::default(), (&w, &q, &sets)).unwrap();
        assert!(far(&w, &found, &other) < 1e-10, "trial {trial}: {:e}", far(&w, &found, &other));
        // And none at all.
        let sets: Vec<_> = (0..size).map(|row| kinds[row % 2 * 2]).collect();
        let (found, _) = solve(&mut Lemke::default(), (&w, &q, &sets)).unwrap();
        let (other, _) = solve(&mut Pivoting::default(), (&w, &q, &sets)).unwrap();
        assert!(far(&w, &found, &other) < 1e-10, "trial {trial}: {:e}", far(&w, &found, &other));
    }
}

/// Of a W that is not symmetric too, and however large the coefficients.
#[test]
fn definite_problems_have_a_solution_and_it_is_found() {
    let mut random = Congruential(43);
    for trial in 0..300 {
        let contacts = 1 + trial % 15;
        let size = 2 * contacts;
        let (mut w, _) = semidefinite(&mut random, size, size + 1);
        if trial % 2 == 1 {
            for (i, j) in (0..size).flat_map(|i| (0..i).map(move |j| (i, j))) {
                let skew = random.signed();
                w[i * size + j] += skew;
                w[j * size + i] -= skew;
            }
        }
        let q = random.vector(size, 1.0);
        let sets: Vec<_> = (0..contacts).map(|_| AdmissibleSet::Cone2 { friction: random.within(0.0, 3.0) }).collect();
        let (_, residual) = solve(&mut Lemke::default(), (&w, &q, &sets)).unwrap();
        assert!(residual < 1e-11, "trial {trial}: {residual:e}");
    }
}

#[test]
fn rows_that_depend_on_one_another_are_met() {
    let mut random = Congruential(53);
    for trial in 0..300 {
        let sets: Vec<_> = (0..=trial % 20)
            .map(|_| match random.unit() {
                tie if tie < 0.1 => AdmissibleSet::Free,
                plain if plain < 0.3 => AdmissibleSet::NonNegative,
                _ => AdmissibleSet::Cone2 { friction: random.within(0.0, 1.2) },
            })
            .collect();
        let size: usize = sets.iter().map(|set| set.rows()).sum();
        let (w, q) = semidefinite(&mut random, size, 1 + size / 2);
        let (_, residual) = solve(&mut Lemke::default(), (&w, &q, &sets)).unwrap();
        assert!(residual < 1e-10, "trial {trial}: {residual:e}");
    }
}

/// In the plane, and in space between walls without friction, where there are twice the corners; some so regular that
/// there are ties everywhere.
#[test]
fn piles_of_rigid_boxes_stand_and_slide() {
    let mut random = Congruential(41);
    let mut lemke = Lemke::default();
    for trial in 0..120 {
        let (height, regular) = (1 + trial % 12, trial % 4 == 0);
        let shift = if regular { 0.0 } else { 0.1 };
        let shifts: Vec<[f64; 2]> = (0..height).map(|_| [shift * random.signed(), 0.0]).collect();
        let free: Vec<f64> = (0..6 * height)
            .map(|k| match k % 6 {
                2 => -1.0,
                0 | 1 => 0.5 * random.signed(),
                _ => 0.1 * random.signed(),
            })
            .map(|v| if regular { (2.0 * v).round() / 2.0 } else { v })
            .collect();
        let mut rows = boxes::pile(&shifts);
        match trial % 3 {
            0 => rows = rows.into_iter().enumerate().filter(|(row, _)| row % 3 < 2).map(|(_, row)| row).collect(),
            _ => rows = boxes::in_plane(rows),
        }
        let (w, q) = boxes::problem(&rows, &free);
        let sets = vec![AdmissibleSet::Cone2 { friction: 0.3 + 0.1 * f64::from(trial % 5) }; q.len() / 2];
        let (_, residual) = solve(&mut lemke, (&w, &q, &sets)).unwrap();
        assert!(residual < 1e-11, "trial {trial}, {height} boxes: {residual:e}");
    }
}

/// A body with one way to move, along which the contact closes only while friction opens it: sliding, the force needed
/// is negative, and sticking would stop what moves along.
#[test]
fn a_contact_that_jams_is_a_failure_and_no_panic() {
    let w = [1.0, 1.0, 1.0, 1.0];
    let q = [-1.0, 0.5];
    let failed = solve(&mut Lemke::<f64>::default(), (&w, &q, &[AdmissibleSet::Cone2 { friction: 2.0 }]));
    let Err(ContactFailure::Jammed { row: 0, friction, normal, coupling }) = failed else { panic!("{failed:?}") };
    assert!((friction - 2.0).abs() < 1e-15 && (normal - 1.0_f64).abs() < 1e-15 && (coupling - 1.0_f64).abs() < 1e-15);
    // Less friction lets it slide; a body with two ways to move sticks.
    let (found, _) = solve(&mut Lemke::<f64>::default(), (&w, &q, &[AdmissibleSet::Cone2 { friction: 0.5 }])).unwrap();
    assert!((found[0] - 2.0).abs() < 1e-14 && (found[1] + 1.0).abs() < 1e-14, "{found:?}");
    let w = [1.0, 1.0, 1.0, 1.1];
    let (found, residual) = solve(&mut Lemke::default(), (&w, &q, &[AdmissibleSet::Cone2 { friction: 2.0 }])).unwrap();
    assert!(residual < 1e-14 && found[0] > 0.0, "{found:?}");
}

#[test]
fn contradictions_are_proven() {
    let coulomb = AdmissibleSet::Cone2 { friction: 0.3 };
    // Two obstacles closer than the body is thick, and a contact elsewhere.
    let w = [1.0, -1.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let sets = [AdmissibleSet::NonNegative, AdmissibleSet::NonNegative, coulomb];
    let failed = solve(&mut Lemke::<f64>::default(), (&w, &[-1.0, 0.5, -1.0, 2.0], &sets));
    let Err(ContactFailure::Contradictory { row, other, residual }) = failed else { panic!("{failed:?}") };
    assert!(row + other == 1 && row != other && (residual - 0.25).abs() < 1e-15, "{failed:?}");
    // Of directions whose products are rounded, in any unit of compliance.
    for scale in [1e-9, 1.0, 1e9] {
        let rows = [1.0, -0.3, 0.7];
        let w: Vec<f64> = rows.iter().flat_map(|x| rows.map(|y| scale * x * y)).collect();
        let failed = solve(&mut Lemke::<f64>::default(), (&w, &[-1.0, 0.2, 1.0], &[AdmissibleSet::NonNegative; 3]));
        let Err(ContactFailure::Contradictory { row, other, .. }) = failed else { panic!("{scale:e}: {failed:?}") };
        assert_eq!([row.min(other), row.max(other)], [0, 1], "{scale:e}");
    }
    // With room between them there is none.
    assert!(solve(&mut Lemke::default(), (&w, &[-1.0, 1.5, -1.0, 2.0], &sets)).is_ok());
}

/// Rows without friction, for which another method has a proof of its own.
#[test]
fn contradictions_are_those_of_pivoting() {
    let mut random = Congruential(61);
    let (mut solved, mut refused) = (0, 0);
    for trial in 0..300 {
        let size = 2 + trial % 12;
        let (w, mut q) = semidefinite(&mut random, size, 1 + size / 2);
        for q in &mut q {
            *q += 0.1 * random.signed();
        }
        let sets = vec![AdmissibleSet::NonNegative; size];
        let outcomes = [&mut Lemke::default() as &mut dyn ContactSolver<f64>, &mut Pivoting::default()]
            .map(|solver| solve(solver, (&w, &q, &sets)));
        match &outcomes {
            [Ok(_), Ok(_)] => solved += 1,
            [Err(ContactFailure::Contradictory { .. }), Err(ContactFailure::Contradictory { .. })] => refused += 1,
            _ => panic!("trial {trial}: {outcomes:?}"),
        }
    }
    assert!(solved > 50 && refused > 50, "{solved} {refused}");
}

#[test]
fn units_do_not_matter() {
    let mut random = Congruential(29);
    let (w, q) = semidefinite(&mut random, 16, 10);
    let sets = [AdmissibleSet::Cone2 { friction: 0.4 }; 8];
    let (base, _) = solve(&mut Lemke::default(), (&w, &q, &sets)).unwrap();
    // Powers of two: the same bits.
    for (length, force) in [(1, 60), (-40, 3), (30, -50)] {
        let [length, force] = [length, force].map(|power| 2.0_f64.powi(power));
        let scaled_w: Vec<f64> = w.iter().map(|w| w * length / force).collect();
        let scaled_q: Vec<f64> = q.iter().map(|q| q * length).collect();
        let (found, _) = solve(&mut Lemke::default(), (&scaled_w, &scaled_q, &sets)).unwrap();
        assert_eq!(found.iter().map(|r| r / force).collect::<Vec<_>>(), base);
    }
    let (w, q) = semidefinite(&mut random, 16, 32);
    let (base, _) = solve(&mut Lemke::default(), (&w, &q, &sets)).unwrap();
    let single = |x: &[f64]| x.iter().map(|&x| f32::of(x)).collect::<Vec<f32>>();
    let (found, _) = solve(&mut Lemke::default(), (&single(&w), &single(&q), &sets)).unwrap();
    let found: Vec<f64> = found.into_iter().map(f64::from).collect();
    assert!(far(&w, &found, &base) < 1e-4, "{:e}", far(&w, &found, &base));
}

#[test]
fn neither_guess_nor_memory_chooses() {
    let mut random = Congruential(17);
    let (w, q) = semidefinite(&mut random, 12, 8);
    let (sets, tolerance) = ([AdmissibleSet::Cone2 { friction: 1.5 }; 6], [0.0; 12]);
    let problem = ContactProblem::new(&w, &q, &sets, &tolerance).unwrap();
    let (first, _) = solve(&mut Lemke::default(), (&w, &q, &sets)).unwrap();
    let mut used = Lemke::default();
    used.reserve(12);
    for _ in 0..5 {
        let mut multipliers = random.vector(12, 10.0);
        used.solve(&problem, &mut multipliers).unwrap();
        assert_eq!(first, multipliers);
        let (w, q) = semidefinite(&mut random, 20, 20);
        solve(&mut used, (&w, &q, &[AdmissibleSet::Cone2 { friction: 0.5 }; 10])).unwrap();
    }
}

#[test]
fn solving_allocates_nothing() {
    let mut random = Congruential(67);
    let (w, q) = semidefinite(&mut random, 21, 40);
    let mut sets = vec![AdmissibleSet::Cone2 { friction: 0.5 }; 9];
    sets.extend([AdmissibleSet::Free, AdmissibleSet::NonNegative, AdmissibleSet::Free]);
    let problem = ContactProblem::new(&w, &q, &sets, &[0.0; 21]).unwrap();
    let (mut solver, mut multipliers) = (Lemke::default(), [0.0; 21]);
    solver.reserve(21);
    let counted = allocation_counter::measure(|| {
        solver.solve(&problem, &mut multipliers).unwrap();
    });
    assert_eq!(counted.count_total, 0);
}

#[test]
fn what_it_does_not_take_it_refuses() {
    let space = AdmissibleSet::Cone3 { friction: 0.3 };
    let mut lemke = Lemke::<f64>::default();
    assert!(!lemke.admits(space) && lemke.admits(AdmissibleSet::Free));
    assert!(lemke.admits(AdmissibleSet::NonNegative) && lemke.admits(AdmissibleSet::Cone2 { friction: 0.3 }));
    let w: Vec<f64> = (0..16).map(|entry| if entry % 5 == 0 { 1.0 } else { 0.0 }).collect();
    let sets = [AdmissibleSet::NonNegative, space];
    assert_eq!(solve(&mut lemke, (&w, &[-1.0; 4], &sets)), Err(ContactFailure::Friction { row: 1 }));
    let not_a_number = solve(&mut lemke, (&w, &[f64::NAN, 0.0, 0.0, 0.0], &[AdmissibleSet::NonNegative; 4]));
    assert!(matches!(not_a_number, Err(ContactFailure::NotConverged { iterations: 0, .. })), "{not_a_number:?}");
    // Nothing to do, and rows that no multiplier moves.
    assert_eq!(lemke.solve(&ContactProblem::new(&[], &[], &[], &[]).unwrap(), &mut []), Ok(0));
    let dead = [AdmissibleSet::Cone2 { friction: 0.3 }];
    assert_eq!(solve(&mut lemke, (&[0.0; 4], &[1.0, -1.0], &dead)), Ok((vec![0.0; 2], 0.0)));
    let closed = solve(&mut lemke, (&[0.0; 4], &[-1.0, 1.0], &dead));
    assert_eq!(closed, Err(ContactFailure::NotConverged { iterations: 0, row: 0, residual: 1.0 }));
}
