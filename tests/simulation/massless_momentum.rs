//! Momentum of bodies some dofs of which have no mass, where nothing acts from outside: starts, friction, damping,
//! corrections, changes of the step.

use contact_dynamics::{
    Bdf2, CdLagrange, CentralDifference, Composite, Error, Houbolt, LinearRows, LinearSystem, Newmark, NohBathe, Park,
    PersistencyCorrection, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::sparse::{matrix, spring};

type Run = Simulation<'static, f64>;
type Make = fn() -> Box<dyn TimeIntegrator>;

/// The largest change of momentum along some dofs in so many steps, and the steps in which the contact was closed.
fn drift(run: &mut Run, dofs: &[usize], steps: usize) -> (f64, usize) {
    let direction: Vec<f64> = (0..run.system().dofs()).map(|dof| f64::from(u8::from(dofs.contains(&dof)))).collect();
    let start = run.momentum(&direction).unwrap();
    let (mut most, mut closed) = (0.0_f64, 0);
    for _ in 0..steps {
        run.step().unwrap();
        most = most.max((run.momentum(&direction).unwrap() - start).abs());
        closed += usize::from(run.state().contacts().closed()[0]);
    }
    (most, closed)
}

/// A point (dofs 0 along the gap and 1 along the surface) on a body: its node (2 and 3), on a spring along the surface
/// to a mass (4). Along the surface the node has no mass.
fn point_on_a_body() -> LinearSystem<'static, f64> {
    let k = (0..5).map(|dof| (dof, dof, 0.0)).chain(spring(3, 4, 50.0));
    LinearSystem::lumped(vec![1.0, 1.0, 3.0, 0.0, 2.0], matrix(5, k)).unwrap()
}

fn rubbing(friction: f64, gap: f64) -> LinearRows<'static, f64> {
    LinearRows::new().unilateral(&[(0, 1.0), (2, -1.0)], gap).friction(friction, &[&[(1, 1.0), (3, -1.0)]])
}

const ALONG: [usize; 3] = [1, 3, 4];

/// Contact pushes dofs with mass, its friction drags one without: no impulse reaches that, so that none is given to the
/// other side either.
#[test]
fn friction_on_dofs_without_mass_takes_from_one_body_what_it_gives_to_the_other() {
    let schemes: [Make; 4] =
        [|| Box::new(Newmark::trapezoidal()), || Box::new(Composite), || Box::new(Bdf2), || Box::new(Houbolt)];
    for make in schemes {
        // It falls on the body, or is pressed on it from the start.
        for (gap, velocity, pressed) in
            [(0.013, vec![-1.0, 0.5, 0.0, 0.0, 0.0], 0.0), (0.0, vec![0.0, 0.5, 0.0, 0.0, 0.0], 4.0)]
        {
            let system = point_on_a_body().load(move |_, f: &mut [f64]| {
                f[0] -= pressed;
                f[2] += pressed;
            });
            let mut run = Simulation::builder(system, make(), 0.01)
                .velocity(velocity)
                .constraint(rubbing(0.3, gap))
                .uncorrected()
                .corrector(PersistencyCorrection::with_history_projection())
                .build()
                .unwrap();
            let (change, closed) = drift(&mut run, &ALONG, 60);
            assert!(closed > 0 && change < 1e-12, "{}, gap {gap}: {change:e}, closed {closed}", make().name());
            let rubbed = 0.5 - run.state().velocity()[1];
            assert!(rubbed > 1e-3, "{}, gap {gap}: friction takes {rubbed:e}", make().name());
        }
    }
}

/// Explicit stages know dofs without mass before the normal force that bounds their friction.
#[test]
fn explicit_stages_refuse_friction_on_dofs_without_mass_under_forces_on_others() {
    let schemes: [Make; 3] =
        [|| Box::new(CentralDifference), || Box::new(CdLagrange), || Box::new(NohBathe::new(0.54).unwrap())];
    for make in schemes {
        let run = |friction| {
            let builder = Simulation::builder(point_on_a_body(), make(), 0.01).constraint(rubbing(friction, 0.013));
            builder.velocity(vec![-1.0, 0.5, 0.0, 0.0, 0.0]).build().unwrap()
        };
        match run(0.3).step() {
            Err(Error::Incompatible { part, reason }) => {
                assert!(part.contains("friction") && reason.contains("implicit"), "{part}: {reason}");
            }
            other => panic!("{}: {other:?}", make().name()),
        }
        // Without a coefficient there is no friction.
        let (change, _) = drift(&mut run(0.0), &ALONG, 60);
        assert!(change < 1e-12, "{}: {change:e}", make().name());
    }
}

