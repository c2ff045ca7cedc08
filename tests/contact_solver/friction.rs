//! Contact problems with Coulomb's friction: one block against its conditions, many against each other and against all
//! combinations of their states, redundant rows, other units, refusals.

use contact_dynamics::contact_solver::{
    ActiveSet, AdmissibleSet, ContactFailure, ContactProblem, ContactSolver, GaussSeidel, Pivoting,
};
use contact_dynamics::{Error, Real};
use contact_dynamics_scenes::boxes::{self, MASS, pile};
use contact_dynamics_scenes::random::Congruential;

fn cone(rows: usize, friction: f64) -> AdmissibleSet {
    if rows == 2 { AdmissibleSet::Cone2 { friction } } else { AdmissibleSet::Cone3 { friction } }
}

/// B Bᵀ, `share` of the identity added, for B of so many columns.
fn semidefinite(random: &mut Congruential, size: usize, columns: usize, share: f64) -> Vec<f64> {
    let b = random.vector(size * columns, 1.0);
    let entry = |i: usize, j: usize| (0..columns).map(|k| b[i * columns + k] * b[j * columns + k]).sum::<f64>();
    (0..size * size).map(|e| entry(e / size, e % size) + if e / size == e % size { share } else { 0.0 }).collect()
}

fn solve<T: Real>(
    solver: &mut dyn ContactSolver<T>,
    (w, q, sets): (&[T], &[T], &[AdmissibleSet]),
) -> Result<Vec<T>, ContactFailure<T>> {
    let tolerance = vec![T::zero(); q.len()];
    let mut multipliers = vec![T::one(); q.len()];
    solver.solve(&ContactProblem::new(w, q, sets, &tolerance).unwrap(), &mut multipliers)?;
    Ok(multipliers)
}

/// Coulomb's law as it is written in books, each part relative to the sizes of the problem.
fn check(w: &[f64], q: &[f64], sets: &[AdmissibleSet], r: &[f64], tolerance: f64, what: &str) {
    let size = q.len();
    let y: Vec<f64> = (0..size).map(|i| q[i] + (0..size).map(|j| w[i * size + j] * r[j]).sum::<f64>()).collect();
    let length = q.iter().fold(0.0, |most: f64, q| most.max(q.abs()));
    let force = r.iter().fold(0.0, |most: f64, r| most.max(r.abs()));
    let (mut first, small, weak) = (0, tolerance * length, tolerance * force);
    for set in sets {
        let (y, r) = (&y[first..first + set.rows()], &r[first..first + set.rows()]);
        let what = format!("{what}, row {first}: y {y:?}, r {r:?}");
        first += set.rows();
        assert!(y[0] >= -small && r[0] >= -weak && (y[0] <= small || r[0] <= weak), "{what}");
        let Some(friction) = set.friction() else { continue };
        let [slip, rubbed] = [&y[1..], &r[1..]].map(|x| x.iter().map(|x| x * x).sum::<f64>().sqrt());
        assert!(rubbed <= friction * r[0] + weak, "{what}");
        if slip > small {
            // Opposite to the slip, and all that there is.
            for (&slipping, &f) in y[1..].iter().zip(&r[1..]) {
                let expected = -friction * r[0] * slipping / slip;
                assert!((f - expected).abs() <= weak * (1.0 + length / slip), "{what}");
            }
        }
    }
}

/// The nearest point z of a convex set to x is the one with (x − z)·(y − z) ≤ 0 for all y of the set.
#[test]
fn multipliers_go_to_the_nearest_ones_of_a_cone() {
    let mut random = Congruential(5);
    for rows in [2, 3] {
        for friction in [0.0, 0.3, 1.0, 4.0] {
            let (mut moved, set) = (0, cone(rows, friction));
            for _ in 0..200 {
                let x = random.vector(rows, 1.0);
                let mut z = x.clone();
                set.project(&mut z);
                let rubbed = |f: &[f64]| f[1..].iter().map(|f| f * f).sum::<f64>().sqrt();
                assert!(z[0] >= 0.0 && rubbed(&z) <= friction * z[0] + 1e-15, "{set:?}: {x:?} to {z:?}");
                moved += usize::from(z != x);
                for _ in 0..20 {
                    let mut y = random.vector(rows, friction);
                    y[0] = random.unit() + if friction > 0.0 { rubbed(&y) / friction } else { 0.0 };
                    let angle: f64 = (0..rows).map(|k| (x[k] - z[k]) * (y[k] - z[k])).sum();
                    assert!(angle <= 1e-14 * (1.0 + y[0]), "{set:?}: {x:?} to {z:?}, {y:?}: {angle}");
                }
            }
            assert!(moved > 50, "{set:?}: {moved}");
        }
    }
}

