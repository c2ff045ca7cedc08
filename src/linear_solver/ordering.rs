//! The choice of an elimination order, with the contact dofs after all others.

use super::dissection;
use super::elimination_tree::EliminationTree;
use super::minimum_degree::{minimum_degree, out_of_memory};
use super::quotient::Quotient;
use crate::error::{Error, Result};
use faer::Side;
use faer::perm::PermRef;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};

/// The order in which [`Cholesky`](super::Cholesky) eliminates the dofs: it determines the number of entries of the
/// factor.
///
/// In any order, the dofs on which contact may act come after all others.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::linear_solver::Ordering;
/// use contact_dynamics::{Cholesky, LinearSolver};
///
/// // A star: dof 0 is coupled with every other one.
/// let n = 50;
/// let mut entries: Vec<_> = (0..n).map(|i| Triplet::new(i, i, 10.0)).collect();
/// entries.extend((1..n).flat_map(|i| [Triplet::new(0, i, -1.0), Triplet::new(i, 0, -1.0)]));
/// let a = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries)?;
///
/// let outward = Cholesky::ordered(Ordering::Given((0..n).collect())); // the center first: everything fills
/// let inward = Cholesky::ordered(Ordering::Given((0..n).rev().collect()));
/// assert!(outward.estimate(a.symbolic(), &[])? >= n * (n + 1) / 2);
/// assert_eq!(inward.estimate(a.symbolic(), &[])?, 2 * n - 1);
///
/// // The solution is the same.
/// let [mut x, mut y] = [vec![1.0; n], vec![1.0; n]];
/// for (solver, x) in [(outward, &mut x), (inward, &mut y)] {
///     let mut factor: Box<dyn contact_dynamics::Factorization<f64>> = solver.analyze(a.symbolic(), &[])?;
///     factor.factorize(a.as_ref())?;
///     factor.solve(x)?;
/// }
/// assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-14));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Ordering {
    /// Minimum degree for chains, frames and plates; for solids minimum degree or nested dissection, whichever gives
    /// fewer entries in the factor, not counting zeros that faer adds for very similar columns.
    #[default]
    Automatic,
    /// Approximate minimum degree (Amestoy, Davis and Duff, SIAM J. Matrix Anal. Appl. 17, 1996): fast to compute,
    /// and hard to beat in one and two dimensions.
    MinimumDegree,
    /// Multilevel nested dissection of the matrix's graph (Karypis and Kumar, SIAM J. Sci. Comput. 20, 1998): much
    /// less fill for solids, increasingly so for larger ones. Needs only the matrix, and is deterministic.
    NestedDissection,
    /// Nested dissection by the coordinates of each dof's node: halves along the longest axis, separated by one layer
    /// of nodes. Faster to compute than [`NestedDissection`](Self::NestedDissection), and as good on regular meshes
    /// of compact bodies. Set unused dimensions to zero.
    Coordinates(Vec<[f64; 3]>),
    /// The host's own order, each dof once: the first entry is the dof eliminated first.
    Given(Vec<usize>),
}

/// Number of factor entries per dof from which nested dissection is tried, as in blocks with at least seven elements
/// per side. Plates and slender beams have fewer; dissection gains a few percent there or loses
/// (`benches/ordering.rs`).
const WORTHWHILE: u64 = 150;

/// The symbolic factorization with `last` (ascending) eliminated last.
pub(crate) fn symbolic_cholesky(
    ordering: &Ordering,
    pattern: SymbolicSparseColMatRef<'_, usize>,
    last: &[usize],
) -> Result<SymbolicCholesky<usize>> {
    match ordering {
        Ordering::Coordinates(places) => check_coordinates(places, pattern.nrows())?,
        Ordering::Given(order) => {
            check_order(order, pattern.nrows())?;
            return with_order(pattern, &moved_last(order, last));
        }
        _ => {}
    }
    // A pattern that is not symmetric has no graph; it occurs if entries that are zero to rounding are stored on one
    // side only.
    let Some(quotient) = Quotient::new(pattern, last)? else {
        return with_order(pattern, &moved_last(&minimum_degree(pattern)?, last));
    };
    let best = match ordering {
        Ordering::NestedDissection => Elimination::new(&quotient, dissection::by_graph(&quotient)?),
        Ordering::Coordinates(places) => Elimination::new(&quotient, dissection::by_coordinates(&quotient, places)?),
        _ => {
            let degree = Elimination::new(&quotient, minimum_degree(quotient.graph.pattern())?);
            if matches!(ordering, Ordering::Automatic) && degree.fill() > WORTHWHILE * pattern.nrows() as u64 {
                let dissected = Elimination::new(&quotient, dissection::by_graph(&quotient)?);
                if dissected.fill() < degree.fill() { dissected } else { degree }
            } else {
                degree
            }
        }
    };
    let symbolic = with_order(pattern, &quotient.expanded(&best.postordered()))?;
    // Only structures as thin as a chain benefit from elimination toward the contact.
    if last.is_empty() || !simplicial(&symbolic) || !matches!(ordering, Ordering::Automatic | Ordering::MinimumDegree) {
        return Ok(symbolic);
    }
    let other = with_order(pattern, &moved_last(&toward(pattern, last), last))?;
    Ok(if other.len_val() < symbolic.len_val() { other } else { symbolic })
}

