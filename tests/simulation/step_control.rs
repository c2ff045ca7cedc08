//! Step-size control: refused steps, judgement, growth, and landing on a time.

use contact_dynamics::contact::{Side, Sphere};
use contact_dynamics::{
    CdLagrange, Composite, Control, EnergyMomentum, Error, LinearRows, LinearSystem, Newmark, NodesOnObstacle,
    PersistencyCorrection, Result, Simulation, StepControl, StepView, System, TimeIntegrator, analysis,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::hosts::Hooked;
use contact_dynamics_scenes::schemes::{Listed, all, correctable};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::matrix;
use std::sync::{Arc, Mutex};

type Make = fn() -> Box<dyn TimeIntegrator>;

const COMPOSITE: Make = || Box::new(Composite);

/// Those that ask for the force at the end of a step, or near it: not in its middle, nor at its start alone.
fn asking_at_the_end() -> impl Iterator<Item = Make> {
    let asks = |listed: &Listed| listed.radius.is_some() && listed.name() != EnergyMomentum.name();
    correctable().filter(asks).map(|listed| listed.make)
}

/// Those whose local error can be estimated.
fn estimated() -> impl Iterator<Item = Listed> {
    correctable().filter(|listed| analysis::local_error(&(listed.make)().tableau()).is_some())
}

/// A mass on a spring.
fn oscillator(omega: f64) -> LinearSystem<'static, f64> {
    let k = matrix(1, [(0, 0, omega * omega)]);
    LinearSystem::lumped(vec![1.0], k).unwrap()
}

#[derive(Clone, Copy)]
struct Rule {
    window: [f64; 2],
    limit: f64,
    recoverable: bool,
}

const NEVER: Rule = Rule { window: [f64::INFINITY; 2], limit: 0.0, recoverable: true };

/// A host, last committed at `last`, that admits no step longer than the limit that ends in the window of time, as an
/// element that is turned inside out by too large a step.
fn host(system: LinearSystem<'static, f64>, mut last: f64, rule: Arc<Mutex<Rule>>) -> impl System<f64> + 'static {
    Hooked::new(system, move |method, t, _| {
        let rule = *rule.lock().unwrap();
        match method {
            "force" if (rule.window[0]..rule.window[1]).contains(&t) && t - last > rule.limit * (1.0 + 1e-6) => {
                let source = "an element is turned inside out".into();
                return Err(match rule.recoverable {
                    true => Error::Inadmissible { callback: method, source },
                    false => Error::Host { callback: method, source },
                });
            }
            "commit" => last = t,
            _ => {}
        }
        Ok(())
    })
}

const H: f64 = 1e-3;

fn reluctant(make: Make, rule: Rule, control: Option<StepControl>) -> (Simulation<'static, f64>, Arc<Mutex<Rule>>) {
    let bars = Bars::paper(10).delayed(0.4, H);
    let rule = Arc::new(Mutex::new(rule));
    let system = host(bars.system(), 0.0, Arc::clone(&rule));
    let builder = Simulation::builder(system, make(), H)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .corrector(PersistencyCorrection::with_history_projection());
    let builder = match control {
        Some(control) => builder.step_control(control),
        None => builder,
    };
    (builder.build().unwrap(), rule)
}

/// Everything a later step reads, as far as it can be seen.
fn seen(run: &Simulation<'_, f64>) -> (Vec<Vec<u64>>, u64) {
    let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let state = run.state();
    let mut all = vec![bits(state.displacement()), bits(state.velocity()), bits(state.acceleration())];
    all.push(bits(state.contacts().raw_forces()));
    for k in 1..=run.history().len() {
        let (u, v, a) = run.history().past(k).unwrap();
        all.extend([bits(u), bits(v), bits(a)]);
    }
    all.push(bits(&[run.time(), run.step_size()]));
    (all, run.statistics().steps)
}

/// Steps of H/2ⁿ end at multiples of H/2ⁿ, wherever the window is in which they are that short.
#[test]
fn steps_of_every_size_stay_on_the_grid_of_that_size() {
    for k in 0..24 {
        let start = 0.01 + 3.7e-4 * f64::from(k);
        let rule = Arc::new(Mutex::new(Rule { window: [start, start + 3.3e-3], limit: H / 16.0, recoverable: true }));
        let mut run = Simulation::builder(host(oscillator(1.0), 0.0, rule), Composite, H)
            .displacement(vec![1.0])
            .step_control(StepControl::halving(H / 64.0).unwrap())
            .build()
            .unwrap();
        let mut smallest = H;
        run.run_until(0.06, &mut |step: &StepView<'_, f64>| {
            let steps = step.state.time() / step.h;
            assert!(
                (steps - steps.round()).abs() < 1e-6,
                "{start}: {} is no multiple of {}",
                step.state.time(),
                step.h
            );
            smallest = smallest.min(step.h);
            Control::Continue
        })
        .unwrap();
        assert_eq!((smallest, run.step_size()), (H / 16.0, H));
    }
}

