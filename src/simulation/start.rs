//! The state at the start: supports, contacts, accelerations, and the past that a multistep scheme needs.
//!
//! - `overclosures`: bodies that overlap at the start.
//! - `rate_check`: gap rates and rows are compared with gaps.
//! - `massless`, `massless_parts`: dofs without mass are brought into static balance.
//! - `problem`: the contact problem of the start.
//! - `past`: past states computed from a motion.
//! - `resumed`, `checkpoint`: a run is continued from another one, or from a file.

#[cfg(feature = "serde")]
pub(super) mod checkpoint;
pub(super) mod massless;
pub(super) mod massless_parts;
pub(super) mod overclosures;
pub(super) mod past;
pub(super) mod problem;
pub(super) mod rate_check;
pub(super) mod resumed;

use crate::contact::{ContactJacobian, GapRates};
use crate::contact_solver::ContactSolver;
use crate::corrector::{Block, Gaps, JumpProblem, JumpProjection};
use crate::error::{Error, Result};
use crate::linear_solver::LinearSolver;
use crate::mass::InverseMass;
use crate::ranks::Together;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::build::scheme::Scheme;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::supports::put_initial_supports;
use crate::simulation::start::massless::{Balanced, StartAdjustment, balance_rates, balance_start, pass_on};
use crate::simulation::start::massless_parts::{joined, parts};
use crate::simulation::start::overclosures::Overclosures;
use crate::simulation::start::past::{straight_past, taylor_past};
use crate::simulation::start::problem::{StartImpact, StartProblem, sliding, stop_in_time};
use crate::simulation::start::rate_check::RateCheck;
use crate::simulation::step::finite::check_state;
use crate::sparse::scattered_signed;
use crate::state::{Clock, ContactState, History, Motion, Pace, State, Trail};
use crate::system::System;
use crate::tableau::StartUp;

/// The data from which the state at the start is computed.
pub(crate) struct Start<'s, T: Real> {
    pub(crate) system: &'s mut dyn System<T>,
    pub(crate) contact_solver: &'s mut dyn ContactSolver<T>,
    pub(crate) scheme: &'s Scheme<'s>,
    pub(crate) together: &'s Together<T>,
    pub(crate) h: f64,
    pub(crate) t: f64,
    /// Free dofs without mass.
    pub(crate) massless: &'s [usize],
    /// Which dofs are brought into static balance.
    pub(crate) balanced: Balanced,
    /// Whether accelerations belong to the smooth motion, without the forces of closed contacts.
    pub(crate) is_smooth: bool,
}

/// How bodies that overlap at the start are treated, in rigid contacts and equality rows. Mesh generators leave small
/// overlaps.
///
/// Gaps within the rounding of the numbers that they are computed from count as zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum InitialOverclosure {
    /// Fails with [`Error::InitialViolation`], which states the depth.
    #[default]
    Refused,
    /// The depth is added to the gap for the whole run, so that the contact starts closed and without strain. It is
    /// added to all gaps of the feature ([`ContactId::feature`](crate::contact::ContactId::feature)), so that a
    /// sliding node keeps it.
    AdjustedGaps,
    /// The depth is added at first, and removed over this time by the factor 1 − 3 τ² + 2 τ³ with τ from 0 to 1. This
    /// strains the bodies like an interference fit.
    RemovedOver(f64),
}

/// Whether a motion may start inside an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Violation {
    /// As the caller has chosen, at the start of a run.
    Initial(InitialOverclosure),
    /// At a restart: schemes that impose contact on velocities leave penetrations behind.
    Accepted,
}

/// The impact by which a contact that friction jams comes to stick.
#[derive(Clone, Copy, Debug)]
enum Impact<T> {
    /// Not allowed: velocities belong to a run that continues, and stay unchanged.
    Refused,
    /// No impact so far.
    Possible,
    /// The row of the contact, and the impulses that the velocities contain. There is no second impact.
    Found(usize, StartImpact<T>),
}

/// Motion and contacts at the start.
struct Found<T: Real> {
    motion: Motion<T>,
    contacts: ContactState<T>,
    adjustment: Option<StartAdjustment<T>>,
}

