//! Starts: dofs without mass that are not in static balance, and bodies that overlap.

use contact_dynamics::contact::{ContactConstraint, ContactLaw, Contacts, GapOffset, Plane};
use contact_dynamics::mass::{Redistribution, redistribute};
use contact_dynamics::{
    Bathe, CdLagrange, Composite, Error, InitialOverclosure, LinearRows, LinearSystem, Lu, MoreauJean, Newmark,
    NodesOnObstacle, Park, PersistencyCorrection, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{matrix, spring, springs};

/// A bar of n elements (EA/l = 1 a element, mass 1 a element), its first node without mass, the last one fixed.
fn bar(n: usize) -> LinearSystem<'static, f64> {
    let k = matrix(n + 1, springs(n + 1, 1.0));
    let mass = (0..=n).map(|i| [0.0, 1.5, 1.0][i.min(2)]).collect();
    LinearSystem::lumped(mass, k).unwrap().fix(n).unwrap()
}

fn schemes() -> Vec<Box<dyn TimeIntegrator>> {
    vec![
        Box::new(Newmark::trapezoidal()),
        Box::new(Bathe::with_radius(1.0).unwrap()),
        Box::new(Composite),
        Box::new(CdLagrange),
    ]
}

#[test]
fn a_stretched_string_is_let_go_without_a_jump() {
    // Stretched evenly, its end free: the end goes at once to where nothing pulls, with the energy of the first
    // element.
    let n = 50;
    let strain = 1e-3;
    let u: Vec<f64> = (0..=n).map(|i| strain * (n - i) as f64).collect();
    for scheme in schemes() {
        let name = scheme.name();
        let conserves = !name.contains("omposite");
        let mut run = Simulation::builder(bar(n), scheme, 0.2).displacement(u.clone()).build().unwrap();
        let adjustment = run.start_adjustment().expect("the end was pulled");
        let element = 0.5 * strain * strain;
        assert!((adjustment.energy.unwrap() / -element - 1.0).abs() < 1e-9, "{name}: {adjustment:?}");
        assert!(adjustment.dof == 0 && (adjustment.largest - strain).abs() < 1e-12, "{name}: {adjustment:?}");
        let before = run.energy().total();
        assert!((before / ((n - 1) as f64 * element) - 1.0).abs() < 1e-9, "{name}");
        let steps = 4 * n;
        let mut least = f64::INFINITY;
        for _ in 0..steps {
            run.step().unwrap();
            least = least.min(run.energy().total() / before);
        }
        // (It was 1 - 1/n after the first step.)
        assert!(!conserves || least > 1.0 - 2e-3, "{name}: {least}");
    }
}

#[test]
fn nothing_is_left_of_a_jump_of_a_spring_without_mass() {
    // Mass 1 at rest, a spring whose other end is displaced: its energy never was in the motion.
    let system = || LinearSystem::<f64>::lumped(vec![0.0, 1.0], matrix(2, springs(2, 2.25))).unwrap();
    for scheme in schemes() {
        let mut run = Simulation::builder(system(), scheme, 0.01).displacement(vec![1.0, 0.0]).build().unwrap();
        assert!((run.start_adjustment().unwrap().energy.unwrap() + 1.125).abs() < 1e-12);
        run.run_until(1.0, &mut ()).unwrap();
        assert!(run.energy().total().abs() < 1e-20 && run.state().displacement()[0].abs() < 1e-10);
    }
}

