//! Slabs that strike a rough wall obliquely: plane P and S waves, a column of elements with two dofs a node, uncoupled
//! but for the cone of friction at the wall.

use crate::masses::Body;
use crate::sparse::matrix;
use contact_dynamics::mass::affine_motions;
use contact_dynamics::{
    ContactLaw, Corrector, LinearRows, LinearSystem, Mass, Preset, Result, Simulation, SimulationBuilder,
    TimeIntegrator, mass,
};

/// A slab before its impact, in the units of the scene: mass a length and wave speeds.
#[derive(Clone, Copy, Debug)]
pub struct Slab {
    /// Elements along its thickness.
    pub elements: usize,
    /// Thickness.
    pub length: f64,
    /// Mass over length (density times area).
    pub density: f64,
    /// Wave speeds: P and S.
    pub speeds: [f64; 2],
    /// Velocity towards the wall, and along it.
    pub velocity: [f64; 2],
    /// Friction coefficient of the wall.
    pub friction: f64,
}

impl Slab {
    /// The slab of the studies, thrown along the wall with this speed: at .02 it sticks, at .05 it slides.
    pub fn thrown(elements: usize, along: f64) -> Self {
        let speeds = [100.0, 100.0 / 3.0_f64.sqrt()];
        Self { elements, length: 10.0, density: 0.0025, speeds, velocity: [0.05, along], friction: 0.3 }
    }

    /// How long it stays at the wall.
    pub fn contact_time(&self) -> f64 {
        2.0 * self.length / self.speeds[0]
    }

    /// The pressure on the wall, and the friction: constant while contact lasts (d'Alembert).
    pub fn forces(&self) -> [f64; 2] {
        let [normal, along] = [0, 1].map(|k| self.density * self.speeds[k] * self.velocity[k]);
        [normal, along.min(self.friction * normal)]
    }

    /// The velocity with which it slides along the wall; zero if it sticks.
    pub fn slip(&self) -> f64 {
        let [_, friction] = self.forces();
        self.velocity[1] - friction / (self.density * self.speeds[1])
    }

    /// Number of dofs: x and y of each node, from the wall on.
    pub(crate) fn dofs(&self) -> usize {
        2 * self.elements + 2
    }

    /// The entries of a matrix from those of an element, diagonal and off-diagonal of x and y.
    fn entries(&self, element: [[f64; 2]; 2]) -> Vec<(usize, usize, f64)> {
        let mut entries = Vec::new();
        for e in 0..self.elements {
            for (k, [own, other]) in element.into_iter().enumerate() {
                let (i, j) = (2 * e + k, 2 * e + 2 + k);
                entries.extend([(i, i, own), (j, j, own), (i, j, other), (j, i, other)]);
            }
        }
        entries
    }

    /// The entries of K.
    pub(crate) fn stiffness(&self) -> Vec<(usize, usize, f64)> {
        let size = self.length / self.elements as f64;
        self.entries(self.speeds.map(|c| [1.0, -1.0].map(|sign| sign * self.density * c * c / size)))
    }

    /// Its lumped mass.
    pub(crate) fn mass(&self) -> Vec<f64> {
        let mut mass = vec![self.density * self.length / self.elements as f64; self.dofs()];
        let last = mass.len() - 2;
        for dof in [0, 1, last, last + 1] {
            mass[dof] *= 0.5;
        }
        mass
    }

    /// Its velocity: toward the wall, and along it.
    pub fn velocities(&self) -> impl Iterator<Item = f64> {
        let [toward, along] = self.velocity;
        (0..self.dofs()).map(move |dof| if dof % 2 == 0 { -toward } else { along })
    }

