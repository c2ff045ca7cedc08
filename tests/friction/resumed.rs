//! Runs with friction continued from a copy, undone after a failure, and in single precision.

use super::{GRAVITY, masses};
use contact_dynamics::{
    Composite, LinearRows, LinearSystem, Newmark, Real, Simulation, SimulationBuilder, TimeIntegrator,
};
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::sparse::matrix;

/// Two masses tied by a spring hop along a rough floor.
fn hopping<T: Real>(scheme: Box<dyn TimeIntegrator>) -> SimulationBuilder<'static, T> {
    let entries = [
        (0, 0, 50.0),
        (2, 2, 50.0),
        (0, 2, -50.0),
        (2, 0, -50.0),
        (1, 1, 20.0),
        (3, 3, 20.0),
        (1, 3, -20.0),
        (3, 1, -20.0),
    ];
    let system = LinearSystem::lumped(vec![T::one(); 4], matrix(4, entries)).unwrap();
    let system = system.load(|_, f: &mut [T]| (f[1], f[3]) = (T::of(-GRAVITY), T::of(-GRAVITY)));
    let floor = [(0, 0.0), (2, 0.3)].into_iter().fold(LinearRows::new(), |rows, (x, gap)| {
        rows.unilateral(&[(x + 1, T::one())], T::of(gap)).friction(0.3, &[&[(x, T::one())]])
    });
    Simulation::builder(system, scheme, 0.01).velocity([2.0, 0.0, 1.0, -1.0].map(T::of).to_vec()).constraint(floor)
}

#[test]
fn a_run_continued_from_a_copy_is_the_same_to_the_bit() {
    for scheme in schemes::all().iter().filter(|scheme| scheme.takes_multipliers()) {
        let mut whole = hopping::<f64>((scheme.make)()).build().unwrap();
        for _ in 0..37 {
            whole.step().unwrap();
        }
        let (state, history) = (whole.state().clone(), whole.history().clone());
        let mut resumed = hopping::<f64>((scheme.make)()).resume(state, history).build().unwrap();
        for _ in 0..60 {
            whole.step().unwrap();
            resumed.step().unwrap();
        }
        assert!(whole.state() == resumed.state(), "{}", scheme.name());
    }
}

#[test]
fn single_precision_follows_double() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Newmark::trapezoidal()), || Box::new(Composite)];
    for scheme in schemes {
        let mut single = hopping::<f32>(scheme()).build().unwrap();
        let mut double = hopping::<f64>(scheme()).build().unwrap();
        single.run_until(1.0, &mut ()).unwrap();
        double.run_until(1.0, &mut ()).unwrap();
        for (&a, &b) in single.state().displacement().iter().zip(double.state().displacement()) {
            assert!((f64::from(a) - b).abs() < 2e-3, "{a} {b}");
        }
    }
}

/// A step that fails leaves friction forces, slips and flags as they were.
#[test]
fn failed_steps_leave_friction_as_it_was() {
    let ball = masses(vec![1.0; 2], vec![0.0, -GRAVITY]).unwrap();
    let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.3, &[&[(0, 1.0)]]).dragging(|t| match t {
        t if t > 0.055 => [[f64::NAN, 0.0], [0.0; 2]],
        _ => [[1.0, 0.0], [0.0; 2]],
    });
    let mut run =
        super::run(ball, Box::new(Newmark::trapezoidal()), 0.01, vec![0.0; 2]).constraint(floor).build().unwrap();
    run.run_until(0.05, &mut ()).unwrap();
    let before = run.state().clone();
    assert!(run.step().is_err());
    assert!(*run.state() == before);
}
