//! A cable around a drum: the tensions at its ends, by Euler and Eytelwein's formula.

use contact_dynamics::contact::{Side, Sphere};
use contact_dynamics::{GeneralizedAlpha, LinearSystem, NodesOnObstacle, Simulation};
use contact_dynamics_scenes::sparse::{Entry, matrix};
use std::f64::consts::PI;

/// The tension that pulls a cable of trusses around a drum of radius one, over the tension that holds it, while it
/// slides; `links` lie on the drum, over this angle.
fn ratio(links: usize, angle: f64, friction: f64, offset: f64) -> f64 {
    const STIFFNESS: f64 = 1e6;
    const HELD: f64 = 1.0;
    let (nodes, radius) = (links + 3, 1.0 + offset);
    let turn = angle / links as f64;
    let length = 2.0 * radius * (0.5 * turn).sin();
    // The first and the last node are off the drum, in the direction of the tangents.
    let coordinates: Vec<[f64; 2]> = (0..nodes)
        .map(|node| {
            let on_drum = node.clamp(1, links + 1);
            let (sin, cos) = ((on_drum - 1) as f64 * turn).sin_cos();
            let beyond = length * (node as f64 - on_drum as f64);
            [radius * cos - beyond * sin, radius * sin + beyond * cos]
        })
        .collect();
    let mut entries: Vec<Entry> = Vec::new();
    for node in 0..nodes - 1 {
        let way = [0, 1].map(|axis| (coordinates[node + 1][axis] - coordinates[node][axis]) / length);
        for (i, j, sign) in
            [(node, node, 1.0), (node + 1, node + 1, 1.0), (node, node + 1, -1.0), (node + 1, node, -1.0)]
        {
            for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                entries.push((2 * i + a, 2 * j + b, sign * STIFFNESS / length * way[a] * way[b]));
            }
        }
    }
    let wave = STIFFNESS.sqrt();
    let (whole, last) = (length * (links + 2) as f64, nodes - 1);
    let (speed, time) = (1e-4, whole / wave);
    let (sin, cos) = angle.sin_cos();
    let pull = move |t: f64| {
        let decay = (-t / time).exp();
        [t - time * (1.0 - decay), 1.0 - decay, decay / time].map(|x| speed * x)
    };
    let system = LinearSystem::lumped(vec![length; 2 * nodes], matrix(2 * nodes, entries))
        .and_then(|system| system.rayleigh(0.0, 0.1 * time))
        .and_then(|system| system.drive(2 * last, move |t| pull(t).map(|x| -sin * x)))
        .and_then(|system| system.drive(2 * last + 1, move |t| pull(t).map(|x| cos * x)))
        .unwrap()
        .load(|_, f| {
            f.fill(0.0);
            f[1] = -HELD;
        });
    let dofs: Vec<[usize; 2]> = (0..nodes).map(|node| [2 * node, 2 * node + 1]).collect();
    let on_drum: Vec<usize> = (1..=links + 1).collect();
    // The drum, and half of the thickness of the cable.
    let drum = Sphere::new([0.0; 2], radius, Side::Outside).unwrap();
    let drum = NodesOnObstacle::new(drum, &coordinates, &dofs, &on_drum).unwrap().friction(friction);
    let mut run =
        Simulation::builder(system, GeneralizedAlpha::default(), 0.02 * time).constraint(drum).build().unwrap();
    // Until the strain of the cable at twice the tension has been taken up, and all slides.
    let strained = HELD * (friction * angle).exp() / STIFFNESS * whole / speed;
    run.run_until(2.0 * strained + 20.0 * time, &mut ()).unwrap();
    let u = run.state().displacement();
    let tension = |node: usize| {
        let way = [0, 1].map(|axis| coordinates[node + 1][axis] - coordinates[node][axis]);
        let longer = [0, 1].map(|axis| u[2 * node + 2 + axis] - u[2 * node + axis]);
        STIFFNESS * (way[0] * longer[0] + way[1] * longer[1]) / (length * length)
    };
    tension(nodes - 2) / tension(0)
}

/// Each node holds μ times its normal force: between chords at an angle 2 φ the tension grows by
/// (1 + μ tan φ)/(1 − μ tan φ), which tends to e^(2 μ φ).
#[test]
fn a_cable_on_a_drum_grips_as_it_should() {
    for (angle, friction, offset) in [(PI, 0.3, 0.0), (0.5 * PI, 0.8, 0.05), (2.5 * PI, 0.2, 0.0)] {
        let mut misses = Vec::new();
        for links in [12, 48] {
            let found = ratio(links, angle, friction, offset);
            let tan = friction * (0.5 * angle / links as f64).tan();
            let of_nodes = ((1.0 + tan) / (1.0 - tan)).powf(links as f64);
            assert!((found / of_nodes - 1.0).abs() < 1e-3, "{angle} {friction} {links}: {found}, {of_nodes}");
            misses.push((found / (friction * angle).exp() - 1.0).abs());
        }
        assert!(misses[1] < 0.01 && misses[1] < 0.3 * misses[0], "{angle} {friction}: {misses:?}");
    }
}
