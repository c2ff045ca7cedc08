//! The candidates of a constraint: their names, laws, rows, and output data.

use super::{ContactJacobian, ContactLaw};
use crate::real::Real;
use std::ops::Range;

/// The candidates of a constraint, in their order.
/// [`ContactConstraint::contacts`](super::ContactConstraint::contacts) fills it with one [`push`](Self::push) per
/// candidate.
///
/// Rows refer to dofs by their *place* in [`ContactConstraint::dofs`](super::ContactConstraint::dofs), not by their
/// index in the system.
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
    list: Vec<Data<T>>,
    rows: ContactJacobian<T>,
    tangents: ContactJacobian<T>,
}

/// A candidate besides its rows.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Data<T> {
    name: (usize, usize),
    law: ContactLaw,
    magnitude: T,
    recovery: T,
    first_tangent: usize,
    friction: f64,
    position: Option<[T; 3]>,
    normal: Option<[T; 3]>,
}

impl<T> Default for Contacts<T> {
    fn default() -> Self {
        Self { list: Vec::new(), rows: ContactJacobian::default(), tangents: ContactJacobian::default() }
    }
}

impl<T: Real> Contacts<T> {
    /// An empty list.
    pub fn new() -> Self {
        Self::default()
    }

    /// Removes all candidates and keeps the memory.
    pub fn clear(&mut self) {
        self.list.clear();
        self.rows.clear();
        self.tangents.clear();
    }

    /// Appends a candidate: its name (feature, candidate), which identifies it from step to step
    /// ([`ContactId`](super::ContactId)), its law, and its row of G, the derivative of the gap, as (place, weight)
    /// pairs.
    pub fn push(&mut self, name: (usize, usize), law: ContactLaw, row: &[(usize, T)]) -> Contact<'_, T> {
        self.rows.push(row);
        self.finish(name, law)
    }

    /// As [`push`](Self::push), with a row of a matrix.
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
        let (contact, first_tangent) = (self.list.len(), self.tangents.rows());
        let (magnitude, recovery, friction) = (T::zero(), T::infinity(), 0.0);
        let (position, normal) = (None, None);
        self.list.push(Data { name, law, magnitude, recovery, first_tangent, friction, position, normal });
        Contact { data: &mut self.list[contact], tangents: &mut self.tangents }
    }

    /// Number of candidates.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there is no candidate.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// (feature, candidate) of a candidate.
    pub fn name(&self, contact: usize) -> (usize, usize) {
        self.list[contact].name
    }

    /// The law of a candidate.
    pub fn law(&self, contact: usize) -> ContactLaw {
        self.list[contact].law
    }

    /// The (place, weight) pairs of the row of G of a candidate.
    pub fn row(&self, contact: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        self.rows.row(contact)
    }

    /// All rows of G; their dofs are places.
    pub(crate) fn rows(&self) -> &ContactJacobian<T> {
        &self.rows
    }

    /// Whether names and rows are equal to another list.
    pub(crate) fn has_rows_of(&self, other: &Self) -> bool {
        let names = self.list.iter().map(|data| data.name);
        names.eq(other.list.iter().map(|data| data.name)) && self.rows == other.rows
    }

    /// The value set with [`Contact::magnitude`]; zero by default.
    pub fn magnitude(&self, contact: usize) -> T {
        self.list[contact].magnitude
    }

    /// The value set with [`Contact::recovery`]; infinity by default.
    pub fn recovery(&self, contact: usize) -> T {
        self.list[contact].recovery
    }

    /// The rows of [`Contact::tangent`], as (place, weight) pairs.
    pub fn tangents(&self, contact: usize) -> Vec<Vec<(usize, T)>> {
        self.tangents_of(contact).map(|row| self.tangents.row(row).collect()).collect()
    }

    /// The friction coefficient of a candidate; zero by default.
    pub fn friction(&self, contact: usize) -> f64 {
        self.list[contact].friction
    }

    /// The tangents of all candidates, one after the other; their dofs are places.
    pub(crate) fn tangent_rows(&self) -> &ContactJacobian<T> {
        &self.tangents
    }

    /// The range of a candidate's tangents in [`tangent_rows`](Self::tangent_rows).
    pub(crate) fn tangents_of(&self, contact: usize) -> Range<usize> {
        let end = self.list.get(contact + 1).map_or(self.tangents.rows(), |next| next.first_tangent);
        self.list[contact].first_tangent..end
    }

    pub(crate) fn has_friction(&self) -> bool {
        self.list.iter().any(|data| data.friction != 0.0)
    }

    /// The position of a contact, if its constraint has set it.
    pub fn position(&self, contact: usize) -> Option<[T; 3]> {
        self.list[contact].position
    }

    /// The normal of a contact in space, if its constraint has set it.
    pub fn normal(&self, contact: usize) -> Option<[T; 3]> {
        self.list[contact].normal
    }
}

