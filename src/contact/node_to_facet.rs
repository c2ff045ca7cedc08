//! Contact of the nodes of one deforming surface with the facets of another.

mod geometry;
mod passage;
mod search;
mod stand;
mod surface;

use super::{Candidates, ContactConstraint, ContactId, ContactJacobian, ContactLaw, GapRates, Stride, check_mesh};
use crate::error::{Error, Result, positive};
use crate::real::Real;
use geometry::{Point, Shape};
use search::{Bounds, Neighborhood, overhang};
use stand::{Ground, Stand};
use surface::Surface;

/// A facet of a surface: the numbers of its 2, 3 or 4 nodes.
///
/// Its normal points out of the body: a segment (two dimensions) is walked with the body on the left, a triangle or a
/// bilinear quadrilateral (three dimensions) goes counter-clockwise if seen from outside.
///
/// ```
/// use contact_dynamics::contact::Facet;
/// let mixed = [Facet::from([0, 1, 2]), Facet::from([1, 3, 4, 2])];
/// assert_eq!(mixed[1].nodes(), [1, 3, 4, 2]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facet {
    nodes: [usize; 4],
    count: usize,
}

impl From<[usize; 2]> for Facet {
    fn from([i, j]: [usize; 2]) -> Self {
        Self { nodes: [i, j, j, j], count: 2 }
    }
}

impl From<[usize; 3]> for Facet {
    fn from([i, j, k]: [usize; 3]) -> Self {
        Self { nodes: [i, j, k, k], count: 3 }
    }
}

impl From<[usize; 4]> for Facet {
    fn from(nodes: [usize; 4]) -> Self {
        Self { nodes, count: 4 }
    }
}

impl Facet {
    /// The nodes in the order given.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes[..self.count]
    }

    fn shape(&self, positions: &[Point]) -> Shape {
        Shape::new(self.nodes.map(|node| positions[node]), self.count)
    }
}

/// The rows that a search found, where they are linearized.
#[derive(Debug)]
struct Rows<T> {
    jacobian: ContactJacobian<T>,
    /// (node, pass)
    identities: Vec<(usize, usize)>,
    stands: Vec<Stand>,
    /// Displacements there, one an entry of G.
    displacements: Vec<T>,
}

impl<T: Real> Rows<T> {
    fn with_capacity(rows: usize, entries: usize) -> Self {
        Self {
            jacobian: ContactJacobian::with_capacity(rows, entries),
            identities: Vec::with_capacity(rows),
            stands: Vec::with_capacity(rows),
            displacements: Vec::with_capacity(entries),
        }
    }

    fn clear(&mut self) {
        self.jacobian.clear();
        self.identities.clear();
        self.stands.clear();
        self.displacements.clear();
    }

    /// Appends the row of a node on the vertices of a facet.
    fn push<'a>(
        &mut self,
        (node, pass): (usize, usize),
        stand: Stand,
        vertices: &[usize],
        dofs: impl Fn(usize) -> &'a [usize],
        u: &[T],
    ) {
        let entries = std::iter::once((node, 1.0)).chain(vertices.iter().copied().zip(stand.weights.map(|w| -w)));
        for (node, share) in entries {
            for (&dof, &component) in dofs(node).iter().zip(&stand.normal) {
                let weight = T::of(share * component);
                if weight != T::zero() {
                    self.jacobian.dofs.push(dof);
                    self.jacobian.weights.push(weight);
                    self.displacements.push(u[dof]);
                }
            }
        }
        self.jacobian.pointers.push(self.jacobian.dofs.len());
        self.identities.push((node, pass));
        self.stands.push(stand);
    }

    /// Appends a row as another list has it.
    fn keep(&mut self, other: &Self, row: usize) {
        let range = other.jacobian.pointers[row]..other.jacobian.pointers[row + 1];
        self.jacobian.dofs.extend_from_slice(&other.jacobian.dofs[range.clone()]);
        self.jacobian.weights.extend_from_slice(&other.jacobian.weights[range.clone()]);
        self.displacements.extend_from_slice(&other.displacements[range]);
        self.jacobian.pointers.push(self.jacobian.dofs.len());
        self.identities.push(other.identities[row]);
        self.stands.push(other.stands[row]);
    }

    /// The gap of a row at u.
    fn gap(&self, row: usize, u: &[T]) -> T {
        let Self { jacobian, stands, displacements, .. } = self;
        let start = &displacements[jacobian.pointers[row]..jacobian.pointers[row + 1]];
        let moved = jacobian.row(row).zip(start).map(|((dof, weight), &start)| weight * (u[dof] - start));
        T::of(stands[row].gap) + moved.sum()
    }
}

