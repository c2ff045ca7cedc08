//! Thin and hollow bodies: facets are met from outside, not through the material of the bodies, however far a
//! constraint looks.

use contact_dynamics::contact::{BodyContact, ContactConstraint, Contacts, NodeToFacet, Surface, SurfaceSettings};
use contact_dynamics::{PersistencyCorrection, Simulation};
use contact_dynamics_scenes::schemes::{self, Listed};
use contact_dynamics_scenes::solids::{Material, Solid};

const MATERIAL: Material = Material { young: 100.0, poisson: 0.0, density: 1.0 };

type Constraints = Vec<Box<dyn ContactConstraint<f64>>>;

fn of_itself<const D: usize>(solid: &Solid<D>, reach: f64) -> [(&'static str, Constraints); 2] {
    let (nodes, dofs) = (&solid.nodes, solid.node_dofs());
    let surface = Surface::of_cells(nodes, &solid.elements).unwrap();
    let facets =
        NodeToFacet::of_itself(nodes, &dofs, &surface).unwrap().with(SurfaceSettings::new().reach(reach)).unwrap();
    let bodies =
        BodyContact::of_itself(nodes, &dofs, &surface).unwrap().with(SurfaceSettings::new().reach(reach)).unwrap();
    [("nodes of itself", vec![Box::new(facets)]), ("bodies of itself", bodies.constraints().unwrap())]
}

fn between<const D: usize>([one, other]: [Solid<D>; 2], reach: f64) -> [(&'static str, Constraints); 4] {
    let first = one.elements.len();
    let pair = one.with(other);
    let (nodes, dofs) = (&pair.nodes, pair.node_dofs());
    let [one, other] =
        [&pair.elements[..first], &pair.elements[first..]].map(|cells| Surface::of_cells(nodes, cells).unwrap());
    let facets =
        NodeToFacet::new(nodes, &dofs, &one, &other).unwrap().with(SurfaceSettings::new().reach(reach)).unwrap();
    let bodies =
        BodyContact::new(nodes, &dofs, &one, &other).unwrap().with(SurfaceSettings::new().reach(reach)).unwrap();
    let [nodes, body] = of_itself(&pair, reach);
    [("nodes", vec![Box::new(facets)]), ("bodies", bodies.constraints().unwrap()), nodes, body]
}

/// The gaps that each constraint of a list finds in the reference configuration, looking as far ahead as bodies move
/// by `way`.
fn gaps(constraints: &mut Constraints, way: f64) -> Vec<Vec<f64>> {
    let found = constraints.iter_mut().map(|contact| {
        let zeros = vec![0.0; contact.dofs().len()];
        let velocity: Vec<f64> = contact.dofs().iter().map(|dof| if dof % 2 == 0 { way } else { -way }).collect();
        contact.search(0.0, &zeros, &velocity, 1.0).unwrap();
        let mut gaps = vec![0.0; Contacts::of(&**contact).len()];
        contact.gaps(0.0, &zeros, &mut gaps).unwrap();
        gaps
    });
    found.collect()
}

fn lowest(gaps: &[Vec<f64>]) -> f64 {
    gaps.iter().flatten().copied().fold(f64::INFINITY, f64::min)
}

/// Two sheets of one element through the thickness, the second one `gap` above the first.
fn sheets(thickness: f64, gap: f64) -> [Solid<2>; 2] {
    let sheet = |cells: usize| Solid::rectangle([1.0, thickness], [cells, 1], MATERIAL);
    [sheet(10), sheet(8).moved([0.03, thickness + gap])]
}

/// The same in space, turned against each other.
fn plates(thickness: f64, gap: f64) -> [Solid<3>; 2] {
    let plate =
        |cells: usize| Solid::block([1.0, 1.0, thickness], [cells, cells, 1], MATERIAL).moved([-0.5, -0.5, 0.0]);
    [plate(5), plate(4).rotated([0.0, 0.0, 1.0], 0.4).moved([0.1, 0.0, thickness + gap])]
}

const THICKNESSES: [f64; 5] = [1.0, 0.1, 1e-2, 1e-3, 1e-4];
const REACHES: [f64; 4] = [1e-3, 0.06, 0.3, 2.0];

#[test]
fn sheets_meet_by_the_sides_that_face_each_other() {
    let check = |name: &str, scene: [f64; 4], found: &[Vec<f64>]| {
        let [_, gap, reach, _] = scene;
        let least = lowest(found);
        assert!(least > gap - 1e-12, "{name}, {scene:?}: {least}");
        // Each list of nodes on facets, and the weighted gaps, see the sides that are near enough.
        assert!(reach < gap || least < gap + 1e-12, "{name}, {scene:?}: {least}");
    };
    for thickness in THICKNESSES {
        for gap in [0.05, 1e-4] {
            for reach in REACHES {
                for way in [0.0, 3.0] {
                    let scene = [thickness, gap, reach, way];
                    for (name, mut constraints) in between(sheets(thickness, gap), reach) {
                        check(name, scene, &gaps(&mut constraints, way));
                    }
                    for (name, mut constraints) in between(plates(thickness, gap), reach) {
                        check(name, scene, &gaps(&mut constraints, way));
                    }
                }
            }
        }
    }
}

#[test]
fn sheets_in_each_other_keep_their_rows() {
    for thickness in THICKNESSES {
        let depth = 0.3 * thickness.min(0.1);
        for reach in [0.05, 0.3, 2.0] {
            let scene = [thickness, reach];
            let plane = between(sheets(thickness, -depth), reach).map(|(name, mut list)| (name, gaps(&mut list, 0.0)));
            let space = between(plates(thickness, -depth), reach).map(|(name, mut list)| (name, gaps(&mut list, 0.0)));
            for (name, found) in plane.into_iter().chain(space) {
                let inside = found[0].iter().filter(|gap| (**gap + depth).abs() < 1e-12).count();
                assert!(inside > 8, "{name}, {scene:?}: {found:?}");
                // (At the rim of cubes what is behind two sides presses on their edge.)
                assert!(lowest(&found) > -1.2 * depth, "{name}, {scene:?}: {}", lowest(&found));
            }
        }
    }
}

/// A box of walls one element thick, its outer half sides.
fn hollow_box<const D: usize>(block: Solid<D>, outer: [f64; D], wall: f64) -> Solid<D> {
    // Of the grid from −1 to 1 by thirds the inner cells are left out, and the rest is drawn to the walls.
    let mut solid = block;
    let is_inner = |nodes: &Vec<usize>, of: &Solid<D>| {
        (0..D).all(|axis| {
            let middle = nodes.iter().map(|&node| of.nodes[node][axis]).sum::<f64>() / nodes.len() as f64;
            middle.abs() < 0.8
        })
    };
    let kept: Vec<Vec<usize>> = solid.elements.iter().filter(|nodes| !is_inner(nodes, &solid)).cloned().collect();
    solid.elements = kept;
    let drawn = |x: f64, outer: f64| if x.abs() > 0.9 { x * outer } else { x / 0.8 * (outer - wall) };
    solid.mapped(|x| std::array::from_fn(|axis| drawn(x[axis], outer[axis])))
}

/// A grid from −1 to 1 whose outer layer is a tenth thick, of `cells` besides it.
fn grid_2d(cells: usize) -> Solid<2> {
    let n = cells + 2;
    let place = |x: f64| graded(x, cells);
    Solid::rectangle([1.0; 2], [n; 2], MATERIAL).mapped(|x| x.map(place))
}

fn grid_3d(cells: usize) -> Solid<3> {
    let n = cells + 2;
    let place = |x: f64| graded(x, cells);
    Solid::block([1.0; 3], [n; 3], MATERIAL).mapped(|x| x.map(place))
}

fn graded(x: f64, cells: usize) -> f64 {
    let inside = (x * (cells + 2) as f64 - 1.0) / cells as f64;
    match inside {
        ..-1e-9 => -1.0,
        ..1.000_000_001 => 0.8 * (2.0 * inside - 1.0),
        _ => 1.0,
    }
}

#[test]
fn hollow_bodies_do_not_meet_their_own_walls() {
    let check = |what: &str, wall: f64, reach: f64, found: Vec<Vec<f64>>, across: f64| {
        // (Sides of a hollow that face each other across it may be within reach.)
        assert!(lowest(&found) > across, "{what}, wall {wall}, reach {reach}: {}", lowest(&found));
    };
    for wall in [0.5, 0.1, 1e-2, 1e-4] {
        for reach in REACHES {
            let plane = [
                ("ring", Solid::ring([1.0 - wall, 1.0], [1, 40], MATERIAL)),
                ("box", hollow_box(grid_2d(6), [1.0, 0.7], wall)),
            ];
            for (what, solid) in plane {
                for (name, mut list) in of_itself(&solid, reach) {
                    check(&format!("{what} {name}"), wall, reach, gaps(&mut list, 0.0), 0.1);
                }
            }
            let space = [
                ("tube", Solid::hoop([1.0 - wall, 1.0], 0.6, [1, 24, 3], MATERIAL)),
                ("box", hollow_box(grid_3d(4), [1.0, 0.7, 0.8], wall)),
            ];
            for (what, solid) in space {
                for (name, mut list) in of_itself(&solid, reach) {
                    check(&format!("{what} {name}"), wall, reach, gaps(&mut list, 0.0), 0.1);
                }
            }
        }
    }
}

#[test]
fn nested_bodies_meet_by_the_sides_that_face_each_other() {
    for wall in [0.2, 1e-2, 1e-4] {
        for reach in [0.05, 0.3, 2.0] {
            let gap = 0.04;
            let ring = |outer: f64, cells: usize| Solid::ring([outer - wall, outer], [1, cells], MATERIAL);
            for (name, mut list) in between([ring(1.0, 40), ring(1.0 - wall - gap, 40)], reach) {
                // (Weighted gaps see across the hollow as well.)
                if name == "bodies" && reach > 1.0 {
                    continue;
                }
                let found = gaps(&mut list, 0.0);
                let least = lowest(&found);
                assert!((least - gap).abs() < 0.1 * gap, "{name}, {wall}, {reach}: {least}");
            }
            let hollow = |outer: f64| hollow_box(grid_3d(4), [outer; 3], wall);
            for (name, mut list) in between([hollow(1.0), hollow(1.0 - wall - gap)], reach) {
                let found = gaps(&mut list, 0.0);
                let least = lowest(&found);
                assert!((least - gap).abs() < 1e-12, "{name}, {wall}, {reach}: {least}");
            }
        }
    }
}

/// What became of two bodies of which the second was thrown at the first.
#[derive(Clone, Copy, Debug)]
struct Thrown {
    /// Highest energy over that at the start.
    highest: f64,
    /// Their relative speed at the end, that at the start being −1.
    speed: f64,
    deepest: f64,
    /// Rows that press at the end.
    pressed: usize,
}

fn thrown(bodies: [Solid<2>; 2], scheme: &Listed, (reach, list): (f64, usize), (h, duration): (f64, f64)) -> Thrown {
    let split = 2 * bodies[0].nodes.len();
    let (_, constraints) = between(bodies.clone(), reach).into_iter().nth(list).unwrap();
    let [one, other] = bodies;
    let pair = one.with(other);
    let velocity = (0..pair.dofs()).map(|dof| if dof >= split && dof % 2 == 1 { -1.0 } else { 0.0 }).collect();
    let mass = pair.lumped_mass::<f64>();
    let builder = Simulation::builder(pair.system::<f64>(), (scheme.make)(), h);
    let builder = builder.velocity(velocity).constraints(constraints);
    let mut run = match scheme.takes_corrections() {
        true => builder.corrector(PersistencyCorrection::default()).build().unwrap(),
        false => builder.build().unwrap(),
    };
    let first = run.energy().total();
    let (mut highest, mut deepest) = (0.0_f64, 0.0_f64);
    while run.time() < duration {
        run.step().unwrap();
        highest = highest.max(run.energy().total() / first);
        deepest = run.gaps().iter().fold(deepest, |low, gap| low.min(*gap));
    }
    let mean = |dofs: std::ops::Range<usize>| {
        let weighted = dofs.clone().skip(1).step_by(2).map(|dof| mass[dof] * run.state().velocity()[dof]);
        weighted.sum::<f64>() / dofs.skip(1).step_by(2).map(|dof| mass[dof]).sum::<f64>()
    };
    let pressed = run.state().contacts().forces().iter().filter(|force| **force > 0.0).count();
    Thrown { highest, speed: mean(split..mass.len()) - mean(0..split), deepest, pressed }
}

#[test]
fn sheets_that_are_thrown_at_each_other_part() {
    let implicit = schemes::all().into_iter().filter(|scheme| scheme.radius.is_some());
    for scheme in implicit {
        for (thickness, h, duration) in [(0.1, 1e-3, 0.06), (1e-3, 1e-4, 0.02)] {
            for list in [0, 3] {
                // At phases of a step.
                for phase in [0.0, 0.4] {
                    let bodies = sheets(thickness, 0.01 + phase * h);
                    let found = thrown(bodies, &scheme, (0.125, list), (h, duration));
                    let Thrown { highest, speed, deepest, pressed } = found;
                    let scene = format!("{} {thickness} {list} {phase} {found:?}", scheme.name());
                    assert!(highest < 1.0 + 1e-9 && speed > 0.0 && pressed == 0, "{scene}");
                    // (Schemes that impose contact on velocities stop within a step.)
                    assert!(deepest > -1.01 * h, "{scene}");
                }
            }
        }
    }
}
