//! Explicit runs that become too stiff for their step: compliant contacts that close, systems that harden.

use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{
    CentralDifference, ContactLaw, Error, LinearRows, LinearSystem, Mass, Result, Simulation, StepControl, System,
    TangentWeights, analysis,
};
use contact_dynamics_scenes::schemes::{Listed, all};
use contact_dynamics_scenes::sparse::matrix;

/// Schemes that are stable up to a frequency, and Ω there.
fn conditional() -> impl Iterator<Item = (Listed, f64)> {
    all()
        .into_iter()
        .filter_map(|listed| analysis::critical_omega(&(listed.make)().tableau(), 0.0).map(|x| (listed, x)))
}

const STEP: f64 = 0.01;

/// A mass of 2 that flies at a wall and is pulled back to it.
fn mass_at_wall(listed: &Listed, law: ContactLaw, speed: f64) -> contact_dynamics::SimulationBuilder<'static, f64> {
    let system = LinearSystem::lumped(vec![2.0], matrix(1, [(0, 0, 0.0)])).unwrap().load(|_, f| f[0] = -1.0);
    let wall = LinearRows::new().row(law, &[(0, 1.0)], 0.1);
    Simulation::builder(system, (listed.make)(), STEP).velocity(vec![-speed]).constraint(wall)
}

/// Springs of contact are taken up to the limit of each scheme, and no further.
#[test]
fn penalties_are_taken_up_to_the_limit() {
    let mut schemes = 0;
    for (listed, critical) in conditional() {
        let name = listed.name();
        let stiffness = |share: f64| 2.0 * (share * critical / STEP).powi(2);
        let laws = |share: f64| {
            let stiffness = stiffness(share);
            [ContactLaw::Penalty { stiffness }, ContactLaw::AugmentedLagrangian { stiffness, augmentations: 2 }]
        };
        for share in [0.3, 0.9, 0.999] {
            for law in laws(share) {
                let mut run = mass_at_wall(&listed, law, 1.0).build().unwrap();
                run.run_until(400.0 * STEP, &mut ()).unwrap_or_else(|error| panic!("{name}, {share}: {error}"));
                assert!(run.statistics().contact_changes > 0, "{name}");
            }
        }
        for share in [1.001, 1.1, 10.0] {
            for law in laws(share) {
                let mut run = mass_at_wall(&listed, law, 1.0).build().unwrap();
                match run.run_until(400.0 * STEP, &mut ()) {
                    Err(Error::Stiffened { contact: Some(_), largest, frequency, .. }) => {
                        assert!((frequency / (share * critical / STEP) - 1.0).abs() < 1e-9, "{name}: {frequency}");
                        assert!((largest * frequency / critical - 1.0).abs() < 1e-6, "{name}: {largest}");
                    }
                    other => panic!("{name}, {share}: {other:?}"),
                }
                assert!(run.state().contacts().raw_forces()[0] == 0.0 && run.state().velocity()[0] < -0.9, "{name}");
                let mut free = mass_at_wall(&listed, law, 1.0).unchecked_stability().build().unwrap();
                free.run_until(0.2, &mut ()).unwrap();
                let control = StepControl::halving(1e-3 * STEP).unwrap();
                let mut controlled = mass_at_wall(&listed, law, 1.0).step_control(control).build().unwrap();
                controlled.run_until(0.2, &mut ()).unwrap();
                assert!(controlled.statistics().refused_steps > 0, "{name}");
            }
        }
        schemes += 1;
    }
    assert!(schemes >= 5, "{schemes}");
}

#[test]
fn the_error_says_what_to_do() {
    let wall = LinearRows::new().row(ContactLaw::Penalty { stiffness: 1e4 }, &[(0, 1.0)], 0.05);
    let system = LinearSystem::lumped(vec![1.0], matrix(1, [(0, 0, 0.0)])).unwrap();
    let builder = Simulation::builder(system, CentralDifference, 0.1).velocity(vec![-1.0]);
    let error = builder.constraint(wall).build().unwrap().run_until(1.0, &mut ()).unwrap_err();
    assert!(error.is_recoverable());
    assert_eq!(
        error.to_string(),
        "step from t = 0e0 with h = 1e-1: contact 0.0.0 is stiffer than central difference takes: the highest \
         frequency is now 1e2 (1/time) or more, and h may be about 2e-2; take smaller steps (`StepControl` does), a \
         softer contact law, or an implicit scheme (`SimulationBuilder::unchecked_stability` takes the step as it is)"
    );
}

