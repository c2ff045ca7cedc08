//! Data and operations for correctors: the jumps of a stage, the projection that removes them, impulses and forces
//! along rows, and their bookkeeping. Code that serves a single corrector is in the file of that corrector.

mod damping;
mod energy;
mod jumps;
mod parts;
mod past;
mod record;
mod restitution;

use super::{Buffers, Corrector, JumpProjection};
use crate::contact::{ContactJacobian, ErasedGaps, GapRates};
use crate::contact_solver::ContactSolver;
use crate::error::Result;
use crate::real::Real;
use crate::simulation::{MasslessBlock, Operator};
use crate::state::{Backup, ContactState, Motion};
use crate::system::System;

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
/// use contact_dynamics::corrector::Correction;
/// use contact_dynamics::{Corrector, PersistencyCorrection, Result};
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
    pub(crate) scheme: Scheme<'a>,
    pub(crate) g: &'a ContactJacobian<T>,
    pub(crate) projection: &'a mut JumpProjection<T>,
    pub(crate) bodies: Bodies<'a, T>,
    pub(crate) solver: &'a mut dyn ContactSolver<T>,
    pub(crate) constraints: ErasedGaps<'a, T>,
    pub(crate) new: &'a mut Motion<T>,
    pub(crate) past: Past<'a, T>,
    pub(crate) contacts: &'a mut ContactState<T>,
    pub(crate) before: Before<'a>,
    pub(crate) buffers: &'a mut Buffers<T>,
    /// Change of kinetic energy by velocity corrections, without the corrections of contacts that close in this step:
    /// these are part of the impact.
    pub(crate) energy: &'a mut T,
}

/// The equations of motion of a stage.
#[derive(Debug)]
pub(crate) struct Bodies<'a, T: Real> {
    pub(crate) system: Erased<'a, T>,
    /// The factorized effective matrix of the stage.
    pub(crate) operator: &'a mut Operator<T>,
    /// The block of dofs without mass that follow statically.
    pub(crate) block: Option<&'a mut MasslessBlock<T>>,
    pub(crate) massless: &'a [usize],
    pub(crate) prescribed: &'a [usize],
}

/// Past states, newest first, and their copies in case the step is undone.
#[derive(Debug)]
pub(crate) struct Past<'a, T: Real> {
    pub(crate) states: &'a mut [Motion<T>],
    pub(crate) backup: &'a mut Backup<T>,
}

/// The contacts before a stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Before<'a> {
    pub(crate) closed: &'a [bool],
    /// Closed flags at the start of the step.
    pub(crate) closed_at_start: &'a [bool],
    /// Contacts that stuck; empty without friction.
    pub(crate) sticking: &'a [bool],
}

