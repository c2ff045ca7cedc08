//! The contact data of a state.

use crate::contact::{ContactId, Tangents};
use crate::real::Real;
use crate::rounding::half_digits;

/// Status of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ContactStatus {
    /// Open, without force.
    Open,
    /// Closed within rounding, without force.
    Touching,
    /// Pressed, or held by an equality, without friction.
    Closed,
    /// Pressed and sticking.
    Sticking,
    /// Pressed and sliding: friction is μ times the normal force.
    Sliding,
}

/// Version of the list of contact names: lists of the same version are equal.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Names(u64);

impl Names {
    /// Sets a new version.
    pub(crate) fn change(&mut self) {
        self.0 += 1;
    }

    /// Whether two lists are known to be equal.
    fn are(self, other: Self) -> bool {
        self.0 != 0 && self.0 == other.0
    }
}

/// States are compared by their content, not by versions.
impl PartialEq for Names {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Multipliers and flags of the contacts, one entry per candidate, in the order of the constraints and their rows.
///
/// With friction, the multipliers of tangential rows follow the multipliers of all gaps: forces, impulses, λ_v and
/// λ_a have one entry per row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactState<T> {
    pub(crate) ids: Vec<ContactId>,
    pub(crate) tangents: Tangents,
    /// The version of these names, if known.
    pub(crate) names: Names,
    pub(crate) lambda: Vec<T>,
    pub(crate) lambda_raw: Vec<T>,
    pub(crate) closed: Vec<bool>,
    pub(crate) gap: Vec<T>,
    pub(crate) impulse: Vec<T>,
    pub(crate) lambda_v: Vec<T>,
    pub(crate) lambda_a: Vec<T>,
    pub(crate) dissipated: Vec<T>,
    /// Slip, one entry per tangential row, and whether each contact slides; both are empty without friction.
    pub(crate) slip: Vec<T>,
    pub(crate) sliding: Vec<bool>,
}

impl<T: Real> ContactState<T> {
    /// Sets the contacts to `ids`, all open.
    pub(crate) fn reset(&mut self, ids: &[ContactId], tangents: &Tangents) {
        let n = ids.len();
        self.names = Names::default();
        self.ids.clear();
        self.ids.extend_from_slice(ids);
        self.tangents.copy_from(tangents);
        let Self { lambda, lambda_raw, gap, impulse, lambda_v, lambda_a, dissipated, slip, sliding, .. } = self;
        let size = |values: &mut Vec<T>, count: usize| {
            values.clear();
            values.resize(count, T::zero());
        };
        for values in [lambda, lambda_raw, impulse, lambda_v, lambda_a] {
            size(values, n + tangents.len());
        }
        for values in [gap, dissipated] {
            size(values, n);
        }
        size(slip, tangents.len());
        sliding.clear();
        sliding.resize(if tangents.is_empty() { 0 } else { n }, false);
        self.closed.clear();
        self.closed.resize(n, false);
    }

