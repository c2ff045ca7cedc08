//! Contributions of the quadrature points of a pair of facets to the rows of the slave facet's corners. They are
//! collected for all points of the pair and then summed at once.

use crate::contact::surface::{Base, Point, RimSample, add_scaled, dot, middle, norm};
use crate::real::Kernels;

/// Contribution of a node to a row, as in [`Entry`](super::integrals::Entry): moment, area, share, and zero.
pub(super) type Column = [f64; 8];

/// A column by its parts.
#[inline]
pub(super) fn column(moment: Point, area: Point, share: f64) -> Column {
    [moment[0], moment[1], moment[2], area[0], area[1], area[2], share, 0.0]
}

#[inline]
pub(super) fn add(sum: &mut Column, column: &Column) {
    sum.iter_mut().zip(column).for_each(|(sum, x)| *sum += x);
}

/// Contributions of a point to a row whose shape function is one there: for the corners of the slave facet, for the
/// corners of the master facet, and last the factor of the derivative of n (its share has no meaning).
pub(super) type Addends = [Column; 9];

/// Positions among addends: first corner of the slave facet, first corner of the master facet, and n.
pub(super) const OWN: usize = 0;
pub(super) const OTHERS: usize = 4;
pub(super) const NORMAL: usize = 8;

#[derive(Debug, Default)]
pub(super) struct Points {
    /// The shape functions of the slave facet's corners, and the addends that they multiply.
    shares: Vec<[f64; 4]>,
    /// Never shrinks; entries behind the last point have no meaning.
    addends: Vec<Addends>,
}

impl Points {
    /// Appends a point; the caller must write all of its addends.
    pub(super) fn push(&mut self, shares: [f64; 4]) -> &mut Addends {
        let place = self.shares.len();
        self.shares.push(shares);
        if place == self.addends.len() {
            self.addends.push([[0.0; 8]; 9]);
        }
        &mut self.addends[place]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.shares.is_empty()
    }

    /// Appends the effect of the master's rim that moves over the slave facet. Gaps are the distance less `offset`.
    pub(super) fn push_rim(&mut self, sample: &RimSample, offset: f64) {
        let RimSample { length, slave, master, gap: distance, outward } = *sample;
        let [moment, area] = [length * (distance - offset), length].map(|x| outward.map(|along| x * along));
        let column = column(moment, area, 0.0);
        let times = |share: f64| column.map(|x| share * x);
        let addends = self.push(slave);
        for k in 0..4 {
            addends[OWN + k] = times(-slave[k]);
            addends[OTHERS + k] = times(master[k]);
        }
        addends[NORMAL] = times(-distance);
    }

    /// Adds all points to the sums of the slave facet's corners, and removes them.
    pub(super) fn add_to(&mut self, sums: &mut [Addends; 4]) {
        for (a, sums) in sums.iter_mut().enumerate() {
            let (sums, addends) = (sums.as_flattened_mut(), |k: usize| self.addends[k].as_flattened());
            let whole = self.shares.len() - self.shares.len() % 4;
            // Four points at a time save memory traffic.
            for k in (0..whole).step_by(4) {
                let shares = std::array::from_fn::<f64, 4, _>(|i| self.shares[k + i][a]);
                f64::add_all(shares, std::array::from_fn(|i| addends(k + i)), sums);
            }
            (whole..self.shares.len()).for_each(|k| f64::add_all([self.shares[k][a]], [addends(k)], sums));
        }
        self.shares.clear();
    }
}

/// Removes the contribution of a corner of the master facet from the sums; returns it by corner of the slave facet.
pub(super) fn take_other(sums: &mut [Addends; 4], corner: usize) -> [Column; 4] {
    sums.each_mut().map(|sums| std::mem::take(&mut sums[OTHERS + corner]))
}

/// Contributions of a slave facet's corners to the rows of each of its corners, including the rotation of its normal.
pub(super) fn own(sums: &mut [Addends; 4], base: &Base) -> [[Column; 4]; 4] {
    let (count, length) = (base.count(), norm(base.product));
    // δn = (I − n nᵀ) δ(t₁ × t₂) / |t₁ × t₂|.
    let across = |x: Point| add_scaled(x, -dot(x, base.normal), base.normal).map(|x| x / length);
    for sums in &mut sums[..count] {
        let [x, y, z, p, q, r, ..] = sums[NORMAL];
        let [of_moment, of_area] = [[x, y, z], [p, q, r]].map(|turn| base.turned(&middle(count), across(turn)));
        for (k, (moment, area)) in of_moment.into_iter().zip(of_area).enumerate() {
            add(&mut sums[OWN + k], &column(moment, area, 0.0));
        }
    }
    std::array::from_fn(|k| std::array::from_fn(|a| sums[a][OWN + k]))
}
