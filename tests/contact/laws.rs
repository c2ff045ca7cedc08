//! Contact laws: compliant ones against springs and Hertz' impact, restitution against bouncing balls and cradles.

use contact_dynamics::contact::{ContactLaw, GapOffset};
use contact_dynamics::{
    CdLagrange, CentralDifference, Composite, Error, GeneralizedAlpha, LinearRows, LinearSystem, MoreauJean, Newmark,
    PersistencyCorrection, Simulation, TchamwaWielgosz, TimeIntegrator,
};
use contact_dynamics_scenes::reference::PowerLawImpact;
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::sparse::{matrix, springs};

/// Masses on springs to their neighbors and to the ground.
fn chain(mass: &[f64], ground: &[f64], between: f64) -> LinearSystem<'static, f64> {
    let n = mass.len();
    let ground = ground.iter().enumerate().map(|(i, &k)| (i, i, k));
    let k = matrix(n, ground.chain(springs(n, between)));
    LinearSystem::lumped(mass.to_vec(), k).unwrap()
}

fn contact(law: ContactLaw, gap: f64) -> LinearRows<'static, f64> {
    LinearRows::new().row(law, &[(0, 1.0)], gap)
}

/// A penalty in lasting compression is a spring: every scheme must give what it gives with that spring in K.
#[test]
fn a_penalty_in_compression_is_a_spring_of_the_system() {
    let (mass, h) = ([1.0, 2.0, 1.5], 0.05);
    let load = |_: f64, f: &mut [f64]| f.copy_from_slice(&[-40.0, -20.0, -10.0]);
    let start = vec![-0.3, -0.2, -0.25];
    for listed in schemes::all() {
        let penalty = ContactLaw::Penalty { stiffness: 30.0 };
        let mut pressed = Simulation::builder(chain(&mass, &[20.0, 30.0, 10.0], 60.0).load(load), (listed.make)(), h)
            .displacement(start.clone())
            .constraint(contact(penalty, 0.0))
            .build()
            .unwrap();
        let mut spring = Simulation::builder(chain(&mass, &[50.0, 30.0, 10.0], 60.0).load(load), (listed.make)(), h)
            .displacement(start.clone())
            .build()
            .unwrap();
        for step in 0..200 {
            pressed.step().unwrap();
            spring.step().unwrap();
            assert!(spring.state().displacement()[0] < 0.0, "{}: not in compression", listed.name());
            for (a, b) in pressed.state().displacement().iter().zip(spring.state().displacement()) {
                assert!((a - b).abs() < 1e-11, "{}, step {step}: {a} {b}", listed.name());
            }
            for (a, b) in pressed.state().acceleration().iter().zip(spring.state().acceleration()) {
                assert!((a - b).abs() < 1e-8, "{}, step {step}: {a} {b}", listed.name());
            }
            assert!(pressed.state().contacts().closed()[0]);
        }
    }
}

/// Duration and largest force of an impact, from the run itself: the force is smooth, its peak is that of a parabola
/// through three steps, the touch and the release are where the gap crosses zero.
fn impact_of(law: ContactLaw, mass: f64, speed: f64, scheme: Box<dyn TimeIntegrator>, h: f64, phase: f64) -> [f64; 2] {
    let gap = (3.0 + phase) * h * speed;
    let mut run = Simulation::builder(chain(&[mass], &[0.0], 0.0), scheme, h)
        .velocity(vec![-speed])
        .constraint(contact(law, gap))
        .build()
        .unwrap();
    let (mut forces, mut gaps) = (vec![0.0], vec![gap]);
    while gaps.len() < 6 || gaps[gaps.len() - 1] < 0.0 {
        run.step().unwrap();
        gaps.push(run.state().displacement()[0] + gap);
        forces.push(run.state().contacts().forces()[0]);
        assert!(gaps.len() < 100_000);
    }
    let top = (1..forces.len() - 1).max_by(|&i, &j| forces[i].total_cmp(&forces[j])).unwrap();
    let (left, middle, right) = (forces[top - 1], forces[top], forces[top + 1]);
    let peak = middle - (right - left).powi(2) / (8.0 * (left - 2.0 * middle + right));
    let cross = |k: usize| (k as f64 - gaps[k] / (gaps[k] - gaps[k - 1])) * h;
    let touch = (1..gaps.len()).find(|&k| gaps[k] < 0.0).unwrap();
    [cross(gaps.len() - 1) - cross(touch), peak]
}

