//! How a body is cut: into slabs of consecutive nodes, or by the crate's own dissection of its graph.

use crate::bodies::Blocks;
use crate::ffi::World;
use crate::parts::Cut;
use crate::share::{Share, host};
use contact_dynamics::faer::sparse::{Pair, SymbolicSparseColMat};
use contact_dynamics::ranks::parts;
use contact_dynamics::{Error, Result};
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Partition {
    Slabs,
    Dissection,
}

impl Partition {
    pub fn name(self) -> &'static str {
        match self {
            Self::Slabs => "slabs",
            Self::Dissection => "dissection",
        }
    }

    /// What this rank has of the body. All ranks call it.
    pub fn cut(self, blocks: &Blocks, world: World) -> Result<Part> {
        let (solid, contact) = (&blocks.solid, blocks.contact_nodes());
        let cut = match self {
            Self::Slabs => Cut::new(solid, &contact, world.rank, world.size),
            Self::Dissection => {
                let all = |element: &Vec<usize>| {
                    let pair = |&row: &usize| element.iter().map(move |&col| Pair { row, col });
                    element.iter().flat_map(pair).collect::<Vec<_>>()
                };
                let pairs: Vec<Pair<usize, usize>> = solid.elements.iter().flat_map(all).collect();
                let count = solid.nodes.len();
                let (graph, _) = SymbolicSparseColMat::try_new_from_indices(count, count, &pairs)
                    .map_err(|error| Error::Host { callback: "graph", source: format!("{error:?}").into() })?;
                Cut::by_owners(solid, &contact, world.rank, &parts(graph.as_ref(), world.size)?)
            }
        };
        let share = Share::new(world, &cut.owners, cut.known()).map_err(|failed| host("share", failed))?;
        Ok(Part { cut, share: Arc::new(share) })
    }
}

/// What one rank has of a body, and its way to the other ranks.
#[derive(Debug)]
pub struct Part {
    pub cut: Cut<3>,
    pub share: Arc<Share>,
}
