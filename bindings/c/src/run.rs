//! Runs: steps and results.

use crate::error::{Result, Status, entry, invalid, locked};
use crate::memory::{free, handle, output, put};
use contact_dynamics::{ContactForce, Error, Simulation, Works};
use std::sync::Mutex;

type Simulated = Simulation<'static, f64>;

/// A model on its way through time.
pub struct Run(pub(crate) Mutex<Simulated>);

// A run may be used by one thread after another, as the header says.
const _: fn() = || {
    fn is_send<T: Send>() {}
    is_send::<Simulated>();
};

/// Status of a contact.
#[repr(C)]
#[expect(clippy::enum_variant_names, reason = "the prefix of names in C")]
pub enum ContactStatus {
    /// Open, without force.
    CdOpen = 0,
    /// Closed within rounding, without force.
    CdTouching = 1,
    /// Pressed, or held by an equality, without friction.
    CdClosed = 2,
    /// Pressed and sticking.
    CdSticking = 3,
    /// Pressed and sliding.
    CdSliding = 4,
}

/// A contact of a state.
#[repr(C)]
pub struct Contact {
    /// Index of its constraint, in the order of the functions that added them; cd_model_bodies adds several.
    pub constraint: usize,
    /// The row of cd_model_rows, or the node.
    pub feature: usize,
    /// The facet or other object opposite to the feature, if there are several.
    pub candidate: usize,
    /// Its status.
    pub status: ContactStatus,
    /// The gap (length), negative if bodies overlap.
    pub gap: f64,
    /// The normal force, compression positive.
    pub force: f64,
    /// Friction forces along the tangents; 0 without friction.
    pub friction: [f64; 2],
    /// Slip velocities along the tangents.
    pub slip: [f64; 2],
    /// Place in space; NaN if it is unknown.
    pub position: [f64; 3],
    /// Direction in which the gap opens; NaN if it is unknown.
    pub normal: [f64; 3],
}

/// Energies of a state. Works, since the start, are zero unless energy_balance is set; docs/energies.md explains
/// them.
#[repr(C)]
pub struct Energies {
    /// ½ vᵀ M v.
    pub kinetic: f64,
    /// ½ uᵀ K u.
    pub potential: f64,
    /// Work of the load.
    pub load: f64,
    /// Work of the supports.
    pub supports: f64,
    /// Work of damping.
    pub damping: f64,
    /// Work of contact forces along the normals.
    pub contact: f64,
    /// Work of friction.
    pub friction: f64,
    /// Kinetic energy lost in impacts (negative).
    pub impacts: f64,
    /// Change of kinetic energy by corrections.
    pub corrections: f64,
    /// Change of the total energy by the scheme.
    pub remainder: f64,
}

/// A function of a run.
unsafe fn of_run(run: *mut Run, body: impl FnOnce(&mut Simulated) -> Result<()>) -> Status {
    // SAFETY: promised by the caller.
    entry(|| locked("run", unsafe { handle(run) }.map(|run| &run.0), body))
}

/// Frees a run; NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_run_free(run: *mut Run) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe { free(run) }
}

/// Takes one step. If it fails, the state is that before the step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_step(run: *mut Run) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe { of_run(run, |run| Ok(run.step()?)) }
}

/// Takes whole steps up to the first time that is not before `until`. If one fails, the state is that before it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_run_until(run: *mut Run, until: f64) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_run(run, |run| {
            run.run_until(until, &mut ())?;
            Ok(())
        })
    }
}

/// Reads the time of the state.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_time(run: *mut Run, time: *mut f64) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe { of_run(run, |run| put(time, run.time(), "the time")) }
}

/// Copies a vector over all dofs.
unsafe fn copy(values: &[f64], out: *mut f64, n: usize, what: &'static str) -> Result<()> {
    if n != values.len() {
        return Err(Error::Dimension { what, expected: values.len(), found: n }.into());
    }
    // SAFETY: promised by the caller.
    let places = unsafe { output(out, n, what) }?;
    places.iter_mut().zip(values).for_each(|(place, value)| _ = place.write(*value));
    Ok(())
}

