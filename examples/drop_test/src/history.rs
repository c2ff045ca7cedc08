//! What is recorded of every step, and what is drawn and written of it.

use crate::Result;
use contact_dynamics::Energy;
use plotters::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::Path;

/// A step, in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    pub time: f64,
    /// Contact force on the part as a vector.
    pub force: [f64; 3],
    /// Contacts that press.
    pub contacts: u64,
    pub kinetic: f64,
    pub elastic: f64,
    /// Of the weights, against the start of the run.
    pub weight: f64,
    /// Lost by friction since the start of the run.
    pub friction: f64,
}

impl Record {
    /// Of a state with energies and works that are those since `before`.
    pub fn new(time: f64, force: [f64; 3], contacts: usize, energy: &Energy<f64>, weight: f64, before: f64) -> Self {
        let friction = before - energy.works.map_or(0.0, |works| works.friction);
        let elastic = energy.potential.unwrap_or(0.0);
        Self { time, force, contacts: contacts as u64, kinetic: energy.kinetic, elastic, weight, friction }
    }

    /// Size of the contact force.
    pub fn size(&self) -> f64 {
        self.force.iter().map(|f| f * f).sum::<f64>().sqrt()
    }

    /// Energy of the motion.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.weight
    }
}

/// The steps of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct History(pub Vec<Record>);

impl History {
    /// Writes history.csv, force.svg and energy.svg.
    pub fn write(&self, directory: &Path) -> Result<()> {
        let mut table = String::from(
            "time_s,force_x_N,force_y_N,force_z_N,contacts,kinetic_J,elastic_J,weight_J,friction_loss_J\n",
        );
        for r in &self.0 {
            let [x, y, z] = r.force;
            let Record { time, contacts, kinetic, elastic, weight, friction, .. } = r;
            writeln!(table, "{time:e},{x:e},{y:e},{z:e},{contacts},{kinetic:e},{elastic:e},{weight:e},{friction:e}")?;
        }
        std::fs::write(directory.join("history.csv"), table)?;
        let force = [("contact force", BLUE, self.curve(Record::size))];
        draw(&directory.join("force.svg"), "force / N", &force)?;
        let energies = [
            ("kinetic", BLUE, self.curve(|r| r.kinetic)),
            ("elastic", VERMILION, self.curve(|r| r.elastic)),
            ("weight", GREEN, self.curve(|r| r.weight)),
            ("total", BLACK, self.curve(Record::total)),
            ("lost by friction", GRAY, self.curve(|r| r.friction)),
        ];
        draw(&directory.join("energy.svg"), "energy / J", &energies)
    }

    fn curve(&self, value: impl Fn(&Record) -> f64) -> Vec<(f64, f64)> {
        self.0.iter().map(|r| (1e3 * r.time, value(r))).collect()
    }
}

const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xb2);
const VERMILION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
const GRAY: RGBColor = RGBColor(0x80, 0x80, 0x80);
const BLACK: RGBColor = RGBColor(0x22, 0x22, 0x22);

/// A curve with its name and color.
type Curve<'a> = (&'a str, RGBColor, Vec<(f64, f64)>);

/// Curves over the time in milliseconds.
fn draw(path: &Path, label: &str, curves: &[Curve<'_>]) -> Result<()> {
    let points = || curves.iter().flat_map(|curve| &curve.2);
    let range = |value: fn(&(f64, f64)) -> f64| {
        let low = points().map(value).fold(f64::INFINITY, f64::min);
        let high = points().map(value).fold(f64::NEG_INFINITY, f64::max);
        low..if high > low { high } else { low + 1.0 }
    };
    let (x, y) = (range(|p| p.0), range(|p| p.1));
    let margin = 0.05 * (y.end - y.start);
    let page = SVGBackend::new(path, (720, 400)).into_drawing_area();
    page.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&page)
        .margin(16)
        .x_label_area_size(40)
        .y_label_area_size(72)
        .build_cartesian_2d(x, y.start - margin..y.end + margin)?;
    let number = |value: &f64| format!("{value:.3e}").replace("e0", "");
    chart
        .configure_mesh()
        .x_desc("time / ms")
        .y_desc(label)
        .y_label_formatter(&number)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for &(name, color, ref curve) in curves {
        chart
            .draw_series(LineSeries::new(curve.iter().copied(), color.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.85)).border_style(TRANSPARENT).draw()?;
    page.present()?;
    Ok(())
}
