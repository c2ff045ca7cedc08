//! Contact imposed ahead of the state or on velocities: central differences at Courant number 1, CD-Lagrange,
//! Moreau–Jean, Noh–Bathe; and position-level contact of Chung–Lee and Hulbert–Chung.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::tableau::{ContactLevel, Stage, Tableau};
use contact_dynamics::{
    CdLagrange, CentralDifference, ChungLee, Corrector, Error, HulbertChung, LinearRows, MoreauJean, NohBathe,
    PersistencyCorrection, Simulation, TchamwaWielgosz, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::measure::{Figures, figures, record};
use contact_dynamics_scenes::reference::Side;
use contact_dynamics_scenes::schemes::Tabulated;
use contact_dynamics_scenes::sparse::free;
use contact_dynamics_scenes::wall_bar::WallBar;

const F0: f64 = 0.0125;

fn run(bars: &Bars, scheme: impl TimeIntegrator + 'static, h: f64) -> Figures {
    figures(bars, &record::<f64>(bars, scheme, None, h, 0.4), h)
}

/// At Courant number 1 with lumped masses d'Alembert's solution holds at the nodes: the force is known at every step.
/// The end node has half the mass of the others, so that the delay of the impact inside its step (`phase`) shows in the
/// first two forces; in the last one the release does.
#[test]
fn central_differences_are_exact_at_courant_number_one() {
    for n in [20, 50, 100, 200] {
        let h = 0.1 / n as f64;
        for phase in (0..10).map(|i| 0.05 + 0.1 * f64::from(i)) {
            let bars = Bars::paper(n).delayed(phase, h);
            let record = record::<f64>(&bars, CentralDifference, None, h, 0.4);
            let exact = bars.exact(0.5);
            let pressed: Vec<f64> = record.force.iter().map(|force| force / F0).filter(|&force| force != 0.0).collect();
            let mut expected = vec![1.0; 2 * n + 1];
            (expected[0], expected[1], expected[2 * n]) = (0.5 * (1.0 - phase), 1.0 - 0.5 * phase, phase);
            assert_eq!(pressed.len(), expected.len(), "n = {n}, phase {phase}: {pressed:?}");
            for (found, expected) in pressed.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-10, "n = {n}, phase {phase}: {found} instead of {expected}");
            }
            // The contact nodes move as d'Alembert's solution says until the release.
            for (i, &t) in record.t.iter().enumerate().filter(|(_, t)| **t < 0.3) {
                let place = exact.displacement(Side::Left, bars.length[0], t);
                assert!((record.u[i][0] - place).abs() < 1e-14, "n = {n}, phase {phase}, t = {t}");
            }
            assert!(record.closure() < 1e-12 && record.drift() < 1e-12);
        }
    }
}

#[test]
fn gaps_of_forward_increments_never_open_or_penetrate_in_contact() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(CentralDifference), || Box::new(NohBathe::new(0.54).unwrap())];
    for scheme in schemes {
        for phase in [0.0, 0.3, 0.8] {
            let h = 1e-3;
            let bars = Bars::paper(20).delayed(phase, h);
            let record = record::<f64>(&bars, scheme(), None, h, 0.4);
            let worst = record.gap.iter().fold(0.0_f64, |worst, gap| worst.min(*gap));
            assert!(worst > -1e-15, "{worst}");
            let closed = record.t.iter().zip(&record.gap).filter(|(t, _)| (0.103..0.299).contains(*t));
            assert!(closed.into_iter().all(|(_, gap)| gap.abs() < 1e-15));
        }
    }
}

/// The gap is looked at when the step is over, or half a step ahead (Moreau and Jean): what bodies have made of the way
/// of a step by then is left, and stays as it is while contact lasts.
#[test]
fn contact_on_velocities_leaves_the_rest_of_the_step_of_the_impact() {
    let h = 1e-3;
    for phase in (0..10).map(|i| 0.05 + 0.1 * f64::from(i)) {
        let bars = Bars::paper(50).delayed(phase, h);
        let half_a_step_ahead = if phase < 0.5 { 0.5 - phase } else { 1.5 - phase };
        let schemes: [(Box<dyn TimeIntegrator>, f64); 2] =
            [(Box::new(CdLagrange), 1.0 - phase), (Box::new(MoreauJean::new(0.5).unwrap()), half_a_step_ahead)];
        for (scheme, expected) in schemes {
            let name = scheme.name();
            let record = record::<f64>(&bars, scheme, None, h, 0.33);
            let way = h * (bars.velocity[0] - bars.velocity[1]);
            let inside = record.t.iter().zip(&record.gap).filter(|(t, _)| (0.103..0.29).contains(*t));
            for (t, gap) in inside {
                assert!((gap / way + expected).abs() < 1e-9, "{name}, phase {phase}, {t}: {}", gap / way);
            }
        }
    }
}

