//! What taper and softening do to a front at a wall: the closed form against the force of a bar.

use contact_dynamics::reduction::Boundary;
use contact_dynamics::{Bathe, TimeIntegrator};
use contact_dynamics_scenes::front::{Front, Shape, best_softening, ringing};
use contact_dynamics_scenes::reduced::{Model, Struck, TAPER, wall_impact};

fn conservative() -> Box<dyn TimeIntegrator> {
    Box::new(Bathe::with_radius(1.0).unwrap())
}

/// Thirty modes, in impacts at three instants of a short step.
fn wall(boundary: Boundary, taper: [f64; 2]) -> Struck {
    wall_impact(31, Model::Reduced(boundary), conservative, 2.5e-4, (&[0.15, 0.45, 0.75], taper)).unwrap()
}

fn shape([exponent, softening]: [f64; 2]) -> Shape {
    Front::new(exponent, softening).unwrap().shape()
}

/// Sums over thirty modes are integrals up to some tenths of a percent of the force.
#[test]
fn the_force_overshoots_as_the_front_in_closed_form() {
    for taper in [[3.0, 0.5], [3.0, 1.0], TAPER] {
        let (measured, exact) = (wall(Boundary::Tapered, taper).overshoot, shape(taper).overshoot);
        assert!((measured - exact).abs() < 0.01, "{taper:?}: {measured} {exact}");
    }
}

/// A sine that nothing damps for T out of the 1.2 T that the error is a mean over; the transient that comes on top of
/// it is gone after some periods.
#[test]
fn untapered_modes_ring_by_the_residue() {
    let [frequency, amplitude] = ringing();
    // artanh(1/ω) = ω, and what follows from it.
    assert!((frequency.recip().atanh() - frequency).abs() < 1e-12 && (amplitude - 0.799).abs() < 1e-3);
    let measured = wall(Boundary::Untapered, TAPER);
    let mean = amplitude * std::f64::consts::FRAC_2_PI / 1.2;
    assert!((measured.error / mean - 1.0).abs() < 0.05, "{measured:?} {mean}");
    assert!((measured.overshoot - amplitude).abs() < 0.1, "{measured:?} {amplitude}");
}

#[test]
fn the_default_taper_is_that_of_the_least_error_of_a_front() {
    let [exponent, softening] = TAPER;
    let (best, least) = best_softening(exponent).unwrap();
    assert!((best - softening).abs() < 0.05, "{best}");
    assert!(shape(TAPER).error < 1.001 * least.error);
    for other in [2.0, 4.0, 6.0] {
        assert!(best_softening(other).unwrap().1.error > 1.02 * least.error, "{other}");
    }
}

/// Where the bracket is negative above the modes there is a frequency that nothing damps.
#[test]
fn steep_tapers_without_softening_ring() {
    // ∫ (1 − x⁶)/(1 − x²) = 1 + 1/3 + 1/5, and 1 + 1/5 is constant.
    assert!(Front::new(6.0, 0.3).is_none() && Front::new(6.0, 0.4).is_some());
    assert!(Front::new(3.0, 0.0).is_some());
}
