//! The settings of contact between surfaces, which all of its constraints share.

use super::ContactLaw;
use super::surface::Ramp;
#[cfg(doc)]
use super::{BodyContact, EdgeToEdge, Mortar, NodeToFacet};
use crate::error::{Error, Result, positive};
use crate::real::Real;

/// Settings of contact between surfaces: law, friction, search range, and the thickness outside of the facets.
///
/// [`NodeToFacet`], [`Mortar`], [`EdgeToEdge`] and [`BodyContact`] take them by their method `with`, which checks all
/// numbers. A setting that is not given keeps its value, so that `with` may be called several times. The law and
/// friction have their own short methods there too, `with_law` and `friction`.
///
/// ```
/// use contact_dynamics::contact::{Contacts, NodeToFacet, SurfaceSettings};
/// use contact_dynamics::{ContactConstraint, ContactLaw};
///
/// // The middle surfaces of two sheets, 0.1 apart, of which each is 0.06 thick.
/// let coordinates = [[1.0, 0.0], [0.0, 0.0], [0.0, 0.1], [1.0, 0.1]];
/// let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
/// let settings = SurfaceSettings::new().law(ContactLaw::Penalty { stiffness: 1e6 }).friction(0.3).offsets(&[0.03; 4]);
/// let mut contact = NodeToFacet::new(&coordinates, &dofs, [[2, 3]], [[0, 1]])?.with(settings)?;
///
/// contact.search(0.0, &[0.0; 8], &[0.0; 8], 0.0)?;
/// let mut gaps = [0.0; 2];
/// contact.gaps(0.0, &[0.0; 8], &mut gaps)?;
/// assert!(gaps.iter().all(|gap: &f64| (gap - 0.04).abs() < 1e-15));
/// assert_eq!(Contacts::of(&contact).friction(0), 0.3);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceSettings<T> {
    pub(super) law: Option<ContactLaw>,
    pub(super) friction: Option<f64>,
    pub(super) reach: Option<T>,
    pub(super) skin: Option<T>,
    pub(super) offsets: Option<Vec<T>>,
    pub(super) ramp: Option<Ramp>,
    pub(super) rings: Option<usize>,
    pub(super) sharp: Option<f64>,
}

impl<T> Default for SurfaceSettings<T> {
    fn default() -> Self {
        let (law, friction, reach, skin, offsets, ramp, rings, sharp) = Default::default();
        Self { law, friction, reach, skin, offsets, ramp, rings, sharp }
    }
}

impl<T: Real> SurfaceSettings<T> {
    /// Rigid contact without friction and offsets; the search range is found from the size of the facets.
    pub fn new() -> Self {
        Self::default()
    }

    /// The law of all rows; [`ContactLaw::Rigid`] by default.
    #[must_use]
    pub fn law(mut self, law: ContactLaw) -> Self {
        self.law = Some(law);
        self
    }

    /// Coulomb's friction with a coefficient μ ≥ 0; none by default. Slip is the velocity relative to the opposite
    /// material point, weighted as the gap for [`Mortar`]: bodies that turn together do not slip.
    #[must_use]
    pub fn friction(mut self, coefficient: f64) -> Self {
        self.friction = Some(coefficient);
        self
    }

    /// The least distance (length), outside and inside, at which nodes, facets and edges are found. Positive and
    /// finite; by default the mean size of the facets: of the coarser surface for faces and edges, of the surface
    /// with the facets for nodes. The motion within a step is added by the velocities, so that the reach need not fit
    /// the speed.
    #[must_use]
    pub fn reach(mut self, reach: T) -> Self {
        self.reach = Some(reach);
        self
    }

    /// How far (length) the surfaces may move relative to each other before the lists of near facets and edges are
    /// built again. Positive and finite; by default half of the search range. It changes the cost, not the result.
    #[must_use]
    pub fn skin(mut self, skin: T) -> Self {
        self.skin = Some(skin);
        self
    }

    /// How far (length) the surfaces of the bodies lie outside of their facets, one finite value for each node of the
    /// mesh: half the thickness of a shell whose facets are its middle surface, the thickness of a coating; negative
    /// if they lie inside. For nodes without facets it is their own thickness, for instance the radius of a cable.
    /// Between nodes the shape functions interpolate. None by default.
    ///
    /// The gap is the distance less the offsets of both sides. Edges and corners are rounded with the offset as
    /// radius. The closest facet of a node is the one whose surface is closest. Rows of nodes include the change of a
    /// varying offset as the closest point slides, so that forces have a component along the facet, and conserve
    /// linear and angular momentum.
    ///
    /// Forces act on nodes and facets; the lever arm of a friction force about the middle surface is left out.
    ///
    /// # Known failure
    ///
    /// - In dents nodes find only sides that share a vertex with the closest facet. In a dent of 90°, that suffices
    ///   for offsets up to a facet's length.
    /// - A surface in contact with itself penetrates itself in a fold tighter than its offset, because facets beyond
    ///   the [rings](Self::rings) count.
    /// - With negative offsets edges are in contact slightly early, by up to 0.4 of the offset at right angles,
    ///   because between its faces the body is smaller by more than the offset.
    #[must_use]
    pub fn offsets(mut self, offsets: &[T]) -> Self {
        self.offsets = Some(offsets.to_vec());
        self
    }

