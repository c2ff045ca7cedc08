//! PETSc: conjugate gradients with algebraic multigrid.

use super::{Failed, THREAD, assert_thread, checked, int};
use std::ffi::{c_int, c_long, c_void};
use std::thread::current;

unsafe extern "C" {
    fn shim_petsc_init() -> c_int;
    fn shim_petsc_finalize() -> c_int;
    fn shim_petsc_free(handle: *mut c_void);
    fn shim_petsc_new(
        handle: *mut *mut c_void,
        own: c_int,
        coordinates: *const f64,
        entries: c_long,
        rows: *mut c_int,
        columns: *mut c_int,
        tolerance: f64,
        most: c_int,
    ) -> c_int;
    fn shim_petsc_factorize(handle: *mut c_void, values: *const f64, reason: *mut c_int) -> c_int;
    fn shim_petsc_solve(
        handle: *mut c_void,
        x: *mut f64,
        own: c_int,
        iterations: *mut c_int,
        reason: *mut c_int,
        residual: *mut f64,
    ) -> c_int;
    fn shim_petsc_complexity(handle: *mut c_void, operators: *mut f64) -> c_int;
}

/// Called by the thread of MPI, once, after MPI.
pub(super) fn initialize() {
    // SAFETY: MPI is initialized.
    let code = unsafe { shim_petsc_init() };
    assert_eq!(code, 0, "PETSc does not start");
}

/// Called before the end of MPI.
pub(super) fn finalize() {
    // SAFETY: both are initialized; handles that are left are not used again, for every use asserts a thread of MPI.
    unsafe { shim_petsc_finalize() };
}

/// Why iterations have ended, if not by convergence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// The residual, relative to the right-hand side, after so many iterations.
    Iterations,
    /// The matrix is not positive definite.
    Indefinite,
    /// A number is not finite.
    NotFinite,
    /// The preconditioner could not be built or applied.
    Preconditioner,
    /// Anything else, by PETSc's number.
    Other(i32),
}

impl Reason {
    /// Of `KSPConvergedReason`.
    fn of(reason: c_int) -> Option<Self> {
        match reason {
            0.. => None,
            -3 | -4 => Some(Self::Iterations),
            -8 | -10 => Some(Self::Indefinite),
            -9 => Some(Self::NotFinite),
            -11 => Some(Self::Preconditioner),
            other => Some(Self::Other(other)),
        }
    }
}

/// How a solve has ended, alike on all ranks.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    pub iterations: usize,
    /// Relative to the right-hand side.
    pub residual: f64,
    /// Why it has not converged, if it has not.
    pub reason: Option<Reason>,
}

/// A symmetric definite matrix in PETSc, whose rows are those of nodes with three dofs.
#[derive(Debug)]
pub struct Multigrid {
    handle: *mut c_void,
    own: usize,
    entries: usize,
}

// SAFETY: every use is asserted to be by the thread of MPI.
unsafe impl Send for Multigrid {}

impl Drop for Multigrid {
    fn drop(&mut self) {
        if THREAD.get() == Some(&current().id()) {
            // SAFETY: the handle is not used again. (Elsewhere it leaks.)
            unsafe { shim_petsc_free(self.handle) };
        }
    }
}

impl Multigrid {
    /// Of a pattern; all ranks call it. The rows that a rank owns follow those of the ranks before it, three a node;
    /// `coordinates` are those of its nodes, `entries` the (row, column) of its rows. Iterations end when the residual
    /// has fallen to `tolerance` times the right-hand side, or after `most`.
    pub fn new(
        coordinates: &[f64],
        entries: impl Iterator<Item = (usize, usize)>,
        tolerance: f64,
        most: usize,
    ) -> Result<Self, Failed> {
        assert_thread();
        assert!(coordinates.len().is_multiple_of(3));
        let (mut rows, mut columns): (Vec<_>, Vec<_>) = entries.map(|(row, column)| (int(row), int(column))).unzip();
        let mut handle = std::ptr::null_mut();
        let own = coordinates.len();
        // SAFETY: the lists are as long as told, and copied; PETSc checks the indices.
        let code = unsafe {
            shim_petsc_new(
                &raw mut handle,
                int(own),
                coordinates.as_ptr(),
                rows.len().try_into().expect("a count of 63 bits"),
                rows.as_mut_ptr(),
                columns.as_mut_ptr(),
                tolerance,
                int(most),
            )
        };
        if handle.is_null() {
            return Err(Failed(code, 0));
        }
        let grid = Self { handle, own, entries: rows.len() };
        checked(code).map(|()| grid)
    }

    /// Takes the values of the entries, in their order, and builds the preconditioner.
    pub fn factorize(&mut self, values: &[f64]) -> Result<Option<Reason>, Failed> {
        assert_thread();
        assert_eq!(values.len(), self.entries);
        let mut reason = 0;
        // SAFETY: as many values as entries; the handle lives.
        checked(unsafe { shim_petsc_factorize(self.handle, values.as_ptr(), &raw mut reason) })?;
        Ok(Reason::of(reason))
    }

    /// Solves for one right-hand side, of which this rank gives its rows and gets its rows.
    pub fn solve(&mut self, x: &mut [f64]) -> Result<Ended, Failed> {
        assert_thread();
        assert_eq!(x.len(), self.own);
        let (mut iterations, mut reason, mut residual) = (0, 0, 0.0);
        // SAFETY: the asserted length; the other pointers are to places of this frame.
        checked(unsafe {
            let (iterations, reason, residual) = (&raw mut iterations, &raw mut reason, &raw mut residual);
            shim_petsc_solve(self.handle, x.as_mut_ptr(), int(self.own), iterations, reason, residual)
        })?;
        let iterations = usize::try_from(iterations).unwrap_or(0);
        Ok(Ended { iterations, residual, reason: Reason::of(reason) })
    }

    /// Entries of the matrices of all grids on this rank, about: every rank has its share of the coarser ones.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub fn stored(&self) -> usize {
        assert_thread();
        let mut complexity = 1.0;
        // SAFETY: the handle lives.
        let code = unsafe { shim_petsc_complexity(self.handle, &raw mut complexity) };
        if code == 0 { (complexity * self.entries as f64) as usize } else { self.entries }
    }
}
