//! Results do not depend on the number of threads: the same bits by one, two and three.
//!
//! Needs the feature `rayon`.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{
    ByBody, Cholesky, Composite, ConjugateGradients, Factorization, LinearRows, LinearSolver, LinearSystem,
    PersistencyCorrection, Simulation, System,
};
use contact_dynamics_scenes::solids::{Material, Solid};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Runs with one, two and three threads, and compares the bits.
fn same_bits(what: &str, run: impl Fn() -> Vec<f64> + Sync) {
    let results = [1, 2, 3].map(|threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            assert_eq!(rayon::current_num_threads(), threads);
            run()
        })
    });
    assert!(results[0].iter().any(|x| *x != 0.0), "{what}");
    for (threads, other) in [(2, &results[1]), (3, &results[2])] {
        let differs = results[0].iter().zip(other).position(|(x, y)| x.to_bits() != y.to_bits());
        assert_eq!(differs, None, "{what} with {threads} threads");
    }
}

/// K + I of a block, of as many bodies as asked for; those behind the first are softer.
fn matrix(block: &Solid<3>, bodies: usize) -> SparseColMat<usize, f64> {
    let k = block.stiffness::<f64>();
    let n = block.dofs();
    let mut triplets = Vec::new();
    for body in 0..bodies {
        let (first, share) = (body * n, 1.0 / (1 + body) as f64);
        triplets.extend((0..n).map(|i| Triplet::new(first + i, first + i, 1.0)));
        for j in 0..n {
            let k = k.as_ref();
            let column = k.row_idx_of_col_raw(j).iter().zip(k.val_of_col(j));
            triplets.extend(column.map(|(&i, &x)| Triplet::new(first + i, first + j, share * x)));
        }
    }
    SparseColMat::try_new_from_triplets(bodies * n, bodies * n, &triplets).unwrap()
}

/// Solution, the halves of a condensation with a force between, responses.
fn everything(factor: &mut dyn Factorization<f64>, a: &SparseColMat<usize, f64>, last: &[usize]) -> Vec<f64> {
    factor.factorize(a.as_ref()).unwrap();
    let rhs: Vec<f64> = (0..a.ncols()).map(|i| (i as f64 * 0.7).sin()).collect();
    let (mut x, mut halves) = (rhs.clone(), rhs.clone());
    factor.solve(&mut x).unwrap();
    let condensed = factor.condensation().unwrap();
    let mut interface = vec![0.0; last.len()];
    condensed.condense(&rhs, &mut interface).unwrap();
    let mut response = vec![0.0; last.len()];
    response[0] = 1.0;
    condensed.solve(&mut response).unwrap();
    interface.iter_mut().zip(&response).for_each(|(x, response)| *x += 0.3 * response);
    condensed.expand(&interface, &mut halves).unwrap();
    // (The same bits of what is wrong would be of no use.)
    let mut pushed = rhs;
    pushed[last[0]] += 0.3;
    factor.solve(&mut pushed).unwrap();
    let size = pushed.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    for (one, other) in pushed.iter().zip(&halves) {
        assert!((one - other).abs() < 1e-10 * size, "{one} {other}");
    }
    [x, halves, interface, response].concat()
}

#[test]
fn solutions_are_the_same_by_any_number_of_threads() {
    let block = Solid::block([1.0; 3], [14; 3], MATERIAL);
    let a = matrix(&block, 1);
    let last: Vec<usize> = (0..block.dofs()).step_by(173).collect();
    same_bits("a block", || {
        let mut factor = Cholesky::default().analyze(a.symbolic(), &last).unwrap();
        everything(&mut *factor, &a, &last)
    });

    let block = Solid::block([1.0; 3], [9; 3], MATERIAL);
    let a = matrix(&block, 3);
    for last in [vec![0, 5, block.dofs() + 7], (0..a.ncols()).step_by(97).collect()] {
        same_bits("three bodies", || {
            let mut factor = ByBody::default().analyze(a.symbolic(), &last).unwrap();
            assert!(factor.stored_values() > 3 << 18);
            everything(&mut *factor, &a, &last)
        });
    }
}

