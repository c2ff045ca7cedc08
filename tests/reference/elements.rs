//! The elements and materials that scenes are made of, and the hand-written step that benches compare with.

use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{
    Error, LinearRows, Newmark, Path, PersistencyCorrection, Simulation, System, TangentWeights, verify,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::particles::Particles;
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::yardsticks::{NewmarkByHand, compressed_rows, entries_of_factor};

/// Displacements or velocities without any symmetry, of size `size`.
fn scattered(count: usize, size: f64, phase: f64) -> Vec<f64> {
    (0..count).map(|k| size * (1.7 * k as f64 * k as f64 + phase).sin()).collect()
}

/// A turn of the plane of the first two axes, then of the last two.
fn turned<const D: usize>(mut x: [f64; D], angles: [f64; 2]) -> [f64; D] {
    for (first, angle) in angles.into_iter().enumerate().take(D - 1) {
        let (s, c) = angle.sin_cos();
        (x[first], x[first + 1]) = (c * x[first] - s * x[first + 1], s * x[first] + c * x[first + 1]);
    }
    x
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

fn force_at(system: &mut dyn System<f64>, u: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; u.len()];
    system.force(0.0, u, &vec![0.0; u.len()], &mut out).unwrap();
    out
}

fn stiffness_at(system: &mut dyn System<f64>, u: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; system.pattern().row_idx().len()];
    let weights = TangentWeights::new(1.0, 0.0);
    system.tangent(0.0, u, &vec![0.0; u.len()], weights, &mut out).unwrap();
    out
}

fn middle(from: &[f64], to: &[f64]) -> Vec<f64> {
    from.iter().zip(to).map(|(a, b)| 0.5 * (a + b)).collect()
}

fn force_along(system: &mut dyn System<f64>, from: &[f64], to: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; from.len()];
    let mean = middle(from, to);
    let own = system.path_force().unwrap();
    own.force_along(0.0, Path::new(from, to, &mean), &vec![0.0; from.len()], &mut out).unwrap();
    out
}

/// The tangent along a path is that of a state if both ends are this state, and the part of the difference
/// quotients that it neglects vanishes with the length of the path.
fn check_tangent_along(system: &mut dyn System<f64>, from: &[f64], direction: &[f64]) {
    let n = from.len();
    let mut neglected = |length: f64| {
        let to: Vec<f64> = from.iter().zip(direction).map(|(u, d)| u + length * d).collect();
        let mut values = vec![f64::NAN; system.pattern().row_idx().len()];
        let weights = TangentWeights::new(1.0, 0.0);
        let mean = middle(from, &to);
        let path = Path::new(from, &to, &mean);
        system.path_force().unwrap().tangent_along(0.0, path, &vec![0.0; n], weights, &mut values).unwrap();
        assert!(asymmetry(system.pattern(), &values) <= 1e-15 * largest(&values));
        let (mut worst, step) = (0.0_f64, 1e-5);
        for column in 0..n {
            let mut displaced = [to.clone(), to.clone()];
            displaced[0][column] -= step;
            displaced[1][column] += step;
            let [before, after] = displaced.map(|to| force_along(system, from, &to));
            let rows = system.pattern().row_idx_of_col_raw(column).to_vec();
            let start = system.pattern().col_ptr()[column];
            for (row, value) in rows.into_iter().zip(&values[start..]) {
                worst = worst.max((value - (before[row] - after[row]) / step).abs());
            }
        }
        worst / largest(&values)
    };
    let [still, short, long] = [0.0, 0.01, 0.02].map(&mut neglected);
    assert!(still < 1e-7, "{still:e}");
    assert!((long / short - 2.0).abs() < 0.1 && long > 1e-5, "{short:e} {long:e}");
}

fn asymmetry(pattern: SymbolicSparseColMatRef<'_, usize>, values: &[f64]) -> f64 {
    let entry = |row: usize, column: usize| {
        let at = pattern.row_idx_of_col_raw(column).binary_search(&row).unwrap();
        values[pattern.col_ptr()[column] + at]
    };
    let columns = (0..pattern.ncols()).flat_map(|j| pattern.row_idx_of_col_raw(j).iter().map(move |&i| (i, j)));
    columns.fold(0.0, |m: f64, (i, j)| m.max((entry(i, j) - entry(j, i)).abs()))
}

/// f_int · (to − from) is the change of the potential; the force has no resultant, and no moment on the mean
/// configuration. Returns the largest of the three errors, relative.
fn check_force_along<const D: usize>(
    system: &mut dyn System<f64>,
    particles: &Particles<D>,
    from: &[f64],
    to: &[f64],
) -> f64 {
    let force = force_along(system, from, to);
    let work: f64 = force.iter().zip(from.iter().zip(to)).map(|(f, (a, b))| -f * (b - a)).sum();
    let [before, after] = [from, to].map(|u| system.potential_energy(u).unwrap());
    let energy = (work - (after - before)).abs() / before.max(after);
    energy.max(balance(particles, &middle(from, to), &force))
}

