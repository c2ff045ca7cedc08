//! Dofs without mass in explicit stages: they follow from static balance with the others and with contact, before
//! anything else of the stage is solved.

use super::contact_step::{ContactStep, Part};
use super::operator::Operator;
use super::program::CompiledStage;
use super::step::StageSolve;
use super::{Constraints, Workspace};
use crate::contact::{Candidates, ContactJacobian, ContactLaw};
use crate::contact_solver::{Bound, ContactProblem, ContactSolver};
use crate::corrector::{Gaps, contact_error, rounding};
use crate::error::{Error, Result};
use crate::linear_solver::{Automatic, Condensation, Factorization, LinearSolver};
use crate::real::Real;
use crate::sparse::{self, Combination};
use crate::state::Motion;
use crate::system::{Damping, Linearity, System, TangentWeights};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat};

/// The dofs b without mass of a linear system, and what of K is theirs.
pub(super) struct MasslessBlock<T: Real> {
    /// Ascending.
    pub(super) dofs: Vec<usize>,
    columns: Columns<T>,
    /// K_bb⁻¹, with its responses to contact.
    operator: Operator<T>,
    /// Where it is solved: d is the displacement itself.
    stage: CompiledStage<T>,
    /// The dofs of the interface that have a mass, and their places there.
    massive: Vec<(usize, usize)>,
    /// The places of its own dofs on the interface; beyond its end for those that are not there.
    places: Vec<usize>,
    /// Version of the rows that have been sorted into those on massless dofs and others.
    sorted: u64,
}

/// Columns of K, one a massless dof: its couplings to all free dofs.
struct Columns<T> {
    pointers: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<T>,
}

impl<T: Real> Columns<T> {
    /// From the tangent, or for an empty pattern by one evaluation of the force a column. (The system is linear: where
    /// the tangent is taken says nothing.)
    fn of(system: &mut dyn System<T>, dofs: &[usize], at: &Motion<T>) -> Result<Self> {
        let mut free = vec![true; system.dofs()];
        for &dof in system.prescribed() {
            free[dof] = false;
        }
        let mut columns = Self { pointers: vec![0], rows: Vec::new(), values: Vec::new() };
        let entries = system.pattern().row_idx().len();
        if entries > 0 {
            let mut values = vec![T::zero(); entries];
            let weights = TangentWeights { stiffness: T::one(), damping: T::zero() };
            system.tangent(at.t, &at.u, &at.v, weights, &mut values)?;
            let k = SparseColMatRef::new(system.pattern(), &values);
            for &dof in dofs {
                columns.push(k.row_idx_of_col_raw(dof).iter().copied().zip(k.val_of_col(dof).iter().copied()), &free);
            }
            return Ok(columns);
        }
        let mut force = vec![T::zero(); system.dofs()];
        let (mut moved, mut u) = (force.clone(), at.u.clone());
        system.force(at.t, &u, &at.v, &mut force)?;
        // The step is as large as what it is added to, so that the difference keeps its digits.
        let size = at.u.iter().fold(T::zero(), |largest, u| largest.max(u.abs()));
        let size = if size > T::zero() { size } else { T::one() };
        for &dof in dofs {
            u[dof] += size;
            system.force(at.t, &u, &at.v, &mut moved)?;
            let step = u[dof] - at.u[dof];
            u[dof] = at.u[dof];
            let largest = moved.iter().zip(&force).fold(T::zero(), |largest, (&x, &y)| largest.max((x - y).abs()));
            let differences = moved.iter().zip(&force).map(|(&x, &y)| {
                let difference = y - x;
                // What is rounding of the forces is no coupling.
                let known = difference.abs() > rounding(x.abs().max(y.abs())).min(rounding(largest));
                if known { difference / step } else { T::zero() }
            });
            columns.push(differences.enumerate(), &free);
        }
        Ok(columns)
    }

