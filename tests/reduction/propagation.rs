//! Exact propagation against closed forms: free and loaded motion, an oscillator in contact, bars.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::reduction::{Boundary, ModalPropagation, ReducedBody, Reduction};
use contact_dynamics::{Error, LinearRows};
use contact_dynamics_scenes::propagated::{bounces, wall};
use contact_dynamics_scenes::reference::single_oscillator;
use contact_dynamics_scenes::sparse::{diagonal, matrix, springs};
use std::f64::consts::PI;

/// A chain of unit masses and springs of stiffness k, its first dof in contact; free, or held at its other end.
fn chain(n: usize, k: f64, held: bool, modes: usize, ratio: f64) -> ReducedBody<f64> {
    let (mass, stiffness) = (diagonal(&vec![1.0; n]), matrix(n, springs(n, k)));
    let fixed: &[usize] = if held { &[n - 1] } else { &[] };
    let reduction = Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0]).fix(fixed);
    reduction.damping_ratio(|_| ratio).modes(modes).unwrap()
}

fn total(run: &ModalPropagation<'_, f64>) -> f64 {
    run.kinetic_energy() + run.elastic_energy()
}

#[test]
fn free_motion_is_exact_at_any_step() {
    for (held, ratio) in [(false, 0.0), (true, 0.0), (false, 0.02), (true, 1.3)] {
        let body = chain(30, 1.0, held, 8, ratio);
        let start: Vec<f64> = (0..9).map(|k| 1.0 / f64::from(k + 1)).collect();
        let longest = PI / body.frequencies()[7];
        for h in [0.999 * longest, 0.31 * longest, 0.01 * longest] {
            let mut run = ModalPropagation::builder(&[&body], h)
                .displacement(start.clone())
                .velocity(start.iter().rev().copied().collect())
                .build()
                .unwrap();
            for _ in 0..500 {
                run.step().unwrap();
            }
            for (k, &omega) in body.frequencies().iter().enumerate() {
                let [u, v, _] = single_oscillator(omega, ratio, start[k], start[8 - k], run.time());
                let size = 1.0 + run.time();
                assert!((run.displacement()[k] - u).abs() < 1e-12 * size, "{k} {h}: {} {u}", run.displacement()[k]);
                assert!((run.velocity()[k] - v).abs() < 1e-12 * size, "{k} {h}: {} {v}", run.velocity()[k]);
            }
        }
    }
}

#[test]
fn free_motion_keeps_its_energy() {
    let body = chain(30, 1.0, false, 8, 0.0);
    let start: Vec<f64> = (0..9).map(|k| 1.0 / f64::from(k + 1)).collect();
    let mut run = ModalPropagation::builder(&[&body], 3.0).velocity(start).build().unwrap();
    let before = total(&run);
    for _ in 0..20_000 {
        run.step().unwrap();
    }
    assert!((total(&run) / before - 1.0).abs() < 1e-10, "{before} {}", total(&run));
}

#[test]
fn loads_that_are_linear_in_time_are_met_exactly() {
    let body = chain(30, 1.0, false, 8, 0.0);
    let on_parent: Vec<f64> = (0..30).map(|k| f64::from(k % 4)).collect();
    let load = body.load(&on_parent).unwrap();
    let values = load.clone();
    let at = move |t: f64, out: &mut [f64]| out.iter_mut().zip(&values).for_each(|(x, f)| *x = (1.0 + 0.25 * t) * f);
    let mut run = ModalPropagation::builder(&[&body], 2.5).load(at).build().unwrap();
    run.run_until(50.0).unwrap();
    let t = run.time();
    assert!((t - 50.0).abs() < 1e-12);
    // What acts on a mode is the load there and, through the coupling, that on the contact dof; of a rigid motion
    // f (t²/2 + t³/24) is known, f the whole load over √mass.
    let whole = on_parent.iter().sum::<f64>() / 30.0_f64.sqrt();
    let rigid = whole * (0.5 * t * t + 0.25 * t * t * t / 6.0);
    assert!((run.displacement()[0].abs() / rigid - 1.0).abs() < 1e-12);
    // Elastic modes: f (1 + t/4)/ω², and what is needed to start at rest. Read off a run with small steps.
    let values = load.clone();
    let at = move |t: f64, out: &mut [f64]| out.iter_mut().zip(&values).for_each(|(x, f)| *x = (1.0 + 0.25 * t) * f);
    let mut fine = ModalPropagation::builder(&[&body], 0.01).load(at).build().unwrap();
    fine.run_until(50.0).unwrap();
    for (coarse, fine) in run.displacement().iter().zip(fine.displacement()) {
        assert!((coarse - fine).abs() < 1e-9 * rigid, "{coarse} {fine}");
    }
}

