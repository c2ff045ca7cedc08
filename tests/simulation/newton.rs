//! Newton's method: it solves linear systems as the direct solve does, converges quadratically, follows curved gaps,
//! and fails without leaving a trace.

use contact_dynamics::contact::{ContactLaw, GapFunction, Side, Sphere};
use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::tableau::{ContactLevel, Stage};
use contact_dynamics::{
    Bathe, CentralDifference, Composite, Corrector, DampingForce, EnergyMomentum, Error, GeneralizedAlpha, LinearRows,
    LinearSystem, Linearity, Mass, Newmark, Newton, NodesOnObstacle, PersistencyCorrection, Result, Simulation,
    SimulationBuilder, StartUp, StepControl, System, TangentWeights, TimeIntegrator,
};
use contact_dynamics_scenes::hosts::{self, Bare, Hooked};
use contact_dynamics_scenes::schemes::{Listed, all};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::matrix;
use contact_dynamics_scenes::{Bars, MassKind};

type Make = fn() -> Box<dyn TimeIntegrator>;

/// A point mass on a spring to the origin of the plane, with force k (l² − L²)/(2 L²) as that of a Green–Lagrange bar,
/// and on a dashpot whose force is c |v|² v.
struct Pendulum {
    mass: [f64; 2],
    axial: f64,
    length: f64,
    drag: f64,
    /// Grows with t.
    load: [f64; 2],
    /// Dofs that move with speed 1.
    supports: &'static [usize],
    pattern: SymbolicSparseColMat<usize>,
    /// Factor of the tangent: 1 is right.
    tangent: f64,
}

impl Pendulum {
    fn new(axial: f64) -> Self {
        let pattern = SymbolicSparseColMat::new_checked(2, 2, vec![0, 2, 4], None, vec![0, 1, 0, 1]);
        Self { mass: [10.0; 2], axial, length: 3.0, drag: 0.0, load: [0.0; 2], supports: &[], pattern, tangent: 1.0 }
    }

    fn place(&self, u: &[f64]) -> [f64; 2] {
        [self.length + u[0], u[1]]
    }

    fn strain(&self, [x, y]: [f64; 2]) -> f64 {
        0.5 * ((x * x + y * y) / self.length.powi(2) - 1.0)
    }
}

impl System<f64> for Pendulum {
    fn dofs(&self) -> usize {
        2
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        let place = self.place(u);
        let (tension, speed) = (self.axial * self.strain(place) / self.length, v[0] * v[0] + v[1] * v[1]);
        for i in 0..2 {
            out[i] = self.load[i] * t - tension * place[i] - self.drag * speed * v[i];
        }
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[f64], v: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        let place = self.place(u);
        let (tension, speed) = (self.axial * self.strain(place) / self.length, v[0] * v[0] + v[1] * v[1]);
        for i in 0..2 {
            for j in 0..2 {
                let unit = f64::from(u8::from(i == j));
                let stiffness = self.axial / self.length.powi(3) * place[i] * place[j] + tension * unit;
                let damping = self.drag * (speed * unit + 2.0 * v[i] * v[j]);
                out[2 * j + i] = self.tangent * (weights.stiffness * stiffness + weights.damping * damping);
            }
        }
        Ok(())
    }
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<f64>> {
        match self.drag == 0.0 {
            true => None,
            false => Some(self),
        }
    }
    fn external_load(&mut self, t: f64, out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.load.map(|load| load * t));
        Ok(())
    }
    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        Some(0.5 * self.axial * self.length * self.strain(self.place(u)).powi(2))
    }
    fn prescribed(&self) -> &[usize] {
        self.supports
    }
    fn prescribed_motion(&mut self, t: f64, out: &mut [[f64; 3]]) -> Result<()> {
        out.fill([t, 1.0, 0.0]);
        Ok(())
    }
}

impl DampingForce<f64> for Pendulum {
    fn evaluate(&mut self, _: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        let speed = v[0] * v[0] + v[1] * v[1];
        out.copy_from_slice(&[self.drag * speed * v[0], self.drag * speed * v[1]]);
        Ok(())
    }
}

const VELOCITY: [f64; 2] = [-1.0, 7.0];

/// The pendulum at the time `until`, by the classical Runge–Kutta method with very small steps.
fn exact(mut pendulum: Pendulum, until: f64) -> [f64; 4] {
    let steps = 40_000;
    let h = until / f64::from(steps);
    let mut rate = |x: [f64; 4]| {
        let mut force = [0.0; 2];
        pendulum.force(0.0, &x[..2], &x[2..], &mut force).unwrap();
        [x[2], x[3], force[0] / 10.0, force[1] / 10.0]
    };
    let add = |x: [f64; 4], c: f64, k: [f64; 4]| std::array::from_fn(|i| x[i] + c * k[i]);
    (0..steps).fold([0.0, 0.0, VELOCITY[0], VELOCITY[1]], |x, _| {
        let k1 = rate(x);
        let k2 = rate(add(x, 0.5 * h, k1));
        let k3 = rate(add(x, 0.5 * h, k2));
        let k4 = rate(add(x, h, k3));
        std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    })
}

fn run(pendulum: Pendulum, scheme: Box<dyn TimeIntegrator>, h: f64) -> Simulation<'static, f64> {
    Simulation::builder(pendulum, scheme, h).velocity(VELOCITY.to_vec()).build().unwrap()
}

