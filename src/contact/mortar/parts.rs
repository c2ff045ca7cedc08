//! What slave facets add to the rows of their corners, facet by facet, and rows as the sums of it.

use super::points::{Column, add};

/// Node by node what facets add: large surfaces have hundreds of megabytes of it, so that it is written once, and read
/// once by the rows.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// Nodes, and what they add to the rows of a facet's corners, in the order in which it was found.
    nodes: Vec<usize>,
    columns: Vec<[Column; 4]>,
    /// (node, place among the columns), ascending in each facet, and where those of each facet begin.
    sorted: Vec<(usize, usize)>,
    starts: Vec<usize>,
}

/// What is next of a facet that a row has something of: from where to where, and which of its corners is the row's.
type Head = (usize, usize, usize);

impl Parts {
    pub(super) fn clear(&mut self) {
        self.nodes.clear();
        self.columns.clear();
        self.sorted.clear();
        self.starts.clear();
        self.starts.push(0);
    }

    /// Adds what a node adds to the rows of the present facet's corners.
    pub(super) fn push(&mut self, node: usize, columns: [Column; 4]) {
        self.nodes.push(node);
        self.columns.push(columns);
    }

    /// All that the present facet adds so far.
    pub(super) fn of_facet_mut(&mut self) -> &mut [[Column; 4]] {
        let begin = self.sorted.len();
        &mut self.columns[begin..]
    }

    /// Goes on to the next facet.
    pub(super) fn end_facet(&mut self) {
        let begin = self.sorted.len();
        self.sorted.extend((begin..).zip(&self.nodes[begin..]).map(|(place, &node)| (node, place)));
        self.sorted[begin..].sort_unstable();
        self.starts.push(self.sorted.len());
    }

    /// Calls `act` with the nodes of a row, ascending, and what the facets around its node add, given with the corner
    /// that it is of each, summed in the order in which it was found.
    pub(super) fn each_of_row(
        &self,
        around: &[(usize, usize)],
        heads: &mut Vec<Head>,
        mut act: impl FnMut(usize, Column),
    ) {
        heads.clear();
        heads.extend(around.iter().map(|&(facet, corner)| (self.starts[facet], self.starts[facet + 1], corner)));
        loop {
            let next = heads.iter().filter(|(next, end, _)| next < end).map(|&(next, ..)| self.sorted[next].0);
            let Some(node) = next.min() else { return };
            let mut sum: Option<Column> = None;
            for (next, end, corner) in &mut *heads {
                while next < end && self.sorted[*next].0 == node {
                    let column = &self.columns[self.sorted[*next].1][*corner];
                    match &mut sum {
                        Some(sum) => add(sum, column),
                        None => sum = Some(*column),
                    }
                    *next += 1;
                }
            }
            sum.into_iter().for_each(|sum| act(node, sum));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_the_sums_of_their_facets() {
        let mut parts = Parts::default();
        parts.clear();
        let column = |value: f64| [value; 8];
        // Two facets with nothing between them; the second one has node 3 twice.
        for entries in [&[(7, 1.0), (2, 2.0)][..], &[], &[(3, 10.0), (7, 20.0), (3, 40.0)]] {
            for &(node, value) in entries {
                parts.push(node, [value, 100.0 * value, 0.0, 0.0].map(column));
            }
            parts.end_facet();
        }
        let row = |around: &[(usize, usize)]| {
            let (mut found, mut heads) = (Vec::new(), Vec::new());
            parts.each_of_row(around, &mut heads, |node, column| found.push((node, column[6])));
            found
        };
        assert_eq!(row(&[(0, 1), (1, 0), (2, 0)]), [(2, 200.0), (3, 50.0), (7, 120.0)]);
        assert_eq!(row(&[(2, 1)]), [(3, 5000.0), (7, 2000.0)]);
        assert_eq!(row(&[(1, 0)]), []);
    }
}
