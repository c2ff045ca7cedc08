//! Band Lanczos for (K + σM)⁻¹ M in the inner product of M, with full reorthogonalization.
//!
//! Ruhe's band form (Math. Comp. 33, 1979; SIAM J. Sci. Stat. Comput. 5, 1984, for the spectral transformation): each
//! vector of an M-orthonormal basis V is multiplied once, and the part of the product orthogonal to the basis is
//! appended. If the band is at least as wide as the number of rigid motions, multiple eigenvalues are found together.
//! A product without a new part shortens the band, and new random vectors widen it. The residual of Rayleigh–Ritz
//! pairs is known without another product. The basis is not restarted: two to three vectors are kept for each mode.
//!
//! If M is singular, vectors may acquire components in its null space, which products with M do not detect: candidate
//! modes are multiplied once more.

use super::pencil::Pencil;
use crate::dense::dot;
use crate::error::{Error, Result};
use crate::kernels::dense::{add_product, symmetric_eigen, transposed_product};
use crate::memory;
use crate::rounding::{MODE_RESIDUAL, ONLY_ROUNDING};
use crate::sparse::scattered_signed;

/// A vector that keeps less than this share of its length has lost more than a digit of its orthogonality, and is
/// orthogonalized again.
const KEPT: f64 = 0.1;

/// Residual of a pair that counts as converged, over its eigenvalue of (K + σM)⁻¹ M.
const CONVERGED: f64 = 0.1 * MODE_RESIDUAL;

/// Converged eigenpairs without gaps, by ascending frequency.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    /// Eigenvalues of K − λM from the Ritz values.
    pub(super) values: Vec<f64>,
    /// Their vectors over the first `size` of the basis, column by column.
    vectors: Vec<f64>,
    size: usize,
}

#[derive(Debug)]
pub(super) struct Lanczos {
    n: usize,
    /// Earlier M-orthonormal vectors, to which the basis is orthogonal, and the number of vectors in the basis.
    locked: Vec<f64>,
    basis: Vec<f64>,
    count: usize,
    /// M times the vectors of the basis from the `kept`-th on: the vectors of the band.
    products: Vec<f64>,
    kept: usize,
    /// Number of multiplied vectors, and the coefficients of their products in the basis.
    done: usize,
    columns: Vec<Vec<f64>>,
    /// Number of random vectors so far.
    drawn: usize,
    pub(super) block: usize,
    /// No vector orthogonal to the basis is left.
    pub(super) exhausted: bool,
}

impl Lanczos {
    /// With a band of width `block`.
    pub(super) fn new(n: usize, block: usize, locked: Vec<f64>) -> Self {
        Self {
            n,
            locked,
            basis: Vec::new(),
            count: 0,
            products: Vec::new(),
            kept: 0,
            done: 0,
            columns: Vec::new(),
            drawn: 0,
            block,
            exhausted: false,
        }
    }

    /// Number of vectors in the basis.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Appends random vectors in the range of (K + σM)⁻¹ M, as many as the band is wide.
    pub(super) fn draw(&mut self, pencil: &mut Pencil) -> Result<()> {
        let n = self.n;
        let numbers: Vec<f64> = (0..n * self.block).map(|k| scattered_signed(self.drawn * n + k)).collect();
        self.drawn += self.block;
        let mut vectors = pencil.mass.times(&numbers);
        pencil.solve(&mut vectors)?;
        let before = self.count;
        self.append(pencil, &mut vectors)?;
        self.exhausted = self.count == before;
        Ok(())
    }

    /// Multiplies the vectors of the band.
    pub(super) fn advance(&mut self, pencil: &mut Pencil) -> Result<()> {
        if self.done == self.count {
            self.draw(pencil)?;
        }
        let ahead = self.done..self.count.min(self.done + self.block);
        if ahead.is_empty() {
            return Ok(());
        }
        let n = self.n;
        let mut vectors = self.products[(ahead.start - self.kept) * n..(ahead.end - self.kept) * n].to_vec();
        pencil.solve(&mut vectors)?;
        let columns = self.append(pencil, &mut vectors)?;
        self.columns.extend(columns);
        self.done = ahead.end;
        let kept = self.done.saturating_sub(2 * self.block).max(self.kept);
        self.products.drain(..(kept - self.kept) * n);
        self.kept = kept;
        Ok(())
    }

    /// Removes the components of vectors in the basis, returns their coefficients, and appends the normalized
    /// remainders that do not vanish.
    fn append(&mut self, pencil: &mut Pencil, vectors: &mut [f64]) -> Result<Vec<Vec<f64>>> {
        let (n, first) = (self.n, self.count);
        let width = vectors.len() / n;
        let mut products = pencil.mass.times(vectors);
        let before = norms(n, vectors, &products);
        let (mut columns, mut last) = (vec![vec![0.0; first]; width], before.clone());
        // Once is enough if little is removed, otherwise twice (Kahan; Giraud, Langou, Rozložník, van den Eshof
        // 2005).
        for _ in 0..3 {
            remove(n, &self.locked, &products, vectors);
            let coefficients = remove(n, &self.basis, &products, vectors);
            for (column, added) in columns.iter_mut().zip(coefficients.chunks(first.max(1))) {
                column.iter_mut().zip(added).for_each(|(c, x)| *c += x);
            }
            products = pencil.mass.times(vectors);
            let lengths = norms(n, vectors, &products);
            let kept = |k: usize| lengths[k] >= KEPT * last[k] || lengths[k] <= ONLY_ROUNDING * before[k];
            let are_kept = (0..width).all(kept);
            last = lengths;
            if are_kept {
                break;
            }
        }
        let each = vectors.chunks_exact_mut(n).zip(products.chunks_exact_mut(n)).zip(&mut columns).zip(&before);
        for (((vector, product), column), &before) in each {
            self.append_one(pencil, first, [vector, product], before, column)?;
        }
        Ok(columns)
    }

