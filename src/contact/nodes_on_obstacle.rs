//! Nodes of a deformable body against a rigid obstacle, which may move.

use super::dofs::DofList;
use super::obstacle::{across, dot, minus};
use super::{
    Candidates, ContactConstraint, ContactId, ContactLaw, Contacts, GapRates, LARGEST_MISS, LARGEST_TURN, Obstacle,
    Rates, STEEP, Stride, Variation, check_local, check_mesh, press_differently,
};
use crate::error::{Error, Result, positive};
use crate::real::Real;

/// Translation of an obstacle at t, its velocity and its acceleration.
type Motion<'a, T, const D: usize> = Box<dyn FnMut(f64) -> [[T; D]; 3] + Send + 'a>;

/// A node: its number, where it is at u = 0, and the places of the dofs of its displacement.
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

    /// The entries of a vector of the constraint.
    fn of(&self, x: &[T]) -> [T; D] {
        self.dofs.map(|dof| x[dof])
    }
}

/// Friction coefficient at a place in space.
type Roughness<'a, T, const D: usize> = Box<dyn Fn([T; D]) -> f64 + Send + 'a>;

/// Velocity and acceleration of a point of the obstacle's surface at t.
type Drag<'a, T, const D: usize> = Box<dyn FnMut(f64, [T; D]) -> [[T; D]; 2] + Send + 'a>;

/// Nodes against a rigid [`Obstacle`], one row a node: g is the signed distance of the node, G its normal. Rows are
/// identified by (number of the node, 0).
///
/// Rows follow the contact of a step to where it is imposed, so that on any surface gaps are distances at its end;
/// schemes that impose contact on velocities see the tangent plane of the start of the step instead (which moves with
/// the obstacle), and on a surface of radius R that leaves a gap of up to (h v)²/(2R) a step. With a `reach` only nodes
/// nearer than that, or than their velocity brings them within the step, are candidates, and a body farther away costs
/// a bounding box.
///
/// Steps are refused ([`Error::PassedThrough`], which a smaller step mends) in which a node goes straight through the
/// body; presses along a normal that turns by more than 30° on its way; or is stopped along a normal that is not that
/// of the place where it is, so that the energy lost would be wrong by more than a tenth. What this cannot see is a way
/// that is not straight: a node that turns around within a step.
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
/// contact.search(0.0, &[0.0; 4], &[0.0; 4], 0.0)?;
/// contact.gaps(0.5, &[0.0; 4], &mut gaps)?;
/// assert!((gaps[0] - 0.64_f64).abs() < 1e-15 && (gaps[1] - 0.44).abs() < 1e-15);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub struct NodesOnObstacle<'a, T: Real, const D: usize> {
    obstacle: Box<dyn Obstacle<T, D> + 'a>,
    dofs: DofList,
    /// Which of them rows may act on.
    acts: Vec<bool>,
    nodes: Vec<Node<T, D>>,
    law: ContactLaw,
    reach: T,
    motion: Option<Motion<'a, T, D>>,
    friction: f64,
    roughness: Option<Roughness<'a, T, D>>,
    drag: Option<Drag<'a, T, D>>,
    rows: Vec<Row<T, D>>,
    /// Rows of the search before.
    before: Vec<Row<T, D>>,
}

