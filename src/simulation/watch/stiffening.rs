//! Detects steps that have become too long in a run: compliant contacts that close, and systems that stiffen.

use crate::analysis;
use crate::contact::ContactJacobian;
use crate::contact_id::ContactId;
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::linear_solver::components;
use crate::mass::Mass;
use crate::real::Real;
use crate::simulation::build::scheme::Scheme;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::watch::stability::{self, StepLimit};
use crate::state::{Clock, Motion};
use crate::system::{Linearity, System};

/// Hosts that give their highest frequency are asked again after this number of steps.
const EVERY: u64 = 64;

/// Accelerations that reverse their sign and grow by this factor in a step are checked: at a frequency 5e-5 above the
/// limit they grow by more.
const GROWTH: f64 = 1.02;

/// Accelerations that grow by this factor in a step are checked whatever their sign.
const LEAP: f64 = 4.0;

/// Checks in every step of a conditionally stable scheme whether the system and the active contacts are still below
/// its limit. A step is refused only if a motion has a Rayleigh quotient, a lower bound of the square of the highest
/// frequency, above the limit.
///
/// * Springs of contact: the quotient of M⁻¹ Gᵀ of each, k G M⁻¹ Gᵀ, in every step. Where the bounds of mesh and
///   contact together do not admit the step, Lanczos' iteration with the active springs, when one closes.
/// * Systems that stiffen: the quotient of ½ h² a between u and u + ½ h² a, where accelerations have grown and
///   reversed their sign, as in every step of motions beyond the limit, or have grown several times. For such a
///   motion u + ½ h² a is the next state, so that the mean stiffness of a nonlinear force over the step counts: a
///   cubic spring grows without bound exactly beyond it. Bodies that the pattern of the tangent separates are checked
///   one by one: otherwise a light body would be hidden by a falling or strongly loaded one. One body among several
///   is checked only if Δaᵀ M Δa over Δaᵀ M Δu, the stiffness of the change in the step, is nearly the limit, and no
///   contact of the body has closed or opened: oscillations through equilibrium and impacts cost nothing.
///
/// Only the list of admissible springs is kept from step to step.
#[derive(Debug)]
pub(crate) struct Stiffening<T> {
    /// Ω up to which the scheme is stable without damping.
    critical: f64,
    /// The equivalent stiffness of a dashpot, times h/c: Ω² over the c h/m up to which the scheme is stable with
    /// forces of the rate before. Computed when a dashpot first carries a force.
    lag: Option<f64>,
    may_stiffen: bool,
    /// Rows with active springs that are not coupled in the step, and their stiffness.
    springs: Vec<(usize, f64)>,
    /// The body of each dof; empty if there is only one.
    body: Vec<usize>,
    bodies: Vec<Body<T>>,
    /// One entry a dof, zero between steps.
    sums: Vec<T>,
    way: Vec<T>,
    force: [Vec<T>; 2],
    /// Springs that were found admissible together, and the step size.
    cleared: (Vec<(ContactId, f64)>, f64),
}

/// Sums over a body, in the norm of a lumped mass.
#[derive(Clone, Copy, Debug)]
struct Body<T> {
    /// Squares of the accelerations at the start of the step and at its end, and their product.
    accelerations: [T; 3],
    /// Square of the change of the accelerations, and the product of the changes of accelerations and displacements.
    changes: [T; 2],
    /// Whether its quotient is needed.
    is_asked: bool,
    /// The largest entries of ½ h² a and of the displacements.
    far: T,
    near: T,
    /// Numerator and denominator of the quotient.
    stiffness: T,
    mass: T,
}

impl<T: Real> Body<T> {
    fn nothing() -> Self {
        let zero = T::zero();
        let (accelerations, changes) = ([zero; 3], [zero; 2]);
        Self { accelerations, changes, is_asked: false, far: zero, near: zero, stiffness: zero, mass: zero }
    }

    /// Whether accelerations have reversed their sign and grown, or grown by [`LEAP`].
    fn grows(&self) -> bool {
        let [before, now, both] = self.accelerations;
        let turns = both < T::zero() && T::of(4.0) * both * both > before * now;
        turns && now > T::of(GROWTH * GROWTH) * before || now > T::of(LEAP * LEAP) * before
    }

