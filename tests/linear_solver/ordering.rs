//! Elimination orders: fill, solutions that do not depend on them, and orders that cannot be used.

use contact_dynamics::contact::Plane;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::linear_solver::Ordering;
use contact_dynamics::{
    Cholesky, Composite, Error, Factorization, LinearRows, LinearSolver, NodesOnObstacle, PersistencyCorrection,
    Simulation, System,
};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{entries, matrix, spring};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

type Matrix = SparseColMat<usize, f64>;

/// A diagonally dominant matrix with the given pairs off the diagonal.
fn tied(n: usize, pairs: impl IntoIterator<Item = (usize, usize)>) -> Matrix {
    let stiffness = |k: usize| 1.0 + (k * 37 % 11) as f64 / 4.0;
    let pairs = pairs.into_iter().filter(|(i, j)| i != j).enumerate();
    matrix(n, (0..n).map(|i| (i, i, 1.0)).chain(pairs.flat_map(|(k, (i, j))| spring(i, j, stiffness(k)))))
}

/// A positive definite matrix of a body: K plus the identity.
fn of_solid<const D: usize>(solid: &Solid<D>) -> Matrix {
    let n = solid.dofs();
    matrix(n, (0..n).map(|i| (i, i, 1.0)).chain(entries(&solid.stiffness())))
}

fn block(n: usize) -> Solid<3> {
    Solid::block([1.0; 3], [n; 3], MATERIAL)
}

/// The coordinates of all dofs.
fn places<const D: usize>(solid: &Solid<D>) -> Vec<[f64; 3]> {
    let place = |node: &[f64; D]| std::array::from_fn(|axis| if axis < D { node[axis] } else { 0.0 });
    solid.nodes.iter().flat_map(|node| [place(node); D]).collect()
}

/// The normal dofs of the face where the last coordinate is zero.
fn face<const D: usize>(solid: &Solid<D>) -> Vec<usize> {
    let nodes = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][D - 1] == 0.0);
    nodes.map(|node| Solid::<D>::dof(node, D - 1)).collect()
}

fn estimate(order: Ordering, a: &Matrix, last: &[usize]) -> usize {
    Cholesky::ordered(order).estimate(a.symbolic(), last).unwrap()
}

fn factor(order: Ordering, a: &Matrix, last: &[usize]) -> Box<dyn Factorization<f64>> {
    let mut factor = Cholesky::ordered(order).analyze(a.symbolic(), last).unwrap();
    factor.factorize(a.as_ref()).unwrap();
    factor
}

/// A random number below `bound`.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn below(random: &mut impl FnMut() -> f64, bound: usize) -> usize {
    (random() * bound as f64) as usize
}

fn strewn(n: usize, pairs: usize, seed: u64) -> Vec<(usize, usize)> {
    let mut random = xorshift(seed);
    (0..pairs).map(|_| (below(&mut random, n), below(&mut random, n))).collect()
}

fn shuffled(n: usize) -> Vec<usize> {
    let mut random = xorshift(7);
    let mut order: Vec<_> = (0..n).collect();
    for k in (1..n).rev() {
        order.swap(k, below(&mut random, k + 1));
    }
    order
}

fn distance(x: &[f64], y: &[f64]) -> f64 {
    let scale = y.iter().fold(0.0, |scale: f64, y| scale.max(y.abs()));
    x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / scale
}

#[test]
fn solids_have_the_fill_of_good_dissections() {
    // With METIS 5.2 the block of ten elements a side has 1.15 M scalars.
    let ten = of_solid(&block(10));
    let dissected = estimate(Ordering::NestedDissection, &ten, &[]);
    assert!(dissected < 1_150_000, "{dissected}");
    for (n, gain) in [(8, 1.1), (13, 1.25)] {
        let solid = block(n);
        let a = of_solid(&solid);
        for last in [vec![], face(&solid)] {
            let degree = estimate(Ordering::MinimumDegree, &a, &last) as f64;
            for order in [Ordering::NestedDissection, Ordering::Automatic, Ordering::Coordinates(places(&solid))] {
                let other = estimate(order.clone(), &a, &last) as f64;
                assert!(degree > gain * other, "{n}, {} last: {degree} and {other}", last.len());
            }
        }
    }
    // A graded, curved body: a graph is better than a box around it.
    let ball = Solid::quarter_ball(1.0, [8, 8, 12], 0.03, MATERIAL);
    let a = of_solid(&ball);
    let degree = estimate(Ordering::MinimumDegree, &a, &[]) as f64;
    assert!(degree > 1.25 * estimate(Ordering::NestedDissection, &a, &[]) as f64);
}

