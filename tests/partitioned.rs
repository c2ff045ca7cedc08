//! Bodies factorized on their own, and bodies in codes of their own that meet at a frame, against the monolithic form.

use contact_dynamics::contact_solver::{ContactFailure, Pivoting};
use contact_dynamics::faer::sparse::{SparseColMat, SparseColMatRef, Triplet};
use contact_dynamics::mass;
use contact_dynamics::partitioned::{Frame, Interface, Side};
use contact_dynamics::{
    Automatic, ByBody, Cholesky, Composite, Corrector, Error, Factorization, GeneralizedAlpha, LinearRows,
    LinearSolver, LinearSystem, Newmark, Newton, PersistencyCorrection, Simulation, System, TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::{Bars, MassKind};
use std::ops::Range;

type Matrix = SparseColMat<usize, f64>;

const H: f64 = 1e-3;

/// Two bodies, the dofs of one behind those of the other, with matching contact dofs along one axis.
struct Scene {
    stiffness: Matrix,
    mass: Matrix,
    lumped: Option<Vec<f64>>,
    /// Number of dofs of the first body.
    split: usize,
    /// Contact dofs of the first and the second body, and the gaps between them.
    pairs: Vec<[usize; 2]>,
    gaps: Vec<f64>,
    velocity: Vec<f64>,
}

fn diagonal(mass: &[f64]) -> Matrix {
    let entries: Vec<_> = mass.iter().enumerate().map(|(i, &m)| Triplet::new(i, i, m)).collect();
    Matrix::try_new_from_triplets(mass.len(), mass.len(), &entries).unwrap()
}

impl Scene {
    fn bars(bars: &Bars) -> Self {
        let lumped = (bars.mass == MassKind::Lumped).then(|| bars.lumped_mass());
        Self {
            stiffness: bars.stiffness(),
            mass: lumped.as_deref().map_or_else(|| bars.consistent_mass(), diagonal),
            lumped,
            split: bars.elements[0] + 1,
            pairs: vec![bars.contact_dofs()],
            gaps: vec![bars.gap],
            velocity: bars.velocities(),
        }
    }

    /// A block on another of the same material, of plane elements; the gap opens by the slope.
    fn blocks(phase: f64) -> (Self, Solid<2>) {
        let material = Material { young: 100.0, poisson: 0.3, density: 0.01 };
        let cells = [4, 6];
        let lower = Solid::rectangle([2.0, 3.0], cells, material);
        let count = lower.nodes.len();
        let solid = lower.with(Solid::rectangle([2.0, 2.0], cells, material).moved([0.0, 3.0]));
        let width = cells[0] + 1;
        let pairs = (0..width).map(|k| [2 * (count - width + k) + 1, 2 * (count + k) + 1]).collect();
        let gaps = (0..width).map(|k| (8.3 + phase + 1.7 * k as f64) * 0.1 * H).collect();
        let speed =
            |dof: usize| if dof.is_multiple_of(2) { 0.01 } else { [0.05, -0.05][usize::from(dof >= 2 * count)] };
        let (stiffness, lumped) = (solid.stiffness(), solid.lumped_mass::<f64>());
        let velocity = (0..solid.dofs()).map(speed).collect();
        let mass = diagonal(&lumped);
        (Self { stiffness, mass, lumped: Some(lumped), split: 2 * count, pairs, gaps, velocity }, solid)
    }

    fn system(&self) -> LinearSystem<'static, f64> {
        match &self.lumped {
            Some(mass) => LinearSystem::lumped(mass.clone(), self.stiffness.clone()),
            None => LinearSystem::new(self.mass.clone(), self.stiffness.clone()),
        }
        .unwrap()
    }

    fn rows(&self) -> LinearRows<'static, f64> {
        self.pairs.iter().zip(&self.gaps).fold(LinearRows::new(), |rows, (&[first, second], &gap)| {
            rows.unilateral(&[(first, -1.0), (second, 1.0)], gap)
        })
    }

    fn simulation(
        &self,
        scheme: impl TimeIntegrator + 'static,
        corrected: bool,
        solver: impl LinearSolver<f64> + 'static,
    ) -> Simulation<'static, f64> {
        simulation(self.system(), self, scheme, corrected, solver)
    }
}

fn simulation<S: System<f64> + 'static>(
    system: S,
    scene: &Scene,
    scheme: impl TimeIntegrator + 'static,
    corrected: bool,
    solver: impl LinearSolver<f64> + 'static,
) -> Simulation<'static, f64> {
    let corrector: Option<Box<dyn Corrector<f64>>> =
        if corrected { Some(Box::new(PersistencyCorrection::new())) } else { None };
    Simulation::builder(system, scheme, H)
        .velocity(scene.velocity.clone())
        .constraint(scene.rows())
        .correctors(corrector)
        .newton(Newton::full().tolerances(1e-12, 1e-12).unwrap())
        .linear_solver(solver)
        .build()
        .unwrap()
}

/// The largest values seen, and the largest differences: of u, v, a and the forces.
#[derive(Debug, Default)]
struct Comparison {
    largest: [f64; 4],
    difference: [f64; 4],
}

