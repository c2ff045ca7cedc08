//! The dam body by body, as in codes of their own: each block advances without contact, the frame finds the forces of
//! the joints, each block takes them up. The trapezoidal rule with the λ_v/λ_a correction, as the other runs.

use crate::record::{Record, Steps};
use crate::threads::try_each;
use crate::valley::{Block, Dam, Loading, Plan, RAYLEIGH};
use contact_dynamics::partitioned::{Assembly, Coupling};
use contact_dynamics::{Automatic, Error, Factorization, LinearSolver, Result};
use contact_dynamics_scenes::sparse::{entries, matrix, product};

/// A block in a code of its own.
struct Body<'a> {
    block: &'a Block,
    factor: Box<dyn Factorization<f64>>,
    step: f64,
    contact: Vec<usize>,
    u: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    /// Accelerations of the contact dofs; their displacements without contact, and with it.
    interface: Vec<f64>,
    free: Vec<f64>,
    scratch: Vec<f64>,
    rhs: Vec<f64>,
}

/// A factor of m M + k K of a block, its contact dofs last, and what unit forces on these do to them.
fn factorized(block: &Block, [m, k]: [f64; 2], scale: f64) -> Result<(Box<dyn Factorization<f64>>, Vec<f64>)> {
    let inertia = block.mass.iter().enumerate().map(|(dof, mass)| (dof, dof, m * mass));
    let elastic = entries(&block.stiffness).into_iter().map(|(i, j, x)| (i, j, k * x));
    let contact = block.contact(0.0);
    let effective = matrix(block.mass.len(), inertia.chain(elastic));
    let mut factor = Automatic.analyze(effective.symbolic(), &contact)?;
    factor.factorize(effective.as_ref())?;
    let size = contact.len();
    let mut flexibility = vec![0.0; size * size];
    flexibility.iter_mut().step_by(size + 1).for_each(|x| *x = scale);
    condensed(&mut *factor)?.solve(&mut flexibility)?;
    Ok((factor, flexibility))
}

impl<'a> Body<'a> {
    /// At u = 0, with its flexibility: what unit forces on the contact dofs do to their displacements at the end of a
    /// step.
    fn new(block: &'a Block, step: f64) -> Result<(Self, Vec<f64>)> {
        let [of_mass, of_stiffness] = RAYLEIGH;
        let weights = [1.0 + 0.5 * step * of_mass, 0.25 * step * step + 0.5 * step * of_stiffness];
        let (factor, flexibility) = factorized(block, weights, 0.25 * step * step)?;
        let contact = block.contact(0.0);
        let (n, size) = (block.mass.len(), contact.len());
        let zero = || vec![0.0; n];
        let (u, v, a, scratch, rhs) = (zero(), zero(), zero(), zero(), zero());
        let (interface, free) = (vec![0.0; size], vec![0.0; size]);
        Ok((Self { block, factor, step, contact, u, v, a, interface, free, scratch, rhs }, flexibility))
    }

    /// Moves without contact: u and v are predicted, a is known on the contact dofs.
    fn advance(&mut self, loads: [f64; 4]) -> Result<()> {
        let (h, [of_mass, of_stiffness]) = (self.step, RAYLEIGH);
        let Self { block, factor, contact, u, v, a, interface, free, scratch, rhs, .. } = self;
        for (((u, v), a), x) in u.iter_mut().zip(v.iter_mut()).zip(&*a).zip(scratch.iter_mut()) {
            *u += h * *v + 0.25 * h * h * a;
            *v += 0.5 * h * a;
            *x = -(*u + of_stiffness * *v);
        }
        *rhs = product(block.stiffness.as_ref(), scratch);
        for (dof, (rhs, load)) in rhs.iter_mut().zip(block.load(loads)).enumerate() {
            *rhs += load - of_mass * block.mass[dof] * v[dof];
        }
        condensed(&mut **factor)?.condense(rhs, interface)?;
        for ((free, &dof), a) in free.iter_mut().zip(&*contact).zip(&*interface) {
            *free = u[dof] + 0.25 * h * h * a;
        }
        Ok(())
    }

