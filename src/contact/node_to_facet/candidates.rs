//! The candidates of contact: a search finds them, and `follow` projects their nodes again.

use super::{NodeToFacet, Pass};
use crate::contact::affine_rows::SearchState;
use crate::contact::surface::{Bounds, Ground, Kept, Offsets, Point, Stand, Surface, Vicinity};
use crate::contact::{ContactId, OPEN};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::half_digits;

impl<T: Real> NodeToFacet<T> {
    /// Finds the boxes of all facets, and makes the lists of facets valid for the current positions and for closest
    /// points up to `range` away.
    pub(super) fn update_lists(&mut self, motions: &[Bounds; 2], range: f64) {
        let positions = &self.nodes.positions;
        let own = self.own_surface.as_ref().filter(|_| !self.vicinity.is_of_itself());
        let surfaces = [Some(&self.surface), own];
        for (cones, surface) in self.cones.iter_mut().zip(surfaces.into_iter().flatten()) {
            cones.find(surface, positions);
        }
        for (pass, surface) in self.passes.iter_mut().zip(surfaces.into_iter().flatten()) {
            pass.boxes.clear();
            pass.boxes.extend(surface.boxes(positions));
        }
        let Some(listed) = self.vicinity.reach.renew(motions, range, positions) else { return };
        for pass in &mut self.passes {
            pass.lists.build(&pass.nodes, positions, &pass.boxes, listed);
        }
        self.rebuilds += 1;
    }

    /// The rows of one pass, in the order of its nodes. `near` is the box of the other body, widened by the search
    /// range, and `speeds` are the boxes of the velocities of both bodies.
    pub(super) fn find_rows(&mut self, pass: usize, near: &Bounds, speeds: &[Bounds; 2], state: &SearchState<'_, T>) {
        let mut clearance = std::mem::take(&mut self.passes[pass].clearance);
        self.find_rows_and(pass, near, speeds, state, &mut clearance);
        self.passes[pass].clearance = clearance;
    }

    /// As `find_rows`; also writes a lower bound of the distance of each node from the surface.
    fn find_rows_and(
        &mut self,
        pass: usize,
        near: &Bounds,
        speeds: &[Bounds; 2],
        &SearchState { t, u, v, ahead }: &SearchState<'_, T>,
        clearance: &mut [f64],
    ) {
        let Self { surface, own_surface, nodes, passes, vicinity, found, cones, leaves_edges, .. } = self;
        let Vicinity { own_facets, reach, thickness, .. } = &*vicinity;
        let places = (&nodes.positions[..], thickness.at(t));
        let positions = places.0;
        let surfaces = (&*surface, own_surface.as_ref());
        let [_, growth] = thickness.sizes(nodes.bodies(), [t, t + ahead]);
        let [thick, _] = thickness.sizes(nodes.bodies(), [t; 2]);
        let motions = reach.motions(nodes);
        let ground_of = |pass: usize| {
            let kept = Kept { reach, motion: motions[1 - pass], thick };
            let ground = ground((pass, passes), surfaces, vicinity, places, kept, half_digits::<T>().value())?;
            let of = |other: usize| if own_facets.is_some() { Some(&cones[0]) } else { cones.get(other) };
            Some(Ground { boxes: Some(&passes[pass].boxes), cones: [of(pass), of(1 - pass)], ..ground })
        };
        let Some(ground) = ground_of(pass) else { return };
        // The pass of the facets' own nodes, if there is one: for two surfaces the other pass.
        let back = if own_facets.is_some() { Some((pass, ground)) } else { Some(1 - pass).zip(ground_of(1 - pass)) };
        let back = back.filter(|_| own_facets.is_some() || passes.len() > 1);
        let way_of = |pass: usize, node: usize| {
            growth + ahead * Bounds::of_points([nodes.vector(node, v)]).farthest(&speeds[1 - pass])
        };
        for (place, (&node, clearance)) in ground.nodes.iter().zip(clearance).enumerate() {
            if !near.contains(positions[node]) {
                continue;
            }
            let way = way_of(pass, node);
            let (distance, stand) = ground.clearance(place, reach.least() + way);
            *clearance = distance;
            let stand = stand.filter(|stand| !(*leaves_edges && ground.is_beside(stand)));
            let Some(stand) = stand.map(|stand| ground.first_side(stand, way)) else { continue };
            let face_each_other = ground.vertex(&stand).zip(back).is_some_and(|(vertex, (pass, back))| {
                let way = way_of(pass, vertex);
                let place = back.nodes.binary_search(&vertex).ok();
                let other = place.and_then(|place| back.closest(place, reach.least() + way, None));
                let other = other.map(|other| back.first_side(other, way));
                other.and_then(|other| back.vertex(&other)) == Some(node)
            });
            if face_each_other && ground.is_second(&stand, pass) {
                continue;
            }
            let mut push = |candidate: usize, stand: &Stand| {
                let vertices = ground.surface.facets()[stand.facet].nodes();
                let row = (stand, ground.slope(stand));
                found.push((node, candidate), row, vertices, |node| nodes.places(node), u);
            };
            let mut beside = ground.beside(&stand, way);
            let Some(next) = beside.next() else {
                push(pass, &stand);
                continue;
            };
            push(pass, &ground.first_in_dent(stand));
            for stand in std::iter::once(next).chain(beside) {
                push(beside_of(pass, stand.facet), &stand);
            }
        }
    }