impl Comparison {
    fn add(&mut self, found: [&[f64]; 4], expected: [&[f64]; 4]) {
        for i in 0..4 {
            assert_eq!(found[i].len(), expected[i].len());
            for (x, y) in found[i].iter().zip(expected[i]) {
                self.largest[i] = self.largest[i].max(y.abs());
                self.difference[i] = self.difference[i].max((x - y).abs());
            }
        }
    }

    fn worst(&self) -> f64 {
        (0..4).map(|i| self.difference[i] / self.largest[i]).fold(0.0, f64::max)
    }
}

fn motion<'a>(run: &'a Simulation<'_, f64>) -> [&'a [f64]; 4] {
    let state = run.state();
    [state.displacement(), state.stored_velocity(), state.stored_acceleration(), state.contacts().forces()]
}

#[test]
fn bodies_factorized_alone_move_as_in_one_factor() {
    let mut cases: Vec<(String, Scene, Option<Solid<2>>)> = Vec::new();
    for mass in [MassKind::Lumped, MassKind::Consistent] {
        cases.push((format!("bars, {mass:?}"), Scene::bars(&Bars::paper(20).delayed(0.35, H).with_mass(mass)), None));
    }
    let (scene, solid) = Scene::blocks(0.4);
    cases.push(("blocks".into(), scene, None));
    cases.push(("hyperelastic blocks".into(), Scene::blocks(0.4).0, Some(solid)));
    for (name, scene, solid) in &cases {
        for corrected in [false, true] {
            for composite in [true, false] {
                let scheme = || -> Box<dyn TimeIntegrator> {
                    if composite {
                        Box::new(Composite)
                    } else {
                        Box::new(GeneralizedAlpha::chung_hulbert(0.9).unwrap())
                    }
                };
                let run = |solver: Box<dyn LinearSolver<f64>>| match solid {
                    Some(solid) => {
                        simulation(Hyperelastic::new(solid, Law::NeoHookean), scene, scheme(), corrected, solver)
                    }
                    None => scene.simulation(scheme(), corrected, solver),
                };
                let mut one = run(Box::new(Automatic));
                let mut apart = run(Box::new(ByBody::new(Automatic).body(0..scene.split, Cholesky::default())));
                let mut comparison = Comparison::default();
                for _ in 0..400 {
                    one.step().unwrap();
                    apart.step().unwrap();
                    comparison.add(motion(&apart), motion(&one));
                }
                assert!(one.statistics().contact_changes >= 2, "{name}: no impact");
                assert!(comparison.worst() < 1e-10, "{name}, corrected {corrected}: {comparison:?}");
            }
        }
    }
}

/// A body in a code of its own: Newmark's rows, its own factors of M + ¼ h² K and M, and its side of the frame.
struct Body {
    stiffness: Matrix,
    factor: Box<dyn Factorization<f64>>,
    mass: Box<dyn Factorization<f64>>,
    /// Its contact dofs, and the sign of a compressive force on them.
    contact: Vec<usize>,
    sign: f64,
    /// What unit forces do to displacements, and to velocities and accelerations, at the interface.
    flexibility: Vec<f64>,
    inertia: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
}

fn product(a: SparseColMatRef<'_, usize, f64>, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for (j, &xj) in x.iter().enumerate() {
        for (&i, &value) in a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)) {
            y[i] += value * xj;
        }
    }
    y
}

/// The sum of the rows and columns of a body, with weights.
fn block(range: &Range<usize>, sum: &[(f64, &Matrix)]) -> Matrix {
    let mut entries = Vec::new();
    for (weight, matrix) in sum {
        for j in range.clone() {
            let matrix = matrix.as_ref();
            for (&i, &x) in matrix.row_idx_of_col_raw(j).iter().zip(matrix.val_of_col(j)) {
                entries.push(Triplet::new(i - range.start, j - range.start, weight * x));
            }
        }
    }
    Matrix::try_new_from_triplets(range.len(), range.len(), &entries).unwrap()
}

fn factorized(matrix: &Matrix) -> Box<dyn Factorization<f64>> {
    let mut factor = LinearSolver::<f64>::analyze(&Automatic, matrix.symbolic(), &[]).unwrap();
    factor.factorize(matrix.as_ref()).unwrap();
    factor
}

/// The block of `scale` A⁻¹ on some dofs.
fn on_interface(factor: &mut dyn Factorization<f64>, n: usize, dofs: &[usize], scale: f64) -> Vec<f64> {
    let column = |&dof: &usize| {
        let mut x = vec![0.0; n];
        x[dof] = scale;
        factor.solve(&mut x).unwrap();
        dofs.iter().map(|&dof| x[dof]).collect::<Vec<_>>()
    };
    dofs.iter().flat_map(column).collect()
}

impl Body {
    fn new(scene: &Scene, number: usize) -> Self {
        let n = scene.velocity.len();
        let range = [0..scene.split, scene.split..n][number].clone();
        let quarter = 0.25 * H * H;
        let mut factor = factorized(&block(&range, &[(1.0, &scene.mass), (quarter, &scene.stiffness)]));
        let mut mass = factorized(&block(&range, &[(1.0, &scene.mass)]));
        let contact: Vec<usize> = scene.pairs.iter().map(|pair| pair[number] - range.start).collect();
        Self {
            stiffness: block(&range, &[(1.0, &scene.stiffness)]),
            flexibility: on_interface(&mut *factor, range.len(), &contact, quarter),
            inertia: on_interface(&mut *mass, range.len(), &contact, 1.0),
            factor,
            mass,
            contact,
            sign: [-1.0, 1.0][number],
            u: vec![0.0; range.len()],
            v: scene.velocity[range.clone()].to_vec(),
            a: vec![0.0; range.len()],
        }
    }

