//! Anderson mixing of linearizations of curved rows that converge slowly, or cycle around a solution: the next
//! linearization is at a combination of the last iterates.
//!
//! Rows are linearized at d, and the contact problem solved with them has the result r(d). Rows turn with d, and so
//! do forces, whose change the problem does not contain. So the iteration approaches the fixed point r(d) = d by a
//! factor only, which may be nearly one, or below minus one. Anderson's mixing (J. ACM 12, 1965; Walker and Ni, SIAM
//! J. Numer. Anal. 49, 2011) takes the combination of the last iterates in which r − d is least, if it is linear in
//! d.

use crate::real::Real;

/// Number of differences of iterates that are mixed.
const DEPTH: usize = 4;

/// A difference is rounding if its component orthogonal to newer differences is below this share of it.
const LEFT: f64 = 1e-6;

/// The largest distance from the result of an iteration to the next linearization, over the distance from its own
/// linearization to the result: a convergence factor of 0.99 or of 1.01 needs a hundred.
const FARTHEST: f64 = 1e3;

/// Mixing may move the result of the unmixed iterations by this share of their displacement by contact if the step
/// can be halved. Fixed points of the same solution are nearly all within a hundredth.
pub(crate) const ELSEWHERE: f64 = 0.5;

/// A difference of two iterations: of r − d, and of r.
struct Difference<T> {
    misses: Vec<T>,
    results: Vec<T>,
}

/// Memory for mixing.
pub(crate) struct Mixing<T> {
    /// Where the rows of the next iteration are linearized.
    from: Vec<T>,
    /// The last iteration itself.
    last: Difference<T>,
    /// The result of the iterations before mixing.
    unmixed: Vec<T>,
    /// Differences of earlier iterations, the newest first, and their components orthogonal to newer differences.
    differences: [Difference<T>; DEPTH],
    apart: [Difference<T>; DEPTH],
    known: usize,
    begun: bool,
}

impl<T: Real> Difference<T> {
    fn new(size: usize) -> Self {
        Self { misses: Vec::with_capacity(size), results: Vec::with_capacity(size) }
    }
}

impl<T: Real> Mixing<T> {
    /// For `size` dofs.
    pub(crate) fn new(size: usize) -> Self {
        let differences = || std::array::from_fn(|_| Difference::new(size));
        Self {
            from: Vec::with_capacity(size),
            last: Difference::new(size),
            unmixed: Vec::with_capacity(size),
            differences: differences(),
            apart: differences(),
            known: 0,
            begun: false,
        }
    }

    /// Begins with the result of unmixed iterations.
    pub(crate) fn begin(&mut self, result: &[T]) {
        self.forget();
        self.unmixed.clear();
        self.unmixed.extend_from_slice(result);
    }

    /// Forgets all iterations.
    fn forget(&mut self) {
        (self.known, self.begun) = (0, false);
    }

    /// The distance of d from the result of the unmixed iterations, over the distance of that result from `free`.
    /// Returned if it exceeds [`ELSEWHERE`], which indicates another solution.
    pub(crate) fn elsewhere(&self, d: &[T], free: &[T]) -> Option<f64> {
        let share = (square_of_way(d, &self.unmixed) / square_of_way(&self.unmixed, free)).sqrt();
        (share > ELSEWHERE).then_some(share)
    }

    /// Stores where the rows of the next iteration are linearized.
    pub(crate) fn begin_at(&mut self, d: &[T]) {
        self.from.clear();
        self.from.extend_from_slice(d);
    }

    /// Stores the result of an iteration.
    pub(crate) fn learn(&mut self, result: &[T]) {
        let Self { from, last, differences, .. } = self;
        let miss = |(&result, &from): (&T, &T)| result - from;
        let misses = || result.iter().zip(&*from).map(miss);
        if self.begun {
            differences.rotate_right(1);
            let newest = &mut differences[0];
            newest.misses.clear();
            newest.misses.extend(misses().zip(&last.misses).map(|(new, &old)| new - old));
            newest.results.clear();
            newest.results.extend(result.iter().zip(&last.results).map(|(&new, &old)| new - old));
            self.known = (self.known + 1).min(DEPTH);
        }
        last.misses.clear();
        last.misses.extend(misses());
        last.results.clear();
        last.results.extend_from_slice(result);
        self.begun = true;
    }

