//! Two bars that collide: H1 to H7, H11, H16 to H18, H22.

use crate::Extent;
use crate::table::Bound::AtMost;
use crate::table::{Row, each, rows};
use crate::tried::{ahead, clean, corrected, massless, presets, with};
use contact_dynamics::contact_solver::{ActiveSet, ContactSolver, Pivoting};
use contact_dynamics::{CentralDifference, LinearRows, LinearSystem, Result, Simulation, TimeIntegrator};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::combinations::{Combination, Correction, plain};
use contact_dynamics_scenes::masses::Takers;
use contact_dynamics_scenes::measure::{Record, figures, record_run, try_record_run};
use contact_dynamics_scenes::reference::Side;
use contact_dynamics_scenes::sparse::block;
use example_support::collisions::{Collision, Swept};

/// ρ c A v₀ of the paper's bars, and v₀.
const FORCE: f64 = 0.0125;
const SPEED: f64 = 0.05;
const WAVE_SPEED: f64 = 100.0;
const H: f64 = 1e-3;

pub(crate) fn cases(extent: &Extent) -> Vec<Row> {
    let mut all = Vec::new();
    all.extend(paper(extent));
    all.extend(phases(extent));
    all.extend(magic_step(extent));
    all.extend(dissimilar(extent));
    all.extend(unequal(extent));
    all.extend(boost());
    all.extend(small_steps(extent));
    all.extend(units());
    all.extend(ratios(extent));
    all.extend(redundant(extent));
    all.extend(changing_step(extent));
    all.extend(damped(extent));
    all
}

/// Figures by name, of a measurement.
fn named<const N: usize>(swept: &[Swept], names: [&str; N]) -> [f64; N] {
    names.map(|name| swept.iter().find(|swept| swept.name == name).map_or(f64::NAN, |swept| swept.worst))
}

/// Whether all stages take the forces of springs from what is known.
fn is_explicit(scheme: &dyn TimeIntegrator) -> bool {
    scheme.tableau().stages.iter().all(|stage| stage.balance.u.z == 0.0)
}

/// The force over F₀ outside of the exact contact, by more than a hundredth of a second (of its fifth).
fn outside(bars: &Bars, record: &Record) -> f64 {
    let (start, end) = (bars.impact_time() - 1e-9, bars.impact_time() + 0.21);
    let outside = record.t.iter().zip(&record.force).filter(|(t, _)| **t < start || **t > end);
    outside.fold(0.0, |most, (_, force)| most.max(force.abs() / FORCE))
}

fn paper(extent: &Extent) -> Vec<Row> {
    let mut all = Vec::new();
    let meshes = [("H1, n = 20", 20, 1.15), ("H1, n = 50", 50, 1.15), ("H1, n = 100", 100, 1.2)];
    for (case, n, max) in meshes.into_iter().take(extent.meshes) {
        let bars = Bars::paper(n);
        // The error is that of the fronts, each of which is smeared over a part of an element and over steps.
        let smeared = 0.6 * bars.element_size(0) / WAVE_SPEED + 1.6 * H;
        let rms = (smeared / (2.0 * 10.0 / WAVE_SPEED)).sqrt();
        let run = |row: &Combination| {
            let of = |&phase: &f64| {
                let scene = Collision::paper(n, H).prepared(row, phase)?;
                let (record, _) = scene.record(row)?;
                let found = figures(&scene.bars, &record, scene.h);
                // A scheme that takes forces at another time than states reports them there.
                Ok([found.force_rms, found.force_max, outside(&scene.bars, &record), found.drift])
            };
            extent.phases.iter().map(of).collect()
        };
        let asked = [
            ("paper's bars, force: RMS error over F₀", AtMost(rms)),
            ("largest force over F₀", AtMost(max)),
            ("force outside of contact over F₀", AtMost(0.0)),
            ("change of momentum over that of a bar", AtMost(1e-10)),
        ];
        all.extend(rows(case, asked, &each(&clean(), run)));
    }
    all
}

