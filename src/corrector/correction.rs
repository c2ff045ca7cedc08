//! Data and operations for correctors: the jumps of a stage, the projection that removes them, impulses and forces
//! along rows, and their bookkeeping. Code that serves a single corrector is in the file of that corrector.

mod energy;
mod friction;
mod parts;
mod past;
mod restitution;

use super::group_problem::Jumps;
use super::{Buffers, Corrector, JumpProjection};
use crate::contact::{ContactJacobian, ErasedGaps, GapRates};
use crate::contact_solver::{AdmissibleSet, ContactSolver, no_response};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::{MasslessBlock, Operator};
use crate::state::{Backup, ContactState, Motion};
use crate::system::{Linearity, System};
pub(super) use restitution::Rebounds;

/// One stage after its contact problem, passed to a [`Corrector`](super::Corrector).
///
/// Jumps are solved first (`solve_…`), then applied (`push_…`). *Engaged* rows are the closed rows that are pressed
/// (raw multiplier positive, or equality rows) and the rows that touch and approach; a row that touches and separates
/// is left alone. Every push along a row is booked as an impulse of its contact, so that Σ h β p + Σ J is the change
/// of momentum to rounding.
///
/// A user's corrector has the same access as the built-in ones: rows ([`closed`](Self::closed),
/// [`engaged`](Self::engaged), [`opened`](Self::opened), [`released`](Self::released)), forces
/// ([`ContactState::raw_forces`] by [`contacts`](Self::contacts), [`previous_force`](Self::previous_force)), gaps and
/// rates ([`starting_gaps`](Self::starting_gaps), [`rate`](Self::rate)), coefficients of the scheme
/// ([`response`](Self::response), [`force_share`](Self::force_share), [`momentum_weights`](Self::momentum_weights))
/// and of the bodies ([`compliance`](Self::compliance), [`compliances`](Self::compliances)), and changes of v
/// ([`apply_impulses`](Self::apply_impulses), [`exchange_energy`](Self::exchange_energy)), of a
/// ([`apply_forces`](Self::apply_forces), [`report_force`](Self::report_force)) and of past states
/// ([`move_past`](Self::move_past), [`project_past`](Self::project_past)).
///
/// ```
/// use contact_dynamics::corrector::{Correction, Corrector};
/// use contact_dynamics::{PersistencyCorrection, Result};
///
/// /// Gives back a share of the energy that an impact took, as soon as the contact is open.
/// #[derive(Debug)]
/// struct Rebound(f64);
///
/// impl Corrector<f64> for Rebound {
///     fn name(&self) -> String {
///         format!("rebound({})", self.0)
///     }
///     fn correct(&self, step: &mut Correction<'_, f64>) -> Result<()> {
///         for i in 0..step.released().len() {
///             let row = step.released()[i];
///             let energy = self.0 * step.contacts().dissipated()[row];
///             step.exchange_energy(row, energy)?;
///         }
///         Ok(())
///     }
/// }
///
/// let correctors: [Box<dyn Corrector<f64>>; 2] = [Box::new(PersistencyCorrection::new()), Box::new(Rebound(0.25))];
/// # let _ = correctors;
/// ```
#[derive(Debug)]
pub struct Correction<'a, T: Real> {
    pub(crate) h: f64,
    pub(crate) t: f64,
    pub(crate) scheme: Scheme<'a>,
    pub(crate) g: &'a ContactJacobian<T>,
    pub(crate) projection: &'a mut JumpProjection<T>,
    /// The factorized effective matrix of the stage.
    pub(crate) operator: &'a mut Operator<T>,
    /// The block of dofs without mass that follow statically.
    pub(crate) block: Option<&'a mut MasslessBlock<T>>,
    pub(crate) solver: &'a mut dyn ContactSolver<T>,
    pub(crate) system: Erased<'a, T>,
    pub(crate) constraints: ErasedGaps<'a, T>,
    pub(crate) new: &'a mut Motion<T>,
    pub(crate) past: &'a mut [Motion<T>],
    pub(crate) backup: &'a mut Backup<T>,
    pub(crate) contacts: &'a mut ContactState<T>,
    /// Closed flags before this stage.
    pub(crate) was_closed: &'a [bool],
    /// Closed flags at the start of the step.
    pub(crate) closed_at_start: &'a [bool],
    /// Contacts that stuck before this stage; empty without friction.
    pub(crate) was_sticking: &'a [bool],
    pub(crate) massless: &'a [usize],
    pub(crate) prescribed: &'a [usize],
    pub(crate) buffers: &'a mut Buffers<T>,
    /// Change of kinetic energy by velocity corrections, without the corrections of contacts that close in this step:
    /// these are part of the impact.
    pub(crate) energy: &'a mut T,
}

