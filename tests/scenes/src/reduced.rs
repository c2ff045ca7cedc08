//! Bars that strike a wall or each other, as meshes and reduced to modes, and the errors of their contact force.

use crate::Bars;
use crate::masses::{Takers, Treatment};
use crate::reference::{Bar, BouncingBar, CollidingBars};
use crate::wall_bar::WallBar;
use contact_dynamics::reduction::{Blocks, Boundary, Reduction};
use contact_dynamics::{LinearRows, LinearSystem, PersistencyCorrection, Result, Simulation, TimeIntegrator};

/// Elements of the bars that are reduced.
pub const PARENT: usize = 1000;

/// Velocity of the paper's bars, and the time of their impact.
pub(crate) const SPEED: f64 = 0.05;
const IMPACT: f64 = 0.1;

/// Exponent and softening of the taper as they are by default.
pub const TAPER: [f64; 2] = [3.0, 2.0];

/// How a bar is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// A mesh with massless contact dofs and the blended mass that suits the scheme, as in the presets.
    Mesh,
    Reduced(Boundary),
}

impl Model {
    pub const ALL: [Self; 4] = [
        Self::Reduced(Boundary::Tapered),
        Self::Reduced(Boundary::Untapered),
        Self::Reduced(Boundary::CraigBampton),
        Self::Mesh,
    ];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mesh => "finite elements",
            Self::Reduced(Boundary::Untapered) => "untapered (MacNeal)",
            Self::Reduced(Boundary::CraigBampton) => "Craig–Bampton",
            Self::Reduced(_) => "tapered",
        }
    }
}

/// A bar as a system, with its contact dof and what a uniform velocity is on its dofs.
#[derive(Debug)]
pub struct Striker {
    pub system: LinearSystem<'static, f64>,
    pub contact: usize,
    /// Unit velocity of the whole bar.
    pub uniform: Vec<f64>,
    /// Its weight.
    pub load: Vec<f64>,
    /// Whether its contact dof has mass.
    inert: bool,
}

impl Striker {
    /// A bar with so many unknowns; its weight is a constant load. Exponent and softening are those of the taper.
    pub fn new(
        bar: &WallBar,
        unknowns: usize,
        model: Model,
        scheme: &dyn TimeIntegrator,
        h: f64,
        [exponent, softening]: [f64; 2],
    ) -> Result<Self> {
        let Model::Reduced(boundary) = model else {
            let bar = WallBar { elements: unknowns - 1, ..*bar };
            let body = bar.body();
            let treatment = Treatment::RedistributedBlend(Takers::Tapered);
            let mass = treatment.mass(&body, &scheme.tableau(), body.courant(h)?)?;
            let load = mass.row_sums().iter().map(|m| -bar.gravity * m).collect();
            let uniform = vec![1.0; unknowns];
            return Ok(Self { system: bar.system_with(mass), contact: 0, uniform, load, inert: false });
        };
        let bar = WallBar { elements: PARENT, ..*bar };
        let (mass, stiffness) = (bar.consistent_mass(), bar.stiffness());
        let weight: Vec<f64> = bar.mass().iter().map(|m| -bar.gravity * m).collect();
        let reduction = Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0]).boundary(boundary);
        let reduction = reduction.exponent(exponent).softening(softening);
        let body = reduction.constant_load(&weight).modes(unknowns - 1)?;
        Ok(Self {
            system: body.system()?,
            contact: body.contact_dofs().start,
            uniform: body.velocity(&vec![1.0; PARENT + 1])?,
            load: body.constant_load().unwrap_or(&[]).to_vec(),
            inert: boundary == Boundary::CraigBampton,
        })
    }

    fn flying(
        self,
        velocity: f64,
        gap: f64,
        scheme: Box<dyn TimeIntegrator>,
        h: f64,
    ) -> Result<Simulation<'static, f64>> {
        let Self { system, contact, uniform, inert, .. } = self;
        let run = Simulation::builder(system, scheme, h)
            .velocity(uniform.iter().map(|v| velocity * v).collect())
            .constraint(LinearRows::new().unilateral(&[(contact, 1.0)], gap));
        // Contact dofs with mass take the correction of the literature, those without what is theirs by default.
        if inert { run.corrector(PersistencyCorrection::new()).build() } else { run.build() }
    }
}

/// Contact forces over time, at the times that they belong to.
pub type Forces = Vec<(f64, f64)>;

/// When the force of a scheme acts, counted from the end of its step.
fn late(scheme: &dyn TimeIntegrator, h: f64) -> f64 {
    (scheme.tableau().stages.last().map_or(1.0, |stage| stage.load) - 1.0) * h
}

