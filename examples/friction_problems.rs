//! Contact problems with friction from files, or piles of rigid boxes: what a solver makes of them, a line each.
//!
//! `cargo run --release --example friction_problems -- FILE...` prints a table and writes it; without files one of
//! piles in space and in the plane, with `--quick` of low ones. `--solver active-set` (the default) or
//! `gauss-seidel`.
//!
//! A file is text: `dimension contacts`; a line of friction coefficients, one a contact; a line of q; the number of
//! entries of W; a line `row column value` for each of these. Rows and columns count from 0, a contact has its normal
//! row first.

use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem, GaussSeidel};
use contact_dynamics::faer::MatRef;
use contact_dynamics::{ActiveSet, ContactSolver};
use contact_dynamics_scenes::boxes;
use contact_dynamics_scenes::random::Congruential;
use example_support::output::Output;
use std::error::Error;
use std::fmt::{Display, Write};
use std::path::Path;
use std::str::{FromStr, SplitWhitespace};
use std::time::Instant;

const USAGE: &str = "usage: friction_problems [--solver active-set|gauss-seidel] [--quick] [--output DIR] [FILE...]";

/// Singular values below this share of the largest count as zero, with rows and columns of W divided by √W_ii.
const RANK_TOLERANCE: f64 = 1e-10;

/// Rows a contact, coefficients of friction, q, W row by row.
struct Problem {
    name: String,
    dimension: usize,
    frictions: Vec<f64>,
    offset: Vec<f64>,
    delassus: Vec<f64>,
}

/// The solver of a name; a new one each time, which remembers nothing.
fn solver(name: &str) -> Option<Box<dyn ContactSolver<f64>>> {
    match name {
        "active-set" => Some(Box::new(ActiveSet::default())),
        "gauss-seidel" => Some(Box::new(GaussSeidel::default())),
        _ => None,
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut output = Output { quick: false, directory: ["output", "friction_problems"].iter().collect() };
    let (mut chosen, mut files) = ("active-set".to_string(), Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--quick" => output.quick = true,
            "--output" => output.directory = arguments.next().ok_or("--output needs a directory")?.into(),
            "--solver" => chosen = arguments.next().ok_or("--solver needs a name")?,
            option if option.starts_with("--") => return Err(format!("unknown option {option}; {USAGE}").into()),
            _ => files.push(argument),
        }
    }
    if solver(&chosen).is_none() {
        return Err(format!("unknown solver {chosen}; {USAGE}").into());
    }
    std::fs::create_dir_all(&output.directory)?;
    let problems = match files.is_empty() {
        true => piles(output.quick),
        false => files.iter().map(|file| read(Path::new(file))).collect::<Result<_, _>>()?,
    };
    let mut table = format!(
        "Rank: singular values above {RANK_TOLERANCE:.0e} of the largest, W scaled to a diagonal of ones. Residual: \
         over the largest |q|.\n\n\
         | problem | dimension | contacts | rows | rank of W | solver | iterations | residual | ms |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    );
    for problem in &problems {
        let Some(solver) = solver(&chosen) else { continue };
        writeln!(table, "{}", row(problem, &chosen, solver)?)?;
    }
    println!("{table}");
    output.write("friction_problems.md", &table)
}

/// The line of a problem.
fn row(problem: &Problem, name: &str, mut solver: Box<dyn ContactSolver<f64>>) -> Result<String, Box<dyn Error>> {
    let Problem { dimension, frictions, offset, delassus, .. } = problem;
    let cone = |&friction: &f64| match dimension {
        2 => AdmissibleSet::Cone2 { friction },
        _ => AdmissibleSet::Cone3 { friction },
    };
    let sets: Vec<_> = frictions.iter().map(cone).collect();
    let tolerance = vec![0.0; offset.len()];
    let posed = ContactProblem::new(delassus, offset, &sets, &tolerance)?;
    let mut multipliers = vec![0.0; offset.len()];
    let start = Instant::now();
    let solved = solver.solve(&posed, &mut multipliers);
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    let outcome = match solved {
        Ok(iterations) => {
            let largest = offset.iter().fold(0.0, |most: f64, q| most.max(q.abs()));
            let scale = if largest > 0.0 { largest } else { 1.0 };
            format!("{iterations} | {:.1e}", posed.residual(&multipliers).1 / scale)
        }
        Err(failure) => format!("{failure} | –"),
    };
    let (contacts, rows, rank) = (frictions.len(), offset.len(), rank(problem)?);
    Ok(format!(
        "| {} | {dimension} | {contacts} | {rows} | {rank} | {name} | {outcome} | {milliseconds:.2} |",
        problem.name
    ))
}

/// The numerical rank of W.
fn rank(problem: &Problem) -> Result<usize, Box<dyn Error>> {
    let size = problem.offset.len();
    let root = |i: usize| match problem.delassus[i * size + i].sqrt() {
        root if root > 0.0 => root,
        _ => 1.0,
    };
    let scaled: Vec<f64> =
        problem.delassus.iter().enumerate().map(|(at, w)| w / (root(at / size) * root(at % size))).collect();
    let values = MatRef::from_row_major_slice(&scaled, size, size)
        .singular_values()
        .map_err(|_| format!("{}: the singular values of W were not found", problem.name))?;
    let least = RANK_TOLERANCE * values.first().copied().unwrap_or(0.0);
    Ok(values.iter().filter(|&&value| value > least).count())
}

/// Piles of rigid boxes, which fall and slide.
fn piles(quick: bool) -> Vec<Problem> {
    let heights: &[usize] = if quick { &[2] } else { &[2, 5, 10] };
    let mut random = Congruential(13);
    let mut problems = Vec::new();
    for &height in heights {
        let shifts: Vec<[f64; 2]> = (0..height).map(|_| [0.1 * random.signed(), 0.1 * random.signed()]).collect();
        let free: Vec<f64> = (0..6 * height).map(|k| if k % 6 == 2 { -1.0 } else { 0.3 * random.signed() }).collect();
        let pile = boxes::pile(&shifts);
        for (dimension, rows) in [(2, boxes::in_plane(pile.clone())), (3, pile)] {
            let (delassus, offset) = boxes::problem(&rows, &free);
            let frictions = vec![0.4; offset.len() / dimension];
            problems.push(Problem { name: format!("pile of {height} boxes"), dimension, frictions, offset, delassus });
        }
    }
    problems
}

/// Reads a file; mistakes are named with their line.
fn read(path: &Path) -> Result<Problem, String> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let mut lines = Lines { path, count: 0, rest: text.lines() };

    let mut head = lines.next("the dimension and the number of contacts")?;
    let dimension = head.number("the dimension, 2 or 3", |d| (2..=3).contains(d))?;
    let contacts: usize = head.number("the number of contacts, up to 2000", |&n| n <= 2000)?;
    head.end()?;
    let size = dimension * contacts;
    let frictions =
        lines
            .next("the friction coefficients")?
            .numbers(contacts, "a coefficient, not negative", |&x| x >= 0.0 && f64::is_finite(x))?;
    let offset = lines.next("q")?.numbers(size, "an entry of q, finite", |x| f64::is_finite(*x))?;
    let mut count = lines.next("the number of entries of W")?;
    let entries: usize = count.number("the number of entries of W", |_| true)?;
    count.end()?;
    let mut delassus = vec![0.0; size * size];
    for _ in 0..entries {
        let mut entry = lines.next("an entry of W")?;
        let row: usize = entry.number("a row of W, from 0", |&row| row < size)?;
        let column: usize = entry.number("a column of W, from 0", |&column| column < size)?;
        delassus[row * size + column] = entry.number("an entry of W, finite", |w| f64::is_finite(*w))?;
        entry.end()?;
    }
    if let Some((line, _)) = lines.rest.by_ref().enumerate().find(|(_, line)| !line.trim().is_empty()) {
        return Err(lines.refused(line + 1, &format!("nothing more is expected after {entries} entries of W")));
    }
    Ok(Problem { name, dimension, frictions, offset, delassus })
}

