//! Surfaces that lie outside of their facets: shells, coatings, and press fits whose interference grows or goes.

use contact_dynamics::contact::{
    BodyContact, ContactConstraint, Contacts, EdgeToEdge, Mortar, NodeToFacet, Stride, Surface, SurfaceSettings,
};
use contact_dynamics::{
    EnergyMomentum, Error, LinearSystem, Newmark, PersistencyCorrection, Simulation, StepControl, verify,
};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::folding::Folding;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 100.0, poisson: 0.0, density: 1.0 };

fn plates(gap: f64) -> Stack<2> {
    let bodies = [3, 4].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL));
    Stack::new(bodies, gap, |x| x)
}

fn at_random(count: usize, size: f64, seed: u64) -> Vec<f64> {
    let mut random = xorshift(seed);
    (0..count).map(|_| size * (2.0 * random() - 1.0)).collect()
}

/// Rows with an offset of its own at each node are derivatives, and do no work on translations and rotations.
fn check_rows<const D: usize>(
    (solid, least): (&Solid<D>, usize),
    mut contact: impl ContactConstraint<f64>,
    (bound, seed): (f64, u64),
) {
    let (u, v) = (at_random(solid.dofs(), 0.02, seed + 10), at_random(solid.dofs(), 1.0, seed + 20));
    let error = verify::gap_jacobian(&mut contact, 0.3, &u, &v, 1e-6).unwrap();
    assert!(error.rows >= least && error.jacobian < bound && error.rate < 1e-7, "{error:?}");
    // (Of accelerations of order one, by differences of the second order.)
    assert!(error.acceleration < 1e6 * bound, "{error:?}");
    let contacts = Contacts::of(&contact);
    for row in 0..contacts.len() {
        let mut sums = [0.0; 6];
        for (place, weight) in contacts.row(row) {
            let (node, axis) = (contact.dofs()[place] / D, contact.dofs()[place] % D);
            let at = |k: usize| if k < D { solid.nodes[node][k] + u[D * node + k] } else { 0.0 };
            sums[axis] += weight;
            // x × f: of f along an axis, −x of the next axis about the last one, x of the last one about the next.
            let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
            sums[3 + last] -= at(next) * weight;
            sums[3 + next] += at(last) * weight;
        }
        assert!(sums.iter().all(|sum| sum.abs() < 1e-12), "row {row}: {sums:?}");
    }
}

#[test]
fn rows_hold_the_slope_of_offsets() {
    let ramp = ([-1.0, 1.0], [0.5, 1.5]);
    for seed in 1..4 {
        let flat = plates(0.02);
        let bodies = [[2, 2, 1], [3, 2, 1]].map(|cells| Solid::block([1.0; 3], cells, MATERIAL));
        let solid = Stack::new(bodies, 0.02, |x| x);
        let [few, many] = [flat.solid.nodes.len(), solid.solid.nodes.len()].map(|n| at_random(n, 0.05, seed));
        let mortar = flat.mortar(true).unwrap().with(SurfaceSettings::new().reach(0.4).offsets(&few)).unwrap();
        check_rows((&flat.solid, 5), mortar.with(SurfaceSettings::new().ramp(ramp.0, ramp.1)).unwrap(), (1e-8, seed));
        // (Warped facets in space: quadrature.)
        let mortar = solid.mortar(true).unwrap().with(SurfaceSettings::new().reach(0.4).offsets(&many)).unwrap();
        check_rows((&solid.solid, 5), mortar.with(SurfaceSettings::new().ramp(ramp.0, ramp.1)).unwrap(), (1e-3, seed));
        for passes in [1, 2] {
            let nodes =
                flat.nodes_on_facets(passes).unwrap().with(SurfaceSettings::new().reach(0.4).offsets(&few)).unwrap();
            check_rows(
                (&flat.solid, 3),
                nodes.with(SurfaceSettings::new().ramp(ramp.0, ramp.1)).unwrap(),
                (1e-8, seed),
            );
            let nodes =
                solid.nodes_on_facets(passes).unwrap().with(SurfaceSettings::new().reach(0.4).offsets(&many)).unwrap();
            check_rows(
                (&solid.solid, 5),
                nodes.with(SurfaceSettings::new().ramp(ramp.0, ramp.1)).unwrap(),
                (1e-8, seed),
            );
        }
    }
}

/// The facets of one.
type Tetrahedron = [[usize; 3]; 4];

