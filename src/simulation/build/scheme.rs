//! The scheme of a run, and quantities derived from its rows besides the compiled program.

use crate::integrator::TimeIntegrator;
use crate::real::Real;
use crate::simulation::build::derived::Derived;
use crate::state::Motion;
use crate::tableau::{StartUp, Tableau};
use std::sync::Arc;

/// Number of dofs per block: the values of a block are still in the first-level cache when they are checked.
const BLOCK: usize = 1024;

/// An integrator, its tableau, and the numbers derived from it once.
#[derive(Debug)]
pub(crate) struct Scheme<'a> {
    pub(crate) integrator: Box<dyn TimeIntegrator + 'a>,
    pub(crate) tableau: Tableau,
    /// Number of states a step reads, the current one included.
    pub(crate) depth: usize,
    /// Times of the stored v and a relative to the time of the state, in steps.
    pub(crate) shifts: [f64; 2],
    pub(crate) start_up: StartUp,
    pub(crate) derived: Arc<Derived>,
}

impl<'a> Scheme<'a> {
    /// Derives everything from a tableau that was checked.
    pub(crate) fn new(integrator: Box<dyn TimeIntegrator + 'a>, tableau: Tableau, start_up: StartUp) -> Self {
        let derived = Derived::of(&tableau);
        let shifts = [derived.order.velocity_shift, derived.order.acceleration_shift];
        let depth = tableau.depth();
        Self { integrator, tableau, depth, shifts, start_up, derived }
    }

    /// Number of motions in a history: the states that are read, and one for each stage to write. If v and a are
    /// stored at another time, a change of the step size reads the state before the present one, though the steps of
    /// a one-step scheme do not: an undone step must not have written there.
    pub(crate) fn slots(&self) -> usize {
        let is_shifted = self.shifts.iter().any(|shift| shift.abs() > 0.0);
        self.depth.max(if is_shifted { 2 } else { 1 }) + self.tableau.stages.len()
    }

    /// How far ahead of the state a step imposes contact, in steps.
    pub(crate) fn ahead(&self) -> f64 {
        self.tableau.stages.iter().map(|stage| stage.end + stage.contact.lead()).fold(1.0, f64::max)
    }

    /// ψ of the known states over h, one entry a dof: times M it is the momentum that the scheme conserves. `past`
    /// holds the states before the newest, in the spacing h.
    pub(crate) fn momentum<T: Real>(&self, newest: &Motion<T>, past: &[Motion<T>], h: f64) -> Vec<T> {
        let mut sum = vec![T::zero(); newest.u.len()];
        let known = past.len().min(self.depth - 1);
        for (psi, motion) in self.derived.covectors[known].iter().zip(std::iter::once(newest).chain(past)) {
            // Displacements enter with weights that sum to zero: differences keep their digits.
            T::axpy_difference(T::of(psi[0] / h), &motion.u, &newest.u, &mut sum);
            T::axpy(T::of(psi[1]), &motion.v, &mut sum);
            T::axpy(T::of(psi[2] * h), &motion.a, &mut sum);
        }
        sum
    }

    /// Memory for v and a at the time of a state: empty if they are stored at that time.
    pub(crate) fn rates<T: Real>(&self, motion: &Motion<T>) -> [Vec<T>; 2] {
        let of = |field: usize| if self.shifts[field - 1] == 0.0 { Vec::new() } else { motion.field(field).to_vec() };
        [of(1), of(2)]
    }

    /// Extrapolates stored v and a to the time of the state; without a `past` state they are copied. Prescribed
    /// motions are given at the time of the state. Returns whether all extrapolated values are finite.
    pub(crate) fn extrapolate_rates<T: Real>(
        &self,
        new: &Motion<T>,
        past: Option<&Motion<T>>,
        prescribed: &[usize],
        rates: &mut [Vec<T>; 2],
    ) -> bool {
        let mut finite = true;
        for (field, (shift, rate)) in (1..).zip(self.shifts.into_iter().zip(rates)) {
            if shift != 0.0 {
                let now = new.field(field);
                match past {
                    None => rate.copy_from_slice(now),
                    Some(past) => {
                        let blocks = now.chunks(BLOCK).zip(past.field(field).chunks(BLOCK));
                        for ((now, past), rate) in blocks.zip(rate.chunks_mut(BLOCK)) {
                            T::combine(&[(T::one(), now)], &[(T::of(shift), past)], now, rate);
                            finite &= T::all_finite(rate);
                        }
                    }
                }
                for &dof in prescribed {
                    rate[dof] = new.field(field)[dof];
                }
            }
        }
        finite
    }
}
