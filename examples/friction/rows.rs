//! Schemes and corrections by name, and tables of what is measured of them.

use contact_dynamics::corrector::NonsmoothSplitting;
use contact_dynamics::{
    Bathe, CdLagrange, Composite, Corrector, GeneralizedAlpha, MoreauJean, Newmark, PersistencyCorrection, Result,
    TimeIntegrator,
};
use example_support::output::decimal;
use std::fmt::Write;

/// A scheme and what tables call it.
#[derive(Clone, Copy)]
pub(crate) struct Scheme {
    pub(crate) name: &'static str,
    pub(crate) make: fn() -> Box<dyn TimeIntegrator>,
}

pub(crate) const TRAPEZOIDAL: Scheme = Scheme { name: "trapezoidal rule", make: || Box::new(Newmark::trapezoidal()) };
pub(crate) const COMPOSITE: Scheme = Scheme { name: "composite", make: || Box::new(Composite) };
pub(crate) const CHUNG_HULBERT: Scheme = Scheme {
    name: "Chung–Hulbert(0.8)",
    make: || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap_or_else(|_| unreachable!())),
};
pub(crate) const BATHE: Scheme = Scheme { name: "Bathe", make: || Box::<Bathe>::default() };
pub(crate) const CD_LAGRANGE: Scheme = Scheme { name: "CD-Lagrange", make: || Box::new(CdLagrange) };
pub(crate) const MOREAU_JEAN: Scheme =
    Scheme { name: "Moreau–Jean(0.5)", make: || Box::new(MoreauJean::new(0.5).unwrap_or_else(|_| unreachable!())) };

/// What is done to the result of a step.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Correction {
    None,
    Persistency,
    History,
    Splitting,
}

impl Correction {
    pub(crate) const ALL: [Self; 4] = [Self::None, Self::Persistency, Self::History, Self::Splitting];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "–",
            Self::Persistency => "λ_v/λ_a",
            Self::History => "λ_v/λ_a + history",
            Self::Splitting => "nonsmooth splitting",
        }
    }

    /// Whether it can act with a scheme.
    pub(crate) fn serves(self, scheme: Scheme) -> bool {
        let tableau = (scheme.make)().tableau();
        self != Self::Splitting || tableau.depth() == 1 && tableau.stages.len() == 1
    }

    pub(crate) fn correctors(self) -> Vec<Box<dyn Corrector<f64>>> {
        match self {
            Self::None => Vec::new(),
            Self::Persistency => vec![Box::new(PersistencyCorrection::new())],
            Self::History => vec![Box::new(PersistencyCorrection::with_history_projection())],
            Self::Splitting => vec![Box::new(NonsmoothSplitting)],
        }
    }
}

/// A table under its title; runs that fail have empty cells, and a line below.
pub(crate) struct Table {
    text: String,
    failures: String,
}

impl Table {
    pub(crate) fn new(title: &str, head: &[&str]) -> Self {
        let text = format!("{title}\n\n| {} |\n|{}\n", head.join(" | "), " --- |".repeat(head.len()));
        Self { text, failures: String::new() }
    }

    /// A row: its names, and groups of so many numbers with their digits.
    pub(crate) fn row<const N: usize>(&mut self, names: &[&str], digits: [i32; N], groups: Vec<Result<[f64; N]>>) {
        let mut cells: Vec<String> = names.iter().map(|&name| name.into()).collect();
        for group in groups {
            match group {
                Ok(numbers) => cells.extend(numbers.iter().zip(digits).map(|(&x, digits)| number(x, digits))),
                Err(error) => {
                    cells.extend([const { String::new() }; N]);
                    let _ = write!(self.failures, "\n{}: {error}\n", names.join(", "));
                }
            }
        }
        let _ = writeln!(self.text, "| {} |", cells.join(" | "));
    }

    pub(crate) fn text(self) -> String {
        self.text + &self.failures
    }
}

/// A number with so many decimals, or, for negative ones, that many digits and a power of ten.
fn number(x: f64, digits: i32) -> String {
    match usize::try_from(-digits) {
        Ok(digits) if digits > 0 => format!("{x:.*e}", digits - 1),
        _ => decimal(x, digits),
    }
}