#[test]
fn plates_have_no_more_fill_dissected_than_by_minimum_degree() {
    let plate = Solid::rectangle([1.0; 2], [100; 2], MATERIAL);
    let a = of_solid(&plate);
    for last in [vec![], face(&plate)] {
        let degree = estimate(Ordering::MinimumDegree, &a, &last);
        for order in [Ordering::NestedDissection, Ordering::Coordinates(places(&plate))] {
            let other = estimate(order, &a, &last);
            assert!(other < degree + degree / 50, "{other} and {degree}");
        }
    }
}

#[test]
fn the_automatic_order_never_fills_more_than_minimum_degree() {
    let mut cases: Vec<Matrix> =
        vec![of_solid(&block(4)), of_solid(&block(9)), tied(400, (1..400).map(|i| (i - 1, i)))];
    // Random graphs have no small separators.
    cases.extend([300, 900, 4000].map(|pairs| tied(600, strewn(600, pairs, 11))));
    for a in cases {
        for last in [vec![], (0..40).collect::<Vec<_>>()] {
            let [automatic, degree] =
                [Ordering::Automatic, Ordering::MinimumDegree].map(|order| estimate(order, &a, &last));
            assert!(automatic <= degree, "{automatic} and {degree}");
        }
    }
}

#[test]
fn chains_and_stars_fill_as_little_as_they_can() {
    let n = 3000;
    let chain = tied(n, (1..n).map(|i| (i - 1, i)));
    let star = tied(n, (1..n).map(|i| (0, i)));
    for a in [&chain, &star] {
        assert_eq!(estimate(Ordering::Automatic, a, &[]), 2 * n - 1);
    }
    assert_eq!(estimate(Ordering::NestedDissection, &star, &[]), 2 * n - 1);
    // Separators of a chain are single dofs: one more entry in the columns of their neighbors.
    assert!(estimate(Ordering::NestedDissection, &chain, &[]) < 3 * n);
}

/// A strip of one row of elements, no string of dofs: minimum degree works from both ends, and would fill 1.6 times as
/// much where all dofs of an end may touch.
#[test]
fn contact_at_the_end_of_a_strip_costs_no_fill() {
    let strip = Solid::rectangle([200.0, 1.0], [200, 1], MATERIAL);
    let is_at_end = |dof: &usize| strip.nodes[dof / 2][0] > 199.5;
    let end: Vec<usize> = (0..strip.dofs()).filter(is_at_end).collect();
    let a = of_solid(&strip);
    assert_eq!(end.len(), 4);
    assert_eq!(estimate(Ordering::Automatic, &a, &end), estimate(Ordering::Automatic, &a, &[]));
}

#[test]
fn solutions_do_not_depend_on_the_order() {
    let solid = Solid::block([1.0, 2.0, 1.0], [3, 6, 3], MATERIAL);
    let plate = Solid::disc(1.0, 12, MATERIAL);
    let mut random = xorshift(3);
    let n = 300;
    let cases = [
        (of_solid(&solid), places(&solid), face(&solid)),
        (of_solid(&plate), places(&plate), face(&plate)),
        (tied(n, strewn(n, 500, 3)), (0..n).map(|_| [random(), random(), random()]).collect(), (10..50).collect()),
        (tied(40, (0..40).flat_map(|i| (0..i).map(move |j| (j, i)))), vec![[0.0; 3]; 40], vec![3, 17]),
        (tied(50, []), vec![[1.0, 2.0, 3.0]; 50], vec![0, 49]),
    ];
    for (a, places, face) in cases {
        let n = a.nrows();
        let rhs: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin()).collect();
        let mut expected = rhs.clone();
        factor(Ordering::Given((0..n).collect()), &a, &[]).solve(&mut expected).unwrap();
        for last in [vec![], face, (0..n).collect()] {
            for order in [
                Ordering::Automatic,
                Ordering::MinimumDegree,
                Ordering::NestedDissection,
                Ordering::Coordinates(places.clone()),
                Ordering::Given(shuffled(n)),
            ] {
                let mut factor = factor(order.clone(), &a, &last);
                assert_eq!(factor.stored_values(), estimate(order.clone(), &a, &last));
                let mut x = rhs.clone();
                factor.solve(&mut x).unwrap();
                assert!(distance(&x, &expected) < 1e-12, "{n} dofs, {} last", last.len());
                // In two halves: whatever the order, the interface has the last places.
                let condensed = factor.condensation().unwrap();
                let mut interface = vec![0.0; last.len()];
                condensed.condense(&rhs, &mut interface).unwrap();
                condensed.expand(&interface, &mut x).unwrap();
                assert!(distance(&x, &expected) < 1e-12, "{n} dofs, {} last", last.len());
                let kept = |(&dof, value): (&usize, &f64)| x[dof].to_bits() == value.to_bits();
                assert!(last.iter().zip(&interface).all(kept));
            }
        }
    }
}