#[test]
fn a_refused_step_is_halved_and_grows_back_on_the_nominal_grid() {
    for make in asking_at_the_end() {
        // In the midst of the contact, in a window that lies across the grid.
        let rule = Rule { window: [0.2003, 0.2107], limit: H / 4.0, recoverable: true };
        let (mut run, _) = reluctant(make, rule, Some(StepControl::halving(H / 64.0).unwrap()));
        let (mut sizes, mut times) = (Vec::new(), Vec::new());
        run.run_until(0.25, &mut |step: &StepView<'_, f64>| {
            sizes.push(step.h);
            times.push(step.state.time());
            Control::Continue
        })
        .unwrap();
        for k in 1..250 {
            let nominal = f64::from(k) * H;
            assert!(times.iter().any(|t| (t - nominal).abs() < 1e-12), "{}: {nominal} is not met", make().name());
        }
        for (size, time) in sizes.iter().zip(&times) {
            // Generalized-α asks for forces before the end of a step.
            let inside = *time > 0.2003 + H && *time < 0.2107;
            let expected = if inside { H / 4.0..=H / 4.0 } else { H / 4.0..=H };
            assert!(expected.contains(size), "{}: a step of {size} to {time}", make().name());
        }
        // Back at the nominal size soon after the window, and no step was wasted before it.
        assert!(run.step_size() == H && sizes.iter().filter(|&&h| h < H).count() < 4 * 11 + 150);
        assert!(sizes[..199].iter().all(|&h| h == H));
        assert!((2..20).contains(&run.statistics().refused_steps), "{}", run.statistics().refused_steps);
        assert_eq!(run.statistics().coarse_steps, 0);
    }
}

#[test]
fn a_retried_step_is_the_step_of_half_the_size() {
    for make in asking_at_the_end() {
        let rule = Rule { window: [0.2003, 0.2503], limit: H / 2.0, recoverable: true };
        let (mut automatic, _) = reluctant(make, rule, Some(StepControl::halving(H / 4.0).unwrap()));
        let (mut by_hand, _) = reluctant(make, rule, None);
        for _ in 0..200 {
            automatic.step().unwrap();
            by_hand.step().unwrap();
        }
        // The failing step leaves everything as it was; then the same change of size gives the same step.
        let before = seen(&by_hand);
        assert!(matches!(by_hand.step(), Err(Error::Inadmissible { .. })));
        assert_eq!(seen(&by_hand), before);
        by_hand.set_step_size(H / 2.0).unwrap();
        automatic.step().unwrap();
        by_hand.step().unwrap();
        assert_eq!(seen(&automatic), seen(&by_hand), "{}", make().name());
    }
}

#[test]
fn giving_up_tells_the_story_and_leaves_no_trace() {
    for make in asking_at_the_end() {
        let rule = Rule { window: [0.20005, 0.3], limit: H / 100.0, recoverable: true };
        let (mut run, shared) = reluctant(make, rule, Some(StepControl::halving(H / 8.0).unwrap()));
        let (mut undisturbed, _) = reluctant(make, NEVER, None);
        for _ in 0..200 {
            run.step().unwrap();
            undisturbed.step().unwrap();
        }
        let before = seen(&run);
        for _ in 0..2 {
            match run.step() {
                Err(ref error @ Error::StepRefused { t, h, attempts: 4, source: ref reason }) => {
                    assert!((t - 0.2).abs() < 1e-12 && h == H / 8.0);
                    assert!(!error.is_recoverable());
                    let text = error.to_string();
                    assert!(text.contains("refused 4 times") && text.contains("1.25e-4"), "{text}");
                    assert!(reason.to_string().contains("force"), "{reason}");
                }
                other => panic!("{other:?}"),
            }
            assert_eq!(seen(&run), before, "{}", make().name());
        }
        // An error that no smaller step mends is handed on at once.
        shared.lock().unwrap().recoverable = false;
        assert!(matches!(run.step(), Err(Error::Host { .. })));
        assert_eq!(seen(&run), before);
        // And the run goes on as if nothing had happened.
        *shared.lock().unwrap() = NEVER;
        for _ in 0..150 {
            run.step().unwrap();
            undisturbed.step().unwrap();
        }
        assert_eq!(seen(&run), seen(&undisturbed), "{}", make().name());
    }
}

