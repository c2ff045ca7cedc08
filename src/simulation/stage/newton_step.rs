//! A stage of a nonlinear system, solved by Newton's method.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::SMALL_INCREMENT;
use crate::simulation::build::program::ScaledRows;
use crate::simulation::operator::tangent::{At, TangentOf};
use crate::simulation::stage::newton::{Iteration, NewtonWork, TangentUpdate};
use crate::simulation::stage::path::PathForm;
use crate::simulation::stage::vectors::StageVectors;
use crate::simulation::stage::{Host, StageSolve};
use crate::state::Motion;
use crate::system::Path;

/// The smallest share of an increment in a line search.
const SHORTEST: f64 = 0.125;

/// The decrease of the residual that a line search demands, over the share of the increment (Armijo).
const DESCENT: f64 = 1e-4;

/// Norms at a trial state.
#[derive(Clone, Copy)]
struct Norms {
    /// Of f − M ā + Gᵀ λ.
    residual: f64,
    /// Of f, and of Gᵀ λ.
    force: f64,
    contact: f64,
}

impl Norms {
    fn scale(&self) -> f64 {
        self.force + self.contact
    }

    fn relative(&self) -> f64 {
        if self.residual > 0.0 { self.residual / self.scale() } else { 0.0 }
    }
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Solves a stage by Newton's method.
    pub(crate) fn solve_nonlinear(&mut self, newton: &mut NewtonWork<T>) -> Result<()> {
        self.begin_iterations(newton);
        // Contact reads the iterate while the stage is solved, and only then.
        std::mem::swap(&mut newton.d, &mut self.vectors.iterate);
        let result = self.iterate(newton);
        std::mem::swap(&mut newton.d, &mut self.vectors.iterate);
        result
    }

    /// Iterates until the balance and the contact conditions hold.
    fn iterate(&mut self, newton: &mut NewtonWork<T>) -> Result<()> {
        let mut norms = self.evaluate_residual(newton)?;
        newton.residuals.push(norms.residual);
        for iteration in 0..newton.settings.iterations {
            if self.operator.varies() && (iteration == 0 || newton.settings.tangent == TangentUpdate::Iteration) {
                self.factorize(iteration, newton)?;
            }
            newton.residual.copy_from_slice(&self.vectors.increment);
            self.statistics.newton_iterations += 1;
            let converged = self.solve_linearized().map_err(|error| self.in_iteration(error, iteration))?;
            self.refuse_nan(&self.vectors.increment, "the increment")?;
            let residual = self.loaded_square(&newton.residual);
            let increment = self.square(&self.vectors.increment);
            let [residual, size] = self.host.together.sum(Ok([residual, increment]))?.map(f64::sqrt);
            let before = Norms { residual, ..norms };
            let Some((share, found)) = self.advance(newton, before)? else {
                // The stage is linear in everything but its gaps.
                return self.refuse_not_converged(converged);
            };
            norms = found;
            // Rows fit the whole increment only.
            let converged = converged && (share >= 1.0 || self.constraints.len() == 0);
            if self.has_converged(newton, share * size, before.residual, norms)? && converged {
                return Ok(());
            }
        }
        // There is at least one iteration.
        let last = newton.report.last().copied().unwrap_or_default();
        Err(Error::NewtonNotConverged {
            t: self.clock.at(0.0),
            h: self.clock.h,
            iterations: newton.report.len(),
            residual: last.residual,
            increment: last.increment,
            dof: self.worst(&self.vectors.increment),
        })
    }

