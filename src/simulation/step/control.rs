//! Step-size control: refused steps are repeated with halves of the step, which grow back to the nominal one.

use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::TIME_SHARE;
use crate::simulation::operator::tangent::At;
use crate::simulation::run::Simulation;
use crate::simulation::step::judge::Verdict;
use crate::state::{History, Refusal, State};

impl<T: Real> Simulation<'_, T> {
    /// Takes one step, and halves the step size as long as steps are refused.
    pub(crate) fn controlled_step(&mut self) -> Result<()> {
        let mut before: Option<(State<T>, History<T>)> = None;
        let mut refusals = 0;
        let result = loop {
            let h = self.history.clock.h;
            let smaller = 0.5 * h;
            let Some(judge) = &mut self.monitors.judge else { break self.attempt().map(drop) };
            let last = smaller < judge.control.smallest * (1.0 - TIME_SHARE);
            judge.suspended = last;
            judge.begin(&self.state, self.history.pace.lasting);
            match self.attempt() {
                Ok(Verdict::Accepted) => break Ok(()),
                Err(error) if !error.is_recoverable() => break Err(error),
                Err(source) if last => {
                    self.statistics.refused_steps += 1;
                    let (t, attempts) = (self.time(), refusals + 1);
                    break Err(Error::StepRefused { t, h, attempts, source: Box::new(source) });
                }
                verdict @ (Ok(Verdict::Coarse) | Err(_)) => {
                    let refusal = match verdict {
                        Err(Error::Stiffened { contact: Some(_), .. }) => Refusal::StiffContact,
                        Err(Error::Stiffened { contact: None, .. }) => Refusal::StiffSystem,
                        _ => Refusal::Temporary,
                    };
                    self.statistics.refused_steps += 1;
                    refusals += 1;
                    before.get_or_insert_with(|| (self.state.clone(), self.history.clone()));
                    if let Err(error) = self.change_step_size(smaller) {
                        break Err(error);
                    }
                    self.history.pace.halve(refusal);
                }
            }
        };
        match (result, before) {
            (Ok(()), _) => {
                self.grow();
                Ok(())
            }
            (Err(error), None) => Err(error),
            (Err(error), Some((state, history))) => {
                let h = history.clock.h;
                (self.state, self.history) = (state, history);
                if self.history.known == self.scheme.depth {
                    self.compiled.startup = None;
                }
                let Self { parts, compiled, scheme, state, .. } = self;
                let at = At::state(&state.motion);
                let compiled = compiled.set_step_size(scheme, &mut *parts.system, h, at);
                self.parts.together.finish(compiled)?;
                Err(error)
            }
        }
    }

    /// Counts a good step, and doubles the step size if the nominal grid and the judgment allow it.
    fn grow(&mut self) {
        let Self { monitors, constraints, state, statistics, history, .. } = self;
        let Some(judge) = &mut monitors.judge else { return };
        statistics.coarse_steps += u64::from(judge.coarse);
        history.pace.note_change(judge.changed, history.clock.h);
        let may_grow = judge.may_grow() && !judge.coarse;
        let presses = || {
            let mut rows = constraints.rows_of(&state.contacts);
            rows.any(|(contact, row)| constraints.law(row).is_spring() && state.contacts.closed[contact])
        };
        if history.pace.advance(presses) && may_grow {
            // If the matrix of the larger step cannot be factorized, the run continues with the smaller one.
            let larger = 2.0 * self.history.clock.h;
            if self.change_step_size(larger).is_ok() {
                self.history.pace.double();
            }
        }
    }

    /// The estimate of the local error of the last step (length), for runs that
    /// [control it](crate::StepControl::local_error).
    pub fn local_error(&self) -> Option<f64> {
        self.monitors.judge.as_ref().filter(|judge| judge.local.is_some()).map(|judge| judge.estimate)
    }
}
