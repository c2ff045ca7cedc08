//! Massless contact dofs: redistributed, singular and mixed mass matrices, against closed forms.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::faer::{Mat, Side};
use contact_dynamics::mass::{self, Mass, Redistribution};
use contact_dynamics::{ContactLaw, Error, Real};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{diagonal, element, matrix, rectangular};

type Matrix = SparseColMat<usize, f64>;

const MATERIAL: Material = Material { young: 2.0, poisson: 0.3, density: 0.7 };

macro_rules! refused {
    ($call:expr, $pattern:pat) => {
        match $call {
            Err($pattern) => {}
            other => panic!("{other:?}"),
        }
    };
}

/// The consistent mass of linear bar elements, ρA = 1.
fn bar(lengths: &[f64]) -> Matrix {
    let element = |(e, l): (usize, &f64)| element(e, e + 1, [l / 3.0, l / 6.0]);
    matrix(lengths.len() + 1, lengths.iter().enumerate().flat_map(element))
}

fn dense(m: &Matrix) -> Vec<Vec<f64>> {
    let dense = m.to_dense();
    (0..m.nrows()).map(|i| (0..m.ncols()).map(|j| dense[(i, j)]).collect()).collect()
}

fn row_sums(m: &Matrix) -> Vec<f64> {
    dense(m).iter().map(|row| row.iter().sum()).collect()
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    let worst = found.iter().zip(expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    assert!(worst < tolerance, "{found:?}\ninstead of {expected:?}");
}

/// Positive semidefinite, with nothing stored in the rows and columns of the massless dofs and nothing else without
/// mass.
fn check_singular(m: &Matrix, massless: &[usize]) {
    let m = m.as_ref();
    for column in 0..m.ncols() {
        let rows = m.row_idx_of_col_raw(column);
        assert!(if massless.contains(&column) { rows.is_empty() } else { rows.iter().all(|r| !massless.contains(r)) });
    }
    let values = m.to_dense().self_adjoint_eigenvalues(Side::Lower).unwrap();
    let largest = values.iter().copied().fold(0.0, f64::max);
    assert!(values.iter().all(|x| *x > -1e-14 * largest));
    assert_eq!(values.iter().filter(|x| **x < 1e-6 * largest).count(), massless.len());
}

/// ψᵀ M ψ′ of the motions 1, x, y, z within each direction: mass, center and second moments, about the origin.
fn inertia<const D: usize>(solid: &Solid<D>, m: &Matrix) -> Vec<f64> {
    let m = m.as_ref();
    let motion = |k: usize, node: usize| if k == 0 { 1.0 } else { solid.nodes[node][k - 1] };
    let mut found = Vec::new();
    for axis in 0..D {
        for (k, l) in (0..=D).flat_map(|k| (k..=D).map(move |l| (k, l))) {
            let mut sum = 0.0;
            for column in (axis..m.ncols()).step_by(D) {
                for (&row, value) in m.row_idx_of_col_raw(column).iter().zip(m.val_of_col(column)) {
                    if row % D == axis {
                        sum += value * motion(k, row / D) * motion(l, column / D);
                    }
                }
            }
            found.push(sum);
        }
    }
    found
}

fn directions<const D: usize>(solid: &Solid<D>) -> Vec<usize> {
    (0..solid.dofs()).map(|dof| dof % D).collect()
}

/// The dofs of the nodes where `at` holds, along the last axis.
fn normal<const D: usize>(solid: &Solid<D>, at: impl Fn([f64; D]) -> bool) -> Vec<usize> {
    (0..solid.nodes.len()).filter(|&node| at(solid.nodes[node])).map(|node| Solid::<D>::dof(node, D - 1)).collect()
}

fn motions<const D: usize>(solid: &Solid<D>) -> Vec<Vec<f64>> {
    mass::affine_motions(solid.dofs(), &solid.nodes, &solid.node_dofs()).unwrap()
}

fn irregular() -> [Solid<2>; 2] {
    let bent = Solid::rectangle([3.0, 2.0], [5, 6], MATERIAL).mapped(|[x, y]| [x + 0.1 * y * y, y + 0.1 * x * x]);
    [bent, Solid::disc(2.0, 8, MATERIAL).moved([7.0, -3.0])]
}

#[test]
fn the_end_of_a_bar_gives_its_mass_to_its_neighbor_or_to_all() {
    let m = bar(&[1.0, 1.0, 1.0, 1.0]);
    let lumped = mass::lump(m.as_ref()).unwrap();
    let near = Redistribution::Neighbors(m.symbolic());
    let redistribute = |massless: &[usize], by| mass::redistribute(&lumped, massless, &[0; 5], by).unwrap();
    close(&redistribute(&[0], near), &[0.0, 1.5, 1.0, 1.0, 0.5], 1e-15);
    close(&redistribute(&[4, 0], near), &[0.0, 1.5, 1.0, 1.5, 0.0], 1e-15);
    close(&redistribute(&[2], near), &[0.5, 1.5, 0.0, 1.5, 0.5], 1e-15);
    let factor = 4.0 / 3.5;
    close(&redistribute(&[0], Redistribution::Uniform), &[0.0, factor, factor, factor, 0.5 * factor], 1e-15);
    // Shares go by mass: neighbors of 1 and 3 times the mass.
    let unequal = mass::lump(bar(&[1.0, 1.0, 5.0]).as_ref()).unwrap();
    let cut = mass::redistribute(&unequal, &[1], &[0; 4], Redistribution::Neighbors(bar(&[1.0; 3]).symbolic()));
    close(&cut.unwrap(), &[0.5 + 1.0 / 7.0, 0.0, 3.0 + 6.0 / 7.0, 2.5], 1e-15);
    // Nothing to do, and nothing left to do.
    assert_eq!(redistribute(&[], near), lumped);
    let once = redistribute(&[0], near);
    assert_eq!(mass::redistribute(&once, &[0, 0], &[0; 5], near).unwrap(), once);
}

/// 3 × 3 nodes, the lowest massless upward: shares 1/3 and 2/3 of a corner, 1/4, 1/2, 1/4 of the middle.
#[test]
fn a_tapered_end_gives_more_of_its_mass_to_all() {
    // Five elements of mass 1: the first node gives ½, its neighbor a fifth of 1, to the 4.5 that are kept, less the
    // fifth.
    let lumped = [0.5, 1.0, 1.0, 1.0, 1.0, 0.5];
    let m = bar(&[1.0; 5]);
    let by = Redistribution::Tapered { neighbors: m.symbolic(), fraction: 0.2 };
    let expected = [0.0, 0.8, 1.0, 1.0, 1.0, 0.5].map(|m: f64| m * 5.0 / 4.3);
    close(&mass::redistribute(&lumped, &[0], &[0; 6], by).unwrap(), &expected, 1e-14);
    // The consistent mass: its row sums do the same, and both ends may give.
    let cut = mass::redistribute_consistent(m.as_ref(), &[0], &[0; 6], by).unwrap();
    close(&row_sums(&cut), &expected, 1e-14);
    check_singular(&cut, &[0]);
    let both = mass::redistribute(&lumped, &[5, 0], &[0; 6], by).unwrap();
    close(&both, &[0.0, 0.8, 1.0, 1.0, 0.8, 0.0].map(|m: f64| m * 5.0 / 3.6), 1e-14);
    // A neighbor of two gives once, and a fraction of nothing is the uniform option.
    let two = mass::redistribute(&lumped, &[1, 3], &[0; 6], by).unwrap();
    close(&two, &[0.4, 0.0, 0.8, 0.0, 0.8, 0.5].map(|m: f64| m * 5.0 / 2.5), 1e-14);
    let none = Redistribution::Tapered { neighbors: m.symbolic(), fraction: 0.0 };
    let uniform = mass::redistribute(&lumped, &[0], &[0; 6], Redistribution::Uniform).unwrap();
    close(&mass::redistribute(&lumped, &[0], &[0; 6], none).unwrap(), &uniform, 1e-15);
    for fraction in [1.0, -0.1, f64::NAN] {
        let by = Redistribution::Tapered { neighbors: m.symbolic(), fraction };
        assert!(matches!(mass::redistribute(&lumped, &[0], &[0; 6], by), Err(Error::Parameter { .. })));
    }
}

#[test]
fn neighbors_in_a_plate_share_by_mass_within_their_direction() {
    let plate = Solid::rectangle([2.0, 2.0], [2, 2], Material { density: 1.0, ..MATERIAL });
    let (lumped, k) = (plate.lumped_mass::<f64>(), plate.stiffness::<f64>());
    let massless = normal(&plate, |[_, y]| y == 0.0);
    let near = Redistribution::Neighbors(k.symbolic());
    let found = mass::redistribute(&lumped, &massless, &directions(&plate), near).unwrap();
    let side = 0.5 + 0.25 / 3.0 + 0.125;
    let middle = 1.0 + 2.0 * (0.5 / 3.0) + 0.25;
    let along = |axis: usize, m: &[f64]| m.iter().skip(axis).step_by(2).copied().collect::<Vec<f64>>();
    close(&along(1, &found), &[0.0, 0.0, 0.0, side, middle, side, 0.25, 0.5, 0.25], 1e-14);
    assert_eq!(along(0, &found), along(0, &lumped));
}

/// Bodies are told apart by their groups: what one gives away the other does not get.
#[test]
fn mass_stays_in_its_body() {
    let m = bar(&[1.0; 5]);
    let lumped = [0.5, 1.0, 0.5, 3.0, 6.0, 3.0];
    let groups = [7, 7, 7, usize::MAX, usize::MAX, usize::MAX];
    let uniform = mass::redistribute(&lumped, &[2, 3], &groups, Redistribution::Uniform).unwrap();
    close(&uniform, &[2.0 / 3.0, 4.0 / 3.0, 0.0, 0.0, 8.0, 4.0], 1e-14);
    let near = mass::redistribute(&lumped, &[2, 3], &groups, Redistribution::Neighbors(m.symbolic())).unwrap();
    close(&near, &[0.5, 1.5, 0.0, 0.0, 9.0, 3.0], 1e-14);
    // Far apart, each keeps its own inertia.
    let x: [[f64; 1]; 40] = std::array::from_fn(|node| [node as f64 + if node < 20 { 0.0 } else { 1e3 }]);
    let dofs: [[usize; 1]; 40] = std::array::from_fn(|node| [node]);
    let (motions, groups) = (mass::affine_motions(40, &x, &dofs).unwrap(), [[0; 20], [1; 20]].concat());
    let by = Redistribution::LeastSquares { motions: &motions, receivers: None };
    let found = mass::redistribute(&[1.0; 40], &[0, 39], &groups, by).unwrap();
    for (body, center) in [(0..20, 9.5), (20..40, 1029.5)] {
        let moment = |k| body.clone().map(|node| found[node] * (x[node][0] - center).powi(k)).sum::<f64>();
        close(&[moment(0), moment(1), moment(2)], &[20.0, 0.0, 665.0], 1e-9);
    }
}

/// Four equal masses take ½ from the place before them, by hand; three would have to extrapolate: 3, −3, 1 times ½.
#[test]
fn least_squares_of_a_bar_by_hand() {
    let lumped = [0.5, 1.0, 1.0, 1.0, 1.0, 1.0];
    let dofs: [[usize; 1]; 6] = std::array::from_fn(|node| [node]);
    let motions = mass::affine_motions(6, &dofs.map(|[x]| [x as f64]), &dofs).unwrap();
    let cut = |receivers| {
        mass::redistribute(&lumped, &[0], &[0; 6], Redistribution::LeastSquares { motions: &motions, receivers })
    };
    close(&cut(Some(&[4, 2, 0, 3, 1])).unwrap(), &[0.0, 2.125, 0.625, 0.375, 1.375, 1.0], 1e-14);
    match cut(Some(&[1, 2, 3])) {
        Err(Error::Mass { dof: 2, value }) => assert!((value + 0.5).abs() < 1e-14, "{value}"),
        other => panic!("{other:?}"),
    }
    // A matrix of the same masses is refused for the same place.
    let matrix: SparseColMat<usize, f64> = diagonal(&lumped);
    let by = Redistribution::LeastSquares { motions: &motions, receivers: Some(&[1, 2, 3]) };
    match mass::redistribute_consistent(matrix.as_ref(), &[0], &[0; 6], by) {
        Err(Error::Mass { dof: 2, value }) => assert!((value + 0.5).abs() < 1e-14, "{value}"),
        other => panic!("{other:?}"),
    }
    refused!(cut(Some(&[1, 2])), Error::Incompatible { .. });
    // One motion keeps the total alone: as the uniform option. Two of them total and center.
    let ones = Redistribution::LeastSquares { motions: &motions[..1], receivers: None };
    let uniform = mass::redistribute(&lumped, &[0], &[0; 6], Redistribution::Uniform).unwrap();
    close(&mass::redistribute(&lumped, &[0], &[0; 6], ones).unwrap(), &uniform, 1e-15);
    // With single precision, too.
    let by = Redistribution::LeastSquares { motions: &motions, receivers: Some(&[1, 2, 3, 4]) };
    let found = mass::redistribute(&lumped.map(f32::of), &[0], &[0; 6], by).unwrap();
    close(&found.into_iter().map(Real::value).collect::<Vec<_>>(), &[0.0, 2.125, 0.625, 0.375, 1.375, 1.0], 1e-6);
}

/// Whatever the masses: relative changes are a quadratic polynomial, which is what makes Σ δ²/m least.
#[test]
fn least_squares_change_the_density_by_a_polynomial() {
    let lengths = [0.5, 1.0, 0.4, 2.0, 1.0, 1.5, 0.8, 1.0, 2.0, 1.0];
    let mut x = vec![[3.0]];
    for (node, length) in lengths.iter().enumerate() {
        x.push([x[node][0] + length]);
    }
    let dofs: Vec<[usize; 1]> = (0..x.len()).map(|node| [node]).collect();
    let motions = mass::affine_motions(x.len(), &x, &dofs).unwrap();
    let (lumped, by) = (
        mass::lump(bar(&lengths).as_ref()).unwrap(),
        Redistribution::LeastSquares { motions: &motions, receivers: None },
    );
    let found = mass::redistribute(&lumped, &[0], &[0; 11], by).unwrap();
    let density = |node: usize| found[node] / lumped[node] - 1.0;
    for node in 1..x.len() {
        let fit = |at: usize| {
            let others = [1, 5, 10].into_iter().filter(|other| *other != at);
            density(at) * others.map(|o| (x[node][0] - x[o][0]) / (x[at][0] - x[o][0])).product::<f64>()
        };
        assert!(([1, 5, 10].map(fit).iter().sum::<f64>() - density(node)).abs() < 1e-12, "{node}");
    }
    for k in 0..3 {
        let moment = |m: &[f64]| m.iter().zip(&x).map(|(m, [x])| m * x.powi(k)).sum::<f64>();
        assert!((moment(&found) / moment(&lumped) - 1.0).abs() < 1e-13);
    }
}

fn least_squares_keeps_inertia<const D: usize>(solid: &Solid<D>, massless: &[usize]) {
    let (motions, groups) = (motions(solid), directions(solid));
    let by = Redistribution::LeastSquares { motions: &motions, receivers: None };
    let relative = |found: &[f64], expected: &[f64]| {
        let scale = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        close(found, expected, 1e-12 * scale);
    };
    let lumped = solid.lumped_mass::<f64>();
    let found = mass::redistribute(&lumped, massless, &groups, by).unwrap();
    assert!((0..found.len()).all(|dof| (found[dof] == 0.0) == massless.contains(&dof)));
    relative(&inertia(solid, &diagonal(&found)), &inertia(solid, &diagonal(&lumped)));

    let consistent = solid.consistent_mass();
    let found = mass::redistribute_consistent(consistent.as_ref(), massless, &groups, by).unwrap();
    check_singular(&found, massless);
    relative(&inertia(solid, &found), &inertia(solid, &consistent));
    // The change is not that of the lumped mass: it loses couplings as well.
    assert!(found.val().len() < consistent.val().len());
}

#[test]
fn least_squares_keep_mass_center_and_inertia_of_each_direction() {
    let plate = Solid::rectangle([3.0, 2.0], [6, 4], MATERIAL);
    least_squares_keeps_inertia(&plate, &normal(&plate, |[_, y]| y == 0.0));
    let both: Vec<usize> = normal(&plate, |[_, y]| y == 0.0).into_iter().flat_map(|dof| [dof - 1, dof]).collect();
    least_squares_keeps_inertia(&plate, &both);
    // A side of only three layers would leave others with less than nothing.
    let thin = Solid::rectangle([3.0, 2.0], [6, 3], MATERIAL);
    let (motions, side) = (motions(&thin), normal(&thin, |[_, y]| y == 0.0));
    let by = Redistribution::LeastSquares { motions: &motions, receivers: None };
    refused!(mass::redistribute(&thin.lumped_mass::<f64>(), &side, &directions(&thin), by), Error::Mass { .. });
    let consistent = thin.consistent_mass();
    refused!(
        mass::redistribute_consistent(consistent.as_ref(), &side, &directions(&thin), by),
        Error::Mass { .. } | Error::Singular { .. }
    );
    let [bent, disc] = irregular();
    let massless: Vec<usize> = (0..=5).map(|node| Solid::<2>::dof(node, 1)).collect();
    least_squares_keeps_inertia(&bent, &massless);
    least_squares_keeps_inertia(&disc, &normal(&disc, |[_, y]| y < -4.3));
    let block =
        Solid::block([2.0, 2.0, 1.5], [4, 4, 4], MATERIAL).mapped(|[x, y, z]| [x + 0.2 * y * z, y, z + 0.1 * x]);
    let massless: Vec<usize> = (0..25).map(|node| Solid::<3>::dof(node, 2)).collect();
    least_squares_keeps_inertia(&block, &massless);
}

/// The other options keep the total of each direction, and along a boundary with symmetric neighbors the center.
#[test]
fn all_options_keep_totals() {
    let [bent, disc] = irregular();
    for solid in [&bent, &disc, &Solid::rectangle([3.0, 2.0], [6, 4], MATERIAL)] {
        let massless: Vec<usize> = (0..=4).map(|node| Solid::<2>::dof(node, 1)).collect();
        let (groups, k) = (directions(solid), solid.stiffness::<f64>());
        let (lumped, consistent) = (solid.lumped_mass::<f64>(), solid.consistent_mass());
        for by in [Redistribution::Neighbors(k.symbolic()), Redistribution::Uniform] {
            let found = mass::redistribute(&lumped, &massless, &groups, by).unwrap();
            let matrix = mass::redistribute_consistent(consistent.as_ref(), &massless, &groups, by).unwrap();
            check_singular(&matrix, &massless);
            for (found, before) in [(diagonal(&found), diagonal(&lumped)), (matrix, consistent.clone())] {
                let (found, before) = (inertia(solid, &found), inertia(solid, &before));
                close(&[found[0], found[6]], &[before[0], before[6]], 1e-12 * before[0]);
                // The untouched direction keeps everything, the other one does not.
                close(&found[..6], &before[..6], 1e-15 * before[0]);
                assert!((found[8] - before[8]).abs() > 1e-4 * before[0]);
            }
        }
    }
    let plate = Solid::rectangle([3.0, 2.0], [6, 4], MATERIAL);
    let k = plate.stiffness::<f64>();
    let cut = |by| {
        let massless = normal(&plate, |[_, y]| y == 0.0);
        let found = mass::redistribute(&plate.lumped_mass(), &massless, &directions(&plate), by).unwrap();
        inertia(&plate, &diagonal(&found))[6..].to_vec()
    };
    let total = 0.7 * 6.0;
    let [near, far] = [Redistribution::Neighbors(k.symbolic()), Redistribution::Uniform].map(cut);
    // Rows of total/8, total/4, …: the lowest goes up by one element of ½, or to the mean of the others, at 8/7.
    close(&near[..3], &[total, 1.5 * total, (1.0 + 0.5 / 8.0) * total], 1e-13);
    close(&far[..3], &[total, 1.5 * total, 8.0 / 7.0 * total], 1e-13);
}

/// Row sums of what the consistent matrix becomes are what its row sums become.
#[test]
fn lumping_and_redistribution_commute() {
    let plate = Solid::rectangle([3.0, 2.0], [6, 4], MATERIAL).mapped(|[x, y]| [x + 0.3 * y, y]);
    let (k, consistent, groups) = (plate.stiffness::<f64>(), plate.consistent_mass(), directions(&plate));
    let (lumped, massless) = (plate.lumped_mass::<f64>(), normal(&plate, |[_, y]| y == 0.0));
    for weight in [1.0, 0.6, 0.0] {
        let blend = mass::blend(consistent.as_ref(), &lumped, weight).unwrap();
        for by in [Redistribution::Neighbors(k.symbolic()), Redistribution::Uniform] {
            let found = mass::redistribute_consistent(blend.as_ref(), &massless, &groups, by).unwrap();
            let expected = mass::redistribute(&lumped, &massless, &groups, by).unwrap();
            close(&row_sums(&found), &expected, 1e-14);
            // A diagonal matrix stays one, in its pattern too.
            if weight == 0.0 {
                assert_eq!(found.val().len(), plate.dofs() - massless.len());
            }
        }
    }
}

/// A quadratic bar element of mass 30: its first node has the row sum 5, couplings 2 and −1, neighbors of diagonal 16
/// and 4.
#[test]
fn quadratic_elements_may_lose_mass_where_couplings_are_negative() {
    let rows = [[4.0, 2.0, -1.0], [2.0, 16.0, 2.0], [-1.0, 2.0, 4.0]];
    let m: Matrix = matrix(3, (0..9).map(|k| (k / 3, k % 3, rows[k / 3][k % 3])));
    let found =
        mass::redistribute_consistent(m.as_ref(), &[0], &[0; 3], Redistribution::Neighbors(m.symbolic())).unwrap();
    close(found.val(), &[16.0 + 2.0 + 4.0, 2.0, 2.0, 4.0 - 1.0 + 1.0], 1e-14);
    // Losing a negative coupling makes this one indefinite: [0.72 0.9; 0.9 1].
    let entries = [(0, 0, 0.5), (0, 1, -0.28), (1, 0, -0.28), (1, 1, 1.0), (1, 2, 0.9), (2, 1, 0.9), (2, 2, 1.0)];
    let m: Matrix = matrix(4, entries.into_iter().chain([(3, 3, 1.0)]));
    let pattern: Matrix = matrix(4, [(3, 0, 1.0), (0, 3, 1.0)]);
    let by = Redistribution::Neighbors(pattern.symbolic());
    refused!(mass::redistribute_consistent(m.as_ref(), &[0], &[0; 4], by), Error::Singular { dof: 1 | 2, .. });
}

/// Relative changes of the lowest three frequencies of a bar, fixed at one end, of n equal elements, by the mass given
/// to its nodes 0 … n − 1 in place of the lumped one.
fn frequency_changes(masses: &[f64]) -> [f64; 3] {
    let n = masses.len();
    // Eigenvalues of M½ K⁻¹ M½ are 1/ω²; K⁻¹ is the distance from the support of the farther node from the end.
    let values = Mat::from_fn(n, n, |i, j| (masses[i] * masses[j]).sqrt() * (n - i.max(j)) as f64)
        .self_adjoint_eigenvalues(Side::Lower)
        .unwrap();
    std::array::from_fn(|mode| {
        let lumped = 2.0 * (0.5 * (mode as f64 + 0.5) * std::f64::consts::PI / n as f64).sin();
        values[n - 1 - mode].sqrt().recip() / lumped - 1.0
    })
}

#[test]
fn frequencies_of_a_bar_with_a_massless_end() {
    let pi = std::f64::consts::PI;
    let cut = |n: usize, option: usize, receivers: Option<&[usize]>| {
        let m = bar(&vec![1.0; n]);
        let dofs: Vec<[usize; 1]> = (0..=n).map(|node| [node]).collect();
        let x: Vec<[f64; 1]> = dofs.iter().map(|[node]| [*node as f64]).collect();
        let motions = mass::affine_motions(n + 1, &x, &dofs).unwrap();
        let by = match option {
            0 => Redistribution::Neighbors(m.symbolic()),
            1 => Redistribution::Uniform,
            _ => Redistribution::LeastSquares { motions: &motions, receivers },
        };
        let found = mass::redistribute(&mass::lump(m.as_ref()).unwrap(), &[0], &vec![0; n + 1], by).unwrap();
        frequency_changes(&found[..n])
    };
    let lumped: Vec<f64> = (0..80).map(|node| if node == 0 { 0.5 } else { 1.0 }).collect();
    close(&frequency_changes(&lumped), &[0.0; 3], 1e-12);
    // q = ω/c times the length of an element; closed forms to leading order in 1/n (theory, section 14).
    let n = 160;
    let [near, far, balanced] = [0, 1, 2].map(|option| cut(n, option, None));
    for mode in 0..3 {
        let angle = (mode as f64 + 0.5) * pi;
        let q = angle / n as f64;
        let found = [near[mode], far[mode], balanced[mode]].map(|x| 4.0 * n as f64 * x);
        assert!((found[0] / (q * q) - 1.0).abs() < 0.02, "{mode}: {found:?}");
        close(&found[1..], &[1.0, 1.0 - 3.0 / (angle * angle)], 5.0 / n as f64);
    }
    // Kept near the end, least squares are of third order as well.
    let receivers: Vec<usize> = (1..=8).collect();
    let [coarse, fine] = [40, 80].map(|n| cut(n, 2, Some(&receivers)));
    for (coarse, fine) in coarse.into_iter().zip(fine) {
        assert!(coarse / fine > 7.0, "{coarse} {fine}");
    }
    close(&fine, &[-2.8e-6, -4.0e-5, -1.84e-4], 1e-6);
    close(&cut(80, 0, None), &[1.2e-6, 1.08e-5, 3.0e-5], 1e-7);
}

#[test]
fn wrong_input_of_redistribution_is_refused_with_its_numbers() {
    let m = bar(&[1.0; 3]);
    let (lumped, near) = ([0.5, 1.0, 1.0, 0.5], Redistribution::Neighbors(m.symbolic()));
    let cut = |mass: &[f64], massless: &[usize], groups: &[usize], by| mass::redistribute(mass, massless, groups, by);
    refused!(cut(&lumped, &[4], &[0; 4], near), Error::MissingDof { dof: 4, dofs: 4, .. });
    refused!(cut(&lumped, &[0], &[0; 3], near), Error::Dimension { expected: 4, found: 3, .. });
    refused!(cut(&lumped[..3], &[0], &[0; 3], near), Error::Dimension { expected: 3, found: 4, .. });
    for wrong in [f64::NAN, f64::INFINITY, -1.0] {
        refused!(cut(&[wrong, 1.0, 1.0, 0.5], &[0], &[0; 4], near), Error::Mass { dof: 0, .. });
        refused!(cut(&[0.5, 1.0, wrong, 0.5], &[0], &[0; 4], near), Error::Mass { dof: 2, .. });
    }
    refused!(cut(&[0.5, 1.0, 0.0, 0.5], &[0], &[0; 4], near), Error::Mass { dof: 2, .. });
    // Nobody left: all of a body, both neighbors, a group of its own.
    refused!(cut(&lumped, &[3, 2, 1, 0], &[0; 4], Redistribution::Uniform), Error::Incompatible { .. });
    refused!(cut(&lumped, &[0, 1], &[0; 4], near), Error::Incompatible { .. });
    refused!(cut(&lumped, &[0], &[1, 0, 0, 0], near), Error::Incompatible { .. });
    refused!(cut(&lumped, &[0], &[1, 0, 0, 0], Redistribution::Uniform), Error::Incompatible { .. });
    let ones = [vec![1.0; 4]];
    let squares = |motions, receivers| Redistribution::LeastSquares { motions, receivers };
    refused!(cut(&lumped, &[0], &[0; 4], squares(&ones, Some(&[0]))), Error::Incompatible { .. });
    refused!(cut(&lumped, &[0], &[0; 4], squares(&ones, Some(&[9]))), Error::MissingDof { dof: 9, .. });
    refused!(cut(&lumped, &[0], &[0; 4], squares(&[], None)), Error::Empty { .. });
    let short = [vec![1.0; 3]];
    refused!(cut(&lumped, &[0], &[0; 4], squares(&short, None)), Error::Dimension { found: 3, .. });
    let broken = [vec![1.0, 1.0, f64::NAN, 1.0]];
    refused!(cut(&lumped, &[0], &[0; 4], squares(&broken, None)), Error::NotFinite { index: 2, .. });
    // All who could take the mass are at one height.
    let layer = Solid::rectangle([3.0, 1.0], [3, 1], MATERIAL).rotated(0.7);
    let (motions, massless) = (motions(&layer), [0, 2, 4, 6]);
    let flat = mass::redistribute(&layer.lumped_mass::<f64>(), &massless, &directions(&layer), squares(&motions, None));
    refused!(flat, Error::Incompatible { .. });

    let consistent =
        |m: &Matrix, massless: &[usize]| mass::redistribute_consistent(m.as_ref(), massless, &[0; 2], near);
    refused!(consistent(&matrix(2, [(0, 1, 1.0)]), &[0]), Error::Asymmetric { .. });
    refused!(consistent(&matrix(2, [(0, 0, f64::NAN)]), &[0]), Error::MatrixNotFinite { .. });
    refused!(consistent(&matrix(2, [(0, 0, 1.0)]), &[0]), Error::Mass { dof: 1, .. });
    refused!(consistent(&rectangular(2, 3, [(0, 0, 1.0)]), &[0]), Error::Dimension { .. });
    refused!(consistent(&matrix(2, [(0, 0, 1.0), (1, 1, 1.0)]), &[2]), Error::MissingDof { .. });

    let coordinates = [[0.0, 1.0], [2.0, 3.0]];
    refused!(mass::affine_motions(4, &coordinates, &[[0, 1]]), Error::Dimension { expected: 2, found: 1, .. });
    refused!(mass::affine_motions(3, &coordinates, &[[0, 1], [2, 3]]), Error::MissingDof { dof: 3, dofs: 3, .. });
    let broken = [[0.0, 1.0], [f64::NAN, 3.0]];
    refused!(mass::affine_motions(4, &broken, &[[0, 1], [2, 3]]), Error::NotFinite { index: 2, .. });
    assert!(mass::affine_motions::<f64, 2>(0, &[], &[]).is_ok());
}

#[test]
fn least_squares_do_not_depend_on_the_unit_of_mass() {
    let lumped = [0.5, 1.0, 1.0, 1.0, 1.0, 1.0];
    let dofs: [[usize; 1]; 6] = std::array::from_fn(|node| [node]);
    let motions = mass::affine_motions(6, &dofs.map(|[x]| [x as f64]), &dofs).unwrap();
    for unit in [1e-18, 1e-9, 1.0, 1e9, 1e18] {
        let masses = lumped.map(|m| unit * m);
        let cut = |receivers| {
            mass::redistribute(&masses, &[0], &[0; 6], Redistribution::LeastSquares { motions: &motions, receivers })
        };
        let found = cut(Some(&[1, 2, 3, 4])).unwrap();
        let expected = [0.0, 2.125, 0.625, 0.375, 1.375, 1.0].map(|m| unit * m);
        close(&found, &expected, 1e-14 * unit);
        // Two cannot keep three motions, and all at one height not what has a height.
        refused!(cut(Some(&[1, 2])), Error::Incompatible { .. });
        refused!(cut(Some(&[3])), Error::Incompatible { .. });
    }
}

/// Dofs and mass of every element of a solid.
fn element_masses<const D: usize>(solid: &Solid<D>) -> Vec<(Vec<usize>, Vec<f64>)> {
    let of = |element: &Vec<usize>| {
        let nodes = element.iter().map(|&node| solid.nodes[node]).collect();
        let alone = Solid { nodes, elements: vec![(0..element.len()).collect()], material: solid.material };
        let dofs = element.iter().flat_map(|&node| (0..D).map(move |axis| Solid::<D>::dof(node, axis))).collect();
        (dofs, dense(&alone.consistent_mass()).concat())
    };
    solid.elements.iter().map(of).collect()
}

#[test]
fn elements_give_their_mass_to_their_other_dofs() {
    // A bar: the same as redistribution to the neighbors.
    let (m, elements) =
        (bar(&[1.0; 4]), [0, 1, 2, 3].map(|e| ([e, e + 1], [2.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 2.0 / 6.0])));
    let found = mass::singular(elements, &[0], &[0; 5]).unwrap();
    let near = Redistribution::Neighbors(m.symbolic());
    let redistributed = mass::redistribute_consistent(m.as_ref(), &[0], &[0; 5], near).unwrap();
    assert_eq!(found.symbolic().row_idx(), redistributed.symbolic().row_idx());
    close(found.val(), redistributed.val(), 1e-15);
    // A dof without mass that is not listed, wherever it stands.
    for missing in 0..3 {
        let dofs: Vec<usize> = (0..3).filter(|&dof| dof != missing).collect();
        let refused = mass::singular([(dofs, [2.0, 1.0, 1.0, 2.0])], &[], &[0; 3]);
        assert!(matches!(refused, Err(Error::Mass { dof, .. }) if dof == missing), "{refused:?}");
    }
    // One quadrilateral of mass 0.7: its upper nodes have 3 · 0.7/36 [4 2; 2 4] upward.
    let one = Solid::rectangle([1.0, 1.0], [1, 1], MATERIAL);
    let found = mass::singular(element_masses(&one), &[1, 3], &directions(&one)).unwrap();
    check_singular(&found, &[1, 3]);
    let found = dense(&found);
    close(&[found[5][5], found[5][7], found[7][5], found[7][7]], &[0.7 / 3.0, 0.7 / 6.0, 0.7 / 6.0, 0.7 / 3.0], 1e-15);
    close(&[found[0][0], found[0][2], found[4][0]], &[0.7 / 9.0, 0.7 / 18.0, 0.7 / 18.0], 1e-15);

    let [bent, disc] = irregular();
    for solid in [bent, disc] {
        let massless: Vec<usize> = (0..5).map(|node| Solid::<2>::dof(node, 1)).collect();
        let consistent = solid.consistent_mass();
        let whole = mass::singular(element_masses(&solid), &[], &directions(&solid)).unwrap();
        close(&dense(&whole).concat(), &dense(&consistent).concat(), 1e-14);
        let found = mass::singular(element_masses(&solid), &massless, &directions(&solid)).unwrap();
        check_singular(&found, &massless);
        let (after, before) = (inertia(&solid, &found), inertia(&solid, &consistent));
        close(&after[..6], &before[..6], 1e-13 * before[0]);
        close(&after[6..7], &before[6..7], 1e-13 * before[0]);
        // Mass has gone inward, by less than one element.
        let shift = (after[8] - before[8]) / before[6];
        assert!(shift > 0.0 && shift < 0.05, "{shift}");
    }
}

#[test]
fn elements_of_other_kinds_keep_their_mass() {
    // Lumped elements: a diagonal pattern.
    let lumped = [0, 1, 2].map(|e| (vec![e, e + 1], vec![0.5, 0.0, 0.0, 0.5]));
    let found = mass::singular(lumped, &[3], &[0; 4]).unwrap();
    assert_eq!(found.symbolic().row_idx(), [0, 1, 2]);
    assert_eq!(found.val(), [0.5, 1.0, 1.5]);
    // Two groups with an entry between them: it takes the geometric mean of the factors 4 and 1.
    let coupled = [[1.0, 1.0, 0.0], [1.0, 1.5, 0.5], [0.0, 0.5, 1.0]].concat();
    let found = mass::singular([([0, 1, 2], coupled)], &[0], &[0, 0, 1]).unwrap();
    close(found.val(), &[4.5, 0.5 * 3.0_f64.sqrt(), 0.5 * 3.0_f64.sqrt(), 1.0], 1e-14);
    // Collapsed elements name a dof twice.
    let found = mass::singular([([0, 1, 1], [1.0; 9])], &[0], &[0; 2]).unwrap();
    close(found.val(), &[9.0], 1e-14);
}

#[test]
fn wrong_elements_are_refused_with_their_numbers() {
    let element = [2.0, 1.0, 1.0, 2.0];
    let cut = |elements: &[([usize; 2], [f64; 4])], massless: &[usize]| {
        mass::singular(elements.iter().copied(), massless, &[0; 3])
    };
    match cut(&[([1, 2], element), ([0, 1], element)], &[0, 1]) {
        Err(Error::Incompatible { part, .. }) => assert_eq!(part, "element 1"),
        other => panic!("{other:?}"),
    }
    refused!(cut(&[([0, 1], element)], &[0]), Error::Mass { dof: 2, .. });
    refused!(cut(&[([0, 3], element)], &[0]), Error::MissingDof { dof: 3, dofs: 3, .. });
    refused!(cut(&[([0, 1], element)], &[5]), Error::MissingDof { dof: 5, .. });
    let broken = [2.0, f64::NAN, 1.0, 2.0];
    refused!(cut(&[([2, 1], broken)], &[0]), Error::MatrixNotFinite { row: 2, column: 1, .. });
    refused!(cut(&[([0, 1], element), ([1, 2], [2.0, 0.5, 1.0, 2.0])], &[0]), Error::Asymmetric { .. });
    refused!(cut(&[([0, 1], [2.0, 1.0, 1.0, -2.0])], &[0]), Error::Incompatible { .. });
    refused!(mass::singular([([0, 1], [1.0; 3])], &[0], &[0; 2]), Error::Dimension { expected: 4, found: 3, .. });
}

/// A bar whose first element's velocity follows its inner node: C invertible on the others.
#[test]
fn mixed_mass_of_a_bar() {
    let n = 6;
    let halves = (1..n).flat_map(|e| [(e, e, 0.5), (e, e + 1, 0.5)]);
    let c = rectangular(n, n + 1, halves.chain([(0, 1, 1.0), (0, 0, 0.0)]));
    let m = mass::mixed(c.as_ref(), &vec![1.0; n]).unwrap();
    check_singular(&m, &[0]);
    close(&row_sums(&m), &[0.0, 1.5, 1.0, 1.0, 1.0, 1.0, 0.5], 1e-15);
    close(&dense(&m)[1], &[0.0, 1.25, 0.25, 0.0, 0.0, 0.0, 0.0], 1e-15);

    // Any C and D: entry by entry, symmetric to the last bit.
    let value = |e: usize, i: usize| ((e * 7 + i * 5) % 4) as f64 - 1.3;
    let c = rectangular(4, 5, (0..20).filter(|k| k % 3 > 0).map(|k| (k / 5, k % 5, value(k / 5, k % 5))));
    let d = [0.3, 2.0, 0.7, 1.1];
    let (m, c_dense) = (dense(&mass::mixed(c.as_ref(), &d).unwrap()), dense(&c));
    for i in 0..5 {
        for j in 0..5 {
            let expected: f64 = (0..4).map(|e| c_dense[e][i] * c_dense[e][j] / d[e]).sum();
            assert!((m[i][j] - expected).abs() < 1e-14);
            assert_eq!(m[i][j].to_bits(), m[j][i].to_bits());
        }
    }

    refused!(mass::mixed(c.as_ref(), &d[..3]), Error::Dimension { expected: 4, found: 3, .. });
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused!(mass::mixed(c.as_ref(), &[0.3, 2.0, wrong, 1.1]), Error::Mass { dof: 2, .. });
    }
    let broken = rectangular(1, 3, [(0, 2, f64::NAN)]);
    refused!(mass::mixed(broken.as_ref(), &[1.0]), Error::MatrixNotFinite { row: 0, column: 2, .. });
    let huge = matrix(1, [(0, 0, 1e200)]);
    refused!(mass::mixed(huge.as_ref(), &[1.0]), Error::MatrixNotFinite { .. });
}