    /// Whether the change in the step may be as stiff as `most`, the square of a frequency.
    fn may_be_stiff(&self, most: f64) -> bool {
        /// Share of the limit above which a body is checked. If u grows by far more than a factor of two in a step,
        /// and a scheme reports accelerations of the step before, the quotient is the square of the frequency over
        /// that growth: 1/h².
        const SHARE: f64 = 0.1;
        self.changes[0] > T::of(SHARE * most) * self.changes[1].abs()
    }

    fn square(&self) -> f64 {
        self.stiffness.value() / self.mass.value()
    }
}

/// A step that has been taken, but not accepted.
pub(crate) struct Taken<'s, 'a, T: Real> {
    pub(crate) system: &'s mut dyn System<T>,
    pub(crate) scheme: &'s Scheme<'a>,
    pub(crate) limit: StepLimit,
    pub(crate) clock: Clock,
    pub(crate) constraints: &'s Constraints<'a, T>,
    pub(crate) g: &'s ContactJacobian<T>,
    pub(crate) contact: &'s ContactWork<T>,
    pub(crate) start: &'s Motion<T>,
    pub(crate) new: &'s Motion<T>,
}

/// Ω² over c h/m of the largest stable steps of a spring alone and of a dashpot alone.
fn lag(scheme: &Scheme<'_>, critical: f64) -> f64 {
    let longest = analysis::critical_step(&scheme.tableau, 0.0, 1.0);
    longest.map_or(0.0, |longest| critical * critical / longest)
}

impl<T: Real> Stiffening<T> {
    /// None for unconditionally stable schemes, and for linear systems without contact.
    pub(crate) fn of(system: &dyn System<T>, scheme: &Scheme<'_>, may_press: bool) -> Option<Self> {
        let may_stiffen = system.linearity() == Linearity::Nonlinear;
        if !may_stiffen && !may_press {
            return None;
        }
        let critical = stability::critical(scheme)?;
        let dofs = || vec![T::zero(); system.dofs()];
        let (body, bodies) = bodies(system);
        Some(Self {
            critical,
            lag: None,
            may_stiffen,
            springs: Vec::new(),
            body,
            bodies: vec![Body::nothing(); bodies],
            sums: dofs(),
            way: dofs(),
            force: [dofs(), dofs()],
            cleared: (Vec::new(), 0.0),
        })
    }

    /// Refuses a step beyond the limit.
    pub(crate) fn check(&mut self, mut step: Taken<'_, '_, T>) -> Result<()> {
        let StepLimit::Cleared(cleared) = step.limit else { return Ok(()) };
        self.list_springs(&step);
        if self.springs.is_empty() && !self.may_stiffen {
            return Ok(());
        }
        let h = step.clock.h;
        let most = (self.critical * stability::allowance::<T>() / h).powi(2);
        let [stiffest, bound] = self.bounds(&*step.system, step.contact.rows.curved.forces(step.g));
        if stiffest.1 > most {
            return Err(self.refusal(&mut step, stiffest.1, Some(stiffest.0)));
        }
        if !self.may_stiffen {
            // By Weyl's inequality.
            if bound.1 + (self.critical / cleared).powi(2) <= most {
                return Ok(());
            }
            self.iterate(&mut step, most)?;
        } else if step.clock.steps.is_multiple_of(EVERY)
            && let Some(frequency) = step.system.highest_frequency()
            && frequency * frequency > most
        {
            return Err(self.refusal(&mut step, frequency * frequency, None));
        }
        let beyond = most * (1.0 + 1e-3_f64.max(32.0 * T::epsilon().value().sqrt()));
        if self.grows(&step, most)
            && let Some(square) = self.quotient(&mut step, beyond)
            && square > beyond
        {
            return Err(self.refusal(&mut step, square, None));
        }
        Ok(())
    }

    fn body_of(&self, dof: usize) -> usize {
        self.body.get(dof).copied().unwrap_or(0)
    }