    /// Completes the step, with the displacements of its contact dofs.
    fn complete(&mut self, values: &[f64]) -> Result<()> {
        let h = self.step;
        for ((a, value), free) in self.interface.iter_mut().zip(values).zip(&self.free) {
            *a += 4.0 / (h * h) * (value - free);
        }
        condensed(&mut *self.factor)?.expand(&self.interface, &mut self.a)?;
        for ((u, v), a) in self.u.iter_mut().zip(&mut self.v).zip(&self.a) {
            *u += 0.25 * h * h * a;
            *v += 0.5 * h * a;
        }
        Ok(())
    }

    /// What the damping makes of a jump of v, which is in `scratch`: a ← a − A⁻¹ C δv.
    fn damp(&mut self) -> Result<()> {
        let Self { block, factor, a, scratch, rhs, .. } = self;
        if scratch.iter().all(|jump| *jump == 0.0) {
            return Ok(());
        }
        let [of_mass, of_stiffness] = RAYLEIGH;
        *rhs = product(block.stiffness.as_ref(), scratch);
        for ((rhs, jump), mass) in rhs.iter_mut().zip(&*scratch).zip(&block.mass) {
            *rhs = of_stiffness * *rhs + of_mass * mass * jump;
        }
        factor.solve(rhs)?;
        a.iter_mut().zip(rhs).for_each(|(a, x)| *a -= *x);
        Ok(())
    }
}

/// A rate of a dof.
type Rate<'a> = for<'b> fn(&'b mut Body<'a>, usize) -> &'b mut f64;

/// The factor with its interior eliminated.
fn condensed(factor: &mut dyn Factorization<f64>) -> Result<&mut dyn contact_dynamics::Condensation<f64>> {
    let reason = "it does not condense";
    factor.condensation().ok_or(Error::Incompatible { part: "the factor of a block".into(), reason })
}

/// All blocks, and the frame between them.
struct Split<'a> {
    dam: &'a Dam,
    loading: &'a Loading,
    bodies: Vec<Body<'a>>,
    frame: Assembly<f64>,
    step: f64,
    steps: u32,
    still: Vec<f64>,
    forces: Vec<f64>,
    gaps: Vec<f64>,
    closed: Vec<bool>,
    raw: Vec<f64>,
    changes: u64,
}

impl<'a> Split<'a> {
    fn new(dam: &'a Dam, loading: &'a Loading, step: f64) -> Result<Self> {
        let made = dam.blocks.iter().map(|block| Body::new(block, step)).collect::<Result<Vec<_>>>()?;
        let (bodies, flexibilities): (Vec<_>, Vec<_>) = made.into_iter().unzip();
        let place = |(block, dof): (usize, usize)| {
            let contact: &[usize] = &bodies[block].contact;
            (block, contact.partition_point(|&own| own < dof))
        };
        let row = |&[left, right]: &[(usize, usize); 2]| {
            let [left, right] = [place(left), place(right)];
            Coupling::unilateral(&[(left.0, left.1, -1.0), (right.0, right.1, 1.0)])
        };
        let rows: Vec<_> = dam.contacts.iter().map(row).collect();
        let flexibilities: Vec<&[f64]> = flexibilities.iter().map(Vec::as_slice).collect();
        let frame = Assembly::new(&flexibilities, &rows)?;
        let zero = || vec![0.0; rows.len()];
        let (still, forces, gaps, raw, closed) = (zero(), zero(), zero(), zero(), vec![true; rows.len()]);
        let mut split =
            Self { dam, loading, bodies, frame, step, steps: 0, still, forces, gaps, closed, raw, changes: 0 };
        split.rest(&rows)?;
        Ok(split)
    }

    /// The start: K u = f + Gᵀ λ, in the way of a step. Bodies move without contact, a frame finds the forces, bodies
    /// take them up.
    fn rest(&mut self, rows: &[Coupling<f64>]) -> Result<()> {
        let loads = self.loading.at(0.0);
        let mut parts = Vec::new();
        for body in &self.bodies {
            let (mut factor, flexibility) = factorized(body.block, [0.0, 1.0], 1.0)?;
            let mut free = vec![0.0; body.contact.len()];
            condensed(&mut *factor)?.condense(&body.block.load(loads), &mut free)?;
            parts.push((factor, flexibility, free));
        }
        let flexibilities: Vec<&[f64]> = parts.iter().map(|(_, flexibility, _)| &flexibility[..]).collect();
        let free: Vec<&[f64]> = parts.iter().map(|(.., free)| &free[..]).collect();
        let mut frame = Assembly::new(&flexibilities, rows)?;
        let found = frame.solve(&free, &self.still)?;
        self.raw.copy_from_slice(found.multipliers());
        self.forces.copy_from_slice(found.multipliers());
        self.gaps.copy_from_slice(found.gaps());
        self.closed.copy_from_slice(found.closed());
        for (number, (body, (factor, ..))) in self.bodies.iter_mut().zip(&mut parts).enumerate() {
            condensed(&mut **factor)?.expand(found.values(number), &mut body.u)?;
        }
        Ok(())
    }

