//! Contact of the nodes of one deforming surface with the facets of another.

mod candidates;
mod constraint;
mod passage;
mod rows;

#[cfg(doc)]
use super::ContactConstraint;
use super::surface::{Bounds, Cones, Facet, NearestFirst, Nodes, Point, RECOVERY, Surface, Vicinity, add_scaled};
use super::{SurfaceSettings, check_nodes, surface_settings};
use crate::error::{Error, Result};
use crate::real::Real;
use rows::Rows;

/// One direction of contact: slave nodes against a surface.
#[derive(Debug)]
struct Pass {
    nodes: Vec<usize>,
    lists: NearestFirst,
    /// For each node a lower bound of its distance from the surface, at the last search.
    clearance: Vec<f64>,
    /// The boxes of the facets at the last search, which many nodes share.
    boxes: Vec<Bounds>,
}

impl Pass {
    fn new(nodes: Vec<usize>) -> Self {
        let clearance = vec![0.0; nodes.len()];
        Self { clearance, nodes, lists: NearestFirst::default(), boxes: Vec::new() }
    }
}

/// Contact of two deforming surfaces: the nodes of each with the facets of the other. Facets are segments in two
/// dimensions, triangles and bilinear quadrilaterals in three. There are two passes, except in a
/// [`one_pass`](Self::one_pass) contact.
///
/// The gap of a node at x_s is its signed distance from the closest point Σ N_i x_i of the other surface (length;
/// positive outside), `g = n · (x_s − Σ N_i x_i)`. Its row of G is n on the dofs of the node and −N_i n on the dofs
/// of the facet's nodes. Since Σ N_i = 1 and x_s − Σ N_i x_i is parallel to n, contact forces conserve momentum, and
/// angular momentum at the configuration of the search (up to lever arms of √ε of a facet on its sides, see below).
/// Nodes at a depth of up to the [`reach`](SurfaceSettings::reach) are found as well as nodes outside.
///
/// # Linearization
///
/// Each [`search`](ContactConstraint::search), once a step, finds the closest points. Between searches gaps are
/// affine, `g = g* + G (u − u*)`. At each trial state [`follow`](ContactConstraint::follow) projects again, onto the
/// facets in the lists of the search, so that the gaps at the end of the step are the distances there. G is the
/// derivative of the distance. [`rates`](ContactConstraint::rates) contain the second derivative of the distance
/// along the motion, for nodes that slide on facets that turn. Geometry is computed in `f64` in every run.
///
/// The search range includes the distance that a node covers in the step by its velocity relative to the other
/// surface, so that it fits any speed. A step is rejected ([`Error::PassedThrough`], and a smaller step helps) if a
/// node that moves by more than an eighth of a facet is stopped away from the surface or, without a row, goes through
/// a facet; or if a node with a row that moves by more than 0.6 of a facet goes through one, or is stopped along
/// another normal than where it met the surface. Motions and facets count as straight within the step.
///
/// A row lasts for its step. Its facet extends a quarter of its size beyond an open rim, and may turn 19° nearer to
/// the node's own normal than a search with [`facing`](Self::facing) allows, so that a node that slides off a table
/// or turns away finishes its step. A node that moves farther, or beyond the listed facets, is lost. If its gap, by
/// its last row, is above 1 % of the reach, it is open and the row stays. Otherwise the step is rejected
/// ([`Error::ContactLost`], and a smaller step helps). A row also stays if its normal has jumped more than eight
/// times since the search, at one time of the step, between two facets or around an edge that its node touches: an
/// iteration would not converge.
///
/// Around a side or a vertex the curvature of a gap is the reciprocal of its distance. Closer than 1e-3 of the facet,
/// rates leave this curvature out.
///
/// # Which facet, which normal
///
/// A node has one row per pass, from the closest facet, and in a dent one row for each side of it. Inside of a facet
/// n is the facet's normal. If the closest point is on a shared side or vertex, n is the direction between it and the
/// node, so that the gap is continuous when a node passes from one facet to the next. If the node is closer to it
/// than √ε of the facet's longest side (ε of the scalar, 1.5e-8 in `f64`), n is the mean of the facets' normals.
/// Behind a convex edge the closest facet changes at the bisector, and the normal jumps there, but not the gap. A
/// node beyond the rim of an open surface has no row; the surface extends beyond its rim by 1e-3 of the facet.
///
/// A node at the bottom of a dent presses on all sides of it. With one row it would rest on one side and penetrate
/// another, and energy would rise at its recovery. So a node whose distance from the bottom is at most a quarter of a
/// facet plus its displacement in the step has more rows: on the facets that share a vertex with the closest one and
/// rise from there by more than 2.9° (sine 0.05). Within the step the rows of a dent stay on their facets, extended
/// as planes, each along its own normal.
///
/// If a search finds a node deeper than 1e-4 of the smallest facet, for instance because an edge has penetrated
/// beside it, that depth is the penetration recovered per step ([`Contact::recovery`](super::Contact::recovery)).
///
/// On a closed surface the closest point determines whether a node is inside. A surface that is given in part, or a
/// body thinner than the possible penetration, needs the normals of the nodes as well: [`facing`](Self::facing). If
/// the surface of the nodes is known, a node behind a facet is in contact with it only up to half of the material
/// that may lie between: the sum of the thicknesses of both bodies in the reference configuration. So there is no
/// contact through thin bodies, if their whole surfaces are given.
///
/// # Identity
///
/// (index of the node, pass), with pass 0 or 1. The other rows of a dent are (index of the node, pass + 2 (1 +
/// facet)), with the index of their facet in its list. A node that slides from one facet to the next keeps its
/// multiplier; [`facet`](Self::facet) returns the facet.
///
/// # Search
///
/// The bounding boxes of the two surfaces are compared first; if they are apart by more than `reach`, there are no
/// candidates. Otherwise each node tries the facets of its list. Lists hold the facets within `reach` and a
/// [`skin`](SurfaceSettings::skin). They are rebuilt, from an R*-tree, when nodes of the two surfaces have moved by
/// more than the skin relative to each other (in any coordinate). Memory is allocated only then. Bodies that fly
/// together need no rebuilds.
///
/// ```
/// use contact_dynamics::ContactConstraint;
/// use contact_dynamics::contact::{Contacts, NodeToFacet};
///
/// // The top side of a body, walked with the body on the left, and a node 0.1 above it.
/// let coordinates = [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.25, 0.1]];
/// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
/// let mut contact = NodeToFacet::one_pass(&coordinates, &dofs, &[3], [[0, 1], [1, 2]])?;
///
/// // The dofs in the order of the constraint: the dofs of the node come first.
/// assert_eq!(contact.dofs(), [6, 7, 0, 1, 2, 3, 4, 5]);
/// let mut u = [0.0; 8];
/// contact.search(0.0, &u, &[0.0; 8], 0.0)?;
/// let contacts = Contacts::of(&contact);
/// assert_eq!((contacts.len(), contacts.name(0), contact.facet(0)), (1, (3, 0), 1));
/// assert_eq!(contacts.row(0).collect::<Vec<_>>(), [(1, 1.0), (5, -0.25), (7, -0.75)]);
///
/// u[1] = -0.3; // the node is pushed into the body
/// let mut gap = [0.0];
/// contact.gaps(0.0, &u, &mut gap)?;
/// assert!((gap[0] + 0.2_f64).abs() < 1e-15);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct NodeToFacet<T: Real> {
    nodes: Nodes,
    /// Positions at the start and at the end of a step, by node.
    ends: [Vec<Point>; 2],
    /// Facets of pass 0.
    surface: Surface,
    /// The nodes' own facets, if known.
    own_surface: Option<Surface>,
    passes: Vec<Pass>,
    settings: SurfaceSettings<T>,
    vicinity: Vicinity,
    /// Whether other constraints hold what is beside the edges.
    leaves_edges: bool,
    rebuilds: usize,
    /// The cones of the normals of both surfaces at the last search.
    cones: [Cones; 2],
    rows: Rows<T>,
    /// Rows of the search in progress.
    found: Rows<T>,
}

