//! The motion: what a later step reads, and what the user reads.

use crate::contact::ContactId;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::Overclosures;

/// Stored values of one state: displacement, velocity and acceleration at its time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Motion<T> {
    pub(crate) t: f64,
    pub(crate) u: Vec<T>,
    pub(crate) v: Vec<T>,
    pub(crate) a: Vec<T>,
}

impl<T: Real> Motion<T> {
    pub(crate) fn zero(dofs: usize) -> Self {
        let zero = || vec![T::zero(); dofs];
        Self { t: 0.0, u: zero(), v: zero(), a: zero() }
    }

    /// Time; u, v, a.
    pub(crate) fn place(&self) -> (f64, [&[T]; 3]) {
        (self.t, [&self.u, &self.v, &self.a])
    }

    /// Copies without allocating.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.t = other.t;
        self.u.copy_from_slice(&other.u);
        self.v.copy_from_slice(&other.v);
        self.a.copy_from_slice(&other.a);
    }

    /// Field 1, 2: v, a, to be edited.
    pub(crate) fn rate_mut(&mut self, field: usize) -> &mut Vec<T> {
        match field {
            1 => &mut self.v,
            _ => &mut self.a,
        }
    }

    /// Field 1, 2: v, a at the time of the state, `shown` if it is not empty.
    pub(crate) fn shown<'v>(&'v self, shown: &'v [Vec<T>; 2], field: usize) -> &'v [T] {
        match shown[field - 1].is_empty() {
            true => self.field(field),
            false => &shown[field - 1],
        }
    }

    /// Field 0, 1, 2: u, v, a.
    pub(crate) fn field(&self, field: usize) -> &[T] {
        match field {
            0 => &self.u,
            1 => &self.v,
            _ => &self.a,
        }
    }
}

/// The state of a simulation at a time: motion and contacts.
///
/// Together with [`History`] it is everything a later step reads: continue from clones of both and the run goes on bit
/// for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct State<T> {
    /// Values as the scheme stores them.
    pub(crate) motion: Motion<T>,
    /// Velocity and acceleration at the time of the state; empty where the stored ones live there.
    pub(crate) shown: [Vec<T>; 2],
    pub(crate) contacts: ContactState<T>,
}

impl<T: Real> State<T> {
    /// Time.
    pub fn time(&self) -> f64 {
        self.motion.t
    }

    /// Displacements, one a dof.
    pub fn displacement(&self) -> &[T] {
        &self.motion.u
    }

    /// Velocities at the time of the state, one a dof.
    pub fn velocity(&self) -> &[T] {
        self.motion.shown(&self.shown, 1)
    }

    /// Accelerations at the time of the state, one a dof.
    ///
    /// Some schemes store v or a of another time ([`Order`](crate::analysis::Order) says which). The values here are
    /// extrapolated from two states, or those of the scheme where a contact closed or opened between the two.
    pub fn acceleration(&self) -> &[T] {
        self.motion.shown(&self.shown, 2)
    }

    /// Velocities as the scheme stores them, at the time that its rows give them.
    pub fn stored_velocity(&self) -> &[T] {
        &self.motion.v
    }

    /// Accelerations as the scheme stores them, at the time that its rows give them: what its balance holds for.
    pub fn stored_acceleration(&self) -> &[T] {
        &self.motion.a
    }

    /// Contacts, one entry a candidate.
    pub fn contacts(&self) -> &ContactState<T> {
        &self.contacts
    }
}

/// Multipliers and flags of the contacts, one entry a candidate, in the order of the constraints and their rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactState<T> {
    pub(crate) ids: Vec<ContactId>,
    pub(crate) lambda: Vec<T>,
    pub(crate) lambda_raw: Vec<T>,
    pub(crate) closed: Vec<bool>,
    pub(crate) gap: Vec<T>,
    pub(crate) impulse: Vec<T>,
    pub(crate) lambda_v: Vec<T>,
    pub(crate) lambda_a: Vec<T>,
    pub(crate) dissipated: Vec<T>,
}

