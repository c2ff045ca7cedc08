//! The figure: the floors at the highest level where the frames meet, and the forces there, around the hardest impacts.

use crate::models::{self, Model};
use crate::tables::Study;
use example_support::plot::{Axis, BLUE, Curve, DARK, GREEN, Panel, RGBColor, VERMILION, page};
use std::error::Error;
use std::ops::Range;

/// Step of the runs shown.
const STEP: f64 = 2e-3;

pub(crate) fn figure(study: &Study) -> Result<String, Box<dyn Error>> {
    let models = models::all(&study.frames);
    let find = |name: &str, scheme: models::Scheme| {
        models.iter().find(|model| model.name == name && model.scheme == scheme).copied().ok_or("no such model")
    };
    let rigid = find("rigid", models::Scheme::TrapezoidalCorrected)?;
    let raw = find("rigid, raw", models::Scheme::Trapezoidal)?;
    let damped = find("Kelvin–Voigt, e = 0.65", models::Scheme::Trapezoidal)?;
    let [left, right] = study.frames.pairs().last().copied().ok_or("no floors that meet")?;
    let [whole, near] = [0.0..study.until.min(12.0), 2.0..4.0];
    let gap = study.frames.gap;
    let motion = |model: &Model| -> Result<Vec<Curve>, Box<dyn Error>> {
        let record = model.run(&study.frames, &study.ground, STEP, study.until)?;
        let of = |label: &str, color, dof: usize, shift: f64| Curve {
            label: Some(label.into()),
            color,
            width: 6,
            points: record.displacements().step_by(5).map(|(t, u)| (t, 1e3 * (u[dof] + shift))).collect(),
        };
        Ok(vec![of("left, third floor", VERMILION, left, 0.0), of("right, third floor", BLUE, right, gap)])
    };
    let force = |model: &Model, label: &str, color: RGBColor, width: u32| -> Result<Curve, Box<dyn Error>> {
        let record = model.run(&study.frames, &study.ground, STEP, study.until)?;
        let top = study.frames.pairs().len() - 1;
        let points = record.forces().map(|(t, forces)| (t, 1e-6 * forces[top])).collect();
        Ok(Curve { label: Some(label.into()), color, width, points })
    };
    let moving = |title: &str, model: &Model| -> Result<Panel, Box<dyn Error>> {
        let curves = motion(model)?;
        let y = Axis::linear("mm", -80.0..80.0, &[-80.0, -40.0, 0.0, 40.0, 80.0]);
        Ok(Panel { title: title.into(), x: time(whole.clone()), y, curves, note: None })
    };
    let forces = vec![
        force(&raw, "raw", VERMILION, 4)?,
        force(&damped, "Kelvin–Voigt", GREEN, 6)?,
        force(&rigid, "rigid, λ_v/λ_a", BLUE, 8)?,
    ];
    let acceleration = Curve {
        label: None,
        color: DARK,
        width: 4,
        points: (0..2400).map(|k| 5e-3 * f64::from(k)).map(|t| (t, study.ground.at(t))).collect(),
    };
    let panels = [
        Panel {
            title: "(a) Acceleration of the ground".into(),
            x: time(whole.clone()),
            y: Axis::linear("m/s²", -4.0..4.0, &[-4.0, -2.0, 0.0, 2.0, 4.0]),
            curves: vec![acceleration],
            note: None,
        },
        moving("(b) Rigid contact, λ_v/λ_a: the floors that meet highest", &rigid)?,
        moving("(c) The same, raw", &raw)?,
        Panel {
            title: "(d) Forces of that contact".into(),
            x: time(near),
            y: Axis::linear("MN", -1.0..20.0, &[0.0, 5.0, 10.0, 15.0, 20.0]),
            curves: forces,
            note: None,
        },
    ];
    let title = "Two frames of 0.90 s and 0.35 s pound against each other";
    page(
        title,
        "Trapezoidal rule, h = 2 ms; displacements against the ground, the right frame shifted by the gap",
        &panels,
    )
}

fn time(range: Range<f64>) -> Axis {
    let count = 4;
    let tick = |k: u32| range.start + f64::from(k) / f64::from(count) * (range.end - range.start);
    let ticks: Vec<_> = (0..=count).map(tick).collect();
    Axis::linear("time (s)", range, &ticks)
}