/// One direction of contact: nodes against a surface.
#[derive(Debug)]
struct Pass {
    nodes: Vec<usize>,
    neighborhood: Neighborhood,
    /// For each node a distance that it has from the surface at least, at the last search.
    clearance: Vec<f64>,
}

impl Pass {
    fn new(nodes: Vec<usize>) -> Self {
        Self { clearance: vec![0.0; nodes.len()], nodes, neighborhood: Neighborhood::default() }
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
/// A node has at most one row a pass, from the closest facet. Inside of a facet n is the facet's normal. If the closest
/// point is on a side or a vertex that facets share, n is the direction between it and the node, so that the gap is
/// continuous when a node passes from one facet to the next; if the node is closer to it than √ε of the facet's longest
/// side (ε of the scalar, 1.5e-8 in `f64`), n is the mean of the facets' normals. Behind a convex edge the closest
/// facet changes at the bisector, and with it the normal, not the gap. A node that stands beyond the rim of an open
/// surface has no row; by 1e-3 of the facet the surface goes on beyond its rim.
///
/// On a closed surface the closest point tells inside from outside. A surface that is given in part, or a body
/// thinner than the depth that may occur, needs the normals of the nodes as well: [`facing`](Self::facing).
///
/// # Identity
///
/// (number of the node, pass). A node that slides from one facet to the next keeps its multiplier;
/// [`facet`](Self::facet) tells the facet.
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
/// use contact_dynamics::contact::{ContactJacobian, NodeToFacet};
///
/// // The top side of a body, walked with the body on the left, and a node 0.1 above it.
/// let coordinates = [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.25, 0.1]];
/// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
/// let mut contact = NodeToFacet::one_pass(&coordinates, &dofs, &[3], [[0, 1], [1, 2]])?;
///
/// let mut u = [0.0; 8];
/// contact.search(0.0, &u, &[0.0; 8], 0.0)?;
/// assert_eq!(contact.candidates(), 1);
/// assert_eq!(contact.identity(0), (3, 0));
/// assert_eq!(contact.facet(0), 1);
///
/// let mut g = ContactJacobian::default();
/// contact.jacobian(&mut g);
/// assert_eq!(g.row(0).collect::<Vec<_>>(), [(7, 1.0), (3, -0.25), (5, -0.75)]);
///
/// u[7] = -0.3; // the node is pushed into the body
/// let mut gap = [0.0];
/// contact.gap(0.0, &u, &mut gap);
/// assert!((gap[0] + 0.2_f64).abs() < 1e-15);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct NodeToFacet<T: Real> {
    dimension: usize,
    /// Reference coordinates, by node.
    coordinates: Vec<Point>,
    /// Dofs of the displacement, by node; the first `dimension` count.
    dofs: Vec<[usize; 3]>,
    /// Positions now and when the lists were built, by node.
    positions: Vec<Point>,
    built_at: Vec<Point>,
    /// How far from a node the lists hold all facets, where they were built.
    listed: f64,
    /// Positions at the start and at the end of a step, by node.
    ends: [Vec<Point>; 2],
    /// Facets that the nodes meet.
    surface: Surface,
    /// Facets that the nodes belong to, if known.
    own_surface: Option<Surface>,
    /// All nodes of the two bodies: the one of the nodes, the one of the facets.
    bodies: [Vec<usize>; 2],
    passes: Vec<Pass>,
    law: ContactLaw,
    reach: f64,
    skin: Option<f64>,
    rebuilds: usize,
    largest_dof: usize,
    /// The node that a node of the first pass stands on exactly.
    partners: Vec<Option<usize>>,
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
    /// use contact_dynamics::contact::NodeToFacet;
    ///
    /// // Two sides face each other, 0.1 apart: three nodes below, two above, and a row for each.
    /// let coordinates = [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.25, 0.1], [1.75, 0.1]];
    /// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]];
    /// let mut contact = NodeToFacet::new(&coordinates, &dofs, [[3, 4]], [[0, 1], [1, 2]])?;
    /// contact.search(0.0, &[0.0; 10], &[0.0; 10], 0.0)?;
    /// // (Of the lower nodes only the middle one is below the upper side.)
    /// assert_eq!((contact.max_candidates(), contact.candidates()), (5, 3));
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
    /// do not match pressure errs by some percent to a half ([`new`](Self::new) is exact there).
    ///
    /// `coordinates`, `dofs` and facets are those of [`new`](Self::new); `nodes` names nodes by their index.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if D is not 2 or 3, if the lists differ in length, if a facet does not fit D, or if a node
    /// does not exist; [`Error::NotFinite`] for the coordinates (index: node); [`Error::Empty`] without nodes or
    /// facets; [`Error::Incompatible`] for a facet without area, folded, turned
    /// against its neighbor or at a branch of the surface, and for nodes that are repeated or shared by the surfaces.
    pub fn one_pass<F: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        nodes: &[usize],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        if D != 2 && D != 3 {
            return Err(Error::Dimension { what: "a point of a contact surface", expected: 3, found: D });
        }
        check_mesh(coordinates, dofs, nodes)?;
        if nodes.is_empty() {
            let what = "the list of contact nodes";
            return Err(Error::Empty { what, remedy: "give at least one node" });
        }
        let coordinates: Vec<_> = coordinates.iter().map(|x| std::array::from_fn(|i| component(x, i))).collect();
        let dofs: Vec<[usize; 3]> =
            dofs.iter().map(|dofs| std::array::from_fn(|i| dofs.get(i).copied().unwrap_or(0))).collect();
        let surface = Surface::new(facets.into_iter().map(Into::into).collect(), D, &coordinates)?;
        let reach = surface.typical();
        let mut sorted = nodes.to_vec();
        sorted.sort_unstable();
        if let Some([node, ..]) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            let part = format!("contact node {node}");
            return Err(Error::Incompatible { part, reason: "it is listed twice" });
        }
        let bodies = [sorted, surface.nodes().to_vec()];
        let mut contact = Self {
            dimension: D,
            positions: coordinates.clone(),
            built_at: Vec::new(),
            listed: 0.0,
            ends: [coordinates.clone(), coordinates.clone()],
            coordinates,
            dofs,
            surface,
            own_surface: None,
            passes: vec![Pass::new(bodies[0].clone())],
            bodies,
            law: ContactLaw::Rigid,
            reach,
            skin: None,
            rebuilds: 0,
            largest_dof: 0,
            partners: Vec::new(),
            rows: Rows::with_capacity(0, 0),
            found: Rows::with_capacity(0, 0),
        };
        contact.prepare()?;
        Ok(contact)
    }

    /// The law of all rows.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// How far (length) outside and inside of the facets a node is found at least; by default the mean size of the
    /// facets. What the velocities bring near within a step is found as well, so that no reach must fit the speed.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn reach(mut self, reach: T) -> Result<Self> {
        self.reach = positive("the reach of a contact search", reach.value())?;
        self.built_at.clear();
        Ok(self)
    }

    /// How far (length) nodes of the two surfaces may move relative to each other before lists of facets are built
    /// anew; if not given, half of what is searched. It changes the cost, not the result.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn skin(mut self, skin: T) -> Result<Self> {
        self.skin = Some(positive("the skin of a contact search", skin.value())?);
        self.built_at.clear();
        Ok(self)
    }

    /// Tells the facets that the nodes belong to: a node then meets only facets turned against its own normal, which is
    /// the mean of its facets' normals (refused: an angle of less than 60° between the two).
    ///
    /// This keeps a node from the far side of a thin body, and from facets that it comes to from behind.
    ///
    /// # Errors
    ///
    /// As those of [`one_pass`](Self::one_pass) about facets.
    pub fn facing<F: Into<Facet>>(mut self, facets: impl IntoIterator<Item = F>) -> Result<Self> {
        let own = Surface::new(facets.into_iter().map(Into::into).collect(), self.dimension, &self.coordinates)?;
        let body = &mut self.bodies[0];
        body.clone_from(&self.passes[0].nodes);
        body.extend(own.nodes());
        body.sort_unstable();
        body.dedup();
        self.own_surface = Some(own);
        self.passes.truncate(1);
        self.prepare()?;
        Ok(self)
    }

    /// Index of the facet that a row of the last search stands on, in the list of its pass.
    pub fn facet(&self, row: usize) -> usize {
        self.rows.stands[row].facet
    }

    /// How often the lists of facets have been built: many times in a run, and a larger [`skin`](Self::skin) may pay.
    pub fn rebuilds(&self) -> usize {
        self.rebuilds
    }

    /// Checks that the bodies share no node, and reserves memory for all rows there can be.
    fn prepare(&mut self) -> Result<()> {
        let [one, other] = &self.bodies;
        if let Some(node) = one.iter().find(|node| other.binary_search(node).is_ok()) {
            let part = format!("contact node {node}");
            return Err(Error::Incompatible { part, reason: "it belongs to both surfaces" });
        }
        let dofs = self.bodies.iter().flatten().flat_map(|&node| &self.dofs[node][..self.dimension]);
        self.largest_dof = dofs.copied().max().unwrap_or(0);
        let (rows, entries) = (self.max_candidates(), self.max_entries());
        self.rows = Rows::with_capacity(rows, entries);
        self.found = Rows::with_capacity(rows, entries);
        self.partners = vec![None; if self.passes.len() > 1 { self.coordinates.len() } else { 0 }];
        self.built_at.clear();
        Ok(())
    }

    /// Shares of a facet below which closeness to a side or a vertex is rounding.
    fn rounding() -> f64 {
        T::epsilon().value().sqrt()
    }

    /// Reads positions; returns the boxes of the two bodies, and of their motion since the lists were built.
    fn move_nodes(&mut self, u: &[T]) -> Result<([Bounds; 2], [Bounds; 2])> {
        let Self { dimension, coordinates, dofs, positions, built_at, bodies, .. } = self;
        let (mut boxes, mut motions) = ([Bounds::EMPTY; 2], [Bounds::EMPTY; 2]);
        for ((body, bounds), motion) in bodies.iter().zip(&mut boxes).zip(&mut motions) {
            for &node in body {
                let mut x = coordinates[node];
                for (x, &dof) in x.iter_mut().zip(&dofs[node][..*dimension]) {
                    *x += u[dof].value();
                    if !x.is_finite() {
                        let what = "the displacement of a contact surface (by dof)";
                        return Err(Error::NotFinite { what, index: dof, value: u[dof].value() });
                    }
                }
                positions[node] = x;
                bounds.include(x);
                if let Some(&before) = built_at.get(node) {
                    motion.include(geometry::sub(x, before));
                }
            }
        }
        Ok((boxes, motions))
    }

    /// The boxes of the velocities of the two bodies.
    fn speeds(&self, v: &[T]) -> [Bounds; 2] {
        [0, 1].map(|body| Bounds::of_points(self.bodies[body].iter().map(|&node| self.vector(node, v))))
    }

    /// The entries of a vector of the system that belong to a node.
    fn vector(&self, node: usize, x: &[T]) -> Point {
        let mut vector = [0.0; 3];
        for (component, &dof) in vector.iter_mut().zip(&self.dofs[node][..self.dimension]) {
            *component = x[dof].value();
        }
        vector
    }

    /// Makes lists of facets valid for the positions now, and for feet as far away as `range`.
    fn update_lists(&mut self, [one, other]: &[Bounds; 2], range: f64) {
        if !self.built_at.is_empty() && range + one.spread(other) <= self.listed {
            return;
        }
        self.listed = range + self.skin.unwrap_or(0.5 * range);
        let surfaces = [Some(&self.surface), self.own_surface.as_ref()];
        for (pass, surface) in self.passes.iter_mut().zip(surfaces.into_iter().flatten()) {
            pass.neighborhood.build(&pass.nodes, surface, &self.positions, self.listed);
        }
        self.built_at.clone_from(&self.positions);
        self.rebuilds += 1;
    }

    /// The rows of one pass, in the order of its nodes: of those near enough in the box given, which the other body
    /// makes with its velocities in theirs within the time `ahead`.
    fn find_rows(&mut self, pass: usize, (near, speeds): (&Bounds, &Bounds), u: &[T], v: &[T], ahead: f64) {
        let mut clearance = std::mem::take(&mut self.passes[pass].clearance);
        self.find_rows_and(pass, (near, speeds), u, v, ahead, &mut clearance);
        self.passes[pass].clearance = clearance;
    }

    fn find_rows_and(
        &mut self,
        pass: usize,
        (near, speeds): (&Bounds, &Bounds),
        u: &[T],
        v: &[T],
        ahead: f64,
        clearance: &mut [f64],
    ) {
        let Self { surface, own_surface, positions, passes, reach, partners, found, dimension, dofs, .. } = self;
        let Some(ground) = ground(pass, passes, surface, own_surface.as_ref(), positions, Self::rounding()) else {
            return;
        };
        for (place, (&node, clearance)) in ground.nodes.iter().zip(clearance).enumerate() {
            if !near.contains(positions[node]) {
                continue;
            }
            let mut velocity = [0.0; 3];
            for (component, &dof) in velocity.iter_mut().zip(&dofs[node][..*dimension]) {
                *component = v[dof].value();
            }
            let way = ahead * Bounds::of_points([velocity]).farthest(speeds);
            let (distance, stand) = ground.clearance(place, *reach + way);
            *clearance = distance;
            let Some(stand) = stand else { continue };
            let vertices = ground.surface.facets()[stand.facet].nodes();
            if !partners.is_empty() {
                let on = vertices.iter().zip(&stand.weights).find(|(_, weight)| **weight >= 1.0 - Self::rounding());
                let on = on.map(|(&vertex, _)| vertex);
                match pass {
                    0 => partners[node] = on,
                    _ if on.is_some_and(|vertex| partners[vertex] == Some(node)) => continue,
                    _ => {}
                }
            }
            found.push((node, pass), stand, vertices, |node| &dofs[node][..*dimension], u);
        }
    }

    /// The rows there are, where their nodes stand now; `motions` are those since the lists were built.
    fn move_rows(&mut self, t: f64, motions: &[Bounds; 2], u: &[T]) -> Result<()> {
        /// Gap, in shares of the reach, above which a row surely does not press.
        const OPEN: f64 = 0.01;
        let Self { surface, own_surface, positions, passes, rows, found, dimension, dofs, .. } = self;
        for (row, &(node, pass)) in rows.identities.iter().enumerate() {
            let old = rows.stands[row];
            let ground = ground(pass, passes, surface, own_surface.as_ref(), positions, Self::rounding());
            // The list of the node has all facets as near as this.
            let moved = self.built_at.get(node).map_or(f64::INFINITY, |&before| {
                Bounds::of_points([geometry::sub(positions[node], before)]).spread(&motions[1 - pass])
            });
            let known = self.listed - moved;
            let stand = ground.filter(|_| known > 0.0).and_then(|ground| {
                let stand = ground.closest(old.place, known).or_else(|| ground.last(old.place, old.facet, known))?;
                Some((stand, ground.surface.facets()[stand.facet].nodes()))
            });
            match stand {
                Some((stand, vertices)) => match old.followed_by(stand, t) {
                    Some(stand) => {
                        found.push((node, pass), stand, vertices, |node| &dofs[node][..*dimension], u);
                    }
                    None => found.keep(rows, row),
                },
                // There is nothing near that it could press on.
                None if known > 0.0 && rows.gap(row, u).value() > OPEN * self.reach => found.keep(rows, row),
                None => {
                    let contact = ContactId { constraint: 0, feature: node, candidate: pass };
                    return Err(Error::ContactLost { t, contact });
                }
            }
        }
        Ok(())
    }

    /// Position and velocity of a node.
    fn moving(&self, node: usize, u: &[T], v: &[T]) -> [Point; 2] {
        let mut motion = [self.coordinates[node], [0.0; 3]];
        for (i, &dof) in self.dofs[node][..self.dimension].iter().enumerate() {
            motion[0][i] += u[dof].value();
            motion[1][i] = v[dof].value();
        }
        motion
    }
}

