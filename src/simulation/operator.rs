//! Effective matrices w_ū K + w_v̄/h C + w_ā/h² M, factorized, with the responses A⁻¹Gᵀ of contact rows.

use crate::contact::ContactJacobian;
use crate::error::{Error, Result};
use crate::linear_solver::{Factorization, LinearSolver};
use crate::mass::Mass;
use crate::memory;
use crate::real::Real;
use crate::sparse::Combination;
use crate::system::{Damping, System, TangentWeights};

/// A factorized effective matrix and the responses A⁻¹ Gᵀ computed with it so far.
#[derive(Debug)]
pub(crate) struct Operator<T> {
    /// (w_ū, w_v̄, w_ā): stages with the same weights share the operator.
    weights: [f64; 3],
    tangent: Tangent,
    combination: Combination,
    factor: Box<dyn Factorization<T>>,
    dofs: usize,
    columns: Vec<T>,
    computed: Vec<bool>,
}

/// Whether K and C have a part in an effective matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tangent {
    /// Only M: an explicit stage without damping.
    Absent,
    /// w_ū K + w_v̄/h C in the pattern of the effective matrix.
    Present,
}

impl<T: Real> Operator<T> {
    /// Assembles and factorizes; memory for the responses of `rows` contact rows is reserved.
    pub(crate) fn new(
        system: &mut dyn System<T>,
        solver: &dyn LinearSolver<T>,
        weights: [f64; 3],
        h: f64,
        rows: usize,
    ) -> Result<Self> {
        let dofs = system.dofs();
        let (tangent, combination) = pattern(system, weights)?;
        let factor = solver.analyze(combination.pattern())?;
        let columns = memory::zeros(rows, dofs, "the responses of the contact rows")?;
        let mut operator = Self { weights, tangent, combination, factor, dofs, columns, computed: vec![false; rows] };
        operator.factorize(system, h)?;
        Ok(operator)
    }

    /// Whether stages with these weights can use it.
    pub(crate) fn serves(&self, weights: [f64; 3]) -> bool {
        self.weights.map(f64::to_bits) == weights.map(f64::to_bits)
    }

    /// Factorizes for the step size h; responses are forgotten.
    ///
    /// After an error the factor is not usable until a factorization has succeeded.
    pub(crate) fn factorize(&mut self, system: &mut dyn System<T>, h: f64) -> Result<()> {
        let Self { weights, tangent, combination, factor, .. } = self;
        let mut values = vec![T::zero(); combination.len()];
        let mut part = Vec::new();
        if *tangent == Tangent::Present {
            part.resize(system.pattern().row_idx().len(), T::zero());
            let weights = TangentWeights { stiffness: T::of(weights[0]), damping: T::of(weights[1] / h) };
            system.tangent(weights, &mut part)?;
        }
        let inertia = T::of(weights[2] / (h * h));
        let part = (*tangent == Tangent::Present).then_some((T::one(), &part[..]));
        match system.mass() {
            Mass::Lumped(mass) => {
                let sources: Vec<_> = part.into_iter().collect();
                combination.fill(&sources, Some((inertia, mass)), &mut values);
            }
            Mass::Consistent(mass) => {
                let sources: Vec<_> = part.into_iter().chain([(inertia, mass.val())]).collect();
                combination.fill(&sources, None, &mut values);
            }
        }
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let column = combination.pattern().col_ptr().partition_point(|&p| p <= at) - 1;
            let (row, value) = (combination.pattern().row_idx()[at], values[at].value());
            return Err(Error::MatrixNotFinite { matrix: "effective", row, column, value });
        }
        factor.factorize(combination.view(&values))?;
        self.reset();
        Ok(())
    }

    /// `x ← A⁻¹ x`.
    pub(crate) fn solve(&mut self, x: &mut [T]) {
        self.factor.solve(x);
    }

    /// Makes A⁻¹ G_rowᵀ available in [`response`](Self::response).
    pub(crate) fn prepare(&mut self, g: &ContactJacobian<T>, row: usize, prescribed: &[usize]) {
        if !self.computed[row] {
            let column = &mut self.columns[row * self.dofs..(row + 1) * self.dofs];
            column.fill(T::zero());
            g.scatter(row, T::one(), column);
            for &dof in prescribed {
                column[dof] = T::zero();
            }
            self.factor.solve(column);
            self.computed[row] = true;
        }
    }

    /// A⁻¹ G_rowᵀ.
    pub(crate) fn response(&self, row: usize) -> &[T] {
        &self.columns[row * self.dofs..(row + 1) * self.dofs]
    }

    /// Forgets responses to rows that have changed.
    pub(crate) fn reset(&mut self) {
        self.computed.fill(false);
    }

    pub(crate) fn stored_values(&self) -> usize {
        self.factor.stored_values()
    }
}

/// The pattern of an effective matrix: no larger than what has a part in it.
fn pattern<T: Real>(system: &mut dyn System<T>, weights: [f64; 3]) -> Result<(Tangent, Combination)> {
    let dofs = system.dofs();
    let damped = weights[1] != 0.0 && {
        let mut force = vec![T::zero(); dofs];
        system.damping_force(&vec![T::zero(); dofs], &mut force) == Damping::Present
    };
    let tangent = match weights[0] != 0.0 || damped {
        true => Tangent::Present,
        false => Tangent::Absent,
    };
    // Damping proportional to a lumped mass leaves an explicit scheme its diagonal.
    let diagonal = tangent == Tangent::Present && weights[0] == 0.0 && has_diagonal_damping(system)?;
    let own = (tangent == Tangent::Present).then_some(system.pattern());
    let combination = match system.mass() {
        Mass::Lumped(_) if diagonal => Combination::diagonal(dofs, system.prescribed(), &[system.pattern()])?,
        Mass::Lumped(_) => Combination::new(dofs, system.prescribed(), own.as_slice())?,
        Mass::Consistent(mass) => {
            let sources: Vec<_> = own.into_iter().chain([mass.symbolic()]).collect();
            Combination::new(dofs, system.prescribed(), &sources)?
        }
    };
    Ok((tangent, combination))
}

/// Whether C has no entry off the diagonal.
fn has_diagonal_damping<T: Real>(system: &mut dyn System<T>) -> Result<bool> {
    let mut values = vec![T::zero(); system.pattern().row_idx().len()];
    system.tangent(TangentWeights { stiffness: T::zero(), damping: T::one() }, &mut values)?;
    let pattern = system.pattern();
    let on_diagonal = |column: usize| {
        let rows = pattern.row_idx_of_col_raw(column).iter().zip(&values[pattern.col_range(column)]);
        rows.into_iter().all(|(&row, &value)| row == column || value == T::zero())
    };
    Ok((0..pattern.ncols()).all(on_diagonal))
}
