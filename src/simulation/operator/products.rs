//! Contact problems solved by products with the effective matrix, without W.

use crate::contact_solver::{Body, Outcome, Patience, ProjectedCg, RowData, SparseProblem};
use crate::error::Result;
use crate::linear_solver::coarse_space::{Aggregates, CoarseSpace, WORTHWHILE, node_size};
use crate::memory;
use crate::ranks::Together;
use crate::real::Real;
use crate::rounding::projected_residual;
use crate::sparse::Product;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use std::ops::Range;

/// What products need of an effective matrix.
#[derive(Debug)]
pub(super) struct Products<T> {
    product: Product<T>,
    /// Whether it has the entries of the matrix, packed.
    pub(super) is_packed: bool,
    /// Number of entries at and below the diagonal that a product reads on average, and number of dofs: the most of
    /// any rank.
    entries: f64,
    dofs: f64,
    /// D⁻¹, zero on prescribed dofs.
    inverse: Vec<T>,
    /// Products that a system without contact would take.
    expected: usize,
    /// The aggregates of the nodes that contact does not act on, and their coarse space if there is one.
    aggregates: Option<Aggregates>,
    space: Option<CoarseSpace<T>>,
    deflates: bool,
    cg: ProjectedCg<T>,
    /// The forces of the problem solved last, on the interface; empty if it was not solved.
    answered: Vec<T>,
    tried: Tried,
    /// Whether all this belongs to the present matrix.
    pub(super) is_current: bool,
}

/// What became of the last problem of a stage. The next ones differ little.
#[derive(Clone, Copy, Debug)]
enum Tried {
    Nothing,
    Solved,
    Failed,
}

/// How often statuses may be decided, and how many products may be taken over those expected, before W is formed.
const LOOKS: usize = 40;
const PATIENCE: usize = 3;

/// Products up to which the iteration is chosen without a coarse space: with more, as for modal coordinates, their
/// number is not well known.
const MANY_PRODUCTS: usize = 64;

/// Products that are tried in any case.
const FEW_PRODUCTS: usize = 24;

/// Digits that conjugate gradients gain until this residual, natural ones, in the estimate of their convergence.
fn digits(residual: f64) -> f64 {
    (2.0 / residual).ln()
}

impl<T: Real> Products<T> {
    /// For contact that acts on some dofs.
    pub(super) fn new(pattern: SymbolicSparseColMatRef<'_, usize>, touched: &[usize]) -> Result<Self> {
        let mut product = Product::of_symmetric(pattern)?;
        product.measure(touched)?;
        Ok(Self {
            product,
            is_packed: false,
            entries: 0.0,
            dofs: 0.0,
            inverse: Vec::new(),
            expected: 0,
            aggregates: None,
            space: None,
            deflates: false,
            cg: ProjectedCg::default(),
            answered: Vec::new(),
            tried: Tried::Nothing,
            is_current: false,
        })
    }

    /// Reads a matrix. Contact may act on the `touched` dofs; in the columns of `fixed` dofs the diagonal is the only
    /// entry. `smooth` is the share of this rank in 1ᵀA 1, the stiffness of smooth motions.
    pub(super) fn read(
        &mut self,
        a: SparseColMatRef<'_, usize, T>,
        (touched, fixed): (&[usize], &[usize]),
        smooth: f64,
        together: &Together<T>,
    ) -> Result<()> {
        let own = self.read_diagonal(a, fixed, together).map(|own| [own, smooth]);
        let [whole, smooth] = together.sum(own)?;
        // Other ranks know the diagonal at dofs whose elements are all theirs.
        together.share(&mut self.inverse)?;
        // The stiffest motion has twice the diagonal.
        let condition = (2.0 * whole / smooth).max(1.0);
        self.deflates = together.is_alone() && condition > WORTHWHILE && self.form_coarse_space(a, touched)?;
        // With a coarse space twice the Courant number takes some 1.3 times as many products.
        let condition = if self.deflates { WORTHWHILE * (condition / WORTHWHILE).cbrt() } else { condition };
        let wanted = 0.5 * condition.sqrt() * digits(projected_residual::<T>().value());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; saturates if it is huge
        let count = wanted.ceil() as usize;
        self.expected = if wanted.is_finite() { count } else { usize::MAX };
        // Over ranks products read all entries: a dof far from contact on this rank may be near it on another.
        let share = match together.is_alone() {
            true if !self.deflates => self.product.mean_share(self.expected.min(MANY_PRODUCTS)),
            _ => 1.0,
        };
        let of_space = self.space.as_ref().filter(|_| self.deflates).map_or(0, CoarseSpace::stored_values);
        let sizes = [share * a.val().len().midpoint(a.ncols()) as f64 + of_space as f64, a.ncols() as f64];
        [self.entries, self.dofs] = together.max(Ok(sizes))?;
        self.is_current = true;
        self.begin();
        Ok(())
    }

