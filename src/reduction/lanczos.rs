//! Band Lanczos for (K + σM)⁻¹ M in the inner product of M, with full reorthogonalization.
//!
//! Ruhe's band form (Math. Comp. 33, 1979; SIAM J. Sci. Stat. Comput. 5, 1984, for the spectral transformation): a
//! basis V, M-orthonormal, of which each vector is multiplied once and what is left of the product beside the basis
//! appended to it. With as many vectors ahead as motions are rigid multiple eigenvalues come together; a product with
//! nothing left shortens the band, and new random vectors lengthen it. Of Rayleigh and Ritz's pairs the residual is
//! known without another product. The basis is not restarted: two to three vectors are kept for each mode.
//!
//! Where M is singular vectors may gather parts of its null space, which no product with M sees: what is taken for a
//! mode is multiplied once more.

use super::pencil::Pencil;
use crate::error::{Error, Result};
use crate::kernels::dense::{add_product, symmetric_eigen, transposed_product};
use crate::memory;
use crate::sparse::scattered_signed;

/// What is left of a product beside the basis counts as nothing below this share.
const NOTHING: f64 = 1e-14;

/// Residual of a pair that counts as converged, over its eigenvalue of (K + σM)⁻¹ M.
const CONVERGED: f64 = 1e-10;

/// Eigenpairs that have converged without one missing between them, by ascending frequency.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    /// Eigenvalues of K − λM as Ritz's values say.
    pub(super) values: Vec<f64>,
    /// Their vectors over the first `size` of the basis, column by column.
    vectors: Vec<f64>,
    size: usize,
}

#[derive(Debug)]
pub(super) struct Lanczos {
    n: usize,
    /// Vectors found before, M-orthonormal, to which the basis is orthogonal, and how many there are.
    locked: Vec<f64>,
    basis: Vec<f64>,
    count: usize,
    /// How many vectors have been multiplied, and the coefficients of their products by the basis.
    done: usize,
    columns: Vec<Vec<f64>>,
    /// Number of random vectors so far.
    drawn: usize,
    pub(super) block: usize,
    /// No vector is left beside the basis.
    pub(super) exhausted: bool,
}

impl Lanczos {
    /// With a band of `block`.
    pub(super) fn new(n: usize, block: usize, locked: Vec<f64>) -> Self {
        Self { n, locked, basis: Vec::new(), count: 0, done: 0, columns: Vec::new(), drawn: 0, block, exhausted: false }
    }

    /// Vectors in the basis.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Appends random vectors, as many as the band is wide, in the range of (K + σM)⁻¹ M.
    pub(super) fn draw(&mut self, pencil: &mut Pencil) -> Result<()> {
        let n = self.n;
        let numbers: Vec<f64> = (0..n * self.block).map(|k| scattered_signed(self.drawn * n + k)).collect();
        self.drawn += self.block;
        let mut vectors = vec![0.0; numbers.len()];
        pencil.mass_product(&numbers, &mut vectors);
        pencil.solve(&mut vectors)?;
        let before = self.count;
        self.append(pencil, &mut vectors, 0)?;
        self.exhausted = self.count == before;
        Ok(())
    }

    /// Multiplies the vectors ahead.
    pub(super) fn advance(&mut self, pencil: &mut Pencil) -> Result<()> {
        if self.done == self.count {
            self.draw(pencil)?;
        }
        let ahead = self.done..self.count.min(self.done + self.block);
        if ahead.is_empty() {
            return Ok(());
        }
        let n = self.n;
        let mut vectors = memory::zeros(n, ahead.len(), "Lanczos vectors")?;
        pencil.mass_product(&self.basis[ahead.start * n..ahead.end * n], &mut vectors);
        pencil.solve(&mut vectors)?;
        // (But for rounding these have parts of the last vectors of the basis only.)
        let columns = self.append(pencil, &mut vectors, ahead.start.saturating_sub(2 * self.block))?;
        self.columns.extend(columns);
        self.done = ahead.end;
        Ok(())
    }

