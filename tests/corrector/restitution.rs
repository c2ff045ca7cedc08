//! Restitution where contact is imposed on displacements: contacts that close leave with e times their approach.

use contact_dynamics::contact::ContactLaw;
use contact_dynamics::corrector::Parts;
use contact_dynamics::{
    CentralDifference, Composite, Error, Gssss, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Simulation,
    TimeIntegrator,
};
use contact_dynamics_scenes::schemes::{self, Listed};
use contact_dynamics_scenes::sparse::{matrix, springs};

fn free(mass: &[f64]) -> LinearSystem<'static, f64> {
    let n = mass.len();
    LinearSystem::lumped(mass.to_vec(), matrix(n, (0..n).map(|i| (i, i, 0.0)))).unwrap()
}

fn restitution(coefficient: f64) -> ContactLaw {
    ContactLaw::Restitution { coefficient }
}

/// Schemes that impose contact on the displacements of the state.
fn served() -> impl Iterator<Item = Listed> {
    schemes::all().into_iter().filter(|listed| listed.takes_corrections() && listed.takes_multipliers())
}

fn ball(e: f64, listed: &Listed, h: f64, height: f64) -> Simulation<'static, f64> {
    Simulation::builder(free(&[2.0]).load(|_, f| f[0] = -2.0 * 9.81), (listed.make)(), h)
        .constraint(LinearRows::new().row(restitution(e), &[(0, 1.0)], height))
        .build()
        .unwrap()
}

/// The energy of flight over that at the start: the apex.
fn apex(run: &Simulation<'_, f64>, height: f64) -> f64 {
    let state = run.state();
    (0.5 * state.velocity()[0].powi(2) + 9.81 * (state.displacement()[0] + height)) / (9.81 * height)
}

#[test]
fn an_elastic_ball_keeps_its_apex() {
    for listed in served() {
        for phase in [0.0, 0.13, 0.41, 0.77] {
            let height = 1.0 + 0.1 * phase;
            let mut run = ball(1.0, &listed, 0.02, height);
            let (mut bounces, mut falls) = (0, true);
            while bounces < 100 {
                run.step().unwrap_or_else(|error| panic!("{}: {error}", listed.name()));
                let rises = run.state().velocity()[0] > 0.0;
                bounces += usize::from(rises && falls);
                falls = !rises;
                let miss = apex(&run, height) - 1.0;
                assert!(miss.abs() < 1e-9 * bounces.max(1) as f64, "{}, {bounces}: {miss:e}", listed.name());
                assert!(run.time() < 120.0, "{}: {bounces} bounces", listed.name());
            }
        }
    }
}

#[test]
fn each_bounce_keeps_the_share_e_and_the_ball_comes_to_rest() {
    for listed in served() {
        for e in [0.3, 0.7] {
            for phase in [0.0, 0.3, 0.8] {
                let height = 1.0 + 0.1 * phase;
                let (mut run, name) = (ball(e, &listed, 5e-3, height), listed.name());
                let (mut before, mut bounces) = (1.0, 0);
                while run.time() < 8.0 {
                    run.step().unwrap();
                    let now = apex(&run, height);
                    if (now - before).abs() > 1e-9 {
                        // (The last one may end at rest, where a ball would be back within two steps.)
                        let rests = now.abs() < 1e-9;
                        assert!(rests || (now / before - e * e).abs() < 1e-8, "{name}: {before} {now}");
                        (before, bounces) = (now, bounces + 1);
                    }
                }
                let force = run.state().contacts().forces()[0];
                assert!(bounces > 2 && before.abs() < 1e-9, "{name}: {before} after {bounces}");
                assert!((force / 19.62 - 1.0).abs() < 1e-6, "{name}: {force}");
                assert!(run.state().velocity()[0].abs() < 1e-8, "{name}");
            }
        }
    }
}

/// Momentum that contact gives is that of its impulses, as the scheme counts both.
#[test]
fn impulses_are_the_change_of_momentum() {
    for listed in served() {
        for (e, phase) in [(1.0, 0.0), (0.6, 0.3), (1.0, 0.8)] {
            let mut run = Simulation::builder(free(&[2.0]), (listed.make)(), 0.01)
                .velocity(vec![-3.0])
                .constraint(LinearRows::new().row(restitution(e), &[(0, 1.0)], (6.0 + phase) * 0.03))
                .build()
                .unwrap();
            let mut impulse = 0.0;
            for _ in 0..20 {
                run.step().unwrap();
                impulse += run.state().contacts().impulses()[0];
            }
            let v = run.state().velocity()[0];
            assert!((v - 3.0 * e).abs() < 1e-12, "{}: {v}", listed.name());
            assert!((impulse - 6.0 * (1.0 + e)).abs() < 1e-11, "{}: {impulse}", listed.name());
            assert!(!run.state().contacts().closed()[0]);
        }
    }
}

