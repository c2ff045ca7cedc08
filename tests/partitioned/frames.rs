//! Bodies in codes of their own that meet at a frame: as in one code, and the equations of the frame.

use crate::body::{self, Body, flexibility};
use crate::scene::{Comparison, H, Scene, motion};
use contact_dynamics::contact_solver::{ContactFailure, Pivoting};
use contact_dynamics::partitioned::{Frame, Interface, Side};
use contact_dynamics::{Automatic, Error, Newmark};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::{Bars, MassKind};

/// What a compressive force is on the dofs of both bodies.
const SIGNS: [f64; 2] = [-1.0, 1.0];

fn signed(sign: f64, forces: &[f64]) -> Vec<f64> {
    forces.iter().map(|force| sign * force).collect()
}

/// Both codes and the frames between them: one for displacements, one for rates.
struct Host {
    bodies: [Body; 2],
    frames: [Frame<f64>; 2],
    gaps: Vec<f64>,
    force: Vec<f64>,
    pressed: usize,
}

impl Host {
    fn new(scene: &Scene) -> Self {
        let nodes = scene.pairs.len();
        Self {
            bodies: [0..scene.split, scene.split..scene.velocity.len()].map(|range| {
                let number = usize::from(range.start > 0);
                let contact = scene.pairs.iter().map(|pair| pair[number] - range.start).collect();
                Body::new([&scene.mass, &scene.stiffness], &scene.velocity, range, contact)
            }),
            frames: [0, 1].map(|_| Frame::new(nodes).unwrap()),
            gaps: scene.gaps.clone(),
            force: vec![0.0; nodes],
            pressed: 0,
        }
    }

    fn step(&mut self, corrected: bool) {
        let Self { bodies, frames: [frame, rates], gaps, force, pressed } = self;
        bodies.iter_mut().for_each(Body::advance);
        let free = [0, 1].map(|s| bodies[s].at_interface(&bodies[s].u));
        let sides = [0, 1].map(|s| Side::new(&free[s], &bodies[s].flexibility));
        let interface = frame.solve(sides, gaps).unwrap().clone();
        // Both sides are where the frame says.
        for (body, sign) in bodies.iter_mut().zip(SIGNS) {
            body.push(&signed(sign, interface.forces()));
        }
        for (body, values) in bodies.iter().zip(interface.values()) {
            let there = body.at_interface(&body.u);
            assert!(there.iter().zip(values).all(|(x, y)| (x - y).abs() < 1e-15));
        }
        force.copy_from_slice(interface.forces());
        *pressed += force.iter().filter(|force| **force > 0.0).count();
        if !corrected {
            return;
        }
        let rate =
            |bodies: &[Body; 2], x: fn(&Body) -> &Vec<f64>| [0, 1].map(|s| bodies[s].at_interface(x(&bodies[s])));
        let still = vec![0.0; gaps.len()];
        // Pressed, or touching and approaching.
        let engaged = |closed: &[bool], free: &[Vec<f64>; 2]| -> Vec<bool> {
            let raw = interface.forces();
            (0..raw.len()).map(|i| closed[i] && (raw[i] > 0.0 || free[1][i] < free[0][i])).collect()
        };
        let v = rate(bodies, |body| &body.v);
        let held = engaged(interface.closed(), &v);
        let sides = [0, 1].map(|s| Side::new(&v[s], &bodies[s].inertia));
        let impulses = rates.hold(sides, &still, &held).unwrap().forces().to_vec();
        for (body, sign) in bodies.iter_mut().zip(SIGNS) {
            let jump = body.jump(&signed(sign, &impulses));
            body.v.iter_mut().zip(jump).for_each(|(v, x)| *v += x);
        }
        let a = rate(bodies, |body| &body.a);
        let held = engaged(&held, &a);
        let sides = [0, 1].map(|s| Side::new(&a[s], &bodies[s].inertia));
        let forces = rates.hold(sides, &still, &held).unwrap().forces().to_vec();
        for (body, sign) in bodies.iter_mut().zip(SIGNS) {
            let jump = body.jump(&signed(sign, &forces));
            body.a.iter_mut().zip(jump).for_each(|(a, x)| *a += x);
        }
        force.iter_mut().zip(forces).for_each(|(force, l)| *force += l);
    }

    fn go_to(&mut self, motion: [&[f64]; 4]) {
        body::go_to(&mut self.bodies, motion);
    }

    fn motion(&self) -> [Vec<f64>; 4] {
        let [first, second] = &self.bodies;
        let both = |x: fn(&Body) -> &Vec<f64>| [&x(first)[..], &x(second)[..]].concat();
        [both(|body| &body.u), both(|body| &body.v), both(|body| &body.a), self.force.clone()]
    }
}