#[test]
fn one_contact_is_open_sticks_or_slides() {
    let w = [2.0, 0.0, 0.0, 4.0];
    for (q, friction, expected) in [
        ([1.0, -3.0], 0.5, [0.0, 0.0]),
        ([-2.0, 0.8], 0.5, [1.0, -0.2]),
        ([-2.0, -8.0], 0.5, [1.0, 0.5]),
        ([-2.0, 8.0], 0.5, [1.0, -0.5]),
        ([-2.0, 8.0], 0.0, [1.0, 0.0]),
    ] {
        for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
            let found = solve(solver, (&w, &q, &[cone(2, friction)])).unwrap();
            let miss = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(miss < 1e-15, "{solver:?} {q:?}: {found:?}");
        }
    }
}

#[test]
fn blocks_alone_meet_coulombs_law() {
    let mut random = Congruential(11);
    for trial in 0..3000 {
        let rows = 2 + trial % 2;
        let w = semidefinite(&mut random, rows, rows, if trial % 5 == 0 { 1e-6 } else { 0.05 });
        let q = random.vector(rows, 1.0);
        let sets = [cone(rows, [0.0, 0.1, 0.6, 1.5][trial / 2 % 4])];
        let found = solve(&mut GaussSeidel::default(), (&w, &q, &sets)).unwrap();
        check(&w, &q, &sets, &found, 1e-8, &format!("trial {trial}"));
    }
}

/// W in other units, by powers of two: multipliers are the same bits.
#[test]
fn blocks_alone_are_the_same_in_any_unit() {
    let mut random = Congruential(12);
    let [compliance, length] = [40, 20].map(|exponent| 2.0_f64.powi(exponent));
    for trial in 0..1000 {
        let mut w = semidefinite(&mut random, 3, 3, 0.05);
        if trial % 2 == 0 {
            // Friction moves nothing.
            w[1..].fill(0.0);
        }
        let q = random.vector(3, 1.0);
        let sets = [cone(3, 0.6)];
        let found = solve(&mut GaussSeidel::default(), (&w, &q, &sets)).unwrap();
        let (w, q): (Vec<_>, Vec<_>) =
            (w.iter().map(|w| w * compliance).collect(), q.iter().map(|q| q * length).collect());
        let scaled = solve(&mut GaussSeidel::default(), (&w, &q, &sets)).unwrap();
        let same = found.iter().zip(scaled).all(|(r, other)| r.to_bits() == (other * compliance / length).to_bits());
        assert!(same, "trial {trial}");
    }
}

/// All solutions of a problem in a plane: every combination of open, stick, and slip to either side.
fn all_solutions(w: &[f64], q: &[f64], frictions: &[f64]) -> Vec<Vec<f64>> {
    let (contacts, size) = (frictions.len(), q.len());
    let mut found = Vec::new();
    // Two bits for each contact.
    for state in 0..1_usize << (2 * contacts) {
        let status = |contact: usize| state >> (2 * contact) & 3;
        // Rows of A r = b, solved by elimination.
        let mut a = vec![vec![0.0; size + 1]; size];
        for (contact, friction) in frictions.iter().enumerate() {
            let (n, t) = (2 * contact, 2 * contact + 1);
            for (row, held) in [(n, status(contact) != 0), (t, status(contact) == 1)] {
                if held {
                    a[row][..size].copy_from_slice(&w[row * size..(row + 1) * size]);
                    a[row][size] = -q[row];
                } else {
                    a[row][row] = 1.0;
                }
            }
            match status(contact) {
                2 => a[t][n] = -friction,
                3 => a[t][n] = *friction,
                _ => {}
            }
        }
        let Some(r) = eliminate(a) else { continue };
        let y: Vec<f64> = (0..size).map(|i| q[i] + (0..size).map(|j| w[i * size + j] * r[j]).sum::<f64>()).collect();
        let holds = (0..contacts).all(|contact| {
            let (n, t) = (2 * contact, 2 * contact + 1);
            match status(contact) {
                0 => y[n] >= 0.0,
                1 => r[n] >= 0.0 && r[t].abs() <= frictions[contact] * r[n],
                2 => r[n] >= 0.0 && y[t] <= 0.0,
                _ => r[n] >= 0.0 && y[t] >= 0.0,
            }
        });
        if holds {
            found.push(r);
        }
    }
    found
}

