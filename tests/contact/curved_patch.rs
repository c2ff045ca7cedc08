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