/// Steps that begin a multistep scheme are taken by another one; a run that gives up in one of them has to take them
/// still.
#[test]
fn giving_up_at_the_beginning_leaves_no_trace() {
    for make in asking_at_the_end() {
        for taken in 0..3 {
            let go = |rule: Rule| {
                let shared = Arc::new(Mutex::new(rule));
                let system = host(oscillator(300.0), 0.0, Arc::clone(&shared));
                let control = StepControl::halving(H / 4.0).unwrap();
                let builder = Simulation::builder(system, make(), H).displacement(vec![1.0]).step_control(control);
                (builder.build().unwrap(), shared)
            };
            let start = (f64::from(taken) + 0.05) * H;
            let (mut run, shared) = go(Rule { window: [start, 1.0], limit: H / 100.0, recoverable: true });
            let (mut undisturbed, _) = go(NEVER);
            (0..taken).for_each(|_| run.step().unwrap());
            assert!(matches!(run.step(), Err(Error::StepRefused { .. })), "{}", make().name());
            *shared.lock().unwrap() = NEVER;
            (taken..10).for_each(|_| run.step().unwrap());
            (0..10).for_each(|_| undisturbed.step().unwrap());
            assert_eq!(seen(&run).0, seen(&undisturbed).0, "{}, {taken}", make().name());
        }
    }
}

#[test]
fn growth_that_fails_again_and_again_is_tried_ever_more_seldom() {
    let rule = Rule { window: [0.02, 1.0], limit: H / 2.0, recoverable: true };
    let (mut run, _) = reluctant(COMPOSITE, rule, Some(StepControl::halving(H / 4.0).unwrap()));
    run.run_until(0.52, &mut ()).unwrap();
    // 500 nominal steps as 1000 halves: one attempt in 64 of them once patience has grown.
    assert!((5..30).contains(&run.statistics().refused_steps), "{}", run.statistics().refused_steps);
}

#[test]
fn a_controlled_run_is_continued_bit_for_bit() {
    let control = StepControl::halving(H / 64.0).unwrap();
    let rule = Rule { window: [0.2003, 0.2107], limit: H / 8.0, recoverable: true };
    for make in asking_at_the_end() {
        let (mut run, _) = reluctant(make, rule, Some(control));
        run.run_until(0.2053, &mut ()).unwrap();
        assert!(run.step_size() < H);
        let bars = Bars::paper(10).delayed(0.4, H);
        let shared = Arc::new(Mutex::new(rule));
        let resumed = |h| {
            let system = host(bars.system(), run.time(), Arc::clone(&shared));
            Simulation::builder(system, make(), h)
                .constraint(bars.contact())
                .corrector(PersistencyCorrection::with_history_projection())
                .resume(run.state().clone(), run.history().clone())
        };
        // The history says which step size it is continued with, whatever that of the next step is.
        let h = run.history().step_size();
        assert_eq!(h.to_bits(), H.to_bits());
        let refused = resumed(run.step_size()).step_control(control).build();
        assert!(matches!(refused, Err(Error::Parameter { value, .. }) if value.to_bits() == h.to_bits()));
        // Without control that is the size of every step.
        let uncontrolled = resumed(h).build().unwrap();
        assert_eq!([uncontrolled.step_size(), uncontrolled.history().step_size()].map(f64::to_bits), [h.to_bits(); 2]);
        let mut resumed = resumed(h).step_control(control).build().unwrap();
        for _ in 0..200 {
            run.step().unwrap();
            resumed.step().unwrap();
            assert_eq!(seen(&run).0, seen(&resumed).0, "{}", make().name());
        }
        assert!(run.step_size() >= H);
    }
}

