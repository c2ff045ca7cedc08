//! How far a constraint between surfaces looks: its reach, what surfaces are thick, and what is not met within it.

use super::Surface;
use super::kin::Kin;
use super::material::{Material, near};
use super::offsets::Thickness;
use super::ramp::Ramp;
use super::reach::Reach;
use super::shape::Point;
use crate::error::Result;
use crate::real::Real;

#[derive(Debug)]
pub(crate) struct Vicinity {
    pub(crate) reach: Reach,
    pub(crate) thickness: Thickness,
    /// What is not met of a surface against itself, once it was asked for.
    pub(crate) kin: Option<Kin>,
    /// The material behind both surfaces, of one against itself once: none before it was asked for.
    pub(crate) material: Vec<Material>,
    /// Of a surface against itself how many rings of facets around a node it does not meet.
    rings: Option<usize>,
}

impl Vicinity {
    /// Of two surfaces without offsets.
    pub(crate) fn new(reach: f64) -> Self {
        let (reach, thickness) = (Reach::new(reach), Thickness::default());
        Self { reach, thickness, kin: None, material: Vec::new(), rings: None }
    }

    /// That of a surface against itself: but for one ring.
    pub(crate) fn of_itself(reach: f64) -> Self {
        Self { rings: Some(1), ..Self::new(reach) }
    }

    pub(crate) fn is_of_itself(&self) -> bool {
        self.rings.is_some()
    }

    /// Finds what nodes do not meet, unless it is known: of two surfaces (of one against itself the first counts) whose
    /// nodes are those of the two bodies.
    pub(crate) fn prepare(&mut self, surfaces: &[&Surface], bodies: &[Vec<usize>; 2], coordinates: &[Point]) {
        if !self.material.is_empty() {
            return;
        }
        let known = (self.reach.least(), self.thickness.overlap(bodies));
        for surface in &surfaces[..if self.is_of_itself() { 1 } else { surfaces.len() }] {
            let near = near(surface, coordinates, known.0);
            self.material.push(Material::new(surface, &near, coordinates, known));
            self.kin = self.rings.map(|rings| Kin::new(surface, rings, near));
        }
    }

    /// The material behind the nodes of a pass, whose facets are those of the first surface in the first one, and
    /// behind these; none if one of both is not known.
    pub(crate) fn material_of(&self, pass: usize) -> Option<[&Material; 2]> {
        match &self.material[..] {
            [itself] if self.is_of_itself() => Some([itself; 2]),
            [first, second] if pass == 0 => Some([second, first]),
            [first, second] => Some([first, second]),
            _ => None,
        }
    }

    /// What is known no longer holds.
    pub(crate) fn forget(&mut self) {
        self.reach.forget();
        self.kin = None;
        self.material.clear();
    }

    /// How many rings of facets around a node it does not meet, of a surface against itself.
    pub(crate) fn set_rings(&mut self, rings: usize) {
        self.rings = self.rings.map(|_| rings);
        self.forget();
    }

    /// Takes one offset a node; refuses lists of another length, and what is not finite.
    pub(crate) fn set_offsets<T: Real>(&mut self, offsets: &[T], nodes: usize) -> Result<()> {
        self.thickness.set(offsets, nodes)?;
        self.forget();
        Ok(())
    }

    /// Lets offsets change with time.
    pub(crate) fn set_ramp(&mut self, times: [f64; 2], factors: [f64; 2]) -> Result<()> {
        self.thickness.ramp = Ramp::new(times, factors)?;
        self.forget();
        Ok(())
    }

    /// The least distance at which surfaces are found.
    pub(crate) fn set_least<T: Real>(&mut self, reach: T) -> Result<()> {
        self.reach.set_least(reach)?;
        self.forget();
        Ok(())
    }
}
