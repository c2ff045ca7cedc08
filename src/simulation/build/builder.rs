//! Builds a simulation: checks every input, compiles the tableau, finds the initial accelerations.

#[cfg(doc)]
use crate::analysis;
#[cfg(doc)]
use crate::contact::ContactLaw;
use crate::contact::{ContactConstraint, ContactJacobian};
use crate::contact_solver::{ActiveSet, ContactSolver};
use crate::corrector::Corrector;
use crate::error::{Error, Result, positive};
use crate::integrator::TimeIntegrator;
use crate::linear_solver::{Automatic, LinearSolver};
use crate::mass;
use crate::ranks::{AgreedSolver, AgreedSystem, Together, check_alike, check_interface, check_owned};
use crate::real::Real;
use crate::simulation::build::law_support::{LawSupport, ListedCorrector};
use crate::simulation::build::pairing::{
    check_corrections, check_lagged_damping, check_massless, check_path, default_corrections, local_error,
};
use crate::simulation::build::program::{Compiled, Compiler, Program};
use crate::simulation::build::scheme::Scheme;
use crate::simulation::build::workspace::Workspace;
use crate::simulation::operator::responses::Unit;
use crate::simulation::operator::tangent::At;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::run::results::Statistics;
use crate::simulation::run::{Monitors, Parts, Simulation};
use crate::simulation::stage::newton::{Newton, NewtonWork};
use crate::simulation::stage::path::PathWork;
use crate::simulation::stage::supports::put_initial_supports;
use crate::simulation::start::rate_check::RateCheck;
use crate::simulation::start::resumed::Resumed;
use crate::simulation::start::{self, Begun, InitialOverclosure, Origin, Start};
use crate::simulation::step::judge::{Judge, StepControl};
use crate::simulation::watch::energy::Ledger;
use crate::simulation::watch::stability::{self, StepLimit};
use crate::simulation::watch::stiffening::Stiffening;
use crate::state::{Clock, History, Motion, State};
use crate::system::{self, Linearity, System, check_step_size, check_vector};
use crate::tableau::StartUp;

/// Collects the parts of a [`Simulation`]; [`build`](Self::build) checks them together.
pub struct SimulationBuilder<'a, T: Real> {
    system: Box<dyn System<T> + 'a>,
    integrator: Box<dyn TimeIntegrator + 'a>,
    h: f64,
    constraints: Vec<Box<dyn ContactConstraint<T> + 'a>>,
    contact_solver: Box<dyn ContactSolver<T> + 'a>,
    correctors: Vec<Box<dyn Corrector<T> + 'a>>,
    /// Whether the default correctors are added.
    corrects_by_default: bool,
    linear_solver: Box<dyn LinearSolver<T> + 'a>,
    initial: InitialState<T>,
    pub(crate) resumed: Option<Resumed<T>>,
    settings: Settings,
}

/// The state from which a run starts.
struct InitialState<T> {
    t: f64,
    u: Option<Vec<T>>,
    v: Option<Vec<T>>,
    overclosure: InitialOverclosure,
    is_at_rest: bool,
}

/// Settings of the steps.
struct Settings {
    start_up: StartUp,
    newton: Option<Newton>,
    control: Option<StepControl>,
    /// Whether the works of the energy balance are accumulated.
    balances_energy: bool,
    /// Whether the step size is compared with the stability limit of the scheme.
    checks_stability: bool,
}

impl<T: Real> std::fmt::Debug for SimulationBuilder<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SimulationBuilder")
            .field("integrator", &self.integrator)
            .field("h", &self.h)
            .field("constraints", &self.constraints.len())
            .field("correctors", &self.correctors)
            .finish_non_exhaustive()
    }
}

impl<'a, T: Real> Simulation<'a, T> {
    /// Begins a simulation of `system` by `integrator` with step size `h`; everything else is optional.
    pub fn builder(
        system: impl System<T> + 'a,
        integrator: impl TimeIntegrator + 'a,
        h: f64,
    ) -> SimulationBuilder<'a, T> {
        SimulationBuilder::new(Box::new(system), Box::new(integrator), h)
    }
}

