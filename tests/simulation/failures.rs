//! Wrong inputs: a typed error with the numbers, never a panic, and a failed step that leaves everything as it was.
#![allow(clippy::float_cmp)] // exact zeros and unchanged values are meant exactly

use contact_dynamics::contact::{ContactConstraint, ContactLaw, Contacts, GapOffset};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::tableau::{ContactLevel, Rows, Stage, Tableau, U, V, Z};
use contact_dynamics::{
    CentralDifference, Cholesky, ChungLee, Composite, Diagonal, Error, Gssss, LinearRows, LinearSolver, LinearSystem,
    Newmark, PersistencyCorrection, Result, Simulation, SimulationBuilder, TimeIntegrator, mass,
};
use contact_dynamics_scenes::schemes::Tabulated;
use contact_dynamics_scenes::sparse::{matrix, rectangular};
use contact_dynamics_scenes::{Bars, MassKind};

type Matrix = SparseColMat<usize, f64>;

/// Two masses and a spring.
fn spring() -> Matrix {
    matrix(2, [(0, 0, 4.0), (0, 1, -4.0), (1, 0, -4.0), (1, 1, 4.0)])
}

fn system() -> LinearSystem<'static, f64> {
    LinearSystem::lumped(vec![1.0, 2.0], spring()).unwrap()
}

fn builder() -> SimulationBuilder<'static, f64> {
    Simulation::builder(system(), Composite, 0.01)
}

fn error<T>(result: Result<T>) -> Error {
    match result {
        Ok(_) => panic!("accepted"),
        Err(error) => error,
    }
}

/// Asserts the variant, and that the message names every one of `words`.
macro_rules! refused {
    ($result:expr, $variant:pat, $($words:expr),*) => {{
        let error = error($result);
        assert!(matches!(error, $variant), "{error:?}");
        let text = error.to_string();
        $(assert!(text.contains($words), "`{text}` lacks `{}`", $words);)*
        assert!(!error.is_recoverable());
    }};
}

#[test]
fn not_finite_input_is_located() {
    let nan = f64::NAN;
    let k = matrix(2, [(0, 0, 4.0), (0, 1, nan), (1, 0, nan), (1, 1, 4.0)]);
    refused!(
        LinearSystem::lumped(vec![1.0, 2.0], k),
        Error::MatrixNotFinite { matrix: "stiffness", row: 1, column: 0, .. },
        "(1, 0)",
        "NaN"
    );
    let m = matrix(2, [(0, 0, 1.0), (1, 1, f64::INFINITY)]);
    refused!(LinearSystem::new(m, spring()), Error::MatrixNotFinite { matrix: "mass", row: 1, column: 1, .. }, "inf");
    refused!(system().damping(matrix(2, [(0, 0, nan)])), Error::MatrixNotFinite { matrix: "damping", .. }, "damping");
    refused!(
        builder().displacement(vec![0.0, nan]).build(),
        Error::NotFinite { what: "the initial displacement", index: 1, .. },
        "index 1"
    );
    refused!(builder().velocity(vec![f64::INFINITY, 0.0]).build(), Error::NotFinite { index: 0, .. }, "velocity");
    let rows = LinearRows::new().unilateral(&[(0, nan)], 0.1);
    refused!(builder().constraint(rows).build(), Error::NotFinite { .. }, "weights");
    let rows = LinearRows::new().unilateral(&[(0, 1.0)], nan);
    refused!(builder().constraint(rows).build(), Error::NotFinite { .. }, "gaps");
}

