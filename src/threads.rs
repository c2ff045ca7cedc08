//! Work side by side, where there are threads for it.

use faer::Par;

/// Scalars of a factor from which on a thread of its own is worth waking: a tenth of a millisecond of reading.
pub(crate) const GRAIN: usize = 1 << 18;

/// How faer is to compute a factor of so many scalars: with all threads of the present pool with the feature `rayon` if
/// it is large, else with one.
#[cfg(feature = "rayon")]
pub(crate) fn parallelism(scalars: usize) -> Par {
    /// Below, threads wait for each other longer than they work.
    const WORTHWHILE: usize = 1 << 20;
    match rayon::current_num_threads() {
        count if count > 1 && scalars >= WORTHWHILE => Par::rayon(count),
        _ => Par::Seq,
    }
}

/// How faer is to compute a factor: with one thread.
#[cfg(not(feature = "rayon"))]
pub(crate) fn parallelism(_: usize) -> Par {
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

/// Whether parts with factors of these sizes, in scalars, are worth a thread each.
pub(crate) fn worthwhile(scalars: impl Iterator<Item = usize>) -> bool {
    cfg!(feature = "rayon") && scalars.filter(|scalars| *scalars >= GRAIN).count() > 1
}

/// Does something to every part, on several threads. What fails first in the order of the parts is told.
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
