//! The contact problem of a stage: which rows take part, their multipliers, and which contacts are closed afterwards.

use super::curved_rows::{CurvedRowsWork, FOLLOWED, Miss};
use super::operator::Operator;
use super::program::{CompiledStage, ContactTarget};
use super::supports::finite_supports;
use super::{Constraints, Statistics, Workspace};
use crate::contact::{Candidates, ContactJacobian, ContactLaw, GapRates};
use crate::contact_solver::{Bound, ContactFailure, ContactProblem, ContactSolver};
use crate::corrector::{Gaps, contact_error, rounding};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::state::{Clock, Motion};
use crate::system::System;

/// What a row constrains in a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Measure {
    /// What the scheme asks for: the gap, or h times its rate.
    AsScheme,
    /// The gap less that at the start of the stage.
    Increment,
    /// h times the rate of the gap, by a scheme that asks for the gap.
    Rate,
    /// Nothing.
    Nothing,
    /// Not known before the free motion of the stage is.
    Undecided,
}

/// Which rows a contact problem is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// All of them.
    All,
    /// Those that act on dofs without mass in an explicit stage, where these follow before anything else moves.
    Massless,
    /// The others, after that.
    Massive,
}

impl Part {
    /// Whether a row has a part in the problem.
    pub(super) fn takes(self, on_massless: &[bool], row: usize) -> bool {
        match self {
            Self::All => true,
            Self::Massless => on_massless[row],
            Self::Massive => !on_massless[row],
        }
    }
}

/// Buffers of the contact problem, one entry a candidate unless said otherwise.
pub(super) struct ContactRowsWork<T> {
    pub(super) rates: Vec<GapRates<T>>,
    /// What complementarity holds for, as a length: gaps, or h times gap rates at velocity level.
    pub(super) y: Vec<T>,
    pub(super) tolerance: Vec<T>,
    /// y is linear in what contact adds to d: its weight.
    pub(super) weight: Vec<T>,
    /// The laws, linearized: 0 ≤ y + compliance λ + shift ⊥ λ ≥ 0.
    compliance: Vec<T>,
    shift: Vec<T>,
    /// Gaps where the balance holds, for compliant laws.
    pub(super) balance_gap: Vec<T>,
    pub(super) curved: CurvedRowsWork<T>,
    /// What each row constrains in this stage; for rows whose law reads it the gap where the stage starts, and what of
    /// it is none.
    measure: Vec<Measure>,
    start_gap: Vec<T>,
    start_tolerance: Vec<T>,
    /// Rows that may press in this stage; at velocity level those whose gap is forecast to be closed.
    pub(super) enabled: Vec<bool>,
    pub(super) in_problem: Vec<bool>,
    /// Rows of [`Part::Massless`]; empty where dofs without mass are solved for with the others.
    pub(super) on_massless: Vec<bool>,
    /// Rows of the problem, and its data, one entry a row of the problem.
    pub(super) problem: Vec<usize>,
    /// Delassus operators assembled so far.
    versions: u64,
    pub(super) offset: Vec<T>,
    pub(super) problem_tolerance: Vec<T>,
    pub(super) bounds: Vec<Bound>,
    pub(super) multipliers: Vec<T>,
    /// What contact constrains, and where the gap is forecast, one entry a dof; empty for schemes that impose contact
    /// on the displacements of the new state.
    pub(super) target: Vec<T>,
    pub(super) forecast: Vec<T>,
    /// Prescribed motions at the time of either.
    pub(super) supports: Vec<[T; 3]>,
}

impl<T: Real> ContactRowsWork<T> {
    /// Buffers for `rows` contacts with `entries` weights, and for targets of `target_dofs` and forecasts of
    /// `forecast_dofs` dofs (0 if the scheme has none) with `supports` prescribed ones.
    pub(super) fn new([rows, entries]: [usize; 2], target_dofs: usize, forecast_dofs: usize, supports: usize) -> Self {
        let reserved = || Vec::with_capacity(rows);
        let zero = || vec![T::zero(); rows];
        Self {
            rates: vec![GapRates::default(); rows],
            y: zero(),
            tolerance: zero(),
            weight: zero(),
            compliance: zero(),
            shift: zero(),
            balance_gap: zero(),
            curved: CurvedRowsWork::new(rows, entries),
            measure: vec![Measure::AsScheme; rows],
            start_gap: zero(),
            start_tolerance: zero(),
            enabled: vec![true; rows],
            in_problem: vec![false; rows],
            on_massless: Vec::new(),
            problem: Vec::with_capacity(rows),
            versions: 0,
            offset: reserved(),
            problem_tolerance: reserved(),
            bounds: Vec::with_capacity(rows),
            multipliers: reserved(),
            target: vec![T::zero(); target_dofs],
            forecast: vec![T::zero(); forecast_dofs],
            supports: vec![[T::zero(); 3]; supports],
        }
    }

