//! The contact problem of S = G M⁻¹ Gᵀ in total multipliers: the jumps already contain a part of them.

use super::JumpProjection;
use super::many_jumps::ManyJumps;
use crate::contact::{ContactId, ContactJacobian};
use crate::contact_solver::{
    AdmissibleSet, ContactFailure, ContactProblem, ContactSolver, FORESEEN, contact_error, no_response,
};
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{half_digits, rounding, share_of_rounding};

/// A contact of the problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block<T> {
    /// The row of its gap, or of a single equation.
    pub(crate) row: usize,
    /// Number of its tangential rows, which follow the row of the gap.
    pub(crate) tangents: usize,
    pub(crate) set: AdmissibleSet,
    /// Friction per unit normal multiplier if its direction is given, that is, if the contact slides.
    pub(crate) direction: Option<[T; 2]>,
    /// Addition to the diagonal of S in the row of the gap.
    pub(crate) compliance: T,
    /// The normal multiplier if it is known; its effect is then contained in the jumps.
    pub(crate) known: Option<T>,
    /// Start of its rows in the lists of the problem, set by `add_block`.
    pub(crate) place: usize,
}

impl<T: Real> Block<T> {
    /// A contact with so many tangential rows.
    pub(crate) fn new(row: usize, tangents: usize, set: AdmissibleSet) -> Self {
        Self { row, tangents, set, direction: None, compliance: T::zero(), known: None, place: 0 }
    }

    /// Whether it is a single equation, whose multiplier may have any sign and size.
    fn is_equation(&self) -> bool {
        let Self { tangents, set, direction, compliance, known, .. } = *self;
        tangents == 0 && set == AdmissibleSet::Free && direction.is_none() && compliance == T::zero() && known.is_none()
    }

    /// The range of its rows in the lists of the problem.
    pub(super) fn places(&self) -> std::ops::Range<usize> {
        self.place..self.place + 1 + self.tangents
    }
}

/// The problem and its memory: blocks, and lists with one entry per row, block after block.
#[derive(Debug, Default)]
pub(crate) struct JumpProblem<T> {
    pub(super) blocks: Vec<Block<T>>,
    /// The rows, and the block of each.
    pub(crate) rows: Vec<usize>,
    pub(super) owners: Vec<usize>,
    /// G x of these rows minus the required rates, and its rounding error.
    pub(super) jump: Vec<T>,
    pub(super) tolerance: Vec<T>,
    /// The multipliers that the jumps already contain.
    pub(super) base: Vec<T>,
    /// The total multipliers, and their increments over `base`.
    pub(crate) totals: Vec<T>,
    pub(super) increments: Vec<T>,
    /// The remaining jumps, and their rounding errors.
    pub(super) left: Vec<T>,
    pub(super) noise: Vec<T>,
    /// (row of the gap, unit vector of its friction) of the contacts of an earlier problem.
    directions: Vec<(usize, [T; 2])>,
    group: Group<T>,
    /// None until a large group is solved.
    pub(super) many: Option<Box<ManyJumps<T>>>,
}

/// How the friction of sliding contacts enters a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Friction {
    /// Proportional to the unknown normal multiplier.
    Follows,
    /// Fixed at its value in the totals; also used if nothing slides.
    Lags,
}

/// Rows that S couples, as a problem for a contact solver.
#[derive(Debug, Default)]
struct Group<T> {
    rows: Vec<usize>,
    s: Vec<T>,
    /// The unknowns: the position of each one's row in the group. A sliding contact has one, its normal multiplier.
    unknowns: Vec<usize>,
    delassus: Vec<T>,
    offset: Vec<T>,
    sets: Vec<AdmissibleSet>,
    tolerance: Vec<T>,
    multipliers: Vec<T>,
    factor: DenseCholesky<T>,
    /// Rows that the factor has memory for.
    reserved: usize,
}

type Solved<T> = std::result::Result<(), ContactFailure<T>>;

impl<T: Real> JumpProblem<T> {
    /// Reserves memory for this many rows, and for groups of up to `FORESEEN` of them.
    pub(super) fn make_room(&mut self, rows: usize) {
        let Self { blocks, rows: own, owners, jump, tolerance, base, totals, increments, left, noise, group, .. } =
            self;
        blocks.reserve(rows.saturating_sub(blocks.len()));
        for list in [own, owners] {
            list.reserve(rows.saturating_sub(list.len()));
        }
        for values in [jump, tolerance, base, totals, increments, left, noise] {
            values.reserve(rows.saturating_sub(values.len()));
        }
        group.make_room(rows.min(FORESEEN));
    }

