//! The state at the start: supports, contacts, accelerations, and the past that a multistep scheme needs.
//!
//! In the order of execution:
//!
//! - `rate_check`: gap rates and rows are compared with gaps.
//! - `overclosures`: which contacts touch; bodies that overlap at the start.
//! - `balance`, `parts`: dofs without mass, or bodies at rest, are brought into static balance.
//! - `problem`, `slides`: the contact problem of the accelerations, with friction.
//! - `past`: past states computed from a motion.
//! - `resumed`, `checkpoint`: a run is continued from another one, or from a file.

pub(super) mod balance;
#[cfg(feature = "serde")]
pub(super) mod checkpoint;
pub(super) mod overclosures;
mod parts;
pub(super) mod past;
pub(super) mod problem;
pub(super) mod rate_check;
pub(super) mod resumed;
mod slides;

use crate::contact::{Candidates, ContactJacobian, GapRates};
use crate::contact_solver::ContactSolver;
use crate::corrector::{Gaps, JumpProjection};
use crate::error::{Error, Result};
use crate::linear_solver::LinearSolver;
use crate::mass::InverseMass;
use crate::ranks::Together;
use crate::real::Real;
use crate::simulation::build::scheme::Scheme;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::supports::put_initial_supports;
use crate::simulation::start::balance::StartAdjustment;
use crate::simulation::start::problem::{StartImpact, StartProblem};
use crate::simulation::start::rate_check::RateCheck;
use crate::simulation::step::finite::check_state;
use crate::state::{Clock, ComputedMotions, ContactState, History, Motion, Pace, State};
use crate::system::System;

/// The data from which the state at the start is computed.
pub(crate) struct Start<'s, 'a, T: Real> {
    pub(crate) system: &'s mut dyn System<T>,
    pub(crate) contact_solver: &'s mut dyn ContactSolver<T>,
    pub(crate) constraints: &'s mut Constraints<'a, T>,
    pub(crate) g: &'s mut ContactJacobian<T>,
    pub(crate) projection: &'s mut JumpProjection<T>,
    pub(crate) scheme: &'s Scheme<'s>,
    pub(crate) together: &'s Together<T>,
    pub(crate) h: f64,
    /// Free dofs without mass.
    pub(crate) massless: &'s [usize],
    pub(crate) origin: Origin,
    /// Whether accelerations belong to the smooth motion, without the forces of closed contacts.
    pub(crate) is_smooth: bool,
}

/// How bodies that overlap at the start are treated, in rigid contacts and equality rows. Mesh generators leave small
/// overlaps.
///
/// Gaps within the rounding of the numbers that they are computed from count as zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum InitialOverclosure {
    /// Fails with [`Error::InitialViolation`], which states the depth.
    #[default]
    Refused,
    /// The depth is added to the gap for the whole run, so that the contact starts closed and without strain. It is
    /// added to all gaps of the feature ([`ContactId::feature`](crate::contact::ContactId::feature)), so that a
    /// sliding node keeps it.
    AdjustedGaps,
    /// The depth is added at first, and removed over this time by the factor 1 − 3 τ² + 2 τ³ with τ from 0 to 1. This
    /// strains the bodies like an interference fit.
    RemovedOver(f64),
}

/// The source of the motion at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Origin {
    /// Initial values of a new run.
    Initial {
        overclosure: InitialOverclosure,
        /// Whether all dofs of bodies without a velocity are brought into static balance, not only those without mass.
        is_at_rest: bool,
    },
    /// A run that starts anew. Schemes that impose contact on velocities leave penetrations behind, which stay;
    /// velocities stay unchanged.
    Restart,
}

/// The data from which a run starts.
pub(crate) struct Begun<T: Real> {
    pub(crate) state: State<T>,
    pub(crate) history: History<T>,
    pub(crate) adjustment: Option<StartAdjustment<T>>,
}

