//! Oblique impact of a slab on a rough wall: smooth friction by every scheme that takes corrections, and by the
//! presets.

use contact_dynamics::{PersistencyCorrection, Preset};
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::slabs::{Impact, Slab};

#[test]
fn friction_is_that_of_the_waves() {
    for along in [0.02, 0.05] {
        let slab = Slab::thrown(20, along);
        let h = 2e-3;
        for scheme in schemes::correctable() {
            let corrected = Impact::mean(&slab, h, 4, |gap| {
                slab.lumped((scheme.make)(), vec![Box::new(PersistencyCorrection::with_history_projection())], h, gap)
            })
            .unwrap();
            let name = scheme.name();
            // (Backward Euler smears the front over ten steps.)
            let bound = if name == "Newmark(0.5, 1)" { 0.09 } else { 0.05 };
            assert!(corrected.error[1] < bound && corrected.variation < 2.5, "{along} {name} {corrected:?}");
            assert!(corrected.largest < 1.15, "{along} {name} {corrected:?}");
            // After contact the slab as a whole slides with what friction has left it.
            let [_, friction] = slab.forces();
            let expected = along - friction * slab.contact_time() / (slab.density * slab.length);
            assert!((corrected.velocity[1] - expected).abs() < 0.002, "{along} {name} {corrected:?} {expected}");
        }
        for preset in [Preset::smooth(), Preset::conservative(), Preset::explicit()] {
            let smooth = Impact::mean(&slab, h, 4, |gap| slab.preset(preset, h, gap)).unwrap();
            assert!(smooth.error[1] < 0.05 && smooth.largest < 1.1, "{along} {preset:?} {smooth:?}");
        }
    }
}
