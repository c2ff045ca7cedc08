//! Bodies that strike a plane or each other along one axis, whole or reduced, and what is measured of their impact.

use crate::masses::{Body, Takers, Treatment};
use crate::solids::Solid;
use contact_dynamics::mass::affine_motions;
use contact_dynamics::reduction::{Blocks, Boundary, Reduction};
use contact_dynamics::{LinearRows, Newmark, Result, Simulation, TimeIntegrator};
use std::ops::Range;
use std::time::Instant;

/// A body of an impact. What strikes, and what is measured, is along the last axis.
#[derive(Clone, Debug)]
pub struct Part {
    pub body: Body,
    /// Supports.
    pub fixed: Vec<usize>,
    /// What is done to its mass where it is not reduced.
    pub treatment: Treatment,
    /// Its speed at the start.
    pub speed: f64,
    /// Unit velocity of all of it.
    pub along: Vec<f64>,
}

/// How all bodies of an impact are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Model {
    /// The mesh with massless contact dofs and the blended mass that suits the scheme, as in the presets.
    Whole,
    /// So many modes of the mesh with its plain mass, each body; softening is that of the taper.
    Reduced { boundary: Boundary, softening: f64, modes: usize },
}

/// Steps of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    Of(f64),
    /// 1/ω_c, of the body with the highest; for reduced bodies.
    Cutoff,
}

/// A contact: the dofs that it compares, as body, place among the contact dofs of this and sign, and the gap.
pub type Row = (Vec<(usize, usize, f64)>, f64);

/// Bodies and their contacts.
#[derive(Clone, Debug)]
pub struct Impact {
    pub parts: Vec<Part>,
    pub rows: Vec<Row>,
    /// Where runs end.
    pub until: f64,
}

/// The course of an impact.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Total contact force over time.
    pub forces: Vec<(f64, f64)>,
    /// The impulses of the steps. (A contact that closes or opens in a step exerts its force for a part of it.)
    pub impulses: Vec<f64>,
    /// All of them.
    pub impulse: f64,
    /// Mean velocity of each body at the end.
    pub velocities: Vec<f64>,
    /// Energy at the end over that at the start.
    pub energy: f64,
    pub unknowns: usize,
    /// Step, and how many were taken.
    pub h: f64,
    pub steps: usize,
    /// Seconds of the steps, and of all that comes before them.
    pub run: f64,
    pub build: f64,
    /// How many contacts were ever closed, and the time of the last one.
    pub touched: usize,
    pub last: f64,
}

impl Part {
    /// Of a mesh; these of its nodes may touch.
    pub fn new<const D: usize>(solid: &Solid<D>, touching: &[usize], fixed: Vec<usize>, speed: f64) -> Result<Self> {
        let body = Body {
            consistent: solid.consistent_mass(),
            stiffness: solid.stiffness(),
            contact: touching.iter().map(|&node| Solid::<D>::dof(node, D - 1)).collect(),
            groups: (0..solid.dofs()).map(|dof| dof % D).collect(),
            motions: affine_motions(solid.dofs(), &solid.nodes, &solid.node_dofs())?,
        };
        let along = solid.uniform(std::array::from_fn(|axis| if axis == D - 1 { 1.0 } else { 0.0 }));
        Ok(Self { body, fixed, treatment: Treatment::RedistributedBlend(Takers::Tapered), speed, along })
    }

    /// Into a system: where its dofs stand and its contact dofs, a unit velocity there, and ω_c if it is reduced.
    fn join(&self, blocks: &mut Blocks<f64>, model: Model, h: f64) -> Result<(Range<usize>, Placed)> {
        let Body { consistent, stiffness, contact, .. } = &self.body;
        let Model::Reduced { boundary, softening, modes } = model else {
            let mass = self.treatment.mass(&self.body, &Newmark::trapezoidal().tableau(), self.body.courant(h)?)?;
            let place = blocks.body(mass.into_matrix().as_ref(), stiffness.as_ref(), None)?;
            let contact = contact.iter().map(|dof| place.start + dof).collect();
            return Ok((place, Placed { contact, along: self.along.clone(), cutoff: 0.0 }));
        };
        let reduction = Reduction::new(consistent.as_ref(), stiffness.as_ref(), contact).fix(&self.fixed);
        let body = reduction.boundary(boundary).softening(softening).modes(modes)?;
        let place = blocks.reduced(&body)?;
        let contact = body.contact_dofs().map(|dof| place.start + dof).collect();
        let cutoff = body.accuracy().cutoff;
        Ok((place, Placed { contact, along: body.velocity(&self.along)?, cutoff }))
    }
}

/// A body in a system.
struct Placed {
    contact: Vec<usize>,
    along: Vec<f64>,
    cutoff: f64,
}

