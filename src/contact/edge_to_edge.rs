//! Contact of the edges of one deforming body with those of another.

mod edges;
mod lines;
mod pairs;
mod passage;
mod rows;

use super::surface::{Facet, Material, Neighborhood, Nodes, Offsets, Point, Surface, Vicinity, add_scaled};
use super::{Candidates, ContactConstraint, ContactLaw, Contacts, GapRates, Rates, Stride, check_local};
use crate::error::{Error, Result};
use crate::real::Real;
use edges::Edge;
use lines::Crossing;
use pairs::{LEAST_SINE, Pair};
use rows::Rows;

/// The angle by which a surface turns around an edge, if not given: 30°.
pub(super) const SHARP: f64 = std::f64::consts::FRAC_PI_6;

/// Refuses what is no angle by which a surface turns.
pub(super) fn check_angle(angle: f64) -> Result<()> {
    match (0.0..=std::f64::consts::PI).contains(&angle) {
        true => Ok(()),
        false => Err(Error::Parameter { name: "the angle of a contact edge", value: angle, range: "from 0 to π" }),
    }
}

/// Contact of the edges of two deforming surfaces in three dimensions, where they cross: beside
/// [`NodeToFacet`](super::NodeToFacet) of the same surfaces, which does not see it, or in a
/// [`BodyContact`](super::BodyContact).
///
/// Edges are the convex sides of facets around which a surface turns by more than an angle ([`sharp`](Self::sharp)).
/// The lines through an edge e of the first surface and an edge f of the second are closest in x_e and x_f. The pair is
/// in contact, or near it, if these points are on the edges, and if the normal n = ±(t_e × t_f)/|t_e × t_f| is one of
/// the second body at f, between the normals of the two facets beside f, and −n one of the first body at e: then n is a
/// normal of the Minkowski difference of the bodies, and which of the two signs fits is known. The gap is
///
/// `g = n · (x_e − x_f)` (length; positive outside).
///
/// Its row of G is n times (1 − s, s) on the ends of e and −n times (1 − t, t) on those of f, s and t the places of x_e
/// and x_f along them. That is the derivative of g, for n is orthogonal to both edges. x_e − x_f is parallel to n:
/// forces conserve momentum and angular momentum at the configuration where rows are linearized.
///
/// # Beside which contact
///
/// A pair of edges keeps apart what crosses between nodes; a corner on a facet, a face on a face, edges that are
/// parallel within 2.9° (sine 0.05) are left to nodes and facets. (Nodes let such edges sink into each other by no more
/// than half an edge times that sine.) Where an edge ends on another one, both speak: redundant rows share their
/// multipliers in the least norm.
///
/// # Linearization
///
/// As of [`NodeToFacet`](super::NodeToFacet): candidates are found once a step ([`search`](ContactConstraint::search)):
/// edges that meet, and those that may come to meet within the step, by their velocities and a tenth of an edge. In
/// between gaps are affine, and rows [`follow`](ContactConstraint::follow) the contact of the step.
/// [`rates`](ContactConstraint::rates) have the second derivative of g along the motion. Where the closest points lie
/// beyond an end by a share x of an edge of length l, the gap is larger than that of the lines by 2 l x²/(x + 0.1):
/// gaps and rows are continuous where edges come to meet or slide off each other. Geometry is computed in `f64` in
/// every run.
///
/// Edges that touch, by 2 % of the shorter one, are in contact even if the normal is up to 30° beside those of the
/// facets: in the dent that an edge makes it may be none of theirs.
///
/// Edges that a search finds in each other deeper than 1e-4 of the shorter one, because a body has come in
/// elsewhere, come out by so much in a step ([`Contact::recovery`](super::Contact::recovery)).
///
/// A step is refused ([`Error::PassedThrough`], which a smaller step mends) in which edges that move by more than an
/// eighth of the smallest one have gone into each other by more than a tenth of their way, taken as straight, or were
/// stopped apart.
///
/// # Known failure
///
/// - An open rim is no edge: what is behind it is not known. Give the whole surface of a body.
/// - Edges that are concave, or that turn by less than the angle, are seen by nodes and facets only.
/// - A row belongs to two sides of facets. A contact that slides along an edge onto its next side is another contact:
///   what a corrector or a friction law remembers of it begins anew.
/// - Where an edge slides from one side of its mesh to the next it loses some of its speed along it, less than 0.5 %
///   over two nodes in `tests/contact/edges.rs`.
///
/// # Identity
///
/// (edge of the first surface, edge of the second): indices in [`edges`](Self::edges).
///
/// ```
/// use contact_dynamics::ContactConstraint;
/// use contact_dynamics::contact::{Contacts, EdgeToEdge};
///
/// // Two roofs: a ridge along x below, one along y upside down 0.1 above it.
/// let coordinates = [
///     [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, -1.0], [0.0, 1.0, -1.0],
///     [0.0, -1.0, 0.1], [0.0, 1.0, 0.1], [-1.0, 0.0, 1.1], [1.0, 0.0, 1.1],
/// ];
/// let dofs: Vec<[usize; 3]> = (0..8).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
/// let (below, above) = ([[0, 1, 3], [1, 0, 2]], [[4, 5, 7], [5, 4, 6]]);
/// let mut contact = EdgeToEdge::new(&coordinates, &dofs, above, below)?;
/// assert_eq!(contact.edges(), [[[4, 5]], [[0, 1]]]);
///
/// let zero = [0.0; 24];
/// contact.search(0.0, &zero, &zero, 0.0)?;
/// let contacts = Contacts::of(&contact);
/// assert_eq!((contacts.len(), contacts.name(0), contacts.normal(0)), (1, (0, 0), Some([0.0, 0.0, 1.0])));
/// let weights: Vec<f64> = contacts.row(0).map(|(_, weight)| weight).collect();
/// assert_eq!(weights, [0.5, 0.5, -0.5, -0.5]);
/// let mut gap = [0.0];
/// contact.gaps(0.0, &zero, &mut gap)?;
/// assert!((gap[0] - 0.1_f64).abs() < 1e-15);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct EdgeToEdge<T: Real> {
    nodes: Nodes,
    surfaces: [Surface; 2],
    edges: [Vec<Edge>; 2],
    vicinity: Vicinity,
    /// Nodes of the edges, by edge.
    ends_of: [Vec<[usize; 2]>; 2],
    /// For each dof whether an edge has it.
    acts: Vec<bool>,
    /// The shortest edge, in the reference coordinates.
    finest: f64,
    law: ContactLaw,
    friction: f64,
    /// Edges of the second surface near each of the first.
    neighborhood: Neighborhood,
    /// Positions at the start and at the end of a step, by node.
    ends: [Vec<Point>; 2],
    rows: Rows<T>,
    /// What the search under way finds.
    found: Rows<T>,
}

