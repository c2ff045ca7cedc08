//! Ranks that fail: `ranks fault force|solve|memory|kill`. The last rank fails, and all have to hear of it.

use crate::bodies::{Blocks, Scene};
use crate::share::Share;
use crate::solver::Way;
use contact_dynamics::{Error, Result, System};
use contact_dynamics_scenes::hosts::Hooked;
use contact_dynamics_scenes::ranks::Cut;
use std::sync::Arc;

/// What happens on the last rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The force of the host fails in a step.
    Force,
    /// The solver fails on this rank alone.
    Solve,
    /// MUMPS is not given the memory that it needs.
    Memory,
    /// The process dies.
    Kill,
}

impl Fault {
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "force" => Some(Self::Force),
            "solve" => Some(Self::Solve),
            "memory" => Some(Self::Memory),
            "kill" => Some(Self::Kill),
            _ => None,
        }
    }
}

/// The call in which the force of the last rank fails or kills, long after the start.
const CALL: usize = 30;

/// A system whose force does what the fault says, on the last rank.
pub fn with_fault(
    system: impl System<f64> + 'static,
    fault: Option<Fault>,
    is_last: bool,
) -> impl System<f64> + 'static {
    let mut calls = 0;
    Hooked::new(system, move |method, t, _: &mut [f64]| {
        calls += usize::from(method == "force");
        if !is_last || method != "force" || calls != CALL {
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
pub fn run(fault: Fault, blocks: &Blocks, (cut, share): (&Cut<3>, &Arc<Share>)) -> Result<bool> {
    let world = share.world;
    let is_last = world.rank + 1 == world.size;
    let way = Way { input: crate::ffi::Input::Distributed, condenses: true };
    let built = blocks.on_rank_with(Scene::LargeStrains, (cut, share), way, Some(fault))?.build();
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
        Fault::Kill => false,
    })
}
