//! The contact problem of the start: which contacts carry a force before the first step, and how large it is.

use crate::contact::{ContactId, ContactLaw, Course};
use crate::contact_solver::AdmissibleSet;
use crate::corrector::{Block, FrictionOf, Gaps, JumpProblem, slides};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::{half_digits, rounding};
use crate::simulation::stage::supports::put_supports;
use crate::simulation::start::Start;
use crate::simulation::start::slides::Slide;
use crate::state::{ContactState, Motion};
use crate::tableau::ContactLevel;
use std::ops::Range;

/// The impact by which friction stopped the slip of a contact when a simulation was built.
///
/// Where μ |W_nt| ≥ W_nn, a touching contact that slides so that its friction closes the gap has no force with which
/// it could slide on ([`Error::Jammed`](crate::Error::Jammed)). Rigid bodies then have an impact without collision
/// (Painlevé's paradox; Génot and Brogliato, Eur. J. Mech. A/Solids 18, 1999): impulses that stop the slip and keep
/// the rate of the gap at zero. For a single contact they are X = −W⁻¹ (0, slip velocity), with
/// |X_t|/X_n = W_nn/|W_nt| ≤ μ.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StartImpact<T> {
    /// The contact that sticks after it.
    pub contact: ContactId,
    /// Its normal impulse (force times time); positive.
    pub normal: T,
    /// Its impulses along its tangents (force times time); the second one is zero in two dimensions.
    pub friction: [T; 2],
    /// Change of the kinetic energy, less the work of moving obstacles; not positive. Other resting contacts are part
    /// of the impact, and of its energy.
    pub energy: T,
}

/// The contact problem of the start: 0 ≤ S λ + q ⊥ λ ≥ 0. q is the acceleration of the gap without contact, or, for a
/// scheme that imposes contact ahead of the state, the violation of that condition as an acceleration.
#[derive(Debug, Default)]
pub(super) struct StartProblem<T> {
    /// Rows that take part.
    rows: Vec<usize>,
    /// Rows that join the problem if the multipliers of the others close them.
    waiting: Vec<usize>,
    /// Rows with a known force, of which only the friction is unknown.
    known: Vec<(usize, T)>,
    /// q and its rounding, one entry a row of G.
    offset: Vec<T>,
    tolerance: Vec<T>,
    /// Additions to the diagonal of S, one entry a candidate.
    compliance: Vec<T>,
    /// Whether the friction of a candidate takes part. Dofs without mass do not respond to impulses: friction there
    /// would act on one body only.
    has_friction: Vec<bool>,
    /// The contacts with friction that slide.
    sliding: Vec<Slide<T>>,
    /// The step within which friction may stop a slip, but not reverse it; none if q is ahead of the state.
    h: Option<f64>,
    /// The rows solved for, and their multipliers.
    solved: Vec<usize>,
    lambda: Vec<T>,
}

impl<T: Real> StartProblem<T> {
    /// The problem of the accelerations without the contact forces that are unknown yet.
    pub(super) fn new(
        start: &mut Start<'_, '_, T>,
        touching: &[bool],
        motion: &Motion<T>,
        contacts: &ContactState<T>,
    ) -> Result<Self> {
        let contact = start.scheme.tableau.stages[start.scheme.tableau.stages.len() - 1].contact;
        let mut problem = match contact.lead() > 0.0 {
            true => Self::ahead(start, contact, touching, motion, &contacts.gap)?,
            false => Self::at_rest(start, touching, motion)?,
        };
        problem.add_inertial(start, motion, &contacts.gap)?;
        let Start { constraints, g, massless, .. } = start;
        let tangents = constraints.tangents();
        // The static balance has found the forces on dofs without mass.
        for rows in [&mut problem.rows, &mut problem.waiting] {
            rows.retain(|&row| !g.acts_on(row, massless));
        }
        problem.has_friction = (0..constraints.len()).map(|row| !tangents.rub_on(g, row, massless)).collect();
        let is_known = |row: &usize| {
            let is_spring = constraints.law(*row).is_spring();
            contacts.closed[*row] && (is_spring || g.acts_on(*row, massless)) && problem.has_friction[*row]
        };
        problem.known = tangents.contacts().filter(is_known).map(|row| (row, contacts.lambda[row])).collect();
        Ok(problem)
    }

