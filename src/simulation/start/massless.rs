//! Dofs without mass at the start of a run, or all dofs of a run that starts at rest: brought into static balance
//! with the others, the load and contact.

use crate::contact::{Candidates, ContactJacobian, Course};
use crate::contact_solver::{ContactProblem, ContactSolver};
use crate::corrector::{Gaps, contact_error};
use crate::error::{Error, Result};
use crate::linear_solver::Factorization;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::operator::Operator;
use crate::simulation::operator::responses::Unit;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::massless::{Columns, Embedded};
use crate::simulation::start::massless_parts::{by_damping, factorize, joined, parts};
use crate::simulation::start::problem::StartImpact;
use crate::state::Motion;
use crate::system::System;

/// How dofs without mass, or all dofs of a run that [starts at rest](crate::SimulationBuilder::start_at_rest), were
/// moved when a simulation was built, before its first step, and how an impact changed their velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StartAdjustment<T> {
    /// Change of the potential energy, with the potential of the load (minus its force times the displacement); not
    /// positive. The run would have lost this energy in a jump. None if the system has no potential.
    pub energy: Option<T>,
    /// The largest change of a displacement (length).
    pub largest: T,
    /// The dof that has moved most; 0 if none has moved.
    pub dof: usize,
    /// The impact that stopped the slip of a contact, if friction jammed one. It changed velocities.
    pub impact: Option<StartImpact<T>>,
}

/// The matrix in the error of a run that cannot start at rest.
const AT_REST: &str = "stiffness matrix, with which the run was to start at rest (contact does not hold a body there),";

/// Maximum number of iterations of the balance at the start. Linear systems take two.
const ITERATIONS: usize = 30;

/// Which dofs are brought into balance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Balanced {
    /// Dofs without mass, if they have a stiffness of their own and no damping.
    Massless,
    /// Dofs of all bodies at rest that have a stiffness of their own; if there is none, the run is refused.
    All,
}

/// The result of a balance.
enum Balance<T> {
    /// It held to rounding.
    Kept,
    /// The adjustment, and the tolerance of the gaps.
    Found(StartAdjustment<T>, T),
    /// Parts have no symmetric positive definite stiffness of their own.
    Indefinite,
}