    /// Removes all blocks.
    pub(crate) fn clear(&mut self) {
        let Self { blocks, rows, owners, jump, tolerance, base, totals, increments, left, noise, .. } = self;
        blocks.clear();
        rows.clear();
        owners.clear();
        for values in [jump, tolerance, base, totals, increments, left, noise] {
            values.clear();
        }
    }

    /// Appends a contact. Its rows must be [appended](Self::add_row) next: first the normal row, then the tangential
    /// ones.
    pub(crate) fn add_block(&mut self, block: &Block<T>) {
        self.blocks.push(Block { place: self.rows.len(), ..*block });
    }

    /// Appends a row: its jump, the rounding error of the jump, and the multiplier that the jump contains.
    pub(crate) fn add_row(&mut self, row: usize, jump: T, tolerance: T, base: T) {
        self.rows.push(row);
        self.owners.push(self.blocks.len().saturating_sub(1));
        self.jump.push(jump);
        self.tolerance.push(tolerance);
        self.base.push(base);
    }

    /// Stores the directions of the friction found. A sliding contact without friction, whose normal multiplier would
    /// pull, may press again in the next problem: its friction is then opposed to the slip.
    pub(super) fn keep_directions(&mut self) {
        let Self { blocks, totals, left, noise, directions, .. } = self;
        directions.clear();
        for block in blocks.iter().filter(|block| block.tangents > 0) {
            let unit_of = |values: &[T], noise: T| {
                let mut direction = [T::zero(); 2];
                direction[..block.tangents].copy_from_slice(&values[block.places()][1..]);
                let size = direction[0].hypot(direction[1]);
                (size > noise).then(|| direction.map(|x| x / size))
            };
            let noise = T::largest(&noise[block.places()][1..]);
            let against_slip = || unit_of(left, noise).map(|along| along.map(|x| -x));
            let unit = unit_of(totals, T::zero()).or_else(against_slip).unwrap_or([T::zero(); 2]);
            directions.push((block.row, unit));
        }
    }

    /// The stored direction of a contact; zero if it was not in the earlier problem. Rows ascend.
    pub(super) fn direction(&self, row: usize) -> [T; 2] {
        match self.directions.binary_search_by_key(&row, |&(row, _)| row) {
            Ok(place) => self.directions[place].1,
            Err(_) => [T::zero(); 2],
        }
    }

    /// Finds the totals group by group; S couples no two groups. Multipliers press if they have the sign of
    /// `presses`. `id` gives the contact of a row for an error at time t.
    pub(crate) fn solve(
        &mut self,
        (g, projection): (&ContactJacobian<T>, &mut JumpProjection<T>),
        solver: &mut dyn ContactSolver<T>,
        presses: T,
        (t, id): (f64, impl Fn(usize) -> ContactId),
    ) -> Result<()> {
        for values in [&mut self.totals, &mut self.left, &mut self.noise] {
            values.clear();
            values.resize(self.rows.len(), T::zero());
        }
        // Contacts that stick and slide in turn would leave no factor of S to keep.
        let has_friction = self.rows.iter().any(|&row| g.is_tangential(row));
        let least = solver.assembly().least();
        let is_large = self.rows.len() >= least
            && projection.lumped().is_some()
            && projection.largest_group(g, &self.rows) >= least;
        if !has_friction && !is_large && self.blocks.iter().all(Block::is_equation) {
            return self.solve_equations(g, projection, |row| no_response(t, id(row)));
        }
        if !is_large {
            projection.sort(g, &self.rows);
        }
        let mut group = std::mem::take(&mut self.group);
        let result = (0..projection.groups().len()).try_for_each(|number| {
            if is_large && self.solve_without_s((g, projection), (number, least), presses)? {
                return Ok(());
            }
            self.solve_with_s((g, projection), (number, &mut group), solver, presses, (t, &id))
        });
        self.group = group;
        self.increments.clear();
        self.increments.extend(self.totals.iter().zip(&self.base).map(|(&total, &base)| total - base));
        result
    }

