//! Recipes from seeds.

use super::bodies::{Bodies, Spread};
use super::contacts::{Setting, law};
use super::recipe::{Contacting, Control, Load, Precision, Recipe, Row, Solving, Support, Tangent, Twin};
use crate::surfaces::{decades, pick};
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::schemes::{self, Listed};

/// What scenes are drawn as.
pub const KINDS: [&str; 9] =
    ["bars", "plate", "cloud", "pile", "block", "hardening bars", "squeeze", "rubber", "lattices"];

/// Of so many scenes one is of lattices, which take a thousand times as long as others.
const LARGE: f64 = 4000.0;

impl Recipe {
    /// The recipe of a seed.
    #[must_use]
    pub fn of_seed(seed: u64) -> Self {
        let mut random = Congruential(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5eed);
        (0..4).for_each(|_| _ = random.unit());
        let random = &mut random;
        let kind = if random.unit() * LARGE < 1.0 { "lattices" } else { pick(&KINDS[..KINDS.len() - 1], random) };
        let spread = Spread::new(random);
        let bodies = match kind {
            "plate" => Bodies::plate(spread, random),
            "cloud" => Bodies::cloud(spread, random),
            "pile" => Bodies::pile(spread, random),
            "block" => Bodies::block(spread, random),
            "rubber" => Bodies::rubber(spread, random),
            "lattices" => Bodies::lattices(spread, random),
            _ => Bodies::chains(spread, random),
        };
        let all = schemes::all();
        let scheme = (random.unit() * all.len() as f64) as usize;
        let h = step(&bodies, &all[scheme], random);
        Self::with(kind, bodies, scheme, h, random)
    }

    /// The same scene with contact solved without W where that is possible, and a second run with the same bits.
    #[must_use]
    pub fn without_w(mut self) -> Self {
        self.contact_solver = Contacting::WithoutW;
        if !matches!(self.twin, Twin::Resumed | Twin::Filed | Twin::PowersOfTwo(_) | Twin::Threaded) {
            self.twin = Twin::Repeated;
        }
        self
    }

    fn with(kind: &'static str, mut bodies: Bodies, scheme: usize, h: f64, random: &mut Congruential) -> Self {
        let listed = &schemes::all()[scheme];
        let n = bodies.mass.len();
        let precision = pick(&[Precision::Double, Precision::Double, Precision::Double, Precision::Single], random);
        // (Squares of what happens must be numbers.)
        let room = if precision == Precision::Single { 0.25 } else { 1.0 };
        let speed = decades(-6.0 * room, 6.0 * room, random);
        let way = speed * h;
        let free = pick(&[true, false, false], random) && kind != "pile" && kind != "squeeze";
        let softest = bodies.mass.iter().fold(f64::INFINITY, |least, m| least.min(*m)) / (h * h);
        let stiffest = bodies.elements.iter().flat_map(|e| &e.stiffness).fold(0.0_f64, |most, k| most.max(k.abs()));
        let heaviest = bodies.mass.iter().fold(0.0_f64, |most, m| most.max(*m));
        // (Of springs that stop the lightest mass explicit steps take some, and refuse others.)
        let unit = if listed.critical.is_some() {
            1e-2 * softest
        } else if stiffest > 0.0 {
            stiffest
        } else {
            heaviest / (h * h)
        };
        let setting = Setting {
            way,
            h,
            moves: !free && pick(&[true, false], random),
            rubs: bodies.axes > 1 && pick(&[true, false], random),
            law: law(unit, h, listed, random),
            starts_closed: pick(&[true, false, false], random),
            free,
        };
        let rows = match kind {
            "pile" => setting.stacked(n / 2, random),
            "squeeze" => setting.levers(n, random),
            "block" | "rubber" if !free && pick(&[true, true, false], random) => setting.floor(&bodies, random),
            _ => setting.rows(&bodies, random),
        };
        extras(kind, way, &mut bodies, random);
        let damping = match pick(&[0, 0, 0, 1, 2], random) {
            0 => [0.0; 2],
            1 => [decades(-3.0, 0.0, random) / h, 0.0],
            _ => [0.0, h * decades(-3.0, 1.0, random)],
        };
        let damping = if free { [0.0, damping[1]] } else { damping };
        let supports = if !free && pick(&[true, false, false, false], random) {
            let amplitude = pick(&[0.0, 1.0], random) * way * random.within(0.1, 3.0);
            vec![Support {
                dof: (random.unit() * n as f64) as usize,
                amplitude,
                frequency: random.within(0.01, 0.3) / h,
            }]
        } else {
            Vec::new()
        };
        let mut velocity = match pick(&[0, 1, 2], random) {
            0 => random.vector(n, speed),
            1 => vec![-speed; n],
            _ => vec![0.0; n],
        };
        let mut displacement =
            if pick(&[true, false, false, false], random) { random.vector(n, way) } else { vec![0.0; n] };
        for support in &supports {
            displacement[support.dof] = 0.0;
            velocity[support.dof] = support.amplitude * support.frequency;
        }
        let load =
            if free || pick(&[true, false], random) { Load::default() } else { load(kind, &bodies, way, h, random) };
        let mut recipe = Self {
            kind,
            precision,
            units: pick(&[[true; 3], [false; 3]], random)
                .map(|natural| if natural { 1.0 } else { decades(-4.0 * room, 4.0 * room, random) }),
            axes: bodies.axes,
            mass: bodies.mass,
            elements: bodies.elements,
            damping,
            displacement,
            velocity,
            load,
            supports,
            rows,
            scheme,
            correction: if listed.takes_corrections() { correction(random) } else { Correction::None },
            contact_solver: contact_solver(random),
            linear_solver: linear_solver(kind, random),
            tangent: pick(&[Tangent::Full, Tangent::Modified, Tangent::LineSearch], random),
            h,
            steps: if kind == "lattices" { 6 } else { pick(&[8, 24, 24, 60], random) },
            control: control(way, random),
            changes: Vec::new(),
            balance: pick(&[true, false], random),
            twin: Twin::Repeated,
        };
        if pick(&[true, false, false], random) {
            let factors: &[f64] =
                if listed.critical.is_some() { &[0.5, 0.25, 0.9, 0.02] } else { &[0.5, 2.0, 0.1, 1.7, 0.01, 20.0] };
            let count = pick(&[1, 2, 5], random);
            recipe.changes = (0..count).map(|_| ((random.unit() * 20.0) as usize, pick(factors, random))).collect();
            recipe.changes.sort_by_key(|change| change.0);
            // (Step control has its own say: the nominal step stays.)
            recipe.changes.retain(|_| recipe.control == Control::None);
        }
        open(&mut recipe);
        recipe.twin = twin(&recipe, random);
        recipe
    }
}

