//! Contact of the edges of one deforming body with the edges of another.

mod edges;
mod lines;
mod lists;
mod pairs;
mod passage;
mod rows;

use super::affine_rows::{SearchState, set_friction};
use super::surface::{Facet, Material, Nodes, Offsets, Point, Surface, Vicinity, add_scaled};
use super::{
    Candidates, ContactConstraint, Contacts, GapRates, Rates, Stride, SurfaceSettings, check_local, surface_settings,
};
use crate::error::Result;
use crate::real::Real;
use edges::Edge;
use lines::Crossing;
use lists::Lists;
use pairs::{LEAST_SINE, Pair};
use rows::Rows;

/// The angle (radians) from which a side is an edge, unless one is given.
const LEAST_TURN: f64 = 0.01;

/// Contact of the edges of two deforming surfaces in three dimensions, where they cross. It complements
/// [`NodeToFacet`](super::NodeToFacet) of the same surfaces, which does not detect crossing edges, or is a part of a
/// [`BodyContact`](super::BodyContact).
///
/// Edges are the sides of facets at which a surface is convex and turns by more than an angle
/// ([`sharp`](SurfaceSettings::sharp)), as it lies at the search: also the sides within a face that bends.
///
/// The lines through an edge e of the first surface and an edge f of the second are closest at x_e and x_f. The pair
/// is in contact, or near it, if these points are on the edges, and if the normal n = ±(t_e × t_f)/|t_e × t_f| is a
/// normal of the second body at f, between the normals of the two facets beside f, and −n is a normal of the first
/// body at e. Then n is a normal of the Minkowski difference of the bodies, which determines the sign. The gap is
///
/// `g = n · (x_e − x_f)` (length; positive outside).
///
/// Its row of G is n times (1 − s, s) on the ends of e and −n times (1 − t, t) on the ends of f, with the positions s
/// of x_e and t of x_f along them. This is the derivative of g, because n is orthogonal to both edges. x_e − x_f is
/// parallel to n: forces conserve momentum and angular momentum at the configuration at which rows are linearized.
///
/// # Complementary contact
///
/// A pair of edges resists crossing between nodes. Nodes on facets resist a corner on a facet, a face on a face, and
/// edges that are parallel within 2.9° (sine 0.05); such edges penetrate by at most half an edge times that sine.
/// Where an edge ends on another one, both constraints have a row: redundant rows have the multipliers of least norm.
///
/// # Linearization
///
/// As for [`NodeToFacet`](super::NodeToFacet), candidates are found once a step
/// ([`search`](ContactConstraint::search)): edges that meet, and edges that may meet within the step, by their
/// velocities and a tenth of an edge. In between gaps are affine, and rows [`follow`](ContactConstraint::follow) the
/// contact of the step. [`rates`](ContactConstraint::rates) contain the second derivative of g along the motion. If
/// the closest points lie beyond an end by a share x of an edge of length l, the gap exceeds the gap of the lines by
/// 2 l x²/(x + 0.1): gaps and rows are continuous where edges begin to meet or slide off each other. Geometry is
/// computed in `f64` in every run.
///
/// Edges that touch, within 2 % of the shorter one, are in contact even if the normal is up to 30° outside the
/// normals of the facets: in the dent that an edge makes, the normal may lie outside of them.
///
/// If a search finds edges that penetrate by more than 1e-4 of the shorter one, because a body has penetrated
/// elsewhere, that depth is the penetration recovered per step ([`Contact::recovery`](super::Contact::recovery)).
///
/// A step is rejected ([`Error::PassedThrough`], and a smaller step helps) if edges that move by more than an eighth
/// of the smallest one have penetrated each other by more than a tenth of their path, taken as straight, or were
/// stopped apart.
///
/// # Known failure
///
/// - An open rim is not an edge, because the surface behind it is unknown. Give the whole surface of a body.
/// - Concave edges, and edges with a smaller angle, have rows only from nodes and facets. Where a face folds within a
///   step, its sides are edges from the next step on.
/// - A row belongs to two sides of facets. A contact that slides along an edge onto its next side is a new contact:
///   correctors and friction laws have no history of it.
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
///
/// [`Error::PassedThrough`]: crate::Error::PassedThrough
#[derive(Debug)]
pub struct EdgeToEdge<T: Real> {
    nodes: Nodes,
    surfaces: [Surface; 2],
    edges: [Vec<Edge>; 2],
    vicinity: Vicinity,
    ends_of: [Vec<[usize; 2]>; 2],
    acts: Vec<bool>,
    /// The length of the shortest edge, in the reference configuration.
    finest: f64,
    settings: SurfaceSettings<T>,
    lists: Lists,
    /// Positions at the start and at the end of a step, by node.
    ends: [Vec<Point>; 2],
    rows: Rows<T>,
    /// Rows of the search in progress.
    found: Rows<T>,
}

surface_settings!(EdgeToEdge<T>);