/// Brings dofs (without mass, or all free dofs) into static balance with the other dofs, the load and contact, by
/// Newton's method: f_b + Gᵀ λ = 0, 0 ≤ g ⊥ λ ≥ 0, and friction in its cone against the displacement from the given
/// positions. Dofs that are in balance to rounding stay unchanged, bit for bit. So do massless dofs under damping,
/// whose displacements are independent initial values, and dofs without a symmetric positive definite stiffness: the
/// step decides whether the scheme can treat these. Also returns the tolerance of gaps, from the rounding of the
/// displacements that contact has undone.
pub(crate) fn balance_start<T: Real>(
    system: &mut dyn System<T>,
    solver: &mut dyn ContactSolver<T>,
    (constraints, g): (&mut Constraints<'_, T>, &mut ContactJacobian<T>),
    motion: &mut Motion<T>,
    (dofs, balanced): (&[usize], Balanced),
    [h, ahead]: [f64; 2],
) -> Result<Option<(StartAdjustment<T>, T)>> {
    let all = parts(system, dofs);
    let mut parts = match balanced {
        Balanced::All => all,
        Balanced::Massless => {
            let [_, undamped] = by_damping(system, all)?;
            undamped
        }
    };
    let given = motion.u.clone();
    while parts.iter().any(|part| !part.is_empty()) {
        let rows = (&mut *constraints, &mut *g);
        match balance(system, solver, rows, (motion, &given), (&mut parts, balanced), h)? {
            Balance::Kept => return Ok(None),
            Balance::Found(adjusted, missed) => return Ok(Some((adjusted, missed))),
            Balance::Indefinite => {
                motion.u.clone_from(&given);
                constraints.search(motion, ahead, g)?;
            }
        }
    }
    match balanced {
        Balanced::Massless => Ok(None),
        // No body can be balanced: the factor gives the reason.
        Balanced::All => {
            let columns = Columns::of(system, dofs, motion)?;
            Embedded::factorized(&columns, dofs, &[]).map(|_| None).map_err(|error| match error {
                Error::Singular { dof, .. } => Error::Singular { matrix: AT_REST, dof },
                other => other,
            })
        }
    }
}

/// Balances some parts of the dofs together, as contacts may couple them. If that fails, `parts` keeps the parts that
/// are left to balance.
fn balance<T: Real>(
    system: &mut dyn System<T>,
    solver: &mut dyn ContactSolver<T>,
    (constraints, g): (&mut Constraints<'_, T>, &mut ContactJacobian<T>),
    (motion, given): (&mut Motion<T>, &[T]),
    (parts, balanced): (&mut Vec<Vec<usize>>, Balanced),
    h: f64,
) -> Result<Balance<T>> {
    let is_massless = balanced == Balanced::Massless;
    let dofs = &joined(parts)[..];
    let unit = if is_massless { Unit::Dof } else { Unit::Row };
    let t = motion.t;
    let largest = |x: &[T]| x.iter().fold(T::zero(), |largest, x| largest.max(x.abs()));
    let interface = constraints.interface().to_vec();
    let mut residual = vec![T::zero(); motion.u.len()];
    let (mut on_interface, mut forces) = (vec![T::zero(); interface.len()], vec![T::zero(); interface.len()]);
    let (mut first, mut missed, mut worst) = (T::zero(), T::zero(), dofs[0]);
    for iteration in 0..ITERATIONS {
        system.force(t, &motion.u, &motion.v, &mut residual)?;
        let columns = Columns::of(system, dofs, motion)?;
        let Some(factor) = factorize(&columns, dofs, parts, &interface)? else { return Ok(Balance::Indefinite) };
        let mut operator = Operator::of_part(Box::new(factor), &interface, unit)?;
        operator.begin(&mut residual, &mut on_interface)?;
        let sliver = press_start(
            solver,
            (&mut *constraints, &*g),
            &mut operator,
            motion.t,
            [&motion.u, given],
            dofs,
            [&mut on_interface, &mut forces],
        )?;
        operator.finish(&mut residual, &on_interface, &forces)?;
        missed = missed.max(sliver);
        let mut size = T::zero();
        for &dof in dofs {
            let d = residual[dof].abs();
            if d > size || d.is_nan() {
                (size, worst) = (d, dof);
            }
        }
        if !size.is_finite() {
            let (dof, value) = (worst, size.value());
            return Err(Error::StepNotFinite { t, h, what: "the displacement in static balance", dof, value });
        }
        let scale = largest(&motion.u).max(largest(given));
        // Gaps are met within their own rounding, which may exceed the rounding of displacements: they are computed
        // from coordinates.
        let settled = size <= T::of(1e3) * T::epsilon() * scale + T::of(4.0) * sliver;
        if iteration == 0 {
            if settled {
                return Ok(Balance::Kept);
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
            let energies = [system.potential_energy(given), system.potential_energy(&motion.u)];
            system.external_load(t, &mut residual)?;
            let work = dofs.iter().map(|&dof| residual[dof] * moves(dof)).sum::<T>();
            let energy = energies[0].zip(energies[1]).map(|(before, after)| after - before - work);
            if !is_massless {
                // The last increment is the rounding of a solve with all of K, which may exceed the rounding of rows
                // with small displacements.
                missed = missed.max(T::of(8.0) * g.largest_row() * (size + T::epsilon() * scale));
            }
            return Ok(Balance::Found(
                StartAdjustment { energy, largest: moves(dof).abs(), dof, impact: None },
                missed,
            ));
        }
    }
    Err(Error::StartNotBalanced { iterations: ITERATIONS, dof: worst })
}

/// Computes the velocities of massless dofs under damping from their balance, f_b(t, u, v) = 0, by Newton's method:
/// their displacements are initial values, their velocities are not. With other velocities the damping force at the
/// start would not be in balance, and would accelerate the dofs with mass, as no internal force does. Velocities stay
/// as given where the part of C is not symmetric positive definite, where no balance is found, and in parts with a
/// `held` dof.
pub(crate) fn balance_rates<T: Real>(
    system: &mut dyn System<T>,
    dofs: &[usize],
    held: &[bool],
    motion: &mut Motion<T>,
) -> Result<()> {
    if dofs.is_empty() || system.pattern().row_idx().is_empty() {
        return Ok(());
    }
    let all = parts(system, dofs);
    let [mut parts, _] = by_damping(system, all)?;
    parts.retain(|part| !part.iter().any(|&dof| held[dof]));
    let given = motion.v.clone();
    while !parts.is_empty() && !settle_rates(system, &mut parts, motion)? {
        motion.v.clone_from(&given);
    }
    Ok(())
}

/// Computes the velocities of some parts. If that fails, returns false, and `parts` keeps the parts to try again.
fn settle_rates<T: Real>(
    system: &mut dyn System<T>,
    parts: &mut Vec<Vec<usize>>,
    motion: &mut Motion<T>,
) -> Result<bool> {
    let dofs = &joined(parts)[..];
    let mut residual = vec![T::zero(); motion.v.len()];
    let mut before = T::infinity();
    for _ in 0..ITERATIONS {
        system.force(motion.t, &motion.u, &motion.v, &mut residual)?;
        let columns = Columns::of_damping(system, dofs, motion)?;
        let Some(mut factor) = factorize(&columns, dofs, parts, &[])? else { return Ok(false) };
        factor.solve(&mut residual)?;
        let mut size = T::zero();
        for &dof in dofs {
            motion.v[dof] += residual[dof];
            size = size.max(residual[dof].abs());
        }
        if !T::all_finite(&motion.v) {
            break;
        }
        // Dofs that may stand still are accurate to the rounding of the velocities around them. Between springs that
        // differ much, they are accurate to the rounding of the stiffest, and increments stop falling.
        let largest = T::largest(&motion.v);
        let stays = size <= T::epsilon().powf(T::of(0.25)) * largest && size > T::of(0.5) * before;
        if size <= T::of(1e3) * T::epsilon() * largest || stays {
            return Ok(true);
        }
        before = size;
    }
    parts.clear();
    Ok(false)
}

/// Replaces forces on dofs without mass, which nothing balances, by the forces on the dofs with mass to which they
/// are passed on as these dofs would move to balance them: at rates by damping, or by stiffness. Returns whether
/// there are any beyond the rounding of a balance. Forces on parts in which neither is symmetric positive definite
/// stay.
pub(crate) fn pass_on<T: Real>(
    system: &mut dyn System<T>,
    dofs: &[usize],
    at: &Motion<T>,
    forces: &mut [T],
) -> Result<bool> {
    if dofs.iter().all(|&dof| forces[dof] == T::zero()) || system.pattern().row_idx().is_empty() {
        return Ok(false);
    }
    let mut parts = parts(system, dofs);
    parts.retain(|part| part.iter().any(|&dof| forces[dof] != T::zero()));
    let [damped, mut undamped] = by_damping(system, parts)?;
    let mut definite = damped.clone();
    let by_rates = pass_on_by(system, Columns::of_damping, (&mut definite, at), &at.v, forces)?;
    undamped.extend(damped.into_iter().filter(|part| definite.binary_search_by_key(&part[0], |part| part[0]).is_err()));
    let by_ways = pass_on_by(system, Columns::of, (&mut undamped, at), &at.u, forces)?;
    Ok(by_rates || by_ways)
}

/// By columns of C or of K, for the parts in which these are symmetric positive definite; `parts` keeps these parts.
fn pass_on_by<T: Real>(
    system: &mut dyn System<T>,
    columns: impl Fn(&mut dyn System<T>, &[usize], &Motion<T>) -> Result<Columns<T>>,
    (parts, at): (&mut Vec<Vec<usize>>, &Motion<T>),
    known: &[T],
    forces: &mut [T],
) -> Result<bool> {
    while !parts.is_empty() {
        let dofs = &joined(parts)[..];
        let columns = columns(system, dofs, at)?;
        let Some(mut factor) = factorize(&columns, dofs, parts, &[])? else { continue };
        let mut moved = forces.to_vec();
        factor.solve(&mut moved)?;
        let size = dofs.iter().fold(T::zero(), |size, &dof| size.max(moved[dof].abs()));
        if !size.is_finite() || size <= T::of(1e4) * T::epsilon() * T::largest(known) {
            return Ok(false);
        }
        let others = columns.without(dofs);
        let prescribed = system.prescribed();
        for (j, &dof) in dofs.iter().enumerate() {
            forces[dof] = T::zero();
            for (row, k) in others.column(j).filter(|(row, _)| prescribed.binary_search(row).is_err()) {
                forces[row] -= k * moved[dof];
            }
        }
        return Ok(true);
    }
    Ok(false)
}

/// Solves the contact problem of an iteration: adds the response to d on the interface, and leaves the forces there.
/// Returns the largest tolerance of a gap, as a displacement.
fn press_start<T: Real>(
    solver: &mut dyn ContactSolver<T>,
    (constraints, g): (&mut Constraints<'_, T>, &ContactJacobian<T>),
    operator: &mut Operator<T>,
    t: f64,
    [u, given]: [&[T]; 2],
    dofs: &[usize],
    [on_interface, forces]: [&mut Vec<T>; 2],
) -> Result<T> {
    let (rows, mut versions) = (constraints.len(), 0);
    let mut gaps = vec![T::zero(); rows];
    constraints.finite_gaps(t, u, &mut gaps)?;
    forces.fill(T::zero());
    let mut tolerance: Vec<T> =
        (0..rows).map(|row| constraints.gap_rounding(row, g.magnitude(row, u), gaps[row])).collect();
    for (row, tolerance) in tolerance.iter_mut().enumerate() {
        *tolerance += rounding(g.interface_magnitude(row, on_interface));
    }
    tolerance.extend(constraints.tangents().all().map(|row| rounding(g.magnitude(row, u))));
    let candidates: Vec<usize> = (0..rows).filter(|&row| g.acts_on(row, dofs)).collect();
    // Compliance and shift of the laws, linearized at the present gaps.
    let mut laws: Vec<[T; 2]> = (0..rows)
        .map(|row| {
            let law = constraints.law(row);
            let (compliance, shift) = law.linearized(gaps[row], tolerance[row], T::zero(), Course::at_rest());
            if law.is_compliant() { [compliance, shift] } else { [T::zero(); 2] }
        })
        .collect();
    laws.resize(g.rows(), [T::zero(); 2]);
    // Gaps, and displacements along the tangents.
    let way = |row: usize| g.row(row).map(|(dof, weight)| weight * (u[dof] - given[dof])).sum::<T>();
    let start = |row: usize| if row < rows { gaps[row] } else { way(row) };
    let free: Vec<T> =
        (0..g.rows()).map(|row| start(row) + g.interface_product(row, on_interface) + laws[row][1]).collect();
    let rubs = |row: usize| constraints.tangents().friction(row) > 0.0 && !constraints.law(row).is_compliant();
    let (mut contacts, mut problem): (Vec<usize>, Vec<usize>) = Default::default();
    let mut response = vec![T::zero(); on_interface.len()];
    loop {
        let pushed = |&row: &usize| {
            let y = free[row] + g.interface_product(row, &response);
            !contacts.contains(&row) && (y < -tolerance[row] || constraints.law(row).is_equality())
        };
        let joining: Vec<usize> = candidates.iter().copied().filter(pushed).collect();
        if joining.is_empty() {
            break;
        }
        contacts.extend(joining);
        contacts.sort_unstable();
        problem.clear();
        let mut sets = Vec::new();
        for &row in &contacts {
            let tangents = if rubs(row) { constraints.tangents().of(row) } else { 0..0 };
            sets.push(if rubs(row) { constraints.set(row) } else { constraints.law(row).into() });
            problem.extend(std::iter::once(row).chain(tangents));
        }
        let pick = |values: &[T]| -> Vec<T> { problem.iter().map(|&row| values[row]).collect() };
        let (offset, rounded) = (pick(&free), pick(&tolerance));
        let (delassus, version) = operator.delassus(g, &problem, |k| laws[problem[k]][0], &mut versions)?;
        let data = ContactProblem::of(delassus, &offset, &sets, &rounded, version);
        let mut lambda = vec![T::zero(); problem.len()];
        solver.reserve(problem.len());
        solver
            .solve(&data, &mut lambda)
            .map_err(|failure| contact_error(t, failure, |i| constraints.id_of(problem[i])))?;
        operator.answer(g, (&problem, &lambda), forces, &mut response);
    }
    T::axpy(T::one(), &response, on_interface);
    // Rows are assumed to have unit weights: a gap is then as long as the displacement that closes it.
    Ok(contacts.iter().fold(T::zero(), |sliver, &row| sliver.max(tolerance[row])))
}
