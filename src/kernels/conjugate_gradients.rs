//! Preconditioned conjugate gradients on a matrix in blocks, scaled so that its diagonal blocks are identities.

use crate::scalar::Scalar;

/// Blocks below the diagonal of a symmetric matrix, row by row, each stored column by column.
#[derive(Clone, Copy, Debug)]
pub struct Blocks<'a, T> {
    pub pointers: &'a [usize],
    pub columns: &'a [u32],
    pub values: &'a [T],
}

/// Preconditioners of conjugate gradients for a matrix with identities as diagonal blocks.
#[derive(Clone, Copy, Debug)]
pub enum Sweeps<'a, T> {
    /// None beyond the scaling of the matrix.
    Nodes,
    /// (1 + L)(1 + Lᵀ).
    GaussSeidel,
    /// An incomplete factor, with the inverses of its diagonal blocks.
    Incomplete { factor: Blocks<'a, T>, inverses: &'a [T] },
}

/// Conjugate gradients for a scaled matrix.
#[derive(Clone, Copy, Debug)]
pub struct Iteration<'a, T> {
    pub lower: Blocks<'a, T>,
    /// C⁻¹ of each diagonal block C Cᵀ of the matrix.
    pub scaling: &'a [T],
    pub sweeps: Sweeps<'a, T>,
    /// Tolerance of the preconditioned residual, relative to the right-hand side.
    pub tolerance: f64,
    /// An update smaller than this share of the solution ends the iteration.
    pub resolution: f64,
    pub limit: usize,
}

/// Memory of conjugate gradients.
#[derive(Debug)]
pub struct Vectors<'a, T> {
    pub x: &'a mut [T],
    pub r: &'a mut [T],
    pub p: &'a mut [T],
    pub t: &'a mut [T],
    pub q: &'a mut [T],
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
    /// `curvature` is pᵀAp over pᵀdiag(A)p for a direction p, `dof` the one with the smallest share of pᵀAp.
    Indefinite {
        curvature: f64,
        dof: usize,
    },
}

/// Partial sums: in a single sum each addition would wait for the one before.
const LANES: usize = 4;

/// Σ x y in double precision: in an f32 run products of long vectors would otherwise lose digits or overflow.
#[inline]
fn dot<T: Scalar>(x: &[T], y: &[T]) -> f64 {
    let mut sums = [0.0; LANES];
    let (x_rest, y_rest) = (x.chunks_exact(LANES).remainder(), y.chunks_exact(LANES).remainder());
    for (x, y) in x.chunks_exact(LANES).zip(y.chunks_exact(LANES)) {
        for k in 0..LANES {
            sums[k] += x[k].value() * y[k].value();
        }
    }
    let rest: f64 = x_rest.iter().zip(y_rest).map(|(x, y)| x.value() * y.value()).sum();
    sums.iter().sum::<f64>() + rest
}

