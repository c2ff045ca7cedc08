//! Normal modes: the lowest eigenpairs of K φ = ω² M φ, computed or imported, and checked.

use super::lanczos::{Lanczos, Pairs, norms, remove};
use super::pencil::{self, Pencil};
use crate::error::{Error, Result};
use crate::kernels::dense::transposed_product;
use crate::real::Real;
use crate::rounding::{DISTINCT, MODE_RESIDUAL};
use crate::sparse::check_vector;
use faer::sparse::SparseColMatRef;

/// Band width for elastic modes: a narrow band converges with fewer solves.
const BAND: usize = 4;

/// Number of attempts to find a missing mode with new random vectors.
const ATTEMPTS: usize = 8;

/// Normal modes of a body: K φ_k = ω_k² M φ_k, φ_jᵀ M φ_k = δ_jk, by ascending frequency.
///
/// [`lowest`](Self::lowest) and [`up_to`](Self::up_to) compute them by band Lanczos on (K + σM)⁻¹ M with one Cholesky
/// factorization and a small σ > 0, so that bodies need no supports. Rigid motions come first, with ω = 0 exactly; if
/// there are several bodies, all rigid motions of each. Multiple frequencies have all their modes. Completeness is
/// checked: the number of eigenvalues below the last gap is counted by the inertia of K − μM, with a second
/// factorization.
///
/// M may be singular: dofs without mass ([`mass::redistribute`](crate::mass::redistribute)) have no modes of their
/// own and follow the others statically. Modes are `f64` for any scalar of the matrices.
///
/// Memory: two to four vectors per mode during the computation. Intended for at most a few hundred modes, not for all
/// modes of a large body.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::reduction::Modes;
///
/// // A free bar of 200 elements: ω_k = kπ c/L.
/// let (n, c, length) = (200, 100.0, 10.0);
/// let size = length / n as f64;
/// let bar = |diagonal: f64, off: f64| {
///     let element = |e: usize| [(e, e, diagonal), (e + 1, e + 1, diagonal), (e, e + 1, off), (e + 1, e, off)];
///     let entries: Vec<_> = (0..n).flat_map(element).map(|(i, j, x)| Triplet::new(i, j, x)).collect();
///     SparseColMat::<usize, f64>::try_new_from_triplets(n + 1, n + 1, &entries)
/// };
/// let (m, k) = (bar(size / 3.0, size / 6.0)?, bar(c * c / size, -c * c / size)?);
/// let modes = Modes::lowest(m.as_ref(), k.as_ref(), &[], 4)?;
/// assert_eq!((modes.rigid(), modes.frequencies()[0]), (1, 0.0));
/// for (k, omega) in modes.frequencies().iter().enumerate() {
///     assert!((omega - k as f64 * std::f64::consts::PI * c / length).abs() <= 1e-3 * c / length * k as f64);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Modes {
    dofs: usize,
    pub(super) free: Vec<usize>,
    pub(super) frequencies: Vec<f64>,
    /// On the free dofs, column by column.
    pub(super) shapes: Vec<f64>,
    rigid: usize,
    next: f64,
    residual: f64,
    factorizations: usize,
    solves: usize,
}

/// Imported modes, for [`Modes::given`].
#[derive(Clone, Copy, Debug)]
pub struct GivenModes<'a> {
    /// Circular frequencies ω_k (1/time), ascending, zero for rigid motions.
    pub frequencies: &'a [f64],
    /// φ_k one after the other, each with one entry for each dof of the body, zero at supports; φᵀMφ = 1.
    pub shapes: &'a [f64],
    /// The first circular frequency not among them; infinite if all modes are given.
    pub next: f64,
    /// Tolerance for the largest entry of ΦᵀMΦ − I and for the residual of each mode ([`Modes::residual`]): about the
    /// accuracy of the digits in the file.
    pub tolerance: f64,
}

/// Which modes to compute.
#[derive(Clone, Copy, Debug)]
pub(super) enum Wanted {
    Count(usize),
    UpTo(f64),
}