    /// Contacts at rest: touching, and neither approaching nor separating. An approaching contact is left to the
    /// first step, a separating contact is open.
    fn at_rest(start: &mut Start<'_, '_, T>, touching: &[bool], motion: &Motion<T>) -> Result<Self> {
        let rates = start.rates(motion.t, motion)?;
        let Start { constraints, g, h, .. } = start;
        // The displacement in one step that the tolerance of touching allows is not allowed here: at rest the rate is
        // zero up to rounding.
        let is_still = |row: usize| {
            let rate = g.product(row, &motion.v) + rates[row].rate;
            let magnitude = g.magnitude(row, &motion.u) + T::of(*h) * g.magnitude(row, &motion.v);
            rate.abs() * T::of(*h) <= rounding(magnitude)
        };
        let rests = |&row: &usize| constraints.law(row).is_equality() || touching[row] && is_still(row);
        let own = || rates.iter().map(|rates| rates.acceleration).enumerate();
        let offset = own().map(|(row, own)| g.product(row, &motion.a) + own).collect();
        let tolerance = own().map(|(row, own)| rounding(g.magnitude(row, &motion.a) + own.abs())).collect();
        Ok(Self {
            rows: (0..constraints.len()).filter(rests).collect(),
            sliding: Slide::find(constraints.tangents(), g, &rates, motion),
            h: Some(*h),
            compliance: vec![T::zero(); constraints.len()],
            offset,
            tolerance,
            ..Self::default()
        })
    }

    /// Adds the laws whose force depends on the acceleration: 0 ≤ g̈ + (k g + λ)/m ⊥ λ ≥ 0.
    fn add_inertial(&mut self, start: &mut Start<'_, '_, T>, motion: &Motion<T>, gaps: &[T]) -> Result<()> {
        if !start.constraints.laws().inertial {
            return Ok(());
        }
        let rates = start.rates(motion.t, motion)?;
        let Start { constraints, g, .. } = start;
        for row in 0..constraints.len() {
            let law = constraints.law(row);
            if law.inertia() > 0.0 {
                let per_gap = T::of(law.inertia()).recip();
                let (compliance, _) = law.linearized(T::zero(), T::zero(), T::zero(), Course::at_rest());
                self.compliance[row] = per_gap * compliance;
                self.offset[row] = g.product(row, &motion.a) + rates[row].acceleration + per_gap * gaps[row];
                self.tolerance[row] = rounding(g.magnitude(row, &motion.a) + self.offset[row].abs());
                match gaps[row] < T::zero() {
                    true => self.rows.push(row),
                    false => self.waiting.push(row),
                }
            }
        }
        self.rows.sort_unstable();
        Ok(())
    }

    /// Contacts that would violate the condition that the scheme imposes ahead of the state.
    fn ahead(
        start: &mut Start<'_, '_, T>,
        contact: ContactLevel,
        touching: &[bool],
        motion: &Motion<T>,
        gaps: &[T],
    ) -> Result<Self> {
        let lead = contact.lead() * start.h;
        let is_position = matches!(contact, ContactLevel::Position { .. });
        // The motion without contact at that time, with the supports in place.
        let mut target = Motion { t: motion.t + lead, ..motion.clone() };
        if is_position {
            T::axpy(T::of(lead), &motion.v, &mut target.u);
            T::axpy(T::of(0.5 * lead * lead), &motion.a, &mut target.u);
        } else {
            T::axpy(T::of(lead), &motion.a, &mut target.v);
        }
        let prescribed = start.system.prescribed().to_vec();
        let mut supports = vec![[T::zero(); 3]; prescribed.len()];
        put_supports(&mut *start.system, target.t, &prescribed, &mut supports, &mut target)?;
        let (now, then) = (start.rates(motion.t, motion)?, start.rates(target.t, motion)?);
        let Start { constraints, g, .. } = start;
        let rows = constraints.len();
        // y = (y without contact) + factor S λ.
        let (factor, values, mut y) = if is_position {
            (0.5 * lead * lead, &target.u, vec![T::zero(); rows])
        } else {
            let rate = |row: usize| g.product(row, &target.v) + then[row].rate;
            (lead, &target.v, (0..rows).map(rate).collect())
        };
        if is_position {
            let there = (target.t, [&target.u[..], &motion.v, &motion.a]);
            constraints.elsewhere(0, there, (motion.t, &motion.u), &mut y)?;
        }
        let scale = T::of(factor).recip();
        let mut tolerance = Vec::with_capacity(g.rows());
        for (row, y) in y.iter_mut().enumerate() {
            let law = constraints.law(row);
            if let Some(coefficient) = law.restitution().filter(|_| !is_position) {
                *y += T::of(coefficient) * (g.product(row, &motion.v) + now[row].rate);
            }
            let noise = match is_position {
                true => constraints.gap_rounding(row, g.magnitude(row, values), *y),
                false => rounding(g.magnitude(row, values) + y.abs()),
            };
            tolerance.push(scale * noise);
            if law.is_predictive() {
                // The stabilized bipenalty compares with the step before, whose gap is assumed to be the same.
                *y += gaps[row] - T::of(2.0) * (-gaps[row]).max(T::zero());
            }
        }
        let mut offset: Vec<T> = y.into_iter().map(|y| scale * y).collect();
        // The slip there, or the displacement until then.
        for row in constraints.tangents().all() {
            let slip = match is_position {
                true => {
                    let moved = g.row(row).map(|(dof, weight)| weight * (target.u[dof] - motion.u[dof]));
                    moved.sum::<T>() + T::of(lead) * then[row].rate
                }
                false => g.product(row, &target.v) + then[row].rate,
            };
            offset.push(scale * slip);
            tolerance.push(scale * rounding(g.magnitude(row, values)));
        }
        let is_enabled = |&row: &usize| (is_position || touching[row]) && constraints.law(row).needs_multiplier();
        let is_violated = |&row: &usize| constraints.law(row).is_equality() || offset[row] < -tolerance[row];
        let (own, waiting) = (0..rows).filter(is_enabled).partition(is_violated);
        // A mean gap changes by half of the response.
        let compliance =
            |law: ContactLaw| T::of(2.0) * scale * law.linearized(-T::one(), T::zero(), T::zero(), Course::at_rest()).0;
        let compliance = (0..rows).map(|row| compliance(constraints.law(row))).collect();
        Ok(Self { rows: own, waiting, offset, tolerance, compliance, ..Self::default() })
    }

