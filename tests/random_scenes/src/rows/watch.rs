//! What must hold in every step, and after one that is refused.

use super::recipe::{Precision, Recipe, Row, Solving};
use super::run::{Finding, Run, Verdict, named};
use contact_dynamics::contact::ContactLaw;
use contact_dynamics::{Error, History, Real, Simulation, State};
use contact_dynamics_scenes::schemes;

/// Gaps are met within so many roots of the rounding, of the sizes of their terms.
const ROUNDING: f64 = 10.0;

/// Momentum is conserved up to this share of the largest Σ m (|v| + |u|/h + h |a|): steps of a thousand periods magnify
/// rounding.
const MOMENTUM: f64 = 1e-6;

/// The same by conjugate gradients, which leave 1e-10 of the forces of springs, much stiffer ones than the masses need.
const MOMENTUM_BY_ITERATION: f64 = 1e-5;

/// Explicit runs on springs alone may gain by impacts that last two steps, but do not grow beyond this.
const GAIN: f64 = 1e6;

pub(super) struct Watch<'a> {
    recipe: &'a Recipe,
    /// The scheme is explicit, and all rows are springs.
    explicit_on_springs: bool,
    /// Contact is imposed on displacements of the state.
    on_positions: bool,
    is_free: bool,
    /// Nothing brings energy in.
    conserves: bool,
    start: f64,
    momentum: Vec<f64>,
    /// The largest of each so far: force, the sum of the sizes of momenta by dof (and of m u/h and m h a), and u, h v
    /// and h² a of each dof.
    force: f64,
    size: f64,
    ways: Vec<f64>,
}

impl<'a> Watch<'a> {
    pub(super) fn new<T: Real>(recipe: &'a Recipe, run: &mut Simulation<'static, T>) -> Self {
        let listed = &schemes::all()[recipe.scheme];
        let is_free = recipe.is_free();
        let rests = recipe.rows.iter().all(|row| row.amplitude == 0.0) && recipe.supports.is_empty();
        let is_spring = |row: &Row| {
            use ContactLaw::{AugmentedLagrangian, Penalty, PowerLaw};
            matches!(row.law, Penalty { .. } | PowerLaw { .. } | AugmentedLagrangian { .. }) && row.friction.is_none()
        };
        let mut watch = Self {
            recipe,
            // (Nor does anything move without mass: its energy is rounding.)
            explicit_on_springs: listed.critical.is_some() && recipe.rows.iter().all(is_spring) && recipe.has_mass(),
            on_positions: listed.takes_corrections(),
            is_free,
            conserves: rests && recipe.load.constant.is_empty(),
            start: run.energy().total().value(),
            momentum: Vec::new(),
            force: 0.0,
            size: 0.0,
            ways: vec![0.0; recipe.dofs()],
        };
        // (Equalities may have taken all motion at the start.)
        let [length, mass, time] = recipe.units;
        let products = recipe.mass.iter().zip(&recipe.velocity).map(|(m, v)| m * v.abs());
        watch.size = products.sum::<f64>() * mass * length / time;
        watch.see(run.state(), recipe.step_size());
        watch.momentum = watch.momenta(run);
        watch
    }

    /// After a step.
    pub(super) fn look<T: Real>(&mut self, run: &mut Run<'_, T>, verdict: &mut Verdict) -> Option<Finding> {
        let step = run.step;
        let find = |what: &'static str, words: String| Some(Finding { what, step, words });
        let total = run.run.energy().total().value();
        let state = run.run.state();
        let contacts = state.contacts();
        let lists = [
            ("u", state.displacement()),
            ("v", state.velocity()),
            ("a", state.acceleration()),
            ("gaps", contacts.gaps()),
            ("forces", contacts.forces()),
            ("raw forces", contacts.raw_forces()),
            ("impulses", contacts.impulses()),
        ];
        if let Some((name, _)) = lists.iter().find(|(_, list)| list.iter().any(|x| !x.is_finite())) {
            return find("not finite", name.to_string());
        }
        // (A run without correction may grow beyond numbers whose squares there are.)
        let overflows = self.size > T::max_value().value().sqrt() * 1e-3;
        if !total.is_finite() && !overflows {
            return find("not finite", format!("energy {total}"));
        }
        self.see(state, run.run.step_size());
        let finding = self.complementarity(state, run.run.step_size(), step).or_else(|| self.cone(run, step));
        if finding.is_some() {
            return finding;
        }
        if self.conserves {
            let gain = if self.start > 0.0 { total / self.start } else { 0.0 };
            verdict.gain = verdict.gain.max(gain);
            if self.explicit_on_springs && gain > GAIN {
                return find("energy grows", format!("to {gain:e} of that at the start"));
            }
        }
        if self.is_free {
            let now = self.momenta(&run.run);
            let change = now.iter().zip(&self.momentum).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
            let share = change / self.size.max(f64::MIN_POSITIVE);
            verdict.momentum = verdict.momentum.max(share);
            // (A correction that sets a to zero is known to change momentum; single precision is looked at in double.)
            let allowed = match self.recipe.linear_solver {
                Solving::ConjugateGradients => MOMENTUM_BY_ITERATION,
                _ => MOMENTUM,
            };
            if self.recipe.conserves_momentum() && self.recipe.precision == Precision::Double && share > allowed {
                return find("momentum changes", format!("by {share:e} of Σ m (|v| + |u|/h + h |a|)"));
            }
        }
        None
    }