#[test]
fn the_same_matrix_gets_the_same_order() {
    let a = of_solid(&block(7));
    let solution = || {
        let mut factor = factor(Ordering::NestedDissection, &a, &[5, 9]);
        let mut x = vec![1.0; a.nrows()];
        factor.solve(&mut x).unwrap();
        x
    };
    // Bit for bit: another order would round otherwise.
    assert_eq!(solution(), solution());
}

#[test]
fn runs_do_not_depend_on_the_order() {
    let solid = block(6);
    let run = |order: Ordering| {
        let mass = solid.lumped_mass::<f64>();
        let system = solid.system::<f64>().load(move |_, f| {
            for (f, m) in f.iter_mut().zip(&mass).skip(2).step_by(3) {
                *f = -1e-2 * m;
            }
        });
        let contact =
            face(&solid).into_iter().fold(LinearRows::new(), |rows, dof| rows.unilateral(&[(dof, 1.0)], 1e-3));
        let mut run = Simulation::builder(system, Composite, 0.1)
            .velocity(solid.uniform([0.0, 0.0, -0.01]))
            .constraint(contact)
            .corrector(PersistencyCorrection::new())
            .linear_solver(Cholesky::ordered(order))
            .build()
            .unwrap();
        for _ in 0..30 {
            run.step().unwrap();
        }
        assert!(run.state().contacts().closed().iter().any(|&closed| closed));
        (run.state().displacement().to_vec(), run.state().contacts().forces().to_vec())
    };
    let (u, forces) = run(Ordering::MinimumDegree);
    let orders = [
        Ordering::Automatic,
        Ordering::NestedDissection,
        Ordering::Coordinates(places(&solid)),
        Ordering::Given(shuffled(solid.dofs())),
    ];
    for order in orders {
        let (other_u, other_forces) = run(order);
        assert!(distance(&other_u, &u) < 1e-10 && distance(&other_forces, &forces) < 1e-10);
    }
}

#[test]
fn orders_that_do_not_fit_are_refused() {
    let a = tied(4, [(0, 1), (1, 2), (2, 3)]);
    let refusal = |order| Cholesky::ordered(order).estimate(a.symbolic(), &[2]).unwrap_err();
    assert!(matches!(refusal(Ordering::Given(vec![0, 1, 2])), Error::Dimension { expected: 4, found: 3, .. }));
    assert!(matches!(refusal(Ordering::Given(vec![0, 1, 2, 4])), Error::MissingDof { dof: 4, dofs: 4, .. }));
    assert!(matches!(refusal(Ordering::Given(vec![0, 1, 3, 1])), Error::RepeatedDof { dof: 1, .. }));
    assert!(matches!(
        refusal(Ordering::Coordinates(vec![[0.0; 3]; 5])),
        Error::Dimension { expected: 4, found: 5, .. }
    ));
    let mut places = vec![[0.0; 3]; 4];
    places[3][1] = f64::NAN;
    assert!(matches!(refusal(Ordering::Coordinates(places)), Error::NotFinite { index: 3, .. }));
    let refused: contact_dynamics::Result<Box<dyn Factorization<f64>>> =
        Cholesky::ordered(Ordering::Given(vec![3])).analyze(a.symbolic(), &[]);
    assert!(matches!(refused, Err(Error::Dimension { .. })));
}

#[test]
fn one_sided_patterns_are_refused_by_the_factorization() {
    let n = 900;
    let a = matrix::<f64>(n, (0..n).map(|i| (i, i, 4.0)).chain((1..n).map(|i| (i, i / 2, 1.0))));
    for order in [Ordering::Automatic, Ordering::NestedDissection, Ordering::Coordinates(vec![[0.0; 3]; n])] {
        let mut factor: Box<dyn Factorization<f64>> = Cholesky::ordered(order).analyze(a.symbolic(), &[]).unwrap();
        assert!(matches!(factor.factorize(a.as_ref()), Err(Error::Asymmetric { .. })));
    }
}

