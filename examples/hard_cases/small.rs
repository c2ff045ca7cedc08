//! Few degrees of freedom, and bodies that turn: H10 (stiff and soft springs), H12 (Hertz), H14 (Zeno's ball), H15
//! (Newton's cradle), H19 (a pendulum and a spinning bar).

use crate::Extent;
use crate::table::Bound::{AtLeast, AtMost};
use crate::table::{Row, each, rows};
use contact_dynamics::{ContactLaw, LinearRows, Result, Simulation};
use contact_dynamics_scenes::combinations::{Combination, listed};
use contact_dynamics_scenes::hyperelastic::Law;
use contact_dynamics_scenes::large::{Swing, Throw};
use contact_dynamics_scenes::reference::PowerLawImpact;
use contact_dynamics_scenes::schemes::{self, Listed};
use contact_dynamics_scenes::sparse::free;
use contact_dynamics_scenes::springs;

pub(crate) fn cases(extent: &Extent) -> Vec<Row> {
    let mut all = stiff_soft();
    all.extend(hertz(extent));
    all.extend(zeno(extent));
    all.extend(cradle());
    all.extend(large_motion(extent));
    all
}

/// The schemes of the list that are meant.
pub(crate) fn those(meant: impl Fn(&Listed) -> bool) -> Vec<Combination> {
    schemes::all().iter().filter(|scheme| meant(scheme)).map(listed).collect()
}

/// Errors of v and a of the first mass behind the stiff spring, after each step.
pub(crate) fn stiff_errors(row: &Combination) -> Result<Vec<[f64; 2]>> {
    let frequency = springs::FREQUENCY;
    let mut run = Simulation::builder(springs::stiff_soft(), row.integrator()?, 0.2618).build()?;
    let mut errors = Vec::new();
    for _ in 0..38 {
        run.step()?;
        let (sine, cosine) = (frequency * run.time()).sin_cos();
        let (v, a) = (run.state().velocity()[1], run.state().acceleration()[1]);
        errors.push([(v - frequency * cosine).abs(), (a + frequency * frequency * sine).abs()]);
    }
    Ok(errors)
}

fn stiff_soft() -> Vec<Row> {
    let run = |from_v: usize, from_a: usize| {
        move |row: &Combination| {
            let errors = stiff_errors(row)?;
            let worst = |from: usize, k: usize| errors[from - 1..].iter().fold(0.0_f64, |most, of| most.max(of[k]));
            Ok(vec![[worst(from_v, 0), worst(from_a, 1)]])
        }
    };
    let asked = |v: f64, a: f64| {
        [("stiff and soft springs: error of v₂ from step 2 on", AtMost(v)), ("error of a₂", AtMost(a))]
    };
    let composite = those(|scheme| scheme.name() == "composite");
    let bathe = those(|scheme| scheme.name() == "Bathe");
    let mut all = rows("H10", asked(0.05, 0.1), &each(&composite, run(2, 4)));
    all.extend(rows("H10", asked(0.01, 0.15), &each(&bathe, run(2, 2))));
    all
}

/// Duration and largest force of an impact on a power law, by crossings of the gap and a parabola through three forces.
fn power_law(row: &Combination, exact: &PowerLawImpact, h: f64, phase: f64) -> Result<[f64; 2]> {
    let gap = (3.0 + phase) * h * exact.velocity;
    let law = ContactLaw::PowerLaw { stiffness: exact.stiffness, exponent: exact.exponent };
    let mut run = Simulation::builder(free(&[exact.mass]), row.integrator()?, h)
        .velocity(vec![-exact.velocity])
        .constraint(LinearRows::new().row(law, &[(0, 1.0)], gap))
        .build()?;
    let (mut forces, mut gaps) = (vec![0.0], vec![gap]);
    while run.time() < 2.0 * exact.duration() {
        run.step()?;
        gaps.push(run.state().displacement()[0] + gap);
        forces.push(run.state().contacts().forces()[0]);
    }
    let top = (1..forces.len() - 1).max_by(|&i, &j| forces[i].total_cmp(&forces[j])).unwrap_or(1);
    let (left, middle, right) = (forces[top - 1], forces[top], forces[top + 1]);
    let peak = middle - (right - left).powi(2) / (8.0 * (left - 2.0 * middle + right));
    let cross = |k: usize| (k as f64 - gaps[k] / (gaps[k] - gaps[k - 1])) * h;
    let touch = (1..gaps.len()).find(|&k| gaps[k] < 0.0).map_or(f64::NAN, cross);
    let release = (2..gaps.len()).find(|&k| gaps[k] >= 0.0 && gaps[k - 1] < 0.0).map_or(f64::NAN, cross);
    Ok([((release - touch) / exact.duration() - 1.0).abs(), (peak / exact.force() - 1.0).abs()])
}