/// A rigid mass that Moreau and Jean's scheme stops on a floor, for any θ: (1 − θ − φ) h v below it where the impact is
/// in the first half of a step, (2 − θ − φ) h v in the second (negative: above).
#[test]
fn moreau_and_jean_leave_what_theta_says() {
    let (h, speed) = (1e-2, 3.0);
    for theta in [0.5, 0.6, 0.75, 1.0] {
        for phase in (0..10).map(|i| 0.05 + 0.1 * f64::from(i)) {
            let gap = (4.0 + phase) * h * speed;
            let mut run = Simulation::builder(free(&[2.0]), MoreauJean::new(theta).unwrap(), h)
                .velocity(vec![-speed])
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], gap))
                .build()
                .unwrap();
            for _ in 0..20 {
                run.step().unwrap();
            }
            let depth = if phase <= 0.5 { 1.0 - theta - phase } else { 2.0 - theta - phase };
            let kept = -run.gaps()[0] / (h * speed);
            assert!((kept - depth).abs() < 1e-12, "θ = {theta}, φ = {phase}: {kept}, not {depth}");
        }
    }
}

/// A step from an open gap goes no deeper than its own way, one from a closed gap no deeper than it began: penetrations
/// do not add up, however many impacts there are.
#[test]
fn penetrations_of_many_impacts_do_not_add_up() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(CdLagrange), || Box::new(MoreauJean::new(0.5).unwrap())];
    for make in schemes {
        for courant in [0.37, 0.8] {
            let bar = WallBar::bouncing(6);
            let h = courant * bar.element_size() / bar.wave_speed();
            let mut run = Simulation::builder(bar.system(), make(), h).constraint(bar.contact()).build().unwrap();
            let (mut gap, mut deepest, mut way, mut touched) = (bar.height, 0.0_f64, 0.0_f64, 0_u64);
            for _ in 0..40_000 {
                run.step().unwrap();
                let now = run.state().displacement()[0] + bar.height;
                // (Moreau and Jean's own measure is the velocity at the end of a step.)
                let approach = h * -run.state().velocity()[0];
                (deepest, way) = (deepest.max(-now), way.max(gap - now).max(approach));
                gap = now;
                touched = run.statistics().contact_changes;
            }
            let name = make().name();
            assert!(deepest > 0.1 * way && deepest <= (1.0 + 1e-9) * way, "{name}, {courant}: {deepest} {way}");
            // The way of a contact node that has all the energy of the fall.
            let node = 0.5 * bar.density * bar.element_size();
            let most = h * (2.0 * bar.weight() * bar.height / node).sqrt();
            assert!(deepest < most && touched > 20, "{name}, {courant}: {deepest} {most}, {touched} changes");
        }
    }
}

/// Force RMS, largest force and energy left of the bars at 1 ms (Moreau–Jean) and Courant number ½ (CD-Lagrange).
#[test]
fn two_bars_have_the_known_figures() {
    let near = |found: f64, expected: f64, what: &str| {
        assert!((found / expected - 1.0).abs() < 0.03, "{what}: {found} instead of {expected}");
    };
    for (n, rms, max, energy) in [(20, 0.159, 2.55, 0.975), (50, 0.067, 1.12, 0.989), (100, 0.051, 1.06, 0.993)] {
        let found = run(&Bars::paper(n), MoreauJean::new(0.5).unwrap(), 1e-3);
        near(found.force_rms, rms, "Moreau–Jean RMS");
        near(found.force_max, max, "Moreau–Jean max");
        near(found.energy, energy, "Moreau–Jean energy");
    }
    near(run(&Bars::paper(20), MoreauJean::new(1.0).unwrap(), 1e-3).energy, 0.82, "Moreau–Jean(1) energy");
    for (n, rms, max, energy) in [(20, 0.096, 1.09, 0.977), (50, 0.068, 1.09, 0.991)] {
        let found = run(&Bars::paper(n), CdLagrange, 0.05 / n as f64);
        near(found.force_rms, rms, "CD-Lagrange RMS");
        near(found.force_max, max, "CD-Lagrange max");
        near(found.energy, energy, "CD-Lagrange energy");
    }
}