    /// Copies the data of contacts that exist in another state; new contacts are open. Values that every stage sets
    /// anew (impulses, λ_v, slips; gaps and λ_a of tangential rows) are undefined until then.
    pub(crate) fn carry_over(&mut self, old: &Self, (ids, names): (&[ContactId], Names), tangents: &Tangents) {
        if old.names.are(names) && self.names.are(names) {
            self.lambda.copy_from_slice(&old.lambda);
            self.lambda_raw.copy_from_slice(&old.lambda_raw);
            self.gap.copy_from_slice(&old.gap);
            self.lambda_a.copy_from_slice(&old.lambda_a);
            self.closed.copy_from_slice(&old.closed);
            self.dissipated.copy_from_slice(&old.dissipated);
            if !tangents.is_empty() {
                // Friction coefficients may have changed.
                self.tangents.copy_from(tangents);
                self.sliding.copy_from_slice(&old.sliding);
            }
            return;
        }
        self.reset(ids, tangents);
        self.names = names;
        // Appearing and vanishing candidates shift the others: the position after the last match is tried first.
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
                self.closed[i] = old.closed[j];
                self.gap[i] = old.gap[j];
                self.lambda_a[i] = old.lambda_a[j];
                self.dissipated[i] = old.dissipated[j];
                let tangential = tangents.of(i).zip(old.tangents.of(j));
                for (i, j) in std::iter::once((i, j)).chain(tangential) {
                    self.lambda[i] = old.lambda[j];
                    self.lambda_raw[i] = old.lambda_raw[j];
                }
                if let (Some(now), Some(&before)) = (self.sliding.get_mut(i), old.sliding.get(j)) {
                    *now = before;
                }
            }
        }
    }

    /// The entries of the gaps in a list with one entry per row.
    fn normal<'v>(&self, values: &'v [T]) -> &'v [T] {
        &values[..self.ids.len()]
    }

    /// The length of the tangential vector of a contact in a list with one entry per row.
    pub(crate) fn tangential(&self, contact: usize, values: &[T]) -> T {
        values[self.tangents.of(contact)].iter().fold(T::zero(), |length, &x| length.hypot(x))
    }

    /// The contact of each entry.
    pub fn ids(&self) -> &[ContactId] {
        &self.ids
    }

    /// Gaps, positive when open.
    pub fn gaps(&self) -> &[T] {
        &self.gap
    }

    /// Contact forces, compression positive, after correction.
    ///
    /// In schemes whose balance holds at the state, M a = f + Gᵀ λ to rounding. In others λ is the force at the time
    /// of the balance ([`Stage::load`](crate::tableau::Stage::load)), and M a and f + Gᵀ λ differ by O(h) at the
    /// state.
    ///
    /// The forces are values at an instant, not means over the step: their sum over the steps times h is not the
    /// change of momentum. The force jumps with the velocity at an impact, and the sum misses the force within that
    /// step (3 % on a coarse block). [`impulses`](Self::impulses) balance the momentum to rounding.
    pub fn forces(&self) -> &[T] {
        self.normal(&self.lambda)
    }

    /// Friction forces of a contact, after correction, one along each of its
    /// [tangents](crate::contact::Contact::tangent): |f| ≤ μ λ; they act on the bodies as f times the tangential row.
    /// Empty for contacts without friction. Like [`forces`](Self::forces) they are values at an instant;
    /// [`friction_impulses`](Self::friction_impulses) balance the momentum to rounding.
    ///
    /// In the plane the tangent of this crate's constraints is (n_y, −n_x), with n the direction in which the gap
    /// opens for the first body (the body of the nodes, or the slave): on a floor, to the right. In space the two
    /// tangents are arbitrary orthonormal directions, chosen anew when normals turn;
    /// [`ContactForce`](crate::ContactForce) has the tangents, and forces as vectors.
    pub fn friction_forces(&self, contact: usize) -> &[T] {
        &self.lambda[self.tangents.of(contact)]
    }

    /// Impulses of friction in the last step (force × time), including corrections, as for
    /// [`impulses`](Self::impulses).
    pub fn friction_impulses(&self, contact: usize) -> &[T] {
        &self.impulse[self.tangents.of(contact)]
    }

    /// Slip velocities along the tangents (length/time), which correspond to
    /// [`friction_forces`](Self::friction_forces) and [`status`](Self::status). They are zero to rounding if a
    /// contact sticks, and opposed to friction if it slides. Empty for contacts without friction.
    ///
    /// They belong to the velocity of the state, after correction. In explicit schemes and on dofs without mass,
    /// velocities are means over the steps before and after: in the step in which such a contact stops or reverses,
    /// its slip is the slip of the displacement caused by its force.
    pub fn slip(&self, contact: usize) -> &[T] {
        let (rows, gaps) = (self.tangents.of(contact), self.ids.len());
        // Contacts without friction have an arbitrary empty range.
        &self.slip[rows.start.saturating_sub(gaps)..rows.end.saturating_sub(gaps)]
    }

    /// Raw multipliers of the contact problem of the last stage; they decide release, and their impulse is h Σ β λ.
    pub fn raw_forces(&self) -> &[T] {
        self.normal(&self.lambda_raw)
    }

    /// Whether a contact is closed: pressed (raw multiplier > 0) or touching within rounding.
    pub fn closed(&self) -> &[bool] {
        &self.closed
    }

    /// Status of a contact, by its position in the lists.
    pub fn status(&self, contact: usize) -> ContactStatus {
        match (self.closed[contact], self.lambda_raw[contact] == T::zero()) {
            (false, _) => ContactStatus::Open,
            (true, true) => ContactStatus::Touching,
            (true, false) if self.tangents.of(contact).is_empty() => ContactStatus::Closed,
            (true, false) if self.sliding[contact] => ContactStatus::Sliding,
            (true, false) => ContactStatus::Sticking,
        }
    }

    /// Impulses of the last step (force × time) along the rows, including corrections. If normals turn within a step,
    /// parts of them act along different normals;
    /// [`Simulation::impulses_on_dofs`](crate::Simulation::impulses_on_dofs) has their vectors.
    pub fn impulses(&self) -> &[T] {
        self.normal(&self.impulse)
    }

    /// The paper's λ_v of the last correction of the acceleration (momentum, kg m/s); zero without correction.
    pub fn lambda_v(&self) -> &[T] {
        self.normal(&self.lambda_v)
    }

    /// The paper's λ_a of the last correction of the velocity (kg m); zero without correction.
    pub fn lambda_a(&self) -> &[T] {
        self.normal(&self.lambda_a)
    }

    /// Kinetic energy that corrections have taken from the bodies since a contact last closed and have not returned,
    /// measured in the frame of a moving obstacle. For contacts without mass, the work that
    /// [`WorkBalance`](crate::corrector::WorkBalance) has still to return to the bodies; negative if it has still to
    /// take work from them.
    pub fn dissipated(&self) -> &[T] {
        &self.dissipated
    }
}

