//! Optional forces of a system: its damping force, and its own force along a path.

use crate::error::Result;

/// Weights of the tangent in a stage: `stiffness · K + damping · C`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TangentWeights<T> {
    /// Factor of K = −∂f/∂u.
    pub stiffness: T,
    /// Factor of C = −∂f/∂v.
    pub damping: T,
}

impl<T> TangentWeights<T> {
    /// Both weights.
    pub const fn new(stiffness: T, damping: T) -> Self {
        Self { stiffness, damping }
    }
}

/// The displacements at both ends of a step, and their mean.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Path<'a, T> {
    /// At the start.
    pub from: &'a [T],
    /// At the end.
    pub to: &'a [T],
    /// ½ (from + to).
    pub mean: &'a [T],
}

impl<'a, T> Path<'a, T> {
    /// A path from one configuration to another; `mean` must be ½ (from + to).
    pub const fn new(from: &'a [T], to: &'a [T], mean: &'a [T]) -> Self {
        Self { from, to, mean }
    }
}

/// The damping force of a [`System`](super::System), returned by
/// [`System::damping_force`](super::System::damping_force).
///
/// ```
/// use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
/// use contact_dynamics::{DampingForce, GeneralizedAlpha, Mass, Result, Simulation, System, TangentWeights, verify};
///
/// /// A mass of 2 on a spring and a dashpot that resists with v + v³.
/// struct Dashpot(SymbolicSparseColMat<usize>);
///
/// impl DampingForce<f64> for Dashpot {
///     fn evaluate(&mut self, _u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
///         out[0] = v[0] + v[0].powi(3);
///         Ok(())
///     }
/// }
///
/// impl System<f64> for Dashpot {
///     fn dofs(&self) -> usize {
///         1
///     }
///     fn mass(&self) -> Mass<'_, f64> {
///         Mass::Lumped(&[2.0])
///     }
///     fn force(&mut self, _t: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
///         self.evaluate(u, v, out)?;
///         out[0] = -8.0 * u[0] - out[0];
///         Ok(())
///     }
///     fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
///         self.0.as_ref()
///     }
///     fn tangent(&mut self, _t: f64, _u: &[f64], v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
///         out[0] = w.stiffness * 8.0 + w.damping * (1.0 + 3.0 * v[0] * v[0]);
///         Ok(())
///     }
///     fn damping_force(&mut self) -> Option<&mut dyn DampingForce<f64>> {
///         Some(self)
///     }
///     fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
///         Some(4.0 * u[0] * u[0])
///     }
/// }
///
/// let mut system = Dashpot(SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]));
/// assert!(verify::tangent(&mut system, 0.0, &[0.7], &[1.0], 1e-5, 1e-5)?.largest() < 1e-8);
/// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 1e-3)
///     .velocity(vec![1.0])
///     .energy_balance()
///     .build()?;
/// run.run_until(2.0, &mut ())?;
/// // The dashpot has dissipated the missing energy.
/// let works = run.energy().works.ok_or("a balance was asked for")?;
/// assert!(works.damping < -0.5 && works.remainder.abs() < 1e-5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait DampingForce<T> {
    /// `out =` the part of the internal force that vanishes with v (C v if linear); `out` is undefined on entry.
    /// [`force`](super::System::force) contains its negative.
    ///
    /// # Errors
    ///
    /// As [`force`](super::System::force).
    fn evaluate(&mut self, u: &[T], v: &[T], out: &mut [T]) -> Result<()>;
}

/// The force of a [`System`](super::System) along a path, returned by
/// [`System::path_force`](super::System::path_force): its internal work is the change of the potential. Used by
/// [`EnergyMomentum`](crate::EnergyMomentum).
pub trait PathForce<T> {
    /// `out = f` of a step along a path, with f_int · (to − from) = V(to) − V(from); t and v are taken at the middle.
    /// As in [`force`](super::System::force), `out` is the whole force: the external load at t, minus that internal
    /// force, minus the damping force at the mean v. For St. Venant–Kirchhoff materials it is the force of the mean
    /// stress ½ (S(from) + S(to)) on the mean configuration, which also conserves angular momentum.
    ///
    /// # Errors
    ///
    /// As [`force`](super::System::force).
    fn force_along(&mut self, t: f64, path: Path<'_, T>, v: &[T], out: &mut [T]) -> Result<()>;

    /// `out = weights.stiffness K + weights.damping C` for [`force_along`](Self::force_along), with K close to −2
    /// ∂f/∂to (the stiffness if f is linear): approximations cost iterations, not accuracy. The
    /// [`tangent`](super::System::tangent) at `path.mean` is often sufficient. The exact K is unsymmetric and needs
    /// [`Lu`](crate::Lu); without it K must be symmetric. C is −∂f/∂v, as in the tangent.
    ///
    /// # Errors
    ///
    /// As [`force`](super::System::force).
    fn tangent_along(
        &mut self,
        t: f64,
        path: Path<'_, T>,
        v: &[T],
        weights: TangentWeights<T>,
        out: &mut [T],
    ) -> Result<()>;
}