/// A power law stiffens as it is pressed: slow impacts are taken, fast ones are not.
#[test]
fn power_laws_are_judged_by_their_present_compression() {
    for (listed, critical) in conditional() {
        let (name, exponent) = (listed.name(), 1.5);
        // At this depth its tangent has the critical frequency.
        let depth = 0.02_f64;
        let slope = 2.0 * (critical / STEP).powi(2);
        let stiffness = slope / (exponent * depth.powf(exponent - 1.0));
        let law = ContactLaw::PowerLaw { stiffness, exponent };
        let deepest = |speed: f64| {
            let mut run = mass_at_wall(&listed, law, speed).build().unwrap();
            let mut deepest = 0.0_f64;
            for _ in 0..200 {
                match run.step() {
                    Ok(()) => {
                        // The depth that belongs to the force: some schemes take it from before the end of the step.
                        let force = run.state().contacts().raw_forces()[0];
                        deepest = deepest.max((force / stiffness).powf(exponent.recip()));
                    }
                    Err(Error::Stiffened { .. }) => return (deepest, true),
                    Err(error) => panic!("{name}: {error}"),
                }
            }
            (deepest, false)
        };
        for i in 0..30 {
            let speed = 0.1 * 1.2_f64.powi(i);
            let (deepest, refused) = deepest(speed);
            assert!(deepest < 1.001 * depth, "{name}: {deepest}");
            // (A mass that has come to rest there has made its way in some steps.)
            assert!(!refused || speed * STEP > 0.2 * depth, "{name}: refused at {speed}");
            assert!(refused || speed * STEP < 4.0 * depth, "{name}: taken at {speed}");
        }
    }
}

/// That one contact is admissible says nothing of another with the same spring, on a mass that the mesh holds.
#[test]
fn each_contact_is_judged_with_what_holds_it() {
    // The limit is ω² = 400: neither 200 nor 300 is beyond it, but both are.
    let (contact, mesh) = (200.0, 300.0);
    let held = matrix(3, [(0, 0, 0.0), (1, 1, mesh), (2, 2, mesh), (1, 2, -mesh), (2, 1, -mesh)]);
    let system = LinearSystem::lumped(vec![1.0, 1.0, 1e3], held).unwrap();
    let law = ContactLaw::Penalty { stiffness: contact };
    let walls = LinearRows::new().row(law, &[(0, 1.0)], 0.05).row(law, &[(1, 1.0)], 0.55);
    let mut run =
        Simulation::builder(system, CentralDifference, 0.1).velocity(vec![-1.0; 3]).constraint(walls).build().unwrap();
    let error = run.run_until(2.0, &mut ()).unwrap_err();
    assert!(matches!(error, Error::Stiffened { contact: Some(id), .. } if id.feature == 1), "{error:?}");
    assert!(run.statistics().contact_changes >= 2 && run.time() > 0.35, "{}", run.time());
}

/// Neither the bar nor the spring at its end is beyond the limit, but both together are.
#[test]
fn meshes_and_contacts_are_judged_together() {
    let n = 20;
    let mass: Vec<f64> = (0..n).map(|i| if i == 0 || i + 1 == n { 0.5 } else { 1.0 }).collect();
    // ω = 2 without the contact.
    let stiffness = |at_end: f64| {
        let springs = (1..n).flat_map(|i| [(i - 1, i - 1, 1.0), (i, i, 1.0), (i - 1, i, -1.0), (i, i - 1, -1.0)]);
        matrix(n, springs.chain([(n - 1, n - 1, at_end)]))
    };
    for k in [0.3, 0.6, 1.0] {
        // The limit of the bar with the spring tied to it.
        let tied = LinearSystem::lumped(mass.clone(), stiffness(k)).unwrap();
        let Err(Error::BeyondStability { largest, .. }) = Simulation::builder(tied, CentralDifference, 1.5).build()
        else {
            panic!("{k}")
        };
        assert!(largest < 0.995 && largest * (2.0 * k).sqrt() < 2.0, "{k}: {largest}");
        let run = |h: f64| {
            let system = LinearSystem::lumped(mass.clone(), stiffness(0.0)).unwrap();
            let wall = LinearRows::new().row(ContactLaw::Penalty { stiffness: k }, &[(n - 1, -1.0)], 0.5);
            let velocity = vec![0.1; n];
            let mut run =
                Simulation::builder(system, CentralDifference, h).velocity(velocity).constraint(wall).build().unwrap();
            let outcome = run.run_until(3000.0 * h, &mut ());
            (outcome.map(drop), run.energy().total() / (0.005 * (n as f64 - 1.0)))
        };
        let (outcome, energy) = run(0.995 * largest);
        assert!(outcome.is_ok() && energy < 1.2, "{k}: {outcome:?}, {energy}");
        let (outcome, _) = run(1.01 * largest);
        match outcome {
            Err(Error::Stiffened { largest: told, .. }) => assert!((told / largest - 1.0).abs() < 1e-2, "{k}: {told}"),
            other => panic!("{k}: {other:?}"),
        }
    }
}

