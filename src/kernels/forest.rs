//! The elimination forest of a supernodal factor: the supernodes between which a sweep passes values, and the
//! branches that may be swept in parallel.
//!
//! Each supernode has a work vector: its own rows, then the rows below. Values pass only between a supernode and its
//! parent: forward, a supernode adds the contributions of its children; backward, it passes its children the solution
//! on the rows below them (Duff and Reid, ACM Trans. Math. Softw. 9, 1983). Branches without a common supernode may
//! therefore be swept at the same time. All sums and their order depend only on the factor: results are bitwise the
//! same on any number of threads.

use super::plan::{Plan, plan};
use crate::error::Result;
use crate::memory;
use crate::threads::GRAIN;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

/// The supernodes of the interior, and their trees.
#[derive(Debug)]
pub struct Forest {
    /// The first column that is not in the forest.
    pub(crate) end: usize,
    /// Start of the work vector of each supernode, and the end of the last.
    pub(crate) offsets: Vec<usize>,
    /// The children of each supernode, ascending, one list after the other.
    children: Vec<usize>,
    first_child: Vec<usize>,
    /// For each row below a supernode, its place in the work vector of the parent; for a root, its distance from
    /// `end`.
    places: Vec<usize>,
    /// The first column of each supernode, and `end`.
    begins: Vec<usize>,
    /// Supernodes without a parent in the forest, ascending.
    pub(crate) roots: Vec<usize>,
    pub(crate) plan: Plan,
}

impl Forest {
    /// The supernodes whose columns all precede `interior`.
    pub(crate) fn new(symbolic: &SymbolicSupernodalCholesky<usize>, interior: usize) -> Result<Self> {
        let count = symbolic.supernode_end().partition_point(|&end| end <= interior);
        let mut begins = symbolic.supernode_begin()[..count].to_vec();
        let end = count.checked_sub(1).map_or(0, |last| symbolic.supernode_end()[last]);
        begins.push(end);
        let mut offsets = vec![0];
        for s in 0..count {
            offsets.push(offsets[s] + begins[s + 1] - begins[s] + symbolic.supernode(s).pattern().len());
        }
        let parents = supernode_parents(symbolic, count);
        let (children, first_child) = lists(&parents);
        let mut forest = Self {
            end,
            children,
            first_child,
            places: Vec::new(),
            begins,
            roots: (0..count).filter(|&s| parents[s] == count).collect(),
            plan: Plan::Serial(0..count),
            offsets,
        };
        forest.places = forest.places_in_parents(symbolic, &parents)?;
        let reads: Vec<usize> = (0..count).map(|s| forest.reads(s)).collect();
        forest.plan = plan(&parents, &reads, GRAIN);
        Ok(forest)
    }

    fn places_in_parents(&self, symbolic: &SymbolicSupernodalCholesky<usize>, parents: &[usize]) -> Result<Vec<usize>> {
        let size = self.offsets[parents.len()] - self.end;
        let mut places = memory::reserve(size, 1, "the sweeps of a sparse Cholesky factor")?;
        places.resize(size, 0);
        let mut place_of = vec![0; symbolic.nrows()];
        for parent in 0..parents.len() {
            let size = self.size(parent);
            for (row, place) in (self.begins[parent]..self.begins[parent + 1]).zip(0..) {
                place_of[row] = place;
            }
            for (&row, place) in symbolic.supernode(parent).pattern().iter().zip(size..) {
                place_of[row] = place;
            }
            for &child in self.children(parent) {
                for (place, row) in places[self.below(child)].iter_mut().zip(symbolic.supernode(child).pattern()) {
                    *place = place_of[*row];
                }
            }
        }
        for &root in &self.roots {
            for (place, row) in places[self.below(root)].iter_mut().zip(symbolic.supernode(root).pattern()) {
                *place = row - self.end;
            }
        }
        Ok(places)
    }

    /// Total number of scalars in the work vectors.
    pub(crate) fn work(&self) -> usize {
        self.offsets.last().copied().unwrap_or(0)
    }

    /// The number of supernodes.
    pub(crate) fn count(&self) -> usize {
        self.begins.len() - 1
    }

    /// The range of the rows below a supernode in the array of all work vectors.
    #[inline]
    pub(crate) fn update(&self, s: usize) -> Range<usize> {
        self.offsets[s] + self.size(s)..self.offsets[s + 1]
    }

    /// The columns of a supernode.
    #[inline]
    pub(crate) fn columns(&self, s: usize) -> Range<usize> {
        self.begins[s]..self.begins[s + 1]
    }

    /// Number of columns of a supernode.
    #[inline]
    pub(crate) fn size(&self, s: usize) -> usize {
        self.begins[s + 1] - self.begins[s]
    }

    #[inline]
    pub(crate) fn children(&self, s: usize) -> &[usize] {
        &self.children[self.first_child[s]..self.first_child[s + 1]]
    }

    /// Places of the rows below a supernode in the work vector of its parent; for a root, their distances from `end`.
    #[inline]
    pub(crate) fn places(&self, s: usize) -> &[usize] {
        &self.places[self.below(s)]
    }

    #[inline]
    fn below(&self, s: usize) -> Range<usize> {
        self.offsets[s] - self.begins[s]..self.offsets[s + 1] - self.begins[s + 1]
    }

    /// Number of scalars that a sweep reads from a supernode.
    fn reads(&self, s: usize) -> usize {
        self.size(s) * (self.offsets[s + 1] - self.offsets[s])
    }
}

