//! One elastic bar above a rigid floor, upright, under gravity.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::reference::BouncingBar;
use contact_dynamics::{LinearRows, LinearSystem};

/// A bar of linear elements with lumped mass; dof 0 is its lower end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallBar {
    pub elements: usize,
    pub young: f64,
    pub density: f64,
    pub length: f64,
    pub gravity: f64,
    /// Height of the lower end above the floor.
    pub height: f64,
    /// Stiffness-proportional damping.
    pub damping: f64,
}

impl WallBar {
    /// The bar of the bounces of Doyen, Ern and Piperno.
    pub fn bouncing(elements: usize) -> Self {
        let bar = BouncingBar::doyen();
        Self {
            elements,
            young: bar.young(),
            density: bar.density(),
            length: bar.length(),
            gravity: bar.gravity(),
            height: bar.drop(),
            damping: 0.0,
        }
    }

    pub fn element_size(&self) -> f64 {
        self.length / self.elements as f64
    }

    pub fn weight(&self) -> f64 {
        self.density * self.length * self.gravity
    }

    pub fn wave_speed(&self) -> f64 {
        (self.young / self.density).sqrt()
    }

    pub fn mass(&self) -> Vec<f64> {
        let m = self.density * self.element_size();
        (0..=self.elements).map(|i| if i == 0 || i == self.elements { 0.5 * m } else { m }).collect()
    }

    pub fn system(&self) -> LinearSystem<'static, f64> {
        let k = self.young / self.element_size();
        let entries = (0..self.elements)
            .flat_map(|i| [(i, i, k), (i + 1, i + 1, k), (i, i + 1, -k), (i + 1, i, -k)])
            .map(|(i, j, k)| Triplet::new(i, j, k));
        let n = self.elements + 1;
        let k = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries.collect::<Vec<_>>()).unwrap();
        let (mass, gravity) = (self.mass(), self.gravity);
        let load = self.mass();
        let system = LinearSystem::lumped(mass, k).unwrap();
        let system = match self.damping > 0.0 {
            true => system.rayleigh(0.0, self.damping).unwrap(),
            false => system,
        };
        system.load(move |_, f| f.iter_mut().zip(&load).for_each(|(f, m)| *f = -gravity * m))
    }

    /// The lower end above the floor.
    pub fn contact(&self) -> LinearRows<'static, f64> {
        LinearRows::new().unilateral(&[(0, 1.0)], self.height)
    }

    /// Displacements at rest on the floor, lower end at the floor.
    pub fn rest(&self) -> Vec<f64> {
        let mass = self.mass();
        let stiffness = self.young / self.element_size();
        let mut u = vec![-self.height];
        let mut above: f64 = mass.iter().sum();
        for (i, m) in mass.iter().take(self.elements).enumerate() {
            above -= m;
            u.push(u[i] - self.gravity * above / stiffness);
        }
        u
    }

    /// Energy with that of the height, zero when the undeformed bar stands on the floor.
    pub fn total_energy(&self, kinetic_and_elastic: f64, u: &[f64]) -> f64 {
        let potential: f64 = self.mass().iter().zip(u).map(|(m, u)| m * self.gravity * (u + self.height)).sum();
        kinetic_and_elastic + potential
    }
}
