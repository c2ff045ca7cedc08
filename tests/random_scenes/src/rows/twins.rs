//! The second run of a scene, and how it must agree with the first.

use super::recipe::{Precision, Recipe, Twin};
use super::run::{Finding, Run, Verdict, named};
use contact_dynamics::{Error, Real, Simulation};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::schemes;

/// What is compared of a state, in natural units.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Trace {
    /// u, v, a, by dof; reported forces and raw ones, by row.
    lists: [Vec<f64>; 5],
    /// Steps that were refused so far, and taken again with half the size.
    refused: u64,
    /// The size of the next step.
    h: f64,
}

/// How much faster than differences that roundings of the data make those of a twin may grow.
const GROWTH: f64 = 1e5;

/// Runs with other roundings of the data, of each way to write a scene that seems to fail.
const MORE_ROUNDINGS: u64 = 14;

const NAMES: [&str; 5] = ["u", "v", "a", "forces", "raw forces"];

impl Trace {
    pub(super) fn of<T: Real>(recipe: &Recipe, run: &Simulation<'static, T>) -> Self {
        let [length, mass, time] = recipe.units;
        let state = run.state();
        let contacts = state.contacts();
        let force = mass * length / (time * time);
        let list = |x: &[T], unit: f64| x.iter().map(|x| x.value() / unit).collect::<Vec<_>>();
        Self {
            lists: [
                list(state.displacement(), length),
                list(state.velocity(), length / time),
                list(state.acceleration(), length / (time * time)),
                list(contacts.forces(), force),
                list(contacts.raw_forces(), force),
            ],
            refused: run.statistics().refused_steps,
            h: run.step_size() / time,
        }
    }

    /// Whether some number but zero is outside of a range.
    fn leaves(&self, [least, most]: [f64; 2]) -> bool {
        self.lists.iter().flatten().any(|x| *x != 0.0 && !(least..=most).contains(&x.abs()))
    }

    fn is_same(&self, other: &Self, least: f64) -> bool {
        // (Zeros have no sign here, and what is subnormal has lost its digits.)
        let same = |x: &f64, y: &f64| x == y || x.abs().max(y.abs()) < least;
        self.lists.iter().flatten().zip(other.lists.iter().flatten()).all(|(x, y)| same(x, y))
    }

    /// Forces as they act on dofs: those of rows that follow from others are not unique. Accelerations of schemes that
    /// impose contact on velocities are left out: behind an impact rounding decides whether a contact counts as closed,
    /// and they with it.
    fn on_dofs(mut self, recipe: &Recipe) -> Self {
        if !schemes::all()[recipe.scheme].takes_corrections() {
            self.lists[2].fill(0.0);
        }
        for list in &mut self.lists[3..] {
            let mut on_dofs = vec![0.0; recipe.dofs()];
            for (row, force) in recipe.rows.iter().zip(&*list) {
                row.terms.iter().for_each(|&(dof, x)| on_dofs[dof] += x * force);
            }
            *list = on_dofs;
        }
        self
    }

    /// Back to the places of the first run.
    fn replaced(&self, dofs: &[usize], rows: &[usize]) -> Self {
        let by_dof = |x: &[f64]| dofs.iter().map(|&dof| x[dof]).collect::<Vec<_>>();
        let by_row = |x: &[f64]| {
            let mut y = vec![0.0; x.len()];
            x.iter().zip(rows).for_each(|(x, &row)| y[row] = *x);
            y
        };
        let [u, v, a, forces, raw] = &self.lists;
        let lists = [by_dof(u), by_dof(v), by_dof(a), by_row(forces), by_row(raw)];
        Self { lists, ..*self }
    }
}

/// The largest of each list so far, in all steps, or what the others make of it in a step: what differences are
/// measured by.
#[derive(Default)]
struct Scales([f64; 5]);

impl Scales {
    fn see(&mut self, recipe: &Recipe, trace: &Trace) {
        for (scale, list) in self.0.iter_mut().zip(&trace.lists) {
            *scale = list.iter().fold(*scale, |most, x| most.max(x.abs()));
        }
        let h = recipe.h;
        let lightest = recipe.masses().fold(f64::INFINITY, f64::min);
        let [u, v, a, forces, raw] = self.0;
        let forces = forces.max(raw);
        let a = a.max(forces / lightest).max(v / h);
        let v = v.max(h * a);
        self.0 = [u.max(h * v), v, a, forces, forces];
    }

