//! A rod in a curved well: torque and drag against the soft string, and the front of axial waves that friction stops.

use contact_dynamics::{CdLagrange, ContactStatus, Corrector, GeneralizedAlpha, PersistencyCorrection};
use contact_dynamics_scenes::well::{Rod, Well, arc_tension, ramp};
use std::f64::consts::FRAC_PI_2;

fn correction() -> Vec<Box<dyn Corrector<f64>>> {
    vec![Box::new(PersistencyCorrection::with_history_projection())]
}

/// The pull of the hook, mean over the last tenth of a run, with the top moved at a constant velocity. Weight and
/// motion come on smoothly: a rod that slides one way all the time is not damped by Coulomb's friction, and would go on
/// swinging.
fn steady_hook(rod: &Rod, velocity: f64, h: f64, until: f64) -> f64 {
    let scheme = Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap());
    let mut run = rod.run(scheme, correction(), h, 0.6 * until, ramp(velocity, 0.3 * until)).unwrap();
    let (mut sum, mut count) = (0.0, 0);
    while run.time() < until {
        run.step().unwrap();
        if run.time() > 0.9 * until {
            sum += rod.hook_load(&mut run).unwrap();
            count += 1;
        }
    }
    // Nothing sticks once all of it moves.
    let contacts = run.state().contacts();
    let sticking = (0..contacts.gaps().len()).filter(|&k| contacts.status(k) == ContactStatus::Sticking).count();
    assert_eq!(sticking, 0);
    sum / f64::from(count)
}

/// A rope around a quarter of a circle, without weight, between two straight pieces.
#[test]
fn a_weightless_rod_on_an_arc_is_a_rope_on_a_capstan() {
    let well = Well { kick_off: 20.0, radius: 100.0, inclination: [0.0, FRAC_PI_2] };
    let rod = Rod {
        well,
        length: well.end_of_arc() + 20.0,
        elements: 50,
        stretching: 7e8,
        bending: 1e4,
        density: 29.0,
        weight: 0.0,
        friction: 0.3,
        // (Little: when tension comes on the rod jumps to the high side, and goes on swinging.)
        play: 1e-4,
        tail: 1e5,
    };
    for (velocity, sign) in [(0.2, 1.0), (-0.2, -1.0)] {
        let exact = rod.tail * (sign * rod.friction * FRAC_PI_2).exp();
        assert!((exact / arc_tension(sign * rod.friction, 0.0, 100.0, [rod.tail, FRAC_PI_2], 0.0) - 1.0).abs() < 1e-12);
        let found = steady_hook(&rod, velocity, 4e-3, 3.0);
        assert!((found / exact - 1.0).abs() < 5e-3, "{velocity}: {found} {exact}");
    }
}

/// A heavy rod that a tail holds on the high side of an arc, with a closed form, and a well of three parts, with the
/// soft string.
#[test]
fn the_hook_load_of_a_rod_that_moves_is_that_of_the_soft_string() {
    let mut held = Rod::drill_pipe(60);
    (held.well.kick_off, held.tail) = (100.0, 3e5);
    held.length = held.well.end_of_arc() + 100.0;
    let [start, end] = held.well.inclination;
    for (velocity, sign) in [(0.2, 1.0), (-0.2, -1.0)] {
        let friction = sign * held.friction;
        let below = held.tail + 100.0 * held.weight * (end.cos() + friction * end.sin());
        let exact = arc_tension(friction, held.weight, held.well.radius, [below, end], start) + 100.0 * held.weight;
        assert!((held.soft_string(sign, 2)[0][1] / exact - 1.0).abs() < 1e-9);
        let found = steady_hook(&held, velocity, 8e-3, 6.0);
        assert!((found / exact - 1.0).abs() < 5e-3, "{velocity}: {found} {exact}");
    }
    let whole = Rod::drill_pipe(60);
    for (velocity, sign) in [(0.2, 1.0), (-0.2, -1.0)] {
        let exact = whole.soft_string(sign, 2)[0][1];
        let found = steady_hook(&whole, velocity, 1.25e-2, 10.0);
        assert!((found / exact - 1.0).abs() < 1e-2, "{velocity}: {found} {exact}");
    }
}

/// A straight rod on a level bed, its end pulled with V from t = 0 on: the front runs with c, behind it the velocity is
/// V − q x/(2 ρA c), so that friction q = μ w stops the front at 2 ρA c V/q; until then the hook pulls with ρA c V + q
/// c t/2 (d'Alembert with a constant load behind the front).
#[test]
fn friction_stops_the_front_of_a_wave() {
    let well = Well { kick_off: 0.0, radius: 1e3, inclination: [FRAC_PI_2, FRAC_PI_2] };
    let rod = Rod { well, length: 1500.0, friction: 0.5, ..Rod::drill_pipe(150) };
    let (c, q, v) = (rod.wave_speed(), rod.friction * rod.weight, 0.4);
    let impedance = rod.density * c;
    let (start, stop) = (0.5, 2.0 * impedance * v / q);
    assert!((800.0..1200.0).contains(&stop), "{stop}");
    // (The weight is on before the pull begins: the support is at rest until then.)
    let hoist = move |t: f64| if t > start { [v * (t - start), v, 0.0] } else { [0.0; 3] };
    // (At the Courant number 1 waves along the rod are exact; elsewhere the mesh rings behind the front.)
    let h = rod.size() / c;
    let mut run = rod.run(Box::new(CdLagrange), Vec::new(), h, 0.2, hoist).unwrap();
    run.run_until(start, &mut ()).unwrap();
    let passed = 0.5 * stop / c;
    run.run_until(start + passed, &mut ()).unwrap();
    let passed = run.time() - start;
    let u = run.state().displacement().to_vec();
    // Behind the front u = V (t − x/c) − q x (c t − x)/(2 EA), before it nothing.
    let exact = |x: f64| match x < c * passed {
        true => v * (passed - x / c) - q * x * (c * passed - x) / (2.0 * rod.stretching),
        false => 0.0,
    };
    let errors = (0..=rod.elements).map(|node| (-rod.way(node, &u) - exact(rod.depth(node))).abs());
    let worst = errors.fold(0.0, f64::max) / (v * passed);
    assert!(worst < 0.01, "{worst}");
    assert!(exact(0.98 * c * passed) > 0.0 && rod.way(rod.elements, &u).abs() < 1e-9 * v * passed);
    let v_now = run.state().velocity().to_vec();
    let front = (0..=rod.elements).take_while(|&node| rod.depth(node) < c * passed).count();
    for node in [front / 4, front / 2, 3 * front / 4] {
        let exact = v - q * rod.depth(node) / (2.0 * impedance);
        let mean = (node - 1..=node + 1).map(|node| -rod.way(node, &v_now)).sum::<f64>() / 3.0;
        assert!((mean / exact - 1.0).abs() < 0.03, "{node}: {mean} {exact}");
    }
    let mut mean = 0.0;
    for _ in 0..20 {
        run.step().unwrap();
        mean += rod.hook_load(&mut run).unwrap() / 20.0;
    }
    let exact = impedance * v + 0.5 * q * c * (run.time() - start - 9.5 * h);
    assert!((mean / exact - 1.0).abs() < 0.02, "{mean} {exact}");
    // What lies beyond where it stops has not moved when the wave could have been there.
    run.run_until(start + 1.05 * stop / c, &mut ()).unwrap();
    let u = run.state().displacement();
    let mut beyond = (0..=rod.elements).filter(|&node| rod.depth(node) > 1.1 * stop);
    assert!(beyond.all(|node| rod.way(node, u).abs() < 1e-3 * v * stop / c));
}