/// An explicit scheme loses the kinetic energy of the contact nodes, 1/(2n), and no more than its own damping.
#[test]
fn explicit_schemes_stay_bounded_through_impact_and_release_at_every_phase() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 6] = [
        || Box::new(CentralDifference),
        || Box::new(CdLagrange),
        || Box::new(NohBathe::new(0.54).unwrap()),
        || Box::new(ChungLee::new(28.0 / 27.0).unwrap()),
        || Box::new(HulbertChung::new(0.8).unwrap()),
        || Box::new(MoreauJean::new(0.5).unwrap()),
    ];
    for make in schemes {
        for phase in (0..10).map(|i| 0.05 + 0.1 * f64::from(i)) {
            let h = 1e-3;
            let bars = Bars::paper(50).delayed(phase, h);
            let record = record::<f64>(&bars, make(), None, h, 0.4);
            let found = figures(&bars, &record, h);
            let name = make().name();
            assert!(found.force_rms < 0.12 && found.force_max < 1.9, "{name}, phase {phase}: {found:?}");
            assert!((0.97..1.0).contains(&found.energy) && found.energy_max < 1.01, "{name}, phase {phase}: {found:?}");
            assert!(found.drift < 1e-12 && found.closure < 1e-12, "{name}, phase {phase}: {found:?}");
            let outside = record.t.iter().zip(&record.force).filter(|(t, _)| **t < 0.099 || **t > 0.31);
            assert!(outside.into_iter().all(|(_, force)| *force == 0.0), "{name}, phase {phase}");
        }
    }
}

#[test]
fn correction_of_explicit_position_level_contact_removes_the_impulse() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(ChungLee::new(28.0 / 27.0).unwrap()), || Box::new(HulbertChung::new(0.8).unwrap())];
    for make in schemes {
        let bars = Bars::paper(20);
        let corrector: Box<dyn Corrector<f64>> = Box::new(PersistencyCorrection::new());
        let raw = run(&bars, make(), 1e-3);
        let corrected = figures(&bars, &record(&bars, make(), Some(corrector), 1e-3, 0.4), 1e-3);
        assert!(raw.force_max > 2.0 && corrected.force_max < 1.1, "{raw:?} {corrected:?}");
        assert!(corrected.variation < 2.6 && corrected.closure < 1e-12, "{corrected:?}");
    }
}

/// Why the scheme is shipped with forward increments: the multipliers of two stages at velocity level fight.
#[test]
fn forward_increments_of_two_stages_are_smoother_than_velocity_conditions() {
    let bars = Bars::paper(20);
    let ahead = run(&bars, NohBathe::new(0.54).unwrap(), 1e-3);
    let level = |stage: Stage| {
        let contact = ContactLevel::Velocity { lead: 0.0, forecast: stage.recovery.u, forecast_at: stage.end };
        stage.with_contact(contact)
    };
    let shipped = NohBathe::new(0.54).unwrap().tableau();
    let rows = Tableau::staged(shipped.stages.into_iter().map(level).collect());
    let at_velocity_level = run(&bars, Tabulated("Noh–Bathe at velocity level", rows), 1e-3);
    assert!((ahead.force_rms - 0.127).abs() < 0.005, "{ahead:?}");
    assert!((at_velocity_level.force_rms - 1.49).abs() < 0.05, "{at_velocity_level:?}");
    assert!(at_velocity_level.variation > 10.0 * ahead.variation);
}

