//! The name of a contact, which errors give and states keep.

/// The stable name of a contact: what keeps multipliers and flags attached to it when candidates change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactId {
    /// Index of the constraint in the simulation.
    pub constraint: usize,
    /// Feature of the body (a node, a row), given by the constraint.
    pub feature: usize,
    /// The candidate opposite of it, given by the constraint.
    pub candidate: usize,
}

impl std::fmt::Display for ContactId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.constraint, self.feature, self.candidate)
    }
}
