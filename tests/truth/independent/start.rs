//! The state at the start, and the past that a multistep scheme reads (theory, section 2.4).

use super::correct::leaves_smooth_motion;
use super::dense::{Matrix, add, dot, product, size, solve};
use super::problem::{Contact, Friction, Problem};
use super::stage::is_at_bound;
use super::{Contacts, Motion, Scene, history};
use contact_dynamics::ContactLaw;
use contact_dynamics::tableau::{ContactLevel, StartUp, Tableau};
use contact_dynamics_scenes::combinations::Correction;

/// The states that are known at the start, and the contacts.
pub(crate) fn begin(scene: &Scene, tableau: &Tableau, correction: Correction) -> (Vec<Motion>, Contacts) {
    let (h, rows) = (scene.h, scene.rows.len());
    let mut now = Motion { t: 0.0, u: scene.u.clone(), v: scene.v.clone(), a: vec![0.0; scene.dofs()] };
    if let Some((dof, [u, v, a])) = scene.driven(0.0) {
        (now.u[dof], now.v[dof], now.a[dof]) = (u, v, a);
    }
    let pressed = if scene.damps_massless() {
        balance_rates(scene, &now.u, &mut now.v);
        Vec::new()
    } else {
        settle(scene, &mut now.u, 0.0, 0.0)
    };
    let mut f = scene.force(0.0, &now.u, &now.v);
    add(&mut f, -1.0, &product(&scene.mass, &now.a));
    let driven = now.a.clone();
    now.a = scene.accelerate(&f);
    add(&mut now.a, 1.0, &driven);
    let mut raw = vec![0.0; scene.axes().count()];
    let gaps: Vec<f64> = (0..rows).map(|i| scene.gap(i, 0.0, &now.u)).collect();
    let mut closed = vec![false; rows];
    for (i, row) in scene.rows.iter().enumerate() {
        let depth = (-gaps[i]).max(0.0);
        let force = match row.law {
            ContactLaw::Penalty { stiffness } | ContactLaw::AugmentedLagrangian { stiffness, .. } => stiffness * depth,
            ContactLaw::PowerLaw { stiffness, exponent } => stiffness * depth.powf(exponent),
            ContactLaw::KelvinVoigt { stiffness, damping } if depth > 0.0 => {
                (stiffness * depth - damping * scene.rate(i, now.t, &now.v)).max(0.0)
            }
            ContactLaw::HuntCrossley { stiffness, exponent, dissipation } => {
                stiffness * depth.powf(exponent) * (1.0 - dissipation * scene.rate(i, now.t, &now.v)).max(0.0)
            }
            _ => 0.0,
        };
        (raw[i], closed[i]) = (force, force > 0.0);
    }
    for (i, force) in pressed {
        raw[i] = force;
        closed[i] =
            force > 0.0 || scene.rows[i].law == ContactLaw::Equality || gaps[i] <= scene.rounding(i, 0.0, &now.u);
    }
    push(scene, &raw, 1.0, &mut now.a);
    let (rigid, resting, stopped) = rigid_forces(scene, tableau, &now, &gaps);
    for (i, force) in rigid.iter().enumerate() {
        raw[i] += force;
        if i < rows {
            closed[i] |= *force > 0.0 || resting.contains(&i);
        }
    }
    push(scene, &rigid, 1.0, &mut now.a);
    if leaves_smooth_motion(correction) {
        let jumps = |(i, force): (usize, &f64)| {
            let springs = scene.rows.get(i).is_some_and(|row| row.law.is_compliant() || scene.is_static(i));
            if springs { 0.0 } else { *force }
        };
        let jumps: Vec<f64> = rigid.iter().enumerate().map(jumps).collect();
        push(scene, &jumps, -1.0, &mut now.a);
    }
    let depth = history::depth(tableau);
    let past = |straight: bool| -> Vec<Motion> { (0..depth).map(|k| back(&now, k as f64 * h, straight)).collect() };
    let states = if is_free_flight(scene, &past(true)) {
        past(true)
    } else if scene.start_up == StartUp::Taylor {
        past(false)
    } else {
        vec![now]
    };
    let slides = |i: usize| match (&scene.rows[i].friction, scene.tangent(i)) {
        (Some((coefficient, _)), Some(k)) => stopped.contains(&i) || is_at_bound(raw[k], coefficient * raw[i]),
        _ => false,
    };
    let slides = (0..rows).map(slides).collect();
    let contacts = Contacts { forces: raw.clone(), raw, closed, slides, taken: vec![0.0; rows], gaps };
    (states, contacts)
}

/// What some dofs do under forces, by their part of a matrix; the others stay.
fn answer(matrix: &Matrix, dofs: &[usize], f: &[f64]) -> Vec<f64> {
    let part = dofs.iter().map(|&i| dofs.iter().map(|&j| matrix[i][j]).collect()).collect();
    let found = solve(part, dofs.iter().map(|&dof| f[dof]).collect()).expect("a matrix that is regular");
    let mut x = vec![0.0; f.len()];
    dofs.iter().zip(found).for_each(|(&dof, found)| x[dof] = found);
    x
}