impl<T: Real> EdgeToEdge<T> {
    /// Contact of the edges of the facets `one` with those of the facets `other`.
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh, and `dofs` the dofs of their displacements;
    /// facets are triangles and quadrilaterals that name nodes by their index there, and their normals point out of the
    /// bodies ([`Facet`]). The two surfaces share no node. The law is [`ContactLaw::Rigid`], unless
    /// [`with_law`](Self::with_law) gives another. A surface without an edge, as a ball's, is no error: there are no
    /// candidates.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the lists differ in length, if a facet is a segment, or if a node does not exist;
    /// [`Error::NotFinite`] for the coordinates (index: node); [`Error::Empty`] without facets;
    /// [`Error::InvertedFacet`] for a facet without area, folded, or turned against its neighbor;
    /// [`Error::Incompatible`] at a branch of a surface, and for nodes that both surfaces have.
    pub fn new<F: Into<Facet>, G: Into<Facet>>(
        coordinates: &[[T; 3]],
        dofs: &[[usize; 3]],
        one: impl IntoIterator<Item = F>,
        other: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let (nodes, surfaces) = Nodes::with_surfaces(coordinates, dofs, one, other)?;
        let mut contact = Self::between(nodes, surfaces);
        contact.find_edges(SHARP)?;
        Ok(contact)
    }

