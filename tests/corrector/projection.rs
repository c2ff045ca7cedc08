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
