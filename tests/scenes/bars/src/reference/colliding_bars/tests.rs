//! Colliding bars against closed forms, conservation laws and limit cases.

use super::*;

/// Bar of the classical benchmark, c = 100 and Z = 1, as in Runcie et al. 2022 (IJNME).
const BAR: Bar = Bar { young: 100.0, density: 0.01, area: 1.0, length: 10.0, velocity: 0.1 };
const RESTING: Bar = Bar { velocity: 0.0, ..BAR };
/// Half of the symmetric pair with four contact nodes: Z = 1/4.
const QUARTER: Bar = Bar { area: 0.25, velocity: 0.05, ..BAR };
const V0: f64 = 0.05;
/// A short time, for values just before an event.
const LATER: f64 = 1e-6;

fn close(value: f64, expected: f64, tolerance: f64) {
    let error = (value - expected).abs();
    assert!(error <= tolerance, "{value} instead of {expected}");
}

fn pair(left: Bar, right: Bar, gap: f64) -> CollidingBars {
    CollidingBars::new(left, right, gap, 1.0).unwrap()
}

fn symmetric() -> CollidingBars {
    let right = Bar { velocity: -V0, ..QUARTER };
    pair(QUARTER, right, 0.01)
}

fn dissimilar() -> CollidingBars {
    pair(Bar { young: 49.0, ..BAR }, RESTING, 0.01)
}

/// Saint-Venant's bars of one section, in contact at time zero.
fn unequal(left: f64, right: f64) -> CollidingBars {
    let bar = |length, bar| Bar { length, ..bar };
    pair(bar(left, BAR), bar(right, RESTING), 0.0)
}

fn samples(count: u32) -> impl Iterator<Item = f64> {
    (0..=count).map(move |k| f64::from(k) / f64::from(count))
}

fn contacts(solution: &CollidingBars, expected: &[(f64, f64)]) {
    assert_eq!(solution.contact_intervals().len(), expected.len());
    for (interval, expected) in solution.contact_intervals().iter().zip(expected) {
        close(interval.0, expected.0, 1e-14);
        close(interval.1, expected.1, 1e-14);
    }
}

#[test]
fn equal_bars_follow_the_closed_form() {
    let solution = symmetric();
    contacts(&solution, &[(0.1, 0.3)]);
    let (start, transit, speed) = (0.1, 0.1, 100.0);
    for t in samples(997) {
        let q = t - start;
        let touching = (0.0..2.0 * transit).contains(&q);
        close(solution.contact_force(t), if touching { 0.0125 } else { 0.0 }, 1e-16);
        for s in samples(13).map(|fraction| 10.0 * fraction) {
            let reached = speed * q > s;
            let freed = speed * q > 20.0 - s;
            let (u, v, sigma) = match (reached, freed) {
                (false, _) => (V0 * t, V0, 0.0),
                (true, false) => (V0 * (start + s / speed), 0.0, -V0),
                (true, true) => (V0 * (start + 2.0 * transit - q), -V0, 0.0),
            };
            for (side, x, sign) in [(Side::Left, 10.0 - s, 1.0), (Side::Right, s, -1.0)] {
                close(solution.displacement(side, x, t), sign * u, 1e-16);
                close(solution.velocity(side, x, t), sign * v, 1e-16);
                close(solution.stress(side, x, t), sigma, 1e-16);
            }
        }
    }
    close(solution.displacement(Side::Left, 10.0, 0.2), 0.005, 1e-17);
    close(solution.impulse(1.0), 2.5e-3, 1e-17);
    close(solution.impulse(1.0), 2.0 * QUARTER.mass() * V0, 1e-17);
}

#[test]
fn equal_bars_exchange_kinetic_and_strain_energy_linearly() {
    let solution = symmetric();
    let total = 6.25e-5;
    for t in samples(997) {
        let kinetic = total * (1.0 - ((t - 0.1) / 0.1).clamp(0.0, 2.0)).abs();
        close(solution.kinetic_energy(t), kinetic, 1e-14 * total);
        close(solution.strain_energy(t), total - kinetic, 1e-14 * total);
    }
}