    fn at_interface(&self, x: &[f64]) -> Vec<f64> {
        self.contact.iter().map(|&dof| x[dof]).collect()
    }

    /// A step without contact.
    fn advance(&mut self) {
        for i in 0..self.u.len() {
            self.u[i] += H * self.v[i] + 0.25 * H * H * self.a[i];
            self.v[i] += 0.5 * H * self.a[i];
        }
        self.a = product(self.stiffness.as_ref(), &self.u);
        self.a.iter_mut().for_each(|f| *f = -*f);
        self.factor.solve(&mut self.a).unwrap();
        let Self { u, v, a, .. } = self;
        for i in 0..u.len() {
            u[i] += 0.25 * H * H * a[i];
            v[i] += 0.5 * H * a[i];
        }
    }

    fn forces(&self, l: &[f64]) -> Vec<f64> {
        let mut f = vec![0.0; self.u.len()];
        self.contact.iter().zip(l).for_each(|(&dof, l)| f[dof] = self.sign * l);
        f
    }

    /// Adds the response to the forces of the frame.
    fn push(&mut self, l: &[f64]) {
        let mut a = self.forces(l);
        self.factor.solve(&mut a).unwrap();
        for (i, a) in a.into_iter().enumerate() {
            self.u[i] += 0.25 * H * H * a;
            self.v[i] += 0.5 * H * a;
            self.a[i] += a;
        }
    }

    fn jump(&mut self, l: &[f64]) -> Vec<f64> {
        let mut x = self.forces(l);
        self.mass.solve(&mut x).unwrap();
        x
    }
}

/// Both codes and the frames between them: one for displacements, one for rates.
struct Host {
    bodies: [Body; 2],
    frames: [Frame<f64>; 2],
    gaps: Vec<f64>,
    force: Vec<f64>,
    pressed: usize,
}

impl Host {
    fn new(scene: &Scene) -> Self {
        let nodes = scene.pairs.len();
        Self {
            bodies: [0, 1].map(|number| Body::new(scene, number)),
            frames: [0, 1].map(|_| Frame::new(nodes).unwrap()),
            gaps: scene.gaps.clone(),
            force: vec![0.0; nodes],
            pressed: 0,
        }
    }

    fn step(&mut self, corrected: bool) {
        let Self { bodies, frames: [frame, rates], gaps, force, pressed } = self;
        bodies.iter_mut().for_each(Body::advance);
        let free = [0, 1].map(|s| bodies[s].at_interface(&bodies[s].u));
        let sides = [0, 1].map(|s| Side::new(&free[s], &bodies[s].flexibility));
        let interface = frame.solve(sides, gaps).unwrap().clone();
        // Both sides are where the frame says.
        for body in &mut *bodies {
            body.push(interface.forces());
        }
        for (body, values) in bodies.iter().zip(interface.values()) {
            let there = body.at_interface(&body.u);
            assert!(there.iter().zip(values).all(|(x, y)| (x - y).abs() < 1e-15));
        }
        force.copy_from_slice(interface.forces());
        *pressed += force.iter().filter(|force| **force > 0.0).count();
        if !corrected {
            return;
        }
        let rate =
            |bodies: &[Body; 2], x: fn(&Body) -> &Vec<f64>| [0, 1].map(|s| bodies[s].at_interface(x(&bodies[s])));
        let still = vec![0.0; gaps.len()];
        // Pressed, or touching and approaching.
        let engaged = |closed: &[bool], free: &[Vec<f64>; 2]| -> Vec<bool> {
            let raw = interface.forces();
            (0..raw.len()).map(|i| closed[i] && (raw[i] > 0.0 || free[1][i] < free[0][i])).collect()
        };
        let v = rate(bodies, |body| &body.v);
        let held = engaged(interface.closed(), &v);
        let sides = [0, 1].map(|s| Side::new(&v[s], &bodies[s].inertia));
        let impulses = rates.hold(sides, &still, &held).unwrap().forces().to_vec();
        for body in &mut *bodies {
            let jump = body.jump(&impulses);
            body.v.iter_mut().zip(jump).for_each(|(v, x)| *v += x);
        }
        let a = rate(bodies, |body| &body.a);
        let held = engaged(&held, &a);
        let sides = [0, 1].map(|s| Side::new(&a[s], &bodies[s].inertia));
        let forces = rates.hold(sides, &still, &held).unwrap().forces().to_vec();
        for body in &mut *bodies {
            let jump = body.jump(&forces);
            body.a.iter_mut().zip(jump).for_each(|(a, x)| *a += x);
        }
        force.iter_mut().zip(forces).for_each(|(force, l)| *force += l);
    }

    fn go_to(&mut self, [u, v, a, _]: [&[f64]; 4]) {
        let mut first = 0;
        for body in &mut self.bodies {
            let range = first..first + body.u.len();
            first = range.end;
            for (own, all) in [(&mut body.u, u), (&mut body.v, v), (&mut body.a, a)] {
                own.copy_from_slice(&all[range.clone()]);
            }
        }
    }

