//! What is refused, by which error.

use contact_dynamics::Error;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::reduction::{Blocks, Boundary, Modes, Reduction};
use contact_dynamics_scenes::sparse::{diagonal, matrix, rectangular, spring, springs};

type Matrix = SparseColMat<usize, f64>;

fn chain(n: usize) -> (Matrix, Matrix) {
    (diagonal(&vec![1.0; n]), matrix(n, springs(n, 1.0)))
}

macro_rules! assert_refused {
    ($result:expr, $pattern:pat) => {
        match $result {
            Err($pattern) => {}
            other => panic!("{:?}", other.map(|_| ())),
        }
    };
}

#[test]
fn matrices_and_supports() {
    let (m, k) = chain(6);
    let lowest = |m: &Matrix, k: &Matrix, fixed: &[usize]| Modes::lowest(m.as_ref(), k.as_ref(), fixed, 2);
    assert_refused!(lowest(&diagonal(&[1.0; 5]), &k, &[]), Error::Dimension { expected: 6, found: 5, .. });
    assert_refused!(lowest(&m, &rectangular(6, 5, []), &[]), Error::Dimension { .. });
    assert_refused!(lowest(&diagonal(&[]), &matrix(0, []), &[]), Error::Empty { .. });
    let nan: Matrix = diagonal(&[1.0, 1.0, f64::NAN, 1.0, 1.0, 1.0]);
    assert_refused!(lowest(&nan, &k, &[]), Error::MatrixNotFinite { row: 2, .. });
    assert_refused!(lowest(&m, &matrix(6, [(0, 0, 1.0), (1, 0, 1.0)]), &[]), Error::Asymmetric { .. });
    let negative: Matrix = diagonal(&[1.0, 1.0, 1.0, -1.0, 1.0, 1.0]);
    assert_refused!(lowest(&negative, &k, &[]), Error::Mass { dof: 3, .. });
    assert_refused!(lowest(&diagonal(&[0.0; 6]), &k, &[]), Error::Mass { .. });
    assert_refused!(lowest(&m, &k, &[6]), Error::MissingDof { dof: 6, dofs: 6, .. });
    assert_refused!(lowest(&m, &k, &[1, 1]), Error::RepeatedDof { dof: 1, .. });
    assert_refused!(lowest(&m, &k, &[0, 1, 2, 3, 4, 5]), Error::Empty { .. });
    // A spring that pushes, and a dof with neither mass nor spring.
    let pushing = matrix(6, springs(6, 1.0).chain(spring(2, 3, -1.5)));
    assert_refused!(lowest(&m, &pushing, &[]), Error::Singular { .. });
    let apart = matrix(6, springs(5, 1.0));
    assert_refused!(lowest(&diagonal(&[1.0, 1.0, 1.0, 1.0, 1.0, 0.0]), &apart, &[]), Error::Singular { dof: 5, .. });
}

#[test]
fn numbers_of_modes() {
    let (m, k) = chain(6);
    let count = |fixed: &[usize], count| Modes::lowest(m.as_ref(), k.as_ref(), fixed, count).map(|modes| modes.count());
    assert_refused!(count(&[], 0), Error::Parameter { value: 0.0, .. });
    assert_refused!(count(&[], 7), Error::Parameter { value: 7.0, .. });
    assert_refused!(count(&[2], 6), Error::Parameter { value: 6.0, .. });
    assert_eq!((count(&[], 1).unwrap(), count(&[], 6).unwrap(), count(&[2], 5).unwrap()), (1, 6, 5));
    // Two bodies have two rigid motions.
    let two = matrix(6, springs(3, 1.0).chain(springs(3, 1.0).map(|(i, j, x)| (i + 3, j + 3, x))));
    assert_refused!(Modes::lowest(m.as_ref(), two.as_ref(), &[], 1), Error::Parameter { value: 1.0, .. });
    for frequency in [-1.0, f64::NAN, f64::INFINITY] {
        assert_refused!(Modes::up_to(m.as_ref(), k.as_ref(), &[], frequency), Error::Parameter { .. });
    }
    assert_eq!(Modes::up_to(m.as_ref(), k.as_ref(), &[], 0.0).unwrap().count(), 1);
    assert_eq!(Modes::up_to(m.as_ref(), k.as_ref(), &[], 99.0).unwrap().count(), 6);
}

