//! Two straight edges: the closest points of the lines through them, their distance, and when moving ones meet.

use crate::contact::surface::{Point, add_scaled, cross, dot, norm, sub};
use crate::rounding::ROUNDED_SHARE;

/// The two ends of an edge, or their velocities.
pub(super) type Ends = [Point; 2];

/// The closest points of the lines through two edges.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// Shares along the edges, from 0 to 1 within them.
    pub(super) shares: [f64; 2],
    /// The unit vector along t_e × t_f.
    pub(super) normal: Point,
    /// The signed distance of the first line from the second along the normal.
    pub(super) gap: f64,
    /// Sine of the angle between the edges.
    pub(super) sine: f64,
}

impl Crossing {
    /// The closest points of two lines; none if one has no length, or if they are parallel up to rounding.
    pub(super) fn of([e, f]: [Ends; 2]) -> Option<Self> {
        let (along, other) = (sub(e[1], e[0]), sub(f[1], f[0]));
        let (across, between) = (cross(along, other), sub(e[0], f[0]));
        let square = dot(across, across);
        let sine = square.sqrt() / (norm(along) * norm(other));
        if sine.is_nan() || sine <= ROUNDED_SHARE {
            return None;
        }
        let shares = [dot(cross(other, between), across) / square, dot(cross(along, between), across) / square];
        let normal = across.map(|x| x / square.sqrt());
        Some(Self { shares, normal, gap: dot(normal, between), sine })
    }

    /// With the reversed normal and gap.
    pub(super) fn turned(self) -> Self {
        Self { normal: self.normal.map(|x| -x), gap: -self.gap, ..self }
    }

    /// Oriented so that the normal points along a direction.
    pub(super) fn as_seen_along(self, direction: Point) -> Self {
        if dot(self.normal, direction) < 0.0 { self.turned() } else { self }
    }

    /// How far the closest points lie beyond the ends of the two edges, in shares of the edges; zero within.
    pub(super) fn excess(&self) -> [f64; 2] {
        self.shares.map(|share| (-share).max(share - 1.0).max(0.0))
    }

    /// Shape functions of the four ends in the motion of the first point relative to the second.
    pub(super) fn weights(&self) -> [f64; 4] {
        let [s, t] = self.shares;
        [1.0 - s, s, t - 1.0, -t]
    }

    /// The derivatives of one of the shares with respect to the positions of the four ends.
    ///
    /// With r = x_e − x_f = g n and w = δx_e − δx_f at fixed shares, r·d = r·c = 0 along both edges d and c give
    /// d·d δs − c·d δt = −(w·d + r·δd) and d·c δs − c·c δt = −(w·c + r·δc).
    pub(super) fn share_gradient(&self, edge: usize, [e, f]: [Ends; 2]) -> [Point; 4] {
        let (d, c) = (sub(e[1], e[0]), sub(f[1], f[0]));
        let (dd, dc, cc) = (dot(d, d), dot(d, c), dot(c, c));
        let square = norm(cross(d, c)).powi(2);
        // Factors of w·d + r·δd and of w·c + r·δc.
        let [by_first, by_second] = if edge == 0 { [-cc, dc] } else { [-dc, dd] }.map(|x| x / square);
        let apart = self.normal.map(|x| self.gap * x);
        let moved = add_scaled(d.map(|x| by_first * x), by_second, c);
        let turned = [-by_first, by_first, -by_second, by_second];
        let weights = self.weights();
        [0, 1, 2, 3].map(|k| add_scaled(moved.map(|x| weights[k] * x), turned[k], apart))
    }
}

/// Two edges whose ends move in straight lines, from τ = 0 to τ = 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ways {
    from: [Ends; 2],
    by: [Ends; 2],
}

impl Ways {
    /// From these positions of the ends and their displacements.
    pub(super) fn new(from: [Ends; 2], by: [Ends; 2]) -> Self {
        Self { from, by }
    }

    pub(super) fn at(&self, share: f64) -> [Ends; 2] {
        [0, 1].map(|k| [0, 1].map(|end| add_scaled(self.from[k][end], share, self.by[k][end])))
    }

