//! A host that says that it failed, in any of its parts and any phase: its own error comes back, what was begun leaves
//! no trace, and the run goes on bit for bit as if nothing had been.

use contact_dynamics::corrector::{LaursenLove, Release};
use contact_dynamics::faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef, Triplet};
use contact_dynamics::observer::{DofRecorder, EnergyRecorder, Observer, Wants};
use contact_dynamics::{
    CdLagrange, CentralDifference, Cholesky, Composite, Condensation, Control, Corrector, EnergyMomentum, Error,
    Factorization, LinearRows, LinearSolver, LinearSystem, Linearity, Newmark, Outcome, Park, PersistencyCorrection,
    Result, Simulation, SimulationBuilder, StepControl, StepView, TimeIntegrator,
};
use contact_dynamics_scenes::hosts::Hooked;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Fails in one of the host's functions, at one of its calls, counted from when it was armed.
#[derive(Clone, Debug)]
struct Fault {
    part: &'static str,
    left: Arc<AtomicUsize>,
}

/// Calls that never come.
const NEVER: usize = usize::MAX / 2;

impl Fault {
    fn of(part: &'static str) -> Self {
        Self { part, left: Arc::new(AtomicUsize::new(NEVER)) }
    }
    fn arm(&self, call: usize) {
        self.left.store(call, Ordering::Relaxed);
    }
    fn has_come(&self) -> bool {
        !(1..=NEVER).contains(&self.left.load(Ordering::Relaxed))
    }
    fn pass(&self, callback: &'static str) -> Result<()> {
        match callback == self.part && self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            true => Err(Error::Host { callback, source: "refused".into() }),
            false => Ok(()),
        }
    }
}

/// Cholesky's method, in which everything may fail.
#[derive(Clone, Debug)]
struct Solver(Fault);

#[derive(Debug)]
struct Factor(Box<dyn Factorization<f64>>, Fault);

impl LinearSolver<f64> for Solver {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<f64>>> {
        self.0.pass("analyze")?;
        Ok(Box::new(Factor(Cholesky::default().analyze(pattern, last)?, self.0.clone())))
    }
}

impl Factorization<f64> for Factor {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<()> {
        self.1.pass("factorize")?;
        self.0.factorize(a)
    }
    fn solve(&mut self, rhs: &mut [f64]) -> Result<()> {
        self.1.pass("solve")?;
        self.0.solve(rhs)
    }
    fn stored_values(&self) -> usize {
        self.0.stored_values()
    }
    fn condensation(&mut self) -> Option<&mut dyn Condensation<f64>> {
        Some(self)
    }
}

impl Condensation<f64> for Factor {
    fn condense(&mut self, rhs: &[f64], interface: &mut [f64]) -> Result<()> {
        self.1.pass("condense")?;
        self.0.condensation().map_or(Ok(()), |inner| inner.condense(rhs, interface))
    }
    fn expand(&mut self, interface: &[f64], solution: &mut [f64]) -> Result<()> {
        self.1.pass("expand")?;
        solution.fill(f64::NAN);
        self.0.condensation().map_or(Ok(()), |inner| inner.expand(interface, solution))
    }
    fn solve(&mut self, forces: &mut [f64]) -> Result<()> {
        // What a failed solve leaves is of no use.
        let passed = self.1.pass("respond");
        if passed.is_err() {
            forces.fill(f64::NAN);
        }
        passed?;
        self.0.condensation().map_or(Ok(()), |inner| inner.solve(forces))
    }
}

const PARTS: [&str; 16] = [
    "force",
    "tangent",
    "external_load",
    "prescribed_motion",
    "commit",
    "damping_force",
    "force_along",
    "tangent_along",
    "analyze",
    "factorize",
    "solve",
    "condense",
    "expand",
    "respond",
    "load",
    "drive",
];

fn matrix(entries: &[(usize, usize, f64)]) -> SparseColMat<usize, f64> {
    let entries: Vec<_> = entries.iter().map(|&(i, j, x)| Triplet::new(i, j, x)).collect();
    SparseColMat::try_new_from_triplets(3, 3, &entries).unwrap()
}