#[test]
fn wrong_sizes_are_refused() {
    refused!(
        LinearSystem::lumped(vec![1.0; 3], spring()),
        Error::Dimension { expected: 2, found: 3, .. },
        "mass",
        "3",
        "2"
    );
    refused!(system().damping(matrix(3, [(0, 0, 1.0)])), Error::Dimension { what: "damping matrix", .. }, "3");
    refused!(
        builder().displacement(vec![0.0; 5]).build(),
        Error::Dimension { what: "the initial displacement", expected: 2, found: 5 },
        "5"
    );
    refused!(builder().velocity(vec![0.0; 1]).build(), Error::Dimension { .. }, "velocity");
    let wide = rectangular::<f64>(2, 3, [(0, 0, 1.0)]);
    refused!(LinearSystem::new(wide.clone(), spring()), Error::Dimension { .. }, "mass");
    refused!(mass::lump(wide.as_ref()), Error::Dimension { .. }, "mass");
    refused!(builder().build().unwrap().momentum(&[1.0]), Error::Dimension { expected: 2, found: 1, .. }, "direction");
    let g = contact_dynamics::faer::sparse::SparseRowMat::<usize, f64>::try_new_from_triplets(
        1,
        2,
        &[Triplet::new(0, 0, 1.0)],
    )
    .unwrap();
    refused!(LinearRows::from_matrix(g.as_ref(), &[0.1, 0.2]), Error::Dimension { .. }, "gaps");
}

#[test]
fn asymmetric_matrices_are_refused_with_the_worst_entry() {
    let k = matrix(2, [(0, 0, 4.0), (0, 1, -4.0), (1, 0, -3.0), (1, 1, 4.0)]);
    // Cholesky cannot factorize it, and names who can.
    let system = LinearSystem::lumped(vec![4.0; 2], k).unwrap();
    let built = Simulation::builder(system, Newmark::trapezoidal(), 2.0).build();
    refused!(built, Error::Asymmetric { matrix: "effective", .. }, "-4e0", "-3e0", "Lu");
    let m = matrix::<f64>(2, [(0, 0, 4.0), (0, 1, -4.0), (1, 0, -3.0), (1, 1, 4.0)]);
    let k = matrix(2, [(0, 0, 1.0), (1, 1, 1.0)]);
    refused!(LinearSystem::new(m, k), Error::Asymmetric { matrix: "mass", .. }, "-4e0", "-3e0");
    // One triangle alone is the usual way to get there.
    let lower = matrix(2, [(0, 0, 4.0), (1, 0, -4.0), (1, 1, 4.0)]);
    refused!(LinearSystem::lumped(vec![1.0; 2], lower), Error::Asymmetric { row: 1, column: 0, .. }, "both triangles");
}

#[test]
fn masses_must_be_positive() {
    refused!(LinearSystem::lumped(vec![1.0, -2.0], spring()), Error::Mass { dof: 1, .. }, "dof 1", "-2e0");
    // No mass is needed where the motion is given, nor where a scheme finds displacements without it.
    let massless = || LinearSystem::lumped(vec![0.0, 1.0], spring()).unwrap();
    assert!(Simulation::builder(massless(), Composite, 0.01).build().is_ok());
    assert!(Simulation::builder(massless(), CentralDifference, 0.01).build().is_ok());
    refused!(
        Simulation::builder(massless(), ChungLee::new(1.0).unwrap(), 0.01).build(),
        Error::Incompatible { .. },
        "dof 0",
        "does not determine"
    );
    let midpoint = Gssss::new(1.0, 1.0, 1.0).unwrap();
    refused!(Simulation::builder(massless(), midpoint, 0.01).build(), Error::Incompatible { .. }, "alternates");
    assert!(Simulation::builder(massless().fix(0).unwrap(), CentralDifference, 0.01).build().is_ok());
    refused!(LinearSystem::lumped(vec![f64::NAN, 1.0], spring()), Error::Mass { dof: 0, .. }, "NaN");
    let m = matrix(2, [(0, 0, 1.0), (0, 1, 0.1), (1, 0, 0.1), (1, 1, -1.0)]);
    refused!(LinearSystem::new(m, spring()), Error::Mass { dof: 1, .. }, "dof 1");
    // Positive diagonal, but indefinite: found when the initial acceleration is solved for.
    let m = matrix(2, [(0, 0, 1.0), (0, 1, 2.0), (1, 0, 2.0), (1, 1, 1.0)]);
    let indefinite = LinearSystem::new(m, spring()).unwrap();
    refused!(
        Simulation::builder(indefinite, Composite, 0.01).build(),
        Error::Singular { matrix: "mass matrix", .. },
        "mass matrix"
    );
    refused!(mass::lump(matrix::<f64>(2, [(0, 0, 1.0), (0, 1, -2.0), (1, 0, -2.0)]).as_ref()), Error::Mass { .. }, "-");
}

