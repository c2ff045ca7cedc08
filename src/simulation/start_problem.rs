//! The contact problem of the start: which contacts press before the first step, and how hard.

use super::constraints::Constraints;
use super::supports::finite_supports;
use crate::contact::{ContactJacobian, ContactLaw, GapRates};
use crate::contact_solver::{AdmissibleSet, ContactProblem, ContactSolver};
use crate::corrector::{Gaps, JumpProjection, contact_error, rounding};
use crate::error::Result;
use crate::real::Real;
use crate::state::{ContactState, Motion};
use crate::system::System;
use crate::tableau::ContactLevel;

/// The contact problem of the start: 0 ≤ S λ + q ⊥ λ ≥ 0. q is the acceleration of the gap without contact, or, for a
/// scheme that imposes contact ahead of the state, the violation of that condition as an acceleration.
pub(super) struct StartProblem<T> {
    /// Rows that take part.
    pub(super) rows: Vec<usize>,
    /// Rows that join the problem if the multipliers of the others close them.
    pub(super) waiting: Vec<usize>,
    /// q and its rounding, one entry a candidate.
    pub(super) offset: Vec<T>,
    pub(super) tolerance: Vec<T>,
    /// Additions to the diagonal of S, one entry a candidate.
    compliance: Vec<T>,
    lambda: Vec<T>,
}

impl<T: Real> StartProblem<T> {
    /// Contacts at rest: touching, and neither approaching nor separating. One that approaches is left to the first
    /// step, one that separates is open.
    pub(super) fn at_rest(
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        motion: &Motion<T>,
        h: f64,
        touching: &[bool],
    ) -> Result<Self> {
        let mut rates = vec![GapRates::default(); constraints.len()];
        constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
        let rows = (0..constraints.len()).filter(|&row| {
            let rate = g.product(row, &motion.v) + rates[row].rate;
            // The way in one step that the tolerance of touching allows is not allowed here: at rest the rate is zero
            // but for rounding.
            let still =
                rate.abs() * T::of(h) <= rounding(g.magnitude(row, &motion.u) + T::of(h) * g.magnitude(row, &motion.v));
            constraints.law(row).is_equality() || touching[row] && still
        });
        let own = |row: usize| rates[row].acceleration;
        Ok(Self {
            rows: rows.collect(),
            waiting: Vec::new(),
            offset: (0..constraints.len()).map(|row| g.product(row, &motion.a) + own(row)).collect(),
            tolerance: (0..constraints.len())
                .map(|row| rounding(g.magnitude(row, &motion.a) + own(row).abs()))
                .collect(),
            compliance: vec![T::zero(); constraints.len()],
            lambda: Vec::new(),
        })
    }

    /// Adds the laws whose force depends on the acceleration: 0 ≤ g̈ + (k g + λ)/m ⊥ λ ≥ 0.
    pub(super) fn add_inertial(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        motion: &Motion<T>,
        gaps: &[T],
    ) -> Result<()> {
        let inertia = |law: ContactLaw| T::of(law.inertia());
        if !constraints.laws().inertial {
            return Ok(());
        }
        let mut rates = vec![GapRates::default(); constraints.len()];
        constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
        for row in 0..constraints.len() {
            let law = constraints.law(row);
            if inertia(law) > T::zero() {
                let per_gap = inertia(law).recip();
                let (compliance, _) = law.linearized(T::zero(), T::zero());
                self.compliance[row] = per_gap * compliance;
                self.offset[row] = g.product(row, &motion.a) + rates[row].acceleration + per_gap * gaps[row];
                self.tolerance[row] = rounding(g.magnitude(row, &motion.a) + self.offset[row].abs());
                match gaps[row] < T::zero() {
                    true => self.rows.push(row),
                    false => self.waiting.push(row),
                }
            }
        }
        self.rows.sort_unstable();
        Ok(())
    }

