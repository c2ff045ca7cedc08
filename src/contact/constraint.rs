//! The trait of contact constraints, and what a constraint is asked and shown.

use super::{ContactId, Contacts, GapRates};
use crate::error::{Error, Result};
use crate::real::Real;

/// A constraint `g(t, u) ≥ 0` (or = 0) on some displacements, with as many rows as it has candidates.
///
/// Like an element a constraint knows its own dofs alone: [`dofs`](Self::dofs) lists them once, and every vector that
/// it is given has one entry for each of them, in this order. Rows name *places* in that list.
///
/// Rows are those of the last [`search`](Self::search) or [`follow`](Self::follow); gaps are evaluated anywhere,
/// exactly or by these rows, `g = g* + G (u − u*)`. Evaluations are pure. Signs: g > 0 is open; the contact force on
/// the system is Gᵀ λ, λ > 0 in compression.
///
/// The end of a bar against a wall that moves (13 lines):
///
/// ```
/// use contact_dynamics::contact::{ContactConstraint, ContactLaw, Contacts};
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Composite, LinearSystem, Result, Simulation};
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
/// let mut run = Simulation::builder(bar, Composite, 1e-3).velocity(vec![1.0, 1.0]).constraint(Wall).build()?;
/// run.run_until(0.08, &mut ())?;
/// assert!(run.state().contacts().closed()[0] && (run.state().velocity()[1] + 0.5).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// A point on or above the parabola y = x² (18 lines):
///
/// ```
/// use contact_dynamics::contact::{Candidates, ContactConstraint, ContactLaw, Contacts};
/// use contact_dynamics::{Result, verify};
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
    /// The dofs of the system (in any order, none twice) that contacts may ever act on or read, whatever later searches
    /// find. Asked once, when a simulation is built, before anything else.
    ///
    /// The solver eliminates those that contacts may act on last, so that contact works on them alone.
    fn dofs(&self) -> &[usize];

    /// Whether no row will ever act on the dof at a place of [`dofs`](Self::dofs): the constraint reads it, and the
    /// solver need not treat it as a dof of contact. Asked after `dofs`. Default: rows may act on all.
    fn only_reads(&self, place: usize) -> bool {
        let _ = place;
        false
    }

    /// Says everything of all candidates there are now, one [`Contacts::push`] each: name, law, row of G, and more if
    /// there is more to say. Called after a search or a follow that has found a change.
    fn contacts(&self, contacts: &mut Contacts<T>);

    /// The gaps at t and u, one a candidate (length). Not called while there are no candidates.
    ///
    /// # Errors
    ///
    /// The host's own, as [`Error::Host`]. (Gaps that are NaN or infinite are refused by the caller.)
    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()>;

    /// The parts of ġ and g̈ that do not come from v and a, one a candidate. Default: they are found from
    /// [differences](Rates::Differences) of the gaps.
    ///
    /// A constraint that gives them must give those of all its candidates: a gap that changes in time while its rates
    /// are zero is refused ([`Error::SilentMotion`]).
    ///
    /// # Errors
    ///
    /// As of [`gaps`](Self::gaps).
    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let _ = (t, u, v, rates);
        Ok(Rates::Differences)
    }

    /// The parts of the slip, and of its rate, that do not come from v and a, one entry a tangent, in the order in
    /// which [`contacts`](Self::contacts) gives them: slip = H v + `rate`, and where contact sticks H a +
    /// `acceleration` = 0. For an obstacle whose points at the contact move with velocity w and acceleration b these
    /// are −t·w and −t·b, t the direction of the tangent. Asked of constraints with
    /// [friction](super::Contact::friction) only. Default: [`Rates::Zero`], as of obstacles at rest, and of bodies
    /// whose dofs are all in H. ([`Rates::Differences`] is no answer here.)
    ///
    /// # Errors
    ///
    /// As of [`gaps`](Self::gaps).
    fn slip_rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let _ = (t, u, v, rates);
        Ok(Rates::Zero)
    }

    /// Finds the candidates near the state at t, once a step; they may change only here. Default: they never change,
    /// and their rows [follow](Self::follow) u.
    ///
    /// `ahead` (time) is how far from t on contact is looked at before the next search: the step that begins, and what
    /// the scheme looks ahead beyond it; zero where no step does. A constraint that takes only what is near takes at
    /// least what v brings near in that time. Returns whether candidates or rows changed since the last call.
    ///
    /// # Errors
    ///
    /// The host's own, as [`Error::Host`].
    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        let _ = (v, ahead);
        self.follow(t, u)
    }

    /// Moves the linearization of the candidates there are to u: rows are then the derivatives of the gaps at u. Called
    /// within a step, between two searches, any number of times and for several u; candidates and their order stay as
    /// they are. Default: rows do not depend on u, nothing moves.
    ///
    /// Returns whether rows changed.
    ///
    /// # Errors
    ///
    /// [`Error::ContactLost`] if a candidate has left what the last search knows of its surroundings,
    /// [`Error::ContactNotFinite`] if it has no normal there (the constraint's index in the contact's name is filled in
    /// by the caller), or the host's own.
    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        let _ = (t, u);
        Ok(Candidates::Unchanged)
    }

    /// Looks at a step before it is accepted: bodies that have gone through each other are refused here, or contacts
    /// found along a normal that is not that of the place where they happen. Candidates are those of the search at the
    /// start of the step. Default: nothing is refused.
    ///
    /// # Errors
    ///
    /// [`Error::PassedThrough`], which a smaller step mends (the constraint's index in the contact's name is filled in
    /// by the caller), or the host's own.
    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        let _ = step;
        Ok(())
    }

    /// Whether [`inspect`](Self::inspect) looks at anything, asked after the first search: one that does not saves the
    /// copying of its vectors. Default: it does.
    fn inspects(&self) -> bool {
        true
    }

    /// Which of its bonds do not stand the forces at the end of a step: rows that hold both ways until their force is
    /// too large. `forces` has one entry a candidate, after correction (compression positive). Appends the
    /// [feature](super::ContactId::feature) of each bond that breaks, and how many times as large as its strength the
    /// force is. Asked once for each step that is accepted, after everything that may refuse it. Default: there is no
    /// bond.
    ///
    /// ```
    /// use contact_dynamics::contact::{BondStrength, ContactConstraint, LinearRows};
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

    /// Is told which of its bonds are broken: their features, ascending, of all that have broken so far. Rows change
    /// with the next search. Called when a run is built, before its first search, with what the state that it continues
    /// from knows (nothing at a start), and after each step that has broken one. That the constraint remembers this is
    /// no state of its own: it is that of the run ([`State::broken_bonds`](crate::State::broken_bonds)). Default:
    /// nothing, as there is no bond.
    fn set_broken(&mut self, features: &[usize]) {
        let _ = features;
    }

    /// When rows may change, asked after the first search: a run in which none follows saves the looking. Default:
    /// nothing is known.
    fn variation(&self) -> Variation {
        Variation::Follows
    }
}

