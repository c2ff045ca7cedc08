//! Input of the builder: any system, start, rows, scheme, correction, solvers. Whatever is taken runs: numbers are
//! finite, and a step that is refused leaves the state as it was.

#![no_main]

use contact_dynamics::contact::{GapOffset, Plane, Side, Sphere};
use contact_dynamics::contact_solver::{GaussSeidel, Pivoting};
use contact_dynamics::{
    Automatic, Cholesky, ConjugateGradients, ContactLaw, Diagonal, Error, InitialOverclosure, LinearRows, LinearSystem,
    Lu, NodesOnObstacle, Result, Simulation, SimulationBuilder, StepControl, Tridiagonal,
};
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes;
use fuzz::Input;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut input = Input(bytes);
    let Ok(mut run) = scene(&mut input).and_then(SimulationBuilder::build) else { return };
    finite(&run);
    for _ in 0..6 {
        if input.below(16) == 15 && run.set_step_size(input.size()).is_err() {
            finite(&run);
        }
        let before = run.state().clone();
        match run.step() {
            Ok(()) => finite(&run),
            Err(error) => {
                assert_eq!(&before, run.state(), "{error}");
                assert!(!matches!(error, Error::Poisoned), "nothing has panicked");
                return;
            }
        }
    }
});

fn finite(run: &Simulation<'_, f64>) {
    let state = run.state();
    let motion = state.displacement().iter().chain(state.velocity()).chain(state.acceleration());
    assert!(motion.chain(state.contacts().forces()).all(|x| x.is_finite()), "{state:?}");
}

fn scene(input: &mut Input<'_>) -> Result<SimulationBuilder<'static, f64>> {
    let n = 1 + input.below(6);
    let stiffness = input.matrix(n);
    let mut system = match input.below(4) {
        0 => LinearSystem::new(input.matrix(n), stiffness)?,
        _ => LinearSystem::lumped((0..n).map(|_| input.size()).collect(), stiffness)?,
    };
    match input.below(4) {
        0 => system = system.damping(input.matrix(n))?,
        1 => system = system.rayleigh(input.size(), 1e-2 * input.size())?,
        _ => {}
    }
    if input.flag() {
        let (load, rate) = (input.number(), input.number());
        system = system.load(move |t, f| f.fill(load + rate * t));
    }
    match input.below(8) {
        0 => system = system.fix(input.below(n + 1))?,
        1 => {
            let motion = [input.number(), input.number(), input.number()];
            system = system.drive(input.below(n), move |t| [motion[0] + t * motion[1], motion[1], motion[2]])?;
        }
        _ => {}
    }
    let all = schemes::all();
    let scheme = (all[input.below(all.len())].make)();
    let h = [0.01, 0.1, 1.0, input.number()][input.below(4)];
    let mut builder = Simulation::builder(system, scheme, h);
    if input.flag() {
        builder = builder.displacement(input.numbers(n));
    }
    if input.flag() {
        let length = n + usize::from(input.below(32) == 31);
        builder = builder.velocity(input.numbers(length));
    }
    if input.below(16) == 0 {
        builder = builder.start_time(input.number());
    }
    builder = rows(input, builder, n)?;
    builder = match input.below(4) {
        0 => builder,
        1 => builder.uncorrected(),
        _ => {
            let correction = Correction::ALL[input.below(Correction::ALL.len())];
            builder.correctors(correction.correctors(0.1)?)
        }
    };
    builder = match input.below(8) {
        0 => builder.contact_solver(GaussSeidel::default()),
        1 => builder.contact_solver(Pivoting::default()),
        _ => builder,
    };
    builder = match input.below(10) {
        0 => builder.linear_solver(Cholesky::default()),
        1 => builder.linear_solver(Lu),
        2 => builder.linear_solver(Tridiagonal),
        3 => builder.linear_solver(Diagonal),
        4 => builder.linear_solver(ConjugateGradients::default()),
        5 => builder.linear_solver(Automatic),
        _ => builder,
    };
    if input.flag() {
        let overclosure = match input.flag() {
            true => InitialOverclosure::AdjustedGaps,
            false => InitialOverclosure::RemovedOver(input.size()),
        };
        builder = builder.initial_overclosure(overclosure);
    }
    if input.below(4) == 0 {
        builder = builder.step_control(StepControl::halving(h.abs() / 8.0)?);
    }
    if input.below(8) == 0 {
        builder = builder.energy_balance();
    }
    Ok(builder)
}

/// Up to four rows, and one obstacle.
fn rows<'a>(
    input: &mut Input<'_>,
    builder: SimulationBuilder<'a, f64>,
    n: usize,
) -> Result<SimulationBuilder<'a, f64>> {
    let mut rows = LinearRows::new();
    for _ in 0..input.below(5) {
        let entries: Vec<_> = (0..1 + input.below(3)).map(|_| (input.below(n + 1) % (n + 1), input.number())).collect();
        let offset = input.size();
        let law = match input.below(16) {
            0 => ContactLaw::Equality,
            1 => ContactLaw::Restitution { coefficient: input.number() },
            2 => ContactLaw::RateCondition,
            3 => ContactLaw::PersistencySwitch,
            4 => ContactLaw::Penalty { stiffness: input.size() },
            5 => ContactLaw::PowerLaw { stiffness: input.size(), exponent: input.size() },
            6 => ContactLaw::Bipenalty { stiffness: input.size(), mass: input.size() },
            7 => ContactLaw::StabilizedBipenalty { stiffness: input.size() },
            8 => ContactLaw::AugmentedLagrangian { stiffness: input.size(), augmentations: input.below(6) },
            _ => ContactLaw::Rigid,
        };
        rows = match input.below(4) {
            0 => {
                let (rate, acceleration) = (input.number(), input.number());
                rows.row(
                    law,
                    &entries,
                    GapOffset::moving(move |t| {
                        [offset + rate * t + 0.5 * acceleration * t * t, rate + acceleration * t, acceleration]
                    }),
                )
            }
            _ => rows.row(law, &entries, offset),
        };
        if input.below(3) == 0 {
            let tangents: Vec<_> = (0..1 + input.below(2)).map(|_| [(input.below(n), input.number())]).collect();
            let tangents: Vec<&[_]> = tangents.iter().map(|entries| &entries[..]).collect();
            rows = rows.friction(input.size(), &tangents);
        }
    }
    let mut builder = builder.constraint(rows);
    if n >= 2 && input.flag() {
        let nodes: Vec<_> = (0..n / 2).map(|node| [2 * node, 2 * node + 1]).collect();
        let coordinates: Vec<_> = nodes.iter().map(|_| [input.number(), input.size()]).collect();
        let chosen: Vec<_> = (0..nodes.len()).collect();
        builder = match input.flag() {
            true => {
                let plane = Plane::new([input.number(), -input.size()], [input.number(), input.number()])?;
                builder.constraint(NodesOnObstacle::new(plane, &coordinates, &nodes, &chosen)?)
            }
            false => {
                let sphere = Sphere::new([input.number(), input.number()], input.size(), Side::Outside)?;
                builder.constraint(NodesOnObstacle::new(sphere, &coordinates, &nodes, &chosen)?)
            }
        };
    }
    Ok(builder)
}
