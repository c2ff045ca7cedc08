//! Runs that start at rest under their loads: in static balance with contact and friction, and they stay there.

use contact_dynamics::contact::Plane;
use contact_dynamics::{
    Bathe, CentralDifference, Composite, Error, LinearRows, LinearSystem, Newmark, NodesOnObstacle, Simulation,
    SimulationBuilder, TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{matrix, product, springs};

fn schemes() -> Vec<Box<dyn TimeIntegrator>> {
    vec![
        Box::new(Newmark::trapezoidal()),
        Box::new(Bathe::with_radius(1.0).unwrap()),
        Box::new(Composite),
        Box::new(CentralDifference),
    ]
}

/// A bar of n + 1 masses and n springs of stiffness k, the last node fixed, a force on each free one.
fn bar(n: usize, k: f64, force: f64) -> LinearSystem<'static, f64> {
    let stiffness = matrix(n + 1, springs(n + 1, k));
    let system = LinearSystem::lumped(vec![1.0; n + 1], stiffness).unwrap().fix(n).unwrap();
    system.load(move |_, f| f[..n].iter_mut().for_each(|f| *f += force))
}

#[test]
fn a_bar_hangs_in_its_weight_on_a_wall_it_reaches_or_not() {
    // Free, its end sinks by Σ j = n (n + 1)/2 times f/k; the wall takes what it would sink further times k/n.
    for scale in [1.0, 1e-7, 1e9] {
        let (n, k, force) = (12, 3.0 * scale, -0.5 * scale);
        let free: f64 = force / k * (n * (n + 1)) as f64 / 2.0;
        for share in [0.6, 1.5] {
            let gap = share * free.abs();
            let push = k / n as f64 * (free.abs() - gap).max(0.0);
            for scheme in schemes() {
                let name = scheme.name();
                let mut run = Simulation::builder(bar(n, k, force), scheme, 0.1 / scale.sqrt())
                    .constraint(LinearRows::new().unilateral(&[(0, 1.0)], gap))
                    .start_at_rest()
                    .build()
                    .unwrap();
                let adjustment = run.start_adjustment().unwrap();
                let end = free.max(-gap);
                assert!(adjustment.largest >= end.abs() * (1.0 - 1e-12), "{name}: {adjustment:?}");
                // (The wall, which does not move, does no work.)
                let start = run.state().displacement().to_vec();
                let work: f64 = start[..n].iter().map(|u| force * u).sum();
                let strain: f64 = start.windows(2).map(|u| 0.5 * k * (u[1] - u[0]).powi(2)).sum();
                assert!((adjustment.energy.unwrap() / (strain - work) - 1.0).abs() < 1e-9, "{name}");
                for _ in 0..200 {
                    let state = run.state();
                    assert!((state.displacement()[0] - end).abs() < 1e-11 * end.abs(), "{name}");
                    let pressed = state.contacts().forces()[0];
                    assert!((pressed - push).abs() < 1e-9 * force.abs(), "{name}, {share}: {pressed} {push}");
                    run.step().unwrap();
                }
                let moved = run.state().displacement().iter().zip(&start).map(|(x, y)| (x - y).abs());
                assert!(moved.fold(0.0, f64::max) < 1e-11 * end.abs(), "{name}");
            }
        }
    }
}

/// A gap in another unit than displacements have: the same rest, by a force as much smaller as the gap is larger.
#[test]
fn rests_do_not_depend_on_the_unit_of_the_gap() {
    for (n, unit) in [12, 300].into_iter().flat_map(|n| [1e-6, 1e-3, 1.0, 1e3, 1e6].map(|unit| (n, unit))) {
        for share in [0.3, 0.61, 0.77] {
            let (k, force) = (3.1, -0.5);
            let free: f64 = force / k * (n * (n + 1)) as f64 / 2.0;
            let (gap, rounding) = (share * free.abs(), 1e-11 * free.abs());
            let mut run = Simulation::builder(bar(n, k, force), Newmark::trapezoidal(), 0.1)
                .constraint(LinearRows::new().unilateral(&[(0, unit), (1, 0.3 * unit)], unit * gap))
                .start_at_rest()
                .build()
                .unwrap();
            let start = run.state().displacement().to_vec();
            assert!((start[0] + 0.3 * start[1] + gap).abs() < rounding, "{n}, {unit}, {share}");
            let pressed = run.state().contacts().forces()[0] * unit;
            // (What the spring between the wall's two dofs bears.)
            let borne = k * (start[1] - start[0]) + force;
            assert!((pressed + borne).abs() < k * rounding, "{n}, {unit}, {share}: {pressed} {borne}");
            assert!(pressed > 0.1 && run.state().contacts().closed()[0], "{n}, {unit}, {share}");
            for _ in 0..20 {
                run.step().unwrap();
            }
            let moved = run.state().displacement().iter().zip(&start).map(|(x, y)| (x - y).abs());
            assert!(moved.fold(0.0, f64::max) < rounding, "{n}, {unit}, {share}");
        }
    }
}

