//! Changes of the step size, restarts and start-up.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::observer::ContactRecorder;
use contact_dynamics::{
    Bathe, Bdf2, Composite, ContactLaw, Corrector, Error, GeneralizedAlpha, Houbolt, LinearRows, LinearSystem,
    MoreauJean, Newmark, Oalts, Park, PersistencyCorrection, Simulation, SimulationBuilder, StartUp, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::measure::record_run;
use contact_dynamics_scenes::reference::{HarmonicForce, forced_oscillator};
use contact_dynamics_scenes::schemes::{Listed, all, correctable};
use contact_dynamics_scenes::sparse::{matrix, springs};
use std::sync::atomic::{AtomicBool, Ordering};

const OMEGA: f64 = 2.0;
const XI: f64 = 0.05;
const FORCE: HarmonicForce = HarmonicForce { frequency: 1.3, cosine: 0.7, sine: 0.4 };
const MASS: f64 = 3.0;

fn oscillator(scheme: Box<dyn TimeIntegrator>, h: f64) -> Simulation<'static, f64> {
    oscillator_builder(scheme, h).build().unwrap()
}

fn oscillator_builder(scheme: Box<dyn TimeIntegrator>, h: f64) -> SimulationBuilder<'static, f64> {
    let scalar = |x| matrix(1, [(0, 0, x)]);
    let system = LinearSystem::lumped(vec![MASS], scalar(MASS * OMEGA * OMEGA))
        .unwrap()
        .damping(scalar(MASS * 2.0 * XI * OMEGA))
        .unwrap()
        .load(move |t, force| {
            let angle = FORCE.frequency * t;
            force[0] = MASS * (FORCE.cosine * angle.cos() + FORCE.sine * angle.sin());
        });
    Simulation::builder(system, scheme, h).displacement(vec![0.3]).velocity(vec![-0.8])
}

/// Root mean square errors of u, v, a over the second half of `steps` steps of size `h · ratio(i)`.
fn errors(scheme: Box<dyn TimeIntegrator>, h: f64, steps: u32, ratio: impl Fn(u32) -> f64) -> [f64; 3] {
    let mut run = oscillator(scheme, h * ratio(0));
    let mut sums = [0.0; 3];
    for i in 0..steps {
        run.set_step_size(h * ratio(i)).unwrap();
        run.step().unwrap();
        if i >= steps / 2 {
            let exact = forced_oscillator(OMEGA, XI, FORCE, 0.3, -0.8, run.time());
            let state = run.state();
            let found = [state.displacement()[0], state.velocity()[0], state.acceleration()[0]];
            for ((sum, found), exact) in sums.iter_mut().zip(found).zip(exact) {
                *sum += (found - exact) * (found - exact);
            }
        }
    }
    sums.map(|sum| (sum / f64::from(steps - steps / 2)).sqrt())
}

fn observed(make: fn() -> Box<dyn TimeIntegrator>, steps: u32, ratio: impl Fn(u32) -> f64 + Copy) -> [f64; 3] {
    let at = |steps: u32| errors(make(), 8.0 / f64::from(steps), steps, ratio);
    let (coarse, fine) = (at(steps), at(2 * steps));
    [0, 1, 2].map(|i| (coarse[i] / fine[i]).log2())
}

/// A step size ratio in [1/√3, √3], so that neighbors differ by factors in [1/3, 3]; of a linear congruential
/// generator.
fn random(i: u32) -> f64 {
    let draw = f64::from((i.wrapping_mul(747_796_405).wrapping_add(2_891_336_453) >> 9) & 0xffff) / 65_536.0;
    3.0_f64.powf(draw - 0.5)
}

type Pattern = fn(u32) -> f64;