surface_settings!(NodeToFacet<T>);

impl<T: Real> NodeToFacet<T> {
    /// Contact of two surfaces in two passes: nodes of the facets `one` with the facets `other`, and the reverse.
    ///
    /// Two passes treat both surfaces alike. They pass the patch test on meshes that do not match; [one
    /// pass](Self::one_pass) fails it where the nodes are coarser than the facets. Normals of both surfaces are
    /// compared as in [`facing`](Self::facing). Of two nodes that are each other's closest points the sharper one has
    /// a row, or else the one of the first pass. Where a flat interface closes as a whole there are more rows than
    /// independent gaps: then the multipliers have the least norm. On curved surfaces the gaps of both passes cannot
    /// all be zero; neither surface penetrates. The second pass costs one row for each node of `other`, in the search
    /// and in the contact problem.
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh, in two or three dimensions, and `dofs` the
    /// dofs of their displacements. Facets list nodes by their index there; nodes of no facet are not read later. The
    /// two surfaces must not share a node. The law is [`ContactLaw::Rigid`] by default, see
    /// [`with_law`](Self::with_law).
    ///
    /// ```
    /// use contact_dynamics::ContactConstraint;
    /// use contact_dynamics::contact::{Contacts, NodeToFacet};
    ///
    /// // Two sides face each other, 0.1 apart: three nodes below, two above, and a row for each.
    /// let coordinates = [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.25, 0.1], [1.75, 0.1]];
    /// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]];
    /// let mut contact = NodeToFacet::new(&coordinates, &dofs, [[3, 4]], [[0, 1], [1, 2]])?;
    /// contact.search(0.0, &[0.0; 10], &[0.0; 10], 0.0)?;
    /// // Of the lower nodes only the middle one is below the upper side.
    /// assert_eq!(Contacts::of(&contact).len(), 3);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`one_pass`](Self::one_pass).
    ///
    /// [`ContactLaw::Rigid`]: crate::ContactLaw::Rigid
    pub fn new<F: Into<Facet>, G: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        one: impl IntoIterator<Item = F>,
        other: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let one: Vec<Facet> = one.into_iter().map(Into::into).collect();
        let mut nodes: Vec<usize> = one.iter().flat_map(|facet| facet.nodes().iter().copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        if nodes.is_empty() {
            let what = "the list of facets of a contact surface";
            return Err(Error::Empty { what, remedy: "give at least one facet" });
        }
        let mut contact = Self::one_pass(coordinates, dofs, &nodes, other)?.facing(one)?;
        let nodes = contact.surface.nodes().to_vec();
        contact.passes.push(Pass::new(nodes));
        contact.prepare()?;
        Ok(contact)
    }