    /// Appends the normalized remainder of a vector without components in the basis before `first`, unless it
    /// vanishes compared with its length `before`; adds its coefficients to a column.
    fn append_one(
        &mut self,
        pencil: &mut Pencil,
        first: usize,
        [vector, product]: [&mut [f64]; 2],
        before: f64,
        column: &mut Vec<f64>,
    ) -> Result<()> {
        let n = self.n;
        column.resize(self.count, 0.0);
        let mut norm = norms(n, vector, product)[0];
        for pass in 0..4 {
            // A small remainder is no longer orthogonal to the earlier vectors.
            let from = if pass == 0 { first } else { 0 };
            let coefficients = remove(n, &self.basis[from * n..], product, vector);
            column[from..].iter_mut().zip(&coefficients).for_each(|(c, x)| *c += x);
            if pass > 0 {
                remove(n, &self.locked, product, vector);
                product.copy_from_slice(&pencil.mass.times(vector));
            } else if !coefficients.is_empty() {
                add_product(-1.0, n, &self.products[(first - self.kept) * n..], &coefficients, product);
            }
            let last = std::mem::replace(&mut norm, norms(n, vector, product)[0]);
            if !norm.is_finite() {
                return Err(Error::ModeResidual { mode: self.count, residual: norm, tolerance: ONLY_ROUNDING });
            }
            if norm <= ONLY_ROUNDING * before {
                return Ok(());
            }
            if norm >= KEPT * last {
                break;
            }
        }
        vector.iter_mut().chain(product.iter_mut()).for_each(|x| *x /= norm);
        memory::grow(&mut self.basis, n, self.count + 1, "Lanczos vectors")?;
        self.basis[self.count * n..].copy_from_slice(vector);
        self.products.extend_from_slice(product);
        column.push(norm);
        self.count += 1;
        Ok(())
    }

    /// The converged pairs of least frequency, up to the first that has not converged.
    pub(super) fn pairs(&self, shift: f64) -> Option<Pairs> {
        let p = self.done;
        // σ times the projection is dimensionless: the same in any units, bitwise if the units are powers of two.
        let entry = |i: usize, j: usize| self.columns[j].get(i).copied().unwrap_or(0.0) * shift;
        let mut matrix = vec![0.0; p * p];
        for j in 0..p {
            for i in j..p {
                matrix[i + j * p] = 0.5 * (entry(i, j) + entry(j, i));
            }
        }
        let (values, vectors) = symmetric_eigen(p, &matrix)?;
        let mut pairs = Pairs { size: p, ..Pairs::default() };
        for k in (0..p).rev() {
            let (theta, vector) = (values[k], &vectors[k * p..(k + 1) * p]);
            // Each column has the length that the basis had at that time.
            let mut rest = vec![0.0; self.count - p];
            for (column, &x) in self.columns.iter().zip(vector) {
                let below = column.get(p..).unwrap_or(&[]);
                rest.iter_mut().zip(below).for_each(|(r, c)| *r += c * x * shift);
            }
            let residual = rest.iter().map(|r| r * r).sum::<f64>().sqrt();
            if !(theta > 0.0 && residual <= CONVERGED * theta) {
                break;
            }
            pairs.values.push(shift / theta - shift);
            pairs.vectors.extend(vector);
        }
        Some(pairs)
    }

    /// The vectors of the first pairs.
    pub(super) fn vectors(&self, pairs: &Pairs, count: usize) -> Result<Vec<f64>> {
        let mut out = memory::zeros(self.n, count, "modes")?;
        if count > 0 {
            add_product(
                1.0,
                self.n,
                &self.basis[..pairs.size * self.n],
                &pairs.vectors[..count * pairs.size],
                &mut out,
            );
        }
        Ok(out)
    }
}

/// Removes the components of vectors in an M-orthonormal basis; `products` are M times the vectors. Returns the
/// coefficients.
pub(super) fn remove(n: usize, basis: &[f64], products: &[f64], vectors: &mut [f64]) -> Vec<f64> {
    let mut coefficients = vec![0.0; basis.len() / n * (products.len() / n)];
    if !coefficients.is_empty() {
        transposed_product(n, basis, products, &mut coefficients);
        add_product(-1.0, n, basis, &coefficients, vectors);
    }
    coefficients
}

/// Lengths in the inner product of M.
pub(super) fn norms(n: usize, vectors: &[f64], products: &[f64]) -> Vec<f64> {
    let pairs = vectors.chunks_exact(n).zip(products.chunks_exact(n));
    pairs.map(|(x, y)| dot(x, y).max(0.0).sqrt()).collect()
}