/// Largest over smallest error over the phases of the impact in a step.
fn phases(extent: &Extent) -> Vec<Row> {
    let meshes: &[usize] = if extent.quick { &[20] } else { &[20, 50] };
    let run = |row: &Combination| {
        let mut ratios = Vec::new();
        for &n in meshes {
            for &h in &extent.steps {
                let errors: Vec<f64> = extent
                    .phases
                    .iter()
                    .map(|&phase| {
                        let scene = Collision::paper(n, h).prepared(row, phase)?;
                        Ok(figures(&scene.bars, &scene.record(row)?.0, scene.h).force_rms)
                    })
                    .collect::<Result<_>>()?;
                let (least, most) = errors.iter().fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
                ratios.push([most / least]);
            }
        }
        Ok(ratios)
    };
    // (Explicit schemes take the forces of springs from the state before.)
    let (explicit, implicit): (Vec<_>, Vec<_>) =
        corrected().into_iter().partition(|row| row.integrator().is_ok_and(|scheme| is_explicit(&*scheme)));
    let asked = [("RMS error of the force, worst phase over best", AtMost(1.3))];
    let mut all = rows("H2", asked, &each(&implicit, run));
    let asked = [("the same, explicit schemes", AtMost(1.35))];
    all.extend(rows("H2", asked, &each(&explicit, run)));
    all
}