impl<T: Real> EdgeToEdge<T> {
    /// Contact of the edges of the facets `one` with the edges of the facets `other`.
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh, and `dofs` the dofs of their
    /// displacements. Facets are triangles and quadrilaterals that list nodes by their index there, and their normals
    /// point out of the bodies ([`Facet`]). The two surfaces must not share a node. The law is [`ContactLaw::Rigid`]
    /// by default, see [`with_law`](Self::with_law). A surface without edges, as a plane, is accepted: it has no
    /// candidates.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the lists differ in length, if a facet is a segment, or if a node does not exist;
    /// [`Error::NotFinite`] for the coordinates (index: node); [`Error::Empty`] without facets;
    /// [`Error::InvertedFacet`] for a facet without area, folded, or turned against its neighbor;
    /// [`Error::Incompatible`] at a branch of a surface, and for nodes that both surfaces have.
    ///
    /// [`ContactLaw::Rigid`]: crate::ContactLaw::Rigid
    /// [`Error::Dimension`]: crate::Error::Dimension
    /// [`Error::NotFinite`]: crate::Error::NotFinite
    /// [`Error::Empty`]: crate::Error::Empty
    /// [`Error::InvertedFacet`]: crate::Error::InvertedFacet
    /// [`Error::Incompatible`]: crate::Error::Incompatible
    pub fn new<F: Into<Facet>, G: Into<Facet>>(
        coordinates: &[[T; 3]],
        dofs: &[[usize; 3]],
        one: impl IntoIterator<Item = F>,
        other: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let (nodes, surfaces) = Nodes::with_surfaces(coordinates, dofs, one, other)?;
        Self::between(nodes, surfaces, false)
    }

    /// Contact of the edges of a surface with each other, for a body that folds or for several bodies whose surfaces
    /// are given as one. It complements [`NodeToFacet::of_itself`](super::NodeToFacet::of_itself), or is a part of a
    /// [`BodyContact::of_itself`](super::BodyContact::of_itself).
    ///
    /// Each pair of edges is listed once, with the smaller index first. Two edges are excluded if a node of one is
    /// within one [ring](SurfaceSettings::rings) of a facet beside the other, and if one is behind a node of the other
    /// by more than half of the material there, in the reference configuration.
    ///
    /// ```
    /// use contact_dynamics::ContactConstraint;
    /// use contact_dynamics::contact::{Contacts, EdgeToEdge};
    ///
    /// // The ridges of two tetrahedra cross, 0.1 apart; one list of facets.
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
        Self::between(nodes, [surface.clone(), surface], true)
    }

    /// From two surfaces, or from the same surface twice.
    fn between(nodes: Nodes, surfaces: [Surface; 2], of_itself: bool) -> Result<Self> {
        let settings = SurfaceSettings::new();
        let typical = surfaces[0].typical().max(surfaces[1].typical());
        let mut contact = Self {
            ends: [nodes.coordinates.clone(), nodes.coordinates.clone()],
            vicinity: Vicinity::new(&settings, nodes.coordinates.len(), typical, of_itself)?,
            nodes,
            surfaces,
            edges: [Vec::new(), Vec::new()],
            ends_of: [Vec::new(), Vec::new()],
            acts: Vec::new(),
            finest: f64::INFINITY,
            settings,
            lists: Lists::default(),
            rows: Rows::new(),
            found: Rows::new(),
        };
        contact.find_edges()?;
        Ok(contact)
    }

    fn apply_settings(&mut self) -> Result<()> {
        let typical = self.surfaces[0].typical().max(self.surfaces[1].typical());
        let (nodes, of_itself) = (self.nodes.coordinates.len(), self.vicinity.is_of_itself());
        self.vicinity = Vicinity::new(&self.settings, nodes, typical, of_itself)?;
        self.find_edges()
    }

    /// The nodes of all sides that two facets of a surface share, the smaller node of each first, in ascending order:
    /// features are indices in the first list, of the first surface, candidates in the second.
    pub fn edges(&self) -> [&[[usize; 2]]; 2] {
        self.ends_of.each_ref().map(Vec::as_slice)
    }

    /// Finds the sides that may be edges, and the dofs on which they act.
    fn find_edges(&mut self) -> Result<()> {
        let Self { nodes, surfaces, edges, .. } = self;
        for (edges, surface) in edges.iter_mut().zip(&*surfaces) {
            *edges = Edge::of(surface, &nodes.coordinates);
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
        self.rows.clear();
        Ok(())
    }

    fn sides(&self, t: f64) -> Sides<'_> {
        let Self { edges, surfaces, vicinity, .. } = self;
        Sides { edges, surfaces, vicinity, offsets: vicinity.thickness.at(t) }
    }

    /// Makes the lists complete for distances up to `range`.
    fn update_lists(&mut self, range: f64) {
        let Self { nodes, edges, surfaces, vicinity, lists, settings, .. } = self;
        lists.update((edges, surfaces), settings.sharp_angle(LEAST_TURN), (nodes, vicinity), range);
    }

    fn find_rows(&mut self, &SearchState { t, u, v, ahead }: &SearchState<'_, T>) {
        let Self { nodes, edges, surfaces, vicinity, lists, found, .. } = self;
        let Vicinity { thickness, reach, .. } = &*vicinity;
        let sides = Sides { edges, surfaces, vicinity, offsets: thickness.at(t) };
        let [thick, growth] = thickness.sizes(nodes.bodies(), [t, t + ahead]);
        let at = |node: usize| nodes.positions[node];
        let velocity = |node: usize| nodes.vector(node, v);
        for index in lists.pairs() {
            let Some(pair) = sides.meeting(index) else { continue };
            let way = growth + ahead * pair.way(&velocity);
            let [one, other] = pair.edges.map(|edge| edge.bounds(&nodes.positions));
            if !one.inflated(reach.least() + thick + way).intersects(&other) {
                continue;
            }
            if let Some(crossing) = pair.near(reach.least(), way, &at) {
                let names = (pair.nodes(), |node| nodes.places(node));
                let row = pair.row(&crossing, &at);
                let round = (pair.radius(&crossing), pair.offsets.factor);
                found.push((index, crossing), round, row, names, u);
            }
        }
    }
}

