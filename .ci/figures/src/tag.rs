//! Tags of tables: what prints a table, and what of it is compared.
//!
//! ```text
//! <!-- printed by: COMMAND -->
//! <!-- printed by: COMMAND (PART; PART) -->
//! <!-- not printed: REASON -->
//! ```
//!
//! A tag is one line, and belongs to the next table, or fenced block, below it. Parts:
//!
//! - `output/…`: a file that the command writes has the table, not the screen. `docs/measured/…`: a file of the
//!   repository has it, which `benches/measure` writes, so that nothing is run.
//! - `some rows`: the document leaves out rows of what is printed, or has them in another order.
//! - `times of DATE, COMMIT: COLUMNS`: these are not compared, with day and commit of the run, or the commit that
//!   brought its rows; without COLUMNS nothing is.
//! - `within N %, REASON: COLUMNS`: figures of these may differ by so much; `rows with "…"` instead of columns are
//!   those with a cell that begins so.
//! - `not compared: REASON`.
//!
//! Numbers below 1e-12 are rounding, and all alike.
//!
//! COLUMNS are heads in quotes, with commas between them; `"a" to "b"` are those from a to the next b. Of a fenced
//! block `times of DATE, COMMIT: lines with "…"` are those that begin so.

/// What stands between a tag's brackets.
#[derive(Clone, Debug, PartialEq)]
pub enum Tag {
    Printed(Printed),
    /// With the reason.
    NotPrinted(String),
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Printed {
    pub command: String,
    /// Where the table is, if not on the screen.
    pub file: Option<String>,
    pub some_rows: bool,
    /// What is not compared, and the run that it is from: day and commit.
    pub times: Option<At>,
    pub run: String,
    pub within: Option<Within>,
    /// Numbers below this size are alike.
    pub rounding: f64,
    /// Why nothing is compared.
    pub not_compared: Option<String>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Within {
    pub percent: f64,
    pub at: At,
}

#[derive(Clone, Debug, PartialEq)]
pub enum At {
    Columns(Columns),
    /// Rows with a cell that begins like that, or lines that do.
    Rows(String),
}

#[derive(Clone, Debug, PartialEq)]
pub enum Columns {
    All,
    /// First and last head of each range.
    Ranges(Vec<(String, String)>),
}

impl Columns {
    /// Which of the columns with these heads are meant; an error names the head that is not there.
    pub fn among(&self, heads: &[String]) -> Result<Vec<bool>, String> {
        let Self::Ranges(ranges) = self else { return Ok(vec![true; heads.len()]) };
        let mut chosen = vec![false; heads.len()];
        for (first, last) in ranges {
            let missing = |head: &str| format!("the tag names a column \"{head}\" that is not there");
            let from = heads.iter().position(|head| head == first).ok_or_else(|| missing(first))?;
            let to = heads[from..].iter().position(|head| head == last).ok_or_else(|| missing(last))?;
            chosen[from..=from + to].fill(true);
        }
        Ok(chosen)
    }
}

/// The tag that a line is, if it is one.
pub fn of_line(line: &str) -> Option<Result<Tag, String>> {
    let inside = line.trim().strip_prefix("<!--")?.strip_suffix("-->")?.trim();
    if let Some(reason) = inside.strip_prefix("not printed:") {
        return Some(Ok(Tag::NotPrinted(reason.trim().into())));
    }
    Some(printed(inside.strip_prefix("printed by:")?.trim()).map(Tag::Printed))
}

fn printed(text: &str) -> Result<Printed, String> {
    let (command, parts) = match text.strip_suffix(')').and_then(|text| text.split_once(" (")) {
        Some((command, parts)) => (command, parts),
        None => (text, ""),
    };
    let mut tag = Printed { command: command.into(), rounding: 1e-12, ..Printed::default() };
    for part in parts.split("; ").filter(|part| !part.is_empty()) {
        if part.starts_with("output/") || part.starts_with("docs/measured/") {
            tag.file = Some(part.into());
        } else if part == "some rows" {
            tag.some_rows = true;
        } else if let Some(rest) = part.strip_prefix("times of ") {
            let (run, what) = rest.split_once(": ").unwrap_or((rest, ""));
            let (date, commit) = run.split_once(", ").ok_or("times of which date and commit?")?;
            if date.len() != 10 || !date.starts_with("20") || !commit.chars().all(|c| c.is_ascii_hexdigit()) {
                return Err(format!("no date and commit: {run}"));
            }
            tag.run = run.into();
            tag.times = Some(if what.is_empty() { At::Columns(Columns::All) } else { at(what)? });
        } else if let Some(rest) = part.strip_prefix("within ") {
            let (percent, rest) = rest.split_once(" %, ").ok_or("within how much, and why?")?;
            let (_reason, what) = rest.split_once(": ").ok_or("within: which columns?")?;
            let percent = percent.parse().map_err(|_| format!("no number: {percent}"))?;
            tag.within = Some(Within { percent, at: at(what)? });
        } else if let Some(reason) = part.strip_prefix("not compared: ") {
            tag.not_compared = Some(reason.into());
        } else {
            return Err(format!("unknown part of a tag: {part}"));
        }
    }
    Ok(tag)
}

fn at(text: &str) -> Result<At, String> {
    match text.strip_prefix("rows with ").or_else(|| text.strip_prefix("lines with ")) {
        Some(begin) => quoted(begin).map(At::Rows),
        None => columns(text).map(At::Columns),
    }
}

fn columns(text: &str) -> Result<Columns, String> {
    let ranges = text.split("\", \"").map(|range| {
        let range = format!("\"{}\"", range.trim_matches('"'));
        match range.split_once("\" to \"") {
            Some((first, last)) => Ok((first.trim_matches('"').into(), last.trim_matches('"').into())),
            None => quoted(&range).map(|head| (head.clone(), head)),
        }
    });
    ranges.collect::<Result<_, String>>().map(Columns::Ranges)
}

fn quoted(text: &str) -> Result<String, String> {
    let inside = text.strip_prefix('"').and_then(|text| text.strip_suffix('"'));
    inside.map(String::from).ok_or_else(|| format!("not in quotes: {text}"))
}

#[cfg(test)]
mod tests {
    use super::{At, Columns, Printed, Tag, Within, of_line};

    fn heads(names: &[&str]) -> Vec<String> {
        names.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn tags_are_read() {
        let line = "<!-- printed by: run -- x (output/a.md; some rows; times of 2026-01-02, ab12: \"t\", \"a, b\" to \
                    \"c\"; within 5 %, chaotic: rows with \"raw\") -->";
        let times = Columns::Ranges(vec![("t".into(), "t".into()), ("a, b".into(), "c".into())]);
        let tag = Printed {
            command: "run -- x".into(),
            file: Some("output/a.md".into()),
            some_rows: true,
            times: Some(At::Columns(times.clone())),
            run: "2026-01-02, ab12".into(),
            within: Some(Within { percent: 5.0, at: At::Rows("raw".into()) }),
            rounding: 1e-12,
            not_compared: None,
        };
        assert_eq!(of_line(line), Some(Ok(Tag::Printed(tag))));
        let chosen = times.among(&heads(&["c", "a, b", "x", "c", "c", "t"])).unwrap();
        assert_eq!(chosen, [false, true, true, true, false, true]);
        assert!(times.among(&heads(&["c", "a, b", "t"])).is_err());
        assert_eq!(of_line("<!-- not printed: by hand -->"), Some(Ok(Tag::NotPrinted("by hand".into()))));
        for wrong in ["(first table)", "(times: all)", "(times of today, ab12)", "(within 5 %: \"a\")"] {
            assert!(of_line(&format!("<!-- printed by: run {wrong} -->")).unwrap().is_err(), "{wrong}");
        }
        assert_eq!(of_line("| a |"), None);
    }
}
