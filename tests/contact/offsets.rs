//! Surfaces that lie outside of their facets: shells, coatings, and press fits whose interference grows or goes.

use contact_dynamics::contact::{ContactConstraint, Contacts, Mortar};
use contact_dynamics::{Error, Newmark, Simulation, verify};
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
fn check_rows<const D: usize>(stack: &Stack<D>, seed: u64) {
    let solid = &stack.solid;
    let offsets = at_random(solid.nodes.len(), 0.05, seed);
    let mut contact = stack.mortar(true).unwrap().reach(0.4).unwrap().offsets(&offsets).unwrap();
    contact = contact.ramp([-1.0, 1.0], [0.5, 1.5]).unwrap();
    let (u, v) = (at_random(solid.dofs(), 0.02, seed + 10), at_random(solid.dofs(), 1.0, seed + 20));
    let error = verify::gap_jacobian(&mut contact, 0.3, &u, &v, 1e-6).unwrap();
    // (Warped facets in space: quadrature.)
    assert!(error.rows > 4 && error.jacobian < if D == 2 { 1e-8 } else { 1e-3 }, "{error:?}");
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
    for seed in 1..4 {
        check_rows(&plates(0.02), seed);
        let bodies = [[2, 2, 1], [3, 2, 1]].map(|cells| Solid::block([1.0; 3], cells, MATERIAL));
        check_rows(&Stack::new(bodies, 0.02, |x| x), seed);
    }
}

#[test]
fn offsets_are_taken_from_the_gap() {
    // Linear offsets of both sides: gaps are 0.3 − o_s − o_m in the mean over N.
    let coordinates = [[1.0, 0.0], [0.0, 0.0], [0.0, 0.3], [1.0, 0.3]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let offsets = [0.06, 0.0, 0.1, 0.1];
    let mut contact = Mortar::new(&coordinates, &dofs, [[2, 3]], [[0, 1]]).unwrap().offsets(&offsets).unwrap();
    let mut gaps = [0.0_f64; 2];
    contact.search(0.0, &[0.0; 8], &[0.0; 8], 0.0).unwrap();
    contact.gaps(0.0, &[0.0; 8], &mut gaps).unwrap();
    // ∫ (1 − x) 0.06 x dx / ∫ (1 − x) dx = 0.02 at the left, twice that at the right.
    for (gap, expected) in gaps.iter().zip([0.18, 0.16]) {
        assert!((gap - expected).abs() < 1e-15, "{gaps:?}");
    }
    // Halfway up a ramp they count by half.
    let mut contact = contact.ramp([2.0, 4.0], [0.0, 1.0]).unwrap();
    contact.search(3.0, &[0.0; 8], &[0.0; 8], 0.0).unwrap();
    contact.gaps(3.0, &[0.0; 8], &mut gaps).unwrap();
    assert!((gaps[0] - 0.24).abs() < 1e-15);
    // Between two searches they go on.
    contact.gaps(5.0, &[0.0; 8], &mut gaps).unwrap();
    assert!((gaps[0] - 0.18).abs() < 1e-15);
}

/// The pressure between two bars held at their far ends, whose offsets are `offsets` in the mean, by the last factor.
fn press_fit(stack: &Stack<2>, offset: f64, factors: [f64; 2]) -> f64 {
    let solid = &stack.solid;
    let mut system = solid.system::<f64>();
    let top = solid.nodes.iter().fold(0.0_f64, |most, x| most.max(x[1]));
    for (node, [_, y]) in solid.nodes.iter().enumerate() {
        if *y < 1e-9 || *y > top - 1e-9 {
            system = system.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
        }
    }
    let contact = stack.mortar(true).unwrap().offsets(&vec![offset; solid.nodes.len()]).unwrap();
    let contact = contact.ramp([0.0, 20.0], factors).unwrap();
    // (Strongly damped, a wave crosses a bar in a tenth of this time.)
    let run = Simulation::builder(system, Newmark::new(0.5, 1.0).unwrap(), 0.05).constraint(contact);
    let mut run = run.build().unwrap();
    run.run_until(40.0, &mut ()).unwrap();
    run.state().contacts().forces().iter().sum()
}

#[test]
fn a_press_fit_grows_to_its_pressure() {
    // Both bars together are shortened by 0.01: E ε with ε = 0.01/2. One is meshed as it just fits, one overlaps.
    let expected = 100.0 * 0.005;
    let fits = press_fit(&plates(0.0), 0.005, [0.0, 1.0]);
    assert!((fits / expected - 1.0).abs() < 1e-9, "{fits}");
    // (The overlapping ones are longer by the interference.)
    let overlaps = press_fit(&plates(-0.01), -0.005, [1.0, 0.0]);
    assert!((overlaps / expected - 1.0).abs() < 1e-9, "{overlaps}");
}

#[test]
fn offsets_that_are_none_are_refused() {
    let stack = plates(0.0);
    let contact = || stack.mortar(true).unwrap();
    let count = stack.solid.nodes.len();
    assert!(matches!(contact().offsets(&[0.1]), Err(Error::Dimension { found: 1, .. })));
    let mut offsets = vec![0.0; count];
    offsets[4] = f64::NAN;
    assert!(matches!(contact().offsets(&offsets), Err(Error::NotFinite { index: 4, .. })));
    for (times, factors) in
        [([1.0, 1.0], [0.0, 1.0]), ([0.0, f64::INFINITY], [0.0, 1.0]), ([0.0, 1.0], [f64::NAN, 1.0])]
    {
        assert!(matches!(contact().ramp(times, factors), Err(Error::Parameter { .. })));
    }
}
