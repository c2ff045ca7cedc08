//! Checks whether surfaces have passed through each other in a step, by weighted gaps along the motion.

use super::Mortar;
use super::integrals::Integrals;
use super::pairs::Pairs;
use crate::contact::surface::{Bounds, Point, add_scaled, sub};
use crate::contact::{FINE, LARGEST_MISS, Stride};
use crate::error::Result;
use crate::real::Real;

/// Largest number of checks in a step. Faster surfaces are rejected if they pass through each other's box.
const CHECKS: u32 = 512;

#[derive(Debug, Default)]
pub(super) struct Inspection {
    ends: [Vec<Point>; 2],
    positions: Vec<Point>,
    pairs: Pairs,
    integrals: Integrals,
    /// Whether each slave node was open, or uncovered, at the start.
    outside: Vec<bool>,
}

impl<T: Real> Mortar<T> {
    /// Rejects a step in which the surfaces penetrated each other, or were stopped apart.
    pub(super) fn check_step(&mut self, step: &Stride<'_, T>) -> Result<()> {
        let motions = self.nodes.boxes_of(|node| self.nodes.way(node, step.u));
        let (path, finest) = (motions[0].farthest(&motions[1]), self.finest());
        if path <= FINE * finest {
            return Ok(());
        }
        self.find_material();
        let mut inspection = std::mem::take(&mut self.work.inspection);
        let result = self.check_path(step, path, FINE * finest, &mut inspection);
        self.work.inspection = inspection;
        result
    }

    fn check_path(&self, step: &Stride<'_, T>, path: f64, fine: f64, inspection: &mut Inspection) -> Result<()> {
        let Inspection { ends, positions, pairs, integrals, outside } = inspection;
        for (positions, u) in ends.iter_mut().zip(step.u) {
            self.nodes.places_at(u, positions);
        }
        let swept = [0, 1].map(|body| {
            let places = self.nodes.bodies()[body].iter().flat_map(|&node| [ends[0][node], ends[1][node]]);
            Bounds::of_points(places)
        });
        let [early, late] = step.t.map(|t| self.thickest(t)[1]);
        let (reach, depth) =
            (self.vicinity.reach.least() + early.max(late), self.depth(step.t[0]).max(self.depth(step.t[1])));
        if !swept[0].inflated(reach).intersects(&swept[1]) {
            return Ok(());
        }
        // Deeper facets are not found, for any length of the motion.
        let deepest = 0.5 * depth;
        let (fine, limit) = (fine.min(deepest), -deepest.min(LARGEST_MISS * path));
        let name = |place: usize| (self.surfaces[0].nodes()[place], 0);
        let Some(checks) = (1..=CHECKS).find(|&checks| f64::from(checks) * fine >= path) else {
            return Err(step.rejected(name(0), "is too fast for its facets to be followed", path, f64::INFINITY));
        };
        let surfaces = self.surfaces.each_ref();
        positions.clone_from(&ends[0]);
        pairs.build(surfaces, positions, reach + path);
        outside.clear();
        outside.resize(self.surfaces[0].nodes().len(), true);
        for check in 0..=checks {
            let share = f64::from(check) / f64::from(checks);
            for &node in self.nodes.bodies().iter().flatten() {
                positions[node] = add_scaled(ends[0][node], share, sub(ends[1][node], ends[0][node]));
            }
            if let Some(material) = self.vicinity.material_of(1) {
                pairs.take_near(surfaces, material, positions, (reach, depth));
            }
            let offsets = self.vicinity.thickness.at(step.t[0] + share * (step.t[1] - step.t[0]));
            integrals.sum(surfaces, positions, offsets, self.multiplier, pairs);
            for (place, sums) in integrals.sums.iter().enumerate().filter(|(_, sums)| sums.is_covered()) {
                if check == 0 {
                    // A node that is already inside may leave freely.
                    outside[place] = sums.gap() >= limit;
                } else if outside[place] && sums.gap() < limit && !self.settings.given_law().is_compliant() {
                    return Err(step.rejected(name(place), "went into the other surface", path, sums.gap()));
                }
            }
        }
        for (row, &place) in self.rows.identities.iter().enumerate() {
            let sums = &integrals.sums[place];
            let stopped = !step.closed[0][row] && step.closed[1][row];
            if stopped && sums.is_covered() && sums.gap() > LARGEST_MISS * path {
                return Err(step.rejected(name(place), "was stopped away from the surface", path, sums.gap()));
            }
        }
        Ok(())
    }
}