#[test]
fn a_linear_system_is_solved_as_by_the_direct_solve() {
    for scheme in all().into_iter().filter(Listed::takes_multipliers) {
        let bars = Bars::paper(10).delayed(0.3, 2e-3);
        let build = |nonlinear: bool, newton: Option<Newton>| {
            let system = bars.system::<f64>().rayleigh(0.0, 1e-5).unwrap();
            let corrector = PersistencyCorrection::with_history_projection();
            let corrector: Option<Box<dyn Corrector<f64>>> =
                if scheme.takes_corrections() { Some(Box::new(corrector)) } else { None };
            let system: Box<dyn System<f64>> =
                if nonlinear { Box::new(hosts::nonlinear(system)) } else { Box::new(system) };
            let builder = Simulation::builder(system, (scheme.make)(), 2e-3)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .correctors(corrector);
            match newton {
                Some(newton) => builder.newton(newton),
                None => builder,
            }
            .build()
            .unwrap()
        };
        let mut direct = build(false, None);
        let variants = [(true, None), (true, Some(Newton::modified().line_search())), (false, Some(Newton::full()))];
        let mut others: Vec<_> = variants.into_iter().map(|(nonlinear, newton)| build(nonlinear, newton)).collect();
        for step in 0..160 {
            direct.step().unwrap();
            for (which, run) in others.iter_mut().enumerate() {
                run.step().unwrap();
                let (one, other) = (direct.state(), run.state());
                let name = format!("{}, variant {which}, step {step}", scheme.name());
                close(one.displacement(), other.displacement(), 1e-9 * 0.01, &name);
                close(one.velocity(), other.velocity(), 1e-7 * 0.05, &name);
                close(one.contacts().forces(), other.contacts().forces(), 1e-6 * 0.0125, &name);
                assert_eq!(one.contacts().closed(), other.contacts().closed(), "{name}");
            }
        }
        // A linear force converges at once: a residual of rounding after the first iteration.
        let [nonlinear, _, linear] = &others[..] else { unreachable!() };
        let stages = (scheme.make)().tableau().stages.len() as u64;
        assert!(nonlinear.statistics().newton_iterations <= 2 * 161 * stages, "{}", scheme.name());
        assert_eq!(linear.statistics().factorizations, direct.statistics().factorizations);
    }
}

#[test]
fn compliant_laws_and_supports_are_those_of_the_direct_solve() {
    let laws = [
        ContactLaw::Penalty { stiffness: 20.0 },
        ContactLaw::PowerLaw { stiffness: 2e3, exponent: 1.5 },
        ContactLaw::Bipenalty { stiffness: 20.0, mass: 1e-3 },
        ContactLaw::AugmentedLagrangian { stiffness: 20.0, augmentations: 3 },
    ];
    for scheme in all() {
        for law in laws {
            for mass in [MassKind::Lumped, MassKind::Consistent] {
                let bars = Bars::paper(6).delayed(0.3, 2e-3).with_mass(mass);
                let last = bars.velocities::<f64>().len() - 1;
                let [left, right] = bars.contact_dofs();
                let system =
                    || bars.system::<f64>().drive(last, |t| [-0.05 * t - 0.1 * t * t, -0.05 - 0.2 * t, -0.2]).unwrap();
                let build = |nonlinear: bool| {
                    let system: Box<dyn System<f64>> =
                        if nonlinear { Box::new(hosts::nonlinear(system())) } else { Box::new(system()) };
                    Simulation::builder(system, (scheme.make)(), 2e-3)
                        .velocity(bars.velocities())
                        .constraint(LinearRows::new().row(law, &[(left, -1.0), (right, 1.0)], bars.gap))
                        .build()
                };
                let (mut direct, mut newton) = match (build(false), build(true)) {
                    (Ok(direct), Ok(newton)) => (direct, newton),
                    (Err(one), Err(other)) => {
                        assert_eq!(one.to_string(), other.to_string());
                        continue;
                    }
                    (one, other) => panic!("{:?} {:?}", one.map(drop), other.map(drop)),
                };
                for step in 0..100 {
                    direct.step().unwrap();
                    newton.step().unwrap();
                    let (one, other) = (direct.state(), newton.state());
                    let name = format!("{}, {law:?}, {mass:?}, step {step}", scheme.name());
                    close(one.displacement(), other.displacement(), 1e-8 * 0.01, &name);
                    close(one.velocity(), other.velocity(), 1e-6 * 0.05, &name);
                    close(one.contacts().forces(), other.contacts().forces(), 1e-5 * 0.0125, &name);
                }
                let reactions = [direct.reactions().unwrap(), newton.reactions().unwrap()];
                close(&reactions[0], &reactions[1], 1e-5 * 0.0125, &scheme.name());
            }
        }
    }
}

#[test]
fn single_precision_converges_to_its_own_rounding() {
    let bars = Bars::paper(20).delayed(0.3, 1e-3);
    let run = |system: Box<dyn System<f32>>| {
        Simulation::builder(system, Composite, 1e-3)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap()
    };
    let (mut direct, mut newton) = (run(Box::new(bars.system())), run(Box::new(hosts::nonlinear(bars.system()))));
    for _ in 0..400 {
        direct.step().unwrap();
        newton.step().unwrap();
        for (x, y) in direct.state().displacement().iter().zip(newton.state().displacement()) {
            assert!((x - y).abs() < 1e-4 * 0.02, "{x} {y}");
        }
    }
    assert!(newton.statistics().newton_iterations < 2 * 402);
}

