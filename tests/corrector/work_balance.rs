//! Contacts on dofs without mass: what they take or give in the step in which they close or open goes back to the
//! digit, wherever in the step that is.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::corrector::WorkBalance;
use contact_dynamics::{
    Bathe, CdLagrange, CentralDifference, Corrector, Error, GeneralizedAlpha, LinearRows, LinearSystem, Newmark,
    NohBathe, Preset, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::masses::{Takers, Treatment};
use contact_dynamics_scenes::sparse::{matrix, spring};
use contact_dynamics_scenes::wall_bar::WallBar;

type Scheme = Box<dyn TimeIntegrator>;

/// The schemes, and what multiplies h² aᵀ M a in the energy that each conserves: ½ (β − ¼).
fn schemes() -> Vec<(Scheme, f64)> {
    vec![
        (Box::new(Newmark::trapezoidal()), 0.0),
        (Box::new(Bathe::with_radius(1.0).unwrap()), 0.0),
        (Box::new(Newmark::new(1.0 / 6.0, 0.5).unwrap()), -1.0 / 24.0),
        (Box::new(CentralDifference), -0.125),
        (Box::new(CdLagrange), -0.125),
    ]
}

fn correctors(balanced: bool) -> Vec<Box<dyn Corrector<f64>>> {
    if balanced { vec![Box::new(WorkBalance)] } else { Vec::new() }
}

/// What a scheme conserves, seen from a frame of this speed: kinetic and elastic energy, and its multiple of h² aᵀ M a.
fn energy(run: &mut Simulation<'_, f64>, mass: &[f64], factor: f64, frame: f64) -> f64 {
    let (h, elastic) = (run.step_size(), run.energy().potential.unwrap());
    let state = run.state();
    let of_dof = |((&m, &v), &a): ((&f64, &f64), &f64)| m * (0.5 * (v - frame).powi(2) + factor * h * h * a * a);
    elastic + mass.iter().zip(state.velocity()).zip(state.acceleration()).map(of_dof).sum::<f64>()
}

/// Two masses in a row behind a dof without mass fall on a floor that moves with the speed `frame`, as the masses do.
struct Fall {
    mass: Vec<f64>,
    frame: f64,
    factor: f64,
    run: Simulation<'static, f64>,
}

impl Fall {
    const SPEED: f64 = 3.0;

    /// The floor is met a fraction `phase` of a step after the fourth.
    fn new((scheme, factor): (Scheme, f64), phase: f64, frame: f64, balanced: bool) -> Self {
        let (h, mass) = (0.02, vec![0.0, 1.0, 2.0]);
        let stiffness = matrix(3, spring(0, 1, 300.0).into_iter().chain(spring(1, 2, 200.0)));
        let floor = move |t: f64| [(4.0 + phase) * h * Self::SPEED - frame * t, -frame, 0.0];
        let run = Simulation::builder(LinearSystem::lumped(mass.clone(), stiffness).unwrap(), scheme, h)
            .velocity(vec![frame - Self::SPEED; 3])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], GapOffset::moving(floor)))
            .correctors(correctors(balanced))
            .energy_balance()
            .build()
            .unwrap();
        Self { mass, frame, factor, run }
    }

    fn energy(&mut self) -> f64 {
        energy(&mut self.run, &self.mass, self.factor, self.frame)
    }
}

#[test]
fn energy_is_that_before_the_impact_wherever_in_a_step_it_begins_and_ends() {
    for scheme in 0..schemes().len() {
        let worst = [true, false].map(|balanced| {
            let change = |k: u32| {
                let phase = 0.025 + 0.05 * f64::from(k);
                let mut fall = Fall::new(schemes().swap_remove(scheme), phase, 0.0, balanced);
                let (before, mut closed) = (fall.energy(), 0);
                for _ in 0..60 {
                    fall.run.step().unwrap();
                    closed += usize::from(fall.run.state().contacts().closed()[0]);
                }
                assert!(closed > 4 && fall.run.state().velocity()[2] > 0.0, "{scheme} {k}: {closed}");
                (fall.energy() / before - 1.0).abs()
            };
            (0..20).map(change).fold(0.0, f64::max)
        });
        assert!(worst[0] < 1e-13, "{scheme}: {worst:?}");
        // (Without it the test would see the error.)
        assert!(worst[1] > 1e-3, "{scheme}: {worst:?}");
    }
}

