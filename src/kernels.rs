//! The loops that dominate the run time, generic over the scalar only; `crate::real` instantiates them for `f32` and
//! `f64`.

pub(crate) mod chain;
pub(crate) mod cholesky;
pub(crate) mod coarse;
pub(crate) mod conjugate_gradients;
pub(crate) mod dense;
pub(crate) mod elimination;
pub(crate) mod forest;
pub(crate) mod inertia;
pub(crate) mod interleaved_sweep;
pub(crate) mod lu;
pub(crate) mod plan;
pub(crate) mod product;
pub(crate) mod supernodal;
pub(crate) mod sweep;
pub(crate) mod vector;
