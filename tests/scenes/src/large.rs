//! Bodies at large motion, bouncing on a floor that may move, and what is measured of their flight.

use crate::hyperelastic::{Hyperelastic, Law};
use crate::particles::Particles;
use crate::solids::{Material, Solid};
use crate::truss::Truss;
use contact_dynamics::contact::Plane;
use contact_dynamics::{
    NodesOnObstacle, PersistencyCorrection, Result, Simulation, SimulationBuilder, StepControl, System, TimeIntegrator,
};

/// The material of all bodies here: waves run at 1.16.
pub const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// A system of nodes with masses.
pub trait Body<const D: usize>: System<f64> + Clone + 'static {
    fn particles(&self) -> &Particles<D>;
}

impl<const D: usize> Body<D> for Hyperelastic<D> {
    fn particles(&self) -> &Particles<D> {
        &self.particles
    }
}

impl<const D: usize> Body<D> for Truss<D> {
    fn particles(&self) -> &Particles<D> {
        &self.particles
    }
}

/// Height, velocity and acceleration of a floor.
pub type FloorMotion = fn(f64) -> [f64; 3];

/// A body thrown onto a floor, whose normal is the last axis.
#[derive(Clone, Debug)]
pub struct Scene<B, const D: usize> {
    pub body: B,
    pub velocity: Vec<f64>,
    /// Candidates.
    pub nodes: Vec<usize>,
    /// At rest at height 0 if not given.
    pub floor: Option<FloorMotion>,
    pub h: f64,
}

/// How a block is thrown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Throw {
    pub cells: usize,
    pub law: Law,
    /// Angle by which it is turned.
    pub angle: f64,
    /// Velocities: along the floor, toward it, and of rotation.
    pub slide: f64,
    pub speed: f64,
    pub spin: f64,
    /// Height of its lowest corner.
    pub height: f64,
    pub gravity: f64,
    /// Time step over the time a wave needs across a cell.
    pub courant: f64,
}

impl Default for Throw {
    /// A tilted block that falls with a quarter of the speed of waves.
    fn default() -> Self {
        Self {
            cells: 6,
            law: Law::NeoHookean,
            angle: 0.3,
            slide: 0.1,
            speed: 0.3,
            spin: 0.3,
            height: 0.02,
            gravity: 0.02,
            courant: 1.0,
        }
    }
}

impl Throw {
    fn step(&self) -> f64 {
        self.courant / self.cells as f64 / MATERIAL.wave_speed()
    }

    /// A unit square.
    pub fn square(&self) -> Scene<Hyperelastic<2>, 2> {
        let solid = Solid::rectangle([1.0; 2], [self.cells; 2], MATERIAL).moved([-0.5; 2]).rotated(self.angle);
        self.plane_body(&solid.lifted(self.height), self.step())
    }

    /// A ring of radii 0.7 and 1, `cells` elements across.
    pub fn ring(&self) -> Scene<Hyperelastic<2>, 2> {
        let solid = Solid::ring([0.7, 1.0], [self.cells, 20 * self.cells], MATERIAL).rotated(self.angle);
        self.plane_body(&solid.lifted(self.height), 0.3 * self.step())
    }

    /// A bar of length 10 and height 1.
    pub fn bar(&self) -> Scene<Hyperelastic<2>, 2> {
        let cells = [10 * self.cells / 2, self.cells];
        let solid = Solid::rectangle([10.0, 1.0], cells, MATERIAL).moved([-5.0, -0.5]).rotated(self.angle);
        self.plane_body(&solid.lifted(self.height), self.step())
    }

    fn plane_body(&self, solid: &Solid<2>, h: f64) -> Scene<Hyperelastic<2>, 2> {
        let body = Hyperelastic::new(solid, self.law).gravity([0.0, -self.gravity]);
        let center = body.particles.center(&vec![0.0; body.particles.dofs()]);
        let velocity = body.particles.rigid_velocity([self.slide, -self.speed], self.spin, center);
        Scene { body, velocity, nodes: solid.surface_nodes(), floor: None, h }
    }

    /// A unit cube, turned about (1, 2, 0) and spinning about (1, 2, 3).
    pub fn cube(&self) -> Scene<Hyperelastic<3>, 3> {
        let solid = Solid::block([1.0; 3], [self.cells; 3], MATERIAL).moved([-0.5; 3]);
        self.solid_body(&solid.rotated([1.0, 2.0, 0.0], self.angle).lifted(self.height), self.step())
    }

    /// A ring of radii 0.7 and 1 and width 0.3, its axis level before it is turned, `cells` elements across.
    pub fn hoop(&self) -> Scene<Hyperelastic<3>, 3> {
        let cells = [self.cells, 20 * self.cells, self.cells];
        let solid = Solid::hoop([0.7, 1.0], 0.3, cells, MATERIAL);
        self.solid_body(&solid.rotated([1.0, 2.0, 0.0], self.angle).lifted(self.height), 0.3 * self.step())
    }

