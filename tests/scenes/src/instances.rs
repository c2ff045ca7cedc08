//! What tests use of the crate in single precision, compiled with this package under `--cfg shared_instances`, as
//! `src/instances.rs` of the crate does it in double precision: here, so that the crate itself builds as fast as before.

use contact_dynamics::contact::{ContactConstraint, GapFunction, LinearRows, NodesOnObstacle};
use contact_dynamics::contact_solver::{ActiveSet, ContactSolver, GaussSeidel, Pivoting};
use contact_dynamics::corrector::{LaursenLove, NonsmoothSplitting, Release};
use contact_dynamics::{
    Automatic, Cholesky, ConjugateGradients, Corrector, Diagonal, LinearSolver, LinearSystem, Lu,
    PersistencyCorrection, Simulation, SimulationBuilder, System, Tridiagonal,
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
        SimulationBuilder::<'static, f32>::build as *const (),
        Simulation::<'static, f32>::step as *const (),
        Simulation::<'static, f32>::run_until as *const (),
        Simulation::<'static, f32>::energy as *const (),
        Simulation::<'static, f32>::momentum as *const (),
    ];
    all.extend(by_trait!(dyn System<f32>: LinearSystem<'static, f32>));
    all.extend(by_trait!(dyn ContactConstraint<f32>:
        LinearRows<'static, f32>, NodesOnObstacle<'static, f32, 2>, GapFunction<'static, f32>));
    all.extend(by_trait!(dyn ContactSolver<f32>:
        ActiveSet<f32>, GaussSeidel<f32>, Pivoting<f32>));
    all.extend(by_trait!(dyn LinearSolver<f32>:
        Automatic, Cholesky, ConjugateGradients, Diagonal, Lu, Tridiagonal));
    all.extend(by_trait!(dyn Corrector<f32>: LaursenLove, NonsmoothSplitting, PersistencyCorrection, Release));
    all
}
