//! Conjugate gradients, preconditioned by Gauss–Seidel sweeps, on a matrix in blocks that is scaled so that its
//! diagonal blocks are identities.
//!
//! Several right-hand sides are solved together: each row of a sweep waits for earlier ones, and the other right-hand
//! sides use that time. The result for one right-hand side does not depend on the others or on the machine: no product
//! is fused with its sum.
#![allow(clippy::inline_always)] // only inlined code is compiled for the vector units

use crate::rounding::rounding;
use crate::scalar::Scalar;
use crate::threads;
use faer::traits::pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Blocks below the diagonal of a symmetric matrix, row by row, each stored column by column.
#[derive(Clone, Copy, Debug)]
pub struct Blocks<'a, T> {
    pub pointers: &'a [usize],
    pub columns: &'a [u32],
    pub values: &'a [T],
}

/// A scaled matrix, and when an iteration ends.
#[derive(Clone, Copy, Debug)]
pub struct Iteration<'a, T> {
    pub lower: Blocks<'a, T>,
    /// C⁻¹ of each diagonal block C Cᵀ of the matrix.
    pub scaling: &'a [T],
    /// The ends of parts, in rows of blocks: no part has a block in the columns of another, and several threads share
    /// them. Rows behind the last part may have blocks in all columns.
    pub parts: &'a [usize],
    /// Tolerance of the preconditioned residual, relative to the right-hand side.
    pub tolerance: f64,
    /// An update smaller than this share of the solution ends the iteration.
    pub resolution: f64,
    pub limit: usize,
}

/// A space Z in which a solve begins, and that its directions are kept out of. It may fail: then an iteration ends
/// without result.
pub trait Deflation<T> {
    /// Solves in the space: x += Z μ and r −= A Z μ, so that Zᵀ r = 0. Returns μᵀ Zᵀ A Z μ.
    fn start(&mut self, r: &mut [T], x: &mut [T]) -> f64;

    /// t −= Z μ and p −= (1 + Lᵀ) Z μ, so that Zᵀ A t = 0.
    fn turn(&mut self, t: &mut [T], p: &mut [T]);
}

/// One entry of each of W right-hand sides.
pub(crate) type Lanes<T, const W: usize> = [T; W];

/// Number of right-hand sides that are solved together.
pub(crate) const LANES: usize = 4;

/// The largest number of parts.
pub(crate) const MOST_PARTS: usize = 8;

/// Vectors of conjugate gradients: the solution, the right-hand side, which is overwritten, and three work vectors.
#[derive(Debug)]
pub struct Vectors<'a, T, const W: usize> {
    pub x: &'a mut [Lanes<T, W>],
    pub r: &'a mut [Lanes<T, W>],
    pub p: &'a mut [Lanes<T, W>],
    pub t: &'a mut [Lanes<T, W>],
    pub y: &'a mut [Lanes<T, W>],
}

impl<'a, T, const W: usize> Vectors<'a, T, W> {
    /// Vectors of `size` entries each in memory for five of them.
    pub(crate) fn of(memory: &'a mut [T], size: usize) -> Self {
        let mut parts = memory.as_chunks_mut().0.chunks_exact_mut(size.max(1));
        let mut next = || parts.next().map_or(&mut [][..], |part| &mut part[..size]);
        Self { x: next(), r: next(), p: next(), t: next(), y: next() }
    }

    /// The same vectors for a shorter time.
    #[inline(always)]
    fn lend(&mut self) -> Vectors<'_, T, W> {
        Vectors { x: self.x, r: self.r, p: self.p, t: self.t, y: self.y }
    }

    /// The entries before `at`, and the others.
    #[inline(always)]
    fn split_at(self, at: usize) -> [Self; 2] {
        let [(x, x_), (r, r_), (p, p_), (t, t_), (y, y_)] =
            [self.x, self.r, self.p, self.t, self.y].map(|vector| vector.split_at_mut(at));
        [Self { x, r, p, t, y }, Self { x: x_, r: r_, p: p_, t: t_, y: y_ }]
    }
}

/// Result of conjugate gradients.
#[derive(Clone, Copy, Debug)]
pub enum Outcome {
    Converged {
        iterations: usize,
    },
    NotConverged {
        iterations: usize,
        residual: f64,
    },
    /// `curvature` is pᵀAp over pᵀdiag(A)p for a direction p, `dof` its largest entry.
    Indefinite {
        curvature: f64,
        dof: usize,
    },
}

