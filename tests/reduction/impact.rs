//! The contact force of reduced bars against the exact one.

use contact_dynamics::reduction::Boundary;
use contact_dynamics::{Bathe, Newmark, TimeIntegrator};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::reduced::{Model, Struck, TAPER, bounces, collision, wall_impact};

const TAPERED: Model = Model::Reduced(Boundary::Tapered);
const UNTAPERED: Model = Model::Reduced(Boundary::Untapered);

fn trapezoidal() -> Box<dyn TimeIntegrator> {
    Box::new(Newmark::trapezoidal())
}

fn conservative() -> Box<dyn TimeIntegrator> {
    Box::new(Bathe::with_radius(1.0).unwrap())
}

fn wall(unknowns: usize, model: Model, h: f64) -> Struck {
    wall_impact(unknowns, model, conservative, h, (&[0.15, 0.45, 0.75], TAPER)).unwrap()
}

#[test]
fn tapered_modes_strike_with_a_clean_force() {
    // Twenty modes. With a quarter of the step more of the fronts counts, which take as long as before.
    for (h, bound) in [(1e-3, 1.1 * 0.0135), (2.5e-4, 1.1 * 0.0183)] {
        let (tapered, untapered) = (wall(21, TAPERED, h), wall(21, UNTAPERED, h));
        assert!(tapered.error <= bound && tapered.overshoot <= 0.08, "{h}: {tapered:?}");
        assert!(tapered.energy < 1e-3, "{h}: {tapered:?}");
        assert!(untapered.error > 10.0 * tapered.error, "{h}: {untapered:?}");
    }
}

#[test]
fn more_modes_have_less_error() {
    let errors = [20, 50, 100].map(|modes| wall(modes + 1, TAPERED, 2.5e-4).error);
    assert!(errors.windows(2).all(|pair| pair[1] < 0.6 * pair[0]), "{errors:?}");
}

#[test]
fn two_reduced_bars_collide_as_one_with_a_mesh() {
    let dissimilar = Bars::dissimilar(1);
    let [both, one] = [[TAPERED; 2], [TAPERED, Model::Mesh]]
        .map(|models| collision(&dissimilar, (30, models), trapezoidal, 5e-4, &[0.25, 0.75]).unwrap());
    for struck in [both, one] {
        assert!(struck.error < 0.03 && struck.overshoot < 0.1, "{struck:?}");
    }
}

#[test]
fn bounces_cost_no_energy() {
    let [tapered, untapered] = [TAPERED, UNTAPERED].map(|model| bounces(16, model, conservative, 200.0).unwrap());
    assert!((tapered.energy - 1.0).abs() < 1e-3 && tapered.error < 0.045, "{tapered:?}");
    assert!(untapered.error > 5.0 * tapered.error, "{untapered:?}");
}
