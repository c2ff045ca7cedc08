//! Contact of nodes with facets as a constraint: its rows, search, gaps and rates.

use super::NodeToFacet;
use super::candidates::pass_of;
use super::rows::Rows;
use crate::contact::affine_rows::{SearchState, set_friction};
use crate::contact::surface::{Shape, Surface, overhang};
use crate::contact::{Candidates, ContactConstraint, Contacts, GapRates, Rates, Stride, check_local};
use crate::error::Result;
use crate::real::Real;

impl<T: Real> ContactConstraint<T> for NodeToFacet<T> {
    fn dofs(&self) -> &[usize] {
        self.nodes.dofs()
    }

    fn contacts(&self, contacts: &mut Contacts<T>) {
        let Rows { identities, spots, affine, .. } = &self.rows;
        for (row, (&(node, candidate), stand)) in identities.iter().zip(spots).enumerate() {
            let pass = pass_of(candidate);
            let mut contact = contacts.push_row((node, candidate), self.settings.given_law(), (&affine.jacobian, row));
            contact.at(self.nodes.positions[node], stand.normal);
            contact.recovery(T::of(self.recovery()));
            let surface = self.own_surface.as_ref().filter(|_| pass > 0).unwrap_or(&self.surface);
            let vertices = surface.facets()[stand.facet].nodes().iter().zip(stand.weights);
            let shares = std::iter::once((node, 1.0)).chain(vertices.map(|(&vertex, weight)| (vertex, -weight)));
            let coefficient = self.settings.given_friction();
            set_friction(&mut contact, coefficient, (&self.nodes, stand.normal), &shares);
        }
    }

    fn search(&mut self, t: f64, u: &[T], v: &[T], ahead: f64) -> Result<Candidates> {
        check_local(u.len(), self.nodes.dofs().len())?;
        let boxes = self.nodes.move_to(u)?;
        let surfaces: &[&Surface] = match &self.own_surface {
            Some(own) => &[&self.surface, own],
            None => &[&self.surface],
        };
        self.vicinity.prepare(surfaces, self.nodes.bodies(), &self.nodes.coordinates);
        let motions = self.vicinity.reach.motions(&self.nodes);
        let speeds = self.nodes.boxes_of(|node| self.nodes.vector(node, v));
        self.found.clear();
        let [thick, growth] = self.vicinity.thickness.sizes(self.nodes.bodies(), [t, t + ahead]);
        let near = self.vicinity.reach.least() + growth + ahead * speeds[0].farthest(&speeds[1]);
        let range = near + thick;
        // Facets extend a little beyond the rim.
        let wide = range + boxes.iter().map(overhang).fold(0.0, f64::max);
        for pass in &mut self.passes {
            pass.clearance.fill(near);
        }
        if boxes[0].inflated(wide).intersects(&boxes[1]) {
            self.update_lists(&motions, range);
            for pass in 0..self.passes.len() {
                self.find_rows(pass, &boxes[1 - pass].inflated(wide), &speeds, &SearchState { t, u, v, ahead });
            }
        }
        Ok(self.rows.replace(&mut self.found))
    }

    fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        check_local(u.len(), self.nodes.dofs().len())?;
        // If a trial state is not finite, the gaps are not finite either.
        if self.nodes.move_to(u).is_err() {
            return Ok(Candidates::Unchanged);
        }
        self.found.clear();
        self.move_rows(t, u)?;
        Ok(self.rows.replace(&mut self.found))
    }

    fn inspect(&mut self, step: &Stride<'_, T>) -> Result<()> {
        self.check_step(step)
    }

    fn gaps(&mut self, t: f64, u: &[T], gaps: &mut [T]) -> Result<()> {
        self.rows.gaps(self.vicinity.thickness.ramp.at(t), u, gaps);
        Ok(())
    }

    fn rates(&mut self, t: f64, u: &[T], v: &[T], rates: &mut [GapRates<T>]) -> Result<Rates> {
        let Rows { identities, spots, .. } = &self.rows;
        for ((out, &(node, candidate)), stand) in rates.iter_mut().zip(identities).zip(spots) {
            let surface = self.own_surface.as_ref().filter(|_| pass_of(candidate) > 0).unwrap_or(&self.surface);
            let facet = &surface.facets()[stand.facet];
            let corners = facet.nodes.map(|vertex| self.moving(vertex, u, v));
            let [x, speed] = self.moving(node, u, v);
            let [shape, velocity] = [0, 1].map(|k| Shape::new(corners.map(|corner| corner[k]), facet.count));
            let mut acceleration = stand.acceleration(x, speed, &shape, &velocity);
            let (offsets, ramp) = (self.vicinity.thickness.at(t), &self.vicinity.thickness.ramp);
            let mut rate = 0.0;
            if !offsets.is_none() {
                let [slides, bends] = stand.sliding(speed, (&shape, &velocity), offsets.at_corners(facet));
                rate = -ramp.rate(t) * stand.offset;
                acceleration -=
                    offsets.factor * bends + 2.0 * ramp.rate(t) * slides + ramp.acceleration(t) * stand.offset;
            }
            *out = GapRates { rate: T::of(rate), acceleration: T::of(acceleration) };
        }
        Ok(Rates::Given)
    }
}