impl<'a, T: Real> SimulationBuilder<'a, T> {
    fn new(system: Box<dyn System<T> + 'a>, integrator: Box<dyn TimeIntegrator + 'a>, h: f64) -> Self {
        Self {
            system,
            integrator,
            h,
            constraints: Vec::new(),
            contact_solver: Box::new(ActiveSet::default()),
            correctors: Vec::new(),
            corrects_by_default: true,
            linear_solver: Box::new(Automatic),
            initial: InitialState {
                t: 0.0,
                u: None,
                v: None,
                overclosure: InitialOverclosure::Refused,
                is_at_rest: false,
            },
            resumed: None,
            settings: Settings {
                start_up: StartUp::default(),
                newton: None,
                control: None,
                balances_energy: false,
                checks_stability: true,
            },
        }
    }

    /// Time at the start; 0 by default.
    #[must_use]
    pub fn start_time(mut self, t: f64) -> Self {
        self.initial.t = t;
        self
    }

    /// Initial displacements, one a dof; zero by default. Prescribed dofs may be left at zero.
    #[must_use]
    pub fn displacement(mut self, u: Vec<T>) -> Self {
        self.initial.u = Some(u);
        self
    }

    /// Initial velocities, one a dof; zero by default. Prescribed dofs may be left at zero.
    #[must_use]
    pub fn velocity(mut self, v: Vec<T>) -> Self {
        self.initial.v = Some(v);
        self
    }

    /// Adds a contact constraint; any number may be added.
    #[must_use]
    pub fn constraint(mut self, constraint: impl ContactConstraint<T> + 'a) -> Self {
        self.constraints.push(Box::new(constraint));
        self
    }

    /// Adds a list of contact constraints, as [`BodyContact`](crate::contact::BodyContact) makes it.
    #[must_use]
    pub fn constraints(mut self, constraints: impl IntoIterator<Item = Box<dyn ContactConstraint<T> + 'a>>) -> Self {
        self.constraints.extend(constraints);
        self
    }

    /// Chooses the solver of the contact problems; [`ActiveSet`] by default.
    #[must_use]
    pub fn contact_solver(mut self, solver: impl ContactSolver<T> + 'a) -> Self {
        self.contact_solver = Box::new(solver);
        self
    }

    /// Disables all correctors, the default ones included. Contact forces then spike at impact, and velocities
    /// oscillate: the trapezoidal rule may end the fall of a block with many times its energy. For comparisons, and
    /// for studies of the schemes themselves.
    #[must_use]
    pub fn uncorrected(mut self) -> Self {
        self.correctors.clear();
        self.corrects_by_default = false;
        self
    }

    /// Adds a corrector. Several act in the order given, and replace the default ones:
    ///
    /// * [`PersistencyCorrection::with_history_projection`](crate::PersistencyCorrection::with_history_projection),
    ///   where contact is rigid, on dofs with mass, and imposed on the displacements of the state;
    /// * [`WorkBalance`](crate::corrector::WorkBalance), where contact dofs have no mass and the scheme conserves
    ///   energy.
    ///
    /// Contact on velocities or ahead of the state leaves nothing to correct. Compliant laws,
    /// [`ContactLaw::RateCondition`] and [`ContactLaw::PersistencySwitch`] suppress oscillation by themselves.
    #[must_use]
    pub fn corrector(mut self, corrector: impl Corrector<T> + 'a) -> Self {
        self.corrects_by_default = false;
        self.correctors.push(Box::new(corrector));
        self
    }

    /// Adds correctors chosen at run time: any number, for instance an `Option`. If there are none, contact is left
    /// [uncorrected](Self::uncorrected).
    #[must_use]
    pub fn correctors(mut self, correctors: impl IntoIterator<Item = Box<dyn Corrector<T> + 'a>>) -> Self {
        self.corrects_by_default = false;
        self.correctors.extend(correctors);
        self
    }