#[test]
fn friction_holds_what_it_can_from_where_it_was() {
    // A mass on springs along x and y is pressed on a floor with 2 and pulled along it by 1.
    for (coefficient, slip) in [(0.6_f64, 0.0_f64), (0.4, (1.0 - 0.4 * 2.0) / 5.0), (0.0, 0.2)] {
        let k = matrix::<f64>(2, [(0, 0, 5.0), (1, 1, 7.0)]);
        let system = LinearSystem::lumped(vec![1.0; 2], k).unwrap().load(|_, f| {
            f[0] += 1.0;
            f[1] -= 2.0;
        });
        let mut rows = LinearRows::new().unilateral(&[(1, 1.0)], 0.0);
        if coefficient > 0.0 {
            rows = rows.friction(coefficient, &[&[(0, 1.0)]]);
        }
        let mut run =
            Simulation::builder(system, Newmark::trapezoidal(), 0.01).constraint(rows).start_at_rest().build().unwrap();
        for _ in 0..100 {
            let state = run.state();
            assert!((state.displacement()[0] - slip).abs() < 1e-10 && state.displacement()[1].abs() < 1e-12);
            assert!((state.contacts().forces()[0] - 2.0).abs() < 1e-8, "{}", state.contacts().forces()[0]);
            run.step().unwrap();
        }
    }
}

/// A soft block, its top fixed, stretched by a weight of its own towards a floor.
fn hanging(law: Option<Law>) -> SimulationBuilder<'static, f64> {
    let solid = Solid::rectangle([1.0, 0.8], [8, 6], Material { young: 10.0, poisson: 0.3, density: 1.0 });
    let at = |level: f64| {
        let solid = &solid;
        (0..solid.nodes.len()).filter(move |&n| (solid.nodes[n][1] - level).abs() < 1e-9).collect::<Vec<usize>>()
    };
    let (top, bottom) = (at(0.8), at(0.0));
    let floor = Plane::new([0.0, -0.03], [0.0, 1.0]).unwrap();
    let rows = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
    let weight: Vec<f64> = solid.lumped_mass();
    let h = 0.01;
    let builder = if let Some(law) = law {
        let held = top.iter().flat_map(|node| [2 * node, 2 * node + 1]).collect();
        let body = Hyperelastic::new(&solid, law).gravity([0.0, -1.5]).fix(held);
        Simulation::builder(body, Newmark::trapezoidal(), h)
    } else {
        let mut body = solid.system::<f64>().load(move |_, f| {
            f.iter_mut().zip(&weight).skip(1).step_by(2).for_each(|(f, m)| *f -= 1.5 * m);
        });
        for &node in &top {
            body = body.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
        }
        Simulation::builder(body, Newmark::trapezoidal(), h)
    };
    builder.constraint(rows).start_at_rest()
}

#[test]
fn solids_stay_where_they_start() {
    for law in [None, Some(Law::NeoHookean)] {
        let mut run = hanging(law).build().unwrap();
        let contacts = run.state().contacts();
        let (closed, pushed) =
            (contacts.closed().iter().filter(|&&c| c).count(), contacts.forces().iter().sum::<f64>());
        assert!(closed > 2 && closed <= 9 && pushed > 1e-3, "{law:?}: {closed} {pushed}");
        let start = run.state().displacement().to_vec();
        let largest = start.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        for _ in 0..50 {
            run.step().unwrap();
        }
        let moved = run.state().displacement().iter().zip(&start).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(moved < 1e-8 * largest, "{law:?}: {moved} of {largest}");
        let forces: f64 = run.state().contacts().forces().iter().sum();
        assert!((forces / pushed - 1.0).abs() < 1e-6, "{law:?}: {forces} {pushed}");
        // Without the choice it falls from where the mesh was drawn.
        assert!(run.start_adjustment().unwrap().largest > 1e-3);
    }
}

