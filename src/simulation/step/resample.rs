//! Changes of the step size: the past of a multistep scheme is resampled, or computed again.

use crate::contact::{ContactJacobian, GapRates};
use crate::corrector::{Gaps, JumpProjection, no_response};
use crate::error::Result;
use crate::ranks::check_alike;
use crate::real::Real;
use crate::rounding::{COEFFICIENT, TIME_SHARE};
use crate::simulation::build::program::{Compiler, Program};
use crate::simulation::build::scheme::Scheme;
use crate::simulation::operator::responses::Unit;
use crate::simulation::operator::tangent::At;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::run::{Parts, Simulation};
use crate::simulation::start;
use crate::simulation::start::past::taylor;
use crate::simulation::watch::stability::{self, StepLimit};
use crate::state::{ComputedMotions, History, Motion, Pace, State};
use crate::system::{Linearity, check_step_size};

/// The past is extrapolated to at most this multiple of its age: polynomials grow beyond it. It is not extrapolated
/// at all if a scheme reads its accelerations: in stiff motions they grow with the frequency.
const FARTHEST: f64 = 3.0;

impl<T: Real> Simulation<'_, T> {
    /// Size of the next step.
    pub fn step_size(&self) -> f64 {
        self.history.clock.h
    }

    /// Changes the step size from here on. Effective matrices are factorized again (their analysis is kept), and the
    /// past of a multistep scheme is resampled at the new spacing: u by the cubic through (u, v) of two states, v by
    /// the cubic through (v, a), a linearly. States from before a contact closed or opened are not used: the past is
    /// then extrapolated from the newer ones, or from the newest alone by Taylor's expansion, and projected on the
    /// closed contacts.
    ///
    /// Every scheme keeps its order when the step changes by factors up to 3, even at every step (`docs/schemes.md`).
    /// If a larger step would extrapolate the past to more than three times its age (beyond its age, if the scheme
    /// reads its accelerations), the past is computed again by steps of the trapezoidal rule, as at the start of a
    /// run, so that fast motions gain hardly any energy. The velocity of the state is then replaced by the velocity
    /// of the scheme's momentum, from which it differs by O(h²): a run with one such change keeps its order, a run
    /// that goes back and forth by such factors all the time is of order 1.
    ///
    /// Otherwise the velocities of the state do not change. [`momentum`](Self::momentum), which schemes may evaluate
    /// a part p of the step ahead, belongs to the new step: under a force F, for instance of a contact, it changes by
    /// p (h' − h) F, which no impulse accounts for (central differences: p = ½). Without force it is conserved. The
    /// impulse of one contact agrees with the change of a body's momentum across a change of h only to the order of
    /// the scheme.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearSystem, Simulation};
    ///
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)])?;
    /// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, GeneralizedAlpha::default(), 0.01)
    ///     .displacement(vec![1.0])
    ///     .build()?;
    /// run.run_until(1.0, &mut ())?;
    /// run.set_step_size(0.004)?;
    /// run.run_until(2.0, &mut ())?;
    /// assert!((run.state().displacement()[0] - run.time().cos()).abs() < 1e-4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless h is positive and finite,
    /// [`Error::TimeNotAdvancing`](crate::Error::TimeNotAdvancing) if a step of that size would not change the time,
    /// [`Error::BeyondStability`](crate::Error::BeyondStability) if the scheme is not stable with it,
    /// [`Error::MatrixNotFinite`](crate::Error::MatrixNotFinite) or
    /// [`Error::Singular`](crate::Error::Singular) if the effective matrix cannot be factorized. The simulation is then
    /// as it was.
    pub fn set_step_size(&mut self, h: f64) -> Result<()> {
        self.guarded(|run| {
            check_alike(&run.parts.together, ["the step size"], [h])?;
            run.change_step_size(h)?;
            run.history.pace = Pace::new(h);
            Ok(())
        })
    }

    /// Changes the step size, and not the nominal one.
    pub(crate) fn change_step_size(&mut self, h: f64) -> Result<()> {
        let result = self.change_step_size_together(h);
        self.parts.together.finish(result)
    }

    fn change_step_size_together(&mut self, h: f64) -> Result<()> {
        let old = self.history.clock.h;
        if h.to_bits() == old.to_bits() {
            return Ok(());
        }
        check_step_size::<T>(h)?;
        let clock = self.history.clock.with_step_size(h);
        clock.check()?;
        // Steps of a system that may stiffen are checked as they are taken: they grow back to the nominal size,
        // whatever the check has found where the run was built or resumed.
        let grows_back = self.parts.system.linearity() == Linearity::Nonlinear && h <= self.history.pace.nominal;
        if let StepLimit::Cleared(cleared) = self.monitors.limit
            && h > cleared
            && !grows_back
        {
            self.monitors.limit = stability::check_step(
                (&mut *self.parts.system, &self.parts.together),
                &self.scheme,
                &self.state.motion,
                h,
            )?;
        }
        let anew = self.is_beyond_past(h);
        let (past, velocity, starter) = match anew {
            true => {
                let motion = self.state.motion.clone();
                let starter = self.compiled.startup.is_none().then(|| self.compiled_starter(h, &motion)).transpose()?;
                (Vec::new(), Some(self.velocity_of_momentum()?), starter)
            }
            false => (self.resampled(h)?, None, None),
        };
        let Self { parts, compiled, scheme, state, history, statistics, work, .. } = self;
        compiled.set_step_size(scheme, &mut *parts.system, h, At::state(&state.motion))?;
        if starter.is_some() {
            compiled.startup = starter;
        }
        let programs = std::iter::once(&compiled.program).chain(&compiled.startup);
        let constant = programs.flat_map(|program| &program.operators).filter(|operator| !operator.varies());
        statistics.factorizations += constant.count() as u64;
        keep_computed(scheme, state, history);
        move_shifted(scheme, state, history, h);
        for (slot, resampled) in history.slots[1..].iter_mut().zip(past) {
            *slot = resampled;
        }
        if let Some(velocity) = velocity {
            state.motion.v = velocity;
            history.known = 1;
        }
        history.clock = clock;
        let is_kept = scheme.depth == 1 && scheme.shifts.iter().all(|&shift| shift == 0.0);
        if let Some(tape) = work.tape.as_mut().filter(|_| !is_kept) {
            tape.refuse(
                "a change of the step size",
                "it moves stored values of this scheme: choose one that stores u, v and a at the time of the state, \
                 and reads no older states, such as the trapezoidal rule",
            );
        }
        Ok(())
    }

    /// Whether steps of this size would extrapolate the past that the scheme reads farther than is stable, beyond
    /// [`FARTHEST`] times its computed age. The past is then computed again, by steps of the one-step scheme that
    /// also begins a run.
    fn is_beyond_past(&self, h: f64) -> bool {
        let Self { state, history, scheme, .. } = self;
        let reads = scheme.tableau.reads_after(scheme.tableau.stages.len() - 1);
        let farthest = if reads.iter().skip(1).any(|reads| reads[2]) { 1.0 } else { FARTHEST };
        let needed = (history.known - 1) as f64 * h;
        let computed = smooth_motions(state, history).last().map_or(0.0, |oldest| oldest.age);
        // After an impact only the newest state is known: then the size of the step that made it counts.
        needed > farthest * (1.0 + TIME_SHARE) * computed.max((history.known - 1) as f64 * history.made_with)
    }

    /// The velocity with which the newest state alone, without its past, has the momentum of the scheme. The stored
    /// velocity has an error O(h²), which matters only if the scheme continues from it alone. Closed contacts keep
    /// their gap rates.
    fn velocity_of_momentum(&self) -> Result<Vec<T>> {
        let Self { parts: Parts { system, .. }, g, state, history, scheme, work, .. } = self;
        let h = history.clock.h;
        let newest = &state.motion;
        let psi = scheme.derived.covectors.get(history.known - 1).filter(|psi| !reads_accelerations_alone(psi));
        let Some(psi) = psi else { return Ok(newest.v.clone()) };
        let mut velocity = scheme.momentum(newest, &history.slots[1..history.known], h);
        T::axpy(T::of(-lead(psi) * h), &newest.a, &mut velocity);
        for &dof in system.prescribed().iter().chain(&work.massless) {
            velocity[dof] = newest.v[dof];
        }
        if let Some((mut projection, closed)) = self.projection_on_closed()? {
            let targets: Vec<T> = closed.iter().map(|&row| g.product(row, &newest.v)).collect();
            projection.remove_jump(g, &targets, &mut velocity, &mut vec![T::zero(); closed.len()])?;
        }
        Ok(velocity)
    }

    /// The closed rows along which past states are projected, and the projection, if there are any.
    fn projection_on_closed(&self) -> Result<Option<(JumpProjection<T>, Vec<usize>)>> {
        let Self { parts: Parts { system, together, linear_solver, .. }, constraints, g, state, work, .. } = self;
        let closed = constraints.rows_of(&state.contacts).filter(|&(contact, _)| state.contacts.closed[contact]);
        // Rows whose law reads the gap at the start of a stage may hold it anywhere. Rows on dofs without mass have
        // nothing to correct, and would move the other side only.
        let tangents = constraints.tangents();
        let corrected =
            |&row: &usize| !constraints.law(row).may_penetrate() && !tangents.act_on(g, row, &work.massless);
        let closed: Vec<usize> = closed.map(|(_, row)| row).filter(corrected).collect();
        if closed.is_empty() {
            return Ok(None);
        }
        let mut projection = start::projection(&**system, constraints, (together, &**linear_solver))?;
        projection.close_rows(g, &closed, |row| no_response(state.motion.t, constraints.ids[row]))?;
        Ok(Some((projection, closed)))
    }

    /// Compiles the scheme for a step size, and leaves the motion as it is: for the gradient.
    pub(crate) fn compile_for(&mut self, h: f64) -> Result<()> {
        let Self { parts: Parts { system, .. }, compiled, scheme, state, .. } = self;
        match h.to_bits() == compiled.h.to_bits() {
            true => Ok(()),
            false => compiled.set_step_size(scheme, &mut **system, h, At::state(&state.motion)),
        }
    }

    /// The scheme of the first steps, for a step size and tangents at a motion.
    pub(crate) fn compiled_starter(&mut self, h: f64, motion: &Motion<T>) -> Result<Program<T>> {
        let Self { parts: Parts { system, linear_solver, .. }, constraints, scheme, .. } = self;
        let (interface, unit) = (constraints.interface(), Unit::of(constraints));
        let at = At::state(motion);
        let mut compiler = Compiler { system: &mut **system, solver: &**linear_solver, h, at, interface, unit };
        compiler.start(&scheme.derived.starter, &scheme.tableau)
    }

    /// Past states 1, 2, … known − 1 at the spacing h.
    fn resampled(&mut self, h: f64) -> Result<Vec<Motion<T>>> {
        let Self { state, history, scheme, .. } = &*self;
        let known = history.known;
        let newest = &state.motion;
        let nodes = smooth_motions(state, history);
        let mut past = vec![Motion::zero(newest.u.len()); known - 1];
        for (k, out) in (1..known).zip(&mut past) {
            let age = k as f64 * h;
            // The interval that contains the time, or else the oldest one.
            let interval = nodes.windows(2).find(|pair| pair[1].age >= age).or(nodes.windows(2).last());
            match interval {
                Some([newer, older]) => interpolate(newer, older, age, out),
                _ => taylor(newest, -age, out),
            }
            out.t = newest.t - age;
        }
        conserve_momentum(scheme, state, history, h, &mut past);
        if history.smooth < known
            && let Some((mut projection, closed)) = self.projection_on_closed()?
        {
            for motion in &mut past {
                project(motion, &mut self.constraints, &self.g, &mut projection, &closed)?;
            }
        }
        Ok(past)
    }
}

