//! Number of negative eigenvalues of a sparse symmetric matrix, from its factors (Sylvester's law of inertia).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::{SymbolicCholesky, SymbolicCholeskyRaw};
use faer::{Par, Side, Spec};

/// Counts them in L B Lᵀ with B of blocks of one and two, with pivoting within supernodes (Bunch and Kaufman); a
/// block of two has one eigenvalue of either sign. `None` if there is no memory or a pivot is not finite.
pub(crate) fn negative_eigenvalues(
    symbolic: &SymbolicCholesky<usize>,
    a: SparseColMatRef<'_, usize, f64>,
) -> Option<usize> {
    let n = symbolic.nrows();
    let scratch = symbolic.factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, Spec::default());
    let mut memory = MemBuffer::try_new(scratch).ok()?;
    let (mut values, mut beside) = (vec![0.0; symbolic.len_val()], vec![0.0; n]);
    let (mut forward, mut inverse) = (vec![0; n], vec![0; n]);
    symbolic.factorize_numeric_intranode_lblt(
        &mut values,
        &mut beside,
        &mut forward,
        &mut inverse,
        a,
        Side::Lower,
        Par::Seq,
        MemStack::new(&mut memory),
        Spec::default(),
    );
    let mut pivots = Vec::with_capacity(n);
    match symbolic.raw() {
        SymbolicCholeskyRaw::Simplicial(raw) => {
            pivots.extend(raw.col_ptr()[..n].iter().map(|&start| values[start]));
        }
        SymbolicCholeskyRaw::Supernodal(raw) => {
            for s in 0..raw.n_supernodes() {
                let columns = raw.supernode_end()[s] - raw.supernode_begin()[s];
                let height = columns + raw.supernode(s).pattern().len();
                let first = raw.col_ptr_for_val()[s];
                pivots.extend((0..columns).map(|k| values[first + k * height + k]));
            }
        }
    }
    let (mut negative, mut k) = (0, 0);
    while k < n {
        // Only supernodal factors write off-diagonal entries.
        if beside[k] != 0.0 {
            (negative, k) = (negative + 1, k + 2);
        } else if pivots[k].is_finite() && pivots[k] != 0.0 {
            (negative, k) = (negative + usize::from(pivots[k] < 0.0), k + 1);
        } else {
            return None;
        }
    }
    Some(negative)
}
