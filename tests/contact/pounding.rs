//! Pounding: contact models of structural engineers against closed forms, and frames that do not meet against their
//! modes.

use contact_dynamics::LinearSystem;
use contact_dynamics::{ContactLaw, Corrector, MoreauJean, Newmark, PersistencyCorrection, Simulation, System, verify};
use contact_dynamics_scenes::damped_contact::{
    DampedContact, DampedLaw, damping_ratio, restitution_of_hertz_damp, restitution_without_pull,
};
use contact_dynamics_scenes::frames::{Frame, Frames};
use contact_dynamics_scenes::ground::{Ground, ricker};
use contact_dynamics_scenes::pounding::{Pounding, Record};
use contact_dynamics_scenes::reference::PowerLawImpact;
use contact_dynamics_scenes::sparse::{matrix, spring};
use std::f64::consts::PI;
use std::sync::Arc;

const MASSES: [f64; 2] = [4.0, 3.0];

/// m₁ m₂/(m₁ + m₂).
fn reduced() -> f64 {
    MASSES[0] * MASSES[1] / (MASSES[0] + MASSES[1])
}

fn free_masses(law: DampedLaw) -> DampedContact<'static> {
    let system = LinearSystem::lumped(MASSES.to_vec(), matrix(2, spring(0, 1, 0.0))).unwrap();
    DampedContact::new(system, law, &[([0, 1], 0.01)]).unwrap()
}

/// What an impact of two free masses leaves.
struct Impact {
    restitution: f64,
    force: f64,
    duration: f64,
}

/// The first one flies at the second one with this speed; a contact lasts about `steps` steps.
fn impact(law: DampedLaw, speed: f64, duration: f64, steps: f64) -> Impact {
    let (mut system, h) = (free_masses(law), duration / steps);
    let mut run =
        Simulation::builder(&mut system, Newmark::trapezoidal(), h).velocity(vec![speed, 0.0]).build().unwrap();
    run.run_until(0.01 / speed + 2.0 * duration, &mut ()).unwrap();
    let v = run.state().velocity().to_vec();
    let momentum = MASSES[0] * v[0] + MASSES[1] * v[1];
    assert!((momentum / (MASSES[0] * speed) - 1.0).abs() < 1e-12, "{momentum}");
    drop(run);
    let forces = system.history();
    let pressed = forces.iter().filter(|&&force| force > 0.0).count();
    Impact {
        restitution: (v[1] - v[0]) / speed,
        force: forces.iter().fold(0.0, |peak, &force| force.max(peak)),
        duration: pressed as f64 * h,
    }
}

#[test]
fn kelvin_and_voigts_contact_has_the_restitution_of_its_damping() {
    let stiffness = 3e4;
    for nominal in [0.4, 0.65, 0.9] {
        let ratio = damping_ratio(nominal);
        // The definition: the amplitude after half a swing.
        assert!(((-PI * ratio / (1.0 - ratio * ratio).sqrt()).exp() - nominal).abs() < 1e-14);
        let half_swing = PI * (reduced() / stiffness).sqrt();
        let law = DampedLaw::kelvin_voigt(stiffness, nominal, MASSES);
        let found = [400.0, 1600.0].map(|steps| impact(law, 0.7, half_swing, steps).restitution);
        let exact = restitution_without_pull(ratio);
        let errors = found.map(|found| (found / exact - 1.0).abs());
        // The damping begins a step late, and ends where the force would pull: first order.
        assert!(errors[0] < 8e-3 && errors[1] < 2e-3, "{nominal}: {found:?}, {exact}");
        // Where contact ends when it would pull, it is less than half a swing: more than the nominal one is left.
        assert!(exact > nominal + 0.2 * (1.0 - nominal).powi(2), "{exact}");
    }
}

#[test]
fn a_damped_hertz_contact_has_the_restitution_of_its_integral() {
    let stiffness = 2e6;
    for nominal in [0.4, 0.65, 0.9, 1.0] {
        let speed = 0.5;
        let elastic = PowerLawImpact { mass: reduced(), stiffness, exponent: 1.5, velocity: speed };
        let law = DampedLaw::HertzDamp { stiffness, restitution: nominal };
        let found = impact(law, speed, elastic.duration(), 1000.0);
        let exact = restitution_of_hertz_damp(nominal);
        assert!((found.restitution / exact - 1.0).abs() < 1e-3, "{nominal}: {} {exact}", found.restitution);
        // Undamped it is Hertz' impact.
        if nominal > 0.99 {
            assert!((found.force / elastic.force() - 1.0).abs() < 1e-4, "{} {}", found.force, elastic.force());
            assert!((found.duration / elastic.duration() - 1.0).abs() < 5e-3);
            assert!((exact - 1.0).abs() < 1e-12);
        }
    }
    // The formula for the damping is that of e near 1.
    assert!((restitution_of_hertz_damp(0.99) - 0.99).abs() < 1e-3);
    assert!(restitution_of_hertz_damp(0.4) > 0.5);
}