/// With a constant step, with one that alternates, and with one that is drawn anew for every step. Stability limits of
/// explicit schemes are far away.
#[test]
fn every_scheme_keeps_its_order_when_the_step_changes_every_time() {
    let patterns: [(&str, Pattern, f64); 5] = [
        ("constant", |_| 1.0, 0.05),
        ("1, 2", |i| if i % 2 == 0 { 1.0 } else { 2.0 }, 0.05),
        ("1, 3", |i| if i % 2 == 0 { 1.0 } else { 3.0 }, 0.15),
        ("1, 1/3, 1/3", |i| if i % 3 == 0 { 1.0 } else { 1.0 / 3.0 }, 0.05),
        ("random", random, 0.12),
    ];
    for scheme in all() {
        for (pattern, ratio, tolerance) in patterns {
            // (Explicit schemes that start with an acceleration of another time are asymptotic late.)
            let steps = if scheme.critical.is_some() { 6400 } else { 1600 };
            let found = observed(scheme.make, steps, ratio);
            let expected = f64::from(scheme.order);
            // (The error constant of a first-order scheme is large: it is not quite asymptotic here.)
            let tolerance: f64 = if scheme.order == 1 { 0.11 } else { tolerance };
            let near = |order: &f64| (order - expected).abs() < tolerance;
            assert!(found.iter().all(near), "{}, {pattern}: {found:.3?}", scheme.name());
        }
    }
}

/// Largest displacement late in a run of a mode with Ω = `omega` at h = 1, released from 1.
fn late_amplitude(make: fn() -> Box<dyn TimeIntegrator>, omega: f64, ratio: Pattern) -> f64 {
    let k = matrix(1, [(0, 0, omega * omega)]);
    let system = LinearSystem::<f64>::lumped(vec![1.0], k).unwrap();
    let mut run = Simulation::builder(system, make(), 1.0).displacement(vec![1.0]).build().unwrap();
    let mut late = 0.0_f64;
    for i in 0..200 {
        run.set_step_size(ratio(i)).unwrap();
        run.step().unwrap();
        if i > 150 {
            late = late.max(run.state().displacement()[0].abs());
        }
    }
    late
}

const ALTERNATING: Pattern = |i| if i % 2 == 0 { 1.0 } else { 3.0 };

/// Modes that the step does not resolve die out, or keep their size, also when the step alternates by a factor of 3.
#[test]
fn stiff_modes_do_not_grow_when_the_step_changes_every_time() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 9] = [
        || Box::new(Composite),
        || Box::new(Houbolt),
        || Box::new(Park),
        || Box::new(Bdf2),
        || Box::<Bathe>::default(),
        || Box::new(Newmark::trapezoidal()),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.5).unwrap()),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
        || Box::new(MoreauJean::new(0.5).unwrap()),
    ];
    let patterns: [Pattern; 3] = [random, ALTERNATING, |i| if i / 10 % 2 == 0 { 1.0 } else { 3.0 }];
    for make in schemes {
        for ratio in patterns {
            for omega in [3.0, 30.0, 300.0] {
                let late = late_amplitude(make, omega, ratio);
                assert!(late <= 1.0 + 1e-9, "{}, Ω = {omega}: {late:e}", make().name());
            }
        }
    }
}

/// Growth a change of an undamped mode, when the step alternates between 1 and `ratio` every `period` steps.
fn growth(make: fn() -> Box<dyn TimeIntegrator>, omega: f64, ratio: f64, period: u32) -> f64 {
    let k = matrix(1, [(0, 0, omega * omega)]);
    let system = LinearSystem::<f64>::lumped(vec![1.0], k).unwrap();
    let mut run = Simulation::builder(system, make(), 1.0).displacement(vec![1.0]).build().unwrap();
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for i in 0..300 * period {
        run.set_step_size(if (i / period).is_multiple_of(2) { 1.0 } else { ratio }).unwrap();
        run.step().unwrap();
        let size = run.state().displacement()[0].abs();
        match i / period {
            60..100 => early = early.max(size),
            260.. => late = late.max(size),
            _ => {}
        }
    }
    (late / early).powf(1.0 / 200.0)
}

