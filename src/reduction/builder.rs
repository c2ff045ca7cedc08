//! Builder of a reduced body: supports, contact dofs, residual flexibility, damping, constant loads.

use super::body::{Accuracy, Boundary, Matrices, Parent, ReducedBody};
use super::matrices;
use super::modes::{Modes, Wanted};
use super::pencil::{self, Pencil};
use super::residual::response;
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::kernels::dense::{add_product, transposed_product};
use crate::real::Real;
use crate::sparse;
use crate::sparse::check_vector;
use faer::sparse::{SparseColMat, SparseColMatRef};

/// Largest ω h at which steps resolve a mode.
const RESOLVED: f64 = 2.5;

/// The softening with the least error behind a front.
const SOFTENING: f64 = 2.0;

/// The longest step for modes with this cutoff.
fn longest_step(modes: &Modes) -> f64 {
    let highest = modes.frequencies.last().copied().unwrap_or(0.0);
    RESOLVED / if modes.next_frequency().is_finite() { modes.next_frequency() } else { highest }
}

enum Damping<'a> {
    None,
    Ratio(Box<dyn Fn(f64) -> f64 + 'a>),
    Rayleigh([f64; 2]),
}

/// Reduces a body to normal modes η and its contact dofs u_b.
///
/// The body is given by M and K as for a [`LinearSystem`](crate::LinearSystem), with or without supports, and by the
/// dofs on which contact acts: normal dofs, and tangential ones for friction. With the modes φ_k, ω_k and weights
/// σ_k² = 1 − (ω_k/ω_c)³, where ω_c is the first frequency left out,
///
/// ```math
/// \begin{aligned}
/// & \ddot\eta + \Omega^2 \eta = P^T \lambda + \Sigma \Phi^T f, \qquad u_b = P \eta + F \lambda, \qquad
///   P = \Phi_b \Sigma \\
/// & F = \sum_k (1 - \sigma_k^2) \frac{\varphi_{b,k} \varphi_{b,k}^T}{\omega_k^2} + 3 R, \qquad
///   R = \sum_{\text{left out}} \frac{\varphi_{b,k} \varphi_{b,k}^T}{\omega_k^2}
/// \end{aligned}
/// ```
///
/// (of 3 R, statics need one R, the others are [`softening`](Self::softening)). Over (η, u_b) this has M = diag(I, 0)
/// and a stiffness built from Ω², P and F⁻¹. The contact dofs have no mass: use schemes for [dofs without
/// mass](crate::analysis::massless_factor), such as the schemes of [`Preset`](crate::Preset), and no corrector.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::reduction::Reduction;
/// use contact_dynamics::{Bathe, LinearRows, Simulation};
///
/// // A bar of 200 elements (c = 100, ρA = 1, L = 10) flies at a wall with v = −1: force ρ A c v = 100 for 2L/c = 0.2.
/// let (n, size) = (200, 0.05);
/// let bar = |diagonal: f64, off: f64| {
///     let element = |e: usize| [(e, e, diagonal), (e + 1, e + 1, diagonal), (e, e + 1, off), (e + 1, e, off)];
///     let entries: Vec<_> = (0..n).flat_map(element).map(|(i, j, x)| Triplet::new(i, j, x)).collect();
///     SparseColMat::<usize, f64>::try_new_from_triplets(n + 1, n + 1, &entries)
/// };
/// let (m, k) = (bar(size / 3.0, size / 6.0)?, bar(1e4 / size, -1e4 / size)?);
/// let body = Reduction::new(m.as_ref(), k.as_ref(), &[0]).modes(20)?;
/// assert_eq!((body.dofs(), body.rigid()), (21, 1));
///
/// let end = body.contact_dofs().start;
/// let mut run = Simulation::builder(body.system()?, Bathe::with_radius(1.0)?, 1e-3)
///     .velocity(body.velocity(&vec![-1.0; n + 1])?)
///     .constraint(LinearRows::new().unilateral(&[(end, 1.0)], 0.05))
///     .build()?;
/// run.run_until(0.15, &mut ())?;
/// assert!((run.state().contacts().forces()[0] / 100.0 - 1.0).abs() < 0.05);
/// run.run_until(0.5, &mut ())?;
/// let field = body.recover_velocity(run.state().velocity())?;
/// assert!((field.iter().sum::<f64>() / 201.0 - 1.0).abs() < 0.02); // it flies back
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Reduction<'a, T: Real> {
    mass: SparseColMatRef<'a, usize, T>,
    stiffness: SparseColMatRef<'a, usize, T>,
    contact: Vec<usize>,
    fixed: Vec<usize>,
    boundary: Boundary,
    exponent: f64,
    /// `None` until chosen.
    softening: Option<f64>,
    damping: Damping<'a>,
    load: Option<Vec<T>>,
}