    /// Finds the bodies whose accelerations have grown. Returns whether there are any.
    fn grows(&mut self, step: &Taken<'_, '_, T>, most: f64) -> bool {
        let mass = match step.system.mass() {
            Mass::Lumped(mass) => mass,
            Mass::Consistent(_) => &[],
        };
        let (start, new) = (step.start, step.new);
        self.bodies.fill(Body::nothing());
        for (dof, (&x, &y)) in start.a.iter().zip(&new.a).enumerate() {
            let m = mass.get(dof).copied().unwrap_or(T::one());
            let of = self.body_of(dof);
            let Body { accelerations: [before, now, both], changes: [square, product], .. } = &mut self.bodies[of];
            *before += m * x * x;
            *now += m * y * y;
            *both += m * x * y;
            if !self.body.is_empty() {
                *square += m * (y - x) * (y - x);
                *product += m * (y - x) * (new.u[dof] - start.u[dof]);
            }
        }
        let mut all = Body::<T>::nothing();
        for body in &self.bodies {
            all.accelerations.iter_mut().zip(body.accelerations).for_each(|(sum, own)| *sum += own);
        }
        let all_grow = all.grows();
        for body in &mut self.bodies {
            body.is_asked = all_grow || body.grows() && body.may_be_stiff(most);
        }
        if !all_grow {
            let ContactWork { rows, trial, closed_at_start, .. } = step.contact;
            let forces = rows.curved.forces(step.g);
            let flags = trial.closed.iter().zip(closed_at_start).enumerate();
            for (row, _) in flags.filter(|(_, (now, before))| now != before) {
                for (dof, _) in forces.row(row) {
                    let of = self.body_of(dof);
                    self.bodies[of].is_asked = false;
                }
            }
        }
        self.bodies.iter().any(|body| body.is_asked)
    }

    fn list_springs(&mut self, step: &Taken<'_, '_, T>) {
        let ContactWork { rows, trial, .. } = step.contact;
        self.springs.clear();
        if !step.constraints.laws().compliant {
            return;
        }
        for (row, law) in step.constraints.laws().iter().enumerate() {
            // A contact that opened before the end of the step has carried a force in one of its stages.
            let force = trial.lambda_raw[row].max(trial.impulse[row] / T::of(step.clock.h));
            // The unknown may contain the force of the dashpot only.
            let holds = rows.weight[row] != T::zero();
            let coupled = holds && !law.is_damped() || rows.massless.acts.get(row).is_some_and(|on| *on);
            if law.is_spring() && !coupled && force > T::zero() {
                let [stiffness, damping] = law.slopes(force.value(), (-rows.laws.balance_gap[row]).value());
                // Both limits together: (Ω/Ω_c)² + (c h/m)/x_c < 1.
                let lagged = damping > 0.0 && !holds;
                let lag = lagged.then(|| *self.lag.get_or_insert_with(|| lag(step.scheme, self.critical)));
                self.springs.push((row, stiffness + lag.unwrap_or(0.0) * damping / step.clock.h));
            }
        }
    }

    /// The row with the highest frequency of its own, with the square of that frequency, and a bound of the square of
    /// the highest frequency of all rows together. No bounds for a consistent mass.
    fn bounds(&mut self, system: &dyn System<T>, forces: &ContactJacobian<T>) -> [(usize, f64); 2] {
        let Mass::Lumped(mass) = system.mass() else { return [(0, 0.0), (0, f64::INFINITY)] };
        let prescribed = system.prescribed();
        let free = |dof: usize| mass[dof] > T::zero() && prescribed.binary_search(&dof).is_err();
        let (mut stiffest, mut bound) = ((0, 0.0), 0.0_f64);
        for &(row, k) in &self.springs {
            let terms = || forces.row(row).filter(|&(dof, _)| free(dof));
            let size: T = terms().map(|(_, weight)| weight.abs()).sum();
            let square = k * terms().map(|(dof, weight)| weight * weight / mass[dof]).sum::<T>().value();
            if square > stiffest.1 {
                stiffest = (row, square);
            }
            terms().for_each(|(dof, weight)| self.sums[dof] += T::of(k) * weight.abs() * size);
        }
        for &(row, _) in &self.springs {
            for (dof, _) in forces.row(row).filter(|&(dof, _)| free(dof)) {
                bound = bound.max((self.sums[dof] / mass[dof]).value());
            }
        }
        for &(row, _) in &self.springs {
            forces.row(row).for_each(|(dof, _)| self.sums[dof] = T::zero());
        }
        [stiffest, (0, bound)]
    }

