//! L D Lᵀ of matrices whose dofs form chains, here called strings.

use super::negligible;
use super::selection::Selection;
use super::{Condensation, Factorization, Fingerprint, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::kernels::chain::Chains;
use crate::real::Real;
use crate::{memory, sparse};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use std::ops::Range;

/// L D Lᵀ of symmetric positive definite matrices that are tridiagonal when their dofs are numbered along strings:
/// any number of bars and trains of masses and springs, in any numbering. Contact may act on one end of a string.
///
/// It stores two scalars per dof and no indices, and processes two strings at a time: faster than
/// [`Cholesky`](super::Cholesky), with the same errors. Other structures are rejected as [`Error::Incompatible`];
/// [`Automatic`](super::Automatic) selects it for suitable structures.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Factorization, LinearSolver, Tridiagonal};
///
/// // Dofs 2 – 0 – 1, coupled by springs.
/// let entries = [(0, 0, 3.0), (1, 1, 2.0), (2, 2, 2.0), (0, 1, -1.0), (1, 0, -1.0), (0, 2, -1.0), (2, 0, -1.0)];
/// let entries = entries.map(|(i, j, a)| Triplet::new(i, j, a));
/// let a = SparseColMat::<usize, f64>::try_new_from_triplets(3, 3, &entries)?;
/// let mut factor: Box<dyn Factorization<f64>> = Tridiagonal.analyze(a.symbolic(), &[1])?;
/// factor.factorize(a.as_ref())?;
/// let mut x = [1.0, 1.0, 1.0];
/// factor.solve(&mut x)?;
/// assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-15));
/// assert_eq!(factor.stored_values(), 5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tridiagonal;

impl<T: Real> LinearSolver<T> for Tridiagonal {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        check_analysis(pattern, last)?;
        match strings(pattern, last) {
            Some(strings) => factorization(strings, pattern, last),
            None => Err(Error::Incompatible {
                part: "the tridiagonal solver".into(),
                reason: "the effective matrix is not one of strings with contact at one end each; use Cholesky",
            }),
        }
    }
}

/// The factorization, if the structure consists of strings.
pub(super) fn try_analyze<T: Real>(
    pattern: SymbolicSparseColMatRef<'_, usize>,
    last: &[usize],
) -> Option<Result<Box<dyn Factorization<T>>>> {
    strings(pattern, last).map(|strings| factorization(strings, pattern, last))
}

/// The dofs along all strings, one string after the other.
#[derive(Debug)]
struct Strings {
    order: Vec<usize>,
    /// Start of each string, and start of its contact dofs; the next string follows.
    begins: Vec<[usize; 2]>,
}