/// A mass pressed on a stop from the first instant: the force is there at t = 0 and stays.
#[test]
fn a_mass_rests_on_a_stop_from_the_start() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 4] = [
        || Box::new(CentralDifference),
        || Box::new(CdLagrange),
        || Box::new(NohBathe::new(0.54).unwrap()),
        || Box::new(MoreauJean::new(0.5).unwrap()),
    ];
    for make in schemes {
        let mut run = mass_above_stop(make(), 0.0, 0.0);
        assert!((run.state().contacts().forces()[0] - 20.0).abs() < 1e-12, "{}", make().name());
        run.run_until(1.0, &mut ()).unwrap();
        let state = run.state();
        assert!((state.contacts().forces()[0] - 20.0).abs() < 1e-10, "{}", make().name());
        assert!(state.displacement()[0].abs() < 1e-13 && state.velocity()[0].abs() < 1e-12, "{}", make().name());
        assert_eq!(run.statistics().contact_changes, 0, "{}", make().name());
    }
}

/// A mass that touches the stop and flies at it: central differences stop it within the first step.
#[test]
fn an_approach_at_the_start_is_met_by_the_first_forces() {
    let mut run = mass_above_stop(Box::new(CentralDifference), 0.0, -3.0);
    for _ in 0..5 {
        run.step().unwrap();
        assert!(run.gaps()[0].abs() < 1e-15);
    }
    assert!(run.state().velocity()[0].abs() < 1e-12);
}

/// A mass 2 under the force −20, `gap` above a stop.
fn mass_above_stop(scheme: Box<dyn TimeIntegrator>, gap: f64, velocity: f64) -> Simulation<'static, f64> {
    let system = free(&[2.0]).load(|_, force| force[0] = -20.0);
    Simulation::builder(system, scheme, 1e-2)
        .velocity(vec![velocity])
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], gap))
        .build()
        .unwrap()
}

/// A wall that pushes a mass: as a driven dof, and as an offset of the gap. The mass takes the speed of the wall, and
/// the force that its acceleration needs.
#[test]
fn a_moving_wall_takes_a_mass_along() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] =
        [|| Box::new(CentralDifference), || Box::new(CdLagrange), || Box::new(MoreauJean::new(0.5).unwrap())];
    // Reaches the mass with speed 0.5, then accelerates with 2.
    let wall = |t: f64| {
        let late = (t - 0.5).max(0.0);
        [0.5 * t - 0.1 + late * late, 0.5 + 2.0 * late, if t < 0.5 { 0.0 } else { 2.0 }]
    };
    for make in schemes {
        let driven = free(&[3.0, 3.0]).drive(1, wall).unwrap();
        let rows = LinearRows::new().unilateral(&[(0, 1.0), (1, -1.0)], 0.0);
        let by_support = Simulation::builder(driven, make(), 1e-3).constraint(rows).build().unwrap();
        let offset = GapOffset::moving(move |t| wall(t).map(|x: f64| -x));
        let rows = LinearRows::new().unilateral(&[(0, 1.0)], offset);
        let alone = free(&[3.0]);
        let by_offset = Simulation::builder(alone, make(), 1e-3).constraint(rows).build().unwrap();
        for mut run in [by_support, by_offset] {
            run.run_until(0.4, &mut ()).unwrap();
            let name = make().name();
            assert!((run.state().velocity()[0] - 0.5).abs() < 1e-9, "{name}: {:?}", run.state().velocity());
            assert!(run.gaps()[0].abs() < 1.1 * 0.5 * 1e-3, "{name}: {:?}", run.gaps());
            run.run_until(0.9, &mut ()).unwrap();
            let [_, v, a] = wall(run.time());
            assert!((run.state().velocity()[0] - v).abs() < 2.0 * 2.0 * 1e-3, "{name}: {:?}", run.state().velocity());
            assert!(
                (run.state().contacts().forces()[0] - 3.0 * a).abs() < 1e-6,
                "{name}: {:?}",
                run.state().contacts()
            );
        }
    }
}

