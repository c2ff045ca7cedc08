//! A body cut into parts for ranks.

use crate::error::{Error, Result};
use crate::linear_solver;
use faer::sparse::SymbolicSparseColMatRef;

/// Cuts a body into `count` parts with similar numbers of dofs and few neighbors in other parts; returns the part of
/// each row of the pattern, from 0.
///
/// The pattern (both triangles, with or without diagonal entries) belongs to a matrix of the whole body, or of its
/// nodes, with an entry for each two nodes of an element. Rows with the same neighbors, such as the dofs of a node,
/// stay together if the diagonal has entries. Parts are pieces of the multilevel nested dissection by which
/// [`Cholesky`](crate::Cholesky) orders solids (Karypis and Kumar, SIAM J. Sci. Comput. 20, 1998). They are the same
/// in every run, so every [rank](crate::ranks::Ranks) can compute them itself. Their shapes are irregular, they may
/// consist of several pieces, and some are empty if there are more parts than rows.
///
/// For graphs that fit in one process. Hosts of larger ones should use their own partition.
///
/// # Errors
///
/// [`Error::Parameter`] for no parts, [`Error::Dimension`] and [`Error::Incompatible`] for a pattern that is not
/// square, not symmetric, or too large for numbers of 32 bits.
///
/// ```
/// use contact_dynamics::faer::sparse::{Pair, SymbolicSparseColMat};
/// use contact_dynamics::ranks::parts;
///
/// // A strip of 12 nodes by 2, each with its neighbors.
/// let near = |a: usize, b: usize| (a / 2).abs_diff(b / 2) <= 1;
/// let pairs = (0..24).flat_map(|row| (0..24).filter(move |&col| near(row, col)).map(move |col| Pair { row, col }));
/// let pairs: Vec<_> = pairs.collect();
/// let (graph, _) = SymbolicSparseColMat::<usize>::try_new_from_indices(24, 24, &pairs).expect("pairs in range");
///
/// let parts = parts(graph.as_ref(), 2)?;
/// assert!((0..2).all(|part| parts.iter().filter(|&&other| other == part).count() == 12));
/// let cut = pairs.iter().filter(|pair| pair.row < pair.col && parts[pair.row] != parts[pair.col]).count();
/// assert_eq!(cut, 4); // across the strip
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn parts(pattern: SymbolicSparseColMatRef<'_, usize>, count: usize) -> Result<Vec<usize>> {
    if count == 0 {
        return Err(Error::Parameter { name: "the number of parts", value: 0.0, range: "positive" });
    }
    let (expected, found) = (pattern.nrows(), pattern.ncols());
    if expected != found {
        return Err(Error::Dimension { what: "the pattern to cut", expected, found });
    }
    linear_solver::parts(pattern, count)?.ok_or(Error::Incompatible {
        part: "the pattern to cut".into(),
        reason: "it is not symmetric, or has too many entries for numbers of 32 bits",
    })
}