    /// Chooses the linear solver; [`Automatic`] by default.
    #[must_use]
    pub fn linear_solver(mut self, solver: impl LinearSolver<T> + 'a) -> Self {
        self.linear_solver = Box::new(solver);
        self
    }

    /// Chooses how a multistep scheme computes its past; [`StartUp::Trapezoidal`] by default. One-step schemes need
    /// none.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{Composite, LinearSystem, Simulation, StartUp};
    ///
    /// // A stiff spring that is released out of equilibrium.
    /// let run = |start_up| {
    ///     let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1e6)])?;
    ///     let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, Composite, 0.1)
    ///         .displacement(vec![1.0])
    ///         .start_up(start_up)
    ///         .build()?;
    ///     run.step()?;
    ///     Ok::<_, Box<dyn std::error::Error>>(run.state().velocity()[0].abs() / 1e3)
    /// };
    /// assert!(run(StartUp::Taylor)? > 20.0); // Ω/4 times ω u₀: the expansion knows nothing of the oscillation
    /// assert!(run(StartUp::Trapezoidal)? < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn start_up(mut self, start_up: StartUp) -> Self {
        self.settings.start_up = start_up;
        self
    }

    /// Settings of Newton's method; [`Newton::full`] by default for nonlinear systems. A linear system needs none.
    #[must_use]
    pub fn newton(mut self, newton: Newton) -> Self {
        self.settings.newton = Some(newton);
        self
    }

    /// Lets the run control its step size. Without this every step has the size given, and the error of a failed step
    /// is returned.
    #[must_use]
    pub fn step_control(mut self, control: StepControl) -> Self {
        self.settings.control = Some(control);
        self
    }

    /// Accumulates the works of the energy balance ([`Energy::works`](crate::Energy::works)). Each step costs a load
    /// and a product with C, with supports one evaluation of f, with contacts their gaps and rates once more.
    #[must_use]
    pub fn energy_balance(mut self) -> Self {
        self.settings.balances_energy = true;
        self
    }

    /// Chooses how overlaps of bodies at the start are treated; [`InitialOverclosure::Refused`] by default.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, InitialOverclosure, LinearRows, LinearSystem};
    /// use contact_dynamics::Simulation;
    ///
    /// // A mass on a spring at rest, 1e-3 deep in a wall.
    /// let start = |overclosure| {
    ///     let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 9.0)])?;
    ///     let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, GeneralizedAlpha::default(), 0.01)
    ///         .constraint(LinearRows::new().unilateral(&[(0, 1.0)], -1e-3))
    ///         .initial_overclosure(overclosure)
    ///         .build()?;
    ///     run.run_until(1.0, &mut ())?;
    ///     Ok::<f64, Box<dyn std::error::Error>>(run.state().displacement()[0])
    /// };
    /// assert!(start(InitialOverclosure::Refused).is_err());
    /// assert_eq!(start(InitialOverclosure::AdjustedGaps)?, 0.0); // it stays where it is
    /// assert!((start(InitialOverclosure::RemovedOver(0.5))? - 1e-3).abs() < 1e-12); // it is pushed out
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn initial_overclosure(mut self, overclosure: InitialOverclosure) -> Self {
        self.initial.overclosure = overclosure;
        self
    }

    /// Starts at rest under the loads at the start time: from the displacements given (zero by default) the bodies
    /// are brought into static balance, f(u, 0) + Gᵀ λ = 0 with 0 ≤ g ⊥ λ ≥ 0, friction in its cone against the
    /// displacement from there, and springs by their laws. A load that is present at the start does not excite the
    /// run then.
    ///
    /// Bodies are the parts that K couples. A body that has a velocity, or whose own K is not positive definite
    /// because it flies freely, keeps the displacements and velocities given: a hammer may strike a structure under
    /// preload.
    ///
    /// Newton's method solves for the balance, with two factorizations of K for linear systems (one is stored at a
    /// time), and one contact problem on the rows that close. [`start_adjustment`](Simulation::start_adjustment)
    /// returns how far dofs have moved. Accelerations and contact forces are computed from that state as from any
    /// other.
    ///
    /// Refused at [`build`](Self::build): runs in which every body has a velocity, supports included; runs in which
    /// no body at rest has a positive definite K, such as a body held by contact only ([`Error::Singular`]); a
    /// balance that is not found, as for nonlinear systems far from it ([`Error::StartNotBalanced`]); systems over
    /// ranks. A [resumed](Self::resume) run has started already.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
    ///
    /// // Two masses on springs (k = 4, 1) in a row with a wall 0.1 behind the second one, the first pulled by 1.
    /// let entries = [(0, 0, 5.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)].map(|(i, j, k)| Triplet::new(i, j, k));
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &entries)?;
    /// let system = LinearSystem::lumped(vec![1.0; 2], k)?.load(|_, f| f[0] += 1.0);
    /// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 0.01)
    ///     .constraint(LinearRows::new().unilateral(&[(1, -1.0)], 0.1))
    ///     .start_at_rest()
    ///     .build()?;
    /// // 5 u₀ − u₁ = 1, u₁ = 0.1, and the wall presses with u₀ − u₁.
    /// run.run_until(1.0, &mut ())?;
    /// assert!((run.state().displacement()[0] - 0.22).abs() < 1e-14);
    /// assert!((run.state().contacts().forces()[0] - 0.12).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn start_at_rest(mut self) -> Self {
        self.initial.is_at_rest = true;
        self
    }

    /// Disables the stability check. Without this a scheme of order 0 or without zero-stability is refused, and so is
    /// a step beyond the stability limit of the scheme, here and in [`set_step_size`](Simulation::set_step_size).
    ///
    /// The limit is the critical Ω of the scheme ([`analysis::critical_omega`]) over the highest frequency of M⁻¹ K.
    /// The frequency is [`System::highest_frequency`]; without it the upper bound by Gershgorin's circles, if it
    /// admits the step; otherwise Lanczos' estimate, which is a lower bound. So a refused step is unstable, and an
    /// admitted step may exceed the limit by a fraction of a percent. A step at the limit itself is admitted: waves
    /// along a uniform bar are exact there, though the shortest grows linearly in time once it is excited.
    ///
    /// For nonlinear systems the tangent at the start is used (at the present state, for `set_step_size`). Systems
    /// that stiffen later, and compliant contacts, are checked in each step, which fails with [`Error::Stiffened`] if
    /// its frequency is beyond the limit. Damping is included if the scheme evaluates its forces before the step,
    /// also for bodies without stiffness. The highest mode is then assumed to have the strongest damping, which is
    /// exact for Rayleigh damping and otherwise may refuse a stable step. For an unsymmetric K only Gershgorin's
    /// circles are used.
    #[must_use]
    pub fn unchecked_stability(mut self) -> Self {
        self.settings.checks_stability = false;
        self
    }

    /// Continues from the state and history of another run of the same system, scheme and
    /// [step size](History::step_size), bit for bit. A run without [step control](Self::step_control) continues with
    /// that size at once, even if the other run had halved it. Initial values and start time given elsewhere are
    /// ignored. For files use `resume_from`, with the feature `serde`.
    #[must_use]
    pub fn resume(mut self, state: State<T>, history: History<T>) -> Self {
        self.resumed = Some(Resumed::new(state, history));
        self
    }

    /// Checks everything and builds.
    ///
    /// # Errors
    ///
    /// Any [`Error`] that names a wrong input: sizes, NaN, parameters, masses, supports, contact rows on missing or
    /// prescribed dofs, initial penetration, a singular effective matrix, parts that do not fit together.
    pub fn build(self) -> Result<Simulation<'a, T>> {
        let together = Together::new(self.system.ranks());
        let run = self.over_ranks(&together).and_then(|builder| builder.build_together(&together));
        let mut run = together.finish(run)?;
        // A run that controlled its step size may have ended between two steps of this one.
        if run.monitors.judge.is_none() {
            run.set_step_size(run.history.step_size())?;
        }
        Ok(run)
    }

    /// Wraps the parts of the host that are spread over ranks, if there are any.
    fn over_ranks(self, together: &Together<T>) -> Result<Self> {
        let Some(ranks) = self.system.ranks() else { return Ok(self) };
        together.agree(check_system(&*self.system).and_then(|dofs| check_owned(&*ranks, dofs)))?;
        let system = Box::new(AgreedSystem::new(self.system, together.clone())?);
        let linear_solver = Box::new(AgreedSolver::new(self.linear_solver, together.clone()));
        Ok(Self { system, linear_solver, ..self })
    }

    #[expect(clippy::too_many_lines, reason = "the parts of a run, one after the other")]
    fn build_together(self, together: &Together<T>) -> Result<Simulation<'a, T>> {
        let Self { mut system, integrator, h, constraints, mut contact_solver, settings, .. } = self;
        let InitialState { t, u, v, overclosure, is_at_rest } = self.initial;
        check_step_size::<T>(h)?;
        check_times(t, overclosure)?;
        self.resumed.as_ref().map_or_else(|| Clock::new(t, h), Resumed::clock).check()?;
        let dofs = check_system(&*system)?;
        let tableau = integrator.tableau();
        tableau.check(&integrator.name())?;
        let listed = ListedCorrector::list(&self.correctors, &tableau);
        let support = LawSupport::of(&*integrator, &tableau, &*contact_solver, (&listed, self.corrects_by_default));
        check_lagged_damping(&*integrator, &tableau, &mut *system)?;
        let scheme = Scheme::new(integrator, tableau, settings.start_up);
        let [mut u, mut v] = initial_motion(together, [u, v], dofs)?;

        let massless = massless_dofs(&*system, together)?;
        let follows = check_massless(&scheme, massless.first())?;
        let fits = |resumed: Resumed<T>| resumed.checked(&scheme, h, [dofs, massless.len()]);
        let resumed = self.resumed.map(fits).transpose()?;
        let (begin, broken) = if let Some((state, _)) = &resumed {
            ((state.motion.t, &state.motion.u[..], &state.motion.v[..]), &state.broken[..])
        } else {
            put_initial_supports(&mut *system, t, &mut u, &mut v)?;
            ((t, &u[..], &v[..]), &[][..])
        };
        let (mut constraints, mut g) = Constraints::new(constraints, begin, system.prescribed(), broken, support)?;
        let alike = ["the step size", "the start time", "the number of contact dofs"];
        check_alike(together, alike, [h, begin.0, constraints.interface().len() as f64])?;
        check_interface(together, dofs, constraints.interface())?;
        if settings.checks_stability {
            stability::check_scheme(&scheme)?;
        }
        if constraints.may_press() {
            check_corrections(&*scheme.integrator, &scheme.tableau, &mut *system, &listed)?;
        }
        let mut projection = start::projection(&*system, &constraints, (together, &*self.linear_solver))?;
        let is_smooth = listed.iter().any(|corrector| corrector.effects.leaves_smooth_motion);
        let is_resumed = resumed.is_some();
        let begun = if let Some((state, history)) = resumed {
            find_resumed_contacts(&mut constraints, &mut g, (&scheme, system.prescribed()), (&state, &history))?;
            Begun { state, history, adjustment: None }
        } else {
            let start = Start {
                system: &mut *system,
                contact_solver: &mut *contact_solver,
                constraints: &mut constraints,
                g: &mut g,
                projection: &mut projection,
                scheme: &scheme,
                together,
                h,
                massless: &massless,
                origin: Origin::Initial { overclosure, is_at_rest },
                is_smooth,
            };
            start.begin(Motion { t, a: vec![T::zero(); dofs], u, v })?
        };
        let Begun { state, history, adjustment } = begun;
        check_alike(together, ["the number of contact rows"], [constraints.len() as f64])?;
        let mut correctors = self.correctors;
        if self.corrects_by_default {
            correctors.extend(default_corrections(&scheme.tableau, &constraints, &massless));
        }
        let limit = match settings.checks_stability {
            false => StepLimit::Unchecked,
            true => step_limit((&mut *system, together), &scheme, (&state.motion, history.clock.h), is_resumed)?,
        };

        let (interface, unit) = (constraints.interface(), Unit::of(&constraints));
        let (at, h) = (At::state(&state.motion), history.clock.h);
        let mut compiler = Compiler { system: &mut *system, solver: &*self.linear_solver, h, at, interface, unit };
        let program = compiler.compile(&scheme.tableau)?;
        let is_known = history.known == scheme.depth;
        let startup = (!is_known).then(|| compiler.start(&scheme.derived.starter, &scheme.tableau)).transpose()?;
        let factorizations = program.operators.len() + startup.as_ref().map_or(0, |program| program.operators.len());
        let slots = history.slots.len();
        let rows = (&constraints, &g);
        let mut work = Workspace::new(&mut *system, &program, &correctors, projection, rows, slots);
        let follower = follows.then(|| scheme.integrator.name());
        work.keep_massless(massless, (&mut *system, together), (&program, follower), &state.motion, interface)?;
        work.newton = newton(settings.newton, &mut *system, &scheme, &program, &state.motion)?;
        work.rates = scheme.rates(&state.motion);
        work.stiffening = (settings.checks_stability && together.is_alone())
            .then(|| Stiffening::of(&*system, &scheme, constraints.may_press()))
            .flatten();
        let parts = (together, &*self.linear_solver);
        let ledger = settings
            .balances_energy
            .then(|| Ledger::new(&mut *system, parts, &state, (&constraints, &g)))
            .transpose()?
            .map(Box::new);
        let judge =
            settings.control.map(|control| judge(control, &scheme, constraints.may_press(), dofs)).transpose()?;
        let linear_solver = self.linear_solver;
        Ok(Simulation {
            parts: Parts { system, contact_solver, correctors, linear_solver, together: together.clone() },
            constraints,
            g,
            scheme,
            compiled: Compiled { program, startup, h },
            state,
            history,
            work,
            monitors: Monitors { limit, ledger, judge },
            adjustment,
            poisoned: false,
            statistics: Statistics { factorizations: factorizations as u64, ..Statistics::default() },
        })
    }
}