#[test]
fn contact_dofs_loads_and_settings() {
    let (m, k) = chain(6);
    let reduce = |contact: &[usize]| Reduction::new(m.as_ref(), k.as_ref(), contact);
    assert_refused!(reduce(&[]).modes(3), Error::Empty { .. });
    assert_refused!(reduce(&[6]).modes(3), Error::MissingDof { dof: 6, .. });
    assert_refused!(reduce(&[1, 4, 1]).modes(3), Error::RepeatedDof { dof: 1, .. });
    assert_refused!(reduce(&[1, 4]).fix(&[4]).modes(3), Error::Incompatible { .. });
    assert_refused!(reduce(&[0]).constant_load(&[1.0; 5]).modes(3), Error::Dimension { expected: 6, found: 5, .. });
    let load = [0.0, f64::NAN, 0.0, 0.0, 0.0, 0.0];
    assert_refused!(reduce(&[0]).constant_load(&load).modes(3), Error::NotFinite { index: 1, .. });
    for exponent in [0.0, 0.9, f64::NAN, f64::INFINITY] {
        assert_refused!(reduce(&[0]).exponent(exponent).modes(3), Error::Parameter { .. });
    }
    for softening in [-0.1, f64::NAN, f64::INFINITY] {
        assert_refused!(reduce(&[0]).softening(softening).modes(3), Error::Parameter { .. });
    }
    assert_refused!(reduce(&[0]).damping_ratio(|_| -0.1).modes(3), Error::Parameter { value: -0.1, .. });
    // (Of rigid motions it is not asked.)
    assert!(reduce(&[0]).damping_ratio(|omega| 0.1 / omega).modes(3).is_ok());
    assert_refused!(reduce(&[0]).rayleigh(0.0, f64::NAN).modes(3), Error::Parameter { .. });
    // All modes leave nothing between them and the contact dofs, and one that is left does not do for two of these.
    for boundary in [Boundary::Tapered, Boundary::Untapered] {
        assert_refused!(reduce(&[0]).boundary(boundary).modes(6), Error::Incompatible { .. });
    }
    assert_refused!(reduce(&[0, 3]).boundary(Boundary::Untapered).modes(5), Error::Incompatible { .. });
    assert!(reduce(&[0]).boundary(Boundary::CraigBampton).modes(5).is_ok());
    let all = reduce(&[0, 1, 2, 3, 4, 5]).boundary(Boundary::CraigBampton);
    assert_refused!(all.modes(1), Error::Empty { .. });
    // A contact dof without mass in the parent, unless the host says how soft.
    let light: Matrix = diagonal(&[0.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
    let reduce_light = || Reduction::new(light.as_ref(), k.as_ref(), &[3, 0]);
    let error = reduce_light().modes(3).unwrap_err();
    assert!(matches!(error, Error::Incompatible { .. }) && error.to_string().contains("contact dof 0 (of 1 such)"));
    assert!(reduce_light().softening(2.0).modes(3).is_ok());
    assert!(reduce_light().boundary(Boundary::Untapered).modes(3).is_ok());
    assert!(Reduction::new(light.as_ref(), k.as_ref(), &[3]).modes(3).is_ok());
    // The longest step is that of the first mode left out.
    let accuracy = reduce(&[0]).modes(3).unwrap().accuracy();
    assert!((accuracy.longest_step * accuracy.cutoff - 2.5).abs() < 1e-12, "{accuracy:?}");
    let whole = reduce(&[0]).boundary(Boundary::CraigBampton).modes(5).unwrap().accuracy();
    assert!(whole.cutoff.is_infinite() && whole.longest_step > 0.0, "{whole:?}");
    // Modes of another body.
    let modes = Modes::lowest(m.as_ref(), k.as_ref(), &[5], 3).unwrap();
    assert_refused!(reduce(&[0]).with_modes(&modes), Error::Incompatible { .. });
    assert!(reduce(&[0]).fix(&[5]).with_modes(&modes).is_ok());
    // Each mode is solved for at least once to be found, and once to be checked.
    assert!(modes.solves() >= 2 * modes.count(), "{}", modes.solves());
}

#[test]
fn vectors_of_another_body() {
    let (m, k) = chain(6);
    let body = Reduction::new(m.as_ref(), k.as_ref(), &[0]).fix(&[5]).modes(3).unwrap();
    for x in [vec![0.0; 5], vec![0.0; 7]] {
        assert_refused!(body.load(&x), Error::Dimension { expected: 6, .. });
        assert_refused!(body.displacement(&x), Error::Dimension { expected: 6, .. });
        assert_refused!(body.velocity(&x), Error::Dimension { expected: 6, .. });
        assert_refused!(body.recover_displacement(&x), Error::Dimension { expected: 4, .. });
        assert_refused!(body.recover_velocity(&x), Error::Dimension { expected: 4, .. });
        assert_refused!(body.support_forces(&x, &x), Error::Dimension { expected: 4, .. });
    }
    let mut blocks = Blocks::new();
    blocks.reduced(&body).unwrap();
    assert_refused!(blocks.body(m.as_ref(), matrix(5, []).as_ref(), None), Error::Dimension { .. });
    assert_refused!(blocks.add_load(1, &[0.0; 4]), Error::Dimension { expected: 4, found: 5, .. });
    assert_refused!(Blocks::<f64>::new().system(), Error::Empty { .. });
}