    /// Forms the coarse space of the nodes on which no contact acts: closed rows stay closed. Returns whether there is
    /// one.
    fn form_coarse_space(&mut self, a: SparseColMatRef<'_, usize, T>, interface: &[usize]) -> Result<bool> {
        let Self { aggregates, space, .. } = self;
        let size = node_size(a.symbolic());
        let aggregates = match aggregates {
            Some(aggregates) => aggregates,
            none => none.insert(Aggregates::find(a, size, interface.iter().copied())?),
        };
        if aggregates.count < 2 {
            return Ok(false);
        }
        let space = match space {
            Some(space) => space,
            none => {
                let of_node = |node: usize| node * size..(node + 1) * size;
                let near = |node: usize| of_node(node).flat_map(|dof| a.row_idx_of_col_raw(dof)).map(|dof| dof / size);
                none.insert(CoarseSpace::new((size, a.ncols() / size), |node| aggregates.of(node), near)?)
            }
        };
        let identity = |_: usize, block: &mut [T]| block.iter_mut().step_by(size + 1).for_each(|x| *x = T::one());
        space.form(identity, |product| {
            for dof in 0..a.ncols() {
                for (&row, &value) in a.row_idx_of_col_raw(dof).iter().zip(a.val_of_col(dof)) {
                    product.add_entry(row, dof, value);
                }
            }
        })
    }

    /// Reads what this rank has. Returns the sum of the diagonal of A over the free dofs that it owns.
    fn read_diagonal(
        &mut self,
        a: SparseColMatRef<'_, usize, T>,
        fixed: &[usize],
        together: &Together<T>,
    ) -> Result<f64> {
        self.is_packed = self.product.pack(a)?;
        self.inverse.clear();
        memory::make_room(&mut self.inverse, a.ncols(), "the diagonal of the effective matrix")?;
        let free = |dof: &usize| fixed.binary_search(dof).is_err();
        let diagonal = |dof: usize| Some(a.val_of_col(dof)[a.row_idx_of_col_raw(dof).binary_search(&dof).ok()?]);
        let own = |dof: usize| diagonal(dof).filter(|own| free(&dof) && *own != T::zero());
        self.inverse.extend((0..a.ncols()).map(|dof| own(dof).map_or(T::zero(), T::recip)));
        let owned = together.owned(a.ncols()).flatten().filter(free);
        Ok(owned.map(|dof| diagonal(dof).map_or(0.0, T::value)).sum())
    }

    /// Products to be tried for a problem to a residual, of rows with so many entries, if the work with W (in
    /// multiplications) is no less. A stage goes on as its last problem has ended.
    pub(super) fn affordable(&self, entries: usize, residual: f64, with_w: f64) -> Option<usize> {
        match self.tried {
            Tried::Solved => return Some(usize::MAX),
            Tried::Failed => return None,
            Tried::Nothing => {}
        }
        let of_one = self.entries + 8.0 * self.dofs + (8 * entries) as f64;
        let expected = self.expected as f64 * digits(residual) / digits(projected_residual::<T>().value());
        let most = if self.deflates { usize::MAX } else { MANY_PRODUCTS };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; saturates if it is huge
        let count = (with_w / of_one) as usize;
        (self.expected <= most && expected <= count as f64).then_some(count.max(FEW_PRODUCTS))
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
        self.tried = Tried::Nothing;
    }