/// Reads the displacements (n, the number of dofs).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_displacement(run: *mut Run, out: *mut f64, n: usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe { of_run(run, |run| copy(run.state().displacement(), out, n, "the array of displacements")) }
}

/// Reads the velocities (n).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_velocity(run: *mut Run, out: *mut f64, n: usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe { of_run(run, |run| copy(run.state().velocity(), out, n, "the array of velocities")) }
}

/// Reads the accelerations (n).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_acceleration(run: *mut Run, out: *mut f64, n: usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe { of_run(run, |run| copy(run.state().acceleration(), out, n, "the array of accelerations")) }
}

/// Reads the forces of all contacts, with friction, on the dofs (n).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_contact_forces(run: *mut Run, out: *mut f64, n: usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_run(run, |run| {
            let mut forces = vec![0.0; run.system().dofs()];
            for contact in run.contact_forces() {
                contact.forces().for_each(|(dof, force)| forces[dof] += force);
            }
            copy(&forces, out, n, "the array of contact forces")
        })
    }
}

/// Reads the forces of the supports (n, the number of fixed and driven dofs), in ascending order of these dofs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_reactions(run: *mut Run, out: *mut f64, n: usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_run(run, |run| {
            let reactions = run.reactions()?;
            copy(&reactions, out, n, "the array of reactions")
        })
    }
}

/// Reads the candidates for contact. Writes their number into `count` in any case; `out` may be NULL with a capacity of
/// 0, to learn the number. A smaller capacity than the number is CD_INVALID otherwise.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_contacts(run: *mut Run, out: *mut Contact, capacity: usize, count: *mut usize) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_run(run, |run| {
            let contacts: Vec<Contact> = run.contact_forces().map(Contact::from).collect();
            put(count, contacts.len(), "the number of contacts")?;
            let places = output(out, capacity, "the array of contacts")?;
            if capacity != 0 && capacity < contacts.len() {
                return Err(invalid(format!("the array of contacts has size {capacity}, expected {}", contacts.len())));
            }
            places.iter_mut().zip(contacts).for_each(|(place, contact)| _ = place.write(contact));
            Ok(())
        })
    }
}

impl From<ContactForce<f64>> for Contact {
    fn from(contact: ContactForce<f64>) -> Self {
        use contact_dynamics::ContactStatus as Of;
        let pair = |values: &[f64]| std::array::from_fn(|axis| values.get(axis).copied().unwrap_or(0.0));
        let status = match contact.status {
            Of::Open => ContactStatus::CdOpen,
            Of::Touching => ContactStatus::CdTouching,
            Of::Sticking => ContactStatus::CdSticking,
            Of::Sliding => ContactStatus::CdSliding,
            // The crate may get other kinds of pressed contacts.
            _ => ContactStatus::CdClosed,
        };
        Self {
            constraint: contact.id.constraint,
            feature: contact.id.feature,
            candidate: contact.id.candidate,
            status,
            gap: contact.gap,
            force: contact.force,
            friction: pair(&contact.friction),
            slip: pair(&contact.slip),
            position: contact.position.unwrap_or([f64::NAN; 3]),
            normal: contact.normal.unwrap_or([f64::NAN; 3]),
        }
    }
}

/// Reads the energies of the state.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cd_energy(run: *mut Run, energies: *mut Energies) -> Status {
    // SAFETY: promised by the caller, as the header says.
    unsafe {
        of_run(run, |run| {
            let energy = run.energy();
            let Works { load, supports, damping, contact, friction, impacts, corrections, remainder, .. } =
                energy.works.unwrap_or_default();
            let (kinetic, potential) = (energy.kinetic, energy.potential.unwrap_or(0.0));
            let works = Energies {
                kinetic,
                potential,
                load,
                supports,
                damping,
                contact,
                friction,
                impacts,
                corrections,
                remainder,
            };
            put(energies, works, "the place of the energies")
        })
    }
}
