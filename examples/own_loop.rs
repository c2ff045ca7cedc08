//! A host that keeps its own time loop, Newton iteration and solver, and takes three parts from the crate: the table of a
//! scheme, the solver of contact problems, and the correction of velocity and acceleration.
//!
//! Two chains of masses with hardening springs fly at a wall, the second one at the first. `cargo run --release --example
//! own_loop` runs this loop with three schemes, and compares it with `Simulation`.

use contact_dynamics::contact::ContactJacobian;
use contact_dynamics::contact_solver::{Bound, ContactProblem};
use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::tableau::{Row, Stage};
use contact_dynamics::{
    ActiveSet, Composite, ContactSolver, GeneralizedAlpha, JumpProjection, LinearRows, Mass, Newmark, Newton,
    PersistencyCorrection, Result, Simulation, System, TangentWeights, TimeIntegrator,
};
use std::error::Error;

// The host's model: masses 0 to 5 are the first chain, 6 to 11 the second one.

const NODES: usize = 12;
const MASS: [f64; NODES] = [1.0; NODES];
/// Gaps are G u + g0: of the wall on the left, g = u_0 + 0.05, and between the chains, g = u_6 − u_5 + 0.2.
const ROWS: [(&[(usize, f64)], f64); 2] = [(&[(0, 1.0)], 0.05), (&[(5, -1.0), (6, 1.0)], 0.2)];

/// f(u), external minus internal force, and K = −∂f/∂u, of springs with the force 400 (e + 20 e³).
fn springs(u: &[f64]) -> (Vec<f64>, Tridiagonal) {
    let mut f = vec![0.0; NODES];
    let mut k = Tridiagonal { diagonal: vec![0.0; NODES], side: vec![0.0; NODES - 1] };
    for i in (0..NODES - 1).filter(|&i| i != 5) {
        let e = u[i + 1] - u[i];
        let (force, slope) = (400.0 * (e + 20.0 * e.powi(3)), 400.0 * (1.0 + 60.0 * e * e));
        f[i] += force;
        f[i + 1] -= force;
        k.diagonal[i] += slope;
        k.diagonal[i + 1] += slope;
        k.side[i] -= slope;
    }
    (f, k)
}

/// The host's solver: a symmetric matrix, or its L D Lᵀ.
struct Tridiagonal {
    diagonal: Vec<f64>,
    side: Vec<f64>,
}

impl Tridiagonal {
    fn factorize(&mut self) {
        for (i, side) in self.side.iter_mut().enumerate() {
            let l = *side / self.diagonal[i];
            self.diagonal[i + 1] -= l * *side;
            *side = l;
        }
    }

    fn solve(&self, b: &mut [f64]) {
        for (i, l) in self.side.iter().enumerate() {
            b[i + 1] -= l * b[i];
        }
        b.iter_mut().zip(&self.diagonal).for_each(|(b, d)| *b /= d);
        for (i, l) in self.side.iter().enumerate().rev() {
            b[i] -= l * b[i + 1];
        }
    }
}

// The host's loop.

/// u, v, a of a state.
type Motion = [Vec<f64>; 3];

struct Loop {
    h: f64,
    /// The only stage of the scheme, and which values of the past are read again after it.
    stage: Stage,
    read: Vec<[bool; 3]>,
    /// The states that the scheme reads, newest first.
    past: Vec<Motion>,
    g: ContactJacobian<f64>,
    solver: ActiveSet<f64>,
    projection: JumpProjection<f64>,
    /// Of each row of G: multiplier of the last step, force that goes with its accelerations, and whether it is closed.
    raw: Vec<f64>,
    force: Vec<f64>,
    closed: Vec<bool>,
}

fn add(c: f64, x: &[f64], y: &mut [f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += c * x);
}

/// A row of the table at d = 0. Rows are pure numbers over u, h v and h² a and yield one of them: `unit` is 1, h or h².
fn predict(row: &Row, past: &[Motion], h: f64, unit: f64) -> Vec<f64> {
    let mut sum = vec![0.0; NODES];
    for (k, state) in past.iter().enumerate() {
        for ((c, scale), x) in row.past(k).into_iter().zip([1.0, h, h * h]).zip(state) {
            add(c * scale / unit, x, &mut sum);
        }
    }
    sum
}

impl Loop {
    /// Begins in free flight, the past of which is a straight line.
    fn new(scheme: &dyn TimeIntegrator, h: f64, v: &[f64]) -> Result<Self> {
        let table = scheme.tableau();
        let state = |k: usize| [v.iter().map(|v| -(k as f64) * h * v).collect(), v.to_vec(), vec![0.0; NODES]];
        let mut g = ContactJacobian::default();
        ROWS.iter().for_each(|(entries, _)| g.push(entries));
        Ok(Self {
            h,
            // The unknown d is zero where the acceleration row vanishes: rounding is not divided by h².
            stage: table.stages[0].increment(),
            read: table.read_after(0),
            past: (0..table.depth()).map(state).collect(),
            g,
            solver: ActiveSet::default(),
            projection: JumpProjection::new(Mass::Lumped(&MASS), &[], ROWS.len())?,
            raw: vec![0.0; ROWS.len()],
            force: vec![0.0; ROWS.len()],
            closed: vec![false; ROWS.len()],
        })
    }

