//! Residual flexibility: the static response that a truncated set of modes does not contain.

use super::lanczos::remove;
use super::pencil::Pencil;
use crate::error::{Error, Result};
use crate::memory;
use crate::rounding::{MODE_RESIDUAL, ONLY_ROUNDING};

/// Iteration limit; each iteration gains the factor σ/(ω² + σ), with ω the first frequency not among the modes.
const STEPS: usize = 2000;

/// `(G − Σ φ φᵀ/ω²) f` for columns f on the free dofs, with G the flexibility without rigid motion: the static
/// response to the part of a load that the modes do not contain. It is M-orthogonal to the modes.
///
/// Solves K x = f − M Φ Φᵀ f by Richardson's iteration with the factor of K + σM, in the complement of the modes:
/// exact for any σ, without another factorization.
pub(super) fn response(pencil: &mut Pencil, shapes: &[f64], loads: &[f64]) -> Result<Vec<f64>> {
    let n = pencil.size();
    let columns = loads.len() / n;
    let mut x = memory::zeros(n, columns, "the residual flexibility")?;
    if shapes.len() == n * n {
        return Ok(x);
    }
    let (mut step, mut rest) = (x.clone(), loads.to_vec());
    let inertia = pencil.mass.times(shapes);
    balance(n, shapes, &inertia, &mut rest);
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    // The rigid motions of a free body contain its weight: only rounding remains of such loads.
    let mut loads = loads.to_vec();
    for (load, rest) in loads.chunks_exact_mut(n).zip(rest.chunks_exact_mut(n)) {
        if norm(rest) <= ONLY_ROUNDING * norm(load) {
            load.fill(0.0);
            rest.fill(0.0);
        }
    }
    let (mut change, mut size) = (f64::INFINITY, 0.0);
    for _ in 0..STEPS {
        step.copy_from_slice(&rest);
        pencil.solve(&mut step)?;
        for _ in 0..2 {
            let products = pencil.mass.times(&step);
            remove(n, shapes, &products, &mut step);
        }
        x.iter_mut().zip(&step).for_each(|(x, d)| *x += d);
        let last = std::mem::replace(&mut change, norm(&step));
        size = norm(&x);
        // Converged as far as rounding allows.
        if change <= ONLY_ROUNDING * size || (change <= MODE_RESIDUAL * size && change >= 0.5 * last) {
            return Ok(x);
        }
        let products = pencil.stiffness.times(&x);
        rest.copy_from_slice(&loads);
        rest.iter_mut().zip(&products).for_each(|(r, f)| *r -= f);
        balance(n, shapes, &inertia, &mut rest);
    }
    let (method, residual) = ("the iteration for the residual flexibility", change / size);
    Err(Error::LinearNotConverged { method, iterations: STEPS, residual, tolerance: ONLY_ROUNDING })
}

/// Removes from loads the part that modes contain: `f − M Φ Φᵀ f`.
fn balance(n: usize, shapes: &[f64], inertia: &[f64], loads: &mut [f64]) {
    let columns = loads.len() / n;
    let mut shares = vec![0.0; shapes.len() / n * columns];
    if !shares.is_empty() {
        crate::kernels::dense::transposed_product(n, shapes, loads, &mut shares);
        crate::kernels::dense::add_product(-1.0, n, inertia, &shares, loads);
    }
}