/// A computed motion, and its age, the time from it to the newest one: a sum of step sizes, as differences of
/// absolute times would have their rounding.
struct Node<'h, T> {
    motion: &'h Motion<T>,
    age: f64,
}

/// The motions computed since a contact last closed or opened, newest first.
fn smooth_motions<'h, T: Real>(state: &'h State<T>, history: &'h History<T>) -> Vec<Node<'h, T>> {
    let newest = std::iter::once((&state.motion, history.made_with));
    let smooth = history.smooth;
    let known: Vec<(&Motion<T>, f64)> = match history.computed.is_empty() {
        // Until the step changes for the first time, the past that the scheme reads is the computed one.
        true => {
            let past = history.slots[1..history.known].iter().map(|motion| (motion, history.made_with));
            newest.chain(past).take(smooth).collect()
        }
        false => newest.chain(history.computed.known()).take(smooth).collect(),
    };
    let mut age = 0.0;
    let node = |(motion, made_with): (&'h Motion<T>, f64)| {
        let node = Node { motion, age };
        age += made_with;
        node
    };
    known.into_iter().map(node).collect()
}

/// Number of computed motions to keep: enough for ratios of step sizes up to 3.
pub(crate) fn computed_capacity(scheme: &Scheme<'_>) -> usize {
    let shifted = scheme.shifts.iter().any(|shift| shift.abs() > 0.0);
    if scheme.depth > 1 { 3 * (scheme.depth - 1) } else { usize::from(shifted) }
}