/// The data from which a run starts.
pub(crate) struct Begun<T: Real> {
    pub(crate) state: State<T>,
    pub(crate) history: History<T>,
    pub(crate) adjustment: Option<StartAdjustment<T>>,
}

/// M⁻¹ on the free dofs, with memory for the candidates.
pub(crate) fn projection<T: Real>(
    system: &dyn System<T>,
    constraints: &Constraints<'_, T>,
    (together, solver): (&Together<T>, &dyn LinearSolver<T>),
) -> Result<JumpProjection<T>> {
    let (mass, interface) = (system.mass(), constraints.interface());
    let inverse = match together.is_alone() {
        true => InverseMass::new(mass, system.prescribed(), interface)?,
        false => InverseMass::through(solver, mass, system.prescribed())?,
    };
    JumpProjection::with(inverse, system.dofs(), constraints.room())
}

impl<T: Real> Start<'_, T> {
    /// State and past from displacements and velocities at the start.
    pub(crate) fn begin(
        mut self,
        u: Vec<T>,
        v: Vec<T>,
        constraints: &mut Constraints<'_, T>,
        g: &mut ContactJacobian<T>,
        projection: &mut JumpProjection<T>,
        violation: Violation,
    ) -> Result<Begun<T>> {
        let (scheme, h, t) = (self.scheme, self.h, self.t);
        let Found { mut motion, contacts, adjustment } = self.motion(u, v, constraints, g, projection, violation)?;
        if self.is_smooth {
            for (row, &force) in contacts.lambda.iter().enumerate() {
                let owner = constraints.tangents().owner(row);
                let is_massless = constraints.tangents().act_on(g, owner, self.massless);
                if constraints.law(owner).leaves_jumps() && !is_massless {
                    projection.push(g, (&[row], &[force]), -T::one(), &mut motion.a)?;
                }
            }
        }
        let depth = scheme.depth;
        let mut slots = vec![Motion::zero(motion.u.len()); scheme.slots()];
        straight_past(&motion, h, &mut slots[1..depth]);
        let known = if is_free_flight((self.system, self.together), projection, &motion, &slots[1..depth], h)? {
            depth
        } else if scheme.start_up == StartUp::Taylor {
            taylor_past(&motion, h, &mut slots[1..depth]);
            depth
        } else {
            1
        };
        let shown = scheme.shown(&motion);
        // A scheme that stores the velocity at another time gets the velocity at that time. The acceleration is left
        // at the start: its rate is unknown, and an estimate would be dominated by the stiffest mode.
        let Motion { v, a, .. } = &mut motion;
        T::axpy(T::of(scheme.shifts[0] * h), a, v);
        let clock = Clock::new(t, h);
        let history = History {
            slots,
            known,
            smooth: known,
            clock,
            pace: Pace::new(h),
            made_with: h,
            trail: Trail::default(),
            unmoved: [Vec::new(), Vec::new()],
            slopes: self.massless.iter().map(|&dof| motion.v[dof]).collect(),
            scheme: scheme.integrator.name(),
            overclosures: constraints.overclosures().cloned(),
        };
        let state = State { motion, shown, contacts, broken: Vec::new() };
        check_state(h, &state)?;
        Ok(Begun { state, history, adjustment })
    }

    /// Motion and contacts at the start: supports in place, M a = f + Gᵀ λ with 0 ≤ λ ⊥ g̈ ≥ 0 on contacts at rest.
    fn motion(
        &mut self,
        u: Vec<T>,
        v: Vec<T>,
        constraints: &mut Constraints<'_, T>,
        g: &mut ContactJacobian<T>,
        projection: &mut JumpProjection<T>,
        violation: Violation,
    ) -> Result<Found<T>> {
        let Self { system, contact_solver, scheme, together, h, t, massless, balanced, .. } = &mut *self;
        let (h, t) = (*h, *t);
        let dofs = u.len();
        let prescribed = system.prescribed().to_vec();
        let mut motion = Motion { t, u, v, a: vec![T::zero(); dofs] };
        let supports = put_initial_supports(&mut **system, t, &mut motion.u, &mut motion.v)?;
        for (&dof, support) in prescribed.iter().zip(&supports) {
            motion.a[dof] = support[2];
        }
        let ahead = scheme.ahead() * h;
        constraints.search(&motion, ahead, g)?;
        constraints.check_rows(g, &prescribed, t, &motion.u)?;
        RateCheck::new(constraints.len()).check(constraints, &motion, h, g)?;
        projection.reset();
        let mut contacts = ContactState::with_capacity(constraints.room());
        contacts.reset(&constraints.ids, constraints.tangents());
        let mut touching = touching_contacts(constraints, g, (&motion, T::zero()), h, violation, &mut contacts)?;
        let mut adjustment = None;
        if let Violation::Initial(_) = violation {
            let resting = match balanced {
                Balanced::Massless => massless.to_vec(),
                Balanced::All => bodies_at_rest(&**system, together, &motion.v)?,
            };
            let balanced = (&resting[..], *balanced);
            let (parts, solver) = (&mut **system, &mut **contact_solver);
            let rows = (&mut *constraints, &mut *g);
            if let Some((adjusted, missed)) = balance_start(parts, solver, rows, &mut motion, balanced, [h, ahead])? {
                adjustment = Some(adjusted);
                constraints.search(&motion, ahead, g)?;
                contacts.reset(&constraints.ids, constraints.tangents());
                touching = touching_contacts(constraints, g, (&motion, missed), h, violation, &mut contacts)?;
            }
        }

        let known = (motion.a.clone(), contacts.clone());
        let mut impact = match violation {
            Violation::Initial(_) => Impact::Possible,
            Violation::Accepted => Impact::Refused,
        };
        loop {
            let rows = (&mut *constraints, &*g, &mut *projection);
            match self.accelerate(rows, (&supports, &touching), impact, (&mut motion, &mut contacts))? {
                None => break,
                Some((row, found)) => {
                    impact = Impact::Found(row, found);
                    (motion.a, contacts) = known.clone();
                }
            }
        }
        if let Impact::Found(_, found) = impact {
            let unmoved = StartAdjustment { energy: Some(T::zero()), largest: T::zero(), dof: 0, impact: None };
            adjustment = Some(StartAdjustment { impact: Some(found), ..adjustment.unwrap_or(unmoved) });
        }
        Ok(Found { motion, contacts, adjustment })
    }

    /// Solves for accelerations and contact forces. If friction jams a contact at rest, changes the velocities instead
    /// by the impact that stops its slip, and returns its row and its impulses: the caller then solves again.
    fn accelerate(
        &mut self,
        (constraints, g, projection): (&mut Constraints<'_, T>, &ContactJacobian<T>, &mut JumpProjection<T>),
        (supports, touching): (&[[T; 3]], &[bool]),
        impact: Impact<T>,
        (motion, contacts): (&mut Motion<T>, &mut ContactState<T>),
    ) -> Result<Option<(usize, StartImpact<T>)>> {
        let Self { system, contact_solver, scheme, h, t, massless, .. } = self;
        let (h, t, dofs) = (*h, *t, motion.u.len());
        let prescribed = system.prescribed().to_vec();
        let mut held = vec![false; dofs];
        for row in (0..constraints.len()).filter(|&row| touching[row] || contacts.gap[row] <= T::zero()) {
            for (dof, _) in g.row(row).filter(|(_, weight)| *weight != T::zero()) {
                held[dof] = true;
            }
        }
        balance_rates(&mut **system, massless, &held, motion)?;

        // Accelerations without contact: M a = f − M a_p on free dofs.
        let mut force = vec![T::zero(); dofs];
        system.force(t, &motion.u, &motion.v, &mut force)?;
        system.mass().add_product(-T::one(), &motion.a, &mut force);
        let unbalanced: Vec<T> = massless.iter().map(|&dof| force[dof]).collect();
        projection.apply_inverse(&mut force)?;
        for (&dof, support) in prescribed.iter().zip(supports) {
            force[dof] = support[2];
        }
        motion.a = force;
        if let Some(dof) = motion.a.iter().position(|a| !a.is_finite()) {
            let value = motion.a[dof].value();
            return Err(Error::StepNotFinite { t, h, what: "the initial acceleration", dof, value });
        }

        let contact = scheme.tableau.stages[scheme.tableau.stages.len() - 1].contact;
        let looks_ahead = contact.lead() > 0.0;
        // Springs in compression exert their force from the start.
        let mut rates = vec![GapRates::default(); constraints.len()];
        if constraints.laws().damped {
            constraints.finite_rates(t, &motion.u, &motion.v, &mut rates)?;
        }
        for (row, own) in rates.iter().enumerate() {
            let law = constraints.law(row);
            if law.is_spring() {
                let force = law.force(contacts.gap[row], -(g.product(row, &motion.v) + own.rate));
                if force > T::zero() {
                    projection.push(g, (&[row], &[force]), T::one(), &mut motion.a)?;
                }
                (contacts.lambda[row], contacts.lambda_raw[row]) = (force, force);
                contacts.closed[row] = force > T::zero();
            }
        }
        // Dofs without mass do not respond to impulses: friction there would act on one body only.
        let drags = |constraints: &Constraints<'_, T>, row: usize| constraints.tangents().rub_on(g, row, massless);
        let is_spring = |row: usize| contacts.closed[row] && constraints.law(row).is_spring();
        let rubs = |row: &usize| is_spring(*row) && !drags(constraints, *row);
        let rows: Vec<usize> = constraints.tangents().contacts().filter(rubs).collect();
        let moved = (&mut *motion, &mut *contacts);
        rub_known(constraints, g, &mut **contact_solver, &mut *projection, h, moved, &rows)?;
        if !massless.is_empty() {
            let moved = (&mut *motion, &mut *contacts);
            let solver = &mut **contact_solver;
            press_static(constraints, (g, projection), solver, (massless, &unbalanced), (h, touching), moved)?;
        }
        let mut problem = match looks_ahead {
            true => StartProblem::ahead(contact, &mut **system, constraints, g, motion, h, touching)?,
            false => StartProblem::at_rest(constraints, g, motion, h, touching)?,
        };
        problem.add_inertial(constraints, g, motion, &contacts.gap)?;
        if !massless.is_empty() {
            // Contacts on dofs without mass have been solved for, or are open.
            problem.rows.retain(|&row| !g.acts_on(row, massless));
            problem.waiting.retain(|&row| !g.acts_on(row, massless));
        }
        let rubbing: Vec<bool> = (0..constraints.len()).map(|row| !drags(constraints, row)).collect();
        let rubs = |row: usize| rubbing[row];
        if let Impact::Found(row, _) = impact {
            problem.stick(row);
        }
        let solved = problem.solve(t, constraints, g, (&mut *projection, &rubs), &mut **contact_solver);
        if let Err(error) = solved {
            let jammed = match &error {
                Error::Jammed { contact, .. } if matches!(impact, Impact::Possible) && !looks_ahead => {
                    constraints.ids.iter().position(|id| id == contact)
                }
                _ => None,
            };
            let Some(row) = jammed else { return Err(error) };
            let rows = (constraints, g, projection);
            let found = problem.stop(row, rows, &rubs, &mut **contact_solver, motion)?;
            return found.map(|found| Some((row, found))).ok_or(error);
        }
        problem.press(g, projection, motion, contacts)?;
        pass_on_rest(&mut **system, (massless, &unbalanced), (g, projection), contacts, motion)?;
        Ok(None)
    }
}

