//! Many candidates and many pressed contacts: what they cost is what presses, and what is kept of them changes nothing.

use contact_dynamics::contact::{GapOffset, NodesOnObstacle, Plane, Side, Sphere};
use contact_dynamics::contact_solver::Pivoting;
use contact_dynamics::{CentralDifference, LinearRows, LinearSystem, Newmark, Simulation, SimulationBuilder};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{entries, matrix};

/// A thin block on a large ball that slides under it: all nodes at the bottom press, and their normals turn.
fn sliding(cells: [usize; 3]) -> contact_dynamics::SimulationBuilder<'static, f64> {
    let radius = 1e3;
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let plate = Solid::block([4.0, 4.0, 0.5], cells, material);
    let height = |x: [f64; 3]| (radius * radius - (x[0] - 2.0).powi(2) - (x[1] - 2.0).powi(2)).sqrt() - radius;
    let places: Vec<[f64; 3]> = plate.nodes.iter().map(|&x| [x[0], x[1], x[2] + height(x)]).collect();
    let bottom: Vec<usize> = (0..places.len()).filter(|&node| plate.nodes[node][2] == 0.0).collect();
    let ball = Sphere::new([2.0, 2.0, -radius], radius, Side::Outside).unwrap();
    let contact = NodesOnObstacle::new(ball, &places, &plate.node_dofs(), &bottom)
        .unwrap()
        .moving(|t| [[0.1 * t, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0; 3]]);
    let mass = plate.lumped_mass::<f64>();
    let system = plate.system::<f64>().load(move |_, f| {
        f.iter_mut().zip(&mass).skip(2).step_by(3).for_each(|(f, m)| *f = -1e-2 * m);
    });
    Simulation::builder(system, Newmark::trapezoidal(), 0.2).constraint(contact)
}

fn closed(run: &Simulation<'_, f64>) -> usize {
    run.state().contacts().closed().iter().filter(|&&closed| closed).count()
}

#[test]
fn hundreds_of_turning_contacts_go_on_bit_for_bit() {
    let cells = [17, 17, 1];
    let mut run = sliding(cells).build().unwrap();
    for _ in 0..5 {
        run.step().unwrap();
    }
    assert!(closed(&run) > 300, "{}", closed(&run));
    let mut resumed = sliding(cells).resume(run.state().clone(), run.history().clone()).build().unwrap();
    for step in 0..5 {
        run.step().unwrap();
        resumed.step().unwrap();
        assert_eq!(run.state(), resumed.state(), "step {step}");
    }
}

/// Masses without springs that fall to the ground, one after the other: candidates of which few press.
fn rain(count: usize, candidates: impl Iterator<Item = usize>) -> Simulation<'static, f64> {
    let free = matrix(count, vec![(0, 0, 0.0)]);
    let system = LinearSystem::lumped(vec![1.0; count], free).unwrap().load(|_, f| f.fill(-1.0));
    let rows =
        candidates.fold(LinearRows::new(), |rows, dof| rows.unilateral(&[(dof, 1.0)], 1e-4 * (dof % 1000) as f64));
    Simulation::builder(system, CentralDifference, 1e-2).constraint(rows).build().unwrap()
}

#[test]
fn candidates_that_stay_open_take_no_part() {
    let count = 200_000;
    let mut all = rain(count, 0..count);
    let near = |dof: &usize| dof % 1000 < 60;
    let mut few = rain(count, (0..count).filter(near));
    for _ in 0..8 {
        all.step().unwrap();
        few.step().unwrap();
    }
    let pressed = closed(&all);
    assert!(pressed > 1000 && pressed == closed(&few), "{pressed} {}", closed(&few));
    for dof in (0..count).filter(near) {
        let of = |run: &Simulation<'_, f64>| {
            [run.state().displacement()[dof], run.state().velocity()[dof]].map(f64::to_bits)
        };
        assert_eq!(of(&all), of(&few));
    }
}

