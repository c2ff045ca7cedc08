//! Fixed and driven dofs, moving stops and equality rows, with their reactions, against closed forms.

use approx::assert_relative_eq;
use contact_dynamics::contact::GapOffset;
use contact_dynamics::observer::{Control, StepView};
use contact_dynamics::{
    CdLagrange, Composite, Error, GeneralizedAlpha, LinearRows, LinearSystem, Newmark, PersistencyCorrection,
    Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::sparse::{element, matrix};

type Scheme = fn() -> Box<dyn TimeIntegrator>;
const SCHEMES: [Scheme; 2] = [|| Box::new(Composite), || Box::new(Newmark::trapezoidal())];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Lumped,
    Consistent,
}

/// A bar of `n` elements with stiffness k and mass m each.
fn bar(n: usize, k: f64, m: f64, kind: Kind) -> LinearSystem<'static, f64> {
    let assemble = |diagonal: f64, off: f64| matrix(n + 1, (0..n).flat_map(|e| element(e, e + 1, [diagonal, off])));
    let mass = match kind {
        Kind::Lumped => assemble(m / 2.0, 0.0),
        Kind::Consistent => assemble(m / 3.0, m / 6.0),
    };
    LinearSystem::new(mass, assemble(k, -k)).unwrap()
}

/// Steady vibration of a bar whose left end is driven by U sin ωt: u_j = U cos κ(n−j)/cos κn sin ωt solves the
/// semi-discrete equations exactly. Errors of u, v, a and of the driving force at the end of the run.
fn driven_bar_error(scheme: Scheme, kind: Kind, steps: u32) -> [f64; 4] {
    let (n, k, m, amplitude, omega) = (12, 500.0, 0.2, 0.03, 9.0);
    let cosine: f64 = match kind {
        Kind::Lumped => 1.0 - omega * omega * m / (2.0 * k),
        Kind::Consistent => (k - omega * omega * m / 3.0) / (k + omega * omega * m / 6.0),
    };
    let kappa = cosine.acos();
    let shape: Vec<f64> =
        (0..=n).map(|j| amplitude * (kappa * (n - j) as f64).cos() / (kappa * n as f64).cos()).collect();
    let system = bar(n, k, m, kind)
        .drive(0, move |t| {
            let (sin, cos) = (omega * t).sin_cos();
            [amplitude * sin, amplitude * omega * cos, -amplitude * omega * omega * sin]
        })
        .unwrap();
    let end = 1.1;
    let mut run = Simulation::builder(system, scheme(), end / f64::from(steps))
        .velocity(shape.iter().map(|s| s * omega).collect())
        .build()
        .unwrap();
    run.run_until(end, &mut ()).unwrap();
    let (sin, cos) = (omega * end).sin_cos();
    let error = |found: &[f64], factor: f64| {
        found.iter().zip(&shape).fold(0.0_f64, |worst, (x, s)| worst.max((x - s * factor).abs()))
    };
    let state = run.state();
    let errors = [
        error(state.displacement(), sin),
        error(state.velocity(), omega * cos),
        error(state.acceleration(), -omega * omega * sin),
    ];
    let inertia = match kind {
        Kind::Lumped => m / 2.0 * shape[0],
        Kind::Consistent => m / 6.0 * (2.0 * shape[0] + shape[1]),
    };
    let force = (-omega * omega * inertia + k * (shape[0] - shape[1])) * sin;
    let reaction = run.reactions().unwrap()[0];
    [errors[0], errors[1], errors[2], (reaction - force).abs()]
}

/// A mass that touches a driven one which sets out as c t³: where contact is imposed on velocities half a step ahead,
/// at ¾ c h², the start has the force that gives the mass this velocity by then.
#[test]
fn driven_dofs_press_at_the_start_as_they_will_half_a_step_ahead() {
    let (c, h, mass) = (2.0, 0.05, 1.7);
    let none = matrix(2, [(0, 0, 0.0), (1, 1, 0.0)]);
    let system = LinearSystem::lumped(vec![1.0, mass], none).unwrap();
    let system = system.drive(0, move |t| [c * t * t * t, 3.0 * c * t * t, 6.0 * c * t]).unwrap();
    let run = Simulation::builder(system, CdLagrange, h)
        .constraint(LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.0))
        .build()
        .unwrap();
    let expected = 0.75 * c * h * h / (0.5 * h);
    assert!((run.state().acceleration()[1] / expected - 1.0).abs() < 1e-12, "{:?}", run.state());
    assert!((run.state().contacts().forces()[0] / (mass * expected) - 1.0).abs() < 1e-12);
}

