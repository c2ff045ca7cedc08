//! The ranks of a body: sums over all of them, values from owners, whole vectors on rank 0, and what that costs.

use crate::ffi::{Counts, Failed, Peers, World};
use contact_dynamics::ranks::Ranks;
use contact_dynamics::{Error, Result};
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// What one rank has of the dofs of a body.
#[derive(Debug)]
pub struct Share {
    pub world: World,
    owned: Vec<Range<usize>>,
    /// The number in the whole body of each dof of this rank, ascending.
    pub known: Vec<usize>,
    /// Dofs of the whole body.
    pub dofs: usize,
    peers: Peers,
    /// Dofs of this rank that go to the peers, and that come from them.
    sent: Vec<usize>,
    received: Vec<usize>,
    /// How many dofs each rank owns; on rank 0, which.
    counts: Counts,
    owners: Vec<usize>,
    buffers: Mutex<Buffers>,
    pub cost: Cost,
}

#[derive(Debug, Default)]
struct Buffers {
    sent: Vec<f64>,
    received: Vec<f64>,
    own: Vec<f64>,
    all: Vec<f64>,
}

/// Bytes that this rank has sent, and time that it has spent in it, waiting included.
#[derive(Debug, Default)]
pub struct Cost {
    bytes: AtomicU64,
    messages: AtomicU64,
    nanoseconds: AtomicU64,
}

impl Cost {
    /// Adds a call that began at `start`.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn add(&self, world: World, start: f64, numbers: usize) {
        self.bytes.fetch_add(8 * numbers as u64, Ordering::Relaxed);
        self.messages.fetch_add(1, Ordering::Relaxed);
        self.nanoseconds.fetch_add(((world.time() - start) * 1e9) as u64, Ordering::Relaxed);
    }

    /// Bytes, calls and seconds, from the last time on.
    pub fn take(&self) -> [f64; 3] {
        let take = |counter: &AtomicU64| counter.swap(0, Ordering::Relaxed) as f64;
        [take(&self.bytes), take(&self.messages), 1e-9 * take(&self.nanoseconds)]
    }
}

/// An error of MPI as the crate carries it.
pub fn host(callback: &'static str, failed: Failed) -> Error {
    Error::Host { callback, source: failed.into() }
}

impl Share {
    /// Of a body whose dofs belong to `owner`, for the rank that knows `known`. All ranks call it.
    pub fn new(world: World, owner: &[usize], known: Vec<usize>) -> std::result::Result<Self, Failed> {
        let rank = world.rank;
        let mut owned: Vec<Range<usize>> = Vec::new();
        for (dof, _) in known.iter().enumerate().filter(|(_, whole)| owner[**whole] == rank) {
            match owned.last_mut().filter(|range| range.end == dof) {
                Some(range) => range.end += 1,
                None => owned.push(dof..dof + 1),
            }
        }
        let local = |whole: &usize| known.binary_search(whole).expect("an owned dof is known");
        let (mut peers, mut sent, mut received) = (Peers::default(), Vec::new(), Vec::new());
        for (other, others) in world.gather_indices(&known)?.iter().enumerate().filter(|(other, _)| *other != rank) {
            let to: Vec<_> = others.iter().filter(|dof| owner[**dof] == rank).map(local).collect();
            let from: Vec<_> = (0..known.len()).filter(|&dof| owner[known[dof]] == other).collect();
            if !to.is_empty() || !from.is_empty() {
                peers.push(other, to.len(), from.len());
                sent.extend(to);
                received.extend(from);
            }
        }
        let mut owners: Vec<usize> = (0..owner.len()).collect();
        owners.sort_by_key(|&dof| owner[dof]);
        let counts = Counts::new((0..world.size).map(|rank| owner.iter().filter(|&&other| other == rank).count()));
        let (dofs, buffers, cost) = (owner.len(), Mutex::default(), Cost::default());
        Ok(Self { world, owned, known, dofs, peers, sent, received, counts, owners, buffers, cost })
    }

    /// The columns that this rank owns, in its own numbers.
    pub fn own_dofs(&self) -> impl Iterator<Item = usize> + '_ {
        self.owned.iter().cloned().flatten()
    }

    /// Brings what all ranks own to rank 0, as a vector of the whole body; elsewhere `whole` is left empty.
    pub fn gather(&self, values: &[f64], whole: &mut Vec<f64>) -> Result<()> {
        let start = self.world.time();
        let mut buffers = self.buffers.lock().unwrap();
        let Buffers { own, all, .. } = &mut *buffers;
        own.clear();
        own.extend(self.own_dofs().map(|dof| values[dof]));
        let is_root = self.world.rank == 0;
        all.resize(if is_root { self.dofs } else { 0 }, 0.0);
        let result = self.world.gather(own, &self.counts, all);
        whole.resize(all.len(), 0.0);
        if is_root {
            for (&dof, &value) in self.owners.iter().zip(all.iter()) {
                whole[dof] = value;
            }
        }
        self.cost.add(self.world, start, own.len());
        result.map_err(|failed| host("gather", failed))
    }

    /// The way back: gives each rank what it owns.
    pub fn scatter(&self, whole: &[f64], values: &mut [f64]) -> Result<()> {
        let start = self.world.time();
        let mut buffers = self.buffers.lock().unwrap();
        let Buffers { own, all, .. } = &mut *buffers;
        all.clear();
        all.extend(self.owners.iter().take(whole.len()).map(|&dof| whole[dof]));
        own.resize(self.own_dofs().count(), 0.0);
        let result = self.world.scatter(all, &self.counts, own);
        for (dof, &value) in self.own_dofs().zip(own.iter()) {
            values[dof] = value;
        }
        self.cost.add(self.world, start, all.len());
        result.map_err(|failed| host("scatter", failed))
    }

    /// Gives all ranks the values of rank 0.
    pub fn broadcast(&self, values: &mut [f64]) -> Result<()> {
        let start = self.world.time();
        let result = self.world.broadcast(values);
        self.cost.add(self.world, start, if self.world.rank == 0 { values.len() } else { 0 });
        result.map_err(|failed| host("broadcast", failed))
    }

    /// What this rank knows of a vector of the whole body.
    pub fn of(&self, whole: &[f64]) -> Vec<f64> {
        self.known.iter().map(|&dof| whole[dof]).collect()
    }
}

impl Ranks<f64> for Share {
    fn rank(&self) -> usize {
        self.world.rank
    }

    fn owned(&self) -> &[Range<usize>] {
        &self.owned
    }

    fn sum(&self, values: &mut [f64]) -> Result<()> {
        let start = self.world.time();
        let result = self.world.sum(values);
        self.cost.add(self.world, start, values.len());
        result.map_err(|failed| host("sum", failed))
    }

    fn max(&self, values: &mut [f64]) -> Result<()> {
        let start = self.world.time();
        let result = self.world.max(values);
        self.cost.add(self.world, start, values.len());
        result.map_err(|failed| host("max", failed))
    }

    fn share(&self, values: &mut [f64]) -> Result<()> {
        let start = self.world.time();
        let mut buffers = self.buffers.lock().unwrap();
        let Buffers { sent, received, .. } = &mut *buffers;
        sent.clear();
        sent.extend(self.sent.iter().map(|&dof| values[dof]));
        received.resize(self.received.len(), 0.0);
        let result = self.world.exchange(&self.peers, sent, received);
        for (&dof, &value) in self.received.iter().zip(received.iter()) {
            values[dof] = value;
        }
        self.cost.add(self.world, start, sent.len());
        result.map_err(|failed| host("share", failed))
    }
}
