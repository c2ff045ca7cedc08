//! Hosts around the systems and solvers of others: they keep to themselves what is not required, or change what is
//! computed, or fail.

use contact_dynamics::faer::sparse::{SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::ranks::Ranks;
use contact_dynamics::{
    DampingForce, Factorization, LinearSolver, Linearity, Mass, Path, PathForce, Real, Result, System, TangentWeights,
};
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
    fn ranks(&self) -> Option<Arc<dyn Ranks<T>>> {
        self.system.ranks()
    }
}

/// A system whose every evaluation passes a hook, which may change the result or fail: `hook(method, t, out)`, with the
/// method as errors name it. The damping force has no t (NaN), `commit` no result. What the system says of itself
/// stays.
#[derive(Clone, Debug)]
pub struct Hooked<S, F> {
    system: S,
    linearity: Linearity,
    /// Forces along a path are those in its middle.
    along: bool,
    hook: F,
}

impl<S, F> Hooked<S, F> {
    /// This system with a hook.
    pub fn new<T: Real>(system: S, hook: F) -> Self
    where
        S: System<T>,
        F: FnMut(&'static str, f64, &mut [T]) -> Result<()> + Send,
    {
        Self { linearity: system.linearity(), system, along: false, hook }
    }

    /// Says this of itself.
    #[must_use]
    pub fn linearity(self, linearity: Linearity) -> Self {
        Self { linearity, ..self }
    }

    /// With a force along paths, which is that in the middle.
    #[must_use]
    pub fn along_paths(self) -> Self {
        Self { along: true, ..self }
    }

    fn pass<T: Real>(&mut self, method: &'static str, t: f64, out: &mut [T]) -> Result<()>
    where
        F: FnMut(&'static str, f64, &mut [T]) -> Result<()>,
    {
        let result = (self.hook)(method, t, out);
        if result.is_err() {
            // What a failed evaluation leaves is of no use.
            out.fill(T::nan());
        }
        result
    }
}

impl<T: Real, S: System<T>, F: FnMut(&'static str, f64, &mut [T]) -> Result<()> + Send> System<T> for Hooked<S, F> {
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
        self.system.force(t, u, v, out)?;
        self.pass("force", t, out)
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.system.pattern()
    }
    fn tangent(&mut self, t: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
        self.system.tangent(t, u, v, weights, out)?;
        self.pass("tangent", t, out)
    }
    fn path_force(&mut self) -> Option<&mut dyn PathForce<T>> {
        match self.along {
            true => Some(self),
            false => self.system.path_force(),
        }
    }
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
        match self.system.damping_force().is_some() {
            true => Some(self),
            false => None,
        }
    }
    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        self.system.potential_energy(u)
    }
    fn external_load(&mut self, t: f64, out: &mut [T]) -> Result<()> {
        self.system.external_load(t, out)?;
        self.pass("external_load", t, out)
    }
    fn highest_frequency(&mut self) -> Option<f64> {
        self.system.highest_frequency()
    }
    fn ranks(&self) -> Option<Arc<dyn Ranks<T>>> {
        self.system.ranks()
    }
    fn prescribed(&self) -> &[usize] {
        self.system.prescribed()
    }
    fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) -> Result<()> {
        self.system.prescribed_motion(t, out)?;
        self.pass("prescribed_motion", t, out.as_flattened_mut())
    }
    fn commit(&mut self, t: f64, u: &[T], v: &[T]) -> Result<()> {
        self.system.commit(t, u, v)?;
        self.pass("commit", t, &mut [])
    }
}

impl<T: Real, S: System<T>, F: FnMut(&'static str, f64, &mut [T]) -> Result<()> + Send> DampingForce<T>
    for Hooked<S, F>
{
    fn evaluate(&mut self, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        self.system.damping_force().expect("it was there").evaluate(u, v, out)?;
        self.pass("damping_force", f64::NAN, out)
    }
}

impl<T: Real, S: System<T>, F: FnMut(&'static str, f64, &mut [T]) -> Result<()> + Send> PathForce<T> for Hooked<S, F> {
    fn force_along(&mut self, t: f64, path: Path<'_, T>, v: &[T], out: &mut [T]) -> Result<()> {
        self.system.force(t, path.mean, v, out)?;
        self.pass("force_along", t, out)
    }
    fn tangent_along(
        &mut self,
        t: f64,
        path: Path<'_, T>,
        v: &[T],
        weights: TangentWeights<T>,
        out: &mut [T],
    ) -> Result<()> {
        self.system.tangent(t, path.mean, v, weights, out)?;
        self.pass("tangent_along", t, out)
    }
}

/// A system that says that it is nonlinear, whatever it is.
pub fn nonlinear<T: Real, S: System<T>>(system: S) -> impl System<T> + use<T, S> {
    Hooked::new(system, |_, _, _| Ok(())).linearity(Linearity::Nonlinear)
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
