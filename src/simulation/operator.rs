//! Effective matrices w_ū K + w_v̄/h C + w_ā/h² M, factorized, with the responses of contact rows on the interface.
//!
//! - `matrix`, `tangent`: the entries of the effective matrix, and the motion at which its tangent is evaluated.
//! - `contact_path`, `interface`: the order of elimination, and the dofs that contact acts on.
//! - `responses`, `delassus`: responses of the interface to unit forces, and the Delassus operator of the rows.
//! - `products`: contact problems solved without it.
//! - `part`: a part of the dofs with a matrix of its own.

pub(super) mod contact_path;
pub(super) mod interface;
pub(super) mod matrix;
pub(super) mod part;
pub(super) mod responses;
pub(super) mod tangent;

mod delassus;
mod products;

use crate::contact::{ContactJacobian, Groups, RowProducts};
use crate::contact_solver::{Assembly, Outcome, RowData, new_version};
use crate::error::{Error, Result};
use crate::linear_solver::{COLUMNS, Factorization, LinearSolver};
use crate::mass::Mass;
use crate::memory;
use crate::ranks::Together;
use crate::real::Real;
use crate::rounding::largest_compliance;
use crate::simulation::operator::contact_path::{ContactPath, analyze, condensation, respond};
use crate::simulation::operator::interface::keep;
use crate::simulation::operator::matrix::EffectiveMatrix;
use crate::simulation::operator::responses::{Responses, Unit};
use crate::simulation::operator::tangent::At;
use crate::system::System;
use delassus::Delassus;
use part::{Embedded, Part};
use products::Products;
use std::sync::Arc;

/// A factorized effective matrix and the responses to contact computed with it so far.
///
/// Contact works on the interface, the free dofs that it may ever act on: only there A⁻¹ Gᵀ is computed. A solve has
/// two halves: [`begin`](Self::begin) computes the solution on the interface, [`finish`](Self::finish) completes it
/// with the values there after contact.
#[derive(Debug)]
pub(crate) struct Operator<T> {
    matrix: EffectiveMatrix<T>,
    /// In the place of `matrix` for a part of the dofs.
    part: Option<Arc<Part<T>>>,
    factor: Box<dyn Factorization<T>>,
    interface: Vec<usize>,
    responses: Responses<T>,
    diagonal: DiagonalResponses<T>,
    /// Version of the rows that the Delassus operator belongs to.
    rows: u64,
    delassus: Delassus<T>,
    /// Contact without W; none until it is used.
    products: Option<Box<Products<T>>>,
    groups: Groups,
    contact: ContactPath,
    /// Columns of the system's size, for full solves.
    full: Vec<T>,
}

/// The responses of a diagonal matrix.
#[derive(Debug, Default)]
struct DiagonalResponses<T> {
    /// The responses of the interface to unit forces; empty until needed.
    reciprocals: Vec<T>,
    /// Products of the response to a row with all rows.
    products: RowProducts<T>,
}

impl<T: Real> Operator<T> {
    /// Assembles and factorizes; contact may act on the `interface`. For a constant matrix responses are kept for
    /// each `unit`.
    pub(crate) fn new(
        system: &mut dyn System<T>,
        solver: &dyn LinearSolver<T>,
        weights: [f64; 3],
        h: f64,
        at: At<'_, T>,
        (interface, unit): (&[usize], Unit),
    ) -> Result<Self> {
        let mut matrix = EffectiveMatrix::new(system, weights)?;
        let varies = matrix.varies();
        let (factor, contact) = analyze(solver, matrix.pattern(), interface, varies)?;
        matrix.leave_pattern();
        let full = match contact {
            ContactPath::Full if !interface.is_empty() => {
                memory::zeros(COLUMNS, system.dofs(), "the responses of the contact rows")?
            }
            _ => Vec::new(),
        };
        let unit = if varies { Unit::Row } else { unit };
        let mut operator = Self {
            matrix,
            part: None,
            factor,
            interface: interface.to_vec(),
            responses: Responses::new(unit, interface.len()),
            diagonal: DiagonalResponses::default(),
            rows: 0,
            delassus: Delassus::default(),
            products: None,
            groups: Groups::default(),
            contact,
            full,
        };
        match operator.factorize(system, h, at) {
            // Another state, or a smaller step, may have a definite matrix, or one that the host admits: iterations
            // evaluate tangents where the balance holds, and a run may continue from such a state. If not, the step
            // fails with this error.
            Err(Error::Singular { .. } | Error::Inadmissible { .. }) if operator.varies() => return Ok(operator),
            other => other?,
        }
        if !operator.full.is_empty() {
            // The solver allocates memory for this many columns now, not in a step.
            operator.factor.solve(&mut operator.full)?;
        }
        Ok(operator)
    }

