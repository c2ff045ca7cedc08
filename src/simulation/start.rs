//! The state at the start: supports, contacts, accelerations, and the past that a multistep scheme needs.

use super::Constraints;
use super::step::finite_supports;
use crate::contact::{ContactJacobian, ContactLaw, GapRates};
use crate::contact_solver::{Bound, ContactProblem, ContactSolver};
use crate::corrector::{Gaps, JumpProjection, contact_error, rounding};
use crate::error::{Error, Result};
use crate::mass::InverseMass;
use crate::real::Real;
use crate::state::{ContactState, Motion};
use crate::system::System;

/// What the state at the start is made from.
pub(super) struct Start<'s, T: Real> {
    pub(super) system: &'s mut dyn System<T>,
    pub(super) contact_solver: &'s mut dyn ContactSolver<T>,
    pub(super) h: f64,
    pub(super) t: f64,
}

/// M⁻¹ on the free dofs with room for `rows` contacts.
pub(super) fn projection<T: Real>(system: &dyn System<T>, dofs: usize, rows: usize) -> Result<JumpProjection<T>> {
    JumpProjection::with(InverseMass::new(system.mass(), system.prescribed())?, dofs, rows)
}

impl<T: Real> Start<'_, T> {
    /// Motion and contacts at the start: supports in place, M a = f + Gᵀ λ with 0 ≤ λ ⊥ g̈ ≥ 0 on contacts at rest.
    pub(super) fn state(
        self,
        u: Vec<T>,
        v: Vec<T>,
        constraints: &mut Constraints<'_, T>,
        g: &mut ContactJacobian<T>,
        rows: usize,
    ) -> Result<(Motion<T>, ContactState<T>, JumpProjection<T>)> {
        let Self { system, contact_solver, h, t } = self;
        let dofs = u.len();
        let prescribed = system.prescribed().to_vec();
        let mut supports = vec![[T::zero(); 3]; prescribed.len()];
        system.prescribed_motion(t, &mut supports);
        let mut motion = Motion { t, u, v, a: vec![T::zero(); dofs] };
        finite_supports(t, &prescribed, &supports)?;
        for (&dof, support) in prescribed.iter().zip(&supports) {
            put(&mut motion.u[dof], support[0], "displacement", dof)?;
            put(&mut motion.v[dof], support[1], "velocity", dof)?;
            motion.a[dof] = support[2];
        }
        constraints.search(t, &motion.u, &motion.v, g)?;
        constraints.check_rows(g, &prescribed, t, &motion.u)?;

        // Accelerations without contact: M a = f − M a_p on free dofs.
        let mut projection = projection(system, dofs, rows)?;
        let mut force = vec![T::zero(); dofs];
        system.force(t, &motion.u, &motion.v, &mut force)?;
        system.mass().product(-T::one(), &motion.a, &mut force);
        projection.apply_inverse(&mut force);
        for (&dof, support) in prescribed.iter().zip(&supports) {
            force[dof] = support[2];
        }
        motion.a = force;
        if let Some(dof) = motion.a.iter().position(|a| !a.is_finite()) {
            let value = motion.a[dof].value();
            return Err(Error::StepNotFinite { t, h, what: "the initial acceleration", dof, value });
        }

        let mut contacts = ContactState::with_capacity(rows);
        contacts.reset(&constraints.ids);
        let resting = resting_contacts(constraints, g, &motion, h, &mut contacts)?;
        if !resting.is_empty() {
            let mut rates = vec![GapRates::default(); constraints.len()];
            constraints.rates(t, &motion.u, &motion.v, &mut rates);
            let mut s = Vec::new();
            projection.assemble(g, &resting, &mut s);
            let offset: Vec<T> =
                resting.iter().map(|&row| g.product(row, &motion.a) + rates[row].acceleration).collect();
            let tolerance: Vec<T> = resting
                .iter()
                .map(|&row| rounding(g.magnitude(row, &motion.a) + rates[row].acceleration.abs()))
                .collect();
            let bounds: Vec<Bound> = resting
                .iter()
                .map(|&row| match constraints.law(row) {
                    ContactLaw::Equality => Bound::Free,
                    ContactLaw::Rigid => Bound::NonNegative,
                })
                .collect();
            let mut lambda = vec![T::zero(); resting.len()];
            contact_solver.reserve(resting.len());
            let problem = ContactProblem { delassus: &s, offset: &offset, bounds: &bounds, tolerance: &tolerance };
            contact_solver
                .solve(&problem, &mut lambda)
                .map_err(|failure| contact_error(t, failure, |i| constraints.ids[resting[i]]))?;
            for (&row, &lambda) in resting.iter().zip(&lambda) {
                projection.push(g, row, lambda, &mut motion.a);
                contacts.lambda[row] = lambda;
                contacts.lambda_raw[row] = lambda;
            }
        }
        Ok((motion, contacts, projection))
    }
}

