//! Which schemes with which corrections and masses claim to handle what.

use contact_dynamics::{Composite, Newmark, Preset};
use contact_dynamics_scenes::combinations::{Combination, Correction, Make, listed, plain, preset};
use contact_dynamics_scenes::masses::{Takers, Treatment};
use contact_dynamics_scenes::schemes::{self, Listed};

const COMPOSITE: Make = || Ok(Box::new(Composite));

/// λ_v/λ_a with the projected past, after every scheme of second order that takes corrections. (Backward Euler and its
/// like smear the fronts that are measured here.)
pub(crate) fn corrected() -> Vec<Combination> {
    with(Correction::History)
}

/// Another correction after the same schemes.
pub(crate) fn with(correction: Correction) -> Vec<Combination> {
    let second = schemes::correctable().filter(|scheme| scheme.order == 2);
    second.map(|scheme| Combination { correction, ..listed(&scheme) }).collect()
}

pub(crate) fn presets() -> Vec<Combination> {
    let tapered = Treatment::RedistributedBlend(Takers::Tapered);
    [Preset::smooth(), Preset::conservative(), Preset::explicit()].map(|of| preset(COMPOSITE, tapered, of)).into()
}

/// Contact dofs without mass, no correction: every scheme of second order that imposes contact by a multiplier.
pub(crate) fn massless(takers: Takers) -> Vec<Combination> {
    let schemes = schemes::all().into_iter().filter(|scheme| scheme.order == 2 && scheme.takes_multipliers());
    let mass = |scheme: &Listed| match scheme.radius {
        Some(_) => Treatment::RedistributedBlend(takers),
        None => Treatment::Redistributed(takers),
    };
    schemes.map(|scheme| Combination { mass: mass(&scheme), ..listed(&scheme) }).collect()
}

/// Schemes that impose contact ahead of the state or on velocities, of second order: nothing is left to correct.
pub(crate) fn ahead() -> Vec<Combination> {
    let schemes = schemes::all().into_iter();
    let ahead = schemes.filter(|scheme| scheme.order == 2 && scheme.takes_multipliers() && !scheme.takes_corrections());
    ahead.map(|scheme| listed(&scheme)).collect()
}

/// All that gives clean forces.
pub(crate) fn clean() -> Vec<Combination> {
    [corrected(), presets(), massless(Takers::Tapered)].concat()
}

/// One scheme with a correction.
pub(crate) fn trapezoidal(correction: Correction) -> Combination {
    Combination { correction, ..plain(|| Ok(Box::new(Newmark::trapezoidal()))) }
}

/// The paper's scheme with a correction.
pub(crate) fn paper(correction: Correction) -> Combination {
    Combination { correction, ..plain(COMPOSITE) }
}
