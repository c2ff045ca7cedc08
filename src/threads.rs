//! Work on several threads with the feature `rayon`, in sequence without it.

use num_traits::Zero;
use std::ops::Add;
use std::sync::{Mutex, PoisonError};

/// The smallest factor, in scalars, that gets a thread of its own: reading it takes a tenth of a millisecond.
pub(crate) const GRAIN: usize = 1 << 18;

/// Runs both, on two threads if the current pool has them, otherwise in sequence.
#[cfg(feature = "rayon")]
pub(crate) fn join(first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    rayon::join(first, second);
}

/// Runs both in sequence.
#[cfg(not(feature = "rayon"))]
pub(crate) fn join(first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    first();
    second();
}

/// Number of threads that may share some work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Threads {
    /// The present thread only.
    One,
    /// All of the current pool.
    All,
}

/// Runs both, on the given threads.
pub(crate) fn join_by(threads: Threads, first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    match threads {
        Threads::All => join(first, second),
        Threads::One => {
            first();
            second();
        }
    }
}

/// Calls `act` with the number and the entries of each chunk of `length` entries; the last one may be shorter.
pub(crate) fn each_chunk<T: Send>(
    threads: Threads,
    values: &mut [T],
    length: usize,
    act: &(impl Fn(usize, &mut [T]) + Sync),
) {
    fn from<T: Send>(first: usize, values: &mut [T], length: usize, act: &(impl Fn(usize, &mut [T]) + Sync)) {
        let chunks = values.len().div_ceil(length);
        if chunks <= 1 {
            return act(first, values);
        }
        let (low, high) = values.split_at_mut(chunks / 2 * length);
        join(|| from(first, low, length, act), || from(first + chunks / 2, high, length, act));
    }
    match threads {
        Threads::All if !values.is_empty() => from(0, values, length, act),
        _ => values.chunks_mut(length).enumerate().for_each(|(chunk, values)| act(chunk, values)),
    }
}

/// Calls `act` with the pieces of some vectors of one length, of which it may change the first; returns the sum of its
/// results, added in an order that depends on the length only.
pub(crate) fn sum_pieces<T: Send + Sync + Add<Output = T> + Zero, const N: usize, const M: usize>(
    written: [&mut [T]; N],
    read: [&[T]; M],
    act: &(impl Fn([&mut [T]; N], [&[T]; M]) -> T + Sync),
) -> T {
    /// Entries of a piece: reading them takes as long as waking a thread.
    const PIECE: usize = 1 << 14;
    let size = read.first().map_or(0, |values| values.len());
    if size <= PIECE {
        return act(written, read);
    }
    let at = size.div_ceil(PIECE) / 2 * PIECE;
    let mut high = [const { None }; N];
    let mut number = 0;
    let low = written.map(|values| {
        let (low, rest) = values.split_at_mut(at);
        high[number] = Some(rest);
        number += 1;
        low
    });
    let high = high.map(Option::unwrap_or_default);
    let (first, second) = (read.map(|values| &values[..at]), read.map(|values| &values[at..]));
    let (mut one, mut other) = (T::zero(), T::zero());
    join(|| one = sum_pieces(low, first, act), || other = sum_pieces(high, second, act));
    one + other
}

/// Memory for each thread of a pool.
#[derive(Debug)]
pub(crate) struct PerThread<W>(Vec<Mutex<W>>);

impl<W> PerThread<W> {
    /// One workspace for each thread of the current pool; `None` if `make` fails.
    pub(crate) fn new(make: impl FnMut() -> Option<W>) -> Option<Self> {
        let made: Option<Vec<W>> = std::iter::repeat_with(make).take(count()).collect();
        made.map(|made| Self(made.into_iter().map(Mutex::new).collect()))
    }

    /// Lends one to the present thread. In a pool larger than the pool of [`new`](Self::new) threads may wait for
    /// each other, so `act` must not wait for other threads, nor borrow again.
    pub(crate) fn with<R>(&self, act: impl FnOnce(&mut W) -> R) -> R {
        let workspace = &self.0[index() % self.0.len()];
        // Data left by a panic are overwritten.
        act(&mut workspace.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Threads of the current pool.
#[cfg(feature = "rayon")]
pub(crate) fn count() -> usize {
    rayon::current_num_threads()
}

#[cfg(feature = "rayon")]
fn index() -> usize {
    rayon::current_thread_index().unwrap_or(0)
}

/// Threads of the current pool.
#[cfg(not(feature = "rayon"))]
pub(crate) fn count() -> usize {
    1
}

#[cfg(not(feature = "rayon"))]
fn index() -> usize {
    0
}

/// Whether at least two of the parts, whose factors have these sizes in scalars, deserve a thread each.
pub(crate) fn worthwhile(scalars: impl Iterator<Item = usize>) -> bool {
    cfg!(feature = "rayon") && scalars.filter(|scalars| *scalars >= GRAIN).count() > 1
}

/// Calls `act` on every part, on several threads. Returns the error of the first failing part in order.
pub(crate) fn try_each<P: Send, E: Send>(
    parts: &mut [P],
    act: &(impl Fn(&mut P) -> Result<(), E> + Sync),
) -> Result<(), E> {
    match parts {
        [] => Ok(()),
        [part] => act(part),
        _ => {
            let (first, second) = parts.split_at_mut(parts.len() / 2);
            let (mut one, mut other) = (Ok(()), Ok(()));
            join(|| one = try_each(first, act), || other = try_each(second, act));
            one.and(other)
        }
    }
}
