//! The copy of the package that has all drawn mutants, and what compiles of it.

use crate::draw::{self, Draw};
use crate::files::{failed, put, read};
use crate::schema::{self, Place};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const HOOK: &str = include_str!("hook.rs");

/// A package, its copy, and where cargo builds.
pub struct Package {
    pub copy: PathBuf,
    pub target: PathBuf,
    /// Texts of all files that may have mutants.
    pub texts: BTreeMap<String, String>,
}

/// A test binary.
#[derive(Clone, Debug)]
pub struct Binary {
    pub name: String,
    pub executable: PathBuf,
}

impl Package {
    /// Copies the files that the repository has, or would have, but those of `.ci`.
    pub fn copy(source: &Path, copy: &Path, target: &Path) -> Result<Self, String> {
        let mut list = Command::new("git");
        list.args(["ls-files", "--cached", "--others", "--exclude-standard"]).current_dir(source);
        let listed = list.output().map_err(|error| format!("git: {error}"))?;
        let mut texts = BTreeMap::new();
        for path in String::from_utf8_lossy(&listed.stdout).lines().filter(|path| !path.starts_with(".ci/")) {
            let from = source.join(path);
            if path.starts_with("src/") && from.extension().is_some_and(|kind| kind == "rs") {
                texts.insert(path.to_owned(), read(&from)?);
            } else if from.is_file() {
                put(&copy.join(path), &fs::read(&from).map_err(|error| failed(&from, &error))?)?;
            }
        }
        Ok(Self { copy: copy.to_owned(), target: target.to_owned(), texts })
    }

    /// A number that changes with the sources and the mutants in them.
    pub fn stamp(&self, draw: &Draw) -> String {
        let keys = draw.drawn().into_iter().map(|mutant| mutant.key.as_str());
        let texts = self.texts.iter().flat_map(|(path, text)| [path.as_str(), text.as_str()]);
        format!("{:016x}", texts.chain(keys).fold(0, draw::chance))
    }

    /// Writes the sources with the mutants that are drawn, numbered from one in their order.
    fn write(&self, draw: &Draw) -> Result<BTreeMap<String, Vec<Place>>, String> {
        let mut places = BTreeMap::new();
        let drawn = draw.drawn();
        for (path, text) in &self.texts {
            let own = drawn.iter().enumerate().filter(|(_, mutant)| mutant.path == *path);
            let numbered: Vec<_> = own.map(|(at, mutant)| (at + 1, *mutant)).collect();
            let (mut written, own_places) = schema::write(text, &numbered);
            if path == "src/lib.rs" {
                written.push_str("\n#[allow(warnings)]\nmod mutant;\n");
            }
            put(&self.copy.join(path), written.as_bytes())?;
            places.insert(path.clone(), own_places);
        }
        put(&self.copy.join("src/mutant.rs"), HOOK.as_bytes())?;
        Ok(places)
    }

    /// Compiles the tests. Mutants that do not compile go, and others come in their place, until all do.
    pub fn compile(&self, draw: &mut Draw) -> Result<Vec<Binary>, String> {
        loop {
            let places = self.write(draw)?;
            // The check is quick, and finds nearly all.
            for arguments in [&["check", "--lib"][..], &["test", "--lib", "--tests", "--no-run"]] {
                let messages = self.cargo(arguments)?;
                let Some(numbers) = culprits(&messages, &places) else {
                    return Err(report(&messages));
                };
                if !numbers.is_empty() {
                    eprintln!("{} mutants do not compile", numbers.len());
                    draw.does_not_compile(&numbers)?;
                    break;
                }
                if arguments[0] == "test" {
                    return Ok(binaries(&messages));
                }
            }
        }
    }

    fn cargo(&self, arguments: &[&str]) -> Result<Vec<Value>, String> {
        let mut cargo = Command::new("cargo");
        cargo.args(arguments).args(["--all-features", "--message-format=json", "--quiet", "--target-dir"]);
        cargo.arg(&self.target).current_dir(&self.copy).env("CARGO_INCREMENTAL", "0");
        let output = cargo.stderr(Stdio::inherit()).output().map_err(|error| format!("cargo: {error}"))?;
        let lines = String::from_utf8_lossy(&output.stdout).into_owned();
        let messages: Vec<Value> = lines.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        if !output.status.success() && errors(&messages).next().is_none() {
            return Err(format!("cargo {}: {}", arguments.join(" "), output.status));
        }
        Ok(messages)
    }
}

fn errors(messages: &[Value]) -> impl Iterator<Item = &Value> {
    let compiler = messages.iter().filter(|message| message["reason"] == "compiler-message");
    compiler.map(|message| &message["message"]).filter(|message| message["level"] == "error")
}

/// The files and places that a message names, the first ones first.
fn spans(message: &Value) -> Vec<(String, Range<usize>)> {
    let mut found = Vec::new();
    let mut own: Vec<&Value> = message["spans"].as_array().into_iter().flatten().collect();
    own.sort_by_key(|span| span["is_primary"] != true);
    for span in own {
        // (Of a macro the place that calls it.)
        let mut at = span;
        while at["expansion"]["span"].is_object() {
            at = &at["expansion"]["span"];
        }
        let byte = |name: &str| at[name].as_u64().and_then(|byte| usize::try_from(byte).ok()).unwrap_or(0);
        found.push((at["file_name"].as_str().unwrap_or_default().to_owned(), byte("byte_start")..byte("byte_end")));
    }
    found
}

/// Numbers of the mutants that errors come from; `None` if there are errors of no mutant alone.
fn culprits(messages: &[Value], places: &BTreeMap<String, Vec<Place>>) -> Option<BTreeSet<usize>> {
    let (mut numbers, mut errors_seen) = (BTreeSet::new(), false);
    for message in errors(messages) {
        errors_seen = true;
        let culprit = |(path, at): &(String, Range<usize>)| schema::culprit(places.get(path)?, at);
        numbers.extend(spans(message).iter().find_map(culprit));
    }
    (!errors_seen || !numbers.is_empty()).then_some(numbers)
}

fn report(messages: &[Value]) -> String {
    errors(messages).filter_map(|message| message["rendered"].as_str()).take(3).collect()
}

fn binaries(messages: &[Value]) -> Vec<Binary> {
    let mut found = Vec::new();
    for message in messages {
        if message["reason"] == "compiler-artifact"
            && message["profile"]["test"] == true
            && let Some(executable) = message["executable"].as_str()
        {
            let library = message["target"]["kind"][0] == "lib";
            let name = if library { "lib" } else { message["target"]["name"].as_str().unwrap_or_default() };
            found.push(Binary { name: name.into(), executable: executable.into() });
        }
    }
    found
}
