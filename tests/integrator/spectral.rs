//! What `analysis` computes from the rows, against the literature: the list of `scenes::schemes`, and laws of its own.

// Exponents are rounded before they are compared.
#![allow(clippy::float_cmp)]

use contact_dynamics::analysis::{
    ZeroStability, critical_omega, eigenvalues, order, overshoot, overshoot_growth, period_and_damping,
    radius_at_infinity, report, spectral_radius, zero_stability,
};
use contact_dynamics::tableau::{Rows, Stage, StartUp, Tableau, U, V, Z};
use contact_dynamics::{
    Bathe, Bdf2, ChungLee, Composite, GeneralizedAlpha, Gssss, Houbolt, HulbertChung, MoreauJean, Newmark, NohBathe,
    Oalts, Park, TchamwaWielgosz, TimeIntegrator,
};
use contact_dynamics_scenes::schemes::all;

/// Half a unit of the last digit with which a figure was published (at least three of them are).
fn half_digit(published: f64) -> f64 {
    let text = published.to_string();
    let digits = text.split_once('.').map_or(0, |(_, digits)| digits.len());
    0.51 * 0.1_f64.powi(i32::try_from(digits).unwrap())
}

#[test]
fn period_error_and_damping_are_those_of_the_literature() {
    for scheme in all() {
        let Some([period, damping]) = scheme.published else { continue };
        let found = period_and_damping(&(scheme.make)().tableau(), 0.1, 0.0).unwrap();
        assert!((100.0 * found.0 - period).abs() < half_digit(period), "{}: {found:?}", scheme.name());
        // (Damping is published with three decimals where it vanishes.)
        let digits = if damping == 0.0 { 5e-4 } else { half_digit(damping) };
        assert!((100.0 * found.1 - damping).abs() < digits, "{}: {found:?}", scheme.name());
    }
}

/// Two solves a step: at equal cost the step is twice as long.
#[test]
fn bathes_scheme_at_equal_cost_is_more_accurate_than_the_composite_one() {
    let (period, damping) = period_and_damping(&Bathe::default().tableau(), 0.2, 0.0).unwrap();
    assert!((100.0 * period - 6.02).abs() < 0.005 && (100.0 * damping - 0.605).abs() < 5e-4, "{period} {damping}");
    let composite = period_and_damping(&Composite.tableau(), 0.1, 0.0).unwrap();
    assert!(period < composite.0 && damping < composite.1);
}

#[test]
fn orders_are_those_of_the_literature() {
    for scheme in all() {
        let found = order(&(scheme.make)().tableau());
        let orders = [found.displacement, found.velocity, found.acceleration];
        assert_eq!(orders, [scheme.order; 3], "{}", scheme.name());
    }
}

#[test]
fn stability_limits_are_those_of_the_literature() {
    for scheme in all() {
        let (name, tableau) = (scheme.name(), (scheme.make)().tableau());
        let found = critical_omega(&tableau, 0.0);
        match (scheme.critical, found) {
            (None, None) => {}
            (Some(expected), Some(found)) => assert!((found - expected).abs() < 2e-4, "{name}: {found}"),
            _ => panic!("{name}: {found:?} instead of {:?}", scheme.critical),
        }
        match (scheme.radius, radius_at_infinity(&tableau)) {
            (None, None) => {}
            (Some(expected), Some(found)) => assert!((found - expected).abs() < 5e-4, "{name}: {found}"),
            (expected, found) => panic!("{name}: {found:?} instead of {expected:?}"),
        }
        assert_eq!(zero_stability(&tableau), ZeroStability::Strong, "{name}");
    }
}

#[test]
fn implicit_schemes_are_stable_with_every_damping() {
    for scheme in all().into_iter().filter(|scheme| scheme.radius.is_some()) {
        for xi in [0.0, 0.01, 0.3, 1.0, 3.0] {
            let found = critical_omega(&(scheme.make)().tableau(), xi);
            assert_eq!(found, None, "{}, ξ = {xi}", scheme.name());
        }
    }
}

