//! Detects steps that have become too long in a run: compliant contacts that close, and systems that stiffen.

use crate::analysis;
use crate::contact::ContactJacobian;
use crate::contact_id::ContactId;
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::mass::Mass;
use crate::real::Real;
use crate::rounding::difference_error;
use crate::simulation::build::scheme::Scheme;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::watch::stability::{self, StepLimit};
use crate::state::{Clock, Motion};
use crate::system::{Linearity, System};

/// Nonlinear systems are checked in every step whose number is a multiple of this: a check costs about ten
/// evaluations of the force.
const EVERY: u64 = 512;

/// A step in which accelerations reverse their sign and grow by this factor is checked: at a frequency 5e-5 above the
/// limit they grow by more.
const GROWTH: f64 = 1.02;

/// A step in which accelerations grow by this factor is checked whatever their sign.
const LEAP: f64 = 4.0;

/// Share of the limit above which the stiffness of the change in a step makes accelerations that grow worth a check.
/// If u grows by far more than a factor of two in a step, and a scheme reports accelerations of the step before, this
/// stiffness is 1/h².
const SHARE: f64 = 0.1;

/// Reserve for laws that stiffen under load, so that not every step of a compression is checked.
const RESERVE: f64 = 1.25;

/// Checks in every step of a conditionally stable scheme whether system and active contacts are below its limit. A
/// step is refused only by a lower bound of the highest frequency.
///
/// * Springs of contact: k G M⁻¹ Gᵀ of each, in every step.
/// * Linear systems: if the bounds of mesh and contact together do not admit the step, Lanczos' iteration with the
///   active springs, when one closes.
/// * Nonlinear systems: Lanczos' iteration with the tangent at the end of the step and the active springs, or the
///   frequency given by the host, in every 512th step and in steps whose accelerations grow as in unstable motions.
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
    /// One entry a dof, zero between steps.
    sums: Vec<T>,
    /// Springs that were found admissible together, and the step size.
    cleared: (Vec<(ContactId, f64)>, f64),
}

/// A step that has been solved, but not accepted.
pub(crate) struct SolvedStep<'s, 'a, T: Real> {
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
        let sums = vec![T::zero(); system.dofs()];
        Some(Self { critical, lag: None, may_stiffen, springs: Vec::new(), sums, cleared: (Vec::new(), 0.0) })
    }

    /// Refuses a step beyond the limit.
    pub(crate) fn check(&mut self, mut step: SolvedStep<'_, '_, T>) -> Result<()> {
        let StepLimit::Cleared(cleared) = step.limit else { return Ok(()) };
        self.list_springs(&step);
        if self.springs.is_empty() && !self.may_stiffen {
            return Ok(());
        }
        let most = (self.critical * stability::allowance::<T>() / step.clock.h).powi(2);
        let [stiffest, bound] = self.bounds(&*step.system, step.contact.rows.curved.forces(step.g));
        if stiffest.1 > most {
            return Err(self.refusal(&mut step, stiffest.1, Some(stiffest.0)));
        }
        match self.may_stiffen {
            true if step.clock.steps.is_multiple_of(EVERY) || may_be_unstable(&step, most) => {
                self.check_tangent(&mut step, most)
            }
            // By Weyl's inequality.
            false if bound.1 + (self.critical / cleared).powi(2) > most => self.check_springs(&mut step, most),
            _ => Ok(()),
        }
    }

    fn list_springs(&mut self, step: &SolvedStep<'_, '_, T>) {
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

    /// Checks the highest frequency of a linear system with the active springs, unless it is known to be admissible.
    fn check_springs(&mut self, step: &mut SolvedStep<'_, '_, T>, most: f64) -> Result<()> {
        let ids = &step.constraints.ids;
        let h = step.clock.h;
        let (known, known_h) = &self.cleared;
        let is_known = |&(row, k): &(usize, f64)| known.iter().any(|&(id, most)| id == ids[row] && k <= most);
        if h <= *known_h && self.springs.iter().all(is_known) {
            return Ok(());
        }
        // With the reserve, if the limit admits it.
        let reserved = |&(row, k): &(usize, f64)| {
            let reserve = if step.constraints.law(row).is_nonlinear() { RESERVE } else { 1.0 };
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

    /// Checks the highest frequency of a nonlinear system at the end of the step, with the active springs.
    fn check_tangent(&self, step: &mut SolvedStep<'_, '_, T>, most: f64) -> Result<()> {
        // Systems without a tangent are differenced.
        let most = most * (1.0 + difference_error::<T>().value());
        let square = match step.system.highest_frequency() {
            Some(frequency) => frequency * frequency,
            None => highest(step, &self.springs, most)?.map_or(0.0, |[at_least, _]| at_least),
        };
        if square > most { Err(self.refusal(step, square, None)) } else { Ok(()) }
    }

    fn refusal(&self, step: &mut SolvedStep<'_, '_, T>, square: f64, row: Option<usize>) -> Error {
        // The largest stable step, with the rest of the system.
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

/// Whether accelerations have grown in the step as in motions beyond the limit: reversed and larger, or several times
/// larger, and by a change that is about as stiff as the limit, ΔaᵀM Δa / ΔaᵀM Δu. Oscillations through equilibrium
/// are not.
fn may_be_unstable<T: Real>(step: &SolvedStep<'_, '_, T>, most: f64) -> bool {
    let mass = match step.system.mass() {
        Mass::Lumped(mass) => mass,
        Mass::Consistent(_) => &[],
    };
    let (start, new) = (step.start, step.new);
    let [mut before, mut now, mut both, mut square, mut product] = [T::zero(); 5];
    for (dof, (&x, &y)) in start.a.iter().zip(&new.a).enumerate() {
        let m = mass.get(dof).copied().unwrap_or(T::one());
        before += m * x * x;
        now += m * y * y;
        both += m * x * y;
        square += m * (y - x) * (y - x);
        product += m * (y - x) * (new.u[dof] - start.u[dof]);
    }
    let reverses = both < T::zero() && T::of(4.0) * both * both > before * now;
    let grows = reverses && now > T::of(GROWTH * GROWTH) * before || now > T::of(LEAP * LEAP) * before;
    grows && square > T::of(SHARE * most) * product.abs()
}

/// Bounds of the square of the highest frequency with springs of contact.
fn highest<T: Real>(
    step: &mut SolvedStep<'_, '_, T>,
    springs: &[(usize, f64)],
    enough: f64,
) -> Result<Option<[f64; 2]>> {
    let forces = step.contact.rows.curved.forces(step.g);
    stability::highest_square(step.system, step.new, enough, |x, y| {
        for &(row, k) in springs {
            forces.scatter(row, T::of(k) * forces.product(row, x), y);
        }
    })
}
