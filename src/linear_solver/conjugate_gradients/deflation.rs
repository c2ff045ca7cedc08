//! The coarse space of a scaled matrix in blocks, 1 + L + Lᵀ = C⁻¹ A C⁻ᵀ.

use super::Matrix;
use crate::error::{Error, Result};
use crate::kernels::conjugate_gradients::{self, Blocks};
use crate::linear_solver::coarse_space::{Aggregates, CoarseSpace, Product, Rows};
use crate::memory;
use crate::real::Real;
use faer::sparse::SparseColMatRef;

/// Entries of the largest block.
const LARGEST: usize = 9;

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
    /// Forms the coarse space of a matrix that has been scaled. Returns whether there is one.
    pub(super) fn form_coarse_space(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<bool> {
        let Self { size, parts, pointers, columns, values, scaling, places, deflation, .. } = self;
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
            return Ok(false);
        }
        let deflation = match deflation {
            Some(deflation) => deflation,
            none => {
                let aggregate = |place: usize| places.aggregates.of(places.nodes[place]);
                let near = |place: usize| {
                    let node = places.nodes[place];
                    let others = (node * size..(node + 1) * size).flat_map(|dof| a.row_idx_of_col_raw(dof));
                    others.map(|other| parts.place(other / size)).chain([place])
                };
                let space = CoarseSpace::new((size, count), aggregate, near)?;
                let upper = space.rows()?;
                none.insert(Deflation { space, upper, failure: None })
            }
        };
        let z = |place: usize, block: &mut [T]| transposed_factor(size, &scaling[place * size * size..], block);
        let lower = Blocks { pointers, columns, values };
        let add = |has_lower: bool, product: &mut Product<'_, T>| {
            let mut other = [T::zero(); LARGEST];
            for row in 0..count {
                other[..size * size].fill(T::zero());
                other[..size * size].iter_mut().step_by(size + 1).for_each(|entry| *entry = T::one());
                product.add_block(row, row, &other);
                for at in lower.pointers[row]..lower.pointers[row + 1] {
                    let (column, block) =
                        (lower.columns[at] as usize, &lower.values[at * size * size..][..size * size]);
                    for c in 0..size {
                        for r in 0..size {
                            other[r * size + c] = block[c * size + r];
                        }
                    }
                    if has_lower {
                        product.add_block(row, column, block);
                    }
                    product.add_block(column, row, &other);
                }
            }
        };
        let is_definite = deflation.space.form(z, |product| add(true, product))?;
        deflation.space.multiply(&mut deflation.upper, |product| add(false, product));
        Ok(is_definite)
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
