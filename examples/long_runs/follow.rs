//! What is looked at in every long run: what its steps allocate, and their work.

use contact_dynamics::{Result, Simulation};

/// Steps before allocations are counted: contacts have been closed and open by then.
const WARM: u64 = 500;

/// Of the whole run.
pub(crate) struct Followed {
    /// Allocations after the first steps.
    pub(crate) allocations: u64,
    /// Linear solves and iterations of contact a step, in the first and in the last tenth.
    pub(crate) solves: [f64; 2],
    pub(crate) iterations: [f64; 2],
    pub(crate) changes: u64,
}

impl Followed {
    /// Takes so many steps, and looks at the state after each.
    pub(crate) fn run(
        run: &mut Simulation<'static, f64>,
        steps: u64,
        mut look: impl FnMut(u64, &mut Simulation<'static, f64>),
    ) -> Result<Self> {
        let mut counts = [[0_u64; 2]; 4];
        let mut outcome = None;
        let mut go = |range: std::ops::Range<u64>, run: &mut Simulation<'static, f64>| {
            for step in range {
                for (place, count) in [0, steps / 10, steps - steps / 10].into_iter().zip(&mut counts) {
                    if step == place {
                        *count = [run.statistics().linear_solves, run.statistics().contact_iterations];
                    }
                }
                run.step()?;
                // (What is measured may allocate: the energy of a mass that is a matrix does.)
                allocation_counter::opt_out(|| look(step + 1, run));
            }
            Ok(())
        };
        go(0..WARM, run)?;
        let counted = allocation_counter::measure(|| outcome = Some(go(WARM..steps, run)));
        outcome.unwrap_or(Ok(()))?;
        let statistics = run.statistics();
        counts[3] = [statistics.linear_solves, statistics.contact_iterations];
        let tenth = (steps / 10) as f64;
        let of = |k: usize| [0, 2].map(|from| (counts[from + 1][k] - counts[from][k]) as f64 / tenth);
        Ok(Self {
            allocations: counted.count_total,
            solves: of(0),
            iterations: of(1),
            changes: statistics.contact_changes,
        })
    }

    /// The cells that all tables end with.
    pub(crate) fn cells(&self) -> Vec<String> {
        let pair = |[first, last]: [f64; 2]| format!("{first:.2}, {last:.2}");
        vec![pair(self.solves), pair(self.iterations), self.allocations.to_string()]
    }

    /// Their heads.
    pub(crate) fn heads() -> Vec<String> {
        ["solves a step: first, last tenth", "iterations of contact a step: first, last tenth", "allocations"]
            .map(String::from)
            .into()
    }

    pub(crate) fn wrong(&self) -> Vec<String> {
        match self.allocations {
            0 => Vec::new(),
            some => vec![format!("{some} allocations")],
        }
    }
}

/// Two digits; rounding below 1e-12 of the scale is none.
pub(crate) fn number(x: f64) -> String {
    if x.abs() < 1e-16 { "0".into() } else { format!("{x:.1e}").replace('-', "−") }
}
