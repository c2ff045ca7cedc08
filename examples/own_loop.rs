//! A host that keeps its own time loop, Newton iteration and solver, and takes three parts from the crate: the table of
//! a scheme, the solver of contact problems, and the correction of velocity and acceleration.
//!
//! Two chains of masses with hardening springs fly at a wall, the second one at the first.
//! `cargo run --release --example own_loop` runs this loop with three schemes, and compares it with `Simulation`.

use contact_dynamics::contact::ContactJacobian;
use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem};
use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::tableau::{Row, Stage};
use contact_dynamics::{
    ActiveSet, Composite, ContactSolver, GeneralizedAlpha, JumpProjection, LinearRows, Mass, Newmark, Newton,
    PersistencyCorrection, Result, Simulation, System, TangentWeights, TimeIntegrator,
};
use std::error::Error;

/// The host's model: masses 0 to 5 are the first chain, 6 to 11 the second one.
const NODES: usize = 12;
const MASS: [f64; NODES] = [1.0; NODES];
/// Gaps are G u + g0: of the wall on the left, g = u_0 + 0.05, and between the chains, g = u_6 − u_5 + 0.2.
const ROWS: [(&[(usize, f64)], f64); 2] = [(&[(0, 1.0)], 0.05), (&[(5, -1.0), (6, 1.0)], 0.2)];
/// What of a gap is rounding, where displacements are of order 1.
const ROUNDING: f64 = 1e-14;

/// f(u), external minus internal force, of springs with the force 400 (e + 20 e³), and K = −∂f/∂u. K is tridiagonal;
/// its columns one after another are K_00, K_10, K_01, K_11, K_21, K_12, K_22 …
fn springs(u: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut f, mut k) = (vec![0.0; NODES], vec![0.0; 3 * NODES - 2]);
    for i in (0..NODES - 1).filter(|&i| i != 5) {
        let e = u[i + 1] - u[i];
        let (force, slope) = (400.0 * (e + 20.0 * e.powi(3)), 400.0 * (1.0 + 60.0 * e * e));
        f[i] += force;
        f[i + 1] -= force;
        for (entry, sign) in k[3 * i..].iter_mut().zip([1.0, -1.0, -1.0, 1.0]) {
            *entry += sign * slope;
        }
    }
    (f, k)
}

/// The host's solver: makes L D Lᵀ of such a matrix.
fn factorize(a: &mut [f64]) {
    for i in (0..a.len() - 1).step_by(3) {
        let l = a[i + 1] / a[i];
        a[i + 3] -= l * a[i + 1];
        a[i + 1] = l;
    }
}

fn solve(a: &[f64], b: &mut [f64]) {
    for i in 1..NODES {
        b[i] -= a[3 * i - 2] * b[i - 1];
    }
    b[NODES - 1] /= a[3 * NODES - 3];
    for i in (0..NODES - 1).rev() {
        b[i] = b[i] / a[3 * i] - a[3 * i + 1] * b[i + 1];
    }
}

/// u, v, a of a state, in the host's loop.
type Motion = [Vec<f64>; 3];

