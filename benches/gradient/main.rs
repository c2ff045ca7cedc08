//! Gradients of runs: what they cost, and how far they are from differences of whole runs.
//!
//! `cargo bench --bench gradient -- [elements a side]…` (default 10 and 20) measures the cost, `-- differences` compares.

mod cost;
mod differences;

use contact_dynamics::Result;
use example_support::timing::Arguments;

fn main() -> Result<()> {
    let arguments = Arguments::read(&[10, 20], &[3]);
    if arguments.quick || std::env::args().any(|argument| argument == "differences") {
        differences::compare(arguments.quick)?;
    }
    if arguments.quick || !std::env::args().any(|argument| argument == "differences") {
        cost::measure(&arguments)?;
    }
    Ok(())
}
