//! What the targets share: numbers, choices and edits from the bytes that the fuzzer hands over.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use std::path::PathBuf;

/// Numbers that programs forget.
const ODD: [f64; 16] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    -0.0,
    1e-160,
    -1e160,
    1e308,
    f64::EPSILON,
    1e-12,
    4503599627370497.0,
    1e19,
];

/// The bytes, taken from the front; behind their end all are zero.
pub struct Input<'a>(pub &'a [u8]);

impl Input<'_> {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    /// A number below `count`, which is from 1 to 256.
    pub fn below(&mut self, count: usize) -> usize {
        usize::from(self.byte()) % count
    }

    pub fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    /// A number: mostly a plain one, which lets a scene run; sometimes an odd one, or any bits.
    pub fn number(&mut self) -> f64 {
        match self.byte() {
            kind @ 0..=239 => {
                let size = [0.01, 0.125, 1.0, 1.0, 10.0, 1e4][usize::from(kind) % 6];
                size * (f64::from(self.byte()) - 128.0) / 32.0
            }
            kind @ 240..=251 => ODD[(usize::from(kind) + self.below(256)) % ODD.len()],
            _ => f64::from_bits(u64::from_le_bytes(std::array::from_fn(|_| self.byte()))),
        }
    }

    /// The same without its sign, for what has to be positive to be taken.
    pub fn size(&mut self) -> f64 {
        match self.number() {
            0.0 => 1.0,
            number => number.abs(),
        }
    }

    /// So many numbers.
    pub fn numbers(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.number()).collect()
    }

    /// A square matrix of at most twelve entries beside its diagonal: symmetric as a rule.
    pub fn matrix(&mut self, n: usize) -> SparseColMat<usize, f64> {
        let mut entries: Vec<_> = match self.below(4) {
            0 => Vec::new(),
            _ => (0..n).map(|i| Triplet::new(i, i, 8.0 * self.size())).collect(),
        };
        let symmetric = self.below(8) > 0;
        for _ in 0..self.below(13) {
            let (i, j, value) = (self.below(n), self.below(n), self.number());
            entries.push(Triplet::new(i, j, value));
            if symmetric && i != j {
                entries.push(Triplet::new(j, i, value));
            }
        }
        SparseColMat::try_new_from_triplets(n, n, &entries).expect("places in the matrix")
    }

    /// A file as it should be, with bytes replaced, left out, doubled, or its end cut off.
    pub fn edited(&mut self, file: &[u8]) -> Vec<u8> {
        let mut file = file.to_vec();
        for _ in 0..self.below(9) {
            let at = (self.below(256) * 256 + self.below(256)) % file.len().max(1);
            match self.below(6) {
                0 => file.truncate(at),
                1 if !file.is_empty() => drop(file.remove(at)),
                2 => file.insert(at, self.byte()),
                3 => {
                    let end = (at + 1 + self.below(32)).min(file.len());
                    let piece: Vec<_> = file.get(at..end).unwrap_or_default().to_vec();
                    file.splice(at..at, piece);
                }
                4 => {
                    let words = ["nan", "-1", "0", "99999999999999999999", "1e999", ",", "\n", "%", "-", "inf"];
                    file.splice(at..at, words[self.below(words.len())].bytes());
                }
                _ => {
                    if let Some(place) = file.get_mut(at) {
                        *place = self.byte();
                    }
                }
            }
        }
        file
    }
}

/// A folder of this process alone, in memory where the machine has such a place.
pub fn folder() -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let place = if memory.is_dir() { memory } else { std::env::temp_dir() };
    let folder = place.join(format!("contact-dynamics-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the files of one input");
    folder
}