#[test]
fn hertz_impact_of_one_degree_of_freedom() {
    use std::f64::consts::PI;
    let ball = |radius: f64, density: f64| density * 4.0 / 3.0 * PI * radius.powi(3);
    // Two glass spheres; two of limestone; aluminium, magnesium and steel spheres on a rigid wall: d_max, F_max, t_c.
    let cases = [
        (48e9 / (2.0 * 0.96), 0.005, ball(0.01, 2800.0) / 2.0, 20.0, [2.74113e-4, 10696.9, 4.03395e-5]),
        (20e9 / (2.0 * 0.9375), 0.005, ball(0.01, 2500.0) / 2.0, 20.0, [3.68304e-4, 7108.24, 5.4201e-5]),
        (70e9 / 0.91, 0.1, ball(0.1, 2699.0), 0.2, [4.97172e-5, 11369.9, 7.31657e-4]),
        (40e9 / 0.8775, 0.1, ball(0.1, 1800.0), 0.2, [5.21233e-5, 7232.68, 7.67066e-4]),
        (210e9 / 0.91, 0.01, ball(0.01, 7800.0), 1.0, [1.77497e-5, 2300.93, 5.22422e-5]),
    ];
    for (modulus, radius, mass, speed, [depth, force, duration]) in cases {
        let law = ContactLaw::hertz(modulus, radius);
        let ContactLaw::PowerLaw { stiffness, exponent } = law else { panic!("{law:?}") };
        let exact = PowerLawImpact { mass, stiffness, exponent, velocity: speed };
        for (found, published) in [(exact.depth(), depth), (exact.force(), force), (exact.duration(), duration)] {
            assert!((found / published - 1.0).abs() < 1e-5, "{found} {published}");
        }
        for phase in [0.0, 0.13, 0.5, 0.87] {
            let found = impact_of(law, mass, speed, Box::new(Newmark::trapezoidal()), duration / 200.0, phase);
            for (found, exact) in found.into_iter().zip([exact.duration(), exact.force()]) {
                assert!((found / exact - 1.0).abs() < 1e-4, "phase {phase}: {found} {exact}");
            }
        }
    }
}

#[test]
fn smooth_impacts_keep_the_order_of_the_scheme() {
    let law = ContactLaw::PowerLaw { stiffness: 100.0, exponent: 1.5 };
    let exact = PowerLawImpact { mass: 2.0, stiffness: 100.0, exponent: 1.5, velocity: 1.0 };
    let make: [fn() -> Box<dyn TimeIntegrator>; 5] = [
        || Box::new(Newmark::trapezoidal()),
        || Box::new(Composite),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
        || Box::new(CentralDifference),
        || Box::new(MoreauJean::new(0.5).unwrap()),
    ];
    for make in make {
        // Worst of some phases: the release is between two steps anywhere.
        let error = |steps: f64| {
            let phases = [0.05, 0.3, 0.55, 0.8].map(|phase| {
                let [duration, _] = impact_of(law, 2.0, 1.0, make(), exact.duration() / steps, phase);
                (duration / exact.duration() - 1.0).abs()
            });
            phases.into_iter().fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(50.0), error(400.0));
        let order = (coarse / fine).log2() / 3.0;
        assert!(order > 1.8 && coarse < 0.02, "{}: {order} ({coarse:e} {fine:e})", make().name());
    }
}