/// Finds the strings, with contact at their ends; `None` for another structure or an unsymmetric one.
fn strings(pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Option<Strings> {
    let n = pattern.ncols();
    if pattern.nrows() != n {
        return None;
    }
    let neighbors = |dof: usize| pattern.row_idx_of_col_raw(dof).iter().copied().filter(move |&row| row != dof);
    let is_last = |dof: usize| last.binary_search(&dof).is_ok();
    let (mut order, mut begins) = (Vec::with_capacity(n), Vec::new());
    let mut visited = vec![false; n];
    for start in 0..n {
        if visited[start] || neighbors(start).nth(1).is_some() {
            continue;
        }
        let begin = order.len();
        let (mut dof, mut before) = (start, None);
        loop {
            visited[dof] = true;
            order.push(dof);
            let mut onward = neighbors(dof).filter(|&next| Some(next) != before);
            let next = onward.next();
            // A third neighbor, or the entry to the previous dof is not mirrored.
            if onward.next().is_some() || before.is_some_and(|before| !neighbors(dof).any(|row| row == before)) {
                return None;
            }
            let Some(next) = next.filter(|&next| next < n) else { break };
            if visited[next] {
                return None;
            }
            (before, dof) = (Some(dof), next);
        }
        let string = &mut order[begin..];
        if is_last(string[0]) && !string.last().is_some_and(|&dof| is_last(dof)) {
            string.reverse();
        }
        let interior = string.iter().position(|&dof| is_last(dof)).unwrap_or(string.len());
        if !string[interior..].iter().all(|&dof| is_last(dof)) {
            return None;
        }
        begins.push([begin, begin + interior]);
    }
    // Dofs that are in no string form rings.
    (order.len() == n).then_some(Strings { order, begins })
}

#[derive(Debug)]
struct Factor<T> {
    fingerprint: Fingerprint,
    /// The unknowns along the strings.
    numbering: Selection,
    /// Start of each string, and start of its contact dofs; the last entry is the number of dofs.
    begins: Vec<[usize; 2]>,
    /// L below the diagonal and 1/D along the strings; zero after each string.
    lower: Vec<T>,
    inverse: Vec<T>,
    /// One right-hand side along the strings.
    x: Vec<T>,
    /// Places of the contact dofs along the strings, and in the list of the ends of all strings.
    interface: Vec<usize>,
    places: Vec<usize>,
    /// Starts of the ends of all strings: the end of string s begins at `ends[s]`.
    ends: Vec<usize>,
    on_ends: Vec<T>,
    /// Memory of the check of symmetry.
    cursor: Vec<usize>,
}

fn factorization<T: Real>(
    Strings { order, mut begins }: Strings,
    pattern: SymbolicSparseColMatRef<'_, usize>,
    last: &[usize],
) -> Result<Box<dyn Factorization<T>>> {
    let n = order.len();
    let what = "the factor of a tridiagonal matrix";
    let zeros = || memory::zeros(n, 1, what);
    let mut place_of = vec![0; n];
    order.iter().enumerate().for_each(|(place, &dof)| place_of[dof] = place);
    begins.push([n, n]);
    let mut ends = vec![0];
    for pair in begins.windows(2) {
        ends.push(ends[ends.len() - 1] + pair[1][0] - pair[0][1]);
    }
    let interface: Vec<usize> = last.iter().map(|&dof| place_of[dof]).collect();
    let place = |&place: &usize| {
        let string = begins.partition_point(|[begin, _]| *begin <= place) - 1;
        ends[string] + place - begins[string][1]
    };
    let places = interface.iter().map(place).collect();
    Ok(Box::new(Factor {
        fingerprint: Fingerprint::of(pattern),
        numbering: Selection::new(order),
        begins,
        lower: zeros()?,
        inverse: zeros()?,
        x: zeros()?,
        interface,
        places,
        ends,
        on_ends: vec![T::zero(); last.len()],
        cursor: Vec::new(),
    }))
}

/// The parts of a vector along two consecutive strings.
fn two<T>(x: &mut [T], [first, second]: [Range<usize>; 2]) -> [&mut [T]; 2] {
    let (x, behind) = x.split_at_mut(second.start);
    [&mut x[first], &mut behind[..second.len()]]
}

impl<T: Real> Factor<T> {
    /// Calls `call` for two strings at a time (the second of the last pair may be empty), with their whole ranges and
    /// the ranges before the contact dofs.
    fn pairs(begins: &[[usize; 2]], mut call: impl FnMut([Range<usize>; 2], [Range<usize>; 2])) {
        let count = begins.len() - 1;
        for first in (0..count).step_by(2) {
            let whole = |s: usize| begins[s.min(count)][0]..begins[(s + 1).min(count)][0];
            let interior = |s: usize| begins[s.min(count)][0]..begins[s.min(count)][1];
            call([first, first + 1].map(whole), [first, first + 1].map(interior));
        }
    }

    fn forward(&mut self) {
        let Self { begins, lower, inverse, x, .. } = self;
        Self::pairs(begins, |whole, _| {
            let [lower, inverse] = [&*lower, &*inverse].map(|v| whole.clone().map(|range| &v[range]));
            T::chains_forward(Chains { lower, inverse, x: two(x, whole) });
        });
    }

    /// Backward over `part` of each string, from the solution after it.
    fn backward(&mut self, part: Part) {
        let Self { begins, lower, inverse, x, .. } = self;
        Self::pairs(begins, |whole, interior| {
            let ranges = match part {
                Part::All => whole.clone(),
                Part::Interior => interior,
            };
            let behind = [0, 1].map(|s| match ranges[s].end < whole[s].end {
                true => x[ranges[s].end],
                false => T::zero(),
            });
            let [lower, inverse] = [&*lower, &*inverse].map(|v| ranges.clone().map(|range| &v[range]));
            T::chains_backward(Chains { lower, inverse, x: two(x, ranges) }, behind);
        });
    }

    /// Solves in place for `on_ends`, the contact dofs at the ends of the strings, with the interior eliminated.
    fn solve_ends(&mut self, direction: Ends) {
        let Self { begins, lower, inverse, ends, on_ends, .. } = self;
        for (ends, begins) in ends.windows(2).zip(begins.windows(2)).filter(|(ends, _)| ends[0] < ends[1]) {
            let own = &mut on_ends[ends[0]..ends[1]];
            let range = begins[0][1]..begins[1][0];
            let (lower, inverse) = (&lower[range.clone()], &inverse[range]);
            if direction == Ends::Both {
                T::chains_forward(Chains { lower: [lower, &[]], inverse: [inverse, &[]], x: [&mut *own, &mut []] });
            }
            let chains = Chains { lower: [lower, &[]], inverse: [inverse, &[]], x: [own, &mut []] };
            T::chains_backward(chains, [T::zero(); 2]);
        }
    }
}

/// The unknowns of a backward sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    All,
    Interior,
}