/// Highest Ω = ωh of a free bar of elements with c h/h_e = 1 (critical for central differences), a contact spring and
/// mass at its end.
fn highest(stiffness: f64, mass: f64) -> f64 {
    let n = 6;
    let m: Vec<f64> = (0..n).map(|i| if i == 0 || i == n - 1 { 0.5 } else { 1.0 }).collect();
    let (spring, weight) =
        (|i: usize| if i == 0 { stiffness } else { 0.0 }, |i: usize| if i == 0 { mass } else { 0.0 });
    let k = |i: usize, j: usize| match i.abs_diff(j) {
        0 => spring(i) + if i == 0 || i == n - 1 { 1.0 } else { 2.0 },
        1 => -1.0,
        _ => 0.0,
    };
    let m = |i: usize| m[i] + weight(i);
    let scaled = Mat::from_fn(n, n, |i, j| k(i, j) / (m(i) * m(j)).sqrt());
    scaled.self_adjoint_eigenvalues(Side::Lower).unwrap().into_iter().fold(0.0, f64::max).sqrt()
}

#[test]
fn bipenalty_keeps_the_critical_step() {
    assert!((highest(0.0, 0.0) - 2.0).abs() < 1e-12);
    for stiffness in [1e-3, 1.0, 1e3, 1e6] {
        let m = mass::bipenalty(stiffness, 1.0).unwrap();
        assert!((m - 0.25 * stiffness).abs() < 1e-15 * stiffness);
        assert!(highest(stiffness, m) < 2.0 + 1e-12);
        assert!(highest(stiffness, 0.0) > 2.0 + 1e-5);
    }
    // A tenth less no longer does, where the spring is stiff.
    assert!(highest(1e6, 0.9 * mass::bipenalty(1e6, 1.0).unwrap()) > 2.1);
    for (stiffness, h) in [(0.0, 1.0), (-1.0, 1.0), (f64::NAN, 1.0), (1.0, 0.0), (1.0, f64::INFINITY), (1.0, 1e-300)] {
        refused!(mass::bipenalty(stiffness, h), Error::Parameter { .. });
    }
    let law = ContactLaw::Bipenalty { stiffness: 8.0, mass: mass::bipenalty(8.0, 0.5).unwrap() };
    assert_eq!(law, ContactLaw::Bipenalty { stiffness: 8.0, mass: 0.5 });
    // Twice the Courant number of a mesh is a bound of Ω: the step is that of the largest one.
    let k = matrix(2, [(0, 0, 100.0), (0, 1, -100.0), (1, 0, -100.0), (1, 1, 100.0)]);
    let courant = mass::courant(Mass::Lumped(&[2.0, 2.0]), k.as_ref(), 0.2).unwrap();
    close(&courant, &[1.0; 2], 1e-15);
}

