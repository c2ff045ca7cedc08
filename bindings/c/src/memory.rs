//! Arrays, strings and handles of the host. Arrays are checked as far as they can be.

use crate::error::{Result, Status, entry, invalid};
use contact_dynamics::Error;
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;

/// Whether a pointer may be one to so many values.
fn check<T>(pointer: *const T, count: usize, what: &str) -> Result<()> {
    if pointer.is_null() {
        return Err(invalid(format!("{what}: the array is NULL")));
    }
    if !pointer.is_aligned() || count > isize::MAX.cast_unsigned() / size_of::<T>() {
        return Err(invalid(format!("{what}: this is no array of {count} values")));
    }
    Ok(())
}

/// An array to be read; NULL is allowed without values.
///
/// # Safety
///
/// A pointer that is not NULL is valid for reading `count` values during the call of C.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, count: usize, what: &str) -> Result<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check(pointer, count, what)?;
    // SAFETY: it is aligned and not NULL, its size fits, and the caller promises the rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// As [`array`], for finite numbers.
///
/// # Safety
///
/// As [`array`].
pub(crate) unsafe fn floats<'a>(pointer: *const f64, count: usize, what: &'static str) -> Result<&'a [f64]> {
    // SAFETY: promised by the caller.
    let values = unsafe { array(pointer, count, what) }?;
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(Error::NotFinite { what, index, value: values[index] }.into()),
        None => Ok(values),
    }
}

/// As [`array`], for dofs of a system.
///
/// # Safety
///
/// As [`array`].
pub(crate) unsafe fn dofs<'a>(
    (pointer, count): (*const usize, usize),
    what: &'static str,
    dofs: usize,
) -> Result<&'a [usize]> {
    // SAFETY: promised by the caller.
    let values = unsafe { array(pointer, count, what) }?;
    match values.iter().find(|&&dof| dof >= dofs) {
        Some(&dof) => Err(Error::MissingDof { what, dof, dofs }.into()),
        None => Ok(values),
    }
}

/// An array to be written, which need not be initialized.
///
/// # Safety
///
/// A pointer that is not NULL is valid for writing `count` values during the call of C, which reads them elsewhere
/// only after it.
pub(crate) unsafe fn output<'a, T>(pointer: *mut T, count: usize, what: &str) -> Result<&'a mut [MaybeUninit<T>]> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(pointer, count, what)?;
    // SAFETY: it is aligned and not NULL, its size fits, and the caller promises the rest.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), count) })
}

/// A string; NULL is the default.
///
/// # Safety
///
/// A pointer that is not NULL is a string that ends with a zero.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, default: &'a str, what: &str) -> Result<&'a str> {
    if pointer.is_null() {
        return Ok(default);
    }
    // SAFETY: promised by the caller.
    unsafe { CStr::from_ptr(pointer) }.to_str().map_err(|_| invalid(format!("{what} is not UTF-8")))
}

/// Writes one result.
///
/// # Safety
///
/// As [`output`].
pub(crate) unsafe fn put<T>(pointer: *mut T, value: T, what: &str) -> Result<()> {
    // SAFETY: promised by the caller.
    unsafe { output(pointer, 1, what) }?[0].write(value);
    Ok(())
}

/// Makes a handle and writes its address, or NULL if it cannot be made.
///
/// # Safety
///
/// As [`output`].
pub(crate) unsafe fn create<T>(out: *mut *mut T, make: impl FnOnce() -> Result<T>) -> Status {
    entry(|| {
        // SAFETY: promised by the caller.
        let out = &mut unsafe { output(out, 1, "the place of the handle") }?[0];
        out.write(std::ptr::null_mut());
        out.write(Box::into_raw(Box::new(make()?)));
        Ok(())
    })
}

/// The object of a handle, unless the handle is NULL.
///
/// # Safety
///
/// A pointer that is not NULL is from [`create`] and not freed during the call of C.
pub(crate) unsafe fn handle<'a, T>(handle: *mut T) -> Option<&'a T> {
    // SAFETY: promised by the caller. What changes is behind a lock.
    unsafe { handle.as_ref() }
}

/// Frees a handle; NULL is allowed.
///
/// # Safety
///
/// A pointer that is not NULL is from [`create`], is not yet freed and is not used any more.
pub(crate) unsafe fn free<T>(handle: *mut T) -> Status {
    entry(|| {
        if !handle.is_null() {
            // SAFETY: promised by the caller.
            drop(unsafe { Box::from_raw(handle) });
        }
        Ok(())
    })
}