const CHAIN: [(usize, usize, f64); 7] =
    [(0, 0, 9.0), (0, 1, -9.0), (1, 0, -9.0), (1, 1, 18.0), (1, 2, -9.0), (2, 1, -9.0), (2, 2, 9.0)];

/// What a run consists of.
struct Run {
    scheme: Box<dyn TimeIntegrator>,
    correctors: Vec<Box<dyn Corrector<f64>>>,
    linearity: Linearity,
    along: bool,
    damped: bool,
    end_mass: f64,
}

impl Run {
    fn new(scheme: impl TimeIntegrator + 'static) -> Self {
        let correctors: Vec<Box<dyn Corrector<f64>>> =
            vec![Box::new(PersistencyCorrection::with_history_projection()), Box::new(Release)];
        let scheme = Box::new(scheme);
        Self { scheme, correctors, linearity: Linearity::Linear, along: false, damped: true, end_mass: 0.4 }
    }
    fn uncorrected(self) -> Self {
        Self { correctors: Vec::new(), ..self }
    }
    fn nonlinear(self) -> Self {
        Self { linearity: Linearity::Nonlinear, ..self }
    }

    fn builder(self, fault: &Fault) -> SimulationBuilder<'static, f64> {
        let inner = LinearSystem::lumped(vec![1.0, 1.0, self.end_mass], matrix(&CHAIN)).unwrap();
        let inner = match self.damped {
            true => inner.damping(matrix(&CHAIN.map(|(i, j, k)| (i, j, 0.005 * k)))).unwrap(),
            false => inner,
        };
        let (load, drive) = (fault.clone(), fault.clone());
        let inner = inner
            .try_load(move |t, out| {
                load.pass("load")?;
                out[1] += 0.3 * t;
                Ok(())
            })
            .try_drive(0, move |t| {
                drive.pass("drive")?;
                Ok([-0.5 * t, -0.5, 0.0])
            })
            .unwrap();
        let evaluated = fault.clone();
        let system = Hooked::new(inner, move |method, _, _| evaluated.pass(method)).linearity(self.linearity);
        let system = if self.along { system.along_paths() } else { system };
        let rows = LinearRows::new().unilateral(&[(2, 1.0)], 0.12).unilateral(&[(1, 1.0)], 0.3);
        Simulation::builder(system, self.scheme, 0.02)
            .velocity(vec![-0.5, -1.0, if self.end_mass > 0.0 { -1.5 } else { 0.0 }])
            .constraint(rows)
            .uncorrected()
            .correctors(self.correctors)
            .linear_solver(Solver(fault.clone()))
            .energy_balance()
    }
}

const RUNS: [fn() -> Run; 8] = [
    || Run::new(Newmark::trapezoidal()),
    || Run::new(Newmark::trapezoidal()).nonlinear(),
    || Run::new(Composite),
    || Run::new(Park),
    || Run { correctors: vec![Box::new(LaursenLove)], ..Run::new(EnergyMomentum).nonlinear() },
    || Run { along: true, ..Run::new(EnergyMomentum).nonlinear().uncorrected() },
    || Run::new(CdLagrange).uncorrected(),
    || Run { damped: false, end_mass: 0.0, ..Run::new(CentralDifference).uncorrected() },
];

/// State and past, energies and works, to be compared bit for bit.
fn trace(run: &mut Simulation<'_, f64>) -> String {
    let energy = run.energy();
    let history = run.history();
    let past: Vec<_> = (1..=history.len()).map(|k| history.past(k)).collect();
    format!("{:?} {past:?} {:e} {:e} {energy:?}", run.state(), history.step_size(), run.time())
}

/// The error of a fault, of this part.
fn is_own(error: &Error, fault: &Fault) -> bool {
    matches!(error, Error::Host { callback, .. } if *callback == fault.part) && !error.is_recoverable()
}

const STEPS: usize = 16;

