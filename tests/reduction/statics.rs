//! Statics and full sets of modes: what a reduction has to be exactly.

use contact_dynamics::faer::sparse::{SparseColMat, SparseColMatRef};
use contact_dynamics::reduction::{Boundary, Modes, ReducedBody, Reduction};
use contact_dynamics::{Bathe, Cholesky, LinearRows, LinearSystem, Newmark, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{Entry, diagonal, entries, factorized, matrix, product};

const STEEL: Material = Material { young: 210.0, poisson: 0.3, density: 7.8 };

type Matrix = SparseColMat<usize, f64>;

/// A plate that stands on supports, and some dofs of its top in an order that does not ascend.
struct Plate {
    mass: Matrix,
    stiffness: Matrix,
    fixed: Vec<usize>,
    contact: Vec<usize>,
}

impl Plate {
    fn new() -> Self {
        let solid = Solid::rectangle([1.0, 2.0], [5, 7], STEEL);
        let at = |y: f64| (0..solid.nodes.len()).filter(|&n| (solid.nodes[n][1] - y).abs() < 1e-12).collect::<Vec<_>>();
        Self {
            fixed: at(0.0).iter().flat_map(|n| [2 * n, 2 * n + 1]).collect(),
            contact: at(2.0).iter().step_by(2).flat_map(|n| [2 * n + 1, 2 * n]).collect(),
            mass: solid.consistent_mass(),
            stiffness: solid.stiffness(),
        }
    }

    fn reduction(&self, boundary: Boundary) -> Reduction<'_, f64> {
        Reduction::new(self.mass.as_ref(), self.stiffness.as_ref(), &self.contact).fix(&self.fixed).boundary(boundary)
    }

    /// Displacements under a load, supports held.
    fn solve(&self, load: &[f64]) -> Vec<f64> {
        let free = |dof: &usize| !self.fixed.contains(dof);
        let kept = entries(&self.stiffness).into_iter().filter(|(i, j, _)| free(i) && free(j));
        let held = matrix(load.len(), kept.chain(self.fixed.iter().map(|&i| (i, i, 1.0))));
        let mut x: Vec<f64> = load.iter().enumerate().map(|(i, f)| if free(&i) { *f } else { 0.0 }).collect();
        factorized(&Cholesky::default(), &held).solve(&mut x).unwrap();
        x
    }
}

fn entries_of(a: SparseColMatRef<'_, usize, f64>) -> Vec<Entry> {
    let column = |j: usize| a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)).map(move |(&i, &x)| (i, j, x));
    (0..a.ncols()).flat_map(column).collect()
}

/// Reduced displacements under a reduced load.
fn solve(body: &ReducedBody<f64>, load: &[f64]) -> Vec<f64> {
    let k = matrix(body.dofs(), entries_of(body.stiffness()));
    let mut x = load.to_vec();
    factorized(&Cholesky::default(), &k).solve(&mut x).unwrap();
    x
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, x| m.max(x.abs()))
}

fn assert_close(x: &[f64], y: &[f64], tolerance: f64) {
    assert_eq!(x.len(), y.len());
    let size = largest(y);
    for (k, (x, y)) in x.iter().zip(y).enumerate() {
        assert!((x - y).abs() <= tolerance * size, "{k}: {x} {y}");
    }
}

#[test]
fn forces_at_contact_dofs_have_their_static_response() {
    let plate = Plate::new();
    let n = plate.stiffness.nrows();
    let mut load = vec![0.0; n];
    plate.contact.iter().enumerate().for_each(|(k, &dof)| load[dof] = (1.0 + k as f64).sin());
    let exact = plate.solve(&load);
    for boundary in [Boundary::Untapered, Boundary::CraigBampton] {
        for count in [1, 4, 20] {
            let body = plate.reduction(boundary).modes(count).unwrap();
            let reduced = body.load(&load).unwrap();
            // A force at a contact dof acts on that one alone.
            assert!(largest(&reduced[..count]) < 1e-10, "{boundary:?}");
            let x = solve(&body, &reduced);
            assert_close(&body.recover_displacement(&x).unwrap(), &exact, 1e-9);
            assert!(body.accuracy().compliance.abs() <= 0.0);
        }
    }
}

#[test]
fn a_taper_without_softening_is_statically_exact() {
    let plate = Plate::new();
    let mut load = vec![0.0; plate.stiffness.nrows()];
    plate.contact.iter().enumerate().for_each(|(k, &dof)| load[dof] = (2.0 + k as f64).cos());
    let body = plate.reduction(Boundary::Tapered).softening(0.0).modes(9).unwrap();
    let x = solve(&body, &body.load(&load).unwrap());
    assert_close(&body.recover_displacement(&x).unwrap(), &plate.solve(&load), 1e-9);
    assert!(body.accuracy().compliance.abs() <= 0.0);
}

