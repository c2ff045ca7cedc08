//! The bodies of these tests, in one piece and over ranks, and what is recorded of their runs.

use crate::parts::{Gathered, Meeting, Part, SolidPart, on_ranks};
use contact_dynamics::contact::Plane;
use contact_dynamics::{
    ContactConstraint, ContactLaw, LinearRows, LinearSolver, LinearSystem, NodesOnObstacle, Result, Simulation,
    SimulationBuilder,
};
use contact_dynamics_scenes::solids::{Material, Solid};
use std::sync::Arc;

pub(crate) const MATERIAL: Material = Material { young: 100.0, poisson: 0.25, density: 1.0 };

/// Two blocks, one on the other with a gap, thrown at a floor.
pub(crate) struct Blocks {
    pub(crate) solid: Solid<2>,
    /// The nodes of the floor's contact, and pairs of nodes of the blocks (lower, upper).
    pub(crate) bottom: Vec<usize>,
    pub(crate) pairs: Vec<[usize; 2]>,
    /// Gap of the floor, and between the blocks.
    pub(crate) gaps: [f64; 2],
}

impl Blocks {
    pub(crate) fn new() -> Self {
        let gaps = [0.013, 0.021];
        let lower = Solid::rectangle([1.2, 0.8], [4, 3], MATERIAL);
        let upper = Solid::rectangle([1.2, 0.6], [4, 2], MATERIAL).moved([0.0, 0.8 + gaps[1]]);
        let first = lower.nodes.len();
        let at = |solid: &Solid<2>, height: f64| -> Vec<usize> {
            (0..solid.nodes.len()).filter(|&node| (solid.nodes[node][1] - height).abs() < 1e-9).collect()
        };
        let (bottom, top, under) = (at(&lower, 0.0), at(&lower, 0.8), at(&upper, 0.8 + gaps[1]));
        let pairs = top.into_iter().zip(under).map(|(lower, upper)| [lower, first + upper]).collect();
        Self { solid: lower.with(upper), bottom, pairs, gaps }
    }

    /// The nodes that contact may act on.
    pub(crate) fn contact_nodes(&self) -> Vec<usize> {
        self.bottom.iter().copied().chain(self.pairs.iter().flatten().copied()).collect()
    }

    /// Initial velocities of the whole.
    pub(crate) fn velocity(&self) -> Vec<f64> {
        let turn = |[x, y]: [f64; 2]| [0.6 - 0.3 * y, -1.5 + 0.4 * x];
        self.solid.nodes.iter().flat_map(|&node| turn(node)).collect()
    }

    /// Contact with friction, in the dofs that `local` gives for a node.
    pub(crate) fn contact(
        &self,
        friction: f64,
        local: impl Fn(usize) -> usize,
    ) -> Result<Vec<Box<dyn ContactConstraint<f64>>>> {
        let dofs = |node: usize| [0, 1].map(|axis| Solid::<2>::dof(local(node), axis));
        let bottom: Vec<_> = self.bottom.iter().map(|&node| self.solid.nodes[node]).collect();
        let places: Vec<_> = self.bottom.iter().map(|&node| dofs(node)).collect();
        let all: Vec<_> = (0..bottom.len()).collect();
        let floor = Plane::new([0.0, -self.gaps[0]], [0.0, 1.0])?;
        let floor = NodesOnObstacle::new(floor, &bottom, &places, &all)?.friction(friction);
        let mut rows = LinearRows::new();
        for &[lower, upper] in &self.pairs {
            let (lower, upper) = (dofs(lower), dofs(upper));
            let law = (ContactLaw::Rigid, friction);
            rows = rows.pair_with_friction(law, lower, upper, [0.0, 1.0], self.gaps[1])?;
        }
        Ok(vec![Box::new(floor), Box::new(rows)])
    }

    /// The run of one rank, as `set_up` makes it of the rank's part.
    pub(crate) fn on_rank(
        &self,
        (rank, meeting): (usize, &Arc<Meeting>),
        set_up: impl Fn(&SolidPart<2>) -> SimulationBuilder<'static, f64>,
    ) -> Result<(SolidPart<2>, SimulationBuilder<'static, f64>)> {
        let part = SolidPart::new(&self.solid, &self.contact_nodes(), rank, meeting);
        let builder = set_up(&part)
            .velocity(part.part.of(&self.velocity()))
            .constraints(self.contact(0.3, |node| part.cut.local(node).unwrap())?)
            .linear_solver(Gathered(part.part.clone()));
        Ok((part, builder))
    }
}

/// The matrices of a part of a solid with a lumped or a consistent mass.
pub(crate) fn linear(solid: &Solid<2>, consistent: bool) -> LinearSystem<'static, f64> {
    match consistent {
        false => LinearSystem::lumped(solid.lumped_mass(), solid.stiffness()).unwrap(),
        true => LinearSystem::new(solid.consistent_mass(), solid.stiffness()).unwrap(),
    }
}

/// Same, over ranks.
pub(crate) fn linear_part(part: &SolidPart<2>, consistent: bool) -> LinearSystem<'static, f64> {
    linear(&part.cut.solid, consistent).over_ranks(part.part.clone())
}