/// Solves by elimination with pivoting; nothing if the matrix is singular.
fn eliminate(mut a: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let n = a.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        if a[pivot][k].abs() < 1e-12 {
            return None;
        }
        a.swap(k, pivot);
        for i in (0..n).filter(|&i| i != k) {
            let (pivots, factor) = (a[k].clone(), a[i][k] / a[k][k]);
            a[i].iter_mut().zip(&pivots).for_each(|(x, pivot)| *x -= factor * pivot);
        }
    }
    Some((0..n).map(|i| a[i][n] / a[i][i]).collect())
}

#[test]
fn solutions_in_a_plane_are_among_all_there_are() {
    let mut random = Congruential(5);
    let (mut alone, mut trials) = (0, 0);
    for trial in 0..400 {
        let contacts = 1 + trial % 4;
        let size = 2 * contacts;
        let w = semidefinite(&mut random, size, size, 0.1);
        let q = random.vector(size, 1.0);
        let frictions: Vec<f64> = (0..contacts).map(|_| random.within(0.0, 0.7)).collect();
        let sets: Vec<_> = frictions.iter().map(|&friction| cone(2, friction)).collect();
        let known = all_solutions(&w, &q, &frictions);
        for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
            let found = solve(solver, (&w, &q, &sets)).unwrap();
            check(&w, &q, &sets, &found, 1e-8, &format!("{solver:?}, trial {trial}"));
            let far = |r: &Vec<f64>| r.iter().zip(&found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let nearest = known.iter().map(far).fold(f64::INFINITY, f64::min);
            let scale = found.iter().fold(1.0, |most: f64, r| most.max(r.abs()));
            assert!(nearest < 1e-7 * scale, "{solver:?}, trial {trial}: {nearest:e}");
        }
        alone += usize::from(known.len() == 1);
        trials += 1;
    }
    // With moderate friction there is mostly one.
    assert!(alone * 10 > trials * 9, "{alone} of {trials}");
}

#[test]
fn many_contacts_by_newton_and_by_sweeps() {
    let mut random = Congruential(3);
    for trial in 0..40 {
        let (rows, contacts) = (2 + trial % 2, 5 + trial);
        let size = rows * contacts;
        let w = semidefinite(&mut random, size, 2 * size, 0.0);
        let q = random.vector(size, 1.0);
        let sets = vec![cone(rows, 0.3); contacts];
        let tolerance = vec![0.0; size];
        let problem = ContactProblem::new(&w, &q, &sets, &tolerance).unwrap();
        let mut newton = vec![0.0; size];
        let iterations = ActiveSet::default().solve(&problem, &mut newton).unwrap();
        assert!(iterations <= 30, "{iterations} iterations for {contacts} contacts");
        assert!(problem.residual(&newton).1 < 1e-12, "{:?}", problem.residual(&newton));
        check(&w, &q, &sets, &newton, 1e-8, &format!("trial {trial}"));
        let swept = solve(&mut GaussSeidel::default(), (&w, &q, &sets)).unwrap();
        let (far, most) = newton
            .iter()
            .zip(&swept)
            .fold((0.0_f64, 0.0_f64), |(far, most), (a, b)| (far.max((a - b).abs()), most.max(a.abs())));
        assert!(far < 1e-8 * most, "trial {trial}: {far:e} of {most:e}");
    }
}

