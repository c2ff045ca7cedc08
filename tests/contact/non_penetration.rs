//! The certificate of non-penetration: motions of two facets beside sampled distances, thin walls, units, runs.

use contact_dynamics::contact::{BodyContact, ContactConstraint, Facet, NodeToFacet, NonPenetration, Stride, Surface};
use contact_dynamics::{Error, GeneralizedAlpha, Result, Simulation, StepControl};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::vectors::{along, cross, dot, minus, norm};

type Point = [f64; 3];

fn to_segment(p: Point, [a, b]: [Point; 2]) -> f64 {
    let side = minus(b, a);
    let share = (dot(minus(p, a), side) / dot(side, side)).clamp(0.0, 1.0);
    norm(minus(p, along(a, share, side)))
}

fn between_segments(e: [Point; 2], f: [Point; 2]) -> f64 {
    let (d, g, r) = (minus(e[1], e[0]), minus(f[1], f[0]), minus(e[0], f[0]));
    let (a, b, c) = (dot(d, d), dot(d, g), dot(g, g));
    let determinant = a * c - b * b;
    let s = (b * dot(g, r) - c * dot(d, r)) / determinant;
    let t = (a * dot(g, r) - b * dot(d, r)) / determinant;
    let inside = [s, t].iter().all(|share| (0.0..=1.0).contains(share));
    let inner = if inside { norm(minus(along(e[0], s, d), along(f[0], t, g))) } else { f64::INFINITY };
    let ends = [to_segment(e[0], f), to_segment(e[1], f), to_segment(f[0], e), to_segment(f[1], e)];
    ends.into_iter().fold(inner, f64::min)
}

fn to_triangle(p: Point, [a, b, c]: [Point; 3]) -> f64 {
    let normal = cross(minus(b, a), minus(c, a));
    let foot = along(p, -dot(normal, minus(p, a)) / dot(normal, normal), normal);
    let inside = [[a, b], [b, c], [c, a]].iter().all(|&[x, y]| dot(normal, cross(minus(y, x), minus(foot, x))) >= 0.0);
    let inner = if inside { norm(minus(p, foot)) } else { f64::INFINITY };
    [[a, b], [b, c], [c, a]].into_iter().fold(inner, |least, side| least.min(to_segment(p, side)))
}

/// Whether a segment goes through a triangle.
fn pierces([p, q]: [Point; 2], [a, b, c]: [Point; 3]) -> bool {
    let volume = |x: Point, y: Point, z: Point, w: Point| dot(minus(y, x), cross(minus(z, x), minus(w, x)));
    let sides = [volume(p, a, b, c), volume(q, a, b, c)];
    let turns = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
    sides[0] * sides[1] < 0.0 && (turns.iter().all(|x| *x > 0.0) || turns.iter().all(|x| *x < 0.0))
}

/// The distance of two triangles; zero if they intersect.
fn between_triangles(one: [Point; 3], other: [Point; 3]) -> f64 {
    let sides = |t: [Point; 3]| [0, 1, 2].map(|k| [t[k], t[(k + 1) % 3]]);
    let meets = |t: [Point; 3], of: [Point; 3]| sides(t).iter().any(|&side| pierces(side, of));
    if meets(one, other) || meets(other, one) {
        return 0.0;
    }
    let edges = sides(one).into_iter().flat_map(|e| sides(other).map(|f| between_segments(e, f)));
    let corners = one.map(|p| to_triangle(p, other)).into_iter().chain(other.map(|p| to_triangle(p, one)));
    edges.chain(corners).fold(f64::INFINITY, f64::min)
}

/// The distance of the hulls of two facets that are not inside of each other, by the faces of the hulls.
fn between(one: &[Point], other: &[Point]) -> f64 {
    let faces = |x: &[Point]| -> Vec<[Point; 3]> {
        let all = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
        all[..if x.len() == 4 { 4 } else { 1 }].iter().map(|face| face.map(|k| x[k])).collect()
    };
    let pairs = faces(one).into_iter().flat_map(|a| faces(other).into_iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| between_triangles(a, b)).fold(f64::INFINITY, f64::min)
}

