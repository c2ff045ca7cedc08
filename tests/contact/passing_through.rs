//! Fast nodes against obstacles and facets: a step stops them where they meet the surface, or is refused; nothing
//! passes.
#![allow(clippy::float_cmp)] // unchanged values are meant exactly

use contact_dynamics::contact::{Cylinder, Obstacle, Plane, Side, Sphere, SurfaceSettings};
use contact_dynamics::{
    ContactConstraint, ContactLaw, Error, LinearSystem, Newmark, NodesOnObstacle, PersistencyCorrection, Simulation,
    StepControl,
};
use contact_dynamics_scenes::sparse::free;
use contact_dynamics_scenes::vectors::{along, dot};

/// Largest error of the energy after the impact, over that before, and of the place, over the way of a step.
const ENERGY: f64 = 0.12;

/// Whether the run may choose its steps.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Steps {
    Fixed,
    Controlled,
}

/// What a straight flight should meet: the time, and the normal there (of the frame in which the surface rests).
type Meeting<const D: usize> = Option<(f64, [f64; D])>;

/// A particle and further dofs that are held.
fn particle<const D: usize>(held: usize) -> LinearSystem<'static, f64> {
    let n = D + held;
    (D..n).fold(free(&vec![1.0; n]), |system, dof| system.fix(dof).unwrap())
}

/// Flies until the particle has met something, or for the time given. What it does against a surface that moves with
/// `drift` must be right, or the step refused; the energy, if no edge is as near as two steps.
#[allow(clippy::too_many_arguments)]
fn fly<const D: usize>(
    what: &str,
    contact: impl ContactConstraint<f64>,
    held: usize,
    start: [f64; D],
    v: [f64; D],
    drift: [f64; D],
    (h, duration): (f64, f64),
    (meeting, edge): (Meeting<D>, f64),
    steps: Steps,
) -> Result<(), Error> {
    let mut velocity = vec![0.0; D + held];
    velocity[..D].copy_from_slice(&along(v, 1.0, drift));
    let builder = Simulation::builder(particle::<D>(held), Newmark::trapezoidal(), h)
        .velocity(velocity)
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection());
    let builder = match steps {
        Steps::Fixed => builder,
        Steps::Controlled => builder.step_control(StepControl::halving(h * 1e-9).unwrap()),
    };
    let mut run = builder.build().unwrap();
    let speed = dot(v, v).sqrt();
    while run.time() < duration {
        let before = run.time();
        run.step()?;
        let (t, h) = (run.time(), run.time() - before);
        let own = |x: &[f64]| std::array::from_fn::<_, D, _>(|k| x[k]);
        let u = along(own(run.state().displacement()), -t, drift);
        let w = along(own(run.state().velocity()), -1.0, drift);
        let place = along(start, 1.0, u);
        if run.state().contacts().closed().contains(&true) {
            let Some((time, normal)) = meeting else { panic!("{what}: stopped at {place:?}, where nothing is") };
            // At an edge the normal is that of the edge.
            let sharp = edge < 2.0 * speed * h;
            let slack = if sharp { 1.5 } else { 1.0 };
            assert!(
                t >= time - 1e-9 * duration - slack * h && before <= time + slack * h,
                "{what}: {before} {t}, not {time}"
            );
            let lost = 1.0 - dot(w, w) / (speed * speed);
            let exact = (dot(normal, v) / speed).powi(2);
            assert!((lost - exact).abs() < ENERGY || sharp, "{what}: {lost} of the energy lost, not {exact}");
            // It is near where it met the surface, and along the normal there.
            let off = along(place, -1.0, along(start, time, v));
            assert!(dot(off, off).sqrt() <= (1.0 + slack) * speed * h, "{what}: {off:?}");
            assert!(dot(off, normal).abs() <= slack * speed * h, "{what}: {off:?}");
            return Ok(());
        }
        // Still in flight.
        assert!(dot(along(w, -1.0, v), along(w, -1.0, v)).sqrt() < 1e-9 * speed, "{what}: {w:?} instead of {v:?}");
        if let Some((time, normal)) = meeting {
            // Grazing impacts may be missed: a sixteenth of the energy. So may edges that a step cuts.
            let steep = dot(normal, v).abs() / speed;
            assert!(
                t <= time + 1.01 * h || steep < 0.26 || edge < speed * h,
                "{what}: missed at {time} (it is {t}), {steep}"
            );
        }
    }
    Ok(())
}

