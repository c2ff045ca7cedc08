//! The wrapper of a system for steps over ranks: shares forces, sums energies, and proceeds only when all ranks
//! agree.

use super::{Ranks, Together};
use crate::error::Result;
use crate::mass::Mass;
use crate::real::Real;
use crate::system::{DampingForce, Linearity, Path, PathForce, System, TangentWeights};
use faer::sparse::SymbolicSparseColMatRef;
use std::sync::Arc;

/// The host's system and its ranks.
pub(crate) struct AgreedSystem<'a, T: Real> {
    inner: Box<dyn System<T> + 'a>,
    together: Together<T>,
    /// The lumped mass, with the owner's value at each dof.
    mass: Vec<T>,
}

impl<'a, T: Real> AgreedSystem<'a, T> {
    /// The system of a host that has ranks.
    pub(crate) fn new(inner: Box<dyn System<T> + 'a>, together: Together<T>) -> Result<Self> {
        let mut mass = match inner.mass() {
            Mass::Lumped(mass) => mass.to_vec(),
            Mass::Consistent(_) => Vec::new(),
        };
        if !mass.is_empty() {
            together.share(&mut mass)?;
        }
        Ok(Self { inner, together, mass })
    }

    /// Shares data written by the host, once all ranks have written them.
    fn shared(&self, result: Result<()>, out: &mut [T]) -> Result<()> {
        self.together.agree(result)?;
        self.together.share(out)
    }
}

impl<T: Real> System<T> for AgreedSystem<'_, T> {
    fn dofs(&self) -> usize {
        self.inner.dofs()
    }

    fn linearity(&self) -> Linearity {
        self.inner.linearity()
    }

    fn mass(&self) -> Mass<'_, T> {
        match self.mass.is_empty() {
            true => self.inner.mass(),
            false => Mass::Lumped(&self.mass),
        }
    }

    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        let result = self.inner.force(t, u, v, out);
        self.shared(result, out)
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.inner.pattern()
    }

    fn tangent(&mut self, t: f64, u: &[T], v: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
        self.inner.tangent(t, u, v, weights, out)
    }

    fn path_force(&mut self) -> Option<&mut dyn PathForce<T>> {
        self.inner.path_force().is_some().then_some(self)
    }

    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
        self.inner.damping_force().is_some().then_some(self)
    }

    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        let part = self.inner.potential_energy(u)?;
        // If ranks cannot be reached the result is NaN; an energy that is not finite is rejected where it is used.
        Some(self.together.sum(Ok([part.value()])).map_or(T::nan(), |[sum]| T::of(sum)))
    }

    fn external_load(&mut self, t: f64, out: &mut [T]) -> Result<()> {
        let result = self.inner.external_load(t, out);
        self.shared(result, out)
    }

    fn highest_frequency(&mut self) -> Option<f64> {
        let own = self.inner.highest_frequency().unwrap_or(f64::INFINITY);
        let highest = self.together.max(Ok([own]));
        highest.ok().map(|[highest]| highest).filter(|highest| highest.is_finite())
    }

    fn ranks(&self) -> Option<Arc<dyn Ranks<T>>> {
        self.inner.ranks()
    }

    fn prescribed(&self) -> &[usize] {
        self.inner.prescribed()
    }

    fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) -> Result<()> {
        self.inner.prescribed_motion(t, out)
    }

    fn commit(&mut self, t: f64, u: &[T], v: &[T]) -> Result<()> {
        // No history variables change while a rank may still fail.
        self.together.agree(Ok(()))?;
        let result = self.inner.commit(t, u, v);
        self.together.agree(result)
    }
}

impl<T: Real> DampingForce<T> for AgreedSystem<'_, T> {
    fn evaluate(&mut self, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        let damping = self.inner.damping_force();
        let result = damping.map_or(Ok(()), |damping| damping.evaluate(u, v, out));
        self.shared(result, out)
    }
}

impl<T: Real> PathForce<T> for AgreedSystem<'_, T> {
    fn force_along(&mut self, t: f64, path: Path<'_, T>, v: &[T], out: &mut [T]) -> Result<()> {
        let result = match self.inner.path_force() {
            Some(own) => own.force_along(t, path, v, out),
            None => self.inner.force(t, path.mean, v, out),
        };
        self.shared(result, out)
    }

    fn tangent_along(
        &mut self,
        t: f64,
        path: Path<'_, T>,
        v: &[T],
        weights: TangentWeights<T>,
        out: &mut [T],
    ) -> Result<()> {
        match self.inner.path_force() {
            Some(own) => own.tangent_along(t, path, v, weights, out),
            None => self.inner.tangent(t, path.mean, v, weights, out),
        }
    }
}
