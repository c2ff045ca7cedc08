//! The quantity that each contact row constrains in a stage, and the buffers of the contact problem.

use crate::contact::{ContactJacobian, GapRates, Measure};
use crate::contact_solver::{AdmissibleSet, ContactProblem, FORESEEN};
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{rounding, touching};
use crate::simulation::build::program::{CompiledStage, ContactTarget};
use crate::simulation::operator::Operator;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::curved_rows::CurvedRowsWork;
use crate::state::{Clock, Motion};

/// The rows that a contact problem contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// All rows.
    All,
    /// Rows that act on dofs without mass in an explicit stage: solved first, with the static balance of these dofs.
    Massless,
    /// The other rows, solved after these.
    Massive,
}

impl Part {
    /// Whether the problem contains a row.
    pub(crate) fn takes(self, on_massless: &[bool], row: usize) -> bool {
        match self {
            Self::All => true,
            Self::Massless => on_massless[row],
            Self::Massive => !on_massless[row],
        }
    }
}

/// Buffers of the contact problem, one entry per row of G unless said otherwise: candidates, then tangential rows.
pub(crate) struct ContactRowsWork<T> {
    pub(crate) rates: Vec<GapRates<T>>,
    /// The same for slips, one per tangential row.
    pub(crate) slips: Vec<GapRates<T>>,
    /// Whether slips are displacements in the stage although the velocities contain the unknown.
    pub(crate) slides_by_way: bool,
    /// Free dofs without mass.
    pub(crate) massless: Vec<usize>,
    /// The quantity complementary to the multiplier, as a length: the gap, or h times the gap rate at velocity level.
    pub(crate) y: Vec<T>,
    pub(crate) tolerance: Vec<T>,
    /// The weight of d in y.
    pub(crate) weight: Vec<T>,
    /// The laws, linearized: 0 ≤ y + compliance λ + shift ⊥ λ ≥ 0.
    pub(crate) compliance: Vec<T>,
    pub(crate) shift: Vec<T>,
    /// Gaps where the balance holds, for compliant laws.
    pub(crate) balance_gap: Vec<T>,
    /// −ġ where the balance holds, for laws that read it.
    pub(crate) approach: Vec<T>,
    pub(crate) curved: CurvedRowsWork<T>,
    /// The quantity that each row constrains in this stage. For laws that read the gap at the start of the stage:
    /// this gap, and the gap below which the row counts as closed.
    pub(crate) measure: Vec<Measure>,
    pub(crate) start_gap: Vec<T>,
    pub(crate) start_tolerance: Vec<T>,
    /// Rows that may carry a force in this stage; at velocity level, rows whose forecast gap is closed.
    pub(crate) enabled: Vec<bool>,
    /// Gap beyond rounding of closed rows that constrain a rate or an increment: they may close by it. Without this
    /// offset, rounding would slowly lift a resting contact until it counts as open.
    pub(crate) hover: Vec<T>,
    /// Rows in the contact problem.
    pub(crate) in_problem: Vec<bool>,
    /// Rows of [`Part::Massless`]; empty where dofs without mass are solved together with the others.
    pub(crate) on_massless: Vec<bool>,
    /// Rows of the problem. The data of the problem have one entry per row of it.
    pub(crate) problem: Vec<usize>,
    /// Compliances of these rows, and magnitude of the diagonal of W, if W is applied and not formed.
    pub(crate) own: Vec<T>,
    pub(crate) scale: Vec<T>,
    /// The same rows, ascending.
    pub(crate) sorted: Vec<usize>,
    /// Number of rows for which the contact solver has reserved memory.
    pub(crate) reserved: usize,
    /// Number of rows for which the available memory has been checked; small problems are not checked.
    pub(crate) most: usize,
    /// Number of Delassus operators assembled so far: the newest version.
    pub(crate) versions: u64,
    pub(crate) offset: Vec<T>,
    pub(crate) problem_tolerance: Vec<T>,
    pub(crate) sets: Vec<AdmissibleSet>,
    pub(crate) multipliers: Vec<T>,
    pub(crate) known: KnownForces<T>,
    /// The values that contact constrains, and the displacements of the gap forecast, one entry a dof; empty for
    /// schemes that impose contact on the displacements of the new state.
    pub(crate) target: Vec<T>,
    pub(crate) forecast: Vec<T>,
    /// Prescribed motions at the time of the target or of the forecast.
    pub(crate) supports: Vec<[T; 3]>,
}

