//! A bar above a floor: H8, H13.

use crate::Extent;
use crate::table::Bound::{AtLeast, AtMost};
use crate::table::{Row, each, rows};
use crate::tried::{ahead, clean, corrected, massless, presets};
use contact_dynamics::{Error, Preset, Result, Simulation};
use contact_dynamics_scenes::combinations::{Combination, Correction, listed};
use contact_dynamics_scenes::masses::{MassMatrix, Takers};
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::wall_bar::WallBar;
use example_support::collisions::bounces;

pub(crate) fn cases(extent: &Extent) -> Vec<Row> {
    [bouncing(extent), keeping(extent), resting(extent), settling()].into_iter().flatten().collect()
}

/// Steps by Courant numbers about ½ that differ by a tenth: bounces fall on all phases of the step.
fn courants(extent: &Extent) -> Vec<f64> {
    let count = if extent.quick { 2 } else { 5 };
    (0..count).map(|k| 0.5 - 0.02 * f64::from(k)).collect()
}

fn bouncing(extent: &Extent) -> Vec<Row> {
    let n = if extent.quick { 50 } else { 100 };
    let run = |row: &Combination| {
        let of = |&courant: &f64| {
            let found = bounces(row, n, courant)?;
            let worst = |name: &str| found.iter().find(|of| of.name == name).map_or(f64::NAN, |of| of.worst);
            let bar = WallBar::bouncing(n);
            let allowed = (2.0 + courant) * bar.element_size() / bar.wave_speed();
            let late = ["touch_1", "release_1"].map(|name| worst(name).abs() / allowed);
            Ok([worst("ramp"), late[0], late[1], (worst("changes") - 4.0).abs()])
        };
        courants(extent).iter().map(of).collect()
    };
    let asked = [
        ("bouncing bar (Doyen, Ern, Piperno): RMS error of the force between the fronts", AtMost(0.03)),
        ("first touch, late by what over 2 h_e/c + h", AtMost(1.0)),
        ("first release, late by what over that", AtMost(1.85)),
        ("changes of contact in a period, beside the four there are", AtMost(0.0)),
    ];
    rows("H8", asked, &each(&[clean(), ahead()].concat(), run))
}

/// Schemes without damping keep the energy where contact dofs have no mass.
fn keeping(extent: &Extent) -> Vec<Row> {
    let n = if extent.quick { 50 } else { 100 };
    let undamped = |row: &Combination| {
        row.integrator().is_ok_and(|scheme| {
            let listed = schemes::all().into_iter().find(|listed| listed.name() == scheme.name());
            listed.is_some_and(|listed| listed.radius == Some(1.0) || scheme.name() == "CD-Lagrange")
        })
    };
    let massless = massless(Takers::Tapered).into_iter().filter(undamped);
    let of_presets = presets().into_iter().filter(|row| row.preset != Some(Preset::smooth()));
    let run = |row: &Combination| {
        let of = |&courant: &f64| {
            let found = bounces(row, n, courant)?;
            let energy = found.iter().find(|of| of.name == "energy_6").map_or(f64::NAN, |of| of.worst);
            Ok([energy, energy])
        };
        courants(extent).iter().map(of).collect()
    };
    let asked = [
        ("energy after 12 impacts over that of the start, undamped schemes, massless contact dofs", AtLeast(0.99)),
        // (The energy of explicit schemes trembles about what they conserve, by Ω²/4 of the elastic one.)
        ("the same, from above", AtMost(1.02)),
    ];
    rows("H8", asked, &each(&massless.chain(of_presets).collect::<Vec<_>>(), run))
}

/// Every scheme that imposes contact by a multiplier, corrected where it takes corrections, and all massless ones.
fn standing() -> Vec<Combination> {
    let all = schemes::all().into_iter().filter(schemes::Listed::takes_multipliers);
    let correction = |scheme: &schemes::Listed| match scheme.takes_corrections() {
        true => Correction::History,
        false => Correction::None,
    };
    let all = all.map(|scheme| Combination { correction: correction(&scheme), ..listed(&scheme) });
    all.chain(presets()).chain(massless(Takers::Uniform)).collect()
}

fn standing_run(row: &Combination, bar: &WallBar, rests: bool) -> Result<(Simulation<'static, f64>, f64)> {
    let transit = bar.element_size() / bar.wave_speed();
    let h = row.step(&bar.body(), transit)?;
    let mass: MassMatrix = row.mass(&bar.body(), h)?;
    let weights = mass.row_sums();
    let weight = bar.gravity * weights.iter().sum::<f64>();
    let start = if rests { bar.rest_with(&weights) } else { vec![0.0; weights.len()] };
    let run = Simulation::builder(bar.system_with(mass), row.integrator()?, h)
        .displacement(start)
        .constraint(bar.contact())
        .correctors(row.correctors(transit)?)
        .build()?;
    Ok((run, weight))
}

fn resting(extent: &Extent) -> Vec<Row> {
    let steps = if extent.quick { 2000 } else { 100_000 };
    let run = |row: &Combination| {
        let bar = WallBar { height: 0.0, ..WallBar::bouncing(20) };
        let (mut run, weight) = standing_run(row, &bar, true)?;
        let start = run.state().displacement().to_vec();
        let mut worst = 0.0_f64;
        for _ in 0..steps {
            run.step()?;
            worst = worst.max((run.state().contacts().forces()[0] / weight - 1.0).abs());
        }
        let drift = run.state().displacement().iter().zip(&start).fold(0.0_f64, |most, (u, s)| most.max((u - s).abs()));
        let changes = run.statistics().contact_changes as f64;
        Ok(vec![[worst, drift / start[20].abs(), changes]])
    };
    let asked = [
        ("rest on a floor, 10⁵ steps (quick: 2000): error of the force over the weight", AtMost(1e-8)),
        ("drift over the static displacement", AtMost(1e-9)),
        ("changes of contact", AtMost(0.0)),
    ];
    rows("H13", asked, &each(&standing(), run))
}

fn settling() -> Vec<Row> {
    let run = |row: &Combination| {
        let mut found = Vec::new();
        for height in [0.0, 1e-9] {
            let mut bar = WallBar { height, ..WallBar::bouncing(20) };
            let omega = std::f64::consts::FRAC_PI_2 * bar.wave_speed() / bar.length;
            bar.damping = 2.0 * 0.05 / omega;
            let (mut run, weight) = standing_run(row, &bar, false)?;
            run.run_until(120.0, &mut ())?;
            let before = run.statistics().contact_changes;
            let mut worst = 0.0_f64;
            for _ in 0..1000 {
                run.step()?;
                worst = worst.max((run.state().contacts().forces()[0] / weight - 1.0).abs());
            }
            found.push([worst, (run.statistics().contact_changes - before) as f64]);
        }
        Ok(found)
    };
    let asked = [
        (
            "settled under damping, from the floor and from 1e-9 above it: error of the force over the weight",
            AtMost(1e-8),
        ),
        ("changes of contact afterwards", AtMost(0.0)),
    ];
    // (Explicit schemes are refused: damping lowers their limit below this step.)
    let run = |row: &Combination| match run(row) {
        Err(Error::BeyondStability { .. }) => Err(Error::Incompatible { part: row.scheme(), reason: "this step" }),
        other => other,
    };
    rows("H13", asked, &each(&corrected(), run))
}
