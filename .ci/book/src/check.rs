//! What is wrong with the documents: links to nothing or out of the package, formulas that KaTeX refuses, pages that
//! the book does not list.

use crate::markdown::{self, Link, Page};
use crate::{formulas, paths};
use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use walkdir::WalkDir;

const SUMMARY: &str = "docs/SUMMARY.md";

/// Words that stand in for an image: registries show images of a repository only if they know it.
const MIN_WORDS: usize = 3;

/// One a line, with the place. `package` has the files that are published.
pub fn complaints(package: &BTreeSet<String>) -> Result<Vec<String>> {
    let mut pages = BTreeMap::new();
    for file in package.iter().filter(|file| paths::extension(file) == Some("md") && !file.starts_with("src/")) {
        pages.insert(file.as_str(), markdown::read(&read(file)?));
    }
    let mut complaints = Vec::new();
    for (file, page) in &pages {
        for link in &page.links {
            let wrong = wrong_link(file, link, package, &pages);
            complaints.extend(wrong.map(|wrong| format!("{file}:{}: {}: {wrong}", link.line, link.destination)));
        }
        let refused = formulas::refused(&page.formulas).into_iter();
        complaints.extend(refused.map(|(line, error)| format!("{file}:{line}: formula: {error}")));
    }
    for entry in WalkDir::new("src") {
        let file = entry?.into_path().to_string_lossy().into_owned();
        let found = match paths::extension(&file) {
            Some("rs") => formulas::of_source(&read(&file)?),
            Some("md") => markdown::read(&read(&file)?).formulas,
            _ => continue,
        };
        let refused = formulas::refused(&found).into_iter();
        complaints.extend(refused.map(|(line, error)| format!("{file}:{line}: formula: {error}")));
    }
    complaints.extend(unlisted(&pages));
    Ok(complaints)
}

fn read(file: &str) -> Result<String> {
    fs::read_to_string(file).with_context(|| format!("cannot read {file}"))
}

fn wrong_link(file: &str, link: &Link, package: &BTreeSet<String>, pages: &BTreeMap<&str, Page>) -> Option<String> {
    let (path, fragment) = paths::local(&link.destination)?;
    if link.is_image && link.text.split_whitespace().count() < MIN_WORDS {
        return Some("an image whose text says too little to whoever cannot see it".into());
    }
    let target = if path.is_empty() { Some(file.to_string()) } else { paths::target(file, path) };
    let Some(target) = target.filter(|target| package.contains(target)) else {
        return Some("no file of the package (`include` in Cargo.toml)".into());
    };
    let fragment = fragment?;
    let known = pages.get(target.as_str()).is_some_and(|page| page.anchors.contains(fragment));
    (!known).then(|| format!("{target} has no heading with that fragment"))
}

/// Pages of docs/ that the table of contents does not have.
fn unlisted(pages: &BTreeMap<&str, Page>) -> Vec<String> {
    let links = pages.get(SUMMARY).map(|summary| &summary.links[..]).unwrap_or_default();
    let listed: BTreeSet<String> = links.iter().filter_map(|link| paths::target(SUMMARY, &link.destination)).collect();
    let of_book = pages.keys().filter(|page| page.starts_with("docs/") && **page != SUMMARY);
    of_book.filter(|page| !listed.contains(**page)).map(|page| format!("{page} is not in {SUMMARY}")).collect()
}
