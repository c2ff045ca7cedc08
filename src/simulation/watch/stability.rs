//! The largest stable step of a run: the critical Ω of its scheme over the highest frequency of its system.

use crate::analysis::{self, ZeroStability};
use crate::error::{Error, Result};
use crate::mass::{InverseMass, Mass};
use crate::memory;
use crate::ranks::Together;
use crate::real::Real;
use crate::rounding::{CRITICAL_ACCURACY, FREQUENCY_ACCURACY, half_digits, rounding};
use crate::simulation::build::scheme::Scheme;
use crate::sparse::{self, Product, Symmetry};
use crate::state::Motion;
use crate::system::{Linearity, System, TangentWeights};
use crate::tableau::Tableau;
use faer::sparse::SparseColMatRef;
use faer::{Mat, Side};

/// The result of the stability check of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StepLimit {
    /// The caller has switched the check off.
    Unchecked,
    /// Steps up to this one have been found stable.
    Cleared(f64),
}

/// Maximum number of Lanczos iterations, with one product with K each. They run only if Gershgorin's circles do not
/// admit the step size.
const ITERATIONS: usize = 40;

/// The estimate is evaluated after these numbers of iterations.
const EVALUATED: [usize; 8] = [3, 6, 9, 13, 18, 24, 31, ITERATIONS];

/// An estimate counts as below a limit if it is below by this multiple of its residual.
const RESERVE: f64 = 4.0;

/// Refuses tableaux that do not converge to the equation of motion as the step decreases.
pub(crate) fn check_scheme(scheme: &Scheme<'_>) -> Result<()> {
    let order = scheme.derived.order;
    let order = order.displacement.min(order.velocity);
    if order == 0 {
        return Err(Error::InconsistentScheme { integrator: scheme.integrator.name() });
    }
    match scheme.derived.zero_stability {
        ZeroStability::Unstable => {
            let radius = analysis::spectral_radius(&scheme.tableau, 0.0, 0.0);
            Err(Error::UnstableScheme { integrator: scheme.integrator.name(), order, radius })
        }
        ZeroStability::Strong | ZeroStability::Weak => Ok(()),
    }
}

/// Ω up to which a scheme is stable without damping; none if it is stable at every frequency.
pub(crate) fn critical(scheme: &Scheme<'_>) -> Option<f64> {
    // Explicit schemes have no radius at infinite frequency.
    if scheme.derived.radius_at_infinity.is_some_and(|radius| radius <= 1.0 + CRITICAL_ACCURACY) {
        return None;
    }
    scheme.derived.critical(&scheme.tableau)
}

/// The factor by which steps may exceed the limit, within its accuracy.
pub(crate) fn allowance<T: Real>() -> f64 {
    1.0 + CRITICAL_ACCURACY + rounding(T::one()).value()
}

/// Bounds of the square of the highest frequency of a system with an additional force, whose product with a vector
/// `add` adds. They are accurate enough for a comparison with `enough`. The first is a lower bound, the second the
/// estimate plus its residual. None if there is no K, or K is not symmetric.
pub(crate) fn highest_square<T: Real>(
    system: &mut dyn System<T>,
    motion: &Motion<T>,
    enough: f64,
    mut add: impl FnMut(&[T], &mut [T]),
) -> Result<Option<[f64; 2]>> {
    let mut lanczos = Lanczos::new(system)?;
    let Some(mut stiffness) = Stiffness::of(system, motion)? else { return Ok(None) };
    if !stiffness.is_symmetric() {
        return Ok(None);
    }
    let highest = lanczos.highest(system, enough, |system, x, y| {
        stiffness.product(system, x, y)?;
        add(x, y);
        Ok(())
    })?;
    Ok(Some([highest.at_least, highest.at_most]))
}