    fn push(&mut self, entries: impl Iterator<Item = (usize, T)>, free: &[bool]) {
        for (row, value) in entries.filter(|&(row, value)| free[row] && value != T::zero()) {
            self.rows.push(row);
            self.values.push(value);
        }
        self.pointers.push(self.rows.len());
    }

    fn column(&self, j: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        let range = self.pointers[j]..self.pointers[j + 1];
        self.rows[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    /// The couplings to other dofs alone.
    fn without(&self, dofs: &[usize]) -> Self {
        let mut others = Self { pointers: vec![0], rows: Vec::new(), values: Vec::new() };
        for j in 0..dofs.len() {
            for (row, value) in self.column(j).filter(|(row, _)| dofs.binary_search(row).is_err()) {
                others.rows.push(row);
                others.values.push(value);
            }
            others.pointers.push(others.rows.len());
        }
        others
    }

    /// K_bb, in the numbering of `dofs`.
    fn own(&self, dofs: &[usize]) -> Result<SparseColMat<usize, T>> {
        let (mut pointers, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for j in 0..dofs.len() {
            for (row, value) in self.column(j) {
                if let Ok(row) = dofs.binary_search(&row) {
                    rows.push(row);
                    values.push(value);
                }
            }
            pointers.push(rows.len());
        }
        let own = SymbolicSparseColMat::new_checked(dofs.len(), dofs.len(), pointers, None, rows);
        let own = SparseColMat::new(own, values);
        sparse::check_symmetric("stiffness", own.as_ref())?;
        // With its whole diagonal.
        let sum = Combination::new(dofs.len(), &[], &[own.symbolic()])?;
        let mut values = vec![T::zero(); sum.len()];
        sum.fill(&[(T::one(), own.val())], None, &mut values);
        Ok(sum.into_matrix(values))
    }
}

/// A factor of K_bb that takes vectors of the whole system, and an interface of which it knows a part: other dofs do
/// not respond.
#[derive(Debug)]
struct Embedded<T> {
    inner: Box<dyn Factorization<T>>,
    dofs: Vec<usize>,
    /// Where on the interface its own dofs there are, ascending, and how many are there in all.
    places: Vec<usize>,
    interface: usize,
    /// One entry a dof of its own, and one a dof of its own on the interface.
    vector: Vec<T>,
    on_interface: Vec<T>,
}

fn gather<T: Copy>(all: &[T], places: &[usize], some: &mut [T]) {
    for (x, &place) in some.iter_mut().zip(places) {
        *x = all[place];
    }
}

fn scatter<T: Copy>(some: &[T], places: &[usize], all: &mut [T]) {
    for (&x, &place) in some.iter().zip(places) {
        all[place] = x;
    }
}

impl<T: Real> Factorization<T> for Embedded<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let dofs = &self.dofs;
        self.inner.factorize(a).map_err(|error| match error {
            Error::Singular { dof, .. } => Error::Singular {
                matrix: "stiffness of the dofs without mass",
                dof: dofs.get(dof).copied().unwrap_or(dof),
            },
            other => other,
        })
    }

    /// Entries of other dofs are left as they are.
    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        gather(rhs, &self.dofs, &mut self.vector);
        self.inner.solve(&mut self.vector)?;
        scatter(&self.vector, &self.dofs, rhs);
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.inner.stored_values()
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        Some(self)
    }
}

impl<T: Real> Condensation<T> for Embedded<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        let Self { inner, dofs, places, vector, on_interface, .. } = self;
        gather(rhs, dofs, vector);
        interface.fill(T::zero());
        match inner.condensation().filter(|_| !places.is_empty()) {
            Some(condensed) => condensed.condense(vector, on_interface)?,
            None => inner.solve(vector)?,
        }
        scatter(on_interface, places, interface);
        Ok(())
    }

    /// Entries of other dofs are left as they are.
    fn expand(&mut self, interface: &[T], solution: &mut [T]) {
        let Self { inner, dofs, places, vector, on_interface, .. } = self;
        gather(interface, places, on_interface);
        if let Some(condensed) = inner.condensation().filter(|_| !places.is_empty()) {
            condensed.expand(on_interface, vector);
        }
        scatter(vector, dofs, solution);
    }

    fn solve(&mut self, forces: &mut [T]) {
        let Self { inner, places, on_interface, interface, .. } = self;
        for column in forces.chunks_exact_mut((*interface).max(1)) {
            gather(column, places, on_interface);
            column.fill(T::zero());
            if let Some(condensed) = inner.condensation().filter(|_| !places.is_empty()) {
                condensed.solve(on_interface);
                scatter(on_interface, places, column);
            }
        }
    }
}

