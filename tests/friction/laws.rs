//! Friction beside the laws of the gap: rigid, with restitution, penalties; on belts; of pairs.

use super::{GRAVITY, masses, run, schemes};
use contact_dynamics::contact::{ContactLaw, GapFunction, NodesOnObstacle, Plane, Side, Sphere};
use contact_dynamics::{ContactStatus, LinearRows, MoreauJean, Newmark, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::schemes::Listed;

/// Newton's impact law: the floor gives m (1 + e) v_n, and friction μ of that, or what holds the particle.
#[test]
fn impacts_with_restitution() {
    for (along, e) in [(2.0, 0.5), (0.2, 0.5), (2.0, 0.0), (-2.0, 1.0)] {
        let ball = masses(vec![1.5; 2], vec![0.0, 0.0]).unwrap();
        let floor = LinearRows::new()
            .row(ContactLaw::Restitution { coefficient: e }, &[(1, 1.0)], 0.1)
            .friction(0.3, &[&[(0, 1.0)]]);
        let scheme = Box::new(MoreauJean::new(0.5).unwrap());
        let mut run = run(ball, scheme, 0.013, vec![along, -1.0]).constraint(floor).build().unwrap();
        run.run_until(0.5, &mut ()).unwrap();
        let expected = along.signum() * (f64::abs(along) - 0.3 * (1.0 + e)).max(0.0);
        let v = run.state().velocity();
        assert!((v[0] - expected).abs() < 1e-14 && (v[1] - e).abs() < 1e-14, "{along} {e} {v:?}");
    }
}

/// Plastic impact of a particle on a rough floor, at any phase of the step: the impulses are in the cone, and so is
/// what is left.
#[test]
fn oblique_impacts_of_a_particle() {
    for scheme in schemes().filter(Listed::takes_corrections) {
        for (along, expected) in [(2.0, 1.7), (0.2, 0.0)] {
            for phase in 0..10 {
                let ball = masses(vec![1.5; 2], vec![0.0, 0.0]).unwrap();
                let gap = 0.05 * (2.0 + f64::from(phase) / 10.0);
                let floor = LinearRows::new().unilateral(&[(1, 1.0)], gap).friction(0.3, &[&[(0, 1.0)]]);
                let mut run = run(ball, (scheme.make)(), 0.05, vec![along, -1.0])
                    .constraint(floor)
                    .corrector(PersistencyCorrection::with_history_projection())
                    .energy_balance()
                    .build()
                    .unwrap();
                let mut impulse = [0.0; 2];
                while run.state().time() < 0.5 {
                    run.step().unwrap();
                    let contacts = run.state().contacts();
                    impulse[0] += contacts.friction_impulses(0)[0];
                    impulse[1] += contacts.impulses()[0];
                }
                let (v, name) = (run.state().velocity(), scheme.name());
                assert!((v[0] - expected).abs() < 1e-12 && v[1].abs() < 1e-12, "{name} {along} {phase} {v:?}");
                // The books close: impulses are the change of momentum.
                assert!((impulse[0] - 1.5 * (v[0] - along)).abs() < 1e-12, "{name} {along} {phase} {impulse:?}");
                assert!((impulse[1] - 1.5).abs() < 1e-12, "{name} {along} {phase} {impulse:?}");
                // So does that of the energy: the normal velocity is lost in the impact, the rest by friction.
                let works = run.energy().works.unwrap();
                let rubbed = 0.75 * (along * along - expected * expected);
                let miss = [works.impacts + 0.75, works.friction + rubbed, works.corrections, works.remainder];
                assert!(miss.iter().all(|x| x.abs() < 1e-12), "{name} {along} {phase} {works:?}");
                if (scheme.make)().tableau().stages.len() > 1 && (1..5).contains(&phase) {
                    // In the first of two stages: the state between is edited.
                    let dissipated = run.state().contacts().dissipated()[0];
                    assert!((dissipated - 0.75).abs() < 1e-12, "{name} {along} {phase} {dissipated}");
                }
            }
        }
    }
}

/// Before the first step a contact at rest is known to stick or slide, from what pulls along it.
#[test]
fn a_run_begins_with_contacts_that_stick_or_slide() {
    for (pull, status, friction) in [(2.0, ContactStatus::Sticking, -2.0), (8.0, ContactStatus::Sliding, -6.0)] {
        let block = masses(vec![2.0; 2], vec![pull, -20.0]).unwrap();
        let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.3, &[&[(0, 1.0)]]);
        let run = run(block, Box::new(Newmark::trapezoidal()), 0.01, vec![0.0; 2]).constraint(floor).build().unwrap();
        let contacts = run.state().contacts();
        assert!((contacts.friction_forces(0)[0] - friction).abs() < 1e-12, "{:?}", contacts.friction_forces(0));
        assert_eq!(contacts.status(0), status, "{pull}");
    }
}

