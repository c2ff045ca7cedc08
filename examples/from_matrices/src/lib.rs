//! Impact and contact of models that come as matrices in files: Matrix Market and CSV in, CSV out. The formats are in
//! docs/scenes/from_matrices.md.

mod contacts;
pub mod demo;
mod matrix_market;
mod model;
pub mod options;
pub mod output;
mod refusal;
mod run;
mod schemes;
mod table;

pub use refusal::{Refusal, Result};
pub use run::run;

use clap::ValueEnum;
use demo::Demo;
use options::Options;

/// Does what a command line asks for; the answer is for the screen.
pub fn answer(options: &Options) -> Result<String> {
    if let Some((demo, directory)) = options.demonstration()? {
        let arguments = demo.write(&directory, options.quick)?;
        return Ok(format!("from-matrices {}", arguments.join(" ")));
    }
    if options.mass.is_some() {
        return run(options).map(|summary| summary.to_string());
    }
    let all: Vec<_> = Demo::value_variants()
        .iter()
        .map(|demo| demo.demonstrate(&options.output, options.quick))
        .collect::<Result<_>>()?;
    Ok(all.join("\n"))
}
