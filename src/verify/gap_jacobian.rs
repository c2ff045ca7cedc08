//! Compares the rows of a constraint with differences of its gaps.

use crate::contact::{Candidates, ContactConstraint, Contacts, GapRates, Rates};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::time_resolution;

/// Errors of the rows of a constraint as derivatives of its gaps.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct GapJacobianError {
    /// Rows compared.
    pub rows: usize,
    /// Largest difference between an entry of G and the derivative of the gap (dimensionless; weights are of order
    /// one).
    pub jacobian: f64,
    /// The contact (feature, candidate) and the system's dof of that entry.
    pub worst: ((usize, usize), usize),
    /// Largest difference between a rate ∂g/∂t and the derivative of the gap (length/time); zero, like
    /// `acceleration`, if the constraint leaves its rates to differences.
    pub rate: f64,
    /// Largest difference between the part of g̈ due to motion with v and its difference quotient (length/time²);
    /// zero if v is.
    pub acceleration: f64,
    /// Deviation of the tangents of contacts with friction from rows that are orthogonal to each other and to the gap
    /// row, and as long as it: the largest product of two rows over their lengths, or relative difference of a length
    /// from the length of the gap row. Only with such tangents is μ correct and the friction cone round.
    pub tangents: f64,
    /// Rows that vanished for some displacement; compared only while they existed.
    pub rows_lost: usize,
    /// Searches that returned [`Candidates::Unchanged`] although identities or G had changed: a run would continue
    /// with the old rows.
    pub unreported: usize,
}

/// Compares G and the gap rates of a constraint with central differences of its gap.
///
/// The gap is evaluated after a [`search`](ContactConstraint::search) at the displaced position, so the check
/// includes the geometry that is linearized, not only the rows. `step` is the size of the displacements (length):
/// small compared with the geometry, large compared with its rounding, for instance 1e-6 of an element. Rows that
/// appear or vanish by a displacement are counted in [`rows_lost`](GapJacobianError::rows_lost) and left out,
/// unreported changes of rows in [`unreported`](GapJacobianError::unreported). At edges and kinks the gap has no
/// derivative, so check at positions inside of facets. Time is varied by `step` over the largest speed in `v`,
/// without another search; for the acceleration everything moves with v, by a hundred steps. The constraint is left
/// as after a search at (t, u, v).
///
/// # Errors
///
/// The errors of the constraint, and [`Error::MissingContactDof`] for dofs that u and v do not have.
///
/// ```
/// use contact_dynamics::contact::{Side, Sphere};
/// use contact_dynamics::{NodesOnObstacle, verify};
///
/// let ball = Sphere::new([0.0, 0.0, 0.0], 1.0, Side::Outside)?;
/// let mut contact = NodesOnObstacle::new(ball, &[[0.8, 0.5, 0.7]], &[[0, 1, 2]], &[0])?
///     .moving(|t| [[0.0, 0.3 * t, 0.0], [0.0, 0.3, 0.0], [0.0; 3]]);
/// let error = verify::gap_jacobian(&mut contact, 0.0, &[0.01, 0.0, -0.02], &[1.0; 3], 1e-5)?;
/// assert!(error.rows == 1 && error.jacobian < 1e-9, "{error:?}");
/// assert!(error.rate < 1e-6 && error.acceleration < 1e-5, "{error:?}");
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn gap_jacobian<T: Real>(
    constraint: &mut dyn ContactConstraint<T>,
    t: f64,
    u: &[T],
    v: &[T],
    step: f64,
) -> Result<GapJacobianError> {
    let dofs = constraint.dofs().to_vec();
    if let Some(&dof) = dofs.iter().find(|&&dof| dof >= u.len()) {
        return Err(Error::MissingContactDof { constraint: 0, dof, dofs: u.len() });
    }
    let [u, v]: [Vec<T>; 2] = [u, v].map(|x| dofs.iter().map(|&dof| x[dof]).collect());
    let (u, v) = (&u[..], &v[..]);
    let mut watched = Watched { constraint, contacts: None, unreported: 0 };
    watched.search(t, u, v)?;
    let found = watched.contacts.clone().unwrap_or_default();
    let rows = found.len();
    let ids: Vec<_> = (0..rows).map(|row| found.name(row)).collect();
    let constraint = &mut *watched.constraint;

    let mut error = GapJacobianError {
        rows,
        jacobian: 0.0,
        worst: ((0, 0), 0),
        rate: 0.0,
        acceleration: 0.0,
        tangents: (0..rows).map(|row| skewness(&found, row)).fold(0.0, f64::max),
        rows_lost: 0,
        unreported: 0,
    };
    let mut lost = vec![false; rows];
    // Rates first, while the rows belong to the search at u.
    let speed = v.iter().fold(0.0, |m: f64, v| m.max(v.value().abs()));
    let delay = if speed > 0.0 { step / speed } else { step };
    // Rounded to the resolution of times near t, so that t ± delay and t ± 100 delay are exact.
    let delay = (t + delay.max(time_resolution(t))) - t;
    let (mut before, mut after) = (vec![T::zero(); rows], vec![T::zero(); rows]);
    let mut rates = vec![GapRates::default(); rows];
    let given = rows > 0 && constraint.rates(t, u, v, &mut rates)? != Rates::Differences;
    if given {
        constraint.gaps(t - delay, u, &mut before)?;
        constraint.gaps(t + delay, u, &mut after)?;
        for (rate, (&before, &after)) in rates.iter().zip(before.iter().zip(&after)) {
            let difference = (after.value() - before.value()) / (2.0 * delay);
            error.rate = error.rate.max((difference - rate.rate.value()).abs());
        }
    }

    let mut displaced = u.to_vec();
    if speed > 0.0 && given {
        let delay = 100.0 * delay;
        let mut along = |time: f64| {
            for (x, (&u, &v)) in displaced.iter_mut().zip(u.iter().zip(v)) {
                *x = u + T::of(time) * v;
            }
            gaps_of(&mut watched, &ids, t + time, &displaced, v)
        };
        let [before, now, after] = [along(-delay)?, along(0.0)?, along(delay)?];
        for (row, rate) in rates.iter().enumerate() {
            match (before[row], now[row], after[row]) {
                (Some(before), Some(now), Some(after)) => {
                    let quotient = ((after - now) - (now - before)) / (delay * delay);
                    let difference = (quotient - rate.acceleration.value()).abs();
                    if difference > error.acceleration || !difference.is_finite() {
                        error.acceleration = difference;
                    }
                }
                _ => lost[row] = true,
            }
        }
        displaced.copy_from_slice(u);
    }
    for (place, &dof) in dofs.iter().enumerate() {
        let mut gaps = [Vec::new(), Vec::new()];
        let mut ends = [0.0; 2];
        for ((gaps, at), sign) in gaps.iter_mut().zip(&mut ends).zip([-1.0, 1.0]) {
            displaced[place] = u[place] + T::of(sign * step);
            *at = displaced[place].value();
            *gaps = gaps_of(&mut watched, &ids, t, &displaced, v)?;
        }
        displaced[place] = u[place];
        for row in 0..rows {
            let entry: f64 = found.row(row).filter(|entry| entry.0 == place).map(|entry| entry.1.value()).sum();
            match (gaps[0][row], gaps[1][row]) {
                (Some(before), Some(after)) => {
                    let difference = ((after - before) / (ends[1] - ends[0]) - entry).abs();
                    if difference > error.jacobian || !difference.is_finite() {
                        (error.jacobian, error.worst) = (difference, (ids[row], dof));
                    }
                }
                _ => lost[row] = true,
            }
        }
    }
    watched.search(t, u, v)?;
    error.unreported = watched.unreported;
    error.rows_lost = lost.iter().filter(|&&lost| lost).count();
    Ok(error)
}

