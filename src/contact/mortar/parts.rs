//! What slave facets add to the rows of their corners, facet by facet, and rows as the sums of it.

use super::points::{Column, add};

/// Node by node what facets add: large surfaces have hundreds of megabytes of it, so that it is written once, in the
/// order in which rows read it.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// Of the present facet: nodes, and what they add to the rows of its corners, in the order in which it was found.
    present: Vec<(usize, [Column; 4])>,
    sorted: Vec<(usize, usize)>,
    /// Facet by facet the nodes, ascending, and where those of each facet begin.
    nodes: Vec<usize>,
    starts: Vec<usize>,
    /// Facet by facet and corner by corner what these nodes add, and where those of each facet begin.
    columns: Vec<Column>,
    blocks: Vec<usize>,
}

/// What is next of a facet that a row has something of: the place of the node, the end of the facet's nodes, and the
/// place of the column.
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

    /// Adds what a node adds to the rows of the present facet's corners.
    pub(super) fn push(&mut self, node: usize, columns: [Column; 4]) {
        self.present.push((node, columns));
    }

    /// All that the present facet adds so far.
    pub(super) fn of_facet_mut(&mut self) -> impl Iterator<Item = &mut [Column; 4]> {
        self.present.iter_mut().map(|(_, columns)| columns)
    }

    /// Goes on to the next facet, the present one having so many corners.
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

    /// Calls `act` with the nodes of a row, ascending, and what the facets around its node add, given with the corner
    /// that it is of each, summed in the order in which it was found.
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
        // Two facets with nothing between them; the second one has node 3 twice.
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