    fn solid_body(&self, solid: &Solid<3>, h: f64) -> Scene<Hyperelastic<3>, 3> {
        let body = Hyperelastic::new(solid, self.law).gravity([0.0, 0.0, -self.gravity]);
        let length = 14.0_f64.sqrt();
        let spin = [1.0, 2.0, 3.0].map(|x| self.spin * x / length);
        let center = body.particles.center(&vec![0.0; body.particles.dofs()]);
        let velocity = body.particles.rigid_velocity([self.slide, 0.0, -self.speed], spin, center);
        Scene { body, velocity, nodes: solid.surface_nodes(), floor: None, h }
    }

    /// A lattice mast of six bays, tumbling onto a table that swings.
    pub fn mast(&self) -> Scene<Truss<3>, 3> {
        let body = Truss::<3>::mast(6, [0.5, 0.5], 1.0, 1.0);
        let (sine, cosine) = self.angle.sin_cos();
        let lowest = body.particles.nodes.iter().map(|x| cosine * x[2] - sine * x[0]).fold(f64::INFINITY, f64::min);
        // The reference itself is turned: displacements start from zero.
        let turned = |[x, y, z]: [f64; 3]| [cosine * x + sine * z, y, cosine * z - sine * x - lowest + self.height];
        let body = body.placed(turned).gravity([0.0, 0.0, -self.gravity]);
        let center = body.particles.center(&vec![0.0; body.particles.dofs()]);
        let velocity =
            body.particles.rigid_velocity([self.slide, 0.0, -self.speed], [0.2 * self.spin, self.spin, 0.0], center);
        let floor: FloorMotion = |t| {
            let (s, c) = (0.5 * t).sin_cos();
            [-0.2 * (1.0 - c), -0.1 * s, -0.05 * c]
        };
        Scene {
            nodes: (0..body.particles.nodes.len()).collect(),
            body,
            velocity,
            floor: Some(floor),
            h: 0.1 * self.courant,
        }
    }
}

impl<B: Body<D>, const D: usize> Scene<B, D> {
    /// The scene ready to be built: contact, corrected if the scheme takes corrections.
    pub fn builder(&self, scheme: Box<dyn TimeIntegrator>) -> Result<SimulationBuilder<'static, f64>> {
        let particles = self.body.particles();
        let up = std::array::from_fn(|axis| f64::from(u8::from(axis + 1 == D)));
        let floor = Plane::new([0.0; D], up)?;
        let mut contact = NodesOnObstacle::new(floor, &particles.nodes, &particles.node_dofs(), &self.nodes)?;
        if let Some(motion) = self.floor {
            contact = contact.moving(move |t| motion(t).map(|x| up.map(|up| up * x)));
        }
        Ok(Simulation::builder(self.body.clone(), scheme, self.h)
            .velocity(self.velocity.clone())
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection()))
    }

    /// Lets it fly, with halved steps where they are refused.
    pub fn fly(&self, scheme: Box<dyn TimeIntegrator>, until: f64) -> Result<Flight> {
        let stages = scheme.tableau().stages.len() as u64;
        let control = StepControl::halving(self.h / 1024.0)?;
        let mut run = self.builder(scheme)?.step_control(control).build()?;
        Flight::measure(&mut run, self, stages, until)
    }
}

/// What is measured of a flight.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    pub steps: u64,
    pub refused: u64,
    /// Most and mean iterations of a stage, in steps without a contact near and in steps with; steps that were refused
    /// and those that took their place are left out.
    pub most: [u64; 2],
    pub mean: [f64; 2],
    /// Energy, with the weight's above the floor, over that at the start: largest, and at the end.
    pub energy_most: f64,
    pub energy_end: f64,
    /// Changes of contact.
    pub changes: u64,
    /// Momentum along the floor's normal beside what contact and weight have given since the fifth step, when the past
    /// of every scheme is known, over that at the start.
    pub momentum: f64,
    /// Angular momentum about the center of mass before the first contact, relative deviation.
    pub angular: f64,
    /// Deepest penetration.
    pub penetration: f64,
}

