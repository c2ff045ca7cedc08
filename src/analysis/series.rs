//! Truncated Laurent series in the step size, with running error bounds that identify cancelling terms as zero.

use crate::rounding::of_operation;

/// `h^valuation (c₀ + c₁ h + c₂ h² + …)`; terms beyond the stored ones are unknown, an empty series is zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Series {
    valuation: i32,
    /// (coefficient, bound of its rounding error)
    terms: Vec<(f64, f64)>,
}

/// Number of terms kept.
const TERMS: usize = 12;
/// Coefficients up to this multiple of their rounding bound count as zero.
const CAUTION: f64 = 16.0;

impl Series {
    pub(super) fn zero() -> Self {
        Self { valuation: 0, terms: Vec::new() }
    }

    /// `c h^power`.
    pub(super) fn monomial(c: f64, power: i32) -> Self {
        let mut terms = vec![(0.0, 0.0); TERMS];
        terms[0] = (c, 0.0);
        Self { valuation: power, terms }.normalized()
    }

    /// `exp(rate h)`.
    pub(super) fn exponential(rate: f64) -> Self {
        let mut c = 1.0;
        let terms = (1..=TERMS).map(|n| {
            let term = (c, 4.0 * of_operation(c));
            c *= rate / n as f64;
            term
        });
        Self { valuation: 0, terms: terms.collect() }
    }

    pub(super) fn is_zero(&self) -> bool {
        self.terms.is_empty()
    }

    /// Power of the first term; `None` for zero.
    pub(super) fn valuation(&self) -> Option<i32> {
        (!self.is_zero()).then_some(self.valuation)
    }

    /// Coefficient of `h^power`, zero beyond the known terms.
    pub(super) fn coefficient(&self, power: i32) -> f64 {
        usize::try_from(power - self.valuation).ok().and_then(|i| self.terms.get(i)).map_or(0.0, |term| term.0)
    }

    /// Magnitude of the first coefficient.
    pub(super) fn leading(&self) -> f64 {
        self.terms.first().map_or(0.0, |term| term.0.abs())
    }

    /// Drops leading terms that are zero to rounding.
    fn normalized(mut self) -> Self {
        let noise = |&(c, e): &(f64, f64)| c.abs() <= CAUTION * e;
        let first = self.terms.iter().position(|term| !noise(term)).unwrap_or(self.terms.len());
        self.terms.drain(..first);
        self.valuation += i32::try_from(first).unwrap_or(i32::MAX);
        self
    }

    /// `1/self`; zero has none.
    fn reciprocal(&self) -> Self {
        let Some(&(first, error)) = self.terms.first() else { return Self::zero() };
        let mut terms: Vec<(f64, f64)> = Vec::with_capacity(self.terms.len());
        for n in 0..self.terms.len() {
            let (mut sum, mut bound) = if n == 0 { (1.0, 0.0) } else { (0.0, 0.0) };
            for (i, &(r, e)) in terms.iter().enumerate() {
                let (c, own) = self.terms[n - i];
                sum -= c * r;
                bound += (c * e).abs() + (own * r).abs() + of_operation(c * r);
            }
            let value = sum / first;
            terms.push((value, (bound + (value * error).abs()) / first.abs() + of_operation(value)));
        }
        Self { valuation: -self.valuation, terms }
    }

    /// `c h^power self`.
    pub(super) fn scaled(&self, c: f64, power: i32) -> Self {
        let scale = |&(x, e): &(f64, f64)| (c * x, (c * e).abs() + of_operation(c * x));
        Self { valuation: self.valuation + power, terms: self.terms.iter().map(scale).collect() }.normalized()
    }

    /// `self/divisor`.
    pub(super) fn over(&self, divisor: &Self) -> Self {
        self.times(&divisor.reciprocal())
    }

    /// `self + other`.
    pub(super) fn plus(&self, other: &Self) -> Self {
        self.combine(other, 1.0)
    }

    /// `self − other`.
    pub(super) fn minus(&self, other: &Self) -> Self {
        self.combine(other, -1.0)
    }

    /// `self · other`.
    pub(super) fn times(&self, other: &Self) -> Self {
        let known = self.terms.len().min(other.terms.len());
        let terms = (0..known).map(|n| {
            (0..=n).fold((0.0, 0.0), |(sum, bound), i| {
                let ((x, e), (y, f)) = (self.terms[i], other.terms[n - i]);
                (sum + x * y, bound + (x * f).abs() + (y * e).abs() + of_operation(x * y))
            })
        });
        Self { valuation: self.valuation + other.valuation, terms: terms.collect() }.normalized()
    }

