//! A coarse space for conjugate gradients: aggregates of nodes, each of which moves as one. Directions are kept
//! A-orthogonal to it, so that they need not resolve motions longer than an aggregate (deflation: Nicolaides, SIAM J.
//! Numer. Anal. 24, 1987; Saad, Yeung, Erhel and Guyomarc'h, SIAM J. Sci. Comput. 21, 2000).

use crate::error::{Error, Result};
use crate::kernels::coarse::NodeRows;
use crate::linear_solver::{Cholesky, Factorization, LinearSolver};
use crate::memory;
use crate::real::Real;
use crate::threads::{self, Threads};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use std::ops::Range;

/// What memory is asked for.
const WHAT: &str = "a coarse space";

/// The condition number of a matrix, scaled by its diagonal, from which on a coarse space pays: a Courant number of
/// about eight (`cargo bench --bench large -- courant`).
pub(crate) const WORTHWHILE: f64 = 40.0;

/// A node of no aggregate.
const NONE: u32 = u32::MAX;

/// The aggregate of each node.
#[derive(Debug, Default)]
pub(crate) struct Aggregates {
    of_node: Vec<u32>,
    pub(crate) count: usize,
}

/// The nodes that share an entry with a node of `size` dofs.
fn neighbors(pattern: SymbolicSparseColMatRef<'_, usize>, size: usize, node: usize) -> impl Iterator<Item = usize> {
    let of_dof = move |dof: usize| pattern.row_idx_of_col_raw(dof).iter().map(move |other| other / size);
    // The dofs of a node have the same neighbors, if not one of them is prescribed.
    let longest = (node * size..(node + 1) * size).max_by_key(|&dof| pattern.row_idx_of_col_raw(dof).len());
    longest.into_iter().flat_map(of_dof).filter(move |&other| other != node)
}

/// The number of dofs of a node, up to three.
pub(crate) fn node_size(pattern: SymbolicSparseColMatRef<'_, usize>) -> usize {
    let is_node = |first: usize, size: usize| {
        let rows = pattern.row_idx_of_col_raw(first);
        rows.binary_search(&first).is_ok_and(|at| rows.get(at + size - 1) == Some(&(first + size - 1)))
    };
    let fits = |size: &usize| {
        let nodes = pattern.ncols() / size;
        pattern.ncols().is_multiple_of(*size)
            && 10 * (0..nodes).filter(|node| is_node(node * size, *size)).count() >= 9 * nodes
    };
    [3, 2].into_iter().find(fits).unwrap_or(1)
}

/// Whether a dof couples with others. Prescribed dofs do not.
pub(crate) fn is_coupled<T: Real>(a: SparseColMatRef<'_, usize, T>, dof: usize) -> bool {
    let mut entries = a.row_idx_of_col_raw(dof).iter().zip(a.val_of_col(dof));
    entries.any(|(&other, &value)| other != dof && value != T::zero())
}

impl Aggregates {
    /// Aggregates of the nodes of a symmetric matrix, which have `size` dofs each. A node of which one dof is
    /// `excluded`, or does not couple with others, as if it is prescribed, belongs to none.
    pub(crate) fn find<T: Real>(
        a: SparseColMatRef<'_, usize, T>,
        size: usize,
        excluded: impl Iterator<Item = usize>,
    ) -> Result<Self> {
        let (pattern, nodes) = (a.symbolic(), a.ncols() / size);
        let near = |node: usize| neighbors(pattern, size, node);
        let mut of_node: Vec<u32> = memory::reserve(nodes, 1, WHAT)?;
        of_node.resize(nodes, NONE);
        let mut may: Vec<bool> = memory::reserve(nodes, 1, WHAT)?;
        may.extend((0..nodes).map(|node| (node * size..(node + 1) * size).all(|dof| is_coupled(a, dof))));
        excluded.for_each(|dof| may[dof / size] = false);
        // All nodes at most two away from a node, if none of them has an aggregate.
        let mut count = 0;
        let mut members = Vec::new();
        for root in 0..nodes {
            if !may[root] || of_node[root] != NONE {
                continue;
            }
            members.clear();
            members.push(root);
            let mut is_free = true;
            for node in std::iter::once(root).chain(near(root)) {
                let before = members.len();
                members.extend(near(node).filter(|&node| may[node]));
                is_free = members[before..].iter().all(|&node| of_node[node] == NONE);
                if !is_free {
                    break;
                }
            }
            if is_free {
                for &node in &members {
                    of_node[node] = count;
                }
                count += 1;
            }
        }
        // The others join the aggregate of a neighbor, layer by layer.
        let mut joining = memory::reserve(nodes, 1, WHAT)?;
        loop {
            let open = (0..nodes).filter(|&node| may[node] && of_node[node] == NONE);
            joining.clear();
            joining.extend(open.filter_map(|node| {
                let found = near(node).map(|other| of_node[other]).filter(|&own| own != NONE);
                let mut found: Vec<u32> = found.collect();
                found.sort_unstable();
                let longest = found.chunk_by(|a, b| a == b).max_by_key(|run| run.len());
                longest.map(|run| (node, run[0]))
            }));
            if joining.is_empty() {
                break;
            }
            for &(node, own) in &joining {
                of_node[node] = own;
            }
        }
        Ok(Self { of_node, count: count as usize })
    }