    /// Contact of `nodes` with `facets` in one pass: the facets' nodes are not in contact with the nodes' own
    /// surface, and may pass between its nodes. Use it for single nodes, beams and cables, and where the nodes are
    /// finer than the facets. On two meshes that do not match the error of the pressure is some percent to a half,
    /// however fine they are ([`new`](Self::new) is exact there on flat surfaces).
    ///
    /// `coordinates`, `dofs` and facets are as in [`new`](Self::new); `nodes` lists nodes by their index.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if D is not 2 or 3, if the lists differ in length, if a facet does not fit D, or if a node
    /// does not exist; [`Error::NotFinite`] for the coordinates (index: node); [`Error::Empty`] without nodes or
    /// facets; [`Error::InvertedFacet`] for a facet without area, folded, or turned against its neighbor;
    /// [`Error::Incompatible`] at a branch of the surface, and for nodes that are repeated or shared by the surfaces.
    pub fn one_pass<F: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        nodes: &[usize],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        let mesh = Nodes::new(coordinates, dofs)?;
        check_nodes("a contact node (at most)", nodes, coordinates.len())?;
        if nodes.is_empty() {
            let what = "the list of contact nodes";
            return Err(Error::Empty { what, remedy: "give at least one node" });
        }
        let surface = Surface::of_facets(facets, D, &mesh.coordinates)?;
        let mut sorted = nodes.to_vec();
        sorted.sort_unstable();
        if let Some([node, ..]) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            let part = format!("contact node {node}");
            return Err(Error::Incompatible { part, reason: "it is listed twice" });
        }
        let mut contact = Self::between(mesh, sorted, surface, None)?;
        contact.prepare()?;
        Ok(contact)
    }

    /// From nodes (ascending), a surface, and the same surface again if it is against itself.
    fn between(mesh: Nodes, nodes: Vec<usize>, surface: Surface, own_surface: Option<Surface>) -> Result<Self> {
        let settings = SurfaceSettings::new();
        Ok(Self {
            ends: [mesh.coordinates.clone(), mesh.coordinates.clone()],
            vicinity: Vicinity::new(&settings, mesh.coordinates.len(), surface.typical(), own_surface.is_some())?,
            nodes: mesh,
            surface,
            own_surface,
            passes: vec![Pass::new(nodes)],
            settings,
            leaves_edges: false,
            rebuilds: 0,
            cones: [Cones::default(), Cones::default()],
            rows: Rows::new(),
            found: Rows::new(),
        })
    }

    /// Contact of a surface with itself: of its nodes with all of its facets that are not around them. Use it for
    /// bodies that fold, and for several bodies whose surfaces are given as one.
    ///
    /// Some facets of a node's own body are excluded. These are the facets within one
    /// [ring](SurfaceSettings::rings), and facets that the node is behind by more than half of the material there, in
    /// the reference configuration. So no body may penetrate itself in that configuration. Facets that do not face
    /// the node are excluded too. As for two surfaces, their normal is within 60° of the node's normal. The limit is
    /// 102° for facets beside the node in the reference configuration, up to two reaches or two facets away, unless
    /// the node is in front of them.
    ///
    /// Facets connected through shared nodes belong to one body. So do the hollows in it: closed parts whose normals
    /// point into them. Of two nodes that are each other's closest points the sharper one has a row, or else the one
    /// with the smaller index. The search range includes the largest relative motion of any two nodes of the surface
    /// within the step. For a body that spins fast it is larger than necessary.
    ///
    /// ```
    /// use contact_dynamics::ContactConstraint;
    /// use contact_dynamics::contact::{Contacts, NodeToFacet, Surface};
    ///
    /// // Two columns of two elements on a beam: their inner sides face each other, 0.5 apart.
    /// let coordinates: Vec<[f64; 2]> = (0..4).flat_map(|j| [0.0, 1.0, 1.5, 2.5].map(|x| [x, f64::from(j)])).collect();
    /// let dofs: Vec<[usize; 2]> = (0..16).map(|node| [2 * node, 2 * node + 1]).collect();
    /// let cells =
    ///     [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [4, 5, 9, 8], [6, 7, 11, 10], [8, 9, 13, 12], [10, 11, 15, 14]];
    /// let surface = Surface::of_cells(&coordinates, cells)?;
    /// let mut contact = NodeToFacet::of_itself(&coordinates, &dofs, &surface)?;
    /// contact.search(0.0, &vec![0.0; contact.dofs().len()], &vec![0.0; contact.dofs().len()], 0.0)?;
    /// let contacts = Contacts::of(&contact);
    /// // One of two opposite nodes has the row; nodes at the foot have the other side within their ring.
    /// let nodes: Vec<usize> = (0..contacts.len()).map(|row| contacts.name(row).0).collect();
    /// assert_eq!(nodes, [9, 13]);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`one_pass`](Self::one_pass) about coordinates, dofs and facets.
    pub fn of_itself<F: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        let mesh = Nodes::new(coordinates, dofs)?;
        let surface = Surface::of_facets(facets, D, &mesh.coordinates)?;
        let mut contact = Self::between(mesh, surface.nodes().to_vec(), surface.clone(), Some(surface))?;
        contact.prepare()?;
        Ok(contact)
    }

    /// Sets whether other constraints hold what is beside the edges.
    pub(super) fn leaves_edges(self, leaves_edges: bool) -> Self {
        Self { leaves_edges, ..self }
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

    /// Index of the facet of a row of the last search, in the list of its pass.
    pub fn facet(&self, row: usize) -> usize {
        self.rows.spots[row].facet
    }

    /// How often the lists of facets have been built. If this is often, a larger [`skin`](SurfaceSettings::skin) may
    /// save time.
    pub fn rebuilds(&self) -> usize {
        self.rebuilds
    }

    fn apply_settings(&mut self) -> Result<()> {
        let (nodes, of_itself) = (self.nodes.coordinates.len(), self.vicinity.is_of_itself());
        self.vicinity = Vicinity::new(&self.settings, nodes, self.surface.typical(), of_itself)?;
        Ok(())
    }

    /// Checks that the bodies share no node, and forgets rows.
    fn prepare(&mut self) -> Result<()> {
        let mut body = self.passes[0].nodes.clone();
        body.extend(self.own_surface.iter().flat_map(Surface::nodes));
        body.sort_unstable();
        body.dedup();
        match self.vicinity.is_of_itself() {
            false => self.nodes.read_bodies([body, self.surface.nodes().to_vec()])?,
            true => self.nodes.read_body(body),
        }
        self.rows.clear();
        self.vicinity.forget();
        Ok(())
    }

    fn finest(&self) -> f64 {
        let own = self.own_surface.as_ref().map_or(f64::INFINITY, Surface::finest);
        self.surface.finest().min(own)
    }

    /// Largest penetration that is recovered in a step.
    fn recovery(&self) -> f64 {
        RECOVERY * self.finest()
    }

    /// Position and velocity of a node.
    fn moving(&self, node: usize, u: &[T], v: &[T]) -> [Point; 2] {
        let moved = self.nodes.vector(node, u);
        [add_scaled(self.nodes.coordinates[node], 1.0, moved), self.nodes.vector(node, v)]
    }
}