/// Results of a sweep.
#[derive(Debug, Default)]
struct Tally {
    right: usize,
    refused: usize,
}

impl Tally {
    fn count(&mut self, what: &str, result: Result<(), Error>) {
        match result {
            Ok(()) => self.right += 1,
            // (A row that turns from one side of a body to the other and back does not stand still.)
            Err(error @ (Error::PassedThrough { .. } | Error::ContactLost { .. } | Error::ContactUnsettled { .. })) => {
                assert!(error.is_recoverable());
                self.refused += 1;
            }
            Err(other) => panic!("{what}: {other}"),
        }
    }
}

/// Ways in a step over the size of what is met: 0.01 to 100 in factors of 3.
fn ratios() -> impl Iterator<Item = f64> {
    (0..9).map(|k| 0.01 * 3_f64.powi(k)).chain([100.0])
}

/// The first meeting with a ball around the origin of a flight that starts outside, or inside of a hollow one.
fn with_ball<const D: usize>(
    start: [f64; D],
    v: [f64; D],
    across: impl Fn([f64; D]) -> [f64; D],
    side: Side,
) -> Meeting<D> {
    let (r, w) = (across(start), across(v));
    let (a, b, c) = (dot(w, w), dot(r, w), dot(r, r) - 1.0);
    let root = b * b - a * c;
    if root <= 0.0 {
        return None;
    }
    let time = match side {
        Side::Outside => (-b - root.sqrt()) / a,
        Side::Inside => (-b + root.sqrt()) / a,
    };
    (time > 0.0).then(|| (time, along(r, time, w)))
}

/// A slab of this half thickness across the first axis, of which the crate knows the distance only.
struct Slab(f64);

impl<const D: usize> Obstacle<f64, D> for Slab {
    fn distance(&self, x: [f64; D]) -> (f64, [f64; D]) {
        let sign = if x[0] < 0.0 { -1.0 } else { 1.0 };
        (x[0].abs() - self.0, std::array::from_fn(|k| if k == 0 { sign } else { 0.0 }))
    }
}

/// All flights at an obstacle: offsets from its middle, phases of the impact, ways in a step, reaches, obstacles that
/// move.
fn sweep<const D: usize, O: Obstacle<f64, D> + 'static>(
    name: &str,
    side: Side,
    make: impl Fn() -> O,
    exact: impl Fn([f64; D], [f64; D]) -> Meeting<D>,
) -> Tally {
    let mut tally = Tally::default();
    for steps in [Steps::Fixed, Steps::Controlled] {
        for (ratio, offset, phase) in ratios().flat_map(|ratio: f64| {
            [0.0, 0.3, 0.7, 0.9, 1.3].into_iter().flat_map(move |b| [0.13, 0.5, 0.91].map(|phase| (ratio, b, phase)))
        }) {
            for (reach, drifts) in [(None, false), (Some(0.1), false), (None, true), (Some(0.1), true)] {
                let v = std::array::from_fn(|k| if k == 0 { ratio } else { 0.0 });
                let mut start = [0.0; D];
                // Some way before the surface; inside of hollow bodies, near the middle.
                start[0] = match side {
                    Side::Outside => -1.8 - ratio.max(0.1) * (1.0 + phase),
                    Side::Inside => -0.6 * phase,
                };
                start[D - 1] = if side == Side::Inside { 0.6 * offset } else { offset };
                let drift: [f64; D] =
                    if drifts { std::array::from_fn(|k| [0.7, -0.4, 0.2][k] * ratio) } else { [0.0; D] };
                let dofs: [usize; D] = std::array::from_fn(|k| k);
                let contact = NodesOnObstacle::new(make(), &[start], &[dofs], &[0]).unwrap();
                let contact = contact.moving(move |t| [drift.map(|v| v * t), drift, [0.0; D]]);
                let contact = match reach {
                    Some(reach) => contact.reach(reach).unwrap(),
                    None => contact,
                };
                let what = format!("{name}, way {ratio:.2}, {offset}, {phase}, reach {reach:?}, {drifts}, {steps:?}");
                let duration = (2.0 * start[0].abs() + 3.0) / ratio + 2.0;
                let result =
                    fly(&what, contact, 0, start, v, drift, (1.0, duration), (exact(start, v), f64::INFINITY), steps);
                if steps == Steps::Controlled {
                    assert!(result.is_ok(), "{what}: {}", result.unwrap_err());
                }
                tally.count(&what, result);
            }
        }
    }
    println!("{name}: {tally:?}");
    assert!(tally.right > tally.refused, "{name}: {tally:?}");
    tally
}