/// Two tetrahedra, a ridge 0.1 above another one and across it.
fn ridges() -> ([[f64; 3]; 8], Tetrahedron, Tetrahedron) {
    let nodes = [
        [-1.0, 0.1, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, -1.0],
        [0.0, 1.0, -1.0],
        [0.0, -1.0, 0.1],
        [0.2, 1.0, 0.1],
        [-1.0, 0.0, 1.1],
        [1.0, 0.0, 1.1],
    ];
    (nodes, [[0, 1, 3], [1, 0, 2], [0, 3, 2], [1, 2, 3]], [[4, 5, 7], [5, 4, 6], [4, 7, 6], [5, 6, 7]])
}

#[test]
fn rows_of_rounded_edges_hold_the_slope_of_their_radii() {
    let (nodes, below, above) = ridges();
    let dofs: Vec<[usize; 3]> = (0..8).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
    let solid = Solid { nodes: nodes.to_vec(), ..Solid::block([1.0; 3], [1; 3], MATERIAL) };
    for seed in 1..6 {
        let offsets = at_random(8, 0.02, seed);
        let contacts = [
            EdgeToEdge::new(&nodes, &dofs, above, below).unwrap(),
            EdgeToEdge::of_itself(&nodes, &dofs, below.into_iter().chain(above)).unwrap(),
        ];
        for contact in contacts {
            let contact = contact.with(SurfaceSettings::new().offsets(&offsets).ramp([-1.0, 1.0], [0.5, 1.5])).unwrap();
            check_rows((&solid, 1), contact, (1e-8, seed));
        }
    }
}