    /// Checks the highest frequency with the active springs, unless it is known to be admissible.
    fn iterate(&mut self, step: &mut Taken<'_, '_, T>, most: f64) -> Result<()> {
        let ids = &step.constraints.ids;
        let h = step.clock.h;
        let (known, known_h) = &self.cleared;
        let is_known = |&(row, k): &(usize, f64)| known.iter().any(|&(id, most)| id == ids[row] && k <= most);
        if h <= *known_h && self.springs.iter().all(is_known) {
            return Ok(());
        }
        // With a reserve for laws that stiffen under load, if the limit admits it.
        let reserved = |&(row, k): &(usize, f64)| {
            let reserve = if step.constraints.law(row).is_nonlinear() { 1.25 } else { 1.0 };
            (row, reserve * k)
        };
        let mut springs: Vec<_> = self.springs.iter().map(reserved).collect();
        let mut found = highest(step, &springs, most)?;
        if found.is_some_and(|[square, _]| square > most) && springs != self.springs {
            springs.clone_from(&self.springs);
            found = highest(step, &springs, most)?;
        }
        if let Some([square, _]) = found.filter(|[square, _]| *square > most) {
            let stiffest = springs.iter().max_by(|x, y| x.1.total_cmp(&y.1)).map(|spring| spring.0);
            return Err(self.refusal(step, square, stiffest));
        }
        self.cleared = (springs.iter().map(|&(row, k)| (step.constraints.ids[row], k)).collect(), h);
        Ok(())
    }

    /// The largest Rayleigh quotient of ½ h² a of the bodies to check, if ½ h² a is large enough beside u to have
    /// digits.
    fn quotient(&mut self, step: &mut Taken<'_, '_, T>, beyond: f64) -> Option<f64> {
        let Taken { system, new, clock, .. } = step;
        let half = T::of(0.5 * clock.h * clock.h);
        self.way.copy_from_slice(&new.a);
        for &dof in system.prescribed() {
            self.way[dof] = T::zero();
        }
        for dof in 0..self.way.len() {
            let of = self.body_of(dof);
            self.way[dof] *= half;
            let Body { far, near, .. } = &mut self.bodies[of];
            (*far, *near) = (far.max(self.way[dof].abs()), near.max(new.u[dof].abs()));
        }
        for body in &mut self.bodies {
            body.is_asked &= body.far > T::epsilon().sqrt() * body.near;
        }
        let asked = self.bodies.iter().filter(|body| body.is_asked).count();
        if asked == 0 {
            return None;
        }
        self.keep_ways();
        self.means(step)?;
        if self.bodies.iter().any(|body| body.is_asked && !body.square().is_finite()) {
            // If the forces there or their work overflow, ½ h² a is scaled down to the magnitude of the
            // displacements.
            for dof in 0..self.way.len() {
                let Body { far, near, .. } = self.bodies[self.body_of(dof)];
                if far > near {
                    self.way[dof] *= near / far;
                }
            }
            self.means(step)?;
        }
        let squares = self.bodies.iter().enumerate().filter(|(_, body)| body.is_asked);
        let squares = squares.map(|(k, body)| (k, body.square())).filter(|(_, square)| square.is_finite());
        let (largest, square) = squares.max_by(|x, y| x.1.total_cmp(&y.1))?;
        if asked == 1 || square <= beyond {
            return Some(square);
        }
        // Evaluated alone: forces between bodies, which the pattern does not contain, would falsify the quotient.
        self.bodies.iter_mut().enumerate().for_each(|(k, body)| body.is_asked = k == largest);
        self.keep_ways();
        self.means(step)?;
        Some(self.bodies[largest].square()).filter(|square| square.is_finite())
    }