impl<T: Real> std::fmt::Debug for Reduction<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let contact = self.contact.len();
        f.debug_struct("Reduction").field("contact", &contact).field("boundary", &self.boundary).finish_non_exhaustive()
    }
}

/// The interface at the contact dofs, in `f64`: fields on the free dofs.
struct Interface {
    /// Weights σ_k of the modes.
    sigma: Vec<f64>,
    /// Static responses S to forces at the contact dofs beyond the responses of the modes (responses to displacements
    /// for [`Boundary::CraigBampton`]), column by column.
    fields: Vec<f64>,
    /// F⁻¹, row by row; the stiffness of the contact dofs.
    stiffness: Vec<f64>,
    accuracy: Accuracy,
}

impl<'a, T: Real> Reduction<'a, T> {
    /// For a body with mass M and stiffness K (both triangles stored), with the contact dofs `contact` in any order.
    /// The inputs are checked when modes are computed.
    pub fn new(
        mass: SparseColMatRef<'a, usize, T>,
        stiffness: SparseColMatRef<'a, usize, T>,
        contact: &[usize],
    ) -> Self {
        Self {
            mass,
            stiffness,
            contact: contact.to_vec(),
            fixed: Vec::new(),
            boundary: Boundary::default(),
            exponent: 3.0,
            softening: None,
            damping: Damping::None,
            load: None,
        }
    }

    /// Holds dofs at zero displacement; replaces earlier supports.
    #[must_use]
    pub fn fix(self, dofs: &[usize]) -> Self {
        Self { fixed: dofs.to_vec(), ..self }
    }

    /// The interface between modes and contact dofs; default [`Boundary::Tapered`].
    #[must_use]
    pub fn boundary(self, boundary: Boundary) -> Self {
        Self { boundary, ..self }
    }

    /// The exponent p of the taper σ² = 1 − (ω/ω_c)^p; default 3, which has the least error behind a front
    /// (`docs/reduction.md`). With a larger p more modes count fully.
    #[must_use]
    pub fn exponent(self, exponent: f64) -> Self {
        Self { exponent, ..self }
    }

    /// How many times the residual flexibility R is added to the statically exact flexibility, if tapered; default 2,
    /// which has the least error behind a front. With 0 statics are exact, as needed for small contacts that grow
    /// slowly, and behind a front the force overshoots by half of it (`docs/reduction.md`).
    ///
    /// If contact dofs of the parent have no mass, the force does not ring and R is the flexibility of a layer of
    /// elements. The default would only soften the body, so the build rejects a tapered body then unless a softening
    /// was chosen.
    #[must_use]
    pub fn softening(self, times: f64) -> Self {
        Self { softening: Some(times), ..self }
    }

    /// Damping ratio of the modes as a function of circular frequency; replaces earlier damping. Rigid motions and
    /// the static response are not damped.
    #[must_use]
    pub fn damping_ratio(self, ratio: impl Fn(f64) -> f64 + 'a) -> Self {
        Self { damping: Damping::Ratio(Box::new(ratio)), ..self }
    }