/// The edges of two surfaces, or the edges of one surface twice, at some time.
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

    /// The largest penetration of two edges in contact, by the material behind both.
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

    /// A pair of edges, unless it is excluded: for a surface against itself each pair counts once, and edges with
    /// facets near each other on the surface do not count.
    fn meeting(&self, [first, second]: [usize; 2]) -> Option<Pair<'a>> {
        let apart = self.vicinity.own_facets.as_ref().is_none_or(|own| {
            let keeps = |one: &Edge, other: &Edge| {
                let places = one.nodes.map(|node| self.surfaces[0].place(node));
                other.facets().iter().any(|&facet| places.iter().any(|&place| own.adjacent.holds(place, facet)))
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
        let Rows { affine, identities, spots, .. } = &self.rows;
        let sides = self.sides(0.0);
        for (row, (&index, crossing)) in identities.iter().zip(spots).enumerate() {
            let pair = sides.pair(index);
            let [ends, _] = pair.ends(&|node| self.nodes.positions[node]);
            let position = Edge::point(ends, crossing.shares[0].clamp(0.0, 1.0));
            let mut contact =
                contacts.push_row((index[0], index[1]), self.settings.given_law(), (&affine.jacobian, row));
            contact.at(position, crossing.normal);
            contact.recovery(T::of(pair.recovery()));
            let (coefficient, shares) =
                (self.settings.given_friction(), pair.nodes().into_iter().zip(crossing.weights()));
            set_friction(&mut contact, coefficient, (&self.nodes, crossing.normal), &shares);
        }
    }

    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        check_local(u.len(), self.dofs().len())?;
        let boxes = self.nodes.move_to(u)?;
        let speeds = self.nodes.boxes_of(|node| self.nodes.vector(node, v));
        self.found.clear();
        self.lists.restart();
        if self.edges.iter().all(|edges| !edges.is_empty()) {
            let Self { vicinity, surfaces, nodes, .. } = self;
            vicinity.prepare(&surfaces.each_ref(), nodes.bodies(), &nodes.coordinates);
            let [thick, growth] = vicinity.thickness.sizes(nodes.bodies(), [t, t + ahead]);
            let range = vicinity.reach.least() + thick + growth + ahead * speeds[0].farthest(&speeds[1]);
            if boxes[0].inflated(range).intersects(&boxes[1]) {
                self.update_lists(range);
                self.find_rows(&SearchState { t, u, v, ahead });
            }
        }
        Ok(self.rows.replace(&mut self.found))
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        check_local(u.len(), self.dofs().len())?;
        // If a trial state is not finite, the gaps are not finite either.
        if self.rows.identities.is_empty() || self.nodes.move_to(u).is_err() {
            return Ok(Candidates::Unchanged);
        }
        let Self { nodes, edges, surfaces, vicinity, rows, found, .. } = self;
        let sides = Sides { edges, surfaces, vicinity, offsets: vicinity.thickness.at(t) };
        let at = |node: usize| nodes.positions[node];
        found.clear();
        for (row, (&index, before)) in rows.identities.iter().zip(&rows.spots).enumerate() {
            let pair = sides.pair(index);
            // If the edges have become parallel, the row stays.
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
        Ok(rows.replace(found))
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        self.rows.gaps(self.vicinity.thickness.ramp.at(t), u, gaps);
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let Rows { identities, spots, .. } = &self.rows;
        let (sides, ramp) = (self.sides(t), &self.vicinity.thickness.ramp);
        let [change, bend] = [ramp.rate(t), ramp.acceleration(t)];
        for (rates, (&index, crossing)) in rates.iter_mut().zip(identities.iter().zip(spots)) {
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
        self.check_step(step)
    }
}