    /// Forms S of a group, and solves.
    fn solve_with_s(
        &mut self,
        (g, projection): (&ContactJacobian<T>, &mut JumpProjection<T>),
        (number, group): (usize, &mut Group<T>),
        solver: &mut dyn ContactSolver<T>,
        presses: T,
        (t, id): (f64, &impl Fn(usize) -> ContactId),
    ) -> Result<()> {
        // Positions of a group ascend, and a block is in one group.
        group.rows.clear();
        group.rows.extend(projection.groups().group(number).iter().map(|&position| self.rows[position]));
        projection.assemble(g, &group.rows, &mut group.s)?;
        let positions = projection.groups().group(number);
        self.solve_group(positions, group, solver, presses).map_err(|failure| {
            let owner = |unknown: usize| self.owners[positions[group.unknowns[unknown]]];
            contact_error(t, failure, |unknown| id(self.blocks[owner(unknown)].row))
        })
    }

    /// Solves equations alone. The projection keeps its factor of S while their rows stay the same.
    fn solve_equations(
        &mut self,
        g: &ContactJacobian<T>,
        projection: &mut JumpProjection<T>,
        refuse: impl Fn(usize) -> Error,
    ) -> Result<()> {
        projection.close_rows(g, &self.rows, refuse)?;
        self.increments.clear();
        self.increments.extend(self.jump.iter().map(|&jump| -jump));
        projection.solve(&mut self.increments);
        for ((total, &base), &increment) in self.totals.iter_mut().zip(&self.base).zip(&self.increments) {
            *total = base + increment;
        }
        Ok(())
    }

    /// Solves for the rows at these positions. A sliding contact whose multiplier would pull gets no friction, and
    /// the problem is solved again.
    fn solve_group(
        &mut self,
        positions: &[usize],
        group: &mut Group<T>,
        solver: &mut dyn ContactSolver<T>,
        presses: T,
    ) -> Solved<T> {
        loop {
            let follows = positions.iter().any(|&position| self.blocks[self.owners[position]].direction.is_some());
            let friction = if follows { Friction::Follows } else { Friction::Lags };
            group.pose(self, positions, friction);
            if let Err(failure) = group.solve(solver, friction) {
                return match group.jammed(self, positions) {
                    Some(jammed) => Err(jammed),
                    None if follows => self.solve_lagging(positions, group, solver, presses).map_err(|_| failure),
                    None => Err(failure),
                };
            }
            let mut again = false;
            for (&at, &multiplier) in group.unknowns.iter().zip(&group.multipliers) {
                let position = positions[at];
                let block = &mut self.blocks[self.owners[position]];
                self.totals[position] = multiplier;
                let Some(direction) = block.direction else { continue };
                for (k, along) in direction.into_iter().enumerate().take(block.tangents) {
                    self.totals[position + 1 + k] = along * multiplier;
                }
                if presses * multiplier < T::zero() && direction != [T::zero(); 2] {
                    (block.direction, again) = (Some([T::zero(); 2]), true);
                }
            }
            if !again {
                break;
            }
        }
        self.keep_in_cones(positions, presses);
        self.measure(positions, group);
        Ok(())
    }

    /// Scales friction back into its cone if it was accepted outside as rounding. Next to much heavier bodies this
    /// rounding far exceeds the rounding of the local contact forces.
    pub(super) fn keep_in_cones(&mut self, positions: &[usize], presses: T) {
        for &position in positions {
            let block = self.blocks[self.owners[position]];
            let is_found = block.place == position && block.direction.is_none() && block.known.is_none();
            let Some(friction) = block.set.friction().filter(|_| is_found) else { continue };
            let bound = T::of(friction) * (presses * self.totals[position]).max(T::zero());
            let tangential = &mut self.totals[position + 1..=position + block.tangents];
            let size = tangential.iter().fold(T::zero(), |size, &f| size.hypot(f));
            if size > (T::one() + half_digits::<T>()) * bound {
                for f in tangential {
                    *f *= bound / size;
                }
            }
        }
    }