/// One mode whose contact dof is tied: u_b = p η + F λ = 0, so that η is an oscillator with ω² + p²/F.
#[test]
fn an_oscillator_in_contact_is_followed_with_order_two() {
    let body = chain(12, 1.0, true, 1, 0.0);
    let (m, k) = (body.dofs(), body.stiffness());
    assert_eq!(m, 2);
    // K = [ω² + p²/F, −p/F; −p/F, 1/F].
    let omega = k.val_of_col(0)[0].sqrt();
    let force = |eta: f64| k.val_of_col(0)[1] * eta;
    let errors = [40, 80, 160].map(|steps| {
        let h = 2.0 / omega / f64::from(steps);
        let mut run = ModalPropagation::builder(&[&body], h)
            .displacement(vec![1.0, 0.0])
            .constraint(LinearRows::new().equality(&[(1, 1.0)], 0.0))
            .build()
            .unwrap();
        assert!((run.forces()[0] / force(1.0) - 1.0).abs() < 1e-12);
        for _ in 0..steps {
            run.step().unwrap();
        }
        let [eta, rate, _] = single_oscillator(omega, 0.0, 1.0, 0.0, run.time());
        assert!(run.gaps()[0].abs() < 1e-14 && run.displacement()[1].abs() < 1e-14);
        let of_force = (run.forces()[0] - force(eta)).abs() / force(1.0).abs();
        (run.displacement()[0] - eta).abs() + (run.velocity()[0] - rate).abs() / omega + of_force
    });
    for pair in errors.windows(2) {
        assert!((pair[0] / pair[1] / 4.0 - 1.0).abs() < 0.05, "{errors:?}");
    }
    assert!(errors[2] < 1e-4, "{errors:?}");
}

#[test]
fn bars_strike_with_a_clean_force() {
    let phases = [0.15, 0.45, 0.75];
    // (Frequencies of coarser parents are so much too high at the end that fronts return torn apart.)
    let struck = [20, 50, 100].map(|modes| wall(4000, modes, Boundary::Tapered, 1e-3, &phases).unwrap());
    for pair in struck.windows(2) {
        assert!(pair[1].error < 0.6 * pair[0].error, "{struck:?}");
    }
    // A hundred modes at ω_r h = 3.1.
    assert!(struck[2].error < 1e-3 && struck[2].overshoot < 0.08 && struck[2].energy < 2e-3, "{struck:?}");
    let bounced = bounces(1000, 16, Boundary::Tapered, 200.0).unwrap();
    assert!(bounced.error < 0.045 && (bounced.energy - 1.0).abs() < 2e-3, "{bounced:?}");
}

/// Two equal chains, one at rest: half the impedance times the speed; then the other one flies on.
#[test]
fn bodies_exchange_their_momentum() {
    let (n, speed) = (200, 0.01);
    let body = chain(n, 1.0, false, 30, 0.0);
    let second = body.dofs();
    let rows = LinearRows::new().unilateral(&[(30, 1.0), (second + 30, -1.0)], 0.05);
    let mut velocity = body.velocity(&vec![-speed; n]).unwrap();
    velocity.extend(vec![0.0; body.dofs()]);
    // Both have their struck end on the same side: the gap is u₁ − u₂ all the same.
    let mut run =
        ModalPropagation::builder(&[&body, &body], 2.0).velocity(velocity.clone()).constraint(rows).build().unwrap();
    let momentum = |v: &[f64]| v[0] + v[second];
    run.run_until(200.0).unwrap();
    assert!((run.forces()[0] / (0.5 * speed) - 1.0).abs() < 0.02, "{}", run.forces()[0]);
    run.run_until(600.0).unwrap();
    assert!(run.forces()[0].abs() <= 0.0);
    assert!((momentum(run.velocity()) / momentum(&velocity) - 1.0).abs() < 1e-12);
    assert!((run.velocity()[second] / velocity[0] - 1.0).abs() < 0.02);
}

#[test]
fn units_do_not_matter() {
    let run = |length: f64, time: f64| {
        let body = chain(40, 1.0 / (time * time), false, 10, 0.03);
        let wall = LinearRows::new().unilateral(&[(10, 1.0)], 0.02 * length);
        let speed = -0.01 * length / time;
        let mut run = ModalPropagation::builder(&[&body], 1.5 * time)
            .velocity(body.velocity(&[speed; 40]).unwrap())
            .constraint(wall)
            .build()
            .unwrap();
        run.run_until(60.0 * time).unwrap();
        (run.forces()[0] * time * time / length, run.velocity()[1] * time / length)
    };
    let ((force, rate), (other, other_rate)) = (run(1.0, 1.0), run(1e3, 1e-4));
    assert!(force > 0.005, "{force}");
    assert!((other / force - 1.0).abs() < 1e-9 && (other_rate / rate - 1.0).abs() < 1e-9, "{force} {other}");
}

#[test]
fn a_moving_obstacle_carries_the_body_along() {
    let body = chain(30, 1.0, false, 6, 0.3);
    let floor = LinearRows::new().equality(&[(6, 1.0)], GapOffset::moving(|t| [-0.1 * t, -0.1, 0.0]));
    let mut run = ModalPropagation::builder(&[&body], 1.0).constraint(floor).build().unwrap();
    run.run_until(20_000.0).unwrap();
    assert!((run.displacement()[6] / 2000.0 - 1.0).abs() < 1e-12);
    assert!((run.velocity()[0].abs() / (0.1 * 30.0_f64.sqrt()) - 1.0).abs() < 1e-6, "{}", run.velocity()[0]);
}

