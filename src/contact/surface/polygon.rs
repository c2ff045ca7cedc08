//! The common part of two facets as a polygon, and quadrature points on it.

/// A rule on a triangle, by its degree.
#[derive(Clone, Copy, Debug)]
pub(super) enum Rule {
    /// Exact for products of two linear functions.
    Two,
    /// Exact for products of two bilinear functions on parallelograms.
    Four,
    /// For pairs of a facet of second order and a quadrilateral. At a lower degree the rows of quadrilaterals of second
    /// order deviate from the gap derivatives by about 1e-4.
    Six,
}

impl Rule {
    /// Weight of each point, and its three barycentric coordinates.
    fn points(self) -> &'static [[f64; 4]] {
        match self {
            Self::Two => &THREE,
            Self::Four => &SIX,
            Self::Six => &TWELVE,
        }
    }
}

#[inline]
pub(super) fn difference(x: [f64; 2], y: [f64; 2]) -> [f64; 2] {
    [x[0] - y[0], x[1] - y[1]]
}

#[inline]
pub(super) fn cross(x: [f64; 2], y: [f64; 2]) -> f64 {
    x[0] * y[1] - x[1] * y[0]
}

/// A direction in the plane of a facet that is usually not perpendicular to any side.
const APEX: [f64; 2] = [0.8146, 0.58];

/// A convex polygon: a quadrilateral cut by four lines.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Polygon {
    corners: [[f64; 2]; 8],
    count: usize,
}

impl Polygon {
    #[inline]
    pub(super) fn push(&mut self, corner: [f64; 2]) {
        // The common part with a nonconvex quadrilateral may have more corners. The last ones are dropped.
        if let Some(place) = self.corners.get_mut(self.count) {
            *place = corner;
            self.count += 1;
        }
    }

    #[inline]
    pub(super) fn corners(&self) -> &[[f64; 2]] {
        &self.corners[..self.count]
    }

    #[inline]
    pub(super) fn area(&self) -> f64 {
        let corners = self.corners();
        let Some(&first) = corners.first() else { return 0.0 };
        let triangle = |pair: &[[f64; 2]]| 0.5 * cross(difference(pair[0], first), difference(pair[1], first));
        corners.windows(2).map(triangle).sum()
    }

    /// The same polygon, listed from the corner that is farthest in a fixed direction.
    ///
    /// The quadrature over the triangle fan from that corner changes smoothly with the polygon: where one corner
    /// splits in two, a triangle without area is added. Otherwise the first corner could change, the quadrature error
    /// would jump, and the iteration of the rows would not converge.
    #[inline]
    fn turned_to_apex(&self) -> Self {
        let height = |corner: &[f64; 2]| APEX[0] * corner[0] + APEX[1] * corner[1];
        let corners = self.corners();
        let farthest = (0..corners.len()).max_by(|&i, &j| height(&corners[i]).total_cmp(&height(&corners[j])));
        let mut turned = *self;
        turned.corners[..self.count].rotate_left(farthest.unwrap_or(0));
        turned
    }

    /// Calls `act` with weights and points of a rule on the triangles of the polygon.
    pub(super) fn each_point(&self, rule: Rule, act: &mut impl FnMut(f64, [f64; 2])) {
        let turned = self.turned_to_apex();
        let [first, rest @ ..] = turned.corners() else { return };
        for pair in rest.windows(2) {
            let [a, b] = [0, 1].map(|k| difference(pair[k], *first));
            let area = 0.5 * cross(a, b);
            for &[weight, _, s, t] in rule.points() {
                act(weight * area, [first[0] + s * a[0] + t * b[0], first[1] + s * a[1] + t * b[1]]);
            }
        }
    }

    /// The part of the polygon to the left of a line.
    #[inline]
    pub(super) fn cut(&self, from: [f64; 2], to: [f64; 2]) -> Self {
        let along = difference(to, from);
        let left = |x: [f64; 2]| cross(along, difference(x, from));
        let mut kept = Self::default();
        let Some(&last) = self.corners().last() else { return kept };
        let (mut before, mut height_before) = (last, left(last));
        for &corner in self.corners() {
            let height = left(corner);
            if (height > 0.0) != (height_before > 0.0) {
                let share = height_before / (height_before - height);
                kept.push(std::array::from_fn(|i| before[i] + share * (corner[i] - before[i])));
            }
            if height > 0.0 {
                kept.push(corner);
            }
            (before, height_before) = (corner, height);
        }
        kept
    }
}

