//! Loads, states and fields between a body and its reduction; momentum, damping, units, order; several bodies.

use contact_dynamics::faer::sparse::{SparseColMat, SparseColMatRef};
use contact_dynamics::reduction::{Blocks, Boundary, ReducedBody, Reduction};
use contact_dynamics::{Bathe, LinearRows, Real, Simulation, System};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{diagonal, entries, matrix, product, springs};

const STEEL: Material = Material { young: 210.0, poisson: 0.3, density: 7.8 };
const ALL: [Boundary; 3] = [Boundary::Tapered, Boundary::Untapered, Boundary::CraigBampton];

type Matrix = SparseColMat<usize, f64>;

fn block() -> (Solid<2>, Matrix, Matrix) {
    let solid = Solid::rectangle([1.0, 2.0], [4, 6], STEEL);
    let (m, k) = (solid.consistent_mass(), solid.stiffness());
    (solid, m, k)
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

fn value(a: SparseColMatRef<'_, usize, f64>, i: usize, j: usize) -> f64 {
    a.row_idx_of_col_raw(j).binary_search(&i).map_or(0.0, |at| a.val_of_col(j)[at])
}

#[test]
fn rigid_motions_pass_exactly_and_cost_no_energy() {
    let (solid, m, k) = block();
    for boundary in ALL {
        let body = Reduction::new(m.as_ref(), k.as_ref(), &[0, 1, 9]).boundary(boundary).modes(12).unwrap();
        assert_eq!(body.rigid(), if boundary == Boundary::CraigBampton { 0 } else { 3 });
        for motion in 0..3 {
            let rigid: Vec<f64> =
                solid.nodes.iter().flat_map(|[x, y]| [[1.0, 0.0], [0.0, 1.0], [-(y - 0.3), x - 2.0]][motion]).collect();
            let reduced = body.displacement(&rigid).unwrap();
            let back = body.recover_displacement(&reduced).unwrap();
            assert!(rigid.iter().zip(&back).all(|(x, y)| (x - y).abs() < 1e-9), "{boundary:?} {motion}");
            let force = product(body.stiffness(), &reduced);
            assert!(force.iter().all(|f| f.abs() < 1e-7), "{boundary:?} {motion}: {force:?}");
            let velocity = body.velocity(&rigid).unwrap();
            let [energy, exact] =
                [dot(&velocity, &product(body.mass(), &velocity)), dot(&rigid, &product(m.as_ref(), &rigid))];
            assert!((energy / exact - 1.0).abs() < 1e-9, "{boundary:?} {motion}: {energy} {exact}");
        }
    }
}

#[test]
fn loads_do_the_work_of_recovered_fields() {
    let (solid, m, k) = block();
    let n = solid.dofs();
    let load: Vec<f64> = (0..n).map(|i| (1.3 * i as f64).cos()).collect();
    for boundary in ALL {
        let contact = [3, 40, 17];
        let body = Reduction::new(m.as_ref(), k.as_ref(), &contact).fix(&[0, 1]).boundary(boundary).modes(9).unwrap();
        let x: Vec<f64> = (0..body.dofs()).map(|i| (0.7 * i as f64).sin()).collect();
        let field = body.recover_velocity(&x).unwrap();
        let work = dot(&field, &load);
        assert!((dot(&body.load(&load).unwrap(), &x) / work - 1.0).abs() < 1e-9, "{boundary:?}");
        // Contact dofs and supports, bit for bit.
        for (&dof, place) in contact.iter().zip(body.contact_dofs()) {
            assert_eq!(field[dof].to_bits(), x[place].to_bits());
        }
        assert!(field[0] == 0.0 && field[1] == 0.0 && body.parent_dofs() == n);
    }
}

/// What the wall gives is what the body gets, by the weights of the scheme.
#[test]
fn momentum_of_a_free_body_changes_by_the_impulse_of_contact() {
    let n = 60;
    let (m, k): (Matrix, Matrix) = (diagonal(&vec![1.0; n + 1]), matrix(n + 1, springs(n + 1, 1.0)));
    for boundary in [Boundary::Tapered, Boundary::Untapered] {
        let body = Reduction::new(m.as_ref(), k.as_ref(), &[0]).boundary(boundary).modes(12).unwrap();
        let along = body.velocity(&vec![1.0; n + 1]).unwrap();
        let start: Vec<f64> = along.iter().map(|v| -0.02 * v).collect();
        let mut run = Simulation::builder(body.system().unwrap(), Bathe::with_radius(1.0).unwrap(), 0.5)
            .velocity(start)
            .constraint(LinearRows::new().unilateral(&[(body.contact_dofs().start, 1.0)], 0.1))
            .build()
            .unwrap();
        let before = run.momentum(&along).unwrap();
        assert!((before + 0.02 * (n + 1) as f64).abs() < 1e-9);
        let mut impulse = 0.0;
        while run.time() < 200.0 {
            run.step().unwrap();
            impulse += run.state().contacts().impulses()[0];
        }
        let after = run.momentum(&along).unwrap();
        assert!((after - before - impulse).abs() < 1e-9 && after > 0.9 * -before, "{before} {after} {impulse}");
    }
}

#[test]
fn contact_dofs_may_be_named_in_any_order() {
    let (_, m, k) = block();
    let reduced = |contact: &[usize]| Reduction::new(m.as_ref(), k.as_ref(), contact).modes(10).unwrap();
    let (one, other) = (reduced(&[8, 2, 33]), reduced(&[2, 33, 8]));
    let place = |i: usize| if i < 10 { i } else { [12, 10, 11][i - 10] };
    let largest = (0..13).map(|i| value(one.stiffness(), i, i)).fold(0.0, f64::max);
    for i in 0..13 {
        for j in 0..13 {
            let [x, y] = [value(one.stiffness(), i, j), value(other.stiffness(), place(i), place(j))];
            assert!((x - y).abs() < 1e-9 * largest, "{i} {j}: {x} {y}");
        }
    }
}

#[test]
fn powers_of_two_change_no_bit() {
    let (_, m, k) = block();
    let scaled =
        |a: &Matrix, by: f64| -> Matrix { matrix(a.nrows(), entries(a).into_iter().map(|(i, j, x)| (i, j, by * x))) };
    let reduced = |m: &Matrix, k: &Matrix, boundary| {
        Reduction::new(m.as_ref(), k.as_ref(), &[0, 1, 8]).boundary(boundary).modes(14).unwrap()
    };
    for boundary in ALL {
        let one = reduced(&m, &k, boundary);
        // Masses 16 times, times 4 times as large.
        let other = reduced(&scaled(&m, 16.0), &scaled(&k, 1.0), boundary);
        let unit = |i: usize| if i < 14 { 0.25 } else { 1.0 };
        for i in 0..17 {
            for j in 0..17 {
                let [x, y] = [value(one.stiffness(), i, j), value(other.stiffness(), i, j)];
                assert!((x * unit(i) * unit(j) - y).abs() <= 0.0, "{boundary:?} {i} {j}: {x} {y}");
            }
        }
    }
}

#[test]
fn damping_is_that_of_the_modes() {
    let (_, m, k) = block();
    let reduction = || Reduction::new(m.as_ref(), k.as_ref(), &[0]);
    let ratio = reduction().damping_ratio(|omega| 0.01 + 1e-3 * omega).modes(9).unwrap();
    let rayleigh = reduction().rayleigh(0.2, 1e-3).modes(9).unwrap();
    for (k, &omega) in ratio.frequencies().iter().enumerate() {
        let [x, y] = [&ratio, &rayleigh].map(|body| value(body.damping().unwrap(), k, k));
        assert!((x - 2.0 * (0.01 + 1e-3 * omega) * omega).abs() <= 1e-12 * (1.0 + x), "{k}");
        assert!((y - 0.2 - 1e-3 * omega * omega).abs() <= 1e-12 * (1.0 + y), "{k}");
    }
    let contact = ratio.contact_dofs().start;
    assert!(value(ratio.damping().unwrap(), contact, contact).abs() <= 0.0);
    assert!(reduction().modes(9).unwrap().damping().is_none());
    // Of contact dofs with mass it is that of the whole.
    let whole = reduction().boundary(Boundary::CraigBampton).rayleigh(0.2, 1e-3).modes(9).unwrap();
    let expected = 0.2 * value(whole.mass(), 9, 9) + 1e-3 * value(whole.stiffness(), 9, 9);
    assert!((value(whole.damping().unwrap(), 9, 9) / expected - 1.0).abs() < 1e-12);
    // One mode alone decays as it should.
    let mut run = Simulation::builder(rayleigh.system().unwrap(), Bathe::with_radius(1.0).unwrap(), 1e-3)
        .velocity({
            let mut v = vec![0.0; rayleigh.dofs()];
            v[3] = 1.0;
            v
        })
        .build()
        .unwrap();
    let omega = rayleigh.frequencies()[3];
    let rate = 0.5 * (0.2 + 1e-3 * omega * omega);
    run.run_until(1.0, &mut ()).unwrap();
    let wave = (omega * omega - rate * rate).sqrt();
    let expected = (-rate * run.time()).exp() * (wave * run.time()).sin() / wave;
    assert!((run.state().displacement()[3] - expected).abs() < 1e-3 / omega);
}

#[test]
fn bodies_stand_side_by_side() {
    let (_, m, k) = block();
    let load = vec![0.5; m.nrows()];
    let reduced: ReducedBody<f64> =
        Reduction::new(m.as_ref(), k.as_ref(), &[0]).rayleigh(0.1, 0.0).constant_load(&load).modes(6).unwrap();
    let mut blocks = Blocks::new();
    let full = blocks.body(m.as_ref(), k.as_ref(), None).unwrap();
    let place = blocks.reduced(&reduced).unwrap();
    assert_eq!((full.end, place.start, blocks.dofs()), (m.nrows(), m.nrows(), m.nrows() + 7));
    let mut system = blocks.system().unwrap();
    let (n, mut force) = (blocks.dofs(), vec![0.0; blocks.dofs()]);
    let u: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
    let v: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
    system.force(0.0, &u, &v, &mut force).unwrap();
    let mut expected: Vec<f64> = product(k.as_ref(), &u[full]).iter().map(|f| -f).collect();
    let mut alone = vec![0.0; reduced.dofs()];
    reduced.system().unwrap().force(0.0, &u[place.clone()], &v[place], &mut alone).unwrap();
    expected.extend(alone);
    let largest = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    assert!(force.iter().zip(&expected).all(|(x, y)| (x - y).abs() < 1e-12 * largest));
}

#[test]
fn single_precision_reduces_like_double() {
    let (solid, m, k) = block();
    let (pattern, values) = m.clone().into_parts();
    let single = SparseColMat::new(pattern, values.into_iter().map(f32::of).collect());
    let other = solid.stiffness::<f32>();
    let body = Reduction::new(single.as_ref(), other.as_ref(), &[0, 1]).modes(10).unwrap();
    let double = Reduction::new(m.as_ref(), k.as_ref(), &[0, 1]).modes(10).unwrap();
    for (&x, &y) in body.frequencies().iter().zip(double.frequencies()) {
        assert!((x - y).abs() <= 1e-4 * y);
    }
    let place = body.contact_dofs().start;
    let stiffness = body.stiffness();
    let at = stiffness.row_idx_of_col_raw(place).binary_search(&place).unwrap();
    let ratio = f64::from(stiffness.val_of_col(place)[at]) / value(double.stiffness(), place, place);
    assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
}