/// Begins to keep the computed motions.
fn keep_computed<T: Real>(scheme: &Scheme<'_>, state: &State<T>, history: &mut History<T>) {
    let length = computed_capacity(scheme);
    if history.computed.is_empty() && length > 0 {
        // One-step schemes read no past, but the motion before the present one is still in its slot.
        let known = history.known.max(history.smooth.min(2));
        let past: Vec<_> = history.slots[1..known].iter().map(|motion| (motion, history.made_with)).collect();
        history.computed = ComputedMotions::new(length, state.motion.u.len(), &past);
    }
}

/// Moves stored v and a of schemes that store them δ steps away from the state: δ steps are another time with the new
/// step size. The moved values are on the line through the last two computed values.
fn move_shifted<T: Real>(scheme: &Scheme<'_>, state: &mut State<T>, history: &mut History<T>, h: f64) {
    let History { computed, unshifted, made_with, smooth, .. } = history;
    let Some((previous, previous_h)) = computed.known().next().filter(|_| *smooth > 1) else { return };
    // Far extrapolation along a line is no estimate: stored values stay, as at the start.
    let moved = if h <= FARTHEST * (1.0 + TIME_SHARE) * *made_with { h - *made_with } else { 0.0 };
    for (field, (shift, unshifted)) in (1..).zip(scheme.shifts.into_iter().zip(unshifted)) {
        if shift == 0.0 {
            continue;
        }
        let stored = state.motion.field_mut(field);
        if unshifted.is_empty() {
            unshifted.clone_from(stored);
        }
        let distance = *made_with + shift * (*made_with - previous_h);
        let fraction = T::of(shift * moved / distance);
        stored.copy_from_slice(unshifted);
        T::axpy_difference(fraction, unshifted, previous.field(field), stored);
    }
}

