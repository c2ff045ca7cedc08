//! Mass redistribution: moves the mass of contact dofs to others.

use super::assembly::{check_dofs, flags};
use super::inverse::check_definite;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::sparse::{self, assembled, check_vector};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef};
use std::collections::BTreeMap;

/// Which dofs receive the mass of the dofs that [`redistribute`] and [`redistribute_consistent`] make massless.
///
/// Mass stays within its group. Each option is the smallest change, Σ δᵢ²/mᵢ for masses mᵢ, under its conditions
/// (theory, section 14); the options differ in how far mass may move and in the quantities kept besides the total.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Redistribution<'a> {
    /// The neighbors of each massless dof that keep mass, in proportion to their mass (Hager, Hüeber, Wohlmuth, Int.
    /// J. Numer. Methods Eng. 73, 2008, do the same by quadrature in the elements at the contact boundary).
    ///
    /// Neighbors are the dofs of the same group in the dof's column of this pattern, usually the pattern of the
    /// stiffness matrix; stored zeros count. Each group keeps its total. Its center of mass moves inward by the order
    /// of h_e², and its inertia changes as much; frequencies change by the order of h_e³. The end of a uniform bar
    /// gives its neighbor 3/2 of its mass.
    Neighbors(SymbolicSparseColMatRef<'a, usize>),
    /// All dofs of the group that keep mass, in proportion to their mass: the body becomes denser.
    ///
    /// Each group keeps its total. Centers of mass, inertia and frequencies change by the order of h_e.
    Uniform,
    /// As `Uniform`, but the neighbors of massless dofs also give away a fraction of their mass.
    ///
    /// The mass then increases gradually behind the contact, so that the force of an impact rises without overshoot:
    /// between bars a fraction of 0.15 reduces the overshoot from 8 % to 3 % (docs/corrections.md). Each group keeps
    /// its total; otherwise as for `Uniform`.
    Tapered {
        /// Neighbors are the dofs of the same group in the column of a massless dof of this pattern, usually the
        /// pattern of the stiffness matrix.
        neighbors: SymbolicSparseColMatRef<'a, usize>,
        /// In [0, 1), relative to their row sums of M.
        fraction: f64,
    },
    /// The smallest change that keeps ψᵀ M ψ′ for every pair of given motions in each group (Khenous, Laborde, Renard
    /// 2008, with the mass norm instead of the norm of the entries of M).
    ///
    /// With the [`affine_motions`] 1, x, y, z these are total mass, center of mass and all second moments: momentum
    /// and kinetic energy of every rigid and every affine motion are kept. Frequencies still change by the order of
    /// h_e if the whole body takes part, because mass must come from far away (theory, section 14).
    ///
    /// On coarse meshes a mass would become negative, which is an error: a block needs 4 layers of elements for a
    /// whole massless side.
    LeastSquares {
        /// Motions ψ, each with one value per dof. Only values within a group are multiplied with each other.
        motions: &'a [Vec<f64>],
        /// Dofs that may receive mass, in any order; massless ones among them are skipped. `None`: all of the group.
        ///
        /// If only dofs near the massless ones receive mass, the rest of the body is unchanged. The fewer they are,
        /// the sooner a mass becomes negative.
        receivers: Option<&'a [usize]>,
    },
}

