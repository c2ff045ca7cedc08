//! Runs that have no gradient, or none yet, are refused by name.

use contact_dynamics::contact::{Candidates, Contacts, Side, Sphere, Variation};
use contact_dynamics::corrector::ZeroAcceleration;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::gradient::{Gradient, RecordedStep, Seed};
use contact_dynamics::{
    CdLagrange, Composite, ContactConstraint, ContactLaw, Error, GeneralizedAlpha, InitialOverclosure, LinearRows,
    LinearSystem, Lu, Newmark, NodesOnObstacle, Result, Simulation, SimulationBuilder, StepControl, TimeIntegrator,
};

fn zero(_: &RecordedStep<'_, f64>, _: &mut Seed<'_, f64>) -> f64 {
    0.0
}

fn gradient(run: &mut Simulation<'_, f64>) -> Result<Gradient<f64>> {
    run.gradient(&mut zero, &mut ())
}

/// Three masses on springs, the first above a floor.
fn system(masses: [f64; 3]) -> LinearSystem<'static, f64> {
    let springs: Vec<_> = (0..3).map(|dof| Triplet::new(dof, dof, 10.0)).collect();
    LinearSystem::lumped(masses.to_vec(), SparseColMat::try_new_from_triplets(3, 3, &springs).unwrap()).unwrap()
}

fn builder(system: LinearSystem<'static, f64>) -> SimulationBuilder<'static, f64> {
    Simulation::builder(system, GeneralizedAlpha::default(), 0.01).velocity(vec![-1.0, 0.0, 0.0])
}

fn floor() -> LinearRows<'static, f64> {
    LinearRows::new().unilateral(&[(0, 1.0)], 0.05)
}

/// A ball of radius 1 below a node.
fn ball(friction: f64) -> NodesOnObstacle<'static, f64, 3> {
    let ball = Sphere::new([0.0, 0.0, -1.1], 1.0, Side::Outside).unwrap();
    NodesOnObstacle::new(ball, &[[0.3, 0.0, 0.0]], &[[0, 1, 2]], &[0]).unwrap().friction(friction)
}

fn assert_refused<R: std::fmt::Debug>(result: Result<R>, what: &str) {
    match result {
        Err(Error::Incompatible { ref part, .. }) if part.contains(what) => {}
        other => panic!("{what}: {other:?}"),
    }
}

#[test]
fn parts_without_derivative_are_refused_when_recording_begins() {
    let refused = |builder: SimulationBuilder<'static, f64>, what: &str| {
        assert_refused(builder.build().unwrap().record(), what);
    };
    refused(builder(system([1.0, 0.0, 1.0])).constraint(floor()), "dofs without mass");
    refused(builder(system([1.0; 3])).constraint(floor()).corrector(ZeroAcceleration), "the corrector");
    refused(builder(system([1.0; 3])).constraint(floor()).linear_solver(Lu), "unsymmetric");
    let explicit = Simulation::builder(system([1.0; 3]), CdLagrange, 0.01);
    refused(explicit.constraint(ball(0.0)), "rows that turn");
    let pressed = LinearRows::new().row(ContactLaw::Penalty { stiffness: 10.0 }, &[(0, 1.0)], -0.1);
    refused(builder(system([1.0; 3])).constraint(pressed), "a force at the start");
    let mut begun = builder(system([1.0; 3])).build().unwrap();
    begun.step().unwrap();
    assert_refused(begun.record(), "a run that has begun");
    assert_refused(gradient(&mut begun), "the gradient");
}

#[test]
fn events_without_derivative_are_refused_by_the_gradient() {
    let law = ContactLaw::AugmentedLagrangian { stiffness: 1e3, augmentations: 3 };
    let mut run = builder(system([1.0; 3])).constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.05)).build().unwrap();
    run.record().unwrap();
    run.run_until(0.04, &mut ()).unwrap();
    assert!(gradient(&mut run).is_ok(), "it has not touched yet");
    run.run_until(0.1, &mut ()).unwrap();
    assert_refused(gradient(&mut run), "this contact law");

    let mut run = builder(system([1.0; 3])).constraint(floor()).build().unwrap();
    run.record().unwrap();
    run.run_until(0.1, &mut ()).unwrap();
    assert!(gradient(&mut run).is_ok());
    run.set_step_size(0.005).unwrap();
    assert_refused(gradient(&mut run), "a change of the step size");

    for (what, friction, scheme) in [
        ("friction along rows that turn", 0.2, Box::new(Newmark::trapezoidal()) as Box<dyn TimeIntegrator>),
        ("a projected past along rows that turn", 0.0, Box::new(Composite)),
    ] {
        let falls = Simulation::builder(system([1.0; 3]), scheme, 0.01).velocity(vec![0.0, 0.0, -1.0]);
        let mut run = falls.constraint(ball(friction)).build().unwrap();
        run.record().unwrap();
        run.run_until(0.3, &mut ()).unwrap();
        assert_refused(gradient(&mut run), what);
    }

    let mut run = builder(system([1.0; 3])).constraint(floor()).build().unwrap();
    run.record().unwrap();
    run.restart().unwrap();
    assert_refused(gradient(&mut run), "a restart");
}

/// A floor that is not searched before some time: nodes below it are found inside then, and are recovered slowly.
struct LateFloor(bool);

impl ContactConstraint<f64> for LateFloor {
    fn dofs(&self) -> &[usize] {
        &[0]
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        if self.0 {
            contacts.push((0, 0), ContactLaw::Rigid, &[(0, 1.0)]).recovery(1e-3);
        }
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        gaps[0] = u[0] + 0.05;
        Ok(())
    }
    fn search(&mut self, t: f64, _: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        let found = t >= 0.1;
        Ok(Candidates::changed_if(std::mem::replace(&mut self.0, found) != found))
    }
    fn variation(&self) -> Variation {
        Variation::BySearch
    }
}

#[test]
fn penetration_that_comes_out_slowly_is_refused() {
    let mut run = builder(system([1.0; 3])).constraint(LateFloor(false)).build().unwrap();
    run.record().unwrap();
    run.run_until(0.09, &mut ()).unwrap();
    assert!(gradient(&mut run).is_ok());
    run.run_until(0.12, &mut ()).unwrap();
    assert_refused(gradient(&mut run), "penetration");
}

#[test]
fn overlaps_at_the_start_are_refused() {
    let overlapping = LinearRows::new().unilateral(&[(0, 1.0)], -0.01);
    let builder =
        builder(system([1.0; 3])).initial_overclosure(InitialOverclosure::AdjustedGaps).constraint(overlapping);
    assert_refused(builder.build().unwrap().record(), "overlaps");
}

/// What happens in an attempt that is undone has no derivative and needs none.
#[test]
fn attempts_that_are_undone_refuse_nothing() {
    let law = ContactLaw::AugmentedLagrangian { stiffness: 1e3, augmentations: 3 };
    let contacts = LinearRows::new().row(law, &[(0, 1.0)], 0.0053).unilateral(&[(0, 1.0)], 0.0054);
    let contacts = contacts.unilateral(&[(0, 1.0)], 0.0054);
    let control = StepControl::halving(0.01 / 8.0).unwrap().contact_changes(1).unwrap();
    let trapezoidal =
        Simulation::builder(system([1.0; 3]), Newmark::trapezoidal(), 0.01).velocity(vec![-1.0, 0.0, 0.0]);
    let mut run = trapezoidal.step_control(control).constraint(contacts).build().unwrap();
    run.record().unwrap();
    run.step().unwrap();
    assert!(run.step_size() < 0.006, "contacts close in the first attempt");
    assert!(gradient(&mut run).is_ok());
}