#[test]
fn singular_effective_matrix_names_the_dof() {
    // A spring so negative that no step size of this run makes up for it.
    let k = matrix(3, [(0, 0, 2.0), (1, 1, -1e9), (2, 2, 2.0)]);
    let negative = LinearSystem::lumped(vec![1.0; 3], k).unwrap();
    refused!(
        Simulation::builder(negative, Newmark::trapezoidal(), 0.01).build(),
        Error::Singular { dof: 1, .. },
        "dof 1",
        "positive definite"
    );
    // The same in a chain (simplicial) and in a dense block (supernodal factor).
    for n in [40, 12] {
        let mut entries = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let bandwidth = if n == 40 { 1 } else { n };
                if i != j && usize::abs_diff(i, j) <= bandwidth {
                    entries.push((i, j, -0.1));
                }
            }
            entries.push((i, i, if i == 7 { -5.0 } else { 9.0 }));
        }
        let a = matrix::<f64>(n, entries.iter().copied());
        let mut factor = LinearSolver::<f64>::analyze(&Cholesky::default(), a.symbolic(), &[]).unwrap();
        let found = factor.factorize(a.as_ref());
        assert!(matches!(found, Err(Error::Singular { dof: 7, .. })), "{n}: {found:?}");
    }
}

#[test]
fn parameters_outside_their_range_are_refused() {
    for h in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        refused!(Simulation::builder(system(), Composite, h).build(), Error::Parameter { .. }, "step size h");
    }
    refused!(builder().start_time(f64::NAN).build(), Error::Parameter { .. }, "start time");
    refused!(Newmark::new(-0.25, 0.5), Error::Parameter { .. }, "β");
    refused!(Newmark::new(0.25, 0.4), Error::Parameter { .. }, "γ", "4e-1");
    refused!(Newmark::new(f64::NAN, 0.5), Error::Parameter { .. }, "NaN");
    refused!(system().rayleigh(-1.0, 0.0), Error::Parameter { .. }, "Rayleigh");
    refused!(system().rayleigh(0.0, f64::NAN), Error::Parameter { .. }, "Rayleigh");
    refused!(builder().build().unwrap().run_until(f64::NAN, &mut ()), Error::Parameter { .. }, "end time");
}

#[test]
fn empty_and_misplaced_parts_are_refused() {
    refused!(LinearSystem::<f64>::lumped(vec![], matrix(0, [])), Error::Empty { what: "the system", .. }, "dof");
    refused!(system().fix(2), Error::MissingDof { dof: 2, dofs: 2, .. }, "support");
    refused!(system().fix(1).unwrap().drive(1, |_| [0.0; 3]), Error::RepeatedDof { dof: 1, .. }, "supports", "once");
    let rows = LinearRows::new().unilateral(&[(0, 1.0)], 1.0).unilateral(&[(0, 1.0), (9, -1.0)], 1.0);
    refused!(
        builder().constraint(rows).build(),
        Error::MissingContactDof { constraint: 0, dof: 9, dofs: 2 },
        "contact constraint 0",
        "dof 9"
    );
    let nowhere = LinearRows::new().unilateral(&[(0, 1.0)], 1.0).unilateral(&[], 1.0);
    refused!(builder().constraint(nowhere).build(), Error::EmptyContact { .. }, "0.1.0");
    let supported = Simulation::builder(system().fix(1).unwrap(), Composite, 0.01)
        .constraint(LinearRows::new().unilateral(&[(1, 1.0)], 1.0));
    refused!(supported.build(), Error::EmptyContact { .. }, "prescribed");
}

