//! Contact constraints: gaps, normals and contact laws.

#[cfg(feature = "mesh-contact")]
mod affine_rows;
#[cfg(feature = "mesh-contact")]
mod body_contact;
mod bond;
mod constraint;
mod contacts;
mod dofs;
#[cfg(feature = "mesh-contact")]
mod edge_to_edge;
mod gap_function;
mod gaps;
mod groups;
mod law;
mod linear_rows;
#[cfg(feature = "mesh-contact")]
mod mortar;
#[cfg(feature = "mesh-contact")]
mod node_to_facet;
mod nodes_on_obstacle;
#[cfg(feature = "mesh-contact")]
mod non_penetration;
mod obstacle;
mod rigid_motion;
mod rows;
#[cfg(feature = "mesh-contact")]
mod surface;
#[cfg(feature = "mesh-contact")]
mod surface_settings;
mod tangents;
#[cfg(feature = "mesh-contact")]
mod tie;

#[cfg(feature = "mesh-contact")]
pub use body_contact::BodyContact;
pub use bond::BrokenBond;
pub use constraint::{Candidates, ContactConstraint, Rates, Stride, Variation};
pub(crate) use contacts::kept_depth;
pub use contacts::{Contact, Contacts};
#[cfg(feature = "mesh-contact")]
pub use edge_to_edge::EdgeToEdge;
pub use gap_function::GapFunction;
pub(crate) use gaps::{ErasedGaps, Gaps};
pub(crate) use groups::Groups;
pub use law::ContactLaw;
pub(crate) use law::{Course, Measure};
pub use linear_rows::{GapOffset, LinearRows};
#[cfg(feature = "mesh-contact")]
pub use mortar::{BondStrength, Mortar};
#[cfg(feature = "mesh-contact")]
pub use node_to_facet::NodeToFacet;
pub use nodes_on_obstacle::NodesOnObstacle;
#[cfg(feature = "mesh-contact")]
pub use non_penetration::{Certificate, NonPenetration};
#[cfg(feature = "mesh-contact")]
pub use obstacle::ClosedSurface;
pub use obstacle::{Capsule, Cone, Cuboid, Cylinder, Obstacle, Passage, Plane, Side, Sphere};
pub use rigid_motion::RigidMotion;
pub use rows::{ContactJacobian, GapRates};
pub(crate) use rows::{NO_RESPONSE, RowProducts};
#[cfg(feature = "mesh-contact")]
pub use surface::{Facet, Surface};
#[cfg(feature = "mesh-contact")]
pub use surface_settings::SurfaceSettings;
#[cfg(feature = "mesh-contact")]
use surface_settings::surface_settings;
pub(crate) use tangents::Tangents;
#[cfg(feature = "mesh-contact")]
pub use tie::Tie;

pub use crate::contact_id::ContactId;
use crate::error::{Error, Result};
use crate::real::Real;

/// Rejects mesh lists that differ in length or hold coordinates that are not finite, and nodes that do not exist.
fn check_mesh<T: Real, const D: usize>(coordinates: &[[T; D]], dofs: &[[usize; D]], nodes: &[usize]) -> Result<()> {
    let count = coordinates.len();
    if dofs.len() != count {
        return Err(Error::Dimension { what: "the list of dofs by node", expected: count, found: dofs.len() });
    }
    check_coordinates(coordinates)?;
    check_nodes("a contact node (at most)", nodes, count)
}

/// Rejects coordinates that are not finite.
fn check_coordinates<T: Real, const D: usize>(coordinates: &[[T; D]]) -> Result<()> {
    for (index, x) in coordinates.iter().enumerate() {
        if let Some(x) = x.iter().find(|x| !x.is_finite()) {
            let what = "the list of coordinates (by node)";
            return Err(Error::NotFinite { what, index, value: x.value() });
        }
    }
    Ok(())
}

/// Rejects a vector whose length is not the number of dofs of its constraint.
fn check_local(found: usize, expected: usize) -> Result<()> {
    match found == expected {
        true => Ok(()),
        false => Err(Error::Dimension { what: "a vector of a contact constraint", expected, found }),
    }
}

/// Rejects nodes that a mesh of `count` nodes does not have.
fn check_nodes(what: &'static str, nodes: &[usize], count: usize) -> Result<()> {
    match nodes.iter().find(|&&node| node >= count) {
        Some(&found) => Err(Error::Dimension { what, expected: count.saturating_sub(1), found }),
        None => Ok(()),
    }
}

/// Whether plastic impacts along two normals would take shares of a body's kinetic energy that differ by more than a
/// tenth. `speeds` are its velocity components along them, `square` is the square of its velocity.
pub(crate) fn impacts_differ(speeds: [f64; 2], square: f64) -> bool {
    (speeds[0] * speeds[0] - speeds[1] * speeds[1]).abs() > 0.1 * square
}

/// A body that enters another and leaves it within a step has missed a contact if the cosine of its direction to the
/// inward normal at the entry exceeds this. An impact below it would take at most a sixteenth of the energy.
pub(crate) const STEEP: f64 = 0.25;

/// Cosine of the largest turn of the normal of a closed contact in a step: 30 degrees.
pub(crate) const LARGEST_TURN: f64 = 0.866;

/// Largest error of a linearized gap, and largest gap of a stopped node, as a share of its displacement in the step.
pub(crate) const LARGEST_MISS: f64 = 0.1;

/// Relative motion in a step, as a share of the smallest facet or edge, up to which bodies are not checked: they cannot
/// pass through anything larger than that.
#[cfg(feature = "mesh-contact")]
pub(crate) const FINE: f64 = 0.125;

/// The same limit for the check of the normal along which bodies were stopped. Below it a row lets its node in only
/// over an edge, where the normal is not unique.
#[cfg(feature = "mesh-contact")]
pub(crate) const COARSE: f64 = 0.6;

/// Gap, as a share of the reach, above which a row that has lost its facet surely does not press.
#[cfg(feature = "mesh-contact")]
pub(crate) const OPEN: f64 = 0.01;
