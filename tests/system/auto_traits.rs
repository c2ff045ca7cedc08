//! What a host may move to another thread, and what it may share between threads; checked by the compiler.

use contact_dynamics::contact::ContactId;
use contact_dynamics::contact_solver::{ContactFailure, GaussSeidel, Pivoting};
use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, Release, TaylorPapadopoulos, ZeroAcceleration,
};
use contact_dynamics::observer::{ContactRecorder, DofRecorder, EnergyRecorder};
use contact_dynamics::partitioned::{Assembled, Assembly, Coupling};
use contact_dynamics::tableau::{Momentum, Row, Rows, Stage, Tableau};
use contact_dynamics::{
    ActiveSet, Automatic, Bathe, Bdf2, ByBody, CdLagrange, CentralDifference, Cholesky, ChungLee, Composite,
    ConjugateGradients, ContactState, Diagonal, Energy, EnergyMomentum, Error, GeneralizedAlpha, Gssss, History,
    Houbolt, HulbertChung, JumpProjection, LinearSystem, Lu, Mass, MoreauJean, Newmark, Newton, NohBathe, Oalts, Park,
    PersistencyCorrection, Preset, Simulation, SimulationBuilder, State, Statistics, StepControl, StepView,
    TangentWeights, TchamwaWielgosz, Tridiagonal, Works,
};

fn shared<T: Send + Sync>() {}
fn moved<T: Send>() {}

#[test]
fn values_are_moved_and_shared() {
    // What a run leaves, and what it is described by.
    shared::<State<f64>>();
    shared::<State<f32>>();
    shared::<ContactState<f64>>();
    shared::<ContactId>();
    shared::<History<f64>>();
    shared::<History<f32>>();
    shared::<Statistics>();
    shared::<Energy<f64>>();
    shared::<Works<f64>>();
    shared::<StepView<'static, f64>>();
    shared::<Error>();
    shared::<ContactFailure<f64>>();
    shared::<Tableau>();
    shared::<Stage>();
    shared::<Rows>();
    shared::<Row>();
    shared::<Momentum>();
    shared::<Mass<'static, f64>>();
    shared::<TangentWeights<f64>>();
    shared::<Newton>();
    shared::<StepControl>();
    shared::<Preset>();
}

#[test]
fn parts_of_the_crate_are_moved_and_shared() {
    shared::<DofRecorder<f64>>();
    shared::<ContactRecorder<f64>>();
    shared::<EnergyRecorder<f64>>();
    shared::<(Composite, Newmark, GeneralizedAlpha, Bathe, Gssss, Houbolt, Park, Bdf2, Oalts, NohBathe)>();
    shared::<(CentralDifference, CdLagrange, ChungLee, HulbertChung, TchamwaWielgosz, MoreauJean, EnergyMomentum)>();
    shared::<(PersistencyCorrection, ContactImplicit, ContactStabilized, LaursenLove, Release)>();
    shared::<(TaylorPapadopoulos, ZeroAcceleration, NonsmoothSplitting)>();
    shared::<(Automatic, Cholesky, Diagonal, Tridiagonal, Lu, ConjugateGradients)>();
    shared::<(ActiveSet<f64>, Pivoting<f64>, GaussSeidel)>();
    shared::<(Assembled<f64>, Coupling<f64>)>();
}

/// These hold parts of the host, which are `Send` and need not be `Sync`.
#[test]
fn runs_are_moved() {
    moved::<Simulation<'static, f64>>();
    moved::<SimulationBuilder<'static, f64>>();
    moved::<LinearSystem<'static, f64>>();
    moved::<(JumpProjection<f64>, Assembly<f64>, ByBody<'static, f64>)>();
}
