//! W = G A⁻¹ Gᵀ from responses to dofs, one tile of places at a time: the column entries that the rows of a tile read
//! stay in a cache, since neighboring rows act on the same dofs.

use crate::contact::ContactJacobian;
use crate::real::Real;
use std::ops::Range;

/// Number of places of a tile.
const TILE: usize = 128;

/// Number of rows whose responses are transposed together: as many as fill a cache line.
const FEW: usize = 8;

/// The entries of some rows, and responses at the places of a tile.
#[derive(Debug, Default)]
pub(crate) struct Tiles<T> {
    /// (place, weight) of all rows, ascending in each, and where each row begins.
    entries: Vec<(usize, T)>,
    starts: Vec<usize>,
    /// For each row the first entry at the places of the present tile, or behind it.
    next: Vec<usize>,
    /// The responses to a few rows at the places of the tile, and the responses to all rows at each of these places.
    own: Vec<T>,
    all: Vec<T>,
}

impl<T: Real> Tiles<T> {
    /// W of some rows, row by row, on an interface of `size` places; `column` returns the response to a unit force at
    /// any place that the rows act on.
    pub(crate) fn couple<'c>(
        &mut self,
        g: &ContactJacobian<T>,
        rows: &[usize],
        size: usize,
        column: impl Fn(usize) -> &'c [T],
        w: &mut [T],
    ) {
        self.sort(g, rows);
        w.fill(T::zero());
        let Self { entries, starts, next, own, all } = self;
        let count = rows.len();
        while let Some(first) = next.iter().zip(&starts[1..]).filter_map(|(&k, &end)| first(entries, k..end)).min() {
            let tile = first..(first + TILE).min(size);
            let width = tile.len();
            own.resize(FEW * width, T::zero());
            all.resize(width * count, T::zero());
            for (block, begins) in starts[..count].chunks(FEW).enumerate() {
                own.fill(T::zero());
                for (k, (&begin, own)) in begins.iter().zip(own.chunks_exact_mut(width)).enumerate() {
                    let end = starts[block * FEW + k + 1];
                    add(&entries[begin..end], |place| &column(place)[tile.clone()], own);
                }
                for (place, all) in all.chunks_exact_mut(count).enumerate() {
                    let all = all[block * FEW..].iter_mut().take(begins.len()).enumerate();
                    all.for_each(|(k, x)| *x = own[k * width + place]);
                }
            }
            for (next, (w, range)) in next.iter_mut().zip(w.chunks_exact_mut(count).zip(starts.windows(2))) {
                let there = entries[*next..range[1]].partition_point(|&(place, _)| place < tile.end);
                let row = |place: usize| &all[(place - first) * count..(place - first + 1) * count];
                add(&entries[*next..*next + there], row, w);
                *next += there;
            }
        }
    }

    /// Reads the entries of some rows, and sorts them by place.
    fn sort(&mut self, g: &ContactJacobian<T>, rows: &[usize]) {
        let Self { entries, starts, next, .. } = self;
        entries.clear();
        starts.clear();
        starts.push(0);
        for &row in rows {
            let first = entries.len();
            entries.extend(g.located(row));
            entries[first..].sort_unstable_by_key(|&(place, _)| place);
            starts.push(entries.len());
        }
        next.clear();
        next.extend_from_slice(&starts[..rows.len()]);
    }
}

/// The first place of some entries.
fn first<T>(entries: &[(usize, T)], range: Range<usize>) -> Option<usize> {
    entries[range].first().map(|&(place, _)| place)
}

/// `out += Σ c x` with the list x of each (place, c).
fn add<'x, T: Real>(terms: &[(usize, T)], list: impl Fn(usize) -> &'x [T], out: &mut [T]) {
    // Several terms at a time: `out` is read and written less often.
    let fours = terms.chunks_exact(4);
    let rest = fours.remainder();
    for four in fours {
        let of = |k: usize| list(four[k].0);
        T::add_all(std::array::from_fn::<T, 4, _>(|k| four[k].1), std::array::from_fn(of), out);
    }
    for &(place, c) in rest {
        T::add_all([c], [list(place)], out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W against its definition, on interfaces of less than a tile, of one, and of several, with places that no row
    /// acts on and dofs that a row names twice.
    #[test]
    fn tiles_add_up_to_the_whole() {
        let noise = |i: usize, j: usize| ((i * 37 + j * 101) as f64).sin();
        let mut tiles = Tiles::default();
        for size in [5, TILE, 3 * TILE + 7] {
            let columns: Vec<Vec<f64>> =
                (0..size).map(|j| (0..size).map(|i| noise(i.min(j), i.max(j))).collect()).collect();
            let mut g = ContactJacobian::default();
            for row in 0..7 {
                let entries: Vec<_> = (0..9).map(|k| ((row * row * 31 + k * k * 17) % size, noise(row, k))).collect();
                g.push(&entries);
            }
            g.locate(&(0..size).collect::<Vec<_>>());
            let rows = [0, 2, 3, 6];
            let mut w = vec![f64::NAN; 16];
            tiles.couple(&g, &rows, size, |place| &columns[place], &mut w);
            for (i, &row) in rows.iter().enumerate() {
                for (j, &other) in rows.iter().enumerate() {
                    let terms = g.row(row).flat_map(|(p, x)| g.row(other).map(move |(q, y)| (p, q, x * y)));
                    let expected: f64 = terms.map(|(p, q, xy)| xy * columns[q][p]).sum();
                    let found = w[i * 4 + j];
                    assert!((found - expected).abs() < 1e-13, "{size}, {i}, {j}: {found}, {expected}");
                }
            }
        }
        tiles.couple(&ContactJacobian::default(), &[], 5, |_| &[], &mut []);
    }
}