    /// Rayleigh damping C = `mass` M + `stiffness` K (units 1/s and s), of the modes only; replaces earlier damping.
    #[must_use]
    pub fn rayleigh(self, mass: f64, stiffness: f64) -> Self {
        Self { damping: Damping::Rayleigh([mass, stiffness]), ..self }
    }

    /// A constant load, such as weight: one entry for each dof of the body. The system has it, and recovered
    /// displacements include the static response to it that the modes do not contain.
    #[must_use]
    pub fn constant_load(self, load: &[T]) -> Self {
        Self { load: Some(load.to_vec()), ..self }
    }

    /// The body reduced to the `count` lowest modes, including rigid motions, and its contact dofs.
    ///
    /// # Errors
    ///
    /// The errors of [`Modes::lowest`]; for the contact dofs [`Error::Empty`], [`Error::MissingDof`],
    /// [`Error::RepeatedDof`] and, if one is fixed, [`Error::Incompatible`]. Also [`Error::Incompatible`] if the
    /// modes leave no flexibility between them and some contact dofs, and for a tapered body whose parent has
    /// massless contact dofs unless a [`softening`](Self::softening) was chosen; [`Error::Dimension`] and
    /// [`Error::NotFinite`] for the constant load, [`Error::Parameter`] for exponent and damping;
    /// [`Error::LinearNotConverged`] if a static response is not found.
    pub fn modes(&self, count: usize) -> Result<ReducedBody<T>> {
        self.build(&|pencil| Modes::find(pencil, Wanted::Count(count)))
    }

    /// The body reduced to all modes with circular frequencies (1/time) up to `frequency`, and its contact dofs.
    ///
    /// # Errors
    ///
    /// As [`modes`](Self::modes) and [`Modes::up_to`].
    pub fn up_to(&self, frequency: f64) -> Result<ReducedBody<T>> {
        self.build(&|pencil| Modes::find(pencil, Wanted::UpTo(frequency)))
    }

    /// The body reduced to given modes, computed with the same supports, for [`Boundary::CraigBampton`] with the
    /// contact dofs held too.
    ///
    /// # Errors
    ///
    /// As [`modes`](Self::modes), and [`Error::Incompatible`] for modes of a body with other dofs or supports.
    pub fn with_modes(&self, modes: &Modes) -> Result<ReducedBody<T>> {
        self.build(&|pencil| match modes.free == pencil.free && modes.dofs() == pencil.dofs {
            true => Ok(modes.clone()),
            false => Err(Error::Incompatible {
                part: format!("a set of {} modes", modes.count()),
                reason: "they belong to a body with other dofs or supports (Craig and Bampton's modes have the contact \
                         dofs held)",
            }),
        })
    }