#[test]
fn a_step_is_undone_whatever_refuses_in_it() {
    let mut refused = std::collections::BTreeSet::new();
    for (index, make) in RUNS.into_iter().enumerate() {
        let mut clean = make().builder(&Fault::of("nothing")).build().unwrap();
        let expected: Vec<String> = (0..STEPS)
            .map(|_| {
                clean.step().unwrap();
                trace(&mut clean)
            })
            .collect();
        assert!(clean.statistics().contact_changes > 0, "{index}");
        for part in PARTS {
            for call in 1.. {
                let fault = Fault::of(part);
                let mut run = make().builder(&fault).build().unwrap();
                fault.arm(call);
                for (step, expected) in expected.iter().enumerate() {
                    let before = trace(&mut run);
                    if let Err(error) = run.step() {
                        let case = format!("run {index}, {part} at call {call}, step {step}: {error}");
                        assert!(is_own(&error, &fault) && fault.has_come(), "{case}");
                        assert_eq!(trace(&mut run), before, "{case}");
                        refused.insert(part);
                        run.step().unwrap_or_else(|error| panic!("{case}, again: {error}"));
                    }
                    assert_eq!(trace(&mut run), *expected, "run {index}, {part} at call {call}, step {step}");
                }
                if !fault.has_come() {
                    break;
                }
            }
        }
    }
    // (An analysis belongs to the build.)
    let expected: std::collections::BTreeSet<_> = PARTS.into_iter().filter(|part| *part != "analyze").collect();
    assert_eq!(refused, expected);
}

#[test]
fn a_build_is_refused_whatever_refuses_in_it() {
    for (index, make) in RUNS.into_iter().enumerate() {
        for part in PARTS {
            for call in 1.. {
                let fault = Fault::of(part);
                fault.arm(call);
                match make().builder(&fault).build() {
                    Ok(_) => {
                        assert!(!fault.has_come(), "run {index}, {part} at call {call}: swallowed");
                        break;
                    }
                    Err(error) => assert!(is_own(&error, &fault), "run {index}, {part} at call {call}: {error}"),
                }
            }
        }
    }
}

/// Between steps: what fails changes nothing, and works when it is called again.
#[test]
fn calls_between_steps_are_undone_whatever_refuses_in_them() {
    type Call = fn(&mut Simulation<'_, f64>) -> Result<()>;
    let calls: [(&str, Call); 3] = [
        ("set_step_size", |run| run.set_step_size(0.015)),
        ("restart", |run| run.restart()),
        ("reactions", |run| run.reactions().map(drop)),
    ];
    for (index, make) in RUNS.into_iter().enumerate() {
        for (name, between) in calls {
            let run = |fault: &Fault| {
                let mut run = make().builder(fault).build().unwrap();
                (0..5).for_each(|_| run.step().unwrap());
                run
            };
            let mut clean = run(&Fault::of("nothing"));
            between(&mut clean).unwrap();
            (0..5).for_each(|_| clean.step().unwrap());
            let expected = trace(&mut clean);
            for part in PARTS {
                for call in 1.. {
                    let fault = Fault::of(part);
                    let mut run = run(&fault);
                    let before = trace(&mut run);
                    fault.arm(call);
                    let case = format!("run {index}, {name}, {part} at call {call}");
                    let result = between(&mut run);
                    if let Err(error) = &result {
                        assert!(is_own(error, &fault), "{case}: {error}");
                        assert_eq!(trace(&mut run), before, "{case}: {error}");
                        between(&mut run).unwrap_or_else(|error| panic!("{case}, again: {error}"));
                    }
                    fault.arm(NEVER);
                    (0..5).for_each(|_| run.step().unwrap_or_else(|error| panic!("{case}: {error}")));
                    assert_eq!(trace(&mut run), expected, "{case}");
                    if result.is_ok() {
                        break;
                    }
                }
            }
        }
    }
}

#[test]
fn a_load_that_is_inadmissible_is_asked_for_at_smaller_steps() {
    let spring = SparseColMat::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)]).unwrap();
    let left = Arc::new(AtomicUsize::new(NEVER));
    let count = left.clone();
    let system = LinearSystem::lumped(vec![1.0], spring).unwrap().try_load(move |_, _| {
        match count.fetch_sub(1, Ordering::Relaxed) {
            1 => Err(Error::Inadmissible { callback: "load", source: "not here".into() }),
            _ => Ok(()),
        }
    });
    let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.1)
        .displacement(vec![1.0])
        .step_control(StepControl::halving(1e-3).unwrap())
        .build()
        .unwrap();
    left.store(1, Ordering::Relaxed);
    run.step().unwrap();
    assert_eq!((run.time(), run.statistics().refused_steps), (0.05, 1));
}

