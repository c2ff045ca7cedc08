//! M⁻¹ of consistent masses, as projections of jumps see it: M δ = Gᵀ p on the free dofs, and G x = γ afterwards.

use contact_dynamics::contact::ContactJacobian;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{Error, JumpProjection, Mass, mass};
use contact_dynamics_scenes::solids::{Material, Solid};

type Matrix = SparseColMat<usize, f64>;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn block(cells: [usize; 3]) -> Solid<3> {
    let bend = |p: [f64; 3]| [p[0] + 0.1 * p[1] * p[2], p[1] + 0.2 * p[0] * p[0], p[2] * (1.0 + 0.3 * p[0])];
    Solid::block([1.0, 1.2, 0.4], cells, MATERIAL).mapped(bend)
}

/// A number between −1 and 1 for each index.
fn number(k: usize) -> f64 {
    (1.7 * k as f64 + 0.3).sin()
}

/// Removes the jumps of some rows from a vector and checks what has become of it. Returns it with the multipliers.
fn project(m: &Matrix, prescribed: &[usize], g: &ContactJacobian<f64>, rows: &[usize], x: &[f64]) -> [Vec<f64>; 2] {
    let mut projection = JumpProjection::new(Mass::Consistent(m.as_ref()), prescribed).unwrap();
    let (mut new, mut p) = (x.to_vec(), vec![0.0; rows.len()]);
    let targets: Vec<f64> = (0..rows.len()).map(|k| 0.1 * number(3 * k)).collect();
    projection.close(g, rows).unwrap();
    projection.remove_jump(g, &targets, &mut new, &mut p).unwrap();
    for (&row, &target) in rows.iter().zip(&targets) {
        let size: f64 = g.row(row).map(|(dof, weight)| (weight * x[dof]).abs()).sum::<f64>() + 1.0;
        assert!((g.product(row, &new) - target).abs() < 1e-12 * size, "row {row}");
    }
    let change: Vec<f64> = x.iter().zip(&new).map(|(x, new)| x - new).collect();
    let mut left = vec![0.0; x.len()];
    Mass::Consistent(m.as_ref()).product(1.0, &change, &mut left).unwrap();
    let mut sizes = vec![0.0; x.len()];
    for (&row, &p) in rows.iter().zip(&p) {
        for (dof, weight) in g.row(row) {
            left[dof] -= weight * p;
            sizes[dof] += (weight * p).abs();
        }
    }
    // (Badly conditioned masses move much by little: the product with M rounds as well.)
    let max = |x: &[f64]| x.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let (largest, rounding) = (max(&sizes), 1e-13 * max(m.val()) * max(&change));
    for (dof, &left) in left.iter().enumerate() {
        if prescribed.contains(&dof) {
            assert!(change[dof].abs() == 0.0);
        } else {
            assert!(left.abs() < 1e-13 * largest + rounding, "dof {dof}: {left:e} of {largest:e}");
        }
    }
    [new, p]
}

/// Rows on the nodes of the bottom: along z, or in between.
fn bottom_rows(solid: &Solid<3>, oblique: bool) -> ContactJacobian<f64> {
    let mut g = ContactJacobian::default();
    for node in (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0) {
        match oblique {
            true => g.push(&[(3 * node, 0.48), (3 * node + 1, -0.6), (3 * node + 2, 0.64)]),
            false => g.push(&[(3 * node + 2, 1.0)]),
        }
    }
    g
}

#[test]
fn jumps_vanish_by_impulses_along_their_rows() {
    // Rows that are pushed one by one, and so many that they are pushed together.
    for cells in [[6, 5, 4], [12, 12, 2]] {
        let solid = block(cells);
        let m = solid.consistent_mass();
        let x: Vec<f64> = (0..solid.dofs()).map(number).collect();
        for oblique in [false, true] {
            let g = bottom_rows(&solid, oblique);
            let all: Vec<usize> = (0..g.rows()).collect();
            for prescribed in [&[][..], &[0, 2, 33, 100]] {
                for rows in [&all[3..4], &all[2..9], &all[..]] {
                    // (A row of prescribed dofs alone has no response.)
                    let free = |row: &&usize| g.row(**row).any(|(dof, _)| !prescribed.contains(&dof));
                    let rows: Vec<usize> = rows.iter().filter(free).copied().collect();
                    project(&m, prescribed, &g, &rows, &x);
                }
            }
        }
    }
}

#[test]
fn each_body_gets_its_momentum() {
    // The same body twice, the second one heavier by far: its response is smaller, and no less exact.
    let solid = block([4, 4, 3]);
    let (m, dofs) = (solid.consistent_mass(), solid.dofs());
    for heavier in [1.0, 1e3, 1e6] {
        let mut triplets = Vec::new();
        for j in 0..dofs {
            for (&i, &value) in m.as_ref().row_idx_of_col_raw(j).iter().zip(m.as_ref().val_of_col(j)) {
                triplets.extend([Triplet::new(i, j, value), Triplet::new(dofs + i, dofs + j, heavier * value)]);
            }
        }
        let both = Matrix::try_new_from_triplets(2 * dofs, 2 * dofs, &triplets).unwrap();
        let single = bottom_rows(&solid, true);
        let mut g = ContactJacobian::default();
        for row in 0..single.rows() {
            let others = single.row(row).map(|(dof, weight)| (dofs + dof, -weight));
            g.push(&single.row(row).chain(others).collect::<Vec<_>>());
        }
        let x: Vec<f64> = (0..2 * dofs).map(number).collect();
        project(&both, &[], &g, &(0..g.rows()).collect::<Vec<_>>(), &x);
    }
}

