//! The trait of contact constraints, and the data passed to and returned by a constraint.

use super::{ContactId, Contacts, GapRates};
use crate::error::{Error, Result};
use crate::real::Real;

/// A constraint `g(t, u) ≥ 0` (or = 0) on some displacements, with one row per candidate.
///
/// As an element, a constraint has its own list of dofs: [`dofs`](Self::dofs) returns it once, and every vector that
/// is passed to the constraint has one entry for each of them, in this order. Rows refer to *places* in that list.
///
/// Rows come from the last [`search`](Self::search) or [`follow`](Self::follow). Gaps are evaluated for any u,
/// exactly or by these rows, `g = g* + G (u − u*)`. Evaluations are pure. Signs: g > 0 is open; the contact force on
/// the system is Gᵀ λ, λ > 0 in compression.
///
/// The end of a bar against a moving wall (13 lines):
///
/// ```
/// use contact_dynamics::contact::Contacts;
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{ContactConstraint, ContactLaw, GeneralizedAlpha, LinearSystem, Result, Simulation};
///
/// struct Wall;
///
/// impl ContactConstraint<f64> for Wall {
///     fn dofs(&self) -> &[usize] {
///         &[1]
///     }
///     fn contacts(&self, contacts: &mut Contacts<f64>) {
///         contacts.push((0, 0), ContactLaw::Rigid, &[(0, -1.0)]);
///     }
///     fn gaps(&mut self, t: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
///         gaps[0] = 0.1 - 0.5 * t - u[0];
///         Ok(())
///     }
/// }
///
/// let entries = [(0, 0, 1e3), (0, 1, -1e3), (1, 0, -1e3), (1, 1, 1e3)];
/// let k: Vec<_> = entries.iter().map(|&(i, j, k)| Triplet::new(i, j, k)).collect();
/// let bar = LinearSystem::lumped(vec![1.0, 1.0], SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &k)?)?;
/// let mut run = Simulation::builder(bar, GeneralizedAlpha::default(), 1e-3)
///     .velocity(vec![1.0, 1.0])
///     .constraint(Wall)
///     .build()?;
/// run.run_until(0.08, &mut ())?;
/// assert!(run.state().contacts().closed()[0] && (run.state().velocity()[1] + 0.5).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A point on or above the parabola y = x² (18 lines):
///
/// ```
/// use contact_dynamics::contact::{Candidates, Contacts};
/// use contact_dynamics::{ContactConstraint, ContactLaw, Result, verify};
///
/// struct Parabola {
///     x: f64, // where its tangent is taken
/// }
///
/// impl ContactConstraint<f64> for Parabola {
///     fn dofs(&self) -> &[usize] {
///         &[0, 1]
///     }
///     fn contacts(&self, contacts: &mut Contacts<f64>) {
///         contacts.push((0, 0), ContactLaw::Rigid, &[(0, -2.0 * self.x), (1, 1.0)]);
///     }
///     fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
///         gaps[0] = u[1] - u[0] * u[0];
///         Ok(())
///     }
///     fn follow(&mut self, _: f64, u: &[f64]) -> Result<Candidates> {
///         Ok(Candidates::changed_if(std::mem::replace(&mut self.x, u[0]) != u[0]))
///     }
/// }
///
/// let error = verify::gap_jacobian(&mut Parabola { x: 0.0 }, 0.0, &[0.3, 0.2], &[1.0, 0.0], 1e-5)?;
/// assert!(error.rows == 1 && error.jacobian < 1e-9, "{error:?}");
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub trait ContactConstraint<T: Real>: Send {
    /// The dofs of the system (in any order, none twice) on which contacts of this constraint may ever act, or which
    /// it reads. Called once, when a simulation is built, before any other method.
    ///
    /// The solver eliminates the dofs on which contacts may act last, so that the contact problem involves only them.
    fn dofs(&self) -> &[usize];

    /// Whether no row will ever act on the dof at a place of [`dofs`](Self::dofs): then the constraint only reads it,
    /// and the solver need not treat it as a dof of contact. Called after `dofs`. Default: rows may act on all dofs.
    fn only_reads(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// Lists all current candidates, with one [`Contacts::push`] each: name, law, row of G, and optional data. Called
    /// after a search or a follow that reports a change.
    fn contacts(&self, contacts: &mut Contacts<T>);

    /// The gaps at t and u, one per candidate (length). Not called without candidates.
    ///
    /// # Errors
    ///
    /// The host's own, as [`Error::Host`]. The caller rejects gaps that are NaN or infinite.
    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()>;

    /// The parts of ġ and g̈ that do not come from v and a, one entry per candidate. Default: the caller finds them
    /// by [differences](Rates::Differences) of the gaps.
    ///
    /// A constraint that returns rates must return them for all its candidates. If a gap changes in time while its
    /// rates are zero, the run fails with [`Error::SilentMotion`].
    ///
    /// # Errors
    ///
    /// As of [`gaps`](Self::gaps).
    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let _ = (t, u, v, rates);
        Ok(Rates::Differences)
    }

    /// The parts of the slip and of its rate that do not come from v and a, one entry per tangent, in the order of
    /// [`contacts`](Self::contacts): slip = H v + `rate`, and in stick H a + `acceleration` = 0. For an obstacle
    /// whose points at the contact move with velocity w and acceleration b these are −t·w and −t·b, with the
    /// direction t of the tangent. Called only for constraints with [friction](super::Contact::friction). Default:
    /// [`Rates::Zero`], for obstacles at rest and for bodies whose dofs are all in H. [`Rates::Differences`] is not
    /// allowed here.
    ///
    /// # Errors
    ///
    /// As of [`gaps`](Self::gaps).
    fn slip_rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let _ = (t, u, v, rates);
        Ok(Rates::Zero)
    }

    /// Finds the candidates near the state at t, once a step; candidates may change only here. Default: they never
    /// change, and their rows [follow](Self::follow) u.
    ///
    /// `ahead` is the time from t within which contact is evaluated before the next search: the coming step, and the
    /// time that the scheme looks ahead beyond it; zero if there is no step. A constraint with a search range must
    /// include the motion by v within that time. Returns whether candidates or rows changed since the last call.
    ///
    /// # Errors
    ///
    /// The host's own, as [`Error::Host`].
    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        let _ = (v, ahead);
        self.follow(t, u)
    }

    /// Linearizes the existing candidates at u: rows are then the derivatives of the gaps at u. Called within a step,
    /// between two searches, any number of times and for several u. Candidates and their order stay. Default: rows do
    /// not depend on u.
    ///
    /// Returns whether rows changed.
    ///
    /// # Errors
    ///
    /// [`Error::ContactLost`] if a candidate has left the range of the last search, [`Error::ContactNotFinite`] if it
    /// has no normal there (the caller sets the constraint's index in the contact's name), or the host's own.
    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        let _ = (t, u);
        Ok(Candidates::Unchanged)
    }

    /// Checks a step before it is accepted. It is rejected here if bodies have gone through each other, or if a
    /// contact was found along a normal that differs from the normal where it occurs. Candidates are from the search
    /// at the start of the step. Default: every step is accepted.
    ///
    /// # Errors
    ///
    /// [`Error::PassedThrough`], for which a smaller step helps (the caller sets the constraint's index in the
    /// contact's name), or the host's own.
    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        let _ = step;
        Ok(())
    }

    /// Whether [`inspect`](Self::inspect) checks anything; if not, its vectors are not copied. Called after the first
    /// search. Default: yes.
    fn inspects(&self) -> bool {
        true
    }

    /// Finds the bonds that break under the forces at the end of a step. A bond is a row that holds in both
    /// directions until its force is too large. `forces` has one entry per candidate, after correction (compression
    /// positive). Appends the [feature](super::ContactId::feature) of each bond that breaks, and the ratio of its
    /// force to its strength. Called once for each accepted step, after all checks that may reject it. Default: there
    /// is no bond.
    ///
    /// ```
    /// use contact_dynamics::contact::BondStrength;
    /// use contact_dynamics::{ContactConstraint, LinearRows};
    ///
    /// // Two dofs that hold together up to a pull of 3.
    /// let bonded = LinearRows::new().bond(3.0, &[(0, -1.0), (1, 1.0)], 0.0);
    /// let mut broken = Vec::new();
    /// bonded.overloads(&[-2.9], &mut broken);
    /// assert!(broken.is_empty());
    /// bonded.overloads(&[-6.0], &mut broken);
    /// assert_eq!(broken, [(0, 2.0)]);
    /// ```
    fn overloads(&self, forces: &[T], broken: &mut Vec<(usize, f64)>) {
        let _ = (forces, broken);
    }

    /// Sets the broken bonds: the features of all bonds that have broken so far, ascending. Rows change with the next
    /// search. Called when a run is built, before its first search, with the broken bonds of the initial state (none
    /// for a new run), and after each step that breaks a bond. The list belongs to the state of the run
    /// ([`State::broken_bonds`](crate::State::broken_bonds)); the constraint only keeps a copy. Default: does
    /// nothing, as there is no bond.
    fn set_broken(&mut self, features: &[usize]) {
        let _ = features;
    }

    /// When rows may change. Called after the first search: a run without rows that follow u skips the calls.
    /// Default: rows may follow u.
    fn variation(&self) -> Variation {
        Variation::Follows
    }
}

