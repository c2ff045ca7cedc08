//! The algebra of time-integration rows: a scheme is a table of affine rows, everything else is derived from it.
//!
//! With z the unknown of a stage and past states k = 0 (newest), 1, 2 …, a [`Row`] is
//!
//! ```text
//! row = w z + Σ_k ( c_u U_k + c_v V_k + c_a A_k ),   U_k = u_k,  V_k = h v_k,  A_k = h² a_k
//! ```
//!
//! Three recovery rows give u, h v, h² a of the new state; three balance rows give ū, h v̄, h² ā at which
//! `M ā = f(t_n + load h, ū, v̄) + Gᵀ λ` holds. Coefficients are pure numbers; h never appears in them.

use crate::error::{Error, Result};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// How many past states a row may read.
pub const MAX_PAST: usize = 4;

/// An affine row over the unknown z and the past states; see the [module](self).
///
/// Rows are written with the constants [`Z`], [`U`], [`V`], [`A`] and arithmetic:
///
/// ```
/// use contact_dynamics::tableau::{U, Z};
/// let velocity = 1.5 * Z - 2.0 * U[0] + 0.5 * U[1]; // h v of the three-point backward difference
/// assert_eq!(velocity.z, 1.5);
/// assert_eq!(velocity.u[1], 0.5);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Weight of the unknown.
    pub z: f64,
    /// Coefficients of `U_k`.
    pub u: [f64; MAX_PAST],
    /// Coefficients of `V_k = h v_k`.
    pub v: [f64; MAX_PAST],
    /// Coefficients of `A_k = h² a_k`.
    pub a: [f64; MAX_PAST],
}

/// The row that is the unknown itself.
pub const Z: Row = Row { z: 1.0, u: [0.0; MAX_PAST], v: [0.0; MAX_PAST], a: [0.0; MAX_PAST] };
/// The rows of the past displacements, newest first.
pub const U: [Row; MAX_PAST] = past(0);
/// The rows of the past velocities times h, newest first.
pub const V: [Row; MAX_PAST] = past(1);
/// The rows of the past accelerations times h², newest first.
pub const A: [Row; MAX_PAST] = past(2);

const fn past(field: usize) -> [Row; MAX_PAST] {
    let zero = Row { z: 0.0, u: [0.0; MAX_PAST], v: [0.0; MAX_PAST], a: [0.0; MAX_PAST] };
    let mut rows = [zero; MAX_PAST];
    let mut k = 0;
    while k < MAX_PAST {
        match field {
            0 => rows[k].u[k] = 1.0,
            1 => rows[k].v[k] = 1.0,
            _ => rows[k].a[k] = 1.0,
        }
        k += 1;
    }
    rows
}

impl Row {
    /// Combines two rows coefficient by coefficient.
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let each = |x: [f64; MAX_PAST], y: [f64; MAX_PAST]| std::array::from_fn(|k| f(x[k], y[k]));
        Self { z: f(self.z, other.z), u: each(self.u, other.u), v: each(self.v, other.v), a: each(self.a, other.a) }
    }

    /// Coefficients of past state `k`: (u, h v, h² a); zero for states older than any row can read.
    pub fn past(&self, k: usize) -> [f64; 3] {
        match k < MAX_PAST {
            true => [self.u[k], self.v[k], self.a[k]],
            false => [0.0; 3],
        }
    }

    /// One more than the oldest past state read, 0 if none is.
    pub fn depth(&self) -> usize {
        (0..MAX_PAST).rev().find(|&k| self.past(k).iter().any(|&c| c != 0.0)).map_or(0, |k| k + 1)
    }

    fn is_finite(&self) -> bool {
        self.z.is_finite() && (0..MAX_PAST).all(|k| self.past(k).iter().all(|c| c.is_finite()))
    }

    /// The row with its z expressed by d = z − ẑ, where ẑ makes `zero` vanish; terms that cancel to rounding are zero.
    fn increment(self, zero: Self) -> Self {
        let factor = self.z / zero.z;
        let cancel = |x: f64, y: f64| {
            let (y, difference) = (factor * y, x - factor * y);
            if difference.abs() <= 16.0 * f64::EPSILON * x.abs().max(y.abs()) { 0.0 } else { difference }
        };
        Self { z: self.z, ..self.zip(zero, cancel) }
    }
}

