//! The multiplication of a matrix with vectors, by a method selected once from its pattern.
//!
//! For a symmetric matrix whose dofs are numbered node by node, as usual, only the entries on and below the diagonal
//! are read, with one index per block of them (`benches/solids.rs` measures the gain).

use super::Symmetry;
use crate::error::Result;
use crate::kernels::product::{LowerColumns, LowerEntries, Supervariable, Tridiagonal};
use crate::kernels::vector::Accumulate;
use crate::memory;
use crate::real::Real;
use crate::threads;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use std::ops::Range;

/// The multiplication method of a matrix. The matrix is stored elsewhere and must be the one for which this was
/// created.
#[derive(Debug)]
pub(crate) enum Product<T> {
    /// An unsymmetric matrix: column by column.
    General,
    /// A symmetric matrix without groups of dofs: row by row.
    Rows,
    /// A symmetric tridiagonal matrix.
    Tridiagonal { diagonal: Vec<T>, beside: Vec<T> },
    /// A symmetric matrix whose columns form groups of two or three.
    Supervariables(Box<Supervariables<T>>),
}

impl<T: Real> Product<T> {
    pub(crate) fn new(a: SparseColMatRef<'_, usize, T>, symmetry: Symmetry) -> Result<Self> {
        if symmetry == Symmetry::General {
            return Ok(Self::General);
        }
        let n = a.ncols();
        let tridiagonal = |j: usize| {
            let rows = a.row_idx_of_col_raw(j);
            rows.first().is_none_or(|&row| row + 1 >= j) && rows.last().is_none_or(|&row| row <= j + 1)
        };
        if (0..n).all(tridiagonal) {
            let diagonal = (0..n).map(|j| super::entry(a, j, j)).collect();
            let beside = (1..n).map(|j| super::entry(a, j, j - 1)).collect();
            return Ok(Self::Tridiagonal { diagonal, beside });
        }
        Self::of_symmetric(a.symbolic())
    }