/// The taper adds 2R to the static compliance, R found here from the modes and K⁻¹ by itself.
#[test]
fn the_taper_adds_twice_the_residual_flexibility() {
    let plate = Plate::new();
    let n = plate.stiffness.nrows();
    let count = 12;
    let modes = Modes::lowest(plate.mass.as_ref(), plate.stiffness.as_ref(), &plate.fixed, count).unwrap();
    let body = plate.reduction(Boundary::Tapered).with_modes(&modes).unwrap();
    let mut worst = 0.0_f64;
    for &dof in &plate.contact {
        let mut load = vec![0.0; n];
        load[dof] = 1.0;
        let exact = plate.solve(&load);
        let mut residual = exact.clone();
        for k in 0..count {
            let (shape, omega) = (modes.shape(k), modes.frequencies()[k]);
            residual.iter_mut().zip(&shape).for_each(|(r, x)| *r -= x * shape[dof] / (omega * omega));
        }
        let x = solve(&body, &body.load(&load).unwrap());
        let expected: Vec<f64> = exact.iter().zip(&residual).map(|(u, r)| u + 2.0 * r).collect();
        assert_close(&body.recover_displacement(&x).unwrap(), &expected, 1e-9);
        worst = worst.max(residual[dof] / exact[dof]);
    }
    let accuracy = body.accuracy();
    assert!((accuracy.residual.unwrap() / worst - 1.0).abs() < 1e-9 && accuracy.compliance < 1.0);
    assert!((accuracy.compliance / (2.0 * worst) - 1.0).abs() < 1e-9);
    assert!((accuracy.cutoff - modes.next_frequency()).abs() <= 0.0);
}

#[test]
fn a_constant_load_has_its_static_response_and_its_reactions() {
    let plate = Plate::new();
    let n = plate.stiffness.nrows();
    let load: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).sin()).collect();
    let exact = plate.solve(&load);
    let balance = product(plate.stiffness.as_ref(), &exact);
    let reactions: Vec<f64> = plate.fixed.iter().map(|&dof| balance[dof] - load[dof]).collect();
    for boundary in [Boundary::Untapered, Boundary::CraigBampton] {
        let body = plate.reduction(boundary).constant_load(&load).modes(6).unwrap();
        let x = solve(&body, body.constant_load().unwrap());
        assert_close(&body.recover_displacement(&x).unwrap(), &exact, 1e-9);
        assert_close(&body.support_forces(&x, &vec![0.0; body.dofs()]).unwrap(), &reactions, 1e-8);
    }
    // A state of rest is one of rest, whatever the taper. (Twice what the modes leave of the load comes on top of it.)
    let load: Vec<f64> = (0..n).map(|dof| [0.1, -0.5][dof % 2]).collect();
    let exact = plate.solve(&load);
    let body = plate.reduction(Boundary::Tapered).constant_load(&load).modes(30).unwrap();
    let rest = solve(&body, body.constant_load().unwrap());
    let projected = body.displacement(&exact).unwrap();
    assert_close(&projected[..30], &rest[..30], 1e-9);
    assert_close(&body.recover_displacement(&rest).unwrap(), &exact, 2e-2);
}

/// What the modes leave of a load is softened as what they leave of contact forces is: s times it comes on top.
#[test]
fn what_modes_leave_of_a_load_is_softened() {
    let plate = Plate::new();
    let n = plate.stiffness.nrows();
    let load: Vec<f64> = (0..n).map(|dof| [0.1, -0.5][dof % 2]).collect();
    let exact = plate.solve(&load);
    let rest = |softening: f64| {
        let reduction = plate.reduction(Boundary::Tapered).softening(softening).constant_load(&load);
        let body = reduction.modes(3).unwrap();
        body.recover_displacement(&solve(&body, body.constant_load().unwrap())).unwrap()
    };
    let [one, two] = [1.0, 2.0].map(rest);
    let left: Vec<f64> = one.iter().zip(&two).map(|(one, two)| two - one).collect();
    let size = |x: &[f64]| x.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    assert!(load.iter().zip(&left).map(|(load, left)| load * left).sum::<f64>() > 0.0, "the load does work on it");
    let miss: Vec<f64> = (0..n).map(|dof| one[dof] - exact[dof] - left[dof]).collect();
    assert!(size(&left) > 1e-3 * size(&exact) && size(&miss) < 1e-9 * size(&left), "{}", size(&miss) / size(&left));
}

