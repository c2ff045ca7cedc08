//! Nodes of a deformable body against a rigid obstacle, which may move.

use super::obstacle::{dot, minus};
use super::{
    Candidates, ContactConstraint, ContactId, ContactJacobian, ContactLaw, GapRates, Obstacle, check_mesh, positive,
};
use crate::error::{Error, Result};
use crate::real::Real;

/// Translation of an obstacle at t, its velocity and its acceleration.
type Motion<'a, T, const D: usize> = Box<dyn FnMut(f64) -> [[T; D]; 3] + Send + 'a>;

/// A node: its number, where it is at u = 0, and the dofs of its displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node<T, const D: usize> {
    number: usize,
    place: [T; D],
    dofs: [usize; D],
}

impl<T: Real, const D: usize> Node<T, D> {
    /// Coordinates at u.
    fn at(&self, u: &[T]) -> [T; D] {
        std::array::from_fn(|axis| self.place[axis] + u[self.dofs[axis]])
    }

    /// The entries of a vector of the system.
    fn of(&self, x: &[T]) -> [T; D] {
        self.dofs.map(|dof| x[dof])
    }
}

/// Nodes against a rigid [`Obstacle`], one row a node: g is the signed distance of the node, G its normal. Rows are
/// identified by the number of the node.
///
/// Rows follow the contact of a step to where it is imposed, so that on any surface gaps are distances at its end; schemes that
/// impose contact on velocities see the tangent plane of the start of the step instead (and the obstacle's own motion exactly),
/// which on a surface of radius R leaves a gap of up to (h v)²/(2R) a step. With a `reach` only nodes nearer than that are candidates, and a body farther away
/// costs a bounding box.
///
/// ```
/// use contact_dynamics::contact::{ContactConstraint, ContactLaw, NodesOnObstacle, Plane};
///
/// let (coordinates, dofs) = ([[1.0, 0.0], [0.0, 0.5]], [[0, 1], [2, 3]]);
/// let slope = Plane::new([0.0, 0.0], [0.6, 0.8])?;
/// let mut contact = NodesOnObstacle::new(slope, &coordinates, &dofs, &[0, 1])?
///     .with_law(ContactLaw::Rigid)
///     .moving(|t| [[0.0, -0.1 * t], [0.0, -0.1], [0.0, 0.0]]); // sinks with speed 0.1
/// let mut gaps = [0.0; 2];
/// contact.search(0.0, &[0.0; 4], &[0.0; 4])?;
/// contact.gap(0.5, &[0.0; 4], &mut gaps);
/// assert!((gaps[0] - 0.64_f64).abs() < 1e-15 && (gaps[1] - 0.44).abs() < 1e-15);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub struct NodesOnObstacle<'a, T: Real, const D: usize> {
    obstacle: Box<dyn Obstacle<T, D> + 'a>,
    nodes: Vec<Node<T, D>>,
    law: ContactLaw,
    reach: T,
    motion: Option<Motion<'a, T, D>>,
    rows: Vec<Row<T, D>>,
    /// Rows of the search before.
    before: Vec<Row<T, D>>,
}

/// A node that is a candidate, by its place in the list of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row<T, const D: usize> {
    node: usize,
    normal: [T; D],
    /// Where the distance is linearized.
    place: [T; D],
}

impl<T: Real, const D: usize> std::fmt::Debug for NodesOnObstacle<'_, T, D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NodesOnObstacle")
            .field("nodes", &self.nodes.len())
            .field("law", &self.law)
            .field("candidates", &self.rows.len())
            .finish_non_exhaustive()
    }
}

impl<'a, T: Real, const D: usize> NodesOnObstacle<'a, T, D> {
    /// Rigid contact of `nodes` with an obstacle at rest.
    ///
    /// `coordinates` are the reference coordinates of all nodes of a mesh and `dofs` the dofs of their displacements;
    /// `nodes` names nodes by their index there.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the lists differ in length or a node does not exist, [`Error::NotFinite`] for the
    /// coordinates (index: node).
    pub fn new(
        obstacle: impl Obstacle<T, D> + 'a,
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        nodes: &[usize],
    ) -> Result<Self> {
        check_mesh(coordinates, dofs, nodes)?;
        let node = |&number: &usize| Node { number, place: coordinates[number], dofs: dofs[number] };
        let nodes: Vec<_> = nodes.iter().map(node).collect();
        let capacity = nodes.len();
        let (rows, before) = (Vec::with_capacity(capacity), Vec::with_capacity(capacity));
        let (obstacle, law) = (Box::new(obstacle), ContactLaw::Rigid);
        Ok(Self { obstacle, nodes, law, reach: T::infinity(), motion: None, rows, before })
    }

    /// The law of all rows; [`ContactLaw::Rigid`] by default.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Nodes farther away than this (length) are no candidates; by default all are. No node must travel as far in a step.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless it is positive and finite.
    pub fn reach(mut self, reach: T) -> Result<Self> {
        positive("the reach of the contact", reach.value())?;
        self.reach = reach;
        Ok(self)
    }

    /// Moves the obstacle: the closure returns its translation at t, its velocity and its acceleration.
    #[must_use]
    pub fn moving(mut self, motion: impl FnMut(f64) -> [[T; D]; 3] + Send + 'a) -> Self {
        self.motion = Some(Box::new(motion));
        self
    }

