//! Random systems and contacts: what must hold whatever the numbers are.
#![allow(clippy::float_cmp)] // exact zeros and unchanged values are meant exactly

use contact_dynamics::contact::{ContactJacobian, ContactLaw};
use contact_dynamics::contact_solver::{ActiveSet, AdmissibleSet, ContactProblem, ContactSolver};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{
    Bathe, Bdf2, CdLagrange, CentralDifference, Composite, GeneralizedAlpha, Gssss, Houbolt, JumpProjection,
    LinearRows, LinearSystem, Mass, MoreauJean, Newmark, NohBathe, Oalts, Park, PersistencyCorrection, Simulation,
    TimeIntegrator,
};
use contact_dynamics_scenes::sparse::{element, entries, matrix};
use proptest::prelude::*;

fn scheme(index: usize) -> Box<dyn TimeIntegrator> {
    match index {
        0 => Box::new(Composite),
        1 => Box::new(Newmark::trapezoidal()),
        2 => Box::new(Bathe::default()),
        3 => Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
        4 => Box::new(Park),
        5 => Box::new(Houbolt),
        6 => Box::new(Bdf2),
        7 => Box::new(Oalts::new(0.5).unwrap()),
        8 => Box::new(Bathe::with_radius(0.7).unwrap()),
        9 => Box::new(GeneralizedAlpha::hht(0.7).unwrap()),
        _ => Box::new(Gssss::new(0.4, 0.9, 0.2).unwrap()),
    }
}

/// A random scene: springs between random pairs, random masses, independent contact rows, random motion.
#[derive(Clone, Debug)]
struct Scene {
    masses: Vec<f64>,
    /// (i, j, stiffness); i = j is a spring to the ground.
    springs: Vec<(usize, usize, f64)>,
    /// Share of the mass that a consistent matrix puts on each spring's pair; none for a lumped mass.
    coupling: Option<f64>,
    /// Row r pushes dof r and, through weights, some later dofs: rows are independent by construction.
    rows: Vec<(Vec<(usize, f64)>, f64)>,
    velocity: Vec<f64>,
    damping: (f64, f64),
    h: f64,
    scheme: usize,
}

fn scenes() -> impl Strategy<Value = Scene> {
    (3_usize..8).prop_flat_map(|n| {
        let masses = prop::collection::vec(0.5..5.0, n);
        let springs = prop::collection::vec((0..n, 0..n, 1.0..200.0), 2..2 * n);
        let coupling = prop::option::of(0.02..0.2);
        let weights = prop::collection::vec(prop::collection::vec((0..n, -1.0..1.0), 0..3), 1..n);
        let gaps = prop::collection::vec(0.0..0.2, n);
        let velocity = prop::collection::vec(-2.0..2.0, n);
        let damping = prop_oneof![Just((0.0, 0.0)), (0.0..0.1, 0.0..0.01)];
        (masses, springs, coupling, weights, gaps, velocity, damping, 0.002..0.05, 0_usize..11).prop_map(
            |(masses, springs, coupling, weights, gaps, velocity, damping, h, scheme)| {
                let rows = weights
                    .into_iter()
                    .enumerate()
                    .map(|(r, weights)| {
                        let mut row = vec![(r, 1.0)];
                        for (dof, weight) in weights {
                            if dof > r && !row.iter().any(|&(other, _)| other == dof) {
                                row.push((dof, weight));
                            }
                        }
                        (row, gaps[r] + 1e-3)
                    })
                    .collect();
                Scene { masses, springs, coupling, rows, velocity, damping, h, scheme }
            },
        )
    })
}

impl Scene {
    fn matrix(&self, pair: impl Fn(f64) -> [f64; 2], ground: impl Fn(f64) -> f64) -> SparseColMat<usize, f64> {
        let n = self.masses.len();
        let mut entries: Vec<_> = (0..n).map(|i| (i, i, 0.0)).collect();
        for &(i, j, k) in &self.springs {
            match i == j {
                true => entries.push((i, i, ground(k))),
                false => entries.extend(element(i, j, pair(k))),
            }
        }
        matrix(n, entries)
    }

