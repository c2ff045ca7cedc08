//! The work of contacts without mass in the step in which they close or open, taken back.

use super::switching::{Switch, Switching};
use super::{Correction, Corrector};
use crate::analysis;
use crate::dense::dot;
use crate::error::Result;
use crate::real::Real;
use crate::tableau::Tableau;

/// Returns the work that contacts on dofs without mass do in the step in which they close or open.
///
/// Such contacts do no work as long as they last, or are open. A scheme that changes velocities by the mean of two
/// accelerations, however, has them act all through the step in which they close or open, with the mean of a force that
/// is there and one that is none. The energy that the scheme conserves changes by
///
/// ```text
/// ½ (λ + λ') (g' − g)  =  −½ g λ'  where the contact closes,   ½ g' λ  where it opens
/// ```
///
/// to rounding (theory, section 15.1). An impact takes the one and gives the other; what is left has either sign, and
/// adds up over many impacts as a random walk. The impulse over the step was too large, for the force of a contact that
/// closes is there for the last part of the step only, that of one that opens for the first. So
///
/// ```text
/// J = W/ġ within [−h λ, 0],      v' ← v' + α Σ J y
/// ```
///
/// with W what the contact has taken from the bodies (½ g λ', or −½ g' λ), ġ the rate of its gap if its dofs followed
/// the others statically, y what a unit impulse of the contact makes of the velocities of the dofs with mass, and one α
/// near 1 for those that give and one for those that take, by which the kinetic energy changes by Σ J ġ to rounding.
/// What a contact cannot return so (where ġ is small, or has the wrong sign) it owes, and returns when it closes or
/// opens again: [`dissipated`](crate::ContactState::dissipated) has it, positive where the bodies are to get it.
/// Momentum changes by the impulses, which are booked as those of the contacts:
/// [`impulses`](crate::ContactState::impulses) is what was exerted over a step, [`forces`](crate::ContactState::forces)
/// what is there at its end. Friction on such contacts gets the same share of its impulse.
///
/// Implicit steps of linear systems are solved again with what such contacts exert too much left out, all through the
/// step, until the energy stays as it is but for a thousandth of the work (theory, section 15.2); what is left is
/// returned as above. That works whatever frequencies the step does not resolve.
///
/// Costs nothing in steps in which nothing closes or opens, two or three solves with the matrix of the stage in others,
/// and in implicit ones one to eight solves of the step, with its contact.
///
/// Known failure: nonlinear systems have impulses alone. Their modes far faster than the step (ω h ≫ 1) that open and
/// close many contacts in every step leave more than can be returned: energy and forces grow, if less than without the
/// correction. Choose a scheme that damps them, as [`GeneralizedAlpha`](crate::GeneralizedAlpha).
///
/// For the trapezoidal rule, Newmark's schemes with γ = ½ (central differences, [`CdLagrange`](crate::CdLagrange) among
/// them) and [`Bathe`](crate::Bathe) with ρ∞ = 1; rows under [`ContactLaw::Rigid`](crate::ContactLaw::Rigid). Part of
/// the default for these, where contact dofs have no mass, and of the presets `conservative()` and `explicit()`.
///
/// ```
/// use contact_dynamics::corrector::{Corrector, WorkBalance};
/// use contact_dynamics::{GeneralizedAlpha, Newmark, TimeIntegrator};
///
/// let balance: &dyn Corrector<f64> = &WorkBalance;
/// assert!(balance.check(&Newmark::trapezoidal().tableau()).is_ok());
/// assert!(balance.check(&GeneralizedAlpha::chung_hulbert(0.9)?.tableau()).is_err());
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WorkBalance;

impl<T: Real> Corrector<T> for WorkBalance {
    fn name(&self) -> String {
        "work balance".into()
    }

    fn check(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        match analysis::steps_by_means(tableau) {
            true => Ok(()),
            false => Err("it needs a scheme that changes velocities by the mean of two accelerations in every stage"),
        }
    }

    fn check_friction(&self) -> std::result::Result<(), &'static str> {
        Ok(())
    }

    fn corrects_massless(&self) -> bool {
        true
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        step.count_switches();
        match step.scheme.stage + 1 == step.scheme.stages {
            true => step.return_work(),
            false => Ok(()),
        }
    }
}

