//! Linear solvers: solutions, elimination orders, what they refuse, and runs with them.

mod conjugate_gradients;
mod factors;
mod lu;
mod ordering;
