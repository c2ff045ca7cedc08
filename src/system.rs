//! The mechanical system of the host: mass, force, tangent and supports.

mod forces;
mod linear;

pub use forces::{DampingForce, Path, PathForce, TangentWeights};
pub use linear::LinearSystem;

pub(crate) use crate::sparse::check_vector;

use crate::error::{Error, Result};
use crate::mass::Mass;
use crate::ranks::Ranks;
use crate::real::Real;
use crate::sparse;
use faer::sparse::SymbolicSparseColMatRef;
use std::sync::Arc;

/// Dependence of the force of a system on displacements and velocities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Linearity {
    /// f = F(t) − K u − C v with constant K and C: one factorization per run, one solve per stage.
    Linear,
    /// Anything else: each stage is solved by Newton's method.
    Nonlinear,
}

/// A mechanical system `M a = f(t, u, v) + Gᵀ λ`, with f the external minus the internal force.
///
/// Vectors have full length, including supports; the solver reads prescribed dofs from
/// [`prescribed`](Self::prescribed) and never solves for them. Evaluations are pure: they may use scratch, but two
/// calls with the same arguments give the same result; only [`commit`](Self::commit) changes history variables. M is
/// constant and symmetric. An unsymmetric tangent needs [`Lu`](crate::Lu) as the linear solver; the default one
/// rejects it.
///
/// A host implements five methods: [`dofs`](Self::dofs), [`mass`](Self::mass), [`force`](Self::force),
/// [`pattern`](Self::pattern) and [`tangent`](Self::tangent) ([`verify::tangent`](crate::verify::tangent) compares
/// the last with differences of the force); the others have defaults. `&mut S` is a system too, so a host can lend
/// its model. Hosts with constant matrices should use [`LinearSystem`].
///
/// If a force cannot be evaluated at a trial state, for instance because an element is turned inside out, return
/// [`Error::Inadmissible`](crate::Error::Inadmissible) with the name of the method as its `callback`: the step is
/// undone and may be repeated with a smaller h.
///
/// ```
/// use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
/// use contact_dynamics::{GeneralizedAlpha, Mass, Result, Simulation, System, TangentWeights, verify};
///
/// /// A mass of 2 on a spring that pulls with 2 u³.
/// struct Cubic(SymbolicSparseColMat<usize>);
///
/// impl System<f64> for Cubic {
///     fn dofs(&self) -> usize {
///         1
///     }
///     fn mass(&self) -> Mass<'_, f64> {
///         Mass::Lumped(&[2.0])
///     }
///     fn force(&mut self, _t: f64, u: &[f64], _v: &[f64], out: &mut [f64]) -> Result<()> {
///         out[0] = -2.0 * u[0].powi(3);
///         Ok(())
///     }
///     fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
///         self.0.as_ref()
///     }
///     fn tangent(&mut self, _t: f64, u: &[f64], _v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
///         out[0] = w.stiffness * 6.0 * u[0] * u[0]; // no damping: nothing for w.damping
///         Ok(())
///     }
/// }
///
/// let mut spring = Cubic(SymbolicSparseColMat::new_checked(1, 1, vec![0, 1], None, vec![0]));
/// assert!(verify::tangent(&mut spring, 0.0, &[0.7], &[1.0], 1e-5, 1e-5)?.largest() < 1e-8);
///
/// // Released at u = 1 it passes through zero at t = 1.8540747 with the speed √½.
/// let mut run = Simulation::builder(&mut spring, GeneralizedAlpha::default(), 1.854_074_677 / 1000.0)
///     .displacement(vec![1.0])
///     .build()?;
/// run.run_until(1.854, &mut ())?;
/// assert!(run.state().displacement()[0].abs() < 1e-6);
/// assert!((run.state().velocity()[0] + 0.5_f64.sqrt()).abs() < 1e-6);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub trait System<T: Real>: Send {
    /// Number of dofs, including prescribed ones.
    fn dofs(&self) -> usize;

    /// How the force depends on u and v. A nonlinear system must not be declared linear; a linear one declared
    /// nonlinear only takes more time.
    fn linearity(&self) -> Linearity {
        Linearity::Nonlinear
    }

    /// The (constant) mass matrix, positive semidefinite. Prescribed dofs may have no mass; other dofs may have none
    /// in schemes that support it ([`massless_factor`](crate::analysis::massless_factor); among the explicit ones
    /// central differences and Noh–Bathe's, for linear systems).
    fn mass(&self) -> Mass<'_, T>;

    /// `out = f(t, u, v)`: external minus internal force; `out` is undefined on entry.
    ///
    /// # Errors
    ///
    /// [`Error::Inadmissible`](crate::Error::Inadmissible) if a smaller step may help, otherwise
    /// [`Error::Host`](crate::Error::Host); the `callback` of either is the name of the method, here `"force"`.
    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()>;

    /// Pattern of K and C together, with both triangles, which need not have the same shape with [`Lu`](crate::Lu);
    /// rows are sorted in each column, and the pattern never changes.
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize>;

    /// `out = weights.stiffness K + weights.damping C` at (t, u, v), with K = −∂f/∂u and C = −∂f/∂v: the values in
    /// the order of the pattern; `out` is undefined on entry.
    ///
    /// # Errors
    ///
    /// As [`force`](Self::force).
    fn tangent(&mut self, t: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()>;

    /// The system's own force along paths, if it has one, for [`EnergyMomentum`](crate::EnergyMomentum). Default: none;
    /// the forces at start, middle and end are then averaged using the potential. Whether it exists must not change
    /// during a run.
    fn path_force(&mut self) -> Option<&mut dyn PathForce<T>> {
        None
    }

    /// The damping force, if the system has one; default: no damping. The energy balance and velocity corrections
    /// read it; schemes, corrections and explicit steps are checked for damping with it. Whether it exists must not
    /// change during a run.
    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
        None
    }

    /// Elastic energy (½ uᵀ K u if linear), if the system has one; none by default. It does not include the potential
    /// of loads. Internal forces with an unsymmetric K have no potential: return none, so that the energy balance
    /// does not count their work as energy.
    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        let _ = u;
        None
    }

    /// `out =` the part of the force that depends on t only, for the energy balance and for
    /// [`EnergyMomentum`](crate::EnergyMomentum) without [`path_force`](Self::path_force); [`force`](Self::force)
    /// contains it. Default: no load. Loads that depend on u are not included; the energy balance counts their work
    /// in its remainder. `EnergyMomentum` would treat them as internal forces; with such loads implement
    /// [`path_force`](Self::path_force).
    ///
    /// # Errors
    ///
    /// As [`force`](Self::force).
    fn external_load(&mut self, t: f64, out: &mut [T]) -> Result<()> {
        let _ = t;
        out.fill(T::zero());
        Ok(())
    }

    /// The highest circular frequency ω of M⁻¹ K on the free dofs (1/time), or an upper bound, if the host knows one;
    /// none by default. Explicit schemes reject larger steps than it allows. Without it the frequency is estimated
    /// when a simulation is built: from the tangent, or for an empty [`pattern`](Self::pattern) from differences of
    /// the force, which needs several evaluations.
    fn highest_frequency(&mut self) -> Option<f64> {
        None
    }

    /// The ranks over which the system is spread; none by default. [`Ranks`] describes what the other methods must
    /// then return.
    fn ranks(&self) -> Option<Arc<dyn Ranks<T>>> {
        None
    }

    /// Prescribed dofs, ascending.
    fn prescribed(&self) -> &[usize] {
        &[]
    }

    /// Displacement, velocity and acceleration of the prescribed dofs at t, in the order of
    /// [`prescribed`](Self::prescribed).
    ///
    /// # Errors
    ///
    /// As [`force`](Self::force).
    fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) -> Result<()> {
        let _ = t;
        out.fill([T::zero(); 3]);
        Ok(())
    }

    /// Accepts the step that ends at t: the only place where the host updates its history variables.
    ///
    /// # Errors
    ///
    /// The host's own, as for [`force`](Self::force); the step is then undone.
    fn commit(&mut self, t: f64, u: &[T], v: &[T]) -> Result<()> {
        let _ = (t, u, v);
        Ok(())
    }
}

