//! Tangents of every constraint with friction are orthonormal, and what is wrong with those of a host is said.

use contact_dynamics::contact::{
    ContactConstraint, Contacts, NodeToFacet, NodesOnObstacle, Plane, Side, Sphere, SurfaceSettings,
};
use contact_dynamics::{ContactLaw, LinearRows, verify};
use contact_dynamics_scenes::solids::{Material, Solid};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn skewness(constraint: &mut dyn ContactConstraint<f64>, u: &[f64]) -> f64 {
    verify::gap_jacobian(constraint, 0.0, u, &vec![0.0; u.len()], 1e-6).unwrap().tangents
}

#[test]
fn tangents_of_constraints_are_orthonormal() {
    let ball = Sphere::new([0.1, -0.2, 0.3], 1.0, Side::Outside).unwrap();
    let mut nodes = NodesOnObstacle::new(ball, &[[0.8, 0.5, 0.9]], &[[0, 1, 2]], &[0]).unwrap().friction(0.3);
    assert!(skewness(&mut nodes, &[0.01, -0.02, 0.03]) < 1e-14);
    let pair =
        LinearRows::new().pair_with_friction((ContactLaw::Rigid, 0.3), [0, 1, 2], [3, 4, 5], [1.0, -2.0, 0.5], 0.1);
    assert!(skewness(&mut pair.unwrap(), &[0.0; 6]) < 1e-14);
    let lower = Solid::block([1.0; 3], [2, 2, 1], MATERIAL);
    let split = lower.nodes.len();
    let solid = lower.with(Solid::block([0.6, 0.6, 1.0], [1, 1, 1], MATERIAL).moved([0.13, 0.21, 1.0]));
    let facets = |inside: &dyn Fn(usize, [f64; 3]) -> bool| -> Vec<[usize; 4]> {
        let all = solid.boundary().into_iter().filter(|side| side.iter().all(|&n| inside(n, solid.nodes[n])));
        all.map(|side| [side[0], side[1], side[2], side[3]]).collect()
    };
    let below = facets(&|n, [.., z]| n < split && z > 0.999);
    let above = facets(&|n, [.., z]| n >= split && z < 1.001);
    let mut contact = NodeToFacet::new(&solid.nodes, &solid.node_dofs(), above, below).unwrap().friction(0.3);
    let u: Vec<_> = (0..solid.dofs()).map(|dof| 1e-3 * (0.7 * dof as f64).sin()).collect();
    assert!(skewness(&mut contact, &u) < 1e-13);
}

/// In the plane a tangent is the normal turned clockwise: to the right on a floor.
#[test]
fn tangents_in_the_plane_are_the_normal_turned() {
    let line = Plane::new([0.0; 2], [0.6, 0.8]).unwrap();
    let on_line = NodesOnObstacle::new(line, &[[1.0, 1.0]], &[[0, 1]], &[0]).unwrap().friction(0.3);
    let pair = LinearRows::new().pair_with_friction((ContactLaw::Rigid, 0.3), [0, 1], [2, 3], [0.6, 0.8], 0.1).unwrap();
    let (nodes, dofs) = ([[0.2, 1.0], [-1.0, 0.0], [1.0, 0.3]], [[0, 1], [2, 3], [4, 5]]);
    let on_facet = NodeToFacet::one_pass(&nodes, &dofs, &[0], [[1, 2]])
        .unwrap()
        .with(SurfaceSettings::new().reach(2.0))
        .unwrap()
        .friction(0.3);
    let constraints: [Box<dyn ContactConstraint<f64>>; 3] = [Box::new(on_line), Box::new(pair), Box::new(on_facet)];
    for mut constraint in constraints {
        let zero = vec![0.0; constraint.dofs().len()];
        constraint.search(0.0, &zero, &zero, 0.0).unwrap();
        let contacts = Contacts::of(&*constraint);
        let [normal, tangent] = [contacts.row(0).collect(), contacts.tangents(0).remove(0)];
        let weight = |row: &[(usize, f64)], dof| row.iter().find(|entry| entry.0 == dof).map_or(0.0, |entry| entry.1);
        for x in (0..zero.len()).step_by(2) {
            assert!((weight(&tangent, x) - weight(&normal, x + 1)).abs() < 1e-14, "{normal:?} {tangent:?}");
            assert!((weight(&tangent, x + 1) + weight(&normal, x)).abs() < 1e-14, "{normal:?} {tangent:?}");
        }
    }
}

/// A tangent that is too long, or leans on the normal, changes μ without a word.
#[test]
fn tangents_that_are_not_are_reported() {
    let row = |tangent: &[(usize, f64)], friction| {
        skewness(&mut LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[tangent]), &[0.0; 2])
    };
    assert!(row(&[(0, 1.0)], 0.3).abs() < 1e-15);
    assert!((row(&[(0, 1.5)], 0.3) - 0.5).abs() < 1e-15);
    assert!((row(&[(0, 0.8), (1, 0.6)], 0.3) - 0.6).abs() < 1e-15);
    assert!((row(&[(0, 0.0)], 0.3) - 1.0).abs() < 1e-15);
}
