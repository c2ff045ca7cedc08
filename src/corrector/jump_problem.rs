//! The contact problem of S = G M⁻¹ Gᵀ in total multipliers: the jumps already contain a part of them.

use super::JumpProjection;
use super::many_jumps::ManyJumps;
use crate::contact::{ContactId, ContactJacobian};
use crate::contact_solver::{AdmissibleSet, ContactFailure, ContactProblem, ContactSolver, contact_error, no_response};
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{ONE_ROW, half_digits, rounding};

/// A contact of the problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block<T> {
    /// The row of its gap, or of a single equation.
    pub(crate) row: usize,
    /// Number of its tangential rows, which follow the row of the gap.
    pub(crate) tangents: usize,
    /// `Free` with tangential rows: held, with a given direction.
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

    /// Whether it slides with friction.
    fn slides(&self) -> bool {
        self.direction.is_some_and(|direction| direction != [T::zero(); 2])
    }

    fn take_friction(&mut self) {
        self.direction = self.direction.map(|_| [T::zero(); 2]);
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

/// The normal multipliers of sliding contacts that come with friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FrictionOf {
    /// Those of forces and impulses, where they press.
    Pressing,
    /// Those of changes of forces and impulses, whether they press or pull.
    Changes,
}

/// Rows that S couples, as a problem for a contact solver.
#[derive(Debug, Default)]
struct Group<T> {
    rows: Vec<usize>,
    s: Vec<T>,
    /// The unknowns: the position of each one's row in the group. A sliding contact has one, its normal multiplier.
    unknowns: Vec<usize>,
    delassus: Vec<T>,
    /// What of it is the friction of sliding contacts; empty if none slides.
    friction: Vec<T>,
    offset: Vec<T>,
    sets: Vec<AdmissibleSet>,
    tolerance: Vec<T>,
    multipliers: Vec<T>,
    /// Multipliers of the next pass of an iteration.
    next: Vec<T>,
    factor: DenseCholesky<T>,
}

type Solved<T> = std::result::Result<(), ContactFailure<T>>;

impl<T: Real> JumpProblem<T> {
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

