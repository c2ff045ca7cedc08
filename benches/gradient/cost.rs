//! Cost of a gradient beside the run that it belongs to: recorded steps, steps back, and steps back by checkpoints.

use contact_dynamics::contact::Plane;
use contact_dynamics::gradient::{RecordedStep, Scales, Seed};
use contact_dynamics::{GeneralizedAlpha, NodesOnObstacle, Result, Simulation};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{Arguments, median};
use std::time::Instant;

type Build = Box<dyn Fn() -> Result<Simulation<'static, f64>>>;

/// Measures two bars, and blocks of so many elements a side.
pub(crate) fn measure(arguments: &Arguments) -> Result<()> {
    println!("ratios to a step that is not recorded; a step back includes derivatives by M, C, K and F");
    println!(
        "{:<30} {:>7} {:>6} {:>6} {:>9} {:>9} {:>7} {:>12}",
        "scene", "dofs", "closed", "steps", "step, µs", "recorded", "back", "checkpoints"
    );
    let samples = arguments.repeated(5);
    for elements in if arguments.quick { vec![10] } else { vec![100, 400] } {
        let bars = Bars::paper(elements);
        let h = bars.element_size(0) / 100.0;
        let build = move || {
            let builder = Simulation::builder(bars.system(), GeneralizedAlpha::default(), h);
            builder.velocity(bars.velocities()).constraint(bars.contact()).build()
        };
        row(&format!("two bars of {elements}"), &(Box::new(build) as Build), (3 * elements, samples))?;
    }
    for &cells in &arguments.sizes {
        row(&format!("block of {cells}³ on a plane"), &block(cells, None), (40, samples))?;
        if cells <= 10 {
            row("the same, St. Venant–Kirchhoff", &block(cells, Some(Law::StVenantKirchhoff)), (20, samples))?;
        }
    }
    Ok(())
}

/// A block that lands on a plane with all nodes of a side at once.
fn block(cells: usize, law: Option<Law>) -> Build {
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let solid = Solid::block([1.0; 3], [cells; 3], material);
    let h = 1.0 / cells as f64 / material.wave_speed();
    Box::new(move || {
        let nodes: Vec<usize> = solid.surface_nodes().into_iter().filter(|&node| solid.nodes[node][2] == 0.0).collect();
        let floor = Plane::new([0.0, 0.0, -0.01 * h], [0.0, 0.0, 1.0])?;
        let contact = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &nodes)?;
        let velocity = solid.uniform([0.0, 0.0, -0.01]);
        let builder = match law {
            None => Simulation::builder(solid.system(), GeneralizedAlpha::default(), h),
            Some(law) => Simulation::builder(Hyperelastic::new(&solid, law), GeneralizedAlpha::default(), h),
        };
        builder.velocity(velocity).constraint(contact).build()
    })
}

fn row(name: &str, build: &Build, (steps, samples): (usize, usize)) -> Result<()> {
    let mut times = [const { Vec::new() }; 4];
    let (mut dofs, mut closed) = (0, 0);
    for _ in 0..samples {
        let timed = |run: &mut dyn FnMut() -> Result<()>| {
            let start = Instant::now();
            run()?;
            Ok::<_, contact_dynamics::Error>(start.elapsed().as_secs_f64() / steps as f64)
        };
        let advance = |run: &mut Simulation<'_, f64>| (0..steps).try_for_each(|_| run.step());
        let back = |run: &mut Simulation<'_, f64>| run.gradient(&mut objective, &mut Scales::default()).map(drop);
        let (mut plain, mut recorded, mut saving) = (build()?, build()?, build()?);
        recorded.record()?;
        saving.record_checkpoints()?;
        times[0].push(timed(&mut || advance(&mut plain))?);
        times[1].push(timed(&mut || advance(&mut recorded))?);
        times[2].push(timed(&mut || back(&mut recorded))?);
        advance(&mut saving)?;
        times[3].push(timed(&mut || back(&mut saving))?);
        dofs = plain.system().dofs();
        closed = closed.max(recorded.state().contacts().closed().iter().filter(|closed| **closed).count());
    }
    let [plain, recorded, back, saving] = times.map(|times| median(&times));
    println!(
        "{name:<30} {dofs:>7} {closed:>6} {steps:>6} {:>9.1} {:>9.2} {:>7.2} {:>12.2}",
        plain * 1e6,
        recorded / plain,
        back / plain,
        saving / plain
    );
    Ok(())
}

/// ½ Σ h F².
fn objective(step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>) -> f64 {
    let force = step.state.contacts().forces();
    seed.force.iter_mut().zip(force).for_each(|(seed, force)| *seed += step.h * force);
    0.5 * step.h * force.iter().map(|force| force * force).sum::<f64>()
}
