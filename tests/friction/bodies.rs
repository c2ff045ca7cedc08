//! Elastic bodies against closed forms: two slabs that strike each other obliquely, partial slip under a ball that is
//! moved sideways, and two blocks on a slope.

use super::GRAVITY;
use contact_dynamics::contact::{NodeToFacet, NodesOnObstacle, Plane};
use contact_dynamics::{ContactStatus, GeneralizedAlpha, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::mindlin::Press;
use contact_dynamics_scenes::schemes;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::two_slabs::TwoSlabs;

/// The characteristics by hand: a force p sends −p/Z into a slab, and 2 p/Z are missing when it is back.
#[test]
fn waves_between_two_slabs_are_those_of_the_characteristics() {
    let pair = TwoSlabs::new(10);
    let [thin, thick] = pair.slabs.map(|slab| slab.density * slab.speeds[0]);
    let together = 1.0 / thin + 1.0 / thick;
    let mut approach = 0.1;
    let mut pressures = Vec::new();
    for _ in 0..3 {
        pressures.push(approach / together);
        approach -= 2.0 / thin * pressures[pressures.len() - 1];
    }
    for (trip, pressure) in (0..).zip(&pressures) {
        let t = 0.1 * f64::from(trip) + 0.05;
        assert!((pair.pressure(t) / pressure - 1.0).abs() < 1e-12, "{t}");
    }
    // It sticks, slides, sticks when the S wave is back, and slides again.
    let shear = 0.031 / (3.0_f64.sqrt() * together);
    let back = shear - 2.0 / thin * shear / together;
    for (t, friction) in [(0.05, shear), (0.15, 0.3 * pressures[1]), (0.19, back), (0.25, 0.3 * pressures[2])] {
        assert!((pair.friction(t) / friction - 1.0).abs() < 1e-12, "{t}: {} {friction}", pair.friction(t));
    }
    assert!(shear < 0.3 * pressures[0] && shear > 0.3 * pressures[1] && back < 0.3 * pressures[1]);
}

#[test]
fn friction_between_two_slabs_follows_the_waves() {
    let pair = TwoSlabs::new(20);
    for scheme in schemes::correctable() {
        let found = pair.measured(3, 1e-3, |gap| {
            let correction = PersistencyCorrection::with_history_projection();
            pair.run((scheme.make)(), vec![Box::new(correction)], 1e-3, gap)
        });
        let [pressure, friction, largest] = found.unwrap();
        let name = scheme.name();
        // (Backward Euler smears the fronts.)
        let bound = if name == "Newmark(0.5, 1)" { 0.15 } else { 0.07 };
        assert!(pressure < 0.6 * bound && friction < bound && largest < 1.15, "{name} {pressure} {friction} {largest}");
    }
}

/// Cattaneo and Mindlin: force over way, and the circle that sticks over the force; no mass, and so static.
#[test]
fn a_ball_that_is_moved_sideways_slips_from_the_rim() {
    let press = Press::new(5, 0.3);
    let loads = press.moved(5).unwrap();
    for (step, load) in (1..).zip(&loads[..3]) {
        let force = load.tangential / (press.friction * load.normal);
        let exact = 1.0 - (1.0 - 0.2 * f64::from(step)).powf(1.5);
        assert!((force / exact - 1.0).abs() < 0.01, "{force} {exact}");
        // (Areas are counted by nodes.)
        let [stick, exact] = [load.stick / load.radius, (1.0 - force).cbrt()];
        assert!((stick / exact - 1.0).abs() < 0.04, "{stick} {exact}");
    }
    // All of it slides in the end, and does so with μ times the force.
    let last = loads[4];
    assert!(last.stick < 0.3 * last.radius);
    assert!((last.tangential / (press.friction * last.normal) - 1.0).abs() < 0.01, "{last:?}");
}

/// A block on a block on a slope, both elastic: below the friction angle neither moves once they have settled.
#[test]
fn two_blocks_on_a_slope_stay() {
    let material = Material { young: 1e5, poisson: 0.3, density: 1.0 };
    let lower = Solid::rectangle([2.0, 0.5], [6, 2], material);
    let split = lower.nodes.len();
    let solid = lower.with(Solid::rectangle([1.0, 0.5], [5, 2], material).moved([0.45, 0.5]));
    let facets = |inside: &dyn Fn(usize, [f64; 2]) -> bool| -> Vec<[usize; 2]> {
        let all = solid.boundary().into_iter().filter(|side| side.iter().all(|&n| inside(n, solid.nodes[n])));
        all.map(|side| [side[0], side[1]]).collect()
    };
    let below = facets(&|n, [_, y]| n < split && y > 0.499);
    let above = facets(&|n, [_, y]| n >= split && y < 0.501);
    let bottom: Vec<_> = (0..split).filter(|&n| solid.nodes[n][1] == 0.0).collect();
    let floor = Plane::new([0.0; 2], [0.0, 1.0]).unwrap();
    let mass = solid.lumped_mass::<f64>();
    let (sine, cosine) = 0.2_f64.sin_cos();
    let system = solid.system().load(move |_, f| {
        for (dof, (f, m)) in f.iter_mut().zip(&mass).enumerate() {
            *f = m * GRAVITY * if dof % 2 == 0 { sine } else { -cosine };
        }
    });
    let mut run = Simulation::builder(system, GeneralizedAlpha::chung_hulbert(0.5).unwrap(), 1e-2)
        .constraint(NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap().friction(0.5))
        .constraint(NodeToFacet::new(&solid.nodes, &solid.node_dofs(), above, below).unwrap().friction(0.5))
        .build()
        .unwrap();
    run.run_until(30.0, &mut ()).unwrap();
    let before = run.state().displacement().to_vec();
    for _ in 0..10_000 {
        run.step().unwrap();
    }
    let most =
        run.state().displacement().iter().zip(&before).fold(0.0_f64, |most, (now, then)| most.max((now - then).abs()));
    // (Coordinates of size one.)
    assert!(most < 2e-15, "{most:e}");
    let contacts = run.state().contacts();
    assert!((0..contacts.ids().len()).all(|contact| contacts.status(contact) != ContactStatus::Sliding));
}