/// The motion at an age on the polynomials through two others, beyond the older one too: u by Hermite's cubic through
/// (u, v), v by the cubic through (v, a), a linearly.
fn interpolate<T: Real>(newer: &Node<'_, T>, older: &Node<'_, T>, age: f64, out: &mut Motion<T>) {
    let length = older.age - newer.age;
    let s = (age - newer.age) / length;
    let (newer, older) = (newer.motion, older.motion);
    let difference = T::of(s * s * (3.0 - 2.0 * s));
    let slopes = [-length * s * (1.0 - s) * (1.0 - s), length * s * s * (1.0 - s)].map(T::of);
    let cubic = |x: &[T], x0: &[T], rate: &[T], rate0: &[T], out: &mut [T]| {
        out.copy_from_slice(x);
        T::axpy_difference(difference, x0, x, out);
        T::axpy(slopes[0], rate, out);
        T::axpy(slopes[1], rate0, out);
    };
    cubic(&newer.u, &older.u, &newer.v, &older.v, &mut out.u);
    cubic(&newer.v, &older.v, &newer.a, &older.a, &mut out.v);
    out.a.copy_from_slice(&newer.a);
    T::axpy_difference(T::of(s), &older.a, &newer.a, &mut out.a);
}

/// p of ψ = v + p h a + O(h²), the momentum functional of a scheme in smooth motion.
fn lead(psi: &[[f64; 3]]) -> f64 {
    let terms = psi.iter().zip(0_u32..).map(|(psi, k)| (psi, f64::from(k)));
    terms.map(|(psi, k)| 0.5 * k * k * psi[0] - k * psi[1] + psi[2]).sum()
}

