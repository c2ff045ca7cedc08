//! Files of checkpoints, of runs with and without friction, with bytes changed: reading refuses them, `build` refuses
//! them, or the run goes on with numbers.

#![no_main]

use contact_dynamics::{
    Checkpoint, ContactLaw, Houbolt, LinearRows, LinearSystem, Newmark, Simulation, SimulationBuilder, StepControl,
    TimeIntegrator,
};
use contact_dynamics_scenes::sparse::matrix;
use fuzz::Input;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut input = Input(bytes);
    let kind = input.below(4);
    let file = match input.below(8) {
        0 => input.0.to_vec(),
        _ => {
            let mut run = scene(kind).build().expect("a run");
            for _ in 0..input.below(12) {
                run.step().expect("a step");
            }
            let file = postcard::to_stdvec(&run.checkpoint()).expect("a file");
            input.edited(&file)
        }
    };
    let Ok(checkpoint) = postcard::from_bytes::<Checkpoint<f64>>(&file) else { return };
    // What is read can be written, and is the same then.
    let again = postcard::to_stdvec(&checkpoint).expect("a file");
    let read = postcard::from_bytes::<Checkpoint<f64>>(&again).expect("what was written is read");
    assert_eq!(checkpoint.state(), read.state());
    let Ok(mut run) = scene(kind).resume_from(checkpoint).build() else { return };
    for _ in 0..4 {
        let before = run.state().clone();
        if let Err(error) = run.step() {
            assert_eq!(&before, run.state(), "{error}");
            return;
        }
        assert!(run.state().displacement().iter().chain(run.state().velocity()).all(|x| x.is_finite()));
    }
});

/// Two masses on springs that fall on a floor which they may slide on: two schemes, with step control or without.
fn scene(kind: usize) -> SimulationBuilder<'static, f64> {
    let k = matrix(4, [(0, 0, 9.0), (2, 2, 9.0), (0, 2, -4.0), (2, 0, -4.0), (1, 1, 1.0)]);
    let system = LinearSystem::lumped(vec![1.0, 1.0, 2.0, 2.0], k).expect("a system");
    let system = system.load(|_, f| (f[1], f[3]) = (-1.0, -1.0));
    let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.05).friction(0.3, &[&[(0, 1.0)]]).row(
        ContactLaw::Penalty { stiffness: 50.0 },
        &[(3, 1.0)],
        0.1,
    );
    let scheme: Box<dyn TimeIntegrator> = match kind {
        0 | 1 => Box::new(Houbolt),
        _ => Box::new(Newmark::trapezoidal()),
    };
    let builder = Simulation::builder(system, scheme, 0.05).velocity(vec![1.0, -1.0, 0.5, -1.0]).constraint(floor);
    match kind % 2 {
        0 => builder,
        _ => builder.step_control(StepControl::halving(1e-3).expect("a limit")),
    }
}
