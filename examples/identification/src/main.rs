//! Identifies parameters from a history of contact forces by gradients through impacts.
//!
//! ```text
//! cargo run --release -p identification
//! ```
//!
//! Two bars collide, and the moduli of both are found from the contact force that was measured; then stiffness and
//! damping of a stop in a shaken frame. L-BFGS (`argmin`) gets the derivatives from `Simulation::gradient`.

mod bars;
mod descent;
mod stop;

use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (mut quick, mut output) = (false, PathBuf::from("output/identification"));
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--quick" => quick = true,
            "--output" => output = arguments.next().ok_or("--output needs a folder")?.into(),
            other => return Err(format!("unknown option {other}: --quick and --output FOLDER are known").into()),
        }
    }
    std::fs::create_dir_all(&output)?;
    bars::identify(if quick { 20 } else { 50 }, &output)?;
    stop::identify()
}
