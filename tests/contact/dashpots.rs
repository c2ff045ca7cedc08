//! Contact laws with dashpots: against springs and dashpots of the system, closed forms of impacts, and the energy.

use contact_dynamics::contact::{ContactLaw, GapOffset};
use contact_dynamics::{Error, LinearRows, LinearSystem, Newmark, Simulation};
use contact_dynamics_scenes::schemes::{self, Listed};
use contact_dynamics_scenes::sparse::{matrix, springs};

/// Free masses on springs to the ground and to their neighbors.
fn chain(mass: &[f64], ground: &[f64], between: f64) -> LinearSystem<'static, f64> {
    let n = mass.len();
    let ground = ground.iter().enumerate().map(|(i, &k)| (i, i, k));
    LinearSystem::lumped(mass.to_vec(), matrix(n, ground.chain(springs(n, between)))).unwrap()
}

/// Lasting contact is a spring of K and a dashpot of C, for every scheme.
#[test]
fn a_dashpot_in_compression_is_one_of_the_system() {
    let (mass, h) = ([1.0, 2.0, 1.5], 0.02);
    let load = |t: f64, f: &mut [f64]| f.copy_from_slice(&[-40.0 - 10.0 * (3.0 * t).sin(), -20.0, -10.0]);
    let start = vec![-0.5, -0.4, -0.45];
    let law = ContactLaw::KelvinVoigt { stiffness: 30.0, damping: 4.0 };
    for listed in schemes::all() {
        let name = listed.name();
        let system = chain(&mass, &[20.0, 30.0, 10.0], 60.0).load(load);
        let mut pressed = Simulation::builder(system, (listed.make)(), h)
            .displacement(start.clone())
            .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.0))
            .build()
            .unwrap();
        let damping = matrix(3, [(0, 0, 4.0), (1, 1, 0.0), (2, 2, 0.0)]);
        let system = chain(&mass, &[50.0, 30.0, 10.0], 60.0).damping(damping).unwrap().load(load);
        // (Some explicit schemes refuse damping of the system altogether.)
        let Ok(mut alone) = Simulation::builder(system, (listed.make)(), h).displacement(start.clone()).build() else {
            continue;
        };
        for step in 0..200 {
            pressed.step().unwrap_or_else(|error| panic!("{name}: {error}"));
            alone.step().unwrap();
            assert!(pressed.state().contacts().closed()[0], "{name}: open in step {step}");
            for (a, b) in pressed.state().displacement().iter().zip(alone.state().displacement()) {
                assert!((a - b).abs() < 1e-11, "{name}, step {step}: {a} {b}");
            }
            for (a, b) in pressed.state().acceleration().iter().zip(alone.state().acceleration()) {
                assert!((a - b).abs() < 1e-7, "{name}, step {step}: {a} {b}");
            }
        }
    }
}

/// The speed with which a mass of 1 leaves that comes with 5, and the run.
fn rebound(law: ContactLaw, listed: &Listed, h: f64, phase: f64) -> (f64, Simulation<'static, f64>) {
    let mut run = Simulation::builder(chain(&[1.0], &[0.0], 0.0), (listed.make)(), h)
        .velocity(vec![-5.0])
        .constraint(LinearRows::new().row(law, &[(0, 1.0)], (6.0 + phase) * h * 5.0))
        .energy_balance()
        .build()
        .unwrap();
    let name = listed.name();
    while run.time() < 0.6 + 8.0 * h {
        run.step().unwrap_or_else(|error| panic!("{name}: {error}"));
        let force = run.state().contacts().forces()[0];
        assert!(force >= 0.0, "{name}: {force}");
    }
    assert!(!run.state().contacts().closed()[0], "{name}");
    (run.state().velocity()[0], run)
}

/// Mean and largest error over phases of the instant at which bodies touch.
fn errors(law: ContactLaw, listed: &Listed, h: f64, exact: f64) -> [f64; 2] {
    let phases = [0.04, 0.24, 0.44, 0.64, 0.84, 0.9995];
    let errors = phases.map(|phase| rebound(law, listed, h, phase).0 / exact - 1.0);
    [errors.iter().sum::<f64>() / errors.len() as f64, errors.iter().fold(0.0, |most, e| most.max(e.abs()))]
}

#[test]
fn an_impact_on_spring_and_dashpot_leaves_by_the_closed_form() {
    let law = ContactLaw::KelvinVoigt { stiffness: 100.0, damping: 5.0 };
    // 1 kg at 5: ξ = 1/4, and k δ + c δ̇ = 0 where ω_d t = acos(2 ξ² − 1).
    let xi = 0.25_f64;
    let exact = 5.0 * (-xi / (1.0 - xi * xi).sqrt() * (2.0 * xi * xi - 1.0).acos()).exp();
    assert!((exact - 2.531_382_762_6).abs() < 1e-9);
    for listed in schemes::all() {
        let (coarse, fine) = (errors(law, &listed, 4e-3, exact), errors(law, &listed, 5e-4, exact));
        // The force jumps within a step: order 1.
        let order = (coarse[1] / fine[1]).log2() / 3.0;
        let most = if listed.order == 2 { 2.5e-3 } else { 1e-2 };
        assert!(fine[1] < most && order > 0.8, "{}: {order} {coarse:?} {fine:?}", listed.name());
    }
}