/// Noh and Bathe's two stages differ in length, so a gap that is closed at the end of either leaves some velocity: up
/// to 6 % of the approach of a rigid mass, by the phase of the impact.
#[test]
fn a_rigid_mass_leaves_noh_and_bathes_contact_slowly() {
    let mut fastest = 0.0_f64;
    for phase in (0..50).map(|i| 0.02 * f64::from(i)) {
        let mut run = mass_above_stop(Box::new(NohBathe::new(0.54).unwrap()), 0.1 + 3.0e-2 * phase, -3.0);
        run.run_until(0.05, &mut ()).unwrap();
        fastest = fastest.max(run.state().velocity()[0]);
    }
    assert!((0.15..0.19).contains(&fastest), "{fastest}");
}

/// A mass pressed on a table that shakes: forward increments know where the table will be, whether it is a driven dof
/// or an offset of the gap.
#[test]
fn forward_increments_follow_a_shaking_table_exactly() {
    let table = |t: f64| {
        let (sin, cos) = (40.0 * t).sin_cos();
        [0.01 * sin, 0.4 * cos, -16.0 * sin]
    };
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(CentralDifference), || Box::new(NohBathe::new(0.54).unwrap())];
    for make in schemes {
        let load = |_: f64, force: &mut [f64]| force[0] = -100.0;
        let driven = free(&[3.0, 3.0]).load(load).drive(1, table).unwrap();
        let rows = LinearRows::new().unilateral(&[(0, 1.0), (1, -1.0)], 0.0);
        let by_support = Simulation::builder(driven, make(), 1e-3).constraint(rows).velocity(vec![0.4, 0.4]);
        let offset = GapOffset::moving(move |t| table(t).map(|x: f64| -x));
        let alone = free(&[3.0]).load(load);
        let rows = LinearRows::new().unilateral(&[(0, 1.0)], offset);
        let by_offset = Simulation::builder(alone, make(), 1e-3).constraint(rows).velocity(vec![0.4]);
        for builder in [by_support, by_offset] {
            let mut run = builder.build().unwrap();
            for _ in 0..500 {
                run.step().unwrap();
                assert!(run.gaps()[0].abs() < 1e-15, "{}: {:e}", make().name(), run.gaps()[0]);
                assert!(run.state().contacts().forces()[0] > 50.0);
            }
        }
    }
}

/// At velocity level a pressed mass has the table's velocity, at the time where the scheme asks for it. (It is not
/// pressed in every step: gaps are not controlled, and one that has opened a little must close again.)
#[test]
fn velocity_conditions_follow_a_shaking_table_exactly() {
    let h = 1e-3;
    let table = |t: f64| {
        let (sin, cos) = (40.0 * t).sin_cos();
        [0.01 * sin, 0.4 * cos, -16.0 * sin]
    };
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(MoreauJean::new(0.5).unwrap()), || Box::new(CdLagrange)];
    for (make, lead) in schemes.into_iter().zip([0.0, 0.5]) {
        let system = free(&[3.0, 3.0]).load(|_, force| force[0] = -100.0).drive(1, table).unwrap();
        let mut run = Simulation::builder(system, make(), h)
            .velocity(vec![0.4, 0.4])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0), (1, -1.0)], 0.0))
            .build()
            .unwrap();
        let mut pressed = 0;
        for _ in 0..500 {
            run.step().unwrap();
            let state = run.state();
            if state.contacts().forces()[0] == 0.0 {
                continue;
            }
            pressed += 1;
            let found = state.velocity()[0] + lead * h * state.stored_acceleration()[0];
            let expected = table(state.time() + lead * h)[1];
            assert!((found - expected).abs() < 1e-12, "{}: {:e}", make().name(), found - expected);
        }
        assert!(pressed > 250, "{}: {pressed}", make().name());
    }
}

/// The first multiplier of central differences pushes a second contact in, which was not violated by itself.
#[test]
fn contacts_that_others_push_in_take_part_in_the_start() {
    let system = free(&[1.0, 1.0]).load(|_, force| force[0] = -20.0);
    let run = Simulation::builder(system, CentralDifference, 1e-3)
        .constraint(LinearRows::new().unilateral(&[(0, 1.0), (1, 1.0)], 0.0).unilateral(&[(1, -1.0)], 0.0))
        .build()
        .unwrap();
    let forces = run.state().contacts().forces();
    assert!(forces.iter().all(|force| (force - 20.0).abs() < 1e-12), "{forces:?}");
    assert!(run.state().acceleration().iter().all(|a| a.abs() < 1e-12));
}

