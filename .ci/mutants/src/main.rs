//! What the tests see: mutants drawn from the sources, and which of them tests kill.
//!
//! ```text
//! mutants [--seed N] [--count N] [--seconds N] [--jobs N] [--again] [--mutants WORD] [--tests WORD] [--list | --quick]
//! ```
//!
//! Run in the root of the repository. So many mutants of every room (`rooms.rs`) are drawn from all that there are
//! (`find.rs`), by a seed, and are written into one copy of the sources, where each waits for its number (`schema.rs`,
//! `hook.rs`). Tests are compiled once. Each is run once without a mutant, which tells the mutants that it reaches; a
//! test that fails in the copy is left out. Then each mutant meets the tests that reach it, each in a process of its
//! own, those of its room and the short ones first, until one fails, or takes five times as long as without it and ten
//! seconds. `--seconds` is how long the tests of one mutant may take (without it) in all. Tests are those of
//! `cargo test --lib --tests`; programs in documents are none of them.
//!
//! All that was found is kept in `target/mutants`, and a run goes on where the last one ended. What a test reaches is
//! asked again where the sources or the sample change, and of new tests; of one that was changed when its line in
//! `reach` is deleted. `--again` runs those
//! anew that were alive, `--mutants` those with a word in their names, `--tests` only tests with a word in theirs.
//! `equivalent.txt` has those in which nothing can be seen, each with the reason; they count apart.
//!
//! `--list` shows the mutants that are drawn, and compiles nothing. `--quick` runs all of this on a package of a few
//! lines, `sample`, whose mutants have known ends.

mod compile;
mod draw;
mod files;
mod find;
mod rooms;
mod schema;
mod suite;
mod table;

use compile::Package;
use draw::Draw;
use files::{put, read};
use find::Mutant;
use rooms::{ROOMS, Room, SAMPLE};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use suite::{Outcome, Suite};
use table::Count;

struct Options {
    seed: u64,
    count: usize,
    seconds: f64,
    jobs: usize,
    again: bool,
    list: bool,
    quick: bool,
    mutants: String,
    tests: String,
}

impl Options {
    fn read() -> Result<Self, String> {
        let (mutants, tests) = (String::new(), String::new());
        let mut options = Self {
            seed: 1,
            count: 16,
            seconds: f64::INFINITY,
            jobs: 2,
            again: false,
            list: false,
            quick: false,
            mutants,
            tests,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(option) = arguments.next() {
            match option.as_str() {
                "--again" => options.again = true,
                "--list" => options.list = true,
                "--quick" => options.quick = true,
                _ => {
                    let value = arguments.next().ok_or_else(|| format!("{option} is unknown, or needs a value"))?;
                    let number = || value.parse::<u32>().map_err(|_| format!("{option} {value} is no number"));
                    match option.as_str() {
                        "--seed" => options.seed = number()?.into(),
                        "--count" => options.count = number()? as usize,
                        "--seconds" => options.seconds = number()?.into(),
                        "--jobs" => options.jobs = number()?.max(1) as usize,
                        "--mutants" => options.mutants = value,
                        "--tests" => options.tests = value,
                        _ => return Err(format!("{option} is unknown")),
                    }
                }
            }
        }
        Ok(options)
    }
}

/// Names of mutants in which nothing can be seen: lines that begin with `src/`; the reason is below each.
fn equivalents(path: &Path) -> Result<Vec<String>, String> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    Ok(read(path)?.lines().filter(|line| line.starts_with("src/")).map(str::to_owned).collect())
}

/// The ends of mutants by their names, in a file to which each run adds.
struct Ends {
    file: PathBuf,
    known: Mutex<BTreeMap<String, Outcome>>,
}

impl Ends {
    fn read(file: PathBuf) -> Self {
        let mut known = BTreeMap::new();
        for line in fs::read_to_string(&file).unwrap_or_default().lines() {
            let fields: Vec<&str> = line.split('\t').collect();
            let number = |at: usize| fields.get(at).and_then(|field: &&str| field.parse().ok()).unwrap_or(0);
            let outcome = match fields[..] {
                [_, "killed", by] => Outcome::Killed { by: by.into(), late: false },
                [_, "late", by] => Outcome::Killed { by: by.into(), late: true },
                [_, "alive", _, _] => Outcome::Alive { passed: number(2), left_out: number(3) },
                // (A line that was not written to its end.)
                _ => continue,
            };
            known.insert(fields[0].to_owned(), outcome);
        }
        Self { file, known: Mutex::new(known) }
    }

