//! Any number of bodies in codes of their own, coupled by weighted rows: as in one code, and the equations of their
//! interfaces.

use crate::body::flexibility;
use crate::many::{Many, compare};
use crate::scene::{H, Scene};
use contact_dynamics::Error;
use contact_dynamics::contact_solver::{ContactFailure, Pivoting};
use contact_dynamics::faer::Mat;
use contact_dynamics::faer::prelude::Solve;
use contact_dynamics::partitioned::{Assembled, Assembly, Coupling};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::{Bars, MassKind};

#[test]
fn bars_move_as_in_one_code() {
    for phase in [0.05, 0.35, 0.6, 0.95] {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            let bars = Many::two(Scene::bars(&Bars::paper(20).delayed(phase, H).with_mass(mass)));
            for (corrected, least) in [(true, 100), (false, 10)] {
                let pressed = compare(&format!("equal bars, phase {phase}, {mass:?}"), &bars, corrected, 400);
                assert!(pressed > least, "equal bars, phase {phase}, {mass:?}: {pressed} pressed");
            }
            let bars = Bars { elements: [20, 13], ..Bars::dissimilar(20) }.delayed(phase, H).with_mass(mass);
            let bars = Many::two(Scene::bars(&bars));
            let pressed = compare(&format!("dissimilar bars, phase {phase}, {mass:?}"), &bars, true, 550);
            assert!(pressed > 100, "dissimilar bars, phase {phase}, {mass:?}: {pressed} pressed");
        }
    }
}

#[test]
fn bodies_that_meet_in_a_point_move_as_in_one_code() {
    for count in [3, 4] {
        for phase in [0.05, 0.4, 0.75] {
            let scene = Many::point(count, phase);
            for corrected in [true, false] {
                let pressed = compare(&format!("{count} bodies, phase {phase}"), &scene, corrected, 300);
                assert!(pressed > 20, "{count} bodies, phase {phase}: {pressed} pressed");
            }
        }
    }
}

#[test]
fn faces_whose_nodes_do_not_match_move_as_in_one_code() {
    for phase in [0.1, 0.5, 0.8] {
        let scene = Many::facets(phase);
        assert_eq!(scene.weighted(), 10);
        for corrected in [true, false] {
            let pressed = compare(&format!("facets, phase {phase}"), &scene, corrected, 300);
            assert!(pressed > 20, "phase {phase}: {pressed} pressed");
        }
    }
}

/// Bodies with random flexibilities and values, and rows over some dofs of two or three of them.
struct Chance {
    flexibilities: Vec<Vec<f64>>,
    free: Vec<Vec<f64>>,
    rows: Vec<Vec<(usize, usize, f64)>>,
    gaps: Vec<f64>,
}

impl Chance {
    fn new(random: &mut impl FnMut() -> f64, bodies: usize, count: usize) -> Self {
        let sizes: Vec<usize> = (0..bodies).map(|body| 4 + body % 3).collect();
        let flexibilities = sizes.iter().map(|&n| flexibility(random, n, n)).collect();
        let free = sizes.iter().map(|&n| (0..n).map(|_| random() - 0.5).collect()).collect();
        let pick = |random: &mut dyn FnMut() -> f64, n: usize| {
            let place = random() * n as f64;
            (1..n).filter(|&k| place >= k as f64).count()
        };
        let row = |random: &mut dyn FnMut() -> f64| {
            (0..4)
                .map(|k| {
                    let body = pick(random, bodies);
                    (body, pick(random, sizes[body]), if k % 2 == 0 { random() } else { -random() })
                })
                .collect()
        };
        let rows = (0..count).map(|_| row(random)).collect();
        let gaps = (0..count).map(|_| random() - 0.3).collect();
        Self { flexibilities, free, rows, gaps }
    }

    fn flexibilities(&self) -> Vec<&[f64]> {
        self.flexibilities.iter().map(Vec::as_slice).collect()
    }

    fn free(&self) -> Vec<&[f64]> {
        self.free.iter().map(Vec::as_slice).collect()
    }

