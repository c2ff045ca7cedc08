//! Which runs are recorded.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::{CompiledStage, Operator, Simulation};
use crate::state::{StartingPast, slides};
use crate::system::Linearity;

/// Refuses a run that has a part without derivative. Returns which past it starts from.
pub(super) fn check<T: Real>(run: &mut Simulation<'_, T>) -> Result<StartingPast> {
    let refuse =
        |part: String, reason| Err(Error::Incompatible { part: format!("the gradient through {part}"), reason });
    if !run.history.clock.is_at_start() {
        return refuse("a run that has begun".into(), "call `record` before its first step");
    }
    if !run.parts.together.is_alone() {
        return refuse("a run over ranks".into(), "record the whole body in one process");
    }
    if !run.work.massless.is_empty() {
        return refuse("dofs without mass".into(), "give them a mass");
    }
    for corrector in &run.parts.correctors {
        if let Err(reason) = corrector.requirements(&run.scheme.tableau).gradient {
            return refuse(format!("the corrector {}", corrector.name()), reason);
        }
    }
    if run.constraints.offsets.overclosures().is_some() {
        let reason = "gaps depend on the initial positions: place the bodies so that they touch";
        return refuse("overlaps at the start that gaps leave out".into(), reason);
    }
    let at_velocities =
        |stage: &CompiledStage<T>| stage.contact.as_ref().is_some_and(|contact| contact.forecast.is_some());
    if !run.constraints.is_affine() && run.compiled.program.stages.iter().any(at_velocities) {
        let reason =
            "the scheme imposes contact on velocities, along the rows of the last search: choose another scheme";
        return refuse("rows that turn".into(), reason);
    }
    let nonlinear = run.parts.system.linearity() == Linearity::Nonlinear;
    let damped = run.parts.system.damping_force().is_some();
    if nonlinear && damped && !run.parts.correctors.is_empty() {
        return refuse("nonlinear damping with a correction".into(), "the derivative of C is unknown");
    }
    let Simulation { compiled, state, history, .. } = run;
    if nonlinear && compiled.program.stages.iter().any(|stage| stage.along_path) {
        return refuse("forces along a path".into(), "choose another scheme");
    }
    if !compiled.program.operators.iter().all(Operator::is_symmetric) {
        return refuse("a linear solver that may be unsymmetric".into(), "choose `Automatic`");
    }
    let tangents = run.constraints.tangents();
    let slides_in_space = |row: usize| {
        let bound = T::of(tangents.friction(row)) * state.contacts.lambda[row];
        tangents.of(row).len() > 1
            && bound > T::zero()
            && slides(state.contacts.tangential(row, &state.contacts.lambda), bound)
    };
    if tangents.contacts().any(slides_in_space) {
        let reason = "its direction follows the initial velocities: let the bodies touch, or slide, later";
        return refuse("friction that slides along two tangents at the start".into(), reason);
    }
    let compliant = |row: usize| state.contacts.lambda[row] != T::zero() && run.constraints.laws()[row].is_compliant();
    if (0..run.constraints.len()).any(compliant) {
        return refuse("a compliant contact that carries a force at the start".into(), "let it touch in the run");
    }
    let past = match history.slots.get(1).filter(|_| history.known > 1) {
        None => StartingPast::Unknown,
        Some(past) if past.a.iter().all(|&a| a == T::zero()) => StartingPast::Straight,
        Some(_) => StartingPast::Expanded,
    };
    Ok(past)
}
