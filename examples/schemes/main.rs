//! Every time integrator side by side: the tables of `docs/schemes.md` and its figure, computed from the rows.
//!
//! `cargo run --release --example schemes`

use contact_dynamics::TimeIntegrator;
use contact_dynamics::analysis::{period_and_damping, spectral_radius};
use contact_dynamics::{
    Bathe, Bdf2, CentralDifference, ChungLee, Composite, GeneralizedAlpha, Houbolt, HulbertChung, Newmark, NohBathe,
    Park, TchamwaWielgosz,
};
use example_support::output::Output;
use example_support::plot::{Axis, BLUE, Curve, GRAY, GREEN, ORANGE, PURPLE, Panel, RGBColor, SKY, VERMILION, page};

use std::error::Error;

#[allow(clippy::pedantic, reason = "numerics, with the lints of tests/scenes")]
mod tables;

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("schemes")?;
    let tables = [
        ("Accuracy and stability", tables::accuracy()),
        ("What is conserved, where contact is imposed", tables::conservation()),
        ("Two bars", tables::contact()),
    ];
    let text: String = tables.map(|(title, table)| [title, "\n\n", &table, "\n"].concat()).concat();
    print!("{text}");
    output.write("schemes.md", &text)?;
    output.write("schemes.svg", &figure()?)
}

type Make = fn() -> Box<dyn TimeIntegrator>;

/// Implicit schemes of the figure: label, color, scheme.
const IMPLICIT: [(&str, RGBColor, Make); 7] = [
    ("trapezoidal", GRAY, || Box::new(Newmark::trapezoidal())),
    ("Houbolt", ORANGE, || Box::new(Houbolt)),
    ("BDF2", GREEN, || Box::new(Bdf2)),
    ("Park", PURPLE, || Box::new(Park)),
    ("Chung–Hulbert(0.8)", SKY, || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap())),
    ("composite", VERMILION, || Box::new(Composite)),
    ("Bathe", BLUE, || Box::<Bathe>::default()),
];

const EXPLICIT: [(&str, RGBColor, Make); 5] = [
    ("central difference", GRAY, || Box::new(CentralDifference)),
    ("Tchamwa(1.033)", ORANGE, || Box::new(TchamwaWielgosz::new(1.033).unwrap())),
    ("Chung–Lee(28/27)", GREEN, || Box::new(ChungLee::new(28.0 / 27.0).unwrap())),
    ("Hulbert–Chung(0.8)", SKY, || Box::new(HulbertChung::new(0.8).unwrap())),
    ("Noh–Bathe(0.54)", BLUE, || Box::new(NohBathe::new(0.54).unwrap())),
];

/// ρ(Ω), period error and damping.
fn figure() -> Result<String, Box<dyn Error>> {
    let ratios = || (1..=200).map(|i| 0.3 * f64::from(i) / 200.0);
    let implicit_radius = curves(&IMPLICIT, |scheme| {
        let omegas = (0..=300).map(|i| -2.0 + 5.0 * f64::from(i) / 300.0);
        omegas.map(|log| (log, spectral_radius(&scheme.tableau(), 10.0_f64.powf(log), 0.0))).collect()
    });
    let explicit_radius = curves(&EXPLICIT, |scheme| {
        let omegas = (1..=800).map(|i| 4.0 * f64::from(i) / 800.0);
        omegas.map(|omega| (omega, spectral_radius(&scheme.tableau(), omega, 0.0))).collect()
    });
    let of_period = |pick: fn((f64, f64)) -> f64| {
        curves(&IMPLICIT, |scheme| {
            let tableau = scheme.tableau();
            ratios().filter_map(|x| Some((x, 100.0 * pick(period_and_damping(&tableau, x, 0.0)?)))).collect()
        })
    };
    let ratio = || Axis::linear("h/T", 0.0..0.3, &[0.0, 0.1, 0.2, 0.3]);
    let radius = || Axis::linear("spectral radius", 0.0..1.1, &[0.0, 0.25, 0.5, 0.75, 1.0]);
    let panels = [
        Panel {
            title: "(a) Spectral radius, implicit".into(),
            x: Axis::decades("Ω = ωh", -2, 3, 1),
            y: radius(),
            curves: implicit_radius,
            note: None,
        },
        Panel {
            title: "(b) Spectral radius, explicit".into(),
            x: Axis::linear("Ω = ωh", 0.0..4.0, &[0.0, 1.0, 2.0, 3.0, 4.0]),
            y: radius(),
            curves: explicit_radius,
            note: None,
        },
        Panel {
            title: "(c) Period error".into(),
            x: ratio(),
            y: Axis::linear("period error (%)", 0.0..40.0, &[0.0, 10.0, 20.0, 30.0, 40.0]),
            curves: of_period(|(period, _)| period),
            note: None,
        },
        Panel {
            title: "(d) Numerical damping".into(),
            x: ratio(),
            y: Axis::linear("damping ratio (%)", 0.0..20.0, &[0.0, 5.0, 10.0, 15.0, 20.0]),
            curves: of_period(|(_, damping)| damping),
            note: None,
        },
    ];
    page("Time integrators, from their rows", "Undamped oscillator, no load", &panels)
}

fn curves(schemes: &[(&str, RGBColor, Make)], points: impl Fn(&dyn TimeIntegrator) -> Vec<(f64, f64)>) -> Vec<Curve> {
    let curve = |&(label, color, make): &(&str, RGBColor, Make)| Curve {
        label: Some(label.into()),
        color,
        width: 7,
        points: points(&*make()),
    };
    schemes.iter().map(curve).collect()
}