/// The part of the penetration that exceeds the recovery of a step: it stays, and gaps are measured from it.
pub(crate) fn kept_depth<T: Real>(gap: T, recovery: T) -> T {
    (-gap - recovery).max(T::zero())
}

/// The candidate pushed last, for its optional data.
#[derive(Debug)]
pub struct Contact<'c, T> {
    data: &'c mut Data<T>,
    tangents: &'c mut ContactJacobian<T>,
}

impl<T: Real> Contact<'_, T> {
    /// Adds a tangential row: (place, weight) pairs whose product with the velocities is the slip. There is one in
    /// the plane, which all constraints of this crate take along (n_y, −n_x), with n the direction in which the gap
    /// opens. There are two in space, along orthonormal directions, because the friction cone is round. Without
    /// [`friction`](Self::friction) they are kept for output.
    pub fn tangent(&mut self, row: &[(usize, T)]) -> &mut Self {
        self.tangent_entries(row.iter().copied());
        self
    }

    /// As [`tangent`](Self::tangent), with a row of a matrix.
    pub(crate) fn tangent_row(&mut self, (rows, row): (&ContactJacobian<T>, usize)) {
        self.tangents.push_row(rows, row);
    }

    /// As [`tangent`](Self::tangent), with an iterator of pairs.
    pub(crate) fn tangent_entries(&mut self, entries: impl Iterator<Item = (usize, T)>) {
        self.tangents.push_entries(entries);
    }

    /// Sets Coulomb's friction along the [tangents](Self::tangent): the coefficient μ ≥ 0, zero by default. |f| ≤ μ p,
    /// and f opposes the slip. It may change with each search, for instance as a function of the position.
    pub fn friction(&mut self, coefficient: f64) -> &mut Self {
        self.data.friction = coefficient;
        self
    }

    /// Sets the magnitude (length) of the terms of the gap besides G u and the gap itself, for instance coordinates.
    /// Contact treats gaps within the rounding of it as zero. The default is zero.
    pub fn magnitude(&mut self, size: T) -> &mut Self {
        self.data.magnitude = size;
        self
    }

    /// Limits the penetration (length, d ≥ 0) recovered per step. If the search at the start of a step finds a gap g
    /// below −d, the gap at its end must be g + d. Without a limit, a corner that has penetrated beside an edge,
    /// where no row was, would be thrown out in one step and gain energy. Steps that are halved, or shortened to end
    /// at a given time, recover less in proportion. It applies to [`ContactLaw::Rigid`] only. By default all is
    /// recovered at once.
    ///
    /// So closed contacts of a state may have negative gaps. For negative gaps at the start of a run see
    /// [`InitialOverclosure`](crate::InitialOverclosure).
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
        self.data.recovery = depth;
        self
    }

    /// Sets the position of the contact, for output: x, y, z (length; zero for a missing axis).
    pub fn position(&mut self, position: [T; 3]) -> &mut Self {
        self.data.position = Some(position);
        self
    }

    /// Sets position and normal of a contact of meshes, and the magnitude of the position.
    #[cfg(feature = "mesh-contact")]
    pub(crate) fn at(&mut self, position: [f64; 3], normal: [f64; 3]) {
        let size = position.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        self.magnitude(T::of(size)).position(position.map(T::of)).normal(normal.map(T::of));
    }

    /// Sets the direction in space in which the gap opens, for output: a unit vector.
    pub fn normal(&mut self, normal: [T; 3]) -> &mut Self {
        self.data.normal = Some(normal);
        self
    }
}