    /// Reports an iteration whose increment has the norm `size`, and returns whether it is the last one. `before` is
    /// the norm of the residual before it, with the contact forces of this iteration.
    fn has_converged(&self, newton: &mut NewtonWork<T>, size: f64, before: f64, norms: Norms) -> Result<bool> {
        let ratio = |x: f64, y: f64| if y > 0.0 { x / y } else { 0.0 };
        let [in_u, in_v, _] = self.stage.balanced().weights();
        let (weight, values) = if in_u == T::zero() { (in_v, &self.new.v) } else { (in_u, &self.new.u) };
        let [whole, values] =
            self.host.together.sum(Ok([self.square(&self.vectors.iterate), self.square(values)]))?.map(f64::sqrt);
        let contraction = ratio(norms.residual, before);
        newton.report.push(Iteration { residual: norms.relative(), increment: ratio(size, whole) });
        let [force, displacement] = newton.settings.bounds::<T>();
        let met = norms.residual <= force * norms.scale() && size * contraction <= displacement * whole;
        // Where forces cancel, the residual has no scale. Then increments must be small, and the residual must
        // stagnate or have fallen far; or the increment must be below the resolution of the displacements. Far from
        // the origin increments are small beside the displacements: a slowly falling residual is not enough.
        newton.residuals.push(norms.residual);
        let (within, share) = newton.settings.tangent.falls();
        let earlier = newton.residuals.len().checked_sub(within + 1);
        let stays = earlier.is_some_and(|earlier| norms.residual >= share * newton.residuals[earlier]);
        let (moved, resolution) = (weight.value().abs() * size, T::epsilon().value() * values);
        let small = size <= displacement * whole || moved <= SMALL_INCREMENT * resolution;
        Ok(met || moved <= resolution || small && (stays || norms.residual <= force * newton.residuals[0]))
    }

    /// Begins with d = 0: completes the prediction by its accelerations.
    fn begin_iterations(&mut self, newton: &mut NewtonWork<T>) {
        newton.d.fill(T::zero());
        newton.report.clear();
        newton.residuals.clear();
        // A resumed run does not know the contact forces of the stage before: the first residual is without them.
        self.contact.interface.forces.fill(T::zero());
        let StageVectors { balance, supports, .. } = &mut *self.vectors;
        let prescribed = &supports.dofs;
        let complete = |rows: &ScaledRows<T>, a: &mut [T], supports: &[[T; 3]]| {
            if !rows.reads_past(2) {
                a.fill(T::zero());
            }
            for (&dof, support) in prescribed.iter().zip(supports) {
                a[dof] = support[2];
            }
        };
        complete(&self.stage.recovery, &mut self.new.a, &supports.state);
        if let (Some(rows), Some(balance)) = (&self.stage.balance, balance.as_mut()) {
            complete(rows, &mut balance.a, &supports.balance);
        }
        if self.stage.along_path
            && let (Some(path), Some(from)) = (&mut newton.path, self.past.first())
        {
            path.begin(self.host.system, &from.u);
        }
    }

    /// Writes f − M ā at the trial motion to `vectors.increment`.
    fn evaluate_residual(&mut self, newton: &mut NewtonWork<T>) -> Result<Norms> {
        let squares = self.squares(newton);
        let [force, residual] = self.host.together.sum(squares)?.map(f64::sqrt);
        // Contact is the same on all ranks.
        Ok(Norms { residual, force, contact: norm(&self.contact.interface.forces) })
    }

    /// Writes the residual without contact to `vectors.increment`. Returns the part of this rank in the squares of
    /// the force, and of the residual with contact forces.
    fn squares(&mut self, newton: &mut NewtonWork<T>) -> Result<[f64; 2]> {
        let t = self.clock.at(self.stage.load);
        let StageVectors { increment, balance, supports, .. } = &mut *self.vectors;
        let motion = match (&self.stage.balance, balance) {
            (Some(_), Some(balance)) => &*balance,
            _ => &*self.new,
        };
        match (&mut newton.path, self.past.first()) {
            (Some(path), Some(from)) if self.stage.along_path => {
                let along = Path { from: &from.u, to: &self.new.u, mean: &motion.u };
                path.force(&mut self.host, t, along, &motion.v, increment)?;
            }
            _ => self.host.system.force(t, &motion.u, &motion.v, increment)?,
        }
        let Host { system, together } = &mut self.host;
        let clear_supports = |increment: &mut [T]| supports.dofs.iter().for_each(|&dof| increment[dof] = T::zero());
        clear_supports(increment);
        let force = together.owned(increment.len()).map(|part| square(&increment[part])).sum();
        system.mass().add_product(-T::one(), &motion.a, increment);
        clear_supports(increment);
        self.refuse_nan(&self.vectors.increment, "the residual")?;
        Ok([force, self.loaded_square(&self.vectors.increment)])
    }

    /// A residual with the contact forces added.
    fn loaded(&self, residual: &[T]) -> impl Iterator<Item = f64> {
        let mut interface = self.constraints.interface().iter().zip(&self.contact.interface.forces).peekable();
        residual.iter().enumerate().map(move |(dof, &r)| {
            let force = interface.next_if(|(on, _)| **on == dof).map_or(T::zero(), |(_, &force)| force);
            (r + force).value()
        })
    }

