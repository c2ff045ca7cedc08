//! Elastic bodies: two slabs that strike each other obliquely, and a ball that is moved sideways while it presses.

use crate::rows::{BATHE, CHUNG_HULBERT, COMPOSITE, Correction, TRAPEZOIDAL, Table};
use contact_dynamics_scenes::mindlin::Press;
use contact_dynamics_scenes::two_slabs::TwoSlabs;
use example_support::output::decimal;

pub(crate) fn tables(quick: bool) -> Vec<String> {
    vec![slabs(quick), partial_slip(quick)]
}

fn slabs(quick: bool) -> String {
    let (elements, phases) = if quick { (20, 2) } else { (50, 10) };
    let title = format!(
        "Two slabs of different impedance, {elements} and {} elements, {phases} phases: mean errors of pressure and \
         friction over those at the impact, largest friction over that",
        4 * elements
    );
    let steps = [1e-3, 2.5e-4];
    let of = |h: f64| ["pressure %", "friction %", "largest"].map(|figure| format!("h = {} ms: {figure}", 1e3 * h));
    let figures = steps.map(of).concat();
    let head: Vec<&str> = ["scheme", "correction"].into_iter().chain(figures.iter().map(String::as_str)).collect();
    let mut table = Table::new(&title, &head);
    let pair = TwoSlabs::new(elements);
    for scheme in [TRAPEZOIDAL, COMPOSITE, CHUNG_HULBERT, BATHE] {
        for correction in [Correction::None, Correction::History, Correction::Splitting] {
            if correction.serves(scheme) {
                let of = |h: f64| {
                    let run = |gap| pair.run((scheme.make)(), correction.correctors(), h, gap);
                    pair.measured(phases, h, run)
                        .map(|[pressure, friction, largest]| [100.0 * pressure, 100.0 * friction, largest])
                };
                table.row(&[scheme.name, correction.name()], [2, 2, 3], steps.map(of).into());
            }
        }
    }
    table.text()
}

/// Cattaneo and Mindlin: tangential force and radius of the circle that sticks while the ball is moved to gross slip.
fn partial_slip(quick: bool) -> String {
    let (across, steps) = if quick { (4, 5) } else { (10, 10) };
    let press = Press::new(across, 0.3);
    let title = format!(
        "A ball pressed on a half-space and moved sideways (Cattaneo, Mindlin), {across} elements across the contact \
         radius a: tangential force over that of gross slip by the way over that to gross slip, and radius of the \
         circle that sticks by the force, both beside the exact ones"
    );
    let head = ["way", "Q/(μP)", "exact", "error %", "stick radius/a", "exact", "error %"];
    let mut table = Table::new(&title, &head);
    match press.moved(steps) {
        Ok(loads) => {
            for (step, load) in (1..).zip(loads).take(steps as usize - 1) {
                let way = f64::from(step) / f64::from(steps);
                let force = load.tangential / (press.friction * load.normal);
                let [exact_force, stick, exact_stick] =
                    [1.0 - (1.0 - way).powf(1.5), load.stick / load.radius, (1.0 - force).cbrt()];
                let error = |found: f64, exact: f64| 100.0 * (found / exact - 1.0);
                let cells =
                    [force, exact_force, error(force, exact_force), stick, exact_stick, error(stick, exact_stick)];
                table.row(&[&decimal(way, 1)], [4, 4, 2, 4, 4, 2], vec![Ok(cells)]);
            }
        }
        Err(error) => table.row(&["–"], [0], vec![Err::<[f64; 1], _>(error)]),
    }
    table.text()
}