    /// Translation, velocity and acceleration of the obstacle.
    fn motion(&mut self, t: f64) -> [[T; D]; 3] {
        self.motion.as_mut().map_or([[T::zero(); D]; 3], |motion| motion(t))
    }

    /// Whether no node can be within reach: the box around all nodes is farther away than its own half diagonal.
    fn is_far(&self, u: &[T], shift: [T; D]) -> bool {
        if self.reach.is_infinite() {
            return false;
        }
        let (mut low, mut high) = ([T::infinity(); D], [T::neg_infinity(); D]);
        for node in &self.nodes {
            for (axis, x) in node.at(u).into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(x), high[axis].max(x));
            }
        }
        let half = T::of(0.5);
        let center = std::array::from_fn(|k| half * (low[k] + high[k]));
        let diagonal = minus(high, low);
        let (distance, _) = self.obstacle.distance(minus(center, shift));
        distance > half * dot(diagonal, diagonal).sqrt() + self.reach
    }
}

impl<T: Real, const D: usize> ContactConstraint<T> for NodesOnObstacle<'_, T, D> {
    fn max_candidates(&self) -> usize {
        self.nodes.len()
    }

    fn max_entries(&self) -> usize {
        D * self.nodes.len()
    }

    fn check(&self, dofs: usize) -> Result<()> {
        match self.nodes.iter().flat_map(|node| node.dofs).find(|&dof| dof >= dofs) {
            Some(dof) => Err(Error::MissingDof { what: "a contact node", dof, dofs }),
            None => Ok(()),
        }
    }

    fn dofs(&self, out: &mut Vec<usize>) {
        let normal = self.obstacle.fixed_normal();
        let acts = |axis: usize| normal.is_none_or(|normal| normal[axis] != T::zero());
        for node in &self.nodes {
            out.extend((0..D).filter(|&axis| acts(axis)).map(|axis| node.dofs[axis]));
        }
    }

    fn search(&mut self, t: f64, u: &[T], _: &[T]) -> Result<Candidates> {
        std::mem::swap(&mut self.rows, &mut self.before);
        self.rows.clear();
        let [shift, ..] = self.motion(t);
        if !self.is_far(u, shift) {
            for (index, node) in self.nodes.iter().enumerate() {
                let place = node.at(u);
                let (distance, normal) = self.obstacle.distance(minus(place, shift));
                // NaN stays, to be reported as a gap.
                if distance <= self.reach || distance.is_nan() {
                    self.rows.push(Row { node: index, normal, place });
                }
            }
        }
        let same = |(new, old): (&Row<T, D>, &Row<T, D>)| new.node == old.node && new.normal == old.normal;
        match self.rows.len() == self.before.len() && self.rows.iter().zip(&self.before).all(same) {
            true => Ok(Candidates::Unchanged),
            false => Ok(Candidates::Changed),
        }
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        if self.obstacle.fixed_normal().is_some() {
            return Ok(Candidates::Unchanged);
        }
        let [shift, ..] = self.motion(t);
        let mut moved = Candidates::Unchanged;
        for row in &mut self.rows {
            row.place = self.nodes[row.node].at(u);
            let (_, normal) = self.obstacle.distance(minus(row.place, shift));
            if let Some(x) = normal.iter().find(|x| !x.is_finite()) {
                let contact = ContactId { constraint: 0, feature: self.nodes[row.node].number, candidate: 0 };
                return Err(Error::ContactNotFinite { t, what: "the normal", contact, value: x.value() });
            }
            if normal != row.normal {
                row.normal = normal;
                moved = Candidates::Changed;
            }
        }
        Ok(moved)
    }

    fn candidates(&self) -> usize {
        self.rows.len()
    }

    fn identity(&self, row: usize) -> (usize, usize) {
        (self.nodes[self.rows[row].node].number, 0)
    }

    fn law(&self, _: usize) -> ContactLaw {
        self.law
    }

    fn magnitude(&self, row: usize) -> T {
        self.rows[row].place.iter().fold(T::zero(), |most, x| most.max(x.abs()))
    }

    fn jacobian(&self, out: &mut ContactJacobian<T>) {
        for row in &self.rows {
            let mut entries = [(0, T::zero()); D];
            let mut count = 0;
            for (&dof, weight) in self.nodes[row.node].dofs.iter().zip(row.normal) {
                // Across an axis-aligned normal a node does not act, and its dof need not be on the interface.
                if weight != T::zero() {
                    entries[count] = (dof, weight);
                    count += 1;
                }
            }
            out.push(&entries[..count]);
        }
    }

    fn gap(&mut self, t: f64, u: &[T], out: &mut [T]) {
        let [shift, ..] = self.motion(t);
        for (row, gap) in self.rows.iter().zip(out) {
            let (distance, _) = self.obstacle.distance(minus(row.place, shift));
            *gap = distance + dot(row.normal, minus(self.nodes[row.node].at(u), row.place));
        }
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) {
        let [shift, velocity, acceleration] = self.motion(t);
        for (row, rates) in self.rows.iter().zip(out) {
            let node = &self.nodes[row.node];
            let curvature = self.obstacle.curvature(minus(node.at(u), shift), minus(node.of(v), velocity));
            *rates =
                GapRates { rate: -dot(row.normal, velocity), acceleration: curvature - dot(row.normal, acceleration) };
        }
    }
}
