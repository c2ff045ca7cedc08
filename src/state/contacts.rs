//! What a state holds of its contacts.

use crate::contact::ContactId;
use crate::real::Real;

/// What a contact does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ContactStatus {
    /// Apart: no force.
    Open,
    /// Closed within rounding, and not pressed.
    Touching,
    /// Pressed (or, under an equality, held).
    Closed,
}

/// Which version of the names of all rows of a run a list holds: lists of one version are equal.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Names(u64);

impl Names {
    /// To a version that there has not been.
    pub(crate) fn change(&mut self) {
        self.0 += 1;
    }

    /// Whether two lists are known to be equal.
    fn are(self, other: Self) -> bool {
        self.0 != 0 && self.0 == other.0
    }
}

/// (States are compared by what they hold.)
impl PartialEq for Names {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Multipliers and flags of the contacts, one entry a candidate, in the order of the constraints and their rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactState<T> {
    pub(crate) ids: Vec<ContactId>,
    /// The version of these names, if it is known.
    pub(crate) names: Names,
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
            names: Names::default(),
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

    /// Makes room for so many contacts in all.
    pub(crate) fn make_room(&mut self, rows: usize) {
        let Self { ids, lambda, lambda_raw, closed, gap, impulse, lambda_v, lambda_a, dissipated, .. } = self;
        ids.reserve(rows.saturating_sub(ids.len()));
        closed.reserve(rows.saturating_sub(closed.len()));
        for reals in [lambda, lambda_raw, gap, impulse, lambda_v, lambda_a, dissipated] {
            reals.reserve(rows.saturating_sub(reals.len()));
        }
    }

    /// Opens every contact of `ids`.
    pub(crate) fn reset(&mut self, ids: &[ContactId]) {
        let n = ids.len();
        self.names = Names::default();
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

    /// Copies what belongs to the same contacts from another state; contacts it does not know are open. What every
    /// stage sets anew (gaps, impulses, λ_v, λ_a) is anything before.
    pub(crate) fn carry_over(&mut self, old: &Self, (ids, names): (&[ContactId], Names)) {
        if old.names.are(names) && self.names.are(names) {
            self.lambda.copy_from_slice(&old.lambda);
            self.lambda_raw.copy_from_slice(&old.lambda_raw);
            self.closed.copy_from_slice(&old.closed);
            self.dissipated.copy_from_slice(&old.dissipated);
            return;
        }
        self.reset(ids);
        self.names = names;
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

    /// What a contact does, by its place in the lists.
    pub fn status(&self, contact: usize) -> ContactStatus {
        match (self.closed[contact], self.lambda_raw[contact] == T::zero()) {
            (false, _) => ContactStatus::Open,
            (true, true) => ContactStatus::Touching,
            (true, false) => ContactStatus::Closed,
        }
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