    fn motion(&self) -> [Vec<f64>; 4] {
        let [first, second] = &self.bodies;
        let both = |x: fn(&Body) -> &Vec<f64>| [&x(first)[..], &x(second)[..]].concat();
        [both(|body| &body.u), both(|body| &body.v), both(|body| &body.a), self.force.clone()]
    }
}

/// Runs the bodies in their own codes beside the monolithic simulation.
fn compare(name: &str, scene: &Scene, corrected: bool, steps: usize) {
    let mut host = Host::new(scene);
    let mut run = scene.simulation(Newmark::trapezoidal(), corrected, Automatic);
    let mut comparison = Comparison::default();
    for _ in 0..steps {
        host.step(corrected);
        run.step().unwrap();
        let found = host.motion();
        comparison.add([&found[0], &found[1], &found[2], &found[3]], motion(&run));
        if !corrected {
            // Contact opens and closes all the time, and each time differences of rounding grow threefold and more:
            // every step begins where the other did.
            host.go_to(motion(&run));
        }
    }
    let released = run.state().contacts().forces().iter().all(|force| *force == 0.0);
    let pressed = host.pressed > if corrected { 100 } else { 10 };
    assert!(pressed && released, "{name}, corrected {corrected}: pressed {}, released {released}", host.pressed);
    assert!(comparison.worst() < 1e-10, "{name}, corrected {corrected}: {comparison:?}");
}

#[test]
fn bars_in_their_own_codes_collide_as_in_one() {
    for phase in [0.05, 0.35, 0.6, 0.95] {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            let bars = Scene::bars(&Bars::paper(20).delayed(phase, H).with_mass(mass));
            compare(&format!("equal bars, phase {phase}, {mass:?}"), &bars, true, 400);
            compare(&format!("equal bars, phase {phase}, {mass:?}"), &bars, false, 400);
            let bars = Bars { elements: [20, 13], ..Bars::dissimilar(20) }.delayed(phase, H).with_mass(mass);
            compare(&format!("dissimilar bars, phase {phase}, {mass:?}"), &Scene::bars(&bars), true, 550);
        }
    }
}

#[test]
fn blocks_in_their_own_codes_collide_as_in_one() {
    for phase in [0.1, 0.5, 0.8] {
        let blocks = Scene::blocks(phase).0;
        compare(&format!("blocks, phase {phase}"), &blocks, true, 400);
        compare(&format!("blocks, phase {phase}"), &blocks, false, 400);
    }
}

/// A random flexibility of full rank, or of one dimension less.
fn flexibility(random: &mut impl FnMut() -> f64, n: usize, rank: usize) -> Vec<f64> {
    let b: Vec<f64> = (0..n * rank).map(|_| random() - 0.3).collect();
    (0..n * n).map(|k| (0..rank).map(|r| b[k % n + r * n] * b[k / n + r * n]).sum()).collect()
}

