//! Rates of the gaps: what comes of curvature and turning.

use super::{Cells, Mesh, gaps, grid, polygon, rows};
use contact_dynamics::contact::{Candidates, GapRates, NodeToFacet};
use contact_dynamics::{Composite, ContactConstraint, LinearSystem, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::sparse::matrix;

fn accelerations(contact: &mut NodeToFacet<f64>, u: &[f64], v: &[f64]) -> Vec<f64> {
    let mut rates = vec![GapRates { rate: f64::NAN, acceleration: f64::NAN }; contact.candidates()];
    contact.rates_on(0.0, u, v, &mut rates);
    assert!(rates.iter().all(|rates| rates.rate == 0.0));
    rates.iter().map(|rates| rates.acceleration).collect()
}

#[test]
fn following_and_rates_do_not_allocate() {
    let mut random = Congruential(13);
    let mut mesh = grid(6, Cells::Mixed, |x, y| 0.2 * (x * y).sin());
    let cloud: Vec<_> =
        (0..60).map(|_| [3.0 + 2.5 * random.signed(), 3.0 + 2.5 * random.signed(), 0.3 * random.signed()]).collect();
    let nodes = mesh.nodes(cloud);
    let mut contact = mesh.contact(&nodes, 0.4);
    let mut u = vec![0.0; contact.dofs().len()];
    contact.search(0.0, &u, &u, 0.0).unwrap();
    let mut rates = vec![GapRates::default(); contact.candidates()];
    // (Memory for the second one of two lists of rows, which swap.)
    contact.follow(0.0, &u).unwrap();
    let counted = allocation_counter::measure(|| {
        for _ in 0..20 {
            for u in &mut u {
                *u += 0.001 * random.signed();
            }
            assert_eq!(contact.follow(0.0, &u).unwrap(), Candidates::Changed);
            contact.rates(0.0, &u, &u, &mut rates).unwrap();
        }
    });
    assert!(rates.len() > 30);
    assert_eq!(counted.count_total, 0);
}

/// Compares rates with differences of gaps that are searched for along u + s v; returns how many rows were compared,
/// and how many of them on a side or a vertex.
fn check_acceleration<const D: usize>(mesh: &Mesh<D>, nodes: &[usize], random: &mut Congruential) -> [usize; 2] {
    let step = 2e-3;
    let mut contact = mesh.contact(nodes, 0.8);
    let u = random.vector(mesh.size(), 0.05);
    let v = random.vector(mesh.size(), 1.0);
    let found = gaps(&mut contact, &u);
    let g = rows(&contact);
    let facets: Vec<_> = (0..g.rows()).map(|row| contact.facet(row)).collect();
    let computed = accelerations(&mut contact, &u, &v);
    let places = [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0];
    let mut along = vec![[None; 7]; g.rows()];
    let mut slopes = vec![[f64::NAN; 7]; g.rows()];
    for (k, place) in places.into_iter().enumerate() {
        let moved: Vec<_> = u.iter().zip(&v).map(|(u, v)| u + place * step * v).collect();
        let there = gaps(&mut contact, &moved);
        let g = rows(&contact);
        for (row, &(name, _)) in found.iter().enumerate() {
            let place = there.iter().position(|other| other.0 == name);
            along[row][k] = place.map(|place| there[place].1);
            slopes[row][k] = place.map_or(f64::NAN, |place| g.product(place, &v));
        }
    }
    let mut compared = [0, 0];
    for (row, &computed) in computed.iter().enumerate() {
        let Some(y) = along[row].into_iter().collect::<Option<Vec<_>>>() else { continue };
        let d = |k: usize| y[3 + k] + y[3 - k] - 2.0 * y[3];
        let difference = (1.5 * d(1) - 0.15 * d(2) + d(3) / 90.0) / (step * step);
        // Where the gap is smooth, both ways of writing the derivative agree.
        let m = &slopes[row];
        let slope = (0.75 * (m[4] - m[2]) - 0.15 * (m[5] - m[1]) + (m[6] - m[0]) / 60.0) / step;
        let scale = 1.0 + difference.abs();
        if (slope - difference).abs() > 1e-6 * scale || found[row].1.abs() < 0.05 {
            continue;
        }
        assert!((computed - difference).abs() < 2e-6 * scale, "row {row}: {computed} and {difference}, {slope}");
        let on_border = g.row(row).count() < D * (1 + mesh.facets[facets[row]].nodes().len());
        compared = [compared[0] + 1, compared[1] + usize::from(on_border)];
    }
    compared
}

#[test]
fn rates_are_the_second_derivatives_of_gaps() {
    let mut random = Congruential(14);
    for cells in [Cells::Quadrilaterals, Cells::Triangles, Cells::Mixed] {
        for height in [0.0, 0.4] {
            let mut mesh = grid(4, cells, |x, y| height * (x * 1.9).sin() * (y * 1.4).cos());
            let cloud: Vec<_> = (0..150)
                .map(|_| [2.0 + 1.9 * random.signed(), 2.0 + 1.9 * random.signed(), 0.7 * random.signed()])
                .collect();
            let nodes = mesh.nodes(cloud);
            let [compared, around] = check_acceleration(&mesh, &nodes, &mut random);
            assert!(compared > 60, "{compared}");
            assert!(height == 0.0 || around > 2, "{around}");
        }
    }
    let mut mesh = polygon(6);
    let cloud: Vec<[f64; 2]> = (0..100).map(|_| [1.3 * random.signed(), 1.3 * random.signed()]).collect();
    let nodes = mesh.nodes(cloud);
    let [compared, around] = check_acceleration(&mesh, &nodes, &mut random);
    assert!(compared > 40 && around > 5, "{compared} {around}");
}

#[test]
fn bodies_that_turn_together_have_no_gap_acceleration() {
    let mut random = Congruential(15);
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    for touching in [false, true] {
        let mut mesh = grid(4, Cells::Mixed, |x, y| if touching { 0.0 } else { 0.4 * (x * 1.9).sin() * y.cos() });
        let cloud: Vec<_> = (0..100)
            .map(|k| {
                let z = if touching { 0.0 } else { 0.5 * random.signed() };
                // Some on sides and vertices.
                let round = |x: f64| if k % 3 == 0 { x.round() } else { x };
                [round(2.0 + 1.9 * random.signed()), 2.0 + 1.9 * random.signed(), z]
            })
            .collect();
        let nodes = mesh.nodes(cloud);
        let mut contact = mesh.contact(&nodes, 0.6);
        let u = vec![0.0; mesh.size()];
        contact.search_on(0.0, &u, &u, 0.0).unwrap();
        let omega = [0.7, -1.1, 0.4];
        let (mut v, mut a) = (Vec::new(), Vec::new());
        for &x in &mesh.coordinates {
            v.extend(cross(omega, x));
            a.extend(cross(omega, cross(omega, x)));
        }
        let g = rows(&contact);
        assert!(g.rows() > 60);
        for (row, acceleration) in accelerations(&mut contact, &u, &v).into_iter().enumerate() {
            let total = g.product(row, &a) + acceleration;
            assert!(total.abs() < 1e-12, "{total:e}");
            assert!(!touching || acceleration.abs() < 1e-12, "{acceleration:e}");
        }
    }
}

/// A bead on a rod that turns with constant speed slides outward, r = r₀ cosh ω t, and presses with 2 m ω ṙ.
#[test]
fn a_bead_on_a_turning_rod_is_pushed_by_it() {
    let omega = 1.5_f64;
    let run = |h: f64| {
        // The rod from (4, 0) to the origin, its free side upward; it turns upward and carries the bead along.
        let coordinates = [[4.0, 0.0], [0.0, 0.0], [0.5, 0.0]];
        let dofs = [[0, 1], [2, 3], [4, 5]];
        let contact = NodeToFacet::one_pass(&coordinates, &dofs, &[2], [[0, 1]]).unwrap();
        let stiffness = matrix(6, (0..6).map(|i| (i, i, 0.0)));
        let end = move |axis: usize| {
            move |t: f64| {
                let (sin, cos) = (omega * t).sin_cos();
                let [x, v, a] = [[4.0 * cos - 4.0, 4.0 * sin], [-4.0 * sin, 4.0 * cos], [-4.0 * cos, -4.0 * sin]];
                [x[axis], omega * v[axis], omega * omega * a[axis]]
            }
        };
        let system = LinearSystem::lumped(vec![1.0; 6], stiffness).unwrap();
        let system = system.fix(2).unwrap().fix(3).unwrap().drive(0, end(0)).unwrap().drive(1, end(1)).unwrap();
        let mut run = Simulation::builder(system, Composite, h)
            .velocity(vec![0.0, 4.0 * omega, 0.0, 0.0, 0.0, 0.5 * omega])
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let mut worst = 0.0_f64;
        while run.time() < 1.0 {
            run.step().unwrap();
            let angle = omega * run.time();
            let coriolis = 2.0 * omega * omega * 0.5 * angle.sinh();
            if run.time() > 0.2 {
                let state = run.state();
                let across = state.acceleration()[5] * angle.cos() - state.acceleration()[4] * angle.sin();
                worst = worst.max((across / coriolis - 1.0).abs());
            }
        }
        worst
    };
    let errors = [run(4e-3), run(1e-3)];
    assert!(errors[0] < 0.05 && errors[1] < 0.3 * errors[0], "{errors:?}");
}