/// Damped dofs without mass begin where they are, with the velocities that balance asks for. (No contact acts on them.)
fn balance_rates(scene: &Scene, u: &[f64], v: &mut [f64]) {
    let Some(damping) = &scene.damping else { return };
    let change = answer(damping, &scene.massless(), &scene.force(0.0, u, v));
    add(v, 1.0, &change);
}

/// Brings dofs without mass into balance, 0 = f_b + G_bᵀ λ with 0 ≤ g ⊥ λ ≥ 0, with the load and the gaps of given
/// times. Returns the multipliers of the rows that act on them.
pub(crate) fn settle(scene: &Scene, u: &mut [f64], t_load: f64, t: f64) -> Vec<(usize, f64)> {
    let dofs = scene.massless();
    let rows: Vec<usize> = (0..scene.rows.len()).filter(|&i| scene.is_static(i)).collect();
    let follow = |f: &[f64]| answer(&scene.stiffness, &dofs, f);
    let free = follow(&scene.force(t_load, u, &vec![0.0; u.len()]));
    add(u, 1.0, &free);
    let responses: Vec<Vec<f64>> = rows.iter().map(|&i| follow(&scene.rows[i].g)).collect();
    let forces = Problem::of_gaps(scene, &rows, &responses, t, u).solve();
    forces.iter().zip(&responses).for_each(|(force, response)| add(u, *force, response));
    rows.into_iter().zip(forces).collect()
}

/// The state a time earlier, on a straight line or by Taylor's expansion.
fn back(now: &Motion, time: f64, straight: bool) -> Motion {
    let mut past = now.clone();
    past.t -= time;
    add(&mut past.u, -time, &now.v);
    if !straight {
        add(&mut past.u, 0.5 * time * time, &now.a);
        add(&mut past.v, -time, &now.a);
    } else if time > 0.0 {
        past.a.fill(0.0);
    }
    past
}

/// Whether no acceleration changes a velocity in a step, now and in a past on a straight line, but by what rounding
/// makes of forces that cancel.
fn is_free_flight(scene: &Scene, past: &[Motion]) -> bool {
    let largest = |x: &[f64]| x.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let sums = |a: &Matrix, by: f64| a.iter().map(|row| by * row.iter().map(|x| x.abs()).sum::<f64>()).collect();
    let rounding = |state: &Motion| {
        let mut forces: Vec<f64> = sums(&scene.stiffness, largest(&state.u));
        if let Some(damping) = &scene.damping {
            add(&mut forces, 1.0, &sums(damping, largest(&state.v)));
        }
        64.0 * f64::EPSILON * (largest(&past[0].v) + scene.h * largest(&scene.accelerate(&forces)))
    };
    let flies = |a: &[f64], state: &Motion| scene.h * largest(a) <= rounding(state);
    let force = |state: &Motion| scene.force(state.t, &state.u, &state.v);
    flies(&past[0].a, &past[0]) && past.iter().skip(1).all(|state| flies(&scene.accelerate(&force(state)), state))
}

/// a += c M⁻¹ Gᵀ r over all rows and tangents.
fn push(scene: &Scene, r: &[f64], c: f64, a: &mut [f64]) {
    for (axis, r) in scene.axes().zip(r) {
        add(a, c * r, &scene.accelerate(axis));
    }
}