/// Equal balls in a row, the first one flies at the others.
fn cradle(n: usize, gap: f64, e: &[f64], listed: &Listed) -> Vec<f64> {
    let rows =
        (1..n).fold(LinearRows::new(), |rows, i| rows.row(restitution(e[i - 1]), &[(i - 1, -1.0), (i, 1.0)], gap));
    let mut v = vec![0.0; n];
    v[0] = 1.0;
    let mut run =
        Simulation::builder(free(&vec![1.0; n]), (listed.make)(), 1e-3).velocity(v).constraint(rows).build().unwrap();
    run.run_until(0.2, &mut ()).unwrap();
    let v = run.state().velocity().to_vec();
    assert!((v.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{}: {v:?}", listed.name());
    v
}

#[test]
fn newtons_cradle() {
    for listed in served() {
        let name = listed.name();
        for n in [3, 5] {
            // Gaps that take several steps to cross: pairwise impacts, the last ball takes all.
            let v = cradle(n, 1e-2, &vec![1.0; n - 1], &listed);
            let first = v[..n - 1].iter().all(|v| v.abs() < 1e-11);
            assert!(first && (v[n - 1] - 1.0).abs() < 1e-11, "{name}: {v:?}");
            // Touching, or closer than a step: one impact.
            for gap in [0.0, 1e-6] {
                let v = cradle(n, gap, &vec![1.0; n - 1], &listed);
                let energy: f64 = v.iter().map(|v| v * v).sum();
                assert!((energy - 1.0).abs() < 1e-11, "{name}, gap {gap}: {v:?}");
            }
        }
        let v = cradle(3, 0.0, &[1.0; 2], &listed);
        for (v, expected) in v.iter().zip([-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]) {
            assert!((v - expected).abs() < 1e-11, "{name}: {v} {expected}");
        }
        // Different coefficients add no energy.
        for e in [[1.0, 0.0], [0.0, 1.0], [0.3, 0.9]] {
            for gap in [0.0, 1e-6, 1e-2] {
                let energy: f64 = cradle(3, gap, &e, &listed).iter().map(|v| v * v).sum();
                assert!(energy < 1.0 + 1e-11, "{name}, {e:?}: {energy}");
            }
        }
    }
}

/// Bodies that are no points: the energy of two masses on a spring that meet a floor under weight errs with h².
#[test]
fn an_elastic_impact_of_a_body_keeps_its_energy_to_second_order() {
    let make: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(Newmark::trapezoidal()), || Box::new(Gssss::new(1.0, 1.0, 0.0).unwrap())];
    for make in make {
        let error = |h: f64| {
            let phases = [0.1, 0.35, 0.6, 0.85].map(|phase| {
                let ground = [(0, 0, 0.0), (1, 1, 0.0)].into_iter();
                let system = LinearSystem::lumped(vec![1.0, 2.0], matrix(2, ground.chain(springs(2, 50.0)))).unwrap();
                let mut run = Simulation::builder(system.load(|_, f| (f[0], f[1]) = (-10.0, -20.0)), make(), h)
                    .displacement(vec![0.0, 0.1])
                    .velocity(vec![-1.0 - phase * 10.0 * h, -1.0])
                    .constraint(LinearRows::new().row(restitution(1.0), &[(0, 1.0)], 0.05))
                    .build()
                    .unwrap();
                let energy = |run: &Simulation<'_, f64>| {
                    let (u, v) = (run.state().displacement(), run.state().velocity());
                    let kinetic = 0.5 * v[0] * v[0] + v[1] * v[1];
                    kinetic + 25.0 * (u[1] - u[0]).powi(2) + 10.0 * u[0] + 20.0 * u[1]
                };
                let start = energy(&run);
                while run.state().velocity()[0] < 0.0 {
                    run.step().unwrap();
                }
                run.step().unwrap();
                assert!(run.state().velocity()[0] > 0.5);
                (energy(&run) / start - 1.0).abs()
            });
            phases.into_iter().fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(4e-3), error(5e-4));
        let order = (coarse / fine).log2() / 3.0;
        assert!(order > 1.7 && coarse < 1e-3, "{}: {order} {coarse:e} {fine:e}", make().name());
    }
}