/// What is measured of an impact, mean over phases of the step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Struck {
    /// Mean error of the force over 0.8 to 3.2 impact times, without points within a step of its jumps, relative to the
    /// largest exact one.
    pub error: f64,
    /// The largest force over the largest exact one, less 1: the worst of all phases.
    pub overshoot: f64,
    /// The largest share of the energy that was lost or gained in any phase.
    pub energy: f64,
}

/// The paper's bar as one against a wall (EA and ρA instead of A), with so many elements.
pub fn paper_bar(elements: usize) -> WallBar {
    let bars = Bars::paper(elements);
    WallBar {
        elements,
        young: bars.young[0] * bars.area,
        density: bars.density[0] * bars.area,
        length: bars.length[0],
        gravity: 0.0,
        height: SPEED * IMPACT,
        damping: 0.0,
    }
}

/// The error of forces, and the overshoot.
pub(crate) fn errors(forces: &Forces, exact: &CollidingBars, h: f64) -> [f64; 2] {
    let (start, end) = exact.contact_intervals()[0];
    let largest = exact.contact_force(start + 1e-6 * (end - start));
    let travel = 0.5 * (end - start);
    let until = forces.last().map_or(0.0, |last| last.0);
    let at_jump = |t: f64| {
        let jumps = |x: f64| (exact.contact_force(x) - exact.contact_force(t)).abs() > 1e-9 * largest;
        jumps((t - h).max(0.0)) || jumps((t + h).min(until))
    };
    let window = start - 0.2 * travel..end + 0.2 * travel;
    let inside = forces.iter().filter(|(t, _)| window.contains(t) && !at_jump(*t));
    let misses: Vec<f64> = inside.map(|(t, force)| (force - exact.contact_force(*t)).abs() / largest).collect();
    let top = forces.iter().fold(0.0_f64, |top, (_, force)| top.max(*force));
    [misses.iter().sum::<f64>() / misses.len() as f64, top / largest - 1.0]
}

/// The force of the paper's bar against a wall, up to 0.4 s, and its energy at the end over that at the start.
pub fn wall_force(
    unknowns: usize,
    model: Model,
    scheme: fn() -> Box<dyn TimeIntegrator>,
    h: f64,
    (phase, taper): (f64, [f64; 2]),
) -> Result<(Forces, f64)> {
    let bar = paper_bar(PARENT);
    let gap = bar.height + phase * h * SPEED;
    let mut run = Striker::new(&bar, unknowns, model, &*scheme(), h, taper)?.flying(-SPEED, gap, scheme(), h)?;
    let (late, before) = (late(&*scheme(), h), run.energy().total());
    let mut forces = Vec::new();
    while run.time() < 4.0 * IMPACT - 0.5 * h {
        run.step()?;
        forces.push((run.time() + late, run.state().contacts().forces()[0]));
    }
    Ok((forces, run.energy().total() / before))
}

/// The exact force of the same, with the impact `phase` of a step later.
pub fn wall_exact(h: f64, phase: f64) -> CollidingBars {
    let bar = paper_bar(1);
    let exact = Bar { young: bar.young, density: bar.density, area: 1.0, length: bar.length, velocity: SPEED };
    CollidingBars::against_wall(exact, bar.height + phase * h * SPEED, 5.0 * IMPACT).expect("a bar that flies")
}

/// The paper's bar against a wall.
pub fn wall_impact(
    unknowns: usize,
    model: Model,
    scheme: fn() -> Box<dyn TimeIntegrator>,
    h: f64,
    (phases, taper): (&[f64], [f64; 2]),
) -> Result<Struck> {
    let mut all = Vec::new();
    for &phase in phases {
        let (forces, energy) = wall_force(unknowns, model, scheme, h, (phase, taper))?;
        all.push((errors(&forces, &wall_exact(h, phase), h), (energy - 1.0).abs()));
    }
    Ok(summary(&all))
}

pub(crate) fn summary(all: &[([f64; 2], f64)]) -> Struck {
    Struck {
        error: all.iter().map(|of| of.0[0]).sum::<f64>() / all.len() as f64,
        overshoot: all.iter().map(|of| of.0[1]).fold(f64::NEG_INFINITY, f64::max),
        energy: all.iter().map(|of| of.1).fold(0.0, f64::max),
    }
}

