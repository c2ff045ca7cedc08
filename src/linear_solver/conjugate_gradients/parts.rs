//! The order of the rows of a large matrix in which several threads sweep over it: consecutive parts that do not couple
//! with each other, then the rows of later parts that couple with earlier ones.

use crate::error::Result;
use crate::kernels::conjugate_gradients::MOST_PARTS;
use crate::memory;

/// Scalars at and below the diagonal that deserve a thread: a tenth of a millisecond.
const GRAIN: usize = 1 << 17;

/// The largest share of rows that no two threads sweep over at the same time.
const MOST_BEHIND: f64 = 1.0 / 16.0;

/// An order of the rows of a matrix in blocks. It depends on the pattern only, not on the number of threads.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// The ends of the parts; none if the matrix is small, or if its numbering couples all parts.
    pub(super) ends: Vec<usize>,
    /// The place of each row in the order; empty if rows keep their places.
    places: Vec<u32>,
}

impl Parts {
    /// For blocks of `size`² below the diagonal, given row by row.
    pub(super) fn find(pointers: &[usize], columns: &[u32], size: usize) -> Result<Self> {
        let (rows, blocks) = (pointers.len() - 1, columns.len());
        let most = (blocks * size * size / GRAIN).min(MOST_PARTS);
        // As many blocks in each part.
        let part = |part: usize, count: usize| {
            let start = |part: usize| pointers.partition_point(|&before| before < blocks * part / count);
            start(part)..if part + 1 < count { start(part + 1) } else { rows }
        };
        // Whether a row couples with rows before its part. Columns ascend.
        let couples = |row: usize, start: usize| {
            columns[pointers[row]..pointers[row + 1]].first().is_some_and(|&column| (column as usize) < start)
        };
        let behind = |count: usize| -> usize {
            let of = |own: std::ops::Range<usize>| own.clone().filter(|&row| couples(row, own.start)).count();
            (0..count).map(|number| of(part(number, count))).sum()
        };
        let counts = std::iter::successors(Some(MOST_PARTS), |count| Some(count / 2)).take_while(|&count| count > 1);
        let mut counts = counts.filter(|&count| count <= most);
        let Some(count) = counts.find(|&count| behind(count) as f64 <= MOST_BEHIND * rows as f64) else {
            return Ok(Self::default());
        };
        let mut ends = Vec::with_capacity(count);
        let mut places: Vec<u32> = memory::zeros(rows, 1, "the order of rows")?;
        let mut place = 0;
        for is_behind in [false, true] {
            for own in (0..count).map(|number| part(number, count)) {
                for row in own.clone().filter(|&row| couples(row, own.start) == is_behind) {
                    places[row] = place;
                    place += 1;
                }
                if !is_behind {
                    ends.push(place as usize);
                }
            }
        }
        Ok(Self { ends, places })
    }

    /// The place of a row.
    #[inline]
    pub(super) fn place(&self, row: usize) -> usize {
        self.places.get(row).map_or(row, |&place| place as usize)
    }

    /// The dof at a place, where rows have `size` dofs each.
    pub(super) fn dof(&self, place: usize, size: usize) -> usize {
        let row = self.places.iter().position(|&other| other as usize == place / size);
        row.unwrap_or(place / size) * size + place % size
    }

    /// Brings blocks below the diagonal into this order.
    pub(super) fn sort(&self, pointers: &mut [usize], columns: &mut [u32]) -> Result<()> {
        if self.places.is_empty() {
            return Ok(());
        }
        let rows = self.places.len();
        // First by column, then by row: so the columns of each row ascend.
        let pairs = || {
            (0..rows).flat_map(|row| columns[pointers[row]..pointers[row + 1]].iter().map(move |&column| (row, column)))
        };
        let ordered = |(row, column): (usize, u32)| {
            let [one, other] = [self.places[row], self.places[column as usize]];
            (one.max(other), one.min(other))
        };
        let by_column = sorted(rows, || pairs().map(ordered).map(|(row, column)| (column, row)), columns.len())?;
        let of_column = (0..).zip(by_column.0.windows(2)).flat_map(|(column, ends): (u32, &[usize])| {
            by_column.1[ends[0]..ends[1]].iter().map(move |&row| (row, column))
        });
        let (starts, found) = sorted(rows, || of_column.clone(), columns.len())?;
        pointers.copy_from_slice(&starts);
        columns.copy_from_slice(&found);
        Ok(())
    }
}