    /// Solves by iteration with lagged friction if the equations with following friction have no solution because a
    /// sliding contact would pull. Each iteration fixes the friction of sliding contacts and solves for the others.
    fn solve_lagging(
        &mut self,
        positions: &[usize],
        group: &mut Group<T>,
        solver: &mut dyn ContactSolver<T>,
        presses: T,
    ) -> Solved<T> {
        /// Largest number of iterations, each relaxed by one half. The error after the last one is accepted: the
        /// reported friction is in its cone, and the remaining jump is a jump of accelerations.
        const PASSES: usize = 60;
        /// Growth of the change per iteration that counts as divergence. It may occur with nearly equal rows, of
        /// which one pulls while the other presses. Sliding contacts then get no friction.
        const DIVERGES: f64 = 1e2;
        let half = T::of(0.5);
        for &position in positions {
            self.totals[position] = T::zero();
        }
        let (mut least, mut diverges) = (T::infinity(), false);
        for _ in 0..PASSES {
            group.pose(self, positions, Friction::Lags);
            group.solve(solver, Friction::Lags)?;
            let (mut change, mut largest) = (T::zero(), T::zero());
            for (&at, &multiplier) in group.unknowns.iter().zip(&group.multipliers) {
                let position = positions[at];
                let block = &self.blocks[self.owners[position]];
                self.totals[position] = multiplier;
                for (k, along) in block.direction.into_iter().flatten().enumerate().take(block.tangents) {
                    let pressing = presses * (presses * multiplier).max(T::zero());
                    let friction = &mut self.totals[position + 1 + k];
                    let moved = half * (along * pressing - *friction);
                    *friction += moved;
                    (change, largest) = (change.max(moved.abs()), largest.max(friction.abs()));
                }
            }
            if change <= share_of_rounding::<T>() * largest {
                break;
            }
            least = least.min(change);
            diverges = change > T::of(DIVERGES) * least || !change.is_finite();
            if diverges {
                break;
            }
        }
        if diverges {
            for &position in positions {
                self.totals[position] = T::zero();
            }
            group.pose(self, positions, Friction::Lags);
            group.solve(solver, Friction::Lags)?;
            for (&at, &multiplier) in group.unknowns.iter().zip(&group.multipliers) {
                self.totals[positions[at]] = multiplier;
            }
            self.measure(positions, group);
            return Ok(());
        }
        for &at in &group.unknowns {
            let (position, block) = (positions[at], &self.blocks[self.owners[positions[at]]]);
            let pressing = presses * (presses * self.totals[position]).max(T::zero());
            for (k, along) in block.direction.into_iter().flatten().enumerate().take(block.tangents) {
                self.totals[position + 1 + k] = along * pressing;
            }
        }
        self.measure(positions, group);
        Ok(())
    }

    /// Computes the remaining jumps of a group.
    fn measure(&mut self, positions: &[usize], group: &Group<T>) {
        let size = positions.len();
        for (i, &position) in positions.iter().enumerate() {
            let (mut left, mut terms) = (self.jump[position], T::zero());
            for (s, &other) in group.s.iter().skip(i).step_by(size).zip(positions) {
                let (total, base) = (*s * self.totals[other], *s * self.base[other]);
                left += total - base;
                terms += total.abs() + base.abs();
            }
            (self.left[position], self.noise[position]) = (left, self.tolerance[position] + rounding(terms));
        }
    }
}

impl<T: Real> Group<T> {
    /// Reserves memory for this many rows.
    fn make_room(&mut self, rows: usize) {
        self.reserve_factor(rows);
        let Self { rows: own, s, unknowns, delassus, offset, sets, tolerance, multipliers, .. } = self;
        for list in [own, unknowns] {
            list.reserve(rows.saturating_sub(list.len()));
        }
        for matrix in [s, delassus] {
            matrix.reserve((rows * rows).saturating_sub(matrix.len()));
        }
        for values in [offset, tolerance, multipliers] {
            values.reserve(rows.saturating_sub(values.len()));
        }
        sets.reserve(rows.saturating_sub(sets.len()));
    }

    fn reserve_factor(&mut self, rows: usize) {
        if rows > self.reserved {
            (self.factor, self.reserved) = (DenseCholesky::with_capacity(rows), rows);
        }
    }

