//! Impact and contact of a model that comes as matrices: `from-matrices --help`.

use clap::Parser;
use from_matrices::options::Options;
use std::process::ExitCode;

fn main() -> ExitCode {
    match from_matrices::answer(&Options::parse()) {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(refusal) => {
            eprintln!("error: {refusal}");
            ExitCode::FAILURE
        }
    }
}