/// Where friction moves nothing in one direction, or in none, the block still slides against its slip.
/// Contacts along a string that stand, some of them without friction: how far they may slide is nothing then, and so is
/// what they slide, which is no direction.
#[test]
fn contacts_that_do_not_slide_are_solved_in_few_iterations() {
    let count = 24;
    let size = 2 * count;
    // The flexibility of the string is badly conditioned; tangents are alone.
    let entry = |i: usize, j: usize| match (i % 2, j % 2) {
        (0, 0) => (i / 2).min(j / 2) as f64 + 1.0,
        _ if i == j => 1.0,
        _ => 0.0,
    };
    let w: Vec<f64> = (0..size * size).map(|e| entry(e / size, e % size)).collect();
    let expected = |row: usize| if row.is_multiple_of(2) { 1.0 + 0.1 * (row as f64).sin() } else { 0.0 };
    let q: Vec<f64> = (0..size).map(|i| -(0..size).map(|j| entry(i, j) * expected(j)).sum::<f64>()).collect();
    for frictions in [[0.0, 0.0], [0.0, 0.3], [0.3, 0.3]] {
        let sets: Vec<_> = (0..count).map(|k| cone(2, frictions[k % 2])).collect();
        let tolerance = vec![0.0; size];
        let mut found = vec![0.0; size];
        let problem = ContactProblem::new(&w, &q, &sets, &tolerance).unwrap();
        let iterations = ActiveSet::default().solve(&problem, &mut found).unwrap();
        assert!(iterations < 60, "{frictions:?}: {iterations}");
        for (row, found) in found.iter().enumerate() {
            assert!((found - expected(row)).abs() < 1e-9, "{frictions:?}, {row}: {found}");
        }
    }
}

#[test]
fn directions_without_compliance() {
    for tangential in [[0.0, 3.0], [3.0, 0.0], [0.0, 0.0], [1e-300, 3.0], [3.0, 1e-12]] {
        for slip in [[0.5, 0.1], [-0.2, 0.7], [0.5, 0.0], [0.0, -0.4], [1e-9, 0.3]] {
            let w = [2.0, 0.0, 0.0, 0.0, tangential[0], 0.0, 0.0, 0.0, tangential[1]];
            let (q, sets) = ([-2.0, slip[0], slip[1]], [cone(3, 0.05)]);
            for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
                let found = solve(solver, (&w, &q, &sets)).unwrap();
                check(&w, &q, &sets, &found, 1e-12, &format!("{solver:?} {tangential:?} {slip:?}"));
            }
        }
    }
}

/// What is rounding of a slip is none of a gap: a contact that is violated beyond the rounding of its gap is pressed,
/// though its slip may be all rounding.
#[test]
fn the_rounding_of_a_slip_does_not_excuse_a_gap() {
    let (w, q, tolerance) = ([0.0726, -0.0012, -0.0012, 0.144], [-7e-21, -9e-19], [2e-34, 7e-17]);
    for friction in [0.0, 0.3, 1e6] {
        let sets = [AdmissibleSet::Cone2 { friction }];
        for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
            let mut found = [0.0; 2];
            solver.solve(&ContactProblem::new(&w, &q, &sets, &tolerance).unwrap(), &mut found).unwrap();
            let gap = q[0] + w[0] * found[0] + w[1] * found[1];
            assert!(found[0] > 0.0 && gap.abs() < 1e-12 * 7e-21, "{friction} {solver:?}: {found:?}, gap {gap:e}");
        }
    }
}

/// In single precision, with rows that depend on one another beside friction without bound: Newton's method may end
/// with rows that pull by what is rounding.
#[test]
fn no_row_pulls_by_rounding() {
    let w = [
        0.246_016_13_f32,
        0.0,
        1.075_345,
        0.057_296_775,
        -0.058_668_237, //
        0.0,
        0.246_016_14,
        8.940_697e-8,
        0.058_668_237,
        0.057_296_775, //
        1.075_345,
        5.960_464_5e-8,
        4.700_370_3,
        0.250_446_2,
        -0.256_440_88, //
        0.057_296_775,
        0.058_668_237,
        0.250_446_2,
        0.246_016_14,
        0.0, //
        -0.058_668_237,
        0.057_296_775,
        -0.256_440_88,
        0.0,
        0.246_016_14,
    ];
    let q = [5.659_221_6e-5, -0.002_006_731_5, 0.000_247_376_3, -0.000_352_111_8, -0.002_444_287];
    let tolerance = [3.626_326_4e-6, 3.086_443_5e-8, 1.585_079_7e-5, 1.978_123e-6, 5.229_096e-8];
    let sets = [cone(2, 1e6), AdmissibleSet::NonNegative, cone(2, 2.0)];
    let mut found = [0.0; 5];
    let problem = ContactProblem::new(&w, &q, &sets, &tolerance).unwrap();
    ActiveSet::default().solve(&problem, &mut found).unwrap();
    assert!([0, 2, 3].iter().all(|&normal| found[normal] >= 0.0), "{found:?}");
    assert!(problem.residual(&found).1 < 1e-4, "{found:?}");
}

