//! A stage of a nonlinear system, solved by Newton's method.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::build::program::ScaledRows;
use crate::simulation::operator::tangent::{At, TangentOf};
use crate::simulation::rows::contact_rows::Part;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::newton::{Iteration, NewtonWork, TangentUpdate};
use crate::simulation::stage::path::PathForm;
use crate::simulation::stage::vectors::StageVectors;
use crate::state::Motion;
use crate::system::Path;

/// The smallest share of an increment in a line search.
const SHORTEST: f64 = 0.125;

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
    /// Moves the predicted motion to where the balance and the contact conditions hold, by Newton's method.
    pub(crate) fn by_iteration(
        &mut self,
        newton: &mut NewtonWork<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        contact.interface.forces.fill(T::zero());
        self.begin(newton, new, past, vectors);
        let limit = newton.settings.iterations;
        let mut norms = self.evaluate(newton, new, past, vectors, &contact.interface.forces)?;
        newton.residuals.push(norms.residual);
        for iteration in 0..limit {
            if self.operator.varies() && (iteration == 0 || newton.settings.tangent == TangentUpdate::Iteration) {
                self.factorize(iteration, newton, new, past, vectors)?;
            }
            newton.residual.copy_from_slice(&vectors.increment);
            self.operator
                .begin(&mut vectors.increment, &mut contact.interface.increment)
                .map_err(|error| self.in_iteration(error, iteration))?;
            self.statistics.linear_solves += 1;
            self.statistics.newton_iterations += 1;
            let settled = self.press(newton, new, past, vectors, contact)?;
            self.operator.finish(&mut vectors.increment, &contact.interface.increment, &contact.interface.forces)?;
            self.refuse_nan(&vectors.increment, "the increment")?;
            let residual = self.loaded_square(&newton.residual, &contact.interface.forces);
            let increment = self.square(&vectors.increment);
            let [residual, size] = self.together.sum(Ok([residual, increment]))?.map(f64::sqrt);
            let before = Norms { residual, ..norms };
            let forces = &contact.interface.forces;
            let Some((share, found)) = self.advance(newton, new, past, vectors, forces, before)? else {
                // The stage is linear in everything but its gaps.
                return self.refuse_unsettled(settled, new.t, &contact.rows.curved);
            };
            norms = found;
            // Rows fit the whole increment only.
            let settled = settled && (share >= 1.0 || self.constraints.len() == 0);
            if self.has_converged(newton, share * size, before.residual, norms, new)? && settled {
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
            dof: self.worst(&vectors.increment, &contact.interface.forces),
        })
    }

    /// Reports an iteration whose increment has the norm `size`, and returns whether it is the last one. `before` is
    /// the norm of the residual before it, with the contact forces of this iteration.
    fn has_converged(
        &self,
        newton: &mut NewtonWork<T>,
        size: f64,
        before: f64,
        norms: Norms,
        new: &Motion<T>,
    ) -> Result<bool> {
        let ratio = |x: f64, y: f64| if y > 0.0 { x / y } else { 0.0 };
        let [in_u, in_v, _] = self.stage.balanced().weights();
        let (weight, values) = if in_u == T::zero() { (in_v, &new.v) } else { (in_u, &new.u) };
        let [whole, values] = self.together.sum(Ok([self.square(&newton.d), self.square(values)]))?.map(f64::sqrt);
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
        let small = size <= displacement * whole || moved <= 1e4 * resolution;
        Ok(met || moved <= resolution || small && (stays || norms.residual <= force * newton.residuals[0]))
    }

    /// Begins with d = 0: completes the prediction by its accelerations.
    fn begin(
        &mut self,
        newton: &mut NewtonWork<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
    ) {
        newton.d.fill(T::zero());
        newton.report.clear();
        newton.residuals.clear();
        let StageVectors { balance, supports, .. } = vectors;
        let prescribed = &supports.dofs;
        let complete = |rows: &ScaledRows<T>, a: &mut [T], supports: &[[T; 3]]| {
            if !rows.reads_past(2) {
                a.fill(T::zero());
            }
            for (&dof, support) in prescribed.iter().zip(supports) {
                a[dof] = support[2];
            }
        };
        complete(&self.stage.recovery, &mut new.a, &supports.state);
        if let (Some(rows), Some(balance)) = (&self.stage.balance, balance.as_mut()) {
            complete(rows, &mut balance.a, &supports.balance);
        }
        if self.stage.along_path
            && let (Some(path), Some(from)) = (&mut newton.path, past.first())
        {
            path.begin(self.system, &from.u);
        }
    }

    /// The motion at which the balance holds.
    fn balanced<'m>(&self, new: &'m Motion<T>, balance: Option<&'m Motion<T>>) -> &'m Motion<T> {
        match (&self.stage.balance, balance) {
            (Some(_), Some(balance)) => balance,
            _ => new,
        }
    }

    /// Writes f − M ā at the trial motion to `vectors.increment`.
    fn evaluate(
        &mut self,
        newton: &mut NewtonWork<T>,
        new: &Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        forces: &[T],
    ) -> Result<Norms> {
        let squares = self.squares(newton, new, past, vectors, forces);
        let [force, residual] = self.together.sum(squares)?.map(f64::sqrt);
        // Contact is the same on all ranks.
        Ok(Norms { residual, force, contact: norm(forces) })
    }

    /// Writes the residual without contact to `vectors.increment`. Returns the part of this rank in the squares of
    /// the force, and of the residual with contact forces.
    fn squares(
        &mut self,
        newton: &mut NewtonWork<T>,
        new: &Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        forces: &[T],
    ) -> Result<[f64; 2]> {
        let StageVectors { increment, balance, supports } = vectors;
        let prescribed = &supports.dofs;
        let t = self.clock.at(self.stage.load);
        let motion = self.balanced(new, balance.as_ref());
        match (&mut newton.path, past.first()) {
            (Some(path), Some(from)) if self.stage.along_path => {
                path.force((&mut *self.system, self.together), t, [&from.u, &new.u, &motion.u], &motion.v, increment)?;
            }
            _ => self.system.force(t, &motion.u, &motion.v, increment)?,
        }
        for &dof in prescribed {
            increment[dof] = T::zero();
        }
        let force = self.square(increment);
        self.system.mass().add_product(-T::one(), &motion.a, increment);
        for &dof in prescribed {
            increment[dof] = T::zero();
        }
        self.refuse_nan(increment, "the residual")?;
        Ok([force, self.loaded_square(increment, forces)])
    }

    /// A residual with the contact forces added.
    fn loaded(&self, residual: &[T], forces: &[T]) -> impl Iterator<Item = f64> {
        let mut interface = self.constraints.interface().iter().zip(forces).peekable();
        residual.iter().enumerate().map(move |(dof, &r)| {
            let force = interface.next_if(|(on, _)| **on == dof).map_or(T::zero(), |(_, &force)| force);
            (r + force).value()
        })
    }

    fn loaded_square(&self, residual: &[T], forces: &[T]) -> f64 {
        let loaded = self.loaded(residual, forces);
        match self.together.is_alone() {
            true => loaded.map(|r| r * r).sum(),
            false => loaded.enumerate().filter(|&(dof, _)| self.together.owns(dof)).map(|(_, r)| r * r).sum(),
        }
    }

    /// The squared norm of the part of a vector that this rank owns.
    fn square(&self, x: &[T]) -> f64 {
        self.together.owned(x.len()).map(|part| square(&x[part])).sum()
    }

    /// The dof with the largest residual.
    fn worst(&self, residual: &[T], forces: &[T]) -> usize {
        let larger =
            |worst: (usize, f64), (dof, r): (usize, f64)| if r.abs() > worst.1 { (dof, r.abs()) } else { worst };
        self.loaded(residual, forces).enumerate().fold((0, 0.0), larger).0
    }

    /// Forms and factorizes the effective matrix at the trial motion.
    fn factorize(
        &mut self,
        iteration: usize,
        newton: &NewtonWork<T>,
        new: &Motion<T>,
        past: &[Motion<T>],
        vectors: &StageVectors<T>,
    ) -> Result<()> {
        let motion = self.balanced(new, vectors.balance.as_ref());
        let of = match (&newton.path, past.first()) {
            (Some(path), Some(from)) if self.stage.along_path => match path.form {
                PathForm::Own => TangentOf::Path(Path { from: &from.u, to: &new.u, mean: &motion.u }),
                PathForm::Middle => TangentOf::State,
                PathForm::Simpson => TangentOf::Simpson { end: &new.u },
            },
            _ => TangentOf::State,
        };
        let at = At { t: self.clock.at(self.stage.load), u: &motion.u, v: &motion.v, of };
        self.statistics.factorizations += 1;
        let factorized = self.operator.factorize(self.system, self.clock.h, at);
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

    /// Adds the response to contact to the increment on the interface. Returns whether curved rows fit the result.
    fn press(
        &mut self,
        newton: &mut NewtonWork<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<bool> {
        contact.interface.forces.fill(T::zero());
        if self.constraints.len() == 0 || !T::all_finite(&contact.interface.increment) {
            return Ok(true);
        }
        self.contact(Part::All, Some(&newton.d), new, past, vectors, contact)
    }

    /// Moves by the increment in `vectors.increment`, or by a share of it, and returns the share; the residual there
    /// replaces the increment. Returns nothing if the stage is linear in its unknown: it is solved then.
    fn advance(
        &mut self,
        newton: &mut NewtonWork<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        forces: &[T],
        before: Norms,
    ) -> Result<Option<(f64, Norms)>> {
        std::mem::swap(&mut newton.increment, &mut vectors.increment);
        self.shift(T::one(), newton, new, vectors);
        if !self.operator.varies() {
            return Ok(None);
        }
        let [force, _] = newton.settings.bounds::<T>();
        let mut share = 1.0;
        loop {
            let found = self.evaluate(newton, new, past, vectors, forces);
            let may_shorten = newton.settings.line_search && share > SHORTEST;
            match found {
                Ok(found) => {
                    let falls = found.residual <= (1.0 - 1e-4 * share) * before.residual;
                    if !may_shorten || falls || found.residual <= force * found.scale() {
                        return Ok(Some((share, found)));
                    }
                }
                // The host may admit a state nearer to the last one.
                Err(error) if may_shorten && error.is_recoverable() => self.together.caught(),
                Err(error) => return Err(error),
            }
            share *= 0.5;
            self.shift(-T::of(share), newton, new, vectors);
        }
    }

    /// Adds a share of the increment to everything that contains the unknown.
    fn shift(&self, share: T, newton: &mut NewtonWork<T>, new: &mut Motion<T>, vectors: &mut StageVectors<T>) {
        let NewtonWork { d, increment, .. } = newton;
        T::axpy(share, increment, d);
        let add = |rows: &ScaledRows<T>, motion: &mut Motion<T>| {
            let [u, v, a] = rows.weights();
            T::axpy(share * u, increment, &mut motion.u);
            T::axpy(share * v, increment, &mut motion.v);
            T::axpy(share * a, increment, &mut motion.a);
        };
        add(&self.stage.recovery, new);
        if let (Some(rows), Some(balance)) = (&self.stage.balance, &mut vectors.balance) {
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
