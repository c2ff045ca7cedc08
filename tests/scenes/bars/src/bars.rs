//! Two elastic bars of linear elements on a line, one behind the other, with contact between their facing ends.

use crate::masses::{Body, MassMatrix};
use crate::reference::{Bar, CollidingBars};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::mass::affine_motions;
use contact_dynamics::{ContactLaw, LinearRows, LinearSystem, Real};

/// Lumped or consistent mass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MassKind {
    Lumped,
    Consistent,
}

/// Data of a two-bar impact; bar 0 is the left one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bars {
    /// Elements a bar.
    pub elements: [usize; 2],
    pub young: [f64; 2],
    pub density: [f64; 2],
    pub area: f64,
    pub length: [f64; 2],
    pub velocity: [f64; 2],
    pub gap: f64,
    pub mass: MassKind,
}

impl Bars {
    /// The paper's data (1-D equivalent): L = 10, E = 100, ρ = 0.01, A = 0.25, v = ±0.05, gap 0.01; impact at 0.1,
    /// release at 0.3.
    pub fn paper(elements: usize) -> Self {
        Self {
            elements: [elements; 2],
            young: [100.0; 2],
            density: [0.01; 2],
            area: 0.25,
            length: [10.0; 2],
            velocity: [0.05, -0.05],
            gap: 0.01,
            mass: MassKind::Lumped,
        }
    }

    /// Bars of different stiffness (E = 49 and 100), one of them at rest; release at 0.3857.
    pub fn dissimilar(elements: usize) -> Self {
        Self { young: [49.0, 100.0], area: 1.0, velocity: [0.1, 0.0], ..Self::paper(elements) }
    }

    /// Equal bars of lengths 10 and 20, the short one moving: from 0.3 to 0.5 they touch without force.
    pub fn unequal(elements: usize) -> Self {
        let area = 1.0;
        Self { elements: [elements, 2 * elements], length: [10.0, 20.0], area, velocity: [0.1, 0.0], ..Self::paper(1) }
    }

    /// The same bars with the impact `phase` of a step `h` later.
    pub fn delayed(self, phase: f64, h: f64) -> Self {
        Self { gap: self.gap + phase * h * (self.velocity[0] - self.velocity[1]), ..self }
    }

    /// The same bars in units in which a length of 1 reads `length`, a time `time`, a mass `mass`.
    pub fn in_units(self, length: f64, time: f64, mass: f64) -> Self {
        let pressure = mass / (length * time * time);
        let velocity = length / time;
        Self {
            young: self.young.map(|x| x * pressure),
            density: self.density.map(|x| x * mass / length.powi(3)),
            area: self.area * length * length,
            length: self.length.map(|x| x * length),
            velocity: self.velocity.map(|x| x * velocity),
            gap: self.gap * length,
            ..self
        }
    }

    pub fn with_mass(self, mass: MassKind) -> Self {
        Self { mass, ..self }
    }

    pub fn dofs(&self) -> usize {
        self.elements[0] + self.elements[1] + 2
    }

    /// The contact dofs: right end of the left bar, left end of the right one.
    pub fn contact_dofs(&self) -> [usize; 2] {
        [self.elements[0], self.elements[0] + 1]
    }

    /// Time of impact.
    pub fn impact_time(&self) -> f64 {
        self.gap / (self.velocity[0] - self.velocity[1])
    }

    /// Element size of a bar.
    pub fn element_size(&self, bar: usize) -> f64 {
        self.length[bar] / self.elements[bar] as f64
    }

    /// Calls `element(first dof, stiffness, mass)` for every element.
    fn each_element(&self, mut element: impl FnMut(usize, f64, f64)) {
        let mut first = 0;
        for bar in 0..2 {
            let size = self.element_size(bar);
            for e in 0..self.elements[bar] {
                element(first + e, self.young[bar] * self.area / size, self.density[bar] * self.area * size);
            }
            first += self.elements[bar] + 1;
        }
    }

