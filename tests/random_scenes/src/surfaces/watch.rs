//! What must hold in every step of a scene, and after one that is refused.

use super::Figures;
use super::meeting::Meeting;
use super::scene::Scene;
use contact_dynamics::contact::Obstacle;
use contact_dynamics::{Result, Simulation, State};

/// Nodes are no deeper than this share of an element where contact is imposed on positions.
const DEEPEST: f64 = 0.05;

/// Gaps of rows with fixed normals are met within so much of the largest coordinate.
const ROUNDING: f64 = 1e-11;

pub(super) struct Watch<'s, const D: usize> {
    meeting: Meeting,
    nodes: &'s [[f64; D]],
    mass: &'s [f64],
    obstacle: Option<&'s dyn Obstacle<f64, D>>,
    friction: f64,
    element: f64,
    on_positions: bool,
    energy: f64,
    momentum: [f64; D],
    /// The largest force so far, and the sum of the sizes of momenta by dof.
    force: f64,
    size: f64,
}

impl<'s, const D: usize> Watch<'s, D> {
    pub(super) fn new(
        meeting: Meeting,
        scene: &'s Scene<D>,
        on_positions: bool,
        run: &mut Simulation<'_, f64>,
    ) -> Result<Self> {
        let Scene { nodes, mass, friction, element, obstacle, velocity, .. } = scene;
        Ok(Self {
            meeting,
            nodes,
            mass,
            obstacle: obstacle.as_deref(),
            friction: *friction,
            element: *element,
            on_positions,
            energy: run.energy().total(),
            momentum: momentum(run)?,
            force: 0.0,
            size: impulse(mass, velocity),
        })
    }

    /// After a step.
    pub(super) fn look(&mut self, run: &mut Simulation<'_, f64>, step: usize, figures: &mut Figures) -> Result<()> {
        let Self { meeting, .. } = *self;
        let mut find = |what: String| figures.findings.push(format!("step {step}: {what}"));
        let total = run.energy().total();
        let state = run.state();
        let (u, v, a) = (state.displacement(), state.velocity(), state.acceleration());
        let contacts = state.contacts();
        let lists = [u, v, a, contacts.gaps(), contacts.forces(), contacts.raw_forces(), contacts.impulses()];
        if !lists.iter().all(|list| list.iter().all(|x| x.is_finite())) || !total.is_finite() {
            find("a number that is not finite".into());
            return Ok(());
        }
        let (forces, raw) = (contacts.forces(), contacts.raw_forces());
        self.force = [forces, raw].concat().iter().fold(self.force, |most, f| most.max(f.abs()));
        self.size = self.size.max(impulse(self.mass, v));
        if let Some(pull) = raw.iter().find(|force| **force < 0.0 && !meeting.holds()) {
            find(format!("a row that pulls: {pull:e} of {:e}", self.force));
        }
        let places = self.nodes.iter().flatten().zip(u);
        let size = places.fold(0.0_f64, |most, (x, u)| most.max(x.abs()).max(u.abs()));
        // What rounding of the gaps, in which contact problems are accepted, makes of forces: m/h² of it.
        let heaviest = self.mass.iter().fold(0.0_f64, |most, m| most.max(*m));
        let noise = 16.0 * f64::EPSILON * size * heaviest / run.step_size().powi(2);
        for (row, force) in forces.iter().enumerate() {
            let rubs = contacts.friction_forces(row).iter().fold(0.0_f64, |size, f| size.hypot(*f));
            let bound = self.friction * force.max(0.0) * (1.0 + 1e-9) + 1e-9 * self.force + noise;
            if rubs > bound {
                find(format!("friction {rubs:e} beyond its cone, {bound:e}, of which {noise:e} is rounding"));
            }
        }
        figures.touched |= raw.iter().any(|force| *force > 0.0);
        let depth = if self.on_positions { self.deepest(u, contacts.gaps()) } else { 0.0 };
        figures.depth = figures.depth.max(depth / self.element);
        // (What has come in unseen comes out slowly.)
        if depth > DEEPEST * self.element && !meeting.lets_in() {
            find(format!("depth {depth:e}, elements are {:e}", self.element));
        }
        if meeting.has_fixed_normals() && depth > ROUNDING * size {
            find(format!("depth {depth:e} among coordinates of {size:e}"));
        }
        if meeting.conserves() {
            figures.gain = figures.gain.max(total / self.energy - 1.0);
        }
        if meeting.is_free() {
            let now: [f64; D] = momentum(run)?;
            let change = now.iter().zip(self.momentum).fold(0.0_f64, |most, (now, then)| most.max((now - then).abs()));
            if change > 1e-9 * self.size {
                find(format!("momentum changes by {change:e} of {:e}", self.size));
            }
        }
        Ok(())
    }

    /// How deep nodes are inside: as the obstacle says where it rests, otherwise as rows say.
    fn deepest(&self, u: &[f64], gaps: &[f64]) -> f64 {
        match self.obstacle {
            Some(obstacle) => self.nodes.iter().enumerate().fold(0.0, |deepest, (node, x)| {
                let place = std::array::from_fn(|k| x[k] + u[D * node + k]);
                f64::max(deepest, -obstacle.distance(place).0)
            }),
            None if self.meeting.holds() => 0.0,
            None => gaps.iter().fold(0.0, |deepest, gap| f64::max(deepest, -gap)),
        }
    }

    /// After a step that is refused.
    pub(super) fn is_unchanged(&self, before: &State<f64>, now: &State<f64>, step: usize, figures: &mut Figures) {
        let bits = |state: &State<f64>| -> Vec<u64> {
            let lists = [state.displacement(), state.velocity(), state.acceleration(), &[state.time()][..]];
            lists.concat().into_iter().map(f64::to_bits).collect()
        };
        if bits(before) != bits(now) || before != now {
            figures.findings.push(format!("step {step}: a refused step changes the state"));
        }
    }
}

/// Momentum along the axes, as the scheme conserves it.
fn momentum<const D: usize>(run: &Simulation<'_, f64>) -> Result<[f64; D]> {
    let mut momentum = [0.0; D];
    for (axis, momentum) in momentum.iter_mut().enumerate() {
        let count = run.state().displacement().len();
        let direction: Vec<f64> = (0..count).map(|dof| f64::from(u8::from(dof % D == axis))).collect();
        *momentum = run.momentum(&direction)?;
    }
    Ok(momentum)
}

/// Σ m |v|.
fn impulse(mass: &[f64], v: &[f64]) -> f64 {
    mass.iter().zip(v).map(|(m, v)| m * v.abs()).sum()
}