/// Sweeps take W for symmetric until its result is refused: by much and by little, in all rows and in one entry.
#[test]
fn an_unsymmetric_operator_is_read_as_a_whole() {
    let mut random = Congruential(31);
    for contacts in [2, 5, 12] {
        for skew in [1e-9, 1e-3, 0.3] {
            for single in [false, true] {
                let (size, sets) = (3 * contacts, vec![cone(3, 0.4); contacts]);
                let mut w = semidefinite(&mut random, size, size, size as f64);
                for (i, j) in (0..size).flat_map(|i| (0..i).map(move |j| (i, j))) {
                    let x = skew * random.signed();
                    if !single || (i, j) == (size - 1, 0) {
                        w[i * size + j] += x;
                        w[j * size + i] -= x;
                    }
                }
                let q: Vec<f64> = (0..size).map(|i| if i % 3 == 0 { -1.0 } else { random.signed() }).collect();
                for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
                    let found = solve(solver, (&w, &q, &sets)).unwrap();
                    check(&w, &q, &sets, &found, 1e-10, &format!("{solver:?} {contacts} {skew} {single}"));
                }
            }
        }
    }
}

/// A number that is none is found wherever it stands, and said with its row.
#[test]
fn an_operator_that_is_not_finite_is_refused() {
    let mut random = Congruential(32);
    let (size, sets) = (9, vec![cone(3, 0.4); 3]);
    let sound = semidefinite(&mut random, size, size, 9.0);
    let q: Vec<f64> = (0..size).map(|i| if i % 3 == 0 { -1.0 } else { random.signed() }).collect();
    for entry in 0..size * size {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut w = sound.clone();
            w[entry] = bad;
            for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
                let failure = solve(solver, (&w, &q, &sets)).unwrap_err();
                let ContactFailure::NotConverged { row, residual, .. } = failure else { panic!("{failure:?}") };
                assert!(row == entry / size && residual.is_nan(), "{entry} {row} {residual}");
            }
        }
    }
}

#[test]
fn the_guess_chooses_nothing() {
    let mut random = Congruential(17);
    let w = semidefinite(&mut random, 12, 12, 0.1);
    let q = random.vector(12, 1.0);
    let (sets, tolerance) = ([cone(3, 0.8); 4], [0.0; 12]);
    let problem = ContactProblem::new(&w, &q, &sets, &tolerance).unwrap();
    let mut first = None;
    for _ in 0..5 {
        let mut multipliers = random.vector(12, 10.0);
        ActiveSet::default().solve(&problem, &mut multipliers).unwrap();
        assert_eq!(first.get_or_insert_with(|| multipliers.clone()), &multipliers);
    }
}

#[test]
fn rows_with_and_without_friction_stand_side_by_side() {
    // A unilateral row, a contact with friction, and a tie, on three masses that springs couple.
    let mut random = Congruential(23);
    for trial in 0..200 {
        let w = semidefinite(&mut random, 5, 5, 0.1);
        let q = random.vector(5, 1.0);
        let sets = [AdmissibleSet::NonNegative, cone(3, 0.4), AdmissibleSet::Free];
        for solver in [&mut ActiveSet::default() as &mut dyn ContactSolver<f64>, &mut GaussSeidel::default()] {
            let found = solve(solver, (&w, &q, &sets)).unwrap();
            check(&w, &q, &sets[..2], &found, 1e-8, &format!("{solver:?}, trial {trial}"));
            let tied = q[4] + (0..5).map(|j| w[20 + j] * found[j]).sum::<f64>();
            assert!(tied.abs() < 1e-10, "{tied:e}");
        }
    }
}

