//! Hundreds of contacts, which steps solve without W.

use contact_dynamics::contact::Plane;
use contact_dynamics::{GeneralizedAlpha, NodesOnObstacle, Simulation};
use contact_dynamics_scenes::gradients::{assert_equal, compare};
use contact_dynamics_scenes::solids::{Material, Solid};

/// A plate lands on a floor with 289 nodes at once.
#[test]
fn hundreds_of_contacts() {
    let build = |at: &[f64]| {
        let material = Material { young: 100.0 * at[2], poisson: 0.3, density: at[0] };
        let solid = Solid::<3>::block([4.0, 4.0, 0.3], [16, 16, 1], material);
        let plane = Plane::new([0.0, 0.0, -0.0103 - at[7]], [0.0, 0.0, 1.0])?;
        let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] < 1e-9).collect();
        Simulation::builder(solid.system(), GeneralizedAlpha::default(), 0.004)
            .velocity(solid.uniform([0.2 * at[4], 0.05 * at[4], -at[4]]))
            .constraint(NodesOnObstacle::new(plane, &solid.nodes, &solid.node_dofs(), &bottom)?)
            .build()
    };
    let error = compare(&build, &|run| run.run_until(0.04, &mut ()).map(drop), (8, 0.1)).unwrap();
    assert_equal(&error, "a plate");
}
