//! A scene by chance: bodies, velocities, units, step size, and what keeps the bodies where they may be.

use super::Variant;
use super::bodies::{Body, decades, pick, rotation, turned};
use super::crossing::crossing;
use super::meeting::{Between, Carried, Kind, Meeting};
use super::space::{Boxed, Dimension, Space};
use contact_dynamics::contact::{
    BodyContact, BondStrength, Certificate, ContactLaw, Facet, GapFunction, LinearRows, Mortar, NodeToFacet,
    NodesOnObstacle, NonPenetration, Obstacle, Plane, Side, Sphere, Surface, SurfaceSettings, Tie,
};
use contact_dynamics::{LinearSystem, Result, System};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{entries, matrix};
use contact_dynamics_scenes::vectors::dot;

/// Units that all numbers of a scene are multiplied by.
#[derive(Clone, Copy, Debug)]
struct Units {
    length: f64,
    mass: f64,
    time: f64,
}

impl Units {
    /// A body of the plane has unit thickness in any unit.
    fn material(&self, of: Material, space: i32) -> Material {
        let Self { length, mass, time } = *self;
        let young = of.young * (mass / time / time) * length.powi(2 - space);
        Material { young, density: of.density * mass / length.powi(space), ..of }
    }
}

/// The depth of certificates, as a share of the smallest element.
const CERTIFIED: f64 = 0.1;

pub(super) struct Scene<const D: usize> {
    pub(super) nodes: Vec<[f64; D]>,
    pub(super) constraints: Vec<Boxed>,
    pub(super) velocity: Vec<f64>,
    pub(super) mass: Vec<f64>,
    pub(super) friction: f64,
    /// Length of the smallest element, and the time in which a wave crosses it.
    pub(super) element: f64,
    pub(super) crossing: f64,
    /// The obstacle of scenes where it rests, again.
    pub(super) obstacle: Option<Box<dyn Obstacle<f64, D>>>,
    bodies: Vec<Body<D>>,
    law: Option<Law>,
}

/// What is drawn of a scene before its geometry is.
#[derive(Clone, Copy, Debug)]
struct Drawn<const D: usize> {
    units: Units,
    /// Materials in natural units.
    materials: [Material; 2],
    /// Velocity in natural units, as a share of the slowest waves, and the way until bodies meet.
    speed: f64,
    gap: f64,
    friction: f64,
    spin: f64,
    drift: [f64; D],
    turn: [[f64; D]; D],
}