    /// Scales all [`offsets`](Self::offsets) in time: by the factor `factors[0]` until `times[0]`, by `factors[1]`
    /// from the later `times[1]` on. In between the factor is smooth, without a jump of velocity or acceleration (a
    /// polynomial of the fifth degree).
    ///
    /// For a press fit whose meshes overlap by d, start with offsets whose sum is −d, and factors from 1 to 0. If the
    /// meshes just fit, use a sum of d and factors from 0 to 1.
    #[must_use]
    pub fn ramp(mut self, times: [f64; 2], factors: [f64; 2]) -> Self {
        self.ramp = Some(Ramp { times, factors });
        self
    }

    /// For a surface against itself, the number of rings of facets around a node, or around the nodes of an edge,
    /// that are excluded: 0 are the facets of the node, 1 also the facets that share a node with these, and so on.
    /// The default is 1. Without effect for two surfaces, and for [`Mortar`].
    #[must_use]
    pub fn rings(mut self, rings: usize) -> Self {
        self.rings = Some(rings);
        self
    }

    /// The angle (radians, from 0 to π) between the normals of two facets from which the convex side between them
    /// counts as sharp. It is used in two places, each with its own default; without effect for other constraints:
    ///
    /// - [`EdgeToEdge`]: sides that are edges now, as the surface lies at each search; 0.01 (0.6°) by default. Other
    ///   sides are left to nodes on facets. Two edges of length l that cross at their middles then penetrate by at
    ///   most ½ l tan(½ `angle`) before a node touches: by 0.25 % of an element at 0.01, by 13 % at 30°.
    /// - [`BodyContact`]: sides (in two dimensions nodes) that are sharp in the reference configuration; 30° by
    ///   default. They decide which nodes have rows of their own, and whether edges are needed at all.
    #[must_use]
    pub fn sharp(mut self, angle: f64) -> Self {
        self.sharp = Some(angle);
        self
    }

    /// These settings; a setting that is not given has its value in `before`.
    pub(super) fn or(self, before: Self) -> Self {
        Self {
            law: self.law.or(before.law),
            friction: self.friction.or(before.friction),
            reach: self.reach.or(before.reach),
            skin: self.skin.or(before.skin),
            offsets: self.offsets.or(before.offsets),
            ramp: self.ramp.or(before.ramp),
            rings: self.rings.or(before.rings),
            sharp: self.sharp.or(before.sharp),
        }
    }

    /// Rejects numbers out of range, for a mesh with this number of nodes. Law and friction are checked with the rows
    /// of every constraint.
    pub(super) fn check(&self, nodes: usize) -> Result<()> {
        for (name, length) in
            [("the reach of a contact search", self.reach), ("the skin of a contact search", self.skin)]
        {
            length.map_or(Ok(0.0), |length| positive(name, length.value()))?;
        }
        let offsets = self.offsets.as_deref().unwrap_or_default();
        if self.offsets.is_some() && offsets.len() != nodes {
            let what = "the list of offsets by node";
            return Err(Error::Dimension { what, expected: nodes, found: offsets.len() });
        }
        if let Some(index) = offsets.iter().position(|offset| !offset.is_finite()) {
            let what = "the list of offsets (by node)";
            return Err(Error::NotFinite { what, index, value: offsets[index].value() });
        }
        self.ramp.map_or(Ok(()), |ramp| ramp.check())?;
        match self.sharp {
            Some(value) if !(0.0..=std::f64::consts::PI).contains(&value) => {
                Err(Error::Parameter { name: "the angle of a contact edge", value, range: "from 0 to π" })
            }
            _ => Ok(()),
        }
    }

    /// The law of all rows.
    pub(super) fn given_law(&self) -> ContactLaw {
        self.law.unwrap_or(ContactLaw::Rigid)
    }

    /// The friction coefficient.
    pub(super) fn given_friction(&self) -> f64 {
        self.friction.unwrap_or(0.0)
    }

    /// The angle from which a convex side is an edge, or this one unless it is given.
    pub(super) fn sharp_angle(&self, usual: f64) -> f64 {
        self.sharp.unwrap_or(usual)
    }
}

/// Gives a constraint, which holds `settings` and applies them in `apply_settings`, the methods by which users set
/// them.
macro_rules! surface_settings {
    ($constraint:ident<T $(, $D:ident)?>) => {
        impl<T: Real $(, const $D: usize)?> $constraint<T $(, $D)?> {
            /// Changes the given [settings](crate::contact::SurfaceSettings); the others keep their value.
            ///
            /// # Errors
            ///
            /// [`Error::Parameter`](crate::Error::Parameter) for a reach or skin that is not positive and finite, a
            /// ramp that is not finite or ends before it begins, and an angle that is not from 0 to π;
            /// [`Error::Dimension`](crate::Error::Dimension) unless there is one offset per node of the mesh;
            /// [`Error::NotFinite`](crate::Error::NotFinite) for an offset (index: node);
            /// [`Error::Incompatible`](crate::Error::Incompatible) for offsets of bonded surfaces.
            pub fn with(mut self, settings: $crate::contact::SurfaceSettings<T>) -> Result<Self> {
                self.settings = settings.or(self.settings);
                self.apply_settings()?;
                Ok(self)
            }

            /// Sets the law of all rows, as [`SurfaceSettings::law`](crate::contact::SurfaceSettings::law).
            #[must_use]
            pub fn with_law(mut self, law: $crate::contact::ContactLaw) -> Self {
                self.settings.law = Some(law);
                self
            }

            /// Sets Coulomb's friction with a coefficient μ ≥ 0, as
            /// [`SurfaceSettings::friction`](crate::contact::SurfaceSettings::friction).
            #[must_use]
            pub fn friction(mut self, coefficient: f64) -> Self {
                self.settings.friction = Some(coefficient);
                self
            }
        }
    };
}
pub(super) use surface_settings;