/// An order of the vertices of a graph, with contact vertices last.
struct Elimination {
    order: Vec<u32>,
    /// Vertices that are not eliminated last.
    interior: usize,
    tree: EliminationTree,
}

impl Elimination {
    /// With an order of all vertices, or of all except contact vertices.
    fn new(quotient: &Quotient, order: Vec<u32>) -> Self {
        let (mut order, mut last): (Vec<_>, Vec<_>) = order.into_iter().partition(|&vertex| !quotient.is_last(vertex));
        let interior = order.len();
        if last.is_empty() {
            last = (0..).take(quotient.graph.size()).filter(|&vertex| quotient.is_last(vertex)).collect();
        }
        order.extend(last);
        let tree = EliminationTree::new(&quotient.graph, &order);
        Self { order, interior, tree }
    }

    fn fill(&self) -> u64 {
        self.tree.fill
    }

    /// The order with each branch of the tree contiguous.
    fn postordered(&self) -> Vec<u32> {
        self.tree.postordered(&self.order, self.interior)
    }
}

fn simplicial(symbolic: &SymbolicCholesky<usize>) -> bool {
    matches!(symbolic.raw(), SymbolicCholeskyRaw::Simplicial(_))
}

fn check_coordinates(places: &[[f64; 3]], n: usize) -> Result<()> {
    let what = "the coordinates of the elimination order";
    if places.len() != n {
        return Err(Error::Dimension { what, expected: n, found: places.len() });
    }
    let finite = |(index, &value): (usize, &f64)| match value.is_finite() {
        true => Ok(()),
        false => Err(Error::NotFinite { what, index: index / 3, value }),
    };
    places.as_flattened().iter().enumerate().try_for_each(finite)
}

fn check_order(order: &[usize], n: usize) -> Result<()> {
    let what = "the elimination order";
    if order.len() != n {
        return Err(Error::Dimension { what, expected: n, found: order.len() });
    }
    let mut seen = vec![false; n];
    order.iter().try_for_each(|&dof| match seen.get_mut(dof) {
        None => Err(Error::MissingDof { what, dof, dofs: n }),
        Some(true) => Err(Error::RepeatedDof { what, dof }),
        Some(seen) => {
            *seen = true;
            Ok(())
        }
    })
}

fn with_order(pattern: SymbolicSparseColMatRef<'_, usize>, order: &[usize]) -> Result<SymbolicCholesky<usize>> {
    let mut inverse = vec![0; order.len()];
    for (place, &dof) in order.iter().enumerate() {
        inverse[dof] = place;
    }
    let order = SymmetricOrdering::Custom(PermRef::new_checked(order, &inverse, order.len()));
    factorize_symbolic_cholesky(pattern, Side::Lower, order, CholeskySymbolicParams::default()).map_err(out_of_memory)
}

/// The same order with the dofs of `last` after the others.
fn moved_last(order: &[usize], last: &[usize]) -> Vec<usize> {
    let is_last = |dof: &usize| last.binary_search(dof).is_ok();
    let interior = order.iter().copied().filter(|dof| !is_last(dof));
    interior.chain(order.iter().copied().filter(is_last)).collect()
}

/// Each connected part from the dofs farthest from `last` (in the graph of the matrix) to the nearest ones.
fn toward(pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Vec<usize> {
    let n = pattern.nrows();
    let mut order = Vec::with_capacity(n);
    let mut reached = vec![false; n];
    // Backward: a breadth-first search from the contact dofs of one part after the other.
    for start in last.iter().copied().chain(0..n) {
        if reached[start] {
            continue;
        }
        let mut next = order.len();
        reached[start] = true;
        order.push(start);
        while let Some(&dof) = order.get(next) {
            next += 1;
            for &neighbor in pattern.row_idx_of_col_raw(dof) {
                if !reached[neighbor] {
                    reached[neighbor] = true;
                    order.push(neighbor);
                }
            }
        }
    }
    order.reverse();
    order
}