    /// Takes what vectors have of the basis, returns the coefficients, and appends what is left, normalized. Most of
    /// what they have is of the basis from `recent` on.
    fn append(&mut self, pencil: &mut Pencil, vectors: &mut [f64], recent: usize) -> Result<Vec<Vec<f64>>> {
        let n = self.n;
        let width = vectors.len() / n;
        let mut products = memory::zeros(n, width, "Lanczos vectors")?;
        pencil.mass_product(vectors, &mut products);
        let before: Vec<f64> = norms(n, vectors, &products);
        let mut columns = vec![vec![0.0; self.count]; width];
        // Twice is enough (Kahan; Giraud, Langou, Rozložník, van den Eshof 2005).
        for from in [recent, 0] {
            remove(n, &self.locked, &products, vectors);
            let coefficients = remove(n, &self.basis[from * n..], &products, vectors);
            for (column, added) in columns.iter_mut().zip(coefficients.chunks_exact((self.count - from).max(1))) {
                column[from..].iter_mut().zip(added).for_each(|(c, x)| *c += x);
            }
            pencil.mass_product(vectors, &mut products);
        }
        let first = self.count;
        for (k, column) in columns.iter_mut().enumerate() {
            let vector = &mut vectors[k * n..(k + 1) * n];
            let product = &mut products[k * n..(k + 1) * n];
            column.resize(self.count, 0.0);
            for _ in 0..2 {
                let coefficients = remove(n, &self.basis[first * n..], product, vector);
                column[first..].iter_mut().zip(&coefficients).for_each(|(c, x)| *c += x);
                pencil.mass_product(vector, product);
            }
            let norm = norms(n, vector, product)[0];
            if !norm.is_finite() {
                return Err(Error::ModeResidual { mode: self.count, residual: norm, tolerance: NOTHING });
            }
            if norm <= NOTHING * before[k] {
                continue;
            }
            // A small rest is orthogonal to rounding of what it was before only: once more, at its own length.
            for x in vector.iter_mut() {
                *x /= norm;
            }
            let mut length = 1.0;
            if norm < 0.1 * before[k] {
                for _ in 0..2 {
                    pencil.mass_product(vector, product);
                    remove(n, &self.locked, product, vector);
                    remove(n, &self.basis, product, vector);
                }
                pencil.mass_product(vector, product);
                length = norms(n, vector, product)[0];
            }
            if length > 0.1 {
                memory::grow(&mut self.basis, n, self.count + 1, "Lanczos vectors")?;
                let place = self.count * n;
                self.basis[place..].iter_mut().zip(&*vector).for_each(|(b, x)| *b = *x / length);
                column.push(norm);
                self.count += 1;
            }
        }
        Ok(columns)
    }

    /// The pairs of least frequency that have converged, up to the first that has not.
    pub(super) fn pairs(&self, shift: f64) -> Option<Pairs> {
        let p = self.done;
        // σ times the projection is a pure number: the same in any units, bit for bit if these are powers of two.
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
            // (Columns are of the length that the basis had.)
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

/// Takes what vectors have of an M-orthonormal basis; `products` are M times the vectors. Returns the coefficients.
pub(super) fn remove(n: usize, basis: &[f64], products: &[f64], vectors: &mut [f64]) -> Vec<f64> {
    let mut coefficients = vec![0.0; basis.len() / n * (products.len() / n)];
    if !coefficients.is_empty() {
        transposed_product(n, basis, products, &mut coefficients);
        add_product(-1.0, n, basis, &coefficients, vectors);
    }
    coefficients
}

/// Lengths in the inner product of M.
fn norms(n: usize, vectors: &[f64], products: &[f64]) -> Vec<f64> {
    let dot = |(x, y): (&[f64], &[f64])| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>().max(0.0).sqrt();
    vectors.chunks_exact(n).zip(products.chunks_exact(n)).map(dot).collect()
}