/// W of twelve rows has rank six.
#[test]
fn a_rigid_box_stands_and_slides() {
    let rows = pile(&[[0.0; 2]]);
    let sets = [cone(3, 0.5); 4];
    for (speed, fall) in [(0.1, 1.0), (0.9, 1.0), (0.6, 2.0)] {
        // It moves along the floor, and its weight is about to move it down.
        let (w, q) = boxes::problem(&rows, &[speed, 0.0, -fall, 0.0, 0.0, 0.0]);
        let r = solve(&mut ActiveSet::default(), (&w, &q, &sets)).unwrap();
        check(&w, &q, &sets, &r, 1e-9, &format!("at speed {speed}"));
        let [up, along] = [0, 1].map(|k| r.chunks(3).map(|r| r[k]).sum::<f64>());
        // (Its corners are far enough apart for it not to topple.)
        assert!((up - MASS * fall).abs() < 1e-10, "{up}");
        assert!((along + MASS * speed.min(0.5 * fall)).abs() < 1e-10, "{along} at speed {speed}");
    }
}

#[test]
fn piles_of_rigid_boxes_stand_and_slide() {
    let mut random = Congruential(41);
    for trial in 0..60 {
        let boxes = 1 + trial % 8;
        let shifts: Vec<[f64; 2]> = (0..boxes).map(|_| [0.1 * random.signed(), 0.1 * random.signed()]).collect();
        let free: Vec<f64> = (0..6 * boxes)
            .map(|k| match k % 6 {
                2 => -1.0,
                0 | 1 => 0.5 * random.signed(),
                _ => 0.1 * random.signed(),
            })
            .collect();
        let (w, q) = boxes::problem(&pile(&shifts), &free);
        let sets = vec![cone(3, 0.3 + 0.1 * (trial % 5) as f64); 4 * boxes];
        let tolerance = vec![0.0; q.len()];
        let problem = ContactProblem::new(&w, &q, &sets, &tolerance).unwrap();
        let mut r = vec![0.0; q.len()];
        let spent = ActiveSet::default().solve(&problem, &mut r);
        assert!(spent.is_ok(), "trial {trial}, {boxes} boxes: {spent:?}");
        assert!(problem.residual(&r).1 < 1e-11, "trial {trial}, {boxes} boxes: {:?}", problem.residual(&r));
        check(&w, &q, &sets, &r, 1e-7, &format!("trial {trial}, {boxes} boxes"));
    }
}

#[test]
fn units_do_not_matter() {
    let mut random = Congruential(29);
    let w = semidefinite(&mut random, 9, 9, 0.1);
    let q = random.vector(9, 1.0);
    let sets = [cone(3, 0.4); 3];
    let base = solve(&mut ActiveSet::default(), (&w, &q, &sets)).unwrap();
    // Powers of two: the same bits.
    for (length, force) in [(1, 60), (-40, 3), (30, -50)] {
        let [length, force] = [length, force].map(|power| 2.0_f64.powi(power));
        let scaled_w: Vec<f64> = w.iter().map(|w| w * length / force).collect();
        let scaled_q: Vec<f64> = q.iter().map(|q| q * length).collect();
        let found = solve(&mut ActiveSet::default(), (&scaled_w, &scaled_q, &sets)).unwrap();
        assert_eq!(found.iter().map(|r| r / force).collect::<Vec<_>>(), base);
    }
    let single = |x: &[f64]| x.iter().map(|&x| f32::of(x)).collect::<Vec<f32>>();
    let found = solve(&mut ActiveSet::default(), (&single(&w), &single(&q), &sets)).unwrap();
    let far = found.iter().zip(&base).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max);
    assert!(far < 1e-4, "{far:e}");
}

#[test]
fn who_takes_no_friction_says_so() {
    let (w, q, sets) = ([1.0, 0.0, 0.0, 1.0], [-1.0, 1.0], [cone(2, 0.3)]);
    let mut refusing = Pivoting::default();
    assert!(!refusing.admits(sets[0]) && refusing.admits(AdmissibleSet::Free));
    assert_eq!(solve(&mut refusing, (&w, &q, &sets)), Err(ContactFailure::Friction { row: 0 }));
    assert!(ActiveSet::<f64>::default().admits(sets[0]) && GaussSeidel::<f64>::default().admits(sets[0]));
    for friction in [-0.1, f64::NAN, f64::INFINITY] {
        let refused = ContactProblem::new(&w, &q, &[cone(2, friction)], &[0.0; 2]).map(drop);
        assert!(matches!(refused, Err(Error::Parameter { .. })), "{refused:?}");
    }
    let not_a_number = solve(&mut ActiveSet::default(), (&w, &[f64::NAN, 0.0], &sets));
    assert!(matches!(not_a_number, Err(ContactFailure::NotConverged { iterations: 0, .. })), "{not_a_number:?}");
}

