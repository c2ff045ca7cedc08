//! Vectors on the interface, the dofs that contact may ever act on.

use crate::real::Real;

/// Vectors on the interface, one entry a dof there.
pub(crate) struct InterfaceWork<T> {
    /// The increment d: first without contact, finally with it.
    pub(crate) increment: Vec<T>,
    /// Forces of contact, and forces of the contact problem that is being solved.
    pub(crate) forces: Vec<T>,
    pub(crate) problem_forces: Vec<T>,
    /// Values at d = 0 of the displacements of the state and of the balance if it differs, and of the target of
    /// contact.
    pub(crate) displacement: Vec<T>,
    pub(crate) balance: Vec<T>,
    pub(crate) target: Vec<T>,
    /// d without contact, and d of the last linearization of curved rows.
    pub(crate) free: Vec<T>,
    pub(crate) tried: Vec<T>,
    /// Displacements where the gaps of curved rows were linearized last.
    pub(crate) linearized_at: Vec<T>,
    /// A response: of the multipliers of a contact problem, or of forces that do not depend on d.
    pub(crate) response: Vec<T>,
}

impl<T: Real> InterfaceWork<T> {
    pub(crate) fn new(size: usize) -> Self {
        let zero = || vec![T::zero(); size];
        Self {
            increment: zero(),
            forces: zero(),
            problem_forces: zero(),
            displacement: zero(),
            balance: zero(),
            target: zero(),
            free: zero(),
            tried: zero(),
            linearized_at: zero(),
            response: zero(),
        }
    }
}

/// `values[dof] = base + weight · increment` on the interface.
pub(crate) fn advance<T: Real>(dofs: &[usize], base: &[T], weight: T, increment: &[T], values: &mut [T]) {
    for ((&dof, &base), &d) in dofs.iter().zip(base).zip(increment) {
        values[dof] = base + weight * d;
    }
}

/// Copies the values on the interface to `kept`.
pub(crate) fn keep<T: Real>(dofs: &[usize], values: &[T], kept: &mut [T]) {
    for (&dof, kept) in dofs.iter().zip(kept) {
        *kept = values[dof];
    }
}

/// Restores the values stored by [`keep`].
pub(crate) fn restore<T: Real>(dofs: &[usize], kept: &[T], values: &mut [T]) {
    for (&dof, &kept) in dofs.iter().zip(kept) {
        values[dof] = kept;
    }
}
