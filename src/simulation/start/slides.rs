//! Contacts with friction that slide at the start.

use crate::contact::{ContactJacobian, GapRates, Tangents};
use crate::real::Real;
use crate::rounding::rounding;
use crate::state::Motion;

/// A contact with friction that slides at the start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slide<T> {
    pub(super) contact: usize,
    /// The direction of its friction: against the slip.
    direction: [T; 2],
    speed: T,
    /// Whether its friction would reverse the slip within the first step. Coulomb's law then holds for the slip at
    /// the end of the step: the force stops the slip, if the bound allows it.
    pub(super) stops: bool,
}

impl<T: Real> Slide<T> {
    /// The contacts that slide; `rates` are the rates of all rows that do not come from velocities.
    pub(super) fn find(
        tangents: &Tangents,
        g: &ContactJacobian<T>,
        rates: &[GapRates<T>],
        motion: &Motion<T>,
    ) -> Vec<Self> {
        let mut sliding = Vec::new();
        for contact in tangents.contacts() {
            let (mut slip, mut noise) = ([T::zero(); 2], T::zero());
            for (slip, k) in slip.iter_mut().zip(tangents.of(contact)) {
                *slip = g.product(k, &motion.v) + rates[k].rate;
                noise = noise.max(rounding(g.magnitude(k, &motion.v) + rates[k].rate.abs()));
            }
            let speed = slip[0].hypot(slip[1]);
            if speed > noise {
                sliding.push(Self { contact, direction: slip.map(|slip| -slip / speed), speed, stops: false });
            }
        }
        sliding
    }

    /// The friction over the normal force, if it is at its bound.
    pub(super) fn friction(&self, tangents: &Tangents) -> Option<[T; 2]> {
        (!self.stops).then(|| self.direction.map(|f| T::of(tangents.friction(self.contact)) * f))
    }

    /// The slip velocity over the step size, if the slip is to be stopped.
    pub(super) fn to_stop(self, h: f64) -> [T; 2] {
        self.direction.map(|f| if self.stops { -self.speed / T::of(h) * f } else { T::zero() })
    }

    /// Marks the slide if accelerations along its tangential rows would reverse it by the end of a step h. Returns
    /// whether the mark is new.
    pub(super) fn stop_in_time(
        &mut self,
        tangents: &Tangents,
        h: f64,
        acceleration: impl Fn(usize) -> Option<T>,
    ) -> bool {
        if self.stops {
            return false;
        }
        let along = tangents.of(self.contact).zip(self.direction).map(|(k, f)| Some(acceleration(k)? * f));
        self.stops = along.sum::<Option<T>>().is_some_and(|slower| T::of(h) * slower > self.speed);
        self.stops
    }
}
