//! Compares the tables of the documents with what their commands print, in the root of the repository:
//!
//! ```text
//! figures [--write] [--times] [--exact] [--kept] [--profile PROFILE] [--only COMMAND]… [NAME]…
//! ```
//!
//! Commands are run that have a NAME in them, or are one of those behind `--only`; without either all. `--kept`
//! compares with what the last run has printed, and runs nothing; `--profile` builds by another profile than
//! `--release`. `--exact` allows no figure to differ, whatever its tag says. `--write` puts printed rows into the
//! documents; columns of times stay, but with `--times` as well, which renews day and commit in their tags. Tags are in
//! `tag.rs`. Ends with a failure if a figure differs, or a table of figures has no tag.

mod compare;
mod page;
mod tag;

use compare::Found;
use page::{Content, Figure};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;
use tag::{At, Columns, Printed, Tag};

const FOLDER: &str = "target/figures";

const FLAGS: [&str; 4] = ["--write", "--times", "--exact", "--kept"];

#[derive(Default)]
struct Options {
    /// Those of `FLAGS` that are given.
    flags: Vec<String>,
    profile: Option<String>,
    only: Vec<String>,
    names: Vec<String>,
}

impl Options {
    fn read() -> Result<Self, String> {
        let (mut options, mut arguments) = (Self::default(), std::env::args().skip(1));
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                flag if FLAGS.contains(&flag) => options.flags.push(argument),
                "--profile" => options.profile = Some(arguments.next().ok_or("--profile needs a name")?),
                "--only" => options.only.push(arguments.next().ok_or("--only needs a command")?),
                unknown if unknown.starts_with('-') => return Err(format!("unknown option {unknown}")),
                _ => options.names.push(argument),
            }
        }
        Ok(options)
    }

    fn has(&self, flag: &str) -> bool {
        self.flags.iter().any(|given| given == flag)
    }

    fn select(&self, command: &str) -> bool {
        let all = self.only.is_empty() && self.names.is_empty();
        all || self.only.iter().any(|only| only == command)
            || self.names.iter().any(|name| command.contains(name.as_str()))
    }
}

/// A figure with a command, and where it is.
struct Job<'a> {
    document: &'a str,
    figure: &'a Figure,
    tag: &'a Printed,
    /// Among the tables of its document with the same heads, from the same command.
    number: usize,
}

#[derive(Default)]
struct Tally {
    equal: usize,
    different: usize,
    not_compared: usize,
    words: usize,
    of_others: usize,
}

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("figures: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether all is as it should be.
fn run() -> Result<bool, String> {
    let options = Options::read()?;
    let mut pages = Vec::new();
    for document in documents()? {
        let text = read(Path::new(&document))?;
        let figures = page::read(&text).map_err(|(line, error)| format!("{document}:{}: {error}", line + 1))?;
        pages.push((document, figures));
    }
    let (mut tally, mut good) = (Tally::default(), true);
    let mut jobs: Vec<(&str, Vec<Job>)> = Vec::new();
    for (document, figures) in &pages {
        for (k, figure) in figures.iter().enumerate() {
            let place = format!("{document}:{}", figure.line + 1);
            match &figure.tag {
                Some((_, Tag::Printed(tag))) => {
                    let job = Job { document, figure, tag, number: number(&figures[..k], figure, tag) };
                    match jobs.iter_mut().find(|(command, _)| *command == tag.command) {
                        Some((_, of_command)) => of_command.push(job),
                        None => jobs.push((&tag.command, vec![job])),
                    }
                }
                Some((_, Tag::NotPrinted(reason))) => {
                    println!("{place}: not printed: {reason}");
                    tally.not_compared += 1;
                }
                None => match &figure.content {
                    Content::Table(table) if table.has_figures() => {
                        eprintln!("{place}: a table of figures without a tag");
                        good = false;
                    }
                    _ => tally.words += 1,
                },
            }
        }
    }
    let known = |test: &dyn Fn(&str) -> bool| jobs.iter().any(|(command, _)| test(command));
    if let Some(unknown) = options.names.iter().find(|name| !known(&|command| command.contains(name.as_str()))) {
        return Err(format!("no command of a tag has {unknown} in it"));
    }
    if let Some(unknown) = options.only.iter().find(|only| !known(&|command| command == *only)) {
        return Err(format!("no tag has the command {unknown}"));
    }
    let mut right = BTreeMap::<&str, Vec<Found>>::new();
    for (command, jobs) in &jobs {
        if !options.select(command) {
            tally.of_others += jobs.len();
            continue;
        }
        for (document, found) in compare_all(command, jobs, &options, &mut tally) {
            right.entry(document).or_default().push(found);
        }
    }
    if options.has("--write") {
        for (document, found) in right {
            write(document, found)?;
        }
    }
    println!(
        "figures: {} equal, {} different, {} not compared (above), {} of other commands; {} tables of words",
        tally.equal, tally.different, tally.not_compared, tally.of_others, tally.words
    );
    Ok(good && tally.different == 0)
}

/// Compares all figures of a command, which is run if that is needed, and gives what is different.
fn compare_all<'a>(command: &str, jobs: &[Job<'a>], options: &Options, tally: &mut Tally) -> Vec<(&'a str, Found)> {
    let mut printed = None;
    let mut different = Vec::new();
    for job in jobs {
        let place = format!("{}:{}", job.document, job.figure.line + 1);
        let reason = match (&job.tag.not_compared, &job.tag.times) {
            (Some(reason), _) => Some(reason.as_str()),
            (None, Some(At::Columns(Columns::All))) if !options.has("--times") => Some("times"),
            _ => None,
        };
        if let Some(reason) = reason {
            println!("{place}: not compared: {reason} ({command})");
            tally.not_compared += 1;
            continue;
        }
        let text = match &job.tag.file {
            Some(file) if !file.starts_with("output/") => read(Path::new(file)),
            file => {
                let printed = printed.get_or_insert_with(|| output(command, options)).clone();
                match file {
                    // (Without `output` and the name of the example.)
                    Some(file) => printed
                        .and_then(|_| read(&folder(command).join(Path::new(file).iter().skip(2).collect::<PathBuf>()))),
                    None => printed,
                }
            }
        };
        let text = match text {
            Ok(text) => text,
            Err(error) => {
                eprintln!("{place}: {error}");
                tally.different += 1;
                continue;
            }
        };
        let mut tag = job.tag.clone();
        if options.has("--exact") {
            (tag.within, tag.rounding) = (None, 0.0);
        }
        if options.has("--times") && tag.times.take().is_some() {
            different.extend(renewed(job).map(|found| (job.document, found)));
        }
        match compare::compare(job.figure, &tag, &text, job.number) {
            Ok(found) if found.differences.is_empty() => tally.equal += 1,
            Ok(found) => {
                for (line, difference) in &found.differences {
                    eprintln!("{}:{}:{difference}", job.document, line + 1);
                }
                tally.different += 1;
                different.push((job.document, found));
            }
            Err(error) => {
                eprintln!("{place}: {command}: {error}");
                tally.different += 1;
            }
        }
    }
    different
}

