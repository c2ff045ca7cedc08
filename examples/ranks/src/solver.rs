//! MUMPS as the linear solver of a run: the matrix on rank 0 or on all ranks, with the Schur complement of the contact
//! dofs or without. Where the matrix is on all ranks so are right-hand sides and solutions: what passes through rank 0
//! is the interface alone.

use crate::faults::Fault;
use crate::ffi::{Counts, Failed, Input, Mumps};
use crate::share::{Route, Share};
use contact_dynamics::faer::linalg::solvers::{Llt, Solve};
use contact_dynamics::faer::mat::MatMut;
use contact_dynamics::faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use contact_dynamics::faer::{Mat, Side};
use contact_dynamics::ranks::Ranks;
use contact_dynamics::{Condensation, Error, Factorization, LinearSolver, Result};
use std::sync::Arc;

/// Where MUMPS gets the matrix, and whether it condenses on the contact dofs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Way {
    pub input: Input,
    pub condenses: bool,
}

/// The solver of a body over ranks.
#[derive(Clone, Debug)]
pub struct Direct {
    pub share: Arc<Share>,
    pub way: Way,
    /// What fails on this rank.
    pub fault: Option<Fault>,
}

/// Of a symmetric matrix: MUMPS wants one triangle of it, all entries once.
#[derive(Debug)]
struct Factor {
    share: Arc<Share>,
    way: Way,
    mumps: Mumps,
    /// The contact dofs, in the numbers of this rank.
    last: Vec<usize>,
    /// A vector of the whole body, on rank 0.
    whole: Vec<f64>,
    /// Right-hand sides of the rows of this rank, and solutions of the pivots that it has eliminated.
    own: Vec<f64>,
    solved: Vec<f64>,
    /// The dofs of these pivots and the way from them to their owners; whether it is that of this factorization.
    route: (Vec<usize>, Route),
    routed: bool,
    /// The entries of all ranks, on rank 0, if the matrix is there: how many of each.
    counts: Option<Counts>,
    entries: Vec<f64>,
    /// The Schur complement, factorized on every rank alike.
    complement: Option<Llt<f64>>,
    fault: Option<Fault>,
    solves: usize,
}

fn failed(what: &'static str) -> impl Fn(Failed) -> Error {
    move |failed| match failed {
        // INFOG(1) of MUMPS: memory that cannot be had.
        Failed(-5 | -7 | -8 | -9 | -13 | -19, _) => Error::OutOfMemory { what: "the factor of MUMPS", bytes: None },
        Failed(-10, _) => Error::Singular { matrix: "effective matrix", dof: 0 },
        other => Error::Host { callback: what, source: other.into() },
    }
}

impl Direct {
    /// The entries of the lower triangle in the columns that this rank owns: (row, column) of the whole body.
    fn entries<'a>(share: &'a Share, pattern: SymbolicSparseColMatRef<'a, usize>) -> impl Iterator<Item = [usize; 2]> {
        share.own_dofs().flat_map(move |j| {
            let rows = pattern.row_idx_of_col_raw(j).iter().map(move |&i| [share.known[i], share.known[j]]);
            rows.filter(|[row, column]| row >= column)
        })
    }
}

impl LinearSolver<f64> for Direct {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<f64>>> {
        let Self { share, way, fault } = self;
        let own: Vec<[usize; 2]> = Self::entries(share, pattern).collect();
        let schur: Vec<usize> = if way.condenses { last.iter().map(|&dof| share.known[dof]).collect() } else { vec![] };
        let flat: Vec<usize> = own.iter().flatten().copied().collect();
        let (entries, counts) = match way.input {
            Input::Distributed => (own, None),
            Input::Root => {
                let all = share.world.gather_indices(&flat).map_err(failed("gather"))?;
                let counts = Counts::new(all.iter().map(|part| part.len() / 2));
                let pairs = all.iter().flatten().copied().collect::<Vec<_>>();
                let pairs = if share.world.rank == 0 { pairs } else { Vec::new() };
                (pairs.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect(), Some(counts))
            }
        };
        let entries = entries.iter().map(|&[row, column]| (row, column));
        let mut mumps =
            Mumps::analyze(share.world, share.dofs, entries, way.input, &schur).map_err(failed("analyze"))?;
        if *fault == Some(Fault::Memory) {
            mumps.limit_memory(1);
        }
        mumps.give(share.own_dofs().map(|dof| share.known[dof]));
        let whole = vec![0.0; if share.world.rank == 0 { share.dofs } else { 0 }];
        Ok(Box::new(Factor {
            share: share.clone(),
            way: *way,
            mumps,
            last: last.to_vec(),
            whole,
            own: Vec::new(),
            solved: Vec::new(),
            route: Default::default(),
            routed: false,
            counts,
            entries: Vec::new(),
            complement: None,
            fault: *fault,
            solves: 0,
        }))
    }

    fn spans_ranks(&self) -> bool {
        true
    }
}