impl Modes {
    /// The `count` lowest modes, including rigid motions, of a body whose dofs `fixed` are held at zero.
    ///
    /// M and K are symmetric with both triangles stored, M positive definite on the dofs that have mass, K positive
    /// semidefinite. If `count` splits a multiple frequency, an arbitrary subset of its modes is returned.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`], [`Error::MatrixNotFinite`], [`Error::Asymmetric`], [`Error::Mass`] for M and K;
    /// [`Error::MissingDof`], [`Error::RepeatedDof`] and [`Error::Empty`] for the supports; [`Error::Parameter`]
    /// for a `count` that is zero, less than there are rigid motions or more than there are free dofs with mass, and
    /// for an eigenvalue that is negative; [`Error::Singular`] for a K that is not semidefinite, or a part with neither
    /// mass nor stiffness; [`Error::ModeResidual`], [`Error::ModesMissed`] if modes are not found to rounding;
    /// [`Error::OutOfMemory`].
    pub fn lowest<T: Real>(
        mass: SparseColMatRef<'_, usize, T>,
        stiffness: SparseColMatRef<'_, usize, T>,
        fixed: &[usize],
        count: usize,
    ) -> Result<Self> {
        Self::of(mass, stiffness, fixed, Wanted::Count(count))
    }

    /// All modes with circular frequencies (1/time) up to `frequency`.
    ///
    /// # Errors
    ///
    /// As [`lowest`](Self::lowest); [`Error::Parameter`] for a frequency that is negative or not finite, and
    /// [`Error::Empty`] if there is no mode below it.
    pub fn up_to<T: Real>(
        mass: SparseColMatRef<'_, usize, T>,
        stiffness: SparseColMatRef<'_, usize, T>,
        fixed: &[usize],
        frequency: f64,
    ) -> Result<Self> {
        Self::of(mass, stiffness, fixed, Wanted::UpTo(frequency))
    }

    fn of<T: Real>(
        mass: SparseColMatRef<'_, usize, T>,
        stiffness: SparseColMatRef<'_, usize, T>,
        fixed: &[usize],
        wanted: Wanted,
    ) -> Result<Self> {
        let dofs = pencil::check(mass, stiffness)?;
        let free = pencil::free_dofs(dofs, fixed)?;
        Self::find(&mut Pencil::new(mass, stiffness, free)?, wanted)
    }

