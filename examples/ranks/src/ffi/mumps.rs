//! MUMPS. It keeps pointers to the entries of its matrix; they are held here, behind the handle, as long as it lives.

use super::{Failed, THREAD, World, assert_thread, int};
use std::ffi::{c_int, c_long, c_void};
use std::thread::current;

unsafe extern "C" {
    fn shim_mumps_new(handle: *mut *mut c_void) -> c_int;
    fn shim_mumps_free(handle: *mut c_void);
    fn shim_mumps_analyze(
        handle: *mut c_void,
        dofs: c_int,
        entries: c_long,
        rows: *mut c_int,
        columns: *mut c_int,
        distributed: c_int,
        last: *mut c_int,
        last_count: c_int,
    ) -> c_int;
    fn shim_mumps_factorize(handle: *mut c_void, values: *mut f64, distributed: c_int) -> c_int;
    fn shim_mumps_stored(handle: *mut c_void, factorized: c_int) -> c_int;
    fn shim_mumps_negative_pivots(handle: *mut c_void) -> c_int;
    fn shim_mumps_detail(handle: *mut c_void) -> c_int;
    fn shim_mumps_schur(handle: *mut c_void, out: *mut f64);
    fn shim_mumps_limit(handle: *mut c_void, megabytes: c_int);
    fn shim_mumps_solve(
        handle: *mut c_void,
        rhs: *mut f64,
        dofs: c_int,
        columns: c_int,
        part: c_int,
        reduced: *mut f64,
        last_count: c_int,
    ) -> c_int;
    fn shim_mumps_solved_here(handle: *mut c_void) -> c_int;
    fn shim_mumps_solve_distributed(
        handle: *mut c_void,
        columns: c_int,
        given_count: c_int,
        given: *mut c_int,
        rhs: *mut f64,
        dofs: c_int,
        solved_count: c_int,
        solved: *mut c_int,
        solution: *mut f64,
        part: c_int,
        reduced: *mut f64,
        last_count: c_int,
    ) -> c_int;
}

/// Where the entries of a matrix are when MUMPS gets them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// All on rank 0.
    Root,
    /// Each rank has its own.
    Distributed,
}

/// A symmetric matrix in MUMPS.
#[derive(Debug)]
pub struct Mumps {
    handle: *mut c_void,
    input: Input,
    is_root: bool,
    dofs: usize,
    entries: usize,
    last: Vec<c_int>,
    // MUMPS points to these.
    rows: Vec<c_int>,
    columns: Vec<c_int>,
    values: Vec<f64>,
    /// Of solves over the ranks: the dofs whose right-hand sides this rank has, and those whose solutions it gets.
    given: Vec<c_int>,
    solved: Vec<c_int>,
}

// SAFETY: every use is asserted to be by the thread of MPI.
unsafe impl Send for Mumps {}

impl Drop for Mumps {
    fn drop(&mut self) {
        if THREAD.get() == Some(&current().id()) {
            // SAFETY: the handle is not used again. (Elsewhere it leaks.)
            unsafe { shim_mumps_free(self.handle) };
        }
    }
}

impl Mumps {
    /// Analyzes a pattern; all ranks call it. Rows and columns from 0, one triangle; `last` are the dofs of the Schur
    /// complement, or none.
    pub fn analyze(
        world: World,
        dofs: usize,
        entries: impl Iterator<Item = (usize, usize)>,
        input: Input,
        last: &[usize],
    ) -> Result<Self, Failed> {
        assert_thread();
        let (rows, columns): (Vec<_>, Vec<_>) = entries.map(|(row, column)| (int(row + 1), int(column + 1))).unzip();
        let last = last.iter().map(|&dof| int(dof + 1)).collect();
        let mut handle = std::ptr::null_mut();
        // SAFETY: the pointer is to a place of this frame.
        let code = unsafe { shim_mumps_new(&raw mut handle) };
        if handle.is_null() {
            return Err(Failed(code, 0));
        }
        let entries = rows.len();
        let mut mumps = Self {
            handle,
            input,
            is_root: world.rank == 0,
            dofs,
            entries,
            last,
            rows,
            columns,
            values: vec![0.0; entries],
            given: Vec::new(),
            solved: Vec::new(),
        };
        mumps.checked(code)?;
        // SAFETY: the lists are as long as told, have indices from 1 to the number of dofs, and live with the handle.
        let code = unsafe {
            shim_mumps_analyze(
                handle,
                int(dofs),
                entries.try_into().expect("a count of 63 bits"),
                mumps.rows.as_mut_ptr(),
                mumps.columns.as_mut_ptr(),
                c_int::from(input == Input::Distributed),
                mumps.last.as_mut_ptr(),
                int(mumps.last.len()),
            )
        };
        mumps.checked(code)?;
        Ok(mumps)
    }

    fn checked(&self, code: c_int) -> Result<(), Failed> {
        // SAFETY: the handle lives.
        if code == 0 { Ok(()) } else { Err(Failed(code, unsafe { shim_mumps_detail(self.handle) })) }
    }

    /// Factorizes; the values are those of the entries of the analysis, in their order. The number of negative pivots.
    pub fn factorize(&mut self, values: impl Iterator<Item = f64>) -> Result<i32, Failed> {
        assert_thread();
        self.values.clear();
        self.values.extend(values);
        assert_eq!(self.values.len(), self.entries);
        let distributed = c_int::from(self.input == Input::Distributed);
        // SAFETY: as many values as entries, which live with the handle.
        let code = unsafe { shim_mumps_factorize(self.handle, self.values.as_mut_ptr(), distributed) };
        self.checked(code)?;
        // SAFETY: the handle lives.
        Ok(unsafe { shim_mumps_negative_pivots(self.handle) })
    }

