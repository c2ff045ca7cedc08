//! The λ_v/λ_a correction against the paper's equations (as derived in docs/theory.md) and against closed forms.
#![allow(clippy::float_cmp)] // exact zeros and unchanged values are meant exactly

use approx::assert_relative_eq;
use contact_dynamics::corrector::Parts;
use contact_dynamics::{
    Bathe, Composite, GeneralizedAlpha, Houbolt, LinearRows, LinearSystem, Mass, Newmark, Park, PersistencyCorrection,
    Simulation, System, TimeIntegrator,
};
use contact_dynamics_scenes::schemes::correctable;
use contact_dynamics_scenes::sparse::{free, matrix, springs};
use contact_dynamics_scenes::{Bars, MassKind};

const FULL: PersistencyCorrection = PersistencyCorrection::with_history_projection();

fn start<'a>(
    bars: &Bars,
    scheme: impl TimeIntegrator + 'a,
    correction: PersistencyCorrection,
    h: f64,
) -> Simulation<'a, f64> {
    Simulation::builder(bars.system::<f64>(), scheme, h)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .corrector(correction)
        .build()
        .unwrap()
}

/// Equations (11), (12'), (13') and (14) of the paper at the step of impact, unequal bars.
#[test]
fn multipliers_forces_and_rates_are_those_of_the_paper() {
    let h = 1e-3;
    for theta in [0.05, 0.35, 0.95] {
        let bars = Bars { elements: [20, 33], ..Bars::dissimilar(20) }.delayed(theta, h);
        let [left, right] = bars.contact_dofs();
        let mass: Vec<f64> = bars.lumped_mass();
        let (m1, m2) = (mass[left], mass[right]);
        let mut raw = start(&bars, Composite, FULL.parts(Parts::Acceleration), h);
        let mut corrected = start(&bars, Composite, PersistencyCorrection::new(), h);
        while raw.state().contacts().raw_forces()[0] == 0.0 {
            raw.step().unwrap();
            corrected.step().unwrap();
        }
        // Values computed directly: û from free flight, v̂ from the run that leaves velocities alone.
        let (t, v) = (raw.time(), bars.velocity);
        let gap = |t: f64| bars.gap + (v[1] - v[0]) * t;
        let approach = v[1] - v[0];
        let jump = 1.6 * gap(t - h) - 0.6 * gap(t - 2.0 * h) + 0.8 * h * approach - 0.4 * h * approach;
        let contacts = corrected.state().contacts();
        // (11) with weights m/h: λ_v = [[û + X]]/(1/w1 + 1/w2).
        let lambda_v = jump / (h / m1 + h / m2);
        assert_relative_eq!(contacts.lambda_v()[0], lambda_v, max_relative = 1e-9);
        assert!(lambda_v < 0.0);
        // (13') with weights m h.
        let v_hat = [left, right].map(|dof| raw.state().velocity()[dof]);
        let lambda_a = (v_hat[1] - v_hat[0]) / (1.0 / (m1 * h) + 1.0 / (m2 * h));
        assert_relative_eq!(contacts.lambda_a()[0], lambda_a, max_relative = 1e-9);
        let v = [left, right].map(|dof| corrected.state().velocity()[dof]);
        assert_relative_eq!(v[0], v_hat[0] + lambda_a / (m1 * h), max_relative = 1e-10);
        assert_relative_eq!(v[1], v_hat[1] - lambda_a / (m2 * h), max_relative = 1e-10);
        assert_relative_eq!(v[0], v[1], max_relative = 1e-12);
        // (14) p' = p + 5/(2h) λ_v, and with it the balance of the contact nodes in (12').
        let p = contacts.raw_forces()[0];
        assert_relative_eq!(contacts.forces()[0], p + 2.5 / h * lambda_v, max_relative = 1e-8, epsilon = 1e-9 * p);
        let a = [left, right].map(|dof| corrected.state().acceleration()[dof]);
        assert_relative_eq!(a[0], a[1], max_relative = 1e-9, epsilon = 1e-6);
        // J: the velocity projection is the impulse −λ_a/h (on the right bar).
        let impulse = contacts.impulses()[0];
        assert_relative_eq!(impulse, h * p - lambda_a / h, max_relative = 1e-10);
    }
}

