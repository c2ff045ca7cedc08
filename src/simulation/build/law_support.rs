//! Which contact laws and friction a scheme, its corrections and a contact solver support, and why not the others.

use crate::contact::{ContactId, ContactLaw, Measure};
use crate::contact_solver::{AdmissibleSet, ContactSolver};
use crate::corrector::{Corrector, Effects, Requirements, Verdict};
use crate::error::{Error, Result};
use crate::integrator::TimeIntegrator;
use crate::real::Real;
use crate::tableau::{ContactLevel, Stage, Tableau};

/// A corrector as far as it is checked when a simulation is built.
pub(crate) struct ListedCorrector {
    pub(crate) name: String,
    pub(crate) requirements: Requirements,
    pub(crate) effects: Effects,
}

impl ListedCorrector {
    pub(crate) fn list<T: Real>(correctors: &[Box<dyn Corrector<T> + '_>], tableau: &Tableau) -> Vec<Self> {
        let listed = |corrector: &dyn Corrector<T>| Self {
            name: corrector.name(),
            requirements: corrector.requirements(tableau),
            effects: corrector.effects(),
        };
        correctors.iter().map(|corrector| listed(&**corrector)).collect()
    }
}

/// The laws and the friction that a run refuses.
#[derive(Clone, Debug)]
pub(crate) struct LawSupport {
    refusals: Vec<Refusal>,
    /// Why friction is refused, if it is.
    no_friction: Option<&'static str>,
    /// The contact solver, if it does not accept some sets, and these sets.
    solver: String,
    no_sets: Vec<AdmissibleSet>,
}

/// Laws that are refused, by a scheme or by a corrector.
#[derive(Clone, Debug)]
struct Refusal {
    concerns: fn(ContactLaw) -> bool,
    by: By,
    reason: &'static str,
}

#[derive(Clone, Debug)]
enum By {
    Scheme(String),
    Corrector(String),
}

fn switches(law: ContactLaw) -> bool {
    law.measure(true) == Measure::Rate
}

fn rebounds(law: ContactLaw) -> bool {
    law.rebounds()
}

impl LawSupport {
    /// Of a scheme with its corrections, and a contact solver.
    pub(crate) fn of<T: Real>(
        integrator: &dyn TimeIntegrator,
        tableau: &Tableau,
        solver: &dyn ContactSolver<T>,
        (correctors, by_default): (&[ListedCorrector], bool),
    ) -> Self {
        let is_corrected = by_default || !correctors.is_empty();
        let corrects = is_corrected && tableau.stages.iter().all(|stage| stage.contact == ContactLevel::POSITION);
        let cones = (1..=2).map(|tangents| AdmissibleSet::with_friction(0.0, tangents));
        let sets = AdmissibleSet::OF_LAWS.into_iter().chain(cones);
        let no_sets: Vec<_> = sets.filter(|&set| !solver.admits(set)).collect();
        // Formatting it takes longer than a step of a small system.
        let solver = if no_sets.is_empty() { String::new() } else { format!("{solver:?}") };

        let mut refusals = Vec::new();
        let mut by_corrector = |concerns, corrector: &ListedCorrector, verdict: Verdict| {
            refusals.extend(verdict.err().map(|reason| {
                let by = By::Corrector(corrector.name.clone());
                Refusal { concerns, by, reason }
            }));
        };
        for corrector in correctors {
            let Requirements { persistency_switch, restitution, .. } = corrector.requirements;
            by_corrector(switches, corrector, persistency_switch);
            if corrects && !corrector.effects.corrects_massless {
                by_corrector(rebounds, corrector, restitution);
            }
        }
        let by_scheme =
            tableau.stages.iter().flat_map(|stage| stage_refusals(stage, is_corrected)).chain(prediction(tableau));
        refusals.extend(by_scheme.map(|(concerns, reason)| {
            let by = By::Scheme(integrator.name());
            Refusal { concerns, by, reason }
        }));
        let undetermined = tableau.stages.iter().any(|stage| stage.contact_row().z == 0.0);
        let by_scheme = undetermined.then_some(
            "the scheme's displacements do not contain the unknown, so that no multiplier holds what sticks; choose \
             another scheme",
        );
        let by_corrector = correctors.iter().find_map(|corrector| corrector.requirements.friction.err());
        Self { refusals, no_friction: by_corrector.or(by_scheme), solver, no_sets }
    }

