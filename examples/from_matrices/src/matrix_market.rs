//! Matrix Market files (Boisvert, Pozo, Remington: The Matrix Market exchange formats, NISTIR 5935, 1996): reading real
//! matrices and diagonals, and writing those of the demonstrations.

use crate::refusal::{Refusal, Result};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use std::fmt::Write;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// How the values of a file are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    /// Row, column and value of each entry.
    Coordinate,
    /// All values, column by column.
    Array,
}

/// What a file says of the two triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Triangles {
    General,
    /// The lower one is given, the upper one is the same.
    Symmetric,
    /// The lower one without the diagonal is given, the upper one is its negative.
    Skew,
}

/// A matrix as read; both triangles, indices from 0.
#[derive(Clone, Debug)]
pub(crate) struct MatrixFile {
    path: PathBuf,
    rows: usize,
    columns: usize,
    layout: Layout,
    entries: Vec<Triplet<usize, usize, f64>>,
}

impl MatrixFile {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|error| Refusal::of(path, format!("cannot be opened: {error}")))?;
        let mut lines = Lines { path, number: 0, rest: BufReader::new(file).lines() };
        let (layout, triangles) = header(&mut lines)?;
        let sizes = lines.numbers("the line of sizes")?;
        let (rows, columns, stored) = match (layout, &sizes[..]) {
            (Layout::Coordinate, &[rows, columns, entries]) => (rows, columns, entries),
            (Layout::Array, &[rows, columns]) => {
                let stored = match triangles {
                    Triangles::General => rows.saturating_mul(columns),
                    Triangles::Symmetric => rows.saturating_mul(rows.saturating_add(1)) / 2,
                    Triangles::Skew => rows.saturating_mul(rows.saturating_sub(1)) / 2,
                };
                (rows, columns, stored)
            }
            (Layout::Coordinate, _) => return Err(lines.refused("expected `rows columns entries`, three integers")),
            (Layout::Array, _) => return Err(lines.refused("expected `rows columns`, two integers")),
        };
        if triangles != Triangles::General && rows != columns {
            let what = format!("a symmetric matrix is square, this one has {rows} rows and {columns} columns");
            return Err(lines.refused(what));
        }
        let mut matrix = Self { path: path.into(), rows, columns, layout, entries: Vec::new() };
        let first = usize::from(triangles == Triangles::Skew);
        let mut place = (if triangles == Triangles::General { 0 } else { first }, 0);
        for read in 0..stored {
            let Some(text) = lines.next()? else {
                let what = format!("the file ends after {read} of {stored} entries; was it cut off?");
                return Err(lines.refused(what));
            };
            let entry = match layout {
                Layout::Coordinate => coordinate(&lines, &text, (rows, columns), triangles)?,
                Layout::Array => {
                    let entry = (place.0, place.1, value(&lines, text.trim())?);
                    place.0 += 1;
                    if place.0 == rows {
                        place.1 += 1;
                        place.0 = if triangles == Triangles::General { 0 } else { place.1 + first };
                    }
                    entry
                }
            };
            matrix.push(entry, triangles);
        }
        match lines.next()? {
            Some(_) => Err(lines.refused(format!("the line of sizes promises {stored} entries, here is one more"))),
            None => Ok(matrix),
        }
    }

    fn push(&mut self, (row, column, value): (usize, usize, f64), triangles: Triangles) {
        self.entries.push(Triplet::new(row, column, value));
        match triangles {
            Triangles::Symmetric if row != column => self.entries.push(Triplet::new(column, row, value)),
            Triangles::Skew => self.entries.push(Triplet::new(column, row, -value)),
            _ => {}
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The values of an array of one column or one row: a diagonal.
    pub(crate) fn diagonal(&self) -> Option<Vec<f64>> {
        let is_vector = self.layout == Layout::Array && (self.rows == 1 || self.columns == 1);
        is_vector.then(|| self.entries.iter().map(|entry| entry.val).collect())
    }

    /// The matrix; entries that are listed more than once are added.
    pub(crate) fn matrix(&self) -> Result<SparseColMat<usize, f64>> {
        let Self { path, rows, columns, entries, .. } = self;
        if rows != columns {
            return Err(Refusal::of(path, format!("expected a square matrix, this one is {rows} × {columns}")));
        }
        SparseColMat::try_new_from_triplets(*rows, *columns, entries)
            .map_err(|error| Refusal::of(path, format!("the matrix cannot be put together: {error:?}")))
    }

    /// The entry that differs most from the one across the diagonal, if one does by more than rounding, as a sentence.
    pub(crate) fn asymmetry(&self, matrix: &SparseColMat<usize, f64>) -> Option<String> {
        let entry = |row, column| matrix.as_ref().get(row, column).copied().unwrap_or(0.0);
        let mirrored = self.entries.iter().map(|e| (e.row, e.col, entry(e.row, e.col), entry(e.col, e.row)));
        let largest = matrix.as_ref().val().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let difference = |e: &(usize, usize, f64, f64)| (e.2 - e.3).abs();
        let worst = mirrored.max_by(|a, b| difference(a).total_cmp(&difference(b)))?;
        let (row, column, value, other) = worst;
        // (The crate's own tolerance: what assembly in another order may leave.)
        (difference(&worst) > 256.0 * f64::EPSILON * largest).then(|| {
            let (row, column) = (row + 1, column + 1);
            format!("entry ({row}, {column}) is {value:?}, entry ({column}, {row}) is {other:?}")
        })
    }
}

/// The first line.
fn header(lines: &mut Lines<'_>) -> Result<(Layout, Triangles)> {
    let text = lines.raw()?.unwrap_or_default().to_ascii_lowercase();
    let words: Vec<_> = text.split_whitespace().collect();
    let &["%%matrixmarket", "matrix", layout, field, symmetry] = &words[..] else {
        return Err(lines.refused(
            "a Matrix Market file begins with a line such as `%%MatrixMarket matrix coordinate real symmetric`",
        ));
    };
    let layout = match layout {
        "coordinate" => Layout::Coordinate,
        "array" => Layout::Array,
        other => return Err(lines.refused(format!("the format is `{other}`, it must be coordinate or array"))),
    };
    match field {
        "real" | "double" | "integer" => {}
        "pattern" => {
            return Err(lines.refused("the file has a pattern without values; write the matrix as `real`"));
        }
        other => return Err(lines.refused(format!("values are `{other}`, they must be real or integer"))),
    }
    let triangles = match symmetry {
        "general" => Triangles::General,
        "symmetric" => Triangles::Symmetric,
        "skew-symmetric" => Triangles::Skew,
        other => {
            let what = format!("the symmetry is `{other}`, it must be general, symmetric or skew-symmetric");
            return Err(lines.refused(what));
        }
    };
    Ok((layout, triangles))
}

/// Row, column (from 0) and value of a line.
fn coordinate(
    lines: &Lines<'_>,
    text: &str,
    (rows, columns): (usize, usize),
    triangles: Triangles,
) -> Result<(usize, usize, f64)> {
    let words: Vec<_> = text.split_whitespace().collect();
    let &[row, column, number] = &words[..] else {
        return Err(lines.refused(format!("expected `row column value`, found `{text}`")));
    };
    let index = |word: &str, what: &str, size: usize| {
        word.parse::<usize>()
            .ok()
            .filter(|index| (1..=size).contains(index))
            .ok_or_else(|| lines.refused(format!("the {what} is {word}, it must be an integer from 1 to {size}")))
    };
    let (row, column) = (index(row, "row", rows)?, index(column, "column", columns)?);
    match triangles {
        Triangles::Symmetric if row < column => Err(lines.refused(format!(
            "entry ({row}, {column}) is above the diagonal; a symmetric file holds the lower triangle alone: exchange \
             rows and columns, or write both triangles as `general`"
        ))),
        Triangles::Skew if row <= column => Err(lines.refused(format!(
            "entry ({row}, {column}) is not below the diagonal, as all entries of a skew-symmetric file are"
        ))),
        _ => Ok((row - 1, column - 1, value(lines, number)?)),
    }
}

/// A finite number; exponents may be written in the way of Fortran, 1.0D+03.
fn value(lines: &Lines<'_>, word: &str) -> Result<f64> {
    let number = word.parse().or_else(|_| word.replace(['d', 'D'], "e").parse::<f64>()).ok();
    match number {
        Some(number) if number.is_finite() => Ok(number),
        Some(_) => Err(lines.refused(format!("the value is {word}; a matrix has finite numbers alone"))),
        None => Err(lines.refused(format!("`{word}` is not a number"))),
    }
}

/// The lines of a file, counted from 1.
struct Lines<'a> {
    path: &'a Path,
    number: u64,
    rest: std::io::Lines<BufReader<File>>,
}

