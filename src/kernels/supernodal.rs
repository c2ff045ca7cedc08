//! The left-looking numeric factorization A = L Lᵀ by supernodes: each supernode is updated by all earlier ones, then
//! factorized as a dense trapezoid (Ng and Peyton, SIAM J. Sci. Comput. 14, 1993).
//!
//! Branches of the elimination forest are independent and processed in parallel. The large supernodes after them are
//! cut into tiles, which are processed in parallel too. Tiles and the order of sums depend only on the factor:
//! results are bitwise the same on any number of threads.

mod dense;
#[cfg(test)]
mod tests;

use self::dense::{divide, lower_product, pivots, slab};
use super::elimination::Elimination;
use super::plan::Plan;
use crate::scalar::Scalar;
use crate::threads::{self, PerThread, Threads};
use faer::dyn_stack::MemBuffer;
use faer::linalg::cholesky::llt::factor::cholesky_in_place_scratch;
use faer::linalg::matmul::matmul;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::{Accum, MatMut, MatRef, Par, Spec};
use std::ops::Range;

/// Columns of a supernode that are updated together.
const TILE: usize = 128;
/// Columns that are factorized before later ones are updated.
const PANEL: usize = 128;
/// Rows that are multiplied together: their product with a tile stays in the cache.
const ROWS: usize = 480;
/// Columns of a source that are multiplied together: with more of them faer's kernel drops to half its speed.
const DEPTH: usize = 128;

/// Runs of at least this length are subtracted one by one, shorter ones row by row.
const LONG: usize = 16;

/// Products of at least this width omit the upper triangle.
const TRIANGLE: usize = 64;

/// Rows of a product that are consecutive in the updated supernode.
#[derive(Clone, Copy, Debug)]
struct Run {
    begin: usize,
    end: usize,
    /// Place of the first row in the supernode.
    place: usize,
}

/// Workspace of one thread for a factorization.
pub struct Workspace<T> {
    /// The product of some rows with a tile, and its places.
    product: Vec<T>,
    places: Vec<usize>,
    runs: Vec<Run>,
    /// For each row of the present supernode its place there; other rows keep places in earlier ones.
    place_of: Vec<usize>,
    /// Scratch of faer's dense factorization.
    memory: MemBuffer,
}

impl<T> std::fmt::Debug for Workspace<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Workspace").field("dofs", &self.place_of.len()).finish_non_exhaustive()
    }
}

/// For factors with this many dofs; `None` if there is no memory.
#[inline]
pub(crate) fn workspace<T: Scalar>(dofs: usize) -> Option<Workspace<T>> {
    let mut place_of = Vec::new();
    place_of.try_reserve_exact(dofs).ok()?;
    place_of.resize(dofs, 0);
    let scratch = cholesky_in_place_scratch::<T>(PANEL, Par::Seq, Spec::default());
    let (mut product, size) = (Vec::new(), TILE * ROWS.min(dofs));
    product.try_reserve_exact(size).ok()?;
    product.resize(size, T::zero());
    Some(Workspace {
        product,
        places: Vec::with_capacity(ROWS),
        runs: Vec::with_capacity(ROWS),
        place_of,
        memory: MemBuffer::try_new(scratch).ok()?,
    })
}

/// A matrix, and the data for its factorization.
#[derive(Debug)]
pub struct Problem<'a, T> {
    pub(crate) symbolic: &'a SymbolicSupernodalCholesky<usize>,
    pub(crate) elimination: &'a Elimination,
    pub(crate) a: SparseColMatRef<'a, usize, T>,
    /// The dof of each column of the factor, and the column of each dof; `None` if they are the same.
    pub(crate) order: Option<(&'a [usize], &'a [usize])>,
    pub(crate) workspaces: &'a PerThread<Workspace<T>>,
}