#[test]
fn base_excited_bar_converges_to_the_closed_form_with_its_reaction() {
    let schemes: [Scheme; 3] = [
        || Box::new(Composite),
        || Box::new(Newmark::trapezoidal()),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.9).unwrap()),
    ];
    for scheme in schemes {
        for kind in [Kind::Lumped, Kind::Consistent] {
            let (coarse, fine) = (driven_bar_error(scheme, kind, 1000), driven_bar_error(scheme, kind, 2000));
            let orders: Vec<f64> = coarse.iter().zip(&fine).map(|(c, f)| (c / f).log2()).collect();
            assert!(orders.iter().all(|o| (o - 2.0).abs() < 0.1), "{}, {kind:?}: {orders:?}", scheme().name());
            assert!(fine[0] < 2e-4, "{}, {kind:?}: {fine:?}", scheme().name());
        }
    }
}

#[test]
fn bar_between_support_and_stop_rests_with_the_static_forces() {
    // Length 1, EA = 40, load b = 3 a length: tip b/(2EA) = 0.0375 if free, stop at 0.02.
    let (n, stiffness, load, gap) = (10, 40.0, 3.0, 0.02);
    let size = 1.0 / n as f64;
    let stop = (load / (2.0 * stiffness) - gap) * stiffness;
    let static_u: Vec<f64> =
        (0..=n).map(|i| i as f64 * size).map(|x| (load * (x - 0.5 * x * x) - stop * x) / stiffness).collect();
    for scheme in SCHEMES {
        for kind in [Kind::Lumped, Kind::Consistent] {
            let system = bar(n, stiffness / size, 0.7 * size, kind).fix(0).unwrap().load(move |_, f| {
                for (i, f) in f.iter_mut().enumerate() {
                    *f = load * size * if i == 0 || i == n { 0.5 } else { 1.0 };
                }
            });
            let mut run = Simulation::builder(system, scheme(), 1e-3)
                .displacement(static_u.clone())
                .constraint(LinearRows::new().unilateral(&[(n, -1.0)], gap))
                .corrector(PersistencyCorrection::with_history_projection())
                .build()
                .unwrap();
            assert_relative_eq!(run.state().contacts().forces()[0], stop, max_relative = 1e-11);
            assert_relative_eq!(run.state().contacts().raw_forces()[0], stop, max_relative = 1e-11);
            assert!(run.state().contacts().closed()[0]);
            run.run_until(2.0, &mut ()).unwrap();
            assert_relative_eq!(run.state().contacts().forces()[0], stop, max_relative = 1e-9);
            // The support carries the rest of the load.
            assert_relative_eq!(run.reactions().unwrap()[0], -(load - stop), max_relative = 1e-9);
            assert_relative_eq!(run.state().displacement()[5], static_u[5], max_relative = 1e-10);
            assert!(run.state().contacts().closed()[0]);
            assert_eq!(run.statistics().contact_changes, 0);
        }
    }
}

#[test]
fn bar_pushed_against_a_stop_shows_the_staircase_of_forces() {
    // The left end starts with velocity V: (2j + 1) ZV at the drive in [2jT, 2(j+1)T], 2j ZV at the stop in [(2j−1)T,
    // (2j+1)T].
    let (n, velocity) = (100, 0.02);
    let (k, m) = (100.0 * n as f64, 1.0 / n as f64); // EA = 100, ρA = 1, L = 1: c = 10, Z = 10
    let (travel, force) = (0.1, 10.0 * velocity);
    for scheme in SCHEMES {
        let system = bar(n, k, m, Kind::Lumped).drive(0, move |t| [velocity * t, velocity, 0.0]).unwrap();
        let h = travel / 200.0;
        let mut run = Simulation::builder(system, scheme(), h)
            .constraint(LinearRows::new().unilateral(&[(n, -1.0)], 0.0))
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let (mut drive, mut stop) = (vec![0.0; 4], vec![0.0; 4]);
        for step in 1..=1600 {
            run.step().unwrap();
            let (interval, shifted) = ((step - 1) / 400, (step + 199) / 400);
            drive[interval] += run.reactions().unwrap()[0] / 400.0;
            if shifted < 4 {
                stop[shifted] += run.state().contacts().impulses()[0] / (400.0 * h);
            }
        }
        for j in 0..4 {
            let expected = (2 * j + 1) as f64 * force;
            // The jump of the driven velocity at t = 0 meets the half mass of the first node: an impulse that no force
            // shows.
            let node = if j == 0 { 0.5 * m * velocity / (400.0 * h) } else { 0.0 };
            assert!((drive[j] + node - expected).abs() < 0.03 * expected, "{}: drive {drive:?}", scheme().name());
        }
        for j in 1..4 {
            let expected = (2 * j) as f64 * force;
            assert!((stop[j] - expected).abs() < 0.02 * expected, "{}: stop {stop:?}", scheme().name());
        }
    }
}

