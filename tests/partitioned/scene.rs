//! Two bodies that meet, one numbered behind the other: bars and blocks; and how far two motions are apart.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{
    Corrector, LinearRows, LinearSolver, LinearSystem, Newton, PersistencyCorrection, Simulation, System,
    TimeIntegrator,
};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::diagonal;
use contact_dynamics_scenes::{Bars, MassKind};

pub(crate) const H: f64 = 1e-3;

/// Two bodies, the dofs of one behind those of the other, with matching contact dofs along one axis.
pub(crate) struct Scene {
    pub(crate) stiffness: SparseColMat<usize, f64>,
    pub(crate) mass: SparseColMat<usize, f64>,
    pub(crate) lumped: Option<Vec<f64>>,
    /// Number of dofs of the first body.
    pub(crate) split: usize,
    /// Contact dofs of the first and the second body, and the gaps between them.
    pub(crate) pairs: Vec<[usize; 2]>,
    pub(crate) gaps: Vec<f64>,
    pub(crate) velocity: Vec<f64>,
}

impl Scene {
    pub(crate) fn bars(bars: &Bars) -> Self {
        let lumped = (bars.mass == MassKind::Lumped).then(|| bars.lumped_mass());
        Self {
            stiffness: bars.stiffness(),
            mass: lumped.as_deref().map_or_else(|| bars.consistent_mass(), diagonal),
            lumped,
            split: bars.elements[0] + 1,
            pairs: vec![bars.contact_dofs()],
            gaps: vec![bars.gap],
            velocity: bars.velocities(),
        }
    }

    /// A block on another of the same material, of plane elements; the gap opens by the slope.
    pub(crate) fn blocks(phase: f64) -> (Self, Solid<2>) {
        let material = Material { young: 100.0, poisson: 0.3, density: 0.01 };
        let cells = [4, 6];
        let lower = Solid::rectangle([2.0, 3.0], cells, material);
        let count = lower.nodes.len();
        let solid = lower.with(Solid::rectangle([2.0, 2.0], cells, material).moved([0.0, 3.0]));
        let width = cells[0] + 1;
        let pairs = (0..width).map(|k| [2 * (count - width + k) + 1, 2 * (count + k) + 1]).collect();
        let gaps = (0..width).map(|k| (8.3 + phase + 1.7 * k as f64) * 0.1 * H).collect();
        let speed =
            |dof: usize| if dof.is_multiple_of(2) { 0.01 } else { [0.05, -0.05][usize::from(dof >= 2 * count)] };
        let (stiffness, lumped) = (solid.stiffness(), solid.lumped_mass::<f64>());
        let velocity = (0..solid.dofs()).map(speed).collect();
        let mass = diagonal(&lumped);
        (Self { stiffness, mass, lumped: Some(lumped), split: 2 * count, pairs, gaps, velocity }, solid)
    }

    pub(crate) fn system(&self) -> LinearSystem<'static, f64> {
        match &self.lumped {
            Some(mass) => LinearSystem::lumped(mass.clone(), self.stiffness.clone()),
            None => LinearSystem::new(self.mass.clone(), self.stiffness.clone()),
        }
        .unwrap()
    }

    pub(crate) fn rows(&self) -> LinearRows<'static, f64> {
        self.pairs.iter().zip(&self.gaps).fold(LinearRows::new(), |rows, (&[first, second], &gap)| {
            rows.unilateral(&[(first, -1.0), (second, 1.0)], gap)
        })
    }

    pub(crate) fn simulation(
        &self,
        scheme: impl TimeIntegrator + 'static,
        corrected: bool,
        solver: impl LinearSolver<f64> + 'static,
    ) -> Simulation<'static, f64> {
        simulation(self.system(), self, scheme, corrected, solver)
    }
}

pub(crate) fn simulation<S: System<f64> + 'static>(
    system: S,
    scene: &Scene,
    scheme: impl TimeIntegrator + 'static,
    corrected: bool,
    solver: impl LinearSolver<f64> + 'static,
) -> Simulation<'static, f64> {
    let corrector: Option<Box<dyn Corrector<f64>>> =
        if corrected { Some(Box::new(PersistencyCorrection::new())) } else { None };
    Simulation::builder(system, scheme, H)
        .velocity(scene.velocity.clone())
        .constraint(scene.rows())
        .correctors(corrector)
        .newton(Newton::full().tolerances(1e-12, 1e-12).unwrap())
        .linear_solver(solver)
        .build()
        .unwrap()
}

/// The largest values seen, and the largest differences: of u, v, a and the forces.
#[derive(Debug, Default)]
pub(crate) struct Comparison {
    largest: [f64; 4],
    difference: [f64; 4],
}

impl Comparison {
    pub(crate) fn add(&mut self, found: [&[f64]; 4], expected: [&[f64]; 4]) {
        for i in 0..4 {
            assert_eq!(found[i].len(), expected[i].len());
            for (x, y) in found[i].iter().zip(expected[i]) {
                self.largest[i] = self.largest[i].max(y.abs());
                self.difference[i] = self.difference[i].max((x - y).abs());
            }
        }
    }

    pub(crate) fn worst(&self) -> f64 {
        (0..4).map(|i| self.difference[i] / self.largest[i]).fold(0.0, f64::max)
    }
}

pub(crate) fn motion<'a>(run: &'a Simulation<'_, f64>) -> [&'a [f64]; 4] {
    let state = run.state();
    [state.displacement(), state.stored_velocity(), state.stored_acceleration(), state.contacts().forces()]
}