/// Writes the factor and the pivots; `Err` holds the first dof (in the order of elimination) whose pivot is not
/// positive. Pivots and dofs are in the numbering of the matrix.
#[inline]
pub(crate) fn factorize<T: Scalar>(problem: &Problem<'_, T>, values: &mut [T], pivots: &mut [T]) -> Result<(), usize> {
    let Problem { symbolic, elimination, order, .. } = *problem;
    let dof = |column: usize| order.map_or(column, |(dofs, _)| dofs[column]);
    Visit { problem }.by_plan(&elimination.plan, 0, values).map_err(dof)?;
    for s in 0..symbolic.n_supernodes() {
        let columns = symbolic.supernode_begin()[s]..symbolic.supernode_end()[s];
        let height = columns.len() + symbolic.supernode(s).pattern().len();
        let diagonal = values[symbolic.col_ptr_for_val()[s]..].iter().step_by(height + 1);
        columns.zip(diagonal).for_each(|(column, &l)| pivots[dof(column)] = l * l);
    }
    Ok(())
}

/// A running factorization.
struct Visit<'a, T> {
    problem: &'a Problem<'a, T>,
}

impl<T: Scalar> Visit<'_, T> {
    /// `values` start at supernode `from`.
    fn by_plan(&self, plan: &Plan, from: usize, values: &mut [T]) -> Result<(), usize> {
        match plan {
            Plan::Serial(range) => {
                self.problem.workspaces.with(|workspace| self.serial(range.clone(), from, values, workspace))
            }
            Plan::Stem(branch, stem) => {
                self.by_plan(branch, from, values)?;
                stem.clone().try_for_each(|s| match self.problem.elimination.is_heavy(s) {
                    true => self.heavy(s, from, values),
                    false => self.problem.workspaces.with(|workspace| self.serial(s..s + 1, from, values, workspace)),
                })
            }
            Plan::Fork(branches, cut) => {
                let places = self.problem.symbolic.col_ptr_for_val();
                let (first, second) = values.split_at_mut(places[*cut] - places[from]);
                let (mut one, mut other) = (Ok(()), Ok(()));
                threads::join(
                    || one = self.by_plan(&branches[0], from, first),
                    || other = self.by_plan(&branches[1], *cut, second),
                );
                one.and(other)
            }
        }
    }

    /// Processes supernodes in sequence.
    fn serial(
        &self,
        range: Range<usize>,
        from: usize,
        values: &mut [T],
        workspace: &mut Workspace<T>,
    ) -> Result<(), usize> {
        for s in range {
            let (target, own) = self.target(s, from, values);
            target.enter(&mut workspace.place_of);
            for (tile, columns) in own.chunks_mut(TILE * target.height).enumerate() {
                target.update(tile, columns, workspace);
            }
            target.factorize(own, Threads::One, |block| pivots(block, &mut workspace.memory))?;
        }
        Ok(())
    }

    /// Processes one supernode, with its tiles in parallel.
    fn heavy(&self, s: usize, from: usize, values: &mut [T]) -> Result<(), usize> {
        let (target, own) = self.target(s, from, values);
        threads::each_chunk(Threads::All, own, TILE * target.height, &|tile, columns| {
            self.problem.workspaces.with(|workspace| {
                target.enter(&mut workspace.place_of);
                target.update(tile, columns, workspace);
            });
        });
        target.factorize(own, Threads::All, |block| {
            self.problem.workspaces.with(|workspace| pivots(block, &mut workspace.memory))
        })
    }

    /// A supernode and its columns; `values` start at supernode `from`.
    fn target<'v>(&'v self, s: usize, from: usize, values: &'v mut [T]) -> (Target<'v, T>, &'v mut [T]) {
        let places = self.problem.symbolic.col_ptr_for_val();
        let (done, own) = values.split_at_mut(places[s] - places[from]);
        let columns = self.problem.symbolic.supernode_begin()[s]..self.problem.symbolic.supernode_end()[s];
        let pattern = self.problem.symbolic.supernode(s).pattern();
        let height = columns.len() + pattern.len();
        (
            Target { problem: self.problem, s, columns, pattern, height, done, from },
            &mut own[..places[s + 1] - places[s]],
        )
    }
}

