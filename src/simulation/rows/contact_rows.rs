//! The quantity that each contact row constrains in a stage, and its tolerance.

use crate::contact::{ContactJacobian, GapRates, Measure};
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{rounding, touching};
use crate::simulation::build::program::{CompiledStage, ContactTarget};
use crate::simulation::operator::Operator;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::curved_rows::CurvedRowsWork;
use crate::simulation::rows::massless_rows::MasslessRows;
use crate::simulation::rows::problem_rows::ProblemRows;
use crate::state::{Clock, Motion};

/// The contact rows of a stage, one entry per row of G: candidates, then tangential rows.
pub(crate) struct ContactRowsWork<T> {
    /// The quantity complementary to the multiplier, as a length: the gap, or h times the gap rate at velocity level.
    pub(crate) y: Vec<T>,
    /// The rounding of y, and at the end of a stage the gap within which a contact touches. A length.
    pub(crate) tolerance: Vec<T>,
    /// The weight of d in y.
    pub(crate) weight: Vec<T>,
    pub(crate) state: Vec<RowState>,
    pub(crate) laws: LawRows<T>,
    pub(crate) start: StartRows<T>,
    pub(crate) target: TargetWork<T>,
    pub(crate) massless: MasslessRows,
    pub(crate) curved: CurvedRowsWork<T>,
    pub(crate) problem: ProblemRows<T>,
    pub(crate) rates: Vec<GapRates<T>>,
    pub(crate) slips: Slips<T>,
}

/// The part of a row in the contact problem of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowState {
    /// The row may not carry a force in this stage: its forecast gap, or its gap at the start, is open.
    Disabled,
    /// The row may carry a force, and is not in the problem so far.
    Open,
    /// The row is in the contact problem.
    InProblem,
    /// The normal force of the row is known: it is in the problem for its friction.
    Known,
}

impl RowState {
    pub(super) fn enabled_if(may_carry_force: bool) -> Self {
        if may_carry_force { Self::Open } else { Self::Disabled }
    }

    pub(crate) fn is_enabled(self) -> bool {
        self != Self::Disabled
    }

    pub(crate) fn is_in_problem(self) -> bool {
        matches!(self, Self::InProblem | Self::Known)
    }
}

/// Compliant laws, linearized: 0 ≤ y + compliance λ + shift ⊥ λ ≥ 0.
#[derive(Default)]
pub(crate) struct LawRows<T> {
    pub(crate) compliance: Vec<T>,
    pub(crate) shift: Vec<T>,
    /// Gaps where the balance holds.
    pub(crate) balance_gap: Vec<T>,
    /// −ġ where the balance holds, for laws that read it.
    pub(crate) approach: Vec<T>,
}

/// Rows whose law reads the gap at the start of the stage, or whose rate is constrained.
#[derive(Default)]
pub(crate) struct StartRows<T> {
    /// The quantity that each row constrains in this stage.
    pub(crate) measure: Vec<Measure>,
    /// The gap at the start, and the gap below which the row counts as closed.
    pub(crate) gap: Vec<T>,
    pub(crate) tolerance: Vec<T>,
    /// Gap beyond rounding of closed rows that constrain a rate or an increment: they may close by it. Without this
    /// slack, rounding would slowly lift a resting contact until it counts as open.
    pub(crate) closed_slack: Vec<T>,
}

/// The values that contact constrains, one entry a dof; empty for schemes that impose contact on the displacements of
/// the new state.
pub(crate) struct TargetWork<T> {
    pub(crate) values: Vec<T>,
    /// The displacements of the gap forecast.
    pub(crate) forecast: Vec<T>,
    /// Prescribed motions at the time of the target or of the forecast.
    pub(crate) supports: Vec<[T; 3]>,
}

/// The slips of contacts with friction.
pub(crate) struct Slips<T> {
    /// The parts of their rates that do not come from v and a, one per tangential row.
    pub(crate) rates: Vec<GapRates<T>>,
    /// Whether slips are displacements in the stage although the velocities contain the unknown.
    pub(crate) by_displacement: bool,
}

impl<T: Real> LawRows<T> {
    /// The gap of the balance, and the approach there.
    pub(crate) fn balance(&self, row: usize) -> [T; 2] {
        [self.balance_gap[row], self.approach[row]]
    }

    /// Stores the compliance and the shift of a row.
    pub(crate) fn set(&mut self, row: usize, (compliance, shift): (T, T)) {
        (self.compliance[row], self.shift[row]) = (compliance, shift);
    }
}

