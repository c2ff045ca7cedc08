//! Which of the mutants in these sources is alive in this process: the one whose number the environment has.
//!
//! `MUTANT=7` brings number 7 to life; `MUTANT_REACH=FILE` none, and writes the number of each that is asked for.

use std::ffi::OsStr;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::ffi::OsStrExt;
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
        ALIVE.store(read(), Relaxed);
    }
    if ALIVE.load(Relaxed) == RECORD {
        record(number);
    }
    ALIVE.load(Relaxed) == number
}

/// What the environment says. (Apart, for its memory on the stack takes a time.)
#[cold]
#[inline(never)]
fn read() -> u32 {
    let mut environment = [0; 1 << 17];
    match variable(b"MUTANT_REACH=", &mut environment) {
        Some(file) => {
            let open = || OpenOptions::new().create(true).append(true).open(OsStr::from_bytes(file));
            REACH.get_or_init(|| open().expect("the file of reach"));
            RECORD
        }
        None => {
            let number = variable(b"MUTANT=", &mut environment).and_then(|number| std::str::from_utf8(number).ok());
            number.and_then(|number| number.parse().ok()).unwrap_or(0)
        }
    }
}

/// What stands behind a name in the environment. Without memory from the heap, as all of this: there are tests that
/// count what is taken from it.
fn variable<'b>(name: &[u8], environment: &'b mut [u8]) -> Option<&'b [u8]> {
    let mut size = 0;
    let mut file = File::open("/proc/self/environ").ok()?;
    loop {
        match file.read(&mut environment[size..]).ok()? {
            0 => break,
            more => size += more,
        }
    }
    environment[..size].split(|&byte| byte == 0).find_map(|entry| entry.strip_prefix(name))
}

/// Writes a number down the first time that it is asked for.
fn record(number: u32) {
    let (seen, bit) = (&SEEN[number as usize / 64], 1 << (number % 64));
    if seen.load(Relaxed) & bit == 0 && seen.fetch_or(bit, Relaxed) & bit == 0 {
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
