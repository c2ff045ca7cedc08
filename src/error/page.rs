//! Checks that `docs/errors.md` covers every variant: an input that provokes it, the remedy, and its meaning for a
//! host.

const PAGE: &str = include_str!("../../docs/errors.md");
const ERRORS: &str = include_str!("../error.rs");
const FAILURES: &str = include_str!("../contact_failure.rs");

/// The variants of an enum, read from its source.
fn variants(source: &str, name: &str) -> Vec<String> {
    let body = source.split(name).nth(1).and_then(|rest| rest.split("\n}").next()).unwrap();
    let names = body.lines().filter_map(|line| line.strip_prefix("    "));
    let names = names.filter(|line| line.starts_with(|first: char| first.is_ascii_uppercase()));
    names.map(|line| line.trim_end_matches(|end: char| !end.is_alphanumeric()).to_owned()).collect()
}

/// The text in backquotes in a line of the page.
fn code(line: &str) -> Vec<&str> {
    line.split('`').skip(1).step_by(2).collect()
}

/// The cells of each row of the tables of the page.
fn rows() -> impl Iterator<Item = Vec<&'static str>> {
    PAGE.lines().filter(|line| line.starts_with("| ")).map(|line| line.trim_matches('|').split(" | ").collect())
}

/// Whether a program of the page names a variant in a pattern.
fn is_provoked(pattern: &str) -> bool {
    PAGE.lines().any(|line| line.contains("matches!") && line.contains(pattern))
}

#[test]
fn every_variant_is_provoked_and_has_a_remedy() {
    let errors = variants(ERRORS, "pub enum Error {");
    assert!(errors.len() > 40 && errors.contains(&"Poisoned".to_owned()), "{errors:?}");
    for error in errors {
        let pattern = [format!("Error::{error} "), format!("Error::{error})")];
        assert!(pattern.iter().any(|pattern| is_provoked(pattern)), "nothing on the page provokes {error}");
        let remedy = rows().any(|cells| cells.len() == 2 && code(cells[0]).contains(&&error[..]));
        assert!(remedy || PAGE.contains(&format!("`{error}`: ")), "the page says nothing of what to do about {error}");
    }
    for failure in variants(FAILURES, "pub enum ContactFailure<T> {") {
        assert!(is_provoked(&format!("ContactFailure::{failure} ")), "nothing on the page provokes {failure}");
    }
}

/// The table for hosts names each variant once, and its first row has the recoverable ones.
#[test]
fn hosts_are_told_what_each_variant_means() {
    let hosts: Vec<_> = rows().filter(|cells| cells.len() == 3 && cells[1].contains('`')).collect();
    let mut told: Vec<_> = hosts.iter().flat_map(|cells| code(cells[1])).collect();
    told.sort_unstable();
    let mut errors = variants(ERRORS, "pub enum Error {");
    errors.sort_unstable();
    assert_eq!(told, errors);
    let says = ERRORS.split("pub fn is_recoverable").nth(1).unwrap();
    let recoverable = |error: &&str| says.contains(&format!("Self::{error} {{"));
    for (number, cells) in hosts.iter().enumerate() {
        assert!(code(cells[1]).iter().all(|error| recoverable(error) == (number == 0)), "{}", cells[0]);
    }
}
