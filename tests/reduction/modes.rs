//! Modes against closed forms of the same meshes: rigid motions, multiple frequencies, nothing missing.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::reduction::{GivenModes, Modes};
use contact_dynamics::{Error, Real, Result};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{Entry, diagonal, element, entries, matrix, product, springs};
use std::f64::consts::PI;

const STEEL: Material = Material { young: 210.0, poisson: 0.3, density: 7.8 };

type Matrix = SparseColMat<usize, f64>;

/// K and the lumped or consistent M of a bar of n elements with EA = ρA = 1 and elements of length 1.
fn bar(n: usize, consistent: bool) -> [Matrix; 2] {
    let [diagonal, off] = if consistent { [1.0 / 3.0, 1.0 / 6.0] } else { [0.5, 0.0] };
    let mass = (0..n).flat_map(|e| element(e, e + 1, [diagonal, off]));
    [matrix(n + 1, mass), matrix(n + 1, springs(n + 1, 1.0))]
}

/// The dispersion of linear elements of length 1: a wave number θ of the mesh has this frequency, exactly.
fn dispersion(theta: f64, consistent: bool) -> f64 {
    let lumped = 2.0 * (0.5 * theta).sin();
    if consistent { lumped / ((2.0 + theta.cos()) / 3.0).sqrt() } else { lumped }
}

fn lowest([mass, stiffness]: &[Matrix; 2], fixed: &[usize], count: usize) -> Result<Modes> {
    Modes::lowest(mass.as_ref(), stiffness.as_ref(), fixed, count)
}

fn assert_frequencies(modes: &Modes, exact: impl IntoIterator<Item = f64>, tolerance: f64) {
    let mut exact: Vec<f64> = exact.into_iter().collect();
    exact.sort_by(f64::total_cmp);
    for (k, (omega, exact)) in modes.frequencies().iter().zip(&exact).enumerate() {
        assert!((omega - exact).abs() <= tolerance * exact, "mode {k}: {omega} {exact}");
    }
    assert!(exact.len() >= modes.count());
}

fn assert_orthonormal(modes: &Modes, mass: &Matrix) {
    let shapes: Vec<Vec<f64>> = (0..modes.count()).map(|k| modes.shape(k)).collect();
    for (i, x) in shapes.iter().enumerate() {
        let inertia = product(mass.as_ref(), x);
        for (j, y) in shapes.iter().enumerate() {
            let unit = f64::from(u8::from(i == j));
            let dot: f64 = y.iter().zip(&inertia).map(|(x, y)| x * y).sum();
            assert!((dot - unit).abs() < 1e-10, "{i} {j}: {dot}");
        }
    }
}

#[test]
fn bars_have_the_frequencies_of_their_mesh() {
    for consistent in [false, true] {
        for n in [1, 2, 7, 60, 400] {
            let matrices = bar(n, consistent);
            let count = (n + 1).min(45);
            let free = lowest(&matrices, &[], count).unwrap();
            assert_eq!((free.rigid(), free.frequencies()[0]), (1, 0.0), "{n}");
            assert_frequencies(&free, (0..=n).map(|k| dispersion(k as f64 * PI / n as f64, consistent)), 1e-10);
            assert_orthonormal(&free, &matrices[0]);
            let fixed = lowest(&matrices, &[n], count.min(n)).unwrap();
            assert_eq!(fixed.rigid(), 0);
            let theta = |k: usize| (k as f64 + 0.5) * PI / n as f64;
            assert_frequencies(&fixed, (0..n).map(|k| dispersion(theta(k), consistent)), 1e-10);
            assert!(fixed.shape(0)[n] == 0.0 && fixed.residual() < 1e-10 && fixed.factorizations() <= 3);
        }
    }
}

#[test]
fn all_modes_of_small_bodies_are_found_and_none_is_next() {
    let modes = lowest(&bar(9, true), &[], 10).unwrap();
    assert!(modes.next_frequency().is_infinite());
    assert_frequencies(&modes, (0..10).map(|k| dispersion(f64::from(k) * PI / 9.0, true)), 1e-9);
    let part = lowest(&bar(9, true), &[], 4).unwrap();
    assert!((part.next_frequency() / modes.frequencies()[4] - 1.0).abs() < 1e-9);
}

#[test]
fn modes_up_to_a_frequency_are_all_of_them() {
    let n = 80;
    let [mass, stiffness] = bar(n, false);
    let omega = |k: usize| dispersion(k as f64 * PI / n as f64, false);
    let limit = 0.5 * (omega(30) + omega(31));
    let modes = Modes::up_to(mass.as_ref(), stiffness.as_ref(), &[], limit).unwrap();
    assert_eq!(modes.count(), 31);
    // (No mode of so many is without rounding.)
    assert!(modes.residual() > 0.0 && modes.residual() < 1e-10, "{}", modes.residual());
    assert!((modes.next_frequency() / omega(31) - 1.0).abs() < 1e-10);
    let none = Modes::up_to(mass.as_ref(), stiffness.as_ref(), &[n], 0.5 * omega(1) * 0.9);
    assert!(matches!(none, Err(Error::Empty { .. })));
}

