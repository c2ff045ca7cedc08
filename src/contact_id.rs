//! The identifier of a contact, used by errors and states.

/// The stable identifier of a contact: it keeps multipliers and flags attached to it when candidates change.
///
/// Feature and candidate are given by the constraint ([`Contacts::push`](crate::contact::Contacts::push)):
///
/// | constraint | feature | candidate |
/// | --- | --- | --- |
/// | [`LinearRows`](crate::contact::LinearRows) | the row, in the order in which rows were added | 0 |
/// | [`GapFunction`](crate::contact::GapFunction) | the function, in the order in which they were added | 0 |
/// | [`NodesOnObstacle`](crate::contact::NodesOnObstacle) | the node | 0 |
/// | `NodeToFacet` | the node | the side: 0 for nodes of `one`, 1 for nodes of `other`; in a dent see `NodeToFacet` |
/// | `Mortar` | the slave node | 0 |
/// | `Tie` | the slave node | the axis |
/// | `EdgeToEdge` | the edge of the first surface | the edge of the second |
/// | a host's own | as given | as given |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactId {
    /// Index of the constraint in the simulation, in the order given; see
    /// [`Simulation::constraint`](crate::Simulation::constraint).
    pub constraint: usize,
    /// Feature of the body (a node, a row), given by the constraint.
    pub feature: usize,
    /// The candidate opposite the feature, given by the constraint.
    pub candidate: usize,
}

impl std::fmt::Display for ContactId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.constraint, self.feature, self.candidate)
    }
}
