//! What must fail, and how: raw multipliers, masses that stop at once, laws and schemes that are not meant for each
//! other.

use crate::Extent;
use crate::small::{after_cradle, stiff_errors, those};
use crate::table::Bound::{About, AtLeast};
use crate::table::{Row, each, rows};
use crate::tried::{paper, trapezoidal};
use contact_dynamics::{CdLagrange, ContactLaw, GeneralizedAlpha, Gssss, MoreauJean, Newmark, Result};
use contact_dynamics_scenes::combinations::{Combination, Correction, plain};
use contact_dynamics_scenes::large::Swing;
use contact_dynamics_scenes::masses::Treatment;
use contact_dynamics_scenes::measure::{Record, figures};
use example_support::collisions::{Collision, bounces};

const FORCE: f64 = 0.0125;
const SPEED: f64 = 0.05;
/// Wave speed and length of the paper's bars.
const WAVE: f64 = 100.0;
const LENGTH: f64 = 10.0;

pub(crate) fn cases(extent: &Extent) -> Vec<Row> {
    let mut all = spikes(extent);
    all.extend(energy(extent));
    all.extend(penetration(extent));
    all.extend(histories(extent));
    all.extend(laws(extent));
    all.extend(corrections(extent));
    all.extend(smooth_motion());
    all
}

/// Two bars of n elements at every phase, by a combination.
fn swept<const N: usize>(
    extent: &Extent,
    n: usize,
    h: f64,
    row: &Combination,
    figure: impl Fn(&Record, &Collision, f64) -> [f64; N],
) -> Result<Vec<[f64; N]>> {
    let of = |&phase: &f64| {
        let scene = Collision { bars: Collision::paper(n, h).bars.delayed(phase, h), h, until: 0.33 };
        let (record, _) = scene.record(row)?;
        Ok(figure(&record, &scene, phase))
    };
    extent.phases.iter().map(of).collect()
}

fn largest(record: &Record) -> f64 {
    record.force.iter().fold(0.0_f64, |most, force| most.max(*force)) / FORCE
}

/// First forces: m_c [[v]]/h times what the scheme makes of it.
fn spikes(extent: &Extent) -> Vec<Row> {
    let n = 20;
    let courant = |h: f64| WAVE * h * n as f64 / LENGTH;
    let mut all = Vec::new();
    // The trapezoidal rule closes the gap of a share 1 − φ of the step by h²/4 m⁻¹ p: p = 2 (1 − φ) F₀/Co.
    let first = |h: f64| {
        move |record: &Record, _: &Collision, phase: f64| {
            let raw = record.raw.iter().find(|raw| **raw > 0.0).map_or(f64::NAN, |raw| raw / FORCE);
            [raw * courant(h) / (2.0 * (1.0 - phase))]
        }
    };
    let raw = |row: &Combination| {
        let mut all = swept(extent, n, 1e-4, row, first(1e-4))?;
        all.extend(swept(extent, n, 1e-5, row, first(1e-5))?);
        Ok(all)
    };
    let what = "trapezoidal rule, raw, Co = 0.02 and 0.002: first force over 2 (1 − φ) F₀/Co";
    all.extend(rows("spike", [(what, About(1.0, 0.02))], &each(&[trapezoidal(Correction::None)], raw)));
    let raw = |row: &Combination| {
        let found = swept(extent, n, 1e-3, row, |record, scene, _| {
            let found = figures(&scene.bars, record, scene.h);
            [found.force_max, found.energy]
        })?;
        Ok(found)
    };
    let asked = [
        ("trapezoidal rule, raw, n = 20, h = 1 ms: largest force over F₀", AtLeast(10.0)),
        ("energy afterwards over that before", AtLeast(4.0)),
    ];
    all.extend(rows("spike", asked, &each(&[trapezoidal(Correction::None)], raw)));
    // Conditions on velocities, and the splitting, stop the contact node in one step: m v₀/h = F₀/(2 Co).
    let on_velocities: [Combination; 4] = [
        plain(|| Ok(Box::new(CdLagrange))),
        plain(|| Ok(Box::new(MoreauJean::new(0.5)?))),
        trapezoidal(Correction::Splitting),
        Combination {
            correction: Correction::Splitting,
            ..plain(|| Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.8)?)))
        },
    ];
    let stopped = |row: &Combination| {
        let mut all = Vec::new();
        for h in [1e-4, 2e-5] {
            all.extend(swept(extent, n, h, row, |record, _, _| [largest(record) * 2.0 * courant(h)])?);
        }
        Ok(all)
    };
    let what = "contact on velocities and splitting, Co = 0.02 and 0.004: largest force over F₀/(2 Co)";
    all.extend(rows("spike", [(what, About(1.0, 0.03))], &each(&on_velocities, stopped)));
    all
}