/// A node that is a candidate, by its place in the list of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row<T, const D: usize> {
    node: usize,
    /// Where the distance is linearized, in the frame of the obstacle, with distance and normal there.
    place: [T; D],
    distance: T,
    normal: [T; D],
    /// The largest coordinate of the node, of which that place is what the obstacle's motion leaves.
    size: T,
    /// Coordinates of the node where it was looked at last.
    at: [T; D],
    /// Gap and normal at the search.
    start: (T, [T; D]),
    friction: f64,
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
        let mut list = DofList::default();
        let mut node = |&number: &usize| {
            let dofs = dofs[number].map(|dof| list.place(dof));
            Node { number, place: coordinates[number], dofs }
        };
        let nodes: Vec<_> = nodes.iter().map(&mut node).collect();
        let capacity = nodes.len();
        let (rows, before) = (Vec::with_capacity(capacity), Vec::with_capacity(capacity));
        let (obstacle, law) = (Box::new(obstacle), ContactLaw::Rigid);
        let acts = vec![false; list.as_slice().len()];
        let (reach, friction) = (T::infinity(), 0.0);
        let mut contact = Self {
            obstacle,
            dofs: list,
            acts,
            nodes,
            law,
            reach,
            motion: None,
            friction,
            roughness: None,
            drag: None,
            rows,
            before,
        };
        contact.settle_acting();
        Ok(contact)
    }

    /// Coulomb's friction with a coefficient μ, from 0, for all nodes. Slip is the velocity of a node against the
    /// points of the surface: those move with the obstacle ([`moving`](Self::moving), [`dragging`](Self::dragging)).
    ///
    /// ```
    /// use contact_dynamics::contact::{NodesOnObstacle, Plane};
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{LinearSystem, Newmark, Simulation};
    ///
    /// // A particle is laid on a belt that runs with speed 1 to the right; g = 10, μ = 0.2.
    /// let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    /// let particle = LinearSystem::lumped(vec![1.0; 2], free)?.load(|_, f| f[1] = -10.0);
    /// let belt = NodesOnObstacle::new(Plane::new([0.0; 2], [0.0, 1.0])?, &[[0.0; 2]], &[[0, 1]], &[0])?
    ///     .friction(0.2)
    ///     .dragging(|_, _| [[1.0, 0.0], [0.0; 2]]);
    /// let mut run = Simulation::builder(particle, Newmark::trapezoidal(), 0.01).constraint(belt).build()?;
    /// run.run_until(0.3, &mut ())?;
    /// assert!((run.state().velocity()[0] - 0.6).abs() < 1e-12); // μ g t
    /// run.run_until(1.0, &mut ())?;
    /// assert!((run.state().velocity()[0] - 1.0).abs() < 1e-12); // that of the belt, from t = 0.5 on
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn friction(mut self, coefficient: f64) -> Self {
        self.friction = coefficient;
        self.settle_acting();
        self
    }

    /// Friction with a coefficient that depends on the place of the node in space: it is that of the start of each
    /// step.
    #[must_use]
    pub fn friction_at(mut self, coefficient: impl Fn([T; D]) -> f64 + Send + 'a) -> Self {
        self.roughness = Some(Box::new(coefficient));
        self.settle_acting();
        self
    }

    /// Lets the points of the surface move along it, though the obstacle stays where it is: belts, turning wheels. The
    /// closure returns the velocity at t of the point of the obstacle that is at x (in space), and its acceleration;
    /// those of [`moving`](Self::moving) are added. For a wheel that turns with ω they are ω × r and −ω² r.
    #[must_use]
    pub fn dragging(mut self, drag: impl FnMut(f64, [T; D]) -> [[T; D]; 2] + Send + 'a) -> Self {
        self.drag = Some(Box::new(drag));
        self
    }

    /// Which dofs rows may act on: with friction all, along a fixed normal those it has a part of.
    fn settle_acting(&mut self) {
        let normal = self.obstacle.fixed_normal();
        let rubs = self.roughness.is_some() || self.friction != 0.0;
        self.acts.fill(rubs || normal.is_none());
        for (node, normal) in self.nodes.iter().filter_map(|node| normal.map(|normal| (node, normal))) {
            for (&place, weight) in node.dofs.iter().zip(normal) {
                self.acts[place] |= weight != T::zero();
            }
        }
    }

    /// The law of all rows; [`ContactLaw::Rigid`] by default.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Nodes farther away than this (length) are no candidates, unless their velocity brings them as near as that
    /// within the step; by default all are. It saves the cost of rows that stay open.
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

    /// Whether no node can be within reach: the box around all nodes is farther away than its own half diagonal, and
    /// than the longest way that a node makes against the obstacle, which moves by `carried` in the time `ahead`.
    fn is_far(&self, u: &[T], v: &[T], shift: [T; D], carried: [T; D], ahead: T) -> bool {
        if self.reach.is_infinite() {
            return false;
        }
        let (mut low, mut high) = ([T::infinity(); D], [T::neg_infinity(); D]);
        let mut longest = T::zero();
        for node in &self.nodes {
            let way = minus(node.of(v).map(|v| ahead * v), carried);
            longest = longest.max(dot(way, way));
            for (axis, x) in node.at(u).into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(x), high[axis].max(x));
            }
        }
        let half = T::of(0.5);
        let center = std::array::from_fn(|k| half * (low[k] + high[k]));
        let diagonal = minus(high, low);
        let (distance, _) = self.obstacle.distance(minus(center, shift));
        distance > half * dot(diagonal, diagonal).sqrt() + self.reach + longest.sqrt()
    }
}