/// A block, `[column][row]`.
type Block<T, const B: usize> = [[T; B]; B];

/// The entries of a row of blocks, for each right-hand side.
type Row<T, const B: usize, const W: usize> = [Lanes<T, W>; B];

#[inline]
fn block<T: Scalar, const B: usize>(values: &[T]) -> Block<T, B> {
    std::array::from_fn(|c| std::array::from_fn(|r| values[c * B + r]))
}

#[inline]
fn store<T: Scalar, const B: usize>(block: &Block<T, B>, values: &mut [T]) {
    for c in 0..B {
        values[c * B..(c + 1) * B].copy_from_slice(&block[c]);
    }
}

/// The inverse of the Cholesky factor of a symmetric block (lower triangle read); `Err` is the index of a pivot that
/// is at most the rounding of its diagonal entry.
#[inline]
fn inverse_factor<T: Scalar, const B: usize>(a: &Block<T, B>) -> Result<Block<T, B>, usize> {
    let mut l = [[T::zero(); B]; B];
    for c in 0..B {
        for r in c..B {
            let mut sum = a[c][r];
            for column in &l[..c] {
                sum -= column[r] * column[c];
            }
            l[c][r] = if r > c {
                sum / l[c][c]
            } else if sum > rounding(a[c][c]) && sum.is_finite() {
                sum.sqrt()
            } else {
                return Err(c);
            };
        }
    }
    let mut inverse = [[T::zero(); B]; B];
    for c in 0..B {
        inverse[c][c] = l[c][c].recip();
        for r in c + 1..B {
            let mut sum = T::zero();
            for k in c..r {
                sum += l[k][r] * inverse[c][k];
            }
            inverse[c][r] = -sum / l[r][r];
        }
    }
    Ok(inverse)
}

/// `L x` for a lower triangular block.
#[inline]
fn lower_product<T: Scalar, const B: usize>(l: &[T], x: [T; B]) -> [T; B] {
    std::array::from_fn(|r| (0..=r).map(|c| l[c * B + r] * x[c]).sum())
}

/// `Lᵀ x` for a lower triangular block.
#[inline]
fn lower_transposed<T: Scalar, const B: usize>(l: &[T], x: [T; B]) -> [T; B] {
    std::array::from_fn(|c| (c..B).map(|r| l[c * B + r] * x[r]).sum())
}

/// As [`scale`], in blocks of `size`².
#[inline]
pub(crate) fn scale_blocks<T: Scalar>(
    size: usize,
    pattern: (&[usize], &[u32]),
    values: &mut [T],
    diagonal: &mut [T],
) -> Result<(), usize> {
    match size {
        3 => scale::<T, 3>(pattern, values, diagonal),
        2 => scale::<T, 2>(pattern, values, diagonal),
        _ => scale::<T, 1>(pattern, values, diagonal),
    }
}

/// As [`solve`], in blocks of `size`².
#[inline]
pub(crate) fn solve_blocks<T: Scalar>(
    size: usize,
    iteration: &Iteration<'_, T>,
    deflation: Option<&mut dyn Deflation<T>>,
    vectors: Vectors<'_, T, 1>,
) -> [Outcome; 1] {
    match size {
        3 => solve_lanes::<T, 3, 1>(iteration, deflation, vectors),
        2 => solve_lanes::<T, 2, 1>(iteration, deflation, vectors),
        _ => solve_lanes::<T, 1, 1>(iteration, deflation, vectors),
    }
}

/// As [`solve_lanes`], for several right-hand sides of a matrix given entry by entry.
#[inline]
pub(crate) fn solve_side_by_side<T: Scalar>(
    iteration: &Iteration<'_, T>,
    vectors: Vectors<'_, T, LANES>,
) -> [Outcome; LANES] {
    Arch::new().dispatch(SideBySide { iteration, vectors })
}

