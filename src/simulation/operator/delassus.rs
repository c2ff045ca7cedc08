//! The Delassus operator of the active rows. When rows join or leave, the couplings of the others are moved and not
//! formed again: they stay the same to the bit.

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
    /// Indices of the rows that have joined.
    pub(crate) joined: Vec<usize>,
    /// The rows that have stayed.
    runs: Vec<Run>,
}

/// Rows that are consecutive before and now: their first index before, among the rows that stay, and now.
#[derive(Clone, Copy, Debug)]
struct Run {
    before: usize,
    among: usize,
    now: usize,
    count: usize,
}

const WHAT: &str = "the Delassus operator";

impl<T: Real> Delassus<T> {
    /// Memory for W of some rows, all of which have joined.
    pub(crate) fn begin(&mut self, rows: &[usize]) -> Result<()> {
        self.values.clear();
        memory::grow(&mut self.values, rows.len(), rows.len(), WHAT)?;
        self.joined.clear();
        self.joined.extend(0..rows.len());
        Ok(())
    }

    /// Memory for W of some rows, with the entries of rows that stay moved to their new places, without compliances.
    /// Rows and columns of joined rows are to be filled.
    pub(crate) fn rearrange(&mut self, rows: &[usize]) -> Result<()> {
        if !self.compare(rows) {
            return self.begin(rows);
        }
        let (was, now) = (self.rows.len(), rows.len());
        let stay = now - self.joined.len();
        let Self { values, diagonal, runs, .. } = self;
        for (k, &own) in diagonal.iter().enumerate() {
            values[k * was + k] = own;
        }
        if stay < was {
            // Ascending moves towards the front overwrite no entry that is still to be moved.
            for to in &*runs {
                for row in 0..to.count {
                    for run in &*runs {
                        let from = (to.before + row) * was + run.before;
                        values.copy_within(from..from + run.count, (to.among + row) * stay + run.among);
                    }
                }
            }
        }
        values.truncate(stay * stay);
        memory::grow(values, now, now, WHAT)?;
        if stay < now {
            // Descending moves towards the back, likewise.
            for to in runs.iter().rev() {
                for row in (0..to.count).rev() {
                    for run in runs.iter().rev() {
                        let from = (to.among + row) * stay + run.among;
                        values.copy_within(from..from + run.count, (to.now + row) * now + run.now);
                    }
                }
            }
        }
        Ok(())
    }

    /// Completes W after the entries of joined rows are filled: couplings below the rounding of every sum become
    /// zero.
    ///
    /// The response to a force in one step decays by orders of magnitude from node to node, down to numbers without
    /// digits, which underflow in one unit and not in another. The pattern of W must not depend on that.
    pub(crate) fn end(&mut self, rows: &[usize]) {
        let Self { rows: assembled, values, diagonal, roots, joined, .. } = self;
        let size = rows.len();
        diagonal.clear();
        diagonal.extend((0..size).map(|k| values[k * size + k]));
        roots.clear();
        roots.extend(diagonal.iter().map(|own| own.max(T::zero()).sqrt()));
        let share = T::epsilon() * T::epsilon();
        let forget = |entry: &mut T, [one, other]: [T; 2]| {
            if entry.abs() <= share * one * other {
                *entry = T::zero();
            }
        };
        for &k in &*joined {
            let row = &mut values[k * size..(k + 1) * size];
            row.iter_mut().zip(&*roots).for_each(|(entry, &root)| forget(entry, [root, roots[k]]));
        }
        // If all rows have joined, the loop above has covered all entries.
        for &k in joined.iter().filter(|_| joined.len() < size) {
            let column = values[k..].iter_mut().step_by(size);
            column.zip(&*roots).for_each(|(entry, &root)| forget(entry, [root, roots[k]]));
        }
        assembled.clear();
        assembled.extend_from_slice(rows);
    }