/// Two masses of 1 on a spring between them with force e + e³, in single precision.
struct HardeningPair {
    pattern: SymbolicSparseColMat<usize>,
}

impl System<f32> for HardeningPair {
    fn dofs(&self) -> usize {
        2
    }
    fn mass(&self) -> Mass<'_, f32> {
        Mass::Lumped(&[1.0, 1.0])
    }
    fn force(&mut self, _: f64, u: &[f32], _: &[f32], out: &mut [f32]) -> Result<()> {
        let e = u[1] - u[0];
        let tension = e + e.powi(3);
        out.copy_from_slice(&[tension, -tension]);
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[f32], _: &[f32], weights: TangentWeights<f32>, out: &mut [f32]) -> Result<()> {
        let stiffness = weights.stiffness * (1.0 + 3.0 * (u[1] - u[0]).powi(2));
        out.copy_from_slice(&[stiffness, -stiffness, -stiffness, stiffness]);
        Ok(())
    }
}

/// Far from the origin increments are small beside the displacements long before they are rounding: an iteration that
/// converges slowly was ended there.
#[test]
fn what_converges_slowly_does_so_far_from_the_origin() {
    // A step of the trapezoidal rule from e = 0 and de/dt = v, with a = −2 (e + e³): e + h²/2 (e + e³) = h v.
    let (h, v): (f64, f64) = (2.0, 0.5);
    let exact = {
        let (mut least, mut most) = (0.0, h * v);
        for _ in 0..60 {
            let e: f64 = 0.5 * (least + most);
            if e + 0.5 * h * h * (e + e.powi(3)) < h * v { least = e } else { most = e }
        }
        least
    };
    for (newton, least) in [(Newton::modified(), 8), (Newton::full(), 3)] {
        for far in [0.0, 300.0] {
            let pattern = SymbolicSparseColMat::new_checked(2, 2, vec![0, 2, 4], None, vec![0, 1, 0, 1]);
            let mut run = Simulation::builder(HardeningPair { pattern }, Newmark::trapezoidal(), h)
                .newton(newton)
                .displacement(vec![far; 2])
                .velocity(vec![0.0, 0.5])
                .build()
                .unwrap();
            run.step().unwrap();
            let u = run.state().displacement();
            // (The tolerance in force, and rounding of u.)
            let error = (f64::from(u[1] - u[0]) - exact).abs();
            assert!(error < f64::from(f32::EPSILON) * (64.0 + 8.0 * f64::from(far)), "{newton:?} at {far}: {error:e}");
            assert!(run.statistics().newton_iterations >= least, "{}", run.statistics().newton_iterations);
        }
    }
}

#[test]
fn a_linear_body_follows_a_curved_obstacle() {
    let block = Solid::rectangle([1.0; 2], [6; 2], Material { young: 100.0, poisson: 0.3, density: 1.0 });
    let top: Vec<usize> = block.surface_nodes().into_iter().filter(|&n| block.nodes[n][1] > 0.99).collect();
    let run = |newton: Option<Newton>| {
        let ball = Sphere::new([-0.2, 1.35], 0.4, Side::Outside).unwrap();
        let contact = NodesOnObstacle::new(ball, &block.nodes, &block.node_dofs(), &top)
            .unwrap()
            .moving(|t| [[t, 0.0], [1.0, 0.0], [0.0; 2]]);
        let builder = Simulation::builder(block.system(), Composite, 0.02)
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection());
        let mut run = match newton {
            Some(newton) => builder.newton(newton),
            None => builder,
        }
        .build()
        .unwrap();
        let mut worst = 0.0_f64;
        while run.time() < 0.8 {
            run.step().unwrap();
            let center = [run.time() - 0.2, 1.35];
            for (row, &node) in top.iter().enumerate() {
                let u = &run.state().displacement()[2 * node..2 * node + 2];
                let [x, y] = [block.nodes[node][0] + u[0] - center[0], block.nodes[node][1] + u[1] - center[1]];
                let gap = x.hypot(y) - 0.4;
                let pressed = run.state().contacts().raw_forces()[row] > 0.0;
                worst = worst.max(if pressed { gap.abs() } else { -gap });
            }
        }
        (worst, *run.statistics())
    };
    for newton in [None, Some(Newton::full())] {
        let (worst, counts) = run(newton);
        assert!(worst < 1e-12, "{worst:e}");
        // The curvature costs contact problems, no factorization and no solve.
        assert_eq!((counts.factorizations, counts.linear_solves), (1, counts.steps));
        assert!(counts.contact_solves > counts.steps);
    }
}

fn close(one: &[f64], other: &[f64], tolerance: f64, name: &str) {
    for (i, (x, y)) in one.iter().zip(other).enumerate() {
        assert!((x - y).abs() <= tolerance, "{name}: entry {i} is {x:e} and {y:e}");
    }
}

