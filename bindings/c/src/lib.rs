//! The crate for C and C++; cbindgen makes the header include/contact_dynamics.h of these functions.
//!
//! - `model`: models, their matrices, supports, loads and settings; `contact`: their contacts.
//! - `run`: steps and results.
//! - `named`: schemes, laws, corrections and solvers by name.
//! - `callback`: calls of the host's functions; `memory`: its arrays, strings and handles.
//! - `error`: status, message, and the end of a panic.
//!
//! Unsafe functions ask of their pointers what the head of the header promises. They end in `memory` and `callback`.

mod callback;
mod contact;
mod error;
mod memory;
mod model;
mod named;
mod run;