/// Deviation of the tangents of a contact with friction from orthonormal ones.
fn skewness<T: Real>(contacts: &Contacts<T>, contact: usize) -> f64 {
    if contacts.friction(contact) == 0.0 {
        return 0.0;
    }
    let gap: Vec<(usize, T)> = contacts.row(contact).collect();
    let rows = [vec![gap], contacts.tangents(contact)].concat();
    let product = |i: usize, j: usize| -> f64 {
        let with = |&(dof, weight): &(usize, T)| {
            rows[j].iter().filter(|other| other.0 == dof).map(|other| (weight * other.1).value()).sum::<f64>()
        };
        rows[i].iter().map(with).sum()
    };
    let length = |i: usize| product(i, i).sqrt();
    let pairs = (0..rows.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let skew = pairs.map(|(i, j)| (product(i, j) / (length(i) * length(j))).abs());
    skew.chain((1..rows.len()).map(|i| (length(i) / length(0) - 1.0).abs())).fold(0.0, f64::max)
}

/// A constraint, and the result of its last search.
struct Watched<'c, T: Real> {
    constraint: &'c mut dyn ContactConstraint<T>,
    contacts: Option<Contacts<T>>,
    /// Searches that changed rows and returned `Unchanged`.
    unreported: usize,
}

impl<T: Real> Watched<'_, T> {
    fn search(&mut self, t: f64, u: &[T], v: &[T]) -> Result<()> {
        let said = self.constraint.search(t, u, v, 0.0)?;
        let found = Contacts::of(&*self.constraint);
        let changed = self.contacts.as_ref().is_some_and(|before| !before.has_rows_of(&found));
        self.contacts = Some(found);
        self.unreported += usize::from(changed && said == Candidates::Unchanged);
        Ok(())
    }
}

/// The gaps of some contacts after a search, if they are found.
fn gaps_of<T: Real>(
    watched: &mut Watched<'_, T>,
    ids: &[(usize, usize)],
    t: f64,
    u: &[T],
    v: &[T],
) -> Result<Vec<Option<f64>>> {
    watched.search(t, u, v)?;
    let Watched { constraint, contacts: Some(contacts), .. } = watched else { return Ok(vec![None; ids.len()]) };
    let mut found = vec![T::zero(); contacts.len()];
    if !found.is_empty() {
        constraint.gaps(t, u, &mut found)?;
    }
    let mut gaps = vec![None; ids.len()];
    for (row, &gap) in found.iter().enumerate() {
        if let Some(at) = ids.iter().position(|other| *other == contacts.name(row)) {
            gaps[at] = Some(gap.value());
        }
    }
    Ok(gaps)
}
