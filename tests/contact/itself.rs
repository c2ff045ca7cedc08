//! Surfaces against themselves: what is met and what is not, hairpins whose arms meet, units.

use contact_dynamics::contact::{ContactConstraint, Contacts, NodeToFacet, Surface, SurfaceSettings};
use contact_dynamics::{Composite, EnergyMomentum, PersistencyCorrection, Simulation, StepControl};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::folding::Folding;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

fn surface<const D: usize>(solid: &Solid<D>) -> Surface {
    Surface::of_cells(&solid.nodes, &solid.elements).unwrap()
}

fn of_itself<const D: usize>(solid: &Solid<D>) -> NodeToFacet<f64> {
    NodeToFacet::of_itself(&solid.nodes, &solid.node_dofs(), &surface(solid)).unwrap()
}

/// Nodes with rows, and their gaps, in the reference configuration.
fn rows(mut contact: NodeToFacet<f64>) -> Vec<(usize, f64)> {
    let zeros = vec![0.0; contact.dofs().len()];
    contact.search(0.0, &zeros, &zeros, 0.0).unwrap();
    let contacts = Contacts::of(&contact);
    let mut gaps = vec![0.0; contacts.len()];
    contact.gaps(0.0, &zeros, &mut gaps).unwrap();
    (0..contacts.len()).map(|row| (contacts.name(row).0, gaps[row])).collect()
}

#[test]
fn bodies_that_do_not_fold_do_not_meet_themselves() {
    let block = Solid::block([1.0; 3], [3; 3], MATERIAL);
    let plate = Solid::block([1.0, 1.0, 0.02], [6, 6, 1], MATERIAL);
    let wedge = Solid::block([1.0; 3], [4; 3], MATERIAL).mapped(|[x, y, z]| [x, y, z * (0.02 + 0.4 * x)]);
    for solid in [&block, &plate, &wedge] {
        for reach in [0.1, 0.5, 3.0] {
            let contact = of_itself(solid).with(SurfaceSettings::new().reach(reach)).unwrap();
            assert_eq!(rows(contact), [], "reach {reach}, {:?}", solid.nodes.last());
        }
    }
    let disc = Solid::disc(1.0, 6, MATERIAL);
    assert_eq!(rows(of_itself(&disc).with(SurfaceSettings::new().reach(5.0)).unwrap()), []);
    // Thrown and turned they do not either.
    let mut contact = of_itself(&plate).with(SurfaceSettings::new().reach(0.5)).unwrap();
    let turned: Vec<f64> = plate.nodes.iter().flat_map(|[x, y, _]| [-y - x, x - y, 0.0]).collect();
    let velocity: Vec<f64> = plate.nodes.iter().flat_map(|[x, y, _]| [-10.0 * y, 10.0 * x, 0.0]).collect();
    contact.search_on(0.0, &turned, &velocity, 0.1).unwrap();
    assert_eq!(contact.candidates(), 0);
}

#[test]
fn bodies_that_bend_do_not_meet_their_own_sides() {
    // A sheet of two layers rolled up to half a circle, either way: its sides turn toward the nodes of its ends.
    let sheet = Solid::block([1.0, 0.5, 0.1], [16, 4, 2], MATERIAL);
    for radius in [0.3, -0.3] {
        let rolled = |[x, _, z]: [f64; 3]| {
            let (s, c) = (x / radius).sin_cos();
            [(radius - z) * s - x, 0.0, radius - (radius - z) * c - z]
        };
        let u: Vec<f64> = sheet.nodes.iter().flat_map(|&x| rolled(x)).collect();
        for reach in [0.05, 0.1, 0.2] {
            let mut contact = of_itself(&sheet).with(SurfaceSettings::new().reach(reach)).unwrap();
            contact.search_on(0.0, &u, &vec![0.0; u.len()], 0.0).unwrap();
            assert_eq!(contact.candidates(), 0, "radius {radius}, reach {reach}");
        }
    }
}

#[test]
fn nothing_is_inside_where_nothing_was() {
    // (Facets a sheet's width long, so that all of a bend is within reach.)
    for wide in [1, 2, 4] {
        let sheet = Folding::sheet(wide, 0.2, 0.0).solid;
        let found = rows(of_itself(&sheet));
        assert!(found.len() > 60 && found.iter().all(|&(_, gap)| gap > 0.0), "{wide}: {found:?}");
    }
}

