//! The contact problem of the start: which contacts carry a force before the first step, and how large it is.

use crate::contact::{ContactId, ContactJacobian, ContactLaw, Course, GapRates, Tangents};
use crate::contact_solver::{AdmissibleSet, ContactProblem, ContactSolver};
use crate::corrector::{Block, Gaps, JumpProblem, JumpProjection, contact_error, slides};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::supports::finite_supports;
use crate::state::{ContactState, Motion};
use crate::system::System;
use crate::tableau::ContactLevel;

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
pub(crate) struct StartProblem<T> {
    /// Rows that take part.
    pub(crate) rows: Vec<usize>,
    /// Rows that join the problem if the multipliers of the others close them.
    pub(crate) waiting: Vec<usize>,
    /// q and its rounding, one entry a row of G.
    pub(crate) offset: Vec<T>,
    pub(crate) tolerance: Vec<T>,
    /// Additions to the diagonal of S, one entry a candidate.
    compliance: Vec<T>,
    /// The contacts with friction that slide.
    sliding: Vec<Slide<T>>,
    /// The step, if the unknowns are forces on bodies with mass: friction may stop a slip within it, but not reverse
    /// it.
    pub(crate) h: Option<f64>,
    /// The rows solved for, and their multipliers.
    solved: Vec<usize>,
    lambda: Vec<T>,
}

impl<T: Real> StartProblem<T> {
    /// Contacts at rest: touching, and neither approaching nor separating. An approaching contact is left to the
    /// first step, a separating contact is open.
    pub(crate) fn at_rest(
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        motion: &Motion<T>,
        h: f64,
        touching: &[bool],
    ) -> Result<Self> {
        let mut rates = vec![GapRates::default(); constraints.len()];
        constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
        let rows = (0..constraints.len()).filter(|&row| {
            let rate = g.product(row, &motion.v) + rates[row].rate;
            // The displacement in one step that the tolerance of touching allows is not allowed here: at rest the
            // rate is zero up to rounding.
            let still =
                rate.abs() * T::of(h) <= rounding(g.magnitude(row, &motion.u) + T::of(h) * g.magnitude(row, &motion.v));
            constraints.law(row).is_equality() || touching[row] && still
        });
        let rows = rows.collect();
        let mut slips = vec![GapRates::default(); constraints.tangents().len()];
        constraints.finite_slip_rates(motion.t, &motion.u, &motion.v, &mut slips)?;
        let sliding = sliding(constraints, (g, &slips), motion);
        rates.truncate(constraints.len());
        rates.append(&mut slips);
        let own = |row: usize| rates[row].acceleration;
        Ok(Self {
            rows,
            waiting: Vec::new(),
            offset: (0..g.rows()).map(|row| g.product(row, &motion.a) + own(row)).collect(),
            tolerance: (0..g.rows()).map(|row| rounding(g.magnitude(row, &motion.a) + own(row).abs())).collect(),
            compliance: vec![T::zero(); constraints.len()],
            sliding,
            h: Some(h),
            solved: Vec::new(),
            lambda: Vec::new(),
        })
    }

