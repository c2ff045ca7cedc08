//! Steps with few and many pressed contacts beside the bare solve: a thick plate on a floor, whose normals stay, and on
//! a large ball that slides under it, whose normals turn in every step.

use contact_dynamics::contact::{NodesOnObstacle, Side, Sphere};
use contact_dynamics::{ContactConstraint, LinearRows, Newmark, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments, Ratio, Table, Unit};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

const RATIOS: &[Ratio] = &[
    Ratio { heading: "/ bare solve", to: &["bare solve, free order"] },
    Ratio { heading: "/ its own solve", to: &["bare solve, contact last"] },
    Ratio { heading: "/ open step", to: &["step, open"] },
];

/// Elements of the plate.
const CELLS: [usize; 3] = [60, 60, 4];
const SIZE: [f64; 3] = [15.0, 15.0, 1.0];

/// Radius of the ball.
const RADIUS: f64 = 1e3;

/// Steps before the measurement: the first contact is behind then.
const SETTLING: usize = 4;

pub(crate) fn measure(arguments: &Arguments) {
    let (plate, cells, h) = plate(arguments);
    println!("plate of {cells:?} elements, {} dofs, trapezoidal rule, Courant number 1, corrected", plate.dofs());
    let sides: &[usize] = if arguments.quick { &[3, 5] } else { &[10, 20, 30, 40, 60] };
    for &side in sides {
        let nodes = patch(&plate, cells, side);
        row(&plate, &nodes, h, arguments);
    }
}

/// The plate, its elements, and a step of Courant number 1.
pub(super) fn plate(arguments: &Arguments) -> (Solid<3>, [usize; 3], f64) {
    let cells = if arguments.quick { [10, 10, 1] } else { CELLS };
    (Solid::block(SIZE, cells, MATERIAL), cells, SIZE[0] / cells[0] as f64 / MATERIAL.wave_speed())
}

/// Nodes at the bottom: a square of so many a side in the middle.
pub(super) fn patch(plate: &Solid<3>, cells: [usize; 3], side: usize) -> Vec<usize> {
    let width = |axis: usize| SIZE[axis] / cells[axis] as f64;
    let first = |axis: usize| (cells[axis] + 1 - side) / 2;
    let inside = |node: &usize| {
        let x = plate.nodes[*node];
        let among = |axis: usize| {
            let cell = x[axis] / width(axis) - first(axis) as f64;
            (-0.5..side as f64 - 0.5).contains(&cell)
        };
        x[2] == 0.0 && (0..2).all(among)
    };
    (0..plate.nodes.len()).filter(inside).collect()
}

fn row(plate: &Solid<3>, nodes: &[usize], h: f64, arguments: &Arguments) {
    let vertical: Vec<usize> = nodes.iter().map(|&node| Solid::<3>::dof(node, 2)).collect();
    let all: Vec<usize> = nodes.iter().flat_map(|&node| (0..3).map(move |axis| Solid::<3>::dof(node, axis))).collect();
    for (kind, last) in [("fixed normals", &vertical), ("turning normals", &all)] {
        let mut table = Table::new(Unit::Milli, RATIOS);
        let a = timing::effective(&plate.stiffness::<f64>(), &plate.lumped_mass(), &Newmark::trapezoidal(), h);
        for (name, last) in [("bare solve, free order", &[][..]), ("bare solve, contact last", last)] {
            table.row(name, timing::solve(timing::factor(&a, last), plate.dofs()));
        }
        drop(a);
        for (name, height) in [("step, open", 1e3), ("step, pressed", 0.0)] {
            let rest = vec![0.0; plate.dofs()];
            let mut run = match kind {
                "fixed normals" => simulation(plate, floor_at(vertical.iter().map(|&dof| (dof, height))), h, rest),
                _ => simulation(plate, ball(plate, nodes, height), h, rest),
            };
            for _ in 0..SETTLING {
                run.step().expect("a well-posed step");
            }
            let closed = run.state().contacts().closed().iter().filter(|&&closed| closed).count();
            table.row(format!("{name}: {closed} of {} closed", nodes.len()), move || {
                run.step().expect("a well-posed step");
            });
        }
        println!("{kind}");
        table.sample(arguments.repeated(7), 1);
        table.print();
        println!();
    }
}

/// A floor below some dofs, as far as is given with each.
pub(super) fn floor_at(dofs: impl Iterator<Item = (usize, f64)>) -> LinearRows<'static, f64> {
    dofs.fold(LinearRows::new(), |rows, (dof, gap)| rows.unilateral(&[(dof, 1.0)], gap))
}

/// Nodes that stand on a ball, which begins to slide.
fn ball(plate: &Solid<3>, nodes: &[usize], height: f64) -> NodesOnObstacle<'static, f64, 3> {
    let center = [0.5 * SIZE[0], 0.5 * SIZE[1], -RADIUS];
    let on_ball = |x: [f64; 3]| {
        let square = (0..2).map(|axis| (x[axis] - center[axis]).powi(2)).sum::<f64>();
        // (A hair above it, for the rounding of the root.)
        [x[0], x[1], x[2] + height + 1e-9 + center[2] + (RADIUS * RADIUS - square).sqrt()]
    };
    let places: Vec<[f64; 3]> = plate.nodes.iter().map(|&x| on_ball(x)).collect();
    let ball = Sphere::new(center, RADIUS, Side::Outside).expect("a ball");
    NodesOnObstacle::new(ball, &places, &plate.node_dofs(), nodes)
        .expect("nodes of the plate")
        .moving(|t| [[1e-3 * t, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0; 3]])
}

/// The plate under its weight.
pub(super) fn simulation<'a>(
    plate: &Solid<3>,
    contact: impl ContactConstraint<f64> + 'a,
    h: f64,
    velocity: Vec<f64>,
) -> Simulation<'a, f64> {
    let mass = plate.lumped_mass::<f64>();
    let system = plate.system::<f64>().load(move |_, f| {
        for (f, m) in f.iter_mut().zip(&mass).skip(2).step_by(3) {
            *f = -1e-3 * m;
        }
    });
    let builder = Simulation::builder(system, Newmark::trapezoidal(), h).velocity(velocity).constraint(contact);
    builder.build().expect("a well-posed scene")
}
