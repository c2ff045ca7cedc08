//! Tables with named columns in CSV files; mistakes are named with file, line and column.

use crate::refusal::{Refusal, Result};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A table as read.
#[derive(Debug)]
pub(crate) struct Table {
    path: PathBuf,
    /// The names of the columns that are there, in the order of the file.
    columns: Vec<String>,
    rows: Vec<(u64, csv::StringRecord)>,
}

impl Table {
    /// Reads a file whose first line names its columns: all those required, any of those optional, in any order. Lines
    /// that begin with # are comments.
    pub(crate) fn read(path: &Path, required: &[&str], optional: &[&str]) -> Result<Self> {
        let text = std::fs::read_to_string(path);
        let text = text.map_err(|error| Refusal::of(path, format!("cannot be read: {error}")))?;
        let mut reader = csv::ReaderBuilder::new();
        let mut reader = reader.trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
        let broken = |error: csv::Error| {
            let line = error.position().map_or(1, |position| line(&text, position));
            match error.kind() {
                csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                    Refusal::at(path, line, format!("{len} cells, but the first line names {expected_len} columns"))
                }
                _ => Refusal::at(path, line, error),
            }
        };
        let header = reader.headers().map_err(broken)?;
        let columns: Vec<_> = header.iter().map(|name| name.trim_start_matches('\u{feff}').to_string()).collect();
        let known = || required.iter().chain(optional).copied().collect::<Vec<_>>().join(", ");
        let refused = |what: String| {
            let optional =
                if optional.is_empty() { String::new() } else { format!(" ({} optional)", optional.join(", ")) };
            Refusal::at(path, 1, format!("{what}; the columns are {}{optional}, separated by commas", known()))
        };
        if let Some(unknown) = columns.iter().find(|&name| !required.contains(&&**name) && !optional.contains(&&**name))
        {
            return Err(refused(format!("there is no column `{unknown}`")));
        }
        if let Some(missing) = required.iter().find(|&name| !columns.iter().any(|column| column == name)) {
            return Err(refused(format!("the column `{missing}` is missing")));
        }
        if let Some(twice) = (1..columns.len()).find(|&at| columns[..at].contains(&columns[at])) {
            return Err(refused(format!("the column `{}` is there twice", columns[twice])));
        }
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(broken)?;
            rows.push((record.position().map_or(0, |position| line(&text, position)), record));
        }
        Ok(Self { path: path.into(), columns, rows })
    }

    pub(crate) fn has(&self, column: &str) -> bool {
        self.columns.iter().any(|name| name == column)
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|(line, record)| Row { table: self, line: *line, record })
    }
}

/// The line of a record, whose position is before the empty lines and comments that precede it.
fn line(text: &str, position: &csv::Position) -> u64 {
    let start = usize::try_from(position.byte()).ok().and_then(|byte| text.get(byte..)).unwrap_or_default();
    let skipped = start.lines().take_while(|line| line.is_empty() || line.starts_with('#')).count();
    position.line() + skipped as u64
}

/// A line of a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<'a> {
    table: &'a Table,
    pub(crate) line: u64,
    record: &'a csv::StringRecord,
}

impl<'a> Row<'a> {
    /// A mistake in this line.
    pub(crate) fn refused(&self, what: impl std::fmt::Display) -> Refusal {
        Refusal::at(&self.table.path, self.line, what)
    }

    /// The text of a cell; none if it is empty, or without such a column.
    pub(crate) fn optional(&self, column: &str) -> Option<&'a str> {
        let at = self.table.columns.iter().position(|name| name == column)?;
        self.record.get(at).filter(|cell| !cell.is_empty())
    }

    pub(crate) fn text(&self, column: &str) -> Result<&'a str> {
        self.optional(column).ok_or_else(|| self.refused(format!("the cell of `{column}` is empty")))
    }

    /// A finite number.
    pub(crate) fn number(&self, column: &str) -> Result<f64> {
        self.parsed(column, self.text(column)?, "a finite number", |x: &f64| x.is_finite())
    }

    /// Finite numbers, separated by spaces or semicolons.
    pub(crate) fn numbers(&self, column: &str) -> Result<Vec<f64>> {
        self.words(column)?.map(|word| self.parsed(column, word, "a finite number", |x: &f64| x.is_finite())).collect()
    }

    /// The index, from 0, of a dof that the file counts from 1.
    pub(crate) fn dof(&self, column: &str, dofs: usize) -> Result<usize> {
        self.index(column, self.text(column)?, dofs)
    }

    /// The same of dofs separated by spaces or semicolons.
    pub(crate) fn dofs(&self, column: &str, dofs: usize) -> Result<Vec<usize>> {
        self.words(column)?.map(|word| self.index(column, word, dofs)).collect()
    }

    fn words(&self, column: &str) -> Result<impl Iterator<Item = &'a str>> {
        Ok(self.text(column)?.split([' ', ';', '\t']).filter(|word| !word.is_empty()))
    }

    fn index(&self, column: &str, word: &str, dofs: usize) -> Result<usize> {
        let expected = format!("a dof from 1 to {dofs}, the size of the matrices");
        self.parsed(column, word, &expected, |dof| (1..=dofs).contains(dof)).map(|dof: usize| dof - 1)
    }

    fn parsed<T: FromStr>(&self, column: &str, word: &str, expected: &str, admits: impl Fn(&T) -> bool) -> Result<T> {
        let value = word.parse().ok().filter(admits);
        value.ok_or_else(|| self.refused(format!("`{column}` is {word}, it must be {expected}")))
    }
}
