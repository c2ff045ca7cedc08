//! A certificate that surfaces do not pass through each other in a step.

use super::surface::{
    Bounds, Corners, Facet, Neighborhood, Nodes, Point, Shape, Surface, add_scaled, distance_in_motion, dot, middle,
    norm, unit,
};
use super::{Candidates, ContactConstraint, Contacts, Stride, Variation, check_local};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Certifies every step: no node passes through a facet, and no edge through an edge, of the same or of another body.
///
/// It is a constraint without contacts, beside the constraints that keep the bodies apart. It checks each step before
/// it is accepted ([`inspect`](ContactConstraint::inspect)) and rejects a step that it cannot certify
/// ([`Error::NotCertified`]). With [`StepControl`](crate::StepControl) a rejected step is repeated with half the size.
/// At the smallest size the run stops with [`Error::StepRefused`]: no step is accepted without a certificate.
///
/// # What is proven
///
/// Contact forces leave small penetrations: by rounding, and by design where gaps are weighted
/// ([`Mortar`](super::Mortar)) or a law is compliant. Therefore the surface is first pulled into its body by a
/// [`depth`](Self::depth), at the start and at the end of the step: nodes move against the mean of the normals of the
/// facets around them, and facets by the depth. Between both the pulled surface moves on straight lines. A step is
/// certified if, at all times within it, a plane separates each two facets that share no node. Planes separate the
/// convex hulls of the corners, so bilinear facets are enclosed. Each plane is checked at both ends of an interval of
/// time in which corners move along straight lines; that is a proof for the whole interval, up to a margin for
/// rounding. Since a step starts where the last one has ended, the pulled surface never intersects itself in a run.
///
/// Facets that share a node always touch and are not compared: that a body does not fold flat between them is for its
/// material to prevent. Facets of second order are checked by their linear parts.
///
/// # Thin bodies
///
/// The two faces of a wall are facets like any others, and the proof covers them. The depth must be smaller than half
/// of the wall; the default is. For sheets without a volume, which contact keeps apart by
/// [offsets](super::SurfaceSettings::offsets), set the depth to zero.
///
/// ```
/// use contact_dynamics::contact::{BodyContact, Certificate, NonPenetration, Surface};
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Error, GeneralizedAlpha, LinearSystem, Result, Simulation, StepControl};
///
/// // Three elastic plates, one upon the other, 0.1 apart. The uppermost falls.
/// let heights = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
/// let coordinates: Vec<[f64; 2]> = heights.iter().flat_map(|&y| [[0.0, y], [1.0, y]]).collect();
/// let dofs: Vec<[usize; 2]> = (0..12).map(|node| [2 * node, 2 * node + 1]).collect();
/// let plates = [0, 4, 8].map(|first| [first, first + 1, first + 3, first + 2]);
/// let bodies = Surface::of_cells(&coordinates, plates)?;
/// // Springs through each plate.
/// let ends = [0, 1, 4, 5, 8, 9].map(|node| [2 * node + 1, 2 * node + 5]);
/// let springs = ends.into_iter().flat_map(|[i, j]| [(i, i, 1e4), (j, j, 1e4), (i, j, -1e4), (j, i, -1e4)]);
/// let springs: Vec<_> = springs.map(|(i, j, k)| Triplet::new(i, j, k)).collect();
/// let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(24, 24, &springs)?;
/// let fall = |listed: &Surface| -> Result<Certificate> {
///     let check = NonPenetration::new(&coordinates, &dofs, &bodies)?;
///     let certificate = check.certificate();
///     let velocity = (0..24).map(|dof| if dof > 16 && dof % 2 == 1 { -1.0 } else { 0.0 }).collect();
///     let plates = LinearSystem::lumped(vec![1.0; 24], stiffness.clone())?;
///     let mut run = Simulation::builder(plates, GeneralizedAlpha::default(), 0.01)
///         .velocity(velocity)
///         .constraints(BodyContact::of_itself(&coordinates, &dofs, listed)?.constraints()?)
///         .constraint(check)
///         .step_control(StepControl::halving(1e-4)?)
///         .build()?;
///     run.run_until(0.4, &mut ())?;
///     Ok(certificate)
/// };
/// // They stay apart: plates that touch are two depths of a twentieth of their thickness apart.
/// let certificate = fall(&bodies)?;
/// assert!(certificate.steps() >= 40 && (certificate.distance() - 0.01).abs() < 1e-6);
/// // The middle plate has been forgotten.
/// let two = Surface::of_cells(&coordinates, [plates[0], plates[2]])?;
/// assert!(matches!(fall(&two), Err(Error::StepRefused { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct NonPenetration {
    nodes: Nodes,
    surface: Surface,
    depth: f64,
    /// How far nodes may move until lists are built again (length).
    skin: f64,
    /// The pulled nodes of the surface, by their place in it, at the start and at the end of a step.
    pulled: [Vec<Point>; 2],
    positions: Vec<Point>,
    /// Of the facets.
    normals: Vec<Point>,
    /// Of the facets in their motion.
    boxes: Vec<Bounds>,
    lists: Neighborhood,
    /// The pulled nodes for which the lists were built.
    listed: Vec<Point>,
    certificate: Certificate,
}

