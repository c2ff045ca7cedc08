//! Gaps given by functions of the host: derivatives, following, what is refused, and runs.
#![allow(clippy::float_cmp)] // unchanged values are meant exactly

use contact_dynamics::contact::{Candidates, ContactId, ContactJacobian, Contacts, GapFunction, GapRates};
use contact_dynamics::{ContactConstraint, ContactLaw, Error, Newmark, PersistencyCorrection, Simulation, verify};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::sparse::free;
use proptest::prelude::*;

/// Two points of the plane at most `length` apart, which shrinks with time.
fn rope(places: [f64; 4], length: f64) -> impl FnMut(f64, &[f64], &[f64], &mut [f64]) -> [f64; 3] + Send {
    move |t, x, v, gradient| {
        let r = [0, 1].map(|i| places[2 + i] + x[2 + i] - places[i] - x[i]);
        let w = [0, 1].map(|i| v[2 + i] - v[i]);
        let distance = r[0].hypot(r[1]);
        let n = r.map(|r| r / distance);
        gradient.copy_from_slice(&[n[0], n[1], -n[0], -n[1]]);
        let across = n[0] * w[1] - n[1] * w[0];
        [length - 0.1 * t * t - distance, -0.2 * t, -0.2 - across * across / distance]
    }
}

/// A point above a wave that runs: the gradient depends on time.
fn wave(t: f64, x: &[f64], v: &[f64], gradient: &mut [f64]) -> [f64; 3] {
    let (sin, cos) = (x[0] - 0.7 * t).sin_cos();
    gradient.copy_from_slice(&[-0.3 * cos, 1.0]);
    [1.0 + x[1] - 0.3 * sin, 0.21 * cos, 0.3 * sin * (v[0] - 0.7) * (v[0] - 0.7)]
}

fn both() -> GapFunction<'static, f64> {
    GapFunction::new(&[4, 1, 0, 3], rope([0.0, 0.0, 0.6, 0.8], 2.0)).and(&[5, 2], wave)
}

fn gaps(contact: &mut GapFunction<'_, f64>, t: f64, u: &[f64]) -> Vec<f64> {
    let mut gaps = vec![f64::INFINITY; contact.candidates()];
    contact.gap(t, u, &mut gaps);
    gaps
}

fn rows(contact: &GapFunction<'_, f64>) -> ContactJacobian<f64> {
    contact.jacobian()
}

#[test]
fn rows_are_derivatives_of_the_functions() {
    let (u, v) = ([0.1, -0.2, 0.4, 0.3, -0.1, 0.2], [0.5, 1.0, -0.7, 0.2, 0.4, -0.9]);
    let mut contact = both();
    let error = verify::gap_jacobian(&mut contact, 0.3, &u, &v, 1e-5).unwrap();
    assert!(error.rows == 2 && error.rows_lost == 0, "{error:?}");
    assert!(error.jacobian < 1e-9 && error.rate < 1e-8, "{error:?}");
    // Second differences along the motion.
    let mut rates = [GapRates::default(); 2];
    contact.rates_on(0.3, &u, &v, &mut rates);
    let mut at = |s: f64| {
        let (t, u) = (0.3 + s, std::array::from_fn::<_, 6, _>(|dof| u[dof] + s * v[dof]));
        contact.search_on(t, &u, &v, 0.0).unwrap();
        gaps(&mut contact, t, &u)
    };
    let [before, here, after] = [at(-1e-4), at(0.0), at(1e-4)];
    for row in 0..2 {
        let difference = (after[row] - 2.0 * here[row] + before[row]) / 1e-8;
        assert!((difference - rates[row].acceleration).abs() < 1e-6, "{difference} {:?}", rates[row]);
    }
}

proptest! {
    #[test]
    fn followed_rows_are_those_of_a_search(
        u in prop::array::uniform6(-0.3..0.3_f64),
        to in prop::array::uniform6(-0.3..0.3_f64),
        t in 0.0..1.0_f64,
    ) {
        let (mut contact, mut fresh) = (both(), both());
        prop_assert_eq!(contact.candidates(), 0);
        prop_assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Changed);
        prop_assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Unchanged);
        prop_assert_eq!(contact.follow_on(t, &to).unwrap(), Candidates::Changed);
        prop_assert_eq!(contact.follow_on(t, &to).unwrap(), Candidates::Unchanged);
        fresh.search_on(t, &to, &to, 0.0).unwrap();
        prop_assert_eq!(rows(&contact), rows(&fresh));
        prop_assert_eq!(gaps(&mut contact, t, &to), gaps(&mut fresh, t, &to));
        prop_assert_eq!(contact.search_on(t, &to, &to, 0.0).unwrap(), Candidates::Unchanged);
        prop_assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Changed);
        prop_assert_eq!([contact.identity(0), contact.identity(1)], [(0, 0), (1, 0)]);
    }
}

#[test]
fn following_does_not_allocate() {
    let mut contact = both();
    let (mut u, mut gaps, mut rates) = ([0.0; 6], [0.0; 2], [GapRates::default(); 2]);
    contact.search_on(0.0, &u, &u, 0.0).unwrap();
    let counted = allocation_counter::measure(|| {
        for k in 0..10 {
            u[k % 6] += 0.01;
            contact.follow(0.1, &u).unwrap();
            contact.gaps(0.1, &u, &mut gaps).unwrap();
            contact.rates(0.1, &u, &u, &mut rates).unwrap();
        }
    });
    assert_eq!(counted.count_total, 0);
}

