//! Contacts that close or open in a step, and friction that changes: whether the motion jumps with them. Rounding alone
//! makes no jump.

use crate::contact::ContactJacobian;
use crate::corrector::Gaps;
use crate::real::Real;
use crate::rounding::{rounding, share_of_rounding};
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::contact::ContactWork;
use crate::state::{ContactState, Motion};

/// Lists which contacts exert a force at displacements u, and replaces the old list.
pub(crate) fn store_exerting<T: Real>(
    (constraints, g): (&Constraints<'_, T>, &ContactJacobian<T>),
    contacts: &ContactState<T>,
    u: &[T],
    exerting: &mut Vec<bool>,
) {
    exerting.clear();
    exerting.extend((0..contacts.gap.len()).map(|row| exerts((constraints, g), contacts, u, row)));
}

fn exerts<T: Real>(
    (constraints, g): (&Constraints<'_, T>, &ContactJacobian<T>),
    contacts: &ContactState<T>,
    u: &[T],
    row: usize,
) -> bool {
    let gap = contacts.gap[row];
    // The force of a spring that just touches is the rounding of its gap.
    let is_pressed =
        || !constraints.law(row).is_spring() || -gap > constraints.gap_rounding(row, g.magnitude(row, u), gap);
    (contacts.lambda_raw[row] != T::zero() || contacts.lambda[row] != T::zero()) && is_pressed()
}

/// The contacts that exert a force at both ends of a step and whose friction jumps in it, because they begin or end
/// to slide or their slip reverses. Contacts on dofs without mass are left out: their friction is part of a static
/// balance.
pub(crate) fn friction_jumps<'c, T: Real>(
    constraints: &'c Constraints<'_, T>,
    g: &'c ContactJacobian<T>,
    massless: &'c [usize],
    contact: &'c ContactWork<T>,
) -> impl Iterator<Item = usize> + 'c {
    let ContactWork { trial, exerting_at_start, forces_at_start, sliding_at_start, .. } = contact;
    let tangents = constraints.tangents();
    tangents.contacts().filter(move |&row| {
        let reverses = || tangents.of(row).map(|k| forces_at_start[k] * trial.lambda[k]).sum::<T>() < T::zero();
        let jumps = match [sliding_at_start[row], trial.sliding[row]] {
            [true, true] => reverses(),
            [before, now] => before != now,
        };
        jumps && exerting_at_start[row] && trial.lambda[row] != T::zero() && !tangents.act_on(g, row, massless)
    })
}

/// Whether contacts that have closed or opened in a step of size h, from `start` to `new`, make the motion jump.
///
/// Bodies that touch without force open and close by rounding, and so do rows whose force is carried by other rows.
/// This must not affect the motion. A contact counts if it exerts a force, or has exerted one at the start of the
/// step or within it, and if along its row the velocity, or h times the acceleration, has changed in the step by more
/// than ε^⅔ of its terms and of the terms of the gap over h. Rows that are multiples of each other are one contact:
/// which of them has its force is the solver's choice.
pub(crate) fn jumps<T: Real>(
    constraints: &Constraints<'_, T>,
    g: &ContactJacobian<T>,
    [start, new]: [&Motion<T>; 2],
    h: f64,
    contact: &ContactWork<T>,
) -> bool {
    let ContactWork { trial, closed_at_start, exerting_at_start, .. } = contact;
    let flags = trial.closed.iter().zip(closed_at_start).enumerate();
    let changed = flags.filter(|(_, (now, before))| now != before).map(|(row, _)| row);
    let share = share_of_rounding::<T>();
    let per_rounding = share / rounding(T::one());
    let h = T::of(h);
    let exerts = |row: usize| exerts((constraints, g), trial, &new.u, row);
    let makes_jump = |&row: &usize| {
        if !(exerting_at_start[row] || exerts(row) || trial.impulse[row] != T::zero()) {
            return false;
        }
        // The changes of v and of a, and the magnitudes of their terms.
        let [of_v, of_a] = [(&start.v, &new.v), (&start.a, &new.a)].map(|(before, now)| {
            let change = g.product(row, now) - g.product(row, before);
            (change.abs(), g.magnitude(row, now) + g.magnitude(row, before))
        });
        let gap = constraints.gap_rounding(row, g.magnitude(row, &new.u), trial.gap[row]);
        let least = share * (of_v.1 + h * of_a.1) + per_rounding * gap / h;
        // Written so that NaN is a jump.
        let stays = of_v.0.max(h * of_a.0) <= least;
        !stays
    };
    // All rows are compared only with rows that seem to jump, up to the first that does.
    let held = |row: usize, holds: &dyn Fn(usize) -> bool| {
        holds(row) || (0..trial.closed.len()).any(|other| holds(other) && g.are_multiples(row, other))
    };
    let before = |row: usize| closed_at_start[row] && exerting_at_start[row];
    let now = |row: usize| trial.closed[row] && exerts(row);
    changed.filter(makes_jump).any(|row| !(held(row, &before) && held(row, &now)))
}