/// The lines of a file, counted.
struct Lines<'a> {
    path: &'a Path,
    count: usize,
    rest: std::str::Lines<'a>,
}

impl<'a> Lines<'a> {
    fn next(&mut self, expected: &str) -> Result<Line<'a>, String> {
        let text = self.rest.next().ok_or_else(|| self.refused(1, &format!("the file ends before {expected}")))?;
        self.count += 1;
        Ok(Line { path: self.path, number: self.count, words: text.split_whitespace() })
    }

    /// A mistake so many lines after the last one that was read.
    fn refused(&self, after: usize, what: &str) -> String {
        format!("{}, line {}: {what}", self.path.display(), self.count + after)
    }
}

/// The words of a line that are still to be read.
struct Line<'a> {
    path: &'a Path,
    number: usize,
    words: SplitWhitespace<'a>,
}

impl Line<'_> {
    fn refused(&self, what: impl Display) -> String {
        format!("{}, line {}: {what}", self.path.display(), self.number)
    }

    fn number<N: FromStr>(&mut self, expected: &str, admits: impl Fn(&N) -> bool) -> Result<N, String> {
        let word = self.words.next().ok_or_else(|| self.refused(format!("the line ends before {expected}")))?;
        let number = word.parse().ok().filter(admits);
        number.ok_or_else(|| self.refused(format!("{word} is not {expected}")))
    }

    /// All words of the line.
    fn numbers<N: FromStr>(
        mut self,
        count: usize,
        expected: &str,
        admits: impl Fn(&N) -> bool,
    ) -> Result<Vec<N>, String> {
        let numbers = (0..count).map(|_| self.number(expected, &admits)).collect::<Result<_, _>>()?;
        self.end()?;
        Ok(numbers)
    }

    fn end(&mut self) -> Result<(), String> {
        self.words.next().map_or(Ok(()), |word| Err(self.refused(format!("{word} is one word too many"))))
    }
}