/// Damping proportional to mass leaves an explicit scheme with a lumped mass its diagonal; none needs no entry at all.
#[test]
fn explicit_schemes_factorize_nothing_they_need_not() {
    let bars = Bars::paper(20);
    let size = |mass_damping: f64, stiffness_damping: f64| {
        let system = bars.system::<f64>().rayleigh(mass_damping, stiffness_damping).unwrap();
        Simulation::builder(system, CentralDifference, 1e-3).build().unwrap().factor_size()
    };
    assert_eq!([size(0.0, 0.0), size(0.3, 0.0)], [bars.dofs(); 2]);
    assert!(size(0.0, 1e-5) > bars.dofs());
}

/// Steps that change through approach, impact and release.
#[test]
fn explicit_contact_bears_changing_steps() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 5] = [
        || Box::new(CentralDifference),
        || Box::new(CdLagrange),
        || Box::new(NohBathe::new(0.54).unwrap()),
        || Box::new(HulbertChung::new(0.8).unwrap()),
        || Box::new(MoreauJean::new(0.5).unwrap()),
    ];
    for make in schemes {
        let bars = Bars::paper(20);
        let mut run = Simulation::builder(bars.system::<f64>(), make(), 1e-3)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .build()
            .unwrap();
        let start = run.energy().total();
        let (mut impulse, mut deepest) = (0.0, 0.0_f64);
        for i in 0_u32.. {
            run.set_step_size([1e-3, 0.4e-3, 1.1e-3, 0.7e-3][(i % 4) as usize]).unwrap();
            run.step().unwrap();
            impulse += run.state().contacts().impulses()[0];
            deepest = deepest.min(run.gaps()[0]);
            if run.time() > 0.4 {
                break;
            }
        }
        let name = make().name();
        let energy = run.energy().total() / start;
        assert!((0.93..1.0).contains(&energy), "{name}: {energy}");
        // 2 m v, less what the plastic impact leaves in the bars.
        assert!((impulse / 2.5e-3 - 1.0).abs() < 0.03, "{name}: {impulse}");
        assert!(deepest > -0.1 * 1.2e-3, "{name}: {deepest}");
        assert!(run.gaps()[0] > 0.0);
    }
}

#[test]
fn what_cannot_be_combined_is_refused_with_a_sentence() {
    let bars = Bars::paper(4);
    let refusal = |scheme: Box<dyn TimeIntegrator>, corrector: Option<Box<dyn Corrector<f64>>>| {
        let built = Simulation::builder(bars.system::<f64>(), scheme, 1e-3)
            .constraint(bars.contact())
            .correctors(corrector)
            .build();
        match built {
            Err(error @ Error::Incompatible { .. }) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    let correction = || Some(Box::new(PersistencyCorrection::new()) as Box<dyn Corrector<f64>>);
    let message = refusal(Box::new(TchamwaWielgosz::new(1.033).unwrap()), None);
    assert!(message.contains("compliant law") && message.contains("Tchamwa"), "{message}");
    let message = refusal(Box::new(CentralDifference), correction());
    assert!(message.contains("ahead of the state"), "{message}");
    let message = refusal(Box::new(MoreauJean::new(0.5).unwrap()), correction());
    assert!(message.contains("on velocities"), "{message}");
    // Without contact rows nothing is wrong with them.
    let free = Simulation::builder(bars.system::<f64>(), TchamwaWielgosz::new(1.033).unwrap(), 1e-3);
    assert!(free.corrector(PersistencyCorrection::new()).build().is_ok());
}

/// Forces of the dampers lag by a step: the member without numerical damping has nothing to spare.
#[test]
fn lagged_damping_is_refused_where_it_cannot_be_stable() {
    let bars = Bars::paper(4);
    let build = |rho: f64, damping: f64| {
        let system = bars.system::<f64>().rayleigh(damping, 0.0).unwrap();
        Simulation::builder(system, HulbertChung::new(rho).unwrap(), 1e-3).build().map(|_| ())
    };
    let message = build(1.0, 0.1).unwrap_err().to_string();
    assert!(message.contains("unstable for every step size"), "{message}");
    assert!(build(1.0, 0.0).is_ok() && build(0.8, 0.1).is_ok());
}