    /// Imported modes, checked against M and K for orthonormality, residuals, and completeness below the last mode.
    /// Rigid modes are recomputed from the given ones, to rounding.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::reduction::{GivenModes, Modes};
    ///
    /// // Two unit masses on a spring of stiffness 2: a rigid motion, and ω = 2.
    /// let entries = [(0, 0, 2.0), (1, 1, 2.0), (0, 1, -2.0), (1, 0, -2.0)].map(|(i, j, x)| Triplet::new(i, j, x));
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &entries)?;
    /// let m = SparseColMat::try_new_from_triplets(2, 2, &[Triplet::new(0, 0, 1.0), Triplet::new(1, 1, 1.0)])?;
    /// let shapes = [0.70711, 0.70711, 0.70711, -0.70711];
    /// let given = GivenModes { frequencies: &[0.0, 2.0], shapes: &shapes, next: f64::INFINITY, tolerance: 1e-4 };
    /// let modes = Modes::given(m.as_ref(), k.as_ref(), &[], &given)?;
    /// assert_eq!(modes.rigid(), 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// As [`lowest`](Self::lowest); [`Error::Dimension`] and [`Error::NotFinite`] for the modes, [`Error::Parameter`]
    /// for frequencies that are negative or do not ascend, and for a tolerance that is not in (0, 0.1];
    /// [`Error::ModeResidual`] for the worst mode, [`Error::ModesMissed`].
    pub fn given<T: Real>(
        mass: SparseColMatRef<'_, usize, T>,
        stiffness: SparseColMatRef<'_, usize, T>,
        fixed: &[usize],
        modes: &GivenModes<'_>,
    ) -> Result<Self> {
        let dofs = pencil::check(mass, stiffness)?;
        let free = pencil::free_dofs(dofs, fixed)?;
        check_given(modes, dofs)?;
        Self::import(&mut Pencil::new(mass, stiffness, free)?, modes)
    }

    fn import(pencil: &mut Pencil, modes: &GivenModes<'_>) -> Result<Self> {
        let count = modes.frequencies.len();
        if count > pencil.rank {
            return Err(too_many(count));
        }
        let n = pencil.size();
        let mut shapes = pencil.restrict(modes.shapes);
        check_orthonormal(pencil, &shapes, modes.tolerance)?;
        let rigid = modes.frequencies.iter().take_while(|&&omega| omega == 0.0).count();
        let given = shapes[..rigid * n].to_vec();
        let polished = polish(pencil, given.clone())?;
        // Rigid motions may have been combined with each other, not with elastic modes: the remaining part is an
        // error.
        let products = pencil.mass.times(&given);
        let mut rest = given;
        remove(n, &polished, &products, &mut rest);
        for (mode, residual) in lengths(pencil, &rest).into_iter().enumerate() {
            within(mode, residual, modes.tolerance)?;
        }
        shapes[..rigid * n].copy_from_slice(&polished);
        shapes = orthonormal(pencil, shapes)?;
        let mut found = Self {
            dofs: pencil.dofs,
            free: pencil.free.clone(),
            frequencies: modes.frequencies.to_vec(),
            shapes,
            rigid,
            next: modes.next,
            residual: 0.0,
            factorizations: 0,
            solves: 0,
        };
        check_rigid(pencil, &found, modes.tolerance)?;
        found.residual = found.worst_residual(pencil, modes.tolerance)?;
        let below = match modes.next.is_finite() {
            true => count_between(pencil, modes.frequencies[count - 1].powi(2), modes.next.powi(2))?,
            false => Some(pencil.rank),
        };
        if below != Some(count) {
            let frequency = if modes.next.is_finite() { modes.next } else { modes.frequencies[count - 1] };
            return Err(Error::ModesMissed { found: count, expected: below.unwrap_or(0), frequency });
        }
        (found.factorizations, found.solves) = (pencil.factorizations, pencil.solves);
        Ok(found)
    }

    /// Computes the modes.
    pub(super) fn find(pencil: &mut Pencil, wanted: Wanted) -> Result<Self> {
        match wanted {
            Wanted::Count(0) => {
                return Err(Error::Parameter { name: "the number of modes", value: 0.0, range: "at least one" });
            }
            Wanted::Count(count) if count > pencil.rank => return Err(too_many(count)),
            Wanted::UpTo(omega) if !(omega >= 0.0 && omega.is_finite()) => {
                let name = "the highest circular frequency of the modes";
                return Err(Error::Parameter { name, value: omega, range: "finite and not negative" });
            }
            _ => {}
        }
        let (rigid, mut lanczos) = rigid_motions(pencil)?;
        let n = pencil.size();
        let zeros = rigid.len() / n;
        if let Wanted::Count(count) = wanted
            && count < zeros
        {
            let range = "at least the number of rigid motions, which no reduction can do without";
            return Err(Error::Parameter { name: "the number of modes", value: count as f64, range });
        }
        for _ in 0..ATTEMPTS {
            let (pairs, cut) = converge(pencil, &mut lanczos, zeros, wanted)?;
            let below = match cut.next {
                Some(next) => count_between(pencil, cut.last, next)?,
                None => Some(pencil.rank),
            };
            if below != Some(cut.distinct) {
                if cut.next.is_none() || below.is_none_or(|below| below < cut.distinct) {
                    return Err(Error::ModesMissed {
                        found: cut.distinct,
                        expected: below.unwrap_or(0),
                        frequency: cut.next.unwrap_or(cut.last).sqrt(),
                    });
                }
                // A multiple frequency with more modes than the width of the band: another start finds the others.
                lanczos.draw(pencil)?;
                continue;
            }
            let mut shapes = rigid;
            shapes.extend(purified(pencil, lanczos.vectors(&pairs, cut.count - zeros)?)?);
            if pencil.rank < n {
                // Removing the null space of M may have left components of lower modes: orthonormalize again.
                shapes = orthonormal(pencil, shapes)?;
            }
            return Self::checked(pencil, shapes, zeros, cut.next);
        }
        Err(Error::ModesMissed { found: lanczos.count(), expected: pencil.rank, frequency: 0.0 })
    }

    /// Modes with their Rayleigh quotients, if their residuals are within tolerance.
    fn checked(pencil: &mut Pencil, shapes: Vec<f64>, rigid: usize, next: Option<f64>) -> Result<Self> {
        let n = pencil.size();
        check_orthonormal(pencil, &shapes, MODE_RESIDUAL)?;
        let products = pencil.stiffness.times(&shapes);
        let quotients: Vec<f64> =
            shapes.chunks_exact(n).zip(products.chunks_exact(n)).map(|(x, f)| pencil.quotient(x, f)).collect();
        if let Some(&value) = quotients.iter().find(|&&quotient| quotient < 0.0) {
            return Err(Error::Parameter { name: "an eigenvalue ω² of the body", value, range: "not negative" });
        }
        let more = quotients.iter().skip(rigid).filter(|&&quotient| quotient == 0.0).count();
        let frequencies = quotients.iter().enumerate().map(|(k, &x)| if k < rigid { 0.0 } else { x.sqrt() }).collect();
        let mut modes = Self {
            dofs: pencil.dofs,
            free: pencil.free.clone(),
            frequencies,
            shapes,
            rigid: rigid + more,
            next: next.map_or(f64::INFINITY, f64::sqrt),
            residual: 0.0,
            factorizations: pencil.factorizations,
            solves: 0,
        };
        modes.residual = modes.worst_residual(pencil, MODE_RESIDUAL)?;
        modes.solves = pencil.solves;
        Ok(modes)
    }

    /// The largest residual of the elastic modes; rejects residuals beyond a tolerance.
    fn worst_residual(&self, pencil: &mut Pencil, tolerance: f64) -> Result<f64> {
        let n = pencil.size();
        let (rigid, elastic) = self.shapes.split_at(self.rigid * n);
        let (mut worst, mut mode) = (0.0_f64, self.rigid);
        for block in elastic.chunks(8 * n) {
            let mut rest = pencil.mass.times(block);
            pencil.solve(&mut rest)?;
            for (k, (x, y)) in block.chunks_exact(n).zip(rest.chunks_exact_mut(n)).enumerate() {
                let inverse = self.frequencies[mode + k].powi(2) + pencil.shift;
                x.iter().zip(y).for_each(|(x, y)| *y = *x - inverse * *y);
            }
            // Rounding in rigid motions is amplified by 1/σ and is no error of the mode.
            let products = pencil.mass.times(&rest);
            remove(n, rigid, &products, &mut rest);
            for residual in lengths(pencil, &rest) {
                let blurred = pencil.blur / (self.frequencies[mode].powi(2) + pencil.shift);
                within(mode, residual, tolerance + blurred)?;
                worst = worst.max(residual);
                mode += 1;
            }
        }
        Ok(worst)
    }

    /// Circular frequencies ω_k (1/time), ascending; zero for rigid motions.
    pub fn frequencies(&self) -> &[f64] {
        &self.frequencies
    }

    /// Number of modes.
    pub fn count(&self) -> usize {
        self.frequencies.len()
    }

    /// Number of rigid motions, which come first: one for a free bar, three in the plane, six in space.
    pub fn rigid(&self) -> usize {
        self.rigid
    }

    /// The first circular frequency beyond the modes (1/time); infinite if these are all modes.
    pub fn next_frequency(&self) -> f64 {
        self.next
    }

    /// φ_k on all dofs of the body, zero at supports.
    ///
    /// # Panics
    ///
    /// If there is no mode `k`.
    pub fn shape(&self, k: usize) -> Vec<f64> {
        let n = self.free.len();
        let mut shape = vec![0.0; self.dofs];
        self.free.iter().zip(&self.shapes[k * n..(k + 1) * n]).for_each(|(&dof, &x)| shape[dof] = x);
        shape
    }

    /// The largest residual of the elastic modes, ‖φ − (ω² + σ)(K + σM)⁻¹Mφ‖ in the norm of M: an upper bound of the
    /// relative distance of ω² + σ from an eigenvalue.
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// Number of sparse factorizations for computing and checking the modes.
    pub fn factorizations(&self) -> usize {
        self.factorizations
    }

    /// Number of right-hand sides solved for computing and checking the modes, several at a time. A lower bound of
    /// the cost: no eigensolver that solves as many on these matrices can be faster.
    pub fn solves(&self) -> usize {
        self.solves
    }

    /// Number of dofs of the body, including supports.
    pub fn dofs(&self) -> usize {
        self.dofs
    }
}