/// Pairs (list, entry) as lists, in the order given; and where each list begins.
fn sorted<I: Iterator<Item = (u32, u32)>>(
    lists: usize,
    pairs: impl Fn() -> I,
    count: usize,
) -> Result<(Vec<usize>, Vec<u32>)> {
    const WHAT: &str = "the blocks of an iterative solver";
    let mut starts: Vec<usize> = memory::zeros(lists + 2, 1, WHAT)?;
    let mut entries: Vec<u32> = memory::zeros(count, 1, WHAT)?;
    pairs().for_each(|(list, _)| starts[list as usize + 2] += 1);
    for list in 1..starts.len() {
        starts[list] += starts[list - 1];
    }
    for (list, entry) in pairs() {
        let at = &mut starts[list as usize + 1];
        entries[*at] = entry;
        *at += 1;
    }
    starts.pop();
    Ok((starts, entries))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of which each couples with the one before and with the one `width` before.
    fn strip(rows: usize, width: u32) -> (Vec<usize>, Vec<u32>) {
        let (mut pointers, mut columns) = (vec![0], Vec::new());
        for row in (0..).take(rows) {
            columns.extend([width, 1].iter().filter(|&&back| back <= row).map(|back| row - back));
            pointers.push(columns.len());
        }
        (pointers, columns)
    }

    #[test]
    fn parts_of_a_strip_couple_only_with_the_rows_behind_them() {
        const ROWS: usize = 60_000;
        let (mut pointers, mut columns) = strip(ROWS, 50);
        let given = (pointers.clone(), columns.clone());
        let parts = Parts::find(&pointers, &columns, 3).unwrap();
        assert_eq!(parts.ends.len(), MOST_PARTS);
        assert_eq!(parts.ends.last(), Some(&(ROWS - (MOST_PARTS - 1) * 50)));
        parts.sort(&mut pointers, &mut columns).unwrap();
        let row = |place: usize| &columns[pointers[place]..pointers[place + 1]];
        let mut start = 0;
        for &end in &parts.ends {
            assert!((start..end).all(|place| row(place).iter().all(|&column| column as usize >= start)));
            start = end;
        }
        assert!((0..ROWS).all(|place| row(place).is_sorted_by(|one, other| one < other)));
        // The same couplings, at their places.
        for one in 0..ROWS {
            for &other in &given.1[given.0[one]..given.0[one + 1]] {
                let places = [parts.place(one), parts.place(other as usize)];
                let column = u32::try_from(places[0].min(places[1])).unwrap();
                assert!(row(places[0].max(places[1])).binary_search(&column).is_ok());
            }
        }
        assert_eq!(columns.len(), given.1.len());
        assert!((0..ROWS).step_by(997).all(|one| parts.dof(3 * parts.place(one) + 2, 3) == 3 * one + 2));
    }

    #[test]
    fn small_matrices_and_scattered_numberings_have_no_parts() {
        for (rows, width, size) in [(60_000, 20_000, 3), (1000, 50, 3), (60_000, 50, 1)] {
            let (mut pointers, mut columns) = strip(rows, width);
            let given = (pointers.clone(), columns.clone());
            let parts = Parts::find(&pointers, &columns, size).unwrap();
            parts.sort(&mut pointers, &mut columns).unwrap();
            assert!(parts.ends.is_empty() && (pointers, columns) == given);
            assert_eq!((parts.place(7), parts.dof(22, 3)), (7, 22));
        }
    }
}