#[test]
fn contacts_that_contradict_each_other_are_named_and_leave_the_state() {
    // A mass between a wall and a stop that comes closer: squeezed to nothing at t = 0.1.
    let stop = GapOffset::moving(|t| [0.1 - 2.0 * t, -2.0, 0.0]);
    let rows = LinearRows::new().unilateral(&[(0, 1.0)], 0.1).unilateral(&[(0, -1.0)], stop);
    let mut run = builder().constraint(rows).uncorrected().build().unwrap();
    let mut before = (run.state().clone(), run.time());
    let found = loop {
        match run.step() {
            Ok(()) => before = (run.state().clone(), run.time()),
            Err(error) => break error,
        }
    };
    assert!((0.095..0.105).contains(&run.time()), "{}", run.time());
    let Error::ContradictoryContacts { contact, other, violation, .. } = found else { panic!("{found:?}") };
    assert_eq!(contact.feature + other.feature, 1);
    assert!(violation > 0.0 && violation < 0.03, "{violation}");
    assert!(found.is_recoverable());
    assert_eq!(before, (run.state().clone(), run.time()));
}

#[test]
fn a_start_that_violates_contact_is_refused_with_the_depth() {
    let rows = LinearRows::new().unilateral(&[(0, 1.0)], -0.25);
    refused!(builder().constraint(rows).build(), Error::InitialViolation { .. }, "-2.5e-1");
    let rows = LinearRows::new().equality(&[(0, 1.0)], 0.25);
    refused!(builder().constraint(rows).build(), Error::InitialViolation { .. }, "2.5e-1");
}

#[test]
fn initial_values_must_agree_with_supports() {
    let build = |u: f64, v: f64| {
        let driven = system().drive(0, |t| [0.5 + t, 1.0, 0.0]).unwrap();
        Simulation::builder(driven, Composite, 0.01).displacement(vec![u, 0.0]).velocity(vec![v, 0.0]).build()
    };
    refused!(build(0.4, 1.0), Error::PrescribedStart { what: "displacement", dof: 0, .. }, "4e-1", "5e-1");
    refused!(build(0.5, 2.0), Error::PrescribedStart { what: "velocity", dof: 0, .. }, "2e0");
    assert_eq!(build(0.0, 0.0).unwrap().state().displacement()[0], 0.5);
    assert_eq!(build(0.5, 1.0).unwrap().state().velocity()[0], 1.0);
}

#[test]
fn malformed_and_unsuitable_schemes_are_refused() {
    let rows = Rows { u: Z, v: Z - U[0], a: Z - U[0] - V[0] };
    let refuse =
        |stages: Vec<Stage>| Simulation::builder(system(), Tabulated("broken", Tableau::staged(stages)), 0.01).build();
    refused!(refuse(vec![]), Error::Tableau { .. }, "broken", "no stage");
    refused!(refuse(vec![Stage::new(Rows { v: f64::NAN * Z, ..rows })]), Error::Tableau { .. }, "not finite");
    refused!(refuse(vec![Stage::new(Rows { a: V[0], ..rows })]), Error::Tableau { .. }, "unknown");
    refused!(refuse(vec![Stage::new(rows).ending_at(0.5)]), Error::Tableau { .. }, "end of the step");
    // What follows from them is beyond all numbers: differences over the unknown, and ½ lead² a.
    let tiny = Rows { a: 1e-300 * Z - U[0], v: 1e300 * Z, ..rows };
    refused!(refuse(vec![Stage::new(tiny)]), Error::Tableau { .. }, "follows from its rows");
    let at = |contact| refuse(vec![Stage::new(rows).with_contact(contact)]);
    refused!(at(ContactLevel::Position { lead: f64::MAX }), Error::Tableau { .. }, "follows from its rows");
    // Contact before the state, and forecasts of what is not known.
    refused!(at(ContactLevel::Position { lead: -1.0 }), Error::Tableau { .. }, "before the stage's state");
    let forecast = |forecast| ContactLevel::Velocity { lead: 0.0, forecast, forecast_at: 1.0 };
    at(forecast(U[0] + V[0])).unwrap();
    refused!(at(forecast(f64::NAN * U[0])), Error::Tableau { .. }, "not finite");
    refused!(at(forecast(Z)), Error::Tableau { .. }, "known before");
    // Displacement without the unknown: a multiplier cannot close a gap.
    let explicit = Stage::new(Rows { u: U[0] + V[0], v: V[0] + Z, a: Z });
    let position = Simulation::builder(system(), Tabulated("broken", Tableau::single(explicit)), 0.01)
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 1.0));
    refused!(position.build(), Error::Incompatible { .. }, "broken", "gap");
    let diagonal = builder().linear_solver(Diagonal).build();
    refused!(diagonal, Error::Incompatible { .. }, "diagonal");
}