/// Refuses a step beyond the limit of the scheme, as far as that is known. Returns the largest step known to be
/// stable.
///
/// Gershgorin's circles bound the highest frequency from above: a step that this bound admits is stable. Otherwise
/// Lanczos' iteration on M⁻¹ K decides: Ritz values never exceed the highest frequency, so a step that they refuse is
/// unstable. A step that they admit may exceed the limit by the error of the iteration (a fraction of a percent on
/// meshes). For nonlinear systems the tangent at `motion` counts.
pub(crate) fn check_step<T: Real>(
    (system, together): (&mut dyn System<T>, &Together<T>),
    scheme: &Scheme<'_>,
    motion: &Motion<T>,
    h: f64,
) -> Result<StepLimit> {
    let tableau = &scheme.tableau;
    let Some(critical) = critical(scheme) else {
        return Ok(StepLimit::Cleared(f64::INFINITY));
    };
    let allowance = allowance::<T>();
    let lags = lags(tableau, system);
    if !together.is_alone() {
        let limit = critical / frequency_over_ranks(system, together, motion, lags)?;
        return match h <= limit * allowance {
            true => Ok(StepLimit::Cleared(h.max(limit))),
            false => Err(Error::BeyondStability {
                integrator: scheme.integrator.name(),
                h,
                largest: limit,
                frequency: critical / limit,
            }),
        };
    }
    let mut lanczos = Lanczos::new(system)?;
    let highest = if let Some(omega) = system.highest_frequency() {
        Highest { at_least: omega * omega, at_most: omega * omega }
    } else {
        let Some(mut stiffness) = Stiffness::of(system, motion)? else { return Ok(StepLimit::Cleared(h)) };
        if !lags && let Some(square) = stiffness.circles(system, &lanczos.inverse) {
            let largest = critical / square.sqrt();
            if h <= largest * allowance {
                return Ok(StepLimit::Cleared(h.max(largest)));
            }
        }
        if !stiffness.is_symmetric() {
            // Ritz values are no bounds for unsymmetric matrices.
            return Ok(StepLimit::Cleared(h));
        }
        let enough = if lags { 0.0 } else { (critical * allowance / h).powi(2) };
        lanczos.highest(system, enough, |system, x, y| stiffness.product(system, x, y))?
    };
    let mut strongest = 0.0;
    if lags {
        // The highest mode is assumed to have the strongest damping of all modes: exact for Rayleigh damping, on the
        // safe side otherwise.
        let still = vec![T::zero(); system.dofs()];
        let damping = lanczos.highest(system, 0.0, |system, x, y| match system.damping_force() {
            Some(damping) => damping.evaluate(&still, x, y),
            None => Ok(()),
        })?;
        strongest = damping.at_least;
    }
    let longest = |square: f64| {
        let omega = square.sqrt();
        let damped = if lags { analysis::critical_step(tableau, omega, strongest) } else { None };
        let undamped = if omega > 0.0 { critical / omega } else { f64::INFINITY };
        damped.map_or(undamped, |damped| damped.min(undamped))
    };
    if h > longest(highest.at_least) * allowance {
        return Err(Error::BeyondStability {
            integrator: scheme.integrator.name(),
            h,
            largest: longest(highest.at_most),
            frequency: highest.at_least.sqrt().max(strongest),
        });
    }
    Ok(StepLimit::Cleared(h.max(longest(highest.at_most))))
}

/// The highest frequency of bodies over ranks: as given by the host, or the bound by Gershgorin's circles, which each
/// rank computes for its own dofs. Lanczos' iteration would need products with rows of all ranks.
fn frequency_over_ranks<T: Real>(
    system: &mut dyn System<T>,
    together: &Together<T>,
    motion: &Motion<T>,
    lags: bool,
) -> Result<f64> {
    let refusal = |reason| Err(Error::Incompatible { part: "an explicit scheme over ranks".into(), reason });
    if lags {
        return refusal(
            "it takes damping forces from before the step, whose limit is not sought over ranks: see to the step size \
             and take it by `unchecked_stability`",
        );
    }
    if let Some(frequency) = system.highest_frequency() {
        return Ok(frequency);
    }
    let circles = Stiffness::of(system, motion).and_then(|stiffness| {
        let inverse = InverseMass::new(system.mass(), system.prescribed(), &[]);
        let circles = stiffness.map(|stiffness| Ok(stiffness.circles(system, &inverse?))).transpose()?.flatten();
        Ok([circles.unwrap_or(f64::INFINITY)])
    });
    match together.max(circles)? {
        [square] if square.is_finite() => Ok(square.sqrt()),
        _ => refusal("nothing bounds its frequencies: let the system tell its `highest_frequency`"),
    }
}

/// Whether the system is damped and the balance of a stage reads velocities without its unknown.
fn lags<T: Real>(tableau: &Tableau, system: &mut dyn System<T>) -> bool {
    tableau.stages.iter().any(|stage| stage.balance.v.z == 0.0) && system.damping_force().is_some()
}