/// Resultant and moment of forces about the origin at u, relative to the sum of their sizes.
fn balance<const D: usize>(particles: &Particles<D>, u: &[f64], force: &[f64]) -> f64 {
    let size: f64 = force.iter().map(|f| f.abs()).sum();
    let reach = particles.nodes.iter().flatten().fold(1.0, |m: f64, x| m.max(x.abs()));
    let resultant = (0..D).map(|axis| force[axis..].iter().step_by(D).sum::<f64>().abs() / size);
    let moment = particles.moment(u, |dof| force[dof]).map(|m| m.abs() / (size * reach));
    resultant.chain(moment).fold(0.0, f64::max)
}

const RUBBER: Material = Material { young: 10.0, poisson: 0.35, density: 1.1 };
const LAWS: [Law; 2] = [Law::NeoHookean, Law::StVenantKirchhoff];

fn plate() -> Solid<2> {
    Solid::rectangle([2.0, 1.0], [3, 2], RUBBER).mapped(|[x, y]| [x + 0.15 * y * y, y - 0.1 * x * y])
}

fn block() -> Solid<3> {
    let bend = |[x, y, z]: [f64; 3]| [x + 0.1 * y * z, y - 0.1 * x * x, z + 0.12 * x * y];
    Solid::block([1.0, 1.2, 0.9], [2, 2, 1], RUBBER).mapped(bend)
}

/// Stretched, turned by a large angle and scattered.
fn deformed<const D: usize>(body: &Hyperelastic<D>, angles: [f64; 2], phase: f64) -> Vec<f64> {
    let scatter = scattered(body.particles.dofs(), 0.03, phase);
    let u = body.particles.displaced(|x| turned(std::array::from_fn(|i| x[i] * [1.3, 0.85, 1.1][i]), angles));
    u.iter().zip(&scatter).map(|(u, s)| u + s).collect()
}

fn check_tangent<const D: usize>(solid: &Solid<D>) {
    for law in LAWS {
        let mut body = Hyperelastic::new(solid, law).gravity([0.3; D]).fix(vec![0, 1, 4]);
        let u = deformed(&body, [0.9, -0.6], 0.2);
        let v = scattered(u.len(), 1.0, 0.1);
        let error = verify::tangent(&mut body, 0.0, &u, &v, 1e-5, 1e-5).unwrap();
        println!("{law:?} {D}: {:e}", error.largest());
        assert!(error.largest() < 1e-7 && error.potential.is_some(), "{law:?}: {error:?}");
        let k = stiffness_at(&mut body, &u);
        assert!(asymmetry(body.pattern(), &k) <= 1e-15 * largest(&k));
        assert_eq!(body.prescribed(), [0, 1, 4]);
    }
}

#[test]
fn tangents_are_derivatives() {
    check_tangent(&plate());
    check_tangent(&block());
}

fn check_small_strains<const D: usize>(solid: &Solid<D>) {
    let linear = solid.stiffness::<f64>();
    for law in LAWS {
        let mut body = Hyperelastic::new(solid, law);
        let k = stiffness_at(&mut body, &vec![0.0; solid.dofs()]);
        assert_eq!(body.pattern().row_idx(), linear.row_idx());
        let difference = k.iter().zip(linear.val()).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        assert!(difference < 1e-14 * largest(&k), "{law:?} {difference:e}");
    }
}

#[test]
fn small_strains_are_linear() {
    check_small_strains(&plate());
    check_small_strains(&block());
}

fn check_rotation<const D: usize>(solid: &Solid<D>) {
    for law in LAWS {
        let mut body = Hyperelastic::new(solid, law);
        let u = body.particles.displaced(|x| turned(x, [2.0, -1.2]).map(|x| x + 3.0));
        let (force, stiffness) = (force_at(&mut body, &u), stiffness_at(&mut body, &u));
        let energy = body.potential_energy(&u).unwrap();
        assert!(largest(&force) < 1e-14 * largest(&stiffness), "{law:?} {:e}", largest(&force));
        assert!(energy.abs() < 1e-14 * RUBBER.young, "{law:?} {energy:e}");
        // In equilibrium at any deformation.
        let u = deformed(&body, [0.9, -0.6], 0.2);
        let force = force_at(&mut body, &u);
        let unbalanced = balance(&body.particles, &u, &force);
        assert!(unbalanced < 1e-14, "{unbalanced:e}");
    }
}

