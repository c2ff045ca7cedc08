//! The allocator of the system with a limit: what a program does that finds no memory. Large blocks alone are counted
//! and refused, for small ones nobody can do without. An allocator cannot be written without `unsafe`, which the
//! packages that use this one forbid.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ptr;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

/// To be named in a test binary of its own: `#[global_allocator] static ALLOCATOR: Refusing = Refusing;`.
#[derive(Debug)]
pub struct Refusing;

/// From so many bytes on a block is large.
pub const LARGE: usize = 160 << 10;

/// Bytes in large blocks.
static USED: AtomicUsize = AtomicUsize::new(0);
/// Bytes that may be in large blocks.
static LIMIT: AtomicUsize = AtomicUsize::new(usize::MAX);
/// Bytes in use when watching began, the most since, and those that it took to get there, one after the other.
static BEFORE: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(usize::MAX);
static PEAKS: [AtomicUsize; 256] = [const { AtomicUsize::new(0) }; 256];
static COUNT: AtomicUsize = AtomicUsize::new(0);
/// Blocks that were refused.
static REFUSED: AtomicUsize = AtomicUsize::new(0);

/// Does some work, and returns each new maximum of the bytes in large blocks beyond those before, on all threads.
///
/// # Panics
///
/// If there are more than 256.
pub fn peaks<R>(act: impl FnOnce() -> R) -> (R, Vec<usize>) {
    let before = USED.load(SeqCst);
    COUNT.store(0, SeqCst);
    BEFORE.store(before, SeqCst);
    MOST.store(before, SeqCst);
    let result = act();
    MOST.store(usize::MAX, SeqCst);
    let count = COUNT.load(SeqCst);
    assert!(count <= PEAKS.len(), "{count} maxima");
    (result, PEAKS[..count].iter().map(|peak| peak.load(SeqCst)).collect())
}

/// From now on large blocks are refused that would make more than so many bytes of large blocks beyond those that there
/// are.
pub fn limit(bytes: usize) {
    REFUSED.store(0, SeqCst);
    LIMIT.store(USED.load(SeqCst) + bytes, SeqCst);
}

/// Refuses nothing any more; returns how many blocks were refused.
pub fn unlimited() -> usize {
    LIMIT.store(usize::MAX, SeqCst);
    REFUSED.load(SeqCst)
}

fn share(bytes: usize) -> usize {
    if bytes >= LARGE { bytes } else { 0 }
}

/// Counts a block in place of another one, if it is admitted.
fn admit(bytes: usize, instead: usize) -> bool {
    let (new, old) = (share(bytes), share(instead));
    let used = USED.load(SeqCst) - old + new;
    if new > old && used > LIMIT.load(SeqCst) {
        REFUSED.fetch_add(1, SeqCst);
        return false;
    }
    USED.fetch_add(new, SeqCst);
    USED.fetch_sub(old, SeqCst);
    if used > MOST.load(SeqCst) && MOST.load(SeqCst) != usize::MAX {
        MOST.store(used, SeqCst);
        if let Some(peak) = PEAKS.get(COUNT.fetch_add(1, SeqCst)) {
            peak.store(used - BEFORE.load(SeqCst), SeqCst);
        }
    }
    true
}

// SAFETY: all is done by the allocator of the system; a null pointer says that there is no memory, and leaves a block
// that was to grow as it is.
unsafe impl GlobalAlloc for Refusing {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if admit(layout.size(), 0) { unsafe { System.alloc(layout) } } else { ptr::null_mut() }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if admit(layout.size(), 0) { unsafe { System.alloc_zeroed(layout) } } else { ptr::null_mut() }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if admit(size, layout.size()) { unsafe { System.realloc(block, layout, size) } } else { ptr::null_mut() }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        USED.fetch_sub(share(layout.size()), SeqCst);
        unsafe { System.dealloc(block, layout) }
    }
}
