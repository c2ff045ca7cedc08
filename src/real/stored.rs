//! What a file of a run asks of its scalar: nothing, without the feature `serde`.

/// A scalar that can be written and read again.
#[cfg(feature = "serde")]
pub trait Stored: serde::Serialize + serde::de::DeserializeOwned {
    /// What files call it.
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