impl Flight {
    fn measure<B: Body<D>, const D: usize>(
        run: &mut Simulation<'_, f64>,
        scene: &Scene<B, D>,
        stages: u64,
        until: f64,
    ) -> Result<Self> {
        let particles = scene.body.particles();
        let up: Vec<f64> = (0..particles.dofs()).map(|dof| f64::from(u8::from(dof % D == D - 1))).collect();
        // The weight's energy is counted from where the nodes stand on the floor.
        let ground: f64 =
            (0..particles.dofs()).map(|dof| particles.load[dof] * particles.nodes[dof / D][dof % D]).sum();
        let energy = |run: &mut Simulation<'_, f64>| {
            run.energy().total() + particles.weight_energy(run.state().displacement()) - ground
        };
        let spin = |run: &Simulation<'_, f64>| {
            let (u, v) = (run.state().displacement(), run.state().velocity());
            particles.spin(u, v)
        };
        let start = (energy(run), spin(run));
        let weight: f64 = (0..particles.dofs()).map(|dof| particles.load[dof] * up[dof]).sum();
        let size =
            (0..particles.dofs()).map(|dof| (particles.mass[dof] * scene.velocity[dof] * up[dof]).abs()).sum::<f64>();
        let mut flight = Self { energy_most: f64::NEG_INFINITY, ..Self::default() };
        let (mut impulse, mut known, mut counts, mut sums) = (0.0, 0.0, [0_u64; 2], [0_u64; 2]);
        let mut touched = false;
        while run.time() < until - 1e-9 {
            let before = *run.statistics();
            run.step()?;
            let after = *run.statistics();
            let near = usize::from(after.contact_solves > before.contact_solves);
            touched |= near == 1;
            if after.refused_steps == before.refused_steps {
                let iterations = (after.newton_iterations - before.newton_iterations).div_ceil(stages);
                flight.most[near] = flight.most[near].max(iterations);
                sums[near] += iterations;
                counts[near] += 1;
            }
            let total = energy(run) / start.0;
            flight.energy_most = flight.energy_most.max(total);
            flight.energy_end = total;
            let contacts = run.state().contacts();
            impulse += contacts.impulses().iter().sum::<f64>();
            flight.penetration = contacts.gaps().iter().fold(flight.penetration, |deepest, gap| deepest.max(-gap));
            if after.steps == 5 {
                (known, impulse) = (run.momentum(&up)? - weight * run.time(), 0.0);
            } else if after.steps > 5 {
                let drift = run.momentum(&up)? - weight * run.time() - known - impulse;
                flight.momentum = flight.momentum.max(drift.abs() / size);
            }
            if !touched {
                let now = spin(run);
                let miss = now.iter().zip(start.1).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
                let whole = start.1.iter().map(|x| x * x).sum::<f64>().sqrt();
                flight.angular = flight.angular.max(miss / whole);
            }
        }
        let statistics = run.statistics();
        (flight.steps, flight.refused) = (statistics.steps, statistics.refused_steps);
        flight.changes = statistics.contact_changes;
        for near in 0..2 {
            flight.mean[near] = sums[near] as f64 / counts[near].max(1) as f64;
        }
        Ok(flight)
    }
}

/// What is measured of the stiff elastic pendulum.
#[derive(Clone, Debug, Default)]
pub struct Swing {
    /// Distances from the reference places, as far as the run came.
    pub errors: Vec<f64>,
    /// Largest relative deviations of energy and angular momentum.
    pub energy: f64,
    pub angular: f64,
    /// Mean iterations of a stage.
    pub iterations: f64,
    /// Time at which the run broke off, and why.
    pub failure: Option<(f64, String)>,
}

impl Swing {
    /// Swings a pendulum of axial stiffness `axial` until `until`.
    pub fn run(scheme: Box<dyn TimeIntegrator>, axial: f64, h: f64, until: f64) -> Result<Self> {
        use crate::truss::PendulumReference as Reference;
        let body = Truss::<2>::pendulum(axial);
        let stages = scheme.tableau().stages.len() as f64;
        let mut run = Simulation::builder(body.clone(), scheme, h).velocity(Truss::<2>::pendulum_velocity()).build()?;
        let mut swing = Self::default();
        let mut places = Reference::PLACES.iter().filter(|place| (place.axial - axial).abs() < 1e-6 * axial).peekable();
        while run.time() < until - 0.5 * h {
            if let Err(error) = run.step() {
                match error.is_recoverable() {
                    true => swing.failure = Some((run.time(), error.to_string())),
                    false => return Err(error),
                }
                break;
            }
            let energy = run.energy().total();
            let (u, v) = (run.state().displacement(), run.state().velocity());
            let angular = body.particles.angular_momentum(u, v);
            swing.energy = swing.energy.max((energy / Reference::ENERGY - 1.0).abs());
            swing.angular = swing.angular.max((angular / Reference::ANGULAR_MOMENTUM - 1.0).abs());
            if let Some(reference) = places.next_if(|place| (place.t - run.time()).abs() < 0.5 * h) {
                let place = [Reference::LENGTH + u[2], u[3]];
                swing.errors.push((place[0] - reference.place[0]).hypot(place[1] - reference.place[1]));
            }
        }
        swing.iterations = run.statistics().newton_iterations as f64 / (stages * run.statistics().steps.max(1) as f64);
        Ok(swing)
    }
}
