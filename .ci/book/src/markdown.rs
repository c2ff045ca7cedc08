//! What a page of Markdown has: headings, links and formulas.

use pulldown_cmark::{CodeBlockKind, Event, LinkType, Options, Parser, Tag, TagEnd};
use std::collections::BTreeSet;
use std::ops::Range;

#[derive(Default)]
pub struct Page {
    /// Fragments by which links find the headings.
    pub anchors: BTreeSet<String>,
    pub links: Vec<Link>,
    pub formulas: Vec<Formula>,
}

pub struct Link {
    pub line: usize,
    pub destination: String,
    /// Where the destination is written, if it is behind its text in parentheses or in HTML.
    pub written: Option<Range<usize>>,
    pub is_image: bool,
    /// What stands for it where it cannot be followed or shown.
    pub text: String,
}

pub struct Formula {
    pub line: usize,
    pub latex: String,
}

pub fn read(text: &str) -> Page {
    let mut page = Page::default();
    let line = |at: usize| text[..at].matches('\n').count() + 1;
    // Text of the heading, or formula, that the parser is in.
    let (mut heading, mut formula) = (None, None);
    for (event, range) in Parser::new_ext(text, Options::ENABLE_TABLES | Options::ENABLE_GFM).into_offset_iter() {
        match event {
            Event::Start(Tag::Link { link_type, dest_url, .. }) => {
                page.links.push(link(text, range, link_type, &dest_url, line, false));
            }
            Event::Start(Tag::Image { link_type, dest_url, .. }) => {
                page.links.push(link(text, range, link_type, &dest_url, line, true));
            }
            Event::Html(html) | Event::InlineHtml(html) => page.links.extend(of_html(&html, range.start, line)),
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::End(TagEnd::Heading(_)) => {
                let name = anchor(&heading.take().unwrap_or_default());
                let again = (1..).map(|k| format!("{name}-{k}"));
                let free = std::iter::once(name.clone()).chain(again).find(|name| !page.anchors.contains(name));
                page.anchors.extend(free);
            }
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(kind))) if &*kind == "math" => {
                formula = Some(Formula { line: line(range.start), latex: String::new() });
            }
            Event::End(TagEnd::CodeBlock) => page.formulas.extend(formula.take()),
            Event::Text(part) | Event::Code(part) => match (&mut heading, &mut formula) {
                (Some(heading), _) => heading.push_str(&part),
                (_, Some(formula)) => formula.latex.push_str(&part),
                _ => {}
            },
            _ => {}
        }
    }
    page
}

fn link(
    text: &str,
    range: Range<usize>,
    kind: LinkType,
    destination: &str,
    line: impl Fn(usize) -> usize,
    is_image: bool,
) -> Link {
    let found = (kind == LinkType::Inline).then(|| text[range.clone()].rfind(&format!("]({destination}"))).flatten();
    let written = found.map(|at| {
        let start = range.start + at + "](".len();
        start..start + destination.len()
    });
    let shown = text[range.clone()].trim_start_matches('!').trim_start_matches('[').split("](").next();
    let shown = shown.unwrap_or_default().to_string();
    Link { line: line(range.start), destination: destination.into(), written, is_image, text: shown }
}

/// Links and images in HTML that begins at a place of the page.
fn of_html(html: &str, begin: usize, line: impl Fn(usize) -> usize) -> Vec<Link> {
    let mut links = Vec::new();
    for (attribute, is_image) in [("href=\"", false), ("src=\"", true)] {
        for (at, _) in html.match_indices(attribute) {
            let value = &html[at + attribute.len()..];
            let Some(length) = value.find('"') else { continue };
            let start = begin + at + attribute.len();
            let destination = value[..length].to_string();
            let written = Some(start..start + length);
            let text = html.split_once("alt=\"").and_then(|(_, rest)| rest.split('"').next()).unwrap_or_default().into();
            links.push(Link { line: line(start), destination, written, is_image, text });
        }
    }
    links
}

/// The fragment of a heading, as hosts of repositories and mdBook make it.
fn anchor(heading: &str) -> String {
    let lower = heading.trim().to_lowercase();
    let kept = lower.chars().filter(|&c| c.is_alphanumeric() || c == '_' || c == '-' || c.is_whitespace());
    kept.map(|c| if c.is_whitespace() { '-' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::read;

    #[test]
    fn headings_links_and_formulas_are_found() {
        let text =
            "# A `b` – c!\n\n## A\n\n## A\n\n[x](y.md#z) <img src=\"q.svg\" alt=\"a b\"> ![c d](e.png)\n\n- l\n\n  ```math\n  E = 0\n  ```\n";
        let page = read(text);
        assert!(page.anchors.iter().eq(["a", "a-1", "a-b--c"]));
        let [link, image, shown] = &page.links[..] else { panic!("three links") };
        assert_eq!((link.destination.as_str(), link.line, link.is_image), ("y.md#z", 7, false));
        assert_eq!(&text[link.written.clone().unwrap()], "y.md#z");
        assert!(image.is_image && image.destination == "q.svg" && image.text == "a b");
        assert!(shown.is_image && shown.destination == "e.png" && shown.text == "c d");
        assert_eq!(page.formulas[0].latex, "E = 0\n");
        assert_eq!(page.formulas[0].line, 11);
    }
}
