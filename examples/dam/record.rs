//! What is written down of a run: forces and openings of the joints, time and memory.

use crate::threads;
use crate::valley::Dam;
use std::time::Instant;

/// A run.
#[derive(Debug, Default)]
pub(crate) struct Record {
    pub(crate) name: String,
    pub(crate) is_reduced: bool,
    /// Whether the scheme damps: it is then compared with meshes under the same scheme.
    pub(crate) is_damped: bool,
    pub(crate) unknowns: usize,
    /// Seconds before the first step, and of all steps.
    pub(crate) build: f64,
    pub(crate) stepping: f64,
    /// Bytes of the factors; all that is held at the end, where one thread did everything.
    pub(crate) factor: usize,
    pub(crate) held: Option<usize>,
    /// For the start and each step: the force of each joint, its largest opening; how many contacts are closed.
    pub(crate) forces: Vec<Vec<f64>>,
    pub(crate) openings: Vec<Vec<f64>>,
    pub(crate) closed: Vec<usize>,
    /// The farthest that two nodes of a contact have slipped, open or closed.
    pub(crate) slip: f64,
    /// Contacts that opened or closed.
    pub(crate) changes: u64,
}

/// What the runs have in common.
pub(crate) trait Steps {
    fn step(&mut self) -> contact_dynamics::Result<()>;
    /// Forces and gaps of all contacts, and which are closed.
    fn contacts(&self) -> [&[f64]; 2];
    fn is_closed(&self, contact: usize) -> bool;
    /// How far two nodes of a contact are apart along the joint, at most.
    fn slip(&self) -> f64;
    fn changes(&self) -> u64;
    /// Values stored by all factors.
    fn factor(&self) -> usize;
    fn unknowns(&self) -> usize;
}

impl Record {
    /// Milliseconds of a step.
    pub(crate) fn step(&self) -> f64 {
        1e3 * self.stepping / (self.forces.len() - 1).max(1) as f64
    }

    /// Builds a run and takes so many steps.
    pub(crate) fn of<S: Steps>(
        name: &str,
        dam: &Dam,
        steps: usize,
        build: impl FnOnce() -> contact_dynamics::Result<S>,
    ) -> contact_dynamics::Result<Self> {
        let mut record = Self { name: name.into(), ..Self::default() };
        let mut kept = Ok(None);
        let counted = allocation_counter::measure(|| {
            kept = (|| {
                let start = Instant::now();
                let mut run = build()?;
                record.build = start.elapsed().as_secs_f64();
                record.look(dam, &run);
                for _ in 0..steps {
                    let start = Instant::now();
                    run.step()?;
                    record.stepping += start.elapsed().as_secs_f64();
                    record.look(dam, &run);
                }
                Ok(Some(run))
            })();
        });
        if let Some(run) = kept? {
            record.unknowns = run.unknowns();
            record.factor = run.factor() * size_of::<f64>();
            record.changes = run.changes();
        }
        record.held = usize::try_from(counted.bytes_current).ok().filter(|_| threads::count() == 1);
        Ok(record)
    }

    fn look(&mut self, dam: &Dam, run: &impl Steps) {
        let [forces, gaps] = run.contacts();
        let joints = || dam.joints.iter().cloned();
        self.forces.push(joints().map(|joint| forces[joint].iter().sum()).collect());
        self.openings.push(joints().map(|joint| gaps[joint].iter().copied().fold(0.0, f64::max)).collect());
        self.closed.push((0..forces.len()).filter(|&contact| run.is_closed(contact)).count());
        self.slip = self.slip.max(run.slip());
    }
}

/// The largest value.
pub(crate) fn largest(rows: &[Vec<f64>]) -> f64 {
    rows.iter().flatten().fold(0.0, |most, x| most.max(*x))
}

/// The largest difference, of the largest value.
pub(crate) fn difference(found: &[Vec<f64>], expected: &[Vec<f64>]) -> f64 {
    let pairs = found.iter().flatten().zip(expected.iter().flatten());
    pairs.fold(0.0_f64, |most, (x, y)| most.max((x - y).abs())) / largest(expected)
}