impl<T: Real> ContactRowsWork<T> {
    /// Buffers for `rows` rows, and for targets of `target_dofs` and forecasts of `forecast_dofs` dofs (0 if the scheme
    /// has none) with `supports` prescribed dofs.
    pub(crate) fn new(rows: usize, target_dofs: usize, forecast_dofs: usize, supports: usize) -> Self {
        let mut work = Self {
            y: Vec::new(),
            tolerance: Vec::new(),
            weight: Vec::new(),
            state: Vec::new(),
            laws: LawRows::default(),
            start: StartRows::default(),
            target: TargetWork {
                values: vec![T::zero(); target_dofs],
                forecast: vec![T::zero(); forecast_dofs],
                supports: vec![[T::zero(); 3]; supports],
            },
            massless: MasslessRows::new(),
            curved: CurvedRowsWork::new(),
            problem: ProblemRows::default(),
            rates: Vec::new(),
            slips: Slips { rates: Vec::new(), by_displacement: false },
        };
        work.resize(rows);
        work
    }

    /// Lists with an entry for each of so many rows.
    pub(crate) fn resize(&mut self, rows: usize) {
        let Self { y, tolerance, weight, laws, start, .. } = self;
        let LawRows { compliance, shift, balance_gap, approach } = laws;
        for values in [y, tolerance, weight, compliance, shift, balance_gap, approach] {
            values.resize(rows, T::zero());
        }
        for values in [&mut start.gap, &mut start.tolerance, &mut start.closed_slack] {
            values.resize(rows, T::zero());
        }
        start.measure.resize(rows, Measure::AsScheme);
        self.state.resize(rows, RowState::Open);
        self.rates.resize(rows, GapRates::default());
        self.massless.acts.resize(rows, false);
        self.curved.gaps.resize(rows, T::zero());
        self.curved.predicted.resize(rows, T::zero());
    }

    /// Evaluates the gaps at the start of a stage, if a law reads them. The rows are still linearized there.
    pub(crate) fn read_start(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        past: &[Motion<T>],
        h: f64,
    ) -> Result<()> {
        let Self { start: at_start, rates, curved, .. } = self;
        let StartRows { measure, gap, tolerance, closed_slack } = at_start;
        curved.forget();
        measure.fill(Measure::AsScheme);
        let reads = constraints.laws().read_start || constraints.laws().predictive;
        let (Some(start), true) = (past.first(), reads) else { return Ok(()) };
        constraints.finite_gaps(start.t, &start.u, gap)?;
        constraints.finite_rates(start.t, &start.u, &start.v, rates)?;
        for row in (0..constraints.len()).filter(|&row| constraints.law(row).reads_start()) {
            let approach = T::of(h) * (g.product(row, &start.v) + rates[row].rate).abs();
            let rounded = constraints.gap_rounding(row, g.magnitude(row, &start.u), gap[row]);
            tolerance[row] = rounded + touching(approach);
            closed_slack[row] = (gap[row] - rounded).max(T::zero());
            measure[row] = Measure::Undecided;
        }
        Ok(())
    }

    /// Converts the gaps in y, and their tolerances, to the measure of each row whose law reads the gap at the start
    /// of the stage. `lacking` is the part of d on the interface that the velocities do not contain yet.
    pub(crate) fn measure(
        &mut self,
        stage: &CompiledStage<T>,
        h: f64,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        new: &Motion<T>,
        lacking: Option<&[T]>,
    ) -> Result<()> {
        if !constraints.laws().read_start {
            return Ok(());
        }
        let Self { rates, y, tolerance, start, .. } = self;
        constraints.finite_rates(new.t, &new.u, &new.v, rates)?;
        let (h, weight) = (T::of(h), stage.recovery.weights()[1]);
        for row in 0..constraints.len() {
            match start.measure[row] {
                Measure::AsScheme | Measure::Nothing | Measure::Undecided => {}
                Measure::Increment => y[row] -= start.gap[row] - start.closed_slack[row],
                Measure::Rate => {
                    let [part, size] = lacking.map_or([T::zero(); 2], |d| {
                        [weight * g.interface_product(row, d), weight * g.interface_magnitude(row, d)]
                    });
                    let own = rates[row].rate;
                    y[row] = h * (g.product(row, &new.v) + part + own) + start.closed_slack[row];
                    // Velocities computed as differences of displacements have the rounding of the displacements.
                    let known = if stage.recovery.subtracts(1) { g.magnitude(row, &new.u) } else { T::zero() };
                    tolerance[row] = rounding(known + h * (g.magnitude(row, &new.v) + size + own.abs()));
                }
            }
        }
        Ok(())
    }

    /// Stores the gaps of the balance before the inertia of compliant laws is added to them.
    pub(crate) fn keep_balance_gaps(&mut self) {
        self.curved.predicted.copy_from_slice(&self.laws.balance_gap);
    }