/// Puts a support's value where the host left zero or gave the same.
fn put<T: Real>(place: &mut T, prescribed: T, what: &'static str, dof: usize) -> Result<()> {
    let given = *place;
    let same = (given - prescribed).abs() <= T::of(1e3) * T::epsilon() * prescribed.abs();
    if given != T::zero() && !same {
        let (given, prescribed) = (given.value(), prescribed.value());
        return Err(Error::PrescribedStart { what, dof, given, prescribed });
    }
    *place = prescribed;
    Ok(())
}

/// Marks closed contacts; returns those at rest. A contact that approaches is left to the first step, one that
/// separates is open.
fn resting_contacts<T: Real>(
    constraints: &mut Constraints<'_, T>,
    g: &ContactJacobian<T>,
    motion: &Motion<T>,
    h: f64,
    contacts: &mut ContactState<T>,
) -> Result<Vec<usize>> {
    let mut rates = vec![GapRates::default(); constraints.len()];
    constraints.finite_gaps(motion.t, &motion.u, &mut contacts.gap)?;
    constraints.rates(motion.t, &motion.u, &motion.v, &mut rates);
    let mut resting = Vec::new();
    for (row, rates) in rates.iter().enumerate() {
        let rate = g.product(row, &motion.v) + rates.rate;
        let gap = contacts.gap[row];
        let tolerance = rounding(g.magnitude(row, &motion.u) + gap.abs()) + T::of(1e-10 * h) * rate.abs();
        let equality = constraints.law(row) == ContactLaw::Equality;
        if gap < -tolerance || (equality && gap > tolerance) {
            let contact = constraints.ids[row];
            return Err(Error::InitialViolation { contact, gap: gap.value(), tolerance: tolerance.value() });
        }
        // The sliver of approach that counts as touching does not count as rest.
        let still =
            rate.abs() * T::of(h) <= rounding(g.magnitude(row, &motion.u) + T::of(h) * g.magnitude(row, &motion.v));
        if equality || (gap <= tolerance && still) {
            contacts.closed[row] = true;
            resting.push(row);
        }
    }
    Ok(resting)
}

/// Whether accelerations change no velocity within a step beyond rounding: then the straight-line past is exact.
pub(super) fn is_free_flight<T: Real>(motion: &Motion<T>, h: f64) -> bool {
    let largest = |x: &[T]| x.iter().fold(T::zero(), |largest, x| largest.max(x.abs()));
    T::of(h) * largest(&motion.a) <= T::of(64.0) * T::epsilon() * largest(&motion.v)
}

/// Fills past states 1, 2, … with u − k h v, v, 0.
pub(super) fn straight_past<T: Real>(motion: &Motion<T>, h: f64, past: &mut [Motion<T>]) {
    for (k, slot) in (1_u32..).zip(past) {
        let back = f64::from(k) * h;
        slot.t = motion.t - back;
        slot.u.copy_from_slice(&motion.u);
        T::axpy(T::of(-back), &motion.v, &mut slot.u);
        slot.v.copy_from_slice(&motion.v);
        slot.a.fill(T::zero());
    }
}