fn hertz(extent: &Extent) -> Vec<Row> {
    // Steel on a rigid wall (radius 10 mm, 1 m/s).
    let mass = 7800.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-6;
    let ContactLaw::PowerLaw { stiffness, exponent } = ContactLaw::hertz(210e9 / 0.91, 0.01) else { return Vec::new() };
    let exact = PowerLawImpact { mass, stiffness, exponent, velocity: 1.0 };
    let run = |row: &Combination| {
        let of = |&phase: &f64| power_law(row, &exact, exact.duration() / 200.0, phase);
        extent.phases.iter().map(of).collect()
    };
    let trapezoidal = those(|scheme| scheme.name() == "Newmark(0.25, 0.5)");
    let asked = [
        ("Hertz, one degree of freedom, 200 steps in contact: error of the duration", AtMost(1e-4)),
        ("error of the largest force", AtMost(1e-4)),
    ];
    let mut all = rows("H12", asked, &each(&trapezoidal, run));
    let order = |row: &Combination| {
        let error = |steps: f64| -> Result<f64> {
            let errors = extent.phases.iter().map(|&phase| power_law(row, &exact, exact.duration() / steps, phase));
            errors.into_iter().try_fold(0.0_f64, |most, error| Ok(most.max(error?[0])))
        };
        Ok(vec![[(error(50.0)? / error(400.0)?).log2() / 3.0]])
    };
    let second = those(|scheme| scheme.order == 2);
    all.extend(rows("H12", [("order of the duration", AtLeast(1.8))], &each(&second, order)));
    all
}

fn on_velocities() -> Vec<Combination> {
    those(|scheme| scheme.name() == "CD-Lagrange" || scheme.name().starts_with("Moreau–Jean"))
}

/// A ball with restitution 0.8 that falls from 1.
fn zeno(extent: &Extent) -> Vec<Row> {
    let (e, gravity) = (0.8_f64, 9.81);
    let fall = (2.0_f64 / gravity).sqrt();
    let rest = fall * (1.0 + e) / (1.0 - e);
    let h = if extent.quick { 1e-3 } else { 1e-4 };
    let run = |row: &Combination| {
        let of = |&phase: &f64| {
            let h = h * (1.0 + 0.01 * phase);
            let law = ContactLaw::Restitution { coefficient: e };
            let system = free(&[2.0]).load(move |_, f| f[0] = -2.0 * gravity);
            let mut run = Simulation::builder(system, row.integrator()?, h)
                .constraint(LinearRows::new().row(law, &[(0, 1.0)], 1.0))
                .build()?;
            let (mut bounces, mut late, mut falling, mut last) = (0, 0.0_f64, true, 0.0);
            while run.time() < 1.5 * rest {
                run.step()?;
                let v = run.state().velocity()[0];
                if falling && v > 1e-2 {
                    let exact = fall * (1.0 + 2.0 * (e - e.powi(bounces + 1)) / (1.0 - e));
                    if bounces < 12 {
                        late = late.max((run.time() - exact).abs());
                    }
                    (bounces, last) = (bounces + 1, run.time());
                }
                falling = v < -1e-2 || falling && v < 1e-2;
            }
            let (state, count) = (run.state(), run.statistics());
            let force = state.contacts().forces()[0] / (2.0 * gravity) - 1.0;
            let iterations = count.contact_iterations as f64 / count.steps as f64;
            Ok([late, (last - rest).abs(), state.velocity()[0].abs().max(force.abs()), iterations])
        };
        extent.phases.iter().map(of).collect()
    };
    // Sixteen bounces within a hundredth of a second take steps of 0.1 ms.
    let loose = if extent.quick { 10.0 } else { 1.0 };
    let asked = [
        ("Zeno's ball, e = 0.8: error of the times of 12 bounces, s", AtMost(0.01 * loose)),
        ("time of rest − t_∞, s", AtMost(0.05 * loose)),
        ("at rest: speed, and force over the weight − 1", AtMost(1e-9)),
        ("iterations a step", AtMost(2.0)),
    ];
    rows("H14", asked, &each(&on_velocities(), run))
}