#[test]
fn several_power_law_contacts_are_solved_together() {
    // Statics of two masses on Hertz springs, tied by a stiff spring: forces must satisfy the laws and balance the
    // load.
    let laws = [(1e4, 1.5), (3e3, 2.0)];
    let rows = laws.iter().enumerate().fold(LinearRows::new(), |rows, (i, &(stiffness, exponent))| {
        rows.row(ContactLaw::PowerLaw { stiffness, exponent }, &[(i, 1.0)], 0.0)
    });
    // And a third one between the two.
    let rows = rows.row(ContactLaw::PowerLaw { stiffness: 5e3, exponent: 1.5 }, &[(0, 1.0), (1, -1.0)], 0.01);
    let system = chain(&[1.0, 1.0], &[0.0; 2], 500.0).load(|t, f| {
        (f[0], f[1]) = (-120.0 * (t * 4.0).min(1.0), -10.0 * (t * 4.0).min(1.0));
    });
    let mut run = Simulation::builder(system, Newmark::new(0.5, 1.0).unwrap(), 0.01).constraint(rows).build().unwrap();
    run.run_until(30.0, &mut ()).unwrap();
    let (u, forces) = (run.state().displacement().to_vec(), run.state().contacts().forces().to_vec());
    let gaps = [u[0], u[1], u[0] - u[1] + 0.01];
    for ((gap, force), (k, p)) in gaps.iter().zip(&forces).zip([(1e4, 1.5), (3e3, 2.0), (5e3, 1.5)]) {
        let law = k * (-gap).max(0.0_f64).powf(p);
        assert!((force - law).abs() < 1e-9 * (1.0 + law), "{force} {law}");
    }
    assert!((forces[0] + forces[1] - 130.0).abs() < 1e-6, "{forces:?}");
    let iterations = run.statistics().contact_iterations as f64 / run.statistics().steps as f64;
    assert!(iterations < 6.0, "{iterations} a step");
}

#[test]
fn augmentation_closes_the_gap_that_a_penalty_leaves() {
    let weight = |_: f64, f: &mut [f64]| f[0] = -10.0;
    let depth = |law: ContactLaw, until: f64| {
        let mut run =
            Simulation::builder(chain(&[1.0], &[0.0], 0.0).load(weight), Newmark::new(0.5, 1.0).unwrap(), 0.01)
                .constraint(contact(law, 0.0))
                .build()
                .unwrap();
        run.run_until(until, &mut ()).unwrap();
        -run.state().displacement()[0]
    };
    let stiffness = 1e3;
    assert!((depth(ContactLaw::Penalty { stiffness }, 20.0) - 0.01).abs() < 1e-9);
    // Every augmentation leaves the same share 1/(1 + k W) of the penetration of a step, W = β h²/m.
    let share = 1.0 / (1.0 + stiffness * 0.5 * 1e-4);
    let depths = [0, 1, 2, 5, 200]
        .map(|augmentations| depth(ContactLaw::AugmentedLagrangian { stiffness, augmentations }, 0.01));
    for (found, augmentations) in depths.into_iter().zip([0, 1, 2, 5, 200]) {
        assert!((found / (10.0 * 0.5 * 1e-4 * share.powi(augmentations + 1)) - 1.0).abs() < 1e-6, "{depths:?}");
    }
    // At rest the force is the weight: m g = d (share^−(n+1) − 1)/W.
    for (augmentations, power) in [(0, -1), (1, -2), (4, -5)] {
        let left = depth(ContactLaw::AugmentedLagrangian { stiffness, augmentations }, 20.0);
        let exact = 10.0 * 0.5e-4 / (share.powi(power) - 1.0);
        assert!((left / exact - 1.0).abs() < 1e-6, "{augmentations}: {left} {exact}");
    }
}

#[test]
fn a_bipenalty_keeps_the_critical_step_of_the_mesh() {
    // Two masses on a spring, ω_max² = 2 k/m; contact pushes one of them, first at rest on a stiff obstacle.
    let (m, k, h) = (1.0, 100.0, 0.12); // h ω_max = 1.7 < 2
    let stiff = 1e4; // alone: h √(stiff/m) = 12
    let run = |law: ContactLaw| {
        // Small vibrations about the compressed state: contact lasts.
        let system = chain(&[m, m], &[0.0; 2], k).load(|_, f| (f[0], f[1]) = (-100.0, -100.0));
        let rest = [-0.02, -1.02];
        let mut run = Simulation::builder(system, CentralDifference, h)
            .displacement(vec![rest[0] + 1e-3, rest[1] - 1e-3])
            .constraint(contact(law, 0.0))
            .build()
            .unwrap();
        let mut largest = 0.0_f64;
        for _ in 0..400 {
            if run.step().is_err() {
                return f64::INFINITY;
            }
            let u = run.state().displacement();
            largest = u.iter().zip(rest).fold(largest, |m, (u, rest)| m.max((u - rest).abs()));
        }
        largest
    };
    assert!(run(ContactLaw::Penalty { stiffness: stiff }) > 1.0);
    // m_c = k_c (h/2)²: the contact alone is just stable.
    let mass = stiff * h * h / 4.0;
    let bound = run(ContactLaw::Bipenalty { stiffness: stiff, mass });
    assert!(bound < 0.01, "{bound}");
}