/// Large enough for four parts.
#[test]
fn forces_are_the_same_by_any_number_of_threads() {
    let block = Solid::block([1.0; 3], [16; 3], MATERIAL);
    assert!(block.stiffness::<f64>().val().len() > 1 << 20);
    let u: Vec<f64> = (0..block.dofs()).map(|i| (0.1 * i as f64).sin()).collect();
    same_bits("a force", || {
        let mut f = vec![0.0; u.len()];
        block.system::<f64>().force(0.0, &u, &u, &mut f).unwrap();
        f
    });
}

/// Long enough for eight parts of the matrix, and for several pieces of the vectors of a contact problem by products.
#[test]
fn conjugate_gradients_are_the_same_by_any_number_of_threads() {
    let block = Solid::block([12.0, 1.2, 0.6], [100, 10, 5], MATERIAL);
    let bottom = block.surface_nodes().into_iter().filter(|&node| block.nodes[node][2] == 0.0);
    let bottom: Vec<usize> = bottom.collect();
    same_bits("a solve", || {
        let a = matrix(&block, 1);
        let mut factor = ConjugateGradients::default().analyze(a.symbolic(), &[]).unwrap();
        factor.factorize(a.as_ref()).unwrap();
        let mut x: Vec<f64> = (0..a.ncols()).map(|i| (i as f64 * 0.7).sin()).collect();
        factor.solve(&mut x).unwrap();
        x
    });
    same_bits("steps in contact", || {
        let floor = bottom.iter().fold(LinearRows::new(), |rows, &node| {
            rows.unilateral(&[(Solid::<3>::dof(node, 2), 1.0)], 0.001 * block.nodes[node][0])
        });
        let mut run = Simulation::builder(block.system::<f64>(), Composite, 0.05)
            .velocity(block.uniform([0.0, 0.0, -0.1]))
            .constraint(floor)
            .linear_solver(ConjugateGradients::default())
            .build()
            .unwrap();
        (0..3).for_each(|_| run.step().unwrap());
        assert!(run.statistics().contact_products > 0);
        [run.state().displacement(), run.state().contacts().forces()].concat()
    });
}

/// A body that fails names its own dof, whichever thread meets it first.
#[test]
fn the_first_body_that_fails_is_told() {
    let block = Solid::block([1.0; 3], [9; 3], MATERIAL);
    let a = matrix(&block, 2);
    let n = block.dofs();
    let mut values = a.val().to_vec();
    for dof in [n - 1, n + 2] {
        let diagonal = a.as_ref().row_idx_of_col_raw(dof).iter().position(|&row| row == dof).unwrap();
        values[a.as_ref().col_range(dof).start + diagonal] = -1.0;
    }
    let broken = SparseColMat::new(a.symbolic().to_owned().unwrap(), values);
    same_bits("the dof that fails", || {
        let mut factor = ByBody::default().analyze(a.symbolic(), &[]).unwrap();
        match factor.factorize(broken.as_ref()) {
            Err(contact_dynamics::Error::Singular { dof, .. }) => {
                assert!(dof < n, "{dof}");
                vec![dof as f64]
            }
            other => panic!("{other:?}"),
        }
    });
}

#[test]
fn runs_are_the_same_by_any_number_of_threads() {
    let block = Solid::block([1.0; 3], [10; 3], MATERIAL);
    let bottom: Vec<usize> = block.surface_nodes().into_iter().filter(|&node| block.nodes[node][2] == 0.0).collect();
    same_bits("a block that falls", || {
        let floor = bottom.iter().fold(LinearRows::new(), |rows, &node| {
            rows.unilateral(&[(Solid::<3>::dof(node, 2), 1.0)], 0.01 + 0.02 * block.nodes[node][0])
        });
        let system = LinearSystem::lumped(block.lumped_mass(), block.stiffness()).unwrap();
        let mut run = Simulation::builder(system, Composite, 0.05)
            .velocity(block.uniform([0.0, 0.0, -0.1]))
            .constraint(floor)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        (0..20).for_each(|_| run.step().unwrap());
        assert!(run.state().contacts().closed().iter().any(|&closed| closed));
        [run.state().displacement(), run.state().velocity(), run.state().acceleration()].concat()
    });
}
