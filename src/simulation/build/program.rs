//! A tableau compiled for one system and one step size: scaled coefficients, and the operator of each stage.

use crate::error::Result;
use crate::linear_solver::LinearSolver;
use crate::real::Real;
use crate::rounding::{COEFFICIENT, rounding};
use crate::simulation::build::scheme::Scheme;
use crate::simulation::operator::Operator;
use crate::simulation::operator::responses::Unit;
use crate::simulation::operator::tangent::At;
use crate::state::Motion;
use crate::system::System;
use crate::tableau::{ContactLevel, MAX_PAST, Row, Rows, Stage, StageForce, Tableau, U};
use std::ops::Range;

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

/// A row with h multiplied in: the part of u, v or a that comes from the past, and the weight of the increment d.
#[derive(Debug)]
pub(crate) struct ScaledRow<T> {
    terms: Vec<Term<T>>,
    /// The number of terms that are not differences; they come first.
    plain: usize,
    pub(crate) weight: T,
}

/// Maximum number of terms of a row.
const TERMS: usize = 3 * MAX_PAST;

/// Number of dofs per block: the vectors of a block stay in the first-level cache.
const BLOCK: usize = 1024;

impl<T: Real> ScaledRow<T> {
    /// Scales a row that gives h^`power` times its quantity: 0 for u (and h v as a length), 1 for v, 2 for a.
    fn new(row: Row, power: usize, h: f64) -> Self {
        // Column j of a past state is h^j times the stored one.
        let scale = |field: usize| match field.abs_diff(power) {
            0 => 1.0,
            1 if field > power => h,
            1 => 1.0 / h,
            _ if field > power => h * h,
            _ => 1.0 / (h * h),
        };
        // The displacement coefficients sum to 1 (u) or 0 (v, a) in every consistent scheme, up to their own rounding.
        let sum: f64 = row.u.iter().sum();
        let size: f64 = row.u.iter().map(|c| c.abs()).sum();
        let nearest = if (sum - sum.round()).abs() <= rounding(size) { sum.round() } else { sum };
        let coefficient = |state: usize, field: usize| match (state, field) {
            (0, 0) => nearest,
            _ => row.past(state)[field],
        };
        let mut terms: Vec<_> = (0..MAX_PAST)
            .flat_map(|state| (0..3).map(move |field| (state, field)))
            .map(|(state, field)| Term { c: T::of(coefficient(state, field) * scale(field)), state, field })
            .filter(|term| term.c != T::zero())
            .collect();
        // Differences last: the first term overwrites.
        terms.sort_by_key(|term: &Term<T>| (term.is_difference(), term.state, term.field));
        let plain = terms.partition_point(|term| !term.is_difference());
        Self { terms, plain, weight: T::of(row.z * scale(0)) }
    }

    /// Writes the part that comes from the past to a block of dofs; without a term the output is left as it is.
    fn predict_block(&self, past: &[Motion<T>], block: &Range<usize>, out: &mut [T]) {
        let Some(newest) = past.first() else { return };
        let mut sources = [(T::zero(), &newest.u[..0]); TERMS];
        for (source, term) in sources.iter_mut().zip(&self.terms) {
            *source = (term.c, &past[term.state].field(term.field)[block.clone()]);
        }
        let (plain, differences) = sources[..self.terms.len()].split_at(self.plain);
        T::combine(plain, differences, &newest.u[block.clone()], out);
    }

    /// Adds to the derivatives by past states what the derivatives by this row give: the transpose of
    /// [`predict_block`](Self::predict_block), for all dofs.
    pub(crate) fn transpose(&self, row: &[T], past: &mut [Motion<T>]) {
        for term in &self.terms {
            T::axpy(term.c, row, past[term.state].field_mut(term.field));
            if term.is_difference() {
                T::axpy(-term.c, row, &mut past[0].u);
            }
        }
    }

    /// The part that comes from the past at a dof, if there is any.
    pub(crate) fn past_at(&self, past: &[Motion<T>], dof: usize) -> Option<T> {
        let newest = past.first().filter(|_| !self.terms.is_empty())?;
        let term = |term: &Term<T>| {
            let value = past[term.state].field(term.field)[dof];
            term.c * if term.is_difference() { value - newest.u[dof] } else { value }
        };
        Some(self.terms.iter().map(term).sum())
    }

    /// Writes the part that comes from the past at some dofs; without a term the output is left as it is.
    pub(crate) fn predict_at(&self, past: &[Motion<T>], dofs: &[usize], out: &mut [T]) {
        let Some(newest) = past.first().filter(|_| !self.terms.is_empty()) else { return };
        let (plain, differences) = self.terms.split_at(self.plain);
        for &dof in dofs {
            let value = |term: &Term<T>| past[term.state].field(term.field)[dof];
            let sum = plain.iter().fold(T::zero(), |sum, term| sum + term.c * value(term));
            out[dof] = differences.iter().fold(sum, |sum, term| sum + term.c * (value(term) - newest.u[dof]));
        }
    }
}