impl<T: Real> ContactRowsWork<T> {
    /// Buffers for `rows` contacts with `entries` weights, and for targets of `target_dofs` and forecasts of
    /// `forecast_dofs` dofs (0 if the scheme has none) with `supports` prescribed dofs.
    pub(crate) fn new([rows, entries]: [usize; 2], target_dofs: usize, forecast_dofs: usize, supports: usize) -> Self {
        let mut work = Self {
            rates: Vec::new(),
            slips: Vec::new(),
            slides_by_way: false,
            massless: Vec::new(),
            y: Vec::new(),
            tolerance: Vec::new(),
            weight: Vec::new(),
            compliance: Vec::new(),
            shift: Vec::new(),
            balance_gap: Vec::new(),
            approach: Vec::new(),
            curved: CurvedRowsWork::new(),
            measure: Vec::new(),
            start_gap: Vec::new(),
            start_tolerance: Vec::new(),
            enabled: Vec::new(),
            hover: Vec::new(),
            in_problem: Vec::new(),
            on_massless: Vec::new(),
            problem: Vec::new(),
            own: Vec::new(),
            scale: Vec::new(),
            sorted: Vec::new(),
            reserved: rows.min(FORESEEN),
            most: FORESEEN,
            versions: 0,
            offset: Vec::new(),
            problem_tolerance: Vec::new(),
            sets: Vec::new(),
            multipliers: Vec::new(),
            known: KnownForces { delassus: Vec::new(), offset: Vec::new() },
            target: vec![T::zero(); target_dofs],
            forecast: vec![T::zero(); forecast_dofs],
            supports: vec![[T::zero(); 3]; supports],
        };
        work.make_room(rows, entries);
        work
    }

    /// Memory for `rows` rows with `entries` weights.
    pub(crate) fn make_room(&mut self, rows: usize, entries: usize) {
        let Self { rates, y, tolerance, weight, compliance, shift, balance_gap, approach, .. } = self;
        for values in [y, tolerance, weight, compliance, shift, balance_gap, approach] {
            values.resize(rows, T::zero());
        }
        for values in [&mut self.start_gap, &mut self.start_tolerance, &mut self.hover] {
            values.resize(rows, T::zero());
        }
        rates.resize(rows, GapRates::default());
        if !self.slips.is_empty() {
            self.slips.resize(rows, GapRates::default());
        }
        let Self { curved, measure, enabled, in_problem, on_massless, problem, sorted, sets, .. } = self;
        curved.make_room(rows, entries);
        measure.resize(rows, Measure::AsScheme);
        enabled.resize(rows, true);
        in_problem.resize(rows, false);
        if !on_massless.is_empty() {
            on_massless.resize(rows, false);
        }
        problem.reserve(rows);
        sorted.reserve(rows);
        sets.reserve(rows);
        for values in [&mut self.offset, &mut self.problem_tolerance, &mut self.multipliers] {
            values.reserve(rows);
        }
    }

    /// Lists the rows of the problem, group by group, and its data. Rows are divided by their weight, which makes W
    /// symmetric for every kind of row.
    pub(crate) fn list_problem(
        &mut self,
        constraints: &Constraints<'_, T>,
        g: &ContactJacobian<T>,
        operator: &mut Operator<T>,
    ) {
        let Self { y, tolerance, weight, shift, in_problem, sorted, problem, offset, sets, curved, .. } = self;
        let forces = curved.forces(g);
        sorted.clear();
        constraints.tangents().expand((0..constraints.len()).filter(|&row| in_problem[row]), sorted);
        operator.sort(forces, sorted);
        problem.clear();
        problem.extend(operator.groups().positions().iter().map(|&position| sorted[position]));
        offset.clear();
        self.problem_tolerance.clear();
        sets.clear();
        for &j in problem.iter() {
            // A row with a known normal force has no weight.
            let known = weight[j] == T::zero();
            offset.push(if known { T::zero() } else { (y[j] + shift[j]) / weight[j] });
            self.problem_tolerance.push(if known { T::zero() } else { tolerance[j] / weight[j] });
            if !forces.is_tangential(j) {
                sets.push(constraints.set(j));
            }
        }
    }

    /// Evaluates the gaps at the start of a stage, if a law reads them. The rows are still linearized there.
    pub(crate) fn read_start(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        past: &[Motion<T>],
        h: f64,
    ) -> Result<()> {
        let Self { measure, start_gap, start_tolerance, hover, rates, curved, .. } = self;
        curved.forget();
        measure.fill(Measure::AsScheme);
        let reads = constraints.laws().read_start || constraints.laws().predictive;
        let (Some(start), true) = (past.first(), reads) else { return Ok(()) };
        constraints.finite_gaps(start.t, &start.u, start_gap)?;
        constraints.finite_rates(start.t, &start.u, &start.v, rates)?;
        for row in (0..constraints.len()).filter(|&row| constraints.law(row).reads_start()) {
            let approach = T::of(h) * (g.product(row, &start.v) + rates[row].rate).abs();
            let rounded = constraints.gap_rounding(row, g.magnitude(row, &start.u), start_gap[row]);
            start_tolerance[row] = rounded + touching(approach);
            hover[row] = (start_gap[row] - rounded).max(T::zero());
            measure[row] = Measure::Undecided;
        }
        Ok(())
    }

