//! Parameters of the model: from the derivatives by forces to the derivatives by what the forces depend on.

use crate::contact::{ContactId, ContactLaw};
use crate::error::Result;
use crate::real::Real;
use crate::system::System;

/// The motion at which the balance M a = f(t, u, v) + Gᵀ λ of a stage holds.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Balance<'a, T> {
    /// The time of the force.
    pub t: f64,
    /// Displacements, one a dof.
    pub displacement: &'a [T],
    /// Velocities, one a dof.
    pub velocity: &'a [T],
    /// Accelerations, one a dof.
    pub acceleration: &'a [T],
}

/// A contact under a compliant law that carries a force, where the balance of a stage holds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CompliantContact<T> {
    /// Its name.
    pub id: ContactId,
    /// Its law.
    pub law: ContactLaw,
    /// Its gap; negative.
    pub gap: T,
    /// The rate of its gap.
    pub rate: T,
    /// Its force λ.
    pub force: T,
}

/// Parameters θ of the forces, the damping and the mass of a system. A run back calls the methods for every stage; the
/// implementor adds up dJ/dθ. `()` has no parameters.
///
/// ```
/// use contact_dynamics::gradient::{Balance, Parameters};
/// use contact_dynamics::{Result, System};
///
/// /// dJ/dk of the springs between dofs i and i + 1.
/// struct Springs(Vec<f64>);
///
/// impl Parameters<f64> for Springs {
///     fn force(&mut self, _: &mut dyn System<f64>, at: &Balance<'_, f64>, w: &[f64]) -> Result<()> {
///         let u = at.displacement;
///         for (i, derivative) in self.0.iter_mut().enumerate() {
///             *derivative -= (w[i + 1] - w[i]) * (u[i + 1] - u[i]);
///         }
///         Ok(())
///     }
/// }
/// ```
pub trait Parameters<T: Real> {
    /// The forces of a stage, or their change by a correction: adds wᵀ ∂f/∂θ, with w = dJ/df, one a dof. Default:
    /// forces have no parameters.
    ///
    /// # Errors
    ///
    /// The host's own, and those of the system.
    fn force(&mut self, system: &mut dyn System<T>, at: &Balance<'_, T>, w: &[T]) -> Result<()> {
        let _ = (system, at, w);
        Ok(())
    }

    /// Accelerations `a` of a stage, or jumps of them and of velocities: adds −wᵀ ∂M/∂θ a. Default: the mass has no
    /// parameters.
    ///
    /// # Errors
    ///
    /// As [`force`](Self::force).
    fn inertia(&mut self, system: &mut dyn System<T>, a: &[T], w: &[T]) -> Result<()> {
        let _ = (system, a, w);
        Ok(())
    }

    /// The force λ of a contact under a compliant law: adds w ∂λ/∂θ at a fixed gap and rate. Default: laws have no
    /// parameters.
    ///
    /// ```
    /// use contact_dynamics::ContactLaw;
    /// use contact_dynamics::gradient::{CompliantContact, Parameters};
    ///
    /// /// dJ/dk and dJ/dc of Kelvin and Voigt's law, λ = −k g − c ġ.
    /// #[derive(Default)]
    /// struct Stop([f64; 2]);
    ///
    /// impl Parameters<f64> for Stop {
    ///     fn contact(&mut self, contact: &CompliantContact<f64>, w: f64) {
    ///         if matches!(contact.law, ContactLaw::KelvinVoigt { .. }) {
    ///             self.0[0] -= w * contact.gap;
    ///             self.0[1] -= w * contact.rate;
    ///         }
    ///     }
    /// }
    /// ```
    fn contact(&mut self, contact: &CompliantContact<T>, w: T) {
        let _ = (contact, w);
    }
}

impl<T: Real> Parameters<T> for () {}

/// The derivatives by factors of M, of the internal force p, of the damping force d, of the load F, and of the forces φ
/// of compliant contacts, in s_M M a + s_C d(u, v) + s_K p(u) = s_F F(t) + Gᵀ λ, λ = s_λ φ(g, ġ), at the factors 1. For a modulus E of the whole body
/// `stiffness` is E dJ/dE.
///
/// Systems must have an [`external_load`](System::external_load), if they have a load, and a
/// [`damping_force`](System::damping_force), if they have damping.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Scales<T> {
    /// dJ/ds_M.
    pub mass: T,
    /// dJ/ds_C.
    pub damping: T,
    /// dJ/ds_K.
    pub stiffness: T,
    /// dJ/ds_F.
    pub load: T,
    /// dJ/ds_λ.
    pub contact: T,
    work: [Vec<T>; 3],
}

impl<T: Real> Parameters<T> for Scales<T> {
    fn force(&mut self, system: &mut dyn System<T>, at: &Balance<'_, T>, w: &[T]) -> Result<()> {
        let (u, v) = (at.displacement, at.velocity);
        for values in &mut self.work {
            values.clear();
            values.resize(w.len(), T::zero());
        }
        let [load, damping, all] = &mut self.work;
        system.external_load(at.t, load)?;
        if let Some(law) = system.damping_force() {
            law.evaluate(u, v, damping)?;
        }
        system.force(at.t, u, v, all)?;
        for (((&w, &load), &damping), &all) in w.iter().zip(&*load).zip(&*damping).zip(&*all) {
            self.load += w * load;
            self.damping -= w * damping;
            self.stiffness -= w * (load - damping - all);
        }
        Ok(())
    }

    fn inertia(&mut self, system: &mut dyn System<T>, a: &[T], w: &[T]) -> Result<()> {
        let [product, ..] = &mut self.work;
        product.clear();
        product.resize(w.len(), T::zero());
        system.mass().add_product(T::one(), a, product);
        self.mass -= w.iter().zip(&*product).map(|(&w, &product)| w * product).sum::<T>();
        Ok(())
    }

    fn contact(&mut self, contact: &CompliantContact<T>, w: T) {
        self.contact += w * contact.force;
    }
}