    /// The equations of the interfaces, of contact (and ties) or of rows that are held.
    fn check(&self, found: &Assembled<f64>, is_free: impl Fn(usize) -> bool) {
        let (tiny, l) = (1e-11, found.multipliers());
        let mut gaps = self.gaps.clone();
        for (body, (flexibility, free)) in self.flexibilities.iter().zip(&self.free).enumerate() {
            let n = free.len();
            let mut forces = vec![0.0; n];
            for (row, l) in self.rows.iter().zip(l) {
                row.iter().filter(|entry| entry.0 == body).for_each(|&(_, dof, weight)| forces[dof] += weight * l);
            }
            assert!(forces.iter().zip(found.forces(body)).all(|(x, y)| (x - y).abs() < tiny));
            for i in 0..n {
                let value = free[i] + (0..n).map(|j| flexibility[i + j * n] * forces[j]).sum::<f64>();
                assert!((value - found.values(body)[i]).abs() < tiny);
            }
            for (gap, row) in gaps.iter_mut().zip(&self.rows) {
                let own = row.iter().filter(|entry| entry.0 == body);
                *gap += own.map(|&(_, dof, weight)| weight * found.values(body)[dof]).sum::<f64>();
            }
        }
        for (row, gap) in gaps.iter().enumerate() {
            assert!((gap - found.gaps()[row]).abs() < tiny);
            match is_free(row) {
                true => assert!(gap.abs() < tiny && found.closed()[row], "row {row}: {gap}"),
                false => assert!(l[row] >= 0.0 && *gap > -tiny && (l[row] == 0.0 || *gap < tiny), "row {row}: {gap}"),
            }
        }
    }
}

#[test]
fn assemblies_meet_the_equations_of_their_interfaces() {
    let mut random = xorshift(43);
    let [mut pressed, mut pulled] = [0; 2];
    for case in 0..100 {
        let bodies = 3 + case % 3;
        let chance = Chance::new(&mut random, bodies, 7);
        let is_tie = |row: usize| case % 2 == 1 && row.is_multiple_of(3);
        let coupling = |(row, entries): (usize, &Vec<_>)| match is_tie(row) {
            true => Coupling::equality(entries),
            false => Coupling::unilateral(entries),
        };
        let rows: Vec<_> = chance.rows.iter().enumerate().map(coupling).collect();
        let mut assembly = Assembly::new(&chance.flexibilities(), &rows).unwrap();
        let found = assembly.solve(&chance.free(), &chance.gaps).unwrap().clone();
        chance.check(&found, is_tie);
        pressed += (0..7).filter(|&row| !is_tie(row) && found.multipliers()[row] > 0.0).count();
        let mut other = Assembly::with_solver(&chance.flexibilities(), &rows, Pivoting::default()).unwrap();
        let expected = other.solve(&chance.free(), &chance.gaps).unwrap();
        let close = |x: &[f64], y: &[f64]| x.iter().zip(y).all(|(x, y)| (x - y).abs() < 1e-8 * (1.0 + y.abs()));
        assert!(close(found.multipliers(), expected.multipliers()));
        // Held rows, and all the others without force; then the same contact as before.
        let held: Vec<bool> = (0..7).map(|_| random() < 0.5).collect();
        let jump = assembly.hold(&chance.free(), &chance.gaps, &held).unwrap();
        assert_eq!(jump.closed(), held);
        let misses = |row: usize| if held[row] { jump.gaps()[row].abs() } else { jump.multipliers()[row].abs() };
        assert!((0..7).all(|row| misses(row) < 1e-11));
        pulled += jump.multipliers().iter().filter(|l| **l < 0.0).count();
        assert_eq!(assembly.solve(&chance.free(), &chance.gaps).unwrap().multipliers(), found.multipliers());
        // A body that is twice as flexible, and back.
        let softer: Vec<f64> = chance.flexibilities[1].iter().map(|x| 2.0 * x).collect();
        assembly.set_flexibility(1, &softer).unwrap();
        let soft = Chance { flexibilities: chance.flexibilities.clone(), ..chance };
        let changed = Chance {
            flexibilities: (0..bodies).map(|b| if b == 1 { &softer } else { &soft.flexibilities[b] }.clone()).collect(),
            ..soft
        };
        changed.check(assembly.solve(&changed.free(), &changed.gaps).unwrap(), is_tie);
    }
    assert!(pressed > 100 && pressed < 500 && pulled > 50, "{pressed} pressed, {pulled} pulled");
}