    /// A factor of a part of the system that does not depend on the step size: it is used for contact and solves, and
    /// not factorized again. Responses are kept for each `unit`.
    pub(crate) fn of_part(factor: Embedded<T>, interface: &[usize], unit: Unit) -> Result<Self> {
        Ok(Self {
            matrix: EffectiveMatrix::none()?,
            part: Some(factor.part.clone()),
            factor: Box::new(factor),
            interface: interface.to_vec(),
            responses: Responses::new(unit, interface.len()),
            diagonal: DiagonalResponses::default(),
            rows: 0,
            delassus: Delassus::default(),
            products: None,
            groups: Groups::default(),
            contact: ContactPath::Condensed,
            full: Vec::new(),
        })
    }

    /// Whether stages with these weights can use it.
    pub(crate) fn serves(&self, weights: [f64; 3]) -> bool {
        self.matrix.has_weights(weights)
    }

    /// Whether the matrix changes with u and v.
    pub(crate) fn varies(&self) -> bool {
        self.matrix.varies()
    }

    /// Factorizes for the step size h with the tangent at a motion, and forgets responses. Where the matrix varies,
    /// only the first call allocates.
    ///
    /// After an error the factor is not usable until a factorization has succeeded.
    pub(crate) fn factorize(&mut self, system: &mut dyn System<T>, h: f64, at: At<'_, T>) -> Result<()> {
        self.matrix.assemble(system, h, at)?;
        self.factor.factorize(self.matrix.view(system))?;
        if !self.varies() {
            self.matrix.free_values();
            self.factor.release();
        }
        self.reset();
        Ok(())
    }

    // Solves may fail if the solver iterates. Responses count as computed only after a successful solve.

    /// Begins `A d = r` with r in `increment`, and writes d on the interface.
    pub(crate) fn begin(&mut self, increment: &mut [T], on_interface: &mut [T]) -> Result<()> {
        if let Some(condensed) = condensation(self.contact, &mut *self.factor).filter(|_| !on_interface.is_empty()) {
            return condensed.condense(increment, on_interface);
        }
        self.factor.solve(increment)?;
        for (x, &dof) in on_interface.iter_mut().zip(&self.interface) {
            *x = increment[dof];
        }
        Ok(())
    }

    /// Finishes the solve of [`begin`](Self::begin): `increment` becomes d on all dofs. `forces` are the contact
    /// forces on the interface, `on_interface` is d there with them.
    pub(crate) fn finish(&mut self, increment: &mut [T], on_interface: &[T], forces: &[T]) -> Result<()> {
        let Self { contact, factor, interface, full, products, .. } = self;
        if let Some(condensed) = condensation(*contact, &mut **factor).filter(|_| !on_interface.is_empty()) {
            condensed.expand(on_interface, increment)?;
        } else if *contact == ContactPath::Apart {
            for (&x, &dof) in on_interface.iter().zip(interface.iter()) {
                increment[dof] = x;
            }
        } else if forces.iter().any(|force| *force != T::zero()) {
            if let Some(known) = products.as_ref().and_then(|products| products.response_to(forces)) {
                T::axpy(T::one(), known, increment);
            } else {
                let column = &mut full[..increment.len()];
                column.fill(T::zero());
                for (&force, &dof) in forces.iter().zip(interface.iter()) {
                    column[dof] = force;
                }
                factor.solve(column)?;
                T::axpy(T::one(), column, increment);
            }
            for (&x, &dof) in on_interface.iter().zip(interface.iter()) {
                increment[dof] = x;
            }
        }
        Ok(())
    }