/// Where the stored acceleration lives, from the balance of each family.
#[test]
fn stored_accelerations_live_where_the_balance_says() {
    let shift = |scheme: &dyn TimeIntegrator| order(&scheme.tableau()).acceleration_shift;
    for rho in [0.5, 0.7, 0.9, 1.0] {
        for scheme in [GeneralizedAlpha::chung_hulbert(rho), GeneralizedAlpha::hht(rho), GeneralizedAlpha::wbz(rho)] {
            let scheme = scheme.unwrap();
            let expected = scheme.alpha_m() - scheme.alpha_f();
            assert!((shift(&scheme) - expected).abs() < 1e-10, "{}: {}", scheme.name(), shift(&scheme));
        }
        let scheme = HulbertChung::new(rho).unwrap();
        let am = (2.0 * rho - 1.0) / (1.0 + rho);
        assert!((shift(&scheme) - (am - 1.0)).abs() < 1e-10);
    }
    assert!((shift(&ChungLee::new(1.0).unwrap()) + 1.0).abs() < 1e-10);
    assert!((shift(&MoreauJean::new(0.5).unwrap()) + 0.5).abs() < 1e-10);
    for collocated in [&Composite as &dyn TimeIntegrator, &Park, &Bathe::default(), &Newmark::new(0.3025, 0.6).unwrap()]
    {
        assert_eq!(shift(collocated), 0.0, "{}", collocated.name());
    }
}

/// The leapfrog form of central differences: the velocity is that of the half step, the acceleration that of its start.
#[test]
fn half_step_velocities_are_recognized() {
    let v = Z - U[0];
    let rows = Rows { u: Z, v, a: v - V[0] };
    let balance = Rows { u: U[0], v: 0.5 * (v + V[0]), a: v - V[0] };
    let leapfrog = Tableau::single(Stage::new(rows).balanced(balance, 0.0));
    let found = order(&leapfrog);
    assert_eq!([found.displacement, found.velocity, found.acceleration], [2, 2, 2]);
    assert!((found.velocity_shift + 0.5).abs() < 1e-12 && (found.acceleration_shift + 1.0).abs() < 1e-12);
    assert!((critical_omega(&leapfrog, 0.0).unwrap() - 2.0).abs() < 1e-9);
}

#[test]
fn families_contain_the_schemes_they_are_said_to_contain() {
    let same_with = |xi: f64, x: &dyn TimeIntegrator, y: &dyn TimeIntegrator| {
        for omega in [0.1, 1.0, 10.0, 300.0] {
            let difference = spectral_radius(&x.tableau(), omega, xi) - spectral_radius(&y.tableau(), omega, xi);
            assert!(difference.abs() < 1e-7, "{} and {}, Ω = {omega}: {difference:e}", x.name(), y.name());
        }
    };
    let same = |x: &dyn TimeIntegrator, y: &dyn TimeIntegrator| same_with(0.02, x, y);
    same(&GeneralizedAlpha::new(0.0, 0.0, 0.3025, 0.6).unwrap(), &Newmark::new(0.3025, 0.6).unwrap());
    same(&GeneralizedAlpha::hht(1.0).unwrap(), &Newmark::trapezoidal());
    same(&GeneralizedAlpha::wbz(1.0).unwrap(), &Newmark::trapezoidal());
    same(&Gssss::new(0.6, 0.6, 0.6).unwrap(), &GeneralizedAlpha::chung_hulbert(0.6).unwrap());
    same(&Gssss::new(1.0, 1.0, 0.0).unwrap(), &Newmark::trapezoidal());
    same(&Oalts::new(0.0).unwrap(), &Bdf2);
    same_with(0.0, &GeneralizedAlpha::chung_hulbert(0.0).unwrap(), &Houbolt);
    same(&MoreauJean::new(0.5).unwrap(), &Newmark::trapezoidal());
    same(&Bathe::with_radius(0.0).unwrap(), &Bathe::default());
}

#[test]
fn radii_at_infinity_are_those_asked_for() {
    for i in 0..=10 {
        let rho = 0.1 * f64::from(i);
        let schemes: Vec<Box<dyn TimeIntegrator>> = vec![
            Box::new(GeneralizedAlpha::chung_hulbert(rho).unwrap()),
            Box::new(GeneralizedAlpha::wbz(rho).unwrap()),
            Box::new(Gssss::new(0.5 * rho, rho, 0.2 * rho).unwrap()),
            Box::new(Oalts::new(rho).unwrap()),
            Box::new(Bathe::with_radius(rho).unwrap()),
            Box::new(GeneralizedAlpha::hht(0.5 + 0.5 * rho).unwrap()),
        ];
        for scheme in &schemes {
            let found = radius_at_infinity(&scheme.tableau()).unwrap();
            let expected = if scheme.name().starts_with("HHT") { 0.5 + 0.5 * rho } else { rho };
            assert!((found - expected).abs() < 1e-7, "{}: {found}", scheme.name());
            // Nothing grows on the way.
            assert_eq!(critical_omega(&scheme.tableau(), 0.0), None, "{}", scheme.name());
        }
    }
}

