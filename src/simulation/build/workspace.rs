//! Memory of the steps: nothing in it changes a result. Lists of contacts grow in steps that have more of them than
//! ever before.

use crate::contact::ContactJacobian;
use crate::corrector::{Backup, Buffers, Corrector, Edits, Effects, JumpProjection};
use crate::error::Result;
use crate::ranks::Together;
use crate::real::Real;
use crate::simulation::build::program::Program;
use crate::simulation::operator::interface::InterfaceWork;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::contact_rows::ContactRowsWork;
use crate::simulation::run::impulses::Impulses;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::excess_forces::ExcessForces;
use crate::simulation::stage::massless::{MasslessBlock, is_damped};
use crate::simulation::stage::newton::NewtonWork;
use crate::simulation::stage::supports::Supports;
use crate::simulation::stage::vectors::StageVectors;
use crate::simulation::start::rate_check::RateCheck;
use crate::simulation::watch::stiffening::Stiffening;
use crate::state::{ContactState, Motion, Tape};
use crate::system::{Linearity, System};

/// Memory of a step.
pub(crate) struct Workspace<T: Real> {
    pub(crate) vectors: StageVectors<T>,
    pub(crate) contact: ContactWork<T>,
    /// For nonlinear systems.
    pub(crate) newton: Option<Box<NewtonWork<T>>>,
    /// Free dofs without mass.
    pub(crate) massless: Vec<usize>,
    /// For explicit schemes, if there are dofs without mass.
    pub(crate) block: Option<MasslessBlock<T>>,
    /// For implicit schemes, if the work of contacts on dofs without mass is balanced.
    pub(crate) excess: Option<Box<ExcessForces<T>>>,
    pub(crate) correction: CorrectionWork<T>,
    pub(crate) rate_check: RateCheck<T>,
    /// For schemes with a stability limit that may be reached in the run.
    pub(crate) stiffening: Option<Stiffening<T>>,
    /// The largest number of rows so far.
    pub(crate) rows: usize,
    /// v and a at the time of the new state, if the scheme stores them at another time.
    pub(crate) rates: [Vec<T>; 2],
    pub(crate) backup: Backup<T>,
    /// If the run is recorded.
    pub(crate) tape: Option<Box<Tape<T>>>,
}

/// Memory of the corrections.
pub(crate) struct CorrectionWork<T: Real> {
    pub(crate) buffers: Buffers<T>,
    pub(crate) projection: Option<JumpProjection<T>>,
    /// Version of the rows for which the projection was made.
    pub(crate) projected_rows: u64,
    /// Change of kinetic energy by corrections in this step.
    pub(crate) energy: T,
}

impl<T: Real> Workspace<T> {
    /// Memory for the steps of a program, with a history of `slots` motions.
    pub(crate) fn new(
        system: &mut dyn System<T>,
        program: &Program<T>,
        correctors: &[Box<dyn Corrector<T> + '_>],
        projection: JumpProjection<T>,
        (constraints, g): (&Constraints<'_, T>, &ContactJacobian<T>),
        slots: usize,
    ) -> Self {
        let dofs = system.dofs();
        let (rows, may_press) = (g.rows(), constraints.may_press());
        let damped = if system.damping_force().is_some() && !correctors.is_empty() { dofs } else { 0 };
        let effects = Effects::of_all(correctors);
        let balances = may_press && effects.corrects_massless;
        let room = |needed: bool| if needed && may_press { dofs } else { 0 };
        let mut targets = program.stages.iter().filter_map(|stage| stage.contact.as_ref());
        let (aimed, forecast) = (targets.clone().count() > 0, targets.any(|target| target.forecast.is_some()));
        let separate_balance = program.stages.iter().any(|stage| stage.balance.is_some());
        let supports = Supports::of(system);
        let mut contact_rows = ContactRowsWork::new(rows, room(aimed), room(forecast), supports.dofs.len());
        contact_rows.slips.by_displacement = effects.leaves_smooth_motion;
        Self {
            contact: ContactWork {
                interface: InterfaceWork::new(constraints.interface().len()),
                rows: contact_rows,
                trial: ContactState::default(),
                impulses: Impulses::new(room(true)),
                closed_at_start: Vec::new(),
                exerting_at_start: Vec::new(),
                forces_at_start: Vec::new(),
                sliding_at_start: Vec::new(),
                was_closed: Vec::new(),
                was_sticking: Vec::new(),
            },
            vectors: StageVectors {
                increment: vec![T::zero(); dofs],
                balance: separate_balance.then(|| Motion::zero(dofs)),
                supports,
                iterate: Vec::new(),
            },
            newton: None,
            massless: Vec::new(),
            block: None,
            excess: None,
            correction: CorrectionWork {
                buffers: Buffers::new(rows, [damped, room(effects.predicts)], balances.then_some(dofs)),
                projection: (may_press && !correctors.is_empty()).then_some(projection),
                projected_rows: 0,
                energy: T::zero(),
            },
            rate_check: RateCheck::new(rows),
            stiffening: None,
            rows,
            rates: [Vec::new(), Vec::new()],
            backup: Backup::new(if effects.edits == Edits::Past { slots - 1 } else { 0 }, dofs),
            tape: None,
        }
    }

    /// Stores the free dofs without mass, and the data for them: `follower` is the name of the scheme if they follow
    /// statically before the others move.
    pub(crate) fn keep_massless(
        &mut self,
        massless: Vec<usize>,
        (system, together): (&mut dyn System<T>, &Together<T>),
        (program, follower): (&Program<T>, Option<String>),
        at: &Motion<T>,
        interface: &[usize],
    ) -> Result<()> {
        if let Some(name) = follower {
            self.block = Some(MasslessBlock::new(system, &name, &massless, at, interface)?);
        } else if self.correction.buffers.switching.is_on() && self.correction.buffers.shifted.is_empty() {
            self.excess = ExcessForces::new(system, program, &massless, at, interface)?;
        }
        let buffers = &mut self.correction.buffers;
        if buffers.spreads() && !(massless.is_empty() && together.is_alone()) {
            let damps = match system.linearity() {
                Linearity::Linear => is_damped(system, &massless),
                // Nonlinear forces may damp them later.
                Linearity::Nonlinear => Ok(!massless.is_empty()),
            };
            let [damps] = together.max(damps.map(|damps| [f64::from(u8::from(damps))]))?;
            buffers.damping.on_massless = damps > 0.0;
        }
        self.contact.rows.massless.dofs.clone_from(&massless);
        self.massless = massless;
        Ok(())
    }

    /// Lists with an entry for each of so many rows.
    pub(crate) fn resize(&mut self, rows: usize) {
        self.rows = rows;
        self.contact.rows.resize(rows);
        self.correction.buffers.resize(rows);
        self.rate_check.resize(rows);
    }
}