    /// `x ← A⁻¹ x`; x is zero on prescribed dofs, before and after.
    pub(crate) fn solve(&mut self, x: &mut [T]) -> Result<()> {
        self.factor.solve(x)
    }

    /// `f ← A⁻¹ f` on the interface, for one column of forces there.
    pub(crate) fn respond(&mut self, forces: &mut [T]) -> Result<()> {
        respond((self.contact, &mut *self.factor), &self.interface, &mut self.full, forces)
    }

    /// Sorts rows into groups whose forces do not move each other's dofs: by shared dofs if A is diagonal, else into
    /// one group.
    pub(crate) fn sort(&mut self, g: &ContactJacobian<T>, rows: &[usize]) {
        match self.contact {
            ContactPath::Apart => {
                let acts_on = |row| g.located(row).map(|(place, _)| place);
                self.groups.sort(rows, self.interface.len(), |row| g.is_tangential(row), acts_on);
            }
            ContactPath::Condensed | ContactPath::Full => self.groups.together(rows.len()),
        }
    }

    /// The groups of the last [`sort`](Self::sort).
    pub(crate) fn groups(&self) -> &Groups {
        &self.groups
    }

    /// W = G A⁻¹ Gᵀ of some rows, with `compliance(k)` added to the diagonal entry of the k-th, and its version.
    ///
    /// The compliance of a power law at first touch is infinite: a multiple of the diagonal entry of W limits it.
    pub(crate) fn delassus(
        &mut self,
        g: &ContactJacobian<T>,
        rows: &[usize],
        compliance: impl Fn(usize) -> T,
    ) -> Result<(&[T], u64)> {
        let mut changed = self.delassus.version == 0 || self.delassus.rows != rows;
        if changed {
            self.delassus.version = 0;
            self.assemble(g, rows)?;
        }
        let Delassus { values, diagonal, version, .. } = &mut self.delassus;
        let most = largest_compliance::<T>();
        for (k, &own) in diagonal.iter().enumerate() {
            let entry = &mut values[k * rows.len() + k];
            let most = if own > T::zero() { most * own } else { T::infinity() };
            let value = own + compliance(k).min(most);
            changed |= *entry != value;
            *entry = value;
        }
        if changed {
            *version = new_version();
        }
        Ok((values, *version))
    }