/// Two bars of a scene, each with so many unknowns and a model of its own.
pub fn collision(
    bars: &Bars,
    (unknowns, models): (usize, [Model; 2]),
    scheme: fn() -> Box<dyn TimeIntegrator>,
    h: f64,
    phases: &[f64],
) -> Result<Struck> {
    let impact = bars.impact_time();
    let until = 5.0 * impact;
    let mut all = Vec::new();
    for &phase in phases {
        let bars = bars.delayed(phase, h);
        let (mut blocks, mut ends, mut velocity) = (Blocks::new(), [0; 2], Vec::new());
        for (side, model) in models.into_iter().enumerate() {
            let bar = WallBar {
                elements: PARENT,
                young: bars.young[side] * bars.area,
                density: bars.density[side] * bars.area,
                length: bars.length[side],
                ..paper_bar(PARENT)
            };
            let speed = bars.velocity[side];
            let place = match model {
                Model::Mesh => {
                    let bar = WallBar { elements: unknowns - 1, ..bar };
                    let body = bar.body();
                    let treatment = Treatment::RedistributedBlend(Takers::Tapered);
                    let mass = treatment.mass(&body, &scheme().tableau(), body.courant(h)?)?.into_matrix();
                    velocity.extend(std::iter::repeat_n(speed, unknowns));
                    let place = blocks.body(mass.as_ref(), body.stiffness.as_ref(), None)?;
                    ends[side] = place.start;
                    place
                }
                Model::Reduced(boundary) => {
                    let (mass, stiffness) = (bar.consistent_mass(), bar.stiffness());
                    let reduction = Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0]).boundary(boundary);
                    let body = reduction.modes(unknowns - 1)?;
                    velocity.extend(body.velocity(&vec![speed; PARENT + 1])?);
                    let place = blocks.reduced(&body)?;
                    ends[side] = place.end - 1;
                    place
                }
            };
            debug_assert_eq!(place.len(), unknowns);
        }
        let mut run = Simulation::builder(blocks.system()?, scheme(), h)
            .velocity(velocity)
            .constraint(LinearRows::new().unilateral(&[(ends[0], -1.0), (ends[1], 1.0)], bars.gap))
            .build()?;
        let (late, before) = (late(&*scheme(), h), run.energy().total());
        let mut forces = Vec::new();
        while run.time() < until - 0.5 * h {
            run.step()?;
            forces.push((run.time() + late, run.state().contacts().forces()[0]));
        }
        let exact = bars.exact(until + h);
        all.push((errors(&forces, &exact, h), (run.energy().total() / before - 1.0).abs()));
    }
    Ok(summary(&all))
}

/// What is measured of the bar of Doyen, Ern and Piperno that bounces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounced {
    /// Mean error of the force while the bar is near or on the floor in the first period, over its mean there.
    pub error: f64,
    /// Energy after six periods over that at the start, height included.
    pub energy: f64,
}

/// The bouncing bar with so many unknowns, in so many steps a contact.
pub fn bounces(unknowns: usize, model: Model, scheme: fn() -> Box<dyn TimeIntegrator>, steps: f64) -> Result<Bounced> {
    let bar = WallBar::bouncing(PARENT);
    let exact = BouncingBar::doyen();
    let h = 2.0 * bar.length / bar.wave_speed() / steps;
    let striker = Striker::new(&bar, unknowns, model, &*scheme(), h, TAPER)?;
    let load = striker.load.clone();
    let mut run = striker.flying(0.0, bar.height, scheme(), h)?;
    let (period, late) = (exact.period(), late(&*scheme(), h));
    let mut forces = Vec::new();
    let total = |run: &mut Simulation<'_, f64>| {
        let work: f64 = load.iter().zip(run.state().displacement()).map(|(f, u)| f * u).sum();
        run.energy().total() - work + bar.weight() * bar.height
    };
    let start = total(&mut run);
    while run.time() < 6.0 * period - 0.5 * h {
        run.step()?;
        forces.push((run.time() + late, run.state().contacts().forces()[0]));
    }
    Ok(Bounced { error: share_of_misses(&forces, &exact, h), energy: total(&mut run) / start })
}

/// The mean error of forces near the first contact of the bouncing bar, over the mean force there.
pub(crate) fn share_of_misses(forces: &Forces, exact: &BouncingBar, h: f64) -> f64 {
    let [t1, t2, ..] = exact.events();
    let (mut sum, mut size) = (0.0, 0.0);
    for &(t, force) in forces {
        if t > t1 - 0.1 && t < t2 + 0.1 && (t - t1).abs() > h && (t - t2).abs() > h {
            let expected = exact.contact_force(t);
            sum += (force - expected).abs();
            size += expected;
        }
    }
    sum / size
}