#[test]
fn contact_takes_part_in_the_balance() {
    // Pressed on a wall at 0 by its own stretch, or held back from a wall that it does not reach.
    for (second, force) in [(-0.3, 0.3), (0.2, 0.0)] {
        let n = 6;
        let mut u: Vec<f64> = (0..=n).map(|i| second * (n - i) as f64 / (n - 1) as f64).collect();
        u[0] = 0.7;
        for scheme in schemes() {
            let name = scheme.name();
            let mut run = Simulation::builder(bar(n), scheme, 0.1)
                .displacement(u.clone())
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.0))
                .uncorrected()
                .build()
                .unwrap();
            let state = run.state();
            let end = state.displacement()[0];
            assert!((end - second.max(0.0)).abs() < 1e-12, "{name}: {end}");
            assert!((state.contacts().forces()[0] - force).abs() < 1e-12, "{name}");
            run.step().unwrap();
            // No jump of the force in the first step.
            assert!((run.state().contacts().forces()[0] - force).abs() < 0.05, "{name}");
        }
    }
}

#[test]
fn many_contacts_are_balanced_far_from_the_origin() {
    // A plate in its own weight on a floor whose height is large beside what it moves.
    for height in [0.0, 1.0, 1e3] {
        let solid = Solid::rectangle([1.0, 1.0], [20, 20], RUBBER).lifted(height);
        let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&n| solid.nodes[n][1] < height + 1e-9).collect();
        let massless: Vec<usize> = bottom.iter().map(|n| 2 * n + 1).collect();
        let groups: Vec<usize> = (0..solid.dofs()).map(|dof| dof % 2).collect();
        let stiffness = solid.stiffness::<f64>();
        let by = Redistribution::Neighbors(stiffness.symbolic());
        let mass = redistribute(&solid.lumped_mass(), &massless, &groups, by).unwrap();
        let weight: Vec<f64> = solid
            .lumped_mass::<f64>()
            .iter()
            .enumerate()
            .map(|(dof, m)| if dof % 2 == 1 { -1e-2 * m } else { 0.0 })
            .collect();
        let carried: f64 = bottom.iter().map(|n| -weight[2 * n + 1]).sum();
        let floor = Plane::new([0.0, height], [0.0, 1.0]).unwrap();
        let rows = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
        let system =
            LinearSystem::lumped(mass, solid.stiffness()).unwrap().load(move |_, f| f.copy_from_slice(&weight));
        let run = Simulation::builder(system, CdLagrange, 1e-3).constraint(rows).uncorrected().build().unwrap();
        let forces: f64 = run.state().contacts().forces().iter().sum();
        assert!((forces / carried - 1.0).abs() < 1e-6, "{height}: {forces} {carried}");
    }
}

#[test]
fn what_is_in_balance_or_damped_is_left_alone() {
    let n = 8;
    let mut u: Vec<f64> = (0..=n).map(|i| 1e-3 * ((n - i) as f64).sin()).collect();
    u[0] = u[1];
    let run = Simulation::builder(bar(n), Newmark::trapezoidal(), 0.1).displacement(u.clone()).build().unwrap();
    assert!(run.start_adjustment().is_none());
    assert!(run.state().displacement().iter().zip(&u).all(|(x, y)| x.to_bits() == y.to_bits()));
    // With a damper at the end its displacement is an initial value: it creeps.
    u[0] = 0.1;
    let damped = bar(n).rayleigh(0.0, 0.5).unwrap();
    let run = Simulation::builder(damped, Newmark::trapezoidal(), 0.1).displacement(u.clone()).build().unwrap();
    assert!(run.start_adjustment().is_none() && run.state().displacement()[0].to_bits() == 0.1_f64.to_bits());
}

