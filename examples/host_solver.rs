//! A host's own linear solver: the sparse Cholesky factorization of another crate behind `LinearSolver`.
//!
//! `cargo run --release --example host_solver` drops a block on a floor with it, with the solver of this crate, and
//! with conjugate gradients, and prints how far the runs are apart; with `--quick` the block is smaller.
//!
//! What a host has to write is the first half: memory for a pattern, a factorization, a solve, and what errors mean.

use contact_dynamics::contact::Plane;
use contact_dynamics::faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef, Triplet};
use contact_dynamics::{
    Automatic, ConjugateGradients, Error, Factorization, GeneralizedAlpha, LinearSolver, LinearSystem, NodesOnObstacle,
    Result, Simulation,
};
use nalgebra_sparse::factorization::{CscCholesky, CscSymbolicCholesky};
use nalgebra_sparse::na::DMatrixViewMut;
use nalgebra_sparse::pattern::SparsityPattern;

/// The method: what a host chooses once, here without settings.
#[derive(Debug)]
struct Theirs;

/// Its memory for one pattern. There may be several at once, one for each stage of a scheme with other weights.
struct Factor {
    symbolic: CscSymbolicCholesky,
    numeric: Option<CscCholesky<f64>>,
}

impl std::fmt::Debug for Factor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Factor").field("values", &self.stored_values()).finish_non_exhaustive()
    }
}

impl LinearSolver<f64> for Theirs {
    /// `_last` are the dofs of contact: a solver that eliminates them last could offer a `Condensation`. This one does
    /// not, and contact is solved with full solves.
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        _last: &[usize],
    ) -> Result<Box<dyn Factorization<f64>>> {
        let (pointers, rows) = (pattern.col_ptr().to_vec(), pattern.row_idx().to_vec());
        let pattern = SparsityPattern::try_from_offsets_and_indices(pattern.ncols(), pattern.nrows(), pointers, rows)
            .map_err(refused)?;
        Ok(Box::new(Factor { symbolic: CscSymbolicCholesky::factor(pattern), numeric: None }))
    }
}

impl Factorization<f64> for Factor {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<()> {
        // An error must not leave an old factor to be used.
        let result = match self.numeric.take() {
            Some(mut factor) => factor.refactor(a.val()).map(|()| factor),
            None => CscCholesky::factor_numerical(self.symbolic.clone(), a.val()),
        };
        self.numeric = Some(result.map_err(refused)?);
        Ok(())
    }

    fn solve(&mut self, rhs: &mut [f64]) -> Result<()> {
        let Some(factor) = &self.numeric else {
            return Err(refused("no matrix has been factorized"));
        };
        let size = self.symbolic.l_pattern().major_dim();
        let columns = rhs.len() / size;
        factor.solve_mut(DMatrixViewMut::from_slice(rhs, size, columns));
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.symbolic.l_pattern().nnz()
    }
}

/// Errors of the other crate. `Error::Host` ends a run; what a smaller step may mend would be `Error::Inadmissible`,
/// for which `StepControl` halves the step. In both the step is undone.
fn refused(source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::Host { callback: "linear solver", source: source.into() }
}

/// A block of 1 × 1 × 1 and mass 1: masses at the corners of cells³ cubes, springs along the edges of the cubes and the
/// diagonals of their faces. The system, and the place of each mass, whose dofs are 3i, 3i + 1 and 3i + 2.
fn block(cells: usize, stiffness: f64) -> Result<(LinearSystem<'static, f64>, Vec<[f64; 3]>)> {
    let (n, size) = (cells + 1, 1.0 / cells as f64);
    let places: Vec<_> = (0..n.pow(3)).map(|i| [i % n, i / n % n, i / n / n].map(|x| x as f64 * size)).collect();
    let mut entries = Vec::new();
    for (i, a) in places.iter().enumerate() {
        for (j, b) in places[..i].iter().enumerate() {
            let d = [0, 1, 2].map(|k| a[k] - b[k]);
            let square: f64 = d.iter().map(|x| x * x).sum();
            if square > 2.5 * size * size {
                continue;
            }
            for (p, q) in (0..9).map(|k| (k / 3, k % 3)) {
                let k = stiffness * size * d[p] * d[q] / square;
                let (i, j) = (3 * i, 3 * j);
                entries.extend(
                    [(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)].map(|(i, j, k)| Triplet::new(i + p, j + q, k)),
                );
            }
        }
    }
    let dofs = 3 * places.len();
    let stiffness = SparseColMat::try_new_from_triplets(dofs, dofs, &entries).map_err(refused)?;
    Ok((LinearSystem::lumped(vec![1.0 / places.len() as f64; dofs], stiffness)?, places))
}