#[test]
fn every_scheme_has_its_order_on_a_nonlinear_motion() {
    let pendulum = || Pendulum { drag: 0.02, ..Pendulum::new(2e3) };
    let until = 1.0;
    let reference = exact(pendulum(), until);
    for scheme in all() {
        let steps: f64 = if scheme.order == 1 { 4000.0 } else { 400.0 };
        let errors = [steps, 2.0 * steps].map(|steps| {
            let mut run = run(pendulum(), (scheme.make)(), until / steps);
            run.run_until(until, &mut ()).unwrap();
            let (u, v) = (run.state().displacement(), run.state().velocity());
            let in_u = (u[0] - reference[0]).hypot(u[1] - reference[1]);
            let in_v = (v[0] - reference[2]).hypot(v[1] - reference[3]);
            [in_u, in_v]
        });
        for (coarse, fine) in errors[0].iter().zip(errors[1]) {
            let order = (coarse / fine).log2();
            assert!((order - f64::from(scheme.order)).abs() < 0.15, "{}: order {order}, {fine:e}", scheme.name());
        }
    }
}

/// Exponents of the residuals of a step: quadratic convergence doubles them.
fn exponents(run: &Simulation<'_, f64>) -> Vec<f64> {
    run.convergence().iter().map(|iteration| -iteration.residual.log10()).collect()
}

#[test]
fn convergence_is_quadratic() {
    let schemes: [(Make, f64); 4] = [
        (|| Box::new(Composite), 0.16),
        (|| Box::new(Newmark::trapezoidal()), 0.16),
        (|| Box::new(Bathe::default()), 0.4),
        (|| Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()), 0.16),
    ];
    for (make, h) in schemes {
        let mut run = Simulation::builder(Pendulum { drag: 0.02, ..Pendulum::new(2e3) }, make(), h)
            .velocity(VELOCITY.to_vec())
            .newton(Newton::full().tolerances(1e-14, 1e-14).unwrap())
            .build()
            .unwrap();
        let mut seen = 0;
        for _ in 0..12 {
            run.step().unwrap();
            // r_{k+1} = C r_k²: the constant is the same for each pair above rounding.
            let residuals: Vec<f64> = run.convergence().iter().map(|it| it.residual).filter(|&r| r > 1e-13).collect();
            let constants: Vec<f64> = residuals.windows(2).map(|r| r[1] / (r[0] * r[0])).collect();
            for pair in constants.windows(2) {
                seen += 1;
                assert!((0.1..10.0).contains(&(pair[1] / pair[0])), "{}: {:?}", make().name(), exponents(&run));
            }
        }
        assert!(seen >= 5, "{}: {seen} pairs, {:?}", make().name(), exponents(&run));
    }
}

#[test]
fn a_modified_iteration_is_linear_and_finds_the_same() {
    let start = |newton| {
        Simulation::builder(Pendulum::new(2e3), Composite, 0.02)
            .velocity(VELOCITY.to_vec())
            .newton(newton)
            .build()
            .unwrap()
    };
    let (mut full, mut modified) = (start(Newton::full()), start(Newton::modified()));
    let mut searching = start(Newton::full().line_search());
    for _ in 0..200 {
        for run in [&mut full, &mut modified, &mut searching] {
            run.step().unwrap();
        }
    }
    for run in [&modified, &searching] {
        close(full.state().displacement(), run.state().displacement(), 1e-6, "displacement");
    }
    let [full, modified] = [&full, &modified].map(|run| *run.statistics());
    assert!(modified.newton_iterations > full.newton_iterations);
    // One factorization a step, and two when the scheme and its start were compiled.
    assert_eq!(modified.factorizations, 200 + 2);
    assert!(full.factorizations > modified.factorizations);
}

/// A pendulum inside a circle, on which it slides after the first contact.
fn sliding(scheme: Box<dyn TimeIntegrator>, h: f64, newton: Newton) -> Simulation<'static, f64> {
    let circle = Sphere::new([0.0, 0.0], 3.02, Side::Inside).unwrap();
    let contact = NodesOnObstacle::new(circle, &[[3.0, 0.0]], &[[0, 1]], &[0]).unwrap();
    Simulation::builder(Pendulum::new(200.0), scheme, h)
        .velocity(vec![2.0, 7.0])
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .newton(newton)
        .build()
        .unwrap()
}

#[test]
fn curved_gaps_are_met_where_the_step_ends() {
    let schemes: [Make; 5] = [
        || Box::new(Composite),
        || Box::new(Newmark::trapezoidal()),
        || Box::new(Bathe::default()),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
        || Box::new(EnergyMomentum),
    ];
    for make in schemes {
        let mut run = sliding(make(), 0.02, Newton::full());
        let (mut closed, mut deepest, mut most) = (0, 0.0_f64, 0);
        for _ in 0..200 {
            run.step().unwrap();
            let u = run.state().displacement();
            let gap = 3.02 - (3.0 + u[0]).hypot(u[1]);
            deepest = deepest.min(gap);
            if run.state().contacts().raw_forces()[0] > 0.0 {
                closed += 1;
                assert!(gap.abs() < 1e-12, "{}: pressed with a gap of {gap:e}", make().name());
                // The normal is that of the end of the step: velocity along it is removed.
                let v = run.state().velocity();
                let rate = ((3.0 + u[0]) * v[0] + u[1] * v[1]) / 3.02;
                assert!(rate.abs() < 1e-9, "{}: rate {rate:e}", make().name());
            }
            most = most.max(run.convergence().len());
        }
        assert!(closed > 20, "{}: {closed} pressed steps", make().name());
        assert!(deepest > -1e-12, "{}: {deepest:e}", make().name());
        assert!(most <= 5, "{}: {most} iterations", make().name());
    }
}

