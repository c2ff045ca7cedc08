//! Gradients of runs: against differences of whole runs, and against closed forms.

mod closed_forms;
mod many;
mod meshes;
mod refused;
mod scenes;
mod throw;
