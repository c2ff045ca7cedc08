//! Exact solution of one contact with friction: a block of a normal row and one or two tangential rows.

use crate::real::Real;
use crate::rounding::rounding;

/// A block W r + b of a contact, with its friction coefficient; blocks of two rows are padded to three.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone<T> {
    /// W of the block, row by row: the normal row first.
    pub(super) delassus: [[T; 3]; 3],
    /// y of the block at r = 0.
    pub(super) offset: [T; 3],
    pub(super) friction: T,
    /// 1 or 2.
    pub(super) tangents: usize,
    /// Rounding of the tangential offset.
    pub(super) noise: T,
    /// The present friction; if the contact keeps sliding, the solution is near.
    pub(super) guess: [T; 2],
}

/// Limit of steps of the search for the slip direction, which takes three or four.
const STEPS: usize = 200;

impl<T: Real> Cone<T> {
    /// The multipliers (p, f) with 0 ≤ y_n ⊥ p ≥ 0, |f| ≤ μ p, and y_t = −γ f with γ ≥ 0 where |f| = μ p.
    ///
    /// A block that is open without forces stays open, though with a large μ it might stick as well. Otherwise it
    /// sticks if the multipliers that hold it are in the cone. Otherwise it slides: with the normal multiplier
    /// eliminated, y_t = −γ f is (S + γ) f = −c, and |f(γ)| − μ p(γ) is positive at γ = 0 and negative for large γ,
    /// so it has a root.
    pub(super) fn solve(&self) -> [T; 3] {
        let Self { delassus: w, offset: b, friction, tangents, noise, guess } = *self;
        if w[0][0] <= T::zero() || b[0] >= T::zero() {
            return [T::zero(); 3];
        }
        let normal = |f: [T; 2]| -(b[0] + w[0][1] * f[0] + w[0][2] * f[1]) / w[0][0];
        if friction <= T::zero() {
            return [normal([T::zero(); 2]), T::zero(), T::zero()];
        }
        let (schur, c) = self.without_normal();
        let beyond = |f: [T; 2]| norm(f) - friction * normal(f);
        if let Some(held) = hold(schur, c, noise).filter(|&held| beyond(held) <= T::zero()) {
            return [normal(held), held[0], held[1]];
        }
        if c == [T::zero(); 2] {
            return [normal([T::zero(); 2]), T::zero(), T::zero()];
        }
        let direction = if tangents == 1 {
            [-c[0].signum(), T::zero()]
        } else {
            let change = |f: [T; 2]| -(w[0][1] * f[0] + w[0][2] * f[1]) / w[0][0];
            slip_direction(schur, c, guess, [&|f| friction * normal(f), &|f| friction * change(f)])
        };
        // In this direction the block is on the boundary of its cone, and its gap is zero, to rounding.
        let along = w[0][1] * direction[0] + w[0][2] * direction[1];
        let p = -b[0] / (w[0][0] + friction * along);
        [p, friction * p * direction[0], friction * p * direction[1]]
    }

    /// The tangential rows without the normal multiplier: S f + c.
    fn without_normal(&self) -> ([[T; 2]; 2], [T; 2]) {
        let Self { delassus: w, offset: b, tangents, .. } = *self;
        let without = |i: usize, x: T, over: T| x - w[i][0] / w[0][0] * over;
        let s = |i: usize, j: usize| without(i, w[i][j], w[0][j]);
        let c = [without(1, b[1], b[0]), if tangents > 1 { without(2, b[2], b[0]) } else { T::zero() }];
        let schur = match tangents {
            // The second direction is unloaded and as compliant as the first.
            1 => [[s(1, 1), T::zero()], [T::zero(), s(1, 1)]],
            _ => [[s(1, 1), s(1, 2)], [s(2, 1), s(2, 2)]],
        };
        (schur, c)
    }