#[test]
fn an_impact_by_hunt_and_crossley_leaves_by_its_quadrature() {
    // ∫ v dv/(1 + χ v) over the contact is zero: v − ln(1 + χ v)/χ is that of −w.
    let chi = 0.1_f64;
    let side = |v: f64| v - (chi * v).ln_1p() / chi;
    let (mut low, mut high) = (0.0, 5.0);
    for _ in 0..60 {
        let w = 0.5 * (low + high);
        if side(-w) < side(5.0) { low = w } else { high = w }
    }
    for (stiffness, exponent) in [(100.0, 1.0), (400.0, 1.5)] {
        let law = ContactLaw::HuntCrossley { stiffness, exponent, dissipation: chi };
        for listed in schemes::all() {
            let (coarse, fine) = (errors(law, &listed, 4e-3, low)[1], errors(law, &listed, 5e-4, low)[1]);
            let order = (coarse / fine).log2() / 3.0;
            let least = f64::from(listed.order) - 0.3;
            assert!(fine < 2e-2 && (order > least || fine < 1e-6), "{}: {order} {coarse:e} {fine:e}", listed.name());
        }
    }
}

/// What a contact has taken is the dashpot's, what it has stored is the spring's, at every instant.
#[test]
fn dashpots_take_the_energy_and_springs_keep_theirs() {
    let laws = [
        ContactLaw::KelvinVoigt { stiffness: 100.0, damping: 5.0 },
        ContactLaw::HuntCrossley { stiffness: 400.0, exponent: 1.5, dissipation: 0.1 },
    ];
    for law in laws {
        for phase in [0.0, 0.3, 0.7] {
            let mut run = Simulation::builder(chain(&[1.0], &[0.0], 0.0), Newmark::trapezoidal(), 2e-3)
                .velocity(vec![-5.0])
                .constraint(LinearRows::new().row(law, &[(0, 1.0)], (3.0 + phase) * 0.01))
                .energy_balance()
                .build()
                .unwrap();
            while run.time() < 0.6 {
                run.step().unwrap();
                let depth = (-run.gaps()[0]).max(0.0);
                let stored = match law {
                    ContactLaw::KelvinVoigt { stiffness, .. } => 0.5 * stiffness * depth * depth,
                    _ => 400.0 / 2.5 * depth.powf(2.5),
                };
                let works = run.energy().works.unwrap();
                assert!((works.contact + stored).abs() < 1e-12, "{works:?} {stored}");
                assert!(works.damping < 1e-12 && works.remainder.abs() < 1e-11, "{works:?}");
            }
            let v = run.state().velocity()[0];
            let works = run.energy().works.unwrap();
            assert!((works.damping - 0.5 * (v * v - 25.0)).abs() < 1e-11 && v > 2.0, "{works:?} {v}");
        }
    }
}

/// Beside rigid rows, on walls that move: forces obey the laws, and a dashpot that begins to press never pulls bodies
/// out of touch again.
#[test]
fn dashpots_beside_rigid_rows_obey_their_laws() {
    let wall = || GapOffset::moving(|t| [0.1 - 0.5 * (4.0 * t).sin(), -2.0 * (4.0 * t).cos(), 8.0 * (4.0 * t).sin()]);
    let law = ContactLaw::KelvinVoigt { stiffness: 200.0, damping: 30.0 };
    let crossley = ContactLaw::HuntCrossley { stiffness: 900.0, exponent: 1.5, dissipation: 0.4 };
    let rows = LinearRows::new().row(law, &[(0, 1.0)], wall()).row(crossley, &[(0, -1.0), (1, 1.0)], 0.05).row(
        ContactLaw::Rigid,
        &[(1, -1.0), (2, 1.0)],
        0.02,
    );
    let system = chain(&[1.0, 0.5, 2.0], &[1.0; 3], 3.0).load(|_, f| f.fill(-9.0));
    let h = 0.01;
    let mut run =
        Simulation::builder(system, Newmark::trapezoidal(), h).constraint(rows).uncorrected().build().unwrap();
    let mut pressed = [0; 3];
    for _ in 0..1500 {
        run.step().unwrap();
        let (u, v, t) = (run.state().displacement(), run.state().velocity(), run.time());
        let forces = run.state().contacts().forces();
        let gaps = [u[0] + 0.1 - 0.5 * (4.0 * t).sin(), u[1] - u[0] + 0.05, u[2] - u[1] + 0.02];
        let rates = [v[0] - 2.0 * (4.0 * t).cos(), v[1] - v[0]];
        for i in 0..3 {
            pressed[i] += usize::from(forces[i] > 0.0);
        }
        // (A dashpot that begins within the last bit of a step takes any force up to c δ̇, and the gap is zero.)
        let spring = if gaps[0] < 0.0 { (-200.0 * gaps[0] - 30.0 * rates[0]).max(0.0) } else { 0.0 };
        let begins = gaps[0].abs() < 1e-13 && (0.0..-30.0 * rates[0]).contains(&forces[0]);
        assert!(begins || (forces[0] - spring).abs() < 1e-9 * (1.0 + spring), "{} {spring}", forces[0]);
        let crossed = 900.0 * (-gaps[1]).max(0.0).powf(1.5) * (1.0 - 0.4 * rates[1]).max(0.0);
        assert!((forces[1] - crossed).abs() < 1e-9 * (1.0 + crossed), "{} {crossed}", forces[1]);
        assert!(gaps[2] > -1e-12 && forces[2] >= 0.0 && gaps[2] * forces[2] < 1e-9);
    }
    assert!(pressed.iter().all(|&n| n > 40), "{pressed:?}");
}