impl<T: Real> Contacts<T> {
    /// What a constraint says now, for hosts that look at a constraint themselves.
    pub fn of(constraint: &(impl ContactConstraint<T> + ?Sized)) -> Self {
        let mut contacts = Self::new();
        constraint.contacts(&mut contacts);
        contacts
    }
}

/// Forwards every method, defaults included: what is boxed or lent behaves as what it is.
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

/// What a search found, or following.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidates {
    /// The same candidates with the same rows of G.
    Unchanged,
    /// Other candidates or other rows.
    Changed,
}

impl Candidates {
    /// [`Changed`](Self::Changed) if so, else [`Unchanged`](Self::Unchanged).
    pub fn changed_if(changed: bool) -> Self {
        if changed { Self::Changed } else { Self::Unchanged }
    }
}

/// Where the rates of the gaps come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rates {
    /// The constraint has given them all.
    Given,
    /// They are all zero, and the slice is left as it is: gaps are G u and a constant, with rows that do not turn. Not
    /// asked again until rows change.
    Zero,
    /// The caller finds them, by central differences of the gaps in time around (t, u): ∂g/∂t of g(t ± δ, u), and
    /// Ġ v + ∂ġ/∂t of g(t ± δ, u ± δ v), at which the constraint [follows](ContactConstraint::follow). What the gaps do
    /// between t ± 1/16 of the time that the search looks ahead enters, also at a start; the errors are fourth and
    /// higher derivatives of the gap in that time (`docs/contact.md`).
    Differences,
}

/// When the rows of a constraint may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Variation {
    /// Never: [`ContactConstraint::search`] is called once, and nothing moves after it.
    Never,
    /// By a search, once a step: [`ContactConstraint::follow`] never moves anything, because gaps are affine in u
    /// between two searches.
    BySearch,
    /// Wherever they follow u.
    Follows,
}

/// A step as contact constraints see it before it is accepted: from where to where it has gone.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Stride<'a, T> {
    /// Times of its start and its end.
    pub t: [f64; 2],
    /// Displacements there, one a dof of the constraint.
    pub u: [&'a [T]; 2],
    /// Velocities at its start.
    pub v: &'a [T],
    /// Which candidates of the constraint were closed at its start, and are at its end.
    pub closed: [&'a [bool]; 2],
}

impl<'a, T> Stride<'a, T> {
    /// The step between two displacements, for hosts that call a constraint themselves.
    pub fn new(t: [f64; 2], u: [&'a [T]; 2], v: &'a [T], closed: [&'a [bool]; 2]) -> Self {
        Self { t, u, v, closed }
    }

    /// The error of a contact (feature, candidate) of the constraint: `way` is that of its node against the surface.
    pub(crate) fn refuse(&self, (feature, candidate): (usize, usize), what: &'static str, way: f64, gap: f64) -> Error {
        let contact = ContactId { constraint: 0, feature, candidate };
        Error::PassedThrough { t: self.t[0], h: self.t[1] - self.t[0], contact, what, way, gap }
    }
}