impl<T: Real> Embedded<T> {
    /// K_bb from its columns, factorized.
    fn factorized(columns: &Columns<T>, dofs: &[usize], interface: &[usize]) -> Result<Self> {
        let own = columns.own(dofs)?;
        let shared =
            interface.iter().enumerate().filter_map(|(place, dof)| Some((place, dofs.binary_search(dof).ok()?)));
        let (places, last): (Vec<usize>, Vec<usize>) = shared.unzip();
        let mut factor = Self {
            inner: Automatic.analyze(own.symbolic(), &last)?,
            dofs: dofs.to_vec(),
            on_interface: vec![T::zero(); places.len()],
            places,
            interface: interface.len(),
            vector: vec![T::zero(); dofs.len()],
        };
        factor.factorize(own.as_ref())?;
        Ok(factor)
    }
}

/// Times rows are linearized again where the dofs without mass have gone, at most.
const LINEARIZATIONS: usize = 20;

impl<T: Real> MasslessBlock<T> {
    /// Refuses systems for which it cannot be made.
    pub(super) fn new(
        system: &mut dyn System<T>,
        integrator: &str,
        dofs: &[usize],
        at: &Motion<T>,
        (rows, interface): (usize, &[usize]),
    ) -> Result<Self> {
        let refuse = |reason| {
            Err(Error::Incompatible { part: format!("{integrator} with dof {} without mass", dofs[0]), reason })
        };
        if system.linearity() == Linearity::Nonlinear {
            return refuse(
                "explicit stages find the displacements of dofs without mass by one factor of their stiffness, and the system \
                 is nonlinear; choose an implicit scheme, or give the dofs a mass",
            );
        }
        if is_damped(system, dofs) {
            return refuse(
                "explicit stages balance dofs without mass by stiffness alone, and damping acts on them; choose damping \
                 proportional to mass or an implicit scheme, or give the dofs a mass",
            );
        }
        let columns = Columns::of(system, dofs, at)?;
        let factor = Embedded::factorized(&columns, dofs, interface)?;
        let massive = interface.iter().enumerate().filter(|(_, dof)| dofs.binary_search(dof).is_err());
        Ok(Self {
            dofs: dofs.to_vec(),
            columns: columns.without(dofs),
            operator: Operator::of_part(Box::new(factor), rows, interface)?,
            stage: CompiledStage::of_displacements(),
            massive: massive.map(|(place, &dof)| (dof, place)).collect(),
            places: dofs.iter().map(|dof| interface.binary_search(dof).unwrap_or(interface.len())).collect(),
            sorted: 0,
        })
    }
}

/// What a simulation has moved before its first step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartAdjustment<T> {
    /// Change of the potential energy, that of the load (its force times the way) included: what the jump would have
    /// taken from the run, not positive. None if the system has no potential.
    pub energy: Option<T>,
    /// The largest change of a displacement (length), and of which dof.
    pub largest: T,
    /// The dof that has moved most.
    pub dof: usize,
}

/// Iterations of the balance at the start, at most: two for linear systems.
const ITERATIONS: usize = 30;

