//! One stage: the balance, the conditions of the contact laws, and which contacts are closed in the end (theory,
//! sections 2, 5 and 18).

use super::dense::{Matrix, add, dot, eliminate, product, size, zeros};
use super::problem::{Contact, Friction, Problem};
use super::rows::{Affine, Target, motion, target};
use super::start::settle;
use super::{Contacts, Motion, Place, Scene};
use contact_dynamics::ContactLaw;
use contact_dynamics::tableau::StageForce;
use contact_dynamics_scenes::combinations::Correction;

pub(crate) struct Solved {
    pub(crate) motion: Motion,
    pub(crate) raw: Vec<f64>,
    pub(crate) gaps: Vec<f64>,
    pub(crate) closed: Vec<bool>,
    pub(crate) slides: Vec<bool>,
    /// The effective matrix.
    pub(crate) matrix: Matrix,
}

/// What a row constrains: y = `by_z` z + `known`, with 0 ≤ y + compliance λ + shift ⊥ λ ≥ 0.
#[derive(Clone)]
struct Form {
    by_z: Vec<f64>,
    known: f64,
    noise: f64,
    compliance: f64,
    shift: f64,
    enabled: bool,
    /// Of springs with dashpots.
    line: [f64; 2],
}

impl Form {
    /// `row` x + `own`.
    fn new(row: &[f64], x: &Affine, own: f64) -> Self {
        let by_z: Vec<f64> = row.iter().zip(&x.weight).map(|(g, w)| g * w).collect();
        let known = dot(row, &x.known) + own;
        let noise = 64.0 * f64::EPSILON * (size(row, &x.known) + own.abs());
        Self { by_z, known, noise, compliance: 0.0, shift: 0.0, enabled: true, line: [0.0; 2] }
    }

    fn at(&self, z: &[f64]) -> f64 {
        dot(&self.by_z, z) + self.known
    }
}

/// A stage before its contact is known.
struct Stage<'s> {
    scene: &'s Scene,
    place: &'s Place<'s>,
    past: &'s [Motion],
    new: [Affine; 3],
    balance: [Affine; 3],
    target: Target,
    /// Where the balance and the new state live.
    t_balance: f64,
    t_new: f64,
    /// The solution without contact.
    free: Vec<f64>,
    /// Whether dofs without mass have been settled already, with the contacts that act on them.
    follows: bool,
}

