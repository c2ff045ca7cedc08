//! Tests of the active-set solver.

use super::*;

fn solve(w: &[f64], q: &[f64], sets: &[AdmissibleSet], guess: &[f64]) -> Result<Vec<f64>, ContactFailure<f64>> {
    let tolerance = vec![1e-13; q.len()];
    let problem = ContactProblem::new(w, q, sets, &tolerance).unwrap();
    let mut lambda = guess.to_vec();
    let mut solver = ActiveSet::default();
    solver.solve(&problem, &mut lambda)?;
    assert!(problem.residual(&lambda).1 < 1e-12, "{lambda:?}");
    Ok(lambda)
}

#[test]
fn guess_does_not_change_the_solution() {
    // A row that repels another one: activating both is wrong.
    let w = [1.0, 0.9, 0.9, 1.0];
    for guess in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
        let lambda = solve(&w, &[-1.0, -0.5], &[AdmissibleSet::NonNegative; 2], &guess).unwrap();
        assert!((lambda[0] - 1.0).abs() < 1e-15 && lambda[1] == 0.0, "{lambda:?}");
    }
}

#[test]
fn free_rows_may_pull() {
    let lambda =
        solve(&[2.0, 0.0, 0.0, 2.0], &[1.0, 1.0], &[AdmissibleSet::Free, AdmissibleSet::NonNegative], &[0.0; 2])
            .unwrap();
    assert!((lambda[0] + 0.5).abs() < 1e-15 && lambda[1] == 0.0, "{lambda:?}");
}

#[test]
fn a_problem_on_which_block_exchanges_cycle_is_solved() {
    // Found by search: exchanging all violating rows at once repeats after three iterations.
    let w = [
        [13.1, -5.0, -11.0, 3.0, 12.0],
        [-5.0, 17.1, 7.0, 3.0, 0.0],
        [-11.0, 7.0, 10.1, -3.0, -9.0],
        [3.0, 3.0, -3.0, 10.1, 2.0],
        [12.0, 0.0, -9.0, 2.0, 13.1],
    ];
    let lambda =
        solve(&w.concat(), &[4.0, -2.0, -4.0, -2.0, 1.0], &[AdmissibleSet::NonNegative; 5], &[0.0; 5]).unwrap();
    assert!(lambda.iter().all(|&l| l >= 0.0) && lambda.iter().any(|&l| l > 0.0), "{lambda:?}");
}

#[test]
fn rounding_of_a_loaded_row_does_not_exchange_rows_at_rest() {
    // Found by random scenes: the second multiplier is zero to rounding, the first row has no scale of its own.
    let w = [
        1.579_567_724_847_582_6e-6,
        -1.147_454_536_639_987_9e-6,
        0.0,
        -1.147_454_536_639_987_9e-6,
        7.148_794_154_662_025e-6,
        -9.394_326_208_640_901e-8,
        0.0,
        -9.394_326_208_640_901e-8,
        1.753_190_892_225_264_2e-6,
    ];
    let offset = [-6.765_851_609_745_381e-35, 8.129_493_350_609_44e-7, -1.517_144_857_880_793_5e-5];
    let tolerance = [5.3e-37, 2.3e-20, 4.3e-19];
    let problem = ContactProblem::new(&w, &offset, &[AdmissibleSet::NonNegative; 3], &tolerance).unwrap();
    let mut lambda = [0.0_f64; 3];
    let iterations = ActiveSet::default().solve(&problem, &mut lambda).unwrap();
    assert!(iterations <= 4, "{iterations}");
    assert!((lambda[2] - 8.653_620_462_031_572).abs() < 1e-12 && lambda[1].abs() < 1e-12, "{lambda:?}");
}

#[test]
fn what_a_loaded_row_carries_into_its_neighbor_is_no_violation() {
    // The first multiplier is 1 up to the tolerance of its row over its W, and the second row is moved by that: it may
    // miss zero by less without being pressed.
    let second = |miss: f64| {
        let (offset, sets) = ([-2.0, -1.0 - miss], [AdmissibleSet::NonNegative; 2]);
        let problem = ContactProblem::new(&[2.0, 1.0, 1.0, 2.0], &offset, &sets, &[1e-8, 1e-13]).unwrap();
        let mut lambda = [1.0_f64, 0.0];
        ActiveSet::default().solve(&problem, &mut lambda).unwrap();
        lambda[1]
    };
    assert!(second(4e-9) == 0.0, "{:e}", second(4e-9));
    // A larger miss gives a multiplier of ⅔ of the miss.
    assert!((second(1e-7) / (2.0 / 3.0 * 1e-7) - 1.0).abs() < 1e-7, "{:e}", second(1e-7));
}

#[test]
fn redundant_rows_share_the_force() {
    let both = [AdmissibleSet::NonNegative; 2];
    let lambda = solve(&[1.0; 4], &[-1.0, -1.0], &both, &[0.0; 2]).unwrap();
    assert!((lambda[0] + lambda[1] - 1.0).abs() < 1e-14 && (lambda[0] - 0.5).abs() < 1e-11, "{lambda:?}");
    // The same dof at two gaps: only the nearer one presses, for any guess.
    for guess in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
        let lambda = solve(&[1.0; 4], &[-1.0, -0.9], &both, &guess).unwrap();
        assert!((lambda[0] - 1.0).abs() < 1e-12 && lambda[1] == 0.0, "{lambda:?}");
    }
    // A tie and a contact on the same dof.
    let lambda =
        solve(&[1.0; 4], &[1.0, 1.0], &[AdmissibleSet::Free, AdmissibleSet::NonNegative], &[0.0, 1.0]).unwrap();
    assert!((lambda[0] + lambda[1] + 1.0).abs() < 1e-12 && lambda[1] >= 0.0, "{lambda:?}");
}

