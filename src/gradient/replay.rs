//! Steps taken again from a checkpoint, and recorded.

use crate::error::Result;
use crate::real::Real;
use crate::simulation::{Impulses, Simulation};
use crate::state::{History, State, Tape};

/// Takes steps of these sizes again. The run is left as it was, but its rows and factors belong to other states.
pub(super) fn take_again<T: Real>(
    run: &mut Simulation<'_, T>,
    tape: &Tape<T>,
    (state, history): &(State<T>, History<T>),
    sizes: &[f64],
) -> Result<Tape<T>> {
    let empty = || Tape::new(tape.start.clone(), tape.held.clone(), tape.past);
    run.work.tape = Some(Box::new(empty()));
    let kept = (
        std::mem::replace(&mut run.state, state.clone()),
        std::mem::replace(&mut run.history, history.clone()),
        run.compiled.startup.take(),
        run.monitors.ledger.take(),
        run.monitors.judge.take(),
        run.statistics,
        std::mem::replace(&mut run.work.contact.impulses, Impulses::new(run.parts.system.dofs())),
    );
    let result = take_steps(run, sizes);
    (
        run.state,
        run.history,
        run.compiled.startup,
        run.monitors.ledger,
        run.monitors.judge,
        run.statistics,
        run.work.contact.impulses,
    ) = kept;
    let taken = run.work.tape.take();
    result?;
    Ok(taken.map_or_else(empty, |taken| *taken))
}

fn take_steps<T: Real>(run: &mut Simulation<'_, T>, sizes: &[f64]) -> Result<()> {
    for &h in sizes {
        run.compile_for(h)?;
        if h.to_bits() != run.history.clock.h.to_bits() {
            run.history.clock = run.history.clock.with_step_size(h);
        }
        if run.history.known < run.scheme.depth && run.compiled.startup.is_none() {
            let motion = run.state.motion.clone();
            run.compiled.startup = Some(run.compiled_starter(h, &motion)?);
        }
        run.attempt()?;
    }
    Ok(())
}