/// Rows of matching nodes of two bodies.
fn matching(n: usize) -> Vec<Vec<(usize, usize, f64)>> {
    (0..n).map(|i| vec![(0, i, -1.0), (1, i, 1.0)]).collect()
}

#[test]
fn rigid_and_rank_deficient_bodies_meet_the_equations_in_any_unit() {
    let mut random = xorshift(41);
    let n = 7;
    let rows: Vec<_> = matching(n).iter().map(|row| Coupling::unilateral(row)).collect();
    let rigid = vec![0.0; n * n];
    let mut assembly = Assembly::new(&[&rigid, &rigid], &rows).unwrap();
    let mut reference = Assembly::with_solver(&[&rigid, &rigid], &rows, Pivoting::default()).unwrap();
    let mut pressed = 0;
    for case in 0..200 {
        // A rigid obstacle now and then, rank-deficient bodies that make up for each other.
        let body = |random: &mut _, number: usize| match case % 4 {
            0 if number == 1 => rigid.clone(),
            1 => flexibility(random, n, n - 2),
            _ => flexibility(random, n, n),
        };
        let chance = Chance {
            flexibilities: (0..2).map(|number| body(&mut random, number)).collect(),
            free: (0..2).map(|_| (0..n).map(|_| random() - 0.5).collect()).collect(),
            rows: matching(n),
            gaps: (0..n).map(|_| random() - 0.3).collect(),
        };
        for (number, flexibility) in chance.flexibilities.iter().enumerate() {
            assembly.set_flexibility(number, flexibility).unwrap();
            reference.set_flexibility(number, flexibility).unwrap();
        }
        let found = assembly.solve(&chance.free(), &chance.gaps).unwrap();
        chance.check(found, |_| false);
        pressed += found.closed().iter().filter(|closed| **closed).count();
        let expected = reference.solve(&chance.free(), &chance.gaps).unwrap();
        let close = |x: &f64, y: &f64| (x - y).abs() < 1e-8 * (1.0 + y);
        assert!(found.multipliers().iter().zip(expected.multipliers()).all(|(x, y)| close(x, y)));
        // In other units of length and force nothing but the units changes.
        let (length, force) = (1e4, 1e-7);
        let scaled = |x: &[f64], by: f64| x.iter().map(|x| x * by).collect::<Vec<_>>();
        for (number, flexibility) in chance.flexibilities.iter().enumerate() {
            assembly.set_flexibility(number, &scaled(flexibility, length / force)).unwrap();
        }
        let free: Vec<_> = chance.free.iter().map(|free| scaled(free, length)).collect();
        let other = assembly.solve(&[&free[0], &free[1]], &scaled(&chance.gaps, length)).unwrap();
        assert_eq!(other.closed(), expected.closed());
        assert!(other.multipliers().iter().zip(expected.multipliers()).all(|(x, y)| close(&(x / force), y)));
    }
    assert!(pressed > 200 && pressed < 1200, "{pressed} pressed");
}

/// Bodies tied in a point by localized multipliers: unknowns are those of each body and the place of the frame,
/// [F, −1; 1ᵀ, 0] (l, x) = (−free, 0).
fn localized(flexibilities: &[f64], free: &[f64]) -> Vec<f64> {
    let k = free.len();
    let entry = |i: usize, j: usize| match (i < k, j < k) {
        (true, true) => f64::from(u8::from(i == j)) * flexibilities[i],
        (true, false) => -1.0,
        (false, true) => 1.0,
        (false, false) => 0.0,
    };
    let matrix = Mat::from_fn(k + 1, k + 1, entry);
    let right = Mat::from_fn(k + 1, 1, |i, _| if i < k { -free[i] } else { 0.0 });
    let solution = matrix.full_piv_lu().solve(&right);
    (0..=k).map(|i| solution[(i, 0)]).collect()
}

