//! Linear systems: constant M, C and K, a time-dependent load, fixed and driven dofs.

use super::{DampingForce, Linearity, System, TangentWeights};
use crate::error::{Error, Result};
use crate::mass::Mass;
use crate::ranks::{Ranks, Together};
use crate::real::Real;
use crate::sparse::{self, Combination, Product, Symmetry};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef};
use std::sync::Arc;

type Load<'a, T> = Box<dyn FnMut(f64, &mut [T]) -> Result<()> + Send + 'a>;
type Motion<'a, T> = Box<dyn FnMut(f64) -> Result<[T; 3]> + Send + 'a>;

/// `M a + C v + K u = F(t) + Gᵀ λ` with constant M, C and K (both triangles stored), M symmetric.
///
/// A mass matrix without off-diagonal entries is recognized as lumped. Without damping no damping product is
/// computed.
///
/// C (gyroscopic forces) and K (circulatory forces, follower loads) may be unsymmetric. A scheme with them in its
/// effective matrix then needs [`Lu`](crate::Lu) as its linear solver; other solvers reject them with
/// [`Error::Asymmetric`]. An unsymmetric K has no potential: [`Energy::potential`](crate::Energy) is then none, and
/// the work of K u is in the remainder of the energy balance. A gyroscopic C does no work and does not disturb the
/// balance.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{LinearSystem, System};
///
/// // A mass on a spring, and a driven support at the other end of the spring.
/// let k = SparseColMat::try_new_from_triplets(
///     2, 2, &[Triplet::new(0, 0, 9.0), Triplet::new(0, 1, -9.0), Triplet::new(1, 0, -9.0), Triplet::new(1, 1, 9.0)],
/// )?;
/// let mut system = LinearSystem::lumped(vec![1.0, 1.0], k)?
///     .rayleigh(0.0, 1e-3)?
///     .load(|t, force| force[1] = t)
///     .drive(0, |t: f64| [t.sin(), t.cos(), -t.sin()])?;
/// let mut force = [0.0; 2];
/// system.force(2.0, &[0.0, 1.0], &[0.0, 0.0], &mut force)?;
/// assert_eq!(force, [9.0, -7.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LinearSystem<'a, T: Real> {
    mass: StoredMass<T>,
    stiffness: SparseColMat<usize, T>,
    /// How K is multiplied.
    product: Product<T>,
    damping: StoredDamping<T>,
    /// K and a general C in one pattern; without C the pattern of K suffices.
    union: Option<Combination>,
    load: Option<Load<'a, T>>,
    prescribed: Vec<usize>,
    motions: Vec<Option<Motion<'a, T>>>,
    scratch: Vec<T>,
    ranks: Option<Arc<dyn Ranks<T>>>,
}

enum StoredMass<T> {
    Lumped(Vec<T>),
    Consistent(SparseColMat<usize, T>),
}

enum StoredDamping<T> {
    None,
    /// C = mass · M + stiffness · K.
    Rayleigh {
        mass: T,
        stiffness: T,
    },
    General(SparseColMat<usize, T>, Product<T>),
}

impl<T: Real> std::fmt::Debug for LinearSystem<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LinearSystem")
            .field("dofs", &self.dofs())
            .field("entries", &self.stiffness.row_idx().len())
            .field("prescribed", &self.prescribed)
            .finish_non_exhaustive()
    }
}

impl<'a, T: Real> LinearSystem<'a, T> {
    /// A system with mass matrix M (diagonal entries only: lumped) and stiffness matrix K.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`], [`Error::Dimension`], [`Error::MatrixNotFinite`], [`Error::Asymmetric`] for an unsymmetric M
    /// and for a K with entries in one triangle only (if intended, store a zero in the other one), [`Error::Mass`]
    /// for a negative diagonal mass. Zero is allowed on fixed or driven dofs, and elsewhere with schemes that support
    /// [dofs without mass](crate::analysis::massless_factor).
    pub fn new(mass: SparseColMat<usize, T>, stiffness: SparseColMat<usize, T>) -> Result<Self> {
        sparse::check_symmetric("mass", mass.as_ref())?;
        let n = mass.nrows();
        let off_diagonal = |j: usize| {
            let column = mass.as_ref();
            let entries = column.row_idx_of_col_raw(j).iter().zip(column.val_of_col(j));
            entries.filter(|&(&i, &value)| i != j && value != T::zero()).count()
        };
        let diagonal = (0..n).map(|j| sparse::entry(mass.as_ref(), j, j)).collect();
        if (0..n).all(|j| off_diagonal(j) == 0) {
            Self::lumped(diagonal, stiffness)
        } else {
            check_masses(&diagonal)?;
            Self::with(StoredMass::Consistent(mass), n, stiffness)
        }
    }