/// Three nodes without mass on springs under loads, off their balance by as little as one likes: what they are moved by
/// is that, until it is rounding.
#[test]
fn starts_as_near_to_balance_as_one_likes_are_balanced() {
    let (k, n, loads) = (0.3, 6, [0.01, -0.02, 0.05]);
    // From the first node with mass on, each spring bears the loads of those before it.
    let mut exact = vec![0.7; n];
    exact[n - 1] = 0.0;
    let mut borne: f64 = loads.iter().sum();
    for node in (0..3).rev() {
        exact[node] = exact[node + 1] + borne / k;
        borne -= loads[node];
    }
    let mass: Vec<f64> = (0..n).map(|node| if node < 3 { 0.0 } else { 1.0 }).collect();
    let load = |_: f64, f: &mut [f64]| f[..3].copy_from_slice(&loads);
    for power in 1..15 {
        let off = 10.0_f64.powi(-power);
        let mut u = exact.clone();
        (0..3).for_each(|node| u[node] += off * [1.0, -0.9, 0.7][node]);
        let system = LinearSystem::lumped(mass.clone(), matrix(n, springs(n, k))).unwrap().fix(n - 1).unwrap();
        let run = Simulation::builder(system.load(load), Newmark::trapezoidal(), 0.1).displacement(u).build().unwrap();
        for (found, exact) in run.state().displacement().iter().zip(&exact) {
            assert!((found - exact).abs() < 1e-14 + off.min(1e-12), "{power}: {found} {exact}");
        }
        match run.start_adjustment() {
            Some(adjustment) => assert!(adjustment.dof == 0 && (adjustment.largest - off).abs() < 1e-14, "{power}"),
            None => assert!(off < 1e-12, "{power}"),
        }
    }
}

const RUBBER: Material = Material { young: 50.0, poisson: 0.25, density: 1.0 };

#[test]
fn newtons_method_balances_large_strains() {
    let solid = Solid::rectangle([1.0, 0.6], [6, 4], RUBBER);
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&n| solid.nodes[n][1] < 1e-9).collect();
    let massless: Vec<usize> = bottom.iter().flat_map(|n| [2 * n, 2 * n + 1]).collect();
    let groups: Vec<usize> = (0..solid.dofs()).map(|dof| dof % 2).collect();
    let stiffness = solid.stiffness::<f64>();
    let by = Redistribution::Neighbors(stiffness.symbolic());
    let light = redistribute(&solid.lumped_mass(), &massless, &groups, by).unwrap();
    let body = || Hyperelastic::new(&solid, Law::NeoHookean).masses(light.clone());
    // Bent, and the bottom scattered; a floor keeps it from going down.
    let mut u: Vec<f64> = (0..solid.dofs())
        .map(|dof| if dof % 2 == 1 { 0.15 * (3.0 * solid.nodes[dof / 2][0]).sin().abs() } else { 0.0 })
        .collect();
    for (k, &dof) in massless.iter().enumerate() {
        u[dof] += 0.02 * (7.3 * k as f64).sin().abs();
    }
    let build = |u: Vec<f64>| {
        let floor = Plane::new([0.0, 0.0], [0.0, 1.0]).unwrap();
        let rows = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
        Simulation::builder(body(), Newmark::trapezoidal(), 0.01)
            .displacement(u)
            .constraint(rows)
            .uncorrected()
            .build()
            .unwrap()
    };
    let mut run = build(u);
    let adjustment = run.start_adjustment().unwrap();
    assert!(adjustment.energy.unwrap() < 0.0 && adjustment.largest > 1e-3, "{adjustment:?}");
    // The balance is one: nothing moves when it is taken as the start.
    let again = build(run.state().displacement().to_vec());
    assert!(again.start_adjustment().is_none_or(|again| again.largest < 1e-9 * adjustment.largest));
    let before = run.energy().total();
    run.step().unwrap();
    assert!((run.energy().total() / before - 1.0).abs() < 0.05, "{}", run.energy().total() / before);
}

fn pendulum() -> LinearSystem<'static, f64> {
    LinearSystem::lumped(vec![1.0], matrix(1, [(0, 0, 4.0)])).unwrap()
}