/// Regular changes may resonate with a mode that is damped little: hardly with the composite scheme, a little with
/// Park's.
#[test]
fn repeated_changes_feed_no_mode() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 4] =
        [|| Box::new(Bdf2), || Box::new(Houbolt), || Box::new(Composite), || Box::new(Park)];
    for (make, bound) in schemes.into_iter().zip([1.0005, 1.0005, 1.005, 1.035]) {
        for ratio in [1.2, 1.5, 2.0, 3.0] {
            for period in 1..=4 {
                for omega in (0..24).map(|i| 10.0_f64.powf(-1.0 + 3.5 * f64::from(i) / 24.0)) {
                    let growth = growth(make, omega, ratio, period);
                    // (What has vanished has no growth.)
                    assert!(
                        growth < bound || growth.is_nan(),
                        "{}, Ω = {omega}, 1 : {ratio} every {period} steps: {growth}",
                        make().name()
                    );
                }
            }
        }
    }
}

/// What `docs/schemes.md` warns of: schemes that extrapolate old accelerations far.
#[test]
fn stiff_modes_grow_with_the_two_schemes_that_are_named() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(Oalts::new(0.5).unwrap()), || Box::new(GeneralizedAlpha::chung_hulbert(0.0).unwrap())];
    for make in schemes {
        let late = late_amplitude(make, 3.0, ALTERNATING);
        assert!(late > 2.0, "{} is better than said: {late:e}", make().name());
    }
}

/// H18: the bars of the paper, the step shortened to 0.3 ms in the middle of the contact, and lengthened again.
#[test]
fn step_changes_during_contact_leave_the_force_smooth() {
    let correction = || Some(Box::new(PersistencyCorrection::with_history_projection()) as Box<dyn Corrector<f64>>);
    for listed in correctable() {
        let make = listed.make;
        for phase in [0.05, 0.35, 0.65, 0.95] {
            let h = 1e-3;
            let bars = Bars::paper(20).delayed(phase, h);
            let error = |changes: &[(f64, f64)]| {
                let mut run = Simulation::builder(bars.system::<f64>(), make(), h)
                    .velocity(bars.velocities())
                    .constraint(bars.contact())
                    .correctors(correction())
                    .build()
                    .unwrap();
                let mut all = record_run(&bars, &mut run, changes[0].0);
                for (i, (_, h)) in changes.iter().enumerate() {
                    run.set_step_size(*h).unwrap();
                    let next = record_run(&bars, &mut run, changes.get(i + 1).map_or(0.4, |change| change.0));
                    all.t.extend(next.t);
                    all.force.extend(next.force);
                    all.momentum[1] = next.momentum[1];
                }
                assert!(all.drift() < 1e-10, "{}: {:e}", make().name(), all.drift());
                // Weighted by the step, so that short steps do not count more.
                let exact = bars.exact(0.5);
                let reference = exact.contact_force(0.2);
                let (mut sum, mut time) = (0.0, 0.0);
                for i in 1..all.t.len() {
                    let (t, step) = (all.t[i], all.t[i] - all.t[i - 1]);
                    if t > bars.impact_time() + 1e-6 * h && t < bars.impact_time() + 0.2 - 1e-6 * h {
                        sum += step * (all.force[i] / reference - 1.0).powi(2);
                        time += step;
                    }
                }
                (sum / time).sqrt()
            };
            let plain = error(&[(0.15, h)]);
            let changed = error(&[(0.15, 0.3 * h), (0.2, h)]);
            assert!(changed < 1.2 * plain, "{}, phase {phase}: {changed} after {plain}", make().name());
            // Also within the first steps of the contact, where the past is that of the approach.
            let early = error(&[(0.1015, 0.3 * h), (0.104, h)]);
            assert!(early < 1.2 * plain, "{}, phase {phase}: {early} after {plain}", make().name());
        }
    }
}