    fn of(&self, key: &str) -> Option<Outcome> {
        self.known.lock().expect("no panic").get(key).cloned()
    }

    fn add(&self, key: &str, outcome: Outcome) -> Result<(), String> {
        let mut known = self.known.lock().expect("no panic");
        known.insert(key.into(), outcome);
        let line = |(key, outcome): (&String, &Outcome)| match outcome {
            Outcome::Killed { by, late: false } => format!("{key}\tkilled\t{by}\n"),
            Outcome::Killed { by, late: true } => format!("{key}\tlate\t{by}\n"),
            Outcome::Alive { passed, left_out } => format!("{key}\talive\t{passed}\t{left_out}\n"),
        };
        put(&self.file, known.iter().map(line).collect::<String>().as_bytes())
    }
}

/// The mutants that are drawn from a package.
struct Drawn {
    package: Package,
    draw: Draw,
    /// The folder in which all is kept.
    state: PathBuf,
}

impl Drawn {
    /// `folder` keeps what is found, `place` the copy of the package.
    fn new(
        options: &Options,
        rooms: &'static [Room],
        source: &Path,
        [folder, place]: [&str; 2],
    ) -> Result<Self, String> {
        let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| "target".into(), PathBuf::from);
        let target = std::path::absolute(target).map_err(|error| error.to_string())?;
        let state = target.join("mutants").join(folder);
        fs::create_dir_all(&state).map_err(|error| format!("{}: {error}", state.display()))?;
        // (One place for all seeds: cargo tells packages by their names and places below, and took the binaries of
        // another seed for its own.)
        let package = Package::copy(source, &target.join("mutants").join(place), &target)?;
        let draw = Draw::new(rooms, &package.texts, options.seed, options.count, &state)?;
        Ok(Self { package, draw, state })
    }
}

/// The mutants of a package and what became of them.
struct Run {
    options: Options,
    rooms: &'static [Room],
    package: Package,
    draw: Draw,
    suite: Suite,
    ends: Ends,
    equivalent: Vec<String>,
}

impl Run {
    fn new(options: Options, rooms: &'static [Room], drawn: Drawn) -> Result<Self, String> {
        let Drawn { package, mut draw, state } = drawn;
        let binaries = package.compile(&mut draw)?;
        eprintln!("{} mutants drawn; tests without them", draw.drawn().len());
        let suite = Suite::reach(&binaries, &package.stamp(&draw), &package.copy, &state, options.jobs)?;
        let seconds: f64 = suite.tests.iter().map(|test| test.seconds).sum();
        eprintln!("{} tests, {seconds:.0} s one after the other", suite.tests.len());
        for test in suite.tests.iter().filter(|test| !test.passes) {
            eprintln!("fails without a mutant, left out: {}", test.full_name());
        }
        let equivalent = equivalents(Path::new(".ci/mutants/equivalent.txt"))?;
        let ends = Ends::read(state.join("ends.txt"));
        Ok(Self { options, rooms, package, draw, suite, ends, equivalent })
    }

    fn is_equivalent(&self, mutant: &Mutant) -> bool {
        self.equivalent.contains(&mutant.key)
    }

    fn judge(&self) -> Result<(), String> {
        let (drawn, options) = (self.draw.drawn(), &self.options);
        let alive = |key: &str| matches!(self.ends.of(key), Some(Outcome::Alive { .. }));
        let open = |(_, mutant): &(usize, &&Mutant)| {
            let key = &mutant.key;
            key.contains(&options.mutants) && (self.ends.of(key).is_none() || (options.again && alive(key)))
        };
        let open: Vec<(usize, &&Mutant)> = drawn.iter().enumerate().filter(open).collect();
        suite::side_by_side(options.jobs, open.len(), |at| {
            let (place, mutant) = open[at];
            let number = place + 1;
            let Some(room) = self.rooms.iter().find(|room| room.has(&mutant.path)) else {
                return Ok(());
            };
            if self.is_equivalent(mutant) || !self.suite.reached(number) {
                return Ok(());
            }
            let outcome = self.suite.judge(number, room, options.seconds, &options.tests)?;
            eprintln!("{}/{} {}: {outcome:?}", at + 1, open.len(), mutant.key);
            // (That some of the tests see nothing is no end.)
            match outcome {
                Outcome::Alive { .. } if !options.tests.is_empty() => Ok(()),
                end => self.ends.add(&mutant.key, end),
            }
        })
    }