#[test]
fn history_of_another_run_is_refused() {
    let donor = |dofs: usize, h: f64, newmark: bool| {
        let k = matrix(dofs, [(0, 0, 1.0)]);
        let system = LinearSystem::lumped(vec![1.0; dofs], k).unwrap();
        let scheme: Box<dyn TimeIntegrator> =
            if newmark { Box::new(Newmark::trapezoidal()) } else { Box::new(Composite) };
        let run = Simulation::builder(system, scheme, h).build().unwrap();
        (run.state().clone(), run.history().clone())
    };
    let resume = |(state, history)| builder().resume(state, history).build();
    refused!(resume(donor(3, 0.01, false)), Error::Dimension { .. }, "history");
    refused!(resume(donor(2, 0.02, false)), Error::Parameter { .. }, "step size");
    refused!(resume(donor(2, 0.01, true)), Error::Incompatible { .. }, "Newmark", "composite");
    let same_size = Simulation::builder(system(), contact_dynamics::Bdf2, 0.01).build().unwrap();
    let other = (same_size.state().clone(), same_size.history().clone());
    refused!(resume(other), Error::Incompatible { .. }, "BDF2", "composite");
    assert!(resume(donor(2, 0.01, false)).is_ok());
}

#[test]
fn matrices_out_of_order_are_refused() {
    use contact_dynamics::faer::sparse::SymbolicSparseColMat;
    let pattern = SymbolicSparseColMat::<usize>::new_unsorted_checked(2, 2, vec![0, 2, 4], None, vec![1, 0, 0, 1]);
    let k = SparseColMat::new(pattern, vec![-4.0, 4.0, -4.0, 4.0]);
    refused!(LinearSystem::lumped(vec![1.0; 2], k), Error::Incompatible { .. }, "stiffness", "ascend");
    let pattern = SymbolicSparseColMat::<usize>::new_checked(2, 2, vec![0, 2, 4], Some(vec![1, 1]), vec![0, 0, 1, 0]);
    let k = SparseColMat::new(pattern, vec![4.0, 0.0, 4.0, 0.0]);
    refused!(LinearSystem::lumped(vec![1.0; 2], k), Error::Incompatible { .. }, "slack");
}

#[test]
fn a_support_that_moves_to_nowhere_fails_the_step() {
    // The driven dof has no stiffness to pass its NaN on: nobody else would notice.
    let k = matrix(2, [(0, 0, 0.0), (1, 1, 4.0)]);
    let system = LinearSystem::lumped(vec![1.0; 2], k)
        .unwrap()
        .drive(0, |t| if t > 0.05 { [f64::NAN, 0.0, 0.0] } else { [0.0; 3] })
        .unwrap();
    let mut run = Simulation::builder(system, Composite, 0.01).build().unwrap();
    run.run_until(0.05, &mut ()).unwrap();
    let before = run.state().clone();
    let found = error(run.step());
    assert!(matches!(found, Error::SupportNotFinite { dof: 0, .. }), "{found}");
    assert_eq!(&before, run.state());
}

