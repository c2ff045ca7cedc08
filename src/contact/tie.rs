//! Surfaces of two bodies that are tied to each other; their meshes need not match.

mod joint;

use super::affine_rows::AffineRows;
use super::surface::{Facet, Nodes, Point, SecondDifference, Surface, unit};
use super::{Candidates, ContactConstraint, ContactLaw, Contacts, GapRates, Rates, Variation, check_local};
use crate::error::{Error, Result, positive};
use crate::real::Real;
use joint::Joint;

/// Reach as a share of the mean facet of the coarser surface. It exceeds the distance of a curved surface from its
/// facets if these turn by 45° from one to the next.
const REACH: f64 = 0.1;

/// Two surfaces that are tied to each other where they touch in the reference configuration; their nodes need not
/// match. Facets are segments in two dimensions, triangles and bilinear quadrilaterals in three, or facets of second
/// order ([`Facet`]). On these, displacements follow the shape functions of second order and N is linear on each
/// part, as in [`Mortar`](super::Mortar).
///
/// Each node of the slave surface that the master surface covers has an equality row for each axis k: the mean jump
/// of the displacement, weighted with the node's shape function N, over the covered part of the reference surface,
///
/// g_k = ∫ N (u_m − u_s)_k dA / ∫ N dA = 0 (length),
///
/// with u_m at the point of the master opposite to the point of the slave, along the normal of its facet (mesh tying
/// by mortar: Bernardi, Maday and Patera, 1994; Puso, Int. J. Numer. Methods Eng. 59, 2004). Where the surfaces
/// touch, any linear displacement is transmitted exactly, for any meshes. The force of a row acts along k, positive
/// on the master and negative on the slave, and ∫ N dA is the node's [`area`](Self::area).
///
/// # Surfaces that do not fit
///
/// Where facets of both surfaces coincide, rows are linear in u and constant. Where they do not, for instance on
/// curved surfaces with different meshes, x_m − x_s is not zero at the start. It is kept constant in axes that turn
/// with each slave facet: g = Σ Rᵀ ∫ N (x_m − x_s) dA / ∫ N dA minus its initial value, with the rotation R of the
/// facet since the start. So bodies turn freely by any angle and forces conserve angular momentum. With fixed axes
/// such a gap would resist rotation (Puso 2004 moves the nodes instead). These rows
/// [follow](ContactConstraint::follow) the motion.
///
/// # Which surface is the slave
///
/// The finer surface as the slave costs more rows, the coarser one makes the interface softer. Nodes of the slave
/// should not be fixed or tied by other constraints: such rows are redundant, cost time, and their forces are not
/// unique.
///
/// # Known failure
///
/// - Rates of rows that turn are differences of gaps along the motion.
/// - Facets at more than 60° to each other are not tied.
///
/// # Identity
///
/// (index of the slave node, axis).
///
/// ```
/// use contact_dynamics::ContactConstraint;
/// use contact_dynamics::contact::{Contacts, Tie};
///
/// // One segment upon two.
/// let coordinates = [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [2.0, 0.0]];
/// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]];
/// let mut tie = Tie::new(&coordinates, &dofs, [[3, 4]], [[0, 1], [1, 2]])?;
/// assert_eq!(tie.nodes(), [3, 4]);
/// // Both stretched by the same: no gap. (Dofs in the order in which the tie reads them: the slave's come first.)
/// assert_eq!(tie.dofs(), [6, 7, 8, 9, 0, 1, 2, 3, 4, 5]);
/// let stretched = [0.0, 0.0, 0.2, 0.0, 0.2, 0.0, 0.1, 0.0, 0.0, 0.0];
/// let mut gaps = [1.0; 4];
/// tie.search(0.0, &stretched, &[0.0; 10], 0.0)?;
/// tie.gaps(0.0, &stretched, &mut gaps)?;
/// assert!(gaps.iter().all(|gap: &f64| gap.abs() < 1e-15));
/// assert_eq!(Contacts::of(&tie).name(3), (4, 1));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct Tie<T: Real> {
    nodes: Nodes,
    slave: Surface,
    master: Surface,
    reach: f64,
    joint: Joint,
    rows: AffineRows<T>,
    before: AffineRows<T>,
    /// For each row its tied node, by place, and its axis.
    listed: Vec<(usize, usize)>,
    /// Work space of `rates`, and the time that the last search looks ahead.
    differences: SecondDifference,
    ahead: f64,
}

