//! Patch tests on curved surfaces: concentric bodies against Lamé's closed form.

use contact_dynamics::Result;
use contact_dynamics_scenes::curved_patch::{CurvedPatch, PatchErrors};
use contact_dynamics_scenes::second_order::Family;

/// Observed orders of pressure and displacement from one mesh to one with elements half as large, and the errors there.
fn orders(errors: impl Fn(usize) -> Result<PatchErrors>) -> ([f64; 2], PatchErrors) {
    let [coarse, fine] = [1, 2].map(|factor| errors(factor).unwrap());
    let order = |coarse: f64, fine: f64| (coarse / fine).log2();
    ([order(coarse.pressure, fine.pressure), order(coarse.displacement, fine.displacement)], fine)
}

fn rings(factor: usize, family: Option<Family>) -> CurvedPatch<2> {
    CurvedPatch::rings([4 * factor, 5 * factor], family)
}

#[test]
fn weighted_gaps_of_rings_converge() {
    for family in [None, Some(Family::Lagrange)] {
        for outer in [true, false] {
            let pressed = |factor| {
                let patch = rings(2 * factor, family);
                patch.pressed(patch.mortar(outer)?)
            };
            let (orders, fine) = orders(pressed);
            let what = format!("{family:?}, outer {outer}: {orders:?}, {fine:?}");
            assert!(orders.iter().all(|&order| order > 1.8), "{what}");
            assert!(fine.pressure < 1e-3 && fine.displacement < 1e-3, "{what}");
        }
    }
}

/// Facets are warped and cut each other anywhere; gaps are far from those of the start where displacements are 1e-6.
#[test]
fn weighted_gaps_of_balls_converge() {
    for outer in [true, false] {
        let pressed = |factor| {
            let patch = CurvedPatch::balls([2 * factor, 3 * factor], None);
            patch.pressed(patch.mortar(outer)?)
        };
        let (orders, fine) = orders(pressed);
        let what = format!("outer {outer}: {orders:?}, {fine:?}");
        assert!(orders.iter().all(|&order| order > 1.2), "{what}");
        assert!(fine.pressure < 0.012 && fine.displacement < 4e-3, "{what}");
    }
    for outer in [true, false] {
        let patch = CurvedPatch::balls([2, 3], Some(Family::Lagrange));
        let errors = patch.pressed(patch.mortar(outer).unwrap()).unwrap();
        assert!(errors.pressure < 0.013 && errors.displacement < 6e-3, "outer {outer}: {errors:?}");
    }
}