    /// Whether the block provably has no solution (Painlevé), up to rounding: neither sticking nor sliding.
    ///
    /// If S is definite there is a solution. Otherwise S = s e eᵀ, and c has a part k d, with the unit vector d ⊥ e,
    /// that no friction stops. For sliding f(γ) = −k d/γ − c_e e/(s + γ), and |f| − μ p ≤ −A/γ + B/(s + γ) − C with A
    /// = −k (1 − μ w·d/W_nn), B = |c_e| − μ (w·e) c_e/W_nn, C = −μ b_n/W_nn and w = W_nt. The maximum of this bound
    /// over γ is −C if B ≤ A, otherwise (√B − √A)²/s − C.
    pub(super) fn jams(&self) -> bool {
        let Self { delassus: w, offset: b, friction, noise, .. } = *self;
        if w[0][0] <= T::zero() || b[0] >= T::zero() {
            return false;
        }
        let ([[xx, xy], [yx, yy]], c) = self.without_normal();
        let tiny = rounding(T::one());
        let (trace, scale) = (xx + yy, w[1][1] + w[2][2]);
        if xx * yy - xy * yx > tiny * trace * scale {
            return false;
        }
        let column = if xx >= yy { [xx, yx] } else { [xy, yy] };
        let is_zero = trace <= T::of(4.0) * tiny * scale;
        let (s, e) = if is_zero { (T::zero(), [T::zero(); 2]) } else { (trace, column.map(|x| x / norm(column))) };
        let along = |x: [T; 2]| x[0] * e[0] + x[1] * e[1];
        let across = [c[0] - along(c) * e[0], c[1] - along(c) * e[1]];
        let k = norm(across);
        if k <= noise + tiny * norm(c) {
            return false;
        }
        let coupled = [w[0][1], w[0][2]].map(|own| friction * own / w[0][0]);
        let a = coupled[0] * across[0] + coupled[1] * across[1] - k;
        let b = along(c).abs() - along(coupled) * along(c);
        let rest = -friction * self.offset[0] / w[0][0];
        a > T::zero() && (b <= a || (b.sqrt() - a.sqrt()).powi(2) < rest * s)
    }
}

/// Solves S f = −c, with the least f if S is singular; `None` if no f solves it within rounding.
fn hold<T: Real>(s: [[T; 2]; 2], c: [T; 2], noise: T) -> Option<[T; 2]> {
    let tiny = rounding(T::one());
    let (trace, determinant) = (s[0][0] + s[1][1], s[0][0] * s[1][1] - s[0][1] * s[1][0]);
    if determinant > tiny * trace * trace {
        return Some(solve_two(s, T::zero(), c)).filter(|f| f.iter().all(|f| f.is_finite()));
    }
    // S = trace e eᵀ, with e along the larger column.
    let column = if s[0][0] >= s[1][1] { [s[0][0], s[1][0]] } else { [s[0][1], s[1][1]] };
    let size = norm(column);
    let e = if size > T::zero() { column.map(|x| x / size) } else { column };
    let along = e[0] * c[0] + e[1] * c[1];
    let across = norm([c[0] - along * e[0], c[1] - along * e[1]]);
    let held = if trace > T::zero() { e.map(|e| -along / trace * e) } else { [T::zero(); 2] };
    (across <= noise + tiny * norm(c)).then_some(held)
}

