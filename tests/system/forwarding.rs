//! Pointers to parts are parts, and forward every method: a part behind a pointer does and answers what the bare one
//! does. The methods of a trait are read from its source, so that one that is new must be tried here too.

use contact_dynamics::corrector::{Correction, Edits, Effects, Prediction, Requirements};
use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMat, SymbolicSparseColMatRef, Triplet};
use contact_dynamics::observer::Wants;
use contact_dynamics::ranks::Ranks;
use contact_dynamics::tableau::Tableau;
use contact_dynamics::{
    Control, Corrector, DampingForce, Diagonal, Factorization, LinearRows, LinearSolver, LinearSystem, Linearity, Mass,
    Newmark, Observer, Path, PathForce, Result, Simulation, StepView, System, TangentWeights, TimeIntegrator,
};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::{Arc, Mutex};

/// Which methods of a part were called.
#[derive(Clone, Debug, Default)]
struct Log(Arc<Mutex<BTreeSet<&'static str>>>);

impl Log {
    fn note(&self, method: &'static str) {
        self.0.lock().unwrap().insert(method);
    }
    fn take(&self) -> BTreeSet<&'static str> {
        std::mem::take(&mut *self.0.lock().unwrap())
    }
}

/// The methods of a trait, but for those that lend the part itself.
fn methods(file: &str, name: &str) -> BTreeSet<String> {
    let source = std::fs::read_to_string(format!("{}/src/{file}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let start = source.find(&format!("pub trait {name}")).unwrap();
    let body = source[start..].split("\n}").next().unwrap();
    let methods = body.lines().filter_map(|line| line.strip_prefix("    fn "));
    let names = methods.map(|rest| rest.split(['(', '<']).next().unwrap().to_owned());
    names.filter(|name| name != "by_ref").collect()
}

/// Refuses a pointer that answers otherwise than the bare part, or whose part has not been asked all that there is.
fn compare<A: PartialEq + std::fmt::Debug>(log: &Log, all: &BTreeSet<String>, bare: &A, other: &A, pointer: &str) {
    assert_eq!(bare, other, "{pointer}");
    let called = log.take().into_iter().map(str::to_owned).collect::<BTreeSet<_>>();
    assert_eq!(called, *all, "{pointer}: methods called, methods of the trait");
}

/// A system whose every answer differs from the default one.
struct Model {
    log: Log,
    pattern: SymbolicSparseColMat<usize>,
}

impl Model {
    fn new(log: &Log) -> Self {
        let pattern = SymbolicSparseColMat::new_checked(2, 2, vec![0, 1, 2], None, vec![0, 1]);
        Self { log: log.clone(), pattern }
    }
}

impl System<f64> for Model {
    fn dofs(&self) -> usize {
        self.log.note("dofs");
        2
    }
    fn linearity(&self) -> Linearity {
        self.log.note("linearity");
        Linearity::Linear
    }
    fn mass(&self) -> Mass<'_, f64> {
        self.log.note("mass");
        Mass::Lumped(&[2.0, 3.0])
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        self.log.note("force");
        out.copy_from_slice(&[t + u[0], v[1]]);
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.log.note("pattern");
        self.pattern.as_ref()
    }
    fn tangent(&mut self, t: f64, u: &[f64], v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        self.log.note("tangent");
        out.copy_from_slice(&[t + u[0] * w.stiffness, v[1] * w.damping]);
        Ok(())
    }
    fn path_force(&mut self) -> Option<&mut dyn PathForce<f64>> {
        self.log.note("path_force");
        Some(self)
    }
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<f64>> {
        self.log.note("damping_force");
        Some(self)
    }
    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        self.log.note("potential_energy");
        Some(u[0])
    }
    fn external_load(&mut self, t: f64, out: &mut [f64]) -> Result<()> {
        self.log.note("external_load");
        out[1] = t;
        Ok(())
    }
    fn highest_frequency(&mut self) -> Option<f64> {
        self.log.note("highest_frequency");
        Some(7.0)
    }
    fn ranks(&self) -> Option<Arc<dyn Ranks<f64>>> {
        self.log.note("ranks");
        Some(Arc::new(Fifth))
    }
    fn prescribed(&self) -> &[usize] {
        self.log.note("prescribed");
        &[1]
    }
    fn prescribed_motion(&mut self, t: f64, out: &mut [[f64; 3]]) -> Result<()> {
        self.log.note("prescribed_motion");
        out[0] = [t, 1.0, 2.0];
        Ok(())
    }
    fn commit(&mut self, t: f64, _: &[f64], _: &[f64]) -> Result<()> {
        self.log.note("commit");
        Err(contact_dynamics::Error::Host { callback: "commit", source: format!("{t}").into() })
    }
}

/// A rank that is asked for its number alone.
#[derive(Debug)]
struct Fifth;