/// Refuses the way of a node between two places in the frame of the obstacle, begun with a velocity there: what is
/// wrong, and the gap at its start. The row, if the node has one, comes with its flags at the start and at the end:
/// closed or not.
fn look_at<T: Real, const D: usize>(
    obstacle: &dyn Obstacle<T, D>,
    row: Option<(&Row<T, D>, [bool; 2])>,
    ends: [[T; D]; 2],
    velocity: [T; D],
) -> std::result::Result<(), (&'static str, T)> {
    let way = minus(ends[1], ends[0]);
    let (gap, normal) = obstacle.distance(ends[1]);
    let Some((row, [was_closed, closed])) = row else {
        let start = obstacle.distance(ends[0]).0;
        return match gap < T::zero() || obstacle.passage(ends[0], ends[1]).is_some() {
            true => Err(("was out of reach, and is in the body or beyond it", start)),
            false => Ok(()),
        };
    };
    let (start, start_normal) = row.start;
    if closed {
        if dot(start_normal, normal) < T::of(LARGEST_TURN) {
            return Err(("presses on a surface that turns by more than 30 degrees on the way", start));
        }
        let speed = dot(velocity, velocity).sqrt();
        let shares = [start_normal, normal].map(|n| (dot(n, velocity) / speed).value());
        if !was_closed && speed > T::zero() && press_differently(shares) {
            return Err(("was stopped along a normal that is not the one where it met the surface", start));
        }
        return Ok(());
    }
    // (Between the ends the gap of the search is linear; what is inside in truth alone was missed.)
    let missed = start + dot(start_normal, way) - gap;
    if gap < T::zero() && missed > T::of(LARGEST_MISS) * dot(way, way).sqrt() {
        return Err(("is in the body, and was taken to be outside", start));
    }
    match obstacle.passage(ends[0], ends[1]) {
        Some(passage) if passage.steepness > T::of(STEEP) => Err(("went through the body", start)),
        _ => Ok(()),
    }
}

