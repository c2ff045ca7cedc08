//! Surfaces that meet themselves, beside the same bodies with two surfaces.

use contact_dynamics::contact::SurfaceSettings;
use contact_dynamics::{Composite, EnergyMomentum, Result as Run};
use contact_dynamics_scenes::folding::{FoldFigures, Folding};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use std::error::Error;
use std::fmt::Write;

/// Energy, depth and the work of Newton's method.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Bodies that fold, against themselves and with two surfaces, corrected: highest energy and that at the end \
         over that at the start, deepest node (length; bodies are 0.2 thick, the strip 0.12), most rows that press, \
         steps refused, most iterations of Newton's method a step, change of momentum, and the difference of the \
         displacements at the end between both, over the largest\n\n\
         | body | contact | highest | at the end | depth | press | refused | iterations | momentum | difference |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let long = |until: f64| if quick { 0.1 * until } else { until };
    let closing = Folding::hairpin(0.1, 1.0);
    rows(&mut table, "hairpin that closes, linear", |own| {
        let contact = if own { closing.of_itself() } else { closing.of_two_surfaces() };
        closing.run(
            closing.solid.system::<f64>(),
            contact?.with(SurfaceSettings::new().reach(0.09))?,
            Composite,
            (2e-3, long(0.3)),
        )
    })?;
    let snap = Folding::hairpin(0.2, 3.0);
    rows(&mut table, "hairpin that snaps shut", |own| large(&snap, own, (5e-3, long(1.0))))?;
    // The faster strip folds at other places than the two surfaces given in advance, its halves of one side.
    for &speed in if quick { &[1.5][..] } else { &[1.5, 2.0] } {
        let strip = Folding::strip([90, 3], [speed, 0.5]);
        let name = format!("strip that buckles, thrown at {speed}");
        rows(&mut table, &name, |own| large(&strip, own, (1e-2, long(8.0))))?;
    }
    let sheet = Folding::sheet(if quick { 2 } else { 4 }, 0.2, 3.0);
    rows(&mut table, "sheet that snaps shut from one side", |own| large(&sheet, own, (5e-3, long(1.0))))?;
    Ok(table)
}

/// At large strains.
fn large<const D: usize>(folding: &Folding<D>, own: bool, times: (f64, f64)) -> Run<FoldFigures> {
    let contact = if own { folding.of_itself() } else { folding.of_two_surfaces() };
    folding.run(Hyperelastic::new(&folding.solid, Law::NeoHookean), contact?, EnergyMomentum, times)
}

/// A line for the surface against itself, and one for two surfaces.
fn rows(table: &mut String, name: &str, run: impl Fn(bool) -> Run<FoldFigures>) -> Result<(), Box<dyn Error>> {
    let mut own = None;
    for (contact, of_itself) in [("itself", true), ("two surfaces", false)] {
        write!(table, "| {name} | {contact} |")?;
        let figures = match run(of_itself) {
            Ok(figures) => figures,
            Err(error) => {
                eprintln!("{name}, {contact}: {error}");
                writeln!(table, " fails | | | | | | | |")?;
                continue;
            }
        };
        let FoldFigures { highest, last, depth, pressed, refused, iterations, momentum, .. } = figures;
        let highest = (highest - 1.0).max(0.0);
        write!(table, " 1 + {highest:.0e} | {last:.4} | {depth:.0e} | {pressed} | {refused} | {iterations} |")?;
        write!(table, " {momentum:.0e} |")?;
        match own.take() {
            None => {
                writeln!(table, " |")?;
                own = Some(figures.displacement);
            }
            Some(own) => writeln!(table, " {:.0e} |", difference(&own, &figures.displacement))?,
        }
    }
    Ok(())
}

/// Largest difference over the largest of both.
fn difference(one: &[f64], other: &[f64]) -> f64 {
    let largest = one.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    one.iter().zip(other).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs())) / largest
}
