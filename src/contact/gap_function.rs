//! Gaps that are any function of some displacements.

use super::dofs::DofList;
use super::{Candidates, ContactConstraint, ContactId, ContactLaw, Contacts, GapRates, Rates, check_local};
use crate::error::{Error, Result, positive};
use crate::real::Real;

type Function<'a, T> = Box<dyn FnMut(f64, &[T], &[T], &mut [T]) -> Result<[T; 3]> + Send + 'a>;

type Tangents<'a, T> = Box<dyn FnMut(f64, &[T], &mut [T]) -> [[T; 2]; 2] + Send + 'a>;

struct Friction<'a, T> {
    coefficient: f64,
    function: Tangents<'a, T>,
    /// For each tangent the places of the dofs and their weights, at the point of linearization.
    rows: Vec<Vec<(usize, T)>>,
}

/// A row and its point of linearization.
struct Row<'a, T> {
    function: Function<'a, T>,
    /// The places of the dofs and the gradient there.
    entries: Vec<(usize, T)>,
    place: Vec<T>,
    /// Whether the gradient there is not finite: then the gap is NaN.
    broken: bool,
    friction: Option<Friction<'a, T>>,
}

/// Any number of rows `g(t, x) ≥ 0`, each a smooth function of the displacements x of some dofs.
///
/// The function is called with t, x, the velocities v of the same dofs, and a slice for the gradient ∂g/∂x, all in
/// the order of the dofs. It writes the whole gradient and returns
///
/// * the gap g (length),
/// * its rate ∂g/∂t at fixed x (length/time), zero if nothing but x moves it,
/// * its acceleration d²/ds² g(t + s, x + s v) at s = 0 (length/time²): vᵀ H v with the second derivatives H of g, and
///   2 v · ∂²g/∂t∂x + ∂²g/∂t² if it depends on t.
///
/// It must be pure. If only the gap is needed, v is zero. The acceleration may be returned as zero, at a loss of
/// accuracy of the correctors: [`verify::gap_jacobian`](crate::verify::gap_jacobian) compares gradient, rate and
/// acceleration with differences.
///
/// Rows follow the contact of a step to its end. A gap or a gradient that is NaN fails the step
/// ([`Error::ContactNotFinite`], and a smaller step helps). For a function with other errors use
/// [`fallible`](Self::fallible). Rows are identified by their order: (row, 0).
///
/// ```
/// use contact_dynamics::contact::GapFunction;
/// use contact_dynamics::ContactConstraint;
///
/// // The end of a rod (dofs 6 and 7, at (0, 1) in the beginning) stays above the parabola y = x²/4.
/// let parabola = |_: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| {
///     gradient.copy_from_slice(&[-0.5 * x[0], 1.0]);
///     [1.0 + x[1] - 0.25 * x[0] * x[0], 0.0, -0.5 * v[0] * v[0]]
/// };
/// // Two particles on a line, 0.5 apart in the beginning, are tethered: at most 2 apart.
/// let tether = |_: f64, x: &[f64], _: &[f64], gradient: &mut [f64]| {
///     let apart = 0.5 + x[1] - x[0];
///     gradient.copy_from_slice(&[apart.signum(), -apart.signum()]);
///     [2.0 - apart.abs(), 0.0, 0.0]
/// };
/// let mut contact = GapFunction::new(&[6, 7], parabola).and(&[0, 2], tether);
///
/// // Displacements of the dofs in the order in which they are named: 6, 7, 0, 2.
/// let (u, mut gaps) = ([2.0, 0.0, 0.0, 0.0], [0.0; 2]);
/// contact.search(0.0, &u, &[0.0; 4], 0.0)?;
/// contact.gaps(0.0, &u, &mut gaps)?;
/// assert_eq!(gaps, [0.0, 1.5]);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
///
/// Two balls in the plane whose centers stay at least 1 apart, checked as hosts should:
///
/// ```
/// use contact_dynamics::contact::GapFunction;
/// use contact_dynamics::verify;
///
/// let places = [0.0, 0.0, 1.2, 0.9];
/// let balls = move |_: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| {
///     let r = [0, 1].map(|i| places[2 + i] + x[2 + i] - places[i] - x[i]);
///     let w = [0, 1].map(|i| v[2 + i] - v[i]);
///     let distance = r[0].hypot(r[1]);
///     let n = r.map(|r| r / distance);
///     gradient.copy_from_slice(&[-n[0], -n[1], n[0], n[1]]);
///     let across = n[0] * w[1] - n[1] * w[0];
///     [distance - 1.0, 0.0, across * across / distance]
/// };
/// let mut contact = GapFunction::new(&[0, 1, 2, 3], balls).scale(1.0)?;
/// let (u, v) = ([0.1, 0.0, 0.0, -0.2], [1.0, 0.0, 0.0, -0.5]);
/// let error = verify::gap_jacobian(&mut contact, 0.0, &u, &v, 1e-6)?;
/// assert!(error.rows == 1 && error.jacobian < 1e-8 && error.acceleration < 1e-5, "{error:?}");
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub struct GapFunction<'a, T: Real> {
    dofs: DofList,
    rows: Vec<Row<'a, T>>,
    law: ContactLaw,
    scale: T,
    /// Number of linearized rows: all of them, or zero before the first search.
    candidates: usize,
    /// Displacements, velocities and gradient of a row.
    buffers: [Vec<T>; 3],
}

