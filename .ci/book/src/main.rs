//! Checks the documents of the repository (`check`, with the files of the package on standard input), and turns them
//! into chapters of the book (`chapters`, as a preprocessor of mdBook). Runs in the root of the repository.

mod chapters;
mod check;
mod formulas;
mod markdown;
mod paths;

use anyhow::{Result, bail};
use std::io;
use std::process::ExitCode;

fn main() -> ExitCode {
    run().unwrap_or_else(|error| {
        eprintln!("{error:#}");
        ExitCode::FAILURE
    })
}

fn run() -> Result<ExitCode> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["check"] => {
            let files = io::read_to_string(io::stdin())?.lines().map(String::from).collect();
            let complaints = check::complaints(&files)?;
            for complaint in &complaints {
                eprintln!("{complaint}");
            }
            Ok(if complaints.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        // mdBook asks first whether a preprocessor knows the renderer.
        ["chapters", "supports", _] => Ok(ExitCode::SUCCESS),
        ["chapters"] => {
            let (context, book) = mdbook_preprocessor::parse_input(io::stdin())?;
            let book = chapters::of_repository(book, &context.config.book.src)?;
            serde_json::to_writer(io::stdout(), &book)?;
            Ok(ExitCode::SUCCESS)
        }
        _ => bail!("`check` with the files of the package on standard input, or `chapters` as mdBook calls it"),
    }
}