impl<T: Real> ContactState<T> {
    pub(crate) fn with_capacity(rows: usize) -> Self {
        let reals = || Vec::with_capacity(rows);
        Self {
            ids: Vec::with_capacity(rows),
            lambda: reals(),
            lambda_raw: reals(),
            closed: Vec::with_capacity(rows),
            gap: reals(),
            impulse: reals(),
            lambda_v: reals(),
            lambda_a: reals(),
            dissipated: reals(),
        }
    }

    /// Opens every contact of `ids`.
    pub(crate) fn reset(&mut self, ids: &[ContactId]) {
        let n = ids.len();
        self.ids.clear();
        self.ids.extend_from_slice(ids);
        let Self { lambda, lambda_raw, gap, impulse, lambda_v, lambda_a, dissipated, .. } = self;
        for reals in [lambda, lambda_raw, gap, impulse, lambda_v, lambda_a, dissipated] {
            reals.clear();
            reals.resize(n, T::zero());
        }
        self.closed.clear();
        self.closed.resize(n, false);
    }

    /// Copies what belongs to the same contacts from another state; contacts it does not know are open.
    pub(crate) fn carry_over(&mut self, old: &Self, ids: &[ContactId]) {
        self.reset(ids);
        // Candidates that come and go shift the others: the place behind the last one found is tried first.
        let sorted = old.ids.is_sorted();
        let mut next = 0;
        for (i, id) in ids.iter().enumerate() {
            let follows = (old.ids.get(next) == Some(id)).then_some(next);
            let elsewhere = || match sorted {
                true => old.ids.binary_search(id).ok(),
                false => old.ids.iter().position(|other| other == id),
            };
            if let Some(j) = follows.or_else(elsewhere) {
                next = j + 1;
                self.lambda[i] = old.lambda[j];
                self.lambda_raw[i] = old.lambda_raw[j];
                self.closed[i] = old.closed[j];
                self.gap[i] = old.gap[j];
                self.impulse[i] = old.impulse[j];
                self.lambda_v[i] = old.lambda_v[j];
                self.lambda_a[i] = old.lambda_a[j];
                self.dissipated[i] = old.dissipated[j];
            }
        }
    }

    /// Which contact each entry belongs to.
    pub fn ids(&self) -> &[ContactId] {
        &self.ids
    }

    /// Gaps, positive when open.
    pub fn gaps(&self) -> &[T] {
        &self.gap
    }

    /// Contact forces, compression positive: those of the instant of the state, after correction, so that M a = f + Gᵀ
    /// λ there.
    ///
    /// They are values, not means over the step: summed over the steps, times h, they are not the change of momentum.
    /// The force jumps with the velocity at an impact, and the sum misses what happens within that step (3 % on a
    /// coarse block). [`impulses`](Self::impulses) close to rounding.
    pub fn forces(&self) -> &[T] {
        &self.lambda
    }

    /// Raw multipliers of the last stage's contact problem; they decide release, and their impulse is h Σ β λ.
    pub fn raw_forces(&self) -> &[T] {
        &self.lambda_raw
    }

    /// Whether a contact is closed: pressed (raw multiplier > 0) or touching within rounding.
    pub fn closed(&self) -> &[bool] {
        &self.closed
    }

    /// Impulses of the last step (force × time), corrections included: along G, their sum over the steps is the change
    /// of the momentum that the scheme conserves ([`Simulation::momentum`](crate::Simulation::momentum)), to rounding.
    pub fn impulses(&self) -> &[T] {
        &self.impulse
    }

    /// The paper's λ_v of the last correction (momentum, kg m/s): it corrected the acceleration; zero without
    /// correction.
    pub fn lambda_v(&self) -> &[T] {
        &self.lambda_v
    }

    /// The paper's λ_a of the last correction (kg m): it corrected the velocity; zero without correction.
    pub fn lambda_a(&self) -> &[T] {
        &self.lambda_a
    }