#[test]
fn contact_on_a_curved_obstacle_leaves_convergence_quadratic() {
    let mut run = sliding(Box::new(Composite), 0.1, Newton::full().tolerances(1e-14, 1e-14).unwrap());
    let mut seen = 0;
    for _ in 0..60 {
        run.step().unwrap();
        let residuals: Vec<f64> = run.convergence().iter().map(|it| it.residual).collect();
        if run.state().contacts().raw_forces()[0] > 0.0 {
            for r in residuals.windows(2) {
                seen += 1;
                assert!(r[1] < 10.0 * r[0] * r[0] + 1e-13, "{:?}", exponents(&run));
            }
        }
    }
    assert!(seen > 10, "{seen}");
}

#[test]
fn failures_say_what_happened_and_leave_no_trace() {
    // A tangent of the wrong sign.
    let mut run = run(Pendulum { tangent: -0.9, ..Pendulum::new(2e4) }, Box::new(Newmark::trapezoidal()), 0.08);
    let before = run.state().clone();
    match run.step() {
        Err(Error::IndefiniteTangent { iteration: 1.., .. } | Error::NewtonNotConverged { .. }) => {}
        other => panic!("{other:?}"),
    }
    assert_eq!(*run.state(), before);
    // One that is half of what it should be: too few iterations.
    let wrong = Pendulum { tangent: 0.5, drag: 0.02, ..Pendulum::new(2e3) };
    let mut run = Simulation::builder(wrong, Composite, 0.05)
        .velocity(VELOCITY.to_vec())
        .newton(Newton::full().iterations(3).unwrap())
        .build()
        .unwrap();
    let error = run.step().unwrap_err();
    assert!(error.is_recoverable());
    match &error {
        Error::NewtonNotConverged { t, h, iterations: 3, residual, increment, dof: 0 | 1 } => {
            assert_eq!([*t, *h].map(f64::to_bits), [0.0_f64, 0.05].map(f64::to_bits));
            let last = run.convergence()[2];
            assert_eq!([*residual, *increment].map(f64::to_bits), [last.residual, last.increment].map(f64::to_bits));
        }
        other => panic!("{other:?}"),
    }
    for (force, displacement) in [(0.0, 1e-8), (1e-9, 1.0), (f64::NAN, 0.1)] {
        assert!(matches!(Newton::full().tolerances(force, displacement), Err(Error::Parameter { .. })));
    }
    assert!(matches!(Newton::full().iterations(0), Err(Error::Parameter { .. })));
}

#[test]
fn a_system_without_energy_is_refused_by_the_conserving_scheme() {
    let plain = Bare::new(Pendulum::new(1e3));
    assert_eq!(System::<f64>::linearity(&plain), Linearity::Nonlinear);
    match Simulation::builder(plain, EnergyMomentum, 0.01).build() {
        Err(Error::Incompatible { part, .. }) => assert_eq!(part, "energy–momentum"),
        other => panic!("{:?}", other.map(drop)),
    }
}

/// A mass on a spring that yields: the plastic part of the elongation is history, which only accepted steps move.
struct Yielding {
    mass: [f64; 1],
    stiffness: f64,
    limit: f64,
    plastic: f64,
    pattern: SymbolicSparseColMat<usize>,
}

impl Yielding {
    fn elastic(&self, u: f64) -> f64 {
        self.stiffness * (u - self.plastic)
    }
}

impl System<f64> for Yielding {
    fn dofs(&self) -> usize {
        1
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out[0] = -self.elastic(u[0]).clamp(-self.limit, self.limit);
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        let elastic = self.elastic(u[0]).abs() < self.limit;
        out[0] = if elastic { weights.stiffness * self.stiffness } else { 0.0 };
        Ok(())
    }
    fn commit(&mut self, _: f64, u: &[f64], _: &[f64]) -> Result<()> {
        let force = self.elastic(u[0]).clamp(-self.limit, self.limit);
        self.plastic = u[0] - force / self.stiffness;
        Ok(())
    }
}