/// Scales a matrix: `values` and `diagonal` hold its blocks and are replaced by C_I⁻¹ A_IJ C_J⁻ᵀ and C_I⁻¹, with the
/// Cholesky factors C_I of the diagonal blocks. `Err` is the dof of a pivot that is not positive.
#[inline]
fn scale<T: Scalar, const B: usize>(
    (pointers, columns): (&[usize], &[u32]),
    values: &mut [T],
    diagonal: &mut [T],
) -> Result<(), usize> {
    for (row, diagonal) in diagonal.chunks_exact_mut(B * B).enumerate() {
        let inverse = inverse_factor::<T, B>(&block(diagonal)).map_err(|k| row * B + k)?;
        store(&inverse, diagonal);
    }
    for row in 0..pointers.len() - 1 {
        let own = &diagonal[row * B * B..(row + 1) * B * B];
        for at in pointers[row]..pointers[row + 1] {
            let other = &diagonal[columns[at] as usize * B * B..][..B * B];
            let values = &mut values[at * B * B..(at + 1) * B * B];
            let a: Block<T, B> = block(values);
            // Columns of C_I⁻¹ A, then rows of it times C_J⁻ᵀ.
            let half: Block<T, B> = std::array::from_fn(|c| lower_product(own, a[c]));
            for r in 0..B {
                let scaled = lower_product::<T, B>(other, std::array::from_fn(|c| half[c][r]));
                for (c, x) in scaled.into_iter().enumerate() {
                    values[c * B + r] = x;
                }
            }
        }
    }
    Ok(())
}

/// The criteria that end an iteration, tested after each step.
#[derive(Clone, Copy)]
struct Ends {
    tolerance: f64,
    /// Squared, like lengths.
    resolution: f64,
    limit: usize,
    /// The squared norm of the right-hand side.
    first: f64,
    /// Σ α ρ: the squared length of the present solution in the norm of the matrix (Hestenes and Stiefel, 1952,
    /// theorem 6:1: directions are orthogonal in that norm).
    length: f64,
    iterations: usize,
}

impl Ends {
    /// After a step α along a direction, with ρ before and after it.
    fn outcome(&mut self, alpha: f64, before: f64, after: f64) -> Option<Outcome> {
        self.iterations += 1;
        let step = alpha * before;
        self.length += step;
        // Second criterion: the change in this step, and in any later one, is below the resolution.
        if after <= self.tolerance.powi(2) * self.first || step <= self.resolution * self.length {
            return Some(Outcome::Converged { iterations: self.iterations });
        }
        let residual = (after / self.first).sqrt();
        (self.iterations >= self.limit).then_some(Outcome::NotConverged { iterations: self.iterations, residual })
    }
}

struct SideBySide<'a, T> {
    iteration: &'a Iteration<'a, T>,
    vectors: Vectors<'a, T, LANES>,
}

impl<T: Scalar> WithSimd for SideBySide<'_, T> {
    type Output = [Outcome; LANES];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [Outcome; LANES] {
        solve_lanes::<T, 1, LANES>(self.iteration, None, self.vectors)
    }
}

/// Solves A x = r for each right-hand side r, starting from zero or in a space to be deflated.
#[inline(always)]
fn solve_lanes<T: Scalar, const B: usize, const W: usize>(
    iteration: &Iteration<'_, T>,
    deflation: Option<&mut dyn Deflation<T>>,
    mut vectors: Vectors<'_, T, W>,
) -> [Outcome; W] {
    let Iteration { lower, scaling, parts, tolerance, resolution, limit } = *iteration;
    let mut largest = [T::zero(); W];
    let r = &mut *vectors.r;
    for (r, inverse) in r.as_chunks_mut::<B>().0.iter_mut().zip(scaling.chunks_exact(B * B)) {
        *r = each_lane(r, |r| lower_product(inverse, r));
        for r in r {
            for l in 0..W {
                largest[l] = if r[l].abs() <= largest[l] || largest[l].is_nan() { largest[l] } else { r[l].abs() };
            }
        }
    }
    // Scaled by a power of two, without rounding: squares of small forces stay in range. Right-hand sides that are
    // zero or not finite are replaced by zero.
    let powers = largest.map(powers);
    for r in r.iter_mut() {
        for l in 0..W {
            r[l] = powers[l].map_or(T::zero(), |[down, _]| down * r[l]);
        }
    }
    let ends = Ends { tolerance, resolution: resolution * resolution, limit, first: 0.0, length: 0.0, iterations: 0 };
    let mut ends = [ends; W];
    let mut outcomes = iterate::<T, B, W>(&Sweeps { lower, parts }, deflation, &mut ends, vectors.lend());
    let x = vectors.x;
    let mut lengths = [0.0; W];
    for x in &*x {
        accumulate(x, x, &mut lengths);
    }
    for l in 0..W {
        let Outcome::Converged { iterations: 1.. } = outcomes[l] else { continue };
        // xᵀAx over xᵀdiag(A)x is at least the smallest eigenvalue. Below the rounding of the entries of A the matrix
        // is singular to working precision; so it is if the solution overflows.
        let curvature = ends[l].length / lengths[l];
        if curvature.is_nan() || curvature <= rounding(T::one()).value() {
            let curvature = if curvature.is_nan() { 0.0 } else { curvature };
            outcomes[l] = Outcome::Indefinite { curvature, dof: place_of_largest(x, l) };
        }
    }
    for (x, inverse) in x.as_chunks_mut::<B>().0.iter_mut().zip(scaling.chunks_exact(B * B)) {
        *x = each_lane(x, |x| lower_transposed(inverse, x));
        for x in x {
            // The product is NaN for a right-hand side that is not finite.
            *x = std::array::from_fn(|l| powers[l].map_or(T::zero() * largest[l], |[_, up]| up * x[l]));
        }
    }
    outcomes
}

