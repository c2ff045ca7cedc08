//! Gradients beside differences of whole runs, in scenes of several kinds.

use contact_dynamics::contact::{Plane, Side, Sphere};
use contact_dynamics::tableau::ContactLevel;
use contact_dynamics::{
    Bathe, CdLagrange, Composite, Error, GeneralizedAlpha, LinearRows, Newmark, NodesOnObstacle, PersistencyCorrection,
    Result, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::frames::Frames;
use contact_dynamics_scenes::gradients::{self, Build};
use contact_dynamics_scenes::ground::{Ground, ricker};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::wall_bar::WallBar;
use std::sync::Arc;

type Scheme = fn() -> Box<dyn TimeIntegrator>;

const SCHEMES: [(&str, Scheme); 5] = [
    ("trapezoidal", || Box::new(Newmark::trapezoidal())),
    ("CH(0.8)", || Box::new(GeneralizedAlpha::default())),
    ("composite", || Box::new(Composite)),
    ("Bathe", || Box::new(Bathe::default())),
    ("CD-Lagrange", || Box::new(CdLagrange)),
];

/// A scene: its name, the size of its gaps, the end of its runs, and its builder by scheme and factors.
type Scene = (&'static str, f64, f64, fn(Scheme, &[f64]) -> Result<Simulation<'static, f64>>);

const SCENES: [Scene; 6] = [
    ("two bars", 0.01, 0.35, bars),
    ("bar on a wall", 5.0, 3.3, wall),
    ("frames that pound", 0.01, 3.0, frames),
    ("StVK block on a plane", 0.1, 0.3, soft_block),
    ("block that slides", 0.1, 0.3, sliding_block),
    ("block on a ball", 0.1, 0.3, block_on_ball),
];

/// Prints the largest relative errors.
pub(crate) fn compare(is_quick: bool) -> Result<()> {
    println!("largest relative error of a derivative by M, K, load, velocity, friction and gap against differences");
    print!("{:<24}", "");
    for (name, _) in SCHEMES {
        print!(" {name:>11}");
    }
    println!();
    for (name, size, end, build) in SCENES.into_iter().take(if is_quick { 1 } else { SCENES.len() }) {
        print!("{name:<24}");
        for (_, scheme) in SCHEMES {
            let build = |at: &[f64]| build(scheme, at);
            let advance = |run: &mut Simulation<'static, f64>| run.run_until(end, &mut ()).map(drop);
            let error = match gradients::compare(&build as &Build<'_>, &advance, (8, size)) {
                Err(Error::Incompatible { .. }) => {
                    print!(" {:>11}", "refused");
                    continue;
                }
                other => other?,
            };
            let kink = error.spread.iter().zip(&error.expected).any(|(&spread, x)| spread > 1e-3 && x.abs() > 1e-6);
            let text = match gradients::largest_error(&error) {
                _ if kink => "kink".to_string(),
                error if error < 1e-9 => "< 1e-9".to_string(),
                error => format!("{error:.0e}"),
            };
            print!(" {text:>11}");
        }
        println!();
    }
    println!();
    Ok(())
}

fn bars(scheme: Scheme, at: &[f64]) -> Result<Simulation<'static, f64>> {
    let bars = Bars::dissimilar(20);
    let bars = Bars {
        young: bars.young.map(|young| young * at[2]),
        density: bars.density.map(|density| density * at[0]),
        velocity: bars.velocity.map(|velocity| velocity * at[4]),
        gap: 1.0137 * bars.gap + at[7],
        ..bars
    };
    Simulation::builder(bars.system(), scheme(), 0.001).velocity(bars.velocities()).constraint(bars.contact()).build()
}

fn wall(scheme: Scheme, at: &[f64]) -> Result<Simulation<'static, f64>> {
    let unvaried = WallBar::bouncing(20);
    let bar = WallBar {
        young: unvaried.young * at[2],
        density: unvaried.density * at[0],
        gravity: unvaried.gravity * at[3] / at[0],
        height: unvaried.height + at[7],
        ..unvaried
    };
    Simulation::builder(bar.system(), scheme(), 0.37 * unvaried.element_size() / unvaried.wave_speed())
        .velocity(vec![-0.1 * at[4]; bar.elements + 1])
        .constraint(bar.contact())
        .build()
}

fn frames(scheme: Scheme, at: &[f64]) -> Result<Simulation<'static, f64>> {
    let mut frames = Frames { damping: 0.0, ..Frames::of_the_study() };
    for frame in &mut frames.frames {
        frame.mass *= at[0];
        frame.stiffness *= at[2];
    }
    let ground = Ground::sampled(0.005, 4.0, ricker(4.0 * at[3] / at[0], 1.0, 1.0));
    let rows = frames
        .pairs()
        .into_iter()
        .fold(LinearRows::new(), |rows, [i, j]| rows.unilateral(&[(i, -1.0), (j, 1.0)], 0.2 * frames.gap + at[7]));
    let velocity = (0..frames.dofs()).map(|dof| 0.01 * at[4] * (dof as f64).cos()).collect();
    Simulation::builder(frames.system(Arc::new(ground))?, scheme(), 0.005).velocity(velocity).constraint(rows).build()
}

/// A block above an inclined plane.
fn block(at: &[f64], friction: f64) -> Result<(Solid<2>, NodesOnObstacle<'static, f64, 2>)> {
    let material = Material { young: 100.0 * at[2], poisson: 0.3, density: at[0] };
    let solid = Solid::<2>::rectangle([1.0, 0.5], [4, 2], material);
    let (s, c) = 0.2_f64.sin_cos();
    let plane = Plane::new([0.0, -0.0231 - at[7] / c], [s, c])?;
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] < 1e-9).collect();
    let contact = NodesOnObstacle::new(plane, &solid.nodes, &solid.node_dofs(), &bottom)?;
    Ok((solid, if friction > 0.0 { contact.friction(friction + at[6]) } else { contact }))
}

fn soft_block(scheme: Scheme, at: &[f64]) -> Result<Simulation<'static, f64>> {
    let (solid, contact) = block(at, 0.0)?;
    let mut system = Hyperelastic::new(&solid, Law::StVenantKirchhoff);
    system.particles.weigh([0.0, -3.0 * at[3] / at[0]]);
    let builder = Simulation::builder(system, scheme(), 0.003).velocity(solid.uniform([0.3 * at[4], -at[4]]));
    builder.constraint(contact).newton(contact_dynamics::Newton::full().tolerances(1e-12, 1e-12)?).build()
}

fn sliding_block(scheme: Scheme, at: &[f64]) -> Result<Simulation<'static, f64>> {
    let (solid, contact) = block(at, 0.1)?;
    let builder = Simulation::builder(solid.system(), scheme(), 0.003);
    builder.velocity(solid.uniform([0.31 * at[4], -at[4]])).constraint(contact).build()
}

fn block_on_ball(scheme: Scheme, at: &[f64]) -> Result<Simulation<'static, f64>> {
    let (solid, _) = block(at, 0.0)?;
    let ball = Sphere::new([0.6, -0.5217], 0.5 - at[7], Side::Outside)?;
    let contact = NodesOnObstacle::new(ball, &solid.nodes, &solid.node_dofs(), &solid.surface_nodes())?;
    let builder = Simulation::builder(solid.system(), scheme(), 0.003);
    let builder = builder.velocity(solid.uniform([0.31 * at[4], -at[4]])).constraint(contact);
    // Rows that turn: no past state is projected.
    if scheme().tableau().stages.iter().all(|stage| stage.contact == ContactLevel::POSITION) {
        return builder.corrector(PersistencyCorrection::new()).build();
    }
    builder.build()
}