impl<T: Real> Tie<T> {
    /// Ties the facets of a `slave` surface, whose nodes get the rows, to the facets of a `master` within the
    /// [`reach`](Self::reach).
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh, in two or three dimensions, and `dofs` the
    /// dofs of their displacements. Facets list nodes by their index there, and their normals point out of the bodies
    /// ([`Facet`]). The two surfaces must not share a node. Displacements at the start of a run must satisfy the
    /// rows, as zero does.
    ///
    /// # Errors
    ///
    /// Those of [`Mortar::new`](super::Mortar::new), except that corners and edges are accepted. If no facet is
    /// within reach, the first search fails ([`Error::Empty`]).
    pub fn new<F: Into<Facet>, G: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        slave: impl IntoIterator<Item = F>,
        master: impl IntoIterator<Item = G>,
    ) -> Result<Self> {
        let (nodes, surfaces) = Nodes::with_surfaces(coordinates, dofs, slave, master)?;
        let mut tie = Self::between(nodes, surfaces);
        tie.join()?;
        Ok(tie)
    }

    /// Between two surfaces that are not joined yet.
    fn between(nodes: Nodes, [slave, master]: [Surface; 2]) -> Self {
        Self {
            nodes,
            reach: REACH * slave.typical().max(master.typical()),
            slave,
            master,
            joint: Joint::default(),
            rows: AffineRows::default(),
            before: AffineRows::default(),
            listed: Vec::new(),
            differences: SecondDifference::default(),
            ahead: 0.0,
        }
    }

    /// Sets the largest gap or penetration (length), along the normal of the slave's facets, at which surfaces are
    /// tied; by default a tenth of the mean size of the facets, of the coarser surface.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn reach(mut self, reach: T) -> Result<Self> {
        self.reach = positive("the reach of a tie", reach.value())?;
        self.join()?;
        Ok(self)
    }

    /// The tied nodes of the slave, ascending: each has one row per axis.
    pub fn nodes(&self) -> &[usize] {
        &self.joint.tied
    }

    /// ∫ N dA (area; length in two dimensions) in the reference configuration over the covered part of the facets
    /// around a tied node, by its place in [`nodes`](Self::nodes): the forces of its rows divided by it are the
    /// traction.
    pub fn area(&self, place: usize) -> T {
        T::of(self.joint.areas[place])
    }

    /// Ties of bonds, which may break. Rows are along the normal of the slave and across it, and turn with the
    /// facets. Their dofs are the places in `nodes`.
    pub(super) fn of_bonds(nodes: Nodes, surfaces: [Surface; 2]) -> Self {
        let mut tie = Self::between(nodes, surfaces);
        tie.joint = tie.find_joint();
        tie.joint.align(&tie.nodes);
        tie.start();
        tie
    }

    /// For each listed node the row of its first axis, and its place among the tied nodes.
    pub(super) fn listed(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.listed.iter().enumerate().filter(|(_, (_, axis))| *axis == 0).map(|(row, &(place, _))| (row, place))
    }

    fn find_joint(&self) -> Joint {
        Joint::new(&self.slave, &self.master, &self.nodes.coordinates, self.reach)
    }

    /// Finds the tied nodes, their dofs, and their rows at zero displacement.
    fn join(&mut self) -> Result<()> {
        self.joint = self.find_joint();
        self.nodes.read_bodies([&self.slave, &self.master].map(|surface| self.joint.nodes_of(surface)))?;
        self.start();
        Ok(())
    }

    /// Makes the rows of all tied nodes at zero displacement.
    fn start(&mut self) {
        self.list_rows(|_| true);
        self.linearize(&vec![T::zero(); self.nodes.dofs().len()]);
    }

    /// Makes the rows at the current positions of the nodes, with displacements u.
    fn linearize(&mut self, u: &[T]) {
        let Self { nodes, joint, rows, listed, .. } = self;
        joint.turn(&nodes.positions);
        rows.clear();
        for &(place, axis) in listed.iter() {
            let entries = joint.row(place, axis).flat_map(|entry| on_axes(nodes, entry));
            rows.push(joint.gap(place, axis), entries, u);
        }
    }

    /// Lists the rows of the tied nodes for which `holds` is true, by place.
    pub(super) fn list_rows(&mut self, holds: impl Fn(usize) -> bool) {
        let Self { nodes, joint, listed, .. } = self;
        let places = (0..joint.tied.len()).filter(|&place| holds(place));
        listed.clear();
        listed.extend(places.flat_map(|place| (0..nodes.dimension).map(move |axis| (place, axis))));
    }
}

