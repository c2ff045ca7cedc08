//! The inverse of a consistent mass, by conjugate gradients around the forces.

use super::layers::Layers;
use super::{Mass, massless};
use crate::error::{Error, Result};
use crate::kernels::conjugate_gradients::{Blocks, Iteration, LANES, Outcome, Vectors};
use crate::linear_solver::{Automatic, Factorization, LinearSolver};
use crate::memory;
use crate::real::Real;
use crate::rounding::{far_below_rounding, half_digits};
use crate::sparse;
use faer::sparse::SparseColMatRef;

/// The dofs that are prescribed or have no mass, ascending.
pub(super) fn without_response<T: Real>(mass: SparseColMatRef<'_, usize, T>, prescribed: &[usize]) -> Vec<usize> {
    let mut fixed = massless(Mass::Consistent(mass), prescribed);
    fixed.extend_from_slice(prescribed);
    fixed.sort_unstable();
    fixed
}

/// A factor of M with identity on some dofs.
pub(super) fn factor<T: Real>(
    solver: &dyn LinearSolver<T>,
    mass: SparseColMatRef<'_, usize, T>,
    fixed: &[usize],
) -> Result<Box<dyn Factorization<T>>> {
    let reduced = sparse::Combination::new(mass.ncols(), fixed, &[mass.symbolic()])?;
    let mut values = memory::zeros(reduced.len(), 1, "the values of the mass matrix")?;
    reduced.fill(&[(T::one(), mass.val())], None, &mut values);
    let mut factor = solver.analyze(reduced.pattern(), &[])?;
    factor.factorize(reduced.view(&values)).map_err(|error| match error {
        Error::Singular { dof, .. } => Error::Singular { matrix: "mass matrix", dof },
        other => other,
    })?;
    Ok(factor)
}

/// The inverse of a consistent mass, applied to forces on few dofs at a time.
///
/// A mass matrix with scaled diagonal is well conditioned for any mesh: conjugate gradients need at most some twenty
/// iterations to rounding, and the memory of half of M. Entries of M⁻¹ decay fast with distance (by 0.27 per element
/// of linear shape functions), so only the layers of dofs around the forces are computed. A factor is used in other
/// cases: for chains, whose factor is as small as M, and for matrices on which a trial converges slowly.
#[derive(Debug)]
pub(crate) struct ConsistentInverse<T: Real> {
    /// Dofs without response, ascending.
    fixed: Vec<usize>,
    layers: Layers,
    /// Forces in the order of places; zero between calls.
    force: Vec<T>,
    solver: Solver<T>,
}

/// Solves for forces in the order of places.
#[derive(Debug)]
struct Solver<T: Real> {
    /// The factors that make responses comparable: √m of the diagonal.
    weights: Vec<T>,
    method: Method<T>,
    /// The last response.
    response: Vec<T>,
}

enum Method<T: Real> {
    Factor {
        factor: Box<dyn Factorization<T>>,
        /// Force and response in the order of dofs.
        vector: Vec<T>,
        /// Whether the factor has rows of other ranks too. All ranks then solve together, whatever their own parts of
        /// force and response, and truncate nothing, because each would truncate something else.
        spans_ranks: bool,
    },
    Iteration(Scaled<T>),
}

/// M with a scaled diagonal: entries below it, row by row, and 1/√m of the diagonal; memory of the iteration.
struct Scaled<T> {
    pointers: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<T>,
    scaling: Vec<T>,
    vectors: Vec<T>,
}

impl<T: Real> std::fmt::Debug for Method<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Factor { .. } => "Factor",
            Self::Iteration(_) => "Iteration",
        })
    }
}

/// Iteration limit of a trial. If it is not met, a factor is cheaper.
const TRIAL: usize = 64;

/// Iteration limit of a solve to rounding: far more than needed after a successful trial.
const LIMIT: usize = 1000;

