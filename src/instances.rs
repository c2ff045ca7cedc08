//! What most programs use of this crate in double precision, compiled with the crate under `--cfg shared_instances`.
//!
//! The repository sets it in `.cargo/config.toml`: its tests, examples and benches then link these functions instead of
//! compiling the generic code once more in each of them. Hosts do not compile this file. (The compiler shares generic
//! functions between crates at optimization levels 0 and 1 only.)

use crate::contact::{Capsule, Cone, Cuboid, Cylinder, GapFunction, Obstacle, Plane, Sphere};
#[cfg(feature = "mesh-contact")]
use crate::contact::{ClosedSurface, EdgeToEdge, Mortar, NodeToFacet, Tie};
use crate::contact_solver::{GaussSeidel, Pivoting};
use crate::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, Release, TaylorPapadopoulos, WorkBalance,
    ZeroAcceleration,
};
use crate::gradient::{Parameters, Scales};
use crate::observer::{ContactRecorder, DofRecorder, EnergyRecorder};
use crate::{
    ActiveSet, Automatic, ByBody, Cholesky, ConjugateGradients, ContactConstraint, ContactSolver, Corrector, Diagonal,
    LinearRows, LinearSolver, LinearSystem, Lu, NodesOnObstacle, Observer, PersistencyCorrection, Simulation,
    SimulationBuilder, System, Tridiagonal,
};

/// Conversions of each type to a trait object: compiling one compiles all methods of the trait for the type.
macro_rules! by_trait {
    ($object:ty: $($implementor:ty),* $(,)?) => {
        [$((|one: Box<$implementor>| -> Box<$object> { one }) as fn(Box<$implementor>) -> Box<$object> as *const ()),*]
    };
}

/// Addresses of functions; nobody calls it.
#[doc(hidden)]
pub fn instances() -> Vec<*const ()> {
    let mut all = vec![
        SimulationBuilder::<'static, f64>::build as *const (),
        Simulation::<'static, f64>::step as *const (),
        Simulation::<'static, f64>::run_until as *const (),
        Simulation::<'static, f64>::land_on as *const (),
        Simulation::<'static, f64>::energy as *const (),
        Simulation::<'static, f64>::momentum as *const (),
        Simulation::<'static, f64>::reactions as *const (),
        Simulation::<'static, f64>::restart as *const (),
        Simulation::<'static, f64>::set_step_size as *const (),
        Simulation::<'static, f64>::record as *const (),
        Simulation::<'static, f64>::record_checkpoints as *const (),
        Simulation::<'static, f64>::gradient as *const (),
    ];
    #[cfg(feature = "serde")]
    all.extend([
        Simulation::<'static, f64>::checkpoint as *const (),
        SimulationBuilder::<'static, f64>::resume_from as *const (),
    ]);
    all.extend(by_trait!(dyn System<f64>: LinearSystem<'static, f64>));
    all.extend(by_trait!(dyn ContactConstraint<f64>:
        LinearRows<'static, f64>, NodesOnObstacle<'static, f64, 2>, NodesOnObstacle<'static, f64, 3>,
        GapFunction<'static, f64>));
    #[cfg(feature = "mesh-contact")]
    all.extend(by_trait!(dyn ContactConstraint<f64>:
        NodeToFacet<f64>, EdgeToEdge<f64>, Mortar<f64>, Tie<f64>));
    all.extend(by_trait!(dyn Obstacle<f64, 2>:
        Plane<f64, 2>, Sphere<f64, 2>, Cuboid<f64, 2>, Capsule<f64, 2>));
    all.extend(by_trait!(dyn Obstacle<f64, 3>:
        Plane<f64, 3>, Sphere<f64, 3>, Cuboid<f64, 3>, Capsule<f64, 3>, Cylinder<f64>, Cone<f64>));
    #[cfg(feature = "mesh-contact")]
    all.extend(by_trait!(dyn Obstacle<f64, 2>: ClosedSurface<f64, 2>));
    #[cfg(feature = "mesh-contact")]
    all.extend(by_trait!(dyn Obstacle<f64, 3>: ClosedSurface<f64, 3>));
    all.extend(by_trait!(dyn ContactSolver<f64>:
        ActiveSet<f64>, GaussSeidel<f64>, Pivoting<f64>));
    all.extend(by_trait!(dyn LinearSolver<f64>:
        Automatic, ByBody<'static, f64>, Cholesky, ConjugateGradients, Diagonal, Lu, Tridiagonal));
    all.extend(by_trait!(dyn Corrector<f64>:
        ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, PersistencyCorrection, Release,
        TaylorPapadopoulos, WorkBalance, ZeroAcceleration));
    all.extend(by_trait!(dyn Parameters<f64>: (), Scales<f64>));
    all.extend(by_trait!(dyn Observer<f64>: ContactRecorder<f64>, DofRecorder<f64>, EnergyRecorder<f64>));
    all
}
