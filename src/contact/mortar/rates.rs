//! Rates of weighted gaps along a motion.

use super::Mortar;
use super::integrals::Integrals;
use crate::contact::GapRates;
use crate::contact::surface::{Point, SecondDifference};
use crate::real::Real;

#[derive(Debug, Default)]
pub(super) struct Rates {
    integrals: Integrals,
    differences: SecondDifference,
}

impl<T: Real> Mortar<T> {
    /// ∂g/∂t, from the offsets, and Ġ v + ∂ġ/∂t by differences of integrals. A node that becomes uncovered along the
    /// motion keeps its row: its Ġ v + ∂ġ/∂t is zero.
    pub(super) fn rates_along(&mut self, (t, u, v): (f64, &[T], &[T]), out: &mut [GapRates<T>]) {
        let Self { nodes, surfaces, vicinity, pairs, rows, work, multiplier, integrals: known, .. } = self;
        let (surfaces, ahead) = (surfaces.each_ref(), work.ahead);
        let Rates { integrals, differences } = &mut work.rates;
        let thickness = &vicinity.thickness;
        let change = thickness.ramp.rate(t);
        for (out, (offset, _)) in out.iter_mut().zip(&rows.offsets) {
            out.rate = T::of(-change * offset);
        }
        let all = || nodes.bodies().iter().flatten();
        let gaps = |time: f64, positions: &[Point], list: &mut Vec<f64>| {
            // Usually the rows are linearized at the current state.
            let bits = |list: &[Point], node: usize| list[node].map(f64::to_bits);
            let is_there = |&node: &usize| bits(positions, node) == bits(&nodes.positions, node);
            let is_known = time.to_bits() == t.to_bits() && all().all(is_there);
            if !is_known {
                let offsets = thickness.at(time);
                integrals.sum(surfaces, positions, offsets, *multiplier, pairs);
            }
            let sums = if is_known { &known.sums } else { &integrals.sums };
            list.extend(rows.identities.iter().map(|&place| sums[place].gap_if_covered()));
        };
        differences.find(
            nodes,
            (t, u, v),
            (ahead, surfaces[0].finest().min(surfaces[1].finest())),
            gaps,
            |row, acceleration| {
                out[row].acceleration = T::of(acceleration);
            },
        );
    }
}
