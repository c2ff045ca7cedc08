//! The Delassus operator of the active rows.

use crate::error::Result;
use crate::memory;
use crate::real::Real;

/// W of some rows, kept until they or their responses change. It grows with them.
#[derive(Debug, Default)]
pub(crate) struct Delassus<T> {
    pub(crate) rows: Vec<usize>,
    /// Row by row, with the compliances of the laws on the diagonal.
    pub(crate) values: Vec<T>,
    /// The diagonal without compliances.
    pub(crate) diagonal: Vec<T>,
    /// The square roots of this diagonal.
    roots: Vec<T>,
    /// Its version, 0 if the values belong to no rows.
    pub(crate) version: u64,
}

const WHAT: &str = "the Delassus operator";

impl<T: Real> Delassus<T> {
    /// Memory for W of some rows.
    pub(crate) fn begin(&mut self, rows: &[usize]) -> Result<()> {
        self.values.clear();
        memory::grow(&mut self.values, rows.len(), rows.len(), WHAT)
    }

    /// Completes W after its entries are filled: couplings below the rounding of every sum become zero.
    ///
    /// The response to a force in one step decays by orders of magnitude from node to node, down to numbers without
    /// digits, which underflow in one unit and not in another. The pattern of W must not depend on that.
    pub(crate) fn end(&mut self, rows: &[usize]) {
        let Self { rows: assembled, values, diagonal, roots, .. } = self;
        let size = rows.len();
        diagonal.clear();
        diagonal.extend((0..size).map(|k| values[k * size + k]));
        roots.clear();
        roots.extend(diagonal.iter().map(|own| own.max(T::zero()).sqrt()));
        let share = T::epsilon() * T::epsilon();
        for (row, &one) in values.chunks_exact_mut(size.max(1)).zip(&*roots) {
            for (entry, &other) in row.iter_mut().zip(&*roots) {
                if entry.abs() <= share * other * one {
                    *entry = T::zero();
                }
            }
        }
        assembled.clear();
        assembled.extend_from_slice(rows);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Couplings that decay from row to row are zero below the rounding of the diagonal, in any unit.
    #[test]
    fn what_no_sum_can_see_is_zero() {
        let n = 30;
        for unit in [1.0, 1e-200, 2.0_f64.powi(60)] {
            let own = |i: usize| unit * 4.0_f64.powf(i as f64 - 15.0);
            let coupling = |i: usize, j: usize| own(i).sqrt() * own(j).sqrt() * 0.01_f64.powf(i.abs_diff(j) as f64);
            let rows: Vec<usize> = (0..n).collect();
            let mut w = Delassus::default();
            w.begin(&rows).unwrap();
            for (e, value) in w.values.iter_mut().enumerate() {
                *value = coupling(e / n, e % n);
            }
            w.end(&rows);
            for (e, value) in w.values.iter().enumerate() {
                let (i, j) = (e / n, e % n);
                let expected = if i.abs_diff(j) < 16 { coupling(i, j) } else { 0.0 };
                assert_eq!(value.to_bits(), expected.to_bits(), "{unit:e}, {i} {j}");
            }
        }
    }
}