    /// A system with lumped masses, one per dof.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn lumped(mass: Vec<T>, stiffness: SparseColMat<usize, T>) -> Result<Self> {
        check_masses(&mass)?;
        let n = mass.len();
        Self::with(StoredMass::Lumped(mass), n, stiffness)
    }

    fn with(mass: StoredMass<T>, n: usize, stiffness: SparseColMat<usize, T>) -> Result<Self> {
        if n == 0 {
            return Err(Error::Empty { what: "the system", remedy: "give it at least one dof" });
        }
        // If K is square and the sizes differ, the mass is reported; otherwise K.
        let dofs = stiffness.nrows();
        if dofs == stiffness.ncols() && dofs != n {
            return Err(Error::Dimension {
                what: "the mass (the stiffness matrix counts the dofs)",
                expected: dofs,
                found: n,
            });
        }
        same_size("stiffness matrix", n, stiffness.as_ref())?;
        let mut product = Product::new(stiffness.as_ref(), sparse::symmetry("stiffness", stiffness.as_ref())?)?;
        product.pack_large(stiffness.as_ref())?;
        Ok(Self {
            mass,
            stiffness,
            product,
            damping: StoredDamping::None,
            union: None,
            load: None,
            prescribed: Vec::new(),
            motions: Vec::new(),
            scratch: Vec::new(),
            ranks: None,
        })
    }

    /// Damping by a matrix C; replaces earlier damping.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`], [`Error::MatrixNotFinite`], [`Error::Asymmetric`] for a C of one triangle.
    pub fn damping(mut self, damping: SparseColMat<usize, T>) -> Result<Self> {
        same_size("damping matrix", self.dofs(), damping.as_ref())?;
        let product = Product::new(damping.as_ref(), sparse::symmetry("damping", damping.as_ref())?)?;
        self.union = Some(Combination::new(self.dofs(), &[], &[self.stiffness.symbolic(), damping.symbolic()])?);
        self.damping = StoredDamping::General(damping, product);
        Ok(self)
    }

    /// Rayleigh damping C = `mass` M + `stiffness` K (units 1/s and s); replaces earlier damping.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for a negative or non-finite coefficient.
    pub fn rayleigh(mut self, mass: T, stiffness: T) -> Result<Self> {
        for (name, value) in [("Rayleigh's mass coefficient", mass), ("Rayleigh's stiffness coefficient", stiffness)] {
            if !(value >= T::zero() && value.is_finite()) {
                return Err(Error::Parameter { name, value: value.value(), range: "finite and not negative" });
            }
        }
        self.damping = match mass + stiffness {
            none if none == T::zero() => StoredDamping::None,
            _ => StoredDamping::Rayleigh { mass, stiffness },
        };
        self.union = match mass > T::zero() {
            true => {
                let consistent_mass = match &self.mass {
                    StoredMass::Consistent(m) => Some(m.symbolic()),
                    StoredMass::Lumped(_) => None,
                };
                let sources: Vec<_> = std::iter::once(self.stiffness.symbolic()).chain(consistent_mass).collect();
                Some(Combination::new(self.dofs(), &[], &sources)?)
            }
            false => None,
        };
        self.scratch = vec![T::zero(); self.dofs()];
        Ok(self)
    }

    /// The external load F(t): the closure adds to (or sets entries of) a vector that is zero on entry. Replaces an
    /// earlier load.
    #[must_use]
    pub fn load(self, mut load: impl FnMut(f64, &mut [T]) + Send + 'a) -> Self {
        self.try_load(move |t, out| {
            load(t, out);
            Ok(())
        })
    }

    /// The external load F(t) of a closure that may fail, otherwise as [`load`](Self::load). Its error
    /// ([`Error::Host`], or [`Error::Inadmissible`] if a smaller step may help) undoes the step.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{Error, GeneralizedAlpha, LinearSystem, Simulation};
    ///
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)])?;
    /// let recorded = [0.0, 1.0, 4.0]; // the load at t = 0, 1, 2
    /// let system = LinearSystem::lumped(vec![1.0], k)?.try_load(move |t, force| {
    ///     let known = recorded.get(t.round() as usize);
    ///     force[0] = *known.ok_or(Error::Host { callback: "load", source: "nothing recorded".into() })?;
    ///     Ok(())
    /// });
    /// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 1.0).build()?;
    /// run.run_until(2.0, &mut ())?;
    /// assert!(matches!(run.step(), Err(Error::Host { callback: "load", .. })));
    /// assert_eq!(run.time(), 2.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn try_load(mut self, load: impl FnMut(f64, &mut [T]) -> Result<()> + Send + 'a) -> Self {
        self.load = Some(Box::new(load));
        self
    }

    /// Marks this as one rank's part of a system: the matrices of the elements that touch its own dofs, over all dofs
    /// that it has. [`Ranks`] describes the data of each rank.
    #[must_use]
    pub fn over_ranks(mut self, ranks: Arc<dyn Ranks<T>>) -> Self {
        self.ranks = Some(ranks);
        self
    }

    /// Fixes a dof at zero displacement.
    ///
    /// # Errors
    ///
    /// [`Error::MissingDof`], [`Error::RepeatedDof`].
    pub fn fix(self, dof: usize) -> Result<Self> {
        self.prescribe(dof, None)
    }

    /// Drives a dof: the closure returns displacement, velocity and acceleration at t, which must be derivatives of
    /// each other.
    ///
    /// # Errors
    ///
    /// [`Error::MissingDof`], [`Error::RepeatedDof`].
    pub fn drive(self, dof: usize, mut motion: impl FnMut(f64) -> [T; 3] + Send + 'a) -> Result<Self> {
        self.try_drive(dof, move |t| Ok(motion(t)))
    }

    /// Drives a dof by a closure that may fail, otherwise as [`drive`](Self::drive). Its error ([`Error::Host`], or
    /// [`Error::Inadmissible`] if a smaller step may help) undoes the step.
    ///
    /// # Errors
    ///
    /// [`Error::MissingDof`], [`Error::RepeatedDof`].
    pub fn try_drive(self, dof: usize, motion: impl FnMut(f64) -> Result<[T; 3]> + Send + 'a) -> Result<Self> {
        self.prescribe(dof, Some(Box::new(motion)))
    }

    fn prescribe(mut self, dof: usize, motion: Option<Motion<'a, T>>) -> Result<Self> {
        let dofs = self.dofs();
        if dof >= dofs {
            return Err(Error::MissingDof { what: "a support", dof, dofs });
        }
        match self.prescribed.binary_search(&dof) {
            Ok(_) => Err(Error::RepeatedDof { what: "the list of supports", dof }),
            Err(at) => {
                self.prescribed.insert(at, dof);
                self.motions.insert(at, motion);
                Ok(self)
            }
        }
    }

    /// The stiffness matrix.
    pub fn stiffness(&self) -> SparseColMatRef<'_, usize, T> {
        self.stiffness.as_ref()
    }
}