/// Two opposite forces on a free bar, which has no K⁻¹.
#[test]
fn free_bodies_have_the_flexibility_of_self_balanced_loads() {
    let n = 40;
    let k = matrix(n + 1, contact_dynamics_scenes::sparse::springs(n + 1, 3.0));
    let m: Matrix = diagonal(&vec![1.0; n + 1]);
    let body = Reduction::new(m.as_ref(), k.as_ref(), &[n, 0]).boundary(Boundary::Untapered).modes(5).unwrap();
    // K_r has the rigid motion as its null space: held at one contact dof the other moves by n/3.
    let (last, first) = (body.contact_dofs().start, body.contact_dofs().start + 1);
    let kept = entries_of(body.stiffness()).into_iter().filter(|&(i, j, _)| i != first && j != first);
    let held: Matrix = matrix(body.dofs(), kept.chain([(first, first, 1.0)]));
    let mut x = vec![0.0; body.dofs()];
    x[last] = 1.0;
    factorized(&Cholesky::default(), &held).solve(&mut x).unwrap();
    assert!((x[last] / (n as f64 / 3.0) - 1.0).abs() < 1e-9, "{}", x[last]);
}

/// With contact dofs without mass the finite modes and the rest of the flexibility are all of the body.
#[test]
fn all_modes_of_a_body_with_massless_contact_dofs_are_the_body() {
    let n = 24;
    let mut masses = vec![1.0; n + 1];
    masses[0] = 0.0;
    let k = matrix(n + 1, contact_dynamics_scenes::sparse::springs(n + 1, 1.0));
    let m: Matrix = diagonal(&masses);
    let h = 0.3;
    let run = |system: LinearSystem<'static, f64>, dof: usize, v: Vec<f64>| {
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), h)
            .velocity(v)
            .constraint(LinearRows::new().unilateral(&[(dof, 1.0)], 0.1))
            .build()
            .unwrap();
        let mut forces = Vec::new();
        while run.time() < 80.0 {
            run.step().unwrap();
            forces.push(run.state().contacts().forces()[0]);
        }
        (forces, run.state().displacement().to_vec())
    };
    let (exact, end) = run(LinearSystem::lumped(masses.clone(), k.clone()).unwrap(), 0, vec![-0.05; n + 1]);
    assert!(largest(&exact) > 0.04);
    for boundary in [Boundary::Untapered, Boundary::Tapered] {
        let reduction = Reduction::new(m.as_ref(), k.as_ref(), &[0]).boundary(boundary).softening(2.0);
        let body = reduction.modes(n).unwrap();
        let velocity = body.velocity(&vec![-0.05; n + 1]).unwrap();
        let (forces, reduced) = run(body.system().unwrap(), body.contact_dofs().start, velocity);
        // (Of all modes there is nothing left to taper toward: F is R three times over if tapered.)
        if boundary == Boundary::Untapered {
            assert_close(&forces, &exact, 1e-7);
            assert_close(&body.recover_displacement(&reduced).unwrap(), &end, 1e-7);
        } else {
            assert!((body.accuracy().compliance / body.accuracy().residual.unwrap() - 2.0).abs() < 1e-12);
        }
    }
}

/// All modes with the contact dofs held, and these: another basis of the same space.
#[test]
fn all_modes_of_craig_and_bampton_are_the_body() {
    let plate = Plate::new();
    let n = plate.stiffness.nrows();
    let count = n - plate.fixed.len() - plate.contact.len();
    let body = plate.reduction(Boundary::CraigBampton).modes(count).unwrap();
    let mut v = vec![0.0; n];
    for (dof, v) in v.iter_mut().enumerate().filter(|(dof, _)| !plate.fixed.contains(dof)) {
        *v = (dof as f64).cos();
    }
    let projected = body.velocity(&v).unwrap();
    assert_close(&body.recover_velocity(&projected).unwrap(), &v, 1e-8);
    let mut full = LinearSystem::new(plate.mass.clone(), plate.stiffness.clone()).unwrap();
    for &dof in &plate.fixed {
        full = full.fix(dof).unwrap();
    }
    let end = |system: LinearSystem<'static, f64>, v: Vec<f64>| {
        let scheme = Bathe::with_radius(1.0).unwrap();
        let mut run = Simulation::builder(system, scheme, 0.02).velocity(v).build().unwrap();
        run.run_until(1.0, &mut ()).unwrap();
        run.state().displacement().to_vec()
    };
    let reduced = end(body.system().unwrap(), projected);
    assert_close(&body.recover_displacement(&reduced).unwrap(), &end(full, v), 1e-8);
}