/// A step that changes right after an impact must not read the approach: the past is made of the state in contact, and
/// has neither gap nor gap rate.
#[test]
fn a_past_from_before_the_impact_is_not_interpolated() {
    let history = PersistencyCorrection::with_history_projection();
    // (Without history projection the contact may be lost a step later.)
    let cases = [(None, 0), (Some(PersistencyCorrection::new()), 0), (Some(history), 0), (Some(history), 1)];
    for listed in correctable() {
        let make = listed.make;
        for (correction, later) in cases {
            let bars = Bars::paper(20).delayed(0.6, 1e-3);
            let mut run = Simulation::builder(bars.system::<f64>(), make(), 1e-3)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .correctors(correction.map(|c| Box::new(c) as Box<dyn Corrector<f64>>))
                .build()
                .unwrap();
            while !run.state().contacts().closed()[0] {
                run.step().unwrap();
            }
            for _ in 0..later {
                run.step().unwrap();
            }
            assert!(run.state().contacts().closed()[0]);
            run.set_step_size(0.4e-3).unwrap();
            let [left, right] = bars.contact_dofs();
            let case = format!("{}, {correction:?}, {later} steps later", make().name());
            for k in 1..=run.history().len() {
                let (u, v, a) = run.history().past(k).unwrap();
                let jump = |x: &[f64]| x[right] - x[left];
                assert!((jump(u) + bars.gap).abs() < 1e-15, "{case}: {:e}", jump(u) + bars.gap);
                assert!(jump(v).abs() < 1e-14 && jump(a).abs() < 1e-11, "{case}: {:e} {:e}", jump(v), jump(a));
            }
        }
    }
}

/// Laws that hold a gap wherever a step has left it have no gap that a past could be projected to: there the past is
/// the motion in contact, prolonged backward, up to the shift that conserves momentum, which moves u or v but not both.
#[test]
fn a_past_made_anew_after_an_impact_has_no_kink() {
    let h = 1e-2;
    let mut made = 0;
    for listed in correctable() {
        // The past as the scheme reads it, and the one that is kept since the step has changed; right after the impact,
        // and a step later, when the mass rests.
        for (law, (earlier, later)) in [ContactLaw::RateCondition, ContactLaw::PersistencySwitch]
            .into_iter()
            .flat_map(|law| [(h, 0), (h, 1), (0.7 * h, 0), (0.7 * h, 1)].map(|case| (law, case)))
        {
            let system = LinearSystem::lumped(vec![2.0], matrix(1, [(0, 0, 0.0)])).unwrap().load(|_, f| f[0] = -3.0);
            let mut run = Simulation::builder(system, (listed.make)(), h)
                .velocity(vec![-1.0])
                .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.0813))
                .corrector(PersistencyCorrection::new())
                .build()
                .unwrap();
            for _ in 0..4 {
                run.step().unwrap();
            }
            run.set_step_size(earlier).unwrap();
            while !run.state().contacts().closed()[0] {
                run.step().unwrap();
            }
            for _ in 0..later {
                run.step().unwrap();
            }
            let changed = 0.4 * h;
            run.set_step_size(changed).unwrap();
            let [v, a] = [run.state().stored_velocity()[0], run.state().stored_acceleration()[0]];
            let u = run.state().displacement()[0];
            let mut miss = [0.0_f64; 2];
            for k in 1..=run.history().len() {
                let (past, age) = (run.history().past(k).unwrap(), k as f64 * changed);
                let expected = [u - age * v + 0.5 * age * age * a, v - age * a];
                miss[0] = miss[0].max((past.0[0] - expected[0]).abs() / changed);
                miss[1] = miss[1].max((past.1[0] - expected[1]).abs());
                made += 1;
            }
            assert!(miss[0].min(miss[1]) < 1e-10, "{}, {law:?}, {earlier}, {later}: {miss:?}", listed.name());
        }
    }
    assert!(made > 20, "{made}");
}

/// A past that is made anew lies on an obstacle that moves as it did then.
#[test]
fn a_past_made_anew_follows_its_obstacle() {
    let h = 1e-2;
    // (Steps between the impact and the change: fewer than the past that some schemes read.)
    for (listed, steps) in correctable().flat_map(|listed| (0..3).map(move |steps| (listed, steps))) {
        let wall = |t: f64| [0.05 + 0.5 * t * t, t, 1.0];
        let system = LinearSystem::lumped(vec![2.0], matrix(1, [(0, 0, 0.0)])).unwrap();
        let gap = GapOffset::moving(move |t| wall(t).map(|x| -x));
        let correction = match steps {
            0 => PersistencyCorrection::new(),
            _ => PersistencyCorrection::with_history_projection(),
        };
        let mut run = Simulation::builder(system, (listed.make)(), h)
            .start_time(1.0)
            .displacement(vec![wall(1.0)[0] + 0.0313])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], gap))
            .corrector(correction)
            .build()
            .unwrap();
        while !run.state().contacts().closed()[0] {
            run.step().unwrap();
        }
        (0..steps).for_each(|_| run.step().unwrap());
        let (changed, t) = (0.4 * h, run.time());
        run.set_step_size(changed).unwrap();
        for k in 1..=run.history().len() {
            let (u, v, a) = run.history().past(k).unwrap();
            let there = wall(t - k as f64 * changed);
            let miss = [u[0] - there[0], v[0] - there[1], a[0] - there[2]];
            assert!(miss.iter().all(|x| x.abs() < 1e-12), "{}, {k}, after {steps}: {miss:?}", listed.name());
        }
    }
}