pub(crate) fn solve(
    scene: &Scene,
    place: &Place<'_>,
    past: &[Motion],
    contacts: &Contacts,
    correction: Correction,
) -> Solved {
    let (stage, h) = (place.stage, scene.h);
    let (t_balance, t_new) = (place.t + stage.load * h, place.t + stage.end * h);
    let mut new = motion(stage.recovery.each(), past, scene, t_new);
    let mut balance = motion(stage.balance.each(), past, scene, t_balance);
    if stage.is_collocated() {
        balance = new.clone();
    }
    if let (StageForce::AlongPath, Some((dof, [to, ..]))) = (stage.force, scene.driven(t_new)) {
        // Along its path a support is in the middle, with the velocity of the way.
        let from = past[0].u[dof];
        balance[0].known[dof] = 0.5 * (from + to);
        balance[1].known[dof] = (to - from) / (stage.end * h);
    }
    if correction == Correction::Stabilized || correction == Correction::StabilizedClosed {
        let shift = shift(scene, &past[0], correction, &contacts.closed, t_new);
        add(&mut new[0].known, 1.0, &shift);
        add(&mut balance[0].known, stage.balance.u.z / stage.recovery.u.z, &shift);
    }
    // Where the displacements of the others are known, those without mass follow before anything else is solved for.
    let follows = !scene.massless().is_empty() && stage.recovery.u.z.abs() <= 0.0;
    let mut pressed = Vec::new();
    if follows {
        let mut u = new[0].known.clone();
        pressed = settle(scene, &mut u, t_balance, t_new);
        for dof in scene.massless() {
            (new[0].known[dof], balance[0].known[dof]) = (u[dof], u[dof]);
        }
    }
    let mut given = vec![0.0; scene.dofs()];
    pressed.iter().for_each(|(i, force)| add(&mut given, *force, &scene.rows[*i].g));
    let (mut matrix, free, mut responses) = balanced(scene, &balance, (t_balance, &given), &vec![0.0; scene.dofs()]);
    let target = target(stage, past, scene, place.t);
    let mut work = Stage { scene, place, past, new, balance, target, t_balance, t_new, free, follows };
    if let (Correction::Stabilized | Correction::StabilizedClosed, None) = (correction, &work.target.forecast) {
        work.target.values = work.new[0].clone();
    }
    let by_way = matches!(
        correction,
        Correction::Splitting | Correction::Implicit | Correction::Stabilized | Correction::StabilizedClosed
    );
    let (mut z, mut steps) = (vec![0.0; scene.dofs()], 0);
    // Newton's method, with the contacts found anew in each iteration: one of them where nothing is cubic.
    loop {
        let forms = work.forms(by_way);
        let mut raw = work.multipliers(forms.clone(), &responses);
        let before = std::mem::replace(&mut z, work.free.clone());
        raw.iter().zip(&responses).for_each(|(r, response)| add(&mut z, *r, response));
        let largest = |x: &[f64]| x.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
        let mut moved = z.clone();
        add(&mut moved, -1.0, &before);
        steps += 1;
        pressed.iter().for_each(|(i, force)| raw[*i] = *force);
        if scene.cubic.is_empty() || largest(&moved) <= 4.0 * f64::EPSILON * largest(&z) || steps == 40 {
            return work.finish(&forms, &z, raw, matrix);
        }
        (matrix, work.free, responses) = balanced(scene, &work.balance, (t_balance, &given), &z);
    }
}

/// The effective matrix about some z, z without contact but for forces that are given, and what unit multipliers make
/// of z.
fn balanced(
    scene: &Scene,
    [u, v, a]: &[Affine; 3],
    (t, given): (f64, &[f64]),
    z: &[f64],
) -> (Matrix, Vec<f64>, Vec<Vec<f64>>) {
    let n = scene.dofs();
    let mut f = scene.force(t, &u.at(z), &v.at(z));
    add(&mut f, 1.0, given);
    add(&mut f, -1.0, &product(&scene.mass, &a.at(z)));
    let stiffness = scene.stiffness_at(&u.at(z));
    let mut matrix = zeros(n, n);
    for (i, row) in matrix.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let damping = scene.damping.as_ref().map_or(0.0, |c| c[i][j]);
            *entry = stiffness[i][j] * u.weight[j] + damping * v.weight[j] + scene.mass[i][j] * a.weight[j];
        }
    }
    for dof in scene.massless().into_iter().filter(|_| u.weight.iter().all(|weight| weight.abs() <= 0.0)) {
        (matrix[dof][dof], f[dof]) = (1.0, 0.0);
    }
    let mut columns: Vec<Vec<f64>> = scene.axes().map(<[f64]>::to_vec).chain([f]).collect();
    scene.hold(&mut matrix, &mut columns);
    assert!(eliminate(&mut matrix.clone(), &mut columns), "an effective matrix that is singular");
    let mut free = columns.pop().unwrap_or_default();
    add(&mut free, 1.0, z);
    (matrix, free, columns)
}

