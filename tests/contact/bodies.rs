//! Bodies with faces, corners and edges: what keeps them apart, and how many constraints that takes.

use contact_dynamics::contact::{BodyContact, EdgeToEdge, Facet, Surface, SurfaceSettings};
use contact_dynamics::{Composite, Error, PersistencyCorrection, Simulation, StepControl};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::falls::{Fall, Keeps, Landing};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// A round body of segments or quadrilaterals, and a box below it.
fn over_a_box<const D: usize>(ball: Solid<D>, below: Solid<D>) -> BodyContact<f64, D> {
    Stack::of_whole_surfaces([below, ball]).bodies(true).unwrap()
}

#[test]
fn a_body_has_the_constraints_that_its_shape_asks_for() {
    let disc = || Solid::ring([0.2, 1.0], [2, 40], MATERIAL);
    let square = || Solid::rectangle([1.0; 2], [2; 2], MATERIAL).moved([0.0, -3.0]);
    // Of the square the four corners are sharp, of a disc with 40 sides nothing is.
    let contact = over_a_box(disc(), square());
    assert_eq!(contact.sharp_nodes().each_ref().map(Vec::len), [0, 4]);
    assert_eq!(contact.constraints().unwrap().len(), 2);
    assert_eq!(over_a_box(disc(), disc().moved([0.0, -3.0])).constraints().unwrap().len(), 1);
    assert_eq!(over_a_box(square(), square().moved([0.0, -3.0])).constraints().unwrap().len(), 3);
    // Of a cube all nodes on its twelve edges are.
    let cube = || Solid::block([1.0; 3], [3; 3], MATERIAL);
    let contact = over_a_box(cube(), cube().moved([0.0, 0.0, -3.0]));
    assert_eq!(contact.sharp_nodes().each_ref().map(Vec::len), [8 + 12 * 2; 2]);
    assert_eq!(contact.constraints().unwrap().len(), 4);
    // With a larger angle only what is sharper is: sides of a cube turn by a right angle.
    let right = std::f64::consts::FRAC_PI_2;
    let blunt =
        over_a_box(cube(), cube().moved([0.0, 0.0, -3.0])).with(SurfaceSettings::new().sharp(1.01 * right)).unwrap();
    assert_eq!((blunt.sharp_nodes().clone(), blunt.constraints().unwrap().len()), ([vec![], vec![]], 1));
}

#[test]
fn a_reentrant_corner_is_not_sharp() {
    // An L, walked with the body on the left: five convex corners, and one that is none.
    let coordinates =
        [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 3.0], [1.0, 3.0], [0.0, 4.0]];
    let dofs: Vec<[usize; 2]> = (0..9).map(|node| [2 * node, 2 * node + 1]).collect();
    let l = (0..6).map(|k| Facet::from([k, (k + 1) % 6]));
    let triangle = [[6, 7], [7, 8], [8, 6]].map(Facet::from);
    let contact = BodyContact::new(&coordinates, &dofs, l, triangle).unwrap();
    assert_eq!(contact.sharp_nodes(), &[vec![0, 1, 2, 4, 5], vec![6, 7, 8]]);
}

#[test]
fn a_surface_against_itself_has_nodes_and_edges() {
    let cubes =
        Solid::block([1.0; 3], [2; 3], MATERIAL).with(Solid::block([1.0; 3], [2; 3], MATERIAL).moved([0.0, 0.0, 1.1]));
    let of_itself = || {
        let surface = Surface::of_cells(&cubes.nodes, &cubes.elements).unwrap();
        BodyContact::of_itself(&cubes.nodes, &cubes.node_dofs(), &surface).unwrap()
    };
    assert_eq!(of_itself().sharp_nodes().each_ref().map(Vec::len), [2 * (8 + 12); 2]);
    assert_eq!(of_itself().constraints().unwrap().len(), 2);
    // What is not sharp has no edges.
    assert_eq!(of_itself().with(SurfaceSettings::new().sharp(1.6)).unwrap().constraints().unwrap().len(), 1);
    let square = Solid::rectangle([1.0; 2], [2; 2], MATERIAL);
    let surface = Surface::of_cells(&square.nodes, &square.elements).unwrap();
    let flat = BodyContact::of_itself(&square.nodes, &square.node_dofs(), &surface).unwrap();
    assert_eq!(flat.constraints().unwrap().len(), 1);
}