/// The friction direction of a block sliding in a plane: the direction of f(γ) = −(S + γ)⁻¹ c at the γ with |f| = μ
/// p. Since |f| is nearly proportional to 1/(S + γ), the quotient μ p/|f| is nearly linear in γ, and Newton's method
/// on it takes a few steps from any start; the steps are kept in the interval that contains the solution.
///
/// μ p and its derivative are given as functions of f. A finite difference would be lost in the rounding of μ p(0) if
/// W is large in the units of the run.
fn slip_direction<T: Real>(
    schur: [[T; 2]; 2],
    c: [T; 2],
    guess: [T; 2],
    [bound, change]: [&dyn Fn([T; 2]) -> T; 2],
) -> [T; 2] {
    let (two, size) = (T::of(2.0), (schur[0][0] + schur[1][1]).abs());
    if size == T::zero() {
        // Friction does not change the slip, as for dofs without mass; it is opposed to the slip.
        let length = norm(c);
        return c.map(|c| -c / length);
    }
    let (mut low, mut high) = (T::zero(), T::infinity());
    // For the solution g, the slip S g + c equals −γ g; applied to the guess this estimates γ.
    let length = norm(guess);
    let guess = guess.map(|f| f / length);
    let along = |k: usize| guess[k] * (schur[k][0] * guess[0] + schur[k][1] * guess[1] + c[k] / length);
    let gamma = -(along(0) + along(1));
    let mut gamma = if gamma > T::zero() && gamma.is_finite() { gamma } else { T::zero() };
    let mut f = solve_two(schur, gamma, c);
    for _ in 0..STEPS {
        let (length, radius) = (norm(f), bound(f));
        // If S is singular, f(0) is NaN or unbounded.
        if length < radius {
            high = gamma;
        } else {
            low = gamma;
        }
        // d f/d γ = −(S + γ)⁻¹ f, computed relative to |f|: for a nearly singular S, |f|² may overflow in `f32`.
        let (share, unit) = (radius / length, f.map(|f| f / length));
        let slope = solve_two(schur, gamma, unit);
        let step = (T::one() - share) / (change(slope) - share * (unit[0] * slope[0] + unit[1] * slope[1]));
        let next = gamma + step;
        // NaN fails the interval test.
        let next = if next >= low && next <= high && next.is_finite() {
            next
        } else if high.is_finite() {
            low + (high - low) / two
        } else {
            two * two * low.max(size)
        };
        let moved = (next - gamma).abs();
        gamma = next;
        f = solve_two(schur, gamma, c);
        if moved <= rounding(gamma + size) {
            break;
        }
    }
    let length = norm(f);
    match length > T::zero() && length.is_finite() {
        true => f.map(|f| f / length),
        false => [T::zero(); 2],
    }
}

/// The length of a vector in any unit. The library's `hypot` takes longer than the rest of a block.
pub(super) fn norm<T: Real>([x, y]: [T; 2]) -> T {
    let (x, y) = (x.abs(), y.abs());
    let (most, least) = if x > y { (x, y) } else { (y, x) };
    if most > T::zero() && most.is_finite() {
        let share = least / most;
        most * (T::one() + share * share).sqrt()
    } else {
        x + y
    }
}

/// (S + γ) f = −c.
fn solve_two<T: Real>(s: [[T; 2]; 2], gamma: T, c: [T; 2]) -> [T; 2] {
    let [[a, b], [d, e]] = [[s[0][0] + gamma, s[0][1]], [s[1][0], s[1][1] + gamma]];
    let determinant = a * e - b * d;
    [(b * c[1] - e * c[0]) / determinant, (d * c[0] - a * c[1]) / determinant]
}

#[cfg(test)]
mod tests {
    use super::norm;

    #[test]
    fn lengths_are_those_of_any_numbers() {
        for (x, y, length) in [(3.0, 4.0, 5.0), (-4.0, 3.0, 5.0), (0.0, -2.0, 2.0), (0.0, 0.0, 0.0)] {
            for unit in [1.0, 2.0_f64.powi(600), 2.0_f64.powi(-600)] {
                assert!((norm([x * unit, y * unit]) - length * unit).abs() <= 1e-15 * length * unit, "{x} {y} {unit}");
            }
        }
        // The squares of these numbers and of their quotient overflow or underflow.
        for (large, small) in [(1e200_f64, 1e-200), (-1e300, 1e-5)] {
            assert!([norm([large, small]), norm([small, large])].iter().all(|x| (x / large.abs() - 1.0).abs() < 1e-15));
        }
        assert!(norm([f64::INFINITY, 1.0]) > f64::MAX && norm([f64::NAN, 1.0]).is_nan());
    }
}