impl Add for Row {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.zip(other, |x, y| x + y)
    }
}

impl Sub for Row {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.zip(other, |x, y| x - y)
    }
}

impl Neg for Row {
    type Output = Self;
    fn neg(self) -> Self {
        -1.0 * self
    }
}

impl Mul<Row> for f64 {
    type Output = Row;
    fn mul(self, row: Row) -> Row {
        row.zip(row, |x, _| self * x)
    }
}

impl Div<f64> for Row {
    type Output = Self;
    fn div(self, divisor: f64) -> Self {
        self.zip(self, |x, _| x / divisor)
    }
}

/// A triple of rows for u, h v and h² a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows {
    /// Displacement.
    pub u: Row,
    /// Velocity times h.
    pub v: Row,
    /// Acceleration times h².
    pub a: Row,
}

impl Rows {
    /// The three rows in the order u, h v, h² a.
    pub fn each(&self) -> [Row; 3] {
        [self.u, self.v, self.a]
    }

    fn increment(self, zero: Row) -> Self {
        Self { u: self.u.increment(zero), v: self.v.increment(zero), a: self.a.increment(zero) }
    }
}

/// At which level, and where, a stage imposes contact.
///
/// `lead` is the fraction of the step by which the contact condition looks ahead of the stage's state, reached with the
/// acceleration of that state: u + lead h v + ½ lead² h² a, and v + lead h a. Explicit schemes need it: the unknown
/// multiplier of theirs moves the body only later.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ContactLevel {
    /// 0 ≤ g ⊥ λ ≥ 0 on displacements.
    Position {
        /// How far ahead of the stage's state.
        lead: f64,
    },
    /// 0 ≤ ġ ⊥ λ ≥ 0 on velocities, for contacts whose gap is forecast to be closed.
    Velocity {
        /// How far ahead of the stage's state.
        lead: f64,
        /// Displacements at which the forecast takes the gap; a row without the unknown.
        forecast: Row,
        /// Time of the forecast, as a fraction of the step.
        forecast_at: f64,
    },
}

impl ContactLevel {
    /// Positions of the stage's own state.
    pub const POSITION: Self = Self::Position { lead: 0.0 };

    /// How far ahead of the stage's state, as a fraction of the step.
    pub fn lead(&self) -> f64 {
        match *self {
            Self::Position { lead } | Self::Velocity { lead, .. } => lead,
        }
    }
}

/// Which force of a nonlinear system a stage balances. For linear systems there is no difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum StageForce {
    /// f(t̄, ū, v̄).
    #[default]
    AtBalance,
    /// The force whose internal work from the last state to that of the stage is the change of the potential; ū must be
    /// the mean of the two.
    AlongPath,
}

/// One stage of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// Rows of the new state.
    pub recovery: Rows,
    /// Rows at which the balance of momentum holds.
    pub balance: Rows,
    /// Fraction of the step at which external load and multiplier live.
    pub load: f64,
    /// Fraction of the step at which the stage's state (and its gap) lives.
    pub end: f64,
    /// Where contact is imposed.
    pub contact: ContactLevel,
    /// Which force is balanced.
    pub force: StageForce,
}

impl Stage {
    /// A stage whose balance holds at the new state, at the end of the step, with contact imposed on its displacements.
    pub fn new(recovery: Rows) -> Self {
        let (contact, force) = (ContactLevel::POSITION, StageForce::AtBalance);
        Self { recovery, balance: recovery, load: 1.0, end: 1.0, contact, force }
    }

    /// The same stage with its own balance rows, holding at `t_n + load h`.
    #[must_use]
    pub fn balanced(self, balance: Rows, load: f64) -> Self {
        Self { balance, load, ..self }
    }

    /// The same stage with its state (and load) at `t_n + end h`.
    #[must_use]
    pub fn ending_at(self, end: f64) -> Self {
        Self { end, load: end, ..self }
    }

    /// The same stage with contact imposed at another level or place.
    #[must_use]
    pub fn with_contact(self, contact: ContactLevel) -> Self {
        Self { contact, ..self }
    }

    /// The same stage with the force of the path instead of that at the balance.
    #[must_use]
    pub fn along_path(self) -> Self {
        Self { force: StageForce::AlongPath, ..self }
    }

