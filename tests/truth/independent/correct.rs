//! The corrections of a stage (theory, sections 7, 8, 16 and 18).

use super::dense::{Matrix, add, dot, product, size, solve};
use super::problem::{Contact, Friction, Problem};
use super::stage::is_at_bound;
use super::{Contacts, Motion, Place, Scene};
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;

/// What was before the stage, and its effective matrix.
pub(crate) struct Before<'b> {
    pub(crate) was_closed: &'b [bool],
    pub(crate) stuck: &'b [bool],
    pub(crate) reported: &'b [f64],
    pub(crate) matrix: &'b Matrix,
}

/// Time of a wave through a contact element, for the correction that wants it, in steps.
pub(crate) const TRANSIT: f64 = 1.5;

/// Whether a correction takes the forces of contact out of the accelerations.
pub(crate) fn leaves_smooth_motion(correction: Correction) -> bool {
    matches!(
        correction,
        Correction::Splitting | Correction::Implicit | Correction::Stabilized | Correction::StabilizedClosed
    )
}

/// Which jump is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Jump {
    Velocity,
    Acceleration,
}

/// A stage in the hands of a correction. The newest state of the past is that of the stage.
struct Step<'s> {
    scene: &'s Scene,
    place: &'s Place<'s>,
    before: Before<'s>,
    past: &'s mut Vec<Motion>,
    contacts: &'s mut Contacts,
    /// M⁻¹ of each row and tangent.
    responses: Vec<Vec<f64>>,
    /// Response of (u, h v, h² a) to a multiplier on a unit mass, over h².
    response: [f64; 3],
    closed: Vec<usize>,
    engaged: Vec<usize>,
    /// Rates that restitution asks of rows, those before the impact, and rows that leave.
    asked: Vec<f64>,
    started: Vec<f64>,
    leaving: Vec<usize>,
    /// Of contacts with friction the direction in which it acts.
    directions: Vec<f64>,
}

pub(crate) fn correct(
    scene: &Scene,
    correction: Correction,
    place: &Place<'_>,
    before: Before<'_>,
    (past, contacts): (&mut Vec<Motion>, &mut Contacts),
) {
    let rigid = |i: &usize| !scene.rows[*i].law.is_compliant();
    // (Nothing stops at once where there is no mass.)
    let closed = (0..scene.rows.len()).filter(rigid).filter(|&i| contacts.closed[i] && scene.has_mass(i)).collect();
    let rows = place.stage.recovery.each();
    let mut step = Step {
        scene,
        place,
        before,
        past,
        contacts,
        responses: responses(scene, correction),
        response: rows.map(|row| row.z / place.stage.balance.a.z),
        closed,
        engaged: Vec::new(),
        asked: vec![0.0; scene.rows.len()],
        started: Vec::new(),
        leaving: Vec::new(),
        directions: vec![0.0; scene.rows.len()],
    };
    match correction {
        Correction::None => {}
        Correction::Persistency => step.persist(),
        Correction::History => {
            step.persist();
            step.project_past();
        }
        Correction::Release => {
            step.persist();
            step.project_past();
            step.release();
        }
        Correction::TaylorPapadopoulos => {
            step.persist();
            step.run_off();
        }
        Correction::Splitting => step.split(),
        Correction::Implicit | Correction::Stabilized | Correction::StabilizedClosed => step.act_implicitly(),
        Correction::LaursenLove => step.restore_energy(),
        Correction::ZeroAcceleration => step.stop_accelerations(),
    }
}

/// M⁻¹ of each row and tangent, where a correction needs them.
fn responses(scene: &Scene, correction: Correction) -> Vec<Vec<f64>> {
    let mut responses = match correction {
        Correction::None => Vec::new(),
        _ => scene.axes().map(<[f64]>::to_vec).collect(),
    };
    scene.accelerate_all(&mut responses);
    responses
}

