//! What a constraint says of its candidates: names, laws, rows, and what is drawn of them.

use super::{ContactJacobian, ContactLaw};
use crate::real::Real;
use std::ops::Range;

/// What a constraint says of its candidates, in their order: filled by
/// [`ContactConstraint::contacts`](super::ContactConstraint::contacts), one [`push`](Self::push) a candidate.
///
/// Rows name dofs by their *place* in [`ContactConstraint::dofs`](super::ContactConstraint::dofs), not by their number
/// in the system.
///
/// ```
/// use contact_dynamics::ContactLaw;
/// use contact_dynamics::contact::Contacts;
///
/// let mut contacts = Contacts::new();
/// // A node (dofs at places 0 and 1) against a slope, and a spring between two others.
/// contacts.push((7, 0), ContactLaw::Rigid, &[(0, 0.6), (1, 0.8)]).tangent(&[(0, 0.8), (1, -0.6)]).friction(0.3);
/// contacts.push((8, 0), ContactLaw::Penalty { stiffness: 1e3 }, &[(2, -1.0), (3, 1.0)]).magnitude(2.0);
/// assert_eq!((contacts.len(), contacts.name(1)), (2, (8, 0)));
/// assert_eq!(contacts.row(0).collect::<Vec<_>>(), [(0, 0.6), (1, 0.8)]);
/// assert_eq!((contacts.tangents(0).len(), contacts.friction(0)), (1, 0.3));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Contacts<T> {
    names: Vec<(usize, usize)>,
    laws: Vec<ContactLaw>,
    rows: ContactJacobian<T>,
    magnitudes: Vec<T>,
    recoveries: Vec<T>,
    tangents: ContactJacobian<T>,
    /// Where the tangents of each contact begin.
    first_tangents: Vec<usize>,
    frictions: Vec<f64>,
    positions: Vec<Option<[T; 3]>>,
    normals: Vec<Option<[T; 3]>>,
}

impl<T> Default for Contacts<T> {
    fn default() -> Self {
        Self {
            names: Vec::new(),
            laws: Vec::new(),
            rows: ContactJacobian::default(),
            magnitudes: Vec::new(),
            recoveries: Vec::new(),
            tangents: ContactJacobian::default(),
            first_tangents: Vec::new(),
            frictions: Vec::new(),
            positions: Vec::new(),
            normals: Vec::new(),
        }
    }
}

impl<T: Real> Contacts<T> {
    /// None yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Forgets all, and keeps the memory.
    pub fn clear(&mut self) {
        let Self { names, laws, rows, magnitudes, recoveries, tangents, .. } = self;
        names.clear();
        laws.clear();
        rows.clear();
        magnitudes.clear();
        recoveries.clear();
        tangents.clear();
        self.first_tangents.clear();
        self.frictions.clear();
        self.positions.clear();
        self.normals.clear();
    }

    /// Appends a candidate: its name (feature, candidate), which identifies it from step to step
    /// ([`ContactId`](super::ContactId)), its law, and its row of G, the derivative of the gap, as (place, weight)
    /// pairs.
    pub fn push(&mut self, name: (usize, usize), law: ContactLaw, row: &[(usize, T)]) -> Contact<'_, T> {
        self.rows.push(row);
        self.finish(name, law)
    }

    /// The same with a row of a matrix.
    pub(crate) fn push_row(
        &mut self,
        name: (usize, usize),
        law: ContactLaw,
        (g, row): (&ContactJacobian<T>, usize),
    ) -> Contact<'_, T> {
        self.rows.push_row(g, row);
        self.finish(name, law)
    }

    fn finish(&mut self, name: (usize, usize), law: ContactLaw) -> Contact<'_, T> {
        self.names.push(name);
        self.laws.push(law);
        self.magnitudes.push(T::zero());
        self.recoveries.push(T::infinity());
        self.first_tangents.push(self.tangents.rows());
        self.frictions.push(0.0);
        self.positions.push(None);
        self.normals.push(None);
        Contact { contacts: self }
    }

    /// Number of candidates.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there is no candidate.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// (feature, candidate) of a candidate.
    pub fn name(&self, contact: usize) -> (usize, usize) {
        self.names[contact]
    }

    /// The law of a candidate.
    pub fn law(&self, contact: usize) -> ContactLaw {
        self.laws[contact]
    }

    /// The (place, weight) pairs of the row of G of a candidate.
    pub fn row(&self, contact: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        self.rows.row(contact)
    }

    /// All rows of G; the dofs that they name are places.
    pub(crate) fn rows(&self) -> &ContactJacobian<T> {
        &self.rows
    }

    /// Whether names and rows are those of another list.
    pub(crate) fn has_rows_of(&self, other: &Self) -> bool {
        self.names == other.names && self.rows == other.rows
    }

    /// What [`Contact::magnitude`] was given; zero if nothing.
    pub fn magnitude(&self, contact: usize) -> T {
        self.magnitudes[contact]
    }

    /// What [`Contact::recovery`] was given; infinity if nothing.
    pub fn recovery(&self, contact: usize) -> T {
        self.recoveries[contact]
    }

    /// The rows of [`Contact::tangent`], as (place, weight) pairs.
    pub fn tangents(&self, contact: usize) -> Vec<Vec<(usize, T)>> {
        self.tangents_of(contact).map(|row| self.tangents.row(row).collect()).collect()
    }

    /// The friction coefficient of a candidate; zero if none was given.
    pub fn friction(&self, contact: usize) -> f64 {
        self.frictions[contact]
    }

    /// The tangents of all candidates, one after the other; the dofs that they name are places.
    pub(crate) fn tangent_rows(&self) -> &ContactJacobian<T> {
        &self.tangents
    }

    /// Those of a candidate among them.
    pub(crate) fn tangents_of(&self, contact: usize) -> Range<usize> {
        let end = self.first_tangents.get(contact + 1).copied().unwrap_or(self.tangents.rows());
        self.first_tangents[contact]..end
    }

    /// Whether any candidate has friction.
    pub(crate) fn has_friction(&self) -> bool {
        self.frictions.iter().any(|&friction| friction != 0.0)
    }

    /// The number of rows that candidates have for their friction.
    pub(crate) fn rubbing_rows(&self) -> usize {
        let rubs = |contact: &usize| self.frictions[*contact] != 0.0;
        (0..self.len()).filter(rubs).map(|contact| self.tangents_of(contact).len()).sum()
    }

    /// Where a contact is, if its constraint has said so.
    pub fn position(&self, contact: usize) -> Option<[T; 3]> {
        self.positions[contact]
    }

    /// The normal of a contact in space, if its constraint has said so.
    pub fn normal(&self, contact: usize) -> Option<[T; 3]> {
        self.normals[contact]
    }
}

