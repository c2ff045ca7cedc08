//! Contact of nodes of a deformable body with a rigid obstacle, which may move and turn.

mod motion;
mod passage;

use super::dofs::DofList;
use super::obstacle::{across, dot, minus};
use super::{
    Candidates, ContactConstraint, ContactId, ContactLaw, Contacts, GapRates, Obstacle, Rates, RigidMotion, Stride,
    Variation, check_local, check_mesh,
};
use crate::error::{Error, Result, positive};
use crate::real::Real;
use motion::{Course, Motion};
use passage::{check_path, turns_too_far};

/// A node: its index, its position at u = 0, and the places of the dofs of its displacement.
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

/// The friction coefficient: of all nodes, or by their position in space.
enum Friction<'a, T, const D: usize> {
    Constant(f64),
    At(Box<dyn Fn([T; D]) -> f64 + Send + 'a>),
}

/// Velocity and acceleration of a point of the obstacle's surface at t.
type Drag<'a, T, const D: usize> = Box<dyn FnMut(f64, [T; D]) -> [[T; D]; 2] + Send + 'a>;

/// Contact of nodes with a rigid [`Obstacle`], one row per node: g is the signed distance of the node, G its normal.
/// Rows are identified by (index of the node, 0).
///
/// Rows follow the contact of a step to the time at which it is imposed, so that on any surface gaps are distances at
/// the end of the step. Schemes that impose contact on velocities use the tangent plane at the start of the step
/// instead. It moves with the obstacle, but if the obstacle turns, its normal is kept for the step. On a surface of
/// radius R this leaves a gap of up to (h v)²/(2R) per step. With a `reach`, only nodes that are within it, or that
/// reach it by their velocity within the step, are candidates, and a body farther away costs a bounding box.
///
/// A step is rejected ([`Error::PassedThrough`], and a smaller step helps) if a node goes straight through the body;
/// if it presses along a normal that turns by more than 30° on its path; if it is stopped along a normal that differs
/// from the normal at its position, so that the energy lost would be wrong by more than a tenth; or if the obstacle
/// [turns](Self::turning) by more than 30° with a node near it. Paths count as straight: a node that turns around
/// within a step is not detected.
///
/// ```
/// use contact_dynamics::contact::Plane;
/// use contact_dynamics::{ContactConstraint, ContactLaw, NodesOnObstacle};
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
    /// For each dof whether rows may act on it.
    acts: Vec<bool>,
    nodes: Vec<Node<T, D>>,
    law: ContactLaw,
    reach: T,
    motion: Motion<'a, T, D>,
    friction: Friction<'a, T, D>,
    drag: Option<Drag<'a, T, D>>,
    rows: Vec<Row<T, D>>,
    before: Vec<Row<T, D>>,
}

/// A node that is a candidate, by its place in the list of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row<T, const D: usize> {
    node: usize,
    /// The point of linearization, with distance and normal there, in the frame of the obstacle.
    place: [T; D],
    distance: T,
    own_normal: [T; D],
    /// The normal in space.
    normal: [T; D],
    /// The latest coordinates of the node.
    at: [T; D],
    /// Gap and normal at the search, in the frame of the obstacle.
    start: (T, [T; D]),
    friction: f64,
}

impl<T: Real, const D: usize> Row<T, D> {
    /// Distance of a point in the frame of the obstacle from the tangent plane.
    fn on_tangent_plane(&self, place: [T; D]) -> T {
        self.distance + dot(self.own_normal, minus(place, self.place))
    }

