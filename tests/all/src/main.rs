//! Runs all tests of the workspace with all features, and says how many passed: `cargo all-tests`.
//!
//! Examples are not built: `.ci/run` builds and runs them.

use std::io::{BufRead, BufReader};
use std::process::{Command, ExitCode, Stdio};

fn main() -> ExitCode {
    let mut passed = 0;
    for kinds in [&["--lib", "--bins", "--tests"][..], &["--doc"]] {
        if let Err(message) = run(kinds, &mut passed) {
            eprintln!("{message}; {passed} tests have passed");
            return ExitCode::FAILURE;
        }
    }
    println!("\nAll {passed} tests passed.");
    ExitCode::SUCCESS
}

/// Runs the tests of some kinds, prints what they print, and counts those that pass.
fn run(kinds: &[&str], passed: &mut u64) -> Result<(), String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut child = Command::new(cargo)
        .args(["test", "--workspace", "--all-features"])
        .args(kinds)
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|error| format!("cargo does not start: {error}"))?;
    for line in child.stdout.take().into_iter().flat_map(|output| BufReader::new(output).lines()) {
        let line = line.map_err(|error| format!("the output cannot be read: {error}"))?;
        println!("{line}");
        *passed += count(&line);
    }
    match child.wait() {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err("A test failed".to_string()),
        Err(error) => Err(format!("cargo was lost: {error}")),
    }
}

/// How many tests passed by a line like `test result: ok. 12 passed; 0 failed; …`.
fn count(line: &str) -> u64 {
    let words: Vec<&str> = line.strip_prefix("test result: ").into_iter().flat_map(|rest| rest.split(' ')).collect();
    words.windows(2).find(|pair| pair[1].starts_with("passed")).and_then(|pair| pair[0].parse().ok()).unwrap_or(0)
}