    /// Whether it constrains accelerations of the state, not a motion ahead of it.
    pub(super) fn is_of_accelerations(&self) -> bool {
        self.h.is_some()
    }

    /// Treats a contact as sticking if its friction can hold it: its slip is rounding.
    pub(super) fn stick(&mut self, contact: usize) {
        self.sliding.retain(|slide| slide.contact != contact);
    }

    /// The block of a contact without its rows, and its tangential rows.
    fn block(&self, start: &Start<'_, '_, T>, row: usize) -> (Block<T>, Range<usize>) {
        let constraints = &start.constraints;
        let own = if self.has_friction[row] { constraints.tangents().of(row) } else { 0..0 };
        let set = if own.is_empty() { constraints.law(row).into() } else { constraints.set(row) };
        (Block { compliance: self.compliance[row], ..Block::new(row, own.len(), set) }, own)
    }

    /// Solves for the rows that take part, until no waiting row is violated and no slide is reversed.
    pub(super) fn solve(&mut self, start: &mut Start<'_, '_, T>, t: f64) -> Result<()> {
        loop {
            self.solve_rows(start, t)?;
            let Start { constraints, g, projection, .. } = start;
            let Self { rows, waiting, offset, tolerance, sliding, h, solved, lambda, .. } = self;
            let mut response = vec![T::zero(); projection.dofs()];
            projection.push(g, (solved, lambda), T::one(), &mut response)?;
            let acceleration = |row: usize| offset[row] + g.product(row, &response);
            let of_solved = |row: usize| solved.contains(&row).then(|| acceleration(row));
            let mut stops = false;
            for slide in sliding {
                stops |= h.is_some_and(|h| slide.stop_in_time(constraints.tangents(), h, of_solved));
            }
            if stops {
                continue;
            }
            let (joining, others): (Vec<usize>, Vec<usize>) =
                waiting.iter().partition(|&&row| acceleration(row) < -tolerance[row]);
            if joining.is_empty() {
                return Ok(());
            }
            *waiting = others;
            rows.extend(joining);
            rows.sort_unstable();
        }
    }

    /// Solves for the rows that take part: resting contacts stick or slip, a sliding one has its friction direction.
    fn solve_rows(&mut self, start: &mut Start<'_, '_, T>, t: f64) -> Result<()> {
        let mut problem = JumpProblem::default();
        let known = self.known.iter().map(|&(row, force)| (row, Some(force)));
        for (row, known) in self.rows.iter().map(|&row| (row, None)).chain(known) {
            let (block, own) = self.block(start, row);
            let slide = self.sliding.iter().find(|slide| slide.contact == row && !own.is_empty());
            let direction = slide.and_then(|slide| slide.friction(start.constraints.tangents()));
            problem.add_block(&Block { direction, known, ..block });
            match known {
                Some(_) => problem.add_row(row, T::zero(), T::zero(), T::zero()),
                None => problem.add_row(row, self.offset[row], self.tolerance[row], T::zero()),
            }
            for (k, row) in own.enumerate() {
                let over = slide.zip(self.h).map_or(T::zero(), |(slide, h)| slide.to_stop(h)[k]);
                let tolerance = self.tolerance[row] + rounding(over.abs());
                problem.add_row(row, self.offset[row] + over, tolerance, T::zero());
            }
        }
        let Start { constraints, g, projection, contact_solver, .. } = start;
        problem.solve((g, projection), &mut **contact_solver, FrictionOf::Pressing, (t, |row| constraints.ids[row]))?;
        let is_unknown = |row: usize| self.known.iter().all(|(known, _)| *known != row);
        let unknown = problem.rows.iter().zip(&problem.totals).filter(|(row, _)| is_unknown(**row));
        (self.solved, self.lambda) = unknown.unzip();
        Ok(())
    }