/// A block, `[column][row]`.
type Block<T, const B: usize> = [[T; B]; B];

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
            } else if sum > T::of(16.0) * T::epsilon() * a[c][c] && sum.is_finite() {
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

#[inline]
fn node<T: Scalar, const B: usize>(x: &[T], node: usize) -> [T; B] {
    let x = &x[node * B..(node + 1) * B];
    std::array::from_fn(|k| x[k])
}

/// Σ_J L_IJ y_J of block row I.
#[inline]
fn gather<T: Scalar, const B: usize>(lower: &Blocks<'_, T>, row: usize, y: &[T]) -> [T; B] {
    let range = lower.pointers[row]..lower.pointers[row + 1];
    let mut sums = [[T::zero(); B]; B];
    let blocks = lower.values[range.start * B * B..range.end * B * B].chunks_exact(B * B);
    for (&column, block) in lower.columns[range].iter().zip(blocks) {
        let y: [T; B] = node(y, column as usize);
        for c in 0..B {
            for r in 0..B {
                sums[c][r] += block[c * B + r] * y[c];
            }
        }
    }
    std::array::from_fn(|r| (0..B).map(|c| sums[c][r]).sum())
}

/// `y_J += sign L_IJᵀ x` for all J of block row I.
#[inline]
fn scatter<T: Scalar, const B: usize>(lower: &Blocks<'_, T>, row: usize, x: [T; B], y: &mut [T]) {
    let range = lower.pointers[row]..lower.pointers[row + 1];
    let blocks = lower.values[range.start * B * B..range.end * B * B].chunks_exact(B * B);
    for (&column, block) in lower.columns[range].iter().zip(blocks) {
        let y = &mut y[column as usize * B..][..B];
        for c in 0..B {
            let mut sum = T::zero();
            for r in 0..B {
                sum += block[c * B + r] * x[r];
            }
            y[c] += sum;
        }
    }
}

/// `q = (1 + L + Lᵀ) p`.
#[inline]
fn product<T: Scalar, const B: usize>(lower: &Blocks<'_, T>, p: &[T], q: &mut [T]) {
    q.copy_from_slice(p);
    for row in 0..p.len() / B {
        let sum: [T; B] = gather(lower, row, p);
        for (q, sum) in q[row * B..(row + 1) * B].iter_mut().zip(sum) {
            *q += sum;
        }
        scatter::<T, B>(lower, row, node(p, row), q);
    }
}

/// `x ← (1 + L)⁻¹ x`.
#[inline]
fn forward<T: Scalar, const B: usize>(lower: &Blocks<'_, T>, x: &mut [T]) {
    for row in 0..x.len() / B {
        let sum: [T; B] = gather(lower, row, x);
        for (x, sum) in x[row * B..(row + 1) * B].iter_mut().zip(sum) {
            *x -= sum;
        }
    }
}

/// `x ← (1 + Lᵀ)⁻¹ x`.
#[inline]
fn backward<T: Scalar, const B: usize>(lower: &Blocks<'_, T>, x: &mut [T]) {
    for row in (0..x.len() / B).rev() {
        let own: [T; B] = node(x, row);
        scatter::<T, B>(lower, row, own.map(|x| -x), x);
    }
}

/// `z = (K Kᵀ)⁻¹ r` with an incomplete factor K: blocks below the diagonal, and the inverses of the diagonal blocks.
#[inline]
fn incomplete<T: Scalar, const B: usize>(factor: &Blocks<'_, T>, inverses: &[T], r: &[T], z: &mut [T]) {
    z.copy_from_slice(r);
    let nodes = r.len() / B;
    for row in 0..nodes {
        let (sum, own): ([T; B], [T; B]) = (gather(factor, row, z), node(z, row));
        let inverse = &inverses[row * B * B..(row + 1) * B * B];
        let own = lower_product::<T, B>(inverse, std::array::from_fn(|k| own[k] - sum[k]));
        z[row * B..(row + 1) * B].copy_from_slice(&own);
    }
    for row in (0..nodes).rev() {
        let inverse = &inverses[row * B * B..(row + 1) * B * B];
        let own = lower_transposed::<T, B>(inverse, node(z, row));
        z[row * B..(row + 1) * B].copy_from_slice(&own);
        scatter::<T, B>(factor, row, own.map(|x| -x), z);
    }
}

/// Scales a matrix: `values` and `diagonal` hold its blocks and are replaced by C_I⁻¹ A_IJ C_J⁻ᵀ and C_I⁻¹, with the
/// Cholesky factors C_I of the diagonal blocks. `Err` is the dof of a pivot that is not positive.
#[inline]
pub(crate) fn scale<T: Scalar, const B: usize>(
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

/// Incomplete Cholesky factor, in the pattern, of a scaled matrix with `shift` added to its diagonal; returns whether
/// all pivots were positive.
#[inline]
pub(crate) fn factorize<T: Scalar, const B: usize>(
    lower: &Blocks<'_, T>,
    shift: T,
    values: &mut [T],
    inverses: &mut [T],
) -> bool {
    let Blocks { pointers, columns, .. } = *lower;
    for row in 0..pointers.len() - 1 {
        let mut diagonal: Block<T, B> = [[T::zero(); B]; B];
        for (k, column) in diagonal.iter_mut().enumerate() {
            column[k] = T::one() + shift;
        }
        for at in pointers[row]..pointers[row + 1] {
            let column = columns[at] as usize;
            let mut own: Block<T, B> = block(&lower.values[at * B * B..(at + 1) * B * B]);
            let (mut i, mut j) = (pointers[row], pointers[column]);
            while i < at && j < pointers[column + 1] {
                match columns[i].cmp(&columns[j]) {
                    std::cmp::Ordering::Less => i += 1,
                    std::cmp::Ordering::Greater => j += 1,
                    std::cmp::Ordering::Equal => {
                        let (left, right) = (&values[i * B * B..(i + 1) * B * B], &values[j * B * B..(j + 1) * B * B]);
                        for c in 0..B {
                            for r in 0..B {
                                for k in 0..B {
                                    own[c][r] -= left[k * B + r] * right[k * B + c];
                                }
                            }
                        }
                        (i, j) = (i + 1, j + 1);
                    }
                }
            }
            let inverse = &inverses[column * B * B..(column + 1) * B * B];
            let rows: Block<T, B> = std::array::from_fn(|r| lower_product(inverse, std::array::from_fn(|c| own[c][r])));
            own = std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c]));
            for (c, column) in diagonal.iter_mut().enumerate() {
                for (r, sum) in column.iter_mut().enumerate() {
                    for own in &own {
                        *sum -= own[r] * own[c];
                    }
                }
            }
            store(&own, &mut values[at * B * B..(at + 1) * B * B]);
        }
        let Ok(inverse) = inverse_factor::<T, B>(&diagonal) else { return false };
        store(&inverse, &mut inverses[row * B * B..(row + 1) * B * B]);
    }
    true
}

