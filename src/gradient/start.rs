//! The transpose of the state at the start: accelerations from the balance with the contacts that touch, and the past.

use super::Balance;
use super::backward::{Back, Seeds, find_candidates};
use super::conditions::released;
use super::turning::Turning;
use crate::error::Result;
use crate::real::Real;
use crate::simulation::Simulation;
use crate::state::{Change, Motion, Rule, StartingPast, Tape};

/// From the derivatives by the stored states at the start, newest first, and by what the objective reads there, to
/// those by the initial displacements and velocities.
pub(super) fn start_back<T: Real>(
    (run, tape, h): (&mut Simulation<'_, T>, &Tape<T>, f64),
    back: &mut Back<'_, T>,
    seeds: Seeds<T>,
    states: Vec<Motion<T>>,
) -> Result<[Vec<T>; 2]> {
    // v and a at the time of the start. The stored velocity is v + shift h a.
    let Seeds { rates: [mut v, mut a], force, .. } = seeds;
    let mut states = states.into_iter();
    let Some(newest) = states.next() else { return Ok([v, a]) };
    let mut u = newest.u;
    T::axpy(T::one(), &newest.v, &mut v);
    T::axpy(T::one(), &newest.a, &mut a);
    T::axpy(T::of(run.scheme.shifts[0] * h), &newest.v, &mut a);
    let reaches = if tape.past == StartingPast::Unknown { 0 } else { run.scheme.depth - 1 };
    for (k, past) in (1_u32..).zip(states.take(reaches)) {
        let age = f64::from(k) * h;
        T::axpy(T::one(), &past.u, &mut u);
        T::axpy(T::of(-age), &past.u, &mut v);
        T::axpy(T::one(), &past.v, &mut v);
        if tape.past == StartingPast::Expanded {
            T::axpy(T::of(0.5 * age * age), &past.u, &mut a);
            T::axpy(T::of(-age), &past.v, &mut a);
            T::axpy(T::one(), &past.a, &mut a);
        }
    }
    back.prescribed.iter().for_each(|&dof| a[dof] = T::zero());

    // M a = f + Gᵀ λ with G a + γ = 0 on the contacts that press.
    let turns = !run.constraints.is_affine();
    if turns {
        find_candidates(run, (&tape.start.motion, h), &tape.start.contacts.ids)?;
    }
    let Simulation { parts, constraints, g, .. } = run;
    let contacts = &tape.start.contacts;
    let (mut rows, mut rules) = (Vec::new(), Vec::new());
    for &row in &tape.held {
        let (normal, force) = (rows.len(), contacts.lambda[row]);
        let bound = T::of(contacts.tangents.friction(row)) * force;
        rows.push(row);
        rules.push(Rule::Closed);
        let own = contacts.tangents.of(row);
        rules.extend(Rule::of_friction(normal, force, &contacts.lambda[own.clone()], (bound, T::one())));
        rows.extend(own);
    }
    let (mut w, mut turned) = (a, None);
    back.projection.apply_inverse(&mut w)?;
    if !rows.is_empty() {
        // Rows that turn are those of the search above.
        let recorded = tape.steps.first().and_then(|step| step.stages.first()).map(|stage| &stage.rows);
        let g = if let Some(rows) = recorded.filter(|_| !turns) {
            back.follow(rows);
            rows
        } else {
            back.projection.reset();
            &*g
        };
        let mut psi: Vec<T> = rows.iter().map(|&row| g.product(row, &w) + force[row]).collect();
        back.solve_jumps((g, &rows), &rules, &mut psi, contacts)?;
        let name = |k: usize| contacts.ids[contacts.tangents.owner(rows[k])];
        back.add_friction(&rules, |k| (name(k), psi[k]), |k| contacts.lambda[rows[k]]);
        let closed = released(&rules, &psi);
        back.projection.push(g, (&rows, &closed), -T::one(), &mut w)?;
        turned = turns.then_some((rows, closed));
    }
    if let Some((rows, closed)) = turned {
        let multipliers = rows.iter().map(|&row| contacts.lambda[row]).collect();
        let change = Change { rows, multipliers, ..Change::new(0, 2) };
        let solved = Motion {
            v: tape.start.velocity().to_vec(),
            a: tape.start.acceleration().to_vec(),
            ..tape.start.motion.clone()
        };
        let mut new = Motion { t: solved.t, u, v, a: Vec::new() };
        Turning { constraints, g, h }.undo_change(&change, &closed, &w, &solved, &mut new)?;
        (u, v) = (new.u, new.v);
    }
    let (system, start) = (&mut *parts.system, &tape.start);
    let (t, displacement) = (start.time(), start.displacement());
    let (velocity, acceleration) = (start.velocity(), start.acceleration());
    back.parameters.force(system, &Balance { t, displacement, velocity, acceleration }, &w)?;
    back.parameters.inertia(system, acceleration, &w)?;
    back.tangents.evaluate(system, (t, displacement, velocity))?;
    back.tangents.add_stiffness(system, -T::one(), &w, &mut u);
    back.tangents.add_damping(system, -T::one(), &w, &mut v);
    for &dof in &back.prescribed {
        (u[dof], v[dof]) = (T::zero(), T::zero());
    }
    Ok([u, v])
}