impl<T: Real> Contacts<T> {
    /// The current candidates of a constraint, for hosts that call a constraint themselves.
    pub fn of(constraint: &(impl ContactConstraint<T> + ?Sized)) -> Self {
        let mut contacts = Self::new();
        constraint.contacts(&mut contacts);
        contacts
    }
}

/// Forwards every method, including defaults, so that a boxed or borrowed constraint behaves as the constraint
/// itself.
macro_rules! forward {
    ($($kind:tt)+) => {
        impl<T: Real, C: ContactConstraint<T> + ?Sized> ContactConstraint<T> for $($kind)+ {
            fn dofs(&self) -> &[usize] {
                (**self).dofs()
            }
            fn only_reads(&self, place: usize) -> bool {
                (**self).only_reads(place)
            }
            fn contacts(&self, contacts: &mut Contacts<T>) {
                (**self).contacts(contacts);
            }
            fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
                (**self).gaps(t, u, gaps)
            }
            fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
                (**self).rates(t, u, v, rates)
            }
            fn slip_rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
                (**self).slip_rates(t, u, v, rates)
            }
            fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
                (**self).search(t, u, v, ahead)
            }
            fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
                (**self).follow(t, u)
            }
            fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
                (**self).inspect(step)
            }
            fn inspects(&self) -> bool {
                (**self).inspects()
            }
            fn overloads(&self, forces: &[T], broken: &mut Vec<(usize, f64)>) {
                (**self).overloads(forces, broken);
            }
            fn set_broken(&mut self, features: &[usize]) {
                (**self).set_broken(features);
            }
            fn variation(&self) -> Variation {
                (**self).variation()
            }
        }
    };
}