/// Moves the mass of some dofs to others, for a lumped mass (Khenous, Laborde, Renard, Eur. J. Mech. A/Solids 27,
/// 2008).
///
/// Without mass at contact dofs the contact force causes no velocity jump: a semi-discrete solution has bounded
/// accelerations and conserves energy, also at impact. The balance of such a dof is static, and M has no inverse.
///
/// `massless` lists dofs in any order: the contact nodes' dofs in the normal direction if that is along an axis,
/// otherwise in all directions. `groups` gives every dof a number as in [`lump_diagonal`](super::lump_diagonal); mass
/// stays among dofs with the same number. Directions must be separate groups (`dof % 3`), bodies should be. Groups
/// without massless dofs are unchanged. Give supports a group of their own, since mass moved to them would be lost to
/// the motion.
///
/// The result is zero on massless dofs and positive on all others. If only normal directions are massless, the masses
/// of a node differ between directions: each direction keeps its own inertia, but for a node that rotates far this is
/// no longer the inertia of a body. For large rotations make all directions massless.
///
/// # Errors
///
/// [`Error::Dimension`] for sizes that disagree, [`Error::MissingDof`] for listed dofs out of range; [`Error::Mass`]
/// for a mass that is not positive (zero is allowed on massless dofs) or would not be in the result, with the dof and
/// that mass; [`Error::Incompatible`] if no dof can receive the mass of another one, or no dofs can keep the motions;
/// [`Error::Empty`], [`Error::NotFinite`] for the motions.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::mass::{self, Redistribution};
/// // A bar of three elements of mass 4 that touches with its first node.
/// let k = [(0, 0, 1.0), (1, 1, 2.0), (2, 2, 2.0), (3, 3, 1.0), (0, 1, -1.0), (1, 0, -1.0), (1, 2, -1.0), (2, 1, -1.0),
///     (2, 3, -1.0), (3, 2, -1.0)];
/// let k = SparseColMat::<usize, f64>::try_new_from_triplets(4, 4, &k.map(|(i, j, k)| Triplet::new(i, j, k)))?;
/// let lumped = [2.0, 4.0, 4.0, 2.0];
/// let near = mass::redistribute(&lumped, &[0], &[0; 4], Redistribution::Neighbors(k.symbolic()))?;
/// assert_eq!(near, [0.0, 6.0, 4.0, 2.0]);
/// let far = mass::redistribute(&lumped, &[0], &[0; 4], Redistribution::Uniform)?;
/// assert_eq!(far, [0.0, 4.8, 4.8, 2.4]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn redistribute<T: Real>(
    mass: &[T],
    massless: &[usize],
    groups: &[usize],
    by: Redistribution<'_>,
) -> Result<Vec<T>> {
    let mut loss = Loss::new(mass, massless, groups)?;
    for (dof, &m) in loss.mass.iter().enumerate() {
        if loss.massless[dof] { &mut loss.lost } else { &mut loss.kept }.push((dof, dof, m));
    }
    let change = loss.compensation(by, rounding(T::one()).value())?;
    let redistributed: Vec<T> = loss.diagonal(&change);
    loss.check(&redistributed)?;
    Ok(redistributed)
}

