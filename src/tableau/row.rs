//! Rows and their arithmetic.

use crate::rounding::rounding;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// How many past states a row may read.
pub const MAX_PAST: usize = 4;

/// An affine row over the unknown z and the past states; see the [module](super).
///
/// Rows are written with the constants [`Z`], [`U`], [`V`], [`A`] and arithmetic:
///
/// ```
/// use contact_dynamics::tableau::{U, Z};
/// let velocity = 1.5 * Z - 2.0 * U[0] + 0.5 * U[1]; // h v of the three-point backward difference
/// assert_eq!(velocity.z, 1.5);
/// assert_eq!(velocity.u[1], 0.5);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Weight of the unknown.
    pub z: f64,
    /// Coefficients of `U_k`.
    pub u: [f64; MAX_PAST],
    /// Coefficients of `V_k = h v_k`.
    pub v: [f64; MAX_PAST],
    /// Coefficients of `A_k = h² a_k`.
    pub a: [f64; MAX_PAST],
}

/// The row of the unknown itself.
pub const Z: Row = Row { z: 1.0, u: [0.0; MAX_PAST], v: [0.0; MAX_PAST], a: [0.0; MAX_PAST] };
/// The rows of the past displacements, newest first.
pub const U: [Row; MAX_PAST] = past(0);
/// The rows of the past velocities times h, newest first.
pub const V: [Row; MAX_PAST] = past(1);
/// The rows of the past accelerations times h², newest first.
pub const A: [Row; MAX_PAST] = past(2);

const fn past(field: usize) -> [Row; MAX_PAST] {
    let zero = Row { z: 0.0, u: [0.0; MAX_PAST], v: [0.0; MAX_PAST], a: [0.0; MAX_PAST] };
    let mut rows = [zero; MAX_PAST];
    let mut k = 0;
    while k < MAX_PAST {
        match field {
            0 => rows[k].u[k] = 1.0,
            1 => rows[k].v[k] = 1.0,
            _ => rows[k].a[k] = 1.0,
        }
        k += 1;
    }
    rows
}

impl Row {
    /// Combines two rows coefficient by coefficient.
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let each = |x: [f64; MAX_PAST], y: [f64; MAX_PAST]| std::array::from_fn(|k| f(x[k], y[k]));
        Self { z: f(self.z, other.z), u: each(self.u, other.u), v: each(self.v, other.v), a: each(self.a, other.a) }
    }

    /// Coefficients of past state `k`: (u, h v, h² a); zero for states older than any row can read.
    pub fn past(&self, k: usize) -> [f64; 3] {
        match k < MAX_PAST {
            true => [self.u[k], self.v[k], self.a[k]],
            false => [0.0; 3],
        }
    }

    /// One more than the index of the oldest past state read, 0 if none is read.
    pub fn depth(&self) -> usize {
        (0..MAX_PAST).rev().find(|&k| self.past(k).iter().any(|&c| c != 0.0)).map_or(0, |k| k + 1)
    }

    pub(super) fn is_finite(&self) -> bool {
        self.z.is_finite() && (0..MAX_PAST).all(|k| self.past(k).iter().all(|c| c.is_finite()))
    }

    /// The row with its z expressed by d = z − ẑ, where ẑ makes `zero` vanish; terms that cancel to rounding become
    /// zero.
    fn increment(self, zero: Self) -> Self {
        let factor = self.z / zero.z;
        let cancel = |x: f64, y: f64| {
            let (y, difference) = (factor * y, x - factor * y);
            if difference.abs() <= rounding(x.abs().max(y.abs())) { 0.0 } else { difference }
        };
        Self { z: self.z, ..self.zip(zero, cancel) }
    }
}

impl Add for Row {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.zip(other, |x, y| x + y)
    }
}

impl Sub for Row {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.zip(other, |x, y| x - y)
    }
}

impl Neg for Row {
    type Output = Self;
    fn neg(self) -> Self {
        -1.0 * self
    }
}

impl Mul<Row> for f64 {
    type Output = Row;
    fn mul(self, row: Row) -> Row {
        row.zip(row, |x, _| self * x)
    }
}

impl Div<f64> for Row {
    type Output = Self;
    fn div(self, divisor: f64) -> Self {
        self.zip(self, |x, _| x / divisor)
    }
}

/// A triple of rows for u, h v and h² a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows {
    /// Displacement.
    pub u: Row,
    /// Velocity times h.
    pub v: Row,
    /// Acceleration times h².
    pub a: Row,
}

impl Rows {
    /// The three rows in the order u, h v, h² a.
    pub fn each(&self) -> [Row; 3] {
        [self.u, self.v, self.a]
    }

    pub(super) fn increment(self, zero: Row) -> Self {
        Self { u: self.u.increment(zero), v: self.v.increment(zero), a: self.a.increment(zero) }
    }
}