/// The shift D of u + h v to what contacts admit, in the norm of the mass (theory, section 16).
fn shift(scene: &Scene, start: &Motion, correction: Correction, closed: &[bool], t: f64) -> Vec<f64> {
    let mut u = start.u.clone();
    add(&mut u, scene.h, &start.v);
    if let Some((dof, [there, ..])) = scene.driven(t) {
        u[dof] = there;
    }
    let rows: Vec<usize> = (0..scene.rows.len())
        .filter(|&i| matches!(scene.rows[i].law, ContactLaw::Rigid | ContactLaw::Equality))
        .filter(|&i| (correction == Correction::Stabilized || closed[i]) && scene.has_mass(i))
        .collect();
    let mut responses: Vec<Vec<f64>> = rows.iter().map(|&i| scene.rows[i].g.clone()).collect();
    scene.accelerate_all(&mut responses);
    let problem = Problem::of_gaps(scene, &rows, &responses, t, &u);
    let mut shift = vec![0.0; scene.dofs()];
    problem.solve().iter().zip(&responses).for_each(|(mu, response)| add(&mut shift, *mu, response));
    shift
}

impl Stage<'_> {
    /// What the rows constrain; those of tangents are behind the others.
    fn forms(&self, by_way: bool) -> Vec<Form> {
        let rows = 0..self.scene.rows.len();
        let normal = rows.clone().map(|i| self.normal(i));
        normal.chain(rows.filter_map(|i| self.tangential(i, by_way))).collect()
    }

    fn normal(&self, i: usize) -> Form {
        let (scene, h, start) = (self.scene, self.scene.h, &self.past[0]);
        let row = &scene.rows[i];
        let rigid = || {
            let [gap, rate, _] = row.offset.at(self.target.t);
            let own = if self.target.forecast.is_some() { h * rate } else { gap };
            Form::new(&row.g, &self.target.values, own)
        };
        let spring = || Form::new(&row.g, &self.balance[0], row.offset.at(self.t_balance)[0]);
        let start_gap = scene.gap(i, start.t, &start.u);
        match row.law {
            ContactLaw::Equality => Form { enabled: self.enables(i), ..rigid() },
            ContactLaw::Rigid => {
                let mut form = Form { enabled: self.enables(i), ..rigid() };
                form.known += self.hover(i);
                form
            }
            ContactLaw::Restitution { coefficient } => {
                let mut form = Form { enabled: self.enables(i), ..rigid() };
                form.known += self.hover(i);
                // (Where gaps are constrained, corrections let contacts leave.)
                if self.target.forecast.is_some() {
                    let lead = self.place.stage.contact.lead();
                    let rate = scene.rate(i, start.t, &start.v) + lead * h * dot(&row.g, &start.a);
                    form.known += coefficient * h * rate;
                }
                form
            }
            ContactLaw::RateCondition | ContactLaw::PersistencySwitch => {
                let mut form = rigid();
                let free = form.at(&self.free);
                let tolerance = scene.rounding(i, start.t, &start.u)
                    + 1e-10 * (h * scene.rate(i, start.t, &start.v).abs() + (free - start_gap).abs());
                let above = (start_gap - scene.rounding(i, start.t, &start.u)).max(0.0);
                match (row.law, start_gap <= tolerance) {
                    (ContactLaw::RateCondition, true) => form.known -= start_gap - above,
                    (ContactLaw::RateCondition, false) => form.enabled = false,
                    (_, true) => {
                        let mut way = self.new[1].clone();
                        way.weight.iter_mut().for_each(|w| *w *= h);
                        way.known.iter_mut().for_each(|v| *v *= h);
                        form = Form::new(&row.g, &way, h * row.offset.at(self.t_new)[1] + above);
                    }
                    (_, false) => {}
                }
                form
            }
            ContactLaw::Bipenalty { stiffness, mass } => {
                let ratio = mass / stiffness;
                let x = self.balance[0].sum(1.0, &self.balance[2], ratio);
                let [gap, _, acceleration] = row.offset.at(self.t_balance);
                Form { compliance: stiffness.recip(), ..Form::new(&row.g, &x, gap + ratio * acceleration) }
            }
            ContactLaw::StabilizedBipenalty { stiffness } => {
                // Gaps of the state are known before its forces.
                let now = spring().known;
                let before = (-0.5 * (start_gap + now)).max(0.0);
                let mut form = rigid();
                form.by_z.iter_mut().for_each(|by| *by *= 0.5);
                form.known = 0.5 * (form.known + now) - before;
                Form { compliance: 2.0 / stiffness, ..form }
            }
            ContactLaw::Penalty { stiffness } | ContactLaw::AugmentedLagrangian { stiffness, .. } => {
                Form { compliance: stiffness.recip(), ..spring() }
            }
            ContactLaw::KelvinVoigt { .. } | ContactLaw::HuntCrossley { .. } => {
                let gap = spring();
                let rate = Form::new(&row.g, &self.balance[1], row.offset.at(self.t_balance)[1]);
                self.damped(row.law, gap, rate)
            }
            _ => spring(),
        }
    }

    /// What a spring with a dashpot constrains. Where the unknown moves its gap, the rate of approach is `touching` at
    /// the gap zero, and grows by `slope` for a unit of depth.
    fn damped(&self, law: ContactLaw, gap: Form, rate: Form) -> Form {
        let [by_gap, by_rate] = [&gap, &rate]
            .map(|form| form.by_z.iter().copied().max_by(|x, y| x.abs().total_cmp(&y.abs())).unwrap_or(0.0));
        if by_gap.abs() > 0.0 {
            let slope = by_rate / by_gap;
            return Form { line: [-(rate.known - slope * gap.known), slope], ..gap };
        }
        let (depth, h) = (-gap.known, self.scene.h);
        let (at_rest, per_rate) = match law {
            ContactLaw::KelvinVoigt { stiffness, damping } => (stiffness * depth, damping),
            ContactLaw::HuntCrossley { stiffness, exponent, dissipation } => {
                let spring = stiffness * depth.max(0.0).powf(exponent);
                (spring, spring * dissipation)
            }
            _ => (0.0, 0.0),
        };
        // (Rounding is no depth.)
        if depth <= gap.noise {
            return Form { enabled: false, ..gap };
        }
        if by_rate.abs() > 0.0 {
            // λ = F − D ġ, with y = h ġ.
            let by_z = rate.by_z.iter().map(|by| h * by).collect();
            let (compliance, shift) = (h / per_rate, -h * at_rest / per_rate);
            return Form { by_z, known: h * rate.known, noise: h * rate.noise, compliance, shift, ..rate };
        }
        // All is known.
        Form { known: -(at_rest - per_rate * rate.known).max(0.0), compliance: 1.0, noise: 0.0, ..gap }
    }

    /// How far a contact whose velocity is constrained, if it is closed, may go on nevertheless.
    fn hover(&self, i: usize) -> f64 {
        let Some((u, t)) = &self.target.forecast else { return 0.0 };
        (self.scene.gap(i, *t, u) - self.scene.rounding(i, *t, u)).max(0.0)
    }

    /// Whether a contact may press: where velocities are constrained if its gap is forecast to be closed.
    fn enables(&self, i: usize) -> bool {
        if self.follows && self.scene.is_static(i) {
            return false;
        }
        let Some((u, t)) = &self.target.forecast else { return true };
        let row = &self.scene.rows[i];
        let x = self.target.values.at(&self.free);
        let way = (dot(&row.g, &x) + self.scene.h * row.offset.at(self.target.t)[1]).abs();
        let tolerance = self.scene.rounding(i, *t, u) + 1e-10 * way;
        row.law == ContactLaw::Equality || self.scene.gap(i, *t, u) <= tolerance
    }

    fn tangential(&self, i: usize, by_way: bool) -> Option<Form> {
        let (_, tangent) = self.scene.rows[i].friction.as_ref()?;
        // (Where there is no mass the velocity is differenced afterwards.)
        let by_way = by_way || !self.scene.has_mass(i);
        let stage = self.place.stage;
        let x = if self.target.forecast.is_some() {
            self.target.values.clone()
        } else if stage.contact.lead() > 0.0 {
            self.target.values.sum(1.0, &self.new[0], -1.0)
        } else if stage.recovery.v.z > 0.0 && !by_way {
            let scale = stage.recovery.u.z / (stage.recovery.v.z / self.scene.h);
            self.new[1].sum(scale, &self.new[1], 0.0)
        } else {
            let start = Affine { weight: vec![0.0; self.free.len()], known: self.past[0].u.clone() };
            self.new[0].sum(1.0, &start, -1.0)
        };
        Some(Form::new(tangent, &x, 0.0))
    }

    /// Multipliers of all rows and tangents.
    fn multipliers(&self, mut forms: Vec<Form>, responses: &[Vec<f64>]) -> Vec<f64> {
        let laws: Vec<ContactLaw> = self.scene.rows.iter().map(|row| row.law).collect();
        let mut depth: Vec<f64> = forms.iter().map(|form| -form.at(&self.free)).collect();
        let (mut pass, mut before) = (0, vec![0.0; laws.len()]);
        loop {
            for (((form, law), depth), before) in forms.iter_mut().zip(&laws).zip(&depth).zip(&before) {
                let [touching, slope] = form.line;
                match *law {
                    ContactLaw::KelvinVoigt { stiffness, damping } if slope > 0.0 => {
                        // As it begins to press it takes any force up to that at the gap zero.
                        let begins = touching > 0.0 && *before <= damping * touching;
                        form.compliance = if begins { 0.0 } else { (stiffness + damping * slope).recip() };
                        form.shift = -form.compliance * damping * touching;
                    }
                    ContactLaw::HuntCrossley { stiffness, exponent, dissipation } if slope > 0.0 => {
                        let depth = depth.max(form.noise);
                        let (spring, rate) =
                            (stiffness * depth.powf(exponent), 1.0 + dissipation * (touching + slope * depth));
                        let tangent = exponent * spring / depth * rate.max(0.0) + spring * dissipation * slope;
                        form.compliance = tangent.recip();
                        form.shift = depth - spring * rate / tangent;
                    }
                    _ => {}
                }
                if let ContactLaw::PowerLaw { stiffness, exponent } = *law {
                    // F = k δ^p about the depth δ.
                    let depth = depth.max(form.noise);
                    form.compliance = (stiffness * exponent * depth.powf(exponent - 1.0)).recip();
                    form.shift = depth * (1.0 - exponent.recip());
                }
            }
            let raw = self.once(&forms, responses);
            let mut again = false;
            for (i, law) in laws.iter().enumerate() {
                match *law {
                    ContactLaw::KelvinVoigt { damping, .. } => {
                        let least = damping * forms[i].line[0];
                        again |= forms[i].line[1] > 0.0 && (raw[i] <= least) != (before[i] <= least) && pass < 60;
                        before[i] = raw[i];
                    }
                    ContactLaw::HuntCrossley { .. } if forms[i].line[1] <= 0.0 => {}
                    ContactLaw::PowerLaw { .. } | ContactLaw::HuntCrossley { .. } => {
                        let y = forms[i].at(&self.free)
                            + raw.iter().zip(responses).map(|(r, x)| r * dot(&forms[i].by_z, x)).sum::<f64>();
                        again |= (depth[i] + y).abs() > 1e-14 * y.abs() && pass < 60;
                        depth[i] = -y;
                    }
                    // (Where the gap does not move with the unknown there is nothing to augment.)
                    ContactLaw::AugmentedLagrangian { augmentations, .. }
                        if pass < augmentations && forms[i].by_z.iter().any(|by| by.abs() > 0.0) =>
                    {
                        forms[i].shift = -forms[i].compliance * raw[i];
                        again = true;
                    }
                    _ => {}
                }
            }
            if !again {
                return raw;
            }
            pass += 1;
        }
    }

    fn once(&self, forms: &[Form], responses: &[Vec<f64>]) -> Vec<f64> {
        let rows = &self.scene.rows;
        let normals: Vec<usize> = (0..rows.len()).filter(|&i| forms[i].enabled).collect();
        let tangents: Vec<usize> = normals.iter().filter_map(|&i| self.scene.tangent(i)).collect();
        let taken: Vec<usize> = normals.iter().chain(&tangents).copied().collect();
        let mut behind = normals.len();
        let contact = |&i: &usize| {
            let friction = rows[i].friction.as_ref().map(|(coefficient, _)| {
                behind += 1;
                Friction { row: behind - 1, coefficient: *coefficient, direction: None, of_change: false }
            });
            Contact { held: rows[i].law == ContactLaw::Equality, friction }
        };
        let contacts = normals.iter().map(contact).collect();
        let entry = |i: usize, j: usize| {
            let own = if i == j { forms[i].compliance } else { 0.0 };
            own + dot(&forms[i].by_z, &responses[j])
        };
        let problem = Problem {
            contacts,
            w: taken.iter().map(|&i| taken.iter().map(|&j| entry(i, j)).collect()).collect(),
            q: taken.iter().map(|&i| forms[i].at(&self.free) + forms[i].shift).collect(),
            noise: taken.iter().map(|&i| forms[i].noise + 1e-15 * forms[i].at(&self.free).abs()).collect(),
        };
        let mut raw = vec![0.0; forms.len()];
        problem.solve().iter().zip(&taken).for_each(|(r, &i)| raw[i] = *r);
        raw
    }

    /// The state at z, and which contacts are closed.
    fn finish(&self, forms: &[Form], z: &[f64], raw: Vec<f64>, matrix: Matrix) -> Solved {
        let (scene, h, t) = (self.scene, self.scene.h, self.t_new);
        let [u, mut v, mut a] = [0, 1, 2].map(|field| self.new[field].at(z));
        for dof in scene.massless() {
            // The parabola through the displacements now, where the step starts, and where that before it did.
            let since = self.place.stage.end * h;
            let newest = (u[dof] - self.past[self.place.made - 1].u[dof]) / since;
            let curve = since / (since + self.place.made_with);
            (v[dof], a[dof]) = (newest + curve * (newest - self.place.slopes[dof]), 0.0);
        }
        let (mut closed, mut slides) = (Vec::new(), Vec::new());
        for (i, row) in scene.rows.iter().enumerate() {
            let form = &forms[i];
            let tolerance = form.noise + 1e-10 * h * scene.rate(i, t, &v).abs();
            let touches = match self.follows && scene.is_static(i) {
                // (Of these the gap of the state is constrained.)
                true => scene.gap(i, t, &u) <= scene.rounding(i, t, &u) + 1e-10 * h * scene.rate(i, t, &v).abs(),
                false => form.enabled && form.at(z) <= tolerance && !row.law.is_compliant(),
            };
            closed.push(raw[i] > 0.0 || touches || row.law == ContactLaw::Equality);
            slides.push(match (&row.friction, scene.tangent(i)) {
                (Some((coefficient, tangent)), Some(k)) => {
                    let slip = dot(tangent, &v).abs();
                    let noise = 64.0 * f64::EPSILON * (size(tangent, &v) + h * size(tangent, &a));
                    raw[i] > 0.0 && is_at_bound(raw[k], coefficient * raw[i]) && slip > noise
                }
                _ => false,
            });
        }
        let gaps = (0..scene.rows.len()).map(|i| scene.gap(i, t, &u)).collect();
        Solved { motion: Motion { t, u, v, a }, raw, gaps, closed, slides, matrix }
    }
}

/// Whether friction is at the rim of its cone.
pub(crate) fn is_at_bound(friction: f64, bound: f64) -> bool {
    friction.abs() >= (1.0 - 1e-12) * bound
}
