//! Contact of the nodes of one deforming surface with the facets of another.

mod candidates;
mod constraint;
mod passage;
mod rows;
mod settings;

#[cfg(doc)]
use super::ContactConstraint;
use super::surface::{Bounds, Cones, Facet, NearestFirst, Nodes, Point, RECOVERY, Surface, Vicinity, add_scaled};
use super::{ContactLaw, check_nodes};
use crate::error::{Error, Result};
use crate::real::Real;
use rows::Rows;

/// One direction of contact: nodes against a surface.
#[derive(Debug)]
struct Pass {
    nodes: Vec<usize>,
    lists: NearestFirst,
    /// For each node a distance that it has from the surface at least, at the last search.
    clearance: Vec<f64>,
    /// The boxes of the facets at the last search, of which each node looks at many.
    boxes: Vec<Bounds>,
}

impl Pass {
    fn new(nodes: Vec<usize>) -> Self {
        let clearance = vec![0.0; nodes.len()];
        Self { clearance, nodes, lists: NearestFirst::default(), boxes: Vec::new() }
    }
}

/// Contact of two deforming surfaces, of the nodes of each with the facets of the other: segments in two dimensions,
/// triangles and bilinear quadrilaterals in three. Two passes are made, unless [`one_pass`](Self::one_pass) is asked
/// for by name.
///
/// The gap of a node at x_s is its signed distance from the closest point Σ N_i x_i of the other surface,
/// `g = n · (x_s − Σ N_i x_i)` (length; positive outside). Its row of G is n on the dofs of the node and −N_i n on
/// those of the facet's nodes. Since Σ N_i = 1 and x_s − Σ N_i x_i is parallel to n, contact forces conserve momentum,
/// and angular momentum at the configuration of the search (but for lever arms of √ε of a facet on its sides, see
/// below). Nodes at a depth of up to the [`reach`](Self::reach) are found as well as nodes outside.
///
/// # Linearization
///
/// Closest points are found at each [`search`](ContactConstraint::search), that is once a step; in between gaps are
/// affine, `g = g* + G (u − u*)`. Rows follow the contact of a step
/// ([`follow`](ContactConstraint::follow)): closest points are found again at each trial state, in the lists of the
/// search, and at the end of the step gaps are the distances there. G is the derivative of the distance, and
/// [`rates`](ContactConstraint::rates) have its second derivative along the motion, from nodes that slide on facets
/// that turn. Geometry is computed in `f64` in every run.
///
/// What a step brings near is searched, whatever the speed: a node looks as far as its velocity against the other
/// surface takes it. A step is refused ([`Error::PassedThrough`], which a smaller step mends) in which a node, moving
/// by more than an eighth of a facet, has gone through one, or was stopped where the surface is not; or, moving by more
/// than a facet, was stopped along a normal that is not that of the place. Way and facets are taken as straight within
/// the step.
///
/// A row lasts for its step. Its facet goes on a quarter of itself beyond an open rim, and may turn 19° nearer to the
/// node's own normal than [`facing`](Self::facing) lets a search find it, so that a node that slides off a table or
/// turns away ends its step. One that goes farther, or that leaves the facets the search can know of, is lost: a step
/// in which it presses is refused ([`Error::ContactLost`], which a smaller step mends); if its gap is above 1 % of the
/// reach where it was last linearized, it is open, and the row stays as it was. A row whose normal has jumped more than
/// eight times since the search at one time, between two facets or around an edge that its node touches, stays as it
/// was too: there is no normal that an iteration could converge to.
///
/// Around a side or a vertex gaps are curved by their own distance; within 1e-3 of the facet rates leave this out, and
/// are those of the facet.
///
/// # Which facet, which normal
///
/// A node has one row a pass, from the closest facet, and in a dent one for each side of it. Inside of a facet n is the
/// facet's normal. If the closest point is on a side or a vertex that facets share, n is the direction between it and
/// the node, so that the gap is continuous when a node passes from one facet to the next; if the node is closer to it
/// than √ε of the facet's longest side (ε of the scalar, 1.5e-8 in `f64`), n is the mean of the facets' normals. Behind
/// a convex edge the closest facet changes at the bisector, and with it the normal, not the gap. A node that stands
/// beyond the rim of an open surface has no row; by 1e-3 of the facet the surface goes on beyond its rim.
///
/// A node at the bottom of a dent presses on all sides of it. With one row it would come to rest on one side and be
/// inside of another, and energy would rise when it is let out. So a node that is as near to the bottom as a quarter of
/// a facet and its way of the step has rows on the other facets around the vertices of the closest one that rise from
/// there by more than 2.9° (sine 0.05). Within the step rows of a dent stay on their facets, each along its own normal,
/// as if the facet went on beyond the bottom.
///
/// A node that a search finds deeper than 1e-4 of the smallest facet, because an edge has come in beside it for
/// instance, comes out by so much in a step ([`Contact::recovery`](super::Contact::recovery)).
///
/// On a closed surface the closest point tells inside from outside. A surface that is given in part, or a body
/// thinner than the depth that may occur, needs the normals of the nodes as well: [`facing`](Self::facing). Where the
/// surface of the nodes is known, a node is in contact with a facet that it is behind of only up to half of the
/// material that may lie between, of its body and of the other one, as thick as they are in the reference
/// configuration: thin bodies do not meet through each other. Give their whole surfaces.
///
/// # Identity
///
/// (number of the node, pass), passes being 0 and 1; in a dent the others are (number of the node, pass + 2 (1 +
/// facet)), with the index of their facet in its list. A node that slides from one facet to the next keeps its
/// multiplier; [`facet`](Self::facet) tells the facet.
///
/// # Search
///
/// One pass over the nodes compares the bounding boxes of the two surfaces; apart by more than `reach` they have no
/// candidates. Otherwise each node looks at the facets of its list. Lists hold the facets within `reach` and a
/// [`skin`](Self::skin); they are built anew, from an R*-tree, when nodes of the two surfaces have moved by more than
/// the skin relative to each other (in any coordinate). Memory is allocated then and at no other time. Bodies that fly
/// together rebuild nothing.
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
/// // The dofs in the order in which the constraint reads them: those of the node come first.
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
    /// Facets that the nodes meet.
    surface: Surface,
    /// Facets that the nodes belong to, if known.
    own_surface: Option<Surface>,
    passes: Vec<Pass>,
    law: ContactLaw,
    friction: f64,
    vicinity: Vicinity,
    rebuilds: usize,
    /// The cones of the normals of both surfaces at the last search.
    cones: [Cones; 2],
    rows: Rows<T>,
    /// What the search under way finds.
    found: Rows<T>,
}

