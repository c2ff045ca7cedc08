//! Contact rows with constant G: gap = G u + g0(t).

use super::dofs::DofList;
use super::obstacle::unit;
use super::{Candidates, ContactConstraint, ContactJacobian, ContactLaw, Contacts, GapRates, Rates, Variation};
use crate::error::{Error, Result};
use crate::real::Real;
use faer::sparse::SparseRowMatRef;

type OffsetFunction<'a, T> = Box<dyn FnMut(f64) -> [T; 3] + Send + 'a>;

/// The part g0 of a gap that does not depend on u: constant, or a function of time with its first two derivatives.
pub enum GapOffset<'a, T> {
    /// A constant initial gap (length).
    Constant(T),
    /// g0, ġ0, g̈0 at t; a moving obstacle, or an imposed approach.
    Moving(OffsetFunction<'a, T>),
}

impl<T: Real> std::fmt::Debug for GapOffset<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Constant(gap) => f.debug_tuple("Constant").field(gap).finish(),
            Self::Moving(_) => f.write_str("Moving"),
        }
    }
}

impl<'a, T> GapOffset<'a, T> {
    /// An offset that moves: the closure returns g0, ġ0, g̈0 at t.
    pub fn moving(offset: impl FnMut(f64) -> [T; 3] + Send + 'a) -> Self {
        Self::Moving(Box::new(offset))
    }
}

impl<T: Real> From<T> for GapOffset<'_, T> {
    fn from(gap: T) -> Self {
        Self::Constant(gap)
    }
}

/// Any number of rows `g = G u + g0(t)` with constant G. Rows are identified by their order: (row, 0).
///
/// ```
/// use contact_dynamics::LinearRows;
/// use contact_dynamics::contact::GapOffset;
///
/// let contact = LinearRows::new()
///     // Dof 4 of the left body pushes dof 5 of the right one; 0.01 apart at u = 0.
///     .unilateral(&[(4, -1.0), (5, 1.0)], 0.01)
///     // Dof 9 above a table that rises with speed 0.1.
///     .unilateral(&[(9, 1.0)], GapOffset::moving(|t| [0.5 - 0.1 * t, -0.1, 0.0]))
///     // Dofs 0 and 7 tied.
///     .equality(&[(0, 1.0), (7, -1.0)], 0.0);
/// assert_eq!(contact.len(), 3);
/// ```
#[derive(Debug)]
pub struct LinearRows<'a, T: Real> {
    dofs: DofList,
    /// In places of the list.
    jacobian: ContactJacobian<T>,
    laws: Vec<ContactLaw>,
    offsets: Vec<GapOffset<'a, T>>,
    coordinates: T,
    /// Whether the numbers given have been looked at.
    checked: bool,
}

