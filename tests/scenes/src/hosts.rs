//! Hosts that keep to themselves what a system or a solver could tell beyond what is required.

use contact_dynamics::faer::sparse::{SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{Factorization, LinearSolver, Linearity, Mass, Real, Result, System, TangentWeights};
use std::sync::{Arc, Mutex};

/// A system without all that a host may leave out: energy, damping force, load and supports; nonlinear for all it says.
#[derive(Clone, Debug)]
pub struct Bare<S> {
    system: S,
    linearity: Linearity,
    /// The empty pattern of a host without tangent.
    empty: Option<SymbolicSparseColMat<usize>>,
}

impl<S> Bare<S> {
    /// With force, mass and tangent of this system.
    pub fn new(system: S) -> Self {
        Self { system, linearity: Linearity::Nonlinear, empty: None }
    }

    /// A linear system of n dofs with its force and mass alone, without any tangent.
    pub fn force_alone(system: S, n: usize) -> Self {
        let empty = SymbolicSparseColMat::new_checked(n, n, vec![0; n + 1], None, Vec::new());
        Self { system, linearity: Linearity::Linear, empty: Some(empty) }
    }
}

impl<T: Real, S: System<T>> System<T> for Bare<S> {
    fn dofs(&self) -> usize {
        self.system.dofs()
    }
    fn linearity(&self) -> Linearity {
        self.linearity
    }
    fn mass(&self) -> Mass<'_, T> {
        self.system.mass()
    }
    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        self.system.force(t, u, v, out)
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.empty.as_ref().map_or_else(|| self.system.pattern(), SymbolicSparseColMat::as_ref)
    }
    fn tangent(&mut self, t: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
        assert!(self.empty.is_none(), "there is no tangent");
        self.system.tangent(t, u, v, weights, out)
    }
}

/// A solver without its condensation. It notes the dofs of the matrices that it has analyzed.
#[derive(Clone, Debug, Default)]
pub struct Uncondensed<L> {
    solver: L,
    /// Dofs of each matrix.
    pub analyzed: Arc<Mutex<Vec<usize>>>,
}

impl<L> Uncondensed<L> {
    /// Of this solver.
    pub fn new(solver: L) -> Self {
        Self { solver, analyzed: Arc::default() }
    }
}

impl<T: Real, L: LinearSolver<T>> LinearSolver<T> for Uncondensed<L> {
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>, _: &[usize]) -> Result<Box<dyn Factorization<T>>> {
        self.analyzed.lock().expect("no panic before").push(pattern.ncols());
        Ok(Box::new(UncondensedFactor(self.solver.analyze(pattern, &[])?)))
    }
}

#[derive(Debug)]
struct UncondensedFactor<T: Real>(Box<dyn Factorization<T>>);

impl<T: Real> Factorization<T> for UncondensedFactor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        self.0.factorize(a)
    }
    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        self.0.solve(rhs)
    }
    fn stored_values(&self) -> usize {
        self.0.stored_values()
    }
}
