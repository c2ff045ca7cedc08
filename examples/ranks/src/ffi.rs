//! All that is unsafe here and in the modules below: calls of the C side, each behind a safe function.
//!
//! MPI is initialized with `MPI_THREAD_FUNNELED`: only the thread that has initialized it may call it, and every
//! function asserts that. So handles may be moved and shared between threads: nothing but a panic comes of their use
//! elsewhere.
#![allow(unsafe_code)]
// (A `World` is the proof that MPI has been initialized.)
#![allow(clippy::unused_self)]

mod mumps;
#[cfg(feature = "petsc")]
mod petsc;

pub use mumps::{Input, Mumps};
#[cfg(feature = "petsc")]
pub use petsc::{Multigrid, Reason};

use std::ffi::c_int;
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
}

/// An error of MPI, MUMPS or PETSc by its number.
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
        #[cfg(feature = "petsc")]
        petsc::initialize();
        Self { rank: rank as usize, size: size as usize }
    }

    /// Ends MPI; all ranks call it, after everything else.
    pub fn finalize(self) {
        assert_thread();
        #[cfg(feature = "petsc")]
        petsc::finalize();
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

    /// Sends to and receives from ranks, in their order.
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

    /// The same with so many numbers in place of each.
    pub fn times(&self, columns: usize) -> Self {
        let times = |counts: &[c_int]| counts.iter().map(|&count| count * int(columns)).collect();
        Self { ranks: self.ranks.clone(), sent: times(&self.sent), received: times(&self.received) }
    }

    /// Each of them with the numbers that it is sent and that it sends.
    #[allow(clippy::cast_sign_loss)]
    pub fn counts(&self) -> impl Iterator<Item = [usize; 2]> {
        self.sent.iter().zip(&self.received).map(|(&sent, &received)| [sent as usize, received as usize])
    }
}