    /// Contacts that would violate the condition that the scheme imposes ahead of the state.
    pub(super) fn ahead(
        contact: ContactLevel,
        system: &mut dyn System<T>,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        motion: &Motion<T>,
        h: f64,
        touching: &[bool],
    ) -> Result<Self> {
        let lead = contact.lead() * h;
        let t = motion.t + lead;
        let mut target = motion.u.clone();
        let mut y = vec![T::zero(); constraints.len()];
        let prescribed = system.prescribed().to_vec();
        let mut supports = vec![[T::zero(); 3]; prescribed.len()];
        system.prescribed_motion(t, &mut supports)?;
        finite_supports(t, &prescribed, &supports)?;
        // y = (y without contact) + factor S λ.
        let (factor, open) = match contact {
            ContactLevel::Position { .. } => {
                T::axpy(T::of(lead), &motion.v, &mut target);
                T::axpy(T::of(0.5 * lead * lead), &motion.a, &mut target);
                for (&dof, support) in prescribed.iter().zip(&supports) {
                    target[dof] = support[0];
                }
                let there = (t, [&target[..], &motion.v, &motion.a]);
                constraints.elsewhere(0, there, (motion.t, &motion.u), &mut y)?;
                (0.5 * lead * lead, vec![true; constraints.len()])
            }
            ContactLevel::Velocity { .. } => {
                target.copy_from_slice(&motion.v);
                T::axpy(T::of(lead), &motion.a, &mut target);
                for (&dof, support) in prescribed.iter().zip(&supports) {
                    target[dof] = support[1];
                }
                let mut rates = vec![GapRates::default(); constraints.len()];
                constraints.finite_rates(t, &motion.u, &motion.v, &mut rates)?;
                for (row, (y, rate)) in y.iter_mut().zip(&rates).enumerate() {
                    *y = g.product(row, &target) + rate.rate;
                }
                constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
                for (row, (y, rate)) in y.iter_mut().zip(&rates).enumerate() {
                    if let Some(coefficient) = constraints.law(row).restitution() {
                        *y += T::of(coefficient) * (g.product(row, &motion.v) + rate.rate);
                    }
                }
                (lead, touching.to_vec())
            }
        };
        let scale = T::of(factor).recip();
        let rounded = |row: usize, magnitude: T, y: T| match contact {
            ContactLevel::Position { .. } => constraints.gap_rounding(row, magnitude, y),
            ContactLevel::Velocity { .. } => rounding(magnitude + y.abs()),
        };
        let tolerance: Vec<T> =
            y.iter().enumerate().map(|(row, &y)| scale * rounded(row, g.magnitude(row, &target), y)).collect();
        // The stabilized bipenalty compares with the step before: the gap is taken to have been the same.
        if constraints.laws().predictive {
            let mut gaps = vec![T::zero(); constraints.len()];
            constraints.finite_gaps(motion.t, &motion.u, &mut gaps)?;
            for (row, (y, gap)) in y.iter_mut().zip(gaps).enumerate() {
                if constraints.law(row).is_predictive() {
                    *y += gap - T::of(2.0) * (-gap).max(T::zero());
                }
            }
        }
        let offset: Vec<T> = y.into_iter().map(|y| scale * y).collect();
        let takes_part = |row: &usize| constraints.law(*row).is_equality() || offset[*row] < -tolerance[*row];
        let aimed = |row: &usize| open[*row] && constraints.law(*row).needs_multiplier();
        let (rows, waiting) = (0..constraints.len()).filter(aimed).partition(takes_part);
        // (A mean gap changes by half of the response.)
        let compliance = |law: ContactLaw| T::of(2.0) * scale * law.linearized(T::one(), T::zero()).0;
        let compliance = (0..constraints.len()).map(|row| compliance(constraints.law(row))).collect();
        Ok(Self { rows, waiting, offset, tolerance, compliance, lambda: Vec::new() })
    }

    /// Applies the multipliers and closes their contacts.
    pub(super) fn press(
        self,
        g: &ContactJacobian<T>,
        projection: &mut JumpProjection<T>,
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) {
        projection.prepare(g, &self.rows);
        for (&row, &lambda) in self.rows.iter().zip(&self.lambda) {
            projection.push(g, row, lambda, &mut motion.a);
            contacts.lambda[row] = lambda;
            contacts.lambda_raw[row] = lambda;
            contacts.closed[row] = true;
        }
    }

    pub(super) fn solve(
        &mut self,
        t: f64,
        constraints: &Constraints<'_, T>,
        g: &ContactJacobian<T>,
        projection: &mut JumpProjection<T>,
        solver: &mut dyn ContactSolver<T>,
    ) -> Result<()> {
        let Self { rows, waiting, offset, tolerance, compliance, lambda } = self;
        let mut s = Vec::new();
        while !rows.is_empty() {
            projection.assemble(g, rows, &mut s);
            for (k, &row) in rows.iter().enumerate() {
                s[k * rows.len() + k] += compliance[row];
            }
            let pick = |values: &[T]| -> Vec<T> { rows.iter().map(|&row| values[row]).collect() };
            let sets: Vec<AdmissibleSet> = rows.iter().map(|&row| constraints.law(row).into()).collect();
            let (q, rounded) = (pick(offset), pick(tolerance));
            lambda.clear();
            lambda.resize(rows.len(), T::zero());
            solver.reserve(rows.len());
            let problem = ContactProblem::of(&s, &q, &sets, &rounded, 0);
            solver
                .solve(&problem, lambda)
                .map_err(|failure| contact_error(t, failure, |i| constraints.ids[rows[i]]))?;
            let mut pushed = vec![T::zero(); projection.dofs()];
            for (&row, &lambda) in rows.iter().zip(lambda.iter()) {
                projection.push(g, row, lambda, &mut pushed);
            }
            let violated = |row: &usize| offset[*row] + g.product(*row, &pushed) < -tolerance[*row];
            let joining: Vec<usize> = waiting.iter().copied().filter(violated).collect();
            if joining.is_empty() {
                break;
            }
            waiting.retain(|row| !joining.contains(row));
            rows.extend(joining);
            rows.sort_unstable();
        }
        Ok(())
    }
}