impl Impact {
    /// Runs it by the trapezoidal rule.
    ///
    /// # Errors
    ///
    /// Those of the reduction and of the run.
    pub fn course(&self, model: Model, step: Step) -> Result<Course> {
        let start = Instant::now();
        let (mut blocks, mut placed, mut fixed) = (Blocks::new(), Vec::new(), Vec::new());
        let given = match step {
            Step::Of(h) => h,
            Step::Cutoff => 0.0,
        };
        for part in &self.parts {
            let (place, body) = part.join(&mut blocks, model, given)?;
            if model == Model::Whole {
                fixed.extend(part.fixed.iter().map(|dof| place.start + dof));
            }
            placed.push((place, body));
        }
        let cutoff = placed.iter().map(|(_, body)| body.cutoff).fold(0.0, f64::max);
        let h = if step == Step::Cutoff { cutoff.recip() } else { given };
        let system = fixed.iter().try_fold(blocks.system()?, |system, &dof| system.fix(dof))?;
        let unknowns = blocks.dofs() - fixed.len();
        let rows = self.rows.iter().fold(LinearRows::new(), |rows, (entries, gap)| {
            let entries: Vec<_> = entries.iter().map(|&(body, k, sign)| (placed[body].1.contact[k], sign)).collect();
            rows.unilateral(&entries, *gap)
        });
        let speeds = self.parts.iter().zip(&placed);
        let velocity = speeds.flat_map(|(part, (_, body))| body.along.iter().map(|x| part.speed * x)).collect();
        let mut run =
            Simulation::builder(system, Newmark::trapezoidal(), h).velocity(velocity).constraint(rows).build()?;
        let mut course = Course { unknowns, h, build: start.elapsed().as_secs_f64(), ..Course::default() };
        self.go(&mut run, &mut course)?;
        for (part, (place, body)) in self.parts.iter().zip(&placed) {
            let mut direction = vec![0.0; blocks.dofs()];
            direction[place.clone()].copy_from_slice(&body.along);
            course.velocities.push(run.momentum(&direction)? / part.mass());
        }
        Ok(course)
    }

    /// The steps, timed.
    fn go(&self, run: &mut Simulation<'static, f64>, course: &mut Course) -> Result<()> {
        let (before, h) = (run.energy().total(), course.h);
        let mut touched = vec![false; self.rows.len()];
        let start = Instant::now();
        while run.time() < self.until - 0.5 * h {
            run.step()?;
            let contacts = run.state().contacts();
            let force: f64 = contacts.forces().iter().sum();
            course.forces.push((run.time(), force));
            let impulse = contacts.impulses().iter().sum::<f64>();
            course.impulses.push(impulse);
            course.impulse += impulse;
            touched.iter_mut().zip(contacts.forces()).for_each(|(touched, force)| *touched |= *force > 0.0);
            if force > 0.0 {
                course.last = run.time();
            }
        }
        course.run = start.elapsed().as_secs_f64();
        course.steps = course.forces.len();
        course.touched = touched.iter().filter(|touched| **touched).count();
        course.energy = run.energy().total() / before;
        Ok(())
    }

    /// A later impact: all gaps larger by so much.
    #[must_use]
    pub fn delayed(mut self, by: f64) -> Self {
        self.rows.iter_mut().for_each(|(_, gap)| *gap += by);
        self
    }
}

impl Part {
    /// Its mass.
    pub fn mass(&self) -> f64 {
        let m = self.body.consistent.as_ref();
        let column = |(j, &x): (usize, &f64)| -> f64 {
            let entries = m.row_idx_of_col_raw(j).iter().zip(m.val_of_col(j));
            x * entries.map(|(&i, m)| self.along[i] * m).sum::<f64>()
        };
        self.along.iter().enumerate().map(column).sum()
    }
}

impl Course {
    /// The largest force.
    pub fn largest(&self) -> f64 {
        self.forces.iter().map(|of| of.1).fold(0.0, f64::max)
    }

    /// The force at a time, between those of the steps.
    fn force(&self, t: f64) -> f64 {
        let after = self.forces.partition_point(|of| of.0 < t);
        match (after.checked_sub(1).map(|k| self.forces[k]), self.forces.get(after)) {
            (Some((t0, f0)), Some(&(t1, f1))) => f0 + (t - t0) / (t1 - t0) * (f1 - f0),
            (None, Some(&(t1, f1))) => t / t1 * f1,
            (_, None) => 0.0,
        }
    }

    /// ∫ |F − F_reference| dt over the impulse of the reference.
    pub fn error(&self, reference: &Self) -> f64 {
        let miss: f64 = self.forces.iter().map(|&(t, force)| (force - reference.force(t)).abs()).sum();
        self.h * miss / reference.impulse
    }

    /// The impulse up to a time.
    fn impulse_until(&self, t: f64) -> f64 {
        let whole = self.forces.partition_point(|of| of.0 <= t);
        let part = |end: f64| ((t - end) / self.h + 1.0).max(0.0);
        let rest = self.forces.get(whole).map_or(0.0, |&(end, _)| part(end) * self.impulses[whole]);
        self.impulses[..whole].iter().sum::<f64>() + rest
    }

    /// Mean forces in windows of such a width, one after the other, as long as the reference is in contact.
    pub fn windows(&self, width: f64, reference: &Self) -> Vec<f64> {
        let edges: Vec<f64> = (0..).map(|k| f64::from(k) * width).take_while(|t| *t < reference.last + width).collect();
        edges.windows(2).map(|of| (self.impulse_until(of[1]) - self.impulse_until(of[0])) / width).collect()
    }

    /// As [`error`](Self::error), of the forces in windows: for contacts that open and close too often to be followed.
    pub fn window_error(&self, width: f64, reference: &Self) -> f64 {
        let (ours, theirs) = (self.windows(width, reference), reference.windows(width, reference));
        ours.iter().zip(&theirs).map(|(x, y)| (x - y).abs()).sum::<f64>() / theirs.iter().sum::<f64>()
    }

    /// Mean force from the first contact to the last.
    pub fn mean(&self) -> f64 {
        let first = self.forces.iter().find(|of| of.1 > 0.0).map_or(0.0, |of| of.0 - self.h);
        self.impulse / (self.last - first)
    }
}