/// The tag of a figure, with the day and the commit of a run of today.
fn renewed(job: &Job) -> Option<Found> {
    let (at, _) = *job.figure.tag.as_ref()?;
    let text = read(Path::new(job.document)).ok()?;
    let print = |command: &str| Command::new("bash").args(["-c", command]).output().ok().map(|output| output.stdout);
    let run = print("echo $(date -u +%F), $(git rev-parse --short=7 HEAD)")?;
    let line = text.lines().nth(at)?.replace(&job.tag.run, String::from_utf8_lossy(&run).trim());
    Some(Found { right: vec![line], at, length: 1, ..Found::default() })
}

/// How many of these have the command, file and heads of a figure.
fn number(before: &[Figure], figure: &Figure, tag: &Printed) -> usize {
    let heads = |figure: &Figure| match &figure.content {
        Content::Table(table) => Some(table.heads.clone()),
        Content::Fence(_) => None,
    };
    let alike = |other: &&Figure| match &other.tag {
        Some((_, Tag::Printed(before))) => before.command == tag.command && before.file == tag.file,
        _ => false,
    };
    before.iter().filter(alike).filter(|other| heads(other) == heads(figure)).count()
}

/// What the command prints, from a run or from the last one.
fn output(command: &str, options: &Options) -> Result<String, String> {
    let folder = folder(command);
    let file = folder.join("printed");
    let words: Vec<&str> = command.split(' ').collect();
    // Examples and programs write into a folder of ours, and say so.
    let behind = |option: &str| words.iter().skip_while(|word| **word != option).nth(1);
    let program = behind("--example").or_else(|| behind("-p")).map(|name| name.replace('-', "_"));
    let as_usual = |text: String| match &program {
        Some(name) => text.replace(&*folder.to_string_lossy(), &format!("output/{name}")),
        None => text,
    };
    if options.has("--kept") {
        return read(&file).map(as_usual);
    }
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let separator = if words.contains(&"--") { "" } else { " --" };
    let whole = match &program {
        Some(_) => format!("{command}{separator} --output {}", folder.display()),
        None => command.into(),
    };
    let whole = match &options.profile {
        Some(profile) => whole.replace("--release", &format!("--profile {profile}")),
        None => whole,
    };
    eprintln!("$ {whole}");
    let start = Instant::now();
    let failed = |error| format!("{whole}: {error}");
    let output = Command::new("bash").args(["-c", &whole]).stderr(Stdio::inherit()).output().map_err(failed)?;
    if !output.status.success() {
        return Err(format!("{whole}: {}", output.status));
    }
    eprintln!("  {:.0} s", start.elapsed().as_secs_f64());
    let text = String::from_utf8(output.stdout).map_err(|error| format!("{whole}: {error}"))?;
    fs::write(&file, &text).map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(as_usual(text))
}

/// Where a command writes, and what it prints is kept.
fn folder(command: &str) -> PathBuf {
    let words = command.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    Path::new(FOLDER).join(words.collect::<Vec<_>>().join("_"))
}

/// Puts the right lines into a document.
fn write(document: &str, mut found: Vec<Found>) -> Result<(), String> {
    let text = read(Path::new(document))?;
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    found.sort_by_key(|found| std::cmp::Reverse(found.at));
    for found in found {
        lines.splice(found.at..found.at + found.length, found.right);
    }
    println!("wrote {document}");
    fs::write(document, lines.join("\n") + "\n").map_err(|error| format!("{document}: {error}"))
}

/// The pages whose tables are looked at.
fn documents() -> Result<Vec<String>, String> {
    let mut found: Vec<String> = ["README.md", "src/lib.md", "src/front.md"].map(String::from).into();
    let mut folders = vec!["docs".to_string()];
    while let Some(folder) = folders.pop() {
        let entries = fs::read_dir(&folder).map_err(|error| format!("{folder}: {error}"))?;
        for entry in entries {
            let path = entry.map_err(|error| format!("{folder}: {error}"))?.path();
            let name = path.to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(name);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                found.push(name);
            }
        }
    }
    found[3..].sort();
    Ok(found)
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}
