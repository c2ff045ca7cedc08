//! Past states computed from a motion: a straight line, or Taylor's expansion.

use crate::real::Real;
use crate::state::Motion;

/// Fills past states 1, 2, … with u − k h v, v, 0.
pub(crate) fn straight_past<T: Real>(motion: &Motion<T>, h: f64, past: &mut [Motion<T>]) {
    for (k, slot) in (1_u32..).zip(past) {
        let back = f64::from(k) * h;
        slot.t = motion.t - back;
        slot.u.copy_from_slice(&motion.u);
        T::axpy(T::of(-back), &motion.v, &mut slot.u);
        slot.v.copy_from_slice(&motion.v);
        slot.a.fill(T::zero());
    }
}

/// Fills past states 1, 2, … with Taylor's expansion of a motion.
pub(crate) fn taylor_past<T: Real>(motion: &Motion<T>, h: f64, past: &mut [Motion<T>]) {
    for (k, slot) in (1_u32..).zip(past) {
        taylor(motion, -f64::from(k) * h, slot);
    }
}

/// u + τ v + ½ τ² a, v + τ a, a.
pub(crate) fn taylor<T: Real>(motion: &Motion<T>, tau: f64, out: &mut Motion<T>) {
    out.t = motion.t + tau;
    out.u.copy_from_slice(&motion.u);
    T::axpy(T::of(tau), &motion.v, &mut out.u);
    T::axpy(T::of(0.5 * tau * tau), &motion.a, &mut out.u);
    out.v.copy_from_slice(&motion.v);
    T::axpy(T::of(tau), &motion.a, &mut out.v);
    out.a.copy_from_slice(&motion.a);
}