#[test]
fn moving_stop_carries_the_mass_with_its_own_velocity_and_acceleration() {
    // u = s(t) = 0.1 + 0.02 (1 − cos 5t) while pressed: p' = m s̈ + k s, exactly, at every step.
    let (mass, stiffness) = (2.0, 800.0);
    let path = |t: f64| {
        let (sin, cos) = (5.0 * t).sin_cos();
        [0.1 + 0.02 * (1.0 - cos), 0.1 * sin, 0.5 * cos]
    };
    for scheme in SCHEMES {
        let k = matrix(1, [(0, 0, stiffness)]);
        let offset = GapOffset::moving(move |t| path(t).map(|x| -x));
        let mut run = Simulation::builder(LinearSystem::lumped(vec![mass], k).unwrap(), scheme(), 0.01)
            .displacement(vec![0.1])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], offset))
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let mut check = |step: &StepView<'_, f64>| {
            let [s, velocity, acceleration] = path(step.state.time());
            assert_relative_eq!(step.state.displacement()[0], s, max_relative = 1e-12);
            assert_relative_eq!(step.state.velocity()[0], velocity, epsilon = 1e-11);
            assert_relative_eq!(step.state.acceleration()[0], acceleration, epsilon = 1e-9);
            let force = mass * acceleration + stiffness * s;
            assert_relative_eq!(step.state.contacts().forces()[0], force, max_relative = 1e-10);
            Control::Continue
        };
        run.run_until(3.0, &mut check).unwrap();
    }
}

#[test]
fn equality_row_is_a_support_by_multiplier() {
    for scheme in SCHEMES {
        let n = 8;
        let velocity: Vec<f64> = (0..=n).map(|i| i as f64 * 0.1).collect();
        let mut fixed = Simulation::builder(bar(n, 300.0, 0.4, Kind::Lumped).fix(0).unwrap(), scheme(), 2e-3)
            .velocity(velocity.clone())
            .build()
            .unwrap();
        let mut tied = Simulation::builder(bar(n, 300.0, 0.4, Kind::Lumped), scheme(), 2e-3)
            .velocity(velocity)
            .constraint(LinearRows::new().equality(&[(0, 1.0)], 0.0))
            .build()
            .unwrap();
        for _ in 0..500 {
            fixed.step().unwrap();
            tied.step().unwrap();
        }
        for (x, y) in fixed.state().displacement().iter().zip(tied.state().displacement()) {
            assert_relative_eq!(x, y, epsilon = 1e-10);
        }
        let reaction = fixed.reactions().unwrap()[0];
        assert_relative_eq!(reaction, tied.state().contacts().forces()[0], max_relative = 1e-8);
    }
}