#[test]
fn slivers_within_the_rounding_of_coordinates_are_no_overclosure() {
    // Twelve digits of a coordinate of size 1.
    let build = |rows: LinearRows<'static, f64>| {
        Simulation::builder(pendulum(), Newmark::trapezoidal(), 0.01)
            .constraint(rows)
            .corrector(PersistencyCorrection::new())
            .build()
    };
    let row = |gap: f64| LinearRows::new().unilateral(&[(0, 1.0)], gap);
    assert!(matches!(build(row(-5e-13)), Err(Error::InitialViolation { .. })));
    assert!(build(row(-5e-13).coordinates(1.0)).is_ok());
    assert!(matches!(build(row(-5e-12).coordinates(1.0)), Err(Error::InitialViolation { .. })));
    // In another unit of length.
    assert!(build(row(-5e-10).coordinates(1e3)).is_ok() && build(row(-5e-9).coordinates(1e3)).is_err());
    // Obstacles know the coordinates.
    let solid = Solid::rectangle([1.0, 0.6], [4, 3], RUBBER).lifted(1.0);
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&n| solid.nodes[n][1] < 1.0 + 1e-9).collect();
    let drop = |depth: f64| {
        let floor = Plane::new([0.0, 1.0 + depth], [0.0, 1.0]).unwrap();
        let rows = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
        let system = LinearSystem::lumped(solid.lumped_mass(), solid.stiffness()).unwrap();
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), 1e-3)
            .constraint(rows)
            .corrector(PersistencyCorrection::new())
            .build()?;
        run.run_until(0.1, &mut ())?;
        Ok::<f64, Error>(run.energy().total())
    };
    assert!(drop(5e-13).unwrap() < 1e-18);
    assert!(drop(1e-10).is_err());
}

#[test]
fn gaps_are_measured_from_where_they_start() {
    let solid = Solid::rectangle([1.0, 0.6], [4, 3], RUBBER);
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&n| solid.nodes[n][1] < 1e-9).collect();
    // A floor that is not level: every node has a depth of its own, and the last ones none.
    let floor = || Plane::new([0.7, 0.0], [0.01, 1.0]).unwrap();
    let load = |_: f64, f: &mut [f64]| f.iter_mut().skip(1).step_by(2).for_each(|f| *f = -0.02);
    let builder = |overclosure: InitialOverclosure, load_on: bool| {
        let rows = NodesOnObstacle::new(floor(), &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
        let system = LinearSystem::lumped(solid.lumped_mass(), solid.stiffness()).unwrap();
        let system = if load_on { system.load(load) } else { system };
        Simulation::builder(system, Newmark::trapezoidal(), 1e-3)
            .constraint(rows)
            .corrector(PersistencyCorrection::new())
            .initial_overclosure(overclosure)
    };
    assert!(matches!(builder(InitialOverclosure::Refused, false).build(), Err(Error::InitialViolation { .. })));
    let mut run = builder(InitialOverclosure::AdjustedGaps, false).build().unwrap();
    assert!(run.gaps().iter().all(|gap| *gap >= 0.0) && run.gaps().iter().any(|gap| *gap > 1e-3));
    run.run_until(0.2, &mut ()).unwrap();
    assert!(run.energy().total().abs() < 1e-300 && run.state().displacement().iter().all(|u| *u == 0.0));
    // Under load no node goes deeper than it was, and a continued run remembers how deep that is.
    let mut run = builder(InitialOverclosure::AdjustedGaps, true).build().unwrap();
    run.run_until(0.2, &mut ()).unwrap();
    let resumed = builder(InitialOverclosure::Refused, true).resume(run.state().clone(), run.history().clone());
    let mut resumed = resumed.build().unwrap();
    run.run_until(0.4, &mut ()).unwrap();
    resumed.run_until(0.4, &mut ()).unwrap();
    assert_eq!(run.state().displacement(), resumed.state().displacement());
    assert!(run.gaps().iter().all(|gap| *gap > -1e-12) && run.state().contacts().closed().iter().any(|closed| *closed));
    for &node in &bottom {
        let depth = (-floor_gap(solid.nodes[node])).max(0.0);
        let gap = floor_gap([0, 1].map(|axis| solid.nodes[node][axis] + run.state().displacement()[2 * node + axis]));
        assert!(gap > -depth - 1e-12, "{gap} {depth}");
    }
    // A time that is none.
    for time in [0.0, -1.0, f64::NAN] {
        assert!(matches!(builder(InitialOverclosure::RemovedOver(time), false).build(), Err(Error::Parameter { .. })));
    }
}

