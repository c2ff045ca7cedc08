//! Contact constraints and laws: gaps and their derivatives, what passes and what does not, what laws do in a run.

mod bipenalty;
mod bodies;
mod bonds;
#[cfg(feature = "mesh-contact")]
mod by_chance;
mod constraints;
mod curved;
mod curved_patch;
mod dashpots;
mod dual;
mod edges;
mod folded_strip;
mod gap_function;
mod hertz;
mod itself;
mod laws;
mod mortar;
mod node_to_facet;
mod non_penetration;
mod observers;
mod obstacles;
mod offsets;
mod passing_through;
mod pounding;
mod rate_laws;
mod searches;
mod second_order;
#[cfg(feature = "mesh-contact")]
mod shapes;
mod surfaces;
mod ties;
mod turning;
mod two_bodies;
mod walls;