    fn gap(&self, row: usize, u: &[f64]) -> f64 {
        self.g.product(row, u) + ROWS[row].1
    }

    /// What of a gap is rounding.
    fn rounding(&self, row: usize, u: &[f64]) -> f64 {
        64.0 * f64::EPSILON * (self.g.row(row).map(|(dof, weight)| (weight * u[dof]).abs()).sum::<f64>() + ROWS[row].1)
    }

    fn step(&mut self) -> std::result::Result<(), Box<dyn Error>> {
        let unit = [1.0, self.h, self.h * self.h];
        // The new state, and the state of the balance M ā = f(ū) + Gᵀ λ: both are a prediction and weights times d.
        let (rows, rows_bar) = (self.stage.recovery.each(), self.stage.balance.each());
        let [w, w_bar] = [rows, rows_bar].map(|rows| [0, 1, 2].map(|i: usize| rows[i].z / unit[i]));
        let [mut new, mut bar] =
            [rows, rows_bar].map(|rows| [0, 1, 2].map(|i| predict(&rows[i], &self.past, self.h, unit[i])));
        let (mut whole, mut converged) = (vec![0.0; NODES], false);
        for _ in 0..20 {
            // The effective matrix A = w_ū K + w_v̄/h C + w_ā/h² M, here without C, and the residual f(ū) − M ā.
            let (mut d, mut a) = springs(&bar[0]);
            a.side.iter_mut().for_each(|k| *k *= w_bar[0]);
            for (i, m) in MASS.iter().enumerate() {
                a.diagonal[i] = w_bar[0] * a.diagonal[i] + w_bar[2] * m;
                d[i] -= m * bar[2][i];
            }
            a.factorize();
            a.solve(&mut d);
            // With contact the increment is d + A⁻¹Gᵀ λ, and the gaps at its end are W λ + q with the Delassus operator
            // W = w_u G A⁻¹ Gᵀ: 0 ≤ W λ + q ⊥ λ ≥ 0. λ > 0 is pressure, and acts along Gᵀ, which opens the gap.
            // (Where gaps are curved, G follows the iteration.)
            let mut responses = vec![vec![0.0; NODES]; ROWS.len()];
            let (mut delassus, mut offset, mut tolerance) = (vec![], vec![], vec![]);
            for (i, response) in responses.iter_mut().enumerate() {
                self.g.row(i).for_each(|(dof, weight)| response[dof] = weight);
                a.solve(response);
                delassus.extend((0..ROWS.len()).map(|j| w[0] * self.g.product(j, response)));
                offset.push(self.gap(i, &new[0]) + w[0] * self.g.product(i, &d));
                tolerance.push(self.rounding(i, &new[0]));
            }
            let (delassus, offset, tolerance) = (&delassus, &offset, &tolerance);
            let bounds = &[Bound::NonNegative; ROWS.len()];
            let problem = ContactProblem { delassus, offset, bounds, tolerance, version: 0 };
            self.solver.solve(&problem, &mut self.raw).map_err(|failure| format!("{failure:?}"))?;
            responses.iter().zip(&self.raw).for_each(|(response, &lambda)| add(lambda, response, &mut d));
            for i in 0..3 {
                add(w[i], &d, &mut new[i]);
                add(w_bar[i], &d, &mut bar[i]);
            }
            add(1.0, &d, &mut whole);
            let [size, all] = [&d, &whole].map(|x| x.iter().map(|x| x * x).sum::<f64>());
            converged = size <= 1e-20 * all;
            if converged {
                break;
            }
        }
        if !converged {
            return Err("Newton's method does not converge".into());
        }
        self.correct(&mut new);
        self.past.rotate_right(1);
        self.past[0] = new;
        Ok(())
    }