/// The default depth, as a share of the shortest side of a facet.
const DEPTH: f64 = 0.05;

/// Distances below so many depths are measured. Bodies that touch are two depths apart.
const MEASURED: f64 = 3.0;

/// Corners are pulled by at most the depth over this.
const LEAST_SLOPE: f64 = 0.5;

/// How far nodes may move until lists are built again, as a share of the shortest side of a facet.
const SKIN: f64 = 0.25;

impl NonPenetration {
    /// For surfaces that are given as one, as [`Surface::of_cells`] finds them of all bodies at once. `coordinates` are
    /// the reference coordinates of all nodes of a mesh, in two or three dimensions, and `dofs` the dofs of their
    /// displacements.
    ///
    /// # Errors
    ///
    /// Those of [`Surface::new`] and [`NodeToFacet::of_itself`](super::NodeToFacet::of_itself) for the mesh.
    pub fn new<T: Real, F: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        dofs: &[[usize; D]],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        let mut nodes = Nodes::new(coordinates, dofs)?;
        let surface = Surface::of_facets(facets, D, &nodes.coordinates)?;
        nodes.read_body(surface.moved_by());
        let shortest = shortest(&surface, &nodes.coordinates);
        Ok(Self {
            depth: DEPTH * shortest,
            skin: SKIN * shortest,
            pulled: [Vec::new(), Vec::new()],
            positions: Vec::new(),
            normals: Vec::new(),
            boxes: Vec::new(),
            lists: Neighborhood::default(),
            listed: Vec::new(),
            certificate: Certificate::default(),
            nodes,
            surface,
        })
    }

    /// How far the surface is pulled into its body before it is checked (length): two bodies may penetrate each other
    /// by up to twice the depth. By default a twentieth of the shortest side of a facet.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless it is zero or positive, and finite.
    pub fn depth(self, depth: f64) -> Result<Self> {
        match depth >= 0.0 && depth.is_finite() {
            true => Ok(Self { depth, ..self }),
            false => Err(Error::Parameter { name: "the depth of a certificate", value: depth, range: "zero or more" }),
        }
    }

    /// The numbers of certified and rejected steps and the smallest distance, during a run and after it.
    pub fn certificate(&self) -> Certificate {
        self.certificate.clone()
    }

    /// Pulls the surface with displacements u into its body.
    fn pull<T: Real>(&mut self, end: usize, u: &[T]) {
        let Self { nodes, surface, depth, pulled, positions, normals, .. } = self;
        nodes.places_at(u, positions);
        normals.clear();
        normals.extend(surface.facets().iter().map(|facet| facet.normal(positions).unwrap_or_default()));
        pulled[end].clear();
        pulled[end].extend(surface.nodes().iter().enumerate().map(|(place, &node)| {
            let around = || surface.corners_at(place).iter().map(|&(facet, _)| normals[facet]);
            let sum = around().fold([0.0; 3], |sum, normal| add_scaled(sum, 1.0, normal));
            let Some(inward) = unit(sum.map(|x| -x)) else { return positions[node] };
            // Facets at a corner are all pulled by the depth.
            let slope = around().map(|normal| -dot(inward, normal)).fold(1.0, f64::min).max(LEAST_SLOPE);
            add_scaled(positions[node], *depth / slope, inward)
        }));
    }

    fn corners(&self, facet: usize, end: usize) -> Corners {
        let places = self.surface.places(facet);
        let count = self.surface.facets()[facet].nodes().len();
        (std::array::from_fn(|k| self.pulled[end][places[k.min(count - 1)]]), count)
    }

    /// Whether two facets have a common node.
    fn touch(&self, one: usize, other: usize) -> bool {
        let facets = self.surface.facets();
        facets[one].nodes().iter().any(|node| facets[other].nodes().contains(node))
    }

    /// Finds the boxes of the facets in their motion, and lists the facets that are near each other if nodes have moved
    /// too far since they were listed.
    fn update_lists(&mut self) {
        let mut boxes = std::mem::take(&mut self.boxes);
        boxes.clear();
        boxes.extend(
            (0..self.surface.facets().len())
                .map(|facet| Bounds::of_points([0, 1].into_iter().flat_map(|end| self.corners(facet, end).0))),
        );
        self.boxes = boxes;
        let Self { depth, skin, pulled, boxes, lists, listed, .. } = self;
        let moved = |end: &Vec<Point>| {
            let ways = end.iter().zip(&*listed).map(|(&x, &listed)| norm(add_scaled(x, -1.0, listed)));
            ways.fold(0.0, f64::max)
        };
        if listed.len() != pulled[0].len() || pulled.iter().any(|end| 2.0 * moved(end) > *skin) {
            lists.build(boxes.iter().copied(), boxes.iter().copied(), MEASURED * *depth + *skin);
            listed.clone_from(&pulled[0]);
        }
    }

    /// The smallest distance of facets in the motion from the first pulled surface to the second, if any two come near
    /// each other; `Err` names two facets that are not certified.
    fn distance(&mut self) -> std::result::Result<Option<f64>, [usize; 2]> {
        self.update_lists();
        let mut smallest: Option<f64> = None;
        for (one, own) in self.boxes.iter().enumerate() {
            let near = own.inflated(MEASURED * self.depth);
            for &other in self.lists.of(one).iter().filter(|&&other| other > one) {
                let others = &self.boxes[other];
                if !near.intersects(others) || self.touch(one, other) {
                    continue;
                }
                let ends = [0, 1].map(|end| [self.corners(one, end), self.corners(other, end)]);
                let least = rounding(own.magnitude().max(others.magnitude()));
                let found = distance_in_motion(&ends, least).ok_or([one, other])?;
                smallest = Some(smallest.map_or(found, |smallest| smallest.min(found)));
            }
        }
        Ok(smallest)
    }
}