/// The change of ψ by a shift of the past displacements by −k h, and by a unit shift of the past velocities.
fn shifted(psi: &[[f64; 3]]) -> [f64; 2] {
    let older = || psi.iter().zip(0_u32..).map(|(psi, k)| (psi, f64::from(k))).skip(1);
    [older().map(|(psi, k)| -k * psi[0]).sum(), older().map(|(psi, _)| psi[1]).sum()]
}

/// Whether ψ reads only accelerations of the past (Adams formulas) and needs no shift: these enter with h a.
fn reads_accelerations_alone(psi: &[[f64; 3]]) -> bool {
    shifted(psi).into_iter().all(|by| by.abs() < COEFFICIENT)
}

/// Shifts the resampled past so that the scheme's momentum continues from before the change.
///
/// In smooth motion the functional ψ of a scheme is v + p h a + O(h²), so a change of h adds p (h' − h) a.
/// Interpolation has an error of O(h²) in ψ at every change. Without this shift, changes at every step would reduce
/// the order to 1.
fn conserve_momentum<T: Real>(
    scheme: &Scheme<'_>,
    state: &State<T>,
    history: &History<T>,
    h: f64,
    past: &mut [Motion<T>],
) {
    let Some(psi) = scheme.derived.covectors.get(past.len()) else { return };
    let p = lead(psi);
    let [by_u, by_v] = shifted(psi);
    if reads_accelerations_alone(psi) {
        return;
    }
    let newest = &state.motion;
    let mut difference = scheme.momentum(newest, &history.slots[1..history.known], history.clock.h);
    T::axpy(T::of(p * (h - history.clock.h)), &newest.a, &mut difference);
    T::axpy(-T::one(), &scheme.momentum(newest, past, h), &mut difference);
    for (k, motion) in (1_u32..).zip(past) {
        if by_u.abs() >= by_v.abs() {
            T::axpy(T::of(-f64::from(k) * h / by_u), &difference, &mut motion.u);
        } else {
            T::axpy(T::of(by_v.recip()), &difference, &mut motion.v);
        }
    }
}

/// Projects gap, gap rate and gap acceleration of a past state to zero on the closed rows.
fn project<T: Real>(
    motion: &mut Motion<T>,
    constraints: &mut Constraints<'_, T>,
    g: &ContactJacobian<T>,
    projection: &mut JumpProjection<T>,
    closed: &[usize],
) -> Result<()> {
    let mut gaps = vec![T::zero(); constraints.len()];
    let mut rates = vec![GapRates::default(); constraints.len()];
    let mut multipliers = vec![T::zero(); closed.len()];
    constraints.finite_gaps(motion.t, &motion.u, &mut gaps)?;
    let targets: Vec<T> = closed.iter().map(|&row| g.product(row, &motion.u) - gaps[row]).collect();
    projection.remove_jump(g, &targets, &mut motion.u, &mut multipliers)?;
    constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
    let targets: Vec<T> = closed.iter().map(|&row| -rates[row].rate).collect();
    projection.remove_jump(g, &targets, &mut motion.v, &mut multipliers)?;
    let targets: Vec<T> = closed.iter().map(|&row| -rates[row].acceleration).collect();
    projection.remove_jump(g, &targets, &mut motion.a, &mut multipliers)
}
