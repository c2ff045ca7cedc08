//! Contact of two deforming surfaces by weighted gaps (mortar method, segment to segment).

mod bonds;
mod dual;
mod integrals;
mod pairs;
mod parts;
mod passage;
mod points;
mod rates;
mod rows;
mod second_order;
mod strength;
mod sums;

use super::affine_rows::SearchState;
use super::surface::{Bounds, Facet, Nodes, Point, RECOVERY, Surface, Vicinity, sub};
use super::{
    Candidates, ContactConstraint, ContactId, Contacts, GapRates, OPEN, Rates, Stride, SurfaceSettings, check_local,
    surface_settings,
};
use crate::error::{Error, Result};
use crate::real::Real;
use bonds::Bonds;
use dual::Multiplier;
use integrals::Integrals;
use pairs::Pairs;
use rows::{Made, Rows};

pub use strength::BondStrength;

/// The largest angle (radians) by which a surface may turn around a convex side: 60°, and 0.6° for rounding, so that
/// a circle of six segments is accepted in both precisions.
const CORNER: f64 = std::f64::consts::FRAC_PI_3 + 0.01;

/// Relative motion since the search, as a share of the smallest facet, up to which an uncovered row stays as it was:
/// a node that slides off the rim finishes its step.
const BEYOND: f64 = 0.25;