/// A run whose factor would be much larger with the interface last orders freely: all surface nodes of a solid may be
/// candidates, at the price of a factor for the few that touch.
#[test]
fn whole_surfaces_may_be_candidates() {
    let solid = block(9).lifted(1e-3);
    let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    let run = |nodes: &[usize], friction: f64| {
        let contact = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), nodes).unwrap().friction(friction);
        let mut run = Simulation::builder(solid.system(), Composite, 0.05)
            .velocity(solid.uniform([0.02, 0.0, -0.01]))
            .constraint(contact)
            .build()
            .unwrap();
        let mut largest = 0.0_f64;
        for _ in 0..60 {
            run.step().unwrap();
            largest = largest.max(run.state().contacts().forces().iter().sum());
        }
        (run, largest)
    };
    let system = solid.system::<f64>();
    let free = LinearSolver::<f64>::analyze(&Cholesky::default(), system.pattern(), &[]).unwrap().stored_values();
    let bottom: Vec<usize> = face(&solid.clone().lifted(0.0)).into_iter().map(|dof| dof / 3).collect();
    for friction in [0.0, 0.3] {
        let (few, force) = run(&bottom, friction);
        let (all, same) = run(&solid.surface_nodes(), friction);
        assert!(few.factor_size() < 2 * free && all.factor_size() <= 2 * free, "{free} {}", all.factor_size());
        // Only the lowest nodes touch, and which others might does not matter.
        assert!(force > 0.0 && (same / force - 1.0).abs() < 1e-9, "{force} {same}");
        let difference = distance(few.state().velocity(), all.state().velocity());
        assert!(difference < 1e-9, "{difference:e}");
    }
}

#[test]
fn an_order_that_was_kept_gives_the_same_factor() {
    let block = block(7);
    let plate = Solid::rectangle([1.0; 2], [12; 2], MATERIAL);
    let chain = tied(40, (1..40).map(|i| (i - 1, i)));
    let scenes = [(of_solid(&block), face(&block)), (of_solid(&plate), face(&plate)), (chain, vec![17])];
    for (a, face) in &scenes {
        for last in [&[], &face[..]] {
            let order = Cholesky::default().order(a.symbolic(), last).unwrap();
            assert_eq!(order.iter().copied().collect::<std::collections::BTreeSet<_>>().len(), a.nrows());
            assert!(order[a.nrows() - last.len()..].iter().all(|dof| last.contains(dof)));
            let solution = |order: Ordering| {
                let mut x: Vec<f64> = (0..a.nrows()).map(|i| (i as f64 * 0.7).sin()).collect();
                let mut factor = factor(order, a, last);
                factor.solve(&mut x).unwrap();
                (x, factor.stored_values())
            };
            assert_eq!(solution(Ordering::Given(order)), solution(Ordering::Automatic), "{} dofs", a.nrows());
        }
    }
}

/// Whatever stands on one side of the diagonal alone: refused where the matrix is factorized, by any order.
#[test]
fn patterns_that_are_not_symmetric_are_orders_all_the_same() {
    let n = 4;
    let places: Vec<(usize, usize)> = (0..n * n).map(|e| (e / n, e % n)).filter(|(i, j)| i != j).collect();
    for chosen in 0..1_usize << places.len() {
        let beside = places.iter().enumerate().filter(|(k, _)| chosen >> k & 1 == 1).map(|(_, &place)| place);
        let beside: Vec<(usize, usize)> = beside.collect();
        let is_symmetric = beside.iter().all(|&(i, j)| beside.contains(&(j, i)));
        let a: Matrix = matrix(n, (0..n).map(|i| (i, i, 8.0)).chain(beside.iter().map(|&(i, j)| (i, j, 1.0))));
        for ordering in [Ordering::Automatic, Ordering::MinimumDegree, Ordering::NestedDissection] {
            for last in [&[][..], &[1], &[0, 3]] {
                let mut factor = LinearSolver::<f64>::analyze(&Cholesky::ordered(ordering.clone()), a.symbolic(), last);
                let factorized = factor.as_mut().unwrap().factorize(a.as_ref());
                match is_symmetric {
                    true => factorized.unwrap(),
                    false => assert!(matches!(factorized, Err(Error::Asymmetric { .. })), "{beside:?}"),
                }
            }
        }
    }
}