/// Courant number 1 on a lumped mass: d'Alembert's solution at the nodes.
fn magic_step(extent: &Extent) -> Vec<Row> {
    let run = |row: &Combination| {
        let of = |&phase: &f64| {
            let n = 50;
            let h = 0.1 / n as f64;
            let scene = Collision::paper(n, h);
            let scene = Collision { bars: scene.bars.delayed(phase, h), ..scene };
            let (record, _) = scene.record(row)?;
            let pressed: Vec<f64> = record.force.iter().filter(|force| **force != 0.0).map(|f| f / FORCE).collect();
            let mut expected = vec![1.0; 2 * n + 1];
            (expected[0], expected[1], expected[2 * n]) = (0.5 * (1.0 - phase), 1.0 - 0.5 * phase, phase);
            let miss = pressed.iter().zip(&expected).fold(0.0_f64, |most, (p, e)| most.max((p - e).abs()));
            let force = if pressed.len() == expected.len() { miss } else { f64::INFINITY };
            let exact = scene.bars.exact(0.5);
            let before = record.t.iter().zip(&record.u).filter(|(t, _)| **t < 0.3);
            let place = before.fold(0.0_f64, |most, (t, u)| {
                most.max((u[0] - exact.displacement(Side::Left, scene.bars.length[0], *t)).abs())
            });
            Ok([force, place / (SPEED * 0.1)])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked = [
        ("Courant number 1, force of every step − exact, over F₀", AtMost(1e-10)),
        ("place of the contact node − d'Alembert's, over v₀ L/c", AtMost(1e-10)),
    ];
    rows("H3", asked, &each(&[plain(|| Ok(Box::new(CentralDifference)))], run))
}

fn dissimilar(extent: &Extent) -> Vec<Row> {
    let (n, h) = (100, 5e-4);
    let run = |row: &Combination| {
        let of = |&phase: &f64| {
            let scene = Collision::dissimilar(n, h);
            let found = scene.measure_plateaus(row, &[phase])?;
            let names = ["plateau_1", "plateau_2", "release", "speed_1", "speed_2"];
            let [first, second, release, left, right] = named(&found, names);
            let allowed = 2.0 * scene.bars.element_size(0) / 70.0 + h;
            let speed = (left - 0.011_418_685).abs().max((right - 0.088_581_315).abs()) / 0.1;
            Ok([first.abs().max(second.abs()), release.abs() / allowed, speed])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked = [
        ("bars of E 49 and 100: error of the two plateaus of the force", AtMost(0.03)),
        ("release, late by what over 2 h_e/c + h", AtMost(1.3)),
        ("error of the mean speeds over the approach", AtMost(0.01)),
    ];
    rows("H4", asked, &each(&[clean(), ahead()].concat(), run))
}

fn unequal(extent: &Extent) -> Vec<Row> {
    let run = |row: &Combination| -> Result<Vec<[f64; 4]>> {
        let of = |&phase: &f64| {
            let found = Collision::unequal(50, H).measure_touching(row, &[phase])?;
            let [changes, restitution, impulse, force] =
                named(&found, ["changes", "restitution", "impulse", "touching_force"]);
            Ok([changes, (restitution - 0.5).abs(), impulse.abs(), force])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked = [
        ("bars of lengths 10 and 20: error of the restitution L₁/L₂", AtMost(0.02)),
        ("impulse, error over the momentum of the first bar", AtMost(0.02)),
        ("force while they touch without force, over F₀", AtMost(0.01)),
    ];
    let touching = |row: &Combination| Ok(run(row)?.into_iter().map(|[_, rest @ ..]| rest).collect());
    let mut all = rows("H5", asked, &each(&[clean(), massless(Takers::Uniform)].concat(), touching));
    // (Ends without mass open and close under the small forces of the line above, see corrections.md.)
    let changing = |row: &Combination| Ok(run(row)?.into_iter().map(|[changes, ..]| [changes]).collect());
    all.extend(rows("H5", [("changes of contact meanwhile", AtMost(2.0))], &each(&corrected(), changing)));
    all
}

/// All that does not depend on rounding.
fn steady() -> Vec<Combination> {
    [corrected(), with(Correction::Splitting), with(Correction::Release), presets(), ahead()].concat()
}

fn record(row: &Combination, bars: Bars, h: f64) -> Result<Record> {
    let scene = Collision { bars, h, until: 4.0 * h * (0.1 / H) };
    Ok(scene.record(row)?.0)
}

/// Largest difference of forces over F₀ and of velocities over v₀, the second run having its own units and velocity.
fn difference(one: &Record, other: &Record, force: f64, speed: f64, boost: f64) -> f64 {
    if one.t.len() != other.t.len() {
        return f64::INFINITY;
    }
    (0..one.t.len()).fold(0.0, |most, i| {
        let forces = (one.force[i] / FORCE - other.force[i] / (force * FORCE)).abs();
        let velocities = (one.v[i][0] / SPEED - (other.v[i][0] - boost) / (speed * SPEED)).abs();
        most.max(forces).max(velocities)
    })
}

fn boost() -> Vec<Row> {
    let run = |row: &Combination| {
        let mut found = Vec::new();
        for phase in [0.0, 0.35] {
            let scene = Collision::paper(50, H).prepared(row, phase)?;
            let reference = record(row, scene.bars, scene.h)?;
            for velocity in [[0.1, 0.0], [5.0, 4.9]] {
                let boosted = record(row, Bars { velocity, ..scene.bars }, scene.h)?;
                found.push([difference(&reference, &boosted, 1.0, 1.0, velocity[0] - SPEED)]);
            }
        }
        Ok(found)
    };
    let asked = [("a velocity that both bars have: change of forces over F₀, of velocities over v₀", AtMost(1e-9))];
    rows("H6", asked, &each(&steady(), run))
}

fn units() -> Vec<Row> {
    // mm, t, s; inch, lbf, s; and micrometers.
    let units = [(1e3, 1.0, 1e-3), (39.370_078_740_157_48, 1.0, 5.710_147_162_769_2e-3), (1e-6, 1e3, 1e9)];
    let run = |row: &Combination| {
        let mut found = Vec::new();
        for phase in [0.0, 0.35] {
            let scene = Collision::paper(20, H).prepared(row, phase)?;
            let reference = record(row, scene.bars, scene.h)?;
            for (length, time, mass) in units {
                let other = record(row, scene.bars.in_units(length, time, mass), scene.h * time)?;
                let (force, speed) = (mass * length / (time * time), length / time);
                found.push([difference(&reference, &other, force, speed, 0.0)]);
            }
        }
        Ok(found)
    };
    let asked = [("other units: change of forces over F₀, of velocities over v₀", AtMost(1e-9))];
    rows("H11", asked, &each(&steady(), run))
}

/// A fixed mesh, smaller and smaller steps.
fn small_steps(extent: &Extent) -> Vec<Row> {
    let steps: &[f64] = if extent.quick { &[1e-3, 1e-4] } else { &[1e-3, 1e-4, 1e-5, 1e-6] };
    let run = |row: &Combination| {
        let mut found = Vec::new();
        for &h in steps {
            let phases: &[f64] = if h < 1e-5 { &[0.35] } else { &[0.15, 0.75] };
            for &phase in phases {
                let scene = Collision { until: 0.33, ..Collision::paper(20, h) }.prepared(row, phase)?;
                let mut run = scene.simulation(row)?;
                let mut most = 0.0_f64;
                while run.time() < scene.until {
                    run.step()?;
                    most = most.max(run.state().contacts().forces()[0] / FORCE);
                }
                found.push([most]);
            }
        }
        Ok(found)
    };
    let asked = [("n = 20, h = 1 ms to 1 µs (quick: 0.1 ms): largest force over F₀", AtMost(1.2))];
    rows("H7", asked, &each(&clean(), run))
}

/// A bar against one of the same wave speed that is a million times heavier and stiffer, and against a wall.
fn ratios(extent: &Extent) -> Vec<Row> {
    let run = |row: &Combination| {
        let of = |&phase: &f64| {
            let heavy = Bars { young: [100.0, 1e8], density: [0.01, 1e4], velocity: [0.1, 0.0], ..Bars::paper(50) };
            let scene = Collision { bars: heavy.delayed(phase, H), h: H, until: 0.4 };
            let (record, _) = scene.record(row)?;
            let (bars, start) = (&scene.bars, scene.bars.impact_time());
            let (found, expected) =
                (record.mean_force(0.0, start + 0.05..start + 0.18), bars.exact(0.5).contact_force(0.2));
            let [left, _] = bars.contact_dofs();
            let k = block(&(0..left + 1), &[(1.0, &bars.stiffness())]);
            let system = LinearSystem::lumped(bars.lumped_mass()[..=left].to_vec(), k)?;
            let mut run = Simulation::builder(system, row.integrator()?, H)
                .velocity(vec![0.1; left + 1])
                .constraint(LinearRows::new().unilateral(&[(left, -1.0)], bars.gap))
                .correctors(row.correctors(0.0)?)
                .build()?;
            let mut apart = 0.0_f64;
            for force in &record.force {
                run.step()?;
                apart = apart.max((force - run.state().contacts().forces()[0]).abs() / expected);
            }
            Ok([(found / expected - 1.0).abs(), apart, record.closure()])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked = [
        ("impedances 1 to 10⁶: error of the mean force", AtMost(0.01)),
        ("the same, force − that at a rigid wall, over F₀", AtMost(1e-4)),
        ("the same, impulses − change of momentum, over it", AtMost(1e-9)),
    ];
    rows("H16", asked, &each(&corrected(), run))
}

/// The contact written down several times, one row turned into other units.
fn redundant(extent: &Extent) -> Vec<Row> {
    type Solver = fn() -> Box<dyn ContactSolver<f64>>;
    let solvers: [Solver; 2] = [|| Box::new(ActiveSet::default()), || Box::new(Pivoting::default())];
    let history = |row: &Combination, copies: usize, solver: Solver, phase: f64| -> Result<Vec<[f64; 2]>> {
        let bars = Bars::paper(20).delayed(phase, H);
        let [left, right] = bars.contact_dofs();
        let scale = |copy: usize| if copy == 2 { 3.0 } else { 1.0 };
        let contact = (0..copies).fold(LinearRows::new(), |rows, copy| {
            rows.unilateral(&[(left, -scale(copy)), (right, scale(copy))], scale(copy) * bars.gap)
        });
        let mut run = Simulation::builder(bars.system::<f64>(), row.integrator()?, H)
            .velocity(bars.velocities())
            .constraint(contact)
            .contact_solver(solver())
            .correctors(row.correctors(0.0)?)
            .build()?;
        let mut history = Vec::new();
        while run.time() < 0.35 {
            run.step()?;
            let forces = run.state().contacts().forces().iter().enumerate();
            let force: f64 = forces.map(|(copy, force)| scale(copy) * force).sum();
            history.push([force / FORCE, run.state().displacement()[left] / (SPEED * 0.1)]);
        }
        Ok(history)
    };
    let run = |row: &Combination| {
        let mut found = Vec::new();
        for &phase in &extent.phases {
            let single = history(row, 1, solvers[0], phase)?;
            for solver in solvers {
                for copies in [2, 4] {
                    let several = history(row, copies, solver, phase)?;
                    let worst = single.iter().flatten().zip(several.iter().flatten());
                    found.push([worst.fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()))]);
                }
            }
        }
        Ok(found)
    };
    let asked = [("one row written 2 and 4 times, in other units: force over F₀, place over v₀ L/c", AtMost(1e-9))];
    rows("H17", asked, &each(&[corrected(), ahead()].concat(), run))
}

/// The step shortened to 0.3 ms in contact, and lengthened again.
fn changing_step(extent: &Extent) -> Vec<Row> {
    let run = |row: &Combination| {
        let error = |phase: f64, changes: &[(f64, f64)]| -> Result<f64> {
            let scene = Collision { bars: Bars::paper(20).delayed(phase, H), h: H, until: 0.4 };
            let bars = &scene.bars;
            let mut run = scene.simulation(row)?;
            let mut all = try_record_run(bars, &mut run, changes[0].0)?;
            for (i, &(_, h)) in changes.iter().enumerate() {
                run.set_step_size(h)?;
                let next = record_run(bars, &mut run, changes.get(i + 1).map_or(0.4, |change| change.0));
                all.t.extend(next.t);
                all.force.extend(next.force);
            }
            let (start, end) = (bars.impact_time() + 1e-6 * H, bars.impact_time() + 0.2 - 1e-6 * H);
            let inside = (1..all.t.len()).filter(|&i| all.t[i] > start && all.t[i] < end);
            let (sum, time) = inside.fold((0.0, 0.0), |(sum, time), i| {
                let step = all.t[i] - all.t[i - 1];
                (sum + step * (all.force[i] / FORCE - 1.0).powi(2), time + step)
            });
            Ok((sum / time).sqrt())
        };
        let of = |&phase: &f64| {
            let plain = error(phase, &[(0.15, H)])?;
            let late = error(phase, &[(0.15, 0.3 * H), (0.2, H)])?;
            let early = error(phase, &[(0.1015, 0.3 * H), (0.104, H)])?;
            Ok([late.max(early) / plain])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked = [("h 1 → 0.3 → 1 ms in contact, and right after impact: RMS error over that without", AtMost(1.2))];
    rows("H18", asked, &each(&corrected(), run))
}

/// Two per cent of critical damping in the lowest mode, by the stiffness.
fn damped(extent: &Extent) -> Vec<Row> {
    let run = |row: &Combination| {
        let of = |&phase: &f64| {
            // Damping lowers the limit of explicit schemes.
            let h = if is_explicit(&*row.integrator()?) { 0.3 * H } else { H };
            let bars = Bars::paper(50).delayed(phase, h);
            // ω = π c/L.
            let beta = 2.0 * 0.02 / (10.0 * std::f64::consts::PI);
            let mut run = Simulation::builder(bars.system::<f64>().rayleigh(0.0, beta)?, row.integrator()?, h)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .correctors(row.correctors(H)?)
                .build()?;
            let record = try_record_run(&bars, &mut run, 0.4)?;
            let found = figures(&bars, &record, h);
            Ok([found.energy_max - 1.0, found.force_max, found.drift])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked = [
        ("damping, ξ = 0.02: highest energy over that of the start, − 1", AtMost(1e-9)),
        ("largest force over F₀", AtMost(1.15)),
        ("change of momentum over that of a bar", AtMost(1e-10)),
    ];
    rows("H22", asked, &each(&corrected(), run))
}