#[test]
fn history_variables_move_with_accepted_steps_only() {
    // Thrown with v: elastic until k u = Y, then decelerated by Y/m; it swings about the plastic elongation afterwards.
    let (stiffness, limit, v) = (100.0, 5.0, 2.0);
    let yielded: f64 = limit / stiffness;
    let rest = 0.5 * (v * v - stiffness * yielded * yielded) / limit;
    let schemes: [Make; 2] = [|| Box::new(Newmark::trapezoidal()), || Box::new(Bathe::default())];
    for make in schemes {
        let pattern = SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]);
        let mut host = Yielding { mass: [1.0], stiffness, limit, plastic: 0.0, pattern };
        let h = 1e-3;
        // Some steps are taken twice: the judgement must come before the history moves.
        let control = StepControl::halving(h / 8.0).unwrap().local_error(2e-9).unwrap();
        let mut run =
            Simulation::builder(&mut host, make(), h).velocity(vec![v]).step_control(control).build().unwrap();
        let mut turned = 0.0_f64;
        run.run_until(3.0, &mut |step: &contact_dynamics::StepView<'_, f64>| {
            turned = turned.max(step.state.displacement()[0]);
            contact_dynamics::Control::Continue
        })
        .unwrap();
        assert!(run.statistics().refused_steps > 0, "{}", make().name());
        let (u, v) = (run.state().displacement()[0], run.state().velocity()[0]);
        drop(run);
        assert!((turned - yielded - rest).abs() < 1e-4, "{}: {turned}", make().name());
        // It unloads elastically: amplitude Y/k about the plastic elongation, which is that of the first swing.
        assert!((host.plastic - rest).abs() < 1e-4, "{}: {} {rest}", make().name(), host.plastic);
        let amplitude = (u - host.plastic).hypot(v / stiffness.sqrt());
        assert!((amplitude / yielded - 1.0).abs() < 1e-3, "{}: {amplitude}", make().name());
    }
}

#[test]
fn the_corrected_force_is_that_of_the_balance() {
    // Where the balance holds at the state: M a = f(u, v) + Gᵀ p after the correction too, with the damping of the
    // corrected velocity and the normal at the end of the step; by schemes that read a to the order of h in that
    // damping.
    let schemes: [Make; 3] =
        [|| Box::new(Composite), || Box::new(Newmark::trapezoidal()), || Box::new(Bathe::default())];
    for make in schemes {
        let reads = make().tableau().read_after(0).unwrap().iter().any(|[.., a]| *a);
        let tolerance = if reads { 0.06 } else { 1e-5 };
        let circle = Sphere::new([0.0, 0.0], 3.02, Side::Inside).unwrap();
        let contact = NodesOnObstacle::new(circle, &[[3.0, 0.0]], &[[0, 1]], &[0]).unwrap();
        let host = || Pendulum { drag: 0.5, ..Pendulum::new(200.0) };
        let mut run = Simulation::builder(host(), make(), 0.02)
            .velocity(vec![2.0, 7.0])
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let mut closed = 0;
        for step in 0..100 {
            run.step().unwrap();
            let state = run.state();
            let (u, v, a) = (state.displacement(), state.velocity(), state.acceleration());
            let mut force = [0.0; 2];
            host().force(state.time(), u, v, &mut force).unwrap();
            let length = (3.0 + u[0]).hypot(u[1]);
            let p = state.contacts().forces()[0];
            closed += usize::from(state.contacts().raw_forces()[0] > 0.0);
            // The normal points to the center.
            for (i, x) in [3.0 + u[0], u[1]].into_iter().enumerate() {
                let miss = 10.0 * a[i] - force[i] + p * x / length;
                assert!(miss.abs() < tolerance, "{}, step {step}: {miss:e} of {:e}", make().name(), 10.0 * a[i]);
            }
        }
        assert!(closed > 5, "{closed}");
    }
}

#[test]
fn a_failed_step_leaves_the_rows_of_the_state() {
    // The host fails after some evaluations, when the row has followed the trial.
    let counter = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(usize::MAX));
    let circle = Sphere::new([0.0, 0.0], 3.02, Side::Inside).unwrap();
    let contact = NodesOnObstacle::new(circle, &[[3.0, 0.0]], &[[0, 1]], &[0]).unwrap();
    let pendulum = Pendulum { drag: 0.5, supports: &[1], ..Pendulum::new(200.0) };
    let calls = counter.clone();
    let host = Hooked::new(pendulum, move |method, _, _| {
        use std::sync::atomic::Ordering::Relaxed;
        if method == "force" && calls.fetch_sub(1, Relaxed) == 0 {
            calls.store(usize::MAX, Relaxed);
            return Err(Error::Inadmissible { callback: method, source: "now".into() });
        }
        Ok(())
    });
    let mut run = Simulation::builder(host, Composite, 0.05)
        .velocity(vec![2.0, 0.0])
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .unwrap();
    for _ in 0..10 {
        run.step().unwrap();
    }
    assert!(run.state().contacts().raw_forces()[0] > 0.0);
    // What is read of the state needs the rows there: the support bears its share of the contact force.
    run.restart().unwrap();
    let before = (run.state().clone(), run.reactions().unwrap());
    counter.store(1, std::sync::atomic::Ordering::Relaxed);
    assert!(matches!(run.step(), Err(Error::Inadmissible { .. })));
    assert_eq!((run.state().clone(), run.reactions().unwrap()), before);
    run.step().unwrap();
}

#[test]
fn the_conserving_scheme_books_loads_and_damping_exactly() {
    let host = || Pendulum { drag: 0.02, load: [20.0, -30.0], ..Pendulum::new(2e3) };
    let h = 0.05;
    let mut run = Simulation::builder(host(), EnergyMomentum, h)
        .velocity(VELOCITY.to_vec())
        .newton(Newton::full().tolerances(1e-13, 1e-12).unwrap().iterations(40).unwrap())
        .build()
        .unwrap();
    let mut before = (vec![0.0; 2], VELOCITY.to_vec(), run.energy().total());
    for step in 0..200 {
        let t = run.time() + 0.5 * h;
        run.step().unwrap();
        let energy = run.energy().total();
        let (u, v) = (run.state().displacement().to_vec(), run.state().velocity().to_vec());
        let moved = [u[0] - before.0[0], u[1] - before.0[1]];
        // v̄ = Δu/h, and the work of load and drag over the step is all that changes the energy.
        let speed = (moved[0] * moved[0] + moved[1] * moved[1]) / (h * h);
        let work: f64 = (0..2).map(|i| (host().load[i] * t - host().drag * speed * moved[i] / h) * moved[i]).sum();
        let miss = energy - before.2 - work;
        assert!(miss.abs() < 1e-9 * energy, "step {step}: {miss:e} of {work:e}");
        before = (u, v, energy);
    }
}