/// Layers of dofs around the forces in which a response is first computed. Beyond this many elements of linear shape
/// functions no response exceeds [`far_below_rounding`] of its largest entry.
const LAYERS: usize = 36;

/// Number of entries per dof in chains.
const CHAIN: usize = 3;

impl<T: Real> ConsistentInverse<T> {
    /// Forces are expected on the dofs `near`, or anywhere if the list is empty.
    pub(super) fn new(mass: SparseColMatRef<'_, usize, T>, prescribed: &[usize], near: &[usize]) -> Result<Self> {
        sparse::check_symmetric("mass", mass)?;
        let fixed = without_response(mass, prescribed);
        let layers = Layers::around(near, mass, &fixed)?;
        let places = layers.order().len();
        let (pointers, columns, mut values) = lower(mass, &layers)?;
        let mut scaling = diagonal(mass, &layers);
        let weights = scaling.iter().map(|m| m.sqrt()).collect();
        let is_chain = 2 * columns.len() + places <= CHAIN * places;
        if !is_chain && T::scale_blocks(1, (&pointers, &columns), &mut values, &mut scaling).is_ok() {
            let method = Method::Iteration(Scaled { pointers, columns, values, scaling, vectors: Vec::new() });
            let mut solver = Solver { weights, method, response: vec![T::zero(); places] };
            if solver.is_definite()? {
                return Ok(Self { fixed, layers, force: vec![T::zero(); places], solver });
            }
        }
        Self::factored(&Automatic, mass, fixed, layers, false)
    }

    /// The same with a given solver: for bodies spread over ranks, whose rows only that solver has together.
    pub(super) fn through(
        solver: &dyn LinearSolver<T>,
        mass: SparseColMatRef<'_, usize, T>,
        prescribed: &[usize],
    ) -> Result<Self> {
        // Dofs whose mass is on other ranks seem to have none, and couplings on other ranks are unknown.
        let fixed = prescribed.to_vec();
        let layers = Layers::around(&[], mass, &fixed)?;
        Self::factored(solver, mass, fixed, layers, true)
    }

    fn factored(
        solver: &dyn LinearSolver<T>,
        mass: SparseColMatRef<'_, usize, T>,
        fixed: Vec<usize>,
        layers: Layers,
        spans_ranks: bool,
    ) -> Result<Self> {
        let method = Method::Factor {
            factor: factor(solver, mass, &fixed)?,
            vector: vec![T::zero(); mass.ncols()],
            spans_ranks,
        };
        let weights: Vec<T> = diagonal(mass, &layers).iter().map(|m| m.sqrt()).collect();
        let [force, response] = [(); 2].map(|()| vec![T::zero(); weights.len()]);
        Ok(Self { fixed, layers, force, solver: Solver { weights, method, response } })
    }

    /// Dofs without response, ascending.
    pub(crate) fn fixed(&self) -> &[usize] {
        &self.fixed
    }

    /// The place of a dof in responses; places where forces are expected come first. Beyond all responses if it has
    /// none.
    pub(crate) fn place(&self, dof: usize) -> usize {
        self.layers.place(dof)
    }

    /// The number of places where forces are expected.
    pub(crate) fn near(&self) -> usize {
        self.layers.first()
    }

    /// `x ← M⁻¹ x`, zero on dofs without response.
    pub(super) fn apply(&mut self, x: &mut [T]) -> Result<()> {
        for (force, &dof) in self.force.iter_mut().zip(self.layers.order()) {
            *force = x[dof as usize];
        }
        let end = self.solve()?;
        x.fill(T::zero());
        for (&dof, &response) in self.layers.order().iter().zip(&self.solver.response[..end]) {
            x[dof as usize] = response;
        }
        Ok(())
    }