#[test]
fn units_make_no_difference() {
    let solid = block([5, 4, 3]);
    let m = solid.consistent_mass();
    let g = bottom_rows(&solid, true);
    let rows: Vec<usize> = (0..g.rows()).collect();
    let x: Vec<f64> = (0..solid.dofs()).map(number).collect();
    let [expected, _] = project(&m, &[], &g, &rows, &x);
    let scaled = |scale: &dyn Fn(usize) -> f64| {
        let entry = |j: usize| m.as_ref().row_idx_of_col_raw(j).iter().zip(m.as_ref().val_of_col(j));
        let entries = (0..solid.dofs()).flat_map(|j| entry(j).map(move |(&i, &value)| (i, j, value)));
        let entries: Vec<_> = entries.map(|(i, j, value)| Triplet::new(i, j, scale(i) * value * scale(j))).collect();
        Matrix::try_new_from_triplets(solid.dofs(), solid.dofs(), &entries).unwrap()
    };
    // Masses in other units, and every dof in units of its own, as rotations beside displacements.
    let scales: [&dyn Fn(usize) -> f64; 3] = [&|_| 1e-6, &|_| 1e6, &|dof| [1e-6, 1.0, 1e6][dof % 3]];
    for scale in scales {
        let own = scaled(scale);
        let mut g_own = ContactJacobian::default();
        for row in 0..g.rows() {
            g_own.push(&g.row(row).map(|(dof, weight)| (dof, weight * scale(dof))).collect::<Vec<_>>());
        }
        let x_own: Vec<f64> = x.iter().enumerate().map(|(dof, x)| x / scale(dof)).collect();
        let mut projection = JumpProjection::new(Mass::Consistent(own.as_ref()), &[]).unwrap();
        projection.close(&g_own, &rows).unwrap();
        let targets: Vec<f64> = (0..rows.len()).map(|k| 0.1 * number(3 * k)).collect();
        let mut new = x_own;
        projection.remove_jump(&g_own, &targets, &mut new, &mut vec![0.0; rows.len()]).unwrap();
        for (dof, (new, expected)) in new.iter().zip(&expected).enumerate() {
            assert!((new * scale(dof) - expected).abs() < 1e-12, "{dof}");
        }
    }
}

#[test]
fn what_is_not_definite_is_refused_at_once() {
    let solid = block([6, 5, 4]);
    let (m, lumped) = (solid.consistent_mass(), solid.lumped_mass::<f64>());
    let refused = |m: &Matrix| match JumpProjection::new(Mass::Consistent(m.as_ref()), &[]) {
        Err(Error::Singular { matrix: "mass matrix", .. }) => true,
        Err(other) => panic!("{other}"),
        Ok(_) => false,
    };
    let less = |weight: f64| {
        let minus: Vec<f64> = lumped.iter().map(|m| -weight * m).collect();
        let (pattern, mut values) = m.clone().into_parts();
        for (dof, minus) in minus.iter().enumerate() {
            let column = pattern.as_ref().col_range(dof);
            let at = pattern.row_idx()[column.clone()].binary_search(&dof).unwrap();
            values[column.start + at] += minus;
        }
        Matrix::new(pattern, values)
    };
    assert!(!refused(&m));
    // The diagonal is positive throughout; the least eigenvalue is one of oscillating motions.
    let (mut definite, mut indefinite) = (0.0, 0.29);
    for _ in 0..40 {
        let weight = 0.5 * (definite + indefinite);
        if refused(&less(weight)) { indefinite = weight } else { definite = weight }
    }
    assert!(definite > 0.01 && indefinite < 0.1, "{definite} {indefinite}");
    // The same limit as that of a factor, which `blend` asks for: (M − w L)/(1 − w) is a blend.
    let blend = |weight: f64| mass::blend(m.as_ref(), &lumped, 1.0 / (1.0 - weight));
    assert!(blend(definite * (1.0 - 1e-9)).is_ok() && blend(indefinite * (1.0 + 1e-9)).is_err());
    // Close to it the condition is bad, and results are as good as it lets them be.
    let close = less(definite * (1.0 - 1e-3));
    let g = bottom_rows(&solid, true);
    let x: Vec<f64> = (0..solid.dofs()).map(number).collect();
    project(&close, &[], &g, &(0..g.rows()).collect::<Vec<_>>(), &x);

    // One point of integration an element: hourglass motions have no mass.
    let mut triplets = Vec::new();
    for element in &solid.elements {
        for &i in element {
            for &j in element {
                triplets.extend((0..3).map(|axis| Triplet::new(3 * i + axis, 3 * j + axis, 1.0 / 64.0)));
            }
        }
    }
    assert!(refused(&Matrix::try_new_from_triplets(solid.dofs(), solid.dofs(), &triplets).unwrap()));
}
