//! All hard cases of contact and friction, with every scheme, correction and mass that claims to handle them: what is
//! asked, the worst that came out, and with what; and what must fail, failing as is known.
//!
//! `cargo run --release --example hard_cases` prints the tables of `docs/measured/hard_cases.md` and writes them, in some
//! minutes; with `--quick` meshes are coarse, phases two, runs short. The program fails if a case does not hold.
//!
//! `tried.rs` says what claims what, `table.rs` what is asked; cases are in one file a subject.

mod bars;
mod failures;
mod friction;
mod rubbing;
mod small;
mod solids;
mod table;
mod tried;
mod walls;

use example_support::output::Output;
use table::Row;

type Anything = Box<dyn std::error::Error>;

/// How much is run.
pub(crate) struct Extent {
    pub(crate) quick: bool,
    /// Places of an impact within its step.
    pub(crate) phases: Vec<f64>,
    /// Steps, and how many of the meshes of the paper's bars.
    pub(crate) steps: Vec<f64>,
    pub(crate) meshes: usize,
}

impl Extent {
    fn new(quick: bool) -> Self {
        let steps = vec![2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4];
        match quick {
            true => Self { quick, phases: vec![0.25, 0.75], steps: steps[..2].to_vec(), meshes: 2 },
            false => Self { quick, phases: (0..10).map(|k| 0.05 + 0.1 * f64::from(k)).collect(), steps, meshes: 3 },
        }
    }

    /// A few of the phases, for what takes long.
    pub(crate) fn few(&self) -> Vec<f64> {
        self.phases.iter().step_by(4).copied().collect()
    }
}

/// A part of a table.
type Cases = fn(&Extent) -> Vec<Row>;

const HOLD: [Cases; 6] = [bars::cases, walls::cases, small::cases, solids::cases, friction::cases, rubbing::cases];

fn main() -> Result<(), Anything> {
    let output = Output::from_command_line("hard_cases")?;
    let extent = Extent::new(output.quick);
    let mut hold = Vec::new();
    for cases in HOLD {
        hold.extend(cases(&extent));
    }
    // (Numbers before letters, and 2 before 10: in the order of the list.)
    hold.sort_by_key(Row::place);
    let fail = failures::cases(&extent);
    let page = format!(
        "What must hold\n\n{}\nWhat must fail, and does as is known\n\n{}",
        table::table(&hold),
        table::table(&fail)
    );
    println!("{page}");
    output.write("hard_cases.md", &page)?;
    let wrong: Vec<&Row> = hold.iter().chain(&fail).filter(|row| !row.holds()).collect();
    for reason in wrong.iter().flat_map(|row| row.failures()) {
        eprintln!("{reason}");
    }
    match wrong.len() {
        0 => Ok(()),
        wrong => Err(format!("{wrong} lines of {} do not hold", hold.len() + fail.len()).into()),
    }
}
