//! What lies between fenris and the crate: matrices, places of nodes, numbers of dofs. Nothing else is needed.

use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMat};
use fenris::mesh::Mesh;
use fenris::nalgebra::allocator::Allocator;
use fenris::nalgebra::{DefaultAllocator, DimName};
use fenris::nalgebra_sparse::CsrMatrix;
use fenris::nalgebra_sparse::pattern::SparsityPattern;

/// The pattern of a matrix whose pattern is symmetric: rows by their columns are then columns by their rows.
pub(crate) fn pattern(pattern: &SparsityPattern) -> SymbolicSparseColMat<usize> {
    let (pointers, indices) = (pattern.major_offsets().to_vec(), pattern.minor_indices().to_vec());
    SymbolicSparseColMat::new_checked(pattern.major_dim(), pattern.minor_dim(), pointers, None, indices)
}

/// The same matrix for the crate: symmetric, as those of elastic bodies are.
pub(crate) fn matrix(csr: &CsrMatrix<f64>) -> SparseColMat<usize, f64> {
    SparseColMat::new(pattern(csr.pattern()), csr.values().to_vec())
}

/// Coordinates of all nodes.
pub(crate) fn coordinates<const D: usize, N: DimName, C>(mesh: &Mesh<f64, N, C>) -> Vec<[f64; D]>
where
    DefaultAllocator: Allocator<f64, N>,
{
    mesh.vertices().iter().map(|vertex| std::array::from_fn(|axis| vertex[axis])).collect()
}

/// Dofs of all nodes: fenris numbers them node by node.
pub(crate) fn node_dofs<const D: usize>(nodes: usize) -> Vec<[usize; D]> {
    (0..nodes).map(|node| std::array::from_fn(|axis| D * node + axis)).collect()
}
