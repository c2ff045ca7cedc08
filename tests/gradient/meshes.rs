//! Two bodies given by their surfaces: rows that turn with both.

use contact_dynamics::contact::{Mortar, NodeToFacet, SurfaceSettings};
use contact_dynamics::verify::GradientError;
use contact_dynamics::{ContactConstraint, Error, Newmark, PersistencyCorrection, Result, Simulation};
use contact_dynamics_scenes::gradients::{assert_equal, assert_near, compare};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

/// A block falls obliquely on a wider one, from this height, and slides on it. Their meshes do not match.
fn fall<const D: usize, C: ContactConstraint<f64> + 'static>(
    bodies: fn(Material) -> [Solid<D>; 2],
    contact: fn(&Stack<D>) -> Result<C>,
    height: f64,
) -> Result<GradientError> {
    let build = |at: &[f64]| {
        let [below, above] = bodies(Material { young: 100.0 * at[2], poisson: 0.3, density: at[0] });
        let narrow = |x: [f64; D]| std::array::from_fn(|k| 0.7 * x[k] + if k + 1 < D { 0.15 } else { 0.0 });
        let stack = Stack::new([below, above.mapped(narrow)], height, |mut x| {
            x[D - 1] += 0.05 * x[0];
            x
        });
        let mut velocity = stack.solid.uniform([0.2 * at[4]; D]);
        for node in velocity[stack.split * D..].chunks_exact_mut(D) {
            node.fill(-0.3 * at[4]);
            node[D - 1] = -at[4];
        }
        Simulation::builder(stack.solid.system(), Newmark::trapezoidal(), 0.003)
            .velocity(velocity)
            .constraint(contact(&stack)?)
            .corrector(PersistencyCorrection::new())
            .build()
    };
    compare(&build, &|run| run.run_until(0.12, &mut ()).map(drop), (7, 0.1))
}

fn plates(material: Material) -> [Solid<2>; 2] {
    [5, 3].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], material))
}

fn blocks(material: Material) -> [Solid<3>; 2] {
    [[4, 3, 1], [2, 2, 1]].map(|cells| Solid::block([1.0; 3], cells, material))
}

fn nodes_on_facets<const D: usize>(stack: &Stack<D>) -> Result<NodeToFacet<f64>> {
    stack.nodes_on_facets(1)?.with(SurfaceSettings::new().reach(0.3))
}

fn mortar<const D: usize>(stack: &Stack<D>) -> Result<Mortar<f64>> {
    stack.mortar(true)?.with(SurfaceSettings::new().reach(0.3))
}

/// From a height of 0.0113 a step ends with a node 2e-5 beside a vertex, at which rows jump.
#[test]
fn nodes_slide_on_facets() {
    for height in [0.0107, 0.0113, 0.0212] {
        assert_equal(&fall(plates, nodes_on_facets, height).unwrap(), &format!("plates, {height}"));
    }
    assert_equal(&fall(blocks, nodes_on_facets, 0.0212).unwrap(), "blocks");
}

/// Rates of mortar rows are differences, so that results of whole runs are smooth to 1e-6 only. In space rows jump with
/// their quadrature points.
#[test]
fn weighted_gaps() {
    assert_near(&fall(plates, mortar, 0.0107).unwrap(), 2e-5, "plates");
    assert_near(&fall(plates, |stack| mortar(stack)?.dual(), 0.0107).unwrap(), 2e-5, "dual");
    let refused = fall(blocks, mortar, 0.0212);
    assert!(matches!(refused, Err(Error::Incompatible { reason, .. }) if reason.contains("jump")), "{refused:?}");
}
