//! The stability of degrees of freedom without mass.

use crate::rounding::ONLY_ROUNDING;
use crate::tableau::Tableau;

/// The factor by which an error in the displacement of a dof without mass grows in a step: its balance is algebraic,
/// 0 = f(ū), and ū = α u + (1 − α) u₀ multiplies an error of u₀ by −(1 − α)/α. `None` if the displacement of such a
/// dof is not determined (explicit schemes), or depends on more than the displacement of the previous state.
///
/// If its magnitude is below 1, errors decay, and a [`Simulation`](crate::Simulation) accepts dofs without mass; at 1
/// they alternate forever. Explicit stages whose displacements are known before their balance bring such dofs into
/// static balance and carry no error over. Zero for every scheme whose balance holds at its own state; −α_f/(1 − α_f)
/// for generalized-α (theory, section 15).
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
        let alone = others.into_iter().all(|c| c.abs() < ONLY_ROUNDING);
        alone.then_some(-rest.u[0] / share).map(|factor| if factor.abs() < ONLY_ROUNDING { 0.0 } else { factor })
    };
    tableau.stages.iter().map(factor).try_fold(1.0, |product, factor| Some(product * factor?))
}

/// Whether every stage of a scheme knows its displacements before its forces and balances forces at these
/// displacements: dofs without mass can then be brought into static balance before the rest of the stage is solved.
pub(crate) fn massless_follow(tableau: &Tableau) -> bool {
    tableau.stages.iter().all(|stage| {
        stage.recovery.u.z == 0.0
            && stage.balance.u == stage.recovery.u
            && (stage.load - stage.end).abs() < ONLY_ROUNDING
    })
}

/// Whether every stage of a scheme changes v by the mean of two accelerations, and u by the mean of two velocities up
/// to a multiple of the change of a, the same in all stages, with the balance at these states. The energy that such a
/// scheme conserves changes by the work of the mean contact force over each stage (theory, section 15.1).
pub(crate) fn steps_by_means(tableau: &Tableau) -> bool {
    // Each value is a combination of u, h v and h² a at the start of the step, and of the unknowns of its stages.
    type Values = Vec<f64>;
    let size = 3 + tableau.stages.len();
    let unit = |i: usize| (0..size).map(|j| if i == j { 1.0 } else { 0.0 }).collect::<Values>();
    let mut states: Vec<[Values; 3]> = vec![[unit(0), unit(1), unit(2)]];
    let (mut multiple, mut before): (Option<f64>, f64) = (None, 0.0);
    let is_small = |x: &f64| x.abs() < ONLY_ROUNDING;
    for (s, stage) in tableau.stages.iter().enumerate() {
        if stage.balance != stage.recovery || (stage.load - stage.end).abs() > ONLY_ROUNDING {
            return false;
        }
        let mut new = [const { Values::new() }; 3];
        for (value, row) in new.iter_mut().zip(stage.recovery.each()) {
            *value = unit(3 + s).iter().map(|x| row.z * x).collect();
            for k in 0..row.depth() {
                let past = row.past(k);
                let Some(state) = states.iter().rev().nth(k) else {
                    if past.iter().all(is_small) {
                        continue;
                    }
                    return false;
                };
                for (field, c) in state.iter().zip(past) {
                    value.iter_mut().zip(field).for_each(|(value, x)| *value += c * x);
                }
            }
        }
        let (old, length) = (&states[s], stage.end - before);
        let change = |field: usize, i: usize| new[field][i] - old[field][i];
        let mean = |field: usize, i: usize| 0.5 * length * (new[field][i] + old[field][i]);
        if !(0..size).all(|i| is_small(&(change(1, i) - mean(2, i)))) {
            return false;
        }
        let Some(largest) = (0..size).max_by(|&i, &j| change(2, i).abs().total_cmp(&change(2, j).abs())) else {
            return false;
        };
        let ratio = (change(0, largest) - mean(1, largest)) / change(2, largest);
        let agrees = multiple.is_none_or(|multiple| is_small(&(multiple - ratio)));
        if !agrees || !(0..size).all(|i| is_small(&(change(0, i) - mean(1, i) - ratio * change(2, i)))) {
            return false;
        }
        (multiple, before) = (Some(ratio), stage.end);
        states.push(new);
    }
    true
}