/// Whether a friction of this magnitude is sliding friction: μ times the normal force, up to rounding.
pub(crate) fn slides<T: Real>(friction: T, bound: T) -> bool {
    friction >= (T::one() - half_digits::<T>()) * bound.max(T::zero())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contacts with these features, each with a tangent and its own coefficient.
    fn named(features: &[usize], friction: f64) -> (Vec<ContactId>, Tangents) {
        let ids = features.iter().map(|&feature| ContactId { constraint: 0, feature, candidate: 0 }).collect();
        let mut tangents = Tangents::default();
        tangents.begin(features.len());
        for _ in features {
            tangents.push(friction, 1);
        }
        (ids, tangents)
    }

    /// A state whose entries identify their contact: ten times its feature, plus one for the tangent.
    fn filled(features: &[usize], friction: f64) -> ContactState<f64> {
        let (ids, tangents) = named(features, friction);
        let mut state = ContactState::default();
        state.reset(&ids, &tangents);
        let count = features.len();
        for (k, &feature) in features.iter().enumerate() {
            let value = 10.0 * feature as f64;
            for values in [&mut state.lambda, &mut state.lambda_raw] {
                (values[k], values[count + k]) = (value, value + 1.0);
            }
            (state.gap[k], state.dissipated[k], state.closed[k], state.sliding[k]) = (value, value, true, true);
        }
        state
    }

    fn entries(state: &ContactState<f64>) -> [&[f64]; 4] {
        [&state.lambda, &state.lambda_raw, &state.gap, &state.dissipated]
    }

    #[test]
    fn contacts_keep_what_they_had_and_new_ones_are_open() {
        let old = filled(&[1, 4, 6], 0.2);
        // The memory held other contacts before.
        let mut state = filled(&[9, 8, 7], 0.2);
        let (ids, tangents) = named(&[4, 5, 6], 0.3);
        state.carry_over(&old, (&ids, Names(3)), &tangents);
        let (rows, gaps) = ([40.0, 0.0, 60.0, 41.0, 0.0, 61.0], [40.0, 0.0, 60.0]);
        assert_eq!(entries(&state), [&rows[..], &rows, &gaps, &gaps]);
        assert_eq!(
            (state.closed.as_slice(), state.sliding.as_slice()),
            (&[true, false, true][..], &[true, false, true][..])
        );
        assert_eq!((&state.ids, &state.tangents), (&ids, &tangents));
    }

    #[test]
    fn contacts_of_the_same_names_are_copied_with_new_coefficients() {
        let (mut old, mut state) = (filled(&[1, 4], 0.2), filled(&[7, 8], 0.2));
        (old.names, state.names) = (Names(5), Names(5));
        (old.sliding[0], old.closed[1]) = (false, false);
        let (ids, tangents) = named(&[1, 4], 0.4);
        state.ids.clone_from(&ids);
        state.carry_over(&old, (&ids, Names(5)), &tangents);
        assert_eq!(entries(&state), entries(&old));
        assert_eq!((&state.closed, &state.sliding, &state.tangents), (&old.closed, &old.sliding, &tangents));
    }
}