    /// A run that begins with the slab this far from the wall.
    fn scene(
        &self,
        system: LinearSystem<'static, f64>,
        scheme: Box<dyn TimeIntegrator>,
        h: f64,
        gap: f64,
    ) -> SimulationBuilder<'static, f64> {
        let velocity = self.velocities().collect();
        Simulation::builder(system, scheme, h).velocity(velocity).constraint(self.wall(ContactLaw::Rigid, gap))
    }

    /// The rough wall, under any law.
    pub fn wall(&self, law: ContactLaw, gap: f64) -> LinearRows<'static, f64> {
        LinearRows::new().row(law, &[(0, 1.0)], gap).friction(self.friction, &[&[(1, 1.0)]])
    }

    /// What treatments of the mass need of it: the node at the wall may lose its mass in both directions.
    pub fn body(&self) -> Body {
        let (nodes, size) = (self.elements + 1, self.length / self.elements as f64);
        let element = [self.density * size / 3.0, self.density * size / 6.0];
        let places: Vec<[f64; 2]> = (0..nodes).map(|node| [node as f64 * size, 0.0]).collect();
        let dofs: Vec<[usize; 2]> = (0..nodes).map(|node| [2 * node, 2 * node + 1]).collect();
        Body {
            consistent: matrix(self.dofs(), self.entries([element; 2])),
            stiffness: matrix(self.dofs(), self.stiffness()),
            contact: vec![0, 1],
            groups: (0..self.dofs()).map(|dof| dof % 2).collect(),
            motions: affine_motions(self.dofs(), &places, &dofs).expect("places of all dofs"),
        }
    }

    /// On a lumped mass, with the correctors given.
    ///
    /// # Errors
    ///
    /// Those of the builder.
    pub fn lumped(
        &self,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        h: f64,
        gap: f64,
    ) -> Result<Simulation<'static, f64>> {
        let system = LinearSystem::lumped(self.mass(), matrix(self.dofs(), self.stiffness()))?;
        self.scene(system, scheme, h, gap).correctors(correctors).build()
    }

    /// By a preset; massless are the contact dofs of all directions.
    ///
    /// # Errors
    ///
    /// Those of the builder.
    pub fn preset(&self, preset: Preset, h: f64, gap: f64) -> Result<Simulation<'static, f64>> {
        let Body { consistent: m, stiffness: k, contact, groups, .. } = self.body();
        let courant = mass::courant(Mass::Consistent(m.as_ref()), k.as_ref(), h)?[0];
        let m = preset.mass(m.as_ref(), k.symbolic(), &contact, &groups, courant)?;
        let system = LinearSystem::new(m, k)?;
        self.scene(system, preset.integrator(), h, gap).correctors(preset.correctors()).build()
    }
}

/// What is measured of an impact.
#[derive(Clone, Copy, Debug, Default)]
pub struct Impact {
    /// Mean errors of pressure and friction over their exact values, while contact lasts.
    pub error: [f64; 2],
    /// Total variation of the friction over its exact value, between the states in contact.
    pub variation: f64,
    /// Largest friction over its exact value.
    pub largest: f64,
    /// Velocities of the whole slab after contact, off the wall and along it.
    pub velocity: [f64; 2],
}

impl Impact {
    /// Runs until contact is over, which begins after the time `start`.
    ///
    /// # Errors
    ///
    /// Those of the steps.
    pub fn of(slab: &Slab, run: &mut Simulation<'_, f64>, start: f64) -> Result<Self> {
        let (exact, end) = (slab.forces(), start + 0.95 * slab.contact_time());
        let mut found = Self::default();
        let (mut states, mut before) = (0.0, None::<f64>);
        while run.state().time() < end + 0.25 * slab.contact_time() {
            run.step()?;
            let contacts = run.state().contacts();
            let (t, forces) = (run.state().time(), [contacts.forces()[0], -contacts.friction_forces(0)[0]]);
            if t > start && t <= end {
                states += 1.0;
                for k in 0..2 {
                    found.error[k] += (forces[k] / exact[k] - 1.0).abs();
                }
            }
            found.largest = found.largest.max(forces[1].abs() / exact[1]);
            if contacts.closed()[0] && t <= end {
                found.variation += before.map_or(0.0, |before| (forces[1] - before).abs() / exact[1]);
                before = Some(forces[1]);
            }
        }
        found.error = found.error.map(|error| error / states);
        for (k, velocity) in found.velocity.iter_mut().enumerate() {
            let direction: Vec<_> = (0..run.state().velocity().len()).map(|dof| f64::from(dof % 2 == k)).collect();
            *velocity = run.momentum(&direction)? / (slab.density * slab.length);
        }
        Ok(found)
    }

    /// The mean over impacts in so many phases of the step.
    ///
    /// # Errors
    ///
    /// Those of the runs.
    pub fn mean(
        slab: &Slab,
        h: f64,
        phases: usize,
        run: impl Fn(f64) -> Result<Simulation<'static, f64>>,
    ) -> Result<Self> {
        let mut mean = Self::default();
        for phase in 0..phases {
            let start = (2.0 + phase as f64 / phases as f64) * h;
            let one = Self::of(slab, &mut run(start * slab.velocity[0])?, start)?;
            let share = 1.0 / phases as f64;
            for k in 0..2 {
                mean.error[k] += share * one.error[k];
                mean.velocity[k] += share * one.velocity[k];
            }
            mean.variation += share * one.variation;
            mean.largest = mean.largest.max(one.largest);
        }
        Ok(mean)
    }
}