fn too_many(count: usize) -> Error {
    let range = "at most the number of free dofs with mass";
    Error::Parameter { name: "the number of modes", value: count as f64, range }
}

/// End of the wanted modes among the computed ones.
struct Cut {
    /// Number of wanted modes, and number of modes up to the first gap after them.
    count: usize,
    distinct: usize,
    /// Eigenvalues on both sides of the gap; `next` is `None` after the last mode.
    last: f64,
    next: Option<f64>,
}

/// The cut, if the computed pairs extend beyond it; `zeros` rigid motions come before them.
fn cut(values: &[f64], zeros: usize, wanted: Wanted, all: bool) -> Result<Option<Cut>> {
    let value = |k: usize| if k < zeros { 0.0 } else { values[k - zeros] };
    let found = zeros + values.len();
    let count = match wanted {
        Wanted::Count(count) => count,
        Wanted::UpTo(omega) => (0..found).take_while(|&k| value(k) <= omega * omega).count(),
    };
    if found < count || (found == count && !all) {
        return Ok(None);
    }
    if count == 0 {
        return Err(Error::Empty { what: "the list of modes", remedy: "ask for a higher frequency" });
    }
    let last = value(count - 1);
    let distinct = (count..found).find(|&k| value(k) > last * (1.0 + DISTINCT)).unwrap_or(found);
    if distinct == found && !all {
        return Ok(None);
    }
    let last = value(distinct - 1);
    Ok(Some(Cut { count, distinct, last, next: (distinct < found).then(|| value(distinct)) }))
}