    /// M⁻¹ f for several f, each given by its forces (dof, f). `keep` receives the number of each f and its response
    /// in the order of places, without the negligible end; numbers in any order.
    pub(crate) fn respond<F: Iterator<Item = (usize, T)>>(
        &mut self,
        count: usize,
        forces: impl Fn(usize) -> F,
        keep: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        let Self { layers, solver, .. } = self;
        let placed = |number| forces(number).map(|(dof, force)| (layers.place(dof), force));
        let places = layers.order().len();
        solver.respond(layers, count, |number| placed(number).filter(|&(place, _)| place < places), keep)
    }

    /// `x += M⁻¹ f`.
    pub(crate) fn add_response(&mut self, forces: impl Iterator<Item = (usize, T)>, x: &mut [T]) -> Result<()> {
        for (dof, force) in forces {
            if let Some(own) = self.force.get_mut(self.layers.place(dof)) {
                *own += force;
            }
        }
        let end = self.solve()?;
        for (&dof, &response) in self.layers.order().iter().zip(&self.solver.response[..end]) {
            x[dof as usize] += response;
        }
        Ok(())
    }

    /// `x += Σ c r` of earlier responses.
    pub(crate) fn combine<'r>(&mut self, responses: impl Iterator<Item = (T, &'r [T])>, x: &mut [T]) {
        let Self { layers, force: sum, .. } = self;
        let mut end = 0;
        for (c, response) in responses {
            T::axpy(c, response, &mut sum[..response.len()]);
            end = end.max(response.len());
        }
        for (&dof, sum) in layers.order().iter().zip(&mut sum[..end]) {
            x[dof as usize] += *sum;
            *sum = T::zero();
        }
    }

    /// Solves for the force, which becomes zero; returns the end of the places where the response is not negligible.
    fn solve(&mut self) -> Result<usize> {
        let Self { layers, force, solver, .. } = self;
        let acting = || force.iter().copied().enumerate().filter(|(_, force)| *force != T::zero());
        let mut end = 0;
        let result = solver.respond(layers, 1, |_| acting(), |_, response| end = response.len());
        force.fill(T::zero());
        result.map(|()| end)
    }
}

impl<T: Real> Solver<T> {
    /// Whether conjugate gradients converge quickly for scattered numbers, so that M is positive definite. As long as
    /// no negative curvature is found, the part of the right-hand side along a direction of negative curvature grows
    /// from one residual to the next (the residual polynomial is 1 at zero and has positive roots), and along one of
    /// zero curvature it stays.
    fn is_definite(&mut self) -> Result<bool> {
        let Self { weights, method: Method::Iteration(scaled), .. } = self else { return Ok(false) };
        let scattered = || weights.iter().enumerate().map(|(k, &m)| (k, T::of(sparse::scattered_signed(k)) * m));
        let tolerance = half_digits::<T>().value();
        let outcomes = scaled.iterate(weights.len(), TRIAL, tolerance, |lane| (lane == 0).then(scattered))?;
        Ok(matches!(outcomes, [Outcome::Converged { .. }, ..]))
    }