/// What is seen of a step: the motion of the whole body, contact forces, and sums.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    pub(crate) motion: [Vec<f64>; 3],
    pub(crate) forces: Vec<f64>,
    pub(crate) sums: [f64; 3],
    pub(crate) h: f64,
}

/// Takes steps; `whole` makes vectors of the whole body of those of the run.
pub(crate) fn record(
    run: &mut Simulation<'_, f64>,
    steps: usize,
    whole: impl Fn(&[f64]) -> Vec<f64>,
    direction: &[f64],
) -> Result<Vec<Seen>> {
    let mut seen = Vec::new();
    for _ in 0..steps {
        run.step()?;
        let energy = run.energy();
        let works = energy.works.map_or(0.0, |works| works.friction + works.contact + works.load);
        let sums = [energy.total(), works, run.momentum(direction)?];
        let state = run.state();
        let motion = [state.displacement(), state.velocity(), state.acceleration()].map(&whole);
        seen.push(Seen { motion, forces: state.contacts().forces().to_vec(), sums, h: run.step_size() });
    }
    Ok(seen)
}

/// What is set of a run besides its system and scheme.
pub(crate) type Setting = fn(SimulationBuilder<'static, f64>) -> SimulationBuilder<'static, f64>;

/// A run in one piece and over 1, 2 and 3 ranks; the largest difference of any value that was seen, over the largest
/// value of its kind. Something must touch in more than a tenth of the steps.
pub(crate) fn largest_difference(
    blocks: &Blocks,
    steps: usize,
    whole: impl Fn() -> SimulationBuilder<'static, f64>,
    part: impl Fn(&SolidPart<2>) -> SimulationBuilder<'static, f64> + Sync,
    setting: Setting,
) -> f64 {
    largest_difference_with(blocks, steps, whole, part, setting, |part| Box::new(Gathered(part.clone()))).0
}

/// Same, with another linear solver over ranks; and the number of products for contact over ranks.
pub(crate) fn largest_difference_with(
    blocks: &Blocks,
    steps: usize,
    whole: impl Fn() -> SimulationBuilder<'static, f64>,
    part: impl Fn(&SolidPart<2>) -> SimulationBuilder<'static, f64> + Sync,
    setting: Setting,
    solver: impl Fn(&Arc<Part>) -> Box<dyn LinearSolver<f64>> + Sync,
) -> (f64, u64) {
    let direction = |nodes: usize| [1.0, 0.5].repeat(nodes);
    let builder = whole().velocity(blocks.velocity()).constraints(blocks.contact(0.3, |node| node).unwrap());
    let mut run = setting(builder).build().unwrap();
    let expected = record(&mut run, steps, <[f64]>::to_vec, &direction(blocks.solid.nodes.len())).unwrap();
    let touching = expected.iter().filter(|seen| seen.forces.iter().any(|&force| force > 0.0)).count();
    assert!(touching > steps / 10, "{touching} steps in contact");
    let (mut largest, mut products) = (0.0_f64, 0);
    for count in 1..=3 {
        let runs = on_ranks(count, |rank, meeting| {
            let (own, builder) = blocks.on_rank((rank, meeting), |own| part(own)).unwrap();
            let mut run = setting(builder.linear_solver(solver(&own.part))).build().unwrap();
            let whole = |values: &[f64]| own.part.gather(values).unwrap();
            let seen = record(&mut run, steps, whole, &direction(own.cut.nodes.len())).unwrap();
            (seen, run.statistics().contact_products)
        });
        let (runs, counts): (Vec<_>, Vec<_>) = runs.into_iter().unzip();
        products += counts[0];
        for run in &runs {
            for (seen, first) in run.iter().zip(&runs[0]) {
                let bits = |seen: &Seen| -> Vec<u64> { seen.forces.iter().map(|force| force.to_bits()).collect() };
                assert_eq!(bits(seen), bits(first), "contact is the same on all ranks to the bit");
            }
        }
        largest = largest.max(difference(&expected, &runs[0]));
    }
    (largest, products)
}

/// The largest difference of two records, each kind of value over its largest.
pub(crate) fn difference(expected: &[Seen], found: &[Seen]) -> f64 {
    assert_eq!(expected.len(), found.len());
    let mut worst = 0.0_f64;
    let kinds: [fn(&Seen) -> &[f64]; 5] = [
        |seen| &seen.motion[0],
        |seen| &seen.motion[1],
        |seen| &seen.motion[2],
        |seen| &seen.forces,
        |seen| &seen.sums,
    ];
    for kind in kinds {
        let size = expected.iter().flat_map(kind).fold(0.0_f64, |size, x| size.max(x.abs()));
        for (expected, found) in expected.iter().zip(found) {
            let (expected, found) = (kind(expected), kind(found));
            assert_eq!(expected.len(), found.len());
            for (x, y) in expected.iter().zip(found) {
                let apart = (x - y).abs() / size.max(f64::MIN_POSITIVE);
                worst = if apart.is_nan() { f64::INFINITY } else { worst.max(apart) };
            }
        }
    }
    for (expected, found) in expected.iter().zip(found) {
        assert_eq!(expected.h.to_bits(), found.h.to_bits(), "step sizes");
    }
    worst
}
