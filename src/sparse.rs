//! Checks of vectors and sparse matrices, and linear combinations of sparse matrices in one fixed pattern.

mod product;

pub(crate) use product::Product;

use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::rounding::rounding;
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};

/// The size of a square matrix.
pub(crate) fn square<T>(matrix: &'static str, a: SparseColMatRef<'_, usize, T>) -> Result<usize> {
    if a.nrows() == a.ncols() {
        Ok(a.nrows())
    } else {
        Err(Error::Dimension { what: matrix, expected: a.nrows(), found: a.ncols() })
    }
}

/// Rejects a vector of another length than `dofs`, and NaN or infinity in it.
pub(crate) fn check_vector<T: Real>(what: &'static str, values: &[T], dofs: usize) -> Result<()> {
    if values.len() != dofs {
        return Err(Error::Dimension { what, expected: dofs, found: values.len() });
    }
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(Error::NotFinite { what, index, value: values[index].value() }),
        None => Ok(()),
    }
}

/// Rejects patterns with slack between columns or with unsorted rows; every loop here relies on this.
pub(crate) fn check_pattern(matrix: &'static str, pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<()> {
    let refuse = |reason| Err(Error::Incompatible { part: format!("the {matrix} matrix"), reason });
    if pattern.col_nnz().is_some() {
        return refuse("its columns have slack; store it compressed");
    }
    let ascending = |j: usize| pattern.row_idx_of_col_raw(j).windows(2).all(|pair| pair[0] < pair[1]);
    match (0..pattern.ncols()).all(ascending) {
        true => Ok(()),
        false => refuse("its row indices must ascend in each column, without repetition"),
    }
}

/// Rejects the pattern of an effective matrix that is not square or that [`check_pattern`] rejects; returns the
/// number of dofs.
pub(crate) fn check_effective_pattern(pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<usize> {
    let (rows, columns) = (pattern.nrows(), pattern.ncols());
    if rows != columns {
        return Err(Error::Dimension { what: "effective matrix", expected: rows, found: columns });
    }
    check_pattern("effective", pattern)?;
    Ok(columns)
}

/// Rejects NaN and infinity, and matrices that are not symmetric to rounding of their own entries.
pub(crate) fn check_symmetric<T: Real>(matrix: &'static str, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
    check_symmetric_in(matrix, a, &mut Vec::new())
}

/// Whether a matrix is symmetric to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Symmetry {
    Symmetric,
    General,
}

/// Rejects NaN and infinity, and returns whether the matrix is symmetric to rounding of its own entries. A matrix
/// with entries on one side of the diagonal only is taken as half of a symmetric one and rejected.
pub(crate) fn symmetry<T: Real>(matrix: &'static str, a: SparseColMatRef<'_, usize, T>) -> Result<Symmetry> {
    let stored = |side: fn(&usize, &usize) -> bool| {
        (0..a.ncols()).any(|column| a.row_idx_of_col_raw(column).iter().any(|row| side(row, &column)))
    };
    match check_symmetric(matrix, a) {
        Ok(()) => Ok(Symmetry::Symmetric),
        Err(Error::Asymmetric { .. }) if stored(usize::gt) && stored(usize::lt) => Ok(Symmetry::General),
        Err(other) => Err(other),
    }
}

/// Rejects NaN and infinity in a matrix with a [checked](check_pattern) pattern.
pub(crate) fn check_finite<T: Real>(matrix: &'static str, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
    let Some(at) = a.val().iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let column = a.col_ptr().partition_point(|&start| start <= at) - 1;
    Err(Error::MatrixNotFinite { matrix, row: a.row_idx()[at], column, value: a.val()[at].value() })
}