    /// The quantity that contact constrains, as a row: displacements, or h v at velocity level.
    pub fn contact_row(&self) -> Row {
        let Rows { u, v, a } = self.recovery;
        match self.contact {
            ContactLevel::Position { lead } => u + lead * v + (0.5 * lead * lead) * a,
            ContactLevel::Velocity { lead, .. } => v + lead * a,
        }
    }

    /// Fraction of the step at which contact is imposed.
    pub fn contact_at(&self) -> f64 {
        self.end + self.contact.lead()
    }

    /// Everything the stage reads: recovery, balance and forecast.
    fn rows(&self) -> Vec<Row> {
        let forecast = match self.contact {
            ContactLevel::Position { .. } => None,
            ContactLevel::Velocity { forecast, .. } => Some(forecast),
        };
        self.recovery.each().into_iter().chain(self.balance.each()).chain(forecast).collect()
    }

    /// Whether the balance holds at the recovered state itself.
    pub fn is_collocated(&self) -> bool {
        self.balance == self.recovery
    }

    /// Change of (U, V, A) of the stage by a unit multiplier on a unit mass, in units of h². The balance asks for w_ā
    /// of the unknown, so a multiplier moves the rows by their weights over that of the balance's acceleration.
    pub(crate) fn response(&self) -> [f64; 3] {
        self.recovery.each().map(|row| row.z / self.balance.a.z)
    }

    /// Rows over the increment d = z − ẑ instead of z, with ẑ the value for which the acceleration row vanishes.
    ///
    /// Recovering a by subtracting displacements costs eps u/h²; in this form the terms that cancel are gone.
    #[must_use]
    pub fn increment(&self) -> Self {
        let zero = self.recovery.a;
        Self { recovery: self.recovery.increment(zero), balance: self.balance.increment(zero), ..*self }
    }
}

/// How the past that a multistep scheme reads is made at the start.
///
/// From free flight (no acceleration) the straight line is exact, and both forms use it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum StartUp {
    /// The first steps are trapezoidal, until the past is known: no overshoot of stiff modes, one more factorization.
    #[default]
    Trapezoidal,
    /// The past is Taylor's expansion of the start, u₀ − k h v₀ + ½ (k h)² a₀, v₀ − k h a₀, a₀: contact and corrections
    /// act by the scheme's own rows from the first step; a stiff mode that starts out of equilibrium overshoots.
    Taylor,
}

/// A time-integration scheme as data: its stages.
///
/// u of the last stage is the displacement at the end of the step. Stored v and a may live elsewhere, as the
/// accelerations of generalized-α do: [`analysis::order`](crate::analysis::order) finds out where.
#[derive(Clone, Debug, PartialEq)]
pub struct Tableau {
    /// Stages in the order in which they are solved.
    pub stages: Vec<Stage>,
}

impl Tableau {
    /// A single-stage scheme.
    pub fn single(stage: Stage) -> Self {
        Self::staged(vec![stage])
    }

    /// A scheme of several stages. After a stage its state is past state 0 for the next one; after the last stage the
    /// intermediate states are dropped.
    pub fn staged(stages: Vec<Stage>) -> Self {
        Self { stages }
    }

    /// Refuses tableaux that no step could be made of.
    ///
    /// # Errors
    ///
    /// [`Error::Tableau`] names the stage and what is wrong: no stage, a coefficient that is not finite, an
    /// acceleration row without the unknown, or a last stage that does not end at the end of the step.
    pub fn check(&self, integrator: &str) -> Result<()> {
        let refuse = |stage, reason| Err(Error::Tableau { integrator: integrator.to_owned(), stage, reason });
        for (s, stage) in self.stages.iter().enumerate() {
            let lead = stage.contact.lead();
            let numbers = [stage.load, stage.end, lead];
            if !stage.rows().iter().all(Row::is_finite) || !numbers.iter().all(|x| x.is_finite()) {
                return refuse(s, "a coefficient is not finite");
            }
            if lead < 0.0 {
                return refuse(s, "contact cannot be imposed before the stage's state");
            }
            if let ContactLevel::Velocity { forecast, forecast_at, .. } = stage.contact
                && (forecast.z != 0.0 || !forecast_at.is_finite())
            {
                return refuse(s, "the forecast of contact must be known before the stage is solved");
            }
            if stage.recovery.a.z == 0.0 || stage.balance.a.z == 0.0 {
                return refuse(s, "the acceleration rows must contain the unknown");
            }
        }
        match self.stages.last() {
            None => refuse(0, "there is no stage"),
            Some(last) if (last.end - 1.0).abs() > f64::EPSILON => {
                refuse(self.stages.len() - 1, "the last stage must end at the end of the step")
            }
            Some(_) => Ok(()),
        }
    }