#[test]
fn rotations_give_no_force() {
    check_rotation(&plate());
    check_rotation(&block());
}

fn check_energy<const D: usize>(solid: &Solid<D>) {
    let [lambda, mu] = RUBBER.lame();
    let volume = solid.lumped_mass::<f64>().iter().step_by(D).sum::<f64>() / RUBBER.density;
    let stretches = &[1.4, 0.8, 1.2][..D];
    for law in LAWS {
        let mut body = Hyperelastic::new(solid, law);
        let u = body.particles.displaced(|x| turned(std::array::from_fn(|i| x[i] * stretches[i]), [1.0, 0.4]));
        // Closed forms in three principal stretches, the third one 1 in plane strain.
        let squares: f64 = stretches.iter().map(|l| l * l - 1.0).sum();
        let logarithm = stretches.iter().product::<f64>().ln();
        let density = match law {
            Law::NeoHookean => 0.5 * mu * (squares - 2.0 * logarithm) + 0.5 * lambda * logarithm * logarithm,
            Law::StVenantKirchhoff => {
                let fourth: f64 = stretches.iter().map(|l| (l * l - 1.0).powi(2)).sum();
                lambda / 8.0 * squares * squares + mu / 4.0 * fourth
            }
        };
        let energy = body.potential_energy(&u).unwrap();
        assert!((energy / (density * volume) - 1.0).abs() < 1e-13, "{law:?}");
    }
}

#[test]
fn homogeneous_energies_are_closed_forms() {
    check_energy(&plate());
    check_energy(&block());
}

fn check_path<const D: usize>(solid: &Solid<D>) {
    let mut body = Hyperelastic::new(solid, Law::StVenantKirchhoff);
    let [from, to] = [([0.9, -0.6], 0.2), ([1.6, 0.1], 1.3)].map(|(angles, phase)| deformed(&body, angles, phase));
    let particles = body.particles.clone();
    let error = check_force_along(&mut body, &particles, &from, &to);
    println!("along a path {D}: {error:e}");
    assert!(error < 1e-13, "{error:e}");
    let direction = scattered(from.len(), 1.0, 0.4);
    check_tangent_along(&mut body, &from, &direction);
}

#[test]
fn mean_stress_conserves_energy_and_momenta() {
    check_path(&plate());
    check_path(&block());
}

#[test]
fn elements_inside_out_are_inadmissible() {
    for law in LAWS {
        let mut body = Hyperelastic::new(&plate(), law);
        let u = body.particles.displaced(|[x, y]| [x, -0.5 * y]);
        let (v, mut out) = (vec![0.0; u.len()], vec![0.0; body.pattern().row_idx().len()]);
        let weights = TangentWeights::new(1.0, 0.0);
        let tangent = body.tangent(0.0, &u, &v, weights, &mut out);
        assert!(matches!(tangent, Err(Error::Inadmissible { callback: "tangent", .. })));
        let error = body.force(0.0, &u, &v, &mut out[..u.len()]).unwrap_err();
        assert!(error.is_recoverable() && matches!(error, Error::Inadmissible { callback: "force", .. }));
    }
}

const STEEL: Material = Material { young: 210.0, poisson: 0.3, density: 7.8 };

fn product(k: &SparseColMat<usize, f64>, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for (j, &xj) in x.iter().enumerate() {
        let k = k.as_ref();
        for (&i, &value) in k.row_idx_of_col_raw(j).iter().zip(k.val_of_col(j)) {
            y[i] += value * xj;
        }
    }
    y
}

#[test]
fn distorted_meshes_pass_the_patch_test() {
    let bend = |p: [f64; 3]| [p[0] + 0.1 * p[1] * p[2], p[1] + 0.07 * p[0] * p[0], p[2] - 0.05 * p[0] * p[1]];
    let block = Solid::block([1.0, 2.0, 1.5], [3, 4, 3], STEEL).mapped(bend);
    // A uniform strain gives no force on interior nodes, whatever the mesh.
    let strain = [[1e-3, 2e-4, -3e-4], [2e-4, -4e-4, 1e-4], [-3e-4, 1e-4, 5e-4]];
    let u: Vec<f64> =
        block.nodes.iter().flat_map(|p| strain.map(|e| e.iter().zip(p).map(|(e, x)| e * x).sum())).collect();
    let f = product(&block.stiffness(), &u);
    let surface = block.surface_nodes();
    let largest = f.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    for node in (0..block.nodes.len()).filter(|n| surface.binary_search(n).is_err()) {
        assert!((0..3).all(|axis| f[3 * node + axis].abs() < 1e-12 * largest));
    }
    // Work of the strain: ½ ε:σ V with the volume of the block.
    let volume = block.lumped_mass::<f64>().iter().step_by(3).sum::<f64>() / STEEL.density;
    let [lambda, mu] = STEEL.lame();
    let trace: f64 = (0..3).map(|i| strain[i][i]).sum();
    let square: f64 = strain.iter().flatten().map(|e| e * e).sum();
    let energy: f64 = 0.5 * u.iter().zip(&f).map(|(u, f)| u * f).sum::<f64>();
    assert!((energy / (volume * (0.5 * lambda * trace * trace + mu * square)) - 1.0).abs() < 1e-12);
}

