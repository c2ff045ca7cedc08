//! Calls of the host's functions.

use contact_dynamics::{Error, Result};
use std::ffi::{c_int, c_void};

/// Writes the load at time t into f (n; force).
pub type Load = Option<unsafe extern "C" fn(t: f64, f: *mut f64, n: usize, user: *mut c_void) -> c_int>;

/// Writes displacement, velocity and acceleration of a driven dof at time t into motion (3).
pub type Motion = Option<unsafe extern "C" fn(t: f64, motion: *mut f64, user: *mut c_void) -> c_int>;

/// Writes a gap as a function of the displacements x (n) of its dofs at time t, with their velocities v (n). Into
/// gradient (n): the derivative of the gap with respect to x. Into gap (3): the gap g (length), its rate ∂g/∂t at fixed
/// x, and its acceleration d²/ds² g(t + s, x + s v) at s = 0, which may be 0 at a loss of accuracy.
pub type Gap = Option<
    unsafe extern "C" fn(
        t: f64,
        x: *const f64,
        v: *const f64,
        gradient: *mut f64,
        n: usize,
        gap: *mut f64,
        user: *mut c_void,
    ) -> c_int,
>;

pub(crate) type LoadFunction = unsafe extern "C" fn(f64, *mut f64, usize, *mut c_void) -> c_int;
pub(crate) type MotionFunction = unsafe extern "C" fn(f64, *mut f64, *mut c_void) -> c_int;
pub(crate) type GapFunction =
    unsafe extern "C" fn(f64, *const f64, *const f64, *mut f64, usize, *mut f64, *mut c_void) -> c_int;

/// The result of a callback that cannot evaluate a state: CD_INADMISSIBLE of the header.
const INADMISSIBLE: c_int = 1;

/// A function of the host and what it is called with.
#[derive(Clone, Copy)]
pub(crate) struct Callback<F> {
    pub(crate) function: F,
    pub(crate) user: *mut c_void,
}

// SAFETY: the library only passes `user` on to the function. The header asks for functions that can be called in any
// thread that uses the handle, by one at a time.
unsafe impl<F: Send> Send for Callback<F> {}

fn outcome(callback: &'static str, code: c_int) -> Result<()> {
    let source = || format!("it returned {code}").into();
    match code {
        0 => Ok(()),
        INADMISSIBLE => Err(Error::Inadmissible { callback, source: source() }),
        _ => Err(Error::Host { callback, source: source() }),
    }
}

impl Callback<LoadFunction> {
    pub(crate) fn load(&self, t: f64, out: &mut [f64]) -> Result<()> {
        // SAFETY: the host's function has this type, and the slice the length that it is told.
        outcome("load", unsafe { (self.function)(t, out.as_mut_ptr(), out.len(), self.user) })
    }
}

impl Callback<MotionFunction> {
    pub(crate) fn motion(&self, t: f64) -> Result<[f64; 3]> {
        let mut out = [0.0; 3];
        // SAFETY: the host's function has this type, and writes three numbers.
        outcome("drive", unsafe { (self.function)(t, out.as_mut_ptr(), self.user) })?;
        Ok(out)
    }
}

impl Callback<GapFunction> {
    pub(crate) fn gap(&self, t: f64, x: &[f64], v: &[f64], gradient: &mut [f64]) -> Result<[f64; 3]> {
        let (mut out, [x, v]) = ([0.0; 3], [x, v].map(<[f64]>::as_ptr));
        // SAFETY: the host's function has this type; x, v and the gradient have the length that it is told.
        let code =
            unsafe { (self.function)(t, x, v, gradient.as_mut_ptr(), gradient.len(), out.as_mut_ptr(), self.user) };
        outcome("gap", code)?;
        Ok(out)
    }
}
