//! Groups of rows that share dofs, directly or through other rows. If forces move only the dofs on which they act,
//! groups are independent and are solved one by one.

use std::ops::Range;

#[derive(Clone, Debug, Default)]
pub(crate) struct Groups {
    /// Positions in the list of rows, group after group. They ascend within a group; so do the first positions of the
    /// groups.
    positions: Vec<usize>,
    starts: Vec<usize>,
    /// For each position an earlier one of its group, or itself if it is the first of the group.
    leader: Vec<usize>,
    /// For each dof a position that acts on it; `FREE` outside of `sort`.
    owner: Vec<usize>,
    /// Work space of `sort`: the group of each position, and the next free entry of each group.
    place: Vec<usize>,
    next: Vec<usize>,
}

/// A dof that no row has claimed.
const FREE: usize = usize::MAX;

impl Groups {
    /// Groups rows by the dofs (below `dofs`) on which they act. A row that is tied to the one before it in the list
    /// is in the group of that row, whatever its dofs.
    pub(crate) fn sort<D: Iterator<Item = usize>>(
        &mut self,
        rows: &[usize],
        dofs: usize,
        is_tied: impl Fn(usize) -> bool,
        acts_on: impl Fn(usize) -> D,
    ) {
        let Self { positions, starts, leader, owner, place, next } = self;
        if owner.len() < dofs {
            owner.resize(dofs, FREE);
        }
        leader.clear();
        leader.extend(0..rows.len());
        for (position, &row) in rows.iter().enumerate() {
            if position > 0 && is_tied(row) {
                join(leader, position - 1, position);
            }
            for dof in acts_on(row) {
                match owner[dof] {
                    FREE => owner[dof] = position,
                    other => join(leader, other, position),
                }
            }
        }
        for &row in rows {
            acts_on(row).for_each(|dof| owner[dof] = FREE);
        }
        // Counted, then laid out, groups in the order of their first rows.
        starts.clear();
        starts.push(0);
        // (All of it is written before it is read.)
        place.resize(rows.len(), 0);
        for position in 0..rows.len() {
            let first = find(leader, position);
            if first == position {
                place[position] = starts.len() - 1;
                starts.push(0);
            } else {
                place[position] = place[first];
            }
            starts[place[position] + 1] += 1;
        }
        for group in 1..starts.len() {
            starts[group] += starts[group - 1];
        }
        positions.resize(rows.len(), 0);
        next.clear();
        next.extend_from_slice(starts);
        for (position, &group) in place.iter().enumerate() {
            positions[next[group]] = position;
            next[group] += 1;
        }
    }

    /// All rows in one group.
    pub(crate) fn together(&mut self, rows: usize) {
        self.positions.clear();
        self.positions.extend(0..rows);
        self.starts.clear();
        self.starts.push(0);
        if rows > 0 {
            self.starts.push(rows);
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The positions of all groups, one group after the other.
    pub(crate) fn positions(&self) -> &[usize] {
        &self.positions
    }

    /// The range of a group in [`positions`](Self::positions).
    pub(crate) fn range(&self, group: usize) -> Range<usize> {
        self.starts[group]..self.starts[group + 1]
    }

    /// The positions of a group in the list of rows, ascending.
    pub(crate) fn group(&self, group: usize) -> &[usize] {
        &self.positions[self.range(group)]
    }
}

/// The first position of a group.
fn find(leader: &mut [usize], mut position: usize) -> usize {
    while leader[position] != position {
        leader[position] = leader[leader[position]];
        position = leader[position];
    }
    position
}

/// Merges two groups; the earlier first position leads.
fn join(leader: &mut [usize], one: usize, other: usize) {
    let (one, other) = (find(leader, one), find(leader, other));
    leader[one.max(other)] = one.min(other);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_share_dofs_are_together() {
        let dofs: [&[usize]; 5] = [&[0, 1], &[7], &[2, 3], &[3, 0], &[5]];
        let acts_on = |row: usize| dofs[row].iter().copied();
        let mut groups = Groups::default();
        groups.sort(&[0, 1, 2, 3, 4], 10, |_| false, acts_on);
        let found: Vec<&[usize]> = (0..groups.len()).map(|k| groups.group(k)).collect();
        assert_eq!(found, [&[0, 2, 3][..], &[1], &[4]]);
        // Without the row that ties them; positions count in the list given.
        groups.sort(&[0, 2, 4], 10, |_| false, acts_on);
        let found: Vec<&[usize]> = (0..groups.len()).map(|k| groups.group(k)).collect();
        assert_eq!(found, [[0], [1], [2]]);
        // Row 4 belongs to the contact before it.
        groups.sort(&[0, 1, 4, 2], 10, |row| row == 4, acts_on);
        let found: Vec<&[usize]> = (0..groups.len()).map(|k| groups.group(k)).collect();
        assert_eq!(found, [&[0][..], &[1, 2], &[3]]);
        groups.together(2);
        assert_eq!((groups.len(), groups.group(0)), (1, &[0, 1][..]));
        groups.together(0);
        assert_eq!(groups.len(), 0);
    }
}
