//! Numbers at the edge of what a scalar or a memory holds, and indices that lead nowhere: typed errors, never a panic.
#![allow(clippy::float_cmp)] // What is compared is untouched, or exact.

use contact_dynamics::analysis;
use contact_dynamics::contact::{ContactJacobian, ContactLaw, Cylinder, Obstacle, Side, Sphere};
use contact_dynamics::contact_solver::{ContactSolver, GaussSeidel, Pivoting};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::faer::traits::ComplexField;
use contact_dynamics::integrator::Newmark;
use contact_dynamics::partitioned::{Assembly, Coupling};
use contact_dynamics::tableau::{Stage, Tableau, U, Z};
use contact_dynamics::{
    ActiveSet, Automatic, Bathe, Bdf2, ByBody, Cholesky, Composite, ConjugateGradients, Diagonal, Error,
    JumpProjection, LinearRows, LinearSolver, LinearSystem, Lu, Mass, Newton, Park, PersistencyCorrection, Real,
    Result, Simulation, StartUp, TimeIntegrator, Tridiagonal,
};
use contact_dynamics_scenes::sparse::{free, matrix};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

type Matrix<T> = SparseColMat<usize, T>;

/// A chain of springs of 3 with 1 added on the diagonal.
fn chain(n: usize) -> Matrix<f64> {
    let mut entries: Vec<_> = (0..n).map(|i| (i, i, 7.0)).collect();
    entries.extend((1..n).flat_map(|i| [(i, i - 1, -3.0), (i - 1, i, -3.0)]));
    matrix(n, entries.iter().copied())
}

fn ball<T: Real + ComplexField>() -> LinearSystem<'static, T> {
    LinearSystem::lumped(vec![T::one(), T::one()], matrix(2, [(0, 0, 1.0)])).unwrap()
}

#[test]
fn step_sizes_whose_square_leaves_the_scalar_are_refused() {
    fn at<T: Real + ComplexField>(h: f64) -> Result<Simulation<'static, T>> {
        Simulation::builder(ball::<T>(), Newmark::trapezoidal(), h).velocity(vec![T::one(); 2]).build()
    }
    for h in [1e-160, 1e-155, 1e155, 1e160, f64::MAX, f64::MIN_POSITIVE, 0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(at::<f64>(h), Err(Error::Parameter { name: "the step size h", .. })), "{h:e}");
        let mut run = at::<f64>(0.1).unwrap();
        let before = run.state().clone();
        assert!(matches!(run.set_step_size(h), Err(Error::Parameter { name: "the step size h", .. })), "{h:e}");
        assert!(run.step_size() == 0.1 && *run.state() == before);
        run.step().unwrap();
    }
    for h in [1e-25, 1e-20, 1e20] {
        assert!(matches!(at::<f32>(h), Err(Error::Parameter { name: "the step size h", .. })), "{h:e}");
        at::<f64>(h).unwrap().step().unwrap();
    }
    at::<f32>(1e-12).unwrap().step().unwrap();
}

#[test]
fn counts_beyond_reason_are_refused() {
    assert!(matches!(Newton::full().iterations(usize::MAX), Err(Error::Parameter { .. })));
    assert!(Newton::full().iterations(1_000_000).is_ok() && Newton::full().iterations(0).is_err());
    let law = |augmentations| ContactLaw::AugmentedLagrangian { stiffness: 1.0, augmentations };
    let build = |law| {
        let rows = LinearRows::new().row(law, &[(0, 1.0)], 0.1);
        Simulation::builder(ball::<f64>(), Composite, 0.1)
            .velocity(vec![-1.0; 2])
            .constraint(rows)
            .uncorrected()
            .build()
    };
    assert!(matches!(build(law(usize::MAX)), Err(Error::Parameter { .. })));
    build(law(3)).unwrap().step().unwrap();
    // Their dense problem would have 2^42 entries.
    let rows = vec![Coupling::unilateral(&[]); 1 << 21];
    assert!(matches!(Assembly::<f64>::new(&[], &rows), Err(Error::OutOfMemory { .. })));
}

fn solvers() -> Vec<Box<dyn LinearSolver<f64>>> {
    vec![
        Box::new(Automatic),
        Box::new(Cholesky::default()),
        Box::new(Tridiagonal),
        Box::new(Lu),
        Box::new(ByBody::default()),
        Box::new(ConjugateGradients::default()),
    ]
}

