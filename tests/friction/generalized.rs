//! Rigid bodies by generalized coordinates: rolling, spinning, and the rod of Painlevé.

use super::{GRAVITY, masses, run, schemes};
use contact_dynamics::{ContactStatus, Error, LinearRows, Newmark, SimulationBuilder, TimeIntegrator};
use std::f64::consts::TAU;

/// x, y and the angle (counterclockwise) of a round body on a floor.
#[test]
fn spheres_and_discs_roll_after_sliding() {
    let (mass, radius, friction, speed) = (3.0, 0.5, 0.2, 2.0);
    for scheme in schemes().filter(|scheme| scheme.name() != "Moreau–Jean(1)") {
        for (inertia, share) in [(0.4, 2.0 / 7.0), (0.5, 1.0 / 3.0)] {
            let body =
                masses(vec![mass, mass, inertia * mass * radius * radius], vec![0.0, -mass * GRAVITY, 0.0]).unwrap();
            let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0), (2, radius)]]);
            let h = 0.0037;
            let mut run = run(body, (scheme.make)(), h, vec![speed, 0.0, 0.0]).constraint(floor).build().unwrap();
            let rolls = share * speed / (friction * GRAVITY);
            while run.state().time() < rolls - 2.0 * h {
                run.step().unwrap();
                let expected = speed - friction * GRAVITY * run.state().time();
                assert!((run.state().velocity()[0] - expected).abs() < 1e-11, "{}", scheme.name());
            }
            run.run_until(2.0 * rolls, &mut ()).unwrap();
            let (v, contacts) = (run.state().velocity(), run.state().contacts());
            assert!((v[0] / (speed * (1.0 - share)) - 1.0).abs() < 1e-12, "{} {}", scheme.name(), v[0]);
            assert!((v[0] + radius * v[2]).abs() < 1e-12 && contacts.slip(0)[0].abs() < 1e-12, "{}", scheme.name());
            assert!(contacts.friction_forces(0)[0].abs() < 1e-9, "{}", scheme.name());
        }
    }
}

/// A disc that spins flat on a floor under its own weight stops after 3 R ω/(4 μ g): all directions of slip at once.
#[test]
fn a_spinning_disc_stops() {
    let (rings, rays, radius, friction, spin) = (5, 12, 1.0, 0.3, 2.0);
    let points = rings * rays;
    // The disc by its angle, its points by their heights, each with its share of the weight (density 1).
    let area = std::f64::consts::PI * radius * radius;
    let share = |ring: usize| area * (2 * ring + 1) as f64 / (rings * rings * rays) as f64;
    let mass = (0..points).map(|k| share(k / rays)).chain([0.5 * area * radius * radius]).collect();
    let force = (0..points).map(|k| -GRAVITY * share(k / rays)).chain([0.0]).collect();
    let floor = (0..points).fold(LinearRows::new(), |rows, k| {
        // The radius at which the ring has its moment.
        let ring = (k / rays) as f64;
        let r = radius / rings as f64 * (2.0 / 3.0) * ((ring + 1.0).powi(3) - ring.powi(3)) / (2.0 * ring + 1.0);
        let (sine, cosine) = (TAU * (k % rays) as f64 / rays as f64 + 0.1).sin_cos();
        let tangents: [&[_]; 2] = [&[(points, -r * sine)], &[(points, r * cosine)]];
        rows.unilateral(&[(k, 1.0)], 0.0).friction(friction, &tangents)
    });
    let velocity = (0..points).map(|_| 0.0).chain([spin]).collect();
    let h = 1e-3;
    let disc = masses(mass, force).unwrap();
    let mut run = run(disc, Box::new(Newmark::trapezoidal()), h, velocity).constraint(floor).build().unwrap();
    let end = 3.0 * radius * spin / (4.0 * friction * GRAVITY);
    while run.state().time() < end - 2.0 * h {
        run.step().unwrap();
        let expected = spin * (1.0 - run.state().time() / end);
        assert!((run.state().velocity()[points] - expected).abs() < 1e-9 * spin, "{}", run.state().time());
    }
    run.run_until(2.0 * end, &mut ()).unwrap();
    assert!(run.state().velocity()[points].abs() < 1e-12);
}