fn floor_gap([x, y]: [f64; 2]) -> f64 {
    (0.01 * (x - 0.7) + y) / 1.0_f64.hypot(0.01)
}

#[test]
fn overlap_that_is_removed_strains_what_it_moves() {
    // A mass on a spring of stiffness 4, 0.01 deep in a wall: it is pushed out along 1 − 3 τ² + 2 τ³.
    let (depth, time) = (0.01, 2.0);
    for scheme in [Box::new(Newmark::trapezoidal()) as Box<dyn TimeIntegrator>, Box::new(Bathe::default())] {
        let name = scheme.name();
        let mut run = Simulation::builder(pendulum(), scheme, 0.01)
            .constraint(LinearRows::new().equality(&[(0, 1.0)], -depth))
            .corrector(PersistencyCorrection::new())
            .initial_overclosure(InitialOverclosure::RemovedOver(time))
            .energy_balance()
            .build()
            .unwrap();
        let mut worst = [0.0_f64; 2];
        while run.time() < 3.0 {
            run.step().unwrap();
            let x = (run.time() / time).min(1.0);
            let u = depth * x * x * (3.0 - 2.0 * x);
            let acceleration = if x < 1.0 { depth * (6.0 - 12.0 * x) / (time * time) } else { 0.0 };
            worst[0] = worst[0].max((run.state().displacement()[0] - u).abs());
            // (Where it begins and ends the acceleration jumps.)
            if (run.time() - time).abs() > 0.02 && run.time() > 0.02 {
                worst[1] = worst[1].max((run.state().contacts().forces()[0] - 4.0 * u - acceleration).abs());
            }
        }
        assert!(worst[0] < 1e-13 && worst[1] < 2e-2 * 4.0 * depth, "{name}: {worst:?}");
        assert!((run.energy().total() / (2.0 * depth * depth) - 1.0).abs() < 1e-3, "{name}: {}", run.energy().total());
    }
}

/// Forces of stiff springs, and of dashpots, cancel in a rigid motion but for their rounding, which is no acceleration:
/// whatever the stiffness, the order of the dofs, the motion and the place, the past is a straight line. A load is none
/// of this.
#[test]
fn a_rigid_motion_of_a_stiff_body_begins_with_its_past() {
    let mut random = Congruential(5);
    for case in 0..200 {
        let stiffness = 10.0_f64.powf(8.0 * random.unit());
        let (n, speed, place) = (12, 1e3 * random.signed(), if case % 2 == 0 { 0.0 } else { 1e3 * random.signed() });
        let mut dofs: Vec<(f64, usize)> = (0..n).map(|dof| (random.unit(), dof)).collect();
        dofs.sort_by(|x, y| x.0.total_cmp(&y.0));
        let dofs: Vec<usize> = dofs.into_iter().map(|(_, dof)| dof).collect();
        let mut springs = Vec::new();
        for i in 0..n {
            let others = [i + 1, i + 3].into_iter().filter(|&j| j < n);
            springs.extend(others.flat_map(|j| spring(dofs[i], dofs[j], stiffness * (0.5 + random.unit()))));
        }
        let mass: Vec<f64> = (0..n).map(|_| 0.5 + random.unit()).collect();
        for (load, known) in [(0.0, 2), (1e-3, 0)] {
            let k = matrix(n, springs.iter().copied());
            let system = LinearSystem::lumped(mass.clone(), k).unwrap().rayleigh(0.0, 1e-3).unwrap();
            let run = Simulation::builder(system.load(move |_, f| f[0] = load * stiffness), Park, 0.5)
                .displacement(vec![place; n])
                .velocity(vec![speed; n])
                .build()
                .unwrap();
            assert_eq!(run.history().len(), known, "case {case}: stiffness {stiffness:e}, load {load}");
        }
    }
}

