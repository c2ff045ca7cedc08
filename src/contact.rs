//! Contact constraints: where the gap is, which way it pushes, under which law.

mod gap_function;
mod gaps;
mod law;
mod linear_rows;
#[cfg(feature = "search")]
mod node_to_facet;
mod nodes_on_obstacle;
mod obstacle;
mod rows;
#[cfg(feature = "search")]
mod surface;

pub use gap_function::GapFunction;
pub(crate) use gaps::{ErasedGaps, Gaps, rounding};
pub use law::ContactLaw;
pub(crate) use law::Measure;
pub use linear_rows::{GapOffset, LinearRows};
#[cfg(feature = "search")]
pub use node_to_facet::NodeToFacet;
pub use nodes_on_obstacle::NodesOnObstacle;
pub use obstacle::{Cylinder, Obstacle, Passage, Plane, Side, Sphere};
pub(crate) use rows::NO_RESPONSE;
pub use rows::{ContactJacobian, GapRates};
#[cfg(feature = "search")]
pub use surface::Facet;

pub use crate::contact_id::ContactId;
use crate::error::{Error, Result};
use crate::real::Real;

/// Refuses lists of a mesh that differ in length or hold coordinates that are not numbers, and nodes that it does not
/// have.
fn check_mesh<T: Real, const D: usize>(coordinates: &[[T; D]], dofs: &[[usize; D]], nodes: &[usize]) -> Result<()> {
    let count = coordinates.len();
    if dofs.len() != count {
        return Err(Error::Dimension { what: "the list of dofs by node", expected: count, found: dofs.len() });
    }
    for (index, x) in coordinates.iter().enumerate() {
        if let Some(x) = x.iter().find(|x| !x.is_finite()) {
            let what = "the list of coordinates (by node)";
            return Err(Error::NotFinite { what, index, value: x.value() });
        }
    }
    check_nodes("a contact node (at most)", nodes, count)
}

/// Refuses nodes that a mesh of `count` nodes does not have.
fn check_nodes(what: &'static str, nodes: &[usize], count: usize) -> Result<()> {
    match nodes.iter().find(|&&node| node >= count) {
        Some(&found) => Err(Error::Dimension { what, expected: count.saturating_sub(1), found }),
        None => Ok(()),
    }
}

/// A constraint `g(t, u) ≥ 0` (or = 0) on the displacements, with as many rows as it has candidates.
///
/// Between two calls of [`search`](Self::search) or [`follow`](Self::follow) gaps are affine in u, `g = G u + g0(t)`.
/// They are linearized by the search where a step begins, and followed to where it imposes contact and where its
/// balance holds. Evaluations are pure. Signs: g > 0 is open; the contact force on the system is Gᵀ λ, λ > 0 in
/// compression.
pub trait ContactConstraint<T: Real>: Send {
    /// The largest number of candidates there can ever be: memory is reserved for it.
    fn max_candidates(&self) -> usize;

    /// The largest number of entries all rows of G together can ever have.
    fn max_entries(&self) -> usize;

    /// Checks the constraint against the size of the system, once, at build.
    ///
    /// # Errors
    ///
    /// Whatever is wrong with it, for instance [`Error::MissingDof`].
    fn check(&self, dofs: usize) -> Result<()>;

    /// Appends every dof that a row may ever act on or a gap depend on (repetitions allowed), whatever later searches
    /// find: the solver eliminates these last, so that contact works on them alone. Asked once, after a search where
    /// the run starts. Default: the dofs of the rows which that has found.
    fn dofs(&self, out: &mut Vec<usize>) {
        let mut g = ContactJacobian::default();
        self.jacobian(&mut g);
        out.extend(g.dofs);
    }

    /// Finds the candidates near the state at t, once a step; they may change only here. Default: they never change.
    ///
    /// `ahead` (time) is how far from t on contact is looked at before the next search: the step that begins, and what
    /// the scheme looks ahead beyond it; zero where no step does. A constraint that takes only what is near takes at
    /// least what v brings near in that time. Returns whether candidates or G changed since the last call.
    ///
    /// # Errors
    ///
    /// The host's own, as [`Error::Host`].
    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        let _ = (t, u, v, ahead);
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