/// Along any direction in space friction is the same, and against the slip.
#[test]
fn the_cone_is_round() {
    let (friction, speed) = (0.4, 1.5);
    for degrees in (0..360).step_by(15) {
        let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
        let ball = masses(vec![2.0; 3], vec![0.0, 0.0, -2.0 * GRAVITY]).unwrap();
        let floor = LinearRows::new().unilateral(&[(2, 1.0)], 0.0).friction(friction, &[&[(0, 1.0)], &[(1, 1.0)]]);
        let velocity = vec![speed * cosine, speed * sine, 0.0];
        let mut run = run(ball, Box::new(Newmark::trapezoidal()), 0.01, velocity).constraint(floor).build().unwrap();
        run.run_until(0.2, &mut ()).unwrap();
        let (v, expected) = (run.state().velocity(), speed - friction * GRAVITY * 0.2);
        assert!((v[0] - expected * cosine).abs() < 1e-12 && (v[1] - expected * sine).abs() < 1e-12, "{degrees}");
        run.run_until(1.0, &mut ()).unwrap();
        let way = run.state().displacement();
        let stop = speed * speed / (2.0 * friction * GRAVITY);
        assert!((way[0].hypot(way[1]) / stop - 1.0).abs() < 1e-3 && run.state().velocity()[0].abs() < 1e-14);
    }
}

/// A rod by (x, y, angle) of its middle, at this angle to a floor, on its lower end: the end is below the middle, and
/// before it or, mirrored, behind it.
#[derive(Clone, Copy)]
struct Rod {
    angle: f64,
    mirrored: bool,
}

impl Rod {
    const MASS: f64 = 1.0;
    const HALF: f64 = 1.0;
    const INERTIA: f64 = Self::MASS * Self::HALF * Self::HALF / 3.0;

    /// Rows of the gap and of the slip of the end, from some dof on.
    fn rows(self, first: usize) -> [[(usize, f64); 2]; 2] {
        let (sine, cosine) = self.angle.sin_cos();
        let side = if self.mirrored { Self::HALF } else { -Self::HALF };
        [[(first + 1, 1.0), (first + 2, side * cosine)], [(first, 1.0), (first + 2, Self::HALF * sine)]]
    }

    /// W_nn, W_nt, W_tt.
    fn delassus(self) -> [f64; 3] {
        let [[_, (_, normal)], [_, (_, tangential)]] = self.rows(0);
        let inverse = 1.0 / Self::MASS;
        let entry = |a: f64, b: f64| a * b / Self::INERTIA;
        [inverse + entry(normal, normal), entry(normal, tangential), inverse + entry(tangential, tangential)]
    }

    /// The least μ at which the end jams, if it slides ahead.
    fn threshold(self) -> f64 {
        let [normal, coupling, _] = self.delassus();
        normal / coupling.abs()
    }

    /// The velocity of the middle with which the end slides ahead.
    fn velocity(self) -> f64 {
        if self.mirrored { 1.0 } else { -1.0 }
    }

    /// Normal impulse, tangential impulse and change of the energy when the end stops.
    fn impact(self) -> [f64; 3] {
        let ([normal, coupling, tangential], slip) = (self.delassus(), self.velocity());
        let friction = -slip / (tangential - coupling * coupling / normal);
        [-coupling / normal * friction, friction, 0.5 * friction * slip]
    }

    fn energy(v: &[f64]) -> f64 {
        0.5 * (Self::MASS * (v[0] * v[0] + v[1] * v[1]) + Self::INERTIA * v[2] * v[2])
    }

    /// The rod alone in its weight, its end this far above the floor.
    fn on_floor(self, scheme: Box<dyn TimeIntegrator>, friction: f64, gap: f64) -> SimulationBuilder<'static, f64> {
        let [normal, tangential] = self.rows(0);
        let rod = masses(vec![Self::MASS, Self::MASS, Self::INERTIA], vec![0.0, -Self::MASS * GRAVITY, 0.0]).unwrap();
        let floor = LinearRows::new().unilateral(&normal, gap).friction(friction, &[&tangential]);
        run(rod, scheme, 1e-3, vec![self.velocity(), 0.0, 0.0]).constraint(floor)
    }
}

