//! The coarse space of a scaled matrix in blocks, 1 + L + Lᵀ = C⁻¹ A C⁻ᵀ.

use super::Matrix;
use crate::error::{Error, Result};
use crate::kernels::conjugate_gradients::{self, Blocks};
use crate::linear_solver::coarse_space::{Aggregates, CoarseSpace, Nodes, Rows};
use crate::memory;
use crate::real::Real;
use faer::sparse::SparseColMatRef;

/// The space, and (1 + Lᵀ) Z.
#[derive(Debug)]
pub(super) struct Deflation<T: Real> {
    space: CoarseSpace<T>,
    upper: Rows<T>,
    /// Why a solve has no result.
    failure: Option<Error>,
}

/// The aggregate of each row of blocks, and the node at each place in their order.
#[derive(Debug)]
pub(super) struct Places {
    aggregates: Aggregates,
    nodes: Vec<usize>,
}

/// A lower triangular block from its inverse, both column by column, transposed.
fn transposed_factor<T: Real>(size: usize, inverse: &[T], block: &mut [T]) {
    for c in 0..size {
        for r in 0..size {
            let before: T = (c..r).map(|k| inverse[k * size + r] * block[k * size + c]).sum();
            let right = if r == c { T::one() } else { T::zero() };
            // Entry (r, c) of the factor is entry (c, r) of the block.
            block[r * size + c] = if r < c { T::zero() } else { (right - before) / inverse[r * size + r] };
        }
    }
}

impl<T: Real> Matrix<T> {
    /// Makes the coarse space anew, for a matrix that has been scaled.
    pub(super) fn deflate(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let Self { size, parts, pointers, columns, values, scaling, places, .. } = self;
        let (size, count) = (*size, pointers.len() - 1);
        let places = match places {
            Some(places) => places,
            none => {
                let mut nodes = memory::zeros(count, 1, "the order of nodes")?;
                (0..count).for_each(|node| nodes[parts.place(node)] = node);
                none.insert(Places { aggregates: Aggregates::find(a, size, std::iter::empty())?, nodes })
            }
        };
        if places.aggregates.count < 2 {
            self.deflation = None;
            return Ok(());
        }
        let aggregate = |place: usize| places.aggregates.of(places.nodes[place]);
        let near = |place: usize| {
            let node = places.nodes[place];
            let dofs = node * size..(node + 1) * size;
            dofs.flat_map(|dof| a.row_idx_of_col_raw(dof)).map(|other| parts.place(other / size)).chain([place])
        };
        let identity: Vec<T> =
            (0..size * size).map(|at| if at % (size + 1) == 0 { T::one() } else { T::zero() }).collect();
        let lower = Blocks { pointers, columns, values };
        let couplings = |has_lower: bool, each: &mut dyn FnMut(usize, usize, &[T])| {
            let mut transposed = identity.clone();
            for row in 0..count {
                each(row, row, &identity);
                for at in lower.pointers[row]..lower.pointers[row + 1] {
                    let (column, block) =
                        (lower.columns[at] as usize, &lower.values[at * size * size..][..size * size]);
                    for c in 0..size {
                        for r in 0..size {
                            transposed[r * size + c] = block[c * size + r];
                        }
                    }
                    if has_lower {
                        each(row, column, block);
                    }
                    each(column, row, &transposed);
                }
            }
        };
        let nodes = Nodes { size, count, aggregate: &aggregate };
        let z = |place: usize, block: &mut [T]| transposed_factor(size, &scaling[place * size * size..], block);
        self.deflation = match CoarseSpace::new(&nodes, near, z, |each| couplings(true, each))? {
            Some(space) => {
                let upper = space.product(&nodes, |each| couplings(false, each))?;
                Some(Deflation { space, upper, failure: None })
            }
            None => None,
        };
        Ok(())
    }
}

impl<T: Real> Deflation<T> {
    /// Why the last solve has no result, if it failed.
    pub(super) fn failure(&mut self) -> Option<Error> {
        self.failure.take()
    }

    pub(super) fn stored_values(&self) -> usize {
        self.space.stored_values() + self.upper.stored_values()
    }
}

impl<T: Real> conjugate_gradients::Deflation<T> for Deflation<T> {
    fn start(&mut self, r: &mut [T], x: &mut [T]) -> f64 {
        let started = self.space.start(r, x);
        started.unwrap_or_else(|error| {
            self.failure = Some(error);
            0.0
        })
    }

    fn turn(&mut self, t: &mut [T], p: &mut [T]) {
        match self.space.turn(t) {
            Ok(weights) => self.upper.subtract(weights, p),
            Err(error) => self.failure = Some(error),
        }
    }
}
