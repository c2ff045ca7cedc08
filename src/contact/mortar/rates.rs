//! Rates of weighted gaps along a motion.

use super::Mortar;
use super::integrals::Integrals;
use crate::contact::GapRates;
use crate::contact::surface::{Point, SecondDifference};
use crate::real::Real;

/// Memory for rates.
#[derive(Debug, Default)]
pub(super) struct Rates {
    integrals: Integrals,
    differences: SecondDifference,
}

impl<T: Real> Mortar<T> {
    /// ∂g/∂t, which is that of the offsets, and Ġ v + ∂ġ/∂t, by differences of integrals without derivatives. A node
    /// that nothing lies over on the way has the row that it had: none of the latter.
    pub(super) fn rates_along(&mut self, (t, u, v): (f64, &[T], &[T]), out: &mut [GapRates<T>]) {
        let Self { nodes, slave, master, thickness, pairs, rows, rates, ahead, multiplier, integrals: known, .. } =
            self;
        let Rates { integrals, differences } = rates;
        let change = thickness.ramp.rate(t);
        for (out, spot) in out.iter_mut().zip(&rows.spots) {
            out.rate = T::of(-change * spot.offset);
        }
        let all = || nodes.bodies().iter().flatten();
        let gaps = |time: f64, positions: &[Point], list: &mut Vec<f64>| {
            // (Rows are linearized where the state is, as a rule.)
            let bits = |list: &[Point], node: usize| list[node].map(f64::to_bits);
            let is_there = |&node: &usize| bits(positions, node) == bits(&nodes.positions, node);
            let is_known = time.to_bits() == t.to_bits() && all().all(is_there);
            if !is_known {
                let offsets = thickness.at(time);
                integrals.sum([&*slave, &*master], positions, offsets, *multiplier, pairs);
            }
            let sums = if is_known { &known.sums } else { &integrals.sums };
            list.extend(rows.places.iter().map(|&place| sums[place].gap_if_covered()));
        };
        differences.find(nodes, (t, u, v), (*ahead, slave.finest().min(master.finest())), gaps, |row, acceleration| {
            out[row].acceleration = T::of(acceleration);
        });
    }
}