/// M⁻¹ on the free dofs.
pub(crate) fn projection<T: Real>(
    system: &dyn System<T>,
    constraints: &Constraints<'_, T>,
    (together, solver): (&Together<T>, &dyn LinearSolver<T>),
) -> Result<JumpProjection<T>> {
    let (mass, interface) = (system.mass(), constraints.interface());
    let inverse = match together.is_alone() {
        true => InverseMass::new(mass, system.prescribed(), interface)?,
        false => InverseMass::through(solver, mass, system.prescribed())?,
    };
    Ok(JumpProjection::with(inverse, system.dofs()))
}

impl<T: Real> Start<'_, '_, T> {
    /// State and past from a motion of which displacements and velocities are given.
    pub(crate) fn begin(mut self, mut motion: Motion<T>) -> Result<Begun<T>> {
        let mut contacts = self.find_contacts(&mut motion)?;
        let mut touching = self.touching(&motion, T::zero(), &mut contacts)?;
        let (balanced, mut adjustment) = self.balance_displacements(&mut motion, &mut contacts)?;
        if adjustment.is_some() {
            contacts.reset(&self.constraints.ids, self.constraints.tangents());
            touching = self.touching(&motion, balanced.tolerance, &mut contacts)?;
        }
        self.load_massless(&balanced.forces, &touching, &mut contacts);
        if let Some(impact) = self.accelerate(&touching, &mut motion, &mut contacts)? {
            let unmoved = StartAdjustment { energy: Some(T::zero()), largest: T::zero(), dof: 0, impact: None };
            adjustment = Some(StartAdjustment { impact: Some(impact), ..adjustment.unwrap_or(unmoved) });
        }
        if self.is_smooth {
            self.remove_jumps(&contacts, &mut motion)?;
        }

        let Self { scheme, h, .. } = self;
        let mut slots = vec![Motion::zero(motion.u.len()); scheme.slots()];
        let is_known = self.fill_past(&motion, &mut slots[1..scheme.depth])?;
        let known = if is_known { scheme.depth } else { 1 };
        let rates = scheme.rates(&motion);
        // A scheme that stores the velocity at another time gets the velocity at that time. The acceleration is left
        // at the start: its rate is unknown, and an estimate would be dominated by the stiffest mode.
        let Motion { v, a, .. } = &mut motion;
        T::axpy(T::of(scheme.shifts[0] * h), a, v);
        let history = History {
            slots,
            known,
            smooth: known,
            clock: Clock::new(motion.t, h),
            pace: Pace::new(h),
            made_with: h,
            computed: ComputedMotions::default(),
            unshifted: [Vec::new(), Vec::new()],
            slopes: self.massless.iter().map(|&dof| motion.v[dof]).collect(),
            scheme: scheme.integrator.name(),
            overclosures: self.constraints.offsets.overclosures().cloned(),
        };
        let state = State { motion, rates, contacts, broken: Vec::new() };
        check_state(h, &state)?;
        Ok(Begun { state, history, adjustment })
    }

    /// Puts the supports in place, and finds and checks the candidates.
    fn find_contacts(&mut self, motion: &mut Motion<T>) -> Result<ContactState<T>> {
        let supports = put_initial_supports(self.system, motion.t, &mut motion.u, &mut motion.v)?;
        for (&dof, support) in self.system.prescribed().iter().zip(&supports) {
            motion.a[dof] = support[2];
        }
        self.search(motion)?;
        let Self { system, constraints, g, projection, h, .. } = self;
        constraints.check_rows(g, system.prescribed(), motion.t, &motion.u)?;
        RateCheck::new(constraints.len()).check(constraints, motion, *h, g)?;
        projection.reset();
        let mut contacts = ContactState::default();
        contacts.reset(&constraints.ids, constraints.tangents());
        Ok(contacts)
    }

    /// Finds the candidates of the first step.
    fn search(&mut self, motion: &Motion<T>) -> Result<Candidates> {
        self.constraints.search(motion, self.scheme.ahead() * self.h, self.g)
    }

