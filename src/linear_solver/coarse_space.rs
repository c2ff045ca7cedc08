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

impl Aggregates {
    /// Aggregates of the nodes of a symmetric matrix, which have `size` dofs each. A node of which one dof is
    /// `excluded`, or does not couple with others, as if it is prescribed, belongs to none.
    pub(crate) fn find<T: Real>(
        a: SparseColMatRef<'_, usize, T>,
        size: usize,
        excluded: impl Iterator<Item = usize>,
    ) -> Result<Self> {
        let (pattern, nodes) = (a.symbolic(), a.ncols() / size);
        let couples = |dof: usize| {
            let mut entries = a.row_idx_of_col_raw(dof).iter().zip(a.val_of_col(dof));
            entries.any(|(&other, &value)| other != dof && value != T::zero())
        };
        let near = |node: usize| neighbors(pattern, size, node);
        let mut of_node: Vec<u32> = memory::reserve(nodes, 1, WHAT)?;
        of_node.resize(nodes, NONE);
        let mut may: Vec<bool> = memory::reserve(nodes, 1, WHAT)?;
        may.extend((0..nodes).map(|node| (node * size..(node + 1) * size).all(couples)));
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
                members.iter().for_each(|&node| of_node[node] = count);
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
            joining.iter().for_each(|&(node, own)| of_node[node] = own);
        }
        Ok(Self { of_node, count: count as usize })
    }

    /// The aggregate of a node.
    pub(crate) fn of(&self, node: usize) -> Option<usize> {
        Some(self.of_node[node]).filter(|&own| own != NONE).map(|own| own as usize)
    }
}

