//! The algebra of time-integration rows: a scheme is a table of affine rows from which all else is derived.
//!
//! With z the unknown of a stage and past states k = 0 (newest), 1, 2 …, a [`Row`] is
//!
//! ```math
//! \text{row} = w z + \sum_k \left( c_u U_k + c_v V_k + c_a A_k \right), \qquad
//! U_k = u_k, \quad V_k = h v_k, \quad A_k = h^2 a_k
//! ```
//!
//! Three recovery rows give u, h v, h² a of the new state; three balance rows give ū, h v̄, h² ā at which
//! `M ā = f(t_n + load h, ū, v̄) + Gᵀ λ` holds. Coefficients are pure numbers; h never appears in them.

#[cfg(feature = "serde")]
mod fingerprint;
mod momentum;
mod row;
mod stage;

pub use momentum::Momentum;
pub(crate) use momentum::impulse_weight;
pub use row::{A, MAX_PAST, Row, Rows, U, V, Z};
pub use stage::{ContactLevel, Stage, StageForce};

use crate::error::{Error, Result};
use crate::rounding::rounding;

/// How the past states of a multistep scheme are initialized.
///
/// In free flight (no acceleration) the straight line is exact, and both forms use it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum StartUp {
    /// The first steps are trapezoidal until the past is known: no overshoot of stiff modes, one more factorization.
    #[default]
    Trapezoidal,
    /// The past is the Taylor expansion at the start, u₀ − k h v₀ + ½ (k h)² a₀, v₀ − k h a₀, a₀: contact and
    /// corrections use the scheme's own rows from the first step; a stiff mode that starts out of equilibrium
    /// overshoots.
    Taylor,
}

/// A time-integration scheme as data: its stages.
///
/// u of the last stage is the displacement at the end of the step. Stored v and a may belong to another time, like
/// the accelerations of generalized-α: [`analysis::order`](crate::analysis::order) computes it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tableau {
    /// Stages in the order in which they are solved.
    pub stages: Vec<Stage>,
}

impl Tableau {
    /// A single-stage scheme.
    pub fn single(stage: Stage) -> Self {
        Self::staged(vec![stage])
    }

    /// A scheme of several stages. After a stage its state is past state 0 for the next one; after the last stage the
    /// intermediate states are dropped.
    pub fn staged(stages: Vec<Stage>) -> Self {
        Self { stages }
    }

    /// Rejects tableaux that define no step.
    ///
    /// # Errors
    ///
    /// [`Error::Tableau`] names the stage and the defect: no stage, a coefficient (or one computed from it) that is
    /// not finite, an acceleration row without the unknown, contact imposed before the stage's state, a contact
    /// forecast that reads the unknown, or a last stage that does not end at the end of the step.
    pub fn check(&self, integrator: &str) -> Result<()> {
        let refuse = |stage, reason| Err(Error::Tableau { integrator: integrator.to_owned(), stage, reason });
        for (s, stage) in self.stages.iter().enumerate() {
            let lead = stage.contact.lead();
            let numbers = [stage.load, stage.end, lead];
            if !stage.rows().iter().all(Row::is_finite) || !numbers.iter().all(|x| x.is_finite()) {
                return refuse(s, "a coefficient is not finite");
            }
            if lead < 0.0 {
                return refuse(s, "contact cannot be imposed before the stage's state");
            }
            if let ContactLevel::Velocity { forecast, forecast_at, .. } = stage.contact
                && (forecast.z != 0.0 || !forecast_at.is_finite())
            {
                return refuse(s, "the forecast of contact must be known before the stage is solved");
            }
            if stage.recovery.a.z == 0.0 || stage.balance.a.z == 0.0 {
                return refuse(s, "the acceleration rows must contain the unknown");
            }
            // Steps use rows over the increment of the unknown, and the time at which contact is imposed.
            let increment = stage.increment();
            if !increment.rows().iter().all(Row::is_finite) || !increment.contact_row().is_finite() {
                return refuse(s, "a coefficient that follows from its rows is not finite");
            }
        }
        match self.stages.last() {
            None => refuse(0, "there is no stage"),
            Some(last) if (last.end - 1.0).abs() > rounding(1.0) => {
                refuse(self.stages.len() - 1, "the last stage must end at the end of the step")
            }
            Some(_) => Ok(()),
        }
    }

    /// Number of states, including the current one, that a step reads at its start (at least 1).
    pub fn depth(&self) -> usize {
        let read =
            |(s, stage): (usize, &Stage)| stage.rows().iter().map(Row::depth).max().unwrap_or(0).saturating_sub(s);
        self.stages.iter().enumerate().map(read).max().unwrap_or(0).max(1)
    }

    /// Entries of the past that are still read after stage `s`: `[k][field]`, k = 0 the state of that stage.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if there is no such stage.
    pub fn read_after(&self, s: usize) -> Result<Vec<[bool; 3]>> {
        match s < self.stages.len() {
            true => Ok(self.reads_after(s)),
            false => Err(no_stage(s)),
        }
    }