#[test]
fn boundaries_are_closed_and_point_outward() {
    let ball = Solid::quarter_ball(1.0, [4, 4, 6], 0.1, STEEL);
    let volume = ball.lumped_mass::<f64>().iter().step_by(3).sum::<f64>() / STEEL.density;
    // Divergence theorem with the triangles of each side.
    let enclosed: f64 = ball
        .boundary()
        .iter()
        .flat_map(|s| [[s[0], s[1], s[2]], [s[0], s[2], s[3]]])
        .map(|t| {
            let [a, b, c] = t.map(|n| ball.nodes[n]);
            (a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0]))
                / 6.0
        })
        .sum();
    assert!((enclosed / volume - 1.0).abs() < 0.02, "{enclosed} {volume}");
    assert!((volume / (std::f64::consts::PI / 3.0) - 1.0).abs() < 0.1, "{volume}");
    let disc = Solid::ring([1.0, 2.0], [2, 40], STEEL);
    let twice: f64 = disc
        .boundary()
        .iter()
        .map(|s| {
            let [a, b] = [disc.nodes[s[0]], disc.nodes[s[1]]];
            a[0] * b[1] - a[1] * b[0]
        })
        .sum();
    assert!((twice / 2.0 / (3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
}

/// An arrow fills in completely if its tip comes first, and not at all if it comes last.
#[test]
fn entries_of_a_factor_are_counted_in_the_order_given() {
    let arms = (1..6).flat_map(|i| [(i, i, 2.0), (0, i, -1.0), (i, 0, -1.0)]);
    let arrow = contact_dynamics_scenes::sparse::matrix::<f64>(6, arms.chain([(0, 0, 9.0)]));
    assert_eq!(entries_of_factor(arrow.symbolic(), &[0, 1, 2, 3, 4, 5]), 21);
    assert_eq!(entries_of_factor(arrow.symbolic(), &[5, 4, 3, 2, 1, 0]), 11);
}

/// What is measured against must do the same.
#[test]
fn newmark_by_hand_is_the_step_of_the_crate() {
    let bars = Bars::paper(12);
    let (dofs, [left, right]) = (bars.dofs(), bars.contact_dofs());
    let h = 0.7 * bars.element_size(0) / 100.0;
    let mut by_hand = NewmarkByHand::<f64>::new(&bars, h);
    let mut run = Simulation::builder(
        bars.system().load(move |_, f| (f[0], f[dofs - 1]) = (1.0, -1.0)),
        Newmark::trapezoidal(),
        h,
    )
    .displacement(by_hand.u.clone())
    .velocity(by_hand.v.clone())
    .constraint(LinearRows::new().unilateral(&[(left, -1.0), (right, 1.0)], 0.0))
    .corrector(PersistencyCorrection::new())
    .build()
    .expect("the scene is well posed");
    for step in 0..200 {
        by_hand.step(|x, l, y| x - l * y);
        run.step().expect("a well-posed step");
        for (of, ours, hand) in [
            ("u", run.state().displacement(), &by_hand.u),
            ("v", run.state().velocity(), &by_hand.v),
            ("a", run.state().acceleration(), &by_hand.a),
        ] {
            let size = hand.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
            let difference = ours.iter().zip(hand).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
            assert!(difference <= 1e-9 * size, "{of} in step {step}: {difference} of {size}");
        }
        assert!(run.state().contacts().closed()[0], "step {step}");
    }
}

#[test]
fn products_by_compressed_rows_are_forces() {
    let bars = Bars::paper(9);
    let u: Vec<f64> = (0..bars.dofs()).map(|i| (0.4 * i as f64).sin()).collect();
    let [mut ours, mut rows] = [vec![0.0; u.len()], vec![0.0; u.len()]];
    bars.system::<f64>().force(0.0, &u, &u, &mut ours).expect("a linear system");
    compressed_rows(&bars.stiffness::<f64>())(&u, &mut rows);
    assert!(ours.iter().zip(&rows).all(|(x, y)| (x + y).abs() <= 1e-12 * x.abs().max(1.0)));
}