/// Rules of degree 2, 4 and 6 on a triangle of area one: weight and barycentric coordinates (Dunavant, Int. J. Numer.
/// Methods Eng. 21, 1985).
const THREE: [[f64; 4]; 3] = [
    [1.0 / 3.0, 2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 3.0, 1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];
const SIX: [[f64; 4]; 6] = [
    [0.223_381_589_678_011_46, 0.108_103_018_168_070_23, 0.445_948_490_915_964_9, 0.445_948_490_915_964_9],
    [0.223_381_589_678_011_46, 0.445_948_490_915_964_9, 0.108_103_018_168_070_23, 0.445_948_490_915_964_9],
    [0.223_381_589_678_011_46, 0.445_948_490_915_964_9, 0.445_948_490_915_964_9, 0.108_103_018_168_070_23],
    [0.109_951_743_655_321_87, 0.816_847_572_980_458_5, 0.091_576_213_509_770_74, 0.091_576_213_509_770_74],
    [0.109_951_743_655_321_87, 0.091_576_213_509_770_74, 0.816_847_572_980_458_5, 0.091_576_213_509_770_74],
    [0.109_951_743_655_321_87, 0.091_576_213_509_770_74, 0.091_576_213_509_770_74, 0.816_847_572_980_458_5],
];
const TWELVE: [[f64; 4]; 12] = [
    [0.116_786_275_726_379_37, 0.501_426_509_658_179_1, 0.249_286_745_170_910_43, 0.249_286_745_170_910_43],
    [0.116_786_275_726_379_37, 0.249_286_745_170_910_43, 0.501_426_509_658_179_1, 0.249_286_745_170_910_43],
    [0.116_786_275_726_379_37, 0.249_286_745_170_910_43, 0.249_286_745_170_910_43, 0.501_426_509_658_179_1],
    [0.050_844_906_370_206_82, 0.873_821_971_016_995_5, 0.063_089_014_491_502_23, 0.063_089_014_491_502_23],
    [0.050_844_906_370_206_82, 0.063_089_014_491_502_23, 0.873_821_971_016_995_5, 0.063_089_014_491_502_23],
    [0.050_844_906_370_206_82, 0.063_089_014_491_502_23, 0.063_089_014_491_502_23, 0.873_821_971_016_995_5],
    [0.082_851_075_618_373_57, 0.053_145_049_844_816_945, 0.310_352_451_033_784_4, 0.636_502_499_121_398_7],
    [0.082_851_075_618_373_57, 0.053_145_049_844_816_945, 0.636_502_499_121_398_7, 0.310_352_451_033_784_4],
    [0.082_851_075_618_373_57, 0.310_352_451_033_784_4, 0.053_145_049_844_816_945, 0.636_502_499_121_398_7],
    [0.082_851_075_618_373_57, 0.310_352_451_033_784_4, 0.636_502_499_121_398_7, 0.053_145_049_844_816_945],
    [0.082_851_075_618_373_57, 0.636_502_499_121_398_7, 0.053_145_049_844_816_945, 0.310_352_451_033_784_4],
    [0.082_851_075_618_373_57, 0.636_502_499_121_398_7, 0.310_352_451_033_784_4, 0.053_145_049_844_816_945],
];

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 2]]) -> Polygon {
        let mut polygon = Polygon::default();
        for &corner in corners {
            polygon.push(corner);
        }
        polygon
    }

    fn integral(polygon: &Polygon, rule: Rule, of: impl Fn([f64; 2]) -> f64) -> f64 {
        let mut sum = 0.0;
        polygon.each_point(rule, &mut |weight, at| sum += weight * of(at));
        sum
    }

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    #[test]
    fn rules_have_their_degrees() {
        for (rule, degree) in [(Rule::Two, 2), (Rule::Four, 4), (Rule::Six, 6)] {
            for (i, j) in (0..=degree).flat_map(|i| (0..=degree - i).map(move |j| (i, j))) {
                let found = integral(&polygon(&SQUARE), rule, |[x, y]| x.powi(i) * y.powi(j));
                assert!((found - 1.0 / f64::from((i + 1) * (j + 1))).abs() < 1e-15, "{rule:?}: x^{i} y^{j}: {found}");
            }
            // Degree + 2 is used, because on the square the errors of odd powers cancel by symmetry.
            let beyond = integral(&polygon(&SQUARE), rule, |[x, _]| x.powi(degree + 2));
            assert!((beyond - 1.0 / f64::from(degree + 3)).abs() > 1e-9, "{rule:?}: {beyond}");
        }
    }

    #[test]
    fn integrals_change_as_smoothly_as_the_polygon() {
        // A function that no rule integrates exactly. Each corner in turn is cut off a little, with every order of
        // the corners.
        let of = |[x, y]: [f64; 2]| (3.0 * x + 2.0 * y).sin();
        let whole = integral(&polygon(&SQUARE), Rule::Four, of);
        for (cut, first) in (0..4).flat_map(|cut| (0..5).map(move |first| (cut, first))) {
            for size in [1e-4, 1e-7, 1e-10] {
                let toward = |other: [f64; 2]| -> [f64; 2] {
                    std::array::from_fn(|i| SQUARE[cut][i] + size * (other[i] - SQUARE[cut][i]))
                };
                let mut corners = SQUARE.to_vec();
                corners.splice(cut..=cut, [toward(SQUARE[(cut + 3) % 4]), toward(SQUARE[(cut + 1) % 4])]);
                corners.rotate_left(first);
                let found = integral(&polygon(&corners), Rule::Four, of);
                assert!((found - whole).abs() < size + 1e-15, "{cut}, {first}, {size:e}: {:e}", found - whole);
            }
        }
    }
}
