//! The amplification matrix that follows from the rows, against the literature.

use contact_dynamics::analysis::{period_and_damping, spectral_radius};
use contact_dynamics::{Bathe, Bdf2, Composite, GeneralizedAlpha, Houbolt, Newmark, Park, TimeIntegrator};

/// (scheme, period error in %, damping in %, at h/T = 0.1).
#[test]
fn period_error_and_damping_are_those_of_the_literature() {
    let newmark = |beta, gamma| Newmark::new(beta, gamma).unwrap();
    let cases: [(Box<dyn TimeIntegrator>, f64, f64); 10] = [
        (Box::new(Composite), 8.448, 1.032),
        (Box::new(Newmark::trapezoidal()), 3.207, 0.0),
        (Box::new(newmark(0.3025, 0.6)), 3.295, 2.951),
        (Box::new(newmark(0.5, 1.0)), 4.21, 14.9),
        (Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()), 3.383, 0.016),
        (Box::new(GeneralizedAlpha::chung_hulbert(0.0).unwrap()), 12.321, 5.499),
        (Box::new(Houbolt), 12.321, 5.499),
        (Box::new(Park), 6.707, 0.445),
        (Box::new(Bdf2), 10.206, 3.443),
        (Box::new(Bathe::default()), 1.571, 0.087),
    ];
    for (scheme, period, damping) in cases {
        let found = period_and_damping(&scheme.tableau(), 0.1, 0.0).unwrap();
        // Three digits, but for the one that the literature gives with fewer.
        let digits = if scheme.name() == "Newmark(0.5, 1)" { (5e-3, 5e-2) } else { (5.01e-4, 5.01e-4) };
        assert!((100.0 * found.0 - period).abs() < digits.0, "{}: {found:?}", scheme.name());
        assert!((100.0 * found.1 - damping).abs() < digits.1, "{}: {found:?}", scheme.name());
    }
}

#[test]
fn composite_is_unconditionally_stable() {
    let tableau = Composite.tableau();
    for i in 0..=180 {
        let omega = 10_f64.powf(-3.0 + 9.0 * f64::from(i) / 180.0);
        for k in 0..=20 {
            let radius = spectral_radius(&tableau, omega, 0.1 * f64::from(k));
            // A nearly double root at 1 is known to eps/Ω only.
            assert!(radius <= 1.0 + 1e-13 / omega.min(1.0), "Ω = {omega}, ξ = {}: {radius}", 0.1 * f64::from(k));
        }
    }
}

#[test]
fn composite_annihilates_the_stiff_part_over_four_steps() {
    // ρ → (1/2)^(1/4) Ω^(−1/2): 0.345 at 10, 0.092 at 100.
    let radius = |omega| spectral_radius(&Composite.tableau(), omega, 0.0);
    assert!((radius(10.0) - 0.345).abs() < 1e-3 && (radius(100.0) - 0.092).abs() < 2e-3);
    assert!((radius(1e6) * 1e3 - 0.5_f64.powf(0.25)).abs() < 1e-3);
}

#[test]
fn low_frequency_laws_hold() {
    // Composite: period error 5/24 Ω², damping ¼ Ω⁵. Trapezoidal rule: Ω²/12, none.
    let at = |scheme: &dyn TimeIntegrator, omega: f64| {
        period_and_damping(&scheme.tableau(), omega / (2.0 * std::f64::consts::PI), 0.0).unwrap()
    };
    let omega: f64 = 0.05;
    let (period, _) = at(&Composite, omega);
    assert!((period / (5.0 / 24.0 * omega * omega) - 1.0).abs() < 0.02, "{period}");
    let ratio = at(&Composite, 0.1).1 / at(&Composite, 0.05).1;
    assert!((ratio.log2() - 5.0).abs() < 0.1, "{ratio}");
    let (period, damping) = at(&Newmark::trapezoidal(), omega);
    assert!((period / (omega * omega / 12.0) - 1.0).abs() < 0.02 && damping.abs() < 1e-12);
}

#[test]
fn newmark_is_stable_exactly_where_the_literature_says() {
    for gamma in [0.5, 0.6, 0.9] {
        for beta in [0.1, 0.2, 0.25, 0.3, 0.45, 0.6] {
            let tableau = Newmark::new(beta, gamma).unwrap().tableau();
            let largest = (0..200)
                .map(|i| spectral_radius(&tableau, 10_f64.powf(-1.0 + 4.0 * f64::from(i) / 200.0), 0.0))
                .fold(0.0, f64::max);
            let stable = 2.0 * beta >= gamma;
            assert_eq!(largest <= 1.0 + 1e-8, stable, "β = {beta}, γ = {gamma}: {largest}");
        }
    }
}