/// A mass (dof 0) meets the node (1) of a body: springs and dampers to a dof without mass (2), and on to a mass (3).
/// Corrections change the velocity of the node, and with it the force of the first damper.
#[test]
fn corrections_of_what_damps_a_dof_without_mass_keep_momentum() {
    let schemes: [Make; 5] = [
        || Box::new(Houbolt),
        || Box::new(Park),
        || Box::new(Bdf2),
        || Box::new(Composite),
        || Box::new(Newmark::trapezoidal()),
    ];
    for make in schemes {
        let k = [(0, 0, 0.0)].into_iter().chain(spring(1, 2, 60.0)).chain(spring(2, 3, 30.0));
        let system = LinearSystem::lumped(vec![1.0, 1.0, 0.0, 2.0], matrix(4, k)).unwrap().rayleigh(0.0, 0.02).unwrap();
        let mut run = Simulation::builder(system, make(), 0.01)
            .velocity(vec![1.0, 0.0, 0.0, 0.0])
            .constraint(LinearRows::new().unilateral(&[(1, 1.0), (0, -1.0)], 0.033))
            .uncorrected()
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let (change, closed) = drift(&mut run, &[0, 1, 2, 3], 100);
        assert!(closed > 0 && change < 1e-12, "{}: {change:e}, closed {closed}", make().name());
    }
}

/// A mass (dof 0) touches a dof without mass (1) that springs and dampers hold to a mass (2).
fn mass_and_foot(damping: f64) -> LinearSystem<'static, f64> {
    let k = [(0, 0, 0.0)].into_iter().chain(spring(1, 2, 40.0));
    let system = LinearSystem::lumped(vec![1.0, 0.0, 2.0], matrix(3, k)).unwrap();
    if damping > 0.0 { system.rayleigh(0.0, damping).unwrap() } else { system }
}

/// Where a contact touches a damped dof without mass at the start, what that cannot balance goes on to its neighbors.
#[test]
fn starts_in_contact_keep_the_momentum_of_damped_dofs() {
    // The body moves away from the contact, or onto it.
    for speed in [3.0, -3.0] {
        let schemes: [Make; 2] = [|| Box::new(Newmark::trapezoidal()), || Box::new(Composite)];
        for make in schemes {
            let mut run = Simulation::builder(mass_and_foot(0.05), make(), 0.01)
                .velocity(vec![0.0, 0.0, speed])
                .constraint(LinearRows::new().unilateral(&[(1, 1.0), (0, -1.0)], 0.0))
                .build()
                .unwrap();
            let (change, _) = drift(&mut run, &[0, 1, 2], 40);
            assert!(change < 1e-12, "{}, {speed}: {change:e}", make().name());
        }
    }
}

/// Contacts on dofs without mass have nothing to correct where the past is resampled or forgotten.
#[test]
fn changes_of_the_step_keep_momentum_while_a_dof_without_mass_is_pressed() {
    let schemes: [Make; 3] = [|| Box::new(Composite), || Box::new(Bdf2), || Box::new(Houbolt)];
    for make in schemes {
        for factor in [0.3, 1.7, 20.0] {
            let mut run = Simulation::builder(mass_and_foot(0.0), make(), 0.002)
                .velocity(vec![1.0, 0.0, 0.0])
                .constraint(LinearRows::new().unilateral(&[(1, 1.0), (0, -1.0)], 0.0031))
                .build()
                .unwrap();
            let (before, closed) = drift(&mut run, &[0, 1, 2], 8);
            assert!(
                closed > 0 && before < 1e-12 && run.state().contacts().closed()[0],
                "{}: {before:e}",
                make().name()
            );
            run.set_step_size(0.002 * factor).unwrap();
            let all = [1.0; 3];
            let changed = (run.momentum(&all).unwrap() - 1.0).abs();
            let (after, _) = drift(&mut run, &[0, 1, 2], 8);
            assert!(changed < 1e-12 && after < 1e-12, "{}, {factor}: {changed:e} {after:e}", make().name());
        }
    }
}

/// A damped dof without mass between two that go by on either side of it, and that it is tied to the ground beside: it
/// stands, though all that its velocity is known by is rounding of theirs.
#[test]
fn damped_dofs_that_others_let_stand_begin_at_rest() {
    let speed: f64 = 553.767_675_993_571_7;
    for [one, other] in [[0.1, 0.2], [0.3, 0.1], [0.7, 0.9]] {
        let third = -(one + other);
        let couplings = [one, other, third].into_iter().zip(1..).flat_map(|(k, dof)| [(0, dof, k), (dof, 0, k)]);
        let k = (0..4).map(|dof| (dof, dof, 2.0)).chain(couplings);
        let system =
            LinearSystem::<f64>::lumped(vec![0.0, 1.0, 1.0, 1.0], matrix(4, k)).unwrap().rayleigh(0.0, 0.01).unwrap();
        let run = Simulation::builder(system, Bdf2, 0.1).velocity(vec![speed; 4]).build().unwrap();
        let foot = run.state().velocity()[0];
        assert!(foot.abs() < 1e-12 * speed, "{one} {other}: {foot:e}");
    }
}
