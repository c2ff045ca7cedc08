//! A host's own parts behind every trait, chosen at run time, in both precisions.

use contact_dynamics::contact::{Candidates, ContactConstraint, ContactLaw, Contacts};
use contact_dynamics::contact_solver::{ContactFailure, ContactProblem};
use contact_dynamics::corrector::Correction;
use contact_dynamics::faer::sparse::{SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::observer::{ContactRecorder, DofRecorder};
use contact_dynamics::{
    ActiveSet, Automatic, Cholesky, Composite, ContactSolver, Control, Corrector, DampingForce, Error, Factorization,
    LinearSolver, Linearity, Mass, Newmark, Observer, Outcome, PersistencyCorrection, Real, Result, Simulation,
    StepView, System, TangentWeights, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::sparse::free;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A mass on a spring and a dashpot, without any matrix.
struct Oscillator<T> {
    mass: [T; 1],
    stiffness: T,
    damping: T,
    pattern: SymbolicSparseColMat<usize>,
    commits: usize,
}

impl<T: Real> Oscillator<T> {
    fn new(mass: f64, stiffness: f64, damping: f64) -> Self {
        Self {
            mass: [T::of(mass)],
            stiffness: T::of(stiffness),
            damping: T::of(damping),
            pattern: SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]),
            commits: 0,
        }
    }
}

impl<T: Real> System<T> for Oscillator<T> {
    fn dofs(&self) -> usize {
        1
    }
    fn mass(&self) -> Mass<'_, T> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, _: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        out[0] = -self.stiffness * u[0] - self.damping * v[0];
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn linearity(&self) -> Linearity {
        Linearity::Linear
    }
    fn tangent(&mut self, _: f64, _: &[T], _: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
        out[0] = weights.stiffness * self.stiffness + weights.damping * self.damping;
        Ok(())
    }
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
        Some(self)
    }
    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        Some(T::of(0.5) * self.stiffness * u[0] * u[0])
    }
    fn commit(&mut self, _: f64, _: &[T], _: &[T]) -> Result<()> {
        self.commits += 1;
        if self.commits == 1000 {
            return Err(Error::Host { callback: "commit", source: "full".into() });
        }
        Ok(())
    }
}

impl<T: Real> DampingForce<T> for Oscillator<T> {
    fn evaluate(&mut self, _: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        out[0] = self.damping * v[0];
        Ok(())
    }
}

/// A floor at u = −depth that appears only near it: candidates change during the run.
struct Floor {
    depth: f64,
    near: bool,
}

impl<T: Real> ContactConstraint<T> for Floor {
    fn dofs(&self) -> &[usize] {
        &[0]
    }
    fn search(&mut self, _: f64, u: &[T], _: &[T], _: f64) -> Result<Candidates> {
        assert_eq!(u.len(), 1);
        let near = u[0].value() < -0.5 * self.depth;
        let changed = near != self.near;
        self.near = near;
        Ok(Candidates::changed_if(changed))
    }
    fn contacts(&self, contacts: &mut Contacts<T>) {
        if self.near {
            contacts.push((7, 3), ContactLaw::Rigid, &[(0, T::one())]);
        }
    }
    fn gaps(&mut self, _: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        gaps[0] = u[0] + T::of(self.depth);
        Ok(())
    }
}

/// Counts what passes through to the library's own solvers.
#[derive(Debug)]
struct Counting {
    calls: Arc<AtomicUsize>,
}

#[derive(Debug)]
struct CountingFactor<T: Real> {
    inner: Box<dyn Factorization<T>>,
    calls: Arc<AtomicUsize>,
}

impl<T: Real> LinearSolver<T> for Counting {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        let inner = Cholesky::default().analyze(pattern, last)?;
        Ok(Box::new(CountingFactor { inner, calls: self.calls.clone() }))
    }
}

impl<T: Real> Factorization<T> for CountingFactor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        self.inner.factorize(a)
    }
    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.inner.solve(rhs)
    }
    fn stored_values(&self) -> usize {
        self.inner.stored_values()
    }
}

