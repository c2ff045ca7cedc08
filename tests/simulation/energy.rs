//! Energy of states and the energy balance of runs.
#![allow(clippy::float_cmp)] // exact zeros and unchanged values are meant exactly

use contact_dynamics::contact::{ContactLaw, GapOffset};
use contact_dynamics::{
    Composite, LinearRows, LinearSystem, MoreauJean, Newmark, PersistencyCorrection, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::schemes::{self, Listed};
use contact_dynamics_scenes::sparse::{diagonal, matrix, springs};
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

/// Masses without springs under a contact, with books.
fn masses(
    mass: Vec<f64>,
    velocity: Vec<f64>,
    rows: LinearRows<'_, f64>,
    scheme: Box<dyn TimeIntegrator>,
    h: f64,
) -> Simulation<'_, f64> {
    let none = diagonal(&vec![0.0; mass.len()]);
    let system = LinearSystem::lumped(mass, none).unwrap();
    Simulation::builder(system, scheme, h).velocity(velocity).constraint(rows).energy_balance().build().unwrap()
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

/// Two masses that stay together lose ½ m_c V², m_c = m₁ m₂/(m₁ + m₂), whatever the scheme, the step and the instant of
/// the impact in it, and nothing else.
#[test]
fn a_plastic_impact_is_booked_alike_by_all_schemes_at_all_phases() {
    // (By Noh and Bathe's scheme the mass leaves again, as its page says.)
    let stops = |listed: &Listed| listed.takes_multipliers() && !listed.name().starts_with("Noh–Bathe");
    for listed in schemes::all().into_iter().filter(stops) {
        for (h, phase) in [1e-2, 3e-3].into_iter().flat_map(|h| [0.1, 0.35, 0.5, 0.9].map(|phase| (h, phase))) {
            let gap = (10.0 + phase) * h;
            let rows = LinearRows::new().unilateral(&[(0, 1.0), (1, -1.0)], gap);
            let mut run = masses(vec![1.0, 1.0 / 3.0], vec![-1.0, 0.0], rows, (listed.make)(), h);
            (0..30).for_each(|_| run.step().unwrap());
            let works = run.energy().works.unwrap();
            let miss = [works.impacts + 0.125, works.contact, works.corrections, works.remainder];
            assert!(miss.iter().all(|x| x.abs() < 1e-10), "{} {h} {phase}: {works:?}", listed.name());
        }
    }
}

/// A mass of 2 with velocity 1 meets a stop that comes toward it with ½: in the frame of the stop it loses ½ 2 1.5², and
/// the stop does the work 3 · ½.
#[test]
fn an_impact_on_a_moving_stop_is_a_loss_and_a_work() {
    for listed in schemes::all().into_iter().filter(Listed::takes_multipliers) {
        for phase in [0.1, 0.35, 0.5, 0.9] {
            let stop = GapOffset::moving(move |t| [0.15 + 0.015 * phase - 0.5 * t, -0.5, 0.0]);
            let rows = LinearRows::new().unilateral(&[(0, -1.0)], stop);
            let mut run = masses(vec![2.0], vec![1.0], rows, (listed.make)(), 0.01);
            (0..30).for_each(|_| run.step().unwrap());
            let (works, v) = (run.energy().works.unwrap(), run.state().velocity()[0]);
            if (v + 0.5).abs() < 1e-12 {
                let miss = [works.impacts + 2.25, works.contact - 1.5, works.corrections, works.remainder];
                assert!(miss.iter().all(|x| x.abs() < 1e-10), "{} {phase}: {works:?}", listed.name());
            } else {
                assert!(listed.name().starts_with("Noh–Bathe"), "{} {phase}: {v}", listed.name());
            }
        }
    }
}

/// Newton's law with e takes 1 − e² of what a plastic impact does.
#[test]
fn a_rebound_loses_less() {
    for e in [0.0, 0.5, 1.0] {
        for phase in [0.1, 0.5, 0.9] {
            let law = ContactLaw::Restitution { coefficient: e };
            let rows = LinearRows::new().row(law, &[(0, 1.0), (1, -1.0)], 0.1 + 0.01 * phase);
            let scheme = Box::new(MoreauJean::new(0.5).unwrap());
            let mut run = masses(vec![1.0, 1.0 / 3.0], vec![-1.0, 0.0], rows, scheme, 0.01);
            (0..30).for_each(|_| run.step().unwrap());
            let works = run.energy().works.unwrap();
            let miss = [works.impacts + 0.125 * (1.0 - e * e), works.contact, works.corrections, works.remainder];
            assert!(miss.iter().all(|x| x.abs() < 1e-10), "{e} {phase}: {works:?}");
        }
    }
}

/// Of elastic bodies an impact takes ½ m_c V² of the mass of the contact nodes, with any of the schemes that stop them.
#[test]
fn an_impact_takes_the_energy_of_the_contact_nodes() {
    for listed in schemes::all().into_iter().filter(|listed| listed.takes_corrections() && listed.takes_multipliers()) {
        for (mass, share) in [(MassKind::Lumped, 0.5), (MassKind::Consistent, 3.0_f64.sqrt() / 6.0)] {
            for (h, theta) in [1e-3, 1e-4].into_iter().flat_map(|h| [0.1, 0.35, 0.8].map(|theta| (h, theta))) {
                let bars = Bars::paper(20).delayed(theta, h).with_mass(mass);
                let mut run = corrected(&bars, (listed.make)(), h);
                while !run.state().contacts().closed()[0] {
                    run.step().unwrap();
                }
                let works = run.energy().works.unwrap();
                let theory = -share / 20.0 * 6.25e-5;
                let name = listed.name();
                assert!((works.impacts / theory - 1.0).abs() < 1e-9, "{name}, {mass:?}, θ = {theta}: {works:?}");
                assert_eq!([works.load, works.supports, works.damping, works.corrections], [0.0; 4], "{name}");
            }
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
    let sum = works.contact + works.impacts + works.corrections + works.remainder;
    assert!((energy.total() - start - sum).abs() < 1e-12 * start, "{works:?}");
    assert!(energy.total() < start && works.impacts < 0.0);
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
fn the_work_of_contact_is_booked_from_the_first_step_of_a_multistep_scheme() {
    use contact_dynamics::Bdf2;
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
