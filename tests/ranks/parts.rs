//! Ranks as threads that speak through shared memory, a body cut into the parts of ranks, and a linear solver over
//! them.

use contact_dynamics::faer::sparse::{
    SparseColMat, SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef, Triplet,
};
use contact_dynamics::ranks::Ranks;
use contact_dynamics::{
    Cholesky, Condensation, Error, Factorization, LinearSolver, Mass, PathForce, Result, System, TangentWeights,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::Solid;
use std::ops::Range;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

/// What threads meet at: each leaves numbers, and gets those of all.
#[derive(Debug)]
pub(crate) struct Meeting {
    size: usize,
    round: Mutex<Round>,
    turn: Condvar,
}

#[derive(Debug, Default)]
struct Round {
    number: u64,
    arrived: usize,
    parts: Vec<Vec<f64>>,
    met: Arc<Vec<Vec<f64>>>,
    /// Whether one has waited in vain.
    broken: bool,
}

/// Longer than this nobody waits.
const PATIENCE: Duration = Duration::from_secs(20);

impl Meeting {
    /// For so many ranks.
    pub(crate) fn new(size: usize) -> Arc<Self> {
        let round = Round { parts: vec![Vec::new(); size], ..Round::default() };
        Arc::new(Self { size, round: Mutex::new(round), turn: Condvar::new() })
    }

    /// Leaves numbers, waits for all, and returns those of all ranks.
    ///
    /// # Errors
    ///
    /// If another rank does not come.
    pub(crate) fn exchange(&self, rank: usize, own: Vec<f64>) -> Result<Arc<Vec<Vec<f64>>>> {
        let lost = || Error::Host { callback: "ranks", source: format!("rank {rank} waits in vain").into() };
        let mut round = self.round.lock().unwrap();
        if round.broken {
            return Err(lost());
        }
        round.parts[rank] = own;
        round.arrived += 1;
        if round.arrived == self.size {
            let next = vec![Vec::new(); self.size];
            round.met = Arc::new(std::mem::replace(&mut round.parts, next));
            round.arrived = 0;
            round.number += 1;
            self.turn.notify_all();
            return Ok(round.met.clone());
        }
        let number = round.number;
        let waits = |round: &mut Round| round.number == number && !round.broken;
        let (mut round, result) = self.turn.wait_timeout_while(round, PATIENCE, waits).unwrap();
        if round.broken || result.timed_out() {
            round.broken = true;
            self.turn.notify_all();
            return Err(lost());
        }
        Ok(round.met.clone())
    }
}

/// What one rank has of the dofs of a body.
#[derive(Debug)]
pub(crate) struct Part {
    meeting: Arc<Meeting>,
    rank: usize,
    owned: Vec<Range<usize>>,
    /// The number in the whole body of each dof of this rank, ascending.
    pub(crate) whole: Vec<usize>,
    /// The dofs that each rank owns, in numbers of the whole body.
    owners: Arc<Vec<Vec<usize>>>,
    dofs: usize,
}

impl Part {
    /// The part of `rank` of a body of `dofs` dofs; `owner` says whose each dof is, `known` (ascending) which this rank
    /// knows.
    pub(crate) fn new(meeting: &Arc<Meeting>, rank: usize, owner: &[usize], known: Vec<usize>) -> Arc<Self> {
        assert!(known.is_sorted());
        Self::renumbered(meeting, rank, owner, known)
    }

    /// The same with the dofs of the rank in any order.
    pub(crate) fn renumbered(meeting: &Arc<Meeting>, rank: usize, owner: &[usize], known: Vec<usize>) -> Arc<Self> {
        let of_rank = |r: usize| (0..owner.len()).filter(|&dof| owner[dof] == r).collect();
        let owners = Arc::new((0..meeting.size).map(of_rank).collect());
        let mut owned: Vec<Range<usize>> = Vec::new();
        for (dof, _) in known.iter().enumerate().filter(|(_, whole)| owner[**whole] == rank) {
            match owned.last_mut().filter(|range| range.end == dof) {
                Some(range) => range.end += 1,
                None => owned.push(dof..dof + 1),
            }
        }
        Arc::new(Self { meeting: meeting.clone(), rank, owned, whole: known, owners, dofs: owner.len() })
    }

    fn own(&self, values: &[f64]) -> Vec<f64> {
        self.owned.iter().flat_map(|range| &values[range.clone()]).copied().collect()
    }

    /// The whole vector, of which each rank gives what it owns.
    ///
    /// # Errors
    ///
    /// As [`Meeting::exchange`].
    pub(crate) fn gather(&self, values: &[f64]) -> Result<Vec<f64>> {
        let parts = self.meeting.exchange(self.rank, self.own(values))?;
        let mut whole = vec![f64::NAN; self.dofs];
        for (dofs, values) in self.owners.iter().zip(parts.iter()) {
            assert_eq!(dofs.len(), values.len(), "ranks ask for different things");
            for (&dof, &value) in dofs.iter().zip(values) {
                whole[dof] = value;
            }
        }
        Ok(whole)
    }

    /// What this rank knows of a vector of the whole body.
    pub(crate) fn of(&self, whole: &[f64]) -> Vec<f64> {
        self.whole.iter().map(|&dof| whole[dof]).collect()
    }

    fn reduce(&self, values: &mut [f64], with: fn(f64, f64) -> f64) -> Result<()> {
        let parts = self.meeting.exchange(self.rank, values.to_vec())?;
        for (rank, part) in parts.iter().enumerate() {
            assert_eq!(part.len(), values.len(), "ranks ask for different things");
            for (value, &other) in values.iter_mut().zip(part) {
                *value = if rank == 0 { other } else { with(*value, other) };
            }
        }
        Ok(())
    }
}

impl Ranks<f64> for Part {
    fn rank(&self) -> usize {
        self.rank
    }

    fn owned(&self) -> &[Range<usize>] {
        &self.owned
    }

    fn sum(&self, values: &mut [f64]) -> Result<()> {
        self.reduce(values, |a, b| a + b)
    }

    fn max(&self, values: &mut [f64]) -> Result<()> {
        self.reduce(values, f64::max)
    }

    fn share(&self, values: &mut [f64]) -> Result<()> {
        let whole = self.gather(values)?;
        values.copy_from_slice(&self.of(&whole));
        Ok(())
    }
}

/// Runs the same on so many ranks, each in a thread of its own; what they return, by rank.
pub(crate) fn on_ranks<R: Send>(count: usize, run: impl Fn(usize, &Arc<Meeting>) -> R + Sync) -> Vec<R> {
    let meeting = Meeting::new(count);
    let (run, meeting) = (&run, &meeting);
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..count).map(|rank| scope.spawn(move || run(rank, meeting))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}

/// What one rank has of a solid: the elements that touch its nodes, over all nodes that it knows.
#[derive(Clone, Debug)]
pub(crate) struct Cut<const D: usize> {
    pub(crate) solid: Solid<D>,
    /// The elements that this rank counts in sums over elements: those whose first node it owns.
    pub(crate) counted: Solid<D>,
    /// The number in the whole body of each node of this rank, ascending.
    pub(crate) nodes: Vec<usize>,
    /// The rank that owns each dof of the whole body.
    pub(crate) owners: Vec<usize>,
}

impl<const D: usize> Cut<D> {
    /// The part of a rank of a solid cut into slabs of consecutive nodes; `contact` are the nodes that contact may act
    /// on, which all ranks know.
    pub(crate) fn new(whole: &Solid<D>, contact: &[usize], rank: usize, size: usize) -> Self {
        let count = whole.nodes.len();
        let owners: Vec<usize> = (0..count).map(|node| (node * size) / count).collect();
        Self::by_owners(whole, contact, rank, &owners)
    }

    /// The part of a rank of a solid whose nodes belong to these ranks.
    pub(crate) fn by_owners(whole: &Solid<D>, contact: &[usize], rank: usize, owners: &[usize]) -> Self {
        let count = whole.nodes.len();
        let owner = |node: usize| owners[node];
        let touches = |element: &&Vec<usize>| element.iter().any(|&node| owner(node) == rank);
        let elements: Vec<_> = whole.elements.iter().filter(touches).collect();
        let mut nodes: Vec<usize> = elements.iter().flat_map(|element| element.iter()).copied().collect();
        nodes.extend(contact);
        nodes.extend((0..count).filter(|&node| owner(node) == rank));
        nodes.sort_unstable();
        nodes.dedup();
        let local = |node: &usize| nodes.binary_search(node).unwrap();
        let renumbered = |element: &Vec<usize>| element.iter().map(local).collect();
        let of = |elements: Vec<Vec<usize>>| Solid {
            nodes: nodes.iter().map(|&node| whole.nodes[node]).collect(),
            elements,
            material: whole.material,
        };
        let solid = of(elements.iter().map(|element| renumbered(element)).collect());
        let first = |element: &&&Vec<usize>| owner(element[0]) == rank;
        let counted = of(elements.iter().filter(first).map(|element| renumbered(element)).collect());
        Self { solid, counted, owners: (0..count).flat_map(|node| [owner(node); D]).collect(), nodes }
    }

    /// The number in the whole body of each dof of this rank.
    pub(crate) fn known(&self) -> Vec<usize> {
        self.nodes.iter().flat_map(|&node| (0..D).map(move |axis| D * node + axis)).collect()
    }

    /// The number of a node of the whole body on this rank, if it knows it.
    pub(crate) fn local(&self, node: usize) -> Option<usize> {
        self.nodes.binary_search(&node).ok()
    }
}

/// The part of a rank that is a thread.
#[derive(Debug)]
pub(crate) struct SolidPart<const D: usize> {
    pub(crate) cut: Cut<D>,
    pub(crate) part: Arc<Part>,
}

impl<const D: usize> SolidPart<D> {
    /// As [`Cut::new`].
    pub(crate) fn new(whole: &Solid<D>, contact: &[usize], rank: usize, meeting: &Arc<Meeting>) -> Self {
        let cut = Cut::new(whole, contact, rank, meeting.size);
        let part = Part::new(meeting, rank, &cut.owners, cut.known());
        Self { cut, part }
    }
}

/// What one rank has of a body at large strains.
#[derive(Clone, Debug)]
pub(crate) struct HyperelasticPart<const D: usize> {
    body: Hyperelastic<D>,
    /// The elements that this rank counts.
    counted: Hyperelastic<D>,
    ranks: Arc<dyn Ranks<f64>>,
}

impl<const D: usize> HyperelasticPart<D> {
    /// Of this part of a solid.
    pub(crate) fn new(cut: &Cut<D>, ranks: Arc<dyn Ranks<f64>>, law: Law) -> Self {
        let [body, counted] = [&cut.solid, &cut.counted].map(|solid| Hyperelastic::new(solid, law));
        Self { body, counted, ranks }
    }
}

impl<const D: usize> System<f64> for HyperelasticPart<D> {
    fn dofs(&self) -> usize {
        self.body.dofs()
    }
    fn mass(&self) -> Mass<'_, f64> {
        self.body.mass()
    }
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        self.body.force(t, u, v, out)
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.body.pattern()
    }
    fn tangent(&mut self, t: f64, u: &[f64], v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        self.body.tangent(t, u, v, w, out)
    }
    fn path_force(&mut self) -> Option<&mut dyn PathForce<f64>> {
        self.body.path_force()
    }
    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        self.counted.potential_energy(u)
    }
    fn external_load(&mut self, t: f64, out: &mut [f64]) -> Result<()> {
        self.body.external_load(t, out)
    }
    fn ranks(&self) -> Option<Arc<dyn Ranks<f64>>> {
        Some(self.ranks.clone())
    }
}

