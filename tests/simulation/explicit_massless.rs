//! Explicit schemes with massless contact dofs, which follow statically: impacts without the impulse of the contact
//! nodes and without its energy.

use contact_dynamics::contact::{Plane, Side, Sphere};
use contact_dynamics::mass::{self, Redistribution};
use contact_dynamics::{
    CdLagrange, CentralDifference, ChungLee, ContactLaw, Error, HulbertChung, LinearRows, LinearSystem,
    NodesOnObstacle, NohBathe, Result, Simulation, System, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::hosts::Bare;
use contact_dynamics_scenes::masses::{Takers, Treatment};
use contact_dynamics_scenes::measure::{Figures, figures, record_run};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{matrix, springs};

/// The paper's bars with tapered massless contact dofs: figures, and the loss of the energy that central differences
/// conserve, ½ v·M v + ½ u·K u − h²/8 a·M a.
fn collide(scheme: Box<dyn TimeIntegrator>, n: usize, courant: f64, phase: f64) -> (Figures, f64) {
    let h = courant * 10.0 / n as f64 / 100.0;
    let bars = Bars::paper(n).delayed(phase, h);
    let mass = Treatment::Redistributed(Takers::Tapered).mass(&bars.body(), &scheme.tableau(), courant).unwrap();
    let mut run = Simulation::builder(bars.system_with(mass), scheme, h)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .uncorrected()
        .build()
        .unwrap();
    let before = run.energy().total();
    let record = record_run(&bars, &mut run, 0.4);
    let mut inertia = vec![0.0; bars.dofs()];
    run.system().mass().product(1.0, run.state().acceleration(), &mut inertia).unwrap();
    let shift: f64 = inertia.iter().zip(run.state().acceleration()).map(|(f, a)| h * h / 8.0 * f * a).sum();
    (figures(&bars, &record, h), 1.0 - (run.energy().total() - shift) / before)
}

#[test]
fn the_force_of_an_impact_does_not_depend_on_the_step() {
    for (n, courants) in [(20, &[0.1, 0.2, 0.5, 0.9][..]), (100, &[0.1, 0.2, 0.5, 0.9]), (400, &[0.2, 0.9])] {
        for &courant in courants {
            let mut mean = 0.0;
            for phase in [0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95] {
                let (found, loss) = collide(Box::new(CdLagrange), n, courant, phase);
                // 5.0 and 2.5 at Courant numbers 0.1 and 0.2 with mass there.
                assert!(found.force_max < 1.08, "{n} {courant} {phase}: {}", found.force_max);
                // What the wall takes or gives because it is met within a step, not at its end: of either sign.
                assert!(loss.abs() < 0.26 * courant * courant / n as f64, "{n} {courant} {phase}: {loss:e}");
                assert!(found.closure < 1e-10 && found.drift < 1e-10, "{n} {courant} {phase}: {found:?}");
                mean += 0.1 * loss;
            }
            // 1/(2n) of the energy with mass there, at any Courant number.
            assert!(mean.abs() < 0.17 * courant * courant / n as f64, "{n} {courant}: {mean:e}");
        }
    }
}

#[test]
fn every_scheme_that_knows_its_displacements_first_takes_them() {
    for (scheme, largest) in [
        (Box::new(CentralDifference) as Box<dyn TimeIntegrator>, 1.08),
        (Box::new(NohBathe::new(0.54).unwrap()), 1.08),
        (Box::new(NohBathe::with_radius(0.5).unwrap()), 1.08),
    ] {
        let name = scheme.name();
        let (found, _) = collide(scheme, 50, 0.4, 0.35);
        assert!(found.force_max < largest && found.energy > 0.985 && found.energy < 1.0004, "{name}: {found:?}");
        assert!(found.closure < 1e-10, "{name}: {found:?}");
    }
}

const RUBBER: Material = Material { young: 50.0, poisson: 0.25, density: 1.0 };

/// Lumped masses of a solid whose bottom nodes have none in any direction, and these nodes.
fn without_bottom<const D: usize>(solid: &Solid<D>) -> (Vec<f64>, Vec<usize>) {
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&n| solid.nodes[n][D - 1] < 1e-9).collect();
    let massless: Vec<usize> = bottom.iter().flat_map(|n| (0..D).map(move |axis| D * n + axis)).collect();
    let groups: Vec<usize> = (0..solid.dofs()).map(|dof| dof % D).collect();
    let stiffness = solid.stiffness::<f64>();
    let by = Redistribution::Tapered { neighbors: stiffness.symbolic(), fraction: 0.15 };
    (mass::redistribute(&solid.lumped_mass(), &massless, &groups, by).unwrap(), bottom)
}

