//! An order of the dofs of a matrix by their distance, counted in couplings, from given dofs.

use crate::error::{Error, Result};
use crate::real::Real;
use faer::sparse::SparseColMatRef;

/// Dofs in layers: the given ones in the first, the dofs coupled to them in the next, and so on; then all dofs
/// without any coupling to these. Dofs left out have no place.
#[derive(Debug)]
pub(super) struct Layers {
    /// The dof of each place, and the place of each dof.
    order: Vec<u32>,
    places: Vec<u32>,
    /// End of each layer.
    ends: Vec<usize>,
}

/// A dof without a place.
const NONE: u32 = u32::MAX;

impl Layers {
    /// Layers around the dofs `near`, or all dofs as one layer if the list is empty. Stored zeros couple no dofs.
    pub(super) fn around<T: Real>(
        near: &[usize],
        matrix: SparseColMatRef<'_, usize, T>,
        left_out: &[usize],
    ) -> Result<Self> {
        let dofs = matrix.ncols();
        let count = u32::try_from(dofs).map_err(|_| Error::OutOfMemory { what: "indices of 32 bits", bytes: None })?;
        let mut places = vec![NONE; dofs];
        // A temporary place, until the dofs left out lose it again.
        for &dof in left_out {
            places[dof] = count;
        }
        let mut order = Vec::with_capacity(dofs - left_out.len());
        let mut ends = Vec::new();
        // All dof numbers fit, as checked above.
        #[allow(clippy::cast_possible_truncation)]
        let mut take = |dof: usize, order: &mut Vec<u32>| {
            if places[dof] == NONE {
                places[dof] = order.len() as u32;
                order.push(dof as u32);
            }
        };
        for &dof in near {
            take(dof, &mut order);
        }
        let mut start = 0;
        while start < order.len() {
            let end = order.len();
            ends.push(end);
            for at in start..end {
                let dof = order[at] as usize;
                for (&row, &value) in matrix.row_idx_of_col_raw(dof).iter().zip(matrix.val_of_col(dof)) {
                    if value != T::zero() {
                        take(row, &mut order);
                    }
                }
            }
            start = end;
        }
        (0..dofs).for_each(|dof| take(dof, &mut order));
        if ends.is_empty() {
            ends.push(order.len());
        }
        for &dof in left_out {
            places[dof] = NONE;
        }
        Ok(Self { order, places, ends })
    }

    /// The dof of each place.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// The place of a dof; beyond all others if it has none.
    pub(super) fn place(&self, dof: usize) -> usize {
        self.places[dof] as usize
    }

    /// The number of dofs in the first layer.
    pub(super) fn first(&self) -> usize {
        self.ends[0]
    }

    /// Start and end of the layer `distance` beyond the layer of a place; the end of all dofs coupled to it if there
    /// are fewer layers.
    pub(super) fn beyond(&self, place: usize, distance: usize) -> [usize; 2] {
        let own = self.ends.partition_point(|&end| end <= place);
        let far = own + distance;
        match self.ends.get(far) {
            Some(&end) if far > 0 => [self.ends[far - 1], end],
            _ => [self.connected(place); 2],
        }
    }

    /// The end of all dofs that may be coupled to a place.
    pub(super) fn connected(&self, place: usize) -> usize {
        let reached = self.ends.last().copied().unwrap_or(0);
        if place < reached { reached } else { self.order.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::sparse::{SparseColMat, Triplet};

    #[test]
    fn layers_of_two_chains() {
        // 0 – 2 – 4 – 6 and 1 – 3 – 5 – 7, of which 7 is left out; 2 and 3 are coupled by a zero.
        let chains = (0..6).flat_map(|i| [(i, i + 2, 1.0), (i + 2, i, 1.0)]);
        let entries = chains.chain((0..8).map(|i| (i, i, 4.0))).chain([(2, 3, 0.0), (3, 2, 0.0)]);
        let entries: Vec<_> = entries.map(|(i, j, x)| Triplet::new(i, j, x)).collect();
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(8, 8, &entries).unwrap();
        let layers = Layers::around(&[2, 7], matrix.as_ref(), &[7]).unwrap();
        assert_eq!(layers.order(), [2, 0, 4, 6, 1, 3, 5]);
        assert_eq!((layers.first(), layers.place(6), layers.place(7) > 7), (1, 3, true));
        assert_eq!([layers.beyond(0, 1), layers.beyond(0, 2), layers.beyond(0, 3)], [[1, 3], [3, 4], [4, 4]]);
        // The other chain has no layers.
        assert_eq!([layers.beyond(5, 1), layers.beyond(3, 9)], [[7, 7], [4, 4]]);
        let whole = Layers::around(&[], matrix.as_ref(), &[7]).unwrap();
        assert_eq!((whole.order(), whole.first(), whole.connected(0)), (&[0, 1, 2, 3, 4, 5, 6][..], 7, 7));
    }
}
