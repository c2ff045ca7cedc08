//! Bodies spread over ranks: the interface of a parallel host.

mod agreement;
mod check;
mod conjugate_gradients;
mod parts;
mod solver;
mod system;

pub use conjugate_gradients::ConjugateGradientsOverRanks;
pub use parts::parts;

pub(crate) use agreement::Together;
pub(crate) use check::{check_alike, check_interface, check_owned};
pub(crate) use solver::AgreedSolver;
pub(crate) use system::AgreedSystem;

use crate::error::Result;
use crate::real::Real;
use std::ops::Range;

/// The ranks (usually processes) over which a body is spread, returned by a host's
/// [`System::ranks`](crate::System::ranks). The crate does no message passing itself: it only needs these five
/// methods.
///
/// **Data of each rank.** Every rank builds its own [`Simulation`](crate::Simulation) from the dofs that it has, in
/// its own numbering: the dofs that it *owns*, the dofs of neighboring ranks that its elements touch, and all dofs on
/// which contact may ever act. Each dof is owned by one rank. Contact is replicated: constraints, contact solver and
/// correctors are the same on all ranks, the contact dofs have the same order, and every rank solves the contact
/// problem itself, with bitwise the same result.
///
/// **Data written by a host** must be correct on dofs that the rank owns: forces of the [`System`](crate::System),
/// and solutions of the [`LinearSolver`](crate::LinearSolver). The crate shares them, so that displacements,
/// velocities and accelerations are correct at every dof of a rank. Matrices contain the elements that touch an owned
/// dof, so they are symmetric, and correct in owned rows; a lumped mass must be correct on owned dofs.
/// [`System::potential_energy`](crate::System::potential_energy) is the rank's part of the sum.
///
/// **Linear solvers** must solve for the rows of all ranks ([`LinearSolver::spans_ranks`]); others are rejected,
/// except for diagonal matrices. Their results on the interface must be bitwise the same on all ranks, and their
/// [iterations](crate::Factorization::iterations) the same number. [`ConjugateGradients::over_ranks`] is one.
///
/// **Errors.** Before any operation that waits for other ranks, and at the end of each step, all ranks check that
/// none has failed. If one has, the step fails on all and is undone: the failed rank returns its own error, the
/// others [`Error::OtherRank`](crate::Error::OtherRank) with its message. A callback that waits for other ranks must
/// do so before it fails, because no rank waits for one that has returned.
///
/// **Collective calls.** All ranks must make the calls that may wait: [`build`](crate::SimulationBuilder::build),
/// steps and runs, changes of the step size, [`energy`](crate::Simulation::energy),
/// [`momentum`](crate::Simulation::momentum), [`reactions`](crate::Simulation::reactions). An observer receives its
/// rank's state; one that stops or fails ends the run on all ranks.
///
/// Not supported over ranks, and rejected: dofs without mass, and explicit steps without
/// [`System::highest_frequency`](crate::System::highest_frequency) that Gershgorin's circles do not admit.
/// `docs/ranks.md` describes the cost of ranks.
///
/// [`LinearSolver::spans_ranks`]: crate::LinearSolver::spans_ranks
/// [`ConjugateGradients::over_ranks`]: crate::ConjugateGradients::over_ranks
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

    /// The dofs that this rank owns, as ascending ranges in its own numbering. They never change.
    fn owned(&self) -> &[Range<usize>];

    /// Replaces each value by its sum over all ranks, bitwise the same on all. All ranks call it in the same order
    /// with the same number of values.
    ///
    /// # Errors
    ///
    /// The host's own, if ranks cannot be reached; no further calls are made then.
    fn sum(&self, values: &mut [f64]) -> Result<()>;

    /// Replaces each value by the largest over all ranks. Called like [`sum`](Self::sum).
    ///
    /// # Errors
    ///
    /// As [`sum`](Self::sum).
    fn max(&self, values: &mut [f64]) -> Result<()>;

    /// Replaces the values of dofs that other ranks own (one value per dof of this rank) by their owners' values.
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

    /// Wrappers must implement every method: a new method must not use its default if the host implements it.
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