#[test]
fn rounded_edges_touch_at_the_sum_of_their_radii() {
    let (nodes, below, above) = ridges();
    let dofs: Vec<[usize; 3]> = (0..8).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
    let gap = |offsets: &[f64; 8], t: f64| {
        let contact = EdgeToEdge::new(&nodes, &dofs, above, below)
            .unwrap()
            .with(SurfaceSettings::new().offsets(offsets))
            .unwrap();
        let mut contact = contact.with(SurfaceSettings::new().ramp([0.0, 1.0], [0.0, 1.0])).unwrap();
        contact.search(t, &[0.0; 24], &[0.0; 24], 0.0).unwrap();
        let ends = contact.edges().map(<[_]>::to_vec);
        let found = Contacts::of(&contact);
        let is_ridges = |&row: &usize| [ends[0][found.name(row).0], ends[1][found.name(row).1]] == [[4, 5], [0, 1]];
        let row = (0..found.len()).find(is_ridges).unwrap();
        let mut gaps = vec![0.0_f64; found.len()];
        contact.gaps(t, &[0.0; 24], &mut gaps).unwrap();
        gaps[row]
    };
    assert!((gap(&[0.03; 8], 1.0) - 0.04).abs() < 1e-14);
    assert!((gap(&[0.03; 8], 0.5) - 0.07).abs() < 1e-14);
    assert!((gap(&[0.0505; 8], 1.0) + 0.001).abs() < 1e-14);
    // From 0 to 0.04 along the lower ridge: the upper one crosses it where x = 0.1 + 0.1 y.
    let x = 0.105 / 1.005;
    let expected = 0.1 - 0.04 * 0.5 * (1.0 + x);
    let found = gap(&[0.0, 0.04, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0);
    assert!((found - expected).abs() < 1e-14, "{found} {expected}");
}

#[test]
fn offsets_are_taken_from_the_distance_of_nodes() {
    // An upper segment 0.3 above a lower one, whose offset grows from 0 to 0.06 to the right.
    let coordinates = [[1.0, 0.0], [0.0, 0.0], [0.25, 0.3], [0.75, 0.3]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let offsets = [0.06, 0.0, 0.1, 0.02];
    let contact = NodeToFacet::one_pass(&coordinates, &dofs, &[2, 3], [[0, 1]])
        .unwrap()
        .with(SurfaceSettings::new().offsets(&offsets))
        .unwrap();
    let gaps_at = |contact: &mut NodeToFacet<f64>, t: f64| {
        let mut gaps = [0.0_f64; 2];
        contact.gaps(t, &[0.0; 8], &mut gaps).unwrap();
        gaps
    };
    let mut contact = contact.with(SurfaceSettings::new().ramp([2.0, 4.0], [0.0, 1.0])).unwrap();
    contact.search(3.0, &[0.0; 8], &[0.0; 8], 0.0).unwrap();
    // By half, then fully, between two searches.
    for (t, factor) in [(3.0, 0.5), (5.0, 1.0)] {
        let gaps = gaps_at(&mut contact, t);
        for (gap, full) in gaps.into_iter().zip([0.015 + 0.1, 0.045 + 0.02]) {
            assert!((gap - (0.3 - factor * full)).abs() < 1e-15, "{gaps:?}");
        }
    }
    // Found again there.
    contact.search(5.0, &[0.0; 8], &[0.0; 8], 0.0).unwrap();
    assert!((gaps_at(&mut contact, 5.0)[0] - 0.185).abs() < 1e-15);
}

#[test]
fn what_offsets_bring_near_is_found_and_the_thicker_facet_comes_first() {
    // A node 1 above one segment and 1.2 above the next body's, whose offset is 0.5; little is searched.
    let coordinates = [[1.0, 0.0], [-1.0, 0.0], [1.0, -0.2], [-1.0, -0.2], [0.0, 1.0]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]];
    let contact = |offsets: [f64; 5]| {
        let contact = NodeToFacet::one_pass(&coordinates, &dofs, &[4], [[0, 1], [2, 3]]).unwrap();
        let mut contact = contact.with(SurfaceSettings::new().reach(0.1).offsets(&offsets)).unwrap();
        contact.search(0.0, &[0.0; 10], &[0.0; 10], 0.0).unwrap();
        let gaps = Contacts::of(&contact).len();
        let mut gap = vec![0.0_f64; gaps];
        contact.gaps(0.0, &[0.0; 10], &mut gap).unwrap();
        (0..gaps).map(|row| (contact.facet(row), (1e12 * gap[row]).round() / 1e12)).collect::<Vec<_>>()
    };
    assert_eq!(contact([0.0; 5]), []);
    assert_eq!(contact([0.5, 0.5, 0.0, 0.0, 0.45]), [(0, 0.05)]);
    assert_eq!(contact([0.0, 0.0, 0.7, 0.7, 0.45]), [(1, 0.05)]);
    assert_eq!(contact([0.0, 0.0, 0.7, 0.7, 0.3]), []);
}

#[test]
fn nodes_whose_way_ends_in_a_layer_are_seen() {
    // Straight through a layer of 0.3 over a segment, and into it at 0.1 a step that no row stops.
    let coordinates = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]];
    let dofs = [[0, 1], [2, 3], [4, 5]];
    for (end, is_refused) in [(0.5, false), (0.1, true), (-0.5, true), (0.35, false)] {
        let contact = NodeToFacet::one_pass(&coordinates, &dofs, &[2], [[0, 1]]).unwrap();
        let mut contact = contact.with(SurfaceSettings::new().reach(0.01).offsets(&[0.2, 0.2, 0.1])).unwrap();
        let (u, v) = ([0.0; 6], [0.0; 6]);
        contact.search(0.0, &u, &v, 0.0).unwrap();
        assert_eq!(Contacts::of(&contact).len(), 0);
        // (The dofs of the node come first.)
        let moved = [0.0, end - 1.0, 0.0, 0.0, 0.0, 0.0];
        let step = Stride::new([0.0, 1.0], [&u, &moved], &v, [&[], &[]]);
        assert_eq!(contact.inspect(&step).is_err(), is_refused, "{end}");
    }
}