impl<T: Real> std::fmt::Debug for GapFunction<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GapFunction").field("rows", &self.rows.len()).field("law", &self.law).finish_non_exhaustive()
    }
}

impl<'a, T: Real> GapFunction<'a, T> {
    /// A constraint with one row, a function of the displacements of these dofs.
    pub fn new(dofs: &[usize], mut function: impl FnMut(f64, &[T], &[T], &mut [T]) -> [T; 3] + Send + 'a) -> Self {
        Self::fallible(dofs, move |t, x, v, gradient| Ok(function(t, x, v, gradient)))
    }

    /// As [`new`](Self::new), with a function that may fail, for instance with [`Error::Host`]: the step fails with
    /// its error.
    pub fn fallible(
        dofs: &[usize],
        function: impl FnMut(f64, &[T], &[T], &mut [T]) -> Result<[T; 3]> + Send + 'a,
    ) -> Self {
        let (law, buffers) = (ContactLaw::Rigid, [const { Vec::new() }; 3]);
        let list = DofList::default();
        Self { dofs: list, rows: Vec::new(), law, scale: T::zero(), candidates: 0, buffers }
            .and_fallible(dofs, function)
    }

    /// Adds a row.
    #[must_use]
    pub fn and(
        self,
        dofs: &[usize],
        mut function: impl FnMut(f64, &[T], &[T], &mut [T]) -> [T; 3] + Send + 'a,
    ) -> Self {
        self.and_fallible(dofs, move |t, x, v, gradient| Ok(function(t, x, v, gradient)))
    }

    /// Adds a row with a function that may fail.
    #[must_use]
    pub fn and_fallible(
        mut self,
        dofs: &[usize],
        function: impl FnMut(f64, &[T], &[T], &mut [T]) -> Result<[T; 3]> + Send + 'a,
    ) -> Self {
        let entries = dofs.iter().map(|&dof| (self.dofs.place(dof), T::zero())).collect();
        let place = vec![T::zero(); dofs.len()];
        self.rows.push(Row { function: Box::new(function), entries, place, broken: false, friction: None });
        for buffer in &mut self.buffers {
            buffer.resize(buffer.len().max(dofs.len()), T::zero());
        }
        self.candidates = 0;
        self
    }

    /// Sets friction for the last row: the coefficient μ ≥ 0, and a function for the tangential rows, of which there
    /// are `tangents`: one in the plane, two orthonormal ones in space. The function is called with t, the
    /// displacements of the dofs of the row, and a slice for the weights of the tangents, one tangent after the
    /// other. The product of the weights with the velocities of the dofs is the slip. The function returns the
    /// velocities of the obstacle along the tangents and its accelerations, zero for an obstacle at rest.
    ///
    /// ```
    /// use contact_dynamics::ContactConstraint;
    /// use contact_dynamics::contact::{Contacts, GapFunction};
    ///
    /// // A bead outside of the unit circle, which turns with 3 rad/s.
    /// let circle = |_: f64, x: &[f64], _: &[f64], gradient: &mut [f64]| {
    ///     let r = x[0].hypot(x[1]);
    ///     gradient.copy_from_slice(&[x[0] / r, x[1] / r]);
    ///     [r - 1.0, 0.0, 0.0]
    /// };
    /// let along = |_: f64, x: &[f64], tangent: &mut [f64]| {
    ///     let r = x[0].hypot(x[1]);
    ///     tangent.copy_from_slice(&[-x[1] / r, x[0] / r]);
    ///     [[3.0, 0.0], [0.0; 2]]
    /// };
    /// let mut contact = GapFunction::new(&[0, 1], circle).friction(0.4, 1, along);
    /// contact.search(0.0, &[0.0, 2.0], &[0.0; 2], 0.0)?;
    /// assert_eq!(Contacts::of(&contact).tangents(0), [[(0, -1.0), (1, 0.0)]]);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    #[must_use]
    pub fn friction(
        mut self,
        coefficient: f64,
        tangents: usize,
        function: impl FnMut(f64, &[T], &mut [T]) -> [[T; 2]; 2] + Send + 'a,
    ) -> Self {
        if let Some(row) = self.rows.last_mut() {
            let rows = vec![row.entries.clone(); tangents.min(3)];
            let size = row.entries.len() * rows.len();
            row.friction = Some(Friction { coefficient, function: Box::new(function), rows });
            for buffer in &mut self.buffers {
                buffer.resize(buffer.len().max(size), T::zero());
            }
        }
        self
    }

