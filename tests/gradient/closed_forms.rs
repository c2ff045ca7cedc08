//! Gradients against closed forms: a bar strikes a wall at the speed v with the force F = v √(E ρ) A, which lasts for
//! 2 L/c, c = √(E/ρ), and then leaves with the impulse 2 m v.

use contact_dynamics::gradient::{RecordedStep, Scales, Seed};
use contact_dynamics::{LinearRows, LinearSystem, Newmark, Simulation};
use contact_dynamics_scenes::Bars;

/// A bar of unit length, density and area, E = 4, v = 1: c = 2, F = 2, contact from 0.1 to 1.1, impulse 2.
fn wall(elements: usize) -> Simulation<'static, f64> {
    let bars = Bars { elements: [elements, 1], young: [4.0, 4.0], density: [1.0; 2], area: 1.0, ..Bars::paper(1) };
    let bars = Bars { length: [1.0, 1.0], ..bars };
    let [end, _] = bars.contact_dofs();
    // The second bar stays away.
    let velocity = (0..bars.dofs()).map(|dof| if dof <= end { 1.0 } else { 0.0 }).collect();
    let system: LinearSystem<'_, f64> = bars.system();
    Simulation::builder(system, Newmark::trapezoidal(), 0.1 / elements as f64)
        .velocity(velocity)
        .constraint(LinearRows::new().unilateral(&[(end, -1.0)], 0.1))
        .build()
        .unwrap()
}

/// The value and the derivatives by v and ln E of ∫ w(t) F dt.
fn weighted(run: &mut Simulation<'static, f64>, w: impl Fn(f64) -> f64) -> [f64; 3] {
    let mut objective = |step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>| {
        let weight = w(step.state.time()) * step.h;
        seed.force[0] += weight;
        weight * step.state.contacts().forces()[0]
    };
    let mut scales = Scales::default();
    let gradient = run.gradient(&mut objective, &mut scales).unwrap();
    [gradient.value, gradient.velocity.iter().sum(), scales.stiffness]
}

#[test]
fn a_bar_on_a_wall() {
    // The front of the release is some elements wide.
    for (elements, error, of_release) in [(50, 1e-3, 2e-2), (400, 5e-5, 4e-3)] {
        let mut run = wall(elements);
        run.record().unwrap();
        run.run_until(1.4, &mut ()).unwrap();
        // The mean force in the middle of the contact.
        let [force, by_v, by_e] = weighted(&mut run, |t| if (0.3..0.9).contains(&t) { 1.0 / 0.6 } else { 0.0 });
        assert!((force / 2.0 - 1.0).abs() < error, "{force}");
        assert!((by_v / 2.0 - 1.0).abs() < error, "∂F/∂v = F/v: {by_v}");
        assert!((by_e - 1.0).abs() < error, "E ∂F/∂E = F/2: {by_e}");
        // The impulse depends on the speed alone, the duration I/F on the modulus alone.
        let [impulse, impulse_by_v, impulse_by_e] = weighted(&mut run, |_| 1.0);
        assert!((impulse / 2.0 - 1.0).abs() < of_release && (impulse_by_v / 2.0 - 1.0).abs() < of_release, "{impulse}");
        let duration = impulse / force;
        let relative = |by_impulse: f64, by_force: f64| by_impulse / impulse - by_force / force;
        assert!((duration - 1.0).abs() < of_release, "{duration}");
        assert!((relative(impulse_by_e, by_e) + 0.5).abs() < of_release, "E/T ∂T/∂E = −½");
        assert!(relative(impulse_by_v, by_v).abs() < of_release, "∂T/∂v = 0");
    }
}

/// Without the correction the force chatters, and its derivatives grow with the mesh.
#[test]
fn without_correction_there_is_no_gradient() {
    let largest = |is_corrected: bool| {
        let bars = Bars::paper(40);
        let builder = Simulation::builder(bars.system(), Newmark::trapezoidal(), 2e-4);
        let builder = builder.velocity(bars.velocities()).constraint(bars.contact());
        let mut run = if is_corrected { builder.build() } else { builder.correctors(Vec::new()).build() }.unwrap();
        run.record().unwrap();
        run.run_until(0.28, &mut ()).unwrap();
        let mut objective = |step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>| {
            seed.force[0] += step.h;
            step.h * step.state.contacts().forces()[0]
        };
        let gradient = run.gradient(&mut objective, &mut ()).unwrap();
        gradient.gaps.iter().map(|(_, by)| by.abs()).fold(0.0, f64::max)
    };
    let (corrected, raw) = (largest(true), largest(false));
    // The impulse until t = 0.28 falls by F per delay of 1/(2 v).
    let bars = Bars::paper(40);
    let force = 0.05 * (100.0_f64 * 0.01).sqrt() * 0.25;
    assert!((corrected / (force / 0.1) - 1.0).abs() < 0.05, "{corrected}, {bars:?}");
    assert!(raw > 100.0 * corrected, "{raw} {corrected}");
}
