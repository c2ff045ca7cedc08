//! Settings of a contact of nodes with facets: law, friction, offsets, search range and excluded facets.

use super::NodeToFacet;
use crate::contact::ContactLaw;
use crate::contact::surface::{Facet, Surface};
#[cfg(doc)]
use crate::error::Error;
use crate::error::Result;
use crate::real::Real;

impl<T: Real> NodeToFacet<T> {
    /// For [a surface against itself](Self::of_itself), the number of rings of facets around a node that are
    /// excluded: 0 are the facets of the node, 1 also the facets that share a node with these, and so on. The default
    /// is 1. Without effect for two surfaces.
    #[must_use]
    pub fn rings(mut self, rings: usize) -> Self {
        self.vicinity.set_rings(rings);
        self
    }

    /// Sets the law of all rows.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Sets Coulomb's friction with a coefficient μ ≥ 0. Slip is the velocity of a node relative to its closest point
    /// on the facet: bodies that turn together do not slip.
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

    /// Sets how far (length) the surfaces of the bodies lie outside of their facets, by node of the mesh: half the
    /// thickness of a shell whose facets are its middle surface, the thickness of a coating; negative if they lie
    /// inside. For nodes without facets it is their own thickness, for instance the radius of a cable. Between nodes
    /// the shape functions interpolate.
    ///
    /// The gap is the distance less the offsets of the node and of the closest point of the facet. The closest facet
    /// is the one whose surface is closest. Rows include the change of a varying offset as the closest point slides.
    /// So forces have a component along the facet, and conserve linear and angular momentum.
    ///
    /// Forces act on nodes and facets; the lever arm of a friction force about the middle surface is left out. In
    /// dents only sides that share a vertex with the closest facet are found. In a dent of 90°, that suffices for
    /// offsets up to a facet's length. In contact [with itself](Self::of_itself) a fold tighter than its offset
    /// penetrates itself, because facets beyond the [rings](Self::rings) count.
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
    /// [`Error::Dimension`] unless there is one offset per node of the mesh; [`Error::NotFinite`] (index: node).
    pub fn offsets(mut self, offsets: &[T]) -> Result<Self> {
        self.vicinity.set_offsets(offsets, self.nodes.coordinates.len())?;
        Ok(self)
    }

    /// Scales all [`offsets`](Self::offsets) in time: by the factor `factors[0]` until `times[0]`, by `factors[1]`
    /// from `times[1]` on. In between the factor is smooth, without a jump of velocity or acceleration, as in
    /// [`Mortar::ramp`](crate::contact::Mortar::ramp).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless all values are finite and the second time is later.
    pub fn ramp(mut self, times: [f64; 2], factors: [f64; 2]) -> Result<Self> {
        self.vicinity.set_ramp(times, factors)?;
        Ok(self)
    }

    /// Sets the least distance (length) outside and inside of the facets at which nodes are found; the default is the
    /// mean size of the facets. The motion within a step is added by the velocities, so that the reach need not fit
    /// the speed.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn reach(mut self, reach: T) -> Result<Self> {
        self.vicinity.set_least(reach)?;
        Ok(self)
    }

    /// Sets how far (length) nodes of the two surfaces may move relative to each other before lists of facets are
    /// rebuilt; the default is half of the search range. It changes the cost, not the result.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn skin(mut self, skin: T) -> Result<Self> {
        self.vicinity.reach.set_skin(skin)?;
        Ok(self)
    }

    /// Sets the facets of the nodes' own surface. Then a node is in contact only with facets that face it: the angle
    /// between their normal and its own, the mean of its facets' normals, must be at least 60°.
    ///
    /// This prevents contact with the far side of a thin body, and with facets that a node approaches from behind.
    /// With the whole surface of its body it also prevents contact through that body.
    ///
    /// # Errors
    ///
    /// Those of [`one_pass`](Self::one_pass) about facets.
    pub fn facing<F: Into<Facet>>(mut self, facets: impl IntoIterator<Item = F>) -> Result<Self> {
        let own = Surface::of_facets(facets, self.nodes.dimension, &self.nodes.coordinates)?;
        self.own_surface = Some(own);
        self.passes.truncate(1);
        self.prepare()?;
        Ok(self)
    }
}