/// As [`redistribute`] for a consistent or blended mass matrix, both triangles stored.
///
/// Rows and columns of the massless dofs are left out. Other dofs get the couplings that they lose added to their
/// diagonal, so that their row sums stay; the row sums of the massless dofs, which are their lumped masses, are then
/// distributed. Neighbors get their shares on the diagonal, in proportion to the diagonal of M. The other options
/// change the density, Mᵢⱼ(1 + pᵢ/2 + pⱼ/2): the matrix keeps the form of a consistent mass, and a lumped mass is a
/// special case.
///
/// With [`Redistribution::Uniform`], lumping the result is the same as [`redistribute`] of the lumped mass; with
/// neighbors too, if the diagonal is proportional to the row sums (one kind of linear element with constant Jacobian).
/// Least squares keep the inertia of this matrix, which differs from the inertia of the lumped one.
///
/// Nonnegative shares of neighbors keep M positive definite on the dofs that keep mass. In all other cases (couplings
/// of quadratic elements are negative, density may fall) the result is factorized once to check it. Entries between
/// dofs of different groups belong to no group and are lost if one of the dofs is massless.
///
/// Rows and columns of massless dofs have no stored entries, and no zeros are stored elsewhere: a diagonal result has
/// a diagonal pattern.
///
/// # Errors
///
/// As [`redistribute`]; [`Error::MatrixNotFinite`], [`Error::Asymmetric`] for the matrix, [`Error::Singular`] if
/// the result is not positive definite on the dofs that keep mass.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::mass::{self, Redistribution};
/// // Two linear bar elements of mass 6.
/// let m = [(0, 0, 2.0), (1, 1, 4.0), (2, 2, 2.0), (0, 1, 1.0), (1, 0, 1.0), (1, 2, 1.0), (2, 1, 1.0)];
/// let m = SparseColMat::try_new_from_triplets(3, 3, &m.map(|(i, j, m)| Triplet::new(i, j, m)))?;
/// let near = Redistribution::Neighbors(m.symbolic());
/// let cut = mass::redistribute_consistent(m.as_ref(), &[0], &[0; 3], near)?;
/// // [8 1; 1 2] on the last two dofs: 4 + 1 lost with the coupling + 3 of the first node.
/// assert_eq!(cut.val(), [8.0, 1.0, 1.0, 2.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn redistribute_consistent<T: Real>(
    mass: SparseColMatRef<'_, usize, T>,
    massless: &[usize],
    groups: &[usize],
    by: Redistribution<'_>,
) -> Result<SparseColMat<usize, T>> {
    sparse::check_symmetric("mass", mass)?;
    let n = mass.ncols();
    let diagonal: Vec<T> = (0..n).map(|dof| sparse::entry(mass, dof, dof)).collect();
    let mut loss = Loss::new(&diagonal, massless, groups)?;
    for column in 0..n {
        for (&row, &value) in mass.row_idx_of_col_raw(column).iter().zip(mass.val_of_col(column)) {
            if groups[row] == groups[column] {
                let lost = loss.massless[row] || loss.massless[column];
                if lost { &mut loss.lost } else { &mut loss.kept }.push((row, column, value.value()));
            }
        }
    }
    let change = loss.compensation(by, rounding(T::one()).value())?;
    let diagonal: Vec<T> = loss.diagonal(&change);
    loss.check(&diagonal)?;
    let keeps = |dof: &usize| !loss.massless[*dof];
    let mut entries: Vec<(usize, usize, T)> = (0..n).filter(keeps).map(|dof| (dof, dof, diagonal[dof])).collect();
    for column in (0..n).filter(keeps) {
        for (&row, &value) in mass.row_idx_of_col_raw(column).iter().zip(mass.val_of_col(column)) {
            if row != column && keeps(&row) && value != T::zero() {
                let density = 1.0 + 0.5 * (change.density[row] + change.density[column]);
                entries.push((row, column, T::of(density * value.value())));
            }
        }
    }
    let result = assembled(n, entries)?;
    if change.added.iter().any(|&m| m < 0.0) || change.density.iter().any(|&p| p != 0.0) {
        let massless: Vec<usize> = (0..n).filter(|&dof| loss.massless[dof]).collect();
        check_definite(result.as_ref(), &massless)?;
    }
    Ok(result)
}

/// The motions 1, x, y, z of [`Redistribution::LeastSquares`]: one value per dof, coordinates relative to their mean,
/// the same in each direction of a node.
///
/// `coordinates` and `dofs` are given by node; `size` is the number of dofs of the system. Dofs of no node get zeros:
/// they receive no mass.
///
/// A rigid motion moves direction x by a + ω_y z − ω_z y: for rigid motions alone the coordinates **across** a
/// direction would suffice. All of them are kept so that the result does not depend on the axes; this costs no more.
///
/// # Errors
///
/// [`Error::Dimension`] unless there are dofs for each node, [`Error::MissingDof`] for dofs out of range,
/// [`Error::NotFinite`] for coordinates.
///
/// ```
/// use contact_dynamics::mass::{self, Redistribution};
/// // A bar of eight elements of mass 2; its first node becomes massless.
/// let lumped = [1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.0];
/// let x: [[f64; 1]; 9] = std::array::from_fn(|node| [node as f64]);
/// let motions = mass::affine_motions(9, &x, &std::array::from_fn::<_, 9, _>(|node| [node]))?;
/// let by = Redistribution::LeastSquares { motions: &motions, receivers: None };
/// let m = mass::redistribute(&lumped, &[0], &[0; 9], by)?;
/// let moment = |m: &[f64], k: i32| m.iter().zip(&x).map(|(m, [x])| m * x.powi(k)).sum::<f64>();
/// assert!((0..3).all(|k| (moment(&m, k) / moment(&lumped, k) - 1.0).abs() < 1e-14));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn affine_motions<T: Real, const D: usize>(
    size: usize,
    coordinates: &[[T; D]],
    dofs: &[[usize; D]],
) -> Result<Vec<Vec<f64>>> {
    if dofs.len() != coordinates.len() {
        let what = "dofs of the nodes";
        return Err(Error::Dimension { what, expected: coordinates.len(), found: dofs.len() });
    }
    let values = coordinates.as_flattened();
    check_vector("coordinates of the nodes", values, values.len())?;
    check_dofs("the dofs of the nodes", dofs.as_flattened(), size)?;
    let mut motions = vec![vec![0.0; size]; D + 1];
    for axis in 0..D {
        let mean = coordinates.iter().map(|x| x[axis].value() / coordinates.len() as f64).sum::<f64>();
        for (x, dofs) in coordinates.iter().zip(dofs) {
            for &dof in dofs {
                motions[0][dof] = 1.0;
                motions[axis + 1][dof] = x[axis].value() - mean;
            }
        }
    }
    Ok(motions)
}