#[test]
fn a_restart_keeps_the_place_in_the_nominal_grid() {
    let rule = Rule { window: [0.2003, 0.2107], limit: H / 8.0, recoverable: true };
    let (mut run, _) = reluctant(COMPOSITE, rule, Some(StepControl::halving(H / 64.0).unwrap()));
    run.run_until(0.2053, &mut ()).unwrap();
    assert!(run.step_size() < H);
    run.restart().unwrap();
    run.run_until(0.25, &mut ()).unwrap();
    assert!((run.step_size() - H).abs() < 1e-15 && ((run.time() / H).round() * H - run.time()).abs() < 1e-12);
}

#[test]
fn a_refused_step_may_have_found_other_contacts() {
    // A ball rolls over a block: candidates come and go with every search, that of a refused step included.
    let block = Solid::rectangle([1.0; 2], [8; 2], Material { young: 100.0, poisson: 0.3, density: 1.0 });
    let top: Vec<usize> = block.surface_nodes().into_iter().filter(|&n| block.nodes[n][1] > 0.99).collect();
    let bottom: Vec<usize> = (0..block.nodes.len()).filter(|&n| block.nodes[n][1] < 0.01).collect();
    let h = 0.02;
    let run = |rule: Rule, control: Option<StepControl>| {
        let ball = Sphere::new([-0.3, 1.45], 0.5, Side::Outside).unwrap();
        let contact = NodesOnObstacle::new(ball, &block.nodes, &block.node_dofs(), &top).unwrap();
        let contact = contact.reach(0.04).unwrap().moving(|t| [[t, 0.0], [1.0, 0.0], [0.0; 2]]);
        let inner = bottom.iter().fold(block.system(), |system, &n| {
            [0, 1]
                .into_iter()
                .fold(system, |system: LinearSystem<'static, f64>, axis| system.fix(2 * n + axis).unwrap())
        });
        let shared = Arc::new(Mutex::new(rule));
        let builder = Simulation::builder(host(inner, 0.0, Arc::clone(&shared)), Composite, h)
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection());
        let builder = match control {
            Some(control) => builder.step_control(control),
            None => builder,
        };
        (builder.build().unwrap(), shared)
    };
    let always = |t: f64| Rule { window: [t, 2.0], limit: h / 8.0, recoverable: true };
    let (mut by_hand, rule) = run(NEVER, None);
    let mut found = 0;
    for _ in 0..40 {
        let before = (seen(&by_hand), by_hand.reactions().unwrap(), by_hand.gaps().len());
        *rule.lock().unwrap() = always(0.0);
        by_hand.step().unwrap_err();
        assert_eq!((seen(&by_hand), by_hand.gaps().len()), (before.0, before.2));
        for (x, y) in by_hand.reactions().unwrap().iter().zip(&before.1) {
            assert!((x - y).abs() < 1e-9, "{x} {y}");
        }
        // Another size and back, with the contacts of a search that is not that of the state.
        by_hand.set_step_size(h / 2.0).unwrap();
        by_hand.set_step_size(h).unwrap();
        *rule.lock().unwrap() = NEVER;
        by_hand.step().unwrap();
        found += usize::from(by_hand.gaps().len() != before.2);
    }
    assert!(found > 5, "{found}");
    let (mut controlled, _) = run(always(0.1), Some(StepControl::halving(h / 8.0).unwrap()));
    controlled.run_until(0.5, &mut ()).unwrap();
    assert!(controlled.statistics().refused_steps > 2);
}

#[test]
fn control_that_refuses_nothing_changes_nothing() {
    let control = StepControl::halving(1e-9).unwrap().local_error(1.0).unwrap().contact_changes(5).unwrap();
    for make in estimated().map(|listed| listed.make) {
        let (mut with, _) = reluctant(make, NEVER, Some(control));
        let (mut without, _) = reluctant(make, NEVER, None);
        for _ in 0..400 {
            with.step().unwrap();
            without.step().unwrap();
        }
        assert_eq!(seen(&with), seen(&without));
    }
}

