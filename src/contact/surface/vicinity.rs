//! How far a constraint between surfaces looks: its reach, what surfaces are thick, and what one does not meet of
//! itself. What depends on one another of these changes together here.

use super::Surface;
use super::kin::Kin;
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
    /// What is not met of a surface against itself, and by how many rings it was found.
    pub(crate) kin: Option<Kin>,
    rings: usize,
}

impl Vicinity {
    /// Of two surfaces without offsets.
    pub(crate) fn new(reach: f64) -> Self {
        Self { reach: Reach::new(reach), thickness: Thickness::default(), kin: None, rings: 0 }
    }

    /// Makes it that of a surface against itself: but for one ring.
    pub(crate) fn meet_itself(&mut self, surface: &Surface, coordinates: &[Point]) {
        self.rings = 1;
        self.find_kin(surface, coordinates);
    }

    fn find_kin(&mut self, surface: &Surface, coordinates: &[Point]) {
        let body = surface.nodes().to_vec();
        let known = (self.reach.least(), self.thickness.overlap(&[body.clone(), body]));
        self.kin = Some(Kin::new(surface, self.rings, coordinates, known));
        self.reach.forget();
    }

    fn find_kin_again(&mut self, surface: &Surface, coordinates: &[Point]) {
        if self.kin.is_some() {
            self.find_kin(surface, coordinates);
        }
    }

    /// How many rings of facets around a node it does not meet, of a surface against itself.
    pub(crate) fn set_rings(&mut self, rings: usize, surface: &Surface, coordinates: &[Point]) {
        self.rings = rings;
        self.find_kin_again(surface, coordinates);
    }

    /// Takes one offset a node; refuses lists of another length, and what is not finite.
    pub(crate) fn set_offsets<T: Real>(
        &mut self,
        offsets: &[T],
        surface: &Surface,
        coordinates: &[Point],
    ) -> Result<()> {
        self.thickness.set(offsets, coordinates.len())?;
        self.reach.forget();
        self.find_kin_again(surface, coordinates);
        Ok(())
    }

    /// Lets offsets change with time.
    pub(crate) fn set_ramp(
        &mut self,
        (times, factors): ([f64; 2], [f64; 2]),
        surface: &Surface,
        coordinates: &[Point],
    ) -> Result<()> {
        self.thickness.ramp = Ramp::new(times, factors)?;
        self.find_kin_again(surface, coordinates);
        Ok(())
    }

    /// The least distance at which surfaces are found.
    pub(crate) fn set_least<T: Real>(&mut self, reach: T, surface: &Surface, coordinates: &[Point]) -> Result<()> {
        self.reach.set_least(reach)?;
        self.find_kin_again(surface, coordinates);
        Ok(())
    }
}
