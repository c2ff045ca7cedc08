//! The assembly of a run: its parts are checked against one another, and the scheme is compiled.
//!
//! - `builder`: checks every input.
//! - `pairing`, `law_support`: which schemes, corrections, contact laws and contact solvers are compatible.
//! - `scheme`, `derived`: the scheme and the numbers derived from its rows.
//! - `program`: the scheme compiled for one system and one step size.
//! - `workspace`: the memory of the steps.

pub(super) mod builder;
pub(super) mod derived;
pub(super) mod law_support;
pub(super) mod pairing;
pub(super) mod program;
pub(super) mod scheme;
pub(super) mod workspace;
