//! Rows that depend on one another and come to contradict each other, by the default contact solver.

use super::{Anything, Row};
use contact_dynamics::{Composite, Newmark, Simulation, TimeIntegrator};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::squeeze::{Squeeze, Walls};

/// Ratios of masses and stiffnesses.
const RATIOS: [f64; 5] = [1.0, 1e2, 1e4, 1e6, 1e8];

/// Runs of random squeezes, 20 steps each or until one is refused: in how many a step was accepted though a gap was
/// violated by more than 1e-5 of the sizes of its terms, and in how many one was refused while the walls left room.
fn count(ratio: f64, walls: Walls, runs: usize) -> Result<[usize; 2], Anything> {
    let mut random = xorshift(77);
    let (mut wrong, mut refused) = (0, 0);
    for run in 0..runs {
        let squeeze = Squeeze::random(&mut random, ratio, walls);
        let scheme: Box<dyn TimeIntegrator> =
            if run % 2 == 0 { Box::new(Composite) } else { Box::new(Newmark::trapezoidal()) };
        let mut run = Simulation::builder(squeeze.system(), scheme, squeeze.h)
            .constraint(squeeze.contact())
            .uncorrected()
            .build()?;
        for _ in 0..20 {
            if run.step().is_err() {
                refused += usize::from(run.time() + squeeze.h < squeeze.until);
                break;
            }
            if squeeze.violation(run.time(), run.state().displacement()) > 1e-5 {
                wrong += 1;
                break;
            }
        }
    }
    Ok([wrong, refused])
}

fn row(walls: Walls, which: usize, runs: usize) -> Result<String, Anything> {
    let counts: Result<Vec<_>, _> = RATIOS.iter().map(|&ratio| count(ratio, walls, runs)).collect();
    let counts: Vec<_> = counts?.iter().map(|counts| counts[which].to_string()).collect();
    Ok(format!("{} of {runs}", counts.join(", ")))
}

pub(crate) fn cases(quick: bool) -> Result<Vec<Row>, Anything> {
    let runs = if quick { 300 } else { 5000 };
    Ok(vec![
        Row {
            case: "Two to six masses, levers, a wall that closes: runs that go on with violated gaps, at ratios of \
                   mass and stiffness of 1, 1e2, 1e4, 1e6, 1e8"
                .into(),
            before: "34, 83, 317, 463, 549 of 5000",
            now: row(Walls::Close, 0, runs)?,
        },
        Row {
            case: "The same with room left: runs refused, of 20 steps each".into(),
            before: "0, 0, 0, 1, 24 of 5000",
            now: row(Walls::Yield, 1, runs)?,
        },
    ])
}
