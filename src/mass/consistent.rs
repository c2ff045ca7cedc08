//! The inverse of a consistent mass, by conjugate gradients around the forces.

use super::layers::Layers;
use super::{Mass, massless};
use crate::error::{Error, Result};
use crate::kernels::conjugate_gradients::{Blocks, Iteration, Outcome, Sweeps, Vectors};
use crate::kernels::side_by_side::{LANES, SideVectors};
use crate::linear_solver::{Automatic, Factorization, LinearSolver};
use crate::memory;
use crate::real::Real;
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
    let mut values = vec![T::zero(); reduced.len()];
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
    /// 1/√m of the diagonal, in the order of places, like the vectors below.
    scaling: Vec<T>,
    method: Method<T>,
    /// Zero between calls.
    force: Vec<T>,
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
    /// Entries of the scaled M below its diagonal, row by row, and five vectors; five more for several forces once
    /// needed.
    Iteration { pointers: Vec<usize>, columns: Vec<u32>, values: Vec<T>, vectors: Vec<T>, lanes: Vec<T> },
}

impl<T: Real> std::fmt::Debug for Method<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Factor { .. } => "Factor",
            Self::Iteration { .. } => "Iteration",
        })
    }
}

/// Iteration limit and tolerance of a trial. If they are not met, a factor is cheaper.
const TRIAL: (usize, f64) = (64, 1e-8);

/// Iteration limit of a solve to rounding: far more than needed after a successful trial.
const LIMIT: usize = 1000;

/// Relative size of updates at which an iteration ends. It is far below rounding: in a body a million times as heavy
/// as the other one the response is smaller, and its own rounding matters.
fn resolution<T: Real>() -> f64 {
    1e-3 * T::epsilon().value()
}

/// Layers of dofs around the forces in which a response is first computed. Beyond this many elements of linear shape
/// functions no response exceeds [`negligible`].
const LAYERS: usize = 36;

/// Number of entries per dof in chains.
const CHAIN: usize = 3;

/// Entries of a response below this share of its largest one, scaled by the square roots of their masses, have no
/// effect.
fn negligible<T: Real>() -> T {
    T::of(1e-3) * T::epsilon()
}

impl<T: Real> ConsistentInverse<T> {
    /// Forces are expected on the dofs `near`, or anywhere if the list is empty.
    pub(super) fn new(mass: SparseColMatRef<'_, usize, T>, prescribed: &[usize], near: &[usize]) -> Result<Self> {
        sparse::check_symmetric("mass", mass)?;
        let fixed = without_response(mass, prescribed);
        let layers = Layers::around(near, mass, &fixed)?;
        let places = layers.order().len();
        let [force, response] = [(); 2].map(|()| vec![T::zero(); places]);
        let (pointers, columns, mut values) = lower(mass, &layers)?;
        let mut scaling: Vec<T> =
            layers.order().iter().map(|&dof| sparse::entry(mass, dof as usize, dof as usize)).collect();
        let is_chain = 2 * columns.len() + places <= CHAIN * places;
        if !is_chain && T::scale_blocks(1, (&pointers, &columns), &mut values, &mut scaling).is_ok() {
            let vectors = memory::zeros(places, 5, "the vectors of conjugate gradients")?;
            let method = Method::Iteration { pointers, columns, values, vectors, lanes: Vec::new() };
            let mut tried = Self { fixed, layers, scaling, method, force, response };
            if tried.is_definite() {
                return Ok(tried);
            }
            return Self::factored(&Automatic, mass, tried.fixed, tried.layers);
        }
        Self::factored(&Automatic, mass, fixed, layers)
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
        let mut inverse = Self::factored(solver, mass, fixed, layers)?;
        inverse.scaling.fill(T::one());
        if let Method::Factor { spans_ranks, .. } = &mut inverse.method {
            *spans_ranks = true;
        }
        Ok(inverse)
    }

    fn factored(
        solver: &dyn LinearSolver<T>,
        mass: SparseColMatRef<'_, usize, T>,
        fixed: Vec<usize>,
        layers: Layers,
    ) -> Result<Self> {
        let factor = factor(solver, mass, &fixed)?;
        let scaling = layers.order().iter().map(|&dof| sparse::entry(mass, dof as usize, dof as usize).sqrt().recip());
        let (scaling, vector) = (scaling.collect(), vec![T::zero(); mass.ncols()]);
        let [force, response] = [(); 2].map(|()| vec![T::zero(); layers.order().len()]);
        Ok(Self {
            fixed,
            layers,
            scaling,
            method: Method::Factor { factor, vector, spans_ranks: false },
            force,
            response,
        })
    }