/// Bounds of the highest eigenvalue ω².
#[derive(Clone, Copy, Debug)]
struct Highest {
    at_least: f64,
    /// The estimate plus its residual. Not a strict bound, as the iteration may have missed a higher eigenvalue.
    at_most: f64,
}

/// The product of K with a vector.
enum Stiffness<'s, T: Real> {
    /// The values of the system's pattern.
    Matrix { values: Vec<T>, product: Product<T> },
    /// Differences of the force over a displacement of the given size.
    Force { at: &'s Motion<T>, force: Vec<T>, size: T, moved: Vec<T> },
}

impl<'s, T: Real> Stiffness<'s, T> {
    /// The tangent, if the system has one, otherwise its force. None for nonlinear forces at zero displacements,
    /// which define no length for a difference.
    fn of(system: &mut dyn System<T>, at: &'s Motion<T>) -> Result<Option<Self>> {
        let dofs = system.dofs();
        let entries = system.pattern().row_idx().len();
        if entries > 0 {
            let mut values = memory::zeros(entries, 1, "the stiffness, whose highest frequency is sought")?;
            let weights = TangentWeights { stiffness: T::one(), damping: T::zero() };
            system.tangent(at.t, &at.u, &at.v, weights, &mut values)?;
            let k = SparseColMatRef::new(system.pattern(), &values[..]);
            let product = Product::new(k, sparse::symmetry("stiffness", k).unwrap_or(Symmetry::General))?;
            return Ok(Some(Self::Matrix { values, product }));
        }
        let size = match system.linearity() {
            Linearity::Linear => T::one(),
            Linearity::Nonlinear => at.u.iter().fold(T::zero(), |largest, u| largest.max(u.abs())) * half_digits(),
        };
        let mut force = vec![T::zero(); dofs];
        match size > T::zero() {
            true => {
                system.force(at.t, &at.u, &at.v, &mut force)?;
                Ok(Some(Self::Force { at, force, size, moved: vec![T::zero(); dofs] }))
            }
            false => Ok(None),
        }
    }

    fn is_symmetric(&self) -> bool {
        !matches!(self, Self::Matrix { product: Product::General, .. })
    }

    /// Gershgorin's bound of ω² by the circles of M⁻¹ K, for a lumped mass and a matrix.
    fn circles(&self, system: &dyn System<T>, inverse: &InverseMass<T>) -> Option<f64> {
        let (Self::Matrix { values, .. }, InverseMass::Lumped(inverse)) = (self, inverse) else { return None };
        let pattern = system.pattern();
        let mut rows = vec![T::zero(); inverse.len()];
        for column in (0..inverse.len()).filter(|&column| inverse[column] > T::zero()) {
            for (&row, value) in pattern.row_idx_of_col_raw(column).iter().zip(&values[pattern.col_range(column)]) {
                rows[row] += value.abs();
            }
        }
        let largest = rows.iter().zip(inverse).fold(T::zero(), |largest, (&row, &inverse)| largest.max(row * inverse));
        largest.is_finite().then_some(largest.value())
    }

    /// `y = K x`.
    fn product(&mut self, system: &mut dyn System<T>, x: &[T], y: &mut [T]) -> Result<()> {
        match self {
            Self::Matrix { values, product } => {
                product.write(T::one(), SparseColMatRef::new(system.pattern(), values), x, y);
            }
            Self::Force { at, force, size, moved } => {
                let longest = x.iter().fold(T::zero(), |largest, x| largest.max(x.abs()));
                let step = if longest > T::zero() { *size / longest } else { T::one() };
                moved.copy_from_slice(&at.u);
                T::axpy(step, x, moved);
                system.force(at.t, moved, &at.v, y)?;
                for (y, &f) in y.iter_mut().zip(force.iter()) {
                    *y = (f - *y) / step;
                }
            }
        }
        Ok(())
    }
}

/// Lanczos' iteration on M⁻¹ K in the inner product of M (Parlett, The Symmetric Eigenvalue Problem, 1980,
/// chapter 13), without orthogonalization against older vectors: this yields eigenvalues several times, which is
/// harmless at the end of the spectrum.
struct Lanczos<T: Real> {
    inverse: InverseMass<T>,
    /// Sizes of the entries of the first vector; their signs are scattered.
    start: Vec<T>,
    vectors: [Vec<T>; 4],
}