#[test]
fn explicit_families_have_the_published_limits() {
    // A root −1: Ω² = 2 (1 − 2α_m)/(2β − γ), and 4/(4β − 3) for Chung and Lee.
    for rho in [0.0_f64, 0.5, 0.8, 0.95] {
        let (am, beta) =
            ((2.0 * rho - 1.0) / (1.0 + rho), (5.0 - 3.0 * rho) / ((1.0 + rho) * (1.0 + rho) * (2.0 - rho)));
        let critical = (2.0 * (1.0 - 2.0 * am) / (2.0 * beta - 1.5 + am)).sqrt();
        let found = critical_omega(&HulbertChung::new(rho).unwrap().tableau(), 0.0).unwrap();
        assert!((found - critical).abs() < 1e-8, "ρ_b = {rho}: {found} instead of {critical}");
    }
    for beta in [1.01, 28.0 / 27.0] {
        let critical = f64::sqrt(4.0 / (4.0 * beta - 3.0));
        let found = critical_omega(&ChungLee::new(beta).unwrap().tableau(), 0.0).unwrap();
        assert!((found - critical).abs() < 1e-8, "β = {beta}: {found} instead of {critical}");
    }
    for phi in [1.0, 1.033, 1.2, 1.7] {
        let tableau = TchamwaWielgosz::new(phi).unwrap().tableau();
        let found = critical_omega(&tableau, 0.0).unwrap();
        assert!((found - 2.0 / f64::sqrt(2.0 * phi - 1.0)).abs() < 1e-6, "φ = {phi}: {found}");
        // The roots meet at 2/φ with the modulus that the scheme is named by.
        if phi > 1.0 {
            let meeting = spectral_radius(&tableau, 2.0 / phi, 0.0);
            let radius = (2.0 - phi) / phi;
            assert!((meeting - radius).abs() < 1e-6, "φ = {phi}: {meeting}");
        }
    }
    // All roots of Hulbert and Chung's scheme meet at −ρ_b; Chung and Lee's 28/27 has the same roots as ρ_b = ½.
    for rho in [0.3_f64, 0.5, 0.8] {
        let meeting = (1.0 + rho) * (2.0 - rho).sqrt();
        let roots = |scheme: &dyn TimeIntegrator| eigenvalues(&scheme.tableau(), meeting, 0.0);
        let mut found = roots(&HulbertChung::new(rho).unwrap());
        if (rho - 0.5).abs() < 1e-12 {
            found.extend(roots(&ChungLee::new(28.0 / 27.0).unwrap()));
        }
        // (A triple root is known to the cube root of the rounding.)
        assert!(found.iter().all(|root| (root.re + rho).hypot(root.im) < 1e-4), "ρ_b = {rho}: {found:?}");
    }
    // Noh and Bathe's lowest radius: 0.45 at p = 0.54, ρ_b where it is asked for.
    let lowest = |scheme: NohBathe| {
        let radius = |i: u32| spectral_radius(&scheme.tableau(), 3.0 + f64::from(i) / 20_000.0, 0.0);
        (0..20_000).map(radius).fold(f64::INFINITY, f64::min)
    };
    assert!((lowest(NohBathe::new(0.54).unwrap()) - 0.451).abs() < 1e-3);
    assert!((lowest(NohBathe::with_radius(0.6).unwrap()) - 0.6).abs() < 1e-3);
    assert!(lowest(NohBathe::with_radius(0.0).unwrap()) < 0.02);
    // Dampers that lag leave nothing to the member without numerical damping.
    let undamped = HulbertChung::new(1.0).unwrap().tableau();
    assert!(critical_omega(&undamped, 0.01).unwrap() < 0.02);
    assert!(critical_omega(&HulbertChung::new(0.8).unwrap().tableau(), 0.01).unwrap() > 1.5);
}

