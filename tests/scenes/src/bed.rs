//! A bar on a rough bed, pushed suddenly at its end: friction of constant strength along all of it.

use crate::sparse;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Corrector, LinearRows, LinearSystem, Result, Simulation, TimeIntegrator, mass};

/// The bar: nodes with two dofs each, along it and off the bed, pressed onto it by their weight.
#[derive(Clone, Copy, Debug)]
pub struct Bed {
    /// Elements.
    pub elements: usize,
    /// Axial stiffness.
    pub stiffness: f64,
    /// Mass over length.
    pub density: f64,
    /// Friction over length.
    pub resistance: f64,
    /// Force on the end.
    pub force: f64,
    /// Friction coefficient.
    pub friction: f64,
}

impl Bed {
    /// That of the studies.
    pub fn new(elements: usize) -> Self {
        Self { elements, stiffness: 1e4, density: 1.0, resistance: 20.0, force: 100.0, friction: 0.5 }
    }

    /// The wave speed.
    pub fn speed(&self) -> f64 {
        (self.stiffness / self.density).sqrt()
    }

    /// Its length: a quarter more than what moves.
    pub fn length(&self) -> f64 {
        2.5 * self.force / self.resistance
    }

    /// When all of it stops at once: t* = 2 F/(q c).
    pub fn end(&self) -> f64 {
        2.0 * self.force / (self.resistance * self.speed())
    }

    /// Where its end is then: F²/(q EA).
    pub fn displacement(&self) -> f64 {
        self.force * self.force / (self.resistance * self.stiffness)
    }

    /// A run with steps of this Courant number, on a lumped mass.
    ///
    /// # Errors
    ///
    /// Those of the builder.
    pub fn run(
        &self,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        courant: f64,
    ) -> Result<Simulation<'static, f64>> {
        let system = LinearSystem::lumped(self.lumped(), self.stiffness())?;
        self.scene(system, scheme, correctors, courant)
    }

    /// The same on the consistent mass with this weight, the rest lumped ([`mass::blend`]); across the bar it stays
    /// lumped.
    ///
    /// # Errors
    ///
    /// Those of the blend and of the builder.
    pub fn blended(
        &self,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        courant: f64,
        weight: f64,
    ) -> Result<Simulation<'static, f64>> {
        let (n, lumped, m) = (self.elements, self.lumped(), self.density * self.size());
        let along = (0..n).flat_map(|e| sparse::element(2 * e, 2 * e + 2, [m / 3.0, m / 6.0]));
        let across = (0..=n).map(|node| (2 * node + 1, 2 * node + 1, lumped[2 * node + 1]));
        let consistent = sparse::matrix(2 * n + 2, along.chain(across));
        let mass = mass::blend(consistent.as_ref(), &lumped, weight)?;
        self.scene(LinearSystem::new(mass, self.stiffness())?, scheme, correctors, courant)
    }

    /// Length of an element.
    fn size(&self) -> f64 {
        self.length() / self.elements as f64
    }

    /// The part of an element that a node has.
    fn share(&self, node: usize) -> f64 {
        if node == 0 || node == self.elements { 0.5 } else { 1.0 }
    }

    fn lumped(&self) -> Vec<f64> {
        (0..2 * self.elements + 2).map(|dof| self.density * self.size() * self.share(dof / 2)).collect()
    }

    fn stiffness(&self) -> SparseColMat<usize, f64> {
        let (n, k) = (self.elements, self.stiffness / self.size());
        let along = (0..n).flat_map(|e| sparse::spring(2 * e, 2 * e + 2, k));
        sparse::matrix(2 * n + 2, along.chain((0..=n).map(|node| (2 * node + 1, 2 * node + 1, 0.0))))
    }

    fn scene(
        &self,
        system: LinearSystem<'static, f64>,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        courant: f64,
    ) -> Result<Simulation<'static, f64>> {
        let bed = *self;
        let system = system.load(move |_, f| {
            let weight = bed.resistance * bed.size() / bed.friction;
            for node in 0..=bed.elements {
                f[2 * node + 1] = -weight * bed.share(node);
            }
            f[0] = bed.force;
        });
        let ground = (0..=self.elements).fold(LinearRows::new(), |rows, node| {
            rows.unilateral(&[(2 * node + 1, 1.0)], 0.0).friction(self.friction, &[&[(2 * node, 1.0)]])
        });
        Simulation::builder(system, scheme, courant * self.size() / self.speed())
            .constraint(ground)
            .correctors(correctors)
            .build()
    }

    /// Runs to three times the end: the displacement of the end of the bar over the exact one, and the variation of
    /// friction after the stop, of all nodes, over the force on the end.
    ///
    /// # Errors
    ///
    /// Those of the steps.
    pub fn measure(&self, run: &mut Simulation<'_, f64>) -> Result<[f64; 2]> {
        let (mut variation, mut before) = (0.0, vec![0.0; self.elements + 1]);
        while run.state().time() < 3.0 * self.end() {
            run.step()?;
            let (t, contacts) = (run.state().time(), run.state().contacts());
            for (node, before) in before.iter_mut().enumerate() {
                let force = contacts.friction_forces(node)[0];
                if t > 1.05 * self.end() {
                    variation += (force - *before).abs() / self.force;
                }
                *before = force;
            }
        }
        Ok([run.state().displacement()[0] / self.displacement(), variation])
    }
}