/// Solves contacts on dofs without mass, where the balance is algebraic: f + Gᵀ λ = 0; then friction on dofs with
/// mass only, as the normal force is known.
fn press_static<T: Real>(
    constraints: &mut Constraints<'_, T>,
    (g, projection): (&ContactJacobian<T>, &mut JumpProjection<T>),
    solver: &mut dyn ContactSolver<T>,
    (massless, unbalanced): (&[usize], &[T]),
    (h, touching): (f64, &[bool]),
    (motion, contacts): (&mut Motion<T>, &mut ContactState<T>),
) -> Result<()> {
    let dofs = motion.u.len();
    let mut forces = vec![T::zero(); dofs];
    let mut unit = forces.clone();
    for (&dof, &force) in massless.iter().zip(unbalanced) {
        (forces[dof], unit[dof]) = (force, T::one());
    }
    let mut unit = JumpProjection::with(InverseMass::Lumped(unit), dofs, constraints.len())?;
    let mut problem = StartProblem::at_rest(constraints, g, motion, h, touching)?;
    problem.h = None;
    problem.rows.retain(|&row| g.acts_on(row, massless));
    problem.offset = (0..g.rows()).map(|row| g.product(row, &forces)).collect();
    problem.tolerance = (0..g.rows()).map(|row| rounding(g.magnitude(row, &forces))).collect();
    let drags = |row: usize| constraints.tangents().rub_on(g, row, massless);
    problem.solve(motion.t, constraints, g, (&mut unit, &drags), solver)?;
    let later: Vec<usize> = problem.rows.iter().copied().filter(|&row| !drags(row)).collect();
    problem.press(g, projection, motion, contacts)?;
    let rubs = |row: &usize| contacts.closed[*row] && !constraints.tangents().of(*row).is_empty();
    let rows: Vec<usize> = later.into_iter().filter(rubs).collect();
    rub_known(constraints, g, solver, projection, h, (motion, contacts), &rows)
}