    fn mass(&self) -> Option<SparseColMat<usize, f64>> {
        let share = self.coupling?;
        let n = self.masses.len();
        let springs = self.matrix(|_| [2.0 * share, share], |_| 0.0);
        Some(matrix(n, (0..n).map(|i| (i, i, self.masses[i])).chain(entries(&springs))))
    }

    fn system(&self) -> LinearSystem<'static, f64> {
        let stiffness = self.matrix(|k| [k, -k], |k| k);
        let system = match self.mass() {
            Some(mass) => LinearSystem::new(mass, stiffness),
            None => LinearSystem::lumped(self.masses.clone(), stiffness),
        };
        system.unwrap().rayleigh(self.damping.0, self.damping.1).unwrap()
    }

    /// Whether a step resolves the damping, so that corrections leave accelerations without jumps (theory, section 7.1).
    /// Gershgorin's circles bound the damping rates of lumped masses.
    fn resolves_damping(&self) -> bool {
        let (by_mass, by_stiffness) = self.damping;
        let stiffest = |(dof, mass): (usize, &f64)| {
            let own = self.springs.iter().filter(|(i, j, _)| *i == dof || *j == dof);
            own.map(|(_, _, k)| 2.0 * k / mass).sum::<f64>()
        };
        let most = self.masses.iter().enumerate().map(stiffest).fold(0.0, f64::max);
        self.damping == (0.0, 0.0) || self.coupling.is_none() && self.h * (by_mass + by_stiffness * most) <= 1.0
    }

    fn contact(&self) -> LinearRows<'static, f64> {
        self.rows.iter().fold(LinearRows::new(), |rows, (row, gap)| rows.unilateral(row, *gap))
    }

    fn jacobian(&self) -> ContactJacobian<f64> {
        let mut g = ContactJacobian::default();
        for (row, _) in &self.rows {
            g.push(row);
        }
        g
    }

    /// What the contacts of the last step add to the total momentum.
    fn pushes(&self, run: &Simulation<'_, f64>) -> Vec<f64> {
        let impulses = run.state().contacts().impulses();
        let rows = self.rows.iter().zip(impulses);
        rows.map(|((row, _), &impulse)| row.iter().map(|(_, weight)| weight * impulse).sum()).collect()
    }

    fn start(&self) -> Simulation<'static, f64> {
        Simulation::builder(self.system(), scheme(self.scheme), self.h)
            .velocity(self.velocity.clone())
            .constraint(self.contact())
            .corrector(PersistencyCorrection::with_history_projection())
            .energy_balance()
            .build()
            .unwrap()
    }
}

/// The total momentum at the start of a run, and what contact has added to it since.
struct Books {
    direction: Vec<f64>,
    before: f64,
    impulse: f64,
    size: f64,
}

impl Books {
    fn open(scene: &Scene, run: &Simulation<'_, f64>) -> Self {
        let direction = vec![1.0; scene.masses.len()];
        let before = run.momentum(&direction).unwrap();
        Self { direction, before, impulse: 0.0, size: before.abs() }
    }

    fn add(&mut self, scene: &Scene, run: &Simulation<'_, f64>) {
        for push in scene.pushes(run) {
            self.impulse += push;
            self.size += push.abs();
        }
    }