#[test]
fn wrong_sizes_are_refused() {
    let none = GapFunction::new(&[], |_, _: &[f64], _: &[f64], _: &mut [f64]| [1.0, 0.0, 0.0]);
    let built = Simulation::builder(free(&[1.0; 4]), Newmark::trapezoidal(), 0.1).constraint(none).build();
    assert!(matches!(built, Err(Error::EmptyContact { .. })));
    let mut contact = both();
    assert!(matches!(
        contact.search(0.0, &[0.0; 3], &[0.0; 3], 0.0),
        Err(Error::Dimension { expected: 6, found: 3, .. })
    ));
    assert!(matches!(contact.follow(0.0, &[0.0; 3]), Err(Error::Dimension { .. })));
    contact.search(0.0, &[0.0; 6], &[0.0; 6], 0.0).unwrap();
    let built = Simulation::builder(free(&[1.0; 4]), Newmark::trapezoidal(), 0.1).constraint(both()).build();
    assert!(matches!(built, Err(Error::MissingContactDof { dof: 4, dofs: 4, .. })));
    for scale in [0.0, -1.0, f64::NAN] {
        assert!(matches!(both().scale(scale), Err(Error::Parameter { .. })));
    }
    let contact = contact.with_law(ContactLaw::Penalty { stiffness: 2.0 }).scale(3.0).unwrap();
    assert_eq!((contact.law(1), contact.magnitude(0)), (ContactLaw::Penalty { stiffness: 2.0 }, 3.0));
    assert_eq!(contact.dofs(), [4, 1, 0, 3, 5, 2]);
}

#[test]
fn gaps_that_are_no_numbers_fail_the_step() {
    // No gap below 0.5, and a gradient that is never written.
    let broken = |_: f64, x: &[f64], _: &[f64], gradient: &mut [f64]| {
        gradient[0] = 1.0;
        [if x[0] < -0.5 { f64::NAN } else { 1.0 + x[0] }, 0.0, 0.0]
    };
    let mut contact = GapFunction::new(&[0], broken);
    contact.search_on(0.0, &[0.0], &[0.0], 0.0).unwrap();
    assert_eq!(contact.follow_on(0.0, &[-0.6]).unwrap(), Candidates::Unchanged);
    assert!(gaps(&mut contact, 0.0, &[-0.6])[0].is_nan());
    assert_eq!(contact.follow_on(0.0, &[-0.4]).unwrap(), Candidates::Unchanged);
    assert_eq!(gaps(&mut contact, 0.0, &[-0.4]), [0.6]);
    let name = ContactId { constraint: 0, feature: 0, candidate: 0 };
    let mut run = Simulation::builder(free(&[1.0; 1]), Newmark::trapezoidal(), 0.1)
        .velocity(vec![-1.0])
        .constraint(GapFunction::new(&[0], broken))
        .build()
        .unwrap();
    let failed = (0..10).find_map(|_| run.step().err()).unwrap();
    assert!(matches!(failed, Error::ContactNotFinite { contact, .. } if contact == name), "{failed}");
    assert!(failed.is_recoverable());

    let unwritten = GapFunction::new(&[0], |_, x: &[f64], _: &[f64], _: &mut [f64]| [1.0 + x[0], 0.0, 0.0]);
    let built = Simulation::builder(free(&[1.0; 1]), Newmark::trapezoidal(), 0.1).constraint(unwritten).build();
    assert!(matches!(built, Err(Error::ContactNotFinite { .. })));
}

/// Two particles on a taut tether turn around each other: the force is that of circular motion.
#[test]
fn a_tether_holds_two_particles_on_a_circle() {
    let (length, speed) = (2.0, 3.0);
    let tether = move |_: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| {
        let value = rope([0.0, 0.0, length, 0.0], length)(0.0, x, v, gradient);
        [value[0], 0.0, value[2] + 0.2]
    };
    let run = |h: f64| {
        let mut run = Simulation::builder(free(&[1.0; 4]), Newmark::trapezoidal(), h)
            .velocity(vec![0.0, -speed, 0.0, speed])
            .constraint(GapFunction::new(&[0, 1, 2, 3], tether).scale(length).unwrap())
            .corrector(PersistencyCorrection::new())
            .build()
            .unwrap();
        let (mut force_error, mut stretch) = (0.0_f64, 0.0_f64);
        // The first step moves along the tangent, which the force at the start lifts it from.
        run.step().unwrap();
        while run.time() < 1.0 {
            run.step().unwrap();
            let (u, v) = (run.state().displacement(), run.state().velocity());
            assert!((0..4).all(|i| (u[i] + u[(i + 2) % 4]).abs() < 1e-12 && (v[i] + v[(i + 2) % 4]).abs() < 1e-12));
            // m v²/r with r half of the length.
            let exact = speed * speed / (0.5 * length);
            force_error = force_error.max((run.state().contacts().forces()[0] / exact - 1.0).abs());
            stretch = stretch.max((length + u[2] - u[0]).hypot(u[3] - u[1]) - length);
        }
        (force_error, stretch)
    };
    let (force, stretch) = run(2e-3);
    // At constant speed the trapezoidal rule is exact but for the way.
    assert!(force < 1e-11 && stretch < 1e-12, "{force:e} {stretch:e}");
}

#[test]
fn friction_is_that_of_the_last_function() {
    let along = |_: f64, _: &[f64], tangent: &mut [f64]| {
        tangent.copy_from_slice(&[1.0, 0.0]);
        [[0.0; 2]; 2]
    };
    let mut contact = both().friction(0.4, 1, along);
    let u = [0.1, -0.2, 0.4, 0.3, -0.1, 0.2];
    contact.search_on(0.3, &u, &[0.0; 6], 0.0).unwrap();
    let contacts = Contacts::of(&contact);
    assert_eq!([0, 1].map(|row| contacts.tangents(row).len()), [0, 1]);
    assert_eq!([0, 1].map(|row| contacts.friction(row)), [0.0, 0.4]);
}
