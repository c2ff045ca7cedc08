//! The tangential rows of G, for friction: they follow all normal rows, in the order of their contacts.

use super::ContactJacobian;
use crate::real::Real;
use std::ops::Range;

/// The tangential rows of the contacts of a run that have friction. Nothing is stored if none has.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(into = "Vec<(f64, usize)>", try_from = "Vec<(f64, usize)>"))]
pub(crate) struct Tangents {
    /// For each contact its first tangential row, and after the last contact the end of all; empty without friction.
    first: Vec<usize>,
    /// For each contact its friction coefficient.
    friction: Vec<f64>,
    /// For each tangential row its contact.
    owners: Vec<usize>,
    contacts: usize,
}

impl Tangents {
    pub(crate) fn clear(&mut self) {
        self.first.clear();
        self.friction.clear();
        self.owners.clear();
        self.contacts = 0;
    }

    /// Copies another list into the existing memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.first.clone_from(&other.first);
        self.friction.clone_from(&other.friction);
        self.owners.clone_from(&other.owners);
        self.contacts = other.contacts;
    }

    /// Starts a list for this number of contacts, some of which have friction.
    pub(crate) fn begin(&mut self, contacts: usize) {
        self.clear();
        self.contacts = contacts;
        self.first.push(contacts);
    }

    /// Appends the next contact, with this number of tangential rows.
    pub(crate) fn push(&mut self, friction: f64, rows: usize) {
        let contact = self.friction.len();
        self.friction.push(friction);
        self.owners.extend(std::iter::repeat_n(contact, rows));
        self.first.push(self.contacts + self.owners.len());
    }

    /// Number of contacts that have been appended.
    pub(crate) fn listed(&self) -> usize {
        self.friction.len()
    }

    /// Whether no contact has friction.
    pub(crate) fn is_empty(&self) -> bool {
        self.owners.is_empty()
    }

    pub(crate) fn len(&self) -> usize {
        self.owners.len()
    }

    pub(crate) fn of(&self, contact: usize) -> Range<usize> {
        match self.first.get(contact..contact + 2) {
            Some(&[start, end]) => start..end,
            _ => 0..0,
        }
    }

    pub(crate) fn all(&self) -> Range<usize> {
        self.contacts..self.contacts + self.owners.len()
    }

    pub(crate) fn friction(&self, contact: usize) -> f64 {
        self.friction.get(contact).copied().unwrap_or(0.0)
    }

    pub(crate) fn contacts(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.friction.len()).filter(|&contact| !self.of(contact).is_empty())
    }

    /// Whether a contact acts on any of the given dofs (ascending), by its gap or by its friction.
    pub(crate) fn act_on<T: Real>(&self, g: &ContactJacobian<T>, contact: usize, dofs: &[usize]) -> bool {
        !dofs.is_empty() && (g.acts_on(contact, dofs) || self.rub_on(g, contact, dofs))
    }

    /// Whether the friction of a contact acts on any of the given dofs (ascending).
    pub(crate) fn rub_on<T: Real>(&self, g: &ContactJacobian<T>, contact: usize, dofs: &[usize]) -> bool {
        self.of(contact).any(|row| g.acts_on(row, dofs))
    }

    /// The contact of a row; a normal row is its own contact.
    pub(crate) fn owner(&self, row: usize) -> usize {
        row.checked_sub(self.contacts).and_then(|tangent| self.owners.get(tangent)).copied().unwrap_or(row)
    }

    /// Appends contacts to a list of rows, each followed by its tangential rows.
    pub(crate) fn expand(&self, contacts: impl Iterator<Item = usize>, rows: &mut Vec<usize>) {
        match self.is_empty() {
            true => rows.extend(contacts),
            false => contacts.for_each(|contact| {
                rows.push(contact);
                rows.extend(self.of(contact));
            }),
        }
    }

    /// Rotates values of the tangential rows with their contacts, from the tangents of `from` to the tangents of
    /// `to`.
    ///
    /// With C = T Fᵀ, T and F the tangential rows of a contact in `to` and `from`, the values are multiplied by the
    /// orthogonal factor of the polar decomposition of C. It is the least rotation from one tangential plane to the
    /// other, for any choice of the tangents in each plane.
    pub(crate) fn turn<T: Real>(&self, [from, to]: [&ContactJacobian<T>; 2], values: &mut [T]) {
        if std::ptr::eq(from, to) {
            return;
        }
        for contact in 0..self.friction.len() {
            let rows = self.of(contact);
            let dot = |i: usize, j: usize| to.dot(rows.start + i, (from, rows.start + j));
            let place = rows.start - self.contacts.min(rows.start);
            match rows.len() {
                1 if dot(0, 0) < T::zero() => values[place] = -values[place],
                2 => {
                    let ([a, b], [c, d]) = ([dot(0, 0), dot(0, 1)], [dot(1, 0), dot(1, 1)]);
                    // C + sgn(det C) cof C is the orthogonal factor times the sum of the singular values.
                    let sign = if a * d - b * c < T::zero() { -T::one() } else { T::one() };
                    let ([a, b], [c, d]) = ([a + sign * d, b - sign * c], [c - sign * b, d + sign * a]);
                    let size = a.hypot(b);
                    let [x, y] = [values[place], values[place + 1]];
                    if size > T::zero() {
                        (values[place], values[place + 1]) = ((a * x + b * y) / size, (c * x + d * y) / size);
                    }
                }
                _ => {}
            }
        }
    }

    /// Whether contacts have the same numbers of rows in another list.
    pub(crate) fn has_rows_of(&self, other: &Self) -> bool {
        self.first == other.first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_friction_stand_behind_those_of_the_gaps() {
        let mut tangents = Tangents::default();
        assert!(tangents.is_empty() && tangents.of(3).is_empty() && tangents.friction(3) == 0.0);
        tangents.begin(3);
        for (friction, rows) in [(0.5, 2), (0.0, 0), (0.2, 1)] {
            tangents.push(friction, rows);
        }
        assert_eq!([0, 1, 2].map(|contact| tangents.of(contact)), [3..5, 5..5, 5..6]);
        assert_eq!((tangents.all(), tangents.owner(4), tangents.owner(5)), (3..6, 0, 2));
        assert_eq!(tangents.owner(2), 2);
        assert_eq!(tangents.contacts().collect::<Vec<_>>(), [0, 2]);
        let mut rows = Vec::new();
        tangents.expand([0, 2].into_iter(), &mut rows);
        assert_eq!(rows, [0, 3, 4, 2, 5]);
    }

    /// A node with tangents turned by any angle, mirrored or not: the vector is the same, also if the plane tilts by
    /// 0.1.
    #[test]
    fn entries_turn_with_their_tangents() {
        let mut tangents = Tangents::default();
        tangents.begin(1);
        tangents.push(0.3, 2);
        let rows = |[x, y]: [[f64; 3]; 2]| {
            let mut g = ContactJacobian::default();
            for row in [[0.0, 0.0, 1.0], x, y] {
                g.push_entries((0..3).map(|k| (k, row[k])));
            }
            g
        };
        let from = rows([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        for lean in [0.0_f64, 0.1] {
            for step in 0..12 {
                let (sin, cos) = (0.5 * f64::from(step)).sin_cos();
                for mirror in [1.0, -1.0] {
                    // The plane tilts about x.
                    let leaning = |[x, y]: [f64; 2]| [x, lean.cos() * y, lean.sin() * y];
                    let to = rows([leaning([cos, sin]), leaning([-mirror * sin, mirror * cos])]);
                    let mut values = [3.0, 4.0];
                    tangents.turn([&from, &to], &mut values);
                    let exact = [3.0 * cos + 4.0 * sin, mirror * (4.0 * cos - 3.0 * sin)];
                    assert!(values.iter().zip(exact).all(|(x, y)| (x - y).abs() < 1e-14), "{values:?} {exact:?}");
                }
            }
        }
    }
}