/// Free flight is the same with any steps, and so is the momentum of a free body that vibrates.
#[test]
fn changes_of_the_step_conserve_momentum() {
    for scheme in all() {
        let bars = Bars { gap: 1e3, ..Bars::paper(10) };
        let velocity: Vec<f64> = (0..bars.dofs()).map(|i| 1.0 + (i as f64).sin()).collect();
        let mut run =
            Simulation::builder(bars.system::<f64>(), (scheme.make)(), 1e-3).velocity(velocity).build().unwrap();
        let direction = vec![1.0; bars.dofs()];
        let start = run.momentum(&direction).unwrap();
        for i in 0..60 {
            run.set_step_size(1e-3 * random(i)).unwrap();
            run.step().unwrap();
        }
        let end = run.momentum(&direction).unwrap();
        assert!((end / start - 1.0).abs() < 1e-11, "{}: {:e}", scheme.name(), end / start - 1.0);
        // A past that is made anew as well.
        for factor in [0.01, 1.0, 0.01, 0.3, 1.0] {
            run.set_step_size(1e-3 * factor).unwrap();
            (0..4).for_each(|_| run.step().unwrap());
        }
        let end = run.momentum(&direction).unwrap();
        assert!((end / start - 1.0).abs() < 1e-11, "{}: {:e}", scheme.name(), end / start - 1.0);
    }
}

/// The schemes that read a past.
fn multistep() -> impl Iterator<Item = Listed> {
    all().into_iter().filter(|listed| {
        let mut run = oscillator((listed.make)(), 1e-3);
        (0..8).for_each(|_| run.step().unwrap());
        !run.history().is_empty()
    })
}

/// Whatever the factor, and however fast the motion, a change of the step brings in no energy to speak of.
#[test]
fn far_changes_of_the_step_bring_in_no_energy() {
    let (mut schemes, mut failures) = (0, Vec::new());
    // (OALTS reads accelerations of the past: a known failure.)
    for listed in multistep().filter(|listed| !listed.name().starts_with("OALTS")) {
        let mut worst = (0.0_f64, 0.0, 0.0);
        for omega in [0.03, 0.3, 1.0, 3.0, 10.0, 100.0, 1e4] {
            for factor in [0.01, 0.05, 0.2, 0.3, 3.0, 3.5, 5.0, 20.0, 100.0] {
                for phase in 0..4 {
                    // ω at the start: the time is counted in steps.
                    let system = LinearSystem::lumped(vec![1.0], matrix(1, [(0, 0, omega * omega)])).unwrap();
                    let (sin, cos) = (0.4 + 0.7 * f64::from(phase)).sin_cos();
                    let mut run = Simulation::builder(system, (listed.make)(), 1.0)
                        .displacement(vec![cos])
                        .velocity(vec![omega * sin])
                        .build()
                        .unwrap();
                    let mut most = run.energy().total();
                    for _ in 0..8 + phase {
                        run.step().unwrap();
                        most = most.max(run.energy().total());
                    }
                    run.set_step_size(factor).unwrap();
                    for _ in 0..60 {
                        run.step().unwrap();
                        let gain = run.energy().total() / most;
                        if gain > worst.0 {
                            worst = (gain, omega, factor);
                        }
                    }
                }
            }
        }
        schemes += 1;
        if worst.0 >= 4.0 {
            failures.push((listed.name(), worst));
        }
    }
    assert!(schemes >= 4 && failures.is_empty(), "{schemes}: {failures:?}");
}