    /// [`read_after`](Self::read_after) for an existing stage.
    pub(crate) fn reads_after(&self, s: usize) -> Vec<[bool; 3]> {
        let (stages, depth) = (self.stages.len(), self.depth());
        let mut read = vec![[false; 3]; depth + stages];
        // In increment form: cancelling terms are not read.
        let mut mark = |stage: &Stage, entry: &dyn Fn(usize) -> Option<usize>| {
            let stage = stage.increment();
            for row in stage.rows() {
                for k in 0..MAX_PAST {
                    let Some(place) = entry(k) else { continue };
                    for (field, c) in row.past(k).into_iter().enumerate() {
                        if let Some(state) = read.get_mut(place).filter(|_| c != 0.0) {
                            state[field] = true;
                        }
                    }
                }
            }
        };
        for (later, stage) in self.stages.iter().enumerate().skip(s + 1) {
            mark(stage, &|k| k.checked_sub(later - s - 1));
        }
        for (next, stage) in self.stages.iter().enumerate() {
            // State k of stage `next` of the next step: its own stages first, then the newest state, then the past of
            // t_n, which after stage s follows the s + 1 states of this step.
            let place = |k: usize| match k.checked_sub(next) {
                None => None,
                Some(0) => (s + 1 == stages).then_some(0),
                Some(steps) => Some(s + steps),
            };
            mark(stage, &place);
        }
        read
    }

    /// The map of one stage for the scalar test equation `inertia a + damping v + stiffness u = 0` with the weights
    /// [stiffness, damping, inertia] in units of the step (Ω², 2 ξ Ω, 1): new (U, V, A) from the past, row by row
    /// over `width` past states.
    pub(crate) fn stage_map(stage: &Stage, weights: [f64; 3], width: usize) -> [Vec<f64>; 3] {
        let [stiffness, damping, inertia] = weights;
        let stage = stage.increment();
        let combine = |row: Row| -> Vec<f64> {
            (0..width).flat_map(|k| if k < MAX_PAST { row.past(k) } else { [0.0; 3] }).collect()
        };
        let [bu, bv, ba] = stage.balance.each();
        let effective = inertia * ba.z + damping * bv.z + stiffness * bu.z;
        let (cu, cv, ca) = (combine(bu), combine(bv), combine(ba));
        let d: Vec<f64> =
            (0..3 * width).map(|i| -(inertia * ca[i] + damping * cv[i] + stiffness * cu[i]) / effective).collect();
        stage.recovery.each().map(|row| combine(row).iter().zip(&d).map(|(c, d)| c + row.z * d).collect())
    }

    /// The amplification matrix of one step for the scalar test equation, row-major, over the past states of the
    /// step: (U, V, A) of the newest state, then of the earlier ones. The weights are the same as for
    /// [`stage_map`](Self::stage_map).
    pub(crate) fn step_map(&self, weights: [f64; 3]) -> Vec<Vec<f64>> {
        let (depth, stages) = (self.depth(), self.stages.len());
        let size = 3 * depth;
        // Rows of the extended past as functions of the past at the start of the step, newest first.
        let mut past: Vec<Vec<f64>> =
            (0..size).map(|i| (0..size).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        for stage in &self.stages {
            let width = past.len() / 3;
            let map = Self::stage_map(stage, weights, width);
            let new = map.map(|row| {
                let mut sum = vec![0.0; size];
                for (c, old) in row.iter().zip(&past) {
                    sum.iter_mut().zip(old).for_each(|(s, o)| *s += c * o);
                }
                sum
            });
            past.splice(0..0, new);
        }
        // A step without stages has no intermediate states to drop.
        past.drain(3..3 * stages.max(1));
        past.truncate(size);
        past
    }
}

fn no_stage(s: usize) -> Error {
    Error::Parameter { name: "the index of a stage", value: s as f64, range: "below the number of stages" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn malformed_tableaux_are_refused() {
        let good = Stage::new(Rows { u: Z, v: Z - U[0], a: Z - U[0] - V[0] });
        assert!(Tableau::single(good).check("good").is_ok());
        let mut bad = good;
        bad.recovery.v.z = f64::NAN;
        assert!(Tableau::single(bad).check("bad").is_err());
        let mut bad = good;
        bad.recovery.a.z = 0.0;
        assert!(Tableau::single(bad).check("bad").is_err());
        assert!(Tableau::staged(vec![]).check("bad").is_err());
        assert!(Tableau::single(good.ending_at(0.5)).check("bad").is_err());
        let with = |contact| Tableau::single(good.with_contact(contact)).check("contact");
        assert!(with(ContactLevel::Position { lead: 1.0 }).is_ok());
        assert!(with(ContactLevel::Position { lead: -0.5 }).is_err());
        assert!(with(ContactLevel::Position { lead: f64::NAN }).is_err());
        let forecast = |forecast, forecast_at| with(ContactLevel::Velocity { lead: 0.0, forecast, forecast_at });
        assert!(forecast(U[0] + 0.5 * V[0], 0.5).is_ok());
        assert!(forecast(Z, 1.0).is_err() && forecast(U[0], f64::INFINITY).is_err());
    }
}