    /// What rounding within a step makes of accelerations and of forces at most, and rounding of the data need not
    /// show. W of a light body between heavy ones is a sum in which these are lost: forces are known to ε times the
    /// ratio of masses. And gaps are known to ε u, which forces make up for within a step: with ε u/h² for the
    /// accelerations, and on the heaviest body with so much times its mass, each a share of what it is measured by.
    fn known(&self, recipe: &Recipe, h: f64, eps: f64) -> [f64; 2] {
        /// Roundings of an entry of W, or of a gap.
        const ROUNDINGS: f64 = 16.0;
        let [u, _, a, forces, _] = self.0;
        let heaviest = recipe.masses().fold(0.0, f64::max);
        let ratio = recipe.masses().fold(1.0_f64, |most, m| most.max(heaviest / m));
        let share = |of_gaps: f64, scale: f64| if scale > 0.0 { of_gaps / scale } else { 0.0 };
        let gaps = u / (h * h);
        [share(gaps, a), share(heaviest * gaps, forces)].map(|share| ROUNDINGS * eps * ratio.max(share))
    }

    /// The largest difference, and of what; of accelerations and forces beyond a share that is `known` to be rounding.
    fn difference(&self, one: &Trace, other: &Trace, [of_a, of_forces]: [f64; 2]) -> (f64, &'static str) {
        let mut worst = (0.0, "");
        let known = [0.0, 0.0, of_a, of_forces, of_forces];
        let lists = one.lists.iter().zip(&other.lists).zip(self.0).zip(NAMES).zip(known);
        for ((((x, y), scale), name), known) in lists {
            let largest = x.iter().zip(y).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
            let share = if scale > 0.0 { (largest / scale - known).max(0.0) } else { 0.0 };
            if share > worst.0 {
                worst = (share, name);
            }
        }
        worst
    }
}

/// Runs the twin, and compares it with the states of the first run.
pub(super) fn compare<T: Real>(recipe: &Recipe, first: &[Trace], verdict: &mut Verdict) -> Option<Finding> {
    if recipe.is_exact() { exact::<T>(recipe, first, verdict) } else { close::<T>(recipe, first, verdict) }
}

impl<T: Real> Run<'_, T> {
    /// Control halves a step, or lets it grow, or does not: where one of two runs decides otherwise they are discretized
    /// differently, and agree to the order of the scheme.
    fn steps_as(&self, trace: &Trace) -> bool {
        let size = self.run.step_size() / self.recipe.units[2];
        self.run.statistics().refused_steps == trace.refused && (size / trace.h - 1.0).abs() < 1e-6
    }
}

/// The same bits, and the same error where the first run ended.
fn exact<T: Real>(recipe: &Recipe, first: &[Trace], verdict: &mut Verdict) -> Option<Finding> {
    let mut other = recipe.clone();
    if let Twin::PowersOfTwo(exponents) = recipe.twin {
        for (unit, exponent) in other.units.iter_mut().zip(exponents) {
            *unit *= 2.0_f64.powi(exponent);
        }
    }
    let find = |what: &'static str, step: usize, words: String| Some(Finding { what, step, words });
    let what = match recipe.twin {
        Twin::Repeated => "a repeated run differs",
        Twin::Resumed => "a resumed run differs",
        Twin::Filed => "a run resumed from a file differs",
        Twin::Threaded => "threads change bits",
        _ => "units of powers of two change bits",
    };
    let mut run = match (Run::<T>::new(&other), verdict.built) {
        (Ok(run), true) => run,
        (Ok(_), false) => return find(what, 0, "the first was refused, the second not".into()),
        (Err(_), false) => return None,
        (Err(error), true) => return find(what, 0, format!("the second is refused: {error}")),
    };
    let [beyond, lost] = [T::max_value().value().sqrt() * 1e-3, (T::min_positive_value() / T::epsilon()).value()];
    for (step, trace) in first.iter().enumerate() {
        if step > 0
            && let Err(error) = run.advance()
        {
            // (As where it is resumed, when the step changes after that.)
            let resumed = matches!(recipe.twin, Twin::Resumed | Twin::Filed) && step > first.len() / 2;
            if resumed && matches!(error, Error::BeyondStability { .. }) {
                return None;
            }
            // (What is beyond the numbers whose squares there are in one of the units is not there in all of them.)
            if matches!(recipe.twin, Twin::PowersOfTwo(_)) && trace.leaves([0.0, beyond]) {
                return None;
            }
            return find(what, step, format!("the second is refused: {error}"));
        }
        let of_second = Trace::of(&other, &run.run);
        // (Nor are numbers without digits, on which contacts close by chance, or energies without.)
        if matches!(recipe.twin, Twin::PowersOfTwo(_)) && [trace, &of_second].iter().any(|x| x.leaves([lost, beyond])) {
            return None;
        }
        let speed = trace.lists[1].iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        if let Twin::PowersOfTwo([length, mass, time]) = recipe.twin
            && speed > 0.0
            && speed * speed < lost * 2.0_f64.powi((2 * length + mass - 2 * time).abs())
        {
            return None;
        }
        if !trace.is_same(&of_second, T::min_positive_value().value().sqrt() * 1e14) {
            let mut scales = Scales::default();
            scales.see(recipe, trace);
            let (size, name) = scales.difference(trace, &of_second, [0.0; 2]);
            return find(what, step, format!("{name} by {size:e}"));
        }
        if matches!(recipe.twin, Twin::Resumed | Twin::Filed) && step == first.len() / 2 {
            run = match run.resumed() {
                Ok(run) => run,
                // (By now it may have grown too stiff for explicit steps.)
                Err(Error::BeyondStability { .. }) => return None,
                Err(error) => return find(what, step, format!("it is refused: {error}")),
            };
        }
        verdict.compared += 1;
    }
    if let Some((before, _)) = verdict.refused.as_ref().filter(|_| first.len() <= recipe.steps) {
        let name = run.advance().map_or_else(|error| named(&error).0, |()| "no error".into());
        // (Where a step goes beyond all numbers it depends on the unit which of them are the first.)
        let overflows = matches!(recipe.twin, Twin::PowersOfTwo(_)) && before.ends_with("NotFinite");
        // (As above.)
        let resumed = matches!(recipe.twin, Twin::Resumed | Twin::Filed) && name == "BeyondStability";
        if name != *before && !overflows && !resumed {
            return find(what, first.len(), format!("{before} before, now {name}"));
        }
    }
    None
}