    /// Solves for the multipliers of some rows, to a residual, with at most `affordable` products, and leaves their
    /// forces Gᵀ λ on the interface. `a` is the matrix unless it is packed, `dofs` are the dofs of a part.
    pub(super) fn solve(
        &mut self,
        (a, dofs): (Option<SparseColMatRef<'_, usize, T>>, Option<&[usize]>),
        together: &Together<T>,
        data: RowData<'_, T>,
        multipliers: &mut [T],
        (affordable, residual): (usize, f64),
        forces: &mut [T],
    ) -> Result<Outcome> {
        let Self { product, inverse, expected, space, deflates, cg, answered, tried, .. } = self;
        answered.clear();
        *tried = Tried::Failed;
        let mut body = Matrix { product, space: space.as_mut().filter(|_| *deflates), a, dofs, together };
        let products = expected.saturating_mul(PATIENCE).saturating_add(LOOKS).min(affordable);
        let patience = Patience { products, looks: LOOKS, residual };
        let mut problem = SparseProblem { body: &mut body, inverse, data, patience };
        let outcome = cg.solve(&mut problem, multipliers)?;
        if outcome.is_solved {
            *tried = Tried::Solved;
            forces.fill(T::zero());
            for (&row, &lambda) in data.rows.iter().zip(&*multipliers) {
                data.g.interface_scatter(row, lambda, forces);
            }
            memory::copy(answered, forces, "the forces of a contact problem")?;
        }
        Ok(outcome)
    }

    /// The response A⁻¹ Gᵀ λ of the problem solved last, by dof.
    pub(super) fn solution(&self) -> &[T] {
        self.cg.solution()
    }

    /// The response A⁻¹ f by dof, if f are the forces of the problem solved last.
    pub(super) fn response_to(&self, forces: &[T]) -> Option<&[T]> {
        (self.answered == forces).then(|| self.solution())
    }
}

/// A matrix, of which each rank has the rows that it owns.
struct Matrix<'a, T: Real> {
    product: &'a mut Product<T>,
    space: Option<&'a mut CoarseSpace<T>>,
    /// None if the product has its entries.
    a: Option<SparseColMatRef<'a, usize, T>>,
    /// The dofs of a part of the system.
    dofs: Option<&'a [usize]>,
    together: &'a Together<T>,
}

impl<T: Real> Body<T> for Matrix<'_, T> {
    fn multiply(&mut self, reach: usize, x: &[T], y: &mut [T]) -> Result<()> {
        // With a coarse space x reaches everywhere at once, and over ranks it comes from elsewhere.
        let reach = if self.together.is_alone() && self.space.is_none() { reach } else { usize::MAX };
        match self.a {
            None => self.product.write_packed(reach, x, y),
            Some(a) => self.product.write(T::one(), a, x, y),
        }
        self.together.share(y)
    }

    fn number(&self, dof: usize) -> Option<usize> {
        self.dofs.map_or(Some(dof), |dofs| dofs.binary_search(&dof).ok())
    }

    fn sum(&self, dofs: usize, part: &dyn Fn(Range<usize>) -> T) -> Result<T> {
        let [sum] = self.together.sum(Ok([self.together.owned(dofs).map(part).sum::<T>().value()]))?;
        Ok(T::of(sum))
    }

    fn start(&mut self, r: &mut [T], x: &mut [T]) -> Result<()> {
        self.space.as_mut().map_or(Ok(()), |space| space.start(r, x).map(|_| ()))
    }

    fn turn(&mut self, p: &mut [T]) -> Result<()> {
        self.space.as_mut().map_or(Ok(()), |space| space.turn(p).map(|_| ()))
    }

    fn agree(&self, result: Result<bool>) -> Result<bool> {
        self.together.agree(result)
    }
}
