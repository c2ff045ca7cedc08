//! Assembles a surface from facets: finds neighbors and open sides, and checks the orientation.

use super::nodes::points;
use super::shape::{Point, RIM, Rim};
use super::{Facet, Surface};
use crate::contact::check_nodes;
use crate::error::{Error, Result};
use crate::real::Real;

fn refuse(facet: usize, reason: &'static str) -> Error {
    Error::Incompatible { part: format!("facet {facet} of a contact surface"), reason }
}

impl Surface {
    /// The surface of these facets, given by the indices of their nodes in `coordinates`. These are the coordinates
    /// of all nodes of a mesh in two or three dimensions. Normals point out of the body ([`Facet`]).
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the dimension is not 2 or 3, if a facet does not fit, or if a node does not exist;
    /// [`Error::NotFinite`] for the coordinates (index: node); [`Error::Empty`] without facets;
    /// [`Error::InvertedFacet`] for a facet without area, folded, or turned against its neighbor;
    /// [`Error::Incompatible`] where more than two facets share a side.
    pub fn new<T: Real, F: Into<Facet>, const D: usize>(
        coordinates: &[[T; D]],
        facets: impl IntoIterator<Item = F>,
    ) -> Result<Self> {
        Self::of_facets(facets, D, &points(coordinates)?)
    }

    /// As [`new`](Self::new), with points in space.
    pub(crate) fn of_facets<F: Into<Facet>>(
        facets: impl IntoIterator<Item = F>,
        dimension: usize,
        coordinates: &[Point],
    ) -> Result<Self> {
        let facets: Vec<Facet> = facets.into_iter().map(Into::into).collect();
        if facets.is_empty() {
            let what = "the list of facets of a contact surface";
            return Err(Error::Empty { what, remedy: "give at least one facet" });
        }
        for (index, facet) in facets.iter().enumerate() {
            let nodes = facet.nodes();
            if (nodes.len() == 2) != (dimension == 2) {
                let expected = if dimension == 2 { 2 } else { 3 };
                return Err(Error::Dimension { what: "a facet of a contact surface", expected, found: nodes.len() });
            }
            let others = facet.whole.as_ref().map_or(&[][..], |whole| whole.others());
            for nodes in [nodes, others] {
                check_nodes("the nodes of a facet (at most)", nodes, coordinates.len())?;
            }
            if let Some(reason) = facet.shape(coordinates).fault() {
                return Err(Error::InvertedFacet { facet: index, nodes: nodes.to_vec(), reason });
            }
        }
        let sizes = facets.iter().map(|facet| facet.shape(coordinates).size());
        let finest = sizes.clone().fold(f64::INFINITY, f64::min);
        let typical = sizes.sum::<f64>() / facets.len() as f64;
        let mut around: Vec<_> = facets
            .iter()
            .enumerate()
            .flat_map(|(index, facet)| facet.nodes().iter().enumerate().map(move |(k, &node)| (node, index, k)))
            .collect();
        around.sort_unstable();
        let (mut nodes, mut starts, mut places) = (Vec::new(), Vec::new(), vec![[0; 4]; facets.len()]);
        for (number, &(node, facet, k)) in around.iter().enumerate() {
            if nodes.last() != Some(&node) {
                nodes.push(node);
                starts.push(number);
            }
            places[facet][k] = nodes.len() - 1;
        }
        starts.push(around.len());
        let mut surface = Self {
            dimension,
            rims: vec![Rim { sides: [true; 4], vertices: [false; 4], beyond: RIM }; facets.len()],
            neighbors: vec![[None; 4]; facets.len()],
            facets,
            nodes,
            places,
            around: around.into_iter().map(|(_, facet, k)| (facet, k)).collect(),
            starts,
            finest,
            typical,
        };
        surface.connect()?;
        surface.find_rim();
        Ok(surface)
    }

    fn connect(&mut self) -> Result<()> {
        let dimension = self.dimension;
        // (smaller node, larger node, facet, side, whether the side runs from the smaller to the larger node)
        let mut sides = Vec::new();
        for (index, facet) in self.facets.iter().enumerate() {
            let nodes = facet.nodes();
            for (k, &node) in nodes.iter().enumerate() {
                let other = if dimension == 2 { node } else { nodes[(k + 1) % nodes.len()] };
                let forward = if dimension == 2 { k == 0 } else { node < other };
                sides.push((node.min(other), node.max(other), index, k, forward));
            }
        }
        sides.sort_unstable();
        // By facet, the number of neighbors with the opposite orientation, and of those minus the others.
        let (mut opposite, mut excess) = (vec![0; self.facets.len()], vec![0; self.facets.len()]);
        for group in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            match *group {
                [] | [_] => {}
                [(.., i, k, one), (.., j, l, other)] => {
                    for (facet, side, neighbor) in [(i, k, (j, l)), (j, l, (i, k))] {
                        self.neighbors[facet][side] = Some(neighbor);
                        self.rims[facet].sides[side] = false;
                        opposite[facet] += usize::from(one == other);
                        excess[facet] += if one == other { 1 } else { -1 };
                    }
                }
                [_, _, (_, _, facet, ..), ..] => {
                    let reason = "it shares a side with two facets or more, and a surface must not branch";
                    return Err(refuse(facet, reason));
                }
            }
        }
        match (0..opposite.len()).rev().filter(|&facet| opposite[facet] > 0).max_by_key(|&facet| excess[facet]) {
            Some(facet) => {
                let reason =
                    "its normal and those of its neighbors point to different sides; turn it, or the neighbors";
                Err(Error::InvertedFacet { facet, nodes: self.facets[facet].nodes().to_vec(), reason })
            }
            None => Ok(()),
        }
    }

    /// Marks the vertices at the ends of open sides as rim vertices.
    fn find_rim(&mut self) {
        let Self { facets, rims, nodes, places, .. } = self;
        let mut open = vec![false; nodes.len()];
        let vertices = || facets.iter().zip(&*places).map(|(facet, places)| &places[..facet.nodes().len()]);
        for (places, rim) in vertices().zip(&*rims) {
            for (k, &place) in places.iter().enumerate().filter(|&(k, _)| rim.sides[k]) {
                open[place] = true;
                if places.len() > 2 {
                    open[places[(k + 1) % places.len()]] = true;
                }
            }
        }
        for (places, rim) in vertices().zip(rims) {
            for (vertex, &place) in rim.vertices.iter_mut().zip(places) {
                *vertex = open[place];
            }
        }
    }
}