/// What the nodes of a pass stand on.
fn ground<'a>(
    pass: usize,
    passes: &'a [Pass],
    surface: &'a Surface,
    own_surface: Option<&'a Surface>,
    positions: &'a [Point],
    rounding: f64,
) -> Option<Ground<'a>> {
    let Pass { nodes, neighborhood, .. } = &passes[pass];
    let (surface, own) = if pass == 0 { (surface, own_surface) } else { (own_surface?, Some(surface)) };
    Some(Ground { nodes, neighborhood: Some(neighborhood), surface, own, positions, rounding })
}

fn component<T: Real>(x: &[T], i: usize) -> f64 {
    x.get(i).map_or(0.0, |x| x.value())
}

impl<T: Real> ContactConstraint<T> for NodeToFacet<T> {
    fn max_candidates(&self) -> usize {
        self.passes.iter().map(|pass| pass.nodes.len()).sum()
    }

    fn max_entries(&self) -> usize {
        let surfaces = [Some(&self.surface), self.own_surface.as_ref()];
        let entries = |(pass, surface): (&Pass, &Surface)| {
            let vertices = surface.facets().iter().map(|facet| facet.nodes().len()).max().unwrap_or(0);
            pass.nodes.len() * self.dimension * (1 + vertices)
        };
        self.passes.iter().zip(surfaces.into_iter().flatten()).map(entries).sum()
    }