    /// The parts of gap rates and slip rates at a time that do not come from v and a, one entry per row of G.
    fn rates(&mut self, t: f64, motion: &Motion<T>) -> Result<Vec<GapRates<T>>> {
        let Self { constraints, g, .. } = self;
        let mut rates = vec![GapRates::default(); g.rows()];
        let (gaps, slips) = rates.split_at_mut(constraints.len());
        constraints.finite_rates(t, &motion.u, &motion.v, gaps)?;
        constraints.finite_slip_rates(t, &motion.u, &motion.v, slips)?;
        Ok(rates)
    }

    /// Stores the contact forces on dofs without mass from their static balance.
    fn load_massless(&self, forces: &[T], touching: &[bool], contacts: &mut ContactState<T>) {
        let (constraints, g) = (&self.constraints, &self.g);
        let is_static = |row: &usize| g.acts_on(*row, self.massless) && !constraints.law(*row).is_spring();
        for row in (0..constraints.len()).filter(is_static) {
            contacts.closed[row] = touching[row] || forces[row] > T::zero();
            for k in std::iter::once(row).chain(constraints.tangents().of(row)) {
                contacts.lambda[k] = forces[k];
            }
        }
    }

    /// Solves for accelerations and contact forces: M a = f + Gᵀ λ with 0 ≤ λ ⊥ g̈ ≥ 0 on contacts at rest. If
    /// friction jams one of them in a new run, an impact stops its slip first, which changes the velocities. There is
    /// no second impact.
    fn accelerate(
        &mut self,
        touching: &[bool],
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<Option<StartImpact<T>>> {
        let known = (motion.a.clone(), contacts.clone());
        let mut problem = self.problem(touching, motion, contacts)?;
        let mut solved = problem.solve(self, motion.t);
        let mut impact = None;
        if let Err(Error::Jammed { contact, .. }) = &solved
            && problem.is_of_accelerations()
            && self.origin != Origin::Restart
            && let Some(row) = self.constraints.ids.iter().position(|id| id == contact)
        {
            impact = problem.stop(self, row, motion)?;
            if impact.is_some() {
                (motion.a, *contacts) = known;
                problem = self.problem(touching, motion, contacts)?;
                problem.stick(row);
                solved = problem.solve(self, motion.t);
            }
        }
        solved?;
        problem.apply(self, motion, contacts)?;
        Ok(impact)
    }

    /// The contact problem of the accelerations, which are left without the contact forces that it will find.
    fn problem(
        &mut self,
        touching: &[bool],
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<StartProblem<T>> {
        self.balance_velocities(touching, motion, contacts)?;
        let Self { system, g, projection, h, .. } = &mut *self;
        // M a = f + Gᵀ λ − M a_p on free dofs, with the contact forces that are known.
        let mut a = vec![T::zero(); motion.u.len()];
        system.force(motion.t, &motion.u, &motion.v, &mut a)?;
        system.mass().add_product(-T::one(), &motion.a, &mut a);
        for (row, &force) in contacts.lambda.iter().enumerate().filter(|(_, force)| **force != T::zero()) {
            g.scatter(row, force, &mut a);
        }
        projection.apply_inverse(&mut a)?;
        for &dof in system.prescribed() {
            a[dof] = motion.a[dof];
        }
        motion.a = a;
        if let Some(dof) = motion.a.iter().position(|a| !a.is_finite()) {
            let value = motion.a[dof].value();
            return Err(Error::StepNotFinite { t: motion.t, h: *h, what: "the initial acceleration", dof, value });
        }
        StartProblem::new(self, touching, motion, contacts)
    }

    /// Removes the effect of closed contacts from the accelerations.
    fn remove_jumps(&mut self, contacts: &ContactState<T>, motion: &mut Motion<T>) -> Result<()> {
        let Self { constraints, g, projection, massless, .. } = self;
        let jumps = |&row: &usize| {
            let owner = constraints.tangents().owner(row);
            !constraints.law(owner).is_compliant() && !constraints.tangents().act_on(g, owner, massless)
        };
        let (rows, forces): (Vec<usize>, Vec<T>) =
            (0..g.rows()).filter(jumps).map(|row| (row, contacts.lambda[row])).unzip();
        projection.push(g, (&rows, &forces), -T::one(), &mut motion.a)
    }
}