/// That a contact that presses is admissible with a step says nothing of a longer one.
#[test]
fn longer_steps_are_judged_anew() {
    // ω² = 2.618 without the contact, 3 with it; at most 3.618 by the sum of both.
    let system = || {
        let k = matrix(2, [(0, 0, 1.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 2.0)]);
        LinearSystem::lumped(vec![1.0; 2], k).unwrap().load(|_, f| f[0] = -1.0)
    };
    let [short, long] = [3.3_f64, 2.8].map(|square| 2.0 / square.sqrt());
    let mut run = Simulation::builder(system(), CentralDifference, short)
        .displacement(vec![-2.0 / 3.0, -1.0 / 3.0])
        .constraint(LinearRows::new().row(ContactLaw::Penalty { stiffness: 1.0 }, &[(0, 1.0)], 0.0))
        .build()
        .unwrap();
    (0..10).for_each(|_| run.step().unwrap());
    run.set_step_size(long).unwrap();
    match run.step() {
        Err(Error::Stiffened { frequency, largest, .. }) => {
            assert!((frequency - 3.0_f64.sqrt()).abs() < 1e-3, "{frequency}");
            assert!((largest * frequency - 2.0).abs() < 1e-6, "{largest}");
        }
        other => panic!("{other:?}"),
    }
    run.set_step_size(short).unwrap();
    (0..10).for_each(|_| run.step().unwrap());
}

/// Unit masses with f = −k₁ d − k₃ d³ between neighbors, the first on the ground; there is no tangent.
pub(crate) struct Hardening {
    mass: Vec<f64>,
    pattern: SymbolicSparseColMat<usize>,
    k1: f64,
    k3: f64,
    frequency: Option<fn(&[f64]) -> f64>,
    u: Vec<f64>,
    evaluations: u64,
}

impl Hardening {
    pub(crate) fn new(n: usize, k1: f64, k3: f64) -> Self {
        let pattern = SymbolicSparseColMat::new_checked(n, n, vec![0; n + 1], None, Vec::new());
        Self { mass: vec![1.0; n], pattern, k1, k3, frequency: None, u: vec![0.0; n], evaluations: 0 }
    }
}

impl System<f64> for Hardening {
    fn dofs(&self) -> usize {
        self.mass.len()
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        self.evaluations += 1;
        out.fill(0.0);
        let mut before = 0.0;
        for i in 0..u.len() {
            let d = u[i] - before;
            let pull = self.k1 * d + self.k3 * d * d * d;
            out[i] -= pull;
            if i > 0 {
                out[i - 1] += pull;
            }
            before = u[i];
        }
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, _: &[f64], _: &[f64], _: TangentWeights<f64>, _: &mut [f64]) -> Result<()> {
        unreachable!("there is none")
    }
    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        let before = std::iter::once(0.0).chain(u.iter().copied());
        let springs = before.zip(u).map(|(x, y)| (y - x) * (y - x));
        Some(springs.map(|square| 0.5 * self.k1 * square + 0.25 * self.k3 * square * square).sum())
    }
    fn highest_frequency(&mut self) -> Option<f64> {
        self.frequency.map(|frequency| frequency(&self.u))
    }
    fn commit(&mut self, _: f64, u: &[f64], _: &[f64]) -> Result<()> {
        self.u.copy_from_slice(u);
        Ok(())
    }
}

