//! The stages of a step. Each stage is predicted, solved with its contact, completed and corrected.

use crate::corrector::{
    Before, Bodies, Correction, Corrector, Erased, ErasedGaps, JumpProjection, Past, Prediction, Scheme,
};
use crate::error::Result;
use crate::real::Real;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::build::workspace::{CorrectionWork, Workspace};
use crate::simulation::run::{Parts, Simulation};
use crate::simulation::stage::contact::closing::Booking;
use crate::simulation::stage::massless::MasslessBlock;
use crate::simulation::stage::{Host, StageSolve};
use crate::state::Backup;
use crate::tableau::impulse_weight;

impl<T: Real> Simulation<'_, T> {
    /// Takes all stages of a step. On entry slot 0 of the history holds the current motion.
    pub(super) fn take_stages(&mut self) -> Result<()> {
        let Self { parts, compiled, constraints, g, history, work, statistics, .. } = self;
        let Parts { system, contact_solver, correctors, together, .. } = parts;
        let (program, start_covector) = match &mut compiled.startup {
            // After the step one more state is known than now.
            Some(startup) => (startup, Some(&self.scheme.derived.covectors[history.known])),
            None => (&mut compiled.program, None),
        };
        let (clock, stages) = (history.clock, program.stages.len());
        for (place, stage) in program.stages.iter().enumerate() {
            history.slots.rotate_right(1);
            work.backup.rotations += 1;
            let Some((new, past)) = history.slots.split_first_mut() else { continue };
            let operator = &mut program.operators[stage.operator];
            operator.follow(constraints.version());
            let mut solve = StageSolve {
                stage,
                clock,
                host: Host { system: &mut **system, together },
                operator,
                constraints,
                g,
                solver: &mut **contact_solver,
                statistics,
                new,
                past,
                vectors: &mut work.vectors,
                contact: &mut work.contact,
            };
            let Workspace { correction, excess, massless, newton, block, backup, tape, .. } = work;

            solve.predict()?;
            predict_corrections(&mut solve, correction, correctors, massless, place == 0)?;
            if let Some(excess) = excess {
                excess.begin(place == 0);
                excess.shift(stage, clock.h, solve.new);
            }
            solve.contact.rows.read_start(solve.constraints, solve.g, solve.past, clock.h)?;

            solve.solve(newton.as_deref_mut(), block.as_mut())?;
            if let (Some(excess), Some(projection)) = (&mut *excess, &mut correction.projection) {
                let switching = &mut *correction.buffers.switching;
                correction.energy += excess.solve_again(&mut solve, switching, projection)?;
            }

            let covector = start_covector.unwrap_or(&stage.covector);
            let impulse_weight = impulse_weight(stage.response, covector);
            solve.set_support_accelerations();
            solve.set_massless_rates(place, history.made_with, &history.slopes);
            if solve.constraints.len() > 0 {
                let booking = Booking { impulse_weight, is_first: place == 0, is_last: place + 1 == stages };
                solve.close(&booking, &mut correction.buffers)?;
            }
            if let Some(tape) = tape {
                let d = newton.as_ref().map(|newton| &newton.d[..]);
                solve.record(tape, d, T::of(clock.h * impulse_weight))?;
            }
            if solve.constraints.len() == 0 {
                continue;
            }
            if let Some(excess) = excess {
                excess.book(stage, clock.h, &correction.buffers.switching, &mut solve.contact.trial);
            }

            let scheme = numbers(stage, clock.h, covector, [place, stages]);
            correct(solve, scheme, correctors, Corrected { correction, block: block.as_mut(), massless, backup })?;
            if let (Some(tape), Some(changes)) = (tape, &mut correction.buffers.changes) {
                let is_read = place + 1 < stages && !constraints.is_affine();
                tape.correct(changes, history.slots.first().filter(|_| is_read));
            }
        }
        Ok(())
    }
}

