//! The moduli of two bars, and the gap between them, from the force of their collision.

use crate::descent::{Evaluation, Found, descend};
use contact_dynamics::gradient::{Balance, Parameters, RecordedStep, Seed};
use contact_dynamics::{GeneralizedAlpha, Result, Simulation, System};
use contact_dynamics_bars::Bars;
use example_plot::{Axis, BLUE, Curve, GRAY, Panel, VERMILION, pair};
use std::error::Error;
use std::path::Path;

/// What was measured: the contact force at every step.
struct Measured {
    forces: Vec<f64>,
    h: f64,
    /// The size of the force, by which J is scaled.
    scale: f64,
}

/// Two bars of different moduli, E₁ = 49 and E₂ = 100.
fn bars(elements: usize) -> Bars {
    Bars { velocity: [0.05, -0.05], ..Bars::dissimilar(elements) }
}

/// The bars with other moduli and another gap, as multiples of the true ones.
fn varied(bars: Bars, factors: &[f64]) -> Bars {
    let young = [bars.young[0] * factors[0], bars.young[1] * factors[1]];
    Bars { young, gap: bars.gap * factors[2], ..bars }
}

fn simulation(bars: &Bars, h: f64, is_corrected: bool) -> Result<Simulation<'static, f64>> {
    let builder = Simulation::builder(bars.system(), GeneralizedAlpha::default(), h);
    let builder = builder.velocity(bars.velocities()).constraint(bars.contact());
    if is_corrected { builder.build() } else { builder.correctors(Vec::new()).build() }
}

const END: f64 = 0.28;

/// The derivatives by the factors of both moduli.
struct Moduli {
    bars: Bars,
    derivatives: [f64; 2],
}

impl Parameters<f64> for Moduli {
    fn force(&mut self, _: &mut dyn System<f64>, at: &Balance<'_, f64>, w: &[f64]) -> Result<()> {
        let mut first = 0;
        for (bar, derivative) in self.derivatives.iter_mut().enumerate() {
            let stiffness = self.bars.young[bar] * self.bars.area / self.bars.element_size(bar);
            let u = at.displacement;
            for i in first..first + self.bars.elements[bar] {
                *derivative -= stiffness * (w[i + 1] - w[i]) * (u[i + 1] - u[i]);
            }
            first += self.bars.elements[bar] + 1;
        }
        Ok(())
    }
}

/// J = ½ Σ (F − F_measured)² h/(F₀² T), and its derivatives by the factors.
fn misfit(bars: Bars, measured: &Measured, factors: &[f64], is_corrected: bool) -> Result<Evaluation> {
    let varied = varied(bars, factors);
    let mut run = simulation(&varied, measured.h, is_corrected)?;
    run.record()?;
    run.run_until(END, &mut ())?;
    let weight = measured.h / END;
    let mut objective = |step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>| {
        let force = step.state.contacts().forces()[0];
        let miss = (force - measured.forces[step.step]) / measured.scale;
        seed.force[0] += weight * miss / measured.scale;
        0.5 * weight * miss * miss
    };
    let mut moduli = Moduli { bars: varied, derivatives: [0.0; 2] };
    let gradient = run.gradient(&mut objective, &mut moduli)?;
    let gap: f64 = gradient.gaps.iter().map(|&(_, by)| by).sum();
    // By the factors: moduli have the factor in them.
    let [first, second] = moduli.derivatives;
    Ok((gradient.value, vec![first / factors[0], second / factors[1], bars.gap * gap]))
}

fn measure(bars: &Bars, h: f64, noise: f64) -> Result<Measured> {
    let mut run = simulation(bars, h, true)?;
    let mut forces = vec![run.state().contacts().forces()[0]];
    while run.time() < END - 0.5 * h {
        run.step()?;
        forces.push(run.state().contacts().forces()[0]);
    }
    let scale = forces.iter().copied().fold(0.0, f64::max);
    // A sequence of low discrepancy is noise enough.
    for (step, force) in forces.iter_mut().enumerate() {
        *force += noise * scale * (2.0 * (step as f64 * 0.618_033_988_749_895).fract() - 1.0);
    }
    Ok(Measured { forces, h, scale })
}