/// Runs the bodies in their own codes beside the monolithic simulation.
fn compare(name: &str, scene: &Scene, corrected: bool, steps: usize) {
    let mut host = Host::new(scene);
    let mut run = scene.simulation(Newmark::trapezoidal(), corrected, Automatic);
    let mut comparison = Comparison::default();
    for _ in 0..steps {
        host.step(corrected);
        run.step().unwrap();
        let found = host.motion();
        comparison.add([&found[0], &found[1], &found[2], &found[3]], motion(&run));
        if !corrected {
            // Contact opens and closes all the time, and each time differences of rounding grow threefold and more:
            // every step begins where the other did.
            host.go_to(motion(&run));
        }
    }
    let released = run.state().contacts().forces().iter().all(|force| *force == 0.0);
    let pressed = host.pressed > if corrected { 100 } else { 10 };
    assert!(pressed && released, "{name}, corrected {corrected}: pressed {}, released {released}", host.pressed);
    assert!(comparison.worst() < 1e-10, "{name}, corrected {corrected}: {comparison:?}");
}

#[test]
fn bars_in_their_own_codes_collide_as_in_one() {
    for phase in [0.05, 0.35, 0.6, 0.95] {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            let bars = Scene::bars(&Bars::paper(20).delayed(phase, H).with_mass(mass));
            compare(&format!("equal bars, phase {phase}, {mass:?}"), &bars, true, 400);
            compare(&format!("equal bars, phase {phase}, {mass:?}"), &bars, false, 400);
            let bars = Bars { elements: [20, 13], ..Bars::dissimilar(20) }.delayed(phase, H).with_mass(mass);
            compare(&format!("dissimilar bars, phase {phase}, {mass:?}"), &Scene::bars(&bars), true, 550);
        }
    }
}

#[test]
fn blocks_in_their_own_codes_collide_as_in_one() {
    for phase in [0.1, 0.5, 0.8] {
        let blocks = Scene::blocks(phase).0;
        compare(&format!("blocks, phase {phase}"), &blocks, true, 400);
        compare(&format!("blocks, phase {phase}"), &blocks, false, 400);
    }
}