#[test]
fn damped_contacts_know_their_tangent_and_refuse_what_is_out_of_range() {
    for law in [DampedLaw::kelvin_voigt(3e4, 0.65, MASSES), DampedLaw::HertzDamp { stiffness: 2e6, restitution: 0.65 }]
    {
        let mut system = free_masses(law);
        // Approach while open, then pressed.
        system.commit(0.0, &[0.0, 0.0], &[0.4, 0.0]).unwrap();
        system.commit(0.1, &[0.02, 0.0], &[0.4, 0.0]).unwrap();
        let check = verify::tangent(&mut system, 0.2, &[0.03, 0.001], &[0.3, 0.1], 1e-7, 1e-6).unwrap();
        assert!(check.largest() < 1e-5, "{law:?}: {check:?}");
        assert!(system.history()[0] == 0.0 && system.history()[1] > 0.0);
    }
    let system = || LinearSystem::lumped(MASSES.to_vec(), matrix(2, [(0, 0, 0.0), (1, 1, 0.0)])).unwrap();
    let refused = |law| DampedContact::new(system(), law, &[([0, 1], 0.0)]).unwrap_err().to_string();
    let stiff = refused(DampedLaw::KelvinVoigt { stiffness: -2.0, damping: 0.0 });
    assert!(stiff.contains("stiffness") && stiff.contains("-2"), "{stiff}");
    let e = refused(DampedLaw::HertzDamp { stiffness: 1.0, restitution: 1.5 });
    assert!(e.contains("restitution") && e.contains("1.5"), "{e}");
    let place = refused(DampedLaw::KelvinVoigt { stiffness: 1.0, damping: 0.0 });
    assert!(place.contains("no place"), "{place}");
}

/// A floor of one frame at rest and one that comes: both go on with the common velocity, or part with e of the
/// approach; the impulse is m v and (1 + e) m v with the reduced mass.
#[test]
fn an_impact_of_floors_has_the_impulse_of_its_masses() {
    let frame = |mass| Frame { storeys: 1, mass, stiffness: 1e-9 };
    let frames = Frames { frames: MASSES.map(frame), gap: 0.01, damping: 0.0 };
    let still = Arc::new(Ground::sampled(0.1, 0.1, |_| 0.0));
    let speed = 0.5;
    for (law, e) in [(ContactLaw::Rigid, 0.0), (ContactLaw::Restitution { coefficient: 0.65 }, 0.65)] {
        let rows = contact_dynamics::LinearRows::new().row(law, &[(0, -1.0), (1, 1.0)], frames.gap);
        let mut run = Simulation::builder(frames.system(still.clone()).unwrap(), MoreauJean::new(0.5).unwrap(), 1e-3)
            .velocity(vec![speed, 0.0])
            .constraint(rows)
            .build()
            .unwrap();
        let mut impulse = 0.0;
        for _ in 0..30 {
            run.step().unwrap();
            impulse += run.state().contacts().impulses()[0];
        }
        let exact = (1.0 + e) * reduced() * speed;
        assert!((impulse / exact - 1.0).abs() < 1e-9, "{impulse} {exact}");
    }
}

fn run(frames: &Frames, ground: &Arc<Ground>, pounding: Pounding, h: f64, until: f64) -> Record {
    let correction = Box::new(PersistencyCorrection::new());
    frames.run(ground, pounding, Box::new(Newmark::trapezoidal()), vec![correction], h, until).unwrap()
}

/// The displacements of a frame at multiples of the interval of a record, by its modes: between two samples the load is
/// a straight line, and the motion of a mode known in closed form.
fn by_modes(frame: &Frame, ratio: f64, ground: &Ground, interval: f64, count: usize) -> Vec<Vec<f64>> {
    let [of_mass, of_stiffness] = frame.rayleigh(ratio);
    let mut motion = vec![vec![0.0; frame.storeys]; count + 1];
    for mode in 1..=frame.storeys {
        let (omega, shape) = (frame.frequency(mode), frame.shape(mode));
        let participation = shape.iter().sum::<f64>() / shape.iter().map(|x| x * x).sum::<f64>();
        let decay = 0.5 * (of_mass + of_stiffness * omega * omega);
        let damped = (omega * omega - decay * decay).sqrt();
        let (mut x, mut v) = (0.0, 0.0);
        for k in 0..count {
            let [start, end] = [k, k + 1].map(|k| -participation * ground.at(k as f64 * interval));
            // The straight line a + b t is a solution of the equation with load; the rest swings freely.
            let slope = (end - start) / interval;
            let b = slope / (omega * omega);
            let a = (start - 2.0 * decay * b) / (omega * omega);
            let (cosine, sine) = (x - a, (v - b + decay * (x - a)) / damped);
            let (sin, cos) = (damped * interval).sin_cos();
            let fading = (-decay * interval).exp();
            x = a + b * interval + fading * (cosine * cos + sine * sin);
            v = b + fading * ((damped * sine - decay * cosine) * cos - (damped * cosine + decay * sine) * sin);
            motion[k + 1].iter_mut().zip(&shape).for_each(|(u, shape)| *u += shape * x);
        }
    }
    motion
}

