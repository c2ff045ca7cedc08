//! Errors of the crate as a status and a message; no panic leaves the library.

use contact_dynamics::Error;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, TryLockError};

/// Result of a function.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::enum_variant_names, reason = "the prefix of names in C")]
pub enum Status {
    /// Done.
    CdOk = 0,
    /// An argument is NULL, has a wrong size or an unknown name, or holds a number out of its range.
    CdInvalid = 1,
    /// The library refuses the model or the start, or a step fails; docs/errors.md lists the messages with remedies.
    CdRefused = 2,
    /// A callback has returned another number than 0 and CD_INADMISSIBLE.
    CdCallback = 3,
    /// Memory is exhausted.
    CdOutOfMemory = 4,
    /// The handle is in use: by another thread, or by the call that has called a callback.
    CdBusy = 5,
    /// The library has panicked, now or in an earlier call on this handle, which can only be freed.
    CdPoisoned = 6,
}

pub(crate) type Result<T> = std::result::Result<T, Fault>;

/// An error on its way to C.
#[derive(Debug)]
pub(crate) struct Fault {
    status: Status,
    text: String,
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Dimension { .. }
            | Error::Parameter { .. }
            | Error::NotFinite { .. }
            | Error::MatrixNotFinite { .. }
            | Error::MissingDof { .. }
            | Error::RepeatedDof { .. }
            | Error::Empty { .. } => Status::CdInvalid,
            Error::Host { .. } => Status::CdCallback,
            Error::OutOfMemory { .. } => Status::CdOutOfMemory,
            Error::Poisoned => Status::CdPoisoned,
            _ => Status::CdRefused,
        };
        Self { status, text: error.to_string() }
    }
}

/// The error for an argument that only C can get wrong.
pub(crate) fn invalid(text: impl Into<String>) -> Fault {
    Fault { status: Status::CdInvalid, text: text.into() }
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// The message of the last error in this thread, "" if there was none. It is valid until the next error in this
/// thread, is never NULL, and is not freed by the caller.
#[unsafe(no_mangle)]
pub extern "C" fn cd_last_error() -> *const c_char {
    LAST.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// The version of the library, as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn cd_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Runs the body of a function and keeps the message of its error. A panic becomes one.
pub(crate) fn entry(body: impl FnOnce() -> Result<()>) -> Status {
    // Incomplete data after a panic are behind the lock of a handle, which is poisoned then.
    let Fault { status, text } = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return Status::CdOk,
        Ok(Err(fault)) => fault,
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message");
            Fault { status: Status::CdPoisoned, text: format!("the library has panicked: {text}; report it, please") }
        }
    };
    let message = CString::new(text.replace('\0', " ")).unwrap_or_default();
    _ = LAST.try_with(|last| last.replace(message));
    status
}

/// Locks a handle for the body of a function.
pub(crate) fn locked<T, R>(name: &str, handle: Option<&Mutex<T>>, body: impl FnOnce(&mut T) -> Result<R>) -> Result<R> {
    let handle = handle.ok_or_else(|| invalid(format!("the {name} is NULL")))?;
    let mut value = handle.try_lock().map_err(|error| {
        let (status, text) = match error {
            TryLockError::WouldBlock => (Status::CdBusy, "in use, by another thread or by the call of this callback"),
            TryLockError::Poisoned(_) => (Status::CdPoisoned, "unusable after an earlier panic; it can only be freed"),
        };
        Fault { status, text: format!("the {name} is {text}") }
    })?;
    body(&mut value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    fn message() -> String {
        // SAFETY: the message is a C string until the next error of this thread.
        unsafe { CStr::from_ptr(cd_last_error()) }.to_string_lossy().into_owned()
    }

    #[test]
    fn a_panic_is_a_status_and_poisons_the_handle() {
        let (handle, other) = (Mutex::new(1), Mutex::new(2));
        assert_eq!(entry(|| locked("run", Some(&handle), |_| panic!("index {} of {}", 3, 2))), Status::CdPoisoned);
        assert_eq!(message(), "the library has panicked: index 3 of 2; report it, please");
        assert_eq!(entry(|| locked("run", Some(&handle), |_| Ok(()))), Status::CdPoisoned);
        assert!(message().contains("earlier panic"), "{}", message());
        assert_eq!(entry(|| locked("run", Some(&other), |_| Ok(()))), Status::CdOk);
        assert_eq!(entry(|| panic!("no handle")), Status::CdPoisoned);
    }

    #[test]
    fn a_handle_in_use_is_busy() {
        let handle = Mutex::new(());
        let nested = |(): &mut ()| {
            assert_eq!(entry(|| locked("run", Some(&handle), |()| Ok(()))), Status::CdBusy);
            Ok(())
        };
        assert_eq!(entry(|| locked("run", Some(&handle), nested)), Status::CdOk);
        assert_eq!(entry(|| locked("run", None, |()| Ok(()))), Status::CdInvalid);
        assert_eq!(message(), "the run is NULL");
    }
}