    /// Moves the linearization of the candidates there are to u: G, gaps and rates are then those of the gap functions
    /// at u. Called within a step, between two searches, any number of times and for several u; candidates and their
    /// order stay as they are. Default: gaps are affine, nothing moves.
    ///
    /// Returns whether G changed.
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

    /// Whether [`follow`](Self::follow) never moves anything, because gaps are affine in u between two searches: a run
    /// in which all are saves the looking. Default: not known to be.
    fn is_affine(&self) -> bool {
        false
    }

    /// Number of candidates now.
    fn candidates(&self) -> usize;

    /// (feature, candidate) of a row: what identifies it from step to step.
    fn identity(&self, row: usize) -> (usize, usize);

    /// The law of a row.
    fn law(&self, row: usize) -> ContactLaw;

    /// The size of what is summed to the gap of a row besides G u and the gap itself, for instance coordinates
    /// (length): contact takes gaps for zero within the rounding of it. Default: nothing.
    fn magnitude(&self, row: usize) -> T {
        let _ = row;
        T::zero()
    }

    /// Appends the rows of G, one [`ContactJacobian::push`] a candidate: those that the last search has found. It is
    /// not called before the first one.
    fn jacobian(&self, out: &mut ContactJacobian<T>);

    /// The gaps at t and u, one a candidate (length).
    fn gap(&mut self, t: f64, u: &[T], out: &mut [T]);

    /// The parts of ġ and g̈ that do not come from v and a, one a candidate. Default: none, for gaps that nothing moves
    /// but u; a gap that changes in time while its rates are zero is refused ([`Error::SilentMotion`]).
    fn rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) {
        let _ = (t, u, v);
        out.fill(GapRates::default());
    }
}

impl<T: Real, C: ContactConstraint<T> + ?Sized> ContactConstraint<T> for Box<C> {
    fn max_candidates(&self) -> usize {
        (**self).max_candidates()
    }
    fn max_entries(&self) -> usize {
        (**self).max_entries()
    }
    fn check(&self, dofs: usize) -> Result<()> {
        (**self).check(dofs)
    }
    fn dofs(&self, out: &mut Vec<usize>) {
        (**self).dofs(out);
    }
    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        (**self).search(t, u, v, ahead)
    }
    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        (**self).inspect(step)
    }
    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        (**self).follow(t, u)
    }
    fn is_affine(&self) -> bool {
        (**self).is_affine()
    }
    fn candidates(&self) -> usize {
        (**self).candidates()
    }
    fn identity(&self, row: usize) -> (usize, usize) {
        (**self).identity(row)
    }
    fn law(&self, row: usize) -> ContactLaw {
        (**self).law(row)
    }
    fn magnitude(&self, row: usize) -> T {
        (**self).magnitude(row)
    }
    fn jacobian(&self, out: &mut ContactJacobian<T>) {
        (**self).jacobian(out);
    }
    fn gap(&mut self, t: f64, u: &[T], out: &mut [T]) {
        (**self).gap(t, u, out);
    }
    fn rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) {
        (**self).rates(t, u, v, out);
    }
}

/// A step as contact constraints see it before it is accepted: from where to where it has gone.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Stride<'a, T> {
    /// Times of its start and its end.
    pub t: [f64; 2],
    /// Displacements there, one a dof.
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

/// Whether the direction in which a body comes presses on two normals so differently that the impact along one is not
/// that along the other: the shares of its kinetic energy that a plastic impact takes differ by more than a tenth.
pub(crate) fn press_differently(directions: [f64; 2]) -> bool {
    (directions[0] * directions[0] - directions[1] * directions[1]).abs() > 0.1
}

/// Share of the way that must lead into a body for a contact to be missed if it comes out again: the cosine of the
/// angle to the inward normal where it enters. An impact below it would have taken a sixteenth of the energy.
pub(crate) const STEEP: f64 = 0.25;

/// Cosine of the largest turn of a normal in a step in which its contact presses: 30 degrees.
pub(crate) const LARGEST_TURN: f64 = 0.866;

/// Share of the way in a step by which a gap may miss its linearization, and a node be stopped away from the surface.
pub(crate) const LARGEST_MISS: f64 = 0.1;

/// What a search found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidates {
    /// The same candidates with the same rows of G.
    Unchanged,
    /// Other candidates or other rows.
    Changed,
}
