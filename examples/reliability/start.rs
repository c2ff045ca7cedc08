//! The first step.

use crate::{Anything, Row};
use contact_dynamics::contact::Plane;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{LinearSystem, Newmark, NodesOnObstacle, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};

/// A stretched string of n elements whose free end has no mass, let go: its energy at the start and after a step, over
/// that of the stretch.
fn string(n: usize) -> Result<String, Anything> {
    let entries = (0..n).flat_map(|e| [(e, e, 1.0), (e + 1, e + 1, 1.0), (e, e + 1, -1.0), (e + 1, e, -1.0)]);
    let entries: Vec<_> = entries.map(|(i, j, k)| Triplet::new(i, j, k)).collect();
    let k = SparseColMat::try_new_from_triplets(n + 1, n + 1, &entries)?;
    let mass = (0..=n).map(|i| [0.0, 1.5, 1.0][i.min(2)]).collect();
    let u: Vec<f64> = (0..=n).map(|i| 1e-3 * (n - i) as f64).collect();
    let system = LinearSystem::lumped(mass, k)?.fix(n)?;
    let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.2).displacement(u).build()?;
    let stretch = 0.5e-6 * n as f64;
    let start = run.energy().total() / stretch;
    run.step()?;
    Ok(format!("{start:.4}, {:.4}", run.energy().total() / stretch))
}

/// Energy of a block whose nodes start 5e−13 deep in a floor at height 1, or why there is none.
fn sliver() -> Result<String, Anything> {
    let material = Material { young: 50.0, poisson: 0.25, density: 1.0 };
    let solid = Solid::rectangle([1.0, 0.6], [4, 3], material).lifted(1.0);
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] < 1.0 + 1e-9).collect();
    let floor = Plane::new([0.0, 1.0 + 5e-13], [0.0, 1.0])?;
    let built = Simulation::builder(
        LinearSystem::lumped(solid.lumped_mass(), solid.stiffness())?,
        Newmark::trapezoidal(),
        1e-3,
    )
    .constraint(NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom)?)
    .corrector(PersistencyCorrection::new())
    .build();
    Ok(match built {
        Err(error) => format!("refused: {error}"),
        Ok(_) => "taken for zero".into(),
    })
}

pub(crate) fn cases(_quick: bool) -> Result<Vec<Row>, Anything> {
    Ok(vec![
        Row {
            case: "a stretched string of 50 elements, its massless end let go: energy at the start, after a step"
                .into(),
            before: "1.0000, 0.9799",
            now: string(50)?,
        },
        Row {
            case: "nodes 5e−13 deep in a floor at height 1".into(),
            before: "refused: gap -5.0e-13, tolerance 1.4e-14",
            now: sliver()?,
        },
    ])
}
