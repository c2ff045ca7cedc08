//! A table, or fenced block, beside what is printed.

use crate::page::{self, Content, Figure, Table};
use crate::tag::{At, Printed};

/// What a comparison finds.
#[derive(Debug, Default, PartialEq)]
pub struct Found {
    /// One a difference, with its line in the document.
    pub differences: Vec<(usize, String)>,
    /// Lines that belong there instead of those from the line `at` on.
    pub right: Vec<String>,
    pub at: usize,
    pub length: usize,
}

/// Compares a figure of a document with the text in which it was printed, in which it is the one with this number among
/// those with its heads. An error says that there is nothing to compare it with.
pub fn compare(figure: &Figure, tag: &Printed, printed: &str, number: usize) -> Result<Found, String> {
    match &figure.content {
        Content::Fence(lines) => fence(figure.line, lines, tag, printed),
        Content::Table(table) => {
            let tables = page::tables(printed);
            let same = tables.iter().filter(|(_, found)| found.heads == table.heads).nth(number);
            let Some((line, found)) = same else {
                let heads: Vec<_> =
                    tables.iter().map(|(_, found)| format!("| {} |", found.heads.join(" | "))).collect();
                return Err(format!("no such table is printed, but:\n  {}", heads.join("\n  ")));
            };
            let raw: Vec<&str> = printed.lines().skip(line + 2).take(found.rows.len()).collect();
            rows(figure.line + 2, table, tag, found, &raw)
        }
    }
}

/// The lines as they follow one another in what is printed; times are lines that begin with some words.
fn fence(at: usize, lines: &[String], tag: &Printed, printed: &str) -> Result<Found, String> {
    let printed: Vec<&str> = printed.lines().map(str::trim_end).collect();
    let is_time = |line: &str| matches!(&tag.times, Some(At::Rows(begin)) if line.starts_with(begin));
    let same = |a: &str, b: &str| is_time(a) && is_time(b) || are_near(a, b, 0.0, tag.rounding);
    // Where most lines are the same, the earlier ones first.
    let is_same = |from: usize, k: usize| printed.get(from + k).is_some_and(|line| same(line, &lines[k]));
    let count = |from: usize| (0..lines.len()).filter(|&k| is_same(from, k)).count();
    let from = (0..printed.len()).rev().max_by_key(|&from| count(from)).ok_or("nothing is printed")?;
    let mut found = Found { at, length: lines.len(), ..Found::default() };
    for (k, documented) in lines.iter().enumerate() {
        let printed = printed.get(from + k).unwrap_or(&"");
        if same(printed, documented) {
            found.right.push(documented.clone());
        } else {
            found.right.push(printed.to_string());
            found.differences.push((at + k, format!("\n  printed    {printed}\n  documented {documented}")));
        }
    }
    Ok(found)
}

