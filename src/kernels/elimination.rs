//! The updates between supernodes of a factor, and the plan of a numeric factorization that processes branches of the
//! elimination forest in parallel.

use super::forest::supernode_parents;
use super::plan::{Plan, plan};
use crate::error::Result;
use crate::memory;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

/// Number of multiplications that deserves a thread of its own, about a millisecond.
const GRAIN: usize = 1 << 22;

/// The updates between supernodes, and the plan of the factorization.
#[derive(Debug)]
pub(crate) struct Elimination {
    /// The updates of each supernode, ascending, one list after the other.
    updates: Vec<Update>,
    first: Vec<usize>,
    /// Number of multiplications for each supernode.
    work: Vec<usize>,
    pub(super) plan: Plan,
}

/// The update of a later supernode by some rows of a source (times these rows and those below).
#[derive(Clone, Copy, Debug)]
pub(super) struct Update {
    pub(super) source: usize,
    /// The rows below the source that are columns of the updated supernode.
    first: usize,
    end: usize,
}

impl Update {
    pub(super) fn rows(&self) -> Range<usize> {
        self.first..self.end
    }
}

impl Elimination {
    pub(crate) fn new(symbolic: &SymbolicSupernodalCholesky<usize>) -> Result<Self> {
        let count = symbolic.n_supernodes();
        let size = |s: usize| symbolic.supernode_end()[s] - symbolic.supernode_begin()[s];
        let mut supernode_of = Vec::with_capacity(symbolic.nrows());
        (0..count).for_each(|s| supernode_of.extend(std::iter::repeat_n(s, size(s))));
        // Counted first, then listed.
        let mut first = vec![0; count + 1];
        let mut work: Vec<usize> =
            (0..count).map(|s| size(s) * size(s) * (size(s) / 3 + symbolic.supernode(s).pattern().len())).collect();
        for source in 0..count {
            let below = symbolic.supernode(source).pattern();
            for rows in of_one_supernode(below, &supernode_of) {
                let target = supernode_of[below[rows.start]];
                first[target + 1] += 1;
                work[target] += size(source) * rows.len() * (below.len() - rows.start);
            }
        }
        (0..count).for_each(|s| first[s + 1] += first[s]);
        let mut next = first.clone();
        let mut updates = memory::reserve(first[count], 1, "the updates of a sparse Cholesky factor")?;
        updates.resize(first[count], Update { source: 0, first: 0, end: 0 });
        for source in 0..count {
            let below = symbolic.supernode(source).pattern();
            for rows in of_one_supernode(below, &supernode_of) {
                let next = &mut next[supernode_of[below[rows.start]]];
                updates[*next] = Update { source, first: rows.start, end: rows.end };
                *next += 1;
            }
        }
        let plan = plan(&supernode_parents(symbolic, count), &work, GRAIN);
        Ok(Self { updates, first, work, plan })
    }

    /// The updates of a supernode.
    pub(super) fn updates(&self, s: usize) -> &[Update] {
        &self.updates[self.first[s]..self.first[s + 1]]
    }

    /// Whether a single supernode deserves several threads.
    pub(super) fn is_heavy(&self, s: usize) -> bool {
        self.work[s] >= GRAIN
    }
}

/// Groups of rows (ascending), each of which are columns of one supernode.
fn of_one_supernode(rows: &[usize], supernode_of: &[usize]) -> impl Iterator<Item = Range<usize>> {
    let mut begin = 0;
    rows.chunk_by(|&a, &b| supernode_of[a] == supernode_of[b]).map(move |group| {
        let range = begin..begin + group.len();
        begin = range.end;
        range
    })
}