    /// Number of states, the current one included, that a step reads at its start (at least 1).
    pub fn depth(&self) -> usize {
        let read =
            |(s, stage): (usize, &Stage)| stage.rows().iter().map(Row::depth).max().unwrap_or(0).saturating_sub(s);
        self.stages.iter().enumerate().map(read).max().unwrap_or(0).max(1)
    }

    /// Which entries of the past are still read after stage `s`: `[k][field]`, k = 0 the state of that stage.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if there is no such stage.
    pub fn read_after(&self, s: usize) -> Result<Vec<[bool; 3]>> {
        match s < self.stages.len() {
            true => Ok(self.reads_after(s)),
            false => Err(no_stage(s)),
        }
    }

    /// [`read_after`](Self::read_after) of a stage that exists.
    pub(crate) fn reads_after(&self, s: usize) -> Vec<[bool; 3]> {
        let (stages, depth) = (self.stages.len(), self.depth());
        let mut read = vec![[false; 3]; depth + stages];
        // In increment form: what cancels is not read.
        let mut mark = |stage: &Stage, entry: &dyn Fn(usize) -> Option<usize>| {
            let stage = stage.increment();
            for row in stage.rows() {
                for k in 0..MAX_PAST {
                    let Some(place) = entry(k) else { continue };
                    for (field, c) in row.past(k).into_iter().enumerate() {
                        if let Some(state) = read.get_mut(place).filter(|_| c != 0.0) {
                            state[field] = true;
                        }
                    }
                }
            }
        };
        for (later, stage) in self.stages.iter().enumerate().skip(s + 1) {
            mark(stage, &|k| k.checked_sub(later - s - 1));
        }
        for (next, stage) in self.stages.iter().enumerate() {
            // State k of the next step's stage `next`: its own stages first, then the newest state, then the past of
            // t_n, which after stage s lies behind the s + 1 states of this step.
            let place = |k: usize| match k.checked_sub(next) {
                None => None,
                Some(0) => (s + 1 == stages).then_some(0),
                Some(steps) => Some(s + steps),
            };
            mark(stage, &place);
        }
        read
    }

    /// The momentum functional and the impulse weights of the stages; see [`Momentum`].
    pub fn momentum(&self) -> Momentum {
        Momentum::of(self)
    }

    /// The map of one stage on the scalar test equation `inertia a + damping v + stiffness u = 0` with the weights
    /// [stiffness, damping, inertia] in units of the step (Ω², 2 ξ Ω, 1): new (U, V, A) from the past, row by row over
    /// `width` past states.
    pub(crate) fn stage_map(stage: &Stage, weights: [f64; 3], width: usize) -> [Vec<f64>; 3] {
        let [stiffness, damping, inertia] = weights;
        let stage = stage.increment();
        let combine = |row: Row| -> Vec<f64> {
            (0..width).flat_map(|k| if k < MAX_PAST { row.past(k) } else { [0.0; 3] }).collect()
        };
        let [bu, bv, ba] = stage.balance.each();
        let effective = inertia * ba.z + damping * bv.z + stiffness * bu.z;
        let (cu, cv, ca) = (combine(bu), combine(bv), combine(ba));
        let d: Vec<f64> =
            (0..3 * width).map(|i| -(inertia * ca[i] + damping * cv[i] + stiffness * cu[i]) / effective).collect();
        stage.recovery.each().map(|row| combine(row).iter().zip(&d).map(|(c, d)| c + row.z * d).collect())
    }