/// The coefficients of the scheme that a correction needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scheme<'a> {
    /// Change of (u, h v, h² a) by a unit multiplier on a unit mass, in units of h².
    pub(crate) response: [f64; 3],
    /// z-weight of the acceleration row.
    pub(crate) acceleration: f64,
    /// z-weight of the acceleration row of the balance.
    pub(crate) balance: f64,
    /// Momentum covector over the past after this stage.
    pub(crate) covector: &'a [[f64; 3]],
    /// Which entries of past states later rows read.
    pub(crate) read: &'a [[bool; 3]],
    /// Whether the next stage starts from a.
    pub(crate) reads_acceleration: bool,
    /// Whether the balance holds at the state and u follows from velocities alone.
    pub(crate) keeps_balance: bool,
    /// This stage, from 0, and the number of stages of a step.
    pub(crate) stage: usize,
    pub(crate) stages: usize,
    /// The length of this stage as a fraction of the step.
    pub(crate) length: f64,
}

impl Scheme<'_> {
    /// Whether the state of the stage is also the state of the step.
    fn is_last(&self) -> bool {
        self.stage + 1 == self.stages
    }
}

/// Which jump is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Jump {
    Velocity,
    Acceleration,
}

impl Jump {
    /// The rates of the dofs in the jump, and the rate or acceleration that the gap function itself adds.
    fn terms<'m, T: Real>(self, motion: &'m Motion<T>, gap: &GapRates<T>) -> (&'m [T], T) {
        match self {
            Self::Velocity => (&motion.v, gap.rate),
            Self::Acceleration => (&motion.a, gap.acceleration),
        }
    }
}

/// Whether pressed contacts may separate under the computed velocities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pressed {
    /// They stay closed: their jumps vanish in both directions.
    Stays,
    /// They may separate, as touching contacts do.
    MayPart,
}

/// A borrowed system, debug-printable.
pub(crate) struct Erased<'a, T: Real>(pub(crate) &'a mut dyn System<T>);

impl<T: Real> std::fmt::Debug for Erased<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "System({} dofs)", self.0.dofs())
    }
}