/// A step that the scheme takes: shares of the period of the fastest motion that there may be.
fn step(bodies: &Bodies, listed: &Listed, random: &mut Congruential) -> f64 {
    let highest = bodies.highest();
    if highest == 0.0 {
        return decades(-2.0, 2.0, random);
    }
    match listed.critical {
        Some(critical) => random.within(0.2, 0.7) * critical / highest,
        None => decades(-1.0, 2.0, random) / highest,
    }
}

/// Shared and missing masses, springs that harden.
fn extras(kind: &str, way: f64, bodies: &mut Bodies, random: &mut Congruential) {
    if pick(&[true, false, false], random) {
        let least = bodies.mass.iter().fold(f64::INFINITY, |least, m| least.min(*m));
        for element in bodies.elements.iter_mut().filter(|element| element.dofs.len() == 2) {
            element.shared_mass = least * random.within(0.02, 0.3);
        }
    }
    if kind == "hardening bars" {
        for element in bodies.elements.iter_mut().filter(|element| element.dofs.len() == 2) {
            element.hardening = element.stiffness[0] * decades(-2.0, 1.0, random) / (way * way);
        }
    }
    if kind == "rubber" {
        // Edges are some ways long.
        let length = way * decades(0.5, 3.0, random);
        for rubber in bodies.elements.iter_mut().filter_map(|element| element.rubber.as_mut()) {
            rubber.gradients.as_flattened_mut().iter_mut().for_each(|x| *x /= length);
            rubber.lambda *= length * length;
            rubber.mu *= length * length;
        }
    }
    if kind == "lattices" {
        return;
    }
    if pick(&[true, false, false, false, false], random) {
        // Some dofs lose their mass; those that nothing holds are refused.
        for mass in &mut bodies.mass {
            if random.unit() < 0.2 {
                *mass = 0.0;
            }
        }
    }
}