    /// The amplification matrix of one step on the scalar test equation, row-major, over the past states of the step:
    /// (U, V, A) of the newest, of the one before, …. The weights are those of [`stage_map`](Self::stage_map).
    pub(crate) fn step_map(&self, weights: [f64; 3]) -> Vec<Vec<f64>> {
        let (depth, stages) = (self.depth(), self.stages.len());
        let size = 3 * depth;
        // Rows of the extended past as functions of the past at the start of the step, newest first.
        let mut past: Vec<Vec<f64>> =
            (0..size).map(|i| (0..size).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        for stage in &self.stages {
            let width = past.len() / 3;
            let map = Self::stage_map(stage, weights, width);
            let new = map.map(|row| {
                let mut sum = vec![0.0; size];
                for (c, old) in row.iter().zip(&past) {
                    sum.iter_mut().zip(old).for_each(|(s, o)| *s += c * o);
                }
                sum
            });
            past.splice(0..0, new);
        }
        // (Without a stage a step does nothing: there is no state between to drop.)
        past.drain(3..3 * stages.max(1));
        past.truncate(size);
        past
    }
}

fn no_stage(s: usize) -> Error {
    Error::Parameter { name: "the index of a stage", value: s as f64, range: "below the number of stages" }
}

/// Weights of motion without stiffness and damping.
const RIGID: [f64; 3] = [0.0, 0.0, 1.0];

/// The linear functional of the past that is the momentum of a scheme, and what each stage's multiplier adds to it.
///
/// ψ is the left eigenvector for the eigenvalue 1 of the step at K = C = 0, scaled so that free flight with velocity V
/// gives V: momentum = 1ᵀ M ψ·(past)/h. A raw multiplier λ of stage s changes it by `h β_s λ`; an edit of the state or
/// of the past by M ψ·(edit)/h.
///
/// ```
/// use contact_dynamics::{Composite, TimeIntegrator};
/// let momentum = Composite.tableau().momentum();
/// // (U0 − U1) + (V0 − V1) for the composite scheme.
/// assert!((momentum.after_step()[0][0] - 1.0).abs() < 1e-12);
/// assert!((momentum.after_step()[1][1] + 1.0).abs() < 1e-12);
/// assert!((momentum.impulse_weights()[0] - 1.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Momentum {
    /// Covector after each stage: `[stage][k][field]`, fields U, V, A.
    covectors: Vec<Vec<[f64; 3]>>,
    weights: Vec<f64>,
}

impl Momentum {
    fn of(tableau: &Tableau) -> Self {
        let stages = tableau.stages.len().max(1);
        let map = tableau.step_map(RIGID);
        let size = map.len();
        // (mapᵀ − 1) ψ = 0.
        let transposed =
            (0..size).map(|i| (0..size).map(|j| map[j][i] - f64::from(u8::from(i == j))).collect()).collect();
        let mut psi = null_vector(transposed);
        let flight: f64 = psi.chunks(3).enumerate().map(|(k, p)| p[1] - k as f64 * p[0]).sum();
        for p in &mut psi {
            *p /= flight;
        }

        // Pull back through the stages, last to first. After the last stage the intermediate states are not kept.
        let mut covector: Vec<[f64; 3]> = psi.chunks(3).map(|p| [p[0], p[1], p[2]]).collect();
        covector.splice(1..1, std::iter::repeat_n([0.0; 3], stages - 1));
        covector.push([0.0; 3]); // the oldest state leaves the past
        let mut covectors = vec![covector];
        for stage in tableau.stages.iter().skip(1).rev() {
            covectors.push(pull_back(&covectors[covectors.len() - 1], stage));
        }
        covectors.reverse();
        let weights = tableau
            .stages
            .iter()
            .zip(&covectors)
            .map(|(stage, covector)| impulse_weight(stage.response(), covector))
            .collect();
        Self { covectors, weights }
    }

    /// The covector over the past after stage `s`: `[k][field]`, k = 0 the state of that stage, fields U, V, A.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if there is no such stage.
    pub fn after_stage(&self, s: usize) -> Result<&[[f64; 3]]> {
        self.covectors.get(s).map(Vec::as_slice).ok_or_else(|| no_stage(s))
    }

    /// The covector over the kept past after a whole step: `[k][field]`.
    pub fn after_step(&self) -> Vec<[f64; 3]> {
        let (stages, last) = (self.covectors.len(), &self.covectors[self.covectors.len() - 1]);
        let mut kept = last.clone();
        kept.drain(1..stages);
        kept.pop();
        kept
    }