    /// Refuses a law that scheme, corrections or contact solver do not support.
    pub(crate) fn check(&self, law: ContactLaw) -> Result<()> {
        if self.no_sets.contains(&AdmissibleSet::from(law)) {
            return Err(Error::Incompatible {
                part: format!("{law:?} with {}", self.solver),
                reason: "the contact solver does not take what this law asks of its multipliers; choose `ActiveSet`",
            });
        }
        match self.refusals.iter().find(|refusal| (refusal.concerns)(law)) {
            None => Ok(()),
            Some(Refusal { by: By::Scheme(name), reason, .. }) => {
                Err(Error::Incompatible { part: name.clone(), reason })
            }
            Some(Refusal { by: By::Corrector(name), reason, .. }) => {
                Err(Error::Incompatible { part: format!("{law:?} with {name}"), reason })
            }
        }
    }

    /// Refuses friction coefficients that are negative or not finite, friction without a direction, and friction that
    /// law, contact solver, scheme or corrections cannot serve.
    pub(crate) fn check_friction(
        &self,
        contact: ContactId,
        (friction, law, tangents): (f64, ContactLaw, usize),
    ) -> Result<()> {
        if !(friction >= 0.0 && friction.is_finite()) {
            let range = "not negative and finite";
            return Err(Error::Parameter { name: "a friction coefficient", value: friction, range });
        }
        let set = AdmissibleSet::with_friction(friction, tangents);
        let kind = |other: &AdmissibleSet| other.rows() == set.rows();
        let reasons = [
            (tangents == 0 || tangents > 2)
                .then_some("its constraint gives no tangent, or more than two: one in the plane, two in space"),
            (!law.admits_friction()).then_some(
                "friction goes with laws of one instant that only press: `Rigid`, `Restitution`, `Penalty`, \
                 `PowerLaw`, `KelvinVoigt`, `HuntCrossley`, `AugmentedLagrangian`",
            ),
            self.no_sets.iter().any(kind).then_some("the contact solver takes no friction; choose `ActiveSet`"),
            self.no_friction,
        ];
        match reasons.into_iter().flatten().next() {
            None => Ok(()),
            Some(reason) => Err(Error::Incompatible { part: format!("friction of contact {contact}"), reason }),
        }
    }
}

/// Laws that a stage cannot impose, and why.
fn stage_refusals(stage: &Stage, is_corrected: bool) -> impl Iterator<Item = (fn(ContactLaw) -> bool, &'static str)> {
    let undetermined = stage.contact_row().z == 0.0;
    let (is_position, on_velocity) =
        (stage.contact == ContactLevel::POSITION, matches!(stage.contact, ContactLevel::Velocity { .. }));
    let rigid = undetermined.then_some(match on_velocity {
        true => {
            "its velocities do not contain the unknown, so a multiplier cannot stop an approach; choose a compliant law"
        }
        false => {
            "its displacements do not contain the unknown, so a multiplier cannot close a gap; choose a compliant law"
        }
    });
    let restitution = (!(on_velocity || is_position && is_corrected)).then_some(match is_position {
        true => {
            "it imposes contact on displacements, and contacts leave by a correction of velocities: choose \
             `PersistencyCorrection::with_history_projection`"
        }
        false => {
            "it imposes contact on displacements ahead of the state, whose velocities are not corrected; choose a \
             scheme that imposes it on velocities, or on the displacements of the state"
        }
    });
    let start = (!is_position).then_some(match on_velocity {
        true => {
            "it imposes contact on velocities already; choose `ContactLaw::Rigid`, or a scheme that imposes it on the \
             displacements of the state"
        }
        false => {
            "it imposes contact ahead of the state, and the gap at the start of a step says nothing of that; choose a \
             scheme that imposes it on the displacements of the state"
        }
    });
    let switch = (stage.recovery.v.z <= 0.0).then_some(
        "its velocities do not contain the unknown, so a multiplier cannot hold the rate of a closed contact; choose \
         another contact law",
    );
    let refusals: [(Concerns, Option<&'static str>); 4] = [
        (|law| law.needs_multiplier(), rigid),
        (rebounds, restitution),
        (|law| law.reads_start(), start),
        (switches, switch),
    ];
    refusals.into_iter().filter_map(|(concerns, reason)| Some((concerns, reason?)))
}

/// Whether a refusal concerns a law.
type Concerns = fn(ContactLaw) -> bool;

/// Why laws on a predicted gap are refused, if they are.
fn prediction(tableau: &Tableau) -> Option<(Concerns, &'static str)> {
    let predicts = |contact| matches!(contact, ContactLevel::Position { .. }) && contact.lead() > 0.0;
    let refuses = tableau.stages.len() > 1 || !tableau.stages.iter().all(|stage| predicts(stage.contact));
    let reason = "it does not impose contact on the displacements of the step ahead, which the stabilized bipenalty \
                  predicts; choose `CentralDifference`";
    refuses.then_some((|law| law.is_predictive(), reason))
}