/// Brings dofs without mass into static balance with the other dofs, the load and contact, by Newton's method:
/// f_b + Gᵀ λ = 0, 0 ≤ g ⊥ λ ≥ 0. Those that are in balance to rounding are left alone, bit for bit, and so are those that
/// damping acts on: their displacements are initial values of their own.
pub(super) fn balance_start<T: Real>(
    system: &mut dyn System<T>,
    solver: &mut dyn ContactSolver<T>,
    (constraints, g): (&mut Constraints<'_, T>, &mut ContactJacobian<T>),
    motion: &mut Motion<T>,
    dofs: &[usize],
    [h, ahead]: [f64; 2],
) -> Result<Option<StartAdjustment<T>>> {
    if dofs.is_empty() || is_damped(system, dofs) {
        return Ok(None);
    }
    let t = motion.t;
    let given = motion.u.clone();
    let largest = |x: &[T]| x.iter().fold(T::zero(), |largest, x| largest.max(x.abs()));
    let interface = constraints.interface().to_vec();
    let mut residual = vec![T::zero(); motion.u.len()];
    let (mut on_interface, mut forces) = (vec![T::zero(); interface.len()], vec![T::zero(); interface.len()]);
    let mut first = T::zero();
    for iteration in 0..ITERATIONS {
        system.force(t, &motion.u, &motion.v, &mut residual)?;
        let columns = Columns::of(system, dofs, motion)?;
        let factor = match Embedded::factorized(&columns, dofs, &interface) {
            Ok(factor) => factor,
            // Without a definite stiffness of their own there is no balance to speak of: the step will say what it can
            // do.
            Err(Error::Asymmetric { .. } | Error::Singular { .. }) => {
                motion.u = given;
                constraints.search(motion, ahead, g)?;
                return Ok(None);
            }
            Err(other) => return Err(other),
        };
        let mut operator = Operator::of_part(Box::new(factor), constraints.capacity(), &interface)?;
        operator.begin(&mut residual, &mut on_interface)?;
        let sliver = press_start(
            solver,
            (&mut *constraints, &*g),
            &mut operator,
            motion,
            dofs,
            [&mut on_interface, &mut forces],
        )?;
        operator.finish(&mut residual, &on_interface, &forces)?;
        let size = dofs.iter().fold(T::zero(), |size, &dof| {
            let d = residual[dof].abs();
            if d > size || d.is_nan() { d } else { size }
        });
        if !size.is_finite() {
            let (dof, value) = (dofs[0], size.value());
            return Err(Error::StepNotFinite { t, h, what: "the displacement in static balance", dof, value });
        }
        let scale = largest(&motion.u).max(largest(&given));
        // (Gaps are met within their own rounding, which coordinates may make larger than that of displacements.)
        let settled = size <= T::of(1e3) * T::epsilon() * scale + T::of(4.0) * sliver;
        if iteration == 0 {
            if settled {
                return Ok(None);
            }
            first = size;
        }
        for &dof in dofs {
            motion.u[dof] += residual[dof];
        }
        let moved = constraints.follow(t, &motion.u, g)?;
        if settled || moved == Candidates::Unchanged && size <= T::of(1e-12) * first {
            let moves = |dof: usize| motion.u[dof] - given[dof];
            let &dof =
                dofs.iter().max_by(|&&i, &&j| moves(i).abs().value().total_cmp(&moves(j).abs().value())).unwrap_or(&0);
            let energies = [system.potential_energy(&given), system.potential_energy(&motion.u)];
            system.external_load(t, &mut residual);
            let work = dofs.iter().map(|&dof| residual[dof] * moves(dof)).sum::<T>();
            let energy = energies[0].zip(energies[1]).map(|(before, after)| after - before - work);
            return Ok(Some(StartAdjustment { energy, largest: moves(dof).abs(), dof }));
        }
    }
    Err(Error::StartNotBalanced { iterations: ITERATIONS, dof: dofs[0] })
}

/// The contact problem of an iteration: adds the response to d on the interface, and leaves the forces there. Returns
/// the largest way by which gaps may be missed, as a displacement.
fn press_start<T: Real>(
    solver: &mut dyn ContactSolver<T>,
    (constraints, g): (&mut Constraints<'_, T>, &ContactJacobian<T>),
    operator: &mut Operator<T>,
    motion: &Motion<T>,
    dofs: &[usize],
    [on_interface, forces]: [&mut Vec<T>; 2],
) -> Result<T> {
    let (t, rows) = (motion.t, constraints.len());
    let (mut gaps, mut versions) = (vec![T::zero(); rows], 0);
    constraints.finite_gaps(t, &motion.u, &mut gaps)?;
    forces.fill(T::zero());
    let tolerance: Vec<T> =
        (0..rows).map(|row| constraints.gap_rounding(row, g.magnitude(row, &motion.u), gaps[row])).collect();
    let candidates: Vec<usize> = (0..rows).filter(|&row| g.acts_on(row, dofs)).collect();
    // What the rows ask for at d on the interface, laws linearized where the motion is.
    let laws: Vec<[T; 2]> = (0..rows)
        .map(|row| {
            let law = constraints.law(row);
            let depth = (-gaps[row]).max(tolerance[row]);
            let (compliance, shift) = law.linearized(depth, T::zero());
            if law.is_compliant() { [compliance, shift] } else { [T::zero(); 2] }
        })
        .collect();
    let free: Vec<T> = (0..rows).map(|row| gaps[row] + g.interface_product(row, on_interface) + laws[row][1]).collect();
    let mut problem: Vec<usize> = Vec::new();
    let mut response = vec![T::zero(); on_interface.len()];
    loop {
        let pushed = |&row: &usize| {
            let y = free[row] + g.interface_product(row, &response);
            !problem.contains(&row) && (y < -tolerance[row] || constraints.law(row).is_equality())
        };
        let joining: Vec<usize> = candidates.iter().copied().filter(pushed).collect();
        if joining.is_empty() {
            break;
        }
        problem.extend(joining);
        problem.sort_unstable();
        let pick = |values: &[T]| -> Vec<T> { problem.iter().map(|&row| values[row]).collect() };
        let (offset, rounded) = (pick(&free), pick(&tolerance));
        let bounds: Vec<Bound> = problem.iter().map(|&row| constraints.law(row).into()).collect();
        let (delassus, version) = operator.delassus(g, &problem, |k| laws[problem[k]][0], &mut versions)?;
        let data = ContactProblem { delassus, offset: &offset, bounds: &bounds, tolerance: &rounded, version };
        let mut lambda = vec![T::zero(); problem.len()];
        solver.reserve(problem.len());
        solver
            .solve(&data, &mut lambda)
            .map_err(|failure| contact_error(t, failure, |i| constraints.ids[problem[i]]))?;
        response.fill(T::zero());
        forces.fill(T::zero());
        for (&row, &lambda) in problem.iter().zip(&lambda) {
            T::axpy(lambda, operator.response(row), &mut response);
            g.interface_scatter(row, lambda, forces);
        }
    }
    T::axpy(T::one(), &response, on_interface);
    // (A row of unit weights moves a dof no further than its gap.)
    Ok(problem.iter().fold(T::zero(), |sliver, &row| sliver.max(tolerance[row])))
}

/// Whether damping forces depend on the velocities of some dofs.
pub(super) fn is_damped<T: Real>(system: &mut dyn System<T>, dofs: &[usize]) -> bool {
    let mut v = vec![T::zero(); system.dofs()];
    let (u, mut force) = (v.clone(), v.clone());
    for &dof in dofs {
        // (Without a pattern, so that nothing cancels.)
        v[dof] = T::of(1.0 + (sparse::scattered(dof) >> 12) as f64 / (1_u64 << 52) as f64);
    }
    system.damping_force(&u, &v, &mut force) == Damping::Present && force.iter().any(|&force| force != T::zero())
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Brings dofs without mass into static balance with the predicted displacements of the others, and with contact.
    /// The residual in `work.increment` becomes that of the others in this configuration, with the forces of contact on
    /// the dofs without mass.
    ///
    /// Rows follow these dofs: an iteration of Newton's method on the gaps alone, for the balance is linear.
    pub(super) fn settle(
        &mut self,
        block: &mut MasslessBlock<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<()> {
        (block.stage.load, block.stage.end) = (self.stage.load, self.stage.end);
        let mut first = T::zero();
        for pass in 0..LINEARIZATIONS {
            self.sort_rows(block, work)?;
            block.operator.follow(self.constraints.version());
            block.operator.begin(&mut work.increment, &mut work.interface.increment)?;
            self.statistics.linear_solves += 1;
            work.interface.forces.fill(T::zero());
            if self.constraints.len() > 0 && T::all_finite(&work.interface.increment) {
                let Self { clock, system, constraints, g, solver, statistics, .. } = self;
                let (stage, solver, part) = (&block.stage, &mut **solver, Part::Massless);
                let mut contact =
                    ContactStep { stage, clock: *clock, constraints, g, solver, statistics, iterate: None, part };
                let settled = contact.solve(&mut **system, &mut block.operator, new, past, work)?;
                self.refuse_unsettled(settled, new.t, work)?;
            }
            let Workspace { increment, interface, balance, .. } = &mut *work;
            block.operator.finish(increment, &interface.increment, &interface.forces)?;
            let (mut largest, mut scale) = (T::zero(), T::zero());
            for (j, &dof) in block.dofs.iter().enumerate() {
                let d = increment[dof];
                if !d.is_finite() {
                    let (t, h, value) = (self.clock.at(0.0), self.clock.h, d.value());
                    return Err(Error::StepNotFinite { t, h, what: "the increment", dof, value });
                }
                new.u[dof] += d;
                (largest, scale) = (largest.max(d.abs()), scale.max(new.u[dof].abs()));
                for (row, k) in block.columns.column(j) {
                    increment[row] -= k * d;
                }
                increment[dof] = T::zero();
            }
            if pass == 0 {
                first = largest;
            }
            let moved = self.constraints.follow(new.t, &new.u, self.g)?;
            let settled = pass > 0 && largest <= rounding(scale) + T::of(1e-9) * first;
            if moved == Candidates::Unchanged || settled {
                for &(dof, place) in &block.massive {
                    increment[dof] += interface.forces[place];
                }
                if let Some(balance) = balance {
                    for &dof in &block.dofs {
                        balance.u[dof] = new.u[dof];
                    }
                }
                self.operator.follow(self.constraints.version());
                return self.sort_rows(block, work);
            }
            // What is left without contact is what contact has balanced.
            for (&dof, &place) in block.dofs.iter().zip(&block.places) {
                increment[dof] = if place < interface.forces.len() { -interface.forces[place] } else { T::zero() };
            }
        }
        let (t, h) = (self.clock.at(0.0), self.clock.h);
        Err(Error::NewtonNotConverged {
            t,
            h,
            iterations: LINEARIZATIONS,
            residual: 0.0,
            increment: if first > T::zero() { 1.0 } else { 0.0 },
            dof: block.dofs[0],
        })
    }

    /// Says of every row whether it acts on dofs without mass, and refuses laws that ask for more than a gap there.
    fn sort_rows(&self, block: &mut MasslessBlock<T>, work: &mut Workspace<T>) -> Result<()> {
        if block.sorted == self.constraints.version() {
            return Ok(());
        }
        for row in 0..self.constraints.len() {
            let on_massless = self.g.acts_on(row, &block.dofs);
            work.rows.on_massless[row] = on_massless;
            let law = self.constraints.law(row);
            let rebounds = matches!(law, ContactLaw::Restitution { coefficient } if coefficient > 0.0);
            if on_massless && (rebounds || law.inertia() > 0.0) {
                return Err(Error::Incompatible {
                    part: format!("{law:?} of contact {} on dofs without mass", self.constraints.ids[row]),
                    reason: "such dofs stop and start at once; choose a law that reads the gap alone, or give them a mass",
                });
            }
        }
        block.sorted = self.constraints.version();
        Ok(())
    }
}
