//! Serialization of scalars for files of a run; no requirement without the feature `serde`.

/// A scalar that can be serialized.
#[cfg(feature = "serde")]
pub trait Stored: serde::Serialize + serde::de::DeserializeOwned {
    /// Its name in files.
    const NAME: &'static str;
}

#[cfg(feature = "serde")]
impl Stored for f32 {
    const NAME: &'static str = "f32";
}

#[cfg(feature = "serde")]
impl Stored for f64 {
    const NAME: &'static str = "f64";
}

/// Files are not written.
#[cfg(not(feature = "serde"))]
pub trait Stored {}

#[cfg(not(feature = "serde"))]
impl Stored for f32 {}

#[cfg(not(feature = "serde"))]
impl Stored for f64 {}