/// Passes on the forces on dofs without mass that contact has not balanced to the dofs with mass, and accelerates
/// these: such forces are internal to the bodies.
fn pass_on_rest<T: Real>(
    system: &mut dyn System<T>,
    (massless, unbalanced): (&[usize], &[T]),
    (g, projection): (&ContactJacobian<T>, &mut JumpProjection<T>),
    contacts: &ContactState<T>,
    motion: &mut Motion<T>,
) -> Result<()> {
    if unbalanced.iter().all(|&force| force == T::zero()) {
        return Ok(());
    }
    let mut forces = vec![T::zero(); motion.u.len()];
    for (&dof, &force) in massless.iter().zip(unbalanced) {
        forces[dof] = force;
    }
    for row in 0..g.rows() {
        for (dof, weight) in g.row(row).filter(|(dof, _)| massless.binary_search(dof).is_ok()) {
            forces[dof] += weight * contacts.lambda[row];
        }
    }
    if pass_on(system, massless, motion, &mut forces)? {
        projection.apply_inverse(&mut forces)?;
        T::axpy(T::one(), &forces, &mut motion.a);
    }
    Ok(())
}

/// The free dofs of the bodies at rest: parts coupled by K without a velocity, supports included. Refuses runs in
/// which everything moves, and ranks, none of which has all of the stiffness.
fn bodies_at_rest<T: Real>(system: &dyn System<T>, together: &Together<T>, v: &[T]) -> Result<Vec<usize>> {
    if !together.is_alone() {
        let reason = "no rank has all of the stiffness: give displacements in balance, as a static analysis finds them";
        return Err(Error::Incompatible { part: "a start at rest over ranks".into(), reason });
    }
    let prescribed = system.prescribed();
    let free: Vec<usize> = (0..v.len()).filter(|dof| prescribed.binary_search(dof).is_err()).collect();
    let pattern = system.pattern();
    let coupled = |dof: usize| if pattern.row_idx().is_empty() { &[] } else { pattern.row_idx_of_col_raw(dof) };
    let rests = |dof: &usize| v[*dof] == T::zero() && coupled(*dof).iter().all(|&other| v[other] == T::zero());
    let resting = parts(system, &free).into_iter().filter(|part| part.iter().all(rests));
    let resting = joined(&resting.collect::<Vec<_>>());
    match v.iter().position(|v| *v != T::zero()) {
        Some(dof) if resting.is_empty() => {
            let part = format!("a start at rest with the initial velocity {:e} of dof {dof}", v[dof]);
            let reason = "a body that starts at rest has none, supports included, and there is no other body";
            Err(Error::Incompatible { part, reason })
        }
        _ => Ok(resting),
    }
}