/// Rejects a system whose mass or pattern does not fit its number of dofs, which is returned.
pub(crate) fn check_sizes<T: Real>(system: &dyn System<T>) -> Result<usize> {
    let dofs = system.dofs();
    if dofs == 0 {
        return Err(Error::Empty { what: "the system", remedy: "give it at least one dof" });
    }
    let size = |what, found| match found == dofs {
        true => Ok(()),
        false => Err(Error::Dimension { what, expected: dofs, found }),
    };
    match system.mass() {
        Mass::Lumped(mass) => size("the mass", mass.len())?,
        Mass::Consistent(mass) => {
            size("the mass matrix", mass.nrows())?;
            size("the mass matrix", mass.ncols())?;
            sparse::check_symmetric("mass", mass)?;
        }
    }
    size("the pattern of the tangent", system.pattern().nrows())?;
    size("the pattern of the tangent", system.pattern().ncols())?;
    sparse::check_pattern("tangent", system.pattern())?;
    Ok(dofs)
}

/// Rejects step sizes that are not positive and finite, or whose square or its reciprocal the scalar cannot
/// represent.
pub(crate) fn check_step_size<T: Real>(h: f64) -> Result<()> {
    let fits = |x: f64| T::of(x).is_normal();
    match h > 0.0 && h.is_finite() && fits(h * h) && fits(1.0 / (h * h)) {
        true => Ok(()),
        false => Err(Error::Parameter {
            name: "the step size h",
            value: h,
            range: "positive and finite, with h² and 1/h² in the range of the scalar; choose another unit of time",
        }),
    }
}

/// Pointers to systems are systems: `&mut S` lends the host's model, `Box<dyn System<T>>` allows a choice at run
/// time.
macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<T: Real, S: System<T> + ?Sized> System<T> for $pointer {
            fn dofs(&self) -> usize {
                (**self).dofs()
            }
            fn linearity(&self) -> Linearity {
                (**self).linearity()
            }
            fn mass(&self) -> Mass<'_, T> {
                (**self).mass()
            }
            fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
                (**self).force(t, u, v, out)
            }
            fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
                (**self).pattern()
            }
            fn tangent(&mut self, t: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
                (**self).tangent(t, u, v, weights, out)
            }
            fn path_force(&mut self) -> Option<&mut dyn PathForce<T>> {
                (**self).path_force()
            }
            fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
                (**self).damping_force()
            }
            fn potential_energy(&mut self, u: &[T]) -> Option<T> {
                (**self).potential_energy(u)
            }
            fn external_load(&mut self, t: f64, out: &mut [T]) -> Result<()> {
                (**self).external_load(t, out)
            }
            fn highest_frequency(&mut self) -> Option<f64> {
                (**self).highest_frequency()
            }
            fn ranks(&self) -> Option<Arc<dyn Ranks<T>>> {
                (**self).ranks()
            }

            fn prescribed(&self) -> &[usize] {
                (**self).prescribed()
            }
            fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) -> Result<()> {
                (**self).prescribed_motion(t, out)
            }
            fn commit(&mut self, t: f64, u: &[T], v: &[T]) -> Result<()> {
                (**self).commit(t, u, v)
            }
        }
    )*};
}

forward!(&mut S, Box<S>);
