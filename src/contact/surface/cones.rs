//! Cones that hold the normals of facets. They are found once per search, and exclude pairs that cannot be in contact
//! and places that cannot be dents without a look at each pair.

use super::Surface;
use super::shape::{Point, Shape, cross, dot};
use crate::rounding::ROUNDED_SHARE;

/// How far facets are extended beyond their sides, in multiples of their size.
const BEYOND: f64 = 1.25;

/// A cone that holds all normals of a facet and of its extension.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    axis: Point,
    /// Bound of the sine of the angle between the axis and the normals; infinite if there is none.
    sine: f64,
}

impl Cone {
    fn of(shape: &Shape) -> Self {
        let unknown = Self { axis: [0.0; 3], sine: f64::INFINITY };
        let Some(axis) = shape.normal(&super::shape::middle(shape.corners().len())) else { return unknown };
        let mut most = 0.0_f64;
        for product in shape.extreme_products(BEYOND) {
            let turned = cross(axis, product);
            if dot(axis, product).is_nan() || dot(axis, product) <= 0.0 {
                return unknown;
            }
            most = most.max(dot(turned, turned) / dot(product, product));
        }
        Self { axis, sine: most.sqrt() + ROUNDED_SHARE }
    }

    /// A bound of the cosine between the normals of two facets: cos (θ − α) ≤ cos θ + 2 sin (α/2).
    fn cosine(&self, other: &Self) -> f64 {
        dot(self.axis, other.axis) + 2.0 * (self.sine + other.sine)
    }

    /// A bound of the sine of the angle between the axis and the normals of another facet; infinite from a right angle.
    fn spread(&self, other: &Self) -> f64 {
        let turned = cross(self.axis, other.axis);
        let sine = if dot(self.axis, other.axis) > 0.0 { dot(turned, turned).sqrt() } else { f64::INFINITY };
        sine + other.sine
    }
}

#[derive(Debug, Default)]
pub(crate) struct Cones {
    of_facets: Vec<Cone>,
    /// By place of a node, a bound of the sine of the angle between any two normals of the facets around it.
    spreads: Vec<f64>,
    /// The longest side of the smallest facet.
    finest: f64,
}

impl Cones {
    /// Finds the cones at the current positions.
    pub(crate) fn find(&mut self, surface: &Surface, positions: &[Point]) {
        let Self { of_facets, spreads, finest } = self;
        of_facets.clear();
        let mut least = f64::INFINITY;
        of_facets.extend(surface.facets().iter().map(|facet| {
            let shape = facet.shape(positions);
            least = least.min(shape.square_of_size());
            Cone::of(&shape)
        }));
        *finest = least.sqrt();
        spreads.clear();
        spreads.extend((0..surface.nodes().len()).map(|place| {
            let around = surface.corners_at(place);
            let reference = &of_facets[around[0].0];
            2.0 * around.iter().fold(0.0, |most: f64, &(facet, _)| most.max(reference.spread(&of_facets[facet])))
        }));
    }

    /// Whether the normals of all facets that share a vertex with a facet surely differ from its normals by less than
    /// the angle with this sine, with facets extended beyond their sides by a share of their size plus `way`.
    pub(super) fn is_even(&self, surface: &Surface, facet: usize, sine: f64, (share, way): (f64, f64)) -> bool {
        let places = &surface.places(facet)[..surface.facets()[facet].nodes().len()];
        let is_even = |&place: &usize| self.spreads[place] < (1.0 - ROUNDED_SHARE) * sine;
        way <= (BEYOND - share) * self.finest && places.iter().all(is_even)
    }