#[test]
fn dissimilar_bars_press_on_two_plateaus() {
    let solution = dissimilar();
    contacts(&solution, &[(0.1, 0.1 + 2.0 / 7.0)]);
    for (t, force, common) in [
        (0.1, 0.07 / 1.7, 0.041_176_470_6),
        (0.3 - LATER, 0.041_176_470_6, 0.041_176_470_6),
        (0.3, 0.007_266_436_0, 0.089_619_377_2),
        (0.385_714, 0.007_266_436_0, 0.089_619_377_2),
    ] {
        close(solution.contact_force(t), force, 1e-10);
        close(solution.velocity(Side::Left, 10.0, t), common, 1e-10);
        close(solution.velocity(Side::Right, 0.0, t), common, 1e-10);
    }
    let release = solution.contact_intervals()[0].1;
    close(solution.contact_force(release), 0.0, 0.0);
    let (left, right) = (-0.017_647_058_8, 0.082_352_941_2);
    close(solution.velocity(Side::Left, 10.0, release), left, 1e-10);
    close(solution.velocity(Side::Right, 0.0, release), right, 1e-10);
    for t in [0.4, 0.7, 1.0] {
        let mean = [Side::Left, Side::Right].map(|side| solution.mean_velocity(side, t));
        close(mean[0], 0.011_418_685_121, 1e-12);
        close(mean[1], 0.088_581_314_879, 1e-12);
        close(mean[0] + mean[1], 0.1, 1e-15);
    }
}

#[test]
fn longer_target_is_touched_without_force_before_it_leaves() {
    let solution = unequal(10.0, 20.0);
    contacts(&solution, &[(0.0, 0.4)]);
    for (t, force, left, right) in [
        (0.0, 0.05, 0.05, 0.05),
        (0.2 - LATER, 0.05, 0.05, 0.05),
        (0.2, 0.0, 0.0, 0.0),
        (0.4 - LATER, 0.0, 0.0, 0.0),
        (0.4, 0.0, 0.0, 0.1),
    ] {
        close(solution.contact_force(t), force, 1e-16);
        close(solution.velocity(Side::Left, 10.0, t), left, 1e-16);
        close(solution.velocity(Side::Right, 0.0, t), right, 1e-16);
    }
    close(solution.mean_velocity(Side::Left, 1.0), 0.0, 1e-16);
    close(solution.mean_velocity(Side::Right, 1.0), 0.05, 1e-16);
    close(solution.impulse(1.0), BAR.mass() * 0.1, 1e-16);
}

#[test]
fn longer_striker_follows_without_force_before_it_is_left() {
    let solution = unequal(20.0, 10.0);
    contacts(&solution, &[(0.0, 0.4)]);
    for (t, force, common) in [(0.1, 0.05, 0.05), (0.2, 0.0, 0.1), (0.3, 0.0, 0.1)] {
        close(solution.contact_force(t), force, 1e-16);
        close(solution.velocity(Side::Left, 20.0, t), common, 1e-16);
        close(solution.velocity(Side::Right, 0.0, t), common, 1e-16);
    }
    assert!(solution.gap(0.5) > 0.0);
    close(solution.mean_velocity(Side::Left, 1.0), 0.05, 1e-16);
    close(solution.mean_velocity(Side::Right, 1.0), 0.1, 1e-16);
}

#[test]
fn touching_without_force_survives_rounding() {
    for k in 1..200 {
        let odd = f64::from(k) / 7.0;
        let bar = |length, velocity| Bar { young: 3.0 * odd, length, velocity, ..BAR };
        let short = bar(0.3, 0.1 + odd);
        let long = bar(0.3 * f64::from(2 + k % 4), odd);
        let round_trip = 2.0 * long.length / long.wave_speed();
        let solution = CollidingBars::new(short, long, 0.0, 9.0).unwrap();
        assert_eq!(solution.contact_intervals().len(), 1);
        close(solution.contact_intervals()[0].1, round_trip, 1e-14);
        assert_eq!(solution.force.0.len(), 3);
        close(solution.contact_force(0.8 * round_trip), 0.0, 0.0);
    }
}

#[test]
fn energy_and_momentum_are_conserved() {
    for solution in [symmetric(), dissimilar(), unequal(10.0, 20.0), unequal(20.0, 10.0)] {
        let (energy, momentum) = (solution.energy(0.0), solution.momentum(0.0));
        for t in samples(997) {
            close(solution.energy(t), energy, 1e-14 * energy);
            close(solution.momentum(t), momentum, 1e-15 * BAR.mass());
            let bar = solution.bodies[0].bar.unwrap();
            let left = bar.mass() * (bar.velocity - solution.mean_velocity(Side::Left, t));
            close(solution.impulse(t), left, 1e-15 * bar.mass());
        }
    }
}