impl Factorization<f64> for Factor {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<()> {
        let share = self.share.clone();
        self.routed = false;
        let own: Vec<f64> = share
            .own_dofs()
            .flat_map(|j| {
                let entries = a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j));
                let known = &share.known;
                entries.filter(move |(i, _)| known[**i] >= known[j]).map(|(_, value)| *value)
            })
            .collect();
        let negative = match &self.counts {
            None => self.mumps.factorize(own.into_iter()),
            Some(counts) => {
                self.entries.resize(self.mumps.entries(), 0.0);
                share.world.gather(&own, counts, &mut self.entries).map_err(failed("gather"))?;
                self.mumps.factorize(self.entries.iter().copied())
            }
        };
        if negative.map_err(failed("factorize"))? > 0 {
            return Err(Error::Singular { matrix: "effective matrix", dof: 0 });
        }
        if self.way.condenses {
            let n = self.last.len();
            let mut complement = vec![0.0; n * n];
            if share.world.rank == 0 {
                self.mumps.schur(&mut complement);
            }
            share.broadcast(&mut complement)?;
            let lower = Mat::from_fn(n, n, |i, j| complement[n * i.max(j) + i.min(j)]);
            let factor = Llt::new(lower.as_ref(), Side::Lower);
            self.complement =
                Some(factor.map_err(|_| Error::Singular { matrix: "effective matrix", dof: self.last[0] })?);
        }
        Ok(())
    }

    fn solve(&mut self, rhs: &mut [f64]) -> Result<()> {
        let known = self.share.known.len();
        if self.way.input == Input::Distributed {
            self.take_own(rhs);
            let columns = rhs.len() / known;
            self.mumps.solve_distributed(&mut self.own, columns, &mut self.solved).map_err(failed("solve"))?;
            return self.deliver(columns, rhs);
        }
        let Self { share, whole, mumps, .. } = self;
        for column in rhs.chunks_exact_mut(known) {
            share.gather(column, whole)?;
            mumps.solve(whole, 1).map_err(failed("solve"))?;
            share.scatter(whole, column)?;
        }
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.mumps.stored(self.complement.is_some())
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<f64>> {
        self.way.condenses.then_some(self)
    }
}

impl Condensation<f64> for Factor {
    fn condense(&mut self, rhs: &[f64], interface: &mut [f64]) -> Result<()> {
        let reduced = match self.way.input {
            Input::Distributed => {
                self.take_own(rhs);
                self.mumps.reduce_distributed(&mut self.own, interface)
            }
            Input::Root => {
                self.share.gather(rhs, &mut self.whole)?;
                self.mumps.reduce(&mut self.whole, interface)
            }
        };
        reduced.map_err(failed("condense"))?;
        self.share.broadcast(interface)?;
        self.solves += 1;
        if self.fault == Some(Fault::Solve) && self.solves == 20 {
            return Err(Error::Host { callback: "condense", source: "a bit has flipped on this rank".into() });
        }
        self.solve_complement(interface)
    }

    fn expand(&mut self, interface: &[f64], solution: &mut [f64]) -> Result<()> {
        let mut given = interface.to_vec();
        if self.way.input == Input::Distributed {
            self.mumps.complete_distributed(&mut given, &mut self.whole, &mut self.solved).map_err(failed("expand"))?;
            self.deliver(1, solution)?;
        } else {
            let Self { share, whole, mumps, .. } = self;
            mumps.complete(&mut given, whole).map_err(failed("expand"))?;
            share.scatter(whole, solution)?;
        }
        for (&dof, &value) in self.last.iter().zip(interface) {
            solution[dof] = value;
        }
        Ok(())
    }

    fn solve(&mut self, forces: &mut [f64]) -> Result<()> {
        self.solve_complement(forces)
    }
}

impl Factor {
    /// The rows that this rank owns of columns of vectors.
    fn take_own(&mut self, columns: &[f64]) {
        let Self { share, own, .. } = self;
        own.clear();
        let columns = columns.chunks_exact(share.known.len());
        own.extend(columns.flat_map(|column| share.own_dofs().map(|dof| column[dof])));
    }

    /// Brings columns of solutions from where they were computed to the owners of their rows.
    fn deliver(&mut self, columns: usize, solution: &mut [f64]) -> Result<()> {
        let Self { share, mumps, solved, route, .. } = self;
        if !self.routed {
            // Another factorization has other pivots on a rank only where some were delayed.
            let mut moved = [f64::from(u8::from(!mumps.solved().eq(route.0.iter().copied())))];
            share.max(&mut moved)?;
            if moved[0] > 0.0 {
                let held: Vec<_> = mumps.solved().collect();
                *route = (held.clone(), share.route(&held)?);
            }
            self.routed = true;
        }
        share.deliver(&route.1, solved, columns, solution)
    }

    /// `f ← S⁻¹ f` for columns of forces on the interface, on every rank alike.
    fn solve_complement(&self, forces: &mut [f64]) -> Result<()> {
        let n = self.last.len();
        let Some(factor) = &self.complement else {
            return Err(Error::Host { callback: "condense", source: "nothing has been factorized".into() });
        };
        let columns = forces.len() / n.max(1);
        factor.solve_in_place(MatMut::from_column_major_slice_mut(forces, n, columns));
        Ok(())
    }
}