/// Growth of the first steps with Ω (Hilber, Hughes 1978): the trapezoidal rule overshoots in neither, Newmark's
/// damped members and generalized-α in the velocity, a Taylor past in the velocity.
#[test]
fn overshoot_grows_as_published() {
    let growth = |scheme: &dyn TimeIntegrator, start| overshoot_growth(&scheme.tableau(), start).map(f64::round);
    let newmark = Newmark::new(0.3025, 0.6).unwrap();
    assert_eq!(growth(&Newmark::trapezoidal(), StartUp::Trapezoidal), [0.0, 0.0]);
    assert_eq!(growth(&newmark, StartUp::Trapezoidal), [0.0, 1.0]);
    assert_eq!(growth(&GeneralizedAlpha::chung_hulbert(0.8).unwrap(), StartUp::Trapezoidal), [0.0, 1.0]);
    // WBZ and Chung–Hulbert meet the displacement without overshoot.
    let stiff = overshoot(&GeneralizedAlpha::chung_hulbert(0.5).unwrap().tableau(), 1e4, StartUp::Trapezoidal);
    assert!(stiff.displacement <= 1.0 + 1e-6, "{stiff:?}");
    for multistep in [&Composite as &dyn TimeIntegrator, &Houbolt, &Park, &Bdf2] {
        assert_eq!(growth(multistep, StartUp::Trapezoidal), [0.0, 0.0], "{}", multistep.name());
    }
    // −Ω/4 ω u₀ at h/T = 10: −15.7 ω u₀.
    let ghost = overshoot(&Composite.tableau(), 20.0 * std::f64::consts::PI, StartUp::Taylor);
    assert!((ghost.velocity - 15.7).abs() < 0.1, "{ghost:?}");
    assert_eq!(growth(&Composite, StartUp::Taylor)[1], 1.0);
}

#[test]
fn zero_stability_tells_weak_and_unstable_schemes() {
    // α_m = ½: the acceleration of a rigid body alternates for ever.
    let weak = GeneralizedAlpha::new(0.5, 0.5, 0.25, 0.5).unwrap().tableau();
    assert_eq!(zero_stability(&weak), ZeroStability::Weak);
    // The most accurate two-step difference is not stable.
    let v = (Z + 4.0 * U[0] - 5.0 * U[1] - 2.0 * V[1] - 4.0 * V[0] + 2.0 * V[1]) / 2.0;
    let unstable = Tableau::single(Stage::new(Rows { u: Z, v, a: v - V[0] }));
    assert_eq!(zero_stability(&unstable), ZeroStability::Unstable);
    // Two-step differences whose second root is r: bodies without forces go on as r^n beside their motion.
    for (r, expected) in [
        (0.5, ZeroStability::Strong),
        (-0.99, ZeroStability::Strong),
        (-1.0, ZeroStability::Weak),
        (-1.01, ZeroStability::Unstable),
        (-1.8, ZeroStability::Unstable),
        (1.5, ZeroStability::Unstable),
    ] {
        let v = (Z - (1.0 + r) * U[0] + r * U[1]) / (1.0 - r);
        let scheme = Tableau::single(Stage::new(Rows { u: Z, v, a: v - V[0] }));
        assert_eq!(zero_stability(&scheme), expected, "{r}");
    }
    assert!(eigenvalues(&unstable, 1e-3, 0.0).iter().any(|root| root.re.hypot(root.im) > 1.5));
}

#[test]
fn reports_of_malformed_tableaux_are_not_panics() {
    let mut stage = Composite.tableau().stages[0];
    stage.recovery.v.z = f64::NAN;
    let malformed = Tableau::single(stage);
    assert!(report(&malformed).is_err() && report(&Tableau::staged(vec![])).is_err());
    assert!(spectral_radius(&malformed, 1.0, 0.0).is_nan());
    assert_eq!(critical_omega(&malformed, 0.0), Some(0.0));
    let found = order(&malformed);
    assert_eq!([found.displacement, found.velocity, found.acceleration], [0; 3]);
    let text = report(&Bathe::default().tableau()).unwrap().to_string();
    assert!(text.contains("1.571 %") && text.contains("unconditional") && text.contains("v + 0.3536 h a"), "{text}");
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
    // (scheme, period error over Ω², damping: coefficient (where known) and power of Ω)
    let laws: [(&dyn TimeIntegrator, f64, Option<f64>, f64); 5] = [
        (&Houbolt, 11.0 / 24.0, None, 3.0),
        (&Bdf2, 1.0 / 3.0, Some(0.25), 3.0),
        (&Park, 1.0 / 6.0, None, 5.0),
        (&Bathe::default(), 1.0 / 24.7, None, 3.0),
        (&GeneralizedAlpha::chung_hulbert(0.5).unwrap(), f64::NAN, Some(0.018), 3.0),
    ];
    for (scheme, law, coefficient, power) in laws {
        let ((period, damping), (_, twice)) = (at(scheme, omega), at(scheme, 2.0 * omega));
        assert!(law.is_nan() || (period / (law * omega * omega) - 1.0).abs() < 0.02, "{}: {period}", scheme.name());
        assert!(((twice / damping).log2() - power).abs() < 0.1, "{}", scheme.name());
        let size = damping / omega.powf(power);
        assert!(coefficient.is_none_or(|c| (size / c - 1.0).abs() < 0.05), "{}: {size}", scheme.name());
    }
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
