//! Contact of two or more bodies with faces, corners and edges: the constraints that keep them apart.

use super::edge_to_edge::{self, EdgeToEdge};
use super::surface::{Facet, Nodes, Ramp, Surface, Thickness};
use super::{ContactConstraint, ContactLaw, Mortar, NodeToFacet};
use crate::error::Result;
use crate::real::Real;

/// Contact of deforming bodies whose surfaces may have corners and edges: of two bodies ([`new`](Self::new)), or of
/// any number of bodies, which may fold ([`of_itself`](Self::of_itself)). It makes the constraints for
/// [`SimulationBuilder::constraints`](crate::SimulationBuilder::constraints).
///
/// Weighted gaps spread contact over faces, but not between facets at more than 60° to each other. Alone they would
/// let corners and edges penetrate, and the bodies could gain energy from the recovery. Therefore [`Mortar`] rejects
/// surfaces with corners. This list has the constraints that the shape of the bodies needs:
///
/// 1. [`Mortar`] of the whole surfaces;
/// 2. [`NodeToFacet`] of the slave's nodes at sharp edges (in two dimensions: at sharp corners) with the master's
///    facets, and of the master's nodes with the slave's facets;
/// 3. [`EdgeToEdge`], in three dimensions.
///
/// For a surface against itself the constraints are [`NodeToFacet::of_itself`], for corners and faces, and in three
/// dimensions [`EdgeToEdge::of_itself`].
///
/// Smooth bodies have the first one only, without extra cost. Where a face with its edges lies on a face there are
/// more rows than independent gaps. Then the multipliers have the least norm, and only their sums are meaningful.
///
/// Give the whole surfaces of both bodies, as [`Surface::of_cells`](super::Surface::of_cells) finds them. No edge
/// counts as sharp where a surface ends, because the surface behind it is unknown.
///
/// # Known failure
///
/// - With a compliant law the springs of faces, corners and edges act side by side: contact is stiffer at edges.
/// - As with [`Mortar`], nodes within faces are kept out only in the mean over their facets: they penetrate by a
///   tenth of an element in blocks that fall on edges (`docs/contact.md` has a table). A surface against itself has
///   no weighted gaps; its pressures come from nodes on facets.
///
/// ```
/// use contact_dynamics::contact::BodyContact;
/// use contact_dynamics::faer::sparse::SparseColMat;
/// use contact_dynamics::{Composite, LinearSystem, Simulation};
///
/// // A square of nodes on its corner, 0.1 above a square with sides along the axes; bodies on the left of the way.
/// let coordinates = [
///     [-1.0, -2.0], [1.0, -2.0], [1.0, 0.0], [-1.0, 0.0],
///     [0.0, 0.1], [1.0, 1.1], [0.0, 2.1], [-1.0, 1.1],
/// ];
/// let dofs: Vec<[usize; 2]> = (0..8).map(|node| [2 * node, 2 * node + 1]).collect();
/// let sides = |first: usize| (0..4).map(move |k| [first + k, first + (k + 1) % 4]);
/// let contact = BodyContact::new(&coordinates, &dofs, sides(4), sides(0))?;
/// assert_eq!(contact.sharp_nodes(), &[vec![4, 5, 6, 7], vec![0, 1, 2, 3]]);
///
/// // Nodes without springs, of which the lower ones are held and the corner falls.
/// let free = SparseColMat::<usize, f64>::try_new_from_triplets(16, 16, &[])?;
/// let mut system = LinearSystem::lumped(vec![1.0; 16], free)?;
/// for dof in 0..8 {
///     system = system.fix(dof)?;
/// }
/// let mut velocity = vec![0.0; 16];
/// velocity[9] = -1.0;
/// let mut run = Simulation::builder(system, Composite, 0.01)
///     .velocity(velocity)
///     .constraints(contact.constraints()?)
///     .build()?;
/// run.run_until(0.2, &mut ())?;
/// assert!((run.state().displacement()[9] + 0.1_f64).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct BodyContact<T: Real, const D: usize> {
    coordinates: Vec<[T; D]>,
    dofs: Vec<[usize; D]>,
    /// Facets of the slave and of the master; for a surface against itself all facets, and none.
    facets: [Vec<Facet>; 2],
    sharp: [Vec<usize>; 2],
    /// For a surface against itself, the number of rings of facets around a node that are excluded.
    rings: Option<usize>,
    offsets: Option<Vec<T>>,
    ramp: Option<[[f64; 2]; 2]>,
    angle: f64,
    law: ContactLaw,
    friction: f64,
    reach: Option<T>,
}