fn blocks(dofs: usize) -> impl Iterator<Item = Range<usize>> {
    (0..dofs).step_by(BLOCK).map(move |start| start..dofs.min(start + BLOCK))
}

/// The rows of u, v and a, scaled.
#[derive(Debug)]
pub(crate) struct ScaledRows<T>([ScaledRow<T>; 3]);

impl<T: Real> ScaledRows<T> {
    fn new(rows: &Rows, h: f64) -> Self {
        let [u, v, a] = rows.each();
        Self([ScaledRow::new(u, 0, h), ScaledRow::new(v, 1, h), ScaledRow::new(a, 2, h)])
    }

    /// Weights of the increment d in u, v and a.
    pub(crate) fn weights(&self) -> [T; 3] {
        [0, 1, 2].map(|field| self.0[field].weight)
    }

    /// Whether u, v or a depends on the past.
    pub(crate) fn reads_past(&self, field: usize) -> bool {
        !self.0[field].terms.is_empty()
    }

    /// Adds to the derivatives by past states what the derivatives by u, v and a give.
    pub(crate) fn transpose(&self, rows: [&[T]; 3], past: &mut [Motion<T>]) {
        for (scaled, row) in self.0.iter().zip(rows) {
            scaled.transpose(row, past);
        }
    }

    /// Whether u, v or a contains differences of displacements.
    pub(crate) fn subtracts(&self, field: usize) -> bool {
        self.0[field].terms.iter().any(Term::is_difference)
    }

    /// The coefficients of a past acceleration in u and v.
    pub(crate) fn shares_of_acceleration(&self, state: usize) -> [T; 2] {
        [0, 1].map(|field| {
            let term = self.0[field].terms.iter().find(|term| (term.state, term.field) == (state, 2));
            term.map_or(T::zero(), |term| term.c)
        })
    }

    /// Writes the parts that come from the past, block by block; fields without a term are left as they are.
    pub(crate) fn predict(&self, past: &[Motion<T>], outputs: &mut [&mut [T]; 3]) {
        for block in blocks(outputs[0].len()) {
            for (row, output) in self.0.iter().zip(outputs.iter_mut()) {
                row.predict_block(past, &block, &mut output[block.clone()]);
            }
        }
    }
}

/// The quantity that contact constrains, if it is not the displacement of the stage's own state.
#[derive(Debug)]
pub(crate) struct ContactTarget<T> {
    /// Displacements ahead of the state, or h times a velocity: both are lengths.
    pub(crate) row: ScaledRow<T>,
    /// The fraction of the step at which the target is evaluated.
    pub(crate) at: f64,
    /// At velocity level: displacements of the forecast, and their fraction of the step.
    pub(crate) forecast: Option<(ScaledRow<T>, f64)>,
}

impl<T: Real> ContactTarget<T> {
    fn new(stage: &Stage, h: f64) -> Option<Self> {
        let row = ScaledRow::new(stage.increment().contact_row(), 0, h);
        match stage.contact {
            ContactLevel::POSITION => None,
            ContactLevel::Position { .. } => Some(Self { row, at: stage.contact_at(), forecast: None }),
            ContactLevel::Velocity { forecast, forecast_at, .. } => {
                let forecast = Some((ScaledRow::new(forecast, 0, h), forecast_at));
                Some(Self { row, at: stage.contact_at(), forecast })
            }
        }
    }
}

/// The displacement from the state of a stage to where contact is imposed, or from the start of the stage to its
/// state.
fn way<T: Real>(stage: &Stage, h: f64) -> ScaledRow<T> {
    let increment = stage.increment();
    ScaledRow::new(
        match stage.contact {
            ContactLevel::POSITION => increment.recovery.u - U[0],
            _ => increment.contact_row() - increment.recovery.u,
        },
        0,
        h,
    )
}