/// A direct solver over ranks: all of them gather the whole matrix and factorize it alike. (Not for large bodies.)
#[derive(Clone, Debug)]
pub(crate) struct Gathered(pub Arc<Part>);

#[derive(Debug)]
struct GatheredFactor {
    part: Arc<Part>,
    factor: Box<dyn Factorization<f64>>,
    pattern: SymbolicSparseColMat<usize>,
}

impl Part {
    /// The whole of a matrix, of which each rank gives the columns that it owns (rows and columns are alike).
    fn gather_matrix(&self, a: SparseColMatRef<'_, usize, f64>) -> Result<SparseColMat<usize, f64>> {
        let mut own = Vec::new();
        for j in self.owned.iter().cloned().flatten() {
            for (&i, &value) in a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)) {
                own.extend([self.whole[i] as f64, self.whole[j] as f64, value]);
            }
        }
        let parts = self.meeting.exchange(self.rank, own)?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "dofs as numbers")]
        let entry = |entry: &[f64]| Triplet::new(entry[0] as usize, entry[1] as usize, entry[2]);
        let entries: Vec<_> = parts.iter().flat_map(|part| part.chunks_exact(3).map(entry)).collect();
        Ok(SparseColMat::try_new_from_triplets(self.dofs, self.dofs, &entries).unwrap())
    }
}