/// A square membrane of springs and unit masses with a fixed edge: ω² = 4 sin² + 4 sin², each pair twice.
#[test]
fn multiple_frequencies_of_a_membrane_come_with_all_their_modes() {
    let n = 17;
    let node = |i: usize, j: usize| i + n * j;
    let mut springs: Vec<Entry> = Vec::new();
    for i in 0..n {
        for j in 0..n {
            // Springs to the fixed edge stand on the diagonal alone.
            let to_edge = [i == 0, i == n - 1, j == 0, j == n - 1].iter().filter(|edge| **edge).count();
            springs.push((node(i, j), node(i, j), to_edge as f64));
            if i + 1 < n {
                springs.extend(element(node(i, j), node(i + 1, j), [1.0, -1.0]));
            }
            if j + 1 < n {
                springs.extend(element(node(i, j), node(i, j + 1), [1.0, -1.0]));
            }
        }
    }
    let (k, m): (Matrix, Matrix) = (matrix(n * n, springs), diagonal(&vec![1.0; n * n]));
    let of = |i: usize| 2.0 * (0.5 * i as f64 * PI / (n + 1) as f64).sin();
    let exact = || (1..=n).flat_map(|i| (1..=n).map(move |j| of(i).hypot(of(j))));
    for count in [1, 2, 3, 16, 55, 120] {
        let modes = lowest(&[m.clone(), k.clone()], &[], count).unwrap();
        assert_eq!((modes.count(), modes.rigid()), (count, 0));
        assert_frequencies(&modes, exact(), 1e-10);
        assert_orthonormal(&modes, &m);
    }
}

/// Eleven equal bars: every frequency eleven times, more often than the band of the iteration is wide at first.
#[test]
fn equal_bodies_have_every_frequency_as_often() {
    let (n, bodies) = (12, 11);
    let [m, k] = bar(n, true);
    let many = |a: &Matrix| -> Matrix {
        let copies = (0..bodies)
            .flat_map(|b| entries(a).into_iter().map(move |(i, j, x)| (i + b * (n + 1), j + b * (n + 1), x)));
        matrix(bodies * (n + 1), copies)
    };
    let modes = lowest(&[many(&m), many(&k)], &[], 4 * bodies).unwrap();
    assert_eq!(modes.rigid(), bodies);
    let exact = (0..=n).flat_map(|k| vec![dispersion(k as f64 * PI / n as f64, true); bodies]);
    assert_frequencies(&modes, exact, 1e-9);
}

/// Twenty equal springs to the ground, coupled by nothing but one of them to its neighbor: the band is narrower than
/// the multiplicity, and only the count finds what is missing.
#[test]
fn what_a_band_misses_is_counted_and_found() {
    let n = 40;
    // Stiffness 1 + the Laplacian of a complete graph: 1 once, n + 1 otherwise; M = 1.
    let size = n as f64;
    let full = (0..n * n).map(|e| (e / n, e % n, if e / n == e % n { size } else { -1.0 }));
    let k: Matrix = matrix(n, full);
    let modes = lowest(&[diagonal(&vec![1.0; n]), k], &[], 25).unwrap();
    assert_eq!(modes.rigid(), 0);
    assert!((modes.frequencies()[0] - 1.0).abs() < 1e-12);
    assert!(modes.frequencies()[1..].iter().all(|omega| (omega * omega / (size + 1.0) - 1.0).abs() < 1e-12));
}

#[test]
fn rigid_motions_of_solids_are_found_exactly() {
    let plate = Solid::rectangle([1.0, 2.0], [4, 7], STEEL).rotated(0.3).moved([50.0, -3.0]);
    let block = Solid::block([1.0, 2.0, 0.5], [3, 4, 2], STEEL).rotated([1.0, 2.0, 3.0], 0.7);
    for (matrices, rigid) in [
        ([plate.consistent_mass(), plate.stiffness()], 3),
        ([block.consistent_mass(), block.stiffness()], 6),
        ([diagonal(&block.lumped_mass::<f64>()), block.stiffness()], 6),
    ] {
        let modes = lowest(&matrices, &[], 20).unwrap();
        assert_eq!(modes.rigid(), rigid);
        assert!(modes.frequencies()[..rigid].iter().all(|&omega| omega == 0.0));
        let largest = product(matrices[1].as_ref(), &modes.shape(rigid)).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for k in 0..rigid {
            assert!(product(matrices[1].as_ref(), &modes.shape(k)).iter().all(|f| f.abs() < 1e-9 * largest));
        }
        assert_orthonormal(&modes, &matrices[0]);
        let alone = lowest(&matrices, &[], rigid).unwrap();
        assert!(alone.rigid() == rigid && alone.count() == rigid && alone.next_frequency() > 0.0);
    }
}