/// A past that is made anew once is of the order of the scheme. (Over and over it is not: `docs/reliability.md`.)
#[test]
fn a_far_change_of_the_step_keeps_the_order() {
    let mut failures = Vec::new();
    for listed in multistep() {
        let found = observed(listed.make, 1600, |i| if i < 100 { 0.1 } else { 1.0 });
        if found.iter().any(|order| (order - f64::from(listed.order)).abs() > 0.2) {
            failures.push((listed.name(), found));
        }
    }
    assert!(failures.is_empty(), "{failures:?}");
}

/// A host may sort its rows into other constraints before it goes on.
#[test]
fn a_resumed_run_names_its_own_contacts() {
    let free = || LinearSystem::lumped(vec![1.0; 3], matrix(3, (0..3).map(|i| (i, i, 0.0)))).unwrap();
    let row = |rows: LinearRows<'static, f64>, dof| rows.unilateral(&[(dof, 1.0)], 1.0);
    let together = (0..3).fold(LinearRows::new(), row);
    let mut run = Simulation::builder(free(), Composite, 0.01).constraint(together).build().unwrap();
    run.step().unwrap();
    for apart in [&[0..1, 1..3][..], &[0..1, 1..2, 2..3], &[0..1, 1..2]] {
        let mut builder = Simulation::builder(free(), Composite, 0.01);
        for dofs in apart {
            builder = builder.constraint(dofs.clone().fold(LinearRows::new(), row));
        }
        let mut resumed = builder.resume(run.state().clone(), run.history().clone()).build().unwrap();
        let own: Vec<_> =
            apart.iter().enumerate().flat_map(|(part, dofs)| (0..dofs.len()).map(move |row| (part, row))).collect();
        for _ in 0..4 {
            resumed.step().unwrap();
            let ids = resumed.state().contacts().ids().iter();
            assert_eq!(ids.map(|id| (id.constraint, id.feature)).collect::<Vec<_>>(), own);
        }
    }
}

#[test]
fn a_run_with_step_changes_is_resumed_bit_for_bit() {
    for listed in all() {
        let make = listed.make;
        let steps = |run: &mut Simulation<'_, f64>, from: u32, to: u32| {
            for i in from..to {
                run.set_step_size(0.01 * random(i / 3)).unwrap();
                run.step().unwrap();
            }
        };
        let mut whole = oscillator(make(), 0.01);
        steps(&mut whole, 0, 40);
        let mut first = oscillator(make(), 0.01);
        steps(&mut first, 0, 17);
        let (state, history) = (first.state().clone(), first.history().clone());
        let h = first.step_size();
        let mut second = oscillator_builder(make(), h).resume(state, history).build().unwrap();
        steps(&mut second, 17, 40);
        assert_eq!(whole.state(), second.state(), "{}", make().name());
    }
}

/// Begun anew where it has begun, once or twice, and while a multistep scheme makes its past: as if nothing had been
/// said, and as if it had been said once.
#[test]
fn a_run_that_is_begun_anew_twice_is_as_one_that_is_begun_once() {
    for listed in all() {
        let run = |restarts: [usize; 3]| {
            let mut run = oscillator((listed.make)(), 0.01);
            for times in restarts {
                for _ in 0..times {
                    run.restart().unwrap();
                }
                run.step().unwrap();
            }
            for _ in 0..6 {
                run.step().unwrap();
            }
            run.state().clone()
        };
        let name = listed.name();
        assert_eq!(run([0; 3]), run([2, 0, 0]), "{name}");
        assert_eq!(run([0, 1, 1]), run([1, 3, 2]), "{name}");
    }
}