/// Gravity, or forces on all dofs, as large as those that stop a body within some steps.
fn load(kind: &str, bodies: &Bodies, way: f64, h: f64, random: &mut Congruential) -> Load {
    let n = bodies.mass.len();
    let gravity = kind == "pile" || pick(&[true, false], random);
    let size = way / (h * h) * decades(-2.0, 0.0, random);
    let force = |dof: usize, random: &mut Congruential| match gravity {
        true if dof % bodies.axes + 1 == bodies.axes => -size * bodies.mass[dof],
        true => 0.0,
        false => size * bodies.mass[dof] * random.signed(),
    };
    let constant = (0..n).map(|dof| force(dof, random)).collect();
    let swings = pick(&[0.0, 1.0], random);
    let amplitude = (0..n).map(|dof| swings * size * bodies.mass[dof] * random.signed()).collect();
    Load { constant, amplitude, frequency: random.within(0.01, 0.3) / h }
}

/// Rows are open where the run starts.
fn open(recipe: &mut Recipe) {
    for row in &mut recipe.rows {
        let product: f64 = row.terms.iter().map(|&(dof, x)| x * recipe.displacement[dof]).sum();
        match row.law {
            ContactLaw::Equality => {
                (row.gap, row.amplitude) = (-product, 0.0);
            }
            _ => row.gap = (row.gap - product).max(row.gap),
        }
    }
}

fn correction(random: &mut Congruential) -> Correction {
    let any = pick(&Correction::ALL, random);
    pick(&[Correction::None, Correction::History, Correction::History, any, any], random)
}

fn contact_solver(random: &mut Congruential) -> Contacting {
    use Contacting::{Default, GaussSeidel, Pivoting};
    pick(&[Default, Default, Default, Default, Default, Pivoting, Pivoting, GaussSeidel, GaussSeidel], random)
}

fn linear_solver(kind: &str, random: &mut Congruential) -> Solving {
    use Solving::{ByBody, Cholesky, ConjugateGradients, Default, Lu, Tridiagonal};
    match kind {
        "lattices" => pick(&[Default, Cholesky, ByBody, ConjugateGradients], random),
        "bars" => pick(&[Default, Default, Default, Default, Cholesky, Lu, ConjugateGradients, Tridiagonal], random),
        _ => pick(&[Default, Default, Default, ByBody, Cholesky, Lu, ConjugateGradients, Default], random),
    }
}

fn control(way: f64, random: &mut Congruential) -> Control {
    let tolerance = way * decades(-3.0, 1.0, random);
    let none = Control::None;
    let choices = [
        none,
        none,
        none,
        none,
        Control::Halving,
        Control::Halving,
        Control::LocalError(tolerance),
        Control::ContactChanges(1),
    ];
    pick(&choices, random)
}

fn twin(recipe: &Recipe, random: &mut Congruential) -> Twin {
    let mut powers = |most: f64| [0, 0, 0].map(|_: i32| random.within(-most, most + 1.0).floor() as i32);
    let (mut two, ten) = (powers(if recipe.precision == Precision::Single { 4.0 } else { 20.0 }), powers(3.0));
    // Roots of masses and of M/h or C are factors; lengths of power laws have exponents that are no whole numbers.
    (two[1], two[2]) = (2 * two[1], two[2] & !1);
    if recipe.rows.iter().any(|row| matches!(row.law, ContactLaw::PowerLaw { .. })) {
        two[0] = 0;
    }
    let moving = if recipe.is_free() { Twin::Moving } else { Twin::Permuted };
    if recipe.linear_solver == Solving::Lu && !recipe.supports.is_empty() {
        // (Ones on the diagonal of prescribed dofs have no unit.)
        two = [two[0], 0, 0];
    }
    let is_direct = !recipe.contact_solver.iterates() && recipe.linear_solver != Solving::ConjugateGradients;
    // With friction, and with rows that follow from others, there may be more than one solution; of rows that touch at
    // the start without pressing rounding decides which open.
    let count = |holds: fn(&Row) -> bool| recipe.rows.iter().filter(|row| holds(row)).count();
    let is_unique = (recipe.rows.len() == 1 || count(|row| row.friction.is_some()) == 0)
        && count(|row| row.law == ContactLaw::Equality) <= 1
        && count(|row| row.law != ContactLaw::Equality && row.gap == 0.0) == 0;
    if recipe.kind == "lattices" {
        return Twin::Threaded;
    }
    if !is_direct || !is_unique {
        return pick(&[Twin::Repeated, Twin::Resumed, Twin::Filed, Twin::PowersOfTwo(two)], random);
    }
    let choices = [
        Twin::Repeated,
        Twin::Resumed,
        Twin::Filed,
        Twin::PowersOfTwo(two),
        Twin::PowersOfTwo(two),
        Twin::Permuted,
        Twin::PowersOfTen(ten),
        moving,
    ];
    pick(&choices, random)
}
