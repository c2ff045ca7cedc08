//! Energy of states and the energy balance of runs.
#![allow(clippy::float_cmp)] // exact zeros and unchanged values are meant exactly

use contact_dynamics::{Composite, LinearSystem, Newmark, PersistencyCorrection, Simulation, TimeIntegrator};
use contact_dynamics_scenes::sparse::{matrix, springs};
use contact_dynamics_scenes::{Bars, MassKind};

fn corrected<'a>(bars: &Bars, scheme: impl TimeIntegrator + 'a, h: f64) -> Simulation<'a, f64> {
    Simulation::builder(bars.system::<f64>(), scheme, h)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .corrector(PersistencyCorrection::with_history_projection())
        .energy_balance()
        .build()
        .unwrap()
}

#[test]
fn trapezoidal_rule_conserves_the_energy_of_free_vibration() {
    let bars = Bars { gap: 1e3, velocity: [0.0, 0.0], ..Bars::paper(10) };
    let velocity: Vec<f64> = (0..bars.dofs()).map(|i| (i as f64).sin()).collect();
    let mut run =
        Simulation::builder(bars.system::<f64>(), Newmark::trapezoidal(), 1e-2).velocity(velocity).build().unwrap();
    let start = run.energy().total();
    run.run_until(20.0, &mut ()).unwrap();
    assert!((run.energy().total() / start - 1.0).abs() < 1e-11, "{:?}", run.energy());
}

#[test]
fn corrections_take_exactly_the_energy_of_the_velocity_jump() {
    // Impact at the fraction θ of a step: closing the gap leaves the trapezoidal rule with the closing speed (2θ − 1) V
    // at its end, and the correction takes ½ m_c of its square; with what the raw multiplier took, ½ m_c V² is lost.
    for (mass, loss) in [(MassKind::Lumped, 0.5 / 50.0), (MassKind::Consistent, 0.288_675 / 50.0)] {
        for theta in [0.1, 0.35, 0.5, 0.8] {
            let bars = Bars::paper(50).delayed(theta, 1e-5).with_mass(mass);
            let mut run = corrected(&bars, Newmark::trapezoidal(), 1e-5);
            run.run_until(0.11, &mut ()).unwrap();
            let energy = run.energy();
            let works = energy.works.unwrap();
            let share = -works.corrections / 6.25e-5;
            let theory = loss * (2.0 * theta - 1.0).powi(2);
            assert!((share - theory).abs() < 1e-3 * loss, "{mass:?}, θ = {theta}: {share:e} for {theory:e}");
            assert!((1.0 - energy.total() / 6.25e-5 - loss).abs() < 1e-3 * loss, "{mass:?}, θ = {theta}");
            assert_eq!([works.load, works.supports, works.damping], [0.0; 3]);
        }
    }
}

#[test]
fn composite_dissipates_and_the_books_say_so() {
    let bars = Bars::paper(20).delayed(0.5, 1e-3);
    let mut run = corrected(&bars, Composite, 1e-3);
    let start = run.energy().total();
    run.run_until(0.4, &mut ()).unwrap();
    let energy = run.energy();
    let works = energy.works.unwrap();
    let sum = works.contact + works.corrections + works.remainder;
    assert!((energy.total() - start - sum).abs() < 1e-12 * start, "{works:?}");
    assert!(energy.total() < start && works.corrections < 0.0);
}

#[test]
fn works_of_load_damping_and_support_balance_on_smooth_motion() {
    // A damped spring between a driven base and a loaded mass: the remainder vanishes with h².
    let remainder = |h: f64| {
        let system = LinearSystem::lumped(vec![1.0, 2.0], matrix(2, springs(2, 50.0)))
            .unwrap()
            .rayleigh(0.1, 0.01)
            .unwrap()
            .load(|t, f| f[1] = 3.0 * (2.0 * t).cos())
            .drive(0, |t| [0.1 * t * t * t, 0.3 * t * t, 0.6 * t])
            .unwrap();
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), h).energy_balance().build().unwrap();
        run.run_until(2.0, &mut ()).unwrap();
        let works = run.energy().works.unwrap();
        assert!(works.damping < 0.0 && works.supports.abs() > 0.1 && works.load.abs() > 0.01, "{works:?}");
        works.remainder.abs()
    };
    let (coarse, fine) = (remainder(4e-3), remainder(2e-3));
    assert!(((coarse / fine).log2() - 2.0).abs() < 0.1, "{coarse:e} {fine:e}");
}

#[test]
fn correction_against_a_moving_stop_books_the_change_of_kinetic_energy() {
    use contact_dynamics::LinearRows;
    use contact_dynamics::contact::GapOffset;
    use contact_dynamics::corrector::Parts;
    // A mass of 2 with velocity 1 meets a stop that comes toward it with 0.5.
    let run = |parts| {
        let k = matrix(1, [(0, 0, 0.0)]);
        let stop = GapOffset::moving(|t| [0.1234 - 0.5 * t, -0.5, 0.0]);
        let mut run = Simulation::builder(LinearSystem::lumped(vec![2.0], k).unwrap(), Composite, 0.01)
            .velocity(vec![1.0])
            .constraint(LinearRows::new().unilateral(&[(0, -1.0)], stop))
            .corrector(PersistencyCorrection::new().parts(parts))
            .energy_balance()
            .build()
            .unwrap();
        while run.state().contacts().raw_forces()[0] == 0.0 {
            run.step().unwrap();
        }
        run.energy()
    };
    let (kept, corrected) = (run(Parts::Acceleration), run(Parts::Velocity));
    let change = corrected.kinetic - kept.kinetic;
    let booked = corrected.works.unwrap().corrections;
    assert!(change.abs() > 1e-3 && (booked - change).abs() < 1e-13, "{booked} for {change}");
}

#[test]
fn the_work_of_contact_is_booked_from_the_first_step_of_a_multistep_scheme() {
    use contact_dynamics::contact::GapOffset;
    use contact_dynamics::{Bdf2, LinearRows};
    // A floor that rises with v = 1 + ½ j t² under a mass that a load of 1 presses on it: λ = 1 + j t.
    let (jerk, h) = (5.0, 0.1);
    let floor = GapOffset::moving(move |t| [-t - jerk * t.powi(3) / 6.0, -1.0 - 0.5 * jerk * t * t, -jerk * t]);
    let system = LinearSystem::lumped(vec![1.0], matrix(1, [(0, 0, 0.0)])).unwrap().load(|_, f| f[0] = -1.0);
    let mut run = Simulation::builder(system, Bdf2, h)
        .velocity(vec![1.0])
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], floor))
        .energy_balance()
        .build()
        .unwrap();
    let mut before = 0.0;
    for step in 0..3 {
        run.step().unwrap();
        let work = |t: f64| t + 0.5 * jerk * t * t + jerk * t.powi(3) / 6.0 + jerk * jerk * t.powi(4) / 8.0;
        let (t, total) = (run.time(), run.energy().works.unwrap().contact);
        let exact = work(t) - work(t - h);
        assert!(((total - before) / exact - 1.0).abs() < 0.03, "step {step}: {} for {exact}", total - before);
        before = total;
    }
}