/// Calls `each` with row, column and values of each block of `size`² of a matrix.
pub(crate) fn each_block<T: Real>(
    a: SparseColMatRef<'_, usize, T>,
    size: usize,
    each: &mut dyn FnMut(usize, usize, &[T]),
) {
    let (mut rows, mut values): (Vec<usize>, Vec<T>) = (Vec::new(), Vec::new());
    for column in 0..a.ncols() / size {
        rows.clear();
        rows.extend(
            (column * size..(column + 1) * size).flat_map(|dof| a.row_idx_of_col_raw(dof)).map(|row| row / size),
        );
        rows.sort_unstable();
        rows.dedup();
        values.clear();
        values.resize(rows.len() * size * size, T::zero());
        for c in 0..size {
            let mut at = 0;
            let dof = column * size + c;
            for (&row, &value) in a.row_idx_of_col_raw(dof).iter().zip(a.val_of_col(dof)) {
                while rows[at] < row / size {
                    at += 1;
                }
                values[(at * size + c) * size + row % size] = value;
            }
        }
        for (&row, block) in rows.iter().zip(values.chunks_exact(size * size)) {
            each(row, column, block);
        }
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

    /// The block of a node and an aggregate, stored column by column.
    fn block(&mut self, node: usize, aggregate: usize) -> &mut [T] {
        let range = self.pointers[node]..self.pointers[node + 1];
        let at = range.start + self.columns[range].partition_point(|&own| (own as usize) < aggregate);
        &mut self.values[at * self.size * self.size..][..self.size * self.size]
    }

    /// `x −= A weights`.
    pub(crate) fn subtract(&self, weights: &[T], x: &mut [T]) {
        let (view, chunk) = (self.view(), self.nodes().div_ceil(CHUNKS).max(1));
        threads::each_chunk(Threads::All, x, chunk * self.size, &|number, x: &mut [T]| {
            let first = number * chunk;
            T::subtract_coarse(view, first..first + x.len() / self.size, weights, x);
        });
    }

    /// `sums = Aᵀ x`, with memory for partial sums.
    fn gather(&self, x: &[T], partial: &mut [T], sums: &mut [T]) {
        let (view, chunk) = (self.view(), self.nodes().div_ceil(CHUNKS).max(1));
        threads::each_chunk(Threads::All, partial, sums.len().max(1), &|number, own: &mut [T]| {
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
    factor: Box<dyn Factorization<T>>,
    /// μ of the last projection, and partial sums.
    weights: Vec<T>,
    partial: Vec<T>,
}

/// The nodes of a matrix in blocks of `size`², and their aggregates, `None` if a node has none.
pub(crate) struct Nodes<'a> {
    pub(crate) size: usize,
    pub(crate) count: usize,
    pub(crate) aggregate: &'a dyn Fn(usize) -> Option<usize>,
}

impl<T: Real> CoarseSpace<T> {
    /// `None` if Zᵀ A Z is not definite. `near` lists the nodes that couple with a node, itself among them; `z` writes the block of Z of a node;
    /// `couplings` calls its argument with row, column and values of each block of A, or of a part of each.
    pub(crate) fn new<I: Iterator<Item = usize>>(
        nodes: &Nodes<'_>,
        near: impl Fn(usize) -> I,
        z: impl Fn(usize, &mut [T]),
        couplings: impl FnOnce(&mut dyn FnMut(usize, usize, &[T])),
    ) -> Result<Option<Self>> {
        let &Nodes { size, count, aggregate } = nodes;
        let mut own = Rows::zero(size, count, |node| aggregate(node).into_iter())?;
        for node in 0..count {
            if let Some(of_node) = aggregate(node) {
                z(node, own.block(node, of_node));
            }
        }
        let mut az = Rows::zero(size, count, |node| near(node).filter_map(aggregate))?;
        couplings(&mut |row, column, block| add_coupling(&mut az, (nodes, &own), (row, column), block));
        let aggregates = own.columns.iter().max().map_or(0, |&last| last as usize + 1);
        let factor = match factorize(&own, &az, aggregates) {
            Err(Error::Singular { .. }) => return Ok(None),
            factor => factor?,
        };
        let weights = memory::zeros(aggregates, size, WHAT)?;
        let partial = memory::zeros(weights.len(), CHUNKS, WHAT)?;
        Ok(Some(Self { z: own, az, factor, partial, weights }))
    }

    /// B Z for a matrix B with entries where A has them, given as A is.
    pub(crate) fn product(
        &self,
        nodes: &Nodes<'_>,
        couplings: impl FnOnce(&mut dyn FnMut(usize, usize, &[T])),
    ) -> Result<Rows<T>> {
        let Rows { size, pointers, columns, values } = &self.az;
        let mut rows = Rows { size: *size, ..Rows::default() };
        memory::copy(&mut rows.pointers, pointers, WHAT)?;
        memory::copy(&mut rows.columns, columns, WHAT)?;
        rows.values = memory::zeros(values.len(), 1, WHAT)?;
        couplings(&mut |row, column, block| add_coupling(&mut rows, (nodes, &self.z), (row, column), block));
        Ok(rows)
    }

    /// Solves in the space: x += Z μ and r −= A Z μ, so that Zᵀ r = 0. Returns μᵀ Zᵀ A Z μ.
    pub(crate) fn start(&mut self, r: &mut [T], x: &mut [T]) -> Result<f64> {
        let Self { z, az, factor, weights, partial } = self;
        z.gather(r, partial, weights);
        let right = &mut partial[..weights.len()];
        right.copy_from_slice(weights);
        factor.solve(weights)?;
        az.subtract(weights, r);
        let energy = right.iter().zip(&*weights).map(|(right, weight)| right.value() * weight.value()).sum();
        weights.iter_mut().for_each(|weight| *weight = -*weight);
        z.subtract(weights, x);
        Ok(energy)
    }

    /// p −= Z μ, so that Zᵀ A p = 0. Returns μ.
    pub(crate) fn turn(&mut self, p: &mut [T]) -> Result<&[T]> {
        let Self { z, az, factor, weights, partial } = self;
        az.gather(p, partial, weights);
        factor.solve(weights)?;
        z.subtract(weights, p);
        Ok(weights)
    }

    /// Number of stored values.
    pub(crate) fn stored_values(&self) -> usize {
        let Self { z, az, factor, partial, .. } = self;
        z.values.len() + az.values.len() + factor.stored_values() + partial.len()
    }
}

/// Adds the block A_IJ of a matrix, times the block of Z of J, to A Z.
fn add_coupling<T: Real>(
    az: &mut Rows<T>,
    (nodes, z): (&Nodes<'_>, &Rows<T>),
    (row, column): (usize, usize),
    block: &[T],
) {
    let size = nodes.size;
    let Some(aggregate) = (nodes.aggregate)(column) else { return };
    let of_column = &z.values[z.pointers[column] * size * size..][..size * size];
    let sums = az.block(row, aggregate);
    for c in 0..size {
        for k in 0..size {
            T::axpy(of_column[c * size + k], &block[k * size..][..size], &mut sums[c * size..][..size]);
        }
    }
}

/// The factor of Zᵀ A Z.
fn factorize<T: Real>(z: &Rows<T>, az: &Rows<T>, aggregates: usize) -> Result<Box<dyn Factorization<T>>> {
    let size = z.size;
    let of_node = |node: usize| z.columns[z.pointers[node]..z.pointers[node + 1]].first().map(|&own| own as usize);
    let others = |node: usize| az.pointers[node]..az.pointers[node + 1];
    // Columns of aggregates, then of their dofs.
    let mut near: Vec<Vec<usize>> = vec![Vec::new(); aggregates];
    for node in 0..z.nodes() {
        let Some(own) = of_node(node) else { continue };
        for &other in &az.columns[others(node)] {
            let near = &mut near[other as usize];
            if !near.contains(&own) {
                near.push(own);
            }
        }
    }
    let blocks: usize = near.iter().map(Vec::len).sum();
    let (mut pointers, mut rows) = (vec![0], memory::reserve(blocks, size * size, WHAT)?);
    for near in &mut near {
        near.sort_unstable();
        for _ in 0..size {
            rows.extend(near.iter().flat_map(|&own| own * size..(own + 1) * size));
            pointers.push(rows.len());
        }
    }
    let mut values: Vec<T> = memory::zeros(rows.len(), 1, WHAT)?;
    for node in 0..z.nodes() {
        let Some(own) = of_node(node) else { continue };
        let of_z = &z.values[z.pointers[node] * size * size..][..size * size];
        for at in others(node) {
            let other = az.columns[at] as usize;
            let of_az = &az.values[at * size * size..][..size * size];
            let place = near[other].partition_point(|&before| before < own);
            for c in 0..size {
                for r in 0..size {
                    let product: T = (0..size).map(|k| of_z[r * size + k] * of_az[c * size + k]).sum();
                    values[pointers[other * size + c] + place * size + r] += product;
                }
            }
        }
    }
    let dofs = aggregates * size;
    let pattern = SymbolicSparseColMatRef::new_checked(dofs, dofs, &pointers, None, &rows);
    let mut factor = Cholesky::default().analyze(pattern, &[])?;
    factor.factorize(SparseColMatRef::new(pattern, &values))?;
    factor.release();
    Ok(factor)
}
