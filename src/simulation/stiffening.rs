//! Steps that have become too long as the run went: compliant contacts that close, and systems that stiffen.

use super::constraints::Constraints;
use super::contact_step::ContactWork;
use super::scheme::Scheme;
use super::stability::{self, StepLimit};
use crate::contact::ContactJacobian;
use crate::contact_id::ContactId;
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::mass::Mass;
use crate::real::Real;
use crate::state::{Clock, Motion};
use crate::system::{Linearity, System};

/// Hosts that know their highest frequency are asked again after so many steps.
const EVERY: u64 = 64;

/// Accelerations that turn their sign and grow by this in a step are looked at: with a frequency 5e-5 above the limit
/// they grow by more.
const GROWTH: f64 = 1.02;

/// Accelerations that grow by this in a step are looked at whatever their sign.
const LEAP: f64 = 4.0;

/// Looks at every step of a scheme that is stable up to some frequency, whether the system and the contacts that press
/// are still below it. A step is refused only beside a motion whose Rayleigh quotient, a lower bound of the square of
/// the highest frequency, is above it.
///
/// * Springs of contact: the quotient of M⁻¹ Gᵀ of each, k G M⁻¹ Gᵀ, in every step. Where the bounds of mesh and
///   contact together do not admit the step, Lanczos' iteration with those that press, when one closes.
/// * Systems that stiffen: the quotient of ½ h² a between u and u + ½ h² a, where accelerations have grown and turned
///   their sign, as those of motions beyond the limit do in every step, or have become several times as large. (Of such
///   a motion u + ½ h² a is the next state, so that for a nonlinear force it is the mean stiffness over the step that
///   counts: a spring of the third power grows without bound exactly beyond it.)
///
/// Nothing is remembered from step to step but which springs have been found admissible.
#[derive(Debug)]
pub(super) struct Stiffening<T> {
    /// Ω up to which the scheme is stable without damping.
    critical: f64,
    may_stiffen: bool,
    /// Rows that press by springs without coupling in the step, and their stiffness.
    springs: Vec<(usize, f64)>,
    /// One entry a dof, zero between steps.
    sums: Vec<T>,
    way: Vec<T>,
    force: [Vec<T>; 2],
    /// Springs that were found admissible together, with a step size.
    cleared: (Vec<(ContactId, f64)>, f64),
}

/// A step that has been taken, but not accepted.
pub(super) struct Taken<'s, 'a, T: Real> {
    pub(super) system: &'s mut dyn System<T>,
    pub(super) scheme: &'s Scheme<'a>,
    pub(super) limit: StepLimit,
    pub(super) clock: Clock,
    pub(super) constraints: &'s Constraints<'a, T>,
    pub(super) g: &'s ContactJacobian<T>,
    pub(super) contact: &'s ContactWork<T>,
    pub(super) start: &'s Motion<T>,
    pub(super) new: &'s Motion<T>,
}

impl<T: Real> Stiffening<T> {
    /// None for schemes that are stable whatever the frequency, and for systems that stay as they are.
    pub(super) fn of(system: &dyn System<T>, scheme: &Scheme<'_>, may_press: bool) -> Option<Self> {
        let may_stiffen = system.linearity() == Linearity::Nonlinear;
        if !may_stiffen && !may_press {
            return None;
        }
        let critical = stability::critical(scheme)?;
        let dofs = || vec![T::zero(); system.dofs()];
        Some(Self {
            critical,
            may_stiffen,
            springs: Vec::new(),
            sums: dofs(),
            way: dofs(),
            force: [dofs(), dofs()],
            cleared: (Vec::new(), 0.0),
        })
    }

    /// Refuses a step beyond the limit.
    pub(super) fn check(&mut self, mut step: Taken<'_, '_, T>) -> Result<()> {
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
            // (By Weyl's inequality.)
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
        if grows(&*step.system, step.start, step.new)
            && let Some(square) = self.quotient(&mut step)
            && square > most * (1.0 + 1e-3_f64.max(32.0 * T::epsilon().value().sqrt()))
        {
            return Err(self.refusal(&mut step, square, None));
        }
        Ok(())
    }

    fn list_springs(&mut self, step: &Taken<'_, '_, T>) {
        let ContactWork { rows, trial, .. } = step.contact;
        self.springs.clear();
        if !step.constraints.laws().compliant {
            return;
        }
        for (row, law) in step.constraints.laws().iter().enumerate() {
            // (A contact that has opened before the end of the step has pressed in one of its stages.)
            let force = trial.lambda_raw[row].max(trial.impulse[row] / T::of(step.clock.h));
            let coupled = rows.weight[row] != T::zero() || rows.on_massless.get(row).is_some_and(|on| *on);
            if law.is_spring() && !coupled && force > T::zero() {
                self.springs.push((row, law.tangent(force.value())));
            }
        }
    }

