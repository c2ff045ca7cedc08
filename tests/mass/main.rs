//! Masses: lumped, blended, redistributed and singular ones.

mod blend;
mod consistent;
mod redistribution;
