//! What happens does not depend on who looks at it: scenes whose obstacle, bodies and loads have a motion of their own,
//! uniform or accelerated, are those at rest with this motion added, under every law and with every correction. Nor
//! does it depend on whether an obstacle is a gap that moves or a dof that is driven.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::tableau::ContactLevel;
use contact_dynamics::{ContactLaw, LinearRows, LinearSystem, Simulation, TimeIntegrator};
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes::all;
use contact_dynamics_scenes::sparse::{free, matrix, springs};

const H: f64 = 0.02;
const STIFFNESS: f64 = 40.0;

/// Speed and acceleration of all that is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Motion {
    speed: f64,
    acceleration: f64,
}

impl Motion {
    const REST: Self = Self { speed: 0.0, acceleration: 0.0 };

    fn at(self, t: f64) -> [f64; 3] {
        let Self { speed, acceleration } = self;
        [speed * t + 0.5 * acceleration * t * t, speed + acceleration * t, acceleration]
    }
}

type Case = (ContactLaw, Correction);

/// What the wall is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wall {
    Offset,
    Driven,
}

/// Two masses on a spring fly against a wall, are pushed to it and pulled off. Relative to the wall: u, v, a and the
/// forces, raw forces, impulses and energies of the contact after every step. Nothing if the parts do not go together.
fn relative(
    scheme: Box<dyn TimeIntegrator>,
    (law, correction): Case,
    (motion, wall): (Motion, Wall),
) -> Option<Vec<Vec<f64>>> {
    let k = matrix(3, springs(2, STIFFNESS).chain([(2, 2, 0.0)]));
    let load = move |t: f64, f: &mut [f64]| {
        // Twice to the wall, once off it.
        let push = if (9.0 * t).sin() > -0.5 { -6.0 } else { 9.0 };
        f[0] = 0.5 * motion.acceleration;
        f[1] = push + 2.0 * motion.acceleration;
    };
    let system = LinearSystem::lumped(vec![0.5, 2.0, 1.0], k).unwrap().load(load);
    let (system, rows) = match wall {
        Wall::Offset => {
            let gap = GapOffset::moving(move |t| {
                let [u, v, a] = motion.at(t);
                [0.1 - u, -v, -a]
            });
            (system, LinearRows::new().row(law, &[(0, 1.0)], gap))
        }
        Wall::Driven => {
            let system = system.drive(2, move |t| motion.at(t)).unwrap();
            (system, LinearRows::new().row(law, &[(0, 1.0), (2, -1.0)], 0.1))
        }
    };
    let mut run = Simulation::builder(system, scheme, H)
        .velocity(vec![motion.speed - 1.0, motion.speed - 1.0, if wall == Wall::Driven { motion.speed } else { 0.0 }])
        .constraint(rows)
        .correctors(correction.correctors(H).unwrap())
        .build()
        .ok()?;
    let mut seen = Vec::new();
    for _ in 0..60 {
        run.step().ok()?;
        let (state, [u, v, a]) = (run.state(), motion.at(run.time()));
        let contacts = state.contacts();
        let mut all = Vec::new();
        all.extend(state.displacement()[..2].iter().map(|x| x - u));
        all.extend(state.velocity()[..2].iter().map(|x| x - v));
        all.extend(state.acceleration()[..2].iter().map(|x| H * (x - a)));
        all.extend([contacts.forces()[0], contacts.raw_forces()[0]].map(|x| H * x));
        all.extend([contacts.impulses()[0], contacts.dissipated()[0], contacts.gaps()[0]]);
        seen.push(all);
    }
    Some(seen)
}

fn laws() -> [ContactLaw; 11] {
    let k = 1.5 * STIFFNESS;
    [
        ContactLaw::Rigid,
        ContactLaw::Restitution { coefficient: 0.6 },
        ContactLaw::RateCondition,
        ContactLaw::PersistencySwitch,
        ContactLaw::Penalty { stiffness: k },
        ContactLaw::PowerLaw { stiffness: 10.0 * k, exponent: 1.5 },
        ContactLaw::Bipenalty { stiffness: k, mass: 0.25 * k * H * H },
        ContactLaw::StabilizedBipenalty { stiffness: k },
        ContactLaw::AugmentedLagrangian { stiffness: k, augmentations: 2 },
        ContactLaw::KelvinVoigt { stiffness: k, damping: 0.5 * k * H },
        ContactLaw::HuntCrossley { stiffness: 10.0 * k, exponent: 1.5, dissipation: 0.2 },
    ]
}

/// All schemes with all laws, and with all corrections on rigid contact, as far as they go together.
fn agree(motions: &[(Motion, Wall)], takes: impl Fn(Box<dyn TimeIntegrator>, Case) -> bool) -> u32 {
    let laws = laws().into_iter().map(|law| (law, Correction::None));
    let corrections = Correction::ALL.into_iter().map(|correction| (ContactLaw::Rigid, correction));
    let cases: Vec<_> = laws.chain(corrections).collect();
    let mut compared = 0;
    for listed in all() {
        for &case in &cases {
            if !takes((listed.make)(), case) {
                continue;
            }
            let Some(still) = relative((listed.make)(), case, (Motion::REST, Wall::Offset)) else { continue };
            for &motion in motions {
                let name = format!("{}, {case:?}, {motion:?}", listed.name());
                let Some(moving) = relative((listed.make)(), case, motion) else { panic!("{name}: refused") };
                for (step, (x, y)) in moving.iter().zip(&still).enumerate() {
                    let miss = x.iter().zip(y).fold(0.0, |miss: f64, (x, y)| miss.max((x - y).abs()));
                    assert!(miss < 1e-7, "{name}, step {step}: {miss:e}\n{x:?}\n{y:?}");
                }
                compared += 1;
            }
        }
    }
    compared
}

#[test]
fn uniform_motion_of_all_changes_nothing() {
    let motion = Motion { speed: 3.0, acceleration: 0.0 };
    let compared = agree(&[(motion, Wall::Offset), (motion, Wall::Driven)], |_, _| true);
    assert!(compared > 300, "{compared}");
}

#[test]
fn accelerated_motion_of_all_changes_nothing_by_schemes_that_are_exact_for_it() {
    let motion = Motion { speed: -2.0, acceleration: 5.0 };
    let exact = |scheme: Box<dyn TimeIntegrator>, (law, correction): Case| {
        // Stabilized schemes predict u + h v, forecasts of those on velocities know no acceleration either, and a = 0
        // means what it says.
        let absolute = [Correction::Stabilized, Correction::StabilizedClosed, Correction::ZeroAcceleration];
        let forecasts = scheme.tableau().stages.iter().any(|s| matches!(s.contact, ContactLevel::Velocity { .. }));
        let scheme_between = scheme.tableau().stages.iter().any(|s| (s.load - s.end).abs() > 1e-12);
        let mut flight = Simulation::builder(free(&[1.0]).load(|_, f| f[0] = 2.0), scheme, H).build().unwrap();
        flight.run_until(0.5, &mut ()).unwrap();
        let (t, state) = (flight.time(), flight.state());
        let miss = [state.displacement()[0] - t * t, state.velocity()[0] - 2.0 * t].map(f64::abs);
        // The mean of two ends is no place on a parabola: springs see a wall that is O(h²) away.
        let between = scheme_between && law.is_compliant();
        !absolute.contains(&correction) && !forecasts && !between && miss.iter().all(|&miss| miss < 1e-12)
    };
    let compared = agree(&[(motion, Wall::Offset), (motion, Wall::Driven)], exact);
    assert!(compared > 200, "{compared}");
}
