//! Scenes by chance: every constraint with everything that it can be given, from a seed, looked at in every step.

mod bodies;
mod crossing;
mod meeting;
mod scene;
mod space;
mod watch;

pub use meeting::{Meeting, meetings};

pub(crate) use bodies::{decades, pick};
use contact_dynamics::contact::Certificate;
use contact_dynamics::{
    Bathe, Bdf2, CdLagrange, Composite, Error, GeneralizedAlpha, MoreauJean, Newmark, NohBathe, PersistencyCorrection,
    Result, Simulation, StepControl, TimeIntegrator,
};
use contact_dynamics_scenes::random::Congruential;
use scene::Scene;
use space::{Dimension, Space};
use std::panic::{AssertUnwindSafe, catch_unwind};
use watch::Watch;

/// The same scene, written differently.
#[derive(Clone, Copy, Debug, Default)]
pub struct Variant {
    /// Units of length, mass and time are so many powers of two smaller.
    pub exponents: [i32; 3],
    /// Facets are listed in another order.
    pub reordered: bool,
    /// Steps that fail are halved, and steps are certified.
    pub certified: bool,
}

/// What a scene was like.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// Scheme, correction and material.
    pub made_of: String,
    /// Whether a contact has closed.
    pub touched: bool,
    /// Steps accepted, and attempts that were refused and taken again by half.
    pub steps: u64,
    pub halved: u64,
    /// Attempts without a certificate, if steps are certified.
    pub rejected: usize,
    /// The error that has ended the run, by its name, and its words.
    pub refused: Option<(String, String)>,
    /// Whether the scheme is corrected, and whether steps that fail are halved.
    pub corrected: bool,
    pub halves: bool,
    /// Highest energy over that at the start, less 1; of scenes in which nothing does work on the bodies.
    pub gain: f64,
    /// Deepest node over the size of an element, of schemes that impose contact on positions.
    pub depth: f64,
    /// Displacements and velocities at the end, without the powers of two.
    pub end: Vec<f64>,
    /// What must not be, with the step in which it was.
    pub findings: Vec<String>,
}

/// Steps of a scene.
const STEPS: usize = 40;

/// How a scene is advanced.
struct Method {
    scheme: Box<dyn TimeIntegrator>,
    /// None, the default, and with the history projection.
    correction: usize,
    /// Step over the time in which a wave crosses an element.
    courant: f64,
    halves: bool,
    /// Whether contact is imposed on positions of the state.
    on_positions: bool,
}

impl Method {
    fn new(random: &mut Congruential) -> Self {
        let scheme = pick(&[0, 0, 1, 2, 3, 3, 4, 5, 6, 7, 8], random);
        let implicit = decades(-1.0, 0.5, random);
        let explicit = decades(-1.5, -0.8, random);
        let correction = pick(&[0, 1, 2, 2], random);
        let halves = pick(&[true, false], random);
        let radius = random.unit();
        let alpha = GeneralizedAlpha::chung_hulbert(radius).expect("a radius below one");
        let (scheme, courant, on_positions): (Box<dyn TimeIntegrator>, _, _) = match scheme {
            0 => (Box::new(Composite), implicit, true),
            1 => (Box::new(Bathe::default()), implicit, true),
            2 => (Box::new(alpha), implicit, true),
            3 => (Box::new(Newmark::trapezoidal()), implicit, true),
            4 => (Box::new(Bdf2), implicit, true),
            5 => (Box::new(NohBathe::new(0.54).expect("a share of the step")), explicit, false),
            6 => (Box::new(MoreauJean::new(0.5).expect("from a half")), implicit, false),
            7 => (Box::new(MoreauJean::new(1.0).expect("to one")), implicit, false),
            _ => (Box::new(CdLagrange), explicit, false),
        };
        let correction = if on_positions { correction } else { 0 };
        Self { scheme, correction, courant, halves, on_positions }
    }

    fn name(&self) -> String {
        let correction = ["raw", "corrected", "corrected, past projected"][self.correction];
        let retried = if self.halves { ", halving" } else { "" };
        format!("{}, {correction}{retried}, Courant number {:.2}", self.scheme.name(), self.courant)
    }
}