#[test]
fn a_driven_dof_is_a_moving_obstacle() {
    // A bar flies against a heavy slide that is driven toward it; once as a dof of the system, once as a moving gap.
    let (n, k, m) = (8, 300.0, 0.4);
    let path = |t: f64| [0.3 - 0.4 * t + 0.1 * t * t, -0.4 + 0.2 * t, 0.2];
    for scheme in SCHEMES {
        for kind in [Kind::Lumped, Kind::Consistent] {
            // The slide is one element away from nothing: dofs n + 1 and n + 2 belong to it, n + 1 is driven.
            let with_slide = |diagonal: f64, off: f64, slide: [f64; 2]| {
                let bar = (0..n).flat_map(|e| element(e, e + 1, [diagonal, off]));
                matrix(n + 3, bar.chain(element(n + 1, n + 2, slide)))
            };
            let mass = match kind {
                Kind::Lumped => with_slide(m / 2.0, 0.0, [5.0, 0.0]),
                Kind::Consistent => with_slide(m / 3.0, m / 6.0, [5.0, 2.0]),
            };
            let system = LinearSystem::new(mass, with_slide(k, -k, [70.0, -70.0])).unwrap().drive(n + 1, path).unwrap();
            let mut velocity = vec![0.5; n + 3];
            (velocity[n + 1], velocity[n + 2]) = (-0.4, -0.4);
            let mut as_dof = Simulation::builder(system, scheme(), 2e-3)
                .velocity(velocity)
                .constraint(LinearRows::new().unilateral(&[(n, -1.0), (n + 1, 1.0)], 0.0))
                .corrector(PersistencyCorrection::with_history_projection())
                .build()
                .unwrap();
            let mut as_gap = Simulation::builder(bar(n, k, m, kind), scheme(), 2e-3)
                .velocity(vec![0.5; n + 1])
                .constraint(LinearRows::new().unilateral(&[(n, -1.0)], GapOffset::moving(path)))
                .corrector(PersistencyCorrection::with_history_projection())
                .build()
                .unwrap();
            for step in 0..500 {
                as_dof.step().unwrap();
                as_gap.step().unwrap();
                let t = as_dof.time();
                assert_relative_eq!(as_dof.state().displacement()[n + 1], path(t)[0], max_relative = 1e-13);
                for (x, y) in as_dof.state().displacement()[..=n].iter().zip(as_gap.state().displacement()) {
                    assert_relative_eq!(x, y, epsilon = 1e-9);
                }
                let (x, y) = (as_dof.state().contacts().forces()[0], as_gap.state().contacts().forces()[0]);
                assert!((x - y).abs() < 1e-6 * (1.0 + y.abs()), "{}, {kind:?}, step {step}: {x} {y}", scheme().name());
                // What drives the slide moves its mass, strains it, and holds against the contact.
                let (state, off) = (as_dof.state(), if kind == Kind::Lumped { 0.0 } else { 2.0 });
                let (u, a) = (&state.displacement()[n + 1..], &state.acceleration()[n + 1..]);
                let expected = 5.0 * a[0] + off * a[1] + 70.0 * (u[0] - u[1]) - x;
                let found: f64 = as_dof.reactions().unwrap()[0];
                assert!((found - expected).abs() < 1e-9 * (1.0 + x.abs()), "{kind:?}, {step}: {found} {expected}");
            }
            assert!(as_gap.statistics().contact_solves > 5, "the impact is part of the run");
        }
    }
}

/// A motion that is no number is refused at the start, whichever part of it is none.
#[test]
fn supports_that_start_nowhere_are_refused() {
    for part in 0..3 {
        for bad in [f64::NAN, f64::INFINITY] {
            let motion = move |_: f64| std::array::from_fn(|i| if i == part { bad } else { 0.0 });
            let system = bar(2, 10.0, 1.0, Kind::Lumped).drive(1, motion).unwrap();
            let refused = Simulation::builder(system, Newmark::trapezoidal(), 0.1).build().unwrap_err();
            assert!(matches!(refused, Error::SupportNotFinite { t: 0.0, dof: 1, .. }), "{part}: {refused}");
        }
    }
}

/// A support that accelerates from the start pulls by the mass that it shares with its neighbor.
#[test]
fn the_acceleration_of_a_support_is_felt_at_the_start() {
    let (m, acceleration) = (3.0, 7.0);
    for (kind, shared) in [(Kind::Lumped, 0.0), (Kind::Consistent, m / 6.0)] {
        let own = if kind == Kind::Lumped { m / 2.0 } else { m / 3.0 };
        let system = bar(1, 5.0, m, kind)
            .drive(0, move |t| [0.5 * acceleration * t * t, acceleration * t, acceleration])
            .unwrap();
        let run = Simulation::builder(system, Newmark::trapezoidal(), 1e-3).build().unwrap();
        let a = run.state().acceleration();
        assert_relative_eq!(a[0], acceleration);
        assert_relative_eq!(a[1], -shared / own * acceleration);
    }
}
