//! A rigid ball that is pressed onto an elastic half-space and then moved sideways: partial slip by Cattaneo and
//! Mindlin.

use crate::solids::{Material, Solid};
use contact_dynamics::contact::{Side, Sphere};
use contact_dynamics::{ContactStatus, GeneralizedAlpha, LinearSystem, NodesOnObstacle, Result, Simulation};
use std::f64::consts::PI;

/// The scene: half of the half-space, y ≥ 0, with elements of one size under the contact and larger ones around it.
/// Nothing has mass, so that each step is a static balance.
#[derive(Clone, Debug)]
pub struct Press {
    pub solid: Solid<3>,
    /// Radius of the ball, that of the contact by Hertz, and elements across the latter.
    pub radius: f64,
    pub contact: f64,
    pub across: usize,
    pub friction: f64,
}

/// Forces on the whole contact, its radius, and that of the circle in which it sticks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Loaded {
    pub normal: f64,
    pub tangential: f64,
    pub radius: f64,
    pub stick: f64,
}

impl Press {
    /// With so many elements across the contact radius.
    pub fn new(across: usize, poisson: f64) -> Self {
        /// By how much elements outside grow, and the half-space's size over the contact radius.
        const GROWTH: f64 = 1.5;
        const SIZE: f64 = 8.0;
        let (radius, contact) = (1.0, 0.1);
        let finest = contact / across as f64;
        // Elements of one size, then growing ones, from the middle outward.
        let (even, even_below) = ((1.25 * across as f64).ceil() as usize, across / 2);
        let grown = ((SIZE * across as f64).ln() / GROWTH.ln()).ceil() as usize;
        let place = |i: usize, even: usize| {
            let growing = (even..i).map(|k| GROWTH.powf((k - even + 1) as f64)).sum::<f64>();
            finest * (i.min(even) as f64 + growing)
        };
        let (cells, deep) = (even + grown, even_below + grown);
        let material = Material { young: 1.0, poisson, density: 1.0 };
        let solid = Solid::block([2.0 * cells as f64, cells as f64, deep as f64], [2 * cells, cells, deep], material);
        let solid = solid.mapped(|[x, y, z]| {
            let index = |x: f64| x.abs().round() as usize;
            let (x, below) = (x - cells as f64, deep as f64 - z);
            [x.signum() * place(index(x), even), place(index(y), even), -place(index(below), even_below)]
        });
        Self { solid, radius, contact, across, friction: 0.3 }
    }

    /// Way of the ball into the half-space, and sideways until all of the contact slides: δ = 3 μ P (2 − ν)/(16 G a).
    fn ways(&self) -> [f64; 2] {
        let Material { young, poisson, .. } = self.solid.material;
        let (shear, a) = (young / (2.0 * (1.0 + poisson)), self.contact);
        let force = 4.0 / 3.0 * young / (1.0 - poisson * poisson) * a.powi(3) / self.radius;
        [a * a / self.radius, 3.0 * self.friction * force * (2.0 - poisson) / (16.0 * shear * a)]
    }

    fn system(&self) -> Result<LinearSystem<'static, f64>> {
        let solid = &self.solid;
        let far = solid.nodes.iter().fold([0.0_f64; 3], |far, node| std::array::from_fn(|k| far[k].max(node[k].abs())));
        let mut system = LinearSystem::lumped(vec![0.0; solid.dofs()], solid.stiffness())?;
        for (node, &[x, y, z]) in solid.nodes.iter().enumerate() {
            let is_far = x.abs() >= far[0] || y >= far[1] || -z >= far[2];
            for axis in (0..3).filter(|&axis| is_far || axis == 1 && y == 0.0) {
                system = system.fix(3 * node + axis)?;
            }
        }
        Ok(system)
    }

    /// The ball as an obstacle that is so deep in the half-space at the time 0, and moves by `way` in a unit of time.
    fn ball(&self, depth: f64, way: [f64; 3]) -> Result<NodesOnObstacle<'static, f64, 3>> {
        let solid = &self.solid;
        let near = |&node: &usize| {
            let [x, y, z] = solid.nodes[node];
            z == 0.0 && x.hypot(y) < 1.24 * self.contact
        };
        let nodes: Vec<_> = (0..solid.nodes.len()).filter(near).collect();
        let sphere = Sphere::new([0.0, 0.0, self.radius - depth], self.radius, Side::Outside)?;
        let ball = NodesOnObstacle::new(sphere, &solid.nodes, &solid.node_dofs(), &nodes)?;
        Ok(ball.moving(move |t| [way.map(|way| way * t), way, [0.0; 3]]))
    }

    /// Presses without friction; the displacements.
    fn pressed(&self) -> Result<Vec<f64>> {
        let [depth, _] = self.ways();
        let mut run = Simulation::builder(self.system()?, GeneralizedAlpha::chung_hulbert(0.0)?, 0.25)
            .constraint(self.ball(0.0, [0.0, 0.0, -depth])?)
            .build()?;
        run.run_until(1.0, &mut ())?;
        Ok(run.state().displacement().to_vec())
    }

    /// Presses, and moves the ball sideways until all of the contact slides, in so many steps; the loads after each.
    ///
    /// # Errors
    ///
    /// Those of the runs.
    pub fn moved(&self, steps: u32) -> Result<Vec<Loaded>> {
        let ([depth, way], scheme) = (self.ways(), GeneralizedAlpha::chung_hulbert(0.0)?);
        let mut run = Simulation::builder(self.system()?, scheme, 1.0 / f64::from(steps))
            .displacement(self.pressed()?)
            .constraint(self.ball(depth, [way, 0.0, 0.0])?.friction(self.friction))
            .build()?;
        let step = |_| run.step().map(|()| self.loaded(&run));
        (0..steps).map(step).collect()
    }

    fn loaded(&self, run: &Simulation<'_, f64>) -> Loaded {
        let finest = self.contact / self.across as f64;
        let (mut loaded, mut areas) = (Loaded::default(), [0.0; 2]);
        for contact in run.contact_forces() {
            for (dof, force) in contact.forces() {
                match dof % 3 {
                    0 => loaded.tangential += 2.0 * force,
                    2 => loaded.normal -= 2.0 * force,
                    _ => {}
                }
            }
            let is_doubled = self.solid.nodes[contact.row[0].0 / 3][1] > 0.0;
            let area = if is_doubled { 2.0 * finest * finest } else { finest * finest };
            match contact.status {
                ContactStatus::Sticking => areas = areas.map(|sum| sum + area),
                ContactStatus::Sliding => areas[0] += area,
                _ => {}
            }
        }
        let [radius, stick] = areas.map(|area| (area / PI).sqrt());
        Loaded { radius, stick, ..loaded }
    }
}
