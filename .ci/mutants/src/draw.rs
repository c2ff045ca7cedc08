//! The sample: so many mutants of each room, by a seed.

use crate::find::{self, Mutant};
use crate::rooms::Room;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

pub struct Draw {
    /// How many of each room.
    count: usize,
    pub rooms: Vec<Pool>,
    /// Names of those that do not compile, which the file keeps.
    not_compiling: BTreeSet<String>,
    file: PathBuf,
}

/// The mutants of a room in the order in which they are drawn.
pub struct Pool {
    pub name: &'static str,
    pub mutants: Vec<Mutant>,
}

/// A number that depends on all bits of seed and name. The order of these numbers is by chance, and is the same for
/// mutants that stay when others come and go (Fowler, Noll and Vo; then mixed).
pub fn chance(seed: u64, name: &str) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64 ^ seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for byte in name.bytes() {
        hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
    hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    hash ^ (hash >> 31)
}

impl Draw {
    pub fn new(
        rooms: &'static [Room],
        texts: &BTreeMap<String, String>,
        seed: u64,
        count: usize,
        folder: &Path,
    ) -> Result<Self, String> {
        let mut pools: Vec<Pool> = rooms.iter().map(|room| Pool { name: room.name, mutants: Vec::new() }).collect();
        for (path, text) in texts.iter().filter(|(path, _)| !path.ends_with("tests.rs")) {
            if let Some(room) = rooms.iter().position(|room| room.has(path)) {
                pools[room].mutants.extend(find::mutants(path, text)?);
            }
        }
        for pool in &mut pools {
            pool.mutants.sort_by_cached_key(|mutant| chance(seed, &mutant.key));
        }
        let file = folder.join("not_compiling.txt");
        let kept = std::fs::read_to_string(&file).unwrap_or_default();
        Ok(Self { count, rooms: pools, not_compiling: kept.lines().map(str::to_owned).collect(), file })
    }

    pub fn of_room<'d>(&'d self, pool: &'d Pool) -> impl Iterator<Item = &'d Mutant> {
        pool.mutants.iter().filter(|mutant| !self.not_compiling.contains(&mutant.key)).take(self.count)
    }

    /// All that are drawn; number n stands at n − 1.
    pub fn drawn(&self) -> Vec<&Mutant> {
        self.rooms.iter().flat_map(|pool| self.of_room(pool)).collect()
    }

    /// How many of a room were drawn in vain.
    pub fn in_vain(&self, pool: &Pool) -> usize {
        let last = self.of_room(pool).last().map(|mutant| &mutant.key);
        let before = pool.mutants.iter().take_while(|mutant| Some(&mutant.key) != last);
        before.filter(|mutant| self.not_compiling.contains(&mutant.key)).count()
    }

    pub fn does_not_compile(&mut self, numbers: &BTreeSet<usize>) -> Result<(), String> {
        let keys: Vec<String> = {
            let drawn = self.drawn();
            numbers.iter().map(|number| drawn[number - 1].key.clone()).collect()
        };
        self.not_compiling.extend(keys);
        let lines: Vec<&str> = self.not_compiling.iter().map(String::as_str).collect();
        crate::files::put(&self.file, lines.join("\n").as_bytes())
    }
}