#[test]
fn edges_of_bodies_that_do_not_fold_do_not_meet_each_other() {
    let block = Solid::block([1.0; 3], [3; 3], MATERIAL);
    let plates = [1, 2].map(|layers| Solid::block([1.0, 1.0, 0.02], [6, 6, layers], MATERIAL));
    let wedge = Solid::block([1.0; 3], [4; 3], MATERIAL).mapped(|[x, y, z]| [x, y, z * (0.02 + 0.4 * x)]);
    for solid in plates.iter().chain([&block, &wedge]) {
        let surface = Surface::of_cells(&solid.nodes, &solid.elements).unwrap();
        for reach in [0.05, 0.3, 2.0] {
            let edges = EdgeToEdge::of_itself(&solid.nodes, &solid.node_dofs(), &surface).unwrap();
            let mut edges = edges.with(SurfaceSettings::new().reach(reach)).unwrap();
            let velocity: Vec<f64> = solid.nodes.iter().flat_map(|[x, y, _]| [-y, *x, 0.0]).collect();
            for speed in [0.0, 1.0] {
                let (u, v) = (vec![0.0; solid.dofs()], velocity.iter().map(|v| speed * v).collect::<Vec<_>>());
                edges.search_on(0.0, &u, &v, 0.05).unwrap();
                // (What spins sees some that are open, around its corners.)
                let mut gaps = vec![0.0; edges.candidates()];
                edges.gap(0.0, &u, &mut gaps);
                assert!(gaps.iter().all(|gap| *gap > 0.0), "{reach} {speed}: {gaps:?}");
                assert!(speed > 0.0 || gaps.is_empty(), "{reach}: {gaps:?}");
            }
        }
    }
}

#[test]
fn piles_of_bodies_gain_no_energy() {
    // Two and three cubes, the upper ones turned, fall on each other with edges across edges; in two units of length.
    let cube = |angle: f64, height: f64| {
        let cube = Solid::block([1.0; 3], [2; 3], MATERIAL).moved([-0.5, -0.5, -0.5]);
        cube.rotated([1.0, 0.0, 0.0], angle).rotated([0.0, 0.0, 1.0], 1.3 * angle).moved([0.1 * angle, 0.0, height])
    };
    for count in [2, 3] {
        let tilts = [std::f64::consts::FRAC_PI_4, -0.6, 0.4];
        let pile = (1..count).fold(cube(tilts[0], 0.0), |pile, k| pile.with(cube(tilts[k], 1.45 * k as f64)));
        let fall = |unit: f64| {
            let nodes: Vec<[f64; 3]> = pile.nodes.iter().map(|x| x.map(|x| unit * x)).collect();
            let surface = Surface::of_cells(&nodes, &pile.elements).unwrap();
            let contact = BodyContact::of_itself(&nodes, &pile.node_dofs(), &surface).unwrap();
            let velocity = pile.nodes.iter().flat_map(|x| [0.0, 0.0, -0.1 * unit * (x[2] / 1.45).round()]);
            let mut run = Simulation::builder(pile.system::<f64>(), Composite, 0.1)
                .velocity(velocity.collect())
                .constraints(contact.constraints().unwrap())
                .corrector(PersistencyCorrection::with_history_projection())
                .step_control(StepControl::halving(1e-3).unwrap())
                .build()
                .unwrap();
            let up: Vec<f64> = (0..pile.dofs()).map(|dof| f64::from(u8::from(dof % 3 == 2))).collect();
            let (energy, momentum) = (run.energy().total(), run.momentum(&up).unwrap());
            let (mut most, mut pressed) = (energy, 0);
            while run.time() < 12.0 {
                run.step().unwrap();
                most = most.max(run.energy().total());
                pressed = pressed.max(run.state().contacts().forces().iter().filter(|force| **force > 0.0).count());
            }
            let change = run.momentum(&up).unwrap() - momentum;
            assert!(pressed > 0 && most < 1.001 * energy, "{count}, {unit}: {pressed} press, {}", most / energy);
            assert!(change.abs() < 1e-10 * momentum.abs(), "{count}, {unit}: {change:e} of {momentum:e}");
            run.state().displacement().iter().map(|u| u / unit).collect::<Vec<_>>()
        };
        let end = fall(1.0);
        let largest = end.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        let other = fall(1024.0);
        assert!(end.iter().zip(other).all(|(one, other)| (one - other).abs() < 1e-9 * largest), "{count}");
    }
}

