//! All that is unsafe here: calls of the C side, each behind a safe function.
//!
//! MPI is initialized with `MPI_THREAD_FUNNELED`: only the thread that has initialized it may call it, and every function
//! asserts that. So handles may be moved and shared between threads: nothing but a panic comes of their use elsewhere.
//! MUMPS keeps pointers to the entries of its matrix; they are held here, behind the handle, as long as it lives.
#![allow(unsafe_code)]
// (A `World` is the proof that MPI has been initialized.)
#![allow(clippy::unused_self)]

use std::ffi::{c_int, c_long, c_void};
use std::sync::OnceLock;
use std::thread::{ThreadId, current};

unsafe extern "C" {
    fn shim_init(rank: *mut c_int, size: *mut c_int) -> c_int;
    fn shim_finalize() -> c_int;
    fn shim_abort(code: c_int);
    fn shim_reduce(values: *mut f64, count: c_int, largest: c_int) -> c_int;
    fn shim_broadcast(values: *mut f64, count: c_int) -> c_int;
    fn shim_gather_count(own: c_int, counts: *mut c_int) -> c_int;
    fn shim_gather_ints(
        own: *const c_int,
        count: c_int,
        all: *mut c_int,
        counts: *const c_int,
        starts: *const c_int,
    ) -> c_int;
    fn shim_gather_to_root(
        own: *const f64,
        count: c_int,
        all: *mut f64,
        counts: *const c_int,
        starts: *const c_int,
    ) -> c_int;
    fn shim_scatter_from_root(
        all: *const f64,
        counts: *const c_int,
        starts: *const c_int,
        own: *mut f64,
        count: c_int,
    ) -> c_int;
    fn shim_exchange(
        peers: c_int,
        ranks: *const c_int,
        send_counts: *const c_int,
        send: *const f64,
        receive_counts: *const c_int,
        receive: *mut f64,
    ) -> c_int;
    fn shim_time() -> f64;
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
}

/// An error of MPI or MUMPS by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failed(pub c_int, pub c_int);

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "error {} ({})", self.0, self.1)
    }
}

impl std::error::Error for Failed {}

fn checked(code: c_int) -> Result<(), Failed> {
    if code == 0 { Ok(()) } else { Err(Failed(code, 0)) }
}

/// A count as C has it.
fn int(count: usize) -> c_int {
    count.try_into().expect("a count of 32 bits")
}

static THREAD: OnceLock<ThreadId> = OnceLock::new();

/// All ranks of this run. (There is one of them, as often as it is copied.)
#[derive(Clone, Copy, Debug)]
pub struct World {
    pub rank: usize,
    pub size: usize,
}

fn assert_thread() {
    assert_eq!(THREAD.get(), Some(&current().id()), "MPI belongs to the thread that initialized it");
}

impl World {
    /// Initializes MPI, once a process.
    ///
    /// # Panics
    ///
    /// At the second call, or where MPI does not start.
    #[allow(clippy::cast_sign_loss)]
    pub fn initialize() -> Self {
        assert!(THREAD.set(current().id()).is_ok(), "MPI is initialized once");
        let (mut rank, mut size) = (0, 0);
        // SAFETY: both pointers are to places of this frame.
        let code = unsafe { shim_init(&raw mut rank, &raw mut size) };
        assert_eq!(code, 0, "MPI does not start");
        Self { rank: rank as usize, size: size as usize }
    }

    /// Ends MPI; all ranks call it, after everything else.
    pub fn finalize(self) {
        assert_thread();
        // SAFETY: MPI is initialized; later calls fail with errors of MPI.
        unsafe { shim_finalize() };
    }

    /// Ends all ranks.
    pub fn abort(self, code: i32) -> ! {
        // SAFETY: MPI is initialized, and may be left from anywhere.
        unsafe { shim_abort(code) };
        std::process::exit(code)
    }

    pub fn sum(self, values: &mut [f64]) -> Result<(), Failed> {
        assert_thread();
        // SAFETY: the pointer is to as many numbers as are told.
        checked(unsafe { shim_reduce(values.as_mut_ptr(), int(values.len()), 0) })
    }

    pub fn max(self, values: &mut [f64]) -> Result<(), Failed> {
        assert_thread();
        // SAFETY: as above.
        checked(unsafe { shim_reduce(values.as_mut_ptr(), int(values.len()), 1) })
    }

    /// Gives all ranks the values of rank 0.
    pub fn broadcast(self, values: &mut [f64]) -> Result<(), Failed> {
        assert_thread();
        // SAFETY: as above.
        checked(unsafe { shim_broadcast(values.as_mut_ptr(), int(values.len())) })
    }