    /// Whether the mean normal of the node at a place of its surface surely has a cosine below `limit` with all
    /// normals of a facet of another surface (or of this one).
    ///
    /// The cosine of the mean direction is below any negative bound that holds for all normals around the node,
    /// because a mean of unit vectors with positive weights is at most as long as the sum of the weights.
    pub(super) fn surely_face(&self, surface: &Surface, place: usize, other: (&Self, usize), limit: f64) -> bool {
        let (others, facet) = other;
        let cone = &others.of_facets[facet];
        let limit = limit.min(0.0) - ROUNDED_SHARE;
        surface.corners_at(place).iter().all(|&(facet, _)| self.of_facets[facet].cosine(cone) < limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Facet;
    use crate::contact::surface::shape::{add_scaled, norm};

    /// Pseudorandom values from −1 to 1.
    fn noise(k: usize) -> f64 {
        let x = (k as f64 * 12.9898).sin() * 43_758.545_3;
        2.0 * (x - x.floor()) - 1.0
    }

    /// A mesh of 3 × 3 squares, some of them split into triangles, whose nodes are off a plane at random.
    fn rough(seed: usize, share: f64) -> (Surface, Vec<Point>) {
        let at = |k: usize| [(k % 4) as f64, (k / 4) as f64, 0.0];
        let off = |k: usize| std::array::from_fn(|i| noise(97 * seed + 3 * k + i));
        let positions: Vec<Point> = (0..16).map(|k| add_scaled(at(k), share, off(k))).collect();
        let facets = (0..9).flat_map(|k| {
            let a = k + k / 3;
            let corners = [a, a + 1, a + 5, a + 4];
            let [a, b, c, d] = corners;
            match (seed + k) % 3 {
                0 => vec![Facet::from([a, b, c]), Facet::from([a, c, d])],
                _ => vec![Facet::from(corners)],
            }
        });
        (Surface::of_facets(facets, 3, &positions).unwrap(), positions)
    }

    /// Shape functions at points of a facet, up to a share of it beyond its sides.
    fn points(count: usize, beyond: f64) -> Vec<[f64; 4]> {
        let at = |i: i32| -beyond + (1.0 + 2.0 * beyond) * f64::from(i) / 5.0;
        let all = (0..=5).flat_map(|i| (0..=5).map(move |j| (i, j)));
        all.map(|(i, j)| match (count, at(i), at(j)) {
            (3, s, t) => [1.0 - s - t, s, t, 0.0],
            (_, s, t) => [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t],
        })
        .collect()
    }

    #[test]
    fn what_is_told_holds_for_all_normals() {
        let (mut even, mut facing) = (0, 0);
        for seed in 0..40 {
            let (surface, positions) = rough(seed, [1e-4, 1e-3, 3e-3, 0.1][seed % 4]);
            let (other, above) = rough(seed + 100, [0.02, 0.3][seed % 2]);
            let turned = |x: &Point| [x[0], -x[1], -x[2]];
            let above: Vec<Point> = above.iter().map(turned).collect();
            let [mut cones, mut others] = [Cones::default(), Cones::default()];
            cones.find(&surface, &positions);
            others.find(&other, &above);
            let normals = |surface: &Surface, positions: &[Point], facet: usize, beyond: f64| -> Vec<Point> {
                let facet = &surface.facets()[facet];
                let shape = facet.shape(positions);
                points(facet.nodes().len(), beyond).iter().filter_map(|weights| shape.normal(weights)).collect()
            };
            for facet in 0..surface.facets().len() {
                let (sine, share, way) = (0.05, 0.25, 0.5);
                if !cones.is_even(&surface, facet, sine, (share, way)) {
                    continue;
                }
                even += 1;
                for k in 0..surface.facets()[facet].nodes().len() {
                    for beside in surface.facets_at(facet, k) {
                        let size = surface.facets()[beside].shape(&positions).size();
                        let own = normals(&surface, &positions, facet, 0.0);
                        let all = normals(&surface, &positions, beside, share + way / size);
                        let turned = |x: &Point, y: &Point| norm(cross(*x, *y)) >= sine || dot(*x, *y) <= 0.0;
                        assert!(own.iter().all(|x| all.iter().all(|y| !turned(x, y))), "{seed}, {facet}");
                    }
                }
            }
            for (place, &node) in surface.nodes().iter().enumerate() {
                let mean = surface.node_normal(node, &positions).unwrap();
                for facet in 0..other.facets().len() {
                    for limit in [-0.9, -0.2, 0.5] {
                        if cones.surely_face(&surface, place, (&others, facet), limit) {
                            facing += 1;
                            let all = normals(&other, &above, facet, 0.0);
                            assert!(all.iter().all(|normal| dot(*normal, mean) < limit), "{seed}, {place}, {facet}");
                        }
                    }
                }
            }
        }
        assert!(even > 50 && facing > 5000, "{even} {facing}");
    }
}