#[test]
fn absurd_angles_and_reaches_are_refused() {
    let contact = || {
        over_a_box(
            Solid::rectangle([1.0; 2], [1; 2], MATERIAL).moved([0.0, 1.5]),
            Solid::rectangle([1.0; 2], [1; 2], MATERIAL),
        )
    };
    for angle in [-0.1, 3.2, f64::NAN] {
        assert!(matches!(contact().with(SurfaceSettings::new().sharp(angle)), Err(Error::Parameter { .. })), "{angle}");
    }
    for reach in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(contact().with(SurfaceSettings::new().reach(reach)), Err(Error::Parameter { .. })), "{reach}");
    }
}

/// Faces, corners and edges of the whole bodies.
fn whole<const D: usize>(stack: &Stack<D>) -> BodyContact<f64, D> {
    let is_lower = |facet: &Vec<usize>| facet.iter().all(|&node| node < stack.split);
    let (below, above): (Vec<_>, Vec<_>) = stack.solid.boundary().into_iter().partition(is_lower);
    let of = |facets: Vec<Vec<usize>>| facets.into_iter().map(|facet| Stack::<D>::facet(&facet));
    BodyContact::new(&stack.solid.nodes, &stack.solid.node_dofs(), of(above), of(below)).unwrap()
}

#[test]
fn pressure_passes_through_faces_with_corners_and_edges() {
    // (Rows of corners and edges say again what weighted gaps say.)
    let flat = Stack::new([3, 2].map(|n| Solid::rectangle([1.0; 2], [n; 2], MATERIAL)), 0.0, |x| x);
    let contact = whole(&flat).constraints().unwrap();
    assert_eq!(contact.len(), 3);
    let patch = flat.patch_with(contact).unwrap();
    assert!(patch < 1e-12, "{patch}");
    let solid = Stack::new([3, 2].map(|n| Solid::block([1.0; 3], [n; 3], MATERIAL)), 0.0, |x| x);
    let contact = whole(&solid).constraints().unwrap();
    assert_eq!(contact.len(), 4);
    let patch = solid.patch_with(contact).unwrap();
    assert!(patch < 1e-12, "{patch}");
}

/// A square that falls on a corner, turned by some angle, beside the corner of a larger one or in its middle: highest
/// energy over that at the start, largest force, and lowest gap of what presses.
fn fall_in_the_plane(angle: f64, beside: f64, bodies: bool) -> [f64; 3] {
    let lower = Solid::rectangle([1.5, 1.0], [5, 4], MATERIAL).moved([-0.75, -1.0]);
    let square = Solid::rectangle([1.0; 2], [4; 2], MATERIAL).moved([-0.5; 2]);
    let upper = square.rotated(angle).lifted(0.02).moved([beside, 0.0]);
    let stack = Stack::of_whole_surfaces([lower, upper]);
    let h = 0.7 * 0.25 / MATERIAL.wave_speed();
    let builder = Simulation::builder(Hyperelastic::new(&stack.solid, Law::NeoHookean), Composite, h)
        .velocity(stack.velocity_of_upper([0.0, -0.15]))
        .corrector(PersistencyCorrection::with_history_projection())
        .step_control(StepControl::halving(h / 256.0).unwrap());
    let builder = match bodies {
        true => builder.constraints(stack.bodies(true).unwrap().constraints().unwrap()),
        false => builder.constraints([stack.weighted(true, 0.25).unwrap()]),
    };
    let mut run = builder.build().unwrap();
    let start = run.energy().total();
    let [mut highest, mut pressed, mut lowest] = [1.0_f64, 0.0, 0.0];
    while run.time() < 6.0 {
        if run.step().is_err() {
            return [f64::INFINITY, pressed, lowest];
        }
        highest = highest.max(run.energy().total() / start);
        let contacts = run.state().contacts();
        pressed = contacts.forces().iter().fold(pressed, |most, force| most.max(*force));
        lowest = contacts.gaps().iter().fold(lowest, |least, gap| least.min(*gap));
    }
    [highest, pressed, lowest]
}