    /// As [`ConsistentInverse::respond`], with forces by places; the last response stays in `response`.
    fn respond<F: Iterator<Item = (usize, T)>>(
        &mut self,
        layers: &Layers,
        count: usize,
        forces: impl Fn(usize) -> F,
        mut keep: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        for first in (0..count).step_by(LANES) {
            let lanes = count.min(first + LANES) - first;
            let last = (first..first + lanes).flat_map(&forces).map(|(place, _)| place).max();
            if let Method::Factor { factor, vector, spans_ranks } = &mut self.method {
                let end = last.map_or(0, |last| layers.connected(last));
                let end = if *spans_ranks { layers.order().len() } else { end };
                for number in first..first + lanes {
                    vector.fill(T::zero());
                    forces(number).for_each(|(place, force)| vector[layers.order()[place] as usize] += force);
                    factor.solve(vector)?;
                    for (response, &dof) in self.response[..end].iter_mut().zip(layers.order()) {
                        *response = vector[dof as usize];
                    }
                    let end = if *spans_ranks { end } else { cut(&self.weights, &self.response[..end]) };
                    keep(number, &self.response[..end]);
                }
                continue;
            }
            let Some(last) = last else {
                (first..first + lanes).for_each(|number| keep(number, &[]));
                continue;
            };
            // If responses decay more slowly than in linear elements, more layers are needed.
            let ([begin, end], all) = (layers.beyond(last, LAYERS), layers.connected(last));
            let mut left: [bool; LANES] = std::array::from_fn(|lane| lane < lanes);
            for end in [end, all] {
                self.iterate(layers, end, |lane| left[lane].then(|| forces(first + lane)))?;
                for (lane, left) in left.iter_mut().enumerate().filter(|(_, left)| **left) {
                    self.take(lane, end);
                    let kept = cut(&self.weights, &self.response[..end]);
                    *left = end < all && kept > begin;
                    if !*left {
                        keep(first + lane, &self.response[..kept]);
                    }
                }
                if left == [false; LANES] {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Solves to rounding for the forces of all lanes on the places before `end`.
    fn iterate<F: Iterator<Item = (usize, T)>>(
        &mut self,
        layers: &Layers,
        end: usize,
        forces: impl Fn(usize) -> Option<F>,
    ) -> Result<()> {
        let Method::Iteration(scaled) = &mut self.method else { return Ok(()) };
        for outcome in scaled.iterate(end, LIMIT, 0.0, forces)? {
            match outcome {
                Outcome::Indefinite { dof, .. } => {
                    return Err(Error::Singular { matrix: "mass matrix", dof: layers.order()[dof] as usize });
                }
                Outcome::NotConverged { iterations, residual } => {
                    let (method, tolerance) = ("conjugate gradients for the mass matrix", T::epsilon().value());
                    return Err(Error::LinearNotConverged { method, iterations, residual, tolerance });
                }
                Outcome::Converged { .. } => {}
            }
        }
        Ok(())
    }

    /// Copies the solution of a lane to the response.
    fn take(&mut self, lane: usize, end: usize) {
        if let Method::Iteration(scaled) = &self.method {
            let solution = &scaled.vectors.as_chunks::<LANES>().0[..end];
            self.response.iter_mut().zip(solution).for_each(|(response, x)| *response = x[lane]);
        }
    }
}

impl<T: Real> Scaled<T> {
    /// Solves for the forces of all lanes on the places before `end`.
    fn iterate<F: Iterator<Item = (usize, T)>>(
        &mut self,
        end: usize,
        limit: usize,
        tolerance: f64,
        forces: impl Fn(usize) -> Option<F>,
    ) -> Result<[Outcome; LANES]> {
        let Self { pointers, columns, values, scaling, vectors } = self;
        let size = vectors.len().max(5 * LANES * end);
        memory::grow(vectors, size, 1, "the vectors of conjugate gradients")?;
        let vectors = Vectors::of(vectors, end);
        vectors.r.fill([T::zero(); LANES]);
        for lane in 0..LANES {
            for (place, force) in forces(lane).into_iter().flatten() {
                vectors.r[place][lane] += force;
            }
        }
        let lower = Blocks { pointers: &pointers[..=end], columns, values };
        let resolution = far_below_rounding::<T>().value();
        let iteration = Iteration { lower, scaling, parts: &[], tolerance, resolution, limit };
        Ok(T::conjugate_gradients_side_by_side(&iteration, vectors))
    }
}

/// The end of the places where a response is not negligible compared with its largest entry.
fn cut<T: Real>(weights: &[T], response: &[T]) -> usize {
    let weighted = || response.iter().zip(weights).map(|(&x, &weight)| (x * weight).abs());
    let bound = far_below_rounding::<T>() * weighted().fold(T::zero(), T::max);
    // NaN is not negligible.
    weighted().rposition(|x| x > bound || x.is_nan()).map_or(0, |place| place + 1)
}

/// The diagonal of M in the order of places.
fn diagonal<T: Real>(mass: SparseColMatRef<'_, usize, T>, layers: &Layers) -> Vec<T> {
    layers.order().iter().map(|&dof| sparse::entry(mass, dof as usize, dof as usize)).collect()
}

/// The nonzero entries of M below the diagonal, row by row in the order of places.
fn lower<T: Real>(mass: SparseColMatRef<'_, usize, T>, layers: &Layers) -> Result<(Vec<usize>, Vec<u32>, Vec<T>)> {
    // The matrix is symmetric: columns are rows.
    let row = |place: usize| {
        let dof = layers.order()[place] as usize;
        let entries = mass.row_idx_of_col_raw(dof).iter().zip(mass.val_of_col(dof));
        let placed = entries.map(|(&other, &value)| (layers.place(other), value));
        placed.filter(move |&(other, value)| other < place && value != T::zero())
    };
    let places = layers.order().len();
    let count = (0..places).map(|place| row(place).count()).sum();
    let what = "a mass matrix in layers";
    let (mut columns, mut values) = (memory::reserve::<u32>(count, 1, what)?, memory::reserve::<T>(count, 1, what)?);
    let mut pointers = Vec::with_capacity(places + 1);
    pointers.push(0);
    for place in 0..places {
        for (other, value) in row(place) {
            columns.push(
                u32::try_from(other).map_err(|_| Error::OutOfMemory { what: "indices of 32 bits", bytes: None })?,
            );
            values.push(value);
        }
        pointers.push(columns.len());
    }
    Ok((pointers, columns, values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::sparse::{SparseColMat, Triplet};

    /// The mass of a rod of `cells` linear elements, 2 × 2 nodes across; `beside` is the off-diagonal entry for a
    /// diagonal of ones along the rod, 1/4 for a consistent mass.
    fn rod(cells: usize, beside: f64) -> SparseColMat<usize, f64> {
        let sections = cells + 1;
        let mut entries = Vec::new();
        for i in 0..4 * sections {
            for j in 0..4 * sections {
                let across = [1.0, 0.5, 0.5, 0.25][(i ^ j) % 4];
                let along = [1.0, beside].get((i / 4).abs_diff(j / 4)).copied().unwrap_or(0.0);
                if along > 0.0 {
                    entries.push(Triplet::new(i, j, across * along));
                }
            }
        }
        SparseColMat::try_new_from_triplets(4 * sections, 4 * sections, &entries).unwrap()
    }

    /// The responses to forces on single dofs, in the order of dofs.
    fn responses(inverse: &mut ConsistentInverse<f64>, dofs: &[usize]) -> Vec<Vec<f64>> {
        let mut found = vec![Vec::new(); dofs.len()];
        inverse.respond(dofs.len(), |k| [(dofs[k], 1.0)].into_iter(), |k, r| found[k] = r.to_vec()).unwrap();
        let by_dofs = |response: &Vec<f64>| {
            let mut all = vec![0.0; inverse.layers.order().len() + inverse.fixed.len()];
            for (&dof, &x) in inverse.layers.order().iter().zip(response) {
                all[dof as usize] = x;
            }
            all
        };
        found.iter().map(by_dofs).collect()
    }

    #[test]
    fn responses_satisfy_their_equations_near_and_far() {
        // The second kind decays by one half per layer: 36 layers are not enough.
        for (beside, is_local) in [(0.25, true), (0.4, false)] {
            let mass = rod(120, beside);
            let dofs = mass.ncols();
            let near = [0, 1, 2, 3];
            let mut inverse = ConsistentInverse::new(mass.as_ref(), &[9], &near).unwrap();
            assert!(matches!(inverse.solver.method, Method::Iteration(_)));
            assert_eq!((inverse.near(), inverse.place(9) > dofs), (4, true));
            let chosen = [2, 0, 1, 3, 1];
            let found = responses(&mut inverse, &chosen);
            for (&dof, x) in chosen.iter().zip(&found) {
                let mut left = vec![0.0; dofs];
                Mass::Consistent(mass.as_ref()).add_product(1.0, x, &mut left);
                left[dof] -= 1.0;
                left[9] = 0.0;
                assert!(x[9] == 0.0 && left.iter().all(|x| x.abs() < 4e-15), "{beside} {dof}");
                // Dof 9 is on the line of dof 1 and shields all dofs beyond: M is a product of a matrix along and one
                // across.
                assert_eq!(x[4 * 50] == 0.0, is_local || dof == 1, "{beside} {dof}");
                // The response alone equals the response among others.
                assert_eq!(responses(&mut inverse, &[dof])[0], *x);
            }
            // The same by the other method, with any force.
            let mut whole = ConsistentInverse::new(mass.as_ref(), &[9], &[]).unwrap();
            for at in [2, 300] {
                let mut x = vec![0.0; dofs];
                (x[at], x[9]) = (1.0, 7.0);
                let mut y = x.clone();
                inverse.apply(&mut x).unwrap();
                whole.apply(&mut y).unwrap();
                let mut z = vec![0.0; dofs];
                inverse.add_response([(at, 1.0)].into_iter(), &mut z).unwrap();
                assert_eq!(x, z);
                assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 4e-15), "{beside} {at}");
            }
            assert!(found[0].iter().zip(&responses(&mut whole, &[2])[0]).all(|(x, y)| (x - y).abs() < 4e-15));
        }
    }

    #[test]
    fn chains_and_bad_conditions_have_a_factor() {
        let chain: Vec<_> = (0..50)
            .flat_map(|i: usize| [(i, i, 4.0), (i, (i + 1) % 50, 1.0), ((i + 1) % 50, i, 1.0)])
            .filter(|(i, j, _)| i.abs_diff(*j) < 2)
            .map(|(i, j, x)| Triplet::new(i, j, x))
            .collect();
        let chain = SparseColMat::try_new_from_triplets(50, 50, &chain).unwrap();
        for mass in [chain, rod(60, 0.499_99)] {
            let mut inverse = ConsistentInverse::new(mass.as_ref(), &[], &[1]).unwrap();
            assert!(matches!(inverse.solver.method, Method::Factor { .. }));
            let mut left = vec![0.0; mass.ncols()];
            Mass::Consistent(mass.as_ref()).add_product(1.0, &responses(&mut inverse, &[1])[0], &mut left);
            left[1] -= 1.0;
            assert!(left.iter().all(|x| x.abs() < 1e-12));
        }
        // All dofs prescribed.
        let mut none = ConsistentInverse::new(rod(1, 0.25).as_ref(), &[0, 1, 2, 3, 4, 5, 6, 7], &[0]).unwrap();
        let mut x = [1.0; 8];
        none.apply(&mut x).unwrap();
        assert!(x.iter().all(|&x| x == 0.0));
    }

    #[test]
    fn failures_have_a_name() {
        let mass = rod(20, 0.25);
        let mut inverse = ConsistentInverse::new(mass.as_ref(), &[], &[0]).unwrap();
        // A matrix that no trial accepts.
        if let Method::Iteration(Scaled { values, .. }) = &mut inverse.solver.method {
            for x in values.iter_mut() {
                *x *= 3.0;
            }
        }
        let error = inverse.respond(1, |_| [(0, 1.0)].into_iter(), |_, _| ()).unwrap_err();
        assert!(matches!(error, Error::Singular { matrix: "mass matrix", .. }), "{error}");
        let mut x = vec![1.0; mass.ncols()];
        let before = x.clone();
        assert!(matches!(inverse.apply(&mut x), Err(Error::Singular { matrix: "mass matrix", .. })));
        assert_eq!(x, before);
    }
}
