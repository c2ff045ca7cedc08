//! The command line.

use crate::demo::Demo;
use crate::refusal::{Refusal, Result};
use crate::schemes;
use clap::{Parser, ValueEnum};
use std::path::PathBuf;

const EXAMPLE: &str = "\
Dofs count from 1 in every file, as rows and columns do in Matrix Market files. Formats of all files, and how other \
codes write M and K: docs/scenes/from_matrices.md.

Example:
  from-matrices --demo bars inputs
  from-matrices --mass inputs/mass.mtx --stiffness inputs/stiffness.mtx --contacts inputs/contacts.csv \\
      --initial inputs/initial.csv --step 1e-3 --end 0.4 --output results

Without matrices the three demonstrations are written, run and compared with their exact solutions.";

/// Impact and contact of a model that comes as matrices: forces and motions in CSV files.
#[derive(Clone, Debug, Parser)]
#[command(name = "from-matrices", after_help = EXAMPLE)]
pub struct Options {
    /// M: a Matrix Market file, a matrix (consistent or lumped) or an array of one column (lumped).
    #[arg(long, value_name = "FILE", requires_all = ["stiffness", "contacts", "step", "end"])]
    pub mass: Option<PathBuf>,
    /// K: a Matrix Market file.
    #[arg(long, value_name = "FILE", requires = "mass")]
    pub stiffness: Option<PathBuf>,
    /// Table of contacts: node,dofs,normal,gap and, if you like, friction,opposite,weights.
    #[arg(long, value_name = "FILE", requires = "mass")]
    pub contacts: Option<PathBuf>,
    /// Step size.
    #[arg(long, value_name = "H", requires = "mass")]
    pub step: Option<f64>,
    /// Time at which the run ends; it starts at 0.
    #[arg(long, value_name = "T", requires = "mass")]
    pub end: Option<f64>,
    /// C: a Matrix Market file.
    #[arg(long, value_name = "FILE", requires = "mass")]
    pub damping: Option<PathBuf>,
    /// C = A M + B K.
    #[arg(long, num_args = 2, value_names = ["A", "B"], requires = "mass", conflicts_with = "damping")]
    pub rayleigh: Option<Vec<f64>>,
    /// Table of initial motion: dof and u, v or both; dofs that are not named start at rest.
    #[arg(long, value_name = "FILE", requires = "mass")]
    pub initial: Option<PathBuf>,
    /// Table of loads: dof,force (constant), or time,dof,force (linear between the times, constant beyond them).
    #[arg(long, value_name = "FILE", requires = "mass")]
    pub load: Option<PathBuf>,
    /// Acceleration of gravity along the dofs of a node, say 0,0,-9.81: every node has as many dofs, node by node.
    #[arg(long, value_name = "G", value_delimiter = ',', allow_hyphen_values = true, requires = "mass")]
    pub gravity: Option<Vec<f64>>,
    /// Table of fixed dofs: dof.
    #[arg(long, value_name = "FILE", requires = "mass")]
    pub supports: Option<PathBuf>,
    /// Lump M by its row sums, for explicit schemes.
    #[arg(long, requires = "mass")]
    pub lump: bool,
    #[arg(long, value_name = "NAME", default_value = "chung-hulbert", help = schemes::scheme_help())]
    pub scheme: String,
    #[arg(long, value_name = "NAME", default_value = "default", help = schemes::correction_help())]
    pub correction: String,
    /// Gaps that are negative at the start: refused, or taken for zero as meshes leave them.
    #[arg(long, value_enum, default_value_t)]
    pub overlap: Overlap,
    /// Write every N-th step (and the last one).
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub every: u64,
    /// Dofs in motion.csv: `all`, or numbers and ranges such as 1,5,10-20; without this those of the contacts' nodes.
    #[arg(long, value_name = "DOFS")]
    pub record: Option<String>,
    /// Where forces.csv, motion.csv and energy.csv go.
    #[arg(long, value_name = "DIR", default_value = "output/from_matrices")]
    pub output: PathBuf,
    /// Write the input files of a demonstration into a directory and say how to run it.
    #[arg(long, num_args = 2, value_names = ["bar|bars|slide", "DIR"], conflicts_with = "mass")]
    pub demo: Option<Vec<String>>,
    /// Demonstrations with fewer elements.
    #[arg(long)]
    pub quick: bool,
}

/// What becomes of gaps that are negative at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Overlap {
    #[default]
    Refused,
    Adjusted,
}

impl Options {
    /// The demonstration that is to be written, and where.
    pub fn demonstration(&self) -> Result<Option<(Demo, PathBuf)>> {
        let Some([name, directory]) = self.demo.as_deref() else { return Ok(None) };
        let demo = Demo::from_str(name, false)
            .map_err(|_| Refusal::new(format!("there is no demonstration `{name}`; the names are bar, bars, slide")))?;
        Ok(Some((demo, directory.into())))
    }
}

/// The dofs, from 0, of `all` or of numbers and ranges from 1.
pub fn recorded(text: &str, dofs: usize) -> Result<Vec<usize>> {
    if text == "all" {
        return Ok((0..dofs).collect());
    }
    let refused = |word: &str| {
        let what = format!("--record: `{word}` is not a dof from 1 to {dofs}, nor a range such as 3-7, nor `all`");
        Refusal::new(what)
    };
    let mut recorded = Vec::new();
    for word in text.split(',').map(str::trim) {
        let dof = |text: &str| text.trim().parse().ok().filter(|dof| (1..=dofs).contains(dof));
        let (first, last) = word.split_once('-').unwrap_or((word, word));
        match (dof(first), dof(last)) {
            (Some(first), Some(last)) if first <= last => recorded.extend(first - 1..last),
            _ => return Err(refused(word)),
        }
    }
    recorded.sort_unstable();
    recorded.dedup();
    Ok(recorded)
}
