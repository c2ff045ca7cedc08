//! Which of the mutants in these sources is alive in this process: the one whose number the environment has.
//!
//! `MUTANT=7` brings number 7 to life; `MUTANT_REACH=FILE` none, and writes the number of each that is asked for.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

const RECORD: u32 = u32::MAX - 1;
const UNKNOWN: u32 = u32::MAX;

static ALIVE: AtomicU32 = AtomicU32::new(UNKNOWN);
static SEEN: [AtomicU64; 256] = [const { AtomicU64::new(0) }; 256];
static REACH: OnceLock<File> = OnceLock::new();

#[inline(always)]
pub(crate) fn is(number: u32) -> bool {
    let alive = ALIVE.load(Relaxed);
    alive == number || (alive >= RECORD && ask(number))
}

#[cold]
#[inline(never)]
fn ask(number: u32) -> bool {
    if ALIVE.load(Relaxed) == UNKNOWN {
        let alive = match std::env::var_os("MUTANT_REACH") {
            Some(file) => {
                let open = || OpenOptions::new().create(true).append(true).open(file);
                REACH.get_or_init(|| open().expect("the file of reach"));
                RECORD
            }
            None => std::env::var("MUTANT").ok().and_then(|number| number.parse().ok()).unwrap_or(0),
        };
        ALIVE.store(alive, Relaxed);
    }
    if ALIVE.load(Relaxed) == RECORD {
        record(number);
    }
    ALIVE.load(Relaxed) == number
}

/// Without memory from the heap: there are tests that count what is taken from it.
fn record(number: u32) {
    let bit = 1 << (number % 64);
    if SEEN[number as usize / 64].fetch_or(bit, Relaxed) & bit == 0 {
        let (mut line, mut rest) = (*b"00000\n", number);
        for digit in line[..5].iter_mut().rev() {
            *digit = b'0' + (rest % 10) as u8;
            rest /= 10;
        }
        if let Some(mut file) = REACH.get() {
            file.write_all(&line).expect("the file of reach");
        }
    }
}