#[test]
fn a_bipenalty_in_compression_is_a_spring_and_a_mass() {
    for listed in schemes::all() {
        let law = ContactLaw::Bipenalty { stiffness: 30.0, mass: 2.0 };
        let load = |_: f64, f: &mut [f64]| f.copy_from_slice(&[-40.0, -20.0]);
        let start = vec![-0.5, -0.4];
        let make = |mass: f64, ground: f64| chain(&[mass, 2.0], &[ground, 30.0], 60.0).load(load);
        let mut pressed = Simulation::builder(make(1.0, 20.0), (listed.make)(), 0.05)
            .displacement(start.clone())
            .constraint(contact(law, 0.0))
            // Beside it a plain spring: explicit schemes know its force before that of the other.
            .constraint(contact(ContactLaw::Penalty { stiffness: 10.0 }, 0.0))
            .build()
            .unwrap();
        let mut heavier =
            Simulation::builder(make(3.0, 60.0), (listed.make)(), 0.05).displacement(start).build().unwrap();
        for step in 0..200 {
            pressed.step().unwrap();
            heavier.step().unwrap();
            let (a, b) = (pressed.state().displacement(), heavier.state().displacement());
            let worst = a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(worst < 1e-10, "{}, step {step}: {worst:e}", listed.name());
        }
    }
}

/// Flight times of a ball with restitution e that falls from `height`.
fn bounces(scheme: Box<dyn TimeIntegrator>, e: f64, h: f64, until: f64) -> (Vec<f64>, Simulation<'static, f64>) {
    let law = ContactLaw::Restitution { coefficient: e };
    let system = chain(&[2.0], &[0.0], 0.0).load(|_, f| f[0] = -2.0 * 9.81);
    let mut run = Simulation::builder(system, scheme, h).constraint(contact(law, 1.0)).build().unwrap();
    let mut times = Vec::new();
    let mut falling = true;
    while run.time() < until {
        run.step().unwrap();
        let velocity = run.state().velocity()[0];
        if falling && velocity > 1e-2 {
            times.push(run.time());
        }
        falling = velocity < -1e-2 || falling && velocity < 1e-2;
    }
    (times, run)
}

#[test]
fn a_ball_with_restitution_comes_to_rest_after_infinitely_many_bounces() {
    let (e, g) = (0.8_f64, 9.81);
    let fall = (2.0_f64 / g).sqrt();
    let make: [fn() -> Box<dyn TimeIntegrator>; 3] = [
        || Box::new(MoreauJean::new(0.5).unwrap()),
        || Box::new(MoreauJean::new(1.0).unwrap()),
        || Box::new(CdLagrange),
    ];
    for make in make {
        let (times, run) = bounces(make(), e, 1e-4, 6.0);
        for (k, &time) in times.iter().enumerate().take(12) {
            let exact = fall * (1.0 + 2.0 * (e - e.powf(k as f64 + 1.0)) / (1.0 - e));
            assert!((time - exact).abs() < 0.01, "{}: bounce {k} at {time}, {exact}", make().name());
        }
        let rest = fall * (1.0 + e) / (1.0 - e);
        assert!((times[times.len() - 1] - rest).abs() < 0.05, "{}: {} {rest}", make().name(), times[times.len() - 1]);
        let state = run.state();
        assert!(state.velocity()[0].abs() < 1e-9, "{}", make().name());
        assert!((state.contacts().forces()[0] - 2.0 * g).abs() < 1e-8, "{}", make().name());
        let count = run.statistics();
        assert!(count.contact_iterations <= 2 * count.steps);
    }
}

/// The schemes that impose contact on velocities, but for those that differ in numerical damping alone.
fn velocity_level() -> [Box<dyn TimeIntegrator>; 2] {
    [Box::new(CdLagrange), Box::new(MoreauJean::new(0.5).unwrap())]
}

