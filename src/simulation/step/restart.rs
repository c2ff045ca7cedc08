//! Restarts after a discontinuity that the host knows.

use crate::corrector::Corrector;
use crate::error::Result;
use crate::real::Real;
use crate::simulation::run::{Parts, Simulation};
use crate::simulation::start::{self, Begun, Origin, Start};
use crate::state::Motion;

impl<T: Real> Simulation<'_, T> {
    /// Starts again from the displacements and velocities of the present state, after a discontinuity known to the
    /// host (a load or a support that jumps): dofs without mass are brought into static balance, accelerations are
    /// computed from the balance after it, contacts at rest are found again, and the past is computed as at the start.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearSystem, Simulation};
    ///
    /// // A mass under a force that is switched on at t = 1.
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
    /// let system = LinearSystem::lumped(vec![1.0], k)?.load(|t, f| f[0] = if t < 1.0 - 1e-9 { 0.0 } else { 3.0 });
    /// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 0.1).build()?;
    /// run.land_on(1.0 - 1e-8, &mut ())?; // before the jump
    /// run.land_on(1.0, &mut ())?; // over it
    /// run.restart()?; // and begin again behind it
    /// assert!((run.state().acceleration()[0] - 3.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Errors of building a simulation from this state. The simulation is then as it was.
    pub fn restart(&mut self) -> Result<()> {
        self.guarded(|run| {
            let result = run.begin_anew();
            run.parts.together.finish(result)
        })
    }

    fn begin_anew(&mut self) -> Result<()> {
        let (h, t) = (self.history.clock.h, self.time());
        let Self { parts, constraints, g, scheme, state, work, .. } = self;
        let Parts { system, contact_solver, correctors, linear_solver, together } = parts;
        let (u, v) = (state.displacement().to_vec(), state.velocity().to_vec());
        let mut projection = start::projection(&**system, constraints, (together, &**linear_solver))?;
        let start = Start {
            system: &mut **system,
            contact_solver: &mut **contact_solver,
            constraints,
            g,
            projection: &mut projection,
            scheme,
            together,
            h,
            massless: &work.massless,
            origin: Origin::Restart,
            is_smooth: correctors.iter().any(|corrector| corrector.effects().leaves_smooth_motion),
        };
        let started = start.begin(Motion { t, a: vec![T::zero(); u.len()], u, v });
        if started.is_err() {
            // The rows belong to the state again.
            constraints.search(&state.motion, scheme.ahead() * h, g).ok();
        }
        let Begun { state: mut begun, history: mut past, .. } = started?;
        let is_known = past.known == scheme.depth;
        let starter = (!is_known && self.compiled.startup.is_none())
            .then(|| self.compiled_starter(h, &begun.motion))
            .transpose()?;
        if let Some(ledger) = &mut self.monitors.ledger {
            ledger.restart(&mut *self.parts.system, &begun, (&self.constraints, &self.g))?;
        }
        if let Some(starter) = starter {
            self.statistics.factorizations += starter.operators.len() as u64;
            self.compiled.startup = Some(starter);
        } else if is_known {
            self.compiled.startup = None;
        }
        begun.broken = std::mem::take(&mut self.state.broken);
        (past.pace, past.clock) = (self.history.pace, self.history.clock);
        (self.state, self.history) = (begun, past);
        if let Some(tape) = &mut self.work.tape {
            tape.refuse("a restart", "its accelerations follow from the balance, which the tape does not have");
        }
        Ok(())
    }
}