/// The friction of contacts with known normal forces, from springs in compression or static balance: it holds
/// contacts at rest, and slows sliding contacts.
fn rub_known<T: Real>(
    constraints: &mut Constraints<'_, T>,
    g: &ContactJacobian<T>,
    solver: &mut dyn ContactSolver<T>,
    projection: &mut JumpProjection<T>,
    h: f64,
    (motion, contacts): (&mut Motion<T>, &mut ContactState<T>),
    rows: &[usize],
) -> Result<()> {
    if rows.is_empty() {
        return Ok(());
    }
    let mut slips = vec![GapRates::default(); constraints.tangents().len()];
    constraints.finite_slip_rates(motion.t, &motion.u, &motion.v, &mut slips)?;
    let mut sliding = sliding(constraints, (g, &slips), motion);
    sliding.retain(|slide| rows.binary_search(&slide.contact).is_ok());
    let (tangents, mut problem) = (constraints.tangents(), JumpProblem::default());
    let own = |k: usize| slips[k - tangents.all().start].acceleration;
    let (rows, forces) = loop {
        problem.clear();
        for &row in rows {
            let slide = sliding.iter().find(|slide| slide.contact == row);
            let direction = slide.and_then(|slide| slide.friction(tangents));
            let block = Block::new(row, tangents.of(row).len(), constraints.set(row));
            problem.add_block(&Block { direction, known: Some(contacts.lambda[row]), ..block });
            problem.add_row(row, T::zero(), T::zero(), T::zero());
            for (at, k) in tangents.of(row).enumerate() {
                let over = slide.map_or(T::zero(), |slide| slide.to_stop(h)[at]);
                let size = g.magnitude(k, &motion.a) + own(k).abs() + over.abs();
                problem.add_row(k, g.product(k, &motion.a) + own(k) + over, rounding(size), T::zero());
            }
        }
        solver.reserve(problem.rows.len());
        problem.solve((g, projection), solver, T::one(), (motion.t, |row| constraints.ids[row]))?;
        let rubs = problem.rows.iter().zip(&problem.totals).filter(|(row, _)| g.is_tangential(**row));
        let (rubbed, forces): (Vec<usize>, Vec<T>) = rubs.unzip();
        let mut a = motion.a.clone();
        projection.push(g, (&rubbed, &forces), T::one(), &mut a)?;
        let slower = |k: usize| rubbed.contains(&k).then(|| g.product(k, &a) + own(k));
        if !stop_in_time(&mut sliding, tangents, h, slower) {
            motion.a = a;
            break (rubbed, forces);
        }
    };
    for (row, force) in rows.into_iter().zip(forces) {
        (contacts.lambda[row], contacts.lambda_raw[row]) = (force, force);
    }
    for slide in sliding {
        contacts.sliding[slide.contact] = contacts.closed[slide.contact];
    }
    Ok(())
}

