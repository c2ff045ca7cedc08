//! One elastic bar above a rigid floor, upright, under gravity.

use crate::masses::{Body, MassMatrix};
use crate::reference::BouncingBar;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::mass::affine_motions;
use contact_dynamics::{ContactLaw, LinearRows, LinearSystem, Result, Simulation};

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
            young: bar.young,
            density: bar.density,
            length: bar.length,
            gravity: bar.gravity,
            height: bar.drop,
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
        self.system_with(MassMatrix::Lumped(self.mass()))
    }

    /// The system with a mass of any kind; every dof weighs what its row of M sums up to.
    pub fn system_with(&self, mass: MassMatrix) -> LinearSystem<'static, f64> {
        let (load, gravity) = (mass.row_sums(), self.gravity);
        let system = mass.system(self.stiffness()).unwrap();
        let system = match self.damping > 0.0 {
            true => system.rayleigh(0.0, self.damping).unwrap(),
            false => system,
        };
        system.load(move |_, f| f.iter_mut().zip(&load).for_each(|(f, m)| *f = -gravity * m))
    }

    /// K.
    pub fn stiffness(&self) -> SparseColMat<usize, f64> {
        let k = self.young / self.element_size();
        self.matrix([k, -k])
    }

    /// The consistent M.
    pub fn consistent_mass(&self) -> SparseColMat<usize, f64> {
        let m = self.density * self.element_size();
        self.matrix([m / 3.0, m / 6.0])
    }

    /// The sum of all elements' matrices, given by the entry on their diagonal and the other one.
    fn matrix(&self, [diagonal, off]: [f64; 2]) -> SparseColMat<usize, f64> {
        let entries = (0..self.elements)
            .flat_map(|i| [(i, i, diagonal), (i + 1, i + 1, diagonal), (i, i + 1, off), (i + 1, i, off)])
            .map(|(i, j, x)| Triplet::new(i, j, x));
        let n = self.elements + 1;
        SparseColMat::try_new_from_triplets(n, n, &entries.collect::<Vec<_>>()).unwrap()
    }

    /// What treatments of the mass need.
    pub fn body(&self) -> Body {
        let n = self.elements + 1;
        let coordinates: Vec<[f64; 1]> = (0..n).map(|node| [node as f64 * self.element_size()]).collect();
        let dofs: Vec<[usize; 1]> = (0..n).map(|dof| [dof]).collect();
        Body {
            consistent: self.consistent_mass(),
            stiffness: self.stiffness(),
            contact: vec![0],
            groups: vec![0; n],
            motions: affine_motions(n, &coordinates, &dofs).unwrap(),
        }
    }

    /// The lower end above the floor.
    pub fn contact(&self) -> LinearRows<'static, f64> {
        self.contact_under(ContactLaw::Rigid)
    }

    /// The lower end above the floor, under any law.
    pub fn contact_under(&self, law: ContactLaw) -> LinearRows<'static, f64> {
        LinearRows::new().row(law, &[(0, 1.0)], self.height)
    }

    /// Displacements at rest on the floor, lower end at the floor.
    pub fn rest(&self) -> Vec<f64> {
        self.rest_with(&self.mass())
    }

    /// The same for a bar whose dofs weigh as these masses.
    pub fn rest_with(&self, mass: &[f64]) -> Vec<f64> {
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
        self.total_energy_with(&self.mass(), kinetic_and_elastic, u)
    }

    /// The same for a bar whose dofs weigh as these masses.
    pub fn total_energy_with(&self, mass: &[f64], kinetic_and_elastic: f64, u: &[f64]) -> f64 {
        let potential: f64 = mass.iter().zip(u).map(|(m, u)| m * self.gravity * (u + self.height)).sum();
        kinetic_and_elastic + potential
    }
}

/// What is measured of a bar that bounces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounces {
    /// Energy after each of six periods over that at the start.
    pub energy: [f64; 6],
    /// RMS error of the force in the first contact, relative to the exact one: everywhere, and away from the fronts by
    /// 0.15 s and 0.1 s of the 0.67 s it lasts.
    pub force: f64,
    pub ramp: f64,
    /// Largest force of the first period over the largest exact one.
    pub force_max: f64,
    /// How late the contacts of the first period begin and end.
    pub events: [f64; 4],
    /// Contacts that closed or opened in the first period (exact: 4).
    pub changes: u64,
}

impl WallBar {
    /// Runs the bouncing bar, whose dofs weigh as these masses, for six periods in steps of `h`; forces act `load` of a
    /// step after the states before those they are reported with.
    pub fn bounces(&self, mass: &[f64], run: &mut Simulation<'_, f64>, h: f64, load: f64) -> Result<Bounces> {
        let exact = BouncingBar::doyen();
        let [t1, t2, t3, t4] = exact.events();
        let (period, apart) = (exact.period(), 0.5 * (t2 + t3));
        let mut figures = Bounces::default();
        let mut forces = Vec::new();
        while run.time() < period - 0.5 * h {
            run.step()?;
            let contacts = run.state().contacts();
            forces.push((run.time(), contacts.forces()[0], contacts.raw_forces()[0]));
        }
        figures.changes = run.statistics().contact_changes;
        let late = (load - 1.0) * h;
        let error = |from: f64, to: f64| {
            let inside = forces.iter().map(|&(t, force, _)| (t + late, force)).filter(|(t, _)| *t > from && *t < to);
            let (sum, count) = inside.fold((0.0, 0.0), |(sum, count), (t, force)| {
                (sum + (force / exact.contact_force(t) - 1.0).powi(2), count + 1.0)
            });
            f64::sqrt(sum / count)
        };
        (figures.force, figures.ramp) = (error(t1, t2), error(t1 + 0.15, t2 - 0.1));
        let top = exact.contact_force(t2 - 1e-9);
        figures.force_max = forces.iter().fold(0.0_f64, |top, f| top.max(f.1)) / top;
        let pressed = |(from, to): (f64, f64)| {
            let mut times = forces.iter().filter(|(t, _, raw)| *t > from && *t <= to && *raw > 0.0).map(|f| f.0);
            let first = times.next().unwrap_or(f64::NAN);
            (first, times.next_back().unwrap_or(first))
        };
        let (first, second) = (pressed((0.0, apart)), pressed((apart, period)));
        figures.events = [first.0 - t1, first.1 - t2, second.0 - t3, second.1 - t4];
        for (number, energy) in (1..).zip(&mut figures.energy) {
            run.run_until(f64::from(number) * period - 0.5 * h, &mut ())?;
            let kinetic_and_elastic = run.energy().total();
            *energy = self.total_energy_with(mass, kinetic_and_elastic, run.state().displacement());
        }
        let start = mass.iter().sum::<f64>() * self.gravity * self.height;
        figures.energy = figures.energy.map(|energy| energy / start);
        Ok(figures)
    }
}