    /// Sets ½ h² a to zero in bodies that are not checked.
    fn keep_ways(&mut self) {
        for dof in 0..self.way.len() {
            if !self.bodies[self.body_of(dof)].is_asked {
                self.way[dof] = T::zero();
            }
        }
    }

    /// Computes the quotients of the bodies, NaN where there is none. Returns nothing if the host refuses the
    /// displacements.
    fn means(&mut self, step: &mut Taken<'_, '_, T>) -> Option<()> {
        let Taken { system, new, .. } = step;
        let [there, here] = &mut self.force;
        self.sums.copy_from_slice(&new.u);
        T::axpy(T::one(), &self.way, &mut self.sums);
        // A refusal there is no error of this step. The state of the step comes last, as hosts keep it.
        let known = system.force(new.t, &self.sums, &new.v, there);
        let known = known.and(system.force(new.t, &new.u, &new.v, here));
        self.sums.fill(T::zero());
        known.ok()?;
        system.mass().add_product(T::one(), &self.way, &mut self.sums);
        for body in &mut self.bodies {
            (body.stiffness, body.mass) = (T::zero(), T::zero());
        }
        for dof in 0..self.way.len() {
            let (way, of) = (self.way[dof], self.body_of(dof));
            let body = &mut self.bodies[of];
            body.stiffness += way * (self.force[1][dof] - self.force[0][dof]);
            body.mass += way * self.sums[dof];
        }
        self.sums.fill(T::zero());
        let forces = step.contact.rows.curved.forces(step.g);
        for &(row, k) in &self.springs {
            for (dof, _) in forces.row(row) {
                let of = self.body_of(dof);
                // Once per body: at its first dof in the row.
                let own = || forces.row(row).filter(|&(dof, _)| self.body_of(dof) == of);
                if own().next().is_some_and(|(first, _)| first == dof) {
                    let product: T = own().map(|(dof, weight)| weight * self.way[dof]).sum();
                    self.bodies[of].stiffness += T::of(k) * product * product;
                }
            }
        }
        Some(())
    }

    fn refusal(&self, step: &mut Taken<'_, '_, T>, square: f64, row: Option<usize>) -> Error {
        // The largest stable step by the best estimate for the system, not by the motion that exceeds the limit.
        let known = highest(step, &self.springs, 0.0).ok().flatten();
        let highest = known.map_or(square, |[_, at_most]| at_most.max(square));
        Error::Stiffened {
            integrator: step.scheme.integrator.name(),
            t: step.clock.at(0.0),
            h: step.clock.h,
            contact: row.map(|row| step.constraints.ids[row]),
            largest: self.critical / highest.sqrt(),
            frequency: square.sqrt(),
        }
    }
}

/// Bounds of the square of the highest frequency with springs of contact.
fn highest<T: Real>(step: &mut Taken<'_, '_, T>, springs: &[(usize, f64)], enough: f64) -> Result<Option<[f64; 2]>> {
    let forces = step.contact.rows.curved.forces(step.g);
    stability::highest_square(step.system, step.new, enough, |x, y| {
        for &(row, k) in springs {
            forces.scatter(row, T::of(k) * forces.product(row, x), y);
        }
    })
}

/// The body of each dof, and the number of bodies. There is one body if the pattern has no entries, or if the mass
/// couples bodies of the pattern.
fn bodies<T: Real>(system: &dyn System<T>) -> (Vec<usize>, usize) {
    let pattern = system.pattern();
    if pattern.row_idx().is_empty() {
        return (Vec::new(), 1);
    }
    let (body, list) = components(pattern);
    let is_coupled = match system.mass() {
        Mass::Lumped(_) => false,
        Mass::Consistent(mass) => {
            (0..mass.ncols()).any(|column| mass.row_idx_of_col_raw(column).iter().any(|&row| body[row] != body[column]))
        }
    };
    match is_coupled {
        true => (Vec::new(), 1),
        false => (body, list.len()),
    }
}