/// One stage, compiled.
#[derive(Debug)]
pub(crate) struct CompiledStage<T> {
    pub(crate) recovery: ScaledRows<T>,
    /// Only if the balance does not hold at the recovered state.
    pub(crate) balance: Option<ScaledRows<T>>,
    /// Only if contact is not imposed on the displacements of the stage's own state.
    pub(crate) contact: Option<ContactTarget<T>>,
    /// The displacement that friction uses as slip if the slip is no velocity: to where contact is imposed ahead of
    /// the state, or in the stage.
    pub(crate) way: ScaledRow<T>,
    pub(crate) load: f64,
    /// The fractions of the step at which the stage starts and ends.
    pub(crate) start: f64,
    pub(crate) end: f64,
    /// Whether the force is evaluated along the path over the stage.
    pub(crate) along_path: bool,
    pub(crate) operator: usize,
    /// Pure z-weights of the acceleration rows, recovery and balance.
    pub(crate) acceleration: f64,
    pub(crate) balance_acceleration: f64,
    /// The response to a multiplier, [`Stage::response`]: with the covector it gives the impulse weight.
    pub(crate) response: [f64; 3],
    /// Momentum covector after the stage.
    pub(crate) covector: Vec<[f64; 3]>,
    pub(crate) read: Vec<[bool; 3]>,
    /// Whether the next stage reads a.
    pub(crate) reads_acceleration: bool,
    /// Whether the balance holds at the state, no velocity row reads an acceleration, and no row reads the step
    /// before.
    pub(crate) keeps_balance: bool,
}

impl<T: Real> CompiledStage<T> {
    /// A stage whose unknown is the displacement itself, solved for at the end of the step.
    pub(crate) fn of_displacements() -> Self {
        let row = |weight: f64| ScaledRow { terms: Vec::new(), plain: 0, weight: T::of(weight) };
        Self {
            recovery: ScaledRows([row(1.0), row(0.0), row(0.0)]),
            balance: None,
            contact: None,
            way: row(1.0),
            load: 1.0,
            start: 0.0,
            end: 1.0,
            along_path: false,
            operator: 0,
            acceleration: 0.0,
            balance_acceleration: 0.0,
            response: [1.0, 0.0, 0.0],
            covector: Vec::new(),
            read: Vec::new(),
            reads_acceleration: false,
            keeps_balance: false,
        }
    }

    /// The rows of the motion at which the balance holds.
    pub(crate) fn balanced(&self) -> &ScaledRows<T> {
        self.balance.as_ref().unwrap_or(&self.recovery)
    }
}

/// A compiled tableau.
#[derive(Debug)]
pub(crate) struct Program<T> {
    pub(crate) stages: Vec<CompiledStage<T>>,
    pub(crate) operators: Vec<Operator<T>>,
}

impl<T: Real> Program<T> {
    /// Recompiles the same stages for another step size. After an error the program is unchanged. Matrices that vary
    /// are left to the iterations of the step.
    fn set_step_size(
        &mut self,
        stages: &[Stage],
        system: &mut dyn System<T>,
        old: f64,
        h: f64,
        at: At<'_, T>,
    ) -> Result<()> {
        for i in 0..self.operators.len() {
            if self.operators[i].varies() {
                continue;
            }
            if let Err(error) = self.operators[i].factorize(system, h, at) {
                // They were factorized for the old size before. If the host's tangent fails now, the first error is
                // returned.
                let mut constant = self.operators[..=i].iter_mut().filter(|operator| !operator.varies());
                constant.try_for_each(|operator| operator.factorize(system, old, at)).ok();
                return Err(error);
            }
        }
        for (compiled, stage) in self.stages.iter_mut().zip(stages) {
            let increment = stage.increment();
            compiled.recovery = ScaledRows::new(&increment.recovery, h);
            compiled.balance = (!stage.is_collocated()).then(|| ScaledRows::new(&increment.balance, h));
            compiled.contact = ContactTarget::new(stage, h);
            compiled.way = way(stage, h);
        }
        Ok(())
    }
}

/// The scheme of a run, compiled for its system and its present step size.
pub(crate) struct Compiled<T: Real> {
    pub(crate) program: Program<T>,
    /// The one-step scheme of the first steps; none once the past is known.
    pub(crate) startup: Option<Program<T>>,
    /// The step size for which both are compiled.
    pub(crate) h: f64,
}

impl<T: Real> Compiled<T> {
    /// Recompiles for the step size h. After an error the programs are as before.
    pub(crate) fn set_step_size(
        &mut self,
        scheme: &Scheme<'_>,
        system: &mut dyn System<T>,
        h: f64,
        at: At<'_, T>,
    ) -> Result<()> {
        let old = self.h;
        let (stages, starter) = (&scheme.tableau.stages, &scheme.derived.starter.stages);
        self.program.set_step_size(stages, system, old, h, at)?;
        if let Some(startup) = &mut self.startup
            && let Err(error) = startup.set_step_size(starter, system, old, h, at)
        {
            self.program.set_step_size(stages, system, h, old, at)?;
            return Err(error);
        }
        self.h = h;
        Ok(())
    }
}

/// The data for which a program is compiled.
pub(crate) struct Compiler<'c, T: Real> {
    pub(crate) system: &'c mut dyn System<T>,
    pub(crate) solver: &'c dyn LinearSolver<T>,
    pub(crate) h: f64,
    /// Where tangents are first evaluated.
    pub(crate) at: At<'c, T>,
    /// The free dofs that contact may ever act on.
    pub(crate) interface: &'c [usize],
    /// The unit of responses of a constant matrix.
    pub(crate) unit: Unit,
}