#[test]
fn no_node_passes_through_an_obstacle() {
    for side in [Side::Outside, Side::Inside] {
        let tally =
            sweep("disc", side, || Sphere::new([0.0; 2], 1.0, side).unwrap(), |x, v| with_ball(x, v, |x| x, side));
        assert!(tally.refused > 0);
        sweep("ball", side, || Sphere::new([0.0; 3], 1.0, side).unwrap(), |x, v| with_ball(x, v, |x| x, side));
        // The axis leans, so that ways go along it as well.
        let axis = [0.6, 0.8, 0.0];
        let across = move |x: [f64; 3]| along(x, -dot(x, axis), axis);
        let make = || Cylinder::new([0.0; 3], axis, 1.0, side).unwrap();
        sweep("cylinder", side, make, |x, v| with_ball(x, v, across, side));
    }
    // (The flight is at right angles, or nearly so, or along it.)
    let flat = |x: [f64; 2], v: [f64; 2]| Some(((-1.0 - x[0]) / v[0], [-1.0, 0.0]));
    let tally = sweep("line", Side::Outside, || Plane::new([-1.0, 0.0], [-1.0, 0.0]).unwrap(), flat);
    assert_eq!(tally.refused, 0);
    let normal = [-0.8, 0.6, 0.0];
    let leaning =
        |x: [f64; 3], v: [f64; 3]| Some((-dot(along(x, 1.0, [0.9, 0.0, 0.0]), normal) / dot(v, normal), normal));
    let tally = sweep("plane", Side::Outside, || Plane::new([-0.9, 0.0, 0.0], normal).unwrap(), leaning);
    assert_eq!(tally.refused, 0);
    for half in [1.0, 0.01] {
        let slab = |x: [f64; 2], v: [f64; 2]| Some(((-half - x[0]) / v[0], [-1.0, 0.0]));
        sweep("slab", Side::Outside, || Slab(half), slab);
    }
}

#[test]
fn what_accelerates_into_a_body_out_of_reach_is_seen() {
    // At rest above a ball, and out of reach: no velocity tells that the step will lead into it.
    for gravity in [2.0, 3.0, 100.0] {
        let system = |_: f64, f: &mut [f64]| f.copy_from_slice(&[0.0, 0.0, -gravity]);
        let ball = Sphere::new([0.0, 0.0, -1.5], 1.0, Side::Outside).unwrap();
        let contact = NodesOnObstacle::new(ball, &[[0.0; 3]], &[[0, 1, 2]], &[0]).unwrap().reach(0.01).unwrap();
        let mut run = Simulation::builder(particle::<3>(0).load(system), Newmark::trapezoidal(), 1.0)
            .constraint(contact)
            .uncorrected()
            .build()
            .unwrap();
        let before = run.state().clone();
        let refused = run.step().unwrap_err();
        assert!(matches!(refused, Error::PassedThrough { t, h, .. } if t == 0.0 && h == 1.0), "{refused}");
        assert_eq!(run.state(), &before);
    }
}