/// The step size, and the coefficients of the scheme that a correction needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scheme<'a> {
    pub(crate) h: f64,
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
    MaySeparate,
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
    /// [`Error::ContactNotFinite`](crate::Error::ContactNotFinite) if a gap rate is not finite, and the errors of the
    /// linear solver; direct solvers have none.
    pub fn apply_impulses(&mut self, rows: &[usize], impulses: &[T]) -> Result<()> {
        self.read_rates()?;
        self.apply(rows, impulses)
    }

    /// Reads the gap rates that the constraints add.
    pub(super) fn read_rates(&mut self) -> Result<()> {
        self.constraints.0.rates(self.new.t, &self.new.u, &self.new.v, &mut self.buffers.readings.rates)
    }

    /// [`apply_impulses`](Self::apply_impulses) if the gap rates have been read already.
    pub(super) fn apply(&mut self, rows: &[usize], impulses: &[T]) -> Result<()> {
        if impulses.iter().all(|&impulse| impulse == T::zero()) {
            return Ok(());
        }
        let Self { buffers, contacts, projection, new, g, scheme, energy, before: previous, .. } = self;
        let Buffers { scratch, readings, damping, .. } = &mut **buffers;
        scratch.clear();
        scratch.extend(rows.iter().map(|&row| g.product(row, &new.v)));
        projection.push(g, (rows, impulses), T::one(), &mut new.v)?;
        for (&row, &impulse) in rows.iter().zip(impulses.iter()) {
            contacts.impulse[row] += T::of(scheme.covector[0][1]) * impulse;
        }
        // Change of kinetic energy: impulse times the mean rate of the bodies before and after, without the
        // obstacle's rate.
        for ((&row, &impulse), &before) in rows.iter().zip(impulses.iter()).zip(scratch.iter()) {
            // A state between stages is dropped from the past: its loss is no loss of the step.
            if !scheme.is_last() {
                continue;
            }
            let gain = impulse * T::of(0.5) * (before + g.product(row, &new.v));
            let contact = contacts.tangents.owner(row);
            if previous.closed_at_start[contact] || !contacts.closed[contact] {
                **energy += gain;
            }
            // A moving obstacle does work, so dissipation is measured in its frame. Friction work is not booked as
            // impact energy.
            if !g.is_tangential(row) {
                contacts.dissipated[row] -= gain + impulse * readings.rates[row].rate;
            }
        }
        if !damping.change.is_empty() {
            damping.change.fill(T::zero());
            projection.push(g, (rows, impulses), T::one(), &mut damping.change)?;
            self.damp()?;
        }
        Ok(())
    }

    /// Adds forces to a, to the reported forces and to the impulses.
    fn push_forces(&mut self, rows: &[usize], forces: &[T]) -> Result<()> {
        let Self { contacts, projection, new, g, scheme, .. } = self;
        let share = T::of(scheme.balance / scheme.acceleration);
        projection.push(g, (rows, forces), T::one(), &mut new.a)?;
        for (&row, &force) in rows.iter().zip(forces) {
            contacts.lambda[row] += share * force;
            contacts.lambda_v[row] = T::of(scheme.h / scheme.acceleration) * force;
            contacts.impulse[row] += T::of(scheme.covector[0][2] * scheme.h) * force;
        }
        Ok(())
    }

    /// Applies forces to a along rows, a ← a + M⁻¹ Gᵀ forces, and books their impulses. Reported forces are
    /// unchanged; see [`report_force`](Self::report_force) and [`force_share`](Self::force_share).
    ///
    /// # Errors
    ///
    /// The errors of a solve with a consistent mass,
    /// [`Error::LinearNotConverged`](crate::Error::LinearNotConverged) and [`Error::Singular`](crate::Error::Singular).
    pub fn apply_forces(&mut self, rows: &[usize], forces: &[T]) -> Result<()> {
        let weight = T::of(self.momentum_weights()[2]);
        self.projection.push(self.g, (rows, forces), T::one(), &mut self.new.a)?;
        for (&row, &force) in rows.iter().zip(forces) {
            self.contacts.impulse[row] += weight * force;
        }
        Ok(())
    }

    /// Removes the contribution r_a M⁻¹ Gᵀ λ of the raw multipliers of rows from the accelerations; r is the
    /// [`response`](Self::response) of the scheme.
    pub(super) fn remove_raw_forces(&mut self, rows: &[usize]) -> Result<()> {
        let mut forces = std::mem::take(&mut self.buffers.scratch);
        let [.., by_a] = self.scheme.response;
        forces.clear();
        forces.extend(rows.iter().map(|&row| -T::of(by_a) * self.contacts.lambda_raw[row]));
        let result = self.apply_forces(rows, &forces);
        self.buffers.scratch = forces;
        result
    }

    /// Writes S = G M⁻¹ Gᵀ of some rows, entry (i, j) at i + j n for n rows: the change of the gap rate of row i by a
    /// unit impulse along row j.
    ///
    /// # Errors
    ///
    /// The errors of a solve with a consistent mass,
    /// [`Error::LinearNotConverged`](crate::Error::LinearNotConverged) and [`Error::Singular`](crate::Error::Singular).
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
        let Some(start) = past.states.first() else { return Ok(&[]) };
        constraints.0.elsewhere(0, start.place(), (new.t, &new.u), &mut buffers.readings.gaps)?;
        Ok(&buffers.readings.gaps)
    }

    /// S of one row: the change of its gap rate by a unit impulse along it.
    ///
    /// # Errors
    ///
    /// As [`compliances`](Self::compliances).
    pub fn compliance(&mut self, row: usize) -> Result<T> {
        let mut s = std::mem::take(&mut self.buffers.scratch);
        let result = self.projection.assemble(self.g, &[row], &mut s);
        let compliance = s.first().copied().unwrap_or(T::zero());
        self.buffers.scratch = s;
        result.map(|()| compliance)
    }

    /// The rate of the gap of a row.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`](crate::Error::ContactNotFinite) if a gap rate is not finite.
    pub fn rate(&mut self, row: usize) -> Result<T> {
        self.read_rates()?;
        Ok(self.g.product(row, &self.new.v) + self.buffers.readings.rates[row].rate)
    }
}