    /// Decides the measure of rows whose law reads the gap at the start of the stage. y holds the gaps of the motion
    /// without contact.
    pub(crate) fn decide(&mut self, constraints: &Constraints<'_, T>) {
        if !constraints.laws().read_start {
            return;
        }
        let Self { y, measure, start_gap, start_tolerance, .. } = self;
        for (row, measure) in measure[..constraints.len()].iter_mut().enumerate() {
            if *measure != Measure::Undecided {
                continue;
            }
            // The gap of a resting contact is small compared with the displacement that its force prevents, from the
            // gap at the start to the gap of the free motion.
            let closed = start_gap[row] <= start_tolerance[row] + touching((y[row] - start_gap[row]).abs());
            *measure = constraints.law(row).measure(closed);
        }
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
        let Self { rates, y, tolerance, measure, start_gap, hover, .. } = self;
        constraints.finite_rates(new.t, &new.u, &new.v, rates)?;
        let (h, weight) = (T::of(h), stage.recovery.weights()[1]);
        for row in 0..constraints.len() {
            match measure[row] {
                Measure::AsScheme | Measure::Nothing | Measure::Undecided => {}
                Measure::Increment => y[row] -= start_gap[row] - hover[row],
                Measure::Rate => {
                    let [part, size] = lacking.map_or([T::zero(); 2], |d| {
                        [weight * g.interface_product(row, d), weight * g.interface_magnitude(row, d)]
                    });
                    let own = rates[row].rate;
                    y[row] = h * (g.product(row, &new.v) + part + own) + hover[row];
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
        self.curved.foreseen.copy_from_slice(&self.balance_gap);
    }

    /// The weight of d in the measure of a row, if it differs from the weight of the scheme.
    pub(crate) fn own_weight(&self, stage: &CompiledStage<T>, h: f64, row: usize) -> Option<T> {
        (self.measure[row] == Measure::Rate).then(|| T::of(h) * stage.recovery.weights()[1])
    }

    /// Evaluates y of all rows at the target, and their tolerances: the rounding of y, and a fraction `approach` of
    /// the change of the gap in one step.
    pub(crate) fn evaluate(
        &mut self,
        level: &Level<'_, T>,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        new: &Motion<T>,
        approach: f64,
    ) -> Result<()> {
        let Self { rates, y, tolerance, target, hover, .. } = self;
        let h = level.clock.h;
        let (t, values) = level.place(new, target);
        if level.is_velocity() {
            constraints.finite_rates(t, &new.u, &new.v, rates)?;
            for row in 0..constraints.len() {
                y[row] = g.product(row, values) + T::of(h) * rates[row].rate + hover[row];
                if !y[row].is_finite() {
                    let (contact, value) = (constraints.ids[row], y[row].value());
                    return Err(Error::ContactNotFinite { t, what: "the gap rate", contact, value });
                }
            }
        } else {
            constraints.finite_gaps(t, values, y)?;
        }
        if approach > 0.0 {
            constraints.finite_rates(new.t, &new.u, &new.v, rates)?;
        }
        // Far rows have a gap above the tolerance of any row: at the end of a stage no tighter tolerance is needed.
        // With few rows, bounds over all dofs would cost more than the rows.
        let many = 16 * constraints.len() > values.len();
        let ends = approach > 0.0 && many && constraints.laws().are_uniform() && !level.is_velocity();
        let far = ends.then(|| {
            let way = g.largest_row() * T::largest(&new.v)
                + rates[..constraints.len()].iter().fold(T::zero(), |most, x| most.max(x.rate.abs()));
            (g.largest_row() * T::largest(values), T::of(approach * h) * way)
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
            if approach > 0.0 {
                let rate = g.product(row, &new.v) + rates[row].rate;
                tolerance[row] += T::of(approach * h) * rate.abs();
            }
        }
        Ok(())
    }
}

/// A contact problem in which some normal multipliers are known: their rows are the uncoupled equations λ = force.
pub(crate) struct KnownForces<T> {
    delassus: Vec<T>,
    offset: Vec<T>,
}

impl<T: Real> KnownForces<T> {
    /// Poses the problem with the rows whose multiplier is given by `force` uncoupled from all others.
    pub(crate) fn pose<'p>(
        &'p mut self,
        problem: &ContactProblem<'p, T>,
        force: impl Fn(usize) -> Option<T>,
    ) -> ContactProblem<'p, T> {
        let (Self { delassus, offset }, size) = (self, problem.size());
        delassus.clear();
        offset.clear();
        // The diagonal of an uncoupled row is arbitrary, and forces of a static balance are in another unit than W:
        // the largest of the other diagonals is used.
        let unknown = (0..size).filter(|&i| force(i).is_none());
        let largest = unknown.fold(T::zero(), |largest, i| largest.max(problem.delassus(i, i)));
        let own = |i: usize| if largest > T::zero() { largest } else { problem.delassus(i, i) };
        for i in 0..size {
            let known = force(i);
            let entry = |j: usize| match (i == j, known.is_some() || force(j).is_some()) {
                (false, true) => T::zero(),
                (true, _) if known.is_some() => own(i),
                _ => problem.delassus(i, j),
            };
            delassus.extend((0..size).map(entry));
            offset.push(known.map_or(problem.offset[i], |force| -own(i) * force));
        }
        ContactProblem::of(delassus, offset, problem.sets, problem.tolerance, 0)
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
