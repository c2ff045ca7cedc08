//! A ball that falls on a plane, against Hertz and against its own mesh.

use crate::bars::Table;
use crate::strikes::{UNTAPERED, models, relative};
use contact_dynamics_scenes::impact_scenes::Ball;
use contact_dynamics_scenes::impacts::{Course, Model, Step};
use example_support::output::decimal;
use std::fmt::Write;

/// Steps of Hertz' duration.
const STEPS: f64 = 200.0;

/// Hertz' contact radius over that of the ball, elements across it and in the quarter of the ball.
type Mesh = (f64, usize, [usize; 3]);

/// The mesh on which all models are compared, and those which say what Hertz' theory and the mesh err.
const MAIN: Mesh = (0.15, 10, [16, 16, 24]);
const OTHERS: [Mesh; 4] =
    [(0.15, 3, [8, 8, 12]), (0.15, 6, [11, 11, 17]), (0.075, 10, [17, 17, 25]), (0.04, 10, [18, 18, 26])];
const QUICK: Mesh = (0.15, 2, [5, 5, 7]);

fn line(table: &mut String, name: &str, course: &Course, (whole, hertz): (&Course, &Course)) -> std::fmt::Result {
    writeln!(
        table,
        "| {name} | {} | {} | {} | {} |",
        course.unknowns,
        decimal(course.error(hertz), 3),
        decimal(course.error(whole), 3),
        relative(course, [hertz, whole], course.velocities[0] / hertz.velocities[0])
    )
}

/// The ball whole and reduced.
pub(crate) fn ball(quick: bool) -> Table {
    let (others, main): (&[Mesh], Mesh) = if quick { (&[], QUICK) } else { (&OTHERS, MAIN) };
    let counts: &[usize] = if quick { &[2, 20] } else { &[2, 5, 20, 50, 100] };
    let mut table = format!(
        "A quarter of a ball of hex8 elements that falls on a plane, {STEPS} steps in Hertz' duration, trapezoidal rule; a is \
         Hertz' contact radius, R the ball's, d the elements across a: error of the force over time, of Hertz' and of \
         the whole model on the same mesh; largest and mean force, impulse and rebound over Hertz'; energy left; \
         times; number of impacts after which the build is paid\n\n\
         | a/R | d | model | unknowns | error, of Hertz | error, of the mesh | largest | mean | impulse | rebound | energy | \
         steps | run, ms | with build, ms | paid after |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    );
    for &(contact, across, cells) in others.iter().chain([&main]) {
        let ball = Ball::new(contact, across, cells)?;
        let h = ball.hertz.duration() / STEPS;
        let hertz = ball.exact(h);
        let whole = ball.impact.course(Model::Whole, Step::Of(h))?;
        let place = format!("{contact} | {across}");
        line(&mut table, &format!("{place} | whole"), &whole, (&whole, &hertz))?;
        let all = match cells == main.2 {
            true => counts.iter().flat_map(|&count| models(count, h)).collect(),
            false => vec![("20 modes, untapered".to_owned(), UNTAPERED.of(20), Step::Of(h))],
        };
        for (name, model, step) in all {
            let course = ball.impact.course(model, step)?;
            line(&mut table, &format!("{place} | {name}"), &course, (&whole, &hertz))?;
        }
    }
    Ok(table)
}