    /// Whether conjugate gradients converge quickly for scattered numbers, so that M is positive definite. As long as
    /// no negative curvature is found, the part of the right-hand side along a direction of negative curvature grows
    /// from one residual to the next (the residual polynomial is 1 at zero and has positive roots), and along one of
    /// zero curvature it stays.
    fn is_definite(&mut self) -> bool {
        for (k, (x, &scaling)) in self.response.iter_mut().zip(&self.scaling).enumerate() {
            *x = T::of(sparse::scattered_signed(k)) / scaling;
        }
        let all = self.response.len();
        let outcome = self.iterate(all, TRIAL.0, TRIAL.1.max(T::epsilon().value().sqrt()));
        matches!(outcome, Some(Outcome::Converged { .. }))
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
        for (&dof, &response) in self.layers.order().iter().zip(&self.response[..end]) {
            x[dof as usize] = response;
        }
        Ok(())
    }

    /// M⁻¹ f for several f, each given by its forces (dof, f). `keep` receives the number of each f and its response
    /// in the order of places, without the negligible end.
    pub(crate) fn respond<F: Iterator<Item = (usize, T)>>(
        &mut self,
        count: usize,
        forces: impl Fn(usize) -> F,
        mut keep: impl FnMut(usize, &[T]),
    ) -> Result<()> {
        if let Method::Factor { .. } = self.method {
            for number in 0..count {
                self.load(forces(number));
                let end = self.solve()?;
                keep(number, &self.response[..end]);
            }
            return Ok(());
        }
        for first in (0..count).step_by(LANES) {
            let numbers = first..count.min(first + LANES);
            let places = numbers.clone().flat_map(&forces).map(|(dof, _)| self.layers.place(dof));
            let Some(last) = places.filter(|&place| place < self.force.len()).max() else {
                numbers.for_each(|number| keep(number, &[]));
                continue;
            };
            let ([begin, end], all) = (self.layers.beyond(last, LAYERS), self.layers.connected(last));
            let outcomes =
                self.iterate_side_by_side(end, |lane| (first + lane < count).then(|| forces(first + lane)))?;
            for (lane, number) in numbers.enumerate() {
                self.refuse(outcomes[lane])?;
                self.take_lane(lane, end);
                let mut end = end;
                if end < all && self.significant(begin..end).is_some() {
                    self.load(forces(number));
                    let result = self.iterate_to_rounding(last, all);
                    self.force[..=last].fill(T::zero());
                    result?;
                    end = all;
                }
                let end = self.significant(0..end).map_or(0, |place| place + 1);
                keep(number, &self.response[..end]);
            }
        }
        Ok(())
    }

    /// Solves for the forces of all lanes on the places before `end`.
    fn iterate_side_by_side<F: Iterator<Item = (usize, T)>>(
        &mut self,
        end: usize,
        forces: impl Fn(usize) -> Option<F>,
    ) -> Result<[Outcome; LANES]> {
        let Self { layers, scaling, method, .. } = self;
        let done = [Outcome::Converged { iterations: 0 }; LANES];
        let Method::Iteration { pointers, columns, values, lanes, .. } = method else { return Ok(done) };
        memory::grow(lanes, lanes.len().max(5 * LANES * end), 1, "the vectors of conjugate gradients")?;
        let mut parts = lanes.as_chunks_mut::<LANES>().0.chunks_exact_mut(end.max(1));
        let mut next = || parts.next().unwrap_or_default();
        let vectors = SideVectors { x: next(), r: next(), p: next(), t: next(), y: next() };
        vectors.r.fill([T::zero(); LANES]);
        for lane in 0..LANES {
            for (dof, force) in forces(lane).into_iter().flatten() {
                let place = layers.place(dof);
                if let Some(r) = vectors.r.get_mut(place) {
                    r[lane] += force * scaling[place];
                }
            }
        }
        let lower = Blocks { pointers: &pointers[..=end], columns, values };
        Ok(T::conjugate_gradients_side_by_side(&lower, (resolution::<T>(), LIMIT), vectors))
    }

    /// Copies the solution of a lane to the response.
    fn take_lane(&mut self, lane: usize, end: usize) {
        if let Method::Iteration { lanes, .. } = &self.method {
            let solution = &lanes.as_chunks::<LANES>().0[..end];
            for ((response, x), &scaling) in self.response.iter_mut().zip(solution).zip(&self.scaling) {
                *response = x[lane] * scaling;
            }
        }
    }

    /// Adds forces (dof, f) to the present ones.
    fn load(&mut self, forces: impl Iterator<Item = (usize, T)>) {
        for (dof, force) in forces {
            if let Some(own) = self.force.get_mut(self.layers.place(dof)) {
                *own += force;
            }
        }
    }

