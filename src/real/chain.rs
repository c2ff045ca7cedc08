//! Recurrences of L D Lᵀ with bidiagonal L, down and up two chains at a time.
//!
//! In a chain each unknown waits for its neighbor, longer than its arithmetic takes. Two chains wait at the same time.

use super::Real;

/// Of two chains: the entries of L below the diagonal (one for each unknown, the last one to what comes behind), 1/D, and
/// the unknowns. All slices of a chain are of one length.
#[derive(Debug)]
pub struct Chains<'a, T> {
    pub lower: [&'a [T]; 2],
    pub inverse: [&'a [T]; 2],
    pub x: [&'a mut [T]; 2],
}

/// `x_k −= l_{k−1} x_{k−1}` down both chains.
#[inline]
pub(super) fn forward<T: Real>(Chains { lower, x: [x0, x1], .. }: Chains<'_, T>) {
    let common = x0.len().min(x1.len());
    let [(l0, rest_l0), (l1, rest_l1)] = lower.map(|l| l.split_at(common));
    let ((x0, rest_x0), (x1, rest_x1)) = (x0.split_at_mut(common), x1.split_at_mut(common));
    let (mut above0, mut above1) = (T::zero(), T::zero());
    for ((x0, &l0), (x1, &l1)) in x0.iter_mut().zip(l0).zip(x1.iter_mut().zip(l1)) {
        *x0 -= above0;
        *x1 -= above1;
        (above0, above1) = (l0 * *x0, l1 * *x1);
    }
    for (x, l, mut above) in [(rest_x0, rest_l0, above0), (rest_x1, rest_l1, above1)] {
        for (x, &l) in x.iter_mut().zip(l) {
            *x -= above;
            above = l * *x;
        }
    }
}

/// `x_k = x_k / d_k − l_k x_{k+1}` up both chains, from the unknowns `behind` them.
#[inline]
pub(super) fn backward<T: Real>(Chains { lower, inverse, x: [x0, x1] }: Chains<'_, T>, behind: [T; 2]) {
    // What the one has more than the other lies at its front.
    let common = x0.len().min(x1.len());
    let (front0, front1) = (x0.len() - common, x1.len() - common);
    let ((rest_x0, x0), (rest_x1, x1)) = (x0.split_at_mut(front0), x1.split_at_mut(front1));
    let ((rest_l0, l0), (rest_l1, l1)) = (lower[0].split_at(front0), lower[1].split_at(front1));
    let ((rest_d0, d0), (rest_d1, d1)) = (inverse[0].split_at(front0), inverse[1].split_at(front1));
    let [mut behind0, mut behind1] = behind;
    let first = x0.iter_mut().zip(l0.iter().zip(d0)).rev();
    let second = x1.iter_mut().zip(l1.iter().zip(d1)).rev();
    for ((x0, (&l0, &d0)), (x1, (&l1, &d1))) in first.zip(second) {
        behind0 = *x0 * d0 - l0 * behind0;
        behind1 = *x1 * d1 - l1 * behind1;
        (*x0, *x1) = (behind0, behind1);
    }
    for (x, l, d, mut behind) in [(rest_x0, rest_l0, rest_d0, behind0), (rest_x1, rest_l1, rest_d1, behind1)] {
        for (x, (&l, &d)) in x.iter_mut().zip(l.iter().zip(d)).rev() {
            behind = *x * d - l * behind;
            *x = behind;
        }
    }
}
