//! A step allocates nothing after the first, in contact or not. Alone in its binary: the counter is global.

use contact_dynamics::{
    Bathe, Composite, GeneralizedAlpha, Newmark, PersistencyCorrection, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::{Bars, MassKind};

#[test]
fn steps_do_not_allocate() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 4] = [
        || Box::new(Composite),
        || Box::new(Newmark::trapezoidal()),
        || Box::new(Bathe::default()),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
    ];
    for scheme in schemes {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            let bars = Bars::paper(50).delayed(0.3, 1e-3).with_mass(mass);
            // Moving from the start, so that a start-up step is taken too.
            let mut run = Simulation::builder(bars.system::<f64>().rayleigh(0.0, 1e-5).unwrap(), scheme(), 1e-3)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .corrector(PersistencyCorrection::with_history_projection())
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
            assert_eq!(counted.count_total, 0, "{}, {mass:?}", scheme().name());
        }
    }
}
