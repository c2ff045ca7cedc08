//! What runs over ranks refuse when they are built, on all ranks.

use crate::bodies::{Blocks, linear_part};
use crate::parts::{Part, SolidPart, on_ranks};
use contact_dynamics::faer::sparse::{Pair, SymbolicSparseColMat};
use contact_dynamics::ranks::{Ranks, parts};
use contact_dynamics::{
    CentralDifference, Cholesky, ChungLee, Composite, Error, LinearRows, LinearSystem, Result, Simulation,
    SimulationBuilder,
};
use contact_dynamics_scenes::hosts::Bare;
use std::ops::Range;
use std::sync::Arc;

/// The errors of all ranks.
fn errors(set_up: impl Fn(usize, &SolidPart<2>, &Blocks) -> SimulationBuilder<'static, f64> + Sync) -> Vec<Error> {
    let blocks = Blocks::new();
    on_ranks(2, |rank, meeting| {
        let (_, builder) = blocks.on_rank((rank, meeting), |part| set_up(rank, part, &blocks)).unwrap();
        builder.build().expect_err("it is refused")
    })
}

/// Asserts what all ranks say.
macro_rules! refused {
    ($errors:expr, $variant:pat, $word:expr) => {{
        for error in $errors {
            assert!(matches!(error, $variant), "{error:?}");
            assert!(error.to_string().contains($word), "{error}");
        }
    }};
}

#[test]
fn solvers_of_one_rank() {
    let blocks = Blocks::new();
    let errors = on_ranks(2, |rank, meeting| {
        let set_up = |part: &SolidPart<2>| Simulation::builder(linear_part(part, false), Composite, 1e-3);
        let (_, builder) = blocks.on_rank((rank, meeting), set_up).unwrap();
        builder.linear_solver(Cholesky::default()).build().expect_err("it is refused")
    });
    refused!(errors, Error::Incompatible { .. }, "spans_ranks");
}

#[test]
fn ranks_that_differ() {
    let step = |rank: usize| if rank == 0 { 1e-3 } else { 1.1e-3 };
    let found = errors(|rank, part, _| Simulation::builder(linear_part(part, false), Composite, step(rank)));
    refused!(found, Error::RanksDiffer { .. }, "the step size");
    let found = errors(|rank, part, _| {
        let builder = Simulation::builder(linear_part(part, false), Composite, 1e-3);
        match rank {
            0 => builder.constraint(LinearRows::new().unilateral(&[(0, 1.0)], 1.0)),
            _ => builder,
        }
    });
    refused!(found, Error::RanksDiffer { .. }, "the number of contact rows");
}

#[test]
fn steps_and_ends_that_differ() {
    let blocks = Blocks::new();
    on_ranks(2, |rank, meeting| {
        let set_up = |part: &SolidPart<2>| Simulation::builder(linear_part(part, false), Composite, 1e-3);
        let (_, builder) = blocks.on_rank((rank, meeting), set_up).unwrap();
        let mut run = builder.build().unwrap();
        let other = 1.0 + rank as f64;
        let step = run.set_step_size(1e-3 * other).expect_err("it is refused");
        assert!(matches!(step, Error::RanksDiffer { what: "the step size", .. }), "{step:?}");
        let end = run.run_until(1e-2 * other, &mut ()).expect_err("it is refused");
        assert!(matches!(end, Error::RanksDiffer { what: "the end time", .. }), "{end:?}");
        // Nothing has moved, and the run goes on.
        assert_eq!(run.statistics().steps, 0);
        run.run_until(1e-2, &mut ()).unwrap();
        assert_eq!(run.statistics().steps, 10);
    });
}

/// Ranks that claim other dofs than they own.
#[derive(Debug)]
struct Claiming(Arc<Part>, Vec<Range<usize>>);

impl Ranks<f64> for Claiming {
    fn rank(&self) -> usize {
        self.0.rank()
    }
    fn owned(&self) -> &[Range<usize>] {
        &self.1
    }
    fn sum(&self, values: &mut [f64]) -> Result<()> {
        self.0.sum(values)
    }
    fn max(&self, values: &mut [f64]) -> Result<()> {
        self.0.max(values)
    }
    fn share(&self, values: &mut [f64]) -> Result<()> {
        self.0.share(values)
    }
}

