//! Checks whether surfaces have passed through each other in a step, by weighted gaps along the motion.

use super::Mortar;
use super::integrals::Integrals;
use super::pairs::Pairs;
use crate::contact::surface::{Bounds, Point, add_scaled, sub};
use crate::contact::{LARGEST_MISS, Stride};
use crate::error::Result;
use crate::real::Real;

/// Relative motion, as a share of the smallest facet, up to which surfaces are not checked; also the motion between
/// two checks.
const FINE: f64 = 0.125;

/// Largest number of checks in a step. Faster surfaces are rejected if they pass through each other's box.
const LOOKS: u32 = 512;

#[derive(Debug, Default)]
pub(super) struct Look {
    ends: [Vec<Point>; 2],
    positions: Vec<Point>,
    pairs: Pairs,
    integrals: Integrals,
    /// Whether each slave node was open, or uncovered, at the start.
    outside: Vec<bool>,
}

impl<T: Real> Mortar<T> {
    /// Rejects a step in which the surfaces penetrated each other, or were stopped apart.
    pub(super) fn look_at(&mut self, step: &Stride<'_, T>) -> Result<()> {
        let motions = self.nodes.boxes_of(|node| self.nodes.way(node, step.u));
        let (way, finest) = (motions[0].farthest(&motions[1]), self.finest());
        if way <= FINE * finest {
            return Ok(());
        }
        self.find_material();
        let mut look = std::mem::take(&mut self.look);
        let result = self.look_along(step, way, FINE * finest, &mut look);
        self.look = look;
        result
    }

    fn look_along(&self, step: &Stride<'_, T>, way: f64, fine: f64, look: &mut Look) -> Result<()> {
        let Look { ends, positions, pairs, integrals, outside } = look;
        for (positions, u) in ends.iter_mut().zip(step.u) {
            self.nodes.places_at(u, positions);
        }
        let swept = [0, 1].map(|body| {
            let places = self.nodes.bodies()[body].iter().flat_map(|&node| [ends[0][node], ends[1][node]]);
            Bounds::of_points(places)
        });
        let [early, late] = step.t.map(|t| self.thickest(t)[1]);
        let (reach, depth) = (self.reach.least() + early.max(late), self.depth(step.t[0]).max(self.depth(step.t[1])));
        if !swept[0].inflated(reach).intersects(&swept[1]) {
            return Ok(());
        }
        // Deeper facets are not found, for any length of the motion.
        let deepest = 0.5 * depth;
        let (fine, limit) = (fine.min(deepest), -deepest.min(LARGEST_MISS * way));
        let name = |place: usize| (self.slave.nodes()[place], 0);
        let Some(looks) = (1..=LOOKS).find(|&looks| f64::from(looks) * fine >= way) else {
            return Err(step.refuse(name(0), "is too fast for its facets to be followed", way, f64::INFINITY));
        };
        let surfaces = [&self.slave, &self.master];
        positions.clone_from(&ends[0]);
        pairs.build(surfaces, positions, reach + way);
        outside.clear();
        outside.resize(self.slave.nodes().len(), true);
        for look in 0..=looks {
            let share = f64::from(look) / f64::from(looks);
            for &node in self.nodes.bodies().iter().flatten() {
                positions[node] = add_scaled(ends[0][node], share, sub(ends[1][node], ends[0][node]));
            }
            if let Some(material) = &self.material {
                pairs.take_near(surfaces, material, positions, (reach, depth));
            }
            let offsets = self.thickness.at(step.t[0] + share * (step.t[1] - step.t[0]));
            integrals.sum(surfaces, positions, offsets, self.multiplier, pairs);
            for (place, sums) in integrals.sums.iter().enumerate().filter(|(_, sums)| sums.is_covered()) {
                if look == 0 {
                    // A node that is already inside may leave freely.
                    outside[place] = sums.gap() >= limit;
                } else if outside[place] && sums.gap() < limit && !self.law.is_compliant() {
                    return Err(step.refuse(name(place), "went into the other surface", way, sums.gap()));
                }
            }
        }
        for (row, &place) in self.rows.places.iter().enumerate() {
            let sums = &integrals.sums[place];
            let stopped = !step.closed[0][row] && step.closed[1][row];
            if stopped && sums.is_covered() && sums.gap() > LARGEST_MISS * way {
                return Err(step.refuse(name(place), "was stopped away from the surface", way, sums.gap()));
            }
        }
        Ok(())
    }
}
