//! The nonzero range of each row of W. In a row of bodies, the contacts of one joint move only the next joints,
//! so the zeros beyond need not be read.

use super::ContactProblem;
use crate::real::Real;
use std::ops::Range;

/// The range from the first to the last nonzero entry of each row of W.
#[derive(Clone, Debug, Default)]
pub(super) struct Extents {
    ranges: Vec<(usize, usize)>,
}

/// Ranges begin and end at multiples of this number, the number of partial sums of a [`dot`](crate::dense::dot), so
/// that products are bitwise equal to those over whole rows.
const LANES: usize = 4;

impl Extents {
    /// Memory for this many rows.
    pub(super) fn with_capacity(rows: usize) -> Self {
        Self { ranges: Vec::with_capacity(rows) }
    }

    /// Finds the ranges of all rows. NaN counts as nonzero.
    pub(super) fn find<T: Real>(&mut self, problem: &ContactProblem<'_, T>) {
        self.ranges.clear();
        self.ranges.extend((0..problem.size()).map(|i| {
            let row = problem.row(i);
            let begin = row.iter().position(|w| *w != T::zero()).unwrap_or(i).min(i);
            let last = row.iter().rposition(|w| *w != T::zero()).unwrap_or(i).max(i);
            let end = (last + 1).next_multiple_of(LANES);
            (begin - begin % LANES, if end > row.len() - row.len() % LANES { row.len() } else { end })
        }));
    }

    /// The nonzero range of row i; it always includes the diagonal.
    pub(super) fn of(&self, i: usize) -> Range<usize> {
        let (begin, end) = self.ranges[i];
        begin..end
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact_solver::AdmissibleSet;
    use crate::dense::dot;

    #[test]
    fn products_over_extents_are_those_of_whole_rows() {
        for size in [1, 3, 8, 29] {
            let entry = |e: usize| {
                let (i, j) = (e / size, e % size);
                if i.abs_diff(j) <= i % 7 && i % 5 != 4 { ((e * e) as f64).sin() } else { 0.0 }
            };
            let w: Vec<f64> = (0..size * size).map(entry).collect();
            let (x, sets) = ((0..size).map(|i| (i as f64).cos()).collect::<Vec<_>>(), vec![AdmissibleSet::Free; size]);
            let problem = ContactProblem::new(&w, &x, &sets, &x).unwrap();
            let mut extents = Extents::default();
            extents.find(&problem);
            for i in 0..size {
                let range = extents.of(i);
                assert!(range.contains(&i) && range.end <= size);
                assert!(problem.row(i)[..range.start].iter().chain(&problem.row(i)[range.end..]).all(|w| *w == 0.0));
                for end in [i + 1, size] {
                    let part = range.start..range.end.min(end);
                    let whole = dot(&problem.row(i)[..end], &x[..end]);
                    assert_eq!(dot(&problem.row(i)[part.clone()], &x[part]).to_bits(), whole.to_bits(), "{size} {i}");
                }
            }
        }
    }
}
