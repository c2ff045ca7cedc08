//! Contact solvers, on their own and in runs whose rows contradict each other.

mod friction;
mod many_rows;
mod solvers;
mod squeezes;
mod without_w;