/// One more body turns what two have into what both have together.
#[test]
fn rigid_motions_of_several_bodies_are_counted_together() {
    let one = Solid::block([1.0; 3], [2, 2, 2], STEEL);
    let two = one.clone().with(one.moved([3.0, 0.0, 0.0]));
    let modes = lowest(&[two.consistent_mass(), two.stiffness()], &[], 30).unwrap();
    assert_eq!(modes.rigid(), 12);
    for pair in modes.frequencies()[12..].chunks_exact(2) {
        assert!((pair[0] / pair[1] - 1.0).abs() < 1e-10, "{pair:?}");
    }
}

#[test]
fn dofs_without_mass_have_no_modes() {
    let n = 30;
    let [_, stiffness] = bar(n, false);
    let mut masses = vec![1.0; n + 1];
    masses[0] = 0.0;
    let all = lowest(&[diagonal(&masses), stiffness.clone()], &[], n).unwrap();
    assert_eq!((all.count(), all.rigid()), (n, 1));
    let more = lowest(&[diagonal(&masses), stiffness.clone()], &[], n + 1);
    assert!(matches!(more, Err(Error::Parameter { .. })));
    // The massless end follows its neighbor: a bar of n masses on n − 1 springs.
    let shorter = lowest(&[diagonal(&vec![1.0; n]), matrix(n, springs(n, 1.0))], &[], n).unwrap();
    assert_frequencies(&all, shorter.frequencies().iter().copied(), 1e-9);
}

#[test]
fn powers_of_two_change_no_bit() {
    let block = Solid::rectangle([1.0, 2.0], [5, 6], STEEL);
    let (m, k) = (block.consistent_mass(), block.stiffness::<f64>());
    let base = lowest(&[m.clone(), k.clone()], &[], 25).unwrap();
    // Mass in units of 2^-6 (an even power: modes go as the root), time in units of 2^5.
    let scaled =
        |a: &Matrix, by: f64| -> Matrix { matrix(a.nrows(), entries(a).into_iter().map(|(i, j, x)| (i, j, by * x))) };
    let other = lowest(&[scaled(&m, 64.0), scaled(&k, 64.0 / 1024.0)], &[], 25).unwrap();
    for k in 0..25 {
        assert!((other.frequencies()[k] * 32.0 - base.frequencies()[k]).abs() <= 0.0, "{k}");
        assert!(base.shape(k).iter().zip(other.shape(k)).all(|(x, y)| (*x - 8.0 * y).abs() <= 0.0), "{k}");
    }
}

#[test]
fn any_order_of_dofs_has_the_same_modes() {
    let block = Solid::rectangle([1.0, 2.2], [4, 6], STEEL);
    let (m, k) = (block.consistent_mass(), block.stiffness::<f64>());
    let n = block.dofs();
    let place = |dof: usize| (dof * 29 + 5) % n;
    let moved = |a: &Matrix| -> Matrix { matrix(n, entries(a).into_iter().map(|(i, j, x)| (place(i), place(j), x))) };
    let (base, other) = (lowest(&[m.clone(), k.clone()], &[3], 18), lowest(&[moved(&m), moved(&k)], &[place(3)], 18));
    let (base, other) = (base.unwrap(), other.unwrap());
    assert_eq!(base.rigid(), other.rigid());
    assert_frequencies(&other, base.frequencies().iter().copied(), 1e-9);
    for k in base.rigid()..18 {
        let (x, y) = (base.shape(k), other.shape(k));
        let inertia = product(m.as_ref(), &x);
        let dot: f64 = (0..n).map(|dof| inertia[dof] * y[place(dof)]).sum();
        assert!((dot.abs() - 1.0).abs() < 1e-8, "{k}: {dot}");
    }
}

#[test]
fn matrices_in_single_precision_have_modes_too() {
    let block = Solid::rectangle([1.0, 2.0], [5, 6], STEEL);
    let single: SparseColMat<usize, f32> = {
        let (pattern, values) = block.consistent_mass().into_parts();
        SparseColMat::new(pattern, values.into_iter().map(f32::of).collect())
    };
    let modes = Modes::lowest(single.as_ref(), block.stiffness::<f32>().as_ref(), &[], 12).unwrap();
    let double = lowest(&[block.consistent_mass(), block.stiffness()], &[], 12).unwrap();
    assert_eq!(modes.rigid(), 3);
    assert_frequencies(&modes, double.frequencies().iter().copied(), 1e-4);
}