/// Contact of two deforming surfaces whose nodes need not match. Gaps are weighted over the facets of one surface,
/// the slave, against the facets of the other, the master. Facets are segments in two dimensions, triangles and
/// bilinear quadrilaterals in three, or facets of second order ([`Facet`]).
///
/// The gap of a slave node is the mean distance between the surfaces, weighted with the node's shape function N, over
/// the part of the slave surface that the master covers:
///
/// g = ∫ N (x_m − x_s)·n dA / ∫ N dA (length; positive outside),
///
/// where n is the normal at the middle of the slave facet, and x_m the point where the ray along n from x_s meets the
/// master (Puso and Laursen, Comput. Methods Appl. Mech. Eng. 193, 2004; Popp, Gee and Wall, Int. J. Numer. Methods
/// Eng. 79, 2009, with gaps not divided by the area). The multiplier is the nodal force of the pressure, p ∫ N dA;
/// [`area`](Self::area) returns the integral. Partly covered facets count with their covered part, so that rows do
/// not become small where little touches.
///
/// On facets of second order N is the linear shape function of their parts, so that weights are positive and each
/// node has a row. x_s and x_m follow the shape functions of second order (Puso, Laursen and Solberg, Comput. Methods
/// Appl. Mech. Eng. 197, 2008), so that a constant pressure makes the same nodal forces as in their elements. n is
/// the normal of the part.
///
/// Rows of G are derivatives of the gap with respect to both surfaces, including the rotation of n and the stretch of
/// the area. Contact forces conserve linear and angular momentum at the configuration at which rows are linearized.
///
/// # Which surface is the slave
///
/// Pressure on flat surfaces is exact with either choice, for any meshes. Where a small surface slides over a large
/// one the small one should be the slave, even if its facets are larger: the contact moves with its nodes, and forces
/// vary less (`docs/measured/contact.md`, ironing). The cost of a search is the intersection of all pairs of facets
/// near each other.
///
/// # Linearization
///
/// As for [`NodeToFacet`](super::NodeToFacet): candidates are found once a step, gaps are affine in between, and rows
/// [`follow`](ContactConstraint::follow) the contact of the step. Their rates are differences of gaps along the
/// motion. The search uses boxes around the facets, extended by the motion from the velocities. A node that slides
/// over the rim of the master finishes its step with its last row. If the surfaces have moved by more than a quarter
/// of a facet since the search, it is lost ([`Error::ContactLost`], and a smaller step helps). A step is rejected
/// ([`Error::PassedThrough`], and a smaller step helps) if a surface has penetrated the other by more than a tenth of
/// its path, or half of the [reach](SurfaceSettings::reach). Geometry is computed in `f64` in every run.
///
/// Facets that penetrate each other by more than half of the material behind both, in the reference configuration,
/// face each other through the bodies and are not in contact. So bodies may be thinner than the
/// [reach](SurfaceSettings::reach) if their whole surfaces are given. As thin bodies have edges, use
/// [`BodyContact`](super::BodyContact) for them.
///
/// # Known failure
///
/// - There is no contact between facets at more than 60° to each other. So a surface with convex corners or edges is
///   rejected; [`BodyContact`](super::BodyContact) accepts it, and has rows for corners and edges as well.
/// - The rim of an open surface does not count as a corner, because the surface behind it is unknown. A body given by
///   one side may penetrate with its rim. Then 1e-4 of the smallest facet is recovered per step
///   ([`Contact::recovery`](super::Contact::recovery)).
/// - If two layers of a master lie behind each other within the reach, the slave is in contact with both.
/// - On facets of second order that are curved, or whose nodes are not in the middle, the pressure of the patch test
///   is not exact to rounding (`docs/measured/contact.md`), because areas are taken from the linear parts.
/// - Gaps are measured along the normals of facets; for facets of second order along the normals of their parts.
///
/// # Identity
///
/// (index of the slave node, 0); for [bonds](Self::bonded) (index of the slave node, axis), with the normal as axis
/// 0.
///
/// ```
/// use contact_dynamics::ContactConstraint;
/// use contact_dynamics::contact::{Contacts, Mortar};
///
/// // One segment above two, 0.1 apart.
/// let coordinates = [[2.0, 0.0], [0.75, 0.0], [0.0, 0.0], [0.0, 0.1], [2.0, 0.1]];
/// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]];
/// let mut contact = Mortar::new(&coordinates, &dofs, [[3, 4]], [[0, 1], [1, 2]])?;
/// contact.search(0.0, &[0.0; 10], &[0.0; 10], 0.0)?;
/// let contacts = Contacts::of(&contact);
/// assert_eq!((contacts.len(), contacts.name(0)), (2, (3, 0)));
/// // Half of the segment belongs to each of its nodes.
/// assert!((contact.area(0) - 1.0_f64).abs() < 1e-15);
/// let mut gaps = [0.0; 2];
/// contact.gaps(0.0, &[0.0; 10], &mut gaps)?;
/// assert!(gaps.iter().all(|gap: &f64| (gap - 0.1).abs() < 1e-15));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct Mortar<T: Real> {
    nodes: Nodes,
    /// The slave and the master.
    surfaces: [Surface; 2],
    settings: SurfaceSettings<T>,
    vicinity: Vicinity,
    bonds: Option<Bonds<T>>,
    multiplier: Multiplier,
    pairs: Pairs,
    integrals: Integrals,
    /// The state for which the integrals of the pairs are valid, if any: the number of changes of the positions, and
    /// the factor of the offsets (its bits).
    known: Option<(usize, u64)>,
    rows: Rows<T>,
    /// Rows of the search in progress.
    found: Rows<T>,
    work: Work,
}

/// Positions of the last search, and work space.
#[derive(Debug, Default)]
struct Work {
    /// Positions at the last search, by body and place of the node there.
    searched_at: [Vec<Point>; 2],
    /// The time that the last search looks ahead.
    ahead: f64,
    /// Work space of `inspect` and of `rates`.
    inspection: passage::Inspection,
    rates: rates::Rates,
}

surface_settings!(Mortar<T>);