/// Where rates or increments of gaps are constrained, what rests would rise from rounding to rounding, and fall in the
/// end: it goes down again.
#[test]
fn what_rests_does_not_rise_from_the_floor() {
    type Make = fn() -> Box<dyn TimeIntegrator>;
    let (g, h) = (10.0, 0.01);
    let cases: [(Make, ContactLaw); 4] = [
        (|| Box::new(CdLagrange), ContactLaw::Rigid),
        (|| Box::new(MoreauJean::new(0.5).unwrap()), ContactLaw::Rigid),
        (|| Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()), ContactLaw::RateCondition),
        (|| Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()), ContactLaw::PersistencySwitch),
    ];
    for (make, law) in cases {
        for unit in [1.0, 1e-6, 1e5] {
            let name = format!("{}, {law:?}", make().name());
            // In the fifth step the floor sinks by as much as still counts as touching, and far more than rounding.
            let sunk = 3e-11 * g * h * h * unit;
            let floor = GapOffset::moving(move |t| [if t > 4.5 * h { sunk } else { 0.0 }, 0.0, 0.0]);
            let system = chain(&[2.0], &[0.0], 0.0).load(move |_, f| f[0] = -2.0 * g * unit);
            let mut run = Simulation::builder(system, make(), h)
                .constraint(LinearRows::new().row(law, &[(0, 1.0)], floor))
                .correctors(Vec::new())
                .build()
                .unwrap();
            for step in 0..80 {
                run.step().unwrap();
                let miss = run.state().contacts().forces()[0] / (2.0 * g * unit) - 1.0;
                assert!(miss.abs() < 1e-7, "{name}: force off by {miss:e} in step {step}");
            }
            // (Rates that are held go a little farther.)
            let left = run.state().displacement()[0] / sunk + 1.0;
            assert!((-0.6..1e-3).contains(&left), "{name}: {left:e} of it are left");
        }
    }
}

#[test]
fn restitution_is_relative_to_a_moving_wall() {
    for e in [0.0, 0.3, 1.0] {
        for scheme in velocity_level() {
            // The wall rises with speed 1.5, the ball falls with 2: it leaves with 1.5 + e · 3.5.
            let wall = GapOffset::moving(|t| [1.0 - 1.5 * t, -1.5, 0.0]);
            let law = ContactLaw::Restitution { coefficient: e };
            let mut run = Simulation::builder(chain(&[1.0], &[0.0], 0.0), scheme, 0.01)
                .velocity(vec![-2.0])
                .constraint(LinearRows::new().row(law, &[(0, 1.0)], wall))
                .build()
                .unwrap();
            run.run_until(1.0, &mut ()).unwrap();
            assert!((run.state().velocity()[0] - 1.5 - e * 3.5).abs() < 1e-12, "{e}: {:?}", run.state().velocity());
        }
    }
}

/// N equal balls in a row, the first one flies at the others.
fn cradle(n: usize, gap: f64, scheme: Box<dyn TimeIntegrator>) -> (Vec<f64>, f64) {
    let law = ContactLaw::Restitution { coefficient: 1.0 };
    let rows = (1..n).fold(LinearRows::new(), |rows, i| rows.row(law, &[(i - 1, -1.0), (i, 1.0)], gap));
    let mut v = vec![0.0; n];
    v[0] = 1.0;
    let mut run = Simulation::builder(chain(&vec![1.0; n], &vec![0.0; n], 0.0), scheme, 1e-3)
        .velocity(v)
        .constraint(rows)
        .build()
        .unwrap();
    run.run_until(1.0, &mut ()).unwrap();
    let v = run.state().velocity().to_vec();
    let energy = v.iter().map(|v| v * v).sum();
    (v, energy)
}

#[test]
fn newtons_cradle_follows_the_law_of_simultaneous_impact() {
    for n in [3, 5] {
        // Gaps that take several steps to cross: pairwise impacts, the last ball takes all.
        for scheme in velocity_level() {
            let (v, energy) = cradle(n, 1e-2, scheme);
            assert!((v[n - 1] - 1.0).abs() < 1e-12 && v[..n - 1].iter().all(|v| v.abs() < 1e-12), "{v:?}");
            assert!((energy - 1.0).abs() < 1e-12);
        }
        // Touching, or closer than a step.
        for gap in [0.0, 1e-6] {
            for scheme in velocity_level() {
                let name = scheme.name();
                let (v, energy) = cradle(n, gap, scheme);
                assert!((v.iter().sum::<f64>() - 1.0).abs() < 1e-12, "momentum: {v:?}");
                assert!((energy - 1.0).abs() < 1e-12, "{name}, n = {n}, gap {gap}: {v:?}");
            }
        }
    }
    // All impacts are one, ġ′ = −ġ on the contacts that touch.
    for scheme in velocity_level() {
        let (v, _) = cradle(3, 0.0, scheme);
        for (v, expected) in v.iter().zip([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]) {
            assert!((v - expected).abs() < 1e-12, "{v} {expected}");
        }
    }
}

