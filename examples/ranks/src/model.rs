//! `ranks model`: what a step in contact costs at sizes that no machine here has, by a model whose constants are
//! measured first, on the ranks that there are.
//!
//! The body is a cube of n dofs of which a tenth of the nodes of one face presses, k = ⅒ (n/3)^⅔ rows. Its factor has
//! c n^{4/3} entries (nested dissection in space: George 1973). A step reads them twice; the reads are spread over the
//! ranks but for the largest separator, n^⅔ dofs, whose triangle is swept by one rank after the other. Messages go up
//! and down a tree of the ranks. Contact is replicated: W is k² numbers on every rank, formed and factorized anew as
//! often as rows join or leave, by blocks of rows.

use crate::bodies::{Blocks, Scene};
use crate::engine::Engine;
use crate::ffi::Input;
use crate::partition::Part;
use crate::share::host;
use crate::solver::{Direct, Way};
use contact_dynamics::faer::linalg::solvers::Llt;
use contact_dynamics::faer::{Mat, Side};
use contact_dynamics::ranks::Ranks;
use contact_dynamics::{LinearSolver, Result};

/// What the machine does, and what a step asks of it.
struct Constants {
    /// Entries of the factor over n^{4/3}.
    fill: f64,
    /// Seconds to sweep forward and backward, an entry of the factor.
    sweep: f64,
    /// Seconds of a sum over two ranks.
    message: f64,
    /// Seconds to send a number through a rank.
    number: f64,
    /// Operations of a dense factorization, a second.
    operations: f64,
    /// Questions to the ranks in a step.
    calls: f64,
}

/// The smallest of some times of a call: what it takes on a machine that does nothing else.
fn least(world: crate::ffi::World, mut call: impl FnMut() -> Result<()>) -> Result<f64> {
    let mut least = f64::INFINITY;
    for _ in 0..20 {
        let start = world.time();
        call()?;
        least = least.min(world.time() - start);
    }
    let mut slowest = [least];
    world.max(&mut slowest).map_err(|failed| host("max", failed))?;
    Ok(slowest[0])
}

fn measure(blocks: &Blocks, part: &Part) -> Result<Constants> {
    const ROWS: usize = 1000;
    let Part { cut, share } = part;
    let world = share.world;
    // The constants of the factor: the matrix of a linear scene.
    let way = Way { input: Input::Distributed, condenses: false };
    let matrix = cut.solid.stiffness::<f64>();
    let shifted = shift(&matrix, 1.0);
    let solver = Direct { share: share.clone(), way, fault: None };
    let mut factor = solver.analyze(shifted.symbolic(), &[])?;
    factor.factorize(shifted.as_ref())?;
    let mut x = vec![1.0; share.known.len()];
    let solve = least(world, || factor.solve(&mut x))?;
    let mut stored = [factor.stored_values() as f64];
    world.max(&mut stored).map_err(|failed| host("max", failed))?;
    // Messages, short and long.
    let mut short = [0.0; 8];
    let message = least(world, || (0..100).try_for_each(|_| share.sum(&mut short)))? / 100.0;
    let mut long = vec![0.0; 100_000];
    let number = (least(world, || share.broadcast(&mut long))? - message).max(0.0) / long.len() as f64;
    // A dense factorization.
    let dense = Mat::from_fn(ROWS, ROWS, |i, j| if i == j { ROWS as f64 } else { 0.5 });
    let mut keep = 0.0;
    let time = least(world, || {
        keep += Llt::new(dense.as_ref(), Side::Lower).map_or(0.0, |factor| factor.L()[(0, 0)]);
        Ok(())
    })?;
    assert!(keep > 0.0);
    // What a step asks of the ranks.
    let mut run = blocks.on_rank(Scene::Linear, part, Engine::CONDENSING)?.build()?;
    share.clock.take();
    let steps = 20;
    (0..steps).try_for_each(|_| run.step())?;
    let calls = share.clock.take().calls / f64::from(steps);
    let n = share.dofs as f64;
    let fill = stored[0] / n.powf(4.0 / 3.0);
    Ok(Constants {
        fill,
        sweep: solve / stored[0] * world.size as f64,
        message,
        number,
        operations: (ROWS as f64).powi(3) / 3.0 / time,
        calls,
    })
}

/// `K + M` with M = c I: a matrix as that of a step.
fn shift(
    k: &contact_dynamics::faer::sparse::SparseColMat<usize, f64>,
    c: f64,
) -> contact_dynamics::faer::sparse::SparseColMat<usize, f64> {
    let mut shifted = k.clone();
    let n = k.ncols();
    for j in 0..n {
        let range = k.col_ptr()[j]..k.col_ptr()[j + 1];
        if let Ok(at) = k.row_idx()[range.clone()].binary_search(&j) {
            shifted.val_mut()[range.start + at] += c;
        }
    }
    shifted
}

/// Seconds of a step: sweeps, messages, the interface, the contact problem; and bytes of W.
fn cost(constants: &Constants, n: f64, ranks: f64) -> [f64; 5] {
    let Constants { fill, sweep, message, number, operations, calls } = *constants;
    let levels = ranks.log2().max(0.0);
    let face = (n / 3.0).powf(2.0 / 3.0);
    let rows = 0.1 * face;
    let top = 0.5 * n.powf(2.0 / 3.0) * n.powf(2.0 / 3.0);
    let entries = fill * n.powf(4.0 / 3.0);
    // (The largest separator is shared by the ranks of a row of their grid.)
    let sweeps = sweep * ((entries - top).max(0.0) / ranks + top / ranks.sqrt());
    let messages = levels * calls * message;
    let interface = levels * 2.0 * 3.0 * face * number;
    // Two changes of the pressed rows in a step.
    let contact = 2.0 * rows.powi(3) / 3.0 / operations;
    [sweeps, messages, interface, contact, 8.0 * rows * rows]
}

/// Prints the constants and the curves.
pub fn print(blocks: &Blocks, part: &Part) -> Result<bool> {
    let constants = measure(blocks, part)?;
    let world = part.share.world;
    if world.rank > 0 {
        return Ok(true);
    }
    println!("Measured over {} ranks, {} dofs:\n", world.size, part.share.dofs);
    println!("| constant | value |");
    println!("| --- | --- |");
    println!("| entries of the factor over n^4/3 | {:.1} |", constants.fill);
    println!("| forward and backward sweep, ns an entry and rank | {:.2} |", 1e9 * constants.sweep);
    println!("| sum over these ranks, µs | {:.1} |", 1e6 * constants.message);
    println!("| number sent, ns | {:.2} |", 1e9 * constants.number);
    println!("| dense factorization, 10⁹ operations a second | {:.1} |", 1e-9 * constants.operations);
    println!("| questions to the ranks, a step | {:.0} |\n", constants.calls);
    println!("| dofs | ranks | pressed rows | sweeps, s | messages, s | interface, s | contact, s | W, GB |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for (n, ranks) in [
        (1e5, 1.0),
        (1e6, 1.0),
        (1e6, 10.0),
        (1e7, 10.0),
        (1e7, 100.0),
        (1e8, 100.0),
        (1e8, 1e3),
        (1e9, 1e3),
        (1e9, 1e4),
    ] {
        let [sweeps, messages, interface, contact, bytes] = cost(&constants, n, ranks);
        let rows = 0.1 * (n / 3.0_f64).powf(2.0 / 3.0);
        println!(
            "| {n:.0e} | {ranks:.0} | {rows:.0} | {sweeps:.1e} | {messages:.1e} | {interface:.1e} | {contact:.1e} | {:.2} |",
            1e-9 * bytes
        );
    }
    Ok(true)
}