    /// Kinetic energy that corrections have taken from the bodies since a contact last closed, and not given back; in
    /// the frame of the obstacle, where there is one that moves.
    pub fn dissipated(&self) -> &[T] {
        &self.dissipated
    }
}

/// The past states that a multistep scheme reads, and the clock of the run.
#[derive(Clone, Debug)]
pub struct History<T> {
    /// Slot 0 is spare between steps; past state k (k ≥ 1) is slot k.
    pub(crate) slots: Vec<Motion<T>>,
    /// Number of states known, the current one included.
    pub(crate) known: usize,
    /// Number of newest states since a contact last closed or opened, the first one after that included.
    pub(crate) smooth: usize,
    pub(crate) clock: Clock,
    pub(crate) pace: Pace,
    /// Step size that made the current state.
    pub(crate) made_with: f64,
    /// The motions as they were computed, from which changes of the step size resample; empty until there is one.
    pub(crate) trail: Trail<T>,
    /// v and a of the current state as they were computed, if a change of the step size has moved the stored ones to
    /// another time.
    pub(crate) unmoved: [Vec<T>; 2],
    /// (u_n − u_{n−1})/h on the dofs without mass: their velocity is differenced over two steps.
    pub(crate) slopes: Vec<T>,
    /// Name of the integrator: another one would read other things out of the same states.
    pub(crate) scheme: String,
    /// What is added to the gaps because bodies overlapped at the start.
    pub(crate) overclosures: Option<Overclosures<T>>,
}

/// Motions before the current one as they were computed, newest first, whatever their spacing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trail<T> {
    /// Each with the step size that made it; those beyond `known` are spare.
    states: Vec<(Motion<T>, f64)>,
    known: usize,
}

impl<T: Real> Trail<T> {
    /// Room for `length` states, the newest of which are `known`.
    pub(crate) fn new(length: usize, dofs: usize, known: &[(&Motion<T>, f64)]) -> Self {
        let mut trail = Self { states: vec![(Motion::zero(dofs), 0.0); length], known: 0 };
        for (motion, h) in known.iter().rev() {
            trail.push(motion, *h);
        }
        trail
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Puts a motion in front, without allocating; the oldest drops out.
    pub(crate) fn push(&mut self, motion: &Motion<T>, h: f64) {
        self.states.rotate_right(1);
        if let Some((front, made_with)) = self.states.first_mut() {
            front.copy_from(motion);
            *made_with = h;
            self.known = (self.known + 1).min(self.states.len());
        }
    }

    /// The newest motion, to be edited.
    pub(crate) fn front(&mut self) -> Option<&mut Motion<T>> {
        self.states.first_mut().map(|(motion, _)| motion)
    }

    /// The motions known.
    pub(crate) fn known(&self) -> impl Iterator<Item = (&Motion<T>, f64)> {
        self.states[..self.known].iter().map(|(motion, h)| (motion, *h))
    }
}

impl<T: Real> History<T> {
    /// Step size with which the states were spaced.
    pub fn step_size(&self) -> f64 {
        self.clock.h
    }

    /// Number of past states known, the current one not counted.
    pub fn len(&self) -> usize {
        self.known - 1
    }

    /// Whether no past state is known.
    pub fn is_empty(&self) -> bool {
        self.known <= 1
    }

    /// Displacement, velocity and acceleration of past state k = 1 (the one before the current), 2, …, as later steps
    /// read them: after a history projection they differ from what an observer saw.
    pub fn past(&self, k: usize) -> Option<(&[T], &[T], &[T])> {
        let motion = self.slots.get(k).filter(|_| (1..self.known).contains(&k))?;
        Some((&motion.u, &motion.v, &motion.a))
    }

