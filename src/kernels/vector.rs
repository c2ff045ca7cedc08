//! Loops over vectors.
//!
//! `combine` and `recover` are compiled for the vector units of the machine that they run on. Their results are
//! bitwise the same on any machine: no product is fused with its sum.
#![allow(clippy::inline_always)] // only inlined code is compiled for the vector units

use crate::scalar::Scalar;
use faer::traits::pulp::{Arch, Simd, WithSimd};

/// Whether a pass adds to the present values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accumulate {
    Replace,
    Add,
}

/// `out = c x`.
#[inline]
pub(crate) fn scale_into<T: Scalar>(c: T, x: &[T], out: &mut [T]) {
    for (y, &x) in out.iter_mut().zip(x) {
        *y = c * x;
    }
}

/// `out += c x`.
#[inline]
pub(crate) fn axpy<T: Scalar>(c: T, x: &[T], out: &mut [T]) {
    for (y, &x) in out.iter_mut().zip(x) {
        *y += c * x;
    }
}

/// `out += c (x − y)`.
#[inline]
pub(crate) fn axpy_difference<T: Scalar>(c: T, x: &[T], y: &[T], out: &mut [T]) {
    for ((out, &x), &y) in out.iter_mut().zip(x).zip(y) {
        *out += c * (x - y);
    }
}

/// `out = Σ c x + Σ c (x − y)` in one pass, summed in this order; without a term nothing is written.
#[inline]
pub(crate) fn combine<T: Scalar>(terms: &[(T, &[T])], differences: &[(T, &[T])], y: &[T], out: &mut [T]) {
    Arch::new().dispatch(Combine(terms, differences, y, out));
}

/// `u += w₀ d, v += w₁ d`, and `a = w₂ d` or `a += w₂ d`, in one pass; returns whether the written values are finite.
#[inline]
pub(crate) fn recover<T: Scalar>(weights: [T; 3], d: &[T], motion: [&mut [T]; 3], a: Accumulate) -> bool {
    Arch::new().dispatch(Recover(weights, d, motion, a))
}

/// Σ x y of several x of one length, in one pass.
#[inline]
pub(crate) fn products<T: Scalar, const N: usize>(x: [&[T]; N], y: &[T]) -> [T; N] {
    Arch::new().dispatch(Products(x, y))
}

/// `out += Σ c x` of several x of one length, in one pass.
#[inline]
pub(crate) fn add_all<T: Scalar, const N: usize>(c: [T; N], x: [&[T]; N], out: &mut [T]) {
    Arch::new().dispatch(AddAll(c, x, out));
}

struct Products<'a, T, const N: usize>([&'a [T]; N], &'a [T]);

impl<T: Scalar, const N: usize> WithSimd for Products<'_, T, N> {
    type Output = [T; N];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [T; N] {
        let Self(x, y) = self;
        let x = x.map(|x| &x[..y.len()]);
        let whole = y.len() - y.len() % LANES;
        let mut sums = [[T::zero(); LANES]; N];
        for start in (0..whole).step_by(LANES) {
            let y = &y[start..start + LANES];
            for (sums, x) in sums.iter_mut().zip(x) {
                let x = &x[start..start + LANES];
                for lane in 0..LANES {
                    sums[lane] += x[lane] * y[lane];
                }
            }
        }
        std::array::from_fn(|k| {
            let rest = x[k][whole..].iter().zip(&y[whole..]).map(|(&x, &y)| x * y).sum::<T>();
            sums[k].into_iter().sum::<T>() + rest
        })
    }
}

struct AddAll<'a, T, const N: usize>([T; N], [&'a [T]; N], &'a mut [T]);

impl<T: Scalar, const N: usize> WithSimd for AddAll<'_, T, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(c, x, out) = self;
        let x = x.map(|x| &x[..out.len()]);
        for (i, out) in out.iter_mut().enumerate() {
            for k in 0..N {
                *out += c[k] * x[k][i];
            }
        }
    }
}