/// Rounding of initial gaps, in units of the rounding of sums: coordinates may have been written to a file with
/// twelve digits.
const INPUT: f64 = 64.0;

/// Evaluates the gaps, returns which of them are closed, and refuses a start inside an obstacle. `missed` is an
/// additional tolerance of the gaps.
fn touching_contacts<T: Real>(
    constraints: &mut Constraints<'_, T>,
    g: &ContactJacobian<T>,
    (motion, missed): (&Motion<T>, T),
    h: f64,
    violation: Violation,
    contacts: &mut ContactState<T>,
) -> Result<Vec<bool>> {
    let mut rates = vec![GapRates::default(); constraints.len()];
    let mut overclosures = Vec::new();
    constraints.finite_gaps(motion.t, &motion.u, &mut contacts.gap)?;
    constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
    let mut touching = Vec::with_capacity(constraints.len());
    for (row, rates) in rates.iter().enumerate() {
        let rate = g.product(row, &motion.v) + rates.rate;
        let gap = contacts.gap[row];
        let rounded = T::of(INPUT) * constraints.gap_rounding(row, g.magnitude(row, &motion.u), gap);
        let tolerance = rounded + missed + T::of(1e-10 * h) * rate.abs();
        let law = constraints.law(row);
        let violated = !law.may_penetrate() && gap < -tolerance || law.is_equality() && gap > tolerance;
        match violation {
            Violation::Initial(InitialOverclosure::Refused) if violated => {
                let contact = constraints.ids[row];
                return Err(Error::InitialViolation { contact, gap: gap.value(), tolerance: tolerance.value() });
            }
            Violation::Initial(_) if violated => overclosures.push((constraints.ids[row], gap)),
            Violation::Initial(_) | Violation::Accepted => {}
        }
        touching.push(gap <= tolerance && !law.is_compliant());
    }
    if !overclosures.is_empty() {
        let over = match violation {
            Violation::Initial(InitialOverclosure::RemovedOver(time)) => Some(time),
            Violation::Initial(_) | Violation::Accepted => None,
        };
        constraints.adjust(Overclosures::new(&overclosures, motion.t, over));
        constraints.finite_gaps(motion.t, &motion.u, &mut contacts.gap)?;
    }
    Ok(touching)
}

