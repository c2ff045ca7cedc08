//! Dofs without mass, part by part: at the start dofs with mass stay where they are, so that parts coupled only by
//! these are balanced separately. A property of one part, damping or a floating mode, must not affect another.

use crate::error::{Error, Result};
use crate::linear_solver::components;
use crate::real::Real;
use crate::simulation::stage::massless::{Columns, Embedded, damping_forces};
use crate::system::System;
use faer::sparse::SymbolicSparseColMat;

/// Lists of dofs, each ascending, that the pattern of the tangent does not couple with each other; one list if there
/// is no pattern.
pub(crate) fn parts<T: Real>(system: &dyn System<T>, dofs: &[usize]) -> Vec<Vec<usize>> {
    let pattern = system.pattern();
    if dofs.is_empty() || pattern.row_idx().is_empty() {
        return vec![dofs.to_vec()];
    }
    let (mut pointers, mut rows) = (vec![0], Vec::new());
    for &dof in dofs {
        rows.extend(pattern.row_idx_of_col_raw(dof).iter().filter_map(|row| dofs.binary_search(row).ok()));
        pointers.push(rows.len());
    }
    let own = SymbolicSparseColMat::new_checked(dofs.len(), dofs.len(), pointers, None, rows);
    let (_, lists) = components(own.as_ref());
    lists.into_iter().map(|list| list.into_iter().map(|place| dofs[place]).collect()).collect()
}

/// Parts that damping acts on, and the other parts.
pub(crate) fn by_damping<T: Real>(system: &mut dyn System<T>, parts: Vec<Vec<usize>>) -> Result<[Vec<Vec<usize>>; 2]> {
    let Some(forces) = damping_forces(system, &joined(&parts))? else { return Ok([Vec::new(), parts]) };
    let acts = |dof: usize| forces[dof] != T::zero();
    let (damped, others): (Vec<_>, Vec<_>) = parts.into_iter().partition(|part| part.iter().any(|&dof| acts(dof)));
    // If it acts on other dofs only, the parts that cause it are unknown.
    let is_elsewhere = damped.is_empty() && (0..forces.len()).any(acts);
    Ok(if is_elsewhere { [others, damped] } else { [damped, others] })
}

/// All dofs of some parts, ascending.
pub(crate) fn joined(parts: &[Vec<usize>]) -> Vec<usize> {
    let mut dofs = parts.concat();
    dofs.sort_unstable();
    dofs
}

/// Factorizes the own matrix of some parts from its columns, one for each of their `dofs` (ascending). If it is not
/// symmetric positive definite there is no factor, and `parts` keeps the parts whose own matrix is.
pub(crate) fn factorize<T: Real>(
    columns: &Columns<T>,
    dofs: &[usize],
    parts: &mut Vec<Vec<usize>>,
    interface: &[usize],
) -> Result<Option<Embedded<T>>> {
    if let Some(factor) = definite(Embedded::factorized(columns, dofs, interface))? {
        return Ok(Some(factor));
    }
    let all = std::mem::take(parts);
    let count = all.len();
    for part in all {
        if count > 1 && definite(Embedded::factorized(&columns.of_part(dofs, &part), &part, &[]))?.is_some() {
            parts.push(part);
        }
    }
    if parts.len() == count {
        // By rounding, each part is definite and all parts together are not.
        parts.clear();
    }
    Ok(None)
}

/// None for matrices that are not symmetric positive definite.
fn definite<T: Real>(factor: Result<Embedded<T>>) -> Result<Option<Embedded<T>>> {
    match factor {
        Ok(factor) => Ok(Some(factor)),
        Err(Error::Asymmetric { .. } | Error::Singular { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}