#[test]
fn modes_of_another_code_are_checked() {
    let [mass, stiffness] = bar(20, true);
    let own = lowest(&[mass.clone(), stiffness.clone()], &[], 6).unwrap();
    let take = |frequencies: &[f64], shapes: Vec<f64>, next: f64| {
        let given = GivenModes { frequencies, shapes: &shapes, next, tolerance: 1e-5 };
        Modes::given(mass.as_ref(), stiffness.as_ref(), &[], &given)
    };
    let shapes = |list: &[usize]| list.iter().flat_map(|&k| own.shape(k)).collect::<Vec<_>>();
    // Seven digits, as in a file.
    let round = |x: &f64| (x * 1e7).round() / 1e7;
    let all: Vec<f64> = shapes(&[0, 1, 2, 3, 4, 5]).iter().map(round).collect();
    let omega = own.frequencies();
    let modes = take(omega, all.clone(), own.next_frequency()).unwrap();
    assert_eq!((modes.count(), modes.rigid()), (6, 1));
    assert!(modes.shape(0).windows(2).all(|pair| (pair[0] - pair[1]).abs() < 1e-13));
    // One is left out, one twice as long, one in another order, one not what it is said to be.
    let without = [omega[0], omega[1], omega[3]];
    let missed = take(&without, shapes(&[0, 1, 3]), omega[4]);
    assert!(matches!(missed, Err(Error::ModesMissed { found: 3, expected: 4, .. })), "{missed:?}");
    let long: Vec<f64> = all.iter().map(|x| 2.0 * x).collect();
    assert!(matches!(take(omega, long, own.next_frequency()), Err(Error::ModeResidual { mode: 0, .. })));
    let mut swapped = omega.to_vec();
    swapped[2] = 1.01 * omega[2];
    let wrong = take(&swapped, all.clone(), own.next_frequency());
    assert!(matches!(wrong, Err(Error::ModeResidual { mode: 2, .. })), "{wrong:?}");
    let mut bent = all.clone();
    bent[3] += 0.1;
    assert!(matches!(take(omega, bent, own.next_frequency()), Err(Error::ModeResidual { .. })));
    // Rigid motions of two bars that are not orthogonal to each other: the later one is named.
    let apart: Matrix = matrix(4, [0, 2].into_iter().flat_map(|node| element(node, node + 1, [1.0, -1.0])));
    let (lumped, skew) = (diagonal(&[0.5; 4]), [1.0, 1.0, 0.0, 0.0].into_iter().chain([0.5_f64.sqrt(); 4]));
    let skew: Vec<f64> = skew.collect();
    let given = GivenModes { frequencies: &[0.0; 2], shapes: &skew, next: 2.0, tolerance: 1e-5 };
    let oblique = Modes::given(lumped.as_ref(), apart.as_ref(), &[], &given);
    assert!(matches!(oblique, Err(Error::ModeResidual { mode: 1, .. })), "{oblique:?}");
    // What comes next is said to come before the last.
    let early = take(omega, all.clone(), 0.5 * (omega[4] + omega[5]));
    assert!(matches!(early, Err(Error::Parameter { .. })), "{early:?}");
    // Or with it: a cluster that is cut.
    let cut = take(omega, all.clone(), omega[5]);
    assert!(matches!(cut, Err(Error::Parameter { value, .. }) if value <= omega[5]), "{cut:?}");
    // An elastic mode that is said to be rigid.
    let named = take(&[0.0, 0.0], shapes(&[0, 1]), omega[2]);
    assert!(matches!(named, Err(Error::ModeResidual { mode: 1, .. })), "{named:?}");
}

/// A plate with massless contact nodes: vectors of the iteration gather parts of the null space of M.
#[test]
fn null_spaces_of_the_mass_do_not_enter_the_modes() {
    let plate = Solid::rectangle([1.0; 2], [16, 16], STEEL);
    let mut masses = plate.lumped_mass::<f64>();
    for (node, place) in plate.nodes.iter().enumerate().filter(|(_, place)| place[1] == 0.0) {
        assert!(place[0] >= 0.0);
        masses[2 * node + 1] = 0.0;
    }
    let matrices = [diagonal(&masses), plate.stiffness()];
    for count in [20, 100, 400] {
        let modes = lowest(&matrices, &[], count).unwrap();
        assert_eq!(modes.rigid(), 3);
        assert_orthonormal(&modes, &matrices[0]);
        for k in 3..count {
            let shape = modes.shape(k);
            let [force, inertia] = [&matrices[1], &matrices[0]].map(|a| product(a.as_ref(), &shape));
            let square = modes.frequencies()[k].powi(2);
            let size = force.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            assert!(force.iter().zip(&inertia).all(|(f, m)| (f - square * m).abs() < 1e-6 * size), "{k}");
        }
    }
}
