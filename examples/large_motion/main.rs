//! Large motion: the stiff elastic pendulum, bodies that tumble onto a floor, and long runs; what each scheme conserves
//! and how many iterations it takes.
//!
//! `cargo run --release --example large_motion` prints the tables of `docs/measured/large_motion.md` and writes them;
//! with `--quick` the flights and the long runs are shorter.

use contact_dynamics::{
    Bathe, Bdf2, Composite, EnergyMomentum, GeneralizedAlpha, Houbolt, Newmark, Park, Result, TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::Law;
use contact_dynamics_scenes::large::{Flight, Swing, Throw};
use example_support::output::Output;
use std::fmt::Write;

type Make = fn() -> Box<dyn TimeIntegrator>;

const SCHEMES: [Make; 9] = [
    || Box::new(Composite),
    || Box::new(Newmark::trapezoidal()),
    || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap_or_else(|_| unreachable!())),
    || Box::new(GeneralizedAlpha::chung_hulbert(0.0).unwrap_or_else(|_| unreachable!())),
    || Box::new(Houbolt),
    || Box::new(Park),
    || Box::new(Bdf2),
    || Box::new(Bathe::default()),
    || Box::new(EnergyMomentum),
];

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let output = Output::from_command_line("large_motion")?;
    let mut page = String::new();
    for axial in [1e4, 1e7, 1e10] {
        writeln!(page, "Pendulum with EA = {axial:.0e}, ten seconds in steps of 0.01:\n")?;
        page += &pendulum(axial)?;
    }
    writeln!(page, "Flights:\n")?;
    page += &flights(if output.quick { 0.2 } else { 1.0 })?;
    let steps = if output.quick { 2_000 } else { 100_000 };
    writeln!(page, "{steps} steps:\n")?;
    page += &long_runs(steps)?;
    println!("{page}");
    output.write("large_motion.md", &page)
}

fn pendulum(axial: f64) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let mut table = String::from(
        "| scheme | distance from the reference | energy | angular momentum | iterations | breaks off |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    for make in SCHEMES {
        let swing = Swing::run(make(), axial, 0.01, 10.0)?;
        let errors = swing.errors.iter().map(|error| format!("{error:.1e}")).collect::<Vec<_>>().join(", ");
        let errors = if errors.is_empty() { "–".into() } else { errors };
        let failure = swing.failure.map_or("–".into(), |(t, _)| format!("t = {t:.2}"));
        writeln!(
            table,
            "| {} | {errors} | {:.0e} | {:.0e} | {:.1} | {failure} |",
            make().name(),
            swing.energy,
            swing.angular,
            swing.iterations
        )?;
    }
    Ok(table + "\n")
}

/// The scenes: a name, and a flight with a scheme for a share of the whole time.
type Fly = fn(Box<dyn TimeIntegrator>, f64) -> Result<Flight>;

/// From higher up, so that there is a flight before the impact.
fn throw() -> Throw {
    Throw { height: 0.3, ..Throw::default() }
}

const SCENES: [(&str, Fly); 6] = [
    ("square, 6²", |scheme, share| throw().square().fly(scheme, 40.0 * share)),
    ("ring, 2 × 40", |scheme, share| Throw { cells: 2, ..throw() }.ring().fly(scheme, 40.0 * share)),
    ("spinning bar, StVK", |scheme, share| {
        let law = Law::StVenantKirchhoff;
        let throw = Throw { cells: 2, law, gravity: 0.0, height: 1.0, slide: 0.0, speed: 0.05, spin: 0.1, ..throw() };
        throw.bar().fly(scheme, 80.0 * share)
    }),
    ("cube, 6³", |scheme, share| throw().cube().fly(scheme, 20.0 * share)),
    ("hoop, 1 × 20 × 1", |scheme, share| Throw { cells: 1, ..throw() }.hoop().fly(scheme, 40.0 * share)),
    ("mast on a swinging table", |scheme, share| {
        Throw { height: 0.5, speed: 0.1, ..throw() }.mast().fly(scheme, 40.0 * share)
    }),
];

fn flights(share: f64) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let mut table = String::from(
        "| scene | scheme | steps, refused | iterations away | in contact | energy: most | end \
         | angular momentum before impact | momentum | penetration | contact changes |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (name, fly) in SCENES {
        for make in [SCHEMES[0], SCHEMES[1], SCHEMES[2], SCHEMES[7], SCHEMES[8]] {
            let f = fly(make(), share)?;
            writeln!(
                table,
                "| {name} | {} | {}, {} | {:.1}, most {} | {:.1}, most {} | {:+.0e} | {:.3} | {:.0e} | {:.0e} \
                 | {:.0e} | {} |",
                make().name(),
                f.steps,
                f.refused,
                f.mean[0],
                f.most[0],
                f.mean[1],
                f.most[1],
                f.energy_most - 1.0,
                f.energy_end,
                f.angular,
                f.momentum,
                f.penetration,
                f.changes,
            )?;
        }
    }
    Ok(table + "\n")
}

fn long_runs(steps: u32) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let mut table = String::from(
        "| scheme | pendulum, EA = 1e4, h = 0.01: energy | angular momentum \
         | square that bounces and rests: energy, most | end | iterations in contact |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    for make in [SCHEMES[0], SCHEMES[1], SCHEMES[2], SCHEMES[7], SCHEMES[8]] {
        let swing = Swing::run(make(), 1e4, 0.01, 0.01 * f64::from(steps))?;
        let scene = Throw { cells: 3, ..throw() }.square();
        let flight = scene.fly(make(), scene.h * f64::from(steps))?;
        let broken = |value: f64| match &swing.failure {
            None => format!("{value:.0e}"),
            Some((t, _)) => format!("breaks off at t = {t:.1}"),
        };
        writeln!(
            table,
            "| {} | {} | {} | {:+.0e} | {:.5} | {:.1}, most {} |",
            make().name(),
            broken(swing.energy),
            broken(swing.angular),
            flight.energy_most - 1.0,
            flight.energy_end,
            flight.mean[1],
            flight.most[1],
        )?;
    }
    Ok(table + "\n")
}
