//! Which contact laws a scheme and a contact solver can serve, and why not the others.

use crate::contact::{ContactId, ContactLaw, Measure};
use crate::contact_solver::{AdmissibleSet, ContactSolver};
use crate::corrector::{Corrector, Verdict};
use crate::error::{Error, Result};
use crate::integrator::TimeIntegrator;
use crate::real::Real;
use crate::tableau::{ContactLevel, Tableau};

/// Which laws a scheme and a contact solver can serve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Admitted {
    pub(crate) integrator: String,
    /// Why laws on a predicted gap are refused, if they are.
    pub(crate) no_prediction: Option<&'static str>,
    /// Why rigid laws are refused, if they are.
    pub(crate) no_rigid: Option<&'static str>,
    /// Why coefficients of restitution above zero are refused, if they are.
    pub(crate) no_restitution: Option<&'static str>,
    /// Why laws that read the gap at the start of a stage are refused, if they are, and why the persistency switch is.
    pub(crate) no_start: Option<&'static str>,
    pub(crate) no_switch: Option<&'static str>,
    /// The correction that cannot act on the persistency switch, and why not.
    pub(crate) uncorrected_switch: Option<(String, &'static str)>,
    /// The correction that does not let contacts rebound, and why not.
    pub(crate) unrestored: Option<(String, &'static str)>,
    /// Why friction is refused, if it is.
    pub(crate) no_friction: Option<&'static str>,
    /// The contact solver, if it does not accept some sets, and these sets.
    pub(crate) solver: String,
    pub(crate) no_sets: Vec<AdmissibleSet>,
}

impl Admitted {
    /// Refuses a law that the scheme, or the contact solver, cannot serve.
    pub(crate) fn check(&self, law: ContactLaw) -> Result<()> {
        if self.no_sets.contains(&AdmissibleSet::from(law)) {
            return Err(Error::Incompatible {
                part: format!("{law:?} with {}", self.solver),
                reason: "the contact solver does not take what this law asks of its multipliers; choose `ActiveSet`",
            });
        }
        let switches = law.measure(true) == Measure::Rate;
        if let Some((corrector, reason)) = self.uncorrected_switch.as_ref().filter(|_| switches) {
            return Err(Error::Incompatible { part: format!("{law:?} with {corrector}"), reason });
        }
        if let Some((corrector, reason)) = self.unrestored.as_ref().filter(|_| law.rebounds()) {
            return Err(Error::Incompatible { part: format!("{law:?} with {corrector}"), reason });
        }
        let reasons = [
            self.no_rigid.filter(|_| law.needs_multiplier()),
            self.no_restitution.filter(|_| law.rebounds()),
            self.no_start.filter(|_| law.reads_start()),
            self.no_switch.filter(|_| switches),
            self.no_prediction.filter(|_| law.is_predictive()),
        ];
        match reasons.into_iter().flatten().next() {
            None => Ok(()),
            Some(reason) => Err(Error::Incompatible { part: self.integrator.clone(), reason }),
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
        let set = AdmissibleSet::with_friction(friction, tangents, false);
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

/// The contact laws that a scheme and a contact solver can serve.
pub(crate) fn admitted<T: Real>(
    integrator: &dyn TimeIntegrator,
    tableau: &Tableau,
    solver: &dyn ContactSolver<T>,
    (correctors, by_default): (&[Box<dyn Corrector<T> + '_>], bool),
) -> Admitted {
    // Corrections pose problems with contacts that do not open.
    let corrects = (by_default || !correctors.is_empty())
        && tableau.stages.iter().all(|stage| stage.contact == ContactLevel::POSITION);
    let kinds: &[bool] = if corrects { &[false, true] } else { &[false] };
    let cone = |tangents| kinds.iter().map(move |&held| AdmissibleSet::with_friction(0.0, tangents, held));
    let sets = AdmissibleSet::OF_LAWS.into_iter().chain((1..=2).flat_map(cone));
    let no_sets: Vec<_> = sets.filter(|&set| !solver.admits(set)).collect();
    // Formatting it takes longer than a step of a small system.
    let solver = if no_sets.is_empty() { String::new() } else { format!("{solver:?}") };
    let mut admitted = Admitted { integrator: integrator.name(), solver, no_sets, ..Admitted::default() };
    admitted.no_friction = correctors.iter().find_map(|corrector| corrector.requirements(tableau).friction.err());
    let with_name = |corrector: &dyn Corrector<T>, verdict: Verdict| Some((corrector.name(), verdict.err()?));
    admitted.uncorrected_switch = correctors
        .iter()
        .find_map(|corrector| with_name(&**corrector, corrector.requirements(tableau).persistency_switch));
    let predicts = |contact| matches!(contact, ContactLevel::Position { .. }) && contact.lead() > 0.0;
    if tableau.stages.len() > 1 || !tableau.stages.iter().all(|stage| predicts(stage.contact)) {
        admitted.no_prediction = Some(
            "it does not impose contact on the displacements of the step ahead, which the stabilized bipenalty \
             predicts; choose `CentralDifference`",
        );
    }
    admitted.unrestored = correctors
        .iter()
        .filter(|corrector| corrects && !corrector.effects().corrects_massless)
        .find_map(|corrector| with_name(&**corrector, corrector.requirements(tableau).restitution));
    for stage in &tableau.stages {
        if stage.contact_row().z == 0.0 && admitted.no_friction.is_none() {
            admitted.no_friction = Some(
                "the scheme's displacements do not contain the unknown, so that no multiplier holds what sticks; \
                 choose another scheme",
            );
        }
        match stage.contact {
            ContactLevel::POSITION => {}
            ContactLevel::Position { .. } => {
                admitted.no_start = Some(
                    "it imposes contact ahead of the state, and the gap at the start of a step says nothing of that; \
                     choose a scheme that imposes it on the displacements of the state",
                );
            }
            ContactLevel::Velocity { .. } => {
                admitted.no_start = Some(
                    "it imposes contact on velocities already; choose `ContactLaw::Rigid`, or a scheme that imposes it \
                     on the displacements of the state",
                );
            }
        }
        if stage.recovery.v.z <= 0.0 {
            admitted.no_switch = Some(
                "its velocities do not contain the unknown, so a multiplier cannot hold the rate of a closed contact; \
                 choose another contact law",
            );
        }
        match stage.contact {
            ContactLevel::Position { .. } => {
                if stage.contact != ContactLevel::POSITION {
                    admitted.no_restitution = Some(
                        "it imposes contact on displacements ahead of the state, whose velocities are not corrected; \
                         choose a scheme that imposes it on velocities, or on the displacements of the state",
                    );
                } else if correctors.is_empty() && !by_default {
                    admitted.no_restitution = Some(
                        "it imposes contact on displacements, and contacts leave by a correction of velocities: choose \
                         `PersistencyCorrection::with_history_projection`",
                    );
                }
                if stage.contact_row().z == 0.0 {
                    admitted.no_rigid = Some(
                        "its displacements do not contain the unknown, so a multiplier cannot close a gap; choose a \
                         compliant law",
                    );
                }
            }
            ContactLevel::Velocity { .. } if stage.contact_row().z == 0.0 => {
                admitted.no_rigid = Some(
                    "its velocities do not contain the unknown, so a multiplier cannot stop an approach; choose a \
                     compliant law",
                );
            }
            ContactLevel::Velocity { .. } => {}
        }
    }
    admitted
}
