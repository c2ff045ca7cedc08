//! Responses of the interface to unit forces, kept for the dofs or rows that contact has used.
//!
//! Responses of a constant matrix with changing rows belong to dofs: rows that turn then cost products, and no solve.
//! Otherwise responses belong to rows, of which there are fewer.

mod tiles;

use crate::contact::ContactJacobian;
use crate::error::Result;
use crate::linear_solver::COLUMNS;
use crate::memory;
use crate::real::Real;
use crate::simulation::rows::constraints::Constraints;
use tiles::Tiles;

/// The unit that a column is the response to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    /// A unit force on a dof of the interface.
    Dof,
    /// A unit multiplier of a row.
    Row,
}

impl Unit {
    /// The unit of responses of a constant matrix: rows that never change are fewer than the dofs they act on.
    pub(crate) fn of<T: Real>(constraints: &Constraints<'_, T>) -> Self {
        if constraints.is_fixed() { Self::Row } else { Self::Dof }
    }
}

/// Columns of displacements of the interface, filled when first needed.
#[derive(Debug)]
pub(crate) struct Responses<T> {
    unit: Unit,
    /// Number of dofs on the interface.
    size: usize,
    /// For each dof there, or each row, the index of its column.
    slots: Vec<usize>,
    columns: Vec<Column>,
    /// Values of the columns, in pages: none is moved when more are needed. Pages behind the `page`-th are empty.
    pages: Vec<Vec<T>>,
    page: usize,
    /// Columns that are being solved for.
    solved: Vec<T>,
    /// The dofs or rows whose columns are missing.
    missing: Vec<usize>,
    /// The response to a row.
    whole: Vec<T>,
    tiles: Tiles<T>,
}

/// A column from its first to its last nonzero entry: a contact force moves only two of several bodies.
#[derive(Clone, Copy, Debug)]
struct Column {
    page: usize,
    start: usize,
    /// The range of dofs that it covers.
    first: usize,
    count: usize,
}

/// Mean number of entries of a row up to which whole responses to rows are formed, as for nodes on obstacles.
const SHORT: usize = 8;

const WHAT: &str = "the responses of contact";

/// Marks of a dof or row without a column, and of one about to get one.
const NONE: usize = usize::MAX;
const MISSING: usize = usize::MAX - 1;

impl<T: Real> Responses<T> {
    /// For an interface of `size` dofs.
    pub(crate) fn new(unit: Unit, size: usize) -> Self {
        Self {
            unit,
            size,
            slots: Vec::new(),
            columns: Vec::new(),
            pages: Vec::new(),
            page: 0,
            solved: Vec::new(),
            missing: Vec::new(),
            whole: Vec::new(),
            tiles: Tiles::default(),
        }
    }

    /// Forgets all columns, which belong to another matrix. Their memory is used again.
    pub(crate) fn reset(&mut self) {
        self.slots.clear();
        self.columns.clear();
        self.pages.iter_mut().for_each(Vec::clear);
        self.page = 0;
    }

    /// Forgets columns that belong to other rows.
    pub(crate) fn forget_rows(&mut self) {
        if self.unit == Unit::Row {
            self.reset();
        }
    }

    /// Computes the columns that [`couple`](Self::couple) and [`respond`](Self::respond) need for some rows
    /// (ascending); `solve` replaces up to [`COLUMNS`] columns of forces by their responses.
    pub(crate) fn prepare(
        &mut self,
        g: &ContactJacobian<T>,
        rows: &[usize],
        mut solve: impl FnMut(&mut [T]) -> Result<()>,
    ) -> Result<()> {
        let Self { unit, size, slots, missing, .. } = self;
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
        // If a solve fails, these columns stay unknown.
        for &index in missing.iter() {
            slots[index] = NONE;
        }
        let (missing, mut solved) = (std::mem::take(&mut self.missing), std::mem::take(&mut self.solved));
        let found = missing.chunks(COLUMNS).try_for_each(|indices| {
            let size = self.size;
            solved.clear();
            memory::grow(&mut solved, indices.len(), size, WHAT)?;
            for (&index, column) in indices.iter().zip(solved.chunks_exact_mut(size)) {
                match self.unit {
                    Unit::Row => g.interface_scatter(index, T::one(), column),
                    Unit::Dof => column[index] = T::one(),
                }
            }
            solve(&mut solved)?;
            indices.iter().zip(solved.chunks_exact(size)).try_for_each(|(&index, column)| self.keep(index, column))
        });
        (self.missing, self.solved) = (missing, solved);
        found
    }