/// As [`check_symmetric`], with memory kept between checks.
pub(crate) fn check_symmetric_in<T: Real>(
    matrix: &'static str,
    a: SparseColMatRef<'_, usize, T>,
    cursor: &mut Vec<usize>,
) -> Result<()> {
    let n = square(matrix, a)?;
    check_pattern(matrix, a.symbolic())?;
    check_finite(matrix, a)?;
    // Assembly adds the same element entries in different orders.
    let tolerance = rounding(T::largest(a.val()));
    let mut worst = (tolerance, None);
    let mut compare = |row: usize, column: usize, value: T, mirrored: T| {
        let difference = (value - mirrored).abs();
        if difference > worst.0 {
            worst = (difference, Some((row, column, value, mirrored)));
        }
    };
    // The mirror images of the entries of a column, which ascend, are met in ascending order: one cursor for each
    // column finds them.
    let (pointers, rows, values) = (a.col_ptr(), a.row_idx(), a.val());
    cursor.clear();
    cursor.extend_from_slice(&pointers[..n]);
    for column in 0..n {
        for at in pointers[column]..pointers[column + 1] {
            let (row, mirror) = (rows[at], &mut cursor[rows[at]]);
            while *mirror < pointers[row + 1] && rows[*mirror] < column {
                *mirror += 1;
            }
            let is_stored = *mirror < pointers[row + 1] && rows[*mirror] == column;
            compare(row, column, values[at], if is_stored { values[*mirror] } else { T::zero() });
        }
    }
    match worst.1 {
        None => Ok(()),
        Some((row, column, value, mirrored)) => {
            Err(Error::Asymmetric { matrix, row, column, value: value.value(), mirrored: mirrored.value() })
        }
    }
}