/// The largest residual of the massless dofs over the largest force, and the deepest penetration.
fn balance<const D: usize>(
    solid: &Solid<D>,
    run: &Simulation<'_, f64>,
    mass: &[f64],
    normals: &[[f64; D]],
) -> [f64; 2] {
    let (u, k) = (run.state().displacement(), solid.stiffness::<f64>());
    let mut force = vec![0.0; u.len()];
    let mut size = 0.0_f64;
    for (column, &displacement) in u.iter().enumerate() {
        for (&row, value) in k.symbolic().row_idx_of_col_raw(column).iter().zip(k.as_ref().val_of_col(column)) {
            force[row] -= value * displacement;
            size = size.max((value * displacement).abs());
        }
    }
    let contacts = run.state().contacts();
    for ((id, &lambda), normal) in contacts.ids().iter().zip(contacts.forces()).zip(normals) {
        for axis in 0..D {
            force[D * id.feature + axis] += lambda * normal[axis];
        }
    }
    let residual = (0..u.len()).filter(|&dof| mass[dof] == 0.0).fold(0.0_f64, |most, dof| most.max(force[dof].abs()));
    [residual / size, contacts.gaps().iter().fold(0.0_f64, |deep, g| deep.max(-g))]
}

#[test]
fn a_block_bounces_on_a_plane_that_is_not_along_an_axis() {
    // The plane turned, and the block with it: all directions of the contact nodes are pushed.
    let angle = 0.3_f64;
    let solid = Solid::rectangle([1.0, 0.6], [10, 6], RUBBER);
    let (mass, bottom) = without_bottom(&solid);
    let solid = solid.rotated(angle);
    let normal = [-angle.sin(), angle.cos()];
    let floor = Plane::new(normal.map(|n| -0.0123 * n), normal).unwrap();
    let h = 0.7 * 0.1 / RUBBER.wave_speed() / 2.0_f64.sqrt();
    let rows = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
    let mut run = Simulation::builder(LinearSystem::lumped(mass.clone(), solid.stiffness()).unwrap(), CdLagrange, h)
        .velocity(solid.uniform(normal.map(|n| -0.5 * n)))
        .constraint(rows)
        .uncorrected()
        .build()
        .unwrap();
    let before = run.energy().total();
    let mut pressed = 0;
    while run.time() < 1.0 {
        run.step().unwrap();
        let contacts = run.state().contacts();
        pressed = pressed.max(contacts.forces().iter().filter(|force| **force > 0.0).count());
        let [residual, depth] = balance(&solid, &run, &mass, &vec![normal; contacts.ids().len()]);
        assert!(residual < 1e-10 && depth < 1e-12, "{residual:e} {depth:e}");
    }
    assert_eq!(pressed, 11);
    assert!(run.state().contacts().closed().iter().all(|closed| !closed));
    let kept = run.energy().total() / before;
    assert!((kept - 1.0).abs() < 0.01, "{kept}");
}

