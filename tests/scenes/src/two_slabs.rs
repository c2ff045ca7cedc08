//! Two slabs of different impedance that strike each other obliquely: their friction sticks, slides, sticks and slides
//! again, as the waves change pressure and shear between them.

use crate::slabs::Slab;
use crate::sparse::matrix;
use contact_dynamics::{Corrector, LinearRows, LinearSystem, Result, Simulation, TimeIntegrator};

/// Two slabs; each in coordinates of its own that point from the contact into it.
#[derive(Clone, Copy, Debug)]
pub struct TwoSlabs {
    pub slabs: [Slab; 2],
}

impl TwoSlabs {
    /// A thin stiff slab and a thick soft one, with so many elements across the thin one.
    pub fn new(elements: usize) -> Self {
        let thin = Slab { length: 5.0, ..Slab::thrown(elements, 0.031) };
        let thick = Slab { length: 20.0, density: 0.5 * thin.density, ..Slab::thrown(4 * elements, 0.0) };
        Self { slabs: [thin, thick] }
    }

    /// What is looked at of an impact: the time until the first S wave is back a second time, before P waves have left
    /// the thick slab.
    pub fn until(&self) -> f64 {
        3.0 * self.travel(0, 0)
    }

    /// Time of P and S waves (k = 0, 1) through a slab and back.
    fn travel(&self, slab: usize, k: usize) -> f64 {
        2.0 * self.slabs[slab].length / self.slabs[slab].speeds[k]
    }

    /// Velocity by which the sides would approach, or slide, if no force acted at t: a force sends velocities −f/Z into
    /// a slab, which come back with their sign and are doubled at the end that is free then.
    fn free(&self, k: usize, t: f64, force: &dyn Fn(f64) -> f64) -> f64 {
        let sign = [1.0, if k == 0 { 1.0 } else { -1.0 }];
        let of = |slab: usize| {
            let impedance = self.impedance(slab, k);
            let travel = self.travel(slab, k);
            let passed = (1..).map(|trip| t - f64::from(trip) * travel).take_while(|&then| then >= 0.0);
            sign[slab] * self.slabs[slab].velocity[k] - 2.0 / impedance * passed.map(force).sum::<f64>()
        };
        of(0) + of(1)
    }

    fn impedance(&self, slab: usize, k: usize) -> f64 {
        self.slabs[slab].density * self.slabs[slab].speeds[k]
    }

    /// What a unit force changes the velocity between the sides by.
    fn compliance(&self, k: usize) -> f64 {
        (0..2).map(|slab| self.impedance(slab, k).recip()).sum()
    }

    /// The pressure a time t after the impact.
    pub fn pressure(&self, t: f64) -> f64 {
        (self.free(0, t, &|then| self.pressure(then)) / self.compliance(0)).max(0.0)
    }

    /// The friction then: what holds, or μ times the pressure.
    pub fn friction(&self, t: f64) -> f64 {
        let bound = self.slabs[0].friction * self.pressure(t);
        (self.free(1, t, &|then| self.friction(then)) / self.compliance(1)).clamp(-bound, bound)
    }

    /// A run on lumped masses that begins with this gap.
    ///
    /// # Errors
    ///
    /// Those of the builder.
    pub fn run(
        &self,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        h: f64,
        gap: f64,
    ) -> Result<Simulation<'static, f64>> {
        let [thin, thick] = self.slabs;
        let first = thin.dofs();
        let moved = thick.stiffness().into_iter().map(|(i, j, k)| (i + first, j + first, k));
        let k = matrix(first + thick.dofs(), thin.stiffness().into_iter().chain(moved));
        let contact = LinearRows::new().unilateral(&[(0, 1.0), (first, 1.0)], gap);
        let contact = contact.friction(thin.friction, &[&[(1, 1.0), (first + 1, -1.0)]]);
        Simulation::builder(LinearSystem::lumped([thin.mass(), thick.mass()].concat(), k)?, scheme, h)
            .velocity(thin.velocities().chain(thick.velocities()).collect())
            .constraint(contact)
            .correctors(correctors)
            .build()
    }

    /// Mean errors of pressure and friction, over those at the impact, and the largest friction over that; means over
    /// so many phases of the impact in a step, and the largest of all.
    ///
    /// # Errors
    ///
    /// Those of the runs.
    pub fn measured(
        &self,
        phases: usize,
        h: f64,
        run: impl Fn(f64) -> Result<Simulation<'static, f64>>,
    ) -> Result<[f64; 3]> {
        let approach: f64 = self.slabs.iter().map(|slab| slab.velocity[0]).sum();
        let scale = [self.pressure(0.0), self.friction(0.0)];
        let (mut sums, mut states, mut largest) = ([0.0; 2], 0.0, 0.0_f64);
        for phase in 0..phases {
            let start = (2.0 + phase as f64 / phases as f64) * h;
            let mut run = run(start * approach)?;
            while run.time() < start + self.until() {
                run.step()?;
                let (t, contacts) = (run.time() - start, run.state().contacts());
                let forces = [contacts.forces()[0], -contacts.friction_forces(0)[0]];
                if t > 0.0 && t < self.until() {
                    states += 1.0;
                    for (k, exact) in [self.pressure(t), self.friction(t)].into_iter().enumerate() {
                        sums[k] += (forces[k] - exact).abs() / scale[k];
                    }
                }
                largest = largest.max(forces[1].abs() / scale[1]);
            }
        }
        Ok([sums[0] / states, sums[1] / states, largest])
    }
}