    /// Rigid rows are not violated, push, and push only where they are closed.
    fn complementarity<T: Real>(&mut self, state: &State<T>, h: f64, step: usize) -> Option<Finding> {
        let find = |what: &'static str, words: String| Some(Finding { what, step, words });
        let contacts = state.contacts();
        let eps = T::epsilon().value();
        let forces = contacts.raw_forces().iter().chain(contacts.forces());
        self.force = forces.fold(self.force, |most, force| most.max(force.value().abs()));
        // What forces keep from happening is known to its rounding.
        let mut forced = vec![0.0; self.recipe.dofs()];
        let moved = |dof: usize, force: f64| {
            let m = self.recipe.mass[dof] * self.recipe.units[1];
            let way = if m > 0.0 { h * h * force.abs() / m } else { f64::INFINITY };
            if force == 0.0 { 0.0 } else { way }
        };
        for (row, raw) in self.recipe.rows.iter().zip(contacts.raw_forces()) {
            for &(dof, x) in &row.terms {
                forced[dof] += moved(dof, x * raw.value());
            }
        }
        // What the force of a row moves its own gap by.
        let push = |row: &Row, raw: f64| row.terms.iter().map(|&(dof, x)| x.abs() * moved(dof, x * raw)).sum::<f64>();
        let way = |dof: usize, x: f64| x.abs() * self.ways[dof].max(forced[dof]);
        let size = |row: &Row| {
            let product: f64 = row.terms.iter().map(|&(dof, x)| way(dof, x)).sum();
            product + (row.gap.abs() + row.amplitude.abs()) * self.recipe.units[0]
        };
        // (What iterates is accurate for the largest row.)
        let iterates =
            self.recipe.contact_solver.iterates() || self.recipe.rows.iter().any(|row| row.friction.is_some());
        let largest = self.recipe.rows.iter().map(size).fold(0.0, f64::max);
        // (That of a problem with friction may be a slip.)
        let slips = self.recipe.rows.iter().filter_map(|row| row.friction.as_ref()).flat_map(|(_, tangents)| tangents);
        let slip = |tangent: &Vec<(usize, f64)>| tangent.iter().map(|&(dof, x)| way(dof, x)).sum::<f64>();
        let slip = slips.map(slip).fold(0.0, f64::max);
        for (r, row) in self.recipe.rows.iter().enumerate() {
            let (gap, raw) = (contacts.gaps()[r].value(), contacts.raw_forces()[r].value());
            if row.law != ContactLaw::Rigid {
                continue;
            }
            if raw < -16.0 * eps * self.force {
                return find("a rigid row pulls", format!("row {r}: {raw:e}"));
            }
            if !self.on_positions {
                continue;
            }
            let size = if iterates { largest } else { size(row) };
            // (Solvers accept 1e-12 of the largest offset.)
            let bound = ROUNDING * (eps.sqrt() * size + 5e2 * eps * largest) + 1e2 * eps.max(1e-14) * slip;
            if gap < -bound {
                return find("a gap is violated", format!("row {r}: {gap:e} of {size:e}"));
            }
            // (Solvers that iterate end where W λ of an open row is 1e-12 of the largest gap: in f32 eight roundings.)
            let idles = iterates && push(row, raw) <= 1e2 * eps.max(1e-14) * largest;
            if raw > 0.0 && gap > bound && !idles {
                return find("an open row pushes", format!("row {r}: {raw:e} at a gap of {gap:e} of {size:e}"));
            }
        }
        None
    }

    fn cone<T: Real>(&self, run: &Run<'_, T>, step: usize) -> Option<Finding> {
        let contacts = run.run.state().contacts();
        let u = run.run.state().displacement();
        let size = u.iter().fold(0.0_f64, |most, u| most.max(u.value().abs()));
        let heaviest = self.recipe.mass.iter().fold(0.0_f64, |most, m| most.max(*m)) * self.recipe.units[1];
        let h = run.run.step_size();
        let eps = T::epsilon().value();
        let [_, mass, time] = self.recipe.units;
        let entries = self.recipe.elements.iter().flat_map(|element| &element.stiffness);
        let stiffest = entries.fold(0.0_f64, |most, k| most.max(k.abs())) * mass / (time * time);
        // (Where hardly any force is left it is that of springs, to their rounding.)
        let noise = 1e3 * eps * size * (heaviest / (h * h) + stiffest);
        for (r, row) in self.recipe.rows.iter().enumerate() {
            let Some((coefficient, _)) = row.friction else { continue };
            let rubs = contacts.friction_forces(r).iter().fold(0.0_f64, |size, f| size.hypot(f.value()));
            let most = coefficient * contacts.forces()[r].value().max(0.0);
            let bound = most * (1.0 + 1e7 * eps) + 1e7 * eps * (1.0 + coefficient) * self.force + noise;
            if rubs > bound {
                let words = format!("row {r}: {rubs:e} beyond {most:e}, largest force {:e}", self.force);
                return Some(Finding { what: "friction beyond its cone", step, words });
            }
        }
        None
    }