    /// Moves the result of the last iteration to where r − d is least. Returns whether it has moved.
    pub(crate) fn mix(&mut self, result: &mut [T]) -> bool {
        let Self { last, differences, apart, known, .. } = self;
        let mut used = 0;
        for difference in &differences[..*known] {
            let (before, rest) = apart.split_at_mut(used);
            let new = &mut rest[0];
            new.misses.clone_from(&difference.misses);
            new.results.clone_from(&difference.results);
            for other in before {
                let share = T::of(-product(&other.misses, &new.misses) / product(&other.misses, &other.misses));
                T::axpy(share, &other.misses, &mut new.misses);
                T::axpy(share, &other.results, &mut new.results);
            }
            let [left, whole] = [&new.misses, &difference.misses].map(|misses| product(misses, misses));
            if left > LEFT * LEFT * whole {
                T::axpy(T::of(-product(&new.misses, &last.misses) / left), &new.results, result);
                used += 1;
            }
        }
        let way = square_of_way(result, &last.results);
        if used > 0 && way <= FARTHEST * FARTHEST * product(&last.misses, &last.misses) {
            return true;
        }
        if used > 0 {
            self.give_up(result);
        }
        false
    }

    /// Restores the result of the last iteration, and begins again.
    pub(crate) fn give_up(&mut self, result: &mut [T]) {
        result.copy_from_slice(&self.last.results);
        self.forget();
    }
}

/// Σ x y in f64, which neither overflows nor underflows where T does.
fn product<T: Real>(x: &[T], y: &[T]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x.value() * y.value()).sum()
}

/// Σ (x − y)².
fn square_of_way<T: Real>(x: &[T], y: &[T]) -> f64 {
    x.iter().zip(y).map(|(&x, &y)| (x - y).value().powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// r(d) = c + D (d − c): iterations approach c, or move away from it, by the factors on the diagonal.
    fn misses(factors: [f64; 3], mixes: bool) -> f64 {
        let center = [1.0, -2.0, 0.5];
        let (mut d, mut mixing) = ([0.0; 3], Mixing::new(3));
        for _ in 0..6 {
            mixing.begin_at(&d);
            d = std::array::from_fn(|k| center[k] + factors[k] * (d[k] - center[k]));
            mixing.learn(&d);
            if mixes {
                mixing.mix(&mut d);
            }
        }
        d.iter().zip(center).map(|(d, c)| (d - c).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn what_is_slow_alternates_or_grows_is_found_at_once() {
        for factors in [[0.99, 0.5, 0.1], [-1.2, 0.9, 0.3], [1.01, 0.2, -0.4]] {
            assert!(misses(factors, false) > 0.1);
            assert!(misses(factors, true) < 1e-9, "{}", misses(factors, true));
        }
    }

    #[test]
    fn a_rest_that_passes_were_not_going_to_is_elsewhere() {
        let mut mixing = Mixing::new(2);
        let free = [3.0, 4.0];
        mixing.begin(&[0.0, 0.0]);
        // Half of the displacement of 5 is 2.5.
        assert_eq!(mixing.elsewhere(&[2.4, 0.0], &free), None);
        assert_eq!(mixing.elsewhere(&[0.0, -2.75], &free), Some(0.55));
        mixing.begin(&[2.0, 4.0]);
        assert_eq!(mixing.elsewhere(&[2.0, 5.0], &free), Some(1.0));
    }

    #[test]
    fn what_cannot_be_mixed_stays() {
        let mut mixing = Mixing::new(2);
        let mut d = [3.0, 4.0];
        mixing.begin_at(&[0.0, 0.0]);
        mixing.learn(&d);
        // No difference yet; then two equal iterations.
        assert!(!mixing.mix(&mut d));
        mixing.learn(&d);
        assert!(!mixing.mix(&mut d));
        assert_eq!(d.map(f64::to_bits), [3.0, 4.0].map(f64::to_bits));
        // A solution a million times farther than the last increment is rejected.
        mixing.forget();
        mixing.begin_at(&[0.0, 0.0]);
        mixing.learn(&[1.0, 0.0]);
        mixing.begin_at(&[1.0, 0.0]);
        let mut d = [2.0 - 1e-6, 0.0];
        mixing.learn(&d);
        assert!(!mixing.mix(&mut d));
        assert_eq!(d.map(f64::to_bits), [2.0 - 1e-6, 0.0].map(f64::to_bits));
        mixing.give_up(&mut d);
        assert_eq!(d.map(f64::to_bits), [2.0 - 1e-6, 0.0].map(f64::to_bits));
    }
}
