//! Makes a book of pages that link to the whole repository: links that leave the book's folder lead to chapters.
//!
//! A chapter that does nothing but include a page from elsewhere, the README for instance, is that page, and links
//! between the two places are made to fit. Sources that pages link to become chapters at the end.

use crate::{markdown, paths};
use anyhow::{Context, Result, bail, ensure};
use mdbook_preprocessor::book::{Book, BookItem, Chapter};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Chapters of the pages in the repository, by their paths there.
type Homes = BTreeMap<String, String>;

/// `folder` is that of the book in the repository.
pub fn of_repository(mut book: Book, folder: &Path) -> Result<Book> {
    let folder = folder.to_str().context("the name of the book's folder is no text")?;
    let mut homes = Homes::new();
    for chapter in book.chapters() {
        homes.insert(page(chapter, folder)?, path(chapter)?);
    }

    let (mut result, mut sources) = (Ok(()), BTreeSet::new());
    book.for_each_chapter_mut(|chapter| {
        if result.is_ok() {
            result = put_home(chapter, folder, &homes, &mut sources);
        }
    });
    result?;

    if !sources.is_empty() {
        book.push_item(BookItem::PartTitle("Sources".into()));
    }
    for file in sources {
        let text = fs::read_to_string(&file).with_context(|| format!("cannot read {file}"))?;
        let language = if paths::extension(&file) == Some("rs") { "rust,noplayground" } else { "text" };
        let content = format!("# {file}\n\n``````{language}\n{text}\n``````\n");
        book.push_item(Chapter::new(&file, content, chapter_of_source(&file), Vec::new()));
    }
    Ok(book)
}

/// The place of a chapter in the book.
fn path(chapter: &Chapter) -> Result<String> {
    text(chapter.path.as_deref())
}

fn text(path: Option<&Path>) -> Result<String> {
    let path = path.context("a chapter without a page")?;
    Ok(path.to_str().with_context(|| format!("{} is no text", path.display()))?.replace('\\', "/"))
}

/// The page of the repository that a chapter shows.
fn page(chapter: &Chapter, folder: &str) -> Result<String> {
    let own = format!("{folder}/{}", text(chapter.source_path.as_deref())?);
    let content = chapter.content.trim();
    let included = content.strip_prefix("{{#include ").and_then(|rest| rest.strip_suffix("}}"));
    let Some(included) = included.filter(|file| paths::extension(file) == Some("md") && !file.contains('\n')) else {
        return Ok(own);
    };
    paths::target(&own, included).with_context(|| format!("{own} includes {included}, beyond the repository"))
}

/// Gives a chapter the text of its page, with links that fit.
fn put_home(chapter: &mut Chapter, folder: &str, homes: &Homes, sources: &mut BTreeSet<String>) -> Result<()> {
    let (page, path) = (page(chapter, folder)?, path(chapter)?);
    let mut text = fs::read_to_string(&page).with_context(|| format!("cannot read {page}"))?;
    let mut links = markdown::read(&text).links;
    // From behind, so that places stay where they are.
    links.sort_by_key(|link| std::cmp::Reverse(link.written.as_ref().map(|written| written.start)));
    for link in links {
        let Some((file, _)) = paths::local(&link.destination).filter(|(file, _)| !file.is_empty()) else { continue };
        let place = || format!("{page}:{}: {}", link.line, link.destination);
        let target = paths::target(&page, file).with_context(|| format!("{}: beyond the repository", place()))?;
        ensure!(Path::new(&target).is_file(), "{}: no file of the repository", place());
        let home = match (homes.get(&target), target.strip_prefix(&format!("{folder}/"))) {
            (Some(chapter), _) => chapter.clone(),
            (None, Some(_)) if paths::extension(&target) == Some("md") => bail!("{}: no chapter of the book", place()),
            // mdBook copies what is no page.
            (None, Some(file)) => file.to_string(),
            (None, None) => {
                sources.insert(target.clone());
                chapter_of_source(&target)
            }
        };
        let fitting = paths::link(&path, &home);
        if fitting != file {
            let written = link.written.clone();
            let written =
                written.with_context(|| format!("{}: no [text](destination), which can be made fit", place()))?;
            text.replace_range(written.start..written.start + file.len(), &fitting);
        }
    }
    chapter.content = text;
    Ok(())
}

fn chapter_of_source(file: &str) -> String {
    format!("sources/{file}.md")
}
