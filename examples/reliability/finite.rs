//! NaN from a host at one of its calls: a step that fails, and nothing else.

use super::{Anything, Row};
use contact_dynamics::Simulation;
use contact_dynamics::contact::{ContactLaw, GapOffset};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{Composite, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Real};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

fn matrix<T: Real>(entries: &[(usize, usize, f64)]) -> Result<SparseColMat<usize, T>, Anything> {
    let triplets: Vec<_> = entries.iter().map(|&(i, j, x)| Triplet::new(i, j, x)).collect();
    let (pattern, values) = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &triplets)?.into_parts();
    Ok(SparseColMat::new(pattern, values.into_iter().map(T::of).collect()))
}

/// Whether what a run shows is finite.
fn is_finite<T: Real>(run: &Simulation<'_, T>) -> bool {
    let (state, contacts) = (run.state(), run.state().contacts());
    let motion = [state.displacement(), state.velocity(), state.acceleration()];
    let forces = [contacts.forces(), contacts.impulses(), contacts.dissipated(), contacts.lambda_v()];
    motion.into_iter().chain(forces).flatten().all(|x| x.is_finite())
}

/// Two masses fly at a wall whose rate (or acceleration) is NaN at one call, whichever: good steps with NaN in what
/// they show, and runs that end elsewhere than the one without NaN though nothing was told, over all calls.
fn swept(part: usize) -> Result<String, Anything> {
    let build = |call: usize| -> Result<(Simulation<'static, f64>, Arc<AtomicUsize>), Anything> {
        let left = Arc::new(AtomicUsize::new(usize::MAX / 2));
        let calls = left.clone();
        let wall = GapOffset::moving(move |t| {
            let mut motion = [0.05 + 0.1 * t, 0.1, 0.0];
            if calls.fetch_sub(1, Ordering::Relaxed) == 1 {
                motion[part] = f64::NAN;
            }
            motion
        });
        let k = matrix(&[(0, 0, 9.0), (0, 1, -9.0), (1, 0, -9.0), (1, 1, 9.0)])?;
        let run = Simulation::builder(LinearSystem::lumped(vec![1.0, 1.0], k)?, Newmark::trapezoidal(), 0.01)
            .velocity(vec![-1.0, -1.0])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], wall))
            .corrector(PersistencyCorrection::new())
            .build()?;
        left.store(call, Ordering::Relaxed);
        Ok((run, left))
    };
    let end = |call: usize| -> Result<(Vec<f64>, u32, u32, bool), Anything> {
        let (mut run, left) = build(call)?;
        let (mut nonsense, mut told) = (0, 0);
        for _ in 0..20 {
            if run.step().is_err() {
                told += 1;
                if run.step().is_err() {
                    break;
                }
            }
            nonsense += u32::from(!is_finite(&run));
        }
        let happened = !(1..=usize::MAX / 2).contains(&left.load(Ordering::Relaxed));
        Ok((run.state().velocity().to_vec(), nonsense, told, happened))
    };
    let clean = end(usize::MAX / 2)?.0;
    let (mut nonsense, mut silent, mut told) = (0, 0, 0);
    for call in 1.. {
        let (v, wrong, errors, happened) = end(call)?;
        if !happened {
            break;
        }
        (nonsense, told) = (nonsense + wrong, told + errors);
        silent += u32::from(errors == 0 && v != clean);
    }
    Ok(format!("{nonsense} steps with NaN, {silent} runs wrong without a word; {told} errors"))
}

/// A spring that `f32` cannot hold.
fn beyond(stiffness: f64) -> Result<String, Anything> {
    let k = matrix::<f32>(&[(0, 0, 1.0), (1, 1, 1.0)])?;
    let built = Simulation::builder(LinearSystem::lumped(vec![1.0_f32; 2], k)?, Composite, 0.01)
        .velocity(vec![-1.0, 0.0])
        .constraint(LinearRows::new().row(ContactLaw::Penalty { stiffness }, &[(0, 1.0)], 0.05))
        .build();
    let mut run = match built {
        Ok(run) => run,
        Err(error) => return Ok(format!("refused: {error}")),
    };
    for _ in 0..20 {
        if let Err(error) = run.step() {
            return Ok(error.to_string());
        }
    }
    Ok(format!("Ok, u = {:.3}, force {:.1e}", run.state().displacement()[0], run.state().contacts().forces()[0]))
}

pub(crate) fn cases(_quick: bool) -> Result<Vec<Row>, Anything> {
    let case = |case: &str, before, now: String| Row { case: case.into(), before, now };
    Ok(vec![
        case("rate of a moving wall NaN at its k-th call, every k: trapezoidal rule, λ_v/λ_a", BEFORE[0], swept(1)?),
        case("acceleration of it", BEFORE[1], swept(2)?),
        case("penalty of 1e-46 in f32, a mass that flies into it", BEFORE[2], beyond(1e-46)?),
    ])
}

const BEFORE: [&str; 3] = [
    "15 steps with NaN, 1 runs wrong without a word; 14 errors",
    "15 steps with NaN, 0 runs wrong without a word; 14 errors",
    "t = 6e-2: contact problem not solved after 0 iterations; contact 0.0.0 misses complementarity by NaN (gap units)",
];
