//! Bodies that are spread over ranks: what a parallel host adds to its system.

mod agreement;
mod check;
mod parts;
mod solver;
mod system;

pub use parts::parts;

pub(crate) use agreement::Together;
pub(crate) use check::{check_alike, check_interface, check_owned};
pub(crate) use solver::AgreedSolver;
pub(crate) use system::AgreedSystem;

use crate::error::Result;
use crate::real::Real;
use std::ops::Range;

/// The ranks (processes, mostly) that a body is spread over, as a host's [`System::ranks`](crate::System::ranks)
/// gives them. The crate knows no message passing: five methods are all that it asks for.
///
/// **What each rank has.** Every rank builds a [`Simulation`](crate::Simulation) of its own, of the dofs that it knows,
/// in numbers of its own: those that it *owns*, those of its neighbors that its elements touch, and all dofs that
/// contact may ever act on. Each dof is owned by one rank. Contact is replicated: constraints, contact solver and
/// correctors are the same on all ranks, the contact dofs come in the same order, and every rank solves the contact
/// problem by itself, to the same bits.
///
/// **What a host writes** has to be right where the rank owns the dof: forces of the [`System`](crate::System), and
/// solutions of the [`LinearSolver`](crate::LinearSolver). The crate shares them, so that displacements, velocities and
/// accelerations are right at every dof that a rank knows. Matrices are those of the elements that touch a dof of the
/// rank's own (symmetric therefore, and right in the rows that it owns), a lumped mass is right where it is owned;
/// [`System::potential_energy`](crate::System::potential_energy) is the rank's part of the sum.
///
/// **Linear solvers** have to solve for the rows of all ranks ([`LinearSolver::spans_ranks`]); others are refused, but
/// for diagonal matrices. What they return on the interface must be the same on all ranks to the bit.
///
/// **Errors.** Before anything that waits for other ranks, and at the end of each step, all ranks agree that none has
/// failed. If one has, the step fails on all and is undone: the rank returns its own error, the others
/// [`Error::OtherRank`](crate::Error::OtherRank), which carries its words. A callback that waits for other ranks has
/// to do so before it fails, for nobody waits for a rank that returned.
///
/// **All ranks call** what may wait: [`build`](crate::SimulationBuilder::build), steps and runs, changes of the step,
/// [`energy`](crate::Simulation::energy), [`momentum`](crate::Simulation::momentum),
/// [`reactions`](crate::Simulation::reactions). An observer sees its rank's state; one that stops or fails ends the run
/// on all ranks.
///
/// What is not done over ranks: dofs without mass, and explicit steps without
/// [`System::highest_frequency`](crate::System::highest_frequency) where Gershgorin's circles do not admit the step.
/// Both are refused. `docs/ranks.md` says what ranks cost.
///
/// [`LinearSolver::spans_ranks`]: crate::LinearSolver::spans_ranks
///
/// ```
/// use contact_dynamics::ranks::Ranks;
/// use std::ops::Range;
///
/// /// One rank that owns all there is, as under `mpirun -n 1`.
/// #[derive(Debug)]
/// struct Alone([Range<usize>; 1]);
///
/// impl Ranks<f64> for Alone {
///     fn rank(&self) -> usize {
///         0
///     }
///     fn owned(&self) -> &[Range<usize>] {
///         &self.0
///     }
///     fn sum(&self, _: &mut [f64]) -> contact_dynamics::Result<()> {
///         Ok(()) // MPI_Allreduce with MPI_SUM
///     }
///     fn max(&self, _: &mut [f64]) -> contact_dynamics::Result<()> {
///         Ok(()) // MPI_Allreduce with MPI_MAX
///     }
///     fn share(&self, _: &mut [f64]) -> contact_dynamics::Result<()> {
///         Ok(()) // owners send, others receive
///     }
/// }
///
/// let ranks = Alone([0..12]);
/// assert_eq!(ranks.owned(), [0..12]);
/// ```
pub trait Ranks<T: Real>: std::fmt::Debug + Send + Sync {
    /// The number of this rank, from 0.
    fn rank(&self) -> usize;

    /// The dofs that this rank owns, as ascending ranges of its own numbers. They never change.
    fn owned(&self) -> &[Range<usize>];

    /// Replaces each value by its sum over all ranks, the same on all of them to the bit. All ranks call it in the same
    /// order and with as many values.
    ///
    /// # Errors
    ///
    /// The host's own, if ranks cannot be reached; nothing is asked of them afterwards.
    fn sum(&self, values: &mut [f64]) -> Result<()>;

    /// Replaces each value by the largest over all ranks. Called as [`sum`](Self::sum).
    ///
    /// # Errors
    ///
    /// As [`sum`](Self::sum).
    fn max(&self, values: &mut [f64]) -> Result<()>;

    /// Replaces the values of dofs that other ranks own (one value a dof of this rank) by those of their owners.
    ///
    /// # Errors
    ///
    /// As [`sum`](Self::sum).
    fn share(&self, values: &mut [T]) -> Result<()>;
}

#[cfg(test)]
mod tests {
    /// The names of the methods in a part of a source.
    fn methods(source: &str, from: &str) -> Vec<String> {
        let body = source.split(from).nth(1).and_then(|rest| rest.split("\n}").next()).unwrap();
        let methods = body.lines().filter_map(|line| line.strip_prefix("    fn "));
        methods.map(|rest| rest.split(['(', '<']).next().unwrap().to_owned()).collect()
    }

    /// A method that is new must not be answered by its default for a host that has one.
    #[test]
    fn wrapped_parts_answer_every_method() {
        let (system, solver) = (include_str!("ranks/system.rs"), include_str!("ranks/solver.rs"));
        let solvers = include_str!("linear_solver.rs");
        for (declared, trait_name, wrapped, implemented) in [
            (include_str!("system.rs"), "pub trait System<", system, "System<T> for AgreedSystem"),
            (solvers, "pub trait LinearSolver<", solver, "LinearSolver<T> for AgreedSolver"),
            (solvers, "pub trait Factorization<", solver, "Factorization<T> for AgreedFactorization"),
            (solvers, "pub trait Condensation<", solver, "Condensation<T> for AgreedFactorization"),
        ] {
            let (mut all, mut own) = (methods(declared, trait_name), methods(wrapped, implemented));
            all.sort_unstable();
            own.sort_unstable();
            assert!(all.len() > 1);
            assert_eq!(all, own, "{trait_name}");
        }
    }
}
