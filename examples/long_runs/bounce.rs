//! A bar that bounces on a floor, up to ten million steps: energy, momentum, penetration.

use crate::follow::{Followed, number};
use crate::{COURANT, ELEMENTS, Line, Scene};
use contact_dynamics::{Result, Simulation};
use contact_dynamics_scenes::combinations::Combination;
use contact_dynamics_scenes::wall_bar::WallBar;
use example_support::output::decimal;

/// The bar, its masses as weights, its step, and a run.
fn bar(row: &Combination, elements: usize, courant: f64) -> Result<(WallBar, Vec<f64>, f64, Simulation<'static, f64>)> {
    let bar = WallBar::bouncing(elements);
    let transit = bar.element_size() / bar.wave_speed();
    let h = row.step(&bar.body(), courant * transit)?;
    let mass = row.mass(&bar.body(), h)?;
    let weights = mass.row_sums();
    let run = Simulation::builder(bar.system_with(mass), row.integrator()?, h)
        .constraint(bar.contact())
        .correctors(row.correctors(transit)?)
        .build()?;
    Ok((bar, weights, h, run))
}

pub(crate) fn scene(steps: u64) -> Scene {
    let energies = [1000, 100, 10, 1].map(|share| format!("energy after {} steps", number((steps / share) as f64)));
    let rest =
        ["highest energy", "momentum", "penetration/drop", "penetration/way", "changes of contact"].map(String::from);
    Scene {
        title: format!("A bar that bounces, {ELEMENTS} elements, {} steps", number(steps as f64)),
        head: energies.into_iter().chain(rest).chain(Followed::heads()).collect(),
        run: bouncing,
    }
}

fn bouncing(row: &Combination, steps: u64) -> Result<Line> {
    let (bar, weights, h, mut run) = bar(row, ELEMENTS, COURANT)?;
    let mass: f64 = weights.iter().sum();
    let start = mass * bar.gravity * bar.height;
    let all = vec![1.0; weights.len()];
    let mut before = Ok(0.0);
    let (mut energies, mut highest) = (Vec::new(), 0.0_f64);
    let (mut impulse, mut lost) = (0.0, 0.0);
    let (mut deepest, mut way, mut gap) = (0.0_f64, 0.0_f64, bar.height);
    let marks = [1000, 100, 10, 1].map(|share| steps / share);
    let followed = Followed::run(&mut run, steps, |step, run| {
        let contacts = run.state().contacts();
        // Compensated: a sum of ten million terms.
        let term = contacts.impulses()[0] - h * mass * bar.gravity - lost;
        let sum: f64 = impulse + term;
        lost = (sum - impulse) - term;
        impulse = sum;
        // In flight, when the past of every scheme is known.
        if step == 5 {
            (before, impulse, lost) = (run.momentum(&all), 0.0, 0.0);
        }
        let now = run.state().displacement()[0] + bar.height;
        deepest = deepest.max(-now);
        way = way.max(gap - now);
        gap = now;
        if step % 16 == 0 || marks.contains(&step) {
            let kinetic_and_elastic = run.energy().total();
            let energy = bar.total_energy_with(&weights, kinetic_and_elastic, run.state().displacement()) / start;
            highest = highest.max(energy);
            if marks.contains(&step) && energies.len() < marks.len() {
                energies.push(energy);
            }
        }
    })?;
    // Over that of the fall.
    let drift = (run.momentum(&all)? - before? - impulse) / (mass * (2.0 * bar.gravity * bar.height).sqrt());
    let numbers = [drift.abs(), deepest / bar.height, deepest / way];
    let cells = energies.iter().chain([&highest]).map(|energy| decimal(*energy, 4));
    let cells =
        cells.chain(numbers.map(number)).chain([followed.changes.to_string()]).chain(followed.cells()).collect();
    let mut wrong = followed.wrong();
    if numbers[0].is_nan() || numbers[0] > 1e-6 {
        wrong.push(format!("momentum drifts by {:e}", numbers[0]));
    }
    if numbers[2].is_nan() || numbers[2] > 1.1 {
        wrong.push(format!("penetration is {} of the way of a step", numbers[2]));
    }
    Ok(Line { cells, wrong })
}

