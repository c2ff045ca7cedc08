//! Prints the public items in a JSON file of rustdoc, one a line, without implementations that the compiler derives or
//! every type has. Exit code 3: the file is in the format of another toolchain.

use std::process::ExitCode;

fn main() -> Result<ExitCode, Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("which file?")?;
    let text = std::fs::read_to_string(&path)?;
    let (_, format) = text.rsplit_once("\"format_version\":").ok_or("not a file of rustdoc")?;
    let format = format.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
    if format != rustdoc_types::FORMAT_VERSION.to_string() {
        eprintln!("rustdoc writes format {format}, known is {}", rustdoc_types::FORMAT_VERSION);
        return Ok(ExitCode::from(3));
    }
    let builder = public_api::Builder::from_rustdoc_json(path);
    let api = builder.omit_blanket_impls(true).omit_auto_trait_impls(true).omit_auto_derived_impls(true).build()?;
    // Of the prelude only names: their items are listed where they belong.
    let mut is_prelude = false;
    for line in api.items().map(ToString::to_string) {
        let own = line.split_once("contact_dynamics::prelude").map(|(_, name)| name);
        if line.starts_with("pub mod ") {
            is_prelude = own.is_some();
        }
        let is_name = own.is_some_and(|path| {
            let name = path.trim_start_matches("::");
            !name.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_').starts_with("::")
        });
        if !is_prelude || is_name {
            println!("{line}");
        }
    }
    Ok(ExitCode::SUCCESS)
}
