//! The reduced bars of `reduced`, propagated exactly instead of by a scheme, from parents of any fineness.

use crate::reduced::{Bounced, SPEED, Struck, errors, paper_bar, share_of_misses, summary, wall_exact};
use crate::reference::BouncingBar;
use crate::wall_bar::WallBar;
use contact_dynamics::reduction::{Boundary, ModalPropagation, ReducedBody, Reduction};
use contact_dynamics::{LinearRows, Result};

/// A bar reduced to so many modes, with its weight.
fn reduced(bar: &WallBar, modes: usize, boundary: Boundary) -> Result<ReducedBody<f64>> {
    let (mass, stiffness) = (bar.consistent_mass(), bar.stiffness());
    let weight: Vec<f64> = bar.mass().iter().map(|m| -bar.gravity * m).collect();
    Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0]).boundary(boundary).constant_load(&weight).modes(modes)
}

/// Kinetic and elastic energy.
fn energy(run: &ModalPropagation<'_, f64>) -> f64 {
    run.kinetic_energy() + run.elastic_energy()
}

/// The paper's bar against a wall, as [`wall_impact`](crate::reduced::wall_impact).
pub fn wall(elements: usize, modes: usize, boundary: Boundary, h: f64, phases: &[f64]) -> Result<Struck> {
    let bar = paper_bar(elements);
    let body = reduced(&bar, modes, boundary)?;
    let velocity = body.velocity(&vec![-SPEED; elements + 1])?;
    let mut all = Vec::new();
    for &phase in phases {
        let gap = bar.height + phase * h * SPEED;
        let mut run = ModalPropagation::builder(&[&body], h)
            .velocity(velocity.clone())
            .constraint(LinearRows::new().unilateral(&[(modes, 1.0)], gap))
            .build()?;
        let (before, mut forces) = (energy(&run), Vec::new());
        while run.time() < 0.4 - 0.5 * h {
            run.step()?;
            forces.push((run.time(), run.forces()[0]));
        }
        all.push((errors(&forces, &wall_exact(h, phase), h), (energy(&run) / before - 1.0).abs()));
    }
    Ok(summary(&all))
}

/// The bouncing bar, as [`bounces`](crate::reduced::bounces).
pub fn bounces(elements: usize, modes: usize, boundary: Boundary, steps: f64) -> Result<Bounced> {
    let bar = WallBar::bouncing(elements);
    let exact = BouncingBar::doyen();
    let h = 2.0 * bar.length / bar.wave_speed() / steps;
    let body = reduced(&bar, modes, boundary)?;
    let load = body.constant_load().unwrap_or(&[]).to_vec();
    let floor = LinearRows::new().unilateral(&[(modes, 1.0)], bar.height);
    let mut run = ModalPropagation::builder(&[&body], h).constraint(floor).build()?;
    let total = |run: &ModalPropagation<'_, f64>| {
        let work: f64 = load.iter().zip(run.displacement()).map(|(f, u)| f * u).sum();
        energy(run) - work + bar.weight() * bar.height
    };
    let (start, mut forces) = (total(&run), Vec::new());
    while run.time() < 6.0 * exact.period() - 0.5 * h {
        run.step()?;
        forces.push((run.time(), run.forces()[0]));
    }
    Ok(Bounced { error: share_of_misses(&forces, &exact, h), energy: total(&run) / start })
}
