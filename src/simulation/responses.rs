//! Responses of the interface to unit forces, kept for what has been pressed.
//!
//! Where the matrix stays and rows change they belong to dofs: rows that turn cost products then, and no solve. Where
//! the matrix changes with every iteration, or rows never do, they belong to rows, of which there are fewer.

mod tiles;

use super::constraints::Constraints;
use crate::contact::ContactJacobian;
use crate::error::Result;
use crate::linear_solver::COLUMNS;
use crate::memory;
use crate::real::Real;
use tiles::Tiles;

/// What a column is the response to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    /// A unit force on a dof of the interface.
    Dof,
    /// A unit multiplier of a row.
    Row,
}

impl Unit {
    /// What responses of a matrix that stays are kept for: rows that never change are fewer than the dofs they act on.
    pub(super) fn of<T: Real>(constraints: &Constraints<'_, T>) -> Self {
        if constraints.is_fixed() { Self::Row } else { Self::Dof }
    }
}

/// Columns of displacements of the interface, filled when first needed.
#[derive(Debug)]
pub(super) struct Responses<T> {
    unit: Unit,
    /// Number of dofs on the interface.
    size: usize,
    /// For each dof there, or each row, the number of its column.
    slots: Vec<usize>,
    /// The columns, in blocks: none is moved when more are needed.
    blocks: Vec<Vec<T>>,
    columns: usize,
    /// The dofs or rows whose columns are missing.
    missing: Vec<usize>,
    /// The response to a row.
    whole: Vec<T>,
    tiles: Tiles<T>,
}

/// Dofs of an interface whose responses take little memory, all together.
const SMALL: usize = 256;

/// Entries of a row, in the mean, up to which the response to each is formed as a whole: those of nodes on obstacles.
const SHORT: usize = 8;

/// A dof or row without a column, and one that is about to get one.
const NONE: usize = usize::MAX;
const MISSING: usize = usize::MAX - 1;

impl<T: Real> Responses<T> {
    /// For an interface of so many dofs. Of a small one all columns have memory at once.
    pub(super) fn new(unit: Unit, size: usize) -> Self {
        let small = if size <= SMALL { size } else { 0 };
        let blocks = (0..small.div_ceil(COLUMNS)).map(|_| vec![T::zero(); COLUMNS * size]).collect();
        Self {
            unit,
            size,
            slots: Vec::with_capacity(small),
            blocks,
            columns: 0,
            missing: Vec::with_capacity(small),
            whole: Vec::with_capacity(size),
            tiles: Tiles::for_interface(small),
        }
    }

    /// Forgets all columns: they belong to another matrix. Their memory is used again.
    pub(super) fn reset(&mut self) {
        self.slots.clear();
        self.columns = 0;
    }

    /// Forgets columns that belong to other rows.
    pub(super) fn forget_rows(&mut self) {
        if self.unit == Unit::Row {
            self.reset();
        }
    }

    /// Makes known what [`couple`](Self::couple) and [`respond`](Self::respond) need of some rows
    /// (ascending); `solve` replaces up to [`COLUMNS`] columns of forces by their responses.
    pub(super) fn prepare(
        &mut self,
        g: &ContactJacobian<T>,
        rows: &[usize],
        mut solve: impl FnMut(&mut [T]) -> Result<()>,
    ) -> Result<()> {
        let Self { unit, size, slots, blocks, columns, missing, .. } = self;
        slots.resize(if *unit == Unit::Row { g.rows() } else { *size }, NONE);
        missing.clear();
        let mut ask = |index: usize| {
            if slots[index] == NONE {
                slots[index] = MISSING;
                missing.push(index);
            }
        };
        for &row in rows {
            match unit {
                Unit::Row => ask(row),
                Unit::Dof => g.located(row).for_each(|(place, _)| ask(place)),
            }
        }
        // (Should a solve fail nothing is known of these.)
        for &index in missing.iter() {
            slots[index] = NONE;
        }
        let mut rest = &missing[..];
        while !rest.is_empty() {
            // Blocks are full but for the last one, which is filled up first.
            let filled = *columns % COLUMNS;
            let count = rest.len().min(COLUMNS - filled);
            if blocks.len() * COLUMNS == *columns {
                blocks.push(memory::zeros(COLUMNS, *size, "the responses of contact")?);
            }
            let block = &mut blocks[*columns / COLUMNS][filled * *size..(filled + count) * *size];
            block.fill(T::zero());
            for (&index, column) in rest.iter().zip(block.chunks_exact_mut(*size)) {
                match unit {
                    Unit::Row => g.interface_scatter(index, T::one(), column),
                    Unit::Dof => column[index] = T::one(),
                }
            }
            solve(block)?;
            for &index in &rest[..count] {
                slots[index] = *columns;
                *columns += 1;
            }
            rest = &rest[count..];
        }
        Ok(())
    }

    /// The column of a dof or row that has one.
    fn column(&self, index: usize) -> &[T] {
        let (block, place) = (self.slots[index] / COLUMNS, self.slots[index] % COLUMNS);
        &self.blocks[block][place * self.size..(place + 1) * self.size]
    }

    /// W = G A⁻¹ Gᵀ of some rows, row by row.
    pub(super) fn couple(&mut self, g: &ContactJacobian<T>, rows: &[usize], w: &mut [T]) {
        let entries: usize = rows.iter().map(|&row| g.located(row).count()).sum();
        if self.unit == Unit::Dof && entries > SHORT * rows.len() {
            let mut tiles = std::mem::take(&mut self.tiles);
            tiles.couple(g, rows, self.size, |place| self.column(place), w);
            self.tiles = tiles;
            return;
        }
        let mut whole = std::mem::take(&mut self.whole);
        for (k, &j) in rows.iter().enumerate() {
            let response = match self.unit {
                Unit::Row => self.column(j),
                Unit::Dof => {
                    whole.clear();
                    whole.resize(self.size, T::zero());
                    g.located(j).for_each(|(place, weight)| T::axpy(weight, self.column(place), &mut whole));
                    &whole
                }
            };
            for (entry, &i) in w[k..].iter_mut().step_by(rows.len()).zip(rows) {
                *entry = g.interface_product(i, response);
            }
        }
        self.whole = whole;
    }

    /// A⁻¹ Gᵀ λ of some rows, whose forces Gᵀ λ on the interface are known.
    pub(super) fn respond(&self, (rows, multipliers): (&[usize], &[T]), forces: &[T], response: &mut [T]) {
        response.fill(T::zero());
        let mut add = |index: usize, factor: T| {
            if factor != T::zero() {
                T::axpy(factor, self.column(index), response);
            }
        };
        match self.unit {
            Unit::Row => rows.iter().zip(multipliers).for_each(|(&row, &lambda)| add(row, lambda)),
            Unit::Dof => forces.iter().enumerate().for_each(|(place, &force)| add(place, force)),
        }
    }
}