    /// After a step that is refused: everything is as it was, and a second attempt ends as the first.
    pub(super) fn after_failure<T: Real>(
        &self,
        run: &mut Run<'_, T>,
        error: &Error,
        before: &State<T>,
        history: &History<T>,
    ) -> Option<Finding> {
        let step = run.step;
        let find = |what: &'static str, words: String| Some(Finding { what, step, words });
        let (name, words) = named(error);
        // (These say what has gone beyond all numbers.)
        let tells = ["StepNotFinite", "ContactNotFinite", "EnergyNotFinite"].contains(&name.as_str());
        if !tells && words.contains("NaN") {
            let largest = |values: &[T]| values.iter().fold(0.0_f64, |most, x| most.max(x.value().abs()));
            let [u, v, a] = [before.displacement(), before.velocity(), before.acceleration()].map(largest);
            return find("an error speaks of NaN", format!("{words}; u, v, a up to {u:e}, {v:e}, {a:e}"));
        }
        let now = run.run.state();
        if now != before || bits(now) != bits(before) {
            return find("a refused step changes the state", words);
        }
        if past(run.run.history()) != past(history) {
            return find("a refused step changes the history", words);
        }
        let again = run.advance().map_or_else(|error| named(&error).1, |()| "no error".into());
        if again != words {
            return find("a second attempt ends differently", format!("{words}; then: {again}"));
        }
        None
    }

    /// Whether nothing is left of the motion but what has no digits: of bodies that are held, say.
    pub(super) fn has_died_out<T: Real>(&self, state: &State<T>) -> bool {
        let least = T::min_positive_value().value().powf(0.25);
        let left = state.displacement().iter().zip(state.velocity()).zip(&self.ways);
        let h = self.recipe.step_size();
        left.into_iter().all(|((u, v), way)| u.value().abs().max(h * v.value().abs()) <= least * way)
    }

    /// Along each axis.
    fn momenta<T: Real>(&self, run: &Simulation<'static, T>) -> Vec<f64> {
        let Recipe { axes, .. } = *self.recipe;
        let unit = |axis: usize| -> Vec<T> {
            (0..self.recipe.dofs()).map(|dof| if dof % axes == axis { T::one() } else { T::zero() }).collect()
        };
        (0..axes).map(|axis| run.momentum(&unit(axis)).map_or(f64::NAN, Real::value)).collect()
    }

    /// What rounding is measured by.
    fn see<T: Real>(&mut self, state: &State<T>, h: f64) {
        let motion = || state.displacement().iter().zip(state.velocity()).zip(state.acceleration());
        let speed = |((u, v), a): ((&T, &T), &T)| u.value().abs() / h + v.value().abs() + h * a.value().abs();
        let speeds: Vec<f64> = motion().map(speed).collect();
        let lumped = self.recipe.mass.iter().zip(&speeds).map(|(m, v)| m * v).sum::<f64>();
        // (A bar's consistent mass: three times what its two dofs share, on each of them.)
        let shared = self.recipe.elements.iter().filter(|element| element.shared_mass > 0.0);
        let shared = shared.map(|e| 3.0 * e.shared_mass * e.dofs.iter().map(|&dof| speeds[dof]).sum::<f64>());
        self.size = self.size.max((lumped + shared.sum::<f64>()) * self.recipe.units[1]);
        for (way, ((u, v), a)) in self.ways.iter_mut().zip(motion()) {
            *way = way.max(u.value().abs()).max(h * v.value().abs()).max(h * h * a.value().abs());
        }
    }
}

/// Past states, and the step that made the newest.
fn past<T: Real>(history: &History<T>) -> Vec<u64> {
    let states = (1..history.len()).filter_map(|k| history.past(k)).flat_map(|(u, v, a)| [u, v, a].concat());
    states.map(|x| x.value().to_bits()).chain([history.step_size().to_bits()]).collect()
}

fn bits<T: Real>(state: &State<T>) -> Vec<u64> {
    let lists = [state.displacement(), state.velocity(), state.acceleration()];
    lists.concat().into_iter().map(|x| x.value().to_bits()).chain([state.time().to_bits()]).collect()
}
