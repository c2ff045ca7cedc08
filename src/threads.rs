//! Work side by side, where there are threads for it.

use faer::Par;

/// How faer is to compute a factor of so many scalars: with all threads of the present pool with the feature `rayon` if it
/// is large, else with one.
#[cfg(feature = "rayon")]
pub(crate) fn all(scalars: usize) -> Par {
    /// Below, threads wait for each other longer than they work.
    const WORTHWHILE: usize = 1 << 20;
    match rayon::current_num_threads() {
        count if count > 1 && scalars >= WORTHWHILE => Par::rayon(count),
        _ => Par::Seq,
    }
}

/// How faer is to compute a factor: with one thread.
#[cfg(not(feature = "rayon"))]
pub(crate) fn all(_: usize) -> Par {
    Par::Seq
}

/// Does both: on two threads with the feature `rayon` if its pool has any, else one after the other.
#[cfg(feature = "rayon")]
pub(crate) fn join(first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    rayon::join(first, second);
}

/// Does both, one after the other.
#[cfg(not(feature = "rayon"))]
pub(crate) fn join(first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    first();
    second();
}