#[derive(Debug)]
struct CountingContact<T: Real> {
    inner: ActiveSet<T>,
    calls: Arc<AtomicUsize>,
}

impl<T: Real> ContactSolver<T> for CountingContact<T> {
    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.inner.solve(problem, multipliers)
    }
}

#[derive(Debug)]
struct CountingCorrector {
    calls: Arc<AtomicUsize>,
}

impl<T: Real> Corrector<T> for CountingCorrector {
    fn name(&self) -> String {
        "counting".into()
    }
    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        assert!(!step.closed().is_empty() || !step.opened().is_empty());
        self.calls.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

fn by_name(name: &str) -> Box<dyn TimeIntegrator> {
    match name {
        "composite" => Box::new(Composite),
        _ => Box::new(Newmark::trapezoidal()),
    }
}

/// Builds everything from trait objects.
fn host_run<T: Real>(name: &str, counts: [&Arc<AtomicUsize>; 3]) -> Simulation<'static, T> {
    let system: Box<dyn System<T>> = Box::new(Oscillator::<T>::new(2.0, 50.0, 0.4));
    let floor: Box<dyn ContactConstraint<T>> = Box::new(Floor { depth: 0.1, near: false });
    let linear: Box<dyn LinearSolver<T>> = Box::new(Counting { calls: counts[0].clone() });
    let contact: Box<dyn ContactSolver<T>> =
        Box::new(CountingContact { inner: ActiveSet::default(), calls: counts[1].clone() });
    let correctors: [Box<dyn Corrector<T>>; 2] =
        [Box::new(PersistencyCorrection::new()), Box::new(CountingCorrector { calls: counts[2].clone() })];
    let [first, second] = correctors;
    Simulation::builder(system, by_name(name), 0.005)
        .velocity(vec![T::of(-1.0)])
        .constraint(floor)
        .linear_solver(linear)
        .contact_solver(contact)
        .corrector(first)
        .corrector(second)
        .build()
        .unwrap()
}

fn run_in<T: Real>() {
    for name in ["composite", "Newmark"] {
        let counts = [(); 3].map(|()| Arc::new(AtomicUsize::new(0)));
        let mut run = host_run::<T>(name, [&counts[0], &counts[1], &counts[2]]);
        let mut lowest = 0.0_f64;
        let mut observer: Box<dyn Observer<T>> = Box::new((DofRecorder::<T>::new(0), ContactRecorder::<T>::new()));
        let mut pressed = 0;
        while run.time() < 2.0 - 1e-9 {
            run.run_until(run.time() + 0.005, &mut *observer).unwrap();
            lowest = lowest.min(run.state().displacement()[0].value());
            let contacts = run.state().contacts();
            if contacts.closed().first() == Some(&true) {
                pressed += 1;
                assert_eq!(contacts.ids()[0].feature, 7);
                assert!(run.state().velocity()[0].value().abs() < 1e-4);
            }
        }
        assert!((lowest + 0.1).abs() < 1e-6, "{name}: {lowest}");
        assert!(pressed > 0);
        for (count, what) in counts.iter().zip(["linear solves", "contact solves", "corrections"]) {
            assert!(count.load(Ordering::Relaxed) > 0, "{what}");
        }
    }
}

#[test]
fn a_host_brings_every_part_in_double_precision() {
    run_in::<f64>();
}

#[test]
fn a_host_brings_every_part_in_single_precision() {
    run_in::<f32>();
}

#[test]
fn a_lent_system_stays_with_the_host() {
    let mut system = Oscillator::<f64>::new(1.0, 4.0, 0.0);
    {
        let mut run =
            Simulation::builder(&mut system, Newmark::trapezoidal(), 0.01).displacement(vec![1.0]).build().unwrap();
        run.run_until(0.5, &mut ()).unwrap();
        assert!((run.state().displacement()[0] - 1.0_f64.cos()).abs() < 1e-4);
    }
    assert_eq!(system.commits, 50);
}

