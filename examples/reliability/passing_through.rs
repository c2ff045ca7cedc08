//! Fast nodes at a ball and at a square of facets: how many runs end Ok and wrong.

use super::{Anything, Row};
use contact_dynamics::contact::{Facet, NodeToFacet, Side, Sphere, SurfaceSettings};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{
    ContactConstraint, Error, LinearSystem, Newmark, NodesOnObstacle, PersistencyCorrection, Simulation, StepControl,
};

/// A straight flight in the plane, and the energy that a plastic impact takes on it; none is met if it is zero.
struct Flight {
    start: [f64; 2],
    v: [f64; 2],
    duration: f64,
    loss: f64,
}

/// What became of a flight.
#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    Right,
    Wrong,
    Refused,
}

impl Flight {
    /// Runs at h = 1 until the node has met something. Right is what loses the energy due, within a tenth of what there
    /// was.
    fn run(&self, contact: impl ContactConstraint<f64>, held: usize, controlled: bool) -> Result<Outcome, Anything> {
        let n = 2 + held;
        let none: Vec<_> = (0..n).map(|i| Triplet::new(i, i, 0.0)).collect();
        let k = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &none)?;
        let system = (2..n).try_fold(LinearSystem::lumped(vec![1.0; n], k)?, LinearSystem::fix)?;
        let mut velocity = vec![0.0; n];
        velocity[..2].copy_from_slice(&self.v);
        let mut builder = Simulation::builder(system, Newmark::trapezoidal(), 1.0)
            .velocity(velocity)
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection());
        if controlled {
            builder = builder.step_control(StepControl::halving(1e-9)?);
        }
        let mut run = builder.build()?;
        while run.time() < self.duration {
            match run.step() {
                Ok(()) => {}
                Err(error) if error.is_recoverable() || matches!(error, Error::StepRefused { .. }) => {
                    return Ok(Outcome::Refused);
                }
                Err(other) => return Err(other.into()),
            }
            if run.state().contacts().closed().contains(&true) {
                break;
            }
        }
        let energy = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>();
        let lost = 1.0 - energy(&run.state().velocity()[..2]) / energy(&self.v);
        Ok(if (lost - self.loss).abs() < 0.12 { Outcome::Right } else { Outcome::Wrong })
    }
}

fn ratios() -> impl Iterator<Item = f64> {
    (0..9).map(|k| 0.01 * 3_f64.powi(k)).chain([100.0])
}

const PHASES: [f64; 3] = [0.13, 0.5, 0.91];

/// Runs all, and counts those that are wrong and those that were refused.
fn tally(outcomes: impl Iterator<Item = Result<Outcome, Anything>>) -> Result<[usize; 3], Anything> {
    let mut counts = [0; 3];
    for outcome in outcomes {
        counts[outcome? as usize] += 1;
    }
    Ok(counts)
}

fn at_ball(controlled: bool) -> Result<[usize; 3], Anything> {
    let flights = ratios().flat_map(|ratio| {
        [0.0, 0.3, 0.7, 0.9, 1.3].into_iter().flat_map(move |offset: f64| {
            PHASES.into_iter().map(move |phase| {
                let start = [-1.0 - ratio.max(0.1) * (1.0 + phase), offset];
                let loss = (1.0 - offset * offset).max(0.0);
                Flight { start, v: [ratio, 0.0], duration: (2.0 * start[0].abs() + 3.0) / ratio + 2.0, loss }
            })
        })
    });
    tally(flights.map(|flight| {
        let ball = Sphere::new([0.0; 2], 1.0, Side::Outside)?;
        let contact = NodesOnObstacle::new(ball, &[flight.start], &[[0, 1]], &[0])?.reach(0.1)?;
        flight.run(contact, 0, controlled)
    }))
}

fn at_square(controlled: bool) -> Result<[usize; 3], Anything> {
    let reach = 0.2;
    let flights = ratios().flat_map(|ratio| {
        [0.37, 0.63, 1.6].into_iter().flat_map(move |aim| {
            PHASES.into_iter().flat_map(move |phase| {
                [0.0, 0.4].map(|slope| {
                    let v = [slope * ratio * reach, -ratio * reach];
                    let before = (0.7 + phase).max(0.3 / ratio);
                    let start = [aim - before * v[0], 1.0 - before * v[1]];
                    let loss = if aim < 1.0 { 1.0 / (1.0 + slope * slope) } else { 0.0 };
                    Flight { start, v, duration: 2.0 * before + 3.0 / (ratio * reach), loss }
                })
            })
        })
    });
    tally(flights.map(|flight| {
        // Each side of the unit square in four, counter-clockwise; node 0 is the particle.
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let mut nodes = vec![flight.start];
        for side in 0..4 {
            let (from, to): ([f64; 2], [f64; 2]) = (corners[side], corners[(side + 1) % 4]);
            nodes.extend((0..4).map(|k| [0, 1].map(|i| from[i] + 0.25 * f64::from(k) * (to[i] - from[i]))));
        }
        let facets = (0..16).map(|k| Facet::from([1 + k, 1 + (k + 1) % 16]));
        let dofs: Vec<[usize; 2]> = (0..nodes.len()).map(|n| [2 * n, 2 * n + 1]).collect();
        let contact = NodeToFacet::one_pass(&nodes, &dofs, &[0], facets)?.with(SurfaceSettings::new().reach(reach))?;
        flight.run(contact, 2 * (nodes.len() - 1), controlled)
    }))
}

pub(crate) fn cases(_: bool) -> Result<Vec<Row>, Anything> {
    let case = |what: &str, before, run: fn(bool) -> Result<[usize; 3], Anything>| {
        let ([right, wrong, refused], [_, still, given_up]) = (run(false)?, run(true)?);
        let runs = right + wrong + refused;
        Ok::<_, Anything>(Row {
            case: format!("{what}, {runs} runs: Ok and wrong, refused; the same under step control"),
            before,
            now: format!("{wrong}, {refused}; {still}, {given_up}"),
        })
    };
    Ok(vec![
        case("A node at a disc, .01 to 100 radii a step, with a reach of a tenth", BALL_BEFORE, at_ball)?,
        case("A node at a square of facets, .01 to 100 reaches a step", SQUARE_BEFORE, at_square)?,
    ])
}

const BALL_BEFORE: &str = "59, 0; 59, 0";
const SQUARE_BEFORE: &str = "48, 0; 48, 0";
