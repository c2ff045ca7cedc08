//! Bodies with many contacts, large strains, supports, and steps that change.

use contact_dynamics::contact::{Plane, Side, Sphere};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::gradient::{RecordedStep, Scales, Seed};
use contact_dynamics::{
    Bathe, CdLagrange, Composite, ContactLaw, GeneralizedAlpha, LinearRows, LinearSystem, Newmark, NodesOnObstacle,
    PersistencyCorrection, Result, Simulation, StepControl, TimeIntegrator,
};
use contact_dynamics_scenes::gradients::{AT, assert_equal, assert_near, compare, objective};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};

fn schemes() -> Vec<Box<dyn TimeIntegrator>> {
    vec![
        Box::new(Newmark::trapezoidal()),
        Box::new(GeneralizedAlpha::default()),
        Box::new(Composite),
        Box::new(Bathe::default()),
        Box::new(CdLagrange),
    ]
}

/// A block of 4 × 2 elements that falls on an inclined plane.
fn block(at: &[f64]) -> Solid<2> {
    let material = Material { young: 100.0 * at[2], poisson: 0.3, density: at[0] };
    Solid::<2>::rectangle([1.0, 0.5], [4, 2], material)
}

fn contact(solid: &Solid<2>, gap: f64) -> Result<NodesOnObstacle<'static, f64, 2>> {
    let (s, c) = 0.2_f64.sin_cos();
    let plane = Plane::new([0.0, -0.0231 - gap / c], [s, c])?;
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] < 1e-9).collect();
    NodesOnObstacle::new(plane, &solid.nodes, &solid.node_dofs(), &bottom)
}

#[test]
fn a_block_on_a_plane() {
    for number in 0..schemes().len() {
        let build = |at: &[f64]| {
            let solid = block(at);
            Simulation::builder(solid.system(), schemes().swap_remove(number), 0.003)
                .velocity(solid.uniform([0.3 * at[4], -at[4]]))
                .constraint(contact(&solid, at[7])?)
                .build()
        };
        let error = compare(&build, &|run| run.run_until(0.3, &mut ()).map(drop), (8, 0.1)).unwrap();
        assert_equal(&error, &schemes()[number].name());
    }
}

/// Large strains: tangents along the way back.
#[test]
fn a_soft_block_on_a_plane() {
    for (law, schemes_of_law) in [(Law::StVenantKirchhoff, 0..schemes().len()), (Law::NeoHookean, 1..2)] {
        for number in schemes_of_law {
            let build = |at: &[f64]| {
                let solid = block(at);
                // The weight is the load: M g with a density of 1.
                let mut system = Hyperelastic::new(&solid, law);
                system.particles.weigh([0.0, -3.0 * at[3] / at[0]]);
                Simulation::builder(system, schemes().swap_remove(number), 0.003)
                    .velocity(solid.uniform([0.3 * at[4], -at[4]]))
                    .constraint(contact(&solid, at[7])?)
                    .newton(contact_dynamics::Newton::full().tolerances(1e-12, 1e-12)?)
                    .build()
            };
            let error = compare(&build, &|run| run.run_until(0.3, &mut ()).map(drop), (8, 0.1)).unwrap();
            assert_equal(&error, &format!("{law:?}, {}", schemes()[number].name()));
        }
    }
}

/// A mass between two stops on a spring whose foot is driven, with a redundant third row.
fn driven(
    at: &[f64],
    scheme: Box<dyn TimeIntegrator>,
    control: Option<StepControl>,
) -> Result<Simulation<'static, f64>> {
    let k = 40.0 * at[2];
    let spring = [(0, 0, k), (0, 1, -k), (1, 0, -k), (1, 1, k)].map(|(i, j, value)| Triplet::new(i, j, value));
    let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &spring).unwrap();
    let system = LinearSystem::lumped(vec![at[0]; 2], stiffness)?.rayleigh(0.0, 0.01 * at[1] / at[2])?;
    let system = system.drive(0, |t: f64| [0.4 * (5.0 * t).sin(), 2.0 * (5.0 * t).cos(), -10.0 * (5.0 * t).sin()])?;
    let factor = at[3];
    let system = system.load(move |t, f| f[1] = factor * (3.0 * t).cos());
    let stops = LinearRows::new()
        .unilateral(&[(1, 1.0)], 0.3 + at[7])
        .unilateral(&[(1, 1.0)], 0.3 + at[7])
        .unilateral(&[(1, -1.0)], 0.31 + at[7]);
    let mut builder = Simulation::builder(system, scheme, 0.013).velocity(vec![0.0, at[4]]).constraint(stops);
    if let Some(control) = control {
        builder = builder.step_control(control);
    }
    builder.build()
}

#[test]
fn a_driven_mass_between_stops() {
    for number in 0..schemes().len() {
        let build = |at: &[f64]| driven(at, schemes().swap_remove(number), None);
        let error = compare(&build, &|run| run.run_until(1.2, &mut ()).map(drop), (8, 0.1)).unwrap();
        assert_equal(&error, &schemes()[number].name());
    }
}