impl<T: Real> Mortar<T> {
    /// Contact of the facets of a `slave` surface, whose nodes get the rows, with the facets of a `master`.
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh, in two or three dimensions, and `dofs` the
    /// dofs of their displacements. Facets list nodes by their index there, and their normals point out of the bodies
    /// ([`Facet`]). The two surfaces must not share a node. The law is [`ContactLaw::Rigid`] by default, see
    /// [`with_law`](Self::with_law).
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the dimension is not 2 or 3, if the lists differ in length, if a facet does not fit, or
    /// if a node does not exist; [`Error::NotFinite`] for the coordinates (index: node); [`Error::Empty`] without
    /// facets; [`Error::InvertedFacet`] for a facet without area, folded, or turned against its neighbor;
    /// [`Error::Incompatible`] at a branch of a surface, for nodes that both surfaces have, and at a convex edge (in
    /// two dimensions a corner) around which a surface turns by more than 60°.
    ///
    /// [`ContactLaw::Rigid`]: crate::ContactLaw::Rigid
    pub fn new<F: Into<Facet>, G: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        slave: impl IntoIterator<Item = F>,
        master: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let contact = Self::without_corner_check(coordinates, dofs, slave, master)?;
        for surface in &contact.surfaces {
            if let Some(node) = surface.sharp_nodes(CORNER, &contact.nodes.coordinates).first() {
                let reason = "weighted gaps alone let corners and edges penetrate, and the bodies may then gain \
                              energy; use BodyContact, or give only the sides that face each other";
                return Err(Error::Incompatible {
                    part: format!("the corner or edge at node {node} of a surface of Mortar"),
                    reason,
                });
            }
        }
        Ok(contact)
    }

    /// As [`new`](Self::new), for surfaces that may have corners and edges, whose rows are in other constraints.
    pub(crate) fn without_corner_check<F: Into<Facet>, G: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        slave: impl IntoIterator<Item = F>,
        master: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let (nodes, surfaces) = Nodes::with_surfaces(coordinates, dofs, slave, master)?;
        let settings = SurfaceSettings::new();
        let typical = surfaces[0].typical().max(surfaces[1].typical());
        Ok(Self {
            vicinity: Vicinity::new(&settings, nodes.coordinates.len(), typical, false)?,
            nodes,
            surfaces,
            settings,
            bonds: None,
            multiplier: Multiplier::default(),
            pairs: Pairs::default(),
            integrals: Integrals::default(),
            known: None,
            rows: Rows::new(),
            found: Rows::new(),
            work: Work::default(),
        })
    }

    /// Bonds the surfaces to each other where they touch in the reference configuration, within a tenth of a facet.
    /// Each slave node there has the rows of a [`Tie`](super::Tie): along the slave's outward normal, averaged over
    /// the node's area, and across it. The bond breaks when the traction, averaged over that area, reaches the
    /// strength. This is checked after each step with its reported forces; from the next step on the node has
    /// ordinary contact. Nodes that touch later are not bonded.
    ///
    /// ```
    /// use contact_dynamics::contact::{BondStrength, Contacts, Mortar};
    /// use contact_dynamics::{ContactConstraint, ContactLaw};
    ///
    /// // Two segments upon each other, of length 2; each node has half of it.
    /// let coordinates = [[2.0, 0.0], [0.0, 0.0], [0.0, 0.0], [2.0, 0.0]];
    /// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    /// let glue = BondStrength::new(10.0, 20.0)?;
    /// let mut contact = Mortar::new(&coordinates, &dofs, [[2, 3]], [[0, 1]])?.bonded(glue)?;
    /// contact.search(0.0, &[0.0; 8], &[0.0; 8], 0.0)?;
    /// // Normal and tangential force of either node; the second one is pulled by 11.
    /// let mut broken = Vec::new();
    /// contact.overloads(&[-9.0, 0.0, -11.0, 0.0], &mut broken);
    /// assert_eq!(broken, [(3, 1.1)]);
    /// contact.set_broken(&[3]);
    /// contact.search(0.0, &[0.0; 8], &[0.0; 8], 0.0)?;
    /// let contacts = Contacts::of(&contact);
    /// let laws: Vec<_> = (0..contacts.len()).map(|row| (contacts.name(row), contacts.law(row))).collect();
    /// let (contact, tie) = (ContactLaw::Rigid, ContactLaw::Equality);
    /// assert_eq!(laws, [((3, 0), contact), ((2, 0), tie), ((2, 1), tie)]);
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// Known failure: a crack advances by at most one node per step. How far it runs from a notch depends on the
    /// mesh, because a strength is not a fracture energy.
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`] with [offsets](SurfaceSettings::offsets) or [`dual`](Self::dual). If the surfaces do not
    /// touch anywhere, the first search fails ([`Error::Empty`]).
    pub fn bonded(mut self, strength: BondStrength) -> Result<Self> {
        self.bonds = Some(Bonds::new(self.nodes.clone(), self.surfaces.clone(), strength));
        self.check_bonds()?;
        Ok(self)
    }

    fn apply_settings(&mut self) -> Result<()> {
        let typical = self.surfaces[0].typical().max(self.surfaces[1].typical());
        self.vicinity = Vicinity::new(&self.settings, self.nodes.coordinates.len(), typical, false)?;
        self.known = None;
        self.check_bonds()
    }

    /// Rejects bonds together with offsets, because touching parts are found for the facets, and with dual functions.
    fn check_bonds(&self) -> Result<()> {
        let (part, reason) = match (self.bonds.is_some(), self.multiplier) {
            (true, _) if !self.vicinity.thickness.is_none() => (
                "bonds between surfaces with offsets",
                "what is bonded is found where facets lie upon each other; give facets on the surfaces",
            ),
            (true, Multiplier::Dual) => (
                "bonds beside dual functions",
                "rows of bonds have standard ones: beside each other they would not add up to one",
            ),
            _ => return Ok(()),
        };
        Err(Error::Incompatible { part: part.into(), reason })
    }

    /// Weights gaps with dual functions of the multiplier instead of the shape functions N. On each slave facet
    ///
    /// ψ_a = Σ_b A_ab N_b, A = D M⁻¹, D = diag ∫ N_a dA, M_ab = ∫ N_a N_b dA, so that ∫ ψ_a N_b dA = δ_ab ∫ N_a dA
    ///
    /// (Wohlmuth, SIAM J. Numer. Anal. 38, 2000; Popp, Gee and Wall, Int. J. Numer. Methods Eng. 79, 2009). On a
    /// flat, fully covered slave surface that touches the master, a row then acts on no slave node but its own, so
    /// that G M⁻¹ Gᵀ has fewer entries, and slip is the slip of this node. Where surfaces are apart or curved, the
    /// rotation of normals adds small entries of the others. A has the value for segments, triangles and
    /// parallelograms, which does not depend on their shape. On other quadrilaterals, and on facets of second order,
    /// whose linear parts have ψ, rows have small entries of the others as well.
    ///
    /// ψ is negative far from its node. On a partly covered facet the weights are (1 − c) N + c ψ, with c a smooth
    /// function of the covered share of its area: 0 up to three quarters, 1 at full cover. So on segments, triangles
    /// and parallelograms the integral of a weight is positive for any covered part, at least a third of the integral
    /// of N. Rows include the change of c. Weights sum to one everywhere: a constant pressure is exact as with N, and
    /// momenta are conserved.
    ///
    /// Known failure: distances far from the node have a negative weight. So over rough or curved masters a gap may
    /// be outside the range of the distances that it averages, and negative where surfaces are apart. Then a start
    /// nearly in contact may be rejected ([`Error::InitialViolation`]): use
    /// [`InitialOverclosure::RemovedOver`](crate::InitialOverclosure::RemovedOver), or make the surface with the
    /// larger radius of curvature the master.
    ///
    /// ```
    /// use contact_dynamics::contact::{Contacts, Mortar};
    /// use contact_dynamics::ContactConstraint;
    ///
    /// // Two segments upon one.
    /// let coordinates = [[2.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.75, 0.0], [2.0, 0.0]];
    /// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]];
    /// let mut contact = Mortar::<f64>::new(&coordinates, &dofs, [[2, 3], [3, 4]], [[0, 1]])?.dual()?;
    /// contact.search(0.0, &[0.0; 10], &[0.0; 10], 0.0)?;
    /// let contacts = Contacts::of(&contact);
    /// for row in 0..contacts.len() {
    ///     let (node, _) = contacts.name(row);
    ///     // Of the dofs of the slave, the vertical one of the node.
    ///     for (place, weight) in contacts.row(row).filter(|&(place, _)| contact.dofs()[place] >= 4) {
    ///         let own = if contact.dofs()[place] == 2 * node + 1 { 1.0_f64 } else { 0.0 };
    ///         assert!((weight - own).abs() < 1e-14);
    ///     }
    /// }
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`] with [bonds](Self::bonded), whose rows are weighted with N.
    pub fn dual(mut self) -> Result<Self> {
        self.multiplier = Multiplier::Dual;
        self.known = None;
        self.check_bonds()?;
        Ok(self)
    }

    /// ∫ N dA (area; length in two dimensions) over the covered part of the facets around the node of a row, with its
    /// weights N, [dual](Self::dual) or not. The force of the row divided by it is the pressure.
    pub fn area(&self, row: usize) -> T {
        T::of(self.rows.spots[row].area)
    }

    fn tangents(&self) -> usize {
        if self.settings.given_friction() == 0.0 { 0 } else { self.nodes.dimension - 1 }
    }

    fn finest(&self) -> f64 {
        self.surfaces[0].finest().min(self.surfaces[1].finest())
    }

    /// A bound of the relative motion of the surfaces since the last search.
    fn moved_since_search(&self) -> f64 {
        let [one, other] = [0, 1].map(|body| {
            let moved = |(&node, &before): (&usize, &Point)| sub(self.nodes.positions[node], before);
            Bounds::of_points(self.nodes.bodies()[body].iter().zip(&self.work.searched_at[body]).map(moved))
        });
        one.farthest(&other)
    }

    /// Lower bound (≤ 0) and upper bound (≥ 0) of the sum of the offsets of both surfaces at t.
    fn thickest(&self, t: f64) -> [f64; 2] {
        self.vicinity.thickness.bounds(self.nodes.bodies(), self.vicinity.thickness.ramp.at(t))
    }

    /// The largest penetration at t at which surfaces are found.
    fn depth(&self, t: f64) -> f64 {
        self.vicinity.reach.least() - self.thickest(t)[0]
    }

    /// Finds the material behind facets, unless it is known.
    fn find_material(&mut self) {
        let Self { vicinity, surfaces, nodes, .. } = self;
        vicinity.prepare(&surfaces.each_ref(), nodes.bodies(), &nodes.coordinates);
    }

    /// Finds the pairs of facets within `range` at the current positions, at t.
    fn find_pairs(&mut self, t: f64, range: f64) {
        let depth = self.depth(t);
        self.find_material();
        let surfaces = self.surfaces.each_ref();
        let motions = self.vicinity.reach.motions(&self.nodes);
        if let Some(listed) = self.vicinity.reach.renew(&motions, range, &self.nodes.positions) {
            self.pairs.build(surfaces, &self.nodes.positions, listed);
        }
        if let Some(material) = self.vicinity.material_of(1)
            && self.pairs.take_near(surfaces, material, &self.nodes.positions, (range, depth))
        {
            self.known = None;
        }
    }

    /// Integrates at the current positions, unless the integrals are known there: usually a step begins where the
    /// rows of the last one were linearized.
    fn integrate(&mut self, t: f64) {
        let present = Some((self.nodes.moves(), self.vicinity.thickness.ramp.at(t).to_bits()));
        if self.known == present {
            return;
        }
        self.known = present;
        let Self { integrals, surfaces, nodes, pairs, vicinity, multiplier, .. } = self;
        integrals.integrate(surfaces.each_ref(), &nodes.positions, vicinity.thickness.at(t), *multiplier, pairs);
    }
}

impl<T: Real> ContactConstraint<T> for Mortar<T> {
    fn dofs(&self) -> &[usize] {
        self.nodes.dofs()
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        let Rows { affine, identities, spots, tangents, .. } = &self.rows;
        let count = self.tangents();
        for (row, (&place, spot)) in identities.iter().zip(spots).enumerate() {
            let name = (self.surfaces[0].nodes()[place], 0);
            let mut contact = contacts.push_row(name, self.settings.given_law(), (&affine.jacobian, row));
            contact.at(spot.position, spot.normal);
            contact.friction(self.settings.given_friction()).recovery(T::of(RECOVERY * self.finest()));
            (row * count..(row + 1) * count).for_each(|tangent| contact.tangent_row((tangents, tangent)));
        }
        if let Some(bonds) = &self.bonds {
            bonds.tie().contacts(contacts);
        }
    }

    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        check_local(u.len(), self.dofs().len())?;
        self.work.ahead = ahead;
        let boxes = self.nodes.move_to(u)?;
        let speeds = self.nodes.boxes_of(|node| self.nodes.vector(node, v));
        let thickness = self.thickest(t)[1].max(self.thickest(t + ahead)[1]);
        let range = self.vicinity.reach.least() + thickness + ahead * speeds[0].farthest(&speeds[1]);
        for (places, body) in self.work.searched_at.iter_mut().zip(self.nodes.bodies()) {
            places.clear();
            places.extend(body.iter().map(|&node| self.nodes.positions[node]));
        }
        self.found.clear();
        if boxes[0].inflated(range).intersects(&boxes[1]) {
            self.find_pairs(t, range);
            self.integrate(t);
            let (rubs, factor) = (self.tangents() > 0, self.vicinity.thickness.ramp.at(t));
            let made = Made { rubs, nodes: &self.nodes, slave: &self.surfaces[0], factor, u };
            let is_bonded = |place: usize| self.bonds.as_ref().is_some_and(|bonds| bonds.hold(place));
            for place in (0..self.surfaces[0].nodes().len()).filter(|&place| !is_bonded(place)) {
                self.found.push(place, &mut self.integrals, &made);
            }
        } else {
            self.pairs.clear();
            self.known = None;
        }
        let Self { bonds, surfaces: [slave, _], .. } = self;
        let tied = match bonds {
            Some(bonds) => bonds.search(slave, &SearchState { t, u, v, ahead })?,
            None => Candidates::Unchanged,
        };
        let found = self.rows.replace(&mut self.found);
        Ok(Candidates::changed_if([found, tied].contains(&Candidates::Changed)))
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        check_local(u.len(), self.dofs().len())?;
        let tied = match &mut self.bonds {
            Some(bonds) => bonds.tie_mut().follow(t, u)?,
            None => Candidates::Unchanged,
        };
        // If a trial state is not finite, the gaps are not finite either.
        if self.rows.identities.is_empty() || self.nodes.move_to(u).is_err() {
            return Ok(tied);
        }
        self.integrate(t);
        self.found.clear();
        let rubs = self.tangents() > 0;
        // Evaluated only if a row is uncovered.
        let is_covered = |&place: &usize| self.integrals.sums[place].is_covered();
        let near = self.rows.identities.iter().all(is_covered) || self.moved_since_search() <= BEYOND * self.finest();
        let Self { rows, found, integrals, nodes, surfaces: [slave, _], vicinity, .. } = self;
        let made = Made { rubs, nodes, slave, factor: vicinity.thickness.ramp.at(t), u };
        for (row, &place) in rows.identities.iter().enumerate() {
            if found.push(place, integrals, &made) {
                continue;
            }
            // The row is no longer covered. An open row stays open, and a node just beyond the rim finishes its step.
            let gap = rows.gap(row, made.factor, u).value();
            if !near && gap <= OPEN * vicinity.reach.least() {
                let contact = ContactId { constraint: 0, feature: slave.nodes()[place], candidate: 0 };
                return Err(Error::ContactLost { t, contact });
            }
            found.keep(rows, row);
        }
        Ok(Candidates::changed_if([rows.replace(found), tied].contains(&Candidates::Changed)))
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        let (own, tied) = gaps.split_at_mut(self.rows.spots.len());
        self.rows.gaps(self.vicinity.thickness.ramp.at(t), u, own);
        self.bonds.as_mut().map_or(Ok(()), |bonds| bonds.tie_mut().gaps(t, u, tied))
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let (own, tied) = rates.split_at_mut(self.rows.spots.len());
        if !own.is_empty() {
            self.rates_along((t, u, v), own);
        }
        if let Some(bonds) = &mut self.bonds {
            bonds.tie_mut().rates(t, u, v, tied)?;
        }
        Ok(Rates::Given)
    }

    fn overloads(&self, forces: &[T], broken: &mut Vec<(usize, f64)>) {
        if let Some(bonds) = &self.bonds {
            bonds.overloads(&forces[self.rows.spots.len()..], self.nodes.dimension, broken);
        }
    }

    fn set_broken(&mut self, features: &[usize]) {
        if let Some(bonds) = &mut self.bonds {
            bonds.set_broken(&self.surfaces[0], features);
        }
    }

    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        self.check_step(step)
    }
}