/// A node that is deep in two facets beside each other: the overlap is that with the deeper one, for both.
#[derive(Debug)]
struct InDent([f64; 2]);

impl ContactConstraint<f64> for InDent {
    fn dofs(&self) -> &[usize] {
        &[0]
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        for facet in 0..2 {
            contacts.push((4, facet), ContactLaw::Rigid, &[(0, 1.0)]);
        }
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<(), Error> {
        gaps.copy_from_slice(&self.0.map(|depth| u[0] - depth));
        Ok(())
    }
}

#[test]
fn of_several_overlaps_of_a_node_the_deepest_counts() {
    for depths in [[1e-3, 2e-3], [2e-3, 1e-3], [1.5e-3, 1.5e-3]] {
        let mut run = Simulation::builder(pendulum(), Newmark::trapezoidal(), 0.01)
            .constraint(InDent(depths))
            .initial_overclosure(InitialOverclosure::AdjustedGaps)
            .build()
            .unwrap();
        run.run_until(0.2, &mut ()).unwrap();
        assert_eq!(run.state().displacement(), [0.0], "{depths:?}");
    }
}

/// A body whose foot without mass stands on the floor slides along it, with a mass along the floor: the friction of its
/// weight slows it from the start.
#[test]
fn friction_below_a_foot_without_mass_acts_from_the_start() {
    let k = matrix(3, spring(1, 2, 100.0));
    let system = LinearSystem::<f64>::lumped(vec![2.0, 0.0, 1.0], k).unwrap().load(|_, f| f[2] -= 10.0);
    let run = Simulation::builder(system, Newmark::trapezoidal(), 0.01)
        .displacement(vec![0.0, 0.0, -0.1])
        .velocity(vec![1.0, 0.0, 0.0])
        .constraint(LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.5, &[&[(0, 1.0)]]))
        .build()
        .unwrap();
    let (contacts, a) = (run.state().contacts(), run.state().acceleration());
    assert!((contacts.forces()[0] - 10.0).abs() < 1e-12 && (a[0] + 2.5).abs() < 1e-12, "{contacts:?} {a:?}");
}

/// A damped dof without mass that a wall holds at the start has no velocity toward it.
#[test]
fn what_a_wall_holds_does_not_begin_to_creep() {
    let mut tried = 0;
    for make in schemes() {
        let k = matrix(2, spring(0, 1, 4.0));
        let system = LinearSystem::lumped(vec![1.0, 0.0], k).unwrap().damping(matrix(2, [(1, 1, 0.5)])).unwrap();
        let name = make.name();
        let built = Simulation::builder(system, make, 0.01)
            .displacement(vec![-0.1, 0.0])
            .constraint(LinearRows::new().unilateral(&[(1, 1.0)], 0.0))
            .build();
        let Ok(mut run) = built else { continue };
        assert_eq!(run.state().velocity()[1..], [0.0], "{name}");
        for _ in 0..5 {
            run.step().unwrap();
            let u: f64 = run.state().displacement()[1];
            assert!(u.abs() < 1e-15, "{name}: {u:e}");
        }
        assert!(run.state().contacts().forces()[0] > 0.3, "{name}");
        tried += 1;
    }
    // (Explicit schemes may refuse damping there.)
    assert!(tried >= 3, "{tried}");
}