/// Powers of two next to 1/x and x; `None` if x is zero or not finite.
#[allow(clippy::cast_possible_truncation)]
fn powers<T: Scalar>(x: T) -> Option<[T; 2]> {
    let least = T::min_positive_value().value().log2() as i32 + 8;
    let exponent = (x.value().log2().floor() as i32).max(least);
    (x > T::zero() && x.is_finite()).then(|| [-exponent, exponent].map(|exponent| T::of(2.0_f64.powi(exponent))))
}

/// A matrix whose parts several threads share.
struct Sweeps<'a, T> {
    lower: Blocks<'a, T>,
    parts: &'a [usize],
}

/// Some rows of blocks, and where the entries of vectors that come with them begin.
#[derive(Clone)]
struct Rows {
    range: Range<usize>,
    first: usize,
}

impl<T: Scalar> Sweeps<'_, T> {
    /// The rows behind the parts, with all entries of the vectors.
    fn border(&self) -> Rows {
        Rows { range: self.parts.last().copied().unwrap_or(0)..self.lower.pointers.len() - 1, first: 0 }
    }

    /// Calls `act` for each part, with its entries of the vectors, on several threads; returns the sum of its results.
    #[inline(always)]
    fn each_part<const B: usize, const W: usize>(
        &self,
        vectors: Vectors<'_, T, W>,
        act: impl Fn(Rows, Vectors<'_, T, W>) -> Lanes<f64, W> + Sync,
    ) -> Lanes<f64, W> {
        if self.parts.is_empty() {
            return [0.0; W];
        }
        let mut sums = [[0.0; W]; MOST_PARTS];
        each_of::<T, B, W>(self.parts, 0, vectors, &mut sums[..self.parts.len()], &act);
        // In the order of the parts, for any number of threads.
        sums.iter().fold([0.0; W], |all, own| std::array::from_fn(|l| all[l] + own[l]))
    }
}