impl<T: Real> NodeToFacet<T> {
    /// Contact of two surfaces in two passes: the nodes of the facets `one` meet the facets `other`, and the other way
    /// round.
    ///
    /// Two passes treat both surfaces alike, and pass the patch test on meshes that do not match, which
    /// [one pass](Self::one_pass) fails where the nodes are coarser than the facets. Normals of both surfaces are
    /// compared as in
    /// [`facing`](Self::facing). Of two nodes that stand on each other only the first pass makes a row. There are more
    /// rows than independent gaps where a flat interface closes as a whole: the multipliers are then those of least
    /// norm. On curved surfaces the gaps of both passes cannot all be zero; neither penetrates. The second pass costs
    /// its rows: one for each node of `other`, in the search and in the contact problem.
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh, in two or three dimensions, and `dofs` the
    /// dofs of their displacements; facets name nodes by their index there. Nodes that none names are not read later.
    /// The two surfaces share no node. The law is [`ContactLaw::Rigid`], unless [`with_law`](Self::with_law) gives
    /// another.
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
    /// // (Of the lower nodes only the middle one is below the upper side.)
    /// assert_eq!(Contacts::of(&contact).len(), 3);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`one_pass`](Self::one_pass).
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

    /// Contact of `nodes` with `facets` in one pass: facets do not meet the nodes' own surface, and may pass between
    /// its nodes. For single nodes, beams and cables, and where the nodes are finer than the facets; on two meshes that
    /// do not match pressure errs by some percent to a half, however fine they are ([`new`](Self::new) is exact there
    /// where surfaces are flat).
    ///
    /// `coordinates`, `dofs` and facets are those of [`new`](Self::new); `nodes` names nodes by their index.
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
        let mut contact = Self::between(mesh, sorted, surface);
        contact.prepare()?;
        Ok(contact)
    }

    /// Of nodes (ascending) with a surface, before its memory is reserved.
    fn between(mesh: Nodes, nodes: Vec<usize>, surface: Surface) -> Self {
        Self {
            ends: [mesh.coordinates.clone(), mesh.coordinates.clone()],
            nodes: mesh,
            vicinity: Vicinity::new(surface.typical()),
            surface,
            own_surface: None,
            passes: vec![Pass::new(nodes)],
            law: ContactLaw::Rigid,
            friction: 0.0,
            rebuilds: 0,
            cones: [Cones::default(), Cones::default()],
            rows: Rows::with_capacity(0, 0),
            found: Rows::with_capacity(0, 0),
        }
    }

    /// Contact of a surface with itself: of its nodes with all of its facets that are not around them. For bodies that
    /// fold, and for several bodies whose surfaces are given as one.
    ///
    /// Of the facets of its own body a node does not meet those within one [ring](Self::rings), and those behind it by
    /// more than half of the material there, as it is thick in the reference configuration. So no body may be inside of
    /// itself there. Nor does it meet those that do not face it: normals within 60° of each other, as of two surfaces;
    /// of facets beside it in the reference configuration, by two reaches or two facets, within 102°, but where the
    /// node is in front of them. Facets that share nodes, with one another or through others, are those of one body,
    /// and so are the hollows in it: closed parts whose normals point into them. Of two nodes that stand on each other the sharper
    /// one has a row, or else that with the smaller number. A search reaches as far as any two nodes of the surface
    /// move against each other within the step: a body that spins fast looks farther than it must.
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
    /// // (Of two nodes right opposite one has the row; those at the foot have the other side within their ring.)
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
        let mut contact = Self::between(mesh, surface.nodes().to_vec(), surface.clone());
        contact.vicinity = Vicinity::of_itself(surface.typical());
        contact.own_surface = Some(surface);
        contact.prepare()?;
        Ok(contact)
    }

    /// Index of the facet that a row of the last search stands on, in the list of its pass.
    pub fn facet(&self, row: usize) -> usize {
        self.rows.stands[row].facet
    }

    /// How often the lists of facets have been built: many times in a run, and a larger [`skin`](Self::skin) may pay.
    pub fn rebuilds(&self) -> usize {
        self.rebuilds
    }

    /// Checks that the bodies share no node, and reserves memory for rows.
    fn prepare(&mut self) -> Result<()> {
        let mut body = self.passes[0].nodes.clone();
        body.extend(self.own_surface.iter().flat_map(Surface::nodes));
        body.sort_unstable();
        body.dedup();
        match self.vicinity.is_of_itself() {
            false => self.nodes.read_bodies([body, self.surface.nodes().to_vec()])?,
            true => self.nodes.read_body(body),
        }
        let (rows, entries) = self.most();
        self.rows = Rows::with_capacity(rows, entries);
        self.found = Rows::with_capacity(rows, entries);
        self.vicinity.forget();
        Ok(())
    }

    /// Room for rows and for their entries: for two a node, as some are in dents.
    fn most(&self) -> (usize, usize) {
        let surfaces = [Some(&self.surface), self.own_surface.as_ref()];
        let entries = |(pass, surface): (&Pass, &Surface)| {
            let vertices = surface.facets().iter().map(|facet| facet.nodes().len()).max().unwrap_or(0);
            pass.nodes.len() * self.nodes.dimension * (1 + vertices)
        };
        let rows: usize = self.passes.iter().map(|pass| pass.nodes.len()).sum();
        let entries: usize = self.passes.iter().zip(surfaces.into_iter().flatten()).map(entries).sum();
        (2 * rows, 2 * entries)
    }

    /// The size of the smallest facet of all passes.
    fn finest(&self) -> f64 {
        let own = self.own_surface.as_ref().map_or(f64::INFINITY, Surface::finest);
        self.surface.finest().min(own)
    }

    /// How far a node that is inside comes out in a step.
    fn recovery(&self) -> f64 {
        RECOVERY * self.finest()
    }

    /// Shares of a facet below which closeness to a side or a vertex is rounding.
    fn rounding() -> f64 {
        T::epsilon().value().sqrt()
    }

    /// Position and velocity of a node.
    fn moving(&self, node: usize, u: &[T], v: &[T]) -> [Point; 2] {
        let moved = self.nodes.vector(node, u);
        [add_scaled(self.nodes.coordinates[node], 1.0, moved), self.nodes.vector(node, v)]
    }
}