impl Step<'_> {
    fn h(&self) -> f64 {
        self.scene.h
    }

    fn is_pressed(&self, i: usize) -> bool {
        self.contacts.raw[i] > 0.0 || self.scene.rows[i].law == ContactLaw::Equality
    }

    /// Rows and the tangents that belong to them, as numbers of axes.
    fn axes_of(&self, rows: &[usize]) -> Vec<usize> {
        rows.iter().copied().chain(rows.iter().filter_map(|&i| self.scene.tangent(i))).collect()
    }

    /// S between two axes.
    fn s(&self, i: usize, j: usize) -> f64 {
        dot(self.scene.axis(i), &self.responses[j])
    }

    /// λ_v/λ_a.
    fn persist(&mut self) {
        let rows = self.closed.clone();
        let rebounds = self.ask_rebounds();
        let mut x = self.jumps(&rows, Jump::Velocity, !rebounds);
        if rebounds {
            x = self.rebound(&rows, x);
        }
        self.apply(&x);
        let share = self.share();
        for axis in self.axes_of(&self.leaving) {
            add(&mut self.past[0].a, -self.contacts.raw[axis] / share, &self.responses[axis]);
            self.contacts.forces[axis] = 0.0;
        }
        let rows = self.engaged.clone();
        let y = self.jumps(&rows, Jump::Acceleration, true);
        for (axis, y) in self.limit(y, 1.0 / share) {
            add(&mut self.past[0].a, y, &self.responses[axis]);
            self.contacts.forces[axis] += share * y;
        }
    }

    /// Finds the rates with which contacts leave that close under a law with restitution; says whether any does.
    fn ask_rebounds(&mut self) -> bool {
        let (scene, h, start) = (self.scene, self.h(), &self.past[1]);
        self.started = scene
            .axes()
            .enumerate()
            .map(|(axis, g)| dot(g, &start.v) + scene.rows.get(axis).map_or(0.0, |row| row.offset.at(start.t)[1]))
            .collect();
        let law = |i: usize| match scene.rows[i].law {
            ContactLaw::Restitution { coefficient } => coefficient,
            _ => 0.0,
        };
        let comes = |&&i: &&usize| law(i) > 0.0 && (!self.before.was_closed[i] || self.started[i] < 0.0);
        if self.closed.iter().find(comes).is_none() {
            return false;
        }
        for &i in &self.closed {
            let (e, row) = (law(i), &scene.rows[i]);
            let gap = scene.gap(i, start.t, &start.u).max(0.0);
            let acceleration = dot(&row.g, &start.a) + row.offset.at(start.t)[2];
            // The square of the rate at the gap zero.
            let square = self.started[i].powi(2) - 2.0 * acceleration * gap;
            if e > 0.0 && square > 0.0 && (self.started[i] < 0.0 || acceleration < 0.0) {
                self.started[i] = -square.sqrt();
                let share = f64::EPSILON.powf(2.0 / 3.0);
                let gap_noise = scene.rounding(i, start.t, &start.u) / (64.0 * f64::EPSILON);
                let noise = share * (size(&row.g, &start.v) + h * size(&row.g, &start.a) + gap_noise / h);
                // What its force balances pulls it back too.
                let pulled = self.s(i, i) * self.before.reported[i].max(0.0) - acceleration;
                if e * square.sqrt() > noise.max(h * pulled) {
                    self.asked[i] = e * square.sqrt();
                }
            }
        }
        self.asked.iter().any(|asked| *asked > 0.0)
    }

    /// Chooses the share of the rates that adds no energy, and finds which contacts leave; x is for all of them.
    fn rebound(&mut self, rows: &[usize], mut x: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
        let given = self.h() * self.response[1];
        let asked = self.asked.clone();
        let gains = |step: &Self, x: &[(usize, f64)]| {
            let (mut work, mut size) = (0.0, 0.0_f64);
            for &(i, impulse) in x {
                let total = impulse + given * step.contacts.raw[i];
                let own = step.scene.rows.get(i).map_or(0.0, |row| row.offset.at(step.past[0].t)[1]);
                let now = dot(step.scene.axis(i), &step.past[0].v) + own;
                let after = now + x.iter().map(|&(j, x)| step.s(i, j) * x).sum::<f64>();
                work += total * (after + step.started[i]);
                size += total.abs() * (after.abs() + step.started[i].abs());
            }
            work > f64::EPSILON.powf(0.75) * size
        };
        if gains(self, &x) {
            let (mut least, mut most) = (0.0, 1.0);
            for _ in 0..45 {
                let share = 0.5 * (least + most);
                self.asked.iter_mut().zip(&asked).for_each(|(own, all)| *own = share * all);
                x = self.jumps(rows, Jump::Velocity, false);
                if gains(self, &x) { most = share } else { least = share }
            }
            self.asked.iter_mut().zip(&asked).for_each(|(own, all)| *own = least * all);
            x = self.jumps(rows, Jump::Velocity, false);
        }
        for &(i, impulse) in x.iter().filter(|(axis, _)| *axis < self.scene.rows.len()) {
            let raw = self.contacts.raw[i];
            let total = impulse + given * raw;
            let presses = self.engaged.contains(&i);
            let is_held = self.scene.rows[i].law == ContactLaw::Equality;
            if !is_held && (!presses && raw > 0.0 && total <= 0.0 || presses && self.asked[i] > 0.0) {
                self.leaving.push(i);
            }
        }
        let leaving = &self.leaving;
        self.engaged.retain(|i| !leaving.contains(i));
        x
    }

    /// Where a row that leaves was, its rate and its acceleration, at a past state; zero for all others.
    fn outgoing(&self, axis: usize, field: usize, k: usize) -> f64 {
        let (scene, now, ago) = (self.scene, &self.past[0], self.past[0].t - self.past[k].t);
        if !self.axes_of(&self.leaving).contains(&axis) {
            return 0.0;
        }
        let own = scene.rows.get(axis).map_or([0.0; 3], |row| row.offset.at(now.t));
        let rate = dot(scene.axis(axis), &now.v) + own[1];
        let acceleration = dot(scene.axis(axis), &now.a) + own[2];
        [ago * (0.5 * ago * acceleration - rate), rate - ago * acceleration, acceleration][field]
    }

    /// Whether a step starts from a.
    fn reads_acceleration(&self) -> bool {
        self.place.starts || self.place.reads.iter().any(|[.., a]| *a)
    }

    fn keeps_balance(&self) -> bool {
        self.place.by_velocities && self.place.stage.is_collocated()
    }

    /// What damping leaves of the forces that remove jumps of acceleration, beyond what takes back so much of the raw
    /// multipliers.
    fn limit(&self, forces: Vec<(usize, f64)>, given: f64) -> Vec<(usize, f64)> {
        let scene = self.scene;
        let Some(damping) = scene.damping.as_ref().filter(|_| self.reads_acceleration()) else {
            return forces;
        };
        let rest = |&(axis, y): &(usize, f64)| {
            let most = given * self.contacts.raw[axis];
            if y * most < 0.0 { y - y.signum() * y.abs().min(most.abs()) } else { y }
        };
        // Axes that S couples, directly or through others, are judged as one.
        let mut group: Vec<usize> = (0..forces.len()).collect();
        for (i, j) in (0..forces.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
            if self.s(forces[i].0, forces[j].0) != 0.0 {
                let (old, new) = (group[i], group[j]);
                group.iter_mut().filter(|own| **own == old).for_each(|own| *own = new);
            }
        }
        let time = self.h() * self.response[1] / self.response[2];
        let mut rests: Vec<f64> = forces.iter().map(rest).collect();
        loop {
            let mut by_rest = vec![0.0; scene.dofs()];
            forces.iter().zip(&rests).for_each(|(force, &rest)| add(&mut by_rest, rest, &self.responses[force.0]));
            let resisted: Vec<f64> = scene.accelerate(&product(damping, &by_rest)).iter().map(|a| time * a).collect();
            let part = |of: usize| {
                let [s, d] = [&by_rest, &resisted].map(|a| {
                    let own = (0..forces.len()).filter(|&k| group[k] == of);
                    own.map(|k| rests[k] * dot(scene.axis(forces[k].0), a)).sum::<f64>()
                });
                if d > s { (s / d).powi(2) } else { 1.0 }
            };
            let parts: Vec<f64> = group.iter().map(|&of| part(of)).collect();
            // Those that the step resolves keep all of it, and the others are judged without them.
            let left: Vec<f64> =
                rests.iter().zip(&parts).map(|(&rest, &part)| if part < 1.0 { rest } else { 0.0 }).collect();
            if left == rests {
                let limited = forces.iter().zip(rests.iter().zip(&parts));
                return limited.map(|(force, (rest, part))| (force.0, force.1 - (1.0 - part) * rest)).collect();
            }
            rests = left;
        }
    }

    /// w_ā/w_a.
    fn share(&self) -> f64 {
        self.place.stage.balance.a.z / self.place.stage.recovery.a.z
    }

    /// Removes the jumps of some rows: finds what is to be added to what the stage has given, axis by axis. Of
    /// velocities it also finds which contacts are engaged, and which slide. A pressed row is `held`, or may part.
    fn jumps(&mut self, rows: &[usize], jump: Jump, held: bool) -> Vec<(usize, f64)> {
        let (scene, axes) = (self.scene, self.axes_of(rows));
        let share = match jump {
            Jump::Velocity => self.h() * self.response[1],
            Jump::Acceleration => self.response[2],
        };
        let new = &self.past[0];
        let mut q = Vec::new();
        let mut noise = Vec::new();
        let mut given = Vec::new();
        for &axis in &axes {
            let (values, field) = if jump == Jump::Velocity { (&new.v, 1) } else { (&new.a, 2) };
            let own = scene.rows.get(axis).map_or(0.0, |row| row.offset.at(new.t)[field]);
            let asked = if jump == Jump::Velocity { self.asked.get(axis).copied().unwrap_or(0.0) } else { 0.0 };
            q.push(dot(scene.axis(axis), values) + own - asked);
            noise.push(64.0 * f64::EPSILON * (size(scene.axis(axis), values) + own.abs()));
            given.push(share * self.contacts.raw[axis]);
        }
        let w: Matrix = axes.iter().map(|&i| axes.iter().map(|&j| self.s(i, j)).collect()).collect();
        let jumps = q.clone();
        for (q, w) in q.iter_mut().zip(&w) {
            *q -= dot(w, &given);
        }
        let mut behind = rows.len();
        let mut contacts = Vec::new();
        for &i in rows {
            let slides = jump == Jump::Acceleration && self.contacts.slides[i];
            let friction = scene.rows[i].friction.as_ref().map(|(coefficient, _)| {
                behind += 1;
                let direction = slides.then(|| self.directions[i]);
                Friction { row: behind - 1, coefficient: *coefficient, direction, of_change: false }
            });
            let held = scene.rows[i].law == ContactLaw::Equality || held && friction.is_none() && self.is_pressed(i);
            contacts.push(Contact { held, friction });
        }
        let problem = Problem { contacts, w, q, noise };
        let totals = problem.solve();
        let added: Vec<f64> = totals.iter().zip(&given).map(|(total, given)| total - given).collect();
        if jump == Jump::Velocity {
            self.engaged.clear();
            for (place, &i) in rows.iter().enumerate() {
                // (Without friction what a touching row is given is all that it has.)
                let Contact { held: is_held, friction } = problem.contacts[place];
                if is_held || held && friction.is_some() && self.is_pressed(i) || totals[place] > 0.0 {
                    self.engaged.push(i);
                }
                if let Some(Friction { row, coefficient, .. }) = problem.contacts[place].friction {
                    let slip = jumps[row] + dot(&problem.w[row], &added);
                    let bound = coefficient * totals[place].max(0.0);
                    self.contacts.slides[i] = is_at_bound(totals[row], bound) && slip.abs() > problem.noise[row];
                    // What has no friction, since all that it has been given pulls, slides all the same.
                    let along = if totals[row].abs() > 0.0 { totals[row] } else { -slip };
                    self.directions[i] = along.signum();
                }
            }
        }
        axes.into_iter().zip(added).collect()
    }

    /// v ← v + M⁻¹ Gᵀ x, and the change of the damping forces.
    fn apply(&mut self, impulses: &[(usize, f64)]) {
        let (scene, h) = (self.scene, self.h());
        let mut change = vec![0.0; scene.dofs()];
        for &(axis, x) in impulses {
            add(&mut change, x, &self.responses[axis]);
        }
        // Where u follows from velocities alone, and the balance holds at the state, damping takes back what it gives.
        let effective = self.reads_acceleration() && !self.keeps_balance() || scene.damps_massless();
        let new = &mut self.past[0];
        let before = new.v.clone();
        add(&mut new.v, 1.0, &change);
        if self.place.is_last {
            for &(axis, x) in impulses.iter().filter(|(axis, _)| *axis < scene.rows.len()) {
                // Seen from the obstacle.
                let mean = 0.5 * (scene.rate(axis, new.t, &before) + scene.rate(axis, new.t, &new.v));
                self.contacts.taken[axis] -= x * mean;
            }
        }
        let Some(damping) = scene.damping.as_ref().filter(|_| change.iter().any(|x| x.abs() > 0.0)) else { return };
        let mut force = product(damping, &change);
        if effective {
            let mut matrix = self.before.matrix.clone();
            scene.hold(&mut matrix, std::slice::from_mut(&mut force));
            let mut response = solve(matrix, force).expect("an effective matrix that is regular");
            // (They respond, and have no acceleration.)
            scene.massless().into_iter().for_each(|dof| response[dof] = 0.0);
            add(&mut new.a, -self.place.stage.balance.a.z / (h * h), &response);
        } else {
            add(&mut new.a, -1.0, &scene.accelerate(&force));
        }
    }

    /// Projects what later rows read of the past, if a contact has just closed, or begins to stick.
    fn project_past(&mut self) {
        let begins = |&i: &usize| {
            let sticks = self.scene.rows[i].friction.is_some() && !self.contacts.slides[i];
            !self.before.was_closed[i] || sticks && !self.before.stuck[i]
        };
        if self.leaving.is_empty() && !self.engaged.iter().any(begins) {
            return;
        }
        for k in 1..self.past.len().min(self.place.reads.len()) {
            for field in 0..3 {
                if self.place.reads[k][field] {
                    self.project(k, field);
                }
            }
        }
    }

    /// Projects one field of one state.
    fn project(&mut self, k: usize, field: usize) {
        let (scene, mut rows) = (self.scene, self.engaged.clone());
        rows.extend(&self.leaving);
        rows.sort_unstable();
        let axes = self.axes_of(&rows);
        let (now, old) = (&self.past[0], &self.past[k]);
        let values = [&old.u, &old.v, &old.a][field];
        let jumps: Vec<f64> = axes
            .iter()
            .map(|&axis| match scene.rows.get(axis) {
                Some(row) => {
                    // Laws that read the gap at the start of a stage hold it where it is.
                    let holds = matches!(row.law, ContactLaw::RateCondition | ContactLaw::PersistencySwitch);
                    let held = if field == 0 && holds { self.contacts.gaps[axis] } else { 0.0 };
                    dot(&row.g, values) + row.offset.at(old.t)[field] - held
                }
                None if field == 0 => dot(scene.axis(axis), &old.u) - dot(scene.axis(axis), &now.u),
                None => dot(scene.axis(axis), values),
            })
            .zip(&axes)
            .map(|(jump, &axis)| jump - self.outgoing(axis, field, k))
            .collect();
        let mut behind = rows.len();
        let contact = |&i: &usize| {
            let friction = scene.rows[i].friction.as_ref().map(|(coefficient, _)| {
                behind += 1;
                let slides = self.contacts.slides[i] && !self.leaving.contains(&i);
                let direction = slides.then(|| self.directions[i]);
                Friction { row: behind - 1, coefficient: *coefficient, direction, of_change: true }
            });
            // (What sticks is held both ways, however it presses.)
            let stuck = friction.is_some_and(|friction| friction.direction.is_none());
            (Contact { held: true, friction: friction.filter(|_| !stuck) }, stuck.then(|| behind - 1))
        };
        let (mut contacts, stuck): (Vec<_>, Vec<_>) = rows.iter().map(contact).unzip();
        let noise: Vec<f64> = axes
            .iter()
            .zip(&jumps)
            .map(|(&axis, jump)| 64.0 * f64::EPSILON * (size(scene.axis(axis), values) + jump.abs()))
            .collect();
        let w: Matrix = axes.iter().map(|&i| axes.iter().map(|&j| self.s(i, j)).collect()).collect();
        // Tangents of what sticks become contacts of their own, behind the rows in the order of the problem.
        let order = reorder(&mut contacts, &stuck, axes.len());
        let pick = |values: &[f64]| -> Vec<f64> { order.iter().map(|&place| values[place]).collect() };
        let problem = Problem {
            contacts,
            w: order.iter().map(|&place| pick(&w[place])).collect(),
            q: pick(&jumps),
            noise: pick(&noise),
        };
        let found = problem.solve();
        let mut multipliers = vec![0.0; axes.len()];
        order.iter().zip(found).for_each(|(&place, m)| multipliers[place] = m);
        if field == 1 && !self.place.is_last && k == self.place.made {
            // What the state that the step starts from loses here no later stage sees any more.
            for (place, &i) in rows.iter().enumerate() {
                let after = jumps[place] + dot(&w[place], &multipliers);
                let mean = 0.5 * (jumps[place] + after) + self.outgoing(i, field, k);
                self.contacts.taken[i] -= multipliers[place] * mean;
            }
        }
        let mut multipliers: Vec<_> = axes.into_iter().zip(multipliers).collect();
        if field == 2 {
            multipliers = self.limit(multipliers, 0.0);
        }
        let old = &mut self.past[k];
        let values = [&mut old.u, &mut old.v, &mut old.a];
        for (value, place) in values.into_iter().zip(0..).filter(|(_, place)| *place == field) {
            let _ = place;
            for (axis, m) in &multipliers {
                add(value, *m, &self.responses[*axis]);
            }
        }
    }

    /// Gives back at release what the corrections took: impulses from the same velocities, and one factor for those
    /// that act on each other, by which they give the sum.
    fn release(&mut self) {
        let (mut given, mut energies) = (Vec::new(), Vec::new());
        for i in self.released() {
            let taken = self.contacts.taken[i];
            let (s, rate) = (self.s(i, i), self.scene.rate(i, self.past[0].t, &self.past[0].v));
            let noise = 64.0
                * f64::EPSILON
                * (size(&self.scene.rows[i].g, &self.past[0].v)
                    + self.scene.rows[i].offset.at(self.past[0].t)[1].abs());
            if taken <= 0.0 || 2.0 * s * taken <= noise * noise {
                continue;
            }
            given.push((i, ((rate * rate + 2.0 * s * taken).sqrt() - rate) / s));
            energies.push([taken, rate]);
        }
        let mut groups: Vec<usize> = (0..given.len()).collect();
        for (a, b) in (0..given.len()).flat_map(|a| (0..a).map(move |b| (a, b))) {
            if self.s(given[a].0, given[b].0) != 0.0 {
                let (from, to) = (groups[a], groups[b]);
                groups.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
            }
        }
        let alone = given.clone();
        for (place, &group) in groups.iter().enumerate() {
            let mut members = (0..given.len()).filter(|&k| groups[k] == group);
            let [mut energy, mut first, mut second] = [0.0; 3];
            for a in members.clone() {
                energy += energies[a][0];
                first += alone[a].1 * energies[a][1];
                second +=
                    members.clone().map(|b| alone[a].1 * self.s(alone[a].0, alone[b].0) * alone[b].1).sum::<f64>();
            }
            if members.any(|member| member != place) {
                given[place].1 *= ((first * first + 2.0 * second * energy).sqrt() - first) / second;
            }
        }
        self.apply(&given);
        for (i, impulse) in given {
            self.move_past(i, impulse);
        }
    }

    /// Lets the stress of contacts that have opened run off as a wave.
    fn run_off(&mut self) {
        for i in self.released() {
            let impulse = 0.5 * TRANSIT * self.h() * self.before.reported[i].max(0.0);
            self.apply(&[(i, impulse)]);
            self.move_past(i, impulse);
        }
    }

    /// Rows that are open at the end of a step, and were closed in it or at its start.
    fn released(&self) -> Vec<usize> {
        let opens = |&i: &usize| {
            let closed = self.before.was_closed[i] || self.place.closed_at_start[i];
            let corrects = !self.scene.rows[i].law.is_compliant() && self.scene.has_mass(i);
            self.place.is_last && closed && !self.contacts.closed[i] && corrects
        };
        (0..self.scene.rows.len()).filter(opens).collect()
    }

    /// Lets the past have had a velocity all along.
    fn move_past(&mut self, i: usize, impulse: f64) {
        let (h, made) = (self.h(), self.place.made);
        for k in made..self.past.len().min(self.place.reads.len()) {
            let steps = (k + 1 - made) as f64;
            let [u, v, _] = self.place.reads[k];
            if u {
                add(&mut self.past[k].u, -steps * h * impulse, &self.responses[i]);
            }
            if v {
                add(&mut self.past[k].v, impulse, &self.responses[i]);
            }
        }
    }

    /// The nonsmooth splitting.
    fn split(&mut self) {
        let rows = self.closed.clone();
        let given = self.h() * self.response[1];
        let x = self.jumps(&rows, Jump::Velocity, false);
        self.apply(&x);
        for &(axis, x) in &x {
            let raw = self.contacts.raw[axis];
            add(&mut self.past[0].a, -self.response[2] * raw, &self.responses[axis]);
            self.contacts.forces[axis] = (given * raw + x) / self.h();
        }
    }

    /// Contact forces that act as one impulse.
    fn act_implicitly(&mut self) {
        let (h, [by_u, by_v, by_a]) = (self.h(), self.response);
        let mut impulses = Vec::new();
        for i in self.closed.clone() {
            let raw = self.contacts.raw[i];
            add(&mut self.past[0].a, -by_a * raw, &self.responses[i]);
            self.contacts.forces[i] = 2.0 * by_u * raw;
            impulses.push((i, h * (2.0 * by_u - by_v) * raw));
        }
        if impulses.iter().any(|(_, x)| x.abs() > 0.0) {
            self.apply(&impulses);
        }
    }

    /// The velocity jump of Laursen and Love.
    fn restore_energy(&mut self) {
        let (scene, rows) = (self.scene, self.closed.clone());
        let (new, start) = (&self.past[0], &self.past[1]);
        let lambda: Vec<f64> = rows.iter().map(|&i| self.contacts.raw[i]).collect();
        let gap = |i: usize, state: &Motion| scene.gap(i, state.t, &state.u);
        let work: f64 = rows.iter().zip(&lambda).map(|(&i, l)| l * (gap(i, new) - gap(i, start))).sum();
        let rate: f64 = rows.iter().zip(&lambda).map(|(&i, l)| l * scene.rate(i, new.t, &new.v)).sum();
        let row = |i: usize| rows.iter().zip(&lambda).map(|(&j, l)| self.s(i, j) * l).sum::<f64>();
        let square: f64 = rows.iter().zip(&lambda).map(|(&i, l)| l * row(i)).sum();
        if square <= 0.0 {
            return;
        }
        // ½ τ² λᵀSλ + τ λᵀ ġ + work = 0.
        let tau = ((rate * rate - 2.0 * square * work).max(0.0).sqrt() - rate) / square;
        let impulses: Vec<_> = rows.iter().zip(&lambda).map(|(&i, l)| (i, tau * l)).collect();
        self.apply(&impulses);
    }

    /// No acceleration on the dofs of pressed contacts.
    fn stop_accelerations(&mut self) {
        let rows = self.closed.clone();
        let _ = self.jumps(&rows, Jump::Velocity, true);
        let rows = self.engaged.clone();
        let y = self.jumps(&rows, Jump::Acceleration, true);
        let share = self.share();
        for &(i, y) in &y {
            self.contacts.forces[i] += share * y;
            for (a, g) in self.past[0].a.iter_mut().zip(&self.scene.rows[i].g) {
                if g.abs() > 0.0 {
                    *a = 0.0;
                }
            }
        }
    }
}

/// Puts the tangents of what sticks behind the normal rows as contacts of their own, and what slides behind these;
/// returns the order.
fn reorder(contacts: &mut Vec<Contact>, stuck: &[Option<usize>], axes: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..contacts.len()).collect();
    for &place in stuck.iter().flatten() {
        order.push(place);
        contacts.push(Contact { held: true, friction: None });
    }
    for place in 0..axes {
        if !order.contains(&place) {
            order.push(place);
        }
    }
    for contact in contacts {
        if let Some(friction) = &mut contact.friction {
            friction.row = order.iter().position(|&place| place == friction.row).unwrap_or(friction.row);
        }
    }
    order
}