/// Damped dofs without mass between springs that differ much begin in balance too, to the rounding of the stiffest.
#[test]
fn damped_dofs_between_soft_and_stiff_springs_begin_in_balance() {
    let mut random = Congruential(83);
    for trial in 0..50 {
        // (Masses at both ends, and two dofs without that a stiff one ties.)
        let stiff = [1e-3 * 10.0_f64.powi(trial / 10), 10.0_f64.powi(trial % 6), 1e-3 * (1.0 + random.unit())];
        let k = matrix(4, (0..3).flat_map(|i| spring(i, i + 1, stiff[i])));
        let u = random.vector(4, 1e-3);
        let system = LinearSystem::lumped(vec![1.0, 0.0, 0.0, 1.0], k).unwrap().rayleigh(0.0, 0.01).unwrap();
        let run = Simulation::builder(system, Newmark::trapezoidal(), 1e-4)
            .displacement(u.clone())
            .velocity(random.vector(4, 1.0))
            .build()
            .unwrap();
        let v = run.state().velocity();
        for dof in [1, 2] {
            let pull = |x: &[f64], i: usize| stiff[i] * (x[i + 1] - x[i]);
            let terms = [dof - 1, dof].map(|i| pull(&u, i) + 0.01 * pull(v, i));
            let scale = [dof - 1, dof].map(|i| stiff[i] * (0.01 * v[i].abs().max(v[i + 1].abs()) + 1e-3));
            let miss = (terms[1] - terms[0]).abs() / (scale[0] + scale[1]);
            assert!(miss < 1e-13, "{trial}, {dof}: {miss:e}");
        }
    }
}

/// A body of a few masses on springs from each to the next, some of them without mass.
struct Chain {
    stiffness: f64,
    mass: &'static [f64],
    /// A damper of so much from a dof to the ground.
    damper: Option<(usize, f64)>,
    u: &'static [f64],
    v: &'static [f64],
    /// A wall that touches a dof from below.
    wall: Option<usize>,
}

/// u, v and a with which some bodies start that nothing couples.
fn start_of(chains: &[&Chain]) -> Result<Vec<Vec<[f64; 3]>>, Error> {
    let firsts: Vec<usize> =
        (0..chains.len()).map(|i| chains[..i].iter().map(|chain| chain.mass.len()).sum()).collect();
    let of = |pick: &dyn Fn(&Chain) -> &'static [f64]| chains.iter().flat_map(|chain| pick(chain)).copied().collect();
    let (mass, u, v): (Vec<f64>, Vec<f64>, Vec<f64>) =
        (of(&|chain| chain.mass), of(&|chain| chain.u), of(&|chain| chain.v));
    let (mut k, mut c, mut walls) = (Vec::new(), Vec::new(), LinearRows::new());
    for (chain, first) in chains.iter().zip(&firsts) {
        k.extend((1..chain.mass.len()).flat_map(|i| spring(first + i - 1, first + i, chain.stiffness)));
        c.extend(chain.damper.map(|(dof, c)| (first + dof, first + dof, c)));
        if let Some(dof) = chain.wall {
            walls = walls.unilateral(&[(first + dof, 1.0)], -chain.u[dof]);
        }
    }
    let n = mass.len();
    let system = LinearSystem::lumped(mass, matrix(n, k))?.damping(matrix(n, c))?;
    let run = Simulation::builder(system, Newmark::trapezoidal(), 0.01)
        .linear_solver(Lu)
        .displacement(u)
        .velocity(v)
        .constraint(walls)
        .build()?;
    let (state, dofs) = (run.state(), chains.iter().map(|chain| chain.mass.len()));
    let at = |dof: usize| [state.displacement()[dof], state.velocity()[dof], state.acceleration()[dof]];
    Ok(firsts.iter().zip(dofs).map(|(first, len)| (*first..first + len).map(at).collect()).collect())
}