    /// The weight of d in the measure of a row, if it differs from the weight of the scheme.
    pub(crate) fn own_weight(&self, stage: &CompiledStage<T>, h: f64, row: usize) -> Option<T> {
        (self.start.measure[row] == Measure::Rate).then(|| T::of(h) * stage.recovery.weights()[1])
    }

    /// Evaluates y of all rows at the target, and their tolerances: the rounding of y and, at the end of a stage, the
    /// gap within which a contact touches.
    pub(crate) fn evaluate(
        &mut self,
        level: &Level<'_, T>,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        new: &Motion<T>,
        is_end: bool,
    ) -> Result<()> {
        let Self { rates, y, tolerance, target, start, .. } = self;
        let h = level.clock.h;
        let (t, values) = level.place(new, &target.values);
        if level.is_velocity() {
            constraints.finite_rates(t, &new.u, &new.v, rates)?;
            for row in 0..constraints.len() {
                y[row] = g.product(row, values) + T::of(h) * rates[row].rate + start.closed_slack[row];
                if !y[row].is_finite() {
                    let (contact, value) = (constraints.ids[row], y[row].value());
                    return Err(Error::ContactNotFinite { t, what: "the gap rate", contact, value });
                }
            }
        } else {
            constraints.finite_gaps(t, values, y)?;
        }
        if is_end {
            constraints.finite_rates(new.t, &new.u, &new.v, rates)?;
        }
        // Far rows have a gap above the tolerance of any row: at the end of a stage no tighter tolerance is needed.
        // With few rows, bounds over all dofs would cost more than the rows.
        let many = 16 * constraints.len() > values.len();
        let bounded = is_end && many && constraints.laws().are_uniform() && !level.is_velocity();
        let far = bounded.then(|| {
            let way = g.largest_row() * T::largest(&new.v)
                + rates[..constraints.len()].iter().fold(T::zero(), |most, x| most.max(x.rate.abs()));
            (g.largest_row() * T::largest(values), touching(T::of(h) * way))
        });
        for row in 0..constraints.len() {
            if let Some((size, way)) = far {
                tolerance[row] = constraints.gap_rounding(row, size, y[row]) + way;
                if y[row] > tolerance[row] {
                    continue;
                }
            }
            tolerance[row] = match level.is_velocity() {
                true => rounding(g.magnitude(row, values) + y[row].abs()),
                false => constraints.gap_rounding(row, g.magnitude(row, values), y[row]),
            };
            if is_end {
                let rate = g.product(row, &new.v) + rates[row].rate;
                tolerance[row] += touching(T::of(h) * rate.abs());
            }
        }
        Ok(())
    }

    /// Lists the rows of the problem, group by group, and its data. Rows are divided by their weight, which makes W
    /// symmetric for every kind of row.
    pub(crate) fn list_problem(
        &mut self,
        constraints: &Constraints<'_, T>,
        g: &ContactJacobian<T>,
        operator: &mut Operator<T>,
    ) {
        let Self { y, tolerance, weight, laws, state, curved, problem, .. } = self;
        let forces = curved.forces(g);
        let ProblemRows { rows, sorted, offset, tolerance: problem_tolerance, sets, .. } = problem;
        sorted.clear();
        constraints.tangents().expand((0..constraints.len()).filter(|&row| state[row].is_in_problem()), sorted);
        operator.sort(forces, sorted);
        rows.clear();
        rows.extend(operator.groups().positions().iter().map(|&position| sorted[position]));
        offset.clear();
        problem_tolerance.clear();
        sets.clear();
        for &row in rows.iter() {
            // A row with a known force has no weight.
            let known = weight[row] == T::zero();
            offset.push(if known { T::zero() } else { (y[row] + laws.shift[row]) / weight[row] });
            problem_tolerance.push(if known { T::zero() } else { tolerance[row] / weight[row] });
            if !forces.is_tangential(row) {
                sets.push(constraints.set(row));
            }
        }
    }
}

/// Where a stage imposes contact.
pub(crate) struct Level<'s, T> {
    pub(crate) target: Option<&'s ContactTarget<T>>,
    pub(crate) clock: Clock,
}

impl<T: Real> Level<'_, T> {
    pub(crate) fn is_velocity(&self) -> bool {
        self.target.is_some_and(|target| target.forecast.is_some())
    }

    /// Time and values that contact constrains.
    pub(crate) fn place<'v>(&self, new: &'v Motion<T>, target: &'v [T]) -> (f64, &'v [T]) {
        match self.target {
            None => (new.t, &new.u),
            Some(rows) => (self.clock.at(rows.at), target),
        }
    }
}
