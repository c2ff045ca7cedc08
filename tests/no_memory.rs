//! Memory that cannot be had: what is large (matrices, factors, W, responses) is refused with a typed error wherever a
//! limit strikes, at build, at the first growth of the contact matrices, in a factorization; a step that fails so
//! leaves everything as it was, and succeeds once there is memory. Alone in its binary: the allocator is global.
//!
//! Not in our hands: buffers that the products of faer keep for each thread (64 MB at the first large factorization),
//! and blocks of the size of a vector.

use contact_dynamics::contact::Plane;
use contact_dynamics::{
    Automatic, ByBody, CdLagrange, ConjugateGradients, Error, LinearSolver, LinearSystem, Lu, Newmark, NodesOnObstacle,
    Simulation, SimulationBuilder, State,
};
use contact_dynamics_refusing::{Refusing, limit, peaks, unlimited};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};

#[global_allocator]
static ALLOCATOR: Refusing = Refusing;

const MATERIAL: Material = Material { young: 1e3, poisson: 0.3, density: 1.0 };
const STEPS: usize = 4;

/// A block that falls on a rough floor, or nearly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scene {
    Direct,
    ByBody,
    Lu,
    Iterative,
    /// A factorization in each iteration.
    Newton,
    Explicit,
    /// Consistent mass, explicit.
    Consistent,
}

impl Scene {
    fn builder(self) -> SimulationBuilder<'static, f64> {
        let cells = match self {
            Self::Newton => [8, 8, 6],
            Self::Lu => [10, 10, 4],
            Self::Explicit | Self::Consistent => [14, 14, 10],
            _ => [12, 12, 8],
        };
        let solid = Solid::block([1.0, 1.0, 0.7], cells, MATERIAL);
        let solver: Box<dyn LinearSolver<f64>> = match self {
            Self::Lu => Box::new(Lu),
            Self::Iterative => Box::new(ConjugateGradients::default()),
            Self::ByBody => Box::new(ByBody::default()),
            _ => Box::new(Automatic),
        };
        let floor = Plane::new([0.0, 0.0, -0.015], [0.0, 0.0, 1.0]).unwrap();
        let nodes: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
        let floor = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &nodes).unwrap().friction(0.3);
        let explicit = 2e-4;
        let (builder, speed) = match self {
            Self::Newton => {
                (Simulation::builder(Hyperelastic::new(&solid, Law::NeoHookean), Newmark::trapezoidal(), 1e-2), 1.0)
            }
            Self::Explicit => (Simulation::builder(solid.system(), CdLagrange, explicit), 40.0),
            Self::Consistent => {
                let system = LinearSystem::new(solid.consistent_mass(), solid.stiffness()).unwrap();
                (Simulation::builder(system, CdLagrange, explicit), 40.0)
            }
            _ => (Simulation::builder(solid.system(), Newmark::trapezoidal(), 1e-2), 1.0),
        };
        builder.velocity(solid.uniform([0.2 * speed, 0.0, -speed])).constraint(floor).linear_solver(solver)
    }
}

/// A number for all bits of a state (FNV-1a; a list of them would be large itself).
fn bits(state: &State<f64>) -> u64 {
    let contacts = state.contacts();
    let lists = [state.displacement(), state.velocity(), state.acceleration(), contacts.forces(), contacts.gaps()];
    let mix = |hash: u64, x: &f64| {
        let bytes = x.to_bits().to_le_bytes();
        bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
    };
    lists.into_iter().flatten().chain([&state.time()]).fold(0xcbf2_9ce4_8422_2325, mix)
}

/// How often a limit struck at build, in steps, and in changes of the step.
#[derive(Clone, Copy, Debug, Default)]
struct Struck {
    build: usize,
    steps: usize,
    changes: usize,
}

fn is_memory(error: &Error) -> bool {
    matches!(error, Error::OutOfMemory { bytes, .. } if bytes.is_none_or(|bytes| bytes > 0))
}

/// The step before which the step size becomes another one: everything is factorized anew.
const CHANGE: usize = 1;

type Run = Simulation<'static, f64>;

/// Takes the steps; what finds no memory is told to `refused`, and tried again.
fn go(run: &mut Run, mut refused: impl FnMut(&Run, usize, Error, bool)) -> Vec<u64> {
    let mut states = vec![bits(run.state())];
    for step in 0..STEPS {
        if step == CHANGE {
            let h = 0.75 * run.step_size();
            if let Err(error) = run.set_step_size(h) {
                refused(run, step, error, true);
                run.set_step_size(h).unwrap();
            }
        }
        if let Err(error) = run.step() {
            refused(run, step, error, false);
            run.step().unwrap();
        }
        states.push(bits(run.state()));
    }
    states
}

