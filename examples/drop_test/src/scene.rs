//! What falls on what: meshes placed, body and contact put together.

use crate::body::{Body, dofs};
use crate::gmsh;
use crate::mesh::Mesh;
use crate::options::{Model, Options, Scheme, Target};
use crate::placement;
use crate::{Phases, Result};
use contact_dynamics::contact::{self, Facet, NodeToFacet, Plane, Side, Sphere};
use contact_dynamics::{
    CdLagrange, Checkpoint, Composite, GeneralizedAlpha, Newmark, NodesOnObstacle, Simulation, SimulationBuilder,
    StepControl, System, TimeIntegrator,
};
use std::path::{Path, PathBuf};

/// A scene ready to run.
pub struct Scene {
    /// The part, and behind it what it falls on if that is a part too.
    pub mesh: Mesh,
    /// How many nodes and elements are the part's.
    pub nodes: usize,
    pub elements: usize,
    pub body: Body,
    /// Facets of the surfaces of all parts, in order.
    pub surface: Vec<Vec<usize>>,
    /// Step size (s), and time and speed of the part where the run begins: the fall up to there is exact.
    pub step: f64,
    pub start: f64,
    pub speed: f64,
    target: Obstacle,
}

/// What the part meets.
enum Obstacle {
    Plane(Plane<f64, 3>),
    Ball(Sphere<f64, 3>),
    /// The other part, which begins at this facet of the surface.
    Part(usize),
}

/// How many steps before contact a run begins.
const BEFORE: f64 = 4.0;

impl Scene {
    pub fn new(options: &Options, phases: &mut Phases) -> Result<Self> {
        let mut mesh = gmsh::read(&part(options), options.unit.meters())?;
        mesh.turn(options.turn.0);
        let mut base = match &options.onto {
            Target::Part(path) => Some(gmsh::read(path, options.unit.meters())?),
            Target::Plane | Target::Ball => None,
        };
        phases.done("read");

        let (nodes, elements) = (mesh.nodes.len(), mesh.elements.len());
        let material = options.material;
        let other = options.target_material.unwrap_or(material);
        let step = step_size(options, &mesh, base.as_ref());
        let (mut surface, fall) = (mesh.boundary(), options.height);
        let target = place(options, &mut mesh, base.as_mut(), surface.len())?;
        // v² = v₀² + 2 g H at the end of the fall; a part that is thrown up comes back.
        let last = (options.speed.powi(2) + 2.0 * options.gravity * fall).sqrt();
        let [start, speed, left] = approach(options, fall, BEFORE * step * last)?;
        mesh.translate([0.0, 0.0, left - fall]);

        if let Some(base) = base {
            surface.extend(base.boundary().into_iter().map(|facet| facet.iter().map(|n| n + nodes).collect()));
            mesh.append(&base);
        }
        let held = held(&mesh, nodes);
        let materials = |element: usize| if element < elements { material } else { other };
        let body = Body::new(&mesh, materials, options.gravity, &held);
        phases.done("assembly");
        Ok(Self { mesh, nodes, elements, body, surface, step, start, speed, target })
    }

