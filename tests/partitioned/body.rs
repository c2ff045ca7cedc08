//! A body in a code of its own, with its interface.

use crate::scene::H;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Automatic, Factorization};
use contact_dynamics_scenes::sparse::{block, factorized, product};
use std::ops::Range;

/// A body in a code of its own: Newmark's rows, its own factors of M + ¼ h² K and M, and its interface.
pub(crate) struct Body {
    stiffness: SparseColMat<usize, f64>,
    factor: Box<dyn Factorization<f64>>,
    mass: Box<dyn Factorization<f64>>,
    /// Its contact dofs.
    pub(crate) contact: Vec<usize>,
    /// What unit forces do to displacements, and to velocities and accelerations, at the interface.
    pub(crate) flexibility: Vec<f64>,
    pub(crate) inertia: Vec<f64>,
    pub(crate) u: Vec<f64>,
    pub(crate) v: Vec<f64>,
    pub(crate) a: Vec<f64>,
}

/// The block of `scale` A⁻¹ on some dofs.
fn on_interface(factor: &mut dyn Factorization<f64>, n: usize, dofs: &[usize], scale: f64) -> Vec<f64> {
    let column = |&dof: &usize| {
        let mut x = vec![0.0; n];
        x[dof] = scale;
        factor.solve(&mut x).unwrap();
        dofs.iter().map(|&dof| x[dof]).collect::<Vec<_>>()
    };
    dofs.iter().flat_map(column).collect()
}

impl Body {
    /// The dofs of a range in matrices of all bodies, mass and stiffness; contact dofs are counted in the range.
    pub(crate) fn new(
        [mass, stiffness]: [&SparseColMat<usize, f64>; 2],
        velocity: &[f64],
        range: Range<usize>,
        contact: Vec<usize>,
    ) -> Self {
        let quarter = 0.25 * H * H;
        let mut factor = factorized(&Automatic, &block(&range, &[(1.0, mass), (quarter, stiffness)]));
        let mut inertia = factorized(&Automatic, &block(&range, &[(1.0, mass)]));
        Self {
            stiffness: block(&range, &[(1.0, stiffness)]),
            flexibility: on_interface(&mut *factor, range.len(), &contact, quarter),
            inertia: on_interface(&mut *inertia, range.len(), &contact, 1.0),
            factor,
            mass: inertia,
            contact,
            u: vec![0.0; range.len()],
            v: velocity[range.clone()].to_vec(),
            a: vec![0.0; range.len()],
        }
    }

    pub(crate) fn at_interface(&self, x: &[f64]) -> Vec<f64> {
        self.contact.iter().map(|&dof| x[dof]).collect()
    }

    /// A step without contact.
    pub(crate) fn advance(&mut self) {
        for i in 0..self.u.len() {
            self.u[i] += H * self.v[i] + 0.25 * H * H * self.a[i];
            self.v[i] += 0.5 * H * self.a[i];
        }
        self.a = product(self.stiffness.as_ref(), &self.u);
        self.a.iter_mut().for_each(|f| *f = -*f);
        self.factor.solve(&mut self.a).unwrap();
        let Self { u, v, a, .. } = self;
        for i in 0..u.len() {
            u[i] += 0.25 * H * H * a[i];
            v[i] += 0.5 * H * a[i];
        }
    }

    fn forces(&self, l: &[f64]) -> Vec<f64> {
        let mut f = vec![0.0; self.u.len()];
        self.contact.iter().zip(l).for_each(|(&dof, l)| f[dof] = *l);
        f
    }

    /// Adds the response to the forces on its contact dofs.
    pub(crate) fn push(&mut self, l: &[f64]) {
        let mut a = self.forces(l);
        self.factor.solve(&mut a).unwrap();
        for (i, a) in a.into_iter().enumerate() {
            self.u[i] += 0.25 * H * H * a;
            self.v[i] += 0.5 * H * a;
            self.a[i] += a;
        }
    }

    pub(crate) fn jump(&mut self, l: &[f64]) -> Vec<f64> {
        let mut x = self.forces(l);
        self.mass.solve(&mut x).unwrap();
        x
    }
}

/// A random flexibility of full rank, or of one dimension less.
pub(crate) fn flexibility(random: &mut impl FnMut() -> f64, n: usize, rank: usize) -> Vec<f64> {
    let b: Vec<f64> = (0..n * rank).map(|_| random() - 0.3).collect();
    (0..n * n).map(|k| (0..rank).map(|r| b[k % n + r * n] * b[k / n + r * n]).sum()).collect()
}

/// Puts bodies, whose dofs come one after the other, into a motion.
pub(crate) fn go_to(bodies: &mut [Body], [u, v, a, _]: [&[f64]; 4]) {
    let mut first = 0;
    for body in bodies {
        let range = first..first + body.u.len();
        first = range.end;
        for (own, all) in [(&mut body.u, u), (&mut body.v, v), (&mut body.a, a)] {
            own.copy_from_slice(&all[range.clone()]);
        }
    }
}
