//! The contact of a stage before its problem is solved: where it is imposed, the quantities that rows constrain
//! there, and the forces of compliant laws that do not depend on the unknown.
//!
//! In the order of execution:
//!
//! - `target`: where contact is imposed, and which rows may carry a force there.
//! - `solve`: solves the contact problem, and solves it again with rows linearized at its result.
//! - `laws`: gaps and rates of compliant laws, restitution.
//! - `multipliers`: the multipliers of the rows in the problem.
//! - `curved`: rows that turn within the stage.
//! - `closing`: which contacts are closed at the end, their forces and impulses.

pub(in crate::simulation) mod closing;
pub(in crate::simulation) mod curved;
pub(in crate::simulation) mod laws;
pub(in crate::simulation) mod multipliers;
pub(in crate::simulation) mod solve;
pub(in crate::simulation) mod target;

use crate::simulation::operator::interface::InterfaceWork;
use crate::simulation::rows::contact_rows::ContactRowsWork;
use crate::simulation::run::impulses::Impulses;
use crate::state::ContactState;

/// Memory of the contact of a step.
pub(crate) struct ContactWork<T> {
    pub(crate) interface: InterfaceWork<T>,
    pub(crate) rows: ContactRowsWork<T>,
    /// The contacts of the step that is being tried.
    pub(crate) trial: ContactState<T>,
    pub(crate) impulses: Impulses<T>,
    /// Closed flags at the start of the step.
    pub(crate) closed_at_start: Vec<bool>,
    /// Which contacts exerted a force at the start of the step.
    pub(crate) exerting_at_start: Vec<bool>,
    /// Forces of all rows at the start of the step, and which contacts slid there; empty without friction.
    pub(crate) forces_at_start: Vec<T>,
    pub(crate) sliding_at_start: Vec<bool>,
    /// Closed flags before the present stage.
    pub(crate) was_closed: Vec<bool>,
    /// Which contacts stuck before the present stage; empty without friction.
    pub(crate) was_sticking: Vec<bool>,
}