    /// Sets up the problem of the rows at these positions, with S given: one unknown per row, but a single unknown
    /// per sliding contact, whose friction is proportional to the normal multiplier.
    fn pose(&mut self, all: &JumpProblem<T>, positions: &[usize], friction: Friction) {
        let size = positions.len();
        let Self { s, unknowns, delassus, offset, sets, tolerance, multipliers, .. } = self;
        let block = |at: usize| &all.blocks[all.owners[positions[at]]];
        for values in [&mut *delassus, offset, tolerance, multipliers] {
            values.clear();
        }
        unknowns.clear();
        sets.clear();
        let mut at = 0;
        while at < size {
            let Block { tangents, set, direction, .. } = *block(at);
            unknowns.extend(at..=at + if direction.is_some() { 0 } else { tangents });
            sets.push(match (direction, set.is_bilateral()) {
                (None, _) => set,
                (Some(_), true) => AdmissibleSet::Free,
                (Some(_), false) => AdmissibleSet::NonNegative,
            });
            at += 1 + tangents;
        }
        let known = |at: usize| block(at).known.filter(|_| block(at).place == positions[at]);
        let largest = (0..size).map(|i| s[i * size + i]).fold(T::zero(), T::max);
        for &i in unknowns.iter() {
            let entry = |j: usize| s[j * size + i];
            if let Some(multiplier) = known(i) {
                // S_ii (λ − known) = 0; the normal force may act on dofs without mass alone, where S_ii is zero.
                let pivot = if entry(i) > T::zero() { entry(i) } else { largest };
                offset.push(-pivot * multiplier);
                tolerance.push(T::zero());
                delassus.extend(unknowns.iter().map(|&j| if i == j { pivot } else { T::zero() }));
                continue;
            }
            let (mut contained, mut terms) = (T::zero(), T::zero());
            for (j, &position) in positions.iter().enumerate() {
                let lags = friction == Friction::Lags && block(j).direction.is_some() && block(j).place < position;
                let base = all.base[position] - if lags { all.totals[position] } else { T::zero() };
                contained += entry(j) * base;
                terms += (entry(j) * base).abs();
            }
            offset.push(all.jump[positions[i]] - contained);
            tolerance.push(all.tolerance[positions[i]] + rounding(terms));
            for &j in unknowns.iter() {
                let Block { tangents, direction, compliance, place, .. } = *block(j);
                let mut sum = if known(j).is_some() { T::zero() } else { entry(j) };
                if let Some(direction) = direction.filter(|_| friction == Friction::Follows) {
                    sum += (0..tangents).map(|k| direction[k] * entry(j + 1 + k)).sum::<T>();
                }
                delassus.push(if i == j && positions[j] == place { sum + compliance } else { sum });
            }
        }
        multipliers.resize(unknowns.len(), T::zero());
    }

    /// Solves the problem. Equations alone, with a symmetric W, are solved in the least norm, however rounding has
    /// changed dependent rows.
    fn solve(&mut self, solver: &mut dyn ContactSolver<T>, friction: Friction) -> Solved<T> {
        let size = self.offset.len();
        if friction == Friction::Lags && self.sets.iter().all(|&set| set == AdmissibleSet::Free) {
            self.reserve_factor(size);
            let Self { delassus, offset, multipliers, factor, .. } = self;
            let failure = |row| ContactFailure::NotConverged { iterations: 0, row, residual: T::nan() };
            factor.factorize(size, |i, j| delassus[i * size + j]).map_err(failure)?;
            for (multiplier, &offset) in multipliers.iter_mut().zip(offset.iter()) {
                *multiplier = -offset;
            }
            factor.solve(multipliers);
            return Ok(());
        }
        let Self { delassus, offset, sets, tolerance, multipliers, .. } = self;
        solver.solve(&ContactProblem::of(delassus, offset, sets, tolerance, 0), multipliers).map(|_| ())
    }

    /// A sliding contact that friction jams.
    fn jammed(&self, all: &JumpProblem<T>, positions: &[usize]) -> Option<ContactFailure<T>> {
        let (size, unknowns) = (positions.len(), self.unknowns.len());
        let one = |(row, &at): (usize, &usize)| {
            let [x, y] = all.blocks[all.owners[positions[at]]].direction?;
            let (normal, sliding) = (self.s[at * size + at], self.delassus[row * unknowns + row]);
            let friction = x.hypot(y);
            let coupling = (sliding - normal).abs() / friction;
            let jams = normal > T::zero() && sliding <= T::zero();
            jams.then_some(ContactFailure::Jammed { row, friction: friction.value(), normal, coupling })
        };
        self.unknowns.iter().enumerate().find_map(one)
    }
}