    /// Changes the velocities by the impact without collision that stops the slip of a contact: its gap rate and slip
    /// are zero afterwards, with impulses W X = −(gap rate, slip). The other contacts of the problem have impulses by
    /// Coulomb's law of impact: 0 ≤ X_n ⊥ gap rate ≥ 0, |X_t| ≤ μ X_n against the slip. Changes nothing if there are
    /// no such impulses, or if the impulses of the contact are outside of its cone.
    pub(super) fn stop(
        &self,
        start: &mut Start<'_, '_, T>,
        contact: usize,
        motion: &mut Motion<T>,
    ) -> Result<Option<StartImpact<T>>> {
        let rates = start.rates(motion.t, motion)?;
        let mut problem = JumpProblem::default();
        let rigid: Vec<usize> = self.rows.iter().copied().filter(|&row| self.compliance[row] == T::zero()).collect();
        for row in rigid {
            let (block, own) = self.block(start, row);
            if row != contact {
                problem.add_block(&block);
            }
            for k in std::iter::once(row).chain(own) {
                if row == contact {
                    problem.add_block(&Block::new(k, 0, AdmissibleSet::Free));
                }
                let (own, g) = (rates[k].rate, &start.g);
                let noise = rounding(g.magnitude(k, &motion.v) + own.abs());
                problem.add_row(k, g.product(k, &motion.v) + own, noise, T::zero());
            }
        }
        let Start { constraints, g, projection, contact_solver, .. } = start;
        let tangents = constraints.tangents();
        let id = |row| constraints.ids[tangents.owner(row)];
        if problem.solve((g, projection), &mut **contact_solver, FrictionOf::Pressing, (motion.t, id)).is_err() {
            return Ok(None);
        }
        let impulse = |row: usize| {
            let place = problem.rows.iter().position(|&other| other == row);
            place.map_or(T::zero(), |place| problem.totals[place])
        };
        let (normal, mut friction) = (impulse(contact), [T::zero(); 2]);
        for (friction, row) in friction.iter_mut().zip(tangents.of(contact)) {
            *friction = impulse(row);
        }
        let bound = T::of(tangents.friction(contact)) * (T::one() + half_digits()) * normal;
        if normal.is_nan() || normal <= T::zero() || friction[0].hypot(friction[1]) > bound {
            return Ok(None);
        }
        let mut v = motion.v.clone();
        projection.push(g, (&problem.rows, &problem.totals), T::one(), &mut v)?;
        let rate = |v: &[T], row: usize| g.product(row, v) + rates[row].rate;
        let work = |(&row, &impulse): (&usize, &T)| impulse * (rate(&motion.v, row) + rate(&v, row));
        let energy = T::of(0.5) * problem.rows.iter().zip(&problem.totals).map(work).sum::<T>();
        motion.v = v;
        Ok(Some(StartImpact { contact: constraints.ids[contact], normal, friction, energy }))
    }

    /// Applies the multipliers to the accelerations, and closes their contacts.
    pub(super) fn apply(
        self,
        start: &mut Start<'_, '_, T>,
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<()> {
        let Start { g, projection, .. } = start;
        projection.push(g, (&self.solved, &self.lambda), T::one(), &mut motion.a)?;
        for (&row, &lambda) in self.solved.iter().zip(&self.lambda) {
            contacts.lambda[row] = lambda;
            if !g.is_tangential(row) {
                contacts.closed[row] = true;
            }
        }
        contacts.lambda_raw.clone_from(&contacts.lambda);
        for row in (0..contacts.sliding.len()).filter(|&row| !contacts.tangents.of(row).is_empty()) {
            let bound = T::of(contacts.tangents.friction(row)) * contacts.lambda[row];
            let stops = self.sliding.iter().any(|slide| slide.contact == row && slide.stops);
            let slips = stops || slides(contacts.tangential(row, &contacts.lambda), bound);
            contacts.sliding[row] = contacts.closed[row] && slips;
        }
        Ok(())
    }
}