/// A point that meets a rough floor: friction has μ times the whole impulse, 1 + e times that of a plastic impact, or
/// stops the slip.
#[test]
fn friction_is_in_the_cone_of_the_whole_impulse() {
    for listed in served() {
        for (mu, e) in [(0.2, 0.5), (0.2, 1.0), (2.0, 0.5)] {
            for phase in [0.0, 0.37, 0.74] {
                let rows = LinearRows::new()
                    .row(restitution(e), &[(1, 1.0)], (6.0 + phase) * 0.02)
                    .friction(mu, &[&[(0, 1.0)]]);
                let mut run = Simulation::builder(free(&[1.0, 1.0]), (listed.make)(), 0.01)
                    .velocity(vec![3.0, -2.0])
                    .constraint(rows)
                    .build()
                    .unwrap();
                for _ in 0..20 {
                    run.step().unwrap_or_else(|error| panic!("{}: {error}", listed.name()));
                }
                let v = run.state().velocity();
                let slip = (3.0 - mu * (1.0 + e) * 2.0_f64).max(0.0);
                let name = format!("{}, μ = {mu}, e = {e}, phase {phase}", listed.name());
                assert!((v[1] - 2.0 * e).abs() < 1e-11, "{name}: {v:?}");
                assert!((v[0] - slip).abs() < 1e-11, "{name}: {v:?} {slip}");
            }
        }
    }
}

/// A rod whose end strikes a rough floor (Kane's case): Newton's law with friction would add energy there.
#[test]
fn no_impact_with_friction_adds_energy() {
    for listed in served().filter(|listed| listed.order == 2) {
        for k in 0..12 {
            let angle = 0.3 + 0.1 * f64::from(k);
            let (sine, cosine) = angle.sin_cos();
            // x, y and angle of a rod with inertia 1/3: the end is at −(cos, sin).
            let rows = LinearRows::new()
                .row(restitution(0.9), &[(1, 1.0), (2, -cosine)], 0.05)
                .friction(0.7, &[&[(0, 1.0), (2, sine)]]);
            let mut run = Simulation::builder(free(&[1.0, 1.0, 1.0 / 3.0]), (listed.make)(), 0.01)
                .velocity(vec![0.3 * f64::from(k % 4) - 0.4, -1.0, 0.8])
                .constraint(rows)
                .build()
                .unwrap();
            let energy = |run: &Simulation<'_, f64>| {
                let v = run.state().velocity();
                0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] / 3.0)
            };
            let start = energy(&run);
            for _ in 0..30 {
                match run.step() {
                    Ok(()) => {}
                    Err(Error::Jammed { .. }) => break,
                    Err(error) => panic!("{}: {error}", listed.name()),
                }
                assert!(energy(&run) < start * (1.0 + 1e-9), "{}, {angle}: {}", listed.name(), energy(&run) / start);
            }
        }
    }
}

#[test]
fn what_cannot_let_contacts_leave_is_refused() {
    let built = |scheme: Box<dyn TimeIntegrator>, correction: Option<PersistencyCorrection>| {
        let builder = Simulation::builder(free(&[1.0]), scheme, 0.01).constraint(LinearRows::new().row(
            restitution(0.5),
            &[(0, 1.0)],
            0.1,
        ));
        match correction {
            Some(correction) => builder.corrector(correction).build().map(|_| ()),
            None => builder.uncorrected().build().map(|_| ()),
        }
    };
    let both = PersistencyCorrection::new();
    let refused: [(Box<dyn TimeIntegrator>, _, _); 4] = [
        (Box::new(Composite), None, "correction of velocities"),
        (Box::new(Composite), Some(both), "past"),
        (Box::new(Newmark::trapezoidal()), Some(both.parts(Parts::Velocity)), "both parts"),
        (Box::new(CentralDifference), None, "ahead of the state"),
    ];
    for (scheme, correction, reason) in refused {
        let error = built(scheme, correction).unwrap_err();
        assert!(matches!(error, Error::Incompatible { .. }) && error.to_string().contains(reason), "{error}");
    }
    built(Box::new(Newmark::trapezoidal()), Some(both)).unwrap();
    built(Box::new(Composite), Some(PersistencyCorrection::with_history_projection())).unwrap();
}
