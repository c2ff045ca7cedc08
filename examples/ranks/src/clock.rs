//! Where the time of a step goes: forces and tangents of the host, the linear solver, messages, and the rest, which is
//! contact and the scheme; and what is sent.

use contact_dynamics::faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use contact_dynamics::ranks::Ranks;
use contact_dynamics::{
    Condensation, DampingForce, Factorization, LinearSolver, Linearity, Mass, Path, PathForce, Result, System,
    TangentWeights,
};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// What a rank is busy with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Contact, and vectors of the scheme.
    Rest,
    /// Forces, energies and tangents of the host.
    Forces,
    /// Factorizations and solves, with the messages of MUMPS and PETSc, without those of this host.
    Solver,
    /// Messages of this host, waiting included.
    Messages,
}

/// The clock of one rank. Every instant belongs to one phase: that which was entered last and has not ended.
#[derive(Debug)]
pub struct Clock(Mutex<Running>);

#[derive(Debug)]
struct Running {
    phase: Phase,
    since: Instant,
    spent: Spent,
}

/// What was spent, from one time on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spent {
    /// Seconds by phase.
    pub seconds: [f64; 4],
    /// Bytes that this rank has sent, and in how many calls.
    pub bytes: f64,
    pub calls: f64,
    /// Iterations of linear solvers.
    pub iterations: f64,
}

impl Clock {
    pub fn new() -> Self {
        Self(Mutex::new(Running { phase: Phase::Rest, since: Instant::now(), spent: Spent::default() }))
    }

    fn switch(&self, to: Phase, sent: Option<usize>) -> Phase {
        let mut running = self.0.lock().unwrap();
        let (from, now) = (running.phase, Instant::now());
        running.spent.seconds[from as usize] += now.duration_since(running.since).as_secs_f64();
        (running.phase, running.since) = (to, now);
        if let Some(numbers) = sent {
            running.spent.bytes += 8.0 * numbers as f64;
            running.spent.calls += 1.0;
        }
        from
    }

    /// The time of a call.
    pub fn during<R>(&self, phase: Phase, call: impl FnOnce() -> R) -> R {
        let before = self.switch(phase, None);
        let result = call();
        self.switch(before, None);
        result
    }

    /// A message of so many numbers.
    pub fn sending<R>(&self, numbers: usize, call: impl FnOnce() -> R) -> R {
        let before = self.switch(Phase::Messages, Some(numbers));
        let result = call();
        self.switch(before, None);
        result
    }

    /// Iterations of a solve.
    pub fn iterated(&self, iterations: usize) {
        self.0.lock().unwrap().spent.iterations += iterations as f64;
    }

    /// What was spent from the last time on.
    pub fn take(&self) -> Spent {
        let phase = self.0.lock().unwrap().phase;
        self.switch(phase, None);
        std::mem::take(&mut self.0.lock().unwrap().spent)
    }
}

/// A system or a solver whose time is measured.
#[derive(Debug)]
pub struct Timed<P> {
    pub part: P,
    pub clock: Arc<Clock>,
}

impl<P> Timed<P> {
    fn forces<R>(&mut self, call: impl FnOnce(&mut P) -> R) -> R {
        let Self { part, clock } = self;
        clock.during(Phase::Forces, || call(part))
    }

    fn solver<R>(&mut self, call: impl FnOnce(&mut P) -> R) -> R {
        let Self { part, clock } = self;
        clock.during(Phase::Solver, || call(part))
    }
}