/// Begins the corrections of a stage; correctors with a prediction act on its predicted motion.
fn predict_corrections<T: Real>(
    solve: &mut StageSolve<'_, '_, T>,
    work: &mut CorrectionWork<T>,
    correctors: &[Box<dyn Corrector<T> + '_>],
    massless: &[usize],
    is_first: bool,
) -> Result<()> {
    let CorrectionWork { buffers, projection, projected_rows, .. } = work;
    let (Some(projection), Some(start)) = (projection, solve.past.first()) else { return Ok(()) };
    refresh(projection, projected_rows, solve.constraints.version());
    buffers.begin(&solve.contact.trial, is_first);
    if buffers.shifted.is_empty() {
        return Ok(());
    }
    let StageSolve { stage, clock, constraints, g, solver, new, vectors, contact, .. } = solve;
    let mut prediction = Prediction {
        h: clock.h * stage.end,
        g,
        projection,
        solver: &mut **solver,
        constraints: ErasedGaps(&mut **constraints),
        start,
        new,
        balance: vectors.balance.as_mut().filter(|_| stage.balance.is_some()).map(|at| (balance_share(stage), at)),
        contacts: &contact.trial,
        massless,
        prescribed: &vectors.supports.dofs,
        buffers,
    };
    correctors.iter().try_for_each(|corrector| corrector.predict(&mut prediction))
}

/// The memory that the corrections of a stage change.
struct Corrected<'s, T: Real> {
    correction: &'s mut CorrectionWork<T>,
    block: Option<&'s mut MasslessBlock<T>>,
    massless: &'s [usize],
    backup: &'s mut Backup<T>,
}

/// Corrects a solved stage if a contact of it is closed or has just opened.
fn correct<T: Real>(
    solve: StageSolve<'_, '_, T>,
    scheme: Scheme<'_>,
    correctors: &[Box<dyn Corrector<T> + '_>],
    corrected: Corrected<'_, T>,
) -> Result<()> {
    let Corrected { correction, block, massless, backup } = corrected;
    let StageSolve { host, operator, constraints, g, solver, new, past, vectors, contact, .. } = solve;
    let CorrectionWork { buffers, projection, projected_rows, energy, .. } = correction;
    if let Some(projection) = projection.as_mut().filter(|_| buffers.has_touched()) {
        refresh(projection, projected_rows, constraints.version());
        let mut correction = Correction {
            scheme,
            g,
            projection,
            bodies: Bodies {
                system: Erased(host.system),
                operator,
                block,
                massless,
                prescribed: &vectors.supports.dofs,
            },
            solver,
            constraints: ErasedGaps(constraints),
            new,
            past: Past { states: past, backup },
            contacts: &mut contact.trial,
            before: Before {
                closed: &contact.was_closed,
                closed_at_start: &contact.closed_at_start,
                sticking: &contact.was_sticking,
            },
            buffers,
            energy,
        };
        correction.correct(correctors)?;
    }
    contact.impulses.push_corrections(g, &contact.trial);
    Ok(())
}

/// Resets a projection made for rows of another version.
fn refresh<T: Real>(projection: &mut JumpProjection<T>, known: &mut u64, version: u64) {
    if *known != version {
        *known = version;
        projection.reset();
    }
}

/// The displacement of the balance per displacement of the state, as functions of the unknown.
fn balance_share<T: Real>(stage: &CompiledStage<T>) -> T {
    let [state, balance] = [stage.recovery.weights()[0], stage.balanced().weights()[0]];
    if state == T::zero() { T::zero() } else { balance / state }
}

/// The numbers of a stage that a correction needs; the stage is number `place` of `stages`.
fn numbers<'s, T: Real>(
    stage: &'s CompiledStage<T>,
    h: f64,
    covector: &'s [[f64; 3]],
    [place, stages]: [usize; 2],
) -> Scheme<'s> {
    Scheme {
        h,
        response: stage.response,
        acceleration: stage.acceleration,
        balance: stage.balance_acceleration,
        covector,
        read: &stage.read,
        reads_acceleration: stage.reads_acceleration,
        keeps_balance: stage.keeps_balance,
        stage: place,
        stages,
        length: stage.end - stage.start,
    }
}