/// A mass matrix before the rows and columns of its massless dofs are removed.
struct Loss<'a> {
    groups: &'a [usize],
    massless: Vec<bool>,
    /// The diagonal of the matrix.
    mass: Vec<f64>,
    /// Row, column and value of the entries that are removed and kept, without entries between groups.
    lost: Vec<(usize, usize, f64)>,
    kept: Vec<(usize, usize, f64)>,
}

/// The change of the kept entries: Mᵢⱼ ← (Mᵢⱼ + δᵢⱼ addedᵢ)(1 + ½ densityᵢ + ½ densityⱼ).
struct Change {
    added: Vec<f64>,
    density: Vec<f64>,
}

impl<'a> Loss<'a> {
    /// Without entries.
    fn new<T: Real>(mass: &[T], massless: &[usize], groups: &'a [usize]) -> Result<Self> {
        let n = mass.len();
        if groups.len() != n {
            return Err(Error::Dimension { what: "groups of the mass matrix", expected: n, found: groups.len() });
        }
        let massless = flags("the list of massless dofs", massless, n)?;
        let values = mass.iter().map(|m| m.value()).collect();
        let loss = Self { groups, massless, mass: values, lost: Vec::new(), kept: Vec::new() };
        loss.check(mass)?;
        Ok(loss)
    }

    /// The diagonal of the result, zero on massless dofs.
    fn diagonal<T: Real>(&self, change: &Change) -> Vec<T> {
        let new = |dof: usize| match self.massless[dof] {
            true => 0.0,
            false => (self.mass[dof] + change.added[dof]) * (1.0 + change.density[dof]),
        };
        (0..self.mass.len()).map(|dof| T::of(new(dof))).collect()
    }

    /// Rejects masses that are not positive; zero is allowed on massless dofs.
    fn check<T: Real>(&self, mass: &[T]) -> Result<()> {
        let wrong = |(&m, &massless): (&T, &bool)| !((m > T::zero() || massless && m == T::zero()) && m.is_finite());
        match mass.iter().zip(&self.massless).position(wrong) {
            Some(dof) => Err(Error::Mass { dof, value: mass[dof].value() }),
            None => Ok(()),
        }
    }