#[test]
fn schemes_take_the_laws_they_can_serve() {
    let build = |scheme: Box<dyn TimeIntegrator>, law: ContactLaw| {
        Simulation::builder(chain(&[1.0], &[1.0], 0.0), scheme, 0.01).constraint(contact(law, 0.1)).build().map(|_| ())
    };
    let restitution = ContactLaw::Restitution { coefficient: 0.5 };
    let plastic = ContactLaw::Restitution { coefficient: 0.0 };
    let penalty = ContactLaw::Penalty { stiffness: 1.0 };
    for listed in schemes::all() {
        let scheme = listed.make;
        assert!(build(scheme(), penalty).is_ok(), "{}", listed.name());
        assert_eq!(build(scheme(), ContactLaw::Rigid).is_ok(), listed.takes_multipliers(), "{}", listed.name());
        assert_eq!(build(scheme(), plastic).is_ok(), listed.takes_multipliers(), "{}", listed.name());
        // (On velocities by the law, on displacements of the state by the correction.)
        let velocity =
            matches!(scheme().tableau().stages[0].contact, contact_dynamics::tableau::ContactLevel::Velocity { .. });
        let serves = listed.takes_multipliers() && (velocity || listed.takes_corrections());
        let built = build(scheme(), restitution);
        assert_eq!(built.is_ok(), serves, "{}", listed.name());
        if let Err(error) = built {
            assert!(matches!(error, Error::Incompatible { .. }), "{error}");
        }
    }
    let wrong = build(Box::new(Composite), ContactLaw::Penalty { stiffness: -1.0 });
    assert!(matches!(wrong, Err(Error::Parameter { name: "the contact stiffness", .. })));
    let refused = build(Box::new(TchamwaWielgosz::new(1.033).unwrap()), ContactLaw::Rigid).unwrap_err();
    assert!(refused.to_string().contains("compliant"), "{refused}");
}

#[test]
fn corrections_leave_compliant_contacts_alone() {
    let law = ContactLaw::Penalty { stiffness: 200.0 };
    let run = |corrected: bool| {
        let builder = Simulation::builder(chain(&[1.0, 2.0], &[0.0; 2], 50.0), Composite, 0.01)
            .velocity(vec![-1.0; 2])
            .constraint(contact(law, 0.1));
        let builder = if corrected {
            builder.corrector(PersistencyCorrection::with_history_projection())
        } else {
            builder.uncorrected()
        };
        let mut run = builder.build().unwrap();
        run.run_until(1.0, &mut ()).unwrap();
        run.state().displacement().to_vec()
    };
    assert_eq!(run(false), run(true));
}

#[test]
fn a_spring_may_be_compressed_at_the_start() {
    // Released from a compressed penalty: the first quarter of a period, then free flight.
    let (m, k) = (2.0_f64, 50.0_f64);
    let omega = (k / m).sqrt();
    for listed in schemes::all().into_iter().filter(|listed| listed.order == 2) {
        let mut run = Simulation::builder(chain(&[m], &[0.0], 0.0), (listed.make)(), 1e-3)
            .displacement(vec![-0.1])
            .constraint(contact(ContactLaw::Penalty { stiffness: k }, 0.0))
            .build()
            .unwrap();
        assert!((run.state().contacts().forces()[0] - 5.0).abs() < 1e-12);
        assert!((run.state().acceleration()[0] - 2.5).abs() < 1e-12);
        run.run_until(0.2, &mut ()).unwrap();
        let exact = -0.1 * (omega * run.time()).cos();
        assert!((run.state().displacement()[0] - exact).abs() < 1e-5, "{}", listed.name());
        run.run_until(1.0, &mut ()).unwrap();
        assert!((run.state().velocity()[0] - 0.1 * omega).abs() < 2e-3, "{}", listed.name());
    }
}