#[test]
fn linear_solvers_refuse_lists_of_contact_dofs_that_are_none() {
    let (coupled, apart) = (chain(4), matrix::<f64>(4, [(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (3, 3, 1.0)]));
    let diagonal = std::iter::once((Box::new(Diagonal) as Box<dyn LinearSolver<f64>>, &apart));
    for (solver, a) in solvers().into_iter().map(|solver| (solver, &coupled)).chain(diagonal) {
        let analyze = |last: &[usize]| solver.analyze(a.symbolic(), last);
        assert!(matches!(analyze(&[4]), Err(Error::MissingDof { dof: 4, dofs: 4, .. })), "{solver:?}");
        assert!(matches!(analyze(&[0, usize::MAX]), Err(Error::MissingDof { .. })), "{solver:?}");
        assert!(matches!(analyze(&[3, 3]), Err(Error::RepeatedDof { dof: 3, .. })), "{solver:?}");
        assert!(matches!(analyze(&[3, 2]), Err(Error::Incompatible { .. })), "{solver:?}");
        assert!(analyze(&[3]).is_ok());
    }
    let estimate = |last: &[usize]| Cholesky::default().estimate(coupled.symbolic(), last);
    assert!(matches!(estimate(&[9]), Err(Error::MissingDof { .. })));
    assert!(matches!(estimate(&[1, 1]), Err(Error::RepeatedDof { .. })));
}

#[test]
fn factorizations_refuse_other_matrices_than_were_analyzed() {
    let a = chain(4);
    let unlike = matrix::<f64>(4, [(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (3, 3, 1.0), (0, 3, 0.1), (3, 0, 0.1)]);
    // As many entries as the chain, elsewhere.
    let moved = [(0, 1, -3.0), (1, 0, -3.0), (1, 2, -3.0), (2, 1, -3.0), (0, 3, -3.0), (3, 0, -3.0)];
    let diagonal: Vec<_> = (0..4).map(|i| (i, i, 9.0)).chain(moved).collect();
    let moved = matrix(4, diagonal.iter().copied());
    for solver in solvers() {
        let mut factor = solver.analyze(a.symbolic(), &[]).unwrap();
        for other in [&chain(3), &chain(5), &unlike, &moved] {
            let refused = factor.factorize(other.as_ref());
            assert!(
                matches!(refused, Err(Error::Dimension { .. } | Error::Incompatible { .. })),
                "{solver:?}: {refused:?}"
            );
        }
        factor.factorize(a.as_ref()).unwrap();
        let mut x = [1.0, 1.0, 1.0, 1.0];
        factor.solve(&mut x).unwrap();
        assert!((7.0 * x[0] - 3.0 * x[1] - 1.0).abs() < 1e-9, "{solver:?}");
    }
    let mut factor: Box<dyn contact_dynamics::Factorization<f64>> =
        Diagonal.analyze(matrix::<f64>(2, [(0, 0, 1.0), (1, 1, 1.0)]).symbolic(), &[]).unwrap();
    for other in [matrix(3, [(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0)]), matrix(1, [(0, 0, 1.0)]), chain(2)] {
        assert!(factor.factorize(other.as_ref()).is_err());
    }
}

#[test]
fn jump_projections_and_products_with_mass_check_what_they_are_given() {
    let lumped = [2.0, 1.0];
    let consistent = matrix::<f64>(2, [(0, 0, 2.0), (1, 1, 1.0)]);
    for mass in [Mass::Lumped(&lumped), Mass::Consistent(consistent.as_ref())] {
        assert!(matches!(JumpProjection::new(mass, &[2]), Err(Error::MissingDof { dof: 2, dofs: 2, .. })));
        assert!(matches!(JumpProjection::new(mass, &[1, 1]), Err(Error::RepeatedDof { dof: 1, .. })));
        assert!(JumpProjection::new(mass, &[1, 0]).is_err());
        let mut g = ContactJacobian::default();
        g.push(&[(0, -1.0), (1, 1.0)]);
        g.push(&[(7, 1.0)]);
        let mut projection = JumpProjection::new(mass, &[]).unwrap();
        assert!(matches!(projection.close(&g, &[2]), Err(Error::Incompatible { .. })));
        assert!(matches!(projection.close(&g, &[0, 1]), Err(Error::MissingDof { dof: 7, dofs: 2, .. })));
        projection.close(&g, &[0]).unwrap();
        let mut v = [1.0, -2.0];
        for (targets, multipliers) in [(0, 1), (2, 1), (1, 0), (1, 2)] {
            let refused = projection.remove_jump(&g, &vec![0.0; targets], &mut v, &mut vec![0.0; multipliers]);
            assert!(matches!(refused, Err(Error::Dimension { .. })), "{targets} {multipliers}");
        }
        assert!(projection.remove_jump(&g, &[0.0], &mut [1.0, 2.0, 3.0], &mut [0.0]).is_err());
        assert!(projection.remove_jump(&ContactJacobian::default(), &[0.0], &mut v, &mut [0.0]).is_err());
        assert_eq!(v, [1.0, -2.0]);
        projection.remove_jump(&g, &[0.0], &mut v, &mut [0.0]).unwrap();
        assert!((v[0] - v[1]).abs() < 1e-15);

        let mut y = [0.0; 2];
        for x in [&[1.0][..], &[1.0; 3]] {
            assert!(matches!(mass.product(1.0, x, &mut y), Err(Error::Dimension { .. })));
        }
        assert!(mass.product(1.0, &[1.0; 2], &mut [0.0]).is_err());
        assert_eq!(y, [0.0; 2]);
        mass.product(2.0, &[1.0, 3.0], &mut y).unwrap();
        assert_eq!(y, [4.0, 6.0]);
    }
}

#[test]
fn rows_and_tableaux_are_asked_for_what_they_do_not_have() {
    assert_eq!((2.0 * Z - U[0]).past(9), [0.0; 3]);
    assert_eq!((2.0 * Z - U[0]).past(usize::MAX), [0.0; 3]);
    for scheme in [&Park as &dyn TimeIntegrator, &Bathe::default()] {
        let tableau = scheme.tableau();
        for s in [tableau.stages.len(), 9, usize::MAX] {
            assert!(matches!(tableau.read_after(s), Err(Error::Parameter { .. })));
            assert!(matches!(tableau.momentum().after_stage(s), Err(Error::Parameter { .. })));
        }
        assert!(tableau.read_after(0).is_ok() && tableau.momentum().after_stage(0).is_ok());
    }
    let none = Tableau::staged(Vec::<Stage>::new());
    assert!(matches!(analysis::report(&none), Err(Error::Tableau { .. })));
    // What answers without an error says of it that a step does nothing.
    assert_eq!(analysis::amplification(&none, 1.0, 0.0), contact_dynamics::faer::Mat::<f64>::identity(3, 3));
    assert_eq!(analysis::spectral_radius(&none, 1.0, 0.0), 1.0);
    assert!(analysis::eigenvalues(&none, 1.0, 0.1).len() == 3 && analysis::order(&none).displacement == 0);
    assert!(analysis::period_elongation(&none).is_none_or(|x| !x.is_normal()));
    let _ = (analysis::radius_at_infinity(&none), analysis::critical_omega(&none, 0.0), analysis::local_error(&none));
    let _ = (analysis::zero_stability(&none), analysis::overshoot(&none, 1.0, StartUp::Taylor), none.momentum());
    let _ = (analysis::massless_factor(&none), analysis::overshoot_growth(&none, StartUp::Trapezoidal));
    assert!(none.read_after(0).is_err() && analysis::period_and_damping(&none, 0.1, 0.0).is_none());
}

#[test]
fn round_obstacles_of_any_size() {
    for e in [-150, -30, 0, 30, 150] {
        let unit = 2.0 * 10_f64.powi(e);
        for (side, sign) in [(Side::Outside, 1.0), (Side::Inside, -1.0)] {
            let ball = Sphere::new([0.0; 3], unit, side).unwrap();
            let (distance, normal) = ball.distance([0.0, 3.0 * unit, 4.0 * unit]);
            assert!((distance / unit - sign * 4.0).abs() < 1e-15, "1e{e}: {distance:e}");
            assert!((normal[1] - sign * 0.6).abs() < 1e-15 && (normal[2] - sign * 0.8).abs() < 1e-15, "{normal:?}");
            // A speed of one radius per unit of time across: w²/|x|.
            let curvature = ball.curvature([0.0, 3.0 * unit, 4.0 * unit], [unit, 0.0, 0.0]);
            assert!((curvature / unit - sign * 0.2).abs() < 1e-15, "1e{e}: {curvature:e}");
            let pipe = Cylinder::new([0.0; 3], [1.0, 0.0, 0.0], unit, side).unwrap();
            assert!((pipe.distance([7.0 * unit, 0.0, 3.0 * unit]).0 / unit - sign * 2.0).abs() < 1e-15);
        }
    }
}

/// The load panics, at a call that can be chosen.
#[test]
fn after_a_panic_of_the_host_everything_is_refused_and_nothing_is_lost() {
    let build = |left: Arc<AtomicUsize>| {
        let system = LinearSystem::lumped(vec![1.0, 2.0], matrix(2, [(0, 0, 1.0), (1, 1, 3.0)])).unwrap().load(
            move |t, force| {
                if left.fetch_sub(1, Ordering::Relaxed) == 0 {
                    // A panic without its message on the screen.
                    resume_unwind(Box::new("the host gives up"));
                }
                force[0] += t;
            },
        );
        Simulation::builder(system, Park, 0.1)
            .velocity(vec![-1.0, 1.0])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.25))
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap()
    };
    for steps in [0, 2, 3, 7] {
        for call in 0..2 {
            let left = Arc::new(AtomicUsize::new(usize::MAX));
            let (mut run, mut reference) = (build(left.clone()), build(Arc::new(AtomicUsize::new(usize::MAX))));
            for _ in 0..steps {
                run.step().unwrap();
                reference.step().unwrap();
            }
            left.store(call, Ordering::Relaxed);
            let mut panicked = false;
            for _ in 0..3 {
                let energy = run.energy();
                let Ok(done) = catch_unwind(AssertUnwindSafe(|| run.step())) else {
                    panicked = true;
                    left.store(usize::MAX, Ordering::Relaxed);
                    assert_eq!(run.energy(), energy);
                    break;
                };
                done.unwrap();
                reference.step().unwrap();
            }
            assert!(panicked, "{steps} {call}");
            assert_eq!(run.state(), reference.state());
            let poisoned = |result: Result<()>| matches!(result, Err(Error::Poisoned));
            assert!(poisoned(run.step()) && poisoned(run.set_step_size(0.05)) && poisoned(run.restart()));
            assert!(poisoned(run.run_until(9.0, &mut ()).map(drop)) && poisoned(run.land_on(9.0, &mut ()).map(drop)));
            assert!(poisoned(run.momentum(&[1.0; 2]).map(drop)) && poisoned(run.reactions().map(drop)));
            assert!(!Error::Poisoned.is_recoverable() && Error::Poisoned.to_string().contains("resume"));
            // The remedy.
            let (state, history) = (run.state().clone(), run.history().clone());
            let system = LinearSystem::lumped(vec![1.0, 2.0], matrix(2, [(0, 0, 1.0), (1, 1, 3.0)]))
                .unwrap()
                .load(|t, force| force[0] += t);
            let mut again = Simulation::builder(system, Park, 0.1)
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.25))
                .corrector(PersistencyCorrection::with_history_projection())
                .resume(state, history)
                .build()
                .unwrap();
            for _ in 0..5 {
                again.step().unwrap();
                reference.step().unwrap();
            }
            assert_eq!(again.state(), reference.state());
        }
    }
}