#[test]
fn the_same_contact_in_other_units() {
    let scale = [1.0, 1.0, 3.0, 1.0];
    let w: Vec<f64> = (0..16).map(|k| 1.6e-3 * scale[k % 4] * scale[k / 4]).collect();
    let q = scale.map(|s| -8.38e-5 * s);
    let lambda = solve(&w, &q, &[AdmissibleSet::NonNegative; 4], &[0.0; 4]).unwrap();
    for (lambda, s) in lambda.iter().zip(scale) {
        assert!((lambda - 8.38e-5 / 1.6e-3 * s / 12.0).abs() < 1e-12, "{lambda}");
    }
}

#[test]
fn four_supports_of_a_rigid_table() {
    // Heave, pitch and roll of a rigid plate on four corners: rank three.
    let corners = [[1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]];
    let w: Vec<f64> =
        (0..16).map(|k| corners[k % 4].iter().zip(&corners[k / 4]).map(|(a, b): (&f64, &f64)| a * b).sum()).collect();
    // A load off the center: the multipliers carry it, and no others of smaller norm do.
    for load in [[-4.0, 0.0, 0.0], [-4.0, 1.0, 0.5], [-4.0, -2.0, 1.0]] {
        let q: Vec<f64> = corners.iter().map(|c| c.iter().zip(&load).map(|(c, l)| c * l).sum()).collect();
        let lambda = solve(&w, &q, &[AdmissibleSet::NonNegative; 4], &[0.0; 4]).unwrap();
        for (axis, load) in load.iter().enumerate() {
            let carried: f64 = corners.iter().zip(&lambda).map(|(c, l)| c[axis] * l).sum();
            assert!((carried + load).abs() < 1e-12, "{lambda:?}");
        }
        // The null space is the twist (1, −1, 1, −1): none of it where all four press.
        let twist: f64 = lambda[0] - lambda[1] + lambda[2] - lambda[3];
        assert!(lambda.contains(&0.0) || twist.abs() < 1e-10, "{lambda:?}");
    }
}

#[test]
fn contradictions_are_named() {
    // A dof that must be above 1 and below −1, and a third contact that has nothing to do with it.
    let w = [1.0, -1.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    for guess in [[0.0; 3], [1.0; 3]] {
        match solve(&w, &[-1.0, -1.0, -1.0], &[AdmissibleSet::NonNegative; 3], &guess) {
            Err(ContactFailure::Contradictory { row, other, residual }) => {
                assert!(row < 2 && other < 2 && row != other);
                assert!((residual - 1.0).abs() < 0.5, "{residual}");
            }
            other => panic!("{other:?}"),
        }
    }
    let tied = solve(&[1.0; 4], &[-1.0, 1.0], &[AdmissibleSet::Free; 2], &[0.0; 2]);
    assert!(matches!(tied, Err(ContactFailure::Contradictory { .. })), "{tied:?}");
}

#[test]
fn rounding_is_no_contradiction() {
    // The same tie twice, its offsets rounded differently, and tolerances that know nothing of it.
    let problem =
        ContactProblem::new(&[1.0; 4], &[-1e-2, -1e-2 - 4e-15], &[AdmissibleSet::Free; 2], &[1e-19; 2]).unwrap();
    let mut lambda = [0.0; 2];
    ActiveSet::default().solve(&problem, &mut lambda).unwrap();
    assert!((lambda[0] + lambda[1] - 1e-2_f64).abs() < 1e-14, "{lambda:?}");
}

#[test]
fn large_problems_and_kept_factors() {
    let n = 90;
    let b = |i: usize, k: usize| (((i * 31 + k * 17) % 23) as f64 - 11.0) / 11.0 + if i == k { 4.0 } else { 0.0 };
    let w: Vec<f64> = (0..n * n).map(|e| (0..n).map(|k| b(e % n, k) * b(e / n, k)).sum()).collect();
    let q: Vec<f64> = (0..n).map(|i| (i as f64 * 0.9).sin() - 0.3).collect();
    let (sets, tolerance) = (vec![AdmissibleSet::NonNegative; n], vec![1e-14; n]);
    let problem = |offset, version| ContactProblem::new(&w, offset, &sets, &tolerance).unwrap().with_version(version);
    let mut solver = ActiveSet::default();
    let mut cold = vec![0.0; n];
    solver.solve(&problem(&q, 7), &mut cold).unwrap();
    assert!(problem(&q, 7).residual(&cold).1 < 1e-12);
    // The same W again, with a kept factor and without: bit for bit.
    let other: Vec<f64> = q.iter().map(|q| 1.01 * q).collect();
    let (mut kept, mut fresh) = (cold.clone(), cold.clone());
    assert_eq!(solver.solve(&problem(&other, 7), &mut kept).unwrap(), 1);
    ActiveSet::default().solve(&problem(&other, 0), &mut fresh).unwrap();
    assert_eq!(kept, fresh);
}
