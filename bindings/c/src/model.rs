//! Models, from which runs are built: plain data and makers, so that one model makes any number of runs.

use crate::callback::{Callback, Load, LoadFunction, Motion, MotionFunction};
use crate::contact::MakeContact;
use crate::error::{Fault, Result, Status, entry, invalid, locked};
use crate::memory::{array, create, dofs, floats, free, handle, text};
use crate::named;
use crate::run::Run;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::matrix::{Stored, from_csr};
use contact_dynamics::{Error, LinearSystem, Simulation, StepControl};
use std::ffi::{c_char, c_void};
use std::ptr::null;
use std::sync::Mutex;

/// A system with its contacts and the settings of a run.
pub struct Model(pub(crate) Mutex<Description>);

/// A sparse matrix by compressed rows (CSR): column indices[k] and value data[k] for k from indptr[i] up to, not
/// including, indptr[i + 1] are in row i. Columns may be in any order; repeated entries are added. Symmetric matrices
/// have both triangles.
#[repr(C)]
pub struct Matrix {
    /// Number of rows.
    pub rows: usize,
    /// Length of indices and data.
    pub entries: usize,
    /// (rows + 1), rises from 0 to entries.
    pub indptr: *const usize,
    /// (entries)
    pub indices: *const usize,
    /// (entries)
    pub data: *const f64,
}

impl Matrix {
    /// The three arrays.
    pub(crate) unsafe fn arrays<'a>(&self, what: &'static str) -> Result<(&'a [usize], &'a [usize], &'a [f64])> {
        let pointers = self.rows.checked_add(1).ok_or_else(|| invalid(format!("{what}: too many rows")))?;
        // SAFETY: promised by the caller.
        unsafe {
            let indices = array(self.indices, self.entries, what)?;
            Ok((array(self.indptr, pointers, what)?, indices, floats(self.data, self.entries, what)?))
        }
    }

    /// A square matrix.
    unsafe fn square(matrix: Option<&Self>, what: &'static str) -> Result<SparseColMat<usize, f64>> {
        let matrix = matrix.ok_or_else(|| invalid(format!("{what} is NULL")))?;
        // SAFETY: promised by the caller.
        let (indptr, indices, data) = unsafe { matrix.arrays(what) }?;
        from_csr(indptr, indices, data, Stored::All).map_err(|error| invalid(format!("{what}: {error}")))
    }
}

/// Settings of a run. Zero and NULL are the defaults: `cd_settings settings = {0};`.
#[repr(C)]
pub struct Settings {
    /// The scheme by its name and parameters, as "bathe rho=0.5". With defaults and ranges (rho is the spectral radius
    /// for the highest frequencies): "generalized-alpha" (rho = 0.8, 0 to 1; the default), "hht" (rho = 0.8, 0.5 to 1),
    /// "wbz" (rho = 0.8, 0 to 1), "trapezoidal", "newmark" (beta = 0.25, 0 to 1; gamma = 0.5, 0.5 to 1), "composite",
    /// "bathe" (rho = 0, 0 to 1), "houbolt", "park", "bdf2", "oalts" (rho = 0.5, 0 to 1), "gssss" (0 ≤ rho_3 ≤ rho_1 ≤
    /// rho_2 ≤ 1, all 0.8), "moreau-jean" (theta = 0.5, 0.5 to 1), "energy-momentum"; explicit, for lumped masses and
    /// steps below the stability limit: "central-difference", "cd-lagrange", "tchamwa-wielgosz" (phi = 1.033, 1 to 2;
    /// compliant laws only), "chung-lee" (beta = 28/27, 1 to 28/27), "hulbert-chung" (rho = 0.8, 0 to 1), "noh-bathe"
    /// (p = 0.54, 0.5 to 2 − √2).
    pub scheme: *const c_char,
    /// Makes velocity and acceleration agree with contacts that have closed: "default" (the library chooses λ_v/λ_a
    /// where it applies), "none", "persistency", "persistency-history", "persistency-release", "contact-implicit",
    /// "contact-stabilized", "laursen-love", "nonsmooth-splitting", "work-balance", "zero-acceleration".
    pub correction: *const c_char,
    /// "automatic" (the default), "cholesky", "lu" (unsymmetric matrices), "conjugate-gradients" (no factor),
    /// "by-body".
    pub linear_solver: *const c_char,
    /// Negative gaps at the start are "refused" (the default), "adjusted" (zero from then on), or "removed time=…" (in
    /// this time).
    pub overlap: *const c_char,
    /// Length of the displacement and the velocity, if they are given: the number of dofs.
    pub n: usize,
    /// The displacement at the start (n); NULL: zero.
    pub displacement: *const f64,
    /// The velocity at the start (n); NULL: zero.
    pub velocity: *const f64,
    /// The time at the start.
    pub start_time: f64,
    /// Steps that fail are halved down to this size (time). 0: they fail at once.
    pub smallest_step: f64,
    /// Begins in static balance under the load at the start time.
    pub start_at_rest: bool,
    /// Adds up the works of cd_energy.
    pub energy_balance: bool,
}

