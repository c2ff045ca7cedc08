//! Parts that a host brings: its system, its contacts and solvers, and how they are verified.

mod auto_traits;
mod forwarding;
mod host;
mod host_errors;
mod verify;
