//! Parts that a host brings: its system, its contacts and solvers, and how they are verified.

mod host;
mod verify;