    pub(crate) fn check(&self, dofs: usize, slots: usize, massless: usize) -> Result<()> {
        let wrong = |what, expected, found| Err(Error::Dimension { what, expected, found });
        if self.slopes.len() != massless {
            return wrong("the history (dofs without mass)", massless, self.slopes.len());
        }
        if self.slots.len() != slots {
            return wrong("the history (states)", slots, self.slots.len());
        }
        for motion in &self.slots {
            for found in (0..3).map(|field| motion.field(field).len()) {
                if found != dofs {
                    return wrong("a state of the history", dofs, found);
                }
            }
        }
        Ok(())
    }
}

/// Time as origin + elapsed + k h, so that it does not drift. What has elapsed is a sum of spacings, which the origin
/// does not round: runs are the same whenever they start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Clock {
    /// Time at the start of the run.
    origin: f64,
    /// From there to the last change of the step size.
    elapsed: f64,
    /// Steps since then, and their size.
    pub(crate) steps: u64,
    pub(crate) h: f64,
}

impl Clock {
    pub(crate) fn new(origin: f64, h: f64) -> Self {
        Self { origin, elapsed: 0.0, steps: 0, h }
    }

    /// Time at `fraction` of the step that comes next.
    pub(crate) fn at(&self, fraction: f64) -> f64 {
        self.origin + self.elapsed_at(fraction)
    }

    fn elapsed_at(&self, fraction: f64) -> f64 {
        self.elapsed + (self.steps as f64 + fraction) * self.h
    }

    /// The clock with another step size from here on.
    pub(crate) fn with_step_size(&self, h: f64) -> Self {
        Self { elapsed: self.elapsed_at(0.0), steps: 0, h, ..*self }
    }

    /// From now until t.
    pub(crate) fn until(&self, t: f64) -> f64 {
        (t - self.origin) - self.elapsed_at(0.0)
    }

    /// Whether t is reached, but for 1e-9 h and the rounding of t.
    pub(crate) fn has_reached(&self, t: f64) -> bool {
        t - self.at(0.0) <= 1e-9 * self.h + resolution(t).min(0.5 * self.h)
    }

    /// Refuses a step size that does not change the time: host functions of time would stand still while the motion
    /// goes on.
    pub(crate) fn check(&self) -> Result<()> {
        let (t, h) = (self.at(0.0), self.h);
        match h >= resolution(t) {
            true => Ok(()),
            false => Err(Error::TimeNotAdvancing { t, h, resolution: resolution(t) }),
        }
    }
}

/// The distance between times near t that an `f64` can tell apart.
pub(crate) fn resolution(t: f64) -> f64 {
    t.abs().next_up() - t.abs()
}

/// Where the present step size stands in the nominal grid, for runs that control it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pace {
    pub(crate) nominal: f64,
    /// How often the nominal step is halved now.
    level: u32,
    /// Steps of the present size since the size last was the nominal one.
    position: u64,
    /// Steps taken since the size last changed, and whether it grew then.
    steps: u32,
    grown: bool,
    /// Steps that growth asks for.
    patience: u32,
}

/// Good steps before a step size grows, at first and at most.
const PATIENCE: [u32; 2] = [2, 64];

impl Pace {
    pub(crate) fn new(nominal: f64) -> Self {
        Self { nominal, level: 0, position: 0, steps: 0, grown: false, patience: PATIENCE[0] }
    }

    /// After a refusal: half the size. One that follows growth at once makes the next growth wait longer.
    pub(crate) fn halve(&mut self) {
        if self.grown && self.steps == 0 {
            self.patience = (2 * self.patience).min(PATIENCE[1]);
        }
        (self.level, self.position) = (self.level + 1, 2 * self.position);
        (self.steps, self.grown) = (0, false);
    }

    /// After a good step: says whether the size may grow here.
    pub(crate) fn advance(&mut self) -> bool {
        self.position = if self.level > 0 { self.position + 1 } else { 0 };
        self.steps += 1;
        if self.grown {
            self.patience = PATIENCE[0];
        }
        self.level > 0 && self.position.is_multiple_of(2) && self.steps >= self.patience
    }

    /// Growth: twice the size.
    pub(crate) fn double(&mut self) {
        (self.level, self.position) = (self.level - 1, self.position / 2);
        (self.steps, self.grown) = (0, true);
    }
}