#[test]
fn ties_in_a_point_are_those_of_localized_multipliers_whichever_rows_say_so() {
    let mut random = xorshift(53);
    for k in [3, 4, 7] {
        let flexibilities: Vec<f64> = (0..k).map(|_| 0.1 + random()).collect();
        let free: Vec<f64> = (0..k).map(|_| random() - 0.5).collect();
        let expected = localized(&flexibilities, &free);
        let pair = |i: usize, j: usize| Coupling::equality(&[(i, 0, -1.0), (j, 0, 1.0)]);
        let chain: Vec<_> = (1..k).map(|j| pair(j - 1, j)).collect();
        // Most of them redundant.
        let all: Vec<_> = (0..k).flat_map(|j| (0..j).map(move |i| pair(i, j))).collect();
        for rows in [chain, all] {
            let flexible: Vec<[f64; 1]> = flexibilities.iter().map(|f| [*f]).collect();
            let flexible: Vec<&[f64]> = flexible.iter().map(<[f64; 1]>::as_slice).collect();
            let mut assembly = Assembly::new(&flexible, &rows).unwrap();
            let values: Vec<&[f64]> = free.chunks(1).collect();
            let found = assembly.solve(&values, &vec![0.0; rows.len()]).unwrap();
            let mut sum = 0.0;
            for (body, force) in expected[..k].iter().enumerate() {
                assert!((found.forces(body)[0] - force).abs() < 1e-12, "{k} bodies: {} {force}", found.forces(body)[0]);
                assert!((found.values(body)[0] - expected[k]).abs() < 1e-12);
                sum += found.forces(body)[0];
            }
            assert!(sum.abs() < 1e-13);
        }
    }
}

#[test]
fn jumps_of_rates_conserve_momentum_and_lose_energy() {
    let mut random = xorshift(59);
    for _ in 0..50 {
        let masses: Vec<f64> = (0..4).map(|_| 0.2 + random()).collect();
        let v: Vec<f64> = (0..4).map(|_| random() - 0.5).collect();
        let inverse: Vec<[f64; 1]> = masses.iter().map(|m| [1.0 / m]).collect();
        let inverse: Vec<&[f64]> = inverse.iter().map(<[f64; 1]>::as_slice).collect();
        // Rows whose weights add up to zero do not act on the motion as a whole.
        let share = random();
        let rows = [
            Coupling::unilateral(&[(0, 0, -share), (1, 0, share - 1.0), (2, 0, 1.0)]),
            Coupling::unilateral(&[(3, 0, 1.0), (2, 0, -1.0)]),
        ];
        let mut assembly = Assembly::new(&inverse, &rows).unwrap();
        let values: Vec<&[f64]> = v.chunks(1).collect();
        let found = assembly.hold(&values, &[0.0; 2], &[true; 2]).unwrap();
        let after: Vec<f64> = (0..4).map(|body| found.values(body)[0]).collect();
        let sum = |v: &[f64], power: i32| masses.iter().zip(v).map(|(m, v)| m * v.powi(power)).sum::<f64>();
        assert!((sum(&after, 1) - sum(&v, 1)).abs() < 1e-13);
        assert!(sum(&after, 2) < sum(&v, 2) && found.gaps().iter().all(|rate| rate.abs() < 1e-13));
    }
}

/// Bodies that touch do so wherever they are: what rounding leaves of a gap between large coordinates is none.
#[test]
fn bodies_that_touch_are_closed_far_from_the_origin() {
    let flexibility = [1.0];
    let rows = [Coupling::unilateral(&[(0, 0, -1.0), (1, 0, 1.0)])];
    let mut assembly = Assembly::new(&[&flexibility, &flexibility], &rows).unwrap();
    for far in [0.0, 1e3, 1e6, 1e9] {
        for k in 1..40 {
            // The gap is the place of the second body less that of the first, and the length of the first.
            let (place, length) = (0.37 * f64::from(k), 0.11 * f64::from(k));
            let (first, second) = ([far + place], [far + (place + length)]);
            let found = assembly.solve(&[&first, &second], &[-length]).unwrap();
            assert!(found.closed()[0], "{far} {k}: {:e}", found.gaps()[0]);
            assert!(found.multipliers()[0].abs() < 1e-14 * (1.0 + far));
        }
        // What is apart is open.
        let (first, second) = ([far + 0.5], [far + 1.5 + 1e-9 * (far + 1e3)]);
        assert!(!assembly.solve(&[&first, &second], &[-1.0]).unwrap().closed()[0]);
    }
}

