//! Recurrences of L D Lᵀ with bidiagonal L, forward and backward along two chains at a time.
//!
//! In a chain each unknown waits for its neighbor, longer than its arithmetic takes. Two chains processed together
//! share the wait, and fused multiply-add, if the machine has it, halves it.
#![allow(clippy::inline_always)] // only inlined code is compiled for the vector units

use crate::scalar::Scalar;
use faer::traits::pulp::{Arch, Simd, WithSimd};

/// Two chains: the entries of L below the diagonal (one for each unknown; the last one couples it to the unknown
/// after the chain), 1/D, and the unknowns. All slices of a chain have the same length.
#[derive(Debug)]
pub struct Chains<'a, T> {
    pub lower: [&'a [T]; 2],
    pub inverse: [&'a [T]; 2],
    pub x: [&'a mut [T]; 2],
}

/// `x_k −= l_{k−1} x_{k−1}` forward along both chains.
pub(crate) fn forward<T: Scalar>(chains: Chains<'_, T>) {
    match fuses() {
        true => Arch::new().dispatch(Down(chains)),
        false => down(chains, |x, l, y| x - l * y),
    }
}

/// `x_k = x_k / d_k − l_k x_{k+1}` backward along both chains, from the unknowns `behind` them.
pub(crate) fn backward<T: Scalar>(chains: Chains<'_, T>, behind: [T; 2]) {
    match fuses() {
        true => Arch::new().dispatch(Up(chains, behind)),
        false => up(chains, behind, |x, l, y| x - l * y),
    }
}

/// Whether the machine has fused multiply-add: in software it would take a hundred times as long.
fn fuses() -> bool {
    cfg!(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64"))
        && !matches!(Arch::new(), Arch::Scalar)
}

struct Down<'a, T>(Chains<'a, T>);

impl<T: Scalar> WithSimd for Down<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        down(self.0, |x, l, y| T::mul_add(-l, y, x));
    }
}

struct Up<'a, T>(Chains<'a, T>, [T; 2]);

impl<T: Scalar> WithSimd for Up<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        up(self.0, self.1, |x, l, y| T::mul_add(-l, y, x));
    }
}

/// `eliminate(x, l, y)` is x − l y.
#[inline(always)]
fn down<T: Scalar>(Chains { lower, x: [x0, x1], .. }: Chains<'_, T>, eliminate: impl Fn(T, T, T) -> T) {
    let common = x0.len().min(x1.len());
    let [(l0, rest_l0), (l1, rest_l1)] = lower.map(|l| l.split_at(common));
    let ((x0, rest_x0), (x1, rest_x1)) = (x0.split_at_mut(common), x1.split_at_mut(common));
    // Kept in registers: a round trip through memory takes longer than the arithmetic.
    let [mut l_above0, mut l_above1, mut above0, mut above1] = [T::zero(); 4];
    for ((x0, &l0), (x1, &l1)) in x0.iter_mut().zip(l0).zip(x1.iter_mut().zip(l1)) {
        above0 = eliminate(*x0, l_above0, above0);
        above1 = eliminate(*x1, l_above1, above1);
        (*x0, *x1) = (above0, above1);
        (l_above0, l_above1) = (l0, l1);
    }
    for (x, l, mut l_above, mut above) in [(rest_x0, rest_l0, l_above0, above0), (rest_x1, rest_l1, l_above1, above1)] {
        for (x, &l) in x.iter_mut().zip(l) {
            above = eliminate(*x, l_above, above);
            *x = above;
            l_above = l;
        }
    }
}

#[inline(always)]
fn up<T: Scalar>(
    Chains { lower, inverse, x: [x0, x1] }: Chains<'_, T>,
    behind: [T; 2],
    eliminate: impl Fn(T, T, T) -> T,
) {
    // The longer chain starts with the unknowns that the other lacks.
    let common = x0.len().min(x1.len());
    let (front0, front1) = (x0.len() - common, x1.len() - common);
    let ((rest_x0, x0), (rest_x1, x1)) = (x0.split_at_mut(front0), x1.split_at_mut(front1));
    let ((rest_l0, l0), (rest_l1, l1)) = (lower[0].split_at(front0), lower[1].split_at(front1));
    let ((rest_d0, d0), (rest_d1, d1)) = (inverse[0].split_at(front0), inverse[1].split_at(front1));
    let [mut behind0, mut behind1] = behind;
    let first = x0.iter_mut().zip(l0.iter().zip(d0)).rev();
    let second = x1.iter_mut().zip(l1.iter().zip(d1)).rev();
    for ((x0, (&l0, &d0)), (x1, (&l1, &d1))) in first.zip(second) {
        behind0 = eliminate(*x0 * d0, l0, behind0);
        behind1 = eliminate(*x1 * d1, l1, behind1);
        (*x0, *x1) = (behind0, behind1);
    }
    for (x, l, d, mut behind) in [(rest_x0, rest_l0, rest_d0, behind0), (rest_x1, rest_l1, rest_d1, behind1)] {
        for (x, (&l, &d)) in x.iter_mut().zip(l.iter().zip(d)).rev() {
            behind = eliminate(*x * d, l, behind);
            *x = behind;
        }
    }
}
