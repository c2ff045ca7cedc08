//! A step allocates nothing after the first, in contact or not. Alone in its binary: the counter is global.

use contact_dynamics::{Corrector, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::schemes::{Listed, all};
use contact_dynamics_scenes::{Bars, MassKind};

#[test]
fn steps_do_not_allocate() {
    for scheme in all().into_iter().filter(Listed::takes_multipliers) {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            let bars = Bars::paper(50).delayed(0.3, 1e-3).with_mass(mass);
            let correction = PersistencyCorrection::with_history_projection();
            let correction: Option<Box<dyn Corrector<f64>>> =
                if scheme.takes_corrections() { Some(Box::new(correction)) } else { None };
            // Damped, which explicit schemes with lagging forces bear at this step.
            let system = bars.system::<f64>().rayleigh(0.0, 1e-5).unwrap();
            let mut run = Simulation::builder(system, (scheme.make)(), 1e-3)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .correctors(correction)
                .energy_balance()
                .build()
                .unwrap();
            run.step().unwrap();
            let mut changes = 0;
            let counted = allocation_counter::measure(|| {
                for _ in 0..400 {
                    run.step().unwrap();
                }
                changes = run.statistics().contact_changes;
            });
            assert!(changes >= 2, "the run must contain an impact and a release");
            assert_eq!(counted.count_total, 0, "{}, {mass:?}", scheme.name());
        }
    }
}