#[test]
fn what_is_refused() {
    let body = chain(30, 1.0, false, 8, 0.0);
    let top = body.frequencies()[7];
    match ModalPropagation::builder(&[&body], 1.01 * PI / top).build() {
        Err(Error::Parameter { value, .. }) => assert!((value / (1.01 * PI) - 1.0).abs() < 1e-12),
        other => panic!("{other:?}"),
    }
    // Untapered bodies gain energy with longer steps.
    let (mass, stiffness) = (diagonal::<f64>(&[1.0; 30]), matrix(30, springs(30, 1.0)));
    let untapered =
        Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0]).boundary(Boundary::Untapered).modes(8).unwrap();
    for (share, admitted) in [(0.249, true), (0.251, false)] {
        let run = ModalPropagation::builder(&[&untapered], share * PI / untapered.frequencies()[7]).build();
        assert_eq!(run.is_ok(), admitted, "{run:?}");
    }
    for h in [0.0, -1.0, f64::NAN] {
        assert!(matches!(ModalPropagation::builder(&[&body], h).build(), Err(Error::Parameter { .. })), "{h}");
    }
    assert!(matches!(ModalPropagation::<f64>::builder(&[], 1.0).build(), Err(Error::Empty { .. })));
    let with = |rows| ModalPropagation::builder(&[&body], 1.0).constraint(rows).build();
    let modal = with(LinearRows::new().unilateral(&[(3, 1.0)], 0.0));
    assert!(matches!(modal, Err(Error::Incompatible { .. })));
    let rubbing = with(LinearRows::new().unilateral(&[(8, 1.0)], 0.0).friction(0.3, &[&[(8, 1.0)]]));
    assert!(matches!(rubbing, Err(Error::Incompatible { .. })));
    let bonded = with(LinearRows::new().bond(1.0, &[(8, 1.0)], 0.0));
    assert!(matches!(bonded, Err(Error::Incompatible { .. })));
    let short = ModalPropagation::builder(&[&body], 1.0).velocity(vec![0.0; 3]).build();
    assert!(matches!(short, Err(Error::Dimension { expected: 9, found: 3, .. })));
    let reduction = Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0]).boundary(Boundary::CraigBampton);
    let held = reduction.modes(5).unwrap();
    assert!(matches!(ModalPropagation::builder(&[&held], 0.1).build(), Err(Error::Incompatible { .. })));
}

/// A body that is held at both ends and in between moves elsewhere, and stays where it is held.
#[test]
fn three_dofs_of_a_body_are_held_at_once() {
    let n = 30;
    let (mass, stiffness) = (diagonal(&vec![1.0; n]), matrix(n, springs(n, 1.0)));
    let body: ReducedBody<f64> = Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0, 12, n - 1]).modes(8).unwrap();
    let start: Vec<f64> = (1..=8).map(|k| 1.0 / f64::from(k)).chain([0.0; 3]).collect();
    let held = (8..11).fold(LinearRows::new(), |rows, dof| rows.equality(&[(dof, 1.0)], 0.0));
    let mut run = ModalPropagation::builder(&[&body], 0.5).velocity(start).constraint(held).build().unwrap();
    let (mut pulled, before) = (0.0_f64, total(&run));
    for _ in 0..200 {
        run.step().unwrap();
        assert!(run.gaps().iter().all(|gap| gap.abs() < 1e-12), "{:?}", run.gaps());
        assert!(total(&run) < 1.1 * before, "{} {before}", total(&run));
        pulled = run.forces().iter().fold(pulled, |most, force| most.max(force.abs()));
    }
    assert!(pulled > 0.1, "{pulled}");
}

/// Two equality rows that part from each other after a while, and a load that becomes infinite.
#[test]
fn a_step_that_fails_changes_nothing() {
    let body = chain(30, 1.0, false, 8, 0.0);
    let parting = |t: f64| [if t > 4.5 { t - 4.5 } else { 0.0 }, 0.0, 0.0];
    let rows = LinearRows::new().equality(&[(8, 1.0)], 0.0).equality(&[(8, 1.0)], GapOffset::moving(parting));
    let torn = ModalPropagation::builder(&[&body], 1.0).velocity(vec![0.01; 9]).constraint(rows);
    let load = |t: f64, out: &mut [f64]| out[0] = if t > 4.5 { f64::INFINITY } else { 0.1 };
    let loaded = ModalPropagation::builder(&[&body], 1.0).velocity(vec![0.01; 9]).load(load);
    for mut run in [torn.build().unwrap(), loaded.build().unwrap()] {
        run.run_until(4.0).unwrap();
        let state = |run: &ModalPropagation<'_, f64>| [run.displacement(), run.velocity(), run.forces()].concat();
        let before = state(&run);
        for _ in 0..2 {
            let error = run.step().unwrap_err();
            assert!(matches!(error, Error::ContradictoryContacts { .. } | Error::NotFinite { .. }), "{error}");
            assert_eq!((state(&run), run.time()), (before.clone(), 4.0));
        }
    }
}