/// Finds the parameters from the forces without and with noise, with the corrected run and with the uncorrected one.
pub(crate) fn identify(elements: usize, output: &Path) -> std::result::Result<(), Box<dyn Error>> {
    let bars = bars(elements);
    let h = 0.2 * bars.element_size(1) / (bars.young[1] / bars.density[1]).sqrt();
    println!(
        "Two bars of {elements} elements collide. Moduli and gap are found from the contact force at {:.0} steps;",
        END / h
    );
    println!("relative errors of what is found, from +20 %, −15 % and +10 %:\n");
    println!("{:<28} {:>9} {:>9} {:>9} {:>9} {:>10} {:>5}", "", "E₁", "E₂", "gap", "J", "iterations", "runs");
    let mut found = Vec::new();
    for (name, noise, is_corrected) in
        [("corrected", 0.0, true), ("corrected, 2 % noise", 0.02, true), ("without correction", 0.0, false)]
    {
        let measured = measure(&bars, h, noise)?;
        let evaluate = |factors: &[f64]| Ok(misfit(bars, &measured, factors, is_corrected)?);
        match descend(&START, 60, evaluate) {
            Ok(Found { parameters, value, iterations, runs }) => {
                let [first, second, gap] = [0, 1, 2].map(|k| format!("{:.0e}", (parameters[k] - 1.0).abs()));
                println!("{name:<28} {first:>9} {second:>9} {gap:>9} {value:>9.0e} {iterations:>10} {runs:>5}");
                found.push(parameters);
            }
            Err(error) => println!("{name:<28} {error}"),
        }
    }
    let noisy = measure(&bars, h, 0.02)?;
    std::fs::write(output.join("bars.svg"), figure(bars, &noisy, found.get(1))?)?;
    println!("\nFigure: {}\n", output.join("bars.svg").display());
    Ok(())
}

/// The factors at the beginning.
const START: [f64; 3] = [1.2, 0.85, 1.1];

/// The forces measured and found, and J along the gap with and without correction.
fn figure(bars: Bars, measured: &Measured, found: Option<&Vec<f64>>) -> std::result::Result<String, Box<dyn Error>> {
    let time = |step: usize| step as f64 * measured.h;
    let forces = |factors: &[f64]| -> Result<Vec<(f64, f64)>> {
        let forces = measure(&varied(bars, factors), measured.h, 0.0)?.forces;
        Ok(forces.iter().enumerate().map(|(step, force)| (time(step), force / measured.scale)).collect())
    };
    let curve = |label: &str, color, width, points| Curve { label: Some(label.into()), color, width, points };
    let points = measured.forces.iter().enumerate().map(|(step, force)| (time(step), force / measured.scale)).collect();
    let mut curves = vec![curve("measured, 2 % noise", GRAY, 6, points)];
    curves.push(curve("at the start", VERMILION, 8, forces(&START)?));
    if let Some(found) = found {
        curves.push(curve("found", BLUE, 8, forces(found)?));
    }
    let along_gap = |is_corrected: bool| -> Result<Vec<(f64, f64)>> {
        let gaps = (0..=240).map(|k| 0.88 + 0.001 * f64::from(k));
        gaps.map(|gap| Ok((gap, misfit(bars, measured, &[1.0, 1.0, gap], is_corrected)?.0))).collect()
    };
    let misfits = vec![
        curve("without correction", VERMILION, 6, along_gap(false)?),
        curve("with correction", BLUE, 10, along_gap(true)?),
    ];
    let panels = [
        Panel {
            title: "(a) Contact force".into(),
            x: Axis::linear("time (s)", 0.05..END, &[0.05, 0.1, 0.15, 0.2, 0.25]),
            y: Axis::linear("force / largest force", -0.1..1.3, &[0.0, 0.25, 0.5, 0.75, 1.0, 1.25]),
            curves,
            note: None,
        },
        Panel {
            title: "(b) Misfit J over the gap".into(),
            x: Axis::linear("gap / true gap", 0.88..1.12, &[0.9, 0.95, 1.0, 1.05, 1.1]),
            y: Axis::linear("J", 0.0..0.12, &[0.0, 0.03, 0.06, 0.09, 0.12]),
            curves: misfits,
            note: None,
        },
    ];
    pair("Parameters from the force of an impact", "Two colliding bars, Chung–Hulbert scheme, ρ∞ = 0.8", &panels)
}