#[test]
fn displacement_integrates_velocity_and_its_gradient_gives_stress() {
    let solution = dissimilar();
    let (steps, dx) = (40_000, 1e-4);
    let dt = 1.0 / f64::from(steps);
    for (side, x, young) in [(Side::Left, 7.3, 49.0), (Side::Right, 2.1, 100.0)] {
        let mut sum = 0.0;
        for k in 0..steps {
            let t = dt * (f64::from(k) + 0.5);
            sum += dt * solution.velocity(side, x, t);
            close(solution.displacement(side, x, t + 0.5 * dt), sum, 5e-6);
        }
        for t in samples(23) {
            let [before, after] = [x - dx, x + dx].map(|x| solution.displacement(side, x, t));
            let strain = (after - before) / (2.0 * dx);
            close(solution.stress(side, x, t), young * strain, 1e-9);
        }
    }
}

#[test]
fn contact_ends_close_the_gap_while_they_touch() {
    for (solution, end, gap) in
        [(symmetric(), 10.0, 0.01), (dissimilar(), 10.0, 0.01), (unequal(20.0, 10.0), 20.0, 0.0)]
    {
        let (start, release) = solution.contact_intervals()[0];
        for t in samples(997) {
            let left = solution.displacement(Side::Left, end, t);
            let right = solution.displacement(Side::Right, 0.0, t);
            close(solution.gap(t), gap + right - left, 1e-16);
            assert_eq!((start..=release).contains(&t), solution.gap(t) <= 0.0);
        }
    }
}

#[test]
fn wall_is_half_of_the_symmetric_pair() {
    let whole = symmetric();
    let half = CollidingBars::against_wall(QUARTER, 0.005, 1.0).unwrap();
    contacts(&half, &[(0.1, 0.3)]);
    for t in samples(997) {
        close(half.contact_force(t), whole.contact_force(t), 1e-16);
        close(half.impulse(t), whole.impulse(t), 1e-17);
        close(half.gap(t), 0.5 * whole.gap(t), 1e-16);
        close(half.energy(t), 0.5 * whole.energy(t), 1e-18);
        let momentum = QUARTER.mass() * half.mean_velocity(Side::Left, t);
        close(half.momentum(t), momentum, 1e-17);
        for x in [0.0, 3.0, 10.0] {
            let [a, b] = [&half, &whole].map(|bars| bars.displacement(Side::Left, x, t));
            close(a, b, 1e-16);
        }
        let wall = [
            half.displacement(Side::Right, 0.0, t),
            half.velocity(Side::Right, 0.0, t),
            half.mean_velocity(Side::Right, t),
            half.stress(Side::Right, 0.0, t),
        ];
        assert!(wall.iter().all(|value| value.abs() <= 0.0));
    }
}

#[test]
fn common_velocity_changes_nothing_else() {
    let boost = 7.0;
    let moved = |bar: Bar| Bar { velocity: bar.velocity + boost, ..bar };
    let left = Bar { young: 49.0, ..BAR };
    let (rest, moving) = (dissimilar(), pair(moved(left), moved(RESTING), 0.01));
    for t in samples(499) {
        close(moving.contact_force(t), rest.contact_force(t), 1e-14);
        close(moving.gap(t), rest.gap(t), 1e-14);
        close(moving.strain_energy(t), rest.strain_energy(t), 1e-16);
        for side in [Side::Left, Side::Right] {
            let [u, u0] = [&moving, &rest].map(|bars| bars.displacement(side, 4.0, t));
            close(u, u0 + boost * t, 1e-14);
            let [v, v0] = [&moving, &rest].map(|bars| bars.velocity(side, 4.0, t));
            close(v, v0 + boost, 1e-14);
        }
    }
}