    /// The run, from the start or from where another one ended.
    pub fn simulation(
        &self,
        options: &Options,
        checkpoint: Option<Checkpoint<f64>>,
    ) -> Result<Simulation<'static, f64>> {
        let scheme: Box<dyn TimeIntegrator> = match options.scheme {
            Scheme::ChungHulbert => Box::new(GeneralizedAlpha::chung_hulbert(0.8)?),
            Scheme::Composite => Box::new(Composite),
            Scheme::Trapezoidal => Box::new(Newmark::trapezoidal()),
            Scheme::CdLagrange => Box::new(CdLagrange),
        };
        let system: Box<dyn System<f64>> = match options.model {
            Model::Linear => Box::new(self.body.clone().linearized()?),
            Model::NeoHookean => Box::new(self.body.clone()),
        };
        let mut velocity = vec![0.0; self.mesh.nodes.len() * 3];
        (0..self.nodes).for_each(|node| velocity[3 * node + 2] = -self.speed);
        let mut builder = Simulation::builder(system, scheme, self.step)
            .start_time(self.start)
            .velocity(velocity)
            .step_control(StepControl::halving(self.step / 64.0)?)
            .energy_balance();
        builder = self.contact(builder, options.friction)?;
        if let Some(checkpoint) = checkpoint {
            builder = builder.resume_from(checkpoint);
        }
        Ok(builder.build()?)
    }

    fn contact(
        &self,
        builder: SimulationBuilder<'static, f64>,
        friction: f64,
    ) -> Result<SimulationBuilder<'static, f64>> {
        let node_dofs: Vec<[usize; 3]> = (0..self.mesh.nodes.len()).map(dofs).collect();
        Ok(match &self.target {
            Obstacle::Plane(plane) => builder.constraint(self.against(*plane, &node_dofs, friction)?),
            Obstacle::Ball(ball) => builder.constraint(self.against(*ball, &node_dofs, friction)?),
            Obstacle::Part(first) => {
                let facets = |list: &[Vec<usize>]| list.iter().map(|nodes| facet(nodes)).collect::<Vec<_>>();
                let (one, other) = self.surface.split_at(*first);
                let pair = NodeToFacet::new(&self.mesh.nodes, &node_dofs, facets(one), facets(other))?;
                builder.constraint(pair.friction(friction))
            }
        })
    }

    /// The nodes of the surface against a rigid body. Those farther away than an element, and than a step brings them,
    /// are left alone.
    fn against(
        &self,
        obstacle: impl contact::Obstacle<f64, 3> + 'static,
        node_dofs: &[[usize; 3]],
        friction: f64,
    ) -> Result<NodesOnObstacle<'static, f64, 3>> {
        let mut nodes = self.surface.concat();
        nodes.sort_unstable();
        nodes.dedup();
        let contact = NodesOnObstacle::new(obstacle, &self.mesh.nodes, node_dofs, &nodes)?;
        Ok(contact.friction(friction).reach(self.mesh.mean_size())?)
    }
}

pub fn facet(nodes: &[usize]) -> Facet {
    match *nodes {
        [i, j, k, l] => Facet::from([i, j, k, l]),
        _ => Facet::from([nodes[0], nodes[1], nodes[2]]),
    }
}

/// The mesh of the part: the one given, or one that comes with the program.
pub fn part(options: &Options) -> PathBuf {
    let shipped = || Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/jack.msh");
    options.mesh.clone().unwrap_or_else(shipped)
}

/// Places the part at its height above the middle of what it falls on, and that with its top at the origin; `first` is
/// the number of facets of the part.
fn place(options: &Options, mesh: &mut Mesh, base: Option<&mut Mesh>, first: usize) -> Result<Obstacle> {
    let [low, high] = mesh.bounds();
    let [x, y] = options.offset.0;
    mesh.translate([x - 0.5 * (low[0] + high[0]), y - 0.5 * (low[1] + high[1]), -low[2]]);
    let (clearance, target) = match (&options.onto, base) {
        (Target::Ball, _) => {
            let width = f64::max(high[0] - low[0], high[1] - low[1]);
            let radius = options.radius.unwrap_or(0.25 * width);
            let ball = Sphere::new([0.0, 0.0, -radius], radius, Side::Outside)?;
            (placement::above_ball(mesh, radius), Obstacle::Ball(ball))
        }
        (Target::Part(_), Some(base)) => {
            let [low, high] = base.bounds();
            base.translate([-0.5 * (low[0] + high[0]), -0.5 * (low[1] + high[1]), -high[2]]);
            (placement::above_part(mesh, base), Obstacle::Part(first))
        }
        _ => {
            let (s, c) = options.slope.to_radians().sin_cos();
            let plane = Plane::new([0.0; 3], [s, 0.0, c])?;
            (placement::above_plane(mesh, [s, 0.0, c]), Obstacle::Plane(plane))
        }
    };
    let clearance = clearance
        .ok_or("the part falls past what it should meet, with nothing below it: look at --offset and --radius")?;
    mesh.translate([0.0, 0.0, options.height - clearance]);
    Ok(target)
}