    /// Contact of the edges of a surface with each other, of a body that folds or of several bodies whose surfaces are
    /// given as one: beside [`NodeToFacet::of_itself`](super::NodeToFacet::of_itself), or in a
    /// [`BodyContact::of_itself`](super::BodyContact::of_itself).
    ///
    /// Each pair of edges is met once, the one of the smaller index being the first. Edges do not meet those beside
    /// whose facets one of their own nodes is within one [ring](Self::rings), nor any that is behind one of their nodes
    /// by more than half of the material there, as it is thick in the reference configuration.
    ///
    /// ```
    /// use contact_dynamics::ContactConstraint;
    /// use contact_dynamics::contact::{Contacts, EdgeToEdge};
    ///
    /// // The ridge of a tetrahedron across that of another, 0.1 above it; one list of facets.
    /// let coordinates = [
    ///     [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, -1.0], [0.0, 1.0, -1.0],
    ///     [0.0, -1.0, 0.1], [0.0, 1.0, 0.1], [-1.0, 0.0, 1.1], [1.0, 0.0, 1.1],
    /// ];
    /// let dofs: Vec<[usize; 3]> = (0..8).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
    /// let facets = [
    ///     [0, 1, 3], [1, 0, 2], [0, 3, 2], [1, 2, 3],
    ///     [4, 5, 7], [5, 4, 6], [4, 7, 6], [5, 6, 7],
    /// ];
    /// let mut contact = EdgeToEdge::of_itself(&coordinates, &dofs, facets)?;
    /// contact.search(0.0, &[0.0; 24], &[0.0; 24], 0.0)?;
    /// let (contacts, edges) = (Contacts::of(&contact), contact.edges());
    /// let pairs: Vec<_> = (0..contacts.len()).map(|row| contacts.name(row)).collect();
    /// assert!(pairs.iter().any(|&(one, other)| [edges[0][one], edges[1][other]] == [[0, 1], [4, 5]]));
    /// assert!(pairs.iter().all(|&(one, other)| one < other));
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`new`](Self::new) about coordinates, dofs and facets.
    pub fn of_itself<F: Into<Facet>>(
        coordinates: &[[T; 3]],
        dofs: &[[usize; 3]],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        let nodes = Nodes::new(coordinates, dofs)?;
        let surface = Surface::of_facets(facets, 3, &nodes.coordinates)?;
        let mut contact = Self::between(nodes, [surface.clone(), surface]);
        contact.vicinity = Vicinity::of_itself(contact.surfaces[0].typical());
        contact.find_edges(SHARP)?;
        Ok(contact)
    }

    /// Of two surfaces, whose edges are still to be found.
    fn between(nodes: Nodes, surfaces: [Surface; 2]) -> Self {
        Self {
            ends: [nodes.coordinates.clone(), nodes.coordinates.clone()],
            nodes,
            vicinity: Vicinity::new(surfaces[0].typical().max(surfaces[1].typical())),
            surfaces,
            edges: [Vec::new(), Vec::new()],
            ends_of: [Vec::new(), Vec::new()],
            acts: Vec::new(),
            finest: f64::INFINITY,
            law: ContactLaw::Rigid,
            friction: 0.0,
            neighborhood: Neighborhood::default(),
            rows: Rows::new(),
            found: Rows::new(),
        }
    }

    /// How many rings of facets around the nodes of an edge it does not meet the edges of, of
    /// [its own surface](Self::of_itself), as [`NodeToFacet::rings`](super::NodeToFacet::rings). By default 1.
    #[must_use]
    pub fn rings(mut self, rings: usize) -> Self {
        self.vicinity.set_rings(rings);
        self
    }

    /// Rounds the edges: how far (length) the surfaces of the bodies lie outside of their facets, by node of the mesh,
    /// as [`NodeToFacet::offsets`](super::NodeToFacet::offsets). The gap is that of the lines less the radii of both
    /// edges where they are closest, which are linear between nodes. Edges of a surface that lies inside of its facets
    /// (negative offsets) are found a little early, by up to 0.4 of the offset at right angles: between its faces a
    /// body is smaller by more than that.
    ///
    /// ```
    /// use contact_dynamics::ContactConstraint;
    /// use contact_dynamics::contact::EdgeToEdge;
    ///
    /// // Two ridges that cross, 0.1 apart, of which each is coated by 0.02.
    /// let coordinates = [
    ///     [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, -1.0], [0.0, 1.0, -1.0],
    ///     [0.0, -1.0, 0.1], [0.0, 1.0, 0.1], [-1.0, 0.0, 1.1], [1.0, 0.0, 1.1],
    /// ];
    /// let dofs: Vec<[usize; 3]> = (0..8).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
    /// let (below, above) = ([[0, 1, 3], [1, 0, 2]], [[4, 5, 7], [5, 4, 6]]);
    /// let mut contact = EdgeToEdge::new(&coordinates, &dofs, above, below)?.offsets(&[0.02; 8])?;
    /// contact.search(0.0, &[0.0; 24], &[0.0; 24], 0.0)?;
    /// let mut gap = [0.0];
    /// contact.gaps(0.0, &[0.0; 24], &mut gap)?;
    /// assert!((gap[0] - 0.06_f64).abs() < 1e-15);
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

    /// Lets all [`offsets`](Self::offsets) grow, or shrink, with time, as [`Mortar::ramp`](super::Mortar::ramp).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless all are finite and the second time is later.
    pub fn ramp(mut self, times: [f64; 2], factors: [f64; 2]) -> Result<Self> {
        self.vicinity.set_ramp(times, factors)?;
        Ok(self)
    }

    /// The law of all rows.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Coulomb's friction with a coefficient μ, from 0. Slip is the velocity of the closest point of the first edge
    /// against that of the second, as material points.
    #[must_use]
    pub fn friction(mut self, coefficient: f64) -> Self {
        self.friction = coefficient;
        self
    }

    /// How far (length) outside and inside of each other edges are found at least; by default the mean size of the
    /// facets, of the coarser surface. What the velocities bring near within a step is found as well.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn reach(mut self, reach: T) -> Result<Self> {
        self.vicinity.set_least(reach)?;
        Ok(self)
    }

    /// How far (length) the surfaces may move relative to each other before lists of near edges are built anew; if not
    /// given, half of what is searched. It changes the cost, not the result.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn skin(mut self, skin: T) -> Result<Self> {
        self.vicinity.reach.set_skin(skin)?;
        Ok(self)
    }

    /// What an edge is: a side around which the surface turns by more than `angle` (radians, between the normals of its
    /// facets in the reference coordinates) to a convex one; 30° if not given.
    ///
    /// What turns less is left to nodes on facets. Two edges of length l that cross in their middles then sink into
    /// each other by ½ l tan(½ `angle`) at most before a node touches: by 13 % of an element at 30°. Smaller angles
    /// make edges of the sides of a mesh on a curved surface, at the cost of a search among all of them.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless from 0 to π.
    pub fn sharp(mut self, angle: f64) -> Result<Self> {
        check_angle(angle)?;
        self.find_edges(angle)?;
        Ok(self)
    }

    /// The nodes of the edges of both surfaces, each edge with the smaller number first, in ascending order: features
    /// are indices in the first list, candidates in the second.
    pub fn edges(&self) -> [&[[usize; 2]]; 2] {
        self.ends_of.each_ref().map(Vec::as_slice)
    }

    fn find_edges(&mut self, angle: f64) -> Result<()> {
        let Self { nodes, surfaces, edges, .. } = self;
        for (edges, surface) in edges.iter_mut().zip(&*surfaces) {
            *edges = Edge::of(surface, angle, &nodes.coordinates);
        }
        self.ends_of = edges.each_ref().map(|edges| edges.iter().map(|edge| edge.nodes).collect());
        let mut bodies = [Vec::new(), Vec::new()];
        for ((body, edges), surface) in bodies.iter_mut().zip(&*edges).zip(&*surfaces) {
            body.extend(edges.iter().flat_map(|edge| edge.around(surface)));
            body.sort_unstable();
            body.dedup();
        }
        match (self.vicinity.is_of_itself(), bodies) {
            (false, bodies) => nodes.read_bodies(bodies)?,
            (true, [body, _]) => nodes.read_body(body),
        }
        self.acts.clear();
        self.acts.resize(nodes.dofs().len(), false);
        self.finest = edges.iter().flatten().map(|edge| edge.length).fold(f64::INFINITY, f64::min);
        for &[from, to] in self.ends_of.iter().flatten() {
            nodes.places(from).iter().chain(nodes.places(to)).for_each(|&place| self.acts[place] = true);
        }
        self.vicinity.forget();
        self.rows.clear();
        Ok(())
    }

    /// The edges at t.
    fn sides(&self, t: f64) -> Sides<'_> {
        let Self { edges, surfaces, vicinity, .. } = self;
        Sides { edges, surfaces, vicinity, offsets: vicinity.thickness.at(t) }
    }

    /// Makes lists of near edges valid for the positions now, and for distances up to `range`.
    fn update_lists(&mut self, range: f64) {
        let motions = self.vicinity.reach.motions(&self.nodes);
        let Some(listed) = self.vicinity.reach.renew(&motions, range, &self.nodes.positions) else { return };
        let [one, other] =
            self.edges.each_ref().map(|edges| edges.iter().map(|edge| edge.bounds(&self.nodes.positions)));
        self.neighborhood.build(one, other, listed);
    }

    fn find_rows(&mut self, (t, u, v): (f64, &[T], &[T]), ahead: f64) {
        let Self { nodes, edges, surfaces, vicinity, neighborhood, found, .. } = self;
        let Vicinity { thickness, reach, .. } = &*vicinity;
        let sides = Sides { edges, surfaces, vicinity, offsets: thickness.at(t) };
        let [thick, growth] = thickness.sizes(nodes.bodies(), [t, t + ahead]);
        let at = |node: usize| nodes.positions[node];
        let velocity = |node: usize| nodes.vector(node, v);
        for (first, edge) in edges[0].iter().enumerate() {
            let bounds = edge.bounds(&nodes.positions);
            for &second in neighborhood.of(first) {
                let Some(pair) = sides.meeting([first, second]) else { continue };
                let way = growth + ahead * pair.way(&velocity);
                if !bounds.inflated(reach.least() + thick + way).intersects(&pair.edges[1].bounds(&nodes.positions)) {
                    continue;
                }
                if let Some(crossing) = pair.near(reach.least(), way, &at) {
                    let names = (pair.nodes(), |node| nodes.places(node));
                    let row = pair.row(&crossing, &at);
                    let round = (pair.radius(&crossing), pair.offsets.factor);
                    found.push(([first, second], crossing), round, row, names, u);
                }
            }
        }
    }
}

