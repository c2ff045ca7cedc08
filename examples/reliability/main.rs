//! Where results were silently wrong, and what they are now: one file a subject, each case with the figure of the state
//! before.
//!
//! `cargo run --release --example reliability` prints the table of `docs/measured/reliability.md` and writes it; with `--quick`
//! sweeps are shorter. Figures of "before" were printed by the same cases at commit 9fcb7b6; they are recorded here,
//! for that state of the code is gone.

mod absolute_time;
mod bipenalty;
mod curved;
mod damping;
mod default_correction;
mod explicit_contact;
mod finite;
mod passing_through;
mod quiet_input;
mod release;
mod squeezes;
mod stability;
mod start;

use example_support::output::Output;
use std::fmt::Write;

type Anything = Box<dyn std::error::Error>;

/// A line of the table.
struct Row {
    /// What is run, in which scene.
    case: String,
    /// What came out at commit 9fcb7b6, and what comes out now.
    before: &'static str,
    now: String,
}

/// A subject, and the cases that tell about it: all, or with `true` (quick) shorter ones.
type Subject = (&'static str, fn(bool) -> Result<Vec<Row>, Anything>);

const SUBJECTS: [Subject; 13] = [
    ("contradictory and redundant rows", squeezes::cases),
    ("curved gaps", curved::cases),
    ("damping and corrections", damping::cases),
    ("NaN from the host", finite::cases),
    ("absolute time", absolute_time::cases),
    ("passing through", passing_through::cases),
    ("nothing said of corrections", default_correction::cases),
    ("starts", start::cases),
    ("schemes and steps that cannot work", stability::cases),
    ("explicit impacts", explicit_contact::cases),
    ("input", quiet_input::cases),
    ("release", release::cases),
    ("bipenalty", bipenalty::cases),
];

fn main() -> Result<(), Anything> {
    let output = Output::from_command_line("reliability")?;
    let mut page = String::from("| subject | case | before | now |\n| --- | --- | --- | --- |\n");
    for (subject, cases) in SUBJECTS {
        for Row { case, before, now } in cases(output.quick)? {
            writeln!(page, "| {subject} | {case} | {before} | {now} |")?;
        }
    }
    println!("{page}");
    output.write("reliability.md", &page)
}