/// A mass on a spring, pressed to a wall: neither spring is beyond the limit, but both are, as is found by what grows.
#[test]
fn systems_that_may_stiffen_are_judged_with_the_contacts_that_press() {
    for (beyond, h) in [0.99_f64, 1.02].into_iter().flat_map(|beyond| [1e-3, 0.1, 10.0].map(|h| (beyond, h))) {
        let k = 0.5 * (2.0 * beyond / h).powi(2);
        let wall = LinearRows::new().row(ContactLaw::Penalty { stiffness: k }, &[(0, 1.0)], -20.0);
        let mut run = Simulation::builder(Hardening::new(1, k, 0.0), CentralDifference, h)
            .displacement(vec![10.0])
            .velocity(vec![1e-3 / h])
            .constraint(wall)
            .build()
            .unwrap();
        let outcome = run.run_until(600.0 * h, &mut ());
        match outcome {
            Ok(_) => assert!(beyond < 1.0 && (run.state().displacement()[0] - 10.0).abs() < 0.1, "{h}"),
            Err(Error::Stiffened { .. }) => {
                assert!(beyond > 1.0 && (run.state().displacement()[0] - 10.0).abs() < 5.0, "{h}");
            }
            Err(error) => panic!("{beyond} {h}: {error}"),
        }
    }
}

/// u″ = −u³ with amplitude A thrown from u = 0, where it has no stiffness: hA from resolved motions to absurd ones.
/// What is not refused keeps its energy, and what is resolved is not refused.
#[test]
fn springs_that_harden_do_not_grow_without_a_word() {
    for (listed, critical) in conditional() {
        let name = listed.name();
        for n in [1, 8] {
            let mut refused = 0;
            for i in 0..60 {
                let times = 0.05 * 1.1_f64.powi(i); // h A
                let (h, amplitude) = (0.1, times / 0.1);
                let mut velocity = vec![0.0; n];
                velocity[n - 1] = amplitude * amplitude / 2.0_f64.sqrt();
                let mut run =
                    Simulation::builder(Hardening::new(n, 1e-3 * amplitude * amplitude, 1.0), (listed.make)(), h)
                        .velocity(velocity)
                        .build()
                        .unwrap();
                let start = run.energy().total();
                let mut most = 0.0_f64;
                let outcome = (0..1500).try_for_each(|_| {
                    run.step()?;
                    most = most.max(run.energy().total() / start);
                    Ok::<(), Error>(())
                });
                match outcome {
                    Ok(()) => {
                        assert!(
                            most < 20.0,
                            "{name}, {n} dofs, hA = {times}: energy grows to {most} of that at the start"
                        );
                    }
                    // (Far beyond the limit numbers end before the step does.)
                    Err(Error::Stiffened { contact: None, .. } | Error::StepNotFinite { .. }) => {
                        assert!(times > 0.3 * critical, "{name}, {n} dofs: hA = {times} is refused");
                        refused += 1;
                    }
                    Err(error) => panic!("{name}, {n} dofs, hA = {times}: {error}"),
                }
            }
            assert!(refused >= 5, "{name}, {n} dofs: {refused}");
        }
    }
}

/// A first step that is far too long is refused however far it goes: also where the forces at u + ½ h² a, or the work
/// that they do, are beyond all numbers.
#[test]
fn steps_that_go_astray_at_once_are_refused() {
    for power in [3, 10, 20, 29, 40, 60, 72] {
        let system = Hardening::new(2, 1.0, 1.0);
        let speed = 10.0_f64.powi(power);
        let builder = Simulation::builder(system, CentralDifference, 0.1).velocity(vec![0.0, speed]);
        let mut run = builder.build().unwrap();
        let error = run.step().unwrap_err();
        assert!(matches!(error, Error::Stiffened { contact: None, .. }), "1e{power}: {error}");
        assert!(run.time() == 0.0 && run.state().velocity() == [0.0, speed]);
    }
}

/// A heavy mass (dof 0) that a constant force moves, and a spring of the third power with a light mass (dof 1).
struct Beside {
    mass: [f64; 2],
    push: f64,
    pattern: SymbolicSparseColMat<usize>,
    evaluations: u64,
}

impl Beside {
    fn new(heavy: f64, push: f64) -> Self {
        let pattern = SymbolicSparseColMat::new_checked(2, 2, vec![0, 1, 2], None, vec![0, 1]);
        Self { mass: [heavy, 1.0], push, pattern, evaluations: 0 }
    }