    /// K.
    pub fn stiffness<T: Real>(&self) -> SparseColMat<usize, T> {
        self.matrix(|k, _| [k, -k])
    }

    /// The consistent M.
    pub fn consistent_mass<T: Real>(&self) -> SparseColMat<usize, T> {
        self.matrix(|_, m| [m / 3.0, m / 6.0])
    }

    fn matrix<T: Real>(&self, entries: impl Fn(f64, f64) -> [f64; 2]) -> SparseColMat<usize, T> {
        let mut triplets = Vec::new();
        self.each_element(|i, k, m| {
            let [diagonal, off] = entries(k, m);
            for (r, c, value) in [(i, i, diagonal), (i, i + 1, off), (i + 1, i, off), (i + 1, i + 1, diagonal)] {
                triplets.push(Triplet::new(r, c, value));
            }
        });
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(self.dofs(), self.dofs(), &triplets).unwrap();
        let (pattern, values) = matrix.into_parts();
        SparseColMat::new(pattern, values.into_iter().map(T::of).collect())
    }

    /// The lumped masses.
    pub fn lumped_mass<T: Real>(&self) -> Vec<T> {
        let mut mass = vec![0.0; self.dofs()];
        self.each_element(|i, _, m| {
            mass[i] += m / 2.0;
            mass[i + 1] += m / 2.0;
        });
        mass.into_iter().map(T::of).collect()
    }

    /// The free system.
    pub fn system<T: Real>(&self) -> LinearSystem<'static, T> {
        match self.mass {
            MassKind::Lumped => LinearSystem::lumped(self.lumped_mass(), self.stiffness()),
            MassKind::Consistent => LinearSystem::new(self.consistent_mass(), self.stiffness()),
        }
        .unwrap()
    }

    /// The free system with a mass of any kind.
    pub fn system_with(&self, mass: MassMatrix) -> LinearSystem<'static, f64> {
        mass.system(self.stiffness()).unwrap()
    }

    /// What treatments of the mass need.
    pub fn body(&self) -> Body {
        let place = |dof: usize| match dof.checked_sub(self.contact_dofs()[1]) {
            None => dof as f64 * self.element_size(0),
            Some(node) => self.length[0] + node as f64 * self.element_size(1),
        };
        let coordinates: Vec<[f64; 1]> = (0..self.dofs()).map(|dof| [place(dof)]).collect();
        let dofs: Vec<[usize; 1]> = (0..self.dofs()).map(|dof| [dof]).collect();
        Body {
            consistent: self.consistent_mass(),
            stiffness: self.stiffness(),
            contact: self.contact_dofs().to_vec(),
            groups: (0..self.dofs()).map(|dof| usize::from(dof >= self.contact_dofs()[1])).collect(),
            motions: affine_motions(self.dofs(), &coordinates, &dofs).unwrap(),
        }
    }

    /// The contact row, gap = u_right − u_left + gap.
    pub fn contact<T: Real>(&self) -> LinearRows<'static, T> {
        self.contact_under(ContactLaw::Rigid)
    }

    /// The contact row under any law.
    pub fn contact_under<T: Real>(&self, law: ContactLaw) -> LinearRows<'static, T> {
        let [left, right] = self.contact_dofs();
        LinearRows::new().row(law, &[(left, -T::one()), (right, T::one())], T::of(self.gap))
    }

    /// Initial velocities.
    pub fn velocities<T: Real>(&self) -> Vec<T> {
        let bar = |bar: usize| std::iter::repeat_n(T::of(self.velocity[bar]), self.elements[bar] + 1);
        bar(0).chain(bar(1)).collect()
    }

    /// The exact solution up to time `until`.
    pub fn exact(&self, until: f64) -> CollidingBars {
        let bar = |i: usize| Bar {
            young: self.young[i],
            density: self.density[i],
            area: self.area,
            length: self.length[i],
            velocity: self.velocity[i],
        };
        CollidingBars::new(bar(0), bar(1), self.gap, until).unwrap()
    }
}