/// Z s/D of a long bar (k = m = 1 an element) with a massless end, (1 − θ) of mass on its neighbor, blend w: the end
/// moves by 1 and pulls with D.
fn stiffness_of_the_end(weight: f64, taper: f64, s: f64) -> f64 {
    let n = 4000;
    let full = bar(&vec![1.0; n]);
    let lumped: Vec<f64> = row_sums(&full);
    let blend = mass::blend(full.as_ref(), &lumped, weight).unwrap();
    let by = Redistribution::Tapered { neighbors: full.symbolic(), fraction: taper };
    let m = mass::redistribute_consistent(blend.as_ref(), &[0], &vec![0; n + 1], by).unwrap();
    let entry = |i: usize, j: usize| {
        let rows = m.as_ref().row_idx_of_col_raw(j);
        rows.iter().position(|&row| row == i).map_or(0.0, |at| m.val_of_col(j)[at])
    };
    // Elimination from the far end: the stiffness seen at node i, without what is before it.
    let stiffness = |i: usize| if i == 0 || i == n { 1.0 } else { 2.0 } + s * s * entry(i, i);
    let mut seen = stiffness(n);
    for i in (0..n).rev() {
        let coupling = s * s * entry(i, i + 1) - 1.0;
        seen = stiffness(i) - coupling * coupling / seen;
    }
    s / seen
}