/// The edges of two surfaces, or twice those of one, at some time.
#[derive(Clone, Copy)]
struct Sides<'a> {
    edges: &'a [Vec<Edge>; 2],
    surfaces: &'a [Surface; 2],
    vicinity: &'a Vicinity,
    offsets: Offsets<'a>,
}

impl<'a> Sides<'a> {
    fn pair(&self, [first, second]: [usize; 2]) -> Pair<'a> {
        let (edges, surfaces) = ([&self.edges[0][first], &self.edges[1][second]], self.surfaces.each_ref());
        Pair { edges, surfaces, offsets: self.offsets, depth: self.depth(edges) }
    }

    /// How deep two edges may lie in each other and be in contact, for the material behind both.
    fn depth(&self, edges: [&Edge; 2]) -> f64 {
        let material = &self.vicinity.material[..];
        let ([one, .., other] | [one @ other]) = material else { return f64::INFINITY };
        let places = [0, 1].map(|k| edges[k].nodes.map(|node| self.surfaces[k].place(node)));
        let behind = |material: &Material, [from, to]: [usize; 2]| material.behind(from).min(material.behind(to));
        let [behind, beyond] = [behind(one, places[0]), behind(other, places[1])];
        let [facet, _] = edges[1].facets();
        let is_one_body = self.vicinity.is_of_itself() && one.is_of_one_body(&self.surfaces[0], places[0][0], facet);
        if is_one_body { behind.min(beyond) } else { behind + beyond }
    }

    /// Two edges that may meet: of one surface each pair once, and none whose facets are near each other on it.
    fn meeting(&self, [first, second]: [usize; 2]) -> Option<Pair<'a>> {
        let apart = self.vicinity.kin.as_ref().is_none_or(|kin| {
            let keeps = |one: &Edge, other: &Edge| {
                let places = one.nodes.map(|node| self.surfaces[0].place(node));
                other.facets().iter().any(|&facet| places.iter().any(|&place| kin.keeps_apart(place, facet)))
            };
            let [one, other] = [&self.edges[0][first], &self.edges[1][second]];
            first < second && !keeps(one, other) && !keeps(other, one)
        });
        apart.then(|| self.pair([first, second]))
    }
}

