//! Settings of the step-size control, and the judgment of a step: fine enough, or too coarse.

use crate::analysis::LocalError;
use crate::contact::ContactJacobian;
use crate::error::{Error, Result, positive};
use crate::ranks::Together;
use crate::real::Real;
use crate::state::{Motion, State};

/// How a run controls its step size.
///
/// Steps are the nominal one, given to the builder, divided by powers of two. A step that fails for a reason that a
/// smaller step may avoid ([`Error::is_recoverable`]), or that is judged too coarse, leaves everything unchanged and
/// is repeated with half the size. After two successful steps the size doubles where that meets the nominal grid
/// again, so every nominal time is met. If doubling fails at once, the next doubling waits twice as long. The size
/// does not return to one that was too long for the stiffness of the system ([`Error::Stiffened`]), or of a contact
/// as long as such contacts carry forces: a step beyond the stability limit adds energy before it is detected.
/// [`set_step_size`](crate::Simulation::set_step_size) makes sizes up to the one given admissible again.
///
/// Two criteria may be added: an estimate of the [local error](Self::local_error), and a limit to the
/// [contacts that change](Self::contact_changes) in a step. At the smallest size they are ignored: the step is taken
/// and counted in [`Statistics::coarse_steps`](crate::Statistics::coarse_steps). A failure there is
/// [`Error::StepRefused`], and the run is as it was before the step, with the step size it had.
///
/// Changes of the step size allocate, factorize, and resample the past of multistep schemes
/// ([`set_step_size`](crate::Simulation::set_step_size)).
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation, StepControl};
///
/// // A mass flies at a wall; far from it large steps will do.
/// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
/// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], free)?, GeneralizedAlpha::default(), 0.1)
///     .velocity(vec![-1.0])
///     .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 1.03))
///     .step_control(StepControl::halving(1e-4)?.local_error(1e-3)?)
///     .build()?;
/// let mut smallest = 0.1_f64;
/// run.run_until(2.0, &mut |step: &contact_dynamics::StepView<'_, f64>| {
///     smallest = smallest.min(step.h);
///     contact_dynamics::Control::Continue
/// })?;
/// // The impact is met by steps in which the mass travels at most the tolerance; the others are large again.
/// assert!(smallest <= 1e-3 && run.step_size() == 0.1);
/// assert!(run.statistics().steps < 60 && run.statistics().refused_steps >= 7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepControl {
    pub(crate) smallest: f64,
    pub(crate) tolerance: Option<f64>,
    pub(crate) changes: Option<usize>,
}

impl StepControl {
    /// Halving of refused steps down to `smallest` (time), not below.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn halving(smallest: f64) -> Result<Self> {
        positive("the smallest step size", smallest)?;
        Ok(Self { smallest, tolerance: None, changes: None })
    }

    /// Refuses steps whose local error in any displacement is estimated at more than `tolerance` (length).
    ///
    /// The estimate is the difference between a step and Taylor's expansion of the state it starts from (v and a at
    /// the time of the state), times a factor of the tableau
    /// ([`analysis::local_error`](crate::analysis::local_error)). In a step in which a contact closes or opens the
    /// motion is not smooth and the factor is 1; the estimate is then about the velocity that the contact lost times
    /// the step size, as the instant of impact is uncertain by a step. Velocities are compared as well as
    /// displacements, so corrections do not hide an impact.
    ///
    /// In a step in which a contact begins or ends to slide, or its slip reverses, the acceleration jumps by Δa at an
    /// instant that is uncertain by the step size h. The velocity may then err by h Δa, and this error moves the body
    /// until contacts change again. The estimate is therefore at least h Δa τ. Δa is measured along the tangents of the
    /// contact. τ is about the time between changes of contact: it grows by h in each step, and halves in a step in
    /// which contacts close, open or change their friction. A slip that reverses every half second is found by steps of
    /// about `tolerance`/(0.5 s · Δa). Contacts that change in every step are judged by 2 h² Δa. Friction on dofs
    /// without mass leaves no such error.
    ///
    /// All other errors are errors of one step: the estimate does not contain their sum over a run.
    ///
    /// The estimate detects an impact one step late if the scheme imposes contact ahead of the state, and does not
    /// contain the error of the velocity for some schemes of first order: `build` refuses both.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless positive and finite.
    pub fn local_error(self, tolerance: f64) -> Result<Self> {
        positive("the tolerance of the local error", tolerance)?;
        Ok(Self { tolerance: Some(tolerance), ..self })
    }

    /// Refuses steps in which more than `limit` contacts close or open.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for zero.
    pub fn contact_changes(self, limit: usize) -> Result<Self> {
        match limit {
            0 => Err(Error::Parameter { name: "the limit of contact changes", value: 0.0, range: "1 or more" }),
            limit => Ok(Self { changes: Some(limit), ..self }),
        }
    }

    pub(crate) fn estimates(&self) -> bool {
        self.tolerance.is_some()
    }
}

/// The result of a step that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Accepted,
    /// It was judged too coarse, and undone.
    Coarse,
}