/// Runs a scene; a panic is a finding.
pub fn run(meeting: Meeting, seed: u64, variant: Variant) -> Figures {
    let go = || match meeting.space() {
        2 => run_in::<2>(meeting, seed, variant),
        _ => run_in::<3>(meeting, seed, variant),
    };
    let words = |panic: Box<dyn std::any::Any + Send>| match panic.downcast::<String>() {
        Ok(words) => *words,
        Err(panic) => panic.downcast_ref::<&str>().map_or("something", |words| *words).into(),
    };
    catch_unwind(AssertUnwindSafe(go))
        .unwrap_or_else(|panic| Figures { findings: vec![format!("panics: {}", words(panic))], ..Figures::default() })
}

fn run_in<const D: usize>(meeting: Meeting, seed: u64, variant: Variant) -> Figures
where
    Space<D>: Dimension<D>,
{
    // (FNV-1a of the name: what is added to the list of meetings changes no other scene.)
    let name = meeting.to_string();
    let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    let mut random = Congruential(name.bytes().fold(seed ^ 0xcbf2_9ce4_8422_2325, hash));
    (0..3).for_each(|_| _ = random.unit());
    let mut method = Method::new(&mut random);
    method.halves |= variant.certified;
    let mut figures = Figures { made_of: method.name(), ..Figures::default() };
    let result = Scene::<D>::new(meeting, method.courant, &mut random, &variant);
    let result = result.and_then(|scene| advance((meeting, variant), scene, method, &mut figures));
    figures.refused = result.err().map(|error| named(&error));
    let [length, _, time] = variant.exponents.map(|exponent| 2.0_f64.powi(exponent));
    let half = figures.end.len() / 2;
    let (displacement, velocity) = figures.end.split_at_mut(half);
    displacement.iter_mut().for_each(|u| *u /= length);
    velocity.iter_mut().for_each(|v| *v *= time / length);
    figures
}

/// Builds the run and takes its steps.
fn advance<const D: usize>(
    (meeting, variant): (Meeting, Variant),
    mut scene: Scene<D>,
    method: Method,
    figures: &mut Figures,
) -> Result<()>
where
    Space<D>: Dimension<D>,
{
    figures.made_of = format!("{}, {}, μ = {:.2}", figures.made_of, scene.material(), scene.friction);
    (figures.corrected, figures.halves) = (method.correction > 0, method.halves);
    let h = method.courant * scene.crossing;
    let mut builder = Simulation::builder(scene.system()?, method.scheme, h).velocity(scene.velocity.clone());
    let certificate = if variant.certified { Some(scene.certify()?) } else { None };
    for constraint in scene.constraints.drain(..) {
        builder = builder.constraint(constraint);
    }
    builder = match method.correction {
        0 => builder.uncorrected(),
        1 => builder.corrector(PersistencyCorrection::new()),
        _ => builder.corrector(PersistencyCorrection::with_history_projection()),
    };
    if method.halves {
        builder = builder.step_control(StepControl::halving(h / 64.0)?);
    }
    let mut run = builder.build()?;
    // (Rows may be deep without contact: of a node that passes a corner, behind the far side of the body there. With a
    // certificate surfaces are looked at themselves.)
    let by_rows = method.on_positions && !variant.certified;
    let mut watch = Watch::new(meeting, &scene, by_rows, &mut run)?;
    for step in 0..STEPS {
        let before = run.state().clone();
        let result = run.step();
        if result.is_err() {
            watch.is_unchanged(&before, run.state(), step, figures);
        } else {
            watch.look(&mut run, step, figures)?;
            if let Some(facets) = certificate.as_ref().and_then(|_| scene.crossing(run.state().displacement())) {
                figures.findings.push(format!("step {step}: facets {facets:?} cross"));
            }
        }
        figures.steps = run.statistics().steps;
        figures.halved = run.statistics().refused_steps;
        figures.rejected = certificate.as_ref().map_or(0, Certificate::rejected);
        figures.end = [run.state().displacement(), run.state().velocity()].concat();
        result?;
    }
    Ok(())
}

/// An error by its variant, and its words; of a step that was halved in vain that of the last attempt.
fn named(error: &Error) -> (String, String) {
    match error {
        Error::StepRefused { source, .. } => named(source),
        _ => {
            let name = format!("{error:?}");
            (name.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().into(), error.to_string())
        }
    }
}
