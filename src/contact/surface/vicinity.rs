//! The search settings of a constraint between surfaces: its reach, offsets, and the facets and depths without
//! contact.

use super::Surface;
use super::material::{Material, near};
use super::offsets::Thickness;
use super::own_facets::{OwnFacets, around};
use super::ramp::Ramp;
use super::reach::Reach;
use super::shape::Point;
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
    /// For two surfaces without offsets.
    pub(crate) fn new(reach: f64) -> Self {
        let (reach, thickness) = (Reach::new(reach), Thickness::default());
        Self { reach, thickness, own_facets: None, material: Vec::new(), rings: None }
    }

    /// For a surface against itself, with one ring excluded.
    pub(crate) fn of_itself(reach: f64) -> Self {
        Self { rings: Some(1), ..Self::new(reach) }
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

    /// Sets the number of rings of facets around a node that are excluded, for a surface against itself.
    pub(crate) fn set_rings(&mut self, rings: usize) {
        self.rings = self.rings.map(|_| rings);
        self.forget();
    }

    /// Sets one offset per node. Rejects lists of another length and values that are not finite.
    pub(crate) fn set_offsets<T: Real>(&mut self, offsets: &[T], nodes: usize) -> Result<()> {
        self.thickness.set(offsets, nodes)?;
        self.forget();
        Ok(())
    }

    pub(crate) fn set_ramp(&mut self, times: [f64; 2], factors: [f64; 2]) -> Result<()> {
        self.thickness.ramp = Ramp::new(times, factors)?;
        self.forget();
        Ok(())
    }

    pub(crate) fn set_least<T: Real>(&mut self, reach: T) -> Result<()> {
        self.reach.set_least(reach)?;
        self.forget();
        Ok(())
    }
}
