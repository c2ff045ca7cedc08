//! What errors and states say: a host's own words with the step, a mass that is too short, facets that are inverted,
//! and what contact forces and impulses are.
#![cfg(feature = "mesh-contact")]

use contact_dynamics::contact::{ContactId, Facet, NodeToFacet};
use contact_dynamics::contact_solver::ContactFailure;
use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{
    Composite, Error, LinearRows, LinearSystem, Mass, Newmark, PersistencyCorrection, Result, Simulation, StepControl,
    System, TangentWeights, TimeIntegrator,
};
use contact_dynamics_scenes::sparse::{matrix, rectangular, springs};
use std::error::Error as _;

#[derive(Debug)]
struct Torn(f64);

impl std::fmt::Display for Torn {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the bar is torn at a stretch of {}", self.0)
    }
}

impl std::error::Error for Torn {}

/// A spring that tears at u = 1.
struct Spring(SymbolicSparseColMat<usize>);

impl System<f64> for Spring {
    fn dofs(&self) -> usize {
        1
    }
    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&[1.0])
    }
    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        if u[0] > 1.0 {
            return Err(Error::Inadmissible { callback: "force", source: Box::new(Torn(1.25)) });
        }
        out[0] = -0.01 * u[0];
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.0.as_ref()
    }
    fn tangent(&mut self, _: f64, _: &[f64], _: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out[0] = 0.01 * w.stiffness;
        Ok(())
    }
}

#[test]
fn what_a_host_does_not_admit_comes_with_its_words_and_the_step() {
    let build = || {
        let pattern = SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]);
        Simulation::builder(Spring(pattern), Newmark::trapezoidal(), 0.25).velocity(vec![1.0])
    };
    let error = build().build().unwrap().run_until(5.0, &mut ()).unwrap_err();
    let Error::Inadmissible { callback: "force", source } = &error else { panic!("{error}") };
    // The host's own error is at the end of the chain.
    assert!(source.source().is_some_and(|own| own.downcast_ref::<Torn>().is_some()));
    let text = error.to_string();
    for words in ["force", "torn at a stretch of 1.25", "t = 1e0", "h = 2.5e-1"] {
        assert!(text.contains(words), "`{text}` lacks `{words}`");
    }
    let control = StepControl::halving(0.1).unwrap();
    let refused = build().step_control(control).build().unwrap().run_until(5.0, &mut ()).unwrap_err().to_string();
    assert!(refused.contains("torn") && refused.contains("h = 1.25e-1"), "{refused}");
    let host = Error::Host { callback: "commit", source: Box::new(Torn(2.0)) }.to_string();
    assert!(host.contains("commit") && host.contains("torn"), "{host}");
}

/// What `{}` prints, and what is printed of a chain of sources.
#[test]
fn a_cause_is_printed_once() {
    let torn = || Error::Inadmissible { callback: "force", source: Box::new(Torn(1.25)) };
    let failure = ContactFailure::NotConverged { iterations: 7, row: 3, residual: 0.5 };
    for (error, cause) in [
        (Error::StepRefused { t: 1.0, h: 0.1, attempts: 2, source: Box::new(torn()) }, "the bar is torn"),
        (torn(), "the bar is torn"),
        (Error::Host { callback: "commit", source: Box::new(Torn(2.0)) }, "the bar is torn"),
        (Error::Frame { failure }, "not solved after 7 iterations"),
    ] {
        let (mut chain, mut next) = (vec![error.to_string()], error.source());
        while let Some(source) = next {
            chain.push(source.to_string());
            next = source.source();
        }
        for printed in [error.to_string(), chain.join("\nCaused by: ")] {
            assert_eq!(printed.matches(cause).count(), 1, "{printed}");
        }
    }
}

/// Digits that tell nothing are not printed; those of numbers that are compared are.
#[test]
fn numbers_are_printed_with_few_digits() {
    let (t, h, x, contact) = (12.0 + 1.0 / 3.0, 1e-4 / 3.0, 2e-14 / 3.0, ContactId::default());
    for (error, words) in [
        (Error::Contact { t, iterations: 9, contact, residual: x }, vec!["t = 1.23333333e1:", "by 6.667e-15 (gap"]),
        (
            Error::NewtonNotConverged { t, h, iterations: 9, residual: x, increment: 1.0, dof: 0 },
            vec!["t = 1.23333333e1 with h = 3.333e-5:", "residual 6.667e-15, relative increment 1e0,"],
        ),
        (Error::PassedThrough { t, h, contact, what: "went", way: -x, gap: 0.5 }, vec!["of 5e-1, went -6.667e-15 "]),
        (Error::Mass { dof: 0, value: -f64::MAX }, vec!["is -1.7976931348623157e308,"]),
        (
            Error::Asymmetric { matrix: "mass", row: 1, column: 0, value: 1.0, mirrored: 1.0 + 4.0 * f64::EPSILON },
            vec!["is 1e0, entry", "is 1.0000000000000009e0;"],
        ),
    ] {
        let message = error.to_string();
        assert!(words.iter().all(|words| message.contains(words)), "{message}");
    }
    let failure = ContactFailure::NotConverged { iterations: 9, row: 0, residual: 2.0_f32 / 3.0 };
    assert!(failure.to_string().ends_with("by 6.667e-1"), "{failure}");
}

