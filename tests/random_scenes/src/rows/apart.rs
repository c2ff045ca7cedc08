//! What needs crates of its own: runs in a pool of threads, checkpoints in files. Without the feature `whole` all is
//! done by the thread at hand, and in memory.

use contact_dynamics::{Real, Result, Simulation, SimulationBuilder};

/// Acts in a pool of so many threads.
#[cfg(feature = "whole")]
pub(super) fn on_threads<R: Send>(threads: usize, act: impl FnOnce() -> R + Send) -> R {
    use std::sync::OnceLock;
    static POOLS: [OnceLock<rayon::ThreadPool>; 4] = [const { OnceLock::new() }; 4];
    let pool = || rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had");
    POOLS[threads].get_or_init(pool).install(act)
}

#[cfg(not(feature = "whole"))]
pub(super) fn on_threads<R: Send>(_: usize, act: impl FnOnce() -> R + Send) -> R {
    act()
}

/// A run that goes on from what two files say of another one: text, and bytes that what is read from it is written to.
///
/// # Panics
///
/// If what is read from one is not what was written to the other.
#[cfg(feature = "whole")]
pub(super) fn by_files<T: Real + serde::Serialize + serde::de::DeserializeOwned>(
    run: &Simulation<'static, T>,
    builder: SimulationBuilder<'static, T>,
) -> Result<Simulation<'static, T>> {
    use contact_dynamics::Checkpoint;
    let written = run.checkpoint();
    let text = serde_json::to_string(&written).expect("a checkpoint is plain data");
    let read: Checkpoint<T> = serde_json::from_str(&text).unwrap_or_else(|error| panic!("a text is refused: {error}"));
    let [before, after] =
        [&written, &read].map(|checkpoint| postcard::to_stdvec(checkpoint).expect("a checkpoint is plain data"));
    assert!(before == after, "text and bytes of a checkpoint differ");
    let read = postcard::from_bytes(&after).unwrap_or_else(|error| panic!("bytes are refused: {error}"));
    builder.resume_from(read).build()
}

#[cfg(not(feature = "whole"))]
pub(super) fn by_files<T: Real>(
    run: &Simulation<'static, T>,
    builder: SimulationBuilder<'static, T>,
) -> Result<Simulation<'static, T>> {
    builder.resume(run.state().clone(), run.history().clone()).build()
}