/// Judges steps by the settings of the control.
pub(crate) struct Judge<T> {
    pub(crate) control: StepControl,
    /// The factor of the error estimate, if errors are estimated.
    pub(crate) local: Option<LocalError>,
    /// u, v and a at the time of the state that the step starts from; empty if errors are not estimated.
    start: Motion<T>,
    /// Time over which the error of a velocity lasts, at the start of the step.
    lasting: f64,
    /// Whether contacts or their friction changed in the step judged last.
    pub(crate) changed: bool,
    /// Whether steps are accepted though too coarse, because they cannot be smaller.
    pub(crate) suspended: bool,
    /// The estimate of the step judged last, as a length and divided by the tolerance.
    pub(crate) estimate: f64,
    excess: f64,
    /// Whether the step judged last was too coarse.
    pub(crate) coarse: bool,
}

impl<T: Real> Judge<T> {
    pub(crate) fn new(control: StepControl, local: Option<LocalError>, dofs: usize) -> Self {
        let start = Motion::zero(if local.is_some() { dofs } else { 0 });
        let (estimate, excess) = (0.0, 0.0);
        Self { control, local, start, lasting: 0.0, changed: false, suspended: false, estimate, excess, coarse: false }
    }

    /// Stores the state that a step starts from, and how long the error of a velocity lasts.
    pub(crate) fn begin(&mut self, state: &State<T>, lasting: f64) {
        self.lasting = lasting;
        if self.local.is_some() {
            self.start.u.copy_from_slice(state.displacement());
            self.start.v.copy_from_slice(state.velocity());
            self.start.a.copy_from_slice(state.acceleration());
        }
    }

    /// Judges a step that ends with u and v, also by its contacts: whether the motion jumps because some have closed
    /// or opened, their number, and the error of the velocity if friction jumps.
    pub(crate) fn judge(
        &mut self,
        together: &Together<T>,
        [u, v]: [&[T]; 2],
        prescribed: &[usize],
        h: f64,
        (jumps, changes, velocity_error): (bool, usize, Option<f64>),
    ) -> Result<Verdict> {
        self.excess = 0.0;
        self.changed = jumps || velocity_error.is_some();
        if let (Some(tolerance), Some(local)) = (self.control.tolerance, self.local) {
            let factor = if jumps { 1.0 } else { local.factor };
            // A maximum ignores NaN.
            let distance = self.distance([u, v], prescribed, h);
            let distance = if distance.is_nan() { f64::INFINITY } else { distance };
            let [distance] = together.max(Ok([distance]))?;
            // If a contact closes as well, the acceleration contains its impact. All ranks know all contact dofs.
            let lasting = velocity_error.filter(|_| !jumps).map_or(0.0, |error| error * (self.lasting + h));
            self.estimate = (factor * distance).max(lasting);
            self.excess = self.estimate / tolerance;
        }
        // Written so that NaN is refused.
        let fine = self.excess <= 1.0 && self.control.changes.is_none_or(|limit| changes <= limit);
        self.coarse = !fine;
        Ok(match fine || self.suspended {
            true => Verdict::Accepted,
            false => Verdict::Coarse,
        })
    }

    /// The error of the velocity along some rows at the end of a step of size h in which the acceleration along them
    /// jumps: h times the largest jump. None if there are no rows, or errors are not estimated.
    pub(crate) fn velocity_error(
        &self,
        (g, rows): (&ContactJacobian<T>, impl Iterator<Item = usize>),
        a: &[T],
        h: f64,
    ) -> Option<f64> {
        let a0 = self.local.map(|_| &self.start.a)?;
        let jump = |row| g.row(row).map(|(dof, weight)| weight * (a[dof] - a0[dof])).sum::<T>();
        rows.map(|row| h * jump(row).value().abs()).reduce(f64::max)
    }

    /// Largest distance of the free dofs from Taylor's expansion, in u and in h v.
    fn distance(&self, [u, v]: [&[T]; 2], prescribed: &[usize], h: f64) -> f64 {
        let Motion { u: u0, v: v0, a: a0, .. } = &self.start;
        let mut prescribed = prescribed.iter().peekable();
        let mut largest = 0.0_f64;
        for dof in 0..u.len() {
            if prescribed.next_if(|&&other| other == dof).is_some() {
                continue;
            }
            let (rate, acceleration) = (v0[dof].value(), a0[dof].value());
            let in_u = (u[dof] - u0[dof]).value() - h * (rate + 0.5 * h * acceleration);
            let in_v = h * ((v[dof] - v0[dof]).value() - h * acceleration);
            let distance = in_u.abs().max(in_v.abs());
            if distance > largest || distance.is_nan() {
                largest = distance;
            }
        }
        largest
    }

    /// Whether the error of a step twice as large can be expected to be half the tolerance at most.
    pub(crate) fn may_grow(&self) -> bool {
        self.local.is_none_or(|local| self.excess * f64::from(1_u32 << local.power) <= 0.5)
    }
}
