//! How contact computes its responses from a factor, and the order of elimination that this requires.

use crate::error::Result;
use crate::linear_solver::{COLUMNS, Condensation, Factorization, LinearSolver};
use crate::real::Real;
use faer::sparse::SymbolicSparseColMatRef;

/// How contact computes its responses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ContactPath {
    /// From the trailing block of a factor with the interface eliminated last.
    Condensed,
    /// By full solves, one column per row.
    Full,
    /// From a diagonal matrix: a force moves only the dof that it acts on.
    Apart,
}

/// Fill relative to a free order beyond which a matrix that is factorized often is not ordered for contact.
const DEAR: f64 = 1.25;

/// The same for a constant matrix: in a free order a step in contact needs two solves instead of one.
const DEAR_KEPT: f64 = 2.0;

/// Share of a factor that the interface's dense triangle must exceed for a free order to be tried.
const TRIANGLE: f64 = 0.1;

/// Analyzes with the interface eliminated last, if the solver condenses; in a free order if the factor would
/// otherwise be much larger: a whole surface, eliminated last, fills a dense triangle.
pub(crate) fn analyze<T: Real>(
    solver: &dyn LinearSolver<T>,
    pattern: SymbolicSparseColMatRef<'_, usize>,
    interface: &[usize],
    varies: bool,
) -> Result<(Box<dyn Factorization<T>>, ContactPath)> {
    let mut last = solver.analyze(pattern, interface)?;
    if last.condensation().is_none() {
        return Ok((last, ContactPath::Full));
    }
    // The diagonal is always part of the pattern.
    if pattern.row_idx().len() == pattern.ncols() {
        return Ok((last, ContactPath::Apart));
    }
    let (stored, dofs) = (last.stored_values() as f64, interface.len() as f64);
    if !interface.is_empty() && (varies || 0.5 * dofs * dofs > TRIANGLE * stored) {
        let free = solver.analyze(pattern, &[])?;
        let dear = if varies { DEAR } else { DEAR_KEPT };
        if stored > dear * free.stored_values() as f64 {
            return Ok((free, ContactPath::Full));
        }
    }
    Ok((last, ContactPath::Condensed))
}

/// The condensation, where contact uses it.
pub(crate) fn condensation<T: Real>(
    path: ContactPath,
    factor: &mut dyn Factorization<T>,
) -> Option<&mut dyn Condensation<T>> {
    match path {
        ContactPath::Condensed => factor.condensation(),
        ContactPath::Full | ContactPath::Apart => None,
    }
}

/// `f ← A⁻¹ f` on the interface, for columns of forces there; `full` is scratch for full solves.
pub(crate) fn respond<T: Real>(
    (path, factor): (ContactPath, &mut dyn Factorization<T>),
    interface: &[usize],
    full: &mut [T],
    forces: &mut [T],
) -> Result<()> {
    // A condensation computes responses on the interface without a full solve, whether steps condense or not.
    if let Some(condensed) = factor.condensation().filter(|_| path != ContactPath::Full) {
        return condensed.solve(forces);
    }
    let (height, size) = (interface.len().max(1), full.len() / COLUMNS);
    for forces in forces.chunks_mut(COLUMNS * height) {
        let columns = &mut full[..forces.len() / height * size];
        columns.fill(T::zero());
        for (column, forces) in columns.chunks_exact_mut(size).zip(forces.chunks_exact(height)) {
            for (&force, &dof) in forces.iter().zip(interface) {
                column[dof] = force;
            }
        }
        factor.solve(columns)?;
        for (column, forces) in columns.chunks_exact(size).zip(forces.chunks_exact_mut(height)) {
            for (x, &dof) in forces.iter_mut().zip(interface) {
                *x = column[dof];
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_solver::Cholesky;
    use faer::sparse::{SparseColMat, Triplet};

    /// A side of a block of springs is eliminated last, its whole surface is not: it would be a dense triangle.
    #[test]
    fn a_whole_surface_is_no_interface_to_condense_to() {
        const SIDE: usize = 12;
        let place = |node: usize| [node / (SIDE * SIDE), node / SIDE % SIDE, node % SIDE];
        let mut entries = Vec::new();
        for node in 0..SIDE * SIDE * SIDE {
            entries.push(Triplet::new(node, node, 6.0));
            for (axis, stride) in [SIDE * SIDE, SIDE, 1].into_iter().enumerate() {
                if place(node)[axis] + 1 < SIDE {
                    entries.push(Triplet::new(node, node + stride, -1.0));
                    entries.push(Triplet::new(node + stride, node, -1.0));
                }
            }
        }
        let dofs = SIDE * SIDE * SIDE;
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(dofs, dofs, &entries).unwrap();
        let solver: &dyn LinearSolver<f64> = &Cholesky::default();
        let path = |interface: &[usize], varies| analyze(solver, matrix.symbolic(), interface, varies).unwrap().1;
        let is_outside = |node: &usize| place(*node).iter().any(|&at| at == 0 || at == SIDE - 1);
        let [side, surface]: [Vec<usize>; 2] = [(0..SIDE * SIDE).collect(), (0..dofs).filter(is_outside).collect()];
        assert_eq!(path(&side, false), ContactPath::Condensed);
        assert_eq!([path(&surface, false), path(&surface, true)], [ContactPath::Full; 2]);
    }
}