fn limited(scene: Scene) -> Struck {
    let mut struck = Struck::default();
    // (What a thread keeps for itself is there after a first run.)
    let built = || scene.builder().build().unwrap();
    go(&mut built(), |_, _, error, _| panic!("{error}"));
    let builder = scene.builder();
    let (run, of_build) = peaks(|| builder.build().unwrap());
    drop(run);
    for peak in of_build {
        let builder = scene.builder();
        limit(peak - 1);
        let error = builder.build().map(|_| ()).expect_err("less memory than a build takes");
        assert!(unlimited() > 0 && is_memory(&error), "{scene:?}, {peak}: {error}");
        struck.build += 1;
    }
    let mut run = built();
    let (states, of_steps) = peaks(|| go(&mut run, |_, _, error, _| panic!("{error}")));
    for peak in of_steps {
        let mut run = built();
        limit(peak - 1);
        let mut strikes = 0;
        let again = go(&mut run, |run, step, error, in_change| {
            assert!(unlimited() > 0 && is_memory(&error), "{scene:?}, {peak}, step {step}: {error}");
            assert!(bits(run.state()) == states[step], "{scene:?}, {peak}, step {step}");
            strikes += 1;
            *(if in_change { &mut struck.changes } else { &mut struck.steps }) += 1;
        });
        unlimited();
        assert!(strikes == 1 && again == states, "{scene:?}, {peak}: {strikes}");
    }
    struck
}

/// By one thread, whose buffers are there after a first run.
#[test]
fn large_blocks_that_cannot_be_had_are_errors() {
    let all = || {
        let mut sum = Struck::default();
        for (scene, least) in [
            (Scene::Direct, 8),
            (Scene::ByBody, 8),
            (Scene::Lu, 6),
            (Scene::Iterative, 6),
            (Scene::Newton, 6),
            (Scene::Explicit, 1),
            (Scene::Consistent, 2),
        ] {
            let struck = limited(scene);
            println!("{scene:?}: {struck:?}");
            assert!(struck.build >= least, "{scene:?}: {struck:?}");
            sum.steps += struck.steps;
            sum.changes += struck.changes;
        }
        assert!(sum.steps >= 2 && sum.changes >= 5, "{sum:?}");
    };
    #[cfg(feature = "rayon")]
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(all);
    #[cfg(not(feature = "rayon"))]
    all();
}

/// A process that may not have more memory.
#[cfg(target_os = "linux")]
mod process {
    use super::*;
    use contact_dynamics::{Cholesky, System};
    use std::process::Command;

    const MODEL: &str = "CONTACT_DYNAMICS_LIMITED";

    /// Address space in use.
    fn used() -> usize {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmSize:")).unwrap();
        1024 * line.trim().trim_end_matches(" kB").parse::<usize>().unwrap()
    }

    /// What the process does that the other test starts: a body is built whose factor does not fit.
    #[test]
    fn of_its_own() {
        if std::env::var_os(MODEL).is_none() {
            return;
        }
        let model = |cells: usize| Solid::block([1.0; 3], [cells; 3], MATERIAL).system::<f64>();
        let run = |system| Simulation::builder(system, Newmark::trapezoidal(), 1e-2).build();
        // (The buffers of faer, which are not in our hands.)
        run(model(12)).unwrap();
        let system = model(18);
        let factor = 8 * Cholesky::default().estimate(system.pattern(), &[]).unwrap();
        let limit = used() + factor / 2;
        let process = std::process::id().to_string();
        let limited = Command::new("prlimit").args(["--pid", &process, &format!("--as={limit}")]).status();
        assert!(limited.unwrap().success());
        match run(system).map(|_| ()) {
            Err(Error::OutOfMemory { what, bytes }) => println!("refused {what}, {bytes:?} of {factor}"),
            other => println!("{other:?}"),
        }
    }

    #[test]
    fn limits_of_the_process_are_errors() {
        let output = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "process::of_its_own", "--nocapture", "--test-threads", "1"])
            // (Threads that have nothing to do take address space.)
            .envs([(MODEL, "1"), ("RAYON_NUM_THREADS", "1"), ("MALLOC_ARENA_MAX", "1")])
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        let words = text.lines().find_map(|line| line.find("refused ").map(|at| &line[at..]));
        let words = words.unwrap_or_else(|| panic!("{output:?}"));
        let expected = "refused a sparse Cholesky factor, Some(";
        assert!(output.status.success() && words.starts_with(expected), "{words}");
        let numbers: Vec<&str> = words[expected.len()..].split(") of ").collect();
        assert_eq!(numbers[0], numbers[1], "{words}");
    }
}