impl<T: Real> Correction<'_, T> {
    /// Calls each corrector that has something to correct: jumps, or contacts without mass that close or open.
    pub(crate) fn correct(&mut self, correctors: &[Box<dyn Corrector<T> + '_>]) -> Result<()> {
        let [jumps, switches] = [self.buffers.has_jumps(), self.buffers.switching.is_pending()];
        for corrector in correctors {
            let concerns = if corrector.effects().corrects_massless { switches } else { jumps };
            if concerns {
                corrector.correct(self)?;
            }
        }
        Ok(())
    }

    /// Whether a row is pressed: its jumps vanish in both directions.
    fn is_pressed(&self, row: usize) -> bool {
        self.contacts.lambda_raw[row] > T::zero() || self.constraints.0.law(row).is_equality()
    }

    /// Finds the engaged rows and the impulses that make the gap rates of the closed rows vanish (pressed rows) or
    /// nonnegative (touching rows). Rows that close under a law with restitution get their rebound rates and are then
    /// not engaged.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`], [`Error::Contact`].
    pub fn solve_velocity_jumps(&mut self) -> Result<()> {
        if self.find_rebounds()? {
            return self.solve_rebounds();
        }
        if self.rubs() {
            return self.solve_rubbing_velocity(Pressed::Stays);
        }
        let rows = std::mem::take(&mut self.buffers.closed);
        let mut impulses = std::mem::take(&mut self.buffers.impulses);
        let result = self.solve_jumps(&rows, Jump::Velocity, &mut impulses);
        let Buffers { engaged, sets, .. } = &mut *self.buffers;
        engaged.clear();
        for ((&row, &set), &impulse) in rows.iter().zip(&*sets).zip(&impulses) {
            if set == AdmissibleSet::Free || impulse > T::zero() {
                engaged.push(row);
            }
        }
        self.buffers.closed = rows;
        self.buffers.impulses = impulses;
        result
    }

    /// The jump caused by the rounding of a gap in the scheme. Dependent rows may contradict each other by this much.
    fn rounding_of_gap(&self, row: usize, jump: Jump) -> T {
        /// Tolerated error of a gap, in roundings.
        const ROUNDINGS: f64 = 32.0;
        let [by_u, by_v, by_a] = self.scheme.response;
        let per_gap = T::of(ROUNDINGS)
            * T::of(match jump {
                Jump::Velocity => (by_v / by_u).abs() / self.h,
                Jump::Acceleration => (by_a / by_u).abs() / (self.h * self.h),
            });
        let magnitude = self.g.magnitude(row, &self.new.u);
        per_gap * self.constraints.0.gap_rounding(row, magnitude, self.contacts.gap[row])
    }

    /// A fraction ε^⅓ of the rates in a jump. If two nodes face each other and each lies on the facets of the other,
    /// their rows and rates differ by the angle between these facets. S contains the square of this angle, and pivots
    /// below ε^⅔ count as zero ([`DenseCholesky`](crate::dense::DenseCholesky)).
    fn share_of_rate(&self, row: usize, jump: Jump) -> T {
        let (values, own) = jump.terms(self.new, &self.buffers.rates[row]);
        T::epsilon().cbrt() * (self.g.magnitude(row, values) + own.abs())
    }

    /// The multipliers of `rows` that remove a jump, within their admissible sets.
    fn solve_jumps(&mut self, rows: &[usize], jump: Jump, x: &mut Vec<T>) -> Result<()> {
        let mut sets = std::mem::take(&mut self.buffers.sets);
        sets.clear();
        sets.extend(rows.iter().map(|&row| match self.is_pressed(row) {
            true => AdmissibleSet::Free,
            false => AdmissibleSet::NonNegative,
        }));
        let Buffers { jump: jumps, tolerance, rates, .. } = &mut *self.buffers;
        let read = self.constraints.0.rates(self.t, &self.new.u, &self.new.v, rates);
        jumps.clear();
        tolerance.clear();
        for &row in rows {
            let (values, own) = jump.terms(self.new, &rates[row]);
            jumps.push(self.g.product(row, values) + own);
            tolerance.push(rounding(self.g.magnitude(row, values) + own.abs()));
        }
        x.clear();
        x.resize(rows.len(), T::zero());
        let mut result = read.and_then(|()| self.solve(rows, &sets, x));
        for excuse in [Self::rounding_of_gap, Self::share_of_rate] {
            if !matches!(result, Err(Error::ContradictoryContacts { .. } | Error::Contact { .. })) {
                break;
            }
            for (k, &row) in rows.iter().enumerate() {
                let miss = excuse(self, row, jump);
                self.buffers.tolerance[k] += miss;
            }
            x.fill(T::zero());
            result = self.solve(rows, &sets, x);
        }
        self.buffers.sets = sets;
        result
    }

    /// Applies the impulses of [`solve_velocity_jumps`](Self::solve_velocity_jumps) to v, and the resulting change of
    /// damping forces to a, as [`apply_impulses`](Self::apply_impulses) does.
    ///
    /// # Errors
    ///
    /// As [`apply_impulses`](Self::apply_impulses).
    pub fn push_velocity(&mut self) -> Result<()> {
        if self.buffers.rebounds.any() {
            self.push_rubbing_velocity()?;
            return self.release_rebounds();
        }
        if self.rubs() {
            return self.push_rubbing_velocity();
        }
        let rows = std::mem::take(&mut self.buffers.closed);
        let impulses = std::mem::take(&mut self.buffers.impulses);
        let result = self.apply(&rows, &impulses);
        for (&row, &impulse) in rows.iter().zip(&impulses).filter(|(_, impulse)| **impulse != T::zero()) {
            self.contacts.lambda_a[row] = -T::of(self.h) * impulse;
        }
        self.buffers.closed = rows;
        self.buffers.impulses = impulses;
        result
    }

    /// Applies impulses to v along rows, v ← v + δv with δv = M⁻¹ Gᵀ impulses, and, with damping, the resulting
    /// change of damping forces to a. The impulses are booked for their contacts; the energy that they take, relative
    /// to the obstacle, is booked as dissipated by these contacts.
    ///
    /// ```text
    /// a ← a − M⁻¹ C δv               by schemes that read no a, and one-step ones whose balance holds at the state
    ///                                and whose u follows from velocities: it holds at the corrected state
    /// a ← a − (w_ā/h²) A⁻¹ C δv      by all others, and in systems with damped dofs without mass: it holds to order h
    /// ```
    ///
    /// A scheme that starts its next step from a applies it over a part of that step. M⁻¹ C δv is the instantaneous
    /// rate of change of δv; if h C is large compared with M, it changes v by many times δv, although damping would
    /// have stopped the bodies by then. The trapezoidal rule and Bathe's schemes recover from this within the step,
    /// because their damping acts on the mean velocity of the step, by which u moves. In other schemes a itself moves
    /// u or enters the balance. (w_ā/h²) A⁻¹, with the matrix A of the stage, tends to M⁻¹ for small steps and gives
    /// at most δv/h for large ones; momentum is conserved as before. This costs one solve whenever v changes.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`] if a gap rate is not finite, and the errors of the linear solver; direct solvers
    /// have none.
    pub fn apply_impulses(&mut self, rows: &[usize], impulses: &[T]) -> Result<()> {
        self.read_rates()?;
        self.apply(rows, impulses)
    }

    /// Reads the gap rates that the constraints add.
    pub(super) fn read_rates(&mut self) -> Result<()> {
        self.constraints.0.rates(self.t, &self.new.u, &self.new.v, &mut self.buffers.rates)
    }

    /// [`apply_impulses`](Self::apply_impulses) if the gap rates have been read already.
    pub(super) fn apply(&mut self, rows: &[usize], impulses: &[T]) -> Result<()> {
        if impulses.iter().all(|&impulse| impulse == T::zero()) {
            return Ok(());
        }
        let Self { buffers, contacts, projection, new, g, scheme, energy, closed_at_start, .. } = self;
        let Buffers { jump, rates, change, .. } = &mut **buffers;
        jump.clear();
        jump.extend(rows.iter().map(|&row| g.product(row, &new.v)));
        projection.push(g, (rows, impulses), T::one(), &mut new.v)?;
        for (&row, &impulse) in rows.iter().zip(impulses.iter()) {
            contacts.impulse[row] += T::of(scheme.covector[0][1]) * impulse;
        }
        // Change of kinetic energy: impulse times the mean rate of the bodies before and after, without the
        // obstacle's rate.
        for ((&row, &impulse), &before) in rows.iter().zip(impulses.iter()).zip(jump.iter()) {
            // A state between stages is dropped from the past: its loss is no loss of the step.
            if !scheme.is_last() {
                continue;
            }
            let gain = impulse * T::of(0.5) * (before + g.product(row, &new.v));
            let contact = contacts.tangents.owner(row);
            if closed_at_start[contact] || !contacts.closed[contact] {
                **energy += gain;
            }
            // A moving obstacle does work, so dissipation is measured in its frame. Friction work is not booked as
            // impact energy.
            if !g.is_tangential(row) {
                contacts.dissipated[row] -= gain + impulse * rates[row].rate;
            }
        }
        if !change.is_empty() {
            change.fill(T::zero());
            projection.push(g, (rows, impulses), T::one(), change)?;
            self.damp()?;
        }
        Ok(())
    }

    /// Adds to a the effect of the damping forces after a change of v.
    pub(super) fn damp_change(&mut self, change: &[T]) -> Result<()> {
        if self.buffers.change.is_empty() {
            return Ok(());
        }
        self.buffers.change.copy_from_slice(change);
        self.damp()
    }

    /// [`damp_change`](Self::damp_change) with the change already in its buffer, which is overwritten.
    fn damp(&mut self) -> Result<()> {
        if self.evaluate_damping()? { self.accelerate_by_damping() } else { Ok(()) }
    }

    /// Evaluates the change of the damping forces caused by the velocity change in `change`, into `damping`. Returns
    /// whether there is damping.
    fn evaluate_damping(&mut self) -> Result<bool> {
        let Self { buffers, new, system, .. } = self;
        let Buffers { change, damping, before, .. } = &mut **buffers;
        let linearity = system.0.linearity();
        let Some(force) = system.0.damping_force() else { return Ok(false) };
        match linearity {
            Linearity::Linear => force.evaluate(&new.u, change, damping)?,
            // Forces that are nonlinear in v are evaluated twice.
            Linearity::Nonlinear => {
                force.evaluate(&new.u, &new.v, damping)?;
                for (change, &v) in change.iter_mut().zip(&new.v) {
                    *change = v - *change;
                }
                force.evaluate(&new.u, change, before)?;
                T::axpy(-T::one(), before, damping);
            }
        }
        Ok(true)
    }

    /// Adds to a the effect of the force change in `damping`.
    fn accelerate_by_damping(&mut self) -> Result<()> {
        let Self { buffers, projection, operator, new, scheme, h, massless, prescribed, .. } = self;
        let Buffers { damping: change, damps_massless, .. } = &mut **buffers;
        // The choice must not depend on the change itself: it may reach massless dofs by rounding only.
        if !*damps_massless && (scheme.keeps_balance || !scheme.reads_acceleration) {
            projection.apply_inverse(change)?;
            T::axpy(-T::one(), change, &mut new.a);
            return Ok(());
        }
        // Dofs without mass respond too, so that internal damping conserves momentum, but they have no acceleration.
        for &dof in *prescribed {
            change[dof] = T::zero();
        }
        operator.solve(change)?;
        for &dof in *massless {
            change[dof] = T::zero();
        }
        T::axpy(-T::of(scheme.balance / (*h * *h)), change, &mut new.a);
        Ok(())
    }

    /// Finds the forces that make the gap accelerations of the engaged rows vanish (pressed rows) or nonnegative
    /// (touching rows).
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`], [`Error::Contact`].
    pub fn solve_acceleration_jumps(&mut self) -> Result<()> {
        if self.rubs() {
            return self.solve_rubbing_acceleration();
        }
        let rows = std::mem::take(&mut self.buffers.engaged);
        let mut forces = std::mem::take(&mut self.buffers.forces);
        let result = self.solve_jumps(&rows, Jump::Acceleration, &mut forces);
        self.buffers.engaged = rows;
        self.buffers.forces = forces;
        result
    }

    /// Applies the forces of [`solve_acceleration_jumps`](Self::solve_acceleration_jumps) to a and to the reported
    /// contact force.
    ///
    /// If bodies have damping and steps start from a, the forces first cancel the contribution of the raw
    /// multipliers. The remainder y is reduced to min(1, s/d)² y, with one factor for all rows that S couples: s = yᵀ
    /// S y is the power of inertia, d the power of the damping force due to the velocity that y produces in a step. A
    /// step that resolves the damping keeps all of y. In a longer step y would act during a part of the next step
    /// although the velocities that it belongs to have decayed by then (theory, section 7.1).
    ///
    /// # Errors
    ///
    /// The errors of a solve with a consistent mass, [`Error::LinearNotConverged`] and [`Error::Singular`].
    pub fn push_acceleration(&mut self) -> Result<()> {
        if self.rubs() {
            return self.push_rubbing_acceleration();
        }
        let rows = std::mem::take(&mut self.buffers.engaged);
        let mut forces = std::mem::take(&mut self.buffers.forces);
        let result = self.push_limited_forces(&rows, &mut forces);
        (self.buffers.engaged, self.buffers.forces) = (rows, forces);
        result
    }

    /// Reduces the forces of the last problem with [`limit_forces`](Self::limit_forces) and applies them with
    /// [`push_forces`](Self::push_forces).
    fn push_limited_forces(&mut self, rows: &[usize], forces: &mut [T]) -> Result<()> {
        self.limit_forces(rows, forces, T::of(self.scheme.acceleration / self.scheme.balance))?;
        self.push_forces(rows, forces)
    }

    /// Adds forces to a, to the reported forces and to the impulses.
    fn push_forces(&mut self, rows: &[usize], forces: &[T]) -> Result<()> {
        let Self { contacts, projection, new, g, scheme, h, .. } = self;
        let share = T::of(scheme.balance / scheme.acceleration);
        projection.push(g, (rows, forces), T::one(), &mut new.a)?;
        for (&row, &force) in rows.iter().zip(forces) {
            contacts.lambda[row] += share * force;
            contacts.lambda_v[row] = T::of(*h / scheme.acceleration) * force;
            contacts.impulse[row] += T::of(scheme.covector[0][2] * *h) * force;
        }
        Ok(())
    }

    /// Reduces the forces that remove acceleration jumps if the step does not resolve the damping. The part that
    /// cancels `given` times the raw multipliers is kept.
    ///
    /// All groups of rows that S couples are tested together. Groups that pass are set aside and the others are
    /// tested again without them, so that damping that the step resolves reduces no force, whichever groups it
    /// couples.
    pub(super) fn limit_forces(&mut self, rows: &[usize], forces: &mut [T], given: T) -> Result<()> {
        if self.buffers.change.is_empty() || !self.scheme.reads_acceleration {
            return Ok(());
        }
        let Self { buffers, contacts, .. } = self;
        let rest = &mut buffers.straight;
        rest.clear();
        rest.extend(rows.iter().zip(&*forces).map(|(&row, &force)| {
            let raw = given * contacts.lambda_raw[row];
            force + if force < T::zero() { raw.max(T::zero()).min(-force) } else { raw.min(T::zero()).max(-force) }
        }));
        // Change of velocity per change of acceleration in a step.
        let [_, by_v, by_a] = self.scheme.response;
        let time = T::of(self.h * by_v / by_a);
        while self.buffers.straight.iter().any(|&rest| rest != T::zero()) {
            let Self { buffers, projection, g, .. } = self;
            let Buffers { change, straight: rest, by_straight: moved, .. } = &mut **buffers;
            change.fill(T::zero());
            projection.push(g, (rows, rest), time, change)?;
            moved.clear();
            moved.extend(rows.iter().map(|&row| g.product(row, change) / time));
            if !self.evaluate_damping()? {
                return Ok(());
            }
            if !self.set_aside_resolved(rows)? {
                let Buffers { straight: rest, by_straight: part, .. } = &*self.buffers;
                for ((force, &rest), &part) in forces.iter_mut().zip(rest).zip(part) {
                    *force -= (T::one() - part * part) * rest;
                }
                return Ok(());
            }
        }
        Ok(())
    }

    /// Sets the forces of the groups whose inertia is at least the resistance of their damping to zero, and returns
    /// whether there are any. For the other groups, the accelerations of their rows are replaced by the ratio of
    /// inertia to resistance.
    fn set_aside_resolved(&mut self, rows: &[usize]) -> Result<bool> {
        let Self { buffers, projection, g, new, h, .. } = self;
        let Buffers { damping, straight: rest, by_straight: moved, .. } = &mut **buffers;
        projection.apply_inverse(damping)?;
        let mut found = false;
        // The groups belong to the problem that gave the forces.
        let groups = projection.groups();
        for group in (0..groups.len()).map(|group| groups.group(group)) {
            let largest = group.iter().fold(T::zero(), |largest, &position| rest[position].abs().max(largest));
            if largest == T::zero() {
                for &position in group {
                    moved[position] = T::one();
                }
                continue;
            }
            let [mut inertia, mut resistance] = [T::zero(); 2];
            for &position in group {
                let resisted = g.product(rows[position], damping);
                if !resisted.is_finite() {
                    let (what, dof) = ("the damping force", g.row(rows[position]).next().map_or(0, |(dof, _)| dof));
                    return Err(Error::StepNotFinite { t: new.t - *h, h: *h, what, dof, value: resisted.value() });
                }
                inertia += rest[position] / largest * moved[position];
                resistance += rest[position] / largest * resisted;
            }
            let is_resolved = resistance <= inertia;
            found |= is_resolved;
            for &position in group {
                if is_resolved {
                    rest[position] = T::zero();
                }
                moved[position] = inertia.max(T::zero()) / resistance;
            }
        }
        Ok(found)
    }

    /// Applies forces to a along rows, a ← a + M⁻¹ Gᵀ forces, and books their impulses. Reported forces are
    /// unchanged; see [`report_force`](Self::report_force) and [`force_share`](Self::force_share).
    ///
    /// # Errors
    ///
    /// The errors of a solve with a consistent mass, [`Error::LinearNotConverged`] and [`Error::Singular`].
    pub fn apply_forces(&mut self, rows: &[usize], forces: &[T]) -> Result<()> {
        let weight = T::of(self.momentum_weights()[2]);
        self.projection.push(self.g, (rows, forces), T::one(), &mut self.new.a)?;
        for (&row, &force) in rows.iter().zip(forces) {
            self.contacts.impulse[row] += weight * force;
        }
        Ok(())
    }

    /// Writes S = G M⁻¹ Gᵀ of some rows, entry (i, j) at i + j n for n rows: the change of the gap rate of row i by a
    /// unit impulse along row j.
    ///
    /// # Errors
    ///
    /// The errors of a solve with a consistent mass, [`Error::LinearNotConverged`] and [`Error::Singular`].
    pub fn compliances(&mut self, rows: &[usize], s: &mut Vec<T>) -> Result<()> {
        self.projection.assemble(self.g, rows, s)
    }

    /// Gaps of all rows at the start of the stage; empty if there are no past states.
    ///
    /// # Errors
    ///
    /// The errors of the constraints at the start of the stage.
    pub fn starting_gaps(&mut self) -> Result<&[T]> {
        let Self { buffers, constraints, past, new, .. } = self;
        let Some(start) = past.first() else { return Ok(&[]) };
        constraints.0.elsewhere(0, start.place(), (new.t, &new.u), &mut buffers.gaps)?;
        Ok(&buffers.gaps)
    }

    /// S of one row: the change of its gap rate by a unit impulse along it.
    ///
    /// # Errors
    ///
    /// As [`compliances`](Self::compliances).
    pub fn compliance(&mut self, row: usize) -> Result<T> {
        let mut s = std::mem::take(&mut self.buffers.s);
        let result = self.projection.assemble(self.g, &[row], &mut s);
        let compliance = s.first().copied().unwrap_or(T::zero());
        self.buffers.s = s;
        result.map(|()| compliance)
    }

    /// The rate of the gap of a row.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`] if a gap rate is not finite.
    pub fn rate(&mut self, row: usize) -> Result<T> {
        self.read_rates()?;
        Ok(self.g.product(row, &self.new.v) + self.buffers.rates[row].rate)
    }

    /// Chooses the rows whose jumps the projection removes.
    fn close(&mut self, rows: &[usize]) -> Result<()> {
        let (t, ids) = (self.t, &self.contacts.ids);
        self.projection.close_rows(self.g, rows, |row| no_response(t, ids[row]))
    }

    /// Finds the multipliers x of `rows`, within their admissible sets, with S x + jump admissible.
    fn solve(&mut self, rows: &[usize], sets: &[AdmissibleSet], x: &mut [T]) -> Result<()> {
        if sets.iter().all(|&set| set == AdmissibleSet::Free) {
            self.close(rows)?;
            for (x, &jump) in x.iter_mut().zip(&self.buffers.jump) {
                *x = -jump;
            }
            self.projection.solve(x);
            return Ok(());
        }
        let Buffers { group, jump, tolerance, .. } = &mut *self.buffers;
        let jumps = Jumps { rows, sets, jump, tolerance };
        let ids = &self.contacts.ids;
        group.solve((self.g, &mut *self.projection), &mut *self.solver, jumps, x, (self.t, |row| ids[row]))
    }
}