/// [`ContactLaw::kept_depth`] of what comes out slowly.
pub(crate) fn kept_depth<T: Real>(gap: T, recovery: T) -> T {
    (-gap - recovery).max(T::zero())
}

/// A candidate that was pushed last: what else there is to say of it.
#[derive(Debug)]
pub struct Contact<'c, T> {
    contacts: &'c mut Contacts<T>,
}

impl<T: Real> Contact<'_, T> {
    /// A row beside the normal one, along which bodies slide: (place, weight) pairs, so that its product with the
    /// velocities is the slip. One in the plane, along (n_y, −n_x) by all constraints of this crate, n the direction in
    /// which the gap opens; two in space, along directions that are orthonormal, for the cone of
    /// friction is round. Without [`friction`](Self::friction) it is kept for output.
    pub fn tangent(&mut self, row: &[(usize, T)]) -> &mut Self {
        self.contacts.tangents.push(row);
        self
    }

    /// The same with a row of a matrix.
    pub(crate) fn tangent_row(&mut self, (rows, row): (&ContactJacobian<T>, usize)) {
        self.contacts.tangents.push_row(rows, row);
    }

    /// The same with the pairs one by one.
    #[cfg(feature = "search")]
    pub(crate) fn tangent_entries(&mut self, entries: impl Iterator<Item = (usize, T)>) {
        self.contacts.tangents.push_entries(entries);
    }

    /// Coulomb's friction along the [tangents](Self::tangent): the coefficient μ, from 0, the default. |f| ≤ μ p, and f
    /// opposes the slip. It may be another one after each search: a function of the place, for instance.
    pub fn friction(&mut self, coefficient: f64) -> &mut Self {
        if let Some(friction) = self.contacts.frictions.last_mut() {
            *friction = coefficient;
        }
        self
    }

    /// The size of what is summed to the gap besides G u and the gap itself, for instance coordinates (length): contact
    /// takes gaps for zero within the rounding of it. Nothing if not given.
    pub fn magnitude(&mut self, size: T) -> &mut Self {
        if let Some(magnitude) = self.contacts.magnitudes.last_mut() {
            *magnitude = size;
        }
        self
    }

    /// How far (length, d ≥ 0) a step lets this contact come out of the other body. Where the search at the start of a
    /// step finds a gap g below −d, the contact has to be at g + d at its end, and no farther. A corner that has come
    /// in beside an edge, where nothing looked for it, is otherwise thrown out in one step, and gains energy from
    /// nothing. Steps that are halved, or end early to land on a time, let it come out by as much less. It is read of
    /// [`ContactLaw::Rigid`] only. If not given all comes out at once.
    ///
    /// Closed contacts of a state may so have negative gaps. Those at the start of a run are another matter
    /// ([`InitialOverclosure`](crate::InitialOverclosure)).
    ///
    /// ```
    /// use contact_dynamics::ContactLaw;
    /// use contact_dynamics::contact::Contacts;
    ///
    /// let mut contacts = Contacts::new();
    /// contacts.push((7, 0), ContactLaw::Rigid, &[(0, 1.0)]).recovery(1e-4);
    /// contacts.push((8, 0), ContactLaw::Rigid, &[(1, 1.0)]);
    /// assert_eq!([0, 1].map(|contact| contacts.recovery(contact)), [1e-4, f64::INFINITY]);
    /// ```
    pub fn recovery(&mut self, depth: T) -> &mut Self {
        if let Some(last) = self.contacts.recoveries.last_mut() {
            *last = depth;
        }
        self
    }

    /// Where the contact is, for output: x, y, z (length; zero where there is no such axis).
    pub fn position(&mut self, position: [T; 3]) -> &mut Self {
        if let Some(last) = self.contacts.positions.last_mut() {
            *last = Some(position);
        }
        self
    }

    /// The direction in space in which the gap opens, for output: a unit vector.
    pub fn normal(&mut self, normal: [T; 3]) -> &mut Self {
        if let Some(last) = self.contacts.normals.last_mut() {
            *last = Some(normal);
        }
        self
    }
}
