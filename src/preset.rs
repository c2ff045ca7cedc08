//! Schemes, masses and corrections that go together, by name.

use crate::corrector::{Corrector, WorkBalance};
use crate::error::{Error, Result};
use crate::integrator::{Bathe, CdLagrange, GeneralizedAlpha, TimeIntegrator};
use crate::mass::{self, Redistribution};
use crate::real::Real;
use crate::sparse::Combination;
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef};

/// A time integrator and the mass matrix (and corrections, if any) that go with it.
///
/// What each buys and costs is measured in `docs/corrections.md`. Known bias: the mass of the contact dofs goes to the
/// rest of the body, whose impedance it raises, and with it the force of lasting contact: by about 1/(3n) for n
/// elements behind the contact, a third of a percent on bars of 100 (section 4 there), more on coarse meshes.
///
/// The mass is made once, from the consistent one:
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

/// The share of their mass that neighbors of massless contact dofs give away in a [`Preset`].
const TAPER: f64 = 0.15;

/// Spectral radius of the dissipative preset.
const RADIUS: f64 = 0.9;

impl Preset {
    /// A smooth force at one solve a step: generalized-α of Chung and Hulbert with ρ∞ = 0.9, massless contact dofs, the
    /// blend of masses whose dispersion makes up for the scheme's.
    pub fn smooth() -> Self {
        Self(Kind::Smooth)
    }

    /// The best energy over many bounces, with a force as smooth: Bathe's scheme without dissipation (ρ∞ = 1, two
    /// solves a step) on the same mass.
    pub fn conservative() -> Self {
        Self(Kind::Conservative)
    }

    /// The cheapest step: central differences on a lumped mass, whose contact dofs have none: they follow the others
    /// statically, so that nothing is stopped at first touch and impact costs no energy, at any Courant number up to 1.
    /// The force overshoots the more the nearer that is to 1 (`docs/corrections.md` has figures): 0.9 is a good choice.
    /// Nothing is factorized but the stiffness of the contact dofs among themselves, once. For linear systems whose
    /// damping does not act on the contact dofs (proportional to mass); contact dofs with mass take [`CdLagrange`] on
    /// [`mass::lump`] alone.
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
    /// `contact` lists the dofs that become massless: those of the contact nodes, in the normal direction if it is
    /// along an axis, otherwise in all; in all directions too where contacts have friction, for what has mass along the
    /// surface rings there. `groups` are those of [`mass::redistribute`]: one number a body and direction.
    /// `neighbors` is the pattern of the stiffness matrix. `courant` is that of the elements at the contact, c h/h_e
    /// ([`mass::courant`] estimates it); the blend follows from it, up to the consistent mass.
    ///
    /// For [`explicit`](Self::explicit) the mass is lumped, and a matrix with a diagonal pattern; the Courant number is
    /// compared with 1 only.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for a Courant number that is negative or not finite, or above 1 for an explicit scheme;
    /// those of
    /// [`mass::lump`], [`mass::blend`] and [`mass::redistribute_consistent`].
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
        // (The schemes of the presets are of second order.)
        let weight =
            mass::dispersion_weight(&self.integrator().tableau(), courant).map_or(0.5, |weight| weight.min(1.0));
        let blend = mass::blend(consistent, &lumped, weight)?;
        mass::redistribute_consistent(blend.as_ref(), contact, groups, by)
    }
}