/// A rod that slides on its end, pressed down: where μ |W_nt| exceeds W_nn no force stops its approach as it slides on
/// (Painlevé). The end stops at once, by an impact without collision, at the start and after a fall.
#[test]
fn a_sliding_rod_that_jams_stops_at_once() {
    for mirrored in [false, true] {
        let rod = Rod { angle: 1.0, mirrored };
        let mut slides = rod.on_floor(Box::new(Newmark::trapezoidal()), 0.95 * rod.threshold(), 0.0).build().unwrap();
        assert!(slides.start_adjustment().is_none());
        slides.step().unwrap();
        assert_eq!(slides.state().contacts().status(0), ContactStatus::Sliding);
        let falls = rod.on_floor(Box::new(Newmark::trapezoidal()), 1.05 * rod.threshold(), 1e-4);
        let mut falls = falls.build().unwrap();
        assert!(falls.start_adjustment().is_none());
        falls.run_until(0.01, &mut ()).unwrap();
        let (v, contacts) = (falls.state().velocity(), falls.state().contacts());
        let slip: f64 = rod.rows(0)[1].iter().map(|&(dof, weight)| weight * v[dof]).sum();
        assert!(slip.abs() < 1e-12 && contacts.closed()[0], "{v:?}");
    }
}

/// Schemes that solve for the force at the start report the impact there.
#[test]
fn the_impact_of_a_jammed_start_is_that_of_the_closed_form() {
    let mut schemes_of_starts = 0;
    // Schemes that impose contact ahead of the state have the impact in their first step.
    for scheme in schemes().filter(|scheme| scheme.takes_corrections() || scheme.name() == "Moreau–Jean(0.5)") {
        for (degrees, over) in [(60.0_f64, 1.2), (40.0, 1.05), (70.0, 1.001)] {
            let found = [false, true].map(|mirrored| {
                let rod = Rod { angle: degrees.to_radians(), mirrored };
                let friction = over * rod.threshold();
                let mut run = rod.on_floor((scheme.make)(), friction, 0.0).build().unwrap();
                let case = format!("{}, {degrees}°, mirrored: {mirrored}", scheme.name());
                let adjustment = run.start_adjustment().unwrap();
                let impact = adjustment.impact.unwrap();
                let [normal, tangential, energy] = rod.impact();
                assert!((impact.normal - normal).abs() < 1e-14, "{case}: {impact:?}");
                assert!((impact.friction[0] - tangential).abs() < 1e-14 && impact.friction[1] == 0.0, "{case}");
                assert!((impact.energy - energy).abs() < 1e-14 && energy < 0.0, "{case}: {impact:?}");
                assert!((impact.friction[0].abs() / impact.normal / rod.threshold() - 1.0).abs() < 1e-12, "{case}");
                assert!(adjustment.largest == 0.0 && adjustment.energy == Some(0.0), "{case}");
                let rates =
                    |v: &[f64]| rod.rows(0).map(|row| row.iter().map(|&(dof, weight)| weight * v[dof]).sum::<f64>());
                let v = run.state().velocity().to_vec();
                assert!(rates(&v).iter().all(|rate| rate.abs() < 1e-14), "{case}: {v:?}");
                assert!((Rod::energy(&v) - Rod::energy(&[1.0, 0.0, 0.0]) - energy).abs() < 1e-14, "{case}");
                assert_eq!(run.state().contacts().status(0), ContactStatus::Sticking, "{case}");
                // A hinge from there on.
                for _ in 0..20 {
                    run.step().unwrap();
                    let rates = rates(run.state().velocity());
                    assert!(rates.iter().all(|rate| rate.abs() < 1e-9), "{case}: {rates:?}");
                }
                let potential = Rod::MASS * GRAVITY * run.state().displacement()[1];
                let total = Rod::energy(run.state().velocity()) + potential;
                assert!((total / Rod::energy(&v) - 1.0).abs() < 0.02, "{case}: {total}");
                let [x, y, turn] = [0, 1, 2].map(|dof| run.state().velocity()[dof]);
                [x, y, turn]
            });
            let [[x, y, turn], [mirrored_x, mirrored_y, mirrored_turn]] = found;
            let differences = [x + mirrored_x, y - mirrored_y, turn + mirrored_turn];
            assert!(differences.iter().all(|difference| difference.abs() < 1e-13), "{found:?}");
            schemes_of_starts += 1;
        }
    }
    assert!(schemes_of_starts > 30, "{schemes_of_starts}");
    // The numbers of 60°: half of the energy is nearly lost.
    let [_, _, energy] = Rod { angle: 60.0_f64.to_radians(), mirrored: false }.impact();
    assert!((0.5 + energy - 0.281_25).abs() < 1e-14);
}

