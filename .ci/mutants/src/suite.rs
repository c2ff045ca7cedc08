//! The tests: which there are, what they reach, and whether they see a mutant.

use crate::compile::Binary;
use crate::files::{put, read};
use crate::rooms::Room;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Memory of a test, in KiB: a mutant may ask for all of it.
const MEMORY: &str = "8000000";

/// A test, and what it does without a mutant.
pub struct Test {
    pub binary: Binary,
    pub name: String,
    pub seconds: f64,
    pub passes: bool,
    /// Numbers of the mutants that it reaches.
    pub reach: BTreeSet<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    Passed,
    Failed,
    /// It took longer than it may.
    Late,
}

/// What became of a mutant.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    Killed {
        by: String,
        late: bool,
    },
    /// With the tests that reach it and have passed, and those that time was too short for.
    Alive {
        passed: usize,
        left_out: usize,
    },
}

pub struct Suite {
    pub tests: Vec<Test>,
    folder: PathBuf,
}

impl Test {
    pub fn full_name(&self) -> String {
        format!("{}::{}", self.binary.name, self.name)
    }

    /// Runs the test alone, in a process of its own.
    fn run(&self, folder: &Path, environment: (&str, &str), limit: Duration) -> Result<End, String> {
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -v $0; exec \"$@\"", MEMORY]).arg(&self.binary.executable);
        command.args(["--exact", &self.name, "--test-threads=1"]).current_dir(folder);
        command.env("CARGO_MANIFEST_DIR", folder).env(environment.0, environment.1);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let (start, mut child) = (Instant::now(), command.spawn().map_err(|error| format!("sh: {error}"))?);
        let mut pause = Duration::from_millis(1);
        loop {
            match child.try_wait().map_err(|error| format!("{}: {error}", self.full_name()))? {
                Some(status) => return Ok(if status.success() { End::Passed } else { End::Failed }),
                None if start.elapsed() > limit => {
                    // (It may have ended meanwhile.)
                    let _ = child.kill();
                    child.wait().map_err(|error| format!("{}: {error}", self.full_name()))?;
                    return Ok(End::Late);
                }
                None => thread::sleep(pause),
            }
            pause = (pause * 5 / 4).min(Duration::from_millis(50));
        }
    }
}

/// Does a piece of work for each of `0..count` by several threads; ends with the first error.
pub fn side_by_side(
    jobs: usize,
    count: usize,
    work: impl Fn(usize) -> Result<(), String> + Sync,
) -> Result<(), String> {
    let (next, failure) = (AtomicUsize::new(0), Mutex::new(None));
    thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                while let at = next.fetch_add(1, Ordering::Relaxed)
                    && at < count
                {
                    if let Err(error) = work(at) {
                        next.store(count, Ordering::Relaxed);
                        *failure.lock().expect("no panic") = Some(error);
                    }
                }
            });
        }
    });
    failure.into_inner().expect("no panic").map_or(Ok(()), Err)
}