/// A past is made from the motions that were computed, whatever sizes were set in between.
#[test]
fn a_step_size_without_a_step_leaves_no_trace() {
    for listed in all() {
        let run = |sizes: &[f64]| {
            let mut run = oscillator((listed.make)(), 0.01);
            run.run_until(0.2, &mut ()).unwrap();
            for &h in sizes {
                run.set_step_size(h).unwrap();
            }
            for _ in 0..5 {
                run.step().unwrap();
            }
            let state = run.state();
            [state.displacement()[0], state.velocity()[0], state.acceleration()[0]]
        };
        for (once, twice) in run(&[0.007]).into_iter().zip(run(&[0.009, 0.005, 0.007])) {
            assert!((once - twice).abs() < 1e-12, "{}: {once} {twice}", listed.name());
        }
    }
}

#[test]
fn absurd_steps_are_refused_and_leave_the_run_as_it_was() {
    let mut run = oscillator(Box::new(Composite), 0.01);
    run.run_until(0.1, &mut ()).unwrap();
    let before = (run.state().clone(), *run.statistics());
    for h in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(run.set_step_size(h), Err(Error::Parameter { .. })));
    }
    // It would not change the time.
    assert!(matches!(run.set_step_size(1e-20), Err(Error::TimeNotAdvancing { .. })));
    assert_eq!((run.state(), run.statistics(), run.step_size()), (&before.0, &before.1, 0.01));
    let mut other = oscillator(Box::new(Composite), 0.01);
    other.run_until(0.1, &mut ()).unwrap();
    run.step().unwrap();
    other.step().unwrap();
    assert_eq!(run.state(), other.state());
    // M/h² is not finite.
    let mut fresh = oscillator(Box::new(Composite), 0.01);
    assert!(matches!(fresh.set_step_size(1e-200), Err(Error::Parameter { .. })));
}

/// A spring so negative that a long step has no positive definite matrix: refused, and the short step goes on as
/// before.
#[test]
fn a_step_whose_matrix_cannot_be_factorized_leaves_the_factors_of_the_old_one() {
    let build = || {
        // Positive definite but for the last dof: the factorization fails when most of it is done.
        let entries = [(0, 0, 4.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 4.0), (1, 2, -1.0), (2, 1, -1.0), (2, 2, -4.0)];
        let system = LinearSystem::lumped(vec![1.0; 3], matrix(3, entries)).unwrap();
        Simulation::builder(system, Park, 0.01).displacement(vec![1.0, 0.0, 0.0]).build().unwrap()
    };
    for steps in [1, 5] {
        let (mut run, mut other) = (build(), build());
        for _ in 0..steps {
            run.step().unwrap();
            other.step().unwrap();
        }
        assert!(matches!(run.set_step_size(10.0), Err(Error::Singular { .. })));
        for _ in 0..5 {
            run.step().unwrap();
            other.step().unwrap();
        }
        assert_eq!(run.state(), other.state());
    }
}

/// Restarted in the middle of the contact, where nothing has jumped, the bars go on as before.
#[test]
fn restart_in_contact_disturbs_nothing() {
    for listed in correctable() {
        let make = listed.make;
        for start_up in [StartUp::Trapezoidal, StartUp::Taylor] {
            let bars = Bars::paper(50).delayed(0.35, 1e-3);
            let forces = |restart: Option<f64>| {
                let mut run = Simulation::builder(bars.system::<f64>(), make(), 1e-3)
                    .velocity(bars.velocities())
                    .constraint(bars.contact())
                    .corrector(PersistencyCorrection::with_history_projection())
                    .start_up(start_up)
                    .build()
                    .unwrap();
                let mut force = ContactRecorder::new();
                if let Some(t) = restart {
                    run.run_until(t, &mut force).unwrap();
                    let closed = run.state().contacts().closed().to_vec();
                    run.restart().unwrap();
                    assert_eq!(run.state().contacts().closed(), closed, "{}", make().name());
                }
                run.run_until(0.29, &mut force).unwrap();
                force.forces().to_vec()
            };
            for t in [0.15, 0.2, 0.25] {
                let worst = forces(None).iter().zip(forces(Some(t))).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
                assert!(worst < 0.05 * 0.0125, "{}, t = {t}: {:.3} F0", make().name(), worst / 0.0125);
            }
        }
    }
}