    /// The times within (0, 1], ascending, at which the lines meet: roots of (x_e − x_f)·(t_e × t_f), a cubic in τ
    /// (Bridson, Fedkiw and Anderson, ACM Trans. Graph. 21, 2002).
    pub(super) fn meetings(&self) -> impl Iterator<Item = f64> + use<> {
        let cubic = self.cubic();
        let value = move |x: f64| cubic[0] + x * (cubic[1] + x * (cubic[2] + x * cubic[3]));
        // It is monotone between the roots of the derivative.
        let (a, b, c) = (3.0 * cubic[3], 2.0 * cubic[2], cubic[1]);
        let discriminant = b * b - 4.0 * a * c;
        let q = -0.5 * (b + discriminant.max(0.0).sqrt().copysign(b));
        let inside = |x: f64| if x > 0.0 && x < 1.0 { x } else { 0.0 };
        let turns = [if a == 0.0 { 0.0 } else { inside(q / a) }, if q == 0.0 { 0.0 } else { inside(c / q) }];
        let ends = [0.0, turns[0].min(turns[1]), turns[0].max(turns[1]), 1.0];
        (0..3).filter_map(move |k| {
            let (mut low, mut high) = (ends[k], ends[k + 1]);
            let begins = value(low);
            if low >= high || begins == 0.0 || (value(high) > 0.0) == (begins > 0.0) && value(high) != 0.0 {
                return None;
            }
            for _ in 0..52 {
                let middle = 0.5 * (low + high);
                match (value(middle) > 0.0) == (begins > 0.0) && value(middle) != 0.0 {
                    true => low = middle,
                    false => high = middle,
                }
            }
            Some(high)
        })
    }

    fn cubic(&self) -> [f64; 4] {
        let pair = |ends: [Ends; 2]| (sub(ends[0][1], ends[0][0]), sub(ends[1][1], ends[1][0]));
        let ((d, c), (dd, dc)) = (pair(self.from), pair(self.by));
        let (r, dr) = (sub(self.from[0][0], self.from[1][0]), sub(self.by[0][0], self.by[1][0]));
        let products = [cross(d, c), add_scaled(cross(dd, c), 1.0, cross(d, dc)), cross(dd, dc)];
        let [zeroth, first, second] = products;
        [dot(r, zeroth), dot(dr, zeroth) + dot(r, first), dot(dr, first) + dot(r, second), dot(dr, second)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_meet_where_the_cubic_vanishes() {
        // Both turn while one falls on the other.
        let from = [[[-1.0, 0.1, 0.4], [1.0, -0.2, 0.5]], [[0.1, -1.0, 0.0], [-0.2, 1.0, 0.1]]];
        let by = [[[0.1, 0.3, -1.0], [0.2, 0.1, -0.7]], [[0.3, 0.0, 0.1], [0.0, 0.0, 0.2]]];
        let ways = Ways::new(from, by);
        let times: Vec<f64> = ways.meetings().collect();
        assert_eq!(times.len(), 1);
        let gap = Crossing::of(ways.at(times[0])).unwrap().gap;
        assert!(gap.abs() < 1e-14, "{gap:e}");
        // A way and back again in one line: two meetings of (τ − ¼)(τ − ¾), made by an edge that turns over.
        let still = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        let falling = [[-1.0, 0.0, 0.25], [1.0, 0.0, 0.25]];
        let ways = Ways::new([falling, still], [[[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]], [[0.0; 3]; 2]]);
        let times: Vec<f64> = ways.meetings().collect();
        assert!(times.len() == 1 && (times[0] - 0.25).abs() < 1e-15);
    }

    #[test]
    fn derivatives_of_shares_are_those_of_differences() {
        let ends = [[[-0.7, 0.1, 0.3], [0.9, -0.2, 0.4]], [[0.1, -1.2, 0.0], [-0.2, 0.8, 0.1]]];
        let crossing = Crossing::of(ends).unwrap();
        for edge in [0, 1] {
            // (The same seen from either side.)
            for seen in [crossing, crossing.turned()] {
                for (k, gradient) in seen.share_gradient(edge, ends).into_iter().enumerate() {
                    for (axis, entry) in gradient.into_iter().enumerate() {
                        let share = |by: f64| {
                            let mut moved = ends;
                            moved[k / 2][k % 2][axis] += by;
                            Crossing::of(moved).unwrap().shares[edge]
                        };
                        let difference = (share(1e-5) - share(-1e-5)) / 2e-5;
                        assert!((entry - difference).abs() < 1e-8, "{entry} {difference}");
                    }
                }
            }
        }
    }
}
