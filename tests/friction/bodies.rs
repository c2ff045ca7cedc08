//! Elastic bodies against closed forms: two slabs that strike each other obliquely, and partial slip under a ball that
//! is moved sideways.

use contact_dynamics::PersistencyCorrection;
use contact_dynamics_scenes::mindlin::Press;
use contact_dynamics_scenes::schemes;
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
