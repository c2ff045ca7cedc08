//! Contact constraints: where the gap is, which way it pushes, under which law.

#[cfg(feature = "search")]
mod affine_rows;
#[cfg(feature = "search")]
mod body_contact;
mod bond;
mod constraint;
mod contacts;
mod dofs;
#[cfg(feature = "search")]
mod edge_to_edge;
mod gap_function;
mod gaps;
mod groups;
mod law;
mod linear_rows;
#[cfg(feature = "search")]
mod mortar;
#[cfg(feature = "search")]
mod node_to_facet;
mod nodes_on_obstacle;
mod obstacle;
mod rigid_motion;
mod rows;
#[cfg(feature = "search")]
mod surface;
mod tangents;
#[cfg(feature = "search")]
mod tie;

#[cfg(feature = "search")]
pub use body_contact::BodyContact;
pub use bond::{BondStrength, BrokenBond};
pub use constraint::{Candidates, ContactConstraint, Rates, Stride, Variation};
pub(crate) use contacts::kept_depth;
pub use contacts::{Contact, Contacts};
#[cfg(feature = "search")]
pub use edge_to_edge::EdgeToEdge;
pub use gap_function::GapFunction;
pub(crate) use gaps::{ErasedGaps, Gaps, rounding, share_of_rounding};
pub(crate) use groups::Groups;
pub use law::ContactLaw;
pub(crate) use law::{Course, Measure};
pub use linear_rows::{GapOffset, LinearRows};
#[cfg(feature = "search")]
pub use mortar::Mortar;
#[cfg(feature = "search")]
pub use node_to_facet::NodeToFacet;
pub use nodes_on_obstacle::NodesOnObstacle;
#[cfg(feature = "search")]
pub use obstacle::ClosedSurface;
pub use obstacle::{Capsule, Cone, Cuboid, Cylinder, Obstacle, Passage, Plane, Side, Sphere};
pub use rigid_motion::RigidMotion;
pub use rows::{ContactJacobian, GapRates};
pub(crate) use rows::{NO_RESPONSE, SpreadRow};
#[cfg(feature = "search")]
pub use surface::{Facet, Surface};
pub(crate) use tangents::Tangents;
#[cfg(feature = "search")]
pub use tie::Tie;

pub use crate::contact_id::ContactId;
use crate::error::{Error, Result};
use crate::real::Real;

/// Refuses lists of a mesh that differ in length or hold coordinates that are not numbers, and nodes that it does not
/// have.
fn check_mesh<T: Real, const D: usize>(coordinates: &[[T; D]], dofs: &[[usize; D]], nodes: &[usize]) -> Result<()> {
    let count = coordinates.len();
    if dofs.len() != count {
        return Err(Error::Dimension { what: "the list of dofs by node", expected: count, found: dofs.len() });
    }
    check_coordinates(coordinates)?;
    check_nodes("a contact node (at most)", nodes, count)
}

/// Refuses coordinates that are not numbers.
fn check_coordinates<T: Real, const D: usize>(coordinates: &[[T; D]]) -> Result<()> {
    for (index, x) in coordinates.iter().enumerate() {
        if let Some(x) = x.iter().find(|x| !x.is_finite()) {
            let what = "the list of coordinates (by node)";
            return Err(Error::NotFinite { what, index, value: x.value() });
        }
    }
    Ok(())
}

/// Refuses a vector that has not one entry a dof of its constraint.
fn check_local(found: usize, expected: usize) -> Result<()> {
    match found == expected {
        true => Ok(()),
        false => Err(Error::Dimension { what: "a vector of a contact constraint", expected, found }),
    }
}

/// Refuses nodes that a mesh of `count` nodes does not have.
fn check_nodes(what: &'static str, nodes: &[usize], count: usize) -> Result<()> {
    match nodes.iter().find(|&&node| node >= count) {
        Some(&found) => Err(Error::Dimension { what, expected: count.saturating_sub(1), found }),
        None => Ok(()),
    }
}

/// Whether a body that comes with these speeds along two normals presses on them so differently that the impact along
/// one is not that along the other: the shares of its kinetic energy (`square` is that of its velocity) that a plastic
/// impact takes differ by more than a tenth.
pub(crate) fn press_differently(speeds: [f64; 2], square: f64) -> bool {
    (speeds[0] * speeds[0] - speeds[1] * speeds[1]).abs() > 0.1 * square
}

/// Share of the way that must lead into a body for a contact to be missed if it comes out again: the cosine of the
/// angle to the inward normal where it enters. An impact below it would have taken a sixteenth of the energy.
pub(crate) const STEEP: f64 = 0.25;

/// Cosine of the largest turn of a normal in a step in which its contact presses: 30 degrees.
pub(crate) const LARGEST_TURN: f64 = 0.866;

/// Share of the way in a step by which a gap may miss its linearization, and a node be stopped away from the surface.
pub(crate) const LARGEST_MISS: f64 = 0.1;