/// Calls `act` for each of some parts, the first of which begins with the row `first`.
fn each_of<T: Scalar, const B: usize, const W: usize>(
    parts: &[usize],
    first: usize,
    vectors: Vectors<'_, T, W>,
    sums: &mut [Lanes<f64, W>],
    act: &(impl Fn(Rows, Vectors<'_, T, W>) -> Lanes<f64, W> + Sync),
) {
    if let ([end], [sum]) = (parts, &mut *sums) {
        let [own, _] = vectors.split_at((end - first) * B);
        *sum = act(Rows { range: first..*end, first }, own);
        return;
    }
    let half = parts.len() / 2;
    let middle = parts[half - 1];
    let [low, high] = vectors.split_at((middle - first) * B);
    let (low_sums, high_sums) = sums.split_at_mut(half);
    threads::join(
        || each_of::<T, B, W>(&parts[..half], first, low, low_sums, act),
        || each_of::<T, B, W>(&parts[half..], middle, high, high_sums, act),
    );
}

/// With the preconditioner (1 + L)(1 + Lᵀ), in a form in which a step costs only one product (Eisenstat, 1981): in
/// the variables (1 + Lᵀ) x the product with a direction p is t + (1 + L)⁻¹ (p − t), where t = (1 + Lᵀ)⁻¹ p.
/// A right-hand side whose iteration has ended waits for the others, with steps of zero.
///
/// With a deflation t is (1 + Lᵀ)⁻¹ p too, found from (1 + Lᵀ)⁻¹ r, without what both have of the space.
#[inline(always)]
fn iterate<T: Scalar, const B: usize, const W: usize>(
    sweeps: &Sweeps<'_, T>,
    mut deflation: Option<&mut dyn Deflation<T>>,
    ends: &mut [Ends; W],
    mut vectors: Vectors<'_, T, W>,
) -> [Outcome; W] {
    let (lower, border) = (&sweeps.lower, sweeps.border());
    let behind = border.range.start * B;
    vectors.x.fill([T::zero(); W]);
    if let Some(deflation) = &mut deflation {
        // The size of the right-hand side as it is without the deflation.
        vectors.t.copy_from_slice(vectors.r);
        let mut first = sweeps.each_part::<B, W>(vectors.lend(), |rows, own| eliminate::<T, B, W>(lower, rows, own.t));
        add(&mut first, eliminate::<T, B, W>(lower, border.clone(), vectors.t));
        let length = deflation.start(vectors.r.as_flattened_mut(), vectors.x.as_flattened_mut());
        for l in 0..W {
            (ends[l].first, ends[l].length) = (first[l], length);
        }
        vectors.t.fill([T::zero(); W]);
    }
    let mut rho = sweeps.each_part::<B, W>(vectors.lend(), |rows, own| eliminate::<T, B, W>(lower, rows, own.r));
    add(&mut rho, eliminate::<T, B, W>(lower, border.clone(), vectors.r));
    if deflation.is_none() {
        for l in 0..W {
            ends[l].first = rho[l];
        }
    }
    // ρ when the space was last removed from r.
    let mut known = rho;
    let mut beta = [T::zero(); W];
    vectors.p.fill([T::zero(); W]);
    let is_met = |l: usize| rho[l] <= ends[l].tolerance.powi(2) * ends[l].first;
    let mut outcomes: [Option<Outcome>; W] =
        std::array::from_fn(|l| is_met(l).then_some(Outcome::Converged { iterations: 0 }));
    while outcomes.iter().any(Option::is_none) {
        let mut curvature = match &mut deflation {
            None => {
                sweeps.each_part::<B, W>(vectors.lend(), |_, own| turn(beta, own));
                turn(beta, vectors.lend().split_at(behind)[1].lend());
                substitute_back::<T, B, W>(lower, border.clone(), vectors.t);
                sweeps.each_part::<B, W>(vectors.lend(), |rows, own| {
                    substitute_back::<T, B, W>(lower, rows.clone(), own.t);
                    substitute::<T, B, W>(lower, rows, [own.p, own.t], own.y)
                })
            }
            Some(deflation) => {
                vectors.y.copy_from_slice(vectors.r);
                substitute_back::<T, B, W>(lower, border.clone(), vectors.y);
                sweeps.each_part::<B, W>(vectors.lend(), |rows, own| {
                    substitute_back::<T, B, W>(lower, rows, own.y);
                    turn_both(beta, own)
                });
                turn_both(beta, vectors.lend().split_at(behind)[1].lend());
                deflation.turn(vectors.t.as_flattened_mut(), vectors.p.as_flattened_mut());
                sweeps.each_part::<B, W>(vectors.lend(), |rows, own| {
                    substitute::<T, B, W>(lower, rows, [own.p, own.t], own.y)
                })
            }
        };
        let direction = [&*vectors.p, &*vectors.t];
        add(&mut curvature, substitute::<T, B, W>(lower, border.clone(), direction, vectors.y));
        let mut steps = [0.0; W];
        for l in 0..W {
            if outcomes[l].is_some() {
                continue;
            }
            if curvature[l] > 0.0 && curvature[l].is_finite() {
                steps[l] = rho[l] / curvature[l];
            } else {
                let mut length = [0.0; W];
                for t in &*vectors.t {
                    accumulate(t, t, &mut length);
                }
                let curvature = curvature[l] / length[l];
                let curvature = if curvature.is_nan() { 0.0 } else { curvature };
                outcomes[l] = Some(Outcome::Indefinite { curvature, dof: place_of_largest(vectors.t, l) });
            }
        }
        let (alpha, before) = (steps.map(T::of), rho);
        rho = sweeps.each_part::<B, W>(vectors.lend(), |_, own| advance(alpha, own));
        add(&mut rho, advance(alpha, vectors.lend().split_at(behind)[1].lend()));
        for l in 0..W {
            beta[l] = T::zero();
            if outcomes[l].is_none() {
                outcomes[l] = ends[l].outcome(steps[l], before[l], rho[l]);
                beta[l] = T::of(rho[l] / before[l]);
            }
        }
        let is_open = |l: usize| outcomes[l].is_none();
        let Some(deflation) = deflation.as_mut().filter(|_| (0..W).any(is_open)) else { continue };
        // What rounding leaves of the space in r would not get smaller with it, and at last lead directions astray.
        if (0..W).any(|l| rho[l] <= T::epsilon().value() * known[l]) {
            restore::<T, B, W>(lower, border.clone(), vectors.r);
            sweeps.each_part::<B, W>(vectors.lend(), |rows, own| restore::<T, B, W>(lower, rows, own.r));
            deflation.start(vectors.r.as_flattened_mut(), vectors.x.as_flattened_mut());
            rho = sweeps.each_part::<B, W>(vectors.lend(), |rows, own| eliminate::<T, B, W>(lower, rows, own.r));
            add(&mut rho, eliminate::<T, B, W>(lower, border.clone(), vectors.r));
            known = rho;
        }
    }
    outcomes.map(|outcome| outcome.unwrap_or(Outcome::Converged { iterations: 0 }))
}

#[inline(always)]
fn add<const W: usize>(sums: &mut Lanes<f64, W>, others: Lanes<f64, W>) {
    for l in 0..W {
        sums[l] += others[l];
    }
}

/// Solves (1 + L) r' = r in place; returns the squared length of the result.
#[inline(always)]
fn eliminate<T: Scalar, const B: usize, const W: usize>(
    lower: &Blocks<'_, T>,
    Rows { range, first }: Rows,
    r: &mut [Lanes<T, W>],
) -> Lanes<f64, W> {
    let mut rho = [0.0; W];
    for row in range {
        let sums = gather::<T, B, W>(lower, row, first, r);
        for (r, sum) in r[(row - first) * B..][..B].iter_mut().zip(sums) {
            *r = std::array::from_fn(|l| r[l] - sum[l]);
            accumulate(r, r, &mut rho);
        }
    }
    rho
}

/// Undoes [`eliminate`]: r ← (1 + L) r. Later rows come before earlier ones.
#[inline(always)]
fn restore<T: Scalar, const B: usize, const W: usize>(
    lower: &Blocks<'_, T>,
    Rows { range, first }: Rows,
    r: &mut [Lanes<T, W>],
) -> Lanes<f64, W> {
    for row in range.rev() {
        let sums = gather::<T, B, W>(lower, row, first, r);
        for (r, sum) in r[(row - first) * B..][..B].iter_mut().zip(sums) {
            *r = std::array::from_fn(|l| r[l] + sum[l]);
        }
    }
    [0.0; W]
}

/// The next direction p, also in t.
#[inline(always)]
fn turn<T: Scalar, const W: usize>(beta: Lanes<T, W>, Vectors { r, p, t, .. }: Vectors<'_, T, W>) -> Lanes<f64, W> {
    for ((p, t), r) in p.iter_mut().zip(t).zip(&*r) {
        *p = std::array::from_fn(|l| r[l] + beta[l] * p[l]);
        *t = *p;
    }
    [0.0; W]
}

/// The next direction p, and t without another substitution: y is (1 + Lᵀ)⁻¹ r.
#[inline(always)]
fn turn_both<T: Scalar, const W: usize>(
    beta: Lanes<T, W>,
    Vectors { r, p, t, y, .. }: Vectors<'_, T, W>,
) -> Lanes<f64, W> {
    for (((p, t), r), y) in p.iter_mut().zip(t).zip(&*r).zip(&*y) {
        for l in 0..W {
            p[l] = r[l] + beta[l] * p[l];
            t[l] = y[l] + beta[l] * t[l];
        }
    }
    [0.0; W]
}

/// Solves (1 + Lᵀ) t' = t in place.
#[inline(always)]
fn substitute_back<T: Scalar, const B: usize, const W: usize>(
    lower: &Blocks<'_, T>,
    Rows { range, first }: Rows,
    t: &mut [Lanes<T, W>],
) {
    for row in range.rev() {
        scatter::<T, B, W>(lower, row, first, t);
    }
}

/// Solves (1 + L) y = p − t; returns p · (t + y).
#[inline(always)]
fn substitute<T: Scalar, const B: usize, const W: usize>(
    lower: &Blocks<'_, T>,
    Rows { range, first }: Rows,
    [p, t]: [&[Lanes<T, W>]; 2],
    y: &mut [Lanes<T, W>],
) -> Lanes<f64, W> {
    let mut curvature = [0.0; W];
    for row in range {
        let sums = gather::<T, B, W>(lower, row, first, y);
        for (k, sum) in ((row - first) * B..).zip(sums) {
            y[k] = std::array::from_fn(|l| p[k][l] - t[k][l] - sum[l]);
            accumulate(&p[k], &std::array::from_fn(|l| t[k][l] + y[k][l]), &mut curvature);
        }
    }
    curvature
}

/// A step along the direction; returns the squared length of the residual.
#[inline(always)]
fn advance<T: Scalar, const W: usize>(
    alpha: Lanes<T, W>,
    Vectors { x, r, t, y, .. }: Vectors<'_, T, W>,
) -> Lanes<f64, W> {
    let mut rho = [0.0; W];
    for (((x, r), t), y) in x.iter_mut().zip(r).zip(&*t).zip(&*y) {
        for l in 0..W {
            x[l] += alpha[l] * t[l];
            r[l] -= alpha[l] * (t[l] + y[l]);
        }
        accumulate(r, r, &mut rho);
    }
    rho
}

/// Applies a function of the B entries of a row to each right-hand side.
#[inline(always)]
fn each_lane<T: Scalar, const B: usize, const W: usize>(
    x: &Row<T, B, W>,
    act: impl Fn([T; B]) -> [T; B],
) -> Row<T, B, W> {
    let lanes: [[T; B]; W] = std::array::from_fn(|l| act(x.map(|x| x[l])));
    std::array::from_fn(|k| std::array::from_fn(|l| lanes[l][k]))
}

/// Σ_J L_IJ y_J of block row I, with y from the row `first` on.
#[inline(always)]
fn gather<T: Scalar, const B: usize, const W: usize>(
    lower: &Blocks<'_, T>,
    row: usize,
    first: usize,
    y: &[Lanes<T, W>],
) -> Row<T, B, W> {
    let range = lower.pointers[row]..lower.pointers[row + 1];
    let mut sums = [[[T::zero(); W]; B]; B];
    let blocks = lower.values[range.start * B * B..range.end * B * B].chunks_exact(B * B);
    for (&column, block) in lower.columns[range].iter().zip(blocks) {
        let y = &y[(column as usize - first) * B..][..B];
        for c in 0..B {
            for r in 0..B {
                for l in 0..W {
                    sums[c][r][l] += block[c * B + r] * y[c][l];
                }
            }
        }
    }
    std::array::from_fn(|r| std::array::from_fn(|l| (0..B).map(|c| sums[c][r][l]).sum()))
}

/// `y_J −= L_IJᵀ y_I` for all J of block row I, with y from the row `first` on.
#[inline(always)]
fn scatter<T: Scalar, const B: usize, const W: usize>(
    lower: &Blocks<'_, T>,
    row: usize,
    first: usize,
    y: &mut [Lanes<T, W>],
) {
    let x: Row<T, B, W> = std::array::from_fn(|k| y[(row - first) * B + k]);
    let range = lower.pointers[row]..lower.pointers[row + 1];
    let blocks = lower.values[range.start * B * B..range.end * B * B].chunks_exact(B * B);
    for (&column, block) in lower.columns[range].iter().zip(blocks) {
        let y = &mut y[(column as usize - first) * B..][..B];
        for c in 0..B {
            for l in 0..W {
                let mut sum = T::zero();
                for r in 0..B {
                    sum += block[c * B + r] * x[r][l];
                }
                y[c][l] -= sum;
            }
        }
    }
}

/// `sums += x y` in double precision: in an f32 run products of long vectors would otherwise lose digits or overflow.
#[inline(always)]
fn accumulate<T: Scalar, const W: usize>(x: &Lanes<T, W>, y: &Lanes<T, W>, sums: &mut Lanes<f64, W>) {
    for l in 0..W {
        sums[l] += x[l].value() * y[l].value();
    }
}

/// The place of the largest entry of one of the vectors.
fn place_of_largest<T: Scalar, const W: usize>(x: &[Lanes<T, W>], lane: usize) -> usize {
    let sizes = x.iter().map(|x| x[lane].abs()).enumerate();
    sizes.fold((0, T::zero()), |largest, (place, size)| if size > largest.1 { (place, size) } else { largest }).0
}
