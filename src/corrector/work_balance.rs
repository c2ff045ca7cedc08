//! Returns the work that contacts without mass do in the step in which they close or open.

use super::correction::Bodies;
use super::switching::{Switch, Switching};
use super::{Correction, Corrector, Effects, Requirements};
use crate::analysis;
use crate::dense::dot;
use crate::error::Result;
use crate::real::Real;
use crate::tableau::Tableau;

/// Returns the work that contacts on dofs without mass do in the step in which they close or open.
///
/// Such contacts do no work while they stay closed or open. A scheme that changes velocities by the mean of two
/// accelerations, however, applies the mean of a contact force and zero over the whole step in which they close or
/// open. The conserved energy of the scheme changes by
///
/// ```text
/// ½ (λ + λ') (g' − g)  =  −½ g λ'  where the contact closes,   ½ g' λ  where it opens
/// ```
///
/// to rounding (theory, section 15.1). An impact takes the first amount and returns the second. The difference has
/// either sign and adds up over many impacts as a random walk. The impulse over the step was too large: the force of
/// a closing contact acts only in the last part of the step, the force of an opening contact only in the first.
/// Therefore
///
/// ```text
/// J = W/ġ within [−h λ, 0],      v' ← v' + α Σ J y
/// ```
///
/// with W the energy that the contact has taken from the bodies (½ g λ', or −½ g' λ), ġ the rate of its gap if its
/// dofs followed the others statically, and y the velocity change of the dofs with mass per unit impulse of the
/// contact. The contacts that return energy share one factor α near 1, and those taking it back another, chosen so
/// that the kinetic energy changes by Σ J ġ to rounding. If ġ is small or has the wrong sign, the contact keeps the
/// rest of W and returns it when it closes or opens again: [`dissipated`](crate::ContactState::dissipated) stores it,
/// positive if the bodies are to receive it. The impulses change the momentum and are booked as contact impulses:
/// [`impulses`](crate::ContactState::impulses) is the impulse exerted over a step,
/// [`forces`](crate::ContactState::forces) the force at its end. Friction on such contacts gets the same share of its
/// impulse.
///
/// Implicit steps of linear systems are solved again with the excess force of such contacts removed over the whole
/// step, until the energy error is a thousandth of the work (theory, section 15.2); the impulses above return the
/// remainder. This also works for frequencies that the step does not resolve.
///
/// Cost: none in steps in which no such contact closes or opens, two or three solves with the matrix of the stage in
/// others, and in implicit steps one to eight solves of the step with its contact problem.
///
/// Known failure: nonlinear systems get the impulses only. If many contacts open and close in every step by modes far
/// faster than the step (ω h ≫ 1), the impulses cannot return all of the work: energy and forces grow, though less
/// than without the correction. Choose a scheme that damps these modes, such as
/// [`GeneralizedAlpha`](crate::GeneralizedAlpha).
///
/// For the trapezoidal rule, Newmark's schemes with γ = ½ (central differences, including
/// [`CdLagrange`](crate::CdLagrange)) and [`Bathe`](crate::Bathe) with ρ∞ = 1; rows under
/// [`ContactLaw::Rigid`](crate::ContactLaw::Rigid). It is part of the default of these schemes if contact dofs have
/// no mass, and of the presets `conservative()` and `explicit()`.
///
/// ```
/// use contact_dynamics::corrector::WorkBalance;
/// use contact_dynamics::{Corrector, GeneralizedAlpha, Newmark, TimeIntegrator};
///
/// let balance: &dyn Corrector<f64> = &WorkBalance;
/// assert!(balance.requirements(&Newmark::trapezoidal().tableau()).scheme.is_ok());
/// assert!(balance.requirements(&GeneralizedAlpha::chung_hulbert(0.9)?.tableau()).scheme.is_err());
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WorkBalance;

impl<T: Real> Corrector<T> for WorkBalance {
    fn name(&self) -> String {
        "work balance".into()
    }

    fn requirements(&self, tableau: &Tableau) -> Requirements {
        let scheme = match analysis::steps_by_means(tableau) {
            true => Ok(()),
            false => Err("it needs a scheme that changes velocities by the mean of two accelerations in every stage"),
        };
        Requirements { scheme, friction: Ok(()), ..Requirements::default() }
    }

    fn effects(&self) -> Effects {
        Effects { corrects_massless: true, ..Effects::default() }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        step.book_switches();
        match step.scheme.stage + 1 == step.scheme.stages {
            true => step.return_work(),
            false => Ok(()),
        }
    }
}