/// Differences grow no faster than those that roundings of the data make; where these are large, rounding decides.
fn close<T: Real>(recipe: &Recipe, first: &[Trace], verdict: &mut Verdict) -> Option<Finding> {
    // (What was made smaller may be held from outside.)
    if recipe.twin == Twin::Moving && !recipe.is_free() {
        return None;
    }
    let eps = T::epsilon().value();
    let decides = eps.powf(0.6);
    let other = Written::new(recipe);
    let runs = (Run::<T>::new(&other.recipe), Run::<T>::new(&other.rounded[0]), Run::<T>::new(&other.rounded[1]));
    let (Ok(mut run), Ok(mut one), Ok(mut two)) = runs else { return None };
    let (mut scales, mut least, mut most) = (Scales::default(), 0.0_f64, 0.0_f64);
    // (Raw forces keep for some steps what rounding was in one, also where control has let the size grow since.)
    let mut shortest = f64::INFINITY;
    for (step, trace) in first.iter().enumerate() {
        // (Control has chosen the size of the next step when this one is over.)
        let (start, mut h) = (run.run.time(), run.run.step_size());
        if step > 0 {
            // (What is refused by one of them is at the edge of being refused.)
            if run.advance().and(one.advance()).and(two.advance()).is_err() {
                break;
            }
            h = run.run.time() - start;
        }
        if ![&run, &one, &two].into_iter().all(|run| run.steps_as(trace)) {
            break;
        }
        let trace = trace.clone().on_dofs(recipe);
        scales.see(recipe, &trace);
        for run in [&one, &two] {
            let of_run = Trace::of(run.recipe, &run.run).on_dofs(recipe);
            least = least.max(scales.difference(&trace, &of_run, [0.0; 2]).0);
        }
        shortest = shortest.min(h);
        let known = scales.known(recipe, shortest / other.recipe.units[2], eps);
        let (size, name) = scales.difference(&trace, &other.read(&run).on_dofs(recipe), known);
        most = most.max(size);
        let allowed = |least: f64| least > decides || most <= GROWTH * (least + eps);
        if !allowed(least) {
            // (What rounding decides it may decide alike in all three by chance, and only where the scene is written
            // as its twin, whose displacements are larger.)
            least = [recipe, &other.recipe].into_iter().fold(least, |most, x| most.max(by_rounding::<T>(x, step)));
        }
        if least > decides {
            verdict.by_rounding = true;
            break;
        }
        if !allowed(least) {
            let what = match recipe.twin {
                Twin::Permuted => "another order changes results",
                Twin::Moving => "a common velocity changes results",
                _ => "units change results",
            };
            let words = format!("{name} by {most:e}, roundings of the data by {least:e}");
            return Some(Finding { what, step, words });
        }
        verdict.compared += 1;
    }
    None
}

