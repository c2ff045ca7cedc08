//! The figure: forces along the well, the hook load over time, contacts that stick and slide, and a wave that stops.

use crate::drag::{CD_LAGRANGE, CORRECTED, TRAPEZOIDAL_RAW, states};
use crate::wave;
use contact_dynamics_scenes::well::{Rod, ramp};
use example_support::plot::{Axis, BLUE, Curve, DARK, GREEN, Panel, RGBColor, VERMILION, page};
use std::error::Error;

/// What panels show of one run of the drill pipe.
struct Shown {
    hook: Vec<(f64, f64)>,
    sticking: Vec<(f64, f64)>,
    sliding: Vec<(f64, f64)>,
}

fn curve(label: &str, color: RGBColor, width: u32, points: Vec<(f64, f64)>) -> Curve {
    Curve { label: Some(label.into()), color, width, points }
}

/// The weight comes on within a second, then the rod is pulled out.
fn pulled(rod: &Rod, way: crate::drag::Way, until: f64) -> Result<Shown, Box<dyn Error>> {
    let h = 5e-3;
    let hoist = ramp(1.0, 0.5);
    let mut run = way.run(rod, h, 1.0, move |t| hoist(t - 2.0))?;
    let mut shown = Shown { hook: Vec::new(), sticking: Vec::new(), sliding: Vec::new() };
    while run.time() < until {
        run.step()?;
        let t = run.time();
        shown.hook.push((t, 1e-3 * rod.hook_load(&mut run)?));
        let [stick, slide] = states(&run).map(|count| count as f64);
        shown.sticking.push((t, stick));
        shown.sliding.push((t, slide));
    }
    Ok(shown)
}

/// Forces on the walls over length by depth, of a rod that is pulled out steadily; of the high side positive.
fn walls(rod: &Rod, until: f64) -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
    let mut run = CORRECTED.steady(rod, 1.0, until)?;
    run.run_until(until, &mut ())?;
    let forces = run.state().contacts().forces();
    let [low, high] = rod.sides();
    let over = |k: usize| (forces[high.clone()][k] - forces[low.clone()][k]) / rod.share(k + 1);
    Ok((0..rod.elements).map(|k| (rod.depth(k + 1), over(k))).collect())
}

pub(crate) fn figure(quick: bool) -> Result<String, Box<dyn Error>> {
    let (elements, until) = if quick { (40, 3.0) } else { (200, 6.0) };
    let rod = Rod::drill_pipe(elements);
    let (corrected, raw) = (pulled(&rod, CORRECTED, until)?, pulled(&rod, TRAPEZOIDAL_RAW, until)?);
    let profile = rod.soft_string(1.0, 401);
    let soft = profile.iter().map(|&[depth, _, pressed]| (depth, pressed)).collect();
    let load = 1e-3 * profile[0][1];
    let depth = Axis::linear("measured depth (m)", 0.0..2000.0, &[0.0, 500.0, 1000.0, 1500.0, 2000.0]);
    let time = Axis::linear("time (s)", 0.0..6.0, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let panels = [
        Panel {
            title: "(a) Force on the wall, high side positive, pulled out steadily".into(),
            x: depth,
            y: Axis::linear("N/m", -300.0..800.0, &[-200.0, 0.0, 200.0, 400.0, 600.0, 800.0]),
            curves: vec![
                curve("λ_v/λ_a", BLUE, 8, walls(&rod, if quick { 4.0 } else { 10.0 })?),
                curve("soft string", DARK, 4, soft),
            ],
            note: None,
        },
        Panel {
            title: "(b) Hook load".into(),
            x: time.clone(),
            y: Axis::linear("kN", 0.0..800.0, &[0.0, 200.0, 400.0, 600.0, 800.0]),
            curves: vec![
                curve("trapezoidal rule, raw", VERMILION, 4, raw.hook),
                curve("λ_v/λ_a", BLUE, 8, corrected.hook),
                curve("soft string", DARK, 4, vec![(2.5, load), (6.0, load)]),
            ],
            note: None,
        },
        Panel {
            title: "(c) Contacts, λ_v/λ_a".into(),
            x: time,
            y: Axis::linear("number", 0.0..220.0, &[0.0, 50.0, 100.0, 150.0, 200.0]),
            curves: vec![curve("stick", GREEN, 6, corrected.sticking), curve("slide", VERMILION, 6, corrected.sliding)],
            note: None,
        },
        front(quick)?,
    ];
    let title =
        format!("Drill pipe in a well of 2000 m, {elements} elements; (b), (c): weight on by 1 s, pulled from 2 s on");
    page(
        &title,
        "Chung–Hulbert(0.8) with λ_v/λ_a, the trapezoidal rule without; (d): level bed, CD-Lagrange, Courant number 1",
        &panels,
    )
}

/// The velocity along a rod on a level bed, three times after a sudden pull, against the exact one.
fn front(quick: bool) -> Result<Panel, Box<dyn Error>> {
    let rod = wave::rod(if quick { 60 } else { 300 });
    let mut curves = Vec::new();
    for (part, color) in [(0.3, BLUE), (0.6, GREEN), (0.9, VERMILION)] {
        let (t, exact) = wave::exact(&rod, part);
        let mut run = CD_LAGRANGE.run(&rod, rod.size() / rod.wave_speed(), 0.2, wave::pull)?;
        run.run_until(wave::START + t, &mut ())?;
        let v = run.state().velocity();
        let points = (0..=rod.elements).map(|node| (rod.depth(node), -rod.way(node, v))).collect();
        curves.push(curve(&format!("{:.0} ms", 1e3 * t), color, 6, points));
        curves.push(Curve { label: None, color: DARK, width: 3, points: exact });
    }
    Ok(Panel {
        title: "(d) Velocity along the rod, pulled with 0.4 m/s; black: exact".into(),
        x: Axis::linear("depth (m)", 0.0..1200.0, &[0.0, 400.0, 800.0, 1200.0]),
        y: Axis::linear("m/s", -0.1..0.6, &[0.0, 0.2, 0.4]),
        curves,
        note: None,
    })
}