    /// Momentum must have changed by the impulses.
    fn check(&self, scene: &Scene, run: &Simulation<'_, f64>) -> Result<(), TestCaseError> {
        let Self { direction, before, impulse, size } = self;
        let after = run.momentum(direction).unwrap();
        let scale = size + largest(&scene.velocity);
        prop_assert!((after - before - impulse).abs() < 1e-9 * scale, "{before} + {impulse} is not {after}");
        Ok(())
    }
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0_f64, |a, b| a.max(b.abs()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn every_step_is_complementary_and_free_of_jumps(scene in scenes()) {
        let mut run = scene.start();
        let g = scene.jacobian();
        let mut corrections = 0.0;
        for _ in 0..60 {
            let was_closed = run.state().contacts().closed().to_vec();
            run.step().unwrap();
            let state = run.state();
            let (u, v, a) = (state.displacement(), state.velocity(), state.acceleration());
            let contacts = state.contacts();
            let length = largest(u) + scene.h * largest(v) + 0.2;
            for (row, &gap) in run.gaps().iter().enumerate() {
                let raw = contacts.raw_forces()[row];
                prop_assert!(gap > -1e-12 * length && raw >= 0.0, "gap {gap}, raw {raw}");
                if raw > 0.0 {
                    prop_assert!(gap < 1e-12 * length, "pressed with gap {gap}");
                    let (rate, acceleration) = (g.product(row, v), g.product(row, a));
                    prop_assert!(rate.abs() < 1e-11 * (largest(v) + largest(u) / scene.h), "jump of velocity {rate}");
                    let most = 1e-10 * (largest(a) + largest(v) / scene.h);
                    let is_free = acceleration.abs() < most || !scene.resolves_damping();
                    prop_assert!(is_free, "jump of acceleration {acceleration}");
                }
                if !contacts.closed()[row] {
                    prop_assert_eq!(contacts.forces()[row], 0.0);
                }
            }
            // In a step in which a contact closes, a part of the projection belongs to its impact.
            let mut rows = was_closed.iter().zip(contacts.impulses());
            let is_whole = rows.all(|(&was_closed, &impulse)| was_closed || impulse == 0.0);
            let works = run.energy().works.unwrap();
            let gain = works.corrections - corrections;
            prop_assert!(gain <= 1e-14 || !is_whole, "the projection gained energy: {gain}");
            corrections = works.corrections;
        }
    }

    #[test]
    fn changing_steps_leave_every_step_complementary(scene in scenes(), ratios in prop::collection::vec(0.4..1.7, 40)) {
        let mut run = scene.start();
        for ratio in ratios {
            run.set_step_size(scene.h * ratio).unwrap();
            run.step().unwrap();
            let state = run.state();
            let length = largest(state.displacement()) + scene.h * largest(state.velocity()) + 0.2;
            for (row, &gap) in run.gaps().iter().enumerate() {
                let raw = state.contacts().raw_forces()[row];
                prop_assert!(gap > -1e-12 * length && raw >= 0.0, "gap {gap}, raw {raw}");
                prop_assert!(raw == 0.0 || gap < 1e-12 * length, "pressed with gap {gap}");
            }
        }
    }

    #[test]
    fn contact_ahead_of_the_state_and_on_velocities_is_complementary(scene in scenes(), which in 0_usize..4) {
        let make: fn() -> Box<dyn TimeIntegrator> = match which {
            0 => || Box::new(CentralDifference),
            1 => || Box::new(NohBathe::new(0.54).unwrap()),
            2 => || Box::new(CdLagrange),
            _ => || Box::new(MoreauJean::new(0.5).unwrap()),
        };
        // Without forces to the ground contact alone changes momentum; the step is far inside the stability limit.
        let springs = scene.springs.iter().copied().filter(|(i, j, _)| i != j).collect();
        let h = scene.h / 20.0;
        let scene = Scene { springs, damping: (0.0, 0.1 * scene.damping.1), h, ..scene };
        let mut run = Simulation::builder(scene.system(), make(), h)
            .velocity(scene.velocity.clone())
            .constraint(scene.contact())
            .build()
            .unwrap();
        let g = scene.jacobian();
        let mut books = Books::open(&scene, &run);
        for _ in 0..400 {
            run.step().unwrap();
            let state = run.state();
            let (u, v, a) = (state.displacement(), state.velocity(), state.stored_acceleration());
            let length = largest(u) + h * largest(v) + 0.2;
            for (row, &gap) in run.gaps().iter().enumerate() {
                let raw = state.contacts().raw_forces()[row];
                prop_assert!(raw >= 0.0);
                // Forward increments keep gaps from closing, the others stop the approach.
                prop_assert!(which > 1 || gap > -1e-12 * length, "gap {gap}");
                let lead = if which == 2 { 0.5 * h } else { 0.0 };
                let rate = g.product(row, v) + lead * g.product(row, a);
                let speed = largest(v) + h * largest(a) + largest(u) / h;
                prop_assert!(which < 2 || raw == 0.0 || rate.abs() < 1e-11 * speed, "pressed with rate {rate}");
            }
            books.add(&scene, &run);
        }
        books.check(&scene, &run)?;
    }

    #[test]
    fn mixed_laws_are_met_together_and_push_what_they_say(
        scene in scenes(),
        laws in prop::collection::vec((0_usize..5, 10.0_f64..1e5, 1.0..2.5), 8),
    ) {
        // Rows of all kinds, and each row once more under another law: they must share or ignore one another.
        let law = |(kind, stiffness, exponent): (usize, f64, f64)| match kind {
            0 => ContactLaw::Rigid,
            1 => ContactLaw::Penalty { stiffness },
            2 => ContactLaw::PowerLaw { stiffness, exponent },
            3 => ContactLaw::AugmentedLagrangian { stiffness, augmentations: 2 },
            _ => ContactLaw::Bipenalty { stiffness, mass: 1e-6 * stiffness },
        };
        let springs = scene.springs.iter().copied().filter(|(i, j, _)| i != j).collect();
        let mut scene = Scene { springs, damping: (0.0, scene.damping.1), ..scene };
        let twice: Vec<_> = scene.rows.iter().take(2).map(|(row, gap)| (row.clone(), 0.9 * gap)).collect();
        scene.rows.extend(twice);
        let laws: Vec<_> = (0..scene.rows.len()).map(|i| law(laws[i % laws.len()])).collect();
        let contact =
            scene.rows.iter().zip(&laws).fold(LinearRows::new(), |rows, ((row, gap), &law)| rows.row(law, row, *gap));
        let mut run = Simulation::builder(scene.system(), scheme(scene.scheme), scene.h)
            .velocity(scene.velocity.clone())
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let mut books = Books::open(&scene, &run);
        // Schemes whose balance holds at the state: there the force of a spring is that of the gap shown.
        let collocated = matches!(scene.scheme, 0 | 1 | 4 | 5 | 6);
        for step in 0..80 {
            run.step().unwrap();
            let contacts = run.state().contacts();
            let length = largest(run.state().displacement()) + scene.h * largest(run.state().velocity()) + 0.2;
            for ((law, &gap), &force) in laws.iter().zip(run.gaps()).zip(contacts.raw_forces()) {
                prop_assert!(force >= 0.0);
                // While a multistep scheme is started another one makes the steps, collocated too.
                match *law {
                    ContactLaw::Rigid => {
                        prop_assert!(gap > -1e-11 * length && (force == 0.0 || gap < 1e-11 * length), "{gap} {force}");
                    }
                    ContactLaw::Penalty { stiffness: k } if collocated => {
                        let spring = k * (-gap).max(0.0);
                        prop_assert!((force - spring).abs() < 1e-9 * k * length, "step {step}: {force} {spring}");
                    }
                    ContactLaw::PowerLaw { stiffness: k, exponent: p } if collocated => {
                        let spring = k * (-gap).max(0.0).powf(p);
                        prop_assert!((force - spring).abs() < 1e-9 * k * length.powf(p), "step {step}: {force} {spring}");
                    }
                    _ => {}
                }
            }
            books.add(&scene, &run);
        }
        books.check(&scene, &run)?;
    }

    #[test]
    fn a_clone_of_state_and_history_continues_bit_for_bit(scene in scenes(), steps in 0_usize..40) {
        let mut run = scene.start();
        for _ in 0..steps {
            run.step().unwrap();
        }
        let mut resumed = Simulation::builder(scene.system(), scheme(scene.scheme), scene.h)
            .constraint(scene.contact())
            .corrector(PersistencyCorrection::with_history_projection())
            .resume(run.state().clone(), run.history().clone())
            .build()
            .unwrap();
        for _ in 0..30 {
            run.step().unwrap();
            resumed.step().unwrap();
            prop_assert_eq!(run.state(), resumed.state());
            prop_assert_eq!(run.time().to_bits(), resumed.time().to_bits());
        }
    }

    #[test]
    fn momentum_changes_by_the_impulses_of_contact(scene in scenes()) {
        // Without springs to the ground and without mass-proportional damping only contact changes momentum.
        let springs = scene.springs.iter().copied().filter(|(i, j, _)| i != j).collect();
        let scene = Scene { springs, damping: (0.0, scene.damping.1), ..scene };
        let mut run = scene.start();
        // Each connected body has its own momentum; the total is enough here.
        let mut books = Books::open(&scene, &run);
        for _ in 0..80 {
            run.step().unwrap();
            books.add(&scene, &run);
        }
        books.check(&scene, &run)?;
    }

    #[test]
    fn projection_removes_jumps_and_never_gains_energy(scene in scenes(), targets in prop::collection::vec(-1.0_f64..1.0, 8)) {
        let g = scene.jacobian();
        let stored = scene.mass();
        let mass = stored.as_ref().map_or(Mass::Lumped(&scene.masses), |m| Mass::Consistent(m.as_ref()));
        let mut projection = JumpProjection::new(mass, &[]).unwrap();
        let rows: Vec<usize> = (0..g.rows()).collect();
        projection.close(&g, &rows).unwrap();
        let energy = |v: &[f64]| {
            let mut p = vec![0.0; v.len()];
            mass.product(1.0, v, &mut p).unwrap();
            0.5 * p.iter().zip(v).map(|(p, v)| p * v).sum::<f64>()
        };
        let mut v = scene.velocity.clone();
        let mut multipliers = vec![0.0; rows.len()];
        let zero = vec![0.0; rows.len()];
        projection.remove_jump(&g, &zero, &mut v, &mut multipliers).unwrap();
        let jumps: Vec<f64> = rows.iter().map(|&row| g.product(row, &scene.velocity)).collect();
        // ½ jumpᵀ S⁻¹ jump
        let loss = 0.5 * jumps.iter().zip(&multipliers).map(|(j, m)| j * m).sum::<f64>();
        let (before, after) = (energy(&scene.velocity), energy(&v));
        prop_assert!(loss >= 0.0 && (before - after - loss).abs() < 1e-12 * before);
        prop_assert!(rows.iter().all(|&row| g.product(row, &v).abs() < 1e-12 * largest(&scene.velocity).max(1e-3)));
        projection.remove_jump(&g, &targets[..rows.len()], &mut v, &mut multipliers).unwrap();
        for &row in &rows {
            prop_assert!((g.product(row, &v) - targets[row]).abs() < 1e-11);
        }
    }

    #[test]
    fn active_set_finds_the_only_solution(
        entries in prop::collection::vec(-1.0_f64..1.0, 36),
        offset in prop::collection::vec(-1.0_f64..1.0, 6),
        guess in prop::collection::vec(0.0_f64..1.0, 6),
        free in 0_usize..3,
    ) {
        // W = B Bᵀ + 0.05: by enumeration of all active sets there is exactly one solution.
        let n = 6;
        let w: Vec<f64> = (0..n * n)
            .map(|k| {
                let (i, j) = (k % n, k / n);
                (0..n).map(|l| entries[i * n + l] * entries[j * n + l]).sum::<f64>() + if i == j { 0.05 } else { 0.0 }
            })
            .collect();
        let bounds: Vec<_> = (0..n).map(|i| if i < free { AdmissibleSet::Free } else { AdmissibleSet::NonNegative }).collect();
        let tolerance = vec![1e-13; n];
        let problem = ContactProblem::new(&w, &offset, &bounds, &tolerance).unwrap();
        let mut solver = ActiveSet::default();
        let mut lambda = guess.iter().map(|&x| if x > 0.5 { x } else { 0.0 }).collect::<Vec<_>>();
        solver.solve(&problem, &mut lambda).unwrap();
        prop_assert!(problem.residual(&lambda).1 < 1e-11, "{:?}", problem.residual(&lambda));
        let mut cold = vec![0.0; n];
        solver.solve(&problem, &mut cold).unwrap();
        for (x, y) in lambda.iter().zip(&cold) {
            prop_assert!((x - y).abs() < 1e-9 * (1.0 + largest(&lambda)));
        }
    }
}