    /// The covectors while the past is still being built by steps of `start` (one stage): entry m − 1 is the one for m
    /// known states. Steps of the start conserve them in turn, and the last one is [`after_step`](Self::after_step).
    pub(crate) fn during_start(&self, start: &Stage) -> Vec<Vec<[f64; 3]>> {
        let mut covectors = vec![self.after_step()];
        while covectors[covectors.len() - 1].len() > 1 {
            covectors.push(pull_back(&covectors[covectors.len() - 1], start));
        }
        covectors.reverse();
        covectors
    }

    /// β of each stage: a raw multiplier λ of the stage adds the impulse h β λ. They sum to 1.
    pub fn impulse_weights(&self) -> &[f64] {
        &self.weights
    }
}

/// β of a stage with this [`response`](Stage::response), and with this covector when it is done: a raw multiplier λ
/// changes the momentum by h β λ.
pub(crate) fn impulse_weight(response: [f64; 3], covector: &[[f64; 3]]) -> f64 {
    response.iter().zip(covector[0]).map(|(change, psi)| change * psi).sum()
}

/// The covector before a stage that has the covector `after` when it is done.
fn pull_back(after: &[[f64; 3]], stage: &Stage) -> Vec<[f64; 3]> {
    let width = after.len() - 1;
    let map = Tableau::stage_map(stage, RIGID, width);
    let through = |k: usize, field: usize| (0..3).map(|new| after[0][new] * map[new][3 * k + field]).sum::<f64>();
    (0..width).map(|k| std::array::from_fn(|field| after[k + 1][field] + through(k, field))).collect()
}

/// A vector in the null space of a small matrix of rank deficiency one, by elimination with complete pivoting.
fn null_vector(mut a: Vec<Vec<f64>>) -> Vec<f64> {
    let n = a.len();
    let mut columns: Vec<usize> = (0..n).collect();
    for k in 0..n - 1 {
        let magnitude = |&(i, j): &(usize, usize)| a[i][columns[j]].abs();
        let places = (k..n).flat_map(|i| (k..n).map(move |j| (i, j)));
        let best = places.max_by(|x, y| magnitude(x).total_cmp(&magnitude(y)));
        let Some((i, j)) = best else { break };
        a.swap(k, i);
        columns.swap(k, j);
        let (pivots, rest) = a.split_at_mut(k + 1);
        let pivot = &pivots[k];
        for row in rest {
            let factor = row[columns[k]] / pivot[columns[k]];
            if factor.is_finite() {
                row.iter_mut().zip(pivot).for_each(|(x, p)| *x -= factor * p);
            }
        }
    }
    let mut x = vec![0.0; n];
    x[columns[n - 1]] = 1.0;
    for k in (0..n - 1).rev() {
        let sum: f64 = columns[k + 1..].iter().map(|&j| a[k][j] * x[j]).sum();
        x[columns[k]] = -sum / a[k][columns[k]];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn malformed_tableaux_are_refused() {
        let good = Stage::new(Rows { u: Z, v: Z - U[0], a: Z - U[0] - V[0] });
        assert!(Tableau::single(good).check("good").is_ok());
        let mut bad = good;
        bad.recovery.v.z = f64::NAN;
        assert!(Tableau::single(bad).check("bad").is_err());
        let mut bad = good;
        bad.recovery.a.z = 0.0;
        assert!(Tableau::single(bad).check("bad").is_err());
        assert!(Tableau::staged(vec![]).check("bad").is_err());
        assert!(Tableau::single(good.ending_at(0.5)).check("bad").is_err());
        let with = |contact| Tableau::single(good.with_contact(contact)).check("contact");
        assert!(with(ContactLevel::Position { lead: 1.0 }).is_ok());
        assert!(with(ContactLevel::Position { lead: -0.5 }).is_err());
        assert!(with(ContactLevel::Position { lead: f64::NAN }).is_err());
        let forecast = |forecast, forecast_at| with(ContactLevel::Velocity { lead: 0.0, forecast, forecast_at });
        assert!(forecast(U[0] + 0.5 * V[0], 0.5).is_ok());
        assert!(forecast(Z, 1.0).is_err() && forecast(U[0], f64::INFINITY).is_err());
    }
}