/// The step size changes between steps, and by the control of the run.
#[test]
fn steps_that_change() {
    let build = |at: &[f64]| driven(at, Box::new(Newmark::trapezoidal()), None);
    let advance = |run: &mut Simulation<'static, f64>| {
        for h in [0.013, 0.02, 0.006, 0.013] {
            run.set_step_size(h)?;
            (0..25).try_for_each(|_| run.step())?;
        }
        run.land_on(1.5, &mut ()).map(drop)
    };
    assert_equal(&compare(&build, &advance, (8, 0.1)).unwrap(), "changed by the host");
    let control = StepControl::halving(0.013 / 16.0).unwrap().contact_changes(1).unwrap();
    let build = |at: &[f64]| driven(at, Box::new(Newmark::trapezoidal()), Some(control));
    let error = compare(&build, &|run| run.run_until(0.3, &mut ()).map(drop), (8, 0.1)).unwrap();
    assert_equal(&error, "changed by the control");
}

/// A block lands obliquely on a floor and slides, or sticks.
#[test]
fn a_block_that_slides_and_sticks() {
    for number in 0..schemes().len() {
        for friction in [0.1, 0.6] {
            let build = |at: &[f64]| {
                let solid = block(at);
                Simulation::builder(solid.system(), schemes().swap_remove(number), 0.003)
                    .velocity(solid.uniform([0.31 * at[4], -at[4]]))
                    .constraint(contact(&solid, at[7])?.friction(friction + at[6]))
                    .build()
            };
            let error = compare(&build, &|run| run.run_until(0.3, &mut ()).map(drop), (8, 0.1)).unwrap();
            assert_equal(&error, &format!("μ = {friction}, {}", schemes()[number].name()));
        }
    }
}

/// A mass on a spring is set down, slides to and fro, and stops; one that lies on the floor is pulled from rest.
#[test]
fn a_mass_that_slides() {
    for number in 0..schemes().len() {
        for [height, speed, pull] in [[0.0133, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 4.0]] {
            let build = |at: &[f64]| {
                let spring = [Triplet::new(0, 0, 10.0 * at[2]), Triplet::new(1, 1, 0.0)];
                let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &spring).unwrap();
                let factor = at[3];
                let system = LinearSystem::lumped(vec![2.0 * at[0]; 2], stiffness)?;
                let system = system.load(move |t, f| [f[0], f[1]] = [factor * pull * (0.5 + t), -5.0 * factor]);
                let floor = LinearRows::new().unilateral(&[(1, 1.0)], height + at[7]);
                Simulation::builder(system, schemes().swap_remove(number), 0.01)
                    .velocity(vec![speed * at[4], if height > 0.0 { -0.5 * at[4] } else { 0.0 }])
                    .constraint(floor.friction(0.3 + at[6], &[&[(0, 1.0)]]))
                    .build()
            };
            // The height of a contact that is closed at the start does not change.
            let varied = if height > 0.0 { 8 } else { 7 };
            let error = compare(&build, &|run| run.run_until(0.4, &mut ()).map(drop), (varied, 0.1)).unwrap();
            assert_equal(&error, &format!("{height}, {speed}, {pull}: {}", schemes()[number].name()));
        }
    }
}

/// Steps taken again from checkpoints give the same digits, and leave the run as it was.
#[test]
fn checkpoints_change_nothing() {
    let controls = [None, Some(StepControl::halving(0.013 / 16.0).unwrap().contact_changes(1).unwrap())];
    for (number, control) in (0..schemes().len()).map(|number| (number, controls[0])).chain([(0, controls[1])]) {
        let run = |by_checkpoints: bool| {
            let mut run = driven(&AT, schemes().swap_remove(number), control).unwrap();
            if by_checkpoints { run.record_checkpoints() } else { run.record() }.unwrap();
            let gradients = [0.7, 1.3].map(|end| {
                run.run_until(end, &mut ()).unwrap();
                let mut scales = Scales::default();
                (run.gradient(&mut objective, &mut scales).unwrap(), scales)
            });
            run.run_until(2.0, &mut ()).unwrap();
            (gradients, run.state().clone(), run.impulses_on_dofs().to_vec(), *run.statistics())
        };
        let [all, some] = [run(false), run(true)];
        assert_eq!(all, some, "{}", schemes()[number].name());
        let mut plain = driven(&AT, schemes().swap_remove(number), control).unwrap();
        plain.run_until(2.0, &mut ()).unwrap();
        assert_eq!((plain.state(), plain.statistics()), (&all.1, &all.3), "{}", schemes()[number].name());
    }
}