#[test]
fn contact_ahead_of_the_state_is_met_after_several_iterations() {
    // Explicit in the stiffness, implicit in a drag that is strong and not linear; the gap of the next state is imposed
    // now.
    let mut tried = 0;
    for scheme in all() {
        let stages = (scheme.make)().tableau().stages;
        let ahead =
            |stage: &Stage| matches!(stage.contact, ContactLevel::Position { lead } if (lead - 1.0).abs() < 1e-12);
        if stages.len() > 1 || !ahead(&stages[0]) || stages[0].balance.v.z == 0.0 {
            continue;
        }
        tried += 1;
        let host = Pendulum { drag: 5.0, ..Pendulum::new(200.0) };
        let mut run = Simulation::builder(host, (scheme.make)(), 0.01)
            .velocity(VELOCITY.to_vec())
            .constraint(LinearRows::new().unilateral(&[(1, -1.0)], 0.3))
            .newton(Newton::full().tolerances(1e-13, 1e-13).unwrap())
            .build()
            .unwrap();
        let (mut met, mut most, mut pressed) = (0, 0, false);
        for _ in 0..60 {
            run.step().unwrap();
            let gap = 0.3 - run.state().displacement()[1];
            if pressed {
                met += 1;
                assert!(gap.abs() < 1e-12, "{}: {gap:e}", scheme.name());
            }
            pressed = run.state().contacts().raw_forces()[0] > 0.0;
            most = most.max(run.convergence().len());
        }
        assert!(met > 3 && most > 2, "{}: {met} steps pressed, {most} iterations", scheme.name());
    }
    assert!(tried > 0);
}

/// A light mass on a spring whose force levels off, F atan u: Newton's method overshoots from far away.
struct Leveling {
    mass: [f64; 1],
    pattern: SymbolicSparseColMat<usize>,
    /// Times before this one are not admitted, nor elongations beyond a bound.
    begins: f64,
    bound: f64,
}

impl Leveling {
    fn new(mass: f64, begins: f64) -> Self {
        Self {
            mass: [mass],
            pattern: SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]),
            begins,
            bound: 1e300,
        }
    }
}

impl System<f64> for Leveling {
    fn dofs(&self) -> usize {
        1
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, t: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out[0] = -u[0].atan();
        match t < self.begins || u[0].abs() > self.bound {
            true => Err(Error::Inadmissible { callback: "force", source: "too early or too far".into() }),
            false => Ok(()),
        }
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out[0] = weights.stiffness / (1.0 + u[0] * u[0]);
        Ok(())
    }
}

#[test]
fn a_line_search_converges_where_full_increments_overshoot() {
    let run = |newton: Newton, bound: f64| {
        let host = Leveling { bound, ..Leveling::new(1e-6, 0.0) };
        let mut run = Simulation::builder(host, Newmark::new(0.5, 1.0).unwrap(), 1.0)
            .displacement(vec![5.0])
            .newton(newton)
            .start_up(StartUp::Taylor)
            .build()
            .unwrap();
        // Without acceleration at the start the prediction would be far away at once.
        let result = run.step();
        (result, run.state().displacement()[0], run.convergence().len())
    };
    assert!(matches!(
        run(Newton::full(), 1e300).0,
        Err(Error::NewtonNotConverged { .. } | Error::StepNotFinite { .. })
    ));
    let (result, u, iterations) = run(Newton::full().line_search(), 1e300);
    result.unwrap();
    assert!(u.is_finite() && iterations < 60, "{u} after {iterations}");
    // Neither does it go where the host cannot follow.
    let farthest = u.abs().max(5.0) + 1.0;
    assert!(matches!(run(Newton::full(), farthest).0, Err(Error::Inadmissible { .. })));
    let (result, same, _) = run(Newton::full().line_search(), farthest);
    result.unwrap();
    assert!((same - u).abs() < 1e-6 * u.abs().max(1.0), "{same} {u}");
}

#[test]
fn a_past_that_the_host_does_not_admit_is_not_free_flight() {
    // At rest in equilibrium: no acceleration, so the straight past is asked for, and refused.
    let mut run = Simulation::builder(Leveling::new(1.0, -1e-9), Composite, 0.1).velocity(vec![0.0]).build().unwrap();
    assert!(run.history().is_empty());
    run.run_until(1.0, &mut ()).unwrap();
}