fn rows(at: usize, table: &Table, tag: &Printed, printed: &Table, raw: &[&str]) -> Result<Found, String> {
    let heads = &table.heads;
    let times = match &tag.times {
        Some(At::Columns(columns)) => columns.among(heads)?,
        Some(At::Rows(_)) => return Err("times of a table are columns".into()),
        None => vec![false; heads.len()],
    };
    // Where figures may differ by some percent.
    let loose = match tag.within.as_ref().map(|within| &within.at) {
        Some(At::Columns(columns)) => columns.among(heads)?,
        Some(At::Rows(_)) => vec![true; heads.len()],
        None => vec![false; heads.len()],
    };
    let is_loose_row = |row: &[String]| match tag.within.as_ref().map(|within| &within.at) {
        Some(At::Rows(begin)) => row.iter().any(|cell| cell.starts_with(begin.as_str())),
        _ => true,
    };
    let percent = |k: usize, row: &[String]| match &tag.within {
        Some(within) if loose[k] && is_loose_row(row) => within.percent,
        _ => 0.0,
    };
    let cell_equal = |k: usize, documented: &[String], printed: &[String]| {
        let (a, b) = (cell(documented, k), cell(printed, k));
        times[k] || a == b || are_near(a, b, percent(k, documented), tag.rounding)
    };
    let equal = |documented: &[String], printed: &[String]| {
        documented.len() == printed.len() && (0..heads.len()).all(|k| cell_equal(k, documented, printed))
    };
    // A printed row, with the times of the documented row of its names, which should be the one with this number.
    let right = |k: usize, j: usize| {
        let row = &printed.rows[j];
        let same = table.rows.iter().skip(k).take(1).chain(&table.rows).find(|other| names(other) == names(row));
        same.map_or(raw[j].to_string(), |documented| with_times(raw[j], row, documented, |k| times[k]))
    };
    let mut found = Found { at, length: table.rows.len(), ..Found::default() };
    let mut free: Vec<usize> = (0..printed.rows.len()).collect();
    for (k, documented) in table.rows.iter().enumerate() {
        let partner = match tag.some_rows {
            false => Some(k).filter(|&k| k < printed.rows.len()),
            true => partner(documented, &printed.rows, &free),
        };
        free.retain(|&j| Some(j) != partner);
        match partner {
            Some(j) if equal(documented, &printed.rows[j]) => {
                found.right.push(with_times(raw[j], &printed.rows[j], documented, |_| true));
            }
            Some(j) => {
                found.right.push(right(k, j));
                let columns = (0..heads.len()).filter(|&k| !cell_equal(k, documented, &printed.rows[j]));
                let columns: Vec<_> = columns.map(|k| heads[k].as_str()).collect();
                let message = format!(
                    " {}\n  printed    {}\n  documented | {} |",
                    columns.join(", "),
                    raw[j],
                    documented.join(" | ")
                );
                found.differences.push((at + k, message));
            }
            None => {
                let message = format!(" no such row is printed:\n  documented | {} |", documented.join(" | "));
                found.differences.push((at + k, message));
            }
        }
    }
    if !tag.some_rows {
        for (j, raw) in raw.iter().enumerate().skip(table.rows.len()) {
            found.right.push(right(j, j));
            found.differences.push((at + table.rows.len(), format!(" a row is missing:\n  printed    {raw}")));
        }
    }
    Ok(found)
}

fn cell(row: &[String], k: usize) -> &str {
    row.get(k).map_or("", |cell| cell)
}

/// The cells from the left that are no numbers: they name a row.
fn names(row: &[String]) -> &[String] {
    let count = row.iter().take_while(|cell| !page::is_number(cell)).count();
    &row[..count.max(1)]
}

/// Of the free printed rows the one that a documented row is of, by its names, and then by most cells.
fn partner(documented: &[String], printed: &[Vec<String>], free: &[usize]) -> Option<usize> {
    let alike = |row: &[String]| (0..documented.len()).filter(|&k| cell(row, k) == documented[k]).count();
    let candidates = free.iter().copied().filter(|&j| names(&printed[j]) == names(documented));
    candidates.rev().max_by_key(|&j| alike(&printed[j]))
}

/// A printed line with some cells of the documented row, in the printed width.
fn with_times(raw: &str, printed: &[String], documented: &[String], keep: impl Fn(usize) -> bool) -> String {
    if (0..printed.len()).all(|k| !keep(k) || printed[k] == cell(documented, k)) {
        return raw.to_string();
    }
    let padded: Vec<&str> = raw.trim_matches('|').split('|').collect();
    if padded.len() != printed.len() {
        // (A bar within a cell: the widths are not worth the trouble.)
        let cells = (0..printed.len()).map(|k| if keep(k) { cell(documented, k) } else { &printed[k] });
        return format!("| {} |", cells.collect::<Vec<_>>().join(" | "));
    }
    let cells = (0..printed.len()).map(|k| match keep(k) {
        true => format!(" {:>1$} ", cell(documented, k), padded[k].chars().count().saturating_sub(2)),
        false => padded[k].to_string(),
    });
    format!("|{}|", cells.collect::<Vec<_>>().join("|"))
}

/// Whether two cells have the same words, and numbers that differ by no more than some percent of the larger one, or
/// are both rounding.
fn are_near(a: &str, b: &str, percent: f64, rounding: f64) -> bool {
    let ((words_a, a), (words_b, b)) = (numbers(a), numbers(b));
    let near = |((text_a, a), (text_b, b)): (&(&str, f64), &(&str, f64))| {
        let larger = a.abs().max(b.abs());
        text_a == text_b || larger < rounding || percent > 0.0 && (a - b).abs() <= percent / 100.0 * larger
    };
    words_a == words_b && a.len() == b.len() && a.iter().zip(&b).all(near)
}