/// Whether the ends are also swept forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ends {
    Backward,
    Both,
}

impl<T: Real> Factorization<T> for Factor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let n = self.x.len();
        self.fingerprint.check(a)?;
        sparse::check_symmetric_in("effective", a, &mut self.cursor)?;
        let Self { numbering, begins, lower, inverse, .. } = self;
        let negligible = negligible::<T>(n);
        // Lower entry, pivot and dof of the previous unknown.
        let mut before = None;
        let mut failed = None;
        let mut string = 0;
        numbering.for_each(|place, dof| {
            if begins[string + 1][0] == place {
                string += 1;
                before = None;
            }
            let entry = sparse::entry(a, dof, dof);
            let pivot = match before {
                None => entry,
                Some((place, other, pivot)) => {
                    let coupling = sparse::entry(a, dof, other);
                    lower[place] = coupling / pivot;
                    entry - lower[place] * coupling
                }
            };
            // False for NaN.
            let sound = pivot > negligible * entry;
            if !sound && failed.is_none() {
                failed = Some(dof);
            }
            inverse[place] = pivot.recip();
            before = Some((place, dof, pivot));
        });
        failed.map_or(Ok(()), |dof| Err(Error::Singular { matrix: "effective matrix", dof }))
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        for column in rhs.chunks_exact_mut(self.x.len().max(1)) {
            self.numbering.gather(column, &mut self.x);
            self.forward();
            self.backward(Part::All);
            self.numbering.scatter(&self.x, column);
        }
        Ok(())
    }

    fn is_symmetric(&self) -> bool {
        true
    }

    fn stored_values(&self) -> usize {
        2 * self.x.len() - (self.begins.len() - 1)
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        Some(self)
    }
}

impl<T: Real> Condensation<T> for Factor<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        self.numbering.gather(rhs, &mut self.x);
        self.forward();
        for (&at, &place) in self.interface.iter().zip(&self.places) {
            self.on_ends[place] = self.x[at];
        }
        self.solve_ends(Ends::Backward);
        for (x, &place) in interface.iter_mut().zip(&self.places) {
            *x = self.on_ends[place];
        }
        Ok(())
    }

    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        for (&x, &at) in interface.iter().zip(&self.interface) {
            self.x[at] = x;
        }
        self.backward(Part::Interior);
        self.numbering.scatter(&self.x, solution);
        Ok(())
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        for column in forces.chunks_exact_mut(self.places.len().max(1)) {
            for (&force, &place) in column.iter().zip(&self.places) {
                self.on_ends[place] = force;
            }
            self.solve_ends(Ends::Both);
            for (x, &place) in column.iter_mut().zip(&self.places) {
                *x = self.on_ends[place];
            }
        }
        Ok(())
    }
}
