//! Memory of the steps: nothing in it changes a result, and nothing is allocated after it but for more
//! contacts than there have ever been.

use super::constraints::Constraints;
use super::contact_rows::ContactRowsWork;
use super::contact_step::ContactWork;
use super::excess_forces::ExcessForces;
use super::impulses::Impulses;
use super::interface::InterfaceWork;
use super::massless::{MasslessBlock, is_damped};
use super::mixing::Mixing;
use super::newton::NewtonWork;
use super::program::Program;
use super::rate_check::RateCheck;
use super::stage_vectors::StageVectors;
use super::stiffening::Stiffening;
use super::supports::Supports;
use crate::contact::ContactJacobian;
use crate::corrector::{Backup, Buffers, Corrector, Edits, JumpProjection};
use crate::error::Result;
use crate::ranks::Together;
use crate::real::Real;
use crate::state::{ContactState, Motion};
use crate::system::{Linearity, System};

/// Memory of a step.
pub(super) struct Workspace<T: Real> {
    pub(super) vectors: StageVectors<T>,
    pub(super) contact: ContactWork<T>,
    /// For nonlinear systems.
    pub(super) newton: Option<Box<NewtonWork<T>>>,
    /// Free dofs without mass.
    pub(super) massless: Vec<usize>,
    /// For explicit schemes, if there are dofs without mass.
    pub(super) block: Option<MasslessBlock<T>>,
    /// For implicit schemes, if the work of contacts on such dofs is balanced.
    pub(super) excess: Option<Box<ExcessForces<T>>>,
    pub(super) correction: CorrectionWork<T>,
    pub(super) rate_check: RateCheck<T>,
    /// For schemes that are stable up to some frequency, which may be met in the run.
    pub(super) stiffening: Option<Stiffening<T>>,
    /// The number of contacts that there is memory for.
    pub(super) rows: usize,
    /// v and a at the time of the new state, where the scheme stores those of another time.
    pub(super) shown: [Vec<T>; 2],
    pub(super) backup: Backup<T>,
}

/// Memory of the corrections.
pub(super) struct CorrectionWork<T: Real> {
    pub(super) buffers: Buffers<T>,
    pub(super) projection: Option<JumpProjection<T>>,
    /// Version of the rows for which the projection was made.
    pub(super) projected_rows: u64,
    /// For correctors that act on the prediction, one entry a dof.
    pub(super) shifted: Vec<T>,
    /// Change of kinetic energy by corrections in this step.
    pub(super) energy: T,
}

/// How much contact there is when memory is reserved.
pub(super) struct ContactSize {
    /// Rows that there is to be memory for, and weights of all of them.
    pub(super) rows: usize,
    pub(super) entries: usize,
    /// Dofs that contact may ever act on.
    pub(super) interface: usize,
    /// Whether there may ever be a row, and whether rows may move within a step.
    pub(super) may_press: bool,
    pub(super) curved: bool,
}

impl ContactSize {
    /// That of the constraints, with room for so many rows.
    pub(super) fn new<T: Real>(rows: usize, g: &ContactJacobian<T>, constraints: &Constraints<'_, T>) -> Self {
        let (entries, interface) = (g.entries(), constraints.interface().len());
        Self { rows, entries, interface, may_press: constraints.may_press(), curved: !constraints.is_affine() }
    }
}