#[test]
fn corners_in_the_plane_gain_no_energy() {
    let mut alone = [1.0_f64, 0.0];
    for (angle, beside) in [(0.785, 0.0), (0.6, 0.2), (0.9, -0.7), (0.785, 0.75), (0.3, 0.4)] {
        let [highest, pressed, lowest] = fall_in_the_plane(angle, beside, true);
        assert!(highest < 1.0 + 1e-6 && pressed > 0.0, "{angle} {beside}: {highest}, {pressed}");
        assert!(lowest > -1e-9, "{angle} {beside}: {lowest:e}");
        let [highest, _, lowest] = fall_in_the_plane(angle, beside, false);
        alone = [alone[0].max(highest), alone[1].min(lowest)];
    }
    // Weighted gaps alone let corners in, by more than a tenth of an element, which come out without energy.
    assert!(alone[0] < 1.0 + 1e-6 && alone[1] < -0.025, "{alone:?}");
}

#[test]
fn blocks_gain_no_energy_and_stay_out_of_each_other() {
    // (In the last one linearizations that were mixed found another solution, and 5 % of the energy, where half of the
    // step finds its own.)
    let falls =
        [(Landing::Corner, 1, 4.0), (Landing::Edge, 0, 3.0), (Landing::Beside, 5, 4.5), (Landing::Beside, 11, 3.0)];
    for (landing, fall, until) in falls {
        let mut random = xorshift(77);
        for number in 0..=fall {
            let scene = Fall::new(landing, &mut random);
            let courant = 0.5 + random();
            if number < fall {
                continue;
            }
            let figures = scene.run(Keeps::Bodies, Box::new(Composite), courant, until).unwrap();
            assert!(figures.touched && figures.momentum < 1e-10, "{landing:?}: {figures:?}");
            assert!(figures.highest < 1.0 + 1e-6, "{landing:?}: {figures:?}");
            assert!(figures.edge_depth < 0.03 * scene.element, "{landing:?}: {figures:?}");
            assert!(figures.node_depth < 0.15 * scene.element, "{landing:?}: {figures:?}");
        }
    }
}

/// Cells have a volume, or are flat, in any unit of length.
#[test]
fn flat_cells_are_refused_in_any_unit() {
    for unit in [1.0, 1e-14, 1e14] {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|point| point.map(|x| unit * x));
        assert_eq!(Surface::of_cells(&square, [[0, 1, 2, 3]]).unwrap().facets().len(), 4, "{unit:e}");
        let flat = square.map(|[x, y]| [x, x + 1e-14 * y]);
        assert!(matches!(Surface::of_cells(&flat, [[0, 1, 2, 3]]), Err(Error::Incompatible { .. })), "{unit:e}");
        let corner = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|point| point.map(|x| unit * x));
        assert_eq!(Surface::of_cells(&corner, [[0, 1, 2, 3]]).unwrap().facets().len(), 4, "{unit:e}");
        let flat = corner.map(|[x, y, z]| [x, y, x + 1e-14 * z]);
        assert!(matches!(Surface::of_cells(&flat, [[0, 1, 2, 3]]), Err(Error::Incompatible { .. })), "{unit:e}");
    }
}