/// The energy of the contact nodes is lost.
fn energy(extent: &Extent) -> Vec<Row> {
    let mut all = Vec::new();
    for (mass, share, name) in [(Treatment::Lumped, 0.5, "lumped"), (Treatment::Consistent, 0.288_675, "consistent")] {
        let row = Combination { mass, ..trapezoidal(Correction::History) };
        let meshes: &[usize] = if extent.quick { &[20] } else { &[20, 50, 100] };
        let lost = |row: &Combination| {
            let mut all = Vec::new();
            for &n in meshes {
                all.extend(swept(extent, n, 1e-4, row, |record, scene, _| {
                    [(1.0 - figures(&scene.bars, record, scene.h).energy) * n as f64 / share]
                })?);
            }
            Ok(all)
        };
        let what = format!("trapezoidal rule, λ_v/λ_a, {name} mass: energy lost over {share:.4}/n");
        all.extend(rows("energy", [(what.as_str(), About(1.0, 0.05))], &each(&[row], lost)));
    }
    // A scheme that damps loses the bounces whatever the correction.
    let n = if extent.quick { 50 } else { 100 };
    let bounced = |row: &Combination| {
        let found = bounces(row, n, 0.5)?;
        Ok(vec![[found.iter().find(|of| of.name == "energy_6").map_or(f64::NAN, |of| of.worst)]])
    };
    if !extent.quick {
        let what = "composite scheme, λ_v/λ_a, bouncing bar: energy left after 12 impacts";
        all.extend(rows("energy", [(what, About(0.587, 0.05))], &each(&[paper(Correction::History)], bounced)));
    }
    all
}

/// Contact on velocities leaves what the bodies have made of the step before it acts.
fn penetration(extent: &Extent) -> Vec<Row> {
    let deepest = |record: &Record, scene: &Collision| {
        record.gap.iter().fold(0.0_f64, |deepest, gap| deepest.max(-gap)) / (scene.h * 2.0 * SPEED)
    };
    // The gap is seen to be closed at the end of the step of the impact, and stays: 1 − φ of a step's approach.
    let cd_lagrange = plain(|| Ok(Box::new(CdLagrange)));
    let run = |row: &Combination| {
        swept(extent, 50, 1e-3, row, |record, scene, phase| [deepest(record, scene) / (1.0 - phase)])
    };
    let what = "CD-Lagrange: penetration over (1 − φ) h [[v]]";
    let mut all = rows("penetration", [(what, About(1.0, 1e-6))], &each(&[cd_lagrange], run));
    // Half a step ahead: ½ − φ of it, and 3/2 − φ for impacts in the second half of a step.
    let moreau = plain(|| Ok(Box::new(MoreauJean::new(0.5)?)));
    let run = |row: &Combination| {
        let exact = |phase: f64| if phase < 0.5 { 0.5 - phase } else { 1.5 - phase };
        swept(extent, 50, 1e-3, row, |record, scene, phase| [deepest(record, scene) / exact(phase)])
    };
    let what = "Moreau–Jean: penetration over ((½ − φ) mod 1) h [[v]]";
    all.extend(rows("penetration", [(what, About(1.0, 1e-6))], &each(&[moreau], run)));
    all
}

/// The correction without the past.
fn histories(extent: &Extent) -> Vec<Row> {
    let ratio = |row: &Combination| {
        let errors =
            swept(extent, 20, 1e-3, row, |record, scene, _| [figures(&scene.bars, record, scene.h).force_rms])?;
        let errors = errors.into_iter().flatten();
        let (least, most) = errors.fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
        Ok(vec![[most / least]])
    };
    if extent.quick {
        return Vec::new();
    }
    let what = "composite scheme, λ_v/λ_a without the past: RMS error, worst phase over best (paper: 1.7)";
    rows("past", [(what, About(1.7, 0.1))], &each(&[paper(Correction::Persistency)], ratio))
}

