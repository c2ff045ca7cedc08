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

/// A mechanical system `M a = f(t, u, v) + Gᵀ λ`, with f the external minus the internal force.
///
/// Vectors have full length, supports included; the solver reads prescribed dofs from [`prescribed`](Self::prescribed)
/// and never solves for them. In this version f is affine in u and v (constant K and C). Evaluations are pure: they may
/// use scratch, but two calls with the same arguments give the same result; only [`commit`](Self::commit) moves
/// history.
///
/// `&mut S` is a system too, so a host lends its model. Most hosts have matrices and take [`LinearSystem`].
pub trait System<T: Real>: Send {
    /// Number of degrees of freedom, prescribed ones included.
    fn dofs(&self) -> usize;

    /// The mass matrix (constant).
    fn mass(&self) -> Mass<'_, T>;

    /// `out = f(t, u, v)`: external minus internal force, `out` holding anything on entry.
    ///
    /// # Errors
    ///
    /// The host's own, as [`Error::Host`](crate::Error::Host).
    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()>;

    /// Pattern of K and C together, both triangles, rows sorted in each column.
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize>;

    /// `out = weights.stiffness K + weights.damping C`, the values of the pattern in its order.
    ///
    /// # Errors
    ///
    /// The host's own, as [`Error::Host`](crate::Error::Host).
    fn tangent(&mut self, weights: TangentWeights<T>, out: &mut [T]) -> Result<()>;

    /// `out = C v`, or [`Damping::None`] without touching `out`.
    fn damping_force(&mut self, v: &[T], out: &mut [T]) -> Damping;

    /// Elastic energy ½ uᵀ K u, if the system has one. The potential of loads is not part of it.
    fn potential_energy(&mut self, u: &[T]) -> Option<T>;

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
    /// The host's own, as [`Error::Host`](crate::Error::Host); the step is then undone.
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
            fn mass(&self) -> Mass<'_, T> {
                (**self).mass()
            }
            fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
                (**self).force(t, u, v, out)
            }
            fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
                (**self).pattern()
            }
            fn tangent(&mut self, weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
                (**self).tangent(weights, out)
            }
            fn damping_force(&mut self, v: &[T], out: &mut [T]) -> Damping {
                (**self).damping_force(v, out)
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