/// The shortest side of a facet.
fn shortest(surface: &Surface, at: &[Point]) -> f64 {
    let facets = surface.facets().iter().map(Facet::nodes);
    let sides = facets.flat_map(|nodes| (0..nodes.len()).map(|k| [nodes[k], nodes[(k + 1) % nodes.len()]]));
    sides.map(|[one, other]| norm(add_scaled(at[one], -1.0, at[other]))).fold(f64::INFINITY, f64::min)
}

impl<T: Real> ContactConstraint<T> for NonPenetration {
    fn dofs(&self) -> &[usize] {
        self.nodes.dofs()
    }

    fn only_reads(&self, _: usize) -> bool {
        true
    }

    fn contacts(&self, _: &mut Contacts<T>) {}

    fn gaps(&mut self, _: f64, _: &[T], _: &mut [T]) -> Result<()> {
        Ok(())
    }

    /// Checks the surface at the start of a run.
    fn search(&mut self, _: f64, u: &[T], _: &[T], _: f64) -> Result<Candidates> {
        check_local(u.len(), self.nodes.dofs().len())?;
        self.nodes.move_to(u)?;
        for end in [0, 1] {
            self.pull(end, u);
        }
        for (facet, &normal) in self.normals.iter().enumerate() {
            let (corners, count) = self.corners(facet, 0);
            let pulled = Shape::new(corners, count).normal(&middle(count));
            if pulled.is_none_or(|pulled| dot(pulled, normal) <= 0.0) {
                let part = format!("facet {facet} of a certified surface");
                return Err(Error::Incompatible { part, reason: "pulled by the depth it is turned inside out" });
            }
        }
        match self.distance() {
            Ok(_) => Ok(Candidates::Unchanged),
            Err([one, other]) => Err(Error::Incompatible {
                part: format!("facets {one} and {other} of a certified surface"),
                reason: "they intersect at the start: their bodies overlap by more than twice the depth",
            }),
        }
    }

    fn variation(&self) -> Variation {
        Variation::Never
    }

    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        for end in [0, 1] {
            self.pull(end, step.u[end]);
        }
        let result = self.distance();
        let mut certified = self.certificate.lock();
        match result {
            Ok(distance) => {
                certified.steps += 1;
                certified.distance = distance.map_or(certified.distance, |distance| certified.distance.min(distance));
                Ok(())
            }
            Err(facets) => {
                certified.rejected += 1;
                let way = facets
                    .iter()
                    .flat_map(|&facet| self.surface.places(facet))
                    .map(|&place| norm(add_scaled(self.pulled[1][place], -1.0, self.pulled[0][place])));
                let [t, end] = step.t;
                Err(Error::NotCertified { t, h: end - t, constraint: 0, facets, way: way.fold(0.0, f64::max) })
            }
        }
    }
}

/// The results of a [`NonPenetration`] so far.
#[derive(Clone, Debug, Default)]
pub struct Certificate(Arc<Mutex<Certified>>);

#[derive(Debug)]
struct Certified {
    steps: usize,
    rejected: usize,
    distance: f64,
}

impl Default for Certified {
    fn default() -> Self {
        Self { steps: 0, rejected: 0, distance: f64::INFINITY }
    }
}

impl Certificate {
    fn lock(&self) -> MutexGuard<'_, Certified> {
        // A panic leaves no half-written data.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The number of certified steps.
    pub fn steps(&self) -> usize {
        self.lock().steps
    }

    /// The number of rejected steps; [`StepControl`](crate::StepControl) has repeated them with smaller sizes.
    pub fn rejected(&self) -> usize {
        self.lock().rejected
    }

    /// A lower bound of the distance between facets of the pulled surface in all certified steps (length); infinite if
    /// no facets came nearer to each other than three depths. Surfaces that touch are two depths apart: they have
    /// penetrated each other by at most twice the depth less this distance.
    pub fn distance(&self) -> f64 {
        self.lock().distance
    }
}
