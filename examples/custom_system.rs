//! A model of one's own: a truss at large displacements, thrown at a floor.
//!
//! `cargo run --release --example custom_system` prints what `verify::tangent` says of the model, a table over time,
//! what must hold of the run, and what `verify::tangent` says of a mistake; with `--quick` it stops after the first
//! impact.
//!
//! First comes the model, which knows nothing of time steps and contact, then its input, then the run.

use contact_dynamics::contact::Plane;
use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{
    EnergyMomentum, Error, Mass, Newton, NodesOnObstacle, Result, Simulation, StepControl, System, TangentWeights,
    verify,
};

/// Bars between point masses in the plane. Node i has the dofs 2i (x) and 2i + 1 (y).
struct Truss {
    /// Where the nodes are at u = 0.
    nodes: Vec<[f64; 2]>,
    /// The two nodes of each bar.
    bars: Vec<[usize; 2]>,
    /// EA of all bars.
    axial: f64,
    /// One entry a dof.
    mass: Vec<f64>,
    weight: Vec<f64>,
    /// Share of the geometric stiffness in the tangent: 1, or the mistake that is shown at the end.
    geometric: f64,
    pattern: SymbolicSparseColMat<usize>,
}

impl Truss {
    /// Length L, present vector x from one end to the other, and Green–Lagrange strain e = (x² − L²)/(2 L²) of a bar.
    fn bar(&self, [i, j]: [usize; 2], u: &[f64]) -> (f64, [f64; 2], f64) {
        let vector: [f64; 2] = std::array::from_fn(|k| self.nodes[j][k] - self.nodes[i][k]);
        let x: [f64; 2] = std::array::from_fn(|k| vector[k] + u[2 * j + k] - u[2 * i + k]);
        let [square, now] = [vector, x].map(|x| x[0] * x[0] + x[1] * x[1]);
        (square.sqrt(), x, (now - square) / (2.0 * square))
    }

    /// Where an entry of the tangent is in the order of the pattern.
    fn place(&self, row: usize, column: usize) -> usize {
        let start = self.pattern.col_ptr()[column];
        let rows = self.pattern.as_ref().row_idx_of_col_raw(column);
        start + rows.binary_search(&row).expect("every bar is in the pattern")
    }
}

/// Five methods are the model; the last two say what its energies are, which `EnergyMomentum` reads.
impl System<f64> for Truss {
    fn dofs(&self) -> usize {
        self.mass.len()
    }

    fn mass(&self) -> Mass<'_, f64> {
        Mass::Lumped(&self.mass)
    }

    /// External minus internal force. The internal force of a bar is ∂/∂u of ½ EA L e², N x/L on its ends with N = EA
    /// e.
    fn force(&mut self, _t: f64, u: &[f64], _v: &[f64], out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.weight);
        for &[i, j] in &self.bars {
            let (length, x, strain) = self.bar([i, j], u);
            // Below 1/√3 of its length such a bar gives way: no state that a step should pass through.
            if strain <= -1.0 / 3.0 {
                let source = format!("the bar of nodes {i} and {j} has the strain {strain:.3}").into();
                return Err(Error::Inadmissible { callback: "force", source });
            }
            for k in 0..2 {
                let pull = self.axial * strain / length * x[k];
                out[2 * i + k] += pull;
                out[2 * j + k] -= pull;
            }
        }
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }

    /// K = −∂f/∂u: EA/L³ x xᵀ + N/L 1 of each bar, with the signs of its ends. There is no damping.
    fn tangent(&mut self, _t: f64, u: &[f64], _v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        for &ends in &self.bars {
            let (length, x, strain) = self.bar(ends, u);
            for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let sign = if a == b { w.stiffness } else { -w.stiffness };
                for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let geometric = if row == column { self.geometric * self.axial * strain / length } else { 0.0 };
                    let material = self.axial / length.powi(3) * x[row] * x[column];
                    let place = self.place(2 * ends[a] + row, 2 * ends[b] + column);
                    out[place] += sign * (material + geometric);
                }
            }
        }
        Ok(())
    }

    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        let energy = |(length, _, strain): (f64, [f64; 2], f64)| 0.5 * self.axial * length * strain * strain;
        Some(self.bars.iter().map(|&ends| energy(self.bar(ends, u))).sum())
    }

    fn external_load(&mut self, _t: f64, out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.weight);
        Ok(())
    }
}

