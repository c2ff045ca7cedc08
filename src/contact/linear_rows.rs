//! Contact rows with constant G: gap = G u + g0(t).

use super::dofs::DofList;
use super::obstacle::{across, unit};
use super::{Candidates, ContactConstraint, ContactJacobian, ContactLaw, Contacts, GapRates, Rates, Variation};
use crate::error::{Error, Result, positive};
use crate::real::Real;
use faer::sparse::SparseRowMatRef;
use std::ops::Range;

type OffsetFunction<'a, T> = Box<dyn FnMut(f64) -> [T; 3] + Send + 'a>;
type Drag<'a, T> = Box<dyn FnMut(f64) -> [[T; 2]; 2] + Send + 'a>;

/// The (dof, weight) pairs of a row without other data, and its law.
pub(crate) type PlainRow<T> = (Vec<(usize, T)>, ContactLaw);

/// A row besides its weights.
struct Row<'a, T> {
    law: ContactLaw,
    offset: GapOffset<'a, T>,
    bond: Option<Bond>,
    friction: Option<Friction<'a, T>>,
}

struct Friction<'a, T> {
    coefficient: f64,
    /// Rows of `LinearRows::tangents`.
    tangents: Range<usize>,
    drag: Option<Drag<'a, T>>,
}

/// A bonded row holds in both directions until its tension exceeds its strength.
struct Bond {
    strength: f64,
    is_broken: bool,
}

impl<T> Row<'_, T> {
    /// Whether a bond of the row holds.
    fn is_bonded(&self) -> bool {
        self.bond.as_ref().is_some_and(|bond| !bond.is_broken)
    }
}

impl<T: Real> std::fmt::Debug for Row<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Row").field("law", &self.law).field("offset", &self.offset).finish_non_exhaustive()
    }
}

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
/// [`friction`](Self::friction) gives them tangents.
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
    /// Dofs are places in the list.
    jacobian: ContactJacobian<T>,
    rows: Vec<Row<'a, T>>,
    /// Dofs are places in the list.
    tangents: ContactJacobian<T>,
    coordinates: T,
    /// Whether the given numbers have been checked.
    checked: bool,
}