    /// The row with the highest frequency of its own, with the square of that, and a bound of the square of the
    /// frequency that all have together; no bounds for a consistent mass.
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

    /// Looks for the highest frequency with the springs that press, unless it is known to be admissible.
    fn iterate(&mut self, step: &mut Taken<'_, '_, T>, most: f64) -> Result<()> {
        let ids = &step.constraints.ids;
        let h = step.clock.h;
        let (known, known_h) = &self.cleared;
        let is_known = |&(row, k): &(usize, f64)| known.iter().any(|&(id, most)| id == ids[row] && k <= most);
        if h <= *known_h && self.springs.iter().all(is_known) {
            return Ok(());
        }
        // With a reserve for laws that stiffen as they are pressed, if there is room for it.
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

    /// The Rayleigh quotient of ½ h² a, if it is large enough beside u to have digits.
    fn quotient(&mut self, step: &mut Taken<'_, '_, T>) -> Option<f64> {
        let Taken { system, new, clock, .. } = step;
        let largest = |x: &[T]| x.iter().fold(T::zero(), |most, x| most.max(x.abs()));
        let half = T::of(0.5 * clock.h * clock.h);
        self.way.copy_from_slice(&new.a);
        self.way.iter_mut().for_each(|way| *way *= half);
        for &dof in system.prescribed() {
            self.way[dof] = T::zero();
        }
        let [far, near] = [largest(&self.way), largest(&new.u)];
        if far <= T::epsilon().sqrt() * near {
            return None;
        }
        let mut square = self.mean(step)?;
        if !square.is_finite() {
            // (The forces there, or what work they do, are beyond all numbers: as far as displacements are, then.)
            self.way.iter_mut().for_each(|way| *way *= near / far);
            square = self.mean(step)?;
        }
        square.is_finite().then_some(square)
    }

    /// The same of a way; none if the host refuses it.
    fn mean(&mut self, step: &mut Taken<'_, '_, T>) -> Option<f64> {
        let Taken { system, new, .. } = step;
        let [there, here] = &mut self.force;
        self.sums.copy_from_slice(&new.u);
        T::axpy(T::one(), &self.way, &mut self.sums);
        // (What the host refuses there is none of this step. The state of the step comes last: it is what hosts keep.)
        let known = system.force(new.t, &self.sums, &new.v, there);
        let known = known.and(system.force(new.t, &new.u, &new.v, here));
        self.sums.fill(T::zero());
        known.ok()?;
        let mut stiffness: T = self.way.iter().zip(&*there).zip(&*here).map(|((&y, &f), &f0)| y * (f0 - f)).sum();
        let forces = step.contact.rows.curved.forces(step.g);
        for &(row, k) in &self.springs {
            let product = forces.product(row, &self.way);
            stiffness += T::of(k) * product * product;
        }
        system.mass().add_product(T::one(), &self.way, &mut self.sums);
        let mass: T = self.way.iter().zip(&self.sums).map(|(&y, &product)| y * product).sum();
        self.sums.fill(T::zero());
        Some(stiffness.value() / mass.value())
    }

    fn refusal(&self, step: &mut Taken<'_, '_, T>, square: f64, row: Option<usize>) -> Error {
        // (The largest stable step by the best that is known of the system, not by the motion that shows it is beyond.)
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

/// Whether accelerations have turned their sign and grown, or leapt, in the norm of a lumped mass.
fn grows<T: Real>(system: &dyn System<T>, start: &Motion<T>, new: &Motion<T>) -> bool {
    let mass = match system.mass() {
        Mass::Lumped(mass) => mass,
        Mass::Consistent(_) => &[],
    };
    let [mut before, mut now, mut both] = [T::zero(); 3];
    for (dof, (&x, &y)) in start.a.iter().zip(&new.a).enumerate() {
        let m = mass.get(dof).copied().unwrap_or(T::one());
        before += m * x * x;
        now += m * y * y;
        both += m * x * y;
    }
    let turns = both < T::zero() && T::of(4.0) * both * both > before * now;
    turns && now > T::of(GROWTH * GROWTH) * before || now > T::of(LEAP * LEAP) * before
}