/// Two pairs of nodes of a bar that folds, each node on a facet that ends at the other one of its pair: every contact
/// twice, but for the angle between the facets and a thousandth of the way along them. What distinguishes the two moves
/// so little that proximal steps must be nearly those of W itself.
#[test]
fn nodes_that_are_each_on_a_facet_of_the_other() {
    let numbers = |text: &str| -> Vec<f64> { text.split_whitespace().map(|x| x.parse().unwrap()).collect() };
    let below = numbers(
        "0.0517985785202122 -1.0508374007936719e-06 0.05289801989042714 -0.000645809321127484 \
        -2.426472709709146e-05 0.025880621118449895 -1.1988234363062554e-05 0.00144119960603335 \
        -9.115526760604188e-06 0.026436071935721766 -0.0006458548524937502 2.3022463937240144e-05 \
        0.02586639022309303 0.0008581900451633221 0.025880621118454766 9.212782264985188e-06 \
        0.001441219997091264 -0.0008581900451633025 0.026422140150691803 9.115526760622097e-06 \
        0.026436071935726536 0.051798480521514645 0.00010077175815094907 -0.0006458548525835315 \
        -9.212782267549056e-06 -0.0006458093212174222 1.1988234363447832e-05 0.051798578520567594 \
        -0.00010077175813514127 0.0528979239004024 -2.3022463934585868e-05 0.001441219997006482 \
        2.426472709696724e-05 0.0014411996059487894 1.0508374165948843e-06 0.05289801989077578",
    );
    let q = numbers(
        "-0.4927427440511541 -0.0004734725057493274 -0.39586935854470673 -0.0064929089978760755 \
        -0.3958693585457268 0.006492908932339891 -0.49274274405222296 0.00047347173592096544",
    );
    let entry = |i: usize, j: usize| below[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
    let w: Vec<f64> = (0..64).map(|e| entry(e / 8, e % 8)).collect();
    let sets = [cone(2, 0.567_363_523_158_849_6); 4];
    let found = solve(&mut ActiveSet::default(), (&w, &q, &sets)).unwrap();
    check(&w, &q, &sets, &found, 1e-11, "a bar that folds");
}

/// Where the bodies give way along one direction alone, friction along that holds what would slip there: of all slopes
/// of it.
#[test]
fn a_block_that_gives_way_along_one_direction_is_held() {
    for degrees in [5.0_f64, 40.0, 50.0, 85.0, 130.0, 175.0] {
        let (y, x) = degrees.to_radians().sin_cos();
        let w = [2.0, 0.0, 0.0, 0.0, x * x, x * y, 0.0, x * y, y * y];
        let q = [-4.0, 0.3 * x, 0.3 * y];
        let solvers: [&mut dyn ContactSolver<f64>; 2] = [&mut GaussSeidel::default(), &mut ActiveSet::default()];
        for solver in solvers {
            let r = solve(solver, (&w, &q, &[cone(3, 0.5)])).unwrap();
            let found = [r[0] - 2.0, r[1] + 0.3 * x, r[2] + 0.3 * y];
            assert!(found.iter().all(|miss| miss.abs() < 1e-14), "{degrees}: {r:?}");
        }
    }
}

/// Two tangents that a body follows as one: the force that would hold it is nearly without bound, and its square is
/// beyond the numbers of `f32`. In other units the search for the direction of slip takes the same steps.
#[test]
fn nearly_singular_blocks_do_not_depend_on_the_unit() {
    let rows = [[-0.164_229, 0.984_099], [-0.751_325, -0.169_238], [-0.639_171, -0.053_92]];
    let product = |i: usize, j: usize| f32::of(3e-8 * (rows[i][0] * rows[j][0] + rows[i][1] * rows[j][1]));
    let w: Vec<f32> = (0..9).map(|entry| product(entry / 3, entry % 3)).collect();
    let mut random = Congruential(71);
    for trial in 0..200 {
        let q = [-1.3e-3, 4e-4 * random.signed(), 3e-4 * random.signed()].map(f32::of);
        let solved = |unit: i32| {
            let unit = 2.0_f32.powi(unit);
            let q = q.map(|x| x * unit);
            let problem = ContactProblem::new(&w, &q, &[AdmissibleSet::Cone3 { friction: 0.1 }], &[0.0; 3]).unwrap();
            let mut multipliers = [0.0; 3];
            let solved = ActiveSet::default().solve(&problem, &mut multipliers);
            (solved, multipliers.map(|x| x / unit))
        };
        for unit in [-20, 4, 20, 60] {
            assert_eq!(solved(0), solved(unit), "{trial}, {unit}");
        }
    }
}

/// Sweeps that end too early say that they have not converged, on problems that have a solution: a body that stands on
/// redundant rows, whose friction moves their gaps more than their normal forces do. So does a contact that would jam
/// alone, where another one may push it open.
#[test]
fn sweeps_that_do_not_end_prove_nothing() {
    let (w, q) = boxes::problem(&pile(&[[0.0; 2]]), &[0.1, 0.0, -1.0, 0.0, 0.0, 0.0]);
    let friction = 1.1 * w[0] / w[1].hypot(w[2]);
    let sets = [cone(3, friction); 4];
    check(&w, &q, &sets, &solve(&mut ActiveSet::default(), (&w, &q, &sets)).unwrap(), 1e-9, "a box");
    let failed = solve(&mut GaussSeidel::default().sweeps(3), (&w, &q, &sets));
    assert!(matches!(failed, Err(ContactFailure::NotConverged { .. })), "{failed:?}");
    let w = [1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let jams = |coupling: f64| {
        let w: Vec<_> = (0..9).map(|k| if [2, 5, 6, 7].contains(&k) { coupling } else { w[k] }).collect();
        let sets = [cone(2, friction), AdmissibleSet::NonNegative];
        solve(&mut GaussSeidel::default(), (&w, &[-1.0, 0.5, -1.0], &sets))
    };
    assert!(matches!(jams(0.0), Err(ContactFailure::Jammed { row: 0, .. })), "{:?}", jams(0.0));
    assert!(!matches!(jams(0.1), Err(ContactFailure::Jammed { .. })), "{:?}", jams(0.1));
}

/// A contact in space whose W is of rank two, or one: where it is said to jam, no friction |f| = μ p against its slip
/// closes the gap. f solves (W_tt − W_tn W_nt/W_nn + γ) f = −c, and the sum of both sides is scanned over γ.
#[test]
fn a_contact_in_space_that_jams_has_no_solution() {
    let mut random = Congruential(83);
    let (mut jammed, mut solved) = (0, 0);
    for trial in 0..400 {
        let w = semidefinite(&mut random, 3, 1 + trial % 2, 0.0);
        let mut q = random.vector(3, 1.0);
        q[0] = -q[0].abs();
        let friction = 3.0;
        match solve(&mut GaussSeidel::default().sweeps(20), (&w, &q, &[cone(3, friction)])) {
            Ok(found) => {
                solved += 1;
                check(&w, &q, &[cone(3, friction)], &found, 1e-8, &format!("trial {trial}"));
            }
            Err(ContactFailure::Jammed { .. }) => {
                jammed += 1;
                let s = |i: usize, j: usize| w[3 * i + j] - w[3 * i] * w[j] / w[0];
                let c = [1, 2].map(|i| q[i] - w[3 * i] * q[0] / w[0]);
                for exponent in -4000..4000 {
                    let gamma = 10.0_f64.powf(f64::from(exponent) / 500.0);
                    let [a, b, d] = [s(1, 1) + gamma, s(1, 2), s(2, 2) + gamma];
                    let f = [b * c[1] - d * c[0], b * c[0] - a * c[1]].map(|x| x / (a * d - b * b));
                    let p = -(q[0] + w[1] * f[0] + w[2] * f[1]) / w[0];
                    assert!(f[0].hypot(f[1]) < friction * p, "trial {trial}: γ = {gamma:e}");
                }
            }
            Err(failure) => assert!(matches!(failure, ContactFailure::NotConverged { .. }), "{failure}"),
        }
    }
    assert!(jammed > 20 && solved > 100, "{jammed} jam, {solved} are solved");
}