#[test]
fn bars_that_do_not_approach_never_press() {
    let fleeing = Bar { velocity: 0.2, ..BAR };
    for (right, gap) in [(BAR, 0.01), (fleeing, 0.01), (fleeing, 0.0)] {
        let solution = pair(BAR, right, gap);
        assert!(solution.contact_intervals().is_empty());
        close(solution.impulse(1.0), 0.0, 0.0);
        close(solution.gap(1.0), gap + right.velocity - 0.1, 1e-16);
        close(solution.displacement(Side::Left, 3.0, 0.7), 0.07, 1e-16);
    }
    let together = pair(BAR, BAR, 0.0);
    contacts(&together, &[(0.0, 1.0)]);
    close(together.impulse(1.0), 0.0, 0.0);
}

#[test]
fn vibrating_bar_hits_the_wall_twice() {
    // Z = c = l = 1. The incoming invariant is 1, -1, 1, 1 for half a unit of time each, chosen so that the gap opens
    // at 0.5, is 0.5 at 1, closes at 1.5, and opens permanently at 2.
    let bar = Bar { young: 1.0, density: 1.0, area: 1.0, length: 1.0, velocity: 0.0 };
    let mut solution = CollidingBars::against_wall(bar, 0.0, 9.0).unwrap();
    let mut past = Steps(Vec::new());
    past.push(-2.0, 1.0, 0.0);
    past.jump(-1.5, -1.0, 0.0);
    past.jump(-1.0, 1.0, 0.0);
    solution.bodies[0].outgoing = past;
    solution.intervals.clear();
    solution.opening = Steps::new(0.0, 0.0);
    solution.follow_waves(0.0, 1.0).unwrap();
    contacts(&solution, &[(0.0, 0.5), (1.5, 2.0)]);
    close(solution.impulse(9.0), 1.0, 1e-15);
    for t in samples(90).map(|fraction| 9.0 * fraction) {
        close(solution.energy(t), 0.5, 1e-14);
        let change = solution.momentum(t) - solution.momentum(0.0);
        close(change, -solution.impulse(t), 1e-14);
    }
    for (t, gap) in [(1.0, 0.5), (1.25, 0.25), (1.75, 0.0), (3.0, 1.0), (3.5, 0.5)] {
        close(solution.gap(t), gap, 1e-15);
    }
}

#[test]
fn incommensurate_bars_stay_cheap_and_exact() {
    for exponent in -6..=6 {
        let ratio = 10_f64.powi(exponent);
        let right = Bar { area: ratio, length: 2.0_f64.sqrt(), ..RESTING };
        let solution = pair(BAR, right, 0.001);
        assert_eq!(solution.contact_intervals().len(), 1);
        let energy = solution.energy(0.0);
        for t in samples(199) {
            assert!(solution.contact_force(t) >= 0.0 && solution.gap(t) >= 0.0);
            assert!(solution.contact_force(t) * solution.gap(t) <= 0.0);
            close(solution.energy(t), energy, 1e-12 * energy);
        }
    }
}

#[test]
fn queries_out_of_range_are_nan_and_parameters_are_checked() {
    let solution = symmetric();
    for (x, t) in [(-0.1, 0.5), (10.1, 0.5), (f64::NAN, 0.5), (5.0, 1.1), (5.0, f64::NAN)] {
        assert!(solution.velocity(Side::Left, x, t).is_nan());
        assert!(solution.displacement(Side::Right, x, t).is_nan());
        assert!(solution.stress(Side::Right, x, t).is_nan());
    }
    assert!(solution.contact_force(-0.1).is_nan() && solution.gap(1.1).is_nan());
    assert!(solution.energy(1.1).is_nan() && solution.momentum(f64::NAN).is_nan());
    let nan = f64::NAN;
    for (left, gap, until, message) in [
        (Bar { young: 0.0, ..BAR }, 0.0, 1.0, "invalid Young's modulus: 0"),
        (Bar { density: -1.0, ..BAR }, 0.0, 1.0, "invalid density: -1"),
        (Bar { area: nan, ..BAR }, 0.0, 1.0, "invalid area: NaN"),
        (Bar { length: 0.0, ..BAR }, 0.0, 1.0, "invalid length: 0"),
        (Bar { velocity: nan, ..BAR }, 0.0, 1.0, "invalid velocity: NaN"),
        (BAR, -1.0, 1.0, "invalid gap: -1"),
        (BAR, 0.0, 0.0, "invalid until: 0"),
    ] {
        let error = CollidingBars::new(left, BAR, gap, until).unwrap_err();
        assert_eq!(error.to_string(), message);
    }
}