/// Multipliers of rigid contacts: of those at rest, or those that a scheme asks for which imposes contact ahead; and
/// which contacts are at rest, pressed or not, and which their friction stops in the first step.
fn rigid_forces(scene: &Scene, tableau: &Tableau, now: &Motion, gaps: &[f64]) -> (Vec<f64>, Vec<usize>, Vec<usize>) {
    let (h, rows) = (scene.h, &scene.rows);
    let level = tableau.stages[tableau.stages.len() - 1].contact;
    let lead = level.lead() * h;
    let mut ahead = now.u.clone();
    add(&mut ahead, lead, &now.v);
    add(&mut ahead, 0.5 * lead * lead, &now.a);
    let mut faster = now.v.clone();
    add(&mut faster, lead, &now.a);
    if let Some((dof, [u, v, _])) = scene.driven(lead) {
        (ahead[dof], faster[dof]) = (u, v);
    }
    let touches = |i: usize| {
        let noise = 64.0 * scene.rounding(i, 0.0, &now.u);
        gaps[i] <= noise + 1e-10 * h * scene.rate(i, 0.0, &now.v).abs()
    };
    let rests = |i: usize| {
        let way = h * scene.rate(i, 0.0, &now.v).abs();
        touches(i) && way <= 64.0 * f64::EPSILON * (size(&rows[i].g, &now.u) + h * size(&rows[i].g, &now.v))
    };
    let acceleration = |i: usize| dot(&rows[i].g, &now.a) + rows[i].offset.at(0.0)[2];
    let inertia = |i: usize| match rows[i].law {
        ContactLaw::Bipenalty { stiffness, mass } => mass / stiffness,
        _ => 0.0,
    };
    let is_predictive = |i: usize| matches!(rows[i].law, ContactLaw::StabilizedBipenalty { .. });
    // y over what a unit of acceleration makes of it.
    let asks = |i: usize| -> Option<f64> {
        let row = &rows[i];
        match (level, level.lead() > 0.0) {
            // λ = −k g − m g̈, or none.
            _ if inertia(i) > 0.0 => Some(acceleration(i) + gaps[i] / inertia(i)),
            (_, true) if is_predictive(i) => {
                // The mean gap of the coming step; the last one is taken to have had the same gap all along.
                let mean = 0.5 * (scene.gap(i, lead, &ahead) + gaps[i]) - (-gaps[i]).max(0.0);
                Some(mean / (0.25 * lead * lead))
            }
            _ if row.law.is_compliant() => None,
            (ContactLevel::Velocity { .. }, true) => {
                let e = if let ContactLaw::Restitution { coefficient } = row.law { coefficient } else { 0.0 };
                touches(i).then(|| (scene.rate(i, lead, &faster) + e * scene.rate(i, 0.0, &now.v)) / lead)
            }
            (_, true) => Some(scene.gap(i, lead, &ahead) / (0.5 * lead * lead)),
            (_, false) => rests(i).then(|| acceleration(i)),
        }
    };
    let slip = |tangent: &[f64]| match (level, level.lead() > 0.0) {
        (ContactLevel::Velocity { .. }, true) => dot(tangent, &faster) / lead,
        (_, true) => (dot(tangent, &ahead) - dot(tangent, &now.u)) / (0.5 * lead * lead),
        (_, false) => dot(tangent, &now.a),
    };
    let taken: Vec<usize> = (0..rows.len()).filter(|&i| !scene.is_static(i) && asks(i).is_some()).collect();
    let tangents: Vec<usize> = taken.iter().filter_map(|&i| scene.tangent(i)).collect();
    let axes: Vec<&[f64]> = scene.axes().collect();
    let all: Vec<usize> = taken.iter().chain(&tangents).copied().collect();
    let mut behind = taken.len();
    let contacts = taken.iter().map(|&i| {
        let friction = rows[i].friction.as_ref().map(|(coefficient, tangent)| {
            behind += 1;
            // What slides at the start has its direction where accelerations are asked for.
            let speed = dot(tangent, &now.v);
            let slides = level.lead() <= 0.0 && speed.abs() > 64.0 * f64::EPSILON * size(tangent, &now.v);
            let direction = slides.then(|| -speed.signum());
            Friction { row: behind - 1, coefficient: *coefficient, direction, of_change: false }
        });
        Contact { held: rows[i].law == ContactLaw::Equality, friction }
    });
    let contacts = contacts.collect();
    let q: Vec<f64> =
        all.iter().map(|&i| if i < rows.len() { asks(i).unwrap_or(0.0) } else { slip(axes[i]) }).collect();
    let responses: Vec<Vec<f64>> = all.iter().map(|&i| scene.accelerate(axes[i])).collect();
    let own = |i: usize| match rows.get(i).map(|row| row.law) {
        Some(ContactLaw::Bipenalty { mass, .. }) => mass.recip(),
        Some(ContactLaw::StabilizedBipenalty { stiffness }) => 2.0 / stiffness / (0.25 * lead * lead),
        _ => 0.0,
    };
    let entry = |i: usize, j: usize, x: &[f64]| dot(axes[i], x) + if i == j { own(i) } else { 0.0 };
    let mut problem = Problem {
        contacts,
        w: all.iter().map(|&i| all.iter().zip(&responses).map(|(&j, x)| entry(i, j, x)).collect()).collect(),
        noise: q.iter().map(|q| 64.0 * f64::EPSILON * q.abs()).collect(),
        q,
    };
    // Friction that would turn a slip round in the first step stops it at the end of that, if it can.
    let mut stopped = Vec::new();
    let solved = loop {
        let solved = problem.solve();
        let stops = |(&i, contact): (&usize, &Contact)| {
            let friction = contact.friction?;
            let slower = (dot(&problem.w[friction.row], &solved) + problem.q[friction.row]) * friction.direction?;
            (scene.h * slower > dot(axes[scene.tangent(i)?], &now.v).abs()).then_some(i)
        };
        let found: Vec<usize> = taken.iter().zip(&problem.contacts).filter_map(stops).collect();
        if found.is_empty() {
            break solved;
        }
        for (i, contact) in taken.iter().zip(&mut problem.contacts).filter(|(i, _)| found.contains(i)) {
            if let (Some(friction), Some(k)) = (&mut contact.friction, scene.tangent(*i)) {
                friction.direction = None;
                problem.q[friction.row] += dot(axes[k], &now.v) / scene.h;
            }
        }
        stopped.extend(found);
    };
    let mut forces = vec![0.0; axes.len()];
    solved.iter().zip(&all).for_each(|(force, &i)| forces[i] = *force);
    let rest = taken.into_iter().filter(|&i| level.lead() <= 0.0 && !rows[i].law.is_compliant());
    (forces, rest.collect(), stopped)
}