    /// Of the light mass.
    fn energy(u: &[f64], v: &[f64]) -> f64 {
        0.5 * v[1] * v[1] + 0.25 * u[1].powi(4)
    }
}

impl System<f64> for Beside {
    fn dofs(&self) -> usize {
        2
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        self.evaluations += 1;
        out.copy_from_slice(&[self.push, -u[1].powi(3)]);
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&[0.0, weights.stiffness * 3.0 * u[1] * u[1]]);
        Ok(())
    }
}

/// A light spring beside a heavy mass that a large force moves: a step twice beyond its limit ends in an error after a
/// few steps, and a resolved motion costs no check.
#[test]
fn large_forces_on_one_body_do_not_hide_another_that_is_unstable() {
    let h = 0.1;
    for (heavy, push) in [(1.0, 0.0), (1e6, 1e9)] {
        for (listed, critical) in conditional() {
            let name = listed.name();
            let amplitude = 2.0 * critical / h;
            let mut system = Beside::new(heavy, push);
            let mut run = Simulation::builder(&mut system, (listed.make)(), h)
                .velocity(vec![0.0, amplitude * amplitude / 2.0_f64.sqrt()])
                .build()
                .unwrap();
            let start = Beside::energy(run.state().displacement(), run.state().velocity());
            let mut most = 1.0_f64;
            let refused = (0..20).find_map(|_| {
                let error = run.step().err();
                most = most.max(Beside::energy(run.state().displacement(), run.state().velocity()) / start);
                error
            });
            assert!(matches!(refused, Some(Error::Stiffened { .. })), "{name}, {heavy:e}: {refused:?} {most:e}");
            assert!(most < 1e4 || push > 0.0, "{name}, {heavy:e}: {most:e}");
        }
    }
    // The light mass swings through equilibrium, where its acceleration grows from almost nothing, or hits a wall.
    for wall in [10.0, 0.3] {
        let evaluations = |checked: bool| {
            let mut system = Beside::new(1e6, 1e9);
            let builder = Simulation::builder(&mut system, CentralDifference, 0.02).velocity(vec![0.0, 1.0]);
            let builder = builder.constraint(LinearRows::new().unilateral(&[(1, -1.0)], wall));
            let builder = if checked { builder } else { builder.unchecked_stability() };
            builder.build().unwrap().run_until(40.0, &mut ()).unwrap();
            system.evaluations
        };
        let (checked, unchecked) = (evaluations(true), evaluations(false));
        assert!(checked <= unchecked + 3, "{wall}: {checked} {unchecked}");
    }
}

/// A host that tells nothing of its stiffness: a frequency one percent beyond that of the step is refused while it has
/// grown by no more than a few steps do, one as much below it runs on.
#[test]
fn frequencies_just_beyond_the_step_are_told_from_those_just_below() {
    for n in [1, 8] {
        // (A chain that is held at one end: ω = 2 √k cos(π/(2 n + 1)), √k of one mass.)
        let highest = 2.0 * (std::f64::consts::PI / (2.0 * n as f64 + 1.0)).cos();
        // (In any unit of time and of length.)
        let units = [(1e-3, 1.0), (0.1, 1.0), (10.0, 1.0), (0.1, 1e-12), (0.1, 1e12)];
        for (beyond, (h, speed)) in [0.99, 0.9998, 1.01].into_iter().flat_map(|beyond| units.map(|unit| (beyond, unit)))
        {
            let k = (2.0 * beyond / (h * highest)).powi(2);
            let mut velocity = vec![0.0; n];
            velocity[0] = speed;
            let mut run = Simulation::builder(Hardening::new(n, k, 0.0), CentralDifference, h)
                .velocity(velocity)
                .build()
                .unwrap();
            let start = run.energy().total();
            let mut most = 0.0_f64;
            let outcome = (0..400).try_for_each(|_| {
                run.step()?;
                most = most.max(run.energy().total() / start);
                Ok::<(), Error>(())
            });
            match outcome {
                Ok(()) => assert!(beyond < 1.0, "{n} {h}: {most:e}"),
                Err(Error::Stiffened { contact: None, .. }) => {
                    assert!(beyond > 1.0 && most < 100.0, "{n} {h} {beyond}: {most:e}");
                }
                Err(error) => panic!("{n} {h} {beyond}: {error}"),
            }
        }
    }
}