/// A pseudo-random number for each index (the finalizer of splitmix64).
pub(crate) fn scattered(index: usize) -> u64 {
    let x = (index as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The same with magnitude between ½ and 1 and either sign: such a vector has a component along almost every other
/// one.
pub(crate) fn scattered_signed(index: usize) -> f64 {
    let number = scattered(index);
    let size = 0.5 + (number >> 12) as f64 / (1_u64 << 53) as f64;
    if number & 1 == 0 { size } else { -size }
}

/// The square matrix of these entries (row, column, value); entries at the same place are summed in order.
pub(crate) fn assembled<T: Real>(size: usize, mut entries: Vec<(usize, usize, T)>) -> Result<SparseColMat<usize, T>> {
    entries.sort_by_key(|&(row, column, _)| (column, row));
    let (mut pointers, mut rows, mut values) = (vec![0; size + 1], Vec::new(), Vec::<T>::new());
    let mut last = None;
    for (row, column, value) in entries {
        match values.last_mut() {
            Some(sum) if last == Some((row, column)) => *sum += value,
            _ => {
                rows.push(row);
                values.push(value);
                pointers[column + 1] += 1;
            }
        }
        last = Some((row, column));
    }
    for column in 0..size {
        pointers[column + 1] += pointers[column];
    }
    let pattern = SymbolicSparseColMatRef::new_checked(size, size, &pointers, None, &rows)
        .to_owned()
        .map_err(|_| Error::OutOfMemory { what: "the pattern of a matrix", bytes: None })?;
    Ok(SparseColMat::new(pattern, values))
}

/// Entry (row, column), zero if it is not stored.
pub(crate) fn entry<T: Real>(a: SparseColMatRef<'_, usize, T>, row: usize, column: usize) -> T {
    let rows = a.row_idx_of_col_raw(column);
    rows.binary_search(&row).map_or(T::zero(), |at| a.val_of_col(column)[at])
}

/// Whether a source has exactly this pattern.
fn kept_as_it_is(source: SymbolicSparseColMatRef<'_, usize>, pointers: &[usize], rows: &[usize]) -> bool {
    source.col_nnz().is_none() && source.col_ptr() == pointers && source.row_idx() == rows
}

/// A fixed pattern for weighted sums of several matrices, with identity rows and columns for some dofs; entries are
/// copied through precomputed slots.
#[derive(Debug)]
pub(crate) struct Combination {
    /// Empty if it is [left to the first source](Self::leave_pattern).
    pattern: SymbolicSparseColMat<usize>,
    /// Number of its entries.
    entries: usize,
    /// For each source the slot of each of its entries, `DROPPED` in removed rows and columns; `None` if the source
    /// has the same pattern, like a stiffness matrix without supports.
    slots: Vec<Option<Vec<usize>>>,
    diagonal: Vec<usize>,
    identity: Vec<usize>,
}

const DROPPED: usize = usize::MAX;

impl Combination {
    /// The union of the patterns of the sources and the diagonal.
    pub(crate) fn new(n: usize, identity: &[usize], sources: &[SymbolicSparseColMatRef<'_, usize>]) -> Result<Self> {
        Self::within(n, identity, sources, sources)
    }

    /// The diagonal only: other entries of the sources are dropped.
    pub(crate) fn diagonal(
        n: usize,
        identity: &[usize],
        sources: &[SymbolicSparseColMatRef<'_, usize>],
    ) -> Result<Self> {
        Self::within(n, identity, &[], sources)
    }

    /// A sum of `sources` in the union of `patterns` and the diagonal.
    fn within(
        n: usize,
        identity: &[usize],
        patterns: &[SymbolicSparseColMatRef<'_, usize>],
        sources: &[SymbolicSparseColMatRef<'_, usize>],
    ) -> Result<Self> {
        let kept = |dof: &usize| identity.binary_search(dof).is_err();
        let mut pointers = Vec::with_capacity(n + 1);
        // A growing vector would use up to twice the memory.
        let size = patterns.iter().map(|source| source.row_idx().len()).max().map_or(n, |entries| entries + n);
        let mut rows: Vec<usize> = memory::reserve(size, 1, "the pattern of the effective matrix")?;
        let mut column_rows: Vec<usize> = Vec::new();
        let mut diagonal = Vec::with_capacity(n);
        pointers.push(0);
        for column in 0..n {
            column_rows.clear();
            column_rows.push(column);
            if kept(&column) {
                for source in patterns {
                    column_rows.extend(source.row_idx_of_col_raw(column).iter().copied().filter(|row| kept(row)));
                }
            }
            column_rows.sort_unstable();
            column_rows.dedup();
            let at = column_rows.partition_point(|&row| row < column);
            diagonal.push(rows.len() + at);
            rows.extend_from_slice(&column_rows);
            pointers.push(rows.len());
        }
        let slots: Result<_> = sources
            .iter()
            .map(|source| {
                if kept_as_it_is(*source, &pointers, &rows) {
                    return Ok(None);
                }
                let mut slots = memory::reserve(source.row_idx().len(), 1, "the pattern of the effective matrix")?;
                for column in 0..n {
                    let range = pointers[column]..pointers[column + 1];
                    for row in source.row_idx_of_col_raw(column) {
                        let found = kept(&column).then(|| rows[range.clone()].binary_search(row).ok()).flatten();
                        slots.push(found.map_or(DROPPED, |at| range.start + at));
                    }
                }
                Ok(Some(slots))
            })
            .collect();
        let slots = slots?;
        rows.shrink_to_fit();
        let entries = rows.len();
        let pattern = SymbolicSparseColMat::new_checked(n, n, pointers, None, rows);
        Ok(Self { pattern, entries, slots, diagonal, identity: identity.to_vec() })
    }

    /// Frees a pattern equal to the first source's, which is then passed to [`shape`](Self::shape).
    pub(crate) fn leave_pattern(&mut self) {
        if let Some(None) = self.slots.first() {
            self.pattern = SymbolicSparseColMat::new_checked(0, 0, vec![0], None, Vec::new());
        }
    }

    /// The pattern; `first` is the pattern of the first source, if there is one.
    pub(crate) fn shape<'p>(&'p self, first: SymbolicSparseColMatRef<'p, usize>) -> SymbolicSparseColMatRef<'p, usize> {
        if self.pattern.row_idx().len() < self.entries { first } else { self.pattern.as_ref() }
    }

    /// Number of stored entries.
    pub(crate) fn len(&self) -> usize {
        self.entries
    }

    pub(crate) fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }

    pub(crate) fn view<'a, T: Real>(&'a self, values: &'a [T]) -> SparseColMatRef<'a, usize, T> {
        SparseColMatRef::new(self.pattern.as_ref(), values)
    }

    /// The matrix with these values.
    pub(crate) fn into_matrix<T: Real>(self, values: Vec<T>) -> SparseColMat<usize, T> {
        SparseColMat::new(self.pattern, values)
    }

    /// Rejects sources, and a diagonal, whose sizes differ from the pattern; each source has its name.
    pub(crate) fn check(
        &self,
        diagonal: usize,
        sources: impl Iterator<Item = (&'static str, usize)> + Clone,
    ) -> Result<()> {
        let dofs = self.diagonal.len();
        let part = || "a system whose mass or tangent has changed in a run".to_string();
        if diagonal != dofs {
            return Err(Error::Dimension {
                what: "the mass, which must not change in a run,",
                expected: dofs,
                found: diagonal,
            });
        }
        if sources.clone().count() != self.slots.len() {
            return Err(Error::Incompatible {
                part: part(),
                reason: "a lumped mass stays lumped, a consistent one consistent",
            });
        }
        for (slots, (what, found)) in self.slots.iter().zip(sources) {
            let expected = slots.as_ref().map_or(self.len(), Vec::len);
            if found != expected {
                return Err(Error::Dimension { what, expected, found });
            }
        }
        Ok(())
    }

    /// `out = Σ weight · source (+ weight · diag)`, identity in the removed rows.
    pub(crate) fn fill<T: Real>(&self, sources: &[(T, &[T])], diagonal: Option<(T, &[T])>, out: &mut [T]) {
        out.fill(T::zero());
        for (slots, (weight, values)) in self.slots.iter().zip(sources) {
            match slots {
                None => T::axpy(*weight, values, out),
                Some(slots) => {
                    for (&slot, &value) in slots.iter().zip(*values).filter(|(slot, _)| **slot != DROPPED) {
                        out[slot] += *weight * value;
                    }
                }
            }
        }
        if let Some((weight, values)) = diagonal {
            for (&slot, &value) in self.diagonal.iter().zip(values) {
                out[slot] += weight * value;
            }
        }
        for &dof in &self.identity {
            out[self.diagonal[dof]] = T::one();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::sparse::Triplet;

    #[test]
    fn every_asymmetric_entry_is_found() {
        // A full symmetric matrix with one entry changed or missing, at every place.
        let n = 5;
        let value = |i: usize, j: usize| (i * j + i + j) as f64 + 1.0;
        for broken in (0..n * n).filter(|k| k % n != k / n) {
            for factor in [0.0, 0.5] {
                let entries: Vec<_> = (0..n * n)
                    .filter(|&k| k != broken || factor > 0.0)
                    .map(|k| (k % n, k / n, if k == broken { factor } else { 1.0 }))
                    .map(|(i, j, factor)| Triplet::new(i, j, factor * value(i, j)))
                    .collect();
                let a = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries).unwrap();
                match check_symmetric("test", a.as_ref()) {
                    Err(Error::Asymmetric { row, column, .. }) => {
                        let (i, j) = (broken % n, broken / n);
                        assert!((row, column) == (i, j) || (row, column) == (j, i));
                    }
                    other => panic!("{broken}: {other:?}"),
                }
            }
        }
    }

    #[test]
    fn combination_adds_in_one_pattern_and_cuts_prescribed_dofs_out() {
        let triplets = |entries: &[(usize, usize, f64)]| {
            let list: Vec<_> = entries.iter().map(|&(i, j, x)| Triplet::new(i, j, x)).collect();
            SparseColMat::<usize, f64>::try_new_from_triplets(3, 3, &list).unwrap()
        };
        let k =
            triplets(&[(0, 0, 2.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 2.0), (1, 2, -1.0), (2, 1, -1.0), (2, 2, 1.0)]);
        let c = triplets(&[(0, 2, 5.0), (2, 0, 5.0)]);
        let sum = Combination::new(3, &[1], &[k.symbolic(), c.symbolic()]).unwrap();
        let mut values = vec![0.0; sum.len()];
        sum.fill(&[(2.0, k.val()), (1.0, c.val())], Some((10.0, &[1.0, 1.0, 1.0])), &mut values);
        let a = sum.view(&values);
        let dense: Vec<Vec<f64>> = (0..3).map(|i| (0..3).map(|j| entry(a, i, j)).collect()).collect();
        assert_eq!(dense, [[14.0, 0.0, 5.0], [0.0, 1.0, 0.0], [5.0, 0.0, 12.0]]);

        // Without supports K alone has the pattern of the sum; C alone does not.
        let own = Combination::new(3, &[], &[k.symbolic()]).unwrap();
        assert!(own.slots[0].is_none() && sum.slots.iter().all(Option::is_some));
        let mut values = vec![0.0; own.len()];
        own.fill(&[(2.0, k.val())], Some((10.0, &[1.0, 1.0, 1.0])), &mut values);
        assert_eq!(values, [14.0, -2.0, -2.0, 14.0, -2.0, -2.0, 12.0]);
    }
}