/// Near the origin, and so far from it that gaps are rounded more coarsely than displacements are.
#[test]
fn rows_follow_the_dofs_over_a_curved_obstacle() {
    for far in [0.0, 1e3] {
        let mut solid = Solid::block([0.6, 0.6, 0.4], [6, 6, 4], RUBBER);
        let (mass, bottom) = without_bottom(&solid);
        solid = solid.moved([far; 3]);
        let center = [0.33, 0.27, -1.01].map(|x| x + far);
        let ball = Sphere::new(center, 1.0, Side::Outside).unwrap();
        let rows = NodesOnObstacle::new(ball, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
        let h = 0.3 * 0.1 / RUBBER.wave_speed();
        let mut run =
            Simulation::builder(LinearSystem::lumped(mass.clone(), solid.stiffness()).unwrap(), CentralDifference, h)
                .velocity(solid.uniform([0.1, 0.0, -1.0]))
                .constraint(rows)
                .uncorrected()
                .build()
                .unwrap();
        let mut pressed = 0;
        while run.time() < 0.3 {
            run.step().unwrap();
            let contacts = run.state().contacts();
            pressed = pressed.max(contacts.forces().iter().filter(|force| **force > 0.0).count());
            let u = run.state().displacement();
            let normals: Vec<[f64; 3]> = contacts
                .ids()
                .iter()
                .map(|id| {
                    let away: [f64; 3] = std::array::from_fn(|axis| {
                        solid.nodes[id.feature][axis] + u[3 * id.feature + axis] - center[axis]
                    });
                    let size = away.iter().map(|x| x * x).sum::<f64>().sqrt();
                    away.map(|x| x / size)
                })
                .collect();
            let [residual, depth] = balance(&solid, &run, &mass, &normals);
            let rounding = 1e-15 * far;
            assert!(residual < 1e-9 + 1e3 * rounding && depth < 1e-12 + rounding, "{far}: {residual:e} {depth:e}");
        }
        assert!(pressed >= 4, "{far}: {pressed}");
    }
}

/// A node without mass between a driven node and an obstacle: the one goes as it is driven, the other follows at once,
/// with a lumped mass and with a consistent one.
#[test]
fn dofs_without_mass_follow_driven_ones_and_do_not_move_them() {
    let (k, h, load) = (400.0, 5e-3, -3.0);
    // Dof 0 has no mass, dof 1 is driven, two more swing.
    let drive = |t: f64| [0.1 * (2.0 * t).sin(), 0.2 * (2.0 * t).cos(), -0.4 * (2.0 * t).sin()];
    let consistent = [(1, 1, 1.0), (1, 2, 0.2), (2, 1, 0.2), (2, 2, 1.0), (2, 3, 0.2), (3, 2, 0.2), (3, 3, 0.6)];
    let stiffness = || matrix::<f64>(4, springs(4, k));
    let systems: [LinearSystem<'static, f64>; 2] = [
        LinearSystem::lumped(vec![0.0, 1.2, 1.4, 0.8], stiffness()).unwrap(),
        LinearSystem::new(matrix(4, consistent), stiffness()).unwrap(),
    ];
    for system in systems {
        let system = system.drive(1, drive).unwrap().load(move |_, f| f[0] = load);
        let start = vec![load / k, 0.0, 0.0, 0.0];
        let mut run = Simulation::builder(system, CdLagrange, h)
            .displacement(start)
            .velocity(vec![0.2, 0.2, 0.0, 0.0])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.05))
            .uncorrected()
            .build()
            .unwrap();
        let mut pressed = 0;
        while run.time() < 4.0 {
            run.step().unwrap();
            let (u, [driven, ..]) = (run.state().displacement(), drive(run.time()));
            let floor = -0.05;
            assert!((u[1] - driven).abs() < 1e-15, "{} {driven}", u[1]);
            assert!((u[0] - (driven + load / k).max(floor)).abs() < 1e-13, "{} {driven}", u[0]);
            pressed += usize::from(run.state().contacts().closed()[0]);
        }
        assert!(pressed > 100, "{pressed}");
    }
}

#[test]
fn hosts_without_stiffness_give_it_by_their_force() {
    let solid = Solid::rectangle([1.0, 0.6], [8, 5], RUBBER);
    let (mass, bottom) = without_bottom(&solid);
    let n = solid.dofs();
    let h = 0.4 * 0.12 / RUBBER.wave_speed();
    let go = |alone: bool| {
        let system = LinearSystem::lumped(mass.clone(), solid.stiffness()).unwrap().load(move |_, f| f[n - 1] = -0.3);
        let system: Box<dyn System<f64>> =
            if alone { Box::new(Bare::force_alone(system, n)) } else { Box::new(system) };
        let floor = Plane::new([0.0, -0.0123], [0.0, 1.0]).unwrap();
        let mut run = Simulation::builder(system, CdLagrange, h)
            .velocity(solid.uniform([0.1, -0.5]))
            .constraint(NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap())
            .uncorrected()
            .build()
            .unwrap();
        run.run_until(0.5, &mut ()).unwrap();
        run.state().displacement().to_vec()
    };
    let (with, without) = (go(false), go(true));
    let size = with.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    assert!(with.iter().zip(&without).all(|(x, y)| (x - y).abs() < 1e-9 * size));
}