#[test]
fn an_observer_that_fails_ends_the_run_after_its_step() {
    let build = || Run::new(Newmark::trapezoidal()).builder(&Fault::of("nothing")).build().unwrap();
    let (mut run, mut clean) = (build(), build());
    (0..4).for_each(|_| clean.step().unwrap());
    let mut seen = 0;
    let mut recorder = DofRecorder::new(1);
    let mut disk_is_full = |step: &StepView<'_, f64>| -> Result<Control> {
        seen += 1;
        match step.statistics.steps {
            4 => Err(Error::Host { callback: "observer", source: "disk full".into() }),
            _ => Ok(Control::Continue),
        }
    };
    let error = run.run_until(1.0, &mut (&mut disk_is_full, &mut recorder)).unwrap_err();
    assert_eq!(error.to_string(), "the host's observer failed: disk full");
    assert_eq!(trace(&mut run), trace(&mut clean));
    // The other of the pair has seen that step too.
    assert_eq!(recorder.times().len(), 4);
    let error = run.land_on(1.0, &mut |_: &StepView<'_, f64>| Err::<Control, _>(Error::Poisoned)).unwrap_err();
    assert!(matches!(error, Error::Poisoned) && run.statistics().steps == 5);
    // Also in the last, shorter step of a landing: the step size is then the old one.
    clean.step().unwrap();
    let t = run.time() + 0.01;
    let error = run.land_on(t, &mut |_: &StepView<'_, f64>| Err::<Control, _>(Error::Poisoned)).unwrap_err();
    assert!(
        matches!(error, Error::Poisoned) && (run.time() - t).abs() < 1e-12 && (run.step_size() - 0.02).abs() < 1e-15
    );
    clean.land_on(t, &mut ()).unwrap();
    assert_eq!(trace(&mut run), trace(&mut clean));
    assert_eq!(run.run_until(0.2, &mut ()).unwrap(), Outcome::Reached);
    assert_eq!(seen, 4);
}

/// A recorder of a host.
#[derive(Default)]
struct Own(Vec<f64>);

impl Observer<f64> for Own {
    fn observe(&mut self, step: &StepView<'_, f64>) -> Result<Control> {
        self.0.push(step.energy.map_or(f64::NAN, |energy| energy.total()));
        Ok(Control::Continue)
    }
    fn wants(&self) -> Wants {
        Wants::Energy
    }
}

#[test]
fn a_lent_recorder_keeps_its_wish_for_energies() {
    let spring = SparseColMat::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)]).unwrap();
    let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], spring).unwrap(), Newmark::trapezoidal(), 0.1)
        .displacement(vec![1.0])
        .build()
        .unwrap();
    let (mut own, mut energies, mut boxed) = (Own::default(), EnergyRecorder::new(), Own::default());
    let mut steps = 0;
    let mut count = |_: &StepView<'_, f64>| {
        steps += 1;
        Control::Continue
    };
    run.run_until(0.95, &mut (&mut energies, &mut count)).unwrap();
    run.run_until(1.95, &mut ((), (own.by_ref(), ()))).unwrap();
    {
        let mut observer: Box<dyn Observer<f64> + '_> = Box::new((boxed.by_ref(), &mut count));
        run.run_until(2.95, &mut (&mut *observer, ())).unwrap();
        run.run_until(3.95, &mut observer).unwrap();
    }
    run.run_until(4.95, &mut count).unwrap();
    assert_eq!((steps, energies.energies().len(), own.0.len(), boxed.0.len()), (40, 10, 10, 20));
    assert!(own.0.iter().chain(&boxed.0).all(|energy| (energy - 0.5).abs() < 1e-12));
}