/// The criteria that end an iteration, tested after each step.
pub(super) struct Judge {
    tolerance: f64,
    /// The squared norm of the right-hand side.
    first: f64,
    /// Σ α ρ: the squared length of the present solution in the norm of the matrix (Hestenes and Stiefel, 1952,
    /// theorem 6:1: directions are orthogonal in that norm).
    pub(super) length: f64,
    /// Squared, like lengths.
    resolution: f64,
    iterations: usize,
    limit: usize,
}

impl Judge {
    pub(super) fn new([tolerance, resolution]: [f64; 2], limit: usize, first: f64) -> Self {
        Self { tolerance, first, length: 0.0, resolution: resolution * resolution, iterations: 0, limit }
    }

    fn begin(&mut self, first: f64) {
        self.first = first;
    }

    /// After a step α along a direction, with ρ before and after it.
    pub(super) fn outcome(&mut self, alpha: f64, before: f64, after: f64) -> Option<Outcome> {
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

/// For a solution x, xᵀAx over xᵀdiag(A)x is at least the smallest eigenvalue. Below this many units of rounding
/// fewer than two of its digits are significant: the matrix is singular to working precision.
pub(super) const NEGLIGIBLE: f64 = 64.0;

/// Solves A x = b in place, starting from zero.
#[inline]
pub(crate) fn solve<T: Scalar, const B: usize>(
    iteration: &Iteration<'_, T>,
    b: &mut [T],
    vectors: Vectors<'_, T>,
) -> Outcome {
    let Iteration { lower, scaling, sweeps, .. } = iteration;
    let Vectors { x, r, p, t, q } = vectors;
    let blocks = scaling.chunks_exact(B * B);
    for ((b, r), inverse) in b.chunks_exact(B).zip(r.chunks_exact_mut(B)).zip(blocks) {
        r.copy_from_slice(&lower_product::<T, B>(inverse, node(b, 0)));
    }
    let largest = r.iter().fold(T::zero(), |largest, r| if r.abs() <= largest { largest } else { r.abs() });
    if !largest.is_finite() || r.iter().any(|r| r.is_nan()) {
        b.fill(T::nan());
        return Outcome::Converged { iterations: 0 };
    }
    if largest == T::zero() {
        b.fill(T::zero());
        return Outcome::Converged { iterations: 0 };
    }
    // Scaled by a power of two, without rounding: squares of small forces stay in range.
    #[allow(clippy::cast_possible_truncation)]
    let least = T::min_positive_value().value().log2() as i32 + 8;
    #[allow(clippy::cast_possible_truncation)]
    let exponent = (largest.value().log2().floor() as i32).max(least);
    let (down, up) = (T::of(2.0_f64.powi(-exponent)), T::of(2.0_f64.powi(exponent)));
    for r in r.iter_mut() {
        *r *= down;
    }
    x.fill(T::zero());
    let mut judge = Judge::new([iteration.tolerance, iteration.resolution], iteration.limit, 0.0);
    let outcome = match sweeps {
        Sweeps::GaussSeidel => gauss_seidel::<T, B>(lower, &mut judge, [x, r, p, t, q]),
        Sweeps::Nodes => preconditioned::<T, B>(lower, &mut judge, [x, r, p, t, q], |r, z| z.copy_from_slice(r)),
        Sweeps::Incomplete { factor, inverses } => {
            preconditioned::<T, B>(lower, &mut judge, [x, r, p, t, q], |r, z| {
                incomplete::<T, B>(factor, inverses, r, z);
            })
        }
    };
    // The last direction is in t.
    let suspect = match outcome {
        Outcome::Indefinite { .. } => Some(&*t),
        Outcome::Converged { .. } if judge.length <= NEGLIGIBLE * T::epsilon().value() * dot(x, x) => Some(&*x),
        _ => None,
    };
    if let Some(p) = suspect {
        // The diagonal is one.
        product::<T, B>(lower, p, q);
        let shares = p.iter().zip(q.iter()).map(|(&p, &q)| (p * q).value());
        let worst = shares.enumerate().fold((0, f64::INFINITY), |w, (i, x)| if x < w.1 { (i, x) } else { w });
        let curvature = dot(p, q) / dot(p, p);
        // An overflowing solution indicates a singular matrix.
        return Outcome::Indefinite { curvature: if curvature.is_nan() { 0.0 } else { curvature }, dof: worst.0 };
    }
    for ((b, x), inverse) in b.chunks_exact_mut(B).zip(x.chunks_exact(B)).zip(scaling.chunks_exact(B * B)) {
        b.copy_from_slice(&lower_transposed::<T, B>(inverse, node(x, 0)).map(|x| up * x));
    }
    outcome
}

/// With the preconditioner (1 + L)(1 + Lᵀ), in a form in which a step costs only one product (Eisenstat, 1981): in
/// the variables (1 + Lᵀ) x the product with a direction p is t + (1 + L)⁻¹ (p − t), where t = (1 + Lᵀ)⁻¹ p.
#[inline]
fn gauss_seidel<T: Scalar, const B: usize>(
    lower: &Blocks<'_, T>,
    judge: &mut Judge,
    [x, r, p, t, y]: [&mut [T]; 5],
) -> Outcome {
    forward::<T, B>(lower, r);
    let mut rho = dot(r, r);
    judge.begin(rho);
    p.copy_from_slice(r);
    loop {
        t.copy_from_slice(p);
        backward::<T, B>(lower, t);
        let mut curvature = 0.0;
        for row in 0..p.len() / B {
            let sum: [T; B] = gather(lower, row, y);
            for (k, sum) in (row * B..).zip(sum) {
                y[k] = p[k] - t[k] - sum;
                curvature += (p[k] * (t[k] + y[k])).value();
            }
        }
        if !(curvature > 0.0 && curvature.is_finite()) {
            return Outcome::Indefinite { curvature, dof: 0 };
        }
        let step = rho / curvature;
        let alpha = T::of(step);
        for k in 0..x.len() {
            x[k] += alpha * t[k];
            r[k] -= alpha * (t[k] + y[k]);
        }
        let before = std::mem::replace(&mut rho, dot(r, r));
        if let Some(outcome) = judge.outcome(step, before, rho) {
            return outcome;
        }
        let beta = T::of(rho / before);
        for (p, &r) in p.iter_mut().zip(r.iter()) {
            *p = r + beta * *p;
        }
    }
}

/// With any preconditioner.
#[inline]
fn preconditioned<T: Scalar, const B: usize>(
    lower: &Blocks<'_, T>,
    judge: &mut Judge,
    [x, r, z, p, q]: [&mut [T]; 5],
    apply: impl Fn(&[T], &mut [T]),
) -> Outcome {
    apply(r, z);
    let mut rho = dot(r, z);
    judge.begin(rho);
    p.copy_from_slice(z);
    loop {
        product::<T, B>(lower, p, q);
        let curvature = dot(p, q);
        if !(curvature > 0.0 && curvature.is_finite()) {
            return Outcome::Indefinite { curvature, dof: 0 };
        }
        let step = rho / curvature;
        let alpha = T::of(step);
        for k in 0..x.len() {
            x[k] += alpha * p[k];
            r[k] -= alpha * q[k];
        }
        apply(r, z);
        let before = std::mem::replace(&mut rho, dot(r, z));
        if let Some(outcome) = judge.outcome(step, before, rho) {
            return outcome;
        }
        let beta = T::of(rho / before);
        for (p, &z) in p.iter_mut().zip(z.iter()) {
            *p = z + beta * *p;
        }
    }
}