/// Friction is μ times the force of a spring, and what sticks is held by a multiplier: by implicit schemes, and by
/// explicit ones, which know the force before they solve.
#[test]
fn compliant_laws_rub_too() {
    for scheme in schemes().filter(|scheme| scheme.name() != "Moreau–Jean(1)") {
        for law in [ContactLaw::Penalty { stiffness: 1e4 }, ContactLaw::PowerLaw { stiffness: 1e5, exponent: 1.5 }] {
            for (pull, status) in [(2.0, ContactStatus::Sticking), (8.0, ContactStatus::Sliding)] {
                let block = masses(vec![2.0; 2], vec![pull, -20.0]).unwrap();
                let depth = match law {
                    ContactLaw::PowerLaw { .. } => (20.0_f64 / 1e5).powf(2.0 / 3.0),
                    _ => 20.0 / 1e4,
                };
                let floor = LinearRows::new().row(law, &[(1, 1.0)], 0.0).friction(0.3, &[&[(0, 1.0)]]);
                let mut run = run(block, (scheme.make)(), 0.01, vec![0.0; 2])
                    .displacement(vec![0.0, -depth])
                    .constraint(floor)
                    .build()
                    .unwrap();
                run.run_until(1.0, &mut ()).unwrap();
                let (contacts, name) = (run.state().contacts(), scheme.name());
                let expected = if status == ContactStatus::Sliding { 0.5 * (pull - 6.0) / 2.0 } else { 0.0 };
                let way = run.state().displacement()[0];
                assert!((way - expected).abs() < 1e-9, "{name} {law:?} {way} {expected}");
                assert_eq!(contacts.status(0), status, "{name} {law:?}");
                let friction = if status == ContactStatus::Sliding { -6.0 } else { -pull };
                assert!((contacts.friction_forces(0)[0] - friction).abs() < 1e-9, "{name} {law:?} {friction}");
            }
        }
    }
}

/// A ball thrown at a spring: friction is μ times its force as long as the ball slides, and what it takes is μ times
/// what the spring gives; rigid contacts beside it go on as they would.
#[test]
fn springs_take_what_they_should() {
    for scheme in schemes() {
        let balls = masses(vec![1.0; 4], vec![0.0, 0.0, 0.0, -GRAVITY]).unwrap();
        let floor = LinearRows::new()
            .row(ContactLaw::Penalty { stiffness: 400.0 }, &[(1, 1.0)], 0.05)
            .friction(0.2, &[&[(0, 1.0)]])
            .unilateral(&[(3, 1.0)], 0.0)
            .friction(0.1, &[&[(2, 1.0)]]);
        let mut run = run(balls, (scheme.make)(), 2e-3, vec![3.0, -1.0, 3.0, 0.0]).constraint(floor).build().unwrap();
        let mut impulse = [0.0; 2];
        while run.state().time() < 0.5 {
            run.step().unwrap();
            let contacts = run.state().contacts();
            impulse[0] += contacts.friction_impulses(0)[0];
            impulse[1] += contacts.impulses()[0];
        }
        let (v, name) = (run.state().velocity(), scheme.name());
        assert!((impulse[0] / impulse[1] + 0.2).abs() < 1e-12 && impulse[1] > 1.5, "{name} {impulse:?}");
        assert!((v[0] - 3.0 - impulse[0]).abs() < 1e-12 && (v[1] + 1.0 - impulse[1]).abs() < 1e-12, "{name} {v:?}");
        assert!((v[2] - 2.5).abs() < 1e-11, "{name} {v:?}");
    }
}