    /// Adds the laws whose force depends on the acceleration: 0 ≤ g̈ + (k g + λ)/m ⊥ λ ≥ 0.
    pub(crate) fn add_inertial(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        motion: &Motion<T>,
        gaps: &[T],
    ) -> Result<()> {
        let inertia = |law: ContactLaw| T::of(law.inertia());
        if !constraints.laws().inertial {
            return Ok(());
        }
        let mut rates = vec![GapRates::default(); constraints.len()];
        constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
        for row in 0..constraints.len() {
            let law = constraints.law(row);
            if inertia(law) > T::zero() {
                let per_gap = inertia(law).recip();
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
    pub(crate) fn ahead(
        contact: ContactLevel,
        system: &mut dyn System<T>,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        motion: &Motion<T>,
        h: f64,
        touching: &[bool],
    ) -> Result<Self> {
        let lead = contact.lead() * h;
        let t = motion.t + lead;
        let mut target = motion.u.clone();
        let mut y = vec![T::zero(); constraints.len()];
        let prescribed = system.prescribed().to_vec();
        let mut supports = vec![[T::zero(); 3]; prescribed.len()];
        system.prescribed_motion(t, &mut supports)?;
        finite_supports(t, &prescribed, &supports)?;
        // y = (y without contact) + factor S λ.
        let (factor, open) = match contact {
            ContactLevel::Position { .. } => {
                T::axpy(T::of(lead), &motion.v, &mut target);
                T::axpy(T::of(0.5 * lead * lead), &motion.a, &mut target);
                for (&dof, support) in prescribed.iter().zip(&supports) {
                    target[dof] = support[0];
                }
                let there = (t, [&target[..], &motion.v, &motion.a]);
                constraints.elsewhere(0, there, (motion.t, &motion.u), &mut y)?;
                (0.5 * lead * lead, vec![true; constraints.len()])
            }
            ContactLevel::Velocity { .. } => {
                target.copy_from_slice(&motion.v);
                T::axpy(T::of(lead), &motion.a, &mut target);
                for (&dof, support) in prescribed.iter().zip(&supports) {
                    target[dof] = support[1];
                }
                let mut rates = vec![GapRates::default(); constraints.len()];
                constraints.finite_rates(t, &motion.u, &motion.v, &mut rates)?;
                for (row, (y, rate)) in y.iter_mut().zip(&rates).enumerate() {
                    *y = g.product(row, &target) + rate.rate;
                }
                constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
                for (row, (y, rate)) in y.iter_mut().zip(&rates).enumerate() {
                    if let Some(coefficient) = constraints.law(row).restitution() {
                        *y += T::of(coefficient) * (g.product(row, &motion.v) + rate.rate);
                    }
                }
                (lead, touching.to_vec())
            }
        };
        let scale = T::of(factor).recip();
        let rounded = |row: usize, magnitude: T, y: T| match contact {
            ContactLevel::Position { .. } => constraints.gap_rounding(row, magnitude, y),
            ContactLevel::Velocity { .. } => rounding(magnitude + y.abs()),
        };
        let mut tolerance: Vec<T> =
            y.iter().enumerate().map(|(row, &y)| scale * rounded(row, g.magnitude(row, &target), y)).collect();
        // The stabilized bipenalty compares with the step before, whose gap is assumed to be the same.
        if constraints.laws().predictive {
            let mut gaps = vec![T::zero(); constraints.len()];
            constraints.finite_gaps(motion.t, &motion.u, &mut gaps)?;
            for (row, (y, gap)) in y.iter_mut().zip(gaps).enumerate() {
                if constraints.law(row).is_predictive() {
                    *y += gap - T::of(2.0) * (-gap).max(T::zero());
                }
            }
        }
        let mut offset: Vec<T> = y.into_iter().map(|y| scale * y).collect();
        // The slip there, or the displacement until then.
        let mut slips = vec![GapRates::default(); constraints.tangents().len()];
        constraints.finite_slip_rates(t, &motion.u, &motion.v, &mut slips)?;
        for (row, own) in constraints.tangents().all().zip(&slips) {
            let slip = match contact {
                ContactLevel::Position { .. } => {
                    let way = g.row(row).map(|(dof, weight)| weight * (target[dof] - motion.u[dof])).sum::<T>();
                    way + T::of(lead) * own.rate
                }
                ContactLevel::Velocity { .. } => g.product(row, &target) + own.rate,
            };
            offset.push(scale * slip);
            tolerance.push(scale * rounding(g.magnitude(row, &target)));
        }
        let takes_part = |row: &usize| constraints.law(*row).is_equality() || offset[*row] < -tolerance[*row];
        let aimed = |row: &usize| open[*row] && constraints.law(*row).needs_multiplier();
        let (rows, waiting) = (0..constraints.len()).filter(aimed).partition(takes_part);
        // A mean gap changes by half of the response.
        let compliance =
            |law: ContactLaw| T::of(2.0) * scale * law.linearized(-T::one(), T::zero(), T::zero(), Course::at_rest()).0;
        let compliance = (0..constraints.len()).map(|row| compliance(constraints.law(row))).collect();
        Ok(Self {
            rows,
            waiting,
            offset,
            tolerance,
            compliance,
            sliding: Vec::new(),
            h: None,
            solved: Vec::new(),
            lambda: Vec::new(),
        })
    }

    /// Treats a contact as sticking if its friction can hold it: its slip is rounding.
    pub(crate) fn stick(&mut self, contact: usize) {
        self.sliding.retain(|slide| slide.contact != contact);
    }

    /// Changes the velocities by the impact without collision that stops the slip of a contact: its gap rate and slip
    /// are zero afterwards, with impulses W X = −(gap rate, slip). The other contacts of the problem have impulses by
    /// Coulomb's law of impact: 0 ≤ X_n ⊥ gap rate ≥ 0, |X_t| ≤ μ X_n against the slip. Changes nothing if there are
    /// no such impulses, or if the impulses of the contact are outside of its cone.
    pub(crate) fn stop(
        &self,
        contact: usize,
        (constraints, g, projection): (&mut Constraints<'_, T>, &ContactJacobian<T>, &mut JumpProjection<T>),
        rubs: &dyn Fn(usize) -> bool,
        solver: &mut dyn ContactSolver<T>,
        motion: &mut Motion<T>,
    ) -> Result<Option<StartImpact<T>>> {
        let mut rates = vec![GapRates::default(); constraints.len()];
        constraints.finite_rates(motion.t, &motion.u, &motion.v, &mut rates)?;
        let mut slips = vec![GapRates::default(); constraints.tangents().len()];
        constraints.finite_slip_rates(motion.t, &motion.u, &motion.v, &mut slips)?;
        rates.truncate(constraints.len());
        rates.append(&mut slips);
        let rate = |v: &[T], row: usize| g.product(row, v) + rates[row].rate;
        let (tangents, mut problem) = (constraints.tangents(), JumpProblem::default());
        for &row in self.rows.iter().filter(|&&row| self.compliance[row] == T::zero()) {
            let own = if rubs(row) { tangents.of(row) } else { 0..0 };
            let set = if own.is_empty() { constraints.law(row).into() } else { constraints.set(row) };
            if row != contact {
                problem.add_block(&Block::new(row, own.len(), set));
            }
            for row in std::iter::once(row).chain(own) {
                if tangents.owner(row) == contact {
                    problem.add_block(&Block::new(row, 0, AdmissibleSet::Free));
                }
                let noise = rounding(g.magnitude(row, &motion.v) + rates[row].rate.abs());
                problem.add_row(row, rate(&motion.v, row), noise, T::zero());
            }
        }
        solver.reserve(problem.rows.len());
        let id = |row| constraints.ids[tangents.owner(row)];
        if problem.solve((g, &mut *projection), solver, T::one(), (motion.t, id)).is_err() {
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
        let bound = T::of(tangents.friction(contact)) * (T::one() + T::epsilon().sqrt()) * normal;
        if normal.is_nan() || normal <= T::zero() || friction[0].hypot(friction[1]) > bound {
            return Ok(None);
        }
        let mut v = motion.v.clone();
        projection.push(g, (&problem.rows, &problem.totals), T::one(), &mut v)?;
        let work = |(&row, &impulse): (&usize, &T)| impulse * (rate(&motion.v, row) + rate(&v, row));
        let energy = T::of(0.5) * problem.rows.iter().zip(&problem.totals).map(work).sum::<T>();
        motion.v = v;
        Ok(Some(StartImpact { contact: constraints.ids[contact], normal, friction, energy }))
    }

    /// Applies the multipliers and closes their contacts.
    pub(crate) fn press(
        self,
        g: &ContactJacobian<T>,
        projection: &mut JumpProjection<T>,
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<()> {
        projection.push(g, (&self.solved, &self.lambda), T::one(), &mut motion.a)?;
        for (&row, &lambda) in self.solved.iter().zip(&self.lambda) {
            contacts.lambda[row] = lambda;
            contacts.lambda_raw[row] = lambda;
            if !g.is_tangential(row) {
                contacts.closed[row] = true;
            }
        }
        for &row in self.rows.iter().filter(|&&row| !contacts.tangents.of(row).is_empty()) {
            let bound = T::of(contacts.tangents.friction(row)) * contacts.lambda[row];
            let moves = self.sliding.iter().any(|slide| slide.contact == row && slide.stops);
            contacts.sliding[row] = moves || slides(contacts.tangential(row, &contacts.lambda), bound);
        }
        Ok(())
    }

    /// Solves. `rubs` returns whether the friction of a contact takes part.
    pub(crate) fn solve(
        &mut self,
        t: f64,
        constraints: &Constraints<'_, T>,
        g: &ContactJacobian<T>,
        (projection, rubs): (&mut JumpProjection<T>, &dyn Fn(usize) -> bool),
        solver: &mut dyn ContactSolver<T>,
    ) -> Result<()> {
        self.solved.clear();
        loop {
            match (self.rows.is_empty(), constraints.tangents().is_empty()) {
                (true, _) => {}
                (_, true) => self.solve_gaps(t, constraints, (g, &mut *projection), solver)?,
                (_, false) => self.solve_rubbing(t, constraints, (g, &mut *projection, rubs), solver)?,
            }
            let Self { rows, waiting, offset, tolerance, sliding, h, solved, lambda, .. } = self;
            let mut pushed = vec![T::zero(); projection.dofs()];
            projection.push(g, (solved, lambda), T::one(), &mut pushed)?;
            if let Some(h) = *h {
                let (rub, acceleration) = (&*solved, |k: usize| offset[k] + g.product(k, &pushed));
                if stop_in_time(sliding, constraints.tangents(), h, |k| rub.contains(&k).then(|| acceleration(k))) {
                    continue;
                }
            }
            let violated = |row: &usize| offset[*row] + g.product(*row, &pushed) < -tolerance[*row];
            let joining: Vec<usize> = waiting.iter().copied().filter(violated).collect();
            if joining.is_empty() {
                break;
            }
            waiting.retain(|row| !joining.contains(row));
            rows.extend(joining);
            rows.sort_unstable();
        }
        Ok(())
    }

    /// Solves for the rows that take part.
    fn solve_gaps(
        &mut self,
        t: f64,
        constraints: &Constraints<'_, T>,
        (g, projection): (&ContactJacobian<T>, &mut JumpProjection<T>),
        solver: &mut dyn ContactSolver<T>,
    ) -> Result<()> {
        let Self { rows, offset, tolerance, compliance, solved, lambda, .. } = self;
        solved.clone_from(rows);
        let mut s = Vec::new();
        projection.assemble(g, rows, &mut s)?;
        for (k, &row) in rows.iter().enumerate() {
            s[k * rows.len() + k] += compliance[row];
        }
        let pick = |values: &[T]| -> Vec<T> { rows.iter().map(|&row| values[row]).collect() };
        let sets: Vec<AdmissibleSet> = rows.iter().map(|&row| constraints.law(row).into()).collect();
        let (q, rounded) = (pick(offset), pick(tolerance));
        lambda.clear();
        lambda.resize(rows.len(), T::zero());
        solver.reserve(rows.len());
        let problem = ContactProblem::of(&s, &q, &sets, &rounded, 0);
        let solved = solver.solve(&problem, lambda);
        solved.map_err(|failure| contact_error(t, failure, |i| constraints.ids[rows[i]]))?;
        Ok(())
    }

    /// The same with friction: a sliding contact has a given friction direction.
    fn solve_rubbing(
        &mut self,
        t: f64,
        constraints: &Constraints<'_, T>,
        (g, projection, rubs): (&ContactJacobian<T>, &mut JumpProjection<T>, &dyn Fn(usize) -> bool),
        solver: &mut dyn ContactSolver<T>,
    ) -> Result<()> {
        let Self { rows, offset, tolerance, compliance, sliding, h, solved, lambda, .. } = self;
        let (tangents, mut problem) = (constraints.tangents(), JumpProblem::default());
        for &row in rows.iter() {
            let own = if rubs(row) { tangents.of(row) } else { 0..0 };
            let slide = sliding.iter().find(|slide| slide.contact == row && !own.is_empty());
            let direction = slide.and_then(|slide| slide.friction(tangents));
            let set = if own.is_empty() { constraints.law(row).into() } else { constraints.set(row) };
            let block = Block::new(row, own.len(), set);
            problem.add_block(&Block { direction, compliance: compliance[row], ..block });
            problem.add_row(row, offset[row], tolerance[row], T::zero());
            for (k, row) in own.enumerate() {
                let over = slide.zip(*h).map_or(T::zero(), |(slide, h)| slide.to_stop(h)[k]);
                problem.add_row(row, offset[row] + over, tolerance[row] + rounding(over.abs()), T::zero());
            }
        }
        solver.reserve(problem.rows.len());
        problem.solve((g, projection), solver, T::one(), (t, |row| constraints.ids[row]))?;
        *solved = problem.rows;
        *lambda = problem.totals;
        Ok(())
    }
}

/// A contact with friction that slides at the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slide<T> {
    pub(crate) contact: usize,
    /// The direction of its friction: against the slip.
    direction: [T; 2],
    speed: T,
    /// Whether its friction would reverse the slip within the first step. Coulomb's law then holds for the slip at
    /// the end of the step: the force stops the slip, if the bound allows it.
    stops: bool,
}

impl<T: Real> Slide<T> {
    /// The friction over the normal force, if it is at its bound.
    pub(crate) fn friction(&self, tangents: &Tangents) -> Option<[T; 2]> {
        (!self.stops).then(|| self.direction.map(|f| T::of(tangents.friction(self.contact)) * f))
    }

    /// The slip velocity over the step size, if the slip is to be stopped.
    pub(crate) fn to_stop(self, h: f64) -> [T; 2] {
        self.direction.map(|f| if self.stops { -self.speed / T::of(h) * f } else { T::zero() })
    }
}

/// Marks slides that would reverse by the end of a step h with the accelerations along tangential rows with friction.
/// Returns whether any mark is new.
pub(crate) fn stop_in_time<T: Real>(
    sliding: &mut [Slide<T>],
    tangents: &Tangents,
    h: f64,
    acceleration: impl Fn(usize) -> Option<T>,
) -> bool {
    let mut found = false;
    for slide in sliding.iter_mut().filter(|slide| !slide.stops) {
        let along = tangents.of(slide.contact).zip(slide.direction).map(|(k, f)| Some(acceleration(k)? * f));
        slide.stops = along.sum::<Option<T>>().is_some_and(|slower| T::of(h) * slower > slide.speed);
        found |= slide.stops;
    }
    found
}

/// The contacts with friction that slide at the start.
pub(crate) fn sliding<T: Real>(
    constraints: &Constraints<'_, T>,
    (g, rates): (&ContactJacobian<T>, &[GapRates<T>]),
    motion: &Motion<T>,
) -> Vec<Slide<T>> {
    let tangents = constraints.tangents();
    let mut sliding = Vec::new();
    for row in tangents.contacts() {
        let (mut slip, mut noise) = ([T::zero(); 2], T::zero());
        for (slip, k) in slip.iter_mut().zip(tangents.of(row)) {
            let own = rates[k - tangents.all().start].rate;
            *slip = g.product(k, &motion.v) + own;
            noise = noise.max(rounding(g.magnitude(k, &motion.v) + own.abs()));
        }
        let speed = slip[0].hypot(slip[1]);
        if speed > noise {
            sliding.push(Slide { contact: row, direction: slip.map(|slip| -slip / speed), speed, stops: false });
        }
    }
    sliding
}