impl<T: Real> Correction<'_, T> {
    /// Counts what has closed or opened in this stage: its work, and by how much its impulse may have been too large.
    fn count_switches(&mut self) {
        let Self { buffers, contacts, scheme, h, .. } = self;
        let Switching { start: Some([gaps, forces]), excess, rows, switches, .. } = &mut *buffers.switching else {
            return;
        };
        let half = T::of(0.5);
        for row in rows.drain(..) {
            let closes = contacts.lambda_raw[row] > T::zero();
            let (gap, all) = if closes { (gaps[row], &contacts.lambda_raw) } else { (contacts.gap[row], &*forces) };
            let force = all[row];
            contacts.dissipated[row] += if closes { half * gap * force } else { -half * gap * force };
            let most = [force - excess[row].force, excess[row].force].map(|force| T::of(*h * scheme.length) * force);
            switches.push(Switch::new(row, most, contacts.tangents.of(row).map(|tangent| all[tangent] / force)));
        }
    }

    /// Changes the velocities by the impulses of this step, so that the bodies get back what contact has taken.
    fn return_work(&mut self) -> Result<()> {
        if self.buffers.switching.switches.is_empty() {
            return Ok(());
        }
        self.read_rates()?;
        let mut switching = std::mem::replace(&mut *self.buffers.switching, Switching::new(0, None));
        let result = self.return_to(&mut switching);
        *self.buffers.switching = switching;
        result
    }

    fn return_to(&mut self, switching: &mut Switching<T>) -> Result<()> {
        let Switching { switches, change, momentum, .. } = switching;
        self.static_rates(change)?;
        for switch in &mut *switches {
            let taken = &mut self.contacts.dissipated[switch.row];
            let rate = self.g.product(switch.row, change) + self.buffers.rates[switch.row].rate;
            let impulse = *taken / rate;
            switch.impulse = if impulse.is_finite() { impulse.max(-switch.most).min(switch.least) } else { T::zero() };
            switch.returned = switch.impulse * rate;
            let tangents = self.contacts.tangents.of(switch.row);
            let along =
                switch.impulses(tangents).skip(1).map(|(tangent, impulse)| impulse * self.g.product(tangent, change));
            switch.by_friction = along.sum();
            // What a contact cannot give back stays with it.
            *taken -= switch.returned;
        }
        for gives in [true, false] {
            self.give(switches, gives, change, momentum)?;
        }
        Ok(())
    }

    /// Gives the bodies back what contacts have taken, or takes back what they have given, by one multiple of their
    /// impulses, for these act on each other.
    fn give(&mut self, switches: &[Switch<T>], gives: bool, change: &mut [T], momentum: &mut [T]) -> Result<()> {
        let group = || {
            let belongs = |returned: T| if gives { returned > T::zero() } else { returned < T::zero() };
            switches.iter().filter(move |switch| belongs(switch.returned))
        };
        if group().next().is_none() {
            return Ok(());
        }
        self.spread(group(), change)?;
        momentum.fill(T::zero());
        self.system.0.mass().add_product(T::one(), change, momentum);
        // Energies are those seen from the obstacles, whose own motion does work.
        let by_obstacles: T = group().map(|switch| switch.impulse * self.buffers.rates[switch.row].rate).sum();
        let first = dot(momentum, &self.new.v);
        let second = T::of(0.5) * dot(momentum, change);
        let all: T = group().map(|switch| switch.returned).sum();
        let by_friction: T = group().map(|switch| switch.by_friction).sum();
        let (part, left) = nearest([-all, first + by_obstacles - by_friction, second]);
        if part <= T::zero() {
            self.keep(group(), T::one());
            return Ok(());
        }
        let weight = T::of(self.scheme.covector[0][1]) * part;
        for switch in group() {
            for (row, impulse) in switch.impulses(self.contacts.tangents.of(switch.row)) {
                self.contacts.impulse[row] += weight * impulse;
            }
        }
        self.keep(group(), -left / all);
        *self.energy += part * (first + part * second);
        for x in change.iter_mut() {
            *x *= part;
        }
        T::axpy(T::one(), change, &mut self.new.v);
        self.damp_change(change)
    }

    /// Books a part of what some contacts were to return as still taken.
    fn keep<'s>(&mut self, switches: impl Iterator<Item = &'s Switch<T>>, part: T)
    where
        T: 's,
    {
        for switch in switches {
            self.contacts.dissipated[switch.row] += part * switch.returned;
        }
    }

    /// The velocities with which dofs without mass follow the others statically, as if no contact held them.
    fn static_rates(&mut self, rates: &mut [T]) -> Result<()> {
        let Self { block, operator, system, new, scheme, prescribed, h, .. } = self;
        if let Some(block) = block {
            return block.follow(&new.v, rates);
        }
        rates.fill(T::zero());
        system.0.mass().add_product(T::of(scheme.balance / (*h * *h)), &new.v, rates);
        for &dof in *prescribed {
            rates[dof] = T::zero();
        }
        operator.solve(rates)
    }

    /// The change of v that impulses of contacts on dofs without mass make of the dofs with mass.
    fn spread<'s>(&mut self, switches: impl Iterator<Item = &'s Switch<T>>, change: &mut [T]) -> Result<()>
    where
        T: 's,
    {
        let Self { g, block, operator, projection, contacts, scheme, massless, prescribed, h, .. } = self;
        change.fill(T::zero());
        for switch in switches {
            for (row, impulse) in switch.impulses(contacts.tangents.of(switch.row)) {
                g.scatter(row, impulse, change);
            }
        }
        for &dof in *prescribed {
            change[dof] = T::zero();
        }
        if let Some(block) = block {
            block.pass_on(change)?;
            projection.apply_inverse(change)?;
        } else {
            operator.solve(change)?;
            let scale = T::of(scheme.balance / (*h * *h));
            for x in change.iter_mut() {
                *x *= scale;
            }
        }
        for &dof in massless.iter().chain(*prescribed) {
            change[dof] = T::zero();
        }
        Ok(())
    }
}

/// The root of c₀ + c₁ x + c₂ x² that is nearer to zero, and what is left there: where there is none the vertex, and
/// zero where neither is a number.
fn nearest<T: Real>([zeroth, first, second]: [T; 3]) -> (T, T) {
    let discriminant = first * first - T::of(4.0) * second * zeroth;
    if discriminant < T::zero() {
        let x = -first / (second + second);
        return (x, zeroth + T::of(0.5) * first * x);
    }
    let root = discriminant.sqrt();
    let x = -(zeroth + zeroth) / (first + if first < T::zero() { -root } else { root });
    if x.is_finite() { (x, T::zero()) } else { (T::zero(), zeroth) }
}