    fn build(&self, find: &dyn Fn(&mut Pencil) -> Result<Modes>) -> Result<ReducedBody<T>> {
        let dofs = pencil::check(self.mass, self.stiffness)?;
        let mut free = pencil::free_dofs(dofs, &self.fixed)?;
        self.check(dofs, &free)?;
        if self.boundary == Boundary::CraigBampton {
            free.retain(|dof| !self.contact.contains(dof));
            if free.is_empty() {
                return Err(Error::Empty { what: "the list of free dofs", remedy: "leave some for the modes" });
            }
        }
        let mut pencil = Pencil::new(self.mass, self.stiffness, free)?;
        let modes = find(&mut pencil)?;
        let interface = match self.boundary {
            Boundary::CraigBampton => self.held(&mut pencil, &modes)?,
            Boundary::Tapered | Boundary::Untapered => self.massless(&mut pencil, &modes)?,
        };
        let rest = self.rest(&mut pencil, &modes, &interface)?;
        let held = self.boundary == Boundary::CraigBampton;
        let (shapes, mut fields) = (pencil.expand(&modes.shapes), pencil.expand(&interface.fields));
        // P, one row per contact dof.
        let mut coupling = Vec::new();
        if held {
            self.contact.iter().enumerate().for_each(|(k, &dof)| fields[k * dofs + dof] = 1.0);
        } else {
            let column =
                |dof: usize| interface.sigma.iter().zip(shapes.chunks_exact(dofs)).map(move |(s, f)| s * f[dof]);
            coupling.extend(self.contact.iter().flat_map(|&dof| column(dof)));
        }
        let frequencies = modes.frequencies.clone();
        let [mass, stiffness] = match held {
            true => matrices::with_mass([self.mass, self.stiffness], &frequencies, [&shapes, &fields])?,
            false => matrices::massless(&frequencies, &coupling, &interface.stiffness)?,
        };
        let modal = self.modal_damping(&modes)?;
        let rayleigh = match self.damping {
            Damping::Rayleigh(coefficients) if held => Some(coefficients),
            _ => None,
        };
        let damping = match modal.is_empty() {
            true => None,
            false => Some(matrices::damping(&modal, rayleigh, [&mass, &stiffness])?.sparse()?),
        };
        let at_support = |&dof: &usize| {
            let k = self.stiffness;
            k.row_idx_of_col_raw(dof).iter().copied().zip(k.val_of_col(dof).iter().copied()).collect()
        };
        let no_memory = |_| Error::OutOfMemory { what: "the mass of the parent", bytes: None };
        let parent = Parent {
            dofs,
            contact: self.contact.clone(),
            fixed: self.fixed.clone(),
            mass: SparseColMat::new(self.mass.symbolic().to_owned().map_err(no_memory)?, self.mass.val().to_vec()),
            at_supports: self.fixed.iter().map(at_support).collect(),
            load: self.load.clone(),
            rest: scalars(&pencil.expand(&rest)),
        };
        let mut body = ReducedBody {
            parent,
            boundary: self.boundary,
            frequencies,
            rigid: modes.rigid(),
            sigma: scalars(&interface.sigma),
            shapes: scalars(&shapes),
            fields: scalars(&fields),
            weights: scalars(&interface.stiffness),
            coupling: scalars(&coupling),
            matrices: Matrices { mass: mass.sparse()?, stiffness: stiffness.sparse()?, damping, load: None },
            accuracy: interface.accuracy,
            factorizations: pencil.factorizations,
        };
        body.matrices.load = self.load.as_ref().map(|load| body.load(load)).transpose()?;
        Ok(body)
    }

    fn check(&self, dofs: usize, free: &[usize]) -> Result<()> {
        let what = "the list of contact dofs";
        if self.contact.is_empty() {
            return Err(Error::Empty { what, remedy: "name the dofs that contact acts on" });
        }
        let mut seen = vec![false; dofs];
        for &dof in &self.contact {
            if dof >= dofs {
                return Err(Error::MissingDof { what, dof, dofs });
            }
            if std::mem::replace(&mut seen[dof], true) {
                return Err(Error::RepeatedDof { what, dof });
            }
            if free.binary_search(&dof).is_err() {
                return Err(Error::Incompatible { part: format!("contact dof {dof}"), reason: "a support holds it" });
            }
        }
        if !(self.exponent >= 1.0 && self.exponent.is_finite()) {
            let name = "the exponent of the taper";
            return Err(Error::Parameter { name, value: self.exponent, range: "finite and at least 1" });
        }
        if let Some(value) = self.softening.filter(|times| !(*times >= 0.0 && times.is_finite())) {
            let name = "the softening of a tapered reduction";
            return Err(Error::Parameter { name, value, range: "finite and not negative" });
        }
        let massless = |dof: &&usize| sparse::entry(self.mass, **dof, **dof) == T::zero();
        if self.boundary == Boundary::Tapered
            && self.softening.is_none()
            && let Some(dof) = self.contact.iter().find(massless)
        {
            let count = self.contact.iter().filter(massless).count();
            return Err(Error::Incompatible {
                part: format!(
                    "a tapered reduction with contact dof {dof} (of {count} such) without mass in the parent"
                ),
                reason: "it would be too soft there: give a plain mass matrix, take `Boundary::Untapered` with many \
                         modes, or choose a `softening`",
            });
        }
        let Some(load) = &self.load else { return Ok(()) };
        check_vector("the constant load of a reduced body", load, dofs)
    }