#[test]
fn step_control_follows_a_spring_that_hardens() {
    let control = StepControl::halving(1e-4).unwrap();
    let mut run = Simulation::builder(Hardening::new(1, 1e-3, 1.0), CentralDifference, 0.1)
        .velocity(vec![600.0])
        .step_control(control)
        .build()
        .unwrap();
    let start = run.energy().total();
    run.run_until(20.0, &mut ()).unwrap();
    assert!(run.statistics().refused_steps > 0 && run.energy().total() < 3.0 * start, "{:?}", run.statistics());
}

/// A chain that hardens more the more energy it has: steps that grow back to a size that was too long would add some
/// each time.
#[test]
fn step_control_does_not_come_back_to_steps_that_were_too_long() {
    for (listed, _) in conditional() {
        for times in [0.5, 2.0] {
            let (h, mut velocity) = (0.1_f64, vec![0.0; 5]);
            velocity[4] = (times / h).powi(2);
            let mut run = Simulation::builder(Hardening::new(5, 1.0, 1.0), (listed.make)(), h)
                .velocity(velocity)
                .step_control(StepControl::halving(1e-5).unwrap())
                .build()
                .unwrap();
            let start = run.energy().total();
            let mut most: f64 = 0.0;
            for _ in 0..3000 {
                run.step().unwrap();
                most = most.max(run.energy().total() / start);
            }
            let (name, refused) = (listed.name(), run.statistics().refused_steps);
            assert!(
                most < 30.0 && refused <= 4,
                "{name}, {times}: energy grows to {most} of that at the start, {refused}"
            );
            assert!(times < 1.0 || run.step_size() < h, "{name}: {}", run.step_size());
        }
    }
}

/// A spring of contact keeps steps short as long as it presses.
#[test]
fn step_control_grows_back_where_a_contact_that_was_too_stiff_opens() {
    for (listed, critical) in conditional() {
        let stiffness = 2.0 * (3.0 * critical / STEP).powi(2);
        let control = StepControl::halving(1e-3 * STEP).unwrap();
        let builder = mass_at_wall(&listed, ContactLaw::Penalty { stiffness }, 1.0).step_control(control);
        let mut run = builder.build().unwrap();
        let name = listed.name();
        let (mut pressed, mut whole) = (0, 0);
        while run.time() < 2000.0 * STEP {
            let before = run.time();
            run.step().unwrap();
            let h = run.time() - before;
            let closed = run.state().contacts().closed()[0];
            assert!(!closed || h < 0.3 * STEP, "{name} presses in a step of {h}");
            pressed += u64::from(closed);
            whole += u64::from(h > 0.9 * STEP);
        }
        assert!(pressed >= 3 && whole > 1900, "{name}: {pressed} pressed, {whole} were whole");
    }
}

/// Hosts that know their frequency are asked again.
#[test]
fn hosts_are_asked_again_for_their_frequency() {
    let mut system = Hardening::new(1, 1.0, 0.0);
    system.frequency = Some(|u: &[f64]| if u[0] > 5.0 { 30.0 } else { 1.0 });
    let mut run = Simulation::builder(system, CentralDifference, 0.1).velocity(vec![10.0]).build().unwrap();
    let outcome = run.run_until(1000.0, &mut ());
    match outcome {
        Err(Error::Stiffened { contact: None, frequency, .. }) => assert!((frequency - 30.0).abs() < 1e-12),
        other => panic!("{other:?}"),
    }
}

/// A motion that is resolved costs no evaluation of the force beside those of the steps.
#[test]
fn resolved_motions_cost_nothing_more() {
    let evaluations = |checked: bool| {
        let mut system = Hardening::new(8, 1.0, 0.1);
        let builder = Simulation::builder(&mut system, CentralDifference, 0.2).velocity(vec![1.0; 8]);
        let builder = if checked { builder } else { builder.unchecked_stability() };
        builder.build().unwrap().run_until(200.0, &mut ()).unwrap();
        system.evaluations
    };
    let (checked, unchecked) = (evaluations(true), evaluations(false));
    assert!(checked <= unchecked + unchecked / 50, "{checked} {unchecked}");
}
