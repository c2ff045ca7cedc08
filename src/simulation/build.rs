//! What is put together before a run: its parts are checked against one another, and the scheme is compiled.
//!
//! - `builder`: every input is checked; `settings`: settings as files hold them.
//! - `pairing`, `admitted`: which scheme, corrections, contact laws and contact solver go together.
//! - `scheme`, `derived`: the scheme and what follows from its rows alone.
//! - `program`: the scheme compiled for one system and one step size.
//! - `workspace`: the memory of the steps.

pub(super) mod admitted;
pub(super) mod builder;
pub(super) mod derived;
pub(super) mod pairing;
pub(super) mod program;
pub(super) mod scheme;
#[cfg(feature = "serde")]
pub(super) mod settings;
pub(super) mod workspace;