/// A block lands on a floor and slides under a side wind: its friction turns.
#[test]
fn friction_in_space() {
    for number in 0..schemes().len() {
        let build = |at: &[f64]| {
            let material = Material { young: 100.0 * at[2], poisson: 0.3, density: at[0] };
            let solid = Solid::<3>::block([1.0, 0.8, 0.5], [2, 1, 1], material);
            let plane = Plane::new([0.0, 0.0, -0.0231 - at[7] / 0.2_f64.cos()], [0.2_f64.sin(), 0.0, 0.2_f64.cos()])?;
            let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] < 1e-9).collect();
            let contact = NodesOnObstacle::new(plane, &solid.nodes, &solid.node_dofs(), &bottom)?;
            let factor = at[3];
            let wind = move |t: f64, f: &mut [f64]| f.iter_mut().skip(1).step_by(3).for_each(|f| *f = factor * 0.3 * t);
            Simulation::builder(solid.system().load(wind), schemes().swap_remove(number), 0.004)
                .velocity(solid.uniform([0.31 * at[4], 0.1 * at[4], -at[4]]))
                .constraint(contact.friction(0.1 + at[6]))
                .build()
        };
        let error = compare(&build, &|run| run.run_until(0.3, &mut ()).map(drop), (8, 0.1)).unwrap();
        assert_equal(&error, &schemes()[number].name());
    }
}

/// A block lands on a ball: rows turn.
#[test]
fn rows_that_turn() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 5] = [
        || Box::new(Newmark::trapezoidal()),
        || Box::new(GeneralizedAlpha::default()),
        || Box::new(Newmark::new(0.3, 0.6).unwrap()),
        || Box::new(Composite),
        || Box::new(Bathe::default()),
    ];
    for scheme in schemes {
        for law in [ContactLaw::Rigid, ContactLaw::Penalty { stiffness: 50.0 }] {
            let build = |at: &[f64]| {
                let solid = block(at);
                let ball = Sphere::new([0.6, -0.5217], 0.5 - at[7], Side::Outside)?;
                let surface = solid.surface_nodes();
                let contact = NodesOnObstacle::new(ball, &solid.nodes, &solid.node_dofs(), &surface)?;
                let law = match law {
                    ContactLaw::Penalty { stiffness } => ContactLaw::Penalty { stiffness: stiffness * at[5] },
                    other => other,
                };
                Simulation::builder(solid.system(), scheme(), 0.003)
                    .velocity(solid.uniform([0.31 * at[4], -at[4]]))
                    .constraint(contact.with_law(law))
                    // It projects no past state.
                    .corrector(PersistencyCorrection::new())
                    .build()
            };
            let error = compare(&build, &|run| run.run_until(0.3, &mut ()).map(drop), (8, 0.1)).unwrap();
            // Steps iterate rows that turn until forces agree to about 1e-7.
            assert_near(&error, 1e-5, &format!("{law:?}, {}", scheme().name()));
        }
    }
}

/// A mass slides in a bowl from the start on, and the bowl swings.
#[test]
fn a_mass_in_a_bowl() {
    for swing in [0.0, 0.3] {
        for scheme in [|| Newmark::trapezoidal(), || Newmark::new(0.3, 0.6).unwrap()] {
            let build = |at: &[f64]| {
                let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &[]).unwrap();
                let factor = at[3];
                let system = LinearSystem::lumped(vec![2.0 * at[0]; 2], stiffness)?;
                let system = system.load(move |_, f| [f[0], f[1]] = [0.0, -20.0 * factor]);
                let bowl = Sphere::new([0.0, 0.0], 1.0, Side::Inside)?;
                let (s, c) = 0.4_f64.sin_cos();
                let contact = NodesOnObstacle::new(bowl, &[[s, -c]], &[[0, 1]], &[0])?.moving(move |t| {
                    let (x, v, a) = (swing * t * t * t, 3.0 * swing * t * t, 6.0 * swing * t);
                    [[x, 0.0], [v, 0.0], [a, 0.0]]
                });
                let velocity = vec![-0.7 * c * at[4], -0.7 * s * at[4]];
                Simulation::builder(system, scheme(), 0.004).velocity(velocity).constraint(contact).build()
            };
            let error = compare(&build, &|run| run.run_until(0.5, &mut ()).map(drop), (5, 0.1)).unwrap();
            assert_equal(&error, &format!("{swing}, {}", scheme().name()));
        }
    }
}

/// A tie without force at the start holds all the same: its accelerations do not follow the displacements.
#[test]
fn a_tie_without_force_at_the_start() {
    let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 8.0)]).unwrap();
    let system = LinearSystem::lumped(vec![2.0], stiffness).unwrap();
    let tie = LinearRows::new().row(ContactLaw::Equality, &[(0, 1.0)], 0.0);
    let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.01).constraint(tie).build().unwrap();
    run.record().unwrap();
    run.step().unwrap();
    let mut acceleration = |step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>| {
        seed.acceleration[0] += if step.step == 0 { 1.0 } else { 0.0 };
        0.0
    };
    let gradient = run.gradient(&mut acceleration, &mut ()).unwrap();
    assert!(gradient.displacement[0].abs() < 1e-12, "{gradient:?}");
}
