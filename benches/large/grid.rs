//! Blocks of equal cubes, assembled without a list of triplets: a million dofs take a gigabyte.

use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMat};
use contact_dynamics_scenes::solids::{Material, Solid};

/// A block of cubes with a corner in the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub(crate) cells: [usize; 3],
    /// Side of a cube.
    pub(crate) size: f64,
    pub(crate) material: Material,
}

impl Grid {
    /// Nodes along each axis.
    fn nodes_along(&self) -> [usize; 3] {
        self.cells.map(|cells| cells + 1)
    }

    pub(crate) fn dofs(&self) -> usize {
        3 * self.nodes_along().iter().product::<usize>()
    }

    /// The number of a node; along the last axis numbers follow each other.
    pub(crate) fn node(&self, [i, j, k]: [usize; 3]) -> usize {
        let [_, y, z] = self.nodes_along();
        k + z * (j + y * i)
    }

    /// Places of all nodes in the grid, in the order of their numbers.
    pub(crate) fn places(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [x, y, z] = self.nodes_along();
        (0..x).flat_map(move |i| (0..y).flat_map(move |j| (0..z).map(move |k| [i, j, k])))
    }

    /// Places of the nodes at the bottom.
    pub(crate) fn bottom(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        self.places().filter(|place| place[2] == 0)
    }

    /// Cells that have all of some corners, each given by offsets of 0 or 1 along the axes: the cells around a place,
    /// by the offset of this place in them.
    fn cells_around(&self, place: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
        let cells = self.cells;
        (0..8).map(|corner| [corner >> 2, corner >> 1 & 1, corner & 1]).filter(move |corner| {
            (0..3).all(|axis| place[axis] >= corner[axis] && place[axis] - corner[axis] < cells[axis])
        })
    }

    /// Lumped masses.
    pub(crate) fn mass(&self) -> Vec<f64> {
        let corner = self.material.density * self.size.powi(3) / 8.0;
        self.places().flat_map(|place| [corner * self.cells_around(place).count() as f64; 3]).collect()
    }

    pub(crate) fn stiffness(&self) -> SparseColMat<usize, f64> {
        self.stack(1)
    }

    /// The stiffness of so many of these blocks, one after the other.
    pub(crate) fn stack(&self, blocks: usize) -> SparseColMat<usize, f64> {
        let cube = Solid::<3>::block([self.size; 3], [1, 1, 1], self.material);
        let corner = |place: [usize; 3]| {
            let at =
                |x: &[f64; 3]| (0..3).all(|axis| (x[axis] - self.size * place[axis] as f64).abs() < 0.1 * self.size);
            cube.nodes.iter().position(at).expect("a corner of a cube")
        };
        let corners: Vec<usize> = (0..8).map(|c| corner([c >> 2, c >> 1 & 1, c & 1])).collect();
        let of_cube = cube.stiffness::<f64>();
        let mut dense = [[0.0; 24]; 24];
        for (column, entries) in dense.iter_mut().enumerate() {
            for (row, value) in of_cube.row_idx_of_col(column).zip(of_cube.val_of_col(column)) {
                entries[row] = *value;
            }
        }
        let entry =
            |[row, column]: [usize; 2], [i, j]: [usize; 2]| dense[3 * corners[column] + j][3 * corners[row] + i];

        let dofs = self.dofs();
        let ([x, y, z], entries) = (self.nodes_along(), 81 * dofs * blocks);
        let (mut pointers, mut rows, mut values) = (vec![0], Vec::with_capacity(entries), Vec::with_capacity(entries));
        for place in self.places() {
            let near = |axis: usize, nodes: usize| place[axis].saturating_sub(1)..(place[axis] + 2).min(nodes);
            for axis in 0..3 {
                for other in near(0, x).flat_map(|i| near(1, y).flat_map(move |j| near(2, z).map(move |k| [i, j, k]))) {
                    let mut block = [0.0; 3];
                    for own in self.cells_around(place) {
                        // The corner of the other place in the cell in which this place is corner `own`.
                        let offset: [Option<usize>; 3] =
                            std::array::from_fn(|axis| (other[axis] + own[axis]).checked_sub(place[axis]));
                        let [Some(i), Some(j), Some(k)] = offset else { continue };
                        if i.max(j).max(k) < 2 {
                            let pair = [4 * i + 2 * j + k, 4 * own[0] + 2 * own[1] + own[2]];
                            for (row, value) in block.iter_mut().enumerate() {
                                *value += entry(pair, [row, axis]);
                            }
                        }
                    }
                    rows.extend((0..3).map(|row| 3 * self.node(other) + row));
                    values.extend(block);
                }
                pointers.push(rows.len());
            }
        }
        let (columns, own) = (pointers.len(), rows.len());
        for block in 1..blocks {
            pointers.extend_from_within(1..columns);
            pointers[block * dofs + 1..].iter_mut().for_each(|pointer| *pointer += block * own);
            rows.extend_from_within(..own);
            rows[block * own..].iter_mut().for_each(|row| *row += block * dofs);
            values.extend_from_within(..own);
        }
        rows.shrink_to_fit();
        values.shrink_to_fit();
        let dofs = blocks * dofs;
        SparseColMat::new(SymbolicSparseColMat::new_checked(dofs, dofs, pointers, None, rows), values)
    }
}