/// The equations of the frame, and what it says of both sides.
fn check(interface: &Interface<f64>, sides: [Side<'_, f64>; 2], gaps: &[f64], sign: bool) {
    let (n, l) = (gaps.len(), interface.forces());
    for i in 0..n {
        let d = [(0, -1.0), (1, 1.0)].map(|(side, sign)| {
            let Side { free, flexibility, .. } = sides[side];
            free[i] + sign * (0..n).map(|j| flexibility[i + j * n] * l[j]).sum::<f64>()
        });
        let (x, tiny) = (interface.positions()[i], 1e-12);
        assert!((interface.values()[0][i] - d[0]).abs() < tiny && (interface.values()[1][i] - d[1]).abs() < tiny);
        let open = [x - d[0], d[1] + gaps[i] - x];
        assert!((open[0] - open[1]).abs() < tiny, "halfway: {open:?}");
        assert!((interface.gaps()[i] - 2.0 * open[0]).abs() < tiny);
        if sign {
            assert!(l[i] >= 0.0 && open[0] > -tiny && (l[i] == 0.0 || open[0] < tiny), "node {i}: {} {open:?}", l[i]);
            assert_eq!(interface.closed()[i], l[i] > 0.0);
        } else if interface.closed()[i] {
            assert!(open[0].abs() < tiny, "node {i}: {open:?}");
        } else {
            assert!(l[i] == 0.0);
        }
    }
}

#[test]
fn frames_meet_the_equations_of_localized_multipliers() {
    let mut random = xorshift(41);
    let n = 7;
    let (mut frame, mut reference) = (Frame::new(n).unwrap(), Frame::with_solver(n, Pivoting::default()).unwrap());
    let (mut pressed, mut held_open) = (0, 0);
    for case in 0..200 {
        // A rigid obstacle on one side now and then, rank-deficient sides that make up for each other.
        let f = [0, 1].map(|side| match case % 4 {
            0 if side == 1 => vec![0.0; n * n],
            1 => flexibility(&mut random, n, n - 2),
            _ => flexibility(&mut random, n, n),
        });
        let free = [0, 1].map(|_| (0..n).map(|_| random() - 0.5).collect::<Vec<_>>());
        let gaps: Vec<f64> = (0..n).map(|_| random() - 0.3).collect();
        let sides = [0, 1].map(|s| Side::new(&free[s], &f[s]));
        let found = frame.solve(sides, &gaps).unwrap().clone();
        check(&found, sides, &gaps, true);
        pressed += found.closed().iter().filter(|closed| **closed).count();
        let other = reference.solve(sides, &gaps).unwrap();
        assert!(found.forces().iter().zip(other.forces()).all(|(x, y)| (x - y).abs() < 1e-8 * (1.0 + y)));
        let held: Vec<bool> = (0..n).map(|_| random() < 0.5).collect();
        let found = frame.hold(sides, &gaps, &held).unwrap();
        check(found, sides, &gaps, false);
        assert_eq!(found.closed(), held);
        held_open += found.forces().iter().filter(|force| **force < 0.0).count();
        // In other units of length and force nothing but the units changes.
        let (length, force) = (1e4, 1e-7);
        let scaled = |x: &[f64], by: f64| x.iter().map(|x| x * by).collect::<Vec<_>>();
        let units = [0, 1].map(|s| (scaled(&free[s], length), scaled(&f[s], length / force)));
        let sides = [0, 1].map(|s| Side::new(&units[s].0, &units[s].1));
        let other = frame.solve(sides, &scaled(&gaps, length)).unwrap();
        let expected = reference.solve([0, 1].map(|s| Side::new(&free[s], &f[s])), &gaps).unwrap();
        assert_eq!(other.closed(), expected.closed());
        for (x, y) in other.forces().iter().zip(expected.forces()) {
            assert!((x / force - y).abs() < 1e-8 * (1.0 + y));
        }
    }
    assert!(pressed > 200 && pressed < 1200 && held_open > 100, "{pressed} pressed, {held_open} pulled");
}

#[test]
fn bodies_in_a_row_alternate() {
    // Masses 1, 2, 4 in a row: the outer ones are the first side, with the normal of the second contact toward the
    // middle.
    let (mass, v) = ([1.0, 2.0, 4.0], [3.0, 0.0, -1.0]);
    let (free, flexibility) = ([v[0], -v[2]], [1.0 / mass[0], 0.0, 0.0, 1.0 / mass[2]]);
    let first = Side::new(&free, &flexibility);
    // Seen along the second normal the middle mass moves the other way.
    let middle = [v[1], -v[1]];
    let second = Side::new(&middle, &[0.5, -0.5, -0.5, 0.5]);
    let mut frame = Frame::<f64>::new(2).unwrap();
    let found = frame.hold([first, second], &[0.0; 2], &[true; 2]).unwrap();
    let common = mass.iter().zip(v).map(|(m, v)| m * v).sum::<f64>() / 7.0;
    assert!((found.positions()[0] - common).abs() < 1e-15 && (found.positions()[1] + common).abs() < 1e-15);
    let impulses = [mass[0] * (v[0] - common), mass[2] * (common - v[2])];
    assert!(found.forces().iter().zip(impulses).all(|(x, y)| (x - y).abs() < 1e-14));
}

#[test]
fn frames_refuse_what_is_no_interface() {
    let mut frame = Frame::<f64>::new(2).unwrap();
    let good = Side::new(&[0.0, 0.0], &[2.0, 1.0, 1.0, 2.0]);
    let mut refused = |side: Side<'_, f64>, gaps: &[f64]| frame.solve([good, side], gaps).map(|_| ()).unwrap_err();
    let short = Side::new(&[0.0], good.flexibility);
    assert!(matches!(refused(short, &[0.0; 2]), Error::Dimension { expected: 2, found: 1, .. }));
    let short = Side::new(good.free, &[1.0]);
    assert!(matches!(refused(short, &[0.0; 2]), Error::Dimension { expected: 4, found: 1, .. }));
    assert!(matches!(refused(good, &[0.0; 3]), Error::Dimension { expected: 2, found: 3, .. }));
    assert!(matches!(refused(good, &[0.0, f64::NAN]), Error::NotFinite { index: 1, .. }));
    let open = Side::new(&[f64::INFINITY, 0.0], good.flexibility);
    assert!(matches!(refused(open, &[0.0; 2]), Error::NotFinite { index: 0, .. }));
    let one_sided = Side::new(good.free, &[2.0, 1.0, -1.0, 2.0]);
    assert!(matches!(refused(one_sided, &[0.0; 2]), Error::Asymmetric { matrix: "flexibility", .. }));
    let wrong_sign = Side::new(good.free, &[2.0, 0.0, 0.0, -1.0]);
    assert!(matches!(refused(wrong_sign, &[0.0; 2]), Error::Singular { dof: 1, .. }));
    // Between rigid sides nothing gives way.
    let rigid = Side::new(&[0.0, 0.0], &[0.0; 4]);
    let found = frame.solve([rigid; 2], &[0.1, -0.1]).map(|_| ()).unwrap_err();
    let failure = |failure: &ContactFailure<f64>| matches!(failure, ContactFailure::NotConverged { row: 1, .. });
    assert!(matches!(&found, Error::Frame { failure: found } if failure(found)), "{found:?}");
    assert!(found.is_recoverable() && found.to_string().contains("frame"));
    assert!(frame.hold([good; 2], &[0.0; 2], &[true]).is_err());
    // The frame can be used again.
    assert_eq!(frame.solve([good; 2], &[0.1; 2]).unwrap().closed(), [false; 2]);
    assert_eq!(frame.solve([good; 2], &[0.0; 2]).unwrap().closed(), [true; 2]);
}

/// The mass of a bar element, `share` of it consistent, the rest lumped, and r of the alternating motion.
fn blended(mass: f64, share: f64) -> ([f64; 4], f64) {
    let off = share * mass / 6.0;
    let diagonal = 0.5 * mass - off;
    ([diagonal, off, off, diagonal], 0.5 * mass / (diagonal - off))
}

/// Shares of the consistent mass: lumped, of fourth order, consistent.
const SHARES: [f64; 3] = [0.0, 0.375, 1.0];

/// A free bar of n elements of length 1/n, ρA = EA = 1: C of a share of consistent mass, and K.
fn free_bar(n: usize, share: f64) -> (Matrix, Matrix) {
    let nodes = || (0..n).map(|e| [e, e + 1]);
    let c = mass::reciprocal(nodes().map(|dofs| (dofs, blended(1.0 / n as f64, share).0)), n + 1).unwrap();
    let k = n as f64;
    let entries = nodes().flat_map(|[i, j]| [(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)]);
    let entries: Vec<_> = entries.map(|(i, j, x)| Triplet::new(i, j, x)).collect();
    let k = Matrix::try_new_from_triplets(n + 1, n + 1, &entries).unwrap();
    (c, k)
}

#[test]
fn reciprocal_masses_of_a_bar_have_the_frequencies_of_the_closed_form() {
    let n = 12;
    for share in SHARES {
        let r = blended(1.0, share).1;
        let (c, k) = free_bar(n, share);
        for mode in 0..=n {
            let theta = std::f64::consts::PI * mode as f64 / n as f64;
            let shape: Vec<f64> = (0..=n).map(|i| (theta * i as f64).cos()).collect();
            let square = 4.0 * (0.5 * theta).sin().powi(2) * (0.5 * (1.0 + r) + 0.5 * (1.0 - r) * theta.cos());
            let found = product(c.as_ref(), &product(k.as_ref(), &shape));
            let scale = (n * n) as f64;
            assert!(found.iter().zip(shape).all(|(x, s)| (x - scale * square * s).abs() < 1e-12 * scale), "{mode}");
        }
        // The error of the first frequency, by the Rayleigh quotient of its shape.
        let error = |n: usize| {
            let (c, k) = free_bar(n, share);
            let shape: Vec<f64> = (0..=n).map(|i| (std::f64::consts::PI * i as f64 / n as f64).cos()).collect();
            product(c.as_ref(), &product(k.as_ref(), &shape))[0].sqrt() / std::f64::consts::PI - 1.0
        };
        let (coarse, kh) = (error(20), std::f64::consts::PI / 20.0);
        let leading = 0.5 * (0.25 * r - 1.0 / 3.0) * kh * kh;
        assert!((coarse - leading).abs() < 0.2 * kh.powi(4), "{share}: {coarse:e} {leading:e}");
        let order = (coarse / error(40)).abs().log2();
        assert!((order - if (share - 0.375).abs() < 1e-9 { 4.0 } else { 2.0 }).abs() < 0.02, "{share}: order {order}");
    }
}

#[test]
fn fixed_ends_lose_their_rows_and_columns() {
    for share in SHARES {
        // The first frequency of the free part, by inverse iteration.
        let error = |n: usize| {
            let (c, k) = free_bar(n, share);
            let free = |a: &Matrix| {
                let a = a.as_ref();
                let entries = (1..=n).flat_map(|j| {
                    let column = a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j));
                    column.filter(|entry| *entry.0 > 0).map(move |(&i, &x)| Triplet::new(i - 1, j - 1, x))
                });
                factorized(&Matrix::try_new_from_triplets(n, n, &entries.collect::<Vec<_>>()).unwrap())
            };
            let (mut c, mut k) = (free(&c), free(&k));
            let (mut x, mut growth) = (vec![1.0; n], 0.0);
            for _ in 0..40 {
                c.solve(&mut x).unwrap();
                k.solve(&mut x).unwrap();
                growth = x[n - 1];
                for x in &mut x {
                    *x /= growth;
                }
            }
            (1.0 / f64::sqrt(growth)) / std::f64::consts::FRAC_PI_2 - 1.0
        };
        let (coarse, fine) = (error(20), error(40));
        let order = (coarse / fine).abs().log2();
        println!("share {share}: fixed at one end, error {coarse:.2e}, order {order:.2}");
        assert!(coarse.abs() < 0.01 && order > 1.9, "{share}: {coarse:e}, order {order}");
    }
}