impl Ranks<f64> for Fifth {
    fn rank(&self) -> usize {
        5
    }
    fn owned(&self) -> &[Range<usize>] {
        &[]
    }
    fn sum(&self, _: &mut [f64]) -> Result<()> {
        Ok(())
    }
    fn max(&self, _: &mut [f64]) -> Result<()> {
        Ok(())
    }
    fn share(&self, _: &mut [f64]) -> Result<()> {
        Ok(())
    }
}

impl DampingForce<f64> for Model {
    fn evaluate(&mut self, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&[u[0], v[0]]);
        Ok(())
    }
}

impl PathForce<f64> for Model {
    fn force_along(&mut self, t: f64, path: Path<'_, f64>, v: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&[t + path.to[0], v[0]]);
        Ok(())
    }
    fn tangent_along(
        &mut self,
        t: f64,
        path: Path<'_, f64>,
        _: &[f64],
        w: TangentWeights<f64>,
        out: &mut [f64],
    ) -> Result<()> {
        out.copy_from_slice(&[t + path.from[0], w.stiffness]);
        Ok(())
    }
}

/// All that a system answers.
fn answers(mut system: impl System<f64>) -> String {
    let (u, v, mut all) = ([0.3, 0.4], [0.5, 0.6], Vec::new());
    let weights = TangentWeights::new(1.5, 2.5);
    let mut evaluate = |call: &mut dyn FnMut(&mut [f64]) -> Result<()>| {
        let mut out = [f64::NAN; 2];
        call(&mut out).unwrap();
        all.push(out);
    };
    evaluate(&mut |out| system.force(0.1, &u, &v, out));
    evaluate(&mut |out| system.tangent(0.1, &u, &v, weights, out));
    evaluate(&mut |out| system.external_load(0.2, out));
    evaluate(&mut |out| system.damping_force().unwrap().evaluate(&u, &v, out));
    evaluate(&mut |out| system.path_force().unwrap().force_along(0.2, Path::new(&u, &v, &u), &v, out));
    evaluate(&mut |out| system.path_force().unwrap().tangent_along(0.2, Path::new(&u, &v, &u), &v, weights, out));
    let mut supports = [[0.0; 3]];
    system.prescribed_motion(0.7, &mut supports).unwrap();
    let sizes = (system.dofs(), system.linearity(), system.pattern().row_idx().len(), system.prescribed().to_vec());
    let rank = system.ranks().map(|ranks| ranks.rank());
    let numbers = (system.potential_energy(&u), system.highest_frequency(), rank);
    let (mass, commit) = (format!("{:?}", system.mass()), system.commit(0.9, &u, &v));
    format!("{all:?} {supports:?} {sizes:?} {numbers:?} {mass} {commit:?}")
}

#[test]
fn pointers_to_systems() {
    let (log, all) = (Log::default(), methods("system.rs", "System"));
    let bare = answers(Model::new(&log));
    compare(&log, &all, &bare, &bare, "bare");
    compare(&log, &all, &bare, &answers(&mut Model::new(&log)), "&mut S");
    compare(&log, &all, &bare, &answers(Box::new(Model::new(&log))), "Box<S>");
    let chosen: Box<dyn System<f64>> = Box::new(Model::new(&log));
    compare(&log, &all, &bare, &answers(chosen), "Box<dyn System>");
    let mut lent: Box<dyn System<f64>> = Box::new(Model::new(&log));
    compare(&log, &all, &bare, &answers(&mut *lent), "&mut dyn System");
    compare(&log, &all, &bare, &answers(Box::new(&mut lent)), "Box<&mut Box<dyn System>>");
}

#[derive(Clone, Debug)]
struct Scheme(Log);

impl TimeIntegrator for Scheme {
    fn name(&self) -> String {
        self.0.note("name");
        "own".into()
    }
    fn tableau(&self) -> Tableau {
        self.0.note("tableau");
        Newmark::trapezoidal().tableau()
    }
}

#[test]
fn pointers_to_integrators() {
    #[expect(clippy::needless_pass_by_value, reason = "pointers are tried by value")]
    fn answers(scheme: impl TimeIntegrator) -> (String, Tableau) {
        (scheme.name(), scheme.tableau())
    }
    let (log, all) = (Log::default(), methods("integrator.rs", "TimeIntegrator"));
    let bare = answers(Scheme(log.clone()));
    compare(&log, &all, &bare, &bare, "bare");
    compare(&log, &all, &bare, &answers(Box::new(Scheme(log.clone()))), "Box<I>");
    let chosen: Box<dyn TimeIntegrator> = Box::new(Scheme(log.clone()));
    compare(&log, &all, &bare, &answers(chosen), "Box<dyn TimeIntegrator>");
}

#[derive(Clone, Debug)]
struct Remedy(Log);

