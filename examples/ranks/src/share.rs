//! The ranks of a body: sums over all of them, values from owners, whole vectors on rank 0, and values that come to
//! their owners from where they were computed.

use crate::clock::Clock;
use crate::ffi::{Counts, Failed, Peers, World};
use contact_dynamics::ranks::Ranks;
use contact_dynamics::{Error, Result};
use std::ops::Range;
use std::sync::{Arc, Mutex};

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
    /// How many dofs each rank owns, and which, those of rank 0 first.
    counts: Counts,
    owners: Vec<usize>,
    /// The rank that owns each dof of the whole body.
    owner: Vec<usize>,
    buffers: Mutex<Buffers>,
    pub clock: Arc<Clock>,
}

#[derive(Debug, Default)]
struct Buffers {
    sent: Vec<f64>,
    received: Vec<f64>,
    own: Vec<f64>,
    all: Vec<f64>,
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
        let (dofs, owner, buffers, clock) = (owner.len(), owner.to_vec(), Mutex::default(), Arc::new(Clock::new()));
        Ok(Self { world, owned, known, dofs, peers, sent, received, counts, owners, owner, buffers, clock })
    }

    /// The columns that this rank owns, in its own numbers.
    pub fn own_dofs(&self) -> impl Iterator<Item = usize> + '_ {
        self.owned.iter().cloned().flatten()
    }

    /// The rows that this rank owns: their number, if those of each rank follow those of the ranks before it, for each
    /// dof that it knows.
    #[cfg(feature = "petsc")]
    pub fn consecutive(&self) -> Vec<usize> {
        let mut place = vec![0; self.dofs];
        self.owners.iter().enumerate().for_each(|(at, &dof)| place[dof] = at);
        self.of(&place)
    }

    /// Brings what all ranks own to rank 0, as a vector of the whole body; elsewhere `whole` is left empty.
    pub fn gather(&self, values: &[f64], whole: &mut Vec<f64>) -> Result<()> {
        let mut buffers = self.buffers.lock().unwrap();
        let Buffers { own, all, .. } = &mut *buffers;
        own.clear();
        own.extend(self.own_dofs().map(|dof| values[dof]));
        let is_root = self.world.rank == 0;
        all.resize(if is_root { self.dofs } else { 0 }, 0.0);
        let result = self.clock.sending(own.len(), || self.world.gather(own, &self.counts, all));
        whole.resize(all.len(), 0.0);
        if is_root {
            for (&dof, &value) in self.owners.iter().zip(all.iter()) {
                whole[dof] = value;
            }
        }
        result.map_err(|failed| host("gather", failed))
    }

    /// The way back: gives each rank what it owns.
    pub fn scatter(&self, whole: &[f64], values: &mut [f64]) -> Result<()> {
        let mut buffers = self.buffers.lock().unwrap();
        let Buffers { own, all, .. } = &mut *buffers;
        all.clear();
        all.extend(self.owners.iter().take(whole.len()).map(|&dof| whole[dof]));
        own.resize(self.own_dofs().count(), 0.0);
        let result = self.clock.sending(all.len(), || self.world.scatter(all, &self.counts, own));
        for (dof, &value) in self.own_dofs().zip(own.iter()) {
            values[dof] = value;
        }
        result.map_err(|failed| host("scatter", failed))
    }

    /// Gives all ranks the values of rank 0.
    pub fn broadcast(&self, values: &mut [f64]) -> Result<()> {
        let sent = if self.world.rank == 0 { values.len() } else { 0 };
        let result = self.clock.sending(sent, || self.world.broadcast(values));
        result.map_err(|failed| host("broadcast", failed))
    }

    /// What this rank knows of a vector of the whole body.
    pub fn of<V: Copy>(&self, whole: &[V]) -> Vec<V> {
        self.known.iter().map(|&dof| whole[dof]).collect()
    }

    /// The way to their owners of values that are elsewhere: `held` are the dofs whose values this rank has, in numbers
    /// of the whole body; each is held by one rank. All ranks call it.
    pub fn route(&self, held: &[usize]) -> Result<Route> {
        let world = self.world;
        let all = self.clock.sending(held.len(), || world.gather_indices(held));
        let mut route = Route::default();
        for (other, others) in all.map_err(|failed| host("route", failed))?.iter().enumerate() {
            let to: Vec<_> = (0..held.len()).filter(|&at| self.owner[held[at]] == other).collect();
            let from = others.iter().filter(|dof| self.owner[**dof] == world.rank);
            let from: Vec<_> = from.map(|dof| self.known.binary_search(dof).expect("an owned dof is known")).collect();
            if !to.is_empty() || !from.is_empty() {
                route.peers.push(other, to.len(), from.len());
                route.sent.extend(to);
                route.received.extend(from);
            }
        }
        Ok(route)
    }

    /// Takes a route: from columns of values that this rank holds to columns of a rank's vector.
    pub fn deliver(&self, route: &Route, held: &[f64], columns: usize, values: &mut [f64]) -> Result<()> {
        let [given, known] = [held.len(), values.len()].map(|size| size / columns.max(1));
        let mut buffers = self.buffers.lock().unwrap();
        let Buffers { sent, received, .. } = &mut *buffers;
        sent.clear();
        let mut from = 0;
        for [count, _] in route.peers.counts() {
            let places = &route.sent[from..from + count];
            sent.extend((0..columns).flat_map(|k| places.iter().map(move |&at| held[k * given + at])));
            from += count;
        }
        received.resize(columns * route.received.len(), 0.0);
        let peers = route.peers.times(columns);
        let result = self.clock.sending(sent.len(), || self.world.exchange(&peers, sent, received));
        let (mut to, mut got) = (0, received.iter());
        for [_, count] in route.peers.counts() {
            let dofs = &route.received[to..to + count];
            for k in 0..columns {
                dofs.iter().zip(&mut got).for_each(|(&dof, &value)| values[k * known + dof] = value);
            }
            to += count;
        }
        result.map_err(|failed| host("deliver", failed))
    }
}

/// What goes to whom of values that are not where their dofs are owned.
#[derive(Debug, Default)]
pub struct Route {
    peers: Peers,
    /// Places among the values held, for each rank in turn.
    sent: Vec<usize>,
    /// Dofs of this rank, by the rank that they come from.
    received: Vec<usize>,
}

impl Ranks<f64> for Share {
    fn rank(&self) -> usize {
        self.world.rank
    }

    fn owned(&self) -> &[Range<usize>] {
        &self.owned
    }

    fn sum(&self, values: &mut [f64]) -> Result<()> {
        let result = self.clock.sending(values.len(), || self.world.sum(values));
        result.map_err(|failed| host("sum", failed))
    }

    fn max(&self, values: &mut [f64]) -> Result<()> {
        let result = self.clock.sending(values.len(), || self.world.max(values));
        result.map_err(|failed| host("max", failed))
    }

    fn share(&self, values: &mut [f64]) -> Result<()> {
        let mut buffers = self.buffers.lock().unwrap();
        let Buffers { sent, received, .. } = &mut *buffers;
        sent.clear();
        sent.extend(self.sent.iter().map(|&dof| values[dof]));
        received.resize(self.received.len(), 0.0);
        let result = self.clock.sending(sent.len(), || self.world.exchange(&self.peers, sent, received));
        for (&dof, &value) in self.received.iter().zip(received.iter()) {
            values[dof] = value;
        }
        result.map_err(|failed| host("share", failed))
    }
}
