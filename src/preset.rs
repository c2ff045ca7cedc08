//! Named combinations of scheme, mass and corrections.

use crate::corrector::{Corrector, WorkBalance};
use crate::error::{Error, Result};
use crate::integrator::{Bathe, CdLagrange, GeneralizedAlpha, TimeIntegrator};
use crate::mass::{self, Redistribution};
use crate::real::Real;
use crate::sparse::Combination;
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef};

/// A time integrator with the matching mass matrix and corrections.
///
/// `docs/corrections.md` measures benefits and costs. Known bias: moving the mass of the contact dofs to the rest of
/// the body raises its impedance and the force of lasting contact, by about 1/(3n) for n elements behind the contact:
/// a third of a percent on bars of 100 elements (section 4 there), more on coarse meshes.
///
/// The mass is computed once from the consistent one:
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{LinearRows, LinearSystem, Mass, Preset, Simulation, mass};
///
/// // A bar of 50 elements falls on a floor with its first node.
/// let (n, ea, rho_a, size, h) = (50, 900.0, 1.0, 0.2, 2e-3);
/// let bar = |diagonal: f64, off: f64| {
///     let element = |e: usize| [(e, e, diagonal), (e + 1, e + 1, diagonal), (e, e + 1, off), (e + 1, e, off)];
///     let entries: Vec<_> = (0..n).flat_map(element).map(|(i, j, x)| Triplet::new(i, j, x)).collect();
///     SparseColMat::<usize, f64>::try_new_from_triplets(n + 1, n + 1, &entries)
/// };
/// let (k, m) = (bar(ea / size, -ea / size)?, bar(rho_a * size / 3.0, rho_a * size / 6.0)?);
///
/// let preset = Preset::conservative();
/// let courant = mass::courant(Mass::Consistent(m.as_ref()), k.as_ref(), h)?[0]; // 0.3 at the contact
/// let m = preset.mass(m.as_ref(), k.symbolic(), &[0], &vec![0; n + 1], courant)?;
/// let mut run = Simulation::builder(LinearSystem::new(m, k)?, preset.integrator(), h)
///     .velocity(vec![-10.0; n + 1])
///     .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 1.0))
///     .correctors(preset.correctors())
///     .build()?;
/// let before = run.energy().total();
/// run.run_until(1.0, &mut ())?;
/// assert!(run.state().displacement()[0] > 0.0 && (run.energy().total() / before - 1.0).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Smooth,
    Conservative,
    Explicit,
}

/// The share of their mass that neighbors of massless contact dofs give away.
const TAPER: f64 = 0.15;

/// Spectral radius of the dissipative preset.
const RADIUS: f64 = 0.9;

impl Preset {
    /// A smooth force with one solve per step: generalized-α of Chung and Hulbert with ρ∞ = 0.9, massless contact
    /// dofs, and the blend of masses whose dispersion cancels the dispersion of the scheme.
    pub fn smooth() -> Self {
        Self(Kind::Smooth)
    }

    /// The best energy over many bounces, with an equally smooth force: Bathe's scheme without dissipation (ρ∞ = 1,
    /// two solves per step) with the same mass.
    pub fn conservative() -> Self {
        Self(Kind::Conservative)
    }

    /// The cheapest step: central differences on a lumped mass with massless contact dofs. These follow the others
    /// statically, so that first touch stops no mass and impact costs no energy, at any Courant number up to 1. The
    /// force overshoots more the closer that number is to 1 (`docs/corrections.md` has figures): 0.9 is a good
    /// choice. Only the stiffness of the contact dofs among themselves is factorized, once. For linear systems whose
    /// damping does not act on the contact dofs (proportional to mass); for contact dofs with mass use [`CdLagrange`]
    /// with [`mass::lump`] alone.
    pub fn explicit() -> Self {
        Self(Kind::Explicit)
    }

    /// The scheme.
    pub fn integrator(&self) -> Box<dyn TimeIntegrator> {
        match self.0 {
            Kind::Smooth => Box::new(GeneralizedAlpha::of_radius(RADIUS)),
            Kind::Conservative => Box::new(Bathe::of_radius(1.0)),
            Kind::Explicit => Box::new(CdLagrange),
        }
    }

    /// The corrections: [`WorkBalance`] for the presets without dissipation, none for the other.
    pub fn correctors<T: Real>(&self) -> Vec<Box<dyn Corrector<T>>> {
        match self.0 {
            Kind::Smooth => Vec::new(),
            Kind::Conservative | Kind::Explicit => vec![Box::new(WorkBalance)],
        }
    }

    /// The mass matrix, from the consistent one.
    ///
    /// `contact` lists the dofs that become massless: the dofs of the contact nodes, in the normal direction if it is
    /// along an axis, otherwise in all directions. With friction use all directions too, because mass along the
    /// surface makes the friction force ring. `groups` are as in [`mass::redistribute`]: one number per body and
    /// direction. `neighbors` is the pattern of the stiffness matrix. `courant` is the Courant number c h/h_e of the
    /// elements at the contact ([`mass::courant`] estimates it); it determines the blend, up to the consistent mass.
    ///
    /// For [`explicit`](Self::explicit) the mass is lumped, a matrix with a diagonal pattern; the Courant number is
    /// only compared with 1.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for a Courant number that is negative or not finite, or above 1 for an explicit scheme;
    /// the errors of [`mass::lump`], [`mass::blend`] and [`mass::redistribute_consistent`].
    pub fn mass<T: Real>(
        &self,
        consistent: SparseColMatRef<'_, usize, T>,
        neighbors: SymbolicSparseColMatRef<'_, usize>,
        contact: &[usize],
        groups: &[usize],
        courant: f64,
    ) -> Result<SparseColMat<usize, T>> {
        let explicit = self.0 == Kind::Explicit;
        if !(courant >= 0.0 && courant.is_finite() && (courant <= 1.0 || !explicit)) {
            let range = if explicit { "in [0, 1]" } else { "finite and not negative" };
            return Err(Error::Parameter { name: "the Courant number of the contact elements", value: courant, range });
        }
        let lumped = mass::lump(consistent)?;
        let by = Redistribution::Tapered { neighbors, fraction: TAPER };
        if explicit {
            let mass = mass::redistribute(&lumped, contact, groups, by)?;
            return Ok(Combination::diagonal(mass.len(), &[], &[])?.into_matrix(mass));
        }
        // The schemes of the presets are of second order.
        let weight =
            mass::dispersion_weight(&self.integrator().tableau(), courant).map_or(0.5, |weight| weight.min(1.0));
        let blend = mass::blend(consistent, &lumped, weight)?;
        mass::redistribute_consistent(blend.as_ref(), contact, groups, by)
    }
}