#[test]
fn impulses_are_booked_and_a_frame_that_moves_changes_nothing() {
    for scheme in 0..schemes().len() {
        let motions = [0.0, 40.0].map(|frame| {
            let mut fall = Fall::new(schemes().swap_remove(scheme), 0.4, frame, true);
            let ones = [1.0; 3];
            let (before, mut impulse) = (fall.run.momentum(&ones).unwrap(), 0.0);
            for _ in 0..60 {
                fall.run.step().unwrap();
                impulse += fall.run.state().contacts().impulses()[0];
            }
            let change = fall.run.momentum(&ones).unwrap() - before;
            assert!((change - impulse).abs() < 1e-12 * impulse, "{scheme} {frame}: {change} {impulse}");
            // The books close, of stages that are steps: the floor's work, and what the correction gave back of it.
            let works = fall.run.energy().works.unwrap();
            let kinetic = fall.run.energy().kinetic;
            let shift: f64 = fall.mass.iter().zip(fall.run.state().acceleration()).map(|(m, a)| m * a * a).sum();
            let shift = fall.factor * fall.run.step_size().powi(2) * shift;
            let is_staged = schemes()[scheme].0.tableau().stages.len() > 1;
            assert!(
                is_staged || (works.remainder + shift).abs() < 1e-11 * kinetic,
                "{scheme} {frame}: {works:?} {shift:e}"
            );
            fall.run.state().velocity().iter().map(|v| v - frame).collect::<Vec<_>>()
        });
        for (still, moving) in motions[0].iter().zip(&motions[1]) {
            assert!((still - moving).abs() < 1e-11 * Fall::SPEED, "{scheme}: {motions:?}");
        }
    }
}

#[test]
fn the_rebound_comes_closer_to_the_exact_one_than_without() {
    // One mass behind the spring: contact lasts half a period, and the mass leaves as fast as it came.
    let h = 0.05;
    for place in 0..schemes().len() {
        let scheme = || schemes().swap_remove(place).0;
        let name = scheme().name();
        let errors = [false, true].map(|balanced| {
            let square = |k: u32| {
                let system = LinearSystem::lumped(vec![0.0, 1.0], matrix(2, spring(0, 1, 64.0))).unwrap();
                let mut run = Simulation::builder(system, scheme(), h)
                    .velocity(vec![-1.0; 2])
                    .constraint(LinearRows::new().unilateral(&[(0, 1.0)], h * (2.0 + (f64::from(k) + 0.5) / 16.0)))
                    .correctors(correctors(balanced))
                    .build()
                    .unwrap();
                (0..20).for_each(|_| run.step().unwrap());
                (run.state().velocity()[1] - 1.0).powi(2)
            };
            ((0..16).map(square).sum::<f64>() / 16.0).sqrt()
        });
        assert!(errors[0] > 1e-3 && errors[1] < 1e-13, "{name}: {errors:?}");
    }
}

#[test]
fn what_closes_and_what_opens_in_the_same_step_is_told_apart() {
    // Two falls in one system, the second one later by a contact and some of a step: their switches meet in a step.
    // Each keeps its energy as it does alone, but for the one number that they share.
    let springs = [(0, 1, 300.0), (1, 2, 200.0), (3, 4, 300.0), (4, 5, 200.0)];
    let stiffness = || matrix::<f64>(6, springs.into_iter().flat_map(|(i, j, k)| spring(i, j, k)));
    let (h, mass) = (0.02, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0]);
    let mut met = 0;
    for delay in 100..400 {
        let delay = 0.1 * f64::from(delay);
        let rows = LinearRows::new()
            .unilateral(&[(0, 1.0)], 4.3 * h * Fall::SPEED)
            .unilateral(&[(3, 1.0)], (4.3 + delay) * h * Fall::SPEED);
        let system = LinearSystem::lumped(mass.to_vec(), stiffness()).unwrap();
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), h)
            .velocity(vec![-Fall::SPEED; 6])
            .constraint(rows)
            .corrector(WorkBalance)
            .build()
            .unwrap();
        let before = energy(&mut run, &mass, 0.0, 0.0);
        let mut was = vec![false; 2];
        for _ in 0..110 {
            run.step().unwrap();
            let now = run.state().contacts().closed().to_vec();
            met += usize::from(was[0] && !now[0] && !was[1] && now[1]);
            was = now;
        }
        let after = energy(&mut run, &mass, 0.0, 0.0);
        assert!((after / before - 1.0).abs() < 1e-13, "{delay}: {:e}", after / before - 1.0);
    }
    assert!(met > 5, "{met}");
}

/// What forty masses in a row did that rattle between two walls, which they meet by dofs without mass, in steps many
/// times as long as their fastest periods.
#[derive(Debug)]
struct Rattled {
    /// The largest change of the energy, over that at the start.
    change: f64,
    /// The same of what contacts have and bodies have not, together.
    of_all: f64,
}

