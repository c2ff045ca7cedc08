//! What a constraint of nodes on facets can be told: laws, friction, offsets, how far it looks, what is met.

use super::NodeToFacet;
use crate::contact::ContactLaw;
use crate::contact::surface::{Facet, Surface};
#[cfg(doc)]
use crate::error::Error;
use crate::error::Result;
use crate::real::Real;

impl<T: Real> NodeToFacet<T> {
    /// How many rings of facets around a node it does not meet, of [its own surface](Self::of_itself): 0 are the facets
    /// that have the node, 1 those that share a node with one of them, and so on. By default 1. It has no meaning for
    /// two surfaces.
    #[must_use]
    pub fn rings(mut self, rings: usize) -> Self {
        self.vicinity.set_rings(rings);
        self
    }

    /// The law of all rows.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Coulomb's friction with a coefficient μ, from 0. Slip is the velocity of a node against the point of the facet
    /// that it stands on: bodies that turn together do not slip.
    ///
    /// ```
    /// use contact_dynamics::contact::{Contacts, NodeToFacet};
    /// use contact_dynamics::ContactConstraint;
    ///
    /// // A node in the middle of a segment, and touching it.
    /// let coordinates = [[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]];
    /// let dofs = [[0, 1], [2, 3], [4, 5]];
    /// let mut contact = NodeToFacet::one_pass(&coordinates, &dofs, &[2], [[1, 0]])?.friction(0.3);
    /// contact.search(0.0, &[0.0; 6], &[0.0; 6], 0.0)?;
    /// let contacts = Contacts::of(&contact);
    /// assert_eq!((contacts.friction(0), contacts.tangents(0).len()), (0.3, 1));
    /// let v = [5.0, 0.0, 5.0, 0.0, 5.0, 0.0];
    /// let slip: f64 = contacts.tangents(0)[0].iter().map(|&(place, weight)| weight * v[place]).sum();
    /// assert_eq!(slip, 0.0); // all of them move along the segment
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    #[must_use]
    pub fn friction(mut self, coefficient: f64) -> Self {
        self.friction = coefficient;
        self
    }

    /// How far (length) the surfaces of the bodies lie outside of their facets, by node of the mesh, and of nodes that
    /// belong to no facet how thick they are: half the thickness of a shell whose facets are its middle surface, the
    /// thickness of a coating, the radius of a cable; negative if they lie inside. Between nodes the shape functions
    /// interpolate. The gap is the distance less the offsets of the node and of the closest point of the facet, and a
    /// node meets the facet whose surface is closest. What a varying offset changes by as the closest point slides is
    /// in the rows: forces then have a share along the facet, and keep linear and angular momentum.
    ///
    /// Forces act on nodes and facets: that a friction force acts at a distance from the middle surface is left out. In
    /// dents sides are found that share a vertex with the closest facet: so in a dent of 90° with an offset of no more
    /// than a facet's length. [Of itself](Self::of_itself) a body meets what is near beyond its [rings](Self::rings),
    /// so a fold tighter than its offset is inside of itself.
    ///
    /// ```
    /// use contact_dynamics::ContactConstraint;
    /// use contact_dynamics::contact::NodeToFacet;
    ///
    /// // The middle surfaces of two sheets, 0.1 apart, of which each is 0.06 thick.
    /// let coordinates = [[1.0, 0.0], [0.0, 0.0], [0.0, 0.1], [1.0, 0.1]];
    /// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    /// let mut contact = NodeToFacet::new(&coordinates, &dofs, [[2, 3]], [[0, 1]])?.offsets(&[0.03; 4])?;
    /// contact.search(0.0, &[0.0; 8], &[0.0; 8], 0.0)?;
    /// let mut gaps = [0.0; 2];
    /// contact.gaps(0.0, &[0.0; 8], &mut gaps)?;
    /// assert!(gaps.iter().all(|gap: &f64| (gap - 0.04).abs() < 1e-15));
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] unless there is one a node of the mesh; [`Error::NotFinite`] (index: node).
    pub fn offsets(mut self, offsets: &[T]) -> Result<Self> {
        self.vicinity.set_offsets(offsets, self.nodes.coordinates.len())?;
        Ok(self)
    }

    /// Lets all [`offsets`](Self::offsets) grow, or shrink, with time: by the factor `factors[0]` until `times[0]`, by
    /// `factors[1]` from `times[1]` on, and in between smoothly, without a jump of velocity or acceleration, as
    /// [`Mortar::ramp`](crate::contact::Mortar::ramp).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless all are finite and the second time is later.
    pub fn ramp(mut self, times: [f64; 2], factors: [f64; 2]) -> Result<Self> {
        self.vicinity.set_ramp(times, factors)?;
        Ok(self)
    }

    /// How far (length) outside and inside of the facets a node is found at least; by default the mean size of the
    /// facets. What the velocities bring near within a step is found as well, so that no reach must fit the speed.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn reach(mut self, reach: T) -> Result<Self> {
        self.vicinity.set_least(reach)?;
        Ok(self)
    }

    /// How far (length) nodes of the two surfaces may move relative to each other before lists of facets are built
    /// anew; if not given, half of what is searched. It changes the cost, not the result.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn skin(mut self, skin: T) -> Result<Self> {
        self.vicinity.reach.set_skin(skin)?;
        Ok(self)
    }

    /// Tells the facets that the nodes belong to: a node then meets only facets turned against its own normal, which is
    /// the mean of its facets' normals (refused: an angle of less than 60° between the two).
    ///
    /// This keeps a node from the far side of a thin body, and from facets that it comes to from behind; of the whole
    /// surface of its body also from facets that it could meet only through that body.
    ///
    /// # Errors
    ///
    /// As those of [`one_pass`](Self::one_pass) about facets.
    pub fn facing<F: Into<Facet>>(mut self, facets: impl IntoIterator<Item = F>) -> Result<Self> {
        let own = Surface::of_facets(facets, self.nodes.dimension, &self.nodes.coordinates)?;
        self.own_surface = Some(own);
        self.passes.truncate(1);
        self.prepare()?;
        Ok(self)
    }
}