/// The rate condition conserves with the midpoint rule alone, and Laursen's and Love's jump has wrong forces.
fn laws(extent: &Extent) -> Vec<Row> {
    let law = ContactLaw::RateCondition;
    let midpoint = Combination { law, ..plain(|| Ok(Box::new(Gssss::new(1.0, 1.0, 1.0)?))) };
    let others = [
        Combination { law, ..plain(|| Ok(Box::new(Gssss::new(1.0, 1.0, 0.0)?))) },
        Combination { law, ..plain(|| Ok(Box::new(Newmark::trapezoidal()))) },
    ];
    let figure = |row: &Combination| {
        swept(extent, 20, 1e-3, row, |record, scene, _| {
            let found = figures(&scene.bars, record, scene.h);
            [found.energy, found.force_rms]
        })
    };
    let exact = [
        ("rate condition, midpoint rule: energy afterwards over that before", About(1.0, 1e-10)),
        ("its force: RMS error over F₀", AtLeast(0.4)),
    ];
    let mut all = rows("rate", exact, &each(&[midpoint], figure));
    let gain = |row: &Combination| Ok(figure(row)?.into_iter().map(|[energy, _]| [energy]).collect());
    let what = [("rate condition, balance at the end of the step: energy afterwards over that before", AtLeast(1.5))];
    all.extend(rows("rate", what, &each(&others, gain)));
    let laursen_love =
        Combination { correction: Correction::LaursenLove, ..plain(|| Ok(Box::new(Gssss::new(1.0, 1.0, 1.0)?))) };
    let exact = [
        ("Laursen–Love: energy afterwards over that before", About(1.0, 1e-10)),
        ("its force: RMS error over F₀", AtLeast(0.4)),
    ];
    all.extend(rows("rate", exact, &each(&[laursen_love], figure)));
    // Three touching balls: the law of simultaneous impacts, not that of pairs.
    let cradle = |row: &Combination| Ok(vec![[after_cradle(row, 3, 0.0)?[0]]]);
    let on_velocities = those(|scheme| ["CD-Lagrange", "Moreau–Jean(0.5)"].contains(&&*scheme.name()));
    let what = [("three touching balls, e = 1: velocity of the first one (pairs: 0)", About(-1.0 / 3.0, 1e-12))];
    all.extend(rows("law", what, &each(&on_velocities, cradle)));
    all
}

/// Corrections with a known price.
fn corrections(extent: &Extent) -> Vec<Row> {
    let (n, h) = if extent.quick { (50, 1e-3) } else { (100, 5e-4) };
    let zero = trapezoidal(Correction::ZeroAcceleration);
    let parted = |row: &Combination| {
        let of = |&phase: &f64| {
            let found = Collision::dissimilar(n, h).measure_plateaus(row, &[phase])?;
            let of = |name: &str| found.iter().find(|of| of.name == name).map_or(f64::NAN, |of| of.worst);
            Ok([(of("speed_1") - 0.011_418_685).abs().max((of("speed_2") - 0.088_581_315).abs()) / 0.1])
        };
        extent.phases.iter().map(of).collect()
    };
    let what = [("a = 0, bars of E 49 and 100: error of the mean speeds over the approach", AtLeast(0.005))];
    let mut all = rows("a = 0", what, &each(&[zero], parted));
    let stabilized = |row: &Combination| {
        swept(extent, 50, 1e-3, row, |record, _, _| {
            // Well inside contact.
            let inside = record.t.iter().zip(&record.v).filter(|(t, _)| (0.13..0.27).contains(*t));
            let worst = inside.fold(0.0_f64, |most, (_, v)| most.max(v[0].abs()));
            [worst / SPEED]
        })
    };
    let what =
        [("contact-stabilized, trapezoidal rule: velocity of the contact node in contact over v₀", AtLeast(0.5))];
    all.extend(rows("stabilized", what, &each(&[trapezoidal(Correction::Stabilized)], stabilized)));
    all
}

/// Without contact: what an undamped scheme makes of stiff modes and of large rotations.
fn smooth_motion() -> Vec<Row> {
    let stiff = |row: &Combination| {
        let late = |k: usize, errors: &[[f64; 2]]| errors[5..].iter().fold(0.0_f64, |most, of| most.max(of[k]));
        let errors = stiff_errors(row)?;
        Ok(vec![[late(0, &errors), late(1, &errors)]])
    };
    let asked = [
        ("trapezoidal rule on stiff and soft springs: error of v₂ from step 6 on", About(1.22, 0.03)),
        ("error of a₂", AtLeast(500.0)),
    ];
    let mut all = rows("stiff", asked, &each(&[trapezoidal(Correction::None)], stiff));
    let breaks = |row: &Combination| {
        let swing = Swing::run(row.integrator()?, 1e10, 0.01, 10.0)?;
        Ok(vec![[swing.failure.map_or(0.0, |(t, _)| 10.0 - t)]])
    };
    let what = [("trapezoidal rule, pendulum of EA = 10¹⁰: time before 10 s at which it breaks off, s", AtLeast(5.0))];
    all.extend(rows("pendulum", what, &each(&[trapezoidal(Correction::None)], breaks)));
    all
}