fn list(binary: &Binary, folder: &Path) -> Result<Vec<String>, String> {
    let mut command = Command::new(&binary.executable);
    let output = command.args(["--list", "--format", "terse"]).current_dir(folder).output();
    let output = output.map_err(|error| format!("{}: {error}", binary.executable.display()))?;
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    Ok(lines.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
}

impl Suite {
    /// Runs every test once without a mutant, but those whose reach is on disk with the stamp of the sources.
    pub fn reach(binaries: &[Binary], stamp: &str, folder: &Path, state: &Path, jobs: usize) -> Result<Self, String> {
        let mut tests = Vec::new();
        for binary in binaries {
            let text = read(&state.join("reach").join(&binary.name)).unwrap_or_default();
            let lines = text.strip_prefix(stamp).unwrap_or_default().lines();
            let known: Vec<Test> = lines.filter_map(|line| parse(binary, line)).filter(|test| test.passes).collect();
            for name in list(binary, folder)? {
                let known = known.iter().find(|test| test.name == name);
                let (binary, reach) = (binary.clone(), known.map(|test| test.reach.clone()).unwrap_or_default());
                let (seconds, passes) = known.map_or((0.0, false), |test| (test.seconds, true));
                tests.push((Test { binary, name, seconds, passes, reach }, known.is_some()));
            }
        }
        let fresh: Vec<usize> = (0..tests.len()).filter(|&test| !tests[test].1).collect();
        let runs = Mutex::new(Vec::new());
        side_by_side(jobs, fresh.len(), |at| {
            let test = &tests[fresh[at]].0;
            let file = state.join(format!("reach.{at}"));
            let _ = fs::remove_file(&file);
            let (start, limit) = (Instant::now(), Duration::from_mins(30));
            let end = test.run(folder, ("MUTANT_REACH", &file.to_string_lossy()), limit)?;
            let seconds = start.elapsed().as_secs_f64();
            // (There is no file if nothing was reached.)
            let reach = read(&file).unwrap_or_default().lines().filter_map(|line| line.parse().ok()).collect();
            let _ = fs::remove_file(&file);
            runs.lock().expect("no panic").push((fresh[at], seconds, end == End::Passed, reach));
            Ok(())
        })?;
        for (test, seconds, passes, reach) in runs.into_inner().expect("no panic") {
            let test = &mut tests[test].0;
            (test.seconds, test.passes, test.reach) = (seconds, passes, reach);
        }
        let tests: Vec<Test> = tests.into_iter().map(|(test, _)| test).collect();
        for binary in binaries {
            let mut text = stamp.to_owned();
            for test in tests.iter().filter(|test| test.binary.name == binary.name) {
                let reach: Vec<String> = test.reach.iter().map(ToString::to_string).collect();
                let fields = [&test.name, &test.seconds.to_string(), &test.passes.to_string(), &reach.join(" ")];
                text += &format!("\n{}", fields.map(String::as_str).join("\t"));
            }
            put(&state.join("reach").join(&binary.name), text.as_bytes())?;
        }
        Ok(Self { tests, folder: folder.to_owned() })
    }

    pub fn reached(&self, number: usize) -> bool {
        self.tests.iter().any(|test| test.passes && test.reach.contains(&number))
    }

    /// Runs the tests that reach a mutant, those of its room and the short ones first, until one fails, or until they
    /// would have taken so many seconds without it. Of all of these those with a word in their names.
    pub fn judge(&self, number: usize, room: &Room, seconds: f64, word: &str) -> Result<Outcome, String> {
        let cost = |test: &Test| test.seconds * if room.tests_with(&test.binary.name) { 1.0 } else { 4.0 };
        let reaches = |test: &&Test| test.passes && test.reach.contains(&number) && test.full_name().contains(word);
        let mut tests: Vec<&Test> = self.tests.iter().filter(reaches).collect();
        tests.sort_by(|one, other| cost(one).total_cmp(&cost(other)));
        let (mut spent, mut passed, mut left_out) = (0.0, 0, 0);
        for test in tests {
            if spent + test.seconds > seconds {
                left_out += 1;
                continue;
            }
            spent += test.seconds;
            let limit = Duration::from_secs_f64(10.0 + 5.0 * test.seconds);
            match test.run(&self.folder, ("MUTANT", &number.to_string()), limit)? {
                End::Passed => passed += 1,
                end => return Ok(Outcome::Killed { by: test.full_name(), late: end == End::Late }),
            }
        }
        Ok(Outcome::Alive { passed, left_out })
    }
}

fn parse(binary: &Binary, line: &str) -> Option<Test> {
    let mut fields = line.split('\t');
    let (name, seconds, passes) = (fields.next()?.to_owned(), fields.next()?.parse().ok()?, fields.next()? == "true");
    let reach = fields.next()?.split(' ').filter_map(|number| number.parse().ok()).collect();
    Some(Test { binary: binary.clone(), name, seconds, passes, reach })
}