/// Of a node.
const MASS: f64 = 1.0;
const GRAVITY: f64 = 9.81;

/// A girder of four square bays of 1 m with crossed diagonals, soft (EA = 2 kN), lifted by 1.5 m and turned by 0.6.
fn girder() -> Truss {
    let bays = 4_usize;
    let (sin, cos) = 0.6_f64.sin_cos();
    let turned = |x: f64, y: f64| [cos * x - sin * y, 1.5 + sin * x + cos * y];
    let nodes: Vec<_> = (0..=bays).flat_map(|i| [turned(i as f64, 0.0), turned(i as f64, 1.0)]).collect();
    let mut bars = vec![[0, 1]];
    for i in (0..2 * bays).step_by(2) {
        bars.extend([[i, i + 2], [i + 1, i + 3], [i, i + 3], [i + 1, i + 2], [i + 2, i + 3]]);
    }
    // The entries (column, row) that bars make, ascending: a block for each pair of ends.
    let mut entries: Vec<_> = bars
        .iter()
        .flat_map(|&[i, j]| [(i, i), (i, j), (j, i), (j, j)])
        .flat_map(|(a, b)| [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(k, l)| (2 * a + k, 2 * b + l)))
        .collect();
    entries.sort_unstable();
    entries.dedup();
    let dofs = 2 * nodes.len();
    let pointers = (0..=dofs).map(|column| entries.partition_point(|entry| entry.0 < column)).collect();
    let rows = entries.iter().map(|entry| entry.1).collect();
    let pattern = SymbolicSparseColMat::new_checked(dofs, dofs, pointers, None, rows);
    let weight = (0..dofs).map(|dof| if dof % 2 == 1 { -MASS * GRAVITY } else { 0.0 }).collect();
    Truss { nodes, bars, axial: 2000.0, mass: vec![MASS; dofs], weight, geometric: 1.0, pattern }
}

/// Prints the entry of K that is farthest from a difference quotient of the force; returns the worst of all errors.
fn report(truss: &mut Truss) -> Result<f64> {
    // A state with strains: much of a wrong tangent vanishes where there are none.
    let u: Vec<_> = (0..truss.dofs()).map(|dof| 0.1 * (1.7 * dof as f64).sin()).collect();
    let error = verify::tangent(truss, 0.0, &u, &vec![1.0; u.len()], 1e-6, 1e-6)?;
    let k = error.stiffness;
    println!(
        "verify::tangent: worst entry of K ({}, {}), given {:.3}, expected {:.3}, relative error {:.0e}",
        k.row, k.column, k.given, k.expected, k.relative
    );
    Ok(error.largest())
}