    fn combine(&self, other: &Self, sign: f64) -> Self {
        if other.is_zero() {
            return self.clone();
        }
        if self.is_zero() {
            let terms = other.terms.iter().map(|&(c, e)| (sign * c, e)).collect();
            return Self { valuation: other.valuation, terms };
        }
        let end = |s: &Self| s.valuation + i32::try_from(s.terms.len()).unwrap_or(i32::MAX);
        let valuation = self.valuation.min(other.valuation);
        let term = |s: &Self, power: i32| {
            usize::try_from(power - s.valuation).ok().and_then(|i| s.terms.get(i)).copied().unwrap_or((0.0, 0.0))
        };
        let terms = (valuation..end(self).min(end(other))).map(|power| {
            let ((x, e), (y, f)) = (term(self, power), term(other, power));
            (x + sign * y, e + f + of_operation(x.abs() + y.abs()))
        });
        Self { valuation, terms: terms.collect() }.normalized()
    }
}

/// Solves `matrix x = right` over the field of Laurent series; `None` if the matrix is singular to the known terms.
pub(super) fn solve(mut matrix: Vec<Vec<Series>>, mut right: Vec<Series>) -> Option<Vec<Series>> {
    let n = right.len();
    for k in 0..n {
        // The lowest power first: dividing by it loses no terms.
        let candidates = (k..n).filter_map(|i| matrix[i][k].valuation().map(|power| (power, i)));
        let order = |x: &(i32, usize), y: &(i32, usize)| {
            x.0.cmp(&y.0).then_with(|| matrix[y.1][k].leading().total_cmp(&matrix[x.1][k].leading()))
        };
        let (_, pivot) = candidates.min_by(order)?;
        matrix.swap(k, pivot);
        right.swap(k, pivot);
        let (done, rest) = matrix.split_at_mut(k + 1);
        let row = &done[k];
        for (i, other) in rest.iter_mut().enumerate() {
            if other[k].is_zero() {
                continue;
            }
            let factor = other[k].over(&row[k]);
            for (x, p) in other.iter_mut().zip(row).skip(k).filter(|(_, p)| !p.is_zero()) {
                *x = x.minus(&factor.times(p));
            }
            other[k] = Series::zero();
            right[k + 1 + i] = right[k + 1 + i].minus(&factor.times(&right[k]));
        }
    }
    for k in (0..n).rev() {
        let known = (k + 1..n).fold(right[k].clone(), |sum, j| sum.minus(&matrix[k][j].times(&right[j])));
        right[k] = known.over(&matrix[k][k]);
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_obey_their_functional_equation() {
        let product = Series::exponential(0.7).times(&Series::exponential(-0.7));
        let rest = product.minus(&Series::monomial(1.0, 0));
        assert!(rest.is_zero(), "{rest:?}");
        let third = Series::exponential(1.0).minus(&Series::exponential(-1.0));
        assert_eq!(third.valuation(), Some(1));
        assert!((third.coefficient(3) - 1.0 / 3.0).abs() < 1e-15 && third.coefficient(2).abs() < 1e-15);
    }

    #[test]
    fn division_shifts_the_power() {
        // (e^h − 1)/h² = 1/h + ½ + h/6 + …
        let series = Series::exponential(1.0).minus(&Series::monomial(1.0, 0)).over(&Series::monomial(1.0, 2));
        assert_eq!(series.valuation(), Some(-1));
        assert!((series.coefficient(1) - 1.0 / 6.0).abs() < 1e-15);
    }

    #[test]
    fn systems_are_solved_beyond_a_vanishing_pivot() {
        // [h 1; 1 1] x = [1; 2] has x = (1/(1 − h), 2 − 1/(1 − h)).
        let matrix = vec![
            vec![Series::monomial(1.0, 1), Series::monomial(1.0, 0)],
            vec![Series::monomial(1.0, 0), Series::monomial(1.0, 0)],
        ];
        let x = solve(matrix, vec![Series::monomial(1.0, 0), Series::monomial(2.0, 0)]).unwrap();
        assert!((0..4).all(|power| (x[0].coefficient(power) - 1.0).abs() < 1e-14), "{x:?}");
        assert!((x[1].coefficient(0) - 1.0).abs() < 1e-14 && (x[1].coefficient(3) + 1.0).abs() < 1e-14);
        let singular = vec![vec![Series::monomial(1.0, 0); 2]; 2];
        assert!(solve(singular, vec![Series::zero(), Series::zero()]).is_none());
    }
}