/// The largest step of central differences, 2/ω, ω² the largest eigenvalue of the operator.
fn critical_step(n: usize, mut operator: impl FnMut(&[f64]) -> Vec<f64>) -> f64 {
    let mut random = xorshift(3);
    let mut x: Vec<f64> = (0..n).map(|_| random() - 0.5).collect();
    let mut square = 0.0;
    for _ in 0..20_000 {
        let y = operator(&x);
        square = y.iter().map(|y| y * y).sum::<f64>().sqrt();
        x = y.into_iter().map(|y| y / square).collect();
    }
    2.0 / f64::sqrt(square)
}

#[test]
fn critical_steps_of_reciprocal_masses() {
    let n = 20;
    let reciprocal = SHARES.map(|share| {
        let (c, k) = free_bar(n, share);
        n as f64 * critical_step(n + 1, |x| product(c.as_ref(), &product(k.as_ref(), x)))
    });
    let (_, k) = free_bar(n, 0.0);
    let entries = (0..n).flat_map(|e| {
        let [a, b, _, d] = blended(1.0 / n as f64, 1.0).0;
        [(e, e, a), (e + 1, e + 1, d), (e, e + 1, b), (e + 1, e, b)].map(|(i, j, m)| Triplet::new(i, j, m))
    });
    let mut consistent =
        factorized(&Matrix::try_new_from_triplets(n + 1, n + 1, &entries.collect::<Vec<_>>()).unwrap());
    let consistent = n as f64
        * critical_step(n + 1, |x| {
            let mut y = product(k.as_ref(), x);
            consistent.solve(&mut y).unwrap();
            y
        });
    println!("Courant numbers at the limit: reciprocal {reciprocal:?} for shares {SHARES:?}, consistent {consistent}");
    // Courant numbers c h/h_e at the limit.
    for (found, share) in reciprocal.into_iter().zip(SHARES) {
        assert!((found * blended(1.0, share).1.sqrt() - 1.0).abs() < 1e-6, "{share}: {found}");
    }
    assert!((consistent * 3.0_f64.sqrt() - 1.0).abs() < 1e-6, "{consistent}");
}