impl<T: Real> Workspace<T> {
    /// Memory for the steps of a program, with a history of so many `slots`.
    pub(super) fn new(
        system: &mut dyn System<T>,
        program: &Program<T>,
        correctors: &[Box<dyn Corrector<T> + '_>],
        projection: JumpProjection<T>,
        contact: &ContactSize,
        slots: usize,
    ) -> Self {
        let dofs = system.dofs();
        let &ContactSize { rows, entries, interface, may_press, curved } = contact;
        let damped = if system.damping_force().is_some() && !correctors.is_empty() { dofs } else { 0 };
        let balances = may_press && correctors.iter().any(Corrector::corrects_massless);
        let edits_past = correctors.iter().any(|corrector| corrector.edits() == Edits::Past);
        let room = |needed: bool| if needed && may_press { dofs } else { 0 };
        let mut targets = program.stages.iter().filter_map(|stage| stage.contact.as_ref());
        let (aimed, forecast) = (targets.clone().count() > 0, targets.any(|target| target.forecast.is_some()));
        let separate_balance = program.stages.iter().any(|stage| stage.balance.is_some());
        let supports = Supports::of(system);
        let mut contact_rows = ContactRowsWork::new([rows, entries], room(aimed), room(forecast), supports.dofs.len());
        if curved && may_press {
            contact_rows.curved.mixing = Some(Box::new(Mixing::new(interface)));
        }
        contact_rows.slides_by_way = correctors.iter().any(Corrector::leaves_smooth_motion);
        Self {
            contact: ContactWork {
                interface: InterfaceWork::new(interface),
                rows: contact_rows,
                trial: ContactState::with_capacity(rows),
                impulses: Impulses::new(room(true)),
                closed_at_start: Vec::with_capacity(rows),
                exerting_at_start: Vec::with_capacity(rows),
                forces_at_start: Vec::new(),
                sliding_at_start: Vec::new(),
                was_closed: Vec::with_capacity(rows),
                was_sticking: Vec::new(),
            },
            vectors: StageVectors {
                increment: vec![T::zero(); dofs],
                balance: separate_balance.then(|| Motion::zero(dofs)),
                supports,
            },
            newton: None,
            massless: Vec::new(),
            block: None,
            excess: None,
            correction: CorrectionWork {
                buffers: Buffers::new(rows, damped, balances.then_some(dofs)),
                projection: (may_press && !correctors.is_empty()).then_some(projection),
                projected_rows: 0,
                shifted: vec![T::zero(); room(correctors.iter().any(Corrector::predicts))],
                energy: T::zero(),
            },
            rate_check: RateCheck::new(rows),
            stiffening: None,
            rows,
            shown: [Vec::new(), Vec::new()],
            backup: Backup::new(if edits_past { slots - 1 } else { 0 }, dofs),
        }
    }

    /// Keeps the free dofs without mass, and what they take: `follower` is the name of the scheme if they follow
    /// statically before the others move.
    pub(super) fn keep_massless(
        &mut self,
        massless: Vec<usize>,
        (system, together): (&mut dyn System<T>, &Together<T>),
        (program, follower): (&Program<T>, Option<String>),
        at: &Motion<T>,
        interface: &[usize],
    ) -> Result<()> {
        if let Some(name) = follower {
            self.block = Some(MasslessBlock::new(system, &name, &massless, at, interface)?);
            self.contact.rows.on_massless = vec![false; self.rows];
        } else if self.correction.buffers.switching.is_on() && self.correction.shifted.is_empty() {
            self.excess = ExcessForces::new(system, program, &massless, at, (interface, self.rows))?;
        }
        let buffers = &mut self.correction.buffers;
        if buffers.spreads() && !(massless.is_empty() && together.is_alone()) {
            let damps = match system.linearity() {
                Linearity::Linear => is_damped(system, &massless),
                // (Forces that are not linear may act on them later.)
                Linearity::Nonlinear => Ok(!massless.is_empty()),
            };
            let [damps] = together.max(damps.map(|damps| [f64::from(u8::from(damps))]))?;
            buffers.damps_massless = damps > 0.0;
        }
        self.contact.rows.massless.clone_from(&massless);
        self.massless = massless;
        Ok(())
    }

    /// Memory for so many contacts, of so many weights in all.
    pub(super) fn make_room(&mut self, rows: usize, entries: usize) {
        self.rows = rows;
        self.contact.rows.make_room(rows, entries);
        self.contact.trial.make_room(rows);
        let ContactWork { closed_at_start, exerting_at_start, was_closed, .. } = &mut self.contact;
        for flags in [closed_at_start, exerting_at_start, was_closed] {
            flags.reserve(rows.saturating_sub(flags.len()));
        }
        self.correction.buffers.make_room(rows);
        if let Some(excess) = &mut self.excess {
            excess.make_room(rows);
        }
        self.rate_check.make_room(rows);
    }
}
