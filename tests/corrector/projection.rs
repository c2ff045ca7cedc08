//! The projection on the rows of a host: which rows it takes together.

use contact_dynamics::contact::ContactJacobian;
use contact_dynamics::{JumpProjection, Mass};

/// Two nodes hit a plate whose motion is prescribed. Its dof is in both rows, but does not couple them: each is a
/// group of its own, and the plate stops both.
#[test]
fn contacts_with_a_prescribed_dof_in_common() {
    for plate in 0..3_usize {
        let nodes: Vec<usize> = (0..3).filter(|&dof| dof != plate).collect();
        for node_first in [true, false] {
            let mut g = ContactJacobian::default();
            for &node in &nodes {
                let mut row = [(node, -1.0), (plate, 1.0)];
                if !node_first {
                    row.reverse();
                }
                g.push(&row);
            }
            let mut v = [3.0_f64; 3];
            v[plate] = 1.0;
            let mut projection = JumpProjection::new(Mass::Lumped(&[2.0; 3]), &[plate]).unwrap();
            projection.close(&g, &[0, 1]).unwrap();
            let mut impulses = [0.0; 2];
            projection.remove_jump(&g, &[0.0; 2], &mut v, &mut impulses).unwrap();
            let near = |x: &[f64], wanted: f64| x.iter().all(|x| (x - wanted).abs() < 1e-14);
            assert!(
                near(&v, 1.0) && near(&impulses, -4.0),
                "plate {plate}, node first: {node_first}: {v:?} {impulses:?}"
            );
        }
    }
}

/// A node on two slopes at a small angle to each other, whose accelerations differ. Slopes within a milliradian are
/// one: the node keeps the mean of both. Others are two, and the edge between them moves at the rate at which both
/// advance, however far that is along them.
#[test]
fn rows_that_are_nearly_the_same_are_one() {
    for (angle, are_one) in [(1e-9, true), (1e-6, true), (5e-4, true), (2e-3, false), (0.1, false)] {
        for order in [[0, 1], [1, 0]] {
            let mut g = ContactJacobian::default();
            let slopes: [f64; 2] = [-0.5 * angle, 0.5 * angle];
            for k in order {
                g.push(&[(0, slopes[k].cos()), (1, slopes[k].sin())]);
            }
            let targets = order.map(|k| [1.0, 3.0][k]);
            let mut projection = JumpProjection::new(Mass::Lumped(&[2.0; 2]), &[]).unwrap();
            projection.close(&g, &[0, 1]).unwrap();
            let (mut a, mut forces) = ([0.0_f64; 2], [0.0; 2]);
            projection.remove_jump(&g, &targets, &mut a, &mut forces).unwrap();
            // Along and across the mean of the slopes.
            let exact = match are_one {
                true => [2.0, 0.0],
                false => [2.0 / (0.5 * angle).cos(), 1.0 / (0.5 * angle).sin()],
            };
            let error = a.iter().zip(exact).map(|(a, exact)| (a - exact).abs() / exact.max(1.0));
            let error = error.fold(0.0, f64::max);
            assert!(error < if are_one { 2.0 * angle } else { 1e-9 }, "{angle:e} {order:?}: {a:?} for {exact:?}");
        }
    }
}