#[test]
fn estimates_add_up_to_the_error_of_smooth_motion() {
    let omega = 3.0;
    for scheme in all() {
        if analysis::local_error(&(scheme.make)().tableau()).is_none() {
            assert_eq!(scheme.order, 1, "{}", scheme.name());
            continue;
        }
        let run_with = |h: f64| {
            let control = StepControl::halving(h).unwrap().local_error(1.0).unwrap();
            let mut run = Simulation::builder(oscillator(omega), (scheme.make)(), h)
                .displacement(vec![1.0])
                .step_control(control)
                .build()
                .unwrap();
            let mut sum = 0.0;
            let mut started = 0.0;
            while run.time() < 4.0 - 0.5 * h {
                run.step().unwrap();
                if run.statistics().steps <= 10 {
                    // What the start makes of its own is not the scheme's.
                    started = error_of(&run, omega);
                } else {
                    sum += run.local_error().unwrap();
                }
            }
            (sum, error_of(&run, omega) - started)
        };
        // The local error lies along one direction of the plane of u and v/ω while the estimate follows the motion
        // around: its mean over a period is 2/π or more of what adds up.
        let (sum, error) = run_with(2e-3);
        assert!((0.35..2.0).contains(&(sum / error)), "{}: {}", scheme.name(), sum / error);
        let (half, _) = run_with(1e-3);
        let order = (sum / half).log2();
        assert!((order - f64::from(scheme.order)).abs() < 0.1, "{}: {order}", scheme.name());
    }
}

/// Distance from cos ωt in the plane of u and v/ω.
fn error_of(run: &Simulation<'_, f64>, omega: f64) -> f64 {
    let (u, v, t) = (run.state().displacement()[0], run.state().velocity()[0], run.time());
    (u - (omega * t).cos()).hypot(v / omega + (omega * t).sin())
}

/// A mass that flies at a wall with unit speed and hits it at the given time.
fn flight(
    scheme: Box<dyn TimeIntegrator>,
    h: f64,
    impact: f64,
    control: StepControl,
) -> Result<Simulation<'static, f64>> {
    let corrected =
        scheme.tableau().stages.iter().all(|stage| stage.contact.lead() == 0.0) && !scheme.name().starts_with("Moreau");
    let corrector: Option<Box<dyn contact_dynamics::Corrector<f64>>> =
        if corrected { Some(Box::new(PersistencyCorrection::with_history_projection())) } else { None };
    Simulation::builder(oscillator(0.0), scheme, h)
        .velocity(vec![-1.0])
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], impact))
        .correctors(corrector)
        .step_control(control)
        .build()
}

#[test]
fn no_impact_hides_from_the_estimate() {
    let h = 0.01;
    for scheme in all().into_iter().filter(Listed::takes_multipliers) {
        for phase in [0.02, 0.2, 0.5, 0.8, 0.98] {
            let control = StepControl::halving(h).unwrap().local_error(1e3).unwrap();
            let run = flight((scheme.make)(), h, 0.1 + phase * h, control);
            let ahead = (scheme.make)().tableau().stages.iter().any(|stage| stage.contact.lead() > 0.0);
            if ahead || analysis::local_error(&(scheme.make)().tableau()).is_none() {
                assert!(matches!(run, Err(Error::Incompatible { .. })), "{}", scheme.name());
                continue;
            }
            let mut run = run.unwrap();
            // The instant of impact is known to a step at best: half of the way in it is the least honest error.
            let mut largest = 0.0_f64;
            while run.time() < 0.1 + 3.0 * h - 1e-9 {
                run.step().unwrap();
                largest = largest.max(run.local_error().unwrap());
            }
            assert!(largest > 0.5 * h, "{}, phase {phase}: {largest}", scheme.name());
        }
    }
}

#[test]
fn the_error_follows_the_tolerance() {
    let omega = 3.0;
    for make in estimated().filter(|listed| listed.radius.is_some()).map(|listed| listed.make) {
        let errors = [1e-4, 1e-6].map(|tolerance| {
            let control = StepControl::halving(1e-6).unwrap().local_error(tolerance).unwrap();
            let mut run = Simulation::builder(oscillator(omega), make(), 0.1)
                .displacement(vec![1.0])
                .step_control(control)
                .build()
                .unwrap();
            run.run_until(5.0, &mut ()).unwrap();
            let counts = run.statistics();
            assert_eq!(counts.coarse_steps, 0);
            // Growth that would be refused is not tried.
            assert!(counts.refused_steps < 10 + counts.steps / 20, "{}: {counts:?}", make().name());
            (error_of(&run, omega), run.statistics().steps)
        });
        // Errors a step fall 100 times, steps become 100^(1/3) times as many, give or take a power of two.
        let [(coarse, few), (fine, many)] = errors;
        assert!(coarse < 0.05 && fine < 0.1 * coarse, "{}: {coarse:e} {fine:e}", make().name());
        assert!((2.0..11.0).contains(&(many as f64 / few as f64)), "{}: {few} {many}", make().name());
    }
}