    /// Takes away the rates with which closed contacts approach or, under pressure, part. Masses are lumped, and no two
    /// contacts share a dof: each is for itself. Returns what it takes.
    fn agree(&mut self, contact: usize, rate: Rate<'a>) -> Option<f64> {
        let [left, right] = self.dam.contacts[contact];
        let [mass_left, mass_right] = [left, right].map(|(block, dof)| self.dam.blocks[block].mass[dof]);
        let parting = *rate(&mut self.bodies[right.0], right.1) - *rate(&mut self.bodies[left.0], left.1);
        if !(self.raw[contact] > 0.0 || parting < 0.0) {
            return None;
        }
        let push = -parting / (1.0 / mass_left + 1.0 / mass_right);
        *rate(&mut self.bodies[left.0], left.1) -= push / mass_left;
        *rate(&mut self.bodies[right.0], right.1) += push / mass_right;
        Some(push)
    }
}

impl Steps for Split<'_> {
    fn step(&mut self) -> Result<()> {
        self.steps += 1;
        let loads = self.loading.at(f64::from(self.steps) * self.step);
        try_each(&mut self.bodies, |body| body.advance(loads))?;
        let free: Vec<&[f64]> = self.bodies.iter().map(|body| &body.free[..]).collect();
        let found = self.frame.solve(&free, &self.still)?;
        self.raw.copy_from_slice(found.multipliers());
        self.forces.copy_from_slice(found.multipliers());
        self.gaps.copy_from_slice(found.gaps());
        self.changes += self.closed.iter().zip(found.closed()).filter(|(before, after)| before != after).count() as u64;
        self.closed.copy_from_slice(found.closed());
        let mut bodies: Vec<(usize, &mut Body<'_>)> = self.bodies.iter_mut().enumerate().collect();
        try_each(&mut bodies, |(number, body)| body.complete(found.values(*number)))?;
        // The velocities agree, then the accelerations.
        for body in &mut self.bodies {
            body.scratch.copy_from_slice(&body.v);
        }
        let closed: Vec<usize> = (0..self.closed.len()).filter(|&contact| self.closed[contact]).collect();
        let held: Vec<usize> =
            closed.into_iter().filter(|&contact| self.agree(contact, |body, dof| &mut body.v[dof]).is_some()).collect();
        try_each(&mut self.bodies, |body| {
            body.scratch.iter_mut().zip(&body.v).for_each(|(before, after)| *before = after - *before);
            body.damp()
        })?;
        for contact in held {
            if let Some(force) = self.agree(contact, |body, dof| &mut body.a[dof]) {
                self.forces[contact] += force;
            }
        }
        Ok(())
    }

    fn contacts(&self) -> [&[f64]; 2] {
        [&self.forces, &self.gaps]
    }

    fn is_closed(&self, contact: usize) -> bool {
        self.closed[contact]
    }

    fn slip(&self) -> f64 {
        let of = |&[left, right]: &[(usize, usize); 2]| {
            [1, 2].map(|k| self.bodies[right.0].u[right.1 + k] - self.bodies[left.0].u[left.1 + k])
        };
        self.dam.contacts.iter().map(of).fold(0.0, |most, [downstream, upward]| most.max(downstream.hypot(upward)))
    }

    fn changes(&self) -> u64 {
        self.changes
    }

    fn factor(&self) -> usize {
        self.bodies.iter().map(|body| body.factor.stored_values()).sum()
    }

    fn unknowns(&self) -> usize {
        self.dam.dofs()
    }
}

/// Runs it.
pub(crate) fn run(name: &str, dam: &Dam, loading: &Loading, plan: &Plan) -> Result<Record> {
    Record::of(name, dam, plan.steps, || Split::new(dam, loading, plan.step))
}