/// Where coordinates are counted from far away a step of one is lost in them.
#[test]
fn a_stiffness_by_the_force_is_found_anywhere() {
    let start = |x: f64| {
        let system = LinearSystem::lumped(vec![1.0, 1.0, 0.0], matrix(3, springs(3, 4.0))).unwrap();
        let builder = Simulation::builder(Bare::force_alone(system, 3), CdLagrange, 0.1);
        let mut run = builder.displacement(vec![x; 3]).velocity(vec![0.0, 0.1, 0.0]).build().unwrap();
        run.step().unwrap();
        [run.state().velocity()[0], run.state().velocity()[1]]
    };
    // (Steps of 0.01 are lost there too: what is left is the motion of the first half of the step.)
    assert!(start(0.0).iter().zip(start(1e17)).all(|(x, y)| y.is_finite() && (x - y).abs() < 0.01));
}

#[test]
fn a_continued_run_goes_on_bit_for_bit() {
    let bars = Bars::paper(30);
    let h = 0.3 * 10.0 / 30.0 / 100.0;
    let mass = || Treatment::Redistributed(Takers::Tapered).mass(&bars.body(), &CdLagrange.tableau(), 0.3).unwrap();
    let build = || {
        Simulation::builder(bars.system_with(mass()), CdLagrange, h)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .uncorrected()
    };
    let mut run = build().build().unwrap();
    run.run_until(0.2, &mut ()).unwrap();
    let mut other = build().resume(run.state().clone(), run.history().clone()).build().unwrap();
    run.run_until(0.35, &mut ()).unwrap();
    other.run_until(0.35, &mut ()).unwrap();
    let bits = |run: &Simulation<'_, f64>| run.state().displacement().iter().map(|u| u.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&run), bits(&other));
}

#[test]
fn compliant_laws_press_on_them_too() {
    // A bar at rest on a spring under its own load at the far end: the spring carries it all.
    let bars = Bars::paper(10);
    let [left, right] = bars.contact_dofs();
    let mass = Treatment::Redistributed(Takers::Tapered).mass(&bars.body(), &CdLagrange.tableau(), 0.3).unwrap();
    let penalty = |gap: f64| 2.0 * (-gap).max(0.0);
    let power = |gap: f64| 30.0 * (-gap).max(0.0).powf(1.5);
    for (law, exact) in [
        (ContactLaw::Penalty { stiffness: 2.0 }, &penalty as &dyn Fn(f64) -> f64),
        (ContactLaw::PowerLaw { stiffness: 30.0, exponent: 1.5 }, &power),
    ] {
        let rows = LinearRows::new().row(law, &[(left, -1.0), (right, 1.0)], 0.001);
        let h = 0.3 * 10.0 / 10.0 / 100.0;
        let mut run = Simulation::builder(bars.system_with(mass.clone()), CdLagrange, h)
            .velocity(bars.velocities())
            .constraint(rows)
            .uncorrected()
            .build()
            .unwrap();
        let before = run.energy().total();
        let (mut largest, mut miss) = (0.0_f64, 0.0_f64);
        while run.time() < 0.5 {
            run.step().unwrap();
            let contacts = run.state().contacts();
            let (gap, force) = (contacts.gaps()[0], contacts.forces()[0]);
            largest = largest.max(force);
            miss = miss.max((force - exact(gap)).abs());
        }
        assert!(largest > 0.005 && miss < 1e-9 * largest, "{law:?}: {largest} {miss:e}");
        assert!((run.energy().total() / before - 1.0).abs() < 1e-2, "{law:?}");
    }
}