    /// The change that returns the lost mass; `rounding` is the relative rounding of sums of the input.
    fn compensation(&self, by: Redistribution<'_>, rounding: f64) -> Result<Change> {
        let n = self.mass.len();
        // A row that keeps mass gets lost couplings back on its diagonal; the row sum of a massless dof goes to other
        // dofs.
        let (mut change, mut given) = (Change { added: vec![0.0; n], density: vec![0.0; n] }, vec![0.0; n]);
        for &(row, _, value) in &self.lost {
            let sums = if self.massless[row] { &mut given } else { &mut change.added };
            sums[row] += value;
        }
        match by {
            Redistribution::Neighbors(graph) => {
                check_graph(graph, n)?;
                for dof in (0..n).filter(|&dof| given[dof] != 0.0) {
                    let neighbors = || self.neighbors(graph, dof);
                    let total: f64 = neighbors().map(|other| self.mass[other]).sum();
                    check_receivers(dof, total)?;
                    neighbors().for_each(|other| change.added[other] += given[dof] * self.mass[other] / total);
                }
            }
            Redistribution::Uniform => self.spread(&given, &mut change)?,
            Redistribution::Tapered { neighbors: graph, fraction } => {
                check_graph(graph, n)?;
                if !(0.0..1.0).contains(&fraction) {
                    let name = "the fraction of mass that neighbors give away";
                    return Err(Error::Parameter { name, value: fraction, range: "in [0, 1)" });
                }
                let mut sums = change.added.clone();
                self.kept.iter().for_each(|&(row, _, value)| sums[row] += value);
                for dof in (0..n).filter(|&dof| self.massless[dof]) {
                    // A neighbor of several massless dofs gives mass only once.
                    for other in self.neighbors(graph, dof) {
                        let part = fraction * std::mem::take(&mut sums[other]);
                        change.added[other] -= part;
                        given[dof] += part;
                    }
                }
                self.spread(&given, &mut change)?;
            }
            Redistribution::LeastSquares { motions, receivers } => {
                check_motions(motions, n)?;
                let listed = receivers.map(|list| flags("the list of receivers", list, n)).transpose()?;
                for group in self.by_group(|dof| listed.as_ref().is_none_or(|listed| listed[dof])) {
                    check_receivers(group.massless[0], group.receivers.len() as f64)?;
                    self.least_squares(&group, motions, rounding, &mut change)?;
                }
            }
        }
        Ok(change)
    }

    /// The neighbors of a dof in its group that keep mass.
    fn neighbors<'g>(
        &'g self,
        graph: SymbolicSparseColMatRef<'g, usize>,
        dof: usize,
    ) -> impl Iterator<Item = usize> + 'g {
        let of_group = move |other: &usize| !self.massless[*other] && self.groups[*other] == self.groups[dof];
        graph.row_idx_of_col_raw(dof).iter().copied().filter(of_group)
    }

    /// Distributes the mass `given` of massless dofs to all others of their groups, as density.
    fn spread(&self, given: &[f64], change: &mut Change) -> Result<()> {
        for group in self.by_group(|_| true) {
            let kept = group.kept.iter().map(|entry| entry.2).sum::<f64>();
            let total = kept + group.receivers.iter().map(|&dof| change.added[dof]).sum::<f64>();
            check_receivers(group.massless[0], total)?;
            let sum: f64 = group.massless.iter().map(|&dof| given[dof]).sum();
            group.receivers.iter().for_each(|&dof| change.density[dof] = sum / total);
        }
        Ok(())
    }

    /// The groups that lose mass, with their dofs that keep mass and may receive more.
    fn by_group(&self, receives: impl Fn(usize) -> bool) -> Vec<Group> {
        let mut groups: BTreeMap<usize, Group> = BTreeMap::new();
        for (dof, group) in self.groups.iter().enumerate().filter(|(dof, _)| self.massless[*dof]) {
            groups.entry(*group).or_default().massless.push(dof);
        }
        for (dof, group) in self.groups.iter().enumerate().filter(|(dof, _)| !self.massless[*dof] && receives(*dof)) {
            if let Some(group) = groups.get_mut(group) {
                group.receivers.push(dof);
            }
        }
        for &entry in &self.lost {
            if let Some(group) = groups.get_mut(&self.groups[entry.0]) {
                group.lost.push(entry);
            }
        }
        for &entry in &self.kept {
            if let Some(group) = groups.get_mut(&self.groups[entry.0]) {
                group.kept.push(entry);
            }
        }
        groups.into_values().collect()
    }

    /// Writes the density p of least Σ mᵢ pᵢ² that compensates the loss of ψᵀ M ψ′ for all pairs ψ, ψ′.
    ///
    /// The condition of a pair is Σ aᵢ pᵢ = b, with aᵢ = ½(ψᵢ (Bψ′)ᵢ + ψ′ᵢ (Bψ)ᵢ) and the kept matrix B. With the
    /// weights mᵢ the functions aᵢ/mᵢ are orthonormalized one by one (Gram and Schmidt, twice), and the b are
    /// transformed in the same way; then p = Σ b aᵢ/mᵢ. Unlike the normal equations this loses no digits if
    /// coordinates start far away.
    fn least_squares(&self, group: &Group, motions: &[Vec<f64>], rounding: f64, change: &mut Change) -> Result<()> {
        let mass: Vec<f64> = group.receivers.iter().map(|&dof| self.mass[dof]).collect();
        let dot = |x: &[f64], y: &[f64]| -> f64 { mass.iter().zip(x.iter().zip(y)).map(|(m, (x, y))| m * x * y).sum() };
        let momentum = |motion: &Vec<f64>| {
            let mut momentum: Vec<f64> = motion.iter().zip(&change.added).map(|(x, m)| m * x).collect();
            group.kept.iter().for_each(|&(row, column, value)| momentum[row] += value * motion[column]);
            momentum
        };
        let momenta: Vec<Vec<f64>> = motions.iter().map(momentum).collect();
        let mut basis: Vec<(Vec<f64>, f64)> = Vec::new();
        for (k, first) in motions.iter().enumerate() {
            for (second, second_momentum) in motions[k..].iter().zip(&momenta[k..]) {
                let mean = |&dof: &usize| 0.5 * (first[dof] * second_momentum[dof] + second[dof] * momenta[k][dof]);
                let mut function: Vec<f64> =
                    group.receivers.iter().zip(&mass).map(|(dof, mass)| mean(dof) / mass).collect();
                let (mut loss, mut size) = (0.0, 0.0);
                for &(row, column, value) in &group.lost {
                    // A lost coupling has been added to the diagonal of its row.
                    let back = if self.massless[row] { 0.0 } else { second[row] };
                    loss += value * first[row] * (second[column] - back);
                    size += (value * first[row]).abs() * (second[column].abs() + back.abs());
                }
                let norm = dot(&function, &function).sqrt();
                for _ in 0..2 {
                    for (vector, of_vector) in &basis {
                        let part = dot(vector, &function);
                        function.iter_mut().zip(vector).for_each(|(x, y)| *x -= part * y);
                        loss -= part * of_vector;
                        size += (part * of_vector).abs();
                    }
                }
                let rest = dot(&function, &function).sqrt();
                if rest > rounding * norm {
                    for x in &mut function {
                        *x /= rest;
                    }
                    basis.push((function, loss / rest));
                } else if loss.abs() > rounding * size {
                    return Err(refused(
                        group.massless[0],
                        "the dofs that may take it cannot keep these motions; let more of them, or keep fewer motions",
                    ));
                }
            }
        }
        for (vector, loss) in &basis {
            group.receivers.iter().zip(vector).for_each(|(&dof, x)| change.density[dof] += loss * x);
        }
        Ok(())
    }
}