/// Iterates until the wanted modes, and the first one after them, have converged.
fn converge(pencil: &mut Pencil, lanczos: &mut Lanczos, zeros: usize, wanted: Wanted) -> Result<(Pairs, Cut)> {
    let mut check = match wanted {
        Wanted::Count(count) => lanczos.count() + count.saturating_sub(zeros) + lanczos.block,
        Wanted::UpTo(_) => lanczos.count() + 2 * lanczos.block,
    };
    loop {
        lanczos.advance(pencil)?;
        if lanczos.count() < check && !lanczos.exhausted {
            continue;
        }
        check = lanczos.count() + (lanczos.count() / 8).max(lanczos.block);
        let pairs = lanczos.pairs(pencil.shift).ok_or(Error::ModesMissed {
            found: 0,
            expected: pencil.rank,
            frequency: 0.0,
        })?;
        let all = lanczos.exhausted && zeros + pairs.values.len() == zeros + lanczos.count();
        if let Some(cut) = cut(&pairs.values, zeros, wanted, all)? {
            return Ok((pairs, cut));
        }
        if lanczos.exhausted {
            let (found, frequency) = (zeros + pairs.values.len(), pairs.values.last().map_or(0.0, |x| x.sqrt()));
            return Err(Error::ModesMissed { found, expected: pencil.rank, frequency });
        }
    }
}

/// The rigid motions, M-orthonormal, and a Lanczos iteration orthogonal to them.
///
/// They are computed first: next to their eigenvalue 1/σ the eigenvalues of elastic modes would be lost in rounding.
fn rigid_motions(pencil: &mut Pencil) -> Result<(Vec<f64>, Lanczos)> {
    let n = pencil.size();
    let block = (6 * pencil.bodies() + 2).clamp(8, 64).min(pencil.rank);
    let mut lanczos = Lanczos::new(n, block, Vec::new());
    loop {
        lanczos.advance(pencil)?;
        let Some(pairs) = lanczos.pairs(pencil.shift) else { continue };
        let low = pairs.values.iter().take_while(|&&value| value < 0.5 * pencil.shift).count();
        let vectors = purified(pencil, lanczos.vectors(&pairs, low)?)?;
        let products = pencil.stiffness.times(&vectors);
        let is_rigid = |(x, f)| pencil.quotient(x, f) == 0.0;
        let rigid = vectors.chunks_exact(n).zip(products.chunks_exact(n)).take_while(|&pair| is_rigid(pair)).count();
        if rigid == pairs.values.len() && !lanczos.exhausted {
            continue;
        }
        if rigid == 0 {
            lanczos.block = BAND.min(lanczos.block);
            return Ok((Vec::new(), lanczos));
        }
        let rigid = polish(pencil, vectors[..rigid * n].to_vec())?;
        let block = BAND.min(pencil.rank - rigid.len() / n).max(1);
        let mut elastic = Lanczos::new(n, block, rigid.clone());
        elastic.draw(pencil)?;
        return Ok((rigid, elastic));
    }
}

/// Vectors without components in the null space of M, if it is singular.
fn purified(pencil: &mut Pencil, vectors: Vec<f64>) -> Result<Vec<f64>> {
    let n = pencil.size();
    if pencil.rank == n || vectors.is_empty() {
        return Ok(vectors);
    }
    let mut pure = pencil.mass.times(&vectors);
    pencil.solve(&mut pure)?;
    let lengths = lengths(pencil, &pure);
    for (vector, length) in pure.chunks_exact_mut(n).zip(lengths) {
        for x in vector {
            *x /= length;
        }
    }
    Ok(pure)
}

/// Rigid motions after two steps of inverse iteration, M-orthonormal.
fn polish(pencil: &mut Pencil, mut vectors: Vec<f64>) -> Result<Vec<f64>> {
    for _ in 0..2 {
        let mut products = pencil.mass.times(&vectors);
        if !products.is_empty() {
            pencil.solve(&mut products)?;
        }
        vectors = orthonormal(pencil, products)?;
    }
    Ok(vectors)
}