/// A thin neo-Hookean block that falls flat on the floor: hundreds of contacts close at once.
fn soft() -> contact_dynamics::SimulationBuilder<'static, f64> {
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let solid = Solid::block([4.0, 4.0, 0.5], [16, 16, 1], material);
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
    let floor = Plane::new([0.0, 0.0, -0.01], [0.0, 0.0, 1.0]).unwrap();
    let contact = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
    let body = Hyperelastic::new(&solid, Law::NeoHookean).gravity([0.0, 0.0, -0.01]);
    let v = solid.uniform([0.02, 0.0, -0.1]);
    Simulation::builder(body, Newmark::trapezoidal(), 0.1).velocity(v).constraint(contact)
}

#[test]
fn contact_by_products_of_w_is_that_of_its_entries() {
    let mut applied = soft().build().unwrap();
    let mut formed = soft().contact_solver(Pivoting::default()).build().unwrap();
    let mut most = 0;
    for step in 0..6 {
        applied.step().unwrap();
        formed.step().unwrap();
        most = most.max(closed(&applied));
        let scale = formed.state().velocity().iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
        for (a, b) in applied.state().velocity().iter().zip(formed.state().velocity()) {
            assert!((a - b).abs() < 1e-8 * scale, "step {step}: {a} {b}");
        }
    }
    assert!(most > 256, "{most}");
    let mut resumed = soft().resume(applied.state().clone(), applied.history().clone()).build().unwrap();
    for step in 0..2 {
        applied.step().unwrap();
        resumed.step().unwrap();
        assert!(applied.state() == resumed.state(), "step {step}");
    }
}

/// Plates side by side on a floor that waves: in every step some contacts open, others close.
fn on_waves(plates: usize, cells: [usize; 3]) -> SimulationBuilder<'static, f64> {
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let plate = Solid::block([2.0, 2.0, 0.5], cells, material);
    let bottom: Vec<usize> = (0..plate.nodes.len()).filter(|&node| plate.nodes[node][2] == 0.0).collect();
    let (mass, stiffness) = (plate.lumped_mass::<f64>(), plate.stiffness::<f64>());
    let (n, own) = (mass.len(), entries(&stiffness));
    let all = (0..plates).flat_map(|body| own.iter().map(move |&(i, j, x)| (body * n + i, body * n + j, x)));
    let masses = mass.repeat(plates);
    let weight = masses.clone();
    let system = LinearSystem::lumped(masses, matrix(plates * n, all)).unwrap().load(move |_, f| {
        f.iter_mut().zip(&weight).skip(2).step_by(3).for_each(|(f, m)| *f = -0.05 * m);
    });
    let places = (0..plates).flat_map(|body| bottom.iter().map(move |&node| (body, node)));
    let rows = places.fold(LinearRows::new(), |rows, (body, node)| {
        let phase = 5.0 * plate.nodes[node][0] + 3.0 * plate.nodes[node][1] + body as f64;
        let wave = move |t: f64| {
            let (sin, cos) = (phase + 2.0 * t).sin_cos();
            [0.03 - 0.03 * sin, -0.06 * cos, 0.12 * sin]
        };
        rows.unilateral(&[(body * n + 3 * node + 2, 1.0)], GapOffset::moving(wave))
    });
    Simulation::builder(system, Newmark::trapezoidal(), 0.1).constraint(rows)
}

#[test]
fn rows_that_come_and_go_leave_nothing_behind() {
    // (What is kept of W and of the responses belongs to rows, not to the way that led to them.)
    for (plates, cells) in [(1, [5, 5, 1]), (3, [13, 13, 1])] {
        let mut run = on_waves(plates, cells).build().unwrap();
        let (mut most, mut least, mut before, mut changes) = (0, usize::MAX, Vec::new(), 0);
        for step in 0..24 {
            let (state, history) = (run.state().clone(), run.history().clone());
            run.step().unwrap();
            let closed_now = run.state().contacts().closed().to_vec();
            changes += closed_now.iter().zip(&before).filter(|(now, before)| now != before).count();
            before = closed_now;
            if step > 4 {
                (most, least) = (most.max(closed(&run)), least.min(closed(&run)));
            }
            if step % 4 == 3 {
                let mut fresh = on_waves(plates, cells).resume(state, history).build().unwrap();
                fresh.step().unwrap();
                assert_eq!(run.state(), fresh.state(), "{plates} plates, step {step}");
            }
        }
        assert!(changes > 10 * plates && least < most, "{plates}: {changes} {least} {most}");
        assert!(plates == 1 || most > 256, "{most}");
    }
}