    /// Finds the totals group by group; S couples no two groups. `id` gives the contact of a row for an error at t.
    pub(crate) fn solve(
        &mut self,
        (g, projection): (&ContactJacobian<T>, &mut JumpProjection<T>),
        solver: &mut dyn ContactSolver<T>,
        friction: FrictionOf,
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
            if is_large && self.solve_without_s((g, projection), (number, least), friction)? {
                return Ok(());
            }
            self.solve_with_s((g, projection), (number, &mut group), solver, friction, (t, &id))
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
        friction: FrictionOf,
        (t, id): (f64, &impl Fn(usize) -> ContactId),
    ) -> Result<()> {
        // Positions of a group ascend, and a block is in one group.
        group.rows.clear();
        group.rows.extend(projection.groups().group(number).iter().map(|&position| self.rows[position]));
        projection.assemble(g, &group.rows, &mut group.s)?;
        let positions = projection.groups().group(number);
        self.solve_group(positions, group, solver, friction).map_err(|failure| {
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

    /// Solves for the rows at these positions. A sliding contact whose force would pull gets no friction, and the
    /// problem is solved again. If it has no solution with the friction of sliding contacts, none of them gets any.
    fn solve_group(
        &mut self,
        positions: &[usize],
        group: &mut Group<T>,
        solver: &mut dyn ContactSolver<T>,
        friction: FrictionOf,
    ) -> Solved<T> {
        loop {
            group.pose(self, positions);
            let slides = positions.iter().any(|&position| self.blocks[self.owners[position]].slides());
            if let Err(failure) = group.solve(solver, friction) {
                if let Some(jammed) = group.jammed(self, positions) {
                    return Err(jammed);
                }
                if !slides {
                    return Err(failure);
                }
                for &position in positions {
                    self.blocks[self.owners[position]].take_friction();
                }
                continue;
            }
            for (&at, &multiplier) in group.unknowns.iter().zip(&group.multipliers) {
                let position = positions[at];
                self.totals[position] = multiplier;
                let Block { direction, tangents, .. } = self.blocks[self.owners[position]];
                for (k, along) in direction.into_iter().flatten().enumerate().take(tangents) {
                    self.totals[position + 1 + k] = along * multiplier;
                }
            }
            if friction == FrictionOf::Changes || !self.take_friction_of_pulling(positions) {
                break;
            }
        }
        self.keep_in_cones(positions);
        self.measure(positions, group);
        Ok(())
    }

    /// Takes the friction from sliding contacts whose multipliers pull; returns whether there are any.
    pub(super) fn take_friction_of_pulling(&mut self, positions: &[usize]) -> bool {
        let mut any = false;
        for &position in positions {
            let block = &mut self.blocks[self.owners[position]];
            if block.place == position && block.slides() && self.totals[position] < T::zero() {
                block.take_friction();
                any = true;
            }
        }
        any
    }

    /// Scales friction back into its cone if it was accepted outside as rounding. Next to much heavier bodies this
    /// rounding far exceeds the rounding of the local contact forces.
    pub(super) fn keep_in_cones(&mut self, positions: &[usize]) {
        for &position in positions {
            let block = self.blocks[self.owners[position]];
            let is_found = block.place == position && block.direction.is_none() && block.known.is_none();
            let Some(friction) = block.set.friction().filter(|_| is_found) else { continue };
            let bound = T::of(friction) * self.totals[position].max(T::zero());
            let tangential = &mut self.totals[position + 1..=position + block.tangents];
            let size = tangential.iter().fold(T::zero(), |size, &f| size.hypot(f));
            if size > (T::one() + half_digits::<T>()) * bound {
                for f in tangential {
                    *f *= bound / size;
                }
            }
        }
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
    /// Sets up the problem of the rows at these positions, with S given: one unknown per row, but a single unknown
    /// per sliding contact, whose friction is proportional to the normal multiplier.
    fn pose(&mut self, all: &JumpProblem<T>, positions: &[usize]) {
        let size = positions.len();
        let Self { s, unknowns, delassus, friction, offset, sets, tolerance, multipliers, .. } = self;
        let block = |at: usize| &all.blocks[all.owners[positions[at]]];
        let slides = (0..size).any(|at| block(at).slides());
        for values in [&mut *delassus, friction, offset, tolerance, multipliers] {
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
        delassus.reserve_exact(unknowns.len().pow(2));
        friction.reserve_exact(if slides { unknowns.len().pow(2) } else { 0 });
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
                friction.extend(unknowns.iter().filter(|_| slides).map(|_| T::zero()));
                continue;
            }
            let (mut contained, mut terms) = (T::zero(), T::zero());
            for (j, &position) in positions.iter().enumerate() {
                contained += entry(j) * all.base[position];
                terms += (entry(j) * all.base[position]).abs();
            }
            offset.push(all.jump[positions[i]] - contained);
            tolerance.push(all.tolerance[positions[i]] + rounding(terms));
            for &j in unknowns.iter() {
                let Block { tangents, direction, compliance, place, .. } = *block(j);
                let own = if known(j).is_some() { T::zero() } else { entry(j) };
                let along = direction.into_iter().flatten().enumerate().take(tangents);
                let rubbed = along.map(|(k, along)| along * entry(j + 1 + k)).sum::<T>();
                let diagonal = if i == j && positions[j] == place { compliance } else { T::zero() };
                delassus.push(own + rubbed + diagonal);
                friction.extend(slides.then_some(rubbed));
            }
        }
        multipliers.resize(unknowns.len(), T::zero());
    }

    /// Solves the problem. Equations alone are solved in the least norm, however rounding has changed dependent rows.
    fn solve(&mut self, solver: &mut dyn ContactSolver<T>, of: FrictionOf) -> Solved<T> {
        if self.sets.iter().all(|&set| set == AdmissibleSet::Free) {
            return self.solve_equations(of);
        }
        let Self { delassus, offset, sets, tolerance, multipliers, .. } = self;
        solver.solve(&ContactProblem::of(delassus, offset, sets, tolerance, 0), multipliers).map(|_| ())
    }

    /// Solves equations by passes, each with the friction of the pass before, until the multipliers no longer change.
    /// Each pass has the least norm, so that dependent rows do not press and pull by arbitrary forces.
    fn solve_equations(&mut self, of: FrictionOf) -> Solved<T> {
        /// Friction of a normal force changes that force by some tenths of its size at most, except near jamming.
        const PASSES: usize = 100;
        let size = self.offset.len();
        let Self { delassus, friction, offset, multipliers, next, factor, .. } = self;
        let slides = !friction.is_empty();
        let friction = |i: usize, j: usize| friction.get(i * size + j).copied().unwrap_or(T::zero());
        let failure = |iterations| move |row| ContactFailure::NotConverged { iterations, row, residual: T::nan() };
        let fill = |i: usize, row: &mut [T]| {
            row.iter_mut().enumerate().for_each(|(j, x)| *x = delassus[i * size + j] - friction(i, j));
        };
        factor.factorize_rows(size, ONE_ROW, fill).map_err(failure(0))?;
        multipliers.fill(T::zero());
        next.resize(size, T::zero());
        for _ in 0..PASSES {
            for (i, next) in next.iter_mut().enumerate() {
                let rubs = |&j: &usize| of == FrictionOf::Changes || multipliers[j] > T::zero();
                *next = -offset[i] - (0..size).filter(rubs).map(|j| friction(i, j) * multipliers[j]).sum::<T>();
            }
            factor.solve(next);
            std::mem::swap(multipliers, next);
            let change = multipliers.iter().zip(next.iter()).fold(T::zero(), |most, (&x, &y)| most.max((x - y).abs()));
            if !slides || change <= rounding(T::largest(multipliers)) {
                return Ok(());
            }
        }
        Err(failure(PASSES)(0))
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