impl<T: Real> Default for LinearRows<'_, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'a, T: Real> LinearRows<'a, T> {
    /// No rows yet.
    pub fn new() -> Self {
        let (dofs, jacobian) = (DofList::default(), ContactJacobian::default());
        Self { dofs, jacobian, laws: Vec::new(), offsets: Vec::new(), coordinates: T::zero(), checked: false }
    }

    /// One unilateral row for each row of `g`, with the initial gaps `gaps`.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the number of gaps is not the number of rows.
    pub fn from_matrix(g: SparseRowMatRef<'_, usize, T>, gaps: &[T]) -> Result<Self> {
        if gaps.len() != g.nrows() {
            return Err(Error::Dimension { what: "the vector of gaps", expected: g.nrows(), found: gaps.len() });
        }
        Ok(gaps.iter().enumerate().fold(Self::new(), |rows, (i, &gap)| {
            let columns = g.col_idx_of_row_raw(i).iter().copied();
            let entries: Vec<_> = columns.zip(g.val_of_row(i).iter().copied()).collect();
            rows.unilateral(&entries, gap)
        }))
    }

    /// Adds a row with `G u + g0 ≥ 0`, given by its (dof, weight) pairs.
    #[must_use]
    pub fn unilateral(self, entries: &[(usize, T)], offset: impl Into<GapOffset<'a, T>>) -> Self {
        self.row(ContactLaw::Rigid, entries, offset)
    }

    /// Adds a row with `G u + g0 = 0`.
    #[must_use]
    pub fn equality(self, entries: &[(usize, T)], offset: impl Into<GapOffset<'a, T>>) -> Self {
        self.row(ContactLaw::Equality, entries, offset)
    }

    /// Adds the contact of a pair of nodes along a fixed normal, from the first to the second: g = n · (u_b − u_a) +
    /// g0.
    ///
    /// The normal has any length, as that of a [`Plane`](super::Plane): gaps are lengths, forces are forces. Where the
    /// pair is free to slide nothing else acts on it.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the normal is zero, [`Error::NotFinite`].
    ///
    /// ```
    /// use contact_dynamics::contact::{ContactConstraint, ContactLaw, LinearRows};
    /// let (lower, upper) = ([0, 1], [2, 3]); // x and y dofs
    /// let mut contact = LinearRows::new().pair(ContactLaw::Rigid, lower, upper, [3.0, 4.0], 0.1)?;
    /// let mut gap = [0.0_f64];
    /// contact.gaps(0.0, &[0.0, 0.0, 0.0, -0.1], &mut gap)?;
    /// assert!((gap[0] - 0.02).abs() < 1e-15);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    pub fn pair<const D: usize>(
        self,
        law: ContactLaw,
        first: [usize; D],
        second: [usize; D],
        normal: [T; D],
        offset: impl Into<GapOffset<'a, T>>,
    ) -> Result<Self> {
        let normal = unit("the normal of a pair of nodes", normal)?;
        let from = first.into_iter().zip(normal.map(|n| -n));
        let entries: Vec<_> = from.chain(second.into_iter().zip(normal)).collect();
        Ok(self.row(law, &entries, offset))
    }

    /// Adds a row under any law.
    #[must_use]
    pub fn row(mut self, law: ContactLaw, entries: &[(usize, T)], offset: impl Into<GapOffset<'a, T>>) -> Self {
        let entries = entries.iter().map(|&(dof, weight)| (self.dofs.place(dof), weight));
        self.jacobian.push_entries(entries);
        self.laws.push(law);
        self.offsets.push(offset.into());
        self.checked = false;
        self
    }

    /// The size of the coordinates from which the host has computed the gaps (length), for all rows: gaps within their
    /// rounding are zero. Zero by default, as if the gaps were exact.
    #[must_use]
    pub fn coordinates(mut self, size: T) -> Self {
        self.coordinates = size.abs();
        self
    }

    /// Refuses numbers that are none.
    fn check(&self) -> Result<()> {
        let weights = &self.jacobian.weights;
        if let Some(index) = weights.iter().position(|weight| !weight.is_finite()) {
            let value = weights[index].value();
            return Err(Error::NotFinite { what: "the weights of the contact rows", index, value });
        }
        for (index, offset) in self.offsets.iter().enumerate() {
            match offset {
                GapOffset::Constant(gap) if !gap.is_finite() => {
                    return Err(Error::NotFinite { what: "the gaps of the contact rows", index, value: gap.value() });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.laws.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.laws.is_empty()
    }
}

impl<T: Real> ContactConstraint<T> for LinearRows<'_, T> {
    fn dofs(&self) -> &[usize] {
        self.dofs.as_slice()
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        for (row, &law) in self.laws.iter().enumerate() {
            contacts.push_row((row, 0), law, (&self.jacobian, row)).magnitude(self.coordinates);
        }
    }

    fn search(&mut self, _t: f64, _u: &[T], _v: &[T], _ahead: f64) -> Result<Candidates> {
        if !std::mem::replace(&mut self.checked, true) {
            self.check()?;
        }
        Ok(Candidates::Unchanged)
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        for (row, (offset, gap)) in self.offsets.iter_mut().zip(gaps).enumerate() {
            let g0 = match offset {
                GapOffset::Constant(g0) => *g0,
                GapOffset::Moving(f) => f(t)[0],
            };
            *gap = self.jacobian.product(row, u) + g0;
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, _u: &[T], _v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        if self.offsets.iter().all(|offset| matches!(offset, GapOffset::Constant(_))) {
            return Ok(Rates::Zero);
        }
        for (offset, rates) in self.offsets.iter_mut().zip(rates) {
            *rates = match offset {
                GapOffset::Constant(_) => GapRates::default(),
                GapOffset::Moving(f) => {
                    let [_, rate, acceleration] = f(t);
                    GapRates { rate, acceleration }
                }
            };
        }
        Ok(Rates::Given)
    }

    /// What passes through an obstacle is never behind it: gaps are affine.
    fn inspects(&self) -> bool {
        false
    }

    fn variation(&self) -> Variation {
        Variation::Never
    }
}