struct Combine<'a, T>(&'a [(T, &'a [T])], &'a [(T, &'a [T])], &'a [T], &'a mut [T]);

impl<T: Scalar> WithSimd for Combine<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        combine_loop(self.0, self.1, self.2, self.3);
    }
}

struct Recover<'a, T>([T; 3], &'a [T], [&'a mut [T]; 3], Accumulate);

impl<T: Scalar> WithSimd for Recover<'_, T> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        recover_blocks(self.0, self.1, self.2, self.3)
    }
}

/// Partial sums: in a single sum each addition would wait for the one before.
const LANES: usize = 8;

/// Σ 0 x: zero if every x is finite, NaN otherwise. An early exit would not vectorize.
#[inline(always)]
pub(crate) fn all_finite<T: Scalar>(x: &[T]) -> bool {
    let mut sums = [T::zero(); LANES];
    let chunks = x.chunks_exact(LANES);
    let rest: T = chunks.remainder().iter().map(|&x| x * T::zero()).sum();
    for chunk in chunks {
        for (sum, &x) in sums.iter_mut().zip(chunk) {
            *sum += x * T::zero();
        }
    }
    sums.into_iter().sum::<T>() + rest == T::zero()
}

/// The largest |x|; NaN is ignored.
#[inline(always)]
pub(crate) fn largest<T: Scalar>(x: &[T]) -> T {
    let mut most = [T::zero(); LANES];
    let chunks = x.chunks_exact(LANES);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (most, &x) in most.iter_mut().zip(chunk) {
            *most = if x.abs() > *most { x.abs() } else { *most };
        }
    }
    most.iter().chain(rest).fold(T::zero(), |most, x| most.max(x.abs()))
}

/// The same for several vectors of one length, in one pass.
#[inline(always)]
fn all_finite_together<T: Scalar, const N: usize>(x: [&[T]; N]) -> bool {
    let n = x.first().map_or(0, |x| x.len());
    let x = x.map(|x| &x[..n]);
    let whole = n - n % LANES;
    let mut sums = [T::zero(); LANES];
    for start in (0..whole).step_by(LANES) {
        let lanes: [&[T]; N] = x.map(|x| &x[start..start + LANES]);
        for (lane, sum) in sums.iter_mut().enumerate() {
            for x in lanes {
                *sum += x[lane] * T::zero();
            }
        }
    }
    x.iter().all(|x| x[whole..].iter().all(|x| x.is_finite())) && sums.into_iter().sum::<T>() == T::zero()
}

#[inline(always)]
fn combine_loop<T: Scalar>(terms: &[(T, &[T])], differences: &[(T, &[T])], y: &[T], out: &mut [T]) {
    /// P terms and D differences; all slices are cut to one length, so that no access is checked.
    #[inline(always)]
    fn fused<T: Scalar, const P: usize, const D: usize>(
        terms: &[(T, &[T])],
        differences: &[(T, &[T])],
        y: &[T],
        out: &mut [T],
    ) {
        let n = out.len();
        let (y, x): (&[T], [&[T]; P]) = (&y[..n], std::array::from_fn(|k| &terms[k].1[..n]));
        let d: [&[T]; D] = std::array::from_fn(|k| &differences[k].1[..n]);
        let (c, e) =
            (std::array::from_fn::<T, P, _>(|k| terms[k].0), std::array::from_fn::<T, D, _>(|k| differences[k].0));
        for (i, out) in out.iter_mut().enumerate() {
            let mut sum = if P > 0 { c[0] * x[0][i] } else { T::zero() };
            for k in 1..P {
                sum += c[k] * x[k][i];
            }
            for k in 0..D {
                sum += e[k] * (d[k][i] - y[i]);
            }
            *out = sum;
        }
    }
    match (terms.len(), differences.len()) {
        (0, 0) => {}
        (1, 0) => fused::<T, 1, 0>(terms, differences, y, out),
        (2, 0) => fused::<T, 2, 0>(terms, differences, y, out),
        (3, 0) => fused::<T, 3, 0>(terms, differences, y, out),
        (4, 0) => fused::<T, 4, 0>(terms, differences, y, out),
        (0, 1) => fused::<T, 0, 1>(terms, differences, y, out),
        (1, 1) => fused::<T, 1, 1>(terms, differences, y, out),
        (2, 1) => fused::<T, 2, 1>(terms, differences, y, out),
        (3, 1) => fused::<T, 3, 1>(terms, differences, y, out),
        (0, 2) => fused::<T, 0, 2>(terms, differences, y, out),
        (1, 2) => fused::<T, 1, 2>(terms, differences, y, out),
        (2, 2) => fused::<T, 2, 2>(terms, differences, y, out),
        (1, 3) => fused::<T, 1, 3>(terms, differences, y, out),
        _ => {
            out.fill(T::zero());
            for (c, x) in terms {
                for (out, &x) in out.iter_mut().zip(*x) {
                    *out += *c * x;
                }
            }
            for (c, x) in differences {
                for ((out, &x), &y) in out.iter_mut().zip(*x).zip(y) {
                    *out += *c * (x - y);
                }
            }
        }
    }
}