    /// Takes the gaps where a stage starts, and where the rows are linearized now, if a law reads them.
    pub(super) fn read_start(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        past: &[Motion<T>],
        h: f64,
    ) -> Result<()> {
        let Self { measure, start_gap, start_tolerance, rates, curved, .. } = self;
        curved.forget();
        measure.fill(Measure::AsScheme);
        let reads = constraints.reads_start() || constraints.laws().iter().any(ContactLaw::is_predictive);
        let (Some(start), true) = (past.first(), reads) else { return Ok(()) };
        constraints.finite_gaps(start.t, &start.u, start_gap)?;
        constraints.finite_rates(start.t, &start.u, &start.v, rates)?;
        for row in (0..constraints.len()).filter(|&row| constraints.law(row).reads_start()) {
            let approach = T::of(h) * (g.product(row, &start.v) + rates[row].rate).abs();
            let rounded = constraints.gap_rounding(row, g.magnitude(row, &start.u), start_gap[row]);
            start_tolerance[row] = rounded + sliver(approach);
            measure[row] = Measure::Undecided;
        }
        Ok(())
    }

    /// Says what rows constrain whose law reads the start of the stage, once y holds the gaps of its free motion.
    fn decide(&mut self, constraints: &Constraints<'_, T>) {
        let Self { y, measure, start_gap, start_tolerance, .. } = self;
        for (row, measure) in measure[..constraints.len()].iter_mut().enumerate() {
            if *measure != Measure::Undecided {
                continue;
            }
            // At rest the gap is what the force has left of the way it prevents.
            let closed = start_gap[row] <= start_tolerance[row] + sliver((y[row] - start_gap[row]).abs());
            *measure = match (constraints.law(row), closed) {
                (ContactLaw::RateCondition, true) => Measure::Increment,
                (ContactLaw::RateCondition, false) => Measure::Nothing,
                (ContactLaw::PersistencySwitch, true) => Measure::Rate,
                _ => Measure::AsScheme,
            };
        }
    }

    /// Makes of the gaps in y, and of their tolerances, what rows constrain whose law reads the start of the stage.
    /// `lacking` is the part of d that the velocities do not contain yet, on the interface.
    pub(super) fn measure(
        &mut self,
        stage: &CompiledStage<T>,
        h: f64,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        new: &Motion<T>,
        lacking: Option<&[T]>,
    ) -> Result<()> {
        if !constraints.reads_start() {
            return Ok(());
        }
        let Self { rates, y, tolerance, measure, start_gap, .. } = self;
        constraints.finite_rates(new.t, &new.u, &new.v, rates)?;
        let (h, weight) = (T::of(h), stage.recovery.weights()[1]);
        for row in 0..constraints.len() {
            match measure[row] {
                Measure::AsScheme | Measure::Nothing | Measure::Undecided => {}
                Measure::Increment => y[row] -= start_gap[row],
                Measure::Rate => {
                    let [part, size] = lacking.map_or([T::zero(); 2], |d| {
                        [weight * g.interface_product(row, d), weight * g.interface_magnitude(row, d)]
                    });
                    let own = rates[row].rate;
                    y[row] = h * (g.product(row, &new.v) + part + own);
                    // Velocities that are differences of displacements have the rounding of those.
                    let known = if stage.recovery.subtracts(1) { g.magnitude(row, &new.u) } else { T::zero() };
                    tolerance[row] = rounding(known + h * (g.magnitude(row, &new.v) + size + own.abs()));
                }
            }
        }
        Ok(())
    }

    /// Keeps the gaps of the balance, to which the inertia of compliant laws is added next.
    pub(super) fn keep_balance_gaps(&mut self) {
        self.curved.foreseen.copy_from_slice(&self.balance_gap);
    }

    /// The weight of d in what a row constrains, if it is not that of the scheme.
    fn own_weight(&self, stage: &CompiledStage<T>, h: f64, row: usize) -> Option<T> {
        (self.measure[row] == Measure::Rate).then(|| T::of(h) * stage.recovery.weights()[1])
    }

