//! Triangles of a hyperelastic material in the plane, W = ½ μ (F:F − 2 J) + ½ λ (J − 1)²: polynomials of the
//! displacements, so that units of powers of two change no bit.

use super::recipe::Rubber;
use contact_dynamics::{Error, Real, Result};

/// How the words of an error end where there is no number for what is asked.
pub(super) const BEYOND: &str = "beyond all numbers";

type Tensor<T> = [[T; 2]; 2];

/// A triangle in the units of a run.
#[derive(Clone, Debug)]
pub struct Triangle<T> {
    pub(super) dofs: Vec<usize>,
    gradients: [[T; 2]; 3],
    lambda: T,
    mu: T,
    /// K without displacement, row by row.
    linear: Vec<T>,
}

/// The stiffness at some displacements, in natural units.
pub(super) fn stiffness(rubber: &Rubber, u: &[f64; 6]) -> [[f64; 6]; 6] {
    let Rubber { gradients, lambda, mu } = *rubber;
    Triangle { dofs: (0..6).collect(), gradients, lambda, mu, linear: Vec::new() }.stiffness(&deformed(u, &gradients))
}

/// ∂u/∂X.
fn deformed<T: Real>(u: &[T; 6], gradients: &[[T; 2]; 3]) -> Tensor<T> {
    let mut h = [[T::zero(); 2]; 2];
    for (a, gradient) in gradients.iter().enumerate() {
        for (i, row) in h.iter_mut().enumerate() {
            row.iter_mut().zip(gradient).for_each(|(h, g)| *h += u[2 * a + i] * *g);
        }
    }
    h
}

/// J − 1, without loss of digits where strains are small.
fn dilatation<T: Real>(h: &Tensor<T>) -> T {
    h[0][0] + h[1][1] + (h[0][0] * h[1][1] - h[0][1] * h[1][0])
}

fn cofactors<T: Real>(a: &Tensor<T>) -> Tensor<T> {
    [[a[1][1], -a[1][0]], [-a[0][1], a[0][0]]]
}

impl<T: Real> Triangle<T> {
    /// In units of length and stiffness.
    pub(super) fn new((dofs, rubber, linear): (&[usize], &Rubber, &[f64]), [length, unit]: [f64; 2]) -> Self {
        let modulus = unit * length * length;
        Self {
            dofs: dofs.to_vec(),
            gradients: rubber.gradients.map(|gradient| gradient.map(|x| T::of(x / length))),
            lambda: T::of(rubber.lambda * modulus),
            mu: T::of(rubber.mu * modulus),
            linear: linear.iter().map(|k| T::of(k * unit)).collect(),
        }
    }

    fn displacements(&self, u: &[T]) -> [T; 6] {
        std::array::from_fn(|place| u[self.dofs[place]])
    }

    /// ∂u/∂X, unless the triangle is turned inside out.
    fn admitted(&self, callback: &'static str, u: &[T; 6]) -> Result<Tensor<T>> {
        let h = deformed(u, &self.gradients);
        let det = T::one() + dilatation(&h);
        let words = match (det.is_finite(), u.iter().find(|u| !u.is_finite())) {
            (true, _) if det > T::zero() => return Ok(h),
            (true, _) => format!("det F = {:e}", det.value()),
            // (A diverging iteration may overflow here; what is handed in must be numbers all the same.)
            (false, None) => format!("det F is {BEYOND}"),
            (false, Some(u)) => format!("a displacement is {u}"),
        };
        Err(Error::Inadmissible { callback, source: words.into() })
    }

    /// K u.
    fn linear_force(&self, u: &[T; 6]) -> [T; 6] {
        std::array::from_fn(|i| (0..6).map(|j| self.linear[6 * i + j] * u[j]).sum())
    }

    /// The internal force less K u.
    pub(super) fn force_beyond(&self, callback: &'static str, u: &[T]) -> Result<[T; 6]> {
        let u = self.displacements(u);
        let h = self.admitted(callback, &u)?;
        let (turned, rest) = (cofactors(&h), self.lambda * dilatation(&h));
        let one = |i: usize, j: usize| if i == j { T::one() } else { T::zero() };
        let stress = |i: usize, j: usize| self.mu * (h[i][j] - turned[i][j]) + rest * (one(i, j) + turned[i][j]);
        let linear = self.linear_force(&u);
        Ok(std::array::from_fn(|place| {
            let (gradient, i) = (self.gradients[place / 2], place % 2);
            stress(i, 0) * gradient[0] + stress(i, 1) * gradient[1] - linear[place]
        }))
    }

    fn stiffness(&self, h: &Tensor<T>) -> [[T; 6]; 6] {
        let turned = cofactors(h);
        let (trace, swelling) = (self.lambda, self.lambda * dilatation(h));
        let one = |i: usize, j: usize| if i == j { T::one() } else { T::zero() };
        let whole = |i: usize, j: usize| one(i, j) + turned[i][j];
        let mut k = [[T::zero(); 6]; 6];
        for column in 0..6 {
            let mut change = [[T::zero(); 2]; 2];
            change[column % 2] = self.gradients[column / 2];
            let turned = cofactors(&change);
            let grows: T = (0..4).map(|e| whole(e / 2, e % 2) * change[e / 2][e % 2]).sum();
            let stress = |i: usize, j: usize| {
                self.mu * (change[i][j] - turned[i][j]) + trace * grows * whole(i, j) + swelling * turned[i][j]
            };
            for (row, k) in k.iter_mut().enumerate() {
                let gradient = self.gradients[row / 2];
                k[column] = stress(row % 2, 0) * gradient[0] + stress(row % 2, 1) * gradient[1];
            }
        }
        k
    }

    /// The stiffness less K.
    pub(super) fn stiffness_beyond(&self, callback: &'static str, u: &[T]) -> Result<[[T; 6]; 6]> {
        let mut k = self.stiffness(&self.admitted(callback, &self.displacements(u))?);
        k.as_flattened_mut().iter_mut().zip(&self.linear).for_each(|(k, linear)| *k -= *linear);
        Ok(k)
    }

    /// W times the volume, less ½ uᵀK u.
    pub(super) fn energy_beyond(&self, u: &[T]) -> T {
        let u = self.displacements(u);
        let h = deformed(&u, &self.gradients);
        let (half, swelling) = (T::of(0.5), dilatation(&h));
        let shear =
            h.as_flattened().iter().map(|x| *x * *x).sum::<T>() - T::of(2.0) * (h[0][0] * h[1][1] - h[0][1] * h[1][0]);
        let linear: T = self.linear_force(&u).iter().zip(&u).map(|(f, u)| *f * *u).sum();
        half * (self.mu * shear + self.lambda * swelling * swelling - linear)
    }
}