impl<T: Real> ContactConstraint<T> for Tie<T> {
    fn dofs(&self) -> &[usize] {
        self.nodes.dofs()
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        let Self { nodes, joint, rows, listed, .. } = self;
        for (row, &(place, axis)) in listed.iter().enumerate() {
            let node = joint.tied[place];
            let position = nodes.positions[node];
            let size = position.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let mut contact = contacts.push_row((node, axis), ContactLaw::Equality, (&rows.jacobian, row));
            contact.position(position.map(T::of));
            if joint.turns {
                contact.magnitude(T::of(size));
            }
            if let Some(direction) = unit(joint.direction(place, axis)) {
                contact.normal(direction.map(T::of));
            }
        }
    }

    fn gaps(&mut self, _t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        for (row, gap) in gaps.iter_mut().enumerate().take(self.listed.len()) {
            *gap = self.rows.gap(row, u);
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let Self { nodes, slave, master, joint, listed, differences, ahead, .. } = self;
        if !joint.turns {
            return Ok(Rates::Zero);
        }
        rates.fill(GapRates::default());
        let gaps = |_: f64, positions: &[Point], list: &mut Vec<f64>| {
            joint.gaps_at(positions);
            list.extend(listed.iter().map(|&(place, axis)| joint.gap(place, axis)));
        };
        differences.find(nodes, (t, u, v), (*ahead, slave.finest().min(master.finest())), gaps, |row, acceleration| {
            rates[row].acceleration = T::of(acceleration);
        });
        Ok(Rates::Given)
    }

    fn search(&mut self, t: f64, u: &[T], _v: &[T], ahead: f64) -> Result<Candidates> {
        self.ahead = ahead;
        if self.joint.tied.is_empty() {
            let remedy = "bring the surfaces within the reach of the tie, face to face, or give a larger one";
            return Err(Error::Empty { what: "the list of tied nodes", remedy });
        }
        self.follow(t, u)
    }

    fn follow(&mut self, _t: f64, u: &[T]) -> Result<Candidates> {
        check_local(u.len(), self.dofs().len())?;
        // If a trial state is not finite, the gaps are not finite either.
        if !self.joint.turns || self.nodes.move_to(u).is_err() {
            return Ok(Candidates::Unchanged);
        }
        std::mem::swap(&mut self.rows, &mut self.before);
        self.linearize(u);
        Ok(Candidates::changed_if(self.rows.jacobian != self.before.jacobian))
    }

    /// Tied surfaces cannot pass through each other.
    fn inspects(&self) -> bool {
        false
    }

    fn variation(&self) -> Variation {
        if self.joint.turns { Variation::Follows } else { Variation::Never }
    }
}

/// The weights of a node on its dofs.
fn on_axes(nodes: &Nodes, (node, weight): (usize, Point)) -> impl Iterator<Item = (usize, f64)> + use<'_> {
    nodes.places(node).iter().copied().zip(weight)
}
