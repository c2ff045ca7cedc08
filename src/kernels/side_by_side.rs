//! Conjugate gradients for several right-hand sides together: each row of a sweep waits for earlier ones, and the
//! other right-hand sides use that time.
//!
//! Compiled for the vector units of the machine that it runs on. The result for one right-hand side does not depend
//! on the others or on the machine: no product is fused with its sum.
#![allow(clippy::inline_always)] // only inlined code is compiled for the vector units

use super::conjugate_gradients::{Blocks, Judge, NEGLIGIBLE, Outcome};
use crate::scalar::Scalar;
use faer::traits::pulp::{Arch, Simd, WithSimd};

/// The number of right-hand sides.
pub(crate) const LANES: usize = 4;

/// One entry of each right-hand side.
pub(crate) type Lanes<T> = [T; LANES];

/// Vectors of conjugate gradients: the solution, the right-hand side, which is overwritten, and three work vectors.
#[derive(Debug)]
pub struct SideVectors<'a, T> {
    pub x: &'a mut [Lanes<T>],
    pub r: &'a mut [Lanes<T>],
    pub p: &'a mut [Lanes<T>],
    pub t: &'a mut [Lanes<T>],
    pub y: &'a mut [Lanes<T>],
}

/// Solves (1 + L + Lᵀ) x = r, with single entries as blocks of L, by the method of
/// [`Sweeps::GaussSeidel`](super::conjugate_gradients::Sweeps::GaussSeidel). For each right-hand side it ends when an
/// update is below a share of the solution, and fails at the iteration limit; `ends` holds both.
#[inline]
pub(crate) fn solve<T: Scalar>(
    lower: &Blocks<'_, T>,
    ends: (f64, usize),
    vectors: SideVectors<'_, T>,
) -> [Outcome; LANES] {
    Arch::new().dispatch(Solve { lower, ends, vectors })
}

struct Solve<'a, T> {
    lower: &'a Blocks<'a, T>,
    ends: (f64, usize),
    vectors: SideVectors<'a, T>,
}

/// Σ L_ij y_j of row i.
#[inline(always)]
fn gather<T: Scalar>(lower: &Blocks<'_, T>, row: usize, y: &[Lanes<T>]) -> Lanes<T> {
    let range = lower.pointers[row]..lower.pointers[row + 1];
    let mut sum = [T::zero(); LANES];
    for (&column, &value) in lower.columns[range.clone()].iter().zip(&lower.values[range]) {
        let y = &y[column as usize];
        for l in 0..LANES {
            sum[l] += value * y[l];
        }
    }
    sum
}

/// `sums += x y`, in double precision.
#[inline(always)]
fn accumulate<T: Scalar>(x: &Lanes<T>, y: &Lanes<T>, sums: &mut Lanes<f64>) {
    for l in 0..LANES {
        sums[l] += x[l].value() * y[l].value();
    }
}

impl<T: Scalar> WithSimd for Solve<'_, T> {
    type Output = [Outcome; LANES];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [Outcome; LANES] {
        let Self { lower, ends: (resolution, limit), vectors: SideVectors { x, r, p, t, y } } = self;
        let rows = x.len();
        let (r, p, t, y) = (&mut r[..rows], &mut p[..rows], &mut t[..rows], &mut y[..rows]);
        x.fill([T::zero(); LANES]);
        let mut rho = [0.0; LANES];
        for row in 0..rows {
            let sum = gather(lower, row, r);
            for l in 0..LANES {
                r[row][l] -= sum[l];
            }
            accumulate(&r[row], &r[row], &mut rho);
        }
        p.copy_from_slice(r);
        let mut judges = rho.map(|first| Judge::new([0.0, resolution], limit, first));
        let mut outcomes = rho.map(|rho| (rho == 0.0).then_some(Outcome::Converged { iterations: 0 }));
        while outcomes.iter().any(Option::is_none) {
            t.copy_from_slice(p);
            for row in (0..rows).rev() {
                let own = t[row];
                let range = lower.pointers[row]..lower.pointers[row + 1];
                for (&column, &value) in lower.columns[range.clone()].iter().zip(&lower.values[range]) {
                    let t = &mut t[column as usize];
                    for l in 0..LANES {
                        t[l] -= value * own[l];
                    }
                }
            }
            let mut curvature = [0.0; LANES];
            for row in 0..rows {
                let sum = gather(lower, row, y);
                let (p, t, y) = (&p[row], &t[row], &mut y[row]);
                let mut image = [T::zero(); LANES];
                for l in 0..LANES {
                    y[l] = p[l] - t[l] - sum[l];
                    image[l] = t[l] + y[l];
                }
                accumulate(p, &image, &mut curvature);
            }
            let mut steps = [0.0; LANES];
            for l in 0..LANES {
                if outcomes[l].is_some() {
                    continue;
                }
                match curvature[l] > 0.0 && curvature[l].is_finite() {
                    true => steps[l] = rho[l] / curvature[l],
                    false => outcomes[l] = Some(Outcome::Indefinite { curvature: curvature[l], dof: largest(t, l) }),
                }
            }
            let (alpha, before) = (steps.map(T::of), rho);
            rho = [0.0; LANES];
            for row in 0..rows {
                let (x, r, t, y) = (&mut x[row], &mut r[row], &t[row], &y[row]);
                for l in 0..LANES {
                    x[l] += alpha[l] * t[l];
                    r[l] -= alpha[l] * (t[l] + y[l]);
                }
                accumulate(r, r, &mut rho);
            }
            let mut beta = [T::zero(); LANES];
            for l in 0..LANES {
                if outcomes[l].is_none() {
                    outcomes[l] = judges[l].outcome(steps[l], before[l], rho[l]);
                    beta[l] = T::of(rho[l] / before[l]);
                }
            }
            for (p, r) in p.iter_mut().zip(r.iter()) {
                for l in 0..LANES {
                    p[l] = r[l] + beta[l] * p[l];
                }
            }
        }
        let mut lengths = [0.0; LANES];
        for x in x.iter() {
            accumulate(x, x, &mut lengths);
        }
        std::array::from_fn(|l| match outcomes[l] {
            // As for one right-hand side: singular to working precision.
            Some(Outcome::Converged { iterations }) if iterations > 0 => {
                let bound = NEGLIGIBLE * T::epsilon().value() * lengths[l];
                match judges[l].length <= bound {
                    true => Outcome::Indefinite { curvature: judges[l].length / lengths[l], dof: largest(x, l) },
                    false => Outcome::Converged { iterations },
                }
            }
            Some(other) => other,
            None => Outcome::Converged { iterations: 0 },
        })
    }
}

/// The row of the largest entry of one of the vectors.
fn largest<T: Scalar>(x: &[Lanes<T>], lane: usize) -> usize {
    let sizes = x.iter().map(|x| x[lane].abs()).enumerate();
    sizes.fold((0, T::zero()), |largest, (row, size)| if size > largest.1 { (row, size) } else { largest }).0
}
