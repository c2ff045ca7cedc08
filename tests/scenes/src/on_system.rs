//! Contact constraints asked with vectors of a whole system, as tests have them.

use contact_dynamics::contact::{
    Candidates, ContactConstraint, ContactJacobian, ContactLaw, Contacts, GapRates, Rates,
};
use contact_dynamics::{Real, Result};

/// A constraint asked with vectors that have one entry a dof of the system.
pub trait OnSystem<T: Real>: ContactConstraint<T> {
    /// The entries of a vector of the system that the constraint sees.
    fn local(&self, x: &[T]) -> Vec<T> {
        self.dofs().iter().map(|&dof| x[dof]).collect()
    }

    /// [`ContactConstraint::search`].
    ///
    /// # Errors
    ///
    /// Its own.
    fn search_on(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        let (u, v) = (self.local(u), self.local(v));
        self.search(t, &u, &v, ahead)
    }

    /// [`ContactConstraint::follow`].
    ///
    /// # Errors
    ///
    /// Its own.
    fn follow_on(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        let u = self.local(u);
        self.follow(t, &u)
    }

    /// The gaps of all candidates.
    fn gap(&mut self, t: f64, u: &[T], gaps: &mut [T]) {
        let u = self.local(u);
        self.gaps(t, &u, gaps).unwrap();
    }

    /// The rates of all candidates, which the constraint gives.
    fn rates_on(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) {
        let (u, v) = (self.local(u), self.local(v));
        match self.rates(t, &u, &v, rates).unwrap() {
            Rates::Given => {}
            Rates::Zero => rates.fill(GapRates::default()),
            other => panic!("{other:?}"),
        }
    }

    /// What the constraint says now.
    fn found(&self) -> Contacts<T> {
        let mut found = Contacts::new();
        self.contacts(&mut found);
        found
    }

    /// Number of candidates now.
    fn candidates(&self) -> usize {
        self.found().len()
    }

    /// The name of a candidate.
    fn identity(&self, row: usize) -> (usize, usize) {
        self.found().name(row)
    }

    /// The law of a candidate.
    fn law(&self, row: usize) -> ContactLaw {
        self.found().law(row)
    }

    /// The magnitude of a candidate.
    fn magnitude(&self, row: usize) -> T {
        self.found().magnitude(row)
    }

    /// The rows of G on the dofs of the system.
    fn jacobian(&self) -> ContactJacobian<T> {
        let (found, dofs, mut g) = (self.found(), self.dofs(), ContactJacobian::default());
        for row in 0..found.len() {
            let entries: Vec<_> = found.row(row).map(|(place, weight)| (dofs[place], weight)).collect();
            g.push(&entries);
        }
        g
    }
}

impl<T: Real, C: ContactConstraint<T> + ?Sized> OnSystem<T> for C {}
