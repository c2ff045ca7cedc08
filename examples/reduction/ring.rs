//! A thin ring thrown at a wall: how many modes it takes.

use crate::bars::Table;
use crate::strikes::{cost, models};
use contact_dynamics::Result;
use contact_dynamics_scenes::impact_scenes::ring;
use contact_dynamics_scenes::impacts::{Course, Model, Step};
use example_support::output::decimal;
use std::fmt::Write;

/// Speeds, over that of waves. The force is one of many short impacts that no two models share one by one: means over
/// several speeds say more than one run.
const SPEEDS: [f64; 3] = [0.0045, 0.005, 0.0055];

/// The angle from the lowest point within which nodes may touch.
const ANGLE: f64 = 0.2;

/// The widths of windows in which forces are compared: the contact of the reference over these.
const WINDOWS: [f64; 2] = [20.0, 5.0];

/// Steps of a mesh with so many elements around: what a wave takes through one of them.
fn step(around: usize) -> f64 {
    std::f64::consts::TAU / around as f64
}

/// Steps of the whole model that are as long as those of some tens of modes may be, over its usual ones.
const LONG: f64 = 50.0;

/// An impact at each speed.
fn courses(cells: [usize; 2], model: Model, step: Step) -> Result<Vec<Course>> {
    SPEEDS.iter().map(|&speed| ring(cells, speed, ANGLE)?.course(model, step)).collect()
}

fn rebounds(courses: &[Course]) -> Vec<f64> {
    courses.iter().zip(SPEEDS).map(|(course, speed)| course.velocities[0] / speed).collect()
}

fn mean(of: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = of.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

/// A row: figures over the reference, and times beside those of the whole model on the same mesh.
fn row(name: &str, courses: &[Course], [reference, whole]: [&[Course]; 2]) -> String {
    let pairs = || courses.iter().zip(reference);
    let error = |parts: f64| decimal(mean(pairs().map(|(x, of)| x.window_error(of.last / parts, of))), 3);
    let top = |parts: f64| {
        let most = |course: &Course, of: &Course| course.windows(of.last / parts, of).into_iter().fold(0.0, f64::max);
        decimal(mean(pairs().map(|(x, of)| most(x, of) / most(of, of))), 2)
    };
    let (ours, theirs) = (rebounds(courses), rebounds(reference));
    let miss = mean(ours.iter().zip(&theirs).map(|(x, y)| (x - y).abs()));
    let cells = [
        decimal(mean(ours.into_iter()), 3),
        decimal(miss, 3),
        decimal(mean(courses.iter().map(|course| course.energy)), 4),
        decimal(mean(pairs().map(|(x, of)| x.last / of.last)), 2),
        error(WINDOWS[0]),
        top(WINDOWS[0]),
        error(WINDOWS[1]),
        top(WINDOWS[1]),
        decimal(mean(pairs().map(|(x, of)| x.largest() / of.largest())), 2),
        courses.iter().map(|course| course.touched).max().unwrap_or(0).to_string(),
        cost(&courses[0], &whole[0]),
    ];
    format!("| {name} | {} | {} |\n", courses[0].unknowns, cells.join(" | "))
}

/// The ring whole and reduced.
pub(crate) fn thrown(quick: bool) -> Table {
    let (coarse, cells, finer) = if quick { ([1, 20], [1, 30], [1, 40]) } else { ([2, 300], [4, 600], [6, 900]) };
    let counts: &[usize] = if quick { &[10] } else { &[6, 10, 14, 20, 30, 50, 100] };
    let contacts = ring(cells, SPEEDS[0], ANGLE)?.rows.len();
    let size = |[across, around]: [usize; 2]| format!("{across} × {around}");
    let mut table = format!(
        "A ring a twentieth of its radius thick, {} quad4 elements, strikes a wall with {contacts} contact dofs, \
         trapezoidal rule, means over three speeds: rebound, its difference from a ring of {} elements; energy left; \
         duration over that of the fine ring; errors of mean forces in windows of a twentieth and a fifth of the \
         contact, and the largest of these over those of the fine ring; the largest force itself, also so; nodes that \
         touched; times of one impact; number of impacts after which the build is paid\n\n",
        size(cells),
        size(finer)
    );
    table += "| model | unknowns | rebound | difference | energy | duration | error, 1/20 | largest, 1/20 | error, 1/5 \
              | largest, 1/5 | largest force | touched | steps | run, ms | with build, ms | paid after |\n";
    writeln!(table, "|{}", " --- |".repeat(16))?;
    let whole = |cells: [usize; 2]| courses(cells, Model::Whole, Step::Of(step(cells[1])));
    let (fine, same) = (whole(finer)?, whole(cells)?);
    let of = [&fine[..], &same[..]];
    table += &row(&format!("whole, {}", size(finer)), &fine, of);
    table += &row(&format!("whole, {}", size(cells)), &same, of);
    let long = courses(cells, Model::Whole, Step::Of(LONG * step(cells[1])))?;
    table += &row(&format!("whole, {}, {LONG} h", size(cells)), &long, of);
    table += &row(&format!("whole, {}", size(coarse)), &whole(coarse)?, of);
    for &count in counts {
        for (name, model, step) in models(count, step(cells[1])) {
            table += &row(&name, &courses(cells, model, step)?, of);
        }
    }
    Ok(table)
}
