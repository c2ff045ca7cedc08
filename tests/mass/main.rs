//! Masses: lumped, blended, redistributed, singular and reciprocal ones.

mod blend;
mod consistent;
mod reciprocal;
mod redistribution;
