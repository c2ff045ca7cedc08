//! Contact solvers, on their own and in runs whose rows contradict each other.

mod solvers;
mod squeezes;