    /// Makes velocity and acceleration agree with the contact, in this order: damping forces, if there were any, would follow
    /// the new velocity first. S = G M⁻¹ Gᵀ is diagonal here, so one-sided conditions need no contact solver.
    fn correct(&mut self, [u, v, a]: &mut Motion) {
        let was_closed = self.closed.clone();
        // Closed is what is pressed, and what touches: within rounding and a sliver of one step's approach.
        for row in 0..ROWS.len() {
            let sliver = 1e-10 * self.h * self.g.product(row, v).abs();
            self.closed[row] = self.raw[row] > 0.0 || self.gap(row, u) <= self.rounding(row, u) + sliver;
        }
        let Self { stage, read, past, g, projection, raw, force, closed, .. } = self;
        // What touches without pressure and separates is left alone.
        let engages = |row: usize, x: &[f64]| closed[row] && (raw[row] > 0.0 || g.product(row, x) < 0.0);
        let mut project = |rows: &[usize], targets: &[f64], x: &mut [f64]| {
            let mut y = vec![0.0; rows.len()];
            projection.close(g, rows).expect("masses are positive");
            projection.remove_jump(g, targets, x, &mut y);
            y
        };
        let still = [0.0; ROWS.len()];
        // v ← v − M⁻¹Gᵀ S⁻¹ G v
        let engaged: Vec<_> = (0..ROWS.len()).filter(|&row| engages(row, v)).collect();
        project(&engaged, &still, v);
        // a ← a − M⁻¹Gᵀ y with y = S⁻¹ G a. For the balance to hold on, the force becomes p′ = p − w_ā/w_a y; it is the one to
        // report, while p goes on deciding when a contact opens.
        let pulled: Vec<_> = engaged.iter().copied().filter(|&row| engages(row, a)).collect();
        let y = project(&pulled, &still, a);
        force.copy_from_slice(raw);
        pulled.iter().zip(y).for_each(|(&row, y)| force[row] -= stage.balance.a.z / stage.recovery.a.z * y);
        // Multistep schemes go on reading states in which a contact that has just closed was still approaching: those are
        // closed and stopped too. G u = −g0 is a gap of zero.
        if engaged.iter().any(|&row| !was_closed[row]) {
            let closing: Vec<_> = engaged.iter().map(|&row| -ROWS[row].1).collect();
            for (state, read) in past.iter_mut().zip(&read[1..]) {
                for (field, x) in state.iter_mut().enumerate().filter(|&(field, _)| read[field]) {
                    project(&engaged, if field == 0 { &closing } else { &still }, x);
                }
            }
        }
    }
}

// The comparison.

/// The model as `Simulation` takes it, all entries of K in its pattern.
struct Chains(SymbolicSparseColMat<usize>);

impl System<f64> for Chains {
    fn dofs(&self) -> usize {
        NODES
    }

    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&MASS)
    }

    fn force(&mut self, _: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&springs(u).0);
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.0.as_ref()
    }

    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        let (_, k) = springs(u);
        out.fill(0.0);
        for (i, k) in k.diagonal.iter().enumerate() {
            out[i * (NODES + 1)] = weights.stiffness * k;
        }
        for (i, k) in k.side.iter().enumerate() {
            out[i * (NODES + 1) + 1] = weights.stiffness * k;
            out[(i + 1) * (NODES + 1) - 1] = weights.stiffness * k;
        }
        Ok(())
    }
}

fn main() -> std::result::Result<(), Box<dyn Error>> {
    let steps = if std::env::args().any(|argument| argument == "--quick") { 200 } else { 400 };
    let (h, v) = (0.005, [[-1.0; 6], [-3.0; 6]].concat());
    println!("| scheme | steps in contact | largest force | difference in u | in v | in force |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let damped = GeneralizedAlpha::chung_hulbert(0.8)?;
    let schemes: [&dyn Fn() -> Box<dyn TimeIntegrator>; 3] =
        [&|| Box::new(Newmark::trapezoidal()), &|| Box::new(Composite), &|| Box::new(damped)];
    for scheme in schemes {
        let mut own = Loop::new(&*scheme(), h, &v)?;
        let pointers = (0..=NODES).map(|column| NODES * column).collect();
        let pattern = (0..NODES * NODES).map(|place| place % NODES).collect();
        let chains = Chains(SymbolicSparseColMat::new_checked(NODES, NODES, pointers, None, pattern));
        let rows = ROWS.iter().fold(LinearRows::new(), |rows, (entries, gap)| rows.unilateral(entries, *gap));
        let mut run = Simulation::builder(chains, scheme(), h)
            .velocity(v.clone())
            .constraint(rows)
            .corrector(PersistencyCorrection::with_history_projection())
            .newton(Newton::full().tolerances(1e-13, 1e-12)?)
            .build()?;
        let (mut largest, mut difference, mut pressed) = ([0.0_f64; 3], [0.0_f64; 3], 0);
        for _ in 0..steps {
            own.step()?;
            run.step()?;
            let (state, contacts) = (run.state(), run.state().contacts());
            let theirs = [state.displacement(), state.stored_velocity(), contacts.forces()];
            for (i, own) in [&own.past[0][0], &own.past[0][1], &own.force].into_iter().enumerate() {
                for (own, theirs) in own.iter().zip(theirs[i]) {
                    largest[i] = largest[i].max(theirs.abs());
                    difference[i] = difference[i].max((own - theirs).abs());
                }
            }
            pressed += usize::from(own.raw.iter().any(|&raw| raw > 0.0));
        }
        let [u, v, force] = [0, 1, 2].map(|i| difference[i] / largest[i]);
        println!("| {} | {pressed} | {:.1} | {u:.0e} | {v:.0e} | {force:.0e} |", scheme().name(), largest[2]);
        assert!(pressed > 20 && u.max(v).max(force) < 1e-10, "the loop and the simulation disagree");
    }
    Ok(())
}
