//! Which branches of an elimination forest may be visited in parallel, cut into similar amounts of work for threads.

use std::ops::Range;

/// The order of a visit: upward from the branches to the stem, downward from the stem to the branches.
#[derive(Debug)]
pub(crate) enum Plan {
    /// Supernodes in sequence.
    Serial(Range<usize>),
    /// A branch (all supernodes before the stem), then the stem: supernodes in sequence, each of which several
    /// threads may share.
    Stem(Box<Plan>, Range<usize>),
    /// Two branches without a common supernode; the second one starts with this supernode.
    Fork(Box<[Plan; 2]>, usize),
}

/// A plan for all supernodes, given the parent of each (out of range for a root) and its weight. Branches lighter
/// than `grain` are not cut off.
pub(super) fn plan(parents: &[usize], weights: &[usize], grain: usize) -> Plan {
    Planner::new(parents, weights, grain).plan(0..parents.len())
}

/// Cuts a forest into branches.
struct Planner<'f> {
    parents: &'f [usize],
    /// Total weight of the supernodes before each one.
    weight_before: Vec<usize>,
    /// For each supernode the first one of its branch if the branch is contiguous, otherwise `None`.
    first: Vec<Option<usize>>,
    /// The least weight that deserves a thread of its own.
    grain: usize,
}

impl<'f> Planner<'f> {
    fn new(parents: &'f [usize], weights: &[usize], grain: usize) -> Self {
        let mut weight_before = vec![0];
        let (mut first, mut members): (Vec<usize>, Vec<usize>) = (0..parents.len()).map(|s| (s, 1)).unzip();
        for s in 0..parents.len() {
            weight_before.push(weight_before[s] + weights[s]);
            let parent = parents[s];
            if parent < parents.len() {
                first[parent] = first[parent].min(first[s]);
                members[parent] += members[s];
            }
        }
        let whole = |s: usize| (s + 1 - first[s] == members[s]).then_some(first[s]);
        Self { parents, weight_before, first: (0..parents.len()).map(whole).collect(), grain }
    }

    fn weight(&self, range: &Range<usize>) -> usize {
        self.weight_before[range.end] - self.weight_before[range.start]
    }

    /// A plan for a range that is a forest of its own.
    fn plan(&self, range: Range<usize>) -> Plan {
        if self.weight(&range) < 2 * self.grain {
            return Plan::Serial(range);
        }
        // The stem: the root while only one tree is left, and trees too light for a thread.
        let mut end = range.end;
        while let Some(first) = end.checked_sub(1).filter(|last| *last >= range.start).and_then(|last| self.first[last])
        {
            match first {
                first if first <= range.start => end -= 1,
                first if self.weight(&(first..end)) < self.grain => end = first,
                _ => break,
            }
        }
        let branches = range.start..end;
        let plan = match self.cut(&branches) {
            Some(cut) => Plan::Fork(Box::new([self.plan(range.start..cut), self.plan(cut..end)]), cut),
            None => return Plan::Stem(Box::new(Plan::Serial(range.start..range.start)), range),
        };
        if end == range.end { plan } else { Plan::Stem(Box::new(plan), end..range.end) }
    }

    /// The supernode that splits a forest into two of similar weight, both heavy enough for a thread.
    fn cut(&self, range: &Range<usize>) -> Option<usize> {
        // From the last tree to the first.
        let (mut cuts, mut end) = (Vec::new(), range.end);
        while end > range.start {
            // A tree that is not contiguous ends the search: it cannot be separated from earlier trees.
            let Some(first) = self.first[end - 1].filter(|first| *first >= range.start) else { break };
            cuts.push(first);
            end = first;
        }
        let lighter = |&cut: &usize| self.weight(&(range.start..cut)).min(self.weight(&(cut..range.end)));
        debug_assert!(cuts.iter().all(|&cut| (range.start..cut).all(|s| !(cut..range.end).contains(&self.parents[s]))));
        cuts.into_iter().max_by_key(lighter).filter(|cut| lighter(cut) >= self.grain)
    }
}
