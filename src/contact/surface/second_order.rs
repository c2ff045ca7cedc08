//! Facets of second order: their shape functions on the linear parts into which they are cut.

/// Most nodes of a facet of second order.
const MOST: usize = 9;

/// Numbers by node of a facet: its own nodes, then the other nodes of its facet of second order.
pub(crate) type ByNode = [f64; MOST];

/// The kinds of facets of second order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Segment,
    Triangle,
    /// A quadrilateral of eight nodes.
    Serendipity,
    /// A quadrilateral of nine nodes.
    Biquadratic,
}

/// Places of the nodes for each linear part: first the nodes of the part, then the others, ascending.
const SEGMENT: &[&[usize]] = &[&[0, 2, 1], &[2, 1, 0]];
const TRIANGLE: &[&[usize]] = &[&[0, 3, 5, 1, 2, 4], &[1, 4, 3, 0, 2, 5], &[2, 5, 4, 0, 1, 3], &[3, 4, 5, 0, 1, 2]];
const SERENDIPITY: &[&[usize]] = &[
    &[0, 4, 7, 1, 2, 3, 5, 6],
    &[1, 5, 4, 0, 2, 3, 6, 7],
    &[2, 6, 5, 0, 1, 3, 4, 7],
    &[3, 7, 6, 0, 1, 2, 4, 5],
    &[4, 5, 6, 7, 0, 1, 2, 3],
];
const BIQUADRATIC: &[&[usize]] = &[
    &[0, 4, 8, 7, 1, 2, 3, 5, 6],
    &[1, 5, 8, 4, 0, 2, 3, 6, 7],
    &[2, 6, 8, 5, 0, 1, 3, 4, 7],
    &[3, 7, 8, 6, 0, 1, 2, 4, 5],
];

/// Natural coordinates of the nodes: from −1 to 1 for segments and quadrilaterals, from 0 to 1 along two sides of
/// triangles.
const ON_SEGMENT: &[[f64; 2]] = &[[-1.0, 0.0], [1.0, 0.0], [0.0, 0.0]];
const ON_TRIANGLE: &[[f64; 2]] = &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
const ON_QUADRILATERAL: &[[f64; 2]] =
    &[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]];

/// The facet of second order that a linear facet is a part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Whole {
    kind: Kind,
    /// Index of the part, and its number of nodes.
    part: usize,
    own: usize,
    /// The other nodes; the last one fills the rest of the array.
    others: [usize; 5],
}

impl Kind {
    fn orders(self) -> &'static [&'static [usize]] {
        match self {
            Self::Segment => SEGMENT,
            Self::Triangle => TRIANGLE,
            Self::Serendipity => SERENDIPITY,
            Self::Biquadratic => BIQUADRATIC,
        }
    }

    fn coordinates(self) -> &'static [[f64; 2]] {
        match self {
            Self::Segment => ON_SEGMENT,
            Self::Triangle => ON_TRIANGLE,
            Self::Serendipity | Self::Biquadratic => ON_QUADRILATERAL,
        }
    }

    /// The shape function of the node at a place, and its derivatives with respect to the natural coordinates.
    fn shape(self, place: usize, at: [f64; 2]) -> (f64, [f64; 2]) {
        let node = self.coordinates()[place];
        match self {
            Self::Segment => {
                let (value, slope) = lagrange(node[0], at[0]);
                (value, [slope, 0.0])
            }
            Self::Triangle => on_triangle(place, at),
            Self::Serendipity => serendipity(node, at),
            Self::Biquadratic => {
                let [(x, dx), (y, dy)] = [0, 1].map(|axis| lagrange(node[axis], at[axis]));
                (x * y, [dx * y, x * dy])
            }
        }
    }
}

/// Lagrange's polynomial of the node −1, 0 or 1, and its derivative.
fn lagrange(node: f64, x: f64) -> (f64, f64) {
    match node.abs() < 0.5 {
        true => (1.0 - x * x, -2.0 * x),
        false => (0.5 * x * (x + node), x + 0.5 * node),
    }
}