impl<T: Real, const D: usize> BodyContact<T, D> {
    /// Contact of the whole surfaces of two bodies, given by their facets. Choose the slave of the weighted gaps as
    /// for [`Mortar`].
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh, in two or three dimensions, and `dofs` the
    /// dofs of their displacements. Facets list nodes by their index there, and their normals point out of the bodies
    /// ([`Facet`]). The two surfaces must not share a node. The law is [`ContactLaw::Rigid`] by default, see
    /// [`with_law`](Self::with_law).
    ///
    /// # Errors
    ///
    /// Those of [`Mortar::new`], except that corners and edges are accepted.
    pub fn new<F: Into<Facet>, G: Into<Facet>>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        slave: impl IntoIterator<Item = F>,
        master: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let facets = [slave.into_iter().map(Into::into).collect(), master.into_iter().map(Into::into).collect()];
        Self::between(coordinates, dofs, facets, None)
    }

    /// Contact of a surface with itself, for a body that folds or for any number of bodies whose surfaces are given
    /// as one: every node with all facets that are not around it, and every edge with all edges that are not near it
    /// on its body. No pairs of bodies need to be listed. [`NodeToFacet::of_itself`] describes the facets excluded
    /// for a node. No body may penetrate itself in the reference configuration.
    ///
    /// Give the whole surfaces, as [`Surface::of_cells`](super::Surface::of_cells) finds them of all bodies at once.
    ///
    /// ```
    /// use contact_dynamics::contact::{BodyContact, Surface};
    ///
    /// // Three cubes, one upon the other, 0.1 apart.
    /// let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
    /// let heights = [0.0, 1.0, 1.1, 2.1, 2.2, 3.2];
    /// let coordinates: Vec<[f64; 3]> =
    ///     heights.iter().flat_map(|&z| corners.map(|[x, y]| [f64::from(x), f64::from(y), z])).collect();
    /// let dofs: Vec<[usize; 3]> = (0..24).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
    /// let cells = [0, 8, 16].map(|first| [0, 1, 2, 3, 4, 5, 6, 7].map(|node| first + node));
    /// let surface = Surface::of_cells(&coordinates, cells)?;
    /// let contact = BodyContact::of_itself(&coordinates, &dofs, &surface)?;
    /// // Nodes on facets, and edges on edges.
    /// assert_eq!(contact.constraints()?.len(), 2);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`NodeToFacet::of_itself`].
    pub fn of_itself<F: Into<Facet>>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        Self::between(coordinates, dofs, [facets.into_iter().map(Into::into).collect(), Vec::new()], Some(1))
    }

    fn between(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        facets: [Vec<Facet>; 2],
        rings: Option<usize>,
    ) -> Result<Self> {
        let mut contact = Self {
            coordinates: coordinates.to_vec(),
            dofs: dofs.to_vec(),
            facets,
            sharp: [Vec::new(), Vec::new()],
            rings,
            offsets: None,
            ramp: None,
            angle: edge_to_edge::SHARP,
            law: ContactLaw::Rigid,
            friction: 0.0,
            reach: None,
        };
        contact.find_sharp_nodes()?;
        Ok(contact)
    }

    /// Sets the number of rings of facets around a node or an edge that are excluded for [a surface against
    /// itself](Self::of_itself); 1 by default ([`NodeToFacet::rings`]). Without effect for two surfaces.
    #[must_use]
    pub fn rings(mut self, rings: usize) -> Self {
        self.rings = self.rings.map(|_| rings);
        self
    }

    /// Sets how far (length) the surfaces of the bodies lie outside of their facets, by node of the mesh. Faces are
    /// offset by this length ([`Mortar::offsets`], [`NodeToFacet::offsets`]); edges and corners are rounded with this
    /// radius ([`EdgeToEdge::offsets`]).
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`](crate::Error::Dimension) unless there is one offset per node of the mesh;
    /// [`constraints`](Self::constraints) reports the other errors.
    pub fn offsets(mut self, offsets: &[T]) -> Result<Self> {
        Thickness::default().set(offsets, self.coordinates.len())?;
        self.offsets = Some(offsets.to_vec());
        Ok(self)
    }

    /// Scales all [`offsets`](Self::offsets) in time, as [`Mortar::ramp`].
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless all values are finite and the second time is later.
    pub fn ramp(mut self, times: [f64; 2], factors: [f64; 2]) -> Result<Self> {
        Ramp::new(times, factors)?;
        self.ramp = Some([times, factors]);
        Ok(self)
    }

    /// Sets the law of all rows.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Sets Coulomb's friction with a coefficient μ ≥ 0 in all rows.
    #[must_use]
    pub fn friction(mut self, coefficient: f64) -> Self {
        self.friction = coefficient;
        self
    }

    /// Sets the least distance (length), outside and inside, at which facets and edges are found. The default is the
    /// mean size of the facets: of the coarser surface for faces and edges, of the surface with the facets for corners.
    /// The motion within a step is added by the velocities.
    #[must_use]
    pub fn reach(mut self, reach: T) -> Self {
        self.reach = Some(reach);
        self
    }

    /// Sets the angle (radians) from which convex sides, or nodes in two dimensions, are sharp: the angle between the
    /// normals of their facets in the reference configuration; 30° by default.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless the angle is from 0 to π.
    pub fn sharp(mut self, angle: f64) -> Result<Self> {
        edge_to_edge::check_angle(angle)?;
        self.angle = angle;
        self.find_sharp_nodes()?;
        Ok(self)
    }

    /// The nodes at sharp edges and corners of the slave, and of the master, ascending; for a surface against itself
    /// the same list twice.
    pub fn sharp_nodes(&self) -> &[Vec<usize>; 2] {
        &self.sharp
    }

    fn find_sharp_nodes(&mut self) -> Result<()> {
        if self.rings.is_some() {
            let nodes = Nodes::new(&self.coordinates, &self.dofs)?;
            let surface = Surface::of_facets(self.facets[0].iter().copied(), D, &nodes.coordinates)?;
            let sharp = surface.sharp_nodes(self.angle, &nodes.coordinates);
            self.sharp = [sharp.clone(), sharp];
            return Ok(());
        }
        let [slave, master] = self.facets.each_ref().map(|facets| facets.iter().copied());
        let (nodes, surfaces) = Nodes::with_surfaces(&self.coordinates, &self.dofs, slave, master)?;
        self.sharp = surfaces.map(|surface| surface.sharp_nodes(self.angle, &nodes.coordinates));
        Ok(())
    }

    /// The constraints in this order: weighted gaps, the slave's sharp nodes on the master's facets, the master's on
    /// the slave's, edges on edges. For a surface against itself: nodes on facets, edges on edges. Without sharp
    /// nodes or edges their constraints are left out.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless the reach is positive and finite.
    pub fn constraints(self) -> Result<Vec<Box<dyn ContactConstraint<T>>>> {
        let Self { coordinates, dofs, facets, sharp, rings, .. } = &self;
        let of = |body: usize| facets[body].iter().copied();
        let mut constraints: Vec<Box<dyn ContactConstraint<T>>> = Vec::new();
        if let Some(rings) = *rings {
            let nodes = NodeToFacet::of_itself(coordinates, dofs, of(0))?.rings(rings);
            constraints.push(Box::new(self.given(nodes)?));
        } else {
            let faces = Mortar::without_corner_check(coordinates, dofs, of(0), of(1))?;
            constraints.push(Box::new(self.given(faces)?));
            for (body, nodes) in sharp.iter().enumerate().filter(|(_, nodes)| !nodes.is_empty()) {
                let corners = NodeToFacet::one_pass(coordinates, dofs, nodes, of(1 - body))?.facing(of(body))?;
                constraints.push(Box::new(self.given(corners)?));
            }
        }
        if D == 3 && sharp.iter().all(|nodes| !nodes.is_empty()) {
            let places: Vec<[T; 3]> = coordinates.iter().map(|x| std::array::from_fn(|i| x[i])).collect();
            let dofs: Vec<[usize; 3]> = dofs.iter().map(|dofs| std::array::from_fn(|i| dofs[i])).collect();
            let edges = match *rings {
                Some(rings) => EdgeToEdge::of_itself(&places, &dofs, of(0))?.rings(rings),
                None => EdgeToEdge::new(&places, &dofs, of(0), of(1))?,
            };
            constraints.push(Box::new(self.given(edges.sharp(self.angle)?)?));
        }
        Ok(constraints)
    }

    /// Applies the settings to one of the constraints.
    fn given<C: Part<T>>(&self, part: C) -> Result<C> {
        let mut part = part.with_law(self.law).friction(self.friction);
        if let Some(reach) = self.reach {
            part = part.reach(reach)?;
        }
        if let Some(offsets) = &self.offsets {
            part = part.offsets(offsets)?;
        }
        match self.ramp {
            Some([times, factors]) => part.ramp(times, factors),
            None => Ok(part),
        }
    }
}

/// The settings that all constraints of the list have.
trait Part<T: Real>: Sized {
    fn with_law(self, law: ContactLaw) -> Self;
    fn friction(self, coefficient: f64) -> Self;
    fn reach(self, reach: T) -> Result<Self>;
    fn offsets(self, offsets: &[T]) -> Result<Self>;
    fn ramp(self, times: [f64; 2], factors: [f64; 2]) -> Result<Self>;
}

macro_rules! part {
    ($($constraint:ident),*) => {$(
        impl<T: Real> Part<T> for $constraint<T> {
            fn with_law(self, law: ContactLaw) -> Self {
                $constraint::with_law(self, law)
            }

            fn friction(self, coefficient: f64) -> Self {
                $constraint::friction(self, coefficient)
            }

            fn reach(self, reach: T) -> Result<Self> {
                $constraint::reach(self, reach)
            }

            fn offsets(self, offsets: &[T]) -> Result<Self> {
                $constraint::offsets(self, offsets)
            }

            fn ramp(self, times: [f64; 2], factors: [f64; 2]) -> Result<Self> {
                $constraint::ramp(self, times, factors)
            }
        }
    )*};
}

part!(Mortar, NodeToFacet, EdgeToEdge);