impl<T: Real> ContactConstraint<T> for EdgeToEdge<T> {
    fn dofs(&self) -> &[usize] {
        self.nodes.dofs()
    }

    fn only_reads(&self, place: usize) -> bool {
        !self.acts[place]
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        let Rows { affine, pairs, crossings, .. } = &self.rows;
        let sides = self.sides(0.0);
        for (row, (&index, crossing)) in pairs.iter().zip(crossings).enumerate() {
            let pair = sides.pair(index);
            let [ends, _] = pair.ends(&|node| self.nodes.positions[node]);
            let position = Edge::point(ends, crossing.shares[0].clamp(0.0, 1.0));
            let size = position.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let mut contact = contacts.push_row((index[0], index[1]), self.law, (&affine.jacobian, row));
            contact.magnitude(T::of(size)).position(position.map(T::of)).normal(crossing.normal.map(T::of));
            contact.recovery(T::of(pair.recovery()));
            if self.friction == 0.0 {
                continue;
            }
            contact.friction(self.friction);
            for tangent in self.nodes.tangents(crossing.normal) {
                let entries = pair.nodes().into_iter().zip(crossing.weights()).flat_map(|(node, share)| {
                    let places = self.nodes.places(node);
                    places.iter().zip(tangent).map(move |(&place, along)| (place, T::of(share * along)))
                });
                contact.tangent_entries(entries);
            }
        }
    }

    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        check_local(u.len(), self.dofs().len())?;
        let boxes = self.nodes.move_to(u)?;
        let speeds = self.nodes.boxes_of(|node| self.nodes.vector(node, v));
        self.found.clear();
        if self.edges.iter().all(|edges| !edges.is_empty()) {
            let Self { vicinity, surfaces: [one, other], nodes, .. } = self;
            vicinity.prepare(&[one, other], nodes.bodies(), &nodes.coordinates);
            let [thick, growth] = self.vicinity.thickness.sizes(self.nodes.bodies(), [t, t + ahead]);
            let range = self.vicinity.reach.least() + thick + growth + ahead * speeds[0].farthest(&speeds[1]);
            if boxes[0].inflated(range).intersects(&boxes[1]) {
                self.update_lists(range);
                self.find_rows((t, u, v), ahead);
            }
        }
        let (rows, found) = (&self.rows, &self.found);
        let same = rows.pairs == found.pairs && rows.affine.jacobian == found.affine.jacobian;
        std::mem::swap(&mut self.rows, &mut self.found);
        Ok(Candidates::changed_if(!same))
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        check_local(u.len(), self.dofs().len())?;
        // A trial state that is not finite: the gaps say so.
        if self.rows.pairs.is_empty() || self.nodes.move_to(u).is_err() {
            return Ok(Candidates::Unchanged);
        }
        let Self { nodes, edges, surfaces, vicinity, rows, found, .. } = self;
        let sides = Sides { edges, surfaces, vicinity, offsets: vicinity.thickness.at(t) };
        let at = |node: usize| nodes.positions[node];
        found.clear();
        for (row, (&index, before)) in rows.pairs.iter().zip(&rows.crossings).enumerate() {
            let pair = sides.pair(index);
            // Edges that have become parallel: the row stays as it was.
            let crossing = Crossing::of(pair.ends(&at)).filter(|crossing| crossing.sine >= 0.5 * LEAST_SINE);
            match crossing.map(|crossing| crossing.as_seen_along(before.normal)) {
                Some(crossing) => {
                    let names = (pair.nodes(), |node| nodes.places(node));
                    let round = (pair.radius(&crossing), pair.offsets.factor);
                    found.push((index, crossing), round, pair.row(&crossing, &at), names, u);
                }
                None => found.keep(rows, row),
            }
        }
        let same = rows.affine.jacobian == found.affine.jacobian;
        std::mem::swap(rows, found);
        Ok(Candidates::changed_if(!same))
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        let now = self.vicinity.thickness.ramp.at(t);
        for ((row, gap), (radius, then)) in gaps.iter_mut().enumerate().zip(&self.rows.rounding) {
            *gap = self.rows.affine.gap(row, u) - T::of((now - then) * radius);
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let Rows { pairs, crossings, .. } = &self.rows;
        let (sides, ramp) = (self.sides(t), &self.vicinity.thickness.ramp);
        let [change, bend] = [ramp.rate(t), ramp.acceleration(t)];
        for (rates, (&index, crossing)) in rates.iter_mut().zip(pairs.iter().zip(crossings)) {
            let pair = sides.pair(index);
            let at = |node: usize| add_scaled(self.nodes.coordinates[node], 1.0, self.nodes.vector(node, u));
            let velocity = |node: usize| self.nodes.vector(node, v);
            let mut acceleration = pair.acceleration(crossing, &at, &velocity);
            let mut rate = 0.0;
            if change != 0.0 {
                let radius = pair.radius(crossing);
                rate = -change * radius;
                acceleration -= 2.0 * change * pair.sliding(crossing, &at, &velocity) + bend * radius;
            }
            *rates = GapRates { rate: T::of(rate), acceleration: T::of(acceleration) };
        }
        Ok(Rates::Given)
    }

    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        self.look_at(step)
    }
}