    /// Evaluates y of all rows at the target, and the tolerance for what rounding makes of it plus `approach` (a
    /// fraction of the approach in one step).
    fn evaluate(
        &mut self,
        level: &Level<'_, T>,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        new: &Motion<T>,
        approach: f64,
    ) -> Result<()> {
        let Self { rates, y, tolerance, target, .. } = self;
        let h = level.clock.h;
        let (t, values) = level.place(new, target);
        if level.is_velocity() {
            constraints.finite_rates(t, &new.u, &new.v, rates)?;
            for row in 0..constraints.len() {
                y[row] = g.product(row, values) + T::of(h) * rates[row].rate;
                if !y[row].is_finite() {
                    let (contact, value) = (constraints.ids[row], y[row].value());
                    return Err(Error::ContactNotFinite { t, what: "the gap rate", contact, value });
                }
            }
        } else {
            constraints.finite_gaps(t, values, y)?;
        }
        for row in 0..constraints.len() {
            tolerance[row] = match level.is_velocity() {
                true => rounding(g.magnitude(row, values) + y[row].abs()),
                false => constraints.gap_rounding(row, g.magnitude(row, values), y[row]),
            };
        }
        if approach > 0.0 {
            constraints.finite_rates(new.t, &new.u, &new.v, rates)?;
            for row in 0..constraints.len() {
                let rate = g.product(row, &new.v) + rates[row].rate;
                tolerance[row] += T::of(approach * h) * rate.abs();
            }
        }
        Ok(())
    }
}

/// Vectors on the interface, one entry a dof there.
pub(super) struct InterfaceWork<T> {
    /// The increment d: without contact when a stage begins its contact, with it at the end.
    pub(super) increment: Vec<T>,
    /// Forces of contact.
    pub(super) forces: Vec<T>,
    /// Values at d = 0 of the displacements, of those of the balance where it holds elsewhere, and of what contact
    /// constrains.
    pub(super) displacement: Vec<T>,
    balance: Vec<T>,
    target: Vec<T>,
    /// d without contact, and with that of the last linearization of curved rows.
    pub(super) free: Vec<T>,
    pub(super) tried: Vec<T>,
    /// Displacements where the gaps of curved rows were linearized last.
    pub(super) followed: Vec<T>,
    /// A response: of the multipliers of a contact problem, or of forces that do not depend on d.
    pub(super) response: Vec<T>,
}

impl<T: Real> InterfaceWork<T> {
    pub(super) fn new(size: usize) -> Self {
        let zero = || vec![T::zero(); size];
        Self {
            increment: zero(),
            forces: zero(),
            displacement: zero(),
            balance: zero(),
            target: zero(),
            free: zero(),
            tried: zero(),
            followed: zero(),
            response: zero(),
        }
    }
}

/// What of a gap counts as none beside a way of this size, made in one step: a sliver of it, and its rounding.
fn sliver<T: Real>(way: T) -> T {
    T::of(1e-10) * way + rounding(way)
}

/// `values[dof] = base + weight · increment` on the interface.
pub(super) fn advance<T: Real>(dofs: &[usize], base: &[T], weight: T, increment: &[T], values: &mut [T]) {
    for ((&dof, &base), &d) in dofs.iter().zip(base).zip(increment) {
        values[dof] = base + weight * d;
    }
}

/// Keeps the values on the interface.
pub(super) fn keep<T: Real>(dofs: &[usize], values: &[T], kept: &mut [T]) {
    for (&dof, kept) in dofs.iter().zip(kept) {
        *kept = values[dof];
    }
}

/// Puts back what [`keep`] has kept.
pub(super) fn restore<T: Real>(dofs: &[usize], kept: &[T], values: &mut [T]) {
    for (&dof, &kept) in dofs.iter().zip(kept) {
        values[dof] = kept;
    }
}

/// Where a stage imposes contact.
pub(super) struct Level<'s, T> {
    pub(super) target: Option<&'s ContactTarget<T>>,
    pub(super) clock: Clock,
}

impl<T: Real> Level<'_, T> {
    pub(super) fn is_velocity(&self) -> bool {
        self.target.is_some_and(|target| target.forecast.is_some())
    }

    /// Time and values that contact constrains.
    pub(super) fn place<'v>(&self, new: &'v Motion<T>, target: &'v [T]) -> (f64, &'v [T]) {
        match self.target {
            None => (new.t, &new.u),
            Some(rows) => (self.clock.at(rows.at), target),
        }
    }
}