#[test]
fn a_negative_stiffness_asks_for_smaller_steps() {
    /// A pencil on its tip: u'' = 100 sin u.
    struct Pencil(SymbolicSparseColMat<usize>);
    impl System<f64> for Pencil {
        fn dofs(&self) -> usize {
            1
        }
        fn mass(&self) -> Mass<'_, f64> {
            Mass::Lumped(&[1.0])
        }
        fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
            out[0] = 100.0 * u[0].sin();
            Ok(())
        }
        fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
            self.0.as_ref()
        }
        fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
            out[0] = -w.stiffness * 100.0 * u[0].cos();
            Ok(())
        }
    }
    let build = |h: f64, control: Option<StepControl>| {
        let pattern = SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]);
        let builder = Simulation::builder(Pencil(pattern), Newmark::trapezoidal(), h).displacement(vec![1e-3]);
        match control {
            Some(control) => builder.step_control(control),
            None => builder,
        }
        .build()
        .unwrap()
    };
    // 4/h² < 100: no step of that size has a solution that is stable.
    let mut run = build(0.25, None);
    assert!(matches!(run.step(), Err(Error::IndefiniteTangent { iteration: 1, dof: 0, .. })));
    let mut run = build(0.25, Some(StepControl::halving(1e-4).unwrap().local_error(1e-7).unwrap()));
    run.run_until(0.5, &mut ()).unwrap();
    // It falls as u₀ cosh 10 t at first.
    let exact = 1e-3 * 5.0_f64.cosh();
    assert!((run.state().displacement()[0] / exact - 1.0).abs() < 0.01, "{}", run.state().displacement()[0] / exact);
}

#[test]
fn gaps_that_never_stand_still_fail_the_step() {
    // Waves of the floor that a step flies over: where it ends its slope may be anything.
    let floor = |_: f64, x: &[f64], _: &[f64], gradient: &mut [f64]| {
        let phase = 200.0 * x[0];
        gradient.copy_from_slice(&[-20.0 * phase.cos(), 1.0]);
        [0.5 + x[1] - 0.1 * phase.sin(), 0.0, 0.0]
    };
    let zero = matrix(2, [(0, 0, 0.0)]);
    for newton in [None, Some(Newton::full())] {
        let mut refused = 0;
        for slide in 0..20 {
            let system = LinearSystem::lumped(vec![1.0; 2], zero.clone()).unwrap();
            let builder = Simulation::builder(system, Newmark::trapezoidal(), 1.0)
                .velocity(vec![0.1 * f64::from(slide), -1.0])
                .constraint(GapFunction::new(&[0, 1], floor))
                .uncorrected();
            let mut run = match newton {
                Some(newton) => builder.newton(newton),
                None => builder,
            }
            .build()
            .unwrap();
            let before = run.state().clone();
            if let Err(error) = run.step() {
                refused += 1;
                assert!(error.is_recoverable());
                let Error::ContactUnsettled { iterations: 48, change, tolerance, .. } = error else {
                    panic!("{error:?}")
                };
                assert!(change > 10.0 * tolerance, "{error}");
                assert_eq!(*run.state(), before);
            }
        }
        assert!(refused > 0);
    }
}

/// A mass on a spring whose host does not admit the state at a time in some of its methods.
fn refused_at(
    time: f64,
    methods: &'static [&'static str],
    scheme: impl TimeIntegrator + 'static,
) -> SimulationBuilder<'static, f64> {
    let spring = LinearSystem::lumped(vec![1.0], matrix(1, [(0, 0, 4.0)])).unwrap();
    let host =
        Hooked::new(spring, move |method, t, _| match methods.contains(&method) && t.to_bits() == time.to_bits() {
            true => Err(Error::Inadmissible { callback: method, source: "an element is turned inside out".into() }),
            false => Ok(()),
        });
    Simulation::builder(host.linearity(Linearity::Nonlinear), scheme, 0.25).energy_balance()
}

/// Takes three steps, to a state that the host does not admit, and three more, also from memory.
fn goes_on(builder: impl Fn() -> SimulationBuilder<'static, f64>) {
    let mut run = builder().displacement(vec![1.0]).build().unwrap();
    for _ in 0..3 {
        run.step().unwrap();
    }
    let mut other = builder().resume(run.state().clone(), run.history().clone()).build().unwrap();
    for _ in 0..3 {
        run.step().unwrap();
        other.step().unwrap();
        assert_eq!(run.state(), other.state());
    }
}

/// A host that does not admit a state, but every motion in which the scheme balances, ends no run there: neither the
/// one that comes by, nor one that goes on from it.
#[test]
fn a_run_goes_on_from_a_state_that_the_host_does_not_admit() {
    let implicit = || GeneralizedAlpha::chung_hulbert(0.5).unwrap();
    goes_on(|| refused_at(0.75, &["force", "tangent"], implicit()));
    // At the start accelerations come from the balance there: it is refused.
    let refused = refused_at(0.0, &["force", "tangent"], implicit()).displacement(vec![1.0]).build();
    assert!(matches!(refused, Err(Error::Inadmissible { callback: "force", .. })), "{:?}", refused.err());
}

/// Explicit steps read no tangent, though their limit is checked by it where a run begins.
#[test]
fn an_explicit_run_goes_on_from_a_state_without_a_tangent() {
    goes_on(|| refused_at(0.75, &["tangent"], CentralDifference));
    let refused = refused_at(0.0, &["tangent"], CentralDifference).displacement(vec![1.0]).build();
    assert!(matches!(refused, Err(Error::Inadmissible { callback: "tangent", .. })), "{:?}", refused.err());
}
