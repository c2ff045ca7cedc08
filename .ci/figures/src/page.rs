//! Tables and fenced blocks of a page of Markdown, or of what a program prints.

use crate::tag::{self, Tag};

/// A table, or a fenced block, with the tag above it.
pub struct Figure {
    /// Of its first line; the first line of a page is 0.
    pub line: usize,
    pub content: Content,
    /// With its own line.
    pub tag: Option<(usize, Tag)>,
}

pub enum Content {
    Table(Table),
    /// Lines between the fences.
    Fence(Vec<String>),
}

pub struct Table {
    pub heads: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Whether it has a column of numbers.
    pub fn has_figures(&self) -> bool {
        let is_column = |k: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(k)).filter(|cell| !cell.is_empty() && *cell != "–");
            let (numbers, others): (Vec<_>, Vec<_>) = cells.partition(|cell| is_number(cell));
            !numbers.is_empty() && others.is_empty()
        };
        (0..self.heads.len()).any(is_column)
    }
}

/// Whether a cell begins as a number does.
pub fn is_number(cell: &str) -> bool {
    let unsigned = cell.trim_start_matches(['−', '-', '+', '<', '>', '*', ' ']);
    unsigned.starts_with(|c: char| c.is_ascii_digit())
        || unsigned.starts_with('.') && unsigned[1..].starts_with(|c: char| c.is_ascii_digit())
}

/// Tables and tagged fences of a page. An error has its line.
pub fn read(text: &str) -> Result<Vec<Figure>, (usize, String)> {
    let lines: Vec<&str> = text.lines().collect();
    let (mut figures, mut tag) = (Vec::new(), None);
    let mut at = 0;
    while at < lines.len() {
        let begin = at;
        if let Some(found) = tag::of_line(lines[at]) {
            let new = (at, found.map_err(|error| (at, error))?);
            if let Some((unused, _)) = tag.replace(new) {
                return Err((unused, "a tag without a table before the next tag".into()));
            }
            at += 1;
        } else if lines[at].trim_start().starts_with("```") {
            let end = lines[at + 1..].iter().position(|line| line.trim_start().starts_with("```"));
            let end = end.map_or(lines.len(), |end| at + 1 + end);
            // (Programs and formulas may stand between a tag and its table.)
            if tag.is_some() && lines[at].trim_start().starts_with("```text") {
                let inside = lines[at + 1..end].iter().map(|line| line.trim_end().to_string()).collect();
                figures.push(Figure { line: begin + 1, content: Content::Fence(inside), tag: tag.take() });
            }
            at = end + 1;
        } else if let Some(table) = table(&lines[at..]) {
            at += 2 + table.rows.len();
            figures.push(Figure { line: begin, content: Content::Table(table), tag: tag.take() });
        } else {
            at += 1;
        }
    }
    match tag {
        Some((unused, _)) => Err((unused, "a tag without a table".into())),
        None => Ok(figures),
    }
}

/// Tables of what a program prints, which has no tags that count, with their lines.
pub fn tables(printed: &str) -> Vec<(usize, Table)> {
    let lines: Vec<&str> = printed.lines().collect();
    (0..lines.len()).filter_map(|at| Some((at, table(&lines[at..])?))).collect()
}

/// The table that begins with the first of some lines.
fn table(lines: &[&str]) -> Option<Table> {
    let heads = cells(lines.first()?)?;
    let rule = cells(lines.get(1)?)?;
    if !rule.iter().all(|cell| !cell.is_empty() && cell.chars().all(|c| c == '-' || c == ':')) {
        return None;
    }
    let rows = lines[2..].iter().map_while(|line| cells(line)).collect();
    Some(Table { heads, rows })
}

/// What stands between the bars of a line, trimmed.
pub fn cells(line: &str) -> Option<Vec<String>> {
    let inside = line.trim_end().strip_prefix('|')?.strip_suffix('|')?;
    // A bar behind a backslash is part of a cell.
    let mut cells = vec![String::new()];
    let mut before = ' ';
    for c in inside.chars() {
        match (before, c) {
            (b, '|') if b != '\\' => cells.push(String::new()),
            _ => cells.last_mut()?.push(c),
        }
        before = c;
    }
    Some(cells.into_iter().map(|cell| cell.trim().to_string()).collect())
}

#[cfg(test)]
mod tests {
    use super::{Content, read};

    #[test]
    fn tables_and_fences_are_found() {
        let page = "<!-- printed by: a -->\nWords.\n\n| x \\| y | z |\n| --- | ---: |\n| −1 % | b |\n\n\
                    ```text\n| a |\n| - |\n```\n<!-- not printed: c -->\n```text\nd \n```\n| w |\n| - |\n| e |\n";
        let figures = read(page).ok().unwrap();
        let [first, fence, words] = &figures[..] else { panic!("three") };
        let Content::Table(table) = &first.content else { panic!("a table") };
        assert_eq!((first.line, &table.heads[..]), (3, &["x \\| y".to_string(), "z".into()][..]));
        assert!(table.has_figures() && first.tag.is_some() && words.tag.is_none());
        assert!(matches!(&words.content, Content::Table(table) if !table.has_figures()));
        assert!(matches!(&fence.content, Content::Fence(lines) if *lines == ["d"]));
        assert!(read("<!-- printed by: a -->\n").is_err());
    }
}
