//! Whole runs beside a second, slow implementation of the time step.

mod explore;