    /// Stores the column of a dof or row: its nonzero range for a row, all of it for a dof, as tiles need it.
    fn keep(&mut self, index: usize, column: &[T]) -> Result<()> {
        let Self { unit, size, slots, columns, pages, page, .. } = self;
        let known = |x: &T| *x != T::zero();
        let range = match (*unit, column.iter().position(known), column.iter().rposition(known)) {
            (Unit::Row, Some(first), Some(last)) => first..last + 1,
            (Unit::Row, ..) => 0..0,
            (Unit::Dof, ..) => 0..*size,
        };
        let is_full = |page: &Vec<T>| page.capacity() - page.len() < range.len();
        *page += usize::from(pages.get(*page).is_some_and(is_full));
        if *page == pages.len() {
            pages.push(memory::reserve(COLUMNS, *size, WHAT)?);
        }
        let values = &mut pages[*page];
        slots[index] = columns.len();
        columns.push(Column { page: *page, start: values.len(), first: range.start, count: range.len() });
        values.extend_from_slice(&column[range]);
        Ok(())
    }

    /// The first dof of the stored column of a dof or row, and its values.
    fn column(&self, index: usize) -> (usize, &[T]) {
        let Column { page, start, first, count } = self.columns[self.slots[index]];
        (first, &self.pages[page][start..start + count])
    }

    /// Work to form W of so many rows with so many entries anew, unless they stay the same, and to solve with it.
    pub(crate) fn work(&self, (rows, entries): (usize, usize), has_friction: bool) -> f64 {
        let (rows, entries, size) = (rows as f64, entries as f64, self.size as f64);
        let forms = match self.unit {
            Unit::Row => 0.0,
            Unit::Dof => entries * (size + rows),
        };
        // Friction factorizes a matrix twice; otherwise iterations take products with W.
        let solves = if has_friction { rows * rows * rows / 4.0 } else { 20.0 * rows * rows };
        8.0 * forms + solves
    }

    /// Whether W of some rows is formed [tile by tile](Self::couple_by_tiles).
    pub(crate) fn couples_by_tiles(&self, g: &ContactJacobian<T>, rows: &[usize]) -> bool {
        let entries = || rows.iter().map(|&row| g.located(row).count()).sum::<usize>();
        self.unit == Unit::Dof && entries() > SHORT * rows.len()
    }

    /// W = G A⁻¹ Gᵀ of some rows, row by row.
    pub(crate) fn couple_by_tiles(&mut self, g: &ContactJacobian<T>, rows: &[usize], w: &mut [T]) {
        let mut tiles = std::mem::take(&mut self.tiles);
        tiles.couple(g, rows, self.size, |place| self.column(place).1, w);
        self.tiles = tiles;
    }

    /// W = G A⁻¹ Gᵀ of some rows, row by row.
    pub(crate) fn couple(&mut self, g: &ContactJacobian<T>, rows: &[usize], w: &mut [T]) {
        let mut whole = std::mem::take(&mut self.whole);
        for (k, &j) in rows.iter().enumerate() {
            let (first, response) = match self.unit {
                Unit::Row => self.column(j),
                Unit::Dof => {
                    whole.clear();
                    whole.resize(self.size, T::zero());
                    g.located(j).for_each(|(place, weight)| T::axpy(weight, self.column(place).1, &mut whole));
                    (0, &whole[..])
                }
            };
            let at = |place: usize| response.get(place.wrapping_sub(first)).copied().unwrap_or(T::zero());
            for (entry, &i) in w[k..].iter_mut().step_by(rows.len()).zip(rows) {
                *entry = g.located(i).map(|(place, weight)| weight * at(place)).sum();
            }
        }
        self.whole = whole;
    }

    /// A⁻¹ Gᵀ λ of some rows, whose forces Gᵀ λ on the interface are known.
    pub(crate) fn respond(&self, (rows, multipliers): (&[usize], &[T]), forces: &[T], response: &mut [T]) {
        response.fill(T::zero());
        let mut add = |index: usize, factor: T| {
            if factor != T::zero() {
                let (first, column) = self.column(index);
                T::axpy(factor, column, &mut response[first..first + column.len()]);
            }
        };
        match self.unit {
            Unit::Row => rows.iter().zip(multipliers).for_each(|(&row, &lambda)| add(row, lambda)),
            Unit::Dof => forces.iter().enumerate().for_each(|(place, &force)| add(place, force)),
        }
    }
}