#[test]
fn contacts_that_close_together_are_parted_as_far_as_steps_may_be_halved() {
    // Three masses that hit at different times within one step, two of them together.
    let zero = matrix(3, [(0, 0, 0.0)]);
    let walls = LinearRows::new().unilateral(&[(0, 1.0)], 0.102).unilateral(&[(1, 1.0)], 0.107);
    let walls = walls.unilateral(&[(2, 1.0)], 0.107);
    let control = StepControl::halving(1e-4).unwrap().contact_changes(1).unwrap();
    let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0; 3], zero).unwrap(), Newmark::trapezoidal(), 0.01)
        .velocity(vec![-1.0; 3])
        .constraint(walls)
        .corrector(PersistencyCorrection::new())
        .step_control(control)
        .build()
        .unwrap();
    let mut most = Vec::new();
    let mut before = 0;
    run.run_until(0.2, &mut |step: &StepView<'_, f64>| {
        most.push((step.statistics.contact_changes - before, step.h));
        before = step.statistics.contact_changes;
        Control::Continue
    })
    .unwrap();
    let crowded: Vec<_> = most.iter().filter(|(changes, _)| *changes > 1).collect();
    assert_eq!(crowded.len(), 1);
    assert!(crowded[0].0 == 2 && crowded[0].1 < 2e-4);
    assert_eq!(run.statistics().coarse_steps, 1);
    assert!((run.step_size() - 0.01).abs() < 1e-15);
}

#[test]
fn runs_land_on_any_time() {
    for make in estimated().map(|listed| listed.make) {
        let omega = 3.0;
        let mut run = Simulation::builder(oscillator(omega), make(), 0.01).displacement(vec![1.0]).build().unwrap();
        let mut steps = 0;
        for t in [0.5, 0.503, 0.5031, 0.6, 1.0, 2.0 / 3.0 + 1.0, 2.0] {
            run.land_on(t, &mut |_: &StepView<'_, f64>| {
                steps += 1;
                Control::Continue
            })
            .unwrap();
            assert!((run.time() - t).abs() < 1e-12, "{}: {} instead of {t}", make().name(), run.time());
            assert!((run.step_size() - 0.01).abs() < 1e-15);
        }
        assert_eq!(run.statistics().steps, steps);
        assert!((200..207).contains(&steps), "{steps} steps");
        assert!(error_of(&run, omega) < 6e-3, "{}: {:e}", make().name(), error_of(&run, omega));
        assert!(matches!(run.land_on(f64::NAN, &mut ()), Err(Error::Parameter { .. })));
        // The past is not reached again.
        run.land_on(1.0, &mut ()).unwrap();
        assert!((run.time() - 2.0).abs() < 1e-12);
    }
}

/// A time within a billionth of a step counts as reached, whatever time is counted in.
#[test]
fn runs_land_alike_in_any_unit_of_time() {
    let landed = |unit: f64, steps: f64| {
        let mut run =
            Simulation::builder(oscillator(0.0), Newmark::trapezoidal(), unit).velocity(vec![1.0]).build().unwrap();
        run.land_on(steps * unit, &mut ()).unwrap();
        (run.statistics().steps, run.time() / unit)
    };
    for (steps, expected) in [(3.0 - 4e-10, (3, 3.0)), (3.0 + 4e-10, (3, 3.0)), (3.0 - 4e-7, (3, 3.0 - 4e-7))] {
        for unit in [2.0_f64.powi(-40), 1.0, 2.0_f64.powi(40)] {
            let (count, time) = landed(unit, steps);
            assert!(count == expected.0 && (time - expected.1).abs() < 1e-14, "{unit}: {count} {time}");
        }
    }
}

#[test]
fn absurd_settings_are_refused() {
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(StepControl::halving(value), Err(Error::Parameter { .. })));
        assert!(matches!(StepControl::halving(1.0).unwrap().local_error(value), Err(Error::Parameter { .. })));
    }
    assert!(matches!(StepControl::halving(1.0).unwrap().contact_changes(0), Err(Error::Parameter { .. })));
    let control = StepControl::halving(1e-3).unwrap().local_error(1e-3).unwrap();
    let refused = flight(Box::new(CdLagrange), 0.01, 0.1, control);
    assert!(matches!(refused, Err(Error::Incompatible { .. })));
}