    /// The numbers of all ranks, on all of them.
    #[allow(clippy::cast_sign_loss)]
    pub fn gather_indices(self, own: &[usize]) -> Result<Vec<Vec<usize>>, Failed> {
        assert_thread();
        let own: Vec<c_int> = own.iter().map(|&index| int(index)).collect();
        let mut counts = vec![0; self.size];
        // SAFETY: there is a count for each rank.
        checked(unsafe { shim_gather_count(int(own.len()), counts.as_mut_ptr()) })?;
        let starts = starts(&counts);
        let mut all: Vec<c_int> = vec![0; counts.iter().sum::<c_int>() as usize];
        // SAFETY: `all` has room for what the counts say, from the starts on.
        checked(unsafe {
            shim_gather_ints(own.as_ptr(), int(own.len()), all.as_mut_ptr(), counts.as_ptr(), starts.as_ptr())
        })?;
        let mut rest = &all[..];
        let mut take = |&count: &c_int| {
            let (part, after) = rest.split_at(count as usize);
            rest = after;
            part.iter().map(|&index| index as usize).collect()
        };
        Ok(counts.iter().map(&mut take).collect())
    }

    /// Brings the numbers of all ranks to rank 0, as many of each as `counts` says; `all` is used there only.
    pub fn gather(self, own: &[f64], counts: &Counts, all: &mut [f64]) -> Result<(), Failed> {
        assert_thread();
        assert!(counts.0[self.rank] == int(own.len()) && (self.rank > 0 || counts.total() == all.len()));
        // SAFETY: the asserted lengths.
        checked(unsafe {
            let Counts(counts, starts) = counts;
            shim_gather_to_root(own.as_ptr(), int(own.len()), all.as_mut_ptr(), counts.as_ptr(), starts.as_ptr())
        })
    }

    /// The way back.
    pub fn scatter(self, all: &[f64], counts: &Counts, own: &mut [f64]) -> Result<(), Failed> {
        assert_thread();
        assert!(counts.0[self.rank] == int(own.len()) && (self.rank > 0 || counts.total() == all.len()));
        // SAFETY: the asserted lengths.
        checked(unsafe {
            let Counts(counts, starts) = counts;
            shim_scatter_from_root(all.as_ptr(), counts.as_ptr(), starts.as_ptr(), own.as_mut_ptr(), int(own.len()))
        })
    }

    /// Sends to and receives from other ranks, in their order.
    pub fn exchange(self, peers: &Peers, send: &[f64], receive: &mut [f64]) -> Result<(), Failed> {
        assert_thread();
        let total = |counts: &[c_int]| counts.iter().map(|&count| i64::from(count)).sum::<i64>();
        assert_eq!(total(&peers.sent), i64::from(int(send.len())));
        assert_eq!(total(&peers.received), i64::from(int(receive.len())));
        // SAFETY: the asserted lengths, and lists of one length by the way peers are made.
        checked(unsafe {
            shim_exchange(
                int(peers.ranks.len()),
                peers.ranks.as_ptr(),
                peers.sent.as_ptr(),
                send.as_ptr(),
                peers.received.as_ptr(),
                receive.as_mut_ptr(),
            )
        })
    }

    /// Seconds, from some instant.
    pub fn time(self) -> f64 {
        // SAFETY: reads a clock.
        unsafe { shim_time() }
    }
}

fn starts(counts: &[c_int]) -> Vec<c_int> {
    counts.iter().scan(0, |start, &count| Some(std::mem::replace(start, *start + count))).collect()
}

/// How many numbers each rank has, and where they start.
#[derive(Clone, Debug)]
pub struct Counts(Vec<c_int>, Vec<c_int>);

impl Counts {
    pub fn new(counts: impl Iterator<Item = usize>) -> Self {
        let counts: Vec<_> = counts.map(int).collect();
        let starts = starts(&counts);
        Self(counts, starts)
    }

    #[allow(clippy::cast_sign_loss)]
    fn total(&self) -> usize {
        self.0.iter().sum::<c_int>() as usize
    }
}

/// Ranks that numbers are exchanged with.
#[derive(Clone, Debug, Default)]
pub struct Peers {
    ranks: Vec<c_int>,
    sent: Vec<c_int>,
    received: Vec<c_int>,
}

impl Peers {
    /// Another one, with so many numbers sent and received.
    pub fn push(&mut self, rank: usize, sent: usize, received: usize) {
        self.ranks.push(int(rank));
        self.sent.push(int(sent));
        self.received.push(int(received));
    }
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