#[test]
fn what_hangs_beside_an_edge_is_outside() {
    // A thin plate beside a box: its outer corner faces the top of the box, not the side that is nearer, and is behind
    // the mean of the normals at the edge between both.
    let flat = Solid::rectangle([1.0; 2], [1; 2], MATERIAL)
        .with(Solid::rectangle([0.08, 1.0], [1, 1], MATERIAL).moved([1.02, 0.7]));
    let found = rows(of_itself(&flat).with(SurfaceSettings::new().reach(1.0)).unwrap());
    assert!(found.len() > 1 && found.iter().all(|&(_, gap)| gap > 0.0), "{found:?}");
    let [below, beside] = [0, 1].map(|k| Surface::of_cells(&flat.nodes, &flat.elements[k..=k]).unwrap());
    let two = NodeToFacet::new(&flat.nodes, &flat.node_dofs(), &beside, &below).unwrap();
    let found = rows(two.with(SurfaceSettings::new().reach(1.0)).unwrap());
    assert!(found.len() > 1 && found.iter().all(|&(_, gap)| gap > 0.0), "{found:?}");
    let deep = Solid::block([1.0; 3], [1; 3], MATERIAL)
        .with(Solid::block([0.08, 0.5, 1.0], [1; 3], MATERIAL).moved([1.02, 0.2, 0.7]));
    let found = rows(of_itself(&deep).with(SurfaceSettings::new().reach(1.0)).unwrap());
    assert!(found.len() > 1 && found.iter().all(|&(_, gap)| gap > 0.0), "{found:?}");
}

#[test]
fn arms_of_a_hairpin_face_each_other() {
    let slot = 0.1;
    let pin = Folding::hairpin(slot, 0.0).solid;
    let found = rows(of_itself(&pin));
    // All inner nodes of the arms, up to the bend, and no outer one.
    assert!(found.len() > 30, "{}", found.len());
    for (node, gap) in found {
        let [x, y] = pin.nodes[node];
        assert!(y.abs() < 0.5 * slot + 1e-12 && gap > 0.0, "{x} {y}: {gap}");
        assert!(x > 1.8 || (gap - slot).abs() < 1e-12, "{x} {y}: {gap}");
    }
}

#[test]
fn arms_meet_as_two_surfaces_do() {
    let folding = Folding::hairpin(0.1, 1.0);
    let run = |contact: NodeToFacet<f64>| {
        let (system, contact) =
            (folding.solid.system::<f64>(), contact.with(SurfaceSettings::new().reach(0.09)).unwrap());
        folding.run(system, contact, Composite, (2e-3, 0.3)).unwrap()
    };
    let (own, two) = (run(folding.of_itself().unwrap()), run(folding.of_two_surfaces().unwrap()));
    assert!(own.pressed > 2 && own.pressed == two.pressed, "{} {}", own.pressed, two.pressed);
    let largest = own.displacement.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    assert!(largest > 0.04);
    for (x, y) in own.displacement.iter().zip(&two.displacement) {
        assert!((x - y).abs() < 1e-6 * largest, "{x} {y}");
    }
}

#[test]
fn a_hairpin_that_snaps_shut_gains_no_energy() {
    let Folding { solid: pin, velocity, .. } = Folding::hairpin(0.2, 3.0);
    let system = Hyperelastic::new(&pin, Law::NeoHookean);
    let particles = system.particles.clone();
    let momentum = |v: &[f64]| -> [f64; 2] {
        let mass = pin.lumped_mass::<f64>();
        [0, 1].map(|axis| v.iter().zip(&mass).skip(axis).step_by(2).map(|(v, m)| m * v).sum())
    };
    let start = momentum(&velocity);
    let (still, scale) = (
        vec![0.0; velocity.len()],
        velocity.iter().zip(pin.lumped_mass::<f64>()).map(|(v, m)| m * v.abs()).sum::<f64>(),
    );
    let turning = particles.angular_momentum(&still, &velocity);
    let mut run = Simulation::builder(system, EnergyMomentum, 5e-3)
        .velocity(velocity)
        .constraint(of_itself(&pin))
        .corrector(PersistencyCorrection::default())
        .step_control(StepControl::halving(1e-4).unwrap())
        .build()
        .unwrap();
    let first = run.energy().total();
    let (mut most, mut deepest, mut pressed) = (first, 0.0_f64, 0);
    while run.time() < 0.5 {
        run.step().unwrap();
        most = most.max(run.energy().total());
        deepest = run.gaps().iter().fold(deepest, |low, gap| low.min(*gap));
        pressed = pressed.max(run.state().contacts().forces().iter().filter(|force| **force > 0.0).count());
    }
    assert!(pressed > 2 && most < (1.0 + 1e-6) * first, "{pressed} pressed, energy {most} of {first}");
    assert!(deepest > -1e-6, "{deepest}");
    let end = momentum(run.state().velocity());
    assert!((0..2).all(|axis| (end[axis] - start[axis]).abs() < 1e-10 * scale));
    let turned = particles.angular_momentum(run.state().displacement(), run.state().velocity());
    assert!((turned - turning).abs() < 1e-2 * scale, "{turning} {turned}");
}

