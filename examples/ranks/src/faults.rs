//! Ranks that fail: `ranks fault force|solve|memory|iterations|kill`. The last rank fails, and all have to hear of it.

use crate::bodies::{Blocks, Scene};
use crate::engine::Engine;
use crate::partition::Part;
use contact_dynamics::{Error, Result, System};
use contact_dynamics_scenes::hosts::Hooked;

/// What happens on the last rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The force of the host fails in a step.
    Force,
    /// The solver fails on this rank alone.
    Solve,
    /// MUMPS is not given the memory that it needs.
    Memory,
    /// Iterations end before they have converged, on all ranks.
    Iterations,
    /// The process dies.
    Kill,
}

impl Fault {
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "force" => Some(Self::Force),
            "solve" => Some(Self::Solve),
            "memory" => Some(Self::Memory),
            "iterations" => Some(Self::Iterations),
            "kill" => Some(Self::Kill),
            _ => None,
        }
    }

    /// Whether all ranks have it, not the last one alone.
    pub fn is_of_all(self) -> bool {
        self == Self::Iterations
    }
}

/// The call in which the force of the last rank fails or kills, some steps after the start.
const CALL: usize = 12;

/// A system whose force does what the fault says.
pub fn with_fault(system: impl System<f64> + 'static, fault: Option<Fault>) -> impl System<f64> + 'static {
    let mut calls = 0;
    Hooked::new(system, move |method, t, _: &mut [f64]| {
        calls += usize::from(method == "force");
        if method != "force" || calls != CALL {
            return Ok(());
        }
        match fault {
            Some(Fault::Force) => {
                Err(Error::Host { callback: "force", source: format!("element 7 is lost at t = {t:.4}").into() })
            }
            // As if the system had run out of memory, or somebody had pulled the plug.
            Some(Fault::Kill) => std::process::abort(),
            _ => Ok(()),
        }
    })
}

/// Runs until the fault. Whether every rank has heard of it as it should.
pub fn run(fault: Fault, blocks: &Blocks, part: &Part, engine: Engine) -> Result<bool> {
    let world = part.share.world;
    let is_last = world.rank + 1 == world.size;
    // (Iterations solve for each pressed row: at large strains that would be a thousand times before the fault.)
    let scene = if engine == Engine::CONDENSING { Scene::LargeStrains } else { Scene::Linear };
    let built = blocks.on_rank_with(scene, part, engine, Some(fault))?.build();
    let (result, steps) = match built {
        Err(error) => (Err(error), 0),
        Ok(mut run) => {
            let before = |run: &contact_dynamics::Simulation<'_, f64>| run.state().clone();
            loop {
                let state = before(&run);
                if let Err(error) = run.step() {
                    assert!(run.state() == &state, "the failed step has left something behind");
                    break (Err::<(), _>(error), run.statistics().steps);
                }
                if run.statistics().steps > 200 {
                    break (Ok(()), run.statistics().steps);
                }
            }
        }
    };
    let Err(error) = result else { return Ok(false) };
    println!("rank {} after {steps} steps: {error}", world.rank);
    let last = world.size - 1;
    Ok(match fault {
        Fault::Force | Fault::Solve if is_last => matches!(error, Error::Host { .. }),
        Fault::Force | Fault::Solve => matches!(error, Error::OtherRank { rank, .. } if rank == last),
        // (MUMPS tells all ranks.)
        Fault::Memory => matches!(error, Error::OutOfMemory { .. } | Error::OtherRank { .. }),
        Fault::Iterations => matches!(error, Error::LinearNotConverged { .. }),
        Fault::Kill => false,
    })
}