/// The certificate of a motion of two facets with these numbers of corners: a lower bound of their distance.
fn certified(counts: [usize; 2], x: &[Point], u: &[f64]) -> Result<Option<f64>> {
    let dofs: Vec<[usize; 3]> = (0..x.len()).map(|node| [0, 1, 2].map(|axis| 3 * node + axis)).collect();
    let facet = |first: usize, count: usize| match count {
        3 => Facet::from([first, first + 1, first + 2]),
        _ => Facet::from([first, first + 1, first + 2, first + 3]),
    };
    let mut check = NonPenetration::new(x, &dofs, [facet(0, counts[0]), facet(counts[0], counts[1])])?.depth(0.0)?;
    let zeros = vec![0.0; u.len()];
    let certificate = check.certificate();
    check.search(0.0, &zeros, &zeros, 1.0)?;
    let result = check.inspect(&Stride::new([0.0, 1.0], [&zeros, u], &zeros, [&[], &[]]));
    assert_eq!([certificate.steps(), certificate.rejected()], if result.is_ok() { [1, 0] } else { [0, 1] });
    match result {
        Ok(()) => Ok(Some(certificate.distance())),
        Err(Error::NotCertified { facets: [0, 1], .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Corners of a flat or nearly flat facet about a point.
fn facet(count: usize, at: Point, random: &mut Congruential) -> Vec<Point> {
    let axes: [Point; 2] = std::array::from_fn(|_| std::array::from_fn(|_| random.signed()));
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    corners[..count]
        .iter()
        .map(|[s, t]| {
            let exact = along(along(at, *s, axes[0]), *t, axes[1]);
            exact.map(|x| x + 0.1 * random.signed())
        })
        .collect()
}

/// Certified distances are lower bounds of sampled ones; facets that intersect on the way are found, and facets that
/// stay well apart are certified. In units from 1e-6 to 1e6, and far from the origin.
#[test]
fn two_facets_in_motion() {
    const SAMPLES: usize = 200;
    let (mut accepted, mut rejected, mut sharp) = (0, 0, 0.0_f64);
    for seed in 0..3000 {
        let mut random = Congruential(seed);
        let counts = [3 + (seed % 2) as usize, 3 + (seed / 2 % 2) as usize];
        let apart = [1.0, 2.0, 4.0][(seed % 3) as usize];
        let mut x = facet(counts[0], [0.0; 3], &mut random);
        x.extend(facet(counts[1], std::array::from_fn(|_| apart * random.signed()), &mut random));
        let swing = [0.1, 1.0, 6.0][(seed / 3 % 3) as usize];
        let common: Vec<Point> = (0..2).map(|_| std::array::from_fn(|_| swing * random.signed())).collect();
        let u: Vec<Point> = (0..x.len())
            .map(|node| common[usize::from(node >= counts[0])].map(|u| u + 0.3 * swing * random.signed()))
            .collect();
        let at = |share: f64| {
            let moved: Vec<Point> = x.iter().zip(&u).map(|(x, u)| along(*x, share, *u)).collect();
            between(&moved[..counts[0]], &moved[counts[0]..])
        };
        let sampled = (0..=SAMPLES).map(|k| at(k as f64 / SAMPLES as f64)).fold(f64::INFINITY, f64::min);
        let fastest = u.iter().fold(0.0, |most: f64, u| most.max(norm(*u)));
        // Between samples corners of both facets move by this much.
        let between_samples = fastest / SAMPLES as f64;
        if at(0.0) == 0.0 {
            continue;
        }
        for (unit, offset) in [(1.0, 0.0), (1e6, 0.0), (1e-6, 0.0), (1.0, 1e6)] {
            let places: Vec<Point> = x.iter().map(|x| x.map(|x| unit * x + offset)).collect();
            let ways: Vec<f64> = u.iter().flatten().map(|u| unit * u).collect();
            let found = certified(counts, &places, &ways);
            if matches!(found, Err(Error::InvertedFacet { .. })) {
                continue;
            }
            let Some(distance) = found.unwrap() else {
                rejected += 1;
                assert!(sampled <= between_samples + 1e-8, "seed {seed}, {unit}, {offset}: {sampled}");
                continue;
            };
            accepted += 1;
            // Facets whose boxes do not meet on the way are not compared.
            let bound = if distance.is_finite() { distance / unit } else { 0.0 };
            assert!(sampled > 0.0 && sampled >= bound - 1e-8, "seed {seed}: {sampled} < {bound}");
            sharp = sharp.max(bound / sampled);
        }
    }
    assert!(accepted > 8000 && rejected > 1000 && sharp > 0.999, "{accepted}, {rejected}, {sharp}");
}

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// A ball of a few elements shot at a wall of one element, thinner than its way in a step.
fn shot(h: f64, offset: f64) -> Result<(f64, usize)> {
    let wall = Solid::block([2.0, 2.0, 0.05], [4, 4, 1], MATERIAL).moved([-1.0, -1.0, 0.0]);
    let bullet = Solid::block([0.3, 0.3, 0.3], [2, 2, 2], MATERIAL);
    let bodies = wall.with(bullet.moved([-0.1 + 0.02, -0.1, 0.25])).moved([offset, -offset, offset]);
    let first = bodies.nodes.len() - 27;
    let velocity: Vec<f64> =
        (0..bodies.dofs()).map(|dof| if dof / 3 >= first && dof % 3 == 2 { -0.1 } else { 0.0 }).collect();
    let surface = Surface::of_cells(&bodies.nodes, &bodies.elements)?;
    let check = NonPenetration::new(&bodies.nodes, &bodies.node_dofs(), &surface)?;
    let certificate = check.certificate();
    let contact = BodyContact::of_itself(&bodies.nodes, &bodies.node_dofs(), &surface)?;
    let builder = Simulation::builder(bodies.system::<f64>(), GeneralizedAlpha::default(), h).velocity(velocity);
    let builder = builder.constraint(check);
    let mut run =
        builder.constraints(contact.constraints()?).step_control(StepControl::halving(h / 1024.0)?).build()?;
    let start = run.energy().total();
    run.run_until(6.0, &mut ())?;
    assert!(run.energy().total() <= 1.001 * start);
    let lowest = run.state().displacement().iter().skip(3 * first + 2).step_by(3).fold(f64::INFINITY, |l, u| l.min(*u));
    Ok((lowest, certificate.rejected()))
}

#[test]
fn a_bullet_stays_before_a_wall_of_one_element() {
    for h in [0.1, 0.5, 2.0] {
        let (lowest, rejected) = shot(h, 0.0).unwrap();
        // It has come to the wall, and pushes it.
        assert!(lowest < -0.2 && lowest > -0.4, "{h}: {lowest}");
        assert_eq!(rejected, shot(h, 100.0).unwrap().1);
    }
}

/// Contact of one pass leaves nodes of the master free to enter: the certificate stops the run.
#[test]
fn what_contact_leaves_out_is_found() {
    let lower = Solid::rectangle([1.0, 0.4], [1, 1], MATERIAL);
    let upper = Solid::rectangle([4.0, 0.4], [1, 1], MATERIAL).moved([-1.5, 0.45]);
    let bodies = lower.with(upper);
    let surface = Surface::of_cells(&bodies.nodes, &bodies.elements).unwrap();
    let run = |slave: &[usize]| -> Result<f64> {
        let facets: Vec<Facet> = surface.facets().to_vec();
        let master = facets
            .iter()
            .copied()
            .filter(|facet| facet.nodes().iter().all(|node| (node / 4 == 0) != (slave[0] / 4 == 0)));
        let contact = NodeToFacet::one_pass(&bodies.nodes, &bodies.node_dofs(), slave, master)?;
        let check = NonPenetration::new(&bodies.nodes, &bodies.node_dofs(), &surface)?;
        let certificate = check.certificate();
        let velocity = (0..16).map(|dof| if dof >= 8 && dof % 2 == 1 { -0.1 } else { 0.0 }).collect();
        let mut run = Simulation::builder(bodies.system::<f64>(), GeneralizedAlpha::default(), 0.05)
            .velocity(velocity)
            .constraint(contact)
            .constraint(check)
            .step_control(StepControl::halving(1e-3)?)
            .build()?;
        run.run_until(2.0, &mut ())?;
        Ok(certificate.distance())
    };
    assert!(run(&[2, 3]).unwrap() > 0.0);
    let refused = run(&[4, 5]).unwrap_err();
    let Error::StepRefused { source, .. } = refused else { panic!("{refused}") };
    assert!(matches!(*source, Error::NotCertified { constraint: 1, .. }), "{source}");
}

#[test]
fn overlaps_and_depths_are_checked() {
    let block = Solid::rectangle([1.0, 0.1], [2, 1], MATERIAL);
    let check = |bodies: &Solid<2>, depth: Option<f64>| -> Result<()> {
        let surface = Surface::of_cells(&bodies.nodes, &bodies.elements)?;
        let mut check = NonPenetration::new(&bodies.nodes, &bodies.node_dofs(), &surface)?;
        if let Some(depth) = depth {
            check = check.depth(depth)?;
        }
        let zeros = vec![0.0; bodies.dofs()];
        check.search(0.0, &zeros, &zeros, 0.0).map(|_| ())
    };
    let at = |gap: f64| block.clone().with(block.clone().moved([0.3, 0.1 + gap]));
    check(&at(0.0), None).unwrap();
    // A twentieth of 0.1 on either side, at corners as well.
    check(&at(-0.0099), None).unwrap();
    let error = check(&at(-0.0101), None).unwrap_err();
    assert!(matches!(&error, Error::Incompatible { part, .. } if part.contains("facets")), "{error}");
    check(&at(-0.011), Some(0.006)).unwrap();
    // Deeper than half of the plate.
    check(&block, Some(0.049)).unwrap();
    assert!(check(&block, Some(0.051)).is_err());
    for wrong in [-1e-9, f64::NAN, f64::INFINITY] {
        assert!(matches!(check(&block, Some(wrong)), Err(Error::Parameter { .. })));
    }
}