impl<const D: usize> Scene<D>
where
    Space<D>: Dimension<D>,
{
    /// From a seed; `courant` is the step over the time in which a wave crosses an element.
    pub(super) fn new(meeting: Meeting, courant: f64, random: &mut Congruential, variant: &Variant) -> Result<Self> {
        let drawn = Self::draw(courant, random, variant);
        let law = pick(&[None, None, Some(Law::NeoHookean), Some(Law::StVenantKirchhoff)], random);
        let mut scene = match meeting.kind {
            Kind::Obstacle(shape, motion) => Self::on_obstacle(shape, motion, &drawn, random)?,
            Kind::Wall | Kind::Bonded => Self::on_wall(meeting.kind, &drawn, random)?,
            Kind::Function => Self::outside_ball(&drawn, random)?,
            Kind::Pairs => Self::in_pairs(&drawn, random)?,
            Kind::Fold | Kind::FoldWithEdges => Self::folding(meeting.kind, &drawn, random, variant)?,
            Kind::Pile => Self::pile(&drawn, random, variant)?,
            Kind::Bodies(between) => Self::of_two(between, &drawn, random, variant)?,
        };
        let is_uniform = scene.bodies.windows(2).all(|pair| pair[0].solid.material == pair[1].solid.material);
        let takes_law = is_uniform && scene.bodies.iter().all(|body| !body.simplices);
        scene.law = law.filter(|_| takes_law);
        Ok(scene)
    }

    fn draw(courant: f64, random: &mut Congruential, variant: &Variant) -> Drawn<D> {
        let [length, mass, time] = variant.exponents.map(|exponent| 2.0_f64.powi(exponent));
        let units = Units {
            length: length * decades(-3.0, 3.0, random),
            mass: mass * decades(-4.0, 4.0, random),
            time: time * decades(-4.0, 3.0, random),
        };
        let poisson = random.within(0.0, 0.4);
        let first = Material { young: 1.0, poisson, density: 1.0 };
        let other = Material { young: decades(-1.5, 1.5, random), density: decades(-1.0, 1.0, random), ..first };
        let second = if pick(&[true, false], random) { first } else { other };
        let materials = [first, second];
        let slowest = first.wave_speed().min(second.wave_speed());
        let fastest = first.wave_speed().max(second.wave_speed());
        let speed = slowest * decades(-2.5, -0.7, random);
        // The first contact within some steps; hollow obstacles have room for so much.
        let gap = (speed * courant * 0.1 / fastest * random.within(1.0, 12.0)).min(0.05);
        let friction = if pick(&[true, false], random) { 0.0 } else { random.within(0.0, 1.0) };
        let spin = random.signed() * speed;
        let drift = std::array::from_fn(|_| pick(&[0.0, 1.0], random) * speed * random.signed());
        Drawn { units, materials, speed, gap, friction, spin, drift, turn: rotation(random) }
    }

    /// All of them in the units of the scene, with velocities in natural ones given by node.
    fn assembled(bodies: Vec<Body<D>>, drawn: &Drawn<D>, velocity: &dyn Fn(usize, [f64; D]) -> [f64; D]) -> Self {
        let Units { length, time, .. } = drawn.units;
        let all = || bodies.iter().enumerate().flat_map(|(k, body)| body.solid.nodes.iter().map(move |x| (k, *x)));
        let velocity = all().flat_map(|(k, x)| velocity(k, x).map(|v| v * length / time)).collect();
        let nodes = all().map(|(_, x)| x.map(|x| length * x)).collect();
        let (mut element, mut crossing) = (f64::INFINITY, f64::INFINITY);
        for body in &bodies {
            let size = length * body.element;
            element = element.min(size);
            let speed = body.solid.material.wave_speed();
            crossing = crossing.min(body.element / speed * time);
        }
        let space = i32::from(D == 3) + 2;
        let in_units = |body: Body<D>| {
            let mut body = body.mapped(|x| x.map(|x| length * x));
            body.solid.material = drawn.units.material(body.solid.material, space);
            body
        };
        let bodies: Vec<_> = bodies.into_iter().map(in_units).collect();
        let mass = bodies.iter().flat_map(|body| body.solid.lumped_mass::<f64>()).collect();
        let friction = drawn.friction;
        let (constraints, obstacle) = (Vec::new(), None);
        Self { nodes, constraints, velocity, mass, friction, element, crossing, obstacle, bodies, law: None }
    }

    fn node_dofs(&self) -> Vec<[usize; D]> {
        (0..self.nodes.len()).map(|node| std::array::from_fn(|axis| D * node + axis)).collect()
    }

    /// Facets of each body, with the nodes of all.
    fn facets(&self, variant: &Variant) -> Vec<Vec<Facet>> {
        let mut first = 0;
        let mut random = Congruential(17);
        let mut moved = Vec::new();
        for body in &self.bodies {
            let moved_facet = |facet: &Facet| match *facet.nodes() {
                [a, b] => Facet::from([a, b].map(|node| node + first)),
                [a, b, c] => Facet::from([a, b, c].map(|node| node + first)),
                [a, b, c, d] => Facet::from([a, b, c, d].map(|node| node + first)),
                _ => panic!("{facet:?}"),
            };
            let mut facets: Vec<_> = body.facets.iter().map(moved_facet).collect();
            if variant.reordered {
                facets.sort_by_cached_key(|_| random.unit().to_bits());
            }
            first += body.solid.nodes.len();
            moved.push(facets);
        }
        moved
    }

    /// Adds a certificate of non-penetration of all bodies.
    pub(super) fn certify(&mut self) -> Result<Certificate> {
        let facets = self.facets(&Variant::default()).concat();
        let check = NonPenetration::new(&self.nodes, &self.node_dofs(), facets)?.depth(CERTIFIED * self.element)?;
        let certificate = check.certificate();
        self.constraints.push(Box::new(check));
        Ok(certificate)
    }

    /// Two facets that have crossed each other by more than the certificate admits.
    pub(super) fn crossing(&self, u: &[f64]) -> Option<[usize; 2]> {
        let at = |(node, x): (usize, &[f64; D])| std::array::from_fn(|axis| x[axis] + u[D * node + axis]);
        let positions: Vec<[f64; D]> = self.nodes.iter().enumerate().map(at).collect();
        crossing(&self.facets(&Variant::default()).concat(), &positions, CERTIFIED * self.element)
    }

    fn surface_nodes(&self) -> Vec<usize> {
        let facets = self.facets(&Variant::default());
        let mut nodes: Vec<_> = facets.iter().flatten().flat_map(|facet| facet.nodes().iter().copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Velocity of a body that flies and spins about a place.
    fn flight(drawn: &Drawn<D>, velocity: [f64; D], about: [f64; D]) -> impl Fn([f64; D]) -> [f64; D] + use<D> {
        let (axes, spin) = (drawn.turn, drawn.spin);
        move |x| {
            let arm: [f64; D] = std::array::from_fn(|k| x[k] - about[k]);
            let [along, across] = [dot(arm, axes[0]), dot(arm, axes[1])];
            let round: [f64; D] = std::array::from_fn(|k| spin * (along * axes[1][k] - across * axes[0][k]));
            std::array::from_fn(|k| velocity[k] + round[k])
        }
    }

    /// A small block turned by chance.
    fn small_block(drawn: &Drawn<D>, random: &mut Congruential) -> Body<D> {
        let size = std::array::from_fn(|_| random.within(0.12, 0.28));
        Body::block(size, drawn.materials[0], random).mapped(|x| turned(&drawn.turn, x))
    }

    /// A small block that flies at what has this distance (in natural units), from a place.
    fn thrown(
        drawn: &Drawn<D>,
        from: [f64; D],
        distance: &dyn Fn([f64; D]) -> (f64, [f64; D]),
        random: &mut Congruential,
    ) -> Self {
        let body = Self::small_block(drawn, random);
        let toward = distance(from).1.map(|x| -x);
        let (mut way, mut closest) = (0.0, (f64::INFINITY, 0.0));
        let at = |way: f64| -> [f64; D] { std::array::from_fn(|k| from[k] + way * toward[k]) };
        for _ in 0..200 {
            let center = at(way);
            let gap = |x: &[f64; D]| distance(std::array::from_fn(|k| center[k] + x[k])).0;
            let nearest = body.solid.nodes.iter().map(gap).fold(f64::INFINITY, f64::min);
            if nearest < closest.0 {
                closest = (nearest, way);
            }
            way += nearest - drawn.gap;
        }
        // (One that flies past the tip of a cone begins where it is closest.)
        if way > 100.0 {
            way = closest.1;
        }
        let center = at(way);
        let velocity = std::array::from_fn(|k| drawn.speed * toward[k] + drawn.drift[k]);
        let body = body.mapped(|x| std::array::from_fn(|k| center[k] + x[k]));
        let flight = Self::flight(drawn, velocity, center);
        Self::assembled(vec![body], drawn, &|_, x| flight(x))
    }

    fn on_obstacle(shape: usize, motion: Carried, drawn: &Drawn<D>, random: &mut Congruential) -> Result<Self> {
        let shapes = random.clone();
        let make = |size: f64| Space::<D>::shapes(size, &mut shapes.clone()).swap_remove(shape).1;
        let natural = make(1.0);
        let [size, time] = [drawn.units.length, drawn.units.time];
        let obstacle = make(size);
        // (Hollow ones are met from the inside.)
        let hollow = natural.distance([0.0; D]).0 > 0.0 && natural.distance([5.0; D]).0 < 0.0;
        let from = if hollow { [0.0; D] } else { drawn.turn[0].map(|x| 4.0 * x) };
        let from = if natural.distance(from).0 > 0.0 { from } else { from.map(|x| -x) };
        let mut scene = Self::thrown(drawn, from, &|x| natural.distance(x), random);
        let (dofs, surface) = (scene.node_dofs(), scene.surface_nodes());
        let contact = NodesOnObstacle::new(obstacle, &scene.nodes, &dofs, &surface)?;
        let mut contact = contact.friction(drawn.friction);
        if pick(&[true, false], random) {
            contact = contact.reach(0.2 * size)?;
        }
        let rate = drawn.speed * random.signed() / time;
        let (axis, point) = (std::array::from_fn(|_| random.signed()), drawn.drift.map(|x| x * size));
        let along = drawn.turn[1];
        scene.constraints.push(match motion {
            Carried::Rests => {
                scene.obstacle = Some(make(size));
                Box::new(contact)
            }
            // To and fro, beginning at rest.
            Carried::Moves => Box::new(contact.moving(move |t| {
                let (sin, cos) = (10.0 * rate * t).sin_cos();
                let factors = [0.1 * (1.0 - cos), rate * sin, 10.0 * rate * rate * cos];
                factors.map(|factor| along.map(|x| size * factor * x))
            })),
            Carried::Turns => {
                Box::new(contact.turning(move |t| Space::<D>::turning(point, axis, [rate * t, rate, 0.0])))
            }
        });
        Ok(scene)
    }

    /// Rows of all nodes to a plane through the origin.
    fn on_wall(kind: Kind, drawn: &Drawn<D>, random: &mut Congruential) -> Result<Self> {
        let wall = Plane::new([0.0; D], drawn.turn[1])?;
        let mut scene = Self::thrown(drawn, drawn.turn[1], &|x| Obstacle::<f64, D>::distance(&wall, x), random);
        let normal = drawn.turn[1];
        let row = |direction: [f64; D], node: usize| -> Vec<(usize, f64)> {
            (0..D).map(|axis| (D * node + axis, direction[axis])).collect()
        };
        let mut rows = LinearRows::new();
        if kind == Kind::Bonded {
            let force = scene.pull(drawn);
            for node in scene.surface_nodes().into_iter().step_by(2) {
                rows = rows.bond(force * decades(-2.0, 1.0, random), &row(normal, node), 0.0);
            }
        } else {
            for node in scene.surface_nodes() {
                let tangents: Vec<_> = (0..D).filter(|&k| k != 1).map(|k| row(drawn.turn[k], node)).collect();
                let tangents: Vec<_> = tangents.iter().map(|tangent| &tangent[..]).collect();
                rows = rows.unilateral(&row(normal, node), dot(normal, scene.nodes[node]));
                rows = rows.friction(drawn.friction, &tangents);
            }
        }
        scene.constraints.push(Box::new(rows));
        Ok(scene)
    }

    /// The force on a node of an element that is stopped: ρ c v A.
    fn pull(&self, drawn: &Drawn<D>) -> f64 {
        let Units { length, time, .. } = drawn.units;
        let smallest = self.mass.iter().fold(f64::INFINITY, |least, m| m.min(least));
        smallest * drawn.speed * length / time / self.crossing
    }

    /// A ball given as functions of the displacements of single nodes.
    fn outside_ball(drawn: &Drawn<D>, random: &mut Congruential) -> Result<Self> {
        let ball = Sphere::new([0.0; D], 0.5, Side::Outside)?;
        let mut scene = Self::thrown(drawn, drawn.turn[0], &|x| ball.distance(x), random);
        let radius = 0.5 * drawn.units.length;
        let mut rows: Option<GapFunction<'static, f64>> = None;
        for node in scene.surface_nodes() {
            let place = scene.nodes[node];
            let dofs: Vec<_> = (0..D).map(|axis| D * node + axis).collect();
            let gap = move |_: f64, u: &[f64], v: &[f64], gradient: &mut [f64]| {
                let x: [f64; D] = std::array::from_fn(|k| place[k] + u[k]);
                let distance = dot(x, x).sqrt();
                let normal = x.map(|x| x / distance);
                let v = std::array::from_fn(|k| v[k]);
                let along = dot(normal, v);
                gradient.copy_from_slice(&normal);
                [distance - radius, 0.0, (dot(v, v) - along * along) / distance]
            };
            rows = Some(match rows {
                None => GapFunction::new(&dofs, gap),
                Some(rows) => rows.and(&dofs, gap),
            });
        }
        let rows = rows.expect("a body has nodes").scale(drawn.units.length)?;
        scene.constraints.push(Box::new(rows));
        Ok(scene)
    }

    /// Two blocks whose nodes face each other, some of them by slanted normals.
    fn in_pairs(drawn: &Drawn<D>, random: &mut Congruential) -> Result<Self> {
        let size = std::array::from_fn(|_| random.within(0.12, 0.28));
        let block = Body::block(size, drawn.materials[0], random);
        let lift = size[D - 1] + drawn.gap;
        let up = drawn.turn[D - 1];
        let upper = block.clone().mapped(|x| std::array::from_fn(|k| if k + 1 == D { x[k] + lift } else { x[k] }));
        let count = block.solid.nodes.len();
        let facing: Vec<_> = (0..count)
            .filter(|&node| (block.solid.nodes[node][D - 1] + 0.5 * size[D - 1]).abs() < 1e-9)
            .filter_map(|below| Some((below, (0..count).find(|&node| is_opposite(&block, below, node))?)))
            .collect();
        let turn = |x: [f64; D]| -> [f64; D] {
            std::array::from_fn(|k| (0..D).map(|axis| drawn.turn[axis][k] * x[axis]).sum())
        };
        let bodies = vec![block.mapped(turn), upper.mapped(turn)];
        let toward = up.map(|x| -drawn.speed * x);
        let [still, flight] = [drawn.drift, std::array::from_fn(|k| toward[k] + drawn.drift[k])]
            .map(|velocity| Self::flight(drawn, velocity, [0.0; D]));
        let mut scene = Self::assembled(bodies, drawn, &|body, x| if body == 0 { still(x) } else { flight(x) });
        let (dofs, mut rows) = (scene.node_dofs(), LinearRows::new());
        for (of_upper, of_lower) in facing {
            let slant = 0.3 * random.signed();
            let normal: [f64; D] = std::array::from_fn(|k| up[k] + slant * drawn.turn[0][k]);
            let [lower, upper] = [dofs[of_lower], dofs[count + of_upper]];
            let law = (ContactLaw::Rigid, drawn.friction);
            let offset = drawn.gap * drawn.units.length * random.within(0.5, 1.0);
            rows = rows.pair_with_friction(law, lower, upper, normal, offset)?;
        }
        scene.constraints.push(Box::new(rows));
        Ok(scene)
    }

    /// A bar folded to a U, its arms thrown at each other.
    fn folding(kind: Kind, drawn: &Drawn<D>, random: &mut Congruential, variant: &Variant) -> Result<Self> {
        let slot = 0.02 + 2.0 * drawn.gap;
        let body = Body::folded(slot, drawn.materials[0], random);
        let speed = drawn.speed;
        let velocity = move |_: usize, x: [f64; D]| -> [f64; D] {
            let thrown = if x[0] < 1.0 { -x[D - 1].signum() * speed * (1.0 - x[0]) } else { 0.0 };
            std::array::from_fn(|k| if k + 1 == D { thrown } else { 0.0 })
        };
        let mut scene = Self::assembled(vec![body], drawn, &velocity);
        let dofs = scene.node_dofs();
        let facets = scene.facets(variant).concat();
        let reach = 0.09 * drawn.units.length;
        scene.constraints = if kind == Kind::FoldWithEdges {
            let contact = BodyContact::of_itself(&scene.nodes, &dofs, facets)?.friction(drawn.friction);
            contact.with(SurfaceSettings::new().reach(reach))?.constraints()?
        } else {
            let contact = NodeToFacet::of_itself(&scene.nodes, &dofs, facets)?.friction(drawn.friction);
            vec![Box::new(contact.with(SurfaceSettings::new().reach(reach))?)]
        };
        Ok(scene)
    }

    /// Three blocks, the first at rest, the others turned anyhow and thrown at it one after the other.
    fn pile(drawn: &Drawn<D>, random: &mut Congruential, variant: &Variant) -> Result<Self> {
        let [below, above] = drawn.materials;
        let mut bodies: Vec<Body<D>> = Vec::new();
        let mut centers: Vec<[f64; D]> = Vec::new();
        let mut height = 0.0;
        for (material, low, high) in [(below, 0.4, 0.7), (above, 0.2, 0.4), (below, 0.2, 0.4)] {
            let size: [f64; D] = std::array::from_fn(|_| random.within(low, high));
            let block = Body::block(size, material, random);
            let any = rotation::<D>(random);
            let is_turned = !bodies.is_empty() && pick(&[true, true, false], random);
            let block = if is_turned { block.mapped(|x| turned(&any, x)) } else { block };
            let lowest = block.solid.nodes.iter().map(|x| x[D - 1]).fold(f64::INFINITY, f64::min);
            let wide = if bodies.is_empty() { 0.0 } else { 0.1 };
            let center: [f64; D] =
                std::array::from_fn(|k| if k + 1 == D { height - lowest } else { wide * random.signed() });
            let block = block.mapped(|x| std::array::from_fn(|k| x[k] + center[k]));
            let highest = block.solid.nodes.iter().map(|x| x[D - 1]).fold(f64::NEG_INFINITY, f64::max);
            height = highest + drawn.gap;
            bodies.push(block);
            centers.push(center);
        }
        let turn = |x: [f64; D]| -> [f64; D] {
            std::array::from_fn(|k| (0..D).map(|axis| drawn.turn[axis][k] * x[axis]).sum())
        };
        let flights: Vec<_> = centers
            .iter()
            .enumerate()
            .map(|(body, &center)| {
                let toward = drawn.turn[D - 1].map(|x| -drawn.speed * body as f64 * x);
                let spins = if body == 0 { 0.0 } else { drawn.spin };
                let together = std::array::from_fn(|k| toward[k] + drawn.drift[k]);
                Self::flight(&Drawn { spin: spins, ..*drawn }, together, turn(center))
            })
            .collect();
        let bodies = bodies.into_iter().map(|body| body.mapped(turn)).collect();
        let mut scene = Self::assembled(bodies, drawn, &|body, x| flights[body](x));
        let (dofs, facets) = (scene.node_dofs(), scene.facets(variant).concat());
        let contact = BodyContact::of_itself(&scene.nodes, &dofs, facets)?.friction(drawn.friction);
        scene.constraints = contact.with(SurfaceSettings::new().reach(0.1 * drawn.units.length))?.constraints()?;
        Ok(scene)
    }

    /// A block that falls on another one, anywhere, or that lies on it.
    fn of_two(between: Between, drawn: &Drawn<D>, random: &mut Congruential, variant: &Variant) -> Result<Self> {
        let mut size = |low: f64, high: f64| -> [f64; D] { std::array::from_fn(|_| random.within(low, high)) };
        let [large, small] = [size(0.4, 0.7), size(0.2, 0.4)];
        let [below, above] = drawn.materials;
        let joined = matches!(between, Between::Bonds | Between::Tie);
        let [lower, upper] = [Body::block(large, below, random), Body::block(small, above, random)];
        let upper = if joined || pick(&[true, false, false], random) {
            upper
        } else {
            let any = rotation::<D>(random);
            upper.mapped(|x| turned(&any, x))
        };
        let thick = if matches!(between, Between::Offsets | Between::Coated) { random.within(0.0, 0.02) } else { 0.0 };
        let gap = if joined { 0.0 } else { drawn.gap + 2.0 * thick };
        let lowest = upper.solid.nodes.iter().map(|x| x[D - 1]).fold(f64::INFINITY, f64::min);
        let aside: [f64; D] = std::array::from_fn(|k| 0.5 * large[k] * random.signed());
        let lift = 0.5 * large[D - 1] + gap - lowest;
        let upper = upper.mapped(|x| std::array::from_fn(|k| x[k] + if k + 1 == D { lift } else { aside[k] }));
        let center = std::array::from_fn(|k| if k + 1 == D { lift } else { aside[k] });
        let turn = |x: [f64; D]| -> [f64; D] {
            std::array::from_fn(|k| (0..D).map(|axis| drawn.turn[axis][k] * x[axis]).sum())
        };
        let toward = drawn.turn[D - 1].map(|x| -drawn.speed * x);
        let straight = Drawn { spin: 0.0, ..*drawn };
        let still = Self::flight(&straight, drawn.drift, [0.0; D]);
        let together = std::array::from_fn(|k| toward[k] + drawn.drift[k]);
        let flight = Self::flight(drawn, together, turn(center));
        let bodies = vec![lower.mapped(turn), upper.mapped(turn)];
        let mut scene = Self::assembled(bodies, drawn, &|body, x| if body == 0 { still(x) } else { flight(x) });
        scene.constraints = scene.between(between, thick, drawn, random, variant)?;
        Ok(scene)
    }

    fn between(
        &self,
        between: Between,
        thick: f64,
        drawn: &Drawn<D>,
        random: &mut Congruential,
        variant: &Variant,
    ) -> Result<Vec<Boxed>> {
        let dofs = self.node_dofs();
        let (nodes, length) = (&self.nodes, drawn.units.length);
        let [lower, upper]: [Vec<Facet>; 2] = self.facets(variant).try_into().expect("two bodies");
        let reach = 0.1 * length;
        let mut found: Vec<Boxed> = Vec::new();
        // Of bodies with corners weighted gaps are among what keeps them apart.
        let bodies = || BodyContact::new(nodes, &dofs, upper.iter().copied(), lower.iter().copied());
        let weighted = |bodies: BodyContact<f64, D>| -> Result<Boxed> {
            Ok(bodies.friction(drawn.friction).with(SurfaceSettings::new().reach(reach))?.constraints()?.remove(0))
        };
        found.push(match between {
            Between::OnePass => {
                let mut slaves: Vec<_> = upper.iter().flat_map(|facet| facet.nodes().iter().copied()).collect();
                slaves.sort_unstable();
                slaves.dedup();
                let contact = NodeToFacet::one_pass(nodes, &dofs, &slaves, lower.iter().copied())?;
                Box::new(contact.friction(drawn.friction).with(SurfaceSettings::new().reach(reach))?)
            }
            Between::TwoPasses | Between::TwoPassesAndEdges => {
                let contact = NodeToFacet::new(nodes, &dofs, upper.iter().copied(), lower.iter().copied())?;
                Box::new(contact.friction(drawn.friction).with(SurfaceSettings::new().reach(reach))?)
            }
            Between::OneSurfaceWithEdges => {
                let contact = BodyContact::of_itself(nodes, &dofs, lower.iter().chain(&upper).copied())?;
                return contact.friction(drawn.friction).with(SurfaceSettings::new().reach(reach))?.constraints();
            }
            Between::OneSurface => {
                let facets = lower.iter().chain(&upper).copied();
                Box::new(
                    NodeToFacet::of_itself(nodes, &dofs, facets)?
                        .friction(drawn.friction)
                        .with(SurfaceSettings::new().reach(reach))?,
                )
            }
            Between::Mortar | Between::MortarAndEdges => weighted(bodies()?)?,
            Between::Offsets => {
                let offsets: Vec<f64> = nodes.iter().map(|_| thick * length * random.within(0.5, 1.0)).collect();
                weighted(bodies()?.with(SurfaceSettings::new().offsets(&offsets))?)?
            }
            Between::Coated => {
                let offsets: Vec<f64> = nodes.iter().map(|_| thick * length * random.within(0.5, 1.0)).collect();
                let contact = NodeToFacet::new(nodes, &dofs, upper.iter().copied(), lower.iter().copied())?;
                Box::new(
                    contact
                        .with(SurfaceSettings::new().offsets(&offsets))?
                        .friction(drawn.friction)
                        .with(SurfaceSettings::new().reach(reach))?,
                )
            }
            Between::Bonds => {
                let material = self.bodies[1].solid.material;
                let speed = drawn.speed * length / drawn.units.time;
                let stress = material.density * material.wave_speed() * speed;
                let strengths = [decades(-1.0, 1.0, random), decades(-1.0, 1.0, random)].map(|share| share * stress);
                // The sides that face each other.
                let facing = |facets: &[Facet], sign: f64| -> Result<Vec<Facet>> {
                    let mut found = Vec::new();
                    for facet in facets {
                        let normals = Surface::new(nodes, [*facet])?.normals(nodes)?;
                        let along = normals[0].iter().zip(drawn.turn[D - 1]).map(|(n, up)| n * up).sum::<f64>();
                        found.extend((sign * along > 0.9).then_some(*facet));
                    }
                    Ok(found)
                };
                let bonded = Mortar::new(nodes, &dofs, facing(&upper, -1.0)?, facing(&lower, 1.0)?)?;
                let bonded = bonded.friction(drawn.friction).with(SurfaceSettings::new().reach(reach))?;
                Box::new(bonded.bonded(BondStrength::new(strengths[0], strengths[1])?)?)
            }
            Between::Tie => Box::new(Tie::new(nodes, &dofs, upper.iter().copied(), lower.iter().copied())?),
        });
        if matches!(between, Between::TwoPassesAndEdges | Between::MortarAndEdges) {
            found.extend(Space::<D>::edges(nodes, &dofs, [&upper, &lower], reach)?);
        }
        Ok(found)
    }
}

impl<const D: usize> Scene<D> {
    /// The system of all bodies.
    pub(super) fn system(&self) -> Result<Box<dyn System<f64>>> {
        if let (Some(law), [first, others @ ..]) = (self.law, &self.bodies[..]) {
            let all = others.iter().fold(first.solid.clone(), |all, body| all.with(body.solid.clone()));
            return Ok(Box::new(Hyperelastic::new(&all, law)));
        }
        let (mut all, mut first) = (Vec::new(), 0);
        for body in &self.bodies {
            let of_body = entries(&body.solid.stiffness());
            all.extend(of_body.into_iter().map(|(i, j, k)| (first + i, first + j, k)));
            first += body.solid.dofs();
        }
        Ok(Box::new(LinearSystem::lumped(self.mass.clone(), matrix(first, all))?))
    }

    /// What bodies are made of.
    pub(super) fn material(&self) -> &'static str {
        match self.law {
            None if self.bodies.iter().any(|body| body.simplices) => "linear, simplices",
            None => "linear",
            Some(Law::NeoHookean) => "Neo-Hookean",
            Some(Law::StVenantKirchhoff) => "St. Venant–Kirchhoff",
        }
    }
}

/// Whether a node is right above another one, on the other side of the block.
fn is_opposite<const D: usize>(block: &Body<D>, below: usize, node: usize) -> bool {
    let Solid { nodes, .. } = &block.solid;
    (0..D).all(|axis| {
        let sum =
            if axis + 1 == D { nodes[below][axis] + nodes[node][axis] } else { nodes[below][axis] - nodes[node][axis] };
        sum.abs() < 1e-9
    })
}