#[test]
fn hundreds_of_contacts_share_what_a_body_weighs() {
    // Two blocks of masses on a diagonal stiffness and a coupling, pressed together by neighbors: K u = f + Gᵀ λ is
    // checked row by row, and complementarity.
    let n = 400;
    let mut entries = Vec::new();
    for i in 0..2 * n {
        entries.push((i, i, 4.0));
        if (i + 1) % n != 0 {
            entries.extend([(i, i + 1, -1.0), (i + 1, i, -1.0)]);
        }
    }
    let k = matrix::<f64>(2 * n, entries);
    let load: Vec<f64> = (0..2 * n).map(|i| if i < n { 1.0 } else { -1.0 } * (0.05 * i as f64).sin()).collect();
    let (applied, stiffness) = (load.clone(), k.clone());
    let system = LinearSystem::lumped(vec![1.0; 2 * n], k).unwrap().load(move |_, f| f.copy_from_slice(&applied));
    let rows = (0..n).fold(LinearRows::new(), |rows, i| rows.unilateral(&[(i, -1.0), (n + i, 1.0)], 0.01));
    let run =
        Simulation::builder(system, Newmark::trapezoidal(), 0.1).constraint(rows).start_at_rest().build().unwrap();
    let (u, contacts) = (run.state().displacement(), run.state().contacts());
    let (mut residual, mut pressing) = (product(stiffness.as_ref(), u), 0);
    residual.iter_mut().zip(&load).for_each(|(r, f)| *r -= f);
    for i in 0..n {
        let (force, gap) = (contacts.forces()[i], 0.01 + u[n + i] - u[i]);
        assert!(force >= 0.0 && gap > -1e-13 && force * gap < 1e-12, "{i}: {force} {gap}");
        residual[i] += force;
        residual[n + i] -= force;
        pressing += usize::from(force > 1e-9);
    }
    let worst = residual.iter().fold(0.0_f64, |most, r| most.max(r.abs()));
    assert!(worst < 1e-11 && pressing > 100 && pressing < n, "{worst} {pressing}");
}

/// A bolt of 1 kg, drawn onto its seat with 1000 N by a spring, is struck by a hammer of .1 kg with 5 m/s. In 10 ms the
/// seat gets 10 N s of the preload, and the .5 N s of the hammer, which stops in a plastic impact.
#[test]
fn a_bolt_under_preload_is_struck() {
    let h = 1e-4;
    let impulse = |scheme: Box<dyn TimeIntegrator>, steps: f64| {
        // Dof 0 is the bolt, 1 the hammer, 2 another mass at rest that nothing holds.
        let k = matrix::<f64>(3, [(0, 0, 1e5)]);
        let system = LinearSystem::lumped(vec![1.0, 0.1, 1.0], k).unwrap().load(|_, f| f[0] -= 1000.0);
        let rows = LinearRows::new().unilateral(&[(0, 1.0)], 0.0).unilateral(&[(0, -1.0), (1, 1.0)], 5.0 * h * steps);
        let builder = Simulation::builder(system, scheme, h).velocity(vec![0.0, -5.0, 0.0]);
        let mut run = builder.constraint(rows).start_at_rest().build().unwrap();
        let mut step = || {
            run.step().unwrap();
            run.state().contacts().impulses()[0]
        };
        (0..100).map(|_| step()).sum::<f64>()
    };
    let runs =
        [0.0, 0.3, 0.7].into_iter().flat_map(|phase| schemes().into_iter().zip(schemes()).map(move |s| (s, phase)));
    for ((scheme, other), phase) in runs {
        let name = scheme.name();
        // Impulses are those of the momentum that a scheme conserves, off from M v by up to half a step of the load.
        let alone = impulse(scheme, 1000.0);
        assert!((alone - 10.0).abs() < 0.51 * h * 1000.0, "{name}: {alone}");
        let struck = impulse(other, 10.0 + phase);
        assert!((struck - alone - 0.5).abs() < 1e-9, "{name} {phase}: {struck} {alone}");
    }
}

#[test]
fn what_does_not_rest_is_refused() {
    let rows = || LinearRows::new().unilateral(&[(0, 1.0)], 0.0);
    let build = |system: LinearSystem<'static, f64>, v: Vec<f64>| {
        Simulation::builder(system, Newmark::trapezoidal(), 0.1)
            .constraint(rows())
            .velocity(v)
            .start_at_rest()
            .build()
            .unwrap_err()
    };
    let error = build(bar(3, 1.0, 0.0), vec![0.0, 0.5, 0.0, 0.0]).to_string();
    assert!(error.contains("velocity 5e-1 of dof 1"), "{error}");
    // Supports that move.
    let driven = || LinearSystem::lumped(vec![1.0; 2], matrix(2, springs(2, 1.0))).unwrap();
    let error = build(driven().drive(1, |t| [t, 1.0, 0.0]).unwrap(), vec![0.0; 2]).to_string();
    assert!(error.contains("velocity 1e0 of dof 1"), "{error}");
    // A bar that nothing but contact holds.
    let error = build(driven().load(|_, f| f[0] -= 1.0), vec![0.0; 2]);
    assert!(matches!(error, Error::Singular { .. }), "{error}");
    assert!(error.to_string().contains("start at rest"), "{error}");
}

#[test]
fn a_run_that_goes_on_has_started() {
    let mut run = hanging(None).build().unwrap();
    run.step().unwrap();
    let mut resumed = hanging(None).resume(run.state().clone(), run.history().clone()).build().unwrap();
    for _ in 0..3 {
        run.step().unwrap();
        resumed.step().unwrap();
    }
    assert_eq!(run.state(), resumed.state());
}