/// Rejects masses that are negative or not finite. Building a simulation rejects zero masses if the scheme does not
/// admit them.
fn check_masses<T: Real>(mass: &[T]) -> Result<()> {
    match mass.iter().position(|&m| !(m >= T::zero() && m.is_finite())) {
        Some(dof) => Err(Error::Mass { dof, value: mass[dof].value() }),
        None => Ok(()),
    }
}

fn same_size<T>(what: &'static str, n: usize, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
    match [a.nrows(), a.ncols()].into_iter().find(|&size| size != n) {
        Some(found) => Err(Error::Dimension { what, expected: n, found }),
        None => Ok(()),
    }
}

impl<T: Real> StoredMass<T> {
    fn view(&self) -> Mass<'_, T> {
        match self {
            Self::Lumped(m) => Mass::Lumped(m),
            Self::Consistent(m) => Mass::Consistent(m.as_ref()),
        }
    }
}

impl<T: Real> System<T> for LinearSystem<'_, T> {
    fn dofs(&self) -> usize {
        self.stiffness.nrows()
    }

    fn linearity(&self) -> Linearity {
        Linearity::Linear
    }

    fn mass(&self) -> Mass<'_, T> {
        self.mass.view()
    }

    fn force(&mut self, t: f64, u: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        let minus = -T::one();
        if let StoredDamping::Rayleigh { stiffness, .. } = &self.damping {
            // One product with K gives both: K (u + βv).
            self.scratch.copy_from_slice(u);
            T::axpy(*stiffness, v, &mut self.scratch);
        }
        let moved = if let StoredDamping::Rayleigh { .. } = &self.damping { &self.scratch[..] } else { u };
        match &mut self.load {
            None => self.product.write(minus, self.stiffness.as_ref(), moved, out),
            Some(load) => {
                out.fill(T::zero());
                load(t, out)?;
                self.product.add(minus, self.stiffness.as_ref(), moved, out);
            }
        }
        match &mut self.damping {
            StoredDamping::General(c, product) => product.add(minus, c.as_ref(), v, out),
            StoredDamping::Rayleigh { mass, .. } if *mass > T::zero() => self.mass.view().add_product(-*mass, v, out),
            StoredDamping::None | StoredDamping::Rayleigh { .. } => {}
        }
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.union.as_ref().map_or(self.stiffness.symbolic(), Combination::pattern)
    }

    fn tangent(&mut self, _: f64, _: &[T], _: &[T], weights: TangentWeights<T>, out: &mut [T]) -> Result<()> {
        let TangentWeights { stiffness: ku, damping: kv } = weights;
        let k = self.stiffness.val();
        match (&self.union, &self.damping) {
            (Some(union), StoredDamping::General(c, _)) => union.fill(&[(ku, k), (kv, c.val())], None, out),
            (Some(union), StoredDamping::Rayleigh { mass, stiffness }) => match &self.mass {
                StoredMass::Lumped(m) => union.fill(&[(ku + kv * *stiffness, k)], Some((kv * *mass, m)), out),
                StoredMass::Consistent(m) => {
                    union.fill(&[(ku + kv * *stiffness, k), (kv * *mass, m.val())], None, out);
                }
            },
            (None, StoredDamping::Rayleigh { stiffness, .. }) => T::scale_into(ku + kv * *stiffness, k, out),
            (_, _) => T::scale_into(ku, k, out),
        }
        Ok(())
    }

    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<T>> {
        match self.damping {
            StoredDamping::None => None,
            StoredDamping::General(..) | StoredDamping::Rayleigh { .. } => Some(self),
        }
    }

    fn potential_energy(&mut self, u: &[T]) -> Option<T> {
        if self.product.symmetry() == Symmetry::General {
            return None;
        }
        let k = self.stiffness.as_ref();
        let together = Together::new(self.ranks());
        let energy = |j: usize| {
            let entries = k.row_idx_of_col_raw(j).iter().zip(k.val_of_col(j));
            u[j] * entries.map(|(&i, &value)| value * u[i]).sum::<T>()
        };
        // On ranks: only the owned rows.
        Some(T::of(0.5) * together.owned(u.len()).map(|part| part.map(energy).sum::<T>()).sum::<T>())
    }

    fn external_load(&mut self, t: f64, out: &mut [T]) -> Result<()> {
        out.fill(T::zero());
        self.load.as_mut().map_or(Ok(()), |load| load(t, out))
    }

    fn ranks(&self) -> Option<Arc<dyn Ranks<T>>> {
        self.ranks.clone()
    }

    fn prescribed(&self) -> &[usize] {
        &self.prescribed
    }

    fn prescribed_motion(&mut self, t: f64, out: &mut [[T; 3]]) -> Result<()> {
        for (motion, out) in self.motions.iter_mut().zip(out) {
            *out = motion.as_mut().map_or(Ok([T::zero(); 3]), |motion| motion(t))?;
        }
        Ok(())
    }
}

impl<T: Real> DampingForce<T> for LinearSystem<'_, T> {
    fn evaluate(&mut self, _: &[T], v: &[T], out: &mut [T]) -> Result<()> {
        match &mut self.damping {
            StoredDamping::None => out.fill(T::zero()),
            StoredDamping::General(c, product) => product.write(T::one(), c.as_ref(), v, out),
            StoredDamping::Rayleigh { mass, stiffness } => {
                self.product.write(*stiffness, self.stiffness.as_ref(), v, out);
                self.mass.view().add_product(*mass, v, out);
            }
        }
        Ok(())
    }
}
