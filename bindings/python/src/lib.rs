//! `contact_dynamics._core`: the crate for the Python package in the folder python/, whose classes describe the input.
//!
//! - `run`: a simulation, its state and its steps; `record`: the recorded columns.
//! - `system`, `contact`: systems, constraints and obstacles from their descriptions in Python.
//! - `named`: schemes, laws, corrections and solvers by name.
//! - `arrays`: arrays of NumPy and sparse matrices of SciPy; `callback`: calls of Python functions.
//! - `error`: the crate's errors as exceptions.

mod arrays;
mod callback;
mod contact;
mod error;
mod named;
mod record;
mod run;
mod system;

#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::contact::outer_facets;
    #[pymodule_export]
    use crate::error::{ContactDynamicsError, Inadmissible};
    #[pymodule_export]
    use crate::run::Run;
    #[pymodule_export]
    use crate::system::preset_mass;
}