    fn count(&self) -> Vec<(&'static str, Count)> {
        let (mut counts, mut number) = (Vec::new(), 0);
        for pool in &self.draw.rooms {
            let mut count =
                Count { all: pool.mutants.len(), not_compiling: self.draw.in_vain(pool), ..Count::default() };
            for mutant in self.draw.of_room(pool) {
                number += 1;
                count.drawn += 1;
                match self.ends.of(&mutant.key) {
                    _ if self.is_equivalent(mutant) => count.equivalent += 1,
                    _ if !self.suite.reached(number) => count.not_reached += 1,
                    Some(Outcome::Killed { late, .. }) => {
                        count.killed += 1;
                        count.late += usize::from(late);
                    }
                    Some(Outcome::Alive { .. }) => count.alive += 1,
                    // Not judged yet: not of the sample.
                    None => count.drawn -= 1,
                }
            }
            counts.push((pool.name, count));
        }
        counts
    }

    /// Those that are not killed, each with its place and the change.
    fn living(&self) -> String {
        let mut text = String::new();
        for (at, mutant) in self.draw.drawn().into_iter().enumerate() {
            let end = match self.ends.of(&mutant.key) {
                _ if self.is_equivalent(mutant) => "equivalent".into(),
                _ if !self.suite.reached(at + 1) => "not reached".into(),
                Some(Outcome::Alive { passed, left_out: 0 }) => format!("not seen by {passed} tests"),
                Some(Outcome::Alive { passed, left_out }) => {
                    format!("not seen by {passed} tests, without {left_out} long ones")
                }
                _ => continue,
            };
            let (original, mutated) = mutant.shown(&self.package.texts[&mutant.path]);
            text +=
                &format!("{}:{}: {end}\n  - {original}\n  + {mutated}\n  {}\n", mutant.path, mutant.line, mutant.key);
        }
        text
    }
}

/// The sample package, all of whose mutants end as `expected.txt` has it.
fn quick(options: Options) -> Result<(), String> {
    let (source, options) = (Path::new(".ci/mutants/sample"), Options { count: usize::MAX, ..options });
    let drawn = Drawn::new(&options, &SAMPLE, source, ["sample", "sample/package"])?;
    let mut run = Run::new(options, &SAMPLE, drawn)?;
    // (Nothing of earlier runs.)
    run.ends.known = Mutex::default();
    run.judge()?;
    let mut found = String::new();
    for (at, mutant) in run.draw.drawn().into_iter().enumerate() {
        let end = match run.ends.of(&mutant.key) {
            _ if !run.suite.reached(at + 1) => "not reached",
            Some(Outcome::Killed { late: false, .. }) => "killed",
            Some(Outcome::Killed { late: true, .. }) => "late",
            _ => "not seen",
        };
        let (original, mutated) = mutant.shown(&run.package.texts[&mutant.path]);
        found += &format!("{}: {original} -> {mutated}: {end}\n", mutant.line);
    }
    let mut lines: Vec<&str> = found.lines().collect();
    lines.sort_by_key(|line| line.split(':').next().and_then(|number| number.parse::<usize>().ok()));
    let found = lines.join("\n") + &format!("\nnot compiling: {}\n", run.draw.in_vain(&run.draw.rooms[0]));
    let expected = read(&source.join("expected.txt"))?;
    print!("{found}");
    if found == expected { Ok(()) } else { Err(format!("expected was\n{expected}")) }
}

fn run() -> Result<(), String> {
    let options = Options::read()?;
    if options.quick {
        return quick(options);
    }
    let drawn = Drawn::new(&options, &ROOMS, Path::new("."), [&format!("seed-{}", options.seed), "package"])?;
    if options.list {
        for (at, mutant) in drawn.draw.drawn().into_iter().enumerate() {
            println!("{} {}:{} {}", at + 1, mutant.path, mutant.line, mutant.key);
        }
        return Ok(());
    }
    let run = Run::new(options, &ROOMS, drawn)?;
    run.judge()?;
    println!("{}\n{}", run.living(), table::print(&run.count()));
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
