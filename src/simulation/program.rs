//! A tableau compiled for one system and one step size: scaled coefficients and factorized effective matrices.

use crate::contact::ContactJacobian;
use crate::error::{Error, Result};
use crate::linear_solver::{Factorization, LinearSolver};
use crate::mass::Mass;
use crate::memory;
use crate::real::Real;
use crate::sparse::Combination;
use crate::state::Motion;
use crate::system::{System, TangentWeights};
use crate::tableau::{MAX_PAST, Row, Rows, Stage, Tableau};

/// One term of a row: coefficient times one field of one past state.
///
/// Displacements of older states (field 0, state ≥ 1) enter as differences from the newest: their coefficients times u
/// would leave eps u/h in a velocity, the differences are exact.
#[derive(Clone, Copy, Debug)]
struct Term<T> {
    c: T,
    state: usize,
    field: usize,
}

impl<T> Term<T> {
    fn is_difference(&self) -> bool {
        self.field == 0 && self.state > 0
    }
}

/// Three rows with h multiplied in: parts of u, v, a that come from the past, and the weights of the increment d.
#[derive(Debug)]
pub(crate) struct ScaledRows<T> {
    terms: [Vec<Term<T>>; 3],
    pub(crate) weights: [T; 3],
}

/// Dofs a block: what it touches stays in the first-level cache.
const BLOCK: usize = 1024;

impl<T: Real> ScaledRows<T> {
    fn new(rows: &Rows, h: f64) -> Self {
        // Row i gives h^i times its quantity, column j of a past state is h^j times the stored one.
        let scale = |row: usize, field: usize| match field.abs_diff(row) {
            0 => 1.0,
            1 if field > row => h,
            1 => 1.0 / h,
            _ if field > row => h * h,
            _ => 1.0 / (h * h),
        };
        let compile = |i: usize, row: Row| {
            // The displacement coefficients sum to 1 (u) or 0 (v, a) in every consistent scheme, up to their own
            // rounding.
            let sum: f64 = row.u.iter().sum();
            let size: f64 = row.u.iter().map(|c| c.abs()).sum();
            let nearest = if (sum - sum.round()).abs() <= 8.0 * f64::EPSILON * size { sum.round() } else { sum };
            let coefficient = |state: usize, field: usize| match (state, field) {
                (0, 0) => nearest,
                _ => row.past(state)[field],
            };
            let mut terms: Vec<_> = (0..MAX_PAST)
                .flat_map(|state| (0..3).map(move |field| (state, field)))
                .map(|(state, field)| Term { c: T::of(coefficient(state, field) * scale(i, field)), state, field })
                .filter(|term| term.c != T::zero())
                .collect();
            // Differences last: the first term overwrites.
            terms.sort_by_key(|term: &Term<T>| (term.is_difference(), term.state, term.field));
            terms
        };
        let [u, v, a] = rows.each();
        Self {
            terms: [compile(0, u), compile(1, v), compile(2, a)],
            weights: [T::of(u.z), T::of(v.z * scale(1, 0)), T::of(a.z * scale(2, 0))],
        }
    }

    /// Whether the past has a part in u, v or a.
    pub(crate) fn reads_past(&self, field: usize) -> bool {
        !self.terms[field].is_empty()
    }

    /// Writes the parts that come from the past, block by block; fields without a term are left as they are.
    pub(crate) fn predict(&self, past: &[Motion<T>], outputs: &mut [&mut [T]; 3]) {
        let dofs = outputs[0].len();
        let mut start = 0;
        while start < dofs {
            let block = start..dofs.min(start + BLOCK);
            for (terms, output) in self.terms.iter().zip(outputs.iter_mut()) {
                let out = &mut output[block.clone()];
                for (i, term) in terms.iter().enumerate() {
                    let source = &past[term.state].field(term.field)[block.clone()];
                    match (i, term.is_difference()) {
                        (0, false) => T::scale_into(term.c, source, out),
                        (_, false) => T::axpy(term.c, source, out),
                        (i, true) => {
                            if i == 0 {
                                out.fill(T::zero());
                            }
                            T::axpy_difference(term.c, source, &past[0].u[block.clone()], out);
                        }
                    }
                }
            }
            start = block.end;
        }
    }
}

/// One stage, compiled.
#[derive(Debug)]
pub(crate) struct CompiledStage<T> {
    pub(crate) recovery: ScaledRows<T>,
    /// Only where the balance does not hold at the recovered state.
    pub(crate) balance: Option<ScaledRows<T>>,
    pub(crate) load: f64,
    pub(crate) end: f64,
    pub(crate) operator: usize,
    /// Pure z-weights of the acceleration rows, recovery and balance.
    pub(crate) acceleration: f64,
    pub(crate) balance_acceleration: f64,
    /// Change of (U, V, A) by a unit multiplier on a unit mass, in units of h²: with the covector, the impulse weight
    /// β.
    pub(crate) response: [f64; 3],
    /// Momentum covector after the stage.
    pub(crate) covector: Vec<[f64; 3]>,
    pub(crate) read: Vec<[bool; 3]>,
}

impl<T> CompiledStage<T> {
    /// β: a raw multiplier λ of the stage changes the momentum by h β λ.
    pub(crate) fn impulse_weight(&self, covector: &[[f64; 3]]) -> f64 {
        self.response.iter().zip(&covector[0]).map(|(response, psi)| response * psi).sum()
    }
}