    /// Distance and normal of a point in the frame of the obstacle. For a point on the other side of the obstacle the
    /// tangent plane is used, so that a node cannot pass through undetected.
    fn distance_from(&self, obstacle: &dyn Obstacle<T, D>, place: [T; D]) -> (T, [T; D]) {
        let (distance, normal) = obstacle.distance(place);
        match dot(normal, self.own_normal) > T::zero() {
            true => (distance, normal),
            false => (self.on_tangent_plane(place), self.own_normal),
        }
    }
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
    /// `nodes` lists nodes by their index there.
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
        let (obstacle, law) = (Box::new(obstacle), ContactLaw::Rigid);
        let acts = vec![false; list.as_slice().len()];
        let (reach, friction) = (T::infinity(), Friction::Constant(0.0));
        let mut contact = Self {
            obstacle,
            dofs: list,
            acts,
            nodes,
            law,
            reach,
            motion: Motion::Rest,
            friction,
            drag: None,
            rows: Vec::new(),
            before: Vec::new(),
        };
        contact.find_acting_dofs();
        Ok(contact)
    }

    /// Sets Coulomb's friction with a coefficient μ ≥ 0 for all nodes. Slip is the velocity of a node relative to the
    /// points of the surface, which move with the obstacle ([`moving`](Self::moving), [`turning`](Self::turning)) or
    /// along it ([`dragging`](Self::dragging)).
    ///
    /// ```
    /// use contact_dynamics::contact::Plane;
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearSystem, NodesOnObstacle, Simulation};
    ///
    /// // A particle is laid on a belt that runs with speed 1 to the right; g = 10, μ = 0.2.
    /// let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    /// let particle = LinearSystem::lumped(vec![1.0; 2], free)?.load(|_, f| f[1] = -10.0);
    /// let belt = NodesOnObstacle::new(Plane::new([0.0; 2], [0.0, 1.0])?, &[[0.0; 2]], &[[0, 1]], &[0])?
    ///     .friction(0.2)
    ///     .dragging(|_, _| [[1.0, 0.0], [0.0; 2]]);
    /// let mut run = Simulation::builder(particle, GeneralizedAlpha::default(), 0.01).constraint(belt).build()?;
    /// run.run_until(0.3, &mut ())?;
    /// assert!((run.state().velocity()[0] - 0.6).abs() < 1e-12); // μ g t
    /// run.run_until(1.0, &mut ())?;
    /// assert!((run.state().velocity()[0] - 1.0).abs() < 1e-12); // the speed of the belt, from t = 0.5 on
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn friction(mut self, coefficient: f64) -> Self {
        self.friction = Friction::Constant(coefficient);
        self.find_acting_dofs();
        self
    }

    /// Sets a friction coefficient that depends on the position of the node in space, evaluated at the start of each
    /// step.
    #[must_use]
    pub fn friction_at(mut self, coefficient: impl Fn([T; D]) -> f64 + Send + 'a) -> Self {
        self.friction = Friction::At(Box::new(coefficient));
        self.find_acting_dofs();
        self
    }

    /// Moves the points of the surface along it while the obstacle stays at its position: belts, turning wheels. The
    /// closure returns the velocity and the acceleration at t of the point of the obstacle at x (in space). The
    /// motions of [`moving`](Self::moving) and [`turning`](Self::turning) are added. For a wheel that turns with ω
    /// they are ω × r and −ω² r. In contrast to an obstacle that turns, its rotation in a step is not limited.
    #[must_use]
    pub fn dragging(mut self, drag: impl FnMut(f64, [T; D]) -> [[T; D]; 2] + Send + 'a) -> Self {
        self.drag = Some(Box::new(drag));
        self
    }

    /// Finds the dofs on which rows may act: all with friction; for a fixed normal those along its nonzero
    /// components.
    fn find_acting_dofs(&mut self) {
        let normal = self.fixed_normal();
        let has_friction = !matches!(self.friction, Friction::Constant(0.0));
        self.acts.fill(has_friction || normal.is_none());
        for (node, normal) in self.nodes.iter().filter_map(|node| normal.map(|normal| (node, normal))) {
            for (&place, weight) in node.dofs.iter().zip(normal) {
                self.acts[place] |= weight != T::zero();
            }
        }
    }

    /// Sets the law of all rows; [`ContactLaw::Rigid`] by default.
    #[must_use]
    pub fn with_law(mut self, law: ContactLaw) -> Self {
        self.law = law;
        self
    }

    /// Sets the distance (length) beyond which nodes are not candidates, unless their velocity brings them within it
    /// in the step; by default all nodes are candidates. It saves the cost of rows that stay open.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn reach(mut self, reach: T) -> Result<Self> {
        positive("the reach of the contact", reach.value())?;
        self.reach = reach;
        Ok(self)
    }

    /// Moves the obstacle without turning it: the closure returns its displacement at t, its velocity and its
    /// acceleration.
    #[must_use]
    pub fn moving(mut self, motion: impl FnMut(f64) -> [[T; D]; 3] + Send + 'a) -> Self {
        self.motion = Motion::Shifting(Box::new(motion));
        self.find_acting_dofs();
        self
    }

    /// Moves and turns the obstacle: the closure returns its [`RigidMotion`] at t. In its own frame the obstacle is
    /// at rest, so that any [`Obstacle`] can turn.
    ///
    /// With the motion x = c + R y of its points, r = x − c, and ω × r the velocity of turning, the gap of a node at x
    /// is the distance d at y = Rᵀ(x − c), its normal n = R ∇d, and
    ///
    /// ```text
    /// ∂g/∂t = −n · (v_c + ω × r)
    /// g̈ = n · (a − a_c − ω̇ × r − ω × (ω × r) − 2 ω × w) + ẏᵀ (∇²d) ẏ,   w = v − v_c − ω × r,  ẏ = Rᵀ w
    /// ```
    ///
    /// A plane that turns is treated as a curved surface: its rows follow. A step in which the obstacle turns by more
    /// than 30° is rejected ([`Error::PassedThrough`]) if a node is nearer than its path as seen from the obstacle,
    /// even for a ball that turns about its center. For obstacles that turn fast without changing their shape in
    /// space use [`dragging`](Self::dragging). Rates that are zero while gaps change are rejected
    /// ([`Error::SilentMotion`]); [`verify::gap_jacobian`](crate::verify::gap_jacobian) finds other wrong rates. A
    /// closure that does not return a rotation causes [`Error::Parameter`] or [`Error::NotFinite`].
    ///
    /// ```
    /// use contact_dynamics::contact::{Plane, RigidMotion};
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{LinearSystem, Newmark, NodesOnObstacle, Simulation};
    ///
    /// // A tube that turns about the origin with ω = 2 flings out what is in it: r = r₀ cosh ω t, and presses on it
    /// // with 2 m ω ṙ.
    /// let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    /// let tube = NodesOnObstacle::new(Plane::new([0.0; 2], [0.0, 1.0])?, &[[1.0, 0.0]], &[[0, 1]], &[0])?
    ///     .turning(|t| RigidMotion::about_point([0.0; 2], [2.0 * t, 2.0, 0.0]));
    /// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0; 2], free)?, Newmark::trapezoidal(), 1e-3)
    ///     .velocity(vec![0.0, 2.0])
    ///     .constraint(tube)
    ///     .build()?;
    /// run.run_until(1.0, &mut ())?;
    /// let u = run.state().displacement();
    /// let (r, force) = ((1.0 + u[0]).hypot(u[1]), run.state().contacts().forces()[0]);
    /// assert!((r / 2.0_f64.cosh() - 1.0).abs() < 1e-5);
    /// assert!((force / (8.0 * 2.0_f64.sinh()) - 1.0).abs() < 1e-5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn turning(mut self, motion: impl FnMut(f64) -> RigidMotion<T, D> + Send + 'a) -> Self {
        self.motion = Motion::Turning(Box::new(motion));
        self.find_acting_dofs();
        self
    }

    /// The normal in space, if it is the same everywhere and at all times.
    fn fixed_normal(&self) -> Option<[T; D]> {
        self.obstacle.fixed_normal().filter(|_| !self.motion.turns())
    }

    /// Whether no node can be within reach: the center of the box around all nodes is farther away than its half
    /// diagonal plus the reach plus the longest path of a node relative to the obstacle in the time `ahead`.
    fn is_far(&self, u: &[T], v: &[T], course: &Course<T, D>, ahead: T) -> bool {
        if self.reach.is_infinite() {
            return false;
        }
        let (mut low, mut high) = ([T::infinity(); D], [T::neg_infinity(); D]);
        let mut longest = T::zero();
        for node in &self.nodes {
            let at = node.at(u);
            longest = longest.max(course.square(at, node.of(v).map(|v| ahead * v)));
            for (axis, x) in at.into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(x), high[axis].max(x));
            }
        }
        let half = T::of(0.5);
        let center = std::array::from_fn(|k| half * (low[k] + high[k]));
        let diagonal = minus(high, low);
        let (distance, _) = self.obstacle.distance(course.ends[0].to_own(center));
        distance > half * dot(diagonal, diagonal).sqrt() + self.reach + longest.sqrt()
    }
}