    /// Linearizes the existing rows at the current positions of their nodes.
    pub(super) fn move_rows(&mut self, t: f64, u: &[T]) -> Result<()> {
        let Self { surface, own_surface, nodes, passes, vicinity, rows, found, .. } = self;
        let Vicinity { reach, thickness, .. } = &*vicinity;
        let motions = reach.motions(nodes);
        let places = (&nodes.positions[..], thickness.at(t));
        let positions = places.0;
        let [thick, _] = thickness.sizes(nodes.bodies(), [t; 2]);
        let surfaces = (&*surface, own_surface.as_ref());
        let mut next = 0;
        for group in rows.identities.chunk_by(|x, y| (x.0, pass_of(x.1)) == (y.0, pass_of(y.1))) {
            let (node, pass) = (group[0].0, pass_of(group[0].1));
            let first = next;
            next += group.len();
            let stands = &rows.spots[first..next];
            let kept = Kept { reach, motion: motions[1 - pass], thick };
            let ground = ground((pass, passes), surfaces, vicinity, places, kept, half_digits::<T>().value());
            // The list of the node is complete for surfaces up to this distance.
            let known = reach.known_around(node, positions[node], &motions[1 - pass]) - thick;
            let ground = ground.filter(|_| known > 0.0);
            let Stand { place, facet, .. } = stands[0];
            let closest = ground.and_then(|ground| {
                ground.closest(place, known, Some(facet)).or_else(|| ground.last(place, facet, known))
            });
            for (k, &old) in stands.iter().enumerate() {
                let row = first + k;
                let stand = ground.and_then(|ground| {
                    let stand = ground.followed(stands, k, closest)?;
                    Some((stand, ground.slope(&stand), ground.surface.facets()[stand.facet].nodes()))
                });
                match stand {
                    Some((stand, slope, vertices)) => match old.followed_by(stand, t) {
                        Some(stand) => found.push(group[k], (&stand, slope), vertices, |node| nodes.places(node), u),
                        None => found.keep(rows, row),
                    },
                    // No facet is near.
                    None if known > 0.0 && rows.gap(row, places.1.factor, u).value() > OPEN * reach.least() => {
                        found.keep(rows, row);
                    }
                    // The first row of the node decides for all.
                    None if k > 0 => found.keep(rows, row),
                    None => {
                        let contact = ContactId { constraint: 0, feature: node, candidate: pass };
                        return Err(Error::ContactLost { t, contact });
                    }
                }
            }
        }
        Ok(())
    }
}

/// The candidate number of an additional row of a node in a dent.
fn beside_of(pass: usize, facet: usize) -> usize {
    pass + 2 * (1 + facet)
}

pub(super) fn pass_of(candidate: usize) -> usize {
    candidate % 2
}

/// The nodes of a pass and the surface onto which they are projected.
fn ground<'a>(
    (pass, passes): (usize, &'a [Pass]),
    (surface, own_surface): (&'a Surface, Option<&'a Surface>),
    vicinity: &'a Vicinity,
    (positions, offsets): (&'a [Point], Offsets<'a>),
    kept: Kept<'a>,
    rounding: f64,
) -> Option<Ground<'a>> {
    let Pass { nodes, lists, .. } = passes.get(pass)?;
    let (surface, own) = if pass == 0 { (surface, own_surface) } else { (own_surface?, Some(surface)) };
    let (lists, kept, cones) = (Some(lists), Some(kept), [None; 2]);
    let (own_facets, material) = (vicinity.own_facets.as_ref(), vicinity.material_of(pass));
    Some(Ground {
        nodes,
        lists,
        kept,
        surface,
        boxes: None,
        cones,
        own,
        own_facets,
        material,
        positions,
        offsets,
        rounding,
    })
}