/// Time, speed and height left where a run begins that has about `distance` before contact.
fn approach(options: &Options, fall: f64, distance: f64) -> Result<[f64; 3]> {
    let (v, g) = (options.speed, options.gravity);
    if v <= 0.0 && g == 0.0 && (v < 0.0 || fall > 0.0) {
        return Err(format!("the part never touches: its speed is {v} m/s downward and there is no gravity").into());
    }
    let left = f64::min(distance, fall);
    let way = fall - left;
    let speed = (v * v + 2.0 * g * way).sqrt();
    let time = if g > 0.0 { (speed - v) / g } else { way / v.max(f64::MIN_POSITIVE) };
    Ok([time, if way == 0.0 { v } else { speed }, left])
}

/// Nodes on which the other part stands: its lowest.
fn held(mesh: &Mesh, first: usize) -> Vec<usize> {
    let heights = || mesh.nodes[first..].iter().map(|x| x[2]);
    let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
    (first..mesh.nodes.len()).filter(|&node| mesh.nodes[node][2] < low + 1e-6 * (high - low)).collect()
}

/// The step size: as given, or by the time that a dilatational wave needs through an element.
fn step_size(options: &Options, mesh: &Mesh, base: Option<&Mesh>) -> f64 {
    let other = options.target_material.unwrap_or(options.material);
    let crossing = |mesh: &Mesh, speed: f64| match options.scheme {
        Scheme::CdLagrange => 0.5 * mesh.thinnest() / speed,
        _ => mesh.mean_size() / speed,
    };
    let own = crossing(mesh, options.material.wave_speed());
    let its = base.map_or(f64::INFINITY, |base| crossing(base, other.wave_speed()));
    options.step.unwrap_or(own.min(its))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    fn options(words: &[&str]) -> Options {
        Options::parse_from(["drop-test", "--quick"].iter().chain(words))
    }

    #[test]
    fn the_fall_that_is_skipped_is_that_of_gravity() {
        let [time, speed, left] = approach(&options(&["--speed", "2", "--gravity", "10"]), 3.0, 0.5).unwrap();
        assert!((left - 0.5).abs() < 1e-15 && (speed - f64::sqrt(4.0 + 50.0)).abs() < 1e-14);
        assert!((2.0 * time + 5.0 * time * time - 2.5).abs() < 1e-14);
        // Thrown up: back with the same speed, later.
        let [time, speed, _] = approach(&options(&["--speed", "-2", "--gravity", "10"]), 3.0, 0.5).unwrap();
        assert!((-2.0 * time + 5.0 * time * time - 2.5).abs() < 1e-13 && (speed - f64::sqrt(54.0)).abs() < 1e-14);
        // Without gravity, and without a way to skip.
        let [time, speed, left] = approach(&options(&["--speed", "2", "--gravity", "0"]), 3.0, 0.5).unwrap();
        assert!((time - 1.25).abs() < 1e-15 && (speed - 2.0).abs() < 1e-15 && (left - 0.5).abs() < 1e-15);
        let [time, speed, left] = approach(&options(&["--gravity", "10"]), 0.1, 0.5).unwrap();
        assert!([time, speed, left - 0.1].iter().all(|x| x.abs() < 1e-15));
        assert!(approach(&options(&["--speed", "0", "--gravity", "0"]), 0.1, 0.5).is_err());
        assert!(approach(&options(&["--speed", "-1", "--gravity", "0"]), 0.1, 0.5).is_err());
    }

    #[test]
    fn scenes_begin_clear_of_contact_by_a_few_steps() {
        for words in [&[][..], &["--slope", "20"], &["--onto", "ball"], &["--turn", "30,40,50"]] {
            let scene = Scene::new(&options(words), &mut Phases::new()).unwrap();
            let run = scene.simulation(&options(words), None).unwrap();
            let gaps = run.state().contacts().gaps();
            let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
            let way = BEFORE * scene.step * scene.speed;
            assert!(least > 0.5 * way && least < 1.01 * way, "{words:?}: {least} {way}");
            assert!((scene.speed - f64::sqrt(2.0 * 9.81 * 0.1)).abs() < 0.01);
        }
    }
}