impl<T: Real> Correction<'_, T> {
    /// Books the work of contacts that have closed or opened in this stage, and bounds the excess of their impulses.
    fn book_switches(&mut self) {
        let Self { buffers, contacts, scheme, .. } = self;
        let Switching { start: Some([gaps, forces]), excess, rows, switches, .. } = &mut *buffers.switching else {
            return;
        };
        let half = T::of(0.5);
        for row in rows.drain(..) {
            let closes = contacts.lambda_raw[row] > T::zero();
            let (gap, all) = if closes { (gaps[row], &contacts.lambda_raw) } else { (contacts.gap[row], &*forces) };
            let force = all[row];
            contacts.dissipated[row] += if closes { half * gap * force } else { -half * gap * force };
            let most =
                [force - excess[row].force, excess[row].force].map(|force| T::of(scheme.h * scheme.length) * force);
            switches.push(Switch::new(row, most, contacts.tangents.of(row).map(|tangent| all[tangent] / force)));
        }
    }

    /// Changes the velocities by the impulses of this step that return the work taken by contact.
    fn return_work(&mut self) -> Result<()> {
        if self.buffers.switching.switches.is_empty() {
            return Ok(());
        }
        self.read_rates()?;
        let mut switching = std::mem::replace(&mut *self.buffers.switching, Switching::new(None));
        let result = self.return_by_impulses(&mut switching);
        *self.buffers.switching = switching;
        result
    }

    fn return_by_impulses(&mut self, switching: &mut Switching<T>) -> Result<()> {
        let Switching { switches, change, momentum, .. } = switching;
        self.static_rates(change)?;
        for switch in &mut *switches {
            let taken = &mut self.contacts.dissipated[switch.row];
            let rate = self.g.product(switch.row, change) + self.buffers.readings.rates[switch.row].rate;
            let impulse = *taken / rate;
            switch.impulse = if impulse.is_finite() { impulse.max(-switch.most).min(switch.least) } else { T::zero() };
            switch.returned = switch.impulse * rate;
            let tangents = self.contacts.tangents.of(switch.row);
            let along =
                switch.impulses(tangents).skip(1).map(|(tangent, impulse)| impulse * self.g.product(tangent, change));
            switch.by_friction = along.sum();
            // A contact keeps the energy that it cannot return.
            *taken -= switch.returned;
        }
        for gives in [true, false] {
            self.apply_returns(switches, gives, change, momentum)?;
        }
        Ok(())
    }

    /// Applies the impulses of the contacts that return energy, or of those taking it back, all scaled by one
    /// factor because the contacts act on each other.
    fn apply_returns(
        &mut self,
        switches: &[Switch<T>],
        gives: bool,
        change: &mut [T],
        momentum: &mut [T],
    ) -> Result<()> {
        let group = || {
            let belongs = |returned: T| if gives { returned > T::zero() } else { returned < T::zero() };
            switches.iter().filter(move |switch| belongs(switch.returned))
        };
        if group().next().is_none() {
            return Ok(());
        }
        self.respond(group(), change)?;
        momentum.fill(T::zero());
        self.bodies.system.0.mass().add_product(T::one(), change, momentum);
        // Energies are relative to the obstacles, whose own motion does work.
        let by_obstacles: T = group().map(|switch| switch.impulse * self.buffers.readings.rates[switch.row].rate).sum();
        let first = dot(momentum, &self.new.v);
        let second = T::of(0.5) * dot(momentum, change);
        let all: T = group().map(|switch| switch.returned).sum();
        let by_friction: T = group().map(|switch| switch.by_friction).sum();
        let (part, left) = nearest([-all, first + by_obstacles - by_friction, second]);
        if part <= T::zero() {
            self.book_unreturned(group(), T::one());
            return Ok(());
        }
        let weight = T::of(self.scheme.covector[0][1]) * part;
        for switch in group() {
            for (row, impulse) in switch.impulses(self.contacts.tangents.of(switch.row)) {
                self.contacts.impulse[row] += weight * impulse;
            }
        }
        self.book_unreturned(group(), -left / all);
        *self.energy += part * (first + part * second);
        for x in change.iter_mut() {
            *x *= part;
        }
        T::axpy(T::one(), change, &mut self.new.v);
        self.damp_change(change)
    }

    /// Books a fraction of the planned returns as still taken.
    fn book_unreturned<'s>(&mut self, switches: impl Iterator<Item = &'s Switch<T>>, part: T)
    where
        T: 's,
    {
        for switch in switches {
            self.contacts.dissipated[switch.row] += part * switch.returned;
        }
    }

    /// The velocities if dofs without mass follow the others statically and no contact holds them.
    fn static_rates(&mut self, rates: &mut [T]) -> Result<()> {
        let Self { bodies: Bodies { block, operator, system, prescribed, .. }, new, scheme, .. } = self;
        if let Some(block) = block {
            return block.follow(&new.v, rates);
        }
        rates.fill(T::zero());
        system.0.mass().add_product(T::of(scheme.balance / (scheme.h * scheme.h)), &new.v, rates);
        for &dof in *prescribed {
            rates[dof] = T::zero();
        }
        operator.solve(rates)
    }

    /// The velocity change of the dofs with mass by impulses of contacts on dofs without mass.
    fn respond<'s>(&mut self, switches: impl Iterator<Item = &'s Switch<T>>, change: &mut [T]) -> Result<()>
    where
        T: 's,
    {
        let Self { g, projection, contacts, scheme, bodies, .. } = self;
        let Bodies { block, operator, massless, prescribed, .. } = bodies;
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
            let scale = T::of(scheme.balance / (scheme.h * scheme.h));
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

/// The root of c₀ + c₁ x + c₂ x² nearer to zero, and the residual there. Without a real root the vertex; zero if the
/// root is not finite.
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
