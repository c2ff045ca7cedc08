//! Bodies over ranks, which are threads here: the same motion as in one piece, and failures of which all hear.

mod bodies;
mod equal;
mod failures;
mod refusals;
