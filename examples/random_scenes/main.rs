//! Scenes by chance, as many as there is time for: what must hold in every run is looked at in each, and each is run
//! twice in ways that must agree. What fails is made as small as it can be and printed.
//!
//! `cargo run --release --example random_scenes --features contact-dynamics-random-scenes/whole -- --seconds 600 --seed 1`;
//! `--scene N` looks at a single one, `--without-w` at scenes with contact solved without W. The program fails if a
//! scene does. Without the feature no run goes on from a file, or by several threads.

mod tally;

use contact_dynamics_random_scenes::rows::{Recipe, shrunk};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tally::Tally;

type Anything = Box<dyn std::error::Error>;

const USAGE: &str = "usage: random_scenes [--seconds N] [--seed N] [--scene N] [--without-w] [--quick] [--output DIR]";

/// Scenes that are made smaller, of each fault.
const SHRUNK: usize = 2;

/// What the command line asks for.
struct Options {
    seconds: u64,
    seed: u64,
    /// Scenes at most.
    most: u64,
    scene: Option<u64>,
    without_w: bool,
    output: std::path::PathBuf,
}

impl Options {
    fn from_command_line() -> Result<Self, Anything> {
        let mut options = Self {
            seconds: 20,
            seed: 1,
            most: u64::MAX,
            scene: None,
            without_w: false,
            output: "output/random_scenes".into(),
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or(USAGE);
            match argument.as_str() {
                "--seconds" => options.seconds = value()?.parse()?,
                "--seed" => options.seed = value()?.parse()?,
                "--scene" => options.scene = Some(value()?.parse()?),
                "--without-w" => options.without_w = true,
                "--quick" => options.most = 1000,
                "--output" => options.output = value()?.into(),
                unknown => return Err(format!("unknown option {unknown}; {USAGE}").into()),
            }
        }
        std::fs::create_dir_all(&options.output)?;
        Ok(options)
    }

    fn recipe(&self, seed: u64) -> Recipe {
        let recipe = Recipe::of_seed(seed);
        if self.without_w { recipe.without_w() } else { recipe }
    }
}

fn main() -> Result<(), Anything> {
    let options = Options::from_command_line()?;
    // (Panics are findings: their words come with the scene.)
    std::panic::set_hook(Box::new(|_| {}));
    if let Some(scene) = options.scene {
        println!("{}", told(scene, &options.recipe(scene)));
        return Ok(());
    }
    let tally = run(&options);
    let mut page = tally.to_string();
    for scene in tally.worst(SHRUNK) {
        page.push_str(&told(scene, &options.recipe(scene)));
    }
    println!("{page}");
    let path = options.output.join("scenes.md");
    std::fs::write(&path, &page)?;
    println!("wrote {}", path.display());
    match tally.findings() {
        0 => Ok(()),
        failed => Err(format!("{failed} scenes fail").into()),
    }
}

/// Scenes of consecutive seeds, on all cores, until time is over.
fn run(options: &Options) -> Tally {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (next, end) = (AtomicU64::new(options.seed), Instant::now() + Duration::from_secs(options.seconds));
    let work = || {
        let mut tally = Tally::default();
        while Instant::now() < end {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed - options.seed >= options.most {
                break;
            }
            let recipe = options.recipe(seed);
            tally.add(seed, &recipe, recipe.examine());
        }
        tally
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let mut all = Tally::default();
        for worker in workers {
            all.merge(worker.join().expect("panics of scenes are caught"));
        }
        all
    })
}

/// A scene, and the smallest one that fails as it does.
fn told(seed: u64, recipe: &Recipe) -> String {
    let verdict = recipe.examine();
    let summary = recipe.summary();
    let Some(finding) = verdict.finding else {
        return format!("scene {seed}: {summary}\n{verdict:?}\n");
    };
    let least = shrunk(recipe, |recipe| recipe.examine().finding.is_some_and(|other| other.what == finding.what));
    if least.dofs() == recipe.dofs() && least.dofs() > 200 {
        return format!("\nscene {seed}: {finding}\n{summary}\n");
    }
    let of_least = least.examine().finding.map_or_else(String::new, |finding| finding.to_string());
    format!("\nscene {seed}: {finding}\n{summary}\nsmallest scene: {of_least}\n{least:?}\n")
}
