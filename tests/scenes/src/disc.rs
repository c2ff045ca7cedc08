//! A soft elastic disc that falls on a floor: the dynamic contact example of GetFEM, on linear quadrilaterals.

use crate::masses::{Body, MassMatrix};
use crate::solids::{Material, Solid};
use contact_dynamics::contact::Plane;
use contact_dynamics::mass::affine_motions;
use contact_dynamics::{ContactLaw, Corrector, NodesOnObstacle, Result, Simulation, TimeIntegrator};

/// λ = μ = 20, ρ = 1.
const SOFT: Material = Material { young: 50.0, poisson: 0.25, density: 1.0 };
const RADIUS: f64 = 20.0;
const HEIGHT: f64 = 5.0;
const GRAVITY: f64 = 0.1;
/// Nodes up to this height above the lowest one may touch the floor.
const REACH: f64 = 10.0;

/// The disc of `cells` × `cells` elements, 5 above the floor.
#[derive(Clone, Debug)]
pub struct SoftDisc {
    solid: Solid<2>,
    candidates: Vec<usize>,
    /// Length of the surface that belongs to each node.
    shares: Vec<f64>,
}

/// What is measured of a fall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DiscFigures {
    /// Energy at the end, and the highest one, less that at the start, over the energy of the fall.
    pub energy: f64,
    pub energy_max: f64,
    /// Deepest penetration over the way the disc falls in a step.
    pub penetration: f64,
    /// Largest pressure over the median one when the total force is largest.
    pub pressure_ratio: f64,
    /// Largest total force over the weight.
    pub force_max: f64,
    /// Total variation of the total force over its largest value (2 if it rises and falls once).
    pub variation: f64,
    /// Contacts that closed or opened, over the largest number closed at once (2 if each closes and opens once).
    pub changes: f64,
}

impl SoftDisc {
    pub fn new(cells: usize) -> Self {
        let solid = Solid::disc(RADIUS, cells, SOFT).lifted(HEIGHT);
        let low = |n: &usize| solid.nodes[*n][1] < HEIGHT + REACH;
        let candidates: Vec<usize> = solid.surface_nodes().into_iter().filter(low).collect();
        let mut shares = vec![0.0; solid.nodes.len()];
        for side in solid.boundary() {
            let [a, b] = [solid.nodes[side[0]], solid.nodes[side[1]]];
            side.iter().for_each(|&n| shares[n] += 0.5 * (a[0] - b[0]).hypot(a[1] - b[1]));
        }
        Self { solid, candidates, shares }
    }

    /// What treatments of the mass need: vertical dofs of the candidates may be massless.
    pub fn body(&self) -> Body {
        let solid = &self.solid;
        Body {
            consistent: solid.consistent_mass(),
            stiffness: solid.stiffness(),
            contact: self.candidates.iter().map(|&n| Solid::<2>::dof(n, 1)).collect(),
            groups: (0..solid.dofs()).map(|dof| dof % 2).collect(),
            motions: affine_motions(solid.dofs(), &solid.nodes, &solid.node_dofs()).unwrap(),
        }
    }

    /// The disc above the floor; every dof weighs what its row of M sums up to.
    pub fn simulation(
        &self,
        mass: MassMatrix,
        integrator: impl TimeIntegrator + 'static,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        law: ContactLaw,
        h: f64,
    ) -> Result<Simulation<'static, f64>> {
        let weights = Self::weights(&mass);
        let system = mass.system(self.solid.stiffness())?;
        let system = system.load(move |_, f| f.iter_mut().zip(&weights).for_each(|(f, w)| *f = -w));
        let floor = Plane::new([0.0, 0.0], [0.0, 1.0])?;
        let contact = NodesOnObstacle::new(floor, &self.solid.nodes, &self.solid.node_dofs(), &self.candidates)?;
        Simulation::builder(system, integrator, h).constraint(contact.with_law(law)).correctors(correctors).build()
    }

    /// Weights of the vertical dofs, zeros for the others.
    fn weights(mass: &MassMatrix) -> Vec<f64> {
        mass.row_sums().iter().enumerate().map(|(dof, m)| if dof % 2 == 1 { GRAVITY * m } else { 0.0 }).collect()
    }

    /// Runs such a simulation up to a time.
    pub fn run(&self, mass: &MassMatrix, run: &mut Simulation<'_, f64>, h: f64, until: f64) -> Result<DiscFigures> {
        let weights = Self::weights(mass);
        let weight: f64 = weights.iter().sum();
        let total = |run: &mut Simulation<'_, f64>| {
            let height: f64 = weights.iter().zip(run.state().displacement()).map(|(w, u)| w * u).sum();
            run.energy().total() + height
        };
        let start = total(run);
        let scale = weight * HEIGHT;
        let mut figures = DiscFigures::default();
        let (mut largest, mut before, mut most) = (0.0, 0.0, 1);
        let mut pressures: Vec<f64> = Vec::new();
        while run.time() < until {
            run.step()?;
            figures.energy = (total(run) - start) / scale;
            figures.energy_max = figures.energy_max.max(figures.energy);
            let contacts = run.state().contacts();
            let deepest = contacts.gaps().iter().fold(0.0_f64, |deepest, gap| deepest.max(-gap));
            figures.penetration = figures.penetration.max(deepest / (h * (2.0 * GRAVITY * HEIGHT).sqrt()));
            most = contacts.closed().iter().filter(|closed| **closed).count().max(most);
            let force: f64 = contacts.forces().iter().sum();
            figures.variation += (force - before).abs();
            before = force;
            if force > largest {
                largest = force;
                let pressed = contacts.ids().iter().zip(contacts.forces()).filter(|(_, f)| **f > 0.0);
                pressures = pressed.map(|(id, f)| f / self.shares[id.feature]).collect();
            }
        }
        pressures.sort_by(f64::total_cmp);
        if let Some(last) = pressures.last() {
            figures.pressure_ratio = last / pressures[pressures.len() / 2];
        }
        figures.force_max = largest / weight;
        figures.variation /= largest;
        figures.changes = run.statistics().contact_changes as f64 / most as f64;
        Ok(figures)
    }
}