fn rattle(scheme: Scheme, correctors: Vec<Box<dyn Corrector<f64>>>) -> Rattled {
    const MASSES: usize = 40;
    let (stiffness, h) = (1e4_f64, 0.3);
    let dofs = MASSES + 2;
    let springs = (0..dofs - 1).flat_map(|i| spring(i, i + 1, stiffness));
    let mass: Vec<f64> = (0..dofs).map(|i| if i == 0 || i == dofs - 1 { 0.0 } else { 1.0 }).collect();
    assert!(h * 2.0 * stiffness.sqrt() > 50.0);
    let velocity = (0..dofs).map(|i| 1.0 + (1.7 * i as f64).sin() + (0.3 * i as f64).cos()).collect();
    let mut run = Simulation::builder(LinearSystem::lumped(mass, matrix(dofs, springs)).unwrap(), scheme, h)
        .velocity(velocity)
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.01).unilateral(&[(dofs - 1, -1.0)], 0.01))
        .correctors(correctors)
        .build()
        .unwrap();
    let start = run.energy().total();
    let mut rattled = Rattled { change: 0.0, of_all: 0.0 };
    for _ in 0..2000 {
        run.step().unwrap();
        let own = run.energy().total();
        let owed: f64 = run.state().contacts().dissipated().iter().sum();
        rattled.change = rattled.change.max((own / start - 1.0).abs());
        rattled.of_all = rattled.of_all.max(((own + owed) / start - 1.0).abs());
    }
    assert!(run.statistics().contact_changes > 500);
    rattled
}

#[test]
fn modes_that_steps_do_not_resolve_keep_their_energy() {
    let makes: [fn() -> Scheme; 2] =
        [|| Box::new(Newmark::trapezoidal()), || Box::new(Bathe::with_radius(1.0).unwrap())];
    for make in makes {
        let [kept, raw] = [true, false].map(|balanced| rattle(make(), correctors(balanced)));
        // What is missing is owed, and stays small; without it the run goes up without bound.
        assert!(kept.change < 0.1 && kept.of_all < 1e-10, "{}: {kept:?}", make().name());
        assert!(raw.change > 10.0, "{}: {raw:?}", make().name());
    }
}

#[test]
fn what_damped_bodies_lose_they_lose_to_damping_alone() {
    // (The dof without mass is damped as well.)
    let (h, gap) = (0.02, 0.25);
    for scheme in [0, 1] {
        for phase in 0..10 {
            let stiffness = matrix(3, spring(0, 1, 300.0).into_iter().chain(spring(1, 2, 200.0)));
            let system = LinearSystem::lumped(vec![0.0, 1.0, 2.0], stiffness).unwrap().rayleigh(0.1, 0.01).unwrap();
            let mut run = Simulation::builder(system, schemes().swap_remove(scheme).0, h)
                .velocity(vec![-Fall::SPEED; 3])
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], gap + 0.1 * h * Fall::SPEED * f64::from(phase)))
                .corrector(WorkBalance)
                .energy_balance()
                .build()
                .unwrap();
            (0..60).for_each(|_| run.step().unwrap());
            let works = run.energy().works.unwrap();
            let owed = run.state().contacts().dissipated()[0];
            assert!(run.statistics().contact_changes == 2 && works.damping < -0.1, "{scheme} {phase}: {works:?}");
            // (The work of contact is booked by whole steps: stages add to it, and to the remainder.)
            let is_staged = schemes()[scheme].0.tableau().stages.len() > 1;
            let left = works.contact + works.corrections + owed;
            assert!(is_staged || left.abs() < 1e-12, "{scheme} {phase}: {left:e} {works:?}");
            assert!(works.contact.abs() > 1e-4, "{scheme} {phase}: nothing to correct: {works:?}");
        }
    }
}

#[test]
fn friction_is_left_out_with_the_force_that_it_belongs_to() {
    // A mass (2 and 3) on a point without mass (0 along the gap, 1 along the floor) falls at a slant, and slides.
    for scheme in [0, 1] {
        for phase in 0..10 {
            let h = 0.02;
            let stiffness = matrix(4, spring(0, 2, 300.0).into_iter().chain(spring(1, 3, 200.0)));
            let gap = (3.0 + 0.1 * f64::from(phase)) * h;
            let rows = LinearRows::new().unilateral(&[(0, 1.0)], gap).friction(0.3, &[&[(1, 1.0)]]);
            let system = LinearSystem::lumped(vec![0.0, 0.0, 1.0, 1.0], stiffness).unwrap();
            let mut run = Simulation::builder(system, schemes().swap_remove(scheme).0, h)
                .velocity(vec![-1.0, 3.0, -1.0, 3.0])
                .constraint(rows)
                .corrector(WorkBalance)
                .build()
                .unwrap();
            let (before, mut impulses) = (run.energy().total(), [0.0; 2]);
            let momentum = |run: &mut Simulation<'_, f64>| {
                [[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]].map(|along| run.momentum(&along).unwrap())
            };
            let start = momentum(&mut run);
            for _ in 0..40 {
                run.step().unwrap();
                let contacts = run.state().contacts();
                impulses[0] += contacts.impulses()[0];
                impulses[1] += contacts.friction_impulses(0)[0];
            }
            let end = momentum(&mut run);
            for k in 0..2 {
                assert!(
                    (end[k] - start[k] - impulses[k]).abs() < 1e-11,
                    "{scheme} {phase}: {start:?} {end:?} {impulses:?}"
                );
            }
            // It slides all the time: friction has the share of the impulse that it has of the force.
            assert!((impulses[1] + 0.3 * impulses[0]).abs() < 1e-11 * impulses[0], "{scheme} {phase}: {impulses:?}");
            let v = run.state().velocity();
            assert!(run.statistics().contact_changes == 2 && (v[2] - 1.0).abs() < 1e-11, "{scheme} {phase}: {v:?}");
            assert!(run.energy().total() < before, "{scheme} {phase}");
        }
    }
}