    /// Finds which rows stay, in their old order, and which have joined. Returns whether any stay.
    fn compare(&mut self, rows: &[usize]) -> bool {
        let Self { rows: before, runs, joined, .. } = self;
        runs.clear();
        joined.clear();
        let (mut among, mut next) = (0, 0);
        for (now, &row) in rows.iter().enumerate() {
            let Some(ahead) = before[next..].iter().position(|other| *other == row) else {
                joined.push(now);
                continue;
            };
            let place = next + ahead;
            match runs.last_mut() {
                Some(run) if run.before + run.count == place && run.now + run.count == now => run.count += 1,
                _ => runs.push(Run { before: place, among, now, count: 1 }),
            }
            (among, next) = (among + 1, place + 1);
        }
        among > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An entry that identifies its row and column.
    fn entry(row: usize, column: usize) -> f64 {
        (1000 * row + column) as f64
    }

    /// Fills the joined rows, and adds compliances to the diagonal, as an operator does.
    fn fill(w: &mut Delassus<f64>, rows: &[usize]) {
        let n = rows.len();
        for &k in &w.joined {
            for i in 0..n {
                w.values[i * n + k] = entry(rows[i], rows[k]);
                w.values[k * n + i] = entry(rows[k], rows[i]);
            }
        }
        w.diagonal = (0..n).map(|k| w.values[k * n + k]).collect();
        w.rows = rows.to_vec();
        for k in 0..n {
            w.values[k * n + k] += 0.25;
        }
    }

    #[test]
    fn rows_come_and_go() {
        let mut w = Delassus::default();
        let all: Vec<usize> = (0..40).collect();
        let sets = |mask: usize| all.iter().copied().filter(move |row| (row * row + mask * 7) % (2 + mask % 5) != 1);
        let mut list: Vec<Vec<usize>> = (0..30).map(|mask| sets(mask * mask).collect()).collect();
        // None, one, all; normal rows with their tangents; another order, which moves cannot produce.
        list.extend([
            vec![],
            vec![3],
            all.clone(),
            vec![0, 20, 21, 1, 22],
            vec![1, 22],
            vec![1, 22, 0, 20],
            vec![39],
            all.clone(),
        ]);
        for rows in &list {
            w.rearrange(rows).unwrap();
            fill(&mut w, rows);
            let n = rows.len();
            assert_eq!(w.values.len(), n * n);
            for (e, value) in w.values.iter().enumerate() {
                let (i, j) = (e / n, e % n);
                let compliance = if i == j { 0.25 } else { 0.0 };
                assert_eq!(value.to_bits(), (entry(rows[i], rows[j]) + compliance).to_bits(), "{rows:?} {i} {j}");
            }
        }
        // If all rows stay, none are to be filled.
        w.rearrange(&all[1..]).unwrap();
        assert!(w.joined.is_empty());
    }

    /// Couplings that decay from row to row are zero below the rounding of the diagonal, in any unit and for any
    /// order in which the rows have joined.
    #[test]
    fn what_no_sum_can_see_is_zero() {
        let n = 30;
        for unit in [1.0, 1e-200, 2.0_f64.powi(60)] {
            let own = |i: usize| unit * 4.0_f64.powf(i as f64 - 15.0);
            let coupling = |i: usize, j: usize| own(i).sqrt() * own(j).sqrt() * 0.01_f64.powf(i.abs_diff(j) as f64);
            let fill = |w: &mut Delassus<f64>, rows: &[usize]| {
                for &k in &w.joined {
                    for (i, &row) in rows.iter().enumerate() {
                        w.values[i * rows.len() + k] = coupling(row, rows[k]);
                        w.values[k * rows.len() + i] = coupling(rows[k], row);
                    }
                }
                w.end(rows);
            };
            let all: Vec<usize> = (0..n).collect();
            let few: Vec<usize> = (0..n).filter(|i| i % 3 > 0).collect();
            let mut w = Delassus::default();
            for rows in [&all, &few, &all] {
                w.rearrange(rows).unwrap();
                fill(&mut w, rows);
            }
            for (e, value) in w.values.iter().enumerate() {
                let (i, j) = (e / n, e % n);
                let expected = if i.abs_diff(j) < 16 { coupling(i, j) } else { 0.0 };
                assert_eq!(value.to_bits(), expected.to_bits(), "{unit:e}, {i} {j}");
            }
        }
    }
}