#[test]
fn dofs_without_an_owner_or_with_several() {
    let claiming = |owned: fn(usize, usize) -> Vec<Range<usize>>| {
        errors(move |rank, part, _| {
            let ranks = Claiming(part.part.clone(), owned(rank, part.part.whole.len()));
            let solid = &part.cut.solid;
            let system = LinearSystem::lumped(solid.lumped_mass(), solid.stiffness()).unwrap();
            Simulation::builder(system.over_ranks(Arc::new(ranks)), Composite, 1e-3)
        })
    };
    // (A vector of ranges, one of which is all.)
    refused!(claiming(|_, dofs| std::iter::once(0..dofs).collect()), Error::RanksDiffer { .. }, "owners");
    refused!(claiming(|_, _| Vec::new()), Error::RanksDiffer { .. }, "owners");
    let beyond = claiming(|rank, dofs| std::iter::once(0..dofs + rank).collect());
    assert!(matches!(beyond[1], Error::MissingDof { .. }), "{beyond:?}");
    assert!(matches!(beyond[0], Error::OtherRank { rank: 1, recoverable: false, .. }), "{beyond:?}");
    let overlapping = claiming(|_, dofs| vec![0..dofs, 3..dofs]);
    refused!(overlapping, Error::Incompatible { .. }, "overlap");
}

#[test]
fn contact_dofs_in_another_order() {
    // Two masses that are not coupled, and a row on both; rank 1 numbers them the other way round.
    let errors = on_ranks(2, |rank, meeting| {
        let part = Part::renumbered(meeting, rank, &[0, 0], if rank == 0 { vec![0, 1] } else { vec![1, 0] });
        let system = LinearSystem::lumped(vec![1.0; 2], contact_dynamics_scenes::sparse::diagonal(&[1.0; 2])).unwrap();
        Simulation::builder(system.over_ranks(part), Composite, 1e-3)
            .constraint(LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 1.0))
            .build()
            .expect_err("it is refused")
    });
    refused!(errors, Error::RanksDiffer { .. }, "the place of a contact dof");
}

#[test]
fn dofs_without_mass_and_unknown_frequencies() {
    let found = errors(|_, part, _| {
        let mut mass: Vec<f64> = part.cut.solid.lumped_mass();
        mass[part.part.owned()[0].start] = 0.0;
        let system = LinearSystem::lumped(mass, part.cut.solid.stiffness()).unwrap();
        Simulation::builder(system.over_ranks(part.part.clone()), Composite, 1e-3)
    });
    refused!(found, Error::Incompatible { .. }, "dofs without mass");
    let far = errors(|_, part, _| Simulation::builder(linear_part(part, false), CentralDifference, 0.1));
    refused!(far, Error::BeyondStability { .. }, "stab");
    let lagging = errors(|_, part, _| {
        let damped = linear_part(part, false).rayleigh(0.0, 1e-3).unwrap();
        Simulation::builder(damped, ChungLee::new(1.0).unwrap(), 1e-5)
    });
    refused!(lagging, Error::Incompatible { .. }, "damping");
    // Nothing is known of a host that has a force alone.
    let unknown = errors(|_, part, _| {
        let dofs = part.part.whole.len();
        Simulation::builder(Bare::force_alone(linear_part(part, false), dofs), CentralDifference, 1e-5)
    });
    refused!(unknown, Error::Incompatible { .. }, "highest_frequency");
}

#[test]
fn patterns_that_cannot_be_cut() {
    let pattern = |rows: usize, columns: usize, pairs: &[(usize, usize)]| {
        let pairs: Vec<_> = pairs.iter().map(|&(row, col)| Pair { row, col }).collect();
        SymbolicSparseColMat::<usize>::try_new_from_indices(rows, columns, &pairs).unwrap().0
    };
    let chain = pattern(3, 3, &[(0, 1), (1, 0), (1, 2), (2, 1)]);
    assert!(matches!(parts(chain.as_ref(), 0), Err(Error::Parameter { .. })));
    let flat = pattern(2, 3, &[(0, 1)]);
    assert!(matches!(parts(flat.as_ref(), 2), Err(Error::Dimension { expected: 2, found: 3, .. })));
    let triangle = pattern(3, 3, &[(0, 0), (1, 0), (1, 1), (2, 2)]);
    assert!(matches!(parts(triangle.as_ref(), 2), Err(Error::Incompatible { .. })));
    // More parts than rows: some are empty. No rows: no parts.
    assert_eq!(parts(chain.as_ref(), 5).unwrap().len(), 3);
    assert!(parts(chain.as_ref(), 5).unwrap().iter().all(|&part| part < 5));
    assert!(parts(pattern(0, 0, &[]).as_ref(), 2).unwrap().is_empty());
}