/// The largest difference that other roundings of the data make in so many steps, until control has chosen others.
fn by_rounding<T: Real>(recipe: &Recipe, steps: usize) -> f64 {
    let traces = |recipe: &Recipe, alike: &[Trace]| {
        let mut traces = Vec::new();
        let Ok(mut run) = Run::<T>::new(recipe) else { return traces };
        while traces.len() <= steps && (traces.is_empty() || run.advance().is_ok()) {
            if alike.get(traces.len()).is_some_and(|trace| !run.steps_as(trace)) {
                break;
            }
            traces.push(Trace::of(recipe, &run.run));
        }
        traces.into_iter().map(|trace| trace.on_dofs(recipe)).collect()
    };
    let first: Vec<Trace> = traces(recipe, &[]);
    let mut most = 0.0_f64;
    for seed in 0..MORE_ROUNDINGS {
        let other = rounded(recipe, 3 + seed, T::epsilon().value());
        let mut scales = Scales::default();
        for (trace, other) in first.iter().zip(&traces(&other, &first)) {
            scales.see(recipe, trace);
            most = most.max(scales.difference(trace, other, [0.0; 2]).0);
        }
    }
    most
}

/// A scene written differently.
struct Written {
    recipe: Recipe,
    /// The scene as it was with its data rounded differently.
    rounded: [Recipe; 2],
    /// Where its dofs are, and which rows come first.
    dofs: Vec<usize>,
    rows: Vec<usize>,
    /// By axis.
    velocity: Vec<f64>,
}

impl Written {
    fn new(recipe: &Recipe) -> Self {
        let eps = if recipe.precision == Precision::Single { f32::EPSILON.into() } else { f64::EPSILON };
        let mut dofs: Vec<usize> = (0..recipe.dofs()).collect();
        let mut rows: Vec<usize> = (0..recipe.rows.len()).collect();
        let mut velocity = vec![0.0; recipe.axes];
        let mut other = recipe.clone();
        let mut random = Congruential(recipe.dofs() as u64 + 77 * recipe.steps as u64);
        match recipe.twin {
            Twin::Permuted => {
                for list in [&mut dofs, &mut rows] {
                    for i in (1..list.len()).rev() {
                        list.swap(i, (random.unit() * (i + 1) as f64) as usize);
                    }
                }
                other = recipe.permuted(&dofs, &rows);
            }
            Twin::Moving => {
                let fastest = recipe.velocity.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
                velocity.fill_with(|| 3.0 * fastest * random.signed());
                for (dof, v) in other.velocity.iter_mut().enumerate() {
                    *v += velocity[dof % recipe.axes];
                }
            }
            Twin::PowersOfTen(exponents) => {
                for (unit, exponent) in other.units.iter_mut().zip(exponents) {
                    *unit *= 10.0_f64.powi(exponent);
                }
            }
            _ => {}
        }
        Self { recipe: other, rounded: [1, 2].map(|seed| rounded(recipe, seed, eps)), dofs, rows, velocity }
    }

    /// The state of its run, as the first run would have it.
    fn read<T: Real>(&self, run: &Run<'_, T>) -> Trace {
        let mut trace = Trace::of(&self.recipe, &run.run).replaced(&self.dofs, &self.rows);
        let t = run.run.time() / self.recipe.units[2];
        let axes = self.recipe.axes;
        let [u, v, ..] = &mut trace.lists;
        for (dof, (u, v)) in u.iter_mut().zip(v).enumerate() {
            *u -= self.velocity[dof % axes] * t;
            *v -= self.velocity[dof % axes];
        }
        trace
    }
}

/// With all numbers changed by some roundings.
fn rounded(recipe: &Recipe, seed: u64, eps: f64) -> Recipe {
    let mut random = Congruential(seed);
    let mut near = |x: &mut f64| *x *= 1.0 + 4.0 * eps * random.signed();
    let mut other = recipe.clone();
    other.mass.iter_mut().for_each(&mut near);
    for element in &mut other.elements {
        // (One factor, so that rigid motions stay free.)
        let mut factor = 1.0;
        near(&mut factor);
        element.stiffness.iter_mut().for_each(|k| *k *= factor);
        if let Some(rubber) = &mut element.rubber {
            rubber.lambda *= factor;
            rubber.mu *= factor;
        }
    }
    let [u, v] = [&mut other.displacement, &mut other.velocity];
    let free = |dof: usize| other.supports.iter().all(|support| support.dof != dof);
    for list in [u, v] {
        list.iter_mut().enumerate().filter(|(dof, _)| free(*dof)).for_each(|(_, x)| near(x));
    }
    other.load.constant.iter_mut().chain(&mut other.load.amplitude).for_each(&mut near);
    for row in &mut other.rows {
        near(&mut row.gap);
        near(&mut row.amplitude);
    }
    other
}
