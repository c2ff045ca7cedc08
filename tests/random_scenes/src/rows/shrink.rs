//! The smallest scene that still fails.

use super::recipe::{Contacting, Control, Load, Precision, Recipe, Row, Solving, Support, Tangent};
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes;

/// Runs at most, while a scene is made smaller.
const ATTEMPTS: usize = 3000;

/// Scenes of more dofs are left as they are.
const LARGE: usize = 200;

/// A scene as small as can be found by leaving things out one at a time, of which `fails` still holds.
#[must_use]
pub fn shrunk(recipe: &Recipe, fails: impl Fn(&Recipe) -> bool) -> Recipe {
    let (mut least, mut attempts) = (recipe.clone(), 0);
    if recipe.dofs() > LARGE {
        return least;
    }
    loop {
        let smaller = candidates(&least).into_iter().find(|smaller| {
            attempts += 1;
            attempts <= ATTEMPTS && fails(smaller)
        });
        match smaller {
            Some(smaller) => least = smaller,
            None => return least,
        }
    }
}

/// What the scene would be without one of its parts, the largest parts first.
fn candidates(recipe: &Recipe) -> Vec<Recipe> {
    let mut all = Vec::new();
    let mut with = |change: &dyn Fn(&mut Recipe)| {
        let mut other = recipe.clone();
        change(&mut other);
        if format!("{other:?}") != format!("{recipe:?}") {
            all.push(other);
        }
    };
    for steps in [recipe.steps / 2, recipe.steps - 1] {
        if steps > 0 {
            with(&|r| r.steps = steps);
        }
    }
    for row in 0..recipe.rows.len() {
        with(&|r| _ = r.rows.remove(row));
    }
    if recipe.dofs() > 1 {
        for dof in (0..recipe.dofs()).rev() {
            with(&|r| remove(r, dof));
        }
    }
    for element in 0..recipe.elements.len() {
        with(&|r| _ = r.elements.remove(element));
        with(&|r| r.elements[element].hardening = 0.0);
        with(&|r| r.elements[element].rubber = None);
        with(&|r| r.elements[element].shared_mass = 0.0);
    }
    with(&|r| r.load = Load::default());
    with(&|r| r.load.amplitude.fill(0.0));
    with(&|r| r.supports.clear());
    for support in 0..recipe.supports.len() {
        with(&|r| r.supports[support].amplitude = 0.0);
    }
    with(&|r| r.damping = [0.0; 2]);
    with(&|r| r.changes.clear());
    for change in 0..recipe.changes.len() {
        with(&|r| _ = r.changes.remove(change));
    }
    with(&|r| r.control = Control::None);
    with(&|r| r.balance = false);
    with(&|r| r.contact_solver = Contacting::Default);
    with(&|r| r.linear_solver = Solving::Default);
    with(&|r| r.tangent = Tangent::Full);
    with(&|r| r.precision = Precision::Double);
    with(&|r| r.units = [1.0; 3]);
    with(&|r| r.correction = Correction::None);
    with(&|r| r.correction = Correction::History);
    let trapezoidal = schemes::all().iter().position(|scheme| scheme.name().starts_with("Newmark"));
    with(&|r| r.scheme = trapezoidal.unwrap_or(r.scheme));
    for row in 0..recipe.rows.len() {
        let simpler: [&dyn Fn(&mut Row); 6] = [
            &|row| row.friction = None,
            &|row| row.amplitude = 0.0,
            &|row| row.law = ContactLaw::Rigid,
            &|row| row.gap = 0.0,
            &|row| row.terms.truncate(1),
            &|row| row.terms.iter_mut().for_each(|term| term.1 = term.1.signum()),
        ];
        for change in simpler {
            with(&|r| change(&mut r.rows[row]));
        }
    }
    for dof in 0..recipe.dofs() {
        with(&|r| r.displacement[dof] = 0.0);
        with(&|r| r.velocity[dof] = 0.0);
        with(&|r| r.mass[dof] = 1.0);
    }
    for digits in [0, 1, 2] {
        with(&|r| round(r, digits));
    }
    all
}

/// Holds a dof: it is gone.
fn remove(recipe: &mut Recipe, dof: usize) {
    let later = |d: usize| d - usize::from(d > dof);
    let without = |terms: &mut Vec<(usize, f64)>| {
        terms.retain(|term| term.0 != dof);
        terms.iter_mut().for_each(|term| term.0 = later(term.0));
    };
    recipe.axes = 1;
    for list in [&mut recipe.mass, &mut recipe.displacement, &mut recipe.velocity] {
        list.remove(dof);
    }
    for list in [&mut recipe.load.constant, &mut recipe.load.amplitude] {
        if !list.is_empty() {
            list.remove(dof);
        }
    }
    recipe.elements = recipe.elements.iter().filter_map(|element| element.without(dof)).collect();
    recipe.supports.retain(|support| support.dof != dof);
    recipe.supports.iter_mut().for_each(|support: &mut Support| support.dof = later(support.dof));
    for row in &mut recipe.rows {
        without(&mut row.terms);
        if let Some((_, tangents)) = &mut row.friction {
            tangents.iter_mut().for_each(without);
            tangents.retain(|tangent| !tangent.is_empty());
        }
        row.friction.take_if(|(_, tangents)| tangents.is_empty());
    }
    recipe.rows.retain(|row| !row.terms.is_empty());
}

/// Numbers to so many digits behind the first.
fn round(recipe: &mut Recipe, digits: i32) {
    let round = |x: &mut f64| {
        if *x != 0.0 {
            let unit = 10.0_f64.powi(x.abs().log10().floor() as i32 - digits);
            *x = (*x / unit).round() * unit;
        }
    };
    let lists = [&mut recipe.mass, &mut recipe.displacement, &mut recipe.velocity];
    lists.into_iter().flatten().for_each(round);
    recipe.load.constant.iter_mut().chain(&mut recipe.load.amplitude).for_each(round);
    for row in &mut recipe.rows {
        row.terms.iter_mut().for_each(|term| round(&mut term.1));
        [&mut row.gap, &mut row.amplitude, &mut row.frequency].into_iter().for_each(round);
    }
    round(&mut recipe.h);
}
