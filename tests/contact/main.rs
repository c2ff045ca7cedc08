//! Contact constraints and laws: gaps and their derivatives, what passes and what does not, what laws do in a run.

mod bipenalty;
mod constraints;
mod curved;
mod edges;
mod gap_function;
mod laws;
mod mortar;
mod node_to_facet;
mod obstacles;
mod passing_through;
mod pounding;
mod rate_laws;
mod two_bodies;