impl Lines<'_> {
    /// The next line as it is; none at the end.
    fn raw(&mut self) -> Result<Option<String>> {
        self.number += 1;
        let line = self.rest.next().transpose();
        line.map_err(|error| self.refused(format!("cannot be read as text: {error}")))
    }

    /// The next line that is neither empty nor a comment.
    fn next(&mut self) -> Result<Option<String>> {
        loop {
            match self.raw()? {
                Some(line) if line.trim().is_empty() || line.starts_with('%') => {}
                other => return Ok(other),
            }
        }
    }

    /// The integers of the next line.
    fn numbers(&mut self, what: &str) -> Result<Vec<usize>> {
        let line = self.next()?.ok_or_else(|| self.refused(format!("the file ends before {what}")))?;
        let numbers = line.split_whitespace().map(str::parse).collect::<std::result::Result<_, _>>();
        numbers.map_err(|_| self.refused(format!("{what} has integers, found `{line}`")))
    }

    fn refused(&self, what: impl std::fmt::Display) -> Refusal {
        Refusal::at(self.path, self.number, what)
    }
}

/// A symmetric matrix of size n as text: its entries on and below the diagonal, indices from 0.
pub(crate) fn symmetric(n: usize, entries: &[(usize, usize, f64)]) -> String {
    let mut text = format!("%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n", entries.len());
    for &(row, column, value) in entries {
        let _ = writeln!(text, "{} {} {value:?}", row + 1, column + 1);
    }
    text
}