#[test]
fn assemblies_refuse_what_is_no_interface() {
    let (one, two) = ([1.0], [2.0, 1.0, 1.0, 2.0]);
    let refused = |flexibilities: &[&[f64]], entries: &[(usize, usize, f64)]| {
        Assembly::new(flexibilities, &[Coupling::unilateral(entries)]).map(|_| ()).unwrap_err()
    };
    let row = [(0, 0, -1.0), (1, 1, 1.0)];
    let good: [&[f64]; 2] = [&one, &two];
    let named =
        |error: &Error, words: &str| matches!(error, Error::Incompatible { .. }) && error.to_string().contains(words);
    assert!(named(&refused(&good, &[(2, 0, 1.0)]), "row 0, which names body 2 of 2"));
    assert!(named(&refused(&good, &[(0, 1, 1.0)]), "interface dof 1 of body 0, which has 1"));
    assert!(matches!(refused(&good, &[(0, 0, 1.0), (1, 0, f64::NAN)]), Error::NotFinite { index: 1, .. }));
    assert!(matches!(refused(&[&one, &two[..3]], &row), Error::Dimension { expected: 1, found: 3, .. }));
    assert!(matches!(refused(&[&one, &[2.0, 1.0, -1.0, 2.0]], &row), Error::Asymmetric { matrix: "flexibility", .. }));
    for (dof, flexibility) in [[-1.0, 0.0, 0.0, 2.0], [2.0, 0.0, 0.0, -1.0]].iter().enumerate() {
        let error = refused(&[&one, flexibility], &row);
        assert!(matches!(error, Error::Singular { dof: found, .. } if found == dof), "{error}");
    }
    assert!(matches!(refused(&[&[f64::NAN], &two], &row), Error::NotFinite { index: 0, .. }));

    let mut assembly = Assembly::new(&good, &[Coupling::unilateral(&row)]).unwrap();
    let free: [&[f64]; 2] = [&[0.0], &[0.0, -0.3]];
    assert!(matches!(assembly.solve(&free[..1], &[0.0]), Err(Error::Dimension { expected: 2, found: 1, .. })));
    assert!(matches!(assembly.solve(&[&[0.0], &[0.0]], &[0.0]), Err(Error::Dimension { expected: 2, found: 1, .. })));
    assert!(matches!(assembly.solve(&free, &[]), Err(Error::Dimension { expected: 1, found: 0, .. })));
    assert!(matches!(assembly.solve(&free, &[f64::INFINITY]), Err(Error::NotFinite { index: 0, .. })));
    assert!(matches!(assembly.solve(&[&[0.0], &[0.0, f64::NAN]], &[0.0]), Err(Error::NotFinite { index: 1, .. })));
    assert!(matches!(assembly.hold(&free, &[0.0], &[true; 2]), Err(Error::Dimension { expected: 1, found: 2, .. })));
    assert!(matches!(assembly.set_flexibility(1, &one), Err(Error::Dimension { expected: 4, found: 1, .. })));
    assert!(matches!(assembly.set_flexibility(2, &one), Err(Error::Incompatible { .. })));
    // 0.3/(1 + 2), as if nothing had happened.
    assert!((assembly.solve(&free, &[0.0]).unwrap().multipliers()[0] - 0.1).abs() < 1e-15);
    // Between rigid bodies nothing gives way; the assembly can be used again.
    let apart = Coupling::unilateral(&[(0, 0, -1.0), (1, 0, 1.0)]);
    let mut rigid = Assembly::new(&[&[0.0], &[0.0]], &[apart.clone(), apart]).unwrap();
    let found = rigid.solve(&[&[0.0], &[0.0]], &[0.1, -0.1]).map(|_| ()).unwrap_err();
    let failure = |failure: &ContactFailure<f64>| matches!(failure, ContactFailure::NotConverged { row: 1, .. });
    assert!(matches!(&found, Error::Frame { failure: found } if failure(found)), "{found:?}");
    assert!(found.is_recoverable() && found.to_string().contains("assembly"));
    assert_eq!(rigid.solve(&[&[0.0], &[0.2]], &[0.1, -0.1]).unwrap().closed(), [false; 2]);
}
