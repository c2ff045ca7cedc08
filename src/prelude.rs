//! The names that a first program needs: `use contact_dynamics::prelude::*;`.

#[cfg(feature = "mesh-contact")]
pub use crate::contact::{BodyContact, Facet, Tie};
pub use crate::contact::{ContactConstraint, ContactLaw, LinearRows, NodesOnObstacle, Plane, Sphere};
pub use crate::error::{Error, Result};
pub use crate::integrator::{GeneralizedAlpha, TimeIntegrator};
pub use crate::matrix::{self, Stored};
pub use crate::observer::{ContactRecorder, DofRecorder, EnergyRecorder, Observer};
pub use crate::preset::Preset;
pub use crate::simulation::{Simulation, StepControl};
pub use crate::system::{LinearSystem, System};
pub use faer::sparse::{SparseColMat, Triplet};
