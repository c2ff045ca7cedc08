//! A bar pushed along a rough bed: all of it stops at once.

use contact_dynamics::{CdLagrange, Corrector, Newmark, PersistencyCorrection, TimeIntegrator};
use contact_dynamics_scenes::bed::Bed;

#[test]
fn it_stops_where_it_should() {
    let bed = Bed::new(60);
    let run = |scheme: Box<dyn TimeIntegrator>, corrected: bool, courant: f64| {
        let correction: Box<dyn Corrector<f64>> = Box::new(PersistencyCorrection::new());
        let correctors = if corrected { vec![correction] } else { Vec::new() };
        bed.measure(&mut bed.run(scheme, correctors, courant).unwrap()).unwrap()
    };
    // At the Courant number 1 waves along the bar are exact, and so is what friction makes of them.
    let [way, variation] = run(Box::new(CdLagrange), false, 1.0);
    assert!((way - 1.0).abs() < 1e-3 && variation < 1e-6, "{way} {variation}");
    // Elsewhere friction rectifies what the mesh rings; without the correction it rings in every step.
    let [way, variation] = run(Box::new(Newmark::trapezoidal()), true, 0.5);
    assert!((way - 1.0).abs() < 0.03 && variation < 12.0, "{way} {variation}");
    let [_, raw] = run(Box::new(Newmark::trapezoidal()), false, 0.5);
    assert!(raw > 20.0 * variation, "{raw}");
}
