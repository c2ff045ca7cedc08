//! The contact rows: gaps of all constraints as one list, and the quantity that a stage constrains in each row.
//!
//! - `constraints`, `part`, `laws`: all constraints as one list of rows, each constraint with its dofs, and their laws.
//! - `gaps`, `rate_differences`: gaps of all rows and their rates.
//! - `gap_offsets`: overlaps at the start, and the limit of penetration recovered in a step.
//! - `contact_rows`: the quantity that each gap row constrains in a stage; `slip`: the same for tangential rows;
//!   `curved_rows`: gaps that are not linear in the displacements; `massless_rows`: rows on dofs without mass.
//! - `row_state`: whether a row may carry a force, is in the contact problem, and is closed.
//! - `problem_rows`: the rows of the contact problem, and its data.

pub(super) mod constraints;
pub(super) mod contact_rows;
pub(super) mod curved_rows;
pub(super) mod gap_offsets;
pub(super) mod gaps;
pub(super) mod laws;
pub(super) mod massless_rows;
pub(super) mod part;
pub(super) mod problem_rows;
pub(super) mod rate_differences;
pub(super) mod row_state;
pub(super) mod slip;