impl Settings {
    const DEFAULT: Self = Self {
        scheme: null(),
        correction: null(),
        linear_solver: null(),
        overlap: null(),
        n: 0,
        displacement: null(),
        velocity: null(),
        start_time: 0.0,
        smallest_step: 0.0,
        start_at_rest: false,
        energy_balance: false,
    };
}

#[derive(Clone)]
enum Mass {
    Lumped(Vec<f64>),
    Consistent(SparseColMat<usize, f64>),
}

enum Damping {
    None,
    General(SparseColMat<usize, f64>),
    Rayleigh(f64, f64),
}

#[derive(Clone)]
enum External {
    None,
    Constant(Vec<f64>),
    Function(Callback<LoadFunction>),
}

pub(crate) struct Description {
    pub(crate) dofs: usize,
    mass: Mass,
    stiffness: SparseColMat<usize, f64>,
    damping: Damping,
    load: External,
    fixed: Vec<usize>,
    driven: Vec<(usize, Callback<MotionFunction>)>,
    pub(crate) contacts: Vec<MakeContact>,
}

impl Description {
    fn new(mass: Mass, stiffness: SparseColMat<usize, f64>) -> Result<Self> {
        let description = Self {
            dofs: stiffness.nrows(),
            mass,
            stiffness,
            damping: Damping::None,
            load: External::None,
            fixed: Vec::new(),
            driven: Vec::new(),
            contacts: Vec::new(),
        };
        description.matrices()?;
        Ok(description)
    }

    fn matrices(&self) -> contact_dynamics::Result<LinearSystem<'static, f64>> {
        match self.mass.clone() {
            Mass::Lumped(mass) => LinearSystem::lumped(mass, self.stiffness.clone()),
            Mass::Consistent(mass) => LinearSystem::new(mass, self.stiffness.clone()),
        }
    }

    fn system(&self) -> contact_dynamics::Result<LinearSystem<'static, f64>> {
        let mut system = match &self.damping {
            Damping::None => self.matrices()?,
            Damping::General(damping) => self.matrices()?.damping(damping.clone())?,
            Damping::Rayleigh(mass, stiffness) => self.matrices()?.rayleigh(*mass, *stiffness)?,
        };
        system = match self.load.clone() {
            External::None => system,
            External::Constant(load) => system.load(move |_, out| out.copy_from_slice(&load)),
            External::Function(load) => system.try_load(move |t, out| load.load(t, out)),
        };
        for &dof in &self.fixed {
            system = system.fix(dof)?;
        }
        for &(dof, motion) in &self.driven {
            system = system.try_drive(dof, move |t| motion.motion(t))?;
        }
        Ok(system)
    }

    /// Builds a run.
    unsafe fn build(&self, step: f64, settings: &Settings) -> Result<Run> {
        // SAFETY: promised by the caller.
        let (scheme, correction, solver, overlap, [displacement, velocity]) = unsafe {
            let start = |values: *const f64, what| {
                let count = if values.is_null() { 0 } else { settings.n };
                if count != 0 {
                    self.check_size(what, count)?;
                }
                Ok::<_, Fault>(floats(values, count, what)?.to_vec())
            };
            (
                text(settings.scheme, "generalized-alpha", "the scheme")?,
                text(settings.correction, "default", "the correction")?,
                text(settings.linear_solver, "automatic", "the linear solver")?,
                text(settings.overlap, "refused", "the treatment of overlaps")?,
                [start(settings.displacement, "the displacement")?, start(settings.velocity, "the velocity")?],
            )
        };
        let mut builder = Simulation::builder(self.system()?, named::scheme(scheme)?, step)
            .start_time(settings.start_time)
            .linear_solver(named::linear_solver(solver)?)
            .initial_overclosure(named::overlap(overlap)?);
        if let Some(correctors) = named::correctors(correction)? {
            builder = builder.correctors(correctors);
        }
        for contact in &self.contacts {
            builder = builder.constraints(contact()?);
        }
        if !displacement.is_empty() {
            builder = builder.displacement(displacement);
        }
        if !velocity.is_empty() {
            builder = builder.velocity(velocity);
        }
        if settings.smallest_step != 0.0 {
            builder = builder.step_control(StepControl::halving(settings.smallest_step)?);
        }
        if settings.start_at_rest {
            builder = builder.start_at_rest();
        }
        if settings.energy_balance {
            builder = builder.energy_balance();
        }
        Ok(Run(Mutex::new(builder.build()?)))
    }

    fn check_size(&self, what: &'static str, found: usize) -> Result<()> {
        let expected = self.dofs;
        if found == expected { Ok(()) } else { Err(Error::Dimension { what, expected, found }.into()) }
    }
}

