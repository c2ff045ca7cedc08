//! Contributions of slave facets to the rows of their corners, and rows as the sums over facets.

use super::points::{Column, add};

/// Contributions of facets, by node. Large surfaces have hundreds of megabytes of them, so they are written once, in
/// the order in which rows read them.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// For the present facet: nodes, and their contributions to the rows of its corners, in the order of the
    /// integration.
    present: Vec<(usize, [Column; 4])>,
    sorted: Vec<(usize, usize)>,
    /// For each facet the nodes, ascending, and the first entry of each facet.
    nodes: Vec<usize>,
    starts: Vec<usize>,
    /// For each facet and corner the contributions of these nodes, and the first entry of each facet.
    columns: Vec<Column>,
    blocks: Vec<usize>,
}

/// Read positions of a row in one of its facets: the next node, the end of the facet's nodes, and the next column.
type Head = [usize; 3];

impl Parts {
    pub(super) fn clear(&mut self) {
        self.present.clear();
        self.nodes.clear();
        self.columns.clear();
        self.starts.clear();
        self.starts.push(0);
        self.blocks.clear();
    }

    /// Appends the contribution of a node to the rows of the present facet's corners.
    pub(super) fn push(&mut self, node: usize, columns: [Column; 4]) {
        self.present.push((node, columns));
    }

    /// All contributions of the present facet so far.
    pub(super) fn of_facet_mut(&mut self) -> impl Iterator<Item = &mut [Column; 4]> {
        self.present.iter_mut().map(|(_, columns)| columns)
    }

    /// Ends the present facet, which has this number of corners.
    pub(super) fn end_facet(&mut self, corners: usize) {
        let Self { present, sorted, nodes, starts, columns, blocks } = self;
        sorted.clear();
        sorted.extend(present.iter().enumerate().map(|(place, &(node, _))| (node, place)));
        sorted.sort_unstable();
        nodes.extend(sorted.iter().map(|&(node, _)| node));
        starts.push(nodes.len());
        blocks.push(columns.len());
        for corner in 0..corners {
            columns.extend(sorted.iter().map(|&(_, place)| present[place].1[corner]));
        }
        present.clear();
    }

    /// Calls `act` with the nodes of a row, ascending, and the sum of the contributions of the facets `around` its
    /// node, which are given with their corner at this node.
    pub(super) fn each_of_row(
        &self,
        around: &[(usize, usize)],
        heads: &mut Vec<Head>,
        mut act: impl FnMut(usize, &Column),
    ) {
        heads.clear();
        heads.extend(around.iter().map(|&(facet, corner)| {
            let [begin, end] = [self.starts[facet], self.starts[facet + 1]];
            [begin, end, self.blocks[facet] + corner * (end - begin)]
        }));
        loop {
            let next = heads.iter().filter(|[next, end, _]| next < end).map(|&[next, ..]| self.nodes[next]);
            let Some(node) = next.min() else { return };
            let mut sum: Option<Column> = None;
            for [next, end, column] in &mut *heads {
                while next < end && self.nodes[*next] == node {
                    match &mut sum {
                        Some(sum) => add(sum, &self.columns[*column]),
                        None => sum = Some(self.columns[*column]),
                    }
                    *next += 1;
                    *column += 1;
                }
            }
            if let Some(sum) = &sum {
                act(node, sum);
            }
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
        // Three facets: the second one is empty, and the third one has node 3 twice.
        for entries in [&[(7, 1.0), (2, 2.0)][..], &[], &[(3, 10.0), (7, 20.0), (3, 40.0)]] {
            for &(node, value) in entries {
                parts.push(node, [value, 100.0 * value, 0.0, 0.0].map(column));
            }
            parts.end_facet(2);
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