    fn check(&self, dofs: usize) -> Result<()> {
        match self.largest_dof {
            dof if dof >= dofs => Err(Error::MissingDof { what: "a contact surface", dof, dofs }),
            _ => Ok(()),
        }
    }

    fn search(&mut self, _t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        self.check(u.len())?;
        let (boxes, motions) = self.move_nodes(u)?;
        let speeds = self.speeds(v);
        self.found.clear();
        let range = self.reach + ahead * speeds[0].farthest(&speeds[1]);
        // Facets go on a little beyond the rim.
        let wide = range + boxes.iter().map(overhang).fold(0.0, f64::max);
        for pass in &mut self.passes {
            pass.clearance.fill(range);
        }
        if boxes[0].inflated(wide).intersects(&boxes[1]) {
            self.update_lists(&motions, range);
            self.partners.fill(None);
            for pass in 0..self.passes.len() {
                self.find_rows(pass, (&boxes[1 - pass].inflated(wide), &speeds[1 - pass]), u, v, ahead);
            }
        }
        let (rows, found) = (&self.rows, &self.found);
        let same = rows.identities == found.identities && rows.jacobian == found.jacobian;
        std::mem::swap(&mut self.rows, &mut self.found);
        Ok(if same { Candidates::Unchanged } else { Candidates::Changed })
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        self.check(u.len())?;
        // A trial state that is not finite: the gaps say so.
        let Ok((_, motions)) = self.move_nodes(u) else { return Ok(Candidates::Unchanged) };
        self.found.clear();
        self.move_rows(t, &motions, u)?;
        let same = self.rows.jacobian == self.found.jacobian;
        std::mem::swap(&mut self.rows, &mut self.found);
        Ok(if same { Candidates::Unchanged } else { Candidates::Changed })
    }

    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        self.look_at(step)
    }

    fn candidates(&self) -> usize {
        self.rows.stands.len()
    }

    fn identity(&self, row: usize) -> (usize, usize) {
        self.rows.identities[row]
    }

    fn law(&self, _row: usize) -> ContactLaw {
        self.law
    }

    fn magnitude(&self, row: usize) -> T {
        let (node, _) = self.rows.identities[row];
        T::of(self.positions[node].iter().fold(0.0, |most, x| most.max(x.abs())))
    }

    fn jacobian(&self, out: &mut ContactJacobian<T>) {
        out.append(&self.rows.jacobian);
    }

    fn gap(&mut self, _t: f64, u: &[T], out: &mut [T]) {
        for (row, out) in out.iter_mut().enumerate().take(self.rows.stands.len()) {
            *out = self.rows.gap(row, u);
        }
    }

    fn rates(&mut self, _t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) {
        let Rows { identities, stands, .. } = &self.rows;
        for ((out, &(node, pass)), stand) in out.iter_mut().zip(identities).zip(stands) {
            let surface = self.own_surface.as_ref().filter(|_| pass > 0).unwrap_or(&self.surface);
            let facet = &surface.facets()[stand.facet];
            let corners = facet.nodes.map(|vertex| self.moving(vertex, u, v));
            let [x, speed] = self.moving(node, u, v);
            let [shape, velocity] = [0, 1].map(|k| Shape::new(corners.map(|corner| corner[k]), facet.count));
            let acceleration = stand.acceleration(x, speed, &shape, &velocity);
            *out = GapRates { rate: T::zero(), acceleration: T::of(acceleration) };
        }
    }

    fn dofs(&self, out: &mut Vec<usize>) {
        let nodes = self.bodies.iter().flatten();
        out.extend(nodes.flat_map(|&node| &self.dofs[node][..self.dimension]));
    }
}