/// Two masses on each other, the upper one thrown: momentum stays, and they end with one velocity.
#[test]
fn pairs_share_their_momentum() {
    for scheme in schemes() {
        let pair = masses(vec![2.0, 2.0, 1.0, 1.0], vec![0.0, 0.0, 0.0, -GRAVITY]).unwrap();
        let rows = LinearRows::new()
            .equality(&[(1, 1.0)], 0.0)
            .pair_with_friction((ContactLaw::Rigid, 0.2), [0, 1], [2, 3], [0.0, 1.0], 0.0)
            .unwrap();
        let mut run = run(pair, (scheme.make)(), 0.01, vec![0.0, 0.0, 1.0, 0.0]).constraint(rows).build().unwrap();
        let start = run.momentum(&[1.0, 0.0, 1.0, 0.0]).unwrap();
        for _ in 0..100 {
            run.step().unwrap();
            let now = run.momentum(&[1.0, 0.0, 1.0, 0.0]).unwrap();
            assert!((now / start - 1.0).abs() < 1e-13, "{} {now}", scheme.name());
        }
        let v = run.state().velocity();
        assert!((v[0] - 1.0 / 3.0).abs() < 1e-12 && (v[2] - 1.0 / 3.0).abs() < 1e-12, "{} {v:?}", scheme.name());
    }
}

/// A particle in a drum that turns is carried up until it slides; the same by an obstacle and by a gap function.
#[test]
fn a_turning_drum_carries() {
    let (radius, friction, spin) = (1.0, 0.5, 3.0);
    let build = |by_function: bool| {
        let particle = masses(vec![1.0; 2], vec![0.0, -GRAVITY]).unwrap();
        let builder = run(particle, Box::new(Newmark::trapezoidal()), 1e-3, vec![spin * radius, 0.0]);
        if by_function {
            let place = move |x: &[f64]| [x[0], x[1] - radius];
            let gap = move |_: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| {
                let [x, y] = place(x);
                let r = x.hypot(y);
                gradient.copy_from_slice(&[-x / r, -y / r]);
                let across = (x * v[1] - y * v[0]) / r;
                [radius - r, 0.0, -across * across / r]
            };
            let along = move |_: f64, x: &[f64], tangent: &mut [f64]| {
                let [x, y] = place(x);
                let r = x.hypot(y);
                tangent.copy_from_slice(&[-y / r, x / r]);
                [[spin * r, 0.0], [0.0; 2]]
            };
            let rows = GapFunction::new(&[0, 1], gap).friction(friction, 1, along).scale(radius).unwrap();
            return builder.constraint(rows).build().unwrap();
        }
        let drum = Sphere::new([0.0, 0.0], radius, Side::Inside).unwrap();
        let nodes = NodesOnObstacle::new(drum, &[[0.0, -radius]], &[[0, 1]], &[0]).unwrap();
        let turning = move |_: f64, [x, y]: [f64; 2]| [[-spin * y, spin * x], [-spin * spin * x, -spin * spin * y]];
        builder.constraint(nodes.friction(friction).dragging(turning)).build().unwrap()
    };
    // It goes round with the drum until its weight pulls more than friction holds, g sin α = μ (g cos α + ω² R), that
    // is until α = .878.
    let mut places = Vec::new();
    for by_function in [false, true] {
        let mut run: Simulation<'_, f64> = build(by_function);
        run.run_until(0.25, &mut ()).unwrap();
        let (u, v) = (run.state().displacement(), run.state().velocity());
        let angle = u[0].atan2(radius - u[1]);
        assert!((angle - spin * 0.25).abs() < 1e-5 && (v[0].hypot(v[1]) - spin).abs() < 1e-5, "{angle} {v:?}");
        assert_eq!(run.state().contacts().status(0), ContactStatus::Sticking);
        places.push(u.to_vec());
        run.run_until(0.35, &mut ()).unwrap();
        assert_eq!(run.state().contacts().status(0), ContactStatus::Sliding);
        assert!(run.state().contacts().slip(0)[0].abs() > 1e-3);
    }
    assert!((places[0][0] - places[1][0]).abs() < 1e-6, "{places:?}");
}

/// A floor that is rough on the right only: the place of each step's start decides.
#[test]
fn friction_may_depend_on_the_place() {
    let block = masses(vec![1.0; 2], vec![0.0, -GRAVITY]).unwrap();
    let floor = NodesOnObstacle::new(Plane::new([0.0; 2], [0.0, 1.0]).unwrap(), &[[0.0; 2]], &[[0, 1]], &[0])
        .unwrap()
        .friction_at(|[x, _]: [f64; 2]| if x < 0.995 { 0.0 } else { 0.25 });
    let mut run = run(block, Box::new(Newmark::trapezoidal()), 0.01, vec![1.0, 0.0]).constraint(floor).build().unwrap();
    run.run_until(0.9, &mut ()).unwrap();
    assert!((run.state().velocity()[0] - 1.0).abs() < 1e-15);
    run.run_until(2.0, &mut ()).unwrap();
    assert!((run.state().displacement()[0] - 1.2).abs() < 0.01 && run.state().velocity()[0].abs() < 1e-14);
}
