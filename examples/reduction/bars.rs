//! Bars against a wall, bars that collide, a bar that bounces.

use contact_dynamics::reduction::Boundary;
use contact_dynamics::{Bathe, Newmark, Result, TimeIntegrator};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::reduced::{Model, Struck, TAPER, bounces, collision, wall_exact, wall_impact};
use example_support::output::decimal;
use std::fmt::Write;

pub(crate) type Make = fn() -> Box<dyn TimeIntegrator>;
pub(crate) type Table = std::result::Result<String, Box<dyn std::error::Error>>;

pub(crate) const TAPERED: Model = Model::Reduced(Boundary::Tapered);
const UNTAPERED: Model = Model::Reduced(Boundary::Untapered);

/// Steps, and as many of them in a contact of the paper's bars.
const STEPS: [(f64, f64); 2] = [(1e-3, 200.0), (2.5e-4, 800.0)];

pub(crate) fn trapezoidal() -> Box<dyn TimeIntegrator> {
    Box::new(Newmark::trapezoidal())
}

/// ρ∞-Bathe without dissipation.
pub(crate) fn bathe() -> Box<dyn TimeIntegrator> {
    Box::new(Bathe::with_radius(1.0).expect("a radius in [0, 1]"))
}

const SCHEMES: [(&str, Make); 2] = [("trapezoidal", trapezoidal), ("ρ∞-Bathe(1)", bathe)];

pub(crate) fn phases(quick: bool) -> Vec<f64> {
    let count = if quick { 2 } else { 10 };
    (0..count).map(|k| (f64::from(k) + 0.5) / f64::from(count)).collect()
}

/// Error and, in parentheses, overshoot in percent.
fn cell(struck: Struck) -> String {
    format!("{} ({} %)", decimal(struck.error, 4), decimal(100.0 * struck.overshoot, 1))
}

/// The paper's bar against a wall; energy of the bar that bounces.
pub(crate) fn wall(quick: bool) -> Table {
    let phases = phases(quick);
    let counts: &[usize] = if quick { &[20] } else { &[20, 50, 100] };
    let mut table = String::from(
        "Paper's bar against a wall: mean error of the force, mean over the phases (worst overshoot); energy of the \
         bouncing bar after six periods, with as many steps a contact. r modes and the contact dof, meshes of as many \
         dofs.\n\n\
         | r | scheme | model | h = 1 ms | h = 0.25 ms | energy, 200 steps | energy, 800 steps |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for &count in counts {
        for (name, scheme) in SCHEMES {
            for model in Model::ALL {
                let mut cells = Vec::new();
                for (h, _) in STEPS {
                    cells.push(cell(wall_impact(count + 1, model, scheme, h, (&phases, TAPER))?));
                }
                for (_, steps) in STEPS {
                    cells.push(decimal(bounces(count + 1, model, scheme, steps)?.energy, 4));
                }
                writeln!(table, "| {count} | {name} | {} | {} |", model.name(), cells.join(" | "))?;
            }
        }
    }
    Ok(table)
}

/// Other tapers.
pub(crate) fn exponents(quick: bool) -> Table {
    let phases = phases(quick);
    let mut table = String::from(
        "Exponent p of the taper σ² = 1 − (ω/ω_c)^p and softening, ρ∞-Bathe(1), h = 0.25 ms: mean error (worst \
         overshoot)\n\n\
         | p | softening | r = 20 | r = 50 | r = 100 |\n| --- | --- | --- | --- | --- |\n",
    );
    let exponents = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0].map(|exponent| [exponent, 2.0]);
    let softenings = [0.0, 0.5, 1.0, 1.5, 2.5, 3.0].map(|softening| [3.0, softening]);
    for taper in exponents.into_iter().chain(softenings) {
        let cells: Result<Vec<String>> = [20, 50, 100]
            .iter()
            .map(|&count| Ok(cell(wall_impact(count + 1, TAPERED, bathe, 2.5e-4, (&phases, taper))?)))
            .collect();
        let [exponent, softening] = taper;
        writeln!(table, "| {exponent} | {softening} | {} |", cells?.join(" | "))?;
    }
    Ok(table)
}

/// The error against the number of modes that fit into a contact.
pub(crate) fn resolution(quick: bool) -> Table {
    let phases = phases(quick);
    let exact = wall_exact(1e-3, 0.0);
    let (start, end) = exact.contact_intervals()[0];
    let duration = end - start;
    let mut table = String::from(
        "Mean error times ω_c T, T the duration of contact; ω_c h in parentheses (ρ∞-Bathe(1))\n\n\
         | r | ω_c T | h = 2 ms | h = 1 ms | h = 0.5 ms | h = 0.25 ms |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    let counts: &[usize] = if quick { &[10, 20] } else { &[10, 20, 40, 80, 160] };
    for &count in counts {
        // ω_k = k π c/L of a free bar, and T = 2 L/c.
        let cutoff = std::f64::consts::TAU * count as f64 / duration;
        let mut cells = Vec::new();
        for h in [2e-3, 1e-3, 5e-4, 2.5e-4] {
            let error = wall_impact(count + 1, TAPERED, bathe, h, (&phases, TAPER))?.error;
            cells.push(format!("{} ({})", decimal(error * cutoff * duration, 2), decimal(cutoff * h, 2)));
        }
        writeln!(table, "| {count} | {} | {} |", decimal(cutoff * duration, 0), cells.join(" | "))?;
    }
    Ok(table)
}

/// Dissimilar bars, with models that differ too, and the bar that bounces.
pub(crate) fn pairs(quick: bool) -> Table {
    let phases = phases(quick);
    let counts: &[usize] = if quick { &[20] } else { &[20, 50, 100] };
    let mut table = String::from(
        "Dissimilar bars (E = 49 and 100, h = 0.5 ms): mean error of the force (worst overshoot), worst change of \
         energy; bouncing bar, 200 steps a contact: mean error of the force\n\n\
         | r | scheme | models | dissimilar bars | energy | bouncing bar |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    let bars = Bars::dissimilar(1);
    for &count in counts {
        for (name, scheme) in SCHEMES {
            for models in [[TAPERED; 2], [TAPERED, Model::Mesh], [Model::Mesh; 2], [UNTAPERED; 2]] {
                let struck = collision(&bars, (count + 1, models), scheme, 5e-4, &phases)?;
                let [first, second] = models.map(Model::name);
                let bouncing = match first == second {
                    true => decimal(bounces(count + 1, models[0], scheme, 200.0)?.error, 4),
                    false => "–".into(),
                };
                let energy = decimal(struck.energy, 5);
                writeln!(table, "| {count} | {name} | {first}, {second} | {} | {energy} | {bouncing} |", cell(struck))?;
            }
        }
    }
    Ok(table)
}