/// What the contact of a stage is solved with.
pub(super) struct ContactStep<'s, 'a, T: Real> {
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) clock: Clock,
    pub(super) constraints: &'s mut Constraints<'a, T>,
    /// The rows of the gaps, linearized where contact is imposed.
    pub(super) g: &'s mut ContactJacobian<T>,
    pub(super) solver: &'s mut dyn ContactSolver<T>,
    pub(super) statistics: &'s mut Statistics,
    /// The part of the unknown that motions contain already, in Newton's method: d is then measured from there, and
    /// accelerations are complete.
    pub(super) iterate: Option<&'s [T]>,
    pub(super) part: Part,
}

/// Times a stage is solved with another linearization of its power laws, at most.
const LINEARIZATIONS: usize = 100;

impl<T: Real> ContactStep<'_, '_, T> {
    /// Finds the multipliers of the stage from d on the interface, adds their response to it, and leaves their forces
    /// there. Motions are left as predicted. Says whether curved rows fit where d ends.
    pub(super) fn solve(
        &mut self,
        system: &mut dyn System<T>,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<bool> {
        let dofs = self.constraints.interface();
        keep(dofs, &new.u, &mut work.interface.displacement);
        if let (Some(_), Some(balance)) = (&self.stage.balance, &work.balance) {
            keep(dofs, &balance.u, &mut work.interface.balance);
        }
        work.interface.free.copy_from_slice(&work.interface.increment);
        self.aim(system, new, past, work)?;
        let result = self.settle(operator, new, past, work);
        let (dofs, interface) = (self.constraints.interface(), &work.interface);
        restore(dofs, &interface.displacement, &mut new.u);
        if let (Some(_), Some(balance)) = (&self.stage.balance, &mut work.balance) {
            restore(dofs, &interface.balance, &mut balance.u);
        }
        if let Some(target) = &self.stage.contact {
            advance(dofs, &interface.target, target.row.weight, &interface.increment, &mut work.rows.target);
        }
        result
    }

    /// Solves with the rows there are, and with rows that follow what comes out, until they fit.
    fn settle(
        &mut self,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<bool> {
        let mut miss = Miss::ALL;
        for pass in 0..FOLLOWED {
            match pass {
                0 => self.observe(operator, new, past, work)?,
                _ => self.step_back(operator, new, work)?,
            }
            let needed = self.condition(new, work);
            match needed {
                true => self.press(operator, new.t, work)?,
                false => self.release(work),
            }
            if self.constraints.is_affine() {
                return Ok(true);
            }
            self.foresee(needed, work);
            if self.follow(new, work)? == Candidates::Unchanged {
                work.rows.curved.miss = 0.0;
                return Ok(true);
            }
            operator.follow(work.rows.curved.version(self.constraints));
            let before = std::mem::replace(&mut miss, self.miss(new, work)?);
            work.rows.curved.miss = miss.largest();
            if miss.is_settled::<T>(pass + 1, before) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Opens every row that d could press.
    fn release(&self, work: &mut Workspace<T>) {
        let Workspace { rows, trial, .. } = work;
        for row in (0..self.constraints.len()).filter(|&row| rows.weight[row] > T::zero()) {
            trial.lambda_raw[row] = T::zero();
        }
    }

    /// Weights of d in what rigid rows constrain, and in the displacements and accelerations of the balance.
    pub(super) fn weights(&self) -> [T; 3] {
        let rigid = self.stage.contact.as_ref().map_or(self.stage.recovery.weights()[0], |target| target.row.weight);
        let [balance_u, _, balance_a] = self.stage.balanced().weights();
        [rigid, balance_u, balance_a]
    }

    /// Evaluates what every row constrains at d without contact, with the rows there are, and applies forces of
    /// compliant laws that do not depend on d.
    fn observe(
        &mut self,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<()> {
        self.weigh(&mut work.rows);
        self.place(new, work);
        if self.constraints.has_compliant() {
            self.balance_gaps(new, work)?;
            self.add_inertia(new, work)?;
            if self.press_without_coupling(operator, work)? {
                self.place(new, work);
                self.balance_gaps(new, work)?;
                self.add_inertia(new, work)?;
            }
        }
        self.evaluate(new, work)?;
        self.extrapolate(new, work);
        self.restitution(past, &mut work.rows)
    }

    /// Sets the weights of d in what the rows constrain by the scheme and by compliant laws.
    fn weigh(&self, rows: &mut ContactRowsWork<T>) {
        let [rigid, balance_u, balance_a] = self.weights();
        for (row, law) in self.constraints.laws().iter().enumerate() {
            let weight = match (law.is_compliant(), law.is_predictive()) {
                (false, _) => rigid,
                (true, false) => balance_u + T::of(law.inertia()) * balance_a,
                (true, true) => T::of(0.5) * rigid,
            };
            rows.weight[row] = if self.part.takes(&rows.on_massless, row) { weight } else { T::zero() };
        }
    }

    /// Evaluates y of all rows, as the scheme and their laws measure it, where d is placed.
    pub(super) fn evaluate(&mut self, new: &Motion<T>, work: &mut Workspace<T>) -> Result<()> {
        let Self { stage, clock, constraints, g, .. } = self;
        let Workspace { rows, interface, .. } = work;
        rows.evaluate(&Level { target: stage.contact.as_ref(), clock: *clock }, constraints, g, new, 0.0)?;
        rows.decide(constraints);
        rows.measure(stage, clock.h, constraints, g, new, Some(&interface.increment))
    }

    /// Decides which rows the problem begins with, and says whether any has to press.
    fn condition(&mut self, new: &Motion<T>, work: &mut Workspace<T>) -> bool {
        let Self { stage, clock, constraints, g, part, .. } = self;
        let Workspace { trial, rows, .. } = work;
        let mut needed = false;
        for row in 0..constraints.len() {
            let law = constraints.law(row);
            if law.is_compliant() {
                let gap = rows.balance_gap[row];
                rows.y[row] = match law.is_predictive() {
                    // The mean gap of the coming step, less that of the last one if it was pressed.
                    true => {
                        T::of(0.5) * (rows.y[row] + gap) - (-T::of(0.5) * (gap + rows.start_gap[row])).max(T::zero())
                    }
                    false => gap,
                };
                rows.tolerance[row] = constraints.gap_rounding(row, g.magnitude(row, &new.u), gap);
                let depth = (-rows.y[row]).max(rows.tolerance[row]);
                (rows.compliance[row], rows.shift[row]) = law.linearized(depth, T::zero());
            } else {
                (rows.compliance[row], rows.shift[row]) = (T::zero(), T::zero());
                let own = rows.own_weight(stage, clock.h, row).filter(|_| part.takes(&rows.on_massless, row));
                rows.weight[row] = own.unwrap_or(rows.weight[row]);
                rows.enabled[row] &= rows.measure[row] != Measure::Nothing;
            }
            let coupled = rows.weight[row] > T::zero();
            let violated = rows.enabled[row] && rows.y[row] < -rows.tolerance[row] || law.is_equality();
            rows.in_problem[row] = coupled && (violated || rows.enabled[row] && trial.lambda_raw[row] > T::zero());
            if coupled && !rows.in_problem[row] {
                trial.lambda_raw[row] = T::zero();
            }
            needed |= coupled && violated;
        }
        needed
    }

    /// Brings d on the interface into the displacements, into those of the balance, and into what contact constrains.
    pub(super) fn place(&mut self, new: &mut Motion<T>, work: &mut Workspace<T>) {
        let dofs = self.constraints.interface();
        let Workspace { interface, rows, balance: elsewhere, .. } = work;
        let InterfaceWork { increment, displacement, balance, target, .. } = interface;
        advance(dofs, displacement, self.stage.recovery.weights()[0], increment, &mut new.u);
        if let (Some(balanced), Some(motion)) = (&self.stage.balance, elsewhere) {
            advance(dofs, balance, balanced.weights()[0], increment, &mut motion.u);
        }
        if let Some(aim) = &self.stage.contact {
            advance(dofs, target, aim.row.weight, increment, &mut rows.target);
        }
    }

    /// Time and displacements of the balance.
    pub(super) fn balanced<'m>(&self, new: &'m Motion<T>, balance: Option<&'m Motion<T>>) -> (f64, &'m Motion<T>) {
        let motion = match (&self.stage.balance, balance) {
            (Some(_), Some(balance)) => balance,
            _ => new,
        };
        (self.clock.at(self.stage.load), motion)
    }

    /// Gaps where the balance holds, by the rows there are.
    fn balance_gaps(&mut self, new: &Motion<T>, work: &mut Workspace<T>) -> Result<()> {
        let (t, motion) = self.balanced(new, work.balance.as_ref());
        self.constraints.finite_gaps(t, &motion.u, &mut work.rows.balance_gap)?;
        work.rows.keep_balance_gaps();
        Ok(())
    }

    /// Adds the inertia of compliant laws to the gaps of the balance.
    pub(super) fn add_inertia(&mut self, new: &Motion<T>, work: &mut Workspace<T>) -> Result<()> {
        if self.constraints.laws().iter().all(|law| law.inertia() == 0.0) {
            return Ok(());
        }
        let [_, _, balance_a] = self.weights();
        let (t, motion) = self.balanced(new, work.balance.as_ref());
        let Self { stage, constraints, g, .. } = self;
        let Workspace { interface, rows, .. } = work;
        let known = self.iterate.is_some() || stage.balanced().reads_past(2);
        // g̈ at ā: the predicted part, and that of d.
        let InterfaceWork { response, increment, .. } = interface;
        for ((&dof, a), &d) in constraints.interface().iter().zip(response.iter_mut()).zip(increment.iter()) {
            *a = if known { motion.a[dof] } else { T::zero() } + balance_a * d;
        }
        constraints.finite_rates(t, &motion.u, &motion.v, &mut rows.rates)?;
        let forces = rows.curved.forces(g);
        for row in 0..constraints.len() {
            let inertia = T::of(constraints.law(row).inertia());
            let acceleration = forces.interface_product(row, response) + rows.rates[row].acceleration;
            rows.balance_gap[row] += inertia * acceleration;
        }
        Ok(())
    }

    /// Applies the forces of compliant rows whose gap does not depend on d (explicit schemes); says whether there are
    /// any.
    pub(super) fn press_without_coupling(
        &mut self,
        operator: &mut Operator<T>,
        work: &mut Workspace<T>,
    ) -> Result<bool> {
        let Self { constraints, g, part, .. } = self;
        let Workspace { interface, rows, trial, .. } = work;
        let forces = rows.curved.forces(g);
        let mut pressed = false;
        for row in (0..constraints.len()).filter(|&row| part.takes(&rows.on_massless, row)) {
            let law = constraints.law(row);
            if law.is_compliant() && rows.weight[row] == T::zero() {
                let force = law.force(rows.balance_gap[row]);
                trial.lambda_raw[row] = force;
                forces.interface_scatter(row, force, &mut interface.forces);
                pressed |= force > T::zero();
            }
        }
        if pressed {
            interface.response.copy_from_slice(&interface.forces);
            operator.respond(&mut interface.response)?;
            T::axpy(T::one(), &interface.response, &mut interface.increment);
        }
        Ok(pressed)
    }

    /// Adds e times the rate at the start of the stage to the rows under Newton's impact law.
    fn restitution(&mut self, past: &[Motion<T>], rows: &mut ContactRowsWork<T>) -> Result<()> {
        let Self { stage, clock, constraints, g, .. } = self;
        let lead = stage.contact.as_ref().map_or(0.0, |target| target.at - stage.end);
        let restores = |law: ContactLaw| matches!(law, ContactLaw::Restitution { coefficient } if coefficient > 0.0);
        let (Some(start), true) = (past.first(), constraints.laws().iter().any(|&law| restores(law))) else {
            return Ok(());
        };
        let h = T::of(clock.h);
        constraints.finite_rates(start.t, &start.u, &start.v, &mut rows.rates)?;
        for row in 0..constraints.len() {
            if let ContactLaw::Restitution { coefficient } = constraints.law(row) {
                let rate = g.product(row, &start.v) + T::of(lead) * h * g.product(row, &start.a) + rows.rates[row].rate;
                rows.y[row] += T::of(coefficient) * h * rate;
                rows.tolerance[row] += rounding(h * g.magnitude(row, &start.v));
            }
        }
        Ok(())
    }

    /// Solves for the multipliers, laws linearized again until they are met.
    fn press(&mut self, operator: &mut Operator<T>, t: f64, work: &mut Workspace<T>) -> Result<()> {
        let augmentations = self.constraints.laws().iter().map(ContactLaw::augmentations).max().unwrap_or(0);
        let limit = LINEARIZATIONS + augmentations;
        for pass in 0..limit {
            self.press_linearized(operator, t, work)?;
            let Workspace { rows, trial, interface, .. } = &mut *work;
            let ContactRowsWork { problem, multipliers, weight, y, tolerance, compliance, shift, curved, .. } = rows;
            let forces = curved.forces(self.g);
            // The laws at the solution.
            let (mut worst, mut again) = ((0, T::zero()), false);
            for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
                let law = self.constraints.law(row);
                match law {
                    ContactLaw::PowerLaw { .. } => {
                        let gap = y[row] + weight[row] * forces.interface_product(row, &interface.response);
                        let (depth, rounded) = ((-gap).max(T::zero()), T::of(64.0) * T::epsilon());
                        let (slope, _) = law.linearized(depth.max(tolerance[row]), T::zero());
                        let miss = (lambda - law.force(gap)).abs() * slope;
                        if miss > tolerance[row] + rounded * depth {
                            again = true;
                            if miss > worst.1 {
                                worst = (row, miss);
                            }
                        }
                        (compliance[row], shift[row]) = law.linearized(depth.max(tolerance[row]), T::zero());
                    }
                    _ if pass < law.augmentations() => {
                        again = true;
                        (compliance[row], shift[row]) = law.linearized(T::zero(), lambda);
                    }
                    _ => {}
                }
            }
            for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
                trial.lambda_raw[row] = lambda;
            }
            if !again {
                for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
                    if !lambda.is_finite() {
                        let (contact, value) = (self.constraints.ids[row], lambda.value());
                        return Err(Error::ContactNotFinite { t, what: "the multiplier", contact, value });
                    }
                    forces.interface_scatter(row, lambda, &mut interface.forces);
                }
                T::axpy(T::one(), &interface.response, &mut interface.increment);
                return Ok(());
            }
            if pass + 1 == limit {
                let failure = ContactFailure::NotConverged { iterations: pass, row: worst.0, residual: worst.1 };
                return Err(contact_error(t, failure, |row| self.constraints.ids[row]));
            }
        }
        Ok(())
    }

    /// Solves on the rows that may be active, and leaves the response in `interface.response`; whoever is pushed in by
    /// that joins. The set only grows: this ends.
    fn press_linearized(&mut self, operator: &mut Operator<T>, t: f64, work: &mut Workspace<T>) -> Result<()> {
        let Self { constraints, g, solver, statistics, .. } = self;
        let Workspace { rows, trial, interface, .. } = work;
        let ContactRowsWork {
            y,
            tolerance,
            weight,
            compliance,
            shift,
            enabled,
            in_problem,
            problem,
            versions,
            offset,
            curved,
            ..
        } = rows;
        let forces = curved.forces(g);
        let (bounds, multipliers, problem_tolerance) =
            (&mut rows.bounds, &mut rows.multipliers, &mut rows.problem_tolerance);
        let count = constraints.len();
        loop {
            problem.clear();
            problem.extend((0..count).filter(|&row| in_problem[row]));
            for buffer in [&mut *offset, &mut *problem_tolerance, &mut *multipliers] {
                buffer.clear();
            }
            bounds.clear();
            // Rows are divided by their weight, which makes W symmetric whatever the rows constrain.
            for &j in problem.iter() {
                offset.push((y[j] + shift[j]) / weight[j]);
                problem_tolerance.push(tolerance[j] / weight[j]);
                multipliers.push(trial.lambda_raw[j]);
                bounds.push(constraints.law(j).into());
            }
            let compliance_of = |k: usize| compliance[problem[k]] / weight[problem[k]];
            let (delassus, version) = operator.delassus(forces, problem, compliance_of, versions)?;
            let data = ContactProblem { delassus, offset, bounds, tolerance: problem_tolerance, version };
            let solved = solver.solve(&data, multipliers);
            statistics.contact_solves += 1;
            statistics.contact_iterations +=
                solved.map_err(|failure| contact_error(t, failure, |i| constraints.ids[problem[i]]))? as u64;
            interface.response.fill(T::zero());
            for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
                if lambda != T::zero() {
                    T::axpy(lambda, operator.response(row), &mut interface.response);
                }
            }
            let mut grown = false;
            for row in 0..count {
                if enabled[row] && !in_problem[row] && weight[row] > T::zero() {
                    let pushed = y[row] + weight[row] * forces.interface_product(row, &interface.response);
                    if pushed < -tolerance[row] {
                        (in_problem[row], grown) = (true, true);
                        let depth = (-pushed).max(tolerance[row]);
                        (compliance[row], shift[row]) = constraints.law(row).linearized(depth, T::zero());
                    }
                }
            }
            if !grown {
                return Ok(());
            }
        }
    }