#[test]
fn a_taper_takes_the_second_order_out_of_the_lag_of_the_force() {
    for weight in [0.0, 1.0] {
        let c = 0.125 - weight / 12.0;
        let best = 0.5 - f64::sqrt(c);
        for taper in [0.0, best] {
            let b = 0.5 - taper;
            let rest = |s: f64| {
                // (The mass given away makes the rest of the bar denser: 1/n.)
                stiffness_of_the_end(weight, taper, s) - (1.0 + (0.5 + taper) * s + (b * b - c) * s * s)
            };
            assert!(rest(0.1).abs() < 0.3 * 0.1_f64.powi(3) + 2e-4, "{weight} {taper}: {}", rest(0.1));
        }
    }
}

#[test]
fn least_squares_keep_the_total_to_rounding_wherever_coordinates_start() {
    // Far from the origin 1, x and x² are nearly the same motion: made orthogonal once, they share 1e-8 of each other.
    let lumped = [1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.0];
    let motions = [vec![1.0; 9], (0..9_u32).map(|node| 1e5 + f64::from(node)).collect()];
    let by = Redistribution::LeastSquares { motions: &motions, receivers: None };
    let mass = mass::redistribute(&lumped, &[0], &[0; 9], by).unwrap();
    let total = mass.iter().sum::<f64>();
    assert!((total / 16.0 - 1.0).abs() < 1e-12, "{total}");
}