impl<S: System<f64>> System<f64> for Timed<S> {
    fn dofs(&self) -> usize {
        self.part.dofs()
    }
    fn linearity(&self) -> Linearity {
        self.part.linearity()
    }
    fn mass(&self) -> Mass<'_, f64> {
        self.part.mass()
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        self.forces(|system| system.force(t, u, v, out))
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.part.pattern()
    }
    fn tangent(&mut self, t: f64, u: &[f64], v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        self.forces(|system| system.tangent(t, u, v, w, out))
    }
    fn path_force(&mut self) -> Option<&mut dyn PathForce<f64>> {
        self.part.path_force().is_some().then_some(self)
    }
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<f64>> {
        self.part.damping_force().is_some().then_some(self)
    }
    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        self.forces(|system| system.potential_energy(u))
    }
    fn external_load(&mut self, t: f64, out: &mut [f64]) -> Result<()> {
        self.forces(|system| system.external_load(t, out))
    }
    fn highest_frequency(&mut self) -> Option<f64> {
        self.forces(System::highest_frequency)
    }
    fn ranks(&self) -> Option<Arc<dyn Ranks<f64>>> {
        self.part.ranks()
    }
    fn prescribed(&self) -> &[usize] {
        self.part.prescribed()
    }
    fn prescribed_motion(&mut self, t: f64, out: &mut [[f64; 3]]) -> Result<()> {
        self.forces(|system| system.prescribed_motion(t, out))
    }
    fn commit(&mut self, t: f64, u: &[f64], v: &[f64]) -> Result<()> {
        self.forces(|system| system.commit(t, u, v))
    }
}

impl<S: System<f64>> PathForce<f64> for Timed<S> {
    fn force_along(&mut self, t: f64, path: Path<'_, f64>, v: &[f64], out: &mut [f64]) -> Result<()> {
        self.forces(|system| system.path_force().expect("it was there").force_along(t, path, v, out))
    }
    fn tangent_along(
        &mut self,
        t: f64,
        path: Path<'_, f64>,
        v: &[f64],
        weights: TangentWeights<f64>,
        out: &mut [f64],
    ) -> Result<()> {
        self.forces(|system| system.path_force().expect("it was there").tangent_along(t, path, v, weights, out))
    }
}

impl<S: System<f64>> DampingForce<f64> for Timed<S> {
    fn evaluate(&mut self, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        self.forces(|system| system.damping_force().expect("it was there").evaluate(u, v, out))
    }
}

impl<L: LinearSolver<f64>> LinearSolver<f64> for Timed<L> {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<f64>>> {
        let part = self.clock.during(Phase::Solver, || self.part.analyze(pattern, last))?;
        Ok(Box::new(Timed { part, clock: self.clock.clone() }))
    }
    fn spans_ranks(&self) -> bool {
        self.part.spans_ranks()
    }
}

type Inner = Box<dyn Factorization<f64>>;

impl Factorization<f64> for Timed<Inner> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<()> {
        self.solver(|part| part.factorize(a))
    }
    fn solve(&mut self, rhs: &mut [f64]) -> Result<()> {
        let solved = self.solver(|part| part.solve(rhs));
        self.clock.iterated(self.part.iterations());
        solved
    }
    fn release(&mut self) {
        self.part.release();
    }
    fn stored_values(&self) -> usize {
        self.part.stored_values()
    }
    fn is_symmetric(&self) -> bool {
        self.part.is_symmetric()
    }
    fn iterations(&self) -> usize {
        self.part.iterations()
    }
    fn condensation(&mut self) -> Option<&mut dyn Condensation<f64>> {
        self.part.condensation().is_some().then_some(self)
    }
}

impl Timed<Inner> {
    fn condensed<R>(&mut self, call: impl FnOnce(&mut dyn Condensation<f64>) -> R) -> R {
        self.solver(|part| call(part.condensation().expect("it was there")))
    }
}

impl Condensation<f64> for Timed<Inner> {
    fn condense(&mut self, rhs: &[f64], interface: &mut [f64]) -> Result<()> {
        self.condensed(|part| part.condense(rhs, interface))
    }
    fn expand(&mut self, interface: &[f64], solution: &mut [f64]) -> Result<()> {
        self.condensed(|part| part.expand(interface, solution))
    }
    fn solve(&mut self, forces: &mut [f64]) -> Result<()> {
        self.condensed(|part| part.solve(forces))
    }
}