#[test]
fn offsets_are_taken_from_the_gap() {
    // Linear offsets of both sides: gaps are 0.3 − o_s − o_m in the mean over N.
    let coordinates = [[1.0, 0.0], [0.0, 0.0], [0.0, 0.3], [1.0, 0.3]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let offsets = [0.06, 0.0, 0.1, 0.1];
    let mut contact = Mortar::new(&coordinates, &dofs, [[2, 3]], [[0, 1]])
        .unwrap()
        .with(SurfaceSettings::new().offsets(&offsets))
        .unwrap();
    let mut gaps = [0.0_f64; 2];
    contact.search(0.0, &[0.0; 8], &[0.0; 8], 0.0).unwrap();
    contact.gaps(0.0, &[0.0; 8], &mut gaps).unwrap();
    // ∫ (1 − x) 0.06 x dx / ∫ (1 − x) dx = 0.02 at the left, twice that at the right.
    for (gap, expected) in gaps.iter().zip([0.18, 0.16]) {
        assert!((gap - expected).abs() < 1e-15, "{gaps:?}");
    }
    // Halfway up a ramp they count by half.
    let mut contact = contact.with(SurfaceSettings::new().ramp([2.0, 4.0], [0.0, 1.0])).unwrap();
    contact.search(3.0, &[0.0; 8], &[0.0; 8], 0.0).unwrap();
    contact.gaps(3.0, &[0.0; 8], &mut gaps).unwrap();
    assert!((gaps[0] - 0.24).abs() < 1e-15);
    // Between two searches they go on.
    contact.gaps(5.0, &[0.0; 8], &mut gaps).unwrap();
    assert!((gaps[0] - 0.18).abs() < 1e-15);
}

/// The force between two bars held at their far ends by constraints whose offsets have come or gone.
fn press_fit(solid: &Solid<2>, constraints: Vec<Box<dyn ContactConstraint<f64>>>) -> f64 {
    let mut system = solid.system::<f64>();
    let top = solid.nodes.iter().fold(0.0_f64, |most, x| most.max(x[1]));
    for (node, [_, y]) in solid.nodes.iter().enumerate() {
        if *y < 1e-9 || *y > top - 1e-9 {
            system = system.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
        }
    }
    // (Strongly damped, a wave crosses a bar in a tenth of this time.)
    let run = Simulation::builder(system, Newmark::new(0.5, 1.0).unwrap(), 0.05).constraints(constraints);
    let mut run = run.build().unwrap();
    run.run_until(40.0, &mut ()).unwrap();
    run.state().contacts().forces().iter().sum()
}

#[test]
fn a_press_fit_grows_to_its_pressure() {
    // Both bars together are shortened by 0.01: E ε with ε = 0.01/2. One is meshed as it just fits, one overlaps (the
    // overlapping ones are longer by the interference).
    let expected = 100.0 * 0.005;
    for (gap, offset, factors) in [(0.0, 0.005, [0.0, 1.0]), (-0.01, -0.005, [1.0, 0.0])] {
        let stack = plates(gap);
        let solid = &stack.solid;
        let (offsets, times, dofs) = (vec![offset; solid.nodes.len()], [0.0, 20.0], solid.node_dofs());
        let mortar =
            stack.mortar(true).unwrap().with(SurfaceSettings::new().offsets(&offsets).ramp(times, factors)).unwrap();
        let nodes = stack
            .nodes_on_facets(2)
            .unwrap()
            .with(SurfaceSettings::new().offsets(&offsets).ramp(times, factors))
            .unwrap();
        let surface = Surface::of_cells(&solid.nodes, &solid.elements).unwrap();
        let own = BodyContact::of_itself(&solid.nodes, &dofs, &surface).unwrap();
        let settings = SurfaceSettings::new().reach(0.3).offsets(&offsets).ramp(times, factors);
        let own = own.with(settings).unwrap().constraints().unwrap();
        let constraints: [Vec<Box<dyn ContactConstraint<f64>>>; 3] =
            [vec![Box::new(mortar)], vec![Box::new(nodes)], own];
        for (kind, constraints) in constraints.into_iter().enumerate() {
            let force = press_fit(solid, constraints);
            // (Where whole surfaces meet, nodes stand upon corners, to the root of rounding.)
            let bound = if kind == 2 { 1e-7 } else { 1e-9 };
            assert!((force / expected - 1.0).abs() < bound, "{kind}, gap {gap}: {force}");
        }
    }
}

#[test]
fn a_strip_rests_on_another_at_half_of_both_thicknesses() {
    // Middle surfaces of a strip that is held, from 0.1 to 0.2 thick on either side, and of one that falls on it. Nodes
    // of weight 1 each move up and down only.
    const LOWER: usize = 5;
    let lower = (0..LOWER).map(|k| [4.0 - k as f64, 0.0]);
    let coordinates: Vec<[f64; 2]> = lower.chain([0.3, 1.4, 2.0, 3.7].map(|x| [x, 0.5])).collect();
    let dofs: Vec<[usize; 2]> = (0..coordinates.len()).map(|node| [2 * node, 2 * node + 1]).collect();
    let below = |x: f64| 0.1 + 0.025 * x;
    let offsets: Vec<f64> =
        coordinates.iter().enumerate().map(|(k, x)| if k < LOWER { below(x[0]) } else { 0.02 * k as f64 }).collect();
    let nodes: Vec<usize> = (LOWER..coordinates.len()).collect();
    let facets = (1..LOWER).map(|k| [k - 1, k]);
    let contact = NodeToFacet::one_pass(&coordinates, &dofs, &nodes, facets)
        .unwrap()
        .with(SurfaceSettings::new().offsets(&offsets))
        .unwrap();
    let free = contact_dynamics::faer::sparse::SparseColMat::try_new_from_triplets(18, 18, &[]).unwrap();
    let mut system = LinearSystem::lumped(vec![1.0; 18], free).unwrap();
    system = system.load(|_, f| (LOWER..9).for_each(|node| f[2 * node + 1] = -1.0));
    for dof in (0..18).filter(|dof| *dof < 2 * LOWER || dof % 2 == 0) {
        system = system.fix(dof).unwrap();
    }
    let run = Simulation::builder(system, Newmark::new(0.5, 1.0).unwrap(), 0.05).constraint(contact);
    let mut run = run.build().unwrap();
    run.run_until(20.0, &mut ()).unwrap();
    for node in LOWER..9 {
        let height = coordinates[node][1] + run.state().displacement()[2 * node + 1];
        let expected = offsets[node] + below(coordinates[node][0]);
        assert!((height - expected).abs() < 1e-9, "{node}: {height} {expected}");
    }
    // Weights, along normals that lean by the slope of the thickness: the vertical component of a row is one.
    let forces = run.state().contacts().forces();
    assert!(forces.len() == 4 && forces.iter().all(|force| (force - 1.0).abs() < 1e-9), "{forces:?}");
}

#[test]
fn coated_arms_of_a_hairpin_meet_at_twice_their_coating() {
    let Folding { solid: pin, velocity, .. } = Folding::hairpin(0.2, 3.0);
    let surface = Surface::of_cells(&pin.nodes, &pin.elements).unwrap();
    let own = || NodeToFacet::of_itself(&pin.nodes, &pin.node_dofs(), &surface).unwrap();
    let coated = own().with(SurfaceSettings::new().offsets(&vec![0.03; pin.nodes.len()])).unwrap();
    let mut run = Simulation::builder(Hyperelastic::new(&pin, Law::NeoHookean), EnergyMomentum, 5e-3)
        .velocity(velocity)
        .constraint(coated)
        .corrector(PersistencyCorrection::default())
        .step_control(StepControl::halving(1e-4).unwrap())
        .build()
        .unwrap();
    let (first, mut bare) = (run.energy().total(), own());
    let (mut most, mut nearest, mut pressed) = (first, f64::INFINITY, 0);
    while run.time() < 0.3 {
        run.step().unwrap();
        most = most.max(run.energy().total());
        pressed = pressed.max(run.state().contacts().forces().iter().filter(|force| **force > 0.0).count());
        let (u, v) = (run.state().displacement().to_vec(), run.state().velocity().to_vec());
        bare.search_on(run.time(), &u, &v, 0.0).unwrap();
        let mut gaps = vec![0.0; bare.candidates()];
        bare.gap(run.time(), &u, &mut gaps);
        nearest = gaps.iter().fold(nearest, |least, gap| least.min(*gap));
    }
    assert!(pressed > 2 && most < (1.0 + 1e-6) * first, "{pressed} pressed, energy {most} of {first}");
    assert!((0.06 - 1e-6..0.062).contains(&nearest), "{nearest}");
}

#[test]
fn patches_with_offsets_that_cancel_are_those_without() {
    for (passes, cells) in [(1, [3, 3]), (2, [3, 4]), (2, [4, 2])] {
        let bodies = cells.map(|n| Solid::rectangle([1.0; 2], [n, 2], MATERIAL));
        let stack = Stack::new(bodies, 0.0, |x| x);
        let offsets: Vec<f64> =
            (0..stack.solid.nodes.len()).map(|node| if node < stack.split { -0.05 } else { 0.05 }).collect();
        let plain = stack.patch(stack.nodes_on_facets(passes).unwrap()).unwrap();
        let offset = stack
            .patch(stack.nodes_on_facets(passes).unwrap().with(SurfaceSettings::new().offsets(&offsets)).unwrap())
            .unwrap();
        assert!(plain < 1e-11 && offset < 1e-11, "{passes} {cells:?}: {plain:e} {offset:e}");
    }
}

#[test]
fn offsets_do_not_depend_on_units() {
    let stack = plates(0.02);
    let solid = &stack.solid;
    let offsets = at_random(solid.nodes.len(), 0.05, 7);
    let u = at_random(solid.dofs(), 0.02, 8);
    let rows = |unit: f64| {
        let scaled = |list: &[f64]| list.iter().map(|x| unit * x).collect::<Vec<_>>();
        let nodes: Vec<[f64; 2]> = solid.nodes.iter().map(|x| x.map(|x| unit * x)).collect();
        let [lower, upper] = stack.surfaces();
        let contact = NodeToFacet::new(&nodes, &solid.node_dofs(), upper, lower).unwrap();
        let mut contact =
            contact.with(SurfaceSettings::new().offsets(&scaled(&offsets)).ramp([0.0, 1.0], [0.0, 1.0])).unwrap();
        let u = scaled(&u);
        let v = vec![0.0; u.len()];
        contact.search_on(0.7, &u, &v, 0.0).unwrap();
        let mut gaps = vec![0.0; contact.candidates()];
        contact.gap(0.7, &u, &mut gaps);
        let found = Contacts::of(&contact);
        let weights: Vec<_> = (0..found.len()).flat_map(|row| found.row(row).collect::<Vec<_>>()).collect();
        (gaps.into_iter().map(|gap: f64| gap / unit).collect::<Vec<_>>(), weights)
    };
    let expected = rows(1.0);
    assert!(expected.0.len() > 4);
    for unit in [2.0_f64.powi(-20), 2.0_f64.powi(20)] {
        assert_eq!(rows(unit), expected);
    }
}

#[test]
fn all_parts_of_two_bodies_take_offsets() {
    let bodies = [3, 2].map(|n| Solid::block([1.0; 3], [n, n, 1], MATERIAL));
    let stack = Stack::of_whole_surfaces([bodies[0].clone(), bodies[1].clone().moved([0.0, 0.0, 1.1])]);
    let offsets = vec![0.05; stack.solid.nodes.len()];
    let constraints =
        stack.bodies(true).unwrap().with(SurfaceSettings::new().offsets(&offsets)).unwrap().constraints().unwrap();
    assert_eq!(constraints.len(), 4);
    for mut contact in constraints {
        let zeros = vec![0.0; contact.dofs().len()];
        contact.search(0.0, &zeros, &zeros, 0.0).unwrap();
        let mut gaps = vec![0.0_f64; Contacts::of(&*contact).len()];
        contact.gaps(0.0, &zeros, &mut gaps).unwrap();
        let least = gaps.iter().fold(f64::INFINITY, |least, gap| least.min(*gap));
        assert!(gaps.is_empty() || least.abs() < 1e-12, "{gaps:?}");
    }
    assert!(matches!(
        stack.bodies(true).unwrap().with(SurfaceSettings::new().offsets(&[0.1])),
        Err(Error::Dimension { .. })
    ));
    assert!(matches!(
        stack.bodies(true).unwrap().with(SurfaceSettings::new().ramp([1.0, 0.0], [0.0, 1.0])),
        Err(Error::Parameter { .. })
    ));
}

#[test]
fn offsets_that_are_none_are_refused() {
    let stack = plates(0.0);
    let contact = || stack.mortar(true).unwrap();
    let count = stack.solid.nodes.len();
    assert!(matches!(contact().with(SurfaceSettings::new().offsets(&[0.1])), Err(Error::Dimension { found: 1, .. })));
    let mut offsets = vec![0.0; count];
    assert!(matches!(
        stack.nodes_on_facets(1).unwrap().with(SurfaceSettings::new().offsets(&[0.1])),
        Err(Error::Dimension { found: 1, .. })
    ));
    offsets[4] = f64::NAN;
    assert!(matches!(
        stack.nodes_on_facets(1).unwrap().with(SurfaceSettings::new().offsets(&offsets)),
        Err(Error::NotFinite { index: 4, .. })
    ));
    assert!(matches!(contact().with(SurfaceSettings::new().offsets(&offsets)), Err(Error::NotFinite { index: 4, .. })));
    for (times, factors) in
        [([1.0, 1.0], [0.0, 1.0]), ([0.0, f64::INFINITY], [0.0, 1.0]), ([0.0, 1.0], [f64::NAN, 1.0])]
    {
        assert!(matches!(contact().with(SurfaceSettings::new().ramp(times, factors)), Err(Error::Parameter { .. })));
        assert!(matches!(
            stack.nodes_on_facets(2).unwrap().with(SurfaceSettings::new().ramp(times, factors)),
            Err(Error::Parameter { .. })
        ));
    }
}
