//! Where an example writes, its two options `--quick` and `--output DIR`, and how it prints numbers.

use std::path::PathBuf;

/// Choices of an example without others.
pub struct Output {
    /// Shorter, with fewer digits of certainty.
    pub quick: bool,
    pub directory: PathBuf,
}

impl Output {
    /// Reads the command line of the example `name`; the directory is made if it is missing.
    pub fn from_command_line(name: &str) -> Result<Self, Box<dyn std::error::Error>> {
        let mut output = Self { quick: false, directory: ["output", name].iter().collect() };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--quick" => output.quick = true,
                "--output" => output.directory = arguments.next().ok_or("--output needs a directory")?.into(),
                unknown => {
                    return Err(format!("unknown option {unknown}; usage: {name} [--quick] [--output DIR]").into());
                }
            }
        }
        std::fs::create_dir_all(&output.directory)?;
        Ok(output)
    }

    /// Writes a file into the directory and says so.
    pub fn write(&self, name: &str, content: &str) -> Result<(), Box<dyn std::error::Error>> {
        let path = self.directory.join(name);
        std::fs::write(&path, content)?;
        println!("wrote {}", path.display());
        Ok(())
    }
}

/// A number with at most `digits` decimals, without a sign before zero.
pub fn decimal(x: f64, digits: i32) -> String {
    let scale = 10.0_f64.powi(digits);
    ((x * scale).round() / scale + 0.0).to_string().replace('-', "−")
}