/// Makes a contact solver.
type Solver = fn() -> Box<dyn ContactSolver<f64>>;

#[test]
fn motion_that_dies_out_leaves_nothing_to_be_solved() {
    let solvers: [Solver; 3] =
        [|| Box::new(ActiveSet::default()), || Box::new(Pivoting::default()), || Box::new(GaussSeidel::default())];
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] =
        [|| Box::new(Newmark::trapezoidal()), || Box::new(Bathe::default()), || Box::new(Bdf2)];
    for solver in solvers {
        for scheme in schemes {
            // One mass is held, the other flies on: what rounding has left of the first one's motion decays below all
            // numbers.
            let rows = LinearRows::new().equality(&[(1, -1.0)], 0.0).unilateral(&[(2, 1.0)], 0.0);
            let mut run = Simulation::builder(free(&[1.0, 0.51, 0.7]), scheme(), 3.09)
                .velocity(vec![-1.97e-6; 3])
                .constraint(rows)
                .corrector(PersistencyCorrection::with_history_projection())
                .contact_solver(solver())
                .build()
                .unwrap();
            for _ in 0..600 {
                run.step().unwrap();
            }
            let v = run.state().velocity();
            assert!((v[0] / -1.97e-6 - 1.0).abs() < 1e-12 && v[1].abs() < 1e-18 && v[2].abs() < 1e-18, "{v:?}");
        }
    }
}