#[test]
fn a_short_mass_is_called_that() {
    let stiffness = |n: usize, m: usize| rectangular::<f64>(n, m, (0..n.min(m)).map(|i| (i, i, 1.0)));
    for (masses, dofs) in [(2, 3), (4, 3)] {
        let lumped = LinearSystem::lumped(vec![1.0; masses], stiffness(dofs, dofs));
        let consistent = LinearSystem::new(stiffness(masses, masses), stiffness(dofs, dofs));
        for refused in [lumped, consistent] {
            let Err(Error::Dimension { what, expected, found }) = refused else { panic!("accepted") };
            assert!(what.contains("mass") && (expected, found) == (dofs, masses), "{what} {expected} {found}");
        }
    }
    let oblong = LinearSystem::lumped(vec![1.0; 3], stiffness(3, 2));
    assert!(matches!(oblong, Err(Error::Dimension { what, found: 2, .. }) if what.contains("stiffness")));
}

#[test]
fn inverted_facets_are_named() {
    // Three quadrilaterals in a row, and a node above; one of them is turned, whichever.
    let nodes: Vec<[f64; 3]> =
        (0..8).map(|k| [f64::from(k / 2), f64::from(k % 2), 0.0]).chain([[0.5, 0.5, 1.0]]).collect();
    let dofs: Vec<[usize; 3]> = (0..9).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let quad = |k: usize| [2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1];
    let build = |facets: Vec<[usize; 4]>| {
        NodeToFacet::one_pass(&nodes, &dofs, &[8], facets.into_iter().map(Facet::from)).map(|_| ())
    };
    build((0..3).map(quad).collect()).unwrap();
    for turned in 0..3 {
        let mut facets: Vec<_> = (0..3).map(quad).collect();
        facets[turned].reverse();
        let error = build(facets.clone()).unwrap_err();
        assert!(error.to_string().contains("inverted") && error.to_string().contains("turn it"), "{error}");
        let Error::InvertedFacet { facet, nodes, .. } = error else { panic!("{error}") };
        assert_eq!((facet, &nodes[..]), (turned, &facets[turned][..]));
        // Without area, without at a corner, and folded.
        for (wrong, words) in [([0, 2, 4, 2], "area"), ([0, 2, 4, 5], "straight"), ([0, 3, 2, 1], "both sides")] {
            let mut facets: Vec<_> = (0..3).map(quad).collect();
            facets[0] = wrong;
            let error = build(facets).unwrap_err();
            assert!(matches!(error, Error::InvertedFacet { facet: 0, .. }), "{error}");
            assert!(error.to_string().contains(words), "{error}");
        }
    }
}

/// A chain that falls on a floor: impulses are what its momentum changes by, sums of forces are not.
#[test]
fn impulses_close_and_forces_do_not() {
    let n = 6;
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Newmark::trapezoidal()), || Box::new(Composite)];
    for scheme in schemes {
        let mut missed = 0.0_f64;
        for phase in [0.07, 0.3, 0.5, 0.8, 0.99] {
            let k = matrix(n, springs(n, 50.0));
            let h = 0.1;
            let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0; n], k).unwrap(), scheme(), h)
                .velocity(vec![-1.0; n])
                .constraint(LinearRows::new().unilateral(&[(0, 1.0)], h * (1.0 + phase)))
                .corrector(PersistencyCorrection::with_history_projection())
                .build()
                .unwrap();
            let all = vec![1.0; n];
            let before = run.momentum(&all).unwrap();
            let (mut impulses, mut forces) = (0.0, 0.0);
            for _ in 0..60 {
                run.step().unwrap();
                let contacts = run.state().contacts();
                impulses += contacts.impulses()[0];
                forces += h * contacts.forces()[0];
            }
            let change = run.momentum(&all).unwrap() - before;
            assert!(change > 5.0 && (impulses / change - 1.0).abs() < 1e-12, "{impulses} {change}");
            missed = missed.max((forces / change - 1.0).abs());
        }
        assert!(missed > 0.005, "{missed:e}");
    }
}