    /// Forms what contact constrains without multipliers, and decides which rows may press.
    fn aim(
        &mut self,
        system: &mut dyn System<T>,
        new: &Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<()> {
        let Self { clock, constraints, g, .. } = self;
        let Workspace { prescribed, rows, interface, .. } = work;
        let ContactRowsWork { y, enabled, target, forecast, supports, rates, .. } = rows;
        enabled.fill(true);
        let Some(aim) = &self.stage.contact else { return Ok(()) };
        let h = T::of(clock.h);
        let t = clock.at(aim.at);
        // Only on the interface: nothing else is read, and far from contact a body is large.
        aim.row.predict_at(past, constraints.interface(), target);
        if let Some(d) = self.iterate {
            for &dof in constraints.interface() {
                target[dof] += aim.row.weight * d[dof];
            }
        }
        keep(constraints.interface(), target, &mut interface.target);
        // Displacements of supports, or h times their velocities.
        let mut support = |t: f64, values: &mut [T], what: fn(&[T; 3], T) -> T| {
            if !prescribed.is_empty() {
                system.prescribed_motion(t, supports);
                finite_supports(t, prescribed, supports)?;
                for (&dof, support) in prescribed.iter().zip(supports.iter()) {
                    values[dof] = what(support, h);
                }
            }
            Ok::<(), Error>(())
        };
        let Some((row, at)) = &aim.forecast else {
            return support(t, target, |support, _| support[0]);
        };
        support(t, target, |support, h| h * support[1])?;
        advance(constraints.interface(), &interface.target, aim.row.weight, &interface.increment, target);
        let t_forecast = clock.at(*at);
        row.predict_at(past, constraints.interface(), forecast);
        support(t_forecast, forecast, |support, _| support[0])?;
        constraints.finite_gaps(t_forecast, forecast, y)?;
        constraints.finite_rates(t, &new.u, &new.v, rates)?;
        for row in 0..constraints.len() {
            // A sliver of one step's approach counts as touching, as at position level.
            let approach = (g.product(row, target) + h * rates[row].rate).abs();
            let touching = constraints.gap_rounding(row, g.magnitude(row, forecast), y[row]) + T::of(1e-10) * approach;
            let law = constraints.law(row);
            enabled[row] = y[row] <= touching || law.is_equality() || law.is_compliant();
        }
        Ok(())
    }

    /// Decides which contacts are closed, and starts the books of the stage: reported force, impulse, corrections.
    pub(super) fn close(
        &mut self,
        new: &Motion<T>,
        impulse_weight: f64,
        is_last: bool,
        work: &mut Workspace<T>,
    ) -> Result<()> {
        let Self { stage, clock, constraints, g, .. } = self;
        let first = work.backup.rotations == 1;
        let Workspace { trial, rows, buffers, was_closed, closed_at_start, massless, .. } = work;
        let level = Level { target: stage.contact.as_ref(), clock: *clock };
        rows.evaluate(&level, constraints, g, new, 1e-10)?;
        if level.target.is_none() {
            trial.gap.copy_from_slice(&rows.y[..constraints.len()]);
        } else {
            // The gaps of a state are those of its own surroundings.
            rows.curved.hold(g, constraints);
            constraints.follow(new.t, &new.u, g)?;
            rows.curved.release(constraints);
            constraints.finite_gaps(new.t, &new.u, &mut trial.gap)?;
        }
        rows.measure(stage, clock.h, constraints, g, new, None)?;
        if self.part != Part::All && level.target.is_some() {
            // Rows on dofs without mass hold for the gaps of the state.
            for row in (0..constraints.len()).filter(|&row| rows.on_massless[row]) {
                let rate = g.product(row, &new.v) + rows.rates[row].rate;
                let rounded = constraints.gap_rounding(row, g.magnitude(row, &new.u), trial.gap[row]);
                (rows.y[row], rows.enabled[row]) = (trial.gap[row], true);
                rows.tolerance[row] = rounded + T::of(1e-10 * clock.h) * rate.abs();
            }
        }
        was_closed.clear();
        was_closed.extend_from_slice(&trial.closed);
        buffers.closed.clear();
        buffers.opened.clear();
        buffers.released.clear();
        let impulse_weight = T::of(clock.h * impulse_weight);
        for (row, &was_closed) in was_closed.iter().enumerate() {
            let raw = trial.lambda_raw[row];
            let law = constraints.law(row);
            let touching = rows.enabled[row] && rows.y[row] <= rows.tolerance[row] && !law.is_compliant();
            let closed = raw > T::zero() || touching || law.is_equality();
            trial.closed[row] = closed;
            // A compliant contact leaves no jump to correct, nor does one that moves dofs without mass.
            if !law.is_compliant() && (massless.is_empty() || !g.acts_on(row, massless)) {
                match (closed, was_closed) {
                    (true, _) => buffers.closed.push(row),
                    (false, true) => buffers.opened.push(row),
                    (false, false) => {}
                }
                if is_last && !closed && (was_closed || closed_at_start[row]) {
                    buffers.released.push(row);
                }
            }
            if closed && !was_closed && !closed_at_start[row] {
                trial.dissipated[row] = T::zero();
            }
            trial.lambda[row] = raw;
            (trial.lambda_v[row], trial.lambda_a[row]) = (T::zero(), T::zero());
            let before = if first { T::zero() } else { trial.impulse[row] };
            trial.impulse[row] = before + impulse_weight * raw;
        }
        Ok(())
    }
}