    /// Sets the law of all rows; [`ContactLaw::Rigid`] by default.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Sets the magnitude of the coordinates (length) used in the functions: gaps within its rounding are zero. The
    /// default is zero; then the gap of a row that touches at the start must be exactly zero or positive.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn scale(mut self, scale: T) -> Result<Self> {
        positive("the scale of a gap function", scale.value())?;
        self.scale = scale;
        Ok(self)
    }

    /// Linearizes all rows at u; returns whether a gradient changed.
    fn linearize(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        check_local(u.len(), self.dofs.as_slice().len())?;
        let Self { rows, buffers: [all, still, gradient], .. } = self;
        still.fill(T::zero());
        let mut found = Candidates::Unchanged;
        for Row { function, entries, place, broken, friction } in rows {
            for (x, &(dof, _)) in place.iter_mut().zip(&*entries) {
                *x = u[dof];
            }
            let gradient = &mut gradient[..entries.len()];
            // An entry that the function does not write must not keep the value of another row.
            gradient.fill(T::nan());
            function(t, place, &still[..place.len()], gradient)?;
            // Without a finite gradient the row stays, and reports a NaN gap.
            *broken = !gradient.iter().all(|x| x.is_finite());
            if *broken {
                continue;
            }
            for ((_, old), &mut new) in entries.iter_mut().zip(gradient) {
                if *old != new {
                    (*old, found) = (new, Candidates::Changed);
                }
            }
            let Some(Friction { function, rows, .. }) = friction else { continue };
            let weights = &mut all[..entries.len() * rows.len()];
            weights.fill(T::nan());
            function(t, place, weights);
            for ((_, old), &mut new) in rows.iter_mut().flatten().zip(weights) {
                // Weights that are not finite are rejected where rows are read.
                if *old != new {
                    (*old, found) = (new, Candidates::Changed);
                }
            }
        }
        Ok(found)
    }
}

impl<T: Real> ContactConstraint<T> for GapFunction<'_, T> {
    fn dofs(&self) -> &[usize] {
        self.dofs.as_slice()
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        for (row, Row { entries, friction, .. }) in self.rows[..self.candidates].iter().enumerate() {
            let mut contact = contacts.push((row, 0), self.law, entries);
            contact.magnitude(self.scale);
            if let Some(Friction { coefficient, rows, .. }) = friction {
                contact.friction(*coefficient);
                for tangent in rows {
                    contact.tangent(tangent);
                }
            }
        }
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        let Self { rows, buffers: [_, still, gradient], candidates, .. } = self;
        still.fill(T::zero());
        for (Row { function, entries, place, broken, .. }, out) in rows[..*candidates].iter_mut().zip(gaps) {
            let [gap, ..] = function(t, place, &still[..place.len()], &mut gradient[..place.len()])?;
            let moved = entries.iter().zip(&*place).map(|(&(dof, weight), &x)| weight * (u[dof] - x));
            *out = if *broken { T::nan() } else { gap + moved.sum() };
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let Self { rows, buffers: [x, w, gradient], candidates, .. } = self;
        for (Row { function, entries, .. }, out) in rows[..*candidates].iter_mut().zip(rates) {
            let (x, w) = (&mut x[..entries.len()], &mut w[..entries.len()]);
            for ((x, w), &(dof, _)) in x.iter_mut().zip(w.iter_mut()).zip(&*entries) {
                (*x, *w) = (u[dof], v[dof]);
            }
            let [_, rate, acceleration] = function(t, x, w, &mut gradient[..entries.len()])?;
            *out = GapRates { rate, acceleration };
        }
        Ok(Rates::Given)
    }

    fn slip_rates(&mut self, t: f64, u: &[T], _v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let Self { rows, buffers: [x, _, weights], candidates, .. } = self;
        let mut rates = rates.iter_mut();
        for Row { entries, friction, .. } in &mut rows[..*candidates] {
            let Some(Friction { function, rows, .. }) = friction else { continue };
            let x = &mut x[..entries.len()];
            for (x, &(dof, _)) in x.iter_mut().zip(&*entries) {
                *x = u[dof];
            }
            let drag = function(t, x, &mut weights[..entries.len() * rows.len()]);
            for (rates, dragged) in rates.by_ref().take(rows.len()).zip(GapRates::dragged(drag)) {
                *rates = dragged;
            }
        }
        Ok(Rates::Given)
    }

    fn search(&mut self, t: f64, u: &[T], _v: &[T], _ahead: f64) -> Result<Candidates> {
        let found = self.linearize(t, u)?;
        let before = std::mem::replace(&mut self.candidates, self.rows.len());
        Ok(if before == self.candidates { found } else { Candidates::Changed })
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        let found = self.linearize(t, u)?;
        match self.rows.iter().position(|row| row.broken) {
            None => Ok(found),
            Some(feature) => {
                let contact = ContactId { constraint: 0, feature, candidate: 0 };
                Err(Error::ContactNotFinite { t, what: "the gradient of the gap", contact, value: f64::NAN })
            }
        }
    }
}
