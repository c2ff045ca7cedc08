//! Rows between the interface dofs of several bodies.

use crate::real::Real;

/// A row: its condition, and a gap (or jump) as a combination of interface dofs of one, two or more bodies.
///
/// Matching nodes need one row with the weights −1 and 1; a node on a facet of another mesh one with the facet's
/// shape functions; a gap weighted over facets as many entries as there are nodes below it. Along a normal that is no
/// axis there is an entry for each component.
#[derive(Clone, Debug)]
pub struct Coupling<T> {
    /// Body, interface dof, weight.
    pub(super) entries: Vec<(usize, usize, T)>,
    pub(super) is_equality: bool,
}

impl<T: Real> Coupling<T> {
    /// Contact: 0 ≤ Σ weight · value + gap, with a compressive force; from (body, interface dof, weight).
    pub fn unilateral(entries: &[(usize, usize, T)]) -> Self {
        Self { entries: entries.to_vec(), is_equality: false }
    }

    /// A tie: Σ weight · value + gap = 0, with a force of either sign; from (body, interface dof, weight).
    pub fn equality(entries: &[(usize, usize, T)]) -> Self {
        Self { entries: entries.to_vec(), is_equality: true }
    }
}
