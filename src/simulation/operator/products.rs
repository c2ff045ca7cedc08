//! Contact problems solved by products with the effective matrix, without W.

use crate::contact_solver::{Outcome, Patience, ProjectedCg, RowData, SparseProblem};
use crate::error::Result;
use crate::mass::Mass;
use crate::memory;
use crate::real::Real;
use crate::rounding::projected_residual;
use crate::simulation::operator::matrix::EffectiveMatrix;
use crate::sparse::Product;
use crate::system::System;

/// What products need of an effective matrix.
#[derive(Debug)]
pub(super) struct Products<T> {
    product: Product<T>,
    /// Whether it has the entries of the matrix, packed.
    pub(super) is_packed: bool,
    /// Number of entries at and below the diagonal that a product reads on average.
    entries: f64,
    /// D⁻¹, zero on prescribed dofs.
    inverse: Vec<T>,
    /// Products that a system without contact would take.
    expected: usize,
    cg: ProjectedCg<T>,
    /// The forces of the problem solved last, on the interface; empty if it was not solved.
    answered: Vec<T>,
    /// Whether all this belongs to the present matrix.
    pub(super) is_current: bool,
}

/// How often statuses may be decided, and how many products may be taken over those expected, before W is formed.
const LOOKS: usize = 40;
const PATIENCE: usize = 3;

/// Products up to which the iteration is chosen: with more, as at large Courant numbers and for modal coordinates,
/// their number is not well known.
const MANY_PRODUCTS: usize = 64;

/// Products that are tried in any case.
const FEW_PRODUCTS: usize = 24;

impl<T: Real> Products<T> {
    /// For contact that acts on some dofs.
    pub(super) fn new(matrix: &EffectiveMatrix<T>, system: &dyn System<T>, interface: &[usize]) -> Result<Self> {
        let mut product = Product::of_symmetric(matrix.view(system).symbolic())?;
        product.measure(interface)?;
        Ok(Self {
            product,
            is_packed: false,
            entries: 0.0,
            inverse: Vec::new(),
            expected: 0,
            cg: ProjectedCg::default(),
            answered: Vec::new(),
            is_current: false,
        })
    }

    /// Reads a matrix.
    pub(super) fn read(&mut self, matrix: &EffectiveMatrix<T>, system: &dyn System<T>, h: f64) -> Result<()> {
        let a = matrix.view(system);
        self.is_packed = self.product.pack(a)?;
        let entries = a.val().len().midpoint(a.ncols());
        let (mut whole, mut mass) = (0.0, 0.0);
        self.inverse.clear();
        memory::make_room(&mut self.inverse, a.ncols(), "the diagonal of the effective matrix")?;
        self.inverse.extend((0..a.ncols()).map(|dof| {
            let at = a.row_idx_of_col_raw(dof).binary_search(&dof).ok();
            let (Some(at), Err(_)) = (at, system.prescribed().binary_search(&dof)) else { return T::zero() };
            let own = a.val_of_col(dof)[at];
            whole += own.value();
            mass += match system.mass() {
                Mass::Lumped(mass) => mass[dof].value(),
                Mass::Consistent(mass) => mass.val_of_col(dof).iter().map(|m| m.value()).sum(),
            };
            own.recip()
        }));
        // A smooth motion has the mass of the diagonal without its stiffness; the stiffest motion has twice both.
        let condition = (2.0 * whole / (matrix.inertia(h) * mass)).max(1.0);
        let digits = (2.0 / projected_residual::<T>().value()).ln();
        let wanted = 0.5 * condition.sqrt() * digits;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; saturates if it is huge
        let count = wanted.ceil() as usize;
        self.expected = if wanted.is_finite() { count } else { usize::MAX };
        self.entries = self.product.mean_share(self.expected.min(MANY_PRODUCTS)) * entries as f64;
        self.is_current = true;
        self.begin();
        Ok(())
    }

    /// Products to be tried for rows with so many entries, if the work with W (in multiplications) is no less.
    pub(super) fn affordable(&self, entries: usize, with_w: f64) -> Option<usize> {
        let of_one = self.entries + (8 * self.inverse.len() + 8 * entries) as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; saturates if it is huge
        let count = (with_w / of_one) as usize;
        (self.expected <= count.min(MANY_PRODUCTS)).then_some(count.max(FEW_PRODUCTS))
    }

    /// The matrix is another.
    pub(super) fn forget(&mut self) {
        self.is_current = false;
        self.begin();
    }

    /// Another stage begins.
    pub(super) fn begin(&mut self) {
        self.cg.begin();
        self.answered.clear();
    }

    /// Solves for the multipliers of some rows, to a residual, with at most `affordable` products, and leaves the forces
    /// Gᵀ λ and the response A⁻¹ Gᵀ λ in two vectors on the interface.
    pub(super) fn solve(
        &mut self,
        (matrix, system, interface): (&EffectiveMatrix<T>, &dyn System<T>, &[usize]),
        data: RowData<'_, T>,
        multipliers: &mut [T],
        (affordable, residual): (usize, f64),
        [forces, response]: [&mut [T]; 2],
    ) -> Result<Outcome> {
        let Self { product, is_packed, inverse, expected, cg, answered, .. } = self;
        answered.clear();
        let mut multiply = |reach: usize, x: &[T], y: &mut [T]| match *is_packed {
            true => product.write_packed(reach, x, y),
            false => product.write(T::one(), matrix.view(system), x, y),
        };
        let products = expected.saturating_mul(PATIENCE).saturating_add(LOOKS).min(affordable);
        let patience = Patience { products, looks: LOOKS, residual };
        let mut problem = SparseProblem { product: &mut multiply, inverse, data, patience };
        let outcome = cg.solve(&mut problem, multipliers)?;
        if outcome.is_solved {
            forces.fill(T::zero());
            for (&row, &lambda) in data.rows.iter().zip(&*multipliers) {
                data.g.interface_scatter(row, lambda, forces);
            }
            memory::copy(answered, forces, "the forces of a contact problem")?;
            let solution = cg.solution();
            for (response, &dof) in response.iter_mut().zip(interface) {
                *response = solution[dof];
            }
        }
        Ok(outcome)
    }

    /// The response A⁻¹ f by dof, if f are the forces of the problem solved last.
    pub(super) fn response_to(&self, forces: &[T]) -> Option<&[T]> {
        (self.answered == forces).then(|| self.cg.solution())
    }
}