#[test]
fn reciprocal_masses_of_distorted_elements_are_exact_for_translation() {
    let material = Material { young: 1.0, poisson: 0.3, density: 7.0 };
    let plate = Solid::rectangle([3.0, 2.0], [6, 4], material);
    let plate = plate.mapped(|[x, y]| [x + 0.07 * (5.0 * y + x).sin(), y + 0.06 * (4.0 * x - y).cos()]);
    let n = plate.dofs();
    let element = |corners: &Vec<usize>| {
        let nodes = corners.iter().map(|&node| plate.nodes[node]).collect();
        let alone = Solid { nodes, elements: vec![(0..4).collect()], material };
        let m = alone.consistent_mass().to_dense();
        let dofs: Vec<usize> = corners.iter().flat_map(|node| [2 * node, 2 * node + 1]).collect();
        (dofs, (0..64).map(|k| m[(k / 8, k % 8)]).collect::<Vec<f64>>())
    };
    let elements: Vec<_> = plate.elements.iter().map(element).collect();
    let c = mass::reciprocal(elements.iter().map(|(dofs, m)| (dofs, m)), n).unwrap();
    let lumped = plate.lumped_mass::<f64>();
    for direction in [[1.0, 0.0], [0.0, 1.0], [0.6, -2.0]] {
        let v: Vec<f64> = plate.uniform(direction);
        let p: Vec<f64> = v.iter().zip(&lumped).map(|(v, m)| v * m).collect();
        assert!(product(c.as_ref(), &p).iter().zip(&v).all(|(x, y)| (x - y).abs() < 1e-13));
    }
    for j in 0..n {
        for (&i, &x) in c.as_ref().row_idx_of_col_raw(j).iter().zip(c.as_ref().val_of_col(j)) {
            assert_eq!(x.to_bits(), c[(j, i)].to_bits());
            assert_eq!(i % 2, j % 2, "directions do not couple");
        }
    }
    // Positive definite.
    let _ = factorized(&c);
    // Lumped elements give the lumped inverse.
    let lump = |m: &[f64]| {
        (0..64).map(|k| if k % 9 == 0 { m[k / 8 * 8..k / 8 * 8 + 8].iter().sum() } else { 0.0 }).collect::<Vec<f64>>()
    };
    let c = mass::reciprocal(elements.iter().map(|(dofs, m)| (dofs, lump(m))), n).unwrap();
    assert_eq!(c.val().len(), n);
    assert!(c.val().iter().zip(&lumped).all(|(c, m)| (c * m - 1.0).abs() < 1e-13));
}

#[test]
fn reciprocal_masses_refuse_what_they_cannot_invert() {
    let refused = |elements: &[(Vec<usize>, Vec<f64>)]| {
        let elements = elements.iter().map(|(dofs, m)| (dofs, m));
        mass::reciprocal(elements, 3).map(|_| ()).unwrap_err()
    };
    let good = (vec![0, 1], vec![2.0, 1.0, 1.0, 2.0]);
    let with = |dofs: &[usize], m: &[f64]| refused(&[good.clone(), (dofs.to_vec(), m.to_vec())]);
    assert!(matches!(refused(std::slice::from_ref(&good)), Error::Mass { dof: 2, .. }));
    assert!(matches!(with(&[1, 3], &[2.0, 1.0, 1.0, 2.0]), Error::MissingDof { dof: 3, dofs: 3, .. }));
    assert!(matches!(with(&[1, 2], &[2.0]), Error::Dimension { expected: 4, found: 1, .. }));
    assert!(matches!(with(&[1, 2], &[2.0, 1.0, 0.5, 2.0]), Error::Asymmetric { row: 2, column: 1, .. }));
    let not_finite = with(&[1, 2], &[2.0, f64::NAN, 1.0, 2.0]);
    assert!(matches!(not_finite, Error::MatrixNotFinite { row: 1, column: 2, .. }));
    assert!(matches!(with(&[1, 2], &[2.0, -2.0, -2.0, 2.0]), Error::Mass { dof: 1, .. }));
    for indefinite in [[1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 2.0, 1.0]] {
        assert!(matches!(with(&[1, 2], &indefinite), Error::Singular { matrix: "mass matrix of an element", .. }));
    }
}

