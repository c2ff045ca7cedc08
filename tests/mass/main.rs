//! Masses: lumped, blended, redistributed, singular and reciprocal ones.

mod blend;
mod reciprocal;
mod redistribution;