/// A step that would end inside by less than c δ̇ pushes back: the dashpot takes what it needs to hold the gap at zero.
#[test]
fn a_dashpot_begins_to_press_with_a_part_of_its_force() {
    let (h, law) = (0.01, ContactLaw::KelvinVoigt { stiffness: 100.0, damping: 8.0 });
    // W = h²/4, so inside by up to 8 (5 h²/4) = 1e-3.
    for (inside, holds) in [(2e-4, true), (8e-4, true), (1.5e-3, false)] {
        let mut run = Simulation::builder(chain(&[1.0], &[0.0], 0.0), Newmark::trapezoidal(), h)
            .velocity(vec![-5.0])
            .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.05 - inside))
            .build()
            .unwrap();
        run.step().unwrap();
        let (gap, v) = (run.gaps()[0], run.state().velocity()[0]);
        let force = run.state().contacts().forces()[0];
        assert_eq!(gap.abs() < 1e-15, holds, "{inside}: {gap}");
        match holds {
            true => assert!((force - 4.0 * inside / (h * h)).abs() < 1e-9 && force < -8.0 * v, "{force} {v}"),
            false => assert!((force + 100.0 * gap + 8.0 * v).abs() < 1e-10, "{force} {gap} {v}"),
        }
    }
}

/// Explicit schemes take dashpots up to a limit of c h/m, beyond which a step that presses is refused; those whose
/// velocities contain the unknown solve for the dashpot, and take any.
#[test]
fn explicit_steps_are_limited_by_dashpots() {
    for listed in schemes::all().into_iter().filter(|listed| listed.critical.is_some()) {
        let tableau = (listed.make)().tableau();
        let solves = tableau.stages.iter().all(|stage| stage.balance.v.z > 0.0);
        let run = |damping: f64| {
            let law = ContactLaw::KelvinVoigt { stiffness: 1.0, damping };
            let mut run =
                Simulation::builder(chain(&[1.0], &[0.0], 0.0).load(|_, f| f[0] = -1.0), (listed.make)(), 0.01)
                    .velocity(vec![-1.0])
                    .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.02))
                    .build()
                    .unwrap();
            let mut deepest = 0.0_f64;
            for _ in 0..1000 {
                run.step()?;
                deepest = deepest.max(-run.gaps()[0]);
            }
            Ok::<_, Error>((run.state().velocity()[0], deepest))
        };
        // c h/m of a tenth: it creeps in by v = (f − k δ)/c.
        let (v, deepest) = run(10.0).unwrap();
        assert!(v < 0.0 && v > -0.1 && deepest < 1.0, "{}: {v} {deepest}", listed.name());
        let strong = run(1e5);
        assert_eq!(strong.is_ok(), solves, "{}: {strong:?}", listed.name());
        if let Err(error) = strong {
            assert!(matches!(error, Error::Stiffened { .. }), "{}: {error}", listed.name());
        }
        // What is accepted is stable: nothing is thrown off. (Beyond c h/m = 1 a step turns the velocity round.)
        for share in 1..40 {
            if let Ok((v, deepest)) = run(10.0 * f64::from(share)) {
                assert!(v.abs() < 1.02 && deepest < 1.0, "{}, {share}: {v} {deepest}", listed.name());
            }
        }
    }
}

#[test]
fn static_balance_of_explicit_stages_refuses_dashpots() {
    let law = ContactLaw::KelvinVoigt { stiffness: 10.0, damping: 1.0 };
    let mut built = Simulation::builder(chain(&[0.0, 1.0], &[0.0; 2], 50.0), contact_dynamics::CentralDifference, 0.01)
        .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.1))
        .build();
    let refused = match &mut built {
        Ok(run) => run.step().unwrap_err(),
        Err(_) => built.unwrap_err(),
    };
    assert!(matches!(refused, Error::Incompatible { .. }), "{refused}");
}