    /// The aggregate of a node.
    pub(crate) fn of(&self, node: usize) -> Option<usize> {
        Some(self.of_node[node]).filter(|&own| own != NONE).map(|own| own as usize)
    }
}

/// A matrix with a row of blocks for each node and a column for each aggregate.
#[derive(Debug, Default)]
pub(crate) struct Rows<T> {
    size: usize,
    pointers: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<T>,
}

impl<T: Real> Rows<T> {
    fn view(&self) -> NodeRows<'_, T> {
        let Self { size, pointers, columns, values } = self;
        NodeRows { size: *size, pointers, columns, values }
    }

    pub(crate) fn stored_values(&self) -> usize {
        self.values.len()
    }

    fn nodes(&self) -> usize {
        self.pointers.len() - 1
    }

    /// The threads that a product deserves.
    fn threads(&self) -> Threads {
        if self.values.len() < threads::GRAIN { Threads::One } else { Threads::All }
    }

    /// The places of the blocks of a node.
    fn range(&self, node: usize) -> Range<usize> {
        self.pointers[node]..self.pointers[node + 1]
    }

    /// The aggregate of the only block of a node, if it has one.
    fn only(&self, node: usize) -> Option<usize> {
        self.columns[self.range(node)].first().map(|&own| own as usize)
    }

    /// Zero, with blocks where `columns` says for each node, in any order and more than once.
    fn zero<I: Iterator<Item = usize>>(size: usize, nodes: usize, columns: impl Fn(usize) -> I) -> Result<Self> {
        let pointers = memory::reserve(nodes + 1, 1, WHAT)?;
        let mut rows = Self { size, pointers, columns: Vec::new(), values: Vec::new() };
        rows.pointers.push(0);
        let mut own = Vec::new();
        for node in 0..nodes {
            own.clear();
            own.extend(columns(node));
            own.sort_unstable();
            own.dedup();
            memory::make_room(&mut rows.columns, own.len(), WHAT)?;
            #[allow(clippy::cast_possible_truncation)] // aggregates are counted with 32 bits
            rows.columns.extend(own.iter().map(|&column| column as u32));
            rows.pointers.push(rows.columns.len());
        }
        rows.values = memory::zeros(rows.columns.len(), size * size, WHAT)?;
        Ok(rows)
    }

    /// The block of a node and an aggregate, stored column by column, if there is one.
    fn block(&mut self, node: usize, aggregate: usize) -> Option<&mut [T]> {
        let range = self.range(node);
        let at =
            range.start + self.columns[range.clone()].binary_search_by(|&own| (own as usize).cmp(&aggregate)).ok()?;
        Some(&mut self.values[at * self.size * self.size..][..self.size * self.size])
    }

    /// `x −= A weights`.
    pub(crate) fn subtract(&self, weights: &[T], x: &mut [T]) {
        let (view, chunk) = (self.view(), self.nodes().div_ceil(CHUNKS).max(1));
        threads::each_chunk(self.threads(), x, chunk * self.size, &|number, x: &mut [T]| {
            let first = number * chunk;
            T::subtract_coarse(view, first..first + x.len() / self.size, weights, x);
        });
    }

    /// `sums = Aᵀ x`, with memory for partial sums.
    fn gather(&self, x: &[T], partial: &mut [T], sums: &mut [T]) {
        let (view, chunk) = (self.view(), self.nodes().div_ceil(CHUNKS).max(1));
        threads::each_chunk(self.threads(), partial, sums.len().max(1), &|number, own: &mut [T]| {
            own.fill(T::zero());
            let rows = (number * chunk).min(self.nodes())..((number + 1) * chunk).min(self.nodes());
            T::gather_coarse(view, rows.clone(), &x[rows.start * self.size..rows.end * self.size], own);
        });
        sums.fill(T::zero());
        for own in partial.chunks_exact(sums.len().max(1)) {
            T::axpy(T::one(), own, sums);
        }
    }
}

