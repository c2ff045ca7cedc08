//! The search settings of a constraint between surfaces: its reach, offsets, and the facets and depths without
//! contact.

use super::Surface;
use super::material::{Material, near};
use super::offsets::Thickness;
use super::own_facets::{OwnFacets, around};
use super::reach::Reach;
use super::shape::Point;
use crate::contact::SurfaceSettings;
use crate::error::Result;
use crate::real::Real;

#[derive(Debug)]
pub(crate) struct Vicinity {
    pub(crate) reach: Reach,
    pub(crate) thickness: Thickness,
    /// For a surface against itself, the facets excluded for each node; none before they are needed.
    pub(crate) own_facets: Option<OwnFacets>,
    /// The material behind both surfaces (one entry for a surface against itself); empty before it is needed.
    pub(crate) material: Vec<Material>,
    /// For a surface against itself, the number of rings of facets around a node that are excluded.
    rings: Option<usize>,
}

impl Vicinity {
    /// For two surfaces of a mesh with this number of nodes, or for a surface against itself. `typical` is the reach
    /// if none is given. Rejects settings out of range.
    pub(crate) fn new<T: Real>(
        settings: &SurfaceSettings<T>,
        nodes: usize,
        typical: f64,
        of_itself: bool,
    ) -> Result<Self> {
        settings.check(nodes)?;
        let SurfaceSettings { reach, skin, offsets, ramp, rings, .. } = settings;
        let reach = reach.map_or(typical, T::value);
        Ok(Self {
            reach: Reach::new(reach, skin.map(T::value)),
            thickness: Thickness::new(offsets.as_deref().unwrap_or_default(), ramp.unwrap_or_default()),
            own_facets: None,
            material: Vec::new(),
            rings: of_itself.then_some(rings.unwrap_or(1)),
        })
    }

    pub(crate) fn is_of_itself(&self) -> bool {
        self.rings.is_some()
    }

    /// Finds the excluded facets and the material, unless they are known. The two bodies are the nodes of the two
    /// surfaces; for a surface against itself only the first surface counts.
    pub(crate) fn prepare(&mut self, surfaces: &[&Surface], bodies: &[Vec<usize>; 2], coordinates: &[Point]) {
        if !self.material.is_empty() {
            return;
        }
        let known = (self.reach.least(), self.thickness.overlap(bodies));
        for surface in &surfaces[..if self.is_of_itself() { 1 } else { surfaces.len() }] {
            let near = near(surface, coordinates, known.0);
            self.material.push(Material::new(surface, &near, coordinates, known));
            self.own_facets = self.rings.map(|rings| OwnFacets { adjacent: around(surface, rings), nearby: near });
        }
    }

    /// The material behind the nodes of a pass, and behind its facets; none if one of them is not known. In pass 0
    /// the first surface has the facets.
    pub(crate) fn material_of(&self, pass: usize) -> Option<[&Material; 2]> {
        match &self.material[..] {
            [itself] if self.is_of_itself() => Some([itself; 2]),
            [first, second] if pass == 0 => Some([second, first]),
            [first, second] => Some([first, second]),
            _ => None,
        }
    }

    /// Drops all lists that depend on the settings.
    pub(crate) fn forget(&mut self) {
        self.reach.forget();
        self.own_facets = None;
        self.material.clear();
    }
}