impl Corrector<f64> for Remedy {
    fn name(&self) -> String {
        self.0.note("name");
        "own".into()
    }
    fn requirements(&self, _: &Tableau) -> Requirements {
        self.0.note("requirements");
        Requirements::default()
    }
    fn effects(&self) -> Effects {
        self.0.note("effects");
        Effects { edits: Edits::Past, leaves_smooth_motion: true, predicts: true, ..Effects::default() }
    }
    fn predict(&self, _: &mut Prediction<'_, f64>) -> Result<()> {
        self.0.note("predict");
        Ok(())
    }
    fn correct(&self, step: &mut Correction<'_, f64>) -> Result<()> {
        self.0.note("correct");
        step.solve_velocity_jumps()?;
        step.push_velocity()
    }
}

#[test]
fn pointers_to_correctors() {
    /// A damped ball that falls on a floor.
    fn answers(corrector: impl Corrector<f64>) -> String {
        let name = corrector.name();
        let matrix = |x: f64| SparseColMat::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, x)]).unwrap();
        let system = LinearSystem::lumped(vec![1.0], matrix(4.0)).unwrap().damping(matrix(0.1)).unwrap();
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.01)
            .velocity(vec![-2.0])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.02))
            .corrector(corrector)
            .build()
            .unwrap();
        run.run_until(0.1, &mut ()).unwrap();
        format!("{name} {:?}", run.state())
    }
    let (log, all) = (Log::default(), methods("corrector.rs", "Corrector"));
    let bare = answers(Remedy(log.clone()));
    compare(&log, &all, &bare, &bare, "bare");
    compare(&log, &all, &bare, &answers(Box::new(Remedy(log.clone()))), "Box<C>");
    let chosen: Box<dyn Corrector<f64>> = Box::new(Remedy(log.clone()));
    compare(&log, &all, &bare, &answers(chosen), "Box<dyn Corrector>");
}

#[derive(Clone, Debug)]
struct Solver(Log);

impl LinearSolver<f64> for Solver {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<f64>>> {
        self.0.note("analyze");
        Diagonal.analyze(pattern, last)
    }
    fn spans_ranks(&self) -> bool {
        self.0.note("spans_ranks");
        true
    }
}

#[test]
fn pointers_to_linear_solvers() {
    #[expect(clippy::needless_pass_by_value, reason = "pointers are tried by value")]
    fn answers(solver: impl LinearSolver<f64>) -> (f64, bool) {
        let a = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 4.0)]).unwrap();
        let mut factor = solver.analyze(a.symbolic(), &[0]).unwrap();
        factor.factorize(a.as_ref()).unwrap();
        let mut x = [1.0];
        factor.solve(&mut x).unwrap();
        (x[0], solver.spans_ranks())
    }
    let (log, all) = (Log::default(), methods("linear_solver.rs", "LinearSolver"));
    let bare = answers(Solver(log.clone()));
    compare(&log, &all, &bare, &bare, "bare");
    compare(&log, &all, &bare, &answers(Box::new(Solver(log.clone()))), "Box<L>");
    let chosen: Box<dyn LinearSolver<f64>> = Box::new(Solver(log.clone()));
    compare(&log, &all, &bare, &answers(chosen), "Box<dyn LinearSolver>");
}

#[derive(Clone, Debug)]
struct Recorder(Log);

impl Observer<f64> for Recorder {
    fn observe(&mut self, step: &StepView<'_, f64>) -> Result<Control> {
        self.0.note("observe");
        assert!(step.energy.is_some(), "its wish was lost");
        Ok(if step.statistics.steps == 3 { Control::Stop } else { Control::Continue })
    }
    fn wants(&self) -> Wants {
        self.0.note("wants");
        Wants::Energy
    }
}

#[test]
fn pointers_to_observers() {
    fn answers(mut observer: impl Observer<f64>) -> (f64, u64) {
        let spring = SparseColMat::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)]).unwrap();
        let system = LinearSystem::lumped(vec![1.0], spring).unwrap();
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.1).build().unwrap();
        run.run_until(1.0, &mut observer).unwrap();
        (run.time(), run.statistics().steps)
    }
    let (log, all) = (Log::default(), methods("observer.rs", "Observer"));
    let bare = answers(Recorder(log.clone()));
    compare(&log, &all, &bare, &bare, "bare");
    compare(&log, &all, &bare, &answers(Recorder(log.clone()).by_ref()), "&mut dyn Observer");
    let chosen: Box<dyn Observer<f64>> = Box::new(Recorder(log.clone()));
    compare(&log, &all, &bare, &answers(chosen), "Box<dyn Observer>");
    compare(&log, &all, &bare, &answers((Recorder(log.clone()), ())), "(A, B)");
    compare(&log, &all, &bare, &answers(((), Recorder(log.clone()).by_ref())), "(A, &mut dyn Observer)");
}