impl<T: Real> Default for LinearRows<'_, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'a, T: Real> LinearRows<'a, T> {
    /// A constraint without rows.
    pub fn new() -> Self {
        let (jacobian, tangents) = (ContactJacobian::default(), ContactJacobian::default());
        Self { dofs: DofList::default(), jacobian, rows: Vec::new(), tangents, coordinates: T::zero(), checked: false }
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

    /// Adds a row with `G u + g0 = 0` until its tension exceeds `strength` (force), which is checked after each step;
    /// then it is unilateral. [`friction`](Self::friction) acts once it is broken.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
    ///
    /// // A mass that is glued to a wall is pulled with a force that grows by 10 a second.
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
    /// let mass = LinearSystem::lumped(vec![1.0], free)?.load(|t, f| f[0] = 10.0 * t);
    /// let mut run = Simulation::builder(mass, GeneralizedAlpha::default(), 0.01)
    ///     .constraint(LinearRows::new().bond(4.999, &[(0, 1.0)], 0.0))
    ///     .build()?;
    /// run.run_until(1.0, &mut ())?;
    /// let broken = run.state().broken_bonds()[0];
    /// assert!((broken.time - 0.5).abs() < 0.011 && broken.load >= 1.0);
    /// assert!(run.state().velocity()[0] > 3.69); // 5 (1 − 0.5²), less a step
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn bond(self, strength: f64, entries: &[(usize, T)], offset: impl Into<GapOffset<'a, T>>) -> Self {
        let mut rows = self.row(ContactLaw::Equality, entries, offset);
        rows.rows.last_mut().into_iter().for_each(|row| row.bond = Some(Bond { strength, is_broken: false }));
        rows
    }

    /// Adds the contact of a pair of nodes along a fixed normal, from the first to the second: g = n · (u_b − u_a) +
    /// g0.
    ///
    /// The normal may have any length, as for a [`Plane`](super::Plane): it is normalized, so that gaps are lengths
    /// and multipliers are forces. Nothing acts along the tangents.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the normal is zero, [`Error::NotFinite`].
    ///
    /// ```
    /// use contact_dynamics::{ContactConstraint, ContactLaw, LinearRows};
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
        Ok(self.row(law, &apart(first, second, normal), offset))
    }

    /// Adds the contact of a [`pair`](Self::pair) with friction: along one direction in the plane, two in space.
    ///
    /// # Errors
    ///
    /// As of `pair`.
    pub fn pair_with_friction<const D: usize>(
        self,
        (law, friction): (ContactLaw, f64),
        first: [usize; D],
        second: [usize; D],
        normal: [T; D],
        offset: impl Into<GapOffset<'a, T>>,
    ) -> Result<Self> {
        let tangents = across(unit("the normal of a pair of nodes", normal)?).map(|t| apart(first, second, t));
        let tangents: Vec<_> = tangents.iter().map(|tangent| &tangent[..]).take(D.saturating_sub(1)).collect();
        Ok(self.pair(law, first, second, normal, offset)?.friction(friction, &tangents))
    }

    /// Adds a row under any law.
    #[must_use]
    pub fn row(mut self, law: ContactLaw, entries: &[(usize, T)], offset: impl Into<GapOffset<'a, T>>) -> Self {
        let entries = entries.iter().map(|&(dof, weight)| (self.dofs.place(dof), weight));
        self.jacobian.push_entries(entries);
        self.rows.push(Row { law, offset: offset.into(), bond: None, friction: None });
        self.checked = false;
        self
    }

    /// Sets friction for the last row: the coefficient μ ≥ 0, and the tangential rows as (dof, weight) pairs: one in
    /// the plane, two along orthonormal directions in space. Slip is their product with the velocities. Without a row
    /// it does nothing.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
    ///
    /// // A block of mass 2 on a floor (dofs x, y), thrown along it with speed 1; g = 10, μ = 0.25.
    /// let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    /// let block = LinearSystem::lumped(vec![2.0; 2], free)?.load(|_, f| f[1] = -20.0);
    /// let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.25, &[&[(0, 1.0)]]);
    /// let mut run = Simulation::builder(block, GeneralizedAlpha::default(), 0.01)
    ///     .velocity(vec![1.0, 0.0])
    ///     .constraint(floor)
    ///     .build()?;
    /// run.run_until(0.2, &mut ())?;
    /// assert!((run.state().velocity()[0] - 0.5).abs() < 1e-12);
    /// assert!((run.state().contacts().friction_forces(0)[0] + 5.0).abs() < 1e-12);
    /// run.run_until(1.0, &mut ())?;
    /// assert!((run.state().displacement()[0] - 0.2).abs() < 1e-12); // v²/(2 μ g)
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn friction(mut self, coefficient: f64, tangents: &[&[(usize, T)]]) -> Self {
        let Some(row) = self.rows.last_mut() else { return self };
        let first = self.tangents.rows();
        for entries in tangents {
            let entries = entries.iter().map(|&(dof, weight)| (self.dofs.place(dof), weight));
            self.tangents.push_entries(entries);
        }
        row.friction = Some(Friction { coefficient, tangents: first..self.tangents.rows(), drag: None });
        self.checked = false;
        self
    }

    /// Moves the obstacle of the last row along its tangents, as a belt: the closure returns its velocities along
    /// them at t, and its accelerations. Without [`friction`](Self::friction) of that row it does nothing.
    #[must_use]
    pub fn dragging(mut self, drag: impl FnMut(f64) -> [[T; 2]; 2] + Send + 'a) -> Self {
        if let Some(friction) = self.rows.last_mut().and_then(|row| row.friction.as_mut()) {
            friction.drag = Some(Box::new(drag));
        }
        self
    }

    /// Sets the magnitude of the coordinates from which the host has computed the gaps (length), for all rows: gaps
    /// within their rounding are zero. The default is zero, for exact gaps.
    #[must_use]
    pub fn coordinates(mut self, size: T) -> Self {
        self.coordinates = size.abs();
        self
    }

    /// Rejects numbers out of range.
    fn check(&self) -> Result<()> {
        for bond in self.rows.iter().filter_map(|row| row.bond.as_ref()) {
            positive("the strength of a bond", bond.strength)?;
        }
        let weights = &self.jacobian.weights;
        if let Some(index) = weights.iter().position(|weight| !weight.is_finite()) {
            let value = weights[index].value();
            return Err(Error::NotFinite { what: "the weights of the contact rows", index, value });
        }
        for (index, row) in self.rows.iter().enumerate() {
            match row.offset {
                GapOffset::Constant(gap) if !gap.is_finite() => {
                    return Err(Error::NotFinite { what: "the gaps of the contact rows", index, value: gap.value() });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The rows, if all of them are rigid or equality rows without other data.
    pub(crate) fn plain(&self) -> Result<Vec<PlainRow<T>>> {
        self.check()?;
        let refused = |reason| Err(Error::Incompatible { part: "the contact rows".into(), reason });
        if self.rows.iter().any(|row| row.friction.is_some()) {
            return refused("exact propagation knows no friction; take a scheme");
        }
        if self.rows.iter().any(|row| row.bond.is_some()) {
            return refused("exact propagation knows no bonds; take a scheme");
        }
        if !self.rows.iter().all(|row| row.law.is_plain()) {
            return refused("exact propagation knows rigid and equality rows; take a scheme for other laws");
        }
        let dofs = self.dofs.as_slice();
        let entries = |row| self.jacobian.row(row).map(|(place, weight)| (dofs[place], weight)).collect();
        Ok(self.rows.iter().enumerate().map(|(index, row)| (entries(index), row.law)).collect())
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

/// The row of a distance along a direction from one node to another.
fn apart<T: Real, const D: usize>(first: [usize; D], second: [usize; D], direction: [T; D]) -> Vec<(usize, T)> {
    let from = first.into_iter().zip(direction.map(|n| -n));
    from.chain(second.into_iter().zip(direction)).collect()
}

impl<T: Real> ContactConstraint<T> for LinearRows<'_, T> {
    fn dofs(&self) -> &[usize] {
        self.dofs.as_slice()
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        for (index, row) in self.rows.iter().enumerate() {
            let is_broken = row.bond.is_some() && !row.is_bonded();
            let law = if is_broken { ContactLaw::Rigid } else { row.law };
            let mut contact = contacts.push_row((index, 0), law, (&self.jacobian, index));
            contact.magnitude(self.coordinates);
            if let Some(friction) = row.friction.as_ref().filter(|_| !row.is_bonded()) {
                contact.friction(friction.coefficient);
                for tangent in friction.tangents.clone() {
                    contact.tangent_row((&self.tangents, tangent));
                }
            }
        }
    }

    fn search(&mut self, _t: f64, _u: &[T], _v: &[T], _ahead: f64) -> Result<Candidates> {
        if !std::mem::replace(&mut self.checked, true) {
            self.check()?;
        }
        Ok(Candidates::Unchanged)
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        for (index, (row, gap)) in self.rows.iter_mut().zip(gaps).enumerate() {
            let g0 = match &mut row.offset {
                GapOffset::Constant(g0) => *g0,
                GapOffset::Moving(f) => f(t)[0],
            };
            *gap = self.jacobian.product(index, u) + g0;
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, _u: &[T], _v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        if self.rows.iter().all(|row| matches!(row.offset, GapOffset::Constant(_))) {
            return Ok(Rates::Zero);
        }
        for (row, rates) in self.rows.iter_mut().zip(rates) {
            *rates = match &mut row.offset {
                GapOffset::Constant(_) => GapRates::default(),
                GapOffset::Moving(f) => {
                    let [_, rate, acceleration] = f(t);
                    GapRates { rate, acceleration }
                }
            };
        }
        Ok(Rates::Given)
    }

    fn slip_rates(&mut self, t: f64, _u: &[T], _v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let drags = |row: &Row<'_, T>| row.friction.as_ref().is_some_and(|friction| friction.drag.is_some());
        if !self.rows.iter().any(drags) {
            return Ok(Rates::Zero);
        }
        let mut rates = rates.iter_mut();
        for friction in self.rows.iter_mut().filter(|row| !row.is_bonded()).filter_map(|row| row.friction.as_mut()) {
            let drag = friction.drag.as_mut().map_or([[T::zero(); 2]; 2], |drag| drag(t));
            for (rates, dragged) in rates.by_ref().take(friction.tangents.len()).zip(GapRates::dragged(drag)) {
                *rates = dragged;
            }
        }
        Ok(Rates::Given)
    }

    /// Gaps are affine, so that a node cannot pass through undetected.
    fn inspects(&self) -> bool {
        false
    }

    fn overloads(&self, forces: &[T], broken: &mut Vec<(usize, f64)>) {
        for (index, (row, force)) in self.rows.iter().zip(forces).enumerate() {
            let load =
                row.bond.as_ref().filter(|bond| !bond.is_broken).map_or(0.0, |bond| -force.value() / bond.strength);
            if load >= 1.0 {
                broken.push((index, load));
            }
        }
    }

    fn set_broken(&mut self, features: &[usize]) {
        for (index, row) in self.rows.iter_mut().enumerate() {
            row.bond.iter_mut().for_each(|bond| bond.is_broken = features.binary_search(&index).is_ok());
        }
    }

    fn variation(&self) -> Variation {
        // A broken bond has another law, and may have friction.
        if self.rows.iter().any(|row| row.bond.is_some()) { Variation::BySearch } else { Variation::Never }
    }
}
