//! Gradients of runs: against differences of whole runs, and against closed forms.

mod differences;