/// A factorized effective matrix and the responses A⁻¹ Gᵀ computed with it so far.
#[derive(Debug)]
pub(crate) struct Operator<T> {
    /// (w_ū, w_v̄, w_ā): stages with the same weights share the operator.
    weights: [f64; 3],
    factor: Box<dyn Factorization<T>>,
    dofs: usize,
    columns: Vec<T>,
    computed: Vec<bool>,
}

impl<T: Real> Operator<T> {
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

/// A compiled tableau.
#[derive(Debug)]
pub(crate) struct Program<T> {
    pub(crate) stages: Vec<CompiledStage<T>>,
    pub(crate) operators: Vec<Operator<T>>,
}

/// What a program is compiled for.
pub(crate) struct Compiler<'c, T: Real> {
    pub(crate) system: &'c mut dyn System<T>,
    pub(crate) solver: &'c dyn LinearSolver<T>,
    pub(crate) h: f64,
    /// Contact rows to reserve responses for.
    pub(crate) rows: usize,
}

impl<T: Real> Compiler<'_, T> {
    /// Compiles the scheme of a run.
    pub(crate) fn compile(&mut self, tableau: &Tableau) -> Result<Program<T>> {
        let momentum = tableau.momentum();
        let books = |s: usize| (momentum.after_stage(s).to_vec(), tableau.read_after(s));
        self.stages(&tableau.stages, books)
    }

    /// Compiles the one-step scheme that starts a multistep one: what it leaves behind is read by `reader`. Its
    /// covectors change from step to step and are not part of the program.
    pub(crate) fn start(&mut self, start: &Tableau, reader: &Tableau) -> Result<Program<T>> {
        self.stages(&start.stages, |_| (Vec::new(), reader.read_after(reader.stages.len() - 1)))
    }

    fn stages(
        &mut self,
        stages: &[Stage],
        books: impl Fn(usize) -> (Vec<[f64; 3]>, Vec<[bool; 3]>),
    ) -> Result<Program<T>> {
        let mut program = Program { stages: Vec::new(), operators: Vec::new() };
        for (s, stage) in stages.iter().enumerate() {
            let weights = stage.balance.each().map(|row| row.z);
            let bits = |weights: [f64; 3]| weights.map(f64::to_bits);
            let shared = program.operators.iter().position(|operator| bits(operator.weights) == bits(weights));
            if shared.is_none() {
                program.operators.push(self.operator(stage, weights)?);
            }
            let increment = stage.increment();
            let (covector, read) = books(s);
            program.stages.push(CompiledStage {
                recovery: ScaledRows::new(&increment.recovery, self.h),
                balance: (!stage.is_collocated()).then(|| ScaledRows::new(&increment.balance, self.h)),
                load: stage.load,
                end: stage.end,
                operator: shared.unwrap_or(program.operators.len() - 1),
                acceleration: stage.recovery.a.z,
                balance_acceleration: stage.balance.a.z,
                response: stage.recovery.each().map(|row| row.z / stage.balance.a.z),
                covector,
                read,
            });
        }
        Ok(program)
    }

    /// Assembles and factorizes w_ū K + w_v̄/h C + w_ā/h² M, identity on the prescribed dofs.
    fn operator(&mut self, stage: &Stage, weights: [f64; 3]) -> Result<Operator<T>> {
        let h = self.h;
        let dofs = self.system.dofs();
        let pattern = self.system.pattern();
        let mut tangent = vec![T::zero(); pattern.row_idx().len()];
        let (combination, explicit) = {
            // Without K and C in the effective matrix its pattern is that of M.
            let explicit = weights[0] == 0.0 && weights[1] == 0.0;
            let mass_pattern = match self.system.mass() {
                Mass::Lumped(_) => None,
                Mass::Consistent(mass) => Some(mass.symbolic()),
            };
            let sources: Vec<_> = (!explicit).then_some(pattern).into_iter().chain(mass_pattern).collect();
            (Combination::new(dofs, self.system.prescribed(), &sources)?, explicit)
        };
        if !explicit {
            let weights = TangentWeights { stiffness: T::of(weights[0]), damping: T::of(weights[1] / h) };
            self.system.tangent(weights, &mut tangent)?;
        }
        let mut values = vec![T::zero(); combination.len()];
        let inertia = T::of(stage.balance.a.z / (h * h));
        let tangent = (!explicit).then_some((T::one(), &tangent[..]));
        match self.system.mass() {
            Mass::Lumped(mass) => {
                let sources: Vec<_> = tangent.into_iter().collect();
                combination.fill(&sources, Some((inertia, mass)), &mut values);
            }
            Mass::Consistent(mass) => {
                let sources: Vec<_> = tangent.into_iter().chain([(inertia, mass.val())]).collect();
                combination.fill(&sources, None, &mut values);
            }
        }
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let column = combination.pattern().col_ptr().partition_point(|&p| p <= at) - 1;
            let (row, value) = (combination.pattern().row_idx()[at], values[at].value());
            return Err(Error::MatrixNotFinite { matrix: "effective", row, column, value });
        }
        let mut factor = self.solver.analyze(combination.pattern())?;
        factor.factorize(combination.view(&values))?;
        Ok(Operator {
            weights,
            factor,
            dofs,
            columns: memory::zeros(self.rows, dofs, "the responses of the contact rows")?,
            computed: vec![false; self.rows],
        })
    }
}