/// A group that loses mass.
#[derive(Default)]
struct Group {
    /// At least one.
    massless: Vec<usize>,
    receivers: Vec<usize>,
    /// As in [`Loss`], of this group.
    lost: Vec<(usize, usize, f64)>,
    kept: Vec<(usize, usize, f64)>,
}

/// Rejects a pattern of neighbors that does not have `size` dofs.
fn check_graph(graph: SymbolicSparseColMatRef<'_, usize>, size: usize) -> Result<()> {
    for found in [graph.nrows(), graph.ncols()] {
        if found != size {
            return Err(Error::Dimension { what: "pattern of the neighbors", expected: size, found });
        }
    }
    sparse::check_pattern("neighbors", graph)
}

fn refused(dof: usize, reason: &'static str) -> Error {
    Error::Incompatible { part: format!("redistribution of the mass of dof {dof}"), reason }
}

/// Fails if no dof may receive the mass of a dof; `weight` is the mass of the receivers, or their number.
fn check_receivers(dof: usize, weight: f64) -> Result<()> {
    match weight > 0.0 {
        true => Ok(()),
        false => Err(refused(dof, "no dof of its group that keeps mass may take it")),
    }
}

fn check_motions(motions: &[Vec<f64>], size: usize) -> Result<()> {
    let what = "motion kept by the redistribution";
    if motions.is_empty() {
        return Err(Error::Empty {
            what: "the list of motions",
            remedy: "take `affine_motions`, or at least all ones",
        });
    }
    for motion in motions {
        check_vector(what, motion, size)?;
    }
    Ok(())
}
