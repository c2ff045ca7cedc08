//! The stability of degrees of freedom without mass.

use crate::tableau::Tableau;

/// The factor by which an error in the displacement of a dof without mass grows in a step: its balance is algebraic, 0
/// = f(ū), and ū = α u + (1 − α) u₀ carries an error of u₀ over by −(1 − α)/α. `None` if the displacement of such a dof
/// is not determined (explicit schemes), or not by that of the previous state alone.
///
/// Below 1 in size errors decay, and a [`Simulation`](crate::Simulation) takes dofs without mass; at 1 they alternate
/// forever. Explicit stages whose displacements are known before their balance bring such dofs into static balance
/// there, and carry no error over. Zero for every scheme whose balance holds at its own state; −α_f/(1 − α_f) for
/// generalized-α (theory, section 15).
///
/// ```
/// use contact_dynamics::{CentralDifference, GeneralizedAlpha, MoreauJean, Newmark, TimeIntegrator, analysis};
/// assert_eq!(analysis::massless_factor(&Newmark::trapezoidal().tableau()), Some(0.0));
/// let factor = analysis::massless_factor(&GeneralizedAlpha::chung_hulbert(0.8)?.tableau()).unwrap();
/// assert!((factor + 0.8).abs() < 1e-12);
/// assert!((analysis::massless_factor(&MoreauJean::new(0.5)?.tableau()).unwrap() + 1.0).abs() < 1e-12);
/// assert_eq!(analysis::massless_factor(&CentralDifference.tableau()), None);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn massless_factor(tableau: &Tableau) -> Option<f64> {
    let factor = |stage: &crate::tableau::Stage| {
        let (displacement, balance) = (stage.recovery.u, stage.balance.u);
        let share = balance.z / displacement.z;
        if share == 0.0 || !share.is_finite() {
            return None;
        }
        let rest = balance - share * displacement;
        let others = rest.v.iter().chain(&rest.a).chain(&rest.u[1..]);
        let alone = others.into_iter().all(|c| c.abs() < 1e-12);
        alone.then_some(-rest.u[0] / share).map(|factor| if factor.abs() < 1e-12 { 0.0 } else { factor })
    };
    tableau.stages.iter().map(factor).try_fold(1.0, |product, factor| Some(product * factor?))
}

/// Whether every stage of a scheme knows its displacements before its forces, and balances forces at these
/// displacements: dofs without mass can then be brought into static balance with the others, before anything else of
/// the stage is solved.
pub(crate) fn massless_follow(tableau: &Tableau) -> bool {
    tableau.stages.iter().all(|stage| {
        stage.recovery.u.z == 0.0 && stage.balance.u == stage.recovery.u && (stage.load - stage.end).abs() < 1e-12
    })
}