#[test]
fn the_impact_of_a_jammed_start_moves_other_contacts_and_both_tangents() {
    let rod = Rod { angle: 1.0, mirrored: false };
    let ([normal, tangential], friction) = (rod.rows(0), 1.05 * rod.threshold());
    let [impulse, along, energy] = rod.impact();
    let scheme = || Box::new(Newmark::trapezoidal());
    // On a heavy plate that lies on the floor: the floor takes what the plate is given.
    let plate = 100.0;
    let mass = vec![Rod::MASS, Rod::MASS, Rod::INERTIA, plate];
    let system = masses(mass, vec![0.0, -Rod::MASS * GRAVITY, 0.0, -plate * GRAVITY]).unwrap();
    let on_plate = [&normal[..], &[(3, -1.0)]].concat();
    let rows = LinearRows::new().unilateral(&on_plate, 0.0).friction(friction, &[&tangential]);
    let rows = rows.unilateral(&[(3, 1.0)], 0.0);
    let run_on_plate = run(system, scheme(), 1e-3, vec![-1.0, 0.0, 0.0, 0.0]).constraint(rows).build().unwrap();
    let impact = run_on_plate.start_adjustment().unwrap().impact.unwrap();
    assert_eq!((impact.contact.constraint, impact.contact.feature), (0, 0));
    assert!((impact.normal - impulse).abs() < 1e-13 && (impact.energy - energy).abs() < 1e-13, "{impact:?}");
    assert!(run_on_plate.state().velocity()[3].abs() < 1e-15);
    // In space, with a slip along the other tangent as well.
    let aside = 0.05;
    let system = masses(vec![Rod::MASS, Rod::MASS, Rod::INERTIA, Rod::MASS], vec![0.0, -Rod::MASS * GRAVITY, 0.0, 0.0]);
    let rows = LinearRows::new().unilateral(&normal, 0.0).friction(friction, &[&tangential, &[(3, 1.0)]]);
    let mut in_space =
        run(system.unwrap(), scheme(), 1e-3, vec![-1.0, 0.0, 0.0, aside]).constraint(rows).build().unwrap();
    let impact = in_space.start_adjustment().unwrap().impact.unwrap();
    let expected = [along, -Rod::MASS * aside];
    assert!((0..2).all(|k| (impact.friction[k] - expected[k]).abs() < 1e-14), "{impact:?}");
    in_space.step().unwrap();
    assert!(in_space.state().velocity()[3].abs() < 1e-14);
}

/// One impact is looked for: if several contacts jam the start is refused, with the numbers of one of them.
#[test]
fn starts_with_several_jammed_contacts_are_refused() {
    let rod = Rod { angle: 1.0, mirrored: false };
    let friction = 1.05 * rod.threshold();
    let masses_of_both = [Rod::MASS, Rod::MASS, Rod::INERTIA].repeat(2);
    let system = masses(masses_of_both, [0.0, -Rod::MASS * GRAVITY, 0.0].repeat(2)).unwrap();
    let floor = [0, 3].into_iter().fold(LinearRows::new(), |rows, first| {
        let [normal, tangential] = rod.rows(first);
        rows.unilateral(&normal, 0.0).friction(friction, &[&tangential])
    });
    let velocity = [rod.velocity(), 0.0, 0.0].repeat(2);
    match run(system, Box::new(Newmark::trapezoidal()), 1e-3, velocity).constraint(floor).build() {
        Err(Error::Jammed { friction: found, normal, coupling, .. }) => {
            assert!((found - friction).abs() < 1e-12 && friction * coupling > normal, "{normal} {coupling}");
            let [nn, nt, _] = rod.delassus();
            assert!((normal / nn - 1.0).abs() < 1e-12 && (coupling / nt.abs() - 1.0).abs() < 1e-12);
        }
        Ok(_) => panic!("accepted"),
        Err(other) => panic!("{other}"),
    }
}