/// A foot without mass toward the floor, and with mass along it: it slides to its stop as far as it should, and sticks
/// there, whatever pulls at it below the bound.
#[test]
fn friction_slows_what_has_mass_along_the_floor_alone() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] =
        [|| Box::new(CentralDifference), || Box::new(CdLagrange), || Box::new(NohBathe::new(0.54).unwrap())];
    let (mass, weight, k, h) = (0.5, 10.0, 100.0, 1e-3);
    let laws = [ContactLaw::Rigid, ContactLaw::Penalty { stiffness: 1e4 }];
    for (make, law) in schemes.into_iter().flat_map(|make| laws.map(|law| (make, law))) {
        for (friction, pull) in [(0.3, 0.0), (0.3, 1.0), (0.3, -1.0), (1e6, 0.0), (1e6, 1.0)] {
            let name = format!("{}, {law:?}, μ = {friction}, pull {pull}", make().name());
            // Dofs: the foot toward the floor and along it, and a mass on a spring that stands on it, at rest.
            let springs = [(0, 0, k), (0, 2, -k), (2, 0, -k), (2, 2, k)];
            let system = LinearSystem::lumped(vec![0.0, mass, 1.0], matrix(3, springs)).unwrap().load(move |_, f| {
                (f[1], f[2]) = (pull, -weight);
            });
            let depth = if law == ContactLaw::Rigid { 0.0 } else { weight / 1e4 };
            let mut run = Simulation::builder(system, make(), h)
                .displacement(vec![-depth, 0.0, -depth - weight / k])
                .velocity(vec![0.0, 1.0, 0.0])
                .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.0).friction(friction, &[&[(1, 1.0)]]))
                .build()
                .unwrap();
            let brake = (friction * weight - pull) / mass;
            while run.time() < 0.5 {
                run.step().unwrap();
                let contacts = run.state().contacts();
                let (normal, along) = (contacts.forces()[0], contacts.friction_forces(0)[0]);
                assert!((normal / weight - 1.0).abs() < 1e-9, "{name}: {normal}");
                assert!(along.abs() <= friction * normal * (1.0 + 1e-12), "{name}: {along}");
            }
            let (u, v) = (run.state().displacement()[1], run.state().velocity()[1]);
            assert!((u - 0.5 / brake).abs() < 1.5 * h && v.abs() < 1e-12, "{name}: {u} {v}");
            let along = run.state().contacts().friction_forces(0)[0];
            assert!((along + pull).abs() < 1e-9, "{name}: {along}");
        }
    }
}

#[test]
fn what_explicit_stages_cannot_do_is_refused() {
    let bars = Bars::paper(10);
    let h = 0.3 * 10.0 / 10.0 / 100.0;
    let mass = Treatment::Redistributed(Takers::Tapered).mass(&bars.body(), &CdLagrange.tableau(), 0.3).unwrap();
    let refused = |built: Result<Simulation<'_, f64>>, words: &str| match built {
        Err(Error::Incompatible { reason, .. }) => assert!(reason.contains(words), "{reason}"),
        other => panic!("{other:?}"),
    };
    for scheme in
        [Box::new(ChungLee::new(1.0).unwrap()) as Box<dyn TimeIntegrator>, Box::new(HulbertChung::new(0.8).unwrap())]
    {
        let rows = bars.contact();
        let built =
            Simulation::builder(bars.system_with(mass.clone()), scheme, h).constraint(rows).uncorrected().build();
        refused(built, "at the end of the step");
    }
    let damped = bars.system_with(mass.clone()).rayleigh(0.0, 1e-4).unwrap();
    refused(Simulation::builder(damped, CdLagrange, h).constraint(bars.contact()).uncorrected().build(), "damping");
    let damped = bars.system_with(mass.clone()).rayleigh(0.5, 0.0).unwrap();
    assert!(Simulation::builder(damped, CdLagrange, h).constraint(bars.contact()).uncorrected().build().is_ok());
    let law = ContactLaw::Restitution { coefficient: 0.5 };
    let system = bars.system_with(mass);
    let built = Simulation::builder(system, CdLagrange, h).constraint(bars.contact_under(law)).uncorrected().build();
    refused(built.and_then(|mut run| run.step().map(|()| run)), "gap alone");
}