    /// Massless contact dofs on the residual flexibility of the modes.
    fn massless(&self, pencil: &mut Pencil, modes: &Modes) -> Result<Interface> {
        let (n, count, contacts) = (pencil.size(), modes.count(), self.contact.len());
        let places: Vec<usize> =
            self.contact.iter().map(|dof| pencil.free.partition_point(|free| free < dof)).collect();
        let mut units = vec![0.0; n * contacts];
        places.iter().enumerate().for_each(|(k, &place)| units[k * n + place] = 1.0);
        let residual = response(pencil, &modes.shapes, &units)?;
        let tapered = self.boundary == Boundary::Tapered;
        let cutoff = modes.next_frequency();
        let square = |omega: f64| match tapered {
            true => 1.0 - (omega / cutoff).powf(self.exponent),
            false => 1.0,
        };
        let squares: Vec<f64> = modes.frequencies.iter().map(|&omega| square(omega)).collect();
        // The part of each mode's flexibility that the taper moves to the contact dofs.
        let of_mode = |k: usize, share: f64| if k < modes.rigid() { 0.0 } else { share / modes.frequencies[k].powi(2) };
        let at = |k: usize, contact: usize| modes.shapes[k * n + places[contact]];
        let mut shares = vec![0.0; count * contacts];
        for (contact, shares) in shares.chunks_exact_mut(count).enumerate() {
            for (k, share) in shares.iter_mut().enumerate() {
                *share = of_mode(k, 1.0 - squares[k]) * at(k, contact);
            }
        }
        let softening = if tapered { self.softening.unwrap_or(SOFTENING) } else { 0.0 };
        let times = 1.0 + softening;
        let mut fields: Vec<f64> = residual.iter().map(|x| times * x).collect();
        add_product(1.0, n, &modes.shapes, &shares, &mut fields);
        let entry = |i: usize, j: usize| 0.5 * (fields[j * n + places[i]] + fields[i * n + places[j]]);
        let stiffness = inverse(contacts, count, entry)?;
        let share = |contact: usize| {
            let left = residual[contact * n + places[contact]];
            let taken: f64 = (0..count).map(|k| of_mode(k, 1.0) * at(k, contact).powi(2)).sum();
            if left > 0.0 { left / (left + taken) } else { 0.0 }
        };
        let largest = (0..contacts).map(share).fold(0.0, f64::max);
        let (compliance, longest_step) = (softening * largest, longest_step(modes));
        let accuracy = Accuracy { residual: Some(largest), compliance, cutoff, longest_step };
        Ok(Interface { sigma: squares.into_iter().map(f64::sqrt).collect(), fields, stiffness, accuracy })
    }

    /// Static responses to displacements of the contact dofs, in addition to modes with held contact dofs.
    fn held(&self, pencil: &mut Pencil, modes: &Modes) -> Result<Interface> {
        let (n, count) = (pencil.size(), modes.count());
        let coupling = pencil::part(self.stiffness, &pencil.free, &self.contact)?;
        let mut loads = vec![0.0; n * self.contact.len()];
        for (j, load) in loads.chunks_exact_mut(n).enumerate() {
            let column = coupling.as_ref();
            column.row_idx_of_col_raw(j).iter().zip(column.val_of_col(j)).for_each(|(&row, k)| load[row] = -k);
        }
        let mut fields = response(pencil, &modes.shapes, &loads)?;
        let mut shares = vec![0.0; count * self.contact.len()];
        transposed_product(n, &modes.shapes, &loads, &mut shares);
        for shares in shares.chunks_exact_mut(count) {
            for (k, share) in shares.iter_mut().enumerate() {
                *share = if k < modes.rigid() { 0.0 } else { *share / modes.frequencies[k].powi(2) };
            }
        }
        add_product(1.0, n, &modes.shapes, &shares, &mut fields);
        let (cutoff, longest_step) = (modes.next_frequency(), longest_step(modes));
        let accuracy = Accuracy { residual: None, compliance: 0.0, cutoff, longest_step };
        Ok(Interface { sigma: vec![1.0; count], fields, stiffness: Vec::new(), accuracy })
    }