#[test]
fn a_sheet_that_snaps_shut_is_kept_out_of_itself() {
    // Its sides bulge where it folds, so that nodes of one side are in front of the flank that the other side ends at:
    // through the whole sheet, and not outside. With elements wider than the slot its creases face each other flatly.
    for wide in [1, 2] {
        let sheet = Folding::sheet(wide, 0.2, 3.0);
        let system = Hyperelastic::new(&sheet.solid, Law::NeoHookean);
        let figures = sheet.run(system, sheet.of_itself().unwrap(), EnergyMomentum, (5e-3, 0.15)).unwrap();
        assert!(figures.pressed > 3 && figures.refused < 5, "{wide}: {figures:?}");
        assert!(figures.highest < 1.0 + 1e-9 && figures.depth < 0.05 * 0.2, "{wide}: {figures:?}");
    }
}

#[test]
fn a_corner_on_a_node_has_the_row_of_both() {
    // A cube that stands on its corner, turned a little, just above a node of the block below: whichever comes first
    // among the nodes, the corner has the row, on the facets below, and the node under it has none.
    let block = Solid::block([3.0, 3.0, 1.0], [3, 3, 1], MATERIAL).moved([-1.0, -1.0, -1.0]);
    let cube = Solid::block([1.0; 3], [1; 3], MATERIAL)
        .rotated([1.0, -1.0, 0.0], (1.0 / 3.0_f64.sqrt()).acos())
        .rotated([0.0, 0.0, 1.0], 0.3)
        .moved([0.0, 0.0, 1e-3]);
    for pair in [block.clone().with(cube.clone()), cube.with(block)] {
        let found = rows(of_itself(&pair).with(SurfaceSettings::new().reach(0.1)).unwrap());
        let [(node, gap)] = found[..] else { panic!("{found:?}") };
        assert!((pair.nodes[node][2] - 1e-3).abs() < 1e-12 && (gap - 1e-3).abs() < 1e-12, "{found:?}");
    }
}

#[test]
fn columns_in_space_meet_and_units_do_not_matter() {
    // Two columns on a plate, 0.3 apart, thrown at each other.
    let column = |from: f64| Solid::block([1.0, 1.0, 2.0], [2, 2, 4], MATERIAL).moved([from, 0.0, 0.0]);
    let forces = |unit: f64| {
        let pair = column(0.0).with(column(1.3));
        let nodes: Vec<[f64; 3]> = pair.nodes.iter().map(|x| x.map(|x| unit * x)).collect();
        let contact = NodeToFacet::of_itself(&nodes, &pair.node_dofs(), &surface(&pair)).unwrap();
        let velocity = pair.nodes.iter().flat_map(|x| [unit * if x[0] < 1.1 { 1.0 } else { -1.0 }, 0.0, 0.0]).collect();
        let mut run = Simulation::builder(pair.system::<f64>(), Composite, 5e-3)
            .velocity(velocity)
            .constraint(contact)
            .corrector(PersistencyCorrection::default())
            .build()
            .unwrap();
        run.run_until(0.2, &mut ()).unwrap();
        run.state().contacts().forces().iter().sum::<f64>() / unit
    };
    let expected = forces(1.0);
    // Of both sides: the pressure of bars that meet is ρ c v, and half of the rows see it each.
    assert!(expected > 5.0, "{expected}");
    for unit in [1e-6, 1e6] {
        assert!((forces(unit) / expected - 1.0).abs() < 1e-9, "{unit}");
    }
}