/// Makes vectors M-orthonormal, one by one.
fn orthonormal(pencil: &mut Pencil, mut vectors: Vec<f64>) -> Result<Vec<f64>> {
    let n = pencil.size();
    for k in 0..vectors.len() / n {
        let (done, rest) = vectors.split_at_mut(k * n);
        let vector = &mut rest[..n];
        // Normalize first: rigid motions from a solve have length of order 1/σ.
        for pass in 0..3 {
            if pass > 0 {
                let product = pencil.mass.times(vector);
                remove(n, done, &product, vector);
            }
            let length = lengths(pencil, vector)[0];
            if !(length > 0.0 && length.is_finite()) {
                return Err(Error::ModeResidual { mode: k, residual: 1.0, tolerance: MODE_RESIDUAL });
            }
            for x in vector.iter_mut() {
                *x /= length;
            }
        }
    }
    Ok(vectors)
}

/// Lengths of vectors in the norm of M.
fn lengths(pencil: &mut Pencil, vectors: &[f64]) -> Vec<f64> {
    let n = pencil.size();
    let products = pencil.mass.times(vectors);
    norms(n, vectors, &products)
}

/// Rejects a residual that is beyond a tolerance or NaN.
fn within(mode: usize, residual: f64, tolerance: f64) -> Result<()> {
    match residual <= tolerance {
        true => Ok(()),
        false => Err(Error::ModeResidual { mode, residual, tolerance }),
    }
}

fn check_orthonormal(pencil: &mut Pencil, shapes: &[f64], tolerance: f64) -> Result<()> {
    let n = pencil.size();
    let count = shapes.len() / n;
    let (products, mut gram) = (pencil.mass.times(shapes), vec![0.0; count * count]);
    transposed_product(n, shapes, &products, &mut gram);
    for (place, value) in gram.into_iter().enumerate() {
        let (row, column) = (place % count, place / count);
        within(row.max(column), (value - f64::from(u8::from(row == column))).abs(), tolerance)?;
    }
    Ok(())
}

/// Rejects motions given as rigid that have strain energy, relative to the first elastic mode or to an element.
fn check_rigid(pencil: &mut Pencil, modes: &Modes, tolerance: f64) -> Result<()> {
    let n = pencil.size();
    let rigid = &modes.shapes[..modes.rigid * n];
    let products = pencil.stiffness.times(rigid);
    let scale = modes.frequencies.get(modes.rigid).map_or(pencil.shift, |omega| omega * omega);
    for (mode, (x, f)) in rigid.chunks_exact(n).zip(products.chunks_exact(n)).enumerate() {
        within(mode, (pencil.quotient(x, f) / scale).abs(), tolerance)?;
    }
    Ok(())
}

fn check_given(modes: &GivenModes<'_>, dofs: usize) -> Result<()> {
    let GivenModes { frequencies, shapes, next, tolerance } = *modes;
    if frequencies.is_empty() {
        return Err(Error::Empty { what: "the list of modes", remedy: "give at least one" });
    }
    check_vector("the frequencies of the modes", frequencies, frequencies.len())?;
    check_vector("the shapes of the modes", shapes, dofs * frequencies.len())?;
    let last = frequencies[frequencies.len() - 1];
    let ascending = frequencies.windows(2).find(|pair| pair[0] > pair[1]).map(|pair| pair[1]);
    if let Some(value) = ascending.or(Some(frequencies[0]).filter(|&omega| omega < 0.0)) {
        return Err(Error::Parameter { name: "a frequency of a mode", value, range: "not negative, and ascending" });
    }
    if next.is_nan() || next <= last {
        let name = "the first frequency that is not among the modes";
        return Err(Error::Parameter { name, value: next, range: "above the last one among them" });
    }
    match tolerance > 0.0 && tolerance <= 0.1 {
        true => Ok(()),
        false => Err(Error::Parameter { name: "the tolerance of modes", value: tolerance, range: "in (0, 0.1]" }),
    }
}

/// Number of eigenvalues below a point between two; `None` if every factorization fails.
fn count_between(pencil: &mut Pencil, last: f64, next: f64) -> Result<Option<usize>> {
    for share in [0.5, 0.4375, 0.625] {
        if let Some(count) = pencil.count_below(last + share * (next - last))? {
            return Ok(Some(count));
        }
    }
    Ok(None)
}