impl<T: Real> Compiler<'_, T> {
    /// Compiles the scheme of a run.
    pub(crate) fn compile(&mut self, tableau: &Tableau) -> Result<Program<T>> {
        let momentum = tableau.momentum();
        let momentum_after = |s: usize| Ok((momentum.after_stage(s)?.to_vec(), tableau.read_after(s)?));
        self.stages(tableau, momentum_after)
    }

    /// Compiles the one-step scheme `start` whose first steps compute the past of the multistep scheme `reader`. Its
    /// momentum covectors change from step to step and are not part of the program.
    pub(crate) fn start(&mut self, start: &Tableau, reader: &Tableau) -> Result<Program<T>> {
        self.stages(start, |_| Ok((Vec::new(), reader.reads_after(reader.stages.len() - 1))))
    }

    fn stages(
        &mut self,
        tableau: &Tableau,
        momentum_after: impl Fn(usize) -> Result<(Vec<[f64; 3]>, Vec<[bool; 3]>)>,
    ) -> Result<Program<T>> {
        let mut program = Program { stages: Vec::new(), operators: Vec::new() };
        let stages = &tableau.stages;
        let reads_no_a = |stage: &Stage| stage.recovery.v.a.iter().all(|a| a.abs() < COEFFICIENT);
        let by_velocities = tableau.depth() == 1 && stages.iter().all(reads_no_a);
        for (s, stage) in stages.iter().enumerate() {
            let weights = stage.balance.each().map(|row| row.z);
            let shared = program.operators.iter().position(|operator| operator.serves(weights));
            if shared.is_none() {
                program.operators.push(Operator::new(
                    self.system,
                    self.solver,
                    weights,
                    self.h,
                    self.at,
                    (self.interface, self.unit),
                )?);
            }
            let increment = stage.increment();
            let (covector, read) = momentum_after(s)?;
            let own = tableau.reads_after(s);
            let reads_a = |read: &[[bool; 3]]| read.iter().any(|[.., a]| *a);
            // The first steps of a multistep scheme that reads a are corrected as its own steps are.
            let is_own = own.len() == read.len() || !reads_a(&read[..]);
            let keeps_balance = is_own && by_velocities && stage.is_collocated();
            program.stages.push(CompiledStage {
                recovery: ScaledRows::new(&increment.recovery, self.h),
                balance: (!stage.is_collocated()).then(|| ScaledRows::new(&increment.balance, self.h)),
                contact: ContactTarget::new(stage, self.h),
                way: way(stage, self.h),
                load: stage.load,
                start: s.checked_sub(1).map_or(0.0, |before| stages[before].end),
                end: stage.end,
                along_path: stage.force == StageForce::AlongPath,
                operator: shared.unwrap_or(program.operators.len() - 1),
                acceleration: stage.recovery.a.z,
                balance_acceleration: stage.balance.a.z,
                response: stage.response(),
                covector,
                reads_acceleration: reads_a(&own[..]) || reads_a(&read[..]),
                read,
                keeps_balance,
            });
        }
        Ok(program)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::{CdLagrange, Composite, Houbolt, TchamwaWielgosz, TimeIntegrator};

    /// Predictions for some dofs equal the predictions for all of them, bit for bit.
    #[test]
    fn predictions_on_the_interface_are_those_of_all_dofs() {
        let motion = |state: usize| {
            let mut motion = Motion::zero(40);
            for (field, values) in [&mut motion.u, &mut motion.v, &mut motion.a].into_iter().enumerate() {
                values.iter_mut().enumerate().for_each(|(i, x)| *x = ((7 * i + 3 * field + state + 1) as f64).sin());
            }
            motion
        };
        let past: Vec<Motion<f64>> = (0..MAX_PAST).map(motion).collect();
        let schemes: [&dyn TimeIntegrator; 4] =
            [&CdLagrange, &Composite, &Houbolt, &TchamwaWielgosz::new(1.03).unwrap()];
        for stage in schemes.iter().flat_map(|scheme| scheme.tableau().stages) {
            for (power, row) in stage.increment().recovery.each().into_iter().enumerate() {
                let row = ScaledRow::new(row, power, 0.037);
                let (mut all, mut some) = (vec![0.5; 40], vec![0.5; 40]);
                row.predict_block(&past, &(0..40), &mut all);
                row.predict_at(&past, &[0, 3, 17, 39], &mut some);
                for dof in 0..40 {
                    let expected = if [0, 3, 17, 39].contains(&dof) { all[dof] } else { 0.5 };
                    assert_eq!(some[dof].to_bits(), expected.to_bits());
                }
            }
        }
    }
}
