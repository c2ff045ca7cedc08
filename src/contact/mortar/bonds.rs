//! Slave nodes that are bonded to the master until their force is too large.

use crate::contact::affine_rows::SearchState;
use crate::contact::surface::{Nodes, Surface};
use crate::contact::{BondStrength, Candidates, ContactConstraint, Tie};
use crate::error::Result;
use crate::real::Real;

/// The ties of the bonded nodes, and their strength.
#[derive(Debug)]
pub(super) struct Bonds<T: Real> {
    tie: Tie<T>,
    strength: BondStrength,
    /// For each node of the slave surface, by place, whether it is bonded.
    holds: Vec<bool>,
    /// Whether `holds` has changed since the last search.
    changed: bool,
}

impl<T: Real> Bonds<T> {
    /// Between two surfaces, on the dofs of `nodes`.
    pub(super) fn new(nodes: Nodes, surfaces: [Surface; 2], strength: BondStrength) -> Self {
        let mut holds = vec![false; surfaces[0].nodes().len()];
        let slave = surfaces[0].clone();
        let tie = Tie::of_bonds(nodes, surfaces);
        tie.nodes().iter().for_each(|&node| holds[slave.place(node)] = true);
        Self { tie, strength, holds, changed: false }
    }

    pub(super) fn hold(&self, place: usize) -> bool {
        self.holds[place]
    }

    pub(super) fn tie(&self) -> &Tie<T> {
        &self.tie
    }

    pub(super) fn tie_mut(&mut self) -> &mut Tie<T> {
        &mut self.tie
    }

    /// Sets the broken nodes of the slave (ascending).
    pub(super) fn set_broken(&mut self, slave: &Surface, broken: &[usize]) {
        for &node in self.tie.nodes() {
            let (place, now) = (slave.place(node), broken.binary_search(&node).is_err());
            self.changed |= std::mem::replace(&mut self.holds[place], now) != now;
        }
    }

    /// Lists the rows of the bonded nodes, and linearizes them at u; returns whether they have changed.
    pub(super) fn search(&mut self, slave: &Surface, state: &SearchState<'_, T>) -> Result<Candidates> {
        let &SearchState { t, u, v, ahead } = state;
        let Self { tie, holds, changed, .. } = self;
        let relisted = std::mem::take(changed);
        if relisted {
            let tied: Vec<bool> = tie.nodes().iter().map(|&node| holds[slave.place(node)]).collect();
            tie.list_rows(|place| tied[place]);
        }
        let found = tie.search(t, u, v, ahead)?;
        Ok(Candidates::changed_if(relisted || found == Candidates::Changed))
    }

    /// Appends the nodes whose rows exceed the strength, with the ratio of their stress to the strength.
    pub(super) fn overloads(&self, forces: &[T], dimension: usize, broken: &mut Vec<(usize, f64)>) {
        for (row, place) in self.tie.listed() {
            let area = self.tie.area(place).value();
            let stress = |row: usize| forces[row].value() / area;
            let shear = (row + 1..row + dimension).fold(0.0_f64, |shear, row| shear.hypot(stress(row)));
            let load = self.strength.load([-stress(row), shear]);
            if load >= 1.0 {
                broken.push((self.tie.nodes()[place], load));
            }
        }
    }
}