impl<T: Real> Lanczos<T> {
    fn new(system: &dyn System<T>) -> Result<Self> {
        let (mass, dofs) = (system.mass(), system.dofs());
        let inverse = InverseMass::new(mass, system.prescribed(), &[])?;
        // Equal components of all dofs in the inner product of M: light dofs are the fastest.
        let start = match (&inverse, mass) {
            (InverseMass::Lumped(inverse), _) => inverse.iter().map(|inverse| inverse.sqrt()).collect(),
            (_, Mass::Consistent(mass)) => {
                let inverse = (0..dofs).map(|dof| sparse::entry(mass, dof, dof).sqrt().recip());
                inverse.map(|size| if size.is_finite() { size } else { T::zero() }).collect()
            }
            _ => vec![T::one(); dofs],
        };
        Ok(Self { inverse, start, vectors: std::array::from_fn(|_| vec![T::zero(); dofs]) })
    }

    /// The highest eigenvalue, accurate enough to compare it with `limit`, and to [`FREQUENCY_ACCURACY`] if it is
    /// above.
    fn highest(
        &mut self,
        system: &mut dyn System<T>,
        limit: f64,
        mut product: impl FnMut(&mut dyn System<T>, &[T], &mut [T]) -> Result<()>,
    ) -> Result<Highest> {
        let Self { inverse, start, vectors: [q, old, image, next] } = self;
        let dot = |x: &[T], y: &[T]| x.iter().zip(y).map(|(&x, &y)| x * y).sum::<T>();
        // q: the vector; old: M times the one before; image: K q, then M times the next; next: M⁻¹ times `image`.
        next.copy_from_slice(start);
        for (dof, x) in next.iter_mut().enumerate() {
            *x *= T::of(sparse::scattered_signed(dof));
        }
        if let InverseMass::Consistent(inverse) = inverse {
            for &dof in inverse.fixed() {
                next[dof] = T::zero();
            }
        }
        image.fill(T::zero());
        system.mass().add_product(T::one(), next, image);
        old.fill(T::zero());
        let (mut diagonal, mut beside) = (Vec::new(), Vec::new());
        let mut found = Highest { at_least: 0.0, at_most: 0.0 };
        for iteration in 1..=ITERATIONS {
            let beta = dot(image, next).sqrt();
            if !(beta > T::zero() && beta.is_finite()) {
                break;
            }
            if iteration > 1 {
                beside.push(beta.value());
            }
            for i in 0..q.len() {
                q[i] = next[i] / beta;
                // `old` becomes M q, which the next iteration subtracts; `next` takes the previous `old`.
                next[i] = old[i];
                old[i] = image[i] / beta;
            }
            product(system, q, image)?;
            let alpha = dot(image, q);
            diagonal.push(alpha.value());
            let back = if iteration > 1 { beta } else { T::zero() };
            for i in 0..q.len() {
                image[i] -= alpha * old[i] + back * next[i];
            }
            next.copy_from_slice(image);
            inverse.apply(next)?;
            if EVALUATED.contains(&iteration) {
                let beta = dot(image, next).max(T::zero()).sqrt().value();
                found = ritz(&diagonal, &beside, beta);
                let miss = found.at_most - found.at_least;
                let known = found.at_least > limit && miss <= FREQUENCY_ACCURACY * found.at_least;
                // With some reserve, as a higher eigenvalue may not have been found yet.
                if known || found.at_least + RESERVE * miss <= limit {
                    return Ok(found);
                }
            }
        }
        // An invariant subspace was found, or the iterations are spent.
        if !EVALUATED.contains(&diagonal.len()) && !diagonal.is_empty() {
            found = ritz(&diagonal, &beside[..diagonal.len() - 1], 0.0);
        }
        Ok(found)
    }
}

/// The highest eigenvalue of a tridiagonal matrix, and its sum with the residual of its vector if `beta` is the next
/// off-diagonal entry.
fn ritz(diagonal: &[f64], beside: &[f64], beta: f64) -> Highest {
    let n = diagonal.len();
    let matrix = Mat::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => beside[i.min(j)],
        _ => 0.0,
    });
    let Ok(eigen) = matrix.self_adjoint_eigen(Side::Lower) else {
        return Highest { at_least: 0.0, at_most: f64::INFINITY };
    };
    let (last, value) = (eigen.U()[(n - 1, n - 1)], eigen.S()[n - 1].max(0.0));
    Highest { at_least: value, at_most: value + beta * last.abs() }
}