/// A force that is switched on: restarted behind the jump, every scheme follows the closed form from the first step.
#[test]
fn restart_after_a_jump_of_the_load_keeps_the_order() {
    let (omega, force) = (2.0_f64, 5.0_f64);
    let error = |scheme: Box<dyn TimeIntegrator>, steps: u32| {
        let k = matrix(1, [(0, 0, omega * omega)]);
        // The step that ends at the jump must not see it, the restart must.
        let is_trapezoidal = scheme.name() == Newmark::trapezoidal().name();
        let jumped = AtomicBool::new(false);
        let on = &jumped;
        let h = 1.0 / f64::from(steps);
        let system = LinearSystem::<f64>::lumped(vec![1.0], k)
            .unwrap()
            .load(move |_, f| f[0] = if on.load(Ordering::Relaxed) { force } else { 0.0 });
        let mut run = Simulation::builder(system, scheme, h).velocity(vec![1.0]).energy_balance().build().unwrap();
        run.run_until(1.0, &mut ()).unwrap();
        jumped.store(true, Ordering::Relaxed);
        run.restart().unwrap();
        assert!(
            (run.state().acceleration()[0] - (force - omega * omega * run.state().displacement()[0])).abs() < 1e-12
        );
        run.run_until(2.0, &mut ()).unwrap();
        if is_trapezoidal {
            // Conserves energy, and its works are exact for a constant load: the books know of the jump.
            let remainder = run.energy().works.unwrap().remainder;
            assert!(remainder.abs() < 1e-11, "{remainder:e}");
        }
        let (u0, v0) = ((omega * 1.0_f64).sin() / omega, (omega * 1.0_f64).cos());
        let rest = force / (omega * omega);
        let (sin, cos) = omega.sin_cos();
        let exact = [rest + (u0 - rest) * cos + v0 / omega * sin, v0 * cos - (u0 - rest) * omega * sin];
        (run.state().displacement()[0] - exact[0]).abs().max((run.state().velocity()[0] - exact[1]).abs())
    };
    for scheme in all() {
        let order = (error((scheme.make)(), 400) / error((scheme.make)(), 800)).log2();
        assert!((order - f64::from(scheme.order)).abs() < 0.1, "{}: {order}", scheme.name());
    }
}

/// A past is extrapolated to three times its age, and no farther: beyond that it is made anew, for which the scheme of
/// the first steps is factorized.
#[test]
fn steps_three_times_as_long_keep_the_past() {
    let factorizations = |ratio: f64| {
        let system = LinearSystem::<f64>::lumped(vec![1.0], matrix(1, [(0, 0, 1.0)])).unwrap();
        let mut run = Simulation::builder(system, Bdf2, 0.5).displacement(vec![1.0]).build().unwrap();
        run.step().unwrap();
        let before = run.statistics().factorizations;
        run.set_step_size(0.5 * ratio).unwrap();
        run.statistics().factorizations - before
    };
    let [within, at, beyond] = [2.5, 3.0, 3.5].map(factorizations);
    assert!(within == at && at < beyond, "{within} {at} {beyond}");
}

/// A contact that has just closed stays so where the past is forgotten: the velocity that the scheme alone has the
/// momentum of would be partly that from before the impact.
#[test]
fn contacts_that_have_just_closed_keep_their_rates_without_the_past() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] = [|| Box::new(Bdf2), || Box::new(Houbolt), || Box::new(Park)];
    for make in schemes {
        let k = matrix(2, springs(2, 5.0));
        let mut run = Simulation::builder(LinearSystem::<f64>::lumped(vec![1.0, 2.0], k).unwrap(), make(), 0.01)
            .velocity(vec![-1.0, -1.5])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.0625))
            .corrector(PersistencyCorrection::new())
            .build()
            .unwrap();
        while !run.state().contacts().closed()[0] {
            run.step().unwrap();
        }
        let before = run.state().velocity().to_vec();
        run.set_step_size(0.2).unwrap();
        let after = run.state().velocity();
        assert!(before[0].abs() < 1e-14 && after[0].abs() < 1e-14, "{}: {before:?} {after:?}", make().name());
        assert!((after[1] - before[1]).abs() < 0.1, "{}: {before:?} {after:?}", make().name());
    }
}