#[test]
fn a_constraint_that_acts_where_it_has_no_dof_is_refused() {
    struct Liar {
        dofs: Vec<usize>,
        place: usize,
        reads: usize,
    }
    impl ContactConstraint<f64> for Liar {
        fn dofs(&self) -> &[usize] {
            &self.dofs
        }
        fn only_reads(&self, place: usize) -> bool {
            place == self.reads
        }
        fn contacts(&self, contacts: &mut Contacts<f64>) {
            contacts.push((4, 0), ContactLaw::Rigid, &[(self.place, 1.0)]);
        }
        fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
            assert_eq!(u.len(), self.dofs.len());
            gaps.fill(1.0);
            Ok(())
        }
    }
    let build = |dofs: &[usize], place, reads| {
        let first = LinearRows::new().unilateral(&[(0, 1.0)], 1.0);
        builder().constraint(first).constraint(Liar { dofs: dofs.to_vec(), place, reads }).build()
    };
    refused!(build(&[1], 1, 9), Error::UnlistedPlace { place: 1, .. }, "1.4.0", "place 1");
    refused!(build(&[0, 1], 1, 1), Error::UnlistedPlace { place: 1, .. }, "1.4.0", "only_reads");
    refused!(
        build(&[1, 7], 0, 9),
        Error::MissingContactDof { constraint: 1, dof: 7, dofs: 2 },
        "contact constraint 1",
        "dof 7"
    );
    refused!(build(&[1, 0, 1], 0, 9), Error::RepeatedContactDof { constraint: 1, dof: 1 }, "constraint 1", "once");
    // (What a constraint only reads another one may press.)
    assert!(build(&[0, 1], 1, 0).is_ok());
    assert!(build(&[1], 0, 9).is_ok());
}

/// A load that is NaN in some time window; the run before and after must be that of the good load.
#[test]
fn a_failed_step_leaves_state_and_history_bit_for_bit() {
    for mass in [MassKind::Lumped, MassKind::Consistent] {
        for scheme in [0, 1, 2] {
            let integrator = || -> Box<dyn TimeIntegrator> {
                match scheme {
                    0 => Box::new(Composite),
                    1 => Box::new(Newmark::trapezoidal()),
                    _ => Box::new(contact_dynamics::Bathe::default()),
                }
            };
            let bars = Bars::paper(20).delayed(0.3, 1e-3).with_mass(mass);
            let poison = std::sync::atomic::AtomicBool::new(false);
            let build = |poisoned: bool| {
                let poison = &poison;
                // Only the later half of a step is poisoned: the first stage of a two-stage scheme succeeds.
                let system = bars.system::<f64>().load(move |t, force: &mut [f64]| {
                    let late = (t / 1e-3).fract() > 0.7 || (t / 1e-3).fract() < 0.3;
                    if poisoned && late && poison.load(std::sync::atomic::Ordering::Relaxed) {
                        force[3] = f64::NAN;
                    }
                });
                Simulation::builder(system, integrator(), 1e-3)
                    .velocity(bars.velocities())
                    .constraint(bars.contact())
                    .corrector(PersistencyCorrection::with_history_projection())
                    .energy_balance()
                    .build()
                    .unwrap()
            };
            let (mut good, mut bad) = (build(false), build(true));
            for _ in 0..150 {
                poison.store(true, std::sync::atomic::Ordering::Relaxed);
                let before = bad.state().clone();
                let past: Vec<_> = (1..3).map(|k| bad.history().past(k).map(|(u, v, a)| [u, v, a].concat())).collect();
                let found = error(bad.step());
                assert!(matches!(found, Error::StepNotFinite { .. }) && found.is_recoverable(), "{found:?}");
                assert_eq!(&before, bad.state());
                let same: Vec<_> = (1..3).map(|k| bad.history().past(k).map(|(u, v, a)| [u, v, a].concat())).collect();
                assert_eq!(past, same);
                poison.store(false, std::sync::atomic::Ordering::Relaxed);
                bad.step().unwrap();
                good.step().unwrap();
                assert_eq!(good.state(), bad.state());
            }
            assert!(good.statistics().contact_solves > 0, "the impact is part of the run");
            assert_eq!(good.energy(), bad.energy());
        }
    }
}

#[test]
fn gaps_that_are_not_finite_fail_the_step() {
    let rows = LinearRows::new()
        .unilateral(&[(0, 1.0)], GapOffset::moving(|t| [if t > 0.05 { f64::NAN } else { 1.0 }, 0.0, 0.0]));
    let mut run = builder().constraint(rows).build().unwrap();
    run.run_until(0.05, &mut ()).unwrap();
    let before = run.state().clone();
    let found = error(run.step());
    assert!(matches!(found, Error::ContactNotFinite { .. }) && found.is_recoverable(), "{found}");
    assert_eq!(&before, run.state());
}