    /// For all symmetric matrices of a pattern.
    pub(crate) fn of_symmetric(pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Self> {
        let found = Supervariables::find(pattern)?;
        Ok(found.map_or(Self::Rows, |found| Self::Supervariables(Box::new(found))))
    }

    /// Packs the entries of a matrix that is too large for a cache: products then read half as much, and the matrix
    /// takes a quarter more memory.
    pub(crate) fn pack_large(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        /// Number of entries, of both triangles.
        const LARGE: usize = 1 << 17;
        if a.val().len() > LARGE {
            self.pack(a)?;
        }
        Ok(())
    }

    /// Packs the entries of a symmetric matrix; products then read these alone. Returns whether it does: other
    /// matrices are read in place.
    pub(crate) fn pack(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<bool> {
        match self {
            Self::Supervariables(supervariables) => supervariables.pack(a).map(|()| true),
            Self::General | Self::Rows | Self::Tridiagonal { .. } => Ok(false),
        }
    }

    /// `y = A x` with packed entries, for x that is zero farther than `distance` from the dofs of the last
    /// [`measure`](Self::measure).
    pub(crate) fn write_packed(&mut self, distance: usize, x: &[T], y: &mut [T]) {
        if let Self::Supervariables(supervariables) = self {
            let highest = u8::try_from(distance.saturating_add(1)).unwrap_or(FAR);
            supervariables.multiply((T::one(), None, highest), x, y, Accumulate::Replace);
        }
    }

    /// Measures how far dofs are from some of them: by how many products x gets there that is zero elsewhere.
    pub(crate) fn measure(&mut self, dofs: &[usize]) -> Result<()> {
        match self {
            Self::Supervariables(supervariables) => supervariables.measure(dofs),
            Self::General | Self::Rows | Self::Tridiagonal { .. } => Ok(()),
        }
    }

    /// The share of the entries that products read of which each reaches one dof farther, on average over `count`.
    pub(crate) fn mean_share(&self, count: usize) -> f64 {
        match self {
            Self::Supervariables(supervariables) => supervariables.mean_share(count),
            Self::General | Self::Rows | Self::Tridiagonal { .. } => 1.0,
        }
    }

    pub(crate) fn symmetry(&self) -> Symmetry {
        match self {
            Self::General => Symmetry::General,
            Self::Rows | Self::Tridiagonal { .. } | Self::Supervariables(_) => Symmetry::Symmetric,
        }
    }

    /// `y = c A x`.
    pub(crate) fn write(&mut self, c: T, a: SparseColMatRef<'_, usize, T>, x: &[T], y: &mut [T]) {
        self.multiply(c, a, x, y, Accumulate::Replace);
    }

    /// `y += c A x`.
    pub(crate) fn add(&mut self, c: T, a: SparseColMatRef<'_, usize, T>, x: &[T], y: &mut [T]) {
        self.multiply(c, a, x, y, Accumulate::Add);
    }

    fn multiply(&mut self, c: T, a: SparseColMatRef<'_, usize, T>, x: &[T], y: &mut [T], put: Accumulate) {
        match self {
            Self::General => {
                if put == Accumulate::Replace {
                    y.fill(T::zero());
                }
                T::product(c, a, x, y);
            }
            Self::Rows => T::symmetric_product(c, a, x, y, put),
            Self::Tridiagonal { diagonal, beside } => {
                T::tridiagonal_product(c, Tridiagonal { diagonal, beside }, x, y, put);
            }
            Self::Supervariables(supervariables) => supervariables.multiply((c, Some(a), FAR), x, y, put),
        }
    }
}

/// The supervariables of a matrix, and the parts that several threads multiply in parallel. Parts depend on the
/// matrix only, so the result is the same for any number of threads.
#[derive(Debug)]
pub(crate) struct Supervariables<T> {
    /// All supervariables, and one after the last.
    all: Vec<Supervariable>,
    groups: Vec<u32>,
    parts: Vec<Part<T>>,
    /// The entries at and below the diagonal, if they have been packed.
    packed: Vec<T>,
    /// The distance of each supervariable from some dofs; empty if it was not measured.
    levels: Vec<u8>,
}

/// The level of supervariables too far to be counted.
const FAR: u8 = u8::MAX;

/// Columns that one thread multiplies.
#[derive(Debug)]
struct Part<T> {
    /// Range of the supervariables, without the following one.
    supervariables: Range<usize>,
    columns: Range<usize>,
    /// Their contributions to the product: in their own rows, then in later rows. Empty if there is a single part,
    /// which writes to the product itself.
    sums: Vec<T>,
    /// Where its packed entries begin.
    packed: usize,
}

impl<T: Real> Supervariables<T> {
    /// Largest number of columns in a group: a kernel is compiled for each number. The six dofs of a shell's node
    /// form two groups.
    const WIDEST: usize = 3;
    /// With fewer columns per supervariable, on average, rows are as fast.
    const WORTHWHILE: f64 = 1.5;
    /// Number of entries that deserves a thread: a tenth of a millisecond.
    const GRAIN: usize = 1 << 18;
    /// This many parts keep eight threads busy at little cost for one thread.
    const MOST_PARTS: usize = 8;

    /// `None` if they bring no gain, or if the matrix is too large for 32 bits.
    fn find(pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Option<Self>> {
        const WHAT: &str = "the supervariables of a matrix";
        let n = pattern.ncols();
        if u32::try_from(pattern.row_idx().len()).is_err() {
            return Ok(None);
        }
        #[allow(clippy::cast_possible_truncation)] // checked above
        let index = |i: usize| i as u32;
        let (mut all, mut groups) = (memory::reserve(n / 2, 1, WHAT)?, Vec::new());
        let mut column = 0;
        while column < n {
            let rows = pattern.row_idx_of_col_raw(column);
            let Ok(place) = rows.binary_search(&column) else { return Ok(None) };
            let alike = |other: &usize| {
                rows.get(place + other - column) == Some(other) && pattern.row_idx_of_col_raw(*other) == rows
            };
            let width = 1 + (column + 1..n.min(column + Self::WIDEST)).take_while(alike).count();
            let below = &rows[place + width..];
            let whole = |group: &[usize]| group.len() == width && group[width - 1] - group[0] == width - 1;
            let group = if below.chunks(width).all(whole) { width } else { 1 };
            #[allow(clippy::cast_possible_truncation)] // at most three
            let [width_, group_] = [width as u8, group as u8];
            memory::make_room(&mut all, 2, WHAT)?;
            memory::make_room(&mut groups, below.len(), WHAT)?;
            all.push(Supervariable { column: index(column), width: width_, group: group_, first: index(groups.len()) });
            groups.extend(below.iter().step_by(group).map(|&row| index(row)));
            column += width;
        }
        if n as f64 <= Self::WORTHWHILE * all.len() as f64 {
            return Ok(None);
        }
        all.push(Supervariable { column: index(n), width: 0, group: 0, first: index(groups.len()) });
        all.shrink_to_fit();
        groups.shrink_to_fit();
        let parts = Self::parts(pattern, &all)?;
        Ok(Some(Self { all, groups, parts, packed: Vec::new(), levels: Vec::new() }))
    }

    /// Parts with similar numbers of entries; a single one if they would contribute to many rows of each other.
    fn parts(pattern: SymbolicSparseColMatRef<'_, usize>, all: &[Supervariable]) -> Result<Vec<Part<T>>> {
        let n = pattern.ncols();
        let pointers = pattern.col_ptr();
        let wanted = (pointers[n] / Self::GRAIN).clamp(1, Self::MOST_PARTS);
        let column = |supervariable: usize| all[supervariable].column as usize;
        let share = |part: usize| {
            all.partition_point(|supervariable| pointers[supervariable.column as usize] < pointers[n] / wanted * part)
        };
        let mut parts = Vec::with_capacity(wanted);
        let mut behind = 0;
        for part in 0..wanted {
            let end = if part + 1 < wanted { share(part + 1) } else { all.len() - 1 };
            let supervariables = share(part)..end;
            let columns = column(supervariables.start)..column(supervariables.end);
            let reach = columns.clone().filter_map(|j| pattern.row_idx_of_col_raw(j).last()).max();
            let rows = reach.map_or(columns.end, |row| columns.end.max(row + 1)) - columns.start;
            behind += rows - columns.len();
            let sums = memory::zeros(rows, 1, "the sums of a product")?;
            parts.push(Part { supervariables, columns, sums, packed: 0 });
        }
        if parts.len() == 1 || behind > n {
            return Ok(vec![Part { supervariables: 0..all.len() - 1, columns: 0..n, sums: Vec::new(), packed: 0 }]);
        }
        Ok(parts)
    }

    /// Copies the entries of a matrix at and below the diagonal.
    fn pack(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let Self { all, parts, packed, .. } = self;
        let entries = |pair: &[Supervariable]| pair[0].entries((pair[1].first - pair[0].first) as usize);
        packed.clear();
        memory::grow(packed, all.windows(2).map(entries).sum(), 1, "the packed effective matrix")?;
        let (mut rest, mut begin) = (&mut packed[..], 0);
        for (at, pair) in all.windows(2).enumerate() {
            if let Some(part) = parts.iter_mut().find(|part| part.supervariables.start == at) {
                part.packed = begin;
            }
            begin += entries(pair);
            let (first, width) = (pair[0].column as usize, usize::from(pair[0].width));
            for column in first..first + width {
                let (own, behind) = rest.split_at_mut(entries(pair) / width);
                let end = a.col_ptr()[column + 1];
                own.copy_from_slice(&a.val()[end - own.len()..end]);
                rest = behind;
            }
        }
        Ok(())
    }

    fn measure(&mut self, dofs: &[usize]) -> Result<()> {
        const WHAT: &str = "the distances from contact";
        let Self { all, groups, levels, .. } = self;
        // The supervariable of each column.
        let mut owners: Vec<usize> = memory::reserve(all[all.len() - 1].column as usize, 1, WHAT)?;
        owners.extend(all.iter().enumerate().flat_map(|(own, found)| std::iter::repeat_n(own, found.width.into())));
        levels.clear();
        memory::grow(levels, all.len() - 1, 1, WHAT)?;
        levels.fill(FAR);
        for &dof in dofs {
            levels[owners[dof]] = 0;
        }
        for level in 0..FAR - 1 {
            let mut grows = false;
            for (own, pair) in all.windows(2).enumerate() {
                let others = groups[pair[0].first as usize..pair[1].first as usize].iter();
                let mut others = others.map(|&row| owners[row as usize]);
                if levels[own] == level {
                    for other in others {
                        let found = &mut levels[other];
                        if *found == FAR {
                            (*found, grows) = (level + 1, true);
                        }
                    }
                } else if levels[own] == FAR && others.any(|other| levels[other] == level) {
                    (levels[own], grows) = (level + 1, true);
                }
            }
            if !grows {
                break;
            }
        }
        Ok(())
    }

    fn mean_share(&self, count: usize) -> f64 {
        let Self { all, levels, .. } = self;
        let (mut read, mut whole) = (0, 0);
        for (at, pair) in all.windows(2).enumerate() {
            let entries = pair[0].entries((pair[1].first - pair[0].first) as usize);
            let level = levels.get(at).map_or(0, |&level| usize::from(level));
            whole += count * entries;
            // The product number k, from 0 on, reads the levels up to k + 1.
            read += count.saturating_sub(level.saturating_sub(1)) * entries;
        }
        if whole > 0 { read as f64 / whole as f64 } else { 1.0 }
    }

    /// `y = c A x` or `y += c A x` with the supervariables up to a level; A is packed if it is not given.
    fn multiply(
        &mut self,
        (c, a, highest): (T, Option<SparseColMatRef<'_, usize, T>>, u8),
        x: &[T],
        y: &mut [T],
        put: Accumulate,
    ) {
        let Self { all, groups, parts, packed, levels } = self;
        let entries = |part: &Part<T>| match a.filter(|_| packed.is_empty()) {
            Some(a) => LowerEntries::Matrix(a),
            None => LowerEntries::Packed(packed.get(part.packed..).unwrap_or(&[])),
        };
        let lower = |part: &Part<T>| LowerColumns {
            entries: entries(part),
            supervariables: &all[part.supervariables.start..=part.supervariables.end],
            groups,
            levels: (levels.get(part.supervariables.clone()).unwrap_or(&[]), highest),
        };
        if let [part] = &parts[..] {
            if put == Accumulate::Replace {
                y.fill(T::zero());
            }
            return T::lower_product(c, lower(part), x, y);
        }
        let sum = |part: &mut Part<T>| -> Result<(), std::convert::Infallible> {
            let columns = lower(part);
            part.sums.fill(T::zero());
            T::lower_product(c, columns, x, &mut part.sums);
            Ok(())
        };
        let Ok(()) = threads::try_each(parts, &sum);
        for Part { columns, sums, .. } in &*parts {
            let (own, _) = sums.split_at(columns.len());
            match put {
                Accumulate::Replace => y[columns.clone()].copy_from_slice(own),
                Accumulate::Add => T::axpy(T::one(), own, &mut y[columns.clone()]),
            }
        }
        for Part { columns, sums, .. } in &*parts {
            let behind = &sums[columns.len()..];
            T::axpy(T::one(), behind, &mut y[columns.end..columns.end + behind.len()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::sparse::{SparseColMat, Triplet};

    /// Nodes with the given numbers of dofs; two nodes are coupled if `coupled` returns true, and each node with
    /// itself.
    fn matrix(dofs: &[usize], coupled: impl Fn(usize, usize) -> bool) -> SparseColMat<usize, f64> {
        let first: Vec<usize> = std::iter::once(0)
            .chain(dofs.iter().scan(0, |sum, dofs| {
                *sum += dofs;
                Some(*sum)
            }))
            .collect();
        let mut entries = Vec::new();
        for p in 0..dofs.len() {
            for q in (0..=p).filter(|&q| q == p || coupled(p, q)) {
                for (i, j) in (first[p]..first[p + 1]).flat_map(|i| (first[q]..first[q + 1]).map(move |j| (i, j))) {
                    let value = (1.0 + (i.min(j) * 7 + i.max(j) * 3) as f64).sin();
                    entries.push(Triplet::new(i, j, value));
                    if p != q {
                        entries.push(Triplet::new(j, i, value));
                    }
                }
            }
        }
        let n = first[dofs.len()];
        SparseColMat::try_new_from_triplets(n, n, &entries).unwrap()
    }

    /// Compares products with row-by-row products, to the rounding of the sums.
    fn check(a: &SparseColMat<usize, f64>, product: &mut Product<f64>) {
        let a = a.as_ref();
        let n = a.ncols();
        let x: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).cos() + 0.2).collect();
        let before: Vec<f64> = (0..n).map(|i| (0.7 * i as f64).sin()).collect();
        let (mut written, mut added) = (vec![f64::NAN; n], before.clone());
        product.write(-2.0, a, &x, &mut written);
        let mut packed = vec![f64::NAN; n];
        if product.pack(a).unwrap() {
            product.write_packed(n, &x, &mut packed);
            assert!(
                packed.iter().zip(&written).all(|(packed, written)| (-2.0 * packed - written).abs() < 1e-14 * n as f64)
            );
        }
        product.add(-2.0, a, &x, &mut added);
        for j in 0..n {
            let terms = || a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)).map(|(&i, &value)| value * x[i]);
            let (sum, size) = (terms().sum::<f64>(), terms().map(f64::abs).sum::<f64>());
            let tolerance = 8.0 * f64::EPSILON * (size + 1.0);
            assert!((written[j] + 2.0 * sum).abs() <= tolerance, "row {j}: {} and {}", written[j], -2.0 * sum);
            assert!((added[j] - before[j] + 2.0 * sum).abs() <= tolerance, "row {j}");
        }
    }

    #[test]
    fn any_number_of_dofs_a_node() {
        let coupled = |p: usize, q: usize| (p * q) % 3 == 1 || p - q < 2;
        for dofs in
            [vec![3; 20], vec![2; 31], vec![6; 9], vec![5; 9], vec![4; 9], vec![3, 1, 2, 3, 3, 2, 6, 1, 1, 2, 3]]
        {
            let a = matrix(&dofs, coupled);
            let mut product = Product::new(a.as_ref(), Symmetry::Symmetric).unwrap();
            assert!(matches!(product, Product::Supervariables(_)), "{dofs:?}");
            check(&a, &mut product);
        }
    }

    /// x that is zero beyond a distance from some dofs has the same product if only what is near is multiplied.
    #[test]
    fn products_of_what_is_near() {
        for (nodes, reach) in [(40, 3), (4500, 14)] {
            let a = matrix(&vec![3; nodes], |p, q| p - q < reach);
            let a = a.as_ref();
            let mut product = Product::new(a, Symmetry::Symmetric).unwrap();
            product.measure(&[3 * (nodes / 2) + 1]).unwrap();
            assert!(product.pack(a).unwrap());
            let (mut x, mut near, mut whole) = (vec![0.0; 3 * nodes], vec![f64::NAN; 3 * nodes], vec![0.0; 3 * nodes]);
            for distance in 0..6 {
                let nearest = (nodes / 2).saturating_sub(distance * (reach - 1));
                let farthest = (nodes / 2 + distance * (reach - 1)).min(nodes - 1);
                x[3 * nearest..3 * farthest + 3].fill(1.0);
                product.write_packed(distance, &x, &mut near);
                product.write_packed(nodes, &x, &mut whole);
                assert_eq!(near, whole, "{nodes} nodes, distance {distance}");
            }
            let share = product.mean_share(2);
            // The first product reads the nodes within one step, the second those within two.
            let read = (6 * reach - 4) as f64 / (2 * nodes) as f64;
            assert!((share / read - 1.0).abs() < 0.1, "{share}, {read}");
        }
    }

    /// A node of two dofs between nodes of three gives rows in groups of neither two nor three.
    #[test]
    fn groups_of_rows_that_are_no_nodes() {
        let a = matrix(&[3, 2, 3], |_, q| q == 0);
        let mut product = Product::new(a.as_ref(), Symmetry::Symmetric).unwrap();
        let Product::Supervariables(found) = &product else { panic!("dofs go together") };
        let all = &found.all;
        assert!(all[0].width == 3 && all[0].group == 1);
        check(&a, &mut product);
    }

    #[test]
    fn chains_and_single_dofs_go_row_by_row() {
        for n in [1, 2, 3, 40] {
            let chain = matrix(&vec![1; n], |p, q| p - q == 1 && p != n / 2);
            let mut product = Product::new(chain.as_ref(), Symmetry::Symmetric).unwrap();
            assert!(matches!(product, Product::Tridiagonal { .. }));
            check(&chain, &mut product);
        }
        let net = matrix(&[1; 50], |p, q| (p + q) % 7 == 0);
        let mut product = Product::new(net.as_ref(), Symmetry::Symmetric).unwrap();
        assert!(matches!(product, Product::Rows));
        check(&net, &mut product);
        check(&net, &mut Product::new(net.as_ref(), Symmetry::General).unwrap());
    }

    /// Large matrices are multiplied in several parts if dofs are numbered along the body, otherwise in one.
    #[test]
    fn parts_of_a_large_matrix_add_up() {
        let band = |p: usize, q: usize| p - q < 14;
        let a = matrix(&vec![3; 4500], band);
        let mut product = Product::new(a.as_ref(), Symmetry::Symmetric).unwrap();
        let Product::Supervariables(found) = &product else { panic!("dofs go together") };
        let parts = &found.parts;
        assert!(parts.len() > 1 && parts.iter().all(|part| !part.sums.is_empty()));
        check(&a, &mut product);

        let scattered = |p: usize| crate::sparse::scattered(p) % 4500;
        let far = matrix(&vec![3; 4500], |p, q| scattered(p).abs_diff(scattered(q)) < 14);
        let mut product = Product::new(far.as_ref(), Symmetry::Symmetric).unwrap();
        let Product::Supervariables(found) = &product else { panic!("dofs go together") };
        let parts = &found.parts;
        assert!(parts.len() == 1 && far.val().len() > 4 * Supervariables::<f64>::GRAIN);
        check(&far, &mut product);
    }
}