struct Loop {
    h: f64,
    /// The only stage of the scheme.
    stage: Stage,
    /// The states that the scheme reads, newest first.
    past: Vec<Motion>,
    g: ContactJacobian<f64>,
    solver: ActiveSet<f64>,
    projection: JumpProjection<f64>,
    /// Multipliers of the rows of G, and the forces that go with the corrected accelerations.
    raw: [f64; ROWS.len()],
    force: [f64; ROWS.len()],
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
        for (entries, _) in ROWS {
            g.push(entries);
        }
        Ok(Self {
            h,
            // The unknown d is zero where the acceleration row vanishes: rounding is not divided by h².
            stage: table.stages[0].increment(),
            past: (0..table.depth()).map(state).collect(),
            g,
            solver: ActiveSet::default(),
            projection: JumpProjection::new(Mass::Lumped(&MASS), &[])?,
            raw: [0.0; ROWS.len()],
            force: [0.0; ROWS.len()],
        })
    }

    fn step(&mut self) -> std::result::Result<(), Box<dyn Error>> {
        let unit = [1.0, self.h, self.h * self.h];
        // The new state, and the state of the balance M ā = f(ū) + Gᵀ λ: both are a prediction and weights times d.
        let (rows, rows_bar) = (self.stage.recovery.each(), self.stage.balance.each());
        let [w, w_bar] = [rows, rows_bar].map(|rows| [0, 1, 2].map(|i: usize| rows[i].z / unit[i]));
        let [mut new, mut bar] =
            [rows, rows_bar].map(|rows| [0, 1, 2].map(|i| predict(&rows[i], &self.past, self.h, unit[i])));
        for _ in 0..20 {
            // The effective matrix A = w_ū K + w_v̄/h C + w_ā/h² M, here without C, and the residual f(ū) − M ā.
            let (mut d, k) = springs(&bar[0]);
            let mut a: Vec<_> = k.iter().map(|k| w_bar[0] * k).collect();
            for (i, m) in MASS.iter().enumerate() {
                a[3 * i] += w_bar[2] * m;
                d[i] -= m * bar[2][i];
            }
            factorize(&mut a);
            solve(&a, &mut d);
            // With contact the increment is d + A⁻¹Gᵀ λ, and the gaps at its end are W λ + q with the Delassus operator
            // W = w_u G A⁻¹ Gᵀ: 0 ≤ W λ + q ⊥ λ ≥ 0. λ > 0 is pressure, and acts along Gᵀ, which opens the gap.
            // (Where gaps are curved, G follows the iteration.)
            let mut responses = vec![vec![0.0; NODES]; ROWS.len()];
            let (mut delassus, mut offset) = (vec![], vec![]);
            for (i, response) in responses.iter_mut().enumerate() {
                self.g.row(i).for_each(|(dof, weight)| response[dof] = weight);
                solve(&a, response);
                delassus.extend((0..ROWS.len()).map(|j| w[0] * self.g.product(j, response)));
                offset.push(self.g.product(i, &new[0]) + w[0] * self.g.product(i, &d) + ROWS[i].1);
            }
            let (delassus, offset) = (&delassus, &offset);
            let (sets, tolerance) = (&[AdmissibleSet::NonNegative; ROWS.len()], &[ROUNDING; ROWS.len()]);
            let problem = ContactProblem::new(delassus, offset, sets, tolerance).unwrap();
            // Multipliers of the iteration before are the guess.
            self.solver.solve(&problem, &mut self.raw)?;
            responses.iter().zip(&self.raw).for_each(|(response, &lambda)| add(lambda, response, &mut d));
            for i in 0..3 {
                add(w[i], &d, &mut new[i]);
                add(w_bar[i], &d, &mut bar[i]);
            }
            if d.iter().all(|d| d.abs() < ROUNDING) {
                self.correct(&mut new);
                self.past.rotate_right(1);
                self.past[0] = new;
                return Ok(());
            }
        }
        Err("Newton's method does not converge".into())
    }

    /// Makes velocity and acceleration agree with the contact, in this order: damping forces, if there were any, would
    /// follow the new velocity first. S = G M⁻¹ Gᵀ is diagonal here, so one-sided conditions need no contact solver.
    ///
    /// (Where a contact closes, multistep schemes want what `Tableau::read_after` names of the past projected as well.)
    fn correct(&mut self, [u, v, a]: &mut Motion) {
        // Closed is what is pressed, and what touches: within rounding and a sliver of one step's approach. Of the
        // latter, what separates is left alone.
        let Self { h, stage, g, projection, raw, force, .. } = self;
        let touches = |row| g.product(row, u) + ROWS[row].1 <= ROUNDING + 1e-10 * *h * g.product(row, v).abs();
        let closed: Vec<_> = (0..ROWS.len()).filter(|&row| raw[row] > 0.0 || touches(row)).collect();
        let mut project = |rows: Vec<usize>, x: &mut [f64]| {
            let rows: Vec<_> = rows.into_iter().filter(|&row| raw[row] > 0.0 || g.product(row, x) < 0.0).collect();
            let (still, mut y) = (vec![0.0; rows.len()], vec![0.0; rows.len()]);
            projection.close(g, &rows).expect("masses are positive");
            projection.remove_jump(g, &still, x, &mut y).expect("one entry a row");
            (rows, y)
        };
        // v ← v − M⁻¹Gᵀ S⁻¹ G v, and then a ← a − M⁻¹Gᵀ y with y = S⁻¹ G a.
        let (engaged, _) = project(closed, v);
        let (engaged, y) = project(engaged, a);
        // With that the balance holds for the force p′ = p − w_ā/w_a y, which is reported; p decides when a contact
        // opens.
        *force = *raw;
        for (row, y) in engaged.into_iter().zip(y) {
            force[row] -= stage.balance.a.z / stage.recovery.a.z * y;
        }
    }
}

/// The model as `Simulation` takes it, for the comparison.
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
        out.iter_mut().zip(springs(u).1).for_each(|(out, k)| *out = weights.stiffness * k);
        Ok(())
    }
}

fn main() -> std::result::Result<(), Box<dyn Error>> {
    let (h, v) = (0.005, [[-1.0; 6], [-3.0; 6]].concat());
    println!(
        "| scheme | steps in contact | largest force | difference in u | in v | in force |\n|{}",
        " --- |".repeat(6)
    );
    let damped = GeneralizedAlpha::chung_hulbert(0.8)?;
    let schemes: [&dyn Fn() -> Box<dyn TimeIntegrator>; 3] =
        [&|| Box::new(Newmark::trapezoidal()), &|| Box::new(Composite), &|| Box::new(damped)];
    for scheme in schemes {
        let mut own = Loop::new(&*scheme(), h, &v)?;
        let rows = (0..NODES).flat_map(|j| j.saturating_sub(1)..NODES.min(j + 2)).collect();
        let pointers = (0..=NODES).map(|j| (3 * j).saturating_sub(1).min(3 * NODES - 2)).collect();
        let chains = Chains(SymbolicSparseColMat::new_checked(NODES, NODES, pointers, None, rows));
        let rows = ROWS.iter().fold(LinearRows::new(), |rows, (entries, gap)| rows.unilateral(entries, *gap));
        let mut run = Simulation::builder(chains, scheme(), h)
            .velocity(v.clone())
            .constraint(rows)
            .corrector(PersistencyCorrection::new())
            .newton(Newton::full().tolerances(1e-13, 1e-12)?)
            .build()?;
        let (mut largest, mut difference, mut pressed) = ([0.0_f64; 3], [0.0_f64; 3], 0);
        for _ in 0..400 {
            own.step()?;
            run.step()?;
            let (state, theirs) = (run.state(), run.state().contacts().forces());
            let [u, v, _] = &own.past[0];
            let pairs = [(&u[..], state.displacement()), (&v[..], state.stored_velocity()), (&own.force[..], theirs)];
            for (i, (own, theirs)) in pairs.into_iter().enumerate() {
                for (own, theirs) in own.iter().zip(theirs) {
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