forward!(Box<C>);
forward!(&mut C);

/// Whether a search or a follow has changed candidates or rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidates {
    /// The same candidates with the same rows of G.
    Unchanged,
    /// Other candidates or other rows.
    Changed,
}

impl Candidates {
    /// [`Changed`](Self::Changed) if `changed`, else [`Unchanged`](Self::Unchanged).
    pub fn changed_if(changed: bool) -> Self {
        if changed { Self::Changed } else { Self::Unchanged }
    }
}

/// The source of the rates of the gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rates {
    /// The constraint has written them all.
    Given,
    /// They are all zero, and the slice is unchanged: gaps are G u plus a constant, with constant rows. Not called
    /// again until rows change.
    Zero,
    /// The caller finds them by central differences of the gaps in time around (t, u): ∂g/∂t of g(t ± δ, u), and
    /// Ġ v + ∂ġ/∂t of g(t ± δ, u ± δ v), to which the constraint [follows](ContactConstraint::follow). δ is at most
    /// 1/16 of the time that the search looks ahead (1/4 in single precision), also at a start, and gaps within t ± δ
    /// enter. The errors are fourth and higher derivatives of the gap in that time (`docs/contact/obstacles.md`).
    Differences,
}

/// When the rows of a constraint may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Variation {
    /// Never: [`ContactConstraint::search`] is called once, and rows are constant after it.
    Never,
    /// By a search, once a step: [`ContactConstraint::follow`] never changes rows, because gaps are affine in u
    /// between two searches.
    BySearch,
    /// Whenever u changes.
    Follows,
}

/// A step as contact constraints check it before it is accepted.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Stride<'a, T> {
    /// Times of its start and its end.
    pub t: [f64; 2],
    /// Displacements at its start and its end, one per dof of the constraint.
    pub u: [&'a [T]; 2],
    /// Velocities at its start.
    pub v: &'a [T],
    /// Whether each candidate of the constraint was closed at its start and at its end.
    pub closed: [&'a [bool]; 2],
}

impl<'a, T> Stride<'a, T> {
    /// The step between two displacements, for hosts that call a constraint themselves.
    pub fn new(t: [f64; 2], u: [&'a [T]; 2], v: &'a [T], closed: [&'a [bool]; 2]) -> Self {
        Self { t, u, v, closed }
    }

    /// The error of a contact (feature, candidate) of the constraint; `way` is its relative displacement in the step.
    pub(crate) fn rejected(
        &self,
        (feature, candidate): (usize, usize),
        what: &'static str,
        way: f64,
        gap: f64,
    ) -> Error {
        let contact = ContactId { constraint: 0, feature, candidate };
        Error::PassedThrough { t: self.t[0], h: self.t[1] - self.t[0], contact, what, way, gap }
    }
}