#[test]
fn frames_far_apart_move_by_their_modes() {
    let (interval, count) = (5e-3, 400);
    let until = count as f64 * interval;
    let ground = Arc::new(Ground::sampled(interval, until, ricker(3.0, 1.5, 0.8)));
    let frames = Frames { gap: 10.0, ..Frames::of_the_study() };
    let exact = frames.frames.map(|frame| by_modes(&frame, frames.damping, &ground, interval, count));
    let peak = exact[0].iter().flatten().fold(0.0, |peak: f64, u| peak.max(u.abs()));
    let error = |pounding, refinement: usize| {
        let record = run(&frames, &ground, pounding, interval / refinement as f64, until);
        let every = record.displacements().skip(refinement - 1).step_by(refinement);
        let exact = exact[0].iter().zip(&exact[1]).skip(1).map(|(left, right)| left.iter().chain(right));
        let errors =
            every.zip(exact).flat_map(|((_, u), exact)| u.iter().zip(exact).map(|(u, exact)| (u - exact).abs()));
        errors.fold(0.0, f64::max) / peak
    };
    for pounding in [
        Pounding::None,
        Pounding::Law(ContactLaw::Rigid),
        Pounding::Damped(DampedLaw::kelvin_voigt(2e9, 0.65, frames.frames.map(|frame| frame.mass))),
    ] {
        let errors = [2, 4].map(|refinement| error(pounding, refinement));
        assert!(errors[1] < 2e-3 && (errors[0] / errors[1] / 4.0 - 1.0).abs() < 0.1, "{pounding:?}: {errors:?}");
    }
}

#[test]
fn models_agree_on_impulses_and_not_on_forces() {
    let frames = Frames::of_the_study();
    let ground = Arc::new(Ground::sampled(5e-3, 2.0, ricker(3.5, 1.5, 0.8)));
    let of = |pounding| frames.figures(&run(&frames, &ground, pounding, 5e-4, 1.5));
    let alone = of(Pounding::None);
    assert!(alone.impacts.count == 0 && alone.toward[0] + alone.toward[1] > frames.gap);
    let springs = [2e8, 2e9, 2e10].map(|stiffness| of(Pounding::Law(ContactLaw::Penalty { stiffness })));
    for figures in &springs {
        assert!(figures.impacts.count > 0);
    }
    // The force of an impact goes with the root of the stiffness; the impulses are those of the masses.
    for pair in springs.windows(2) {
        let ratio = pair[1].impacts.force / pair[0].impacts.force;
        assert!((1.5..5.0).contains(&ratio), "{ratio}");
    }
    let rigid = of(Pounding::Law(ContactLaw::Rigid));
    for figures in &springs[1..] {
        let ratio = figures.impacts.impulse / rigid.impacts.impulse;
        assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
    }
}

/// The same impacts by steps ten times as long: with the correction drifts and impulses hardly change, without it they
/// do.
#[test]
fn corrected_impacts_do_not_depend_on_the_step() {
    let frames = Frames::of_the_study();
    let ground = Arc::new(Ground::sampled(5e-3, 2.0, ricker(3.5, 1.5, 0.8)));
    let change = |corrected: bool| {
        let [fine, coarse] = [5e-4, 5e-3].map(|h| {
            let scheme = Box::new(Newmark::trapezoidal());
            let correction: Box<dyn Corrector<f64>> = Box::new(PersistencyCorrection::new());
            let correctors = if corrected { vec![correction] } else { Vec::new() };
            let rigid = Pounding::Law(ContactLaw::Rigid);
            frames.figures(&frames.run(&ground, rigid, scheme, correctors, h, 1.5).unwrap())
        });
        let drifts = fine.drifts.iter().zip(&coarse.drifts).map(|(fine, coarse)| (coarse / fine - 1.0).abs());
        [drifts.fold(0.0, f64::max), (coarse.impacts.impulse / fine.impacts.impulse - 1.0).abs()]
    };
    let (corrected, raw) = (change(true), change(false));
    assert!(corrected[0] < 0.04 && corrected[1] < 0.02, "{corrected:?}");
    assert!(raw[0] > 3.0 * corrected[0] && raw[1] > 3.0 * corrected[1], "{corrected:?} {raw:?}");
}