#[test]
fn a_commit_that_fails_undoes_the_step() {
    let mut run = Simulation::builder(Oscillator::<f64>::new(1.0, 4.0, 0.0), Composite, 0.01)
        .displacement(vec![1.0])
        .build()
        .unwrap();
    run.run_until(9.99, &mut ()).unwrap();
    let before = (run.state().clone(), run.time(), *run.statistics());
    let error = run.step().unwrap_err();
    assert!(matches!(error, Error::Host { callback: "commit", .. }) && !error.is_recoverable());
    assert!(matches!(&error, Error::Host { source, .. } if source.to_string() == "full"), "{error}");
    let after = (run.state().clone(), run.time(), *run.statistics());
    assert_eq!((before.0, before.1.to_bits(), before.2.steps), (after.0, after.1.to_bits(), after.2.steps));
}

#[test]
fn observers_pair_up_and_may_stop_the_run() {
    let bars = Bars::paper(10);
    let mut run = Simulation::builder(bars.system::<f64>(), Composite, 1e-3)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .linear_solver(Automatic)
        .build()
        .unwrap();
    let mut recorder = DofRecorder::new(10);
    let mut forces = ContactRecorder::new();
    let mut steps = 0;
    let stop = |step: &StepView<'_, f64>| {
        assert_eq!(step.state.contacts().gaps().len(), 1);
        steps += 1;
        match step.state.contacts().closed()[0] {
            true => Control::Stop,
            false => Control::Continue,
        }
    };
    let record = |step: &StepView<'_, f64>| {
        recorder.observe(step)?;
        forces.observe(step)
    };
    let outcome = run.run_until(1.0, &mut ((record, ()), stop)).unwrap();
    assert_eq!(outcome, Outcome::Stopped);
    assert_eq!(recorder.times().len(), steps);
    assert_eq!(forces.forces().len(), steps);
    assert!((recorder.motion()[steps - 1][0] - 0.005).abs() < 1e-4);
    assert!((run.time() - 0.1).abs() < 2e-3, "{}", run.time());
    assert_eq!(run.run_until(0.05, &mut ()).unwrap(), Outcome::Reached);
}

#[test]
fn time_is_counted_not_summed() {
    let mut run =
        Simulation::builder(Oscillator::<f64>::new(1.0, 4.0, 0.0), Newmark::trapezoidal(), 1e-3).build().unwrap();
    run.run_until(0.9, &mut ()).unwrap();
    assert_eq!(run.time().to_bits(), (900.0_f64 * 1e-3).to_bits());
    assert_eq!(run.statistics().steps, 900);
}

/// Floors under two masses; a mass has a candidate only near its floor, so that the places in the list change.
struct Floors {
    depths: [f64; 2],
    near: [bool; 2],
}

impl Floors {
    fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..2).filter(|&mass| self.near[mass])
    }
}

impl ContactConstraint<f64> for Floors {
    fn dofs(&self) -> &[usize] {
        &[0, 1]
    }
    fn search(&mut self, _: f64, u: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        let near = [0, 1].map(|mass| u[mass] < 0.3 - self.depths[mass]);
        let changed = near != self.near;
        self.near = near;
        Ok(Candidates::changed_if(changed))
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        for mass in self.rows() {
            contacts.push((mass, 0), ContactLaw::Rigid, &[(mass, 1.0)]);
        }
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        for (mass, gap) in self.rows().zip(gaps) {
            *gap = u[mass] + self.depths[mass];
        }
        Ok(())
    }
}

/// A constraint without rows whose search fails when it is told to.
struct Moody(Arc<AtomicUsize>);

