//! Two bridge decks end to end on bearings, which pound against each other in an earthquake: elastic bars.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Corrector, LinearSystem, Mass, Preset, Result, TimeIntegrator, mass};
use contact_dynamics_scenes::ground::Ground;
use contact_dynamics_scenes::pounding::{Pounding, Record, Scene};
use contact_dynamics_scenes::sparse::{self, Entry, diagonal, element, entries, matrix, product, spring};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A deck: a bar on a spring at either end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deck {
    pub(crate) length: f64,
    pub(crate) elements: usize,
    /// On its bearings, as a rigid body.
    pub(crate) period: f64,
}

/// Two decks of one cross-section with a joint between them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decks {
    pub(crate) decks: [Deck; 2],
    /// EA.
    pub(crate) stretching: f64,
    /// Mass over length.
    pub(crate) density: f64,
    /// Width of the joint.
    pub(crate) gap: f64,
    /// Damping ratio of the bearings, in proportion to the mass.
    pub(crate) damping: f64,
}

impl Decks {
    /// Concrete box girders of 6 m², 60 m and 40 m long, on bearings of 1.2 s and 0.7 s, 30 mm apart, with elements of
    /// 40/n m (SI units).
    pub(crate) fn of_the_study(n: usize) -> Self {
        let decks =
            [Deck { length: 60.0, elements: 3 * n / 2, period: 1.2 }, Deck { length: 40.0, elements: n, period: 0.7 }];
        Self { decks, stretching: 1.8e11, density: 1.5e4, gap: 0.03, damping: 0.05 }
    }

    /// √(EA/ρA).
    pub(crate) fn wave_speed(&self) -> f64 {
        (self.stretching / self.density).sqrt()
    }

    /// The ends that meet.
    pub(crate) fn contact(&self) -> [usize; 2] {
        [self.decks[0].elements, self.decks[0].elements + 1]
    }

    /// Number of dofs.
    pub(crate) fn dofs(&self) -> usize {
        self.decks[0].elements + self.decks[1].elements + 2
    }

    /// First dof of each deck with the deck.
    fn parts(&self) -> [(usize, Deck); 2] {
        [(0, self.decks[0]), (self.contact()[1], self.decks[1])]
    }

    /// A matrix of both, from diagonal and off-diagonal entries of their elements.
    fn of_elements(&self, entry: impl Fn(f64) -> [f64; 2]) -> Vec<Entry> {
        let of = |(first, deck): (usize, Deck)| {
            let own = entry(deck.length / deck.elements as f64);
            (first..first + deck.elements).flat_map(move |dof| element(dof, dof + 1, own)).collect::<Vec<_>>()
        };
        self.parts().into_iter().flat_map(of).collect()
    }

    fn stiffness(&self) -> SparseColMat<usize, f64> {
        let bars = self.of_elements(|size| [self.stretching / size, -self.stretching / size]);
        let bearings = self.parts().into_iter().flat_map(|(first, deck)| {
            let half = 0.5 * self.density * deck.length * (TAU / deck.period).powi(2);
            [first, first + deck.elements].map(|dof| (dof, dof, half))
        });
        let [i, j] = self.contact();
        // Places for the contact of damped laws, which is part of K there.
        matrix(self.dofs(), bars.into_iter().chain(bearings).chain(spring(i, j, 0.0)))
    }

    fn consistent_mass(&self) -> SparseColMat<usize, f64> {
        let share = |size: f64| self.density * size / 6.0;
        matrix(self.dofs(), self.of_elements(|size| [2.0 * share(size), share(size)]))
    }

    /// M a + C v + K u = −M ι a_g(t), each deck with C = 2 ζ ω M.
    fn scene(&self, mass: SparseColMat<usize, f64>, ground: Arc<Ground>) -> Result<Scene> {
        let load = product(mass.as_ref(), &vec![1.0; self.dofs()]);
        let [i, j] = self.contact();
        let factor = |dof: usize| {
            let deck = self.decks[usize::from(dof >= j)];
            2.0 * self.damping * TAU / deck.period
        };
        // (No entry of M couples the decks.)
        let damping = entries(&mass).into_iter().map(|(row, column, m)| (row, column, factor(row) * m));
        let damping = matrix(self.dofs(), damping);
        let system = LinearSystem::new(mass, self.stiffness())?.damping(damping)?.load(move |t, force| {
            let acceleration = ground.at(t);
            force.iter_mut().zip(&load).for_each(|(force, mass)| *force = -mass * acceleration);
        });
        Ok(Scene { system, pairs: vec![([i, j], self.gap)] })
    }

    /// Runs with a lumped mass.
    ///
    /// # Errors
    ///
    /// Those of the builder and of the steps.
    pub(crate) fn lumped(
        &self,
        ground: &Arc<Ground>,
        pounding: Pounding,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        [h, until]: [f64; 2],
    ) -> Result<Record> {
        let mass = diagonal(&mass::lump(self.consistent_mass().as_ref())?);
        self.scene(mass, ground.clone())?.run(pounding, scheme, correctors, h, until)
    }

    /// Runs a preset, with rigid contact.
    ///
    /// # Errors
    ///
    /// Those of the preset, the builder and the steps.
    pub(crate) fn preset(&self, ground: &Arc<Ground>, preset: Preset, [h, until]: [f64; 2]) -> Result<Record> {
        let (m, k) = (self.consistent_mass(), self.stiffness());
        let contact = self.contact();
        let courant = mass::courant(Mass::Consistent(m.as_ref()), k.as_ref(), h)?[contact[0]];
        let groups: Vec<_> = (0..self.dofs()).map(|dof| usize::from(dof >= contact[1])).collect();
        // The places for damped contact join the decks, which the mass must not.
        let neighbors = sparse::matrix::<f64>(self.dofs(), self.of_elements(|_| [1.0, 1.0]));
        let mass = preset.mass(m.as_ref(), neighbors.symbolic(), &contact, &groups, courant)?;
        let rigid = Pounding::Law(contact_dynamics::ContactLaw::Rigid);
        self.scene(mass, ground.clone())?.run(rigid, preset.integrator(), preset.correctors(), h, until)
    }
}