#[test]
fn a_bar_that_bounces_for_long_keeps_its_energy() {
    for (preset, bound) in [(Preset::conservative(), 5e-3), (Preset::explicit(), 0.34)] {
        let (bar, courant) = (WallBar::bouncing(8), 0.5);
        let h = courant * bar.element_size() / bar.wave_speed();
        let by = if preset == Preset::explicit() {
            Treatment::Redistributed(Takers::Tapered)
        } else {
            Treatment::RedistributedBlend(Takers::Tapered)
        };
        let changes = [true, false].map(|balanced| {
            let mass = by.mass(&bar.body(), &preset.integrator().tableau(), courant).unwrap();
            let weights = mass.row_sums();
            let mut run = Simulation::builder(bar.system_with(mass), preset.integrator(), h)
                .constraint(bar.contact())
                .correctors(if balanced { preset.correctors() } else { Vec::new() })
                .build()
                .unwrap();
            let start = weights.iter().sum::<f64>() * bar.gravity * bar.height;
            let mut worst = 0.0_f64;
            for _ in 0..100_000 {
                run.step().unwrap();
                let own = run.energy().total();
                worst = worst.max(bar.total_energy_with(&weights, own, run.state().displacement()) / start - 1.0);
            }
            worst
        });
        // (That of explicit schemes trembles about what they conserve, by Ω²/4 of the elastic energy.)
        assert!(changes[0] < bound && changes[1] > 2.0 * changes[0], "{preset:?}: {changes:?}");
    }
}

#[test]
fn a_run_goes_on_from_a_state_that_owes_energy() {
    let bar = WallBar::bouncing(8);
    let h = 0.5 * bar.element_size() / bar.wave_speed();
    let build = |from: Option<(contact_dynamics::State<f64>, contact_dynamics::History<f64>)>| {
        let mass = Treatment::Redistributed(Takers::Tapered).mass(&bar.body(), &CdLagrange.tableau(), 0.5).unwrap();
        let builder =
            Simulation::builder(bar.system_with(mass), CdLagrange, h).constraint(bar.contact()).corrector(WorkBalance);
        match from {
            Some((state, history)) => builder.resume(state, history),
            None => builder,
        }
        .build()
        .unwrap()
    };
    let mut run = build(None);
    while run.state().contacts().dissipated()[0] == 0.0 {
        run.step().unwrap();
        assert!(run.time() < 3000.0, "it owes nothing");
    }
    let mut resumed = build(Some((run.state().clone(), run.history().clone())));
    for _ in 0..3000 {
        run.step().unwrap();
        resumed.step().unwrap();
    }
    assert_eq!(run.state(), resumed.state());
}

#[test]
fn schemes_of_which_it_knows_no_work_are_refused() {
    let system = LinearSystem::lumped(vec![0.0, 1.0], matrix(2, spring(0, 1, 64.0))).unwrap();
    let scheme = GeneralizedAlpha::chung_hulbert(0.9).unwrap();
    let built = Simulation::builder(system, scheme, 0.1)
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 1.0))
        .corrector(WorkBalance)
        .build();
    assert!(matches!(built, Err(Error::Incompatible { .. })), "{built:?}");
    let others: [Scheme; 4] = [
        Box::new(Bathe::default()),
        Box::new(Newmark::new(0.3, 0.6).unwrap()),
        Box::new(contact_dynamics::Composite),
        Box::new(NohBathe::new(0.54).unwrap()),
    ];
    for scheme in others {
        assert!(Corrector::<f64>::requirements(&WorkBalance, &scheme.tableau()).scheme.is_err(), "{}", scheme.name());
    }
}