impl ContactConstraint<f64> for Moody {
    fn dofs(&self) -> &[usize] {
        &[]
    }
    fn search(&mut self, _: f64, _: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        match self.0.load(Ordering::Relaxed) {
            0 => Ok(Candidates::Unchanged),
            _ => Err(Error::Host { callback: "search", source: "moody".into() }),
        }
    }
    fn contacts(&self, _: &mut Contacts<f64>) {}
    fn gaps(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<()> {
        Ok(())
    }
}

#[test]
fn multipliers_and_flags_follow_their_contact_through_the_list() {
    // Mass 1 lands at t = 0.32, mass 0 at 0.45 under g = 10: its candidate comes in before that of mass 1.
    let broken = Arc::new(AtomicUsize::new(0));
    let system = free(&[1.0, 2.0]).load(|_, f: &mut [f64]| f.copy_from_slice(&[-10.0, -20.0]));
    let mut run = Simulation::builder(system, Composite, 1e-3)
        .constraint(Floors { depths: [1.0, 0.5], near: [false; 2] })
        .constraint(Moody(broken.clone()))
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .unwrap();
    let mut seen = Vec::new();
    while run.time() < 0.6 {
        // Every third search fails after the floors have looked: what they found must not be lost.
        if run.statistics().steps % 3 == 0 {
            broken.store(1, Ordering::Relaxed);
            let before = run.state().clone();
            assert!(matches!(run.step(), Err(Error::Host { callback: "search", .. })));
            assert_eq!(&before, run.state());
            broken.store(0, Ordering::Relaxed);
        }
        run.step().unwrap();
        seen.push(run.state().contacts().ids().iter().map(|id| id.feature).collect::<Vec<_>>());
        // Once it has landed, mass 1 carries its weight at every step, whoever joins the list.
        if run.time() > 0.33 {
            let contacts = run.state().contacts();
            let row = contacts.ids().iter().position(|id| id.feature == 1).unwrap();
            assert!(contacts.closed()[row] && (contacts.forces()[row] - 20.0).abs() < 1e-8, "{contacts:?}");
        }
    }
    seen.dedup();
    assert_eq!(seen, [vec![], vec![1], vec![0, 1]]);
    assert_eq!(run.statistics().contact_changes, 2);
    assert!((run.state().contacts().forces()[0] - 10.0).abs() < 1e-8);
}

#[test]
fn a_corrector_that_hides_its_edits_is_refused() {
    #[derive(Debug)]
    struct Sly;
    impl Corrector<f64> for Sly {
        fn name(&self) -> String {
            "sly".into()
        }
        fn correct(&self, step: &mut Correction<'_, f64>) -> Result<()> {
            step.solve_velocity_jumps()?;
            step.project_past()
        }
    }
    let bars = Bars::paper(10);
    let mut run = Simulation::builder(bars.system::<f64>(), Composite, 1e-3)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .corrector(Sly)
        .build()
        .unwrap();
    let error = run.run_until(0.2, &mut ()).unwrap_err();
    assert!(matches!(error, Error::Incompatible { .. }), "{error}");
    assert!((run.time() - 0.1).abs() < 2e-3);
}

/// A floor for one mass after the other: the same place in the list, another row of G.
struct Relay {
    mass: usize,
}

impl ContactConstraint<f64> for Relay {
    fn dofs(&self) -> &[usize] {
        &[0, 1]
    }
    fn search(&mut self, t: f64, _: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        let mass = usize::from(t > 0.15);
        Ok(Candidates::changed_if(std::mem::replace(&mut self.mass, mass) != mass))
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        contacts.push((self.mass, 0), ContactLaw::Rigid, &[(self.mass, 1.0)]);
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        gaps[0] = u[self.mass] + [0.1, 0.5][self.mass];
        Ok(())
    }
}

#[test]
fn what_was_computed_for_one_row_is_not_used_for_the_next() {
    // Masses of 1 and 5 fall under g = 10 on floors 0.1 and 0.5 below them; the first is pressed until it loses its
    // floor.
    let weight = |_, f: &mut [f64]| f.copy_from_slice(&[-10.0, -50.0]);
    let mut run = Simulation::builder(free(&[1.0, 5.0]).load(weight), Composite, 0.007)
        .velocity(vec![-1.0, -1.0])
        .constraint(Relay { mass: 0 })
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .unwrap();
    let mut pressed = [0; 2];
    while run.time() < 0.5 {
        run.step().unwrap();
        let contacts = run.state().contacts();
        let mass = contacts.ids()[0].feature;
        if contacts.closed()[0] {
            pressed[mass] += 1;
            // Stopped at once, not little by little.
            assert!(run.state().velocity()[mass].abs() < 1e-12, "{:?}", run.state());
        }
    }
    assert!(pressed[0] > 5 && pressed[1] > 20, "{pressed:?}");
}