impl<T: Real, const D: usize> ContactConstraint<T> for NodesOnObstacle<'_, T, D> {
    fn dofs(&self) -> &[usize] {
        self.dofs.as_slice()
    }

    /// Across an axis-aligned normal that is fixed nodes do not act.
    fn only_reads(&self, place: usize) -> bool {
        !self.acts[place]
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        let own = self.obstacle.magnitude();
        for row in &self.rows {
            let node = &self.nodes[row.node];
            let mut entries = [(0, T::zero()); D];
            let mut count = 0;
            for (&place, weight) in node.dofs.iter().zip(row.normal) {
                if weight != T::zero() {
                    entries[count] = (place, weight);
                    count += 1;
                }
            }
            let size = row.place.iter().fold(row.size.max(own), |most, x| most.max(x.abs()));
            let mut contact = contacts.push((node.number, 0), self.law, &entries[..count]);
            let contact = contact.magnitude(size).position(in_space(row.at)).normal(in_space(row.normal));
            if row.friction == 0.0 {
                continue;
            }
            let mut contact = contact.friction(row.friction);
            for tangent in across(row.normal).into_iter().take(D.saturating_sub(1)) {
                for (entry, along) in entries.iter_mut().zip(node.dofs.into_iter().zip(tangent)) {
                    *entry = along;
                }
                contact = contact.tangent(&entries);
            }
        }
    }

    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        check_local(u.len(), self.dofs.as_slice().len())?;
        std::mem::swap(&mut self.rows, &mut self.before);
        self.rows.clear();
        let [shift, ..] = self.motion(t);
        let carried = match self.reach.is_infinite() || self.motion.is_none() {
            true => [T::zero(); D],
            false => minus(self.motion(t + ahead)[0], shift),
        };
        let ahead = T::of(ahead);
        if !self.is_far(u, v, shift, carried, ahead) {
            for (index, node) in self.nodes.iter().enumerate() {
                let (x, size) = (node.at(u), |size: T, x: &T| size.max(x.abs()));
                let (place, size) = (minus(x, shift), x.iter().fold(T::zero(), size));
                let (distance, normal) = self.obstacle.distance(place);
                let near = || {
                    let way = minus(node.of(v).map(|v| ahead * v), carried);
                    distance <= self.reach + dot(way, way).sqrt()
                };
                // NaN stays, to be reported as a gap.
                if distance <= self.reach || distance.is_nan() || near() {
                    self.rows.push(Row {
                        node: index,
                        place,
                        distance,
                        normal,
                        size,
                        at: x,
                        start: (distance, normal),
                        friction: self.roughness.as_ref().map_or(self.friction, |friction| friction(x)),
                    });
                }
            }
        }
        let same = |(new, old): (&Row<T, D>, &Row<T, D>)| {
            // (A coefficient that is NaN is refused when it is read.)
            new.node == old.node && new.normal == old.normal && new.friction.to_bits() == old.friction.to_bits()
        };
        let kept = self.rows.len() == self.before.len() && self.rows.iter().zip(&self.before).all(same);
        Ok(Candidates::changed_if(!kept))
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        if self.obstacle.fixed_normal().is_some() {
            return Ok(Candidates::Unchanged);
        }
        let [shift, ..] = self.motion(t);
        let mut moved = Candidates::Unchanged;
        for row in &mut self.rows {
            let x = self.nodes[row.node].at(u);
            (row.place, row.size) = (minus(x, shift), x.iter().fold(T::zero(), |size, x| size.max(x.abs())));
            let (distance, normal) = self.obstacle.distance(row.place);
            (row.distance, row.at) = (distance, x);
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

    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        for row in &mut self.rows {
            row.at = self.nodes[row.node].at(step.u[1]);
        }
        // Through a plane a row lets nothing pass.
        if self.reach.is_infinite() && self.obstacle.fixed_normal().is_some() {
            return Ok(());
        }
        let [[from, speed, _], [to, ..]] = step.t.map(|t| self.motion(t));
        let Self { nodes, rows, obstacle, reach, .. } = self;
        let mut rows = rows.iter().enumerate().peekable();
        for (index, node) in nodes.iter().enumerate() {
            let row = rows.next_if(|(_, row)| row.node == index);
            let ends = [minus(node.at(step.u[0]), from), minus(node.at(step.u[1]), to)];
            let way = minus(ends[1], ends[0]);
            let length = dot(way, way).sqrt();
            // What is no candidate was farther away than the reach.
            if row.map_or(*reach, |(_, row)| row.start.0) > length {
                continue;
            }
            let row = row.map(|(k, row)| (row, step.closed.map(|flags| flags[k])));
            if let Err((what, gap)) = look_at(&**obstacle, row, ends, minus(node.of(step.v), speed)) {
                return Err(step.refuse((node.number, 0), what, length.value(), gap.value()));
            }
        }
        Ok(())
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        let [shift, ..] = self.motion(t);
        let flat = self.obstacle.fixed_normal().is_some();
        for (row, gap) in self.rows.iter().zip(gaps) {
            let place = minus(self.nodes[row.node].at(u), shift);
            *gap = match flat {
                // The distance itself is affine, and the same to the bit whenever the last search was.
                true => self.obstacle.distance(place).0,
                false => row.distance + dot(row.normal, minus(place, row.place)),
            };
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        if self.obstacle.fixed_normal().is_some() && self.motion.is_none() {
            return Ok(Rates::Zero);
        }
        let [shift, velocity, acceleration] = self.motion(t);
        for (row, rates) in self.rows.iter().zip(rates) {
            let node = &self.nodes[row.node];
            let curvature = self.obstacle.curvature(minus(node.at(u), shift), minus(node.of(v), velocity));
            *rates =
                GapRates { rate: -dot(row.normal, velocity), acceleration: curvature - dot(row.normal, acceleration) };
        }
        Ok(Rates::Given)
    }

    fn slip_rates(&mut self, t: f64, u: &[T], _v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        if self.motion.is_none() && self.drag.is_none() {
            return Ok(Rates::Zero);
        }
        let [_, velocity, acceleration] = self.motion(t);
        let Self { nodes, rows, drag, .. } = self;
        let mut rates = rates.iter_mut();
        for row in rows.iter().filter(|row| row.friction != 0.0) {
            let still = [[T::zero(); D]; 2];
            let [along, faster] = drag.as_mut().map_or(still, |drag| drag(t, nodes[row.node].at(u)));
            for (rates, tangent) in rates.by_ref().take(D.saturating_sub(1)).zip(across(row.normal)) {
                *rates = GapRates {
                    rate: -dot(tangent, velocity) - dot(tangent, along),
                    acceleration: -dot(tangent, acceleration) - dot(tangent, faster),
                };
            }
        }
        Ok(Rates::Given)
    }

    fn variation(&self) -> Variation {
        match self.obstacle.fixed_normal() {
            Some(_) if self.reach.is_infinite() && self.roughness.is_none() => Variation::Never,
            Some(_) => Variation::BySearch,
            None => Variation::Follows,
        }
    }
}

/// A vector with the axes that it does not have.
fn in_space<T: Real, const D: usize>(x: [T; D]) -> [T; 3] {
    std::array::from_fn(|axis| x.get(axis).copied().unwrap_or(T::zero()))
}
