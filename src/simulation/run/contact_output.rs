//! The contacts of a run for plots and other codes: forces as vectors, rows and positions.

use crate::contact::{ContactId, Contacts};
use crate::real::Real;
use crate::simulation::run::Simulation;
use crate::state::ContactStatus;

/// A contact of a state with its force as a vector: made by [`Simulation::contact_forces`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ContactForce<T> {
    /// Which contact.
    pub id: ContactId,
    /// Open, touching or closed.
    pub status: ContactStatus,
    /// The gap (length).
    pub gap: T,
    /// The force λ, compression positive, as in [`ContactState::forces`](crate::state::ContactState::forces).
    pub force: T,
    /// The (dof, weight) pairs of the row of G, along which the force acts and the gap is measured: its normal.
    pub row: Vec<(usize, T)>,
    /// The friction forces along the tangents, and the slip velocities along them, as in
    /// [`ContactState::friction_forces`](crate::state::ContactState::friction_forces) and
    /// [`slip`](crate::state::ContactState::slip). Empty without friction.
    pub friction: Vec<T>,
    /// See [`friction`](Self::friction).
    pub slip: Vec<T>,
    /// Rows along which the bodies slide, if the constraint has given them, as (dof, weight) pairs.
    pub tangents: Vec<Vec<(usize, T)>>,
    /// Where the contact is (length), if its constraint gives it: nodes at the end of the step.
    pub position: Option<[T; 3]>,
    /// The direction in space in which the gap opens, if its constraint gives it.
    pub normal: Option<[T; 3]>,
}

impl<T: Real> ContactForce<T> {
    /// The force on the dofs that the contact acts on, as (dof, force) pairs: λ times the row, and friction times the
    /// tangents. A dof may occur more than once.
    pub fn forces(&self) -> impl Iterator<Item = (usize, T)> + '_ {
        let rows =
            std::iter::once((&self.row, self.force)).chain(self.tangents.iter().zip(self.friction.iter().copied()));
        rows.flat_map(|(row, force)| row.iter().map(move |&(dof, weight)| (dof, force * weight)))
    }
}

impl<T: Real> Simulation<'_, T> {
    /// The contacts of the state with their forces as vectors, their rows, and where they are.
    ///
    /// Rows belong to the state: M a = f + Σ [`forces`](ContactForce::forces) there, to rounding or O(h) as described
    /// at [`ContactState::forces`](crate::state::ContactState::forces). Contacts are in the order of
    /// [`ContactState::ids`](crate::state::ContactState::ids). Allocates: for output, not for inner loops.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::contact::Plane;
    /// use contact_dynamics::{GeneralizedAlpha, LinearSystem, NodesOnObstacle, Simulation};
    ///
    /// // A particle of weight 10 rests on a floor, 3 to the right of the origin.
    /// let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    /// let system = LinearSystem::lumped(vec![1.0; 2], free)?.load(|_, f| f[1] = -10.0);
    /// let floor = NodesOnObstacle::new(Plane::new([0.0, 0.0], [0.0, 1.0])?, &[[3.0, 0.0]], &[[0, 1]], &[0])?;
    /// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 0.1).constraint(floor).build()?;
    /// run.step()?;
    /// let contact = run.contact_forces().next().ok_or("no contact")?;
    /// let [(dof, force)] = contact.forces().collect::<Vec<_>>()[..] else { panic!("one dof") };
    /// assert!(dof == 1 && (force - 10.0_f64).abs() < 1e-12);
    /// assert_eq!(contact.normal, Some([0.0, 1.0, 0.0]));
    /// assert!(contact.position.is_some_and(|[x, y, _]| x == 3.0 && y.abs() < 1e-12));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn contact_forces(&self) -> impl Iterator<Item = ContactForce<T>> + '_ {
        let contacts = &self.state.contacts;
        // Read from the constraints now: positions move without their rows.
        let reported: Vec<Contacts<T>> = (0..).map_while(|part| self.constraint(part)).map(Contacts::of).collect();
        self.constraints.rows_of(contacts).map(move |(contact, row)| {
            let id = contacts.ids[contact];
            let (first, dofs) = self.constraints.rows_of_part(id.constraint);
            let (own, reported) = (row - first, &reported[id.constraint]);
            let on_system = |row: Vec<(usize, T)>| row.into_iter().map(|(place, w)| (dofs[place], w)).collect();
            ContactForce {
                id,
                status: contacts.status(contact),
                gap: contacts.gap[contact],
                force: contacts.lambda[contact],
                friction: contacts.friction_forces(contact).to_vec(),
                slip: contacts.slip(contact).to_vec(),
                row: self.g.row(row).collect(),
                tangents: match self.constraints.tangents().of(row) {
                    rows if rows.is_empty() => reported.tangents(own).into_iter().map(on_system).collect(),
                    rows => rows.map(|row| self.g.row(row).collect()).collect(),
                },
                position: reported.position(own),
                normal: reported.normal(own),
            }
        })
    }
}