#[test]
fn compliant_contacts_may_be_deep() {
    // A soft ball of radius 1 stops a mass that comes in by half of it, in 60 steps; the steps of the way out are as
    // many.
    let ball = Sphere::new([0.0; 3], 1.0, Side::Outside).unwrap();
    let contact = NodesOnObstacle::new(ball, &[[-1.1, 0.05, 0.0]], &[[0, 1, 2]], &[0]).unwrap();
    let contact = contact.with_law(ContactLaw::Penalty { stiffness: 4.0 });
    let mut run = Simulation::builder(particle::<3>(0), Newmark::trapezoidal(), 0.02)
        .velocity(vec![1.0, 0.0, 0.0])
        .constraint(contact)
        .uncorrected()
        .build()
        .unwrap();
    let mut deepest = 0.0_f64;
    while run.time() < 4.0 {
        run.step().unwrap();
        deepest = deepest.min(run.gaps()[0]);
    }
    assert!(deepest < -0.45, "{deepest}");
    let v = run.state().velocity();
    assert!((v.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 0.02 && v[0] < -0.8, "{v:?}");
}

#[cfg(feature = "mesh-contact")]
mod facets {
    use super::*;
    use contact_dynamics::contact::{Contacts, Facet, NodeToFacet, Stride};

    /// The first meeting with the box [0, size].
    fn with_box<const D: usize>(start: [f64; D], v: [f64; D], size: [f64; D]) -> Meeting<D> {
        let (mut enter, mut leave, mut normal) = (f64::NEG_INFINITY, f64::INFINITY, [0.0; D]);
        for k in 0..D {
            if v[k] == 0.0 {
                if start[k] <= 0.0 || start[k] >= size[k] {
                    return None;
                }
                continue;
            }
            let times = [-start[k] / v[k], (size[k] - start[k]) / v[k]];
            let [first, last] = if v[k] > 0.0 { times } else { [times[1], times[0]] };
            if first > enter {
                (enter, normal) = (first, std::array::from_fn(|i| if i == k { -v[k].signum() } else { 0.0 }));
            }
            leave = leave.min(last);
        }
        (enter > 0.0 && enter < leave).then_some((enter, normal))
    }

    /// Nodes and facets of the box [0, size], the edges of which are divided; node 0 is the particle.
    fn body<const D: usize>(start: [f64; D], size: [f64; D], triangles: bool) -> (Vec<[f64; D]>, Vec<Facet>) {
        let mut nodes = vec![start];
        let corner = |k: usize| std::array::from_fn::<f64, D, _>(|i| if k >> i & 1 == 1 { size[i] } else { 0.0 });
        if D == 2 {
            // Counter-clockwise, each side in four.
            let corners = [0, 1, 3, 2].map(corner);
            for side in 0..4 {
                let (from, to) = (corners[side], corners[(side + 1) % 4]);
                for part in 0..4 {
                    nodes.push(along(from, 0.25 * f64::from(part), along(to, -1.0, from)));
                }
            }
            return (nodes, (0..16).map(|k| Facet::from([1 + k, 1 + (k + 1) % 16])).collect());
        }
        nodes.extend((0..8).map(corner));
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let quads = quads.map(|quad| quad.map(|node| 1 + node));
        let facets = match triangles {
            false => quads.map(Facet::from).to_vec(),
            true => quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]].map(Facet::from)).collect(),
        };
        (nodes, facets)
    }

    fn sweep<const D: usize>(name: &str, size: [f64; D], triangles: bool) {
        let mut tally = Tally::default();
        for steps in [Steps::Fixed, Steps::Controlled] {
            for (ratio, aim, phase) in ratios().flat_map(|ratio: f64| {
                [0.37, 0.02, 0.97, 1.2]
                    .into_iter()
                    .flat_map(move |aim| [0.13, 0.5, 0.91].map(|phase| (ratio, aim, phase)))
            }) {
                for slope in [0.0, 0.4, 1.5] {
                    // The way in a step over the reach; the node comes from above, or aslant.
                    let reach = 0.2;
                    let mut v = [0.0; D];
                    (v[0], v[D - 1]) = (slope * ratio * reach, -ratio * reach);
                    let mut start: [f64; D] = std::array::from_fn(|k| if k == 0 { aim } else { 0.41 * size[k] });
                    start[D - 1] = size[D - 1];
                    start = along(start, -(0.7_f64 + phase).max(0.3 / ratio), v);
                    let meeting = with_box(start, v, size);
                    let near = |(time, _): (f64, [f64; D])| {
                        let x = along(start, time, v);
                        let mut depths: [f64; D] = std::array::from_fn(|k| x[k].min(size[k] - x[k]).abs());
                        depths.sort_by(f64::total_cmp);
                        depths[1]
                    };
                    let edge = meeting.map_or(f64::INFINITY, near);
                    let (nodes, facets) = body(start, size, triangles);
                    let dofs: Vec<[usize; D]> = (0..nodes.len()).map(|n| std::array::from_fn(|k| D * n + k)).collect();
                    let contact = NodeToFacet::one_pass(&nodes, &dofs, &[0], facets)
                        .unwrap()
                        .with(SurfaceSettings::new().reach(reach))
                        .unwrap();
                    let what = format!("{name}, way {ratio:.2}, {aim}, {phase}, slope {slope}, {steps:?}");
                    let duration = 2.0 * (0.7_f64 + phase).max(0.3 / ratio) + 3.0 / (ratio * reach);
                    let held = dofs.len() * D - D;
                    let result = fly(&what, contact, held, start, v, [0.0; D], (1.0, duration), (meeting, edge), steps);
                    if steps == Steps::Controlled {
                        assert!(result.is_ok(), "{what}: {}", result.unwrap_err());
                    }
                    tally.count(&what, result);
                }
            }
        }
        println!("{name}: {tally:?}");
        assert!(tally.right > tally.refused, "{name}: {tally:?}");
    }

    /// What is wrong with the straight way of a node in a step against a square at rest, whose row, if it has one, has
    /// these flags at its start and its end.
    fn look(unit: f64, law: ContactLaw, start: [f64; 2], way: [f64; 2], closed: [bool; 2]) -> Option<String> {
        let (nodes, facets) = body(start.map(|x| unit * x), [unit; 2], false);
        let dofs: Vec<[usize; 2]> = (0..nodes.len()).map(|n| [2 * n, 2 * n + 1]).collect();
        let contact = NodeToFacet::one_pass(&nodes, &dofs, &[0], facets).unwrap();
        let mut contact = contact.with(SurfaceSettings::new().reach(0.3 * unit)).unwrap().with_law(law);
        let own: Vec<usize> = contact.dofs().to_vec();
        let still = vec![0.0; own.len()];
        let end: Vec<f64> = own.iter().map(|&dof| if dof < 2 { unit * way[dof] } else { 0.0 }).collect();
        contact.search(0.0, &still, &end, 1.0).unwrap();
        let flags = closed.map(|closed| vec![closed; Contacts::of(&contact).len()]);
        match contact.inspect(&Stride::new([0.0, 1.0], [&still, &end], &end, [&flags[0], &flags[1]])) {
            Ok(()) => None,
            Err(Error::PassedThrough { what, .. }) => Some(what.to_owned()),
            Err(other) => panic!("{other}"),
        }
    }

    #[test]
    fn ways_against_a_square_are_judged_alike_in_any_unit() {
        for unit in [1e-3, 1.0, 1e3] {
            let rigid = |start, way, closed| look(unit, ContactLaw::Rigid, start, way, closed);
            let (open, stops) = ([false; 2], [false, true]);
            let is = |found: Option<String>, words: &str| found.is_some_and(|what| what.contains(words));
            // Up to the upper side, in from above as its row says, along it; through the square and out again.
            assert_eq!(rigid([0.4, 1.2], [0.0, -0.2], open), None);
            assert_eq!(rigid([0.4, 1.2], [0.0, -0.4], open), None);
            assert_eq!(rigid([0.4, 1.01], [0.5, 0.0], open), None);
            assert!(is(rigid([0.4, 1.2], [0.0, -1.5], open), "went through a facet"));
            assert!(is(rigid([0.4, 9.0], [0.0, -20.0], open), "went through a facet"));
            // Over a corner: far inside of it, and around it where the node was.
            assert!(is(rigid([0.7, 1.1], [0.4, -0.4], open), "went through a facet"));
            assert!(is(rigid([0.75, 1.15], [0.26, -0.46], open), "went through a facet"));
            assert_eq!(rigid([0.9, 1.01], [0.11, -0.11], open), None);
            // Stopped at the side, above it, where another side is.
            for (down, right) in [(0.2, true), (0.19, true), (0.21, true), (0.16, false), (0.1, false)] {
                let found = rigid([0.4, 1.2], [0.2, -down], stops);
                assert!(if right { found.is_none() } else { is(found, "away from the surface") }, "{unit} {down}");
            }
            assert!(is(rigid([0.9, 1.1], [0.1, -0.2], stops), "along a normal"));
            // A spring lets nodes in, and back out, not through the body.
            let soft = |start, way| look(unit, ContactLaw::Penalty { stiffness: 1.0 }, start, way, open);
            assert_eq!(soft([0.4, 0.95], [0.0, -0.35]), None);
            assert_eq!(soft([0.4, 0.95], [0.0, 0.3]), None);
            assert!(is(soft([0.4, 0.95], [0.0, -0.9]), "went through the body that it was in"));
        }
    }

    /// A triangle ends where it ends: a node that goes down beside it has not gone through.
    #[test]
    fn ways_beside_a_triangle_do_not_go_through_it() {
        for (place, meets) in [([0.2, 0.3], true), ([0.45, 0.45], true), ([0.8, 0.8], false), ([0.6, 0.6], false)] {
            let [x, y] = place;
            let nodes = [[x, y, 0.2], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
            let dofs: Vec<[usize; 3]> = (0..4).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
            let contact = NodeToFacet::one_pass(&nodes, &dofs, &[0], [[1, 2, 3]]).unwrap();
            let mut contact = contact.with(SurfaceSettings::new().reach(0.1)).unwrap();
            let own: Vec<usize> = contact.dofs().to_vec();
            let still = vec![0.0; own.len()];
            let end: Vec<f64> = own.iter().map(|&dof| if dof == 2 { -1.2 } else { 0.0 }).collect();
            // (Nothing promises that it moves: it has no row.)
            contact.search(0.0, &still, &still, 1.0).unwrap();
            assert!(Contacts::of(&contact).is_empty());
            let looked = contact.inspect(&Stride::new([0.0, 1.0], [&still, &end], &end, [&[], &[]]));
            assert_eq!(matches!(looked, Err(Error::PassedThrough { .. })), meets, "{place:?}: {looked:?}");
        }
    }

    #[test]
    fn no_node_passes_through_facets() {
        sweep("square", [1.0, 1.0], false);
        sweep("thin strip", [1.0, 0.02], false);
        sweep("cube", [1.0, 1.0, 1.0], false);
        sweep("cube of triangles", [1.0, 1.0, 1.0], true);
        sweep("thin plate", [1.0, 1.0, 0.02], true);
    }
}
