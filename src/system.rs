//! The host's mechanics: mass, force, tangent and supports.

mod linear;

pub use linear::LinearSystem;

use crate::error::Result;
use crate::mass::Mass;
use crate::real::Real;
use faer::sparse::SymbolicSparseColMatRef;

/// Weights of the tangent that a stage asks for: `stiffness · K + damping · C`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentWeights<T> {
    /// Factor of K = −∂f/∂u.
    pub stiffness: T,
    /// Factor of C = −∂f/∂v.
    pub damping: T,
}

/// Whether a system has velocity-dependent forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damping {
    /// C = 0; the output was not written.
    None,
    /// The output holds C v.
    Present,
}

/// The displacements at both ends of a step, and their mean.
#[derive(Clone, Copy, Debug)]
pub struct Path<'a, T> {
    /// At the start.
    pub from: &'a [T],
    /// At the end.
    pub to: &'a [T],
    /// ½ (from + to).
    pub mean: &'a [T],
}

/// Whether a system has a force of its own for a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathForce {
    /// It has none; the output was not written.
    None,
    /// The output holds it.
    Present,
}

/// How the force of a system depends on displacements and velocities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Linearity {
    /// f = F(t) − K u − C v with constant K and C: one factorization for a run, one solve a stage.
    Linear,
    /// Anything else: each stage is solved by Newton's method.
    Nonlinear,
}

/// A mechanical system `M a = f(t, u, v) + Gᵀ λ`, with f the external minus the internal force.
///
/// Vectors have full length, supports included; the solver reads prescribed dofs from [`prescribed`](Self::prescribed)
/// and never solves for them. Evaluations are pure: they may use scratch, but two calls with the same arguments give
/// the same result; only [`commit`](Self::commit) moves history. M is constant, M and the tangent are symmetric.
///
/// A host writes five methods: [`dofs`](Self::dofs), [`mass`](Self::mass), [`force`](Self::force),
/// [`pattern`](Self::pattern) and [`tangent`](Self::tangent) (compared with differences of the force by
/// [`verify::tangent`](crate::verify::tangent)); the others have defaults. `&mut S` is a system too, so a host lends its
/// model. Hosts with constant matrices take [`LinearSystem`].
///
/// A force that cannot be evaluated at a trial state, because an element is turned inside out for instance, is
/// [`Error::Inadmissible`](crate::Error::Inadmissible): the step is undone, and may be taken again with a smaller h.
pub trait System<T: Real>: Send {
    /// Number of degrees of freedom, prescribed ones included.
    fn dofs(&self) -> usize;

    /// How the force depends on u and v. A system that is nonlinear must not say that it is linear; the other way round
    /// costs time only.
    fn linearity(&self) -> Linearity {
        Linearity::Nonlinear
    }

    /// The mass matrix (constant).
    fn mass(&self) -> Mass<'_, T>;

    /// `out = f(t, u, v)`: external minus internal force, `out` holding anything on entry.
    ///
    /// # Errors
    ///
    /// [`Error::Inadmissible`](crate::Error::Inadmissible) if a smaller step may help, else
    /// [`Error::Host`](crate::Error::Host).
    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()>;

    /// Pattern of K and C together, both triangles, rows sorted in each column; it never changes.
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize>;

    /// `out = weights.stiffness K + weights.damping C` at (t, u, v), with K = −∂f/∂u and C = −∂f/∂v: the values of the
    /// pattern in its order, `out` holding anything on entry.
    ///
    /// # Errors
    ///
    /// As [`force`](Self::force).
    fn tangent(&mut self, t: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()>;

    /// `out = f` of a step along a path whose internal work is the change of the potential,
    /// f_int · (to − from) = V(to) − V(from), for [`EnergyMomentum`](crate::EnergyMomentum); t and v are those of the middle.
    /// For St. Venant–Kirchhoff materials it is the force of the mean stress ½ (S(from) + S(to)) on the mean
    /// configuration, which conserves angular momentum too. Default: none; the forces at start, middle and end are then
    /// averaged by the potential.
    ///
    /// # Errors
    ///
    /// As [`force`](Self::force).
    fn force_along(&mut self, t: f64, path: Path<'_, T>, v: &[T], out: &mut [T]) -> Result<PathForce> {
        let _ = (t, path, v, out);
        Ok(PathForce::None)
    }

    /// `out = weights.stiffness K + weights.damping C` for [`force_along`](Self::force_along), with K close to
    /// −2 ∂f/∂to (which is the stiffness where f is linear) and symmetric: what is neglected costs iterations, not accuracy.
    /// Default: the tangent at the mean.
    ///
    /// # Errors
    ///
    /// As [`force`](Self::force).
    fn tangent_along(
        &mut self,
        t: f64,
        path: Path<'_, T>,
        v: &[T],
        weights: TangentWeights<T>,
        out: &mut [T],
    ) -> Result<()> {
        self.tangent(t, path.mean, v, weights, out)
    }

    /// `out =` the part of the internal force that vanishes with v (C v if it is linear), or [`Damping::None`] without
    /// touching `out`. The default is no damping. The energy balance and corrections of velocity read it.
    fn damping_force(&mut self, u: &[T], v: &[T], out: &mut [T]) -> Damping {
        let _ = (u, v, out);
        Damping::None
    }

    /// Elastic energy (½ uᵀ K u if it is linear), if the system has one; none by default. The potential of loads is not
    /// part of it.
    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        let _ = u;
        None
    }

    /// `out = external load at t`, for the energy balance. The default is no load.
    fn external_load(&mut self, t: f64, out: &mut [T]) {
        let _ = t;
        out.fill(T::zero());
    }

    /// Degrees of freedom whose motion is given, ascending.
    fn prescribed(&self) -> &[usize] {
        &[]
    }

    /// Displacement, velocity and acceleration of the prescribed dofs at t, in the order of
    /// [`prescribed`](Self::prescribed).
    fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) {
        let _ = t;
        out.fill([T::zero(); 3]);
    }

    /// Accepts the step that ends at t: history variables of the host move here and nowhere else.
    ///
    /// # Errors
    ///
    /// The host's own, as for [`force`](Self::force); the step is then undone.
    fn commit(&mut self, t: f64, u: &[T], v: &[T]) -> Result<()> {
        let _ = (t, u, v);
        Ok(())
    }
}

/// What points to a system is a system: `&mut S` lends the host's model, `Box<dyn System<T>>` is chosen at run time.
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
            fn force_along(&mut self, t: f64, path: Path<'_, T>, v: &[T], out: &mut [T]) -> Result<PathForce> {
                (**self).force_along(t, path, v, out)
            }
            fn tangent_along(
                &mut self,
                t: f64,
                path: Path<'_, T>,
                v: &[T],
                weights: TangentWeights<T>,
                out: &mut [T],
            ) -> Result<()> {
                (**self).tangent_along(t, path, v, weights, out)
            }
            fn damping_force(&mut self, u: &[T], v: &[T], out: &mut [T]) -> Damping {
                (**self).damping_force(u, v, out)
            }
            fn potential_energy(&mut self, u: &[T]) -> Option<T> {
                (**self).potential_energy(u)
            }
            fn external_load(&mut self, t: f64, out: &mut [T]) {
                (**self).external_load(t, out);
            }
            fn prescribed(&self) -> &[usize] {
                (**self).prescribed()
            }
            fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) {
                (**self).prescribed_motion(t, out);
            }
            fn commit(&mut self, t: f64, u: &[T], v: &[T]) -> Result<()> {
                (**self).commit(t, u, v)
            }
        }
    )*};
}

forward!(&mut S, Box<S>);