impl<T: Real, const D: usize> ContactConstraint<T> for NodesOnObstacle<'_, T, D> {
    fn dofs(&self) -> &[usize] {
        self.dofs.as_slice()
    }

    /// Nodes do not act on the axes across a fixed normal along an axis.
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
            let size = row.place.iter().chain(&row.at).fold(own, |most, x| most.max(x.abs()));
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
        let now = self.motion.at(t)?;
        let still = self.reach.is_infinite() || self.motion.is_rest();
        let later = if still { now } else { self.motion.at(t + ahead)? };
        let ahead = T::of(ahead);
        let course = Course::new([now, later], ahead);
        if !self.is_far(u, v, &course, ahead) {
            for (index, node) in self.nodes.iter().enumerate() {
                let x = node.at(u);
                let place = now.to_own(x);
                let (distance, normal) = self.obstacle.distance(place);
                let near = || distance <= self.reach + course.square(x, node.of(v).map(|v| ahead * v)).sqrt();
                // NaN is kept, to be reported as a gap.
                if distance <= self.reach || distance.is_nan() || near() {
                    self.rows.push(Row {
                        node: index,
                        place,
                        distance,
                        own_normal: normal,
                        normal: now.direction(normal),
                        at: x,
                        start: (distance, normal),
                        friction: match &self.friction {
                            Friction::Constant(coefficient) => *coefficient,
                            Friction::At(coefficient) => coefficient(x),
                        },
                    });
                }
            }
        }
        let same = |(new, old): (&Row<T, D>, &Row<T, D>)| {
            // A NaN coefficient is rejected when it is read.
            new.node == old.node && new.normal == old.normal && new.friction.to_bits() == old.friction.to_bits()
        };
        let kept = self.rows.len() == self.before.len() && self.rows.iter().zip(&self.before).all(same);
        Ok(Candidates::changed_if(!kept))
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        if self.fixed_normal().is_some() {
            return Ok(Candidates::Unchanged);
        }
        let now = self.motion.at(t)?;
        let mut moved = Candidates::Unchanged;
        for row in &mut self.rows {
            let x = self.nodes[row.node].at(u);
            row.place = now.to_own(x);
            let (distance, own_normal) = self.obstacle.distance(row.place);
            let normal = now.direction(own_normal);
            (row.distance, row.own_normal, row.at) = (distance, own_normal, x);
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
        // A node with a row cannot pass through a plane.
        if self.reach.is_infinite() && self.fixed_normal().is_some() {
            return Ok(());
        }
        let [from, to] = [self.motion.at(step.t[0])?, self.motion.at(step.t[1])?];
        let course = Course::new([from, to], T::of(step.t[1] - step.t[0]));
        let Self { nodes, rows, obstacle, reach, .. } = self;
        let mut rows = rows.iter().enumerate().peekable();
        for (index, node) in nodes.iter().enumerate() {
            let row = rows.next_if(|(_, row)| row.node == index);
            let places = step.u.map(|u| node.at(u));
            let ends = [from.to_own(places[0]), to.to_own(places[1])];
            let path = minus(ends[1], ends[0]);
            let length = dot(path, path).sqrt() + course.bend(places[0], minus(places[1], places[0]));
            // A node without a row was farther away than the reach.
            let start = row.map_or(*reach, |(_, row)| row.start.0);
            if start > length {
                continue;
            }
            let row = row.map(|(k, row)| (row, step.closed.map(|flags| flags[k])));
            let checked = match turns_too_far(course.angle) {
                true => Err(("is near an obstacle that turns by more than 30 degrees in the step", start)),
                false => check_path(&**obstacle, row, ends, from.own_velocity(places[0], node.of(step.v))),
            };
            if let Err((what, gap)) = checked {
                return Err(step.rejected((node.number, 0), what, length.value(), gap.value()));
            }
        }
        Ok(())
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        let now = self.motion.at(t)?;
        let (flat, turns) = (self.obstacle.fixed_normal().is_some(), self.motion.turns());
        for (row, gap) in self.rows.iter().zip(gaps) {
            let place = now.to_own(self.nodes[row.node].at(u));
            *gap = match (flat, turns) {
                // The distance itself is affine. It is bitwise the same for any time of the last search.
                (true, _) => self.obstacle.distance(place).0,
                (false, true) => row.distance_from(&*self.obstacle, place).0,
                (false, false) => row.on_tangent_plane(place),
            };
        }
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        if self.obstacle.fixed_normal().is_some() && self.motion.is_rest() {
            return Ok(Rates::Zero);
        }
        let (now, turns) = (self.motion.at(t)?, self.motion.turns());
        for (row, rates) in self.rows.iter().zip(rates) {
            let node = &self.nodes[row.node];
            let (x, v) = (node.at(u), node.of(v));
            let (place, velocity) = (now.to_own(x), now.velocity_at(x));
            let mut rate = -dot(row.normal, velocity);
            if turns {
                // Away from the point of linearization the gap has another normal, which adds to ġ besides G v.
                let normal = now.direction(row.distance_from(&*self.obstacle, place).1);
                rate += dot(minus(normal, row.normal), minus(v, velocity));
            }
            let curvature = self.obstacle.curvature(place, now.own_velocity(x, v));
            *rates = GapRates { rate, acceleration: curvature - dot(row.normal, now.apparent_acceleration(x, v)) };
        }
        Ok(Rates::Given)
    }

    fn slip_rates(&mut self, t: f64, u: &[T], _v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        if self.motion.is_rest() && self.drag.is_none() {
            return Ok(Rates::Zero);
        }
        let now = self.motion.at(t)?;
        let Self { nodes, rows, drag, .. } = self;
        let mut rates = rates.iter_mut();
        for row in rows.iter().filter(|row| row.friction != 0.0) {
            let x = nodes[row.node].at(u);
            let (velocity, acceleration) = (now.velocity_at(x), now.acceleration_at(x));
            let still = [[T::zero(); D]; 2];
            let [along, faster] = drag.as_mut().map_or(still, |drag| drag(t, x));
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
        match self.fixed_normal() {
            Some(_) if self.reach.is_infinite() && matches!(self.friction, Friction::Constant(_)) => Variation::Never,
            Some(_) => Variation::BySearch,
            None => Variation::Follows,
        }
    }
}

/// A vector in space; missing axes are zero.
fn in_space<T: Real, const D: usize>(x: [T; D]) -> [T; 3] {
    std::array::from_fn(|axis| x.get(axis).copied().unwrap_or(T::zero()))
}