impl LinearSolver<f64> for Gathered {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<f64>>> {
        let ones = vec![1.0; pattern.row_idx().len()];
        let whole = self.0.gather_matrix(SparseColMatRef::new(pattern, &ones))?;
        let last: Vec<usize> = last.iter().map(|&dof| self.0.whole[dof]).collect();
        let factor = Cholesky::default().analyze(whole.symbolic(), &last)?;
        let pattern = whole.symbolic().to_owned().unwrap();
        Ok(Box::new(GatheredFactor { part: self.0.clone(), factor, pattern }))
    }

    fn spans_ranks(&self) -> bool {
        true
    }
}

impl Factorization<f64> for GatheredFactor {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<()> {
        let whole = self.part.gather_matrix(a)?;
        assert_eq!(whole.row_idx(), self.pattern.row_idx());
        self.factor.factorize(whole.as_ref())
    }

    fn solve(&mut self, rhs: &mut [f64]) -> Result<()> {
        for column in rhs.chunks_exact_mut(self.part.whole.len()) {
            let mut whole = self.part.gather(column)?;
            self.factor.solve(&mut whole)?;
            column.copy_from_slice(&self.part.of(&whole));
        }
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.factor.stored_values()
    }

    fn is_symmetric(&self) -> bool {
        true
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<f64>> {
        self.factor.condensation().is_some().then_some(self)
    }
}

impl Condensation<f64> for GatheredFactor {
    fn condense(&mut self, rhs: &[f64], interface: &mut [f64]) -> Result<()> {
        let whole = self.part.gather(rhs)?;
        self.factor.condensation().unwrap().condense(&whole, interface)
    }

    fn expand(&mut self, interface: &[f64], solution: &mut [f64]) -> Result<()> {
        let mut whole = vec![0.0; self.part.dofs];
        self.factor.condensation().unwrap().expand(interface, &mut whole)?;
        solution.copy_from_slice(&self.part.of(&whole));
        Ok(())
    }

    fn solve(&mut self, forces: &mut [f64]) -> Result<()> {
        self.factor.condensation().unwrap().solve(forces)
    }
}