/// What is no number in a cell, and its numbers, as they are written too.
fn numbers(cell: &str) -> (String, Vec<(&str, f64)>) {
    let (mut words, mut numbers) = (String::new(), Vec::new());
    let mut rest = cell;
    while let Some(first) = rest.chars().next() {
        let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | 'e' | '+' | '-' | '−');
        let end = rest.find(|c: char| !is_part(c)).unwrap_or(rest.len());
        if let Ok(number) = rest[..end].replace('−', "-").parse() {
            numbers.push((&rest[..end], number));
            words.push('#');
            rest = &rest[end..];
        } else {
            words.push(first);
            rest = &rest[first.len_utf8()..];
        }
    }
    (words, numbers)
}

#[cfg(test)]
mod tests {
    use super::{are_near, compare};
    use crate::page;
    use crate::tag::Tag;

    const PRINTED: &str =
        "First\n\n| a | b | time |\n| - | -: | -: |\n| x | 1 |  3.0 |\n| y | 2 |  4.0 |\n| z | 3 | 5 |\n";

    /// Differences, their lines, and the rows as they should be.
    fn differences(tag: &str, rows: &str) -> (Vec<usize>, Vec<String>) {
        let page = format!("<!-- printed by: run {tag} -->\n| a | b | time |\n| - | - | - |\n{rows}");
        let figure = page::read(&page).ok().unwrap().remove(0);
        let Some((_, Tag::Printed(tag))) = &figure.tag else { panic!("a tag") };
        let found = compare(&figure, tag, PRINTED, 0).unwrap();
        (found.differences.iter().map(|&(line, _)| line).collect(), found.right)
    }

    #[test]
    fn rows_are_compared() {
        let times = "(times of 2026-01-01, ab: \"time\")";
        let (all, two) = ("| x | 1 | 7 |\n| y | 2 | 8 |\n| z | 3 | 9 |\n", "| y | 2 | 8 |\n| z | 4 | 9 |\n");
        assert_eq!(differences(times, all).0, []);
        assert_eq!(differences("", all).0, [3, 4, 5]);
        assert_eq!(differences(times, &all[..28]).0, [5]);
        assert_eq!(differences(times, &format!("{all}| w | 1 | 1 |\n")).0, [6]);
        let (lines, right) = differences("(some rows; times of 2026-01-01, ab: \"time\")", two);
        assert_eq!((lines, &right[1][..]), (vec![4], "| z | 3 | 9 |"));
        // A row that is new leaves the others their times.
        assert_eq!(
            differences(times, "| x | 1 | 7 |\n| z | 3 | 9 |\n").1,
            ["| x | 1 |    7 |", "| y | 2 |  4.0 |", "| z | 3 | 9 |"]
        );
        // Printed widths, documented times.
        assert_eq!(differences(times, "| x | 5 | 7 |\n| y | 2 | 8 |\n| z | 3 | 9 |\n").1[0], "| x | 1 |    7 |");
        let within = "(some rows; within 60 %, why: rows with \"z\"; times of 2026-01-01, ab: \"time\")";
        assert_eq!(differences(within, "| y | 3 | 8 |\n| z | 4 | 9 |\n").0, [3]);
        let within = "(some rows; within 30 %, why: \"b\"; times of 2026-01-01, ab: \"time\")";
        assert_eq!(differences(within, "| y | 3 | 8 |\n| z | 4 | 9 |\n").0, [3]);
    }

    #[test]
    fn fences_are_compared() {
        let found = |text: &str| {
            let page = format!("<!-- printed by: run -->\n```text\n{text}\n```\n");
            let figure = page::read(&page).ok().unwrap().remove(0);
            let Some((_, Tag::Printed(tag))) = &figure.tag else { panic!("a tag") };
            compare(&figure, tag, "0\na = 1 \nb = 2\nc\n", 0).unwrap()
        };
        assert!(found("a = 1\nb = 2").differences.is_empty());
        let wrong = found("a = 1\nb = 3");
        assert_eq!((wrong.differences[0].0, wrong.right), (3, vec!["a = 1".to_string(), "b = 2".into()]));
        assert_eq!(found("a = 2\nb = 2\nc").right, ["a = 1", "b = 2", "c"]);
    }

    #[test]
    fn near_cells_are_told_from_others() {
        let near = |a, b| are_near(a, b, 10.0, 1e-12);
        assert!(near("−0.10 (2e-3)", "−0.11 (2e-3)") && near("1, 3e-15", "1, 0e0"));
        assert!(!near("0.10", "−0.10") && !near("1 of 2", "1 in 2") && !near("–", "1") && !near("3e-12", "0e0"));
        assert!(are_near("+2e-13", "-1e-15", 0.0, 1e-12) && !are_near("0.10", "0.1", 0.0, 1e-12));
    }
}
