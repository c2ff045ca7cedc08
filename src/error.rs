//! The error type of the crate: every variant carries its numbers and says what to do.

mod check;
pub(crate) mod text;

#[cfg(test)]
mod page;

pub(crate) use check::positive;
pub(crate) use text::few;

use crate::contact_failure::ContactFailure;
use crate::contact_id::ContactId;
use text::{bytes_requested, moment, tangent_remedy};

/// What failed, where, and with which numbers.
///
/// Numbers are reported as `f64` for any scalar of the run; messages round them, the fields have all digits. The
/// message of an error contains the message of its cause, and [`source`](std::error::Error::source) does not return
/// the cause again, so that printing the chain of sources repeats nothing. A failed step leaves state and history
/// bitwise unchanged.
///
#[doc = include_str!("../docs/errors.md")]
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A vector or matrix has the wrong size.
    #[error("{what} has size {found}, expected {expected}")]
    Dimension {
        /// Which input.
        what: &'static str,
        /// The size it must have.
        expected: usize,
        /// The size it has.
        found: usize,
    },
    /// A parameter is outside its range.
    #[error("{name} is {value:e}, it must be {range}")]
    Parameter {
        /// Which parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The admissible range, in words.
        range: &'static str,
    },
    /// An input vector holds NaN or infinity.
    #[error("{what} is not finite at index {index}: {value}")]
    NotFinite {
        /// Which input.
        what: &'static str,
        /// Index of the first such entry.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// An input matrix holds NaN or infinity.
    #[error("the {matrix} matrix is not finite at ({row}, {column}): {value}")]
    MatrixNotFinite {
        /// Which matrix.
        matrix: &'static str,
        /// Row of the first such entry.
        row: usize,
        /// Its column.
        column: usize,
        /// Its value.
        value: f64,
    },
    /// A matrix that must be symmetric is not; both triangles must be stored.
    #[error(
        "the {matrix} matrix is not symmetric: entry ({row}, {column}) is {value:e}, entry ({column}, {row}) is \
         {mirrored:e}; store both triangles (an effective matrix that is not to be symmetric takes the linear solver \
         Lu)"
    )]
    Asymmetric {
        /// Which matrix.
        matrix: &'static str,
        /// Row of the worst entry.
        row: usize,
        /// Its column.
        column: usize,
        /// Its value.
        value: f64,
        /// The value across the diagonal.
        mirrored: f64,
    },
    /// A mass that must be positive is not.
    #[error("the mass of dof {dof} is {value:e}, it must be positive", value = few(*.value))]
    Mass {
        /// The dof.
        dof: usize,
        /// Its (diagonal) mass.
        value: f64,
    },
    /// A degree of freedom does not exist in the system.
    #[error("{what} names dof {dof}, but the system has {dofs} dofs")]
    MissingDof {
        /// The input that names it.
        what: &'static str,
        /// The dof named.
        dof: usize,
        /// Number of dofs of the system.
        dofs: usize,
    },
    /// A degree of freedom is named more than once where each must be named once.
    #[error("{what} names dof {dof} more than once; name each once")]
    RepeatedDof {
        /// The input that names it.
        what: &'static str,
        /// The dof.
        dof: usize,
    },
    /// A contact constraint names a degree of freedom that does not exist in the system.
    #[error("contact constraint {constraint} names dof {dof}, but the system has {dofs} dofs")]
    MissingContactDof {
        /// The index of the constraint, in the order in which they were given.
        constraint: usize,
        /// The dof named.
        dof: usize,
        /// Number of dofs of the system.
        dofs: usize,
    },
    /// A contact constraint names a degree of freedom more than once.
    #[error("contact constraint {constraint} names dof {dof} more than once; `dofs` names each once")]
    RepeatedContactDof {
        /// The index of the constraint, in the order in which they were given.
        constraint: usize,
        /// The dof.
        dof: usize,
    },
    /// An initial value contradicts the prescribed motion.
    #[error("{what} of dof {dof} starts at {given:e}, but its support prescribes {prescribed:e} at the start time")]
    PrescribedStart {
        /// Displacement or velocity.
        what: &'static str,
        /// The dof.
        dof: usize,
        /// The initial value given by the host.
        given: f64,
        /// The prescribed value.
        prescribed: f64,
    },
    /// Something that must have content is empty.
    #[error("{what} is empty; {remedy}")]
    Empty {
        /// The empty input.
        what: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// Two parts do not fit together.
    #[error("{part} cannot be used here: {reason}")]
    Incompatible {
        /// The rejected part.
        part: String,
        /// Why.
        reason: &'static str,
    },
    /// A facet of a contact surface has no front side, or its orientation is opposite to its neighbors'.
    #[error("facet {facet} of a contact surface (nodes {nodes:?}) is inverted: {reason}")]
    InvertedFacet {
        /// Its index in the list of facets.
        facet: usize,
        /// Its nodes.
        nodes: Vec<usize>,
        /// Its defect, and what to do.
        reason: &'static str,
    },
    /// A time-integration tableau is malformed.
    #[error("tableau of {integrator}, stage {stage}: {reason}")]
    Tableau {
        /// Name of the integrator.
        integrator: String,
        /// Index of the stage.
        stage: usize,
        /// Its defect.
        reason: &'static str,
    },
    /// A time-integration tableau does not converge to the motion for any step size: its order is 0.
    #[error(
        "{integrator} is of order 0 in displacement or velocity: its results are no motion of the system, however \
         small the step; check the rows of its tableau with `analysis::order`"
    )]
    InconsistentScheme {
        /// Name of the integrator.
        integrator: String,
    },
    /// A time-integration tableau is zero-unstable: errors of single steps grow without bound for any step size.
    #[error(
        "{integrator} (order {order}) is zero-unstable: without stiffness and damping a step has the spectral radius \
         {radius:e}, or more than the double root 1 of rigid motion; check the rows of its tableau with \
         `analysis::zero_stability`",
        radius = few(*.radius)
    )]
    UnstableScheme {
        /// Name of the integrator.
        integrator: String,
        /// Its order.
        order: u32,
        /// Spectral radius of a step at frequency zero.
        radius: f64,
    },
    /// The step size is beyond the stability limit of the scheme.
    #[error(
        "h = {h:e} is beyond the stability limit of {integrator}: the highest frequency of the system, or the rate of \
         its strongest damping, is {frequency:e} (1/time) or more, for which h may be {largest:e}; take smaller steps \
         or an implicit scheme (`SimulationBuilder::unchecked_stability` takes the step as it is)",
        frequency = few(*.frequency)
    )]
    BeyondStability {
        /// Name of the integrator.
        integrator: String,
        /// The step size.
        h: f64,
        /// The largest step size that is stable.
        largest: f64,
        /// The highest circular frequency of M⁻¹ K found, or the highest rate of M⁻¹ C if that is larger and the
        /// scheme evaluates damping forces before the step.
        frequency: f64,
    },
    /// The step size has become too long: the frequency of a pressed compliant contact, or of a stiffening system,
    /// exceeds the stability limit of the scheme.
    #[error(
        "step from t = {t:e} with h = {h:e}: {} than {integrator} takes: the highest frequency is now {frequency:e} \
         (1/time) or more, and h may be about {largest:e}; take smaller steps (`StepControl` does), a softer contact \
         law, or an implicit scheme (`SimulationBuilder::unchecked_stability` takes the step as it is)",
        stiffer_part(*.contact),
        t = moment(*.t), h = few(*.h), frequency = few(*.frequency), largest = few(*.largest)
    )]
    Stiffened {
        /// Name of the integrator.
        integrator: String,
        /// Time at the start of the step.
        t: f64,
        /// Step size.
        h: f64,
        /// The stiffest contact; `None` if the system itself has stiffened.
        contact: Option<ContactId>,
        /// An estimate of the largest step size that is stable.
        largest: f64,
        /// The highest circular frequency found, of M⁻¹ (K + Gᵀ k G).
        frequency: f64,
    },
    /// A matrix that must be positive definite is not.
    #[error(
        "the {matrix} is not positive definite: pivot of dof {dof} is not positive; look for a body without mass or \
         support, or a negative stiffness"
    )]
    Singular {
        /// Which matrix.
        matrix: &'static str,
        /// Degree of freedom of the failing pivot.
        dof: usize,
    },
    /// An iteration has found a direction along which a matrix that must be positive definite is not.
    #[error(
        "the effective matrix is not positive definite: pᵀAp is {curvature:e} of pᵀdiag(A)p along a direction p of \
         conjugate gradients that is largest at dof {dof}; look for a body without mass or support, or a negative \
         stiffness",
        curvature = few(*.curvature)
    )]
    Indefinite {
        /// pᵀAp over pᵀdiag(A)p.
        curvature: f64,
        /// Degree of freedom at which p is largest.
        dof: usize,
    },
    /// The iterative solution of a linear system did not converge.
    #[error(
        "{method} not converged after {iterations} iterations: relative residual {residual:e}, tolerance \
         {tolerance:e}; take smaller steps, allow more iterations, or use `Cholesky`",
        residual = few(*.residual), tolerance = few(*.tolerance)
    )]
    LinearNotConverged {
        /// Name of the iterative method.
        method: &'static str,
        /// Iterations performed.
        iterations: usize,
        /// The residual reached, relative to the right-hand side.
        residual: f64,
        /// The required residual.
        tolerance: f64,
    },
    /// A mode does not satisfy K φ = ω² M φ, or is not orthonormal to the others.
    #[error(
        "mode {mode} leaves a residual of {residual:e}, tolerance {tolerance:e}; of given modes look at their order of \
         dofs, their units and their normalization (φᵀMφ = 1), of computed ones at masses or stiffnesses that differ \
         by many powers of ten",
        residual = few(*.residual), tolerance = few(*.tolerance)
    )]
    ModeResidual {
        /// The mode, counted from 0.
        mode: usize,
        /// Its residual, relative to the mode.
        residual: f64,
        /// The allowed residual.
        tolerance: f64,
    },
    /// Some modes below a frequency are missing.
    #[error(
        "{found} modes below the circular frequency {frequency:e} (1/time) where the inertia of K − ω²M counts \
         {expected}; give those that are missing, and rigid motions too",
        frequency = few(*.frequency)
    )]
    ModesMissed {
        /// Modes found or given.
        found: usize,
        /// Number of modes that exist.
        expected: usize,
        /// The frequency.
        frequency: f64,
    },
    /// A factorization, or the matrices of contact, do not fit into memory or their index range.
    #[error("no memory for {what}{}", bytes_requested(*.bytes))]
    OutOfMemory {
        /// The data to be allocated.
        what: &'static str,
        /// Requested size; `None` if only the linear algebra library knows it, or if it exceeds the address space.
        bytes: Option<usize>,
    },
    /// A contact row has no effect on any free degree of freedom.
    #[error("contact {contact} acts on no free dof with mass: its row of G is zero or all its dofs are prescribed")]
    EmptyContact {
        /// The contact.
        contact: ContactId,
    },
    /// A contact row refers to a place that is not among the dofs on which its constraint may act.
    #[error(
        "contact {contact} acts on place {place} of its constraint's dofs, but `dofs` lists no such place, or \
         `only_reads` says that no row acts there; rows name places in `dofs`, not dofs of the system"
    )]
    UnlistedPlace {
        /// The contact.
        contact: ContactId,
        /// The place.
        place: usize,
    },
    /// Closed contacts contradict each other: no contact forces satisfy all of them.
    #[error(
        "t = {t:e}: contacts {contact} and {other} contradict each other, {contact} stays violated by {violation:e} \
         (gap units) whatever the forces; a body is squeezed between obstacles or tied twice",
        t = moment(*.t), violation = few(*.violation)
    )]
    ContradictoryContacts {
        /// Time of the stage.
        t: f64,
        /// The contact that is violated most.
        contact: ContactId,
        /// The contact that acts most against it.
        other: ContactId,
        /// The violation, in units of the gap.
        violation: f64,
    },
    /// Friction jams a contact (Painlevé): while it slides, no contact force can stop the approach, since μ |W_nt| ≥
    /// W_nn. At the start of a run an impact stops the slip of one such contact instead
    /// ([`StartAdjustment::impact`](crate::StartAdjustment)). Steps, restarts, and starts with several such contacts
    /// return this error. Only a model with compliance resolves the motion after that.
    #[error(
        "t = {t:e}: contact {contact} jams: with μ = {friction} a unit of its force closes the gap by {friction} × \
         {coupling:e} through friction and opens it by {normal:e} only; lower μ, or give the contact compliance \
         (`ContactLaw::Penalty`)",
        t = moment(*.t), friction = few(*.friction), coupling = few(*.coupling), normal = few(*.normal)
    )]
    Jammed {
        /// Time of the stage.
        t: f64,
        /// The contact.
        contact: ContactId,
        /// μ.
        friction: f64,
        /// W_nn: change of the gap per unit of normal multiplier.
        normal: f64,
        /// W_nt: change of the gap per unit of friction, in the direction in which it is largest.
        coupling: f64,
    },
    /// The effective matrix is not symmetric, so contacts respond unequally to each other, and the contact solver
    /// requires symmetric problems.
    #[error(
        "t = {t:e}: contact {contact} answers to {other} otherwise than {other} to {contact}: the effective matrix is \
         not symmetric; solve contact by ActiveSet or GaussSeidel",
        t = moment(*.t)
    )]
    UnsymmetricContacts {
        /// Time of the stage.
        t: f64,
        /// The contact of the pair with the largest asymmetry.
        contact: ContactId,
        /// The other contact of the pair.
        other: ContactId,
    },
    /// The contact problem was not solved.
    #[error(
        "t = {t:e}: contact problem not solved after {iterations} iterations; contact {contact} misses \
         complementarity by {residual:e} (gap units)",
        t = moment(*.t), residual = few(*.residual)
    )]
    Contact {
        /// Time of the stage.
        t: f64,
        /// Iterations performed.
        iterations: usize,
        /// Worst contact.
        contact: ContactId,
        /// Its complementarity residual, in units of the gap.
        residual: f64,
    },
    /// The repeated linearization of the contact rows did not converge.
    #[error(
        "t = {t:e}: contact not settled after {iterations} linearizations: {what} of contact {contact} still changes \
         by {change:e} (relative), tolerance {tolerance:e}; take smaller steps (`StepControl` does)",
        t = moment(*.t), change = few(*.change)
    )]
    ContactUnsettled {
        /// Time of the stage.
        t: f64,
        /// Number of linearizations; the problem was solved after each.
        iterations: usize,
        /// The contact with the largest change.
        contact: ContactId,
        /// The changing quantity: gap, slip, force or displacement.
        what: &'static str,
        /// Its change between the last two linearizations, relative to its total change by contact.
        change: f64,
        /// The change that would have been accepted.
        tolerance: f64,
    },
    /// A gap changes in time by itself, but its constraint reports no rates.
    #[error(
        "contact {contact}: with displacements held its gap goes from {:e} to {:e} between t = {:e} and {:e}, but its \
         rates are zero; give ∂g/∂t (`ContactConstraint::rates`, or the second entry of a moving offset or gap \
         function), and check it with `verify::gap_jacobian`",
        .gap[0], .gap[1], moment(.t[0]), moment(.t[1])
    )]
    SilentMotion {
        /// The contact.
        contact: ContactId,
        /// The two times.
        t: [f64; 2],
        /// The gap at both times.
        gap: [f64; 2],
    },
    /// The row of a contact is not the derivative of its gap, although its constraint reports that rows do not
    /// change.
    #[error(
        "contact {contact}: between t = {:e} and {:e} displacements change its gap by {:e}, along its row of G by \
         {:e}, and its constraint says that rows do not change; return `Candidates::Changed` from `search` and \
         `follow` when they do, and check them with `verify::gap_jacobian`",
        .t[0], .t[1], .change[0], .change[1]
    )]
    SilentTurn {
        /// The contact.
        contact: ContactId,
        /// The times at the start and end of the step.
        t: [f64; 2],
        /// The change of its gap in the step with obstacles held, and the change along its row.
        change: [f64; 2],
    },
    /// The contact problem of the frame between bodies in separate codes was not solved.
    #[error("contact on the frame: {failure}; rows are those of the assembly")]
    Frame {
        /// The failure, in the numbering of the rows of the assembly and the unit of their gaps.
        failure: ContactFailure<f64>,
    },
    /// The initial state violates a contact constraint.
    #[error(
        "contact {contact} is violated at the start: gap {gap:e}, tolerance {tolerance:e}; start from a gap that is \
         not negative (zero for an equality row), or say by `initial_overclosure` what becomes of it",
        gap = few(*.gap), tolerance = few(*.tolerance)
    )]
    InitialViolation {
        /// The contact.
        contact: ContactId,
        /// Its gap (negative: depth).
        gap: f64,
        /// Rounding tolerance of that gap.
        tolerance: f64,
    },
    /// Dofs without mass were not brought into static balance at the start.
    #[error(
        "dof {dof} and others are not in static balance after {iterations} iterations from the initial displacements; \
         start nearer to it, or give dofs without mass some"
    )]
    StartNotBalanced {
        /// Iterations performed.
        iterations: usize,
        /// One of the dofs.
        dof: usize,
    },
    /// A step produced NaN or infinity.
    #[error("step from t = {t:e} with h = {h:e}: {what} of dof {dof} is {value}", t = moment(*.t), h = few(*.h))]
    StepNotFinite {
        /// Time at the start of the step.
        t: f64,
        /// Step size.
        h: f64,
        /// Which quantity.
        what: &'static str,
        /// First offending dof.
        dof: usize,
        /// Its value.
        value: f64,
    },
    /// Newton's method did not converge.
    #[error(
        "step from t = {t:e} with h = {h:e}: Newton's method not converged after {iterations} iterations; relative \
         residual {residual:e}, relative increment {increment:e}, worst dof {dof}; take smaller steps, check the \
         tangent with `verify::tangent`, or try a line search",
        t = moment(*.t), h = few(*.h), residual = few(*.residual), increment = few(*.increment)
    )]
    NewtonNotConverged {
        /// Time at the start of the step.
        t: f64,
        /// Step size.
        h: f64,
        /// Iterations performed.
        iterations: usize,
        /// Residual relative to the forces.
        residual: f64,
        /// Last increment relative to the total increment.
        increment: f64,
        /// The dof with the largest residual.
        dof: usize,
    },
    /// A step is so small that it would not change the time.
    #[error(
        "step from t = {t:e}: h = {h:e} is below the resolution of times there, {resolution:e}, so that the step \
         would not change t; count time from an origin nearer to the run, or take larger steps",
        h = few(*.h), resolution = few(*.resolution)
    )]
    TimeNotAdvancing {
        /// Time at the start of the step.
        t: f64,
        /// Step size.
        h: f64,
        /// Distance from t to the next time that can be represented.
        resolution: f64,
    },
    /// A step was rejected at its size and at repeated halves of it, down to the smallest allowed.
    #[error(
        "step from t = {t:e} refused {attempts} times, last with h = {h:e}, the smallest allowed: {source}",
        t = moment(*.t), h = few(*.h)
    )]
    StepRefused {
        /// Time at the start of the step.
        t: f64,
        /// The last step size tried.
        h: f64,
        /// Number of attempts.
        attempts: u32,
        /// Why the last attempt failed.
        r#source: Box<Error>,
    },
    /// The effective matrix of an iteration is not positive definite.
    #[error(
        "step from t = {t:e} with h = {h:e}: the effective matrix of iteration {iteration} is not positive definite \
         at dof {dof}: {}",
        tangent_remedy(*.iteration),
        t = moment(*.t), h = few(*.h)
    )]
    IndefiniteTangent {
        /// Time at the start of the step.
        t: f64,
        /// Step size.
        h: f64,
        /// The iteration, from 1.
        iteration: usize,
        /// Degree of freedom of the failing pivot.
        dof: usize,
    },
    /// A gap or a multiplier is NaN or infinite.
    #[error("t = {t:e}: {what} of contact {contact} is {value}", t = moment(*.t))]
    ContactNotFinite {
        /// Time of the stage.
        t: f64,
        /// Gap or multiplier.
        what: &'static str,
        /// The contact.
        contact: ContactId,
        /// Its value.
        value: f64,
    },
    /// An energy or a work is NaN or infinite.
    #[error(
        "t = {t:e}: {what} is {value}; look at the potential energy, load and damping force of the system",
        t = moment(*.t)
    )]
    EnergyNotFinite {
        /// Time of the state.
        t: f64,
        /// Which energy.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A prescribed motion is NaN or infinite.
    #[error("t = {t:e}: the prescribed motion of dof {dof} is {value}", t = moment(*.t))]
    SupportNotFinite {
        /// Time of the motion.
        t: f64,
        /// The prescribed dof.
        dof: usize,
        /// The value (displacement, velocity or acceleration).
        value: f64,
    },
    /// A node has left the facets found for it by the last search.
    #[error(
        "t = {t:e}: contact {contact} has left what the search at the start of the step found; take smaller steps or \
         give the contact a larger reach",
        t = moment(*.t)
    )]
    ContactLost {
        /// Time of the stage.
        t: f64,
        /// The contact.
        contact: ContactId,
    },
    /// A body has passed through another one within a step, or was stopped where the other body is not.
    #[error(
        "step from t = {t:e} with h = {h:e}: contact {contact} {what}; its node, at a gap of {gap:e}, went {way:e} \
         against the surface; take smaller steps (`StepControl` does)",
        t = moment(*.t), h = few(*.h), gap = few(*.gap), way = few(*.way)
    )]
    PassedThrough {
        /// Time at the start of the step.
        t: f64,
        /// Step size.
        h: f64,
        /// The contact.
        contact: ContactId,
        /// What happened.
        what: &'static str,
        /// The displacement of the node against the surface (length).
        way: f64,
        /// Its gap at the start of the step (length).
        gap: f64,
    },
    /// Two facets may have gone through each other in a step
    /// ([`NonPenetration`](crate::contact::NonPenetration)).
    #[error(
        "step from t = {t:e} with h = {h:e}: facets {} and {} of certified surface {constraint} could not be certified \
         to stay apart; their nodes moved by up to {way:e}; take smaller steps (`StepControl` does), and look whether \
         contact has all pairs of bodies",
        facets[0], facets[1], t = moment(*.t), h = few(*.h), way = few(*.way)
    )]
    NotCertified {
        /// Time at the start of the step.
        t: f64,
        /// Step size.
        h: f64,
        /// The certificate, in the order in which constraints were given.
        constraint: usize,
        /// The facets of its surface.
        facets: [usize; 2],
        /// The largest displacement of their nodes (length).
        way: f64,
    },
    /// The host cannot evaluate a trial state; a smaller step may help.
    #[error("the host's {callback} does not admit the state of a step: {source}")]
    Inadmissible {
        /// Which callback.
        callback: &'static str,
        /// The host's own error. If a step failed, the error that adds t and h, with the host's own error as its
        /// source.
        r#source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A step, or another collective call, has failed on another rank and therefore on this one.
    #[error("rank {rank} has failed: {message}")]
    OtherRank {
        /// Number of the first rank that failed.
        rank: usize,
        /// Whether a smaller step may help.
        recoverable: bool,
        /// The message of its error, truncated if long.
        message: String,
    },
    /// A value that must be the same on all ranks differs.
    #[error("ranks differ: {what} lies between {smallest:e} and {largest:e}")]
    RanksDiffer {
        /// The value that must agree.
        what: &'static str,
        /// The smallest value found.
        smallest: f64,
        /// The largest value found, or the required value.
        largest: f64,
    },
    /// A callback of the host panicked in an earlier call and may have left the host's own data incomplete.
    #[error(
        "a callback of the host has panicked in an earlier call: this simulation does not go on; its state and \
         history are those before that call: build another one and `resume` from them, or from copies kept before"
    )]
    Poisoned,
    /// A callback of the host failed.
    #[error("the host's {callback} failed: {source}")]
    Host {
        /// Which callback.
        callback: &'static str,
        /// The host's own error.
        r#source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// The part of a run that has become too stiff for the step size.
fn stiffer_part(contact: Option<ContactId>) -> String {
    contact.map_or_else(|| "the system has become stiffer".into(), |contact| format!("contact {contact} is stiffer"))
}

/// Result with the crate's [`Error`], unless another one is named.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The host's error for a state, with the step that it belongs to.
#[derive(Debug, thiserror::Error)]
#[error("step from t = {t:e} with h = {h:e}: {source}", t = moment(*.t), h = few(*.h))]
struct InStep {
    t: f64,
    h: f64,
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl Error {
    /// Adds the step to the host's error for one of its states.
    pub(crate) fn in_step(self, t: f64, h: f64) -> Self {
        match self {
            Self::Inadmissible { callback, source } => {
                Self::Inadmissible { callback, source: Box::new(InStep { t, h, source }) }
            }
            other => other,
        }
    }

    /// Whether a smaller step may help (a failed step, not a wrong input).
    ///
    /// [`Host`](Self::Host) is never recoverable: a host whose callback may succeed with a smaller step returns
    /// [`Inadmissible`](Self::Inadmissible).
    pub fn is_recoverable(&self) -> bool {
        matches!(
            self,
            Self::Contact { .. }
                | Self::ContactUnsettled { .. }
                | Self::Frame { .. }
                | Self::ContradictoryContacts { .. }
                | Self::Jammed { .. }
                | Self::ContactLost { .. }
                | Self::PassedThrough { .. }
                | Self::NotCertified { .. }
                | Self::Stiffened { .. }
                | Self::NewtonNotConverged { .. }
                | Self::LinearNotConverged { .. }
                | Self::IndefiniteTangent { .. }
                | Self::Inadmissible { .. }
                | Self::StepNotFinite { .. }
                | Self::ContactNotFinite { .. }
                | Self::EnergyNotFinite { .. }
                | Self::SupportNotFinite { .. }
                | Self::OtherRank { recoverable: true, .. }
        )
    }
}
