//! Two elastic cylinders whose meshes do not match, against the pressure of Hertz.

use contact_dynamics_scenes::hertz::{Cylinders, HertzErrors};

/// By elements of the lower body and of the upper one over half the contact's width.
fn scene(elements: [f64; 2]) -> Cylinders {
    Cylinders::new(elements, 3.0, 1e3)
}

fn mortar(elements: [f64; 2]) -> HertzErrors {
    let scene = scene(elements);
    scene.pressed(scene.stack.mortar(true).unwrap()).unwrap()
}

fn one_pass(elements: [f64; 2]) -> HertzErrors {
    let scene = scene(elements);
    scene.pressed(scene.stack.nodes_on_facets(1).unwrap()).unwrap()
}

#[test]
fn pressures_of_weighted_gaps_converge() {
    for [below, above] in [[1.0, 1.0], [1.0 / 1.3, 1.0], [1.0, 1.0 / 1.3]] {
        // (Where the contact ends its pressure falls with a root: order one, up to where the last node is.)
        let errors = [5.0, 20.0].map(|fine| mortar([fine * below, fine * above]));
        let [coarse, fine] = errors;
        for body in [0, 1] {
            let [coarse, fine] = [coarse.pressure[body], fine.pressure[body]];
            assert!(coarse < 0.1 && fine < 0.03 && fine < 0.5 * coarse, "{below} {above} {errors:?}");
        }
        assert!(fine.peak.iter().all(|error| error.abs() < 1e-3) && fine.force.abs() < 5e-4, "{errors:?}");
    }
}

#[test]
fn pressures_of_nodes_on_facets_converge_where_meshes_match() {
    let [coarse, fine] = [5.0, 10.0].map(|elements| one_pass([elements; 2]));
    assert!(fine.pressure[0] < 0.52 * coarse.pressure[0], "{coarse:?} {fine:?}");
    assert!(fine.peak[0].abs() < 1e-3 && fine.force.abs() < 1e-3, "{fine:?}");
    // Where they do not nodes press in lumps; the force is right all the same.
    let lumps = one_pass([20.0, 20.0 / 1.3]);
    assert!(lumps.peak[0] > 0.05 && lumps.force.abs() < 1e-3, "{lumps:?}");
}
