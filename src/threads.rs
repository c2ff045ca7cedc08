//! Work on several threads with the feature `rayon`, in sequence without it.

use faer::Par;

/// The smallest factor, in scalars, that is worth a thread of its own: reading it takes a tenth of a millisecond.
pub(crate) const GRAIN: usize = 1 << 18;

/// The parallelism with which faer computes a factor of so many scalars: all threads of the current pool if the factor
/// is large, else one.
#[cfg(feature = "rayon")]
pub(crate) fn parallelism(scalars: usize) -> Par {
    /// In smaller factors threads wait for each other longer than they work.
    const WORTHWHILE: usize = 1 << 20;
    match rayon::current_num_threads() {
        count if count > 1 && scalars >= WORTHWHILE => Par::rayon(count),
        _ => Par::Seq,
    }
}

/// The parallelism with which faer computes a factor: one thread.
#[cfg(not(feature = "rayon"))]
pub(crate) fn parallelism(_: usize) -> Par {
    Par::Seq
}

/// Runs both, on two threads if the current pool has them, else one after the other.
#[cfg(feature = "rayon")]
pub(crate) fn join(first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    rayon::join(first, second);
}

/// Runs both, one after the other.
#[cfg(not(feature = "rayon"))]
pub(crate) fn join(first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    first();
    second();
}

/// Whether two or more of the parts, whose factors have these sizes in scalars, are worth a thread each.
pub(crate) fn worthwhile(scalars: impl Iterator<Item = usize>) -> bool {
    cfg!(feature = "rayon") && scalars.filter(|scalars| *scalars >= GRAIN).count() > 1
}

/// Calls `act` on every part, on several threads. Of several errors that of the first part in order is returned.
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
