//! Bonds that have broken: equality rows that hold until their force is too large.

/// A bond that a run has broken.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BrokenBond {
    /// The constraint, by its index in the order in which constraints were added.
    pub constraint: usize,
    /// The bond: the [feature](super::ContactId::feature) of its rows.
    pub feature: usize,
    /// The end of the last step in which it held.
    pub time: f64,
    /// The force at that time divided by the strength, at least 1.
    pub load: f64,
}

impl BrokenBond {
    pub(crate) fn new(constraint: usize, (feature, load): (usize, f64), time: f64) -> Self {
        Self { constraint, feature, time, load }
    }
}