/// A function of a model.
pub(crate) unsafe fn of_model(model: *mut Model, body: impl FnOnce(&mut Description) -> Result<()>) -> Status {
    // SAFETY: promised by the caller.
    entry(|| locked("model", unsafe { handle(model) }.map(|model| &model.0), body))
}

/// Makes a model with a consistent mass matrix M and a stiffness matrix K of the same size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_new(
    mass: Option<&Matrix>,
    stiffness: Option<&Matrix>,
    out: *mut *mut Model,
) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        create(out, || {
            let mass = Mass::Consistent(Matrix::square(mass, "the mass matrix")?);
            let stiffness = Matrix::square(stiffness, "the stiffness matrix")?;
            Ok(Model(Mutex::new(Description::new(mass, stiffness)?)))
        })
    }
}

/// Makes a model with lumped masses (n) and a stiffness matrix K of n rows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_new_lumped(
    masses: *const f64,
    n: usize,
    stiffness: Option<&Matrix>,
    out: *mut *mut Model,
) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        create(out, || {
            let mass = Mass::Lumped(floats(masses, n, "the mass")?.to_vec());
            let stiffness = Matrix::square(stiffness, "the stiffness matrix")?;
            Ok(Model(Mutex::new(Description::new(mass, stiffness)?)))
        })
    }
}

/// Frees a model; NULL is allowed. Its runs stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_free(model: *mut Model) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe { free(model) }
}

/// Sets the damping matrix C.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_damping(model: *mut Model, damping: Option<&Matrix>) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let damping = Matrix::square(damping, "the damping matrix")?;
            model.check_size("damping matrix", damping.nrows())?;
            model.damping = Damping::General(damping);
            Ok(())
        })
    }
}

/// Sets the damping matrix mass · M + stiffness · K (1/time, time).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_rayleigh(model: *mut Model, mass: f64, stiffness: f64) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            model.matrices()?.rayleigh(mass, stiffness)?;
            model.damping = Damping::Rayleigh(mass, stiffness);
            Ok(())
        })
    }
}

/// Sets a constant load (n, the number of dofs; force).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_constant_load(model: *mut Model, load: *const f64, n: usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            model.check_size("the load", n)?;
            model.load = External::Constant(floats(load, n, "the load")?.to_vec());
            Ok(())
        })
    }
}

/// Sets a load that depends on time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_load(model: *mut Model, load: Load, user: *mut c_void) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let function = load.ok_or_else(|| invalid("the load is NULL"))?;
            model.load = External::Function(Callback { function, user });
            Ok(())
        })
    }
}

/// Fixes more dofs at zero displacement.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_fix(model: *mut Model, fixed: *const usize, count: usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let fixed = dofs((fixed, count), "the list of fixed dofs", model.dofs)?;
            model.fixed.extend_from_slice(fixed);
            Ok(())
        })
    }
}

/// Drives a dof by a motion.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_model_drive(model: *mut Model, dof: usize, motion: Motion, user: *mut c_void) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_model(model, |model| {
            let function = motion.ok_or_else(|| invalid("the motion is NULL"))?;
            if dof >= model.dofs {
                return Err(Error::MissingDof { what: "a driven support", dof, dofs: model.dofs }.into());
            }
            model.driven.push((dof, Callback { function, user }));
            Ok(())
        })
    }
}

/// Builds a run with the step size `step` (time). NULL settings are the defaults. The model can make other runs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_build(
    model: *mut Model,
    step: f64,
    settings: Option<&Settings>,
    out: *mut *mut Run,
) -> Status {
    let settings = settings.unwrap_or(&Settings::DEFAULT);
    // SAFETY: promised by the caller, as the header says.
    unsafe { create(out, || locked("model", handle(model).map(|model| &model.0), |model| model.build(step, settings))) }
}
