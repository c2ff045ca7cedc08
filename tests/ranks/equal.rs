//! Runs over ranks move as those in one piece, and contact forces are the same on all ranks to the bit.

use crate::bodies::{Blocks, Setting, largest_difference, largest_difference_with, linear, linear_part};
use crate::parts::{Gathered, HyperelasticPart, Part, SolidPart};
use contact_dynamics::contact_solver::Assembly;
use contact_dynamics::{
    ActiveSet, Bathe, CentralDifference, Composite, ConjugateGradients, EnergyMomentum, GeneralizedAlpha, LinearSolver,
    Newmark, Newton, Simulation, SimulationBuilder, StepControl, TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use std::sync::Arc;

/// Rounding of sums in another order, over some dozens of steps with impacts.
const SAME: f64 = 1e-10;

/// Compares a linear body, with what else is set.
fn check_linear<I: TimeIntegrator + 'static>(
    scheme: impl Fn() -> I + Sync,
    h: f64,
    consistent: bool,
    setting: Setting,
) {
    let blocks = Blocks::new();
    let damped = |system: contact_dynamics::LinearSystem<'static, f64>| system.rayleigh(0.2, 1e-3).unwrap();
    let apart = largest_difference(
        &blocks,
        60,
        || Simulation::builder(damped(linear(&blocks.solid, consistent)), scheme(), h),
        |part| Simulation::builder(damped(linear_part(part, consistent)), scheme(), h),
        setting,
    );
    println!("{} (consistent mass: {consistent}): {apart:e}", scheme().name());
    assert!(apart < SAME, "{}, consistent {consistent}: {apart:e}", scheme().name());
}

#[test]
fn linear_bodies_with_friction_damping_and_both_masses() {
    let balanced: Setting = SimulationBuilder::energy_balance;
    for consistent in [false, true] {
        check_linear(|| Composite, 2e-3, consistent, balanced);
        check_linear(Newmark::trapezoidal, 2e-3, consistent, balanced);
        check_linear(|| GeneralizedAlpha::chung_hulbert(0.8).unwrap(), 2e-3, consistent, balanced);
        check_linear(|| Bathe::with_radius(0.5).unwrap(), 2e-3, consistent, balanced);
    }
}

#[test]
fn explicit_steps() {
    check_linear(|| CentralDifference, 5e-4, false, SimulationBuilder::energy_balance);
}

#[test]
fn uncorrected_contact() {
    check_linear(|| Composite, 2e-3, false, SimulationBuilder::uncorrected);
}

/// Contact without W on every rank, and not in one piece: products with the rows of each, and sums.
#[test]
fn contact_by_products() {
    let blocks = Blocks::new();
    let never: Setting = |builder| builder.contact_solver(ActiveSet::default().with_assembly(Assembly::Never));
    let exact = ConjugateGradients::default().tolerance(1e-14).unwrap();
    let factor = |part: &Arc<Part>| -> Box<dyn LinearSolver<f64>> { Box::new(Gathered(part.clone())) };
    let iteration = |part: &Arc<Part>| -> Box<dyn LinearSolver<f64>> { Box::new(exact.over_ranks(part.clone())) };
    for consistent in [false, true] {
        let whole = || Simulation::builder(linear(&blocks.solid, consistent), Composite, 2e-3);
        let part = |part: &SolidPart<2>| Simulation::builder(linear_part(part, consistent), Composite, 2e-3);
        let apart = [
            largest_difference_with(&blocks, 60, whole, part, never, factor),
            largest_difference_with(&blocks, 60, whole, part, never, iteration),
        ];
        println!("consistent mass {consistent}: {apart:?}");
        let fits = |&(apart, products): &(f64, u64)| apart < SAME && products > 0;
        assert!(apart.iter().all(fits), "consistent {consistent}: {apart:?}");
    }
}

#[test]
fn steps_that_are_judged_and_halved() {
    let control: Setting = |builder| {
        let control = StepControl::halving(1e-5).and_then(|control| control.local_error(2e-3));
        builder.step_control(control.unwrap())
    };
    check_linear(Newmark::trapezoidal, 4e-3, false, control);
    check_linear(|| Composite, 4e-3, false, control);
}

fn check_nonlinear<I: TimeIntegrator + 'static>(scheme: impl Fn() -> I + Sync, law: Law, h: f64, setting: Setting) {
    let blocks = Blocks::new();
    let apart = largest_difference(
        &blocks,
        40,
        || Simulation::builder(Hyperelastic::new(&blocks.solid, law), scheme(), h),
        |part| Simulation::builder(HyperelasticPart::new(&part.cut, part.part.clone(), law), scheme(), h),
        setting,
    );
    println!("{} {law:?}: {apart:e}", scheme().name());
    assert!(apart < SAME, "{} {law:?}: {apart:e}", scheme().name());
}

#[test]
fn bodies_at_large_strains() {
    for law in [Law::StVenantKirchhoff, Law::NeoHookean] {
        check_nonlinear(|| Composite, law, 4e-3, SimulationBuilder::energy_balance);
        check_nonlinear(|| EnergyMomentum, law, 4e-3, |builder| builder);
        check_nonlinear(|| Composite, law, 4e-3, |builder| builder.newton(Newton::modified().line_search()));
    }
    check_nonlinear(|| CentralDifference, Law::NeoHookean, 5e-4, SimulationBuilder::unchecked_stability);
}