/// Two bars with reciprocal masses in codes of their own: p ← p + h (f + Gᵀl), v = C p, u ← u + h v.
struct Explicit {
    c: Matrix,
    k: Matrix,
    u: Vec<f64>,
    p: Vec<f64>,
    /// The contact dof, and the sign of a compressive force on it.
    contact: (usize, f64),
}

#[test]
fn bars_with_reciprocal_masses_collide() {
    // Force RMS over the contact interval and largest energy, for each share at 0.9 of its critical step.
    for (share, bound) in SHARES.into_iter().zip([0.03, 0.15, 0.28]) {
        let bars = Bars::paper(50);
        let (n, size) = (bars.elements[0], bars.element_size(0));
        let (element, r) = blended(bars.density[0] * bars.area * size, share);
        let wave = (bars.young[0] / bars.density[0]).sqrt();
        let h = 0.9 * size / wave / r.sqrt();
        let mut lumped = vec![0.0; n + 1];
        (0..n).for_each(|e| [e, e + 1].iter().for_each(|&i| lumped[i] += element[0] + element[1]));
        let elements = || (0..n).map(|e| ([e, e + 1], element));
        let mut bodies = [0, 1].map(|number| {
            let c = mass::reciprocal(elements(), n + 1).unwrap();
            let k = block(&[0..n + 1, n + 1..2 * n + 2][number], &[(1.0, &bars.stiffness())]);
            let p = lumped.iter().map(|m| m * bars.velocity[number]).collect();
            Explicit { c, k, u: vec![0.0; n + 1], p, contact: [(n, -1.0), (0, 1.0)][number] }
        });
        let flexibility = bodies.each_ref().map(|body| h * h * body.c[(body.contact.0, body.contact.0)]);
        let mut frame = Frame::new(1).unwrap();
        let energy = |bodies: &[Explicit; 2], before: &[Vec<f64>; 2]| {
            let of = |(body, before): (&Explicit, &Vec<f64>)| {
                let p: Vec<f64> = body.p.iter().zip(before).map(|(p, q)| 0.5 * (p + q)).collect();
                let [v, f] = [product(body.c.as_ref(), &p), product(body.k.as_ref(), &body.u)];
                let pairs = p.iter().zip(v).chain(body.u.iter().zip(f));
                pairs.map(|(x, y)| 0.5 * x * y).sum::<f64>()
            };
            bodies.iter().zip(before).map(of).sum::<f64>()
        };
        let before = bodies.each_ref().map(|body| body.p.clone());
        let start = energy(&bodies, &before);
        let plateau = bars.density[0] * wave * bars.area * bars.velocity[0];
        let (mut square, mut count, mut most, mut impulse, mut last) = (0.0, 0, 0.0_f64, 0.0, start);
        let mut t = 0.0;
        while t < 0.4 {
            t += h;
            let before = bodies.each_ref().map(|body| body.p.clone());
            for Explicit { k, u, p, .. } in &mut bodies {
                let f = product(k.as_ref(), u);
                p.iter_mut().zip(f).for_each(|(p, f)| *p -= h * f);
            }
            let free = bodies.each_ref().map(|body| {
                let dof = body.contact.0;
                [body.u[dof] + h * product(body.c.as_ref(), &body.p)[dof]]
            });
            let sides = [0, 1].map(|s| Side::new(&free[s], &flexibility[s..=s]));
            let force = frame.solve(sides, &[bars.gap]).unwrap().forces()[0];
            for Explicit { p, contact: (dof, sign), .. } in &mut bodies {
                p[*dof] += h * *sign * force;
            }
            impulse += h * force;
            last = energy(&bodies, &before);
            most = most.max(last / start);
            for Explicit { c, u, p, .. } in &mut bodies {
                let v = product(c.as_ref(), p);
                u.iter_mut().zip(v).for_each(|(u, v)| *u += h * v);
            }
            if t > 0.1 + 2.0 * h && t < 0.3 {
                square += (force / plateau - 1.0).powi(2);
                count += 1;
            } else if t < 0.1 {
                assert!(force == 0.0);
            }
        }
        let rms = (square / f64::from(count)).sqrt();
        println!(
            "share {share}: h {h:.2e}, force RMS {rms:.3}, energy at most {most:.4}, at the end {:.4}",
            last / start
        );
        assert!(
            rms < bound && most < 1.0 + 1e-9 && last / start > 0.98,
            "share {share}: {rms} {most} {}",
            last / start
        );
        // Momentum of each body in the lumped masses: what the contact has given, and no more.
        for (Explicit { c, p, contact, .. }, v) in bodies.iter().zip(bars.velocity) {
            let v_now = product(c.as_ref(), p);
            let found: f64 = v_now.iter().zip(&lumped).map(|(v, m)| v * m).sum();
            let expected = v * lumped.iter().sum::<f64>() + contact.1 * impulse;
            assert!((found - expected).abs() < 1e-13 * impulse, "{found} {expected}");
        }
    }
}