/// Equal balls in a row, the first one flies at the others: energy, momentum and the last ball's velocity.
pub(crate) fn after_cradle(row: &Combination, n: usize, gap: f64) -> Result<Vec<f64>> {
    let law = ContactLaw::Restitution { coefficient: 1.0 };
    let contacts = (1..n).fold(LinearRows::new(), |rows, i| rows.row(law, &[(i - 1, -1.0), (i, 1.0)], gap));
    let mut v = vec![0.0; n];
    v[0] = 1.0;
    let mut run =
        Simulation::builder(free(&vec![1.0; n]), row.integrator()?, 1e-3).velocity(v).constraint(contacts).build()?;
    run.run_until(1.0, &mut ())?;
    Ok(run.state().velocity().to_vec())
}

fn cradle() -> Vec<Row> {
    let run = |row: &Combination| {
        let mut found = Vec::new();
        for n in [3, 5] {
            for gap in [1e-2, 0.0, 1e-6] {
                let v = after_cradle(row, n, gap)?;
                let momentum = (v.iter().sum::<f64>() - 1.0).abs();
                let energy = (v.iter().map(|v| v * v).sum::<f64>() - 1.0).abs();
                // Gaps of several steps: pair by pair. Touching: all at once, ġ′ = −ġ (three balls, −1/3, 2/3, 2/3).
                let law = match (n, gap > 1e-3, gap > 0.0) {
                    (_, true, _) => (v[n - 1] - 1.0).abs(),
                    (3, _, false) => {
                        v.iter().zip([-1.0, 2.0, 2.0]).fold(0.0_f64, |m, (v, e)| m.max((v - e / 3.0).abs()))
                    }
                    _ => 0.0,
                };
                found.push([momentum.max(energy), law]);
            }
        }
        Ok(found)
    };
    let asked = [
        ("Newton's cradle, 3 and 5 balls, gaps 0, 1e-6, 1e-2: errors of momentum and energy", AtMost(1e-12)),
        ("error of the law: in turn, or all at once (−1/3, 2/3, 2/3)", AtMost(1e-12)),
    ];
    // θ = ½ alone reflects velocities: restitution of Moreau and Jean's scheme does not depend on θ either.
    rows("H15", asked, &each(&on_velocities(), run))
}

fn large_motion(extent: &Extent) -> Vec<Row> {
    let conserving = those(|scheme| scheme.name() == "energy–momentum");
    let until = if extent.quick { 20.0 } else { 1000.0 };
    let swing = |row: &Combination| {
        let of = |&axial: &f64| {
            let swing = Swing::run(row.integrator()?, axial, 0.01, until)?;
            Ok([swing.energy, swing.angular, f64::from(u8::from(swing.failure.is_some()))])
        };
        [1e4, 1e7, 1e10].iter().map(of).collect()
    };
    let asked = [
        ("pendulum, EA 10⁴ to 10¹⁰, 10⁵ steps (quick: 2000): error of the energy", AtMost(1e-6)),
        ("error of the angular momentum", AtMost(1e-8)),
        ("runs that break off", AtMost(0.0)),
    ];
    let mut all = rows("H19", asked, &each(&conserving, swing));
    let bar = |row: &Combination| {
        let of = |&phase: &f64| {
            let throw = Throw {
                cells: 2,
                law: Law::StVenantKirchhoff,
                gravity: 0.0,
                height: 1.0 + 0.1 * phase,
                slide: 0.0,
                speed: 0.05,
                spin: 0.1,
                ..Throw::default()
            };
            let flight = throw.bar().fly(row.integrator()?, 60.0)?;
            Ok([flight.angular, flight.energy_most - 1.0, flight.momentum, flight.penetration])
        };
        extent.few().iter().map(of).collect()
    };
    let asked = [
        ("spinning bar that hits a wall: error of the angular momentum before", AtMost(1e-10)),
        ("highest energy over that of the start, − 1", AtMost(1e-10)),
        ("momentum − impulses, over that of the start", AtMost(1e-11)),
        ("penetration over the length, × 10", AtMost(1e-12)),
    ];
    all.extend(rows("H19", asked, &each(&conserving, bar)));
    all
}