/// Whether the straight line through the start is the past motion of the system: the accelerations at the start and
/// at the past states do not change a velocity beyond rounding within a step.
fn is_free_flight<T: Real>(
    (system, together): (&mut dyn System<T>, &Together<T>),
    projection: &mut JumpProjection<T>,
    motion: &Motion<T>,
    past: &[Motion<T>],
    h: f64,
) -> Result<bool> {
    let bound = 64.0 * T::epsilon().value() * largest(&motion.v, together)?;
    let is_rounding = |a: &[T], system: &mut dyn System<T>, projection: &mut _, motion: &_| -> Result<bool> {
        let change = h * largest(a, together)?;
        if change <= bound || !change.is_finite() {
            return Ok(change <= bound);
        }
        let sensitivity = sensitivity((system, together), projection, motion)?;
        Ok(sensitivity.is_some_and(|most| change <= bound + 64.0 * T::epsilon().value() * h * most))
    };
    if !is_rounding(&motion.a, system, projection, motion)? {
        return Ok(false);
    }
    let mut a = vec![T::zero(); motion.u.len()];
    for motion in past {
        if !admitted(system.force(motion.t, &motion.u, &motion.v, &mut a), together)? {
            return Ok(false);
        }
        projection.apply_inverse(&mut a)?;
        if !is_rounding(&a, system, projection, motion)? {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The largest magnitude of an entry of a vector, infinite if an entry is not finite.
fn largest<T: Real>(x: &[T], together: &Together<T>) -> Result<f64> {
    let own = if T::all_finite(x) { T::largest(x) } else { T::infinity() };
    together.max(Ok([own.value()])).map(|[largest]| largest)
}

/// Whether the host admits a state.
fn admitted<T: Real>(force: Result<()>, together: &Together<T>) -> Result<bool> {
    match force {
        Err(error) if error.is_recoverable() => {
            together.caught();
            Ok(false)
        }
        other => other.map(|()| true),
    }
}

/// The change of accelerations by changes of displacements and velocities of their own magnitude and with scattered
/// signs. ε times this is the rounding of accelerations where forces cancel, as for stiff springs in rigid motions.
/// None where the host does not admit the state.
fn sensitivity<T: Real>(
    (system, together): (&mut dyn System<T>, &Together<T>),
    projection: &mut JumpProjection<T>,
    motion: &Motion<T>,
) -> Result<Option<f64>> {
    let share = T::epsilon().sqrt();
    let mut moved = [motion.u.clone(), motion.v.clone()];
    for values in &mut moved {
        let size = share * T::of(largest(values, together)?);
        values.iter_mut().enumerate().for_each(|(dof, x)| *x += size * T::of(scattered_signed(dof)));
        together.share(values)?;
    }
    let [mut there, mut here] = [(); 2].map(|()| vec![T::zero(); motion.u.len()]);
    let known = admitted(system.force(motion.t, &moved[0], &moved[1], &mut there), together)?
        && admitted(system.force(motion.t, &motion.u, &motion.v, &mut here), together)?;
    if !known {
        return Ok(None);
    }
    there.iter_mut().zip(&here).for_each(|(there, &here)| *there -= here);
    projection.apply_inverse(&mut there)?;
    let most = largest(&there, together)? / share.value();
    Ok(most.is_finite().then_some(most))
}
