//! Whether the parts of a run are compatible: the scheme with dofs without mass, with corrections, damping and paths,
//! and with an estimate of the local error.

use crate::analysis::{self, LocalError};
use crate::corrector::{Corrector, PersistencyCorrection, Requirements, WorkBalance};
use crate::error::{Error, Result};
use crate::integrator::TimeIntegrator;
use crate::real::Real;
use crate::rounding::COEFFICIENT;
use crate::simulation::build::law_support::ListedCorrector;
use crate::simulation::build::scheme::Scheme;
use crate::simulation::rows::constraints::Constraints;
use crate::state::Motion;
use crate::system::System;
use crate::tableau::{ContactLevel, Tableau};

/// Refuses dofs without mass if the scheme leaves their displacement undetermined, or its errors undamped. Returns
/// whether they follow statically before the other dofs move.
pub(crate) fn check_massless(scheme: &Scheme<'_>, dof: Option<&usize>) -> Result<bool> {
    let Some(dof) = dof else { return Ok(false) };
    let reason = match analysis::massless_factor(&scheme.tableau) {
        Some(factor) if factor.abs() < 1.0 - COEFFICIENT => return Ok(false),
        Some(_) => {
            "its balance holds halfway, where an error in the displacement of a dof without mass alternates forever; \
             choose a scheme that damps high frequencies, or give the dof a mass"
        }
        None if analysis::massless_follow(&scheme.tableau) => return Ok(true),
        None => {
            "its balance does not determine the displacement of a dof without mass at the end of the step; choose \
             central differences or an implicit scheme, or give the dof a mass"
        }
    };
    Err(Error::Incompatible { part: format!("{} with dof {dof} without mass", scheme.integrator.name()), reason })
}

/// Refuses corrections of contact that is not imposed on the displacements of the state, and ineffective corrections.
pub(crate) fn check_corrections<T: Real>(
    integrator: &dyn TimeIntegrator,
    tableau: &Tableau,
    system: &mut dyn System<T>,
    correctors: &[ListedCorrector],
) -> Result<()> {
    let level = tableau.stages.iter().find_map(|stage| match stage.contact {
        ContactLevel::POSITION => None,
        ContactLevel::Position { .. } => {
            Some("the scheme imposes contact ahead of the state, whose velocity still approaches")
        }
        ContactLevel::Velocity { .. } => {
            Some("the scheme imposes contact on velocities, which leaves no jump to correct")
        }
    });
    let damped = system.damping_force().is_some();
    for corrector in correctors {
        let Requirements { scheme, damping, .. } = corrector.requirements;
        let scheme = match level {
            Some(reason) if !corrector.effects.corrects_massless => Err(reason),
            _ => scheme,
        };
        if let Err(reason) = scheme.and(if damped { damping } else { Ok(()) }) {
            let part = format!("the correction {} with {}", corrector.name, integrator.name());
            return Err(Error::Incompatible { part, reason });
        }
    }
    Ok(())
}

/// The numbers that estimate the local error of a scheme; refused if the estimate would not contain contact.
pub(crate) fn local_error(scheme: &Scheme<'_>, may_press: bool) -> Result<LocalError> {
    let ahead = scheme.tableau.stages.iter().any(|stage| stage.contact.lead() > 0.0);
    let refuse = |reason| {
        let part = format!("an estimate of the local error with {}", scheme.integrator.name());
        Err(Error::Incompatible { part, reason })
    };
    if may_press && ahead {
        return refuse(
            "the scheme imposes contact ahead of the state, where the step in which it happens does not show it",
        );
    }
    match analysis::local_error(&scheme.tableau) {
        Some(error) => Ok(error),
        None => refuse("what it errs in velocity does not show in one step"),
    }
}

/// Refuses systems that have neither a potential nor a force of their own for paths.
pub(crate) fn check_path<T: Real>(system: &mut dyn System<T>, scheme: &Scheme<'_>, motion: &Motion<T>) -> Result<()> {
    match system.path_force().is_some() || system.potential_energy(&motion.u).is_some() {
        true => Ok(()),
        false => Err(Error::Incompatible {
            part: scheme.integrator.name(),
            reason: "the system gives neither a potential energy nor a force along paths, so its energy is not defined",
        }),
    }
}

/// Refuses schemes that evaluate damping at the start of the step and are then unstable at every step size.
pub(crate) fn check_lagged_damping<T: Real>(
    integrator: &dyn TimeIntegrator,
    tableau: &Tableau,
    system: &mut dyn System<T>,
) -> Result<()> {
    let lags = tableau.stages.iter().all(|stage| stage.balance.v.z == 0.0);
    let grows = || analysis::spectral_radius(tableau, 0.1, 0.01) > 1.0 + COEFFICIENT;
    if lags && grows() && system.damping_force().is_some() {
        return Err(Error::Incompatible {
            part: integrator.name(),
            reason: "it takes damping forces from the start of the step, which makes it unstable for every step \
                     size; choose a member with more numerical damping",
        });
    }
    Ok(())
}

/// The correctors of a run that chooses none: for jumps, and for contacts without mass, where there are any.
pub(crate) fn default_corrections<'a, T: Real>(
    tableau: &Tableau,
    constraints: &Constraints<'_, T>,
    massless: &[usize],
) -> Vec<Box<dyn Corrector<T> + 'a>> {
    let mut correctors: Vec<Box<dyn Corrector<T> + 'a>> = Vec::new();
    if is_correctable(tableau, constraints, massless) {
        correctors.push(Box::new(PersistencyCorrection::with_history_projection()));
    }
    if is_balanceable(tableau, constraints, massless) {
        correctors.push(Box::new(WorkBalance));
    }
    correctors
}

/// Whether there may be jumps to correct: contact on displacements of the state, by a rigid law (or not known yet),
/// on dofs with mass.
fn is_correctable<T: Real>(tableau: &Tableau, constraints: &Constraints<'_, T>, massless: &[usize]) -> bool {
    let has_mass = |dof: &usize| massless.binary_search(dof).is_err();
    tableau.stages.iter().all(|stage| stage.contact == ContactLevel::POSITION)
        && constraints.may_press()
        && (constraints.len() == 0
            || constraints.laws().iter().any(|law| law.is_plain() || law.restitution().is_some()))
        && constraints.interface().iter().any(has_mass)
}

/// Whether the work of contacts without mass is balanced by default: contact dofs have none, and the scheme conserves
/// energy except in steps in which contacts close or open.
fn is_balanceable<T: Real>(tableau: &Tableau, constraints: &Constraints<'_, T>, massless: &[usize]) -> bool {
    let has_none = |dof: &usize| massless.binary_search(dof).is_ok();
    constraints.may_press() && constraints.interface().iter().any(has_none) && analysis::steps_by_means(tableau)
}