/// Chunks of nodes that several threads share.
const CHUNKS: usize = 8;

/// Z, A Z, and the factor of Zᵀ A Z.
#[derive(Debug)]
pub(crate) struct CoarseSpace<T> {
    z: Rows<T>,
    az: Rows<T>,
    /// Zᵀ A Z.
    pointers: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<T>,
    factor: Box<dyn Factorization<T>>,
    /// μ of the last projection, and partial sums.
    weights: Vec<T>,
    partial: Vec<T>,
}

impl<T: Real> CoarseSpace<T> {
    /// For a matrix in blocks of `size`² and the aggregate of each node. `near` lists the nodes that couple with a
    /// node, itself among them.
    pub(crate) fn new<I: Iterator<Item = usize>>(
        (size, nodes): (usize, usize),
        aggregate: impl Fn(usize) -> Option<usize>,
        near: impl Fn(usize) -> I,
    ) -> Result<Self> {
        let z = Rows::zero(size, nodes, |node| aggregate(node).into_iter())?;
        let az = Rows::zero(size, nodes, |node| near(node).filter_map(&aggregate))?;
        let aggregates = z.columns.iter().max().map_or(0, |&last| last as usize + 1);
        // Which aggregates couple.
        let mut coupled: Vec<Vec<usize>> = vec![Vec::new(); aggregates];
        for node in 0..nodes {
            let Some(own) = z.only(node) else { continue };
            for &other in &az.columns[az.range(node)] {
                let coupled = &mut coupled[other as usize];
                if !coupled.contains(&own) {
                    coupled.push(own);
                }
            }
        }
        let blocks: usize = coupled.iter().map(Vec::len).sum();
        let (mut pointers, mut rows) = (vec![0], memory::reserve(blocks, size * size, WHAT)?);
        for coupled in &mut coupled {
            coupled.sort_unstable();
            for _ in 0..size {
                rows.extend(coupled.iter().flat_map(|&own| own * size..(own + 1) * size));
                pointers.push(rows.len());
            }
        }
        let dofs = aggregates * size;
        let pattern = SymbolicSparseColMatRef::new_checked(dofs, dofs, &pointers, None, &rows);
        let factor = Cholesky::default().analyze(pattern, &[])?;
        let (values, weights) = (memory::zeros(rows.len(), 1, WHAT)?, memory::zeros(dofs, 1, WHAT)?);
        let partial = memory::zeros(dofs, CHUNKS, WHAT)?;
        Ok(Self { z, az, pointers, rows, values, factor, weights, partial })
    }