fn main() -> Result<()> {
    let end = if std::env::args().any(|argument| argument == "--quick") { 0.8 } else { 1.6 };
    let mut truss = girder();
    // The potential and the load were compared too: `largest` knows of them.
    assert!(report(&mut truss)? < 1e-8);

    let (nodes, count) = (truss.nodes.clone(), truss.nodes.len());
    let node_dofs: Vec<_> = (0..count).map(|node| [2 * node, 2 * node + 1]).collect();
    let floor = Plane::new([0.0, 0.0], [0.0, 1.0])?;
    // Thrown to the right, turning with 1 rad/s about the first node.
    let velocity = nodes.iter().flat_map(|[x, y]| [3.0 - (y - nodes[0][1]), x - nodes[0][0]]).collect();
    let h = 0.01;
    // This scheme keeps energy at any step size: what is lost, contact has taken. `Composite` or `Newmark` fit here as
    // well; they change it a little in every step, and the last assertion below does not hold for them.
    let mut run = Simulation::builder(&mut truss, EnergyMomentum, h)
        .velocity(velocity)
        .constraint(NodesOnObstacle::new(floor, &nodes, &node_dofs, &(0..count).collect::<Vec<_>>())?)
        .newton(Newton::full().tolerances(1e-12, 1e-11)?)
        // Steps that fail are halved, and those in which a node that lands is uncertain by more than 1 mm.
        .step_control(StepControl::halving(h / 64.0)?.local_error(1e-3)?)
        .build()?;

    let up: Vec<_> = (0..2 * count).map(|dof| f64::from(u8::from(dof % 2 == 1))).collect();
    let along: Vec<_> = up.iter().map(|up| 1.0 - up).collect();
    let momentum = [run.momentum(&along)?, run.momentum(&up)?];
    let height = |u: &[f64]| (0..count).map(|node| nodes[node][1] + u[2 * node + 1]).sum::<f64>() / count as f64;
    let weight = MASS * count as f64 * GRAVITY;
    let start = run.energy().total() + weight * height(run.state().displacement());
    let (mut energy, mut drift, mut landings, mut impulse) = (start, 0.0_f64, 0.0, 0.0);
    let (mut next, mut iterations) = (0.1, 0);
    println!("\n|     t |      h | height | energy | force | landed | iterations |");
    println!("| ----: | -----: | -----: | -----: | ----: | -----: | ---------: |");
    while run.time() < end - 1e-9 {
        let (t, v) = (run.time(), run.state().velocity().to_vec());
        let closed = run.state().contacts().closed().to_vec();
        run.step()?;
        let contacts = run.state().contacts();
        let landed: Vec<_> = (0..count).filter(|&node| contacts.closed()[node] && !closed[node]).collect();
        // Persistent contact is a plastic impact of the mass that lands: that much energy, and no more, is lost.
        landings += landed.iter().map(|node| 0.5 * MASS * v[2 * node + 1].powi(2)).sum::<f64>();
        impulse += contacts.impulses().iter().sum::<f64>();
        // Where a node has just landed this may be a pull: it is what keeps the contact closed; raw forces decide
        // release.
        let force: f64 = contacts.forces().iter().sum();
        let height = height(run.state().displacement());
        let before = std::mem::replace(&mut energy, run.energy().total() + weight * height);
        if landed.is_empty() {
            drift = drift.max((energy - before).abs());
        }
        if !landed.is_empty() || run.time() > next - 1e-9 {
            let landed = if landed.is_empty() { String::new() } else { format!("{landed:?}") };
            let (t, h, sum) = (run.time(), run.time() - t, run.statistics().newton_iterations);
            println!(
                "| {t:5.3} | {h:6.4} | {height:6.3} | {energy:6.2} | {force:5.0} | {landed:>6} | {:10} |",
                sum - iterations
            );
            iterations = sum;
            if t > next - 1e-9 {
                next += 0.1;
            }
        }
    }

    // What must hold, whatever the mesh and the step.
    let [sideways, upward] = [run.momentum(&along)? - momentum[0], run.momentum(&up)? - momentum[1]];
    let balance = upward + weight * run.time() - impulse;
    let statistics = run.statistics();
    println!(
        "\n{} steps, {} refused, {:.1} iterations a step\n\
         momentum: {balance:.0e} of {impulse:.1} N s is not the impulse of weight and floor, {sideways:.0e} sideways\n\
         energy: {:.3} J lost, ½ m v² of the nodes that landed {landings:.3} J; {drift:.0e} J in all other steps",
        statistics.steps,
        statistics.refused_steps,
        statistics.newton_iterations as f64 / statistics.steps as f64,
        start - energy,
    );
    assert!(balance.abs() < 1e-9 * impulse && sideways.abs() < 1e-9 * impulse);
    assert!(drift < 1e-8 * start && ((start - energy) / landings - 1.0).abs() < 0.02);
    drop(run);

    println!("\nThe same with N/L forgotten in the tangent:");
    truss.geometric = 0.0;
    assert!(report(&mut truss)? > 0.01);
    Ok(())
}