/// What holds of one body, that it is damped, unstable, or touches a wall, is not laid to another.
#[test]
fn each_body_starts_as_it_would_alone() {
    let compare = |found: &[[f64; 3]], expected: &[[f64; 3]], what: &str| {
        for (dof, (x, y)) in found.iter().zip(expected).enumerate() {
            let miss = x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(miss < 1e-12, "{what}, dof {dof}: u, v, a are {x:?}, not {y:?}");
        }
    };
    let chain = |mass, u, v| Chain { stiffness: 2.0, mass, damper: None, u, v, wall: None };
    let (moves, rests): (&[f64], &[f64]) = (&[0.5, 0.25], &[0.0, 0.0]);
    let stretched = chain(&[0.0, 1.0, 1.0], &[0.3, 0.0, 0.1], &[0.0, 0.2, 0.1]);
    let damped = Chain { damper: Some((1, 0.5)), ..chain(&[1.0, 0.0], &[0.1, 0.0], moves) };
    let held = Chain { damper: Some((1, 0.5)), wall: Some(1), ..chain(&[1.0, 0.0], &[-0.1, 0.05], rests) };
    let lifted = Chain { damper: Some((1, 0.5)), wall: Some(1), ..chain(&[1.0, 0.0], &[0.1, 0.05], rests) };
    let partly = Chain { damper: Some((2, 0.5)), ..chain(&[1.0, 0.0, 0.0], &[0.2, 0.0, 0.1], &[0.0, 0.0, 0.0]) };
    let unstable = Chain { stiffness: -2.0, ..chain(&[1.0, 0.0], &[0.1, 0.3], rests) };
    let all = [&stretched, &damped, &held, &lifted, &partly, &unstable];
    let alone: Vec<Vec<[f64; 3]>> = all.iter().map(|chain| start_of(&[chain]).unwrap().remove(0)).collect();
    // The end of the string goes to where its spring pulls no more; the damped foot creeps as its spring pulls it, also
    // off a wall, and its mass is pulled by the damper; a dof between others goes to where both springs pull alike.
    let expected: [&[[f64; 3]]; 6] = [
        &[[0.0, 0.0, 0.0], [0.0, 0.2, 0.2], [0.1, 0.1, -0.2]],
        &[[0.1, 0.5, -0.2], [0.0, 0.4, 0.0]],
        &[[-0.1, 0.0, 0.3], [0.05, 0.0, 0.0]],
        &[[0.1, 0.0, -0.1], [0.05, 0.2, 0.0]],
        &[[0.2, 0.0, -0.1], [0.15, 0.0, 0.0], [0.1, 0.2, 0.0]],
        &[[0.1, 0.0, -0.4], [0.3, 0.0, 0.0]],
    ];
    for (body, (found, expected)) in alone.iter().zip(expected).enumerate() {
        compare(found, expected, &format!("body {body}"));
    }
    for chains in (1_usize..64).filter(|chains| chains.count_ones() > 1) {
        let present = |i: &usize| (chains >> i) & 1 == 1;
        let members: Vec<usize> = (0..all.len()).filter(present).collect();
        let together = start_of(&members.iter().map(|&i| all[i]).collect::<Vec<_>>()).unwrap();
        for (&member, found) in members.iter().zip(&together) {
            compare(found, &alone[member], &format!("body {member} of {members:?}"));
        }
    }
}

/// A weight on a floor that moves evenly, as fast as the weight: the force at the start is the weight, also of schemes
/// that impose contact on velocities.
#[test]
fn a_floor_that_moves_carries_its_weight_from_the_start() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] =
        [|| Box::new(CdLagrange), || Box::new(MoreauJean::new(0.5).unwrap()), || Box::new(Newmark::trapezoidal())];
    for scheme in schemes {
        for speed in [-3.0, 0.0, 0.2, 3.0] {
            let system = LinearSystem::lumped(vec![2.0], matrix(1, [(0, 0, 0.0)])).unwrap().load(|_, f| f[0] = -14.0);
            let floor = GapOffset::moving(move |t: f64| [-speed * t, -speed, 0.0]);
            let mut run = Simulation::builder(system, scheme(), 1e-2)
                .velocity(vec![speed])
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], floor))
                .uncorrected()
                .build()
                .unwrap();
            for step in 0..4 {
                let force = run.state().contacts().forces()[0];
                assert!((force - 14.0).abs() < 1e-11, "{}, {speed}, step {step}: {force}", scheme().name());
                assert!((run.state().velocity()[0] - speed).abs() < 1e-13);
                run.step().unwrap();
            }
        }
    }
}