/// The parent of each of the first `count` supernodes; `count` if it is not among them.
pub(super) fn supernode_parents(symbolic: &SymbolicSupernodalCholesky<usize>, count: usize) -> Vec<usize> {
    let ends = &symbolic.supernode_end()[..count];
    let parent =
        |s: usize| symbolic.supernode(s).pattern().iter().min().map(|row| ends.partition_point(|end| end <= row));
    (0..count).map(|s| parent(s).unwrap_or(count)).collect()
}

/// The children of each parent, and the start of each list; a parent out of range has no list.
fn lists(parents: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let count = parents.len();
    let mut first = vec![0; count + 1];
    for &parent in parents.iter().filter(|parent| **parent < count) {
        first[parent + 1] += 1;
    }
    for s in 0..count {
        first[s + 1] += first[s];
    }
    let mut next = first.clone();
    let mut children = vec![0; first[count]];
    for (s, &parent) in parents.iter().enumerate().filter(|(_, parent)| **parent < count) {
        children[next[parent]] = s;
        next[parent] += 1;
    }
    (children, first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_solver::Ordering;
    use crate::linear_solver::ordering::symbolic_cholesky;
    use faer::sparse::linalg::cholesky::{SymbolicCholesky, SymbolicCholeskyRaw};
    use faer::sparse::{SparseColMat, Triplet};

    /// The factor of a grid with 27 neighbors per vertex, with the dofs of one edge last.
    fn grid(sides: [usize; 3], ordering: &Ordering) -> (SymbolicCholesky<usize>, usize) {
        let n = sides.iter().product();
        let place = |dof: usize| [dof % sides[0], dof / sides[0] % sides[1], dof / (sides[0] * sides[1])];
        let near = |i: usize, j: usize| place(i).iter().zip(place(j)).all(|(a, b)| a.abs_diff(b) <= 1);
        let reach = 1 + sides[0] + sides[0] * sides[1];
        let entries = (0..n).flat_map(|j| (j.saturating_sub(reach)..n.min(j + reach + 1)).map(move |i| (i, j)));
        let entries: Vec<_> = entries.filter(|&(i, j)| near(i, j)).map(|(i, j)| Triplet::new(i, j, 1.0)).collect();
        let a = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries).unwrap();
        let last: Vec<usize> = (0..sides[0]).collect();
        (symbolic_cholesky(ordering, a.symbolic(), &last).unwrap(), n - last.len())
    }

    /// The order of a plan on one thread, and the number of forks; checks that no branch has children in another.
    fn flatten(plan: &Plan, forest: &Forest, order: &mut Vec<usize>) -> usize {
        match plan {
            Plan::Serial(range) => {
                order.extend(range.clone());
                0
            }
            Plan::Stem(branch, stem) => {
                let forks = flatten(branch, forest, order);
                order.extend(stem.clone());
                forks
            }
            Plan::Fork(branches, cut) => {
                let begin = order.len();
                let mut forks = 1 + flatten(&branches[0], forest, order);
                assert_eq!(order.len(), *cut);
                forks += flatten(&branches[1], forest, order);
                for branch in [begin..*cut, *cut..order.len()] {
                    let closed = |s: usize| forest.children(s).iter().all(|child| branch.contains(child));
                    assert!(branch.clone().all(closed), "{branch:?}");
                    assert!(branch.map(|s| forest.reads(s)).sum::<usize>() >= GRAIN);
                }
                forks
            }
        }
    }

    #[test]
    fn plans_visit_every_supernode_once_after_its_children() {
        for (sides, ordering, forks) in [
            ([22, 22, 22], Ordering::NestedDissection, 1),
            ([30, 30, 15], Ordering::NestedDissection, 3),
            ([20, 20, 20], Ordering::MinimumDegree, 0),
            ([14, 14, 14], Ordering::NestedDissection, 0),
        ] {
            let (symbolic, interior) = grid(sides, &ordering);
            let SymbolicCholeskyRaw::Supernodal(raw) = symbolic.raw() else { panic!("a solid") };
            let forest = Forest::new(raw, interior).unwrap();
            assert!(forest.end <= interior && forest.count() > 1);
            let mut order = Vec::new();
            let found = flatten(&forest.plan, &forest, &mut order);
            assert!(order.into_iter().eq(0..forest.count()));
            assert!(found >= forks, "{sides:?}: {found} forks");
        }
    }

    #[test]
    fn rows_find_their_places_in_the_parent() {
        let (symbolic, interior) = grid([15, 14, 13], &Ordering::NestedDissection);
        let SymbolicCholeskyRaw::Supernodal(raw) = symbolic.raw() else { panic!("a solid") };
        let forest = Forest::new(raw, interior).unwrap();
        let mut seen = 0;
        for parent in 0..forest.count() {
            let rows: Vec<usize> =
                forest.columns(parent).chain(raw.supernode(parent).pattern().iter().copied()).collect();
            for &child in forest.children(parent) {
                assert!(child < parent);
                let places = forest.places(child).iter().map(|&place| rows[place]);
                assert!(places.eq(raw.supernode(child).pattern().iter().copied()), "{child} in {parent}");
                seen += 1;
            }
        }
        for &root in &forest.roots {
            let rows = forest.places(root).iter().map(|place| place + forest.end);
            assert!(rows.eq(raw.supernode(root).pattern().iter().copied()));
        }
        assert_eq!(seen + forest.roots.len(), forest.count());
    }
}
