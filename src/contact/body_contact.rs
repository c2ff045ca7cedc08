//! Contact of two or more bodies with faces, corners and edges: the constraints that keep them apart.

use super::surface::{Facet, Nodes, Surface};
use super::{ContactConstraint, EdgeToEdge, Mortar, NodeToFacet, SurfaceSettings, surface_settings};
use crate::error::Result;
use crate::real::Real;
use std::f64::consts::FRAC_PI_6;

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
/// 3. [`EdgeToEdge`], in three dimensions, if both bodies have sharp edges.
///
/// For a surface against itself the constraints are [`NodeToFacet::of_itself`], for corners and faces, and in three
/// dimensions [`EdgeToEdge::of_itself`]. Where edges have rows, a node that is outside an edge and behind the facet
/// that ends there has none.
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
///   tenth of an element in blocks that fall on edges (`docs/measured/contact.md` has a table). A surface against
///   itself has no weighted gaps; its pressures come from nodes on facets.
///
/// ```
/// use contact_dynamics::contact::BodyContact;
/// use contact_dynamics::faer::sparse::SparseColMat;
/// use contact_dynamics::{GeneralizedAlpha, LinearSystem, Simulation};
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
/// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 0.01)
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
    is_of_itself: bool,
    settings: SurfaceSettings<T>,
}

surface_settings!(BodyContact<T, D>);

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
    ///
    /// [`ContactLaw::Rigid`]: crate::ContactLaw::Rigid
    pub fn new<F: Into<Facet>, G: Into<Facet>>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        slave: impl IntoIterator<Item = F>,
        master: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let facets = [slave.into_iter().map(Into::into).collect(), master.into_iter().map(Into::into).collect()];
        Self::between(coordinates, dofs, facets, false)
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
        Self::between(coordinates, dofs, [facets.into_iter().map(Into::into).collect(), Vec::new()], true)
    }

    fn between(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        facets: [Vec<Facet>; 2],
        is_of_itself: bool,
    ) -> Result<Self> {
        let mut contact = Self {
            coordinates: coordinates.to_vec(),
            dofs: dofs.to_vec(),
            facets,
            sharp: [Vec::new(), Vec::new()],
            is_of_itself,
            settings: SurfaceSettings::new(),
        };
        contact.apply_settings()?;
        Ok(contact)
    }

    /// The nodes at sharp edges and corners of the slave, and of the master, ascending; for a surface against itself
    /// the same list twice.
    pub fn sharp_nodes(&self) -> &[Vec<usize>; 2] {
        &self.sharp
    }

    /// Checks the settings, and finds the sharp nodes.
    fn apply_settings(&mut self) -> Result<()> {
        self.settings.check(self.coordinates.len())?;
        let angle = self.settings.sharp_angle(FRAC_PI_6);
        if self.is_of_itself {
            let nodes = Nodes::new(&self.coordinates, &self.dofs)?;
            let surface = Surface::of_facets(self.facets[0].iter().copied(), D, &nodes.coordinates)?;
            let sharp = surface.sharp_nodes(angle, &nodes.coordinates);
            self.sharp = [sharp.clone(), sharp];
            return Ok(());
        }
        let [slave, master] = self.facets.each_ref().map(|facets| facets.iter().copied());
        let (nodes, surfaces) = Nodes::with_surfaces(&self.coordinates, &self.dofs, slave, master)?;
        self.sharp = surfaces.map(|surface| surface.sharp_nodes(angle, &nodes.coordinates));
        Ok(())
    }

    /// The constraints in this order: weighted gaps, the slave's sharp nodes on the master's facets, the master's on
    /// the slave's, edges on edges. For a surface against itself: nodes on facets, edges on edges. Without sharp
    /// nodes or edges their constraints are left out.
    ///
    /// # Errors
    ///
    /// Those of the constructors of the constraints, which accept all that [`new`](Self::new) and
    /// [`with`](Self::with) have accepted.
    pub fn constraints(self) -> Result<Vec<Box<dyn ContactConstraint<T>>>> {
        let Self { coordinates, dofs, facets, sharp, is_of_itself, settings } = self;
        let of = |body: usize| facets[body].iter().copied();
        let mut constraints: Vec<Box<dyn ContactConstraint<T>>> = Vec::new();
        let given = || settings.clone();
        let has_edges = D == 3 && sharp.iter().all(|nodes| !nodes.is_empty());
        if is_of_itself {
            let nodes = NodeToFacet::of_itself(&coordinates, &dofs, of(0))?.leaves_edges(has_edges);
            constraints.push(Box::new(nodes.with(given())?));
        } else {
            let faces = Mortar::without_corner_check(&coordinates, &dofs, of(0), of(1))?;
            constraints.push(Box::new(faces.with(given())?));
            for (body, nodes) in sharp.iter().enumerate().filter(|(_, nodes)| !nodes.is_empty()) {
                let corners = NodeToFacet::one_pass(&coordinates, &dofs, nodes, of(1 - body))?.facing(of(body))?;
                constraints.push(Box::new(corners.leaves_edges(has_edges).with(given())?));
            }
        }
        if has_edges {
            let places: Vec<[T; 3]> = coordinates.iter().map(|x| std::array::from_fn(|i| x[i])).collect();
            let dofs: Vec<[usize; 3]> = dofs.iter().map(|dofs| std::array::from_fn(|i| dofs[i])).collect();
            let edges = match is_of_itself {
                true => EdgeToEdge::of_itself(&places, &dofs, of(0))?,
                false => EdgeToEdge::new(&places, &dofs, of(0), of(1))?,
            };
            constraints.push(Box::new(edges.with(given())?));
        }
        Ok(constraints)
    }
}