/// The block falls on a tilted floor, one edge first.
fn drop(cells: usize, solver: impl LinearSolver<f64> + 'static) -> Result<Simulation<'static, f64>> {
    let (system, places) = block(cells, 50.0)?;
    let dofs: Vec<_> = (0..places.len()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let lower: Vec<_> = (0..places.len()).filter(|&i| places[i][2] == 0.0).collect();
    let floor = Plane::new([0.0, 0.0, -0.02], [0.2, 0.0, 1.0])?;
    // A step is about what a wave takes for a cell.
    Simulation::builder(system, GeneralizedAlpha::default(), 0.1 / cells as f64)
        .velocity([0.0, 0.0, -1.0].repeat(places.len()))
        .constraint(NodesOnObstacle::new(floor, &places, &dofs, &lower)?)
        .linear_solver(solver)
        .build()
}

/// Largest difference, over the largest entry of the second.
fn difference(x: &[f64], y: &[f64]) -> f64 {
    let largest = y.iter().fold(0.0_f64, |m, y| m.max(y.abs()));
    x.iter().zip(y).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs())) / largest.max(f64::MIN_POSITIVE)
}

fn main() -> Result<()> {
    let cells = if std::env::args().any(|argument| argument == "--quick") { 3 } else { 6 };
    let mut ours = drop(cells, Automatic)?;
    let others = [drop(cells, Theirs)?, drop(cells, ConjugateGradients::default())?];
    // How far each is from ours: in displacements, velocities and contact forces; forces over the largest so far.
    let mut others = others.map(|run| (run, [0.0_f64; 3]));
    let (mut largest, mut pressed) = (0.0_f64, 0);
    for _ in 0..20 * cells {
        ours.step()?;
        let forces = ours.state().contacts().forces().to_vec();
        largest = forces.iter().fold(largest, |m, force| m.max(force.abs()));
        pressed += usize::from(forces.iter().any(|force| *force > 0.0));
        for (run, apart) in &mut others {
            run.step()?;
            let (theirs, state) = (run.state(), ours.state());
            assert_eq!(theirs.contacts().ids(), state.contacts().ids());
            let force = theirs.contacts().forces().iter().zip(&forces).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs()));
            for (apart, now) in apart.iter_mut().zip([
                difference(theirs.displacement(), state.displacement()),
                difference(theirs.velocity(), state.velocity()),
                force / largest.max(f64::MIN_POSITIVE),
            ]) {
                *apart = apart.max(now);
            }
        }
    }
    println!("block of {cells}³ cells, {} steps, {pressed} of them in contact", ours.statistics().steps);
    println!("largest contact force of a node {largest:.4}\n");
    println!("| solver | difference in u | in v | in contact forces |\n| --- | --- | --- | --- |");
    for (name, (_, [u, v, force]), bound) in ["another crate's Cholesky", "conjugate gradients"]
        .into_iter()
        .zip(&others)
        .zip([1e-9, 1e-6])
        .map(|((a, b), c)| (a, b, c))
    {
        println!("| {name} | {u:.0e} | {v:.0e} | {force:.0e} |");
        assert!(pressed > cells && u.max(*v).max(*force) < bound, "{name} and the default disagree");
    }

    // What their solver refuses arrives with its own message.
    let error =
        Simulation::builder(block(1, -1e9)?.0, GeneralizedAlpha::default(), 1.0).linear_solver(Theirs).build().err();
    let source = error.as_ref().and_then(std::error::Error::source).map(ToString::to_string);
    println!("\nA negative stiffness: {}", source.as_deref().unwrap_or("taken?"));
    assert!(matches!(error, Some(Error::Host { .. })));
    Ok(())
}