    /// Forms W of some rows, without compliances.
    fn assemble(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<()> {
        self.prepare(g, rows)?;
        let Self { delassus, responses, diagonal: DiagonalResponses { reciprocals, products }, .. } = self;
        delassus.begin(rows)?;
        let size = rows.len();
        match self.contact {
            ContactPath::Apart => {
                products.list(size, reciprocals.len(), |i| g.located(rows[i]))?;
                for (k, &j) in rows.iter().enumerate() {
                    let response = g.located(j).map(|(place, weight)| (place, weight * reciprocals[place]));
                    products.each(response, |i, product| delassus.values[i * size + k] = product);
                }
            }
            ContactPath::Condensed | ContactPath::Full => match responses.couples_by_tiles(g, rows) {
                true => responses.couple_by_tiles(g, rows, &mut delassus.values),
                false => responses.couple(g, rows, &mut delassus.values),
            },
        }
        delassus.end(rows);
        Ok(())
    }

    /// Computes responses to unit forces on all dofs that some rows act on.
    fn prepare(&mut self, g: &ContactJacobian<T>, rows: &[usize]) -> Result<()> {
        let Self { contact, factor, interface, full, responses, diagonal, .. } = self;
        let reciprocals = &mut diagonal.reciprocals;
        if *contact == ContactPath::Apart {
            if reciprocals.is_empty() {
                memory::grow(reciprocals, interface.len(), 1, "the responses of the contact rows")?;
                reciprocals.fill(T::one());
                let found = respond((*contact, &mut **factor), interface, full, reciprocals);
                return found.inspect_err(|_| reciprocals.clear());
            }
            return Ok(());
        }
        responses.prepare(g, rows, |forces| respond((*contact, &mut **factor), interface, full, forces))
    }

    /// The response A⁻¹ Gᵀ λ on the interface of rows whose [`delassus`](Self::delassus) has been formed, and their
    /// forces Gᵀ λ there.
    pub(crate) fn answer(
        &self,
        g: &ContactJacobian<T>,
        (rows, multipliers): (&[usize], &[T]),
        forces: &mut [T],
        response: &mut [T],
    ) {
        forces.fill(T::zero());
        for (&row, &lambda) in rows.iter().zip(multipliers) {
            g.interface_scatter(row, lambda, forces);
        }
        if self.contact == ContactPath::Apart {
            response.fill(T::zero());
            for (&row, &lambda) in rows.iter().zip(multipliers) {
                for (place, weight) in g.located(row) {
                    response[place] += lambda * (weight * self.diagonal.reciprocals[place]);
                }
            }
            return;
        }
        self.responses.respond((rows, multipliers), forces, response);
    }

    /// Whether problems of so many rows may be solved by products with A.
    pub(crate) fn multiplies(&self, assembly: Assembly, rows: usize) -> bool {
        let may = self.contact != ContactPath::Apart && self.factor.is_symmetric();
        let few = assembly == Assembly::Automatic && self.iterates();
        may && rows >= if few { 1 } else { assembly.least() }
    }

    /// Whether solves iterate: then a response to a row costs as much as a whole contact problem by products.
    fn iterates(&self) -> bool {
        self.factor.iterations() > 0
    }

    /// Solves a contact problem by products with A, to a residual, unless forming W is less work or the only way.
    /// Leaves the forces Gᵀ λ and the response A⁻¹ Gᵀ λ in two vectors on the interface.
    pub(crate) fn solve_by_products(
        &mut self,
        (system, together): (&mut dyn System<T>, &Together<T>),
        (h, at): (f64, At<'_, T>),
        (assembly, residual): (Assembly, f64),
        data: RowData<'_, T>,
        multipliers: &mut [T],
        answer: [&mut [T]; 2],
    ) -> Result<Option<Outcome>> {
        let RowData { g, rows, .. } = data;
        let moves = |place| self.part.as_ref().is_none_or(|part| part.has_place(place));
        let responds = |&row: &usize| g.located(row).any(|(place, _)| moves(place));
        // Ranks number their parts by themselves.
        let spans = self.part.is_some() && !together.is_alone();
        if spans || data.compliance.iter().any(|c| !c.is_finite()) || !rows.iter().all(responds) {
            return Ok(None);
        }
        let (responses, iterates) = (self.work_of_responses(rows.len()), self.iterates());
        self.read_products((system, together), h, at)?;
        let Some(products) = &mut self.products else { return Ok(None) };
        let mut affordable = usize::MAX;
        if assembly == Assembly::Automatic && !iterates {
            let entries = rows.iter().map(|&row| g.located(row).count()).sum();
            let with_w = responses + self.responses.work((rows.len(), entries), data.sets.len() < rows.len());
            match products.affordable(entries, residual, with_w) {
                Some(count) => affordable = count,
                None => return Ok(None),
            }
        }
        let [forces, response] = answer;
        let a = (!products.is_packed).then(|| match &self.part {
            Some(part) => part.matrix.as_ref(),
            None => self.matrix.view(system),
        });
        let dofs = self.part.as_ref().map(|part| &part.dofs[..]);
        let outcome = products.solve((a, dofs), together, data, multipliers, (affordable, residual), forces)?;
        if outcome.is_solved {
            let d = products.solution();
            match &self.part {
                Some(part) => part.write_on_interface(d, response),
                None => keep(&self.interface, d, response),
            }
        }
        Ok(Some(outcome))
    }

    /// Multiplications for the responses to some rows, if the matrix changes too often to keep them.
    fn work_of_responses(&self, rows: usize) -> f64 {
        let of_one = match self.contact {
            ContactPath::Full => 2.0 * self.factor.stored_values() as f64,
            ContactPath::Condensed | ContactPath::Apart => (self.interface.len() as f64).powi(2),
        };
        if self.varies() { rows as f64 * of_one } else { 0.0 }
    }

    /// Reads what products need of the present matrix.
    fn read_products(
        &mut self,
        (system, together): (&mut dyn System<T>, &Together<T>),
        h: f64,
        at: At<'_, T>,
    ) -> Result<()> {
        if self.products.as_ref().is_some_and(|products| products.is_current) {
            return Ok(());
        }
        let whole = self.part.is_none();
        together.agree(if !whole || self.varies() { Ok(()) } else { self.matrix.assemble(system, h, at) })?;
        // A smooth motion of a whole system has inertia alone, one of a part the stiffness towards the others.
        let (a, touched, fixed, smooth) = match &self.part {
            Some(part) => (part.matrix.as_ref(), &part.touched, &[][..], part.sum_of_entries()),
            None => (self.matrix.view(system), &self.interface, system.prescribed(), self.inertia(system, together, h)),
        };
        let products = match &mut self.products {
            Some(products) => products,
            none => none.insert(Box::new(together.agree(Products::new(a.symbolic(), touched))?)),
        };
        products.read(a, (touched, fixed), smooth, together)?;
        if products.is_packed && !self.varies() {
            self.matrix.free_values();
        }
        Ok(())
    }

    /// The inertia of smooth motions on the free dofs that this rank owns.
    fn inertia(&self, system: &dyn System<T>, together: &Together<T>, h: f64) -> f64 {
        let free = |dof: &usize| system.prescribed().binary_search(dof).is_err();
        let mass = |dof: usize| match system.mass() {
            Mass::Lumped(mass) => mass[dof].value(),
            Mass::Consistent(mass) => mass.val_of_col(dof).iter().map(|m| m.value()).sum(),
        };
        self.matrix.inertia(h) * together.owned(system.dofs()).flatten().filter(free).map(mass).sum::<f64>()
    }

    /// Another stage begins: contact problems solved so far are not near those to come.
    pub(crate) fn begin_stage(&mut self) {
        if let Some(products) = &mut self.products {
            products.begin();
        }
    }

    /// Forgets the Delassus operator if it belongs to another version of the rows.
    pub(crate) fn follow(&mut self, rows: u64) {
        if self.rows != rows {
            self.rows = rows;
            self.responses.forget_rows();
            self.delassus.version = 0;
        }
    }

    /// Forgets results computed with another matrix.
    fn reset(&mut self) {
        if let Some(products) = &mut self.products {
            products.forget();
        }
        self.responses.reset();
        self.diagonal.reciprocals.clear();
        self.delassus.version = 0;
    }

    /// Whether A is taken as symmetric.
    pub(crate) fn is_symmetric(&self) -> bool {
        self.factor.is_symmetric()
    }

    /// Number of dofs on the interface.
    pub(crate) fn interface(&self) -> usize {
        self.interface.len()
    }

    pub(crate) fn stored_values(&self) -> usize {
        self.factor.stored_values()
    }
}
