//! Parts of a system that a static balance treats separately: dofs that the pattern of the tangent does not couple. A
//! property of one part, such as a floating mode, must not affect another.

use crate::error::{Error, Result};
use crate::linear_solver::components;
use crate::ranks::Together;
use crate::real::Real;
use crate::simulation::operator::part::Embedded;
use crate::simulation::stage::massless::{Columns, damping_forces};
use crate::system::System;
use faer::sparse::SymbolicSparseColMat;

/// Lists of dofs, each ascending, that the pattern of the tangent does not couple with each other; one list if there
/// is no pattern.
pub(super) fn parts<T: Real>(system: &dyn System<T>, dofs: &[usize]) -> Vec<Vec<usize>> {
    let pattern = system.pattern();
    if dofs.is_empty() {
        return Vec::new();
    }
    if pattern.row_idx().is_empty() {
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

/// The dofs whose velocities cause damping forces on some of them, and the other dofs.
pub(super) fn by_damping<T: Real>(system: &mut dyn System<T>, dofs: &[usize]) -> Result<[Vec<usize>; 2]> {
    if dofs.is_empty() {
        return Ok([Vec::new(), Vec::new()]);
    }
    let forces = damping_forces(system, dofs)?;
    let is_damped = |dof: &usize| forces.as_ref().is_some_and(|forces| forces[*dof] != T::zero());
    let (damped, others) = dofs.iter().partition(|dof| is_damped(dof));
    Ok([damped, others])
}

/// All dofs of some parts, ascending.
pub(super) fn joined(parts: &[Vec<usize>]) -> Vec<usize> {
    let mut dofs = parts.concat();
    dofs.sort_unstable();
    dofs
}

/// The free dofs of the bodies at rest: parts coupled by K without a velocity, supports included. Refuses runs in
/// which everything moves, and ranks, none of which has all of the stiffness.
pub(super) fn bodies_at_rest<T: Real>(system: &dyn System<T>, together: &Together<T>, v: &[T]) -> Result<Vec<usize>> {
    if !together.is_alone() {
        let reason = "no rank has all of the stiffness: give displacements in balance, as a static analysis finds them";
        return Err(Error::Incompatible { part: "a start at rest over ranks".into(), reason });
    }
    let prescribed = system.prescribed();
    let free: Vec<usize> = (0..v.len()).filter(|dof| prescribed.binary_search(dof).is_err()).collect();
    let pattern = system.pattern();
    let coupled = |dof: usize| if pattern.row_idx().is_empty() { &[] } else { pattern.row_idx_of_col_raw(dof) };
    let rests = |dof: &usize| v[*dof] == T::zero() && coupled(*dof).iter().all(|&other| v[other] == T::zero());
    let resting = parts(system, &free).into_iter().filter(|part| part.iter().all(rests));
    let resting = joined(&resting.collect::<Vec<_>>());
    match v.iter().position(|v| *v != T::zero()) {
        Some(dof) if resting.is_empty() => {
            let part = format!("a start at rest with the initial velocity {:e} of dof {dof}", v[dof]);
            let reason = "a body that starts at rest has none, supports included, and there is no other body";
            Err(Error::Incompatible { part, reason })
        }
        _ => Ok(resting),
    }
}

/// Factorizes the own matrix of some parts from its columns, one for each of their `dofs` (ascending). If it is not
/// symmetric positive definite, `parts` keeps the parts whose own matrix is.
pub(super) fn factorize<T: Real>(
    columns: &Columns<T>,
    dofs: &[usize],
    parts: &mut Vec<Vec<usize>>,
    interface: &[usize],
) -> Result<Embedded<T>> {
    columns.factorized(dofs, interface).inspect_err(|_| {
        let count = parts.len();
        let factor = |part: &Vec<usize>| columns.of_part(dofs, part).factorized(part, &[]);
        parts.retain(|part| count > 1 && factor(part).is_ok());
        if parts.len() == count {
            // By rounding, each part is definite and all parts together are not.
            parts.clear();
        }
    })
}