/// A supernode that is being factorized.
struct Target<'a, T> {
    problem: &'a Problem<'a, T>,
    s: usize,
    columns: Range<usize>,
    /// The rows below the columns.
    pattern: &'a [usize],
    /// Number of entries of a column.
    height: usize,
    /// The values of the earlier supernodes, from supernode `from` on.
    done: &'a [T],
    from: usize,
}

impl<T: Scalar> Target<'_, T> {
    /// Stores the place of each of its rows.
    fn enter(&self, place_of: &mut [usize]) {
        for (&row, place) in self.pattern.iter().zip(self.columns.len()..) {
            place_of[row] = place;
        }
        for (row, place) in self.columns.clone().zip(0..) {
            place_of[row] = place;
        }
    }

    /// Whether a row has a place stored by [`enter`](Self::enter), which may belong to another supernode.
    fn is_row(&self, row: usize, place: usize) -> bool {
        match place.checked_sub(self.columns.len()) {
            None => self.columns.start + place == row,
            Some(below) => self.pattern.get(below) == Some(&row),
        }
    }

    /// Writes A and the updates by all earlier supernodes into the columns of a tile.
    fn update(&self, tile: usize, own: &mut [T], workspace: &mut Workspace<T>) {
        let start = self.columns.start + tile * TILE;
        let columns = start..start + own.len() / self.height;
        own.fill(T::zero());
        self.add_matrix(columns.clone(), own, &workspace.place_of);
        let symbolic = self.problem.symbolic;
        let places = symbolic.col_ptr_for_val();
        for update in self.problem.elimination.updates(self.s) {
            let pattern = symbolic.supernode(update.source).pattern();
            let within = &pattern[update.rows()];
            let first = update.rows().start + within.partition_point(|&row| row < columns.start);
            let width = pattern[first..update.rows().end].partition_point(|&row| row < columns.end);
            if width == 0 {
                continue;
            }
            let size = symbolic.supernode_end()[update.source] - symbolic.supernode_begin()[update.source];
            let values = &self.done[places[update.source] - places[self.from]..];
            let height = size + pattern.len();
            let source = MatRef::from_column_major_slice(&values[..height * size], height, size);
            let source = source.subrows(size + first, pattern.len() - first);
            self.subtract(source, &pattern[first..], width, columns.start, own, workspace);
        }
    }

    /// Adds the lower triangle of A. A is symmetric, so its columns are read as rows. An entry that is zero to
    /// rounding may have no partner across the diagonal, and then no place in the factor.
    fn add_matrix(&self, columns: Range<usize>, own: &mut [T], place_of: &[usize]) {
        let a = self.problem.a;
        for (column, own) in columns.zip(own.chunks_exact_mut(self.height)) {
            let dof = self.problem.order.map_or(column, |(dofs, _)| dofs[column]);
            for (&row, &value) in a.row_idx_of_col_raw(dof).iter().zip(a.val_of_col(dof)) {
                let row = self.problem.order.map_or(row, |(_, columns)| columns[row]);
                let place = place_of[row];
                if row >= column && self.is_row(row, place) {
                    own[place] += value;
                }
            }
        }
    }

    /// Subtracts the product of a supernode's `rows` with the first `width` of them, which are columns of the tile
    /// starting at column `start`.
    fn subtract(
        &self,
        source: MatRef<'_, T>,
        rows: &[usize],
        width: usize,
        start: usize,
        own: &mut [T],
        workspace: &mut Workspace<T>,
    ) {
        let Workspace { product, places, runs, place_of, .. } = workspace;
        let columns = source.subrows(0, width);
        for (begin, chunk) in (0..).step_by(ROWS).zip(rows.chunks(ROWS)) {
            let count = chunk.len();
            let product = &mut product[..count * width];
            let mut result = MatMut::from_column_major_slice_mut(product, count, width);
            let source = source.subrows(begin, count);
            let mut accumulate = Accum::Replace;
            for depth in (0..source.ncols()).step_by(DEPTH) {
                let depth = depth..source.ncols().min(depth + DEPTH);
                let (source, columns) = (slab(source, &depth), slab(columns, &depth));
                if begin == 0 && width >= TRIANGLE {
                    let (top, below) = result.rb_mut().split_at_row_mut(width);
                    lower_product(top, accumulate, columns, T::one());
                    let source = source.subrows(width, count - width);
                    matmul(below, accumulate, source, columns.transpose(), T::one(), Par::Seq);
                } else {
                    matmul(result.rb_mut(), accumulate, source, columns.transpose(), T::one(), Par::Seq);
                }
                accumulate = Accum::Add;
            }
            find_places(chunk, place_of, places, runs);
            let scattered = runs.len() * LONG > count;
            for ((j, &column), product) in rows[..width].iter().enumerate().zip(product.chunks_exact(count)) {
                let own = &mut own[(column - start) * self.height..][..self.height];
                // From the diagonal down.
                let above = j.saturating_sub(begin).min(count);
                if scattered {
                    for (&place, &x) in places[above..].iter().zip(&product[above..]) {
                        own[place] -= x;
                    }
                    continue;
                }
                for run in runs.iter().filter(|run| run.end > above) {
                    let begin = run.begin.max(above);
                    let (place, length) = (run.place + begin - run.begin, run.end - begin);
                    for (own, &x) in own[place..place + length].iter_mut().zip(&product[begin..run.end]) {
                        *own -= x;
                    }
                }
            }
        }
    }

    /// Factorizes the trapezoid, right-looking: panel by panel, each of which then updates the later columns.
    fn factorize(
        &self,
        own: &mut [T],
        threads: Threads,
        mut pivots: impl FnMut(MatMut<'_, T>) -> Result<(), usize>,
    ) -> Result<(), usize> {
        let (mut rest, mut first, size) = (own, 0, self.columns.len());
        while first < size {
            let width = PANEL.min(size - first);
            let (panel, behind) = rest.split_at_mut(width * self.height);
            let whole = MatMut::from_column_major_slice_mut(panel, self.height, width);
            let (mut top, below) = whole.subrows_mut(first, self.height - first).split_at_row_mut(width);
            pivots(top.rb_mut()).map_err(|pivot| self.columns.start + first + pivot)?;
            divide(threads, ROWS, top.rb(), below);
            first += width;
            let panel = MatRef::from_column_major_slice(panel, self.height, width);
            threads::each_chunk(threads, behind, TILE * self.height, &|tile, columns| {
                self.update_behind(panel, first + tile * TILE, columns);
            });
            rest = behind;
        }
        Ok(())
    }

    /// Subtracts the contribution of a panel to some later columns, the first of which is `first`.
    fn update_behind(&self, panel: MatRef<'_, T>, first: usize, columns: &mut [T]) {
        let width = columns.len() / self.height;
        let columns = MatMut::from_column_major_slice_mut(columns, self.height, width);
        let (top, below) = columns.subrows_mut(first, self.height - first).split_at_row_mut(width);
        let (on, under) = panel.subrows(first, self.height - first).split_at_row(width);
        lower_product(top, Accum::Add, on, -T::one());
        matmul(below, Accum::Add, under, on.transpose(), -T::one(), Par::Seq);
    }
}

/// Finds the places of the rows of a chunk in the present supernode.
fn find_places(rows: &[usize], place_of: &[usize], places: &mut Vec<usize>, runs: &mut Vec<Run>) {
    places.clear();
    places.extend(rows.iter().map(|&row| place_of[row]));
    runs.clear();
    for (k, &place) in places.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if run.place + (k - run.begin) == place => run.end = k + 1,
            _ => runs.push(Run { begin: k, end: k + 1, place }),
        }
    }
}