    /// The damping coefficient of each mode.
    fn modal_damping(&self, modes: &Modes) -> Result<Vec<f64>> {
        let range = "finite and not negative";
        let check = |name, value: f64| match value >= 0.0 && value.is_finite() {
            true => Ok(value),
            false => Err(Error::Parameter { name, value, range }),
        };
        let omegas = modes.frequencies.iter();
        match &self.damping {
            Damping::None => Ok(Vec::new()),
            Damping::Ratio(ratio) => omegas
                .map(|&omega| match omega > 0.0 {
                    true => Ok(2.0 * omega * check("the damping ratio of a mode", ratio(omega))?),
                    false => Ok(0.0),
                })
                .collect(),
            Damping::Rayleigh([mass, stiffness]) => {
                let mass = check("Rayleigh's mass coefficient", *mass)?;
                let stiffness = check("Rayleigh's stiffness coefficient", *stiffness)?;
                Ok(omegas.map(|&omega| mass + stiffness * omega * omega).collect())
            }
        }
    }

    /// The static response to the constant load that modes and contact dofs do not contain, zero at the contact dofs.
    fn rest(&self, pencil: &mut Pencil, modes: &Modes, interface: &Interface) -> Result<Vec<f64>> {
        let n = pencil.size();
        let Some(load) = &self.load else { return Ok(Vec::new()) };
        let load: Vec<f64> = pencil.free.iter().map(|&dof| load[dof].value()).collect();
        let mut rest = response(pencil, &modes.shapes, &load)?;
        if self.boundary == Boundary::CraigBampton {
            return Ok(rest);
        }
        // Treats the load as one more contact force: S of the load, minus the share of the contact dofs.
        if self.boundary == Boundary::Tapered {
            for x in &mut rest {
                *x *= 1.0 + self.softening.unwrap_or(SOFTENING);
            }
        }
        let mut shares = vec![0.0; modes.count()];
        transposed_product(n, &modes.shapes, &load, &mut shares);
        for (k, share) in shares.iter_mut().enumerate() {
            let left = 1.0 - interface.sigma[k] * interface.sigma[k];
            *share *= if k < modes.rigid() { 0.0 } else { left / modes.frequencies[k].powi(2) };
        }
        add_product(1.0, n, &modes.shapes, &shares, &mut rest);
        let contacts = self.contact.len();
        let mut moved = vec![0.0; contacts];
        transposed_product(n, &interface.fields, &load, &mut moved);
        let mut forces = vec![0.0; contacts];
        add_product(1.0, contacts, &interface.stiffness, &moved, &mut forces);
        add_product(-1.0, n, &interface.fields, &forces, &mut rest);
        Ok(rest)
    }
}

fn scalars<T: Real>(values: &[f64]) -> Vec<T> {
    values.iter().map(|&x| T::of(x)).collect()
}

/// F⁻¹, bitwise symmetric.
fn inverse(size: usize, modes: usize, entry: impl Fn(usize, usize) -> f64) -> Result<Vec<f64>> {
    let mut factor = DenseCholesky::<f64>::default();
    if factor.factorize(size, entry).is_err() || factor.is_singular() {
        return Err(Error::Incompatible {
            part: format!("the flexibility that {modes} modes leave at {size} contact dofs"),
            reason: "it is singular: take fewer modes, or leave out contact dofs that cannot move by themselves",
        });
    }
    let mut inverse = vec![0.0; size * size];
    for (k, column) in inverse.chunks_exact_mut(size).enumerate() {
        column[k] = 1.0;
        factor.solve(column);
    }
    for i in 0..size {
        for j in 0..i {
            let mean = 0.5 * (inverse[i * size + j] + inverse[j * size + i]);
            (inverse[i * size + j], inverse[j * size + i]) = (mean, mean);
        }
    }
    Ok(inverse)
}