/// A diagonal as text: an array of one column.
pub(crate) fn diagonal(values: &[f64]) -> String {
    let mut text = format!("%%MatrixMarket matrix array real general\n{} 1\n", values.len());
    for value in values {
        let _ = writeln!(text, "{value:?}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<MatrixFile> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.mtx");
        std::fs::write(&path, text).unwrap();
        MatrixFile::read(&path)
    }

    /// The matrix of a text, dense, row by row.
    fn dense(text: &str) -> Vec<Vec<f64>> {
        let matrix = read(text).unwrap().matrix().unwrap();
        let entry = |row, column| matrix.as_ref().get(row, column).copied().unwrap_or(0.0);
        (0..matrix.nrows()).map(|row| (0..matrix.ncols()).map(|column| entry(row, column)).collect()).collect()
    }

    /// The sentence about a text, without the path.
    fn refused(text: &str) -> String {
        let sentence = read(text).unwrap_err().to_string();
        sentence.split_once("a.mtx").unwrap().1.trim_start_matches(", ").to_string()
    }

    #[test]
    fn all_formats_of_one_matrix_are_the_same() {
        let matrix = [[2.0, -1.0], [-1.0, 3.5]];
        for text in [
            "%%MatrixMarket matrix coordinate real symmetric\n% K\n2 2 3\n1 1 2\n2 1 -1\n2 2 3.5\n",
            "%%MatrixMarket matrix coordinate real general\n\n2 2 4\n2 2 3.5\n1 1 2.0\n2 1 -1e0\n1 2 -1.0D+00\n",
            "%%MatrixMarket matrix array real symmetric\n2 2\n2\n-1\n3.5\n",
            "%%matrixmarket MATRIX array real general\n2 2\n2\n-1\n-1\n3.5\n",
            // Added, as by assembly.
            "%%MatrixMarket matrix coordinate real symmetric\n2 2 4\n1 1 2\n2 1 -1\n2 2 3\n2 2 0.5\n",
        ] {
            assert_eq!(dense(text), matrix, "{text}");
        }
        let skew = "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n2 1 4\n";
        assert_eq!(dense(skew), [[0.0, -4.0], [4.0, 0.0]]);
        assert_eq!(dense("%%MatrixMarket matrix array real skew-symmetric\n2 2\n4\n"), [[0.0, -4.0], [4.0, 0.0]]);
        let general = "%%MatrixMarket matrix array integer general\n2 2\n1\n2\n3\n4\n";
        assert_eq!(dense(general), [[1.0, 3.0], [2.0, 4.0]]);
    }

    #[test]
    fn diagonals_are_arrays_of_one_column_or_row() {
        for size in ["3 1", "1 3"] {
            let file = read(&format!("%%MatrixMarket matrix array real general\n{size}\n1\n2\n3\n")).unwrap();
            assert_eq!(file.diagonal(), Some(vec![1.0, 2.0, 3.0]));
        }
        let square = read("%%MatrixMarket matrix array real symmetric\n2 2\n1\n2\n3\n").unwrap();
        assert_eq!(square.diagonal(), None);
    }

    #[test]
    fn what_is_written_is_read_bit_for_bit() {
        let values = [0.1 + 0.2, 1.0 / 3.0, 5e-324, 1e300];
        let text = diagonal(&values);
        assert_eq!(read(&text).unwrap().diagonal().unwrap(), values);
        let text = symmetric(2, &[(0, 0, values[0]), (1, 0, values[1]), (1, 1, values[3])]);
        assert_eq!(dense(&text), [[values[0], values[1]], [values[1], values[3]]]);
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        let head = "%%MatrixMarket matrix coordinate real symmetric\n";
        for (text, sentence) in [
            (String::new(), "line 1: a Matrix Market file begins with"),
            ("1 1 2.0\n".into(), "line 1: a Matrix Market file begins with"),
            (head.replace("real", "complex"), "line 1: values are `complex`"),
            (head.replace("real", "pattern"), "line 1: the file has a pattern without values"),
            (head.replace("symmetric", "hermitian"), "line 1: the symmetry is `hermitian`"),
            (format!("{head}2 2\n"), "line 2: expected `rows columns entries`"),
            (format!("{head}2 3 1\n1 1 1\n"), "line 2: a symmetric matrix is square, this one has 2 rows and 3 col"),
            (format!("{head}2 2 1\n0 1 1\n"), "line 3: the row is 0, it must be an integer from 1 to 2"),
            (format!("{head}2 2 1\n2 3 1\n"), "line 3: the column is 3, it must be an integer from 1 to 2"),
            (format!("{head}2 2 1\n1 2 1\n"), "line 3: entry (1, 2) is above the diagonal"),
            (format!("{head}2 2 1\n1 1 NaN\n"), "line 3: the value is NaN"),
            (format!("{head}2 2 1\n1 1 x\n"), "line 3: `x` is not a number"),
            (format!("{head}2 2 1\n1 1\n"), "line 3: expected `row column value`"),
            (format!("{head}2 2 2\n1 1 1\n"), "line 4: the file ends after 1 of 2 entries"),
            (format!("{head}2 2 1\n1 1 1\n\n2 2 1\n"), "line 5: the line of sizes promises 1 entries"),
        ] {
            let found = refused(&text);
            assert!(found.starts_with(sentence), "{text}{found}");
        }
    }
}