    fn loaded_square(&self, residual: &[T]) -> f64 {
        let loaded = self.loaded(residual);
        match self.host.together.is_alone() {
            true => loaded.map(|r| r * r).sum(),
            false => loaded.enumerate().filter(|&(dof, _)| self.host.together.owns(dof)).map(|(_, r)| r * r).sum(),
        }
    }

    /// The squared norm of the part of a vector that this rank owns.
    fn square(&self, x: &[T]) -> f64 {
        self.host.together.owned(x.len()).map(|part| square(&x[part])).sum()
    }

    /// The dof with the largest residual.
    fn worst(&self, residual: &[T]) -> usize {
        let larger =
            |worst: (usize, f64), (dof, r): (usize, f64)| if r.abs() > worst.1 { (dof, r.abs()) } else { worst };
        self.loaded(residual).enumerate().fold((0, 0.0), larger).0
    }

    /// Forms and factorizes the effective matrix at the trial motion.
    fn factorize(&mut self, iteration: usize, newton: &NewtonWork<T>) -> Result<()> {
        let motion = self.vectors.balanced(self.stage, self.new);
        let of = match (&newton.path, self.past.first()) {
            (Some(path), Some(from)) if self.stage.along_path => match path.form {
                PathForm::Own => TangentOf::Path(Path { from: &from.u, to: &self.new.u, mean: &motion.u }),
                PathForm::Middle => TangentOf::State,
                PathForm::Simpson => TangentOf::Simpson { end: &self.new.u },
            },
            _ => TangentOf::State,
        };
        let at = At { t: self.clock.at(self.stage.load), u: &motion.u, v: &motion.v, of };
        self.statistics.factorizations += 1;
        let factorized = self.operator.factorize(self.host.system, self.clock.h, at);
        factorized.map_err(|error| self.in_iteration(error, iteration))
    }

    /// Converts the error of a matrix that is not positive definite to an error of this iterate.
    fn in_iteration(&self, error: Error, iteration: usize) -> Error {
        match error {
            Error::Singular { dof, .. } | Error::Indefinite { dof, .. } => {
                Error::IndefiniteTangent { t: self.clock.at(0.0), h: self.clock.h, iteration: iteration + 1, dof }
            }
            other => other,
        }
    }

    /// Moves by the increment in `vectors.increment`, or by a share of it, and returns the share; the residual there
    /// replaces the increment. Returns nothing if the stage is linear in its unknown: it is solved then.
    fn advance(&mut self, newton: &mut NewtonWork<T>, before: Norms) -> Result<Option<(f64, Norms)>> {
        std::mem::swap(&mut newton.increment, &mut self.vectors.increment);
        self.add_share(T::one(), &newton.increment);
        if !self.operator.varies() {
            return Ok(None);
        }
        let [force, _] = newton.settings.bounds::<T>();
        let mut share = 1.0;
        loop {
            let found = self.evaluate_residual(newton);
            let may_shorten = newton.settings.line_search && share > SHORTEST;
            match found {
                Ok(found) => {
                    let falls = found.residual <= (1.0 - DESCENT * share) * before.residual;
                    if !may_shorten || falls || found.residual <= force * found.scale() {
                        return Ok(Some((share, found)));
                    }
                }
                // The host may admit a state nearer to the last one.
                Err(error) if may_shorten && error.is_recoverable() => self.host.together.caught(),
                Err(error) => return Err(error),
            }
            share *= 0.5;
            self.add_share(-T::of(share), &newton.increment);
        }
    }

    /// Adds a share of the increment to everything that contains the unknown.
    fn add_share(&mut self, share: T, increment: &[T]) {
        let add = |rows: &ScaledRows<T>, motion: &mut Motion<T>| {
            let [u, v, a] = rows.weights();
            T::axpy(share * u, increment, &mut motion.u);
            T::axpy(share * v, increment, &mut motion.v);
            T::axpy(share * a, increment, &mut motion.a);
        };
        T::axpy(share, increment, &mut self.vectors.iterate);
        add(&self.stage.recovery, self.new);
        if let (Some(rows), Some(balance)) = (&self.stage.balance, &mut self.vectors.balance) {
            add(rows, balance);
        }
    }
}

fn norm<T: Real>(x: &[T]) -> f64 {
    square(x).sqrt()
}

fn square<T: Real>(x: &[T]) -> f64 {
    x.iter().map(|x| x.value().powi(2)).sum()
}