fn on_triangle(place: usize, [s, t]: [f64; 2]) -> (f64, [f64; 2]) {
    const SLOPES: [[f64; 2]; 3] = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
    let corners = [1.0 - s - t, s, t];
    if place < 3 {
        let l = corners[place];
        return (l * (2.0 * l - 1.0), SLOPES[place].map(|slope| (4.0 * l - 1.0) * slope));
    }
    let (i, j) = (place - 3, (place - 2) % 3);
    let slope = |axis: usize| 4.0 * (corners[i] * SLOPES[j][axis] + corners[j] * SLOPES[i][axis]);
    (4.0 * corners[i] * corners[j], [slope(0), slope(1)])
}

fn serendipity([a, b]: [f64; 2], [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
    if a.abs() < 0.5 {
        return (0.5 * (1.0 - x * x) * (1.0 + b * y), [-x * (1.0 + b * y), 0.5 * b * (1.0 - x * x)]);
    }
    if b.abs() < 0.5 {
        return (0.5 * (1.0 - y * y) * (1.0 + a * x), [0.5 * a * (1.0 - y * y), -y * (1.0 + a * x)]);
    }
    let (p, q) = (1.0 + a * x, 1.0 + b * y);
    let sum = a * x + b * y;
    (0.25 * p * q * (sum - 1.0), [0.25 * a * q * (sum - 1.0 + p), 0.25 * b * p * (sum - 1.0 + q)])
}

impl Whole {
    /// A part of a facet of second order: its nodes, their number, and the link to the whole facet.
    pub(super) fn part(kind: Kind, part: usize, nodes: &[usize]) -> ([usize; 4], usize, Self) {
        let order = kind.orders()[part];
        let own = match (kind, part) {
            (Kind::Segment, _) => 2,
            (Kind::Triangle, _) | (Kind::Serendipity, 0..4) => 3,
            _ => 4,
        };
        let (of_part, others) = order.split_at(own);
        let fill = |places: &[usize], k: usize| nodes[places[k.min(places.len() - 1)]];
        let whole = Self { kind, part, own, others: std::array::from_fn(|k| fill(others, k)) };
        (std::array::from_fn(|k| fill(of_part, k)), own, whole)
    }

    /// The nodes of the whole facet that are not nodes of the part.
    pub(super) fn others(&self) -> &[usize] {
        &self.others[..self.order().len() - self.own]
    }

    fn order(&self) -> &'static [usize] {
        self.kind.orders()[self.part]
    }

    /// The shares of the force on a node of the part that move to the other nodes if linear parts bear the pressure.
    ///
    /// With these shares the shape functions of nodes in the middle give to their neighbors until each integral
    /// equals that of the linear shape function: a constant pressure makes forces in proportion to the areas.
    pub(super) fn given(&self, corner: usize) -> ByNode {
        let order = self.order();
        let at = order[corner];
        let (corners, share) = match self.kind {
            Kind::Segment => (2, 1.0 / 8.0),
            Kind::Triangle => (3, 1.0 / 8.0),
            Kind::Serendipity => (4, 3.0 / 16.0),
            Kind::Biquadratic => (4, 1.0 / 8.0),
        };
        let mut given = [0.0; MOST];
        for (given, &to) in given.iter_mut().zip(order) {
            *given = match at {
                8 => [1.0 / 64.0, 3.0 / 32.0, 0.0][to / 4],
                _ if at >= corners && (to == at - corners || to == (at - corners + 1) % corners) => share,
                _ => 0.0,
            };
        }
        given
    }

    /// Natural coordinates of the point of the part with these shape functions.
    fn place(&self, weights: &[f64; 4]) -> [f64; 2] {
        let corners = &self.order()[..self.own];
        corners.iter().zip(weights).fold([0.0; 2], |sum, (&corner, weight)| {
            let at = self.kind.coordinates()[corner];
            [sum[0] + weight * at[0], sum[1] + weight * at[1]]
        })
    }

    /// Its shape functions where the shape functions of the part are `weights`.
    pub(crate) fn shapes(&self, weights: &[f64; 4]) -> ByNode {
        let at = self.place(weights);
        let mut shapes = [0.0; MOST];
        for (shape, &place) in shapes.iter_mut().zip(self.order()) {
            *shape = self.kind.shape(place, at).0;
        }
        shapes
    }

    /// Its shape functions less the ones of the part. They are zero at all nodes, and their sum is zero.
    pub(crate) fn excess(&self, weights: &[f64; 4]) -> ByNode {
        let mut excess = self.shapes(weights);
        excess.iter_mut().zip(&weights[..self.own]).for_each(|(shape, weight)| *shape -= weight);
        excess
    }

    /// The derivatives of [`excess`](Self::excess) by the coordinates of the part, given the derivatives `by` of the
    /// part's own shape functions.
    pub(crate) fn excess_slopes(&self, weights: &[f64; 4], by: &[[f64; 4]; 2]) -> [ByNode; 2] {
        let at = self.place(weights);
        let mut slopes = [[0.0; MOST]; 2];
        for (slopes, by) in slopes.iter_mut().zip(by) {
            let [first, second] = self.place(by);
            for (slope, &place) in slopes.iter_mut().zip(self.order()) {
                let (_, [along, across]) = self.kind.shape(place, at);
                *slope = first * along + second * across;
            }
            slopes.iter_mut().zip(&by[..self.own]).for_each(|(slope, by)| *slope -= by);
        }
        slopes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [(Kind, usize); 4] =
        [(Kind::Segment, 3), (Kind::Triangle, 6), (Kind::Serendipity, 8), (Kind::Biquadratic, 9)];

    #[test]
    fn shape_functions_are_one_at_their_nodes_and_slopes_are_their_derivatives() {
        for (kind, count) in KINDS {
            let at = [0.23, 0.31];
            let (mut sum, mut place) = (0.0, [0.0; 2]);
            for node in 0..count {
                for other in 0..count {
                    let expected = f64::from(u8::from(node == other));
                    assert!((kind.shape(node, kind.coordinates()[other]).0 - expected).abs() < 1e-15);
                }
                let (value, slopes) = kind.shape(node, at);
                sum += value;
                for axis in 0..2 {
                    place[axis] += value * kind.coordinates()[node][axis];
                    let moved = |by: f64| std::array::from_fn(|k| if k == axis { at[k] + by } else { at[k] });
                    let difference = (kind.shape(node, moved(1e-5)).0 - kind.shape(node, moved(-1e-5)).0) / 2e-5;
                    assert!((difference - slopes[axis]).abs() < 1e-9, "{kind:?} {node} {axis}");
                }
            }
            // Constants and linear functions are reproduced.
            let dimension = if kind == Kind::Segment { 1 } else { 2 };
            assert!((sum - 1.0).abs() < 1e-15);
            assert!((0..dimension).all(|axis| (place[axis] - at[axis]).abs() < 1e-15));
        }
    }

    #[test]
    fn parts_have_all_nodes_and_cover_the_whole() {
        for (kind, count) in KINDS {
            let nodes: Vec<usize> = (10..10 + count).collect();
            let mut covered = 0.0;
            for part in 0..kind.orders().len() {
                let (own, corners, whole) = Whole::part(kind, part, &nodes);
                let mut all: Vec<usize> = own[..corners].iter().chain(whole.others()).copied().collect();
                all.sort_unstable();
                assert_eq!(all, nodes);
                // At its corners the part has the shape functions of the whole facet.
                for corner in 0..corners {
                    let mut weights = [0.0; 4];
                    weights[corner] = 1.0;
                    assert!(whole.excess(&weights).iter().all(|excess| excess.abs() < 1e-15));
                }
                let at = |k: usize| kind.coordinates()[own[k] - 10];
                covered += match corners {
                    2 => at(1)[0] - at(0)[0],
                    _ => (2..corners).fold(0.0, |area, k| {
                        let [a, b] = [at(k - 1), at(k)].map(|x| [x[0] - at(0)[0], x[1] - at(0)[1]]);
                        area + 0.5 * (a[0] * b[1] - a[1] * b[0])
                    }),
                };
            }
            let whole = [2.0, 0.5, 4.0, 4.0][KINDS.iter().position(|&(other, _)| other == kind).unwrap()];
            assert!((covered - whole).abs() < 1e-15, "{kind:?}: {covered}");
        }
    }
}
