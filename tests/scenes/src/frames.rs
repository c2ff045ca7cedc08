//! Two shear frames of different periods side by side, which pound against each other in an earthquake.

use crate::ground::Ground;
use crate::pounding::{Impacts, Pounding, Record, Scene};
use crate::sparse::{Entry, matrix, spring};
use contact_dynamics::{Corrector, LinearSystem, Result, TimeIntegrator};
use std::f64::consts::PI;
use std::sync::Arc;

/// A shear frame: equal rigid floors on equal storeys.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub storeys: usize,
    /// Of a floor.
    pub mass: f64,
    /// Of a storey, against its drift.
    pub stiffness: f64,
}

impl Frame {
    /// Circular frequency of a mode, from 1 on: 2 √(k/m) sin((2j − 1)π/(4n + 2)).
    pub fn frequency(&self, mode: usize) -> f64 {
        let angle = (2 * mode - 1) as f64 * PI / (4 * self.storeys + 2) as f64;
        2.0 * (self.stiffness / self.mass).sqrt() * angle.sin()
    }

    /// The fundamental period.
    pub fn period(&self) -> f64 {
        2.0 * PI / self.frequency(1)
    }

    /// The shape of a mode, largest entry at most 1: sin((2j − 1) π i/(2n + 1)) at floor i = 1 … n.
    pub fn shape(&self, mode: usize) -> Vec<f64> {
        let angle = (2 * mode - 1) as f64 * PI / (2 * self.storeys + 1) as f64;
        (1..=self.storeys).map(|floor| (angle * floor as f64).sin()).collect()
    }

    /// Rayleigh's coefficients, of M and of K, for a damping ratio in the first two modes.
    pub fn rayleigh(&self, ratio: f64) -> [f64; 2] {
        let [first, second] = [self.frequency(1), self.frequency(self.storeys.min(2))];
        match self.storeys {
            1 => [0.0, 2.0 * ratio / first],
            _ => [2.0 * ratio * first * second / (first + second), 2.0 * ratio / (first + second)],
        }
    }

    /// The entries of K times a factor, from this dof on.
    fn entries(&self, first: usize, factor: f64) -> impl Iterator<Item = Entry> + use<> {
        let (n, k) = (self.storeys, factor * self.stiffness);
        let above = (1..n).flat_map(move |floor| spring(first + floor - 1, first + floor, k));
        std::iter::once((first, first, k)).chain(above)
    }
}

/// Two frames with a gap between their floors; their displacements are relative to the ground.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    pub frames: [Frame; 2],
    pub gap: f64,
    /// Damping ratio of the first two modes of each.
    pub damping: f64,
}

impl Frames {
    /// Five storeys of 400 t and three of 300 t, periods of 0.90 s and 0.35 s, 15 mm apart (SI units).
    pub fn of_the_study() -> Self {
        let frames =
            [Frame { storeys: 5, mass: 4e5, stiffness: 2.4e8 }, Frame { storeys: 3, mass: 3e5, stiffness: 4.9e8 }];
        Self { frames, gap: 0.015, damping: 0.05 }
    }

    /// Number of dofs: the floors of the left frame from below, then those of the right one.
    pub fn dofs(&self) -> usize {
        self.frames[0].storeys + self.frames[1].storeys
    }

    /// The dofs of the floors that may meet, from below.
    pub fn pairs(&self) -> Vec<[usize; 2]> {
        let [left, right] = self.frames.map(|frame| frame.storeys);
        (0..left.min(right)).map(|floor| [floor, left + floor]).collect()
    }

    /// M of the floors.
    pub fn masses(&self) -> Vec<f64> {
        self.frames.iter().flat_map(|frame| std::iter::repeat_n(frame.mass, frame.storeys)).collect()
    }

    /// Both frames on the ground: M a + C v + K u = −M ι a_g(t), with ι = 1 for every floor.
    ///
    /// # Errors
    ///
    /// Those of the system.
    pub fn system(&self, ground: Arc<Ground>) -> Result<LinearSystem<'static, f64>> {
        let (n, masses) = (self.dofs(), self.masses());
        let firsts = [0, self.frames[0].storeys];
        let [first, second] = self.frames;
        let own = |factors: [f64; 2]| first.entries(0, factors[0]).chain(second.entries(firsts[1], factors[1]));
        // Places for the contacts of damped laws, which are part of K there.
        let places = self.pairs().into_iter().flat_map(|[i, j]| [(i, j, 0.0), (j, i, 0.0)]);
        let stiffness = matrix(n, own([1.0; 2]).chain(places));
        let [left, right] = self.frames.map(|frame| frame.rayleigh(self.damping));
        let of_mass = masses.iter().enumerate().map(|(dof, mass)| {
            let coefficient = if dof < firsts[1] { left[0] } else { right[0] };
            (dof, dof, coefficient * mass)
        });
        let damping = matrix(n, own([left[1], right[1]]).chain(of_mass));
        let load = masses.clone();
        LinearSystem::lumped(masses, stiffness)?.damping(damping).map(|system| {
            system.load(move |t, force| {
                let acceleration = ground.at(t);
                force.iter_mut().zip(&load).for_each(|(force, mass)| *force = -mass * acceleration);
            })
        })
    }

    /// Runs with steps h until a time.
    ///
    /// # Errors
    ///
    /// Those of the builder and of the steps.
    pub fn run(
        &self,
        ground: &Arc<Ground>,
        pounding: Pounding,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        h: f64,
        until: f64,
    ) -> Result<Record> {
        let pairs = self.pairs().into_iter().map(|dofs| (dofs, self.gap)).collect();
        Scene { system: self.system(ground.clone())?, pairs }.run(pounding, scheme, correctors, h, until)
    }

    /// What is compared of a run.
    pub fn figures(&self, record: &Record) -> Figures {
        let mut figures = Figures {
            impacts: record.impacts(),
            toward: [0.0; 2],
            drifts: vec![0.0; self.dofs()],
            seconds: record.seconds,
        };
        let first_right = self.frames[0].storeys;
        let top = self.pairs().last().copied().unwrap_or_default();
        for (_, u) in record.displacements() {
            for (floor, drift) in figures.drifts.iter_mut().enumerate() {
                let below = if floor == 0 || floor == first_right { 0.0 } else { u[floor - 1] };
                *drift = drift.max((u[floor] - below).abs());
            }
            let toward = [u[top[0]], -u[top[1]]];
            figures.toward = [0, 1].map(|side| figures.toward[side].max(toward[side]));
        }
        figures
    }
}

/// What is compared of runs.
#[derive(Clone, Debug)]
pub struct Figures {
    pub impacts: Impacts,
    /// Largest displacement toward the other frame, of either at the highest level where they meet.
    pub toward: [f64; 2],
    /// Largest drift of each storey.
    pub drifts: Vec<f64>,
    /// Seconds a step.
    pub seconds: f64,
}