#[test]
fn corrected_state_satisfies_the_equation_of_motion_with_the_reported_force() {
    // M a + C v + K u = Gᵀ p', whatever was corrected; with damping by schemes that read no a, else to h C δv.
    for (alpha, beta) in [(0.0, 0.0), (0.0, 2e-3), (1.5, 2e-3)] {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            for parts in [Parts::Both, Parts::Velocity, Parts::Acceleration] {
                let schemes: [Box<dyn TimeIntegrator>; 4] =
                    [Box::new(Composite), Box::new(Newmark::trapezoidal()), Box::new(Bathe::default()), Box::new(Park)];
                for scheme in schemes {
                    let name = scheme.name();
                    let reads = scheme.tableau().read_after(0).unwrap().iter().any(|[.., a]| *a);
                    let tolerance = if reads && beta > 0.0 && parts != Parts::Acceleration { 0.1 } else { 1e-11 };
                    let bars = Bars::paper(20).delayed(0.3, 1e-3).with_mass(mass);
                    let build = || bars.system::<f64>().rayleigh(alpha, beta).unwrap();
                    let mut run = Simulation::builder(build(), scheme, 1e-3)
                        .velocity(bars.velocities())
                        .constraint(bars.contact())
                        .corrector(FULL.parts(parts))
                        .build()
                        .unwrap();
                    let mut system = build();
                    let mut scale = 1e-3;
                    for _ in 0..180 {
                        run.step().unwrap();
                        let state = run.state();
                        let mut residual = vec![0.0; bars.dofs()];
                        system.force(state.time(), state.displacement(), state.velocity(), &mut residual).unwrap();
                        let [left, right] = bars.contact_dofs();
                        residual[left] -= state.contacts().forces()[0];
                        residual[right] += state.contacts().forces()[0];
                        system.mass().product(-1.0, state.acceleration(), &mut residual).unwrap();
                        scale = state.contacts().raw_forces()[0].max(scale);
                        let worst = residual.iter().fold(0.0_f64, |w, r| w.max(r.abs()));
                        assert!(
                            worst < tolerance * scale,
                            "{name}, {mass:?}, {parts:?}, α {alpha}, β {beta}, t = {}: {worst:e}",
                            state.time()
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn nothing_is_corrected_in_persistent_contact() {
    // With the past projected, λ_v and λ_a vanish from the step after the impact on.
    let schemes: [Box<dyn TimeIntegrator>; 3] = [Box::new(Composite), Box::new(Houbolt), Box::new(Park)];
    for scheme in schemes {
        let name = scheme.name();
        let mut run = start(&Bars::paper(20).delayed(0.3, 1e-3), scheme, FULL, 1e-3);
        while run.state().contacts().raw_forces()[0] == 0.0 {
            run.step().unwrap();
        }
        let first = run.state().contacts().clone();
        assert!(first.lambda_v()[0] < 0.0);
        for step in 1..100 {
            run.step().unwrap();
            let contacts = run.state().contacts();
            assert!(contacts.closed()[0], "{name} lost contact {step} steps after impact");
            assert!(contacts.lambda_v()[0].abs() < 1e-10 * first.lambda_v()[0].abs(), "{name}, step {step}");
            assert!(contacts.lambda_a()[0].abs() < 1e-10 * first.lambda_v()[0].abs(), "{name}, step {step}");
        }
    }
}

#[test]
fn without_history_projection_contact_is_lost_after_an_early_impact() {
    // (0.4 − 0.6 θ) h V of spurious opening, θ the impact instant within the step: the reason for the projection.
    let lost = |theta: f64, correction| {
        let mut run = start(&Bars::paper(20).delayed(theta, 1e-3), Composite, correction, 1e-3);
        run.run_until(0.1015 + theta * 1e-3, &mut ()).unwrap();
        let gap = run.gaps()[0];
        let changes = run.statistics().contact_changes;
        (gap, changes)
    };
    let (gap, changes) = lost(0.2, PersistencyCorrection::new());
    assert!(changes >= 2 && gap > 0.0, "{gap} {changes}");
    let (gap, changes) = lost(0.2, FULL);
    assert!(changes == 1 && gap.abs() < 1e-14, "{gap} {changes}");
    // Of free masses, which no wave moves meanwhile, the opening is that to rounding.
    for theta in [0.05, 0.2, 0.5] {
        let (h, speed) = (1e-3, 0.1);
        let mut run = Simulation::builder(free(&[1.0, 3.0]), Composite, h)
            .velocity(vec![0.6 * speed, -0.4 * speed])
            .constraint(LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], (10.0 + theta) * h * speed))
            .corrector(PersistencyCorrection::new())
            .build()
            .unwrap();
        while !run.state().contacts().closed()[0] {
            run.step().unwrap();
        }
        run.step().unwrap();
        assert_relative_eq!(run.gaps()[0], (0.4 - 0.6 * theta) * h * speed, max_relative = 1e-9);
    }
}

#[test]
fn rows_that_share_a_body_are_projected_together() {
    // Three free masses in a row, all gaps closing in the same step: one common velocity, total momentum over total
    // mass.
    let masses = [2.0, 0.5, 3.0];
    let velocity = [1.0, 0.3, -0.9];
    let common = masses.iter().zip(velocity).map(|(m, v)| m * v).sum::<f64>() / 5.5;
    let h = 0.01;
    // The gaps are such that both contacts close within the fifth step.
    let gaps = [0.7 * 4.3 * h, 1.2 * 4.6 * h];
    for listed in correctable() {
        let (scheme, name) = ((listed.make)(), listed.name());
        let mut run = Simulation::builder(free(&masses), scheme, h)
            .velocity(velocity.to_vec())
            .constraint(
                LinearRows::new()
                    .unilateral(&[(0, -1.0), (1, 1.0)], gaps[0])
                    .unilateral(&[(1, -1.0), (2, 1.0)], gaps[1]),
            )
            .corrector(FULL)
            .build()
            .unwrap();
        run.run_until(0.3, &mut ()).unwrap();
        for &v in run.state().velocity() {
            assert_relative_eq!(v, common, max_relative = 1e-11);
        }
        let momentum = run.momentum(&[1.0; 3]).unwrap();
        assert_relative_eq!(momentum, 5.5 * common, max_relative = 1e-12);
        assert_eq!(run.statistics().contact_changes, 2, "{name}");
    }
}

#[test]
fn several_rows_at_one_node_stop_it_in_a_corner() {
    // A node with two dofs flies into an acute corner of two oblique walls: both rows share both dofs, and what stops
    // it at one wall presses it against the other.
    let mut run = Simulation::builder(free(&[1.5, 1.5]), Composite, 0.01)
        .velocity(vec![-1.0, 0.2])
        .constraint(LinearRows::new().unilateral(&[(0, 0.8), (1, 0.6)], 0.3).unilateral(&[(0, 0.28), (1, -0.96)], 0.2))
        .corrector(FULL)
        .build()
        .unwrap();
    run.run_until(1.0, &mut ()).unwrap();
    let state = run.state();
    assert!(state.velocity().iter().all(|v| v.abs() < 1e-13), "{:?}", state.velocity());
    assert!(run.gaps().iter().all(|gap| gap.abs() < 1e-13));
    assert!(run.statistics().contact_changes >= 2);
}

#[test]
fn a_bar_against_a_wall_is_half_of_a_symmetric_pair() {
    for scheme in [true, false] {
        let integrator = || -> Box<dyn TimeIntegrator> {
            if scheme { Box::new(Composite) } else { Box::new(Newmark::trapezoidal()) }
        };
        let pair = Bars::paper(30).delayed(0.45, 1e-3);
        let mut both = start(&pair, integrator(), FULL, 1e-3);
        // The left bar alone: the wall is the symmetry plane.
        let n = 30;
        let k = 100.0 * 0.25 / (10.0 / n as f64);
        let stiffness = matrix(n + 1, springs(n + 1, k));
        let mass = pair.lumped_mass::<f64>()[..=n].to_vec();
        let mut single = Simulation::builder(LinearSystem::lumped(mass, stiffness).unwrap(), integrator(), 1e-3)
            .velocity(vec![0.05; n + 1])
            .constraint(LinearRows::new().unilateral(&[(n, -1.0)], 0.5 * pair.gap))
            .corrector(FULL)
            .build()
            .unwrap();
        for _ in 0..400 {
            both.step().unwrap();
            single.step().unwrap();
            let (pair_force, force) = (both.state().contacts().forces()[0], single.state().contacts().forces()[0]);
            assert!((pair_force - force).abs() < 1e-9 * 0.0125, "t = {}: {pair_force} {force}", both.time());
        }
    }
}

#[test]
fn touching_bodies_that_separate_are_left_alone() {
    // In contact at the start, gap zero, moving apart: nothing may pull.
    let mut run = Simulation::builder(free(&[1.0, 1.0]), Composite, 0.01)
        .velocity(vec![-0.5, 0.5])
        .constraint(LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.0))
        .corrector(FULL)
        .build()
        .unwrap();
    run.run_until(0.1, &mut ()).unwrap();
    assert_relative_eq!(run.state().velocity()[0], -0.5, max_relative = 1e-14);
    assert_relative_eq!(run.gaps()[0], 0.1, max_relative = 1e-12);
    assert_eq!(run.statistics().contact_solves, 0);
    // Touching and approaching from the start: the first step closes it.
    let mut run = Simulation::builder(free(&[1.0, 3.0]), Composite, 0.01)
        .velocity(vec![1.0, -1.0])
        .constraint(LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.0))
        .corrector(FULL)
        .build()
        .unwrap();
    run.step().unwrap();
    assert_relative_eq!(run.state().velocity()[0], -0.5, max_relative = 1e-12);
    assert_relative_eq!(run.state().velocity()[1], -0.5, max_relative = 1e-12);
}

#[test]
fn heavy_partner_equals_the_rigid_limit() {
    // The 1/w2 = 0 path: a wall moving with constant velocity, against a partner 1e9 times as heavy.
    let run = |partner: bool| {
        let rows = LinearRows::new();
        let (masses, velocity, rows) = if partner {
            (vec![1.0, 1e9], vec![1.0, -0.5], rows.unilateral(&[(0, -1.0), (1, 1.0)], 0.123))
        } else {
            let moving = contact_dynamics::contact::GapOffset::moving(|t| [0.123 - 0.5 * t, -0.5, 0.0]);
            (vec![1.0], vec![1.0], rows.unilateral(&[(0, -1.0)], moving))
        };
        let mut run = Simulation::builder(free(&masses), Composite, 0.01)
            .velocity(velocity)
            .constraint(rows)
            .corrector(FULL)
            .build()
            .unwrap();
        run.run_until(0.3, &mut ()).unwrap();
        (run.state().displacement()[0], run.state().velocity()[0])
    };
    let (heavy, rigid) = (run(true), run(false));
    // The partner gives way by 1.5 in 1e9.
    assert_relative_eq!(heavy.0, rigid.0, epsilon = 1e-9);
    assert_relative_eq!(heavy.1, rigid.1, epsilon = 3e-9);
    assert_relative_eq!(rigid.1, -0.5, max_relative = 1e-11);
}

#[test]
fn mass_views_multiply_as_matrices() {
    let bars = Bars::paper(3);
    let consistent = bars.consistent_mass::<f64>();
    let mut y = vec![0.0; bars.dofs()];
    Mass::Consistent(consistent.as_ref()).product(2.0, &vec![1.0; bars.dofs()], &mut y).unwrap();
    // Row sums are the lumped masses.
    for (y, m) in y.iter().zip(bars.lumped_mass::<f64>()) {
        assert_relative_eq!(*y, 2.0 * m, max_relative = 1e-14);
    }
    // A diagonal matrix is recognized as lumped.
    let diagonal = matrix::<f64>(bars.dofs(), (0..bars.dofs()).map(|i| (i, i, 1.0 + i as f64)));
    let system = LinearSystem::new(diagonal, bars.stiffness()).unwrap();
    assert!(matches!(system.mass(), Mass::Lumped(mass) if mass.len() == bars.dofs() && mass[2] == 3.0));
    let system = LinearSystem::new(consistent, bars.stiffness()).unwrap();
    assert!(matches!(system.mass(), Mass::Consistent(_)));
}

#[test]
fn an_impact_on_a_grid_point_belongs_to_that_step() {
    // The gap of 1/4 closes with 2/64 a step: exactly at the eighth, without any pressure.
    let h = 1.0 / 64.0;
    let schemes: [Box<dyn TimeIntegrator>; 2] = [Box::new(Composite), Box::new(Park)];
    for scheme in schemes {
        let name = scheme.name();
        let mut run = Simulation::builder(free(&[1.0, 1.0]), scheme, h)
            .velocity(vec![1.0, -1.0])
            .constraint(LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.25))
            .corrector(FULL)
            .build()
            .unwrap();
        run.run_until(8.0 * h, &mut ()).unwrap();
        let contacts = run.state().contacts();
        assert!(contacts.closed()[0] && contacts.raw_forces()[0] == 0.0, "{name}: {contacts:?}");
        assert!(run.state().velocity().iter().all(|v| v.abs() < 1e-14), "{name}: {:?}", run.state().velocity());
        assert_relative_eq!(contacts.impulses()[0], 1.0, max_relative = 1e-10);
        // The past that later steps read no longer approaches.
        let (u, v, _) = run.history().past(1).unwrap();
        assert!((u[1] - u[0] + 0.25).abs() < 1e-14 && (v[1] - v[0]).abs() < 1e-14, "{name}: {u:?} {v:?}");
        run.run_until(12.0 * h, &mut ()).unwrap();
        assert!(run.gaps()[0].abs() < 1e-14 && run.statistics().contact_changes == 1, "{name}: {:?}", run.gaps());
    }
}

#[test]
fn reported_force_of_a_generalized_scheme_balances_its_own_rows() {
    // Chung and Hulbert: M ā + K ū = Gᵀ p' at the balance rows, with the corrected acceleration in ā; the factor is 1 −
    // α_m.
    for rho in [0.0, 0.8, 1.0] {
        let (am, af) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
        let bars = Bars::paper(20).delayed(0.3, 1e-3);
        let mut run = start(&bars, GeneralizedAlpha::chung_hulbert(rho).unwrap(), PersistencyCorrection::new(), 1e-3);
        let (mass, mut system) = (bars.lumped_mass::<f64>(), bars.system::<f64>());
        let [left, right] = bars.contact_dofs();
        let mut scale = 1e-3_f64;
        for _ in 0..180 {
            let old = run.state().clone();
            run.step().unwrap();
            let new = run.state();
            let mix = |x: f64, y: &[f64], z: &[f64]| -> Vec<f64> {
                y.iter().zip(z).map(|(y, z)| (1.0 - x) * y + x * z).collect()
            };
            let u = mix(af, new.displacement(), old.displacement());
            let a = mix(am, new.stored_acceleration(), old.stored_acceleration());
            let mut residual = vec![0.0; bars.dofs()];
            system.force(0.0, &u, &a, &mut residual).unwrap();
            residual[left] -= new.contacts().forces()[0];
            residual[right] += new.contacts().forces()[0];
            scale = scale.max(new.contacts().raw_forces()[0]);
            for (i, r) in residual.iter().enumerate() {
                assert!((r - mass[i] * a[i]).abs() < 1e-11 * scale, "ρ = {rho}, t = {}, dof {i}", run.time());
            }
        }
        assert!(scale > 1e-2, "the impact is part of the run");
    }
}

#[test]
fn a_touching_row_is_not_held_back_by_an_impact_elsewhere() {
    // A node slides along the floor (touching, no pressure) and meets an oblique wall on a grid point: the wall throws
    // it off the floor with 0.6 of its normal velocity along (0.6, 0.8); holding the floor's gap would be adhesion.
    let h = 1.0 / 64.0;
    for scheme in [true, false] {
        let integrator: Box<dyn TimeIntegrator> =
            if scheme { Box::new(Composite) } else { Box::new(Newmark::trapezoidal()) };
        let mut run = Simulation::builder(free(&[1.0, 1.0]), integrator, h)
            .velocity(vec![-1.0, 0.0])
            .constraint(LinearRows::new().unilateral(&[(1, 1.0)], 0.0).unilateral(&[(0, 0.6), (1, 0.8)], 0.6 * 8.0 * h))
            .corrector(FULL)
            .build()
            .unwrap();
        run.run_until(8.0 * h, &mut ()).unwrap();
        assert_eq!(run.state().contacts().closed(), [true, true]);
        assert_eq!(run.state().contacts().raw_forces(), [0.0, 0.0]);
        assert_relative_eq!(run.state().velocity()[0], -0.64, max_relative = 1e-12);
        assert_relative_eq!(run.state().velocity()[1], 0.48, max_relative = 1e-12);
        let impulses = run.state().contacts().impulses();
        assert!(impulses[0].abs() < 1e-14 && (impulses[1] - 0.6).abs() < 1e-12, "{impulses:?}");
    }
}

#[test]
fn a_touching_row_is_not_held_back_in_acceleration_either() {
    // A body of two faces is pulled along by a load, and another one with it, which touches its back without pressure.
    // A third one catches up with it on a grid point: the two that meet have one velocity, but the load pulls its body
    // off at once, and the one behind it goes on alone. All numbers are exact in binary.
    let (h, load) = (1.0 / 8.0, 1.0);
    let mut run = Simulation::builder(free(&[1.0; 3]).load(move |_, f| f[1..].fill(load)), Newmark::trapezoidal(), h)
        .velocity(vec![1.0, 0.0, 0.0])
        .constraint(
            LinearRows::new()
                .unilateral(&[(0, -1.0), (2, 1.0)], 2.0 * h - 2.0 * h * h)
                .unilateral(&[(1, -1.0), (2, 1.0)], 0.0),
        )
        .corrector(FULL)
        .build()
        .unwrap();
    run.run_until(2.0 * h, &mut ()).unwrap();
    let contacts = run.state().contacts();
    assert_eq!(contacts.closed(), [true, true]);
    assert_eq!(contacts.raw_forces(), [0.0, 0.0]);
    // The mean of 1 and ¼.
    assert_eq!(run.state().velocity(), [0.625, 0.25, 0.625]);
    assert_eq!(run.state().acceleration(), [0.0, load, load]);
    assert_eq!(contacts.forces(), [0.0, 0.0]);
}