#[inline(always)]
fn recover_blocks<T: Scalar>(weights: [T; 3], d: &[T], motion: [&mut [T]; 3], accumulate: Accumulate) -> bool {
    /// Entries in a block: they stay in the first-level cache until they have been checked.
    const BLOCK: usize = 512;
    /// `MOVES`: u is updated too. `ADDS`: a is added to, not replaced.
    #[inline(always)]
    fn pass<T: Scalar, const MOVES: bool, const ADDS: bool>(w: [T; 3], d: &[T], [u, v, a]: [&mut [T]; 3]) -> bool {
        let n = d.len();
        let (u, v, a) = (&mut u[..n], &mut v[..n], &mut a[..n]);
        for i in 0..n {
            if MOVES {
                u[i] += w[0] * d[i];
            }
            v[i] += w[1] * d[i];
            a[i] = if ADDS { a[i] + w[2] * d[i] } else { w[2] * d[i] };
        }
        // A d that is not finite makes a not finite either.
        match MOVES {
            true => all_finite_together([u, v, a]),
            false => all_finite_together([v, a]),
        }
    }
    let [u, v, a] = motion;
    let mut finite = true;
    for (k, d) in d.chunks(BLOCK).enumerate() {
        let part = k * BLOCK..k * BLOCK + d.len();
        let motion = [&mut u[part.clone()], &mut v[part.clone()], &mut a[part]];
        // The displacements of explicit schemes do not contain d.
        finite &= match (weights[0] != T::zero(), accumulate) {
            (true, Accumulate::Replace) => pass::<T, true, false>(weights, d, motion),
            (true, Accumulate::Add) => pass::<T, true, true>(weights, d, motion),
            (false, Accumulate::Replace) => pass::<T, false, false>(weights, d, motion),
            (false, Accumulate::Add) => pass::<T, false, true>(weights, d, motion),
        };
    }
    finite
}

#[cfg(test)]
mod tests {
    use super::{Accumulate, recover};

    /// The blocks of a recovery give bitwise the same as one loop, and detect non-finite values in any of them.
    #[test]
    fn recovery_in_blocks_is_one_loop() {
        let vector = |seed: usize, n: usize| -> Vec<f64> { (0..n).map(|i| ((seed + 5 * i) as f64).sin()).collect() };
        for n in [0, 1, 7, 511, 512, 513, 1700] {
            for (w, accumulate) in [
                ([1.0, 0.3, 0.7], Accumulate::Replace),
                ([0.2, 0.3, 0.7], Accumulate::Add),
                ([0.0, 0.3, 0.7], Accumulate::Replace),
                ([0.0, 0.3, 0.7], Accumulate::Add),
            ] {
                let d = vector(1, n);
                let [mut u, mut v, mut a] = [2, 3, 4].map(|seed| vector(seed, n));
                assert!(recover(w, &d, [&mut u, &mut v, &mut a], accumulate));
                let [u0, v0, a0] = [2, 3, 4].map(|seed| vector(seed, n));
                for i in 0..n {
                    let past = if accumulate == Accumulate::Add { a0[i] } else { 0.0 };
                    assert_eq!(u[i].to_bits(), (u0[i] + w[0] * d[i]).to_bits());
                    assert_eq!(v[i].to_bits(), (v0[i] + w[1] * d[i]).to_bits());
                    assert_eq!(a[i].to_bits(), (past + w[2] * d[i]).to_bits());
                }
                for bad in (0..n).step_by(97) {
                    let mut d = d.clone();
                    d[bad] = if bad % 2 == 0 { f64::NAN } else { f64::INFINITY };
                    assert!(!recover(w, &d, [&mut u, &mut v, &mut a], accumulate));
                }
            }
        }
    }
}