/// Penetration by steps taken and by their size, of schemes that impose contact on velocities.
pub(crate) fn penetration() -> Scene {
    let of = |courant: f64| ["first tenth", "all"].map(|when| format!("{courant}: {when}"));
    let head = [0.8, 0.4, 0.2, 0.1].map(of).concat();
    Scene {
        title: "Penetration over the drop, contact on velocities, by Courant number, in a tenth of the steps".into(),
        head: head.into_iter().chain(["order".into(), "penetration/way".into()]).collect(),
        run: penetrating,
    }
}

fn penetrating(row: &Combination, steps: u64) -> Result<Line> {
    let velocities = ["CD-Lagrange", "Moreau–Jean(0.5)"];
    if row.preset.is_some() || !velocities.contains(&&*row.integrator()?.name()) {
        return Ok(Line::default());
    }
    let (mut cells, mut all, mut worst) = (Vec::new(), Vec::new(), 0.0_f64);
    for courant in [0.8, 0.4, 0.2, 0.1] {
        let (bar, _, _, mut run) = bar(row, ELEMENTS, courant)?;
        let steps = steps / 10;
        let (mut deepest, mut way, mut gap, mut early) = (0.0_f64, 0.0_f64, bar.height, 0.0);
        for step in 0..steps {
            run.step()?;
            let now = run.state().displacement()[0] + bar.height;
            deepest = deepest.max(-now);
            way = way.max(gap - now);
            gap = now;
            if step == steps / 10 {
                early = deepest;
            }
        }
        cells.extend([early, deepest].map(|deep| number(deep / bar.height)));
        all.push(deepest);
        worst = worst.max(deepest / way);
    }
    cells.push(decimal((all[0] / all[3]).log2() / 3.0, 2));
    cells.push(decimal(worst, 3));
    Ok(Line { cells, wrong: Vec::new() })
}

/// Elements and Courant numbers by which the energy that impacts give or take is measured.
const SIZES: [(usize, f64); 5] = [(8, 0.5), (16, 0.5), (32, 0.5), (8, 0.25), (16, 0.25)];

/// What an impact gives or takes of the energy, of the presets.
pub(crate) fn gains() -> Scene {
    let of = |(elements, courant): (usize, f64)| {
        [format!("n = {elements}, Courant {courant}: mean %"), "its error".into(), "RMS %".into(), "impacts".into()]
    };
    Scene {
        title: "Change of the energy by an impact, without mass on the contact node".into(),
        head: SIZES.map(of).concat(),
        run: gaining,
    }
}

fn gaining(row: &Combination, steps: u64) -> Result<Line> {
    if row.preset.is_none() {
        return Ok(Line::default());
    }
    let mut cells = Vec::new();
    for (elements, courant) in SIZES {
        let (bar, weights, _, mut run) = bar(row, elements, courant)?;
        // The mean over a flight: the energy of explicit schemes trembles about what they conserve.
        let (mut sum, mut count, mut flights) = (0.0, 0.0, Vec::new());
        for _ in 0..steps / 5 {
            run.step()?;
            if run.state().contacts().closed()[0] {
                // (Shorter ones are of a contact that opens and closes.)
                if count > elements as f64 / courant {
                    flights.push(f64::ln(sum / count));
                }
                (sum, count) = (0.0, 0.0);
            } else {
                let kinetic_and_elastic = run.energy().total();
                sum += bar.total_energy_with(&weights, kinetic_and_elastic, run.state().displacement());
                count += 1.0;
            }
        }
        let changes: Vec<f64> = flights.windows(2).map(|pair| 100.0 * (pair[1] - pair[0])).collect();
        let number_of = changes.len() as f64;
        let mean = changes.iter().sum::<f64>() / number_of;
        let rms = (changes.iter().map(|x| x * x).sum::<f64>() / number_of).sqrt();
        let spread = (changes.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / number_of / number_of).sqrt();
        cells.extend([mean, spread, rms].map(|x| decimal(x, 4)));
        cells.push(changes.len().to_string());
    }
    Ok(Line { cells, wrong: Vec::new() })
}