    /// `x += M⁻¹ f`.
    pub(crate) fn add_response(&mut self, forces: impl Iterator<Item = (usize, T)>, x: &mut [T]) -> Result<()> {
        self.load(forces);
        let end = self.solve()?;
        for (&dof, &response) in self.layers.order().iter().zip(&self.response[..end]) {
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

    /// Converts the force to a response; returns the end of the places that are not negligible.
    fn solve(&mut self) -> Result<usize> {
        if let Method::Factor { spans_ranks: true, .. } = self.method {
            let result = self.force.len().checked_sub(1).map_or(Ok(0), |last| self.respond_around(last));
            self.force.fill(T::zero());
            return result;
        }
        let Some(last) = self.force.iter().rposition(|&force| force != T::zero()) else { return Ok(0) };
        let result = self.respond_around(last);
        self.force[..=last].fill(T::zero());
        let end = result?;
        Ok(self.significant(0..end).map_or(0, |place| place + 1))
    }

    /// Computes the response to forces up to a place; returns its end.
    fn respond_around(&mut self, last: usize) -> Result<usize> {
        let all = self.layers.connected(last);
        if let Method::Factor { factor, vector, .. } = &mut self.method {
            vector.fill(T::zero());
            for (&dof, &force) in self.layers.order().iter().zip(&self.force[..=last]) {
                vector[dof as usize] = force;
            }
            factor.solve(vector)?;
            for (response, &dof) in self.response[..all].iter_mut().zip(self.layers.order()) {
                *response = vector[dof as usize];
            }
            return Ok(all);
        }
        let [begin, end] = self.layers.beyond(last, LAYERS);
        self.iterate_to_rounding(last, end)?;
        // If responses decay more slowly than in linear elements, more layers may be needed.
        if end == all || self.significant(begin..end).is_none() {
            return Ok(end);
        }
        self.iterate_to_rounding(last, all)?;
        Ok(all)
    }

    /// The last place of a range where the response is not negligible.
    fn significant(&self, range: std::ops::Range<usize>) -> Option<usize> {
        let weighted = |place: usize| (self.response[place] / self.scaling[place]).abs();
        let largest = (0..range.end).map(weighted).fold(T::zero(), T::max);
        let bound = negligible::<T>() * largest;
        // NaN is not negligible.
        range.rev().find(|&place| weighted(place) > bound || self.response[place].is_nan())
    }

    fn iterate_to_rounding(&mut self, last: usize, end: usize) -> Result<()> {
        self.response[..=last].copy_from_slice(&self.force[..=last]);
        self.response[last + 1..end].fill(T::zero());
        self.iterate(end, LIMIT, 0.0).map_or(Ok(()), |outcome| self.refuse(outcome))
    }

    /// The error of an iteration that failed.
    fn refuse(&self, outcome: Outcome) -> Result<()> {
        match outcome {
            Outcome::Indefinite { dof, .. } => {
                Err(Error::Singular { matrix: "mass matrix", dof: self.layers.order()[dof] as usize })
            }
            Outcome::NotConverged { iterations, residual } => {
                let (method, tolerance) = ("conjugate gradients for the mass matrix", T::epsilon().value());
                Err(Error::LinearNotConverged { method, iterations, residual, tolerance })
            }
            Outcome::Converged { .. } => Ok(()),
        }
    }

    /// Conjugate gradients on the places before `end`, from right-hand side to solution; `None` if a factor is used.
    fn iterate(&mut self, end: usize, limit: usize, tolerance: f64) -> Option<Outcome> {
        let Method::Iteration { pointers, columns, values, vectors, .. } = &mut self.method else { return None };
        let lower = Blocks { pointers: &pointers[..=end], columns, values };
        let scaling = &self.scaling[..end];
        let resolution = resolution::<T>();
        let iteration = Iteration { lower, scaling, sweeps: Sweeps::GaussSeidel, tolerance, resolution, limit };
        let mut parts = vectors.chunks_exact_mut(self.response.len().max(1));
        let mut next = || parts.next().map_or(&mut [][..], |part| &mut part[..end]);
        let vectors = Vectors { x: next(), r: next(), p: next(), t: next(), q: next() };
        Some(T::conjugate_gradients(1, &iteration, &mut self.response[..end], vectors))
    }
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
            assert!(matches!(inverse.method, Method::Iteration { .. }));
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
            assert!(matches!(inverse.method, Method::Factor { .. }));
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
        if let Method::Iteration { values, .. } = &mut inverse.method {
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