    /// The number of entries that a factorization takes from this rank.
    pub fn entries(&self) -> usize {
        self.entries
    }

    /// Entries of the factors; as estimated before there are any.
    pub fn stored(&self, factorized: bool) -> usize {
        assert_thread();
        // SAFETY: the handle lives.
        let stored = unsafe { shim_mumps_stored(self.handle, c_int::from(factorized)) };
        let size = stored.unsigned_abs() as usize;
        if stored < 0 { size * 1_000_000 } else { size }
    }

    /// Gives this rank no more memory than so many megabytes.
    pub fn limit_memory(&mut self, megabytes: i32) {
        assert_thread();
        // SAFETY: the handle lives.
        unsafe { shim_mumps_limit(self.handle, megabytes) };
    }

    /// The lower triangle of the Schur complement by rows, on rank 0, after a factorization.
    pub fn schur(&self, out: &mut [f64]) {
        assert_thread();
        assert!(self.is_root && out.len() == self.last.len() * self.last.len());
        // SAFETY: the asserted length is that of the complement.
        unsafe { shim_mumps_schur(self.handle, out.as_mut_ptr()) };
    }

    /// Names the dofs whose right-hand sides this rank has in solves over the ranks.
    pub fn give(&mut self, dofs: impl Iterator<Item = usize>) {
        self.given = dofs.map(|dof| int(dof + 1)).collect();
    }

    /// Solves over the ranks: `rhs` has one or more columns of what this rank gives, `solution` becomes as many of what
    /// it gets. Which dofs these are is the same from one factorization to the next.
    pub fn solve_distributed(
        &mut self,
        rhs: &mut [f64],
        columns: usize,
        solution: &mut Vec<f64>,
    ) -> Result<(), Failed> {
        self.solve_part_distributed(rhs, columns, solution, 0, &mut [])
    }

    /// Eliminates the interior over the ranks; what is left on the interface, on rank 0.
    pub fn reduce_distributed(&mut self, rhs: &mut [f64], reduced: &mut [f64]) -> Result<(), Failed> {
        self.solve_part_distributed(rhs, 1, &mut Vec::new(), 1, reduced)
    }

    /// Completes the solution of the last reduction, and leaves it where it is computed. (MUMPS wants room for a whole
    /// right-hand side on rank 0, which it does not use.)
    pub fn complete_distributed(
        &mut self,
        interface: &mut [f64],
        room: &mut [f64],
        solution: &mut Vec<f64>,
    ) -> Result<(), Failed> {
        assert!(!self.is_root || room.len() == self.dofs);
        self.solve_part_distributed(room, 1, solution, 2, interface)
    }

    /// The dofs whose solutions this rank has got in the last solve over the ranks.
    #[allow(clippy::cast_sign_loss)]
    pub fn solved(&self) -> impl Iterator<Item = usize> {
        self.solved.iter().map(|&dof| dof as usize - 1)
    }

    fn solve_part_distributed(
        &mut self,
        rhs: &mut [f64],
        columns: usize,
        solution: &mut Vec<f64>,
        part: c_int,
        reduced: &mut [f64],
    ) -> Result<(), Failed> {
        assert_thread();
        assert!(part == 2 || rhs.len() == columns * self.given.len());
        assert!(!self.is_root || part == 0 || reduced.len() == self.last.len());
        // SAFETY: the handle lives.
        let count = unsafe { shim_mumps_solved_here(self.handle) };
        let size = usize::try_from(count).expect("a count");
        self.solved.resize(size, 0);
        solution.resize(columns * size, 0.0);
        // SAFETY: the lists have the lengths that are told, as asserted or made so; the interface and a whole
        // right-hand side are read on rank 0.
        let code = unsafe {
            shim_mumps_solve_distributed(
                self.handle,
                int(columns),
                int(self.given.len()),
                self.given.as_mut_ptr(),
                rhs.as_mut_ptr(),
                int(self.dofs),
                count,
                self.solved.as_mut_ptr(),
                solution.as_mut_ptr(),
                part,
                reduced.as_mut_ptr(),
                int(self.last.len()),
            )
        };
        self.checked(code)
    }

    /// Solves for whole right-hand sides on rank 0 (elsewhere the slices are empty).
    pub fn solve(&mut self, rhs: &mut [f64], columns: usize) -> Result<(), Failed> {
        self.solve_part(rhs, columns, 0, &mut [])
    }

    /// Eliminates the interior; what is left on the interface, on rank 0.
    pub fn reduce(&mut self, rhs: &mut [f64], reduced: &mut [f64]) -> Result<(), Failed> {
        self.solve_part(rhs, 1, 1, reduced)
    }

    /// Completes the solution of the last reduction from that on the interface.
    pub fn complete(&mut self, interface: &mut [f64], solution: &mut [f64]) -> Result<(), Failed> {
        self.solve_part(solution, 1, 2, interface)
    }

    fn solve_part(&mut self, rhs: &mut [f64], columns: usize, part: i32, reduced: &mut [f64]) -> Result<(), Failed> {
        assert_thread();
        assert!(!self.is_root || rhs.len() == columns * self.dofs);
        assert!(!self.is_root || part == 0 || reduced.len() == self.last.len());
        let last = int(self.last.len());
        // SAFETY: the asserted lengths where MUMPS reads them, which is rank 0.
        let code = unsafe {
            let (rhs, reduced) = (rhs.as_mut_ptr(), reduced.as_mut_ptr());
            shim_mumps_solve(self.handle, rhs, int(self.dofs), int(columns), part, reduced, last)
        };
        self.checked(code)
    }
}
