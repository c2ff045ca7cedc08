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
use crate::sparse::scattered_signed;

/// A new part of a product below this share counts as zero.
const NOTHING: f64 = 1e-14;

/// A vector that keeps this share of its length has lost no orthogonality.
const ENOUGH: f64 = 0.7;

/// A vector that keeps less than this share is orthogonalized again.
const SMALL: f64 = 0.1;

/// Residual of a pair that counts as converged, over its eigenvalue of (K + σM)⁻¹ M.
const CONVERGED: f64 = 1e-10;

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
    /// Memory for vectors to be appended, and M times these.
    vectors: Vec<f64>,
    images: Vec<f64>,
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
            vectors: Vec::new(),
            images: Vec::new(),
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
        let mut vectors = vec![0.0; numbers.len()];
        pencil.mass.times_into(&numbers, &mut vectors);
        pencil.solve(&mut vectors)?;
        let before = self.count;
        self.append(pencil, &mut vectors, self.count)?;
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
        let mut vectors = std::mem::take(&mut self.vectors);
        vectors.clear();
        vectors.extend_from_slice(&self.products[(ahead.start - self.kept) * n..(ahead.end - self.kept) * n]);
        pencil.solve(&mut vectors)?;
        // Up to rounding, these have components in the last vectors of the basis only.
        let columns = self.append(pencil, &mut vectors, ahead.start.saturating_sub(2 * self.block))?;
        self.columns.extend(columns);
        self.vectors = vectors;
        self.done = ahead.end;
        let kept = self.done.saturating_sub(2 * self.block).max(self.kept);
        self.products.drain(..(kept - self.kept) * n);
        self.kept = kept;
        Ok(())
    }

    /// Removes the components of vectors in the basis, returns their coefficients, and appends the normalized
    /// remainders. The largest components are in the basis from `recent` on.
    fn append(&mut self, pencil: &mut Pencil, vectors: &mut [f64], recent: usize) -> Result<Vec<Vec<f64>>> {
        let n = self.n;
        let width = vectors.len() / n;
        let mut products = std::mem::take(&mut self.images);
        products.clear();
        memory::grow(&mut products, n, width, "Lanczos vectors")?;
        pencil.mass.times_into(vectors, &mut products);
        let before: Vec<f64> = norms(n, vectors, &products);
        let mut columns = vec![vec![0.0; self.count]; width];
        self.clear_recent(pencil, recent, [vectors, &mut products], &mut columns);
        // Once is enough if little is removed, otherwise twice (Kahan; Giraud, Langou, Rozložník, van den Eshof
        // 2005).
        let mut lengths = norms(n, vectors, &products);
        for _ in 0..3 {
            remove(n, &self.locked, &products, vectors);
            let coefficients = remove(n, &self.basis, &products, vectors);
            add(&mut columns, 0, &coefficients);
            pencil.mass.times_into(vectors, &mut products);
            let last = std::mem::replace(&mut lengths, norms(n, vectors, &products));
            let kept = |k: usize| lengths[k] >= ENOUGH * last[k] || lengths[k] <= NOTHING * before[k];
            if (0..width).all(kept) {
                break;
            }
        }
        if !self.append_together([vectors, &products], [&before, &lengths], &mut columns)? {
            self.append_singly(pencil, [vectors, &mut products], [&before, &lengths], &mut columns)?;
        }
        self.images = products;
        Ok(columns)
    }

    /// Removes components in the basis from `recent` on, and updates the products with M.
    fn clear_recent(
        &self,
        pencil: &mut Pencil,
        recent: usize,
        [vectors, products]: [&mut [f64]; 2],
        columns: &mut [Vec<f64>],
    ) {
        let n = self.n;
        let recent = recent.max(self.kept);
        if recent == self.count {
            return;
        }
        let before = norms(n, vectors, products);
        let coefficients = remove(n, &self.basis[recent * n..], products, vectors);
        add_product(-1.0, n, &self.products[(recent - self.kept) * n..], &coefficients, products);
        add(columns, recent, &coefficients);
        // If much was removed, the updated products have lost accuracy and are computed again.
        let after = norms(n, vectors, products);
        if after.iter().zip(&before).any(|(after, before)| *after < SMALL * before) {
            pencil.mass.times_into(vectors, products);
        }
    }

    /// Orthonormalizes vectors that are orthogonal to the basis by the Cholesky factor of their products, and appends
    /// them; does nothing unless all are well separated. `before` and `lengths` are their lengths before and after
    /// they were made orthogonal to the basis.
    fn append_together(
        &mut self,
        [vectors, products]: [&[f64]; 2],
        [before, lengths]: [&[f64]; 2],
        columns: &mut [Vec<f64>],
    ) -> Result<bool> {
        let (n, width) = (self.n, columns.len());
        let mut gram = vec![0.0; width * width];
        transposed_product(n, vectors, products, &mut gram);
        // U with UᵀU = VᵀMV, column by column, and U⁻¹.
        let (mut upper, mut inverse) = (vec![0.0; width * width], vec![0.0; width * width]);
        for k in 0..width {
            for j in 0..k {
                let known = dot(&upper[j * width..j * width + j], &upper[k * width..k * width + j]);
                upper[k * width + j] = (gram[k * width + j] - known) / upper[j * width + j];
            }
            let column = &upper[k * width..k * width + k];
            let pivot = (gram[k * width + k] - dot(column, column)).max(0.0).sqrt();
            let apart = pivot >= SMALL * lengths[k] && lengths[k] >= SMALL * before[k] && pivot.is_normal();
            if !apart {
                return Ok(false);
            }
            upper[k * width + k] = pivot;
            inverse[k * width + k] = 1.0 / pivot;
            for j in (0..k).rev() {
                let known: f64 = (j + 1..=k).map(|i| upper[i * width + j] * inverse[k * width + i]).sum();
                inverse[k * width + j] = -known / upper[j * width + j];
            }
        }
        for (k, column) in columns.iter_mut().enumerate() {
            column.extend(&upper[k * width..=k * width + k]);
        }
        memory::grow(&mut self.basis, n, self.count + width, "Lanczos vectors")?;
        add_product(1.0, n, vectors, &inverse, &mut self.basis[self.count * n..]);
        memory::grow(&mut self.products, n, self.count - self.kept + width, "Lanczos vectors")?;
        add_product(1.0, n, products, &inverse, &mut self.products[(self.count - self.kept) * n..]);
        self.count += width;
        Ok(true)
    }

    /// Orthonormalizes vectors that are orthogonal to the basis one by one, and appends those that do not vanish;
    /// `before` and `lengths` as above.
    fn append_singly(
        &mut self,
        pencil: &mut Pencil,
        [vectors, products]: [&mut [f64]; 2],
        [before, lengths]: [&[f64]; 2],
        columns: &mut [Vec<f64>],
    ) -> Result<()> {
        let (n, first) = (self.n, self.count);
        for (k, column) in columns.iter_mut().enumerate() {
            let vector = &mut vectors[k * n..(k + 1) * n];
            let product = &mut products[k * n..(k + 1) * n];
            column.resize(self.count, 0.0);
            for _ in 0..2 {
                let coefficients = remove(n, &self.basis[first * n..], product, vector);
                if !coefficients.is_empty() {
                    add_product(-1.0, n, &self.products[(first - self.kept) * n..], &coefficients, product);
                }
                column[first..].iter_mut().zip(&coefficients).for_each(|(c, x)| *c += x);
            }
            let mut norm = norms(n, vector, product)[0];
            if !norm.is_finite() {
                return Err(Error::ModeResidual { mode: self.count, residual: norm, tolerance: NOTHING });
            }
            let small = norm < SMALL * lengths[k];
            if small {
                pencil.mass.times_into(vector, product);
                norm = norms(n, vector, product)[0];
            }
            if norm <= NOTHING * before[k] {
                continue;
            }
            for x in vector.iter_mut().chain(product.iter_mut()) {
                *x /= norm;
            }
            // A small remainder is orthogonal only to the rounding of the original length: repeat at its own length.
            if small {
                for _ in 0..2 {
                    remove(n, &self.locked, product, vector);
                    remove(n, &self.basis, product, vector);
                    pencil.mass.times_into(vector, product);
                }
                let length = norms(n, vector, product)[0];
                if length <= SMALL {
                    continue;
                }
                for x in vector.iter_mut().chain(product.iter_mut()) {
                    *x /= length;
                }
            }
            memory::grow(&mut self.basis, n, self.count + 1, "Lanczos vectors")?;
            self.basis[self.count * n..].copy_from_slice(vector);
            self.products.extend_from_slice(product);
            column.push(norm);
            self.count += 1;
        }
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

/// Adds the coefficients of vectors in a basis to their columns, starting at row `first`.
fn add(columns: &mut [Vec<f64>], first: usize, coefficients: &[f64]) {
    let height = coefficients.len() / columns.len();
    for (column, added) in columns.iter_mut().zip(coefficients.chunks(height.max(1))) {
        column[first..].iter_mut().zip(added).for_each(|(c, x)| *c += x);
    }
}

/// Lengths in the inner product of M.
pub(super) fn norms(n: usize, vectors: &[f64], products: &[f64]) -> Vec<f64> {
    let pairs = vectors.chunks_exact(n).zip(products.chunks_exact(n));
    pairs.map(|(x, y)| dot(x, y).max(0.0).sqrt()).collect()
}
