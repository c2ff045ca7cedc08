//! Linearizations of curved rows that converge slowly, or go round a solution: where rows are linearized next is mixed
//! from the last passes.
//!
//! Rows are linearized at d, and the contact problem solved with them has the result r(d). Rows turn with d, and with
//! them forces, whose change the problem does not know: from pass to pass d then comes nearer to where r(d) = d by a
//! factor only, which may be nearly one, or below minus one. Anderson's mixing (J. ACM 12, 1965; Walker and Ni, SIAM J.
//! Numer. Anal. 49, 2011) takes the combination of the last passes in which r − d is least, if it is linear in d.

use crate::real::Real;

/// The number of differences of passes that are mixed.
const DEPTH: usize = 4;

/// Share of a difference that is left of it, without what it has in common with those of later passes, below which it
/// is rounding.
const LEFT: f64 = 1e-6;

/// The longest way from the result of a pass to where rows are linearized next, over that from where they were
/// linearized to the result: a factor of 0.99 or of 1.01 needs a hundred.
const FARTHEST: f64 = 1e3;

/// The share of the way by which passes have pushed that mixing may move their result where half of the step may be
/// taken instead. (Of the rests that are those of the same solution nearly all are nearer than a hundredth.)
pub(crate) const ELSEWHERE: f64 = 0.5;

/// A difference of two passes: of r − d, and of r.
struct Difference<T> {
    misses: Vec<T>,
    results: Vec<T>,
}

/// Memory for mixing.
pub(crate) struct Mixing<T> {
    /// Where the rows of the next pass are linearized.
    from: Vec<T>,
    /// The last pass itself.
    last: Difference<T>,
    /// The result of the passes before any was mixed.
    unmixed: Vec<T>,
    /// Of the passes before, the newest first, and of them what each has that those before it here have not.
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
    /// For so many dofs.
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

    /// Begins with the result of passes that were not mixed.
    pub(crate) fn begin(&mut self, result: &[T]) {
        self.forget();
        self.unmixed.clear();
        self.unmixed.extend_from_slice(result);
    }

    /// Forgets what passes have found.
    fn forget(&mut self) {
        (self.known, self.begun) = (0, false);
    }

    /// How far d is from where passes were before any was mixed, over the way that they had pushed it from `free`, if
    /// this share is that of another solution.
    pub(crate) fn elsewhere(&self, d: &[T], free: &[T]) -> Option<f64> {
        let share = (square_of_way(d, &self.unmixed) / square_of_way(&self.unmixed, free)).sqrt();
        (share > ELSEWHERE).then_some(share)
    }

    /// Notes where the rows of the next pass are linearized.
    pub(crate) fn begin_at(&mut self, d: &[T]) {
        self.from.clear();
        self.from.extend_from_slice(d);
    }

    /// Takes the result of a pass.
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

    /// Moves the result of the last pass to where r − d is least. Says whether it has moved.
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

    /// Goes back to the result of the last pass, and begins anew.
    pub(crate) fn give_up(&mut self, result: &mut [T]) {
        result.copy_from_slice(&self.last.results);
        self.forget();
    }
}

/// Σ x y, which neither overflows nor underflows where T does.
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

    /// r(d) = c + D (d − c), whose passes come nearer to c by the factors on the diagonal, or go away from it.
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
        // Half of the way of 5 that they had pushed.
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
        // Nothing to compare with yet; then passes that differ in nothing.
        assert!(!mixing.mix(&mut d));
        mixing.learn(&d);
        assert!(!mixing.mix(&mut d));
        assert_eq!(d.map(f64::to_bits), [3.0, 4.0].map(f64::to_bits));
        // A solution a million times farther than the last way is none.
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
