//! Work on one thread and on two, with the feature `rayon`; on the one that is there without it.

/// Whether there are threads.
pub(crate) const THERE: bool = cfg!(feature = "rayon");

/// Runs in a pool of so many threads.
#[cfg(feature = "rayon")]
pub(crate) fn in_pool<R: Send>(threads: usize, run: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(run)
}

/// Runs.
#[cfg(not(feature = "rayon"))]
pub(crate) fn in_pool<R: Send>(_threads: usize, run: impl FnOnce() -> R + Send) -> R {
    run()
}

/// How many threads there are here.
#[cfg(feature = "rayon")]
pub(crate) fn count() -> usize {
    rayon::current_num_threads()
}

/// One.
#[cfg(not(feature = "rayon"))]
pub(crate) fn count() -> usize {
    1
}

/// Does something with each part, side by side.
#[cfg(feature = "rayon")]
pub(crate) fn try_each<P: Send, E: Send>(
    parts: &mut [P],
    act: impl Fn(&mut P) -> Result<(), E> + Send + Sync,
) -> Result<(), E> {
    use rayon::iter::{IntoParallelRefMutIterator, ParallelIterator};
    parts.par_iter_mut().try_for_each(act)
}

/// Does something with each part.
#[cfg(not(feature = "rayon"))]
pub(crate) fn try_each<P: Send, E: Send>(
    parts: &mut [P],
    act: impl Fn(&mut P) -> Result<(), E> + Send + Sync,
) -> Result<(), E> {
    parts.iter_mut().try_for_each(act)
}