/// The equations of the frame, and what it says of both sides.
fn check(interface: &Interface<f64>, sides: [Side<'_, f64>; 2], gaps: &[f64], sign: bool) {
    let (n, l) = (gaps.len(), interface.forces());
    for i in 0..n {
        let d = [(0, -1.0), (1, 1.0)].map(|(side, sign)| {
            let Side { free, flexibility, .. } = sides[side];
            free[i] + sign * (0..n).map(|j| flexibility[i + j * n] * l[j]).sum::<f64>()
        });
        let (x, tiny) = (interface.positions()[i], 1e-12);
        assert!((interface.values()[0][i] - d[0]).abs() < tiny && (interface.values()[1][i] - d[1]).abs() < tiny);
        let open = [x - d[0], d[1] + gaps[i] - x];
        assert!((open[0] - open[1]).abs() < tiny, "halfway: {open:?}");
        assert!((interface.gaps()[i] - 2.0 * open[0]).abs() < tiny);
        if sign {
            assert!(l[i] >= 0.0 && open[0] > -tiny && (l[i] == 0.0 || open[0] < tiny), "node {i}: {} {open:?}", l[i]);
            assert_eq!(interface.closed()[i], l[i] > 0.0);
        } else if interface.closed()[i] {
            assert!(open[0].abs() < tiny, "node {i}: {open:?}");
        } else {
            assert!(l[i] == 0.0);
        }
    }
}

#[test]
fn frames_meet_the_equations_of_localized_multipliers() {
    let mut random = xorshift(41);
    let n = 7;
    let (mut frame, mut reference) = (Frame::new(n).unwrap(), Frame::with_solver(n, Pivoting::default()).unwrap());
    let (mut pressed, mut held_open) = (0, 0);
    for case in 0..200 {
        // A rigid obstacle on one side now and then, rank-deficient sides that make up for each other.
        let f = [0, 1].map(|side| match case % 4 {
            0 if side == 1 => vec![0.0; n * n],
            1 => flexibility(&mut random, n, n - 2),
            _ => flexibility(&mut random, n, n),
        });
        let free = [0, 1].map(|_| (0..n).map(|_| random() - 0.5).collect::<Vec<_>>());
        let gaps: Vec<f64> = (0..n).map(|_| random() - 0.3).collect();
        let sides = [0, 1].map(|s| Side::new(&free[s], &f[s]));
        let found = frame.solve(sides, &gaps).unwrap().clone();
        check(&found, sides, &gaps, true);
        pressed += found.closed().iter().filter(|closed| **closed).count();
        let other = reference.solve(sides, &gaps).unwrap();
        assert!(found.forces().iter().zip(other.forces()).all(|(x, y)| (x - y).abs() < 1e-8 * (1.0 + y)));
        let held: Vec<bool> = (0..n).map(|_| random() < 0.5).collect();
        let found = frame.hold(sides, &gaps, &held).unwrap();
        check(found, sides, &gaps, false);
        assert_eq!(found.closed(), held);
        held_open += found.forces().iter().filter(|force| **force < 0.0).count();
        // In other units of length and force nothing but the units changes.
        let (length, force) = (1e4, 1e-7);
        let scaled = |x: &[f64], by: f64| x.iter().map(|x| x * by).collect::<Vec<_>>();
        let units = [0, 1].map(|s| (scaled(&free[s], length), scaled(&f[s], length / force)));
        let sides = [0, 1].map(|s| Side::new(&units[s].0, &units[s].1));
        let other = frame.solve(sides, &scaled(&gaps, length)).unwrap();
        let expected = reference.solve([0, 1].map(|s| Side::new(&free[s], &f[s])), &gaps).unwrap();
        assert_eq!(other.closed(), expected.closed());
        for (x, y) in other.forces().iter().zip(expected.forces()) {
            assert!((x / force - y).abs() < 1e-8 * (1.0 + y));
        }
    }
    assert!(pressed > 200 && pressed < 1200 && held_open > 100, "{pressed} pressed, {held_open} pulled");
}

#[test]
fn bodies_in_a_row_alternate() {
    // Masses 1, 2, 4 in a row: the outer ones are the first side, with the normal of the second contact toward the
    // middle.
    let (mass, v) = ([1.0, 2.0, 4.0], [3.0, 0.0, -1.0]);
    let (free, flexibility) = ([v[0], -v[2]], [1.0 / mass[0], 0.0, 0.0, 1.0 / mass[2]]);
    let first = Side::new(&free, &flexibility);
    // Seen along the second normal the middle mass moves the other way.
    let middle = [v[1], -v[1]];
    let second = Side::new(&middle, &[0.5, -0.5, -0.5, 0.5]);
    let mut frame = Frame::<f64>::new(2).unwrap();
    let found = frame.hold([first, second], &[0.0; 2], &[true; 2]).unwrap();
    let common = mass.iter().zip(v).map(|(m, v)| m * v).sum::<f64>() / 7.0;
    assert!((found.positions()[0] - common).abs() < 1e-15 && (found.positions()[1] + common).abs() < 1e-15);
    let impulses = [mass[0] * (v[0] - common), mass[2] * (common - v[2])];
    assert!(found.forces().iter().zip(impulses).all(|(x, y)| (x - y).abs() < 1e-14));
}

#[test]
fn frames_refuse_what_is_no_interface() {
    let mut frame = Frame::<f64>::new(2).unwrap();
    let good = Side::new(&[0.0, 0.0], &[2.0, 1.0, 1.0, 2.0]);
    let mut refused = |side: Side<'_, f64>, gaps: &[f64]| frame.solve([good, side], gaps).map(|_| ()).unwrap_err();
    let short = Side::new(&[0.0], good.flexibility);
    assert!(matches!(refused(short, &[0.0; 2]), Error::Dimension { expected: 2, found: 1, .. }));
    let short = Side::new(good.free, &[1.0]);
    assert!(matches!(refused(short, &[0.0; 2]), Error::Dimension { expected: 4, found: 1, .. }));
    assert!(matches!(refused(good, &[0.0; 3]), Error::Dimension { expected: 2, found: 3, .. }));
    assert!(matches!(refused(good, &[0.0, f64::NAN]), Error::NotFinite { index: 1, .. }));
    let open = Side::new(&[f64::INFINITY, 0.0], good.flexibility);
    assert!(matches!(refused(open, &[0.0; 2]), Error::NotFinite { index: 0, .. }));
    let one_sided = Side::new(good.free, &[2.0, 1.0, -1.0, 2.0]);
    assert!(matches!(refused(one_sided, &[0.0; 2]), Error::Asymmetric { matrix: "flexibility", .. }));
    let wrong_sign = Side::new(good.free, &[2.0, 0.0, 0.0, -1.0]);
    assert!(matches!(refused(wrong_sign, &[0.0; 2]), Error::Singular { dof: 1, .. }));
    // Between rigid sides nothing gives way.
    let rigid = Side::new(&[0.0, 0.0], &[0.0; 4]);
    let found = frame.solve([rigid; 2], &[0.1, -0.1]).map(|_| ()).unwrap_err();
    let failure = |failure: &ContactFailure<f64>| matches!(failure, ContactFailure::NotConverged { row: 1, .. });
    assert!(matches!(&found, Error::Frame { failure: found } if failure(found)), "{found:?}");
    assert!(found.is_recoverable() && found.to_string().contains("frame"));
    assert!(frame.hold([good; 2], &[0.0; 2], &[true]).is_err());
    // The frame can be used again.
    assert_eq!(frame.solve([good; 2], &[0.1; 2]).unwrap().closed(), [false; 2]);
    assert_eq!(frame.solve([good; 2], &[0.0; 2]).unwrap().closed(), [true; 2]);
}