    /// Forms all for a matrix. `z` writes the block of Z of a node, and `matrix` adds the entries of the matrix.
    /// Returns whether Zᵀ A Z is definite.
    pub(crate) fn form(
        &mut self,
        z: impl Fn(usize, &mut [T]),
        matrix: impl FnOnce(&mut Product<'_, T>),
    ) -> Result<bool> {
        let Self { z: own, az, pointers, rows, values, factor, weights, .. } = self;
        let size = own.size;
        for node in 0..own.nodes() {
            if let Some(block) = own.only(node).and_then(|aggregate| own.block(node, aggregate)) {
                z(node, block);
            }
        }
        az.values.fill(T::zero());
        matrix(&mut Product { z: own, product: az });
        values.fill(T::zero());
        for node in 0..own.nodes() {
            let Some(aggregate) = own.only(node) else { continue };
            let of_z = &own.values[own.pointers[node] * size * size..][..size * size];
            for at in az.range(node) {
                let of_az = &az.values[at * size * size..][..size * size];
                for c in 0..size {
                    let column = az.columns[at] as usize * size + c;
                    let range = pointers[column]..pointers[column + 1];
                    let first = range.start + rows[range].partition_point(|&row| row < aggregate * size);
                    for (r, value) in values[first..first + size].iter_mut().enumerate() {
                        *value += (0..size).map(|k| of_z[r * size + k] * of_az[c * size + k]).sum();
                    }
                }
            }
        }
        let pattern = SymbolicSparseColMatRef::new_checked(weights.len(), weights.len(), pointers, None, rows);
        match factor.factorize(SparseColMatRef::new(pattern, values)) {
            Err(Error::Singular { .. }) => Ok(false),
            factorized => factorized.map(|()| true),
        }
    }

    /// Zero, with blocks where A Z has them.
    pub(crate) fn rows(&self) -> Result<Rows<T>> {
        let Rows { size, pointers, columns, values } = &self.az;
        let mut rows = Rows { size: *size, ..Rows::default() };
        memory::copy(&mut rows.pointers, pointers, WHAT)?;
        memory::copy(&mut rows.columns, columns, WHAT)?;
        rows.values = memory::zeros(values.len(), 1, WHAT)?;
        Ok(rows)
    }

    /// Forms B Z for a matrix B with entries where A has them.
    pub(crate) fn multiply(&self, product: &mut Rows<T>, matrix: impl FnOnce(&mut Product<'_, T>)) {
        product.values.fill(T::zero());
        matrix(&mut Product { z: &self.z, product });
    }

    /// Solves in the space: x += Z μ and r −= A Z μ, so that Zᵀ r = 0. Returns μᵀ Zᵀ A Z μ.
    pub(crate) fn start(&mut self, r: &mut [T], x: &mut [T]) -> Result<f64> {
        let Self { z, az, factor, weights, partial, .. } = self;
        z.gather(r, partial, weights);
        let right = &mut partial[..weights.len()];
        right.copy_from_slice(weights);
        factor.solve(weights)?;
        az.subtract(weights, r);
        let energy = right.iter().zip(&*weights).map(|(right, weight)| right.value() * weight.value()).sum();
        for weight in weights.iter_mut() {
            *weight = -*weight;
        }
        z.subtract(weights, x);
        Ok(energy)
    }

    /// p −= Z μ, so that Zᵀ A p = 0. Returns μ.
    pub(crate) fn turn(&mut self, p: &mut [T]) -> Result<&[T]> {
        let Self { z, az, factor, weights, partial, .. } = self;
        az.gather(p, partial, weights);
        factor.solve(weights)?;
        z.subtract(weights, p);
        Ok(weights)
    }

    /// Number of stored values.
    pub(crate) fn stored_values(&self) -> usize {
        let Self { z, az, values, factor, partial, .. } = self;
        [&z.values, &az.values, values, partial].iter().map(|part| part.len()).sum::<usize>() + factor.stored_values()
    }
}

/// The product of a matrix, given part by part, with Z.
#[derive(Debug)]
pub(crate) struct Product<'a, T> {
    z: &'a Rows<T>,
    product: &'a mut Rows<T>,
}

impl<T: Real> Product<'_, T> {
    /// Adds a block of the matrix, stored column by column.
    pub(crate) fn add_block(&mut self, row: usize, column: usize, block: &[T]) {
        let Self { z, product } = self;
        let Some(aggregate) = z.only(column) else { return };
        let size = z.size;
        let of_z = &z.values[z.pointers[column] * size * size..][..size * size];
        // Zeros may be stored on one side of the diagonal only.
        let Some(sums) = product.block(row, aggregate) else { return };
        for c in 0..size {
            for k in 0..size {
                for r in 0..size {
                    sums[c * size + r] += block[k * size + r] * of_z[c * size + k];
                }
            }
        }
    }

    /// Adds an entry of the matrix, given by dofs.
    pub(crate) fn add_entry(&mut self, row: usize, column: usize, value: T) {
        let Self { z, product } = self;
        let size = z.size;
        let Some(aggregate) = z.only(column / size) else { return };
        let of_z = &z.values[z.pointers[column / size] * size * size..][..size * size];
        let Some(sums) = product.block(row / size, aggregate) else { return };
        for c in 0..size {
            sums[c * size + row % size] += value * of_z[c * size + column % size];
        }
    }
}