/// Initial displacements and velocities as given, or zero; on ranks the values of their owners.
fn initial_motion<T: Real>(together: &Together<T>, given: [Option<Vec<T>>; 2], dofs: usize) -> Result<[Vec<T>; 2]> {
    let names = ["the initial displacement", "the initial velocity"];
    let mut motion = given.map(|values| values.unwrap_or_else(|| vec![T::zero(); dofs]));
    let sound = names.into_iter().zip(&motion).try_for_each(|(what, values)| check_vector(what, values, dofs));
    together.agree(sound)?;
    motion.iter_mut().try_for_each(|values| together.share(values))?;
    Ok(motion)
}

/// Finds the rows of the state that a run continues from, and checks that they fit.
fn find_resumed_contacts<T: Real>(
    constraints: &mut Constraints<'_, T>,
    g: &mut ContactJacobian<T>,
    (scheme, prescribed): (&Scheme<'_>, &[usize]),
    (state, history): (&State<T>, &History<T>),
) -> Result<()> {
    let h = history.clock.h;
    constraints.search(&state.motion, scheme.ahead() * h, g)?;
    constraints.check_rows(g, prescribed, state.motion.t, &state.motion.u)?;
    if let Some(overclosures) = &history.overclosures {
        constraints.offsets.adjust(overclosures.clone(), &constraints.ids);
    }
    // A past that is resampled at once is projected onto gaps as the last step has measured them.
    constraints.keep_depths(&state.motion, 0.0)?;
    RateCheck::new(constraints.len()).check(constraints, &state.motion, h, g)
}

/// The largest step known to be stable. If the host does not admit the tangent of a resumed state, the step size is
/// accepted: explicit steps read no tangent.
fn step_limit<T: Real>(
    (system, together): (&mut dyn System<T>, &Together<T>),
    scheme: &Scheme<'_>,
    (motion, h): (&Motion<T>, f64),
    is_resumed: bool,
) -> Result<StepLimit> {
    match stability::check_step((system, together), scheme, motion, h) {
        Err(error) if is_resumed && error.is_recoverable() => {
            together.caught();
            Ok(StepLimit::Cleared(h))
        }
        found => found,
    }
}

/// The free dofs without mass. They are refused over ranks, none of which has all of their stiffness.
fn massless_dofs<T: Real>(system: &dyn System<T>, together: &Together<T>) -> Result<Vec<usize>> {
    let mut massless = mass::massless(system.mass(), system.prescribed());
    massless.retain(|&dof| together.owns(dof));
    if together.is_alone() || together.max(Ok([massless.len() as f64]))? == [0.0] {
        return Ok(massless);
    }
    let reason = "it has dofs without mass, which runs over ranks do not take: give them some, as `Mass` lumps it";
    Err(Error::Incompatible { part: "the mass".into(), reason })
}

fn check_times(t: f64, overclosure: InitialOverclosure) -> Result<()> {
    if let InitialOverclosure::RemovedOver(time) = overclosure {
        positive("the time over which overclosures are removed", time)?;
    }
    match t.is_finite() {
        true => Ok(()),
        false => Err(Error::Parameter { name: "the start time", value: t, range: "finite" }),
    }
}

/// Memory of Newton's method: for nonlinear systems, and for runs with settings of it.
fn newton<T: Real>(
    settings: Option<Newton>,
    system: &mut dyn System<T>,
    scheme: &Scheme<'_>,
    program: &Program<T>,
    motion: &Motion<T>,
) -> Result<Option<Box<NewtonWork<T>>>> {
    let linearity = system.linearity();
    if settings.is_none() && linearity == Linearity::Linear {
        return Ok(None);
    }
    let along_path = program.stages.iter().any(|stage| stage.along_path) && linearity == Linearity::Nonlinear;
    if along_path {
        check_path(system, scheme, motion)?;
    }
    let dofs = motion.u.len();
    let path = along_path.then(|| PathWork::new(dofs));
    Ok(Some(Box::new(NewtonWork::new(settings.unwrap_or_default(), dofs, path))))
}

/// The judge of the steps of a run that controls them.
fn judge<T: Real>(control: StepControl, scheme: &Scheme<'_>, may_press: bool, dofs: usize) -> Result<Judge<T>> {
    let local = control.estimates().then(|| local_error(scheme, may_press)).transpose()?;
    Ok(Judge::new(control, local, dofs))
}

/// Sizes and supports of a host's system.
fn check_system<T: Real>(system: &dyn System<T>) -> Result<usize> {
    let dofs = system::check_sizes(system)?;
    let prescribed = system.prescribed();
    if let Some(&dof) = prescribed.iter().find(|&&dof| dof >= dofs) {
        return Err(Error::MissingDof { what: "a support", dof, dofs });
    }
    match prescribed.windows(2).find(|pair| pair[0] >= pair[1]) {
        Some(pair) if pair[0] == pair[1] => Err(Error::RepeatedDof { what: "the list of supports", dof: pair[0] }),
        Some(_) => Err(Error::Incompatible { part: "the system".into(), reason: "its prescribed dofs must ascend" }),
        None => Ok(dofs),
    }
}
