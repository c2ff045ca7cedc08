//! What all scenes share.

/// Errors of fenris, of the crate and of writing.
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;
